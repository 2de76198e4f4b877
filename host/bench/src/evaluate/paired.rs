use serde::Serialize;

use super::{Metric, SOLVE_TIME, Success, Trials, Unit};
use crate::statistics::{
    BOOTSTRAP_SEED, Clustered, Interval, MIN_CLUSTERS, Posterior, bayesian_signed_rank,
    cluster_means, holm, mean, median, median_interval, sign_test, sorted,
};

/// A ratio that does not matter, and its inverse.
pub const EQUIVALENT: f64 = 1.05;

/// Draws from a posterior distribution.
const DRAWS: usize = 2000;

/// Two values of one question.
#[derive(Debug, Clone, Copy)]
pub(super) struct Pair {
    pub(super) cluster: usize,
    pub(super) first: f64,
    pub(super) second: f64,
}

/// Two values of each of many instances: is one side smaller? Differences and ratios are means over
/// the pairs of a cluster, ratios geometric ones; medians, intervals and tests are over clusters.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Paired {
    /// Instances, by seed and budget, with both values.
    pub pairs: usize,
    /// Instances with neither or one.
    pub left_out: usize,
    /// Clusters with a pair.
    pub clusters: usize,
    /// Mean of the first side over pairs.
    pub mean_first: Option<f64>,
    /// Mean of the second side over pairs.
    pub mean_second: Option<f64>,
    /// Median of second − first.
    pub median_delta: Option<f64>,
    /// Its exact 95 % interval, of six clusters or more.
    pub delta_interval: Option<Interval>,
    /// Median of second / first, where all values are positive.
    pub median_ratio: Option<f64>,
    /// Its exact 95 % interval, of six clusters or more.
    pub ratio_interval: Option<Interval>,
    /// Clusters whose second values are greater: where they are times, slower. By their ratio, where
    /// there is one, and else by their difference.
    pub greater: usize,
    /// Clusters whose second values are smaller: where they are times, faster.
    pub smaller: usize,
    /// Clusters without a difference.
    pub tied: usize,
    /// Exact two-sided sign test, ties left out; of six clusters or more.
    pub p: Option<f64>,
    /// After Holm's correction for all comparisons of the same table.
    pub p_holm: Option<f64>,
    /// Of solve times: the probabilities that the second is faster, as fast, and slower, where 5 %
    /// more or less is as fast; of six clusters or more.
    pub posterior: Option<Posterior>,
}

impl Paired {
    /// Of pairs; `p_holm` is still `p`.
    pub(super) fn of(pairs: &[Pair], left_out: usize, metric: &Metric) -> Self {
        let by_cluster = |value: &dyn Fn(&Pair) -> f64| -> Vec<f64> {
            let values = pairs.iter().map(|pair| (pair.cluster, value(pair)));
            cluster_means(&values.collect::<Vec<Clustered>>())
        };
        let deltas = by_cluster(&|pair| pair.second - pair.first);
        let positive = pairs
            .iter()
            .all(|pair| pair.first > 0.0 && pair.second > 0.0);
        let logs = if positive {
            by_cluster(&|pair| (pair.second / pair.first).ln())
        } else {
            Vec::new()
        };
        let signed = if positive { &logs } else { &deltas };
        let count = |what: fn(f64) -> bool| signed.iter().filter(|one| what(**one)).count();
        let (greater, smaller) = (count(|one| one > 0.0), count(|one| one < 0.0));
        let is_enough = deltas.len() >= MIN_CLUSTERS;
        let p = is_enough.then(|| sign_test(greater as u64, smaller as u64));
        let ratios = sorted(logs.iter().map(|log| log.exp()));
        let of_times = is_enough && *metric == SOLVE_TIME;
        let posterior =
            of_times.then(|| bayesian_signed_rank(&logs, EQUIVALENT.ln(), DRAWS, BOOTSTRAP_SEED));
        let tied = deltas.len() - greater - smaller;
        let deltas = sorted(deltas);
        let exact = |values: &[f64]| median_interval(values).map(|(interval, _)| interval);
        Self {
            pairs: pairs.len(),
            left_out,
            clusters: deltas.len(),
            mean_first: mean(&sorted(pairs.iter().map(|pair| pair.first))),
            mean_second: mean(&sorted(pairs.iter().map(|pair| pair.second))),
            median_delta: median(&deltas),
            delta_interval: exact(&deltas),
            median_ratio: median(&ratios),
            ratio_interval: exact(&ratios),
            greater,
            smaller,
            tied,
            p,
            p_holm: p,
            posterior: posterior.flatten(),
        }
    }

    /// Corrects all comparisons of a table that have a test.
    pub(super) fn correct<'a>(table: impl IntoIterator<Item = &'a mut Self>) {
        let tested = table.into_iter().filter_map(|one| one.p_holm.as_mut());
        correct(tested);
    }
}

/// Holm's correction of some p-values together.
pub(super) fn correct<'a>(p_values: impl IntoIterator<Item = &'a mut f64>) {
    let p_values: Vec<&mut f64> = p_values.into_iter().collect();
    let corrected = holm(&p_values.iter().map(|p| **p).collect::<Vec<f64>>());
    for (p, corrected) in p_values.into_iter().zip(corrected) {
        *p = corrected;
    }
}

/// Every planner against one of them (Table IV of the maze paper).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// The planner that the others are compared with: the first side of every pair.
    pub baseline: String,
    /// The metric that is compared.
    pub metric: Metric,
    /// The unit that is counted.
    pub unit: Unit,
    /// True if p-values are exploratory, because some case has no repeats.
    pub descriptive: bool,
    /// The others, by median difference.
    pub planners: Vec<Against>,
}

/// A planner against the one that others are compared with.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Against {
    /// Its label.
    pub planner: String,
    /// On the instances that both solved.
    #[serde(flatten)]
    pub paired: Paired,
    /// On the instances that both were asked; the first is the other one.
    pub solved: Success,
}

/// The values of two planners on the instances that both solved; `None` if there is no planner of
/// one of the labels.
pub(super) fn pairs(
    trials: &Trials<'_>,
    first: &str,
    second: &str,
    metric: &Metric,
) -> Option<Vec<Pair>> {
    let (first, second) = (trials.planner(first)?, trials.planner(second)?);
    let both = first.cases.iter().filter_map(|case| {
        Some(Pair {
            cluster: case.cluster,
            first: case.value(metric)?,
            second: second.case(case.instance)?.value(metric)?,
        })
    });
    Some(both.collect())
}

/// Compares every planner with the one of that label, on the instances that both solved;
/// `None` if there is no such planner.
pub fn compare_with(trials: &Trials<'_>, baseline: &str, metric: &Metric) -> Option<Comparison> {
    let first = trials.planner(baseline)?;
    let others = trials.planners().iter();
    let mut planners: Vec<Against> = others
        .filter(|other| other.label != baseline)
        .filter_map(|other| {
            let pairs = pairs(trials, baseline, &other.label, metric)?;
            let left_out = trials.instances().len() - pairs.len();
            Some(Against {
                planner: other.label.to_string(),
                paired: Paired::of(&pairs, left_out, metric),
                solved: Success::between(first, other),
            })
        })
        .collect();
    Paired::correct(planners.iter_mut().map(|against| &mut against.paired));
    let solved = planners.iter_mut().map(|against| &mut against.solved);
    correct(solved.filter_map(|solved| solved.p.as_mut()));
    planners.sort_by(|a, b| {
        let delta = |against: &Against| against.paired.median_delta.unwrap_or(f64::INFINITY);
        let by_delta = delta(a).total_cmp(&delta(b));
        by_delta.then_with(|| a.planner.cmp(&b.planner))
    });
    let mut cases = trials.planners().iter().flat_map(|planner| &planner.cases);
    Some(Comparison {
        baseline: baseline.to_owned(),
        metric: *metric,
        unit: trials.unit(),
        descriptive: cases.any(|case| case.repeats.len() < 2),
        planners,
    })
}
