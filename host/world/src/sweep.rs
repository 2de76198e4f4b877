//! Shapes in motion: when two of them overlap within a span of time, and
//! whether what they sweep over meets.
//!
//! Within a span the x, y and heading of a body change uniformly. The times of
//! contacts come in closed form wherever neither body turns (turning discs do
//! not matter). Otherwise they are found by conservative advancement: the
//! separation of two bodies shrinks and grows no faster than their points move,
//! |Δp| + r_a·|Δθ_a| + r_b·|Δθ_b| per span with r the effective radius (0 for a
//! disc), so that it stays on its side of the tolerance for a while that can be
//! told from its value. Apart, the motion along the direction of the separation
//! is what counts (B. Mirtich, "Impulse-based dynamic simulation of rigid body
//! systems", 1996, section 2.3). The steps end at [`RESOLUTION_M`].
//!
//! One expression of the poses at the ends of a span decides whether bodies overlap
//! there, so that a contact that lasts over several spans neither flickers nor
//! vanishes between them.

use crate::geometry::disc_crossing;
use crate::separation::{each_axis, separate, separation_m};
use crate::vector::sides;
use crate::{Inside, Placement, Pose, Relative, Shape, Vector};

/// Accuracy where a body turns: an overlap that is never deeper than the tolerance plus this may be
/// missed, and so may a gap of this size: a micrometre.
///
/// In a span on which a point of a body moves by more than a metre, it is a
/// millionth of the way.
pub const RESOLUTION_M: f64 = 1e-6;

/// The most steps of a span.
const MOST_STEPS: f64 = (1 << 20) as f64;

/// Number of moments of a span that are told apart.
const MOST_MOMENTS: f64 = (1u64 << 36) as f64;

/// Appends when two bodies overlap by more than `tolerance_m` in a span in which
/// they move from one pose to the other, in order of time.
///
/// If neither turns there is at most one such interval, found in time n·m for
/// polygons of n and m vertices, or constant time for discs. Otherwise it takes
/// some tens of steps per contact and close approach, each of time n·m and four
/// cosines and sines.
#[expect(
    clippy::too_many_arguments,
    reason = "two moving bodies and what to find"
)]
pub fn contacts_in_span(
    a: &Shape,
    from_a: Pose,
    to_a: Pose,
    b: &Shape,
    from_b: Pose,
    to_b: Pose,
    tolerance_m: f64,
    out: &mut Vec<Inside>,
) {
    let way = Relative::between([from_a, to_a], [from_b, to_b]);
    let reach = a.effective_radius_m() + b.effective_radius_m();
    let (squared, _) = way.closest();
    if a.is_disc() && b.is_disc() {
        out.extend(way.inside_disc((reach - tolerance_m).max(0.0), squared));
        return;
    }
    // With some slack, so that rounding never decides otherwise than at the ends.
    if squared > reach * reach * (1.0 + 1e-9) {
        return;
    }
    let span = Span {
        a,
        b,
        from_a,
        to_a,
        from_b,
        to_b,
        tolerance_m,
    };
    let overlap = |at_a: Pose, at_b: Pose| separation_m(a, at_a, b, at_b) < -tolerance_m;
    let (at_start, at_end) = (overlap(from_a, from_b), overlap(to_a, to_b));
    if span.turning_m() > 0.0 {
        span.advance(at_start, at_end, out);
        return;
    }
    match span.crossing(way) {
        // Inside all the time and outside at both ends is rounding.
        Some((enter, leave))
            if at_start || at_end || (leave > 0.0 && enter < 1.0 && leave - enter < 1.0) =>
        {
            out.push(Inside::clamped((enter, leave), at_start, at_end));
        }
        // Rounding may lose an interval that an end lies in.
        _ if at_start || at_end => out.push(Inside::clamped((0.0, 1.0), at_start, at_end)),
        _ => {}
    }
}

/// Two bodies in a span.
struct Span<'a> {
    a: &'a Shape,
    b: &'a Shape,
    from_a: Pose,
    to_a: Pose,
    from_b: Pose,
    to_b: Pose,
    tolerance_m: f64,
}

/// Distance by which the farthest point of a shape moves because the shape turns.
fn turning_m(shape: &Shape, from: Pose, to: Pose) -> f64 {
    if shape.is_disc() {
        0.0
    } else {
        shape.effective_radius_m() * (to.heading - from.heading).abs()
    }
}

impl Span<'_> {
    fn turning_m(&self) -> f64 {
        turning_m(self.a, self.from_a, self.to_a) + turning_m(self.b, self.from_b, self.to_b)
    }

    /// The poses at a fraction of the span.
    fn at(&self, fraction: f64) -> (Placement, Placement) {
        (
            self.from_a.toward(self.to_a, fraction).into(),
            self.from_b.toward(self.to_b, fraction).into(),
        )
    }

    /// Difference of the separation and that of a contact, and its direction in the world.
    fn clearance(&self, fraction: f64) -> (f64, Vector) {
        let (at_a, at_b) = self.at(fraction);
        let (separation, direction) = separate(self.a, self.b, &at_a.inv_mul(&at_b));
        (separation + self.tolerance_m, at_a.rotation * direction)
    }

    /// When bodies that do not turn overlap, as fractions that may be beyond
    /// the span.
    fn crossing(&self, way: Relative) -> Option<(f64, f64)> {
        let (at_a, at_b): (Placement, Placement) = (self.from_a.into(), self.from_b.into());
        // The disc's centre in the frame of the polygon.
        let (polygon, frame, sign, disc) = match (self.a.is_disc(), self.b.is_disc()) {
            (false, false) => return self.clip(&at_a, &at_b, way),
            (false, true) => (self.a, at_a, 1.0, self.b),
            _ => (self.b, at_b, -1.0, self.a),
        };
        let seen = |at: Vector| frame.inverse_transform_vector(&(at * sign));
        let seen = Relative {
            start: seen(way.start),
            end: seen(way.end),
        };
        seen.near_convex(polygon, disc.effective_radius_m() - self.tolerance_m)
    }

    /// When the gaps along all axes of two polygons are overlaps. They change
    /// uniformly, since the axes do not turn.
    fn clip(&self, at_a: &Placement, at_b: &Placement, way: Relative) -> Option<(f64, f64)> {
        let moved = at_a.inverse_transform_vector(&way.way());
        let mut interval = (f64::NEG_INFINITY, f64::INFINITY);
        each_axis(self.a, self.b, &at_a.inv_mul(at_b), |gap, axis| {
            below(gap + self.tolerance_m, axis.dot(&moved), &mut interval);
        });
        (interval.0 < interval.1).then_some(interval)
    }

    /// Goes through the span in steps on which the answer cannot change.
    fn advance(&self, at_start: bool, at_end: bool, out: &mut Vec<Inside>) {
        let turning = self.turning_m();
        let moved = |from: Pose, to: Pose| to.position() - from.position();
        let velocity = moved(self.from_b, self.to_b) - moved(self.from_a, self.to_a);
        // More than 0, since something turns.
        let speed = velocity.norm() + turning;
        let least_step = (RESOLUTION_M / speed).max(1.0 / MOST_STEPS);
        let (mut inside, mut enter, mut s) = (at_start, 0.0, 0.0);
        while s < 1.0 {
            let (clearance, direction) = self.clearance(s);
            let step = if inside {
                -clearance / speed
            } else {
                // How fast the gap in this direction may close.
                let closing = turning - direction.dot(&velocity);
                if closing > 0.0 {
                    clearance / closing
                } else {
                    1.0
                }
            };
            let next = s + step.max(least_step);
            let next_inside = if next < 1.0 {
                self.clearance(next).0 < 0.0
            } else {
                at_end
            };
            if next_inside != inside {
                let crossing = self.bisect(s, next.min(1.0), inside, speed);
                if inside {
                    let at_start = at_start && enter <= 0.0;
                    out.push(Inside {
                        enter,
                        leave: crossing,
                        at_start,
                        at_end: false,
                    });
                }
                (inside, enter) = (next_inside, crossing);
            }
            s = next;
        }
        if inside {
            out.push(Inside {
                enter,
                leave: 1.0,
                at_start: at_start && enter <= 0.0,
                at_end: true,
            });
        }
    }

    /// Fraction at which an overlap begins or ends, between two fractions.
    fn bisect(&self, mut from: f64, mut to: f64, inside: bool, speed: f64) -> f64 {
        // To a tenth of a nanometre, or 2⁻³⁶ of a span that is long.
        let enough = (1e-4 * RESOLUTION_M / speed).max(1.0 / MOST_MOMENTS);
        while to - from > enough {
            let middle = from + 0.5 * (to - from);
            if middle <= from || middle >= to {
                break;
            }
            if (self.clearance(middle).0 < 0.0) == inside {
                from = middle;
            } else {
                to = middle;
            }
        }
        to
    }
}

/// Cuts an interval to where `value + s · slope` is below 0.
fn below(value: f64, slope: f64, interval: &mut (f64, f64)) {
    if slope > 0.0 {
        interval.1 = interval.1.min(-value / slope);
    } else if slope < 0.0 {
        interval.0 = interval.0.max(-value / slope);
    } else if value >= 0.0 {
        *interval = (f64::INFINITY, f64::NEG_INFINITY);
    }
}

impl Relative {
    /// When the point is nearer to a convex polygon than `radius`, or deeper in
    /// it than that if it is negative; fractions may be beyond the span.
    fn near_convex(self, polygon: &Shape, radius: f64) -> Option<(f64, f64)> {
        let (start, way) = (self.start, self.way());
        // The polygon itself, smaller if the radius is negative.
        let mut within = (f64::NEG_INFINITY, f64::INFINITY);
        let inset = radius.min(0.0);
        for edge in polygon.edges() {
            let above = edge.normal.dot(&start) - edge.offset - inset;
            below(above, edge.normal.dot(&way), &mut within);
        }
        let mut hull = (within.0 < within.1).then_some(within);
        if radius <= 0.0 {
            return hull;
        }
        // And around it a rectangle over every side and a disc around every
        // corner. The whole is convex, so the hull of the intervals is the interval.
        let mut join = |part: (f64, f64)| {
            hull = Some(hull.map_or(part, |all| (all.0.min(part.0), all.1.max(part.1))));
        };
        for (edge, (a, b)) in polygon.edges().iter().zip(sides(polygon.vertices())) {
            let normal = edge.normal;
            let mut over = (f64::NEG_INFINITY, f64::INFINITY);
            let above = normal.dot(&start) - edge.offset;
            let climb = normal.dot(&way);
            below(above - radius, climb, &mut over);
            below(-above, -climb, &mut over);
            // Along the side, which is the normal turned to the left.
            let side = Vector::new(-normal.y, normal.x);
            let along = side.dot(&way);
            below(side.dot(&(start - b)), along, &mut over);
            below(-side.dot(&(start - a)), -along, &mut over);
            if over.0 < over.1 {
                join(over);
            }
            if let Some(corner) = disc_crossing(start - a, way, radius * radius) {
                join(corner);
            }
        }
        hull
    }
}

#[cfg(test)]
pub(crate) mod tests {
    //! parry is the oracle: its signed distance along a span says who is inside.

    use parry2d_f64::math;
    use parry2d_f64::query;
    use parry2d_f64::shape::{Ball, ConvexPolygon, Shape as ParryShape};
    use proptest::prelude::*;

    use super::*;
    use crate::Footprint;
    use crate::vector::least_along;

    pub(crate) fn convex(vertices: &[[f64; 2]]) -> Shape {
        let vertices_m = vertices.to_vec();
        Footprint::Polygon { vertices_m }.shape().unwrap()
    }

    pub(crate) fn rectangle(length_m: f64, width_m: f64) -> Shape {
        Footprint::Rectangle { length_m, width_m }.shape().unwrap()
    }

    pub(crate) fn any_shape() -> impl Strategy<Value = Shape> {
        // Corners on an ellipse make a convex polygon.
        let corners = proptest::collection::vec(0.0..std::f64::consts::TAU, 3..9);
        let polygon = (corners, 0.1..1.0f64, 0.1..1.0f64).prop_filter_map(
            "has an area",
            |(mut angles, x, y)| {
                angles.sort_by(f64::total_cmp);
                let corners = angles.iter();
                let corners = corners.map(|at| [x * libm::cos(*at), y * libm::sin(*at)]);
                let vertices_m = corners.collect();
                let shape = Footprint::Polygon { vertices_m }.shape().ok()?;
                // Parry has no answers for slivers.
                (shape.edges().iter().all(|edge| {
                    let other = least_along(shape.vertices(), edge.normal);
                    edge.offset - other > 0.02
                }) && sides(shape.vertices()).all(|(a, b)| (a - b).abs().sum() > 0.02))
                .then_some(shape)
            },
        );
        prop_oneof![
            (0.05..1.0f64).prop_map(Shape::disc),
            (0.1..2.0f64, 0.1..2.0f64).prop_map(|(length, width)| rectangle(length, width)),
            polygon,
        ]
    }

    pub(crate) fn any_pose() -> impl Strategy<Value = Pose> {
        let coordinate = || prop_oneof![-2.0..2.0f64, (-4..=4i32).prop_map(|i| f64::from(i) * 0.5)];
        let heading = prop_oneof![
            -7.0..7.0f64,
            (-4..=4i32).prop_map(|i| f64::from(i) * std::f64::consts::FRAC_PI_2),
        ];
        (coordinate(), coordinate(), heading).prop_map(|(x, y, heading)| Pose::new(x, y, heading))
    }

    pub(crate) fn in_parry(shape: &Shape) -> Box<dyn ParryShape> {
        if shape.is_disc() {
            return Box::new(Ball::new(shape.effective_radius_m()));
        }
        let corners = shape
            .vertices()
            .iter()
            .map(|at| math::Vector::new(at.x, at.y));
        Box::new(ConvexPolygon::from_convex_polyline(corners.collect()).unwrap())
    }

    pub(crate) fn placed(pose: Pose) -> math::Pose {
        math::Pose::new(math::Vector::new(pose.x, pose.y), pose.heading)
    }

    fn signed_distance(a: &Shape, at_a: Pose, b: &Shape, at_b: Pose) -> f64 {
        let (one, two) = (in_parry(a), in_parry(b));
        let (at_a, at_b) = (placed(at_a), placed(at_b));
        // Close to touching, parry finds no contact at times.
        match query::contact(&at_a, &*one, &at_b, &*two, 0.0).unwrap() {
            Some(contact) => contact.dist,
            None => {
                query::distance(&at_a, &*one, &at_b, &*two)
                    .unwrap()
                    .distance
            }
        }
    }

    fn check(a: &Shape, way_a: (Pose, Pose), b: &Shape, way_b: (Pose, Pose), tolerance_m: f64) {
        let mut found = Vec::new();
        contacts_in_span(
            a,
            way_a.0,
            way_a.1,
            b,
            way_b.0,
            way_b.1,
            tolerance_m,
            &mut found,
        );
        let over = |s: f64| {
            let (at_a, at_b) = (way_a.0.toward(way_a.1, s), way_b.0.toward(way_b.1, s));
            signed_distance(a, at_a, b, at_b) + tolerance_m
        };
        for (at, inside) in found.iter().enumerate() {
            assert!(0.0 <= inside.enter && inside.enter <= inside.leave && inside.leave <= 1.0);
            assert!(!inside.at_start || (at == 0 && inside.enter <= 0.0));
            assert!(!inside.at_end || (at + 1 == found.len() && inside.leave >= 1.0));
            assert!(at == 0 || found[at - 1].leave <= inside.enter);
            // At an end within the span they touch.
            for (s, open) in [
                (inside.enter, inside.at_start),
                (inside.leave, inside.at_end),
            ] {
                assert!(
                    open || over(s).abs() < 1e-6,
                    "{} at {s}, {inside:?}",
                    over(s)
                );
            }
        }
        let samples = 64;
        for sample in 0..=samples {
            let s = f64::from(sample) / f64::from(samples);
            let over = over(s);
            if over.abs() > 2.0 * RESOLUTION_M {
                let inside = found
                    .iter()
                    .any(|inside| inside.enter <= s && s <= inside.leave);
                assert_eq!(over < 0.0, inside, "{over} at {s}: {found:?}");
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(1500))]

        #[test]
        fn turning_shapes_agree_with_parry(
            a in any_shape(), way_a in (any_pose(), any_pose()),
            b in any_shape(), way_b in (any_pose(), any_pose()),
            tolerance_m in prop_oneof![Just(0.0), Just(1e-6), Just(0.1)],
        ) {
            check(&a, way_a, &b, way_b, tolerance_m);
        }

        #[test]
        fn shapes_that_do_not_turn_agree_with_parry(
            a in any_shape(), way_a in (any_pose(), any_pose()),
            b in any_shape(), way_b in (any_pose(), any_pose()),
            tolerance_m in prop_oneof![Just(0.0), Just(1e-6), Just(0.1)],
        ) {
            let straight = |(from, to): (Pose, Pose)| (from, Pose { heading: from.heading, ..to });
            check(&a, straight(way_a), &b, straight(way_b), tolerance_m);
        }

        #[test]
        fn shapes_that_only_turn_agree_with_parry(
            a in any_shape(), way_a in (any_pose(), any_pose()),
            b in any_shape(), way_b in (any_pose(), any_pose()),
        ) {
            let still = |(from, to): (Pose, Pose)| (from, Pose { heading: to.heading, ..from });
            check(&a, still(way_a), &b, still(way_b), 1e-6);
        }

        /// An overlap that lasts at the end of a span lasts at the start of the next, and so on.
        #[test]
        fn spans_fit_together(
            a in any_shape(), b in any_shape(),
            way in [any_pose(), any_pose(), any_pose()],
            other in [any_pose(), any_pose(), any_pose()],
            turns in [any::<bool>(), any::<bool>()],
        ) {
            let heading = |turn: bool, from: Pose, to: Pose| {
                if turn { to } else { Pose { heading: from.heading, ..to } }
            };
            let way = {
                let middle = heading(turns[0], way[0], way[1]);
                [way[0], middle, heading(turns[1], middle, way[2])]
            };
            let other = {
                let middle = heading(turns[1], other[0], other[1]);
                [other[0], middle, heading(turns[0], middle, other[2])]
            };
            let span = |at: usize| {
                let mut found = Vec::new();
                contacts_in_span(
                    &a, way[at], way[at + 1], &b, other[at], other[at + 1], 1e-6, &mut found,
                );
                found
            };
            let (before, after) = (span(0), span(1));
            let ends = before.last().is_some_and(|inside| inside.at_end);
            let starts = after.first().is_some_and(|inside| inside.at_start);
            prop_assert_eq!(ends, starts);
        }
    }

    fn contacts(a: &Shape, way_a: (Pose, Pose), b: &Shape, way_b: (Pose, Pose)) -> Vec<(f64, f64)> {
        let mut found = Vec::new();
        contacts_in_span(a, way_a.0, way_a.1, b, way_b.0, way_b.1, 1e-6, &mut found);
        found
            .iter()
            .map(|inside| (inside.enter, inside.leave))
            .collect()
    }

    #[test]
    fn a_corner_that_turns_past_a_wall() {
        // The corner of a 2 m square reaches √2 m; the wall is 1.2 m away.
        let (square, wall) = (rectangle(2.0, 2.0), rectangle(0.2, 8.0));
        let turn = |angle: f64| (Pose::default(), Pose::new(0.0, 0.0, angle));
        let at = |x: f64| (Pose::at(x, 0.0), Pose::at(x, 0.0));
        // √2·cos(π/4 − θ) > 1.2 + 1e-6 in each of four quarter turns.
        let full = contacts(&square, turn(std::f64::consts::TAU), &wall, at(1.3));
        assert_eq!(full.len(), 4);
        let enter = std::f64::consts::FRAC_PI_4 - libm::acos((1.2 + 1e-6) / 2f64.sqrt());
        for (quarter, (from, to)) in full.iter().enumerate() {
            let quarter = quarter as f64;
            let expected = (quarter * std::f64::consts::FRAC_PI_2 + enter) / std::f64::consts::TAU;
            assert!((from - expected).abs() < 1e-9, "{from} {expected}");
            let expected =
                ((quarter + 1.0) * std::f64::consts::FRAC_PI_2 - enter) / std::f64::consts::TAU;
            assert!((to - expected).abs() < 1e-9, "{to} {expected}");
        }
        // Just out of reach, and just within by ten micrometres.
        assert!(contacts(&square, turn(7.0), &wall, at(0.1 + 2f64.sqrt())).is_empty());
        assert_eq!(
            contacts(&square, turn(1.5), &wall, at(0.1 + 2f64.sqrt() - 1.1e-5)).len(),
            1
        );
    }

    #[test]
    fn touching_all_the_time_is_no_contact() {
        let (square, disc) = (rectangle(1.0, 1.0), Shape::disc(0.5));
        let along = |x: f64| (Pose::at(x, 0.0), Pose::at(x, 9.0));
        let turn = (Pose::at(1.0, 0.0), Pose::new(1.0, 0.0, 100.0));
        let still = (Pose::default(), Pose::default());
        for (b, way_a, way_b) in [
            (&square, along(0.0), along(1.0)),
            (&disc, along(0.0), along(1.0)),
            (&square, still, along(1.0)),
            (&disc, still, along(1.0)),
            (&disc, still, turn),
        ] {
            assert_eq!(contacts(&square, way_a, b, way_b), []);
        }
        // Two in the same place, whatever they do there.
        for shape in [&square, &disc] {
            assert_eq!(contacts(shape, still, shape, still), [(0.0, 1.0)]);
            assert_eq!(contacts(shape, along(2.0), shape, along(2.0)), [(0.0, 1.0)]);
            assert_eq!(contacts(shape, turn, shape, turn), [(0.0, 1.0)]);
        }
    }

    #[test]
    fn absurd_motions_end() {
        let (one, two) = (rectangle(1.0, 0.2), rectangle(1.0, 0.2));
        let spin = (Pose::default(), Pose::new(0.0, 0.0, 1e9));
        let far = (Pose::at(-1e9, 0.5), Pose::new(1e9, 0.5, -1e9));
        let mut found = Vec::new();
        contacts_in_span(&one, spin.0, spin.1, &two, far.0, far.1, 1e-6, &mut found);
        assert!(found.iter().all(|inside| inside.enter <= inside.leave));
    }
}
