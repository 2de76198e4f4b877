//! Between the domain model of the host and the model of the contract.

use fleetyard_abi::{
    Environment, GridEnvironment, GridPlan, Instance, Motion, Objective, SharedEnvironment,
};
use fleetyard_core::{Connectivity, Grid, GridInstance, OFF_MAP};

/// The environment of an instance, as a planner is told it.
pub fn environment(instance: &GridInstance, cell_size_m: f64, step_s: f64) -> SharedEnvironment {
    environment_of(
        instance.grid(),
        instance.connectivity(),
        cell_size_m,
        step_s,
    )
}

/// The environment of a map, as plugins are told it.
pub fn environment_of(
    grid: &Grid,
    connectivity: Connectivity,
    cell_size_m: f64,
    step_s: f64,
) -> SharedEnvironment {
    let passable: Vec<u8> = grid
        .terrain()
        .iter()
        .map(|letter| Grid::letter_is_passable(*letter).into())
        .collect();
    let (rows, cols, degree) = (grid.rows(), grid.cols(), connectivity.degree());
    let view = GridEnvironment {
        rows,
        cols,
        connectivity: degree,
        cell_size_m,
        step_s,
        origin_m: [0.0, 0.0],
        moves: grid.move_masks(connectivity),
        passable,
        terrain: grid.terrain().to_vec(),
    };
    SharedEnvironment::new(Environment::from(view).named(grid.name()))
}

/// The instance, as a planner is asked to solve it.
pub fn instance(instance: &GridInstance, radius_m: f64) -> Instance {
    Instance {
        motion: Motion::Pebble,
        objective: Objective::SumOfCosts,
        radius_m,
        ..Instance::one_shot(instance.starts().to_vec(), instance.goals().to_vec())
    }
}

/// A plugin's plan for a map of so many cells, as the host keeps it. Whatever is
/// outside the map becomes [`OFF_MAP`], as it does on the wire: a plan is the same by
/// every attachment.
pub fn plan_from_abi(plan: &GridPlan, cells: u32) -> GridPlan {
    let mut kept = GridPlan::with_capacity(plan.agents(), plan.cells().len());
    let on_map = |cell: &u32| if *cell < cells { *cell } else { OFF_MAP };
    for path in plan.paths() {
        kept.push_path(path.iter().map(on_map));
    }
    kept
}
