//! Local repair by guided waits: agents follow the paths that the planner left, and wait where
//! they would collide.
//!
//! The name and the idea are those of the program that comes with J. Li, A. Tinka, S. Kiesel,
//! J. W. Durham, T. K. S. Kumar, S. Koenig, "Lifelong multi-agent path finding in large-scale
//! warehouses", AAAI 2021. That the order in which agents pass stays the planner's is from
//! Y. Zhang, Z. Chen, D. Harabor, P. Le Bodic, P. J. Stuckey, "Planning and execution in
//! multi-agent path finding: models and algorithms", ICAPS 2024.

use fleetyard_abi::sdk::{FailPolicy, Failure, Options, Plugin, Sink};
use fleetyard_abi::{Budget, Capability, Descriptor, Instance, Kind, PlanRef};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Question, convoy, learns, stop};
use crate::ground::Ground;
use crate::{described, unprepared};

/// Follows the failed paths with as few waits as keep agents apart.
#[derive(Debug)]
pub struct Lrgw {
    ground: Option<Ground>,
}

/// Options of `lrgw`: none.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct LrgwOptions {}

impl Plugin for Lrgw {
    fn descriptor() -> Descriptor {
        described::<LrgwOptions>(
            Kind::FailPolicy,
            ("lrgw", "LRGW"),
            "Local repair by guided waits: agents follow the paths that the planner left and wait \
             where they would collide, in the order in which the planner lets them pass (Li, \
             Tinka, Kiesel, Durham, Kumar, Koenig, AAAI 2021; Zhang, Chen, Harabor, Le Bodic, \
             Stuckey, ICAPS 2024). Who has no path waits.",
            &[
                Capability::Grid,
                Capability::Pebble,
                Capability::Rotation,
                Capability::Windowed,
                Capability::DuplicateGoals,
                Capability::Deterministic,
            ],
        )
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        let LrgwOptions {} = options.parse()?;
        Ok(Self { ground: None })
    }
}

impl FailPolicy for Lrgw {
    learns!();

    fn recover(
        &mut self,
        instance: &Instance,
        failed: Option<PlanRef<'_>>,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let ground = self.ground.as_ref().ok_or_else(unprepared)?;
        let question = Question::new(ground, instance)?;
        let paths = question.paths(failed);
        let driven = convoy::drive(&question, &paths, &mut stop(budget, sink));
        question.submit(&driven, sink)
    }
}
