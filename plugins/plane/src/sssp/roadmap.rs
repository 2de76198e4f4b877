//! Roadmaps of single robots: a first one by RRT-Connect, and vertices that are sampled where the search asks for them
//! (Okumura and Défago, algorithms 2 and 3).
//!
//! Lengths and thresholds are shares of the longer side of the world, as in the paper's unit square; a heading counts as half a
//! turn per side (its robot "Line2d"). Costs are seconds.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::{PI, TAU};
use std::rc::Rc;

use fleetyard_plugin_spacetime::random::Random;

use super::Options;
use super::bodies::{Leg, Pose, Space, wrapped};
use crate::Vector;
use crate::bins::Rectangle;

/// The vertex of the start.
pub const START: u32 = 0;

/// A new vertex is joined to so many others at most.
const NEAREST: usize = 48;

/// No two vertices are closer, in sides of the world.
const LEAST: f64 = 1e-6;

/// A robot that wants to go somewhere.
#[derive(Debug, Clone)]
pub struct Robot {
    /// Its body among the obstacles.
    pub space: Rc<Space>,
    /// Metres per second.
    pub speed: f64,
    /// Radians per second; zero where it cannot turn.
    pub turn_rate: f64,
    /// Its pose at the beginning.
    pub start: Pose,
    /// Its pose in the end.
    pub goal: Pose,
}

impl Robot {
    /// The straight motion from pose to pose, as fast as it can be.
    pub fn leg(&self, from: Pose, to: Pose) -> Leg {
        let turn = wrapped(to.heading - from.heading);
        let drive = (to.at - from.at).norm() / self.speed;
        let turning = if turn == 0.0 {
            0.0
        } else {
            turn.abs() / self.turn_rate
        };
        Leg {
            from,
            to: Pose {
                heading: from.heading + turn,
                ..to
            },
            duration: drive.max(turning),
        }
    }

    /// The straight motion between two poses touches no obstacle. The first one has to be free.
    pub fn connects(&self, from: Pose, to: Pose) -> bool {
        let leg = self.leg(from, to);
        // Half a turn would be driven one way round there and the other way round back.
        let turn = (leg.to.heading - leg.from.heading).abs();
        turn < PI - 1e-9 && leg.duration.is_finite() && self.space.is_clear(&leg)
    }

    /// Its heading matters, and it can change it.
    pub fn has_heading(&self) -> bool {
        !self.space.body.is_disc() && self.turn_rate > 0.0
    }
}

/// Draws poses, and measures how far they are from each other.
#[derive(Debug)]
pub struct Sampler {
    bounds: Rectangle,
    side: f64,
    random: Random,
}

impl Sampler {
    /// In these bounds.
    pub fn new(bounds: Rectangle, seed: u64) -> Self {
        Self {
            bounds,
            side: (bounds.max - bounds.min).max(),
            random: Random::new(seed, 0),
        }
    }

    /// The diameter of a robot, in sides of the world.
    pub fn diameters(&self, robot: &Robot) -> f64 {
        2.0 * robot.space.body.radius / self.side
    }

    /// Distance of two poses, in sides of the world.
    fn distance(&self, robot: &Robot, from: &Pose, to: &Pose) -> f64 {
        let place = (to.at - from.at).norm_squared() / (self.side * self.side);
        let turn = if robot.has_heading() {
            wrapped(to.heading - from.heading) / PI
        } else {
            0.0
        };
        (place + turn * turn).sqrt()
    }

    /// Any order.
    pub fn shuffle(&mut self, order: &mut [usize]) {
        self.random.shuffle(order);
    }

    /// Any pose in the bounds.
    fn pose(&mut self, robot: &Robot) -> Pose {
        let extent = self.bounds.max - self.bounds.min;
        let share = Vector::new(self.random.share(), self.random.share());
        let heading = if robot.has_heading() {
            (self.random.share() - 0.5) * TAU
        } else {
            robot.start.heading
        };
        Pose {
            at: self.bounds.min + extent.component_mul(&share),
            heading,
        }
    }

    /// Two poses may be joined by an edge.
    fn connects(&self, robot: &Robot, options: &Options, from: Pose, to: Pose) -> bool {
        let near = options
            .epsilon
            .is_none_or(|most| self.distance(robot, &from, &to) <= most);
        near && robot.connects(from, to)
    }

    /// A pose on the way to `wanted` that is joined to `from`, by halving the way a few times; none where all of them fail.
    fn steer(&self, robot: &Robot, options: &Options, from: Pose, wanted: Pose) -> Option<Pose> {
        if self.connects(robot, options, from, wanted) {
            return Some(wanted);
        }
        let (mut safe, mut unsafe_part) = (0.0, 1.0);
        for _ in 0..options.steering_depth {
            let middle = f64::midpoint(safe, unsafe_part);
            if self.connects(robot, options, from, from.toward(&wanted, middle)) {
                safe = middle;
            } else {
                unsafe_part = middle;
            }
        }
        (safe > 0.0).then(|| from.toward(&wanted, safe))
    }
}

/// A roadmap of one robot; its edges lead both ways.
#[derive(Debug)]
pub struct Roadmap {
    poses: Vec<Pose>,
    edges: Vec<Vec<(u32, f64)>>,
    to_goal: Vec<f64>,
    goal: u32,
}

/// An entry of Dijkstra's queue; the greatest is the nearest.
struct Near(f64, u32);

impl PartialEq for Near {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Near {}

impl PartialOrd for Near {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Near {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}

impl Roadmap {
    /// The vertex of the goal.
    pub fn goal(&self) -> u32 {
        self.goal
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.poses.len()
    }

    /// The pose of a vertex.
    pub fn pose(&self, vertex: u32) -> Pose {
        self.poses[vertex as usize]
    }

    /// The vertices next to one.
    pub fn next(&self, vertex: u32) -> impl Iterator<Item = u32> {
        self.edges[vertex as usize].iter().map(|(to, _)| *to)
    }

    /// Seconds of the shortest way to the goal.
    pub fn to_goal(&self, vertex: u32) -> f64 {
        self.to_goal[vertex as usize]
    }

    /// The shortest way to the goal.
    pub fn way(&self, from: u32) -> Vec<Pose> {
        let (mut way, mut at) = (vec![self.pose(from)], from);
        while at != self.goal {
            let edges = self.edges[at as usize].iter();
            let ahead = edges.min_by(|a, b| {
                let through = |(to, cost): &(u32, f64)| cost + self.to_goal(*to);
                through(a).total_cmp(&through(b))
            });
            match ahead {
                Some((to, _)) if self.to_goal(*to) < self.to_goal(at) => at = *to,
                _ => break,
            }
            way.push(self.pose(at));
        }
        way
    }

    /// A first roadmap that joins start and goal, of the two trees of RRT-Connect (J. J. Kuffner, S. M. LaValle, ICRA 2000).
    /// None where `more` says no before there is one.
    pub fn connecting(
        robot: &Robot,
        sampler: &mut Sampler,
        options: &Options,
        more: &mut dyn FnMut() -> bool,
    ) -> Option<Self> {
        let (start, goal) = (robot.start, robot.goal);
        let mut roadmap = Self {
            poses: Vec::new(),
            edges: Vec::new(),
            to_goal: Vec::new(),
            goal: u32::from(robot.leg(start, goal).duration > 0.0),
        };
        roadmap.push(start);
        if roadmap.goal == START {
            roadmap.relax_from(START, 0.0);
            return Some(roadmap);
        }
        roadmap.push(goal);
        roadmap.relax_from(roadmap.goal, 0.0);
        if sampler.connects(robot, options, start, goal) {
            roadmap.join(robot, START, roadmap.goal);
            return Some(roadmap);
        }
        // Poses with the numbers of their parents.
        let mut trees = [vec![(start, 0)], vec![(goal, 0)]];
        let extend = |tree: &mut Vec<(Pose, usize)>, sampler: &Sampler, wanted: Pose| {
            let distances = tree
                .iter()
                .map(|(pose, _)| sampler.distance(robot, pose, &wanted));
            let (nearest, _) = distances.enumerate().min_by(|a, b| a.1.total_cmp(&b.1))?;
            let reached = sampler.steer(robot, options, tree[nearest].0, wanted)?;
            tree.push((reached, nearest));
            Some(reached)
        };
        for from in [0, 1].into_iter().cycle() {
            if !more() {
                return None;
            }
            let wanted = sampler.pose(robot);
            let Some(reached) = extend(&mut trees[from], sampler, wanted) else {
                continue;
            };
            if extend(&mut trees[1 - from], sampler, reached) == Some(reached) {
                break;
            }
        }
        let branch = |tree: &[(Pose, usize)]| {
            let mut at = tree.len() - 1;
            let mut branch = vec![tree[at].0];
            while at > 0 {
                at = tree[at].1;
                branch.push(tree[at].0);
            }
            branch
        };
        let mut way = branch(&trees[0]);
        way.reverse();
        // Both trees end where they met.
        way.extend(branch(&trees[1]).into_iter().skip(1));
        let mut last = START;
        for pose in &way[1..way.len() - 1] {
            let vertex = roadmap.add(robot, sampler, options, *pose);
            roadmap.join(robot, last, vertex);
            last = vertex;
        }
        roadmap.join(robot, last, roadmap.goal);
        // Of the other vertices those that fill space.
        for (pose, _) in trees.iter().flatten() {
            if roadmap.is_new(robot, sampler, pose, options.init_min_dist_thread) {
                roadmap.add(robot, sampler, options, *pose);
            }
        }
        Some(roadmap)
    }

    /// Samples vertices around one, as far as they are farther than `threshold` from all others.
    pub fn expand(
        &mut self,
        robot: &Robot,
        sampler: &mut Sampler,
        options: &Options,
        from: u32,
        threshold: f64,
    ) {
        for _ in 0..options.num_vertex_expansion {
            let wanted = sampler.pose(robot);
            let Some(pose) = sampler.steer(robot, options, self.pose(from), wanted) else {
                continue;
            };
            if self.is_new(robot, sampler, &pose, threshold) {
                self.add(robot, sampler, options, pose);
            }
        }
    }

    fn is_new(&self, robot: &Robot, sampler: &Sampler, pose: &Pose, threshold: f64) -> bool {
        let threshold = threshold.max(LEAST);
        let far = |known: &Pose| sampler.distance(robot, known, pose) > threshold;
        self.poses.iter().all(far)
    }

    fn push(&mut self, pose: Pose) -> u32 {
        self.poses.push(pose);
        self.edges.push(Vec::new());
        self.to_goal.push(f64::INFINITY);
        self.poses.len() as u32 - 1
    }

    /// Adds a vertex with edges to the goal and to the nearest, where they touch nothing. The paper joins it to all: with
    /// many vertices that is a lot of memory, and of ways that others block.
    fn add(&mut self, robot: &Robot, sampler: &Sampler, options: &Options, pose: Pose) -> u32 {
        let vertex = self.push(pose);
        let mut others: Vec<u32> = (0..vertex).collect();
        if others.len() > NEAREST {
            let distance = |other: u32| {
                if other == self.goal {
                    0.0
                } else {
                    sampler.distance(robot, &pose, &self.pose(other))
                }
            };
            let mut near: Vec<(f64, u32)> = others
                .into_iter()
                .map(|other| (distance(other), other))
                .collect();
            let nearer = |a: &(f64, u32), b: &(f64, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
            near.select_nth_unstable_by(NEAREST, nearer);
            near.truncate(NEAREST);
            near.sort_unstable_by(nearer);
            others = near.into_iter().map(|(_, other)| other).collect();
        }
        for other in others {
            if sampler.connects(robot, options, pose, self.pose(other)) {
                self.join(robot, vertex, other);
            }
        }
        vertex
    }

    /// Adds an edge, unless there is one, and brings distances up to date.
    fn join(&mut self, robot: &Robot, a: u32, b: u32) {
        if self.next(a).any(|known| known == b) {
            return;
        }
        let seconds = robot.leg(self.pose(a), self.pose(b)).duration;
        self.edges[a as usize].push((b, seconds));
        self.edges[b as usize].push((a, seconds));
        for (from, to) in [(a, b), (b, a)] {
            self.relax_from(to, self.to_goal(from) + seconds);
        }
    }

    /// A vertex has a way of so many seconds, and others a shorter one over it.
    fn relax_from(&mut self, vertex: u32, seconds: f64) {
        let mut queue = BinaryHeap::from([Near(seconds, vertex)]);
        while let Some(Near(seconds, vertex)) = queue.pop() {
            if seconds >= self.to_goal(vertex) {
                continue;
            }
            self.to_goal[vertex as usize] = seconds;
            let edges = self.edges[vertex as usize].iter();
            queue.extend(edges.map(|(to, cost)| Near(seconds + cost, *to)));
        }
    }
}
