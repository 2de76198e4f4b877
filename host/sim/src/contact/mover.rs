//! Obstacles on scripted paths.

use fleetyard_world::{Pose, Shape};
use rapier2d_f64::prelude::RigidBodyHandle;

use super::ContactError;

/// An obstacle that goes where it is told, whatever is in its way. Between the
/// knots of its path it moves uniformly; before the first and after the last it
/// stands.
#[derive(Debug, Clone)]
pub struct Mover {
    /// Convex parts and where each is in the frame of the mover: those of a
    /// [`Polygon`](fleetyard_world::Polygon), or one shape at the origin.
    pub parts: Vec<(Pose, Shape)>,
    /// Seconds and poses, at least one, in strictly ascending order of time.
    pub path: Vec<(f64, Pose)>,
}

impl Mover {
    pub(super) fn check(&self, mover: u32) -> Result<(), ContactError> {
        let fault = |knot, reason| {
            Err(ContactError::Path {
                mover,
                knot,
                reason,
            })
        };
        if self.path.is_empty() {
            return fault(0, "is missing");
        }
        for (knot, (time, pose)) in self.path.iter().enumerate() {
            if !(time.is_finite() && pose.is_finite()) {
                return fault(knot, "has a number that is not finite");
            }
            if knot > 0 && *time <= self.path[knot - 1].0 {
                return fault(knot, "is not later than the one before");
            }
        }
        Ok(())
    }

    pub(super) fn pose_at(&self, time_s: f64) -> Pose {
        let next = self.path.partition_point(|(time, _)| *time <= time_s);
        let Some((from, start)) = next.checked_sub(1).map(|at| self.path[at]) else {
            return self.path[0].1;
        };
        match self.path.get(next) {
            Some((to, end)) => start.toward(*end, (time_s - from) / (to - from)),
            None => start,
        }
    }
}

/// A mover and its body.
#[derive(Debug)]
pub(super) struct Moving {
    pub(super) mover: Mover,
    pub(super) handle: RigidBodyHandle,
}
