//! LaCAM*: search over configurations whose successors come one at a time.
//!
//! K. Okumura, "LaCAM: search-based algorithm for quick multi-agent pathfinding",
//! AAAI 2023; "Improving LaCAM for scalable eventually optimal multi-agent
//! pathfinding", IJCAI 2023; "Engineering LaCAM*", AAMAS 2024.
//!
//! A high-level node is a configuration, that is, a vertex for each agent. Below it
//! lies a tree of constraints "this agent goes there next", explored breadth first;
//! each constraint gives one successor, completed by PIBT. All constraints together
//! give all successors, so exhausting the search proves infeasibility, and, once a
//! solution is known, optimality for the *sum of loss*: the number of steps that
//! agents do not spend resting at their goals.
//!
//! The search is driven from outside, one [`Lacam::step`] at a time: it reads no clock.

use std::collections::HashMap;
use std::collections::VecDeque;
use std::hash::{BuildHasherDefault, Hasher};

use crate::pibt::{OneGoal, Pibt};
use crate::scatter::Guide;
use fleetyard_abi::leftovers::Leftover;
use fleetyard_plugin_spacetime::distance::Distances;
use fleetyard_plugin_spacetime::graph::{Graph, Vertex};
use fleetyard_plugin_spacetime::random::Random;

/// No node.
const NONE: u32 = u32::MAX;
/// The search goes back to the start once in so many meetings with a known node...
const RESTART_ONE_IN: usize = 1000;
/// ... and, when a solution is known, expands a random open node once in so many steps.
const RANDOM_ONE_IN: usize = 100;

/// Result of one step.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Step {
    /// Nothing of note.
    Searching,
    /// The goal was reached, or reached more cheaply.
    Improved,
    /// Nothing is left to explore.
    Exhausted,
}

/// High-level node.
#[derive(Debug)]
struct Node {
    configuration: Box<[Vertex]>,
    /// Agents by decreasing priority.
    order: Box<[u32]>,
    parent: u32,
    /// Cost from the start by the best known way, and lower bound of the rest.
    g: u64,
    h: u64,
    /// First and last of the constraints to try: a list in `constraints`.
    first: u32,
    last: u32,
    /// Known neighbours and the cost to them: both ways where moves can be undone.
    edges: Vec<(u32, u32)>,
    /// Next node whose configuration has the same hash.
    same_hash: u32,
}

/// Node of the constraint tree: `agent` goes to `vertex`, and so on up the parents.
#[derive(Debug, Clone, Copy)]
struct Constraint {
    parent: u32,
    depth: u32,
    agent: u32,
    vertex: Vertex,
    next: u32,
}

/// Hashes are computed here, not by the map.
#[derive(Debug, Default)]
struct Identity(u64);

impl Hasher for Identity {
    fn finish(&self) -> u64 {
        self.0
    }
    fn write(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.0 = self.0.rotate_left(8) ^ u64::from(byte);
        }
    }
    fn write_u64(&mut self, hash: u64) {
        self.0 = hash;
    }
}

/// The search.
pub(crate) struct Lacam<'g> {
    graph: &'g Graph,
    goals: Vec<Vertex>,
    guide: Guide,
    pibt: Pibt<'g>,
    samples: usize,
    random: Random,
    /// Agents by decreasing initial priority: the order among those at their goals.
    initial_order: Box<[u32]>,
    nodes: Leftover<Vec<Node>>,
    constraints: Leftover<Vec<Constraint>>,
    explored: Leftover<HashMap<u64, u32, BuildHasherDefault<Identity>>>,
    open: Vec<u32>,
    goal: u32,
    /// The node that PIBT has loaded.
    loaded: u32,
    fixed: Vec<(u32, Vertex)>,
    best: Vec<Vertex>,
}

impl<'g> Lacam<'g> {
    pub(crate) fn new(
        starts: &[Vertex],
        goals: &[Vertex],
        distances: &mut Distances<'g>,
        guide: Guide,
        (swap, rings): (bool, bool),
        samples: usize,
        random: Random,
    ) -> Self {
        let graph = distances.graph();
        let mut initial_order: Box<[u32]> = (0..starts.len() as u32).collect();
        initial_order.sort_by_key(|&a| {
            let a = a as usize;
            std::cmp::Reverse(distances.get(a, starts[a]))
        });
        let mut search = Self {
            graph,
            goals: goals.to_vec(),
            guide,
            pibt: Pibt::new(graph, goals.len(), swap, rings),
            samples: samples.max(1),
            random: random.clone(),
            initial_order,
            nodes: Leftover::default(),
            constraints: Leftover::default(),
            explored: Leftover::default(),
            open: Vec::new(),
            goal: NONE,
            loaded: NONE,
            fixed: Vec::new(),
            best: Vec::new(),
        };
        search.restart(starts, distances, random);
        search
    }

    /// Forgets everything and begins anew from `starts`.
    pub(crate) fn restart(
        &mut self,
        starts: &[Vertex],
        distances: &mut Distances<'g>,
        random: Random,
    ) {
        self.random = random;
        self.nodes.clear();
        self.constraints.clear();
        self.explored.clear();
        self.open.clear();
        self.goal = NONE;
        self.loaded = NONE;
        let root = self.add(starts.into(), hash_of(starts), NONE, 0, distances);
        self.open.push(root);
    }

    /// Approximate number of bytes that the search holds.
    pub(crate) fn bytes(&self) -> u64 {
        let node = size_of::<Node>() + 64 + 8 * self.goals.len();
        (self.nodes.len() * node + self.constraints.len() * size_of::<Constraint>()) as u64
    }

    /// Agent moves considered in one step, at most.
    pub(crate) fn work_per_step(&self) -> u64 {
        ((self.samples + 1) * self.goals.len()) as u64
    }

    /// Number of configurations met so far.
    pub(crate) fn len(&self) -> usize {
        self.nodes.len()
    }

    /// Sum of loss of the best known solution.
    pub(crate) fn cost(&self) -> Option<u64> {
        (self.goal != NONE).then(|| self.nodes[self.goal as usize].g)
    }

    /// The best known solution, as configurations from the starts to the goals.
    pub(crate) fn solution(&self) -> Vec<&[Vertex]> {
        let mut solution = Vec::new();
        let mut at = self.goal;
        while at != NONE {
            let node = &self.nodes[at as usize];
            solution.push(&*node.configuration);
            at = node.parent;
        }
        solution.reverse();
        solution
    }

    /// Tries one constraint of one node.
    pub(crate) fn step(&mut self, distances: &mut Distances<'g>) -> Step {
        let Some(&last) = self.open.last() else {
            return Step::Exhausted;
        };
        // A node picked at random stays where it is in the stack, whatever becomes of it.
        let picked = self.goal != NONE && self.random.one_in(RANDOM_ONE_IN);
        let at = if picked {
            self.open[self.random.below(self.open.len())]
        } else {
            last
        };
        if self.goal != NONE {
            let bound = self.nodes[self.goal as usize].g;
            let node = &self.nodes[at as usize];
            if node.g + node.h >= bound {
                self.drop_last_unless(picked);
                return Step::Searching;
            }
        } else if self.nodes[at as usize].h == 0 {
            self.goal = at;
            return Step::Improved;
        }
        if !self.next_constraint(at) {
            self.drop_last_unless(picked);
            return Step::Searching;
        }
        if !self.successor(at, distances) {
            return Step::Searching;
        }
        let before = self.cost();
        let hash = hash_of(&self.best);
        let known = self.find(hash, &self.best);
        if known == NONE {
            let configuration = self.best.as_slice().into();
            let cost = self.loss(at, &self.best);
            let new = self.add(configuration, hash, at, cost, distances);
            self.open.push(new);
        } else {
            self.connect(at, known);
            let restart = self.random.one_in(RESTART_ONE_IN);
            self.open.push(if restart { 0 } else { known });
        }
        if before.is_some() && self.cost() < before {
            Step::Improved
        } else {
            Step::Searching
        }
    }

    fn drop_last_unless(&mut self, picked: bool) {
        if !picked {
            self.open.pop();
        }
    }

    /// Makes a solution found by other means part of the search.
    pub(crate) fn insert(&mut self, solution: &[Box<[Vertex]>], distances: &mut Distances<'g>) {
        let mut at = 0;
        for configuration in solution.iter().skip(1) {
            let hash = hash_of(configuration);
            let known = self.find(hash, configuration);
            if known == NONE {
                let cost = self.loss(at, configuration);
                let new = self.add(configuration.clone(), hash, at, cost, distances);
                self.open.push(new);
                if self.goal == NONE && self.nodes[new as usize].h == 0 {
                    self.goal = new;
                }
                at = new;
            } else {
                self.connect(at, known);
                at = known;
            }
        }
    }

    /// Takes the next constraint of a node into `fixed`; false when there is none.
    fn next_constraint(&mut self, at: u32) -> bool {
        let node = &mut self.nodes[at as usize];
        let taken = node.first;
        if taken == NONE {
            return false;
        }
        let constraint = self.constraints[taken as usize];
        node.first = constraint.next;
        if node.first == NONE {
            node.last = NONE;
        }
        self.fixed.clear();
        let mut up = taken;
        loop {
            let constraint = self.constraints[up as usize];
            if constraint.depth == 0 {
                break;
            }
            self.fixed.push((constraint.agent, constraint.vertex));
            up = constraint.parent;
        }
        if let Some(&agent) = node.order.get(constraint.depth as usize) {
            let here = node.configuration[agent as usize];
            let mut choices = [here; 5];
            let mut count = 1;
            for v in self.graph.neighbors(here) {
                choices[count] = v;
                count += 1;
            }
            self.random.shuffle(&mut choices[..count]);
            for &vertex in &choices[..count] {
                let child = self.constraints.len() as u32;
                let depth = constraint.depth + 1;
                self.constraints.push(Constraint {
                    parent: taken,
                    depth,
                    agent,
                    vertex,
                    next: NONE,
                });
                if node.last == NONE {
                    node.first = child;
                } else {
                    self.constraints[node.last as usize].next = child;
                }
                node.last = child;
            }
        }
        true
    }

    /// Monte-Carlo configuration generation: the best of several PIBT steps under the
    /// constraints in `fixed`, left in `best`. False when all fail.
    fn successor(&mut self, at: u32, distances: &mut Distances<'g>) -> bool {
        let node = &self.nodes[at as usize];
        let mut wishes = OneGoal {
            goals: &self.goals,
            distances,
            guide: &self.guide,
        };
        if self.loaded != at {
            self.pibt.load(&node.configuration, &mut wishes);
            self.loaded = at;
        }
        let mut best_cost = u64::MAX;
        for _ in 0..self.samples {
            if !self
                .pibt
                .sample(&node.order, &self.fixed, &mut wishes, &mut self.random)
            {
                continue;
            }
            let mut cost = 0;
            let steps = node
                .configuration
                .iter()
                .zip(self.pibt.step())
                .zip(&self.goals);
            for (agent, ((&from, &to), &goal)) in steps.enumerate() {
                cost += u64::from(wishes.distances.get(agent, to));
                cost += u64::from(from != goal || to != goal);
            }
            if cost < best_cost {
                best_cost = cost;
                self.best.clear();
                self.best.extend_from_slice(self.pibt.step());
            }
        }
        best_cost != u64::MAX
    }

    /// Cost of the step from a node to a configuration.
    fn loss(&self, from: u32, to: &[Vertex]) -> u32 {
        let from = &self.nodes[from as usize].configuration;
        let steps = from.iter().zip(to).zip(&self.goals);
        steps
            .filter(|((from, to), goal)| from != goal || to != goal)
            .count() as u32
    }

    fn find(&self, hash: u64, configuration: &[Vertex]) -> u32 {
        let mut at = self.explored.get(&hash).copied().unwrap_or(NONE);
        while at != NONE && *self.nodes[at as usize].configuration != *configuration {
            at = self.nodes[at as usize].same_hash;
        }
        at
    }

    fn add(
        &mut self,
        configuration: Box<[Vertex]>,
        hash: u64,
        parent: u32,
        cost: u32,
        distances: &mut Distances<'g>,
    ) -> u32 {
        let id = self.nodes.len() as u32;
        let h = configuration
            .iter()
            .enumerate()
            .map(|(a, &v)| u64::from(distances.get(a, v)))
            .sum();
        // Priorities as in PIBT: an agent's grows while it is away from its goal and
        // falls back to the initial one there. Only the order matters, and it follows
        // from the parent's.
        let (order, g) = if parent == NONE {
            (self.initial_order.clone(), 0)
        } else {
            let up = &mut self.nodes[parent as usize];
            up.edges.push((id, cost));
            let up = &self.nodes[parent as usize];
            let away = |a: &&u32| configuration[**a as usize] != self.goals[**a as usize];
            let moving = up.order.iter().filter(away);
            let resting = self.initial_order.iter().filter(|a| !away(a));
            (
                moving.chain(resting).copied().collect(),
                up.g + u64::from(cost),
            )
        };
        let root = self.constraints.len() as u32;
        self.constraints.push(Constraint {
            parent: NONE,
            depth: 0,
            agent: NONE,
            vertex: NONE,
            next: NONE,
        });
        let same_hash = self.explored.insert(hash, id).unwrap_or(NONE);
        let edges = if parent == NONE || self.graph.is_directed() {
            Vec::new()
        } else {
            vec![(parent, cost)]
        };
        self.nodes.push(Node {
            configuration,
            order,
            parent,
            g,
            h,
            first: root,
            last: root,
            edges,
            same_hash,
        });
        id
    }

    /// Records that one node leads to another and passes on what that makes cheaper.
    fn connect(&mut self, from: u32, to: u32) {
        if from == to {
            return;
        }
        if !self.nodes[from as usize]
            .edges
            .iter()
            .any(|&(n, _)| n == to)
        {
            let cost = self.loss(from, &self.nodes[to as usize].configuration);
            self.nodes[from as usize].edges.push((to, cost));
            if !self.graph.is_directed() {
                self.nodes[to as usize].edges.push((from, cost));
            }
        }
        let mut queue = VecDeque::from([from]);
        while let Some(at) = queue.pop_front() {
            for k in 0..self.nodes[at as usize].edges.len() {
                let (next, cost) = self.nodes[at as usize].edges[k];
                let g = self.nodes[at as usize].g + u64::from(cost);
                let node = &mut self.nodes[next as usize];
                if g < node.g {
                    node.g = g;
                    node.parent = at;
                    let f = node.g + node.h;
                    queue.push_back(next);
                    if self.goal != NONE && f < self.nodes[self.goal as usize].g {
                        self.open.push(next);
                    }
                }
            }
        }
    }
}

/// Mixes a configuration into 64 bits.
fn hash_of(configuration: &[Vertex]) -> u64 {
    let mut hash = 0x9e37_79b9_7f4a_7c15_u64;
    for &v in configuration {
        hash = (hash.rotate_left(23) ^ u64::from(v)).wrapping_mul(0x2127_599b_f432_5c37);
    }
    hash ^ hash >> 32
}
