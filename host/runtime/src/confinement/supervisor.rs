//! The supervisor: one small process per session that owns the plugin's process
//! tree.
//!
//! The host re-executes itself with [`ARGUMENT`]. The supervisor starts the plugin (a
//! program, or a copy of itself that becomes the worker) in the [sandbox], watches
//! what it uses, and waits for whichever comes first: the plugin's main process ends,
//! a limit is exceeded, or the host closes the control socket, on purpose or by dying.
//! Then it ends every process of the plugin, reports on the socket how it went and
//! what was used, and ends. Daemons that left their process group or session are
//! found all the same: they cannot leave their namespace, and where there is none an
//! orphan's new parent is the supervisor.
//!
//! [sandbox]: crate::confinement::sandbox

use std::convert::Infallible;
use std::io::{ErrorKind, Read, Write};
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};
use std::os::unix::net::UnixStream;
use std::path::{Path, PathBuf};

use fleetyard_abi::wire::{self, Response};
use fleetyard_abi::{c, monotonic_ns, serve};
use fleetyard_core::Digest;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::process::{Resource, Rlimit, getrlimit};
use rustix::time::Timespec;
use serde::{Deserialize, Serialize};

use crate::Fault;
use crate::confinement::cgroup::{Cgroup, Places};
use crate::confinement::monitor::{CallLimits, CallUsage, Limit, Monitor, Standing, Usage};
use crate::confinement::sandbox;
use crate::confinement::sandbox::jail::{
    self, Ended, Jail, Launch, News, NotStarted, ScratchFolder,
};
use crate::confinement::sandbox::{Layer, SandboxReport, Victims};
use crate::confinement::state::{self, Registered};
use crate::measure::{affinity, pin};
use crate::sessions::adapter::Adapter;
use crate::sessions::library::Library;

/// First argument of a process that is a supervisor.
pub const ARGUMENT: &str = "__supervise";

/// Signals that a supervisor ignores.
const FOR_THE_HOST: [i32; 4] = [libc::SIGINT, libc::SIGTERM, libc::SIGHUP, libc::SIGQUIT];

/// The process that the supervisor starts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Target {
    /// A shared library, in a worker.
    Library(PathBuf),
    /// The plugins that are linked into the host, in a worker.
    BuiltIn,
    /// A program that speaks JSON over standard input and output.
    Program(Vec<String>),
    /// The solver that a manifest describes, started by a worker.
    Adapter(PathBuf),
    /// Nothing: to see which layers a machine grants.
    Nothing,
    /// Attempts at things that a plugin must not get done, by the host itself.
    Attempts(Victims),
}

impl Target {
    /// The plugin's file; of a program that is started by an interpreter, the script.
    pub(crate) fn file(&self) -> Option<PathBuf> {
        match self {
            Self::BuiltIn | Self::Nothing | Self::Attempts(_) => None,
            Self::Library(path) | Self::Adapter(path) => Some(path.clone()),
            Self::Program(argv) => {
                let named = argv.iter().take(2).find(|name| name.starts_with('/'));
                named.map(PathBuf::from)
            }
        }
    }
}

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
    fn failed(what: &str, error: &dyn std::fmt::Display) -> Self {
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

/// Call first in `main`: becomes a supervisor and never returns when the process
/// was started as one. `built_in` are the entries that are linked in.
///
/// In every role a file that grows beyond what is allowed is an error to be reported, not
/// the end of the process, until a plugin takes its place.
pub fn intercept(built_in: &'static [&'static c::PluginEntry]) {
    // SAFETY: ignoring a signal has no precondition.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
    let mut arguments = std::env::args().skip(1);
    let role = arguments.next();
    if role.as_deref() == Some(sandbox::INSIDE_ARGUMENT) {
        sandbox::enter_from_bwrap(arguments, &|target| worker(target, built_in));
    }
    if role.as_deref() != Some(ARGUMENT) {
        return;
    }
    let control = arguments.next().and_then(|text| text.parse::<RawFd>().ok());
    let Some(control) = control.filter(|fd| *fd > 2) else {
        eprintln!("{ARGUMENT} is how the host starts itself; it is not a command");
        std::process::exit(2);
    };
    // SAFETY: the host opened this descriptor for the supervisor alone.
    let stream = UnixStream::from(unsafe { OwnedFd::from_raw_fd(control) });
    // Whatever else was left open by whoever started the host is not for plugins.
    close_from(3, control);
    supervise(Control::new(stream), built_in)
}

/// Closes all descriptors from a number on, but for one.
fn close_from(first: RawFd, but: RawFd) {
    let close = |from: RawFd, to: u32| {
        // SAFETY: nobody in this young process owns any of them.
        unsafe { libc::syscall(libc::SYS_close_range, from, to, 0) }
    };
    if but > first {
        close(first, but as u32 - 1);
    }
    close(but + 1, u32::MAX);
}

/// The socket to the host.
struct Control {
    stream: UnixStream,
    received: Vec<u8>,
}

/// The host's wish, as the supervisor heard it.
enum Heard {
    Order(Order),
    Nothing,
    /// The host wants an end, or is gone.
    Stop,
    /// It cannot be heard.
    Deaf(std::io::Error),
}

impl Control {
    fn new(stream: UnixStream) -> Self {
        Self {
            stream,
            received: Vec::new(),
        }
    }

    /// A host that does not hear what it waits for would wait for ever.
    fn say(&mut self, message: &Message) -> std::io::Result<()> {
        let mut text = serde_json::to_vec(message)?;
        text.push(b'\n');
        self.stream.write_all(&text)
    }

    fn line(&mut self) -> Option<Vec<u8>> {
        let end = self.received.iter().position(|byte| *byte == b'\n')?;
        Some(self.received.drain(..=end).collect())
    }

    /// The first line, which has to come.
    fn launch(&mut self) -> Option<Launch> {
        loop {
            if let Some(line) = self.line() {
                return serde_json::from_slice(&line).ok();
            }
            self.read().ok()?.then_some(())?;
        }
    }

    /// Reads what is there, waiting for it if need be; false at the end.
    fn read(&mut self) -> std::io::Result<bool> {
        let mut buffer = [0; 4096];
        loop {
            match self.stream.read(&mut buffer) {
                Ok(0) => return Ok(false),
                Ok(read) => {
                    self.received.extend_from_slice(&buffer[..read]);
                    return Ok(true);
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                // A host that is gone did not read everything.
                Err(error) if error.kind() == ErrorKind::ConnectionReset => return Ok(false),
                Err(error) => return Err(error),
            }
        }
    }

    /// Call when there is something to be read, then until nothing is left.
    fn hear(&mut self, readable: bool) -> Heard {
        if readable {
            match self.read() {
                Ok(true) => {}
                Ok(false) => return Heard::Stop,
                Err(error) => return Heard::Deaf(error),
            }
        }
        match self.line() {
            Some(line) => serde_json::from_slice(&line).map_or(Heard::Stop, Heard::Order),
            None => Heard::Nothing,
        }
    }
}

fn supervise(mut control: Control, built_in: &'static [&'static c::PluginEntry]) -> ! {
    // SAFETY: a plain system call that makes orphans ours.
    let reaps = unsafe { libc::prctl(libc::PR_SET_CHILD_SUBREAPER, 1) } == 0;
    let reaps = reaps
        .then_some(())
        .ok_or_else(std::io::Error::last_os_error);
    // What the terminal, or `timeout`, sends to the whole process group is for the
    // host, which then closes the socket. A supervisor that died of it would leave
    // daemons of the plugin behind.
    for signal in FOR_THE_HOST {
        // SAFETY: ignoring a signal has no precondition.
        unsafe { libc::signal(signal, libc::SIG_IGN) };
    }
    let allowed = Allowed::now();
    let Some(launch) = control.launch() else {
        std::process::exit(2)
    };
    // Before anybody else is started.
    state::mark(&launch.run);
    let report = match reaps {
        Ok(()) => run(&launch, &mut control, &allowed, built_in),
        Err(error) => Report::failed("orphans of a plugin cannot be found", &error),
    };
    // A host that is gone needs to hear nothing.
    let _ = control.say(&Message::Ended(Box::new(report)));
    std::process::exit(0)
}

fn run(
    launch: &Launch,
    control: &mut Control,
    allowed: &Allowed,
    built_in: &'static [&'static c::PluginEntry],
) -> Report {
    let no_scratch = |error| Report::failed("there is no scratch folder for it", &error);
    let places = Places::of(&launch.run);
    let scratch = match ScratchFolder::path_of(&launch.run) {
        Ok(path) => path,
        Err(error) => return no_scratch(error),
    };
    // From here on there is something to be removed.
    let registered = Registered::write(&launch.run, &scratch, places.folders());
    let scratch = match ScratchFolder::create(scratch) {
        Ok(scratch) => scratch,
        Err(error) => return no_scratch(error),
    };
    // Inherited by everybody who is started from here, until this process goes back to
    // where the host is. Where it is refused, the record's load shows who else was there.
    let own = affinity(None);
    if let Some(cpus) = &launch.cpus {
        let _ = pin(None, cpus);
    }
    let become_plugin = || -> Infallible { worker(&launch.target, built_in) };
    let started = jail::start(launch, scratch.path(), &places, &become_plugin);
    if let (Ok(own), Some(_)) = (own, &launch.cpus) {
        let _ = pin(None, &own);
    }
    let jail = match started {
        Ok(jail) => jail,
        Err(NotStarted {
            report,
            reason,
            by_policy,
        }) => {
            drop(scratch);
            return Report {
                start_error: by_policy.then(|| reason.clone()),
                host_error: (!by_policy).then_some(reason),
                sandbox: report,
                ..Report::default()
            };
        }
    };
    release_stdio();
    let _ = control.say(&Message::Started(jail.report.clone()));
    let report = watch(launch, control, allowed, &jail);
    // The note goes last: what could not be removed is found by it.
    drop((jail, scratch));
    drop(registered);
    report
}

/// The limits of this process when it began. A process that may set the limits of others can keep a
/// supervisor from reading and from counting.
#[derive(PartialEq, Eq)]
struct Allowed(Vec<Rlimit>);

/// Without these it cannot work, or not in time.
const NEEDED: [(Resource, &str); 7] = [
    (Resource::Cpu, "processor time"),
    (Resource::Nofile, "open files"),
    (Resource::Fsize, "sizes of files"),
    (Resource::As, "address space"),
    (Resource::Data, "data"),
    (Resource::Stack, "stack"),
    (Resource::Nproc, "processes"),
];

impl Allowed {
    fn now() -> Self {
        Self(
            NEEDED
                .iter()
                .map(|(resource, _)| getrlimit(*resource))
                .collect(),
        )
    }

    /// The change that somebody made since, if one was made.
    fn changed(&self) -> Option<String> {
        let now = Self::now();
        let pairs = self.0.iter().zip(&now.0).zip(NEEDED);
        let mut changed = pairs.filter(|((before, now), _)| before != now);
        let (_, (_, name)) = changed.next()?;
        Some(format!("somebody changed its supervisor's limit of {name}"))
    }
}

/// Watches the plugin to its end.
fn watch(launch: &Launch, control: &mut Control, allowed: &Allowed, jail: &Jail) -> Report {
    let policy = &launch.policy;
    let standing = Standing {
        processes: u64::from(policy.processes),
        disk_bytes: policy.disk_bytes,
        files: policy.files,
        own_disk: jail.report.has(Layer::MountNamespace),
        network: policy.network,
    };
    let mut monitor = Monitor::new(standing, launch.memory_bytes);
    let mut report = Report {
        sandbox: jail.report.clone(),
        environment: Some(jail.environment),
        ..Report::default()
    };
    let mut grace_ns = 0;
    // When a plugin that was told to stop has to have stopped.
    let mut until = None;
    let ended: Option<Ended> = loop {
        let pause = monitor.pause();
        let timeout = Timespec {
            tv_sec: pause.as_secs() as i64,
            tv_nsec: i64::from(pause.subsec_nanos()),
        };
        let mut waiting = [
            PollFd::new(&control.stream, PollFlags::IN | PollFlags::RDHUP),
            PollFd::from_borrowed_fd(jail.link(), PollFlags::IN),
        ];
        let (asked, told) = match poll(&mut waiting, Some(&timeout)) {
            Ok(_) => (
                !waiting[0].revents().is_empty(),
                !waiting[1].revents().is_empty(),
            ),
            Err(Errno::INTR) => (false, false),
            Err(error) => {
                let what = format!("its supervisor cannot wait any more: {error}");
                report.disturbed.get_or_insert(what);
                (false, false)
            }
        };
        if report.disturbed.is_none() {
            report.disturbed = allowed.changed();
        }
        // What the plugin did comes before what the host wants: a crash is a crash
        // also when the host has just lost its patience.
        if told {
            match jail.hear() {
                Ok(News::Ended(ended)) => {
                    jail.bury();
                    break Some(ended);
                }
                Ok(News::CannotStart(reason)) => report.start_error = Some(reason),
                Ok(News::HostFailed(reason)) => report.host_error = Some(reason),
                Ok(News::Other) => {}
                Err(jail::Gone) => {
                    jail.bury();
                    if !jail.cgroup.as_ref().is_some_and(Cgroup::out_of_memory) {
                        let what = "somebody ended the first process of its sandbox";
                        report.disturbed.get_or_insert(what.into());
                    }
                    break None;
                }
            }
        }
        let mut stop = report.disturbed.is_some() || report.host_error.is_some();
        // Whoever cannot count says nothing of what was used.
        let mut heard = if stop {
            Heard::Nothing
        } else {
            control.hear(asked)
        };
        loop {
            match heard {
                Heard::Order(Order::Begin {
                    limits,
                    grace_ns: grace,
                }) => {
                    grace_ns = grace;
                    until = None;
                    monitor.begin(jail, limits);
                }
                Heard::Order(Order::Finish) => {
                    let used = monitor.finish(jail);
                    if let Err(error) = control.say(&Message::Used(used)) {
                        failed(&mut report, "the supervisor cannot answer", &error);
                        stop = true;
                    }
                    until = None;
                }
                Heard::Deaf(error) => {
                    failed(&mut report, "the supervisor cannot hear the host", &error);
                    stop = true;
                    break;
                }
                Heard::Nothing => break,
                Heard::Stop => {
                    stop = true;
                    break;
                }
            }
            heard = control.hear(false);
        }
        if !stop && let Some(limit) = monitor.look(jail) {
            let now = monotonic_ns();
            report.over.get_or_insert(limit);
            if limit == Limit::Cpu && grace_ns > 0 {
                // A host that does not hear it in time hears it in the report.
                if until.is_none() {
                    let _ = control.say(&Message::Over(limit));
                }
                stop = now >= *until.get_or_insert(now.saturating_add(grace_ns));
            } else {
                stop = true;
            }
        }
        if stop {
            report.killed = true;
            report.call = Some(monitor.finish(jail));
            let decided = monotonic_ns();
            let ended = jail.end();
            report.kill_us = Some((monotonic_ns() - decided) / 1000);
            break ended;
        }
    };
    // The kernel may have stopped the plugin before we looked.
    let by_kernel = match ended.and_then(|ended| ended.signal) {
        _ if jail.cgroup.as_ref().is_some_and(Cgroup::out_of_memory) => Some(Limit::Memory),
        _ if jail.cgroup.as_ref().is_some_and(Cgroup::out_of_processes) => Some(Limit::Processes),
        Some(libc::SIGXFSZ) => Some(Limit::Disk),
        Some(_) => None,
        _ => monitor.last_look(jail),
    };
    if report.over.is_none() && by_kernel.is_some() {
        report.over = by_kernel;
        report.killed = true;
    }
    report.code = ended.and_then(|ended| ended.code);
    report.signal = ended.and_then(|ended| ended.signal);
    report.usage = Some(monitor.usage(jail, ended.as_ref()));
    report
}

/// The supervisor can go on no more, for no fault of the plugin.
fn failed(report: &mut Report, what: &str, error: &dyn std::fmt::Display) {
    report
        .host_error
        .get_or_insert_with(|| format!("{what}: {error}"));
}

/// Runs in the plugin's process before any of its code.
pub(crate) fn child_setup() -> std::io::Result<()> {
    // SAFETY: plain system calls on this process. Ignored and blocked signals would
    // be inherited, and so would the host's terminal.
    unsafe {
        // Who may signal a group must not be in the host's.
        if libc::setsid() < 0 {
            return Err(std::io::Error::last_os_error());
        }
        for signal in FOR_THE_HOST.into_iter().chain([libc::SIGXFSZ]) {
            libc::signal(signal, libc::SIG_DFL);
        }
        let mut none: libc::sigset_t = std::mem::zeroed();
        libc::sigemptyset(&raw mut none);
        libc::sigprocmask(libc::SIG_SETMASK, &raw const none, std::ptr::null_mut());
    }
    Ok(())
}

/// Becomes the worker: serves a library's plugins on private descriptors.
fn worker(target: &Target, built_in: &'static [&'static c::PluginEntry]) -> ! {
    let (input, output) = match serve::private_stdio() {
        Ok(streams) => streams,
        Err(error) => {
            eprintln!("cannot set up the worker's streams: {error}");
            std::process::exit(1);
        }
    };
    let input = std::io::BufReader::with_capacity(1 << 16, input);
    let gone = || std::process::exit(0);
    let library = match target {
        Target::Adapter(path) => {
            match Adapter::open(path) {
                Ok(adapter) => serve::serve(&adapter, input, output, gone),
                Err(fault) => refuse(&fault, output),
            }
            std::process::exit(0)
        }
        Target::Library(path) => Library::open(path),
        _ => Library::from_entries(built_in),
    };
    match library {
        Ok(library) => {
            serve::serve(&library, input, output, gone);
            library.deinit();
        }
        Err(fault) => refuse(&fault, output),
    }
    std::process::exit(0)
}

/// Answers the host's first request, which is number 1, by a fault that explains
/// itself.
fn refuse(fault: &Fault, mut output: std::fs::File) {
    let hint = fault
        .hint()
        .map(|hint| format!("\n{hint}"))
        .unwrap_or_default();
    let answer = Response::error(Some(1), wire::REFUSED, format!("{fault}{hint}"));
    // A host that is gone needs no answer.
    let _ = output.write_all(&wire::line(&answer));
}

/// The pipes belong to the plugin: without this the host would never see them
/// close.
pub(crate) fn release_stdio() {
    match std::fs::OpenOptions::new()
        .read(true)
        .write(true)
        .open(Path::new("/dev/null"))
    {
        Ok(null) => {
            for descriptor in 0..3 {
                // SAFETY: both descriptors are open.
                unsafe { libc::dup2(null.as_raw_fd(), descriptor) };
            }
        }
        Err(_) => {
            for descriptor in 0..3 {
                // SAFETY: nobody uses them from here on.
                unsafe { libc::close(descriptor) };
            }
        }
    }
}
