//! The planner `rrt-star`.

use std::f64::consts::{FRAC_PI_2, PI};

use fleetyard_abi::{Footprint, Mover, Status};
use fleetyard_plugin_kinodynamic::plugin::rrt_star::RrtStar;
use fleetyard_plugin_kinodynamic::robot::DYNAMICS;
use proptest::prelude::*;

use super::super::tasks::{Problem, rectangle, robot};
use super::{ask, asked, of};

/// A wall with a door of 0.8 m in its middle, in a world of 6 by 6 m.
pub(super) const DOOR: [&[[f64; 2]]; 2] = [
    &[[2.9, 0.0], [3.1, 0.0], [3.1, 2.6], [2.9, 2.6]],
    &[[2.9, 3.4], [3.1, 3.4], [3.1, 6.0], [2.9, 6.0]],
];

const BLOCK: &[[f64; 2]] = &[[2.5, 1.0], [3.5, 1.0], [3.5, 4.0], [2.5, 4.0]];

pub(super) fn single(radius: f64) -> fleetyard_abi::Robot {
    robot(DYNAMICS[0], Footprint::disc(radius), &[1.0, 1.0], &[])
}

#[test]
fn ways_approach_the_shortest_one() {
    let problem = Problem::new(6.0, &[BLOCK]).with(single(0.3), &[1.0, 2.0], &[5.0, 2.0]);
    // Below the block: two tangents, two arcs, and its lower edge.
    let (square, radius): (f64, f64) = (1.5 * 1.5 + 1.0, 0.3);
    let tangent = (square - radius * radius).sqrt();
    let rise = 1.0_f64.atan2(1.5) + radius.atan2(tangent);
    let shortest = 2.0 * (tangent + radius * rise) + 1.0;
    for informed in [true, false] {
        let options = format!(
            r#"{{"informed": {informed}, "shorten": false, "clearance_m": 0.0, "rewire_factor": 3.0}}"#
        );
        let cost = ask::<RrtStar>(&problem, &options, 10_000).cost();
        assert!(
            cost >= shortest && cost < shortest * 1.01,
            "{cost} s, {shortest} s at best"
        );
    }
    let few = ask::<RrtStar>(&problem, r#"{"shorten": false}"#, 300);
    assert_eq!(few.count("nodes"), 300);
    assert!(few.cost() > shortest * 1.002);
}

#[test]
fn robots_of_all_kinds_pass_a_door() {
    for dynamics in DYNAMICS {
        for body in [Footprint::disc(0.25), rectangle(0.9, 0.4)] {
            let problem = Problem::new(6.0, &DOOR)
                .with(
                    of(dynamics, body.clone()),
                    &[1.0, 1.0, FRAC_PI_2, 0.3, 0.1, 0.1],
                    &[5.0, 1.2, -FRAC_PI_2],
                )
                .within(0.0);
            let answer = ask::<RrtStar>(&problem, "{}", 4000);
            assert!(
                !answer.plans.is_empty(),
                "{dynamics} {body:?}: {:?}",
                answer.end
            );
            let again = ask::<RrtStar>(&problem, "{}", 4000);
            assert_eq!(answer.plans, again.plans);
        }
    }
}

#[test]
fn a_free_way_is_driven_at_once() {
    // Sums of sides: a robot without a heading, one that turns on its way, and one that turns longer than it drives.
    let straight = Problem::new(6.0, &[]).with(single(0.3), &[1.0, 1.0], &[4.0, 5.0]);
    let answer = ask::<RrtStar>(&straight, "{}", 0);
    assert!((answer.cost() - 5.0).abs() < 1e-9);
    assert!(answer.count("nodes") < 1000);
    for (turn, seconds) in [(2.0, 5.0), (3.0, 6.0)] {
        let turning = robot(DYNAMICS[0], Footprint::disc(0.3), &[1.0, 1.0, 0.5], &[]);
        let problem =
            Problem::new(6.0, &[]).with(turning, &[1.0, 1.0, 0.5], &[4.0, 5.0, 0.5 - turn]);
        let answer = ask::<RrtStar>(&problem, "{}", 0);
        assert!((answer.cost() - seconds).abs() < 1e-9, "{}", answer.cost());
    }
}

#[test]
fn who_is_at_the_goal_stays() {
    let there = Problem::new(6.0, &[]).with(single(0.3), &[1.0, 1.0], &[1.0, 1.0]);
    assert!(ask::<RrtStar>(&there, "{}", 0).cost() < 1e-12);
    let near = Problem::new(6.0, &[])
        .with(single(0.3), &[1.0, 1.0], &[1.1, 1.0])
        .within(0.2);
    assert!(ask::<RrtStar>(&near, "{}", 0).cost() < 1e-12);
    let mut anywhere = Problem::new(6.0, &[]).with(
        of(DYNAMICS[1], Footprint::disc(0.3)),
        &[1.0, 1.0, 0.0, 0.5, 0.0, 0.0],
        &[0.0; 3],
    );
    anywhere.instance.goal_states = std::iter::once([]).collect();
    // It only has to stop.
    let stopping = ask::<RrtStar>(&anywhere, "{}", 0);
    assert!((stopping.cost() - 1.0).abs() < 1e-9, "{}", stopping.cost());
}

#[test]
fn a_heading_that_does_not_matter_is_chosen() {
    let long = rectangle(1.2, 0.3);
    let goal = |heading: f64| {
        Problem::new(6.0, &DOOR).with(
            of(DYNAMICS[2], long.clone()),
            &[1.0, 3.0, 0.0],
            &[5.0, 3.0, heading],
        )
    };
    let [free, turned] = [f64::NAN, PI * 0.9].map(|heading| {
        let answer = ask::<RrtStar>(&goal(heading), "{}", 3000);
        answer.cost()
    });
    assert!(free < turned - 0.5, "{free} {turned}");
}

#[test]
fn limits_and_what_nobody_can_do_are_told() {
    let closed = [&[[2.9, 0.0], [3.1, 0.0], [3.1, 6.0], [2.9, 6.0]] as &[_]];
    let across = |obstacles: &[&[[f64; 2]]]| {
        Problem::new(6.0, obstacles).with(single(0.3), &[1.0, 2.0], &[5.0, 2.0])
    };
    let status = |problem: &Problem, nodes| {
        let failure = ask::<RrtStar>(problem, "{}", nodes).end.unwrap_err();
        (failure.status, failure.message)
    };
    assert_eq!(status(&across(&closed), 500).0, Status::GaveUp);
    assert_eq!(status(&across(&[BLOCK]), 2).0, Status::GaveUp);
    let stopped = asked::<RrtStar>(&across(&[BLOCK]), "{}", 0, 1, true);
    assert_eq!(stopped.end.unwrap_err().status, Status::TimedOut);
    // In the wall, and beside the world.
    for goal in [[3.0, 2.0], [7.0, 2.0]] {
        let blocked = Problem::new(6.0, &closed).with(single(0.3), &[1.0, 2.0], &goal);
        assert_eq!(status(&blocked, 500).0, Status::GaveUp);
        let blocked = Problem::new(6.0, &closed).with(single(0.3), &goal, &[1.0, 2.0]);
        assert_eq!(status(&blocked, 500).0, Status::GaveUp);
    }
    let stiff = robot(DYNAMICS[0], Footprint::disc(0.3), &[1.0, 1.0, 0.0], &[]);
    let stiff = Problem::new(6.0, &[]).with(stiff, &[1.0, 1.0, 0.0], &[4.0, 1.0, 1.0]);
    assert_eq!(status(&stiff, 500).0, Status::GaveUp);
    let team = across(&[]).with(single(0.3), &[1.0, 4.0], &[5.0, 4.0]);
    let (refused, message) = status(&team, 0);
    assert!(
        refused == Status::Unsupported && message.contains("hint: sssp"),
        "{message}"
    );
    let mut crossed = across(&[]);
    crossed.environment.movers.push(Mover {
        footprint: Footprint::disc(0.2),
        knots: vec![[0.0, 3.0, 1.0, 0.0], [5.0, 3.0, 5.0, 0.0]],
    });
    let (refused, message) = status(&crossed, 0);
    assert!(
        refused == Status::Unsupported && message.contains("hint: sst"),
        "{message}"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(12))]

    /// Whatever lies around, a plan is one, and the same seed gives the same.
    #[test]
    fn plans_among_boxes_are_plans(
        boxes in prop::collection::vec((0.5..5.5, 0.5..5.5, 0.1..1.5, 0.1..1.5), 0..6),
        kind in 0..DYNAMICS.len(), is_disc in any::<bool>(), seed in any::<u64>(), touches in any::<bool>(),
    ) {
        let corners: Vec<[[f64; 2]; 4]> = boxes
            .iter()
            .map(|(x, y, width, height): &(f64, f64, f64, f64)| {
                [[x - width / 2.0, y - height / 2.0], [x + width / 2.0, y - height / 2.0], [x + width / 2.0, y + height / 2.0], [x - width / 2.0, y + height / 2.0]]
            })
            .collect();
        let obstacles: Vec<&[[f64; 2]]> = corners.iter().map(|corners| &corners[..]).collect();
        let body = if is_disc { Footprint::disc(0.2) } else { rectangle(0.4, 0.4) };
        // In the corner it may touch both sides of the world.
        let corner = if touches { 0.2 } else { 0.3 };
        let problem = Problem::new(6.0, &obstacles).with(of(DYNAMICS[kind], body), &[corner, corner, 0.0], &[5.6, 5.5, 1.0]);
        let plan = || asked::<RrtStar>(&problem, "{}", 600, seed, false).plans;
        prop_assert_eq!(plan(), plan());
    }
}
