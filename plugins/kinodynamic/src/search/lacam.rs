//! LaCAM over motion primitives (after LaCAM: Okumura, AAAI 2023, and db-LaCAM, which plans so for teams with dynamics).
//!
//! Time goes in steps as long as a primitive. A configuration has the state of every robot at such a time, and of every robot a *course
//! of action*: a motion that ends at rest. No two courses of action of a configuration touch, ever. So a robot may always go on with its
//! own, and there is no state in which somebody cannot brake any more. In a step robots choose new ones in the order of PIBT (Okumura et
//! al., AIJ 2022): a primitive and the brake after it, or the connection to the goal. Who is in the way of a choice has to choose at once
//! something that is not; if it cannot, the choice is undone. Choices are tried by the time that remains from where they come to rest: to a place ahead on
//! a shortest way of a disc, and from there on along it.
//!
//! As in LaCAM the search goes depth first over configurations, and each has constraints that make robots choose otherwise, one
//! after the other, which are tried lazily. Configurations are the same where all robots are in the same cells.

use std::collections::{HashMap, HashSet, VecDeque};
use std::rc::Rc;

use fleetyard_abi::leftovers::Leftover;
use fleetyard_plugin_plane::sssp::bodies::Pose;
use fleetyard_plugin_spacetime::random::Random;

use super::astar::{Avoid, Limits, Outcome, Pathfinder};
use super::field::{Field, Guide, Waypoint};
use crate::course::{Course, Segment};
use crate::plugin::{Member, Team};
use crate::primitives::Level;
use crate::robot::State;
use crate::steer::brake;

/// A motion that ends at rest.
#[derive(Debug)]
struct Action {
    /// Its beginning, in seconds.
    begin: f64,
    segments: Vec<Segment>,
    /// Levels after each step of it; after the last it goes on to rest, if there are any.
    levels: Vec<Level>,
    avoid: Avoid,
    /// A bound of the time from its rest to the goal, in seconds.
    remaining: f64,
    /// A way to the goal that goes on at its end: its controls, and the seconds of them before.
    way: Option<Following>,
}

/// Controls that lead to the goal, and the seconds of them that were followed.
type Following = (Rc<[Segment]>, f64);

/// A robot in a configuration.
#[derive(Debug, Clone)]
struct Own {
    state: State,
    /// The level, if it may choose.
    level: Option<Level>,
    action: Rc<Action>,
    /// It rests at its goal.
    is_there: bool,
    /// The way that it would go if it were alone.
    reference: Option<Rc<Reference>>,
}

/// Poses on the way of a robot alone, and the seconds that remain from each.
type Reference = Vec<(Pose, f64)>;

/// Robots that have to choose another of their choices: robot and number.
type Constraint = Vec<(usize, usize)>;

struct Node {
    robots: Vec<Own>,
    step: u32,
    parent: usize,
    /// By descending priority.
    order: Vec<usize>,
    priorities: Vec<f64>,
    constraints: VecDeque<Constraint>,
}

/// Result of a search.
#[derive(Debug)]
pub enum Ended {
    /// A course for every robot.
    Found(Vec<Course>),
    /// There is no further configuration.
    Exhausted,
    /// These robots cannot come to rest without touching.
    Unsafe,
    /// A limit was met.
    Stopped,
}

/// Choices of a robot in one step, by what remains after them.
type Choices = Vec<Rc<Action>>;

/// By robot and state the way to its goal, if there is one.
type Alone = HashMap<(usize, [u64; 7]), Option<Rc<Course>>>;

/// LaCAM for a team.
pub struct Search<'s, 'a> {
    team: &'a Team<'a>,
    pathfinders: &'s mut [Pathfinder<'a>],
    guides: Vec<Guide>,
    /// Length of a step, in seconds.
    step: f64,
    random: Random,
    /// From then on no obstacle moves.
    still: f64,
    nodes: Leftover<Vec<Node>>,
    /// Ways of single robots from states to their goals.
    alone: Leftover<Alone>,
    /// Configurations that were made.
    pub made: u64,
}

/// Places ahead are so many steps at full speed away.
const AHEAD: f64 = 4.0;

/// Most connections to the goal that last longer than this many steps are not tried.
const LONG: f64 = 64.0;

/// Most nodes of the search of a robot's way alone.
const ALONE: u64 = 2000;

/// Most of these ways that are known at a time.
const MOST_ALONE: usize = 20_000;

/// A robot without a way to its goal looks for one every so many steps.
const RETHINK: usize = 4;

/// Seconds to the goal on a way that is clear of obstacles count so much: others are bounds from below.
const SURE: f64 = 0.8;

/// Choices differ by up to this many seconds at random.
const JITTER_S: f64 = 1e-3;

/// Constraints of one configuration are tried until there are so many.
const MOST_CONSTRAINTS: usize = 10_000;

impl<'s, 'a> Search<'s, 'a> {
    /// With a pathfinder for every robot, all of primitives of this length in seconds.
    pub fn new(
        team: &'a Team<'a>,
        pathfinders: &'s mut [Pathfinder<'a>],
        field: &Rc<Field>,
        step: f64,
        seed: u64,
    ) -> Self {
        let guide = |member: &Member| Guide::new(Rc::clone(field), member);
        let moving = team.scene.movers.iter().map(|mover| mover.track.seconds());
        Self {
            team,
            pathfinders,
            guides: team.members.iter().map(guide).collect(),
            step,
            random: Random::new(seed, 31),
            still: moving.fold(0.0, f64::max),
            nodes: Leftover::default(),
            alone: Leftover::default(),
            made: 0,
        }
    }

    /// Searches courses of all robots within so many configurations, of which so many fit in memory.
    pub fn run(&mut self, most: u64, memory: usize, stop: &mut dyn FnMut() -> bool) -> Ended {
        let Some(first) = self.first() else {
            return Ended::Unsafe;
        };
        let mut seen = Leftover::new(HashSet::from([self.cells(&first, 0)]));
        let priorities: Vec<f64> = first
            .iter()
            .map(|own| own.action.remaining * 1e-6)
            .collect();
        self.add(first, 0, 0, priorities);
        let mut open = vec![0];
        while let Some(number) = open.last().copied() {
            if self.is_goal(number) {
                return Ended::Found(self.courses(number));
            }
            if self.made >= most || self.nodes.len() >= memory || stop() {
                return Ended::Stopped;
            }
            let Some(constraint) = self.nodes[number].constraints.pop_front() else {
                open.pop();
                continue;
            };
            let Some(next) = self.next(number, constraint, stop) else {
                continue;
            };
            self.made += 1;
            let step = self.nodes[number].step + 1;
            if !seen.insert(self.cells(&next, step)) {
                continue;
            }
            let priorities =
                next.iter()
                    .zip(&self.nodes[number].priorities)
                    .map(|(own, before)| {
                        if own.is_there {
                            before.fract()
                        } else {
                            before + 1.0
                        }
                    });
            let priorities = priorities.collect();
            let child = self.add(next, step, number, priorities);
            open.push(child);
        }
        Ended::Exhausted
    }

    fn add(&mut self, robots: Vec<Own>, step: u32, parent: usize, priorities: Vec<f64>) -> usize {
        let mut order: Vec<usize> = (0..robots.len()).collect();
        order.sort_by(|one, other| priorities[*other].total_cmp(&priorities[*one]));
        self.nodes.push(Node {
            robots,
            step,
            parent,
            order,
            priorities,
            constraints: VecDeque::from([Vec::new()]),
        });
        self.nodes.len() - 1
    }

    /// All robots brake, or stay.
    fn first(&mut self) -> Option<Vec<Own>> {
        let mut robots: Vec<Own> = Vec::with_capacity(self.team.len());
        for (robot, member) in self.team.members.iter().enumerate() {
            let halt: Vec<Segment> = brake(&member.robot, &member.start).into_iter().collect();
            let action = self.action(robot, &member.start, 0.0, (halt, Vec::new()), None)?;
            let touches = |own: &Own| action.avoid.touches_after(&own.action.avoid, 0.0);
            if robots.iter().any(touches) {
                return None;
            }
            robots.push(self.own(robot, member.start, 0.0, (Rc::new(action), None)));
        }
        Some(robots)
    }

    /// A motion to rest that touches nothing but perhaps other robots.
    fn action(
        &self,
        robot: usize,
        start: &State,
        begin: f64,
        (segments, levels): (Vec<Segment>, Vec<Level>),
        reference: Option<&Reference>,
    ) -> Option<Action> {
        let member = &self.team.members[robot];
        let course = Course {
            start: *start,
            segments,
        };
        let rest = course.end(&member.robot).pose();
        let own = &self.pathfinders[robot];
        if own.is_shut(rest.at) {
            return None;
        }
        let bends = |state: State| !member.robot.allows_joint(&state);
        if member.behind.is_some() && course.states(&member.robot).any(bends) {
            return None;
        }
        let track = course.track(&member.robot);
        if !own.is_clear(&track) {
            return None;
        }
        let track = track.later(begin);
        let seconds = track.seconds() + self.step;
        if own.meets_mover(&track, seconds) {
            return None;
        }
        let body = member.body.clone();
        Some(Action {
            begin,
            segments: course.segments,
            levels,
            avoid: Avoid::new(body, Rc::new(track), begin, f64::INFINITY),
            remaining: self.remaining(robot, &rest, reference),
            way: None,
        })
    }

    /// A step on a way to the goal, then rest; of a robot that cannot stop at once, the whole way.
    fn follow(
        &self,
        robot: usize,
        own: &Own,
        time: f64,
        (segments, before): Following,
    ) -> Option<(f64, Rc<Action>)> {
        let whole: f64 = segments.iter().map(|segment| segment.seconds).sum();
        let left = whole - before;
        if left > LONG * self.step || (left <= 0.0 && own.is_there) {
            return None;
        }
        let (length, after) = if self.team.members[robot].robot.is_second {
            (left, 0.0)
        } else {
            (self.step, (left - self.step).max(0.0))
        };
        let piece = part(&segments, before, length);
        let action = self.action(robot, &own.state, time, (piece, Vec::new()), None)?;
        let way = (after > 0.0).then_some((segments, before + length));
        let action = Action {
            remaining: after,
            way,
            ..action
        };
        Some((after * SURE, Rc::new(action)))
    }

    /// The robot at a time on its course of action.
    fn own(
        &self,
        robot: usize,
        state: State,
        time: f64,
        (action, reference): (Rc<Action>, Option<Rc<Reference>>),
    ) -> Own {
        let member = &self.team.members[robot];
        let steps = ((time - action.begin) / self.step).round() as usize;
        let rests = time >= action.avoid.ends() - 1e-9;
        let level = if rests || !member.robot.is_second {
            Some([0; 3])
        } else {
            steps
                .checked_sub(1)
                .and_then(|step| action.levels.get(step).copied())
        };
        Own {
            is_there: rests && member.goal.is_reached(&state),
            state,
            level,
            action,
            reference,
        }
    }

    /// Seconds from rest in a pose to the goal, if no other robot were there.
    fn remaining(&self, robot: usize, pose: &Pose, reference: Option<&Reference>) -> f64 {
        let speed = self.team.members[robot].robot.top_speed();
        let reach = AHEAD * self.step * speed;
        let guide = &self.guides[robot];
        let own = &self.pathfinders[robot];
        // Of poses on the way the last one that is near and seen.
        let seen = reference.and_then(|poses| {
            poses
                .iter()
                .rev()
                .find(|(on, _)| (on.at - pose.at).norm() <= reach && guide.sees(pose.at, on.at))
        });
        if let Some((on, left)) = seen {
            let to = Waypoint {
                pose: *on,
                remaining_m: 0.0,
            };
            return left + own.seconds_to(pose, &to);
        }
        let ahead = guide.ahead(pose.at, reach);
        let on = if ahead.remaining_m > 0.0 {
            ahead.remaining_m / speed
        } else {
            0.0
        };
        on + own.seconds_to(pose, &ahead)
    }

    /// The way of a robot alone from a state, if it is found soon.
    fn alone(
        &mut self,
        robot: usize,
        state: &State,
        time: f64,
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<Rc<Course>> {
        let [place, heading, rates] = [state.at.x, state.at.y, state.heading].map(f64::to_bits);
        let own = state.rates.map(f64::to_bits);
        let behind = state.behind.to_bits();
        let key = (
            robot,
            [place, heading, rates, own[0], own[1], own[2], behind],
        );
        if let Some(known) = self.alone.get(&key) {
            return known.clone();
        }
        let mut limits = Limits {
            nodes: ALONE,
            memory: usize::MAX,
            stop,
        };
        let none: (&[Avoid], (&[Avoid], f64)) = (&[], (&[], 0.0));
        let finder = &mut self.pathfinders[robot];
        let found = match finder.find_from(state, time, none, f64::INFINITY, &mut limits) {
            Outcome::Found(way) => Some(Rc::new(way.course)),
            Outcome::Exhausted | Outcome::Stopped => None,
        };
        if self.alone.len() >= MOST_ALONE {
            self.alone.clear();
        }
        self.alone.insert(key, found.clone());
        found
    }

    /// Courses of action that a robot may take next, and the way that it would go alone.
    fn choices(
        &mut self,
        robot: usize,
        own: &Own,
        step: u32,
        stop: &mut dyn FnMut() -> bool,
    ) -> (Choices, Option<Rc<Reference>>) {
        let time = f64::from(step) * self.step;
        let mut choices: Vec<(f64, Rc<Action>)> = vec![(
            own.action.remaining + JITTER_S * 2.0,
            Rc::clone(&own.action),
        )];
        let mut reference = own.reference.clone();
        let Some(level) = own.level else {
            let choices = choices.into_iter().map(|(_, action)| action);
            return (choices.collect(), reference);
        };
        let ended = time >= own.action.avoid.ends() - 1e-9;
        let mut ways: Vec<Following> = own
            .action
            .way
            .clone()
            .filter(|_| ended)
            .into_iter()
            .collect();
        // Who is on its way goes on; others think again from time to time.
        let is_lost = ways.is_empty() && (own.action.remaining > 0.0 || ended);
        let is_turn = (step as usize + robot).is_multiple_of(RETHINK);
        let finder = &self.pathfinders[robot];
        let member = &self.team.members[robot];
        let robot_of = &member.robot;
        let direct = finder
            .connections(&own.state)
            .into_iter()
            .filter(|segments| {
                let course = Course {
                    start: own.state,
                    segments: segments.clone(),
                };
                let leads = |course: &Course| {
                    course.is_allowed(robot_of) && member.goal.is_reached(&course.end(robot_of))
                };
                (member.behind.is_none() || leads(&course))
                    && finder.is_clear(&course.track(robot_of))
            });
        ways.extend(direct.map(|segments| (segments.into(), 0.0)));
        let thinks = step == 0 || (is_lost && !own.is_there && is_turn);
        let alone = thinks.then(|| self.alone(robot, &own.state, time, stop));
        if let Some(course) = alone.flatten() {
            let track = course.track(robot_of);
            let steps = (2.0 * track.seconds() / self.step).ceil().max(1.0);
            let on = (0..=steps as u32).map(|step| {
                let time = track.seconds() * (f64::from(step) / steps);
                (track.at(time), track.seconds() - time)
            });
            reference = Some(Rc::new(on.collect()));
            ways.push((course.segments.clone().into(), 0.0));
        }
        for way in ways {
            choices.extend(self.follow(robot, own, time, way));
        }
        let set = self.pathfinders[robot].primitives().from(level);
        for primitive in set.iter() {
            let (mut segments, mut levels) = (primitive.segments.clone(), vec![primitive.to]);
            self.slow_down(robot, &mut segments, &mut levels);
            let course = (segments, levels);
            let on = reference.as_deref();
            if let Some(action) = self.action(robot, &own.state, time, course, on) {
                let jitter = self.random.share() * JITTER_S;
                choices.push((action.remaining + jitter, Rc::new(action)));
            }
        }
        choices.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        let choices = choices.into_iter().map(|(_, action)| action);
        (choices.collect(), reference)
    }

    /// Adds the primitives that lead to rest, all rates one level down in each.
    fn slow_down(&mut self, robot: usize, segments: &mut Vec<Segment>, levels: &mut Vec<Level>) {
        while let Some(level) = levels.last().copied().filter(|level| *level != [0; 3]) {
            let set = self.pathfinders[robot].primitives().from(level);
            let down = set.iter().min_by_key(|primitive| {
                let left = primitive.to.iter().map(|own| u32::from(own.unsigned_abs()));
                left.sum::<u32>()
            });
            let Some(down) = down else { return };
            segments.extend(&down.segments);
            levels.push(down.to);
        }
    }

    /// The configuration after one, or none where the constraint leads to none.
    fn next(
        &mut self,
        number: usize,
        constraint: Constraint,
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<Vec<Own>> {
        let node = &self.nodes[number];
        let time = f64::from(node.step) * self.step;
        let (robots, order) = (node.robots.clone(), node.order.clone());
        let step = node.step;
        let (choices, references): (Vec<Choices>, Vec<Option<Rc<Reference>>>) = (0..robots.len())
            .map(|robot| self.choices(robot, &robots[robot], step, stop))
            .unzip();
        let depth = constraint.len();
        if depth < order.len() && self.nodes[number].constraints.len() < MOST_CONSTRAINTS {
            let robot = order[depth];
            for choice in 0..choices[robot].len() {
                let mut longer = constraint.clone();
                longer.push((robot, choice));
                self.nodes[number].constraints.push_back(longer);
            }
        }
        let mut turn = Turn {
            robots: &robots,
            choices: &choices,
            chosen: vec![None; robots.len()],
            is_asked: vec![false; robots.len()],
            time,
            order: &order,
        };
        for (robot, choice) in constraint {
            turn.is_asked[robot] = true;
            let action = choices[robot].get(choice)?;
            if !turn.fits(robot, action) {
                return None;
            }
            turn.chosen[robot] = Some(Rc::clone(action));
        }
        // Those in the way of what was forced go first.
        for robot in &order {
            if turn.chosen[*robot].is_none() && turn.is_in_the_way(*robot) && !turn.choose(*robot) {
                return None;
            }
        }
        for robot in &order {
            if turn.chosen[*robot].is_none() && !turn.choose(*robot) {
                return None;
            }
        }
        let chosen = turn.chosen;
        let mut next = Vec::with_capacity(robots.len());
        for (robot, (action, reference)) in chosen.into_iter().zip(references).enumerate() {
            let action = action?;
            let before = &robots[robot].state;
            let member = &self.team.members[robot];
            let part = part(&action.segments, time - action.begin, self.step);
            let state = part.iter().fold(*before, |state, segment| {
                member
                    .robot
                    .after(&state, &segment.control, segment.seconds)
            });
            next.push(self.own(robot, state, time + self.step, (action, reference)));
        }
        Some(next)
    }

    fn is_goal(&self, number: usize) -> bool {
        let node = &self.nodes[number];
        let time = f64::from(node.step) * self.step;
        node.robots.iter().enumerate().all(|(robot, own)| {
            let stays = || {
                let robot_of = &self.team.members[robot].robot;
                let track = Course::stay(own.state).track(robot_of).later(time);
                !self.pathfinders[robot].meets_mover(&track, f64::INFINITY)
            };
            own.is_there && (time >= self.still || stays())
        })
    }

    /// The courses that lead to a configuration.
    fn courses(&self, number: usize) -> Vec<Course> {
        let mut path = vec![number];
        let mut own = number;
        while own != 0 {
            own = self.nodes[own].parent;
            path.push(own);
        }
        path.reverse();
        let course = |(robot, member): (usize, &Member)| {
            let steps = path.windows(2).flat_map(|pair| {
                let time = f64::from(self.nodes[pair[0]].step) * self.step;
                let action = &self.nodes[pair[1]].robots[robot].action;
                let mut part = part(&action.segments, time - action.begin, self.step);
                // A robot that has come to rest waits for the end of the step.
                let lasts: f64 = part.iter().map(|segment| segment.seconds).sum();
                if lasts < self.step - 1e-12 {
                    part.push(Segment {
                        control: [0.0; 3],
                        seconds: self.step - lasts,
                    });
                }
                part
            });
            let mut segments: Vec<Segment> = steps.collect();
            while ends_at_rest(member, &segments) {
                segments.pop();
            }
            Course {
                start: member.start,
                segments,
            }
        };
        self.team.members.iter().enumerate().map(course).collect()
    }

    /// The cells of all robots.
    fn cells(&self, robots: &[Own], step: u32) -> Vec<[i32; 8]> {
        let time = f64::from(step) * self.step;
        let late = if time < self.still {
            step as i32
        } else {
            i32::MAX
        };
        let own = |(robot, own): (usize, &Own)| {
            let [x, y, heading, joint] = self.pathfinders[robot].cell(&own.state);
            let level = own.level.unwrap_or([i16::MAX; 3]).map(i32::from);
            // A robot on its way to the goal is where its motion has got to.
            let begun = if own.level.is_none() {
                ((time - own.action.begin) / self.step).round() as i32
            } else {
                i32::from(own.is_there) - 2
            };
            [
                x,
                y,
                heading,
                joint,
                level[0],
                level[1] * 1000 + level[2],
                begun,
                late,
            ]
        };
        robots.iter().enumerate().map(own).collect()
    }
}

/// The last segment is a rest.
fn ends_at_rest(member: &Member, segments: &[Segment]) -> bool {
    let Some((last, before)) = segments.split_last() else {
        return false;
    };
    let course = || Course {
        start: member.start,
        segments: before.to_vec(),
    };
    let still = || {
        let rates = course().end(&member.robot).rates;
        rates.iter().all(|rate| rate.abs() < 1e-9)
    };
    last.control.iter().all(|number| *number == 0.0) && (!member.robot.is_second || still())
}

/// The segments from a time on, for so long at most.
fn part(segments: &[Segment], from: f64, seconds: f64) -> Vec<Segment> {
    let mut found = Vec::new();
    let (mut skip, mut left) = (from, seconds);
    for segment in segments {
        let held = segment.seconds - skip.min(segment.seconds);
        skip = (skip - segment.seconds).max(0.0);
        let held = held.min(left);
        if held > 1e-12 {
            found.push(Segment {
                seconds: held,
                ..*segment
            });
            left -= held;
        }
    }
    found
}

/// The choices of one step.
struct Turn<'t> {
    robots: &'t [Own],
    choices: &'t [Choices],
    chosen: Vec<Option<Rc<Action>>>,
    is_asked: Vec<bool>,
    time: f64,
    order: &'t [usize],
}

impl Turn<'_> {
    /// No robot that has chosen is touched.
    fn fits(&self, robot: usize, action: &Action) -> bool {
        let mut chosen = self.chosen.iter().enumerate();
        chosen.all(|(other, others)| {
            let touches =
                |others: &Rc<Action>| action.avoid.touches_after(&others.avoid, self.time);
            other == robot || !others.as_ref().is_some_and(touches)
        })
    }

    /// Somebody has chosen what touches the course of action that a robot has.
    fn is_in_the_way(&self, robot: usize) -> bool {
        !self.fits(robot, &self.robots[robot].action)
    }

    /// A robot chooses; false if it has no choice. PIBT's recursion.
    fn choose(&mut self, robot: usize) -> bool {
        self.is_asked[robot] = true;
        for action in &self.choices[robot] {
            if !self.fits(robot, action) {
                continue;
            }
            let before = self.chosen.clone();
            self.chosen[robot] = Some(Rc::clone(action));
            if self.push_away(action) {
                return true;
            }
            self.chosen = before;
        }
        false
    }

    /// Those in the way of a choice choose themselves. Nobody is asked twice in a step.
    fn push_away(&mut self, action: &Action) -> bool {
        for other in self.order {
            if self.chosen[*other].is_none()
                && action
                    .avoid
                    .touches_after(&self.robots[*other].action.avoid, self.time)
                && (self.is_asked[*other] || !self.choose(*other))
            {
                return false;
            }
        }
        true
    }
}
