//! Why an execution was refused or broken off.

use std::io;

/// Why an execution was refused or broken off. Agents and times are counted
/// from 0.
#[derive(Debug, thiserror::Error)]
#[allow(missing_docs, reason = "the messages document the fields")]
#[non_exhaustive]
pub enum SimError {
    #[error("{field} = {value} {reason}")]
    Config {
        field: &'static str,
        value: String,
        reason: &'static str,
        hint: &'static str,
    },
    #[error("the plan has no agents")]
    NoAgents,
    #[error("the plan has {agents} agents, more than the {most} that can be simulated")]
    TooManyAgents { agents: usize, most: usize },
    #[error("the path of agent {agent} is empty")]
    EmptyPath { agent: usize },
    #[error("agent {agent} is outside the map at time {time}")]
    OffMap { agent: usize, time: usize },
    #[error("the execution would take {ticks:e} ticks, more than the {most:e} that can be counted")]
    TooLong { ticks: f64, most: f64 },
    #[error("more than {most} pairs of agents are near each other at {time_s} s")]
    TooDense { most: usize, time_s: f64 },
    #[error("the trace could not be written")]
    Trace(#[from] io::Error),
}

impl SimError {
    /// What the user can do.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::Config { hint, .. } => Some(hint),
            Self::NoAgents => Some("an instance has at least one agent"),
            Self::TooManyAgents { .. } => Some("split the plan"),
            Self::EmptyPath { .. } => {
                Some("an agent that never moves has a path of one cell: its start")
            }
            Self::OffMap { .. } => {
                Some("validate the plan against its instance first; cells are row * width + column")
            }
            Self::TooLong { .. } => Some("shorten the plan, or lower step_s or ticks_hz"),
            Self::TooDense { .. } => Some(
                "validate the plan first; if it is meant, raise max_pairs or lower approach_range_cells",
            ),
            Self::Trace(_) => {
                Some("check the free space and the permissions of the trace file's folder")
            }
        }
    }
}
