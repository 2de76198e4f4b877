//! Targets: what a supervisor starts.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use crate::confinement::sandbox::Victims;
use crate::plugin_file::PluginFile;

/// The process that the supervisor starts.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Target {
    /// A shared library, in a worker.
    Library(PathBuf),
    /// The plugins that are linked into the host, in a worker.
    BuiltIn,
    /// A program that speaks JSON over standard input and output.
    Program(Vec<String>),
    /// The solver that a manifest describes, started by a worker.
    Adapter(PathBuf),
    /// Nothing: to see which layers a machine grants.
    Nothing,
    /// Attempts at things that a plugin must not get done, by the host itself.
    Attempts(Victims),
}

impl Target {
    /// The plugin's file; of a program that is started by an interpreter, the script.
    pub(crate) fn file(&self) -> Option<PathBuf> {
        match self {
            Self::BuiltIn | Self::Nothing | Self::Attempts(_) => None,
            Self::Library(path) | Self::Adapter(path) => Some(path.clone()),
            Self::Program(argv) => {
                let named = argv.iter().take(2).find(|name| name.starts_with('/'));
                named.map(PathBuf::from)
            }
        }
    }
}

impl From<&PluginFile> for Target {
    fn from(file: &PluginFile) -> Self {
        match file {
            PluginFile::BuiltIn => Self::BuiltIn,
            PluginFile::Library(path) => Self::Library(path.clone()),
            PluginFile::Program(_, argv) => Self::Program(argv.clone()),
            PluginFile::Adapter(path) => Self::Adapter(path.clone()),
        }
    }
}
