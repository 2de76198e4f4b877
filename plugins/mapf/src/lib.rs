//! Grid planners: PIBT and LaCAM*.
//!
//! One-shot multi-agent path finding on 4-connected grids: every agent has a start and a
//! goal of its own, moves to a neighbouring cell or waits in each step, no two may be in a
//! cell at a time and no two may change places. An agent costs the time of its last
//! arrival at its goal; the sum over the agents is to be small.
//!
//! - [`Algorithm::Pibt`] makes one step after the other by priority inheritance with
//!   backtracking. It is fastest and may fail.
//! - [`Algorithm::LacamStar`] searches over whole configurations and lets PIBT propose
//!   successors. It finds a plan if there is one, proves it if there is none, and, as long
//!   as it is given time, goes on to better plans: by searching on, and by replanning small
//!   groups of agents (large neighbourhood search).
//!
//! [`solve`] is the way in. Plans are told to an [`Observer`] as they come; the observer
//! also says when to stop. The library reads no clock: the same [`Problem`], [`Options`] and
//! seed give the same first plan, and the same plans in the same order as far as the run
//! gets, on any machine and with any number of threads.
//!
//! # What is proven
//!
//! [`Outcome::Infeasible`] is a proof. The `lower_bound` of [`Outcome::Solved`] is one too:
//! it is the sum of the shortest paths, or, when the search was exhausted, the least sum of
//! *loss* (steps not spent resting at the goal), which never exceeds the least sum of costs.
//! A plan whose cost equals it is optimal. Exhausting the search is a matter of a few agents.
//!
//! # Time and memory
//!
//! With N agents, V passable cells and a plan of T steps, and k = [`Options::samples`]:
//!
//! - distance tables: N·V steps and 2·N·V bytes at most; only what is looked at is computed
//!   before the first plan;
//! - guidance ([`Options::scatter_margin`]): up to ten searches per agent within the ellipse
//!   of short paths, 5·V·(T + margin) bytes while it is computed, none above 1 GiB;
//! - first plan: about k·N·T agent moves, 8·N·T bytes;
//! - refinement: a few thousand states per replanned agent, 5·V·T/8 bytes per thread.
//!
//! 1000 agents on a warehouse map of 5700 cells have a first plan in less than half a second
//! of processor time, and 25 MB. For the first plan alone set [`Options::anytime`] to false;
//! for the quickest one also `samples` to 1 and `scatter_margin` to `None`, which costs a
//! third in plan quality.
#![forbid(unsafe_code)]

pub mod epibt;
mod lacam;
pub mod lifelong;
mod one_shot;
mod pibt;
pub mod plugin;
mod scatter;
mod share;
mod solve;
pub mod streets;
mod watch;
pub mod wppl;

pub use fleetyard_plugin_spacetime::problem::ProblemError;
pub use solve::{Algorithm, Limit, Observer, Options, Outcome, Problem, solve};
pub use watch::Watch;
