//! Calls that ask for a plan: what they ask, how they are measured, and how they end.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Duration;

use fleetyard_abi::paths::PlanContext;
use fleetyard_abi::wire::Outcome;
use fleetyard_abi::{Budget, Environment, GridPlan, Instance, PathEncoding, Plan, Status};
use rustix::time::{ClockId, clock_gettime};
use serde::Serialize;

use crate::Fault;
use crate::interrupt::Interruptible;
use crate::sessions::annotated::Annotated;
use crate::sessions::bounds::plan_cells;
use crate::sessions::collector::{Collected, Collector, Follow, Incumbent};
use crate::sessions::log::Log;
use crate::usage::{CallUsage, Limit};

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
    /// The time of this thread so far.
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
    /// Facts that the plugin noted about its inputs.
    pub notes: BTreeMap<String, String>,
    /// The bytes that it wants to have with its next call, if it kept some and the call ended well
    /// and in time.
    pub kept: Option<Vec<u8>>,
    /// The plugin's annotations, where it is asked for them.
    pub annotations: Annotated,
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
            notes: BTreeMap::new(),
            kept: None,
            annotations: Annotated::default(),
            planning: Duration::ZERO,
            call: None,
            round_trip: None,
            held_up: None,
            host: HostTime::default(),
        }
    }

    /// The plan that counts.
    pub fn plan(&self) -> Option<&Plan> {
        self.incumbents
            .last()
            .and_then(|incumbent| incumbent.plan.as_ref())
    }

    /// The plan that counts, if it is one on a grid.
    pub fn cells(&self) -> Option<&GridPlan> {
        self.plan().and_then(Plan::cells)
    }
}

/// The plugin that is asked for a plan.
#[derive(Clone, Copy)]
pub(super) enum Solver<'a> {
    /// A planner.
    Planner,
    /// A fail policy, with what the planner left, if it left something.
    FailPolicy(Option<&'a Plan>),
}

/// A call that asks for a plan.
#[derive(Clone, Copy)]
pub(super) struct PlanCall<'a> {
    pub(super) solver: Solver<'a>,
    pub(super) instance: &'a Instance,
    /// The map, if the plugin was told one.
    pub(super) environment: Option<&'a Environment>,
    /// The encoding in which the plugin wants to read paths.
    pub(super) encoding: PathEncoding,
    /// Somebody wants to see its annotations.
    pub(super) wants_annotations: bool,
    /// Is told of plans as they come.
    pub(super) follower: Option<&'a Arc<dyn Follow>>,
}

impl<'a> PlanCall<'a> {
    /// The name of the call.
    pub(super) fn method(&self) -> &'static str {
        match self.solver {
            Solver::Planner => "plan",
            Solver::FailPolicy(_) => "recover",
        }
    }

    /// Cells of the map, or vertices; 0 in the plane.
    fn places(&self) -> usize {
        self.environment.and_then(Environment::places).unwrap_or(0)
    }

    /// The context in which plans are read and written; a fault without a map.
    pub(super) fn context(&self) -> Result<PlanContext<'a>, Fault> {
        let Some(environment) = self.environment else {
            return Err(Fault::reported(self.method(), Status::InvalidInput, None));
        };
        let most = plan_cells(self.instance, self.places());
        Ok(PlanContext::new(environment, self.instance, most))
    }
}

/// A call for a plan that is under way, with the clock and what it collects.
pub(super) struct Running {
    method: &'static str,
    /// The budget with its deadline.
    pub(super) budget: Budget,
    pub(super) collector: Collector,
    pub(super) timing: Timing,
    host: HostTime,
    interruptible: Interruptible,
}

/// The time that a call took.
#[derive(Default)]
pub(super) struct Timing {
    /// As the plugin says.
    pub(super) claimed: Option<Duration>,
    pub(super) round_trip: Option<Duration>,
    /// Part of it in which the host handled messages.
    pub(super) handled: Duration,
}

impl Running {
    /// The call begins; `now_ns` reads the clock of the attachment.
    pub(super) fn begin(call: &PlanCall<'_>, budget: &Budget, now_ns: impl Fn() -> u64) -> Self {
        let interruptible = Interruptible::begin();
        let host = HostTime::now();
        let began_ns = now_ns();
        let budget = budget.starting(began_ns);
        Self {
            method: call.method(),
            budget,
            collector: Collector::new(
                call.instance,
                call.places() as u32,
                &budget,
                began_ns,
                call.wants_annotations,
                call.follower.cloned(),
            ),
            timing: Timing::default(),
            host,
            interruptible,
        }
    }

    /// The call has ended at a time.
    pub(super) fn end(self, ended_ns: u64) -> Ended {
        drop(self.interruptible);
        Ended {
            method: self.method,
            host: HostTime::now().since(self.host),
            planning: Duration::from_nanos(ended_ns - self.collector.started_ns),
            overdue: ended_ns > self.budget.deadline_monotonic_ns,
            timing: self.timing,
            collected: self.collector.into_inner(),
        }
    }
}

/// A call for a plan that has ended, before it is said how.
pub(super) struct Ended {
    method: &'static str,
    host: HostTime,
    planning: Duration,
    /// The deadline was over.
    overdue: bool,
    timing: Timing,
    collected: Collected,
}

impl Ended {
    /// True once the plugin has submitted something that breaks the protocol.
    pub(super) fn broke_protocol(&self) -> bool {
        self.collected.fault.is_some()
    }

    /// The log of the call.
    pub(super) fn take_log(&mut self) -> Log {
        std::mem::take(&mut self.collected.log)
    }

    /// The outcome, given the plugin's answer and the limit that was found exceeded.
    pub(super) fn run(
        self,
        called: Result<Outcome, Fault>,
        usage: CallUsage,
        over: Option<Limit>,
    ) -> PlanRun {
        let Collected {
            incumbents,
            late,
            metrics,
            notes,
            kept,
            annotations,
            fault,
            ..
        } = self.collected;
        let method = self.method;
        // A library's plan is rejected after the deadline before it gets here; one
        // that claims success all the same is late, not silent.
        let silent = incumbents.is_empty() && late == 0 && !self.overdue;
        let called = called.and_then(|outcome| match fault {
            Some(reason) => Err(Fault::protocol(method, reason)),
            None if silent && outcome.status == Status::Solved => Err(Fault::protocol(
                method,
                "it claims `solved` but submitted no plan",
            )),
            None => Ok(outcome),
        });
        let mut run = PlanRun {
            termination: Termination::Completed,
            claim: None,
            message: None,
            fault: None,
            incumbents,
            late,
            metrics,
            notes,
            kept,
            annotations,
            planning: self.planning,
            call: self.timing.claimed,
            round_trip: self.timing.round_trip,
            held_up: self
                .host
                .run_delay
                .map(|waited| waited + self.timing.handled),
            host: self.host,
            usage,
            stopped: false,
            limit: over.or(self.overdue.then_some(Limit::Wall)),
        };
        let fault = match called {
            Ok(Outcome { status, message }) => {
                run.claim = Some(status);
                run.message = message;
                if run.incumbents.is_empty() && (run.late > 0 || status == Status::Solved) {
                    run.termination = Termination::TimedOut;
                }
                matches!(
                    status,
                    Status::Unsupported | Status::InvalidInput | Status::InternalError
                )
                .then(|| Fault::reported(method, status, run.message.clone()))
            }
            Err(fault) => {
                run.stopped = fault.is_stop();
                run.limit = fault.limit();
                Some(fault)
            }
        };
        if let Some(fault) = fault {
            run.termination = Termination::from(&fault);
            run.fault = Some(fault);
        }
        if run.termination != Termination::Completed {
            run.kept = None;
        }
        run
    }
}
