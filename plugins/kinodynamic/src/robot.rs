//! Robots in the plane: their states, their limits, and where controls lead.
//!
//! Robots of the contract differ in three things. Their rates are along the axes of the world or of the body; they may go to
//! the side or not; and controls are rates (first order) or change them (second order). While a control is held, rates are
//! linear in time. So is the direction of axes that turn evenly; positions are integrated by Gauss's rule with five points
//! over pieces in which the robot turns by a quarter radian at most, which is exact to 10⁻¹⁰ of the way.

use fleetyard_abi::Limit;
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::sssp::bodies::{Body, Pose, wrapped};

use crate::car::{Car, Trailer};

/// Names of the dynamics that all planners know.
pub const DYNAMICS: [&str; 6] = [
    "fleetyard.single-integrator/1",
    "fleetyard.double-integrator/1",
    "fleetyard.unicycle/1",
    "fleetyard.unicycle-2/1",
    "fleetyard.holonomic/1",
    "fleetyard.holonomic-2/1",
];

/// Names of the dynamics of cars, with a trailer and without.
pub const CARS: [&str; 2] = ["fleetyard.car/1", "fleetyard.car-trailer/1"];

/// Rates, or their changes: along the first axis, along the second one, and of the heading; m/s and rad/s, or m/s² and rad/s².
pub type Control = [f64; 3];

/// A rate or a change without a limit is limited to this: in m/s, m/s², rad/s or rad/s².
pub const UNLIMITED: f64 = 1.0;

/// Rates may exceed a limit by this part of it: they are sums of many changes.
const ROUNDING: f64 = 1e-10;

/// A miss by less is rounding, in metres, radians and their rates.
const MISSED: f64 = 1e-9;

/// A piece that is integrated turns by no more, in radians.
const PIECE_RAD: f64 = 0.25;

/// The place of a robot, and how it moves. Rates of a robot of first order are zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Its origin, in metres.
    pub at: Vector,
    /// Radians counter-clockwise from +x, not wrapped; zero where a robot has none.
    pub heading: f64,
    /// As [`Control`], in the order of the robot's axes.
    pub rates: [f64; 3],
    /// The heading of its trailer, not wrapped; as its own where a robot has none.
    pub behind: f64,
}

impl State {
    /// At rest, with a trailer in line.
    pub fn rest(at: Vector, heading: f64) -> Self {
        Self {
            at,
            heading,
            rates: [0.0; 3],
            behind: heading,
        }
    }

    /// Its place and heading.
    pub fn pose(&self) -> Pose {
        Pose {
            at: self.at,
            heading: self.heading,
        }
    }
}

/// A robot of the contract.
#[derive(Debug, Clone, PartialEq)]
#[expect(clippy::struct_excessive_bools, reason = "as the contract has them")]
pub struct Robot {
    /// Its body.
    pub body: Body,
    /// Axes turn with the body.
    pub turns_axes: bool,
    /// Controls change rates, instead of being them.
    pub is_second: bool,
    /// It moves along the second axis.
    pub goes_sideways: bool,
    /// It has a heading.
    pub has_heading: bool,
    /// The largest of the first two rates bounds their length.
    pub polar_rates: bool,
    /// The largest of the first two changes bounds their length.
    pub polar_changes: bool,
    /// Least and most of each rate; zeros of an axis that it does not have.
    pub rates: [[f64; 2]; 3],
    /// Least and most change of each rate; zeros of an axis that it does not have, and of a robot of first order.
    pub changes: [[f64; 2]; 3],
    /// It steers: its turn rate is bounded by its speed.
    pub car: Option<Car>,
}

impl Robot {
    /// Fails with the reason for dynamics that are not known, or limits that are none.
    pub fn new(robot: &fleetyard_abi::Robot) -> Result<Self, String> {
        let (turns_axes, is_second, goes_sideways) = match &*robot.dynamics {
            // Any motion will do.
            "" | "fleetyard.single-integrator/1" => (false, false, true),
            "fleetyard.double-integrator/1" => (false, true, true),
            "fleetyard.unicycle/1" | "fleetyard.car/1" | "fleetyard.car-trailer/1" => {
                (true, false, false)
            }
            "fleetyard.unicycle-2/1" => (true, true, false),
            "fleetyard.holonomic/1" => (true, false, true),
            "fleetyard.holonomic-2/1" => (true, true, true),
            other => return Err(format!("the dynamics `{other}` are not known")),
        };
        if turns_axes && !robot.has_heading {
            return Err(format!("dynamics `{}` without a heading", robot.dynamics));
        }
        let pose = 2 + usize::from(robot.has_heading) + usize::from(robot.dynamics == CARS[1]);
        let of_pose = robot.state_limits.iter().take(pose);
        if of_pose.flatten().any(Option::is_some) {
            return Err("limits of places and headings are not supported".to_owned());
        }
        let known = robot.control_limits.iter().chain(&robot.state_limits);
        let (mut low, mut high) = known.fold((true, true), |(low, high), [least, most]| {
            (
                low && least.is_none_or(|least| least <= 0.0),
                high && most.is_none_or(|most| most >= 0.0),
            )
        });
        low &= robot.control_limits.len() <= 3;
        high &= robot.state_limits.len() <= 6;
        if !low || !high {
            return Err("limits between which there is no rest are not supported".to_owned());
        }
        let there = [true, goes_sideways, robot.has_heading];
        let spread = |limits: &[[Limit; 2]]| {
            let mut limits = limits.iter();
            there.map(|there| {
                if !there {
                    return [0.0; 2];
                }
                let [least, most] = limits.next().copied().unwrap_or([None; 2]);
                [least.unwrap_or(-UNLIMITED), most.unwrap_or(UNLIMITED)]
            })
        };
        let mut controls = spread(&robot.control_limits);
        let car = if CARS.contains(&&*robot.dynamics) {
            let [right, left] = controls[2];
            let car = Car::new(&robot.parameters, left.min(-right));
            let is_towing = robot.dynamics == CARS[1];
            let car = car.filter(|car| car.trailer.is_some() == is_towing);
            Some(car.ok_or_else(|| format!("parameters that are none of `{}`", robot.dynamics))?)
        } else {
            None
        };
        if let Some(car) = &car {
            let most = car.curvature * greatest(controls[0]);
            controls[2] = [-most, most];
        }
        let corners = robot.footprint.corners_m.iter();
        Ok(Self {
            body: Body {
                radius: robot.footprint.radius_m,
                corners: corners.map(|[x, y]| Vector::new(*x, *y)).collect(),
            },
            turns_axes,
            is_second,
            goes_sideways,
            has_heading: robot.has_heading,
            polar_rates: goes_sideways
                && if is_second {
                    robot.polar_state
                } else {
                    robot.polar_control
                },
            polar_changes: goes_sideways && is_second && robot.polar_control,
            rates: if is_second {
                spread(robot.state_limits.get(pose..).unwrap_or_default())
            } else {
                controls
            },
            changes: if is_second { controls } else { [[0.0; 2]; 3] },
            car,
        })
    }

    /// The axes that it has: travel along both, and turning.
    pub fn axes(&self) -> [bool; 3] {
        [true, self.goes_sideways, self.has_heading]
    }

    /// Least and most of each number of a control.
    pub fn controls(&self) -> &[[f64; 2]; 3] {
        if self.is_second {
            &self.changes
        } else {
            &self.rates
        }
    }

    /// The nearest control within the limits, number by number, then shortened where the length is bounded.
    #[must_use]
    pub fn clamped(&self, control: &Control) -> Control {
        let polar = if self.is_second {
            self.polar_changes
        } else {
            self.polar_rates
        };
        let mut near = within(control, self.controls(), polar);
        if let Some(car) = &self.car {
            let most = car.curvature * near[0].abs();
            near[2] = near[2].clamp(-most, most);
        }
        near
    }

    /// The trailer that it tows.
    pub fn trailer(&self) -> Option<&Trailer> {
        self.car.as_ref()?.trailer.as_ref()
    }

    /// Bounds from below of its ways are far off: it has to speed up and slow down, or to keep a joint from bending too far.
    pub fn is_hard_to_bound(&self) -> bool {
        self.is_second || self.trailer().is_some()
    }

    /// Its trailer, if there is one, is not bent too far.
    pub fn allows_joint(&self, state: &State) -> bool {
        let trailer = self.trailer();
        trailer.is_none_or(|trailer| trailer.allows(state.heading, state.behind))
    }

    /// Farthest that a point of it, or of its trailer, is from its origin, in metres.
    pub fn span(&self, body: &Body) -> f64 {
        let trailer = self.trailer().map_or(0.0, Trailer::reach);
        body.radius.max(trailer)
    }

    /// The nearest rates within the limits; of a robot of first order there are none.
    #[must_use]
    pub fn clamped_rates(&self, rates: &[f64; 3]) -> [f64; 3] {
        if self.is_second {
            within(rates, &self.rates, self.polar_rates)
        } else {
            [0.0; 3]
        }
    }

    /// Rates are within the limits, but for rounding.
    pub fn allows(&self, rates: &[f64; 3]) -> bool {
        let near = |value: f64, [least, most]: [f64; 2]| {
            least * (1.0 + ROUNDING) - ROUNDING <= value
                && value <= most * (1.0 + ROUNDING) + ROUNDING
        };
        if !self.is_second {
            return rates.iter().all(|rate| *rate == 0.0);
        }
        let polar = usize::from(self.polar_rates) * 2;
        let length = libm::hypot(rates[0], rates[1]);
        (polar..3).all(|axis| near(rates[axis], self.rates[axis]))
            && (polar == 0 || near(length, [0.0, longest(&self.rates)]))
    }

    /// The greatest speed of its origin, in m/s.
    pub fn top_speed(&self) -> f64 {
        top(&self.rates, self.polar_rates)
    }

    /// The greatest turn rate, in rad/s.
    pub fn top_turn_rate(&self) -> f64 {
        greatest(self.rates[2])
    }

    /// The state after a control was held for a time, in seconds. Whether limits hold is not asked.
    #[must_use]
    pub fn after(&self, state: &State, control: &Control, seconds: f64) -> State {
        let (rates, changes) = if self.is_second {
            (state.rates, *control)
        } else {
            (*control, [0.0; 3])
        };
        let at = |time: f64| [0, 1, 2].map(|axis| rates[axis] + changes[axis] * time);
        let turn = (rates[2] + changes[2] * seconds / 2.0) * seconds;
        let way = if self.turns_axes && (rates[2] != 0.0 || changes[2] != 0.0) {
            turned(state.heading, &rates, &changes, seconds)
        } else {
            let middle = at(seconds / 2.0);
            let along = Vector::new(middle[0], middle[1]) * seconds;
            if self.turns_axes {
                rotated(along, state.heading)
            } else {
                along
            }
        };
        let heading = state.heading + turn;
        State {
            at: state.at + way,
            heading,
            rates: if self.is_second {
                at(seconds)
            } else {
                [0.0; 3]
            },
            behind: match self.trailer() {
                Some(trailer) => {
                    let headings = [state.heading, heading];
                    trailer.after(state.behind, headings, rates[0] * seconds)
                }
                None => heading,
            },
        }
    }

    /// The velocity of its origin in the world, in m/s, with these rates at a heading.
    pub fn velocity(&self, heading: f64, rates: &[f64; 3]) -> Vector {
        let along = Vector::new(rates[0], rates[1]);
        if self.turns_axes {
            rotated(along, heading)
        } else {
            along
        }
    }

    /// The pose after a motion from the origin with heading zero, begun in another pose.
    #[must_use]
    pub fn placed(&self, start: &Pose, motion: &Pose) -> Pose {
        let way = if self.turns_axes {
            rotated(motion.at, start.heading)
        } else {
            motion.at
        };
        Pose {
            at: start.at + way,
            heading: start.heading + motion.heading,
        }
    }

    /// The numbers of a control that the contract asks for.
    pub fn numbers(&self, control: &Control) -> Vec<f64> {
        if let Some(car) = &self.car {
            return vec![control[0], car.steering(control[0], control[2])];
        }
        let there = control.iter().zip(self.axes());
        there
            .filter_map(|(number, there)| there.then_some(*number))
            .collect()
    }

    /// The state of these numbers, and which of them any value will do for; none if there are too few.
    pub(crate) fn state(&self, numbers: &[f64]) -> Option<(State, Free)> {
        let mut rest = numbers.iter().copied();
        let mut any = |there: bool| if there { rest.next() } else { Some(0.0) };
        let at = Vector::new(any(true)?, any(true)?);
        let heading = any(self.has_heading)?;
        let behind = if self.trailer().is_some() {
            any(true)?
        } else {
            heading
        };
        let mut rates = [0.0; 3];
        for (rate, there) in rates.iter_mut().zip(self.axes()) {
            *rate = any(there && self.is_second)?;
        }
        let free = Free {
            heading: heading.is_nan() || !self.has_heading,
            rates: rates.map(f64::is_nan),
            trailer: behind.is_nan() || self.trailer().is_none(),
        };
        let known = |number: f64| if number.is_nan() { 0.0 } else { number };
        let state = State {
            at,
            heading: known(heading),
            rates: rates.map(known),
            behind: if behind.is_nan() {
                known(heading)
            } else {
                behind
            },
        };
        (at.x.is_finite() && at.y.is_finite()).then_some((state, free))
    }
}

/// The numbers of a goal that any value will do for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Free {
    /// The heading.
    pub heading: bool,
    /// Rates.
    pub rates: [bool; 3],
    /// The heading of the trailer.
    pub trailer: bool,
}

/// A state that a robot has to come to rest in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Goal {
    /// The state.
    pub state: State,
    /// The numbers of it that do not matter.
    pub free: Free,
    /// Distance from the place, in metres, within which it is reached.
    pub place_m: f64,
    /// The same of the heading, in radians.
    pub heading_rad: f64,
    /// The same of each rate.
    pub rate: f64,
}

impl Goal {
    /// The differences to a state: of the place in metres, of the heading in radians the short way, of rates. Zero where any
    /// will do.
    pub fn missed(&self, state: &State) -> (Vector, f64, [f64; 3]) {
        let turn = wrapped(state.heading - self.state.heading);
        let rates = [0, 1, 2].map(|axis| {
            if self.free.rates[axis] {
                0.0
            } else {
                state.rates[axis] - self.state.rates[axis]
            }
        });
        let turn = if self.free.heading { 0.0 } else { turn };
        (state.at - self.state.at, turn, rates)
    }

    /// A state is within the tolerances, or misses it by rounding where there are none.
    pub fn is_reached(&self, state: &State) -> bool {
        let (place, turn, rates) = self.missed(state);
        let behind = wrapped(state.behind - self.state.behind).abs();
        // The host integrates by itself, and rounds otherwise.
        let near = (self.heading_rad * (1.0 - 1e-6)).max(MISSED);
        (self.free.trailer || behind <= near)
            && place.norm() <= self.place_m.max(MISSED)
            && turn.abs() <= self.heading_rad.max(MISSED)
            && rates.iter().all(|rate| rate.abs() <= self.rate.max(MISSED))
    }
}

/// Turned by an angle.
pub fn rotated(vector: Vector, angle: f64) -> Vector {
    let (sin, cos) = libm::sincos(angle);
    Vector::new(
        cos * vector.x - sin * vector.y,
        sin * vector.x + cos * vector.y,
    )
}

fn greatest([least, most]: [f64; 2]) -> f64 {
    most.max(-least)
}

/// The bound of the length of the first two numbers.
fn longest(limits: &[[f64; 2]; 3]) -> f64 {
    greatest(limits[0]).max(greatest(limits[1]))
}

/// The greatest length of the first two numbers.
fn top(limits: &[[f64; 2]; 3], polar: bool) -> f64 {
    if polar {
        longest(limits)
    } else {
        libm::hypot(greatest(limits[0]), greatest(limits[1]))
    }
}

fn within(numbers: &[f64; 3], limits: &[[f64; 2]; 3], polar: bool) -> [f64; 3] {
    let mut near = *numbers;
    for (number, [least, most]) in near.iter_mut().zip(limits) {
        *number = number.clamp(*least, *most);
    }
    if polar {
        let (length, most) = (libm::hypot(near[0], near[1]), longest(limits));
        if length > most {
            near[0] *= most / length;
            near[1] *= most / length;
        }
    }
    near
}

/// Points and weights of Gauss's rule on [−1, 1].
const GAUSS: [(f64, f64); 5] = [
    (-0.906_179_845_938_664, 0.236_926_885_056_189_08),
    (-0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.0, 0.568_888_888_888_888_9),
    (0.538_469_310_105_683_1, 0.478_628_670_499_366_47),
    (0.906_179_845_938_664, 0.236_926_885_056_189_08),
];

/// ∫ R(θ + ωt + αt²/2) (v + at) dt.
fn turned(heading: f64, rates: &[f64; 3], changes: &[f64; 3], seconds: f64) -> Vector {
    let mut way = Vector::zeros();
    quadrature(rates[2], changes[2], seconds, |time, turn, weight| {
        let along = Vector::new(rates[0] + changes[0] * time, rates[1] + changes[1] * time);
        way += rotated(along, heading + turn) * weight;
    });
    way
}

/// Calls `see` with times, the turn until then, and weights whose products with a function of time sum up to its integral.
pub(crate) fn quadrature(rate: f64, change: f64, seconds: f64, mut see: impl FnMut(f64, f64, f64)) {
    let fastest = rate.abs().max((rate + change * seconds).abs());
    let pieces = (fastest * seconds / PIECE_RAD).ceil().max(1.0);
    let half = seconds / pieces / 2.0;
    for piece in 0..pieces as u32 {
        let middle = half * f64::from(2 * piece + 1);
        for (offset, weight) in GAUSS {
            let time = middle + half * offset;
            see(time, (rate + change * time / 2.0) * time, weight * half);
        }
    }
}
