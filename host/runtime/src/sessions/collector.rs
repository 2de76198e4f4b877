//! Plans and figures that a plugin submits during a call, whichever way they come.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use fleetyard_abi::convert::wrong_agents;
use fleetyard_abi::sdk::{Rejected, Sink};
use fleetyard_abi::{Budget, GridPlan, Instance, LogLevel, monotonic_ns};

use crate::interrupt::interrupted_by;
use crate::sessions::bounds::{
    INCUMBENTS, LOG_BYTES, METRIC_NAME_BYTES, METRICS, OLDER_BYTES, plan_bytes,
};
use crate::sessions::convert::plan_from_abi;
use crate::sessions::log::Log;
use crate::sessions::plan_run::Incumbent;

/// Takes what a plugin submits during a call, whichever way it comes.
pub(crate) struct Collector {
    /// Of the map.
    cells: u32,
    pub(crate) started_ns: u64,
    deadline_ns: u64,
    agents: Option<usize>,
    collected: Mutex<Collected>,
}

#[derive(Default)]
pub(crate) struct Collected {
    pub(crate) incumbents: Vec<Incumbent>,
    /// The first of them that has its plan, and the memory of all plans but the last.
    oldest: usize,
    older_bytes: usize,
    pub(crate) late: u64,
    pub(crate) metrics: BTreeMap<String, f64>,
    pub(crate) log: Log,
    pub(crate) instance: Option<Instance>,
    pub(crate) fault: Option<String>,
}

impl Collector {
    /// For a call that began then.
    pub(crate) fn new(instance: &Instance, cells: u32, budget: &Budget, started_ns: u64) -> Self {
        Self {
            cells,
            started_ns,
            deadline_ns: budget.deadline_monotonic_ns,
            agents: Some(instance.agents()),
            collected: Mutex::default(),
        }
    }

    /// For calls that ask for no plan.
    pub(crate) fn idle() -> Self {
        Self {
            cells: 0,
            started_ns: monotonic_ns(),
            deadline_ns: u64::MAX,
            agents: None,
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
    pub(crate) fn accept(
        &self,
        plan: GridPlan,
        paths: usize,
        arrived_ns: u64,
    ) -> Result<(), String> {
        if !self.is_wanted(paths, arrived_ns)? {
            return Ok(());
        }
        self.keep(plan, arrived_ns);
        Ok(())
    }

    fn accept_ref(&self, plan: &GridPlan, arrived_ns: u64) -> Result<(), String> {
        if self.is_wanted(plan.agents(), arrived_ns)? {
            self.keep(plan_from_abi(plan, self.cells), arrived_ns);
        }
        Ok(())
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

    fn keep(&self, plan: GridPlan, arrived_ns: u64) {
        let arrived = Duration::from_nanos(arrived_ns.saturating_sub(self.started_ns));
        self.lock().keep(arrived, plan);
    }
}

impl Collected {
    /// The last plan is kept whatever its size, and of the older ones as many as there is
    /// memory for.
    fn keep(&mut self, arrived: Duration, plan: GridPlan) {
        let bytes = |plan: &GridPlan| plan_bytes(plan.agents(), plan.cells().len());
        if self.incumbents.len() >= INCUMBENTS {
            self.incumbents.pop();
        } else if let Some(last) = self.incumbents.last() {
            self.older_bytes += last.plan.as_ref().map_or(0, bytes);
        }
        while self.older_bytes > OLDER_BYTES
            && let Some(oldest) = self.incumbents.get_mut(self.oldest)
        {
            self.older_bytes -= oldest.plan.take().as_ref().map_or(0, bytes);
            self.oldest += 1;
        }
        self.incumbents.push(Incumbent {
            arrived,
            plan: Some(plan),
        });
    }
}

impl Sink for Collector {
    fn submit_plan(&self, plan: &GridPlan) -> Result<(), Rejected> {
        let arrived = monotonic_ns();
        if let Err(reason) = self.accept_ref(plan, arrived) {
            self.lock().fault.get_or_insert(reason);
            return Err(Rejected);
        }
        if arrived > self.deadline_ns {
            Err(Rejected)
        } else {
            Ok(())
        }
    }

    fn submit_instance(&self, instance: &Instance) -> Result<(), Rejected> {
        self.lock().instance = Some(instance.clone());
        Ok(())
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
        monotonic_ns() >= self.deadline_ns || interrupted_by().is_some()
    }
}
