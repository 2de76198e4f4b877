//! Everybody stays where it is.
//!
//! J. Morag, R. Stern, A. Felner, "Adapting to planning failures in lifelong multi-agent path
//! finding", SoCS 2023, compare better policies with it.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, GridPlan, Instance};
use fleetyard_plugin_spacetime::plugin::Call;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Policy, Recovery};

/// Keeps everybody where it is.
pub type AllWait = Policy<AllWaitOptions>;

/// Options of `all-wait`: none.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct AllWaitOptions {}

impl Recovery for AllWaitOptions {
    const NAMES: (&'static str, &'static str) = ("all-wait", "All wait");
    const ABOUT: &'static str = "Keeps everybody where it is until the planner is called again.";
    const EXTRA: &'static [Capability] = &[Capability::EightConnected];
    type Map = ();

    fn recover(
        &self,
        (): &mut (),
        instance: &Instance,
        _: Option<&GridPlan>,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        let stay = instance.starts.iter().map(|start| [*start]);
        call.submit(&GridPlan::from_paths(stay));
        Ok(())
    }
}
