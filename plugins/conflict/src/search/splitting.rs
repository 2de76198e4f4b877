//! Splitting: the constraints of the children that resolve a conflict.
//!
//! A vertex, an edge or a ring of agents forbids each agent its part (Sharon et al., AIJ 219,
//! 2015); rings have as many children as agents. Target, corridor and rectangle symmetries are
//! resolved at once ([`crate::symmetry`]; Li, Harabor, Stuckey, Ma, Gange, Koenig, AIJ 301,
//! 2021). Disjoint splitting (Li, Harabor, Stuckey, Felner, Ma, Koenig, ICAPS 2019) is used for
//! targets alone: the two ranges of arrival times exclude each other.

use std::sync::Arc;

use fleetyard_plugin_spacetime::astar::{Query, Stopped};
use fleetyard_plugin_spacetime::conflict::{Conflict, FOREVER, Kind};
use fleetyard_plugin_spacetime::distance::Table;
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::problem::Route;

use super::Search;
use super::choice::{Cardinality, Urgency};
use crate::constraint::Constraint;
use crate::symmetry::{corridor, passage, rectangle};

/// Corridor ends to which distances are remembered.
const MOST_DISTANCES: usize = 256;

impl Search<'_> {
    /// The constraints of the children for a conflict.
    pub(super) fn split(
        &mut self,
        id: u32,
        conflict: &Conflict,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Vec<Constraint>, Stopped> {
        let time = conflict.time;
        if self.settings.symmetry {
            if let Some((rests, _)) = self.target(conflict)
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

    /// The agent that rests at its goal where another one passes, and the other one.
    pub(super) fn target(&self, conflict: &Conflict) -> Option<(usize, usize)> {
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

    /// The barriers of the most urgent rectangle, if that is more urgent than what is known.
    pub(super) fn rectangles(
        &mut self,
        id: u32,
        conflicts: &[&Conflict],
        known: Urgency,
    ) -> Option<Vec<Constraint>> {
        let one_way = self.problem.graph.is_directed();
        if !self.settings.symmetry || self.problem.turning || self.rules.delay > 0 || one_way {
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
            let singles = agents.map(|agent| self.with_mdd(agent));
            if singles.iter().any(|single| single.cost != single.bound) {
                continue;
            }
            let levels = [0, 1].map(|i| singles[i].singletons.get().map_or(&[][..], Vec::as_slice));
            let graph = &self.problem.graph;
            let Some(found) = rectangle(graph, levels, v, conflict.time) else {
                continue;
            };
            let class = Cardinality::of(found.cardinal);
            if (class, 0) >= urgency {
                continue;
            }
            let mut barriers = found.barriers;
            for i in 0..2 {
                if found.whole[i] {
                    continue;
                }
                self.fill_table(agents[i], id, None);
                let route = self.route(agents[i]);
                let until = self.rules.until;
                self.mdd.members(
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

    /// The ranges that keep one of two agents out of a corridor in which they meet.
    fn corridors(
        &mut self,
        id: u32,
        conflict: &Conflict,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Vec<Constraint>>, Stopped> {
        // In one-way streets nobody meets.
        if self.problem.graph.is_directed() {
            return Ok(None);
        }
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
        if self.distances.len() >= MOST_DISTANCES && !self.distances.contains_key(&goal) {
            self.distances.clear();
        }
        let (graph, turning) = (&self.problem.graph, self.problem.turning);
        let table = self
            .distances
            .entry(goal)
            .or_insert_with(|| Arc::new(Table::new(graph, goal, turning, None)));
        let table = Arc::clone(table);
        let Route { start, heading, .. } = *self.route(agent);
        let route = Route::to(start, heading, goal, table);
        self.fill_table(agent, id, None);
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
}
