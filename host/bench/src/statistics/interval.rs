//! Confidence intervals by formula.

use serde::Serialize;
use statrs::distribution::{Binomial, ContinuousCDF, DiscreteCDF, Normal, StudentsT};

use super::{mean, standard_deviation};

/// Confidence of every interval.
pub const CONFIDENCE: f64 = 0.95;

/// A closed interval.
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
    wilson_share(successes as f64 / trials as f64, trials as f64)
}

/// The same of a share of `n` trials, of which neither has to be whole.
pub(super) fn wilson_share(share: f64, n: f64) -> Option<Interval> {
    if !(n > 0.0 && (0.0..=1.0).contains(&share)) {
        return None;
    }
    let z = Normal::standard().inverse_cdf(f64::midpoint(1.0, CONFIDENCE));
    let center = share + z * z / (2.0 * n);
    let half = z * (share * (1.0 - share) / n + z * z / (4.0 * n * n)).sqrt();
    let scale = 1.0 + z * z / n;
    // The ends are exactly 0 and 1 here, which rounding would miss.
    let low = if share <= 0.0 {
        0.0
    } else {
        (center - half) / scale
    };
    let high = if share >= 1.0 {
        1.0
    } else {
        (center + half) / scale
    };
    Some(Interval { low, high })
}

/// Distribution-free interval of the median of ascending values: from the k-th smallest to the k-th
/// largest, with the largest k for which P(k ≤ B < n + 1 − k) ≥ 95 %, B binomial with n and ½. Under
/// six values there is none. The second value is that probability.
///
/// David and Nagaraja, "Order statistics", 3rd ed. (2003), section 7.1.
pub fn median_interval(ascending: &[f64]) -> Option<(Interval, f64)> {
    let n = ascending.len();
    let binomial = Binomial::new(0.5, n as u64).ok()?;
    let coverage = |k: usize| 1.0 - 2.0 * binomial.cdf(k as u64 - 1);
    // It covers the less, the larger k is.
    let (mut k, mut beyond) = (0, n / 2 + 1);
    while beyond - k > 1 {
        let middle = k.midpoint(beyond);
        if coverage(middle) >= CONFIDENCE {
            k = middle;
        } else {
            beyond = middle;
        }
    }
    if k == 0 {
        return None;
    }
    let (low, high) = (ascending[k - 1], ascending[n - k]);
    Some((Interval { low, high }, coverage(k)))
}

/// 95 % interval of the difference of two rates over the same cases, from how many both, the first
/// alone, the second alone and neither solved: the difference of the rates with the square-and-add
/// combination of their Wilson intervals, and the correlation of the pairs.
///
/// Newcombe, "Improved confidence intervals for the difference between binomial proportions based on
/// paired data", Statistics in Medicine 17 (1998), method 10.
pub fn paired_rate_difference(
    both: u64,
    first: u64,
    second: u64,
    neither: u64,
) -> Option<(f64, Interval)> {
    let n = both + first + second + neither;
    let (one, other) = (wilson(both + first, n)?, wilson(both + second, n)?);
    let [both, first, second, neither] = [both, first, second, neither].map(|count| count as f64);
    let (p1, p2) = ((both + first) / n as f64, (both + second) / n as f64);
    let margins = (both + first) * (second + neither) * (both + second) * (first + neither);
    let cross = both * neither - first * second;
    // With a correction for continuity where pairs agree more often than by chance.
    let numerator = if cross > 0.0 {
        (cross - n as f64 / 2.0).max(0.0)
    } else {
        cross
    };
    let correlation = if margins > 0.0 {
        numerator / margins.sqrt()
    } else {
        0.0
    };
    let reach = |a: f64, b: f64| (a * a - 2.0 * correlation * a * b + b * b).max(0.0).sqrt();
    let difference = p1 - p2;
    let interval = Interval {
        low: difference - reach(p1 - one.low, other.high - p2),
        high: difference + reach(one.high - p1, p2 - other.low),
    };
    Some((difference, interval))
}

/// 95 % interval of the mean: x̄ ± t₍n−1₎·s/√n with Student's quantile; of two values or more.
///
/// Student, "The probable error of a mean", Biometrika 6 (1908).
pub fn mean_interval(values: &[f64]) -> Option<Interval> {
    let (mean, deviation) = (mean(values)?, standard_deviation(values)?);
    around(mean, deviation / (values.len() as f64).sqrt(), values.len())
}

/// x̄ ± t₍n−1₎·`error`, of `n` values or clusters.
pub(super) fn around(mean: f64, error: f64, n: usize) -> Option<Interval> {
    let student = StudentsT::new(0.0, 1.0, n.checked_sub(1)? as f64).ok()?;
    let half = student.inverse_cdf(f64::midpoint(1.0, CONFIDENCE)) * error;
    Some(Interval {
        low: mean - half,
        high: mean + half,
    })
}
