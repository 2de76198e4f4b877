//! Every way in which a plugin can fail its host, told apart.

use std::path::Path;

use fleetyard_abi::Status;

use crate::usage::Limit;

/// A fault of a plugin; [`Fault::Host`] and [`Fault::Interrupted`] are not its doing.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum Fault {
    /// The file is no plugin that this host can use.
    #[error("{reason}")]
    Refused {
        /// The reason.
        reason: String,
        /// A hint for the user.
        hint: Option<String>,
    },
    /// A file of a plugin is missing, cannot be read, or says what it may not.
    #[error("{reason}")]
    File {
        /// The file, and the reason.
        reason: String,
        /// A hint for the user.
        hint: Option<String>,
    },
    /// No plugin has the name.
    #[error("{reason}")]
    Unknown {
        /// The name that was looked for.
        reason: String,
        /// A hint for the user.
        hint: Option<String>,
    },
    /// The process could not be started.
    #[error("cannot start {program}: {reason}")]
    Spawn {
        /// The program that was to be started.
        program: String,
        /// The system's reason.
        reason: String,
        /// A hint for the user.
        hint: Option<String>,
    },
    /// The host could not do its part: the plugin is not to blame.
    #[error("the host failed: {reason}")]
    Host {
        /// The thing that it could not do, and the system's reason.
        reason: String,
    },
    /// A signal ended the process.
    #[error("crashed with {} (signal {signal}) during `{during}`", signal_name(*signal))]
    Crashed {
        /// The signal's number.
        signal: i32,
        /// The call that was running.
        during: String,
    },
    /// The process ended by itself before it answered.
    #[error("exited with code {code} without a result during `{during}`")]
    Exited {
        /// The exit code.
        code: i32,
        /// The call that was running.
        during: String,
    },
    /// The call did not return within its budget, and the process was killed.
    #[error("did not answer `{during}` within {limit_ms} ms and was killed")]
    TimedOut {
        /// The call that was running.
        during: String,
        /// The budget.
        limit_ms: u64,
    },
    /// Somebody told the host to end, and the process was killed.
    #[error("was interrupted during `{during}`")]
    Interrupted {
        /// The call that was running.
        during: String,
    },
    /// The plugin used more of a resource than it may, and was stopped.
    #[error("exceeded its {limit} limit of {allowed} during `{during}` and was stopped")]
    OverLimit {
        /// The call that was running.
        during: String,
        /// The resource.
        limit: Limit,
        /// The amount of it that is allowed.
        allowed: String,
    },
    /// The plugin broke the protocol, and the process was killed.
    #[error("broke the protocol during `{during}`: {reason}")]
    Protocol {
        /// The call that was running.
        during: String,
        /// Its breach.
        reason: String,
    },
    /// The supervisor was lost or hindered: what the plugin did under which limits nobody
    /// can say.
    #[error("was not supervised to the end of `{during}`: {reason}")]
    Unsupervised {
        /// The call that was running.
        during: String,
        /// The supervisor's fate.
        reason: String,
    },
    /// The plugin reported a failure by itself.
    #[error("reported `{status}` from `{during}`: {message}")]
    Reported {
        /// Its claim.
        status: Status,
        /// The call that was running.
        during: String,
        /// Its explanation.
        message: String,
    },
}

impl Fault {
    /// A refusal without a hint.
    pub(crate) fn refused(reason: impl Into<String>) -> Self {
        Self::Refused {
            reason: reason.into(),
            hint: None,
        }
    }

    /// A file of a plugin cannot be read.
    pub(crate) fn file(path: &Path, error: impl std::fmt::Display) -> Self {
        Self::File {
            reason: format!("{}: {error}", path.display()),
            hint: None,
        }
    }

    /// The host could not do something.
    pub(crate) fn host(what: impl std::fmt::Display, error: impl std::fmt::Display) -> Self {
        Self::Host {
            reason: format!("{what}: {error}"),
        }
    }

    /// A breach of the protocol during a call.
    pub(crate) fn protocol(during: &str, reason: impl Into<String>) -> Self {
        Self::Protocol {
            during: during.into(),
            reason: reason.into(),
        }
    }

    /// The fault that a plugin says itself, by its status.
    pub(crate) fn reported(method: &str, status: Status, message: Option<String>) -> Self {
        let message = message.unwrap_or_else(|| "it did not say why".into());
        Self::Reported {
            status,
            during: method.into(),
            message,
        }
    }

    /// True if the plugin has nothing to do with it, so that it says nothing of the plugin.
    pub fn is_of_host(&self) -> bool {
        matches!(self, Self::Host { .. })
    }

    /// True if the plugin is still there to be asked again: it failed one call and
    /// said so.
    pub(crate) fn is_survivable(&self) -> bool {
        matches!(self, Self::Reported { .. })
    }

    /// True if the host stopped the plugin, rather than found it ended.
    pub(crate) fn is_stop(&self) -> bool {
        matches!(
            self,
            Self::TimedOut { .. }
                | Self::Interrupted { .. }
                | Self::OverLimit { .. }
                | Self::Protocol { .. }
                | Self::Unsupervised { .. }
        )
    }

    /// The limit that was exceeded, if that is what went wrong.
    pub fn limit(&self) -> Option<Limit> {
        match self {
            Self::TimedOut { .. } => Some(Limit::Wall),
            Self::OverLimit { limit, .. } => Some(*limit),
            _ => None,
        }
    }

    /// A hint for the user, where there is something to do.
    pub fn hint(&self) -> Option<&str> {
        match self {
            Self::Refused { hint, .. }
            | Self::File { hint, .. }
            | Self::Unknown { hint, .. }
            | Self::Spawn { hint, .. } => hint.as_deref(),
            Self::Unsupervised { .. } => Some(
                "its result does not count; if nobody ended the supervisor on purpose, \
                 `fleetyard doctor` says which layers keep a plugin away from it here",
            ),
            // EAGAIN, as the system writes it.
            Self::Host { reason } if reason.contains("(os error 11)") => Some(
                "the user or the container may have no more processes (`ulimit -u`, `pids.max`): raise \
                 the limit, or run less at a time",
            ),
            Self::Host { .. } => Some("run it again when the machine has what was missing"),
            _ => None,
        }
    }
}

/// The name of a signal, as in the manual.
pub(crate) fn signal_name(signal: i32) -> &'static str {
    match signal {
        libc::SIGABRT => "SIGABRT",
        libc::SIGALRM => "SIGALRM",
        libc::SIGBUS => "SIGBUS",
        libc::SIGFPE => "SIGFPE",
        libc::SIGHUP => "SIGHUP",
        libc::SIGILL => "SIGILL",
        libc::SIGINT => "SIGINT",
        libc::SIGKILL => "SIGKILL",
        libc::SIGPIPE => "SIGPIPE",
        libc::SIGQUIT => "SIGQUIT",
        libc::SIGSEGV => "SIGSEGV",
        libc::SIGSYS => "SIGSYS",
        libc::SIGTERM => "SIGTERM",
        libc::SIGTRAP => "SIGTRAP",
        libc::SIGXCPU => "SIGXCPU",
        libc::SIGXFSZ => "SIGXFSZ",
        _ => "a signal",
    }
}
