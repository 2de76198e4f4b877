//! The plugin's side of the JSON wire: answers a host's requests from a
//! [`Catalog`].
//!
//! Two programs use it: executables of plugins written in Rust
//! ([`serve_stdio`]), and the host's worker process, whose catalogue is a shared
//! library.

use std::borrow::Cow;
use std::io::{self, BufRead, BufReader, IsTerminal, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, mpsc};
use std::thread::{self, ThreadId};
use std::time::Duration;

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::value::RawValue;

use crate::annotation::Annotation;
use crate::c::ANNOTATIONS_ID;
use crate::clock::monotonic_ns;
use crate::export::panic_message;
use crate::memory::{Kept, may_be_kept};
use crate::model::{self, Budget, Instance, LogLevel, PathEncoding, SharedEnvironment, Status};
use crate::object::Object;
use crate::paths::{PlanContext, WritePlan};
use crate::plan::PlanRef;
use crate::sdk::{Annotations, Catalog, Failure, Options, Rejected, Sink};
use crate::wire::{
    self, CancelParams, CreateParams, Envelope, GenerateParams, GenerateResult, InitializeParams,
    InitializeResult, KeepParams, LogParams, MetricParams, NoteParams, Outcome, PlanParams,
    PlanResult, PlanText, PrepareParams, ProgressParams, RecoverParams, Request, Response,
    ShouldInvokeParams, ShouldInvokeResult,
};

/// Serves a catalogue on standard input and output, until the host says `exit`
/// or goes away. For the `main` function of a plugin's executable.
///
/// The protocol moves to private descriptors first: standard output becomes
/// standard error, so that a stray `println!` is a line in the log. Started from
/// a terminal, it explains itself and returns 2.
pub fn serve_stdio(catalog: &dyn Catalog) -> i32 {
    if io::stdin().is_terminal() {
        let names: Vec<String> = catalog
            .descriptors()
            .iter()
            .map(|d| format!("  {} ({})", d.id, d.kind))
            .collect();
        eprintln!(
            "This program is a Fleetyard plugin: it speaks JSON over standard input and output \
             and is started by the host.\nIt offers:\n{}\nhint: try `fleetyard plugins info {}`",
            names.join("\n"),
            std::env::args().next().unwrap_or_else(|| "PROGRAM".into()),
        );
        return 2;
    }
    match private_stdio() {
        Ok((input, output)) => {
            // Answers to requests that came just before the end still go out.
            serve(catalog, BufReader::new(input), output, || {
                std::thread::sleep(Duration::from_secs(1));
                std::process::exit(0);
            });
            0
        }
        Err(error) => {
            eprintln!("cannot move the protocol off standard output: {error}");
            1
        }
    }
}

/// Duplicates standard input and output for the protocol, then points the
/// originals at `/dev/null` and standard error.
pub fn private_stdio() -> io::Result<(std::fs::File, std::fs::File)> {
    use std::os::fd::{AsRawFd, FromRawFd};
    let duplicate = |fd: i32| {
        // SAFETY: plain system call on a number.
        let copy = unsafe { libc::fcntl(fd, libc::F_DUPFD_CLOEXEC, 3) };
        if copy < 0 {
            return Err(io::Error::last_os_error());
        }
        // SAFETY: `copy` was just opened and is owned by nobody else.
        Ok(unsafe { std::fs::File::from_raw_fd(copy) })
    };
    let (input, output) = (duplicate(0)?, duplicate(1)?);
    let null = std::fs::File::open("/dev/null")?;
    for (from, to) in [(null.as_raw_fd(), 0), (2, 1)] {
        // SAFETY: both descriptors are open; `dup2` replaces the second.
        if unsafe { libc::dup2(from, to) } < 0 {
            return Err(io::Error::last_os_error());
        }
    }
    Ok((input, output))
}

/// Serves a catalogue until the host says `exit` or closes the input; then calls
/// `gone` from the reading thread, which may end the process even though a call
/// into the plugin does not return.
pub fn serve(
    catalog: &dyn Catalog,
    mut input: impl BufRead + Send + 'static,
    output: impl Write + Send,
    gone: impl FnOnce() + Send + 'static,
) {
    let (sender, lines) = mpsc::channel::<String>();
    let cancelled = Arc::new(AtomicU64::new(0));
    let heard = Arc::clone(&cancelled);
    let reading = std::thread::Builder::new().spawn(move || {
        let mut line = String::new();
        while matches!(input.read_line(&mut line), Ok(read) if read > 0) {
            let line = std::mem::take(&mut line);
            match notification(&line) {
                Some(Notification::Cancel(id)) => heard.store(id, Ordering::Relaxed),
                Some(Notification::Exit) => break,
                None if sender.send(line).is_err() => break,
                None => {}
            }
        }
        drop(sender);
        gone();
    });
    if let Err(error) = reading {
        eprintln!("cannot read requests: no thread for it: {error}");
        return;
    }
    let output = Mutex::new(output);
    let channel = Channel {
        output: &output,
        cancelled: &cancelled,
    };
    let mut server = Server {
        catalog,
        channel,
        object: None,
        environment: None,
    };
    for line in lines {
        server.answer(&line);
    }
}

enum Notification {
    Cancel(u64),
    Exit,
}

/// A notification that must be heard while a call is running. Other lines are cheap to rule out.
fn notification(line: &str) -> Option<Notification> {
    if line.len() > 256 {
        return None;
    }
    let envelope: Envelope<'_> = serde_json::from_str(line).ok()?;
    match envelope.method.as_deref()? {
        "$/cancel" => Some(Notification::Cancel(
            envelope.params::<CancelParams>().ok()?.id,
        )),
        "exit" => Some(Notification::Exit),
        _ => None,
    }
}

struct Server<'a, W> {
    catalog: &'a dyn Catalog,
    channel: Channel<'a, W>,
    object: Option<Object>,
    environment: Option<SharedEnvironment>,
}

/// A refusal on the level of the protocol.
struct Refusal {
    code: i64,
    message: String,
}

impl Refusal {
    fn new(code: i64, message: impl Into<String>) -> Self {
        Self {
            code,
            message: message.into(),
        }
    }
}

/// A request to learn a map. Its parameters, which may be large, are read at once, and not first as
/// text; the reading of another request ends at its method.
#[derive(Deserialize)]
struct Preparing {
    id: u64,
    #[serde(rename = "method")]
    _method: Prepare,
    params: PrepareParams,
}

#[derive(Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Prepare {
    Prepare,
}

impl<W: Write + Send> Server<'_, W> {
    fn answer(&mut self, line: &str) {
        if let Ok(Preparing { id, params, .. }) = serde_json::from_str(line) {
            return self.guard(id, |server| server.prepare(id, params));
        }
        let envelope: Envelope<'_> = match serde_json::from_str(line) {
            Ok(envelope) => envelope,
            Err(error) => {
                let response = Response::error(None, wire::PARSE_ERROR, error.to_string());
                return self.channel.send(&response);
            }
        };
        let (Some(id), Some(method)) = (envelope.id, envelope.method.as_deref()) else {
            let response = Response::error(envelope.id, wire::INVALID_REQUEST, "not a request");
            return self.channel.send(&response);
        };
        let text = envelope.params.map_or("null", RawValue::get);
        self.guard(id, |server| server.dispatch(id, method, text));
    }

    /// Makes a call, and answers with an error when it is refused or panics.
    fn guard(&mut self, id: u64, call: impl FnOnce(&mut Self) -> Result<(), Refusal>) {
        let refusal = match catch_unwind(AssertUnwindSafe(|| call(self))) {
            Ok(Ok(())) => return self.tidy(),
            Ok(Err(refusal)) => refusal,
            Err(payload) => {
                let message = panic_message(payload.as_ref());
                Refusal::new(
                    wire::INTERNAL_ERROR,
                    format!("the plugin panicked: {message}"),
                )
            }
        };
        self.leave();
        self.channel
            .send(&Response::error(Some(id), refusal.code, refusal.message));
        self.tidy();
    }

    /// Says, before a call is answered, if memory is to be freed afterwards.
    fn leave(&mut self) {
        if self.has_leftovers() {
            self.channel.notify(wire::BUSY);
        }
    }

    /// Frees what a call has left, once it has been answered, and says so.
    fn tidy(&mut self) {
        if self.has_leftovers()
            && let Some(object) = &mut self.object
        {
            // A panic in a destructor has nobody left to hear of it.
            let _ = catch_unwind(AssertUnwindSafe(|| object.free_leftovers()));
            self.channel.notify(wire::READY);
        }
    }

    fn has_leftovers(&mut self) -> bool {
        self.object.as_mut().is_some_and(Object::has_leftovers)
    }

    fn prepare(&mut self, id: u64, asked: PrepareParams) -> Result<(), Refusal> {
        let PrepareParams {
            environment,
            budget,
        } = asked;
        let environment = SharedEnvironment::new(environment);
        let sink = self.channel.sink(id, Some(&budget), Answer::None);
        let object = self.object.as_mut();
        let prepared = object.and_then(|object| object.prepare(&environment, &budget, &sink));
        let Some(result) = prepared else {
            return Err(wrong_object("prepare", self.object.as_ref()));
        };
        self.environment = result.is_ok().then_some(environment);
        self.leave();
        self.channel.reply(id, outcome(result)?);
        Ok(())
    }

    fn dispatch(&mut self, id: u64, method: &str, text: &str) -> Result<(), Refusal> {
        let channel = self.channel;
        match method {
            "initialize" => {
                let InitializeParams {
                    protocol_versions: offered,
                    ..
                } = params(text)?;
                let protocol_version = wire::PROTOCOL_VERSION;
                if !offered.contains(&protocol_version) {
                    let reason =
                        format!("this plugin speaks protocol {protocol_version}, not {offered:?}");
                    return Err(Refusal::new(wire::INVALID_PARAMS, reason));
                }
                let plugins = self.catalog.descriptors();
                channel.reply(
                    id,
                    InitializeResult {
                        protocol_version,
                        plugins,
                        abi_version: self.catalog.abi_version(),
                    },
                );
            }
            "create" => {
                let CreateParams {
                    kind,
                    plugin,
                    options,
                } = params(text)?;
                let options = match options {
                    serde_json::Value::Null => String::new(),
                    options => options.to_string(),
                };
                self.object = None;
                self.environment = None;
                let sink = channel.sink(id, None, Answer::None);
                let made = self
                    .catalog
                    .create(kind, &plugin, Options::new(&options), &sink);
                channel.reply(id, outcome(made.map(|object| self.object = Some(object)))?);
            }
            "prepare" => self.prepare(id, params(text)?)?,
            "plan" => {
                let PlanParams {
                    instance,
                    budget,
                    extensions,
                } = params(text)?;
                let Some(Object::Planner(planner)) = &mut self.object else {
                    return Err(wrong_object(method, self.object.as_ref()));
                };
                let context = plan_context(self.environment.as_ref(), &instance)?;
                let sink = channel.sink(id, Some(&budget), Answer::Plan(context));
                let sink = sink.with(&extensions);
                let began_ns = monotonic_ns();
                let result = planner.plan(&instance, &budget, &sink);
                let call_ns = sink.worked_ns(began_ns);
                self.leave();
                channel.reply(id, plan_result(result, call_ns)?);
            }
            "recover" => {
                let RecoverParams {
                    instance,
                    budget,
                    failed_plan,
                    extensions,
                } = serde_json::from_str(text).map_err(invalid_params)?;
                let Some(Object::FailPolicy(policy)) = &mut self.object else {
                    return Err(wrong_object(method, self.object.as_ref()));
                };
                let context = plan_context(self.environment.as_ref(), &instance)?;
                let failed = match failed_plan {
                    Some(text) => {
                        let text: PlanText<'_> = params_of(text.get())?;
                        let wrong = |reason| Refusal::new(wire::INVALID_PARAMS, reason);
                        context.read(&text).map_err(wrong)?
                    }
                    None => None,
                };
                let sink = channel.sink(id, Some(&budget), Answer::Plan(context));
                let sink = sink.with(&extensions);
                let failed = failed.as_ref();
                let began_ns = monotonic_ns();
                let result = policy.recover(&instance, failed, &budget, &sink);
                let call_ns = sink.worked_ns(began_ns);
                self.leave();
                channel.reply(id, plan_result(result, call_ns)?);
            }
            "generate" => {
                let GenerateParams { state, budget }: GenerateParams = params(text)?;
                let Some(Object::InstanceGenerator(generator)) = &mut self.object else {
                    return Err(wrong_object(method, self.object.as_ref()));
                };
                if let Some(environment) = &self.environment {
                    check_instance(environment, &state.next)?;
                }
                let next = Mutex::new(None);
                let sink = channel.sink(id, Some(&budget), Answer::Request(&next));
                let result = generator.generate(&state, &budget, &sink);
                let Outcome { status, message } = outcome(result)?;
                let request = lock(&next).take();
                self.leave();
                channel.reply(
                    id,
                    GenerateResult {
                        status,
                        message,
                        request,
                    },
                );
            }
            "should_invoke" => {
                let ShouldInvokeParams { status } = params(text)?;
                let Some(Object::InvocationPolicy(policy)) = &mut self.object else {
                    return Err(wrong_object(method, self.object.as_ref()));
                };
                let sink = channel.sink(id, None, Answer::None);
                let invoke = policy
                    .should_invoke(&status, &sink)
                    .map_err(|failure| Refusal::new(wire::INTERNAL_ERROR, failure.to_string()))?;
                channel.reply(id, ShouldInvokeResult { invoke });
            }
            "shutdown" => {
                self.object = None;
                self.environment = None;
                channel.reply(id, serde_json::Value::Null);
            }
            _ => {
                let reason = format!("there is no method `{method}`");
                return Err(Refusal::new(wire::METHOD_NOT_FOUND, reason));
            }
        }
        Ok(())
    }
}

fn params<T: DeserializeOwned>(text: &str) -> Result<T, Refusal> {
    params_of(text)
}

fn params_of<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, Refusal> {
    serde_json::from_str(text).map_err(invalid_params)
}

#[allow(clippy::needless_pass_by_value, reason = "for map_err")]
fn invalid_params(error: serde_json::Error) -> Refusal {
    Refusal::new(wire::INVALID_PARAMS, error.to_string())
}

fn wrong_object(method: &str, object: Option<&Object>) -> Refusal {
    let reason = match object {
        Some(object) => format!("`{method}` is not for a plugin of kind {}", object.kind()),
        None => format!("`{method}` came before a successful `create`"),
    };
    Refusal::new(wire::INVALID_REQUEST, reason)
}

/// The answer to a call that asked for a plan.
fn plan_result(result: Result<(), Failure>, call_ns: u64) -> Result<PlanResult<'static>, Refusal> {
    let Outcome { status, message } = outcome(result)?;
    Ok(PlanResult {
        status,
        message,
        paths: None,
        visits: None,
        trajectories: None,
        call_ns: Some(call_ns),
    })
}

fn outcome(result: Result<(), Failure>) -> Result<Outcome, Refusal> {
    match result {
        Ok(()) => Ok(Outcome {
            status: Status::Solved,
            message: None,
        }),
        Err(Failure {
            message,
            broke_contract: true,
            ..
        }) => Err(Refusal::new(wire::BROKE_CONTRACT, message)),
        Err(Failure {
            status, message, ..
        }) => Ok(Outcome {
            status,
            message: Some(message),
        }),
    }
}

/// The context for the plans of an instance, if the instance fits the map that was prepared.
fn plan_context<'a>(
    environment: Option<&SharedEnvironment>,
    instance: &'a Instance,
) -> Result<PlanContext<'a>, Refusal> {
    let environment = environment.ok_or_else(|| {
        Refusal::new(
            wire::INVALID_REQUEST,
            "the call came before a successful `prepare`",
        )
    })?;
    check_instance(environment, instance)?;
    Ok(PlanContext::new(environment, instance, usize::MAX))
}

/// Refuses an instance that does not fit the map: a library goes by its lengths.
fn check_instance(environment: &SharedEnvironment, instance: &Instance) -> Result<(), Refusal> {
    instance
        .check(environment.places())
        .map_err(|reason| Refusal::new(wire::INVALID_PARAMS, reason))
}

/// State that all calls share: the output for messages, and the request that was cancelled.
struct Channel<'a, W> {
    output: &'a Mutex<W>,
    cancelled: &'a AtomicU64,
}

impl<W> Clone for Channel<'_, W> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<W> Copy for Channel<'_, W> {}

impl<'a, W: Write + Send> Channel<'a, W> {
    fn sink(self, id: u64, budget: Option<&Budget>, answer: Answer<'a>) -> WireSink<'a, W> {
        WireSink {
            channel: self,
            id,
            answer_by_ns: budget.map_or(u64::MAX, |budget| budget.answer_by_ns),
            deadline_ns: budget.map_or(u64::MAX, |budget| budget.deadline_monotonic_ns),
            answer,
            annotations: false,
            thread: thread::current().id(),
            writing_ns: AtomicU64::new(0),
        }
    }

    fn reply<R: Serialize>(self, id: u64, result: R) {
        self.send(&Response::result(id, result));
    }

    /// Sends a notification that says all by its name.
    fn notify(self, method: &str) {
        self.send(&Request::notification(method, ()));
    }

    fn send<M: Serialize>(self, message: &M) {
        let line = wire::line(message);
        let mut output = lock(self.output);
        // A host that has gone away is noticed by the reading thread.
        let _ = output.write_all(&line).and_then(|()| output.flush());
    }
}

/// The kind of answer that a call may submit.
enum Answer<'a> {
    None,
    Plan(PlanContext<'a>),
    Request(&'a Mutex<Option<model::Request>>),
}

struct WireSink<'a, W> {
    channel: Channel<'a, W>,
    id: u64,
    answer_by_ns: u64,
    deadline_ns: u64,
    answer: Answer<'a>,
    /// The host wants annotations.
    annotations: bool,
    /// The call's own thread, and how long it has written messages.
    thread: ThreadId,
    writing_ns: AtomicU64,
}

impl<W: Write + Send> WireSink<'_, W> {
    /// With these extensions of the host.
    fn with(self, extensions: &[Cow<'_, str>]) -> Self {
        Self {
            annotations: extensions.iter().any(|id| id == ANNOTATIONS_ID),
            ..self
        }
    }

    /// Nanoseconds that the call which began at `began_ns` has worked until now.
    fn worked_ns(&self, began_ns: u64) -> u64 {
        (monotonic_ns() - began_ns).saturating_sub(self.writing_ns.load(Ordering::Relaxed))
    }

    /// The host has said that it waits no longer.
    fn given_up(&self) -> bool {
        self.channel.cancelled.load(Ordering::Relaxed) == self.id
    }

    /// Sends a message. What other threads of the plugin send does not keep the call
    /// from its work.
    fn send<T: Serialize>(&self, message: &T) {
        let began_ns = monotonic_ns();
        self.channel.send(message);
        if thread::current().id() == self.thread {
            let spent_ns = monotonic_ns() - began_ns;
            self.writing_ns.fetch_add(spent_ns, Ordering::Relaxed);
        }
    }
}

impl<W: Write + Send> Sink for WireSink<'_, W> {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        let Answer::Plan(context) = self.answer else {
            return Err(Rejected::Malformed);
        };
        if self.given_up() || monotonic_ns() >= self.deadline_ns {
            return Err(Rejected::TooLate);
        }
        let params = WritePlan {
            plan,
            context,
            encoding: PathEncoding::Moves,
        };
        self.send(&Request::notification("incumbent", params));
        Ok(())
    }

    fn submit_request(&self, request: &model::Request) -> Result<(), Rejected> {
        let Answer::Request(next) = self.answer else {
            return Err(Rejected::Malformed);
        };
        *lock(next) = Some(request.clone());
        Ok(())
    }

    fn keep(&self, bytes: &[u8]) -> Result<(), Rejected> {
        if matches!(self.answer, Answer::None) || may_be_kept(bytes.len() as u64).is_err() {
            return Err(Rejected::Malformed);
        }
        if self.given_up() || monotonic_ns() >= self.deadline_ns {
            return Err(Rejected::TooLate);
        }
        let bytes = Kept {
            bytes: bytes.to_vec(),
        };
        self.send(&Request::notification("keep", KeepParams { bytes }));
        Ok(())
    }

    fn note(&self, name: &str, text: &str) {
        let params = NoteParams {
            name: name.into(),
            text: text.into(),
        };
        self.send(&Request::notification("note", params));
    }

    fn metric(&self, name: &str, value: f64) {
        // JSON has no other numbers.
        if value.is_finite() {
            let params = MetricParams {
                name: name.into(),
                value,
            };
            self.send(&Request::notification("metric", params));
        }
    }

    fn log(&self, level: LogLevel, text: &str) {
        let params = LogParams {
            level,
            text: text.into(),
        };
        self.send(&Request::notification("log", params));
    }

    fn progress(&self, done: u64, total: u64) {
        self.send(&Request::notification(
            "progress",
            ProgressParams { done, total },
        ));
    }

    fn cancelled(&self) -> bool {
        self.given_up() || monotonic_ns() >= self.answer_by_ns
    }

    fn annotations(&self) -> Option<&dyn Annotations> {
        self.annotations.then_some(self as &dyn Annotations)
    }
}

impl<W: Write + Send> Annotations for WireSink<'_, W> {
    fn annotate(&self, annotation: &Annotation) -> Result<(), Rejected> {
        self.send(&Request::notification("annotation", annotation));
        Ok(())
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A panic while the lock was held leaves a plain value behind.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
