use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::{Counts, METRICS, Metric, Planner, SOLVE_TIME, Trials, Unit};
use crate::Row;
use crate::statistics::{Clustered, Interval, Summary, clustered_share_interval, mean, sorted};
use crate::verify::comparable;

/// Numbers of trials, and obstacles to their comparison.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Overview {
    /// Rows.
    pub trials: usize,
    /// Trials that failed.
    pub failures: usize,
    /// Planners.
    pub planners: usize,
    /// Instances, by seed and budget.
    pub instances: usize,
    /// Numbers of instances, scenarios and maps.
    pub counts: Counts,
    /// The unit to which results are generalised.
    pub unit: Unit,
    /// Number of these units: nothing is inferred from fewer than six.
    pub clusters: usize,
    /// Instances that every planner solved.
    pub shared: usize,
    /// Fewest repeats of a case.
    pub repeats_min: usize,
    /// Most repeats of a case.
    pub repeats_max: usize,
    /// Timings without repeats describe what happened once; nothing tells a planner's
    /// time from the machine's noise.
    pub descriptive: bool,
    /// Trials that others disturbed.
    pub contended: usize,
    /// Trials that may not be compared.
    pub unranked: usize,
    /// Digests of the machines, sorted.
    pub machines: Vec<String>,
}

impl Overview {
    /// Of trials.
    pub fn of(trials: &Trials<'_>) -> Self {
        let count = |what: fn(&Row) -> bool| trials.rows().filter(|row| what(row)).count();
        let cases = trials.planners().iter().flat_map(|planner| &planner.cases);
        let repeats = || cases.clone().map(|case| case.repeats.len());
        let machines: BTreeSet<&String> = trials.rows().map(|row| &row.machine).collect();
        Self {
            trials: trials.rows().count(),
            failures: count(|row| !row.success),
            planners: trials.planners().len(),
            instances: trials.instances().len(),
            counts: trials.counts(),
            unit: trials.unit(),
            clusters: trials.clusters(),
            shared: trials.shared().len(),
            repeats_min: repeats().min().unwrap_or(0),
            repeats_max: repeats().max().unwrap_or(0),
            descriptive: repeats().any(|repeats| repeats < 2),
            contended: count(|row| !row.contended.is_empty()),
            unranked: count(|row| !row.ranked),
            machines: machines.into_iter().cloned().collect(),
        }
    }
}

/// Number of trials that failed for a reason.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct FailureCount {
    /// As [`Row::failure`] says it.
    pub reason: String,
    /// Trials.
    pub trials: usize,
}

/// Distribution of a planner's values of a metric.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct MetricSummary {
    /// The column.
    pub metric: Metric,
    /// Over cases that succeeded.
    #[serde(flatten)]
    pub summary: Summary,
    /// Cases without a value: they failed, or have none.
    pub left_out: usize,
    /// Mean over the cases that every planner solved: the others' means are of other cases, and who
    /// fails on hard ones looks good.
    pub shared_mean: Option<f64>,
}

/// A planner's line of the tables.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PlannerSummary {
    /// Its label.
    pub planner: String,
    /// Identifier of the plugin.
    pub planner_id: String,
    /// Versions of the plugin, sorted; one, unless stores were mixed.
    pub versions: Vec<String>,
    /// Digests of its code, sorted.
    pub digests: Vec<String>,
    /// Its options as a JSON object.
    pub options: String,
    /// Rows.
    pub trials: usize,
    /// Cases.
    pub cases: usize,
    /// Cases of which every repeat succeeded.
    pub successes: usize,
    /// Mean over cases of the share of repeats that succeeded.
    pub success_rate: f64,
    /// Its 95 % interval, of six clusters or more.
    pub success_interval: Option<Interval>,
    /// Cases that aggregates leave out.
    pub failures: usize,
    /// Failed trials by reason, most frequent first.
    pub reasons: Vec<FailureCount>,
    /// Cases of which some repeats succeeded and others did not.
    pub unsteady: usize,
    /// Cases whose repeats have different plans, though time decided nothing.
    pub different_plans: usize,
    /// Trials with claims that the host found to be false.
    pub false_claims: usize,
    /// The first of those.
    pub false_claim: Option<String>,
    /// Trials that others disturbed.
    pub contended: usize,
    /// Trials that may not be compared.
    pub unranked: usize,
    /// Mean solve time over all cases, failures included.
    pub mean_time_of_all_ms: Option<f64>,
    /// Of every metric that it has.
    pub metrics: Vec<MetricSummary>,
}

/// The mean of shares; of none it is zero.
pub(super) fn rate(shares: &[Clustered]) -> f64 {
    mean(&sorted(shares.iter().map(|share| share.1))).unwrap_or(0.0)
}

impl PlannerSummary {
    /// Of a planner's cases; `shared` are the instances that every planner solved, ascending.
    pub fn of(planner: &Planner<'_>, shared: &[usize]) -> Self {
        let distinct = |of: fn(&Row) -> Option<&String>| -> Vec<String> {
            let texts: BTreeSet<&String> = planner.rows().filter_map(of).collect();
            texts.into_iter().cloned().collect()
        };
        let count = |what: fn(&Row) -> bool| planner.rows().filter(|row| what(row)).count();
        let cases = planner.cases.len();
        let successes = planner.successes().count();
        let mut reasons: BTreeMap<String, usize> = BTreeMap::new();
        for reason in planner.rows().filter_map(Row::failure) {
            *reasons.entry(reason).or_default() += 1;
        }
        let mut reasons: Vec<FailureCount> = reasons
            .into_iter()
            .map(|(reason, trials)| FailureCount { reason, trials })
            .collect();
        reasons.sort_by_key(|reason| std::cmp::Reverse(reason.trials));
        let unsteady = planner.cases.iter().filter(|case| {
            let successes = case.repeats.iter().filter(|row| row.success).count();
            successes > 0 && successes < case.repeats.len()
        });
        let different_plans = planner.cases.iter().filter(|case| {
            let repeats = case.repeats.iter().filter(|row| comparable(row));
            let mut plans = repeats.filter_map(|row| row.plan_digest.as_ref());
            let first = plans.next();
            plans.any(|plan| Some(plan) != first)
        });
        let metrics = METRICS.iter().filter_map(|metric| {
            let summary = Summary::of_clustered(&planner.values(metric))?;
            let common = planner.of_instances(shared);
            Some(MetricSummary {
                metric: *metric,
                left_out: cases - summary.count,
                summary,
                shared_mean: mean(&sorted(common.filter_map(|case| case.value(metric)))),
            })
        });
        let shares = planner.shares();
        let times: Vec<f64> = planner
            .cases
            .iter()
            .filter_map(|case| case.any_value(&SOLVE_TIME))
            .collect();
        let first = planner.rows().next();
        Self {
            planner: planner.label.to_string(),
            planner_id: first.map(|row| row.planner_id.clone()).unwrap_or_default(),
            versions: distinct(|row| Some(&row.planner_version)),
            digests: distinct(|row| row.planner_digest.as_ref()),
            options: first.map(|row| row.options.clone()).unwrap_or_default(),
            trials: planner.rows().count(),
            cases,
            successes,
            success_rate: rate(&shares),
            success_interval: clustered_share_interval(&shares),
            failures: cases - successes,
            reasons,
            unsteady: unsteady.count(),
            different_plans: different_plans.count(),
            false_claims: count(|row| row.false_claims.is_some()),
            false_claim: planner.rows().find_map(|row| row.false_claims.clone()),
            contended: count(|row| !row.contended.is_empty()),
            unranked: count(|row| !row.ranked),
            mean_time_of_all_ms: Summary::of(&times).map(|summary| summary.mean),
            metrics: metrics.collect(),
        }
    }

    /// Its values of the metric of a column, if it has any.
    pub fn column(&self, column: &str) -> Option<&Summary> {
        let found = Metric::named(column).and_then(|metric| self.metric(metric));
        found.map(|found| &found.summary)
    }

    /// Its summary of a metric, if it has any value.
    pub fn metric(&self, metric: &Metric) -> Option<&MetricSummary> {
        self.metrics
            .iter()
            .find(|summary| summary.metric == *metric)
    }
}
