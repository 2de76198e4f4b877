//! Maps and the budget of every call.

use std::sync::Arc;

use fleetyard_abi::{Budget, GridEnvironment, SharedEnvironment};
use fleetyard_testkit::grid;

pub(crate) const BUDGET: Budget = Budget {
    deadline_monotonic_ns: u64::MAX,
    answer_by_ns: u64::MAX,
    wall_ns: 1_000_000_000,
    nodes: 0,
    memory_bytes: 0,
    threads: 1,
    seed: 7,
};

pub(crate) fn map(rows: u32, cols: u32, free: impl Fn(u32) -> bool) -> SharedEnvironment {
    let passable: Vec<u8> = (0..rows * cols).map(|cell| free(cell).into()).collect();
    Arc::new(GridEnvironment::four_connected(rows, cols, passable).into())
}

pub(crate) fn drawn(rows: &[&str]) -> SharedEnvironment {
    Arc::new(grid::drawn(rows).into())
}
