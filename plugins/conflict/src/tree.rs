//! The constraint tree: conflict-based search, optimal (Sharon, Stern, Felner, Sturtevant,
//! "Conflict-based search for optimal multi-agent pathfinding", AIJ 219, 2015) and
//! bounded-suboptimal (ECBS: Barer, Sharon, Stern, Felner, SoCS 2014).
//!
//! A node has a path for every agent and is split at one of its conflicts: each child forbids
//! one of the agents its part. In addition:
//!
//! - conflicts that raise the cost of both children come first (ICBS: Boyarski et al., IJCAI
//!   2015), and the symmetries of [`crate::symmetry`] are resolved at once;
//! - where a child avoids the conflict at no cost, its path is taken over and nothing is split
//!   (bypass: Boyarski et al., ICAPS 2015);
//! - optimal searches add what pairs of agents must pay at least (WDG heuristic: Li, Felner,
//!   Boyarski, Ma, Koenig, IJCAI 2019), each pair by a small search of its own;
//! - conflicts after the window do not count (RHCR: Li et al., AAAI 2021); cells stay taken for
//!   k steps in k-robust plans (Atzmon et al., JAIR 2020); rings of three and more agents are
//!   split into as many children.

use std::cell::{Cell, OnceCell};
use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

use fleetyard_plugin_spacetime::astar::{Astar, Query, Stopped};
use fleetyard_plugin_spacetime::conflict::{Conflict, FOREVER, Kind, Rules};
use fleetyard_plugin_spacetime::constraints::Constraints;
use fleetyard_plugin_spacetime::distance::Table;
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::pose::Poses;
use fleetyard_plugin_spacetime::problem::{Problem, Route};
use fleetyard_plugin_spacetime::traffic::Traffic;

use crate::constraint::Constraint;
use crate::cover::least_cover;
use crate::mdd::{Builder, SEVERAL};
use crate::queue::{Queue, Rank};
use crate::symmetry::{corridor, passage, rectangle};

/// Expansions of the search that says what a pair of agents must pay.
const PAIR_NODES: u64 = 48;
/// Pairs whose payment is remembered.
const MOST_PAIRS: usize = 1 << 18;
/// Corridor ends to which distances are remembered.
const MOST_TABLES: usize = 256;
const ROOT: u32 = u32::MAX;

/// How to search.
#[derive(Debug, Clone, PartialEq)]
pub struct Settings {
    /// The sum of costs may exceed the least one by this factor, at least 1.
    pub weight: f64,
    /// Steps for which a cell has to be left alone after a visit.
    pub delay: u32,
    /// Take over paths of children that avoid a conflict at no cost.
    pub bypass: bool,
    /// Resolve targets, corridors and rectangles at once.
    pub symmetry: bool,
    /// Conflicts of a node of which is found out whether they are cardinal.
    pub classified: usize,
    /// Add what pairs of agents must pay at least.
    pub pairs: bool,
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
            pairs: true,
            node_limit: None,
            memory_limit: 2 << 30,
        }
    }
}

/// How a search ended.
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

/// What came of a search.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outcome {
    /// How it ended.
    pub end: End,
    /// Paths of all agents: the plan, or those with the fewest conflicts that were found.
    pub paths: Vec<Vec<Vertex>>,
    /// The sum of their costs.
    pub cost: u64,
    /// No plan costs less.
    pub lower_bound: u64,
    /// Conflicts that are left.
    pub conflicts: u32,
    /// Nodes that were split.
    pub expanded: u64,
    /// Nodes that were made.
    pub generated: u64,
    /// Nodes whose conflict was avoided without splitting.
    pub bypassed: u64,
    /// States that the low level expanded.
    pub low_level: u64,
}

/// The path of one agent under the constraints of a node.
#[derive(Debug)]
struct Single {
    path: Vec<Vertex>,
    cost: u32,
    bound: u32,
    /// The node that it was made for: what holds there holds wherever it is used.
    origin: Cell<u32>,
    /// Per step the only cell of cheapest paths under the constraints of that node.
    narrow: OnceCell<Vec<Vertex>>,
}

#[derive(Debug)]
struct Node {
    parent: u32,
    constraint: Option<Constraint>,
    changed: Vec<(u32, Rc<Single>)>,
    rank: Rank,
    /// Whether the bound has what pairs must pay in it.
    assessed: bool,
}

/// A search for a team, or for some of its agents.
pub(crate) struct Tree<'p> {
    problem: &'p Problem,
    poses: Poses<'p>,
    settings: Settings,
    rules: Rules,
    /// The agents of the problem that are searched for. All other numbers here count these.
    members: Vec<u32>,
    /// What they have to keep in every node.
    base: Vec<Constraint>,
    astar: Astar<'p>,
    table: Constraints,
    builder: Builder,
    traffic: Traffic,
    /// The paths that are in the traffic.
    loaded: Vec<Option<Rc<Single>>>,
    nodes: Vec<Node>,
    queue: Queue,
    bytes: u64,
    best: Option<(u32, u64, u32)>,
    pair: Option<Box<Tree<'p>>>,
    payments: BTreeMap<(u32, u32, u128, u128), u32>,
    tables: BTreeMap<Vertex, Arc<Table>>,
    expanded: u64,
    generated: u64,
    bypassed: u64,
}

/// What is known of a conflict: the smaller, the sooner it is resolved.
type Urgency = (u8, u8);

impl<'p> Tree<'p> {
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
            builder: Builder::default(),
            traffic: Traffic::new(vertices, agents, rules),
            loaded: vec![None; agents],
            nodes: Vec::new(),
            queue: Queue::new(settings.weight.max(1.0), counted),
            bytes: 0,
            best: None,
            pair: None,
            payments: BTreeMap::new(),
            tables: BTreeMap::new(),
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
            conflicts: self.traffic.conflicts().all().len() as u32,
            expanded: self.expanded,
            generated: self.generated,
            bypassed: self.bypassed,
            low_level: low_level + self.pair.as_ref().map_or(0, |pair| pair.astar.expansions()),
        }
    }

    fn route(&self, agent: usize) -> &'p Route {
        &self.problem.routes[self.members[agent] as usize]
    }

    /// Finds a path for every agent, one after the other; false if there is none for one.
    fn root(&mut self, stop: &mut dyn FnMut() -> bool) -> Result<bool, Stopped> {
        for agent in 0..self.members.len() {
            if stop() {
                return Err(Stopped);
            }
            let found = self.plan(agent, ROOT, None, 0, stop)?;
            let Some(single) = found else {
                return Ok(false);
            };
            self.place(agent, single);
        }
        self.add_root();
        Ok(true)
    }

    /// Makes the root out of what is loaded.
    fn add_root(&mut self) {
        let changed: Vec<(u32, Rc<Single>)> =
            (0..).zip(self.loaded.iter().flatten().cloned()).collect();
        let sum =
            |f: fn(&Single) -> u32| changed.iter().map(|(_, single)| u64::from(f(single))).sum();
        let rank = Rank {
            bound: sum(|single| single.bound),
            cost: sum(|single| single.cost),
            conflicts: self.traffic.conflicts().all().len() as u32,
        };
        self.add(Node {
            parent: ROOT,
            constraint: None,
            changed,
            rank,
            assessed: false,
        });
    }

    fn add(&mut self, node: Node) {
        let id = self.nodes.len() as u32;
        for (_, single) in &node.changed {
            single.origin.set(id);
        }
        let paths = node
            .changed
            .iter()
            .map(|(_, single)| single.path.len() * 8 + 96);
        self.bytes += paths.sum::<usize>() as u64 + 2 * size_of::<Node>() as u64 + 128;
        let key = (node.rank.conflicts, node.rank.cost, id);
        if self.best.is_none_or(|best| key < best) {
            self.best = Some(key);
        }
        self.queue.push(id, node.rank);
        self.nodes.push(node);
        self.generated += 1;
    }

    /// Puts a path into the traffic.
    fn place(&mut self, agent: usize, single: Rc<Single>) {
        self.traffic.set(agent, &single.path);
        self.loaded[agent] = Some(single);
    }

    /// Puts the paths of a node into the traffic.
    fn load(&mut self, id: u32) {
        let mut wanted: Vec<Option<Rc<Single>>> = vec![None; self.members.len()];
        let mut missing = wanted.len();
        let mut at = id;
        while at != ROOT && missing > 0 {
            let node = &self.nodes[at as usize];
            for (agent, single) in &node.changed {
                let slot = &mut wanted[*agent as usize];
                if slot.is_none() {
                    *slot = Some(Rc::clone(single));
                    missing -= 1;
                }
            }
            at = node.parent;
        }
        for (agent, single) in wanted.into_iter().enumerate() {
            let Some(single) = single else { continue };
            let same = self.loaded[agent]
                .as_ref()
                .is_some_and(|now| Rc::ptr_eq(now, &single));
            if !same {
                self.place(agent, single);
            }
        }
    }

    /// The constraints of a node.
    fn chain(&self, id: u32) -> impl Iterator<Item = &Constraint> {
        let mut at = id;
        let above = std::iter::from_fn(move || {
            let node = self.nodes.get(at as usize)?;
            at = node.parent;
            Some(node.constraint.as_ref())
        });
        self.base.iter().chain(above.flatten())
    }

    /// Fills the table with what an agent has to keep in a node, and one thing more.
    fn fill(&mut self, agent: usize, id: u32, more: Option<&Constraint>) {
        let mut table = std::mem::replace(&mut self.table, Constraints::new(0));
        table.clear();
        let number = self.members[agent];
        for constraint in self.chain(id).chain(more) {
            constraint.apply(number, &mut table);
        }
        self.table = table;
    }

    /// A path for an agent in a node with one constraint more.
    fn plan(
        &mut self,
        agent: usize,
        id: u32,
        more: Option<&Constraint>,
        least: u32,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Rc<Single>>, Stopped> {
        self.fill(agent, id, more);
        let query = Query {
            agent: agent as u32,
            route: self.route(agent),
            constraints: &self.table,
            traffic: Some(&self.traffic),
            until: self.rules.until,
            weight: self.settings.weight,
            least,
            most: FOREVER,
        };
        let found = self.astar.find(&query, stop)?;
        Ok(found.map(|found| {
            Rc::new(Single {
                path: found.path,
                cost: found.cost,
                bound: found.bound,
                origin: Cell::new(ROOT),
                narrow: OnceCell::new(),
            })
        }))
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
            let nodes = &self.nodes;
            let Some(id) = self.queue.pop(|id| nodes[id as usize].rank) else {
                return End::Infeasible;
            };
            self.load(id);
            let node = &self.nodes[id as usize];
            let (rank, assessed) = (node.rank, node.assessed);
            if rank.conflicts == 0 {
                // Its bound is one of those that the sum of costs is compared with.
                self.queue.push(id, rank);
                return End::Solved;
            }
            if self.settings.pairs && self.settings.weight <= 1.0 && !assessed {
                match self.assess(id, stop) {
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
                let single = Rc::new(Single {
                    path: single.path.clone(),
                    cost: single.cost,
                    bound,
                    origin: Cell::new(id),
                    narrow: OnceCell::new(),
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

    /// Whether the paths of a child serve its parent: no dearer than they may be there, and
    /// with fewer conflicts.
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

    /// The child of the loaded node that one more constraint makes; `None` if nothing keeps it.
    fn child(
        &mut self,
        id: u32,
        constraint: Constraint,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Node>, Stopped> {
        let affected = self.affected(&constraint);
        let mut rank = self.nodes[id as usize].rank;
        let before: Vec<(usize, Rc<Single>)> = affected
            .iter()
            .filter_map(|&agent| Some((agent, Rc::clone(self.loaded[agent].as_ref()?))))
            .collect();
        let sum = |paths: &[(usize, Rc<Single>)]| {
            let costs = paths.iter().map(|(_, single)| u64::from(single.cost));
            let bounds = paths.iter().map(|(_, single)| u64::from(single.bound));
            (costs.sum::<u64>(), bounds.sum::<u64>())
        };
        for &agent in &affected {
            self.traffic.clear(agent);
        }
        let mut after = Vec::with_capacity(before.len());
        let mut result = Ok(true);
        for (agent, old) in &before {
            match self.plan(*agent, id, Some(&constraint), old.bound, stop) {
                Ok(Some(single)) => {
                    self.traffic.set(*agent, &single.path);
                    after.push((*agent, single));
                }
                Ok(None) => result = Ok(false),
                Err(Stopped) => result = Err(Stopped),
            }
            if result != Ok(true) {
                break;
            }
        }
        rank.conflicts = self.traffic.conflicts().all().len() as u32;
        for (agent, single) in &before {
            self.traffic.set(*agent, &single.path);
        }
        if !result? {
            return Ok(None);
        }
        let (old, new) = (sum(&before), sum(&after));
        rank.cost = rank.cost - old.0 + new.0;
        let bounds = self
            .loaded
            .iter()
            .flatten()
            .map(|single| u64::from(single.bound));
        rank.bound = rank.bound.max(bounds.sum::<u64>() - old.1 + new.1);
        Ok(Some(Node {
            parent: id,
            constraint: Some(constraint),
            changed: after
                .into_iter()
                .map(|(agent, single)| (agent as u32, single))
                .collect(),
            rank,
            assessed: false,
        }))
    }

    /// The agents whose paths a constraint forbids, in order.
    fn affected(&self, constraint: &Constraint) -> Vec<usize> {
        let local = |number: u32| self.members.iter().position(|&member| member == number);
        let about = local(constraint.agent());
        let Constraint::ArriveBy {
            goal, time, others, ..
        } = constraint
        else {
            return about.into_iter().collect();
        };
        let visits = self.traffic.conflicts().visits(*goal).iter();
        let late = visits.filter(|visit| visit.until >= *others);
        let mut affected: Vec<usize> = late.map(|visit| visit.agent as usize).collect();
        affected.retain(|&agent| Some(agent) != about);
        let slow = |agent: &usize| {
            self.loaded[*agent]
                .as_ref()
                .is_some_and(|single| single.cost > *time)
        };
        affected.extend(about.filter(slow));
        affected.sort_unstable();
        affected.dedup();
        affected
    }

    /// The path of an agent in the node that is loaded, with the narrow places of its cheapest
    /// paths known.
    fn narrow(&mut self, agent: usize) -> Rc<Single> {
        let single = match &self.loaded[agent] {
            Some(single) => Rc::clone(single),
            None => unreachable!("the node is loaded"),
        };
        if single.narrow.get().is_none() {
            self.fill(agent, single.origin.get(), None);
            let route = self.route(agent);
            let levels = self.builder.singles(
                self.poses,
                route,
                &self.table,
                single.bound,
                self.rules.until,
            );
            // Nobody else can have set it meanwhile.
            let _ = single.narrow.set(levels);
        }
        single
    }

    /// Whether an agent cannot avoid its part in a conflict at its least cost.
    fn is_forced(&mut self, agent: usize, conflict: &Conflict) -> bool {
        let single = self.narrow(agent);
        let levels = single.narrow.get().map_or(&[][..], Vec::as_slice);
        let at = |time: u32| levels.get(time as usize).copied().unwrap_or(SEVERAL);
        let time = conflict.time;
        match &conflict.kind {
            Kind::Cell(v) => {
                let goal = self.route(agent).stays && self.route(agent).goals.last() == Some(v);
                let steps = time..=(time + self.rules.delay).min(self.rules.until);
                goal && time + self.rules.delay >= single.bound
                    || steps.clone().any(|time| at(time) == *v)
            }
            Kind::Swap([from, to]) => {
                let [from, to] = if conflict.agents[0] as usize == agent {
                    [*from, *to]
                } else {
                    [*to, *from]
                };
                at(time) == from && at(time + 1) == to
            }
            Kind::Ring(members) => {
                let place = members
                    .iter()
                    .position(|(member, _)| *member as usize == agent);
                place.is_some_and(|place| {
                    let to = members[(place + 1) % members.len()].1;
                    at(time) == members[place].1 && at(time + 1) == to
                })
            }
        }
    }

    /// The agent that rests where another one passes.
    fn parked(&self, conflict: &Conflict) -> Option<(usize, usize)> {
        let Kind::Cell(v) = conflict.kind else {
            return None;
        };
        let [a, b] = conflict.agents.map(|agent| agent as usize);
        let rests = |agent: usize| {
            let path = self.traffic.conflicts().path(agent);
            self.route(agent).stays
                && path.last() == Some(&v)
                && path.len() as u32 - 1 <= conflict.time + self.rules.delay
        };
        match (rests(a), rests(b)) {
            (true, false) => Some((a, b)),
            (false, true) => Some((b, a)),
            _ => None,
        }
    }

    /// Chooses a conflict of the loaded node and says how it is split.
    fn choose(
        &mut self,
        id: u32,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<Constraint>, Stopped> {
        let mut conflicts = self.traffic.conflicts().all().to_vec();
        conflicts.sort_unstable();
        let classified = self.settings.classified.min(conflicts.len());
        let mut best: Option<(Urgency, &Conflict)> = None;
        let mut others = Vec::new();
        for conflict in &conflicts[..classified] {
            if stop() {
                return Err(Stopped);
            }
            let forced = match &conflict.kind {
                Kind::Ring(members) => {
                    let members = members.iter().map(|(member, _)| *member as usize);
                    let forced: Vec<bool> = members
                        .map(|agent| self.is_forced(agent, conflict))
                        .collect();
                    [forced.iter().all(|&f| f), forced.iter().any(|&f| f)]
                }
                _ => conflict
                    .agents
                    .map(|agent| self.is_forced(agent as usize, conflict)),
            };
            let target = self.settings.symmetry && self.parked(conflict).is_some();
            let class = 2 - forced.iter().filter(|&&f| f).count() as u8;
            let urgency = (class, u8::from(!target));
            if best.is_none_or(|(known, _)| urgency < known) {
                best = Some((urgency, conflict));
            }
            if class > 0 && !target {
                others.push(conflict);
            }
        }
        let Some((urgency, conflict)) = best.or_else(|| Some(((2, 1), conflicts.first()?))) else {
            return Ok(Vec::new());
        };
        if urgency.0 > 0
            && let Some(split) = self.rectangles(id, &others, urgency)
        {
            return Ok(split);
        }
        self.split(id, conflict, stop)
    }

    /// The barriers of the most urgent rectangle, if that is more urgent than what is known.
    fn rectangles(
        &mut self,
        id: u32,
        conflicts: &[&Conflict],
        known: Urgency,
    ) -> Option<Vec<Constraint>> {
        if !self.settings.symmetry || self.problem.turning || self.rules.delay > 0 {
            return None;
        }
        let mut best = None;
        let mut urgency = known;
        for conflict in conflicts {
            let Kind::Cell(v) = conflict.kind else {
                continue;
            };
            let agents = conflict.agents.map(|agent| agent as usize);
            if agents
                .iter()
                .any(|&agent| self.route(agent).goals.len() != 1)
            {
                continue;
            }
            let singles = agents.map(|agent| self.narrow(agent));
            if singles.iter().any(|single| single.cost != single.bound) {
                continue;
            }
            let levels = [0, 1].map(|i| singles[i].narrow.get().map_or(&[][..], Vec::as_slice));
            let graph = &self.problem.graph;
            let Some(found) = rectangle(graph, levels, v, conflict.time) else {
                continue;
            };
            let class = 2 - found.cardinal.iter().filter(|&&cardinal| cardinal).count() as u8;
            if (class, 0) >= urgency {
                continue;
            }
            let mut barriers = found.barriers;
            for i in 0..2 {
                if found.whole[i] {
                    continue;
                }
                self.fill(agents[i], id, None);
                let route = self.route(agents[i]);
                let until = self.rules.until;
                self.builder.members(
                    self.poses,
                    route,
                    &self.table,
                    singles[i].bound,
                    until,
                    &mut barriers[i],
                );
            }
            // A barrier that is not in the way would change nothing.
            let met = (0..2).all(|i| {
                let path = &singles[i].path;
                let mut cells = barriers[i].iter();
                cells.any(|&(v, time)| path.get(time as usize) == Some(&v))
            });
            if met {
                urgency = (class, 0);
                best = Some((agents, barriers));
            }
        }
        let (agents, [one, other]) = best?;
        let barrier = |agent: usize, cells: Vec<(Vertex, u32)>| Constraint::Barrier {
            agent: self.members[agent],
            cells: cells.into(),
        };
        Some(vec![barrier(agents[0], one), barrier(agents[1], other)])
    }

    /// The constraints of the children for a conflict.
    fn split(
        &mut self,
        id: u32,
        conflict: &Conflict,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<Constraint>, Stopped> {
        let time = conflict.time;
        if self.settings.symmetry {
            if let Some((rests, _)) = self.parked(conflict)
                && let Kind::Cell(goal) = conflict.kind
            {
                let agent = self.members[rests];
                let last = time + self.rules.delay;
                return Ok(vec![
                    Constraint::ArriveAfter { agent, time: last },
                    Constraint::ArriveBy {
                        agent,
                        goal,
                        time: last,
                        others: time,
                    },
                ]);
            }
            if let Some(split) = self.corridors(id, conflict, stop)? {
                return Ok(split);
            }
        }
        let number = |agent: u32| self.members[agent as usize];
        Ok(match &conflict.kind {
            Kind::Cell(v) => {
                let end = (time + self.rules.delay).min(self.rules.until);
                conflict
                    .agents
                    .map(|agent| Constraint::Cell {
                        agent: number(agent),
                        v: *v,
                        begin: time,
                        end,
                    })
                    .into()
            }
            Kind::Swap([from, to]) => {
                let [a, b] = conflict.agents.map(number);
                let step = |agent, from, to| Constraint::Move {
                    agent,
                    from,
                    to,
                    time,
                };
                vec![step(a, *from, *to), step(b, *to, *from)]
            }
            Kind::Ring(members) => {
                let after = members.iter().cycle().skip(1);
                let steps = members.iter().zip(after);
                steps
                    .map(|(&(agent, from), &(_, to))| Constraint::Move {
                        agent: number(agent),
                        from,
                        to,
                        time,
                    })
                    .collect()
            }
        })
    }

    /// The ranges that keep one of two agents out of a corridor in which they meet.
    fn corridors(
        &mut self,
        id: u32,
        conflict: &Conflict,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<Constraint>>, Stopped> {
        let graph = &self.problem.graph;
        let cells: &[Vertex] = match &conflict.kind {
            Kind::Cell(v) => &[*v],
            Kind::Swap(cells) => cells,
            Kind::Ring(_) => return Ok(None),
        };
        let Some(chain) = cells.iter().find_map(|&v| corridor(graph, v)) else {
            return Ok(None);
        };
        let agents = conflict.agents.map(|agent| agent as usize);
        let inside = &chain[1..chain.len() - 1];
        let mut ends = [0; 2];
        for i in 0..2 {
            let path = self.traffic.conflicts().path(agents[i]);
            let way = passage(path, &chain, conflict.time);
            let begins_inside = inside.contains(&self.route(agents[i]).start);
            let Some([_, end]) = way.filter(|_| !begins_inside) else {
                return Ok(None);
            };
            ends[i] = end;
        }
        if ends[0] == ends[1] {
            return Ok(None);
        }
        let length = chain.len() as u32 - 1;
        let mut first = [0; 2];
        for i in 0..2 {
            let Some(time) = self.earliest(agents[i], id, ends[i], &[], FOREVER, stop)? else {
                return Ok(None);
            };
            first[i] = time;
        }
        let mut split = Vec::with_capacity(2);
        for i in 0..2 {
            let limit = first[1 - i] + length;
            let around = self.earliest(agents[i], id, ends[i], inside, limit, stop)?;
            let end = match around {
                Some(0) => return Ok(None),
                Some(time) => limit.min(time - 1),
                None => limit,
            };
            let end = end.min(self.rules.until);
            let path = self.traffic.conflicts().path(agents[i]);
            let reach = (end as usize + 1).min(path.len());
            if !path[..reach].contains(&ends[i]) {
                return Ok(None);
            }
            split.push(Constraint::Cell {
                agent: self.members[agents[i]],
                v: ends[i],
                begin: 0,
                end,
            });
        }
        Ok(Some(split))
    }

    /// The first step at which an agent can be in a cell without coming through others, if
    /// that is no later than `most`.
    fn earliest(
        &mut self,
        agent: usize,
        id: u32,
        goal: Vertex,
        closed: &[Vertex],
        most: u32,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<u32>, Stopped> {
        if self.tables.len() >= MOST_TABLES && !self.tables.contains_key(&goal) {
            self.tables.clear();
        }
        let (graph, turning) = (&self.problem.graph, self.problem.turning);
        let table = self
            .tables
            .entry(goal)
            .or_insert_with(|| Arc::new(Table::new(graph, goal, turning, None)));
        let table = Arc::clone(table);
        let Route { start, heading, .. } = *self.route(agent);
        let route = Route::to(start, heading, goal, table);
        self.fill(agent, id, None);
        for &v in closed {
            self.table.forbid(v, 0, FOREVER);
        }
        let query = Query {
            agent: agent as u32,
            route: &route,
            constraints: &self.table,
            traffic: None,
            until: FOREVER,
            weight: 1.0,
            least: 0,
            most,
        };
        let found = self.astar.find(&query, stop)?;
        Ok(found.map(|found| found.cost))
    }

    /// What the loaded node costs at least, given what its pairs of agents must pay; `None` if
    /// a pair cannot pay it at all.
    fn assess(&mut self, id: u32, stop: &mut dyn FnMut() -> bool) -> Result<Option<u64>, Stopped> {
        let pairs = self.traffic.conflicts().all().iter();
        let mut pairs: Vec<[u32; 2]> = pairs
            .filter(|conflict| !matches!(conflict.kind, Kind::Ring(_)))
            .map(|conflict| conflict.agents)
            .collect();
        pairs.sort_unstable();
        pairs.dedup();
        let mut hashes = vec![None; self.members.len()];
        let mut edges = Vec::new();
        for [a, b] in pairs {
            for agent in [a, b] {
                let slot = &mut hashes[agent as usize];
                if slot.is_none() {
                    let number = self.members[agent as usize];
                    let chain = self.chain(id).filter(|constraint| constraint.binds(number));
                    *slot = Some(chain.fold(0_u128, |sum, c| sum.wrapping_add(c.hash())));
                }
            }
            let [one, other] = [a, b].map(|agent| hashes[agent as usize].unwrap_or(0));
            let key = (a, b, one, other);
            let payment = if let Some(&payment) = self.payments.get(&key) {
                payment
            } else {
                let payment = self.payment(id, [a, b], stop)?;
                if self.payments.len() >= MOST_PAIRS {
                    self.payments.clear();
                }
                self.payments.insert(key, payment);
                payment
            };
            match payment {
                u32::MAX => return Ok(None),
                0 => {}
                _ => edges.push((a, b, payment)),
            }
        }
        self.nodes[id as usize].assessed = true;
        let rank = self.nodes[id as usize].rank;
        Ok(Some(
            rank.bound.max(rank.cost + u64::from(least_cover(&edges))),
        ))
    }

    /// What two agents must pay at least to avoid each other, above what they pay in the loaded
    /// node; `u32::MAX` if they cannot.
    fn payment(
        &mut self,
        id: u32,
        agents: [u32; 2],
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<u32, Stopped> {
        let numbers = agents.map(|agent| self.members[agent as usize]);
        let base: Vec<Constraint> = self
            .chain(id)
            .filter(|constraint| numbers.iter().any(|&number| constraint.binds(number)))
            .cloned()
            .collect();
        let settings = Settings {
            pairs: false,
            node_limit: Some(PAIR_NODES),
            ..self.settings.clone()
        };
        let mut pair = match self.pair.take() {
            Some(pair) => pair,
            None => Box::new(Tree::new(self.problem, settings)),
        };
        pair.members = numbers.into();
        pair.base = base;
        pair.nodes.clear();
        pair.queue.clear();
        pair.best = None;
        (pair.bytes, pair.expanded) = (0, 0);
        pair.loaded = vec![None; 2];
        let mut sum = 0;
        for (place, agent) in agents.into_iter().enumerate() {
            // Nodes have other numbers there: narrow places have to be known before.
            let single = self.narrow(agent as usize);
            sum += u64::from(single.cost);
            let copy = Single {
                path: single.path.clone(),
                origin: Cell::new(0),
                narrow: single.narrow.clone(),
                ..*single
            };
            pair.place(place, Rc::new(copy));
        }
        pair.add_root();
        let end = pair.run(stop);
        let bound = pair.queue.bound().unwrap_or(sum);
        for place in 0..2 {
            pair.traffic.clear(place);
        }
        self.pair = Some(pair);
        match end {
            End::Infeasible => Ok(u32::MAX),
            End::Stopped => Err(Stopped),
            _ => Ok(u32::try_from(bound.saturating_sub(sum)).unwrap_or(u32::MAX - 1)),
        }
    }
}
