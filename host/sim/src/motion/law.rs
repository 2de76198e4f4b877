//! The law by which one coordinate approaches its target at rest, under limits.
//!
//! A tick sets a speed and moves by speed · Δt. Let a be the deceleration to plan with and
//! q = a·Δt what a tick can take from the speed. A body that has a distance d to go, moves
//! at v in this tick and loses q in each tick after it stops within d exactly if
//!
//! ```text
//! v ≤ sqrt(2·a·d) − q/2      if sqrt(2·a·d) ≥ q
//! v ≤ d/Δt                   else: what is left fits one tick
//! ```
//!
//! This is v ≤ sqrt(2·a·d) of continuous time, less what ticks of finite length cost. It
//! reproduces itself: whoever moves at the bound meets the bound of the next tick by
//! losing q. So a body that keeps it never has to brake harder than a, never passes its
//! target, and lands on it, at any tick length.

use core::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use super::error::{MotionError, within};

/// Distances below this, in metres or radians, count as zero.
pub(super) const THERE: f64 = 1e-9;

/// Gains of a controller, whose requested speed is p · error + i · ∫ error dt − d ·
/// speed, before any limit.
///
/// The derivative acts on the measured speed (the target is at rest), so that a new
/// target gives no kick. The integral grows only while no limit holds the speed back, and
/// is cleared at rest.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Pid {
    /// Proportional gain in 1/s. From 1/Δt on, only the limits matter.
    pub p: f64,
    /// Integral gain in 1/s².
    pub i: f64,
    /// Derivative gain, dimensionless.
    pub d: f64,
}

impl Default for Pid {
    /// So stiff that only the limits matter at up to 1000 ticks per second.
    fn default() -> Self {
        Self::proportional(1000.0)
    }
}

impl Pid {
    /// A proportional controller.
    pub const fn proportional(p: f64) -> Self {
        Self { p, i: 0.0, d: 0.0 }
    }

    pub(super) fn validate(&self, fields: [&'static str; 3]) -> Result<(), MotionError> {
        let hint = "give gains between 0 and 1e6, p at least 1e-3: without it nothing moves";
        within(fields[0], self.p, 1e-3, 1e6, hint)?;
        within(fields[1], self.i, 0.0, 1e6, hint)?;
        within(fields[2], self.d, 0.0, 1e6, hint)
    }
}

/// One coordinate under limits, prepared for ticks of one length.
#[derive(Debug, Clone, Copy)]
pub(super) struct Axis {
    pid: Pid,
    cap: f64,
    /// Largest increase and decrease of the speed per tick.
    up: f64,
    down: f64,
    /// The terms 2·a, q and q/2 of the law.
    two_a: f64,
    q: f64,
    half_q: f64,
    dt: f64,
    per_dt: f64,
}

impl Axis {
    /// Speed changes by at most `accelerate` and `decelerate` per second; the law plans
    /// with `brake`, at most `decelerate`.
    pub(super) fn new(
        pid: Pid,
        cap: f64,
        [accelerate, decelerate, brake]: [f64; 3],
        dt: f64,
    ) -> Self {
        let q = brake * dt;
        Self {
            pid,
            cap,
            up: accelerate * dt,
            down: decelerate * dt,
            two_a: 2.0 * brake,
            q,
            half_q: 0.5 * q,
            dt,
            per_dt: 1.0 / dt,
        }
    }

    /// Speed changes at once. In the terms of the law: the rest always fits one tick.
    pub(super) fn first_order(pid: Pid, cap: f64, dt: f64) -> Self {
        Self {
            pid,
            cap,
            up: f64::INFINITY,
            down: f64::INFINITY,
            two_a: 0.0,
            q: 1.0,
            half_q: 0.5,
            dt,
            per_dt: 1.0 / dt,
        }
    }

    /// True if no motion is possible.
    pub(super) fn is_stalled(&self) -> bool {
        self.cap <= 0.0
    }

    /// The largest speed from which a body stops within `gap`.
    #[inline]
    pub(super) fn bound(&self, gap: f64) -> f64 {
        let s = (self.two_a * gap).sqrt();
        if s >= self.q {
            s - self.half_q
        } else {
            gap * self.per_dt
        }
    }

    /// Speed of the next tick, from the current speed and the signed `gap` to go.
    #[inline]
    pub(super) fn next(&self, speed: f64, gap: f64, integral: &mut f64) -> f64 {
        let mut wanted = 0.0;
        let size = gap.abs();
        if size > THERE {
            let asked = self.pid.p * gap + self.pid.i * *integral - self.pid.d * speed;
            let limit = self.cap.min(self.bound(size));
            wanted = if gap > 0.0 {
                asked.max(0.0).min(limit)
            } else {
                asked.min(0.0).max(-limit)
            };
            if asked.abs() <= limit {
                *integral += gap * self.dt;
            }
        }
        self.slew(speed, wanted)
    }

    /// The speed nearest to `wanted` that a tick reaches.
    #[inline]
    pub(super) fn slew(&self, speed: f64, wanted: f64) -> f64 {
        // Through zero, at most as fast as from zero.
        let (low, high) = if speed >= 0.0 {
            ((speed - self.down).max(-self.up), speed + self.up)
        } else {
            (speed - self.up, (speed + self.down).min(self.up))
        };
        wanted.max(low).min(high)
    }

    /// [`Axis::next`] for a body that moves forwards or rests, with the square root only
    /// where it begins to brake and where it ends.
    #[inline]
    pub(super) fn next_forward(&self, speed: f64, gap: f64, integral: &mut f64) -> f64 {
        let asked = self.pid.p * gap + self.pid.i * *integral - self.pid.d * speed;
        let room = self.two_a * gap;
        let faster = (speed + self.up).min(self.cap);
        let square = (faster + self.half_q) * (faster + self.half_q);
        // If this holds, `faster` is below the bound in both of its cases.
        if square <= room && speed <= self.cap && faster <= asked {
            return faster;
        }
        // A body at the bound stays there by losing q; rounding makes the check
        // necessary.
        let slower = speed - self.q;
        let square = (slower + self.half_q) * (slower + self.half_q);
        if slower > 0.0
            && (square - room).abs() <= 1e-10 * room
            && slower <= self.cap
            && slower <= asked
        {
            return slower;
        }
        self.next(speed, gap, integral).max(0.0)
    }
}

/// The largest speed of a tick from which a body stops within `gap`.
pub(crate) fn stopping_speed(gap: f64, deceleration: f64, dt: f64) -> f64 {
    Axis::new(Pid::default(), f64::INFINITY, [deceleration; 3], dt).bound(gap)
}

/// The angle in (−π, π] that differs from `angle` by whole turns.
///
/// Exact: no rounding happens. Up to one turn out of range the one subtraction is exact
/// (Sterbenz); beyond that the remainder of IEEE 754 is. A turn is the `f64` nearest to 2π.
pub fn wrap(angle: f64) -> f64 {
    if angle > -PI && angle <= PI {
        return angle;
    }
    let wrapped = if angle.abs() <= 3.0 * PI {
        angle - TAU.copysign(angle)
    } else {
        libm::remainder(angle, TAU)
    };
    if wrapped <= -PI { PI } else { wrapped }
}
