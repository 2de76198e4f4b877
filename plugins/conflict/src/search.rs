//! The high level: best-first search of the constraint tree.
//!
//! - CBS: Sharon, Stern, Felner, Sturtevant, "Conflict-based search for optimal multi-agent
//!   pathfinding", AIJ 219, 2015.
//! - ECBS, where the weight is above 1: Barer, Sharon, Stern, Felner, "Suboptimal variants of
//!   the conflict-based search algorithm for the multi-agent pathfinding problem", SoCS 2014.
//!   OPEN and FOCAL are [`Queue`].
//! - Bypass: Boyarski, Felner, Sharon, Stern, "Don't split, try to work it out", ICAPS 2015.
//!   Where a child avoids the conflict at no cost, its path is taken over and nothing is split.
//! - A window: conflicts after it do not count (RHCR: Li, Tinka, Kiesling, Durham, Kumar,
//!   Koenig, AAAI 2021).
//! - k-robust plans: cells stay taken for k steps (Atzmon, Stern, Felner, Wagner, Barták, Zhou,
//!   JAIR 67, 2020).
//!
//! [`Search::run`] is the loop. `nodes` has the nodes and their low-level searches, `heuristic`
//! the WDG heuristic, `choice` the choice of a conflict, `splitting` the constraints that
//! resolve it.

mod choice;
mod heuristic;
mod nodes;
mod splitting;

use std::cell::{Cell, OnceCell};
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

use fleetyard_abi::leftovers::Leftover;
use fleetyard_plugin_spacetime::astar::{Astar, Stopped};
use fleetyard_plugin_spacetime::conflict::{Conflict, FOREVER, Rules};
use fleetyard_plugin_spacetime::constraints::Constraints;
use fleetyard_plugin_spacetime::distance::Table;
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::pose::Poses;
use fleetyard_plugin_spacetime::problem::Problem;
use fleetyard_plugin_spacetime::traffic::Traffic;

use crate::constraint::Constraint;
use crate::mdd::Builder;
use crate::queue::Queue;
use nodes::{AgentPath, Node};

/// Settings of a search.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The sum of costs may exceed the least one by this factor, at least 1.
    pub weight: f64,
    /// Steps for which a cell has to be left alone after a visit.
    pub delay: u32,
    /// Take over paths of children that avoid a conflict at no cost.
    pub bypass: bool,
    /// Resolve target, corridor and rectangle symmetries at once.
    pub symmetry: bool,
    /// Most conflicts of a node that are classified as cardinal, semi-cardinal or
    /// non-cardinal.
    pub classified: usize,
    /// Use the WDG heuristic, where the weight is 1.
    pub wdg: bool,
    /// Most nodes to expand.
    pub node_limit: Option<u64>,
    /// Most bytes that nodes may take.
    pub memory_limit: u64,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            weight: 1.0,
            delay: 0,
            bypass: true,
            symmetry: true,
            classified: usize::MAX,
            wdg: true,
            node_limit: None,
            memory_limit: 2 << 30,
        }
    }
}

/// The end of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// There is a plan.
    Solved,
    /// There is none, which is proven.
    Infeasible,
    /// It was told to stop.
    Stopped,
    /// So many nodes were to be expanded.
    Nodes,
    /// The nodes took too much memory.
    Memory,
}

/// The outcome of a search.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outcome {
    /// The end.
    pub end: End,
    /// Paths of all agents: the plan, or those with the fewest conflicts that were found.
    pub paths: Vec<Vec<Vertex>>,
    /// The sum of their costs.
    pub cost: u64,
    /// No plan costs less.
    pub lower_bound: u64,
    /// Conflicts that are left.
    pub conflicts: Vec<Conflict>,
    /// Constraints that the paths keep.
    pub constraints: Vec<Constraint>,
    /// Nodes that were split.
    pub expanded: u64,
    /// Nodes that were made.
    pub generated: u64,
    /// Nodes whose conflict was avoided without splitting.
    pub bypassed: u64,
    /// States that the low level expanded.
    pub low_level: u64,
}

/// A search for a team, or for some of its agents.
pub(crate) struct Search<'p> {
    problem: &'p Problem,
    poses: Poses<'p>,
    settings: Settings,
    rules: Rules,
    /// The agents of the problem that are searched for. All other numbers here count these.
    members: Vec<u32>,
    /// Constraints of every node.
    base: Vec<Constraint>,
    astar: Astar<'p>,
    table: Constraints,
    mdd: Builder,
    traffic: Traffic,
    /// The node whose paths were put into the traffic last.
    at: Option<u32>,
    /// The paths that are in the traffic.
    loaded: Vec<Option<Rc<AgentPath>>>,
    nodes: Leftover<Vec<Node>>,
    queue: Leftover<Queue>,
    bytes: u64,
    /// The node with the fewest conflicts: these, its cost, and its number.
    best: Option<(u32, u64, u32)>,
    /// The search for two agents that the WDG heuristic uses.
    of_pair: Option<Box<Search<'p>>>,
    /// Weights of edges of the dependency graph, by the two agents and their constraints.
    pair_weights: BTreeMap<(u32, u32, u128, u128), u32>,
    /// Distances to the ends of corridors.
    distances: BTreeMap<Vertex, Arc<Table>>,
    expanded: u64,
    generated: u64,
    bypassed: u64,
}

impl<'p> Search<'p> {
    pub(crate) fn new(problem: &'p Problem, settings: Settings) -> Self {
        let poses = Poses::new(&problem.graph, problem.turning);
        let rules = Rules {
            until: match problem.window {
                0 => FOREVER,
                window => window,
            },
            delay: settings.delay,
            rings: !problem.cycles,
        };
        let vertices = problem.graph.len();
        let agents = problem.agents();
        let counted = match problem.window {
            0 => u64::MAX,
            window => u64::from(window) * agents as u64,
        };
        Self {
            problem,
            poses,
            rules,
            members: (0..agents as u32).collect(),
            base: Vec::new(),
            astar: Astar::new(poses),
            table: Constraints::new(vertices),
            mdd: Builder::default(),
            traffic: Traffic::new(vertices, agents, rules),
            at: None,
            loaded: vec![None; agents],
            nodes: Leftover::default(),
            queue: Leftover::new(Queue::new(settings.weight.max(1.0), counted)),
            bytes: 0,
            best: None,
            of_pair: None,
            pair_weights: BTreeMap::new(),
            distances: BTreeMap::new(),
            expanded: 0,
            generated: 0,
            bypassed: 0,
            settings,
        }
    }

    /// Searches for the whole team.
    pub(crate) fn solve(mut self, stop: &mut dyn FnMut() -> bool) -> Outcome {
        let end = match self.root(stop) {
            Ok(true) => self.run(stop),
            Ok(false) => End::Infeasible,
            Err(Stopped) => End::Stopped,
        };
        self.outcome(end)
    }

    /// The outcome, given the end.
    fn outcome(&mut self, end: End) -> Outcome {
        let best = match end {
            // The node that is loaded has no conflicts.
            End::Solved => None,
            _ => self.best,
        };
        if let Some((.., id)) = best {
            self.load(id);
        }
        let paths = (0..self.members.len()).map(|agent| match &self.loaded[agent] {
            Some(single) => single.path.clone(),
            None => vec![self.route(agent).start],
        });
        let paths = paths.collect();
        let cost = self
            .loaded
            .iter()
            .flatten()
            .map(|single| u64::from(single.cost))
            .sum();
        let low_level = self.astar.expansions();
        Outcome {
            end,
            paths,
            cost,
            lower_bound: match (self.queue.bound(), end) {
                (_, End::Solved) if self.settings.weight <= 1.0 => cost,
                (Some(bound), End::Solved) => bound.min(cost),
                (bound, _) => bound.unwrap_or(0).max(self.problem.lower_bound()),
            },
            conflicts: self.traffic.conflicts().all().to_vec(),
            constraints: self
                .at
                .map(|id| self.constraints(id).cloned().collect())
                .unwrap_or_default(),
            expanded: self.expanded,
            generated: self.generated,
            bypassed: self.bypassed,
            low_level: low_level
                + self
                    .of_pair
                    .as_ref()
                    .map_or(0, |pair| pair.astar.expansions()),
        }
    }

    /// Expands nodes until there is a plan or a reason to stop.
    fn run(&mut self, stop: &mut dyn FnMut() -> bool) -> End {
        loop {
            if stop() {
                return End::Stopped;
            }
            if self.bytes > self.settings.memory_limit {
                return End::Memory;
            }
            let nodes = &*self.nodes;
            let Some(id) = self.queue.pop(|id| nodes[id as usize].rank) else {
                return End::Infeasible;
            };
            self.load(id);
            let node = &self.nodes[id as usize];
            let (rank, has_wdg) = (node.rank, node.has_wdg);
            if rank.conflicts == 0 {
                // Its bound is one of those that the sum of costs is compared with.
                self.queue.push(id, rank);
                return End::Solved;
            }
            if self.settings.wdg && self.settings.weight <= 1.0 && !has_wdg {
                match self.wdg_bound(id, stop) {
                    Err(Stopped) => {
                        self.queue.push(id, rank);
                        return End::Stopped;
                    }
                    Ok(None) => continue,
                    Ok(Some(bound)) if bound > rank.bound => {
                        self.nodes[id as usize].rank.bound = bound;
                        self.queue.push(id, self.nodes[id as usize].rank);
                        continue;
                    }
                    Ok(Some(_)) => {}
                }
            }
            if self
                .settings
                .node_limit
                .is_some_and(|limit| self.expanded >= limit)
            {
                self.queue.push(id, rank);
                return End::Nodes;
            }
            self.expanded += 1;
            if self.expand(id, stop).is_err() {
                self.queue.push(id, self.nodes[id as usize].rank);
                return End::Stopped;
            }
        }
    }

    /// Splits a node, or takes over a path that makes that unnecessary.
    fn expand(&mut self, id: u32, stop: &mut dyn FnMut() -> bool) -> Result<(), Stopped> {
        loop {
            let split = self.choose(id, stop)?;
            let mut children = Vec::with_capacity(split.len());
            for constraint in split {
                let Some(child) = self.child(id, constraint, stop)? else {
                    continue;
                };
                children.push(child);
            }
            let better = children.iter().position(|child| self.bypasses(id, child));
            let Some(better) = better.filter(|_| self.settings.bypass) else {
                for child in children {
                    self.add(child);
                }
                return Ok(());
            };
            self.bypassed += 1;
            let child = children.swap_remove(better);
            for (agent, single) in child.changed {
                // What the constraint cost is no bound here, where it does not hold.
                let bound = self.loaded[agent as usize]
                    .as_ref()
                    .map_or(0, |now| now.bound);
                let single = Rc::new(AgentPath {
                    path: single.path.clone(),
                    cost: single.cost,
                    bound,
                    origin: Cell::new(id),
                    singletons: OnceCell::new(),
                });
                self.place(agent as usize, Rc::clone(&single));
                let changed = &mut self.nodes[id as usize].changed;
                match changed.iter_mut().find(|(other, _)| *other == agent) {
                    Some((_, old)) => *old = single,
                    None => changed.push((agent, single)),
                }
            }
            let rank = &mut self.nodes[id as usize].rank;
            rank.conflicts = child.rank.conflicts;
            rank.cost = child.rank.cost;
            let rank = *rank;
            let key = (rank.conflicts, rank.cost, id);
            self.best = self.best.map(|best| best.min(key));
            if rank.conflicts == 0 {
                self.queue.push(id, rank);
                return Ok(());
            }
        }
    }

    /// True if the paths of a child can replace those of its parent: no dearer than the parent's
    /// may be, and with fewer conflicts.
    fn bypasses(&self, id: u32, child: &Node) -> bool {
        let rank = self.nodes[id as usize].rank;
        let (weight, until) = (self.settings.weight, self.rules.until);
        child.rank.conflicts < rank.conflicts
            && child.changed.iter().all(|(agent, single)| {
                self.loaded[*agent as usize].as_ref().is_some_and(|now| {
                    let slack = f64::from(now.bound.min(until)) * (weight - 1.0);
                    single.cost <= now.bound + (slack + 1e-6) as u32
                })
            })
    }
}
