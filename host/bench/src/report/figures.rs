//! The figures of a report, from what `evaluate` finds.

use serde::Serialize;

use super::figure::{Axis, Figure, Marks, Series};
use super::format::capital;
use crate::evaluate::{
    Cactus, Dimension, EXPANSIONS, Evaluation, METRICS, Metric, PATH_LENGTH, PlannerSummary,
    Ranking, Reached, Reference, SOLVE_TIME, Trials, box_plots, cactus, curves, log_spaced,
    profiles, quality_over_time, scatter, targets_reached,
};
use crate::statistics::{Interval, Summary};

/// Points that a line has at most; more could not be told apart.
const POINTS: usize = 400;

/// Outliers that a box has at most.
const OUTLIERS: usize = 40;

/// Moments at which quality is shown.
const MOMENTS: usize = 60;

/// Metrics whose axes are not logarithmic although they have a unit of time or none.
const LINEAR: [&str; 6] = [
    "suboptimality",
    "fail_policy_ratio",
    "waiting_share",
    "contacts",
    "execution_makespan_s",
    "nearest_approach_m",
];

/// Names of a quantity, for the page.
#[derive(Debug, Serialize)]
pub(super) struct Quantity {
    column: &'static str,
    name: &'static str,
    label: String,
    log: bool,
}

impl Quantity {
    pub(super) fn of(metric: &Metric) -> Self {
        let log = matches!(metric.unit, "ms" | "KiB" | "") && !LINEAR.contains(&metric.column);
        Self {
            column: metric.column,
            name: metric.title,
            label: match metric.unit {
                "" => metric.title.to_owned(),
                unit => format!("{}, {unit}", metric.title),
            },
            log,
        }
    }

    fn axis(self) -> Axis {
        Axis {
            log: self.log,
            zero: !self.log,
            ..Axis::of(self.label)
        }
    }
}

/// The dimension by which instances differ in size, if they do: team sizes, or else sizes of mazes.
pub(super) fn size_of(trials: &Trials<'_>) -> Option<Dimension> {
    [Dimension::Agents, Dimension::MazeSize]
        .into_iter()
        .find(|dimension| {
            let mut levels = trials.instances().iter().map(|row| dimension.level(row));
            let first = levels.next().flatten();
            levels.any(|level| level.is_some() && level != first)
        })
}

/// An axis of shares.
fn share(label: &str) -> Axis {
    Axis {
        percent: true,
        range: Some([0.0, 1.0]),
        ..Axis::of(label)
    }
}

fn size_name(dimension: Dimension) -> &'static str {
    match dimension {
        Dimension::MazeSize => "maze width in cells",
        _ => "agents",
    }
}

/// Moments from the first plan of all to the last, at which quality is shown; none if no
/// plans on the way are known.
pub(super) fn moments(trials: &Trials<'_>) -> Vec<f64> {
    let plans = trials.rows().flat_map(|row| &row.incumbents);
    let times = plans.map(|plan| plan.time_ms).filter(|time| *time > 0.0);
    let (low, high) = times.fold((f64::INFINITY, 0.0f64), |(low, high), time| {
        (low.min(time), high.max(time))
    });
    log_spaced(low, high, MOMENTS)
}

/// Evenly chosen places of `length`, both ends among them.
fn thinned(length: usize, most: usize) -> impl Iterator<Item = usize> {
    let chosen = length.min(most);
    (0..chosen).map(move |i| {
        if length <= most {
            i
        } else {
            i * (length - 1) / (most - 1)
        }
    })
}

fn ends(interval: &Interval) -> [f64; 2] {
    [interval.low, interval.high]
}

/// The interval of a mean, if the axis can show it.
fn shown(summary: &Summary, log: bool) -> Option<[f64; 2]> {
    let interval = summary.mean_interval.as_ref().map(ends);
    interval.filter(|[low, _]| !log || *low > 0.0)
}

/// Makes figures of trials.
pub(super) struct Maker<'a> {
    pub(super) trials: &'a Trials<'a>,
    pub(super) ranking: &'a Ranking,
    pub(super) summaries: &'a [PlannerSummary],
}

impl<'a> Maker<'a> {
    pub(super) fn new(trials: &'a Trials<'a>, evaluation: &'a Evaluation) -> Self {
        Self {
            trials,
            ranking: &evaluation.ranking,
            summaries: &evaluation.planners,
        }
    }

    /// All that have something to show.
    pub(super) fn all(&self) -> Vec<Figure> {
        let mut figures = vec![self.success(), self.cactus(), self.profile(), self.times()];
        // One planner is always the fastest.
        figures.retain(|figure| figure.id != "profile" || self.summaries.len() > 1);
        figures.extend([&SOLVE_TIME, &PATH_LENGTH, &EXPANSIONS].map(|metric| self.means(metric)));
        if let [first, second, ..] = &self.ranking.planners[..] {
            figures.extend(self.scatter(&first.planner, &second.planner, &SOLVE_TIME));
        }
        figures.extend([self.quality(), self.targets()]);
        if let Some(size) = size_of(self.trials) {
            figures.extend(METRICS.iter().map(|metric| self.by_size(size, metric)));
        }
        figures.retain(|figure| !figure.is_empty());
        figures
    }

    fn slot(&self, planner: &str) -> usize {
        let planners = self.trials.planners();
        let slot = planners.iter().position(|one| one.label == planner);
        slot.unwrap_or_default()
    }

    fn series(&self, planner: &str, marks: Marks) -> Series {
        Series {
            name: planner.to_owned(),
            slot: self.slot(planner),
            marks,
        }
    }

    fn at(&self, planner: &str) -> usize {
        let mut planners = self.ranking.planners.iter();
        let at = planners.position(|ranked| ranked.planner == planner);
        at.unwrap_or_default()
    }

    fn names(&self) -> Axis {
        let names = self.ranking.planners.iter();
        Axis {
            names: Some(names.map(|ranked| ranked.planner.clone()).collect()),
            ..Axis::default()
        }
    }

    /// Success rates: curves by size, or bars where there is one size.
    fn success(&self) -> Figure {
        let caption = "Share of trials that succeeded, with 95 % intervals.";
        let Some(size) = size_of(self.trials) else {
            let bar = |summary: &PlannerSummary| {
                let marks = Marks::Bar {
                    at: self.at(&summary.planner),
                    value: Some(summary.success_rate),
                    interval: summary.success_interval.as_ref().map(ends),
                };
                self.series(&summary.planner, marks)
            };
            return Figure {
                id: "success".into(),
                title: "Success".into(),
                caption: caption.into(),
                x: share("success"),
                y: self.names(),
                diagonal: false,
                series: self.summaries.iter().map(bar).collect(),
            };
        };
        let curve = |curve: crate::evaluate::Curve| {
            let points = curve.points.iter();
            let at = |point: &crate::evaluate::CurvePoint| point.level.number.unwrap_or_default();
            let marks = Marks::Curve {
                points: points.clone().map(|p| [at(p), p.success_rate]).collect(),
                band: points
                    .map(|p| p.success_interval.as_ref().map(ends))
                    .collect(),
            };
            self.series(&curve.planner, marks)
        };
        let curves = curves(self.trials, size, &SOLVE_TIME);
        Figure {
            id: "success".into(),
            title: format!("Success by {}", size_name(size)),
            caption: caption.into(),
            x: Axis::of(size_name(size)),
            y: share("success"),
            diagonal: false,
            series: curves.into_iter().map(curve).collect(),
        }
    }

    /// Shares of cases that are solved within something, of every planner.
    fn steps(&self, of: Vec<Cactus>) -> Vec<Series> {
        let curve = |cactus: Cactus| {
            let points = thinned(cactus.marks.len(), POINTS);
            let points: Vec<_> = points
                .map(|at| {
                    [
                        cactus.marks[at].value,
                        (at + 1) as f64 / cactus.cases as f64,
                    ]
                })
                .collect();
            let steps = self.series(&cactus.planner, Marks::Steps { points });
            (!cactus.marks.is_empty()).then_some(steps)
        };
        of.into_iter().filter_map(curve).collect()
    }

    fn cactus(&self) -> Figure {
        Figure {
            id: "cactus".into(),
            title: "Cases solved within a time".into(),
            caption:
                "Cactus plot: the share of its cases that each planner solves within how long. \
                      Higher and further left is better."
                    .into(),
            x: Quantity::of(&SOLVE_TIME).axis(),
            y: share("cases solved"),
            diagonal: false,
            series: self.steps(cactus(self.trials, &SOLVE_TIME)),
        }
    }

    fn profile(&self) -> Figure {
        Figure {
            id: "profile".into(),
            title: "Performance profile".into(),
            caption: "The share of its cases that each planner solves within so many times the time of \
                      the fastest planner of the instance: at 1 how often it is the fastest, on the \
                      right how much it solves."
                .into(),
            x: Axis::log("times the fastest"),
            y: share("cases solved"),
            diagonal: false,
            series: self.steps(profiles(self.trials, &SOLVE_TIME)),
        }
    }

    fn times(&self) -> Figure {
        let mut boxes = box_plots(self.trials, &SOLVE_TIME);
        boxes.sort_by_key(|found| self.at(&found.planner));
        let series = boxes.into_iter().map(|found| {
            let outliers = thinned(found.outliers.len(), OUTLIERS);
            let marks = Marks::Box {
                at: self.at(&found.planner),
                low: found.whisker_low,
                q1: found.summary.q1,
                median: found.summary.median,
                q3: found.summary.q3,
                high: found.whisker_high,
                mean: found.summary.mean,
                outliers: outliers.map(|at| found.outliers[at].value).collect(),
            };
            self.series(&found.planner, marks)
        });
        Figure {
            id: "times".into(),
            title: "Solve times".into(),
            caption: "Box: quartiles and median; diamond: mean; whiskers: the farthest values \
                      within one and a half boxes on the logarithmic axis. Of cases that \
                      succeeded."
                .into(),
            x: Quantity::of(&SOLVE_TIME).axis(),
            y: self.names(),
            diagonal: false,
            series: series.collect(),
        }
    }

    fn means(&self, metric: &Metric) -> Figure {
        let quantity = Quantity::of(metric);
        let log = quantity.log;
        let bar = |summary: &PlannerSummary| {
            let found = summary.metric(metric).map(|found| found.summary);
            let marks = Marks::Bar {
                at: self.at(&summary.planner),
                value: found.map(|found| found.mean),
                interval: found.and_then(|found| shown(&found, log)),
            };
            self.series(&summary.planner, marks)
        };
        Figure {
            id: format!("means-{}", metric.column),
            title: format!("Mean {}", metric.title),
            caption: "Means over cases that succeeded, with 95 % intervals.".into(),
            x: quantity.axis(),
            y: self.names(),
            diagonal: false,
            series: self.summaries.iter().map(bar).collect(),
        }
    }

    fn scatter(&self, x: &str, y: &str, metric: &Metric) -> Option<Figure> {
        let found = scatter(self.trials, x, y, metric)?;
        let points = found.points.iter();
        let points = points.filter_map(|point| Some([point.x?, point.y?]));
        let axis = |planner: &str| {
            let quantity = Quantity::of(metric);
            Axis {
                log: quantity.log,
                ..Axis::of(format!("{planner}: {}", quantity.label))
            }
        };
        let marks = Marks::Dots {
            points: points.collect(),
        };
        Some(Figure {
            id: format!("scatter-{}", metric.column),
            title: capital(&format!("{}: one against another", metric.title)),
            caption: format!(
                "A point per case that both solved; above the line the vertical planner has \
                 more. {}",
                only(&found)
            ),
            x: axis(x),
            y: axis(y),
            diagonal: true,
            series: vec![self.series(y, marks)],
        })
    }

    fn quality(&self) -> Figure {
        let quality = quality_over_time(self.trials, Reference::LowerBound, &moments(self.trials));
        let curve = |quality: crate::evaluate::Quality| {
            let points = quality.points.iter();
            let known = points.filter_map(|point| Some((point, point.mean_ratio?)));
            let points: Vec<_> = known.clone().map(|(p, ratio)| [p.time_ms, ratio]).collect();
            let band = known.map(|(point, ratio)| match &point.interval {
                Some(interval) => ends(interval),
                None => [ratio, ratio],
            });
            let band = Some(band.collect());
            let some = !points.is_empty();
            let curve = self.series(&quality.planner, Marks::Curve { points, band });
            some.then_some(curve)
        };
        Figure {
            id: "quality".into(),
            title: "Quality over time".into(),
            caption: "Mean ratio of the best valid plan so far to the lower bound, with 95 % \
                      intervals, over the cases that have a plan by then: it may rise when a hard \
                      case gets its first plan."
                .into(),
            x: Axis::log("time, ms"),
            y: Axis::of("SoC / lower bound"),
            diagonal: false,
            series: quality.into_iter().filter_map(curve).collect(),
        }
    }

    fn targets(&self) -> Figure {
        let times_ms = moments(self.trials);
        let curve = |found: Reached| {
            let mut points: Vec<[f64; 2]> = Vec::new();
            for (time_ms, share) in times_ms.iter().zip(found.shares) {
                if share > points.last().map_or(0.0, |point| point[1]) {
                    points.push([*time_ms, share]);
                }
            }
            let some = !points.is_empty();
            let steps = self.series(&found.planner, Marks::Steps { points });
            some.then_some(steps)
        };
        let found = targets_reached(self.trials, &times_ms);
        Figure {
            id: "targets".into(),
            title: "Targets reached over time".into(),
            caption: "The share of targets that each planner has reached within how long; a target is an \
                      instance and a gap of 1, 2, 5 or 10 % to the best plan that any planner found of it. \
                      Higher and further left is better."
                .into(),
            x: Axis::log("time, ms"),
            y: share("targets reached"),
            diagonal: false,
            series: found.into_iter().filter_map(curve).collect(),
        }
    }

    fn by_size(&self, size: Dimension, metric: &Metric) -> Figure {
        let quantity = Quantity::of(metric);
        let log = quantity.log;
        let curve = |curve: crate::evaluate::Curve| {
            let points = curve.points.iter();
            let known = points.filter_map(|point| Some((point.level.number?, point.values?)));
            let marks = Marks::Curve {
                points: known
                    .clone()
                    .map(|(size, found)| [size, found.mean])
                    .collect(),
                band: known
                    .map(|(_, found)| Some(shown(&found, log).unwrap_or([found.mean; 2])))
                    .collect(),
            };
            self.series(&curve.planner, marks)
        };
        let mut series: Vec<Series> = (curves(self.trials, size, metric).into_iter())
            .map(curve)
            .collect();
        series
            .retain(|one| !matches!(&one.marks, Marks::Curve { points, .. } if points.is_empty()));
        Figure {
            id: format!("size-{}", metric.column),
            title: capital(&format!("{} by {}", metric.title, size_name(size))),
            caption: "Means over cases that succeeded, with 95 % intervals. Failures are left \
                      out: read it beside the success rate."
                .into(),
            x: Axis::of(size_name(size)),
            y: quantity.axis(),
            diagonal: false,
            series,
        }
    }
}

/// Numbers of the instances that are not among the points of a scatter plot.
fn only(found: &crate::evaluate::Scatter) -> String {
    format!(
        "Only the horizontal one solved {}, only the vertical one {}, neither {}.",
        found.only_x, found.only_y, found.neither
    )
}
