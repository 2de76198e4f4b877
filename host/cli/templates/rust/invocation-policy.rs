//! Calls the planner every so many seconds, and when somebody has nothing left to do.
//!
//! Put your own rule into `should_invoke`.

use fleetyard_abi::sdk::{Failure, InvocationPolicy, Options, Plugin, Sink, options_schema};
use fleetyard_abi::{Descriptor, FleetStatus, Kind};
use schemars::JsonSchema;
use serde::Deserialize;

fleetyard_abi::export! { invocation_policies: [Periodic] }

/// The options, as in `--option NAME=VALUE`. The host checks them before the policy starts.
#[derive(Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct PeriodicOptions {
    /// Simulated seconds between calls.
    #[schemars(range(min = 0.0))]
    period_s: f64,
}

impl Default for PeriodicOptions {
    fn default() -> Self {
        Self { period_s: 5.0 }
    }
}

/// Calls the planner periodically, and when an agent has nothing left to do.
pub struct Periodic {
    options: PeriodicOptions,
}

impl Plugin for Periodic {
    fn descriptor() -> Descriptor {
        Descriptor {
            version: env!("CARGO_PKG_VERSION").into(),
            options_schema: options_schema::<PeriodicOptions>(),
            ..Descriptor::new(
                Kind::InvocationPolicy,
                env!("CARGO_PKG_NAME"),
                "Calls the planner periodically, and when an agent has nothing left to do.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        let options = options.parse()?;
        Ok(Self { options })
    }
}

impl InvocationPolicy for Periodic {
    fn should_invoke(&mut self, status: &FleetStatus, _: &dyn Sink) -> Result<bool, Failure> {
        let idle = status.actions_left.contains(&0);
        Ok(idle || status.since_last_call_s >= self.options.period_s)
    }
}
