//! The domain model: maps, instances, plans, and the files they come from.
//!
//! This crate knows no clock, no plugin and no simulator. Everything in it is
//! plain data with explicit invariants, and every reader reports bad input as
//! an [`InputError`] that names file, line and column.

#![forbid(unsafe_code)]

mod digest;
mod error;
mod grid;
mod instance;
mod plan;

pub use digest::{Digest, Hasher};
pub use error::InputError;
pub use grid::{Connectivity, Grid};
pub use instance::{GridInstance, InstanceError};
pub use plan::{GridPlan, OFF_MAP};
