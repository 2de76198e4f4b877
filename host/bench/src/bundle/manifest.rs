//! The manifest of a bundle, one JSON file.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use fleetyard_core::json::read_object;
use fleetyard_core::{InputError, is_unseen, shown};
use fleetyard_runtime::CodeFile;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// Name and version of the format.
pub const FORMAT: &str = "fleetyard.bundle/1";

/// The name of the manifest in the bundle's folder.
pub(super) const MANIFEST: &str = "manifest.json";

/// The most bytes that all files of a bundle have.
const TOTAL_LIMIT: u64 = 1 << 40;

/// A name of a file has at most so many bytes, its folders included: a tar of 1988 has no room for
/// more, and no other way of writing names is read.
const NAME_LIMIT: usize = 255;

/// Files that are programs are there; nothing else may be executed.
const PLUGINS: &str = "plugins/";

/// Origin and content of a bundle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, expecting = "a manifest: a JSON object")]
pub struct Manifest {
    pub(super) format: String,
    /// Version of the program that wrote the store.
    pub fleetyard: String,
    /// Version and commit of the program that wrote the bundle.
    pub bundled_by: Builder,
    /// Name of the suite, and of the folder.
    pub suite: String,
    /// Digest of all that the suite asks, its instances and planners included.
    pub suite_digest: String,
    /// Time at which the store was made.
    pub created_unix_ms: u64,
    /// Trials of the store that the suite asks for.
    pub trials: u64,
    /// The machines on which they were made, by digest.
    pub machines: BTreeMap<String, Value>,
    /// The planners of its trials.
    pub planners: Vec<BundledPlanner>,
    /// Plugins of a fleet beside its planners, as they were when the bundle was written.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub modules: Vec<BundledModule>,
    /// Plans that the store has kept.
    pub plans: BundledPlans,
    /// Files and folders beyond the bundle that planners may read.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub reads: Vec<PathBuf>,
    /// Files of plugins that are not in the bundle.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub left_out: Vec<PathBuf>,
    /// Every file but this one, by name.
    pub files: Vec<BundledFile>,
}

/// A build of this program.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Builder {
    /// Its version.
    pub version: String,
    /// The commit that it was built from, where the build said so.
    pub commit: Option<String>,
}

/// A planner of the suite.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BundledPlanner {
    /// Its name in the suite.
    pub label: String,
    /// Identifier of the plugin.
    pub id: String,
    /// Version of the plugin.
    pub version: String,
    /// The attachment.
    pub attach: String,
    /// Its options as a JSON object.
    pub options: Value,
    /// True if it is a part of the program.
    pub built_in: bool,
    /// Digest of its code; of the program, for built-ins.
    pub digest: Option<String>,
    /// Its files with their SHA-256, by their names where the trials were made.
    pub code: Vec<CodeFile>,
    /// Its file in the bundle's folder, which has to be put there where `bundled` is false.
    pub file: Option<String>,
    /// True if its files are in the bundle.
    pub bundled: bool,
}

/// A plugin of a fleet beside its planner.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BundledModule {
    /// Its file in the bundle's folder, which has to be put there where `bundled` is false.
    pub file: String,
    /// True if its files are in the bundle.
    pub bundled: bool,
    /// Its files with their SHA-256.
    pub code: Vec<CodeFile>,
}

/// The number of plans.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BundledPlans {
    /// Plans that are in the bundle; equal ones are one.
    pub kept: u64,
    /// Plans of trials that the store has not kept: they come out of repeating.
    pub not_kept: u64,
}

/// A file of the bundle.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BundledFile {
    /// Its name from the bundle's folder.
    pub path: String,
    /// Its size.
    pub bytes: u64,
    /// The SHA-256 of its content, in hexadecimal digits as `sha256sum` prints it.
    pub sha256: String,
    /// True if it may be executed.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub executable: bool,
}

impl Manifest {
    /// Of nothing yet.
    pub(super) fn empty() -> Self {
        Self {
            format: FORMAT.to_owned(),
            fleetyard: String::new(),
            bundled_by: Builder {
                version: env!("CARGO_PKG_VERSION").to_owned(),
                commit: option_env!("FLEETYARD_COMMIT").map(str::to_owned),
            },
            suite: String::new(),
            suite_digest: String::new(),
            created_unix_ms: 0,
            trials: 0,
            machines: BTreeMap::new(),
            planners: Vec::new(),
            modules: Vec::new(),
            plans: BundledPlans::default(),
            reads: Vec::new(),
            left_out: Vec::new(),
            files: Vec::new(),
        }
    }

    /// As it is in the bundle.
    pub(super) fn text(&self) -> Vec<u8> {
        // Every key of it is a text.
        let mut text = serde_json::to_vec_pretty(self).unwrap_or_default();
        text.push(b'\n');
        text
    }

    /// Reads one, named `source` in errors. Names stay below the bundle's folder, and are there
    /// once.
    pub(super) fn read(source: &str, text: &[u8]) -> Result<Self, InputError> {
        let hint = "the manifest of a bundle is what `fleetyard store bundle` writes";
        let manifest: Self = read_object(source, text, hint).map_err(|mut error| {
            error.hint.get_or_insert_with(|| hint.into());
            error
        })?;
        let fault = |reason: String| Err(InputError::new(source, reason).hint(hint));
        if manifest.format != FORMAT {
            let found = shown(&manifest.format);
            return fault(format!("format is \"{found}\", expected \"{FORMAT}\""));
        }
        let fits = |letter: char| letter.is_ascii_alphanumeric() || "._-".contains(letter);
        let name = &manifest.suite;
        if name.is_empty()
            || name.len() > 100
            || name.starts_with(['.', '-'])
            || !name.chars().all(fits)
        {
            let name = shown(name);
            return fault(format!("\"{name}\" cannot be the name of a suite"));
        }
        match fault_of(&manifest.files) {
            Some(reason) => fault(reason),
            None => Ok(manifest),
        }
    }

    /// The bytes of all files together.
    pub fn bytes(&self) -> u64 {
        self.files.iter().map(|file| file.bytes).sum()
    }
}

/// The reason why a name is refused; `None` for one that stays below its folder.
pub(super) fn name_fault(name: &str) -> Option<&'static str> {
    if name.is_empty() {
        return Some("has no name");
    }
    if name.len() > NAME_LIMIT {
        return Some("has a name of more than 255 bytes");
    }
    if name.contains(is_unseen) {
        return Some("has a name with a character that cannot be seen");
    }
    if name.starts_with('/') {
        return Some("has a name that begins at the root");
    }
    let mut parts = name.split('/');
    if parts.any(|part| matches!(part, "" | "." | "..")) {
        return Some("has a name with `.`, `..` or nothing between slashes");
    }
    None
}

/// The reason why a list of files is refused, if it is.
pub(super) fn fault_of(files: &[BundledFile]) -> Option<String> {
    let mut names = BTreeSet::from([MANIFEST]);
    let mut total: u64 = 0;
    for file in files {
        let place = format!("`{}`", shown(&file.path));
        if let Some(what) = name_fault(&file.path) {
            return Some(format!("{place} {what}"));
        }
        if !names.insert(&file.path) {
            return Some(format!("{place} is there twice"));
        }
        total = total.saturating_add(file.bytes);
        if total > TOTAL_LIMIT {
            let most = TOTAL_LIMIT >> 30;
            return Some(format!(
                "{place} and those before have more than {most} GiB"
            ));
        }
        if file.executable && !file.path.starts_with(PLUGINS) {
            return Some(format!("{place} is no plugin, and may be executed"));
        }
        if file.sha256.len() != 64 || !file.sha256.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Some(format!("{place} has no SHA-256"));
        }
    }
    // A file is no folder.
    let parents = |name: &&str| {
        let ends = name.match_indices('/').map(|(at, _)| at);
        ends.collect::<Vec<_>>()
    };
    for name in &names {
        for end in parents(name) {
            if names.contains(&name[..end]) {
                return Some(format!("`{}` is a file and a folder", shown(&name[..end])));
            }
        }
    }
    None
}
