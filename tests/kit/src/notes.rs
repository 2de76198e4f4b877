//! A host that takes notes.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use fleetyard_abi::sdk::{Rejected, Sink};
use fleetyard_abi::{GridPlan, LogLevel, Plan, PlanRef, Request};

/// Accepts and keeps everything that is submitted.
#[derive(Debug, Default)]
pub struct Notes {
    /// All plans on grids, in the order in which they came.
    pub plans: Mutex<Vec<GridPlan>>,
    /// All plans on roadmaps and in the plane, in the order in which they came.
    pub others: Mutex<Vec<Plan>>,
    /// The last request.
    pub request: Mutex<Option<Request>>,
    /// All figures, in the order in which they came.
    pub figures: Mutex<Vec<(String, f64)>>,
    /// The answer to a plugin that asks for it.
    pub cancelled: AtomicBool,
}

impl Sink for Notes {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        match plan {
            PlanRef::Cells(plan) => self.plans.lock().unwrap().push(plan.clone()),
            other => self.others.lock().unwrap().push(other.to_plan()),
        }
        Ok(())
    }
    fn submit_request(&self, request: &Request) -> Result<(), Rejected> {
        *self.request.lock().unwrap() = Some(request.clone());
        Ok(())
    }
    fn note(&self, _: &str, _: &str) {}
    fn metric(&self, name: &str, value: f64) {
        self.figures.lock().unwrap().push((name.to_owned(), value));
    }
    fn log(&self, _: LogLevel, _: &str) {}
    fn progress(&self, _: u64, _: u64) {}
    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}
