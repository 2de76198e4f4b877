//! Suites of trials: what is run, how it is kept, and what it says.

#![forbid(unsafe_code)]

mod candidate;
pub mod claims;
pub mod evaluate;
pub mod export;
mod options;
mod plan;
mod record;
mod row;
pub mod slurm;
pub mod statistics;
mod store;
pub mod suite;
mod trial;
mod trial_error;

pub use candidate::{Candidate, GivenOptions, Running};
pub use options::{BudgetOptions, Robots, RobotsError, SandboxOptions, half_of_memory};
pub use plan::{Planned, Schedule, Shard, Step};
pub use record::{
    BudgetInfo, CallInfo, Ending, ExecutionInfo, IncumbentInfo, InstanceInfo, Measurement, Metrics,
    PlannerInfo, Record, VerdictInfo, number,
};
pub use row::{COLUMNS, Column, ColumnType, Incumbent, Row, Value};
pub use store::{Asked, Merged, Meta, Store, schema};
pub use trial::{Host, Outcome, Trial, execute, milliseconds};
pub use trial_error::TrialError;
