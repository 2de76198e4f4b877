//! The planner without a host: `cargo test`.

mod host;

use std::sync::Arc;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin};
use fleetyard_abi::{
    Footprint, Instance, Knot, Lists, Motion, Plan, Robot, State, Status, WorkspaceEnvironment,
};
use host::{BUDGET, Host};

use example_plugin::InTurn;

/// The knots that the planner finds for discs of half a metre in a room of ten metres with a wall.
fn plan(starts: &[[f64; 2]], goals: &[[f64; 2]]) -> Result<Vec<Vec<Knot>>, Failure> {
    let wall = vec![[4.9, 0.0], [5.1, 0.0], [5.1, 5.0], [4.9, 5.0]];
    let room = WorkspaceEnvironment {
        min_m: [0.0, 0.0],
        max_m: [10.0, 8.0],
        obstacles: Lists::from_iter([wall]),
        movers: Vec::new(),
    };
    let disc = Robot {
        name: "disc".into(),
        footprint: Footprint::disc(0.5),
        dynamics: "fleetyard.single-integrator/1".into(),
        has_heading: false,
        polar_state: false,
        polar_control: true,
        state_limits: vec![[None, None]; 2],
        control_limits: vec![[Some(-2.0), Some(2.0)]; 2],
        parameters: Vec::new(),
    };
    let state = |place: &[f64; 2]| State(place.to_vec());
    let instance = Instance {
        start_states: starts.iter().map(state).collect(),
        goal_states: goals.iter().map(|place| vec![state(place)]).collect(),
        robots: vec![disc],
        motion: Motion::Dynamics,
        ..Instance::one_shot(Vec::new(), Vec::new())
    };
    let host = Host::default();
    let mut planner = InTurn::create(Options::new(r#"{"speed_m_per_s": 4}"#))?;
    let mut map = planner.prepare(&Arc::new(room.into()), &BUDGET, &host)?;
    planner.plan(&mut map, &instance, &BUDGET, &host)?;
    let Some(Plan::Trajectories(plan)) = host.plan.into_inner().unwrap() else {
        panic!("trajectories");
    };
    Ok(plan.knots().iter().map(<[Knot]>::to_vec).collect())
}

#[test]
fn a_free_way_is_straight() {
    let paths = plan(&[[1.0, 1.0]], &[[1.0, 5.0]]).unwrap();
    let [first, last] = paths[0][..] else {
        panic!("{paths:?}")
    };
    assert_eq!((first.time_s, first.y_m), (0.0, 1.0));
    assert_eq!((last.time_s, last.y_m), (2.0, 5.0));
}

#[test]
fn the_wall_is_passed_and_robots_drive_in_turn() {
    let paths = plan(&[[1.0, 1.0], [3.0, 2.0]], &[[9.0, 1.0], [1.0, 7.0]]).unwrap();
    let over = |knot: &Knot| knot.y_m > 5.5 && (4.0..6.0).contains(&knot.x_m);
    assert!(paths[0].iter().any(over), "{paths:?}");
    let there_s = paths[0][paths[0].len() - 1].time_s;
    assert_eq!(paths[1][1].time_s, there_s);
    assert_eq!((paths[1][1].x_m, paths[1][1].y_m), (3.0, 2.0));
}

#[test]
fn says_when_there_is_no_plan() {
    let failure = plan(&[[1.0, 1.0]], &[[5.0, 1.0]]).unwrap_err();
    assert_eq!(failure.status, Status::GaveUp);
}
