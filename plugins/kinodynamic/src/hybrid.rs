//! Hybrid A*, for one robot among obstacles that stand.
//!
//! D. Dolgov, S. Thrun, M. Montemerlo, J. Diebel, "Path planning for autonomous vehicles in unknown semi-structured
//! environments", IJRR 29(5), 2010.
//!
//! A* over poses: every move leads from a pose to a pose, which is kept as it is, and of those in one bin of place and heading
//! the cheapest alone is expanded. The estimate is the greater of two: the time without obstacles, and the time of the
//! origin among obstacles, on a grid. Now and then controls that lead straight to the goal are tried (analytic expansion).
//!
//! Three things differ from the paper, whose car has a turning circle. Moves and the estimate without obstacles are those of
//! robots that may turn where they stand, in place of Reeds and Shepp's curves ([`steer`], [`Ahead`]). A way is made of curves
//! along which the rates keep their proportion, so that a robot of second order drives each of them from rest to rest; costs
//! are seconds. And the way is not smoothed by gradients, which would give up controls that are exact: of the poses on it those
//! are kept between which controls lead soonest.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};
use std::f64::consts::{FRAC_1_SQRT_2, FRAC_PI_2, PI, SQRT_2, TAU};

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::obstacles::Obstacles;
use fleetyard_plugin_plane::prioritised::World;
use fleetyard_plugin_plane::sssp::bodies::{Body, Leg, Pose, Space, wrapped};

use crate::course::{CHORD, Course, Segment};
use crate::plugin::Line;
use crate::robot::{Goal, Robot, State};
use crate::steer::{proportional, seconds_at_rates, seconds_lost, steer};

/// Length of a move by the side of a bin: it leads into another one.
const STEP_BINS: f64 = 1.5;

/// Bins by which the robot turns at once where it stands.
const TURN_BINS: f64 = 3.0;

/// Directions of a robot that moves to the side.
const DIRECTIONS: u32 = 16;

/// Most cells along one side of the grid of the estimate.
const MOST_CELLS: f64 = 1024.0;

/// Poses before one on the way from which controls to it are tried.
const WINDOW: usize = 64;

/// Expansions between two looks at the clock.
const UNLOOKED: u64 = 64;

/// Sizes of bins, and the end of a search.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// The side of a bin, in metres.
    pub side: f64,
    /// Bins of a full turn.
    pub headings: u32,
    /// Most expansions.
    pub expansions: u64,
    /// Most poses that are kept.
    pub poses: usize,
    /// Factor of the estimate, at least 1.
    pub weight: f64,
    /// Shortens the way that was found.
    pub shortens: bool,
}

/// The end of a search.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// Controls to the goal.
    Found(Course),
    /// No bin is left to be expanded.
    NoWay,
    /// It was told to stop, or a limit was met.
    Stopped,
}

/// A curve along which the rates keep their proportion.
#[derive(Debug, Clone)]
struct Move {
    /// The displacement along the robot's axes.
    by: [f64; 3],
    /// Seconds at full speed.
    seconds: f64,
    /// Seconds more for setting out and coming to rest.
    lost: f64,
    /// Poses along it, seen from its beginning, between which it is straight within [`CHORD`].
    way: Vec<Pose>,
}

#[derive(Debug, Clone, Copy)]
struct Node {
    pose: Pose,
    seconds: f64,
    before: u32,
    /// The move that led here.
    by: u32,
}

const NONE: u32 = u32::MAX;

/// The cheapest pose in a bin. A bin that is done has been expanded.
#[derive(Debug, Clone, Copy)]
struct Bin {
    node: u32,
    is_done: bool,
}

/// The motion from one pose on a way to a later one.
#[derive(Debug, Clone)]
enum Part {
    Move(u32),
    Controls(Vec<Segment>),
}

/// A robot, its world and its goal.
#[derive(Debug)]
pub struct Query<'a> {
    /// The robot.
    pub robot: &'a Robot,
    /// The obstacles at rest, as its body sees them.
    pub space: &'a Space,
    /// The world of that.
    pub world: &'a World,
    /// The goal, where it is to come to rest.
    pub goal: &'a Goal,
}

impl Query<'_> {
    /// Controls from rest in a pose to rest at the goal, and the number of expansions. `line` is given a line for
    /// every pose that is found, from the pose before.
    pub fn solve(
        &self,
        start: Pose,
        effort: &Effort,
        stop: &mut dyn FnMut() -> bool,
        line: &mut dyn FnMut(Line),
    ) -> (Outcome, u64) {
        Search::new(self, effort).run(start, stop, line)
    }

    /// A pose that lies within the goal's tolerances.
    fn is_goal(&self, pose: &Pose) -> bool {
        self.goal.is_reached(&State::rest(pose.at, pose.heading))
    }

    fn controls(&self, from: &Pose, to: &Pose, heading_free: bool) -> Option<(Vec<Segment>, f64)> {
        let segments = steer(self.robot, from, to, heading_free)?;
        let seconds = segments.iter().map(|segment| segment.seconds).sum();
        Some((segments, seconds))
    }

    /// The body touches nothing on its way from rest by these controls.
    fn is_clear(&self, around: &Obstacles, from: &Pose, segments: &[Segment]) -> bool {
        let course = Course {
            start: State::rest(from.at, from.heading),
            segments: segments.to_vec(),
        };
        let track = course.track(self.robot);
        track.legs().all(|leg| self.is_leg_clear(around, &leg))
    }

    /// The obstacles at rest, as a disc of this radius sees them.
    fn seen_by(&self, radius: f64) -> Obstacles {
        Obstacles::new(self.world.polygons.clone(), self.world.bounds, radius)
    }

    /// Controls straight to a pose lead the origin along a line.
    fn goes_straight(&self, heading_free: bool) -> bool {
        heading_free || !(self.robot.goes_sideways && self.robot.turns_axes)
    }

    /// The body touches nothing on a leg. A body around which a disc has room may turn as it likes.
    fn is_leg_clear(&self, around: &Obstacles, leg: &Leg) -> bool {
        around.clear(leg.from.at, leg.to.at) || self.space.is_clear(leg)
    }

    fn end(&self, from: &Pose, segments: &[Segment]) -> Pose {
        let course = Course {
            start: State::rest(from.at, from.heading),
            segments: segments.to_vec(),
        };
        course.end(self.robot).pose()
    }
}

struct Search<'a> {
    query: &'a Query<'a>,
    effort: &'a Effort,
    moves: Vec<Move>,
    estimate: Estimate,
    /// The obstacles at rest, as the disc around the body sees them, and as that inside of it does.
    around: Obstacles,
    inside: Obstacles,
    nodes: Vec<Node>,
    bins: HashMap<[i64; 3], Bin>,
    /// By estimated seconds in all, seconds left, and number; numbers of nodes, or of `ends` behind those.
    open: BinaryHeap<Reverse<(u64, u64, u32, bool)>>,
    /// Nodes from which these controls lead to the goal.
    ends: Vec<(u32, Vec<Segment>)>,
}

impl<'a> Search<'a> {
    fn new(query: &'a Query<'a>, effort: &'a Effort) -> Self {
        Self {
            moves: moves(query, effort),
            estimate: Estimate::new(query, effort.side),
            around: query.seen_by(query.space.body.radius),
            inside: query.seen_by(inner_radius(&query.space.body)),
            query,
            effort,
            nodes: Vec::new(),
            bins: HashMap::new(),
            open: BinaryHeap::new(),
            ends: Vec::new(),
        }
    }

    fn run(
        mut self,
        start: Pose,
        stop: &mut dyn FnMut() -> bool,
        line: &mut dyn FnMut(Line),
    ) -> (Outcome, u64) {
        self.push(start, 0.0, NONE, NONE);
        let (mut expansions, mut until_tried) = (0, 0_u64);
        while let Some(Reverse((_, left, number, is_end))) = self.open.pop() {
            if is_end {
                return (self.found(number, stop), expansions);
            }
            let node = self.nodes[number as usize];
            let bin = self.bin(&node.pose);
            let Some(bin) = self.bins.get_mut(&bin) else {
                continue;
            };
            if bin.node != number || std::mem::replace(&mut bin.is_done, true) {
                continue;
            }
            if expansions >= self.effort.expansions
                || self.nodes.len() >= self.effort.poses
                || (expansions % UNLOOKED == 0 && stop())
            {
                return (Outcome::Stopped, expansions);
            }
            expansions += 1;
            if self.query.is_goal(&node.pose) {
                self.end(number, Vec::new(), 0.0);
                continue;
            }
            if until_tried == 0 {
                self.try_end(number);
                // The farther the goal, the less likely nothing is in between.
                let steps = f64::from_bits(left) * self.query.robot.top_speed() / self.effort.side;
                until_tried = libm::sqrt(steps.max(0.0)) as u64;
            } else {
                until_tried -= 1;
            }
            self.expand(number, line);
        }
        (Outcome::NoWay, expansions)
    }

    fn expand(&mut self, number: u32, line: &mut dyn FnMut(Line)) {
        let node = self.nodes[number as usize];
        for by in 0..self.moves.len() {
            let own = &self.moves[by];
            // Who goes on in the same way does not stop.
            let lost = if node.by == by as u32 { 0.0 } else { own.lost };
            let seconds = node.seconds + own.seconds + lost;
            let placed = |relative: &Pose| self.query.robot.placed(&node.pose, relative);
            let Some(pose) = own.way.last().map(placed) else {
                continue;
            };
            let known = self.bins.get(&self.bin(&pose));
            let is_worse = known
                .is_some_and(|bin| bin.is_done || self.nodes[bin.node as usize].seconds <= seconds);
            if is_worse || !self.is_clear(&node.pose, &own.way) {
                continue;
            }
            line([node.pose.at.into(), pose.at.into()]);
            self.push(pose, seconds, number, by as u32);
        }
    }

    fn is_clear(&self, from: &Pose, way: &[Pose]) -> bool {
        let mut last = *from;
        way.iter().all(|relative| {
            let to = self.query.robot.placed(from, relative);
            let leg = Leg {
                from: std::mem::replace(&mut last, to),
                to,
                duration: 1.0,
            };
            self.query.is_leg_clear(&self.around, &leg)
        })
    }

    fn bin(&self, pose: &Pose) -> [i64; 3] {
        let per_turn = f64::from(self.effort.headings) / TAU;
        let heading = libm::floor(wrapped(pose.heading) * per_turn) as i64;
        let place = pose.at / self.effort.side;
        [
            libm::floor(place.x) as i64,
            libm::floor(place.y) as i64,
            heading.rem_euclid(i64::from(self.effort.headings)),
        ]
    }

    fn push(&mut self, pose: Pose, seconds: f64, before: u32, by: u32) {
        let number = self.nodes.len() as u32;
        let left = self.estimate.seconds(self.query, &pose);
        let bin = Bin {
            node: number,
            is_done: false,
        };
        self.bins.insert(self.bin(&pose), bin);
        self.nodes.push(Node {
            pose,
            seconds,
            before,
            by,
        });
        let all = (seconds + self.effort.weight * left).to_bits();
        self.open
            .push(Reverse((all, left.to_bits(), number, false)));
    }

    /// Tries controls that lead straight to the goal.
    fn try_end(&mut self, number: u32) {
        let (query, pose) = (self.query, self.nodes[number as usize].pose);
        let goal = query.goal;
        if let Some((segments, seconds)) =
            query.controls(&pose, &goal.state.pose(), goal.free.heading)
            && query.is_clear(&self.around, &pose, &segments)
        {
            self.end(number, segments, seconds);
        }
    }

    fn end(&mut self, node: u32, segments: Vec<Segment>, seconds: f64) {
        let all = self.nodes[node as usize].seconds + seconds;
        let number = self.ends.len() as u32;
        self.ends.push((node, segments));
        self.open.push(Reverse((all.to_bits(), 0, number, true)));
    }

    /// The way that ends so, as controls.
    fn found(&self, end: u32, stop: &mut dyn FnMut() -> bool) -> Outcome {
        let (mut at, last) = self.ends[end as usize].clone();
        let mut poses = Vec::new();
        let mut parts = Vec::new();
        loop {
            let node = &self.nodes[at as usize];
            poses.push(node.pose);
            if node.before == NONE {
                break;
            }
            parts.push(Part::Move(node.by));
            at = node.before;
        }
        poses.reverse();
        parts.reverse();
        let start = poses[0];
        if !last.is_empty() {
            let at = poses[poses.len() - 1];
            poses.push(self.query.end(&at, &last));
            parts.push(Part::Controls(last));
        }
        let own = self.joined(start, parts.iter().cloned());
        let shorter = if self.effort.shortens {
            self.shortened(&poses, &parts, stop)
        } else {
            None
        };
        let sooner = shorter
            .map(|parts| self.joined(start, parts.into_iter()))
            .filter(|shorter| shorter.seconds() < own.seconds());
        Outcome::Found(sooner.unwrap_or(own))
    }

    /// Parts one after the other, where a move that goes on does not stop.
    fn joined(&self, start: Pose, parts: impl Iterator<Item = Part>) -> Course {
        let mut segments = Vec::new();
        let mut going: Option<(u32, f64)> = None;
        let stop = |going: &mut Option<(u32, f64)>, segments: &mut Vec<Segment>| {
            if let Some((by, times)) = going.take() {
                let by = self.moves[by as usize].by.map(|number| number * times);
                segments.extend(proportional(self.query.robot, &by).unwrap_or_default());
            }
        };
        for part in parts {
            match part {
                Part::Move(by) => match &mut going {
                    Some((same, times)) if *same == by => *times += 1.0,
                    _ => {
                        stop(&mut going, &mut segments);
                        going = Some((by, 1.0));
                    }
                },
                Part::Controls(controls) => {
                    stop(&mut going, &mut segments);
                    segments.extend(controls);
                }
            }
        }
        stop(&mut going, &mut segments);
        Course {
            start: State::rest(start.at, start.heading),
            segments,
        }
    }

    /// The parts of a way over some of these poses: to each pose the soonest from those before it, by its own parts or by
    /// controls that lead straight there. `None` if that does not lead to the end, or is not done when it has to stop.
    fn shortened(
        &self,
        poses: &[Pose],
        parts: &[Part],
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<Vec<Part>> {
        let (query, robot) = (self.query, self.query.robot);
        let mut labels: Vec<Option<Label>> = vec![Some(Label {
            seconds: 0.0,
            pose: poses[0],
            before: 0,
            part: Part::Controls(Vec::new()),
        })];
        for at in 1..poses.len() {
            if stop() {
                return None;
            }
            let is_last = at + 1 == poses.len();
            let mut best: Option<Label> = None;
            if let Some(before) = &labels[at - 1]
                && before.pose == poses[at - 1]
            {
                let part = parts[at - 1].clone();
                let seconds = match &part {
                    Part::Move(by) => {
                        let own = &self.moves[*by as usize];
                        let goes_on = matches!(before.part, Part::Move(same) if same == *by);
                        own.seconds + if goes_on { 0.0 } else { own.lost }
                    }
                    Part::Controls(segments) => segments.iter().map(|one| one.seconds).sum(),
                };
                best = Some(Label {
                    seconds: before.seconds + seconds,
                    pose: poses[at],
                    before: at - 1,
                    part,
                });
            }
            for from in (at.saturating_sub(WINDOW)..at).rev() {
                let Some(before) = &labels[from] else {
                    continue;
                };
                let least = (poses[at].at - before.pose.at).norm() / robot.top_speed();
                let bound = best.as_ref().map_or(f64::INFINITY, |best| best.seconds);
                if before.seconds + least >= bound {
                    continue;
                }
                // On its way any heading will do, but in a narrow place that which was found there.
                let free = if is_last {
                    vec![query.goal.free.heading]
                } else {
                    vec![true, false]
                };
                for free in free {
                    let bound = best.as_ref().map_or(f64::INFINITY, |best| best.seconds);
                    let Some((segments, seconds)) = query.controls(&before.pose, &poses[at], free)
                    else {
                        continue;
                    };
                    let is_blocked = || {
                        query.goes_straight(free)
                            && !self.inside.clear(before.pose.at, poses[at].at)
                    };
                    if before.seconds + seconds >= bound
                        || is_blocked()
                        || !query.is_clear(&self.around, &before.pose, &segments)
                    {
                        continue;
                    }
                    best = Some(Label {
                        seconds: before.seconds + seconds,
                        pose: query.end(&before.pose, &segments),
                        before: from,
                        part: Part::Controls(segments),
                    });
                }
            }
            labels.push(best);
        }
        let mut found = Vec::new();
        let mut at = poses.len() - 1;
        while at > 0 {
            let label = labels[at].take()?;
            found.push(label.part);
            at = label.before;
        }
        found.reverse();
        Some(found)
    }
}

/// The soonest way to a pose that is known.
#[derive(Debug, Clone)]
struct Label {
    seconds: f64,
    pose: Pose,
    before: usize,
    part: Part,
}

/// Moves of a robot: arcs ahead and back and turns of wheels, straight lines in all directions and turns of others.
fn moves(query: &Query<'_>, effort: &Effort) -> Vec<Move> {
    let robot = query.robot;
    let step = STEP_BINS * effort.side;
    let turn = TURN_BINS * TAU / f64::from(effort.headings);
    let mut all: Vec<[f64; 3]> = Vec::new();
    if robot.goes_sideways {
        let directions =
            (0..DIRECTIONS).map(|number| TAU * f64::from(number) / f64::from(DIRECTIONS));
        all.extend(directions.map(|angle| {
            let (sin, cos) = libm::sincos(angle);
            // Rounding would make a direction another one.
            let [x, y] = [cos, sin].map(|part| if part.abs() < 1e-9 { 0.0 } else { part * step });
            [x, y, 0.0]
        }));
    } else {
        // At full speed on the tightest circle, half as tight, and on one at half the speed.
        let tightest = robot.top_turn_rate() / robot.top_speed() * step;
        for ahead in [step, -step] {
            all.extend(
                [0.0, 0.5, -0.5, 1.0, -1.0, 2.0, -2.0].map(|part| [ahead, 0.0, part * tightest]),
            );
        }
    }
    let turns = robot.has_heading
        && !(robot.goes_sideways && query.space.body.is_disc() && query.goal.free.heading);
    if turns {
        all.extend([[0.0, 0.0, turn], [0.0, 0.0, -turn]]);
    }
    let found = all.into_iter().filter_map(|by| {
        let seconds = seconds_at_rates(robot, &by);
        // Half a turn at once is none.
        if !(seconds > 0.0 && seconds.is_finite()) || by[2].abs() > PI {
            return None;
        }
        let lost = seconds_lost(robot, &by);
        // An arc is beside its chord by an eighth of its length times its turn.
        let parts = libm::sqrt(step * by[2].abs() / (8.0 * CHORD))
            .ceil()
            .max(1.0);
        let parts = if by[0] == 0.0 { 1.0 } else { parts };
        let even = Robot {
            is_second: false,
            ..robot.clone()
        };
        let origin = State::rest(Vector::zeros(), 0.0);
        let way = (1..=parts as u32).map(|part| {
            let after = f64::from(part) / parts;
            even.after(&origin, &by, after).pose()
        });
        Some(Move {
            by,
            seconds,
            lost,
            way: way.collect(),
        })
    });
    found.collect()
}

/// The time that is left, in seconds.
struct Estimate {
    /// Of wheels, without obstacles.
    ahead: Option<Ahead>,
    turn_rate: f64,
    grid: Distances,
}

impl Estimate {
    fn new(query: &Query<'_>, side: f64) -> Self {
        let robot = query.robot;
        let ahead = Ahead {
            speed: robot.rates[0][1],
            back: -robot.rates[0][0],
            turn_rate: robot.top_turn_rate(),
        };
        Self {
            ahead: (!robot.goes_sideways).then_some(ahead),
            turn_rate: robot.top_turn_rate(),
            grid: Distances::new(query, side),
        }
    }

    fn seconds(&self, query: &Query<'_>, pose: &Pose) -> f64 {
        let goal = query.goal;
        let way = goal.state.at - pose.at;
        let distance = (way.norm() - goal.place_m).max(0.0);
        let mut least = (distance / query.robot.top_speed()).max(0.0);
        if !goal.free.heading && self.turn_rate > 0.0 {
            let turn = wrapped(goal.state.heading - pose.heading).abs() - goal.heading_rad;
            least = least.max(turn / self.turn_rate);
        }
        if let Some(ahead) = &self.ahead
            && distance > 0.0
        {
            // Seen from the goal the way is driven the other way round.
            let direction = libm::atan2(way.y, way.x);
            let ends = [
                Some(pose.heading),
                (!goal.free.heading).then_some(goal.state.heading),
            ];
            for heading in ends.into_iter().flatten() {
                // The tolerance lets the direction differ.
                let slack = libm::asin((goal.place_m / way.norm()).min(1.0));
                let off = (wrapped(heading - direction).abs() - slack).max(0.0);
                least = least.max(ahead.seconds(distance, off));
            }
        }
        let among = self.grid.metres(pose.at) - goal.place_m;
        least.max(among / query.robot.top_speed())
    }
}

/// A bound of the time in which wheels get along a direction: meanwhile they turn at their greatest rate, and their speed counts
/// by the cosine of what is left to turn.
#[derive(Debug, Clone, Copy)]
pub struct Ahead {
    /// Greatest speed ahead, in m/s.
    pub speed: f64,
    /// Greatest speed back, in m/s; 0 or less if there is none.
    pub back: f64,
    /// Greatest turn rate, in rad/s.
    pub turn_rate: f64,
}

impl Ahead {
    /// Least seconds for a distance in metres along a direction that is `off` radians beside the heading, of driving ahead or of
    /// driving back.
    pub fn seconds(&self, distance: f64, off: f64) -> f64 {
        let [ahead, back] = [(self.speed, off), (self.back, PI - off)].map(|(speed, off)| {
            if speed > 0.0 {
                self.one_way(distance / speed, off)
            } else {
                f64::INFINITY
            }
        });
        ahead.min(back)
    }

    /// The same of one way to drive, for a distance in seconds at full speed.
    fn one_way(&self, distance: f64, off: f64) -> f64 {
        if off <= 0.0 {
            return distance;
        }
        if self.turn_rate <= 0.0 {
            return distance.max(0.0) / libm::cos(off).max(1e-9);
        }
        // Nothing is gained before it is a quarter turn.
        let first = (off - FRAC_PI_2).max(0.0) / self.turn_rate;
        let off = off.min(FRAC_PI_2);
        // ∫ cos(off − ωs) ds = distance.
        let whole = libm::sin(off) / self.turn_rate;
        let then = if distance <= whole {
            (off - libm::asin(libm::sin(off) - distance * self.turn_rate)) / self.turn_rate
        } else {
            off / self.turn_rate + distance - whole
        };
        first + then
    }
}

/// Distances of a robot's origin from the goal among obstacles, along a grid with eight neighbours, where the disc inside its
/// body has room.
struct Distances {
    corner: Vector,
    side: f64,
    columns: usize,
    metres: Vec<f32>,
}

impl Distances {
    fn new(query: &Query<'_>, side: f64) -> Self {
        let bounds = query.world.bounds;
        let extent = bounds.max - bounds.min;
        let inner = inner_radius(&query.space.body);
        // Where the disc goes through cells so small, their middles have half of its room, and nothing is between them.
        let side = side.min(inner * FRAC_1_SQRT_2);
        let side = side.max(extent.max() / MOST_CELLS);
        let count = |length: f64| (libm::ceil(length / side) as usize).max(1);
        let (columns, rows) = (count(extent.x), count(extent.y));
        let room = query.seen_by((inner - side * FRAC_1_SQRT_2).max(0.0));
        let lines = query.seen_by(0.0);
        let mut grid = Self {
            corner: bounds.min,
            side,
            columns,
            metres: vec![f32::INFINITY; columns * rows],
        };
        let middle = |cell: usize| {
            let (row, column) = (cell / columns, cell % columns);
            bounds.min + Vector::new(column as f64 + 0.5, row as f64 + 0.5) * side
        };
        let Some(goal) = grid.cell(query.goal.state.at) else {
            return grid;
        };
        let mut open = BinaryHeap::from([Reverse((0_u32, goal))]);
        grid.metres[goal] = 0.0;
        while let Some(Reverse((bits, cell))) = open.pop() {
            let metres = f32::from_bits(bits);
            if metres > grid.metres[cell] {
                continue;
            }
            let (row, column) = (cell / columns, cell % columns);
            for near_row in row.saturating_sub(1)..(row + 2).min(rows) {
                for near_column in column.saturating_sub(1)..(column + 2).min(columns) {
                    let near = near_row * columns + near_column;
                    let is_diagonal = near_row != row && near_column != column;
                    let step = side * if is_diagonal { SQRT_2 } else { 1.0 };
                    let sum = metres + step as f32;
                    let at = middle(near);
                    if sum < grid.metres[near]
                        && room.clear(at, at)
                        && lines.clear(middle(cell), at)
                    {
                        grid.metres[near] = sum;
                        open.push(Reverse((sum.to_bits(), near)));
                    }
                }
            }
        }
        grid
    }

    fn cell(&self, at: Vector) -> Option<usize> {
        let place = (at - self.corner) / self.side;
        if place.x < 0.0 || place.y < 0.0 {
            return None;
        }
        let (row, column) = (place.y as usize, place.x as usize);
        let cell = row * self.columns + column;
        (column < self.columns && cell < self.metres.len()).then_some(cell)
    }

    /// Metres to the goal; zero where the grid does not lead there.
    fn metres(&self, at: Vector) -> f64 {
        let metres = self
            .cell(at)
            .map_or(0.0, |cell| f64::from(self.metres[cell]));
        if metres.is_finite() {
            // The goal and the place are anywhere in their cells.
            (metres - SQRT_2 * self.side).max(0.0)
        } else {
            0.0
        }
    }
}

/// The radius of the disc about the origin inside of a body; 0 if the origin is outside.
fn inner_radius(body: &Body) -> f64 {
    if body.is_disc() {
        return body.radius;
    }
    let count = body.corners.len();
    let to_edge = |at: usize| {
        let (from, along) = (
            body.corners[at],
            body.corners[(at + 1) % count] - body.corners[at],
        );
        // Counter-clockwise: the inside is to the left.
        (along.x * -from.y - along.y * -from.x) / along.norm()
    };
    (0..count)
        .map(to_edge)
        .fold(f64::INFINITY, f64::min)
        .max(0.0)
}
