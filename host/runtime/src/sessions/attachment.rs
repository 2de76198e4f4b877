//! The one trait behind a session: calls of a plugin, whichever way it is attached.

use std::time::Duration;

use fleetyard_abi::{Budget, FleetState, FleetStatus, Kind, Request, SharedEnvironment};
use fleetyard_core::Digest;
use serde_json::Value;

use crate::Fault;
use crate::confinement::promises::BrokenPromise;
use crate::confinement::sandbox::SandboxReport;
use crate::sessions::log::LogLine;
use crate::sessions::plan_run::{CallReport, PlanCall, PlanRun};
use crate::usage::{Limit, Usage};

/// A plugin's file that was started, by the way in which its plugins are called.
///
/// The host's own process and a process of its own are the two ways
/// ([`InProcess`](super::in_process::InProcess), [`Client`](super::client::Client)). Each says
/// in full what one of them does; what they have in common is [`PlanCall`] and its kin.
pub(super) trait Attachment {
    /// Makes a plugin, which takes the place of the last one. Its options were checked
    /// against its schema.
    fn create(&mut self, kind: Kind, id: &str, options: Value) -> Result<(), Fault>;

    /// Tells the plugin the map.
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
    ) -> Result<CallReport, Fault>;

    /// From here on calls may go on for so long after their deadlines, once told to stop. In process
    /// nobody can be stopped.
    fn set_grace(&mut self, grace: Duration);

    /// Asks a planner or a fail policy for a plan.
    fn solve(&mut self, call: &PlanCall<'_>, budget: &Budget) -> PlanRun;

    /// Asks an instance generator what the next instance is.
    fn generate(&mut self, state: &FleetState, budget: &Budget) -> Result<Generated, Fault>;

    /// Asks an invocation policy whether to call the planner now.
    fn should_invoke(&mut self, status: &FleetStatus, limit: Duration) -> Result<bool, Fault>;

    /// The layers and the limits of the sandbox; absent in process.
    fn sandbox(&self) -> Option<&SandboxReport>;

    /// The parts of the host's process that the plugin did not leave as they were.
    fn broken_promises(&mut self) -> &[BrokenPromise];

    /// Ends the plugin; nothing of it is left running.
    fn close(&mut self) -> Closing;
}

/// The last facts about a session, when it has ended.
#[derive(Debug, Clone, Default)]
pub struct Closing {
    /// The use of the process tree; absent in process.
    pub usage: Option<Usage>,
    /// The plugin's fault after its last answer.
    pub fault: Option<Fault>,
    /// The end of what it wrote to standard error.
    pub stderr: String,
    /// The bytes of standard error that came before.
    pub stderr_dropped: u64,
    /// Its log.
    pub log: Vec<LogLine>,
    /// Lines on standard output that were no messages.
    pub stray_lines: u64,
    /// The layers of its sandbox; absent in process.
    pub sandbox: Option<SandboxReport>,
    /// The limit for which it was stopped, also after its last answer.
    pub over: Option<Limit>,
    /// From the decision to stop it until nobody was left, if it was stopped.
    pub kill_latency: Option<Duration>,
    /// Stands for the plugin's whole environment; absent in process.
    pub environment: Option<Digest>,
    /// The parts of the host's process that it did not leave as they were; none in a process of
    /// its own.
    pub broken_promises: Vec<BrokenPromise>,
}

/// The answer of an instance generator.
#[derive(Debug, Clone, PartialEq)]
pub struct Generated {
    /// Its request for the next instance.
    pub request: Request,
    /// The bytes that it wants to have with its next call, if it kept some.
    pub kept: Option<Vec<u8>>,
}

/// The fault for which a call gave no request although it succeeded.
pub(super) fn no_request(method: &str) -> Fault {
    Fault::protocol(method, "it claims success but submitted no request")
}
