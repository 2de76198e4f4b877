//! Description of a sample: centre, spread, quantiles.

use serde::Serialize;

use super::{Clustered, Interval, clustered_mean_interval, mean_interval};

/// Arithmetic mean, Σx/n.
pub fn mean(values: &[f64]) -> Option<f64> {
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

/// Sample standard deviation, √(Σ(x − x̄)²/(n − 1)), in two passes; of two values or more.
pub fn standard_deviation(values: &[f64]) -> Option<f64> {
    let mean = mean(values)?;
    let degrees = values.len().checked_sub(1).filter(|degrees| *degrees > 0)?;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    Some((squares / degrees as f64).sqrt())
}

/// The values in ascending order, which [`quantile`] and [`median`] need.
pub fn sorted(values: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_unstable_by(f64::total_cmp);
    values
}

/// The quantile at `level` (0 to 1) of ascending values, interpolated linearly: with
/// h = (n − 1)·level it is x₍⌊h⌋₎ + (h − ⌊h⌋)(x₍⌊h⌋₊₁₎ − x₍⌊h⌋₎), counted from 0.
///
/// Type 7 of Hyndman and Fan, "Sample quantiles in statistical packages", The American
/// Statistician 50 (1996); the default of R and NumPy.
pub fn quantile(ascending: &[f64], level: f64) -> Option<f64> {
    let last = ascending.len().checked_sub(1)?;
    let place = last as f64 * level.clamp(0.0, 1.0);
    let below = (place.floor() as usize).min(last);
    let (low, high) = (ascending[below], ascending[(below + 1).min(last)]);
    Some(low + (high - low) * (place - below as f64))
}

/// The median of ascending values: the [`quantile`] at one half.
pub fn median(ascending: &[f64]) -> Option<f64> {
    quantile(ascending, 0.5)
}

/// Everything a table or a box plot shows of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Summary {
    /// Number of values.
    pub count: usize,
    /// Arithmetic mean.
    pub mean: f64,
    /// Sample standard deviation; of two values or more.
    pub standard_deviation: Option<f64>,
    /// 95 % t interval of the mean; of two values or more.
    pub mean_interval: Option<Interval>,
    /// Smallest value.
    pub min: f64,
    /// First quartile.
    pub q1: f64,
    /// Median.
    pub median: f64,
    /// Third quartile.
    pub q3: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest value.
    pub max: f64,
}

impl Summary {
    /// Of values in clusters: the interval of the mean counts these.
    pub fn of_clustered(values: &[Clustered]) -> Option<Self> {
        let mut summary = Self::of(&values.iter().map(|value| value.1).collect::<Vec<_>>())?;
        summary.mean_interval = clustered_mean_interval(values);
        Some(summary)
    }

    /// Of values in any order.
    pub fn of(values: &[f64]) -> Option<Self> {
        let ascending = sorted(values.iter().copied());
        Some(Self {
            count: values.len(),
            // Of the sorted values, so that the sum does not depend on their order.
            mean: mean(&ascending)?,
            standard_deviation: standard_deviation(&ascending),
            mean_interval: mean_interval(&ascending),
            min: *ascending.first()?,
            q1: quantile(&ascending, 0.25)?,
            median: median(&ascending)?,
            q3: quantile(&ascending, 0.75)?,
            p95: quantile(&ascending, 0.95)?,
            max: *ascending.last()?,
        })
    }
}
