//! What the planners promise, judged by a checker that knows nothing of their tables.

mod support;

use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, Ordering};

use fleetyard_abi::object::Object;
use fleetyard_abi::sdk::{Failure, Options, Planner, Rejected, Sink};
use fleetyard_abi::{Budget, Environment, Instance, LogLevel, PlanRef, Status, monotonic_ns};
use fleetyard_plugin_neighborhood::plugin::{MapfLns, MapfLns2};
use fleetyard_plugin_neighborhood::repair::{Control, Repaired, repair};
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::plan::sum_of_costs;
use fleetyard_plugin_spacetime::problem::Problem;
use proptest::prelude::*;
use support::{Scene, collisions};

fn run(problem: &Problem, seed: u64, nodes: u64) -> Repaired {
    let mut control = Control {
        stop: &mut || false,
        nodes,
    };
    repair(problem, 8, seed, &mut control)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(128))]

    /// A plan is called valid if and only if nobody collides, rings included where they are
    /// not allowed.
    #[test]
    fn valid_is_valid(side in 3_u32..9, share in 1_usize..60, blocked in 0_u64..5, seed: u64, cycles: bool) {
        let agents = (side * side) as usize * share / 100;
        let scene = Scene { cycles, ..Scene::open(side, agents.max(1), blocked, seed) };
        let problem = scene.problem().unwrap();
        let repaired = run(&problem, seed, 400);
        let found = collisions(&problem, &repaired.paths);
        if repaired.valid {
            prop_assert_eq!(found, Ok(0));
        } else {
            // Nobody may have been planned when the limit was met.
            prop_assert!(found != Ok(0));
        }
        prop_assert_eq!(&repaired, &run(&problem, seed, 400));
    }
}

/// Takes down what a planner says.
#[derive(Default)]
struct Notes {
    plans: Mutex<Vec<Vec<Vec<u32>>>>,
    cancelled: AtomicBool,
}

impl Sink for Notes {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        let paths = plan.paths().map(<[u32]>::to_vec).collect();
        self.plans.lock().unwrap().push(paths);
        Ok(())
    }
    fn submit_instance(&self, _: &Instance) -> Result<(), Rejected> {
        panic!("a planner submits no instances");
    }
    fn metric(&self, _: &str, _: f64) {}
    fn log(&self, _: LogLevel, _: &str) {}
    fn progress(&self, _: u64, _: u64) {}
    fn cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }
}

fn budget(nodes: u64, threads: u32) -> Budget {
    let wall_ns = 60_000_000_000;
    Budget {
        deadline_monotonic_ns: monotonic_ns() + wall_ns,
        wall_ns,
        nodes,
        memory_bytes: 0,
        threads,
        seed: 7,
    }
}

/// Asks a planner; paths over vertices, in the order in which they came.
fn ask<P: Planner>(
    scene: &Scene,
    instance: &Instance,
    budget: Budget,
    notes: &Notes,
) -> (Result<(), Failure>, Vec<Vec<Vec<Vertex>>>) {
    let mut planner = Object::planner(P::create(Options::new("")).unwrap());
    let environment = Environment::Grid(scene.environment()).into();
    let prepared = planner.prepare(&environment, &budget, notes);
    prepared.expect("planners learn maps").unwrap();
    let Object::Planner(planner) = &mut planner else {
        panic!("{planner:?}");
    };
    let said = planner.plan(instance, &budget, notes);
    let graph = scene.problem().unwrap().graph;
    let plans = std::mem::take(&mut *notes.plans.lock().unwrap());
    let vertices = |path: Vec<u32>| -> Vec<Vertex> {
        path.iter().map(|&c| graph.vertex(c).unwrap()).collect()
    };
    let plans = plans
        .into_iter()
        .map(|plan| plan.into_iter().map(vertices).collect())
        .collect();
    (said, plans)
}

#[test]
fn every_plan_is_better_and_the_same_again() {
    for cycles in [true, false] {
        let scene = Scene {
            cycles,
            ..Scene::open(16, 90, 2, 3)
        };
        let problem = scene.problem().unwrap();
        let told = |threads| {
            let (said, plans) = ask::<MapfLns>(
                &scene,
                &scene.instance(),
                budget(3000, threads),
                &Notes::default(),
            );
            assert!(said.is_ok());
            plans
        };
        let plans = told(1);
        for plan in &plans {
            assert_eq!(collisions(&problem, plan), Ok(0));
        }
        let costs: Vec<u64> = plans.iter().map(sum_of_costs).collect();
        assert!(
            costs.len() > 2 && costs.is_sorted_by(|a, b| a > b),
            "{costs:?}"
        );
        assert!(costs[costs.len() - 1] < costs[0] * 8 / 10, "{costs:?}");
        assert_eq!(plans, told(1));
        assert_eq!(plans, told(4));
        // The other one ends with the first.
        let (said, first) = ask::<MapfLns2>(
            &scene,
            &scene.instance(),
            budget(3000, 1),
            &Notes::default(),
        );
        assert!(said.is_ok());
        assert_eq!(first, plans[..1]);
    }
}

#[test]
fn what_collides_is_left_with_a_failure() {
    let scene = Scene {
        rows: 1,
        cols: 4,
        passable: vec![1; 4],
        starts: vec![0, 3],
        goals: vec![3, 0],
        cycles: true,
    };
    let (said, plans) =
        ask::<MapfLns2>(&scene, &scene.instance(), budget(50, 1), &Notes::default());
    assert_eq!(said.unwrap_err().status, Status::GaveUp);
    let problem = scene.problem().unwrap();
    assert!(collisions(&problem, &plans[0]).unwrap() > 0);
    let notes = Notes::default();
    notes.cancelled.store(true, Ordering::Relaxed);
    let (said, _) = ask::<MapfLns>(&scene, &scene.instance(), budget(50, 1), &notes);
    assert_eq!(said.unwrap_err().status, Status::TimedOut);
}

#[test]
fn other_instances_are_refused() {
    let scene = Scene::open(4, 2, 0, 1);
    let said = |change: &dyn Fn(&mut Instance)| {
        let mut instance = scene.instance();
        change(&mut instance);
        let (said, plans) = ask::<MapfLns2>(&scene, &instance, budget(50, 1), &Notes::default());
        assert!(plans.is_empty());
        said.unwrap_err().status
    };
    assert_eq!(
        said(&|instance| instance.window_steps = 5),
        Status::Unsupported
    );
    let shared = |instance: &mut Instance| {
        instance.goals = fleetyard_abi::Goals::single(vec![3, 3]);
    };
    assert_eq!(said(&shared), Status::Unsupported);
    let rotation = |instance: &mut Instance| instance.motion = fleetyard_abi::Motion::Rotation;
    assert_eq!(said(&rotation), Status::Unsupported);
    assert_eq!(
        said(&|instance| instance.starts = vec![0, 0]),
        Status::InvalidInput
    );
}

/// Public benchmark maps, if they are there.
#[test]
fn benchmark_scenarios_are_solved() {
    let Some(data) = std::env::var_os("FLEETYARD_DATA").map(PathBuf::from) else {
        return;
    };
    for (map, agents) in [
        ("random-32-32-20", 250),
        ("empty-32-32", 350),
        ("room-64-64-16", 200),
    ] {
        let folder = data.join("movingai").join(map);
        let (file, scenario) = (format!("{map}.map"), format!("{map}-random-1.scen"));
        let paths: [&Path; 2] = [&folder.join(file), &folder.join(scenario)];
        let scene = support::read(paths[0], paths[1], agents).unwrap();
        for cycles in [true, false] {
            let problem = Scene {
                cycles,
                ..scene.clone()
            }
            .problem()
            .unwrap();
            let repaired = run(&problem, 0, u64::MAX);
            assert!(repaired.valid);
            assert_eq!(collisions(&problem, &repaired.paths), Ok(0));
        }
    }
}
