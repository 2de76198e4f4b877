//! The planner without a host: `cargo test`.

mod host;

use std::sync::Arc;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin};
use fleetyard_abi::{Instance, Lists, Motion, Plan, RoadmapEnvironment, Status, Visit};
use host::{BUDGET, Host};

use example_plugin::InTurn;

/// The visits that the planner finds on a corridor of four vertices, a metre and a second apart,
/// with a bay at the third: "0@0-1 1@2" is a robot that waits for a second and arrives at 2.
///
/// ```text
/// 0 - 1 - 2 - 3
///         |
///         4
/// ```
fn plan(starts: &[u32], goals: &[u32]) -> Result<Vec<String>, Failure> {
    let edges: Lists<u32> = [vec![1], vec![0, 2], vec![1, 3, 4], vec![2], vec![2]]
        .into_iter()
        .collect();
    let (x, y) = ([0.0, 1.0, 2.0, 3.0, 2.0], [0.0, 0.0, 0.0, 0.0, -1.0]);
    let roadmap = RoadmapEnvironment::straight(x.into(), y.into(), edges, 1.0, 0.5);
    let host = Host::default();
    let mut planner = InTurn::create(Options::new("{}"))?;
    let mut map = planner.prepare(&Arc::new(roadmap.into()), &BUDGET, &host)?;
    let instance = Instance {
        motion: Motion::StopGo,
        ..Instance::one_shot(starts.to_vec(), goals.to_vec())
    };
    planner.plan(&mut map, &instance, &BUDGET, &host)?;
    let Some(Plan::Visits(plan)) = host.plan.into_inner().unwrap() else {
        panic!("visits");
    };
    let text = |path: &[Visit]| {
        let visits = path.iter().map(|visit| {
            let waits = visit.departure_s > visit.arrival_s;
            let until = waits.then(|| format!("-{}", visit.departure_s));
            let until = until.unwrap_or_default();
            format!("{}@{}{until}", visit.vertex, visit.arrival_s)
        });
        visits.collect::<Vec<String>>().join(" ")
    };
    Ok(plan.iter().map(text).collect())
}

#[test]
fn the_way_of_one_robot_is_shortest() {
    assert_eq!(plan(&[0], &[4]).unwrap(), ["0@0 1@1 2@2 4@3"]);
}

#[test]
fn robots_drive_in_turn() {
    // The first is in the way of nobody once it is in the bay.
    let plan = plan(&[0, 1], &[3, 4]).unwrap();
    assert_eq!(plan, ["0@0-2 1@3 2@4 3@5", "1@0 2@1 4@2"]);
}

#[test]
fn says_when_there_is_no_plan() {
    let failure = plan(&[0, 3], &[3, 0]).unwrap_err();
    assert_eq!(failure.status, Status::GaveUp);
}
