//! Bodies that drive where they head: differential drive and unicycles.
//!
//! One controller for all: it turns in place until it faces the target, then drives, and
//! holds its course with small corrections. A moving body far off course stops first. So
//! from rest a body keeps to the straight line to its target.

use core::f64::consts::{FRAC_PI_2, PI};

use serde::{Deserialize, Serialize};

use super::error::{MotionError, limit, tolerance_m, tolerance_rad, within};
use super::law::{Axis, Pid, wrap};
use super::{State, Target};

/// The controller of differential drives and unicycles.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TurnAndDrive {
    /// From distance to speed.
    pub distance: Pid,
    /// From heading error to turn rate.
    pub heading: Pid,
    /// A body has arrived if it stops within this distance of the target, in metres.
    pub arrival_tolerance_m: f64,
    /// A body has arrived if it stops within this angle of the requested heading, in
    /// radians.
    pub heading_tolerance_rad: f64,
    /// A moving body with at most this heading error steers; beyond it stops and turns in
    /// place.
    pub steer_within_rad: f64,
    /// Drive backwards to targets behind the body.
    pub reverse: bool,
}

impl Default for TurnAndDrive {
    fn default() -> Self {
        Self {
            distance: Pid::default(),
            heading: Pid::default(),
            arrival_tolerance_m: 0.01,
            heading_tolerance_rad: 0.5 * PI / 180.0,
            steer_within_rad: 2.0 * PI / 180.0,
            reverse: false,
        }
    }
}

impl TurnAndDrive {
    fn validate(&self) -> Result<(), MotionError> {
        let names = [
            "control.distance.p",
            "control.distance.i",
            "control.distance.d",
        ];
        self.distance.validate(names)?;
        let names = [
            "control.heading.p",
            "control.heading.i",
            "control.heading.d",
        ];
        self.heading.validate(names)?;
        tolerance_m("control.arrival_tolerance_m", self.arrival_tolerance_m)?;
        tolerance_rad("control.heading_tolerance_rad", self.heading_tolerance_rad)?;
        tolerance_rad("control.steer_within_rad", self.steer_within_rad)
    }

    /// True if a body rests at its target.
    #[inline]
    pub(super) fn rests(&self, state: &State, target: &Target) -> bool {
        let (_, _, squared) = state.way(target);
        state.vx == 0.0
            && state.vy == 0.0
            && state.omega == 0.0
            && squared <= self.arrival_tolerance_m * self.arrival_tolerance_m
            && target.heading.is_none_or(|heading| {
                wrap(heading - state.heading).abs() <= self.heading_tolerance_rad
            })
    }

    /// Largest distance from a straight leg.
    pub(super) fn lateral_tolerance_m(&self) -> f64 {
        1.1 * self.arrival_tolerance_m
    }
}

/// Two driven wheels: drives forwards and turns in place, under limits of speed and
/// acceleration. The defaults are the AGV of LSMART, section 4.1.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DifferentialDrive {
    /// Largest speed; by default 2 m/s (LSMART).
    pub max_speed_m_per_s: f64,
    /// Largest acceleration; by default 2 m/s² (LSMART).
    pub max_acceleration_m_per_s2: f64,
    /// Largest deceleration; by default 2 m/s² (LSMART).
    pub max_deceleration_m_per_s2: f64,
    /// Deceleration that the controller plans with, at most the largest; by default the
    /// largest.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub braking_m_per_s2: Option<f64>,
    /// Largest turn rate; by default 45°/s (LSMART).
    pub max_turn_rate_rad_per_s: f64,
    /// Largest change of the turn rate; by default 180°/s², which reaches the turn rate in
    /// a quarter of a second. LSMART gives none.
    pub max_turn_acceleration_rad_per_s2: f64,
    /// The controller.
    pub control: TurnAndDrive,
}

impl Default for DifferentialDrive {
    fn default() -> Self {
        Self {
            max_speed_m_per_s: 2.0,
            max_acceleration_m_per_s2: 2.0,
            max_deceleration_m_per_s2: 2.0,
            braking_m_per_s2: None,
            max_turn_rate_rad_per_s: 0.25 * PI,
            max_turn_acceleration_rad_per_s2: PI,
            control: TurnAndDrive::default(),
        }
    }
}

impl DifferentialDrive {
    pub(super) fn validate(&self) -> Result<(), MotionError> {
        limit("max_speed_m_per_s", self.max_speed_m_per_s)?;
        limit("max_acceleration_m_per_s2", self.max_acceleration_m_per_s2)?;
        limit("max_deceleration_m_per_s2", self.max_deceleration_m_per_s2)?;
        if let Some(braking) = self.braking_m_per_s2 {
            let most = self.max_deceleration_m_per_s2;
            let hint = "give at most max_deceleration_m_per_s2, or leave it out";
            within("braking_m_per_s2", braking, 1e-6, most, hint)?;
        }
        limit("max_turn_rate_rad_per_s", self.max_turn_rate_rad_per_s)?;
        let turn = self.max_turn_acceleration_rad_per_s2;
        limit("max_turn_acceleration_rad_per_s2", turn)?;
        self.control.validate()
    }

    pub(super) fn wheels(&self, dt: f64, factor: f64) -> Wheels {
        let (up, down) = (
            self.max_acceleration_m_per_s2,
            self.max_deceleration_m_per_s2,
        );
        let brake = self.braking_m_per_s2.unwrap_or(down);
        let cap = self.max_speed_m_per_s * factor;
        let drive = Axis::new(self.control.distance, cap, [up, down, brake], dt);
        let turn = self.max_turn_acceleration_rad_per_s2;
        let cap = self.max_turn_rate_rad_per_s * factor;
        let turn = Axis::new(self.control.heading, cap, [turn; 3], dt);
        Wheels::new(drive, turn, &self.control, dt)
    }
}

/// A unicycle whose speed and turn rate are set at once. The defaults are the first-order
/// unicycle of dynobench.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Unicycle1 {
    /// Largest speed, forwards and backwards; by default 0.5 m/s.
    pub max_speed_m_per_s: f64,
    /// Largest turn rate; by default 0.5 rad/s.
    pub max_turn_rate_rad_per_s: f64,
    /// The controller; by default it may reverse, as the model can.
    pub control: TurnAndDrive,
}

impl Default for Unicycle1 {
    fn default() -> Self {
        Self {
            max_speed_m_per_s: 0.5,
            max_turn_rate_rad_per_s: 0.5,
            control: both_ways(),
        }
    }
}

fn both_ways() -> TurnAndDrive {
    TurnAndDrive {
        reverse: true,
        ..TurnAndDrive::default()
    }
}

impl Unicycle1 {
    pub(super) fn validate(&self) -> Result<(), MotionError> {
        limit("max_speed_m_per_s", self.max_speed_m_per_s)?;
        limit("max_turn_rate_rad_per_s", self.max_turn_rate_rad_per_s)?;
        self.control.validate()
    }

    pub(super) fn wheels(&self, dt: f64, factor: f64) -> Wheels {
        let cap = self.max_speed_m_per_s * factor;
        let drive = Axis::first_order(self.control.distance, cap, dt);
        let cap = self.max_turn_rate_rad_per_s * factor;
        let turn = Axis::first_order(self.control.heading, cap, dt);
        Wheels::new(drive, turn, &self.control, dt)
    }
}

/// A unicycle whose inputs are accelerations. The defaults are the second-order unicycle
/// of dynobench.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Unicycle2 {
    /// Largest speed, forwards and backwards; by default 0.5 m/s.
    pub max_speed_m_per_s: f64,
    /// Largest turn rate; by default 0.5 rad/s.
    pub max_turn_rate_rad_per_s: f64,
    /// Largest acceleration, either way; by default 0.25 m/s².
    pub max_acceleration_m_per_s2: f64,
    /// Largest change of the turn rate; by default 0.25 rad/s².
    pub max_turn_acceleration_rad_per_s2: f64,
    /// The controller; by default it may reverse, as the model can.
    pub control: TurnAndDrive,
}

impl Default for Unicycle2 {
    fn default() -> Self {
        Self {
            max_speed_m_per_s: 0.5,
            max_turn_rate_rad_per_s: 0.5,
            max_acceleration_m_per_s2: 0.25,
            max_turn_acceleration_rad_per_s2: 0.25,
            control: both_ways(),
        }
    }
}

impl Unicycle2 {
    pub(super) fn validate(&self) -> Result<(), MotionError> {
        limit("max_speed_m_per_s", self.max_speed_m_per_s)?;
        limit("max_turn_rate_rad_per_s", self.max_turn_rate_rad_per_s)?;
        limit("max_acceleration_m_per_s2", self.max_acceleration_m_per_s2)?;
        let turn = self.max_turn_acceleration_rad_per_s2;
        limit("max_turn_acceleration_rad_per_s2", turn)?;
        self.control.validate()
    }

    pub(super) fn wheels(&self, dt: f64, factor: f64) -> Wheels {
        let cap = self.max_speed_m_per_s * factor;
        let drive = [self.max_acceleration_m_per_s2; 3];
        let drive = Axis::new(self.control.distance, cap, drive, dt);
        let cap = self.max_turn_rate_rad_per_s * factor;
        let turn = [self.max_turn_acceleration_rad_per_s2; 3];
        let turn = Axis::new(self.control.heading, cap, turn, dt);
        Wheels::new(drive, turn, &self.control, dt)
    }
}

/// A wheeled body, prepared for a block of ticks.
pub(super) struct Wheels {
    drive: Axis,
    turn: Axis,
    near_squared: f64,
    heading_tolerance: f64,
    /// Largest heading error that counts as on course.
    on_course: f64,
    steer_within: f64,
    reverse: bool,
    dt: f64,
}

impl Wheels {
    fn new(drive: Axis, turn: Axis, control: &TurnAndDrive, dt: f64) -> Self {
        Self {
            drive,
            turn,
            near_squared: control.arrival_tolerance_m * control.arrival_tolerance_m,
            heading_tolerance: control.heading_tolerance_rad,
            on_course: 0.1 * control.arrival_tolerance_m,
            steer_within: control.steer_within_rad,
            reverse: control.reverse,
            dt,
        }
    }

    pub(super) fn run(
        &self,
        state: &mut State,
        target: &Target,
        ticks: usize,
        visit: &mut impl FnMut(&State),
    ) {
        let mut left = ticks;
        while left > 0 {
            let (dx, dy, squared) = state.way(target);
            let near = squared <= self.near_squared;
            if state.vx != 0.0 || state.vy != 0.0 {
                state.face();
                let [ahead, aside] = state.seen(dx, dy);
                let [speed, _] = state.seen(state.vx, state.vy);
                let way = if speed >= 0.0 { 1.0 } else { -1.0 };
                if state.omega == 0.0 && (aside.abs() <= self.on_course || near) {
                    self.straight(state, way, [speed, ahead], &mut left, visit);
                } else {
                    self.steer(state, way, [speed, ahead, aside], near);
                    left -= 1;
                    visit(state);
                }
                continue;
            }
            let mut error = if near {
                let heading = target.heading.unwrap_or(state.heading);
                wrap(heading - state.heading)
            } else {
                self.bearing_error(state, dx, dy)
            };
            if state.omega == 0.0 {
                if near && error.abs() <= self.heading_tolerance {
                    error = 0.0;
                }
                if !near && error == 0.0 && !self.drive.is_stalled() {
                    let [ahead, _] = state.seen(dx, dy);
                    let way = if ahead > 0.0 { 1.0 } else { -1.0 };
                    self.straight(state, way, [0.0, ahead], &mut left, visit);
                    continue;
                }
                if error == 0.0 || self.turn.is_stalled() {
                    state.forget();
                    for _ in 0..left {
                        visit(state);
                    }
                    return;
                }
            }
            self.turn_in_place(state, error, &mut left, visit);
        }
    }

    /// Turn of a standing body that makes it drive to (dx, dy). Without cosine and sine
    /// while it turns: the heading changes with every tick.
    fn bearing_error(&self, state: &mut State, dx: f64, dy: f64) -> f64 {
        if state.omega == 0.0 {
            state.face();
            let [ahead, aside] = state.seen(dx, dy);
            if aside.abs() <= self.on_course && (ahead > 0.0 || self.reverse) {
                return 0.0;
            }
        }
        let error = wrap(libm::atan2(dy, dx) - state.heading);
        if self.reverse && error.abs() > FRAC_PI_2 {
            error - PI.copysign(error)
        } else {
            error
        }
    }

    /// Drives on with the heading fixed, until the body stands or no tick is left.
    #[inline]
    fn straight(
        &self,
        state: &mut State,
        way: f64,
        [speed, ahead]: [f64; 2],
        left: &mut usize,
        visit: &mut impl FnMut(&State),
    ) {
        let (cos, sin) = (state.cos * way, state.sin * way);
        let (mut speed, mut gap) = (speed * way, ahead * way);
        while *left > 0 {
            speed = self.drive.next_forward(speed, gap, &mut state.sum_distance);
            state.vx = speed * cos;
            state.vy = speed * sin;
            state.x += state.vx * self.dt;
            state.y += state.vy * self.dt;
            gap -= speed * self.dt;
            *left -= 1;
            visit(state);
            if speed == 0.0 {
                return;
            }
        }
    }

    /// A tick of a moving body that is off course or still turning.
    fn steer(&self, state: &mut State, way: f64, [speed, ahead, aside]: [f64; 3], near: bool) {
        let (mut gap, aside) = (ahead * way, aside * way);
        let mut error = 0.0;
        if aside.abs() > self.on_course && !near {
            error = libm::atan2(aside, gap);
            if error.abs() > self.steer_within {
                // Stop, without turning on; then turn in place.
                error = 0.0;
                gap = 0.0;
            }
        }
        let turn = state.omega;
        state.omega = self.turn.next(turn, error, &mut state.sum_heading);
        let speed = self
            .drive
            .next_forward(speed * way, gap, &mut state.sum_distance)
            * way;
        state.heading += state.omega * self.dt;
        state.face();
        state.vx = speed * state.cos;
        state.vy = speed * state.sin;
        state.x += state.vx * self.dt;
        state.y += state.vy * self.dt;
    }

    /// Turns in place by `error`, or until no tick is left.
    fn turn_in_place(
        &self,
        state: &mut State,
        mut error: f64,
        left: &mut usize,
        visit: &mut impl FnMut(&State),
    ) {
        // The law for going forwards is cheaper.
        let way = if error < 0.0 { -1.0 } else { 1.0 };
        let forward = state.omega * way >= 0.0;
        let mut sum = state.sum_heading * way;
        let mut rate = state.omega * way;
        error *= way;
        while *left > 0 {
            rate = if forward {
                self.turn.next_forward(rate, error, &mut sum)
            } else {
                self.turn.next(rate, error, &mut sum)
            };
            state.omega = rate * way;
            state.sum_heading = sum * way;
            state.heading += state.omega * self.dt;
            error -= rate * self.dt;
            *left -= 1;
            visit(state);
            if rate == 0.0 {
                break;
            }
        }
    }
}
