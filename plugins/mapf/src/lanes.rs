//! PIBT along the lanes of the map.
//!
//! Of the cells where an agent could be next it prefers the one from where the way to its
//! goal is the shortest, with what moves against [`Lanes`] are charged; of equals those that
//! PIBT prefers by itself. Who goes first is decided by that way too, so that the first of
//! all still arrives.

use std::sync::Arc;

use fleetyard_abi::Goals;
use fleetyard_plugin_spacetime::distance::{Table, Tables};
use fleetyard_plugin_spacetime::graph::Graph;
use fleetyard_plugin_spacetime::lanes::Lanes;

use crate::lifelong::{Place, Ranking};

/// The lanes of a map, and the ways to goals along them, kept from call to call.
#[derive(Debug)]
pub struct Streets {
    graph: Arc<Graph>,
    lanes: Lanes,
    tables: Tables,
}

impl Streets {
    /// Moves against a lane are charged so many steps. Tables may take so many bytes.
    pub fn new(graph: &Arc<Graph>, charge: u32, bytes: u64) -> Self {
        Self {
            graph: Arc::clone(graph),
            lanes: Lanes::new(graph, charge),
            tables: Tables::new(bytes),
        }
    }

    /// Makes ready for a fleet with these goals. `None` when tables of one goal each would take
    /// more than half of the bytes, so that none would stay to the next goals, or when time is
    /// up; tables that were made are kept.
    pub fn ranking<'a>(
        &'a mut self,
        goals: &'a Goals,
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<ByLane<'a>> {
        let bytes = Table::bytes(&self.graph, false).saturating_mul(goals.len() as u64);
        if bytes > self.tables.limit() / 2 {
            return None;
        }
        self.tables.begin();
        let mut ranking = ByLane {
            streets: self,
            goals,
            ways: Vec::with_capacity(goals.len()),
        };
        for agent in 0..goals.len() {
            if stop() {
                return None;
            }
            let way = ranking.way(agent, 0);
            ranking.ways.push((0, way));
        }
        Some(ranking)
    }
}

/// The order of lanes in one call.
#[derive(Debug)]
pub struct ByLane<'a> {
    streets: &'a mut Streets,
    goals: &'a Goals,
    /// The table of the goal that each agent is after, by how many it has visited before.
    ways: Vec<(usize, Option<Arc<Table>>)>,
}

impl ByLane<'_> {
    fn way(&mut self, agent: usize, visited: usize) -> Option<Arc<Table>> {
        let Streets {
            graph,
            lanes,
            tables,
        } = &mut *self.streets;
        let goal = graph.vertex(*self.goals.get(agent)?.get(visited)?)?;
        tables.get(graph, goal, false, Some(lanes))
    }

    /// Distance from a cell to the next goal of the agent of a [`Place`].
    #[inline]
    fn far(&mut self, place: Place) -> Option<impl Fn(u32) -> u32> {
        if self.ways[place.agent].0 != place.visited {
            let way = self.way(place.agent, place.visited);
            self.ways[place.agent] = (place.visited, way);
        }
        let table = self.ways[place.agent].1.as_ref()?;
        let graph = &self.streets.graph;
        Some(move |cell| graph.vertex(cell).map_or(u32::MAX, |v| table.get(v, 0)))
    }
}

impl Ranking for ByLane<'_> {
    #[inline]
    fn rank(&mut self, place: Place, cells: &mut [u32]) {
        if let Some(far) = self.far(place) {
            cells.sort_by_key(|cell| far(*cell));
        }
    }

    #[inline]
    fn urgency(&mut self, place: Place) -> Option<u32> {
        self.far(place).map(|far| far(place.cell))
    }
}
