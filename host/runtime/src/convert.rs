//! Between the domain model of the host and the model of the contract.

use fleetyard_abi::{
    Environment, GridEnvironment, Instance, Motion, Objective, PlanRef, SharedEnvironment,
};
use fleetyard_core::{Grid, GridInstance, GridPlan};

/// What a planner is told of a map.
pub fn environment(instance: &GridInstance, cell_size_m: f64, step_s: f64) -> SharedEnvironment {
    let grid = instance.grid();
    let passable = grid
        .terrain()
        .iter()
        .map(|letter| Grid::letter_is_passable(*letter).into());
    SharedEnvironment::new(Environment::Grid(GridEnvironment {
        map_name: grid.name().to_owned(),
        rows: grid.rows(),
        cols: grid.cols(),
        connectivity: instance.connectivity().degree(),
        cell_size_m,
        step_s,
        passable: passable.collect(),
        terrain: grid.terrain().to_vec(),
    }))
}

/// What a planner is asked to solve.
pub fn instance(instance: &GridInstance, radius_m: f64) -> Instance {
    Instance {
        motion: Motion::Pebble,
        objective: Objective::SumOfCosts,
        radius_m,
        ..Instance::one_shot(instance.starts().to_vec(), instance.goals().to_vec())
    }
}

/// A plugin's plan as the host keeps it.
pub fn plan_from_abi(plan: PlanRef<'_>) -> GridPlan {
    let mut kept = GridPlan::with_capacity(plan.agents(), plan.cells().len());
    for path in plan.paths() {
        kept.push_path(path.iter().copied());
    }
    kept
}
