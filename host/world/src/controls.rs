//! Controls of robots: the motions that they lead to, and the limits that they exceed.
//!
//! A control is held for a time, and so the rates of a robot (its velocity and its turn rate) are
//! linear in time within a segment. Its pose follows in closed form where the axes of its rates do
//! not turn, or turn evenly: parabolas, arcs, and arcs that speed up. Where the turn rate itself
//! changes (a clothoid), velocities are integrated by Gauss's rule with five points over pieces in
//! which the robot turns by at most [`PIECE_RAD`]: its error is below 10⁻¹¹ of the piece. A car goes on
//! arcs, and its trailer follows by [`joint_after`].
//!
//! Knots are linear by contract. A motion that is curved is therefore sampled so densely that its
//! chords lie within [`CHORD_M`] and [`CHORD_RAD`] of it at all times: a chord over h seconds is
//! off by h²/8 of the largest change of the velocity meanwhile, at most.

use core::f64::consts::{FRAC_PI_2, TAU};

use fleetyard_core::{Knot, Robot, Segment, TrajectoryPlan};

use crate::{DYNAMICS_TOLERANCE, Dynamics, Trailer, Travel, Vector, joint_after};

/// Largest distance between a motion and the chords of its samples, in metres.
pub const CHORD_M: f64 = 1e-4;

/// The same of its heading, in radians.
pub const CHORD_RAD: f64 = 1e-4;

/// Most that a robot turns within a piece that is integrated, in radians.
const PIECE_RAD: f64 = 0.5;

/// Rounding of rates that are sums of many segments.
const ROUNDING: f64 = 1e-9;

/// A robot that is moved by controls.
#[derive(Debug, Clone, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "as robots are declared")]
pub struct ControlModel {
    /// True if rates are along the axes of the body.
    turns_axes: bool,
    /// True if controls change rates, rather than being them.
    is_second: bool,
    /// True if there is a rate to the side.
    sideways: bool,
    has_heading: bool,
    polar_state: bool,
    polar_control: bool,
    state_limits: Vec<[f64; 2]>,
    control_limits: Vec<[f64; 2]>,
    wheels: Option<Wheels>,
    car: Option<Car>,
}

/// A car: the second number of a control is the angle at which it steers.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Car {
    wheelbase_m: f64,
    trailer: Option<Trailer>,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Wheels {
    track_m: f64,
    speed_max: f64,
}

/// Quantity that has a limit. The order is that of [`Driven::excesses`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Bounded {
    /// x or y, in metres.
    Place,
    /// Heading, in radians.
    Heading,
    /// Speed, in m/s.
    Speed,
    /// Speed of a wheel, in m/s.
    WheelSpeed,
    /// Turn rate, in rad/s.
    TurnRate,
    /// Steering angle, in radians.
    Steering,
    /// Acceleration, in m/s².
    Acceleration,
    /// Turn acceleration, in rad/s².
    TurnAcceleration,
}

/// A place where controls ask for more than a robot can.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ControlExcess {
    /// The quantity.
    pub bounded: Bounded,
    /// The axis or the wheel, as in "moves along x"; empty where that is no part of the limit.
    pub along: &'static str,
    /// The segment, counted from 0.
    pub segment: usize,
    /// Time, in seconds.
    pub time_s: f64,
    /// Position of the robot then, in metres.
    pub place_m: [f64; 2],
    /// Value that the controls ask for, with its sign.
    pub value: f64,
    /// The limit on that side.
    pub limit: f64,
}

/// The motion that controls lead to.
#[derive(Debug, Clone, PartialEq)]
pub struct Driven {
    /// Samples of it, between which chords keep to [`CHORD_M`] and [`CHORD_RAD`]; the first at time 0.
    pub knots: Vec<Knot>,
    /// The state at its end.
    pub end: Vec<f64>,
    /// Of every quantity and axis the worst place, and the first among equal ones.
    pub excesses: Vec<ControlExcess>,
}

/// The reason why controls lead nowhere. Segments are counted from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum ControlError {
    #[error("the host does not know the dynamics `{0}`")]
    UnknownDynamics(String),
    #[error("dynamics `{dynamics}` with {what}")]
    Declared {
        dynamics: String,
        what: &'static str,
    },
    #[error("the state at the start has {found} numbers, but the robot has {expected}")]
    Start { expected: usize, found: usize },
    #[error("segment {segment} has a control of {found} numbers, but the robot takes {expected}")]
    Numbers {
        segment: usize,
        expected: usize,
        found: usize,
    },
    #[error("segment {segment} leads beyond ±1e9 metres or radians")]
    Far { segment: usize },
    #[error("segment {segment} makes the motion longer than {most} knots")]
    Long { segment: usize, most: usize },
}

/// Pose and rates: along the first axis, along the second one, and of the heading.
#[derive(Debug, Clone, Copy, PartialEq)]
struct State {
    at: Vector,
    heading: f64,
    rates: [f64; 3],
    /// Heading of the trailer; 0 without one.
    behind: f64,
}

/// Change of rates within a segment, and the state at its begin.
#[derive(Debug, Clone, Copy)]
struct Course {
    begin: State,
    change: [f64; 3],
    turns_axes: bool,
    /// Length of a hitch, of a car with a trailer.
    hitch_m: Option<f64>,
}

impl ControlModel {
    /// Fails for dynamics that the host does not know, and for a robot that is none of its dynamics.
    pub fn new(robot: &Robot) -> Result<Self, ControlError> {
        let wrong = |what| ControlError::Declared {
            dynamics: robot.dynamics.clone(),
            what,
        };
        let (turns_axes, is_second, sideways) = match &*robot.dynamics {
            "fleetyard.single-integrator/1" => (false, false, true),
            "fleetyard.double-integrator/1" => (false, true, true),
            "fleetyard.unicycle/1"
            | "fleetyard.differential-drive/1"
            | "fleetyard.car/1"
            | "fleetyard.car-trailer/1" => (true, false, false),
            "fleetyard.unicycle-2/1" => (true, true, false),
            "fleetyard.holonomic/1" => (true, false, true),
            "fleetyard.holonomic-2/1" => (true, true, true),
            other => return Err(ControlError::UnknownDynamics(other.to_owned())),
        };
        if turns_axes && !robot.has_heading {
            return Err(wrong("no heading"));
        }
        let wheels = match (&*robot.dynamics, &*robot.parameters) {
            ("fleetyard.differential-drive/1", [track_m, speed_max]) => Some(Wheels {
                track_m: *track_m,
                speed_max: *speed_max,
            }),
            ("fleetyard.differential-drive/1", _) => {
                return Err(wrong("other parameters than track_m and wheel_speed_max"));
            }
            ("fleetyard.car/1" | "fleetyard.car-trailer/1", _) | (_, []) => None,
            _ => return Err(wrong("parameters")),
        };
        let car = match (&*robot.dynamics, &*robot.parameters) {
            ("fleetyard.car/1", [wheelbase_m]) => Some(Car {
                wheelbase_m: *wheelbase_m,
                trailer: None,
            }),
            (
                "fleetyard.car-trailer/1",
                [wheelbase_m, hitch_m, length_m, width_m, max_joint_rad],
            ) => Some(Car {
                wheelbase_m: *wheelbase_m,
                trailer: Some(Trailer {
                    hitch_m: *hitch_m,
                    length_m: *length_m,
                    width_m: *width_m,
                    max_joint_rad: *max_joint_rad,
                }),
            }),
            ("fleetyard.car/1", _) => return Err(wrong("other parameters than wheelbase_m")),
            ("fleetyard.car-trailer/1", _) => {
                return Err(wrong(
                    "other parameters than wheelbase_m, hitch_m, trailer_length_m, \
                     trailer_width_m and joint_max_rad",
                ));
            }
            _ => None,
        };
        if robot.dynamics.starts_with("fleetyard.car")
            && !robot
                .parameters
                .iter()
                .all(|size| *size > 0.0 && size.is_finite())
        {
            return Err(wrong("sizes that are not above 0"));
        }
        let limits = |given: &[[Option<f64>; 2]]| -> Vec<[f64; 2]> {
            let infinite = |[least, most]: &[Option<f64>; 2]| {
                [
                    least.unwrap_or(f64::NEG_INFINITY),
                    most.unwrap_or(f64::INFINITY),
                ]
            };
            given.iter().map(infinite).collect()
        };
        let model = Self {
            turns_axes,
            is_second,
            sideways,
            has_heading: robot.has_heading,
            polar_state: robot.polar_state && is_second && sideways,
            polar_control: robot.polar_control && sideways,
            state_limits: limits(&robot.state_limits),
            control_limits: limits(&robot.control_limits),
            wheels,
            car,
        };
        if model.control_limits.len() != model.control_size() {
            return Err(wrong("another number of control limits"));
        }
        if model.state_limits.len() != model.state_size() {
            return Err(wrong("another number of state limits"));
        }
        Ok(model)
    }

    /// The limits of its motion as [`Dynamics`] have them, by which knots alone are judged. Of limits
    /// that differ by side where those there do not, the larger one counts.
    pub fn dynamics(&self) -> Dynamics {
        let ways = 1 + usize::from(self.sideways);
        let free = [[f64::NEG_INFINITY, f64::INFINITY]; 3];
        let (rates, changes) = if self.is_second {
            let rates = &self.state_limits[self.pose_size()..];
            (rates, &self.control_limits[..])
        } else {
            (&self.control_limits[..], &free[..self.control_size()])
        };
        let most = |limits: &[[f64; 2]]| {
            let sizes = limits.iter().flatten().map(|limit| limit.abs());
            sizes.fold(0.0, f64::max)
        };
        let turning = |limits: &[[f64; 2]]| match limits.get(ways) {
            Some(limits) => most(&[*limits]),
            None => f64::INFINITY,
        };
        let ([back, ahead], [slower, faster]) = (rates[0], changes[0]);
        let curvature = self.car.map(|car| {
            let steering = most(&rates[1..=ways]).min(FRAC_PI_2);
            libm::tan(steering) / car.wheelbase_m
        });
        let travel = match (self.turns_axes, self.sideways) {
            (false, _) if self.polar_state || self.polar_control => Travel::Polar {
                speed: most(&rates[..ways]),
                acceleration: most(&changes[..ways]),
            },
            (false, _) => Travel::Axes {
                speed: most(&rates[..ways]),
                acceleration: most(&changes[..ways]),
            },
            (true, true) => Travel::Body {
                forward: ahead,
                backward: -back,
                sideways: most(&rates[1..ways]),
                forward_acceleration: most(&changes[..1]),
                sideways_acceleration: most(&changes[1..ways]),
            },
            (true, false) => Travel::Wheels {
                forward: ahead,
                backward: -back,
                acceleration: faster,
                deceleration: -slower,
            },
        };
        Dynamics {
            travel,
            turn_rad_per_s: match curvature {
                Some(curvature) => curvature * most(&rates[..1]),
                None => turning(rates),
            },
            turn_acceleration_rad_per_s2: turning(changes),
            curvature_rad_per_m: curvature.unwrap_or(f64::INFINITY),
        }
    }

    /// The trailer of a car that has one.
    pub fn trailer(&self) -> Option<Trailer> {
        self.car.and_then(|car| car.trailer)
    }

    fn pose_size(&self) -> usize {
        2 + usize::from(self.has_heading) + usize::from(self.trailer().is_some())
    }

    /// Numbers of a state.
    pub fn state_size(&self) -> usize {
        let rates = if self.is_second {
            self.control_size()
        } else {
            0
        };
        self.pose_size() + rates
    }

    /// Numbers of a control.
    pub fn control_size(&self) -> usize {
        1 + usize::from(self.sideways) + usize::from(self.has_heading)
    }

    /// True if its states have a heading.
    pub fn has_heading(&self) -> bool {
        self.has_heading
    }

    /// The rates of a state beyond its pose, by name.
    pub fn rates<'a>(
        &self,
        state: &'a [f64],
    ) -> impl Iterator<Item = (&'static str, f64)> + use<'a> {
        let names = self.axes();
        let rates = state.get(self.pose_size()..).unwrap_or_default();
        names.into_iter().flatten().zip(rates.iter().copied())
    }

    /// Names of the rates, in their order.
    fn axes(&self) -> [Option<&'static str>; 3] {
        let turn = self.has_heading.then_some("turn rate");
        match (self.turns_axes, self.sideways) {
            (false, _) => [Some("speed along x"), Some("speed along y"), turn],
            (true, true) => [Some("speed"), Some("sideways speed"), turn],
            (true, false) => [Some("speed"), turn, None],
        }
    }

    /// The motion from a state by controls, one after the other, in at most `most` knots.
    pub fn drive<'a>(
        &self,
        start: &[f64],
        segments: impl IntoIterator<Item = Segment<'a>>,
        most: usize,
    ) -> Result<Driven, ControlError> {
        if start.len() != self.state_size() {
            return Err(ControlError::Start {
                expected: self.state_size(),
                found: start.len(),
            });
        }
        let pose = self.pose_size();
        let mut state = State {
            at: Vector::new(start[0], start[1]),
            heading: if self.has_heading { start[2] } else { 0.0 },
            rates: self.spread(&start[pose..]),
            behind: self.trailer().map_or(0.0, |_| start[3]),
        };
        let hitch_m = self.trailer().map(|trailer| trailer.hitch_m);
        let mut knots = vec![self.knot(0.0, &state)];
        let mut worst = Vec::new();
        let mut time_s = 0.0;
        for (
            segment,
            Segment {
                duration_s,
                control,
            },
        ) in segments.into_iter().enumerate()
        {
            if control.len() != self.control_size() {
                return Err(ControlError::Numbers {
                    segment,
                    expected: self.control_size(),
                    found: control.len(),
                });
            }
            let mut numbers = self.spread(control);
            if let Some(car) = self.car {
                numbers[2] = numbers[0] * libm::tan(numbers[2]) / car.wheelbase_m;
            }
            let course = if self.is_second {
                Course {
                    begin: state,
                    change: numbers,
                    turns_axes: self.turns_axes,
                    hitch_m,
                }
            } else {
                Course {
                    begin: State {
                        rates: numbers,
                        ..state
                    },
                    change: [0.0; 3],
                    turns_axes: self.turns_axes,
                    hitch_m,
                }
            };
            let samples = course.samples(duration_s);
            let room = most.saturating_sub(knots.len()) as f64;
            if samples.is_nan() || samples > room {
                return Err(ControlError::Long { segment, most });
            }
            let mut seen = Seen {
                worst: &mut worst,
                segment,
            };
            self.see_control(&mut seen, control, time_s, &course.begin);
            let mut before = (0.0, course.begin);
            for sample in 1..=samples as u32 {
                let after_s = duration_s * (f64::from(sample) / samples);
                let next = course.at(after_s, before);
                let last = TrajectoryPlan::LARGEST;
                let numbers = [next.at.x, next.at.y, next.heading];
                if !numbers.iter().all(|number| number.abs() <= last) {
                    return Err(ControlError::Far { segment });
                }
                self.see_state(&mut seen, time_s + after_s, &next);
                let knot = self.knot(time_s + after_s, &next);
                // Less than time can tell adds to the sample before.
                match knots.last_mut() {
                    Some(same) if same.time_s >= knot.time_s => {
                        // The first stays at the start.
                        if same.time_s > 0.0 {
                            *same = Knot {
                                time_s: same.time_s,
                                ..knot
                            };
                        }
                    }
                    _ => knots.push(knot),
                }
                before = (after_s, next);
            }
            state = before.1;
            time_s += duration_s;
        }
        worst.sort_by_key(|excess: &ControlExcess| (excess.bounded, excess.along));
        Ok(Driven {
            knots,
            end: self.numbers(&state),
            excesses: worst,
        })
    }

    /// Rates or a control as its three axes.
    fn spread(&self, numbers: &[f64]) -> [f64; 3] {
        let mut rest = numbers.iter().copied();
        let mut next = |there: bool| {
            let number = if there { rest.next() } else { None };
            number.unwrap_or(0.0)
        };
        [next(true), next(self.sideways), next(self.has_heading)]
    }

    fn numbers(&self, state: &State) -> Vec<f64> {
        let mut numbers = vec![state.at.x, state.at.y];
        numbers.extend(self.has_heading.then_some(state.heading));
        numbers.extend(self.trailer().map(|_| state.behind));
        if self.is_second {
            let there = [true, self.sideways, self.has_heading];
            let rates = state.rates.into_iter().zip(there);
            numbers.extend(rates.filter_map(|(rate, there)| there.then_some(rate)));
        }
        numbers
    }

    fn knot(&self, time_s: f64, state: &State) -> Knot {
        Knot {
            time_s,
            x_m: state.at.x,
            y_m: state.at.y,
            heading_rad: self.has_heading.then_some(state.heading),
        }
    }

    /// Holds a control against its limits.
    fn see_control(&self, seen: &mut Seen<'_>, control: &[f64], time_s: f64, begin: &State) {
        let kinds = if self.is_second {
            [Bounded::Acceleration, Bounded::TurnAcceleration]
        } else if self.car.is_some() {
            [Bounded::Speed, Bounded::Steering]
        } else {
            [Bounded::Speed, Bounded::TurnRate]
        };
        let limits = &self.control_limits;
        self.see_rates(
            seen,
            kinds,
            control,
            limits,
            self.polar_control,
            time_s,
            begin,
        );
        if let (Some(wheels), [ahead, turn]) = (self.wheels, control) {
            let by = turn * wheels.track_m / 2.0;
            for (along, speed) in [("left", ahead - by), ("right", ahead + by)] {
                let limits = [-wheels.speed_max, wheels.speed_max];
                seen.see(Bounded::WheelSpeed, along, speed, limits, time_s, begin);
            }
        }
    }

    /// Holds a state against its limits. Within a segment rates are largest at its ends.
    fn see_state(&self, seen: &mut Seen<'_>, time_s: f64, state: &State) {
        let numbers = self.numbers(state);
        let (pose, rates) = numbers.split_at(self.pose_size());
        let (of_pose, of_rates) = self.state_limits.split_at(self.pose_size());
        let kinds = [
            (Bounded::Place, "x"),
            (Bounded::Place, "y"),
            (Bounded::Heading, ""),
            (Bounded::Heading, "of its trailer"),
        ];
        for (((bounded, along), value), limits) in kinds.into_iter().zip(pose).zip(of_pose) {
            seen.see(bounded, along, *value, *limits, time_s, state);
        }
        if self.is_second {
            let kinds = [Bounded::Speed, Bounded::TurnRate];
            self.see_rates(
                seen,
                kinds,
                rates,
                of_rates,
                self.polar_state,
                time_s,
                state,
            );
        }
    }

    #[expect(
        clippy::too_many_arguments,
        reason = "rates of a state or of a control, one way"
    )]
    fn see_rates(
        &self,
        seen: &mut Seen<'_>,
        [travel, turn]: [Bounded; 2],
        rates: &[f64],
        limits: &[[f64; 2]],
        polar: bool,
        time_s: f64,
        state: &State,
    ) {
        let ways = 1 + usize::from(self.sideways);
        let (rates, turning) = rates.split_at(ways);
        let (limits, of_turning) = limits.split_at(ways);
        if polar {
            let most = limits.iter().map(|limits| limits[1]).fold(0.0, f64::max);
            let length = Vector::new(rates[0], rates[1]).norm();
            seen.see(travel, "", length, [f64::NEG_INFINITY, most], time_s, state);
        } else {
            let names: [&str; 2] = match (self.turns_axes, self.sideways) {
                (false, _) => ["along x", "along y"],
                (true, true) => ["ahead", "sideways"],
                (true, false) => ["", ""],
            };
            for ((along, value), limits) in names.into_iter().zip(rates).zip(limits) {
                seen.see(travel, along, *value, *limits, time_s, state);
            }
        }
        for (value, limits) in turning.iter().zip(of_turning) {
            seen.see(turn, "", *value, *limits, time_s, state);
        }
    }
}

/// The excesses seen so far, and the segment that is looked at.
struct Seen<'a> {
    worst: &'a mut Vec<ControlExcess>,
    segment: usize,
}

impl Seen<'_> {
    fn see(
        &mut self,
        bounded: Bounded,
        along: &'static str,
        value: f64,
        [least, most]: [f64; 2],
        time_s: f64,
        state: &State,
    ) {
        let limit = if value > most { most } else { least };
        let over = excess(value, limit);
        let is_beyond = (value > most || value < least) && over > 0.0;
        if !is_beyond {
            return;
        }
        let new = ControlExcess {
            bounded,
            along,
            segment: self.segment,
            time_s,
            place_m: state.at.into(),
            value,
            limit,
        };
        let same = |old: &&mut ControlExcess| (old.bounded, old.along) == (bounded, along);
        match self.worst.iter_mut().find(same) {
            None => self.worst.push(new),
            Some(old) if over > excess(old.value, old.limit) => *old = new,
            Some(_) => {}
        }
    }
}

/// Amount by which a value is beyond a limit and what rounding explains.
fn excess(value: f64, limit: f64) -> f64 {
    (value - limit).abs() - limit.abs() * DYNAMICS_TOLERANCE - ROUNDING
}

impl Course {
    /// The rates after a time.
    fn rates(&self, after_s: f64) -> [f64; 3] {
        let axis = |axis: usize| self.begin.rates[axis] + self.change[axis] * after_s;
        [axis(0), axis(1), axis(2)]
    }

    /// Number of samples that it takes for chords to keep to their bounds, and for pieces to be short.
    fn samples(&self, duration_s: f64) -> f64 {
        let ends = [self.begin.rates, self.rates(duration_s)];
        let speed = ends.map(|rates| Vector::new(rates[0], rates[1]).norm());
        let speed = speed[0].max(speed[1]);
        let turn = ends[0][2].abs().max(ends[1][2].abs());
        let mut bending = Vector::new(self.change[0], self.change[1]).norm();
        if self.turns_axes {
            bending += turn * speed;
        }
        let mut parts = duration_s * (bending / (8.0 * CHORD_M)).sqrt();
        let turning = self.change[2].abs();
        parts = parts.max(duration_s * (turning / (8.0 * CHORD_RAD)).sqrt());
        if self.is_clothoid() {
            parts = parts.max(duration_s * turn / PIECE_RAD);
        }
        parts.ceil().max(1.0)
    }

    fn is_clothoid(&self) -> bool {
        let moves = self.begin.rates[..2].iter().chain(&self.change[..2]);
        self.turns_axes && self.change[2] != 0.0 && moves.into_iter().any(|rate| *rate != 0.0)
    }

    /// The heading after a time.
    fn heading(&self, after_s: f64) -> f64 {
        self.begin.heading + (self.begin.rates[2] + 0.5 * self.change[2] * after_s) * after_s
    }

    /// The state after a time; `before` is an earlier sample.
    fn at(&self, after_s: f64, (from_s, before): (f64, State)) -> State {
        let [ahead, aside, turn] = self.begin.rates;
        let rates = Vector::new(ahead, aside);
        let change = Vector::new(self.change[0], self.change[1]);
        let at = if self.is_clothoid() {
            before.at + self.integrated(from_s, after_s)
        } else if self.turns_axes {
            let angle = turn * after_s;
            let (even, growing) = (turned(even_turn(angle), rates), growing_turn(angle));
            let way = even * after_s + turned(growing, change) * (after_s * after_s);
            let (sin, cos) = libm::sincos(self.begin.heading);
            self.begin.at + turned([cos, sin], way)
        } else {
            self.begin.at + rates * after_s + change * (0.5 * after_s * after_s)
        };
        let heading = self.heading(after_s);
        State {
            at,
            heading,
            rates: self.rates(after_s),
            behind: self.hitch_m.map_or(0.0, |hitch_m| {
                let turned = heading - self.begin.heading;
                let joint = joint_after(
                    self.begin.heading - self.begin.behind,
                    turned,
                    ahead * after_s / hitch_m,
                );
                let behind = heading - joint;
                behind + TAU * ((before.behind - behind) / TAU).round()
            }),
        }
    }

    /// The way from one time to another, by Gauss's rule with five points.
    fn integrated(&self, from_s: f64, to_s: f64) -> Vector {
        const POINTS: [[f64; 2]; 3] = [
            [0.0, 0.568_888_888_888_888_9],
            [0.538_469_310_105_683_1, 0.478_628_670_499_366_47],
            [0.906_179_845_938_664, 0.236_926_885_056_189_08],
        ];
        let (middle, half) = (0.5 * (from_s + to_s), 0.5 * (to_s - from_s));
        let velocity = |at_s: f64| {
            let (sin, cos) = libm::sincos(self.heading(at_s));
            let [ahead, aside, _] = self.rates(at_s);
            turned([cos, sin], Vector::new(ahead, aside))
        };
        let mut way = velocity(middle) * POINTS[0][1];
        for [place, weight] in &POINTS[1..] {
            way += (velocity(middle - half * place) + velocity(middle + half * place)) * *weight;
        }
        way * half
    }
}

/// A vector turned and stretched by a complex number.
fn turned([cos, sin]: [f64; 2], vector: Vector) -> Vector {
    Vector::new(
        cos * vector.x - sin * vector.y,
        sin * vector.x + cos * vector.y,
    )
}

/// Below that angle series are more exact than quotients.
const SMALL_RAD: f64 = 0.5;

/// ∫₀¹ exp(iφu) du.
fn even_turn(angle: f64) -> [f64; 2] {
    if angle.abs() < SMALL_RAD {
        return series(angle, |k| 1.0 / (k + 1.0));
    }
    let (sin, cos) = libm::sincos(angle);
    [sin / angle, (1.0 - cos) / angle]
}

/// ∫₀¹ u exp(iφu) du.
fn growing_turn(angle: f64) -> [f64; 2] {
    if angle.abs() < SMALL_RAD {
        return series(angle, |k| 1.0 / (k + 2.0));
    }
    let (sin, cos) = libm::sincos(angle);
    let square = angle * angle;
    [
        sin / angle + (cos - 1.0) / square,
        sin / square - cos / angle,
    ]
}

/// Σ (iφ)ᵏ/k! · weight(k): 14 terms are exact for [`SMALL_RAD`].
fn series(angle: f64, weight: impl Fn(f64) -> f64) -> [f64; 2] {
    let mut sum = [0.0; 2];
    let mut term = 1.0;
    for k in 0..14_u32 {
        let sign = if k & 2 == 0 { 1.0 } else { -1.0 };
        sum[(k & 1) as usize] += sign * term * weight(f64::from(k));
        term *= angle / (f64::from(k) + 1.0);
    }
    sum
}
