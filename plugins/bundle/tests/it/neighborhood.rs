//! The promises of the planners, judged by a checker that does not use their tables.

mod fewest;

use std::sync::atomic::Ordering;

use fleetyard_abi::object::Object;
use fleetyard_abi::sdk::{Failure, Options, Planner};
use fleetyard_abi::{Budget, Goals, GridPlan, Instance, Motion, Status, monotonic_ns};
use fleetyard_plugin_neighborhood::plugin::{MapfLns, MapfLns2};
use fleetyard_plugin_neighborhood::repair::{Control, Repaired, repair};
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem};
use fleetyard_testkit::{Case, Notes, grid};
use proptest::prelude::*;

fn problem(case: &Case) -> Problem {
    Ground::new(&case.map, 1 << 30)
        .and_then(|mut ground| ground.problem(&case.instance, GoalRule::Stay, &mut || false))
        .expect("a problem that is well formed")
}

fn run(problem: &Problem, seed: u64, nodes: u64) -> Repaired {
    let mut control = Control {
        stop: &mut || false,
        nodes,
    };
    repair(problem, 8, seed, &mut control)
}

fn cells(problem: &Problem, repaired: &Repaired) -> Vec<Vec<u32>> {
    paths(&problem.plan(&repaired.paths))
}

fn paths(plan: &GridPlan) -> Vec<Vec<u32>> {
    plan.paths().map(<[u32]>::to_vec).collect()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// A plan is called valid if and only if nobody collides, rings included where they are
    /// not allowed.
    #[test]
    fn valid_is_valid(side in 3_u32..9, share in 1_usize..60, blocked in 0_u64..5, seed: u64, cycles: bool) {
        let agents = (side * side) as usize * share / 100;
        let mut case = Case::square(side, agents.max(1), blocked, seed);
        case.instance.allows_cycles = cycles;
        let problem = problem(&case);
        let repaired = run(&problem, seed, 400);
        // Nobody may have been planned when the limit was met.
        let fault = case.judge(&cells(&problem, &repaired), 0);
        prop_assert_eq!(repaired.valid, fault.is_ok(), "{:?}", fault);
        prop_assert_eq!(&repaired, &run(&problem, seed, 400));
    }
}

fn budget(nodes: u64, threads: u32) -> Budget {
    Budget {
        nodes,
        threads,
        seed: 7,
        ..Budget::lasting(monotonic_ns(), 60_000_000_000)
    }
}

/// Asks a planner for plans, which are in the order in which they came.
fn ask<P: Planner>(
    case: &Case,
    budget: Budget,
    notes: &Notes,
) -> (Result<(), Failure>, Vec<GridPlan>) {
    let mut planner = Object::planner(P::create(Options::new("")).unwrap());
    let prepared = planner.prepare(&case.environment(), &budget, notes);
    prepared.expect("planners learn maps").unwrap();
    let Object::Planner(planner) = &mut planner else {
        panic!("{planner:?}");
    };
    let said = planner.plan(&case.instance, &budget, notes);
    (said, std::mem::take(&mut *notes.plans.lock().unwrap()))
}

#[test]
fn every_plan_is_better_and_the_same_again() {
    for cycles in [true, false] {
        let mut case = Case::square(16, 90, 2, 3);
        case.instance.allows_cycles = cycles;
        let told = |threads| {
            let (said, plans) = ask::<MapfLns>(&case, budget(3000, threads), &Notes::default());
            assert!(said.is_ok());
            plans
        };
        let plans = told(1);
        for plan in &plans {
            assert_eq!(case.judge(&paths(plan), 0), Ok(()));
        }
        let cost = |plan: &GridPlan| paths(plan).iter().map(|path| path.len() - 1).sum();
        let costs: Vec<usize> = plans.iter().map(cost).collect();
        assert!(
            costs.len() > 2 && costs.is_sorted_by(|a, b| a > b),
            "{costs:?}"
        );
        assert!(costs[costs.len() - 1] < costs[0] * 8 / 10, "{costs:?}");
        assert_eq!(plans, told(1));
        assert_eq!(plans, told(4));
        // The other one ends with the first.
        let (said, first) = ask::<MapfLns2>(&case, budget(3000, 1), &Notes::default());
        assert!(said.is_ok());
        assert_eq!(first, plans[..1]);
    }
}

#[test]
fn what_collides_is_left_with_a_failure() {
    let case = Case::new(&["...."], &[(0, 3), (3, 0)]);
    let (said, plans) = ask::<MapfLns2>(&case, budget(50, 1), &Notes::default());
    assert_eq!(said.unwrap_err().status, Status::GaveUp);
    let left = paths(&plans[0]);
    assert_eq!(case.motions(&left).and(case.arrivals(&left)), Ok(()));
    assert!(case.collisions(&left, 0).is_err(), "{left:?}");
    let notes = Notes::default();
    notes.cancelled.store(true, Ordering::Relaxed);
    let (said, _) = ask::<MapfLns>(&case, budget(50, 1), &notes);
    assert_eq!(said.unwrap_err().status, Status::TimedOut);
}

#[test]
fn other_instances_are_refused() {
    let said = |change: &dyn Fn(&mut Instance)| {
        let mut case = Case::square(4, 2, 0, 1);
        change(&mut case.instance);
        let (said, plans) = ask::<MapfLns2>(&case, budget(50, 1), &Notes::default());
        assert!(plans.is_empty());
        said.unwrap_err().status
    };
    assert_eq!(
        said(&|instance| instance.window_steps = 5),
        Status::Unsupported
    );
    let shared = |instance: &mut Instance| {
        instance.goals = Goals::single(vec![3, 3]);
    };
    assert_eq!(said(&shared), Status::Unsupported);
    let rotation = |instance: &mut Instance| instance.motion = Motion::Rotation;
    assert_eq!(said(&rotation), Status::Unsupported);
    assert_eq!(
        said(&|instance| instance.starts = vec![0, 0]),
        Status::InvalidInput
    );
}

/// Public benchmark maps, if they are there.
#[test]
fn benchmark_scenarios_are_solved() {
    for (map, agents) in [
        ("random-32-32-20", 250),
        ("empty-32-32", 350),
        ("room-64-64-16", 200),
    ] {
        let Some((file, scenario)) = grid::movingai(map, 1) else {
            continue;
        };
        for cycles in [true, false] {
            let mut case = Case::read(&file, &scenario, agents).unwrap();
            case.instance.allows_cycles = cycles;
            let problem = problem(&case);
            let repaired = run(&problem, 0, u64::MAX);
            assert!(repaired.valid);
            assert_eq!(case.judge(&cells(&problem, &repaired), 0), Ok(()));
        }
    }
}
