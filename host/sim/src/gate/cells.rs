//! Dependencies by cell, for bodies that fit their cells.
//!
//! A disc with 2·radius + margin ≤ cell side that moves between centres of neighbouring
//! cells stays half a margin inside the two cells. So two moves conflict exactly if they
//! share a cell, and each visitor of a cell only waits until the previous visitor has
//! left (Hönig et al. 2016, 2019).

use super::graph::{Edge, Wait};
use super::meet::Bodies;
use super::routes::Routes;

/// An agent's stay in a cell, from the action that enters it to the one that leaves it.
#[derive(Debug, Clone, Copy)]
struct Visit {
    row: i32,
    col: i32,
    /// Arrival of the agent; 0 if it starts there.
    arrives_s: f64,
    agent: u32,
    /// The entering action, 0 if the agent starts here, and the leaving action, one more
    /// than the agent has if it stays.
    enters: u32,
    leaves: u32,
}

/// The dependencies, or `None` if the routes are not of this kind, or if two agents are
/// in a cell at the same time: the search by distance then reports the fault.
pub(super) fn edges<R: Routes + ?Sized>(
    routes: &R,
    bodies: &Bodies<'_>,
    margin_m: f64,
    cell_size_m: f64,
) -> Option<Vec<Edge>> {
    let agents = routes.agents();
    let fits = |agent: u32| {
        let shape = bodies.shape(agent);
        let width = 2.0 * shape.effective_radius_m() + margin_m;
        shape.is_disc() && width <= cell_size_m * (1.0 + ROUNDING)
    };
    if !(0..agents as u32).all(fits) {
        return None;
    }
    let mut visits = Vec::new();
    for agent in 0..agents {
        let cell = |knot: usize| {
            let pose = routes.pose(agent, knot);
            index(pose.x / cell_size_m).zip(index(pose.y / cell_size_m))
        };
        let actions = routes.actions(agent);
        let mut here = cell(0)?;
        let mut visit = Visit {
            row: here.1,
            col: here.0,
            arrives_s: 0.0,
            agent: agent as u32,
            enters: 0,
            leaves: 0,
        };
        for action in 1..=actions {
            let there = cell(action)?;
            if there == here {
                continue;
            }
            if here.0.abs_diff(there.0) + here.1.abs_diff(there.1) != 1 {
                return None;
            }
            visit.leaves = action as u32;
            visits.push(visit);
            visit = Visit {
                row: there.1,
                col: there.0,
                arrives_s: routes.time_s(agent, action),
                enters: action as u32,
                ..visit
            };
            here = there;
        }
        visit.leaves = actions as u32 + 1;
        visits.push(visit);
    }
    visits.sort_unstable_by(|a, b| {
        let by_cell = (a.row, a.col).cmp(&(b.row, b.col));
        by_cell
            .then(a.arrives_s.total_cmp(&b.arrives_s))
            .then(a.agent.cmp(&b.agent))
    });
    let mut edges = Vec::with_capacity(visits.len());
    for pair in visits.windows(2) {
        let (before, after) = (pair[0], pair[1]);
        if (before.row, before.col) != (after.row, after.col) || before.agent == after.agent {
            continue;
        }
        let stays = before.leaves as usize > routes.actions(before.agent as usize);
        // With ends that never descend along a dependency, all moves of a cycle end
        // together. The search for rings relies on that.
        if stays
            || after.enters == 0
            || routes.time_s(before.agent as usize, before.leaves as usize) > after.arrives_s
        {
            return None;
        }
        edges.push(Edge {
            agent: after.agent,
            wait: Wait {
                action: after.enters,
                other: before.agent,
                knot: before.leaves,
            },
        });
    }
    Some(edges)
}

/// Largest rounding error of a centre, in cell sides.
const ROUNDING: f64 = 1e-9;

/// Index of the cell with its centre at a coordinate, in cell sides.
fn index(coordinate: f64) -> Option<i32> {
    let number = coordinate.floor();
    let is_centre = (coordinate - number - 0.5).abs() <= ROUNDING * coordinate.abs().max(1.0);
    (is_centre && number.abs() < f64::from(i32::MAX)).then_some(number as i32)
}
