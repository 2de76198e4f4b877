//! Follows the planner's failed paths for as long as nobody collides, and then waits.
//!
//! So the fleet goes on a little, and the next call of the planner is another question.
//! Put your own algorithm into `recover`.

use fleetyard_abi::sdk::{FailPolicy, Failure, Options, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, GridEnvironment, GridPlan, Instance, Kind, Plan,
    SharedEnvironment, Status,
};
use schemars::JsonSchema;
use serde::Deserialize;

fleetyard_abi::export! { fail_policies: [SafePrefix] }

/// The options, as in `--option NAME=VALUE`. The host checks them before the policy starts.
#[derive(Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct SafePrefixOptions {
    /// Most steps to take.
    steps: usize,
}

impl Default for SafePrefixOptions {
    fn default() -> Self {
        Self { steps: 10 }
    }
}

/// Keeps what is free of collisions at the beginning of the failed paths.
pub struct SafePrefix {
    options: SafePrefixOptions,
}

/// The map: per cell, the cells that one move reaches.
pub struct Map {
    neighbours: Vec<Vec<u32>>,
}

impl Plugin for SafePrefix {
    fn descriptor() -> Descriptor {
        Descriptor {
            version: env!("CARGO_PKG_VERSION").into(),
            // What the host may ask; docs/conformance.md lists all there is.
            capabilities: Capabilities::of(&[
                Capability::Grid,
                Capability::Pebble,
                Capability::Deterministic,
            ]),
            options_schema: options_schema::<SafePrefixOptions>(),
            ..Descriptor::new(
                Kind::FailPolicy,
                env!("CARGO_PKG_NAME"),
                "Keeps what is free of collisions at the beginning of the failed paths.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        Ok(Self {
            options: options.parse()?,
        })
    }
}

impl FailPolicy for SafePrefix {
    type Map = Map;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<Map, Failure> {
        let unknown = || Failure::new(Status::Unsupported, "this policy knows grids only");
        let grid = environment.grid().ok_or_else(unknown)?;
        let neighbours = neighbours(grid);
        Ok(Map { neighbours })
    }

    fn recover(
        &mut self,
        map: &mut Map,
        instance: &Instance,
        failed: Option<&Plan>,
        _budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let mut paths: Vec<Vec<u32>> = instance.starts.iter().map(|start| vec![*start]).collect();
        // The planner may have left nothing.
        if let Some(failed) = failed.and_then(Plan::cells) {
            for time in 1..=self.options.steps {
                let now: Vec<u32> = paths.iter().map(|path| path[time - 1]).collect();
                let at = |path: &[u32]| path.get(time).or(path.last()).copied();
                // An agent without a path is on no map.
                let after = failed.paths().map(|path| at(path).unwrap_or(u32::MAX));
                let after: Vec<u32> = after.collect();
                if sink.cancelled() || !map.is_safe(&now, &after) {
                    break;
                }
                for (path, cell) in paths.iter_mut().zip(after) {
                    path.push(cell);
                }
            }
        }
        sink.submit(&GridPlan::from_paths(paths))?;
        Ok(())
    }
}

impl Map {
    /// True if all agents can go from their cells to these in one step.
    fn is_safe(&self, now: &[u32], after: &[u32]) -> bool {
        let moves: Vec<(u32, u32)> = now.iter().copied().zip(after.iter().copied()).collect();
        moves.iter().enumerate().all(|(agent, (from, to))| {
            let is_step = to == from || self.neighbours[*from as usize].contains(to);
            let meets = |other: &(u32, u32)| other.1 == *to || *other == (*to, *from);
            is_step && !moves[..agent].iter().any(meets)
        })
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
