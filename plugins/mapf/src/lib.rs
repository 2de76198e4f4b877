//! Grid planners: PIBT and LaCAM*.
#![forbid(unsafe_code)]

mod distance;
mod graph;
mod lacam;
mod neighborhood;
mod one_shot;
mod pibt;
mod plan;
pub mod plugin;
mod problem;
mod random;
mod refine;
mod reservation;
mod scatter;
mod sipp;
mod solve;

pub use plan::Plan;
pub use problem::{Problem, ProblemError};
pub use solve::{Algorithm, Limit, Observer, Options, Outcome, solve};
