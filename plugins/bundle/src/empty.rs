//! A planner that does nothing: everybody stays at their start.
//!
//! It measures what a call costs the host, and solves instances in which
//! everybody has arrived already. Of all others it leaves the same plan and says
//! that it gave up.

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, Instance, Kind, PlanRef, SharedEnvironment,
    Status,
};

/// Everybody stays.
pub(crate) struct Empty;

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
            ..Descriptor::new(
                Kind::Planner,
                "empty",
                "Leaves everybody at their start: for measuring what a call costs the host.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        let _: std::collections::BTreeMap<String, ()> = options.parse()?;
        Ok(Self)
    }
}

impl Planner for Empty {
    fn prepare(&mut self, _: &SharedEnvironment, _: &Budget, _: &dyn Sink) -> Result<(), Failure> {
        Ok(())
    }

    fn plan(&mut self, instance: &Instance, _: &Budget, sink: &dyn Sink) -> Result<(), Failure> {
        let offsets: Vec<u64> = (0..=instance.agents() as u64).collect();
        if let Some(plan) = PlanRef::new(&offsets, &instance.starts) {
            sink.submit_plan(plan)?;
        }
        let mut agents = instance.starts.iter().zip(instance.goals.iter());
        if agents.all(|(start, goals)| goals.iter().all(|goal| goal == start)) {
            Ok(())
        } else {
            let reason = "somebody is not at the goal, and this planner moves nobody";
            Err(Failure::new(Status::GaveUp, reason))
        }
    }
}
