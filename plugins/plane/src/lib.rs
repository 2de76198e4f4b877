//! Geometry of discs in the plane, for planners of roadmaps and of continuous space.
//!
//! The host judges plans with code of its own (`host/world`, `host/check`). Nothing here is shared with it, so that a
//! fault of one is found by the other.
//!
//! - [`motion`]: straight motions of discs, and when two of them are too close;
//! - [`spans`]: sets of open intervals of time;
//! - [`bins`]: which boxes are near each other.
#![forbid(unsafe_code)]

pub mod bins;
pub mod motion;
pub mod spans;

/// A place or a displacement, in metres.
pub type Vector = nalgebra::Vector2<f64>;
