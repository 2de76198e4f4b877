//! The policy without a host: `cargo test`.

mod host;

use fleetyard_abi::FleetStatus;
use fleetyard_abi::sdk::{InvocationPolicy, Options, Plugin};
use host::Host;

use example_plugin::Periodic;

/// The policy's answer about two agents.
fn should_invoke(options: &str, since_s: f64, left: u32) -> bool {
    let status = FleetStatus {
        time_s: 100.0,
        since_last_call_s: since_s,
        planning_limit_s: 1.0,
        action_s: 0.5,
        actions_left: vec![left, 3],
    };
    let mut policy = Periodic::create(Options::new(options)).unwrap();
    policy.should_invoke(&status, &Host::default()).unwrap()
}

#[test]
fn calls_when_it_is_time() {
    assert!(!should_invoke("{}", 4.9, 1));
    assert!(should_invoke("{}", 5.0, 1));
    assert!(should_invoke(r#"{"period_s": 2}"#, 2.0, 1));
}

#[test]
fn calls_when_somebody_is_idle() {
    assert!(should_invoke("{}", 0.0, 0));
}
