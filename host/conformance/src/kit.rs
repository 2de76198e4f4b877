//! The kit: what stays the same from case to case.

use std::time::{Duration, Instant};

use fleetyard_abi::{Kind, c};
use fleetyard_runtime::{Fault, Introduction, Limits, PluginFile, Runtime};
use fleetyard_world::SeededRandom;

use crate::cases::Case;
use crate::report::{CaseReport, Outcome, milliseconds};
use crate::stop::Stop;
use crate::subject::{Config, Subject};
use crate::trial::Trial;

/// Runs cases.
#[derive(Debug)]
pub struct Kit {
    runtime: Runtime,
    config: Config,
}

impl Kit {
    /// For a program that calls `fleetyard_runtime::supervisor::intercept` with the
    /// same entries first of all. Limits are those of all sessions, but for the times
    /// of the configuration.
    pub fn new(
        built_in: &'static [&'static c::PluginEntry],
        config: Config,
        limits: Limits,
    ) -> std::io::Result<Self> {
        let limits = Limits {
            startup: config.startup,
            grace: config.grace,
            ending: config.ending(),
            ..limits
        };
        Ok(Self {
            runtime: Runtime::new(built_in, limits)?,
            config,
        })
    }

    pub(crate) fn runtime(&self) -> &Runtime {
        &self.runtime
    }

    pub(crate) fn config(&self) -> &Config {
        &self.config
    }

    /// The limits of all sessions.
    pub fn limits(&self) -> &Limits {
        self.runtime.limits()
    }

    /// The plugins of a file, described by a process of its own.
    pub fn describe(&self, file: &PluginFile) -> Result<Introduction, Fault> {
        self.runtime.describe(file)
    }

    /// The report about a file that could not even be described. A fault of the host is no report.
    pub fn refused(fault: Fault, seed: u64, taken: Duration) -> Result<CaseReport, Fault> {
        let hint = fault.hint().map(str::to_owned);
        let (outcome, mut reason) = Stop::from(fault).parts()?;
        if let Some(hint) = hint {
            reason = format!("{reason}\n{hint}");
        }
        Ok(CaseReport {
            case: "handshake".into(),
            outcome,
            reason: Some(reason),
            warnings: Vec::new(),
            notes: Vec::new(),
            figures: [].into(),
            seed,
            time_ms: milliseconds(taken),
        })
    }

    /// The seed of one case in a run of many: cases do not depend on which others
    /// are run. Small enough for every reader of JSON.
    pub fn seed_of(case: &Case, kind: Kind, run: u64) -> u64 {
        let mut random = SeededRandom::new(case.name, run);
        let mut of_kind = SeededRandom::new(kind.as_str(), random.below(1 << 48) as u64);
        of_kind.below(1 << 32) as u64
    }

    /// Runs one case. An error is a fault of the host, which says nothing of the plugin.
    pub fn check(&self, subject: &Subject, case: &Case, seed: u64) -> Result<CaseReport, Fault> {
        let started = Instant::now();
        let mut trial = Trial::new(&self.runtime, self.config, subject, seed);
        let ended = trial
            .needs(case.kinds, case.needs)
            .and_then(|()| (case.run)(&mut trial));
        let ended = ended.and_then(|()| trial.end());
        let (outcome, reason) = match ended {
            Ok(()) => (Outcome::Passed, None),
            Err(stop) => {
                let (outcome, reason) = stop.parts()?;
                (outcome, Some(reason))
            }
        };
        let (warnings, notes, figures) = trial.into_findings();
        Ok(CaseReport {
            case: case.name.into(),
            outcome,
            reason,
            warnings,
            notes,
            figures,
            seed,
            time_ms: milliseconds(started.elapsed()),
        })
    }
}
