//! Conflict-based search, optimal and bounded-suboptimal.
//!
//! Every agent gets a path of its own; where two paths conflict, the search splits: one of the
//! agents may not do its part (see [`solve`]). With a weight of 1 the plan has the least sum of
//! costs, with larger weights it is at most so much dearer, and usually found much sooner.
//!
//! # What is proven
//!
//! [`End::Infeasible`] is a proof, but where agents block each other for good the search often
//! goes on without end instead. [`Outcome::lower_bound`] is one too.
//!
//! Tests compare the costs with brute force on tiny grids: pebbles and turning robots, with
//! and without delays, rings and each improvement.
//!
//! # Time and memory
//!
//! Both grow exponentially with the number of conflicts that cost something; a node takes a few
//! hundred bytes and [`Settings::memory_limit`] ends the search.
#![forbid(unsafe_code)]

mod constraint;
mod cover;
mod mdd;
pub mod plugin;
mod queue;
mod search;
mod show;
mod symmetry;

use fleetyard_plugin_spacetime::problem::Problem;

pub use constraint::Constraint;
pub use search::{End, Outcome, Settings};

/// Searches for a plan. `stop` is asked often and ends the search when it says so.
pub fn solve(problem: &Problem, settings: &Settings, stop: &mut dyn FnMut() -> bool) -> Outcome {
    search::Search::new(problem, settings.clone()).solve(stop)
}
