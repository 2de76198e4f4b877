//! Worlds of Fleetyard: seeded generators of maps and scenarios.
//!
//! Every generator is a struct of parameters with the methods of [`MapSpec`]:
//! the same parameters and the same seed give the same bytes on every machine.
//! What a generator cannot make is an [`InputError`](fleetyard_core::InputError) whose
//! source is the parameter's name.

#![forbid(unsafe_code)]

mod canvas;
mod maze;
mod random;
mod random_map;
mod room;
mod scenario;
mod spec;
mod warehouse;

pub use maze::{MazeAlgorithm, MazeSpec};
pub use random::SeededRandom;
pub use random_map::RandomSpec;
pub use room::RoomSpec;
pub use scenario::ScenarioSpec;
pub use spec::{EmptySpec, MapSpec};
pub use warehouse::WarehouseSpec;
