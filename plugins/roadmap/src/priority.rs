//! Prioritised planning on roadmaps: one disc after the other, each by SIPP among the paths of those before it.
//!
//! K. Kasaura, M. Nishimura, R. Yonetani, "Prioritized safe interval path planning for multi-agent pathfinding with continuous
//! time on 2D roadmaps", RA-L 7(4), 2022.

use fleetyard_plugin_plane::orders::{Attempt, End, longest_first, try_orders};

use crate::closeness::Closeness;
use crate::plan::{Path, cost};
use crate::reservation::Reservations;
use crate::rest::{Known, Rest};
use crate::roadmap::Vertex;
use crate::sipp::{Found, Search, Task};

/// Start and goals of a disc.
#[derive(Debug, Clone, PartialEq)]
pub struct Disc {
    /// The start.
    pub start: Vertex,
    /// The direction in which it looks there, in radians; none where that does not matter.
    pub direction: Option<f64>,
    /// The goals, met in order.
    pub goals: Vec<Vertex>,
}

/// Result of prioritised planning, and its work.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// A path for everybody, if an order gives them.
    pub end: End<Vec<Path>>,
    /// Orders that were tried.
    pub orders: u64,
    /// States that searches expanded.
    pub expanded: u64,
}

/// Plans for discs up to the time `until`, after which they may be in each other's way; infinite for whole paths. At most `limit`
/// orders are tried.
pub fn plan(
    closeness: &Closeness,
    known: &mut Known,
    (discs, until): (&[Disc], f64),
    limit: u64,
    seed: u64,
    stop: &mut dyn FnMut() -> bool,
) -> Outcome {
    let roadmap = closeness.roadmap();
    let mut rests = Vec::with_capacity(discs.len());
    for disc in discs {
        // What is known by then is there for the next call.
        if stop() {
            return Outcome {
                end: End::Stopped,
                orders: 0,
                expanded: 0,
            };
        }
        let stays = until == f64::INFINITY;
        rests.push(Rest::to(roadmap, &disc.goals, stays, known));
    }
    let tasks: Vec<Task<'_>> = discs
        .iter()
        .zip(&rests)
        .map(|(disc, rest)| Task {
            start: disc.start,
            direction: disc.direction,
            rest,
            until,
        })
        .collect();
    let way = |task: &Task<'_>| {
        let met = task.rest.met(0, task.start);
        task.rest.from(roadmap, met, task.start, |_| 0.0)
    };
    let ways: Vec<f64> = tasks.iter().map(way).collect();
    let (mut taken, mut search) = (Reservations::new(closeness), Search::new(roadmap));
    for task in &tasks {
        taken.hold(closeness, task.start, task.least_stay(roadmap));
    }
    let (end, orders) = try_orders(longest_first(&ways), limit, seed, |order| {
        taken.clear();
        let mut paths = vec![Path::new(); tasks.len()];
        for (place, agent) in order.iter().map(|agent| *agent as usize).enumerate() {
            taken.release(agent);
            match search.find(roadmap, &taken, &tasks[agent], stop) {
                Found::Path(path) => {
                    taken.reserve(closeness, &path, until);
                    paths[agent] = path;
                }
                Found::None => return Attempt::Blocked(place),
                Found::Stopped => return Attempt::Stopped,
            }
        }
        Attempt::Solved(paths)
    });
    Outcome {
        end,
        orders,
        expanded: search.expanded,
    }
}

/// Sum of the times at which paths arrive.
pub fn sum_of_costs(paths: &[Path]) -> f64 {
    paths.iter().map(|path| cost(path)).sum()
}
