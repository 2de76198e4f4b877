//! Origin of a derived view.

use fleetyard_core::Digest;
use serde::Serialize;
use serde_json::Value;

use crate::Problem;

/// The value of `format` in files that say how a view came about.
pub const VIEW_FORMAT: &str = "fleetyard.view/1";

/// Operator, parameters and sources of what was derived.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Origin {
    /// The operator's name.
    pub operator: &'static str,
    /// Its parameters, as they were used.
    pub parameters: Value,
    /// The seed, if the operator draws anything.
    pub seed: Option<u64>,
    /// Digest of the world.
    pub world_digest: Digest,
    /// Digest of the problem: world, robots, starts and goals.
    pub problem_digest: Digest,
}

impl Origin {
    /// Of a view that is derived from a problem.
    pub(crate) fn of(
        problem: &Problem,
        operator: &'static str,
        parameters: Value,
        seed: Option<u64>,
    ) -> Self {
        Self {
            operator,
            parameters,
            seed,
            world_digest: problem.world.digest(),
            problem_digest: problem.digest(),
        }
    }
}
