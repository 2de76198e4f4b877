//! Rows of trials, as tests of several binaries compare them.

use fleetyard_bench::Row;

/// The part of a row that does not depend on the clock.
pub(crate) fn lasting(row: &Row) -> String {
    format!(
        "{} {} {} {} {} {} {:?} {:?} {:?}",
        row.key,
        row.trial,
        row.planner,
        row.agents,
        row.termination,
        row.success,
        row.soc_steps,
        row.plan_digest,
        row.trace_digest
    )
}
