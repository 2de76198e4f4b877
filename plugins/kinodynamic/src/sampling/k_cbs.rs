//! K-CBS: conflict-based search over trees of controls.
//!
//! J. Kottinger, S. Almagor, M. Lahijanian, "Conflict-based search for multi-robot motion planning with kinodynamic
//! constraints", IROS 2022. Where two robots touch, one of them has to keep clear of the other's motion for as long as they
//! touch, and is planned anew. A pair that conflicts too often is merged: from then on a tree moves both, and the search begins
//! anew. A robot that finds no way in time is tried again later, for longer.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::rc::Rc;

use fleetyard_abi::leftovers::Leftover;
use fleetyard_plugin_plane::sssp::bodies::Body;
use fleetyard_plugin_spacetime::random::Random;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::drive::{Drive, Moving};
use super::joint::{Choices, Tree, solve};
use super::sst::{self, Sparse, longest};
use crate::course::{Course, Track};
use crate::plugin::{CLEARANCE_M, Team};
use crate::scene::clash;

/// A planner of single robots.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LowLevel {
    /// A kinodynamic RRT, as in the paper; the first way that it finds.
    Rrt,
    /// SST; the best way that it finds.
    Sst,
}

/// Options of `k-cbs`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// The planner of single robots; merged ones always have an RRT.
    pub low_level: LowLevel,
    /// Conflicts of a pair after which both are merged (B); null: never.
    pub merge_bound: Option<u32>,
    /// Controls after which a robot is given up for now; twice as many the next time.
    #[schemars(range(min = 1))]
    pub low_level_controls: u64,
    /// Longest time that a control is held, in seconds; null: what a tenth of the world's longer
    /// side takes at full speed, and speeding up.
    #[schemars(range(min = 0.000_001))]
    pub t_prop_s: Option<f64>,
    /// Part of the samples that are the goal.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub goal_bias: f64,
    /// Searches with other random numbers, of which the best plan counts; null: until the budget
    /// ends. The paper has one.
    #[schemars(range(min = 1))]
    pub rounds: Option<u64>,
    /// From new nodes robots are stopped and led to their goals exactly, where nothing is in the way;
    /// the paper has no such step.
    pub connect: bool,
    /// Distance that robots keep from all others beyond touching, in metres, where there is room for
    /// it.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub clearance_m: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            low_level: LowLevel::Rrt,
            merge_bound: Some(10),
            low_level_controls: 10_000,
            t_prop_s: None,
            goal_bias: 0.05,
            rounds: None,
            connect: true,
            clearance_m: CLEARANCE_M,
        }
    }
}

/// Seconds in steps of which the end of a conflict is looked for.
const STEP_S: f64 = 0.1;

/// Bytes of a node of a tree of single robots.
const TREE_NODE_BYTES: u64 = 400;

/// Bytes of a node of the tree of constraints, for each robot of a team.
const NODE_BYTES: u64 = 4096;

/// Bounds of the search.
pub struct Limits<'a> {
    /// Controls that may be tried.
    pub controls: u64,
    /// Bytes for trees.
    pub memory: u64,
    /// True when the search has to end.
    pub stop: &'a mut dyn FnMut() -> bool,
}

/// Figures of a search.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Effort {
    /// Controls that were tried.
    pub controls: u64,
    /// Nodes of the tree of constraints.
    pub nodes: u64,
    /// Times that a robot or a group was planned.
    pub plans: u64,
    /// Groups that were merged.
    pub merges: u64,
}

/// A motion of a robot, and the controls that make it.
#[derive(Debug)]
struct Motion {
    course: Course,
    track: Track,
}

/// A robot that has to keep clear of another's motion for some time.
#[derive(Debug, Clone)]
struct Constraint {
    robot: usize,
    other: usize,
    motion: Rc<Motion>,
    span: [f64; 2],
}

/// The beginning of a conflict of two robots.
#[derive(Debug, Clone, Copy)]
struct Conflict {
    pair: [usize; 2],
    time: f64,
}

/// A node of the tree of constraints.
#[derive(Debug)]
struct Node {
    constraints: Vec<Constraint>,
    /// Of all robots; of a group that has no plan yet those of its parent.
    motions: Vec<Rc<Motion>>,
    conflicts: Vec<Conflict>,
    /// The group that has to be planned still, and for how many controls.
    open: Option<(usize, u64)>,
}

/// A search for a team.
pub struct Search<'a> {
    team: &'a Team<'a>,
    options: &'a Options,
    seed: u64,
    drives: Vec<Drive<'a>>,
    /// Robots that are planned together.
    groups: Vec<Vec<usize>>,
    limits: Limits<'a>,
    /// Single robots have to take less seconds in sum.
    best: f64,
    /// Of the last plan of a group.
    tree: Leftover<Option<Tree>>,
    /// Figures.
    pub effort: Effort,
}

impl<'a> Search<'a> {
    /// Of a team.
    pub fn new(team: &'a Team<'a>, options: &'a Options, seed: u64, limits: Limits<'a>) -> Self {
        Self {
            team,
            options,
            seed,
            drives: (0..team.len())
                .map(|agent| Drive::new(team, agent))
                .collect(),
            groups: (0..team.len()).map(|agent| vec![agent]).collect(),
            limits,
            best: f64::INFINITY,
            tree: Leftover::default(),
            effort: Effort::default(),
        }
    }

    /// Begins anew with other random numbers, to find a plan that takes less seconds in sum.
    pub fn again(&mut self, best: f64) {
        self.groups = (0..self.team.len()).map(|agent| vec![agent]).collect();
        self.best = best;
    }

    /// A limit was met.
    pub fn is_over(&mut self) -> bool {
        self.effort.controls >= self.limits.controls || (self.limits.stop)()
    }

    /// Courses of all robots; none if a limit is met before, or where plans of single robots take too long already.
    pub fn run(&mut self) -> Option<Vec<Course>> {
        let mut known: BTreeMap<Vec<usize>, Vec<Rc<Motion>>> = BTreeMap::new();
        loop {
            let motions = self.root(&mut known)?;
            let seconds: f64 = motions.iter().map(|motion| motion.course.seconds()).sum();
            if seconds >= self.best {
                return None;
            }
            match self.search(motions) {
                Ended::Solved(courses) => return Some(courses),
                Ended::Stopped => return None,
                Ended::Merge([one, other]) => {
                    self.effort.merges += 1;
                    let more = self.groups.remove(one.max(other));
                    let group = &mut self.groups[one.min(other)];
                    group.extend(more);
                    group.sort_unstable();
                }
            }
        }
    }

    /// Plans of all groups on their own.
    fn root(
        &mut self,
        known: &mut BTreeMap<Vec<usize>, Vec<Rc<Motion>>>,
    ) -> Option<Vec<Rc<Motion>>> {
        let mut motions: Vec<Option<Rc<Motion>>> = vec![None; self.team.len()];
        for group in 0..self.groups.len() {
            let robots = self.groups[group].clone();
            let mut controls = self.options.low_level_controls;
            while !known.contains_key(&robots) {
                if let Some(planned) = self.plan(group, &[], controls) {
                    known.insert(robots.clone(), planned);
                } else if self.is_over() {
                    return None;
                }
                controls = controls.saturating_mul(2);
            }
            for (robot, motion) in robots.iter().zip(&known[&robots]) {
                motions[*robot] = Some(motion.clone());
            }
        }
        motions.into_iter().collect()
    }

    fn search(&mut self, motions: Vec<Rc<Motion>>) -> Ended {
        let mut counts: BTreeMap<[usize; 2], u32> = BTreeMap::new();
        let mut nodes: Vec<Option<Node>> = Vec::new();
        let mut queue: BinaryHeap<Reverse<(u64, usize, u64, usize)>> = BinaryHeap::new();
        let conflicts = self.conflicts(&motions, &(0..self.team.len()).collect::<Vec<_>>());
        let root = Node {
            constraints: Vec::new(),
            motions,
            conflicts,
            open: None,
        };
        let most = self.limits.memory / (NODE_BYTES * self.team.len() as u64).max(1);
        let push =
            |nodes: &mut Vec<Option<Node>>, queue: &mut BinaryHeap<_>, node: Node, first: u64| {
                let seconds: f64 = node
                    .motions
                    .iter()
                    .map(|motion| motion.course.seconds())
                    .sum();
                // Nanoseconds order as seconds do.
                queue.push(Reverse((
                    first,
                    node.conflicts.len(),
                    (seconds * 1e9) as u64,
                    nodes.len(),
                )));
                nodes.push(Some(node));
            };
        self.effort.nodes += 1;
        push(&mut nodes, &mut queue, root, 0);
        while let Some(Reverse((_, _, _, number))) = queue.pop() {
            let Some(node) = nodes[number].take() else {
                continue;
            };
            if self.is_over() || nodes.len() as u64 > most {
                // Other rounds free theirs: only now there is no time for it.
                drop(Leftover::new(nodes));
                return Ended::Stopped;
            }
            if let Some((group, controls)) = node.open {
                // Deferred behind nodes that have plans, and among each other by their controls.
                let (node, first) = self.planned(node, group, controls);
                push(&mut nodes, &mut queue, node, first);
                continue;
            }
            let times = node.conflicts.iter().enumerate();
            let first = times.min_by(|(_, one), (_, other)| one.time.total_cmp(&other.time));
            let Some((_, conflict)) = first else {
                let courses = node.motions.iter().map(|motion| motion.course.clone());
                return Ended::Solved(courses.collect());
            };
            let conflict = *conflict;
            let group_of = |robot: usize| {
                let mut groups = self.groups.iter();
                groups
                    .position(|group| group.contains(&robot))
                    .unwrap_or_default()
            };
            let pair = conflict.pair.map(group_of);
            let key = [pair[0].min(pair[1]), pair[0].max(pair[1])];
            let count = counts.entry(key).or_default();
            *count += 1;
            if self.options.merge_bound.is_some_and(|bound| *count > bound) {
                return Ended::Merge(key);
            }
            let span = self.span(&node.motions, &conflict);
            for (side, group) in pair.into_iter().enumerate() {
                let (robot, other) = (conflict.pair[side], conflict.pair[1 - side]);
                let mut constraints = node.constraints.clone();
                constraints.push(Constraint {
                    robot,
                    other,
                    motion: node.motions[other].clone(),
                    span,
                });
                let child = Node {
                    constraints,
                    motions: node.motions.clone(),
                    conflicts: node.conflicts.clone(),
                    open: None,
                };
                self.effort.nodes += 1;
                let (child, first) = self.planned(child, group, self.options.low_level_controls);
                push(&mut nodes, &mut queue, child, first);
            }
        }
        Ended::Stopped
    }

    /// The node with a new plan of a group, and its rank; or the node that waits for one.
    fn planned(&mut self, mut node: Node, group: usize, controls: u64) -> (Node, u64) {
        let robots = self.groups[group].clone();
        let Some(planned) = self.plan(group, &node.constraints, controls) else {
            let more = controls.saturating_mul(2);
            node.open = Some((group, more));
            return (node, more);
        };
        for (robot, motion) in robots.iter().zip(planned) {
            node.motions[*robot] = motion;
        }
        node.open = None;
        node.conflicts
            .retain(|conflict| !conflict.pair.iter().any(|robot| robots.contains(robot)));
        let conflicts = self.conflicts(&node.motions, &robots);
        node.conflicts.extend(conflicts);
        (node, 0)
    }

    /// Plans a group under constraints by at most so many controls.
    fn plan(
        &mut self,
        group: usize,
        constraints: &[Constraint],
        controls: u64,
    ) -> Option<Vec<Rc<Motion>>> {
        let robots = &self.groups[group];
        self.effort.plans += 1;
        let drives: Vec<Drive<'_>> = robots
            .iter()
            .map(|robot| {
                let mut drive = self.drives[*robot].clone();
                let own = constraints.iter().filter(|one| one.robot == *robot);
                drive.moving.extend(own.map(|one| Moving {
                    body: &self.team.members[one.other].body,
                    track: &one.motion.track,
                    span: one.span,
                }));
                drive
            })
            .collect();
        let bounds = drives[0].bounds();
        let side = (bounds.max - bounds.min).max();
        let held = robots
            .iter()
            .map(|robot| longest(&self.drives[*robot], side / 10.0));
        let choices = Choices {
            goal_bias: self.options.goal_bias,
            longest: self
                .options
                .t_prop_s
                .unwrap_or_else(|| held.fold(0.0, f64::max)),
            connect: self.options.connect,
            room: (self.limits.memory / (TREE_NODE_BYTES * robots.len() as u64)) as usize,
        };
        // Each tree has numbers of its own.
        let mut random = Random::new(self.seed, self.effort.plans);
        let (limits, effort) = (&mut self.limits, &mut self.effort);
        let mut left = controls;
        let mut goes_on = || {
            let goes_on = left > 0 && effort.controls < limits.controls;
            if !goes_on || (effort.controls.is_multiple_of(16) && (limits.stop)()) {
                return false;
            }
            left -= 1;
            effort.controls += 1;
            true
        };
        let courses = if self.options.low_level == LowLevel::Sst && robots.len() == 1 {
            let options = sst::Options {
                t_prop_s: Some(choices.longest),
                goal_bias: choices.goal_bias,
                connect: choices.connect,
                ..sst::Options::default()
            };
            let mut tree = Sparse::new(&drives[0], &options, random.below(1 << 32) as u64);
            while tree.nodes() < choices.room && goes_on() {
                tree.grow();
            }
            tree.course().map(|course| vec![course.clone()])
        } else {
            solve(&drives, choices, &mut random, &mut self.tree, &mut goes_on)
        };
        let motions = courses?.into_iter().zip(&drives).map(|(course, drive)| {
            let track = course.track(&drive.member.robot);
            Rc::new(Motion { course, track })
        });
        Some(motions.collect())
    }

    /// Conflicts of some robots with all others.
    fn conflicts(&self, motions: &[Rc<Motion>], robots: &[usize]) -> Vec<Conflict> {
        let mut conflicts = Vec::new();
        for one in robots {
            for other in 0..motions.len() {
                let is_told = robots.contains(&other) && other <= *one;
                let is_grouped = self
                    .groups
                    .iter()
                    .any(|group| group.contains(one) && group.contains(&other));
                if is_told || is_grouped {
                    continue;
                }
                let pair = [*one.min(&other), *one.max(&other)];
                let [a, b] = pair.map(|robot| self.moving(motions, robot));
                if let Some(time) = clash(a, b, 0.0, f64::INFINITY) {
                    conflicts.push(Conflict { pair, time });
                }
            }
        }
        conflicts
    }

    fn moving<'b>(&'b self, motions: &'b [Rc<Motion>], robot: usize) -> (&'b Body, &'b Track) {
        (&self.team.members[robot].body, &motions[robot].track)
    }

    /// The time in which two robots touch, from the beginning of their conflict on.
    fn span(&self, motions: &[Rc<Motion>], conflict: &Conflict) -> [f64; 2] {
        let [one, other] = conflict.pair.map(|robot| self.moving(motions, robot));
        let rest = one.1.seconds().max(other.1.seconds());
        let mut end = conflict.time;
        while end < rest && clash(one, other, end, end + STEP_S).is_some() {
            end += STEP_S;
        }
        let touches = end >= rest && clash(one, other, end, end + STEP_S).is_some();
        let end = if touches { f64::INFINITY } else { end + STEP_S };
        [(conflict.time - STEP_S).max(0.0), end]
    }
}

/// The end of a search in a tree of constraints.
enum Ended {
    Solved(Vec<Course>),
    Stopped,
    /// These groups conflict too often.
    Merge([usize; 2]),
}
