//! The waypoint law of the maze benchmark, appendix C, equations 26 to 38.
//!
//! ```text
//! e  = angle of the way − heading                                              27
//! ω* = clip(k_ψ·e, ±ω_max)                                                     28
//! v* = α·min(v_max, d, sqrt(2·a_dec·d))                                        30
//! α  = 0 if |e| ≥ θ_turn, 1 if |e| ≤ θ_drive, else 1 − σ((|e| − θ_drive)/(θ_turn − θ_drive))    31
//! σ(z) = z²·(3 − 2z)                                                           32
//! v, ω: slewed by a₊·Δt when growing in size, else by a₋·Δt                    33, 34
//! |v| ≤ v_max·max(0.18, 1 − 0.68·|ω|/ω_max)                                    35, 36
//! wheels: v ∓ b·ω/2, over r for the axle                                       37, 38
//! ```

use core::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::error::{MotionError, limit, tolerance_m, within};
use super::law::wrap;
use super::{State, Target};

/// A differential drive that steers while it drives: the smaller its heading error, the
/// faster.
///
/// The paper gives the law and not the values; the defaults are those of a Clearpath
/// Husky (its default robot) where published, and otherwise our choice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WaypointLaw {
    /// `v_max`; by default 1 m/s (Husky).
    pub max_speed_m_per_s: f64,
    /// `ω_max`; by default 1.5 rad/s.
    pub max_turn_rate_rad_per_s: f64,
    /// `k_ψ`; by default 3 per second.
    pub heading_gain_per_s: f64,
    /// `a_dec` of the braking bound; by default 1 m/s².
    pub braking_m_per_s2: f64,
    /// `θ_drive`: full speed up to this heading error; by default 0.1 rad.
    pub drive_within_rad: f64,
    /// `θ_turn`: no speed from this heading error on; by default 0.6 rad.
    pub turn_beyond_rad: f64,
    /// `a_v,+`; by default 1 m/s².
    pub speed_up_m_per_s2: f64,
    /// `a_v,−`; by default 2 m/s².
    pub slow_down_m_per_s2: f64,
    /// `a_ω,+`; by default 4 rad/s².
    pub turn_up_rad_per_s2: f64,
    /// `a_ω,−`; by default 6 rad/s².
    pub turn_down_rad_per_s2: f64,
    /// Share of the speed lost at the full turn rate; 0.68 in equation 35.
    pub turn_slowdown: f64,
    /// Least share of the speed; 0.18 in equation 35.
    pub turn_floor: f64,
    /// `b`, the distance between the wheels; by default 0.555 m (Husky).
    pub axle_track_m: f64,
    /// `r`; by default 0.165 m (Husky).
    pub wheel_radius_m: f64,
    /// `ε` of every waypoint but the last; by default 0.05 m.
    pub arrival_tolerance_m: f64,
    /// `ε` of the last waypoint, no less than that of the others, and by default the
    /// same. The body counts as arrived there, and goes on to `arrival_tolerance_m`.
    pub final_tolerance_m: Option<f64>,
    /// Tolerance of a requested heading; by default 1°. The paper has no headings.
    pub heading_tolerance_rad: f64,
}

impl Default for WaypointLaw {
    fn default() -> Self {
        Self {
            max_speed_m_per_s: 1.0,
            max_turn_rate_rad_per_s: 1.5,
            heading_gain_per_s: 3.0,
            braking_m_per_s2: 1.0,
            drive_within_rad: 0.1,
            turn_beyond_rad: 0.6,
            speed_up_m_per_s2: 1.0,
            slow_down_m_per_s2: 2.0,
            turn_up_rad_per_s2: 4.0,
            turn_down_rad_per_s2: 6.0,
            turn_slowdown: 0.68,
            turn_floor: 0.18,
            axle_track_m: 0.555,
            wheel_radius_m: 0.165,
            arrival_tolerance_m: 0.05,
            final_tolerance_m: None,
            heading_tolerance_rad: PI / 180.0,
        }
    }
}

/// Speeds of the two wheels in a tick, equations 37 and 38.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WheelSpeeds {
    /// Over ground, in metres per second.
    pub left_m_per_s: f64,
    /// Over ground, in metres per second.
    pub right_m_per_s: f64,
    /// Of the axle, in radians per second.
    pub left_rad_per_s: f64,
    /// Of the axle, in radians per second.
    pub right_rad_per_s: f64,
}

impl WaypointLaw {
    pub(super) fn validate(&self) -> Result<(), MotionError> {
        let limits = [
            ("max_speed_m_per_s", self.max_speed_m_per_s),
            ("max_turn_rate_rad_per_s", self.max_turn_rate_rad_per_s),
            ("heading_gain_per_s", self.heading_gain_per_s),
            ("braking_m_per_s2", self.braking_m_per_s2),
            ("speed_up_m_per_s2", self.speed_up_m_per_s2),
            ("slow_down_m_per_s2", self.slow_down_m_per_s2),
            ("turn_up_rad_per_s2", self.turn_up_rad_per_s2),
            ("turn_down_rad_per_s2", self.turn_down_rad_per_s2),
            ("axle_track_m", self.axle_track_m),
            ("wheel_radius_m", self.wheel_radius_m),
        ];
        for (field, value) in limits {
            limit(field, value)?;
        }
        let hint =
            "the angles of the gate must ascend: 0 <= drive_within_rad < turn_beyond_rad <= π/2";
        within(
            "turn_beyond_rad",
            self.turn_beyond_rad,
            1e-6,
            0.5 * PI,
            hint,
        )?;
        // A width above zero, by which the gate's argument is divided.
        let most = self.turn_beyond_rad - 1e-9;
        within("drive_within_rad", self.drive_within_rad, 0.0, most, hint)?;
        let hint = "give a share between 0 and 1";
        within("turn_slowdown", self.turn_slowdown, 0.0, 1.0, hint)?;
        within("turn_floor", self.turn_floor, 0.0, 1.0, hint)?;
        tolerance_m("arrival_tolerance_m", self.arrival_tolerance_m)?;
        within(
            "final_tolerance_m",
            self.final_tolerance_m(),
            self.arrival_tolerance_m,
            1e3,
            "give metres between arrival_tolerance_m and 1000",
        )?;
        let hint = "give radians between 1e-6 and 3";
        within(
            "heading_tolerance_rad",
            self.heading_tolerance_rad,
            1e-6,
            3.0,
            hint,
        )
    }

    /// `ε` of the last waypoint.
    pub(super) fn final_tolerance_m(&self) -> f64 {
        self.final_tolerance_m.unwrap_or(self.arrival_tolerance_m)
    }

    /// Wheel speeds in the tick that ends in `state`.
    pub fn wheel_speeds(&self, state: &State) -> WheelSpeeds {
        let (sin, cos) = libm::sincos(state.heading);
        let speed = state.vx * cos + state.vy * sin;
        let half = 0.5 * self.axle_track_m * state.omega;
        let (left, right) = (speed - half, speed + half);
        WheelSpeeds {
            left_m_per_s: left,
            right_m_per_s: right,
            left_rad_per_s: left / self.wheel_radius_m,
            right_rad_per_s: right / self.wheel_radius_m,
        }
    }

    /// The heading gate α, equations 31 and 32.
    fn gate(&self, error: f64) -> f64 {
        if error >= self.turn_beyond_rad {
            return 0.0;
        }
        if error <= self.drive_within_rad {
            return 1.0;
        }
        let width = self.turn_beyond_rad - self.drive_within_rad;
        let z = (error - self.drive_within_rad) / width;
        1.0 - z * z * (3.0 - 2.0 * z)
    }

    pub(super) fn run(
        &self,
        state: &mut State,
        target: &Target,
        ticks: usize,
        dt: f64,
        factor: f64,
        visit: &mut impl FnMut(&State),
    ) {
        let max_speed = self.max_speed_m_per_s * factor;
        let max_turn = self.max_turn_rate_rad_per_s * factor;
        let near = self.arrival_tolerance_m * self.arrival_tolerance_m;
        state.face();
        for tick in 0..ticks {
            let (dx, dy, squared) = state.way(target);
            let mut speed = state.vx * state.cos + state.vy * state.sin;
            let mut omega = state.omega;
            let (mut to_turn, mut to_drive) = (0.0, 0.0);
            if squared > near {
                // 26 to 30. The angle of the way in the frame of the body is its error.
                let distance = squared.sqrt();
                let ahead = dx * state.cos + dy * state.sin;
                let aside = dy * state.cos - dx * state.sin;
                let error = libm::atan2(aside, ahead);
                to_turn = self.heading_gain_per_s * error;
                let brake = (2.0 * self.braking_m_per_s2 * distance).sqrt();
                to_drive = self.gate(error.abs()) * max_speed.min(distance).min(brake);
            } else if let Some(heading) = target.heading {
                let error = wrap(heading - state.heading);
                if error.abs() > self.heading_tolerance_rad {
                    to_turn = self.heading_gain_per_s * error;
                }
            }
            if to_drive == 0.0 && to_turn == 0.0 && speed == 0.0 && omega == 0.0 {
                for _ in tick..ticks {
                    visit(state);
                }
                return;
            }
            let to_turn = to_turn.max(-max_turn).min(max_turn);
            speed = slew(
                speed,
                to_drive,
                self.speed_up_m_per_s2 * dt,
                self.slow_down_m_per_s2 * dt,
            );
            omega = slew(
                omega,
                to_turn,
                self.turn_up_rad_per_s2 * dt,
                self.turn_down_rad_per_s2 * dt,
            );
            // 35 and 36, with the limit of the model rather than that of this block.
            let turning = (omega.abs() / self.max_turn_rate_rad_per_s).min(1.0);
            let share = (1.0 - self.turn_slowdown * turning).max(self.turn_floor);
            let most = self.max_speed_m_per_s * share;
            speed = speed.max(-most).min(most);
            state.omega = omega;
            state.heading += omega * dt;
            state.face();
            state.vx = speed * state.cos;
            state.vy = speed * state.sin;
            state.x += state.vx * dt;
            state.y += state.vy * dt;
            visit(state);
        }
    }

    /// Largest distance from the straight line of a body that starts from rest.
    ///
    /// It starts at the turn gate, at no more than `a_v,+ · t`, with an error that
    /// shrinks at the turn rate and then exponentially.
    pub(super) fn lateral_tolerance_m(&self) -> f64 {
        let (gain, rate) = (self.heading_gain_per_s, self.max_turn_rate_rad_per_s);
        let first = self.turn_beyond_rad;
        let clipped = ((first - rate / gain) / rate).max(0.0);
        let then = first.min(rate / gain);
        let drift = first * clipped * clipped / 2.0 + then * (clipped / gain + 1.0 / (gain * gain));
        self.speed_up_m_per_s2.max(self.slow_down_m_per_s2) * drift + self.arrival_tolerance_m
    }
}

/// Equations 33 and 34.
fn slew(now: f64, wanted: f64, up: f64, down: f64) -> f64 {
    let faster = wanted * now > 0.0 && wanted.abs() > now.abs();
    let most = if faster { up } else { down };
    now + (wanted - now).max(-most).min(most)
}
