//! Lifelong operation of a fleet: robots drive what planners plan meanwhile.
//!
//! It follows LSMART (Yan et al., Lifelong Scalable Multi-Agent Realistic Testbed, 2026).
#![forbid(unsafe_code)]

pub mod adg;
pub mod assign;
pub mod batch;
mod config;
mod error;
mod modules;
mod outcome;

pub use config::{Allowance, Assign, Clock, FleetConfig};
pub use error::FleetError;
pub use modules::{Module, ModuleInfo, Modules, Start};
pub use outcome::{
    CallTimes, Ended, EventKind, FleetEvent, FleetExecution, FleetMetrics, FleetOutcome, Point,
};
