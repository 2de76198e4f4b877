//! Reasons why a run could not be made, as opposed to how it went.

use fleetyard_abi::Capability;
use fleetyard_core::InputError;
use fleetyard_runtime::Fault;
use fleetyard_sim::SimError;

/// The reason why a run could not be made or had to be broken off. Faults of a plugin once the
/// robots drive are no such error: they are among the run's events.
#[derive(Debug, thiserror::Error)]
pub enum FleetError {
    /// A number is out of range.
    #[error("{field} is out of range: {value}")]
    Config {
        /// Its name.
        field: &'static str,
        /// Its value.
        value: f64,
        /// The values that are allowed.
        hint: &'static str,
    },
    /// Something that was read is wrong.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The robots cannot drive so, or the trace cannot be written.
    #[error(transparent)]
    Sim(#[from] SimError),
    /// A plugin did not start.
    #[error("{kind} `{name}` {fault}")]
    Start {
        /// Its kind.
        kind: fleetyard_abi::Kind,
        /// The user's name for it.
        name: String,
        /// The fault.
        fault: Fault,
    },
    /// A plugin does not claim what the run needs.
    #[error("{kind} `{name}` does not support `{}`", missing.as_str())]
    Incapable {
        /// Its kind.
        kind: fleetyard_abi::Kind,
        /// The user's name for it.
        name: String,
        /// The capability that is needed.
        missing: Capability,
        /// A way out.
        hint: String,
    },
    /// The host broke a rule of its own.
    #[error("{0}")]
    Broken(String),
}

impl FleetError {
    /// A way out.
    pub fn hint(&self) -> Option<&str> {
        match self {
            Self::Config { hint, .. } => Some(hint),
            Self::Incapable { hint, .. } => Some(hint),
            Self::Input(error) => error.hint.as_deref(),
            Self::Sim(error) => error.hint(),
            Self::Start { fault, .. } => fault.hint(),
            Self::Broken(_) => None,
        }
    }
}
