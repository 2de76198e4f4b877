//! What planners of teams say alike behind the plugin contract.

use fleetyard_abi::{Budget, Capabilities, Capability, Descriptor, Kind};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::problem::GoalRule;

/// Bytes for tables of distances, and again for the search, where the budget says nothing.
pub const MEMORY: u64 = 1 << 30;

/// What an agent does after its last goal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Goals {
    /// It stays there; where several agents share it a visit is enough.
    #[default]
    Stay,
    /// A visit is enough: it may go on to where it is in nobody's way (MAPF4L).
    Transient,
}

impl From<Goals> for GoalRule {
    fn from(goals: Goals) -> Self {
        match goals {
            Goals::Stay => Self::Stay,
            Goals::Transient => Self::Transient,
        }
    }
}

/// Half of what the budget allows: for tables of distances, and again for the search.
pub fn half_of_memory(budget: &Budget) -> u64 {
    match budget.memory_bytes {
        0 => MEMORY,
        bytes => bytes / 2,
    }
}

/// The descriptor of a planner that comes with the product, without options.
pub fn descriptor(
    id: &str,
    name: &str,
    description: &str,
    common: &[Capability],
    extra: &[Capability],
) -> Descriptor {
    let all: Vec<_> = common.iter().chain(extra).copied().collect();
    Descriptor {
        name: name.into(),
        version: env!("CARGO_PKG_VERSION").into(),
        license: env!("CARGO_PKG_LICENSE").into(),
        capabilities: Capabilities::of(&all),
        ..Descriptor::new(Kind::Planner, id, description)
    }
}
