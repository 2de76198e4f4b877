//! Invocation policies, instance generators and fail policies for fleets that work without
//! an end: what decides when a planner is asked, what it is asked, and what is done when it
//! fails.
//!
//! - [`invocation`]: `periodic`, `event-based`;
//! - [`generate`]: `distinct-one-goal`, `one-goal`, `windowed-multi-goals`;
//! - [`recover`]: `pibt`, `guided-pibt`, `lrgw`, `rule-based`, `all-wait`.
//!
//! All of them know 4-connected grids only, and none remembers anything from one call to the
//! next that would change an answer: a recorded run goes on from anywhere as it went.
#![forbid(unsafe_code)]

pub mod generate;
mod ground;
pub mod invocation;
pub mod recover;

use fleetyard_abi::sdk::{Failure, options_schema};
use fleetyard_abi::{Capabilities, Capability, Descriptor, Kind, Status};
use schemars::JsonSchema;

/// A descriptor with what all plugins of this crate have in common.
fn described<Options: JsonSchema>(
    kind: Kind,
    (id, name): (&str, &str),
    about: &str,
    capabilities: &[Capability],
) -> Descriptor {
    Descriptor {
        name: name.into(),
        version: env!("CARGO_PKG_VERSION").into(),
        license: env!("CARGO_PKG_LICENSE").into(),
        capabilities: Capabilities::of(capabilities),
        options_schema: options_schema::<Options>(),
        ..Descriptor::new(kind, id, about)
    }
}

fn invalid(reason: impl Into<String>) -> Failure {
    Failure::new(Status::InvalidInput, reason)
}
