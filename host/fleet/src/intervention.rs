//! Interventions: what somebody does to a fleet while it drives. They are a part of its recording, so
//! that a replay has them too.

use fleetyard_core::Grid;
use serde::{Deserialize, Serialize};

use crate::FleetConfig;

/// Something that is done to a fleet.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Intervention {
    /// A cell closes once no robot is there or on its way there.
    Close {
        /// The cell.
        cell: u32,
        /// The time for which it is closed, in seconds.
        for_s: f64,
    },
    /// A cell that is closed opens, and one that is to close does not.
    Open {
        /// The cell.
        cell: u32,
    },
    /// A robot is sent nothing more: it stops at the end of what it was sent, and others wait for it.
    Hold {
        /// The robot.
        agent: u32,
        /// The time for which it is held, in seconds.
        for_s: f64,
    },
    /// A robot that is held goes on.
    Release {
        /// The robot.
        agent: u32,
    },
    /// A robot gets one more goal, after those that it has.
    Send {
        /// The robot.
        agent: u32,
        /// The cell of the goal.
        cell: u32,
    },
}

/// An intervention and when it took effect.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Intervened {
    /// The block at whose beginning it did.
    pub block: u64,
    /// The intervention.
    pub what: Intervention,
}

impl Intervention {
    /// Longest time for which something lasts: a year.
    const MOST_S: f64 = 366.0 * 86_400.0;

    /// Says why it cannot be done in a run on a map.
    pub(crate) fn check(self, grid: &Grid, config: &FleetConfig) -> Result<(), String> {
        let agents = config.agents;
        if config.is_synchronous() {
            return Err("by synchronous rules nobody does anything to robots".into());
        }
        let (cell, agent, for_s) = match self {
            Self::Close { cell, for_s } => (Some(cell), None, Some(for_s)),
            Self::Open { cell } => (Some(cell), None, None),
            Self::Hold { agent, for_s } => (None, Some(agent), Some(for_s)),
            Self::Release { agent } => (None, Some(agent), None),
            Self::Send { agent, cell } => (Some(cell), Some(agent), None),
        };
        if matches!(self, Self::Close { .. } | Self::Open { .. }) {
            let closing = config.validate_closing();
            closing.map_err(|error| error.to_string())?;
        }
        if let Some(cell) = cell
            && !(cell < grid.cell_count() && grid.is_passable(cell))
        {
            return Err(format!("{cell} is no free cell of the map"));
        }
        if let Some(agent) = agent.filter(|agent| *agent >= agents) {
            return Err(format!("there is no robot {agent} among {agents}"));
        }
        match for_s {
            Some(for_s) if !(for_s > 0.0 && for_s <= Self::MOST_S) => {
                Err(format!("{for_s} s is no time between nothing and a year"))
            }
            _ => Ok(()),
        }
    }
}
