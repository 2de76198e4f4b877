//! Cars, and cars with a trailer: where controls lead, and plans for them.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_4, PI};
use std::sync::Arc;

use fleetyard_abi::sdk::{Planner, Plugin};
use fleetyard_abi::{Footprint, Robot, Status};
use fleetyard_plugin_kinodynamic::course::{CHORD, Course, Segment};
use fleetyard_plugin_kinodynamic::plugin::Team;
use fleetyard_plugin_kinodynamic::plugin::db_astar::DbAstar;
use fleetyard_plugin_kinodynamic::plugin::db_cbs::DbCbs;
use fleetyard_plugin_kinodynamic::plugin::db_lacam::DbLacam;
use fleetyard_plugin_kinodynamic::plugin::sst::Sst;
use fleetyard_plugin_kinodynamic::robot::{self, State};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::plugin::robots::world;
use fleetyard_plugin_plane::sssp::bodies::wrapped;
use proptest::prelude::*;

use super::search::{Said, plan};
use super::tasks::{Problem, rectangle};

/// The car of dynobench, with its trailer or without.
fn car(tows: bool) -> Robot {
    let numbers = if tows { 4 } else { 3 };
    Robot {
        name: String::new(),
        footprint: rectangle(0.5, 0.25),
        dynamics: robot::CARS[usize::from(tows)].to_owned(),
        has_heading: true,
        polar_state: false,
        polar_control: false,
        state_limits: vec![[None; 2]; numbers],
        control_limits: vec![[Some(-0.1), Some(0.5)], [Some(-FRAC_PI_3), Some(FRAC_PI_3)]],
        parameters: [0.25, 0.5, 0.3, 0.25, FRAC_PI_4][..if tows { 5 } else { 1 }].to_vec(),
    }
}

/// Plans of which each is valid and the last is the quickest; its cost.
fn checked(problem: &Problem, said: &Said) -> f64 {
    let world = world(&Arc::new(problem.environment())).unwrap();
    let team = Team::new(&world, &problem.instance, 0.0).unwrap();
    let mut cost = f64::INFINITY;
    for plan in &said.plans {
        let course = |(agent, start): (usize, State)| {
            let segments = plan.of(agent).map(|held| {
                let [speed, steering] = held.control else {
                    panic!("speed and steering: {:?}", held.control);
                };
                assert!((-0.1 - 1e-12..=0.5 + 1e-12).contains(speed));
                assert!(steering.abs() <= FRAC_PI_3 + 1e-12);
                Segment {
                    control: [*speed, 0.0, speed * steering.tan() / 0.25],
                    seconds: held.duration_s,
                }
            });
            let segments = segments.collect();
            Course { start, segments }
        };
        let starts = team.members.iter().map(|member| member.start);
        let courses: Vec<Course> = starts.enumerate().map(course).collect();
        assert_eq!(team.fault(&courses), None, "{problem:?}");
        let own = courses.iter().map(Course::seconds).sum();
        assert!(own < cost, "{own} {cost}");
        cost = own;
    }
    cost
}

/// The cost of a plan that has to be found, and is found again.
fn solved<P: Plugin + Planner>(problem: &Problem, options: &str, nodes: u64) -> f64 {
    let (ended, said) = plan::<P>(problem, options, nodes, false);
    ended.unwrap();
    let again = plan::<P>(problem, options, nodes, false).1;
    assert_eq!(again.plans, said.plans);
    assert!(!said.plans.is_empty());
    checked(problem, &said)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Euler's midpoint rule with steps of a millisecond.
    #[test]
    fn cars_and_trailers_go_where_small_steps_lead(
        heading in -PI..PI, joint in -1.5..1.5_f64, speed in -0.1..0.5_f64, turn in -2.0..2.0_f64, seconds in 0.01..4.0_f64,
    ) {
        let robot = robot::Robot::new(&car(true)).unwrap();
        let control = robot.clamped(&[speed, 0.0, turn]);
        prop_assert!(control[2].abs() <= control[0].abs() * FRAC_PI_3.tan() / 0.25 + 1e-12);
        let start = State { behind: heading - joint, ..State::rest(Vector::new(1.0, 2.0), heading) };
        let steps = (seconds * 1000.0).ceil();
        let h = seconds / steps;
        let (mut own, mut behind) = (heading, start.behind);
        for _ in 0..steps as u32 {
            let middle = behind + 0.5 * h * control[0] / 0.5 * (own - behind).sin();
            behind += h * control[0] / 0.5 * (own + 0.5 * h * control[2] - middle).sin();
            own += h * control[2];
        }
        let led = robot.after(&start, &control, seconds);
        prop_assert!(wrapped(led.behind - behind).abs() < 1e-5, "{led:?} {behind}");
        let half = robot.after(&start, &control, seconds / 3.0);
        let both = robot.after(&half, &control, seconds * 2.0 / 3.0);
        prop_assert!(wrapped(both.behind - led.behind).abs() < 1e-9);
        // What is emitted leads there again.
        let [v, steering] = robot.numbers(&control)[..] else { panic!() };
        prop_assert!((v * steering.tan() / 0.25 - control[2]).abs() < 1e-9);
    }

    #[test]
    fn tracks_of_trailers_stay_beside_their_motions(
        joint in -0.7..0.7_f64, speed in -0.1..0.5_f64, turn in -0.6..0.6_f64, seconds in 0.1..3.0_f64, part in 0.0..1.0_f64,
    ) {
        let robot = robot::Robot::new(&car(true)).unwrap();
        let trailer = robot.trailer().unwrap();
        let control = robot.clamped(&[speed, 0.0, turn]);
        let start = State { behind: -joint, ..State::rest(Vector::zeros(), 0.0) };
        let course = Course { start, segments: vec![Segment { control, seconds }] };
        let track = course.track(&robot).later(3.0);
        let state = robot.after(&start, &control, seconds * part);
        let (own, exact) = (track.trail.unwrap().track.at(3.0 + seconds * part), trailer.pose(state.at, state.behind));
        prop_assert!((own.at - exact.at).norm() < 2.0 * CHORD, "{own:?} {exact:?}");
        prop_assert!((own.heading - exact.heading).abs() < 2.0 * CHORD);
    }
}

#[test]
fn a_car_parks_in_a_bay() {
    let bay: [&[[f64; 2]]; 2] = [
        &[[1.5, 0.0], [2.2, 0.0], [2.2, 0.8], [1.5, 0.8]],
        &[[2.7, 0.0], [3.4, 0.0], [3.4, 0.8], [2.7, 0.8]],
    ];
    // Ahead, and backwards.
    for heading in [-FRAC_PI_2, FRAC_PI_2] {
        let problem =
            Problem::new(4.0, &bay).with(car(false), &[1.0, 2.0, 0.0], &[2.45, 0.4, heading]);
        let cost = solved::<DbAstar>(&problem, "{\"refinements\": 0}", 20_000);
        assert!(cost < 25.0, "{cost}");
    }
    // The heading at the goal does not matter.
    let problem = Problem::new(4.0, &bay).with(car(false), &[1.0, 2.0, 0.0], &[3.4, 3.0, f64::NAN]);
    solved::<DbAstar>(&problem, "{\"refinements\": 0}", 20_000);
}

#[test]
fn a_car_takes_its_trailer_round_a_corner() {
    let shed: [&[[f64; 2]]; 1] = [&[[2.0, 0.0], [2.6, 0.0], [2.6, 1.8], [2.0, 1.8]]];
    let problem = Problem::new(5.0, &shed).within(0.1).with(
        car(true),
        &[1.0, 0.8, 0.0, 0.0],
        &[4.0, 0.8, -FRAC_PI_2, -FRAC_PI_2],
    );
    let with = solved::<DbAstar>(&problem, "{\"refinements\": 0}", 20_000);
    let mut open = problem.clone();
    open.instance.goal_states = [[fleetyard_abi::State(vec![4.0, 0.8, -FRAC_PI_2, f64::NAN])]]
        .into_iter()
        .collect();
    solved::<DbAstar>(&open, "{\"refinements\": 0}", 20_000);
    let bare = Problem::new(5.0, &shed).within(0.1).with(
        car(false),
        &[1.0, 0.8, 0.0],
        &[4.0, 0.8, -FRAC_PI_2],
    );
    let without = solved::<DbAstar>(&bare, "{\"refinements\": 0}", 20_000);
    assert!(without < with, "{without} {with}");
}

/// Two trucks that meet head on, and a car beside them.
fn meeting() -> Problem {
    Problem::new(5.0, &[])
        .within(0.1)
        .with(car(true), &[1.0, 2.5, 0.0, 0.0], &[4.0, 2.6, 0.0, 0.0])
        .with(car(true), &[4.0, 2.5, PI, PI], &[1.0, 2.6, PI, PI])
        .with(car(false), &[2.5, 0.5, FRAC_PI_2], &[2.5, 4.5, FRAC_PI_2])
}

#[test]
fn trucks_that_meet_pass_each_other() {
    solved::<DbCbs>(&meeting(), "{}", 60_000);
    solved::<DbLacam>(&meeting(), "{\"improve\": false}", 2_000);
}

#[test]
fn other_planners_refuse_cars() {
    let problem = Problem::new(5.0, &[]).with(car(false), &[1.0, 1.0, 0.0], &[3.0, 3.0, 0.0]);
    let failure = plan::<Sst>(&problem, "{}", 10, false).0.unwrap_err();
    assert_eq!(failure.status, Status::Unsupported);
    assert!(
        Sst::descriptor()
            .features
            .iter()
            .all(|name| !name.contains("car"))
    );
    assert!(
        DbCbs::descriptor()
            .features
            .contains(&"dynamics:fleetyard.car-trailer/1".to_owned())
    );
    for (parameters, tows) in [
        (vec![], false),
        (vec![0.25], true),
        (vec![0.0], false),
        (vec![0.25, 0.5, 0.3, 0.25, 0.7], false),
    ] {
        let mut odd = car(tows);
        odd.parameters = parameters;
        let problem = Problem::new(5.0, &[]).with(odd, &[1.0, 1.0, 0.0], &[3.0, 3.0, 0.0]);
        let failure = plan::<DbAstar>(&problem, "{}", 10, false).0.unwrap_err();
        assert_eq!(failure.status, Status::Unsupported);
    }
    let mut disc = car(true);
    disc.footprint = Footprint::disc(0.2);
    let problem =
        Problem::new(5.0, &[])
            .within(0.1)
            .with(disc, &[1.0, 1.0, 0.0, 0.0], &[4.0, 3.0, 0.0, 0.0]);
    solved::<DbAstar>(&problem, "{\"refinements\": 0}", 20_000);
}
