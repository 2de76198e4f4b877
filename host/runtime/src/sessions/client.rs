//! The host's side of the JSON wire, over a supervised process.
//!
//! One thread, one wait: it writes the request, reads standard output and error as they
//! come, and watches the deadline. Every byte that arrives is hostile, and none of it is
//! looked at that came after the time of the call was over.

use std::io::ErrorKind;
use std::time::Duration;

use fleetyard_abi::wire::{
    self, CancelParams, KeepParams, LogParams, MetricParams, NoteParams, Request, RpcError,
};
use fleetyard_abi::{Budget, LogLevel};
use serde::Serialize;

use crate::Fault;
use crate::confinement::control::Report;
use crate::confinement::process::Process;
use crate::confinement::sandbox::Level;
use crate::confinement::transport::{Interest, Output, Transport};
use crate::sessions::bounds::{LOG_BYTES, STDERR_BYTES};
use crate::sessions::incoming::{Expected, Incoming, Part, Read, Whole};
use crate::sessions::limits::Limits;
use crate::sessions::log::Log;
use crate::sessions::message::Message;
use crate::usage::{CallLimits, CallUsage, Limit};

/// The reads of a pipe before the rest is looked at again, so that a flood cannot
/// hide it.
const ROUNDS: usize = 16;

/// The bytes that are read at a time. To handle them takes a few milliseconds at most, and
/// then the clock is looked at again.
const PIECE: usize = 1 << 16;

/// The time that a process that closed its output has to end by itself.
const ENDING: Duration = Duration::from_millis(500);

/// The first request: a worker that cannot load its library answers it without having
/// read it.
const FIRST_ID: u64 = 1;

/// The number of a request is larger than the last one by up to this, at random. So
/// nobody can answer what was not asked, and numbers stay exact in every language for
/// some hundred million calls.
const ID_STEP: u64 = 1 << 26;

/// A message of a plugin while a call is running.
pub(crate) enum Notice<'a> {
    /// A plan, the number of its paths, and when its last byte arrived.
    Incumbent { read: Read, arrived_ns: u64 },
    /// Bytes that it wants to have with its next call.
    Keep(KeepParams),
    /// Something to show, as text, and when it arrived.
    Annotation { text: &'a str, arrived_ns: u64 },
    /// A figure.
    Metric(MetricParams),
    /// A fact about the plugin's inputs.
    Note(NoteParams),
}

/// An answer.
pub(crate) struct Reply {
    /// The result as text, without the paths that were found in it.
    pub(crate) result: String,
    pub(crate) paths: Option<Read>,
    /// Time at which its last byte arrived.
    pub(crate) arrived_ns: u64,
}

/// A connection to a plugin.
#[expect(
    clippy::struct_excessive_bools,
    reason = "three pipes are open or not, and the plugin is busy or not"
)]
pub(crate) struct Client<T: Transport = Process> {
    pub(super) transport: T,
    pub(super) limits: Limits,
    /// Of the last request.
    id: Option<u64>,
    unsent: Vec<u8>,
    /// Bytes of `unsent` that were written already.
    sent: usize,
    incoming: Incoming,
    /// The buffer into which pieces are read.
    buffer: Vec<u8>,
    /// Bytes that came in one piece with an answer, behind it.
    behind: Vec<u8>,
    pub(crate) stray_lines: u64,
    pub(crate) log: Log,
    stderr: Tail,
    /// Of the call that is running, or of the last one.
    call: CallLimits,
    /// It has answered, and frees memory until it says that it is ready.
    busy: bool,
    stdin_open: bool,
    stdout_open: bool,
    stderr_open: bool,
    /// Times at which the last request was about to be written, and the last bytes arrived.
    asked_ns: u64,
    arrived_ns: u64,
    /// The time for which messages were handled since then.
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

/// The time by which a call must have returned.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Deadline {
    /// On the monotonic clock.
    pub(crate) at_ns: u64,
    /// The length of the budget, for messages: what is left of it when the request
    /// is sent is a little less.
    pub(crate) limit: Duration,
}

impl Deadline {
    pub(crate) fn after(now_ns: u64, limit: Duration) -> Self {
        let at_ns = now_ns.saturating_add(limit.as_nanos() as u64);
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

/// The things that a call is waited for.
struct Wait<'a> {
    id: u64,
    method: &'a str,
    deadline_ns: u64,
    /// Time by which the plugin has to have answered, the grace included.
    until_ns: u64,
    limit_ms: u64,
    expected: Expected<'a>,
    /// The request was written, at least its beginning. Until then the plugin is waited for to be
    /// ready for it.
    asked: bool,
}

type Notify<'a> = &'a mut dyn FnMut(Notice<'_>) -> Result<(), String>;

impl<T: Transport> Client<T> {
    pub(crate) fn new(transport: T, limits: Limits) -> Self {
        // Until a call has limits of its own.
        let call = CallLimits {
            cpu_ns: 0,
            memory_bytes: limits.memory_bytes,
        };
        Self {
            transport,
            limits,
            id: None,
            unsent: Vec::new(),
            sent: 0,
            incoming: Incoming::default(),
            buffer: vec![0; PIECE],
            behind: Vec::new(),
            stray_lines: 0,
            log: Log::default(),
            stderr: Tail::default(),
            call,
            busy: false,
            stdin_open: true,
            stdout_open: true,
            stderr_open: true,
            asked_ns: 0,
            arrived_ns: 0,
            handled_ns: 0,
            fault: None,
        }
    }

    pub(crate) fn now_ns(&self) -> u64 {
        self.transport.now_ns()
    }

    /// The next call has limits of its own, which count from here: what is left of the last one is
    /// gone.
    pub(crate) fn begin(&mut self, method: &str, call: CallLimits) -> Result<(), Fault> {
        self.settle(method)?;
        self.call = call;
        self.transport.begin(call, self.limits.grace);
        Ok(())
    }

    /// Waits until the plugin has freed what its last call has left.
    fn settle(&mut self, method: &str) -> Result<(), Fault> {
        if !self.busy || self.fault.is_some() {
            return Ok(());
        }
        let limit = self.limits.startup;
        let until_ns = Deadline::after(self.transport.now_ns(), limit).at_ns;
        let wait = Wait {
            id: 0,
            method,
            deadline_ns: until_ns,
            until_ns,
            limit_ms: limit.as_millis() as u64,
            expected: Expected::NO_PLAN,
            asked: false,
        };
        let notify: Notify<'_> = &mut |_| Ok(());
        let mut settled = self.hear_unasked(&wait, notify);
        while self.busy && settled.is_ok() {
            settled = self.wait_once(&wait, &mut false, notify).map(drop);
        }
        self.fault = settled.as_ref().err().cloned();
        settled
    }

    /// The use since then, if somebody watched to the end.
    pub(crate) fn finish(&mut self, method: &str) -> Result<CallUsage, Fault> {
        let used = self.transport.finish();
        match self.unsupervised(method) {
            Some(fault) => {
                self.fault = Some(fault.clone());
                Err(fault)
            }
            None => Ok(used.unwrap_or_default()),
        }
    }

    /// Says so when the supervisor is gone or could not do its work. It comes before all
    /// that the plugin did: nobody held it to anything. Where the plugin cannot have done it, the
    /// host failed.
    fn unsupervised(&self, method: &str) -> Option<Fault> {
        let reason = self.transport.disturbed()?;
        Some(if self.transport.is_disturbed_from_outside() {
            Fault::Host { reason }
        } else {
            Fault::Unsupervised {
                during: method.to_owned(),
                reason,
            }
        })
    }

    /// Ends the process for a fault; which one it is when that is done.
    fn stop(&mut self, method: &str, fault: Fault) -> Fault {
        self.transport.end(Duration::ZERO);
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
        self.transport.over()
    }

    /// Sends a request and waits for its answer, until the deadline plus the
    /// grace. After a fault, unless the plugin reported it, nothing of the process
    /// is left.
    pub(crate) fn call<P: Serialize>(
        &mut self,
        method: &str,
        params: P,
        deadline: Deadline,
        expected: Expected<'_>,
        notify: Notify<'_>,
    ) -> Result<Reply, Fault> {
        self.settle(method)?;
        if let Some(fault) = &self.fault {
            return Err(fault.clone());
        }
        let id = match self.id {
            None => FIRST_ID,
            Some(id) => id + 1 + self.transport.secret() % ID_STEP,
        };
        let grace_ns = self.limits.grace.as_nanos() as u64;
        let mut wait = Wait {
            id,
            method,
            deadline_ns: deadline.at_ns,
            until_ns: deadline.at_ns.saturating_add(grace_ns),
            limit_ms: deadline.limit.as_millis() as u64,
            expected,
            asked: false,
        };
        let request = wire::line(&Request::new(id, method, params));
        let answer = self.hear_unasked(&wait, notify).and_then(|()| {
            self.incoming.ask();
            self.unsent.extend_from_slice(&request);
            wait.asked = true;
            self.wait(&wait, notify)
        });

        self.id = Some(id);
        if let Err(fault) = &answer
            && !fault.is_survivable()
        {
            self.fault = Some(fault.clone());
        }
        answer
    }

    /// Takes in what came before the request is written: none of it can be its answer.
    fn hear_unasked(&mut self, wait: &Wait<'_>, notify: Notify<'_>) -> Result<(), Fault> {
        let behind = std::mem::take(&mut self.behind);
        let now = self.transport.now_ns();
        self.take(&behind, now, wait, notify)?;
        self.read_stdout(wait, notify).map(drop)
    }

    fn wait(&mut self, wait: &Wait<'_>, notify: Notify<'_>) -> Result<Reply, Fault> {
        let mut cancelled = false;
        self.handled_ns = 0;
        self.asked_ns = self.transport.now_ns();
        loop {
            if let Some(answer) = self.wait_once(wait, &mut cancelled, notify)? {
                return Ok(answer);
            }
        }
    }

    /// Waits until something has come, or the time is over.
    fn wait_once(
        &mut self,
        wait: &Wait<'_>,
        cancelled: &mut bool,
        notify: Notify<'_>,
    ) -> Result<Option<Reply>, Fault> {
        if let Some(fault) = self.unsupervised(wait.method) {
            self.drain_stderr();
            return Err(fault);
        }
        let now = self.transport.now_ns();
        if now >= wait.until_ns {
            let (during, limit_ms) = (wait.method.to_owned(), wait.limit_ms);
            return Err(self.stop(wait.method, Fault::TimedOut { during, limit_ms }));
        }
        if self.transport.interrupted() {
            let during = wait.method.to_owned();
            return Err(self.stop(wait.method, Fault::Interrupted { during }));
        }
        // With a grace, the supervisor says first that a limit is exceeded.
        let told = now >= wait.deadline_ns || self.transport.over().is_some();
        if told && wait.asked && !*cancelled {
            *cancelled = true;
            let params = CancelParams { id: wait.id };
            self.unsent
                .extend_from_slice(&wire::line(&Request::notification("$/cancel", params)));
        }
        if !self.stdout_open {
            return Err(self.ended(wait.method));
        }
        let until = if now >= wait.deadline_ns {
            wait.until_ns
        } else {
            wait.deadline_ns
        };
        let interest = Interest {
            stdin: self.stdin_open && !self.unsent.is_empty(),
            stdout: self.stdout_open,
            stderr: self.stderr_open,
        };
        self.transport.wait(interest, until - now);
        self.write_some();
        let answer = self.read_stdout(wait, notify)?;
        self.drain_stderr();
        self.check_output(wait.method)?;
        Ok(answer)
    }

    fn write_some(&mut self) {
        while self.stdin_open && self.sent < self.unsent.len() {
            match self.transport.write(&self.unsent[self.sent..]) {
                Ok(written) => self.sent += written,
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => {
                    // A plugin that closed its input says the rest by its output.
                    self.close_stdin();
                    if error.kind() != ErrorKind::BrokenPipe {
                        self.lose(format!("cannot write to the plugin: {error}"));
                    }
                }
            }
        }
        self.unsent.clear();
        self.sent = 0;
    }

    fn close_stdin(&mut self) {
        self.stdin_open = false;
        self.transport.close_stdin();
    }

    /// The host cannot go on with this process.
    fn lose(&mut self, reason: String) {
        self.transport.give_up(reason);
        self.stdout_open = false;
    }

    /// Reads what has come, until the answer is there. What comes when the time is over is
    /// not looked at.
    fn read_stdout(&mut self, wait: &Wait<'_>, notify: Notify<'_>) -> Result<Option<Reply>, Fault> {
        let mut buffer = std::mem::take(&mut self.buffer);
        let mut outcome = Ok(None);
        for _ in 0..ROUNDS {
            let read = match read_some(&mut self.transport, Output::Stdout, &mut buffer) {
                Ok(Some([])) => break,
                Ok(Some(bytes)) => bytes,
                Ok(None) => {
                    self.stdout_open = false;
                    break;
                }
                Err(error) => {
                    self.lose(format!("cannot read what the plugin says: {error}"));
                    break;
                }
            };
            let arrived_ns = self.transport.now_ns();
            if arrived_ns >= wait.until_ns {
                break;
            }
            self.arrived_ns = arrived_ns;
            outcome = self.take(read, arrived_ns, wait, notify);
            if !matches!(outcome, Ok(None)) {
                break;
            }
            self.handled_ns += self.transport.now_ns().saturating_sub(arrived_ns);
        }
        self.buffer = buffer;
        outcome
    }

    fn drain_stderr(&mut self) {
        let mut buffer = std::mem::take(&mut self.buffer);
        for _ in 0..ROUNDS {
            if !self.stderr_open {
                break;
            }
            match read_some(&mut self.transport, Output::Stderr, &mut buffer) {
                Ok(Some([])) => break,
                Ok(Some(bytes)) => self.stderr.push(bytes, STDERR_BYTES),
                // What it says there decides nothing.
                Ok(None) | Err(_) => self.stderr_open = false,
            }
        }
        self.buffer = buffer;
    }

    /// Takes bytes that arrived at a time, until the answer is among them.
    fn take(
        &mut self,
        mut bytes: &[u8],
        arrived_ns: u64,
        wait: &Wait<'_>,
        notify: Notify<'_>,
    ) -> Result<Option<Reply>, Fault> {
        while !bytes.is_empty() {
            let (taken, line) = self.incoming.take(bytes, &wait.expected);
            bytes = &bytes[taken..];
            let outcome = match line {
                Ok(None) => continue,
                Ok(Some(line)) => self.handle_line(line, arrived_ns, wait, notify),
                Err(reason) => Err(Broken::Protocol(reason)),
            };
            match outcome {
                Ok(None) => {}
                Ok(answer) => {
                    self.behind = bytes.to_vec();
                    return Ok(answer);
                }
                Err(Broken::Protocol(reason)) => return Err(self.broken(wait, reason)),
                Err(Broken::Fault(fault)) => {
                    if fault.is_survivable() {
                        self.behind = bytes.to_vec();
                        return Err(fault);
                    }
                    return Err(self.stop(wait.method, fault));
                }
            }
        }
        Ok(None)
    }

    /// Stops a plugin that wrote too much that is no message, also if it has answered.
    fn check_output(&mut self, method: &str) -> Result<(), Fault> {
        if self.incoming.stray_bytes + self.stderr.total() <= self.limits.output_bytes {
            return Ok(());
        }
        let fault = self.over_limit(Limit::Output, method);
        Err(self.stop(method, fault))
    }

    fn handle_line(
        &mut self,
        mut line: Whole,
        arrived_ns: u64,
        wait: &Wait<'_>,
        notify: Notify<'_>,
    ) -> Result<Option<Reply>, Broken> {
        let asked = wait.asked && !line.is_early();
        let (message, found) = line.read().map_err(Broken::Protocol)?;
        let found = |wanted| {
            found
                .filter(|(part, _)| *part == wanted)
                .map(|(_, read)| read)
        };
        match message {
            Message::Blank | Message::Ignored => {}
            Message::Busy => self.busy = true,
            Message::Ready => self.busy = false,
            Message::Stray => {
                let text = format!("stdout: {}", line.text());
                self.stray_lines += 1;
                self.log.push(LogLevel::Info, &text, LOG_BYTES);
            }
            Message::Incumbent(_) if !asked => {
                let reason = "it submitted a plan before it was asked for one";
                return Err(Broken::Protocol(reason.into()));
            }
            Message::Incumbent(plan) => {
                let read = wait.expected.read(&plan, found(Part::Params));
                let notice = Notice::Incumbent { read, arrived_ns };
                notify(notice).map_err(Broken::Protocol)?;
            }
            Message::Keep(_) if !asked => {
                let reason = "it kept bytes before it was asked for anything";
                return Err(Broken::Protocol(reason.into()));
            }
            Message::Keep(keep) => {
                notify(Notice::Keep(keep)).map_err(Broken::Protocol)?;
            }
            // Nobody asked for it.
            Message::Annotation(_) if !asked => {}
            Message::Annotation(text) => {
                let notice = Notice::Annotation { text, arrived_ns };
                notify(notice).map_err(Broken::Protocol)?;
            }
            Message::Metric(metric) => {
                notify(Notice::Metric(metric)).map_err(Broken::Protocol)?;
            }
            Message::Note(note) => {
                notify(Notice::Note(note)).map_err(Broken::Protocol)?;
            }
            Message::Log(LogParams { level, text }) => self.log.push(level, &text, LOG_BYTES),
            Message::Answer { id, result } => {
                self.check_id(id, asked, wait).map_err(Broken::Protocol)?;
                let result = result.map_err(|error| failed(error, wait))?.to_owned();
                return Ok(Some(Reply {
                    result,
                    paths: found(Part::Result),
                    arrived_ns,
                }));
            }
        }
        Ok(None)
    }

    /// It is this request that was answered, after it was asked.
    fn check_id(&self, id: Option<u64>, asked: bool, wait: &Wait<'_>) -> Result<(), String> {
        match id {
            Some(id) if Some(id) == self.id => {
                Err(format!("it answered request {id} a second time"))
            }
            Some(id) if !asked => Err(format!("it answered request {id} before it was asked")),
            Some(id) if id != wait.id => {
                let asked = wait.id;
                Err(format!("it answered request {id}, but was asked {asked}"))
            }
            None if !asked => Err("it sent an error before it was asked".into()),
            _ => Ok(()),
        }
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
        let report = self.transport.end(ENDING);
        self.drain_stderr();
        let during = method.to_owned();
        if let Some(fault) = self.unsupervised(method) {
            return fault;
        }
        match report {
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
                let strict = sandbox.level == Level::Strict
                    && (sandbox.refused().next().is_some() || sandbox.only_watches(Limit::Memory));
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
    /// of it is left. A busy one only hears that it should end: what it frees goes with it.
    pub(crate) fn shut_down(&mut self, patience: Duration) -> (Report, Option<Fault>) {
        let mut fault = None;
        if self.fault.is_none() {
            if !self.busy {
                let deadline = Deadline::after(self.transport.now_ns(), patience);
                let expected = Expected::NO_PLAN;
                fault = self
                    .call("shutdown", (), deadline, expected, &mut |_| Ok(()))
                    .err();
            }
            self.unsent
                .extend_from_slice(&wire::line(&Request::notification("exit", ())));
            self.write_some();
            self.close_stdin();
        }
        let report = self.transport.end(patience);
        self.drain_stderr();
        (report, self.unsupervised("shutdown").or(fault))
    }

    /// The reason why nothing more is asked.
    #[cfg(test)]
    pub(crate) fn fault(&self) -> Option<&Fault> {
        self.fault.as_ref()
    }

    /// The bytes of what was sent and received that are kept, plans aside.
    #[cfg(test)]
    pub(crate) fn held_bytes(&self) -> usize {
        let buffers = self.buffer.len() + self.behind.len() + self.unsent.len();
        buffers + self.incoming.held_bytes() + self.stderr.kept.len()
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

/// Reads as much as there is without waiting, if only nothing; `None` once the pipe is
/// closed.
fn read_some<'a, T: Transport>(
    transport: &mut T,
    output: Output,
    buffer: &'a mut [u8],
) -> std::io::Result<Option<&'a [u8]>> {
    loop {
        match transport.read(output, buffer) {
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

/// The fault for which an answer is an error.
fn failed(error: RpcError, wait: &Wait<'_>) -> Broken {
    let during = wait.method.to_owned();
    let RpcError { code, message } = error;
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
}
