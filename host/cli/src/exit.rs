//! Exit codes of the command, and errors that become one.

use std::fmt;

use fleetyard_bench::{BenchError, Ending, TrialError, slurm};
use fleetyard_core::InputError;
use fleetyard_fleet::FleetError;
use fleetyard_runtime::{Fault, OptionError, interrupted_by};
use fleetyard_sim::SimError;

/// Exit codes. They are documented in `fleetyard help` and stay as they are.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Exit {
    /// A valid plan, or nothing to complain about.
    Success = 0,
    /// The planner found no plan within its budget, proved that there is none, or
    /// does not support the instance.
    NoPlan = 1,
    /// The command line is wrong, or names a plugin that there is not.
    Usage = 2,
    /// A file is missing, malformed or contradicts another.
    Input = 3,
    /// The plan breaks a rule, or something happened in its execution that may not.
    InvalidPlan = 4,
    /// The plugin crashed, broke the protocol, reported an error or is none.
    Plugin = 5,
    /// The host failed.
    Internal = 70,
    /// Somebody ended the command, here as Ctrl-C does; see [`Exit::code`].
    Interrupted = 130,
}

impl Exit {
    /// The exit code: after an interrupt, as a shell says it of a process that a signal has
    /// ended.
    pub(crate) fn code(self) -> i32 {
        match (self, interrupted_by()) {
            (Self::Interrupted, Some(signal)) => 128 + signal,
            (exit, _) => exit as i32,
        }
    }
}

/// The table for the help text.
pub(crate) const HELP: &str = "\
Exit codes:
   0  a valid plan, or nothing to complain about
   1  no plan within the budget, none exists, or the planner does not support the instance
   2  the command line is wrong, or no plugin has the name
   3  a file is missing, malformed or contradicts another, a plugin's file too
   4  the plan breaks a rule, or something happened that --fail-on names
   5  the plugin crashed, broke the protocol, reported an error or is none
  70  internal error of the host
 130  interrupted (128 and the number of the signal)

Environment:
  FLEETYARD_PLUGIN_PATH  folders with plugins, separated by colons
  FLEETYARD_LOCK         the lock file with the digests of pinned plugins
  FLEETYARD_SBATCH, FLEETYARD_SQUEUE, FLEETYARD_SCONTROL, FLEETYARD_SACCT,
  FLEETYARD_SCANCEL      programs to use in place of those of Slurm
  NO_COLOR               no colours and no progress bars";

/// Something the user must know before anything else.
#[derive(Debug)]
pub(crate) struct Failure {
    pub(crate) exit: Exit,
    pub(crate) message: String,
    pub(crate) hint: Option<String>,
}

pub(crate) type Result<T> = std::result::Result<T, Failure>;

impl Failure {
    pub(crate) fn new(exit: Exit, message: impl Into<String>) -> Self {
        Self {
            exit,
            message: message.into(),
            hint: None,
        }
    }

    pub(crate) fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "error: {}", self.message)?;
        if let Some(hint) = &self.hint {
            write!(f, "\nhint: {hint}")?;
        }
        Ok(())
    }
}

impl From<InputError> for Failure {
    fn from(error: InputError) -> Self {
        Self {
            exit: Exit::Input,
            message: error.to_string(),
            hint: error.hint,
        }
    }
}

impl From<OptionError> for Failure {
    fn from(error: OptionError) -> Self {
        Self {
            exit: Exit::Usage,
            message: error.reason,
            hint: error.hint,
        }
    }
}

impl From<slurm::Error> for Failure {
    fn from(error: slurm::Error) -> Self {
        let hint = error.hint();
        let exit = match &error {
            slurm::Error::Input(_) | slurm::Error::State { .. } => Exit::Input,
            slurm::Error::Failed { .. } => Exit::Internal,
            // Another executor or other options are needed.
            _ => Exit::Usage,
        };
        Self {
            exit,
            message: error.to_string(),
            hint,
        }
    }
}

impl From<SimError> for Failure {
    fn from(error: SimError) -> Self {
        let hint = error.hint().map(str::to_owned);
        Self {
            exit: Exit::Input,
            message: error.to_string(),
            hint,
        }
    }
}

impl From<&Fault> for Exit {
    fn from(fault: &Fault) -> Self {
        match fault {
            Fault::Unknown { .. } => Self::Usage,
            Fault::File { .. } => Self::Input,
            Fault::Host { .. } => Self::Internal,
            Fault::Interrupted { .. } => Self::Interrupted,
            _ => Self::Plugin,
        }
    }
}

impl From<Fault> for Failure {
    fn from(fault: Fault) -> Self {
        let hint = fault.hint().map(str::to_owned);
        Self {
            exit: Exit::from(&fault),
            message: fault.to_string(),
            hint,
        }
    }
}

impl From<TrialError> for Failure {
    fn from(error: TrialError) -> Self {
        let hint = error.hint();
        let message = error.to_string();
        let exit = match error {
            TrialError::Input(error) | TrialError::NoView(error) => return error.into(),
            TrialError::Options(error) => return error.into(),
            TrialError::Fault(fault) => return fault.into(),
            TrialError::Simulation(error) => return error.into(),
            TrialError::Fleet(error) => return error.into(),
            TrialError::Robots(_)
            | TrialError::SeveralPlugins { .. }
            | TrialError::NoPlugin {
                wanted: Some(_), ..
            } => Exit::Usage,
            TrialError::NoPlugin { .. } | TrialError::CodeChanged { .. } => Exit::Plugin,
            TrialError::Incapable { .. } | TrialError::NoneOfViews { .. } => Exit::NoPlan,
        };
        Self {
            exit,
            message,
            hint,
        }
    }
}

impl From<FleetError> for Failure {
    fn from(error: FleetError) -> Self {
        let hint = error.hint().map(str::to_owned);
        let message = error.to_string();
        let exit = match error {
            FleetError::Input(error) => return error.into(),
            FleetError::Sim(error) => return error.into(),
            FleetError::Config { .. } => Exit::Usage,
            FleetError::Start { fault, .. } => Exit::from(&fault),
            FleetError::Incapable { .. } => Exit::NoPlan,
            FleetError::Broken(_) => Exit::Internal,
        };
        Self {
            exit,
            message,
            hint,
        }
    }
}

impl From<BenchError> for Failure {
    fn from(error: BenchError) -> Self {
        let message = error.to_string();
        match error {
            BenchError::Input(error) | BenchError::Plugin { at: error, .. } => error.into(),
            BenchError::Trial { error, .. } => Self {
                message,
                ..Self::from(*error)
            },
            BenchError::Host(_) => internal(message),
        }
    }
}

impl From<Ending> for Exit {
    fn from(ending: Ending) -> Self {
        match ending {
            Ending::Success => Self::Success,
            Ending::NoPlan => Self::NoPlan,
            Ending::InvalidPlan => Self::InvalidPlan,
            Ending::Plugin => Self::Plugin,
            Ending::Interrupted => Self::Interrupted,
        }
    }
}

/// For failures of the host's own output.
pub(crate) fn internal(error: impl fmt::Display) -> Failure {
    Failure::new(Exit::Internal, error.to_string())
}
