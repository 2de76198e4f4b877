//! Is one planner faster than another on the same instances?

/// Exact two-sided sign test: the probability, were both signs equally likely, of a split
/// at least as uneven, p = min(1, 2·Σ_{i ≤ k} C(n, i)/2ⁿ) with k the smaller count and
/// n = `positive` + `negative`. Pairs without a difference are left out before.
///
/// Arbuthnott (1710); Conover, "Practical nonparametric statistics" (1999), section 3.4.
/// Without any difference it is 1.
pub fn sign_test(positive: u64, negative: u64) -> f64 {
    let (fewer, n) = (positive.min(negative), positive + negative);
    // C(n, k)/2ⁿ factor by factor. Halvings are exact and taken as early as they can be,
    // which keeps the product near 1 for any n.
    let mut probability = 1.0f64;
    let mut halvings = n;
    for i in 1..=fewer {
        probability *= (n - i + 1) as f64 / i as f64;
        while probability > 1.0 && halvings > 0 {
            probability *= 0.5;
            halvings -= 1;
        }
    }
    // The smaller terms relative to this one, which is the largest: C(n, i−1)/C(n, i) = i/(n−i+1).
    let (mut term, mut sum) = (1.0f64, 1.0f64);
    for i in (1..=fewer).rev() {
        term *= i as f64 / (n - i + 1) as f64;
        sum += term;
        if term < f64::EPSILON * 1e-6 {
            break;
        }
    }
    // In two halves, because a single power of two would be lost below the smallest number.
    let half = i32::try_from(halvings / 2).unwrap_or(i32::MAX);
    let rest = i32::try_from(halvings - halvings / 2).unwrap_or(i32::MAX);
    (2.0 * probability * sum * 0.5f64.powi(half) * 0.5f64.powi(rest)).min(1.0)
}

/// Holm's step-down correction of several p-values, in the order given: the i-th smallest of
/// m becomes max_{j ≤ i} min(1, (m − j + 1)·p₍ⱼ₎).
///
/// Holm, "A simple sequentially rejective multiple test procedure", Scandinavian Journal of
/// Statistics 6 (1979). Keeps the chance of any false rejection among all below the level.
pub fn holm(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|a, b| p_values[*a].total_cmp(&p_values[*b]));
    let mut adjusted = vec![0.0; p_values.len()];
    let mut largest = 0.0f64;
    for (at, which) in order.into_iter().enumerate() {
        let corrected = (p_values.len() - at) as f64 * p_values[which];
        largest = largest.max(corrected.min(1.0));
        adjusted[which] = largest;
    }
    adjusted
}
