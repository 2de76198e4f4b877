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
