//! Gives each open task to the nearest agent that has nothing to do; the rest wait.
//!
//! Tasks are given away in the order in which they came. Put your own rule into
//! `generate`.

use std::collections::{BTreeSet, VecDeque};

use fleetyard_abi::sdk::{Failure, InstanceGenerator, Options, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Assignment, Budget, Capabilities, Capability, Descriptor, FleetState, GridEnvironment, Kind,
    Request, SharedEnvironment, Status,
};
use schemars::JsonSchema;
use serde::Deserialize;

fleetyard_abi::export! { instance_generators: [NearestIdle] }

/// The options, as in `--option NAME=VALUE`. The host checks them before the generator starts.
#[derive(Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct NearestIdleOptions {
    /// Most tasks to give away in one call.
    #[schemars(range(min = 1))]
    most_tasks: usize,
}

impl Default for NearestIdleOptions {
    fn default() -> Self {
        Self { most_tasks: 1000 }
    }
}

/// Gives each open task to the nearest agent that has nothing to do.
pub struct NearestIdle {
    options: NearestIdleOptions,
}

/// The map: per cell, the cells that one move reaches.
pub struct Map {
    neighbours: Vec<Vec<u32>>,
}

impl Plugin for NearestIdle {
    fn descriptor() -> Descriptor {
        Descriptor {
            version: env!("CARGO_PKG_VERSION").into(),
            // What the host may ask; docs/conformance.md lists all there is.
            capabilities: Capabilities::of(&[
                Capability::Grid,
                Capability::Pebble,
                Capability::Deterministic,
            ]),
            options_schema: options_schema::<NearestIdleOptions>(),
            ..Descriptor::new(
                Kind::InstanceGenerator,
                env!("CARGO_PKG_NAME"),
                "Gives each open task to the nearest agent that has nothing to do.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        Ok(Self {
            options: options.parse()?,
        })
    }
}

impl InstanceGenerator for NearestIdle {
    type Map = Map;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<Map, Failure> {
        let unknown = || Failure::new(Status::Unsupported, "this generator knows grids only");
        let grid = environment.grid().ok_or_else(unknown)?;
        let neighbours = neighbours(grid);
        Ok(Map { neighbours })
    }

    fn generate(
        &mut self,
        map: &mut Map,
        state: &FleetState,
        _budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        // What agents have to do they keep.
        let mut goals: Vec<Vec<u32>> = state.next.goals.iter().map(<[u32]>::to_vec).collect();
        // Two agents cannot end in the same cell.
        let mut ends: BTreeSet<u32> = goals
            .iter()
            .filter_map(|list| list.last().copied())
            .collect();
        // The host appends the cells of these tasks to the goals of their agents.
        let mut assignments = Vec::new();
        for task in state.tasks.iter().take(self.options.most_tasks) {
            if sink.cancelled() {
                return Err(Failure::new(Status::TimedOut, "the time is up"));
            }
            let (Some(first), Some(last)) = (task.places.first(), task.places.last()) else {
                continue;
            };
            let distances = map.distances(*first);
            let steps = |cell: u32| distances[cell as usize];
            let reachable = task.places.iter().all(|cell| steps(*cell).is_some());
            if ends.contains(last) || !reachable {
                continue;
            }
            let nearest = (0..goals.len())
                .filter(|agent| goals[*agent].is_empty())
                .filter_map(|agent| Some((steps(state.next.starts[agent])?, agent)))
                .min();
            if let Some((_, agent)) = nearest {
                goals[agent].clone_from(&task.places);
                ends.insert(*last);
                assignments.push(Assignment {
                    agent: agent as u32,
                    task: task.id,
                });
            }
        }
        for (agent, list) in goals.iter_mut().enumerate() {
            if list.is_empty() {
                list.push(map.place_to_wait(state.next.starts[agent], &ends)?);
                ends.extend(list.last());
            }
        }
        sink.submit_request(&Request {
            assignments,
            ..state.request(goals.into_iter().collect())
        })?;
        Ok(())
    }
}

impl Map {
    /// Steps from a cell to every other when nobody is in the way.
    fn distances(&self, from: u32) -> Vec<Option<u32>> {
        let mut distances = vec![None; self.neighbours.len()];
        distances[from as usize] = Some(0);
        let mut queue = VecDeque::from([(from, 0)]);
        while let Some((cell, steps)) = queue.pop_front() {
            for near in &self.neighbours[cell as usize] {
                if distances[*near as usize].is_none() {
                    distances[*near as usize] = Some(steps + 1);
                    queue.push_back((*near, steps + 1));
                }
            }
        }
        distances
    }

    /// The nearest cell where nobody ends: most often where the agent is.
    fn place_to_wait(&self, cell: u32, ends: &BTreeSet<u32>) -> Result<u32, Failure> {
        if !ends.contains(&cell) {
            return Ok(cell);
        }
        let reachable = (0..).zip(self.distances(cell));
        let nearest = reachable
            .filter(|(near, _)| !ends.contains(near))
            .filter_map(|(near, steps)| Some((steps?, near)))
            .min();
        let none = || Failure::new(Status::GaveUp, "no cell is left for an agent to wait in");
        nearest.map(|(_, near)| near).ok_or_else(none)
    }
}

/// The cells that one move reaches, for every cell. Cells are `row * cols + col`.
fn neighbours(grid: &GridEnvironment) -> Vec<Vec<u32>> {
    let (rows, cols) = (grid.rows, grid.cols);
    let of_cell = |cell: u32| {
        let (row, col) = (cell / cols, cell % cols);
        let near = [
            (row > 0).then(|| cell - cols),
            (col + 1 < cols).then(|| cell + 1),
            (row + 1 < rows).then(|| cell + cols),
            (col > 0).then(|| cell - 1),
        ];
        let free = |near: &u32| grid.passable[*near as usize] != 0;
        near.into_iter().flatten().filter(free).collect()
    };
    (0..rows * cols).map(of_cell).collect()
}
