//! A supervised process: its pipes, its end, and what it used.

use std::ffi::OsStr;
use std::hash::{BuildHasher, RandomState};
use std::io::{self, ErrorKind, Read, Write};
use std::os::fd::{AsFd, AsRawFd, OwnedFd};
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::Path;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use fleetyard_abi::monotonic_ns;
use rustix::event::{PollFd, PollFlags, poll};
use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
use rustix::pipe::fcntl_setpipe_size;
use rustix::time::Timespec;

use crate::Fault;
use crate::confinement::child::patiently;
use crate::confinement::control::{ARGUMENT, Message, Order, Report};
use crate::confinement::sandbox::SandboxReport;
use crate::confinement::sandbox::launch::Launch;
use crate::confinement::state::{self, RUN};
use crate::confinement::transport::{Interest, Output, Transport};
use crate::fault::signal_name;
use crate::interrupt;
use crate::usage::{CallLimits, CallUsage, Limit};

/// The time that a supervisor may take to answer or to end everybody. It takes milliseconds;
/// one that somebody has stopped takes for ever.
const SILENCE: Duration = Duration::from_secs(30);

/// The time that one that has closed its socket may take to end by itself.
const ENDING: Duration = Duration::from_secs(1);

/// The longest wait, so that it can be written as the system wants it.
const LONGEST_WAIT_NS: u64 = 60_000_000_000;

/// True of the variables that say where programs are, where state is kept, and what plugins are
/// told anyway.
fn is_for_supervisors(name: &OsStr) -> bool {
    let known = ["PATH", "XDG_RUNTIME_DIR"];
    name.to_str()
        .is_some_and(|name| known.contains(&name) || name.starts_with("FLEETYARD_"))
}

/// A plugin's process under its supervisor.
pub(crate) struct Process {
    supervisor: Child,
    run: String,
    control: UnixStream,
    received: Vec<u8>,
    stdin: Option<ChildStdin>,
    pub(crate) stdout: ChildStdout,
    pub(crate) stderr: ChildStderr,
    sandbox: Option<SandboxReport>,
    /// Makes numbers that nobody can guess, and how many it has made.
    secret: (RandomState, u64),
    report: Option<Report>,
    /// The limit that the supervisor says is exceeded, while the plugin has its grace.
    over: Option<Limit>,
    used: Option<CallUsage>,
}

impl Process {
    /// Starts what is to be launched under a supervisor; `executable` calls
    /// [`intercept`](crate::supervisor::intercept) first of all.
    pub(crate) fn start(executable: &Path, launch: &Launch) -> Result<Self, Fault> {
        let spawn_fault = |error: &dyn std::fmt::Display| {
            Fault::host(format!("cannot start {}", executable.display()), error)
        };
        let (control, theirs) = UnixStream::pair().map_err(|error| spawn_fault(&error))?;
        let theirs = OwnedFd::from(theirs);
        let descriptor = theirs.as_raw_fd();
        let mut command = Command::new(executable);
        command
            .arg(ARGUMENT)
            .arg(descriptor.to_string())
            // A worker is a copy of the supervisor, so what this one is told can be read
            // by the plugin.
            .env_clear()
            .envs(std::env::vars_os().filter(|(name, _)| is_for_supervisors(name)))
            .env(RUN, &launch.run)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        // SAFETY: `fcntl` is async-signal-safe; only the child's copy of the
        // descriptor survives the exec.
        unsafe {
            command.pre_exec(move || {
                if libc::fcntl(descriptor, libc::F_SETFD, 0) < 0 {
                    return Err(std::io::Error::last_os_error());
                }
                Ok(())
            });
        }
        let spawned = patiently(
            || command.spawn(),
            |error| error.kind() == ErrorKind::WouldBlock,
        );
        let mut supervisor = spawned.map_err(|error| spawn_fault(&error))?;
        drop(theirs);
        let streams = (
            supervisor.stdin.take(),
            supervisor.stdout.take(),
            supervisor.stderr.take(),
        );
        let (Some(stdin), Some(stdout), Some(stderr)) = streams else {
            return Err(spawn_fault(&"the pipes are missing"));
        };
        let mut unready = None;
        for pipe in [stdin.as_fd(), stdout.as_fd(), stderr.as_fd()] {
            let made =
                fcntl_getfl(pipe).and_then(|flags| fcntl_setfl(pipe, flags | OFlags::NONBLOCK));
            unready = unready.or(made.err());
            // Larger pipes mean fewer wake-ups; refusal costs only speed.
            let _ = fcntl_setpipe_size(pipe, 1 << 20);
        }
        // What cannot be said in time is said to nobody.
        let _ = control.set_write_timeout(Some(SILENCE));
        let mut process = Self {
            supervisor,
            run: launch.run.clone(),
            control,
            received: Vec::new(),
            stdin: Some(stdin),
            stdout,
            stderr,
            sandbox: None,
            secret: (RandomState::new(), 0),
            report: None,
            over: None,
            used: None,
        };
        // A pipe that waits would outwait every deadline.
        if let Some(error) = unready {
            process.end(Duration::ZERO);
            return Err(Fault::host("cannot use the plugin's pipes", error));
        }
        process.say(launch);
        Ok(process)
    }

    /// Says something to the supervisor. One that is gone is noticed by its silence.
    fn say(&mut self, what: &impl serde::Serialize) {
        if let Ok(mut text) = serde_json::to_vec(what) {
            text.push(b'\n');
            match self.control.write_all(&text) {
                Err(error) if error.kind() != ErrorKind::BrokenPipe => {
                    self.abandon(format!("cannot tell the supervisor what to do: {error}"));
                }
                _ => {}
            }
        }
    }

    /// The host can go on no more: the supervisor ends everybody, and what it would say
    /// does not matter.
    fn abandon(&mut self, reason: String) {
        let _ = self.control.shutdown(std::net::Shutdown::Both);
        self.report.get_or_insert_with(|| Report {
            host_error: Some(reason),
            ..Report::default()
        });
    }

    /// Takes in what the supervisor has said already.
    fn catch_up(&mut self) {
        if self.report.is_none() && self.control.set_nonblocking(true).is_ok() {
            while self.hear(SILENCE) && self.report.is_none() {}
            let _ = self.control.set_nonblocking(false);
        }
    }

    /// Waits until the supervisor has said something or has ended. One that says nothing
    /// is lost.
    fn hear_until(&mut self, said: impl Fn(&Self) -> bool) {
        let until = Instant::now() + SILENCE;
        while !said(self) && self.report.is_none() {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                self.lose(Some("its supervisor does not answer any more"));
            } else {
                self.hear(left);
            }
        }
    }

    /// The supervisor is lost: ends it if need be, and what it leaves.
    fn lose(&mut self, why: Option<&str>) {
        let until = Instant::now() + ENDING;
        let mut status = self.supervisor.try_wait().ok().flatten();
        while why.is_none() && status.is_none() && Instant::now() < until {
            std::thread::sleep(Duration::from_millis(1));
            status = self.supervisor.try_wait().ok().flatten();
        }
        let ended = status.map(|status| (status.signal(), status.code().unwrap_or_default()));
        // It ignores the signals that it can, and dies of others by what is wrong in it.
        let was_killed = matches!(ended, Some((Some(libc::SIGKILL), _)));
        let sandbox = self.sandbox.as_ref();
        let from_outside = was_killed && sandbox.is_some_and(SandboxReport::keeps_signals_in);
        let reason = match ended {
            Some((Some(signal), _)) => format!(
                "its supervisor was ended by {} (signal {signal})",
                signal_name(signal)
            ),
            Some((None, code)) => {
                format!("its supervisor ended with code {code} and without a report")
            }
            None => {
                let _ = self.supervisor.kill();
                let _ = self.supervisor.wait();
                why.unwrap_or("its supervisor said goodbye and stayed")
                    .to_owned()
            }
        };
        state::end_run(&self.run);
        self.report = Some(Report {
            from_outside,
            ..Report::disturbed(reason)
        });
    }

    /// Waits up to `patience` for the next thing that the supervisor says; false when there
    /// was none in time, or when it is gone.
    fn hear(&mut self, patience: Duration) -> bool {
        let _ = self.control.set_read_timeout(Some(patience));
        let mut buffer = [0; 4096];
        let read = loop {
            match self.control.read(&mut buffer) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) if error.kind() == ErrorKind::WouldBlock => return false,
                Err(error) if error.kind() != ErrorKind::ConnectionReset => {
                    self.abandon(format!("cannot hear the supervisor: {error}"));
                    return false;
                }
                Ok(0) | Err(_) => break 0,
                Ok(read) => break read,
            }
        };
        if read == 0 {
            self.lose(None);
            return false;
        }
        self.received.extend_from_slice(&buffer[..read]);
        while let Some(end) = self.received.iter().position(|byte| *byte == b'\n') {
            let line: Vec<u8> = self.received.drain(..=end).collect();
            match serde_json::from_slice(&line) {
                Ok(Message::Started(sandbox)) => self.sandbox = Some(sandbox),
                Ok(Message::Used(used)) => self.used = Some(used),
                Ok(Message::Over(limit)) => self.over = Some(limit),
                Ok(Message::Ended(report)) => self.ended(*report),
                Err(_) => {}
            }
        }
        true
    }

    /// The supervisor has reported.
    fn ended(&mut self, mut report: Report) {
        let said = report.start_error.is_some() || report.host_error.is_some();
        if !said && report.sandbox.layers.is_empty() {
            let reason = "its supervisor says nothing of the sandbox";
            report.disturbed.get_or_insert(reason.into());
        }
        if report.disturbed.is_some() {
            // It may not have been able to end everybody.
            state::end_run(&self.run);
        }
        self.report = Some(report);
    }
}

impl Transport for Process {
    fn now_ns(&self) -> u64 {
        monotonic_ns()
    }

    fn secret(&mut self) -> u64 {
        let (state, made) = &mut self.secret;
        *made += 1;
        state.hash_one(made)
    }

    fn wait(&mut self, interest: Interest, most_ns: u64) {
        let most_ns = most_ns.min(LONGEST_WAIT_NS);
        let timeout = Timespec {
            tv_sec: (most_ns / 1_000_000_000) as i64,
            tv_nsec: (most_ns % 1_000_000_000) as i64,
        };
        let wakes = interrupt::wakes();
        let mut waiting = Vec::with_capacity(5);
        let hears = self.report.is_none();
        if hears {
            waiting.push(PollFd::new(&self.control, PollFlags::IN));
        }
        if interest.stdout {
            waiting.push(PollFd::new(&self.stdout, PollFlags::IN));
        }
        if interest.stderr {
            waiting.push(PollFd::new(&self.stderr, PollFlags::IN));
        }
        if let Some(stdin) = self.stdin.as_ref().filter(|_| interest.stdin) {
            waiting.push(PollFd::new(stdin, PollFlags::OUT));
        }
        if let Some(wakes) = &wakes {
            waiting.push(PollFd::new(wakes, PollFlags::IN));
        }
        // An interrupted poll is a spurious wake-up.
        let _ = poll(&mut waiting, Some(&timeout));
        let told = hears && !waiting[0].revents().is_empty();
        drop(waiting);
        if told {
            self.catch_up();
        }
    }

    fn interrupted(&self) -> bool {
        interrupt::interrupted_by().is_some()
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        match &mut self.stdin {
            Some(stdin) => stdin.write(bytes),
            None => Err(ErrorKind::BrokenPipe.into()),
        }
    }

    fn close_stdin(&mut self) {
        self.stdin = None;
    }

    fn read(&mut self, output: Output, buffer: &mut [u8]) -> io::Result<usize> {
        match output {
            Output::Stdout => self.stdout.read(buffer),
            Output::Stderr => self.stderr.read(buffer),
        }
    }

    fn begin(&mut self, limits: CallLimits, grace: Duration) {
        self.over = None;
        self.used = None;
        let grace_ns = grace.as_nanos() as u64;
        self.say(&Order::Begin { limits, grace_ns });
    }

    fn finish(&mut self) -> Option<CallUsage> {
        if self.report.is_none() {
            self.say(&Order::Finish);
            self.hear_until(|process| process.used.is_some());
        }
        let stopped = self.report.as_ref().and_then(|report| report.call);
        self.used.take().or(stopped)
    }

    fn over(&self) -> Option<Limit> {
        let report = self.report.as_ref();
        report.and_then(|report| report.over).or(self.over)
    }

    fn sandbox(&self) -> Option<&SandboxReport> {
        self.sandbox.as_ref()
    }

    fn give_up(&mut self, reason: String) {
        self.abandon(reason);
    }

    fn disturbed(&self) -> Option<String> {
        self.report.as_ref()?.disturbed.clone()
    }

    fn is_disturbed_from_outside(&self) -> bool {
        let report = self.report.as_ref();
        report.is_some_and(|report| report.from_outside)
    }

    fn end(&mut self, patience: Duration) -> Report {
        let until = Instant::now() + patience;
        while self.report.is_none() {
            let left = until.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            self.hear(left);
        }
        if self.report.is_none() {
            let decided = Instant::now();
            let _ = self.control.shutdown(std::net::Shutdown::Write);
            self.hear_until(|_| false);
            if let Some(report) = self.report.as_mut().filter(|report| report.killed) {
                // As the host sees it, the way to the supervisor and back included.
                report.kill_us = Some(decided.elapsed().as_micros() as u64);
            }
        }
        let _ = self.supervisor.wait();
        let lost = || Report::disturbed("its supervisor did not report".into());
        self.report.clone().unwrap_or_else(lost)
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.end(Duration::ZERO);
    }
}
