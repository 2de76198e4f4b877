//! The kit: what stays the same from case to case.

use std::time::{Duration, Instant};

use fleetyard_abi::{Descriptor, Kind, c};
use fleetyard_runtime::{Attach, Fault, Introduction, Limits, PluginFile, Runtime};
use fleetyard_world::SeededRandom;
use serde_json::{Map, Value};

use crate::cases::Case;
use crate::report::{CaseReport, Outcome};
use crate::trial::{Stop, Trial};

/// Time limits of plugins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Config {
    /// For one call. A planner that claims `anytime` gets a tenth of it, since it
    /// takes all that it gets; so does whoever is asked what cannot be solved.
    pub budget: Duration,
    /// For returning after the deadline.
    pub grace: Duration,
    /// For starting and introducing itself.
    pub startup: Duration,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            budget: Duration::from_secs(5),
            grace: Duration::from_secs(2),
            startup: Duration::from_mins(1),
        }
    }
}

impl Config {
    /// The part of the budget for those who take all of it.
    pub(crate) fn slice(&self) -> Duration {
        (self.budget / 10).max(Duration::from_millis(10))
    }

    /// Time that a plugin may take to end.
    pub(crate) fn ending(&self) -> Duration {
        self.grace.max(Limits::default().ending)
    }
}

/// One plugin, and how it is attached and made.
#[derive(Debug, Clone)]
pub struct Subject {
    /// The file that has it.
    pub file: PluginFile,
    /// The way of attaching it.
    pub attach: Attach,
    /// Its descriptor.
    pub descriptor: Descriptor,
    /// Options that it gets in every case.
    pub options: Map<String, Value>,
}

/// Runs cases.
#[derive(Debug)]
pub struct Kit {
    pub(crate) runtime: Runtime,
    pub(crate) config: Config,
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

    /// The limits of all sessions.
    pub fn limits(&self) -> &Limits {
        self.runtime.limits()
    }

    /// The plugins of a file, described by a process of its own.
    pub fn describe(&self, file: &PluginFile) -> Result<Introduction, Fault> {
        self.runtime.describe(file)
    }

    /// The report about a file that could not even be described.
    pub fn refused(fault: Fault, seed: u64, taken: Duration) -> CaseReport {
        let hint = fault.hint().map(str::to_owned);
        let (outcome, mut reason) = Stop::from(fault).parts();
        if let Some(hint) = hint {
            reason = format!("{reason}\n{hint}");
        }
        CaseReport {
            case: "handshake".into(),
            outcome,
            reason: Some(reason),
            warnings: Vec::new(),
            figures: [].into(),
            seed,
            time_ms: milliseconds(taken),
        }
    }

    /// The seed of one case in a run of many: cases do not depend on which others
    /// are run. Small enough for every reader of JSON.
    pub fn seed_of(case: &Case, kind: Kind, run: u64) -> u64 {
        let mut random = SeededRandom::new(case.name, run);
        let mut of_kind = SeededRandom::new(kind.as_str(), random.below(1 << 48) as u64);
        of_kind.below(1 << 32) as u64
    }

    /// Runs one case.
    pub fn check(&self, subject: &Subject, case: &Case, seed: u64) -> CaseReport {
        let started = Instant::now();
        let mut trial = Trial::new(self, subject, seed);
        let ended = trial.needs(case).and_then(|()| (case.run)(&mut trial));
        let ended = ended.and_then(|()| trial.end());
        let (outcome, reason) = match ended {
            Ok(()) => (Outcome::Passed, None),
            Err(stop) => {
                let (outcome, reason) = stop.parts();
                (outcome, Some(reason))
            }
        };
        let (warnings, figures) = trial.into_notes();
        CaseReport {
            case: case.name.into(),
            outcome,
            reason,
            warnings,
            figures,
            seed,
            time_ms: milliseconds(started.elapsed()),
        }
    }
}

pub(crate) fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1000.0
}
