//! PIBT, EPIBT, WPPL and LaCAM*, for one plan and for fleets.

mod epibt;
mod floor;
mod lifelong;
mod planners;
mod support;
mod ways;
mod wppl;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin};
use fleetyard_abi::{
    Budget, GridEnvironment, GridPlan, Instance, RestOfPlan, Status, monotonic_ns,
};
use fleetyard_testkit::{Case, Notes, grid};

/// Asks a planner, made with options, in so many seconds. Gives what it said, with the plan that it
/// submitted last.
fn ask<P: Planner + Plugin>(
    case: &Case,
    options: &str,
    (seconds, threads): (u64, u32),
) -> (Result<(), Failure>, Option<GridPlan>, Notes) {
    let budget = Budget {
        seed: 7,
        threads,
        ..Budget::lasting(monotonic_ns(), seconds * 1_000_000_000)
    };
    let notes = Notes::default();
    let mut planner = P::create(Options::new(options)).unwrap();
    let mut map = planner
        .prepare(&case.environment(), &budget, &notes)
        .unwrap();
    let said = planner.plan(&mut map, &case.instance, &budget, &notes);
    let plan = notes.plans.lock().unwrap().pop();
    (said, plan, notes)
}

/// The cells of the paths of a planner's plan, which has to be one.
fn paths_of<P: Planner + Plugin>(case: &Case, options: &str) -> Vec<Vec<u32>> {
    let (said, plan, _) = ask::<P>(case, options, (60, 1));
    assert_eq!(said, Ok(()));
    let plan = plan.unwrap();
    let paths: Vec<&[u32]> = plan.paths().collect();
    assert_eq!(case.judge(&paths, 0), Ok(()));
    paths.into_iter().map(<[u32]>::to_vec).collect()
}

fn open(rows: u32, cols: u32) -> GridEnvironment {
    GridEnvironment::four_connected(rows, cols, vec![1; (rows * cols) as usize])
}

/// One agent with some goals, and a window.
fn alone(map: GridEnvironment, start: u32, goals: &[u32], window: u32) -> Case {
    let instance = Instance::one_shot(vec![start], vec![start]);
    Case { map, instance }.windowed(window, &[goals.to_vec()])
}

/// Two agents on two rows of six cells go east, the second one behind the first, with a rest of their
/// last plans.
fn followers(window: u32, rest: Option<[&str; 2]>) -> Case {
    let map = grid::drawn(&["......", "......"]);
    let instance = Instance::one_shot(vec![0, 6], vec![5, 11]);
    let mut case = Case { map, instance }.windowed(window, &[vec![5], vec![11]]);
    if let Some(paths) = rest {
        let paths = paths.map(str::to_owned).to_vec();
        case.instance.parts = vec![RestOfPlan { paths }.into()];
    }
    case
}

/// The paths of a planner that has no time, which have to be valid.
fn at_once<P: Planner + Plugin>(case: &Case) -> Vec<Vec<u32>> {
    let (said, plan, _) = ask::<P>(case, "", (0, 1));
    assert_eq!(said.unwrap_err().status, Status::TimedOut);
    let plan = plan.unwrap();
    let paths: Vec<&[u32]> = plan.paths().collect();
    assert_eq!(case.judge(&paths, 0), Ok(()));
    paths.into_iter().map(<[u32]>::to_vec).collect()
}
