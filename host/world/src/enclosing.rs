//! The minimum enclosing circle: the smallest circle that contains all points.
//!
//! Welzl's observation that two or three of the points determine it is used
//! without his recursion: starting from the circle of few points, the farthest
//! point that is still outside joins them, and the circle of these at most four
//! points is found by looking at all pairs and triples. The radius grows with
//! every round, so the search ends, in practice after a handful of rounds of
//! one pass over the points each. Nothing is random.
//!
//! E. Welzl, "Smallest enclosing disks (balls and ellipsoids)", 1991;
//! B. Gärtner, "Fast and robust smallest enclosing balls", 1999 (the pivot).

use crate::Vector;

/// Centre and radius of the smallest circle around `points`, of which there is
/// at least one. No point is farther from the centre than the radius.
pub(crate) fn minimum_enclosing_circle(points: &[[f64; 2]]) -> ([f64; 2], f64) {
    let points: Vec<Vector> = points.iter().map(|point| (*point).into()).collect();
    let mut support = vec![points[0]];
    let mut center = points[0];
    let mut squared = 0.0;
    // Rounding could make the last rounds go in a circle; more rounds than
    // points are never needed.
    for _ in 0..=2 * points.len() {
        let (farthest, distance) = farthest(&points, center);
        if distance <= squared * SLACK {
            break;
        }
        support.push(farthest);
        (support, center, squared) = smallest_around(&support);
    }
    (center.into(), farthest(&points, center).1.sqrt())
}

/// Squared distances that differ by less than this factor are equal.
const SLACK: f64 = 1.0 + 1e-13;

fn farthest(points: &[Vector], center: Vector) -> (Vector, f64) {
    let mut most = (points[0], -1.0);
    for point in points {
        let squared = (point - center).norm_squared();
        if squared > most.1 {
            most = (*point, squared);
        }
    }
    most
}

/// The smallest circle around at most four points: those of them that it passes
/// through, its centre and its squared radius.
fn smallest_around(points: &[Vector]) -> (Vec<Vector>, Vector, f64) {
    let mut best: Option<(Vec<Vector>, Vector, f64)> = None;
    let mut consider = |through: &[Vector], center: Vector| {
        let squared = farthest(through, center).1;
        let contains = farthest(points, center).1 <= squared * SLACK;
        if contains && best.as_ref().is_none_or(|(_, _, least)| squared < *least) {
            best = Some((through.to_vec(), center, squared));
        }
    };
    for (at, a) in points.iter().enumerate() {
        for (next, b) in points.iter().enumerate().skip(at + 1) {
            consider(&[*a, *b], (a + b) * 0.5);
            for c in &points[next + 1..] {
                if let Some(center) = circumcenter(*a, *b, *c) {
                    consider(&[*a, *b, *c], center);
                }
            }
        }
    }
    // Rounding may leave no circle that contains all of four nearly equal ones.
    best.unwrap_or_else(|| {
        let center = circumcenter(points[0], points[1], points[points.len() - 1]);
        let center = center.unwrap_or(points[0]);
        (points[..2].to_vec(), center, farthest(points, center).1)
    })
}

/// The point that is as far from `a` as from `b` and `c`, unless they are in line.
fn circumcenter(a: Vector, b: Vector, c: Vector) -> Option<Vector> {
    let (b, c) = (b - a, c - a);
    let (b2, c2) = (b.norm_squared(), c.norm_squared());
    let from_a = Vector::new(c.y * b2 - b.y * c2, b.x * c2 - c.x * b2) / (2.0 * b.perp(&c));
    from_a.iter().all(|v| v.is_finite()).then(|| a + from_a)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn known_circles() {
        type Case<'a> = (&'a [[f64; 2]], [f64; 2], f64);
        let cases: [Case<'_>; 5] = [
            (&[[3.0, 4.0]], [3.0, 4.0], 0.0),
            (&[[0.0, 0.0], [2.0, 0.0]], [1.0, 0.0], 1.0),
            // Obtuse: the longest side is the diameter.
            (&[[0.0, 0.0], [4.0, 0.0], [1.0, 0.5]], [2.0, 0.0], 2.0),
            (
                &[[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]],
                [2.0, 1.5],
                2.5,
            ),
            (&[[1.0, 1.0], [1.0, 1.0], [1.0, 1.0]], [1.0, 1.0], 0.0),
        ];
        for (points, center, radius) in cases {
            let found = minimum_enclosing_circle(points);
            assert!(
                (Vector::from(found.0) - Vector::from(center)).norm() < 1e-12,
                "{points:?}"
            );
            assert!((found.1 - radius).abs() < 1e-12, "{points:?}");
        }
    }

    /// Anything, or a whole number, so that points coincide and are in line.
    fn coordinate() -> impl Strategy<Value = f64> {
        prop_oneof![-9.0..9.0f64, (-3..3i32).prop_map(f64::from)]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1000))]

        /// No circle through two or three of the points that contains all of
        /// them is smaller.
        #[test]
        fn it_is_the_smallest(
            points in proptest::collection::vec((coordinate(), coordinate()), 1..14),
        ) {
            let points: Vec<[f64; 2]> = points.into_iter().map(|(x, y)| [x, y]).collect();
            let (center, radius) = minimum_enclosing_circle(&points);
            let points: Vec<Vector> = points.into_iter().map(Vector::from).collect();
            for point in &points {
                prop_assert!((point - Vector::from(center)).norm() <= radius);
            }
            let mut least = if points.len() == 1 { 0.0 } else { f64::INFINITY };
            let mut consider = |center: Vector| {
                least = f64::min(least, farthest(&points, center).1.sqrt());
            };
            for a in &points {
                for b in &points {
                    consider((a + b) * 0.5);
                    for c in &points {
                        if let Some(center) = circumcenter(*a, *b, *c) {
                            consider(center);
                        }
                    }
                }
            }
            prop_assert!((radius - least).abs() < 1e-9, "{} {}", radius, least);
        }
    }
}
