//! Plans in the plane and on roadmaps: what is accepted, what is refused, and what they
//! mean.

#![allow(clippy::float_cmp, reason = "the values are exact")]

use std::f64::consts::PI;

use fleetyard_core::{
    Grid, GridPlan, Knot, Roadmap, RoadmapError, RoadmapPlan, RoadmapPlanError, TrajectoryError,
    TrajectoryPlan, Visit, cell_center_m, cell_of_point,
};

fn at(time_s: f64, x_m: f64, y_m: f64) -> Knot {
    Knot {
        time_s,
        x_m,
        y_m,
        heading_rad: None,
    }
}

fn facing(time_s: f64, x_m: f64, y_m: f64, heading_rad: f64) -> Knot {
    Knot {
        heading_rad: Some(heading_rad),
        ..at(time_s, x_m, y_m)
    }
}

fn plan(paths: &[&[Knot]]) -> Result<TrajectoryPlan, TrajectoryError> {
    let mut plan = TrajectoryPlan::default();
    for path in paths {
        plan.push_path(path.iter().copied())?;
    }
    Ok(plan)
}

/// The same through columns, which must agree with path by path.
fn columns(paths: &[&[Knot]]) -> Result<TrajectoryPlan, TrajectoryError> {
    let all: Vec<Knot> = paths.concat();
    let mut offsets = vec![0];
    for path in paths {
        offsets.push(offsets[offsets.len() - 1] + path.len());
    }
    let headings: Vec<f64> = all.iter().filter_map(|knot| knot.heading_rad).collect();
    TrajectoryPlan::from_columns(
        offsets,
        all.iter().map(|knot| knot.time_s).collect(),
        all.iter().map(|knot| knot.x_m).collect(),
        all.iter().map(|knot| knot.y_m).collect(),
        (!headings.is_empty()).then_some(headings),
    )
}

#[track_caller]
fn fails(paths: &[&[Knot]], expected: &str) {
    let error = plan(paths).expect_err("the plan is bad");
    assert_eq!(error.to_string(), expected);
    // Columns cannot mix: the number of headings is wrong then.
    match columns(paths) {
        Err(TrajectoryError::LengthMismatch { what, .. }) => assert_eq!(what, "heading_rad"),
        other => assert_eq!(
            other.expect_err("the columns are bad").to_string(),
            expected
        ),
    }
}

#[test]
fn what_makes_no_trajectories() {
    let good: &[Knot] = &[at(0.0, 0.0, 0.0)];
    fails(&[good, &[]], "agent 1 has no knots");
    fails(
        &[&[at(0.5, 0.0, 0.0)]],
        "agent 0 begins at time 0.5 s, not at 0",
    );
    fails(
        &[&[at(-1.0, 0.0, 0.0), at(0.0, 0.0, 0.0)]],
        "agent 0 begins at time -1 s, not at 0",
    );
    fails(
        &[
            good,
            &[at(0.0, 0.0, 0.0), at(2.0, 1.0, 0.0), at(1.5, 2.0, 0.0)],
        ],
        "knot 2 of agent 1 goes back in time, from 2 s to 1.5 s",
    );
    fails(
        &[&[at(0.0, 0.0, 0.0), at(1.0, 0.0, 0.0), at(1.0, 3.0, 4.0)]],
        "there is a gap at knot 2 of agent 0: at time 1 s it is in two places, \
         5 m apart and turned by 0 rad",
    );
    fails(
        &[&[facing(0.0, 0.0, 0.0, 0.0), facing(0.0, 0.0, 0.0, 0.5)]],
        "there is a gap at knot 1 of agent 0: at time 0 s it is in two places, \
         0 m apart and turned by 0.5 rad",
    );
    for (value, shown) in [
        (f64::NAN, "NaN"),
        (f64::INFINITY, "inf"),
        (f64::NEG_INFINITY, "-inf"),
    ] {
        for (what, knot) in [
            ("time", facing(value, 0.0, 0.0, 0.0)),
            ("x", facing(1.0, value, 0.0, 0.0)),
            ("y", facing(1.0, 0.0, value, 0.0)),
            ("heading", facing(1.0, 0.0, 0.0, value)),
        ] {
            fails(
                &[&[facing(0.0, 0.0, 0.0, 0.0), knot]],
                &format!("knot 1 of agent 0 has {what} {shown}, which is not finite"),
            );
        }
    }
    fails(
        &[&[at(0.0, 2e9, 0.0)]],
        "knot 0 of agent 0 has x 2e9, beyond ±1e9",
    );
    fails(
        &[&[facing(0.0, 0.0, 0.0, 0.0)], good],
        "knot 0 of agent 1 has no heading, unlike the first of the plan",
    );
    fails(
        &[good, &[facing(0.0, 0.0, 0.0, 0.0)]],
        "knot 0 of agent 1 has a heading, unlike the first of the plan",
    );
}

#[test]
fn columns_that_do_not_fit() {
    let column = || vec![0.0; 2];
    let fails = |offsets: Vec<usize>, x: Vec<f64>, headings, expected: &str| {
        let error = TrajectoryPlan::from_columns(offsets, vec![0.0, 1.0], x, column(), headings);
        assert_eq!(error.expect_err("it is bad").to_string(), expected);
    };
    let one = || vec![0.0];
    fails(
        vec![0, 2],
        one(),
        None,
        "x_m has 1 entries, but there are 2 knots",
    );
    fails(
        vec![0, 2],
        column(),
        Some(one()),
        "heading_rad has 1 entries, but there are 2 knots",
    );
    let reason = "offsets must begin at 0, not descend, and end at the number of knots, 2";
    for offsets in [vec![], vec![0], vec![1, 2], vec![0, 2, 1, 2], vec![0, 3]] {
        fails(offsets, column(), None, reason);
    }
}

#[test]
fn a_refused_path_leaves_the_plan_as_it_was() {
    let mut plan = TrajectoryPlan::default();
    let bad = [facing(0.0, 0.0, 0.0, 0.0), facing(1.0, f64::NAN, 0.0, 0.0)];
    assert!(plan.push_path(bad).is_err());
    assert_eq!(plan, TrajectoryPlan::default());
    // Nothing was decided about headings yet.
    plan.push_path([at(0.0, 1.0, 2.0), at(1.0, 2.0, 2.0)])
        .unwrap();
    let before = plan.clone();
    assert!(plan.push_path(bad).is_err());
    assert!(
        plan.push_path([at(0.0, 0.0, 0.0), at(0.0, 1.0, 0.0)])
            .is_err()
    );
    assert!(plan.push_path([]).is_err());
    assert_eq!(plan, before);
}

#[test]
fn repeated_knots_are_dropped() {
    let paths: &[&[Knot]] = &[
        &[
            at(0.0, 0.0, 0.0),
            at(0.0, -0.0, 0.0),
            at(1.0, 1.0, 0.0),
            at(1.0, 1.0, 0.0),
        ],
        &[at(-0.0, 5.0, 5.0)],
    ];
    let made = plan(paths).unwrap();
    assert_eq!(made, columns(paths).unwrap());
    assert_eq!(made.offsets(), [0, 2, 3]);
    assert_eq!((made.agents(), made.knot_count()), (2, 3));
    let kept = plan(&[
        &[at(0.0, 0.0, 0.0), at(1.0, 1.0, 0.0)],
        &[at(0.0, 5.0, 5.0)],
    ])
    .unwrap();
    assert_eq!(made.digest(), kept.digest());
}

#[test]
fn agents_move_linearly_and_rest_at_the_end() {
    let plan = plan(&[&[
        facing(0.0, 0.0, 0.0, 0.0),
        facing(2.0, 4.0, 0.0, 0.0),
        facing(5.0, 4.0, 0.0, 1.5 * PI),
        facing(9.0, 4.0, 2.0, 1.5 * PI),
    ]])
    .unwrap();
    let knots = plan.knots(0);
    assert_eq!(knots.at(-1.0), facing(-1.0, 0.0, 0.0, 0.0));
    assert_eq!(knots.at(0.5), facing(0.5, 1.0, 0.0, 0.0));
    assert_eq!(knots.at(2.0), facing(2.0, 4.0, 0.0, 0.0));
    assert_eq!(knots.at(3.0), facing(3.0, 4.0, 0.0, 0.5 * PI));
    assert_eq!(knots.at(100.0), facing(100.0, 4.0, 2.0, 1.5 * PI));
    assert_eq!((plan.horizon_s(), knots.length_m()), (9.0, 6.0));
    let fastest = plan.fastest().next().unwrap();
    assert_eq!((fastest.speed_m_per_s, fastest.speed_knot), (2.0, 1));
    assert_eq!((fastest.turn_rad_per_s, fastest.turn_knot), (0.5 * PI, 2));
}

#[test]
fn digests_tell_plans_apart() {
    let one = plan(&[&[at(0.0, 0.0, 0.0), at(1.0, 1.0, 0.0)]]).unwrap();
    let waits = plan(&[&[
        at(0.0, 0.0, 0.0),
        at(1.0, 1.0, 0.0),
        at(3.0, 1.0, 0.0),
        at(4.0, 1.0, 0.0),
    ]])
    .unwrap();
    assert_eq!(one.digest(), waits.digest());
    assert_eq!(waits.knots(0).arrival(), 1);
    let others = [
        plan(&[&[at(0.0, 0.0, 0.0), at(1.0, 1.0, 1.0)]]).unwrap(),
        plan(&[&[at(0.0, 0.0, 0.0), at(1.5, 1.0, 0.0)]]).unwrap(),
        plan(&[&[at(0.0, 0.0, 0.0)], &[at(0.0, 1.0, 0.0)]]).unwrap(),
        plan(&[&[facing(0.0, 0.0, 0.0, 0.0), facing(1.0, 1.0, 0.0, 0.0)]]).unwrap(),
    ];
    for other in others {
        assert_ne!(one.digest(), other.digest());
    }
    // Pinned: digests are the same in every build, and stay.
    assert_eq!(one.digest().to_string(), "eae7968aa97e2dec4a5eacaf09e29864");
}

#[test]
fn grid_plans_become_trajectories() {
    let grid = Grid::new("g", 3, 4, vec![b'.'; 12]).unwrap();
    // East, two waits, south, three waits at the end; and one that never moves.
    let plan = GridPlan::from_paths([vec![0, 1, 1, 1, 5, 5, 5, 5], vec![11]]);
    let made = TrajectoryPlan::from_grid(&plan, &grid, 2.0, 0.5).unwrap();
    let knots: Vec<Knot> = made.knots(0).iter().collect();
    assert_eq!(
        knots,
        [
            at(0.0, 1.0, 5.0),
            at(0.5, 3.0, 5.0),
            at(1.5, 3.0, 5.0),
            at(2.0, 3.0, 3.0),
            at(3.5, 3.0, 3.0)
        ]
    );
    assert_eq!(
        made.knots(1).iter().collect::<Vec<_>>(),
        [at(0.0, 7.0, 1.0)]
    );
    let trimmed = TrajectoryPlan::from_grid(&plan.trimmed(), &grid, 2.0, 0.5).unwrap();
    assert_eq!(trimmed.digest(), made.digest());
    // Wherever a step ends, the agent is in the cell of the grid plan.
    for agent in 0..2 {
        for time in 0..9 {
            let (x, y) = cell_center_m(&grid, 2.0, plan.at(agent, time));
            let knot = made.knots(agent).at(time as f64 * 0.5);
            assert_eq!((knot.x_m, knot.y_m), (x, y));
            assert_eq!(cell_of_point(&grid, 2.0, x, y), Some(plan.at(agent, time)));
        }
    }
    let fails = |paths: Vec<Vec<u32>>, cell: f64, step: f64, expected: &str| {
        let plan = GridPlan::from_paths(paths);
        let error = TrajectoryPlan::from_grid(&plan, &grid, cell, step).unwrap_err();
        assert_eq!(error.to_string(), expected);
    };
    fails(vec![vec![0], vec![]], 1.0, 1.0, "agent 1 has no knots");
    fails(
        vec![vec![0, u32::MAX]],
        1.0,
        1.0,
        "agent 0 is not on the map at time 1",
    );
    fails(
        vec![vec![0]],
        0.0,
        1.0,
        "the cell size is 0, but it must be positive and finite",
    );
    fails(
        vec![vec![0]],
        1.0,
        f64::NAN,
        "the time of a step is NaN, but it must be positive and finite",
    );
}

#[test]
fn paths_in_straight_lines() {
    let grid = Grid::new("g", 4, 5, vec![b'.'; 20]).unwrap();
    // Two steps east, a wait, a line of (3, 4), and back over two cells of it.
    let plan = GridPlan::from_paths([vec![0, 1, 1, 0, 1, 2, 0, 19, 19], vec![7]]);
    let made = TrajectoryPlan::along_lines(&plan, &grid, 2.0, 0.5).unwrap();
    let knots: Vec<Knot> = made.knots(0).iter().collect();
    assert_eq!(
        knots,
        [
            at(0.0, 1.0, 7.0),
            at(0.5, 3.0, 7.0),
            at(1.0, 1.0, 7.0),
            at(2.0, 5.0, 7.0),
            at(3.0, 1.0, 7.0),
            at(5.5, 9.0, 1.0)
        ]
    );
    assert_eq!(
        made.knots(1).iter().collect::<Vec<_>>(),
        [at(0.0, 5.0, 5.0)]
    );
    let line = GridPlan::from_paths([[0, 6, 12, 18]]);
    let line = TrajectoryPlan::along_lines(&line, &grid, 1.0, 1.0).unwrap();
    assert_eq!(line.knots(0).len(), 2);
    assert!((line.horizon_s() - 3.0 * 2f64.sqrt()).abs() < 1e-12);
    for (paths, cell, expected) in [
        (vec![vec![0], vec![]], 1.0, "agent 1 has no knots"),
        (
            vec![vec![0, u32::MAX]],
            1.0,
            "agent 0 is not on the map at time 1",
        ),
        (
            vec![vec![0]],
            -1.0,
            "the cell size is -1, but it must be positive and finite",
        ),
    ] {
        let plan = GridPlan::from_paths(paths);
        let error = TrajectoryPlan::along_lines(&plan, &grid, cell, 1.0).unwrap_err();
        assert_eq!(error.to_string(), expected);
    }
}

fn square() -> Roadmap {
    let edges = [(0, 1), (1, 0), (1, 2), (2, 3), (3, 0), (1, 2)];
    Roadmap::new(vec![0.0, 3.0, 3.0, 0.0], vec![0.0, 0.0, 4.0, 4.0], edges).unwrap()
}

#[test]
fn roadmaps() {
    let roadmap = square();
    assert_eq!((roadmap.vertices(), roadmap.edge_count()), (4, 5));
    assert_eq!(roadmap.neighbors(1), [0, 2]);
    assert!(roadmap.has_edge(0, 1) && !roadmap.has_edge(2, 1));
    assert!(!roadmap.is_symmetric());
    assert_eq!(roadmap.position_m(2), (3.0, 4.0));
    let edges: Vec<(u32, u32)> = roadmap.edges().collect();
    assert_eq!(edges, [(0, 1), (1, 0), (1, 2), (2, 3), (3, 0)]);
    let made = |x: Vec<f64>, y: Vec<f64>, edges: &[(u32, u32)]| {
        Roadmap::new(x, y, edges.iter().copied()).map(|roadmap| roadmap.digest())
    };
    let zero = || vec![0.0, 1.0];
    assert_ne!(
        made(zero(), zero(), &[(0, 1)]),
        made(zero(), zero(), &[(1, 0)])
    );
    assert_eq!(made(vec![], vec![], &[]), Err(RoadmapError::NoVertices));
    let fails = |result: Result<_, RoadmapError>, expected: &str| {
        assert_eq!(result.unwrap_err().to_string(), expected);
    };
    fails(
        made(zero(), vec![0.0], &[]),
        "there are 2 x and 1 y coordinates",
    );
    fails(
        made(zero(), vec![0.0, f64::NAN], &[]),
        "vertex 1 is at (1, NaN), which is not finite or beyond ±1e9",
    );
    fails(
        made(zero(), zero(), &[(0, 1), (1, 2)]),
        "edge 1 goes from 1 to 2, but there are 2 vertices",
    );
    fails(
        made(zero(), zero(), &[(1, 1)]),
        "edge 0 goes from vertex 1 to itself",
    );
}

fn visit(vertex: u32, arrival_s: f64, departure_s: f64) -> Visit {
    Visit {
        vertex,
        arrival_s,
        departure_s,
    }
}

#[test]
fn plans_on_roadmaps() {
    let roadmap = square();
    let mut plan = RoadmapPlan::default();
    // Two visits to vertex 1 are one.
    let path = [
        visit(0, 0.0, 1.0),
        visit(1, 4.0, 4.0),
        visit(1, 4.0, 5.0),
        visit(2, 9.0, 100.0),
    ];
    plan.push_path(path).unwrap();
    plan.push_path([visit(3, 0.0, 0.0)]).unwrap();
    assert_eq!((plan.agents(), plan.visit_count()), (2, 4));
    assert_eq!(plan.horizon_s(), 9.0);
    let made = plan.to_trajectories(&roadmap).unwrap();
    let knots: Vec<Knot> = made.knots(0).iter().collect();
    assert_eq!(
        knots,
        [
            at(0.0, 0.0, 0.0),
            at(1.0, 0.0, 0.0),
            at(4.0, 3.0, 0.0),
            at(5.0, 3.0, 0.0),
            at(9.0, 3.0, 4.0)
        ]
    );
    assert_eq!(
        made.knots(1).iter().collect::<Vec<_>>(),
        [at(0.0, 0.0, 4.0)]
    );
    let mut same = RoadmapPlan::default();
    same.push_path([visit(0, 0.0, 1.0), visit(1, 4.0, 5.0), visit(2, 9.0, 9.0)])
        .unwrap();
    same.push_path([visit(3, 0.0, 7.0)]).unwrap();
    assert_eq!(same.digest(), plan.digest());
}

#[test]
fn what_makes_no_plan_on_a_roadmap() {
    let fails = |path: &[Visit], expected: &str| {
        let mut plan = RoadmapPlan::default();
        plan.push_path([visit(0, 0.0, 0.0)]).unwrap();
        let before = plan.clone();
        let error: RoadmapPlanError = match plan.push_path(path.iter().copied()) {
            Err(error) => {
                assert_eq!(plan, before);
                error
            }
            Ok(()) => plan.to_trajectories(&square()).unwrap_err(),
        };
        assert_eq!(error.to_string(), expected);
        assert_eq!(error.place().map(|(agent, _)| agent), Some(1));
    };
    fails(&[], "agent 1 visits no vertex");
    fails(
        &[visit(0, 1.0, 1.0)],
        "agent 1 begins at time 1 s, not at 0",
    );
    fails(
        &[visit(0, 0.0, f64::NAN)],
        "visit 0 of agent 1 is from 0 s to NaN s, which is not finite or beyond 1e9",
    );
    fails(
        &[visit(0, 0.0, -1.0)],
        "visit 0 of agent 1 ends at -1 s, before it begins at 0 s",
    );
    fails(
        &[visit(0, 0.0, 2.0), visit(1, 2.0, 2.0)],
        "visit 1 of agent 1 begins at 2 s, but the one before ends at 2 s",
    );
    fails(
        &[visit(0, 0.0, 0.0), visit(9, 2.0, 2.0)],
        "visit 1 of agent 1 is to vertex 9, but the roadmap has 4",
    );
    fails(
        &[visit(2, 0.0, 0.0), visit(1, 2.0, 2.0)],
        "visit 1 of agent 1: the roadmap has no edge from 2 to 1",
    );
}
