//! The independent plan validator and the metrics of Fleetyard.
//!
//! A plan is judged here and nowhere else. This crate takes an instance and the
//! paths that someone claims to solve it, and knows no planner, no plugin, no
//! simulator and no clock: what a planner says of its own plan has no way in.
//! [`validate`] judges plans on grids, [`validate_terms`] those of
//! which more or less is asked than an instance does, [`validate_paths`] those whose cells need not
//! be neighbours, [`validate_roadmap`] plans on roadmaps, [`validate_trajectories`] plans in
//! continuous space and time.

#![forbid(unsafe_code)]

mod continuous;
mod controls;
mod metrics;
mod path;
mod roadmap;
mod trailers;
mod validate;
mod verdict;

pub use continuous::{
    BeyondLimit, ContinuousRule, ContinuousTask, ContinuousVerdict, ContinuousViolation, Near,
    Tolerance, validate_trajectories,
};
pub use controls::{ControlTask, MOST_DRIVEN_KNOTS};
pub use metrics::{PlanMetrics, TravelCosts, metrics};
pub use path::{PathRule, validate_paths};
pub use roadmap::{
    Pace, RoadmapRule, RoadmapTask, RoadmapVerdict, RoadmapViolation, validate_roadmap,
};
pub use trailers::TrailerTask;
pub use validate::{Terms, validate, validate_terms};
pub use verdict::{CellPosition, Rule, Verdict, Violation};
