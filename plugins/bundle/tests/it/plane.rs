//! Intervals in closed form beside what the least distance of two motions says, sets of intervals beside a list of
//! moments, and bins beside all pairs.

// Ends of intervals are copied, not worked out anew.
#![allow(clippy::float_cmp)]

mod shortest;
mod space_time;
mod sssp;
mod support;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::{Bins, Rectangle};
use fleetyard_plugin_plane::motion::{Motion, Span};
use fleetyard_plugin_plane::spans::Spans;
use proptest::prelude::*;

/// The least distance of two centres when the second motion begins `later` than the first; infinite when they never are
/// on their way at once. Where the motions overlap in time, the displacement between them is linear in it.
fn least_distance(a: &Motion, b: &Motion, later: f64) -> f64 {
    let (begin, end) = (later.max(0.0), a.duration.min(later + b.duration));
    if begin > end {
        return f64::INFINITY;
    }
    let offset = a.at(begin) - b.at(begin - later);
    let drift = a.velocity - b.velocity;
    let at = if drift.norm_squared() > 0.0 {
        (-offset.dot(&drift) / drift.norm_squared()).clamp(0.0, end - begin)
    } else {
        0.0
    };
    (offset + drift * at).norm()
}

fn back(motion: &Motion) -> Motion {
    Motion {
        from: motion.at(motion.duration),
        velocity: -motion.velocity,
        duration: motion.duration,
    }
}

/// Holds an interval against the least distance, just outside of it and inside.
fn judge(a: &Motion, b: &Motion, distance: f64, found: Option<Span>) -> Result<(), TestCaseError> {
    let reach = a.duration + b.duration;
    let closer = |later: f64| least_distance(a, b, later) < distance - 1e-9;
    // Motions that touch at an end may have an interval of a rounding error's length.
    match found.filter(|span| span.high - span.low > 1e-9) {
        None => {
            for step in 0..=64 {
                let later = -b.duration + reach * f64::from(step) / 64.0;
                prop_assert!(
                    !closer(later),
                    "{later} is too close, but no interval was found"
                );
            }
        }
        Some(span) => {
            let (outside, length) = (1e-6 * (1.0 + reach), span.high - span.low);
            for later in [span.low - outside, span.high + outside] {
                prop_assert!(!closer(later), "{later} is too close outside of {span:?}");
            }
            for step in 1..8 {
                let later = span.low + length * f64::from(step) / 8.0;
                let least = least_distance(a, b, later);
                prop_assert!(
                    least < distance + 1e-9,
                    "{later} in {span:?} is {least} apart"
                );
            }
        }
    }
    Ok(())
}

fn place() -> impl Strategy<Value = Vector> {
    // Places of a coarse lattice give parallel, touching, crossing and equal motions; the others do not.
    prop_oneof![
        (0..5_i32, 0..5_i32).prop_map(|(x, y)| Vector::new(f64::from(x), f64::from(y)) * 0.5),
        (0.0..2.0, 0.0..2.0).prop_map(|(x, y)| Vector::new(x, y)),
    ]
}

fn motion() -> impl Strategy<Value = Motion> {
    let moving = (place(), place(), prop_oneof![Just(1.0), 0.1..3.0_f64])
        .prop_filter("a motion leads somewhere", |(from, to, _)| from != to)
        .prop_map(|(from, to, speed)| Motion::between(from, to, (to - from).norm() / speed));
    prop_oneof![
        4 => moving,
        1 => (place(), 0.0..5.0_f64).prop_map(|(at, duration)| Motion::rest(at, duration)),
    ]
}

/// As many cases as `PROPTEST_CASES` asks for.
fn cases(otherwise: u32) -> ProptestConfig {
    let asked = std::env::var("PROPTEST_CASES").ok();
    ProptestConfig::with_cases(
        asked
            .and_then(|asked| asked.parse().ok())
            .unwrap_or(otherwise),
    )
}

proptest! {
    #![proptest_config(cases(20_000))]

    #[test]
    fn start_times_are_those_at_which_motions_come_too_close(
        a in motion(), b in motion(), distance in prop_oneof![Just(0.5), 0.01..1.5_f64],
    ) {
        let found = a.overlap(&b, distance);
        judge(&a, &b, distance, found.map(|overlap| overlap.forward))?;
        judge(&a, &back(&b), distance, found.map(|overlap| overlap.backward))?;
    }

    #[test]
    fn a_place_is_near_while_the_distance_says_so(
        a in motion(), at in place(), distance in 0.01..1.5_f64,
    ) {
        let found = a.near(at, distance);
        for step in 0..=64 {
            let time = a.duration * f64::from(step) / 64.0;
            let apart = (a.at(time) - at).norm();
            // An interval that begins or ends with the motion has that end.
            let inside = found.is_some_and(|span| {
                (span.low < time || span.low == 0.0) && (time < span.high || span.high == a.duration)
                    && span.low <= time && time <= span.high
            });
            if inside {
                prop_assert!(apart < distance + 1e-9);
            } else {
                prop_assert!(apart > distance - 1e-9);
            }
        }
    }

    #[test]
    fn spans_hold_what_was_inserted(
        given in proptest::collection::vec((0..40_i32, 0..12_i32), 0..20), asked in 0..80_i32,
    ) {
        let mut spans = Spans::new();
        let given: Vec<Span> = given
            .iter()
            .map(|(low, length)| Span { low: f64::from(*low), high: f64::from(low + length) })
            .collect();
        for span in &given {
            spans.insert(*span);
        }
        for pair in spans.as_slice().windows(2) {
            prop_assert!(pair[0].high < pair[1].low);
        }
        let within = |spans: &[Span], time: f64| spans.iter().any(|span| span.low < time && time < span.high);
        // Half steps are at no end of an interval.
        let time = f64::from(asked) / 2.0 + 0.25;
        prop_assert_eq!(within(spans.as_slice(), time), within(&given, time));
        let next = spans.first_outside(time);
        prop_assert!(next >= time && !within(spans.as_slice(), next));
        prop_assert_eq!(next == time, !within(&given, time));
        let safe = spans.safe(spans.ended(next));
        prop_assert!(safe.low <= next && next <= safe.high);
    }

    #[test]
    fn bins_tell_of_every_box_that_meets(
        given in proptest::collection::vec((place(), place()), 0..40), a in place(), b in place(), first in 0..40_u32,
    ) {
        let boxes: Vec<Rectangle> =
            given.iter().map(|(a, b)| Rectangle::around(*a, *b, 0.1)).collect();
        let asked = Rectangle::around(a, b, 0.05);
        let mut found = Vec::new();
        Bins::new(boxes.clone()).meeting(&asked, |number| found.push(number));
        found.sort_unstable();
        let meeting = (0..boxes.len()).filter(|number| boxes[*number].meets(&asked));
        prop_assert_eq!(&found, &meeting.map(|number| number as u32).collect::<Vec<_>>());
        let mut later = Vec::new();
        Bins::new(boxes).meeting_from(&asked, first, |number| later.push(number));
        later.sort_unstable();
        found.retain(|number| *number >= first);
        prop_assert_eq!(later, found);
    }
}

#[test]
fn who_rests_for_ever_is_in_the_way_for_ever() {
    let parked = Motion::rest(Vector::new(1.0, 0.0), f64::INFINITY);
    let passing = Motion::between(Vector::zeros(), Vector::new(2.0, 0.0), 2.0);
    let found = parked.overlap(&passing, 0.5).unwrap().forward;
    assert_eq!((found.low, found.high), (-1.5, f64::INFINITY));
}

#[test]
fn driving_one_behind_the_other_takes_a_headway() {
    let a = Motion::between(Vector::zeros(), Vector::new(4.0, 0.0), 4.0);
    let found = a.overlap(&a, 0.5).unwrap();
    assert!((found.forward.low + 0.5).abs() < 1e-12 && (found.forward.high - 0.5).abs() < 1e-12);
    // Head on, the second one has to be through before, or to wait until the first one is.
    assert!((found.backward.low + 4.0).abs() < 1e-12 && (found.backward.high - 4.0).abs() < 1e-12);
}

pub(crate) mod ways {
    //! Shortest ways held against a search in a graph of many places round each corner, whose lines are tested by sampling.

    use std::f64::consts::PI;

    use fleetyard_plugin_plane::Vector;
    use fleetyard_plugin_plane::bins::Rectangle;
    use fleetyard_plugin_plane::obstacles::Obstacles;
    use fleetyard_plugin_plane::tangent::Tangents;

    pub(crate) const SIDE: f64 = 6.0;
    pub(crate) const RADIUS: f64 = 0.3;

    /// Numbers from 0 to 1, the same in every run.
    pub(crate) struct Numbers(pub(crate) u64);

    impl Numbers {
        pub(crate) fn next(&mut self) -> f64 {
            self.0 = self
                .0
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            (self.0 >> 33) as f64 / f64::from(1_u32 << 31)
        }

        pub(crate) fn place(&mut self) -> Vector {
            Vector::new(self.next(), self.next()) * SIDE
        }

        /// A clockwise polygon. Corners at unequal distances from its middle point inwards at times.
        pub(crate) fn polygon(&mut self) -> Vec<Vector> {
            let (centre, size) = (self.place(), 0.7 + self.next());
            let corners = 3 + (self.next() * 3.0) as u32;
            let corner = |corner: u32| {
                let turn = f64::from(corner) + 0.8 * self.next();
                let angle = turn * 2.0 * PI / f64::from(corners);
                let reach = size * (0.5 + 0.5 * self.next());
                centre + Vector::new(angle.cos(), -angle.sin()) * reach
            };
            (0..corners).map(corner).collect()
        }
    }

    /// Distance of a place to a polygon's border, below zero inside.
    fn distance(polygon: &[Vector], place: Vector) -> f64 {
        let (mut least, mut odd) = (f64::INFINITY, false);
        for (at, a) in polygon.iter().enumerate() {
            let b = polygon[(at + 1) % polygon.len()];
            let along = b - a;
            let part = ((place - a).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            least = least.min((a + along * part - place).norm());
            let above = (a.y > place.y, b.y > place.y);
            odd ^= above.0 != above.1 && place.x < a.x + (place.y - a.y) / along.y * along.x;
        }
        if odd { -least } else { least }
    }

    pub(crate) fn clear(polygons: &[Vec<Vector>], from: Vector, to: Vector) -> bool {
        let samples = ((to - from).norm() / 0.02).ceil().max(1.0);
        (0..=samples as u32).all(|sample| {
            let place = from + (to - from) * (f64::from(sample) / samples);
            let wall = place.min().min(SIDE - place.max());
            let polygon = polygons.iter().map(|polygon| distance(polygon, place));
            polygon.fold(wall, f64::min) > RADIUS - 1e-4
        })
    }

    /// The shortest way over places round the corners, each ten degrees.
    pub(crate) fn sampled(polygons: &[Vec<Vector>], start: Vector, goal: Vector) -> f64 {
        let mut places = vec![start, goal];
        for corner in polygons.iter().flatten() {
            let around = (0..36).map(|step| {
                let angle = f64::from(step) * PI / 18.0;
                corner + Vector::new(angle.cos(), angle.sin()) * (RADIUS / (PI / 36.0).cos() + 1e-6)
            });
            places.extend(around.filter(|place| clear(polygons, *place, *place)));
        }
        let mut lengths = vec![f64::INFINITY; places.len()];
        let mut done = vec![false; places.len()];
        lengths[0] = 0.0;
        loop {
            let left = (0..places.len()).filter(|at| !done[*at] && lengths[*at].is_finite());
            let Some(at) = left.min_by(|a, b| lengths[*a].total_cmp(&lengths[*b])) else {
                return f64::INFINITY;
            };
            if at == 1 {
                return lengths[1];
            }
            done[at] = true;
            for to in 0..places.len() {
                let length = lengths[at] + (places[to] - places[at]).norm();
                if !done[to] && length < lengths[to] && clear(polygons, places[at], places[to]) {
                    lengths[to] = length;
                }
            }
        }
    }

    #[test]
    fn ways_are_as_short_as_those_over_many_places_round_each_corner() {
        let (mut numbers, mut found, mut turned) = (Numbers(7), 0, 0);
        for _ in 0..150 {
            let polygons: Vec<Vec<Vector>> = (0..4).map(|_| numbers.polygon()).collect();
            let bounds = Rectangle {
                min: Vector::zeros(),
                max: Vector::repeat(SIDE),
            };
            let (start, goal) = (
                numbers.place() * 0.3,
                Vector::repeat(SIDE) - numbers.place() * 0.3,
            );
            let obstacles = Obstacles::new(polygons.clone(), bounds, RADIUS);
            let way = Tangents::new(&obstacles).shortest(start, goal, &mut || false);
            if !clear(&polygons, start, start) || !clear(&polygons, goal, goal) {
                assert_eq!(way, None);
                continue;
            }
            let sampled = sampled(&polygons, start, goal);
            let Some(way) = way else {
                assert!(sampled.is_infinite(), "a way of {sampled} m was not found");
                continue;
            };
            found += 1;
            turned += u32::from(way.places.len() > 2);
            let driven: f64 = way
                .places
                .windows(2)
                .map(|pair| (pair[1] - pair[0]).norm())
                .sum();
            assert!(
                way.places
                    .windows(2)
                    .all(|pair| clear(&polygons, pair[0], pair[1]))
            );
            assert_eq!(
                (way.places[0], way.places[way.places.len() - 1]),
                (start, goal)
            );
            assert!(way.length <= driven + 1e-9 && driven < way.length * 1.003);
            assert!(
                way.length < sampled + 1e-4,
                "{} m, but {sampled} m would do",
                way.length
            );
            assert!(
                way.length > sampled * 0.99,
                "{} m, but {sampled} m over places",
                way.length
            );
        }
        assert!(
            found > 20 && turned > 10,
            "{found} ways, {turned} of them round a corner"
        );
    }

    #[test]
    fn a_disc_at_its_goal_stays() {
        let bounds = Rectangle {
            min: Vector::zeros(),
            max: Vector::new(1.0, 1.0),
        };
        let obstacles = Obstacles::new(Vec::new(), bounds, RADIUS);
        let at = Vector::new(0.5, 0.5);
        let way = Tangents::new(&obstacles).shortest(at, at, &mut || false);
        let way = way.unwrap();
        assert_eq!((way.length, way.places), (0.0, vec![at]));
    }

    #[test]
    fn a_disc_that_does_not_fit_through_a_gap_goes_round() {
        let wall = |x: f64, y: [f64; 2]| {
            [(x, y[0]), (x + 0.2, y[0]), (x + 0.2, y[1]), (x, y[1])]
                .map(|(x, y)| Vector::new(x, y))
                .to_vec()
        };
        let bounds = Rectangle {
            min: Vector::zeros(),
            max: Vector::new(6.0, 6.0),
        };
        let way = |gap: f64| {
            let polygons = [
                wall(2.9, [0.0, 3.0 - gap / 2.0]),
                wall(2.9, [3.0 + gap / 2.0, 5.0]),
            ];
            let obstacles = Obstacles::new(polygons, bounds, RADIUS);
            let mut tangents = Tangents::new(&obstacles);
            let way =
                tangents.shortest(Vector::new(1.0, 3.0), Vector::new(5.0, 3.0), &mut || false);
            way.map(|way| way.length)
        };
        assert!((way(0.601).unwrap() - 4.0).abs() < 1e-6);
        assert!(way(0.599).unwrap() > 5.0);
    }
}

pub(crate) mod teams {
    //! Teams of discs of several sizes: whoever is given a plan keeps clear of everybody and everything.

    use fleetyard_plugin_plane::Vector;
    use fleetyard_plugin_plane::bins::Rectangle;
    use fleetyard_plugin_plane::obstacles::Obstacles;
    use fleetyard_plugin_plane::orders::End;
    use fleetyard_plugin_plane::prioritised::{Disc, Effort, Mover, Outcome, World, plan};
    use fleetyard_plugin_plane::timing::Stop;
    use proptest::prelude::*;

    use super::support::least_clearance;

    pub(crate) fn bounds() -> Rectangle {
        Rectangle {
            min: Vector::zeros(),
            max: Vector::new(8.0, 6.0),
        }
    }

    /// A wall with a door, and a block.
    pub(crate) fn polygons() -> Vec<Vec<Vector>> {
        let block = |left: f64, bottom: f64, right: f64, top: f64| {
            [(left, bottom), (right, bottom), (right, top), (left, top)]
                .map(|(x, y)| Vector::new(x, y))
                .to_vec()
        };
        vec![
            block(3.9, 0.0, 4.1, 2.4),
            block(3.9, 3.6, 4.1, 6.0),
            block(1.5, 1.0, 2.5, 2.0),
        ]
    }

    fn effort(seed: u64) -> Effort {
        Effort {
            clearance: if seed == 2 { 0.01 } else { 0.0 },
            limit: 10,
            seed,
        }
    }

    pub(crate) fn world(polygons: Vec<Vec<Vector>>) -> World {
        World {
            polygons,
            bounds: bounds(),
            movers: Vec::new(),
        }
    }

    /// It comes along a free aisle and leaves the way that it came.
    pub(crate) fn mover() -> Mover {
        let stop = |x: f64, arrival: f64, departure: f64| Stop {
            at: Vector::new(x, -1.0),
            arrival,
            departure,
        };
        Mover {
            radius: 1.3,
            stops: vec![
                stop(-3.0, 0.0, 1.0),
                stop(9.0, 7.0, 8.0),
                stop(-3.0, 14.0, f64::INFINITY),
            ],
        }
    }

    pub(crate) fn discs() -> impl Strategy<Value = Vec<Disc>> {
        let place = || (0.4..7.6_f64, 0.4..5.6_f64).prop_map(|(x, y)| Vector::new(x, y));
        let disc = (
            prop_oneof![Just(0.2), 0.1..0.35_f64],
            0.5..2.0_f64,
            place(),
            place(),
        );
        let disc = disc.prop_map(|(radius, speed, start, goal)| Disc {
            radius,
            speed,
            start,
            goal,
        });
        proptest::collection::vec(disc, 1..12).prop_map(|wanted| {
            // Starts and goals that are free, and do not block each other.
            let mut discs: Vec<Disc> = Vec::new();
            for disc in wanted {
                let obstacles = Obstacles::new(polygons(), bounds(), disc.radius);
                let apart = |other: &Disc| {
                    let least = disc.radius + other.radius + 1e-6;
                    (disc.start - other.start).norm() > least
                        && (disc.goal - other.goal).norm() > least
                };
                if obstacles.free(disc.start)
                    && obstacles.free(disc.goal)
                    && discs.iter().all(apart)
                {
                    discs.push(disc);
                }
            }
            discs
        })
    }

    /// Fails unless discs keep clear of each other, of movers and of walls, and go from start to goal at their speeds.
    pub(crate) fn judge(
        world: &World,
        discs: &[Disc],
        plans: &[Vec<Stop>],
    ) -> Result<(), TestCaseError> {
        let (mut bodies, mut stops) = (discs.to_vec(), plans.to_vec());
        for mover in &world.movers {
            let at = mover.stops[0].at;
            bodies.push(Disc {
                radius: mover.radius,
                speed: 1.0,
                start: at,
                goal: at,
            });
            stops.push(mover.stops.clone());
        }
        let clearance = least_clearance(&bodies, &stops);
        prop_assert!(clearance > -1e-7, "{} m", clearance);
        prop_assert_eq!(discs.len(), plans.len());
        for (disc, stops) in discs.iter().zip(plans) {
            let (first, last) = (stops[0], stops[stops.len() - 1]);
            prop_assert_eq!((first.at, first.arrival), (disc.start, 0.0));
            prop_assert_eq!((last.at, last.departure), (disc.goal, f64::INFINITY));
            let radius = disc.radius - 1e-6;
            let obstacles = Obstacles::new(world.polygons.clone(), world.bounds, radius);
            for leg in stops.windows(2) {
                prop_assert!(leg[0].departure >= leg[0].arrival);
                let seconds = (leg[1].at - leg[0].at).norm() / disc.speed;
                prop_assert!((leg[1].arrival - leg[0].departure - seconds).abs() < 1e-9);
                prop_assert!(obstacles.clear(leg[0].at, leg[1].at));
            }
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(120))]

        #[test]
        fn discs_keep_clear_of_each_other_and_of_walls(
            discs in discs(),
            seed in 0..3_u64,
            moved in prop::bool::ANY,
        ) {
            let mover = mover();
            let world = World {
                movers: moved.then(|| mover.clone()).into_iter().collect(),
                ..world(polygons())
            };
            let found = plan(&world, &discs, effort(seed), &mut || false);
            prop_assert_eq!(&found, &plan(&world, &discs, effort(seed), &mut || false));
            let Outcome::Ordered { end: End::Solved(plans), .. } = found else {
                prop_assert!(discs.len() > 1 || moved, "one disc alone has a way");
                return Ok(());
            };
            judge(&world, &discs, &plans)?;
        }
    }

    #[test]
    fn who_cannot_get_out_of_its_room_has_no_way() {
        let wall = [(4.0, 0.0), (4.1, 0.0), (4.1, 6.0), (4.0, 6.0)]
            .map(|(x, y)| Vector::new(x, y))
            .to_vec();
        let disc = |x: f64, to: f64| Disc {
            radius: 0.2,
            speed: 1.0,
            start: Vector::new(x, 3.0),
            goal: Vector::new(to, 3.0),
        };
        let discs = [disc(1.0, 2.0), disc(3.0, 5.0)];
        let found = plan(&world(vec![wall]), &discs, effort(1), &mut || false);
        assert_eq!(found, Outcome::NoWay(1));
    }
}
