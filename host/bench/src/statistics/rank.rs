//! Do two rankings agree?

use std::cmp::Ordering;

/// Kendall's τ-b of paired values: (C − D) / √((C + D + Tx)(C + D + Ty)), with C concordant
/// and D discordant pairs, and Tx, Ty those tied in one of both alone. `None` where lengths
/// differ or either side is constant.
///
/// Kendall, "The treatment of ties in ranking problems", Biometrika 33 (1945). Quadratic:
/// rankings have as many entries as there are planners.
pub fn kendall_tau_b(x: &[f64], y: &[f64]) -> Option<f64> {
    if x.len() != y.len() {
        return None;
    }
    let (mut agreement, mut x_untied, mut y_untied) = (0i64, 0u64, 0u64);
    for i in 0..x.len() {
        for j in 0..i {
            let (by_x, by_y) = (x[i].total_cmp(&x[j]), y[i].total_cmp(&y[j]));
            agreement += by_x as i64 * by_y as i64;
            x_untied += u64::from(by_x != Ordering::Equal);
            y_untied += u64::from(by_y != Ordering::Equal);
        }
    }
    let scale = (x_untied as f64 * y_untied as f64).sqrt();
    (scale > 0.0).then(|| agreement as f64 / scale)
}
