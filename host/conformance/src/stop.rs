//! Ends of cases before their last step.

use fleetyard_core::InputError;
use fleetyard_runtime::Fault;

use crate::report::Outcome;

/// A fault of a plugin: its kind in a few words, which is the same wherever the plugin fails in the same
/// way, and the reason for people.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Failure {
    pub(crate) kind: String,
    pub(crate) reason: String,
}

impl Failure {
    pub(crate) fn new(kind: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            kind: kind.into(),
            reason: reason.into(),
        }
    }

    /// The same, in a situation that its reason is told with.
    pub(crate) fn told(self, tell: impl FnOnce(String) -> String) -> Self {
        Self {
            reason: tell(self.reason),
            ..self
        }
    }
}

/// A promise that only the reason names.
impl From<String> for Failure {
    fn from(reason: String) -> Self {
        Self::new("broken-promise", reason)
    }
}

impl From<&str> for Failure {
    fn from(reason: &str) -> Self {
        Self::from(reason.to_owned())
    }
}

/// The reason why a case goes no further.
#[derive(Debug)]
pub(crate) enum Stop {
    Failed(Failure),
    Crashed(Failure),
    Skipped(String),
    /// The host failed, which says nothing of the plugin.
    Host(Fault),
}

pub(crate) type Step<T> = Result<T, Stop>;

impl Stop {
    /// A failure of a case.
    pub(crate) fn failed(failure: impl Into<Failure>) -> Self {
        Self::Failed(failure.into())
    }

    /// The outcome of the case with its reason; the fault, if it is the host's.
    pub(crate) fn parts(self) -> Result<(Outcome, String), Fault> {
        match self {
            Self::Failed(failure) => Ok((Outcome::Failed, failure.reason)),
            Self::Crashed(failure) => Ok((Outcome::Crashed, failure.reason)),
            Self::Skipped(reason) => Ok((Outcome::Skipped, reason)),
            Self::Host(fault) => Err(fault),
        }
    }

    /// The same, in a situation that its reason is told with.
    pub(crate) fn told(self, tell: impl FnOnce(String) -> String) -> Self {
        match self {
            Self::Failed(failure) => Self::Failed(failure.told(tell)),
            Self::Crashed(failure) => Self::Crashed(failure.told(tell)),
            other @ (Self::Skipped(_) | Self::Host(_)) => other,
        }
    }
}

impl From<Fault> for Stop {
    fn from(fault: Fault) -> Self {
        if fault.is_of_host() {
            return Self::Host(fault);
        }
        let kind = match &fault {
            Fault::Crashed { signal, during } => format!("crash signal {signal} {during}"),
            Fault::Exited { code, during } => format!("crash exit {code} {during}"),
            Fault::TimedOut { during, .. } => format!("hang {during}"),
            Fault::OverLimit { during, limit, .. } => format!("over-limit {limit} {during}"),
            Fault::Protocol { during, .. } => format!("broken-protocol {during}"),
            Fault::Reported { status, during, .. } => format!("reported {status} {during}"),
            _ => "no-start".to_owned(),
        };
        let failure = Failure::new(kind, fault.to_string());
        match fault {
            Fault::Crashed { .. } | Fault::Exited { .. } => Self::Crashed(failure),
            _ => Self::Failed(failure),
        }
    }
}

impl From<InputError> for Stop {
    fn from(error: InputError) -> Self {
        Self::failed(format!("the kit could not make its instance: {error}"))
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
