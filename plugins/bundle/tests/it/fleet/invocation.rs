//! Invocation policies.

use fleetyard_abi::sdk::{InvocationPolicy, Options, Plugin};
use fleetyard_abi::{FleetStatus, Status};
use fleetyard_plugin_fleet::invocation::{EventBased, Periodic};
use fleetyard_testkit::Notes;

fn status(since_last_call_s: f64, planning_limit_s: f64, left: &[u32]) -> FleetStatus {
    FleetStatus {
        time_s: 100.0,
        since_last_call_s,
        planning_limit_s,
        action_s: 0.5,
        actions_left: left.to_vec(),
    }
}

#[test]
fn periods_are_kept_to_the_tick() {
    let mut policy = Periodic::create(Options::new(r#"{"period_s":0.3}"#)).unwrap();
    let mut ask = |since| policy.should_invoke(&status(since, 1.0, &[0]), &Notes::default());
    assert_eq!(ask(0.2), Ok(false));
    // Less than 0.3 by the last bit.
    assert_eq!(ask(0.1 + 0.1 + 0.1 - 1e-12), Ok(true));
    assert_eq!(ask(7.0), Ok(true));
    for wrong in ["0", "-1", "1e-9", "\"x\""] {
        let options = format!("{{\"period_s\":{wrong}}}");
        let failure = Periodic::create(Options::new(&options)).unwrap_err();
        assert_eq!(failure.status, Status::InvalidInput, "{wrong}");
    }
}

#[test]
fn events_are_too_few_actions() {
    let mut policy = EventBased::create(Options::new("{}")).unwrap();
    let mut ask =
        |limit, left: &[u32]| policy.should_invoke(&status(0.0, limit, left), &Notes::default());
    // Within a second two actions can be done.
    assert_eq!(ask(1.0, &[2, 9]), Ok(false));
    assert_eq!(ask(1.0, &[9, 1]), Ok(true));
    assert_eq!(ask(1.1, &[2, 9]), Ok(true));
    assert_eq!(ask(0.0, &[1]), Ok(false));
    assert_eq!(ask(0.0, &[0]), Ok(true));
    assert_eq!(ask(1.0, &[]), Ok(false));
    assert!(ask(f64::NAN, &[1]).is_err());
    assert!(EventBased::create(Options::new(r#"{"x":1}"#)).is_err());
}
