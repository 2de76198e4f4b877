//! Settings of a fleet, and the times of its calls.

use fleetyard_abi::Kind;
use fleetyard_fleet::{CallTimes, FleetConfig};

#[test]
fn seeds_depend_on_run_module_and_call() {
    let config = FleetConfig::default();
    let other = FleetConfig {
        seed: 1,
        ..FleetConfig::default()
    };
    let mut seeds = vec![
        config.call_seed(Kind::Planner, 0),
        config.call_seed(Kind::Planner, 1),
        config.call_seed(Kind::FailPolicy, 0),
        other.call_seed(Kind::Planner, 0),
    ];
    seeds.sort_unstable();
    seeds.dedup();
    assert_eq!(seeds.len(), 4);
}

#[test]
fn numbers_out_of_range_are_named() {
    let config = FleetConfig {
        limit_s: f64::NAN,
        ..FleetConfig::default()
    };
    let error = config.validate().unwrap_err();
    assert!(error.to_string().contains("limit_s"), "{error}");
    assert!(error.hint().is_some());
}

#[test]
fn windows_and_looks_ahead_are_rounded_up() {
    let mut config = FleetConfig {
        window_s: 10.0,
        limit_s: 1.2,
        ..FleetConfig::default()
    };
    config.sim.step_s = 0.5;
    assert_eq!(config.window_steps(), 20);
    // Discs stop at once, when they hear of it.
    assert_eq!(config.lookahead(None), 3 + 1);
}

#[test]
fn percentiles_are_of_the_nearest_rank() {
    let times = CallTimes::of((1..=100).rev().map(f64::from).collect());
    let expected = CallTimes {
        mean: 50.5,
        p50: 50.0,
        p95: 95.0,
        max: 100.0,
    };
    assert_eq!(times, expected);
    assert_eq!(CallTimes::of(vec![]), CallTimes::default());
    let one = CallTimes::of(vec![3.0]);
    assert_eq!(
        [one.p50, one.p95].map(f64::to_bits),
        [3.0; 2].map(f64::to_bits)
    );
}
