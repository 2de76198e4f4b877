//! Everybody stays where it is.

use fleetyard_abi::sdk::{FailPolicy, Failure, Options, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Instance, Kind, Plan, PlanRef, SharedEnvironment,
};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::described;

/// Keeps everybody where it is. J. Morag, R. Stern, A. Felner, "Adapting to planning failures in
/// lifelong multi-agent path finding", SoCS 2023, compare better policies with it.
#[derive(Debug)]
pub struct AllWait;

/// Options of `all-wait`: none.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct AllWaitOptions {}

impl Plugin for AllWait {
    fn descriptor() -> Descriptor {
        described::<AllWaitOptions>(
            Kind::FailPolicy,
            ("all-wait", "All wait"),
            "Keeps everybody where it is until the planner is called again.",
            &[
                Capability::Grid,
                Capability::EightConnected,
                Capability::Pebble,
                Capability::Rotation,
                Capability::Windowed,
                Capability::DuplicateGoals,
                Capability::Deterministic,
            ],
        )
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        let AllWaitOptions {} = options.parse()?;
        Ok(Self)
    }
}

impl FailPolicy for AllWait {
    fn prepare(&mut self, _: &SharedEnvironment, _: &Budget, _: &dyn Sink) -> Result<(), Failure> {
        Ok(())
    }

    fn recover(
        &mut self,
        instance: &Instance,
        _: Option<PlanRef<'_>>,
        _: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let stay = instance.starts.iter().map(|start| [*start]);
        sink.submit_plan(Plan::from_paths(stay).as_ref())?;
        Ok(())
    }
}
