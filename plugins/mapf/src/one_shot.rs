//! PIBT as a planner of its own: steps are made until everybody has arrived.
//!
//! K. Okumura, M. Machida, X. Défago, Y. Tamura, "Priority inheritance with
//! backtracking for iterative multi-agent path finding", Artificial Intelligence
//! 310 (2022).
//!
//! Not complete: on graphs that are not biconnected, and on grids with parked agents
//! in the way, it may go on for ever, so the number of steps is limited.

use crate::pibt::{OneGoal, Pibt};
use crate::scatter::Guide;
use fleetyard_plugin_spacetime::distance::Distances;
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::random::Random;

/// Runs PIBT; `None` when the limit or `stop` comes first.
pub(crate) fn pibt(
    starts: &[Vertex],
    goals: &[Vertex],
    distances: &mut Distances<'_>,
    (swap, rings): (bool, bool),
    step_limit: u64,
    mut random: Random,
    stop: &mut dyn FnMut() -> bool,
) -> Option<Vec<Box<[Vertex]>>> {
    let guide = Guide::default();
    let mut pibt = Pibt::new(distances.graph(), starts.len(), swap, rings);
    let mut by_distance: Vec<u32> = (0..starts.len() as u32).collect();
    by_distance.sort_by_key(|&a| std::cmp::Reverse(distances.get(a as usize, starts[a as usize])));
    let mut wishes = OneGoal {
        goals,
        distances,
        guide: &guide,
    };
    let mut order = by_distance.clone();
    let mut configurations: Vec<Box<[Vertex]>> = vec![starts.into()];
    let mut now: Box<[Vertex]> = starts.into();
    while *now != *goals {
        if configurations.len() as u64 > step_limit || stop() {
            return None;
        }
        pibt.load(&now, &mut wishes);
        // Without constraints every agent can at least stay or be moved away.
        if !pibt.sample(&order, &[], &mut wishes, &mut random) {
            return None;
        }
        now.copy_from_slice(pibt.step());
        configurations.push(now.clone());
        // Priority grows while an agent is away from its goal and is reset there.
        let resting = |agent: &u32| now[*agent as usize] == goals[*agent as usize];
        order.retain(|agent| !resting(agent));
        order.extend(by_distance.iter().filter(|agent| resting(agent)));
    }
    Some(configurations)
}
