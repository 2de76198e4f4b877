//! The planner `sst`.

use std::f64::consts::FRAC_PI_2;

use fleetyard_abi::{Footprint, Mover, Status};
use fleetyard_plugin_kinodynamic::plugin::sst::Sst;
use fleetyard_plugin_kinodynamic::robot::DYNAMICS;
use proptest::prelude::*;

use super::super::tasks::{Problem, rectangle};
use super::rrt_star::{DOOR, single};
use super::{ask, asked, of};

/// As the paper has it.
const PAPER: &str = r#"{"connect": false, "prune": false, "n": 4000}"#;

#[test]
fn robots_of_all_kinds_are_driven_through_a_door() {
    for dynamics in DYNAMICS {
        for body in [Footprint::disc(0.2), rectangle(0.5, 0.3)] {
            let problem = Problem::new(6.0, &DOOR).with(
                of(dynamics, body.clone()),
                &[1.5, 1.5, FRAC_PI_2, 0.3, 0.1, 0.1],
                &[4.5, 2.0, -FRAC_PI_2],
            );
            let answer = ask::<Sst>(&problem, "{}", 6000);
            assert!(
                !answer.plans.is_empty(),
                "{dynamics} {body:?}: {:?}",
                answer.end
            );
            let again = ask::<Sst>(&problem, "{}", 6000);
            assert_eq!(answer.plans, again.plans);
        }
    }
}

/// Random controls alone end near a goal, not at it.
#[test]
fn plans_of_random_controls_become_shorter() {
    let problem = |tolerance: f64| {
        Problem::new(6.0, &[])
            .with(
                of(DYNAMICS[2], rectangle(0.5, 0.3)),
                &[1.5, 3.0, 0.0],
                &[4.0, 4.0, 1.0],
            )
            .within(tolerance)
    };
    let costs = [2000, 8000, 30_000].map(|nodes| ask::<Sst>(&problem(0.3), PAPER, nodes).cost());
    assert!(
        costs.is_sorted_by(|one, other| one >= other) && costs[2] < costs[0],
        "{costs:?}"
    );
    let exact = ask::<Sst>(&problem(1e-6), PAPER, 5000);
    assert_eq!(exact.end.unwrap_err().status, Status::GaveUp);
    let led = ask::<Sst>(&problem(1e-6), "{}", 30_000).cost();
    assert!(led < costs[0], "{led} {costs:?}");
}

#[test]
fn a_free_way_is_driven_at_once_and_a_goal_that_is_reached_is_kept() {
    let problem = Problem::new(6.0, &[]).with(single(0.3), &[1.0, 1.0], &[4.0, 5.0]);
    let answer = ask::<Sst>(&problem, "{}", 0);
    assert!((answer.cost() - 5.0).abs() < 1e-5);
    assert_eq!(answer.count("nodes"), 0);
    let there = Problem::new(6.0, &[]).with(single(0.3), &[1.0, 1.0], &[1.0, 1.0]);
    assert!(ask::<Sst>(&there, PAPER, 0).cost() < 1e-12);
    let mut anywhere = Problem::new(6.0, &[]).with(
        of(DYNAMICS[1], Footprint::disc(0.3)),
        &[1.0, 1.0, 0.0, 0.4],
        &[0.0],
    );
    anywhere.instance.goal_states = std::iter::once([]).collect();
    let stopping = ask::<Sst>(&anywhere, "{}", 4000);
    assert!(stopping.cost() < 0.9, "{}", stopping.cost());
}

/// One that comes through the door and stays behind it, and one that crosses the start.
#[test]
fn movers_are_kept_clear_of() {
    let mut problem = Problem::new(6.0, &DOOR).with(
        of(DYNAMICS[2], rectangle(0.5, 0.3)),
        &[1.5, 3.0, 0.0],
        &[5.0, 3.0, 0.0],
    );
    let alone = ask::<Sst>(&problem, "{}", 3000).cost();
    problem.environment.movers.push(Mover {
        footprint: Footprint::disc(0.2),
        knots: vec![
            [0.0, 4.0, 3.0, 0.0],
            [6.0, 2.2, 3.0, 0.0],
            [9.0, 0.5, 3.0, 0.0],
        ],
    });
    problem.environment.movers.push(Mover {
        footprint: Footprint::disc(0.2),
        knots: vec![[0.0, 1.5, 5.5, 0.0], [4.0, 1.5, 0.5, 0.0]],
    });
    let answer = ask::<Sst>(&problem, "{}", 20_000);
    assert!(answer.cost() > alone + 0.5, "{} {alone}", answer.cost());
    // Nobody may rest where a mover comes later.
    problem.environment.movers[1]
        .knots
        .push([40.0, 5.0, 3.0, 0.0]);
    let end = ask::<Sst>(&problem, "{}", 2000).end;
    assert_eq!(end.unwrap_err().status, Status::GaveUp);
}

#[test]
fn limits_are_kept_and_teams_refused() {
    let problem = Problem::new(6.0, &DOOR).with(single(0.3), &[1.0, 1.0], &[5.0, 1.0]);
    let stopped = asked::<Sst>(&problem, PAPER, 0, 1, true);
    assert_eq!(stopped.end.unwrap_err().status, Status::TimedOut);
    let few = ask::<Sst>(&problem, PAPER, 7);
    assert_eq!(few.count("nodes"), 7);
    let team = problem.with(single(0.3), &[1.0, 4.0], &[5.0, 4.0]);
    let refused = ask::<Sst>(&team, "{}", 0).end.unwrap_err();
    assert_eq!(refused.status, Status::Unsupported);
    assert!(
        refused.message.contains("hint: k-cbs"),
        "{}",
        refused.message
    );
    let walled = Problem::new(6.0, &DOOR).with(single(0.3), &[3.0, 1.0], &[5.0, 1.0]);
    assert_eq!(
        ask::<Sst>(&walled, "{}", 50).end.unwrap_err().status,
        Status::GaveUp
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Radii that shrink often, of nodes that come and go.
    #[test]
    fn plans_are_plans_in_any_round(
        kind in 0..DYNAMICS.len(), is_disc in any::<bool>(), seed in any::<u64>(), n in 50..1000_u64, prune in any::<bool>(), connect in any::<bool>(),
    ) {
        let body = if is_disc { Footprint::disc(0.2) } else { rectangle(0.4, 0.4) };
        let problem = Problem::new(6.0, &DOOR).with(of(DYNAMICS[kind], body), &[1.0, 3.5, 0.0], &[5.0, 2.0, 1.0]).within(0.4);
        let options = format!(r#"{{"n": {n}, "xi": 0.9, "prune": {prune}, "connect": {connect}}}"#);
        let plan = || asked::<Sst>(&problem, &options, 4000, seed, false).plans;
        prop_assert_eq!(plan(), plan());
    }
}
