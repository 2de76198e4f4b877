//! Launches: what the host tells the supervisor to start.

use serde::{Deserialize, Serialize};

use super::grants::Grants;
use super::policy::Policy;
use super::report::Filter;
use crate::confinement::target::Target;
use crate::measure::Cpus;

/// The process that the host wants to be started.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(crate) struct Launch {
    pub(crate) target: Target,
    pub(crate) policy: Policy,
    /// The filter of system calls.
    pub(crate) filter: Filter,
    /// For numerical libraries, which read it from the environment.
    pub(crate) threads: u32,
    /// The processors that the plugin may run on.
    pub(crate) cpus: Option<Cpus>,
    /// The memory limit until a call has one of its own; 0 for none.
    pub(crate) memory_bytes: u64,
    /// True if any of its calls has a limit of processor time.
    pub(crate) cpu_is_limited: bool,
    /// The paths that it may read, and its environment: found by the host, whose environment does
    /// not come this far.
    pub(crate) grants: Grants,
    /// Stands for this run in the environment of all its processes.
    pub(crate) run: String,
}
