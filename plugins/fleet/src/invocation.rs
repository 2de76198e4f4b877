//! Invocation policies: they decide when the planner is called.
//!
//! Both rules are those that "LSMART" compares (see [`crate::generate`]): at a fixed interval, or
//! when some robot would be idle before a new plan could take effect.

use fleetyard_abi::sdk::{Failure, InvocationPolicy, Options, Plugin, Sink};
use fleetyard_abi::{Descriptor, FleetStatus, Kind};
use fleetyard_plugin_spacetime::plugin::{described, parse};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::invalid;

/// Tolerance for times that are sums of many short ones, in seconds.
const TOLERANCE_S: f64 = 1e-6;

/// Calls the planner at a fixed interval.
#[derive(Debug)]
pub struct Periodic {
    period_s: f64,
}

/// Options of `periodic`.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PeriodicOptions {
    /// Simulated seconds from one call of the planner to the next.
    #[schemars(range(min = 0.001))]
    period_s: f64,
}

impl Default for PeriodicOptions {
    fn default() -> Self {
        Self { period_s: 1.0 }
    }
}

impl Plugin for Periodic {
    fn descriptor() -> Descriptor {
        described::<PeriodicOptions>(
            Kind::InvocationPolicy,
            ("periodic", "Periodic"),
            "Calls the planner every `period_s` simulated seconds.",
            [&[], &[]],
        )
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        let check = |PeriodicOptions { period_s }: &PeriodicOptions| {
            if *period_s >= 0.001 && period_s.is_finite() {
                return Ok(());
            }
            Err(format!(
                "`period_s` is {period_s}, but has to be 0.001 or more"
            ))
        };
        let PeriodicOptions { period_s } = parse(options, check)?;
        Ok(Self { period_s })
    }
}

impl InvocationPolicy for Periodic {
    fn should_invoke(&mut self, status: &FleetStatus, _: &dyn Sink) -> Result<bool, Failure> {
        Ok(status.since_last_call_s + TOLERANCE_S >= self.period_s)
    }
}

/// Calls the planner when somebody would have nothing left to do before its answer could take
/// effect.
#[derive(Debug)]
pub struct EventBased;

/// Options of `event-based`: none.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EventBasedOptions {}

impl Plugin for EventBased {
    fn descriptor() -> Descriptor {
        described::<EventBasedOptions>(
            Kind::InvocationPolicy,
            ("event-based", "Event-based"),
            "Calls the planner when some agent has fewer committed actions left than it can \
             finish within the planner's limit.",
            [&[], &[]],
        )
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        let EventBasedOptions {} = options.parse()?;
        Ok(Self)
    }
}

impl InvocationPolicy for EventBased {
    fn should_invoke(&mut self, status: &FleetStatus, _: &dyn Sink) -> Result<bool, Failure> {
        let FleetStatus {
            planning_limit_s,
            action_s,
            ..
        } = *status;
        if !(planning_limit_s >= 0.0 && action_s > 0.0) {
            return Err(invalid(format!(
                "the planner's limit is {planning_limit_s} s and an action takes {action_s} s"
            )));
        }
        // Who has nothing at all to do is reason enough, however fast the planner is.
        let enough = ((planning_limit_s - TOLERANCE_S) / action_s)
            .ceil()
            .max(1.0);
        let least = status.actions_left.iter().min();
        Ok(least.is_some_and(|least| f64::from(*least) < enough))
    }
}

#[cfg(test)]
mod tests {
    use fleetyard_abi::sdk::Rejected;
    use fleetyard_abi::{LogLevel, PlanRef, Request, Status};

    use super::*;

    struct Deaf;

    impl Sink for Deaf {
        fn submit_plan(&self, _: PlanRef<'_>) -> Result<(), Rejected> {
            Err(Rejected::Malformed)
        }
        fn submit_request(&self, _: &Request) -> Result<(), Rejected> {
            Err(Rejected::Malformed)
        }
        fn note(&self, _: &str, _: &str) {}
        fn metric(&self, _: &str, _: f64) {}
        fn log(&self, _: LogLevel, _: &str) {}
        fn progress(&self, _: u64, _: u64) {}
        fn cancelled(&self) -> bool {
            false
        }
    }

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
        let mut ask = |since| policy.should_invoke(&status(since, 1.0, &[0]), &Deaf);
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
        let mut ask = |limit, left: &[u32]| policy.should_invoke(&status(0.0, limit, left), &Deaf);
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
}
