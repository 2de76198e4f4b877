//! Plans in continuous space and time.

use std::f64::consts::TAU;

use fleetyard_check::{
    ContinuousRule, ContinuousTask, ContinuousVerdict, ContinuousViolation, Near, Tolerance,
};
use fleetyard_core::{Grid, GridInstance, GridPlan, Knot, TrajectoryPlan};
use fleetyard_world::exact::Obstacles;
use fleetyard_world::{
    Boundary, Bounds, Dynamics, Footprint, Polygon, Pose, Shape, Travel, Workspace,
};
use proptest::prelude::*;

use crate::validated;

fn disc(radius_m: f64) -> Shape {
    Footprint::Disc { radius_m }.shape().unwrap()
}

fn plan(paths: &[&[(f64, f64, f64, f64)]]) -> TrajectoryPlan {
    let mut plan = TrajectoryPlan::default();
    for path in paths {
        let knots = path.iter().map(|(time_s, x_m, y_m, heading)| Knot {
            time_s: *time_s,
            x_m: *x_m,
            y_m: *y_m,
            heading_rad: Some(*heading),
        });
        plan.push_path(knots).unwrap();
    }
    plan
}

fn sentences(verdict: &ContinuousVerdict) -> Vec<&str> {
    let all = verdict.violations.iter();
    all.map(|violation| violation.sentence.as_str()).collect()
}

#[test]
fn every_rule() {
    let footprint = Footprint::Rectangle {
        length_m: 1.0,
        width_m: 0.5,
    };
    let rectangle = footprint.shape().unwrap();
    let shapes = [&rectangle, &rectangle];
    let workspace = Workspace {
        name: String::new(),
        bounds: Bounds {
            min: [0.0, 0.0],
            max: [10.0, 10.0],
        },
        boundary: None,
        obstacles: vec![Polygon::rectangle([5.0, 5.0], [1.0, 1.0], 0.0).unwrap()],
        movers: Vec::new(),
    };
    let obstacles = Obstacles::workspace(&workspace);
    let good = plan(&[
        &[(0.0, 1.0, 1.0, 0.0), (4.0, 9.0, 1.0, 0.0)],
        &[
            (0.0, 1.0, 2.0, 0.0),
            (4.0, 9.0, 2.0, 0.0),
            (4.2, 9.0, 2.0, 0.15),
            (5.1, 9.0, 2.0, 1.5),
            (6.1, 9.0, 2.0, 1.5),
        ],
    ]);
    let starts = [Pose::at(1.0, 1.0), Pose::at(1.0, 2.0)];
    let goals = [Pose::new(9.0, 1.0, TAU), Pose::new(9.0, 2.0, 1.5)];
    let limits = [Dynamics {
        travel: Travel::Polar {
            speed: 2.0,
            acceleration: f64::INFINITY,
        },
        turn_rad_per_s: 1.5,
        turn_acceleration_rad_per_s2: 15.0,
        curvature_rad_per_m: f64::INFINITY,
    }; 2];
    let task = ContinuousTask {
        starts: Some(&starts),
        goals: Some(&goals),
        limits: Some(&limits),
        ..ContinuousTask::new(&shapes, &obstacles)
    };
    let verdict = validated(&good, &task, 10);
    assert_eq!(sentences(&verdict), [""; 0]);
    assert!(verdict.valid);
    assert!((verdict.checked_until_s - 6.1).abs() < 1e-12);

    let bad = plan(&[
        &[(0.0, 1.0, 1.5, 0.0), (4.0, 5.0, 5.0, 0.0)],
        &[
            (0.0, 1.0, 2.0, 0.0),
            (2.0, 9.0, 2.0, 0.0),
            (3.0, 9.75, 2.0, 3.0),
        ],
    ]);
    let verdict = validated(&bad, &task, 10);
    assert!(!verdict.valid);
    assert_eq!(
        sentences(&verdict),
        [
            "agent 0 begins 0.5 m from its start",
            "agent 1 moves at 4 m/s, faster than 2 m/s, from 0 s on, in [1, 2]",
            "agents 0 and 1 overlap from 0.0000011428571428571428 s to 0.333333 s",
            "agent 1 turns at 3 rad/s, faster than 1.5 rad/s, from 2 s on, in [9, 2]",
            "agent 1 changes its turn rate by 30 rad/s², more than 15 rad/s², at 2 s, in [9, 2]",
            "agent 1 reaches over the bounds from 2.704087739031907 s on",
            "agent 1 ends 0.75 m from its goal",
            "agent 0 overlaps obstacle 0 from 3.1428582857142855 s on",
            "agent 0 ends 5.656854249492381 m from its goal",
        ]
    );
}

/// The double integrator has 0.5 m/s and 2 m/s² along each axis.
#[test]
fn an_instant_reversal_and_too_fast_an_axis_are_refused() {
    let disc = disc(0.1);
    let none = Obstacles::none();
    let limits = [Dynamics {
        travel: Travel::Axes {
            speed: 0.5,
            acceleration: 2.0,
        },
        turn_rad_per_s: f64::INFINITY,
        turn_acceleration_rad_per_s2: f64::INFINITY,
        curvature_rad_per_m: f64::INFINITY,
    }];
    let shapes = [&disc];
    let task = ContinuousTask {
        limits: Some(&limits),
        ..ContinuousTask::new(&shapes, &none)
    };
    // Speeds along x in steps of a tenth of a second, from rest to rest.
    let driven = |speeds: &[f64]| {
        let mut path = vec![(0.0, 0.0, 0.0, 0.0)];
        for (at, speed) in speeds.iter().enumerate() {
            let x = path[at].1 + 0.1 * speed;
            path.push((0.1 * (at + 1) as f64, x, 0.0, 0.0));
        }
        validated(&plan(&[&path]), &task, 10)
    };
    assert!(driven(&[0.2, 0.4, 0.5, 0.5, 0.4, 0.2]).valid);
    let reversal = driven(&[0.2, 0.4, 0.5, -0.5, -0.4, -0.2]);
    let found = &reversal.violations[..];
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!(found[0].rule, ContinuousRule::TooSudden);
    let excess = found[0].excess.expect("a limit");
    assert!((excess.value - 10.0).abs() < 1e-9 && (excess.limit - 2.0).abs() < 1e-12);
    assert!((excess.place_m[0] - 0.11).abs() < 1e-12 && (found[0].time_s - 0.3).abs() < 1e-12);
    let fast = driven(&[0.2, 0.4, 0.6, 0.6, 0.4, 0.2]);
    assert_eq!(fast.violations.len(), 1, "{:?}", fast.violations);
    assert_eq!(fast.violations[0].rule, ContinuousRule::TooFast);
    let json = serde_json::to_value(&fast.violations[0]).unwrap();
    assert_eq!(json["rule"], "too-fast");
    assert_eq!(json["limit"], 0.5);
    assert_eq!(
        serde_json::from_value::<ContinuousViolation>(json).unwrap(),
        fast.violations[0]
    );
}

/// Ω of GRACE: an L whose notch no box tells.
#[test]
fn the_edge_of_a_world_is_kept_at_all_times() {
    let corners = [
        [0.0, 0.0],
        [6.0, 0.0],
        [6.0, 2.0],
        [2.0, 2.0],
        [2.0, 6.0],
        [0.0, 6.0],
    ];
    let boundary = Boundary::new(&corners).unwrap();
    let workspace = Workspace {
        name: String::new(),
        bounds: boundary.polygon().bounds(),
        boundary: Some(boundary),
        obstacles: Vec::new(),
        movers: Vec::new(),
    };
    let obstacles = Obstacles::workspace(&workspace);
    let disc = disc(0.5);
    let shapes = [&disc];
    let task = ContinuousTask::new(&shapes, &obstacles);
    let around = plan(&[&[
        (0.0, 5.0, 1.0, 0.0),
        (4.0, 1.0, 1.0, 0.0),
        (8.0, 1.0, 5.0, 0.0),
    ]]);
    assert!(validated(&around, &task, 10).valid);
    // Straight through the notch, in and out again.
    let across = plan(&[&[(0.0, 5.0, 1.0, 0.0), (4.0, 1.0, 5.0, 0.0)]]);
    let verdict = validated(&across, &task, 10);
    assert_eq!(verdict.violations.len(), 1, "{:?}", verdict.violations);
    let found = &verdict.violations[0];
    assert_eq!(found.rule, ContinuousRule::OutOfBounds);
    // It touches y = 2 with its upper side at y = 1.5, and x = 2 likewise.
    assert!((found.time_s - 0.5).abs() < 1e-5, "{found:?}");
    assert!(
        found.end_s.is_some_and(|end| (end - 3.5).abs() < 1e-5),
        "{found:?}"
    );
    // Far beyond, in the notch and out of the box.
    let away = plan(&[&[(0.0, 5.0, 1.0, 0.0), (1.0, 500.0, 100.0, 0.0)]]);
    let verdict = validated(&away, &task, 10);
    assert_eq!(verdict.violations.len(), 1);
    assert_eq!(verdict.violations[0].end_s, None);
}

#[test]
fn the_first_conflict_comes_first() {
    let disc = disc(0.5);
    // Agents 1 and 2 meet at 1 s, agents 0 and 1 at 9 s.
    let plan = plan(&[
        &[(0.0, 0.0, 0.0, 0.0)],
        &[(0.0, 10.0, 0.0, 0.0), (10.0, 0.0, 0.0, 0.0)],
        &[
            (0.0, 8.0, 0.0, 0.0),
            (0.5, 8.0, 0.0, 0.0),
            (0.9, 8.0, -4.0, 0.0),
        ],
        &[
            (0.0, 8.0, 9.0, 0.0),
            (1.0, 8.0, 0.0, 0.0),
            (1.1, 8.0, 9.0, 0.0),
        ],
    ]);
    let shapes = [&disc; 4];
    let none = Obstacles::none();
    let task = ContinuousTask::new(&shapes, &none);
    let first = validated(&plan, &task, 1);
    assert_eq!(first.violations.len(), 1);
    assert_eq!(first.violations[0].rule, ContinuousRule::AgentContact);
    assert_eq!(first.violations[0].agents, [1, 3]);
    assert!(first.checked_until_s < 10.0);
    let all = validated(&plan, &task, 100);
    assert_eq!(all.violations[0], first.violations[0]);
    assert_eq!(all.violations.last().unwrap().agents, [0, 1]);
    // Nobody knows who is who if the numbers differ.
    let (poses, limits) = ([Pose::at(0.0, 0.0); 5], [free(); 3]);
    let task = ContinuousTask {
        starts: Some(&poses),
        goals: Some(&poses[..2]),
        limits: Some(&limits),
        trailers: &[None],
        ..ContinuousTask::new(&shapes[..3], &none)
    };
    let verdict = validated(&plan, &task, 10);
    assert!(verdict.checked_until_s <= 0.0);
    let told = |count, what| format!("the plan has 4 agents, but there are {count} {what}");
    assert_eq!(
        sentences(&verdict),
        [
            told(3, "footprints"),
            told(5, "starts"),
            told(2, "goals"),
            told(3, "limits"),
            told(1, "trailers")
        ]
    );
}

/// A robot that can do anything.
fn free() -> Dynamics {
    Dynamics {
        travel: Travel::Polar {
            speed: f64::INFINITY,
            acceleration: f64::INFINITY,
        },
        turn_rad_per_s: f64::INFINITY,
        turn_acceleration_rad_per_s2: f64::INFINITY,
        curvature_rad_per_m: f64::INFINITY,
    }
}

/// A rectangle that ended turned by 1.5 rad was right where nothing but its place was looked at.
#[test]
fn a_rectangle_looks_where_its_start_and_its_goal_say() {
    let rectangle = Footprint::Rectangle {
        length_m: 1.0,
        width_m: 0.5,
    };
    let (rectangle, disc) = (rectangle.shape().unwrap(), disc(0.5));
    let none = Obstacles::none();
    let with_headings = plan(&[&[(0.0, 1.0, 1.0, 0.25), (4.0, 9.0, 1.0, 0.75)]]);
    let mut without = TrajectoryPlan::default();
    let knots = with_headings.knots(0).iter().map(|knot| Knot {
        heading_rad: None,
        ..knot
    });
    without.push_path(knots).unwrap();
    let told = |plan: &TrajectoryPlan, shape: &Shape, tolerance: Tolerance, poses: [Pose; 2]| {
        let [start, goal] = poses.map(|pose| [pose]);
        let shapes = [shape];
        let task = ContinuousTask {
            starts: Some(&start),
            goals: Some(&goal),
            tolerance,
            ..ContinuousTask::new(&shapes, &none)
        };
        let verdict = validated(plan, &task, 10);
        let told = |found: &ContinuousViolation| format!("{}: {found}", found.rule);
        verdict.violations.iter().map(told).collect::<Vec<_>>()
    };
    let looks = |start: f64, goal: f64| [Pose::new(1.0, 1.0, start), Pose::new(9.0, 1.0, goal)];
    let exact = Tolerance::default();
    for turns in [-2.0, -1.0, 0.0, 1.0] {
        let poses = looks(0.25 - turns * TAU, 0.75 + turns * TAU);
        assert_eq!(told(&with_headings, &rectangle, exact, poses), [""; 0]);
    }
    let turned = looks(1.25, -0.75);
    assert_eq!(
        told(&with_headings, &rectangle, exact, turned),
        [
            "wrong-start: agent 0 begins at its start, but turned by 1 rad",
            "wrong-goal: agent 0 ends at its goal, but turned by 1.5 rad",
        ]
    );
    assert_eq!(told(&with_headings, &disc, exact, turned), [""; 0]);
    assert_eq!(told(&without, &rectangle, exact, turned), [""; 0]);
    // What is forgiven is, to the end, and each by its own.
    let near = |place_m: f64, heading_rad: f64| Near {
        place_m,
        heading_rad,
    };
    let forgiving = Tolerance {
        start: near(0.5, 0.25),
        goal: near(0.25, 0.5),
        ..exact
    };
    let at = |x: f64, by: f64| {
        [
            Pose::new(1.0 - x, 1.0, by),
            Pose::new(9.0, 1.0 + x, 0.5 + by),
        ]
    };
    assert_eq!(
        told(&with_headings, &rectangle, forgiving, at(0.25, 0.5)),
        [""; 0]
    );
    assert_eq!(
        told(&with_headings, &rectangle, forgiving, at(0.5, 0.0)),
        ["wrong-goal: agent 0 ends 0.5 m from its goal"]
    );
    assert_eq!(
        told(&with_headings, &rectangle, forgiving, at(0.0, 0.625)),
        ["wrong-start: agent 0 begins at its start, but turned by 0.375 rad"]
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(500))]

    /// With cells of side 2√2·r, the rules of eight-connected grids say what
    /// continuous space and time say, step by step.
    #[test]
    fn rules_of_grids_are_feasibility(
        walks in proptest::collection::vec(
            (0..36u32, proptest::collection::vec(0..9u8, 0..8)), 2..7,
        ),
    ) {
        let grid = std::sync::Arc::new(Grid::new("open", 6, 6, vec![b'.'; 36]).unwrap());
        let paths: Vec<Vec<u32>> = walks
            .iter()
            .map(|(start, turns)| {
                let mut path = vec![*start];
                for turn in turns {
                    let here = path[path.len() - 1];
                    let near = grid.neighbors(here, fleetyard_core::Connectivity::Eight);
                    let near: Vec<u32> = near.chain([here]).collect();
                    path.push(near[usize::from(*turn) % near.len()]);
                }
                path
            })
            .collect();
        let plan = GridPlan::from_paths(&paths);
        let starts = paths.iter().map(|path| path[0]).collect();
        let goals = paths.iter().map(|path| path[path.len() - 1]).collect();
        let eight = fleetyard_core::Connectivity::Eight;
        let instance = GridInstance::new(grid.clone(), eight, starts, goals);
        prop_assume!(instance.is_ok());
        let discrete = fleetyard_check::validate(&instance.unwrap(), &plan, 100);

        let radius_m = 0.5;
        let side_m = 8f64.sqrt() * radius_m;
        let disc = disc(radius_m);
        let shapes = vec![&disc; paths.len()];
        let obstacles = Obstacles::cells(&grid, side_m).unwrap();
        let trajectories = TrajectoryPlan::from_grid(&plan, &grid, side_m, 1.0).unwrap();
        let task = ContinuousTask::new(&shapes, &obstacles);
        let continuous = validated(&trajectories, &task, 100);
        prop_assert_eq!(discrete.valid, continuous.valid, "{:?}", discrete.violations);
        if let (Some(one), Some(two)) = (discrete.violations.first(), continuous.violations.first()) {
            // A contact begins in the step before the time of the violation.
            prop_assert_eq!(one.time, two.time_s.ceil() as u32);
        }
    }
}
