//! The runtime: starts plugins' files and opens sessions with them.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, OnceLock};
use std::time::Duration;

use fleetyard_abi::sdk::Catalog;
use fleetyard_abi::wire::{InitializeResult, PROTOCOL_VERSION};
use fleetyard_abi::{Descriptor, c, monotonic_ns};
use fleetyard_core::quoted;

use crate::confinement::process::Process;
use crate::confinement::promises::Promises;
use crate::confinement::sandbox::launch::Launch;
use crate::confinement::sandbox::{
    self, Attempt, Filter, Grants, Interpreter, Level, Policy, Profile, SandboxReport, Targets,
};
use crate::confinement::target::Target;
use crate::confinement::transport::Transport;
use crate::confinement::{python, selftest, state};
use crate::sessions::adapter::{FORMAT, declared};
use crate::sessions::client::Client;
use crate::sessions::in_process::InProcess;
use crate::sessions::limits::Limits;
use crate::sessions::out_of_process::introduced;
use crate::sessions::session::{Contract, Introduction, Session};
use crate::{Attach, Fault, Identity, Library, PluginFile};

/// Opens sessions.
#[derive(Debug, Clone)]
pub struct Runtime {
    executable: PathBuf,
    built_in: &'static [&'static c::PluginEntry],
    limits: Limits,
    /// All plugins that there are, once somebody asked.
    known: Arc<OnceLock<Vec<Descriptor>>>,
}

impl Runtime {
    /// For a program that calls [`intercept`](crate::supervisor::intercept) with
    /// the same entries first of all.
    pub fn new(
        built_in: &'static [&'static c::PluginEntry],
        mut limits: Limits,
    ) -> std::io::Result<Self> {
        state::reap_orphans();
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
            known: Arc::default(),
        })
    }

    /// All plugins that there are, looked for by the first who asks.
    pub(crate) fn all_plugins(&self, look: impl FnOnce() -> Vec<Descriptor>) -> &[Descriptor] {
        self.known.get_or_init(look)
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
        Ok(session.introduction().clone())
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
        if let Some((reason, hint)) = mismatch(file, attach) {
            return Err(Fault::Refused {
                reason: reason.into(),
                hint: Some(hint.into()),
            });
        }
        match attach {
            Attach::InProcess => self.open_in_process(file),
            Attach::Worker | Attach::Stdio | Attach::Command => self.open_process(file),
        }
    }

    fn open_in_process(&self, file: &PluginFile) -> Result<Session, Fault> {
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
        let attachment = InProcess::new(library, promises);
        Ok(Session::new(attachment, introduction, Duration::ZERO))
    }

    fn launch(&self, target: Target) -> Result<Launch, Fault> {
        let filter = self.filter();
        let grants = self.granted(&target, sandbox::python(&target))?;
        Ok(self.launched(target, grants, filter))
    }

    fn filter(&self) -> Filter {
        match self.limits.policy.level {
            Level::Strict => selftest::strictest(
                |filter| self.try_worker(filter),
                |target, filter| self.start_filtered(target, filter),
                self.limits.startup,
            ),
            Level::Auto | Level::None => Filter::of(Profile::DenyList),
        }
    }

    fn launched(&self, target: Target, grants: Grants, filter: Filter) -> Launch {
        let limits = &self.limits;
        let policy = limits.policy.clone();
        self.launch_granted(target, grants, policy, filter, limits.memory_bytes)
    }

    /// The files that a plugin may read, as its interpreter has them, if one is asked.
    fn granted(&self, target: &Target, interpreter: Option<Interpreter>) -> Result<Grants, Fault> {
        let Limits {
            policy, threads, ..
        } = &self.limits;
        let asked = interpreter.map(|interpreter| {
            let grants = Grants::to_ask(&interpreter, target, policy, *threads)?;
            let name = interpreter.program.to_string_lossy().into_owned();
            let command = [name, "-c".into(), python::QUESTION.into()];
            let launch = self.launched(Target::Program(command.into()), grants, self.filter());
            Ok(python::ask(&self.executable, &launch))
        });
        let python = asked.transpose()?.flatten();
        Grants::new(target, policy, *threads, python.as_ref(), declared)
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
    fn start_filtered(&self, target: Target, filter: Filter) -> Result<Process, Fault> {
        let policy = Policy {
            level: Level::Strict,
            ..Policy::default()
        };
        let grants = Grants::new(&target, &policy, self.limits.threads, None, declared)?;
        let launch = self.launch_granted(target, grants, policy, filter, 0);
        Process::start(&self.executable, &launch)
    }

    /// Lets a worker introduce itself under such a filter.
    fn try_worker(&self, filter: Filter) -> Result<(), Fault> {
        let process = self.start_filtered(Target::BuiltIn, filter)?;
        let mut client = Client::new(process, self.limits.clone());
        client.introduce()?;
        let (_, fault) = client.shut_down(self.limits.ending);
        fault.map_or(Ok(()), Err)
    }

    /// Paths that a plugin may read besides the system's files and what variables of the host name,
    /// without starting it: its own folder, its interpreter, what it declares. Places of a
    /// Python interpreter are found when it is started.
    pub fn readable(&self, file: &PluginFile) -> Result<Vec<PathBuf>, Fault> {
        let limits = &self.limits;
        let grants = Grants::new(&file.into(), &limits.policy, limits.threads, None, declared)?;
        Ok(grants.for_the_plugin())
    }

    /// All that decides what the plugins of a file do, as far as it is not the system's: it is what
    /// records, keys of trials and bundles know a plugin by. Nothing of the plugin's is started.
    pub fn identity(&self, file: &PluginFile) -> Result<Identity, Fault> {
        let policy = &self.limits.policy;
        if *file == PluginFile::BuiltIn {
            return file.identity(&policy.hidden, Vec::new());
        }
        let target = Target::from(file);
        // One that the user's path names says where it is installed; the plugin's own is a file of it.
        let interpreter = sandbox::python(&target).filter(|interpreter| interpreter.searched);
        let elsewhere = self
            .granted(&target, interpreter)?
            .elsewhere(&target, policy)?;
        file.identity(&policy.hidden, elsewhere)
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
        let launch = self.launch(file.into())?;
        let withheld = launch.grants.withheld.clone();
        let started = monotonic_ns();
        let process = Process::start(&self.executable, &launch)?;
        let mut client = Client::new(process, self.limits.clone());
        let called = client.introduce();
        let answer = called.map_err(|fault| explain_start(fault, file, &client, &withheld))?;
        let InitializeResult {
            plugins,
            abi_version,
            ..
        } = introduced(&answer)?;
        let introduction = Introduction {
            contract: contract(file, abi_version),
            descriptors: plugins,
        };
        let startup = Duration::from_nanos(monotonic_ns() - started);
        Ok(Session::new(client, introduction, startup))
    }
}

/// The reason why a file cannot be attached so, if it cannot, and a way out.
fn mismatch(file: &PluginFile, attach: Attach) -> Option<(&'static str, &'static str)> {
    match (file, attach) {
        (PluginFile::Program(..), Attach::Stdio)
        | (PluginFile::BuiltIn | PluginFile::Library(_), Attach::InProcess | Attach::Worker)
        | (PluginFile::Adapter(_), Attach::Command) => None,
        (PluginFile::Program(..), Attach::InProcess | Attach::Worker) => Some((
            "a program cannot be loaded as a library",
            "use `--attach stdio`",
        )),
        (PluginFile::BuiltIn | PluginFile::Library(_), Attach::Stdio) => Some((
            "a shared library does not speak JSON over stdio by itself",
            "use `--attach worker`",
        )),
        (PluginFile::Adapter(_), _) => Some((
            "a planner.toml describes a command-line solver",
            "use `--attach command`",
        )),
        (_, Attach::Command) => Some((
            "this is no planner.toml that describes a command-line solver",
            "leave `--attach` away to attach the plugin as what it is",
        )),
    }
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

/// The way to the SDK for a program in Python that does not find it.
fn lacks_sdk(last: &str, file: &PluginFile) -> Option<String> {
    let folder = file.path()?.parent()?;
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    last.contains("No module named 'fleetyard'").then(|| {
        let folder = quoted(&folder.display().to_string());
        format!("the Python SDK is not beside it: `fleetyard plugins sdk {folder}` writes it there")
    })
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
            hint: lacks
                .or_else(|| lacks_sdk(last, file))
                .or((!last.is_empty()).then(|| format!("its last words were: {last}"))),
        },
        other => other,
    }
}
