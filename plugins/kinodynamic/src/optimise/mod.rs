//! Courses of teams that end sooner: trajectory optimisation.
//!
//! A guess is states and controls, which need not fit together: states may jump, robots overlap a little, goals be missed. One
//! robot after the other is improved among the motions of all others ([`single`]), again and again. The costs of a round so
//! grow with the number of robots, where a problem of all robots together has them grow with its cube. What is returned was
//! found to be without a fault ([`Team::fault`]).
//!
//! - [`single`]: the problem of one robot, as a sequence of programs;
//! - [`quadratic`]: such a program;
//! - [`linear`]: derivatives of steps;
//! - [`gap`]: signed distances of bodies.

pub mod gap;
pub mod linear;
pub mod matrix;
pub mod quadratic;
pub mod single;

use fleetyard_plugin_plane::sssp::bodies::Pose;

use self::gap::{Shape, Walls};
use self::single::{Around, Effort, improve};
use crate::course::{Course, Knot, Segment, Track};
use crate::plugin::{Fault, Team};
use crate::robot::{Robot, State};
use crate::scene::clash;

/// A motion to begin with. It need not be possible.
#[derive(Debug, Clone, PartialEq)]
pub struct Guess {
    /// The states at the beginning of each segment, and in the end.
    pub states: Vec<State>,
    /// Controls that lead from each state to about the next one.
    pub segments: Vec<Segment>,
}

/// How much is tried.
#[derive(Debug, Clone, Copy)]
pub struct Options {
    /// Most rounds, in each of which every robot is improved once.
    pub rounds: u32,
    /// Most programs for a robot in a round.
    pub programs: u32,
    /// Most steps of a course.
    pub steps: u32,
    /// A round that makes the sum of durations less by a smaller part than this is the last one.
    pub gain: f64,
}

/// Figures.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Figures {
    /// Rounds.
    pub rounds: u64,
    /// Quadratic programs.
    pub programs: u64,
    /// Iterations of all programs.
    pub iterations: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            rounds: 8,
            programs: 20,
            steps: 200,
            gain: 2e-3,
        }
    }
}

impl Guess {
    /// A course as it is.
    pub fn of(course: &Course, robot: &Robot) -> Self {
        Self {
            states: course.states(robot).collect(),
            segments: course.segments.clone(),
        }
    }

    /// Seconds until the last control ends.
    pub fn seconds(&self) -> f64 {
        self.segments.iter().map(|segment| segment.seconds).sum()
    }

    /// The controls alone.
    fn course(&self) -> Course {
        Course {
            start: self.states[0],
            segments: self.segments.clone(),
        }
    }

    /// Straight from state to state.
    fn track(&self) -> Track {
        let mut time = 0.0;
        let mut knots = vec![Knot {
            time,
            pose: self.states[0].pose(),
        }];
        for (segment, state) in self.segments.iter().zip(&self.states[1..]) {
            time += segment.seconds;
            knots.push(Knot {
                time,
                pose: state.pose(),
            });
        }
        knots.dedup_by(|next, before| next.time <= before.time);
        Track { knots }
    }

    /// Numbers that fit together, of a start.
    fn is_sound(&self, start: &State) -> bool {
        let finite = |state: &State| {
            state.at.x.is_finite()
                && state.at.y.is_finite()
                && state.heading.is_finite()
                && state.rates.iter().all(|rate| rate.is_finite())
        };
        self.states.len() == self.segments.len() + 1
            && self.states[0] == *start
            && self.states.iter().all(finite)
            && self.segments.iter().all(|segment| {
                segment.seconds >= 0.0
                    && segment.seconds.is_finite()
                    && segment.control.iter().all(|number| number.is_finite())
            })
    }

    /// The same in steps of at most so many seconds, where `splits` says so of a segment's number and time.
    fn cut(&self, robot: &Robot, pieces: impl Fn(usize, &Segment) -> u32) -> Self {
        let mut cut = Self {
            states: vec![self.states[0]],
            segments: Vec::with_capacity(self.segments.len()),
        };
        for (number, segment) in self.segments.iter().enumerate() {
            let pieces = pieces(number, segment);
            let part = Segment {
                seconds: segment.seconds / f64::from(pieces),
                ..*segment
            };
            for piece in 1..=pieces {
                cut.segments.push(part);
                cut.states.push(if piece == pieces {
                    self.states[number + 1]
                } else {
                    let before = &self.states[number];
                    robot.after(before, &segment.control, part.seconds * f64::from(piece))
                });
            }
        }
        cut
    }

    /// The same without segments of no duration, and where a control that is held on is one.
    fn joined(&self) -> Self {
        let mut joined = Self {
            states: vec![self.states[0]],
            segments: Vec::with_capacity(self.segments.len()),
        };
        for (segment, state) in self.segments.iter().zip(&self.states[1..]) {
            match joined.segments.last_mut() {
                Some(last) if last.control == segment.control || segment.seconds == 0.0 => {
                    last.seconds += segment.seconds;
                    let end = joined.states.len() - 1;
                    joined.states[end] = *state;
                }
                _ => {
                    joined.segments.push(*segment);
                    joined.states.push(*state);
                }
            }
        }
        joined
    }
}

/// A robot between rounds.
struct Lane {
    guess: Guess,
    /// Its motion as others see it.
    track: Track,
    /// Its controls, if nothing but perhaps other robots is in their way.
    course: Option<Course>,
    step: f64,
    margin: f64,
    body_at_walls: Shape,
    body: Shape,
}

/// Fewest steps of a course.
const FEWEST_STEPS: f64 = 12.0;

/// A step is so short that a robot moves by no more than this part of its radius, where that is not too many.
const STEP: f64 = 0.35;

/// Improves a guess for every robot. Returns courses without a fault, and figures; none if there are none. Where the guess is
/// without a fault the courses are never longer in sum.
pub fn optimise(
    team: &Team<'_>,
    guess: &[Guess],
    options: &Options,
    stop: &mut dyn FnMut() -> bool,
) -> (Option<Vec<Course>>, Figures) {
    let mut figures = Figures::default();
    let sound = guess.iter().zip(&team.members);
    if guess.len() != team.len() || !sound.into_iter().all(|(guess, member)| guess.is_sound(&member.start)) {
        return (None, figures);
    }
    let walls = Walls::new(team.scene.world);
    let movers: Vec<Shape> = team.scene.movers.iter().map(|mover| Shape::new(&mover.body)).collect();
    let begin: Vec<Course> = guess.iter().map(Guess::course).collect();
    let mut best = team.fault(&begin).is_none().then_some(begin);
    let mut lanes: Vec<Lane> = guess
        .iter()
        .enumerate()
        .map(|(agent, guess)| Lane::new(team, agent, guess, options))
        .collect();
    let mut price = 10.0;
    for _ in 0..options.rounds {
        figures.rounds += 1;
        let before = seconds(&lanes);
        for agent in 0..lanes.len() {
            if stop() {
                return (best, figures);
            }
            let old = &lanes[agent];
            let others: Vec<(usize, &Track)> = lanes
                .iter()
                .map(|lane| &lane.track)
                .enumerate()
                .filter(|(other, _)| *other != agent)
                .collect();
            let mut moving: Vec<(&Shape, &Track)> = movers
                .iter()
                .zip(&team.scene.movers)
                .map(|(shape, mover)| (shape, &mover.track))
                .collect();
            moving.extend(others.iter().map(|(other, track)| (&lanes[*other].body, *track)));
            let around = Around {
                walls: &walls,
                body_at_walls: &old.body_at_walls,
                body: &old.body,
                others: moving,
            };
            let mut guess = old.guess.clone();
            let mut margin = old.margin;
            let mut found = None;
            for _ in 0..4 {
                let effort = Effort {
                    margin,
                    programs: options.programs,
                    price,
                    step: [1.5 * old.step, 1e-3 * old.step],
                };
                let done = improve(&team.members[agent], &around, effort, &mut guess, stop);
                figures.programs += done[0];
                figures.iterations += done[1];
                let course = guess.course();
                let member = &team.members[agent];
                if std::env::var("TRACE").is_ok() {
                    eprintln!("agent {agent}: {:.3} {:?} reached {} {:?}", course.seconds(), team.track(agent, &course).err(), member.goal.is_reached(&course.end(&member.robot)), others.iter().map(|o| o.0).collect::<Vec<_>>());
                }
                if !member.goal.is_reached(&course.end(&member.robot)) || !course.is_allowed(&member.robot) {
                    break;
                }
                let track = course.track(&member.robot);
                let touched = touched(team, agent, &track, &others);
                if touched.is_empty() {
                    found = Some((course, track));
                    break;
                }
                margin += 2e-3;
                guess = guess.split_at(&member.robot, &touched);
            }
            let lane = &mut lanes[agent];
            match found {
                Some((course, track)) if best.is_none() || course.seconds() < lane.guess.seconds() => {
                    lane.guess = guess;
                    lane.track = track;
                    lane.course = Some(course);
                    lane.margin = margin;
                }
                None if best.is_none() => {
                    lane.track = guess.track();
                    lane.guess = guess;
                    lane.course = None;
                }
                _ => {}
            }
        }
        let courses: Option<Vec<Course>> = lanes.iter().map(|lane| lane.course.clone()).collect();
        let whole = courses.filter(|courses| team.fault(courses).is_none());
        if std::env::var("TRACE").is_ok() {
            eprintln!("round: {:.3} -> {:.3} whole {}", before, seconds(&lanes), whole.is_some());
        }
        match whole {
            Some(courses) => {
                let is_new = best.is_none();
                best = Some(courses);
                if !is_new && seconds(&lanes) > before * (1.0 - options.gain) {
                    break;
                }
            }
            None => price *= 2.0,
        }
    }
    (best, figures)
}

fn seconds(lanes: &[Lane]) -> f64 {
    lanes.iter().map(|lane| lane.guess.seconds()).sum()
}

/// The times at which a robot touches what it should not.
fn touched(team: &Team<'_>, agent: usize, track: &Track, others: &[(usize, &Track)]) -> Vec<f64> {
    let member = &team.members[agent];
    let mut times = Vec::new();
    let mut time = 0.0;
    for leg in track.legs() {
        if !member.space.is_clear(&leg) {
            times.push(time + leg.duration / 2.0);
        }
        time += leg.duration;
    }
    for mover in &team.scene.movers {
        times.extend(clash((&member.body, track), (&mover.body, &mover.track), 0.0, f64::INFINITY));
    }
    for (other, other_track) in others {
        let body = &team.members[*other].body;
        times.extend(clash((&member.body, track), (body, other_track), 0.0, f64::INFINITY));
    }
    times
}

impl Guess {
    /// The same with steps halved at these times.
    fn split_at(&self, robot: &Robot, times: &[f64]) -> Self {
        let ends: Vec<f64> = self
            .segments
            .iter()
            .scan(0.0, |time, segment| {
                *time += segment.seconds;
                Some(*time)
            })
            .collect();
        self.cut(robot, |number, segment| {
            let begin = ends[number] - segment.seconds;
            let is_hit = times.iter().any(|time| begin <= *time && *time <= ends[number]);
            if is_hit { 2 } else { 1 }
        })
    }
}

impl Lane {
    fn new(team: &Team<'_>, agent: usize, guess: &Guess, options: &Options) -> Self {
        let member = &team.members[agent];
        let robot = &member.robot;
        let guess = guess.joined();
        let total = guess.seconds();
        let usual = STEP * member.body.radius / robot.top_speed().max(1e-3);
        let step = usual.min(total / FEWEST_STEPS).max(total / f64::from(options.steps)).max(1e-6);
        let guess = guess.cut(robot, |_, segment| {
            (segment.seconds / step).ceil().max(1.0) as u32
        });
        let course = guess.course();
        Self {
            track: guess.track(),
            course: None,
            step,
            margin: 5e-4,
            body_at_walls: Shape::new(&member.space.body),
            body: Shape::new(&member.body),
            guess,
        }
    }
}
