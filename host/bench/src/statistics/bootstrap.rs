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

#[cfg(test)]
mod tests {
    use super::*;

    const COUNT: usize = 100_000;

    /// Mean, variance, and the third and the fourth moment about the mean.
    fn moments(mut draw: impl FnMut() -> f64) -> [f64; 4] {
        let values: Vec<f64> = (0..COUNT).map(|_| draw()).collect();
        let mean_of = |power: i32, center: f64| {
            let powers = values.iter().map(|value| (value - center).powi(power));
            powers.sum::<f64>() / COUNT as f64
        };
        let mean = mean_of(1, 0.0);
        [mean, mean_of(2, mean), mean_of(3, mean), mean_of(4, mean)]
    }

    #[test]
    fn what_is_drawn_has_the_moments_of_its_distribution() {
        let mut random = SeededRandom::new("moments", 1);
        let near = |found: [f64; 4], wanted: [f64; 4], off: [f64; 4]| {
            for ((found, wanted), off) in found.iter().zip(wanted).zip(off) {
                assert!((found - wanted).abs() < off, "{found} is not {wanted}");
            }
        };
        let found = moments(|| normal(&mut random));
        near(found, [0.0, 1.0, 0.0, 3.0], [0.02, 0.02, 0.05, 0.15]);
        // Of shape k: mean and variance k, third moment 2k, fourth 3k² + 6k.
        for k in [0.5, 1.0, 3.0, 20.0] {
            let found = moments(|| gamma_of_any_shape(&mut random, k));
            let wanted = [k, k, 2.0 * k, 3.0 * k * k + 6.0 * k];
            let off = [0.02 * k, 0.03 * k, 0.2 * k, 0.15 * wanted[3]];
            near(found, wanted, off);
        }
    }

    /// All numbers below a bound come as often, and the halves of one number do not repeat.
    #[test]
    fn draws_are_even() {
        for bound in [1, 3, 7, 1000] {
            let mut draws = Draws::new(SeededRandom::new("even", 2), bound);
            let mut counts = vec![0u32; bound as usize];
            let mut pairs = 0;
            let mut before = usize::MAX;
            for _ in 0..COUNT {
                let drawn = draws.next();
                counts[drawn] += 1;
                pairs += u32::from(drawn == before);
                before = drawn;
            }
            let wanted = COUNT as f64 / f64::from(bound);
            let far = counts
                .iter()
                .filter(|count| (f64::from(**count) - wanted).abs() > 4.5 * wanted.sqrt());
            assert_eq!(far.count(), 0, "{bound}: {counts:?}");
            assert!((f64::from(pairs) - wanted).abs() < 4.5 * wanted.sqrt() + 1.0);
        }
        // Half of all halves are of no use for a bound of a little more than half of their range: one of
        // them has to fall into the last third in a third of the draws.
        let bound = 3 << 30;
        let mut draws = Draws::new(SeededRandom::new("even", 3), bound);
        let last = (0..COUNT).filter(|_| draws.next() >= 2 << 30).count();
        assert!(
            (last as f64 / COUNT as f64 - 1.0 / 3.0).abs() < 0.01,
            "{last}"
        );
    }
}
