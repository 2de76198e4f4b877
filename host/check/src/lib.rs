//! The independent plan validator and the metrics of Fleetyard.
//!
//! A plan is judged here and nowhere else. This crate takes an instance and the
//! paths that someone claims to solve it, and knows no planner, no plugin, no
//! simulator and no clock: what a planner says of its own plan has no way in.

#![forbid(unsafe_code)]

mod metrics;
mod validate;
mod verdict;

pub use metrics::{PlanMetrics, metrics, sum_of_costs};
pub use validate::validate;
pub use verdict::{CellPosition, Rule, Verdict, Violation};
