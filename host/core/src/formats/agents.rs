//! Starts and goals as files list them, before a map says what they mean.

use std::sync::Arc;

use crate::{Connectivity, Grid, GridInstance, InputError, Scenario, ScenarioEntry};

/// Starts and goals of a file, in its order; not checked against a map.
#[derive(Debug, Clone, PartialEq)]
pub struct AgentList {
    /// The file, for error messages.
    pub source: String,
    /// The map's file as the list names it.
    pub map_file: Option<String>,
    /// One entry per agent.
    pub agents: Vec<AgentEntry>,
}

/// Start and goal of an agent, each as row and column.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AgentEntry {
    /// Line in the file, from 1; 0 if it is from none.
    pub line: u64,
    /// Row and column of the start.
    pub start: (u32, u32),
    /// Row and column of the goal.
    pub goal: (u32, u32),
    /// Length of a shortest path between them, if the list says it; see [`ScenarioEntry`].
    pub length: Option<f64>,
}

impl AgentEntry {
    /// An entry that does not say how long its shortest path is.
    pub fn new(line: u64, start: (u32, u32), goal: (u32, u32)) -> Self {
        Self {
            line,
            start,
            goal,
            length: None,
        }
    }
}

impl AgentList {
    /// The instance of the first `agents` entries, or of all, on `grid`.
    ///
    /// Errors name the entry's line, as those of [`Scenario::instance`] do.
    pub fn instance(
        &self,
        grid: Arc<Grid>,
        agents: Option<usize>,
        connectivity: Connectivity,
    ) -> Result<GridInstance, InputError> {
        let agents = agents.unwrap_or(self.agents.len());
        self.scenario(&grid).instance(grid, agents, connectivity)
    }

    /// Refuses a map of another name than the list's.
    pub fn check_name(&self, grid: &Grid) -> Result<(), InputError> {
        self.scenario(grid).check_name(grid)
    }

    /// The entries of a scenario on a map of the size of `grid`.
    fn scenario(&self, grid: &Grid) -> Scenario {
        let map = self.map_file.as_deref().unwrap_or(grid.name());
        let entries = self.agents.iter().map(|agent| ScenarioEntry {
            line: agent.line,
            bucket: 0,
            map: map.to_owned(),
            map_cols: grid.cols(),
            map_rows: grid.rows(),
            start: agent.start,
            goal: agent.goal,
            optimal_length: 0.0,
        });
        Scenario {
            source: self.source.clone(),
            entries: entries.collect(),
        }
    }
}

impl From<&Scenario> for AgentList {
    fn from(scenario: &Scenario) -> Self {
        let agents = scenario.entries.iter().map(|entry| AgentEntry {
            line: entry.line,
            start: entry.start,
            goal: entry.goal,
            length: Some(entry.optimal_length),
        });
        Self {
            source: scenario.source.clone(),
            map_file: scenario.entries.first().map(|entry| entry.map.clone()),
            agents: agents.collect(),
        }
    }
}
