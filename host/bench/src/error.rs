//! Reasons why a suite cannot be run, as opposed to how its trials went.

use fleetyard_core::InputError;

use crate::trial_error::TrialError;

/// The reason why a suite cannot be run or go on.
#[derive(Debug, thiserror::Error)]
pub enum BenchError {
    /// A suite, a file that it names or a store is not what it must be.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A plugin that the suite names is not there, does not start or takes no such options.
    #[error("{at}")]
    Plugin {
        /// The error at its place in the suite.
        at: InputError,
        /// The reason.
        error: Box<TrialError>,
    },
    /// A trial could not be made at all.
    #[error("{planner}: {error}")]
    Trial {
        /// The planner's label.
        planner: String,
        /// The reason.
        error: Box<TrialError>,
    },
    /// The host cannot run plugins here.
    #[error("cannot run plugins: {0}")]
    Host(#[from] std::io::Error),
}

impl BenchError {
    /// A way out.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Input(error) | Self::Plugin { at: error, .. } => error.hint.clone(),
            Self::Trial { error, .. } => error.hint(),
            Self::Host(_) => None,
        }
    }
}
