//! Intervals without an assumption about the distribution: the percentile bootstrap.
//!
//! Efron and Tibshirani, "An introduction to the bootstrap" (1993), chapter 13: draw n
//! values with replacement, take the statistic, repeat; the interval is from the 2.5th to
//! the 97.5th percentile of what came out.

use fleetyard_world::SeededRandom;

use super::{CONFIDENCE, Interval, mean, quantile, sorted};

/// Resamples of an interval, as in the maze paper.
pub const RESAMPLES: usize = 40_000;

/// The seed of every interval, as in the maze paper.
pub const BOOTSTRAP_SEED: u64 = 20_260_226;

/// 95 % percentile bootstrap interval of the median, of two values or more.
///
/// The time does not depend on the number of values, because no resample is drawn value by
/// value. A resample of ascending x₀ … xₙ₋₁ is x at ⌊n·U⌋ for n independent uniform U, so
/// that its k-th smallest value is x at ⌊n·U₍ₖ₎⌋, and order statistics of uniforms are
/// ratios of gamma variables (Devroye, "Non-uniform random variate generation" (1986),
/// section V.3): U₍ₖ₎ = G/(G + H) with G ~ Γ(k), H ~ Γ(n + 1 − k), and for a neighbour
/// U₍ₖ₊₁₎ = (G + E)/(G + E + H) with E ~ Γ(1) and H ~ Γ(n − k). This is the distribution
/// of plain resampling, not an approximation of it.
pub fn bootstrap_median(values: &[f64], resamples: usize, seed: u64) -> Option<Interval> {
    let ascending = sorted(values.iter().copied());
    let n = ascending.len();
    if n < 2 || resamples == 0 {
        return None;
    }
    if ascending[n - 1] <= ascending[0] {
        let (low, high) = (ascending[0], ascending[0]);
        return Some(Interval { low, high });
    }
    // Ranks of both middle values, from 1; the same for odd n.
    let (low, high) = (n.div_ceil(2), n / 2 + 1);
    let mut random = SeededRandom::new("bootstrap median", seed);
    let place = |below: f64, total: f64| {
        let place = (n as f64 * (below / total)) as usize;
        ascending[place.min(n - 1)]
    };
    let medians = (0..resamples).map(|_| {
        let below = gamma(&mut random, low as f64);
        let between = if low == high {
            0.0
        } else {
            -random.unit().ln()
        };
        let above = gamma(&mut random, (n + 1 - high) as f64);
        let total = below + between + above;
        f64::midpoint(place(below, total), place(below + between, total))
    });
    percentiles(&sorted(medians))
}

/// 95 % percentile bootstrap interval of the mean, of two values or more.
pub fn bootstrap_mean(values: &[f64], resamples: usize, seed: u64) -> Option<Interval> {
    let count = u32::try_from(values.len())
        .ok()
        .filter(|count| *count > 1)?;
    let center = mean(values)?;
    // Around the mean, so that what differs between resamples is not lost in their sums.
    let around: Vec<f64> = values.iter().map(|value| value - center).collect();
    let mut draws = Draws::new(SeededRandom::new("bootstrap mean", seed), count);
    let means = (0..resamples).map(|_| {
        let sum: f64 = (0..count).map(|_| around[draws.next()]).sum();
        center + sum / f64::from(count)
    });
    percentiles(&sorted(means))
}

pub(super) fn percentiles(ascending: &[f64]) -> Option<Interval> {
    let outside = f64::midpoint(1.0, -CONFIDENCE);
    Some(Interval {
        low: quantile(ascending, outside)?,
        high: quantile(ascending, 1.0 - outside)?,
    })
}

/// A gamma variable of any positive shape: one of the next shape times U^(1/shape), as Marsaglia and
/// Tsang have it in section 6.
pub(super) fn gamma_of_any_shape(random: &mut SeededRandom, shape: f64) -> f64 {
    if shape >= 1.0 {
        return gamma(random, shape);
    }
    gamma(random, shape + 1.0) * random.unit().powf(1.0 / shape)
}

/// A gamma variable of a shape of at least 1 and scale 1: Marsaglia and Tsang, "A simple
/// method for generating gamma variables", ACM Transactions on Mathematical Software 26 (2000).
fn gamma(random: &mut SeededRandom, shape: f64) -> f64 {
    let d = shape - 1.0 / 3.0;
    let c = 1.0 / (9.0 * d).sqrt();
    loop {
        let x = normal(random);
        let v = (1.0 + c * x).powi(3);
        if v > 0.0 && random.unit().ln() < 0.5 * x * x + d * (1.0 - v + v.ln()) {
            return d * v;
        }
    }
}

/// A standard normal variable: the polar method of Marsaglia and Bray (1964).
fn normal(random: &mut SeededRandom) -> f64 {
    loop {
        let (x, y) = (2.0 * random.unit() - 1.0, 2.0 * random.unit() - 1.0);
        let square = x * x + y * y;
        if square < 1.0 && square > 0.0 {
            return x * (-2.0 * square.ln() / square).sqrt();
        }
    }
}

/// Numbers below a bound, two of each number of the stream: Lemire, "Fast random integer
/// generation in an interval", ACM Transactions on Modeling and Computer Simulation 29 (2019).
pub(super) struct Draws {
    random: SeededRandom,
    bound: u32,
    /// The half that is left.
    rest: Option<u32>,
}

impl Draws {
    pub(super) fn new(random: SeededRandom, bound: u32) -> Self {
        Self {
            random,
            bound,
            rest: None,
        }
    }

    pub(super) fn next(&mut self) -> usize {
        loop {
            let half = self.rest.take().unwrap_or_else(|| {
                let both = self.random.next_u64();
                self.rest = Some((both >> 32) as u32);
                both as u32
            });
            let product = u64::from(half) * u64::from(self.bound);
            let low = product as u32;
            // Without this the first numbers would be a little likelier.
            if low >= self.bound || low >= self.bound.wrapping_neg() % self.bound {
                return (product >> 32) as usize;
            }
        }
    }
}
