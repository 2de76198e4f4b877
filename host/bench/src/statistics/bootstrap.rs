//! Draws of resampling, and the interval of their results: from the 2.5th to the 97.5th percentile
//! (Efron and Tibshirani, "An introduction to the bootstrap" (1993), chapter 13).

use fleetyard_world::SeededRandom;

use super::{CONFIDENCE, Interval, quantile};

/// Resamples of an interval and flips of a test, as in the maze paper.
pub const RESAMPLES: usize = 40_000;

/// The seed of whatever is drawn, as in the maze paper.
pub const BOOTSTRAP_SEED: u64 = 20_260_226;

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
