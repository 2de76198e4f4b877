//! One plugin of each kind on the Rust SDK, to be read and copied. As a shared
//! library and, with `main.rs`, as an executable that speaks JSON over stdio.
//!
//! Not the standard plugins: those are better and longer.

mod all_wait;
mod layered;
mod periodic;
mod random_goals;

pub use all_wait::AllWait;
pub use layered::Layered;
pub use periodic::Periodic;
pub use random_goals::RandomGoals;

fleetyard_abi::export! {
    planners: [Layered],
    fail_policies: [AllWait],
    instance_generators: [RandomGoals],
    invocation_policies: [Periodic],
}

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Environment, GridEnvironment, Status};
use serde::Deserialize;

/// The options of a plugin that has none: a name is a spelling mistake.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct NoOptions {}

/// The grid of an environment, if this crate can plan on it.
fn four_connected(environment: &Environment) -> Result<&GridEnvironment, Failure> {
    environment
        .grid()
        .filter(|grid| grid.connectivity == 4)
        .ok_or_else(|| {
            Failure::new(
                Status::Unsupported,
                "this plugin knows grids with 4 neighbours only",
            )
        })
}

/// The free neighbours of every cell.
fn neighbours(grid: &GridEnvironment) -> Vec<Vec<u32>> {
    let (rows, cols) = (grid.rows as usize, grid.cols as usize);
    let of_cell = |cell: usize| {
        let (row, col) = (cell / cols, cell % cols);
        let near = [
            (row > 0).then(|| cell - cols),
            (col + 1 < cols).then(|| cell + 1),
            (row + 1 < rows).then(|| cell + cols),
            (col > 0).then(|| cell - 1),
        ];
        let free = near.into_iter().flatten();
        free.filter(|near| grid.passable[*near] != 0)
            .map(|near| near as u32)
            .collect()
    };
    (0..rows * cols).map(of_cell).collect()
}
