//! The manifest beside a store: what was run, where, by what, in one JSON file for people and
//! scripts. Reports read the store; nothing reads the manifest back. That of an archive is
//! [`bundle::Manifest`](crate::bundle::Manifest).

use std::path::{Path, PathBuf};

use fleetyard_core::{Digest, InputError, write_atomically};
use fleetyard_runtime::measure::Machine;
use fleetyard_runtime::{Attach, CodeFile, SandboxReport};
use serde::Serialize;
use serde_json::{Map, Value};

use crate::experiment::{Experiment, Pin};
use crate::store::Meta;

/// The record of a store's origin.
#[derive(Debug, Clone, Serialize)]
pub struct Manifest {
    /// Name and version of this format.
    format: &'static str,
    /// Version of this program.
    fleetyard: &'static str,
    /// The commit that it was built from, where the build said so.
    commit: Option<&'static str>,
    /// File name of the store.
    store: String,
    suite: String,
    /// The suite's file as it was.
    suite_text: String,
    /// The suite's values, those of the command line included.
    suite_values: Value,
    /// Digest of all that it asks, instances and planners included.
    suite_digest: String,
    /// The part of it that was run.
    shard: Option<String>,
    /// Time at which the store was made.
    created_unix_ms: u64,
    /// Begin of this run.
    started_unix_ms: u64,
    /// End of this run; absent while it runs, and after it was killed.
    ended_unix_ms: Option<u64>,
    trials: Counts,
    planners: Vec<Planner>,
    #[serde(flatten)]
    pin: Option<Pin>,
    machine_digest: Digest,
    machine: &'static Machine,
}

/// Numbers of trials.
#[derive(Debug, Clone, Copy, Default, Serialize)]
pub struct Counts {
    /// That the suite, or this part of it, asks for.
    pub asked: u64,
    /// Of these, in the store.
    pub stored: u64,
    /// In the store for an earlier state of the suite or of a planner.
    pub superseded: u64,
}

#[derive(Debug, Clone, Serialize)]
struct Planner {
    label: String,
    id: String,
    version: String,
    attach: Attach,
    path: Option<PathBuf>,
    digest: Digest,
    code: Vec<CodeFile>,
    options: Map<String, Value>,
    /// The layers around it, once a process of it has ended.
    sandbox: Option<SandboxReport>,
}

impl Manifest {
    /// Of a run that begins.
    pub fn new(
        experiment: &Experiment<'_>,
        meta: &Meta,
        store: &Path,
        shard: Option<String>,
        started_unix_ms: u64,
    ) -> Self {
        Self {
            format: "fleetyard.manifest/1",
            fleetyard: env!("CARGO_PKG_VERSION"),
            commit: option_env!("FLEETYARD_COMMIT"),
            store: store
                .file_name()
                .unwrap_or(store.as_os_str())
                .to_string_lossy()
                .into_owned(),
            suite: meta.suite.clone(),
            suite_text: meta.suite_text.clone(),
            suite_values: serde_json::from_str(&meta.suite_values).unwrap_or_default(),
            suite_digest: meta.suite_digest.clone(),
            shard,
            created_unix_ms: meta.created_unix_ms,
            started_unix_ms,
            ended_unix_ms: None,
            trials: Counts::default(),
            planners: planners(experiment),
            pin: None,
            machine_digest: Machine::here().digest(),
            machine: Machine::here(),
        }
    }

    /// Adds the facts that are known when the run has ended.
    pub fn end(&mut self, experiment: &Experiment<'_>, ended_unix_ms: u64) {
        self.planners = planners(experiment);
        self.pin = experiment.pin().cloned();
        self.ended_unix_ms = Some(ended_unix_ms);
    }

    /// Says how many trials there are.
    pub fn count(&mut self, trials: Counts) {
        self.trials = trials;
    }

    /// Path of the manifest of a store: `NAME.manifest.json` beside `NAME.sqlite`.
    pub fn path(store: &Path) -> PathBuf {
        store.with_extension("manifest.json")
    }

    /// Writes it beside the store, as a whole or not at all.
    pub fn write(&self, store: &Path) -> Result<(), InputError> {
        let path = Self::path(store);
        let mut text = serde_json::to_vec_pretty(self)
            .map_err(|error| InputError::new(path.display().to_string(), error.to_string()))?;
        text.push(b'\n');
        write_atomically(&path, &text)
    }
}

fn planners(experiment: &Experiment<'_>) -> Vec<Planner> {
    let planners = experiment.planners().iter();
    planners
        .map(|planner| Planner {
            label: planner.label.clone(),
            id: planner.descriptor.id.clone(),
            version: planner.descriptor.version.clone(),
            attach: planner.plugin.attach(),
            path: planner.plugin.path(),
            digest: planner.plugin.digest(),
            code: planner.plugin.code().to_vec(),
            options: planner.options.clone(),
            sandbox: planner.sandbox.clone(),
        })
        .collect()
}
