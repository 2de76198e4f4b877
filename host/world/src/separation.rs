//! Distance between two shapes, or depth of their overlap.
//!
//! Two convex shapes are apart exactly if some direction separates them, and for
//! polygons the normals of their edges are directions enough (the separating
//! axis theorem). If none separates, the least overlap over these normals is the
//! penetration depth: the shortest translation that parts the shapes. If one
//! does, the largest gap over them is a lower bound of the distance; it is the
//! distance itself unless two corners are what is nearest.
//!
//! Discs against polygons and against each other are computed exactly. Two
//! polygons of n and m vertices take n·m steps, and nothing is allocated.
//!
//! This is not parry's distance, which it agrees with in the tests: near touching, parry
//! finds neither a distance nor a depth at times, and contacts must not be lost. Vectors and
//! placements are nalgebra's, whose products are sums of two terms in the order of the axes:
//! the same bits on every machine.

use nalgebra::{Isometry2, Translation2, UnitComplex};

use crate::vector::{from_segment, least_along, length_and_direction, sides};
use crate::{Pose, Shape, Vector};

/// A pose whose heading has been turned into its cosine and sine, for callers
/// who test one body against many.
pub type Placement = Isometry2<f64>;

impl From<Pose> for Placement {
    fn from(pose: Pose) -> Self {
        let (cos, sin) = pose.rotation();
        let rotation = UnitComplex::from_cos_sin_unchecked(cos, sin);
        Self::from_parts(Translation2::new(pose.x, pose.y), rotation)
    }
}

/// Distance between two shapes in metres: above 0 if they are apart, and then no more than their
/// distance; 0 if they touch; the negative penetration depth if they overlap.
///
/// Exact but for rounding unless both are polygons whose corners are what is
/// nearest: then it is the largest gap along the normals of their edges. Takes
/// n·m steps for polygons of n and m vertices and allocates nothing.
pub fn separation_m(
    a: &Shape,
    at_a: impl Into<Placement>,
    b: &Shape,
    at_b: impl Into<Placement>,
) -> f64 {
    let (at_a, at_b) = (at_a.into(), at_b.into());
    separate(a, b, &at_a.inv_mul(&at_b)).0
}

/// The separation of `b`, placed in the frame of `a`, and a direction from a to b,
/// in the same frame and of length 1, along which they are that far apart.
pub(crate) fn separate(a: &Shape, b: &Shape, at_b: &Placement) -> (f64, Vector) {
    let position = at_b.translation.vector;
    match (a.is_disc(), b.is_disc()) {
        (true, true) => {
            let (distance, direction) = length_and_direction(position);
            let radii = a.effective_radius_m() + b.effective_radius_m();
            (distance - radii, direction)
        }
        (false, true) => {
            let (distance, direction) = from_point(a, position);
            (distance - b.effective_radius_m(), direction)
        }
        (true, false) => {
            let here = at_b.inverse_transform_vector(&-position);
            let (distance, direction) = from_point(b, here);
            let direction = -(at_b.rotation * direction);
            (distance - a.effective_radius_m(), direction)
        }
        (false, false) => between_polygons(a, b, at_b),
    }
}

/// Distances that may be nothing but roundings.
const ROUNDING_M: f64 = 1e-12;

/// The signed distance of a point from a polygon, below 0 inside, and the
/// direction in which it grows.
fn from_point(polygon: &Shape, point: Vector) -> (f64, Vector) {
    let mut inside = (f64::NEG_INFINITY, Vector::zeros());
    for edge in polygon.edges() {
        let above = edge.normal.dot(&point) - edge.offset;
        if above > inside.0 {
            inside = (above, edge.normal);
        }
    }
    if inside.0 <= 0.0 {
        return inside;
    }
    let mut nearest = (f64::INFINITY, Vector::zeros());
    for (a, b) in sides(polygon.vertices()) {
        let from = from_segment(a, b, point);
        let squared = from.norm_squared();
        if squared < nearest.0 {
            nearest = (squared, from);
        }
    }
    let (distance, direction) = length_and_direction(nearest.1);
    if distance > inside.0.max(ROUNDING_M) {
        (distance, direction)
    } else {
        // Nearest is the inside of an edge, whose normal has fewer roundings, or the point is on the
        // edge, and the way to it has no direction.
        inside
    }
}

fn between_polygons(a: &Shape, b: &Shape, at_b: &Placement) -> (f64, Vector) {
    let mut most = (f64::NEG_INFINITY, Vector::zeros());
    each_axis(a, b, at_b, |gap, direction| {
        if gap > most.0 {
            most = (gap, direction);
        }
    });
    most
}

/// The gap between two polygons along every normal that may separate them, and
/// the direction of the gap from a to b, in the frame of `a`.
pub(crate) fn each_axis(
    a: &Shape,
    b: &Shape,
    at_b: &Placement,
    mut visit: impl FnMut(f64, Vector),
) {
    let position = at_b.translation.vector;
    for edge in a.edges() {
        let seen = at_b.inverse_transform_vector(&edge.normal);
        let gap = edge.normal.dot(&position) + least_along(b.vertices(), seen) - edge.offset;
        visit(gap, edge.normal);
    }
    for edge in b.edges() {
        let normal = at_b.rotation * edge.normal;
        let gap = least_along(a.vertices(), normal) - normal.dot(&position);
        visit(gap - edge.offset, -normal);
    }
}

/// The distance of two shapes in metres; 0 if they touch or overlap.
///
/// Exact but for rounding. Costs more than [`separation_m`].
pub fn distance_m(
    a: &Shape,
    at_a: impl Into<Placement>,
    b: &Shape,
    at_b: impl Into<Placement>,
) -> f64 {
    let seen = at_a.into().inv_mul(&at_b.into());
    let (separation, _) = separate(a, b, &seen);
    if separation <= 0.0 || a.is_disc() || b.is_disc() {
        return separation.max(0.0);
    }
    // The least distance of convex polygons that are apart is one of a corner of
    // one from a side of the other.
    let mut least = f64::INFINITY;
    for (from, to) in sides(b.vertices()) {
        let [from, to] = [from, to].map(|corner| seen.transform_point(&corner.into()).coords);
        for (start, end) in sides(a.vertices()) {
            for away in [
                from_segment(from, to, start),
                from_segment(start, end, from),
            ] {
                least = least.min(away.norm_squared());
            }
        }
    }
    least.sqrt().max(separation)
}

#[cfg(test)]
mod tests {
    //! parry is the oracle.

    use parry2d_f64::query;
    use proptest::prelude::*;

    use super::*;
    use crate::sweep::tests::{any_pose, any_shape, convex, in_parry, placed};

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(4000))]

        #[test]
        fn separations_agree_with_parry(
            a in any_shape(), at_a in any_pose(), b in any_shape(), at_b in any_pose(),
        ) {
            let separation = separation_m(&a, at_a, &b, at_b);
            let distance = distance_m(&a, at_a, &b, at_b);
            let (one, two) = (in_parry(&a), in_parry(&b));
            let expected = query::distance(&placed(at_a), &*one, &placed(at_b), &*two)
                .unwrap()
                .distance;
            prop_assert!((distance - expected).abs() < 1e-6, "{} {}", distance, expected);
            prop_assert!(separation <= distance + 1e-12);
            prop_assert_eq!(separation > 0.0, distance > 0.0);
            // Translation by a little more than the depth parts them, by less does not.
            let seen = Placement::from(at_a).inv_mul(&at_b.into());
            let (depth, direction) = separate(&a, &b, &seen);
            prop_assert!((depth - separation).abs() < 1e-12);
            if depth < 0.0 {
                let away = Placement::from(at_a).rotation * direction;
                for (factor, parted) in [(1.0 + 1e-6, true), (1.0 - 1e-6, false)] {
                    let way = -depth * factor;
                    let moved = Pose { x: at_b.x + way * away.x, y: at_b.y + way * away.y, ..at_b };
                    let after = separation_m(&a, at_a, &b, moved);
                    prop_assert!(after > -1e-9 || !parted);
                    prop_assert!(after < 1e-9 || parted);
                }
            }
        }

        /// From either side and in any frame it is the same.
        #[test]
        fn separations_are_symmetric(
            a in any_shape(), at_a in any_pose(), b in any_shape(), at_b in any_pose(),
        ) {
            let one = separation_m(&a, at_a, &b, at_b);
            let two = separation_m(&b, at_b, &a, at_a);
            prop_assert!((one - two).abs() < 1e-12);
        }
    }

    #[test]
    fn touching_is_neither_apart_nor_overlap() {
        let square = convex(&[[1.0, 1.0], [-1.0, 1.0], [-1.0, -1.0], [1.0, -1.0]]);
        let disc = Shape::disc(0.5);
        for (a, b, at, expected) in [
            (&square, &square, Pose::at(2.0, 0.5), 0.0),
            (&square, &square, Pose::at(2.0, 2.0), 0.0),
            (&square, &square, Pose::at(0.0, 0.0), -2.0),
            (&square, &square, Pose::at(1.5, 0.0), -0.5),
            (&square, &disc, Pose::at(1.5, 0.0), 0.0),
            (&square, &disc, Pose::at(0.25, 0.0), -1.25),
            (&disc, &square, Pose::at(0.0, -2.0), 0.5),
            (&disc, &disc, Pose::at(1.0, 0.0), 0.0),
            (&disc, &disc, Pose::at(0.0, 0.0), -1.0),
        ] {
            let found = separation_m(a, Pose::default(), b, at);
            assert!((found - expected).abs() < 1e-15, "{found} {expected}");
        }
        // Corner to corner: the bound is less than the distance.
        let at = Pose::at(5.0, 6.0);
        assert_eq!(
            separation_m(&square, Pose::default(), &square, at).total_cmp(&4.0),
            std::cmp::Ordering::Equal
        );
        assert!((distance_m(&square, Pose::default(), &square, at) - 5.0).abs() < 1e-12);
    }
}
