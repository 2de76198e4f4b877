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

/// The goals of discs with what is known of the ways there; none when it is told to stop. What is known by then is there for the
/// next call.
pub fn rests(
    closeness: &Closeness,
    known: &mut Known,
    (discs, until): (&[Disc], f64),
    stop: &mut dyn FnMut() -> bool,
) -> Option<Vec<Rest>> {
    let stays = until == f64::INFINITY;
    let mut rests = Vec::with_capacity(discs.len());
    for disc in discs {
        if stop() {
            return None;
        }
        rests.push(Rest::to(closeness.roadmap(), &disc.goals, stays, known));
    }
    Some(rests)
}

/// The questions for discs with these goals, up to the time `until`.
pub fn tasks<'a>((discs, until): (&[Disc], f64), rests: &'a [Rest]) -> Vec<Task<'a>> {
    let each = discs.iter().zip(rests);
    each.map(|(disc, rest)| Task {
        start: disc.start,
        direction: disc.direction,
        rest,
        until,
    })
    .collect()
}

/// Plans for discs up to the time `until`, after which they may be in each other's way; infinite for whole paths. At most `limit`
/// orders are tried.
pub fn plan(
    closeness: &Closeness,
    known: &mut Known,
    team: (&[Disc], f64),
    limit: u64,
    seed: u64,
    stop: &mut dyn FnMut() -> bool,
) -> Outcome {
    let Some(rests) = rests(closeness, known, team, stop) else {
        return Outcome {
            end: End::Stopped,
            orders: 0,
            expanded: 0,
        };
    };
    let mut search = Search::new(closeness.roadmap());
    let tasks = tasks(team, &rests);
    let (end, orders) = in_orders(closeness, &tasks, (limit, seed), &mut search, stop);
    Outcome {
        end,
        orders,
        expanded: search.expanded,
    }
}

/// Plans in at most `limit` orders, the longest way first, and says how many were tried.
pub fn in_orders(
    closeness: &Closeness,
    tasks: &[Task<'_>],
    (limit, seed): (u64, u64),
    search: &mut Search,
    stop: &mut dyn FnMut() -> bool,
) -> (End<Vec<Path>>, u64) {
    let roadmap = closeness.roadmap();
    let ways: Vec<f64> = tasks.iter().map(|task| task.alone(roadmap)).collect();
    let mut taken = Reservations::new(closeness);
    for task in tasks {
        taken.hold(closeness, task.start, task.least_stay(roadmap));
    }
    try_orders(longest_first(&ways), limit, seed, |order| {
        taken.clear();
        let mut paths = vec![Path::new(); tasks.len()];
        for (place, agent) in order.iter().map(|agent| *agent as usize).enumerate() {
            taken.release(agent);
            match search.find(roadmap, &taken, &tasks[agent], stop) {
                Found::Path(path) => {
                    taken.reserve(closeness, &path, tasks[agent].until);
                    paths[agent] = path;
                }
                Found::None => return Attempt::Blocked(place),
                Found::Stopped => return Attempt::Stopped,
            }
        }
        Attempt::Solved(paths)
    })
}

/// Sum of the times at which paths arrive.
pub fn sum_of_costs(paths: &[Path]) -> f64 {
    paths.iter().map(|path| cost(path)).sum()
}
