//! A fail policy: everybody waits.
//!
//! Always free of collisions, and nothing more: it gives the next call of the planner
//! another chance. Where a planner fails for good, the fleet stands for good.

use fleetyard_abi::sdk::{FailPolicy, Failure, Options, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, GridPlan, Instance, Kind, Plan, SharedEnvironment,
};

use crate::NoOptions;

/// Keeps every agent where it is.
pub struct AllWait;

impl Plugin for AllWait {
    fn descriptor() -> Descriptor {
        Descriptor {
            name: "All wait (Rust example)".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            license: env!("CARGO_PKG_LICENSE").into(),
            capabilities: Capabilities::of(&[
                Capability::Grid,
                Capability::EightConnected,
                Capability::Pebble,
                Capability::Rotation,
                Capability::Windowed,
                Capability::DuplicateGoals,
                Capability::Deterministic,
            ]),
            ..Descriptor::new(
                Kind::FailPolicy,
                "all-wait",
                "Keeps every agent where it is until the planner is called again.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        options.parse::<NoOptions>()?;
        Ok(Self)
    }
}

impl FailPolicy for AllWait {
    type Map = ();

    fn prepare(&mut self, _: &SharedEnvironment, _: &Budget, _: &dyn Sink) -> Result<(), Failure> {
        Ok(())
    }

    fn recover(
        &mut self,
        (): &mut (),
        instance: &Instance,
        _failed: Option<&Plan>,
        _: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let stay = GridPlan::from_paths(instance.starts.iter().map(|start| [*start]));
        sink.submit(&stay)?;
        Ok(())
    }
}
