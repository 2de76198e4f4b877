//! The host's side of the JSON wire, over a supervised process.
//!
//! One thread, one `poll`: it writes the request, reads standard output and
//! error as they come, and watches the deadline. Every byte that arrives is
//! hostile.

use std::io::{ErrorKind, Read, Write};
use std::os::fd::AsFd;
use std::time::Duration;

use fleetyard_abi::wire::{self, CancelParams, LogParams, MetricParams, Request, RpcError};
use fleetyard_abi::{Budget, LogLevel, monotonic_ns};
use rustix::event::{PollFd, PollFlags, poll};
use rustix::time::Timespec;
use serde::Serialize;
use serde_json::value::RawValue;

use crate::Fault;
use crate::log::Log;
use crate::message::{self, Message};
use crate::monitor::{CallLimits, CallUsage, Limit};
use crate::process::Process;
use crate::sandbox::Level;
use crate::session::Limits;
use crate::supervisor::Report;

/// How often a pipe is read before the deadline is looked at again, so that a
/// flood cannot hide it.
const ROUNDS: usize = 64;

/// How long a process that closed its output has to end by itself.
const ENDING: Duration = Duration::from_millis(500);

/// What a plugin says while a call is running.
pub(crate) enum Notice<'a> {
    /// A plan, its paths still as text, and when its last byte arrived.
    Incumbent {
        paths: &'a RawValue,
        arrived_ns: u64,
    },
    /// A figure.
    Metric(MetricParams),
}

/// A connection to a plugin.
pub(crate) struct Client {
    process: Process,
    limits: Limits,
    next_id: u64,
    unsent: Vec<u8>,
    /// Bytes of `unsent` that were written already.
    sent: usize,
    received: Vec<u8>,
    /// Bytes of `received` that were handled already. They are dropped many lines
    /// at a time: dropping each line's would take time quadratic in a flood.
    handled: usize,
    /// Where in `received` the search for the next newline goes on.
    searched: usize,
    /// In the middle of a line that is too long to be kept and is no message.
    skipping: bool,
    stray_bytes: u64,
    pub(crate) stray_lines: u64,
    pub(crate) log: Log,
    stderr: Tail,
    /// Of the call that is running, or of the last one.
    call: CallLimits,
    stdout_open: bool,
    stderr_open: bool,
    /// When the last request was about to be written, and when the last bytes arrived.
    asked_ns: u64,
    arrived_ns: u64,
    /// How long messages were handled since then.
    handled_ns: u64,
    /// Once broken, always broken.
    fault: Option<Fault>,
}

/// The first and the last of what a plugin wrote to standard error.
#[derive(Default)]
struct Tail {
    kept: Vec<u8>,
    dropped: u64,
}

impl Tail {
    /// Bytes so far, kept or not.
    fn total(&self) -> u64 {
        self.dropped + self.kept.len() as u64
    }

    fn push(&mut self, bytes: &[u8], limit: usize) {
        self.kept.extend_from_slice(bytes);
        if self.kept.len() > limit {
            let surplus = self.kept.len() - limit;
            self.kept.drain(..surplus);
            self.dropped += surplus as u64;
        }
    }
}

/// When a call must have returned.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Deadline {
    /// On the monotonic clock.
    pub(crate) at_ns: u64,
    /// The length of the budget, for messages: what is left of it when the request
    /// is sent is a little less.
    pub(crate) limit: Duration,
}

impl Deadline {
    pub(crate) fn after(limit: Duration) -> Self {
        let at_ns = monotonic_ns().saturating_add(limit.as_nanos() as u64);
        Self { at_ns, limit }
    }
}

impl From<&Budget> for Deadline {
    fn from(budget: &Budget) -> Self {
        Self {
            at_ns: budget.deadline_monotonic_ns,
            limit: Duration::from_nanos(budget.wall_ns),
        }
    }
}

/// What a call is waited for.
struct Wait<'a> {
    id: u64,
    method: &'a str,
    deadline_ns: u64,
    limit_ms: u64,
    /// Longest message meanwhile.
    line_bytes: usize,
}

impl Client {
    pub(crate) fn new(process: Process, limits: Limits) -> Self {
        // Until a call has limits of its own.
        let call = CallLimits {
            cpu_ns: 0,
            memory_bytes: limits.memory_bytes,
        };
        Self {
            process,
            limits,
            next_id: 1,
            unsent: Vec::new(),
            sent: 0,
            received: Vec::new(),
            handled: 0,
            searched: 0,
            skipping: false,
            stray_bytes: 0,
            stray_lines: 0,
            log: Log::default(),
            stderr: Tail::default(),
            call,
            stdout_open: true,
            stderr_open: true,
            asked_ns: 0,
            arrived_ns: 0,
            handled_ns: 0,
            fault: None,
        }
    }

    /// The next call has limits of its own, which count from here.
    pub(crate) fn begin(&mut self, call: CallLimits) {
        self.call = call;
        self.process.begin(call, self.limits.grace);
    }

    /// What was used since then, if somebody watched to the end.
    pub(crate) fn finish(&mut self, method: &str) -> Result<CallUsage, Fault> {
        let used = self.process.finish();
        match self.unsupervised(method) {
            Some(fault) => {
                self.fault = Some(fault.clone());
                Err(fault)
            }
            None => Ok(used.unwrap_or_default()),
        }
    }

    /// Says so when the supervisor is gone or could not do its work. It comes before all
    /// that the plugin did: nobody held it to anything.
    fn unsupervised(&self, method: &str) -> Option<Fault> {
        self.process.disturbed().map(|reason| Fault::Unsupervised {
            during: method.to_owned(),
            reason: reason.to_owned(),
        })
    }

    /// Ends the process for a fault; which one it is when that is done.
    fn stop(&mut self, method: &str, fault: Fault) -> Fault {
        self.process.end(Duration::ZERO);
        self.drain_stderr();
        self.unsupervised(method).unwrap_or(fault)
    }

    /// Of the call that was answered last: from its request, ready to be written, until the
    /// last byte of its answer had arrived, and for how long of it messages were handled, in
    /// which nothing is read.
    pub(crate) fn round_trip(&self) -> (Duration, Duration) {
        let took_ns = self.arrived_ns.saturating_sub(self.asked_ns);
        (
            Duration::from_nanos(took_ns),
            Duration::from_nanos(self.handled_ns),
        )
    }

    /// The limit that the supervisor found exceeded.
    pub(crate) fn over(&self) -> Option<Limit> {
        self.process.over()
    }

    /// Sends a request and waits for its answer, until the deadline plus the
    /// grace. After a fault, unless the plugin reported it, nothing of the process
    /// is left.
    pub(crate) fn call<P: Serialize>(
        &mut self,
        method: &str,
        params: P,
        deadline: Deadline,
        notice: &mut dyn FnMut(Notice<'_>) -> Result<(), String>,
    ) -> Result<String, Fault> {
        if let Some(fault) = &self.fault {
            return Err(fault.clone());
        }
        let id = self.next_id;
        self.next_id += 1;
        self.unsent
            .extend_from_slice(&wire::line(&Request::new(id, method, params)));
        let wait = Wait {
            id,
            method,
            deadline_ns: deadline.at_ns,
            limit_ms: deadline.limit.as_millis() as u64,
            line_bytes: match method {
                "initialize" => self.limits.introduction_bytes,
                _ => self.limits.line_bytes,
            },
        };
        let answer = self.wait(&wait, notice);
        if let Err(fault) = &answer
            && !fault.is_survivable()
        {
            self.fault = Some(fault.clone());
        }
        answer
    }

    fn wait(
        &mut self,
        wait: &Wait<'_>,
        notice: &mut dyn FnMut(Notice<'_>) -> Result<(), String>,
    ) -> Result<String, Fault> {
        let grace_ns = self.limits.grace.as_nanos() as u64;
        let mut cancelled = false;
        self.handled_ns = 0;
        self.asked_ns = monotonic_ns();
        let mut began = self.asked_ns;
        loop {
            if let Some(fault) = self.unsupervised(wait.method) {
                self.drain_stderr();
                return Err(fault);
            }
            if let Some(answer) = self.take_answer(wait, notice)? {
                return Ok(answer);
            }
            let now = monotonic_ns();
            self.handled_ns += now - began;
            if now >= wait.deadline_ns.saturating_add(grace_ns) {
                let (during, limit_ms) = (wait.method.to_owned(), wait.limit_ms);
                return Err(self.stop(wait.method, Fault::TimedOut { during, limit_ms }));
            }
            // With a grace, the supervisor says first that a limit is exceeded.
            let told = now >= wait.deadline_ns || self.process.over().is_some();
            if told && !cancelled {
                cancelled = true;
                let params = CancelParams { id: wait.id };
                self.unsent
                    .extend_from_slice(&wire::line(&Request::notification("$/cancel", params)));
            }
            if !self.stdout_open {
                return Err(self.ended(wait.method));
            }
            let until = if now >= wait.deadline_ns {
                wait.deadline_ns.saturating_add(grace_ns)
            } else {
                wait.deadline_ns
            };
            self.poll_once(until - now);
            began = monotonic_ns();
        }
    }

    /// Reads and writes what can be read and written now, after waiting up to
    /// `wait_ns`.
    fn poll_once(&mut self, wait_ns: u64) {
        // A minute at most, so that the sum below cannot overflow.
        let wait_ns = wait_ns.min(60_000_000_000);
        let timeout = Timespec {
            tv_sec: (wait_ns / 1_000_000_000) as i64,
            tv_nsec: (wait_ns % 1_000_000_000) as i64,
        };
        let stdin = self
            .process
            .stdin
            .as_ref()
            .filter(|_| !self.unsent.is_empty());
        let mut waiting = Vec::with_capacity(4);
        let control = self.process.control();
        let has_control = control.is_some();
        waiting.extend(control.map(|fd| PollFd::from_borrowed_fd(fd, PollFlags::IN)));
        if self.stdout_open {
            waiting.push(PollFd::new(&self.process.stdout, PollFlags::IN));
        }
        if self.stderr_open {
            waiting.push(PollFd::new(&self.process.stderr, PollFlags::IN));
        }
        if let Some(stdin) = stdin {
            waiting.push(PollFd::from_borrowed_fd(stdin.as_fd(), PollFlags::OUT));
        }
        // An interrupted poll is a spurious wake-up.
        let _ = poll(&mut waiting, Some(&timeout));
        let told = has_control && !waiting[0].revents().is_empty();
        drop(waiting);
        if told {
            self.process.catch_up();
        }
        self.write_some();
        self.read_stdout();
        self.drain_stderr();
    }

    fn write_some(&mut self) {
        while let Some(stdin) = &mut self.process.stdin
            && self.sent < self.unsent.len()
        {
            match stdin.write(&self.unsent[self.sent..]) {
                Ok(written) => self.sent += written,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => {
                    // A plugin that closed its input says the rest by its output.
                    self.process.stdin = None;
                    if error.kind() != ErrorKind::BrokenPipe {
                        self.lose(format!("cannot write to the plugin: {error}"));
                    }
                }
            }
        }
        self.unsent.clear();
        self.sent = 0;
    }

    fn read_stdout(&mut self) {
        let mut buffer = [0; 1 << 14];
        for _ in 0..ROUNDS {
            match read_some(&mut self.process.stdout, &mut buffer) {
                Ok(Some([])) => return,
                Ok(Some(bytes)) => {
                    self.arrived_ns = monotonic_ns();
                    self.receive(bytes);
                }
                Ok(None) => {
                    self.stdout_open = false;
                    return;
                }
                Err(error) => {
                    self.lose(format!("cannot read what the plugin says: {error}"));
                    return;
                }
            }
        }
    }

    /// The host cannot go on with this process.
    fn lose(&mut self, reason: String) {
        self.process.give_up(reason);
        self.stdout_open = false;
    }

    /// Keeps bytes of possible messages, and drops those of long stray lines.
    fn receive(&mut self, mut bytes: &[u8]) {
        if self.skipping {
            let end = bytes.iter().position(|byte| *byte == b'\n');
            self.stray_bytes += end.unwrap_or(bytes.len()) as u64;
            match end {
                Some(end) => {
                    self.skipping = false;
                    bytes = &bytes[end + 1..];
                }
                None => return,
            }
        }
        self.received.extend_from_slice(bytes);
    }

    fn drain_stderr(&mut self) {
        let mut buffer = [0; 1 << 14];
        for _ in 0..ROUNDS {
            if !self.stderr_open {
                return;
            }
            match read_some(&mut self.process.stderr, &mut buffer) {
                Ok(Some([])) => return,
                Ok(Some(bytes)) => self.stderr.push(bytes, self.limits.stderr_bytes),
                // What it says there decides nothing.
                Ok(None) | Err(_) => self.stderr_open = false,
            }
        }
    }

    /// Handles whole lines until one is the answer.
    fn take_answer(
        &mut self,
        wait: &Wait<'_>,
        notice: &mut dyn FnMut(Notice<'_>) -> Result<(), String>,
    ) -> Result<Option<String>, Fault> {
        loop {
            let newline = self.received[self.searched..]
                .iter()
                .position(|byte| *byte == b'\n');
            let Some(newline) = newline.map(|at| at + self.searched) else {
                self.received.drain(..self.handled);
                self.handled = 0;
                self.searched = self.received.len();
                return self.check_unfinished(wait).map(|()| None);
            };
            if newline - self.handled > wait.line_bytes {
                return Err(self.too_long(wait));
            }
            // Taken out for a moment: a line may be a gigabyte, too much to copy.
            let received = std::mem::take(&mut self.received);
            let outcome = self.handle_line(&received[self.handled..newline], wait, notice);
            self.received = received;
            self.handled = newline + 1;
            self.searched = self.handled;
            match outcome {
                Ok(None) => {}
                Ok(answer) => return Ok(answer),
                Err(Broken::Protocol(reason)) => return Err(self.broken(wait, reason)),
                Err(Broken::Fault(fault)) if fault.is_survivable() => return Err(fault),
                Err(Broken::Fault(fault)) => return Err(self.stop(wait.method, fault)),
            }
        }
    }

    /// A line without an end yet: is it too long, or no message anyway?
    fn check_unfinished(&mut self, wait: &Wait<'_>) -> Result<(), Fault> {
        let first = self
            .received
            .iter()
            .find(|byte| !byte.is_ascii_whitespace());
        if first.is_some_and(|first| *first != b'{') && self.received.len() > 1 << 16 {
            self.stray_bytes += self.received.len() as u64;
            self.stray(&self.received.clone());
            self.received.clear();
            self.searched = 0;
            self.skipping = true;
        }
        if self.received.len() > wait.line_bytes {
            return Err(self.too_long(wait));
        }
        if self.stray_bytes + self.stderr.total() > self.limits.output_bytes {
            let fault = self.over_limit(Limit::Output, wait.method);
            return Err(self.stop(wait.method, fault));
        }
        Ok(())
    }

    fn handle_line(
        &mut self,
        line: &[u8],
        wait: &Wait<'_>,
        notice: &mut dyn FnMut(Notice<'_>) -> Result<(), String>,
    ) -> Result<Option<String>, Broken> {
        match message::read(line).map_err(Broken::Protocol)? {
            Message::Blank | Message::Ignored => {}
            Message::Stray => {
                self.stray_bytes += line.len() as u64;
                self.stray(line);
            }
            Message::Incumbent(paths) => {
                let arrived_ns = monotonic_ns();
                notice(Notice::Incumbent { paths, arrived_ns }).map_err(Broken::Protocol)?;
            }
            Message::Metric(metric) => {
                notice(Notice::Metric(metric)).map_err(Broken::Protocol)?;
            }
            Message::Log(LogParams { level, text }) => {
                self.log.push(level, &text, self.limits.log_bytes);
            }
            Message::Answer { id, result } => {
                return answer(id, result, wait).map(|result| Some(result.to_owned()));
            }
        }
        Ok(None)
    }

    fn stray(&mut self, line: &[u8]) {
        self.stray_lines += 1;
        let shown = &line[..line.len().min(400)];
        let text = String::from_utf8_lossy(shown).into_owned();
        let text = format!("stdout: {text}");
        self.log.push(LogLevel::Info, &text, self.limits.log_bytes);
    }

    fn too_long(&mut self, wait: &Wait<'_>) -> Fault {
        let limit = wait.line_bytes >> 20;
        self.broken(wait, format!("a message is longer than {limit} MiB"))
    }

    fn broken(&mut self, wait: &Wait<'_>, reason: String) -> Fault {
        let during = wait.method.to_owned();
        self.stop(wait.method, Fault::Protocol { during, reason })
    }

    fn over_limit(&self, limit: Limit, method: &str) -> Fault {
        let bytes = |bytes: u64| bytesize::ByteSize::b(bytes).display().iec().to_string();
        let policy = &self.limits.policy;
        let allowed = match limit {
            Limit::Wall => None,
            Limit::Cpu => Some(format!("{:?}", Duration::from_nanos(self.call.cpu_ns))),
            Limit::Memory => Some(bytes(self.call.memory_bytes)),
            Limit::Processes => Some(policy.processes.to_string()),
            Limit::Output => Some(bytes(self.limits.output_bytes)),
            Limit::Disk => Some(format!(
                "{} and {} files",
                bytes(policy.disk_bytes),
                policy.files
            )),
        };
        Fault::OverLimit {
            during: method.to_owned(),
            limit,
            allowed: allowed.unwrap_or_default(),
        }
    }

    /// Standard output is closed: how did the process end?
    fn ended(&mut self, method: &str) -> Fault {
        let report = self.process.end(ENDING);
        self.drain_stderr();
        let during = method.to_owned();
        match report {
            Report {
                disturbed: Some(reason),
                ..
            } => Fault::Unsupervised { during, reason },
            Report {
                host_error: Some(reason),
                ..
            } => Fault::Host { reason },
            Report {
                over: Some(limit),
                killed: true,
                ..
            } => self.over_limit(limit, method),
            Report {
                start_error: Some(reason),
                sandbox,
                ..
            } => {
                let strict = sandbox.level == Level::Strict && sandbox.refused().next().is_some();
                let hint = if strict {
                    "`fleetyard doctor` says what to do; `--sandbox auto` runs with what there is"
                } else {
                    "is it executable, and is its interpreter installed?"
                };
                let hint = hint.to_owned();
                Fault::Spawn {
                    program: "the plugin".into(),
                    reason,
                    hint: Some(hint),
                }
            }
            Report { killed: true, .. } => Fault::Protocol {
                during,
                reason: "it closed its standard output and went on running".into(),
            },
            Report {
                signal: Some(signal),
                ..
            } => Fault::Crashed { signal, during },
            Report {
                code: Some(code), ..
            } => Fault::Exited { code, during },
            _ => Fault::Unsupervised {
                during,
                reason: "nobody knows how it ended".into(),
            },
        }
    }

    /// Ends the process at once: what it answered breaks the protocol.
    pub(crate) fn condemn(&mut self, method: &str, fault: Fault) -> Fault {
        let fault = self.stop(method, fault);
        self.fault = Some(fault.clone());
        fault
    }

    /// Asks the plugin to end, gives it `patience`, and makes sure that nothing
    /// of it is left.
    pub(crate) fn close(&mut self, patience: Duration) -> (Report, Option<Fault>) {
        let mut fault = None;
        if self.fault.is_none() {
            let deadline = Deadline::after(patience);
            fault = self.call("shutdown", (), deadline, &mut |_| Ok(())).err();
            self.unsent
                .extend_from_slice(&wire::line(&Request::notification("exit", ())));
            self.write_some();
            self.process.stdin = None;
        }
        let report = self.process.end(patience);
        self.drain_stderr();
        (report, self.unsupervised("shutdown").or(fault))
    }

    /// The end of what the plugin wrote to standard error, and how many bytes
    /// came before.
    pub(crate) fn stderr(&self) -> (String, u64) {
        (
            String::from_utf8_lossy(&self.stderr.kept).into_owned(),
            self.stderr.dropped,
        )
    }
}

/// What can be read without waiting, if only nothing; `None` once the pipe is
/// closed.
fn read_some<'a>(pipe: &mut impl Read, buffer: &'a mut [u8]) -> std::io::Result<Option<&'a [u8]>> {
    loop {
        match pipe.read(buffer) {
            Ok(0) => return Ok(None),
            Ok(read) => return Ok(Some(&buffer[..read])),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(Some(&[])),
            Err(error) => return Err(error),
        }
    }
}

enum Broken {
    Protocol(String),
    Fault(Fault),
}

/// The result of an answer, as text, if it is the one that is waited for.
fn answer<'a>(
    id: Option<u64>,
    result: Result<&'a str, RpcError>,
    wait: &Wait<'_>,
) -> Result<&'a str, Broken> {
    match id {
        Some(id) if id < wait.id => {
            return Err(Broken::Protocol(format!(
                "it answered request {id} a second time"
            )));
        }
        Some(id) if id > wait.id => {
            let asked = wait.id;
            return Err(Broken::Protocol(format!(
                "it answered request {id}, but was asked {asked}"
            )));
        }
        _ => {}
    }
    let during = wait.method.to_owned();
    result.map_err(|RpcError { code, message }| {
        Broken::Fault(match code {
            wire::REFUSED => {
                let (reason, hint) = match message.split_once('\n') {
                    Some((reason, hint)) => (reason.to_owned(), Some(hint.to_owned())),
                    None => (message, None),
                };
                Fault::Refused { reason, hint }
            }
            wire::BROKE_CONTRACT => Fault::Protocol {
                during,
                reason: message,
            },
            _ => Fault::Reported {
                status: fleetyard_abi::Status::InternalError,
                during,
                message,
            },
        })
    })
}
