use serde::Serialize;

use super::{Planner, SOLVE_TIME, Trials};
use crate::statistics::{Interval, MIN_CLUSTERS, Survival, Time, log_rank_test};

/// Times to a solution of two planners, a failure being known to take longer than its budget.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Censored {
    /// Last time that counts, in milliseconds: the largest budget.
    pub until_ms: f64,
    /// Mean of min(t, `until_ms`) of the first by the Kaplan-Meier estimate, and its 95 % interval.
    pub first: (f64, Interval),
    /// The same of the second.
    pub second: (f64, Interval),
    /// Two-sided log-rank test.
    pub p: f64,
}

/// Compares times to a solution; `None` where there is no such planner, and where cases are not
/// independent: all of it assumes that, so that each cluster has to be one case, of six or more.
pub fn censored(trials: &Trials<'_>, first: &str, second: &str) -> Option<Censored> {
    let instances = trials.instances();
    if trials.clusters() < MIN_CLUSTERS || trials.clusters() < instances.len() {
        return None;
    }
    let budgets = instances.iter().map(|row| row.budget_ms);
    let until_ms = budgets.fold(0.0, f64::max);
    let of = |planner: &Planner<'_>| -> Vec<Time> {
        let times = planner.cases.iter().map(|case| Time {
            value: case
                .value(&SOLVE_TIME)
                .unwrap_or(instances[case.instance].budget_ms),
            ended: case.success(),
        });
        times.collect()
    };
    let (first, second) = (of(trials.planner(first)?), of(trials.planner(second)?));
    Some(Censored {
        until_ms,
        first: Survival::of(&first).restricted_mean(until_ms),
        second: Survival::of(&second).restricted_mean(until_ms),
        p: log_rank_test(&first, &second),
    })
}
