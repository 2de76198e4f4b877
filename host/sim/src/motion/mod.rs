//! Motion models with limits, and the controllers that drive them.
//!
//! A [`Model`] moves a body from its [`State`] towards a [`Target`], at which it is to
//! rest, tick by tick. It never passes the target by more than
//! [`Model::arrival_tolerance_m`], and a body that starts from rest stays within
//! [`Model::lateral_tolerance_m`] of the straight line to it: gated execution relies on
//! both. Models are deterministic to the bit: only `+ − × ÷`, square roots and the
//! functions of `libm`.
//!
//! `docs/execution.md` describes every model and controller, with the sources of its
//! numbers.

mod car;
mod error;
mod fleet;
mod fleet_file;
mod ideal;
mod law;
mod plane;
mod preset;
mod smooth;
mod state;
mod waypoint;
mod wheeled;

use fleetyard_core::json::with_hint;
use fleetyard_world::{Dynamics, Trailer, Travel};
use serde::de::value::MapAccessDeserializer;
use serde::de::{MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub use car::Car;
pub use error::MotionError;
pub use fleet::{Fleet, FleetError, Profile};
pub use fleet_file::{
    Assignment, FLEET_FILE_LIMIT, FLEET_FORMAT, FleetFile, load_fleet, read_fleet,
};
pub use ideal::{Pebble, Rotation};
pub(crate) use law::stopping_speed;
pub use law::{Pid, wrap};
pub use plane::{DoubleIntegrator, Holonomic, SingleIntegrator};
pub use preset::{PRESETS, Preset};
pub use smooth::smooth;
pub use state::{State, Target};
pub use waypoint::{WaypointLaw, WheelSpeeds};
pub use wheeled::{DifferentialDrive, TurnAndDrive, Unicycle1, Unicycle2};

/// Motion model of a body: its limits and its controller.
///
/// In files either the name of a preset, or an object with the name of a model and its
/// parameters, all of which have defaults: `"agv"`, `{"differential-drive": {}}`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(remote = "Self", rename_all = "kebab-case")]
pub enum Model {
    /// Unit moves, followed exactly.
    Pebble(Pebble),
    /// Unit moves forwards and turns, followed exactly.
    Rotation(Rotation),
    /// One common speed.
    SingleIntegrator(SingleIntegrator),
    /// Two driven wheels, with limits and PID control.
    DifferentialDrive(DifferentialDrive),
    /// Speed and turn rate are set at once.
    #[serde(rename = "unicycle-1")]
    Unicycle1(Unicycle1),
    /// Acceleration and turn acceleration are set.
    #[serde(rename = "unicycle-2")]
    Unicycle2(Unicycle2),
    /// Accelerations along x and y are set.
    DoubleIntegrator(DoubleIntegrator),
    /// Body twists, with proportional control.
    Holonomic(Holonomic),
    /// A differential drive under the waypoint law of the maze benchmark.
    WaypointLaw(WaypointLaw),
    /// Front wheels that steer, and perhaps a trailer; follows plans exactly.
    Car(Car),
}

impl Model {
    /// The name used in files and on the command line.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Pebble(_) => "pebble",
            Self::Rotation(_) => "rotation",
            Self::SingleIntegrator(_) => "single-integrator",
            Self::DifferentialDrive(_) => "differential-drive",
            Self::Unicycle1(_) => "unicycle-1",
            Self::Unicycle2(_) => "unicycle-2",
            Self::DoubleIntegrator(_) => "double-integrator",
            Self::Holonomic(_) => "holonomic",
            Self::WaypointLaw(_) => "waypoint-law",
            Self::Car(_) => "car",
        }
    }

    /// True if bodies follow their reference exactly, without a controller.
    pub fn is_ideal(&self) -> bool {
        matches!(self, Self::Pebble(_) | Self::Rotation(_) | Self::Car(_))
    }

    /// True if a body is off its way by rounding alone.
    pub fn is_exact(&self) -> bool {
        self.is_ideal() || matches!(self, Self::SingleIntegrator(_))
    }

    /// Checks the parameters. A model that was read from a file is valid.
    pub fn validate(&self) -> Result<(), MotionError> {
        match self {
            Self::Pebble(model) => model.validate(),
            Self::Rotation(model) => model.validate(),
            Self::SingleIntegrator(model) => model.validate(),
            Self::DifferentialDrive(model) => model.validate(),
            Self::Unicycle1(model) => model.validate(),
            Self::Unicycle2(model) => model.validate(),
            Self::DoubleIntegrator(model) => model.validate(),
            Self::Holonomic(model) => model.validate(),
            Self::WaypointLaw(model) => model.validate(),
            Self::Car(model) => model.validate(),
        }
    }

    /// Moves a body for `ticks` ticks of `dt` seconds and shows it at the end of each.
    ///
    /// `speed_factor` in `[0, 1]` lowers the requested speeds and turn rates; a body that
    /// is faster slows down under its limits. Ideal models move uniformly and are at the
    /// target after the last tick.
    #[inline]
    pub fn run(
        &self,
        state: &mut State,
        target: &Target,
        ticks: usize,
        dt: f64,
        speed_factor: f64,
        visit: &mut impl FnMut(&State),
    ) {
        let factor = speed_factor;
        match self {
            Self::Pebble(_) | Self::Rotation(_) | Self::Car(_) => {
                ideal::run(state, target, ticks, dt, factor, visit);
            }
            Self::SingleIntegrator(model) => model.run(state, target, ticks, dt, factor, visit),
            Self::DifferentialDrive(model) => {
                if model.control.rests(state, target) {
                    state.forget();
                    (0..ticks).for_each(|_| visit(state));
                } else {
                    model.wheels(dt, factor).run(state, target, ticks, visit);
                }
            }
            Self::Unicycle1(model) => {
                if model.control.rests(state, target) {
                    state.forget();
                    (0..ticks).for_each(|_| visit(state));
                } else {
                    model.wheels(dt, factor).run(state, target, ticks, visit);
                }
            }
            Self::Unicycle2(model) => {
                if model.control.rests(state, target) {
                    state.forget();
                    (0..ticks).for_each(|_| visit(state));
                } else {
                    model.wheels(dt, factor).run(state, target, ticks, visit);
                }
            }
            Self::DoubleIntegrator(model) => {
                model.plane(dt, factor).run(state, target, ticks, visit);
            }
            Self::Holonomic(model) => model.plane(dt, factor).run(state, target, ticks, visit),
            Self::WaypointLaw(model) => model.run(state, target, ticks, dt, factor, visit),
        }
    }

    /// True if the body is at the target, and would stop within the tolerances.
    pub fn has_arrived(&self, state: &State, target: &Target) -> bool {
        let near = match self {
            Self::WaypointLaw(model) => model.arrival_tolerance_m,
            _ => self.arrival_tolerance_m(),
        };
        self.is_within(near, state, target)
    }

    /// True if the body is at the last target of its route, which may have a larger
    /// tolerance.
    pub fn has_finished(&self, state: &State, target: &Target) -> bool {
        self.is_within(self.arrival_tolerance_m(), state, target)
    }

    fn is_within(&self, near: f64, state: &State, target: &Target) -> bool {
        let (_, _, squared) = state.way(target);
        if squared > near * near || self.stop_distance_m(state) > near {
            return false;
        }
        let Some(heading) = target.heading else {
            return true;
        };
        let error = (heading - state.heading).abs();
        let tolerance = self.heading_tolerance_rad();
        let error = if self.is_ideal() || self.keeps_headings() {
            error
        } else {
            wrap(error).abs()
        };
        let deceleration = match self {
            Self::Pebble(_)
            | Self::Rotation(_)
            | Self::SingleIntegrator(_)
            | Self::Unicycle1(_)
            | Self::DoubleIntegrator(_)
            | Self::Car(_) => f64::INFINITY,
            Self::DifferentialDrive(model) => model.max_turn_acceleration_rad_per_s2,
            Self::Unicycle2(model) => model.max_turn_acceleration_rad_per_s2,
            Self::Holonomic(model) => model.max_turn_acceleration_rad_per_s2,
            Self::WaypointLaw(model) => model.turn_down_rad_per_s2,
        };
        error <= tolerance && half_square(state.omega, deceleration) <= tolerance
    }

    /// Braking distance from top speed at the largest deceleration, in metres; 0 for
    /// models that stop at once from any speed.
    pub fn longest_stop_m(&self) -> f64 {
        let speed = self.max_speed_m_per_s();
        if !speed.is_finite() {
            return 0.0;
        }
        self.stop_distance_m(&State {
            vx: speed,
            ..State::at_rest(0.0, 0.0, 0.0)
        })
    }

    /// Braking distance from top speed at the controller's deceleration, in metres.
    pub fn usual_stop_m(&self) -> f64 {
        let braking = match self {
            Self::DifferentialDrive(model) => model.braking_m_per_s2,
            Self::WaypointLaw(model) => Some(model.braking_m_per_s2),
            _ => None,
        };
        let speed = self.max_speed_m_per_s();
        let stop_m = braking.map_or(0.0, |braking| speed * speed / (2.0 * braking));
        stop_m.max(self.longest_stop_m())
    }

    /// Least braking distance from the current state.
    pub fn stop_distance_m(&self, state: &State) -> f64 {
        let deceleration = match self {
            Self::Pebble(_)
            | Self::Rotation(_)
            | Self::SingleIntegrator(_)
            | Self::Unicycle1(_)
            | Self::Car(_) => {
                return 0.0;
            }
            Self::DifferentialDrive(model) => model.max_deceleration_m_per_s2,
            Self::Unicycle2(model) => model.max_acceleration_m_per_s2,
            Self::DoubleIntegrator(model) => model.max_acceleration_m_per_s2,
            Self::Holonomic(model) => model.least_acceleration(),
            Self::WaypointLaw(model) => model.slow_down_m_per_s2,
        };
        (state.vx * state.vx + state.vy * state.vy) / (2.0 * deceleration)
    }

    /// A body has arrived if it stops within this distance; no body passes its target by
    /// more.
    pub fn arrival_tolerance_m(&self) -> f64 {
        match self {
            Self::Pebble(_) | Self::Rotation(_) | Self::SingleIntegrator(_) | Self::Car(_) => {
                SingleIntegrator::TOLERANCE
            }
            Self::DifferentialDrive(model) => model.control.arrival_tolerance_m,
            Self::Unicycle1(model) => model.control.arrival_tolerance_m,
            Self::Unicycle2(model) => model.control.arrival_tolerance_m,
            Self::DoubleIntegrator(model) => model.arrival_tolerance_m,
            Self::Holonomic(model) => model.arrival_tolerance_m,
            Self::WaypointLaw(model) => model.final_tolerance_m(),
        }
    }

    /// Largest distance from the line on the way to one or more knots in a straight line,
    /// from rest within the arrival tolerance of a knot.
    pub fn lateral_tolerance_m(&self) -> f64 {
        match self {
            Self::Pebble(_) | Self::Rotation(_) | Self::SingleIntegrator(_) | Self::Car(_) => {
                SingleIntegrator::TOLERANCE
            }
            Self::DifferentialDrive(model) => model.control.lateral_tolerance_m(),
            Self::Unicycle1(model) => model.control.lateral_tolerance_m(),
            Self::Unicycle2(model) => model.control.lateral_tolerance_m(),
            Self::DoubleIntegrator(model) => 1.1 * model.arrival_tolerance_m,
            Self::Holonomic(model) => 1.1 * model.arrival_tolerance_m,
            Self::WaypointLaw(model) => model.lateral_tolerance_m(),
        }
    }

    /// True if a body has the planned headings wherever it moves: from rest within the
    /// tolerances of a pose, on the way to another one, its place and its heading change
    /// in proportion, so that at some fraction of the way it is within
    /// [`Model::lateral_tolerance_m`] and [`Model::heading_tolerance_rad`] of it. Wheeled
    /// bodies head where they drive instead.
    pub fn keeps_headings(&self) -> bool {
        matches!(
            self,
            Self::SingleIntegrator(_) | Self::DoubleIntegrator(_) | Self::Holonomic(_)
        )
    }

    /// True if a body need not stop where its way bends: it moves in any direction, under limits.
    pub(crate) fn goes_through_bends(&self) -> bool {
        self.keeps_headings() && !self.is_exact()
    }

    /// Share of a way of this length, in metres, at whose end a body has to aim to keep half of its
    /// deceleration for bends on the way: a target is approached with all of it, or in proportion to its
    /// distance. Bodies whose limits turn with them keep that half anyway while they turn.
    pub(crate) fn gentle_share(&self, distance_m: f64, turns: bool) -> f64 {
        let (gain_per_s, deceleration) = match self {
            Self::DoubleIntegrator(model) => {
                (model.distance_gain_per_s, model.max_acceleration_m_per_s2)
            }
            Self::Holonomic(model) if !turns => {
                (model.distance_gain_per_s, model.least_acceleration())
            }
            _ => return 1.0,
        };
        let share = (deceleration / distance_m).sqrt() / gain_per_s;
        share.clamp(0.5, 1.0)
    }

    /// A body has arrived if it is within this angle of the requested heading.
    pub fn heading_tolerance_rad(&self) -> f64 {
        match self {
            Self::Pebble(_) | Self::Rotation(_) | Self::SingleIntegrator(_) | Self::Car(_) => {
                SingleIntegrator::TOLERANCE
            }
            Self::DifferentialDrive(model) => model.control.heading_tolerance_rad,
            Self::Unicycle1(model) => model.control.heading_tolerance_rad,
            Self::Unicycle2(model) => model.control.heading_tolerance_rad,
            Self::DoubleIntegrator(model) => model.heading_tolerance_rad,
            Self::Holonomic(model) => model.heading_tolerance_rad,
            Self::WaypointLaw(model) => model.heading_tolerance_rad,
        }
    }

    /// Largest speed over ground; infinite for ideal models, which are as fast as their
    /// reference.
    pub fn max_speed_m_per_s(&self) -> f64 {
        match self {
            Self::Pebble(_) | Self::Rotation(_) => f64::INFINITY,
            Self::SingleIntegrator(model) => model.speed_m_per_s,
            Self::DifferentialDrive(model) => model.max_speed_m_per_s,
            Self::Unicycle1(model) => model.max_speed_m_per_s,
            Self::Unicycle2(model) => model.max_speed_m_per_s,
            Self::DoubleIntegrator(model) => model.max_speed_m_per_s * core::f64::consts::SQRT_2,
            Self::Holonomic(model) => {
                let forward = model.max_forward_m_per_s.max(model.max_backward_m_per_s);
                let lateral = model.max_lateral_m_per_s;
                (forward * forward + lateral * lateral).sqrt()
            }
            Self::WaypointLaw(model) => model.max_speed_m_per_s,
            Self::Car(model) => model.top_speed(),
        }
    }

    /// Largest turn rate; infinite for models whose heading is free.
    pub fn max_turn_rate_rad_per_s(&self) -> f64 {
        match self {
            Self::Pebble(_) | Self::Rotation(_) | Self::SingleIntegrator(_) => f64::INFINITY,
            Self::DifferentialDrive(model) => model.max_turn_rate_rad_per_s,
            Self::Unicycle1(model) => model.max_turn_rate_rad_per_s,
            Self::Unicycle2(model) => model.max_turn_rate_rad_per_s,
            Self::DoubleIntegrator(model) => model.max_turn_rate_rad_per_s,
            Self::Holonomic(model) => model.max_turn_rate_rad_per_s,
            Self::WaypointLaw(model) => model.max_turn_rate_rad_per_s,
            Self::Car(model) => model.curvature() * model.top_speed(),
        }
    }
}

impl Model {
    /// The trailer of a car that tows one.
    pub fn trailer(&self) -> Option<Trailer> {
        match self {
            Self::Car(model) => model.trailer,
            _ => None,
        }
    }

    /// Limits against which plans are validated.
    pub fn dynamics(&self) -> Dynamics {
        let unlimited = f64::INFINITY;
        let (travel, turn_acceleration) = match self {
            Self::Pebble(_) | Self::Rotation(_) => (Dynamics::UNLIMITED.travel, unlimited),
            Self::SingleIntegrator(model) => (
                Travel::Polar {
                    speed: model.speed_m_per_s,
                    acceleration: unlimited,
                },
                unlimited,
            ),
            Self::DoubleIntegrator(model) => (
                Travel::Axes {
                    speed: model.max_speed_m_per_s,
                    acceleration: model.max_acceleration_m_per_s2,
                },
                unlimited,
            ),
            Self::Holonomic(model) => (
                Travel::Body {
                    forward: model.max_forward_m_per_s,
                    backward: model.max_backward_m_per_s,
                    sideways: model.max_lateral_m_per_s,
                    forward_acceleration: model.max_forward_acceleration_m_per_s2,
                    sideways_acceleration: model.max_lateral_acceleration_m_per_s2,
                },
                model.max_turn_acceleration_rad_per_s2,
            ),
            Self::DifferentialDrive(model) => (
                wheels(
                    model.max_speed_m_per_s,
                    model.control.reverse,
                    model.max_acceleration_m_per_s2,
                    model.max_deceleration_m_per_s2,
                ),
                model.max_turn_acceleration_rad_per_s2,
            ),
            Self::Unicycle1(model) => (
                wheels(
                    model.max_speed_m_per_s,
                    model.control.reverse,
                    unlimited,
                    unlimited,
                ),
                unlimited,
            ),
            Self::Unicycle2(model) => (
                wheels(
                    model.max_speed_m_per_s,
                    model.control.reverse,
                    model.max_acceleration_m_per_s2,
                    model.max_acceleration_m_per_s2,
                ),
                model.max_turn_acceleration_rad_per_s2,
            ),
            // It starts at its deceleration, and turns cost speed at once.
            Self::WaypointLaw(model) => (
                wheels(
                    model.max_speed_m_per_s,
                    false,
                    model.speed_up_m_per_s2.max(model.slow_down_m_per_s2),
                    unlimited,
                ),
                model.turn_up_rad_per_s2.max(model.turn_down_rad_per_s2),
            ),
            Self::Car(model) => return model.dynamics(),
        };
        Dynamics {
            travel,
            turn_rad_per_s: self.max_turn_rate_rad_per_s(),
            turn_acceleration_rad_per_s2: turn_acceleration,
            curvature_rad_per_m: unlimited,
        }
    }
}

fn wheels(speed: f64, reverse: bool, acceleration: f64, deceleration: f64) -> Travel {
    Travel::Wheels {
        forward: speed,
        backward: if reverse { speed } else { 0.0 },
        acceleration,
        deceleration,
    }
}

/// Angle or distance covered while a rate falls to zero.
fn half_square(rate: f64, deceleration: f64) -> f64 {
    rate * rate / (2.0 * deceleration)
}

impl Serialize for Model {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        Self::serialize(self, serializer)
    }
}

impl<'de> Deserialize<'de> for Model {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Form;

        impl<'de> Visitor<'de> for Form {
            type Value = Model;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("the name of a preset, or an object with the name of a model")
            }

            fn visit_str<E: serde::de::Error>(self, name: &str) -> Result<Model, E> {
                name.parse()
                    .map_err(|error: MotionError| with_hint(&error, Some(error.hint)))
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Model, A::Error> {
                let model = Model::deserialize(MapAccessDeserializer::new(map))?;
                let checked = model.validate();
                checked.map_err(|error| with_hint(&error, Some(error.hint)))?;
                Ok(model)
            }
        }

        deserializer.deserialize_any(Form)
    }
}
