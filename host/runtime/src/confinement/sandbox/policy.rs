//! The policy of a sandbox: what a plugin is granted.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::report::Level;

/// Grants to a plugin beyond the least.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Policy {
    /// The answer to refused layers.
    pub level: Level,
    /// Files and folders that the plugin may read, beside its own and the system's.
    pub read: Vec<PathBuf>,
    /// Files that the host itself reads and writes: a store, a suite, scenarios, results. Not
    /// granted, wherever they lie; nor are the host's journals and the parts that are being
    /// written, whose names begin with theirs.
    pub hidden: Vec<PathBuf>,
    /// True if it may use the network.
    pub network: bool,
    /// Devices that it may use, as [`devices`](super::devices()) finds them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub devices: Vec<PathBuf>,
    /// Environment variables beside the fixed ones.
    pub env: Vec<(String, String)>,
    /// Most processes and threads.
    pub processes: u32,
    /// Most bytes in the scratch folder.
    pub disk_bytes: u64,
    /// Most files in the scratch folder.
    pub files: u64,
}

impl Default for Policy {
    fn default() -> Self {
        Self {
            level: Level::default(),
            read: Vec::new(),
            hidden: Vec::new(),
            network: false,
            devices: Vec::new(),
            env: Vec::new(),
            processes: 256,
            disk_bytes: 256 << 20,
            files: 10_000,
        }
    }
}
