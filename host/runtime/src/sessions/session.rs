//! Sessions: one plugin, from its start to its end.

use std::collections::BTreeMap;
use std::io::Read;
use std::path::PathBuf;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Duration;

use fleetyard_abi::figures::longest_call_ns;
use fleetyard_abi::object::Object;
use fleetyard_abi::paths::{PathContext, WritePaths};
use fleetyard_abi::sdk::{Catalog, Failure, Options, Sink};
use fleetyard_abi::wire::{
    CreateParams, GenerateParams, GenerateResult, InitializeParams, InitializeResult, Outcome,
    PROTOCOL_VERSION, Peer, PlanParams, PlanResult, PrepareParams, RecoverParams,
    ShouldInvokeParams, ShouldInvokeResult,
};
use fleetyard_abi::{
    Budget, Descriptor, FleetState, FleetStatus, GridEnvironment, Instance, Kind, PathEncoding,
    Plan, PlanRef, SharedEnvironment, Status, c, monotonic_ns,
};
use fleetyard_core::{Digest, GridPlan};
use rustix::time::{ClockId, clock_gettime};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::value::{RawValue, to_raw_value};

use crate::confinement::monitor::{CallLimits, CallUsage, Limit, Usage};
use crate::confinement::process::Process;
use crate::confinement::promises::{BrokenPromise, Promises};
use crate::confinement::sandbox::jail::Launch;
use crate::confinement::sandbox::{
    self, Attempt, Filter, Grants, Level, Policy, Profile, SandboxReport, Targets,
};
use crate::confinement::supervisor::Target;
use crate::confinement::transport::Transport;
use crate::confinement::{python, selftest};
use crate::interrupt::{Interruptible, interrupted_by};
use crate::measure::Cpus;
use crate::sessions::adapter::FORMAT;
use crate::sessions::bounds::{INTRODUCTION_BYTES, LOG_BYTES, message_bytes, plan_cells};
use crate::sessions::client::{Client, Deadline, Notice, Reply};
use crate::sessions::collector::{Collected, Collector};
use crate::sessions::incoming::Expected;
use crate::sessions::log::{Log, LogLine};
use crate::sessions::message;
use crate::{Attach, Fault, Library, PluginFile, Trust};

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
    /// Whose code may be started.
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

/// A plan and when it came.
#[derive(Debug, Clone)]
pub struct Incumbent {
    /// From the start of the call to the arrival of the plan's last byte.
    pub arrived: Duration,
    /// The plan; absent when too many were submitted to keep them all.
    pub plan: Option<GridPlan>,
}

/// The end of a run, whatever the planner claims and the validator finds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Termination {
    /// The call returned.
    Completed,
    /// The wall-clock budget ended first.
    TimedOut,
    /// Somebody told the host to end.
    Interrupted,
    /// The plugin used more of another resource than it may, and was stopped.
    OverLimit,
    /// A signal ended the plugin.
    Crashed,
    /// The plugin ended by itself without a result.
    Exited,
    /// The plugin broke the protocol.
    ProtocolError,
    /// The plugin cannot handle the instance.
    Unsupported,
    /// The plugin reported an error of its own, could not be started, or was not
    /// supervised to the end.
    Failed,
}

impl std::fmt::Display for Termination {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Completed => "completed",
            Self::TimedOut => "timed-out",
            Self::Interrupted => "interrupted",
            Self::OverLimit => "over-limit",
            Self::Crashed => "crashed",
            Self::Exited => "exited",
            Self::ProtocolError => "protocol-error",
            Self::Unsupported => "unsupported",
            Self::Failed => "failed",
        })
    }
}

impl From<&Fault> for Termination {
    fn from(fault: &Fault) -> Self {
        match fault {
            Fault::Crashed { .. } => Self::Crashed,
            Fault::Exited { .. } => Self::Exited,
            Fault::TimedOut { .. } => Self::TimedOut,
            Fault::Interrupted { .. } => Self::Interrupted,
            Fault::OverLimit { .. } => Self::OverLimit,
            Fault::Protocol { .. } => Self::ProtocolError,
            Fault::Reported {
                status: Status::Unsupported,
                ..
            } => Self::Unsupported,
            Fault::Refused { .. }
            | Fault::File { .. }
            | Fault::Unknown { .. }
            | Fault::Spawn { .. }
            | Fault::Unsupervised { .. }
            | Fault::Host { .. }
            | Fault::Reported { .. } => Self::Failed,
        }
    }
}

/// A call that asks for no plan, and how long it took.
#[derive(Debug, Clone, Copy)]
pub struct CallReport {
    /// Wall time by the host's clock.
    pub wall: Duration,
    /// The use of the plugin's processes meanwhile.
    pub usage: CallUsage,
}

/// The time of the host's own thread during a call; absent where the kernel does not count it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct HostTime {
    /// Processor time: it wrote, read and kept plans. In process the plugin's is in it.
    pub cpu: Option<Duration>,
    /// Time for which it was ready to run and had no processor.
    pub run_delay: Option<Duration>,
}

impl HostTime {
    /// Of this thread so far.
    fn now() -> Self {
        let cpu = clock_gettime(ClockId::ThreadCPUTime);
        let waited = || {
            let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
            let delay = text.split_whitespace().nth(1)?;
            Some(Duration::from_nanos(delay.parse().ok()?))
        };
        Self {
            cpu: Duration::try_from(cpu).ok(),
            run_delay: waited(),
        }
    }

    fn since(self, before: Self) -> Self {
        let gained = |now: Option<Duration>, then| Some(now?.saturating_sub(then?));
        Self {
            cpu: gained(self.cpu, before.cpu),
            run_delay: gained(self.run_delay, before.run_delay),
        }
    }
}

/// Everything that came of a `plan` or `recover` call.
#[derive(Debug, Clone)]
pub struct PlanRun {
    /// The end of the call.
    pub termination: Termination,
    /// The plugin's claim, if it came to say so.
    pub claim: Option<Status>,
    /// The plugin's explanation.
    pub message: Option<String>,
    /// The fault, if something went wrong.
    pub fault: Option<Fault>,
    /// Plans that came before the deadline, in order of arrival. The last one is
    /// the answer.
    pub incumbents: Vec<Incumbent>,
    /// Plans that came too late.
    pub late: u64,
    /// Figures that the plugin reported of itself.
    pub metrics: BTreeMap<String, f64>,
    /// Wall time of the call by the host's clock.
    pub planning: Duration,
    /// Wall time of the call as the plugin's process claims it, without transport.
    pub call: Option<Duration>,
    /// From the request, ready to be written, to the last byte of the answer, by the host's
    /// clock; in process the call itself. Absent if there was no answer.
    pub round_trip: Option<Duration>,
    /// The part of it that the host's own work and other processes may have taken: it handled
    /// messages, and waited for a processor. Absent where the kernel does not count the latter.
    pub held_up: Option<Duration>,
    /// The host's part of the wall time of the call.
    pub host: HostTime,
    /// The use of the plugin's processes meanwhile.
    pub usage: CallUsage,
    /// True if the plugin was stopped, rather than ending its call by itself.
    pub stopped: bool,
    /// The limit that was exceeded; a plugin may exceed one and end by itself, in its
    /// grace, and it may be stopped for something else.
    pub limit: Option<Limit>,
}

impl PlanRun {
    /// A run that ended before the planner could be asked.
    pub fn failed(fault: Fault) -> Self {
        Self {
            termination: Termination::from(&fault),
            claim: None,
            message: None,
            usage: CallUsage::default(),
            stopped: fault.is_stop(),
            limit: fault.limit(),
            fault: Some(fault),
            incumbents: Vec::new(),
            late: 0,
            metrics: BTreeMap::new(),
            planning: Duration::ZERO,
            call: None,
            round_trip: None,
            held_up: None,
            host: HostTime::default(),
        }
    }

    /// The plan that counts.
    pub fn plan(&self) -> Option<&GridPlan> {
        self.incumbents
            .last()
            .and_then(|incumbent| incumbent.plan.as_ref())
    }
}

/// The last facts about a session, when it has ended.
#[derive(Debug, Clone)]
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

/// The contract that a plugin was built for, which is how it is spoken to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(tag = "kind", content = "version", rename_all = "kebab-case")]
pub enum Contract {
    /// The C ABI, by major and minor version.
    CAbi(String),
    /// JSON over standard input and output.
    Protocol(u32),
    /// The manifest of a command adapter.
    Manifest(i64),
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

/// Opens sessions.
#[derive(Debug, Clone)]
pub struct Runtime {
    executable: PathBuf,
    built_in: &'static [&'static c::PluginEntry],
    limits: Limits,
}

impl Runtime {
    /// For a program that calls [`intercept`](crate::confinement::supervisor::intercept) with
    /// the same entries first of all.
    pub fn new(
        built_in: &'static [&'static c::PluginEntry],
        mut limits: Limits,
    ) -> std::io::Result<Self> {
        crate::confinement::state::reap_orphans();
        let lock = limits
            .trust
            .lock
            .as_ref()
            .map(|lock| lock.file().to_owned());
        limits.policy.hidden.extend(lock);
        // Through /proc, so that a binary replaced meanwhile is still this one.
        let executable = PathBuf::from("/proc/self/exe");
        let executable = if executable.exists() {
            executable
        } else {
            std::env::current_exe()?
        };
        Ok(Self {
            executable,
            built_in,
            limits,
        })
    }

    /// The limits of every session.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// The plugins that a file has. The built-ins need no process of their own to be
    /// described: they are this program.
    pub fn describe(&self, file: &PluginFile) -> Result<Introduction, Fault> {
        if *file == PluginFile::BuiltIn {
            let library = Library::from_entries(self.built_in)?;
            return Ok(Introduction {
                contract: contract(file, library.abi_version()),
                descriptors: library.descriptors(),
            });
        }
        let mut session = self.open(file, file.default_attach())?;
        session.close();
        Ok(session.introduction)
    }

    /// Starts a plugin and lets it introduce itself, if the lock allows it.
    pub fn open(&self, file: &PluginFile, attach: Attach) -> Result<Session, Fault> {
        let hidden = &self.limits.policy.hidden;
        self.limits.trust.admit(file, hidden)?;
        let mut session = self.start(file, attach)?;
        // What was put into the file's place between the look and the start.
        if let Err(fault) = self.limits.trust.admit(file, hidden) {
            session.close();
            return Err(fault);
        }
        Ok(session)
    }

    fn start(&self, file: &PluginFile, attach: Attach) -> Result<Session, Fault> {
        let mismatch = |what: &str, hint: &str| {
            Err(Fault::Refused {
                reason: what.into(),
                hint: Some(hint.into()),
            })
        };
        match (file, attach) {
            (PluginFile::Program(..), Attach::InProcess | Attach::Worker) => mismatch(
                "a program cannot be loaded as a library",
                "use `--attach stdio`",
            ),
            (PluginFile::BuiltIn | PluginFile::Library(_), Attach::Stdio) => mismatch(
                "a shared library does not speak JSON over stdio by itself",
                "use `--attach worker`",
            ),
            (PluginFile::Adapter(_), Attach::InProcess | Attach::Worker | Attach::Stdio) => {
                mismatch(
                    "a planner.toml describes a command-line solver",
                    "use `--attach command`",
                )
            }
            (
                PluginFile::BuiltIn | PluginFile::Library(_) | PluginFile::Program(..),
                Attach::Command,
            ) => mismatch(
                "this is no planner.toml that describes a command-line solver",
                "leave `--attach` away to attach the plugin as what it is",
            ),
            (PluginFile::Program(..), Attach::Stdio)
            | (PluginFile::BuiltIn | PluginFile::Library(_), Attach::Worker)
            | (PluginFile::Adapter(_), Attach::Command) => self.open_process(file),
            (PluginFile::BuiltIn | PluginFile::Library(_), Attach::InProcess) => {
                let mut promises = Promises::new();
                // Constructors are the first of its code that runs.
                let library = promises.around("load", || match file {
                    PluginFile::Library(path) => Library::open(path),
                    _ => Library::from_entries(self.built_in),
                });
                promises.settle();
                let library = library?;
                let introduction = Introduction {
                    contract: contract(file, library.abi_version()),
                    descriptors: library.descriptors(),
                };
                let inner = Inner::InProcess {
                    library,
                    object: None,
                    log: Log::default(),
                    promises,
                };
                Ok(Session {
                    inner,
                    introduction,
                    limits: self.limits.clone(),
                    environment: None,
                    encoding: PathEncoding::default(),
                    startup: Duration::ZERO,
                })
            }
        }
    }

    fn launch(&self, target: Target) -> Result<Launch, Fault> {
        let limits = &self.limits;
        let policy = &limits.policy;
        let filter = match policy.level {
            Level::Strict => selftest::strictest(self),
            Level::Auto | Level::None => Filter::of(Profile::DenyList),
        };
        let launched = |target: Target, grants: Grants| {
            let memory_bytes = limits.memory_bytes;
            self.launch_granted(target, grants, policy.clone(), filter.clone(), memory_bytes)
        };
        let asked = sandbox::python(&target).map(|interpreter| {
            let grants = Grants::to_ask(&interpreter, &target, policy, limits.threads)?;
            let name = interpreter.program.to_string_lossy().into_owned();
            let question = [name, "-c".into(), python::QUESTION.into()];
            let launch = launched(Target::Program(question.into()), grants);
            Ok(python::ask(&self.executable, &launch))
        });
        let python = asked.transpose()?.flatten();
        let grants = Grants::new(&target, policy, limits.threads, python.as_ref())?;
        Ok(launched(target, grants))
    }

    fn launch_granted(
        &self,
        target: Target,
        grants: Grants,
        policy: Policy,
        filter: Filter,
        memory_bytes: u64,
    ) -> Launch {
        static SERIAL: AtomicU64 = AtomicU64::new(0);
        let serial = SERIAL.fetch_add(1, Ordering::Relaxed);
        // Unique on this machine since it was started.
        let run = format!("{}-{serial}-{:x}", std::process::id(), monotonic_ns());
        let limits = &self.limits;
        Launch {
            grants,
            target,
            policy: Policy {
                // Said by the grants; nobody else needs to know of them.
                read: Vec::new(),
                hidden: Vec::new(),
                ..policy
            },
            filter,
            threads: limits.threads,
            cpus: limits.cpus.clone(),
            memory_bytes,
            cpu_is_limited: limits.cpu.is_some() || limits.prepare_cpu.is_some(),
            run,
        }
    }

    /// Starts something of this machine's under `strict` with a filter, and with nothing
    /// that was granted to plugins.
    pub(crate) fn start_filtered(&self, target: Target, filter: Filter) -> Result<Process, Fault> {
        let policy = Policy {
            level: Level::Strict,
            ..Policy::default()
        };
        let grants = Grants::new(&target, &policy, self.limits.threads, None)?;
        let launch = self.launch_granted(target, grants, policy, filter, 0);
        Process::start(&self.executable, &launch)
    }

    /// Lets a worker introduce itself under such a filter.
    pub(crate) fn try_worker(&self, filter: Filter) -> Result<(), Fault> {
        let process = self.start_filtered(Target::BuiltIn, filter)?;
        let mut client = Client::new(process, self.limits.clone());
        introduce(&mut client, &self.limits)?;
        client.close(self.limits.ending).1.map_or(Ok(()), Err)
    }

    /// Paths that a plugin may read besides the system's files and what variables of the host name,
    /// without starting it: its own folder, its interpreter, what it declares. Places of a
    /// Python interpreter are found when it is started.
    pub fn readable(&self, file: &PluginFile) -> Result<Vec<PathBuf>, Fault> {
        let limits = &self.limits;
        let grants = Grants::new(&file.target(), &limits.policy, limits.threads, None)?;
        Ok(grants.for_the_plugin())
    }

    /// The layers that a sandbox would have on this machine, for this user: all of it is
    /// set up, and nothing is started in it.
    pub fn probe(&self) -> Result<SandboxReport, Fault> {
        let launch = self.launch(Target::Nothing)?;
        let mut process = Process::start(&self.executable, &launch)?;
        let report = process.end(self.limits.startup);
        if let Some(reason) = report.host_error {
            return Err(Fault::Host { reason });
        }
        if let Some(reason) = report.disturbed {
            return Err(Fault::Unsupervised {
                during: "start".into(),
                reason,
            });
        }
        if let (Some(reason), true) = (report.start_error, report.sandbox.layers.is_empty()) {
            return Err(Fault::Spawn {
                program: "a sandbox".into(),
                reason,
                hint: None,
            });
        }
        Ok(report.sandbox)
    }

    /// Tries in a sandbox what a plugin must not get done, and says what it was made of
    /// and which attempts succeeded.
    pub fn attempts(&self) -> Result<(SandboxReport, Vec<Attempt>), Fault> {
        let cannot = |reason: String| Fault::Spawn {
            program: "a sandbox".into(),
            reason,
            hint: None,
        };
        let targets = Targets::make().map_err(|error| cannot(error.to_string()))?;
        let launch = self.launch(Target::Attempts(targets.victims.clone()))?;
        let mut process = Process::start(&self.executable, &launch)?;
        let report = process.end(self.limits.startup);
        let mut answer = Vec::new();
        // All is there: the process has ended.
        let _ = process.stdout.read_to_end(&mut answer);
        let succeeded = serde_json::from_slice(&answer).map_err(|_| {
            cannot(
                report
                    .start_error
                    .unwrap_or_else(|| "what was tried in it gave no answer".into()),
            )
        })?;
        Ok((report.sandbox, succeeded))
    }

    fn open_process(&self, file: &PluginFile) -> Result<Session, Fault> {
        let launch = self.launch(file.target())?;
        let withheld = launch.grants.withheld.clone();
        let started = monotonic_ns();
        let process = Process::start(&self.executable, &launch)?;
        let mut client = Client::new(process, self.limits.clone());
        let called = introduce(&mut client, &self.limits);
        let answer = called.map_err(|fault| explain_start(fault, file, &client, &withheld))?;
        let InitializeResult {
            protocol_version,
            plugins,
            abi_version,
        } = read("initialize", &answer)?;
        if protocol_version != PROTOCOL_VERSION {
            return Err(protocol(
                "initialize",
                format!("it chose protocol {protocol_version}, which was not offered"),
            ));
        }
        let limits = self.limits.clone();
        Ok(Session {
            inner: Inner::Process(Box::new(client)),
            introduction: Introduction {
                contract: contract(file, abi_version),
                descriptors: plugins,
            },
            limits,
            environment: None,
            encoding: PathEncoding::default(),
            startup: Duration::from_nanos(monotonic_ns() - started),
        })
    }
}

/// Asks a plugin who it is.
fn introduce(client: &mut Client, limits: &Limits) -> Result<Reply, Fault> {
    let params = InitializeParams {
        protocol_versions: vec![PROTOCOL_VERSION],
        host: Peer {
            name: "fleetyard".into(),
            version: env!("CARGO_PKG_VERSION").into(),
        },
    };
    let deadline = Deadline::after(client.now_ns(), limits.startup);
    let expected = Expected {
        bytes: INTRODUCTION_BYTES,
        ..Expected::NO_PLAN
    };
    let figures = &mut nothing_but_figures;
    client.call("initialize", params, deadline, expected, figures)
}

/// The contract that the plugins of a file were built for.
fn contract(file: &PluginFile, abi_version: Option<[u16; 2]>) -> Contract {
    match file {
        PluginFile::Program(..) => Contract::Protocol(PROTOCOL_VERSION),
        PluginFile::Adapter(_) => Contract::Manifest(FORMAT),
        PluginFile::BuiltIn | PluginFile::Library(_) => {
            // The worker says it; one that does not has the host's own.
            let [major, minor] = abi_version.unwrap_or([c::ABI_MAJOR, c::ABI_MINOR]);
            Contract::CAbi(format!("{major}.{minor}"))
        }
    }
}

/// A program that dies at once has usually said why on standard error.
fn explain_start(fault: Fault, file: &PluginFile, client: &Client, withheld: &[PathBuf]) -> Fault {
    let shown = file.path().map_or("the built-in plugins".into(), |path| {
        path.display().to_string()
    });
    let (stderr, _) = client.stderr();
    let last = stderr
        .lines()
        .rev()
        .find(|line| !line.trim().is_empty())
        .unwrap_or_default();
    // What it names and may not read is what it lacks first of all.
    let lacks = withheld.first().map(|path| {
        let path = path.display();
        format!(
            "it was not given {path}, which is closed to others: `--allow-read {path}` gives it"
        )
    });
    match fault {
        Fault::Spawn { reason, hint, .. } => Fault::Spawn {
            program: shown,
            reason,
            hint: lacks.or(hint),
        },
        Fault::Exited { .. } | Fault::Crashed { .. } | Fault::TimedOut { .. } => Fault::Refused {
            reason: format!("{shown} is no plugin that speaks the protocol: it {fault}"),
            hint: lacks.or((!last.is_empty()).then(|| format!("its last words were: {last}"))),
        },
        other => other,
    }
}

fn protocol(during: &str, reason: impl Into<String>) -> Fault {
    Fault::Protocol {
        during: during.into(),
        reason: reason.into(),
    }
}

fn read<T: DeserializeOwned>(method: &str, answer: &Reply) -> Result<T, Fault> {
    result(method, &answer.result).map_err(|reason| protocol(method, reason))
}

/// In calls that ask for no plan, figures are nobody's, and a plan is a breach.
fn nothing_but_figures(notice: Notice) -> Result<(), String> {
    match notice {
        Notice::Incumbent { read, .. } => read.map(drop),
        Notice::Metric(_) => Ok(()),
    }
}

fn result<'a, T: Deserialize<'a>>(method: &str, answer: &'a str) -> Result<T, String> {
    message::payload(&format!("the result of `{method}`"), answer)
}

/// Asks something whose answer is short and no plan.
fn ask<L: Transport>(
    client: &mut Client<L>,
    method: &str,
    params: impl Serialize,
    deadline: Deadline,
) -> Result<Reply, Fault> {
    client.call(
        method,
        params,
        deadline,
        Expected::NO_PLAN,
        &mut nothing_but_figures,
    )
}

fn reported(method: &str, status: Status, message: Option<String>) -> Fault {
    let message = message.unwrap_or_else(|| "it did not say why".into());
    Fault::Reported {
        status,
        during: method.into(),
        message,
    }
}

fn to_fault(method: &str) -> impl Fn(Failure) -> Fault + '_ {
    move |failure| {
        if failure.broke_contract {
            return protocol(method, failure.message);
        }
        reported(method, failure.status, Some(failure.message))
    }
}

enum Inner<L: Transport = Process> {
    InProcess {
        library: Library,
        object: Option<Object>,
        log: Log,
        promises: Promises,
    },
    Process(Box<Client<L>>),
}

/// A running plugin.
pub struct Session {
    inner: Inner,
    introduction: Introduction,
    limits: Limits,
    environment: Option<SharedEnvironment>,
    /// The encoding in which the plugin that was made wants to read paths.
    encoding: PathEncoding,
    /// From its start until it had introduced itself.
    startup: Duration,
}

/// The calls that ask for a plan.
#[derive(Clone, Copy)]
enum Question<'a> {
    Plan,
    /// With what the planner left, if it left something.
    Recover(Option<&'a Plan>),
}

impl<'a> Question<'a> {
    fn method(self) -> &'static str {
        match self {
            Self::Plan => "plan",
            Self::Recover(_) => "recover",
        }
    }

    /// The plan that the planner left.
    fn left(self) -> Option<PlanRef<'a>> {
        match self {
            Self::Plan => None,
            Self::Recover(left) => left.map(Plan::as_ref),
        }
    }
}

/// A part of a request as text.
type Written = Option<Box<RawValue>>;

/// The time that a call took.
#[derive(Default)]
struct Timing {
    /// As the plugin says.
    claimed: Option<Duration>,
    round_trip: Option<Duration>,
    /// For how long of it the host handled messages.
    handled: Duration,
}

/// The budget of a call that begins then.
fn from(now_ns: u64, budget: &Budget) -> Budget {
    Budget {
        deadline_monotonic_ns: now_ns.saturating_add(budget.wall_ns),
        ..*budget
    }
}

impl Session {
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
        match &self.inner {
            Inner::InProcess { .. } => None,
            Inner::Process(client) => client.sandbox(),
        }
    }

    /// Makes one plugin. Its options were checked against its schema.
    pub fn create(
        &mut self,
        kind: Kind,
        id: &str,
        options: serde_json::Value,
    ) -> Result<(), Fault> {
        let made = self
            .introduction
            .descriptors
            .iter()
            .find(|d| d.kind == kind && d.id == id);
        self.encoding = made
            .map(|descriptor| descriptor.path_encoding)
            .unwrap_or_default();
        match &mut self.inner {
            Inner::InProcess {
                library,
                object,
                log,
                promises,
            } => {
                let collector = Collector::idle();
                if object.is_some() {
                    promises.around("destroy", || *object = None);
                }
                let options = options.to_string();
                let made = promises.around("create", || {
                    library.create(kind, id, Options::new(&options), &collector)
                });
                promises.settle();
                log.append(collector.into_log(), LOG_BYTES);
                *object = Some(made.map_err(to_fault("create"))?);
                Ok(())
            }
            Inner::Process(client) => {
                let params = CreateParams {
                    kind,
                    plugin: id.into(),
                    options,
                };
                let deadline = Deadline::after(client.now_ns(), self.limits.startup);
                let answer = ask(client, "create", params, deadline)?;
                succeeded("create", read("create", &answer)?)
            }
        }
    }

    /// Tells the plugin the map.
    pub fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
    ) -> Result<CallReport, Fault> {
        let written = self.inner.write("prepare", environment.as_ref())?;
        self.inner.begin(budget, self.limits.prepare_cpu);
        let budget = from(self.inner.now_ns(), budget);
        let started = monotonic_ns();
        match &mut self.inner {
            Inner::InProcess {
                object,
                log,
                promises,
                ..
            } => {
                let collector = Collector::idle();
                let result = promises.around("prepare", || {
                    let object = object.as_mut();
                    object
                        .and_then(|object| object.prepare(environment, &budget, &collector))
                        .unwrap_or_else(|| Err(wrong_object()))
                });
                promises.settle();
                log.append(collector.into_log(), LOG_BYTES);
                result.map_err(to_fault("prepare"))?;
            }
            Inner::Process(client) => {
                let deadline = Deadline::from(&budget);
                let params = PrepareParams {
                    environment: written,
                    budget,
                };
                let answer = ask(client, "prepare", params, deadline)?;
                succeeded("prepare", read("prepare", &answer)?)?;
            }
        }
        let wall = Duration::from_nanos(monotonic_ns() - started);
        let usage = self.inner.finish("prepare")?;
        self.environment = Some(SharedEnvironment::clone(environment));
        Ok(CallReport { wall, usage })
    }

    /// Asks a planner for a plan.
    pub fn plan(&mut self, instance: &Instance, budget: &Budget) -> PlanRun {
        self.solve(Question::Plan, instance, budget)
    }

    /// Asks a fail policy for a plan; `failed` is what the planner left.
    pub fn recover(
        &mut self,
        instance: &Instance,
        failed: Option<&Plan>,
        budget: &Budget,
    ) -> PlanRun {
        self.solve(Question::Recover(failed), instance, budget)
    }

    fn solve(&mut self, question: Question<'_>, instance: &Instance, budget: &Budget) -> PlanRun {
        let cpu = self.limits.cpu;
        let environment = self.environment.as_deref();
        let grid = environment.and_then(|environment| environment.grid());
        let encoding = self.encoding;
        self.inner
            .solve(question, grid, encoding, instance, budget, cpu)
    }

    /// Asks an instance generator for the next instance.
    pub fn generate(&mut self, state: &FleetState, budget: &Budget) -> Result<Instance, Fault> {
        let method = "generate";
        let written = self.inner.write(method, state)?;
        self.inner.begin(budget, self.limits.cpu);
        let budget = from(self.inner.now_ns(), budget);
        let missing = || protocol(method, "it claims success but submitted no instance");
        match &mut self.inner {
            Inner::InProcess {
                object: Some(Object::InstanceGenerator(generator)),
                log,
                promises,
                ..
            } => {
                let collector = Collector::idle();
                let result =
                    promises.around(method, || generator.generate(state, &budget, &collector));
                let collected = collector.into_inner();
                log.append(collected.log, LOG_BYTES);
                result.map_err(to_fault(method))?;
                collected.instance.ok_or_else(missing)
            }
            Inner::InProcess { .. } => Err(to_fault(method)(wrong_object())),
            Inner::Process(client) => {
                let deadline = Deadline::from(&budget);
                let params = GenerateParams {
                    state: written,
                    budget,
                };
                let expected = Expected {
                    bytes: message_bytes(state.cells.len()),
                    ..Expected::NO_PLAN
                };
                let figures = &mut nothing_but_figures;
                let answer = client.call(method, params, deadline, expected, figures)?;
                let GenerateResult {
                    status,
                    message,
                    instance,
                } = read(method, &answer)?;
                succeeded(method, Outcome { status, message })?;
                instance.ok_or_else(missing)
            }
        }
    }

    /// Asks an invocation policy whether to call the planner now.
    pub fn should_invoke(&mut self, status: &FleetStatus, limit: Duration) -> Result<bool, Fault> {
        let method = "should_invoke";
        let written = self.inner.write(method, status)?;
        match &mut self.inner {
            Inner::InProcess {
                object: Some(Object::InvocationPolicy(policy)),
                log,
                promises,
                ..
            } => {
                let collector = Collector::idle();
                let result = promises.around(method, || policy.should_invoke(status, &collector));
                log.append(collector.into_log(), LOG_BYTES);
                result.map_err(to_fault(method))
            }
            Inner::InProcess { .. } => Err(to_fault(method)(wrong_object())),
            Inner::Process(client) => {
                let deadline = Deadline::after(client.now_ns(), limit);
                let params = ShouldInvokeParams { status: written };
                let answer = ask(client, method, params, deadline)?;
                read(method, &answer).map(|ShouldInvokeResult { invoke }| invoke)
            }
        }
    }

    /// The parts of the host's process that the plugin did not leave as they were, so far. From
    /// here on
    /// all of it is as it was, where it could be put back.
    pub fn broken_promises(&mut self) -> &[BrokenPromise] {
        match &mut self.inner {
            Inner::InProcess { promises, .. } => {
                promises.settle();
                promises.broken()
            }
            Inner::Process(_) => &[],
        }
    }

    /// Ends the plugin; nothing of it is left running.
    pub fn close(&mut self) -> Closing {
        match &mut self.inner {
            Inner::InProcess {
                object,
                log,
                promises,
                ..
            } => {
                promises.around("destroy", || *object = None);
                promises.settle();
                Closing {
                    broken_promises: promises.broken().to_vec(),
                    usage: None,
                    fault: None,
                    stderr: String::new(),
                    stderr_dropped: 0,
                    log: log.take(),
                    stray_lines: 0,
                    sandbox: None,
                    over: None,
                    kill_latency: None,
                    environment: None,
                }
            }
            Inner::Process(client) => {
                let (report, fault) = client.close(self.limits.ending);
                let (stderr, stderr_dropped) = client.stderr();
                Closing {
                    usage: report.usage,
                    fault,
                    stderr,
                    stderr_dropped,
                    log: client.log.take(),
                    stray_lines: client.stray_lines,
                    sandbox: Some(report.sandbox),
                    over: report.over.filter(|_| report.killed),
                    kill_latency: report.kill_us.map(Duration::from_micros),
                    environment: report.environment,
                    broken_promises: Vec::new(),
                }
            }
        }
    }
}

impl<L: Transport> Inner<L> {
    fn now_ns(&self) -> u64 {
        match self {
            Self::InProcess { .. } => monotonic_ns(),
            Self::Process(client) => client.now_ns(),
        }
    }

    /// A call begins, with the limits of its budget.
    fn begin(&mut self, budget: &Budget, cpu: Option<Duration>) {
        if let Self::Process(client) = self {
            client.begin(CallLimits {
                cpu_ns: cpu.map_or(0, |cpu| cpu.as_nanos() as u64),
                memory_bytes: budget.memory_bytes,
            });
        }
    }

    /// It has ended: what it used, if somebody watched it to the end.
    fn finish(&mut self, method: &str) -> Result<CallUsage, Fault> {
        match self {
            Self::InProcess { .. } => Ok(CallUsage::default()),
            Self::Process(client) => client.finish(method),
        }
    }

    /// Something large as it goes to the plugin's process, written before the clock of a call
    /// begins; none where the plugin is called directly.
    fn write(&self, method: &str, what: &impl Serialize) -> Result<Written, Fault> {
        match self {
            Self::InProcess { .. } => Ok(None),
            Self::Process(_) => to_raw_value(what)
                .map(Some)
                .map_err(|error| Fault::host(format!("cannot write `{method}`"), error)),
        }
    }

    fn solve(
        &mut self,
        question: Question<'_>,
        grid: Option<&GridEnvironment>,
        encoding: PathEncoding,
        instance: &Instance,
        budget: &Budget,
        cpu: Option<Duration>,
    ) -> PlanRun {
        let method = question.method();
        let cells = grid.map_or(0, |grid| grid.rows.saturating_mul(grid.cols));
        let context = grid.map(|grid| PathContext {
            rows: grid.rows,
            cols: grid.cols,
            starts: &instance.starts,
            max_cells: plan_cells(instance, cells as usize),
        });
        let written = context.map_or(Ok((None, None)), |context| {
            let left = question.left().map(|plan| WritePaths {
                plan,
                context,
                encoding,
            });
            let left = left.map(|left| self.write(method, &left)).transpose()?;
            Ok((self.write(method, instance)?, left.flatten()))
        });
        self.begin(budget, cpu);
        let interruptible = Interruptible::begin();
        let host = HostTime::now();
        let began_ns = self.now_ns();
        let budget = from(began_ns, budget);
        let collector = Collector::new(instance, cells, &budget, began_ns);
        let mut timing = Timing::default();
        let called = match (context, written) {
            (Some(context), Ok(written)) => {
                let asked = (question, context, written);
                self.call_solve(asked, instance, &budget, &collector, &mut timing)
            }
            (None, _) => Err(reported(method, Status::InvalidInput, None)),
            (_, Err(fault)) => Err(fault),
        };
        let ended_ns = self.now_ns();
        drop(interruptible);
        let host = HostTime::now().since(host);
        let planning = Duration::from_nanos(ended_ns - collector.started_ns);
        // Whatever it answered: what nobody watched does not count.
        let (usage, called) = match self.finish(method) {
            Ok(usage) => (usage, called),
            Err(fault) => (CallUsage::default(), Err(fault)),
        };
        let over = match self {
            Self::InProcess { .. } => None,
            Self::Process(client) => client.over(),
        };
        // A library's plan is rejected after the deadline before it gets here; one
        // that claims success all the same is late, not silent.
        let overdue = ended_ns > budget.deadline_monotonic_ns;
        let Collected {
            incumbents,
            late,
            metrics,
            log,
            fault,
            ..
        } = collector.into_inner();
        if let Self::InProcess { log: kept, .. } = self {
            kept.append(log, LOG_BYTES);
        }
        let called = match (called, fault) {
            (Err(fault @ Fault::Unsupervised { .. }), _) => Err(fault),
            (Ok(_), Some(reason)) => Err(protocol(method, reason)),
            // It ended by itself because it was told to.
            (Ok(_), None)
                if matches!(self, Self::InProcess { .. }) && interrupted_by().is_some() =>
            {
                Err(Fault::Interrupted {
                    during: method.into(),
                })
            }
            (
                Ok(Outcome {
                    status: Status::Solved,
                    ..
                }),
                None,
            ) if incumbents.is_empty() && late == 0 && !overdue => {
                Err(protocol(method, "it claims `solved` but submitted no plan"))
            }
            (called, _) => called,
        };
        let mut run = PlanRun {
            termination: Termination::Completed,
            claim: None,
            message: None,
            fault: None,
            incumbents,
            late,
            metrics,
            planning,
            call: timing.claimed,
            round_trip: timing.round_trip,
            held_up: host.run_delay.map(|waited| waited + timing.handled),
            host,
            usage,
            stopped: false,
            limit: over.or((ended_ns > budget.deadline_monotonic_ns).then_some(Limit::Wall)),
        };
        match called {
            Ok(Outcome { status, message }) => {
                run.claim = Some(status);
                run.message = message;
                if run.incumbents.is_empty() && (late > 0 || status == Status::Solved) {
                    run.termination = Termination::TimedOut;
                }
                if matches!(
                    status,
                    Status::Unsupported | Status::InvalidInput | Status::InternalError
                ) {
                    let fault = reported(method, status, run.message.clone());
                    run.termination = Termination::from(&fault);
                    run.fault = Some(fault);
                }
            }
            Err(fault) => {
                run.stopped = fault.is_stop() && !matches!(self, Self::InProcess { .. });
                run.limit = fault.limit();
                run.termination = Termination::from(&fault);
                run.fault = Some(fault);
            }
        }
        run
    }

    fn call_solve(
        &mut self,
        (question, context, written): (Question<'_>, PathContext<'_>, (Written, Written)),
        instance: &Instance,
        budget: &Budget,
        collector: &Collector,
        timing: &mut Timing,
    ) -> Result<Outcome, Fault> {
        let method = question.method();
        let client = match self {
            Self::InProcess {
                object, promises, ..
            } => {
                let (result, taken_ns) = promises.around(method, || {
                    // What stands around the call is not the plugin's time.
                    let began_ns = monotonic_ns();
                    let result = match (object, question) {
                        (Some(Object::Planner(planner)), Question::Plan) => {
                            planner.plan(instance, budget, collector)
                        }
                        (Some(Object::FailPolicy(policy)), Question::Recover(failed)) => {
                            policy.recover(instance, failed.map(Plan::as_ref), budget, collector)
                        }
                        _ => Err(wrong_object()),
                    };
                    (result, monotonic_ns() - began_ns)
                });
                timing.round_trip = Some(Duration::from_nanos(taken_ns));
                return match result {
                    Ok(()) => Ok(Outcome {
                        status: Status::Solved,
                        message: None,
                    }),
                    Err(failure) if failure.broke_contract => Err(to_fault(method)(failure)),
                    Err(Failure {
                        status, message, ..
                    }) => Ok(Outcome {
                        status,
                        message: Some(message),
                    }),
                };
            }
            Self::Process(client) => client,
        };
        let mut notify = |notice: Notice| match notice {
            Notice::Incumbent { read, arrived_ns } => {
                let (plan, paths) = read?;
                collector.accept(plan, paths, arrived_ns)
            }
            Notice::Metric(metric) => {
                collector.metric(&metric.name, metric.value);
                Ok(())
            }
        };
        let deadline = Deadline::from(budget);
        let expected = Expected {
            paths: Some(context),
            ..Expected::NO_PLAN
        };
        let ((instance, left), budget) = (written, *budget);
        let answer = match question {
            Question::Plan => {
                let params = PlanParams { instance, budget };
                client.call(method, params, deadline, expected, &mut notify)?
            }
            Question::Recover(_) => {
                let params = RecoverParams {
                    instance,
                    budget,
                    failed_paths: left.as_deref(),
                };
                client.call(method, params, deadline, expected, &mut notify)?
            }
        };
        let Reply {
            result: text,
            paths: found,
            arrived_ns,
        } = answer;
        let (round_trip, handled) = client.round_trip();
        timing.round_trip = Some(round_trip);
        timing.handled = handled;
        let read = || -> Result<Outcome, String> {
            let PlanResult {
                status,
                message,
                paths,
                call_ns,
            } = result(method, &text)?;
            let took_ns = round_trip.as_nanos() as u64;
            if let Some(call_ns) = call_ns.filter(|call_ns| *call_ns > longest_call_ns(took_ns)) {
                return Err(format!(
                    "it claims to have worked for {:?} on a call of {round_trip:?}",
                    Duration::from_nanos(call_ns)
                ));
            }
            timing.claimed = call_ns.map(Duration::from_nanos);
            if let Some(paths) = paths {
                let (plan, paths) = expected.read(paths, found)?;
                collector.accept(plan, paths, arrived_ns)?;
            }
            Ok(Outcome { status, message })
        };
        read().map_err(|reason| client.condemn(method, protocol(method, reason)))
    }
}

fn wrong_object() -> Failure {
    Failure::new(
        Status::InvalidInput,
        "the call is not for a plugin of this kind",
    )
}

fn succeeded(method: &str, outcome: Outcome) -> Result<(), Fault> {
    match outcome.status {
        Status::Solved => Ok(()),
        status => Err(reported(method, status, outcome.message)),
    }
}

#[cfg(test)]
mod played;
