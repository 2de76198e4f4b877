//! Nodes of the constraint tree: a node is a constraint more than its parent, and new paths for
//! the agents that have to keep it (Sharon et al., AIJ 219, 2015, section 4).
//!
//! A node stores the paths that differ from its parent's. [`Search::load`] puts all paths of a
//! node into the traffic, where conflicts are counted as paths change. The low level is the
//! space-time A\* of `fleetyard_plugin_spacetime::astar`, which prefers paths with few conflicts
//! among those of equal cost, or among those within the weight (ECBS: Barer et al., SoCS 2014).

use std::cell::{Cell, OnceCell};
use std::rc::Rc;

use fleetyard_plugin_spacetime::astar::{Query, Stopped};
use fleetyard_plugin_spacetime::conflict::FOREVER;
use fleetyard_plugin_spacetime::constraints::Constraints;
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::problem::Route;

use super::Search;
use crate::constraint::Constraint;
use crate::queue::Rank;

/// The parent of the root.
const ROOT: u32 = u32::MAX;

/// The path of one agent under the constraints of a node.
#[derive(Debug)]
pub(super) struct AgentPath {
    pub(super) path: Vec<Vertex>,
    pub(super) cost: u32,
    pub(super) bound: u32,
    /// The node that it was made for: what holds there holds wherever it is used.
    pub(super) origin: Cell<u32>,
    /// Per step the only cell of the MDD of its cost under the constraints of that node, or
    /// [`SEVERAL`](crate::mdd::SEVERAL).
    pub(super) singletons: OnceCell<Vec<Vertex>>,
}

/// A node of the constraint tree.
#[derive(Debug)]
pub(super) struct Node {
    pub(super) parent: u32,
    pub(super) constraint: Option<Constraint>,
    pub(super) changed: Vec<(u32, Rc<AgentPath>)>,
    pub(super) rank: Rank,
    /// The WDG heuristic is in the bound.
    pub(super) has_wdg: bool,
}

impl<'p> Search<'p> {
    /// The route of an agent.
    pub(super) fn route(&self, agent: usize) -> &'p Route {
        &self.problem.routes[self.members[agent] as usize]
    }

    /// Finds a path for every agent, one after the other; false if there is none for one.
    pub(super) fn root(&mut self, stop: &mut dyn FnMut() -> bool) -> Result<bool, Stopped> {
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
    pub(super) fn add_root(&mut self) {
        let changed: Vec<(u32, Rc<AgentPath>)> =
            (0..).zip(self.loaded.iter().flatten().cloned()).collect();
        let sum =
            |f: fn(&AgentPath) -> u32| changed.iter().map(|(_, single)| u64::from(f(single))).sum();
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
            has_wdg: false,
        });
    }

    /// Adds a node to the tree and opens it.
    pub(super) fn add(&mut self, node: Node) {
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
    pub(super) fn place(&mut self, agent: usize, single: Rc<AgentPath>) {
        self.traffic.set(agent, &single.path);
        self.loaded[agent] = Some(single);
    }

    /// Puts the paths of a node into the traffic.
    pub(super) fn load(&mut self, id: u32) {
        self.at = Some(id);
        let mut wanted: Vec<Option<Rc<AgentPath>>> = vec![None; self.members.len()];
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
    pub(super) fn constraints(&self, id: u32) -> impl Iterator<Item = &Constraint> {
        let mut at = id;
        let above = std::iter::from_fn(move || {
            let node = self.nodes.get(at as usize)?;
            at = node.parent;
            Some(node.constraint.as_ref())
        });
        self.base.iter().chain(above.flatten())
    }

    /// Fills the table with an agent's constraints in a node, and one more.
    pub(super) fn fill_table(&mut self, agent: usize, id: u32, more: Option<&Constraint>) {
        let mut table = std::mem::replace(&mut self.table, Constraints::new(0));
        table.clear();
        let number = self.members[agent];
        for constraint in self.constraints(id).chain(more) {
            constraint.apply(number, &mut table);
        }
        self.table = table;
    }

    /// A path for an agent in a node with one constraint more.
    pub(super) fn plan(
        &mut self,
        agent: usize,
        id: u32,
        more: Option<&Constraint>,
        least: u32,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Rc<AgentPath>>, Stopped> {
        self.fill_table(agent, id, more);
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
            Rc::new(AgentPath {
                path: found.path,
                cost: found.cost,
                bound: found.bound,
                origin: Cell::new(ROOT),
                singletons: OnceCell::new(),
            })
        }))
    }

    /// The child of the loaded node that one more constraint makes; `None` if nothing keeps it.
    pub(super) fn child(
        &mut self,
        id: u32,
        constraint: Constraint,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Node>, Stopped> {
        let affected = self.affected(&constraint);
        let mut rank = self.nodes[id as usize].rank;
        let before: Vec<(usize, Rc<AgentPath>)> = affected
            .iter()
            .filter_map(|&agent| Some((agent, Rc::clone(self.loaded[agent].as_ref()?))))
            .collect();
        let sum = |paths: &[(usize, Rc<AgentPath>)]| {
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
            has_wdg: false,
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
}
