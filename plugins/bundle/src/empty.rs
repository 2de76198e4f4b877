//! A planner that does nothing: everybody stays at their start.
//!
//! It measures what a call costs the host, with an answer as long as one wishes, and
//! solves instances in which everybody has arrived already. Of all others it leaves the
//! same plan and says that it gave up.

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, GridPlan, Instance, Kind, Lists,
    SharedEnvironment, Status,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Everybody stays.
#[derive(Debug, Default, Deserialize, Serialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(crate) struct Empty {
    /// Steps for which everybody waits, so that an answer has its length.
    #[schemars(range(max = 1_000_000))]
    steps: u32,
}

impl Plugin for Empty {
    fn descriptor() -> Descriptor {
        Descriptor {
            version: env!("CARGO_PKG_VERSION").into(),
            license: env!("CARGO_PKG_LICENSE").into(),
            capabilities: Capabilities::of(&[
                Capability::Grid,
                Capability::EightConnected,
                Capability::Pebble,
                Capability::Rotation,
                Capability::Windowed,
                Capability::DuplicateGoals,
                Capability::CollidingPlans,
                Capability::Deterministic,
            ]),
            features: vec![Descriptor::FOR_MEASURING.to_owned()],
            options_schema: options_schema::<Self>(),
            ..Descriptor::new(
                Kind::Planner,
                "empty",
                "Leaves everybody at their start: for measuring what a call costs the host.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        options.parse()
    }
}

impl Planner for Empty {
    type Map = ();

    fn prepare(&mut self, _: &SharedEnvironment, _: &Budget, _: &dyn Sink) -> Result<(), Failure> {
        Ok(())
    }

    fn plan(
        &mut self,
        (): &mut (),
        instance: &Instance,
        _: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let length = 1 + self.steps as usize;
        let starts = instance.starts.iter();
        let stay: Lists<u32> = starts.map(|at| std::iter::repeat_n(*at, length)).collect();
        sink.submit(&GridPlan::from(stay))?;
        let mut agents = instance.starts.iter().zip(instance.goals.iter());
        if agents.all(|(start, goals)| goals.iter().all(|goal| goal == start)) {
            Ok(())
        } else {
            let reason = "somebody is not at the goal, and this planner moves nobody";
            Err(Failure::new(Status::GaveUp, reason))
        }
    }
}
