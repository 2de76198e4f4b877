//! The control socket between host and supervisor: orders, messages, and the report at the end.

use fleetyard_core::Digest;
use serde::{Deserialize, Serialize};

use crate::confinement::sandbox::SandboxReport;
use crate::usage::{CallLimits, CallUsage, Limit, Usage};

/// First argument of a process that is a supervisor.
pub const ARGUMENT: &str = "__supervise";

/// Orders of the host, after it has said what to start.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Order {
    /// A call begins.
    Begin {
        limits: CallLimits,
        /// The time for which the plugin may go on once it was told to stop.
        grace_ns: u64,
    },
    /// It has ended: say what it used.
    Finish,
}

/// Messages of the supervisor.
#[derive(Debug, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Message {
    /// The plugin has been started, in this sandbox.
    Started(SandboxReport),
    /// The use of the call.
    Used(CallUsage),
    /// A limit is exceeded; the plugin has its grace to stop.
    Over(Limit),
    /// Nobody is left.
    Ended(Box<Report>),
}

/// The supervisor's report at the end.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Report {
    /// Exit code of the plugin's main process.
    pub code: Option<i32>,
    /// Signal that ended it.
    pub signal: Option<i32>,
    /// True if the plugin was stopped: by the host, or for a limit.
    pub killed: bool,
    /// The limit for which it was stopped, as far as the supervisor watches it.
    pub over: Option<Limit>,
    /// From the decision to stop it until nobody was left.
    pub kill_us: Option<u64>,
    /// The reason why the plugin could not be started.
    pub start_error: Option<String>,
    /// The reason why the supervisor could not do its work: somebody changed its limits, or ended
    /// it or the sandbox's first process. The rest of its report is then worth nothing.
    #[serde(default)]
    pub disturbed: Option<String>,
    /// True if nothing that the plugin can do was the cause of that.
    #[serde(default)]
    pub from_outside: bool,
    /// Work for the plugin that the host, the supervisor or the inside of the sandbox could not do.
    #[serde(default)]
    pub host_error: Option<String>,
    /// The use of the whole tree.
    pub usage: Option<Usage>,
    /// The use of the call in which it was stopped.
    pub call: Option<CallUsage>,
    /// Stands for the whole environment of the plugin.
    pub environment: Option<Digest>,
    /// The layers of its sandbox.
    pub sandbox: SandboxReport,
}

impl Report {
    /// The host could not do something before there was a plugin.
    pub(crate) fn failed(what: &str, error: &dyn std::fmt::Display) -> Self {
        Self {
            host_error: Some(format!("{what}: {error}")),
            ..Self::default()
        }
    }

    /// Of a supervisor that could not do its work.
    pub(crate) fn disturbed(reason: String) -> Self {
        Self {
            disturbed: Some(reason),
            ..Self::default()
        }
    }
}
