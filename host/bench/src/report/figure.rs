//! Content of figures, apart from how they are drawn: `svg.rs` draws them for papers, and
//! `page/plot.js` in the page, which makes the same figures of filtered trials.

use serde::Serialize;

/// A figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Figure {
    /// Its name among the figures of a report, fit for a file name.
    pub id: String,
    /// Its content, in a few words.
    pub title: String,
    /// Explanation for readers.
    pub caption: String,
    /// The horizontal axis.
    pub x: Axis,
    /// The vertical axis.
    pub y: Axis,
    /// True if both axes have the same values, and a line where they are equal.
    pub diagonal: bool,
    /// The series, later ones drawn over earlier ones.
    pub series: Vec<Series>,
}

/// An axis.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Axis {
    /// The quantity along it, with its unit.
    pub label: String,
    /// True if it is logarithmic.
    pub log: bool,
    /// True if its values are shares, written as per cent.
    pub percent: bool,
    /// True if it has to show zero.
    pub zero: bool,
    /// Its ends; by its values if they are not given.
    pub range: Option<[f64; 2]>,
    /// Names along it instead of numbers; values are indices into them.
    pub names: Option<Vec<String>>,
}

impl Axis {
    /// A linear axis with a label.
    pub fn of(label: impl Into<String>) -> Self {
        Self {
            label: label.into(),
            ..Self::default()
        }
    }

    /// A logarithmic axis with a label.
    pub fn log(label: &str) -> Self {
        Self {
            log: true,
            ..Self::of(label)
        }
    }
}

/// The data of a planner in a figure.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Series {
    /// The planner, or what else the series is of.
    pub name: String,
    /// Number of the planner, which stands for colour, dashes and mark.
    pub slot: usize,
    /// The marks.
    #[serde(flatten)]
    pub marks: Marks,
}

/// Marks of a planner. Points are `[x, y]`.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Marks {
    /// A line through points, with an interval of y around each if there is one.
    Curve {
        /// By ascending x.
        points: Vec<[f64; 2]>,
        /// Lower and upper end per point.
        band: Option<Vec<[f64; 2]>>,
    },
    /// A line that goes along x and jumps at the points.
    Steps {
        /// By ascending x.
        points: Vec<[f64; 2]>,
    },
    /// Points without a line.
    Dots {
        /// In any order.
        points: Vec<[f64; 2]>,
    },
    /// A bar along x, at a name of the y axis.
    Bar {
        /// Index of the name.
        at: usize,
        /// Its end, if there is a value.
        value: Option<f64>,
        /// An interval around the end.
        interval: Option<[f64; 2]>,
    },
    /// A box along x, at a name of the y axis.
    Box {
        /// Index of the name.
        at: usize,
        /// The smallest value within 1.5 interquartile ranges of the first quartile.
        low: f64,
        /// First quartile.
        q1: f64,
        /// Median.
        median: f64,
        /// Third quartile.
        q3: f64,
        /// The largest value within 1.5 interquartile ranges of the third quartile.
        high: f64,
        /// Mean.
        mean: f64,
        /// Values beyond both, or some of them where there are many.
        outliers: Vec<f64>,
    },
}

/// Steps of a logarithmic axis within a decade, by how many decades it has at least.
const STEPS: [(f64, &[f64]); 3] = [
    (2.2, &[1.0]),
    (0.7, &[1.0, 2.0, 5.0]),
    (0.0, &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0]),
];

/// An axis with its length: where values are along it, and where it is marked.
#[derive(Debug, PartialEq)]
pub(super) struct Scale {
    log: bool,
    from: f64,
    to: f64,
    length: f64,
    pub(super) ticks: Vec<f64>,
}

impl Scale {
    /// For these values. `room` is how long a mark and its text are.
    pub(super) fn new(axis: &Axis, values: &[f64], length: f64, room: f64) -> Self {
        if let Some(names) = &axis.names {
            return Self {
                log: false,
                from: -0.5,
                to: names.len().max(1) as f64 - 0.5,
                length,
                ticks: Vec::new(),
            };
        }
        let shown = |value: &&f64| value.is_finite() && (!axis.log || **value > 0.0);
        let shown = values.iter().filter(shown);
        let (mut low, mut high) = shown.fold((f64::INFINITY, f64::NEG_INFINITY), |ends, value| {
            (ends.0.min(*value), ends.1.max(*value))
        });
        if let Some([from, to]) = axis.range {
            (low, high) = (from, to);
        }
        if low > high {
            (low, high) = if axis.log { (1.0, 10.0) } else { (0.0, 1.0) };
        }
        let most = (length / room).floor().clamp(2.0, 12.0);
        if axis.log {
            return Self::logarithmic(low.log10(), high.log10(), length, most);
        }
        if axis.zero {
            (low, high) = (low.min(0.0), high.max(0.0));
        }
        if low >= high {
            let around = low.abs() * 0.1;
            (low, high) = if around > 0.0 {
                (low - around, high + around)
            } else {
                (0.0, 1.0)
            };
        }
        let least = (high - low) / most.min(6.0);
        let power = 10f64.powf(least.log10().floor());
        let steps = [1.0, 2.0, 2.5, 5.0, 10.0].map(|step| step * power);
        let step = steps.into_iter().find(|step| *step >= least * 0.999);
        let step = step.unwrap_or(10.0 * power);
        if axis.range.is_none() {
            let margin = (high - low) * 0.04;
            low -= if axis.zero && low == 0.0 { 0.0 } else { margin };
            high += if axis.zero && high == 0.0 {
                0.0
            } else {
                margin
            };
        }
        let (first, last) = ((low / step - 1e-9).ceil(), (high / step + 1e-9).floor());
        let ticks = (0..=(last - first).max(0.0) as usize).map(|i| (first + i as f64) * step);
        Self {
            log: false,
            from: low,
            to: high,
            length,
            ticks: ticks.collect(),
        }
    }

    fn logarithmic(from: f64, to: f64, length: f64, most: f64) -> Self {
        let margin = (0.03 * (to - from)).max(0.05);
        let (from, to) = (from - margin, to + margin);
        let steps = STEPS.iter().find(|(decades, _)| to - from > *decades);
        let steps = steps.map_or(STEPS[2].1, |(_, steps)| steps);
        let every = ((to - from) / most).ceil().max(1.0) as i32;
        let powers = (from.floor() as i32..=to.floor() as i32).filter(|power| power % every == 0);
        let ticks = powers.flat_map(|power| steps.iter().map(move |step| step * 10f64.powi(power)));
        let within = |tick: &f64| (from - 1e-9..=to + 1e-9).contains(&tick.log10());
        Self {
            log: true,
            from,
            to,
            length,
            ticks: ticks.filter(within).collect(),
        }
    }

    /// Position of a value along the axis.
    pub(super) fn place(&self, value: f64) -> f64 {
        let value = if self.log {
            value.max(1e-300).log10()
        } else {
            value
        };
        (value - self.from) / (self.to - self.from) * self.length
    }

    /// The values at both ends.
    pub(super) fn ends(&self) -> [f64; 2] {
        [self.from, self.to].map(|end| if self.log { 10f64.powf(end) } else { end })
    }
}

/// Intervals of few values may be so wide that nothing else could be seen: they widen an
/// axis by a third of what its points need, at either end, and are cut off beyond.
fn bounded(points: &[f64], bands: &[f64], log: bool) -> Vec<f64> {
    let on_axis = |value: f64| if log { value.log10() } else { value };
    let values = points
        .iter()
        .map(|value| on_axis(*value))
        .filter(|value| value.is_finite());
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |ends, value| {
        (ends.0.min(value), ends.1.max(value))
    });
    let bound = |value: f64| {
        if low < high && value.is_finite() {
            value.clamp(low - (high - low) / 3.0, high + (high - low) / 3.0)
        } else {
            value
        }
    };
    let bands = bands.iter().map(|value| bound(on_axis(*value)));
    bands
        .map(|value| if log { 10f64.powf(value) } else { value })
        .collect()
}

impl Figure {
    /// All values along x, and all along y.
    pub(super) fn values(&self) -> [Vec<f64>; 2] {
        let (mut xs, mut ys, mut bands) = (Vec::new(), Vec::new(), Vec::new());
        for series in &self.series {
            match &series.marks {
                Marks::Curve { points, band } => {
                    xs.extend(points.iter().map(|[x, _]| x));
                    ys.extend(points.iter().map(|[_, y]| y));
                    bands.extend(band.iter().flatten().flatten());
                }
                Marks::Steps { points } | Marks::Dots { points } => {
                    xs.extend(points.iter().map(|[x, _]| x));
                    ys.extend(points.iter().map(|[_, y]| y));
                }
                Marks::Bar {
                    value, interval, ..
                } => {
                    xs.extend(value);
                    xs.extend(interval.iter().flatten());
                }
                Marks::Box {
                    low,
                    high,
                    mean,
                    outliers,
                    ..
                } => {
                    xs.extend([low, high, mean]);
                    xs.extend(outliers);
                }
            }
        }
        ys.extend(bounded(&ys, &bands, self.y.log));
        [xs, ys]
    }

    /// True if there is nothing to be seen.
    pub fn is_empty(&self) -> bool {
        let [xs, _] = self.values();
        xs.is_empty()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticks(axis: &Axis, values: &[f64]) -> Vec<f64> {
        Scale::new(axis, values, 300.0, 50.0).ticks
    }

    #[test]
    fn axes_are_marked_at_round_values() {
        let linear = Axis::default();
        assert_eq!(ticks(&linear, &[10.0, 200.0]), [50.0, 100.0, 150.0, 200.0]);
        assert_eq!(ticks(&linear, &[3.0]).len(), 7);
        let share = Axis {
            range: Some([0.0, 1.0]),
            ..Axis::default()
        };
        assert_eq!(ticks(&share, &[]).len(), 6);
        let log = Axis {
            log: true,
            ..Axis::default()
        };
        assert_eq!(ticks(&log, &[0.2, 30.0]), [1.0, 10.0]);
        assert_eq!(ticks(&log, &[0.0, -3.0]), [1.0, 2.0, 5.0, 10.0]);
        assert_eq!(ticks(&log, &[1e-12, 1e12]).len(), 5);
        // Whatever the values are, there is an axis.
        for values in [vec![], vec![f64::NAN], vec![f64::MAX], vec![5e-324, 1e308]] {
            for axis in [&linear, &log, &share] {
                assert!(ticks(axis, &values).len() < 60, "{values:?}");
            }
        }
    }
}
