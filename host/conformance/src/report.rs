//! Results of cases.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};

/// Result of a case.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// The plugin did what the contract says.
    Passed,
    /// It did something else.
    Failed,
    /// Its process ended before it had answered.
    Crashed,
    /// The case asks for what the plugin does not claim, or cannot be asked here.
    Skipped,
}

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Passed => "passed",
            Self::Failed => "failed",
            Self::Crashed => "crashed",
            Self::Skipped => "skipped",
        })
    }
}

/// One case and one plugin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CaseReport {
    /// The case's name.
    pub case: String,
    /// The result.
    pub outcome: Outcome,
    /// The reason, unless it passed.
    pub reason: Option<String>,
    /// Findings that are odd but allowed.
    pub warnings: Vec<String>,
    /// Findings that are as they may be.
    #[serde(default)]
    pub notes: Vec<String>,
    /// Figures measured on the way.
    pub figures: BTreeMap<String, f64>,
    /// Asks the same again.
    pub seed: u64,
    /// Wall time of the case.
    pub time_ms: f64,
}

pub(crate) fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1000.0
}
