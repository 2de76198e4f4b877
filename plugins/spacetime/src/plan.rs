//! Paths as the planners work on them, and the plans that are made of them.

use fleetyard_abi::GridPlan;

use crate::graph::{Graph, Vertex};

/// Paths over vertices while they are worked on: agent `i` stands at `paths[i][t]` at time `t`
/// and stays at the last vertex for ever after. No path goes on after its last arrival.
pub type Paths = Vec<Vec<Vertex>>;

/// Turns a sequence of configurations, from all starts to all goals, into paths.
pub fn paths_of(configurations: &[&[Vertex]]) -> Paths {
    let Some(last) = configurations.last() else {
        return Paths::new();
    };
    (0..last.len())
        .map(|agent| {
            let goal = last[agent];
            let arrival = configurations
                .iter()
                .rposition(|q| q[agent] != goal)
                .map_or(0, |before| before + 1);
            configurations[..=arrival]
                .iter()
                .map(|q| q[agent])
                .collect()
        })
        .collect()
}

/// Turns paths into a sequence of configurations, first all starts, last all goals.
pub fn configurations_of(paths: &Paths) -> Vec<Box<[Vertex]>> {
    let makespan = paths.iter().map(Vec::len).max().unwrap_or(1);
    (0..makespan)
        .map(|t| {
            paths
                .iter()
                .filter_map(|path| path.get(t).or(path.last()))
                .copied()
                .collect()
        })
        .collect()
}

/// Sum over the agents of the time of last arrival.
pub fn sum_of_costs(paths: &Paths) -> u64 {
    paths.iter().map(|path| path.len() as u64 - 1).sum()
}

/// Translates paths to grid cells.
pub fn plan_of<P: AsRef<[Vertex]>>(paths: impl IntoIterator<Item = P>, graph: &Graph) -> GridPlan {
    let mut plan = GridPlan::default();
    for path in paths {
        plan.push_path(path.as_ref().iter().map(|&v| graph.cell(v)));
    }
    plan
}
