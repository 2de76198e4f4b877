//! Greedy best-first search over the vertices of all robots and whose turn it is (Okumura and Défago, algorithm 1).
//!
//! A node moves one robot to a vertex next to its own, or lets it stay. Before that the robot's roadmap grows around its vertex,
//! so that roadmaps are dense where the search goes. Once all nodes are expanded vertices may be closer to each other, and the
//! search begins anew on the roadmaps that there are.
//!
//! Two things are not in the paper. Among many robots a greedy search is soon stuck where one of them is in the way of another:
//! it begins anew in another order of turns after a number of nodes. Before, robots push each other ([`super::push`]).
//!
//! A node stores its parent and one vertex: the vertices of the others are those of as many ancestors as there are robots.
//! Visited nodes are known by a hash of 64 bits; two of the same hash would cost a way of the search, and no collision.

use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashSet};

use super::Options;
use super::bodies::{Body, Leg, Pose, hits};
use super::push::Pushing;
use super::roadmap::{Roadmap, Robot, START, Sampler};
use crate::tangent::Tangents;

/// A move of one robot while all others rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Move {
    /// Number of the robot.
    pub robot: usize,
    /// Its motion.
    pub leg: Leg,
}

/// Result of a search.
#[derive(Debug, Clone, PartialEq)]
pub enum Outcome {
    /// Moves one after the other.
    Solved(Vec<Move>),
    /// This robot's start touches an obstacle, or its goal.
    NotFree(usize),
    /// This robot, a disc, has no way to its goal, whatever the others do.
    NoWay(usize),
    /// These robots touch at their starts, or at their goals.
    Touching([usize; 2]),
    /// It was told to stop, or expanded all nodes that it may.
    Stopped,
}

/// Effort of a search.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub struct Effort {
    /// Nodes that were expanded.
    pub expanded: u64,
    /// Nodes that were generated.
    pub generated: u64,
    /// Samples of first roadmaps.
    pub samples: u64,
    /// Searches that began.
    pub rounds: u64,
}

/// Limits of a search.
pub struct Limits<'a> {
    /// Most nodes to expand, and samples of first roadmaps.
    pub nodes: u64,
    /// Most bytes for nodes.
    pub memory: u64,
    /// True when it has to end.
    pub stop: &'a mut dyn FnMut() -> bool,
}

/// Steps of pushing before the search is asked.
const STEPS: u64 = 100;

/// Nodes per robot of the shortest rounds of the search.
const PATIENCE: u64 = 100;

/// Samples of a first roadmap before a disc is asked for a proof that there is a way.
const SAMPLES: u64 = 1000;

/// Bytes of a node with its entries in queue and set.
const NODE_BYTES: u64 = 64;

/// The root's parent.
const NOBODY: u32 = u32::MAX;

#[derive(Debug, Clone, Copy)]
struct Node {
    parent: u32,
    /// Of the robot that moved last; none of the root.
    vertex: u32,
    /// Number of the robot that moves next.
    next: u32,
    hash: u64,
}

/// The greatest is the one with the least estimate, and of those the latest.
struct Entry {
    estimate: f64,
    node: u32,
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        let least = other.estimate.total_cmp(&self.estimate);
        least.then(self.node.cmp(&other.node))
    }
}

/// Moves of all robots to their goals, and the roadmaps as they are then.
pub fn solve(
    robots: &[Robot],
    sampler: &mut Sampler,
    options: &Options,
    limits: &mut Limits<'_>,
) -> (Outcome, Vec<Roadmap>, Effort) {
    let mut effort = Effort::default();
    if let Some(outcome) = wrong(robots) {
        return (outcome, Vec::new(), effort);
    }
    let mut roadmaps = Vec::with_capacity(robots.len());
    for (number, robot) in robots.iter().enumerate() {
        match first_roadmap(robot, sampler, options, limits, &mut effort) {
            First::Made(roadmap) => roadmaps.push(roadmap),
            First::NoWay => return (Outcome::NoWay(number), roadmaps, effort),
            First::Stopped => return (Outcome::Stopped, roadmaps, effort),
        }
    }
    let mut threshold = options.init_min_dist_thread;
    let mut order: Vec<usize> = (0..robots.len()).collect();
    let outcome = loop {
        effort.rounds += 1;
        let grow = |sampler: &mut Sampler, roadmap: &mut Roadmap, robot: usize, vertex: u32| {
            let threshold = threshold.min(sampler.diameters(&robots[robot]));
            roadmap.expand(&robots[robot], sampler, options, vertex, threshold);
        };
        let mut expand = || {
            effort.expanded += 1;
            effort.expanded + effort.samples <= limits.nodes && !(limits.stop)()
        };
        if options.pushes {
            let pushing = Pushing::new(robots, &mut roadmaps, sampler, &grow);
            if let Some(moves) = pushing.run(STEPS, &mut expand) {
                break Outcome::Solved(moves);
            }
        }
        let mut search = Search {
            robots,
            order: &order,
            roadmaps: &mut roadmaps,
            nodes: Vec::new(),
            generated: &mut effort.generated,
        };
        let most = Most {
            nodes: PATIENCE * robots.len() as u64 * luby(effort.rounds),
            bytes: limits.memory,
        };
        match search.run(
            &mut |roadmaps, robot, vertex| grow(sampler, &mut roadmaps[robot], robot, vertex),
            most,
            &mut expand,
        ) {
            Round::Solved(moves) => break Outcome::Solved(moves),
            Round::Stopped => break Outcome::Stopped,
            Round::Exhausted => threshold *= options.decreasing_rate_min_dist_thread,
            Round::Impatient => {}
        }
        sampler.shuffle(&mut order);
    };
    (outcome, roadmaps, effort)
}

enum First {
    Made(Roadmap),
    NoWay,
    Stopped,
}

/// The first roadmap of a robot. Where samples do not soon join start and goal of a disc, there may be no way.
fn first_roadmap(
    robot: &Robot,
    sampler: &mut Sampler,
    options: &Options,
    limits: &mut Limits<'_>,
    effort: &mut Effort,
) -> First {
    for most in [SAMPLES, u64::MAX] {
        let mut samples = 0;
        let mut more = || {
            (samples, effort.samples) = (samples + 1, effort.samples + 1);
            samples <= most && effort.samples <= limits.nodes && !(limits.stop)()
        };
        if let Some(roadmap) = Roadmap::connecting(robot, sampler, options, &mut more) {
            return First::Made(roadmap);
        }
        if effort.samples > limits.nodes || (limits.stop)() {
            break;
        }
        let way = robot.space.of_disc().map(|obstacles| {
            let mut tangents = Tangents::new(obstacles);
            tangents.shortest(robot.start.at, robot.goal.at, limits.stop)
        });
        if way == Some(None) && !(limits.stop)() {
            return First::NoWay;
        }
    }
    First::Stopped
}

/// The reason why nobody can plan.
fn wrong(robots: &[Robot]) -> Option<Outcome> {
    let free =
        |robot: &Robot| robot.space.is_free(&robot.start) && robot.space.is_free(&robot.goal);
    if let Some(robot) = robots.iter().position(|robot| !free(robot)) {
        return Some(Outcome::NotFree(robot));
    }
    for (second, b) in robots.iter().enumerate() {
        for (first, a) in robots[..second].iter().enumerate() {
            let touch =
                |own, other| hits(&a.space.body, &Leg::rest(own, 1.0), &b.space.body, &other);
            if touch(a.start, b.start) || touch(a.goal, b.goal) {
                return Some(Outcome::Touching([first, second]));
            }
        }
    }
    None
}

enum Round {
    Solved(Vec<Move>),
    /// Nothing is left to expand.
    Exhausted,
    /// It expanded as many nodes as it may.
    Impatient,
    Stopped,
}

/// Limits of one round.
#[derive(Clone, Copy)]
struct Most {
    nodes: u64,
    bytes: u64,
}

/// Number `n` of 1, 1, 2, 1, 1, 2, 4, 1, … from 1 on (M. Luby, A. Sinclair, D. Zuckerman, Information Processing Letters 47,
/// 1993): restarts that are about as good as those of the best fixed length.
fn luby(mut number: u64) -> u64 {
    loop {
        let power = (number + 1).next_power_of_two();
        if number + 1 == power {
            return power / 2;
        }
        number -= power / 2 - 1;
    }
}

/// A number for a robot at a vertex, of which those of a team are joined by ⊕ (A. Zobrist, University of Wisconsin, 1970);
/// mixed as in splitmix64.
fn place(robot: usize, vertex: u32) -> u64 {
    let mut mixed = ((robot as u64) << 32 | u64::from(vertex)).wrapping_add(0x9e37_79b9_7f4a_7c15);
    mixed = (mixed ^ (mixed >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    mixed = (mixed ^ (mixed >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    mixed ^ (mixed >> 31)
}

/// The same for the robot that is next.
fn turn(next: u32) -> u64 {
    place(usize::MAX >> 32, next)
}

/// One round of the search.
struct Search<'a> {
    robots: &'a [Robot],
    /// Robots in the order of their turns.
    order: &'a [usize],
    roadmaps: &'a mut [Roadmap],
    nodes: Vec<Node>,
    generated: &'a mut u64,
}

impl Search<'_> {
    fn run(
        &mut self,
        grow: &mut dyn FnMut(&mut [Roadmap], usize, u32),
        most: Most,
        expand: &mut dyn FnMut() -> bool,
    ) -> Round {
        let team = self.robots.len();
        let root = (0..team).fold(0, |hash, robot| hash ^ place(robot, START));
        self.nodes.push(Node {
            parent: NOBODY,
            vertex: START,
            next: 0,
            hash: root,
        });
        let mut visited = HashSet::from([root ^ turn(0)]);
        let mut open = BinaryHeap::from([Entry {
            estimate: 0.0,
            node: 0,
        }]);
        let mut at = vec![START; team];
        let mut expanded = 0;
        while let Some(Entry { node: number, .. }) = open.pop() {
            if !expand() {
                return Round::Stopped;
            }
            expanded += 1;
            let size = self.nodes.len() as u64 * NODE_BYTES;
            if expanded > most.nodes || size > most.bytes {
                return Round::Impatient;
            }
            self.load(number, &mut at);
            if std::iter::zip(&*self.roadmaps, &at).all(|(roadmap, at)| roadmap.goal() == *at) {
                return Round::Solved(self.moves(number));
            }
            let node = self.nodes[number as usize];
            let robot = self.order[node.next as usize];
            grow(self.roadmaps, robot, at[robot]);
            for (estimate, child) in self.children(number, &at, &mut visited) {
                open.push(Entry {
                    estimate,
                    node: self.nodes.len() as u32,
                });
                self.nodes.push(child);
                *self.generated += 1;
            }
        }
        Round::Exhausted
    }

    /// The nodes after one that were not visited yet, with their estimates.
    fn children(&self, number: u32, at: &[u32], visited: &mut HashSet<u64>) -> Vec<(f64, Node)> {
        let node = self.nodes[number as usize];
        let robot = self.order[node.next as usize];
        let (own, roadmap, vertex) = (&self.robots[robot], &self.roadmaps[robot], at[robot]);
        let others = std::iter::zip(self.robots, std::iter::zip(&*self.roadmaps, at)).enumerate();
        let others = others.filter(|(other, _)| *other != robot);
        let others: Vec<(&Body, Pose, f64)> = others
            .map(|(_, (other, (roadmap, at)))| {
                (&other.space.body, roadmap.pose(*at), roadmap.to_goal(*at))
            })
            .collect();
        let rest: f64 = others.iter().map(|(_, _, to_goal)| to_goal).sum();
        let next = (node.next + 1) % self.order.len() as u32;
        let mut children = Vec::new();
        for to in roadmap.next(vertex).chain([vertex]) {
            let hash = node.hash ^ place(robot, vertex) ^ place(robot, to);
            if visited.contains(&(hash ^ turn(next))) {
                continue;
            }
            let leg = own.leg(roadmap.pose(vertex), roadmap.pose(to));
            let touches =
                |(body, pose, _): &(&Body, Pose, f64)| hits(&own.space.body, &leg, body, pose);
            if to != vertex && others.iter().any(touches) {
                continue;
            }
            visited.insert(hash ^ turn(next));
            let child = Node {
                parent: number,
                vertex: to,
                next,
                hash,
            };
            children.push((rest + roadmap.to_goal(to), child));
        }
        children
    }

    /// The robot that made a node by its move.
    fn moved(&self, node: &Node) -> usize {
        let team = self.order.len();
        self.order[(node.next as usize + team - 1) % team]
    }

    /// The vertices of all robots in a node.
    fn load(&self, number: u32, at: &mut [u32]) {
        at.fill(START);
        let mut node = &self.nodes[number as usize];
        for _ in 0..at.len() {
            if node.parent == NOBODY {
                break;
            }
            at[self.moved(node)] = node.vertex;
            node = &self.nodes[node.parent as usize];
        }
    }

    /// The moves that lead to a node, without stays.
    fn moves(&self, last: u32) -> Vec<Move> {
        let mut line = Vec::new();
        let mut node = &self.nodes[last as usize];
        while node.parent != NOBODY {
            line.push((self.moved(node), node.vertex));
            node = &self.nodes[node.parent as usize];
        }
        let mut at = vec![START; self.robots.len()];
        let mut moves = Vec::new();
        for (robot, to) in line.into_iter().rev() {
            if at[robot] != to {
                let pose = |vertex| self.roadmaps[robot].pose(vertex);
                let leg = self.robots[robot].leg(pose(at[robot]), pose(to));
                moves.push(Move { robot, leg });
                at[robot] = to;
            }
        }
        moves
    }
}
