//! A host that takes notes.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use fleetyard_abi::sdk::{Rejected, Sink};
use fleetyard_abi::{GridPlan, Instance, LogLevel};

/// Accepts and keeps everything that is submitted.
#[derive(Debug, Default)]
pub struct Notes {
    /// All plans, in the order in which they came.
    pub plans: Mutex<Vec<GridPlan>>,
    /// The last instance.
    pub instance: Mutex<Option<Instance>>,
    /// The answer to a plugin that asks for it.
    pub cancelled: AtomicBool,
}

impl Sink for Notes {
    fn submit_plan(&self, plan: &GridPlan) -> Result<(), Rejected> {
        self.plans.lock().unwrap().push(plan.clone());
        Ok(())
    }
    fn submit_instance(&self, instance: &Instance) -> Result<(), Rejected> {
        *self.instance.lock().unwrap() = Some(instance.clone());
        Ok(())
    }
    fn metric(&self, _: &str, _: f64) {}
    fn log(&self, _: LogLevel, _: &str) {}
    fn progress(&self, _: u64, _: u64) {}
    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}
