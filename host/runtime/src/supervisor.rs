//! The supervisor: one small process per session that owns the plugin's process
//! tree.
//!
//! The host re-executes itself with [`ARGUMENT`]. The supervisor makes itself the
//! reaper of orphans, starts the plugin (a program, or a fork of itself that
//! becomes the worker), and waits for whichever comes first: the plugin's main
//! process ends, or the host closes the control socket, on purpose or by dying.
//! Then it kills every descendant until none is left, reports exit status and
//! resource usage on the socket, and ends. Daemons that left their process group
//! or session are found all the same: an orphan's new parent is the supervisor.
//!
//! This is where a sandbox is locked before any code of the plugin runs.

use std::io::Write;
use std::os::fd::{AsRawFd, FromRawFd, OwnedFd, RawFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::Command;

use fleetyard_abi::wire::{self, Response};
use fleetyard_abi::{c, serve};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::process::{Pid, PidfdFlags, Signal, WaitOptions, kill_process, pidfd_open, wait};
use serde::{Deserialize, Serialize};

use crate::Fault;
use crate::adapter::Adapter;
use crate::library::Library;

/// First argument of a process that is a supervisor.
pub const ARGUMENT: &str = "__supervise";

/// Signals that a supervisor ignores.
const FOR_THE_HOST: [i32; 4] = [libc::SIGINT, libc::SIGTERM, libc::SIGHUP, libc::SIGQUIT];

/// What the supervisor starts.
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
}

/// What the supervisor says at the end.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Report {
    /// Exit code of the plugin's main process.
    pub code: Option<i32>,
    /// Signal that ended it.
    pub signal: Option<i32>,
    /// Whether the host asked for the end.
    pub killed: bool,
    /// Why the plugin could not be started.
    pub start_error: Option<String>,
    /// CPU time in user mode of the whole tree.
    pub user_us: u64,
    /// CPU time in the kernel of the whole tree.
    pub system_us: u64,
    /// Largest resident set of any process of the tree.
    pub max_rss_kb: u64,
}

/// Call first in `main`: becomes a supervisor and never returns when the process
/// was started as one. `built_in` are the entries that are linked in.
pub fn intercept(built_in: &'static [&'static c::PluginEntry]) {
    let mut arguments = std::env::args().skip(1);
    if arguments.next().as_deref() != Some(ARGUMENT) {
        return;
    }
    let (Some(target), Some(control)) = (arguments.next(), arguments.next()) else {
        eprintln!("{ARGUMENT} is how the host starts itself; it is not a command");
        std::process::exit(2);
    };
    let target = serde_json::from_str(&target).ok();
    let control = control.parse::<RawFd>().ok().filter(|fd| *fd > 2);
    match (target, control) {
        (Some(target), Some(control)) => {
            // SAFETY: the host opened this descriptor for the supervisor alone.
            let control = UnixStream::from(unsafe { OwnedFd::from_raw_fd(control) });
            supervise(&target, control, built_in)
        }
        _ => std::process::exit(2),
    }
}

fn supervise(
    target: &Target,
    mut control: UnixStream,
    built_in: &'static [&'static c::PluginEntry],
) -> ! {
    // SAFETY: a plain system call that makes orphans ours.
    unsafe { libc::prctl(libc::PR_SET_CHILD_SUBREAPER, 1) };
    // What the terminal, or `timeout`, sends to the whole process group is for the
    // host, which then closes the socket. A supervisor that died of it would leave
    // daemons of the plugin behind.
    for signal in FOR_THE_HOST {
        // SAFETY: ignoring a signal has no precondition.
        unsafe { libc::signal(signal, libc::SIG_IGN) };
    }
    let mut report = Report::default();
    match start(target, &control, built_in) {
        Ok(child) => {
            release_stdio();
            report.killed = wait_for_end(child, &control);
            kill_everybody(child, &mut report);
        }
        Err(error) => report.start_error = Some(error),
    }
    fill_usage(&mut report);
    if let Ok(text) = serde_json::to_vec(&report) {
        // A host that is gone needs no report.
        let _ = control.write_all(&text);
    }
    std::process::exit(0)
}

fn start(
    target: &Target,
    control: &UnixStream,
    built_in: &'static [&'static c::PluginEntry],
) -> Result<Pid, String> {
    match target {
        Target::Program(argv) => {
            let (program, arguments) = argv.split_first().ok_or("there is no program to start")?;
            let mut command = Command::new(program);
            command.args(arguments).process_group(0);
            // SAFETY: only async-signal-safe calls between fork and exec.
            unsafe {
                command.pre_exec(|| {
                    child_setup();
                    Ok(())
                });
            }
            let child = command.spawn().map_err(|error| error.to_string())?;
            Pid::from_raw(child.id() as i32).ok_or_else(|| "the child has no identifier".into())
        }
        Target::Library(_) | Target::BuiltIn | Target::Adapter(_) => {
            // SAFETY: this process has one thread, so the child may do anything.
            match unsafe { libc::fork() } {
                -1 => Err(std::io::Error::last_os_error().to_string()),
                0 => {
                    // SAFETY: the descriptor belongs to the parent's copy.
                    unsafe { libc::close(control.as_raw_fd()) };
                    // SAFETY: plain system call: a group of its own.
                    unsafe { libc::setpgid(0, 0) };
                    child_setup();
                    worker(target, built_in)
                }
                child => Pid::from_raw(child).ok_or_else(|| "the child has no identifier".into()),
            }
        }
    }
}

/// Runs in the plugin's process before any of its code.
fn child_setup() {
    // SAFETY: plain system calls on this process. The death signal is a
    // convenience for a supervisor that dies; ignored signals would be inherited.
    unsafe {
        libc::prctl(libc::PR_SET_PDEATHSIG, libc::SIGKILL);
        for signal in FOR_THE_HOST {
            libc::signal(signal, libc::SIG_DFL);
        }
    }
}

/// Becomes the worker: serves a library's plugins, or an adapter's, on private
/// descriptors.
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

/// Answers the host's first request, which is number 1, with a fault.
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
fn release_stdio() {
    if let Ok(null) = std::fs::OpenOptions::new()
        .read(true)
        .write(true)
        .open("/dev/null")
    {
        for descriptor in 0..3 {
            // SAFETY: both descriptors are open.
            unsafe { libc::dup2(null.as_raw_fd(), descriptor) };
        }
    }
}

/// Waits for the main process or the host; true when it was the host.
fn wait_for_end(child: Pid, control: &UnixStream) -> bool {
    let Ok(ended) = pidfd_open(child, PidfdFlags::empty()) else {
        return true;
    };
    loop {
        let mut waiting = [
            PollFd::new(&ended, PollFlags::IN),
            PollFd::new(control, PollFlags::IN | PollFlags::RDHUP),
        ];
        match poll(&mut waiting, None) {
            Ok(_) => {
                if !waiting[1].revents().is_empty() {
                    return true;
                }
                if !waiting[0].revents().is_empty() {
                    return false;
                }
            }
            Err(rustix::io::Errno::INTR) => {}
            Err(_) => return true,
        }
    }
}

/// Kills and reaps until this process has no children left.
fn kill_everybody(child: Pid, report: &mut Report) {
    loop {
        loop {
            match wait(WaitOptions::NOHANG) {
                Ok(Some((pid, status))) => {
                    if pid == child {
                        report.code = status.exit_status();
                        report.signal = status.terminating_signal();
                    }
                }
                Ok(None) => break,
                Err(rustix::io::Errno::INTR) => {}
                Err(_) => return,
            }
        }
        for descendant in descendants() {
            // Gone already is as good.
            let _ = kill_process(descendant, Signal::KILL);
        }
        // Killed processes need a moment to die.
        std::thread::sleep(std::time::Duration::from_micros(200));
    }
}

/// Every process below this one, by the parents in `/proc`.
fn descendants() -> Vec<Pid> {
    let mut parents: Vec<(i32, i32)> = Vec::new();
    for entry in std::fs::read_dir("/proc").into_iter().flatten().flatten() {
        let Some(pid) = entry
            .file_name()
            .to_str()
            .and_then(|name| name.parse::<i32>().ok())
        else {
            continue;
        };
        let Ok(stat) = std::fs::read_to_string(format!("/proc/{pid}/stat")) else {
            continue;
        };
        // The name, in parentheses, may contain anything; the parent is the
        // second field after it.
        let after_name = stat.rsplit(')').next().unwrap_or_default();
        if let Some(parent) = after_name
            .split_whitespace()
            .nth(1)
            .and_then(|p| p.parse().ok())
        {
            parents.push((pid, parent));
        }
    }
    let mut found = vec![std::process::id() as i32];
    let mut at = 0;
    while at < found.len() {
        let children = parents.iter().filter(|(_, parent)| *parent == found[at]);
        let children: Vec<i32> = children.map(|(pid, _)| *pid).collect();
        found.extend(children);
        at += 1;
    }
    found
        .into_iter()
        .skip(1)
        .filter_map(Pid::from_raw)
        .collect()
}

fn fill_usage(report: &mut Report) {
    // SAFETY: an all-zero structure is valid, and the call fills it in.
    let usage = unsafe {
        let mut usage: libc::rusage = std::mem::zeroed();
        libc::getrusage(libc::RUSAGE_CHILDREN, &raw mut usage);
        usage
    };
    let micros = |time: libc::timeval| time.tv_sec as u64 * 1_000_000 + time.tv_usec as u64;
    report.user_us = micros(usage.ru_utime);
    report.system_us = micros(usage.ru_stime);
    report.max_rss_kb = usage.ru_maxrss as u64;
}
