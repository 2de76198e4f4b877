//! Instances: who starts where and must go where, on which map.

use std::sync::Arc;

use crate::{Connectivity, Digest, Grid, Hasher};

/// The reason why starts and goals do not make an instance. Agents are counted from 0.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum InstanceError {
    #[error("{starts} starts but {goals} goals")]
    LengthMismatch { starts: usize, goals: usize },
    #[error("there are no agents")]
    NoAgents,
    #[error("the {what} of agent {agent} is cell {cell}, but the map has {cells} cells")]
    OutOfBounds {
        what: &'static str,
        agent: usize,
        cell: u32,
        cells: u32,
    },
    #[error("the {what} of agent {agent} at row {row}, column {col} is on an obstacle")]
    Blocked {
        what: &'static str,
        agent: usize,
        row: u32,
        col: u32,
    },
    #[error("agents {first} and {agent} have the same {what} at row {row}, column {col}")]
    Duplicate {
        what: &'static str,
        first: usize,
        agent: usize,
        row: u32,
        col: u32,
    },
    #[error("agent {agent} cannot reach its goal: start and goal are in separate parts of the map")]
    Unreachable { agent: usize },
}

impl InstanceError {
    /// The agent at fault, if one is.
    pub fn agent(&self) -> Option<usize> {
        match self {
            Self::LengthMismatch { .. } | Self::NoAgents => None,
            Self::OutOfBounds { agent, .. }
            | Self::Blocked { agent, .. }
            | Self::Duplicate { agent, .. }
            | Self::Unreachable { agent } => Some(*agent),
        }
    }
}

/// A one-shot multi-agent path finding instance on a grid.
///
/// Invariants: at least one agent; starts are distinct, goals are distinct, all
/// are passable, and every agent can reach its goal.
#[derive(Debug, Clone)]
pub struct GridInstance {
    grid: Arc<Grid>,
    connectivity: Connectivity,
    starts: Vec<u32>,
    goals: Vec<u32>,
}

impl GridInstance {
    /// Checks the invariants and builds the instance.
    pub fn new(
        grid: Arc<Grid>,
        connectivity: Connectivity,
        starts: Vec<u32>,
        goals: Vec<u32>,
    ) -> Result<Self, InstanceError> {
        if starts.len() != goals.len() {
            let (starts, goals) = (starts.len(), goals.len());
            return Err(InstanceError::LengthMismatch { starts, goals });
        }
        if starts.is_empty() {
            return Err(InstanceError::NoAgents);
        }
        for (what, cells) in [("start", &starts), ("goal", &goals)] {
            check_cells(&grid, what, cells)?;
        }
        if let Some(agent) = grid.first_cut_off(&starts, &goals, connectivity) {
            return Err(InstanceError::Unreachable { agent });
        }
        Ok(Self {
            grid,
            connectivity,
            starts,
            goals,
        })
    }

    /// The map.
    pub fn grid(&self) -> &Arc<Grid> {
        &self.grid
    }

    /// The moves that are allowed.
    pub fn connectivity(&self) -> Connectivity {
        self.connectivity
    }

    /// Start cell of every agent.
    pub fn starts(&self) -> &[u32] {
        &self.starts
    }

    /// Goal cell of every agent.
    pub fn goals(&self) -> &[u32] {
        &self.goals
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.starts.len()
    }

    /// Digest of map, moves, starts and goals.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("fleetyard.grid-instance/1");
        let map = self.grid.digest().0;
        hasher.u64(map as u64);
        hasher.u64((map >> 64) as u64);
        hasher.u64(u64::from(self.connectivity.degree()));
        hasher.u32s(&self.starts);
        hasher.u32s(&self.goals);
        hasher.finish()
    }
}

fn check_cells(grid: &Grid, what: &'static str, cells: &[u32]) -> Result<(), InstanceError> {
    let mut owner = vec![u32::MAX; grid.cell_count() as usize];
    for (agent, cell) in cells.iter().copied().enumerate() {
        if cell >= grid.cell_count() {
            return Err(InstanceError::OutOfBounds {
                what,
                agent,
                cell,
                cells: grid.cell_count(),
            });
        }
        let (row, col) = grid.row_col(cell);
        if !grid.is_passable(cell) {
            return Err(InstanceError::Blocked {
                what,
                agent,
                row,
                col,
            });
        }
        let first = std::mem::replace(&mut owner[cell as usize], agent as u32);
        if first != u32::MAX {
            let first = first as usize;
            return Err(InstanceError::Duplicate {
                what,
                first,
                agent,
                row,
                col,
            });
        }
    }
    Ok(())
}
