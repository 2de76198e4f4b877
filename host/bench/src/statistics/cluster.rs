//! Inference where values come in clusters: what is of one scenario or map is alike, so that clusters
//! are what is counted and drawn, and not their values.
//!
//! Cameron and Miller, "A practitioner's guide to cluster-robust inference", Journal of Human
//! Resources 50 (2015), sections II and VI.

use fleetyard_world::SeededRandom;

use super::bootstrap::{Draws, percentiles};
use super::{Interval, sorted};

/// Fewest clusters from which anything is inferred: with fewer, no split of signs and no pair of
/// order statistics has a probability below 5 %.
pub const MIN_CLUSTERS: usize = 6;

/// Most clusters whose sign flips are all tried; above, they are drawn.
const ALL_FLIPS: usize = 20;

/// 95 % percentile bootstrap interval of a statistic of clusters, of [`MIN_CLUSTERS`] or more.
///
/// `statistic` is given how often each cluster was drawn, and says `None` where such a draw
/// determines nothing; these draws are left out.
pub fn bootstrap_clusters(
    clusters: usize,
    resamples: usize,
    seed: u64,
    mut statistic: impl FnMut(&[u32]) -> Option<f64>,
) -> Option<Interval> {
    let count = u32::try_from(clusters).ok()?;
    if clusters < MIN_CLUSTERS {
        return None;
    }
    let mut draws = Draws::new(SeededRandom::new("bootstrap clusters", seed), count);
    let mut drawn = vec![0; clusters];
    let values = (0..resamples).filter_map(|_| {
        drawn.fill(0);
        for _ in 0..count {
            drawn[draws.next()] += 1;
        }
        statistic(&drawn)
    });
    percentiles(&sorted(values))
}

/// Two-sided sign-flip test of the hypothesis that differences are symmetric about zero, one
/// difference for each cluster: the share of all flips of signs whose sum is as far from zero. With
/// more than 20 clusters 40,000 flips are drawn, and the one that was seen counts as one of
/// them. `None` with fewer than [`MIN_CLUSTERS`].
///
/// Fisher, "The design of experiments" (1935), section 21; as drawn, Phipson and Smyth,
/// "Permutation p-values should never be zero", Statistical Applications in Genetics 9 (2010).
pub fn sign_flip_test(differences: &[f64], seed: u64) -> Option<f64> {
    let n = differences.len();
    if n < MIN_CLUSTERS {
        return None;
    }
    let sizes: Vec<f64> = differences.iter().map(|value| value.abs()).collect();
    let scale: f64 = sizes.iter().sum();
    // Sums of the same terms in another order differ by rounding alone.
    let seen = differences.iter().sum::<f64>().abs() - 1e-12 * scale;
    if n <= ALL_FLIPS {
        let all = 1u32 << n;
        let far = (0..all).filter(|flips| {
            let signed =
                sizes.iter().enumerate().map(
                    |(at, size)| {
                        if flips >> at & 1 == 1 { -size } else { *size }
                    },
                );
            signed.sum::<f64>().abs() >= seen
        });
        return Some(far.count() as f64 / f64::from(all));
    }
    let mut random = SeededRandom::new("sign flips", seed);
    let far = (0..super::RESAMPLES).filter(|_| {
        let mut bits = 0;
        let signed = sizes.iter().enumerate().map(|(at, size)| {
            if at % 64 == 0 {
                bits = random.next_u64();
            }
            bits >>= u32::from(at % 64 != 0);
            if bits & 1 == 1 { -size } else { *size }
        });
        signed.sum::<f64>().abs() >= seen
    });
    Some((far.count() + 1) as f64 / (super::RESAMPLES + 1) as f64)
}
