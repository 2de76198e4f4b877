//! Local repair by guided waits: agents follow the paths that the planner left, and wait where
//! they would collide.
//!
//! The name and the idea are those of the program that comes with J. Li, A. Tinka, S. Kiesel,
//! J. W. Durham, T. K. S. Kumar, S. Koenig, "Lifelong multi-agent path finding in large-scale
//! warehouses", AAAI 2021. That the order in which agents pass stays the planner's is from
//! Y. Zhang, Z. Chen, D. Harabor, P. Le Bodic, P. J. Stuckey, "Planning and execution in
//! multi-agent path finding: models and algorithms", ICAPS 2024.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{GridPlan, Instance};
use fleetyard_plugin_spacetime::plugin::Call;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Policy, Problem, Recovery, convoy};
use crate::ground::Ground;

/// Follows the failed paths with as few waits as keep agents apart.
pub type Lrgw = Policy<LrgwOptions>;

/// Options of `lrgw`: none.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LrgwOptions {}

impl Recovery for LrgwOptions {
    const NAMES: (&'static str, &'static str) = ("lrgw", "LRGW");
    const ABOUT: &'static str = "Local repair by guided waits: agents follow the paths that the \
         planner left and wait where they would collide, in the order in which the planner lets \
         them pass (Li, Tinka, Kiesel, Durham, Kumar, Koenig, AAAI 2021; Zhang, Chen, Harabor, Le \
         Bodic, Stuckey, ICAPS 2024). Who has no path waits.";
    type Map = Ground;

    fn recover(
        &self,
        ground: &mut Ground,
        instance: &Instance,
        failed: Option<&GridPlan>,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        let problem = Problem::new(ground, instance)?;
        let paths = problem.paths(failed);
        let driven = convoy::drive(&problem, &paths, &mut || call.stop());
        problem.submit(&driven, call);
        Ok(())
    }
}
