//! A plugin in a process of its own, which is spoken to in JSON over pipes.

use std::borrow::Cow;
use std::time::Duration;

use fleetyard_abi::c::ANNOTATIONS_ID;
use fleetyard_abi::figures::longest_call_ns;
use fleetyard_abi::memory::may_be_kept;
use fleetyard_abi::paths::WritePlan;
use fleetyard_abi::sdk::Sink;
use fleetyard_abi::wire::{
    CreateParams, GenerateParams, GenerateResult, InitializeParams, InitializeResult, KeepParams,
    Outcome, PROTOCOL_VERSION, Peer, PlanParams, PlanResult, PrepareParams, RecoverParams,
    ShouldInvokeParams, ShouldInvokeResult,
};
use fleetyard_abi::{Budget, FleetState, FleetStatus, Kept, Kind, SharedEnvironment, Status};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use serde_json::value::{RawValue, to_raw_value};

use crate::Fault;
use crate::confinement::promises::BrokenPromise;
use crate::confinement::sandbox::SandboxReport;
use crate::confinement::transport::Transport;
use crate::sessions::attachment::{Attachment, Closing, Generated, no_request};
use crate::sessions::bounds::{INTRODUCTION_BYTES, MESSAGE_BYTES, PLAN_TEXT_BYTES, message_bytes};
use crate::sessions::client::{Client, Deadline, Notice, Reply};
use crate::sessions::collector::Collector;
use crate::sessions::identity;
use crate::sessions::incoming::Expected;
use crate::sessions::message;
use crate::sessions::plan_run::{CallReport, PlanCall, PlanRun, Running, Solver};
use crate::usage::{CallLimits, CallUsage};

/// A part of a request as text: something large is written before the clock of a call begins.
fn write(method: &str, part: &impl Serialize) -> Result<Box<RawValue>, Fault> {
    to_raw_value(part).map_err(|error| Fault::host(format!("cannot write `{method}`"), error))
}

/// The large parts of a request for a plan.
struct Written {
    instance: Box<RawValue>,
    /// The plan that a planner left.
    failed: Option<Box<RawValue>>,
}

impl Written {
    fn of(call: &PlanCall<'_>) -> Result<Self, Fault> {
        let method = call.method();
        let context = call.context()?;
        let failed = match call.solver {
            Solver::Planner => None,
            Solver::FailPolicy(failed) => failed,
        };
        let failed = failed.map(|plan| WritePlan {
            plan: plan.as_ref(),
            context,
            encoding: call.encoding,
        });
        Ok(Self {
            instance: write(method, call.instance)?,
            failed: failed.map(|plan| write(method, &plan)).transpose()?,
        })
    }
}

impl<T: Transport> Client<T> {
    /// Asks a plugin for its descriptors.
    pub(super) fn introduce(&mut self) -> Result<Reply, Fault> {
        let params = InitializeParams {
            protocol_versions: vec![PROTOCOL_VERSION],
            host: Peer {
                name: "fleetyard".into(),
                version: env!("CARGO_PKG_VERSION").into(),
            },
        };
        let deadline = Deadline::after(self.now_ns(), self.limits.startup);
        let expected = Expected {
            bytes: INTRODUCTION_BYTES,
            ..Expected::NO_PLAN
        };
        let figures = &mut nothing_but_figures;
        self.call("initialize", params, deadline, expected, figures)
    }

    /// Asks something whose answer is short and no plan.
    pub(super) fn ask(
        &mut self,
        method: &str,
        params: impl Serialize,
        deadline: Deadline,
    ) -> Result<Reply, Fault> {
        let expected = Expected::NO_PLAN;
        self.call(method, params, deadline, expected, &mut nothing_but_figures)
    }

    /// A call begins, whose limits count from here.
    fn begin_call(
        &mut self,
        method: &str,
        budget: &Budget,
        cpu: Option<Duration>,
    ) -> Result<(), Fault> {
        let limits = CallLimits {
            cpu_ns: cpu.map_or(0, |cpu| cpu.as_nanos() as u64),
            memory_bytes: budget.memory_bytes,
        };
        self.begin(method, limits)
    }

    /// Asks for a plan; what it comes to before it is judged.
    fn ask_for_plan(
        &mut self,
        call: &PlanCall<'_>,
        Written { instance, failed }: Written,
        running: &mut Running,
    ) -> Result<Outcome, Fault> {
        let method = call.method();
        let collector = &running.collector;
        let mut notify = |notice: Notice<'_>| match notice {
            Notice::Incumbent { read, arrived_ns } => {
                let (plan, paths) = read?;
                collector.accept(plan, paths, arrived_ns)
            }
            Notice::Keep(KeepParams { bytes }) => keep(collector, &bytes),
            Notice::Annotation { text, arrived_ns } => {
                collector.accept_annotation(text, arrived_ns)
            }
            Notice::Metric(metric) => {
                collector.metric(&metric.name, metric.value);
                Ok(())
            }
            Notice::Note(note) => {
                collector.note(&note.name, &note.text);
                Ok(())
            }
        };
        let budget = running.budget;
        let deadline = Deadline::from(&budget);
        let context = call.context()?;
        let expected = Expected {
            plan: Some(context),
            // Cells are read as they come; other plans are text until they have ended.
            bytes: context.paths().map_or(PLAN_TEXT_BYTES, |_| MESSAGE_BYTES),
        };
        let extensions: Vec<Cow<'static, str>> = call
            .wants_annotations
            .then_some(ANNOTATIONS_ID.into())
            .into_iter()
            .collect();
        let answer = match call.solver {
            Solver::Planner => {
                let params = PlanParams {
                    instance,
                    budget,
                    extensions,
                };
                self.call(method, params, deadline, expected, &mut notify)?
            }
            Solver::FailPolicy(_) => {
                let params = RecoverParams {
                    instance,
                    budget,
                    failed_plan: failed.as_deref(),
                    extensions,
                };
                self.call(method, params, deadline, expected, &mut notify)?
            }
        };
        let Reply {
            result: text,
            paths: found,
            arrived_ns,
        } = answer;
        let (round_trip, handled) = self.round_trip();
        let timing = &mut running.timing;
        timing.round_trip = Some(round_trip);
        timing.handled = handled;
        let read = || -> Result<Outcome, String> {
            let answer: PlanResult<'_> = result(method, &text)?;
            let plan = answer.plan();
            let PlanResult {
                status,
                message,
                call_ns,
                ..
            } = answer;
            let took_ns = round_trip.as_nanos() as u64;
            if let Some(call_ns) = call_ns.filter(|call_ns| *call_ns > longest_call_ns(took_ns)) {
                return Err(format!(
                    "it claims to have worked for {:?} on a call of {round_trip:?}",
                    Duration::from_nanos(call_ns)
                ));
            }
            timing.claimed = call_ns.map(Duration::from_nanos);
            if plan.is_there() {
                let (plan, paths) = expected.read(&plan, found)?;
                collector.accept(plan, paths, arrived_ns)?;
            }
            Ok(Outcome { status, message })
        };
        read().map_err(|reason| self.condemn(method, Fault::protocol(method, reason)))
    }
}

impl<T: Transport> Attachment for Client<T> {
    fn create(&mut self, kind: Kind, id: &str, options: Value) -> Result<(), Fault> {
        let params = CreateParams {
            kind,
            plugin: id.into(),
            options,
        };
        let deadline = Deadline::after(self.now_ns(), self.limits.startup);
        let answer = self.ask("create", params, deadline)?;
        succeeded("create", read("create", &answer)?)?;
        // From here on it has nothing to do until it is called.
        self.finish("create").map(drop)
    }

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
    ) -> Result<CallReport, Fault> {
        let environment = write("prepare", environment.as_ref())?;
        self.begin_call("prepare", budget, self.limits.prepare_cpu)?;
        let started = self.now_ns();
        let budget = budget.starting(started);
        let params = PrepareParams {
            environment,
            budget,
        };
        let answer = self.ask("prepare", params, Deadline::from(&budget))?;
        succeeded("prepare", read("prepare", &answer)?)?;
        let wall = Duration::from_nanos(self.now_ns() - started);
        let usage = self.finish("prepare")?;
        Ok(CallReport { wall, usage })
    }

    fn set_grace(&mut self, grace: Duration) {
        self.limits.grace = grace;
    }

    fn solve(&mut self, call: &PlanCall<'_>, budget: &Budget) -> PlanRun {
        let written = Written::of(call);
        let begun = self.begin_call(call.method(), budget, self.limits.cpu);
        let written = begun.and(written);
        let mut running = Running::begin(call, budget, || self.now_ns());
        let called = written.and_then(|written| self.ask_for_plan(call, written, &mut running));
        let ended = running.end(self.now_ns());
        // Whatever it answered: what nobody watched does not count.
        let (usage, called) = match self.finish(call.method()) {
            Ok(usage) => (usage, called),
            Err(fault) => (CallUsage::default(), Err(fault)),
        };
        ended.run(called, usage, self.over())
    }

    fn generate(&mut self, state: &FleetState, budget: &Budget) -> Result<Generated, Fault> {
        let method = "generate";
        let written = write(method, state)?;
        self.begin_call(method, budget, self.limits.cpu)?;
        let budget = budget.starting(self.now_ns());
        let params = GenerateParams {
            state: written,
            budget,
        };
        let expected = Expected {
            bytes: message_bytes(state.next.agents()),
            ..Expected::NO_PLAN
        };
        let collector = Collector::idle(budget.answer_by_ns);
        let notify = &mut |notice: Notice<'_>| match notice {
            Notice::Keep(KeepParams { bytes }) => keep(&collector, &bytes),
            notice => nothing_but_figures(notice),
        };
        let answer = self.call(method, params, Deadline::from(&budget), expected, notify)?;
        let GenerateResult {
            status,
            message,
            request,
        } = read(method, &answer)?;
        succeeded(method, Outcome { status, message })?;
        Ok(Generated {
            request: request.ok_or_else(|| no_request(method))?,
            kept: collector.into_inner().kept,
        })
    }

    fn should_invoke(&mut self, status: &FleetStatus, limit: Duration) -> Result<bool, Fault> {
        let method = "should_invoke";
        let params = ShouldInvokeParams {
            status: write(method, status)?,
        };
        let answer = self.ask(method, params, Deadline::after(self.now_ns(), limit))?;
        read(method, &answer).map(|ShouldInvokeResult { invoke }| invoke)
    }

    fn sandbox(&self) -> Option<&SandboxReport> {
        self.transport.sandbox()
    }

    fn broken_promises(&mut self) -> &[BrokenPromise] {
        &[]
    }

    fn close(&mut self) -> Closing {
        let (report, fault) = self.shut_down(self.limits.ending);
        let (stderr, stderr_dropped) = self.stderr();
        Closing {
            usage: report.usage,
            fault,
            stderr,
            stderr_dropped,
            log: self.log.take(),
            stray_lines: self.stray_lines,
            sandbox: Some(report.sandbox),
            over: report.over.filter(|_| report.killed),
            kill_latency: report.kill_us.map(Duration::from_micros),
            environment: report.environment,
            broken_promises: Vec::new(),
        }
    }
}

/// The plugins that an introduction describes, with the version of the C ABI that they were
/// built for.
pub(super) fn introduced(answer: &Reply) -> Result<InitializeResult, Fault> {
    let mut introduced: InitializeResult = read("initialize", answer)?;
    let version = introduced.protocol_version;
    let breach = |reason| Fault::protocol("initialize", reason);
    if version != PROTOCOL_VERSION {
        let reason = format!("it chose protocol {version}, which was not offered");
        return Err(breach(reason));
    }
    let plugins = introduced.plugins.into_iter().map(identity::introduced);
    introduced.plugins = plugins.collect::<Result<_, _>>().map_err(breach)?;
    Ok(introduced)
}

fn read<T: DeserializeOwned>(method: &str, answer: &Reply) -> Result<T, Fault> {
    result(method, &answer.result).map_err(|reason| Fault::protocol(method, reason))
}

fn result<'a, T: Deserialize<'a>>(method: &str, answer: &'a str) -> Result<T, String> {
    message::payload(&format!("the result of `{method}`"), answer)
}

/// Keeps bytes, or says how they break the protocol.
fn keep(collector: &Collector, Kept { bytes }: &Kept) -> Result<(), String> {
    may_be_kept(bytes.len() as u64)?;
    // What comes too late is not kept.
    let _ = collector.keep(bytes);
    Ok(())
}

/// In calls that ask for no plan, figures are nobody's, and a plan is a breach.
fn nothing_but_figures(notice: Notice<'_>) -> Result<(), String> {
    match notice {
        Notice::Incumbent { read, .. } => read.map(drop),
        Notice::Keep(_) => Err("bytes were kept in a call that keeps none".into()),
        Notice::Annotation { .. } | Notice::Metric(_) | Notice::Note(_) => Ok(()),
    }
}

fn succeeded(method: &str, outcome: Outcome) -> Result<(), Fault> {
    match outcome.status {
        Status::Solved => Ok(()),
        status => Err(Fault::reported(method, status, outcome.message)),
    }
}
