//! The file `job.json`: everything that is needed to go on with a run from another
//! process on another day.

use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use fleetyard_core::{InputError, json, read_file, write_atomically};
use fleetyard_runtime::CodeFile;
use serde::{Deserialize, Serialize};

use super::Resources;
use super::parse::Submitted;

const LIMIT: u64 = 1 << 28;

/// Most shards of a run; sites allow fewer (`MaxArraySize`).
pub const MAX_SHARDS: u32 = 1_000_000;

#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(super) enum Format {
    #[serde(rename = "fleetyard.job/1")]
    V1,
}

/// The record of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Job {
    pub(super) format: Format,
    /// The name of the job, by which lines of Slurm's commands are known to be about it.
    pub(super) name: String,
    /// The suite file with its digest.
    pub(super) suite: CodeFile,
    /// The executable with its digest.
    pub(super) executable: CodeFile,
    /// The current folder of the submission, which is that of the tasks.
    pub(super) folder: PathBuf,
    /// More arguments of `fleetyard bench`.
    pub(super) arguments: Vec<String>,
    /// Path of the store into which those of the shards are merged.
    pub(super) store: PathBuf,
    /// Trials of each shard, from the first.
    pub(super) trials: Vec<u64>,
    /// Resources of a task.
    pub(super) resources: Resources,
    /// Submissions, in order.
    pub(super) submissions: Vec<Submission>,
}

/// A job array that was accepted.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Submission {
    /// The identifier of the array.
    pub(super) job: u32,
    /// The cluster, where a site has several.
    pub(super) cluster: Option<String>,
    /// Its shards, which are the indices of its tasks, in order.
    pub(super) shards: Vec<u32>,
    /// Time of the submission, in milliseconds since 1970.
    pub(super) submitted_unix_ms: u64,
    /// The options that `sbatch` was given.
    pub(super) options: Vec<String>,
}

impl Submission {
    pub(super) fn identity(&self) -> Submitted {
        Submitted {
            job: self.job,
            cluster: self.cluster.clone(),
        }
    }
}

impl Job {
    pub(super) fn load(path: &Path) -> Result<Self, InputError> {
        let source = path.display().to_string();
        let bytes = read_file(path, LIMIT)?;
        let hint = "`fleetyard bench … --executor slurm` writes it into a run's folder";
        let job: Self = json::read_object(&source, &bytes, hint)?;
        // Everything else indexes by shard.
        let count = job.trials.len();
        let shards = job.submissions.iter().flat_map(|of| &of.shards);
        if count == 0 || count > MAX_SHARDS as usize {
            return Err(InputError::new(source, format!("{count} shards")).hint(hint));
        }
        if let Some(shard) = shards
            .into_iter()
            .find(|shard| !(1..=count).contains(&(**shard as usize)))
        {
            return Err(
                InputError::new(source, format!("there is no shard {shard} of {count}")).hint(hint),
            );
        }
        Ok(job)
    }

    pub(super) fn save(&self, path: &Path) -> Result<(), InputError> {
        let text = serde_json::to_string_pretty(self)
            .map_err(|error| InputError::new(path.display().to_string(), error.to_string()))?;
        write_atomically(path, format!("{text}\n").as_bytes())
    }

    /// The numbers of all shards.
    pub(super) fn shards(&self) -> RangeInclusive<u32> {
        1..=self.trials.len() as u32
    }

    /// The submission that a shard was last part of, if any was.
    pub(super) fn latest(&self, shard: u32) -> Option<&Submission> {
        let mut latest_first = self.submissions.iter().rev();
        latest_first.find(|submission| submission.shards.contains(&shard))
    }
}
