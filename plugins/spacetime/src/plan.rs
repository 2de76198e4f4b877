//! Plans as the planners give them out, and their costs.

use crate::graph::{Graph, Vertex};

/// One path per agent, flat: agent `i` stands at `path(i)[t]` at time `t` and stays at
/// the last cell, its goal, for ever after. No path goes on after its last arrival.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plan {
    offsets: Vec<usize>,
    cells: Vec<u32>,
}

impl Plan {
    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.offsets.len() - 1
    }

    /// The cells of one agent, from its start at time zero to its arrival.
    pub fn path(&self, agent: usize) -> &[u32] {
        &self.cells[self.offsets[agent]..self.offsets[agent + 1]]
    }

    /// All paths in agent order.
    pub fn paths(&self) -> impl Iterator<Item = &[u32]> + '_ {
        self.offsets.windows(2).map(|w| &self.cells[w[0]..w[1]])
    }

    /// Index in [`Plan::cells`] at which each path begins; one entry more than agents.
    pub fn offsets(&self) -> &[usize] {
        &self.offsets
    }

    /// The cells of all paths, one after the other.
    pub fn cells(&self) -> &[u32] {
        &self.cells
    }

    /// Sum over the agents of the time of last arrival.
    pub fn sum_of_costs(&self) -> u64 {
        (self.cells.len() - self.agents()) as u64
    }

    /// The time when the last agent arrives.
    pub fn makespan(&self) -> u64 {
        self.paths().map(|p| p.len() as u64 - 1).max().unwrap_or(0)
    }
}

/// Paths over vertices while they are worked on. Same convention as [`Plan`].
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
pub fn plan_of(paths: &Paths, graph: &Graph) -> Plan {
    let mut offsets = Vec::with_capacity(paths.len() + 1);
    let mut cells = Vec::with_capacity(paths.iter().map(Vec::len).sum());
    offsets.push(0);
    for path in paths {
        cells.extend(path.iter().map(|&v| graph.cell(v)));
        offsets.push(cells.len());
    }
    Plan { offsets, cells }
}
