//! Stands for the host in tests: a sink that keeps the last answer.

#![allow(dead_code, reason = "a test uses what its kind of plugin needs")]

use std::sync::{Arc, Mutex};

use fleetyard_abi::sdk::{Rejected, Sink};
use fleetyard_abi::{Budget, GridEnvironment, LogLevel, Plan, PlanRef, Request, SharedEnvironment};

#[derive(Default)]
pub struct Host {
    pub plan: Mutex<Option<Plan>>,
    pub paths: Mutex<Vec<Vec<u32>>>,
    pub goals: Mutex<Vec<Vec<u32>>>,
}

impl Sink for Host {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        let plan = plan.to_plan();
        if let Plan::Cells(cells) = &plan {
            *self.paths.lock().unwrap() = cells.paths().map(<[u32]>::to_vec).collect();
        }
        *self.plan.lock().unwrap() = Some(plan);
        Ok(())
    }
    fn submit_request(&self, request: &Request) -> Result<(), Rejected> {
        *self.goals.lock().unwrap() = request.goals.iter().map(<[u32]>::to_vec).collect();
        Ok(())
    }
    fn note(&self, _: &str, _: &str) {}
    fn metric(&self, _: &str, _: f64) {}
    fn log(&self, _: LogLevel, _: &str) {}
    fn progress(&self, _: u64, _: u64) {}
    fn cancelled(&self) -> bool {
        false
    }
}

pub const BUDGET: Budget = Budget {
    deadline_monotonic_ns: u64::MAX,
    answer_by_ns: u64::MAX,
    wall_ns: u64::MAX,
    nodes: 0,
    memory_bytes: 0,
    threads: 1,
    seed: 1,
};

/// A map of rows, `.` where a robot may stand.
pub fn map(rows: &[&str]) -> SharedEnvironment {
    let (height, width) = (rows.len() as u32, rows[0].len() as u32);
    let letters = rows.concat().into_bytes();
    let passable = letters.iter().map(|letter| u8::from(*letter == b'.'));
    Arc::new(GridEnvironment::four_connected(height, width, passable.collect()).into())
}
