//! Presets: robots and benchmarks by name.

use core::f64::consts::PI;
use std::str::FromStr;

use fleetyard_world::{Footprint, Trailer};

use super::{
    Car, DifferentialDrive, DoubleIntegrator, Holonomic, Model, MotionError, Pebble, Rotation,
    SingleIntegrator, TurnAndDrive, Unicycle1, Unicycle2, WaypointLaw,
};

/// A model with a name.
#[derive(Debug, Clone, Copy)]
pub struct Preset {
    /// The name, as in files and on the command line.
    pub name: &'static str,
    /// Description, with the source of its numbers.
    pub about: &'static str,
    /// The model.
    pub model: fn() -> Model,
    /// The footprint, for presets of robots.
    pub footprint: Option<fn() -> Footprint>,
}

/// All presets; every model with its defaults comes first.
pub const PRESETS: &[Preset] = &[
    Preset {
        name: "pebble",
        about: "unit moves in one second, followed exactly",
        model: || Model::Pebble(Pebble::default()),
        footprint: None,
    },
    Preset {
        name: "rotation",
        about: "unit moves and turns by 90° in one second each, followed exactly",
        model: || Model::Rotation(Rotation::default()),
        footprint: None,
    },
    Preset {
        name: "single-integrator",
        about: "stop and go at 1 m/s in any direction",
        model: || Model::SingleIntegrator(SingleIntegrator::default()),
        footprint: None,
    },
    Preset {
        name: "differential-drive",
        about: "the same as agv",
        model: || Model::DifferentialDrive(DifferentialDrive::default()),
        footprint: None,
    },
    Preset {
        name: "unicycle-1",
        about: "the same as dynobench-unicycle-1",
        model: || Model::Unicycle1(Unicycle1::default()),
        footprint: None,
    },
    Preset {
        name: "unicycle-2",
        about: "the same as dynobench-unicycle-2",
        model: || Model::Unicycle2(Unicycle2::default()),
        footprint: None,
    },
    Preset {
        name: "double-integrator",
        about: "the same as dynobench-double-integrator",
        model: || Model::DoubleIntegrator(DoubleIntegrator::default()),
        footprint: None,
    },
    Preset {
        name: "holonomic",
        about: "a robot of 1 m/s forwards and 0.5 m/s sideways",
        model: || Model::Holonomic(Holonomic::default()),
        footprint: None,
    },
    Preset {
        name: "waypoint-law",
        about: "the law of the maze benchmark on a Husky",
        model: || Model::WaypointLaw(WaypointLaw::default()),
        footprint: None,
    },
    Preset {
        name: "car",
        about: "the same as dynobench-car",
        model: || Model::Car(Car::default()),
        footprint: None,
    },
    Preset {
        name: "agv",
        about: "2 m/s, 2 m/s², 45°/s: LSMART as published (section 4.1)",
        model: || Model::DifferentialDrive(DifferentialDrive::default()),
        footprint: Some(|| disc(0.3)),
    },
    Preset {
        name: "lsmart-effective",
        about: "LSMART as measured: brakes at 0.2 m/s², peaks at 0.95 m/s, turns 90° in 0.9 s",
        model: || {
            Model::DifferentialDrive(DifferentialDrive {
                max_speed_m_per_s: 0.95,
                braking_m_per_s2: Some(0.2),
                max_turn_rate_rad_per_s: 2.0,
                max_turn_acceleration_rad_per_s2: 17.5,
                control: TurnAndDrive {
                    arrival_tolerance_m: 0.03,
                    ..TurnAndDrive::default()
                },
                ..DifferentialDrive::default()
            })
        },
        footprint: Some(|| disc(0.085)),
    },
    Preset {
        name: "go2",
        about: "Unitree Go2: 2.5 m/s (public figure)",
        model: || quadruped(2.5, 2.5),
        footprint: Some(|| rectangle(0.70, 0.31)),
    },
    Preset {
        name: "spot",
        about: "Boston Dynamics Spot: 1.6 m/s (public figure)",
        model: || quadruped(1.6, 1.6),
        footprint: Some(|| rectangle(1.10, 0.50)),
    },
    Preset {
        name: "anymal-c",
        about: "ANYbotics ANYmal C: 0.7 m/s and 0.75 m/s² (measured)",
        model: || quadruped(0.7, 0.75),
        footprint: Some(|| rectangle(0.93, 0.53)),
    },
    Preset {
        name: "dynobench-unicycle-1",
        about: "first-order unicycle of dynobench: ±0.5 m/s, ±0.5 rad/s",
        model: || Model::Unicycle1(Unicycle1::default()),
        footprint: Some(|| rectangle(0.5, 0.25)),
    },
    Preset {
        name: "dynobench-unicycle-1-sphere",
        about: "its variant with a round footprint: ±0.5 m/s, ±2 rad/s",
        model: || {
            let wide = Unicycle1 {
                max_turn_rate_rad_per_s: 2.0,
                ..Unicycle1::default()
            };
            Model::Unicycle1(wide)
        },
        footprint: Some(|| disc(0.4)),
    },
    Preset {
        name: "dynobench-unicycle-2",
        about: "second-order unicycle of dynobench: ±0.25 m/s², ±0.25 rad/s²",
        model: || Model::Unicycle2(Unicycle2::default()),
        footprint: Some(|| rectangle(0.5, 0.25)),
    },
    Preset {
        name: "dynobench-double-integrator",
        about: "double integrator of dynobench and GRACE: ±0.5 m/s, ±2 m/s² per axis",
        model: || Model::DoubleIntegrator(DoubleIntegrator::default()),
        footprint: None,
    },
    Preset {
        name: "dynobench-car",
        about: "car of dynobench: −0.1 to 0.5 m/s, steers by ±π/3, followed exactly",
        model: || Model::Car(Car::default()),
        footprint: Some(|| rectangle(0.5, 0.25)),
    },
    Preset {
        name: "dynobench-car-trailer",
        about: "the same with its trailer, hitched 0.5 m behind",
        model: || {
            Model::Car(Car {
                trailer: Some(Trailer::default()),
                ..Car::default()
            })
        },
        footprint: Some(|| rectangle(0.5, 0.25)),
    },
];

fn disc(radius_m: f64) -> Footprint {
    Footprint::Disc { radius_m }
}

fn rectangle(length_m: f64, width_m: f64) -> Footprint {
    Footprint::Rectangle { length_m, width_m }
}

/// Published figures give the forward speed alone; half of it in other directions, and a
/// quarter turn per second, are our choice.
fn quadruped(speed_m_per_s: f64, acceleration_m_per_s2: f64) -> Model {
    Model::Holonomic(Holonomic {
        max_forward_m_per_s: speed_m_per_s,
        max_backward_m_per_s: 0.5 * speed_m_per_s,
        max_lateral_m_per_s: 0.5 * speed_m_per_s,
        max_forward_acceleration_m_per_s2: acceleration_m_per_s2,
        max_lateral_acceleration_m_per_s2: acceleration_m_per_s2,
        max_turn_rate_rad_per_s: 0.5 * PI,
        max_turn_acceleration_rad_per_s2: PI,
        ..Holonomic::default()
    })
}

/// The preset of a name.
pub(super) fn find(name: &str) -> Result<&'static Preset, MotionError> {
    let preset = PRESETS.iter().find(|preset| preset.name == name);
    preset.ok_or_else(|| MotionError {
        field: "model",
        value: format!("{:?}", fleetyard_core::shown(name)),
        reason: "is not a model or a preset",
        hint: "use agv, lsmart-effective, go2, spot, anymal-c, pebble, rotation, \
               single-integrator, differential-drive, unicycle-1, unicycle-2, \
               double-integrator, holonomic, waypoint-law or car",
    })
}

impl FromStr for Model {
    type Err = MotionError;

    /// The model of a preset.
    fn from_str(name: &str) -> Result<Self, MotionError> {
        Ok((find(name)?.model)())
    }
}
