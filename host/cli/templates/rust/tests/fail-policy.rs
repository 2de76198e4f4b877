//! The policy without a host: `cargo test`.

mod host;

use fleetyard_abi::sdk::{FailPolicy, Options, Plugin};
use fleetyard_abi::{GridPlan, Instance, Plan};
use host::{BUDGET, Host, map};

use example_plugin::SafePrefix;

/// Paths of the policy for two agents at the ends of a corridor of four cells.
fn recover(options: &str, failed: Option<[&[u32]; 2]>) -> Vec<Vec<u32>> {
    let host = Host::default();
    let failed = failed.map(|paths| Plan::Cells(GridPlan::from_paths(paths)));
    let mut policy = SafePrefix::create(Options::new(options)).unwrap();
    let mut map = policy.prepare(&map(&["...."]), &BUDGET, &host).unwrap();
    let instance = Instance::one_shot(vec![0, 3], vec![3, 0]);
    policy
        .recover(&mut map, &instance, failed.as_ref(), &BUDGET, &host)
        .unwrap();
    host.paths.into_inner().unwrap()
}

const THROUGH: [&[u32]; 2] = [&[0, 1, 2, 3], &[3, 2, 1, 0]];

#[test]
fn stops_before_the_collision() {
    assert_eq!(recover("{}", Some(THROUGH)), [[0, 1], [3, 2]]);
}

#[test]
fn takes_no_more_steps_than_it_may() {
    assert_eq!(recover(r#"{"steps": 0}"#, Some(THROUGH)), [[0], [3]]);
}

#[test]
fn waits_where_there_is_nothing_to_follow() {
    assert_eq!(recover("{}", Some([&[0, 9], &[3]])), [[0], [3]]);
    assert_eq!(recover("{}", None), [[0], [3]]);
}
