//! The places that a plan keeps for its robots in a window of time: cells of a grid; vertices and edges
//! of a roadmap. Plans in the plane keep none.

use fleetyard_core::{Grid, GridPlan, RoadmapPlan, cell_center_m};
use fleetyard_views::{GridView, Problem, Representation, RoadmapView};
use serde::Serialize;

use crate::answer::{Refused, Result};
use crate::artefacts::KeptPlan;
use crate::recordings::Span;

/// Most places in an answer.
const MOST_HELD: usize = 20_000;

/// The places that a plan keeps for its robots in a window.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub(crate) struct Reservations {
    /// The view of the plan.
    view: Representation,
    /// The side of a cell in metres; absent on a roadmap.
    #[serde(skip_serializing_if = "Option::is_none")]
    side_m: Option<f64>,
    /// The places in the order of the robots, and of a robot in the order of times.
    held: Vec<Held>,
    /// False if there are more of them, of robots with higher numbers.
    complete: bool,
}

/// Agent, seconds from and to within the window, and the place: x and y of a cell's middle or a vertex,
/// of both ends of an edge.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(untagged)]
enum Held {
    Place(u32, f64, f64, f64, f64),
    Edge(u32, f64, f64, f64, f64, f64, f64),
}

/// The reservations of a plan that was made for a problem.
pub(crate) fn reservations(plan: &KeptPlan, problem: &Problem, span: Span) -> Result<Reservations> {
    let span = span.checked()?;
    Ok(match plan {
        KeptPlan::Grid { plan, view } => on_grid(plan, view, view.step_s(problem), span),
        KeptPlan::Roadmap { plan, view } => on_roadmap(plan, view, span),
        KeptPlan::Continuous(_) => {
            return Err(Refused::value("a plan in the plane reserves no places")
                .hint("see where its robots are in a recording"));
        }
    })
}

/// A cell is kept from the step in which its robot sets out for it to the one in which it leaves.
fn on_grid(plan: &GridPlan, view: &GridView, step_s: f64, span: Span) -> Reservations {
    let grid: &Grid = view.instance.grid();
    let mut held = Vec::new();
    // Before the window begins a robot sets out for where it is then; `as` keeps numbers in their range.
    let first = (span.from_s / step_s).floor() as usize;
    'agents: for (agent, path) in plan.paths().enumerate() {
        let Some(last) = path.len().checked_sub(1) else {
            continue;
        };
        let mut step = first.min(last);
        loop {
            let cell = path[step];
            let stays = path[step..].iter().take_while(|other| **other == cell);
            // It leaves in the step that begins at the last one of its stay.
            let most = ((span.to_s / step_s).ceil() as usize).saturating_sub(step) + 2;
            let until = step + stays.take(most).count() - 1;
            let from_s = step.saturating_sub(1) as f64 * step_s;
            let to_s = match until {
                until if until == last => f64::INFINITY,
                until => (until + 1) as f64 * step_s,
            };
            if from_s > span.to_s {
                break;
            }
            if held.len() == MOST_HELD {
                break 'agents;
            }
            let (x, y) = cell_center_m(grid, view.cell_m, cell);
            let at = [view.corner_m[0] + x, view.corner_m[1] + y];
            let [from_s, to_s] = [from_s, to_s].map(|time_s| time_s.clamp(span.from_s, span.to_s));
            held.push(Held::Place(agent as u32, from_s, to_s, at[0], at[1]));
            if until >= last {
                break;
            }
            step = until + 1;
        }
    }
    Reservations {
        view: Representation::Grid,
        side_m: Some(view.cell_m),
        complete: held.len() < MOST_HELD,
        held,
    }
}

/// A vertex is kept while its robot is there, an edge while it drives there.
fn on_roadmap(plan: &RoadmapPlan, view: &RoadmapView, span: Span) -> Reservations {
    let mut held = Vec::new();
    let overlaps = |from_s: f64, to_s: f64| from_s <= span.to_s && to_s >= span.from_s;
    let within = |time_s: f64| time_s.clamp(span.from_s, span.to_s);
    'agents: for (agent, path) in plan.paths().enumerate() {
        let agent = agent as u32;
        let place = |vertex: u32| view.roadmap.position_m(vertex);
        // The vertex before the window may be the beginning of an edge in it.
        let first = path.partition_point(|visit| visit.departure_s < span.from_s);
        let visits = path.iter().enumerate().skip(first.saturating_sub(1));
        for (at, visit) in visits {
            if visit.arrival_s > span.to_s {
                break;
            }
            if held.len() + 2 > MOST_HELD {
                break 'agents;
            }
            let next = path.get(at + 1);
            let leaves_s = next.map_or(f64::INFINITY, |_| visit.departure_s);
            let (x, y) = place(visit.vertex);
            if overlaps(visit.arrival_s, leaves_s) {
                let [from_s, to_s] = [visit.arrival_s, leaves_s].map(within);
                held.push(Held::Place(agent, from_s, to_s, x, y));
            }
            let Some(next) = next else { continue };
            if overlaps(visit.departure_s, next.arrival_s) {
                let [from_s, to_s] = [visit.departure_s, next.arrival_s].map(within);
                let (to_x, to_y) = place(next.vertex);
                held.push(Held::Edge(agent, from_s, to_s, x, y, to_x, to_y));
            }
        }
    }
    Reservations {
        view: Representation::Roadmap,
        side_m: None,
        complete: held.len() + 2 <= MOST_HELD,
        held,
    }
}
