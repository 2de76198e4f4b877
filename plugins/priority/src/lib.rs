//! Planners of teams by priorities: prioritized planning and priority-based search.
//!
//! Both plan one agent after the other, each so that it keeps out of the way of those with
//! higher priority, by SIPP over their paths
//! ([`sipp`](fleetyard_plugin_spacetime::sipp)). They differ in where priorities come from:
//!
//! - [`prioritized`]: a total order, and another one when some agent finds no path;
//! - [`search`]: a partial order that grows only where two agents collide, by depth-first
//!   search over the ways to decide.
//!
//! Neither is complete nor optimal; both are fast. They take goals in sequence, windows,
//! robots that turn, and goals that agents share
//! ([`Problem`](fleetyard_plugin_spacetime::problem::Problem)). The library reads no clock:
//! the same problem, options and seed give the same plan, unless the run is stopped.
#![forbid(unsafe_code)]

mod planner;
pub mod plugin;
pub mod prioritized;
pub mod search;

pub use planner::{Control, Outcome};
