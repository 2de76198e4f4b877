//! Prioritised planning on roadmaps: one disc after the other, each by SIPP among the paths of those before it.
//!
//! K. Kasaura, M. Nishimura, R. Yonetani, "Prioritized safe interval path planning for multi-agent pathfinding with continuous
//! time on 2D roadmaps", RA-L 7(4), 2022. An order in which somebody finds no path is given up, and the next one begins with
//! who found none; orders that come again are shuffled.

use std::collections::HashSet;

use fleetyard_plugin_spacetime::random::Random;

use crate::closeness::Closeness;
use crate::plan::{Path, cost};
use crate::reservation::Reservations;
use crate::roadmap::Vertex;
use crate::sipp::{Found, Search};

/// Shuffles after which a small team is taken to have no order that was not tried.
const SHUFFLES: u32 = 64;

/// How prioritised planning ended.
#[derive(Debug, Clone, PartialEq)]
pub enum End {
    /// Everybody has a path.
    Solved(Vec<Path>),
    /// No order that was tried gives everybody a path.
    GaveUp,
    /// It was told to stop.
    Stopped,
}

/// What prioritised planning did.
#[derive(Debug, Clone, PartialEq)]
pub struct Outcome {
    /// Its end.
    pub end: End,
    /// Orders that were tried.
    pub orders: u64,
    /// States that searches expanded.
    pub expanded: u64,
}

/// Plans for discs with these starts and goals; who has the longest way is first. At most `orders` orders are tried.
pub fn plan(
    closeness: &Closeness<'_>,
    tasks: &[(Vertex, Vertex)],
    orders: u64,
    seed: u64,
    stop: &mut dyn FnMut() -> bool,
) -> Outcome {
    let roadmap = closeness.roadmap();
    let rests: Vec<Vec<f64>> = tasks.iter().map(|task| roadmap.times_to(task.1)).collect();
    let mut order: Vec<u32> = (0..tasks.len() as u32).collect();
    let way = |agent: &u32| rests[*agent as usize][tasks[*agent as usize].0 as usize];
    order.sort_by(|a, b| way(b).total_cmp(&way(a)));
    let mut taken = Reservations::new(closeness);
    let mut search = Search::new(roadmap);
    let mut random = Random::new(seed, 0);
    let mut tried = HashSet::new();
    for number in 1..=orders {
        let mut shuffles = 0;
        while !tried.insert(order.clone()) {
            if shuffles == SHUFFLES {
                return Outcome {
                    end: End::GaveUp,
                    orders: number - 1,
                    expanded: search.expanded,
                };
            }
            random.shuffle(&mut order);
            shuffles += 1;
        }
        let attempt = attempt(
            closeness,
            tasks,
            &rests,
            &order,
            &mut taken,
            &mut search,
            stop,
        );
        let end = match attempt {
            Attempt::Solved(paths) => End::Solved(paths),
            Attempt::Stopped => End::Stopped,
            Attempt::NoPath(place) => {
                order[..=place].rotate_right(1);
                continue;
            }
        };
        return Outcome {
            end,
            orders: number,
            expanded: search.expanded,
        };
    }
    Outcome {
        end: End::GaveUp,
        orders,
        expanded: search.expanded,
    }
}

enum Attempt {
    Solved(Vec<Path>),
    /// Who is at this place of the order finds no path.
    NoPath(usize),
    Stopped,
}

fn attempt(
    closeness: &Closeness<'_>,
    tasks: &[(Vertex, Vertex)],
    rests: &[Vec<f64>],
    order: &[u32],
    taken: &mut Reservations,
    search: &mut Search,
    stop: &mut dyn FnMut() -> bool,
) -> Attempt {
    taken.clear();
    let mut paths = vec![Path::new(); tasks.len()];
    for (place, agent) in order.iter().map(|agent| *agent as usize).enumerate() {
        match search.find(
            closeness.roadmap(),
            taken,
            tasks[agent],
            &rests[agent],
            stop,
        ) {
            Found::Path(path) => {
                taken.reserve(closeness, &path);
                paths[agent] = path;
            }
            Found::None => return Attempt::NoPath(place),
            Found::Stopped => return Attempt::Stopped,
        }
    }
    Attempt::Solved(paths)
}

/// Sum of the times at which paths arrive.
pub fn sum_of_costs(paths: &[Path]) -> f64 {
    paths.iter().map(|path| cost(path)).sum()
}
