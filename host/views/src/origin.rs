//! Origin of a derived view.

use fleetyard_core::{Digest, Grid, Roadmap};
use serde::Serialize;
use serde_json::Value;

use crate::Problem;

/// The value of `format` in files that say how a view came about.
pub const VIEW_FORMAT: &str = "fleetyard.view/1";

/// The operators that derive views from a task alone.
pub(crate) const WORLD_TO_GRID: &str = "world-to-grid";
pub(crate) const WORLD_TO_ROADMAP: &str = "world-to-roadmap";

/// Operator, parameters and sources of what was derived.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Origin {
    /// The operator's name.
    pub operator: &'static str,
    /// Its parameters, as they were used.
    pub parameters: Value,
    /// The seed, if the operator draws anything.
    pub seed: Option<u64>,
    /// Digest of the world, if the view is derived from one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub world_digest: Option<Digest>,
    /// Digest of the problem: world, robots, starts and goals.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub problem_digest: Option<Digest>,
    /// Digest of the roadmap, if the view is derived from one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub roadmap_digest: Option<Digest>,
    /// Digest of the map, likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub map_digest: Option<Digest>,
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
            world_digest: Some(problem.world.digest()),
            problem_digest: Some(problem.digest()),
            roadmap_digest: None,
            map_digest: None,
        }
    }

    /// Of a view that is derived from a problem and a roadmap.
    pub(crate) fn of_roadmap(
        problem: &Problem,
        roadmap: &Roadmap,
        operator: &'static str,
        parameters: Value,
    ) -> Self {
        Self {
            roadmap_digest: Some(roadmap.digest()),
            ..Self::of(problem, operator, parameters, None)
        }
    }

    /// Of what is derived from a map.
    pub(crate) fn of_map(grid: &Grid, operator: &'static str, parameters: Value) -> Self {
        Self {
            operator,
            parameters,
            seed: None,
            world_digest: None,
            problem_digest: None,
            roadmap_digest: None,
            map_digest: Some(grid.digest()),
        }
    }
}
