//! Reasons why a trial could not be made, as opposed to how it went.

use std::fmt;
use std::path::{Path, PathBuf};

use fleetyard_abi::{Capability, Kind};
use fleetyard_core::InputError;
use fleetyard_fleet::FleetError;
use fleetyard_runtime::{Able, Fault, OptionError, Termination, plural};
use fleetyard_sim::SimError;

use crate::options::RobotsError;

/// In words after a reason: the file that it is about.
fn named(file: Option<&Path>) -> String {
    file.map_or_else(String::new, |file| format!(", by {}", file.display()))
}

/// The reason why a trial could not be made. Faults of a planner once it is asked are a part of its
/// record.
#[derive(Debug, thiserror::Error)]
pub enum TrialError {
    /// Something that was given is wrong.
    #[error(transparent)]
    Input(#[from] InputError),
    /// The planner has no such option, or not with such a value.
    #[error("{}", .0.reason)]
    Options(#[from] OptionError),
    /// The plugin could not be started.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The plan cannot be executed so.
    #[error(transparent)]
    Simulation(#[from] SimError),
    /// There are no such robots.
    #[error(transparent)]
    Robots(#[from] RobotsError),
    /// The fleet could not drive.
    #[error(transparent)]
    Fleet(#[from] FleetError),
    /// A file has several plugins of the kind, and none was named.
    #[error("{file} has several {}: {}", plural(*kind), ids.join(", "))]
    SeveralPlugins {
        /// The file's name.
        file: String,
        /// The kind that is wanted.
        kind: Kind,
        /// Its plugins of the kind.
        ids: Vec<String>,
    },
    /// A file has no plugin of the kind, or not the one that is wanted.
    #[error(
        "{file} has no {}{}",
        kind.as_str().replace('-', " "),
        wanted.as_ref().map_or(String::new(), |id| format!(" `{id}`"))
    )]
    NoPlugin {
        /// The file's name.
        file: String,
        /// The kind that is wanted.
        kind: Kind,
        /// The plugin that is wanted.
        wanted: Option<String>,
        /// Those that it has.
        ids: Vec<String>,
    },
    /// A plugin is no longer what it was when the command began.
    #[error("{name}: its code was changed meanwhile{}", named(file.as_deref()))]
    CodeChanged {
        /// The plugin's name.
        name: String,
        /// A file that is new, gone or another one.
        file: Option<PathBuf>,
    },
    /// A planner does not do what the instance needs.
    #[error("planner `{planner}` {missing}")]
    Incapable {
        /// Identifier of the planner.
        planner: String,
        /// The need that it does not meet.
        missing: Missing,
        /// Planners that do.
        able: Able,
    },
    /// A planner plans on none of the views that are asked for.
    #[error("planner `{planner}` plans on none of the views that are asked for")]
    NoneOfViews {
        /// The planner's label.
        planner: String,
        /// Planners that plan on one of them.
        able: Able,
    },
    /// A view cannot be derived from its task.
    #[error("{}", .0.reason)]
    NoView(InputError),
}

/// Something that an instance needs and a planner does not do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Missing {
    /// It does not claim a capability.
    Capability {
        /// The capability.
        needed: Capability,
        /// True if it claims to plan in straight lines between any cells.
        lines: bool,
    },
    /// It does not list a feature.
    Feature(String),
    /// It plans for fewer agents.
    Agents {
        /// The most that it plans for.
        most: usize,
        /// Those that there are.
        agents: usize,
    },
}

impl fmt::Display for Missing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Capability { needed, .. } => write!(f, "does not support `{}`", needed.as_str()),
            Self::Feature(feature) => {
                write!(
                    f,
                    "does not list the feature `{feature}`, which the task needs"
                )
            }
            Self::Agents { most: 1, agents } => write!(f, "plans for one agent, not for {agents}"),
            Self::Agents { most, agents } => {
                write!(f, "plans for {most} agents at most, not for {agents}")
            }
        }
    }
}

impl TrialError {
    /// The fault of the plugin that did not start.
    pub(crate) fn fault(&self) -> Option<&Fault> {
        match self {
            Self::Fault(fault) | Self::Fleet(FleetError::Start { fault, .. }) => Some(fault),
            _ => None,
        }
    }

    /// The end of the trial, if a plugin is to blame that the trial could not be made.
    pub(crate) fn termination(&self) -> Option<Termination> {
        match self {
            Self::Incapable { .. }
            | Self::NoView(_)
            | Self::Fleet(FleetError::Incapable { .. }) => Some(Termination::Unsupported),
            _ => {
                let fault = self.fault().filter(|fault| !fault.is_of_host())?;
                Some(Termination::from(fault))
            }
        }
    }

    /// A way out.
    pub fn hint(&self) -> Option<String> {
        match self {
            Self::Input(error) | Self::NoView(error) => error.hint.clone(),
            Self::Options(error) => error.hint.clone(),
            Self::Fault(fault) => fault.hint().map(str::to_owned),
            Self::Simulation(error) => error.hint().map(str::to_owned),
            Self::Robots(error) => error.hint().map(str::to_owned),
            Self::Fleet(error) => error.hint().map(str::to_owned),
            Self::SeveralPlugins { .. } => Some("write PATH:ID to choose one of them".to_owned()),
            Self::NoPlugin { ids, .. } if ids.is_empty() => None,
            Self::NoPlugin { ids, .. } => Some(format!("it has {}", ids.join(", "))),
            Self::CodeChanged { .. } => Some(
                "all in a plugin's own folder is its code: keep results elsewhere, and run the command again"
                    .to_owned(),
            ),
            Self::Incapable {
                missing:
                    Missing::Capability {
                        needed: Capability::Pebble,
                        lines: true,
                    },
                able,
                ..
            } => Some(format!(
                "it plans in straight lines, which the path rules `bresenham` and `supercover` \
                 judge; {able}"
            )),
            Self::Incapable { able, .. } | Self::NoneOfViews { able, .. } => Some(able.to_string()),
        }
    }
}
