//! A session: one plugin, from its start to its end.

use std::sync::Arc;
use std::time::Duration;

use fleetyard_abi::{
    Budget, Descriptor, FleetState, FleetStatus, Instance, Kind, PathEncoding, Plan,
    SharedEnvironment,
};
use serde::Serialize;
use serde_json::Value;

use crate::Fault;
use crate::confinement::promises::BrokenPromise;
use crate::confinement::sandbox::SandboxReport;
use crate::options::with_defaults;
use crate::sessions::attachment::{Attachment, Closing, Generated};
use crate::sessions::collector::Follow;
use crate::sessions::plan_run::{CallReport, PlanCall, PlanRun, Solver};

/// The contract that a plugin was built for, which is how it is spoken to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", content = "version", rename_all = "kebab-case")]
pub enum Contract {
    /// The C ABI, by major and minor version.
    CAbi(String),
    /// JSON over standard input and output.
    Protocol(u32),
    /// The manifest of a command adapter.
    Manifest(u64),
}

impl std::fmt::Display for Contract {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::CAbi(version) => write!(f, "C ABI {version}"),
            Self::Protocol(version) => write!(f, "protocol {version}"),
            Self::Manifest(version) => write!(f, "manifest {version}"),
        }
    }
}

/// A file's own description.
#[derive(Debug, Clone)]
pub struct Introduction {
    /// The contract that its plugins were built for.
    pub contract: Contract,
    /// The plugins.
    pub descriptors: Vec<Descriptor>,
}

/// A running plugin.
pub struct Session {
    attachment: Box<dyn Attachment + Send>,
    introduction: Introduction,
    environment: Option<SharedEnvironment>,
    /// The encoding in which the plugin that was made wants to read paths.
    encoding: PathEncoding,
    wants_annotations: bool,
    follower: Option<Arc<dyn Follow>>,
    /// From its start until it had introduced itself.
    startup: Duration,
}

impl Session {
    /// A plugin that was started and has introduced itself, which took so long.
    pub(super) fn new(
        attachment: impl Attachment + Send + 'static,
        introduction: Introduction,
        startup: Duration,
    ) -> Self {
        Self {
            attachment: Box::new(attachment),
            introduction,
            environment: None,
            encoding: PathEncoding::default(),
            wants_annotations: false,
            follower: None,
            startup,
        }
    }

    /// The description of the plugin's file by itself.
    pub fn introduction(&self) -> &Introduction {
        &self.introduction
    }

    /// The plugins that the session offers.
    pub fn descriptors(&self) -> &[Descriptor] {
        &self.introduction.descriptors
    }

    /// The time that it took to start the plugin until it had introduced itself, the
    /// sandbox included.
    pub fn startup(&self) -> Duration {
        self.startup
    }

    /// The layers and the limits of its sandbox; absent in process.
    pub fn sandbox(&self) -> Option<&SandboxReport> {
        self.attachment.sandbox()
    }

    /// Makes one plugin. Its options were checked against its schema, whose defaults it gets beside
    /// them.
    pub fn create(&mut self, kind: Kind, id: &str, options: Value) -> Result<(), Fault> {
        let mut offered = self.descriptors().iter();
        let made = offered.find(|offered| offered.kind == kind && offered.id == id);
        let encoding = made
            .map(|descriptor| descriptor.path_encoding)
            .unwrap_or_default();
        let options = match (options, made) {
            (Value::Object(options), Some(descriptor)) => {
                with_defaults(options, &descriptor.options_schema).into()
            }
            (options, _) => options,
        };
        self.encoding = encoding;
        self.attachment.create(kind, id, options)
    }

    /// Tells the plugin the map.
    pub fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
    ) -> Result<CallReport, Fault> {
        self.environment = None;
        let report = self.attachment.prepare(environment, budget)?;
        self.environment = Some(SharedEnvironment::clone(environment));
        Ok(report)
    }

    /// From here on calls may go on for so long after their deadlines, once told to stop; at first as
    /// the limits of the session say. In process nobody can be stopped.
    pub fn set_grace(&mut self, grace: Duration) {
        self.attachment.set_grace(grace);
    }

    /// From here on plugins are asked what they want to show of their search, or not; at first they
    /// are not.
    pub fn want_annotations(&mut self, wanted: bool) {
        self.wants_annotations = wanted;
    }

    /// From here on `follower` is told of plans as they come, if there is one.
    pub fn follow(&mut self, follower: Option<Arc<dyn Follow>>) {
        self.follower = follower;
    }

    /// Asks a planner for a plan.
    pub fn plan(&mut self, instance: &Instance, budget: &Budget) -> PlanRun {
        self.solve(Solver::Planner, instance, budget)
    }

    /// Asks a fail policy for a plan; `failed` is what the planner left.
    pub fn recover(
        &mut self,
        instance: &Instance,
        failed: Option<&Plan>,
        budget: &Budget,
    ) -> PlanRun {
        self.solve(Solver::FailPolicy(failed), instance, budget)
    }

    fn solve(&mut self, solver: Solver<'_>, instance: &Instance, budget: &Budget) -> PlanRun {
        let environment = self.environment.as_deref();
        let call = PlanCall {
            solver,
            instance,
            environment,
            encoding: self.encoding,
            wants_annotations: self.wants_annotations,
            follower: self.follower.as_ref(),
        };
        self.attachment.solve(&call, budget)
    }

    /// Asks an instance generator what the next instance is.
    pub fn generate(&mut self, state: &FleetState, budget: &Budget) -> Result<Generated, Fault> {
        self.attachment.generate(state, budget)
    }

    /// Asks an invocation policy whether to call the planner now.
    pub fn should_invoke(&mut self, status: &FleetStatus, limit: Duration) -> Result<bool, Fault> {
        self.attachment.should_invoke(status, limit)
    }

    /// The parts of the host's process that the plugin did not leave as they were, so far. From
    /// here on all of it is as it was, where it could be put back.
    pub fn broken_promises(&mut self) -> &[BrokenPromise] {
        self.attachment.broken_promises()
    }

    /// Ends the plugin; nothing of it is left running.
    pub fn close(&mut self) -> Closing {
        self.attachment.close()
    }
}
