//! Simultaneous sampling and search planning (K. Okumura, X. Défago, "Quick multi-robot motion planning by combining sampling and
//! search", IJCAI 2023): roadmaps are sampled where the search for a team goes.
//!
//! - [`bodies`]: discs and convex polygons in motion, and when they touch;
//! - [`roadmap`]: the roadmap of one robot, and how it grows;
//! - [`search`]: moves one after the other that bring everybody to its goal (algorithm 1);
//! - [`push`]: the same by robots that push each other away;
//! - [`order`]: the same moves at once, in the same order where they meet (section 5);
//! - [`refine`]: ways and times that are better.
//!
//! | paper | here |
//! |---|---|
//! | `connect`, `collide` | [`Robot::connects`](roadmap::Robot::connects), [`bodies::hits`] |
//! | `sample`, `dist`, `steer`, θ | [`roadmap::Sampler`], [`Options`] |
//! | Q, next | [`search`]: the vertices of all robots, and who moves |
//! | temporal plan graph | [`order::schedule`] |

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

pub mod bodies;
pub mod order;
pub mod push;
pub mod refine;
pub mod roadmap;
pub mod search;

/// Options of `sssp`, with the names and defaults of the authors' program. Distances are shares of the longer side of the
/// world.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// A new vertex is farther than this from all others of its roadmap.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub init_min_dist_thread: f64,
    /// The factor of that distance after each search that ends without a plan.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub decreasing_rate_min_dist_thread: f64,
    /// Poses that are sampled for every vertex that the search expands.
    #[schemars(range(max = 10000))]
    pub num_vertex_expansion: u32,
    /// Halvings of a way that touches an obstacle, to find a shorter one that does not.
    #[schemars(range(max = 50))]
    pub steering_depth: u32,
    /// Longest edge of a roadmap; without it, of any length.
    #[schemars(range(min = 0.0))]
    pub epsilon: Option<f64>,
    /// Robots may push each other out of the way before the search is asked.
    pub pushes: bool,
    /// Most attempts to make the first plan better; without it, until the budget ends.
    pub refinements: Option<u64>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            init_min_dist_thread: 0.1,
            decreasing_rate_min_dist_thread: 0.99,
            num_vertex_expansion: 10,
            steering_depth: 2,
            epsilon: None,
            pushes: true,
            refinements: None,
        }
    }
}
