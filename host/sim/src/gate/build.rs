//! The dependency graph of routes, and the proof that it is free of deadlock.

use fleetyard_world::Shape;

use super::graph::{DependencyGraph, GateOptions};
use super::meet::Bodies;
use super::routes::{Cuts, Refined, Routes};
use super::{GateError, cells, near, rings};

impl DependencyGraph {
    /// Finds the dependencies between routes of agents with the given shapes.
    ///
    /// Fails if two agents of the plan collide, or are so near each other that they
    /// cannot pass in any order.
    pub fn build<'s, R: Routes + ?Sized>(
        routes: &R,
        shape: &'s (dyn Fn(usize) -> &'s Shape + Sync),
        options: &GateOptions,
    ) -> Result<Self, GateError> {
        check(routes, options)?;
        let agents = routes.agents();
        let bodies = Bodies::new(agents, shape);
        let by_cell = options
            .cell_size_m
            .and_then(|side_m| cells::edges(routes, &bodies, options.margin_m, side_m));
        let cuts = match by_cell {
            Some(_) => Cuts::default(),
            None => near::cut_long(routes, &bodies, options.longest_action_m)?,
        };
        let refined = Refined {
            routes,
            cuts: &cuts,
        };
        let (edges, margin_m) = match by_cell {
            Some(edges) => (edges, options.margin_m),
            None => near::edges(&refined, &bodies, options)?,
        };
        let actions = (0..agents).map(|agent| refined.actions(agent) as u32);
        let graph = Self::assemble(actions.collect(), edges).with(cuts, margin_m);
        rings::resolve(graph, routes, &bodies, options)
    }
}

/// Checks that the geometry of the routes can be computed under the options.
fn check<R: Routes + ?Sized>(routes: &R, options: &GateOptions) -> Result<(), GateError> {
    let positive = |value: Option<f64>| value.is_none_or(|v| v > 0.0 && v.is_finite());
    let margin_m = options.margin_m;
    let values = [
        (
            "margin_m",
            margin_m,
            margin_m >= 0.0 && margin_m.is_finite(),
        ),
        (
            "least_margin_m",
            options.least_margin_m,
            (0.0..=margin_m).contains(&options.least_margin_m),
        ),
        (
            "longest_action_m",
            options.longest_action_m.unwrap_or(0.0),
            positive(options.longest_action_m),
        ),
        (
            "cell_size_m",
            options.cell_size_m.unwrap_or(0.0),
            positive(options.cell_size_m),
        ),
    ];
    for (field, value, is_right) in values {
        if !is_right {
            return Err(GateError::Option { field, value });
        }
    }
    if routes.agents() >= u32::MAX as usize {
        let most = u32::MAX as usize - 1;
        return Err(GateError::TooManyAgents { most });
    }
    for agent in 0..routes.agents() {
        let mut before_s = f64::NEG_INFINITY;
        for knot in 0..=routes.actions(agent) {
            let time_s = routes.time_s(agent, knot);
            if !routes.pose(agent, knot).is_finite() || !time_s.is_finite() {
                return Err(GateError::NotFinite { agent, knot });
            }
            if time_s <= before_s {
                return Err(GateError::BackInTime {
                    agent,
                    knot,
                    time_s,
                });
            }
            before_s = time_s;
        }
    }
    Ok(())
}
