//! Robots that turn in place and drive straight on: the time that turns and drives take them.
//!
//! J. Yan, J. Li ("Multi-agent motion planning for differential drive robots through stationary state search", AAAI 2025)
//! search from one state of rest to the next; what is between them is a turn in place and a straight drive. Here a drive is
//! along the edges of a straight line: the robot speeds up along the first, goes on at one speed, and brakes along the last.

use std::f64::consts::PI;

use fleetyard_abi::{Limit, Robot};

/// Limits of a robot, infinite where it has none. All are above zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Speed forwards, in metres per second.
    pub speed: f64,
    /// Metres per second squared.
    pub acceleration: f64,
    /// The same when it brakes.
    pub deceleration: f64,
    /// Radians per second.
    pub turn_rate: f64,
    /// Radians per second squared.
    pub turn_acceleration: f64,
}

impl Limits {
    /// Of a robot on wheels: of the dynamics `unicycle`, `unicycle-2` and `differential-drive`. None of others, which may
    /// drive another way than they look.
    pub fn of(robot: &Robot) -> Option<Self> {
        let most = |limits: &[[Limit; 2]], number: usize| {
            limits
                .get(number)
                .and_then(|limit| limit[1])
                .unwrap_or(f64::INFINITY)
        };
        let (state, control) = (&robot.state_limits, &robot.control_limits);
        let limits = match robot.dynamics.as_str() {
            "fleetyard.unicycle/1" | "fleetyard.differential-drive/1" => Self {
                speed: most(control, 0),
                acceleration: f64::INFINITY,
                deceleration: f64::INFINITY,
                turn_rate: most(control, 1),
                turn_acceleration: f64::INFINITY,
            },
            "fleetyard.unicycle-2/1" => Self {
                speed: most(state, 3),
                acceleration: most(control, 0),
                deceleration: control
                    .first()
                    .and_then(|limit| limit[0])
                    .map_or(f64::INFINITY, |least| -least),
                turn_rate: most(state, 4),
                turn_acceleration: most(control, 1),
            },
            _ => return None,
        };
        let Self {
            speed,
            acceleration,
            deceleration,
            turn_rate,
            turn_acceleration,
        } = limits;
        let all = [
            speed,
            acceleration,
            deceleration,
            turn_rate,
            turn_acceleration,
        ];
        all.iter().all(|limit| *limit > 0.0).then_some(limits)
    }

    /// The limits that both keep.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            speed: self.speed.min(other.speed),
            acceleration: self.acceleration.min(other.acceleration),
            deceleration: self.deceleration.min(other.deceleration),
            turn_rate: self.turn_rate.min(other.turn_rate),
            turn_acceleration: self.turn_acceleration.min(other.turn_acceleration),
        }
    }

    /// Seconds to turn in place from one direction to another, in radians, the short way.
    pub fn turn(&self, from: f64, to: f64) -> f64 {
        let apart = (to - from).rem_euclid(2.0 * PI);
        let angle = apart.min(2.0 * PI - apart);
        // Directions are rounded.
        if angle < 1e-6 {
            return 0.0;
        }
        let [rate, change] = [self.turn_rate, self.turn_acceleration];
        from_rest_to_rest(angle, rate, [change, change])
    }

    /// Seconds to drive so many metres from rest to rest.
    pub fn stop_to_stop(&self, metres: f64) -> f64 {
        from_rest_to_rest(metres, self.speed, [self.acceleration, self.deceleration])
    }

    /// The speed to go on at if it is reached, and lost again, within so many metres.
    pub fn speed_within(&self, metres: f64) -> f64 {
        let change = self.acceleration.min(self.deceleration);
        self.speed.min((2.0 * change * metres).sqrt())
    }

    /// Seconds to drive so many metres from rest up to `speed`, evenly from there on.
    pub fn set_out(&self, metres: f64, speed: f64) -> f64 {
        up_to(metres, speed, self.acceleration)
    }

    /// Seconds to drive so many metres from `speed` to rest.
    pub fn come_to_rest(&self, metres: f64, speed: f64) -> f64 {
        up_to(metres, speed, self.deceleration)
    }
}

/// Time over a way with a change of speed between none and `speed` at one end.
fn up_to(way: f64, speed: f64, change: f64) -> f64 {
    (way + speed * speed / (2.0 * change)) / speed
}

/// Time over a way from rest to rest with limits of the rate and of its changes, up and down.
fn from_rest_to_rest(way: f64, rate: f64, [up, down]: [f64; 2]) -> f64 {
    // The way in which the rate is reached and lost.
    let both = rate * rate / 2.0 * (up.recip() + down.recip());
    if rate.is_finite() && way >= both {
        return (way + both) / rate;
    }
    let slow = up.recip() + down.recip();
    (2.0 * way * slow).sqrt()
}
