//! Conversions between plain coordinates in flat arrays and the glam vectors of rapier
//! and parry.

pub use fleetyard_core::{cell_center_m, cell_of_point};
use fleetyard_world::Pose;
use rapier2d_f64::math::{Pose as Isometry, Rotation, Vector};

/// A vector of rapier.
pub(crate) fn vector(x: f64, y: f64) -> Vector {
    Vector::new(x, y)
}

/// A pose of rapier.
pub(crate) fn isometry(pose: Pose) -> Isometry {
    let (cos, sin) = pose.rotation();
    Isometry::from_parts(
        vector(pose.x, pose.y),
        Rotation::from_cos_sin_unchecked(cos, sin),
    )
}
