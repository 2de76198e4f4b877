//! Metrics of a plan, computed from its paths alone.
//!
//! Costs are those of classical MAPF (Stern et al. 2019): an agent's cost is the
//! time of its last arrival, after which it stays. Numbers are those of the
//! paths as they are; whether the plan is valid is for [`crate::validate`].

use fleetyard_core::{
    Connectivity, GridInstance, GridPlan, GridSearch, OctileLength, TrajectoryPlan,
};
use serde::{Deserialize, Serialize};

use crate::path::line_length;

/// Costs of a plan in the plane, the currency in which plans on grids, on roadmaps and in the
/// plane are compared (GRACE, section V).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TravelCosts {
    /// Sum over agents of the time at which they come to rest for good, in seconds.
    pub sum_of_costs_s: f64,
    /// The latest of these times, in seconds.
    pub makespan_s: f64,
    /// Length of all paths, in metres.
    pub length_m: f64,
}

impl TravelCosts {
    /// Costs of a plan as it is, valid or not.
    pub fn of(plan: &TrajectoryPlan) -> Self {
        let arrivals = || plan.paths().map(|knots| knots.time_s[knots.arrival()]);
        Self {
            sum_of_costs_s: arrivals().sum(),
            makespan_s: arrivals().fold(0.0, f64::max),
            length_m: plan.paths().map(|knots| knots.length_m()).sum(),
        }
    }
}

/// Cost, length and lower bounds of a plan on a grid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PlanMetrics {
    /// Sum over agents of the time of their last arrival, in steps (SoC).
    pub sum_of_costs: u64,
    /// Latest last arrival, in steps.
    pub makespan: u64,
    /// Steps in which an agent moves, over all agents.
    pub moves: u64,
    /// Steps in which an agent waits before its last arrival, over all agents.
    pub waits: u64,
    /// Length of all paths in cells: 1 for a move, and for a longer step the cells of
    /// its Bresenham line without the first, as the grid-maze benchmark measures
    /// any-angle paths.
    pub length_cells: u64,
    /// Length of all paths in metres: a diagonal move is √2 cells and a wait
    /// nothing.
    pub length_m: f64,
    /// Sum over agents of the fewest steps from start to goal, ignoring others.
    pub lower_bound_steps: u64,
    /// Most of these steps: no plan has a smaller makespan.
    pub lower_bound_makespan: u64,
    /// Sum over agents of the shortest length from start to goal in metres,
    /// ignoring others. On an eight-connected grid a shortest path need not be
    /// one of fewest steps.
    pub lower_bound_m: f64,
    /// Cost of every agent of the plan, in steps.
    pub costs: Vec<u32>,
}

/// Computes the metrics of a plan on cells of `cell_size_m` metres.
///
/// A step that is no unit move counts as one move of its straight-line length;
/// steps to or from outside the map have no length.
pub fn metrics(instance: &GridInstance, plan: &GridPlan, cell_size_m: f64) -> PlanMetrics {
    let grid = instance.grid();
    let mut costs = Vec::with_capacity(plan.agents());
    let mut moves = 0;
    let mut waits = 0;
    // Straight and diagonal moves are counted, so that the sum does not depend
    // on the order of additions.
    let (mut straight, mut diagonal) = (0u64, 0u64);
    let mut other_cells = 0.0;
    let mut length_cells = 0;
    for path in plan.paths() {
        let mut cost = 0;
        let mut path_moves = 0;
        for (time, step) in path.windows(2).enumerate() {
            let (from, to) = (step[0], step[1]);
            if from == to {
                continue;
            }
            cost = time as u32 + 1;
            path_moves += 1;
            if from.max(to) >= grid.cell_count() {
                continue;
            }
            let (from, to) = (grid.row_col(from), grid.row_col(to));
            length_cells += u64::from(line_length(from, to));
            let (rows, cols) = (from.0.abs_diff(to.0), from.1.abs_diff(to.1));
            match (rows, cols) {
                (1, 0) | (0, 1) => straight += 1,
                (1, 1) => diagonal += 1,
                _ => {
                    let (rows, cols) = (f64::from(rows), f64::from(cols));
                    other_cells += (rows * rows + cols * cols).sqrt();
                }
            }
        }
        costs.push(cost);
        moves += path_moves;
        waits += u64::from(cost) - path_moves;
    }
    let bound = lower_bound(instance);
    let length =
        |straight: u64, diagonal: u64| straight as f64 + diagonal as f64 * std::f64::consts::SQRT_2;
    PlanMetrics {
        sum_of_costs: costs.iter().copied().map(u64::from).sum(),
        makespan: costs.iter().copied().max().unwrap_or(0).into(),
        moves,
        waits,
        length_cells,
        length_m: (length(straight, diagonal) + other_cells) * cell_size_m,
        lower_bound_steps: bound.steps,
        lower_bound_makespan: bound.makespan,
        lower_bound_m: length(bound.straight, bound.diagonal) * cell_size_m,
        costs,
    }
}

#[derive(Default)]
struct LowerBound {
    steps: u64,
    makespan: u64,
    straight: u64,
    diagonal: u64,
}

fn lower_bound(instance: &GridInstance) -> LowerBound {
    let connectivity = instance.connectivity();
    let mut search = GridSearch::new(instance.grid());
    let mut bound = LowerBound::default();
    for (start, goal) in instance.starts().iter().zip(instance.goals()) {
        // An instance's goals are within reach.
        let steps = search.steps(*start, *goal, connectivity).unwrap_or(0);
        let length = match connectivity {
            Connectivity::Four => OctileLength {
                straight: steps,
                diagonal: 0,
            },
            Connectivity::Eight => search.octile(*start, *goal).unwrap_or_default(),
        };
        bound.steps += u64::from(steps);
        bound.makespan = bound.makespan.max(u64::from(steps));
        bound.straight += u64::from(length.straight);
        bound.diagonal += u64::from(length.diagonal);
    }
    bound
}
