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
    /// The host failed, which says nothing of the plugin.
    Host(Fault),
}

pub(crate) type Step<T> = Result<T, Stop>;

impl Stop {
    /// The outcome of the case with its reason; the fault, if it is the host's.
    pub(crate) fn parts(self) -> Result<(Outcome, String), Fault> {
        match self {
            Self::Failed(reason) => Ok((Outcome::Failed, reason)),
            Self::Crashed(reason) => Ok((Outcome::Crashed, reason)),
            Self::Skipped(reason) => Ok((Outcome::Skipped, reason)),
            Self::Host(fault) => Err(fault),
        }
    }

    /// The same, in a situation that its reason is told with.
    pub(crate) fn told(self, tell: impl FnOnce(String) -> String) -> Self {
        match self {
            Self::Failed(reason) => Self::Failed(tell(reason)),
            Self::Crashed(reason) => Self::Crashed(tell(reason)),
            other @ (Self::Skipped(_) | Self::Host(_)) => other,
        }
    }
}

impl From<Fault> for Stop {
    fn from(fault: Fault) -> Self {
        let reason = fault.to_string();
        match fault {
            fault if fault.is_of_host() => Self::Host(fault),
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_of_the_host_is_no_outcome_of_the_plugin() {
        let fault = Fault::Host {
            reason: "making a process: Resource temporarily unavailable (os error 11)".into(),
        };
        let hint = fault.hint().unwrap_or_default().to_owned();
        assert!(hint.contains("ulimit -u"), "{hint}");
        let stop = Stop::from(fault.clone()).told(|reason| format!("with options it {reason}"));
        assert_eq!(stop.parts(), Err(fault));
        let crash = Fault::Exited {
            code: 3,
            during: "plan".into(),
        };
        let (outcome, reason) = Stop::from(crash)
            .told(|reason| format!("it {reason}"))
            .parts()
            .unwrap();
        assert_eq!(outcome, Outcome::Crashed);
        assert!(reason.starts_with("it exited with code 3"), "{reason}");
    }
}
