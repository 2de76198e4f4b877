//! RRT\*: a tree of ways from rest to rest that gets better with every sample.
//!
//! S. Karaman, E. Frazzoli, "Sampling-based algorithms for optimal motion planning", IJRR 30(7), 2011: algorithm 6, with the
//! nearest neighbours of k-nearest RRT\*. J. D. Gammell, S. S. Srinivasa, T. D. Barfoot, "Informed RRT\*", IROS 2014: section IV.
//!
//! A motion is asked for when it would be used: a parent is tried by ascending cost, and of motions that would shorten the way
//! of a neighbour those alone are tested.

use std::f64::consts::{E, PI, TAU};

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::sssp::bodies::Pose;
use fleetyard_plugin_spacetime::random::Random;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::motions::Motions;
use super::near::{Found, Near, lifted};
use crate::plugin::{CLEARANCE_M, Line};

/// Options of `rrt-star`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Part of the samples that are the goal.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub goal_bias: f64,
    /// Longest motion from the nearest vertex to a new one, in metres (η); null: a fifth of the
    /// world's longer side.
    #[schemars(range(min = 0.000_001))]
    pub range_m: Option<f64>,
    /// Neighbours of a vertex, in e(1 + 1/d) ln n; above 1 the plans approach the optimum.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub rewire_factor: f64,
    /// With a plan in hand, samples are drawn where a faster way may lead (Informed RRT*).
    pub informed: bool,
    /// Poses that a direct motion makes needless are left out of plans; the paper has no such step.
    pub shorten: bool,
    /// Distance that the robot keeps from obstacles beyond touching, in metres, where there is room
    /// for it.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub clearance_m: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            goal_bias: 0.05,
            range_m: None,
            rewire_factor: 1.1,
            informed: true,
            shorten: true,
            clearance_m: CLEARANCE_M,
        }
    }
}

/// No vertex.
const NONE: u32 = u32::MAX;

/// Bytes of a vertex, with its entry among its neighbours.
pub const VERTEX_BYTES: u64 = 160;

/// Most vertices that are goals: a heading that does not matter is drawn so often.
const GOALS: usize = 64;

/// Most draws of a sample.
const MOST_DRAWS: u32 = 100;

/// A vertex that is reached sooner by less stays where it is, in seconds.
const LEAST_GAIN_S: f64 = 1e-12;

/// A pose at rest, and the way to it.
#[derive(Debug, Clone, Copy)]
struct Vertex {
    pose: Pose,
    /// Seconds from the start.
    cost: f64,
    /// Seconds from the parent.
    edge: f64,
    parent: u32,
    /// The children are a list.
    child: u32,
    next: u32,
    previous: u32,
}

/// The task of a tree.
#[derive(Debug, Clone, Copy)]
pub struct Task {
    /// A free pose.
    pub start: Pose,
    /// Another one.
    pub goal: Pose,
    /// The heading at the goal does not matter.
    pub any_heading: bool,
    /// The box of the world.
    pub bounds: Rectangle,
    /// No plan takes less seconds.
    pub least: f64,
}

/// A tree of ways from a start.
#[derive(Debug)]
pub struct Tree<'a> {
    motions: &'a Motions<'a>,
    task: Task,
    options: &'a Options,
    range: f64,
    /// e(1 + 1/d), with the factor.
    neighbours: f64,
    lever: f64,
    vertices: Vec<Vertex>,
    near: Near<3>,
    goals: Vec<u32>,
    /// Seconds of the fastest way that is known; infinite if none is.
    pub best: f64,
    random: Random,
    /// Samples that were drawn.
    pub samples: u64,
    /// Motions that were tested.
    pub tests: u64,
    found: Vec<Found>,
    candidates: Vec<Candidate>,
    changed: Vec<u32>,
}

/// A neighbour of a new vertex.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    number: u32,
    /// Seconds of the motion from it.
    edge: f64,
    /// Seconds from the start over it.
    cost: f64,
    is_blocked: bool,
}

impl<'a> Tree<'a> {
    /// A tree of its root alone.
    pub fn new(motions: &'a Motions<'a>, task: Task, options: &'a Options, seed: u64) -> Self {
        let (lever, extent) = (motions.lever(), task.bounds.max - task.bounds.min);
        let axes = if motions.turns { 3.0 } else { 2.0 };
        let root = Vertex {
            pose: task.start,
            cost: 0.0,
            edge: 0.0,
            parent: NONE,
            child: NONE,
            next: NONE,
            previous: NONE,
        };
        let mut near = Near::new(task.bounds, lever * TAU);
        near.insert(point(&task.start, lever), 0);
        Self {
            motions,
            task,
            options,
            range: options.range_m.unwrap_or(extent.max() / 5.0),
            neighbours: options.rewire_factor * E * (1.0 + 1.0 / axes),
            lever,
            vertices: vec![root],
            near,
            goals: Vec::new(),
            best: f64::INFINITY,
            random: Random::new(seed, 0),
            samples: 0,
            tests: 0,
            found: Vec::new(),
            candidates: Vec::new(),
            changed: Vec::new(),
        }
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.vertices.len()
    }

    /// Lines from vertices to their parents.
    pub fn lines(&self) -> impl Iterator<Item = Line> {
        let ends = |vertex: &Vertex| {
            let parent = self.vertices.get(vertex.parent as usize)?;
            Some([parent.pose.at.into(), vertex.pose.at.into()])
        };
        self.vertices.iter().filter_map(ends)
    }

    /// No way is faster than the one that is known.
    pub fn is_done(&self) -> bool {
        self.best <= self.task.least * (1.0 + 1e-9)
    }

    /// The poses of the fastest way of the tree.
    pub fn way(&self) -> Option<Vec<Pose>> {
        let cost = |number: &&u32| self.vertices[**number as usize].cost;
        let goals = self.goals.iter();
        let mut at = *goals.min_by(|one, other| cost(one).total_cmp(&cost(other)))?;
        let mut way = Vec::new();
        while at != NONE {
            let vertex = &self.vertices[at as usize];
            way.push(vertex.pose);
            at = vertex.parent;
        }
        way.reverse();
        Some(way)
    }

    /// Draws a sample, and extends the tree towards it. True if the fastest way got faster.
    pub fn grow(&mut self) -> bool {
        self.samples += 1;
        let (sample, mut is_goal) = self.sample();
        let metric = point(&sample, self.lever);
        self.neighbours_of(&metric);
        let Some(mut nearest) = self.nearest() else {
            return false;
        };
        if nearest.square == 0.0 {
            return false;
        }
        let mut pose = sample;
        if nearest.square > self.range * self.range {
            let from = self.vertices[nearest.number as usize].pose;
            pose = from.toward(&sample, self.range / nearest.square.sqrt());
            is_goal = false;
            self.neighbours_of(&point(&pose, self.lever));
            // Of the others some may be nearer to this pose.
            if let Some(other) = self.nearest() {
                nearest = other;
            }
        }
        let from = self.vertices[nearest.number as usize].pose;
        self.tests += 1;
        if self.motions.seconds(&from, &pose).is_infinite() || !self.motions.is_clear(&from, &pose)
        {
            return false;
        }
        let number = self.vertices.len() as u32;
        self.choose(&pose, nearest.number);
        self.near.insert(point(&pose, self.lever), number);
        if is_goal {
            self.goals.push(number);
        }
        self.rewire(number);
        self.improved()
    }

    /// A cost that is known from elsewhere.
    pub fn learn(&mut self, seconds: f64) {
        self.best = self.best.min(seconds);
    }

    fn improved(&mut self) -> bool {
        let costs = self.goals.iter();
        let costs = costs.map(|number| self.vertices[*number as usize].cost);
        let best = costs.fold(f64::INFINITY, f64::min);
        let better = best < self.best;
        self.best = self.best.min(best);
        better
    }

    fn neighbours_of(&mut self, metric: &[f64; 3]) {
        let count = self.neighbours * libm::log(self.vertices.len() as f64 + 1.0);
        let count = count.ceil().max(1.0) as usize;
        self.near.nearest(metric, count, &mut self.found);
    }

    fn nearest(&self) -> Option<Found> {
        self.found.iter().copied().min_by(|one, other| {
            let squares = one.square.total_cmp(&other.square);
            squares.then(one.number.cmp(&other.number))
        })
    }

    /// Adds a vertex below the neighbour over which it is reached soonest. The nearest one is joined to it.
    fn choose(&mut self, pose: &Pose, nearest: u32) {
        self.candidates.clear();
        for found in &self.found {
            let vertex = &self.vertices[found.number as usize];
            let edge = self.motions.seconds(&vertex.pose, pose);
            self.candidates.push(Candidate {
                number: found.number,
                edge,
                cost: vertex.cost + edge,
                is_blocked: false,
            });
        }
        let (mut parent, mut edge, mut cost) = (nearest, f64::INFINITY, f64::INFINITY);
        let open = |candidates: &[Candidate]| {
            let numbers = 0..candidates.len();
            let open = numbers.filter(|at| !candidates[*at].is_blocked);
            open.min_by(|one, other| {
                let costs = candidates[*one].cost.total_cmp(&candidates[*other].cost);
                costs.then(candidates[*one].number.cmp(&candidates[*other].number))
            })
        };
        while let Some(at) = open(&self.candidates) {
            let candidate = &mut self.candidates[at];
            let from = &self.vertices[candidate.number as usize].pose;
            self.tests += u64::from(candidate.number != nearest);
            if candidate.number == nearest || self.motions.is_clear(from, pose) {
                (parent, edge, cost) = (candidate.number, candidate.edge, candidate.cost);
                break;
            }
            candidate.is_blocked = true;
        }
        let number = self.vertices.len() as u32;
        self.vertices.push(Vertex {
            pose: *pose,
            cost,
            edge,
            parent: NONE,
            child: NONE,
            next: NONE,
            previous: NONE,
        });
        self.join(number, parent);
    }

    /// Neighbours that are reached sooner over a new vertex become its children.
    fn rewire(&mut self, number: u32) {
        let Vertex {
            pose, cost, parent, ..
        } = self.vertices[number as usize];
        let is_symmetric = self.motions.is_symmetric();
        for at in 0..self.candidates.len() {
            let candidate = self.candidates[at];
            let other = &self.vertices[candidate.number as usize];
            if candidate.number == parent || other.cost <= cost {
                continue;
            }
            if is_symmetric && candidate.is_blocked {
                continue;
            }
            let edge = self.motions.seconds(&pose, &other.pose);
            if cost + edge >= other.cost - LEAST_GAIN_S {
                continue;
            }
            self.tests += 1;
            if self.motions.is_clear(&pose, &other.pose) {
                self.leave(candidate.number);
                self.vertices[candidate.number as usize].edge = edge;
                self.join(candidate.number, number);
                self.renew(candidate.number);
            }
        }
    }

    fn join(&mut self, number: u32, parent: u32) {
        let next = self.vertices[parent as usize].child;
        self.vertices[parent as usize].child = number;
        if next != NONE {
            self.vertices[next as usize].previous = number;
        }
        let vertex = &mut self.vertices[number as usize];
        (vertex.parent, vertex.next, vertex.previous) = (parent, next, NONE);
    }

    fn leave(&mut self, number: u32) {
        let Vertex {
            parent,
            next,
            previous,
            ..
        } = self.vertices[number as usize];
        if previous == NONE {
            self.vertices[parent as usize].child = next;
        } else {
            self.vertices[previous as usize].next = next;
        }
        if next != NONE {
            self.vertices[next as usize].previous = previous;
        }
    }

    /// Costs of a vertex and of all below it follow from its parent's.
    fn renew(&mut self, number: u32) {
        self.changed.clear();
        self.changed.push(number);
        while let Some(at) = self.changed.pop() {
            let Vertex { parent, edge, .. } = self.vertices[at as usize];
            self.vertices[at as usize].cost = self.vertices[parent as usize].cost + edge;
            let mut child = self.vertices[at as usize].child;
            while child != NONE {
                self.changed.push(child);
                child = self.vertices[child as usize].next;
            }
        }
    }

    /// A pose, and whether it is the goal.
    fn sample(&mut self) -> (Pose, bool) {
        let wanted = if self.task.any_heading { GOALS } else { 1 };
        let share = self.random.share();
        if self.goals.len() < wanted && share < self.options.goal_bias {
            let pose = Pose {
                at: self.task.goal.at,
                heading: self.heading(self.task.any_heading, self.task.goal.heading),
            };
            return (pose, true);
        }
        let is_informed = self.options.informed && self.best.is_finite();
        let mut pose = self.task.start;
        for _ in 0..MOST_DRAWS {
            let at = if is_informed {
                self.informed()
            } else {
                self.anywhere()
            };
            let heading = self.heading(true, self.task.start.heading);
            pose = Pose { at, heading };
            if !is_informed || self.may_lead(&pose) {
                break;
            }
        }
        (pose, false)
    }

    /// A heading at random, if there are several.
    fn heading(&mut self, any: bool, otherwise: f64) -> f64 {
        if any && self.motions.turns {
            (self.random.share() - 0.5) * TAU
        } else if self.motions.turns {
            otherwise
        } else {
            self.task.start.heading
        }
    }

    fn anywhere(&mut self) -> Vector {
        let share = Vector::new(self.random.share(), self.random.share());
        let bounds = &self.task.bounds;
        bounds.min + (bounds.max - bounds.min).component_mul(&share)
    }

    /// A place in the ellipse of those over which a faster way may lead, or in the world where that is smaller.
    fn informed(&mut self) -> Vector {
        let Task {
            start,
            goal,
            bounds,
            ..
        } = &self.task;
        let (from, to) = (start.at, goal.at);
        let extent = bounds.max - bounds.min;
        let long = self.best * self.motions.robot().top_speed();
        let apart = (to - from).norm();
        let short = (long * long - apart * apart).max(0.0).sqrt();
        if PI / 4.0 * long * short >= extent.x * extent.y {
            return self.anywhere();
        }
        let in_disc = loop {
            let share = Vector::new(self.random.share(), self.random.share());
            let place = share * 2.0 - Vector::repeat(1.0);
            if place.norm_squared() <= 1.0 {
                break place;
            }
        };
        let along = if apart > 0.0 {
            (to - from) / apart
        } else {
            Vector::new(1.0, 0.0)
        };
        let across = Vector::new(-along.y, along.x);
        (from + to) / 2.0 + along * (in_disc.x * long / 2.0) + across * (in_disc.y * short / 2.0)
    }

    /// A way over this pose may be faster than the one that is known.
    fn may_lead(&self, pose: &Pose) -> bool {
        let Task {
            start,
            goal,
            any_heading,
            bounds,
            ..
        } = &self.task;
        let goal = Pose {
            heading: if *any_heading {
                pose.heading
            } else {
                goal.heading
            },
            ..*goal
        };
        let (low, high) = (pose.at - bounds.min, bounds.max - pose.at);
        low.min().min(high.min()) >= 0.0
            && self.motions.bound(start, pose) + self.motions.bound(pose, &goal) < self.best
    }
}

fn point(pose: &Pose, lever: f64) -> [f64; 3] {
    let around = if lever > 0.0 {
        lifted(pose.heading, lever)
    } else {
        0.0
    };
    [pose.at.x, pose.at.y, around]
}
