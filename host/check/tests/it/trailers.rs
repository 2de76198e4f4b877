//! Cars with a trailer: the trailer is where it has to be, whatever the car clears.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, FRAC_PI_6};

use fleetyard_check::{ContinuousRule, ContinuousTask, ContinuousVerdict, TrailerTask};
use fleetyard_core::{Knot, TrajectoryPlan};
use fleetyard_world::exact::Obstacles;
use fleetyard_world::{Bounds, Footprint, Polygon, Shape, Trailer, Workspace};

use crate::validated;

fn rectangle(length_m: f64, width_m: f64) -> Shape {
    Footprint::Rectangle { length_m, width_m }.shape().unwrap()
}

/// A car on a circle of a metre about the origin, by two radians to the left, at 0.5 m/s.
fn round() -> TrajectoryPlan {
    let knot = |number: u32| {
        let angle = f64::from(number) * 0.01;
        Knot {
            time_s: 2.0 * angle,
            x_m: angle.cos(),
            y_m: angle.sin(),
            heading_rad: Some(angle + FRAC_PI_2),
        }
    };
    let mut plan = TrajectoryPlan::default();
    plan.push_path((0..=200).map(knot)).unwrap();
    plan
}

/// A world with a box whose far corner is so far from the origin, half right, half ahead.
fn corner(distance_m: f64) -> Workspace {
    let [x, y] = [distance_m / 2f64.sqrt(); 2];
    let corners = [[x - 0.1, y - 0.1], [x, y - 0.1], [x, y], [x - 0.1, y]];
    Workspace {
        bounds: Bounds {
            min: [-3.0; 2],
            max: [3.0; 2],
        },
        name: String::new(),
        boundary: None,
        obstacles: vec![Polygon::new(&corners).unwrap()],
        movers: Vec::new(),
    }
}

/// The trailer begins as it stays on the circle: with a joint of 30°, on a circle of √0.75 m.
fn judged(
    plan: &TrajectoryPlan,
    world: &Workspace,
    change: impl Fn(&mut TrailerTask<'_>),
) -> ContinuousVerdict {
    let (car, trailer) = (rectangle(0.5, 0.25), Trailer::default());
    let body = trailer.shape().unwrap();
    let mut task = TrailerTask {
        trailer,
        shape: &body,
        start_rad: FRAC_PI_3,
        goal_rad: f64::NAN,
    };
    change(&mut task);
    let trailers = [Some(task), None];
    let shapes: Vec<&Shape> = (0..plan.agents()).map(|_| &car).collect();
    let obstacles = Obstacles::workspace(world);
    let task = ContinuousTask {
        trailers: &trailers[..plan.agents()],
        ..ContinuousTask::new(&shapes, &obstacles)
    };
    validated(plan, &task, 10)
}

#[test]
fn a_trailer_cuts_a_corner_that_its_car_clears() {
    let plan = round();
    // Its inner side is so far from the origin; the car's is 0.875 m.
    let side_m = 0.75f64.sqrt() - 0.125;
    for clear_m in [side_m - 0.01, side_m - 1e-4, side_m + 2e-4] {
        let verdict = judged(&plan, &corner(clear_m), |_| {});
        assert!(verdict.valid, "{clear_m}: {:?}", verdict.violations);
    }
    for cut_m in [side_m + 0.001, 0.8, 0.86] {
        let verdict = judged(&plan, &corner(cut_m), |_| {});
        let rules: Vec<ContinuousRule> =
            verdict.violations.iter().map(|found| found.rule).collect();
        assert_eq!(rules, [ContinuousRule::ObstacleContact], "{cut_m}");
        let found = &verdict.violations[0];
        assert!(
            found
                .sentence
                .starts_with("the trailer of agent 0 overlaps obstacle 0 from"),
            "{found}"
        );
        // It is there half a radian and a quarter turn behind its car.
        assert!(
            (found.time_s - 2.0 * (FRAC_PI_6 + FRAC_PI_2 / 2.0)).abs() < 0.8,
            "{found}"
        );
        assert_eq!(found.agents, [0]);
    }
    // Without it nobody is there.
    let obstacles = corner(0.86);
    let (car, obstacles) = (rectangle(0.5, 0.25), Obstacles::workspace(&obstacles));
    let shapes = [&car];
    let alone = ContinuousTask::new(&shapes, &obstacles);
    assert!(validated(&plan, &alone, 10).valid);
}

#[test]
fn a_joint_has_a_limit_and_a_goal() {
    let (plan, free) = (round(), corner(0.1));
    let at_most = |most: f64| judged(&plan, &free, |task| task.trailer.max_joint_rad = most);
    assert!(at_most(FRAC_PI_6).valid);
    let verdict = at_most(FRAC_PI_6 - 1e-5);
    assert_eq!(verdict.violations.len(), 1);
    let found = &verdict.violations[0];
    assert_eq!(found.rule, ContinuousRule::JointLimit);
    assert!(
        found
            .sentence
            .starts_with("agent 0 bends the joint to its trailer by 0.523599 rad"),
        "{found}"
    );
    let excess = found.excess.unwrap();
    assert!((excess.value - FRAC_PI_6).abs() < 1e-9);
    // It stays bent: some place of the circle is told.
    assert!((excess.place_m[0].hypot(excess.place_m[1]) - 1.0).abs() < 1e-9);

    let end = 2.0 + FRAC_PI_3;
    for (goal, valid) in [
        (end, true),
        (end + 2e-6, false),
        (end + std::f64::consts::TAU, true),
    ] {
        let verdict = judged(&plan, &free, |task| task.goal_rad = goal);
        assert_eq!(verdict.valid, valid, "{goal}: {:?}", verdict.violations);
    }
}

/// Behind a car that drives straight on, a trailer misses its goal by nothing, or by what its goal is turned.
#[test]
fn a_trailer_may_miss_its_goal_by_the_tolerance_and_no_more() {
    let mut plan = TrajectoryPlan::default();
    let knot = |time_s: f64| Knot {
        time_s,
        x_m: time_s,
        y_m: 0.0,
        heading_rad: Some(0.0),
    };
    plan.push_path([knot(0.0), knot(1.0)]).unwrap();
    let (car, trailer, free) = (rectangle(0.5, 0.25), Trailer::default(), corner(2.0));
    let (body, obstacles) = (trailer.shape().unwrap(), Obstacles::workspace(&free));
    for (goal_rad, tolerance_rad, valid) in [
        (0.0, 0.0, true),
        (0.25, 0.25, true),
        (0.25, 0.125, false),
        (-0.25, 0.125, false),
    ] {
        let trailers = [Some(TrailerTask {
            trailer,
            shape: &body,
            start_rad: 0.0,
            goal_rad,
        })];
        let shapes = [&car];
        let mut task = ContinuousTask {
            trailers: &trailers,
            ..ContinuousTask::new(&shapes, &obstacles)
        };
        task.tolerance.goal.heading_rad = tolerance_rad;
        let verdict = validated(&plan, &task, 10);
        assert_eq!(verdict.valid, valid, "{:?}", verdict.violations);
        for found in &verdict.violations {
            assert_eq!(
                found.sentence,
                "the trailer of agent 0 ends turned by 0.25 rad"
            );
            assert_eq!((found.rule, found.time_s), (ContinuousRule::WrongGoal, 1.0));
        }
    }
}

#[test]
fn a_trailer_that_begins_nowhere_goes_nowhere() {
    let verdict = judged(&round(), &corner(0.1), |task| task.start_rad = f64::NAN);
    let found = &verdict.violations[0];
    assert_eq!(
        (found.rule, found.time_s),
        (ContinuousRule::OutOfLimits, 0.0)
    );
    assert!(
        found
            .sentence
            .starts_with("the trailer of agent 0 goes nowhere:"),
        "{found}"
    );
}

#[test]
fn trailers_touch_others_but_not_their_cars() {
    let mut plan = round();
    // A second car waits where the trailer comes by, clear of the first one.
    plan.push_path([Knot {
        time_s: 0.0,
        x_m: 0.62,
        y_m: 0.0,
        heading_rad: Some(FRAC_PI_2),
    }])
    .unwrap();
    let free = corner(0.1);
    let verdict = judged(&plan, &free, |_| {});
    assert_eq!(verdict.violations.len(), 1, "{:?}", verdict.violations);
    let found = &verdict.violations[0];
    assert_eq!(
        (found.rule, &found.agents[..]),
        (ContinuousRule::AgentContact, &[0, 1][..])
    );
    assert!(
        found
            .sentence
            .starts_with("agent 1 and the trailer of agent 0 overlap"),
        "{found}"
    );
    // A trailer so near that it is in its car all the time.
    let alone = round();
    let verdict = judged(&alone, &free, |task| {
        task.trailer.hitch_m = 0.2;
        task.start_rad = FRAC_PI_2;
    });
    assert!(verdict.valid, "{:?}", verdict.violations);
}
