//! Cars that steer with their front wheels, and may tow a trailer.
//!
//! A car has no controller: it follows plans exactly, by time. What it can do is judged.

use core::f64::consts::PI;

use fleetyard_world::{Dynamics, Trailer, Travel};
use serde::{Deserialize, Serialize};

use super::error::{MotionError, limit, within};

/// A car whose speed and steering angle are set at once. Its reference point is the middle of its rear
/// axle. The defaults are those of `car1_v0` of dynobench, without the trailer.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Car {
    /// Largest speed ahead; by default 0.5 m/s.
    pub max_speed_m_per_s: f64,
    /// Largest speed back; by default 0.1 m/s.
    pub max_reverse_m_per_s: f64,
    /// Distance of its axles; by default 0.25 m.
    pub wheelbase_m: f64,
    /// Largest steering angle to either side; by default π/3.
    pub max_steering_rad: f64,
    /// The trailer that it tows.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub trailer: Option<Trailer>,
}

impl Default for Car {
    fn default() -> Self {
        Self {
            max_speed_m_per_s: 0.5,
            max_reverse_m_per_s: 0.1,
            wheelbase_m: 0.25,
            max_steering_rad: PI / 3.0,
            trailer: None,
        }
    }
}

impl Car {
    pub(super) fn validate(&self) -> Result<(), MotionError> {
        let size = |field, value| {
            let hint = "give metres between 1e-3 and 1000";
            within(field, value, 1e-3, 1e3, hint)
        };
        let angle = |field, value| {
            let hint = "give radians between 1e-3 and 1.5, which is less than a quarter turn";
            within(field, value, 1e-3, 1.5, hint)
        };
        limit("max_speed_m_per_s", self.max_speed_m_per_s)?;
        let hint = "give a number between 0 and 1e6; 0 for a car that does not reverse";
        let reverse = self.max_reverse_m_per_s;
        within("max_reverse_m_per_s", reverse, 0.0, 1e6, hint)?;
        size("wheelbase_m", self.wheelbase_m)?;
        angle("max_steering_rad", self.max_steering_rad)?;
        if let Some(trailer) = self.trailer {
            size("trailer.hitch_m", trailer.hitch_m)?;
            size("trailer.length_m", trailer.length_m)?;
            size("trailer.width_m", trailer.width_m)?;
            angle("trailer.max_joint_rad", trailer.max_joint_rad)?;
        }
        Ok(())
    }

    pub(super) fn top_speed(&self) -> f64 {
        self.max_speed_m_per_s.max(self.max_reverse_m_per_s)
    }

    /// Turn per metre at the largest steering angle, in radians.
    pub(super) fn curvature(&self) -> f64 {
        libm::tan(self.max_steering_rad) / self.wheelbase_m
    }

    pub(super) fn dynamics(&self) -> Dynamics {
        Dynamics {
            travel: Travel::Wheels {
                forward: self.max_speed_m_per_s,
                backward: self.max_reverse_m_per_s,
                acceleration: f64::INFINITY,
                deceleration: f64::INFINITY,
            },
            turn_rad_per_s: self.curvature() * self.top_speed(),
            turn_acceleration_rad_per_s2: f64::INFINITY,
            curvature_rad_per_m: self.curvature(),
        }
    }
}
