//! Large neighbourhood search: plans are repaired, and then made better, by planning a few
//! agents anew at a time.
//!
//! - [`repair`]: from paths that collide as little as one agent at a time can help it, to
//!   paths that do not collide at all: the planner `mapf-lns2`;
//! - [`fleetyard_plugin_spacetime::refine`] makes the result cheaper for as long as it may:
//!   the planner `mapf-lns`.
//!
//! Every agent has a start and a goal of its own, where it stays. The library reads no
//! clock: the same problem, seed and limit of nodes give the same plans on any machine and
//! with any number of threads.
#![forbid(unsafe_code)]

pub mod fewest;
pub mod plugin;
pub mod repair;
