//! Budgets of trials, and the execution of their plans. Defaults are those of `fleetyard run`.

use std::time::Duration;

use fleetyard_core::InputError;
use fleetyard_core::document::between;
use fleetyard_runtime::measure::Machine;
use fleetyard_runtime::{Limits, Policy, Trust};
use fleetyard_sim::motion::{FleetError, FleetFile, Model, MotionError};
use fleetyard_sim::{Fleet, Profile, SimConfig};
use fleetyard_world::Footprint;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::quantity::{duration, size};

/// The budget of every call of a trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct BudgetOptions {
    /// Wall clock of a plan.
    #[serde(deserialize_with = "duration")]
    pub wall: Duration,
    /// Wall clock of learning the map; `None` is the plan's.
    #[serde(deserialize_with = "duration")]
    pub prepare: Option<Duration>,
    /// Time in which a planner has to start and be made.
    #[serde(deserialize_with = "duration")]
    pub startup: Duration,
    /// Time for which a planner may go on after the deadline once it was told to stop.
    #[serde(deserialize_with = "duration")]
    pub grace: Option<Duration>,
    /// Processor time of a plan; `None` for no limit.
    #[serde(deserialize_with = "duration")]
    pub cpu: Option<Duration>,
    /// Processor time of learning the map; `None` is the plan's.
    #[serde(deserialize_with = "duration")]
    pub prepare_cpu: Option<Duration>,
    /// Memory of all processes together; `None` is half of the machine's.
    #[serde(rename(deserialize = "memory"), deserialize_with = "size")]
    pub memory_bytes: Option<u64>,
    /// Memory of learning the map; `None` is the plan's.
    #[serde(rename(deserialize = "prepare_memory"), deserialize_with = "size")]
    pub prepare_memory_bytes: Option<u64>,
    /// Most search nodes, for planners that count them; 0 for no limit.
    #[serde(deserialize_with = "between::<1, { u64::MAX }, u64, _, _>")]
    pub nodes: u64,
    /// Most threads that a planner may use.
    #[serde(deserialize_with = "between::<1, 4096, u32, _, _>")]
    pub threads: u32,
}

impl Default for BudgetOptions {
    fn default() -> Self {
        Self {
            wall: Duration::from_secs(10),
            prepare: None,
            startup: Duration::from_mins(1),
            grace: None,
            cpu: None,
            prepare_cpu: None,
            memory_bytes: None,
            prepare_memory_bytes: None,
            nodes: 0,
            threads: 1,
        }
    }
}

impl BudgetOptions {
    /// Memory of a plan in bytes; 0 for no limit.
    pub fn plan_memory(&self) -> u64 {
        self.memory_bytes.unwrap_or_else(half_of_memory)
    }

    /// Memory of learning the map in bytes; 0 for no limit.
    pub fn prepare_memory(&self) -> u64 {
        self.prepare_memory_bytes
            .unwrap_or_else(|| self.plan_memory())
    }

    /// Wall clock of learning the map.
    pub fn prepare_wall(&self) -> Duration {
        self.prepare.unwrap_or(self.wall)
    }
}

/// Half of the machine's memory; 0 where nobody tells how much that is.
pub fn half_of_memory() -> u64 {
    Machine::here().memory_kb.unwrap_or(0) / 2 * 1024
}

/// Grants and limits of a plugin in every call.
#[derive(Debug, Clone)]
pub struct SandboxOptions {
    /// Layers, files, network, environment, processes and disk.
    pub policy: Policy,
    /// Most output that is no message.
    pub output_bytes: u64,
    /// The code that may be started.
    pub trust: Trust,
    /// True if planners have processor cores of their own, where the machine has so many that
    /// nobody else has reserved.
    pub pin: bool,
}

impl Default for SandboxOptions {
    fn default() -> Self {
        Self {
            policy: Policy::default(),
            output_bytes: Limits::default().output_bytes,
            trust: Trust::default(),
            pin: true,
        }
    }
}

/// The robots that execute a plan.
#[derive(Debug, Clone, Default, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Robots {
    /// Points of a radius that follow the plan exactly.
    #[default]
    Pebbles,
    /// One model for everybody, by the name of a model or preset.
    Model(String),
    /// The robots of a fleet file, with the file's name.
    File(String, Box<FleetFile>),
}

/// The reason why there is no such fleet.
#[derive(Debug, thiserror::Error)]
pub enum RobotsError {
    /// No model has this name, or its limits contradict each other.
    #[error("{0}")]
    Model(#[from] MotionError),
    /// The robots make no fleet.
    #[error("{0}")]
    Fleet(#[from] FleetError),
    /// The fleet file does not fit.
    #[error("{0}")]
    File(InputError),
}

impl RobotsError {
    /// A way out.
    pub fn hint(&self) -> Option<&str> {
        match self {
            Self::Model(error) => Some(error.hint),
            Self::Fleet(error) => Some(error.hint()),
            Self::File(error) => error.hint.as_deref(),
        }
    }
}

impl Robots {
    /// The radius of robots whose model has no body of its own, in cells. Smaller than
    /// that of pebbles: with 0.35 a controller has 7 mm to err where a plan turns robots
    /// in a ring.
    pub const DRIVEN_RADIUS_CELLS: f64 = 0.3;

    /// The robots as JSON, without the name of a file: no result depends on where files lie.
    pub(crate) fn said(&self) -> Value {
        match self {
            Self::File(_, file) => json!({ "file": file }),
            other => json!(other),
        }
    }

    /// The fleet of so many agents; pebbles need none.
    pub fn fleet(&self, agents: usize, config: &SimConfig) -> Result<Option<Fleet>, RobotsError> {
        match self {
            Self::Pebbles => Ok(None),
            Self::File(name, file) => match file.fleet(agents) {
                Ok(fleet) => Ok(Some(fleet)),
                Err(error) => Err(RobotsError::File(
                    InputError::new(name.as_str(), error.to_string()).hint(error.hint()),
                )),
            },
            Self::Model(name) => {
                let model: Model = name.parse()?;
                // A preset may have a body of its own; the radius that is asked for goes
                // before.
                let footprint = match (config.radius_m, Profile::preset(name)) {
                    (None, Ok(profile)) => profile.footprint,
                    (radius_m, _) => Footprint::Disc {
                        radius_m: radius_m
                            .unwrap_or(Self::DRIVEN_RADIUS_CELLS * config.cell_size_m),
                    },
                };
                Ok(Some(Fleet::uniform(Profile { footprint, model }, agents)?))
            }
        }
    }
}
