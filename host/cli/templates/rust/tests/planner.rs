//! The planner without a host: `cargo test`.

mod host;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin};
use fleetyard_abi::{Instance, Status};
use host::{BUDGET, Host, map};

use example_plugin::Prioritized;

/// The paths that the planner finds.
fn plan(rows: &[&str], starts: &[u32], goals: &[u32]) -> Result<Vec<Vec<u32>>, Failure> {
    let host = Host::default();
    let mut planner = Prioritized::create(Options::new(r#"{"attempts": 3}"#))?;
    let mut map = planner.prepare(&map(rows), &BUDGET, &host)?;
    let instance = Instance::one_shot(starts.to_vec(), goals.to_vec());
    planner.plan(&mut map, &instance, &BUDGET, &host)?;
    Ok(host.paths.into_inner().unwrap())
}

#[test]
fn the_path_of_one_agent_is_shortest() {
    assert_eq!(plan(&["..", ".."], &[0], &[1]).unwrap(), [[0, 1]]);
}

#[test]
fn agents_do_not_meet() {
    let paths = plan(&["....", "@@.@"], &[0, 3], &[3, 0]).unwrap();
    let at = |agent: usize, time: usize| paths[agent][time.min(paths[agent].len() - 1)];
    assert_eq!((at(0, 99), at(1, 99)), (3, 0));
    for time in 0..9 {
        assert_ne!(at(0, time), at(1, time));
        assert_ne!(
            (at(0, time), at(0, time + 1)),
            (at(1, time + 1), at(1, time))
        );
    }
}

#[test]
fn says_when_there_is_no_plan() {
    let status =
        |rows, starts: &[u32], goals: &[u32]| plan(rows, starts, goals).unwrap_err().status;
    assert_eq!(status(&[".@."], &[0], &[2]), Status::Infeasible);
    assert_eq!(status(&["..."], &[0, 2], &[2, 0]), Status::GaveUp);
}
