//! Conflict-based search over rapidly-exploring random trees (R. Veerapaneni, N. Sobanbabu, G. Shi, J. Li, M. Likhachev, "Towards
//! unstructured MAPF: multi-quadruped MAPF demo", 2025, section 3, "MAPF Solver").
//!
//! - [`edge`]: one robot among what stands, and its motions from rest to rest;
//! - [`barred`]: what it has to keep clear of, and when;
//! - [`tree`]: a tree in place, heading and time;
//! - [`way`]: the ways that come of it, and shortcuts;
//! - [`blend`]: two motions in one, without a stop between them;
//! - [`overlap`]: the point that a constraint names;
//! - [`search`]: the conflict tree.
//!
//! | paper | here |
//! |---|---|
//! | single-agent planner, an RRT | [`tree::Tree`] |
//! | collisions by a finely discretised checker | [`clash`](crate::scene::clash), exact |
//! | collision point in the overlap | [`overlap::common_point`] |
//! | vertex constraint for a time range | [`barred::Constraint`], [`Options::delta_s`] |
//! | greedy CBS by (number of conflicts, sum of times) | [`search`] |

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub mod barred;
pub mod blend;
pub mod edge;
pub mod overlap;
pub mod search;
pub mod tree;
pub mod way;

/// Options of `cbs-rrt`. The paper publishes none of its numbers.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// A constraint bars its point from so long before a collision until as long after it, in seconds.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub delta_s: f64,
    /// That time doubles with each further constraint of the same two robots.
    pub widen: bool,
    /// A robot that is planned anew keeps clear of the others' ways as well, where it finds such a way. The paper's does not.
    pub avoid: bool,
    /// Most samples of a tree.
    #[schemars(range(min = 1))]
    pub samples: u64,
    /// Longest motion of a tree, in metres; motions to the goal may be longer.
    #[schemars(range(min = 0.01, max = 10000.0))]
    pub step_m: f64,
    /// Share of samples that are drawn near the robot's last way.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub guide_bias: f64,
    /// Greatest distance of those samples from it, in metres.
    #[schemars(range(min = 0.0, max = 10000.0))]
    pub spread_m: f64,
    /// Attempts to shorten each way.
    #[schemars(range(max = 1_000_000))]
    pub shortcuts: u32,
    /// A robot with limits of acceleration that goes in all directions does not stop where it need not.
    pub blend: bool,
    /// Nodes of the conflict tree after which the search begins anew with other ways.
    #[schemars(range(min = 1))]
    pub restart_nodes: u64,
    /// Most beginnings.
    #[schemars(range(min = 1))]
    pub restarts: u64,
    /// Times that every robot of a plan is planned anew to make it shorter, at most: a round without success is the last one.
    pub rounds: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            delta_s: 1.0,
            widen: true,
            avoid: true,
            samples: 3000,
            step_m: 2.0,
            guide_bias: 0.2,
            spread_m: 3.0,
            shortcuts: 200,
            blend: true,
            restart_nodes: 100,
            restarts: 100,
            rounds: 10,
        }
    }
}
