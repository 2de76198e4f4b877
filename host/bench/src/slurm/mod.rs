//! Suites on a cluster: a Slurm job array, one task for each shard.
//!
//! A *run* is a folder on a file system that all nodes share:
//!
//! ```text
//! RUN/job.json            what the run is and what was submitted
//! RUN/run.sh              the batch script of every task
//! RUN/suite.toml          the suite as it was submitted
//! RUN/shards/I.sqlite     the store of shard I
//! RUN/shards/I.progress   how many trials it has
//! RUN/shards/I.exit       how its task ended
//! RUN/logs/I-JOB.log      what its task said
//! ```
//!
//! No process has to stay: whatever is known is in the folder or known to Slurm, and every
//! command reads it anew. How a task ended is what it wrote itself; only of tasks that wrote
//! nothing (killed, out of memory, on a node that failed) Slurm is asked, `squeue` first,
//! then `scontrol`, and then `sacct`, which not every site has.

mod client;
mod job;
mod parse;
mod resources;
mod run;
mod script;
mod status;
#[cfg(test)]
mod tests;

use fleetyard_core::InputError;
use thiserror::Error;

pub use client::Slurm;
pub use job::MAX_SHARDS;
pub use resources::Resources;
pub use run::{Request, Run};
pub use status::{Progress, Shard, ShardState, Status};

/// The reason why a request to a cluster failed.
#[derive(Debug, Error)]
pub enum Error {
    /// A file of the run is missing or is not what it must be.
    #[error(transparent)]
    Input(#[from] InputError),
    /// An option is wrong.
    #[error("{reason}")]
    Option {
        /// The reason.
        reason: String,
        /// A way out.
        hint: String,
    },
    /// A command of Slurm is not there.
    #[error("{program} is not there")]
    Missing {
        /// The command.
        program: String,
    },
    /// Slurm does not take the job.
    #[error("{program} refuses the job: {message}")]
    Refused {
        /// The command.
        program: String,
        /// Its message.
        message: String,
    },
    /// A command failed or printed something else than is documented.
    #[error("{program}: {message}")]
    Failed {
        /// The command.
        program: String,
        /// The reason.
        message: String,
    },
    /// Shards that have not completed cannot be merged or submitted.
    #[error("{reason}")]
    State {
        /// The reason.
        reason: String,
        /// A way out.
        hint: String,
    },
}

impl Error {
    fn option(reason: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::Option {
            reason: reason.into(),
            hint: hint.into(),
        }
    }

    fn state(reason: impl Into<String>, hint: impl Into<String>) -> Self {
        Self::State {
            reason: reason.into(),
            hint: hint.into(),
        }
    }

    /// Output that is not as documented.
    fn output(program: &str, line: &str) -> Self {
        Self::Failed {
            program: program.to_owned(),
            message: format!("cannot read `{}`", fleetyard_core::shown(line)),
        }
    }

    /// A way out.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Input(error) => error.hint.clone(),
            Self::Option { hint, .. } | Self::State { hint, .. } => Some(hint.clone()),
            Self::Missing { program } => {
                let name = program.rsplit('/').next().unwrap_or(program);
                let known = ["sbatch", "squeue", "scontrol", "sacct", "scancel"];
                Some(if known.contains(&program.as_str()) {
                    format!(
                        "run this where Slurm's commands are installed, or name the program in FLEETYARD_{}",
                        name.to_uppercase()
                    )
                } else {
                    "check the FLEETYARD_… variables that name Slurm's commands".into()
                })
            }
            Self::Refused { .. } => Some(
                "change the options for the cluster; `sinfo` lists partitions and their limits"
                    .into(),
            ),
            Self::Failed { .. } => Some(
                "is the cluster up? `scontrol ping` says whether its controller answers".into(),
            ),
        }
    }
}
