//! Settings of a fleet, and the times of its calls.

use fleetyard_abi::Kind;
use fleetyard_fleet::{CallTimes, Decay, FleetConfig, Point};

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

/// A run in which so many goals are reached per second, and three of ten robots stand.
fn series(seconds: u32, goals_per_s: impl Fn(u32) -> u64) -> Vec<Point> {
    let mut goals_reached = 0;
    let points = (1..=seconds).map(|second| {
        goals_reached += goals_per_s(second);
        Point {
            time_s: f64::from(second),
            goals_reached,
            waiting: 3,
            adg_nodes: 0,
            planner_calls: 0,
            fail_calls: 0,
        }
    });
    points.collect()
}

#[test]
fn a_fall_of_throughput_is_told_from_chance_and_from_a_slow_beginning() {
    assert_eq!(Decay::of(&[], 10), None);
    assert_eq!(Decay::of(&series(1000, |_| 5), 10), None);
    assert_eq!(
        Decay::of(&series(1000, |second| u64::from(second > 500)), 10),
        None
    );
    // Five goals instead of ten in 200 s may be chance; 500 instead of 1000 are not.
    let halved = |every: u32, goals: u64| {
        series(1000, move |second| match second {
            ..=800 => goals * u64::from(second.is_multiple_of(every)),
            _ => goals * u64::from(second.is_multiple_of(2 * every)),
        })
    };
    assert_eq!(Decay::of(&halved(20, 1), 10), None);
    let known = Decay {
        best_per_s: 5.0,
        last_per_s: 2.5,
        still_share: 0.3,
    };
    assert_eq!(Decay::of(&halved(1, 5), 10), Some(known));
    // A tenth less is none, and neither is anything in a run of a few minutes.
    let less = series(1000, |second| 10 - u64::from(second > 800));
    assert_eq!(Decay::of(&less, 10), None);
    assert_eq!(
        Decay::of(&series(290, |second| 300 - u64::from(second)), 10),
        None
    );
}
