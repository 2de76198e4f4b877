//! Bodies that move in any direction: integrators and holonomic robots.
//!
//! From rest a body moves on the straight line to its target: both coordinates follow the
//! law of [`super::law`] with limits in proportion to their share of the way, so that
//! they arrive together. A requested heading changes in proportion to the way, as the
//! headings of a trajectory plan do.

use core::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::error::{MotionError, limit, tolerance_m, tolerance_rad, within};
use super::law::{Axis, Pid, THERE};
use super::{State, Target};

/// Motion in any direction at one common speed, without acceleration: the agents of
/// roadmaps in GRACE, section III-B. The last tick of a way is slower, to end at the
/// target.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SingleIntegrator {
    /// The speed ν of a body that moves; by default 1 m/s.
    pub speed_m_per_s: f64,
    /// The rate of turns in place; by default 180°/s. Turns on the way take no time of
    /// their own.
    pub turn_rate_rad_per_s: f64,
}

impl Default for SingleIntegrator {
    fn default() -> Self {
        Self {
            speed_m_per_s: 1.0,
            turn_rate_rad_per_s: PI,
        }
    }
}

impl SingleIntegrator {
    /// Largest rounding error at a target; the body lands on it otherwise.
    pub(super) const TOLERANCE: f64 = 1e-6;

    pub(super) fn validate(&self) -> Result<(), MotionError> {
        limit("speed_m_per_s", self.speed_m_per_s)?;
        limit("turn_rate_rad_per_s", self.turn_rate_rad_per_s)
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
        let step = self.speed_m_per_s * factor * dt;
        let most = self.turn_rate_rad_per_s * factor * dt;
        let (dx, dy, squared) = state.way(target);
        let mut gap = squared.sqrt();
        let share = if gap > 0.0 { step / gap } else { 0.0 };
        let mut turn = target
            .heading
            .map_or(0.0, |heading| heading - state.heading);
        for _ in 0..ticks {
            let turned = if gap > step {
                state.vx = dx * share / dt;
                state.vy = dy * share / dt;
                state.x += dx * share;
                state.y += dy * share;
                let turned = turn * (step / gap);
                gap -= step;
                turned
            } else if gap > 0.0 {
                state.vx = (target.x - state.x) / dt;
                state.vy = (target.y - state.y) / dt;
                state.x = target.x;
                state.y = target.y;
                gap = 0.0;
                turn
            } else {
                (state.vx, state.vy) = (0.0, 0.0);
                turn.max(-most).min(most)
            };
            state.omega = turned / dt;
            state.heading += turned;
            turn -= turned;
            visit(state);
        }
    }
}

/// A point with bounded accelerations per world axis as inputs. The defaults are those of
/// dynobench and of GRACE's continuous experiments.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DoubleIntegrator {
    /// Largest speed along x and along y; by default 0.5 m/s.
    pub max_speed_m_per_s: f64,
    /// Largest acceleration along x and along y; by default 2 m/s².
    pub max_acceleration_m_per_s2: f64,
    /// Largest turn rate, reached at once (the model has no heading); by default 180°/s.
    pub max_turn_rate_rad_per_s: f64,
    /// Requested speed per distance, in 1/s; by default 1000: only the limits matter.
    pub distance_gain_per_s: f64,
    /// A body has arrived if it stops within this distance of the target; by default 5
    /// mm.
    pub arrival_tolerance_m: f64,
    /// A body has arrived if it stops within this angle of the requested heading; by
    /// default 0.5°.
    pub heading_tolerance_rad: f64,
}

impl Default for DoubleIntegrator {
    fn default() -> Self {
        Self {
            max_speed_m_per_s: 0.5,
            max_acceleration_m_per_s2: 2.0,
            max_turn_rate_rad_per_s: PI,
            distance_gain_per_s: 1000.0,
            arrival_tolerance_m: 0.005,
            heading_tolerance_rad: 0.5 * PI / 180.0,
        }
    }
}

const GAIN_HINT: &str = "give a gain between 0.001 and 1e6 per second";

impl DoubleIntegrator {
    pub(super) fn validate(&self) -> Result<(), MotionError> {
        limit("max_speed_m_per_s", self.max_speed_m_per_s)?;
        limit("max_acceleration_m_per_s2", self.max_acceleration_m_per_s2)?;
        limit("max_turn_rate_rad_per_s", self.max_turn_rate_rad_per_s)?;
        within(
            "distance_gain_per_s",
            self.distance_gain_per_s,
            1e-3,
            1e6,
            GAIN_HINT,
        )?;
        tolerance_m("arrival_tolerance_m", self.arrival_tolerance_m)?;
        tolerance_rad("heading_tolerance_rad", self.heading_tolerance_rad)
    }

    pub(super) fn plane(&self, dt: f64, factor: f64) -> Plane {
        let turn_cap = self.max_turn_rate_rad_per_s * factor;
        Plane {
            speeds: [self.max_speed_m_per_s; 3],
            caps: [self.max_speed_m_per_s * factor; 3],
            rates: [self.max_acceleration_m_per_s2; 2],
            gain: Pid::proportional(self.distance_gain_per_s),
            turn: Axis::first_order(Pid::default(), turn_cap, dt),
            turn_cap,
            most_turn: self.max_turn_rate_rad_per_s,
            turn_rate: f64::INFINITY,
            body_frame: false,
            near_squared: self.arrival_tolerance_m * self.arrival_tolerance_m,
            heading_tolerance: self.heading_tolerance_rad,
            dt,
        }
    }
}

/// A body with twists as inputs: speeds forwards and sideways and a turn rate, each under
/// limits. The heading is independent of the direction of travel. The controller is
/// proportional in the frame of the body (Multi-Quadruped MAPF, section 3).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Holonomic {
    /// Largest speed forwards; by default 1 m/s.
    pub max_forward_m_per_s: f64,
    /// Largest speed backwards; by default 0.5 m/s.
    pub max_backward_m_per_s: f64,
    /// Largest speed to either side; by default 0.5 m/s.
    pub max_lateral_m_per_s: f64,
    /// Largest change of the speed forwards; by default 1 m/s².
    pub max_forward_acceleration_m_per_s2: f64,
    /// Largest change of the speed to the side; by default 1 m/s².
    pub max_lateral_acceleration_m_per_s2: f64,
    /// Largest turn rate; by default 1 rad/s.
    pub max_turn_rate_rad_per_s: f64,
    /// Largest change of the turn rate; by default 2 rad/s².
    pub max_turn_acceleration_rad_per_s2: f64,
    /// Requested speed per distance, in 1/s; by default 4.
    pub distance_gain_per_s: f64,
    /// Requested turn rate per angle in turns in place, in 1/s; by default 4.
    pub heading_gain_per_s: f64,
    /// A body has arrived if it stops within this distance of the target; by default 2
    /// cm.
    pub arrival_tolerance_m: f64,
    /// A body has arrived if it stops within this angle of the requested heading; by
    /// default 1°.
    pub heading_tolerance_rad: f64,
}

impl Default for Holonomic {
    fn default() -> Self {
        Self {
            max_forward_m_per_s: 1.0,
            max_backward_m_per_s: 0.5,
            max_lateral_m_per_s: 0.5,
            max_forward_acceleration_m_per_s2: 1.0,
            max_lateral_acceleration_m_per_s2: 1.0,
            max_turn_rate_rad_per_s: 1.0,
            max_turn_acceleration_rad_per_s2: 2.0,
            distance_gain_per_s: 4.0,
            heading_gain_per_s: 4.0,
            arrival_tolerance_m: 0.02,
            heading_tolerance_rad: PI / 180.0,
        }
    }
}

impl Holonomic {
    pub(super) fn validate(&self) -> Result<(), MotionError> {
        let limits = [
            ("max_forward_m_per_s", self.max_forward_m_per_s),
            ("max_backward_m_per_s", self.max_backward_m_per_s),
            ("max_lateral_m_per_s", self.max_lateral_m_per_s),
            (
                "max_forward_acceleration_m_per_s2",
                self.max_forward_acceleration_m_per_s2,
            ),
            (
                "max_lateral_acceleration_m_per_s2",
                self.max_lateral_acceleration_m_per_s2,
            ),
            ("max_turn_rate_rad_per_s", self.max_turn_rate_rad_per_s),
            (
                "max_turn_acceleration_rad_per_s2",
                self.max_turn_acceleration_rad_per_s2,
            ),
        ];
        for (field, value) in limits {
            limit(field, value)?;
        }
        within(
            "distance_gain_per_s",
            self.distance_gain_per_s,
            1e-3,
            1e6,
            GAIN_HINT,
        )?;
        within(
            "heading_gain_per_s",
            self.heading_gain_per_s,
            1e-3,
            1e6,
            GAIN_HINT,
        )?;
        tolerance_m("arrival_tolerance_m", self.arrival_tolerance_m)?;
        tolerance_rad("heading_tolerance_rad", self.heading_tolerance_rad)
    }

    /// The deceleration available in every direction.
    pub(super) fn least_acceleration(&self) -> f64 {
        let forward = self.max_forward_acceleration_m_per_s2;
        forward.min(self.max_lateral_acceleration_m_per_s2)
    }

    pub(super) fn plane(&self, dt: f64, factor: f64) -> Plane {
        let speeds = [
            self.max_forward_m_per_s,
            self.max_backward_m_per_s,
            self.max_lateral_m_per_s,
        ];
        let turn_cap = self.max_turn_rate_rad_per_s * factor;
        let turn_rate = self.max_turn_acceleration_rad_per_s2;
        let gain = Pid::proportional(self.heading_gain_per_s);
        Plane {
            speeds,
            caps: speeds.map(|speed| speed * factor),
            rates: [
                self.max_forward_acceleration_m_per_s2,
                self.max_lateral_acceleration_m_per_s2,
            ],
            gain: Pid::proportional(self.distance_gain_per_s),
            turn: Axis::new(gain, turn_cap, [turn_rate; 3], dt),
            turn_cap,
            most_turn: self.max_turn_rate_rad_per_s,
            turn_rate,
            body_frame: true,
            near_squared: self.arrival_tolerance_m * self.arrival_tolerance_m,
            heading_tolerance: self.heading_tolerance_rad,
            dt,
        }
    }
}

/// A body that moves in any direction, prepared for a block of ticks.
pub(super) struct Plane {
    /// Largest speeds forwards, backwards and sideways, of the body and of this block.
    speeds: [f64; 3],
    caps: [f64; 3],
    /// Largest accelerations forwards and sideways.
    rates: [f64; 2],
    gain: Pid,
    turn: Axis,
    /// Largest turn rate of this block and of the body.
    turn_cap: f64,
    most_turn: f64,
    /// Largest change of the turn rate.
    turn_rate: f64,
    /// Set if the limits turn with the body.
    body_frame: bool,
    near_squared: f64,
    heading_tolerance: f64,
    dt: f64,
}

impl Plane {
    pub(super) fn run(
        &self,
        state: &mut State,
        target: &Target,
        ticks: usize,
        visit: &mut impl FnMut(&State),
    ) {
        let (dx, dy, squared) = state.way(target);
        let turn = target
            .heading
            .map_or(0.0, |heading| heading - state.heading);
        let still = state.vx == 0.0 && state.vy == 0.0 && state.omega == 0.0;
        if still && squared <= self.near_squared && turn.abs() <= self.heading_tolerance {
            for _ in 0..ticks {
                visit(state);
            }
            return;
        }
        if turn.abs() <= THERE && state.omega == 0.0 {
            let frame = self.frame(state);
            let mut left = ticks;
            let mut way = [dx, dy];
            while left > 0 && !is_along([state.vx, state.vy], way) {
                let [cap, rate] = self.along(frame, way);
                [state.vx, state.vy] = self.onto(frame, [state.vx, state.vy], way, cap, rate);
                state.x += state.vx * self.dt;
                state.y += state.vy * self.dt;
                left -= 1;
                visit(state);
                let (dx, dy, _) = state.way(target);
                way = [dx, dy];
            }
            self.glide(state, frame, way, left, visit);
            return;
        }
        for _ in 0..ticks {
            self.turning(state, target);
            visit(state);
        }
    }

    /// Moves with the heading fixed; `frame` is the cosine and sine of the axes of the
    /// limits.
    fn glide(
        &self,
        state: &mut State,
        frame: [f64; 2],
        way: [f64; 2],
        ticks: usize,
        visit: &mut impl FnMut(&State),
    ) {
        let (gap, speed) = (into(frame, way), into(frame, [state.vx, state.vy]));
        let axes = self.axes(gap);
        // Mirrored so that both coordinates move forwards: that case of the law is
        // cheaper.
        let signs = gap.map(|gap| if gap < 0.0 { -1.0 } else { 1.0 });
        let mut gap = [gap[0] * signs[0], gap[1] * signs[1]];
        let mut speed = [speed[0] * signs[0], speed[1] * signs[1]];
        let forward = speed.map(|speed| speed >= 0.0);
        for _ in 0..ticks {
            for side in 0..2 {
                let (axis, now, to_go) = (&axes[side], speed[side], gap[side]);
                speed[side] = if forward[side] {
                    axis.next_forward(now, to_go, &mut 0.0)
                } else {
                    axis.next(now, to_go, &mut 0.0)
                };
                gap[side] -= speed[side] * self.dt;
            }
            [state.vx, state.vy] = out_of(frame, [speed[0] * signs[0], speed[1] * signs[1]]);
            state.x += state.vx * self.dt;
            state.y += state.vy * self.dt;
            visit(state);
        }
    }

    /// Both coordinates under limits in proportion to their distances.
    fn axes(&self, gap: [f64; 2]) -> [Axis; 2] {
        let [forward, backward, lateral] = self.caps;
        let caps = [if gap[0] >= 0.0 { forward } else { backward }, lateral];
        let size = gap.map(f64::abs);
        // Duration of the way at the limit of speed, and at that of acceleration.
        let slowest = (size[0] / caps[0]).max(size[1] / caps[1]);
        let laziest = (size[0] / self.rates[0]).max(size[1] / self.rates[1]);
        let there = size[0] <= THERE && size[1] <= THERE;
        let axis = |side: usize| {
            let full = self.rates[side];
            if there {
                return Axis::new(self.gain, caps[side], [full; 3], self.dt);
            }
            let rate = (size[side] / laziest).min(full);
            let cap = (size[side] / slowest).min(caps[side]);
            Axis::new(self.gain, cap, [rate; 3], self.dt)
        };
        [axis(0), axis(1)]
    }

    /// A tick of a turning body: its heading changes in proportion to its way.
    fn turning(&self, state: &mut State, target: &Target) {
        let (dx, dy, squared) = state.way(target);
        let distance = squared.sqrt();
        let turn = target
            .heading
            .map_or(0.0, |heading| heading - state.heading);
        let before = [state.vx, state.vy];
        let moves = distance > NO_WAY_M;
        let per_metre = if moves { turn / distance } else { 0.0 };
        let frame = self.frame(state);
        let mut velocity = self.slowly(frame, before, [dx, dy], per_metre);
        let omega = state.omega;
        state.omega = if moves {
            let way = [dx / distance, dy / distance];
            // At most the speed from which it can stop at its heading.
            let most = self.most_turn(velocity).min(self.turn.bound(turn.abs()));
            self.keep_up(&mut velocity, before, way, [per_metre, omega, most], frame);
            // A body that still moves away has not set out; one that moves past its
            // target turns no further than it.
            let closing = velocity[0] * way[0] + velocity[1] * way[1];
            let closing = closing.max(0.0).min(distance / self.dt);
            self.turn
                .slew(omega, (per_metre * closing).max(-most).min(most))
        } else {
            self.turn.next(omega, turn, &mut state.sum_heading)
        };
        state.heading += state.omega * self.dt;
        if self.body_frame {
            let old = into(frame, before);
            state.face();
            let frame = [state.cos, state.sin];
            let mut twist = into(frame, velocity);
            let [forward, backward, lateral] = self.speeds;
            for (side, low, high) in [(0, -backward, forward), (1, -lateral, lateral)] {
                let most = self.rates[side] * self.dt;
                let slewed = twist[side].max(old[side] - most).min(old[side] + most);
                twist[side] = slewed.max(low).min(high);
            }
            velocity = out_of(frame, twist);
        }
        [state.vx, state.vy] = velocity;
        state.x += state.vx * self.dt;
        state.y += state.vy * self.dt;
    }

    /// Acceleration available in every direction while the body turns. Turning the
    /// velocity along with the body needs some of it: half is reserved for that.
    fn rate(&self) -> f64 {
        let reserve = if self.body_frame { 0.5 } else { 1.0 };
        self.rates[0].min(self.rates[1]) * reserve
    }

    /// Velocity of the next tick on a way with the given turn per metre, under limits
    /// that hold whatever the heading.
    fn slowly(
        &self,
        frame: [f64; 2],
        velocity: [f64; 2],
        way: [f64; 2],
        per_metre: f64,
    ) -> [f64; 2] {
        let (bend, rate) = (per_metre.abs(), self.rate());
        let mut cap = self.caps[0].min(self.caps[1]).min(self.caps[2]);
        let mut slow = rate;
        if bend > 0.0 {
            cap = cap.min(self.turn_cap / bend);
            slow = slow.min(self.turn_rate / bend);
            if self.body_frame {
                cap = cap.min((rate / bend).sqrt());
            }
        }
        if !is_along(velocity, way) {
            return self.onto(frame, velocity, way, cap, slow);
        }
        let (gap, mut speed) = (into(frame, way), into(frame, velocity));
        let distance = size(gap);
        for side in 0..2 {
            let share = if distance > THERE {
                gap[side].abs() / distance
            } else {
                1.0
            };
            let axis = Axis::new(self.gain, cap * share, [slow * share; 3], self.dt);
            speed[side] = axis.next(speed[side], gap[side], &mut 0.0);
        }
        out_of(frame, speed)
    }

    /// The axes of the limits.
    fn frame(&self, state: &mut State) -> [f64; 2] {
        if self.body_frame {
            state.face();
            [state.cos, state.sin]
        } else {
            [1.0, 0.0]
        }
    }

    /// Largest speed and acceleration along a way.
    fn along(&self, frame: [f64; 2], way: [f64; 2]) -> [f64; 2] {
        let gap = into(frame, way);
        let distance = size(gap);
        let [forward, backward, lateral] = self.caps;
        let caps = [if gap[0] >= 0.0 { forward } else { backward }, lateral];
        [caps, self.rates].map(|most| least_along(most, gap) * distance)
    }

    /// Velocity of the next tick of a body that does not move along its way: it brakes
    /// across the way as hard as it can, and uses only the rest of its acceleration along
    /// it. So it stays as near to its way as its stopping point was.
    fn onto(
        &self,
        frame: [f64; 2],
        velocity: [f64; 2],
        way: [f64; 2],
        cap: f64,
        slow: f64,
    ) -> [f64; 2] {
        let (gap, speed) = (into(frame, way), into(frame, velocity));
        let distance = size(gap);
        let budget = self.rates.map(|rate| rate * self.dt);
        if distance <= THERE {
            let left = 1.0 - least_along(budget, speed).min(1.0);
            return velocity.map(|speed| speed * left);
        }
        let ahead = [gap[0] / distance, gap[1] / distance];
        let aside = [-ahead[1], ahead[0]];
        let part = |of: [f64; 2]| speed[0] * of[0] + speed[1] * of[1];
        let most = least_along(budget, aside);
        let across = (-part(aside)).max(-most).min(most);
        let left = [0, 1].map(|side| budget[side] - (across * aside[side]).abs());
        let hard = least_along(self.rates, ahead);
        let axis = Axis::new(self.gain, cap, [slow, hard, slow], self.dt);
        let most = least_along(left, ahead).max(0.0);
        let closing = part(ahead);
        let along = (axis.next(closing, distance, &mut 0.0) - closing)
            .max(-most)
            .min(most);
        let [forward, backward, lateral] = self.speeds;
        let ends = [(-backward, forward), (-lateral, lateral)];
        let next = [0, 1].map(|side| {
            let (low, high) = ends[side];
            let next = speed[side] + across * aside[side] + along * ahead[side];
            next.max(low.min(speed[side])).min(high.max(speed[side]))
        });
        out_of(frame, next)
    }

    /// Largest turn rate at a velocity, whatever the requested speed: a body that slows
    /// down turns on in proportion.
    fn most_turn(&self, [vx, vy]: [f64; 2]) -> f64 {
        let speed = (vx * vx + vy * vy).sqrt();
        if self.body_frame && speed > 0.0 {
            self.most_turn.min(self.rate() / speed)
        } else {
            self.most_turn
        }
    }

    /// Slows a velocity down until the turn keeps up with it, as hard as the body brakes.
    /// From rest it always does; a body that arrives with speed left, or gets a new
    /// target while moving, first has to reach the turn rate of the way.
    fn keep_up(
        &self,
        velocity: &mut [f64; 2],
        before: [f64; 2],
        way: [f64; 2],
        [per_metre, omega, most]: [f64; 3],
        frame: [f64; 2],
    ) {
        if per_metre == 0.0 {
            return;
        }
        let bend = per_metre.abs();
        let turns = omega * per_metre.signum();
        let (closed, closing) = (
            before[0] * way[0] + before[1] * way[1],
            velocity[0] * way[0] + velocity[1] * way[1],
        );
        // The lag meanwhile is not worth a stop within this part of the tolerance.
        let slack = (0.1 * self.turn_rate * self.heading_tolerance).sqrt();
        let lacks = bend * closed - turns;
        let allowed = if lacks > slack {
            (turns + slack) / bend
        } else if lacks > self.turn_rate * self.dt {
            closed
        } else {
            (turns + self.turn_rate * self.dt) / bend
        };
        let excess = closing - allowed.min(most / bend).max(0.0);
        if excess <= 0.0 {
            return;
        }
        // Along the way alone, as far as the remaining acceleration permits.
        let (ahead, now, old) = (
            into(frame, way),
            into(frame, *velocity),
            into(frame, before),
        );
        let left = [0, 1].map(|side| {
            let done = (old[side] - now[side]) * ahead[side].signum();
            (self.rates[side] * self.dt - done).max(0.0)
        });
        let by = excess.min(least_along(left, ahead));
        *velocity = [velocity[0] - by * way[0], velocity[1] - by * way[1]];
    }
}

/// On a shorter way, in metres, a body turns in place: a turn in proportion to it would
/// amplify rounding.
const NO_WAY_M: f64 = 1e-6;

/// True if a body moves along its way: then both coordinates slow down in proportion, so
/// that it stays there. Otherwise it has to reach the way first.
fn is_along(speed: [f64; 2], way: [f64; 2]) -> bool {
    let aside = speed[0] * way[1] - speed[1] * way[0];
    let ahead = speed[0] * way[0] + speed[1] * way[1];
    aside.abs() <= 1e-3 * ahead
}

/// Largest length of a vector in a direction with every coordinate within its bound.
fn least_along(most: [f64; 2], direction: [f64; 2]) -> f64 {
    (most[0] / direction[0].abs()).min(most[1] / direction[1].abs())
}

fn size([x, y]: [f64; 2]) -> f64 {
    (x * x + y * y).sqrt()
}

/// A vector of the world in a frame with the given cosine and sine. Vectors are pairs here
/// and not nalgebra's, since almost all is done side by side: gaps, caps, rates and speeds.
fn into([cos, sin]: [f64; 2], [x, y]: [f64; 2]) -> [f64; 2] {
    [x * cos + y * sin, y * cos - x * sin]
}

/// Inverse of [`into`]: a vector of the frame in the world.
fn out_of([cos, sin]: [f64; 2], [x, y]: [f64; 2]) -> [f64; 2] {
    [x * cos - y * sin, x * sin + y * cos]
}
