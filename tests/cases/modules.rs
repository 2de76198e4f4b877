//! The modules of a fleet give the same answer through every attachment: linked in, in a
//! worker, and as a program that speaks JSON over stdio. This binary is its own worker and program.

use std::time::Duration;

use fleetyard_abi::{
    Budget, FleetState, FleetStatus, Goals, GridEnvironment, GridPlan, Heading, Instance, Kind,
    Motion, Plan, SharedEnvironment, Task, c, serve,
};
use fleetyard_runtime::{Attach, Limits, PluginFile, Runtime, Session, supervisor};

use crate::Tests;

static BUILT_IN: &[&c::PluginEntry] = &[&fleetyard_plugins::fleetyard_plugin_entry_v1];
const SERVE: &str = "__serve";
const SIDE: u32 = 12;

const BUDGET: Budget = Budget {
    deadline_monotonic_ns: 0,
    answer_by_ns: 0,
    wall_ns: 20_000_000_000,
    nodes: 0,
    memory_bytes: 0,
    threads: 1,
    seed: 11,
};

fn free(cell: u32) -> bool {
    !((cell / SIDE) % 3 == 1 && cell % 4 < 2)
}

fn environment() -> SharedEnvironment {
    let passable: Vec<u8> = (0..SIDE * SIDE).map(|cell| free(cell).into()).collect();
    SharedEnvironment::new(GridEnvironment::four_connected(SIDE, SIDE, passable).into())
}

/// A fleet on every third free cell that shares six goals, and some tasks.
fn state() -> FleetState {
    let free: Vec<u32> = (0..SIDE * SIDE).filter(|cell| free(*cell)).collect();
    let cells: Vec<u32> = free.iter().copied().step_by(3).collect();
    let mut goals = Goals::default();
    for agent in 0..cells.len() {
        let both = [free[agent % 6 * 7], free[agent * 2]];
        goals.push(both.into_iter().filter(|_| agent % 5 != 0));
    }
    FleetState {
        time_s: 12.5,
        next: Instance {
            headings: Some(vec![Heading::North; cells.len()]),
            goals,
            window_steps: 10,
            radius_m: 0.4,
            starts: cells,
            ..Instance::default()
        },
        tasks: (0..4)
            .map(|task| Task {
                id: 1 << (10 * task),
                places: vec![free[task * 20 + 3], free[task * 5]],
                released_s: 0.0,
            })
            .collect(),
        parts: Vec::new(),
    }
}

/// The instance for the fail policies, and paths that collide: everybody goes east and back.
fn failed(motion: Motion) -> (Instance, Plan) {
    let mut next = state().next;
    next.motion = motion;
    let goals: Vec<u32> = next.starts.iter().rev().copied().collect();
    let east_and_back = next.starts.iter().map(|start| {
        let mut path = vec![*start];
        for _ in 0..4 {
            let next = path[path.len() - 1] + 1;
            if !next.is_multiple_of(SIDE) && free(next) {
                path.push(next);
            }
        }
        let back: Vec<u32> = path.iter().rev().copied().collect();
        [path, back].concat()
    });
    let failed = GridPlan::from_paths(east_and_back).into();
    next.goals = Goals::single(goals);
    (next, failed)
}

fn open(attach: Attach, kind: Kind, id: &str) -> Session {
    let runtime = Runtime::new(BUILT_IN, Limits::default()).expect("a runtime");
    let itself = std::env::current_exe().expect("a path");
    let argv = vec![itself.display().to_string(), SERVE.to_owned()];
    let file = match attach {
        Attach::Stdio => PluginFile::Program(itself, argv),
        _ => PluginFile::BuiltIn,
    };
    let mut session = runtime.open(&file, attach).expect("it starts");
    session
        .create(kind, id, serde_json::json!({}))
        .expect("it is made");
    if kind != Kind::InvocationPolicy {
        session
            .prepare(&environment(), &BUDGET)
            .expect("it is prepared");
    }
    session
}

/// The answers of a module to some calls, twice in one session.
fn answers(attach: Attach, kind: Kind, id: &str) -> String {
    let mut session = open(attach, kind, id);
    let mut answers = Vec::new();
    for _ in 0..2 {
        match kind {
            Kind::FailPolicy => {
                for motion in [Motion::Pebble, Motion::Rotation] {
                    let (instance, failed) = failed(motion);
                    for left in [Some(&failed), None] {
                        let run = session.recover(&instance, left, &BUDGET);
                        assert_eq!(run.fault, None, "{id}");
                        answers.push(format!("{:?}", run.plan().expect("a plan")));
                    }
                }
            }
            Kind::InstanceGenerator => {
                let made = session.generate(&state(), &BUDGET).expect("a request");
                let next = made.request;
                assert!(!next.assignments.is_empty(), "{id}");
                answers.push(format!("{next:?}"));
            }
            Kind::InvocationPolicy => {
                for (since_last_call_s, left) in [(0.5, 5), (1.0, 5), (0.5, 1), (0.0, 0)] {
                    let status = FleetStatus {
                        time_s: 30.0,
                        since_last_call_s,
                        planning_limit_s: 1.0,
                        action_s: 0.5,
                        actions_left: vec![9, left, 7],
                    };
                    let limit = Duration::from_secs(20);
                    let says = session.should_invoke(&status, limit).expect("an answer");
                    answers.push(format!("{says:?}"));
                }
            }
            Kind::Planner => {}
        }
    }
    session.close();
    let half = answers.len() / 2;
    assert_eq!(answers[..half], answers[half..], "{id} says the same again");
    answers.join("\n")
}

/// Does not return in the processes that tests start for plugins.
pub(crate) fn intercept() {
    supervisor::intercept(BUILT_IN);
    if std::env::args().nth(1).as_deref() == Some(SERVE) {
        std::process::exit(serve::serve_stdio(fleetyard_plugins::catalog()));
    }
}

pub(crate) fn add(tests: &mut Tests) {
    let modules = fleetyard_abi::sdk::Catalog::descriptors(fleetyard_plugins::catalog());
    for of in modules.into_iter().filter(|of| of.kind != Kind::Planner) {
        tests.add(&format!("modules::{}::{}", of.kind, of.id), move || {
            let expected = answers(Attach::InProcess, of.kind, &of.id);
            for attach in [Attach::Worker, Attach::Stdio] {
                assert_eq!(answers(attach, of.kind, &of.id), expected, "{attach:?}");
            }
        });
    }
}
