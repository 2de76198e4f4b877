//! Propagation beside small steps, controls from rest to rest, and bodies that meet on curved ways.

use std::f64::consts::{FRAC_PI_2, PI};

use fleetyard_abi::Footprint;
use fleetyard_plugin_kinodynamic::course::{CHORD, Course, Knot, Segment, Track};
use fleetyard_plugin_kinodynamic::robot::{DYNAMICS, Robot, State};
use fleetyard_plugin_kinodynamic::scene::clash;
use fleetyard_plugin_kinodynamic::steer::{brake, steer};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::sssp::bodies::{Body, Pose};
use proptest::prelude::*;

/// A rectangle with these dynamics, ±0.5 of every rate and ±0.25 of its change; ahead faster than back.
fn robot(dynamics: &str) -> Robot {
    let second = dynamics.contains("double") || dynamics.contains("-2");
    let axes = if dynamics.contains("unicycle") { 2 } else { 3 };
    let corners = [
        [0.25, 0.125],
        [-0.25, 0.125],
        [-0.25, -0.125],
        [0.25, -0.125],
    ];
    let mut rates = vec![[Some(-0.5), Some(0.5)]; axes];
    rates[0][0] = Some(-0.3);
    let changes = vec![[Some(-0.25), Some(0.4)]; axes];
    let mut state_limits = vec![[None; 2]; 3];
    if second {
        state_limits.extend(rates.clone());
    }
    Robot::new(&fleetyard_abi::Robot {
        name: String::new(),
        footprint: Footprint {
            radius_m: 0.28,
            corners_m: corners.to_vec(),
        },
        dynamics: dynamics.to_owned(),
        has_heading: true,
        polar_state: false,
        polar_control: false,
        state_limits,
        control_limits: if second { changes } else { rates },
        parameters: Vec::new(),
    })
    .unwrap()
}

fn any_robot() -> impl Strategy<Value = Robot> {
    (0..DYNAMICS.len()).prop_map(|kind| robot(DYNAMICS[kind]))
}

fn any_pose() -> impl Strategy<Value = Pose> {
    (-2.0..2.0, -2.0..2.0, -PI..PI).prop_map(|(x, y, heading)| Pose {
        at: Vector::new(x, y),
        heading,
    })
}

fn near(one: &State, other: &State, distance: f64) {
    assert!((one.at - other.at).norm() < distance, "{one:?} {other:?}");
    assert!(
        (one.heading - other.heading).abs() < distance,
        "{one:?} {other:?}"
    );
    for axis in 0..3 {
        assert!(
            (one.rates[axis] - other.rates[axis]).abs() < distance,
            "{one:?} {other:?}"
        );
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// Euler's midpoint rule with steps of a millisecond.
    #[test]
    fn controls_lead_where_small_steps_lead(
        robot in any_robot(), pose in any_pose(),
        control in prop::array::uniform3(-1.0..1.0_f64), rates in prop::array::uniform3(-1.0..1.0_f64),
        seconds in 0.01..4.0_f64,
    ) {
        let control = robot.clamped(&control);
        let start = State { rates: robot.clamped_rates(&rates), ..State::rest(pose.at, pose.heading) };
        let steps = (seconds * 1000.0).ceil();
        let step = seconds / steps;
        let (mut at, mut heading, mut own) = (start.at, start.heading, if robot.is_second { start.rates } else { control });
        for _ in 0..steps as u32 {
            let change = if robot.is_second { control } else { [0.0; 3] };
            let middle = [0, 1, 2].map(|axis| own[axis] + change[axis] * step / 2.0);
            let direction = heading + (own[2] + change[2] * step / 4.0) * step / 2.0;
            at += robot.velocity(direction, &middle) * step;
            heading += middle[2] * step;
            own = [0, 1, 2].map(|axis| own[axis] + change[axis] * step);
        }
        let led = robot.after(&start, &control, seconds);
        let rates = if robot.is_second { own } else { [0.0; 3] };
        near(&led, &State { at, heading, rates, behind: heading }, 1e-6);
        // In two parts as in one.
        let half = robot.after(&start, &control, seconds / 3.0);
        near(&robot.after(&half, &control, seconds * 2.0 / 3.0), &led, 1e-9);
    }

    #[test]
    fn steering_leads_from_rest_to_rest_within_limits(
        robot in any_robot(), from in any_pose(), to in any_pose(), free in any::<bool>(),
    ) {
        let start = State::rest(from.at, from.heading);
        let course = Course { start, segments: steer(&robot, &from, &to, free).unwrap() };
        prop_assert!(course.is_allowed(&robot));
        let end = course.end(&robot);
        prop_assert!((end.at - to.at).norm() < 1e-9, "{end:?} {to:?}");
        prop_assert!(end.rates.iter().all(|rate| rate.abs() < 1e-12));
        let turn = (end.heading - to.heading) / (2.0 * PI);
        prop_assert!(free || (turn - turn.round()).abs() < 1e-9, "{end:?} {to:?}");
    }

    #[test]
    fn a_brake_ends_at_rest_within_limits(
        robot in any_robot(), rates in prop::array::uniform3(-1.0..1.0_f64),
    ) {
        let start = State { rates: robot.clamped_rates(&rates), ..State::rest(Vector::zeros(), 0.0) };
        let segments: Vec<Segment> = brake(&robot, &start).into_iter().collect();
        prop_assert_eq!(segments.is_empty(), start.rates.iter().all(|rate| *rate == 0.0));
        let course = Course { start, segments };
        prop_assert!(course.is_allowed(&robot));
        prop_assert!(course.end(&robot).rates.iter().all(|rate| rate.abs() < 1e-12));
    }

    #[test]
    fn tracks_stay_beside_their_motions(
        robot in any_robot(), controls in prop::collection::vec((prop::array::uniform3(-0.2..0.2_f64), 0.0..2.0_f64), 1..5),
        part in 0.0..1.0_f64,
    ) {
        let start = State::rest(Vector::zeros(), 0.0);
        let segments: Vec<Segment> = controls
            .iter()
            .map(|(control, seconds)| Segment { control: robot.clamped(control), seconds: *seconds })
            .collect();
        let course = Course { start, segments };
        let track = course.track(&robot);
        let time = course.seconds() * part;
        let (mut state, mut left) = (start, time);
        for segment in &course.segments {
            let held = left.min(segment.seconds);
            state = robot.after(&state, &segment.control, held);
            left -= held;
        }
        let pose = track.at(time);
        prop_assert!((pose.at - state.at).norm() < CHORD + 1e-9, "{pose:?} {state:?}");
        prop_assert!((pose.heading - state.heading).abs() < CHORD + 1e-9);
        near(&course.end(&robot), &State { at: track.last().pose.at, heading: track.last().pose.heading, ..course.end(&robot) }, 1e-9);
    }

    /// Beside poses every hundredth of a second.
    #[test]
    fn bodies_clash_when_samples_of_them_overlap(
        one in prop::collection::vec(any_pose(), 1..4), other in prop::collection::vec(any_pose(), 1..4), is_disc in any::<bool>(),
    ) {
        let long = Body { radius: 0.6, corners: [[0.55, 0.2], [-0.55, 0.2], [-0.55, -0.2], [0.55, -0.2]].map(|[x, y]| Vector::new(x, y)).to_vec() };
        let disc = Body { radius: 0.3, corners: Vec::new() };
        let bodies = [if is_disc { &disc } else { &long }, &long];
        let track = |poses: &[Pose], pace: f64| Track::of(
            poses.iter().enumerate().map(|(number, pose)| Knot { time: number as f64 * pace, pose: *pose }).collect(),
        );
        let tracks = [track(&one, 1.0), track(&other, 1.5)];
        let found = clash((bodies[0], &tracks[0]), (bodies[1], &tracks[1]), 0.0, f64::INFINITY);
        let overlap = |time: f64| overlapping(bodies[0], &tracks[0].at(time), bodies[1], &tracks[1].at(time));
        let sampled = (0..=500).map(|step| f64::from(step) * 0.01).find(|time| overlap(*time));
        match (found, sampled) {
            (None, sampled) => prop_assert_eq!(sampled, None),
            // Between samples it is seen sooner, and a graze may end between them.
            (Some(found), Some(sampled)) => prop_assert!(found <= sampled + 1e-9 && overlap_soon(&overlap, found)),
            (Some(found), None) => prop_assert!(overlap_soon(&overlap, found)),
        }
    }
}

fn overlap_soon(overlap: &dyn Fn(f64) -> bool, found: f64) -> bool {
    (-100..=100).any(|step| overlap((found + f64::from(step) * 1e-6).max(0.0)))
}

/// By separating axes; a disc by the nearest point of the polygon.
fn overlapping(one: &Body, pose: &Pose, other: &Body, other_pose: &Pose) -> bool {
    let placed = |body: &Body, pose: &Pose| -> Vec<Vector> {
        let (sin, cos) = pose.heading.sin_cos();
        let turned =
            |at: &Vector| Vector::new(cos * at.x - sin * at.y, sin * at.x + cos * at.y) + pose.at;
        body.corners.iter().map(turned).collect()
    };
    let b = placed(other, other_pose);
    let edges = |corners: &[Vector]| -> Vec<[Vector; 2]> {
        (0..corners.len())
            .map(|at| [corners[at], corners[(at + 1) % corners.len()]])
            .collect()
    };
    if one.is_disc() {
        let sides = edges(&b);
        let outside = sides.iter().any(|[from, to]| {
            let along = to - from;
            along.x * (pose.at - from).y - along.y * (pose.at - from).x < 0.0
        });
        let nearest = sides.iter().map(|[from, to]| {
            let along = to - from;
            let part = ((pose.at - from).dot(&along) / along.norm_squared()).clamp(0.0, 1.0);
            (pose.at - from - along * part).norm()
        });
        return !outside || nearest.fold(f64::INFINITY, f64::min) < one.radius - 1e-9;
    }
    let a = placed(one, pose);
    edges(&a).iter().chain(&edges(&b)).all(|[from, to]| {
        let normal = Vector::new((to - from).y, -(to - from).x).normalize();
        let span = |corners: &[Vector]| {
            corners
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), corner| {
                    (low.min(normal.dot(corner)), high.max(normal.dot(corner)))
                })
        };
        let ((low, high), (other_low, other_high)) = (span(&a), span(&b));
        low < other_high - 1e-9 && other_low < high - 1e-9
    })
}

#[test]
fn a_unicycle_drives_back_where_that_is_sooner_and_turns_where_it_cannot() {
    let mut robot = robot("fleetyard.unicycle/1");
    let pose = |x: f64, heading: f64| Pose {
        at: Vector::new(x, 0.0),
        heading,
    };
    let back = steer(&robot, &pose(0.0, 0.0), &pose(-0.3, 0.0), false).unwrap();
    assert_eq!(back.len(), 1);
    assert!((back[0].seconds - 1.0).abs() < 1e-12 && back[0].control[0] < 0.0);
    robot.rates[0][0] = 0.0;
    let turning = steer(&robot, &pose(0.0, 0.0), &pose(-0.3, 0.0), false).unwrap();
    assert_eq!(turning.len(), 3);
    // A robot that cannot turn gets there by no controls.
    robot.rates[2] = [0.0; 2];
    assert_eq!(
        steer(&robot, &pose(0.0, 0.0), &pose(0.0, FRAC_PI_2), false),
        None
    );
    assert!(steer(&robot, &pose(0.0, 0.0), &pose(0.5, FRAC_PI_2), true).is_some());
}

#[test]
fn bodies_that_begin_side_by_side_do_not_clash() {
    let body = Body {
        radius: 0.5,
        corners: [[0.3, 0.2], [-0.3, 0.2], [-0.3, -0.2], [0.3, -0.2]]
            .map(|[x, y]| Vector::new(x, y))
            .to_vec(),
    };
    let knot = |time: f64, x: f64, y: f64| Knot {
        time,
        pose: Pose {
            at: Vector::new(x, y),
            heading: 0.0,
        },
    };
    let track = |y: f64, end: f64| Track::of(vec![knot(0.0, 0.0, y), knot(1.0, 1.0, end)]);
    let still = Track::of(vec![knot(0.0, 0.0, 0.0)]);
    // Both in parallel, one along the other, one away, and one into the other.
    for (own, end, other, clashes) in [
        (0.4, 0.4, track(0.0, 0.0), false),
        (0.4, 0.4, still.clone(), false),
        (0.4, 1.4, still.clone(), false),
        (0.4, 0.3, track(0.0, 0.0), true),
    ] {
        let found = clash(
            (&body, &track(own, end)),
            (&body, &other),
            0.0,
            f64::INFINITY,
        );
        assert_eq!(found.is_some(), clashes, "{own} {end} {other:?} {found:?}");
    }
}
