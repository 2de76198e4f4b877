//! Suites of trials: what is run, how it is kept, and what it says.

#![forbid(unsafe_code)]

pub mod bundle;
mod calibration;
mod changes;
pub mod claims;
mod correction;
mod error;
mod estimate;
pub mod evaluate;
mod execution;
mod experiment;
pub mod export;
mod failure;
mod fleet;
mod follow;
mod kept;
mod manifest;
mod options;
mod places;
mod plan;
mod plugin;
mod quantity;
mod questions;
mod record;
pub mod report;
mod row;
mod run;
pub mod slurm;
pub mod statistics;
mod store;
pub mod suite;
mod trial;
mod trial_error;
mod trial_instance;
mod verify;

pub use changes::changes;
pub use correction::Correction;
pub use error::BenchError;
pub use estimate::{Estimate, Left, rough};
pub use execution::execute;
pub use experiment::{Experiment, Pin, Planner, now_unix_ms};
pub use fleet::start_modules;
pub use follow::{ClaimedIncumbent, Followed};
pub use manifest::{Counts, Manifest};
pub use options::{BudgetOptions, Robots, RobotsError, SandboxOptions, half_of_memory};
pub use places::{Places, ScenarioPlace, TaskPlace};
pub use plan::{Planned, Schedule, Shard, Step};
pub use plugin::{GivenOptions, Plugin, Running};
pub use questions::Questions;
pub use record::{
    BudgetInfo, CallInfo, Ending, ExecutionInfo, IncumbentInfo, InstanceInfo, Measurement, Metrics,
    PlannerInfo, Record, VerdictInfo, milliseconds, number,
};
pub use row::{COLUMNS, Column, ColumnType, Incumbent, Row, Value};
pub use run::{Progress, Ran, run};
pub use store::{Asked, KeptPlan, Merged, Meta, SharedStore, Store, schema};
pub use trial::{Host, Outcome, Trial};
pub use trial_error::TrialError;
pub use trial_instance::TrialInstance;
pub use verify::{Difference, Verified, What, verify};
