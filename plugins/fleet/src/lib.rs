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
pub mod ground;
pub mod invocation;
pub mod recover;

use fleetyard_abi::Status;
use fleetyard_abi::sdk::Failure;

fn invalid(reason: impl Into<String>) -> Failure {
    Failure::new(Status::InvalidInput, reason)
}
