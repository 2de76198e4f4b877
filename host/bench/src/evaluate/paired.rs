use serde::Serialize;

use super::{Metric, Trials};
use crate::statistics::{
    BOOTSTRAP_SEED, Interval, RESAMPLES, bootstrap_median, holm, mean, median, sign_test, sorted,
};

/// Two values of each of many instances: is one side smaller?
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Paired {
    /// Instances with both values.
    pub pairs: usize,
    /// Instances with neither or one.
    pub left_out: usize,
    /// Mean of the first side over pairs.
    pub mean_first: Option<f64>,
    /// Mean of the second side over pairs.
    pub mean_second: Option<f64>,
    /// Median of second − first.
    pub median_delta: Option<f64>,
    /// 95 % percentile bootstrap interval of that median, from 40,000 resamples of pairs; of
    /// two pairs or more.
    pub delta_interval: Option<Interval>,
    /// Median of second / first, where all values are positive.
    pub median_ratio: Option<f64>,
    /// 95 % percentile bootstrap interval of that median, like the one above.
    pub ratio_interval: Option<Interval>,
    /// Pairs whose second value is greater: where it is a time, slower.
    pub greater: usize,
    /// Pairs whose second value is smaller: where it is a time, faster.
    pub smaller: usize,
    /// Pairs without a difference.
    pub tied: usize,
    /// Exact two-sided sign test, ties left out.
    pub p: f64,
    /// After Holm's correction for all comparisons of the same table.
    pub p_holm: f64,
}

impl Paired {
    /// Of (first, second) values; `p_holm` is still `p`.
    pub(super) fn of(pairs: &[(f64, f64)], left_out: usize) -> Self {
        let deltas = sorted(pairs.iter().map(|(first, second)| second - first));
        let count = |what: fn(f64) -> bool| deltas.iter().filter(|delta| what(**delta)).count();
        let (greater, smaller) = (count(|delta| delta > 0.0), count(|delta| delta < 0.0));
        let p = sign_test(greater as u64, smaller as u64);
        let positive = pairs.iter().all(|pair| pair.0 > 0.0 && pair.1 > 0.0);
        let ratios = pairs.iter().filter(|_| positive);
        let ratios = sorted(ratios.map(|(first, second)| second / first));
        Self {
            pairs: pairs.len(),
            left_out,
            mean_first: mean(&sorted(pairs.iter().map(|pair| pair.0))),
            mean_second: mean(&sorted(pairs.iter().map(|pair| pair.1))),
            median_delta: median(&deltas),
            delta_interval: bootstrap_median(&deltas, RESAMPLES, BOOTSTRAP_SEED),
            median_ratio: median(&ratios),
            ratio_interval: bootstrap_median(&ratios, RESAMPLES, BOOTSTRAP_SEED),
            greater,
            smaller,
            tied: deltas.len() - greater - smaller,
            p,
            p_holm: p,
        }
    }

    /// Corrects all comparisons of a table; those without a pair are no comparisons.
    pub(super) fn correct<'a>(table: impl IntoIterator<Item = &'a mut Self>) {
        let mut table: Vec<&mut Self> = table.into_iter().filter(|one| one.pairs > 0).collect();
        let raw: Vec<f64> = table.iter().map(|one| one.p).collect();
        for (one, corrected) in table.iter_mut().zip(holm(&raw)) {
            one.p_holm = corrected;
        }
    }
}

/// Every planner against one of them (Table IV of the maze paper).
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Comparison {
    /// The planner that the others are compared with: the first side of every pair.
    pub baseline: String,
    /// What is compared.
    pub metric: Metric,
    /// Whether p-values are exploratory, because some case has no repeats.
    pub descriptive: bool,
    /// The others, by median difference.
    pub planners: Vec<(String, Paired)>,
}

/// Compares every planner with the one of that label, on the instances that both solved;
/// `None` if there is no such planner.
pub fn compare_with(trials: &Trials<'_>, baseline: &str, metric: &Metric) -> Option<Comparison> {
    let first = trials.planner(baseline)?;
    let others = trials
        .planners()
        .iter()
        .filter(|other| other.label != baseline);
    let mut planners: Vec<(String, Paired)> = others
        .map(|second| {
            let pairs: Vec<(f64, f64)> = (0..trials.instances().len())
                .filter_map(|instance| {
                    let first = first.case(instance)?.value(metric)?;
                    let second = second.case(instance)?.value(metric)?;
                    Some((first, second))
                })
                .collect();
            let left_out = trials.instances().len() - pairs.len();
            (second.label.to_owned(), Paired::of(&pairs, left_out))
        })
        .collect();
    Paired::correct(planners.iter_mut().map(|(_, paired)| paired));
    planners.sort_by(|(a_label, a), (b_label, b)| {
        let delta = |paired: &Paired| paired.median_delta.unwrap_or(f64::INFINITY);
        let by_delta = delta(a).total_cmp(&delta(b));
        by_delta.then_with(|| a_label.cmp(b_label))
    });
    let mut cases = trials.planners().iter().flat_map(|planner| &planner.cases);
    Some(Comparison {
        baseline: baseline.to_owned(),
        metric: *metric,
        descriptive: cases.any(|case| case.repeats.len() < 2),
        planners,
    })
}
