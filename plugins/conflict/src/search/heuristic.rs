//! The WDG heuristic: a lower bound of the cost that a node's conflicts add (Li, Felner,
//! Boyarski, Ma, Koenig, "Improved heuristics for multi-agent path finding with conflict-based
//! search", IJCAI 2019).
//!
//! In the weighted dependency graph of a node, agents that conflict are joined by an edge. Its
//! weight is the least cost that the two must add to avoid each other, found by a small CBS of
//! their own. The heuristic is the edge-weighted minimum vertex cover ([`least_cover`]).

use std::cell::Cell;
use std::rc::Rc;

use fleetyard_plugin_spacetime::astar::Stopped;
use fleetyard_plugin_spacetime::conflict::Kind;

use super::nodes::AgentPath;
use super::{End, Search, Settings};
use crate::constraint::Constraint;
use crate::cover::least_cover;

/// Expansions of the search for the weight of an edge.
const PAIR_NODES: u64 = 48;
/// Edges whose weight is remembered.
const MOST_PAIRS: usize = 1 << 18;

impl Search<'_> {
    /// The bound of the loaded node with the heuristic; `None` if two of its agents cannot avoid
    /// each other at any cost.
    pub(super) fn wdg_bound(
        &mut self,
        id: u32,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<u64>, Stopped> {
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
                    let chain = self
                        .constraints(id)
                        .filter(|constraint| constraint.binds(number));
                    *slot = Some(chain.fold(0_u128, |sum, c| sum.wrapping_add(c.hash())));
                }
            }
            let [one, other] = [a, b].map(|agent| hashes[agent as usize].unwrap_or(0));
            let key = (a, b, one, other);
            let weight = if let Some(&weight) = self.pair_weights.get(&key) {
                weight
            } else {
                let weight = self.edge_weight(id, [a, b], stop)?;
                if self.pair_weights.len() >= MOST_PAIRS {
                    self.pair_weights.clear();
                }
                self.pair_weights.insert(key, weight);
                weight
            };
            match weight {
                u32::MAX => return Ok(None),
                0 => {}
                _ => edges.push((a, b, weight)),
            }
        }
        self.nodes[id as usize].has_wdg = true;
        let rank = self.nodes[id as usize].rank;
        Ok(Some(
            rank.bound.max(rank.cost + u64::from(least_cover(&edges))),
        ))
    }

    /// The weight of an edge: the least cost that two agents must add to that of the loaded node
    /// to avoid each other; `u32::MAX` if they cannot.
    fn edge_weight(
        &mut self,
        id: u32,
        agents: [u32; 2],
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<u32, Stopped> {
        let numbers = agents.map(|agent| self.members[agent as usize]);
        let base: Vec<Constraint> = self
            .constraints(id)
            .filter(|constraint| numbers.iter().any(|&number| constraint.binds(number)))
            .cloned()
            .collect();
        let settings = Settings {
            wdg: false,
            node_limit: Some(PAIR_NODES),
            ..self.settings.clone()
        };
        let mut pair = match self.of_pair.take() {
            Some(pair) => pair,
            None => Box::new(Search::new(self.problem, settings)),
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
            // Nodes have other numbers there: MDDs have to be known before.
            let single = self.with_mdd(agent as usize);
            sum += u64::from(single.cost);
            let copy = AgentPath {
                path: single.path.clone(),
                origin: Cell::new(0),
                singletons: single.singletons.clone(),
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
        self.of_pair = Some(pair);
        match end {
            End::Infeasible => Ok(u32::MAX),
            End::Stopped => Err(Stopped),
            _ => Ok(u32::try_from(bound.saturating_sub(sum)).unwrap_or(u32::MAX - 1)),
        }
    }
}
