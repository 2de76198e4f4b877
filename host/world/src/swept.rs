//! Swept areas: tells if those of two bodies meet, whatever the times.
//!
//! A body that does not turn sweeps over the convex hull of its two ends (a disc
//! over a capsule). The points of one that turns by Δθ leave the straight lines
//! between their ends by at most r·Δθ²/8, r being the effective radius, since no
//! point is accelerated by more than r·Δθ². So the hull of its ends, thickened
//! by that much, contains the area; motions are halved until that says no, or is
//! thin enough to say yes.

use crate::vector::{from_segment, least_along, sides};
use crate::{Placement, Pose, Shape, Vector};

/// A yes for bodies that turn may mean a gap of up to this part of the sum of
/// their effective radii.
pub const SWEPT_SLACK: f64 = 1e-3;

/// A body that turns by more than this, in radians, is taken for the disc of its
/// effective radius, which it has covered several times.
const MOST_TURN: f64 = 8.0 * std::f64::consts::PI;

/// True if the areas that two bodies sweep over come nearer to each other than `margin_m`, each
/// moving from one pose to another, x, y and heading uniformly, at whatever times.
///
/// Touching is not meeting; a negative margin lets areas overlap by as much. The
/// answer is exact but for rounding if neither turns. Otherwise it is never a
/// wrong no, and a yes may mean a gap of at most [`SWEPT_SLACK`].
pub fn swept_shapes_meet(
    a: &Shape,
    (from_a, to_a): (Pose, Pose),
    b: &Shape,
    (from_b, to_b): (Pose, Pose),
    margin_m: f64,
) -> bool {
    let way = |from: Pose, to: Pose| [from.position(), to.position()];
    let squared = squared_distance(way(from_a, to_a), way(from_b, to_b));
    let below = |reach: f64| reach > 0.0 && squared < reach * reach;
    if !below(a.effective_radius_m() + b.effective_radius_m() + margin_m) {
        return false;
    }
    if below(a.inner_radius_m() + b.inner_radius_m() + margin_m) {
        return true;
    }
    let slack = SWEPT_SLACK * (a.effective_radius_m() + b.effective_radius_m());
    let (one, two) = (Leg::new(a, from_a, to_a), Leg::new(b, from_b, to_b));
    meet(&one, &one.hull(), &two, &two.hull(), margin_m, slack)
}

/// A piece of a body's motion.
#[derive(Clone, Copy)]
struct Leg<'a> {
    shape: &'a Shape,
    from: Pose,
    to: Pose,
    /// Taken for a disc.
    is_disc: bool,
}

impl<'a> Leg<'a> {
    fn new(shape: &'a Shape, from: Pose, to: Pose) -> Self {
        let turn = (to.heading - from.heading).abs();
        Self {
            shape,
            from,
            to,
            is_disc: shape.is_disc() || turn > MOST_TURN,
        }
    }

    /// Distance by which points leave the hull of the ends.
    fn bulge(&self) -> f64 {
        if self.is_disc {
            return 0.0;
        }
        let turn = self.to.heading - self.from.heading;
        0.125 * self.shape.effective_radius_m() * turn * turn
    }

    fn halves(self) -> [Self; 2] {
        let middle = self.from.toward(self.to, 0.5);
        [
            Self { to: middle, ..self },
            Self {
                from: middle,
                ..self
            },
        ]
    }

    fn hull(&self) -> Hull {
        if self.is_disc {
            return Hull {
                corners: convex_hull(vec![self.from.position(), self.to.position()]),
                radius: self.shape.effective_radius_m(),
            };
        }
        let ends = [self.from, self.to].map(Placement::from);
        let corners = ends.iter().flat_map(|end| {
            let vertices = self.shape.vertices().iter();
            vertices.map(|vertex| end.transform_point(&(*vertex).into()).coords)
        });
        Hull {
            corners: convex_hull(corners.collect()),
            radius: 0.0,
        }
    }
}

fn meet(a: &Leg<'_>, hull_a: &Hull, b: &Leg<'_>, hull_b: &Hull, margin: f64, slack: f64) -> bool {
    let (bulge_a, bulge_b) = (a.bulge(), b.bulge());
    let limit = margin + bulge_a + bulge_b;
    if hull_a.gap(hull_b, limit) >= limit {
        return false;
    }
    if bulge_a + bulge_b <= slack {
        return true;
    }
    if bulge_a >= bulge_b {
        let mut halves = a.halves().into_iter();
        halves.any(|half| meet(&half, &half.hull(), b, hull_b, margin, slack))
    } else {
        let mut halves = b.halves().into_iter();
        halves.any(|half| meet(a, hull_a, &half, &half.hull(), margin, slack))
    }
}

/// A point, a segment or a convex polygon, thickened by a radius.
struct Hull {
    /// Counter-clockwise.
    corners: Vec<Vector>,
    radius: f64,
}

impl Hull {
    /// The distance of two, or a negative depth if they overlap. From `limit` on
    /// it may be less than the distance.
    fn gap(&self, other: &Self, limit: f64) -> f64 {
        let radii = self.radius + other.radius;
        let (ours, theirs) = (&self.corners, &other.corners);
        if ours.len() > 2 && theirs.len() > 2 {
            let along = along_normals(ours, theirs).max(along_normals(theirs, ours));
            if along <= 0.0 || along - radii >= limit {
                return along - radii;
            }
        } else if contains(ours, theirs[0]) || contains(theirs, ours[0]) {
            return -radii;
        }
        let mut squared = f64::INFINITY;
        for (a, b) in sides(ours) {
            for (c, d) in sides(theirs) {
                squared = squared.min(squared_distance([a, b], [c, d]));
            }
        }
        squared.sqrt() - radii
    }
}

/// The largest gap along the normals of the first's sides.
fn along_normals(polygon: &[Vector], other: &[Vector]) -> f64 {
    let mut most = f64::NEG_INFINITY;
    for (a, b) in sides(polygon) {
        let normal = Vector::new(b.y - a.y, a.x - b.x);
        let normal = normal / normal.norm();
        most = most.max(least_along(other, normal) - normal.dot(&a));
    }
    most
}

fn contains(polygon: &[Vector], point: Vector) -> bool {
    polygon.len() > 2 && sides(polygon).all(|(a, b)| cross(a, b, point) >= 0.0)
}

/// Twice the area of a triangle, above 0 if its corners go counter-clockwise.
fn cross(a: Vector, b: Vector, c: Vector) -> f64 {
    (b - a).perp(&(c - a))
}

/// The squared distance of two segments, which may be points; 0 if they cross.
pub fn squared_distance(one: [Vector; 2], two: [Vector; 2]) -> f64 {
    let sides = |[a, b]: [Vector; 2], [c, d]: [Vector; 2]| {
        let (one, other) = (cross(a, b, c), cross(a, b, d));
        (one > 0.0 && other < 0.0) || (one < 0.0 && other > 0.0)
    };
    if sides(one, two) && sides(two, one) {
        return 0.0;
    }
    let from = |[a, b]: [Vector; 2], point| from_segment(a, b, point).norm_squared();
    from(one, two[0])
        .min(from(one, two[1]))
        .min(from(two, one[0]))
        .min(from(two, one[1]))
}

/// The convex hull, counter-clockwise (A. M. Andrew, 1979).
fn convex_hull(mut points: Vec<Vector>) -> Vec<Vector> {
    let order = |a: &Vector, b: &Vector| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y));
    points.sort_by(order);
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let mut hull: Vec<Vector> = Vec::with_capacity(points.len() + 1);
    // Below from left to right, and above back again.
    let (forth, back) = (points.iter(), points.iter().rev().skip(1));
    let mut kept = 1;
    for (at, point) in forth.chain(back).enumerate() {
        if at == points.len() {
            kept = hull.len();
        }
        while hull.len() > kept && cross(hull[hull.len() - 2], hull[hull.len() - 1], *point) <= 0.0
        {
            hull.pop();
        }
        hull.push(*point);
    }
    hull.pop();
    hull
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::distance_m;
    use crate::sweep::tests::{any_pose, any_shape, rectangle};

    type Way = (Pose, Pose);

    /// The least distance over samples of both motions.
    fn sampled(a: &Shape, way_a: Way, b: &Shape, way_b: Way, samples: u32) -> f64 {
        let at = |way: Way, sample: u32| {
            let pose = way.0.toward(way.1, f64::from(sample) / f64::from(samples));
            Placement::from(pose)
        };
        let mut least = f64::INFINITY;
        for one in 0..=samples {
            let place = at(way_a, one);
            for two in 0..=samples {
                least = least.min(distance_m(a, place, b, at(way_b, two)));
            }
        }
        least
    }

    /// No point moves farther than this between two samples.
    fn stride(shape: &Shape, (from, to): Way, samples: u32) -> f64 {
        let (x, y) = (to.x - from.x, to.y - from.y);
        let turn = (to.heading - from.heading).abs() * shape.effective_radius_m();
        ((x * x + y * y).sqrt() + turn) / f64::from(samples)
    }

    fn check(a: &Shape, way_a: Way, b: &Shape, way_b: Way, margin: f64) {
        let samples = 24;
        let found = swept_shapes_meet(a, way_a, b, way_b, margin);
        assert_eq!(found, swept_shapes_meet(b, way_b, a, way_a, margin));
        let least = sampled(a, way_a, b, way_b, samples);
        if least < margin - 1e-9 {
            assert!(found, "a wrong no at {least} m");
        }
        let between = 0.5 * (stride(a, way_a, samples) + stride(b, way_b, samples));
        let slack = SWEPT_SLACK * (a.effective_radius_m() + b.effective_radius_m());
        if least - between > margin + slack + 1e-9 {
            assert!(!found, "a wrong yes at {least} m");
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(600))]

        #[test]
        fn swept_areas_agree_with_samples(
            a in any_shape(), way_a in (any_pose(), any_pose()),
            b in any_shape(), way_b in (any_pose(), any_pose()),
            far in 0.0..3.0f64,
            margin in prop_oneof![Just(0.0), 0.0..0.3f64],
            turns in any::<bool>(),
        ) {
            let away = |pose: Pose| Pose { x: pose.x + far, y: pose.y + far, ..pose };
            let way_b = (away(way_b.0), away(way_b.1));
            let straight = |(from, to): Way| {
                (from, Pose { heading: if turns { to.heading } else { from.heading }, ..to })
            };
            check(&a, straight(way_a), &b, straight(way_b), margin);
        }
    }

    #[test]
    fn known_areas() {
        let (square, disc) = (rectangle(1.0, 1.0), Shape::disc(0.5));
        let (long, tall, small) = (rectangle(10.0, 1.0), rectangle(1.0, 30.0), Shape::disc(0.1));
        let way = |x0: f64, y0: f64, x1: f64, y1: f64| (Pose::at(x0, y0), Pose::at(x1, y1));
        let rest = |x: f64, y: f64| way(x, y, x, y);
        let turn = |x: f64, angle: f64| (Pose::at(x, 0.0), Pose::new(x, 0.0, angle));
        let eighth = std::f64::consts::FRAC_PI_4;
        let cases = [
            // Side by side they touch; following and crossing they meet.
            (
                &disc,
                way(0.0, 0.0, 5.0, 0.0),
                &disc,
                way(0.0, 1.0, 5.0, 1.0),
                0.0,
                false,
            ),
            (
                &disc,
                way(0.0, 0.0, 5.0, 0.0),
                &disc,
                way(0.0, 1.0, 5.0, 1.0),
                1e-9,
                true,
            ),
            (
                &disc,
                way(0.0, 0.0, 1.0, 0.0),
                &disc,
                way(1.0, 0.0, 2.0, 0.0),
                0.0,
                true,
            ),
            (
                &disc,
                way(0.0, 0.0, 4.0, 4.0),
                &disc,
                way(0.0, 4.0, 4.0, 0.0),
                0.0,
                true,
            ),
            (
                &square,
                way(0.0, 0.0, 5.0, 0.0),
                &square,
                way(0.0, 1.0, 5.0, 1.0),
                0.0,
                false,
            ),
            (
                &square,
                way(0.0, 0.0, 5.0, 0.0),
                &square,
                way(0.0, 1.0, 5.0, 1.0),
                -1e-6,
                false,
            ),
            (
                &square,
                way(0.0, 0.0, 5.0, 0.0),
                &square,
                way(0.0, 0.9, 5.0, 0.9),
                -1e-6,
                true,
            ),
            (
                &square,
                way(0.0, 0.0, 5.0, 0.0),
                &square,
                way(0.0, 0.9, 5.0, 0.9),
                -0.11,
                false,
            ),
            // A diagonal passes the corner of a square at a distance of √2/2 m.
            (
                &square,
                rest(0.0, 0.0),
                &disc,
                way(-1.0, 3.0, 3.0, -1.0),
                0.2,
                false,
            ),
            (
                &square,
                rest(0.0, 0.0),
                &disc,
                way(-1.0, 3.0, 3.0, -1.0),
                0.21,
                true,
            ),
            (
                &square,
                rest(0.0, 0.0),
                &disc,
                way(-1.0, 2.0, 2.0, -1.0),
                0.0,
                true,
            ),
            // A small disc far from the middle of what a long body sweeps, all of its way inside or none,
            // and the other way round.
            (
                &long,
                way(0.0, 0.0, 0.0, 20.0),
                &small,
                rest(4.0, 10.0),
                0.0,
                true,
            ),
            (
                &long,
                way(0.0, 0.0, 0.0, 20.0),
                &small,
                way(3.0, 9.0, 4.5, 12.0),
                0.0,
                true,
            ),
            (
                &long,
                way(0.0, 0.0, 0.0, 20.0),
                &small,
                rest(5.2, 10.0),
                0.0,
                false,
            ),
            (
                &small,
                rest(4.0, 10.0),
                &tall,
                way(0.0, 0.0, 8.0, 0.0),
                0.0,
                true,
            ),
            // A square that turns needs √2 − 1 m more than one that does not.
            (&square, rest(0.0, 0.0), &square, rest(1.1, 0.0), 0.0, false),
            (
                &square,
                turn(0.0, eighth),
                &square,
                rest(1.1, 0.0),
                0.0,
                true,
            ),
            (
                &square,
                turn(0.0, eighth),
                &square,
                rest(1.21, 0.0),
                0.0,
                false,
            ),
            (
                &square,
                turn(0.0, eighth),
                &square,
                turn(1.41, eighth),
                0.0,
                true,
            ),
            (
                &square,
                turn(0.0, 1e9),
                &square,
                turn(1.42, -1e9),
                0.0,
                false,
            ),
            (
                &square,
                turn(0.0, 1e9),
                &square,
                turn(1.41, -1e9),
                0.0,
                true,
            ),
        ];
        for (at, (a, way_a, b, way_b, margin, expected)) in cases.into_iter().enumerate() {
            assert_eq!(
                swept_shapes_meet(a, way_a, b, way_b, margin),
                expected,
                "case {at}"
            );
            assert_eq!(
                swept_shapes_meet(b, way_b, a, way_a, margin),
                expected,
                "case {at}"
            );
        }
    }
}
