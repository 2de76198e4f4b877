//! Prioritized planning: agents plan one after the other, each round those before it.
//!
//! After Erdmann and Lozano-Perez, "On Multiple Moving Objects" (Algorithmica 1987). It
//! is simple, and neither complete nor optimal. Put your own algorithm into `plan`.

use std::collections::{BTreeMap, BTreeSet};

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, GridEnvironment, GridPlan, Instance, Kind,
    SharedEnvironment, Status,
};
use schemars::JsonSchema;
use serde::Deserialize;

fleetyard_abi::export! { planners: [Prioritized] }

/// The options, as in `--option NAME=VALUE`. The host checks them before the planner starts.
#[derive(Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct PrioritizedOptions {
    /// Most orders of the agents to try.
    #[schemars(range(min = 1))]
    attempts: u32,
}

impl Default for PrioritizedOptions {
    fn default() -> Self {
        Self { attempts: 100 }
    }
}

/// Prioritized planning, in another order when an agent finds no path.
pub struct Prioritized {
    options: PrioritizedOptions,
}

/// The map: per cell, the cells that one move reaches.
pub struct Map {
    neighbours: Vec<Vec<u32>>,
}

impl Plugin for Prioritized {
    fn descriptor() -> Descriptor {
        Descriptor {
            version: env!("CARGO_PKG_VERSION").into(),
            // What the host may ask; docs/conformance.md lists all there is.
            capabilities: Capabilities::of(&[
                Capability::Grid,
                Capability::Pebble,
                Capability::Deterministic,
            ]),
            options_schema: options_schema::<PrioritizedOptions>(),
            ..Descriptor::new(
                Kind::Planner,
                env!("CARGO_PKG_NAME"),
                "Prioritized planning, in another order when an agent finds no path.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        Ok(Self {
            options: options.parse()?,
        })
    }
}

impl Planner for Prioritized {
    type Map = Map;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<Map, Failure> {
        let unknown = || Failure::new(Status::Unsupported, "this planner knows grids only");
        let grid = environment.grid().ok_or_else(unknown)?;
        let neighbours = neighbours(grid);
        Ok(Map { neighbours })
    }

    fn plan(
        &mut self,
        map: &mut Map,
        instance: &Instance,
        _budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let starts: BTreeSet<u32> = instance.starts.iter().copied().collect();
        if starts.len() < instance.agents() {
            let reason = "two agents start in one cell";
            return Err(Failure::new(Status::InvalidInput, reason));
        }
        let mut order: Vec<usize> = (0..instance.agents()).collect();
        for _ in 0..self.options.attempts {
            let mut paths = BTreeMap::new();
            let failed = loop {
                let Some(agent) = order.get(paths.len()).copied() else {
                    // By agent, as a map is in the order of its keys.
                    sink.submit(&GridPlan::from_paths(paths.into_values()))?;
                    return Ok(());
                };
                match map.find_path(instance, agent, &paths, sink)? {
                    Some(path) => paths.insert(agent, path),
                    None => break paths.len(),
                };
            };
            let agent = order.remove(failed);
            if failed == 0 {
                let reason = format!("no path leads agent {agent} to its goal");
                return Err(Failure::new(Status::Infeasible, reason));
            }
            // Who found no path goes first, and who went first goes last.
            order.rotate_left(1);
            order.insert(0, agent);
        }
        let reason = "no order of the agents worked";
        Err(Failure::new(Status::GaveUp, reason))
    }
}

impl Map {
    /// The cells of a shortest path that meets none of the other paths, if there is one.
    fn find_path(
        &self,
        instance: &Instance,
        agent: usize,
        others: &BTreeMap<usize, Vec<u32>>,
        sink: &dyn Sink,
    ) -> Result<Option<Vec<u32>>, Failure> {
        let (start, goal) = (instance.starts[agent], instance.goals[agent][0]);
        // steps[t] has every cell where the agent can be at time t, and where it was
        // before that.
        let mut steps = vec![BTreeMap::from([(start, start)])];
        loop {
            let (time, reachable) = (steps.len(), &steps[steps.len() - 1]);
            // At the goal it stays: nobody may come by later.
            let comes_by = |path: &Vec<u32>| path.iter().skip(time).any(|cell| *cell == goal);
            if reachable.contains_key(&goal) && !others.values().any(comes_by) {
                break;
            }
            if sink.cancelled() {
                return Err(Failure::new(Status::TimedOut, "the time is up"));
            }
            let (before, now) = (positions(others, time - 1), positions(others, time));
            let mut reached = BTreeMap::new();
            for cell in reachable.keys() {
                for near in self.neighbours[*cell as usize].iter().chain([cell]) {
                    let swap = before.contains_key(near) && now.get(cell) == before.get(near);
                    if !now.contains_key(near) && !swap {
                        reached.entry(*near).or_insert(*cell);
                    }
                }
            }
            // Once the others stand still, what is not reached now never will be.
            let still = others.values().all(|path| path.len() < time);
            if reached.is_empty() || (still && reached.len() == reachable.len()) {
                return Ok(None);
            }
            steps.push(reached);
        }
        let mut path = vec![goal];
        for reached in steps[1..].iter().rev() {
            path.push(reached[&path[path.len() - 1]]);
        }
        path.reverse();
        Ok(Some(path))
    }
}

/// The agent in each cell at a time. After its last cell an agent stays there.
fn positions(paths: &BTreeMap<usize, Vec<u32>>, time: usize) -> BTreeMap<u32, usize> {
    let at = |path: &Vec<u32>| path[time.min(path.len() - 1)];
    paths.iter().map(|(who, path)| (at(path), *who)).collect()
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
        let is_free = |cell: u32| grid.passable[cell as usize] != 0;
        let may = |near: &u32| is_free(cell) && is_free(*near);
        near.into_iter().flatten().filter(may).collect()
    };
    (0..rows * cols).map(of_cell).collect()
}
