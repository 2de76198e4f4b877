//! A\* over motion primitives (db-A\*: Hönig, Ortiz-Haro, Toussaint, "db-A\*: Discontinuity-bounded search for kinodynamic mobile
//! robot motion planning", IROS 2022).
//!
//! As in the paper, a state that is nearer than α δ to one that was reached at less cost is pruned, where near means in the same
//! cell of places, headings, levels of rates and, where something moves, time steps. In the paper primitives start up to δ beside
//! the state before them, and an optimiser repairs that. Here primitives join exactly ([`crate::primitives`]), and every node that is expanded
//! is connected to the goal exactly, by a curve of [`Curves`] or from rest to rest ([`crate::steer`]). The result is a motion that
//! the robot can do; of those that the primitives and one connection give it is the quickest, but for pruning.
//!
//! What remains is bounded from below by the way of a disc inside the body round all obstacles, by accelerations, by turns, and by the
//! curve without obstacles, which is computed for nodes that come up alone.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};
use std::f64::consts::PI;
use std::rc::Rc;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::sssp::bodies::{Body, Pose, wrapped};

use super::field::{Field, Remaining, Walls, Waypoint};
use crate::course::{Course, Knot, Segment, Track};
use crate::curves::Curves;
use crate::plugin::{Line, Member, Team};
use crate::primitives::{Level, Primitive, Primitives, circle};
use crate::robot::{Robot, State, rotated};
use crate::scene::clash;
use crate::steer::{brake, proportional, steer};

/// A body to keep clear of on its way.
#[derive(Debug, Clone)]
pub struct Avoid {
    body: Rc<Body>,
    track: Rc<Track>,
    /// Its greatest speed, in m/s.
    speed: f64,
    /// Farthest that a point of it, or of what it tows, is from its origin, in metres.
    span: f64,
    /// Circles that its origin does not leave, one for each [`WINDOW_S`] from time zero on.
    windows: Windows,
    /// The first time that counts, in seconds.
    pub from: f64,
    /// The time from which on it does not count any more.
    pub until: f64,
}

impl Avoid {
    /// A body on its way, from one time until another.
    pub fn new(body: Body, track: Rc<Track>, from: f64, until: f64) -> Self {
        let speeds = track
            .legs()
            .map(|leg| (leg.to.at - leg.from.at).norm() / leg.duration);
        Self {
            speed: speeds.fold(0.0, f64::max),
            span: span(&body, &track),
            windows: Windows::new(&track),
            body: Rc::new(body),
            track,
            from,
            until,
        }
    }

    /// The same, from one time until another.
    #[must_use]
    pub fn during(&self, from: f64, until: f64) -> Self {
        Self {
            from,
            until,
            ..self.clone()
        }
    }

    /// The end of its motion, in seconds.
    pub fn ends(&self) -> f64 {
        self.track.seconds()
    }

    /// Both touch at a time or later.
    pub fn touches_after(&self, other: &Self, time: f64) -> bool {
        let own = (&*self.body, &*self.track, &self.windows);
        other.meets(own, time, f64::INFINITY)
    }

    /// It is touched by a body between two times.
    fn meets(
        &self,
        (body, track, windows): (&Body, &Track, &Windows),
        from: f64,
        until: f64,
    ) -> bool {
        let reach = span(body, track) + self.span;
        let last = self.windows.last().max(windows.last());
        let mut window = (from / WINDOW_S) as usize;
        let mut begin = from;
        while begin < until {
            let end = if window > last {
                until
            } else {
                until.min((window + 1) as f64 * WINDOW_S)
            };
            let (one, other) = (windows.at(window), self.windows.at(window));
            let is_near = (one.0 - other.0).norm() <= one.1 + other.1 + reach;
            if is_near && clash((body, track), (&self.body, &self.track), begin, end).is_some() {
                return true;
            }
            (window, begin) = (window + 1, end);
        }
        false
    }

    /// The time from which on nothing changes about it.
    fn changes_until(&self) -> f64 {
        if self.until.is_finite() {
            self.until
        } else {
            self.track.seconds()
        }
    }

    /// A body that is nowhere farther from its origin than its span, which stays in a circle from one time until another, is not
    /// near.
    fn is_far(&self, span: f64, (centre, reach): (Pose, f64), from: f64, until: f64) -> bool {
        let (from, until) = (from.max(self.from), until.min(self.until));
        if from >= until {
            return true;
        }
        let way = self.speed * (until - from).min(self.track.seconds());
        let distance = (self.track.at(from).at - centre.at).norm();
        distance > span + self.span + reach + way
    }

    /// It is touched by a body on its way, which begins at its first knot.
    fn touches(&self, body: &Body, track: &Track, windows: &Windows, until: f64) -> bool {
        let from = track.knots[0].time.max(self.from);
        self.meets((body, track, windows), from, until.min(self.until))
    }
}

/// Farthest that a point of a body, or of what it tows, is from its origin, in metres.
fn span(body: &Body, track: &Track) -> f64 {
    let trail = track.trail.as_ref().map_or(0.0, |trail| trail.reach);
    body.radius.max(trail)
}

/// A motion in windows of time.
#[derive(Debug, Clone)]
struct Windows {
    /// The number of the first one.
    first: usize,
    /// Centres and radii.
    circles: Vec<(Vector, f64)>,
}

/// Seconds of a window.
const WINDOW_S: f64 = 1.0;

/// Most windows of a motion; it may be anywhere after them.
const MOST_WINDOWS: usize = 4096;

impl Windows {
    fn new(track: &Track) -> Self {
        let number = |time: f64| (time / WINDOW_S) as usize;
        let begin = track.knots[0].time;
        let (first, last) = (number(begin), number(track.seconds()));
        let mut knot = 0;
        let circles = (first..=last).take(MOST_WINDOWS).map(|window| {
            let (from, until) = (window as f64 * WINDOW_S, (window + 1) as f64 * WINDOW_S);
            let (from, until) = (from.max(begin), until.min(track.seconds()));
            let ends = [from, until].map(|time| Knot {
                time,
                pose: track.at(time),
            });
            while track.knots[knot].time < from {
                knot += 1;
            }
            let within = track.knots[knot..].iter();
            let within = within.take_while(|knot| knot.time <= until).copied();
            circle(&ends.into_iter().chain(within).collect::<Vec<_>>())
        });
        let mut circles: Vec<(Vector, f64)> = circles.collect();
        if last - first >= MOST_WINDOWS {
            circles.push((Vector::zeros(), f64::INFINITY));
        } else {
            circles.push((track.last().pose.at, 0.0));
        }
        Self { first, circles }
    }

    /// The last window in which it moves.
    fn last(&self) -> usize {
        self.first + self.circles.len() - 1
    }

    /// The circle of a window, and of all after the last one.
    fn at(&self, window: usize) -> (Vector, f64) {
        let number = window.saturating_sub(self.first);
        self.circles[number.min(self.circles.len() - 1)]
    }
}

/// Memory of a node with its places in the queue and among cells.
pub const NODE_BYTES: u64 = 320;

/// Bounds of a search.
pub struct Limits<'a> {
    /// Nodes that may still be expanded.
    pub nodes: u64,
    /// Most nodes in memory.
    pub memory: usize,
    /// True when the search has to end.
    pub stop: &'a mut dyn FnMut() -> bool,
}

/// Sizes of primitives and of what counts as the same.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Grain {
    /// Metres that a primitive leads at full speed.
    pub step_m: f64,
    /// Part of it within which states count as the same.
    pub alpha: f64,
    /// The factor of bounds from below (weighted A\*): a way costs at most so much more than the cheapest that there is.
    pub weight: f64,
}

/// A way that was found.
#[derive(Debug, Clone)]
pub struct Way {
    /// Its controls.
    pub course: Course,
    /// Its motion.
    pub track: Rc<Track>,
    /// Its body on that motion, for others.
    pub avoid: Avoid,
}

impl Way {
    /// A robot's way by controls.
    pub fn new(member: &Member, course: Course) -> Self {
        let track = Rc::new(course.track(&member.robot));
        let body = member.body.clone();
        Self {
            course,
            avoid: Avoid::new(body, Rc::clone(&track), 0.0, f64::INFINITY),
            track,
        }
    }
}

/// Result of a search.
#[derive(Debug, Clone)]
pub enum Outcome {
    /// A way.
    Found(Way),
    /// There is none with these primitives.
    Exhausted,
    /// A limit was met.
    Stopped,
}

/// Searches ways of one robot.
#[derive(Debug)]
pub struct Pathfinder<'a> {
    member: &'a Member,
    walls: Walls,
    /// As the trailer sees them.
    behind: Option<Walls>,
    remaining: Remaining,
    curves: Option<Curves>,
    /// Curves to the goal, and how far before it they end: what is left is driven straight; below zero for back.
    connections: Vec<(Curves, f64)>,
    movers: Vec<Avoid>,
    primitives: Primitives,
    wait: Primitive,
    /// Metres and radians within which states are the same.
    cell: [f64; 2],
    weight: f64,
    /// Lines of the last search between nodes and their parents, for those who want to see them.
    pub lines: Option<Vec<Line>>,
}

#[derive(Debug, Clone, Copy)]
enum Via {
    Start,
    /// From rates that are on no level to some that are.
    Join(Segment),
    Primitive(u16),
    Wait,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    state: State,
    level: Level,
    time: f64,
    cost: f64,
    parent: u32,
    via: Via,
}

struct Entry {
    estimate: f64,
    cost: f64,
    node: u32,
    /// The curve to the goal is part of the estimate.
    is_exact: bool,
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        let by_estimate = other.estimate.total_cmp(&self.estimate);
        let by_cost = self.cost.total_cmp(&other.cost);
        by_estimate
            .then(by_cost)
            .then(other.node.cmp(&self.node))
            .then(self.is_exact.cmp(&other.is_exact))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Entry {}

/// Ways that are cheaper by less than this are not looked for, in seconds.
const NO_LESS: f64 = 1e-6;

/// A primitive of a robot of second order changes its rates by at least this part of the greatest.
const LEAST_LEVEL: f64 = 0.25;

/// Most radians in a cell of headings.
const MOST_CELL_RAD: f64 = 0.35;

/// Distances from walls are known up to this many radii of a body.
const FIELD_RADII: f64 = 3.0;

/// Cells of distances per radius of a body.
const CELLS: f64 = 6.0;

/// Expansions between two looks at the clock.
const LOOK: u64 = 16;

/// The distances of a team's world; `None` if there is no time for them.
pub fn field(team: &Team<'_>, stop: &mut dyn FnMut() -> bool) -> Option<Rc<Field>> {
    let radii = || team.members.iter().map(|member| member.space.body.radius);
    let least = radii().fold(f64::INFINITY, f64::min);
    let most = radii().fold(0.0, f64::max);
    let cell = if least.is_finite() {
        least / CELLS
    } else {
        0.0
    };
    Field::new(team.scene.world, cell, FIELD_RADII * most, stop).map(Rc::new)
}

/// The way of primitives at first, in metres: the robot's size, and in a wide world more.
pub fn first_step(team: &Team<'_>, agent: usize) -> f64 {
    let bounds = team.scene.world.bounds;
    let extent = (bounds.max - bounds.min).max();
    team.members[agent].space.body.radius.max(extent / 50.0)
}

impl<'a> Pathfinder<'a> {
    /// For a robot of a team.
    pub fn new(team: &'a Team<'_>, agent: usize, field: &Rc<Field>, grain: Grain) -> Self {
        let step = step_seconds(&team.members[agent].robot, grain.step_m);
        Self::in_steps(team, agent, field, grain, step)
    }

    /// The same, with primitives of so many seconds.
    pub fn in_steps(
        team: &'a Team<'_>,
        agent: usize,
        field: &Rc<Field>,
        grain: Grain,
        step: f64,
    ) -> Self {
        let member = &team.members[agent];
        let robot = &member.robot;
        let movers = team.scene.movers.iter().map(|mover| {
            let track = Rc::new(mover.track.clone());
            Avoid::new(mover.body.clone(), track, 0.0, f64::INFINITY)
        });
        let primitives = Primitives::new(robot, step);
        let turn = (robot.top_turn_rate() * step).min(MOST_CELL_RAD / grain.alpha);
        let curves = Curves::new(robot);
        let behind = member.behind.as_ref();
        Self {
            member,
            walls: Walls::new(Rc::clone(field), Rc::clone(&member.space)),
            behind: behind.map(|space| Walls::new(Rc::clone(field), Rc::clone(space))),
            remaining: Remaining::new(Rc::clone(field), member),
            curves,
            connections: curves.map_or(Vec::new(), |curves| connections(robot, curves)),
            movers: movers.collect(),
            wait: primitives.rest(step),
            primitives,
            weight: grain.weight,
            cell: [grain.step_m, turn].map(|whole| (whole * grain.alpha).max(1e-9)),
            lines: None,
        }
    }

    /// The robot is clear of what stands at its start.
    pub fn is_free_at_start(&self) -> bool {
        self.member.is_free(&self.member.start)
    }

    /// A bound from below of the time from the start to the goal, in seconds.
    pub fn least_seconds(&self) -> f64 {
        let start = &self.member.start;
        self.remaining.seconds(&start.pose(), &start.rates)
    }

    /// Its primitives.
    pub fn primitives(&mut self) -> &mut Primitives {
        &mut self.primitives
    }

    /// The body touches what stands for certain.
    pub fn is_shut(&self, place: Vector) -> bool {
        self.walls.is_shut(place)
    }

    /// A motion touches nothing that stands. Where it begins has to be free.
    pub fn is_clear(&self, track: &Track) -> bool {
        let trail = track.trail.as_ref().zip(self.behind.as_ref());
        self.walls.is_clear(&track.knots)
            && trail.is_none_or(|(trail, walls)| walls.is_clear(&trail.track.knots))
    }

    /// A motion touches an obstacle that moves, before `until`.
    pub fn meets_mover(&self, track: &Track, until: f64) -> bool {
        let body = &self.member.body;
        let windows = Windows::new(track);
        let mut movers = self.movers.iter();
        movers.any(|mover| mover.touches(body, track, &windows, until))
    }

    /// A bound of the seconds from rest in a pose to another one, where nothing is in the way.
    pub fn seconds_to(&self, from: &Pose, to: &Waypoint) -> f64 {
        let robot = &self.member.robot;
        let is_goal = to.remaining_m == 0.0;
        let travel = (to.pose.at - from.at).norm() / robot.top_speed();
        if is_goal && self.member.goal.free.heading {
            return travel;
        }
        if let Some(curves) = self.curves {
            let ahead = curves.seconds(from, &to.pose);
            if is_goal {
                return ahead;
            }
            let turned = Pose {
                heading: to.pose.heading + PI,
                ..to.pose
            };
            return ahead.min(curves.seconds(from, &turned));
        }
        if !is_goal || !robot.has_heading {
            return travel;
        }
        let turn = wrapped(to.pose.heading - from.heading).abs() / robot.top_turn_rate();
        travel.max(turn)
    }

    /// The cell of a state's place, heading and joint.
    pub fn cell(&self, state: &State) -> [i32; 4] {
        let [place, turn] = self.cell;
        let part = |value: f64, cell: f64| (value / cell).floor() as i32;
        let heading = if self.member.robot.has_heading {
            part(wrapped(state.heading), turn)
        } else {
            0
        };
        let joint = if self.behind.is_some() {
            part(wrapped(state.heading - state.behind), turn)
        } else {
            0
        };
        [
            part(state.at.x, place),
            part(state.at.y, place),
            heading,
            joint,
        ]
    }

    /// Controls that lead from a state to rest at the goal exactly where nothing is in the way.
    pub fn connections(&self, state: &State) -> Vec<Vec<Segment>> {
        let (robot, goal) = (&self.member.robot, &self.member.goal);
        let stop = brake(robot, state);
        let rest = stop.map_or(*state, |stop| {
            robot.after(state, &stop.control, stop.seconds)
        });
        let (from, to) = (rest.pose(), goal.state.pose());
        let headings = match (&robot.car, goal.free.heading) {
            (_, false) if !robot.is_second => vec![to.heading],
            // Where any will do a car drives on straight, or arrives on the line to the goal.
            (Some(_), true) => {
                let way = to.at - from.at;
                vec![libm::atan2(way.y, way.x), from.heading]
            }
            _ => Vec::new(),
        };
        let curve = |(curves, straight): &(Curves, f64), heading: f64| {
            let before = Pose {
                at: to.at - rotated(Vector::new(*straight, 0.0), heading),
                heading,
            };
            let (_, mut segments) = curves.quickest(&from, &before)?;
            segments.extend(proportional(robot, &[*straight, 0.0, 0.0])?);
            Some(segments)
        };
        let ways: Vec<Vec<Segment>> = if goal.is_reached(&rest) {
            vec![Vec::new()]
        } else {
            let steered = steer(robot, &from, &to, goal.free.heading);
            let curves = headings.iter().flat_map(|heading| {
                let to_it = |way| curve(way, *heading);
                self.connections.iter().filter_map(to_it)
            });
            curves.chain(steered).collect()
        };
        let whole = |way| stop.into_iter().chain(way).collect();
        ways.into_iter().map(whole).collect()
    }

    /// The quickest way that costs less than `bound` and touches none of `avoid`. Touching one of `dodge` costs `penalty` seconds
    /// for each motion that does.
    pub fn find(
        &mut self,
        avoid: &[Avoid],
        dodge: (&[Avoid], f64),
        bound: f64,
        limits: &mut Limits<'_>,
    ) -> Outcome {
        if !self.is_free_at_start() {
            return Outcome::Exhausted;
        }
        self.find_from(&self.member.start, 0.0, (avoid, dodge), bound, limits)
    }

    /// The same from a state, which touches nothing, at a time in seconds. The course begins there and then.
    pub fn find_from(
        &mut self,
        start: &State,
        begin: f64,
        (avoid, (dodge, penalty)): (&[Avoid], (&[Avoid], f64)),
        bound: f64,
        limits: &mut Limits<'_>,
    ) -> Outcome {
        let all = avoid.iter().chain(&self.movers);
        let hard: Vec<Avoid> = all.cloned().collect();
        let changing = hard.iter().chain(dodge).map(Avoid::changes_until);
        let mut search = Search {
            hard: &hard,
            soft: dodge,
            penalty,
            changes_until: changing.fold(f64::NEG_INFINITY, f64::max),
            nodes: Vec::new(),
            open: BinaryHeap::new(),
            seen: HashMap::new(),
            best: bound,
            found: None,
            own: self,
        };
        search.begin(*start, begin);
        let ended = search.run(limits);
        if search.own.lines.is_some() {
            let at = |number: u32| search.nodes[number as usize].state.at.into();
            let ends = (0..).zip(&search.nodes).skip(1);
            let lines = ends.map(|(number, node)| [at(node.parent), at(number)]);
            search.own.lines = Some(lines.collect());
        }
        match search.way() {
            Some(way) => Outcome::Found(way),
            None if ended => Outcome::Exhausted,
            None => Outcome::Stopped,
        }
    }
}

/// Straight ways at the goal of a car with a trailer, in lengths of its hitch: the joint straightens ahead; below zero for back.
const STRAIGHT: [f64; 4] = [0.0, 1.0, 2.5, -1.0];

/// Part of the joint's limit that the widest curves bend it by when driven for ever.
const BENT: f64 = 0.9;

/// Curves by which a robot is connected to its goal.
fn connections(robot: &Robot, curves: Curves) -> Vec<(Curves, f64)> {
    let Some(trailer) = robot.trailer() else {
        return vec![(curves, 0.0)];
    };
    // On a circle of that radius the joint stays so.
    let wide = curves.wider(trailer.hitch / libm::sin(trailer.most.min(PI / 2.0) * BENT));
    let both = [curves, wide].into_iter();
    let all = both.flat_map(|curves| STRAIGHT.map(|part| (curves, part * trailer.hitch)));
    all.collect()
}

/// The duration of primitives.
pub fn step_seconds(robot: &Robot, step_m: f64) -> f64 {
    let (speed, turn) = (robot.top_speed(), robot.top_turn_rate());
    let mut step = if speed > 0.0 {
        step_m / speed
    } else if turn > 0.0 {
        MOST_CELL_RAD / turn
    } else {
        1.0
    };
    for axis in 0..3 {
        let [least, most] = robot.changes[axis];
        let (change, top) = (
            most.min(-least),
            robot.rates[axis][1].max(-robot.rates[axis][0]),
        );
        if change > 0.0 {
            step = step.max(LEAST_LEVEL * top / change);
        }
    }
    step
}

struct Search<'s, 'a> {
    own: &'s mut Pathfinder<'a>,
    hard: &'s [Avoid],
    soft: &'s [Avoid],
    penalty: f64,
    /// From then on nothing moves any more.
    changes_until: f64,
    nodes: Vec<Node>,
    open: BinaryHeap<Entry>,
    /// The cheapest node of every cell.
    seen: HashMap<[i32; 8], u32>,
    /// The cost of the best way, or what it has to cost less than.
    best: f64,
    /// The node from which the goal was reached, and the controls from there.
    found: Option<(u32, Vec<Segment>)>,
}

impl Search<'_, '_> {
    fn begin(&mut self, start: State, time: f64) {
        let level = self.own.primitives.level(&start.rates);
        self.nodes.push(Node {
            state: start,
            level,
            time,
            cost: 0.0,
            parent: 0,
            via: Via::Start,
        });
        let rates = self.own.primitives.rates(level);
        let excess = [0, 1, 2].map(|axis| start.rates[axis] - rates[axis]);
        if excess.iter().all(|rate| rate.abs() < 1e-12) {
            self.push(0);
            return;
        }
        // From rates between levels to a level.
        self.connect(0);
        let over = State {
            rates: excess,
            ..start
        };
        let Some(segment) = brake(&self.own.member.robot, &over) else {
            return;
        };
        let course = Course {
            start,
            segments: vec![segment],
        };
        let track = course.track(&self.own.member.robot).later(time);
        let clear = self.own.is_clear(&track);
        let until = time + segment.seconds;
        let Some(touched) = self.touched(&track, until).filter(|_| clear) else {
            return;
        };
        let state = course.end(&self.own.member.robot);
        self.nodes.push(Node {
            state,
            level,
            time: until,
            cost: segment.seconds + self.penalty * touched as f64,
            parent: 0,
            via: Via::Join(segment),
        });
        self.push(1);
    }

    /// True when all nodes were expanded that may lead to a cheaper way.
    fn run(&mut self, limits: &mut Limits<'_>) -> bool {
        let mut expanded = 0_u64;
        // A trailer's many connections take their time.
        let look = if self.own.behind.is_some() { 1 } else { LOOK };
        while let Some(entry) = self.open.pop() {
            if entry.estimate >= self.best - NO_LESS {
                return true;
            }
            let node = self.nodes[entry.node as usize];
            if self.seen.get(&self.cell(&node)) != Some(&entry.node) {
                continue;
            }
            if !entry.is_exact
                && let Some(curves) = self.own.curves
            {
                let goal = &self.own.member.goal;
                let curve = if goal.free.heading {
                    0.0
                } else {
                    curves.seconds(&node.state.pose(), &goal.state.pose())
                };
                let estimate = entry.estimate.max(node.cost + curve * self.own.weight);
                self.open.push(Entry {
                    estimate,
                    is_exact: true,
                    ..entry
                });
                continue;
            }
            if limits.nodes == 0
                || self.nodes.len() >= limits.memory
                || (expanded.is_multiple_of(look) && (limits.stop)())
            {
                return false;
            }
            limits.nodes -= 1;
            expanded += 1;
            self.connect(entry.node);
            self.expand(entry.node);
        }
        true
    }

    /// The cell in which a node is the same as others.
    fn cell(&self, node: &Node) -> [i32; 8] {
        let [x, y, heading, joint] = self.own.cell(&node.state);
        let time = if node.time < self.changes_until {
            ((node.time + 1e-9) / self.own.wait.seconds).floor() as i32
        } else {
            i32::MAX
        };
        let [one, two, three] = node.level.map(i32::from);
        [x, y, heading, joint, one, two, three, time]
    }

    /// Puts the last node into the queue.
    fn push(&mut self, number: u32) {
        let node = self.nodes[number as usize];
        let remaining = self
            .own
            .remaining
            .seconds(&node.state.pose(), &node.state.rates);
        self.seen.insert(self.cell(&node), number);
        self.open.push(Entry {
            estimate: node.cost + remaining * self.own.weight,
            cost: node.cost,
            node: number,
            is_exact: false,
        });
    }

    /// Others that a motion touches, of those that it may touch; none if it touches one that it may not.
    fn touched(&self, track: &Track, until: f64) -> Option<usize> {
        let body = &self.own.member.body;
        let windows = Windows::new(track);
        let touches = |avoid: &Avoid| avoid.touches(body, track, &windows, until);
        let free = !self.hard.iter().any(touches);
        free.then(|| self.soft.iter().filter(|avoid| touches(avoid)).count())
    }

    fn expand(&mut self, number: u32) {
        let node = self.nodes[number as usize];
        let set = self.own.primitives.from(node.level);
        for (own, primitive) in set.iter().enumerate() {
            self.follow(number, &node, primitive, Via::Primitive(own as u16));
        }
        if node.level == [0; 3] && node.time < self.changes_until {
            let wait = self.own.wait.clone();
            self.follow(number, &node, &wait, Via::Wait);
        }
    }

    /// Adds the node after a primitive.
    fn follow(&mut self, parent: u32, node: &Node, primitive: &Primitive, via: Via) {
        let member = self.own.member;
        let robot = &member.robot;
        let state = primitive
            .segments
            .iter()
            .fold(node.state, |state, segment| {
                robot.after(&state, &segment.control, segment.seconds)
            });
        let pose = state.pose();
        if self.own.walls.is_shut(pose.at) || !robot.allows_joint(&state) {
            return;
        }
        let time = node.time + primitive.seconds;
        let mut child = Node {
            // Sums of many changes would leave the lattice.
            state: State {
                rates: self.own.primitives.rates(primitive.to),
                ..state
            },
            level: primitive.to,
            time,
            cost: node.cost + primitive.seconds,
            parent,
            via,
        };
        let remaining = self.own.remaining.seconds(&pose, &child.state.rates);
        if child.cost + remaining >= self.best - NO_LESS {
            return;
        }
        let cell = self.cell(&child);
        let known = self.seen.get(&cell);
        let is_worse = |child: &Node| {
            known.is_some_and(|known| self.nodes[*known as usize].cost <= child.cost + NO_LESS)
        };
        if is_worse(&child) {
            return;
        }
        let start = node.state.pose();
        let (centre, reach) = primitive.around;
        let middle = robot.placed(
            &start,
            &Pose {
                at: centre,
                heading: 0.0,
            },
        );
        let span = robot.span(&member.body);
        let beyond = robot.span(&member.space.body) - member.space.body.radius;
        let is_open = self.own.walls.is_open(middle.at, reach + beyond);
        let is_far = |avoid: &Avoid| avoid.is_far(span, (middle, reach), node.time, time);
        let all_far = self.hard.iter().chain(self.soft).all(is_far);
        if !is_open || !all_far {
            let track = if self.own.behind.is_some() {
                // Where the trailer goes depends on its joint.
                let course = Course {
                    start: node.state,
                    segments: primitive.segments.clone(),
                };
                course.track(robot).later(node.time)
            } else {
                let knots = primitive.knots.iter().map(|knot| Knot {
                    time: node.time + knot.time,
                    pose: robot.placed(&start, &knot.pose),
                });
                Track::of(knots.collect())
            };
            if !is_open && !self.own.is_clear(&track) {
                return;
            }
            if !all_far {
                let Some(touched) = self.touched(&track, time) else {
                    return;
                };
                child.cost += self.penalty * touched as f64;
                if is_worse(&child) {
                    return;
                }
            }
        }
        self.nodes.push(child);
        self.push(self.nodes.len() as u32 - 1);
    }

    /// Tries to reach the goal from a node exactly.
    fn connect(&mut self, number: u32) {
        let node = self.nodes[number as usize];
        let member = self.own.member;
        let (robot, goal) = (&member.robot, &member.goal);
        for segments in self.own.connections(&node.state) {
            let seconds: f64 = segments.iter().map(|segment| segment.seconds).sum();
            let cost = node.cost + seconds;
            if cost >= self.best - NO_LESS {
                continue;
            }
            let course = Course {
                start: node.state,
                segments,
            };
            let is_towed_there = || course.is_allowed(robot) && goal.is_reached(&course.end(robot));
            if self.own.behind.is_some() && !is_towed_there() {
                continue;
            }
            let Some(touched) = self.touched_by(&course, node.time) else {
                continue;
            };
            let cost = cost + self.penalty * touched as f64;
            if cost < self.best - NO_LESS && goal.is_reached(&course.end(robot)) {
                self.best = cost;
                self.found = Some((number, course.segments));
            }
        }
    }

    /// Others that a course which begins at a time touches, of those that it may; none if it touches anything else.
    fn touched_by(&self, course: &Course, time: f64) -> Option<usize> {
        let robot = &self.own.member.robot;
        // Where it ends in a wall the rest need not be known.
        if course
            .states(robot)
            .any(|state| self.own.walls.is_shut(state.at))
        {
            return None;
        }
        let mut whole = Course::stay(course.start).track(robot).later(time);
        for (segment, start) in course.segments.iter().zip(course.states(robot)) {
            let part = Course {
                start,
                segments: vec![*segment],
            };
            let track = part.track(robot);
            if !self.own.is_clear(&track) {
                return None;
            }
            whole.append(track);
        }
        self.touched(&whole, f64::INFINITY)
    }

    /// The best way that was found.
    fn way(&mut self) -> Option<Way> {
        let (last, connection) = self.found.take()?;
        let mut parts: Vec<Vec<Segment>> = vec![connection];
        let mut number = last;
        loop {
            let node = self.nodes[number as usize];
            let level = self.nodes[node.parent as usize].level;
            match node.via {
                Via::Start => break,
                Via::Join(segment) => parts.push(vec![segment]),
                Via::Wait => parts.push(self.own.wait.segments.clone()),
                Via::Primitive(own) => {
                    let set = self.own.primitives.from(level);
                    parts.push(set[own as usize].segments.clone());
                }
            }
            number = node.parent;
        }
        let course = Course {
            start: self.nodes[0].state,
            segments: parts.into_iter().rev().flatten().collect(),
        };
        Some(Way::new(self.own.member, course))
    }
}
