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
use std::os::fd::{FromRawFd, OwnedFd, RawFd};
use std::os::unix::net::UnixStream;

use fleetyard_abi::monotonic_ns;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use rustix::time::Timespec;

use crate::confinement::cgroup::{Cgroup, Places};
use crate::confinement::child::{FOR_THE_HOST, release_stdio};
use crate::confinement::control::{ARGUMENT, Message, Order, Report};
use crate::confinement::monitor::{Monitor, Standing};
use crate::confinement::sandbox::jail::{self, Ended, Jail, News, NotStarted, ScratchFolder};
use crate::confinement::sandbox::launch::Launch;
use crate::confinement::sandbox::{self, Layer};
use crate::confinement::state::{self, Registered};
use crate::confinement::target::Target;
use crate::measure::{affinity, pin};
use crate::usage::Limit;

/// Becomes a supervisor and never returns when the process was started as one;
/// `become_plugin` makes a copy of it a worker.
///
/// In every role a file that grows beyond what is allowed is an error to be reported, not
/// the end of the process, until a plugin takes its place.
pub(crate) fn intercept(become_plugin: &dyn Fn(&Target) -> Infallible) {
    // SAFETY: ignoring a signal has no precondition.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
    let mut arguments = std::env::args().skip(1);
    let role = arguments.next();
    if role.as_deref() == Some(sandbox::INSIDE_ARGUMENT) {
        sandbox::enter_from_bwrap(arguments, become_plugin);
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
    supervise(Control::new(stream), become_plugin)
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

fn supervise(mut control: Control, become_plugin: &dyn Fn(&Target) -> Infallible) -> ! {
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
    // What a host needs more is not for plugins, also where nothing else is taken from them.
    let files = getrlimit(Resource::Nofile);
    let _ = setrlimit(
        Resource::Nofile,
        Rlimit {
            current: files.current.map(|current| current.min(USUAL_FILES)),
            ..files
        },
    );
    let allowed = Allowed::now();
    let Some(launch) = control.launch() else {
        std::process::exit(2)
    };
    // Before anybody else is started.
    state::mark(&launch.run);
    let report = match reaps {
        Ok(()) => run(&launch, &mut control, &allowed, become_plugin),
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
    become_plugin: &dyn Fn(&Target) -> Infallible,
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
    let started = jail::start(launch, scratch.path(), &places, &|| {
        become_plugin(&launch.target)
    });
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
                sandbox: *report,
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

/// The open files that a process usually may have.
const USUAL_FILES: u64 = 1024;

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
