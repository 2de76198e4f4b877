//! The course of one robot, where all others move as they will.
//!
//! States, controls and durations of steps are variables alike, and each step has to lead from its state to the next one
//! (multiple shooting: H. G. Bock, K. J. Plitt, IFAC World Congress 1984). Around what is known the problem is linear but for
//! the weights that keep steps short, and every solution of that is taken if enough of the gain that it promised is true
//! (sequential convex programming: J. Schulman et al., "Motion planning with sequential convex optimization and convex
//! collision checking", IJRR 33(9), 2014). What is to become small is the duration, and what is broken is paid for.

use fleetyard_plugin_plane::sssp::bodies::Pose;

use super::gap::{Shape, Walls};
use super::guess::{Guess, SLOWEST, Span, Steps};
use super::linear::{HEADING, RATES, Step, TIME, axes};
use super::quadratic::{Program, Row, Solution, Stage};
use crate::course::{Track, between};
use crate::plugin::Member;
use crate::robot::{Goal, State};

/// The surroundings that a robot has to keep clear of.
#[derive(Debug)]
pub(super) struct Around<'a> {
    /// Obstacles that stand.
    pub(super) walls: &'a Walls,
    /// The robot's body beside walls.
    pub(super) body_at_walls: &'a Shape,
    /// The robot's body beside what moves.
    pub(super) body: &'a Shape,
    /// Bodies that move.
    pub(super) others: Vec<(&'a Shape, &'a Track)>,
}

/// Parameters of a solution.
#[derive(Debug, Clone, Copy)]
pub(super) struct Effort {
    /// Distance to keep from all, in metres.
    pub(super) margin: f64,
    /// Most programs.
    pub(super) programs: u32,
    /// Seconds that a robot would lose rather than to break a constraint by what it does in one second at its limits.
    pub(super) price: f64,
}

/// A gap of a robot at the beginning of a step.
#[derive(Debug, Clone, Copy)]
struct Contact {
    stage: usize,
    distance: f64,
    /// By place, heading and time.
    growth: [f64; 4],
}

/// Constraints that are broken, in units.
struct Look<const N: usize, const M: usize> {
    steps: Vec<Step<N, M>>,
    /// The state that each step leads to, less the state after it.
    defects: Vec<[f64; N]>,
    contacts: Vec<Contact>,
    /// The duration, and the price of all that is broken.
    cost: f64,
    /// The price alone.
    broken: f64,
    /// The least of all gaps.
    nearest: f64,
}

/// Weight of the square of a step at first.
const WEIGHT: f64 = 1.0;

/// A program that promises a smaller part of the duration than this is the last one.
const ENOUGH: f64 = 2e-4;

/// A step becomes shorter by no more than this factor in one program.
const SHORTER: f64 = 5.0;

/// A step that leads so deep into something, as a part of the body's radius, is too long.
const DEEP: f64 = 0.15;

/// Limits are this much narrower, as a part of their width, so that rounding breaks none.
const ROUNDING: f64 = 1e-8;

/// Directions in which a length is bounded.
const DIRECTIONS: u32 = 8;

/// One robot, with its limits as the programs have them.
struct Single<'a> {
    member: &'a Member,
    around: &'a Around<'a>,
    effort: Effort,
    spans: &'a [Span],
    axes: Vec<usize>,
    /// Prices of a metre, a radian and of each rate.
    prices: [f64; 3],
    /// Gaps above this are not looked at, in metres.
    reach: f64,
    /// The goal's tolerances, a little narrower.
    goal: Goal,
}

/// The end of a guess.
#[derive(Debug)]
pub(super) struct Improved {
    /// Programs that were solved.
    pub(super) programs: u64,
    /// Their iterations.
    pub(super) iterations: u64,
    /// It touches something at the beginning of a step, for all that was tried.
    pub(super) touches: bool,
}

/// Improves a guess.
pub(super) fn improve(
    member: &Member,
    around: &Around<'_>,
    effort: Effort,
    steps: &mut Steps,
    stop: &mut dyn FnMut() -> bool,
) -> Improved {
    let Steps { guess, spans } = steps;
    let single = Single::new(member, around, effort, spans);
    match (member.robot.is_second, single.axes.len()) {
        (false, 2) => single.run::<4, 3>(guess, stop),
        (false, _) => single.run::<4, 4>(guess, stop),
        (true, 2) => single.run::<6, 3>(guess, stop),
        (true, _) => single.run::<7, 4>(guess, stop),
    }
}

impl<'a> Single<'a> {
    fn new(member: &'a Member, around: &'a Around<'a>, effort: Effort, spans: &'a [Span]) -> Self {
        let robot = &member.robot;
        let per = |most: f64| effort.price / most.max(SLOWEST);
        let change = robot
            .changes
            .iter()
            .flatten()
            .fold(0.0, |a: f64, b| a.max(b.abs()));
        let narrower = |tolerance: f64| (tolerance * (1.0 - 1e-6) - 1e-10).max(0.0);
        Self {
            prices: [
                per(robot.top_speed()),
                per(robot.top_turn_rate()),
                per(change),
            ],
            axes: axes(robot),
            reach: member.body.radius,
            goal: Goal {
                place_m: narrower(member.goal.place_m),
                heading_rad: narrower(member.goal.heading_rad),
                rate: narrower(member.goal.rate),
                ..member.goal
            },
            spans,
            member,
            around,
            effort,
        }
    }

    fn run<const N: usize, const M: usize>(
        mut self,
        guess: &mut Guess,
        stop: &mut dyn FnMut() -> bool,
    ) -> Improved {
        let mut done = Improved {
            programs: 0,
            iterations: 0,
            touches: false,
        };
        for (segment, span) in guess.segments.iter_mut().zip(self.spans) {
            segment.control = self.member.robot.clamped(&segment.control);
            segment.seconds = segment.seconds.clamp(span.least, span.most);
        }
        let mut look = self.look::<N, M>(guess);
        let mut weight = WEIGHT;
        let mut accuracy: f64 = 1e-5;
        for _ in 0..self.effort.programs {
            if stop() {
                return done;
            }
            let mut program = self.program(guess, &look, weight, 1.0);
            done.programs += 1;
            let Some((solution, iterations)) = program.solve(accuracy) else {
                weight *= 10.0;
                continue;
            };
            done.iterations += u64::from(iterations);
            let next = self.moved(guess, &solution);
            let promised = look.cost - self.promised(&next, &look, &solution);
            accuracy = (0.02 * promised / program.rows.len() as f64).clamp(1e-9, 1e-5);
            if promised < ENOUGH * guess.seconds() {
                if look.broken < 1e-3 || self.effort.price > 300.0 || promised > 1e-2 * look.broken
                {
                    break;
                }
                // Time is worth more than what is broken: it has to be dearer.
                self.effort.price *= 4.0;
                self = Self::new(self.member, self.around, self.effort, self.spans);
                look = self.look(guess);
                continue;
            }
            let (mut next, mut next_look) = {
                let look = self.look::<N, M>(&next);
                (next, look)
            };
            let mut kept = (look.cost - next_look.cost) / promised;
            if kept < 0.6 {
                // What the step leaves of gaps between steps is known: once more with it.
                for (stage, missed) in program.stages.iter_mut().zip(&next_look.defects) {
                    for (defect, missed) in stage.defect.iter_mut().zip(missed) {
                        *defect += missed;
                    }
                }
                done.programs += 1;
                if let Some((solution, iterations)) = program.solve(accuracy) {
                    done.iterations += u64::from(iterations);
                    let again = self.moved(guess, &solution);
                    let again_look = self.look::<N, M>(&again);
                    let again_kept = (look.cost - again_look.cost) / promised;
                    if again_kept > kept {
                        (next, next_look, kept) = (again, again_look, again_kept);
                    }
                }
            }
            // Nothing is passed through for the sake of time.
            let deepest = look.nearest.min(-DEEP * self.member.body.radius);
            if kept > 0.1 && next_look.nearest >= deepest {
                *guess = next;
                look = next_look;
                if kept > 0.6 {
                    weight = (weight * 0.3).max(1e-5);
                } else if kept < 0.3 {
                    weight *= 2.0;
                }
            } else {
                weight *= 6.0;
                if weight > 1e5 {
                    break;
                }
            }
        }
        // What is left of gaps between steps is closed, whatever time it takes.
        for _ in 0..4 {
            let worst = look.defects.iter().flatten();
            if worst.fold(0.0, |worst: f64, one: &f64| worst.max(one.abs())) < 1e-10 {
                break;
            }
            let program = self.program(guess, &look, 1.0, 0.0);
            done.programs += 1;
            let Some((solution, iterations)) = program.solve(1e-9) else {
                break;
            };
            done.iterations += u64::from(iterations);
            *guess = self.moved(guess, &solution);
            look = self.look(guess);
        }
        done.touches = look.nearest < 0.0;
        done
    }

    /// The program around a guess: steps cost so much by their size, and seconds so much.
    fn program<const N: usize, const M: usize>(
        &self,
        guess: &Guess,
        look: &Look<N, M>,
        weight: f64,
        second: f64,
    ) -> Program<N, M> {
        let robot = &self.member.robot;
        let steps = guess.segments.len();
        let mut rows = Vec::with_capacity(steps * 16 + look.contacts.len());
        let mut state_weight = [0.0; N];
        state_weight[0] = weight;
        state_weight[1] = weight;
        state_weight[HEADING] = 4.0 * weight;
        let controls = robot.controls();
        let mut stages = Vec::with_capacity(steps);
        for (stage, (segment, step)) in guess.segments.iter().zip(&look.steps).enumerate() {
            let mut by_control = step.by_control;
            let mut control_weight = [0.1 * weight; M];
            for (number, axis) in self.axes.iter().copied().enumerate() {
                let [least, most] = controls[axis];
                let width = most - least;
                if width < 1e-9 {
                    for row in &mut by_control {
                        row[number] = 0.0;
                    }
                    continue;
                }
                control_weight[number] /= width * width;
                let own = segment.control[axis];
                let mut bound = |sign: f64, least: f64| {
                    rows.push(Row::new(
                        (stage, true),
                        &[(number, sign)],
                        least,
                        f64::INFINITY,
                    ));
                };
                bound(1.0, least - own);
                bound(-1.0, own - most);
            }
            if robot.goes_sideways
                && (robot.polar_changes || (!robot.is_second && robot.polar_rates))
            {
                let most = longest(controls);
                within(
                    &mut rows,
                    (stage, true),
                    0,
                    [segment.control[0], segment.control[1]],
                    most,
                    f64::INFINITY,
                );
            }
            let Span { least, most } = self.spans[stage];
            let least = least.max(segment.seconds / SHORTER);
            control_weight[M - 1] /= most * most;
            rows.push(Row::new(
                (stage, true),
                &[(M - 1, 1.0)],
                least - segment.seconds,
                f64::INFINITY,
            ));
            rows.push(Row::new(
                (stage, true),
                &[(M - 1, -1.0)],
                segment.seconds - most,
                f64::INFINITY,
            ));
            let mut control_cost = [0.0; M];
            control_cost[M - 1] = second;
            stages.push(Stage {
                by_state: step.by_state,
                by_control,
                defect: look.defects[stage],
                state_weight,
                control_weight,
                control_cost,
            });
            if robot.is_second {
                self.rates(&mut rows, stage + 1, &guess.states[stage + 1]);
            }
        }
        rows.extend(look.contacts.iter().map(|contact| {
            let growth = contact.growth;
            let terms = [
                (0, growth[0]),
                (1, growth[1]),
                (HEADING, growth[2]),
                (TIME, growth[3]),
            ];
            let least = self.effort.margin - contact.distance;
            Row::new((contact.stage, false), &terms, least, self.prices[0])
        }));
        self.arrival(&mut rows, steps, &guess.states[steps]);
        Program {
            stages,
            end_weight: state_weight,
            rows,
        }
    }

    fn rates(&self, rows: &mut Vec<Row>, stage: usize, state: &State) {
        let robot = &self.member.robot;
        for (number, axis) in self.axes.iter().copied().enumerate() {
            let [least, most] = robot.rates[axis];
            let inside = ROUNDING * (most - least);
            let own = state.rates[axis];
            let mut bound = |sign: f64, least: f64| {
                rows.push(Row::new(
                    (stage, false),
                    &[(RATES + number, sign)],
                    least,
                    self.prices[2],
                ));
            };
            bound(1.0, least + inside - own);
            bound(-1.0, own - most + inside);
        }
        if robot.polar_rates {
            let most = longest(&robot.rates) * (1.0 - ROUNDING);
            within(
                rows,
                (stage, false),
                RATES,
                [state.rates[0], state.rates[1]],
                most,
                self.prices[2],
            );
        }
    }

    fn arrival(&self, rows: &mut Vec<Row>, stage: usize, state: &State) {
        let (place, turn, rates) = self.goal.missed(state);
        if self.goal.place_m.is_finite() {
            within(
                rows,
                (stage, false),
                0,
                [place.x, place.y],
                self.goal.place_m,
                self.prices[0],
            );
        }
        let mut both = |number: usize, own: f64, most: f64, price: f64| {
            rows.push(Row::new(
                (stage, false),
                &[(number, 1.0)],
                -most - own,
                price,
            ));
            rows.push(Row::new(
                (stage, false),
                &[(number, -1.0)],
                own - most,
                price,
            ));
        };
        if !self.goal.free.heading {
            both(HEADING, turn, self.goal.heading_rad, self.prices[1]);
        }
        if self.member.robot.is_second {
            for (number, axis) in self.axes.iter().copied().enumerate() {
                if !self.goal.free.rates[axis] {
                    both(RATES + number, rates[axis], self.goal.rate, self.prices[2]);
                }
            }
        }
    }

    /// The guess after a step.
    fn moved<const N: usize, const M: usize>(&self, guess: &Guess, by: &Solution<N, M>) -> Guess {
        let mut next = guess.clone();
        for (state, by) in next.states.iter_mut().zip(&by.states) {
            state.at.x += by[0];
            state.at.y += by[1];
            if self.member.robot.has_heading {
                state.heading += by[HEADING];
            }
            if self.member.robot.is_second {
                for (number, axis) in self.axes.iter().copied().enumerate() {
                    state.rates[axis] += by[RATES + number];
                }
            }
        }
        for (segment, by) in next.segments.iter_mut().zip(&by.controls) {
            for (number, axis) in self.axes.iter().copied().enumerate() {
                segment.control[axis] += by[number];
            }
            segment.control = self.member.robot.clamped(&segment.control);
            segment.seconds += by[M - 1];
        }
        next
    }

    /// The price of what is broken by states alone: rates and the goal.
    fn broken(&self, guess: &Guess) -> f64 {
        let robot = &self.member.robot;
        let end = &guess.states[guess.segments.len()];
        let (place, turn, rates) = self.goal.missed(end);
        let over = |value: f64, most: f64| (value.abs() - most).max(0.0);
        let mut price = self.prices[0] * over(place.norm(), self.goal.place_m)
            + self.prices[1] * over(turn, self.goal.heading_rad);
        if !robot.is_second {
            return price;
        }
        price += self.prices[2]
            * rates
                .iter()
                .map(|rate| over(*rate, self.goal.rate))
                .sum::<f64>();
        for state in &guess.states[1..] {
            let clamped = robot.clamped_rates(&state.rates);
            let beyond = clamped
                .iter()
                .zip(&state.rates)
                .map(|(clamped, own)| (clamped - own).abs());
            price += self.prices[2] * beyond.sum::<f64>();
        }
        price
    }

    /// The cost that a program promises for the guess after its step.
    fn promised<const N: usize, const M: usize>(
        &self,
        next: &Guess,
        look: &Look<N, M>,
        solution: &Solution<N, M>,
    ) -> f64 {
        let broken = look.contacts.iter().map(|contact| {
            let by = &solution.states[contact.stage];
            let grown = contact
                .growth
                .iter()
                .zip(by)
                .map(|(growth, by)| growth * by);
            self.prices[0] * (self.effort.margin - contact.distance - grown.sum::<f64>()).max(0.0)
        });
        next.seconds() + self.broken(next) + broken.sum::<f64>()
    }

    fn look<const N: usize, const M: usize>(&self, guess: &Guess) -> Look<N, M> {
        let robot = &self.member.robot;
        let steps: Vec<Step<N, M>> = guess
            .segments
            .iter()
            .zip(&guess.states)
            .map(|(segment, state)| {
                Step::new(robot, &self.axes, state, &segment.control, segment.seconds)
            })
            .collect();
        let contacts = self.contacts(guess);
        let mut look = Look {
            defects: self.defects(&steps, guess),
            steps,
            contacts,
            cost: 0.0,
            broken: self.broken(guess),
            nearest: f64::INFINITY,
        };
        for defect in &look.defects {
            look.broken += self.prices[0] * (defect[0].abs() + defect[1].abs())
                + self.prices[1] * defect[HEADING].abs()
                + self.prices[2] * defect[RATES..].iter().map(|one| one.abs()).sum::<f64>();
        }
        for contact in &look.contacts {
            look.broken += self.prices[0] * (self.effort.margin - contact.distance).max(0.0);
            look.nearest = look.nearest.min(contact.distance);
        }
        look.cost = guess.seconds() + look.broken;
        look
    }

    /// The state that each step leads to, less the state after it.
    fn defects<const N: usize, const M: usize>(
        &self,
        steps: &[Step<N, M>],
        guess: &Guess,
    ) -> Vec<[f64; N]> {
        let ends = steps.iter().zip(&guess.states[1..]);
        let defects = ends.map(|(Step { end, .. }, next)| {
            let mut defect = [0.0; N];
            defect[0] = end.at.x - next.at.x;
            defect[1] = end.at.y - next.at.y;
            defect[HEADING] = end.heading - next.heading;
            if self.member.robot.is_second {
                for (number, axis) in self.axes.iter().copied().enumerate() {
                    defect[RATES + number] = end.rates[axis] - next.rates[axis];
                }
            }
            defect
        });
        defects.collect()
    }

    fn contacts(&self, guess: &Guess) -> Vec<Contact> {
        let mut contacts = Vec::new();
        let Around {
            walls,
            body_at_walls,
            body,
            others,
        } = self.around;
        let mut at_walls = (*body_at_walls).clone();
        let mut own = (*body).clone();
        let mut other_shape = own.clone();
        let reach = self.reach + self.effort.margin;
        let steps = guess.segments.len();
        let mut time = 0.0;
        for stage in 1..=steps {
            time += guess.segments[stage - 1].seconds;
            let pose = guess.states[stage].pose();
            body_at_walls.place(&pose, &mut at_walls);
            walls.near(&at_walls, pose.at, reach, |gap| {
                let [x, y, turn] = gap.growth(pose.at);
                contacts.push(Contact {
                    stage,
                    distance: gap.distance,
                    growth: [x, y, turn, 0.0],
                });
            });
            if others.is_empty() {
                continue;
            }
            body.place(&pose, &mut own);
            let mut see = |shape: &Shape, at: &Pose, rates: [f64; 3]| {
                let apart = (at.at - pose.at).norm() - shape.radius - own.radius;
                if apart >= reach {
                    return;
                }
                shape.place(at, &mut other_shape);
                let gap = own.gap(&other_shape);
                if gap.distance < reach {
                    let [x, y, turn] = gap.growth(pose.at);
                    let other = gap.growth(at.at);
                    let time = -(other[0] * rates[0] + other[1] * rates[1] + other[2] * rates[2]);
                    contacts.push(Contact {
                        stage,
                        distance: gap.distance,
                        growth: [x, y, turn, time],
                    });
                }
            };
            for (shape, track) in others {
                let number = track.knot_at(time);
                let before = &track.knots[number];
                match track.knots.get(number + 1) {
                    Some(next) => {
                        let at = between(before, next, time);
                        let seconds = next.time - before.time;
                        let way = (next.pose.at - before.pose.at) / seconds;
                        let turn = (next.pose.heading - before.pose.heading) / seconds;
                        see(shape, &at, [way.x, way.y, turn]);
                        if stage == steps {
                            // It rests here while others pass.
                            for later in &track.knots[number + 1..] {
                                see(shape, &later.pose, [0.0; 3]);
                            }
                        }
                    }
                    None => see(shape, &before.pose, [0.0; 3]),
                }
            }
        }
        contacts
    }
}

fn longest(limits: &[[f64; 2]; 3]) -> f64 {
    limits[..2]
        .iter()
        .flatten()
        .fold(0.0, |most, limit| most.max(limit.abs()))
}

/// The length of two numbers is bounded: by lines around the circle, one of them where the numbers are now.
fn within(
    rows: &mut Vec<Row>,
    of: (usize, bool),
    first: usize,
    own: [f64; 2],
    most: f64,
    price: f64,
) {
    let now = libm::atan2(own[1], own[0]);
    for direction in 0..DIRECTIONS {
        let (sin, cos) = libm::sincos(
            now + std::f64::consts::TAU * f64::from(direction) / f64::from(DIRECTIONS),
        );
        let least = cos * own[0] + sin * own[1] - most;
        rows.push(Row::new(
            of,
            &[(first, -cos), (first + 1, -sin)],
            least,
            price,
        ));
    }
}
