//! Each example plugin through the SDK's catalogue, as a host uses it.

use std::collections::BTreeSet;
use std::sync::Arc;

use fleetyard_abi::object::Object;
use fleetyard_abi::sdk::{Catalog, Failure, Options};
use fleetyard_abi::{
    Budget, FleetState, FleetStatus, GridEnvironment, GridPlan, Instance, Kind, SharedEnvironment,
    Status,
};
use fleetyard_example_rust::catalog;
use fleetyard_testkit::Notes;

fn grid(rows: &[&str], connectivity: u32) -> SharedEnvironment {
    let letters = rows.concat().into_bytes();
    let free = letters.iter().map(|letter| u8::from(*letter == b'.'));
    let (height, width) = (rows.len() as u32, rows[0].len() as u32);
    Arc::new(GridEnvironment::new(height, width, connectivity, free.collect()).into())
}

const BUDGET: Budget = Budget {
    deadline_monotonic_ns: u64::MAX,
    answer_by_ns: u64::MAX,
    wall_ns: u64::MAX,
    nodes: 0,
    memory_bytes: 0,
    threads: 1,
    seed: 7,
};

fn create(kind: Kind, id: &str, options: &str) -> Result<Object, Failure> {
    catalog().create(kind, id, Options::new(options), &Notes::default())
}

fn plan(
    map: &SharedEnvironment,
    options: &str,
    instance: &Instance,
    sink: &Notes,
) -> Result<GridPlan, Failure> {
    let Object::Planner(mut planner) = create(Kind::Planner, "layered", options)? else {
        panic!("another kind");
    };
    planner.prepare(map, &BUDGET, sink)?;
    planner.plan(instance, &BUDGET, sink)?;
    Ok(sink.plans.lock().unwrap().pop().expect("a plan"))
}

/// The rules of classical MAPF, in the plainest way.
fn assert_solves(plan: &GridPlan, instance: &Instance, map: &SharedEnvironment) {
    let grid = map.grid().unwrap();
    let paths: Vec<&[u32]> = plan.paths().collect();
    assert_eq!(paths.len(), instance.agents());
    let at = |agent: usize, time: usize| paths[agent][time.min(paths[agent].len() - 1)];
    let steps = paths.iter().map(|path| path.len()).max().unwrap();
    for (agent, path) in paths.iter().enumerate() {
        assert_eq!(path[0], instance.starts[agent]);
        assert_eq!(path.last(), instance.goals[agent].last());
        for pair in path.windows(2) {
            let [from, to] = pair.try_into().unwrap();
            let rows = (from / grid.cols).abs_diff(to / grid.cols);
            let cols = (from % grid.cols).abs_diff(to % grid.cols);
            assert!(rows + cols <= 1 && grid.passable[to as usize] == 1);
        }
        for other in 0..agent {
            for time in 0..steps {
                assert_ne!(at(agent, time), at(other, time), "at {time}");
                let swap = at(agent, time) == at(other, time + 1)
                    && at(other, time) == at(agent, time + 1);
                assert!(!swap, "agents {agent} and {other} at {time}");
            }
        }
    }
}

#[test]
fn layered_solves_what_needs_another_order_and_giving_way() {
    let corridor: &[&str] = &["@.@@@", ".....", "@@@.@"];
    let open: &[&str] = &["......"; 5];
    let cases = [
        (corridor, vec![5, 9], vec![9, 5], 9),
        (corridor, vec![1, 5], vec![6, 9], 8),
        (open, (0..15).collect(), (15..30).rev().collect(), 15),
        (open, vec![0], vec![0], 0),
    ];
    for (rows, starts, goals, most_steps) in cases {
        let map = grid(rows, 4);
        let instance = Instance::one_shot(starts, goals);
        let solved = plan(&map, "", &instance, &Notes::default()).unwrap();
        assert_solves(&solved, &instance, &map);
        let steps = solved.paths().map(|path| path.len() - 1).max();
        assert!(steps <= Some(most_steps as usize), "{steps:?} for {rows:?}");
        let again = plan(&map, "{}", &instance, &Notes::default()).unwrap();
        assert_eq!(solved, again, "equal for equal seeds");
    }
}

#[test]
fn layered_says_why_not() {
    let row = grid(&["...@."], 4);
    let cancelled = || Notes {
        cancelled: true.into(),
        ..Notes::default()
    };
    let swap = || Instance::one_shot(vec![0, 2], vec![2, 0]);
    let two_goals = Instance {
        goals: [vec![1, 2]].into_iter().collect(),
        ..Instance::one_shot(vec![0], vec![])
    };
    let cases = [
        (
            Instance::one_shot(vec![0], vec![4]),
            "",
            Notes::default(),
            Status::Infeasible,
        ),
        (
            swap(),
            r#"{"attempts":5}"#,
            Notes::default(),
            Status::GaveUp,
        ),
        (swap(), "", cancelled(), Status::TimedOut),
        (
            Instance::one_shot(vec![0, 1], vec![2, 2]),
            "",
            Notes::default(),
            Status::Unsupported,
        ),
        (two_goals, "", Notes::default(), Status::Unsupported),
        (
            Instance::one_shot(vec![3], vec![2]),
            "",
            Notes::default(),
            Status::InvalidInput,
        ),
        (
            Instance::one_shot(vec![9], vec![2]),
            "",
            Notes::default(),
            Status::InvalidInput,
        ),
        (
            Instance::one_shot(vec![1, 1], vec![2, 0]),
            "",
            Notes::default(),
            Status::InvalidInput,
        ),
        (
            swap(),
            r#"{"speed":5}"#,
            Notes::default(),
            Status::InvalidInput,
        ),
    ];
    for (instance, options, sink, status) in cases {
        let failure = plan(&row, options, &instance, &sink).unwrap_err();
        assert_eq!(failure.status, status, "{failure}");
    }
    let eight = grid(&["..."], 8);
    let failure = plan(&eight, "", &swap(), &Notes::default()).unwrap_err();
    assert_eq!(failure.status, Status::Unsupported);
}

#[test]
fn all_wait_waits() {
    let Object::FailPolicy(mut policy) = create(Kind::FailPolicy, "all-wait", "").unwrap() else {
        panic!("another kind");
    };
    let sink = Notes::default();
    policy.prepare(&grid(&["..."], 4), &BUDGET, &sink).unwrap();
    let instance = Instance::one_shot(vec![2, 0], vec![0, 2]);
    policy.recover(&instance, None, &BUDGET, &sink).unwrap();
    let plans = sink.plans.into_inner().unwrap();
    assert_eq!(plans, [GridPlan::from_paths([[2], [0]])]);
}

#[test]
fn random_goals_are_free_reachable_and_distinct() {
    let Object::InstanceGenerator(mut generator) =
        create(Kind::InstanceGenerator, "random-goals", "").unwrap()
    else {
        panic!("another kind");
    };
    let map = grid(&["...@..", "...@.."], 4);
    let mut state = FleetState {
        time_s: 0.0,
        next: Instance {
            starts: vec![0, 1, 4],
            goals: [vec![], vec![6, 7], vec![]].into_iter().collect(),
            window_steps: 3,
            radius_m: 0.35,
            ..Instance::default()
        },
        tasks: Vec::new(),
        parts: Vec::new(),
    };
    let sink = Notes::default();
    generator.prepare(&map, &BUDGET, &sink).unwrap();
    let mut drawn = BTreeSet::new();
    for seed in 0..40 {
        let budget = Budget { seed, ..BUDGET };
        generator.generate(&state, &budget, &sink).unwrap();
        let request = sink.request.lock().unwrap().take().unwrap();
        request.check(3, 12).unwrap();
        assert_eq!(request.window_steps, 3);
        assert_eq!(request.goals[1], [6, 7]);
        assert!([1, 2, 6, 8].contains(&request.goals[0][0]));
        assert!([5, 10, 11].contains(&request.goals[2][0]));
        drawn.insert(request.goals[0][0]);
    }
    assert_eq!(drawn.len(), 4, "all of them in forty draws");

    // Three agents in two cells' room: nothing is left for the last.
    state.next.starts = vec![4, 5, 10];
    state.next.goals = [vec![11], vec![4], vec![]].into_iter().collect();
    generator.generate(&state, &BUDGET, &sink).unwrap();
    state.next.goals = [vec![4, 11], vec![5], vec![]].into_iter().collect();
    generator.generate(&state, &BUDGET, &sink).unwrap();
    state.next.starts = vec![4, 5, 3];
    let failure = generator.generate(&state, &BUDGET, &sink).unwrap_err();
    assert_eq!(failure.status, Status::GaveUp);
    state.next.starts = vec![4, 5, 12];
    let failure = generator.generate(&state, &BUDGET, &sink).unwrap_err();
    assert_eq!(failure.status, Status::InvalidInput);
}

#[test]
fn periodic_calls_when_it_is_time_or_somebody_is_idle() {
    let cases = [
        (r#"{"period_s":2}"#, 1.5, [1, 3], false),
        (r#"{"period_s":2}"#, 2.0, [1, 3], true),
        (r#"{"period_s":2}"#, 0.0, [1, 0], true),
        (r#"{"period_s":2,"when_idle":false}"#, 0.0, [1, 0], false),
        ("", 5.0, [1, 1], true),
    ];
    for (options, since, actions_left, expected) in cases {
        let Object::InvocationPolicy(mut policy) =
            create(Kind::InvocationPolicy, "periodic", options).unwrap()
        else {
            panic!("another kind");
        };
        let status = FleetStatus {
            time_s: 10.0,
            since_last_call_s: since,
            planning_limit_s: 1.0,
            action_s: 0.5,
            actions_left: actions_left.to_vec(),
        };
        let answer = policy.should_invoke(&status, &Notes::default());
        assert_eq!(answer, Ok(expected), "{options}");
    }
    for options in [r#"{"period_s":-1}"#, r#"{"period_s":"x"}"#, "[]"] {
        let failure = create(Kind::InvocationPolicy, "periodic", options).unwrap_err();
        assert_eq!(failure.status, Status::InvalidInput, "{options}");
    }
}

#[test]
fn every_kind_is_described_once() {
    let descriptors = catalog().descriptors();
    let kinds: BTreeSet<Kind> = descriptors.iter().map(|d| d.kind).collect();
    assert_eq!(kinds.len(), 4);
    for descriptor in descriptors {
        let text = serde_json::to_string(&descriptor).unwrap();
        assert!(!descriptor.description.is_empty(), "{text}");
        assert_eq!(descriptor.license, "MIT OR Apache-2.0", "{text}");
    }
}
