//! Closed forms for uniformly moving discs.
//!
//! Everything here is about one span of time, run through by a fraction s from
//! 0 to 1, and takes constant time. "Inside" is strict: a disc that touches is not inside. Whether the
//! ends of the span are inside is decided by the same expression on the same
//! numbers as at the end of the span before, so that a contact that lasts over
//! several spans neither flickers nor is lost to rounding.

use crate::{Pose, Vector};

/// When, within a span, something is inside something convex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Inside {
    /// Fraction at which it comes in; 0 if it was inside at the start.
    pub enter: f64,
    /// Fraction at which it goes out; 1 if it is inside at the end.
    pub leave: f64,
    /// Inside at the start of the span.
    pub at_start: bool,
    /// Inside at the end of the span.
    pub at_end: bool,
}

/// The motion of one point relative to another, in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Relative {
    /// The place at the start.
    pub start: Vector,
    /// The place at the end.
    pub end: Vector,
}

impl Relative {
    /// The motion of `two` as `one` sees it, each from one pose to the other.
    pub fn between(one: [Pose; 2], two: [Pose; 2]) -> Self {
        let seen = |at: usize| two[at].position() - one[at].position();
        Self {
            start: seen(0),
            end: seen(1),
        }
    }

    /// The motion seen from another place.
    #[must_use]
    pub fn seen_from(self, place: Vector) -> Self {
        Self {
            start: self.start - place,
            end: self.end - place,
        }
    }

    /// The whole way.
    pub(crate) fn way(self) -> Vector {
        self.end - self.start
    }

    /// The least squared distance to the origin and the first fraction at which
    /// it is reached.
    pub fn closest(self) -> (f64, f64) {
        let way = self.way();
        let (start, end) = (self.start.norm_squared(), self.end.norm_squared());
        let along = self.start.dot(&way);
        if along >= 0.0 {
            return (start, 0.0);
        }
        let length = way.norm_squared();
        if -along >= length {
            return (end, 1.0);
        }
        let s = -along / length;
        // Rounding must not make the least larger than an end, which decides
        // over contacts.
        let inner = (self.start + way * s).norm_squared();
        (inner.min(start).min(end), s)
    }

    /// When the point is nearer to the origin than `radius`, given the least
    /// squared distance from [`Relative::closest`].
    pub fn inside_disc(self, radius: f64, least_squared: f64) -> Option<Inside> {
        let limit = radius * radius;
        let [at_start, at_end] = [self.start, self.end].map(|at| at.norm_squared() < limit);
        if !at_start && !at_end && least_squared >= limit {
            return None;
        }
        // Rounding may lose the crossing: of a point at rest, whose ends decide,
        // and of one that comes by so fast that a moment is all there is.
        let crossing = disc_crossing(self.start, self.way(), limit).unwrap_or_else(|| {
            let (_, closest) = self.closest();
            (closest, closest)
        });
        Some(Inside::clamped(crossing, at_start, at_end))
    }

    /// When the point is nearer than `radius` to the square of half side `half`
    /// around the origin.
    pub fn inside_square(self, half: f64, radius: f64) -> Option<Inside> {
        let limit = radius * radius;
        let near = |at: Vector| at.map(|v| (v.abs() - half).max(0.0)).norm_squared() < limit;
        let (at_start, at_end) = (near(self.start), near(self.end));
        // A rounded square is the union of two rectangles and four discs.
        // It is convex, so the hull of the six intervals is the interval.
        let (start, way) = (self.start, self.way());
        let mut hull: Option<(f64, f64)> = None;
        let mut join = |part: Option<(f64, f64)>| {
            let part = part.filter(|(enter, leave)| *leave > 0.0 && *enter < 1.0);
            hull = match (hull, part) {
                (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
                (a, b) => a.or(b),
            };
        };
        let (thin, wide) = (half, half + radius);
        join(box_crossing(start, way, [wide, thin]));
        join(box_crossing(start, way, [thin, wide]));
        for (x, y) in [(-half, -half), (-half, half), (half, -half), (half, half)] {
            join(disc_crossing(start - Vector::new(x, y), way, limit));
        }
        match hull {
            Some(crossing) => Some(Inside::clamped(crossing, at_start, at_end)),
            // Rounding may lose an interval that an end lies in.
            None if at_start || at_end => Some(Inside::clamped((0.0, 1.0), at_start, at_end)),
            None => None,
        }
    }
}

impl Inside {
    /// Confines a crossing to the span and lets the ends decide over rounding.
    pub(crate) fn clamped((enter, leave): (f64, f64), at_start: bool, at_end: bool) -> Self {
        let enter = if at_start { 0.0 } else { enter.clamp(0.0, 1.0) };
        let leave = if at_end { 1.0 } else { leave.clamp(0.0, 1.0) };
        Self {
            enter,
            leave: leave.max(enter),
            at_start,
            at_end,
        }
    }
}

/// The open interval of s with |p + s·w|² < `limit`, if there is one.
pub(crate) fn disc_crossing(p: Vector, w: Vector, limit: f64) -> Option<(f64, f64)> {
    let (a, b, c) = (w.norm_squared(), p.dot(&w), p.norm_squared() - limit);
    let discriminant = b * b - a * c;
    // Written so that a point at rest, and NaN, have no crossing.
    if !(a > 0.0 && discriminant > 0.0) {
        return None;
    }
    let root = discriminant.sqrt();
    // The sum of equal signs loses no digits; the other root is c over it.
    let sum = if b >= 0.0 { -(b + root) } else { root - b };
    let (one, two) = (sum / a, c / sum);
    Some((one.min(two), one.max(two)))
}

/// The open interval of s with p + s·w inside a box around the origin.
fn box_crossing(p: Vector, w: Vector, half: [f64; 2]) -> Option<(f64, f64)> {
    let mut interval = (f64::NEG_INFINITY, f64::INFINITY);
    for (axis, half) in half.into_iter().enumerate() {
        let (p, w) = (p[axis], w[axis]);
        if w == 0.0 {
            if p.abs() >= half {
                return None;
            }
            continue;
        }
        let (one, two) = ((-half - p) / w, (half - p) / w);
        interval.0 = interval.0.max(one.min(two));
        interval.1 = interval.1.min(one.max(two));
    }
    (interval.0 < interval.1).then_some(interval)
}

#[cfg(test)]
mod tests {
    //! parry is the oracle: its distance of a segment to a shape says whether a
    //! swept disc meets the shape, its shape cast says when.

    use parry2d_f64::math;
    use parry2d_f64::query::{self, ShapeCastOptions};
    use parry2d_f64::shape::{Ball, Cuboid, Segment, Shape};
    use proptest::prelude::*;

    use super::*;

    fn relative() -> impl Strategy<Value = Relative> {
        let coordinate = prop_oneof![-2.0..2.0f64, (-4..=4i32).prop_map(|i| f64::from(i) * 0.5)];
        [
            coordinate.clone(),
            coordinate.clone(),
            coordinate.clone(),
            coordinate,
        ]
        .prop_map(|[x0, y0, x1, y1]| Relative {
            start: Vector::new(x0, y0),
            end: Vector::new(x1, y1),
        })
    }

    /// Compares with parry; `shape` sits at the origin and the disc moves.
    fn check(way: Relative, shape: &dyn Shape, radius: f64, found: Option<Inside>) {
        let [start, end] = [way.start, way.end].map(|at| math::Vector::new(at.x, at.y));
        let origin = math::Pose::IDENTITY;
        let moved = math::Pose::from_translation(start);
        let least = if start == end {
            query::distance(&origin, shape, &moved, &Ball::new(1e-12))
        } else {
            query::distance(&origin, shape, &origin, &Segment::new(start, end))
        };
        let least = least.expect("parry supports these shapes").distance;
        if (least - radius).abs() < 1e-6 {
            return; // Grazes are decided by rounding.
        }
        assert_eq!(least < radius, found.is_some(), "{way:?}: least {least}");
        let Some(inside) = found else { return };
        assert!(0.0 <= inside.enter && inside.enter <= inside.leave && inside.leave <= 1.0);
        assert!(!inside.at_start || inside.enter <= 0.0);
        assert!(!inside.at_end || inside.leave >= 1.0);
        let distance = |s: f64| {
            let at = math::Pose::from_translation(start + (end - start) * s);
            query::distance(&origin, shape, &at, &Ball::new(1e-12))
                .expect("supported")
                .distance
        };
        // At an end of the interval within the span the disc touches.
        for (crossing, open) in [
            (inside.enter, inside.at_start),
            (inside.leave, inside.at_end),
        ] {
            if !open {
                let there = distance(crossing);
                assert!(
                    (there - radius).abs() < 1e-6,
                    "{way:?}: {there} at {crossing}"
                );
            }
        }
        let ball = Ball::new(radius);
        let options = ShapeCastOptions::with_max_time_of_impact(1.0);
        let zero = math::Vector::new(0.0, 0.0);
        let hit = query::cast_shapes(&origin, zero, shape, &moved, end - start, &ball, options)
            .expect("supported");
        // parry stops its casts at some small distance from the shape.
        if let Some(hit) = hit {
            let gap = distance(hit.time_of_impact) - distance(inside.enter);
            assert!(gap.abs() < 1e-3, "{way:?}: {hit:?} {inside:?}");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn discs_agree_with_parry(way in relative(), radius in 0.05..1.0f64) {
            let (squared, fraction) = way.closest();
            let there = way.start + way.way() * fraction;
            prop_assert!((there.norm_squared() - squared).abs() < 1e-12);
            // A disc against a point is a point against a disc.
            check(way, &Ball::new(1e-9), radius, way.inside_disc(radius, squared));
        }

        #[test]
        fn squares_agree_with_parry(way in relative(), radius in 0.05..0.5f64) {
            let square = Cuboid::new(math::Vector::new(0.5, 0.5));
            check(way, &square, radius, way.inside_square(0.5, radius));
        }

        /// A contact that lasts at the end of a span lasts at the start of the next, and so on.
        #[test]
        fn spans_fit_together(way in relative(), radius in 0.05..1.0f64, s in 0.0..1.0f64) {
            let middle = way.start + way.way() * s;
            let (one, two) = (Relative { end: middle, ..way }, Relative { start: middle, ..way });
            let disc = |way: Relative| way.inside_disc(radius, way.closest().0);
            let square = |way: Relative| way.inside_square(0.5, radius.min(0.5));
            for (one, two) in [(disc(one), disc(two)), (square(one), square(two))] {
                let ends = one.is_some_and(|inside| inside.at_end);
                let starts = two.is_some_and(|inside| inside.at_start);
                prop_assert_eq!(ends, starts);
            }
        }
    }
}
