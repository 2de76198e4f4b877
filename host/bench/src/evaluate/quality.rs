use serde::Serialize;

use super::{Case, Trials};
use crate::Row;
use crate::statistics::{Clustered, Interval, Summary, median, sorted};

/// The divisor of sums of costs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reference {
    /// The lower bound of the instance.
    LowerBound,
    /// The best valid plan that any planner found of the instance.
    Best,
}

/// Quality of a planner's plans over time.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Quality {
    /// Its label.
    pub planner: String,
    /// The divisor of its sums of costs.
    pub reference: Reference,
    /// Cases.
    pub cases: usize,
    /// In order of time.
    pub points: Vec<QualityPoint>,
}

/// Quality of its plans at some time.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct QualityPoint {
    /// From the start of the call.
    pub time_ms: f64,
    /// Cases of which every repeat has a valid plan by then. The mean is over these, so that
    /// it may rise when a hard case gets its first plan.
    pub with_plan: usize,
    /// Mean ratio of the best valid plan so far.
    pub mean_ratio: Option<f64>,
    /// Its 95 % interval, of six clusters or more.
    pub interval: Option<Interval>,
}

/// `count` times from `low` to `high` that are equally far apart on a logarithmic axis;
/// none unless 0 < `low` ≤ `high`.
pub fn log_spaced(low: f64, high: f64, count: usize) -> Vec<f64> {
    if !(low > 0.0 && low <= high && high.is_finite()) {
        return Vec::new();
    }
    let steps = count.saturating_sub(1).max(1) as f64;
    let time = |at: usize| match at {
        0 => low,
        at if at + 1 == count => high,
        at => low * (high / low).powf(at as f64 / steps),
    };
    (0..count).map(time).collect()
}

/// Quality over time from the plans that were kept and found valid, at ascending times.
/// Planners without such a plan have no points.
pub fn quality_over_time(
    trials: &Trials<'_>,
    reference: Reference,
    times_ms: &[f64],
) -> Vec<Quality> {
    let mut references = vec![f64::INFINITY; trials.instances().len()];
    for case in trials.planners().iter().flat_map(|planner| &planner.cases) {
        for row in &case.repeats {
            let value = match reference {
                Reference::LowerBound => row.lower_bound_steps.map(|steps| steps as f64),
                Reference::Best => valid_plans(row).map(|(_, soc)| soc).reduce(f64::min),
            };
            let known = &mut references[case.instance];
            *known = known.min(value.unwrap_or(f64::INFINITY));
        }
    }
    let planners = trials.planners().iter();
    planners
        .map(|planner| {
            let mut ratios: Vec<Vec<Clustered>> = vec![Vec::new(); times_ms.len()];
            for case in &planner.cases {
                let reference = references[case.instance];
                for (ratios, soc) in ratios.iter_mut().zip(best_by(case, times_ms)) {
                    // Everybody at the goal from the beginning: as good as can be.
                    let ratio = if reference > 0.0 {
                        soc / reference
                    } else {
                        1.0
                    };
                    ratios.extend(Some((case.cluster, ratio)).filter(|_| soc.is_finite()));
                }
            }
            let anything = ratios.iter().any(|ratios| !ratios.is_empty());
            let point = |(time_ms, ratios): (&f64, Vec<Clustered>)| {
                let summary = Summary::of_clustered(&ratios);
                QualityPoint {
                    time_ms: *time_ms,
                    with_plan: ratios.len(),
                    mean_ratio: summary.map(|summary| summary.mean),
                    interval: summary.and_then(|summary| summary.mean_interval),
                }
            };
            let points = times_ms.iter().zip(ratios).map(point);
            Quality {
                planner: planner.label.to_string(),
                reference,
                cases: planner.cases.len(),
                points: points.filter(|_| anything).collect(),
            }
        })
        .collect()
}

/// Times and sums of costs of the plans of a trial that are known to be valid. A planner
/// that keeps no plans on the way has one: its last. Those of views are counted in steps on grids alone, and
/// left out.
pub(super) fn valid_plans(row: &Row) -> impl Iterator<Item = (f64, f64)> {
    let kept = row
        .incumbents
        .iter()
        .filter(|plan| plan.valid == Some(true) && row.view.is_none());
    let kept = kept.filter_map(|plan| Some((plan.time_ms, plan.soc_steps? as f64)));
    let last_ms = row
        .incumbents
        .last()
        .map_or(row.planning_time_ms, |plan| plan.time_ms);
    let last = row
        .soc_steps
        .filter(|_| row.valid && row.view.is_none())
        .map(|soc| (last_ms, soc as f64));
    kept.chain(last)
}

/// By time, the median over repeats of the best sum of costs so far; infinite as long as a
/// repeat has none.
fn best_by(case: &Case<'_>, times_ms: &[f64]) -> Vec<f64> {
    let repeats = case.repeats.iter();
    let repeats: Vec<Vec<f64>> = repeats.map(|row| best_of(row, times_ms)).collect();
    (0..times_ms.len())
        .map(|at| {
            let values = sorted(repeats.iter().map(|best| best[at]));
            let all = values.last().is_some_and(|worst| worst.is_finite());
            median(&values).filter(|_| all).unwrap_or(f64::INFINITY)
        })
        .collect()
}

/// By time, the best sum of costs of a trial's plans so far that are known to be valid;
/// infinite as long as there is none.
pub(crate) fn best_of(row: &Row, times_ms: &[f64]) -> Vec<f64> {
    let mut plans: Vec<(f64, f64)> = valid_plans(row).collect();
    plans.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut plans = plans.into_iter().peekable();
    let mut best = f64::INFINITY;
    let at = |time: &f64| {
        while let Some((_, soc)) = plans.next_if(|plan| plan.0 <= *time) {
            best = best.min(soc);
        }
        best
    };
    times_ms.iter().map(at).collect()
}
