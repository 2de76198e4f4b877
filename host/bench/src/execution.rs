//! The execution of a trial's plan.

use std::time::Instant;

use fleetyard_sim::{Plan as Planned, SimError, Simulator, TraceSink};

use crate::record::{ExecutionInfo, milliseconds};

/// Executes a plan and takes the time.
pub fn execute<'p>(
    simulator: &Simulator<'_>,
    plan: impl Into<Planned<'p>>,
    trace: &mut dyn TraceSink,
) -> Result<ExecutionInfo, SimError> {
    let started = Instant::now();
    let outcome = simulator.run(plan, trace)?;
    let wall = started.elapsed();
    Ok(ExecutionInfo {
        figures: outcome.figures(wall.as_secs_f64()),
        policy: outcome.policy,
        agents: outcome.agents,
        arrived: outcome.arrived,
        makespan_s: outcome.makespan_s,
        sum_of_costs_s: outcome.sum_of_costs_s,
        wall_ms: milliseconds(wall),
        tracking_error_max_m: outcome.tracking_error_max_m,
        tracking_error_max_rad: outcome.tracking_error_max_rad,
        tracking_error_mean_m: outcome.tracking_error_mean_m,
        host_peak_memory_kb: peak_memory_kb(),
    })
}

/// The high-water mark of this process's resident set, where the kernel tells.
fn peak_memory_kb() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status
        .lines()
        .find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse().ok()
}
