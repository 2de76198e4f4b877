//! The four plugins of a run, and how each is started again when it has died.

use std::time::Duration;

use fleetyard_abi::{Budget, Capabilities, Kind, SharedEnvironment};
use fleetyard_core::Digest;
use fleetyard_runtime::{Able, Closing, Fault, Runtime, Session};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

/// The record of a plugin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModuleInfo {
    /// Its part in the run.
    pub kind: Kind,
    /// The user's name for it: an identifier or a path.
    pub name: String,
    /// Its identifier.
    pub id: String,
    /// Its version.
    pub version: String,
    /// Its attachment: `in-process`, `worker`, `stdio` or `command`.
    pub attach: String,
    /// Digest of its code; absent where its code cannot be read.
    pub digest: Option<Digest>,
    /// Its options.
    pub options: Map<String, Value>,
    /// Parts with the memory of the fleet that it reads.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub memory: Vec<String>,
}

impl ModuleInfo {
    /// True if it reads a part with memory.
    pub(crate) fn reads(&self, part: &str) -> bool {
        self.memory.iter().any(|read| read == part)
    }
}

/// Starts a plugin: opens a session and makes the plugin in it.
pub type Start = dyn Fn(&Runtime) -> Result<Session, Fault> + Send;

/// A plugin that was made, and the means to make it again.
pub struct Module {
    info: ModuleInfo,
    capabilities: Capabilities,
    runtime: Runtime,
    start: Box<Start>,
    session: Option<Session>,
    /// True once the plugin that runs has learnt the map.
    prepared: bool,
    /// Calls one after the other in which it was killed, since it did not even answer late.
    hung: u32,
    /// The first time that nobody watched it to the end, or that the host failed.
    unsupervised: Option<Fault>,
}

impl std::fmt::Debug for Module {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_tuple("Module").field(&self.info).finish()
    }
}

impl Module {
    /// A plugin that was made in a session of a runtime, and what makes it in another one.
    pub fn new(
        info: ModuleInfo,
        capabilities: Capabilities,
        session: Session,
        runtime: Runtime,
        start: Box<Start>,
    ) -> Self {
        Self {
            info,
            capabilities,
            runtime,
            start,
            session: Some(session),
            prepared: false,
            hung: 0,
            unsupervised: None,
        }
    }

    /// The record of it.
    pub fn info(&self) -> &ModuleInfo {
        &self.info
    }

    /// The capabilities that it claims.
    pub fn capabilities(&self) -> Capabilities {
        self.capabilities
    }

    /// The plugins of its kind that claim so much for a fleet.
    pub(crate) fn able(&self, needed: Capabilities) -> Able {
        self.runtime.able(self.info.kind, |other| {
            let claims = other.capabilities;
            other.most_agents().is_none() && needed.iter().all(|needed| claims.has(needed))
        })
    }

    /// True if it has to be started before it can be asked.
    pub(crate) fn is_down(&self) -> bool {
        self.session.is_none()
    }

    /// The plugin, started and told the map where that is needed. Invocation policies
    /// learn no map.
    pub(crate) fn ready(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
    ) -> Result<&mut Session, Fault> {
        if self.session.is_none() {
            self.session = Some((self.start)(&self.runtime)?);
        }
        if !self.prepared && self.info.kind != Kind::InvocationPolicy {
            let session = self.session.as_mut();
            let taught = session.map(|session| session.prepare(environment, budget));
            if let Some(Err(fault)) = taught {
                self.note(&fault);
                self.drop_session();
                return Err(fault);
            }
        }
        self.prepared = true;
        self.session.as_mut().ok_or_else(|| Fault::Refused {
            reason: "it is not running".into(),
            hint: None,
        })
    }

    /// For how long its next call may go on after its limit, if calls may for so long. Whoever has not
    /// come to an end in two calls one after the other hangs, and a run would wait for nothing.
    pub(crate) fn patience(&self, grace_s: f64) -> Duration {
        const PATIENT: u32 = 2;
        if self.hung < PATIENT {
            Duration::from_secs_f64(grace_s)
        } else {
            Duration::ZERO
        }
    }

    /// A call has come to an end by itself.
    pub(crate) fn answered(&mut self) {
        self.hung = 0;
    }

    /// The map has changed: it is told the new one before its next call.
    pub(crate) fn forget_map(&mut self) {
        self.prepared = false;
    }

    /// Treats the fault of a call: a plugin that only reported a failure goes on, any other that
    /// failed is dead or may not be trusted, and starts again at its next call. Its last words, if
    /// it had some.
    pub(crate) fn after(&mut self, fault: &Fault) -> Option<String> {
        if matches!(fault, Fault::Reported { .. }) {
            self.answered();
            return None;
        }
        if matches!(fault, Fault::TimedOut { .. }) {
            self.hung += 1;
        }
        self.note(fault);
        self.drop_session()
    }

    fn note(&mut self, fault: &Fault) {
        if fault.is_of_host() || matches!(fault, Fault::Unsupervised { .. }) {
            self.unsupervised.get_or_insert_with(|| fault.clone());
        }
    }

    /// That it ran without its supervisor for a while, or the host failed, if it did.
    pub fn unsupervised(&self) -> Option<&Fault> {
        self.unsupervised.as_ref()
    }

    fn drop_session(&mut self) -> Option<String> {
        let closing = self.close()?;
        let mut lines = closing.stderr.lines().rev();
        let last = lines.find(|line| !line.trim().is_empty())?;
        Some(last.chars().take(200).collect())
    }

    /// Ends it; absent if it was not running.
    pub fn close(&mut self) -> Option<Closing> {
        self.prepared = false;
        let closing = self.session.take()?.close();
        if let Some(fault) = &closing.fault {
            self.note(fault);
        }
        Some(closing)
    }
}

/// The plugins of a run.
#[derive(Debug)]
pub struct Modules {
    /// Plans.
    pub planner: Module,
    /// Says what the planner is asked.
    pub generator: Module,
    /// Says when it is asked.
    pub invocation: Module,
    /// Gets the fleet moving where the planner failed.
    pub fail_policy: Module,
}

impl Modules {
    /// All of them, in the order in which they are told of.
    pub fn infos(&self) -> Vec<ModuleInfo> {
        let Self {
            planner,
            generator,
            invocation,
            fail_policy,
        } = self;
        [planner, generator, invocation, fail_policy]
            .map(|module| module.info.clone())
            .to_vec()
    }
}

/// The budget of a call that may take so long.
pub(crate) fn budget(wall_s: f64, allowance: &crate::Allowance, nodes: u64, seed: u64) -> Budget {
    Budget {
        nodes,
        memory_bytes: allowance.memory_bytes,
        threads: allowance.threads,
        seed,
        ..Budget::lasting(0, Duration::from_secs_f64(wall_s).as_nanos() as u64)
    }
}
