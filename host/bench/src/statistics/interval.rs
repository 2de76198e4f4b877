//! Confidence intervals by formula.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use super::{mean, standard_deviation};

/// Confidence of every interval.
pub const CONFIDENCE: f64 = 0.95;

/// From where to where.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// 95 % score interval of a proportion: (p̂ + z²/2n ± z√(p̂(1 − p̂)/n + z²/4n²)) / (1 + z²/n).
///
/// Wilson, "Probable inference, the law of succession, and statistical inference", Journal
/// of the American Statistical Association 22 (1927); without continuity correction. It
/// says something where all trials succeed, which the normal approximation does not.
pub fn wilson(successes: u64, trials: u64) -> Option<Interval> {
    if trials == 0 || successes > trials {
        return None;
    }
    let z = Normal::standard().inverse_cdf(f64::midpoint(1.0, CONFIDENCE));
    let n = trials as f64;
    let share = successes as f64 / n;
    let center = share + z * z / (2.0 * n);
    let half = z * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + z * z / n;
    // The ends are exactly 0 and 1 here, which rounding would miss.
    let low = if successes == 0 {
        0.0
    } else {
        (center - half) / scale
    };
    let high = if successes == trials {
        1.0
    } else {
        (center + half) / scale
    };
    Some(Interval { low, high })
}

/// 95 % interval of the mean: x̄ ± t₍n−1₎·s/√n with Student's quantile; of two values or more.
///
/// Student, "The probable error of a mean", Biometrika 6 (1908).
pub fn mean_interval(values: &[f64]) -> Option<Interval> {
    let (mean, deviation) = (mean(values)?, standard_deviation(values)?);
    let student = StudentsT::new(0.0, 1.0, (values.len() - 1) as f64).ok()?;
    let quantile = student.inverse_cdf(f64::midpoint(1.0, CONFIDENCE));
    let half = quantile * deviation / (values.len() as f64).sqrt();
    Some(Interval {
        low: mean - half,
        high: mean + half,
    })
}
