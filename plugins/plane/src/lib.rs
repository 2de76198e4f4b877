//! Geometry of discs in the plane, for planners of roadmaps and of continuous space.
//!
//! The host judges plans with code of its own (`host/world`, `host/check`). Nothing here is shared with it, so that a
//! fault of one is found by the other.
//!
//! - [`motion`]: straight motions of discs, and when two of them are too close;
//! - [`spans`]: sets of open intervals of time;
//! - [`bins`]: which boxes are near each other;
//! - [`obstacles`]: polygons that a disc must not touch;
//! - [`tangent`]: the shortest path of one disc among them;
//! - [`timing`]: the times of a disc on a given way among others;
//! - [`orders`]: orders of priority;
//! - [`prioritised`]: teams of discs in the plane;
//! - [`team`]: teams of discs in space and time together;
//! - [`sssp`]: teams of discs and polygons, by sampling and search at once;
//! - [`plugin`]: the planners behind the contract.
#![forbid(unsafe_code)]

pub mod bins;
pub mod motion;
pub mod obstacles;
pub mod orders;
pub mod plugin;
pub mod prioritised;
pub mod spans;
pub mod sssp;
pub mod tangent;
pub mod team;
pub mod timing;

/// A place or a displacement, in metres.
pub type Vector = nalgebra::Vector2<f64>;
