//! What a planner is asked, and what is wrong with it if something is.

use thiserror::Error;

use fleetyard_plugin_spacetime::graph::{Graph, Vertex};

/// A one-shot multi-agent path finding problem on a 4-connected grid.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Problem {
    /// Height of the map.
    pub rows: u32,
    /// Width of the map.
    pub cols: u32,
    /// One entry per cell, row by row: `cell = row · cols + col`.
    pub passable: Vec<bool>,
    /// Start cell of each agent, all different.
    pub starts: Vec<u32>,
    /// Goal cell of each agent, all different.
    pub goals: Vec<u32>,
}

/// Why a [`Problem`] is not one that can be planned for.
#[derive(Debug, Clone, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum ProblemError {
    /// `passable` does not have `rows · cols` entries, or that product is too large.
    #[error("a map of {rows} × {cols} cells cannot have {cells} entries")]
    MapSize {
        /// Rows announced.
        rows: u32,
        /// Columns announced.
        cols: u32,
        /// Entries found.
        cells: usize,
    },
    /// Not as many goals as starts.
    #[error("{starts} starts and {goals} goals: each agent needs one of both")]
    TeamSize {
        /// Number of starts.
        starts: usize,
        /// Number of goals.
        goals: usize,
    },
    /// A start or goal off the map or on an obstacle.
    #[error("agent {agent}: {what} cell {cell} is not a passable cell of the map")]
    Blocked {
        /// Agent index.
        agent: usize,
        /// "start" or "goal".
        what: &'static str,
        /// The cell.
        cell: u32,
    },
    /// Two agents share a start, or share a goal.
    #[error("agents {first} and {second} have the same {what} cell {cell}")]
    Duplicate {
        /// The agent with the lower index.
        first: usize,
        /// The other one.
        second: usize,
        /// "start" or "goal".
        what: &'static str,
        /// The cell.
        cell: u32,
    },
    /// No path leads from a start to its goal, or only one longer than supported.
    #[error("agent {agent}: no path of at most {limit} steps from cell {start} to cell {goal}")]
    Unreachable {
        /// Agent index.
        agent: usize,
        /// Start cell.
        start: u32,
        /// Goal cell.
        goal: u32,
        /// Longest supported path.
        limit: u32,
    },
}

impl ProblemError {
    /// What the user can do about it.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::MapSize { .. } => "give one entry per cell, row by row",
            Self::TeamSize { .. } => "give one start and one goal per agent",
            Self::Blocked { .. } => {
                "check that coordinates are not swapped: cell = row · cols + col"
            }
            Self::Duplicate { .. } => "give every agent a start and a goal of its own",
            Self::Unreachable { .. } => {
                "start and goal must lie in the same connected part of the map"
            }
        }
    }
}

/// A checked problem over graph vertices.
#[derive(Debug)]
pub(crate) struct Checked {
    pub(crate) graph: Graph,
    pub(crate) starts: Vec<Vertex>,
    pub(crate) goals: Vec<Vertex>,
}

impl Problem {
    /// Checks everything but reachability.
    pub(crate) fn check(&self) -> Result<Checked, ProblemError> {
        let size = u64::from(self.rows) * u64::from(self.cols);
        if size != self.passable.len() as u64 || size >= u64::from(u32::MAX) {
            let (rows, cols, cells) = (self.rows, self.cols, self.passable.len());
            return Err(ProblemError::MapSize { rows, cols, cells });
        }
        if self.starts.len() != self.goals.len() {
            let (starts, goals) = (self.starts.len(), self.goals.len());
            return Err(ProblemError::TeamSize { starts, goals });
        }
        let graph = Graph::new(self.rows as usize, self.cols as usize, &self.passable);
        let starts = vertices(&graph, &self.starts, "start")?;
        let goals = vertices(&graph, &self.goals, "goal")?;
        Ok(Checked {
            graph,
            starts,
            goals,
        })
    }
}

pub(crate) fn vertices(
    graph: &Graph,
    cells: &[u32],
    what: &'static str,
) -> Result<Vec<Vertex>, ProblemError> {
    let mut owner = vec![None; graph.len()];
    let mut vertices = Vec::with_capacity(cells.len());
    for (agent, &cell) in cells.iter().enumerate() {
        let vertex = graph
            .vertex(cell)
            .ok_or(ProblemError::Blocked { agent, what, cell })?;
        if let Some(first) = owner[vertex as usize].replace(agent) {
            return Err(ProblemError::Duplicate {
                first,
                second: agent,
                what,
                cell,
            });
        }
        vertices.push(vertex);
    }
    Ok(vertices)
}
