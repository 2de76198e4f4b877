//! Worlds of Fleetyard: what robots and obstacles cover, and seeded generators
//! of maps and scenarios.
//!
//! # Geometry
//!
//! The geometry that judging and simulating share: a [`Footprint`] becomes a [`Shape`], a
//! [`Workspace`] has [`Polygon`]s. Metres, seconds, radians; x right, y up, headings
//! counter-clockwise. Results are the same bits on every machine.
//!
//! # Generators
//!
//! Every generator is a struct of parameters with the methods of [`MapSpec`]:
//! the same parameters and the same seed give the same bytes on every machine.
//! What a generator cannot make is an [`InputError`](fleetyard_core::InputError) whose
//! source is the parameter's name.

#![forbid(unsafe_code)]

mod bounds;
mod canvas;
mod controls;
mod dynamics;
mod enclosing;
pub mod exact;
mod footprint;
mod geometry;
mod index;
mod maze;
mod polygon;
mod pose;
mod python_random;
mod random;
mod random_map;
mod room;
mod scenario;
mod separation;
mod shape;
mod spec;
mod sweep;
mod swept;
mod trailer;
mod vector;
mod warehouse;
mod workspace;

pub use bounds::Bounds;
pub use controls::{
    Bounded, CHORD_M, CHORD_RAD, ControlError, ControlExcess, ControlModel, Driven,
};
pub use dynamics::{DYNAMICS_TOLERANCE, Demand, Dynamics, Excess, LONGEST_SAMPLE_S, Travel};
pub use footprint::{Footprint, FootprintError};
pub use geometry::{Inside, Relative};
pub use index::{BoxIndex, Lists, Tiles};
pub use maze::{Maze, MazeAlgorithm, MazeRandom, MazeSeeds, MazeSpec};
pub use polygon::{Boundary, Polygon, PolygonError};
pub use pose::Pose;
pub use python_random::PythonRandom;
pub use random::SeededRandom;
pub use random_map::RandomSpec;
pub use room::RoomSpec;
pub use scenario::ScenarioSpec;
pub use separation::{Placement, distance_m, separation_m};
pub use shape::{Shape, common_radius_m};
pub use spec::{EmptySpec, MapSpec};
pub use sweep::{RESOLUTION_M, contacts_in_span};
pub use swept::{SWEPT_SLACK, squared_distance, swept_shapes_meet};
pub use trailer::{Bend, Towed, Trailer, Trains, joint_after};
pub use vector::Vector;
pub use warehouse::WarehouseSpec;
pub use workspace::{
    Mover, WORLD_FILE_LIMIT, WORLD_FORMAT, Workspace, load_workspace, read_workspace,
    save_workspace, write_workspace,
};
