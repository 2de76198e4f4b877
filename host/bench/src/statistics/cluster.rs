//! Inference where values come in clusters: what is of one scenario or map is alike, so that clusters
//! are what is counted and drawn, and not their values.
//!
//! Cameron and Miller, "A practitioner's guide to cluster-robust inference", Journal of Human
//! Resources 50 (2015), sections II and VI.

use std::collections::BTreeMap;

use fleetyard_world::SeededRandom;

use super::bootstrap::{Draws, percentiles};
use super::interval::{around, wilson_share};
use super::{Interval, sign_test, sorted};

/// Fewest clusters from which anything is inferred: with fewer, no split of signs and no pair of
/// order statistics has a probability below 5 %.
pub const MIN_CLUSTERS: usize = 6;

/// Most clusters whose sign flips are all tried; above, they are drawn.
const ALL_FLIPS: usize = 20;

/// A value and the number of its cluster.
pub type Clustered = (usize, f64);

/// A value, the number of its cluster, and how much it counts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Weighted {
    /// Number of its cluster.
    pub cluster: usize,
    /// The value.
    pub value: f64,
    /// Above zero.
    pub weight: f64,
}

fn equal(values: &[Clustered]) -> Vec<Weighted> {
    let weighted = |(cluster, value): &Clustered| Weighted {
        cluster: *cluster,
        value: *value,
        weight: 1.0,
    };
    values.iter().map(weighted).collect()
}

/// By cluster, the weight of its values and the weighted sum of their differences from `center`.
fn sums(values: &[Weighted], center: f64) -> BTreeMap<usize, (f64, f64)> {
    let mut sums: BTreeMap<usize, (f64, f64)> = BTreeMap::new();
    for one in values {
        let (weight, sum) = sums.entry(one.cluster).or_default();
        *weight += one.weight;
        *sum += one.weight * (one.value - center);
    }
    sums
}

/// Σwx/Σw.
pub fn weighted_mean(values: &[Weighted]) -> Option<f64> {
    // Of sorted terms, so that it does not depend on their order.
    let sum = |of: fn(&Weighted) -> f64| sorted(values.iter().map(of)).iter().sum::<f64>();
    let weight = sum(|one| one.weight);
    (weight > 0.0).then(|| sum(|one| one.weight * one.value) / weight)
}

/// The mean of the values of each cluster, by its number.
pub fn cluster_means(values: &[Clustered]) -> Vec<f64> {
    let sums = sums(&equal(values), 0.0).into_values();
    sums.map(|(count, sum)| sum / count).collect()
}

/// 95 % interval of the mean of values in clusters, of [`MIN_CLUSTERS`] G or more:
/// x̄ ± t₍G−1₎·√(G/(G − 1)·Σ_g(Σ_{i ∈ g} wᵢ(xᵢ − x̄))²)/Σw. With one value in each it is Student's.
///
/// Cameron and Miller (2015), section II B, the variance with their correction for few clusters.
pub fn weighted_mean_interval(values: &[Weighted]) -> Option<Interval> {
    let center = weighted_mean(values)?;
    let sums = sums(values, center);
    let clusters = sums.len() as f64;
    if sums.len() < MIN_CLUSTERS {
        return None;
    }
    let squares: f64 = sums.values().map(|(_, sum)| sum * sum).sum();
    let weight: f64 = sums.values().map(|(weight, _)| weight).sum();
    let error = (clusters / (clusters - 1.0) * squares).sqrt() / weight;
    around(center, error, sums.len())
}

/// The same where every value counts as much.
pub fn clustered_mean_interval(values: &[Clustered]) -> Option<Interval> {
    weighted_mean_interval(&equal(values))
}

/// 95 % interval of the mean of shares from 0 to 1 in clusters, of [`MIN_CLUSTERS`] or more: Wilson's,
/// for as many trials as there are clusters of one size, n = (Σm)²/Σm² with weight m in each. No values
/// of a cluster can vary by more than if all of them were one, so that it is never too narrow.
///
/// Kish, "Survey sampling" (1965), section 8.2; Korn and Graubard, "Confidence intervals for proportions
/// with small expected number of positive counts estimated from survey data", Survey Methodology 24
/// (1998).
pub fn weighted_share_interval(values: &[Weighted]) -> Option<Interval> {
    // No more than one: rounded sums of sorted terms that are no more are no more.
    let share = weighted_mean(values)?;
    let sums = sums(values, 0.0);
    if sums.len() < MIN_CLUSTERS {
        return None;
    }
    let squares: f64 = sums.values().map(|(weight, _)| weight * weight).sum();
    let all: f64 = sums.values().map(|(weight, _)| weight).sum();
    wilson_share(share, all * all / squares)
}

/// The same where every share counts as much.
pub fn clustered_share_interval(values: &[Clustered]) -> Option<Interval> {
    weighted_share_interval(&equal(values))
}

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
/// difference for each cluster: the share of all flips of signs whose sum is as far from zero. Where
/// all that are not zero have one size, it is the sign test. With more than 20 of several sizes 40,000
/// flips are drawn, and the one that was seen counts as one of them. `None` with fewer than
/// [`MIN_CLUSTERS`].
///
/// Fisher, "The design of experiments" (1935), section 21; as drawn, Phipson and Smyth,
/// "Permutation p-values should never be zero", Statistical Applications in Genetics 9 (2010).
pub fn sign_flip_test(differences: &[f64], seed: u64) -> Option<f64> {
    if differences.len() < MIN_CLUSTERS {
        return None;
    }
    // A flip does not change what is zero.
    let differences: Vec<f64> = differences.iter().copied().filter(|d| *d != 0.0).collect();
    let n = differences.len();
    let sizes: Vec<f64> = differences.iter().map(|value| value.abs()).collect();
    let least = sizes.iter().copied().fold(f64::INFINITY, f64::min);
    if sizes.iter().all(|size| *size <= least * (1.0 + 1e-12)) {
        let positive = differences.iter().filter(|value| **value > 0.0).count();
        return Some(sign_test(positive as u64, (n - positive) as u64));
    }
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
