//! The plugin that is checked, and the time that it has.

use std::time::Duration;

use fleetyard_abi::Descriptor;
use fleetyard_runtime::{Attach, Limits, PluginFile};
use serde_json::{Map, Value};

/// Time limits of plugins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// For one call. A planner that claims `anytime` gets a tenth of it, since it
    /// takes all that it gets; so does whoever is asked what cannot be solved.
    pub budget: Duration,
    /// For returning after the deadline.
    pub grace: Duration,
    /// For starting and introducing itself.
    pub startup: Duration,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            budget: Duration::from_secs(5),
            grace: Duration::from_secs(2),
            startup: Duration::from_mins(1),
        }
    }
}

impl Config {
    /// The part of the budget for those who take all of it.
    pub(crate) fn slice(&self) -> Duration {
        (self.budget / 10).max(Duration::from_millis(10))
    }

    /// Time that a plugin may take to end.
    pub(crate) fn ending(&self) -> Duration {
        self.grace.max(Limits::default().ending)
    }
}

/// One plugin, and how it is attached and made.
#[derive(Debug, Clone)]
pub struct Subject {
    /// The file that has it.
    pub file: PluginFile,
    /// The way of attaching it.
    pub attach: Attach,
    /// Its descriptor.
    pub descriptor: Descriptor,
    /// Options that it gets in every case.
    pub options: Map<String, Value>,
}
