//! LaCAM on roadmaps: search over configurations whose successors come one at a time.
//!
//! K. Okumura, "LaCAM: search-based algorithm for quick multi-agent pathfinding", AAAI 2023; "Improving LaCAM for scalable eventually
//! optimal multi-agent pathfinding", IJCAI 2023. A node is a configuration, that is, a vertex for each disc. Below it lies a tree of
//! constraints "this disc goes along that edge next", explored breadth first; each constraint gives one successor, which a
//! generator in the manner of PIBT completes ([`step`]).
//!
//! Time is continuous in what follows, not in the search: in a step every disc stays or drives one edge, all set out at once, and a
//! step is over when all have arrived. Two motions are compatible if their discs keep their distance until then, so that crossing
//! edges and vertices closer than the separation are seen as they are. A sequence of steps is a plan, if a slow one. [`schedule`]
//! makes it fast: it keeps who passes first and gives everybody the earliest times.

pub mod schedule;
pub mod step;

use std::collections::HashMap;
use std::rc::Rc;

use fleetyard_abi::leftovers::Leftover;
use fleetyard_plugin_spacetime::random::Random;

use crate::closeness::Closeness;
use crate::roadmap::{Edge, NONE, Vertex};
use crate::sipp::Task;
use step::{Choice, Generator};

/// The search goes back to the start once in so many meetings with a known node.
const RESTART_ONE_IN: usize = 1000;

/// Limits of a run.
pub struct Control<'a> {
    /// True once the budget is spent; asked often.
    pub stop: &'a mut dyn FnMut() -> bool,
    /// At most so many configurations are made from others.
    pub nodes: u64,
    /// About how many bytes the search may hold beside the roadmap.
    pub memory: u64,
}

/// Reason why a search ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum End {
    /// With the edges that each disc drives, step by step; [`NONE`] where it stays.
    Solved(Vec<Vec<Edge>>),
    /// It was told to stop, or made all nodes that it may.
    Stopped,
    /// There is nothing left to try: in steps there is no plan.
    Exhausted,
    /// It needs more memory than it may have.
    Memory,
}

/// A configuration.
struct Node {
    places: Rc<[Vertex]>,
    /// Discs by decreasing priority.
    order: Box<[u32]>,
    /// The node before, and the edges from there.
    parent: u32,
    edges: Box<[Edge]>,
    /// First and last of the constraints to try: a list in `constraints`.
    first: u32,
    last: u32,
}

/// A node of the constraint tree: `disc` does this, and so on up the parents.
#[derive(Clone, Copy)]
struct Constraint {
    parent: u32,
    depth: u32,
    disc: u32,
    choice: Choice,
    next: u32,
}

/// The root of a constraint tree.
const ROOT: Constraint = Constraint {
    parent: NONE,
    depth: 0,
    disc: NONE,
    choice: Choice::STAY,
    next: NONE,
};

struct Lacam<'a> {
    closeness: &'a Closeness,
    tasks: &'a [Task<'a>],
    generator: Generator<'a>,
    random: Random,
    /// Discs by decreasing priority at first: the order among those at their goals.
    initial: Box<[u32]>,
    nodes: Leftover<Vec<Node>>,
    constraints: Leftover<Vec<Constraint>>,
    known: Leftover<HashMap<Rc<[Vertex]>, u32>>,
    open: Vec<u32>,
}

/// Searches for steps that lead all discs to the goals where they stay, and says how many configurations it made.
pub fn search(
    closeness: &Closeness,
    tasks: &[Task<'_>],
    seed: u64,
    control: &mut Control<'_>,
) -> (End, u64) {
    let roadmap = closeness.roadmap();
    let alone: Vec<f64> = tasks.iter().map(|task| task.alone(roadmap)).collect();
    let mut search = Lacam {
        closeness,
        tasks,
        generator: Generator::new(closeness, tasks),
        random: Random::new(seed, 0),
        initial: fleetyard_plugin_plane::orders::longest_first(&alone).into(),
        nodes: Leftover::default(),
        constraints: Leftover::default(),
        known: Leftover::default(),
        open: Vec::new(),
    };
    let starts: Rc<[Vertex]> = tasks.iter().map(|task| task.start).collect();
    search.add(starts, NONE, Box::default());
    search.open.push(0);
    let mut made = 0;
    let end = loop {
        let Some(at) = search.open.last().copied() else {
            break End::Exhausted;
        };
        if search.is_goal(at) {
            break End::Solved(search.steps(at));
        }
        if made >= control.nodes || (control.stop)() {
            break End::Stopped;
        }
        if search.bytes() > control.memory {
            break End::Memory;
        }
        made += 1;
        search.step(at);
    };
    (end, made)
}

impl Lacam<'_> {
    fn is_goal(&self, node: u32) -> bool {
        let places = self.nodes[node as usize].places.iter();
        let mut all = places.zip(self.tasks);
        all.all(|(place, task)| task.rest.is_over(0, *place))
    }

    /// Approximate number of bytes that the search holds.
    fn bytes(&self) -> u64 {
        let node = size_of::<Node>() + 64 + 12 * self.tasks.len();
        let constraints = self.constraints.len() * size_of::<Constraint>();
        (self.nodes.len() * node + constraints) as u64
    }

    /// Tries the next constraint of a node.
    fn step(&mut self, at: u32) {
        let Some(fixed) = self.next_constraint(at) else {
            self.open.pop();
            return;
        };
        let node = &self.nodes[at as usize];
        let (places, order) = (Rc::clone(&node.places), &node.order);
        let Some(edges) = self.generator.successor(&places, order, &fixed) else {
            return;
        };
        let roadmap = self.closeness.roadmap();
        let next: Rc<[Vertex]> = places
            .iter()
            .zip(edges)
            .map(|(place, edge)| match *edge {
                NONE => *place,
                edge => roadmap.target(edge),
            })
            .collect();
        let edges: Box<[Edge]> = edges.into();
        if let Some(known) = self.known.get(&next).copied() {
            let restart = self.random.one_in(RESTART_ONE_IN);
            self.open.push(if restart { 0 } else { known });
        } else {
            let new = self.add(next, at, edges);
            self.open.push(new);
        }
    }

    /// Takes the next constraint of a node; none when all were tried.
    fn next_constraint(&mut self, at: u32) -> Option<Vec<(u32, Choice)>> {
        let node = &mut self.nodes[at as usize];
        let taken = node.first;
        if taken == NONE {
            return None;
        }
        let constraint = self.constraints[taken as usize];
        node.first = constraint.next;
        if node.first == NONE {
            node.last = NONE;
        }
        let mut fixed = Vec::new();
        let mut up = taken;
        while self.constraints[up as usize].depth > 0 {
            let Constraint {
                parent,
                disc,
                choice,
                ..
            } = self.constraints[up as usize];
            fixed.push((disc, choice));
            up = parent;
        }
        if let Some(disc) = node.order.get(constraint.depth as usize).copied() {
            let roadmap = self.closeness.roadmap();
            let leaving = roadmap.leaving(node.places[disc as usize]);
            let mut choices: Vec<Choice> = leaving.map(Choice).collect();
            choices.push(Choice::STAY);
            self.random.shuffle(&mut choices);
            for choice in choices {
                let child = self.constraints.len() as u32;
                self.constraints.push(Constraint {
                    parent: taken,
                    depth: constraint.depth + 1,
                    disc,
                    choice,
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
        Some(fixed)
    }

    fn add(&mut self, places: Rc<[Vertex]>, parent: u32, edges: Box<[Edge]>) -> u32 {
        let id = self.nodes.len() as u32;
        // Priorities as in PIBT: a disc's grows while it is away from its goal and falls back to the first one there. Only the
        // order matters, and it follows from the parent's.
        let order = match self.nodes.get(parent as usize) {
            None => self.initial.clone(),
            Some(up) => {
                let there = |disc: &u32| {
                    let rest = self.tasks[*disc as usize].rest;
                    rest.is_over(0, places[*disc as usize])
                };
                let moving = up.order.iter().copied().filter(|disc| !there(disc));
                let resting = self.initial.iter().copied().filter(there);
                moving.chain(resting).collect()
            }
        };
        let root = self.constraints.len() as u32;
        self.constraints.push(ROOT);
        self.known.insert(Rc::clone(&places), id);
        self.nodes.push(Node {
            places,
            order,
            parent,
            edges,
            first: root,
            last: root,
        });
        id
    }

    /// The edges of each disc on the way to a node.
    fn steps(&self, goal: u32) -> Vec<Vec<Edge>> {
        let mut steps = vec![Vec::new(); self.tasks.len()];
        let mut at = &self.nodes[goal as usize];
        while at.parent != NONE {
            for (list, edge) in steps.iter_mut().zip(&at.edges) {
                list.push(*edge);
            }
            at = &self.nodes[at.parent as usize];
        }
        for list in &mut steps {
            list.reverse();
        }
        steps
    }
}
