//! Prioritised planning on roadmaps: one disc after the other, each by SIPP among the paths of those before it.
//!
//! K. Kasaura, M. Nishimura, R. Yonetani, "Prioritized safe interval path planning for multi-agent pathfinding with continuous
//! time on 2D roadmaps", RA-L 7(4), 2022.

use fleetyard_plugin_plane::orders::{Attempt, End, longest_first, try_orders};

use crate::closeness::Closeness;
use crate::plan::{Path, cost};
use crate::reservation::Reservations;
use crate::roadmap::Vertex;
use crate::sipp::{Found, Search};

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

/// Plans for discs with these starts and goals. At most `limit` orders are tried.
pub fn plan(
    closeness: &Closeness<'_>,
    tasks: &[(Vertex, Vertex)],
    limit: u64,
    seed: u64,
    stop: &mut dyn FnMut() -> bool,
) -> Outcome {
    let roadmap = closeness.roadmap();
    let rests: Vec<Vec<f64>> = tasks.iter().map(|task| roadmap.times_to(task.1)).collect();
    let ways: Vec<f64> = rests
        .iter()
        .zip(tasks)
        .map(|(rest, task)| rest[task.0 as usize])
        .collect();
    let (mut taken, mut search) = (Reservations::new(closeness), Search::new(roadmap));
    let (end, orders) = try_orders(longest_first(&ways), limit, seed, |order| {
        taken.clear();
        let mut paths = vec![Path::new(); tasks.len()];
        for (place, agent) in order.iter().map(|agent| *agent as usize).enumerate() {
            match search.find(roadmap, &taken, tasks[agent], &rests[agent], stop) {
                Found::Path(path) => {
                    taken.reserve(closeness, &path);
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
