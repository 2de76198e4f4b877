//! Lifelong operation of a fleet: robots drive what planners plan meanwhile.
//!
//! It follows LSMART (Yan et al., Lifelong Scalable Multi-Agent Realistic Testbed, 2026).
#![forbid(unsafe_code)]

pub mod adg;
mod answers;
pub mod assign;
pub mod batch;
mod call;
mod closures;
mod config;
mod course;
mod error;
pub mod guide;
mod intervention;
mod memory;
mod modules;
mod outcome;
mod recording;
mod run;
mod series;
pub mod steps;
pub mod timed;

pub use closures::{Closure, ClosureRate};
pub use config::{Allowance, Assign, Clock, CutBy, FleetConfig, Rules};
pub use error::FleetError;
pub use fleetyard_sim::trace::By;
pub use intervention::{Intervened, Intervention};
pub use memory::{PERIOD_S, TIME_CONSTANT_S, memory_of};
pub use modules::{Module, ModuleInfo, Modules, Start};
pub use outcome::{
    CallTimes, Decay, Ended, EventKind, FleetEvent, FleetExecution, FleetMetrics, FleetOutcome,
    Late, Point, StepMetrics, differ,
};
pub use recording::{End, Header, KeptBytes, Notice, RECORDING_FORMAT, Recorder, Recording, Round};
pub use run::{Ground, Watch, replay, resume, run, step_s};
