//! The planner `k-cbs`.

use fleetyard_abi::{Footprint, Mover, Status};
use fleetyard_plugin_kinodynamic::plugin::k_cbs::KCbs;
use fleetyard_plugin_kinodynamic::robot::DYNAMICS;
use proptest::prelude::*;

use super::super::tasks::{Problem, rectangle};
use super::rrt_star::{DOOR, single};
use super::{ask, asked, of};

/// As the paper has it.
const PAPER: &str = r#"{"rounds": 1, "connect": false}"#;

#[test]
fn problems_of_its_authors_are_solved() {
    for (name, robots, options) in [
        ("corridor", 4, PAPER),
        ("congested", 6, PAPER),
        ("congested", 6, r#"{"rounds": 1}"#),
        (
            "empty",
            10,
            r#"{"rounds": 1, "low_level": "sst", "low_level_controls": 200}"#,
        ),
    ] {
        let problem = Problem::of_k_cbs(name).unwrap();
        let answer = ask::<KCbs>(&problem, options, 2_000_000);
        assert!(answer.plans.len() == 1, "{name}: {:?}", answer.end);
        assert_eq!(answer.plans[0].len(), robots);
    }
}

/// A disc, a rectangle on wheels and one with inertia go through a door in both directions.
#[test]
fn different_robots_pass_a_door_one_after_the_other() {
    let problem = Problem::new(6.0, &DOOR)
        .with(single(0.3), &[1.0, 3.0], &[5.0, 3.0])
        .with(
            of(DYNAMICS[2], rectangle(0.5, 0.3)),
            &[5.0, 2.0, 3.0],
            &[1.0, 2.0, 3.0],
        )
        .with(
            of(DYNAMICS[5], Footprint::disc(0.2)),
            &[5.0, 4.0, 0.0],
            &[1.5, 4.0, 0.0],
        );
    let answer = ask::<KCbs>(&problem, "{}", 60_000);
    assert!(answer.plans.len() > 1, "{:?}", answer.end);
    assert!(answer.count("rounds") > 1);
    let again = ask::<KCbs>(&problem, "{}", 60_000);
    assert_eq!(answer.plans, again.plans);
    let first = ask::<KCbs>(&problem, r#"{"rounds": 1}"#, 60_000);
    assert_eq!(first.plans, answer.plans[..1]);
}

/// Two discs change places in a lane with a bay: whoever waits in it has to be driven there at the same time.
#[test]
fn pairs_that_conflict_too_often_are_merged() {
    let walls: [&[[f64; 2]]; 3] = [
        &[[0.0, 2.0], [6.0, 2.0], [6.0, 0.0], [0.0, 0.0]],
        &[[0.0, 3.0], [2.3, 3.0], [2.3, 6.0], [0.0, 6.0]],
        &[[3.7, 3.0], [6.0, 3.0], [6.0, 6.0], [3.7, 6.0]],
    ];
    let problem = Problem::new(6.0, &walls)
        .with(single(0.35), &[1.0, 2.5], &[5.0, 2.5])
        .with(single(0.35), &[5.0, 2.5], &[1.0, 2.5]);
    let merged = ask::<KCbs>(&problem, r#"{"rounds": 1, "merge_bound": 0}"#, 300_000);
    assert!(!merged.plans.is_empty(), "{:?}", merged.end);
    assert_eq!(merged.count("merges"), 1);
    let apart = ask::<KCbs>(&problem, r#"{"rounds": 1, "merge_bound": null}"#, 300_000);
    assert_eq!(apart.count("merges"), 0);
}

#[test]
fn one_robot_and_none_in_the_way_are_no_problem() {
    let problem = Problem::new(6.0, &[]).with(single(0.3), &[1.0, 1.0], &[4.0, 5.0]);
    let answer = ask::<KCbs>(&problem, r#"{"rounds": 1}"#, 100);
    assert!((answer.cost() - 5.0).abs() < 1e-5, "{}", answer.cost());
    let there = problem.with(single(0.3), &[3.0, 1.0], &[3.0, 1.0]);
    let answer = ask::<KCbs>(&there, "{}", 100);
    assert!((answer.cost() - 5.0).abs() < 1e-5, "{}", answer.cost());
    // Nobody wants to go anywhere.
    let rest = Problem::new(6.0, &[]).with(single(0.3), &[3.0, 1.0], &[3.0, 1.0]);
    assert!(ask::<KCbs>(&rest, "{}", 100).cost() < 1e-12);
}

/// One stands at its goal in a lane that another one has to pass.
#[test]
fn who_is_in_the_way_steps_aside_and_comes_back() {
    let walls: [&[[f64; 2]]; 3] = [
        &[[0.0, 2.0], [6.0, 2.0], [6.0, 0.0], [0.0, 0.0]],
        &[[0.0, 3.0], [2.3, 3.0], [2.3, 6.0], [0.0, 6.0]],
        &[[3.7, 3.0], [6.0, 3.0], [6.0, 6.0], [3.7, 6.0]],
    ];
    let problem = Problem::new(6.0, &walls)
        .with(single(0.35), &[1.0, 2.5], &[5.0, 2.5])
        .with(single(0.35), &[3.0, 2.5], &[3.0, 2.5]);
    let answer = ask::<KCbs>(&problem, r#"{"rounds": 1}"#, 400_000);
    assert!(answer.cost() > 5.0, "{:?}", answer.end);
}

#[test]
fn movers_are_kept_clear_of_and_limits_kept() {
    let mut problem = Problem::new(6.0, &DOOR)
        .with(
            of(DYNAMICS[2], rectangle(0.5, 0.3)),
            &[1.5, 2.0, 0.0],
            &[5.0, 3.0, 0.0],
        )
        .with(single(0.2), &[5.0, 4.0], &[1.0, 4.0]);
    problem.environment.movers.push(Mover {
        footprint: Footprint::disc(0.2),
        knots: vec![
            [0.0, 4.0, 3.0, 0.0],
            [6.0, 2.2, 3.0, 0.0],
            [9.0, 0.5, 3.0, 0.0],
        ],
    });
    let answer = ask::<KCbs>(&problem, r#"{"rounds": 1}"#, 200_000);
    assert!(!answer.plans.is_empty(), "{:?}", answer.end);
    for (nodes, cancelled, status) in [(5, false, Status::GaveUp), (0, true, Status::TimedOut)] {
        let end = asked::<KCbs>(&problem, PAPER, nodes, 1, cancelled).end;
        assert_eq!(end.unwrap_err().status, status);
    }
    let walled = problem.with(single(0.3), &[3.0, 1.0], &[5.0, 1.0]);
    let failure = ask::<KCbs>(&walled, "{}", 50).end.unwrap_err();
    assert_eq!(failure.status, Status::GaveUp);
    assert!(failure.message.contains("agent 2"), "{}", failure.message);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(8))]

    /// Teams of any kinds in a ring, each of which wants to the other side.
    #[test]
    fn plans_of_teams_are_plans(
        kinds in prop::collection::vec((0..DYNAMICS.len(), any::<bool>()), 2..6), seed in any::<u64>(), bound in prop_oneof![Just("null"), Just("0"), Just("3")],
    ) {
        let mut problem = Problem::new(6.0, &[]);
        for (number, (kind, is_disc)) in kinds.iter().enumerate() {
            let angle = number as f64 / kinds.len() as f64 * std::f64::consts::TAU;
            let body = if *is_disc { Footprint::disc(0.2) } else { rectangle(0.5, 0.3) };
            let (x, y) = (2.0 * angle.cos(), 2.0 * angle.sin());
            problem = problem.with(of(DYNAMICS[*kind], body), &[3.0 + x, 3.0 + y, angle], &[3.0 - x, 3.0 - y, angle]);
        }
        let options = format!(r#"{{"merge_bound": {bound}}}"#);
        let plan = || asked::<KCbs>(&problem, &options, 4000, seed, false).plans;
        prop_assert_eq!(plan(), plan());
    }
}
