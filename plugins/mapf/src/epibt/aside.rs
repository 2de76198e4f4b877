//! Agents that step aside before dead ends.
//!
//! Two agents in a corridor that is closed behind one of them, and wider only far behind the other,
//! see no operation that gets them past each other, and the one of higher priority pushes the other one
//! back to where it came from for ever. So who stands between the other and the first wide place goes
//! back there and steps aside, as by the swap operation of PIBT; who has not entered yet waits.

use fleetyard_plugin_spacetime::graph::{Graph, Vertex};

use super::NOBODY;
use super::operations::Near;
use super::run::{Agent, Run};
use crate::pibt::swap::{Corridors, Will};
use crate::streets::STEP;

/// Wishes of the agents of a run.
struct Wants<'r, 'a, 'b, 's, const D: usize>(&'r Run<'a, 'b, 's, D>);

impl<const D: usize> Wants<'_, '_, '_, '_, D> {
    /// The cost of the way of an agent from a vertex; `None` if it wants nothing, or its ways are
    /// not known.
    fn rest(&self, agent: usize, v: Vertex) -> Option<u32> {
        let (ways, tolls) = self.0.agents[agent].ways[0].as_ref()?;
        let streets = &self.0.streets;
        Some(ways.from(streets.moves(), v, None, streets.tolls(*tolls)))
    }

    /// The next cell on the way of an agent from a vertex.
    fn next(&self, agent: usize, v: Vertex, heading: Option<u8>) -> Option<Vertex> {
        let (ways, tolls) = self.0.agents[agent].ways[0].as_ref()?;
        let streets = &self.0.streets;
        let d = ways.best(streets.moves(), v, heading, streets.tolls(*tolls))?;
        Some(self.0.graph.around(v)[d])
    }
}

impl<const D: usize> Will for Wants<'_, '_, '_, '_, D> {
    fn nearer(&mut self, _: &Graph, agent: usize, a: Vertex, b: Vertex) -> bool {
        self.rest(agent, a) < self.rest(agent, b)
    }

    fn willing(&mut self, graph: &Graph, agent: usize, a: Vertex, b: Vertex) -> bool {
        self.0.agents[agent].is_done() || self.nearer(graph, agent, a, b)
    }

    fn rests(&self, agent: usize, v: Vertex) -> bool {
        let Agent {
            stays,
            visited,
            ref goals,
            ..
        } = self.0.agents[agent];
        stays && goals[visited..] == [v]
    }
}

impl<const D: usize> Run<'_, '_, '_, D> {
    /// The way of an agent that has to step aside, or to wait; `None` for all others. `occupant` is the
    /// agent in each vertex.
    pub(super) fn aside(&self, agent: usize, occupant: &[u32]) -> Option<Near> {
        // No agent can go back against the arrows.
        if self.graph.is_directed() {
            return None;
        }
        let mut wants = Wants(self);
        let corridors = Corridors {
            graph: self.graph,
            occupant,
        };
        // Up to the next agent on the way.
        let Agent { at, heading, .. } = self.agents[agent];
        let mut path = vec![at];
        let mut ahead = wants.next(agent, at, heading)?;
        while occupant[ahead as usize] == NOBODY {
            path.push(ahead);
            if path.len() > D + 1 {
                return None;
            }
            ahead = wants.next(agent, ahead, None)?;
        }
        let other = occupant[ahead as usize];
        let last = path[path.len() - 1];
        if self.graph.is_open(ahead)
            || !corridors.swap_required(agent as u32, other, last, ahead, &mut wants)
        {
            return None;
        }
        let mut back = Vec::new();
        if !corridors.way_back(ahead, last, &wants, |v| back.push(v)) {
            return None;
        }
        // Out of the way that the other one takes from the wide place on.
        let wide = *back.last()?;
        let before = back.len().checked_sub(2).map_or(ahead, |at| back[at]);
        let on = wants.next(other as usize, wide, None);
        let beside = || {
            let mut around = self.graph.neighbors(wide);
            around.find(|&v| v != before && Some(v) != on)
        };
        let way: Vec<Vertex> = if let Some(here) = back.iter().position(|&v| v == at) {
            back[here..].iter().copied().chain([beside()?]).collect()
        } else {
            // The wide place is ahead.
            let end = path.iter().position(|&v| v == wide)?;
            if Some(path[end - 1]) == on {
                path[..=end].iter().copied().chain([beside()?]).collect()
            } else {
                path[..end].to_vec()
            }
        };
        let costs = way.iter().rev().zip((0..).map(|steps| steps * STEP));
        Some(Near::new(costs.map(|(&v, cost)| (v, cost))))
    }
}
