//! The figures of a report.

use serde::Serialize;

/// A quantity that figures may show.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Metric {
    /// The column of a row.
    pub(super) column: &'static str,
    /// In titles.
    pub(super) name: &'static str,
    /// On axes, with its unit.
    pub(super) label: &'static str,
    /// Whether its axis is logarithmic.
    pub(super) log: bool,
}

const fn metric(column: &'static str, name: &'static str, label: &'static str, log: bool) -> Metric {
    Metric {
        column,
        name,
        label,
        log,
    }
}

/// All of them, in the order in which readers may choose.
pub(super) const METRICS: &[Metric] = &[
    metric("solve_time_ms", "solve time", "solve time, ms", true),
    metric("first_solution_ms", "time to the first plan", "first plan, ms", true),
    metric("suboptimality", "cost over lower bound", "SoC / lower bound", false),
    metric("soc_steps", "sum of costs", "sum of costs, steps", false),
    metric("makespan_steps", "makespan", "makespan, steps", false),
    metric("path_length_cells", "path length", "path length, cells", false),
    metric("expansions", "expansions", "expansions", true),
    metric("throughput_per_s", "throughput", "goals per second", false),
    metric("execution_makespan_s", "makespan of the execution", "makespan, s", false),
    metric("contacts", "contacts", "contacts", false),
    metric("nearest_approach_m", "nearest approach", "nearest approach, m", false),
    metric("tracking_error_max_m", "tracking error", "tracking error, m", false),
    metric("rtf", "real-time factor", "simulated over wall time", true),
    metric("cpu_time_ms", "processor time", "processor time, ms", true),
    metric("peak_memory_kb", "memory", "peak memory, kB", true),
];
