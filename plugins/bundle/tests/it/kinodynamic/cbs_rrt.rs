//! Conflict-based search over random trees: constraints, and plans of teams.

use fleetyard_abi::{Footprint, Mover, Robot, State as Numbers, Status};
use fleetyard_plugin_kinodynamic::course::Course;
use fleetyard_plugin_kinodynamic::plugin::Team;
use fleetyard_plugin_kinodynamic::plugin::cbs_rrt::CbsRrt;
use fleetyard_plugin_kinodynamic::rrt::barred::{Barred, Constraint};
use fleetyard_plugin_kinodynamic::rrt::blend::blended;
use fleetyard_plugin_kinodynamic::rrt::edge::Walker;
use fleetyard_plugin_kinodynamic::rrt::overlap::{common_area, common_point};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::plugin::robots::world;
use fleetyard_plugin_plane::sssp::bodies::{Body, Leg, Pose, hits};
use proptest::prelude::*;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

use super::sampling::{Answer, asked};
use super::tasks::{Problem, rectangle, robot};

fn ask(problem: &Problem, options: &str, (nodes, seed): (u64, u64), cancelled: bool) -> Answer {
    asked::<CbsRrt>(problem, options, nodes, seed, cancelled)
}

fn status(answer: &Answer) -> Option<Status> {
    answer.end.as_ref().err().map(|failure| failure.status)
}

fn arrivals(answer: &Answer) -> Vec<f64> {
    let last = answer.plans.last().unwrap();
    last.iter().map(Course::seconds).collect()
}

fn planned(problem: &Problem) -> Answer {
    let answer = ask(problem, "{}", (0, 1), false);
    assert!(answer.end.is_ok(), "{:?}", answer.end);
    answer
}

/// A quadruped: length and width in metres, speed in m/s, change of speed in m/s².
fn quadruped(length: f64, width: f64, speed: f64, change: f64) -> Robot {
    let mut own = robot(
        "fleetyard.holonomic-2/1",
        rectangle(length, width),
        &[speed, speed / 2.0, FRAC_PI_2],
        &[change, change, PI],
    );
    own.state_limits[3][0] = Some(-speed / 2.0);
    own
}

fn go2() -> Robot {
    quadruped(0.70, 0.31, 2.5, 2.5)
}

fn spot() -> Robot {
    quadruped(1.10, 0.50, 1.6, 1.6)
}

fn anymal() -> Robot {
    quadruped(0.93, 0.53, 0.7, 0.75)
}

/// Two walls with a door of 1.6 m between them across a room of 8 m.
const DOOR: [&[[f64; 2]]; 2] = [
    &[[3.9, 0.0], [4.1, 0.0], [4.1, 3.2], [3.9, 3.2]],
    &[[3.9, 4.8], [4.1, 4.8], [4.1, 8.0], [3.9, 8.0]],
];

fn crossing() -> Problem {
    Problem::new(8.0, &DOOR)
        .with(go2(), &[1.0, 1.0, 0.0], &[7.0, 7.0, 1.0])
        .with(spot(), &[7.0, 1.0, 3.0], &[1.0, 7.0, 2.0])
        .with(anymal(), &[1.0, 4.0, 0.0], &[7.0, 4.0, 0.0])
        .with(go2(), &[7.0, 4.0, 0.0], &[1.0, 4.0, 0.0])
}

#[test]
fn quadrupeds_change_sides_through_a_door_and_again_the_same() {
    let answer = planned(&crossing());
    assert_eq!(answer.plans, planned(&crossing()).plans);
    assert_ne!(answer.plans, ask(&crossing(), "{}", (0, 2), false).plans);
}

/// Round a corner it slows down at most.
#[test]
fn a_quadruped_does_not_stop_where_it_need_not() {
    let wall: &[&[[f64; 2]]] = &[&[[3.0, 0.0], [5.0, 0.0], [5.0, 6.0], [3.0, 6.0]]];
    let problem = Problem::new(8.0, wall).with(go2(), &[1.0, 1.0, 1.5], &[7.0, 1.0, -1.5]);
    let [stopping, going] = ["false", "true"].map(|blend| {
        let options = format!(r#"{{"blend": {blend}}}"#);
        arrivals(&ask(&problem, &options, (0, 1), false))[0]
    });
    assert!(going < stopping - 0.3, "{going} {stopping}");
}

#[test]
fn the_papers_form_changes_sides_as_well() {
    let options = r#"{"avoid": false, "widen": false, "rounds": 0}"#;
    let answer = ask(&crossing(), options, (0, 1), false);
    assert!(answer.end.is_ok(), "{:?}", answer.end);
    assert_eq!(answer.plans.len(), 1);
}

#[test]
fn robots_of_all_dynamics_plan_together() {
    let disc = Footprint::disc(0.25);
    let problem = Problem::new(8.0, &DOOR)
        .with(
            robot(
                "fleetyard.unicycle/1",
                rectangle(0.5, 0.3),
                &[0.8, 1.0],
                &[],
            ),
            &[1.0, 1.0, 0.0],
            &[7.0, 7.0, 0.0],
        )
        .with(
            robot(
                "fleetyard.unicycle-2/1",
                rectangle(0.5, 0.3),
                &[0.8, 1.0],
                &[0.5, 0.5],
            ),
            &[7.0, 7.0, 0.0],
            &[1.0, 1.0, 0.0],
        )
        .with(
            robot(
                "fleetyard.single-integrator/1",
                disc.clone(),
                &[1.0, 1.0],
                &[],
            ),
            &[1.0, 4.0],
            &[7.0, 4.0],
        )
        .with(
            robot(
                "fleetyard.double-integrator/1",
                disc,
                &[1.0, 1.0],
                &[0.5, 0.5],
            ),
            &[7.0, 4.0],
            &[1.0, 4.0],
        )
        .with(
            robot(
                "fleetyard.holonomic/1",
                rectangle(0.7, 0.4),
                &[1.0, 0.5, 1.0],
                &[],
            ),
            &[1.0, 7.0, 0.0],
            &[7.0, 1.0, 2.0],
        )
        .with(go2(), &[7.0, 1.0, 0.0], &[1.0, 7.0, 1.0]);
    planned(&problem);
}

#[test]
fn a_robot_at_its_goal_stays_unless_somebody_has_to_pass() {
    let alone = Problem::new(8.0, &[]).with(go2(), &[2.0, 2.0, 1.0], &[2.0, 2.0, 1.0]);
    assert_eq!(arrivals(&planned(&alone)), [0.0]);
    // In the door, which the other one has to go through.
    let both = Problem::new(8.0, &DOOR)
        .with(go2(), &[4.0, 4.0, 1.57], &[4.0, 4.0, 1.57])
        .with(spot(), &[1.0, 4.0, 0.0], &[7.0, 4.0, 0.0]);
    let arrivals = arrivals(&planned(&both));
    assert!(arrivals[0] > 2.0, "{arrivals:?}");
}

#[test]
fn a_robot_without_a_goal_makes_room() {
    let mut problem = Problem::new(8.0, &DOOR)
        .with(go2(), &[4.0, 4.0, 1.57], &[4.0, 4.0, 1.57])
        .with(spot(), &[1.0, 4.0, 0.0], &[7.0, 4.0, 0.0]);
    let goal = problem.instance.goal_states.get(1).unwrap().to_vec();
    problem.instance.goal_states = fleetyard_abi::Lists::default();
    problem.instance.goal_states.push([]);
    problem.instance.goal_states.push(goal);
    let arrivals = arrivals(&planned(&problem));
    assert!(arrivals[0] > 0.0 && arrivals[1] > 4.0, "{arrivals:?}");
}

#[test]
fn starts_and_goals_may_touch_others_and_walls() {
    let problem = Problem::new(8.0, &DOOR)
        .with(spot(), &[0.55, 0.25, 0.0], &[7.45, 7.75, 0.0])
        .with(spot(), &[0.55, 0.75, 0.0], &[7.45, 7.25, 0.0])
        .with(go2(), &[0.55 + 0.9, 0.25, 0.0], &[7.45 - 0.9, 7.75, 0.0]);
    planned(&problem);
}

#[test]
fn movers_are_given_way() {
    let mut problem = Problem::new(8.0, &DOOR).with(go2(), &[1.0, 4.0, 0.0], &[7.0, 4.0, 0.0]);
    let free = arrivals(&planned(&problem))[0];
    problem.environment.movers.push(Mover {
        footprint: Footprint::disc(0.5),
        knots: vec![
            [0.0, 7.0, 4.0, 0.0],
            [12.0, 4.0, 4.0, 0.0],
            [14.0, 4.0, 7.0, 0.0],
            [15.0, 2.0, 7.0, 0.0],
        ],
    });
    let behind = arrivals(&planned(&problem))[0];
    assert!(free < 7.0 && behind > 12.0, "{free} {behind}");
}

#[test]
fn who_is_moving_brakes_first() {
    let mut problem = Problem::new(8.0, &[]).with(go2(), &[1.0, 1.0, 0.0], &[1.0, 1.0, 0.0]);
    problem.instance.start_states[0] = Numbers(vec![1.0, 1.0, 0.0, 1.0, 0.5, 0.3]);
    let answer = planned(&problem);
    let first = answer.plans[0][0].segments[0];
    assert!(first.control[0] < 0.0 && first.control[1] < 0.0 && first.control[2] < 0.0);
    // It cannot.
    problem.instance.robots[0].control_limits[0] = [Some(0.0), Some(1.0)];
    let answer = ask(&problem, "{}", (0, 1), false);
    assert_eq!(status(&answer), Some(Status::GaveUp), "{:?}", answer.end);
}

#[test]
fn limits_may_be_missing_and_tolerances_zero() {
    let mut problem = Problem::new(8.0, &DOOR).with(go2(), &[1.0, 4.0, 0.0], &[7.0, 4.0, 1.0]);
    problem.instance.robots[0].control_limits = vec![[None; 2]; 3];
    problem.instance.robots[0].state_limits = vec![[None; 2]; 6];
    planned(&problem);
    let answer = ask(&problem.within(0.0), "{}", (200, 1), false);
    assert!(
        answer.end.is_ok()
            || status(&answer) == Some(Status::TimedOut)
            || status(&answer) == Some(Status::GaveUp)
    );
}

#[test]
fn who_cannot_get_there_gives_up_and_says_who() {
    let walled = Problem::new(8.0, &[&[[3.9, 0.0], [4.1, 0.0], [4.1, 8.0], [3.9, 8.0]]])
        .with(go2(), &[1.0, 1.0, 0.0], &[2.0, 2.0, 0.0])
        .with(go2(), &[1.0, 4.0, 0.0], &[7.0, 4.0, 0.0]);
    let answer = ask(&walled, r#"{"samples": 100}"#, (0, 1), false);
    let failure = answer.end.unwrap_err();
    assert_eq!(failure.status, Status::GaveUp);
    assert!(failure.message.contains("agent 1"), "{}", failure.message);
}

#[test]
fn it_stops_when_told_and_at_the_limit() {
    let answer = ask(&crossing(), "{}", (0, 1), true);
    assert_eq!(status(&answer), Some(Status::TimedOut));
    let answer = ask(&crossing(), "{}", (3, 1), false);
    assert_eq!(status(&answer), Some(Status::GaveUp));
    assert!(answer.count("nodes") <= 3);
}

fn pose() -> impl Strategy<Value = Pose> {
    (-1.0..1.0, -1.0..1.0, -3.0..3.0).prop_map(|(x, y, heading)| Pose {
        at: Vector::new(x, y),
        heading,
    })
}

fn long(length: f64, width: f64) -> Body {
    let (x, y) = (length / 2.0, width / 2.0);
    Body {
        radius: x.hypot(y),
        corners: [[x, y], [-x, y], [-x, -y], [x, -y]]
            .map(|[x, y]| Vector::new(x, y))
            .to_vec(),
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn a_common_point_is_in_both_bodies(one in pose(), other in pose(), is_disc: bool) {
        let disc = Body { radius: 0.4, corners: Vec::new() };
        let (a, b) = (long(1.1, 0.5), if is_disc { disc } else { long(0.7, 0.3) });
        if common_area((&a, &one), (&b, &other)) > 1e-6 {
            let point = common_point((&a, &one), (&b, &other));
            let at = Pose { at: point, heading: 0.0 };
            let dot = Body { radius: 1e-6, corners: Vec::new() };
            prop_assert!(hits(&a, &Leg::rest(one, 1.0), &dot, &at));
            prop_assert!(hits(&b, &Leg::rest(other, 1.0), &dot, &at));
        }
    }

    #[test]
    fn two_motions_in_one_end_where_both_did_and_sooner(one in pose(), two in pose(), three in pose()) {
        let shift = |pose: Pose| Pose { at: pose.at + Vector::new(4.0, 4.0), ..pose };
        let poses = [shift(one), shift(two), shift(three)];
        let numbers = |pose: &Pose| [pose.at.x, pose.at.y, pose.heading];
        let problem = Problem::new(8.0, &[]).with(anymal(), &numbers(&poses[0]), &numbers(&poses[2]));
        let environment = Arc::new(problem.environment());
        let world = world(&environment).unwrap();
        let team = Team::new(&world, &problem.instance, 1e-3).unwrap();
        let walkers: Vec<Walker> = Walker::team(&team).into_iter().flatten().collect();
        let first = walkers[0].edge(&walkers[0].root, &poses[1], false).unwrap();
        let second = walkers[0].edge(&first.end, &poses[2], false).unwrap();
        let Some(both) = blended(&walkers[0], &first, &second) else {
            return Ok(());
        };
        let course = Course { start: walkers[0].root, segments: both.segments.clone() };
        prop_assert!(course.is_allowed(&team.members[0].robot) && team.members[0].goal.is_reached(&course.end(&team.members[0].robot)));
        prop_assert!(both.seconds < first.seconds + second.seconds);
        // And once more from where that ends.
        let back = walkers[0].edge(&both.end, &poses[1], false).unwrap();
        if let Some(all) = blended(&walkers[0], &both, &back) {
            let course = Course { start: walkers[0].root, segments: all.segments.clone() };
            let end = course.end(&team.members[0].robot);
            prop_assert!((end.at - poses[1].at).norm() < 1e-9 && end.rates.iter().all(|rate| rate.abs() < 1e-9), "{end:?}");
        }
    }

    /// Beside poses every hundredth of a second.
    #[test]
    fn a_departure_keeps_the_footprint_off_a_point_in_its_time(
        from in pose(), to in pose(), (x, y) in (-1.0..1.0, -1.0..1.0), begin in 0.0..4.0_f64, length in 0.1..3.0_f64,
    ) {
        let shift = |pose: Pose| Pose { at: pose.at + Vector::new(4.0, 4.0), ..pose };
        let (from, to) = (shift(from), shift(to));
        let numbers = |pose: &Pose| [pose.at.x, pose.at.y, pose.heading];
        let problem = Problem::new(8.0, &[]).with(spot(), &numbers(&from), &numbers(&to));
        let environment = Arc::new(problem.environment());
        let world = world(&environment).unwrap();
        let team = Team::new(&world, &problem.instance, 1e-3).unwrap();
        let walkers: Vec<Walker> = Walker::team(&team).into_iter().flatten().collect();
        let walker = &walkers[0];
        let constraint = Constraint { point: Vector::new(x + 4.0, y + 4.0), from: begin, to: begin + length };
        let barred = Barred { body: &walker.body, constraints: vec![constraint], moving: Vec::new() };
        let Some(edge) = walker.edge(&walker.root, &to, false) else {
            return Ok(());
        };
        let at = Pose { at: constraint.point, heading: 0.0 };
        let dot = Body { radius: 0.0, corners: Vec::new() };
        let contains = |pose: Pose| hits(&team.members[0].robot.body, &Leg::rest(pose, 1.0), &dot, &at);
        let stay = barred.stay(&from, 0.0);
        let Some((departure, end)) = stay.and_then(|stay| barred.depart(&stay, &edge, 0.0)) else {
            return Ok(());
        };
        let track = edge.track_at(departure);
        for step in 0..=((length / 0.01) as u32) {
            let time = begin + f64::from(step) * 0.01;
            if time < end.until {
                prop_assert!(!contains(track.at(time)), "at {time} s");
            }
        }
        // The last stay that has no end begins after all constraints of its place.
        let free = barred.free_from(&to).unwrap();
        prop_assert!(free <= begin + length && barred.stay(&to, free + 1e-9).is_some_and(|stay| stay.until == f64::INFINITY));
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// All that comes of it is asserted by [`ask`].
    #[test]
    fn random_teams_get_plans_or_it_gives_up(seed in 0_u64..1000, count in 1_usize..7, avoid: bool) {
        let mut random = fleetyard_plugin_spacetime::random::Random::new(seed, 0);
        let mut problem = Problem::new(8.0, &DOOR);
        for number in 0..count {
            let kinds = [go2(), spot(), anymal(), robot("fleetyard.unicycle/1", rectangle(0.5, 0.3), &[0.8, 1.0], &[])];
            let own = kinds[random.below(4)].clone();
            // Places in columns, so that none overlap.
            let x = if random.one_in(2) { 1.0 } else { 7.0 };
            let mut end = |x: f64| [x, 0.8 + number as f64 * 1.25, (random.share() - 0.5) * 6.0];
            let (start, goal) = (end(x), end(8.0 - x));
            problem = problem.with(own, &start, &goal);
        }
        let options = format!(r#"{{"avoid": {avoid}, "restart_nodes": 20, "restarts": 3}}"#);
        let answer = ask(&problem, &options, (2000, seed), false);
        if let Err(failure) = &answer.end {
            prop_assert!([Status::GaveUp, Status::TimedOut].contains(&failure.status), "{failure:?}");
        }
    }
}
