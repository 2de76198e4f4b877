use std::fmt;

use serde::{Serialize, Serializer};

use crate::Row;

/// A column of numbers that is summarised, plotted and compared.
#[derive(Clone, Copy)]
pub struct Metric {
    /// Name of the column.
    pub column: &'static str,
    /// For people.
    pub title: &'static str,
    /// For people; empty where it is a number of things.
    pub unit: &'static str,
    /// True if more is better.
    pub higher_is_better: bool,
    read: fn(&Row) -> Option<f64>,
}

impl Metric {
    /// The metric of that column.
    pub fn named(column: &str) -> Option<&'static Self> {
        METRICS.iter().find(|metric| metric.column == column)
    }

    /// Of a trial; what is no finite number is absent.
    pub fn of(&self, row: &Row) -> Option<f64> {
        (self.read)(row).filter(|value| value.is_finite())
    }
}

impl fmt::Debug for Metric {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.column)
    }
}

impl PartialEq for Metric {
    fn eq(&self, other: &Self) -> bool {
        self.column == other.column
    }
}

impl Serialize for Metric {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.column)
    }
}

macro_rules! metrics {
    ($($column:ident: $title:literal, $unit:literal, $better:ident, $read:expr;)*) => {
        /// Every metric, in the order in which tables show them.
        pub const METRICS: &[Metric] = &[$(Metric {
            column: stringify!($column),
            title: $title,
            unit: $unit,
            higher_is_better: better::$better,
            read: |row| ($read)(row.$column),
        },)*];
    };
}

mod better {
    pub(super) const LESS: bool = false;
    pub(super) const MORE: bool = true;
}

fn counted(value: Option<u64>) -> Option<f64> {
    value.map(|value| value as f64)
}

fn known(value: Option<f64>) -> Option<f64> {
    value
}

metrics! {
    solve_time_ms: "solve time", "ms", LESS, Some;
    first_solution_ms: "time to first plan", "ms", LESS, known;
    soc_steps: "sum of costs", "steps", LESS, counted;
    suboptimality: "SoC / lower bound", "", LESS, known;
    makespan_steps: "makespan", "steps", LESS, counted;
    path_length_cells: "path length", "cells", LESS, known;
    path_length_m: "path length", "m", LESS, known;
    expansions: "expansions", "", LESS, known;
    soc_s: "sum of costs in the world", "s", LESS, known;
    makespan_s: "makespan in the world", "s", LESS, known;
    planning_time_ms: "planning time, host's clock", "ms", LESS, Some;
    call_time_ms: "planning time that the planner claims", "ms", LESS, known;
    startup_time_ms: "start of the plugin", "ms", LESS, known;
    prepare_time_ms: "learning the map", "ms", LESS, known;
    total_time_ms: "start, map and call together", "ms", LESS, known;
    cpu_time_ms: "processor time", "ms", LESS, known;
    peak_memory_kb: "peak memory", "KiB", LESS, counted;
    rtf: "real-time factor", "", MORE, known;
    contacts: "contacts", "", LESS, counted;
    nearest_approach_m: "nearest approach", "m", MORE, known;
    tracking_error_max_m: "largest tracking error", "m", LESS, known;
    execution_makespan_s: "makespan of the execution", "s", LESS, known;
    throughput_per_s: "throughput", "goals/s", MORE, known;
    fail_policy_ratio: "fail-policy ratio", "", LESS, known;
    waiting_share: "share of time standing still", "", LESS, known;
}

/// Metrics of which planners are held against each other one by one, as far as they have them.
pub(crate) const COMPARED: [&str; 11] = [
    "solve_time_ms",
    "first_solution_ms",
    "soc_steps",
    "makespan_steps",
    "path_length_cells",
    "soc_s",
    "makespan_s",
    "total_time_ms",
    "cpu_time_ms",
    "peak_memory_kb",
    "throughput_per_s",
];

/// The time that planners are ranked by.
pub const SOLVE_TIME: Metric = METRICS[0];
/// The length of the maze paper (equation 17).
pub const PATH_LENGTH: Metric = METRICS[5];
/// Expansions that planners claim.
pub const EXPANSIONS: Metric = METRICS[7];
/// Uncertainty of the time that planners are ranked by.
pub(super) const UNCERTAINTY: Metric = Metric {
    column: "correction_uncertainty_ms",
    title: "uncertainty of the empty call",
    unit: "ms",
    higher_is_better: better::LESS,
    read: |row| row.correction_uncertainty_ms,
};
