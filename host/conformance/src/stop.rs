//! Ends of cases before their last step.

use fleetyard_core::InputError;
use fleetyard_runtime::Fault;

use crate::report::Outcome;

/// The reason why a case goes no further.
#[derive(Debug)]
pub(crate) enum Stop {
    Failed(String),
    Crashed(String),
    Skipped(String),
}

pub(crate) type Step<T> = Result<T, Stop>;

impl Stop {
    pub(crate) fn parts(self) -> (Outcome, String) {
        match self {
            Self::Failed(reason) => (Outcome::Failed, reason),
            Self::Crashed(reason) => (Outcome::Crashed, reason),
            Self::Skipped(reason) => (Outcome::Skipped, reason),
        }
    }
}

impl From<Fault> for Stop {
    fn from(fault: Fault) -> Self {
        let reason = fault.to_string();
        match fault {
            Fault::Crashed { .. } | Fault::Exited { .. } => Self::Crashed(reason),
            _ => Self::Failed(reason),
        }
    }
}

impl From<InputError> for Stop {
    fn from(error: InputError) -> Self {
        Self::Failed(format!("the kit could not make its instance: {error}"))
    }
}
