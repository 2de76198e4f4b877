//! The one place that converts between vector types: rapier and parry speak glam
//! vectors; the rest of this crate speaks plain coordinates in flat arrays.

pub use fleetyard_core::{cell_center_m, cell_of_point};
use rapier2d_f64::math::Vector;

/// A vector of rapier.
pub(crate) fn vector(x: f64, y: f64) -> Vector {
    Vector::new(x, y)
}
