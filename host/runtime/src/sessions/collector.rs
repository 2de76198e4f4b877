//! Plans and figures that a plugin submits during a call, whichever way they come.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use fleetyard_abi::convert::wrong_agents;
use fleetyard_abi::memory::may_be_kept;
use fleetyard_abi::paths::PlanContext;
use fleetyard_abi::sdk::{Annotations, Rejected, Sink};
use fleetyard_abi::{Annotation, Budget, Instance, LogLevel, Plan, PlanRef, Request, monotonic_ns};

use crate::interrupt::interrupted_by;
use crate::sessions::annotated::Annotated;
use crate::sessions::bounds::{
    INCUMBENTS, LOG_BYTES, METRIC_NAME_BYTES, METRICS, NOTE_BYTES, OLDER_BYTES,
};
use crate::sessions::convert::plan_from_abi;
use crate::sessions::log::Log;
use crate::sessions::message::payload;

/// A plan and when it came.
#[derive(Debug, Clone)]
pub struct Incumbent {
    /// From the start of the call to the arrival of the plan's last byte.
    pub arrived: Duration,
    /// The plan; absent when too many were submitted to keep them all.
    pub plan: Option<Plan>,
}

/// Is told of plans while the call goes on, by the thread that reads them: it has to be quick.
pub trait Follow: fmt::Debug + Send + Sync {
    /// A plan came so long after the call began. Nobody has judged it. `metrics` are the figures
    /// that the plugin has reported of itself so far.
    fn incumbent(&self, plan: PlanRef<'_>, arrived: Duration, metrics: &BTreeMap<String, f64>);
}

/// Takes what a plugin submits during a call, whichever way it comes.
pub(crate) struct Collector {
    /// Cells of the map, or vertices.
    places: u32,
    pub(crate) started_ns: u64,
    answer_by_ns: u64,
    deadline_ns: u64,
    agents: Option<usize>,
    wants_annotations: bool,
    follower: Option<Arc<dyn Follow>>,
    collected: Mutex<Collected>,
}

#[derive(Default)]
pub(crate) struct Collected {
    pub(crate) incumbents: Vec<Incumbent>,
    /// The last of them that has lost its plan, and the memory of all plans but the last.
    lost: usize,
    older_bytes: usize,
    pub(crate) late: u64,
    pub(crate) metrics: BTreeMap<String, f64>,
    pub(crate) notes: BTreeMap<String, String>,
    pub(crate) annotations: Annotated,
    pub(crate) log: Log,
    pub(crate) request: Option<Request>,
    pub(crate) kept: Option<Vec<u8>>,
    pub(crate) fault: Option<String>,
}

impl Collector {
    /// For a call that began then, with annotations if they are wanted. `follower` is told of its
    /// plans as they come.
    pub(crate) fn new(
        instance: &Instance,
        places: u32,
        budget: &Budget,
        started_ns: u64,
        wants_annotations: bool,
        follower: Option<Arc<dyn Follow>>,
    ) -> Self {
        Self {
            places,
            started_ns,
            answer_by_ns: budget.answer_by_ns,
            deadline_ns: budget.deadline_monotonic_ns,
            agents: Some(instance.agents()),
            wants_annotations,
            follower,
            collected: Mutex::default(),
        }
    }

    /// For calls that ask for no plan, and are told to stop then.
    pub(crate) fn idle(answer_by_ns: u64) -> Self {
        Self {
            places: 0,
            started_ns: monotonic_ns(),
            answer_by_ns,
            deadline_ns: u64::MAX,
            agents: None,
            wants_annotations: false,
            follower: None,
            collected: Mutex::default(),
        }
    }

    fn lock(&self) -> MutexGuard<'_, Collected> {
        // A panic while the lock was held leaves plain values behind.
        self.collected
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn into_inner(self) -> Collected {
        self.collected
            .into_inner()
            .unwrap_or_else(PoisonError::into_inner)
    }

    /// Keeps a plan that was read from so many paths on a map of this size, or says why it
    /// breaks the protocol.
    pub(crate) fn accept(&self, plan: Plan, paths: usize, arrived_ns: u64) -> Result<(), String> {
        if !self.is_wanted(paths, arrived_ns)? {
            return Ok(());
        }
        self.keep(plan, arrived_ns);
        Ok(())
    }

    fn accept_ref(&self, plan: PlanRef<'_>, arrived_ns: u64) -> Result<(), String> {
        if self.is_wanted(plan.agents(), arrived_ns)? {
            let plan = match plan {
                PlanRef::Cells(plan) => Plan::Cells(plan_from_abi(plan, self.places)),
                other => other.to_plan(),
            };
            self.keep(plan, arrived_ns);
        }
        Ok(())
    }

    /// Keeps an annotation as it came, if anybody wants it, or says why it breaks the protocol.
    pub(crate) fn accept_annotation(&self, text: &str, arrived_ns: u64) -> Result<(), String> {
        let (true, Some(agents)) = (self.wants_annotations, self.agents) else {
            return Ok(());
        };
        let annotation: Annotation = payload("`annotation`", text)?;
        annotation.check(agents, self.places as usize)?;
        self.keep_annotation(&annotation, arrived_ns).or(Ok(()))
    }

    fn keep_annotation(&self, annotation: &Annotation, arrived_ns: u64) -> Result<(), Rejected> {
        let mut collected = self.lock();
        if arrived_ns > self.deadline_ns {
            collected.annotations.leave_out();
            Err(Rejected::TooLate)
        } else if collected.annotations.keep(annotation) {
            Ok(())
        } else {
            Err(Rejected::Busy)
        }
    }

    /// A plan of another form than the map takes breaks the contract.
    pub(crate) fn check_forms(&self, context: &PlanContext<'_>) {
        let mut collected = self.lock();
        let mut plans = collected
            .incumbents
            .iter()
            .filter_map(|one| one.plan.as_ref());
        if let Some(reason) = plans.find_map(|plan| context.check(plan.as_ref()).err()) {
            collected.fault.get_or_insert(reason);
        }
    }

    /// A plan of so many paths counts, unless it is late or breaks the protocol.
    fn is_wanted(&self, paths: usize, arrived_ns: u64) -> Result<bool, String> {
        let Some(agents) = self.agents else {
            return Err("a plan was submitted in a call that asks for none".into());
        };
        if paths != agents {
            return Err(wrong_agents(paths, agents));
        }
        let late = arrived_ns > self.deadline_ns;
        if late {
            self.lock().late += 1;
        }
        Ok(!late)
    }

    fn keep(&self, plan: Plan, arrived_ns: u64) {
        let arrived = Duration::from_nanos(arrived_ns.saturating_sub(self.started_ns));
        if let Some(follower) = &self.follower {
            let metrics = self.lock().metrics.clone();
            follower.incumbent(plan.as_ref(), arrived, &metrics);
        }
        self.lock().keep(arrived, plan);
    }
}

impl Collected {
    /// The last plan is kept whatever its size, and of the older ones as many as there is memory
    /// for: the newest, and the first, by which a planner's time to a solution is known.
    fn keep(&mut self, arrived: Duration, plan: Plan) {
        let bytes = |plan: &Plan| plan.as_ref().bytes();
        if self.incumbents.len() >= INCUMBENTS {
            self.incumbents.pop();
        } else if let Some(last) = self.incumbents.last() {
            self.older_bytes += last.plan.as_ref().map_or(0, bytes);
        }
        while self.older_bytes > OLDER_BYTES {
            let mut next = (self.lost + 1..self.incumbents.len()).chain([0]);
            let Some(goes) = next.find(|at| self.incumbents[*at].plan.is_some()) else {
                break;
            };
            self.older_bytes -= self.incumbents[goes].plan.take().as_ref().map_or(0, bytes);
            self.lost = self.lost.max(goes);
        }
        self.incumbents.push(Incumbent {
            arrived,
            plan: Some(plan),
        });
    }
}

impl Sink for Collector {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        let arrived = monotonic_ns();
        if let Err(reason) = self.accept_ref(plan, arrived) {
            self.lock().fault.get_or_insert(reason);
            return Err(Rejected::Malformed);
        }
        if arrived > self.deadline_ns {
            Err(Rejected::TooLate)
        } else {
            Ok(())
        }
    }

    fn submit_request(&self, request: &Request) -> Result<(), Rejected> {
        self.lock().request = Some(request.clone());
        Ok(())
    }

    fn keep(&self, bytes: &[u8]) -> Result<(), Rejected> {
        if let Err(reason) = may_be_kept(bytes.len() as u64) {
            self.lock().fault.get_or_insert(reason);
            return Err(Rejected::Malformed);
        }
        if monotonic_ns() > self.deadline_ns {
            return Err(Rejected::TooLate);
        }
        self.lock().kept = Some(bytes.to_vec());
        Ok(())
    }

    fn note(&self, name: &str, text: &str) {
        let mut collected = self.lock();
        if name.len() <= METRIC_NAME_BYTES
            && text.len() <= NOTE_BYTES
            && (collected.notes.len() < METRICS || collected.notes.contains_key(name))
        {
            collected.notes.insert(name.to_owned(), text.to_owned());
        }
    }

    fn metric(&self, name: &str, value: f64) {
        let mut collected = self.lock();
        if value.is_finite()
            && name.len() <= METRIC_NAME_BYTES
            && (collected.metrics.len() < METRICS || collected.metrics.contains_key(name))
        {
            collected.metrics.insert(name.to_owned(), value);
        }
    }

    fn log(&self, level: LogLevel, text: &str) {
        self.lock().log.push(level, text, LOG_BYTES);
    }

    fn progress(&self, _: u64, _: u64) {}

    fn cancelled(&self) -> bool {
        monotonic_ns() >= self.answer_by_ns || interrupted_by().is_some()
    }

    fn annotations(&self) -> Option<&dyn Annotations> {
        self.wants_annotations.then_some(self as &dyn Annotations)
    }
}

impl Annotations for Collector {
    fn annotate(&self, annotation: &Annotation) -> Result<(), Rejected> {
        self.keep_annotation(annotation, monotonic_ns())
    }
}
