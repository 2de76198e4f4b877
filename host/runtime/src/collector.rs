//! What a plugin submits during a call, whichever way it comes.

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use fleetyard_abi::convert::wrong_agents;
use fleetyard_abi::sdk::{Rejected, Sink};
use fleetyard_abi::{Budget, Instance, LogLevel, Plan, PlanRef, monotonic_ns};

use crate::convert::plan_from_abi;
use crate::log::Log;
use crate::session::{Incumbent, Limits};

/// Takes what a plugin submits during a call, whichever way it comes.
pub(crate) struct Collector {
    /// Of the map.
    cells: u32,
    pub(crate) started_ns: u64,
    deadline_ns: u64,
    agents: Option<usize>,
    kept_cells: usize,
    log_bytes: usize,
    most_incumbents: usize,
    collected: Mutex<Collected>,
}

#[derive(Default)]
pub(crate) struct Collected {
    pub(crate) incumbents: Vec<Incumbent>,
    cells: usize,
    pub(crate) late: u64,
    pub(crate) metrics: BTreeMap<String, f64>,
    pub(crate) log: Log,
    pub(crate) instance: Option<Instance>,
    pub(crate) fault: Option<String>,
}

impl Collector {
    pub(crate) fn new(instance: &Instance, cells: u32, budget: &Budget, limits: &Limits) -> Self {
        Self {
            cells,
            started_ns: monotonic_ns(),
            deadline_ns: budget.deadline_monotonic_ns,
            agents: Some(instance.agents()),
            kept_cells: limits.kept_cells,
            log_bytes: limits.log_bytes,
            most_incumbents: limits.incumbents,
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
            kept_cells: 0,
            log_bytes: Limits::default().log_bytes,
            most_incumbents: 0,
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

    pub(crate) fn into_log(self) -> Log {
        self.into_inner().log
    }

    /// Keeps a plan, or says why it breaks the protocol.
    pub(crate) fn accept(&self, plan: &Plan, arrived_ns: u64) -> Result<(), String> {
        self.accept_ref(plan.as_ref(), arrived_ns)
    }

    fn accept_ref(&self, plan: PlanRef<'_>, arrived_ns: u64) -> Result<(), String> {
        let Some(agents) = self.agents else {
            return Err("a plan was submitted in a call that asks for none".into());
        };
        if plan.agents() != agents {
            return Err(wrong_agents(plan.agents(), agents));
        }
        let mut collected = self.lock();
        if arrived_ns > self.deadline_ns {
            collected.late += 1;
            return Ok(());
        }
        collected.cells += plan.cells().len();
        if collected.cells > self.kept_cells {
            for incumbent in &mut collected.incumbents {
                incumbent.plan = None;
            }
            collected.cells = plan.cells().len();
        }
        let arrived = Duration::from_nanos(arrived_ns.saturating_sub(self.started_ns));
        if collected.incumbents.len() >= self.most_incumbents {
            collected.incumbents.pop();
        }
        collected.incumbents.push(Incumbent {
            arrived,
            plan: Some(plan_from_abi(plan, self.cells)),
        });
        Ok(())
    }
}

impl Sink for Collector {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
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
        const MOST: usize = 1000;
        const LONGEST_NAME: usize = 256;
        let mut collected = self.lock();
        if value.is_finite()
            && name.len() <= LONGEST_NAME
            && (collected.metrics.len() < MOST || collected.metrics.contains_key(name))
        {
            collected.metrics.insert(name.to_owned(), value);
        }
    }

    fn log(&self, level: LogLevel, text: &str) {
        let mut collected = self.lock();
        collected.log.push(level, text, self.log_bytes);
    }

    fn progress(&self, _: u64, _: u64) {}

    fn cancelled(&self) -> bool {
        monotonic_ns() >= self.deadline_ns
    }
}
