//! The limits of sessions that are not a call's budget.

use std::time::Duration;

use crate::Trust;
use crate::confinement::sandbox::Policy;
use crate::measure::Cpus;

/// Limits that are not a call's budget. How much of what a plugin sends is kept is said in
/// [`bounds`](crate::sessions::bounds).
#[derive(Debug, Clone)]
pub struct Limits {
    /// The time that a plugin may take to start and introduce itself.
    pub startup: Duration,
    /// The time for which a plugin may go on after the deadline, once told to stop. Zero
    /// for runs that are compared.
    pub grace: Duration,
    /// The time that a plugin may take to end when it is no longer needed.
    pub ending: Duration,
    /// Most bytes on standard output and standard error that are no messages.
    pub output_bytes: u64,
    /// The sandbox's grants.
    pub policy: Policy,
    /// The code that may be started.
    pub trust: Trust,
    /// Processor time of a `prepare` call, over all processes and threads.
    pub prepare_cpu: Option<Duration>,
    /// Processor time of every other call.
    pub cpu: Option<Duration>,
    /// Memory of all processes together while no call with a budget is running;
    /// 0 for no limit.
    pub memory_bytes: u64,
    /// The threads that numerical libraries are told of through the environment.
    pub threads: u32,
    /// The processors that the plugin may run on.
    pub cpus: Option<Cpus>,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            startup: Duration::from_mins(1),
            grace: Duration::ZERO,
            ending: Duration::from_secs(2),
            output_bytes: 64 << 20,
            policy: Policy::default(),
            trust: Trust::default(),
            prepare_cpu: None,
            cpu: None,
            memory_bytes: 0,
            threads: 1,
            cpus: None,
        }
    }
}
