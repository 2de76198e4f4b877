//! The probability that one planner is better, and by more than matters.

use fleetyard_world::SeededRandom;
use serde::Serialize;

use super::bootstrap::gamma_of_any_shape;

/// Probabilities that the typical difference is below a region that does not matter, within it, and
/// above it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Posterior {
    /// Below −`rope`.
    pub below: f64,
    /// From −`rope` to `rope`.
    pub equivalent: f64,
    /// Above `rope`.
    pub above: f64,
}

/// The Bayesian signed-rank test: differences, one of each cluster, are weighted by draws of
/// Dirichlet(½, 1, …, 1), whose first weight belongs to a difference of zero; in each draw the
/// weights of pairs count for where their mean lies, and the region with most of them wins.
///
/// Benavoli, Corani, Mangili, Zaffalon and Ruggeri, "A Bayesian Wilcoxon signed-rank test based on
/// the Dirichlet process", ICML 2014; with the region, Benavoli, Corani, Demšar and Zaffalon, "Time
/// for a change", Journal of Machine Learning Research 18 (2017), section 4.2. Quadratic in the
/// number of differences. `None` without any, or without a draw.
pub fn bayesian_signed_rank(
    differences: &[f64],
    rope: f64,
    draws: usize,
    seed: u64,
) -> Option<Posterior> {
    if differences.is_empty() || draws == 0 {
        return None;
    }
    let values: Vec<f64> = [0.0]
        .into_iter()
        .chain(differences.iter().copied())
        .collect();
    // In which region the mean of two lies does not change between draws.
    let mut regions = Vec::with_capacity(values.len() * (values.len() + 1) / 2);
    for (i, one) in values.iter().enumerate() {
        for other in &values[..=i] {
            let (twice, edge) = (one + other, 2.0 * rope);
            let (below, above) = (half_open(-twice, edge), half_open(twice, edge));
            regions.push([below, 1.0 - below - above, above]);
        }
    }
    let mut random = SeededRandom::new("bayesian signed rank", seed);
    let mut wins = [0.0; 3];
    let mut weights = vec![0.0; values.len()];
    for _ in 0..draws {
        for (at, weight) in weights.iter_mut().enumerate() {
            *weight = gamma_of_any_shape(&mut random, if at == 0 { 0.5 } else { 1.0 });
        }
        let mut sums = [0.0; 3];
        let mut regions = regions.iter();
        for (i, one) in weights.iter().enumerate() {
            for (j, other) in weights[..=i].iter().enumerate() {
                let both = if i == j { one * one } else { 2.0 * one * other };
                let shares = regions.next().into_iter().flatten();
                for (sum, share) in sums.iter_mut().zip(shares) {
                    *sum += both * share;
                }
            }
        }
        let most = sums.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let first: Vec<usize> = (0..3).filter(|at| sums[*at] >= most).collect();
        for at in &first {
            wins[*at] += 1.0 / first.len() as f64;
        }
    }
    let [below, equivalent, above] = wins.map(|wins| wins / draws as f64);
    Some(Posterior {
        below,
        equivalent,
        above,
    })
}

/// 1 beyond an edge, and on it a half, as where regions meet.
fn half_open(value: f64, edge: f64) -> f64 {
    if value > edge {
        1.0
    } else if value < edge {
        0.0
    } else {
        0.5
    }
}
