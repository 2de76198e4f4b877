//! The example planner without a host, and the program where no host speaks to it.

#[allow(unreachable_pub, reason = "the file is one of the templates'")]
#[path = "../../../../host/cli/templates/rust/tests/host.rs"]
mod host;

use std::process::{Command, Stdio};

use fleetyard_abi::Instance;
use fleetyard_abi::sdk::{Options, Planner, Plugin};
use fleetyard_example_rust::Layered;
use host::{BUDGET, Host, map};

/// One of them goes into the bay.
#[test]
fn agents_pass_each_other_in_a_corridor() {
    let host = Host::default();
    let mut planner = Layered::create(Options::new("{}")).unwrap();
    let corridor = map(&["....", "@.@@"]);
    let mut map = planner.prepare(&corridor, &BUDGET, &host).unwrap();
    let instance = Instance::one_shot(vec![0, 3], vec![3, 0]);
    planner.plan(&mut map, &instance, &BUDGET, &host).unwrap();
    let paths = host.paths.into_inner().unwrap();
    let at = |agent: usize, time: usize| paths[agent][time.min(paths[agent].len() - 1)];
    assert_eq!([at(0, 99), at(1, 99)], [3, 0]);
    for time in 0..9 {
        let (now, next) = (
            [at(0, time), at(1, time)],
            [at(1, time + 1), at(0, time + 1)],
        );
        assert!(now[0] != now[1] && now != next, "{paths:?}");
    }
}

#[test]
fn the_program_ends_with_its_input() {
    let mut program = Command::new(env!("CARGO_BIN_EXE_fleetyard-example-rust"));
    let ended = program.stdin(Stdio::null()).output().unwrap();
    assert!(ended.status.success(), "{ended:?}");
}
