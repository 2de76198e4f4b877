//! The generator without a host: `cargo test`.

mod host;

use fleetyard_abi::sdk::{Failure, InstanceGenerator, Options, Plugin};
use fleetyard_abi::{FleetState, Instance, Status, Task};
use host::{BUDGET, Host, map};

use example_plugin::NearestIdle;

/// The goals of two agents in a corridor: the first has nothing to do, the second has a
/// goal, and there is one task.
fn generate(row: &str, cells: [u32; 2], goal: u32, task: &[u32]) -> Result<Vec<Vec<u32>>, Failure> {
    let host = Host::default();
    let mut generator = NearestIdle::create(Options::new("{}"))?;
    let mut map = generator.prepare(&map(&[row]), &BUDGET, &host)?;
    let state = FleetState {
        time_s: 0.0,
        next: Instance {
            starts: cells.to_vec(),
            goals: [vec![], vec![goal]].into_iter().collect(),
            ..Instance::default()
        },
        tasks: vec![Task {
            id: 7,
            places: task.to_vec(),
            released_s: 0.0,
        }],
        parts: Vec::new(),
    };
    generator.generate(&mut map, &state, &BUDGET, &host)?;
    Ok(host.goals.into_inner().unwrap())
}

#[test]
fn who_is_idle_gets_the_task() {
    let goals = generate("......", [0, 5], 2, &[4, 1]).unwrap();
    assert_eq!(goals, [vec![4, 1], vec![2]]);
}

#[test]
fn no_two_agents_end_in_one_cell() {
    assert_eq!(generate("....", [0, 3], 1, &[2, 1]).unwrap(), [[0], [1]]);
    assert_eq!(generate("....", [1, 3], 1, &[2, 1]).unwrap(), [[0], [1]]);
    let none_left = generate(".@.", [0, 2], 0, &[0, 0]).unwrap_err();
    assert_eq!(none_left.status, Status::GaveUp);
}

#[test]
fn nobody_is_sent_behind_a_wall() {
    assert_eq!(generate("..@.", [0, 1], 1, &[1, 3]).unwrap(), [[0], [1]]);
}
