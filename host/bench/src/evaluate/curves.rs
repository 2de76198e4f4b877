use std::collections::{BTreeMap, BTreeSet};

use serde::Serialize;

use super::{Case, Dimension, Level, Metric, Planner, Trials};
use crate::statistics::{
    Interval, Summary, Weighted, weighted_mean, weighted_mean_interval, weighted_share_interval,
};

/// A value and the trial that it is of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Mark {
    /// The value of the case.
    pub value: f64,
    /// Place of its first repeat in the suite's order.
    pub trial: u64,
}

/// A planner's success rate and a metric along a dimension.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Curve {
    /// Its label.
    pub planner: String,
    /// In order of the dimension.
    pub points: Vec<CurvePoint>,
}

/// All cases of a planner at one level of a dimension.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct CurvePoint {
    /// The level.
    pub level: Level,
    /// Cases.
    pub cases: usize,
    /// Cases of which every repeat succeeded.
    pub successes: usize,
    /// Mean over maps of their success rates.
    pub success_rate: f64,
    /// Its 95 % interval, of six clusters or more.
    pub success_interval: Option<Interval>,
    /// The metric over the cases that succeeded; its mean, with the 95 % interval, is that over maps.
    pub values: Option<Summary>,
    /// Cases without a value.
    pub left_out: usize,
}

/// Success rates and a metric along a dimension, such as throughput against the number of
/// agents, at the levels that every map has: where one map goes on and another does not, a curve
/// would be of other maps. Every map counts as much.
pub fn curves(trials: &Trials<'_>, along: Dimension, metric: &Metric) -> Vec<Curve> {
    let common = common_levels(trials, along);
    let planners = trials.planners().iter();
    planners
        .map(|planner| {
            let mut levels: BTreeMap<Level, Vec<&Case<'_>>> = BTreeMap::new();
            for case in &planner.cases {
                let level = along.level(trials.instances()[case.instance]);
                if let Some(level) = level.filter(|level| common.contains(level)) {
                    levels.entry(level).or_default().push(case);
                }
            }
            let point = |(level, cases): (Level, Vec<&Case<'_>>)| {
                let shares = by_map(trials, &cases, |case| Some(case.share()));
                let values = by_map(trials, &cases, |case| case.value(metric));
                CurvePoint {
                    level,
                    cases: cases.len(),
                    successes: cases.iter().filter(|case| case.success()).count(),
                    success_rate: weighted_mean(&shares).unwrap_or(0.0),
                    success_interval: weighted_share_interval(&shares),
                    left_out: cases.len() - values.len(),
                    values: summary(&values),
                }
            };
            Curve {
                planner: planner.label.to_string(),
                points: levels.into_iter().map(point).collect(),
            }
        })
        .collect()
}

/// The levels of a dimension that every map has which has any.
pub fn common_levels(trials: &Trials<'_>, along: Dimension) -> BTreeSet<Level> {
    let mut maps: BTreeMap<usize, BTreeSet<Level>> = BTreeMap::new();
    for (instance, row) in trials.instances().iter().enumerate() {
        if let Some(level) = along.level(row) {
            maps.entry(trials.map_of(instance))
                .or_default()
                .insert(level);
        }
    }
    let common = maps.into_values().reduce(|a, b| &a & &b);
    common.unwrap_or_default()
}

/// Values of cases, so weighted that all maps with a value count as much.
fn by_map(
    trials: &Trials<'_>,
    cases: &[&Case<'_>],
    value: impl Fn(&Case<'_>) -> Option<f64>,
) -> Vec<Weighted> {
    let mut counts: BTreeMap<usize, f64> = BTreeMap::new();
    let values: Vec<(usize, usize, f64)> = (cases.iter())
        .filter_map(|case| Some((trials.map_of(case.instance), case.cluster, value(case)?)))
        .collect();
    for (map, ..) in &values {
        *counts.entry(*map).or_default() += 1.0;
    }
    let weighted = values.into_iter().map(|(map, cluster, value)| Weighted {
        cluster,
        value,
        weight: 1.0 / counts[&map],
    });
    weighted.collect()
}

fn summary(values: &[Weighted]) -> Option<Summary> {
    let plain: Vec<f64> = values.iter().map(|one| one.value).collect();
    Some(Summary {
        mean: weighted_mean(values)?,
        mean_interval: weighted_mean_interval(values),
        ..Summary::of(&plain)?
    })
}

/// Number of cases that a planner solves with so much of a metric: the k-th mark is the value
/// within which k cases are solved.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Cactus {
    /// Its label.
    pub planner: String,
    /// Cases, solved or not.
    pub cases: usize,
    /// Of the solved ones, ascending.
    pub marks: Vec<Mark>,
}

/// Quantile curves of every planner.
pub fn cactus(trials: &Trials<'_>, metric: &Metric) -> Vec<Cactus> {
    let planners = trials.planners().iter();
    planners
        .map(|planner| Cactus {
            planner: planner.label.to_string(),
            cases: planner.cases.len(),
            marks: marks(&planner.cases, |case| case.value(metric)),
        })
        .collect()
}

/// Performance profiles of every planner: the k-th mark is the factor within which k of its cases are
/// solved, each against the best planner of its instance. Failures have none.
///
/// Dolan and Moré, "Benchmarking optimization software with performance profiles", Mathematical
/// Programming 91 (2002).
pub fn profiles(trials: &Trials<'_>, metric: &Metric) -> Vec<Cactus> {
    let mut best = vec![f64::INFINITY; trials.instances().len()];
    for case in trials.planners().iter().flat_map(|planner| &planner.cases) {
        let known = &mut best[case.instance];
        *known = known.min(case.value(metric).unwrap_or(f64::INFINITY));
    }
    let planners = trials.planners().iter();
    let profile = |planner: &Planner<'_>| Cactus {
        planner: planner.label.to_string(),
        cases: planner.cases.len(),
        marks: marks(&planner.cases, |case| {
            let factor = case.value(metric)? / best[case.instance];
            // Who takes no time at all is as fast as can be.
            Some(if factor.is_nan() { 1.0 } else { factor })
        }),
    };
    planners.map(profile).collect()
}

/// Ascending.
fn marks(cases: &[Case<'_>], value: impl Fn(&Case<'_>) -> Option<f64>) -> Vec<Mark> {
    let mark = |case: &Case<'_>| {
        let value = value(case).filter(|value| value.is_finite())?;
        let trial = case.trial();
        Some(Mark { value, trial })
    };
    let mut marks: Vec<Mark> = cases.iter().filter_map(mark).collect();
    marks.sort_by(|a, b| a.value.total_cmp(&b.value).then(a.trial.cmp(&b.trial)));
    marks
}

/// One planner against another, instance by instance.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scatter {
    /// Label of the planner whose values are `x`.
    pub x: String,
    /// Label of the planner whose values are `y`.
    pub y: String,
    /// Of every instance that both were asked, in order.
    pub points: Vec<ScatterPoint>,
    /// Instances where `x` has the smaller value.
    pub x_smaller: usize,
    /// Instances where `y` has the smaller value.
    pub y_smaller: usize,
    /// Instances where both have the same.
    pub tied: usize,
    /// Instances that only `x` solved.
    pub only_x: usize,
    /// Instances that only `y` solved.
    pub only_y: usize,
    /// Instances that neither solved.
    pub neither: usize,
}

/// An instance; a value is absent where the planner failed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct ScatterPoint {
    /// Of the one.
    pub x: Option<f64>,
    /// Of the other.
    pub y: Option<f64>,
    /// The one's first repeat.
    pub x_trial: u64,
    /// The other's first repeat.
    pub y_trial: u64,
}

/// Two planners beside each other; `None` if one of both labels is unknown.
pub fn scatter(trials: &Trials<'_>, x: &str, y: &str, metric: &Metric) -> Option<Scatter> {
    let (of_x, of_y) = (trials.planner(x)?, trials.planner(y)?);
    let points: Vec<ScatterPoint> = of_x
        .cases
        .iter()
        .filter_map(|x_case| {
            let y_case = of_y.case(x_case.instance)?;
            Some(ScatterPoint {
                x: x_case.value(metric),
                y: y_case.value(metric),
                x_trial: x_case.trial(),
                y_trial: y_case.trial(),
            })
        })
        .collect();
    let count = |what: fn(Option<f64>, Option<f64>) -> bool| {
        points.iter().filter(|point| what(point.x, point.y)).count()
    };
    Some(Scatter {
        x: x.into(),
        y: y.into(),
        x_smaller: count(|x, y| x.zip(y).is_some_and(|(x, y)| x < y)),
        y_smaller: count(|x, y| x.zip(y).is_some_and(|(x, y)| y < x)),
        tied: count(|x, y| x.is_some() && x == y),
        only_x: count(|x, y| x.is_some() && y.is_none()),
        only_y: count(|x, y| x.is_none() && y.is_some()),
        neither: count(|x, y| x.is_none() && y.is_none()),
        points,
    })
}

/// A planner's box plot for a logarithmic axis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BoxPlot {
    /// Its label.
    pub planner: String,
    /// The box is from the first to the third quartile, the same as in tables.
    pub summary: Summary,
    /// Smallest value that is at most one and a half boxes below the box, on a logarithmic
    /// axis: not below q1·(q1/q3)^1.5.
    pub whisker_low: f64,
    /// Largest value not above q3·(q3/q1)^1.5.
    pub whisker_high: f64,
    /// Values beyond the whiskers, ascending.
    pub outliers: Vec<Mark>,
    /// Values that have no place on a logarithmic axis.
    pub not_positive: usize,
    /// Cases without a value.
    pub left_out: usize,
}

/// Box plots of every planner that has a value. Where a quartile is not positive, fences are
/// one and a half boxes away on a linear axis.
pub fn box_plots(trials: &Trials<'_>, metric: &Metric) -> Vec<BoxPlot> {
    let planners = trials.planners().iter();
    planners
        .filter_map(|planner| {
            let marks = marks(&planner.cases, |case| case.value(metric));
            let values: Vec<f64> = marks.iter().map(|mark| mark.value).collect();
            let summary = Summary::of(&values)?;
            let (q1, q3) = (summary.q1, summary.q3);
            let (low, high) = if q1 > 0.0 {
                (q1 * (q1 / q3).powf(1.5), q3 * (q3 / q1).powf(1.5))
            } else {
                (q1 - 1.5 * (q3 - q1), q3 + 1.5 * (q3 - q1))
            };
            let within = |value: f64| (low..=high).contains(&value);
            let inner = || values.iter().copied().filter(|value| within(*value));
            Some(BoxPlot {
                planner: planner.label.to_string(),
                // Rounding may put a quartile of equal values outside of its own fences.
                whisker_low: inner().next().unwrap_or(q1).min(q1),
                whisker_high: inner().next_back().unwrap_or(q3).max(q3),
                outliers: marks
                    .iter()
                    .copied()
                    .filter(|mark| !within(mark.value))
                    .collect(),
                not_positive: values.iter().filter(|value| **value <= 0.0).count(),
                left_out: planner.cases.len() - values.len(),
                summary,
            })
        })
        .collect()
}
