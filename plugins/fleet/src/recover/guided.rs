//! Planning anew with PIBT along the paths that the planner left.
//!
//! Z. Chen, D. Harabor, J. Li, P. J. Stuckey, "Traffic flow optimisation for lifelong
//! multi-agent path finding", AAAI 2024: an agent has a guide path, and of the cells where it
//! could be next it prefers the one that is nearest to the path, and of those as near the one
//! from where less of the path is left.

use std::collections::BTreeMap;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Goals, GridPlan, Instance};
use fleetyard_plugin_mapf::lifelong::{Place, Ranking};
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::plugin::Call;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::pibt::{SteppedMap, SteppingOptions};
use super::{Policy, Problem, Recovery};
use crate::ground::Ground;

/// PIBT along the failed paths.
pub type GuidedPibt = Policy<GuidedOptions>;

/// The options, for the policy that goes by guide paths.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct GuidedOptions(SteppingOptions);

impl Recovery for GuidedOptions {
    const NAMES: (&'static str, &'static str) = ("guided-pibt", "Guided PIBT");
    const ABOUT: &'static str = "Plans anew with PIBT along the paths that the planner left: moves \
         are ranked by how near they lead to the path, then by how much of it is left (Chen, \
         Harabor, Li, Stuckey, AAAI 2024). Where a path ends before a goal, PIBT goes on by itself.";
    type Map = SteppedMap;

    fn check(&self) -> Result<(), String> {
        self.0.faults()
    }

    fn recover(
        &self,
        map: &mut SteppedMap,
        instance: &Instance,
        failed: Option<&GridPlan>,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        self.0
            .recover(map, instance, call, |ground, problem, goals| {
                Guides::new(ground, problem, goals, failed)
            })
    }
}

/// The guide paths of a fleet.
struct Guides<'g> {
    ground: &'g Ground,
    agents: Vec<Guide>,
}

/// The guide path of an agent.
struct Guide {
    path: Vec<Vertex>,
    /// Indices in the path at which the agent visits its goals, one after the other, as far as it
    /// does.
    visits: Vec<usize>,
    /// The part of the path that it is on: how many goals it has visited, and how far places
    /// are from there.
    part: Option<(usize, Field)>,
}

/// Per vertex, the distance to a part of a path, and the steps left on that part from the nearest
/// vertex of it.
struct Field {
    /// The end of the part, if that is no goal: the path has no guidance beyond it.
    open_end: Option<Vertex>,
    left_behind: bool,
    known: BTreeMap<Vertex, (u32, u32)>,
    edge: Vec<Vertex>,
    distance: u32,
}

impl<'g> Guides<'g> {
    fn new(
        ground: &'g Ground,
        problem: &Problem<'_>,
        goals: &Goals,
        failed: Option<&GridPlan>,
    ) -> Self {
        let paths = problem.paths(failed).into_iter();
        let guide = |(mut path, goals): (Vec<Vertex>, &[u32])| {
            path.dedup();
            let mut visits = Vec::new();
            let mut from = 0;
            for goal in goals {
                let found = path[from..]
                    .iter()
                    .position(|v| ground.graph.cell(*v) == *goal);
                let Some(further) = found else { break };
                from += further;
                visits.push(from);
            }
            Guide {
                path,
                visits,
                part: None,
            }
        };
        Self {
            agents: paths.zip(goals.iter()).map(guide).collect(),
            ground,
        }
    }
}

impl Guide {
    /// The part of the path on which an agent is that has visited so many goals.
    fn field(&mut self, visited: usize) -> Option<&mut Field> {
        if self
            .part
            .as_ref()
            .is_none_or(|(before, _)| *before != visited)
        {
            let from = match visited.checked_sub(1) {
                None => Some(0),
                Some(before) => self.visits.get(before).copied(),
            };
            let to = self.visits.get(visited).copied();
            let last = self.path.len() - 1;
            let part = from.map_or(&[][..], |from| &self.path[from..=to.unwrap_or(last)]);
            let mut known = BTreeMap::new();
            // Where the path comes to a cell again, the last time counts.
            for (left, v) in (0..).zip(part.iter().rev()) {
                known.entry(*v).or_insert((0, left));
            }
            let field = Field {
                open_end: if to.is_none() {
                    part.last().copied()
                } else {
                    None
                },
                left_behind: part.is_empty(),
                edge: part.to_vec(),
                known,
                distance: 0,
            };
            self.part = Some((visited, field));
        }
        self.part.as_mut().map(|(_, field)| field)
    }
}

impl Field {
    /// Distance of a vertex from the path, and steps of the path that are left from there.
    fn get(&mut self, ground: &Ground, v: Vertex) -> (u32, u32) {
        loop {
            if let Some(found) = self.known.get(&v) {
                return *found;
            }
            if self.edge.is_empty() {
                return (u32::MAX, u32::MAX);
            }
            self.distance += 1;
            let mut next = Vec::new();
            for here in std::mem::take(&mut self.edge) {
                let left = self.known.get(&here).map_or(0, |(_, left)| *left);
                let wall = ground.graph.wall();
                let sources = ground.graph.sources(here).iter().copied();
                for near in sources.filter(|near| *near != wall) {
                    match self.known.get_mut(&near) {
                        None => {
                            self.known.insert(near, (self.distance, left));
                            next.push(near);
                        }
                        Some((distance, least)) if *distance == self.distance => {
                            *least = left.min(*least);
                        }
                        Some(_) => {}
                    }
                }
            }
            self.edge = next;
        }
    }
}

impl Ranking for Guides<'_> {
    fn rank(&mut self, place: Place, cells: &mut [u32]) -> usize {
        let Some(field) = self.agents[place.agent].field(place.visited) else {
            return 0;
        };
        let vertex = |cell: u32| self.ground.graph.vertex(cell);
        if field.open_end.is_some() && field.open_end == vertex(place.cell) {
            field.left_behind = true;
        }
        if field.left_behind {
            return 0;
        }
        cells.sort_by_cached_key(|cell| match vertex(*cell) {
            Some(v) => field.get(self.ground, v),
            None => (u32::MAX, u32::MAX),
        });
        0
    }
}
