//! The validator against rules written down twice.

mod continuous;
mod controls;
mod oracle;
mod paths;
mod roadmaps;
mod rules;
mod trailers;

use fleetyard_check::{ContinuousTask, ContinuousVerdict, validate_trajectories};
use fleetyard_core::TrajectoryPlan;

/// Judges a plan; it is valid exactly if nothing is wrong with it.
fn validated(plan: &TrajectoryPlan, task: &ContinuousTask<'_>, limit: usize) -> ContinuousVerdict {
    let verdict = validate_trajectories(plan, task, limit);
    assert_eq!(verdict.valid, verdict.violations.is_empty());
    assert!(verdict.violations.len() <= limit.max(1));
    verdict
}
