//! Folders in which plugins are searched.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::plugin_file::{PluginFile, candidates_in};

/// Origin of a plugin.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Origin {
    /// Linked into the host.
    BuiltIn,
    /// A file that the user named.
    Path,
    /// A file in a folder of the plugin path.
    Folder(PathBuf),
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BuiltIn => f.pad("built-in"),
            Self::Path => f.pad("path"),
            Self::Folder(folder) => folder.display().fmt(f),
        }
    }
}

/// The search for plugins.
#[derive(Debug, Clone)]
pub struct Discovery {
    /// Folders, first match first.
    pub folders: Vec<PathBuf>,
    /// The number of those that the user named, which must be there.
    pub named: usize,
}

impl Discovery {
    /// `FLEETYARD_PLUGIN_PATH`, the user's and the system's data folders, and
    /// `plugins` next to the executable.
    pub fn from_environment() -> Self {
        let set = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty());
        let mut folders: Vec<PathBuf> = Vec::new();
        if let Some(path) = set("FLEETYARD_PLUGIN_PATH") {
            let named = std::env::split_paths(&path);
            folders.extend(named.filter(|folder| !folder.as_os_str().is_empty()));
        }
        let named = folders.len();
        let home = set("HOME").map(PathBuf::from);
        let data_home = set("XDG_DATA_HOME")
            .map(PathBuf::from)
            .or(home.map(|home| home.join(".local/share")));
        let data = set("XDG_DATA_DIRS").unwrap_or_else(|| "/usr/local/share:/usr/share".into());
        for folder in data_home.into_iter().chain(std::env::split_paths(&data)) {
            folders.push(folder.join("fleetyard/plugins"));
        }
        if let Ok(executable) = std::env::current_exe() {
            folders.extend(executable.parent().map(|folder| folder.join("plugins")));
        }
        Self { folders, named }
    }

    /// Folders that the user named and that cannot be searched, with the reason.
    pub fn unreadable(&self) -> Vec<(PathBuf, String)> {
        let named = self.folders.iter().take(self.named);
        named
            .filter_map(|folder| Some((folder.clone(), fs::read_dir(folder).err()?.to_string())))
            .collect()
    }

    /// Files in the folders that may be plugins, in order of precedence. A folder that
    /// is named twice counts once.
    pub(crate) fn candidates(&self) -> Vec<(PluginFile, Origin)> {
        let mut found = Vec::new();
        let mut searched: Vec<PathBuf> = Vec::new();
        for folder in &self.folders {
            let Ok(real) = fs::canonicalize(folder) else {
                continue;
            };
            if searched.contains(&real) {
                continue;
            }
            searched.push(real);
            let files = candidates_in(folder).into_iter();
            found.extend(files.map(|file| (file, Origin::Folder(folder.clone()))));
        }
        found
    }

    /// The number of files in the folders that may be plugins.
    pub fn count(&self) -> usize {
        self.candidates().len()
    }
}

/// True if a folder is one where plugins are searched, and has several: then it is no
/// plugin's own, and what else is there is not for each of them.
pub(crate) fn holds_several(folder: &Path) -> bool {
    let searched = Discovery::from_environment().folders;
    let real = fs::canonicalize(folder).ok();
    let is_searched = real.is_some_and(|real| {
        let mut searched = searched
            .iter()
            .filter_map(|other| fs::canonicalize(other).ok());
        searched.any(|other| other == real)
    });
    if !is_searched {
        return false;
    }
    candidates_in(folder).len() > 1
}
