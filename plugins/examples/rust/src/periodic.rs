//! An invocation policy: every so many seconds, and when somebody runs out of work.

use fleetyard_abi::sdk::{Failure, InvocationPolicy, Options, Plugin, Sink, options_schema};
use fleetyard_abi::{Descriptor, FleetStatus, Kind, Status};
use schemars::JsonSchema;
use serde::Deserialize;

/// Calls the planner periodically.
pub struct Periodic {
    options: PeriodicOptions,
}

#[derive(Debug, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct PeriodicOptions {
    /// Seconds of simulated time between calls.
    #[schemars(range(min = 0.0))]
    period_s: f64,
    /// Call early when an agent has nothing left to do.
    when_idle: bool,
}

impl Default for PeriodicOptions {
    fn default() -> Self {
        Self {
            period_s: 5.0,
            when_idle: true,
        }
    }
}

impl Plugin for Periodic {
    fn descriptor() -> Descriptor {
        Descriptor {
            name: "Periodic (Rust example)".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            license: env!("CARGO_PKG_LICENSE").into(),
            options_schema: options_schema::<PeriodicOptions>(),
            ..Descriptor::new(
                Kind::InvocationPolicy,
                "periodic",
                "Calls the planner every so many seconds of simulated time, and when an agent \
                 has nothing left to do.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        let options: PeriodicOptions = options.parse()?;
        if !(options.period_s >= 0.0 && options.period_s.is_finite()) {
            let reason = "options: `period_s` is not a number of 0 or more";
            return Err(Failure::new(Status::InvalidInput, reason));
        }
        Ok(Self { options })
    }
}

impl InvocationPolicy for Periodic {
    fn should_invoke(&mut self, status: &FleetStatus, _: &dyn Sink) -> Result<bool, Failure> {
        let idle = self.options.when_idle && status.actions_left.contains(&0);
        Ok(idle || status.since_last_call_s >= self.options.period_s)
    }
}
