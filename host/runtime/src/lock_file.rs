//! The lock file: which code of plugins may run.
//!
//! A lock lists files with the SHA-256 of all that is their code. It is consulted before
//! anything of a plugin is executed, its descriptors included, and once more when the
//! plugin has started: code that is not what was pinned gives no result. A file is known
//! by its path, since what plugins it has is known only to who runs it.

use std::collections::{BTreeMap, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};

use fleetyard_abi::{Descriptor, Kind};
use fleetyard_core::{InputError, read_file, write_atomically};
use serde::{Deserialize, Serialize};

use crate::Fault;
use crate::code::CodeFile;
use crate::confinement::sandbox::Hidden;
use crate::plugin_file::PluginFile;

/// The name of a lock file in the folder where it applies.
pub const LOCK_FILE: &str = "fleetyard.lock";

/// The version of its format.
const VERSION: u32 = 1;

/// Largest lock file that is read, in bytes.
const LIMIT: u64 = 1 << 24;

/// A plugin of a pinned file, as it described itself when it was pinned.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PinnedPlugin {
    /// Its kind.
    pub kind: Kind,
    /// Its identifier.
    pub id: String,
    /// Its version.
    pub version: String,
}

/// A file that is pinned.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pinned {
    /// Path of the file: relative to the lock's folder if it is inside.
    pub path: PathBuf,
    /// The plugins that it has.
    pub plugins: Vec<PinnedPlugin>,
    /// All that is its code, the file itself first.
    pub code: Vec<CodeFile>,
}

/// A lock file.
#[derive(Debug, Clone)]
pub struct Lock {
    file: PathBuf,
    /// The folder of the file, absolute.
    folder: PathBuf,
    pinned: Vec<Pinned>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Document {
    lock: u32,
    pinned: Vec<Pinned>,
}

impl Lock {
    /// An empty lock that will be written to `file`.
    pub fn new(file: &Path) -> Self {
        let absolute = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
        let folder = absolute.parent().unwrap_or(Path::new("/")).to_owned();
        Self {
            file: file.to_owned(),
            folder,
            pinned: Vec::new(),
        }
    }

    /// Reads a lock file.
    pub fn read(file: &Path) -> Result<Self, InputError> {
        Self::parse(&read_file(file, LIMIT)?, file)
    }

    /// Reads the content of a lock file.
    pub fn parse(content: &[u8], file: &Path) -> Result<Self, InputError> {
        let source = file.display().to_string();
        let document: Document = serde_json::from_slice(content).map_err(|error| {
            let text = error.to_string();
            let reason = text
                .rsplit_once(" at line ")
                .map_or(&*text, |(reason, _)| reason);
            // The reader counts bytes, and from 0 when a line has just ended.
            let line = content
                .split(|byte| *byte == b'\n')
                .nth(error.line().saturating_sub(1));
            let line = line.unwrap_or_default();
            let before = &line[..error.column().saturating_sub(1).min(line.len())];
            let column = String::from_utf8_lossy(before).chars().count() as u64 + 1;
            InputError::new(source.as_str(), reason)
                .at(error.line().max(1) as u64, column)
                .hint("`fleetyard plugins pin` writes this file")
        })?;
        if document.lock != VERSION {
            let reason = format!("version {} of lock files is not known here", document.lock);
            return Err(
                InputError::new(source, reason).hint(format!("this host reads version {VERSION}"))
            );
        }
        if let Some(empty) = document.pinned.iter().find(|entry| entry.code.is_empty()) {
            let reason = format!("{} is pinned without any code", empty.path.display());
            return Err(InputError::new(source, reason));
        }
        Ok(Self {
            pinned: document.pinned,
            ..Self::new(file)
        })
    }

    /// Its content, sorted by path.
    pub fn content(&self) -> Result<Vec<u8>, InputError> {
        let mut pinned = self.pinned.clone();
        pinned.sort_by(|a, b| a.path.cmp(&b.path));
        let document = Document {
            lock: VERSION,
            pinned,
        };
        let mut text = serde_json::to_vec_pretty(&document)
            .map_err(|error| InputError::new(self.file.display().to_string(), error.to_string()))?;
        text.push(b'\n');
        Ok(text)
    }

    /// Writes it as a whole or not at all.
    pub fn write(&self) -> Result<(), InputError> {
        write_atomically(&self.file, &self.content()?)
    }

    /// The file that it was read from.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// Every file that is pinned.
    pub fn pinned(&self) -> &[Pinned] {
        &self.pinned
    }

    /// Full path of a path in the lock.
    pub fn locate(&self, path: &Path) -> PathBuf {
        self.folder.join(path)
    }

    fn relative(&self, path: &Path) -> PathBuf {
        path.strip_prefix(&self.folder).unwrap_or(path).to_owned()
    }

    fn index(&self, path: &Path) -> Option<usize> {
        let real = fs::canonicalize(path);
        self.pinned.iter().position(|entry| {
            let known = self.locate(&entry.path);
            known == path || matches!((&real, fs::canonicalize(&known)), (Ok(a), Ok(b)) if *a == b)
        })
    }

    /// The entry of a file.
    pub fn entry(&self, file: &PluginFile) -> Option<&Pinned> {
        self.index(file.path()?).map(|index| &self.pinned[index])
    }

    /// The entry that has a plugin, of one kind or of any.
    pub fn with(&self, kind: Option<Kind>, id: &str) -> Option<&Pinned> {
        let has =
            |plugin: &PinnedPlugin| plugin.id == id && kind.is_none_or(|kind| kind == plugin.kind);
        self.pinned
            .iter()
            .find(|entry| entry.plugins.iter().any(has))
    }

    /// Pins a file, in place of what the lock had for it.
    pub fn pin(&mut self, file: &PluginFile, plugins: &[Descriptor], code: &[CodeFile]) {
        let Some(path) = file.path() else { return };
        let code = code.iter().map(|part| CodeFile {
            path: self.relative(&part.path),
            ..part.clone()
        });
        let mut plugins: Vec<PinnedPlugin> = plugins
            .iter()
            .map(|plugin| PinnedPlugin {
                kind: plugin.kind,
                id: plugin.id.clone(),
                version: plugin.version.clone(),
            })
            .collect();
        plugins.sort();
        let entry = Pinned {
            path: self.relative(path),
            plugins,
            code: code.collect(),
        };
        match self.index(path) {
            Some(index) => self.pinned[index] = entry,
            None => self.pinned.push(entry),
        }
    }

    /// Takes out the entries for which `out` holds; how many there were.
    pub fn remove(&mut self, out: impl Fn(&Pinned) -> bool) -> usize {
        let before = self.pinned.len();
        self.pinned.retain(|entry| !out(entry));
        before - self.pinned.len()
    }

    /// True if a file and all that is its own is what is pinned. The lock is no part of it,
    /// nor is what is `hidden` from plugins, pinned or not.
    pub fn compare(
        &self,
        entry: &Pinned,
        file: &PluginFile,
        hidden: &[PathBuf],
    ) -> Result<(), Fault> {
        let mut entry = entry.clone();
        let concealed = Hidden::new(hidden, &[], &[self.locate(&entry.path)]);
        let folder = fs::canonicalize(&self.folder).unwrap_or_else(|_| self.folder.clone());
        entry
            .code
            .retain(|code| !concealed.has_real(&folder.join(&code.path)));
        let hidden: Vec<PathBuf> = hidden.iter().chain([&self.file]).cloned().collect();
        self.check(&entry, &file.whole(&hidden)?)
    }

    /// Refuses code that is not what is pinned, file by file.
    pub fn check(&self, entry: &Pinned, code: &[CodeFile]) -> Result<(), Fault> {
        let name = self.locate(&entry.path);
        let name = name.display();
        let lock = self.file.display();
        let id = entry.plugins.first().map(|plugin| plugin.id.as_str());
        let changed = |reason: String| {
            let id = id.map_or_else(|| entry.path.display().to_string(), str::to_owned);
            Fault::Refused {
                reason,
                hint: Some(format!(
                    "if you trust the change: `fleetyard plugins pin --update {id}`"
                )),
            }
        };
        // What belongs together moves together: files beside the first are known by where
        // they are from there, others by their order.
        let located = entry.code.iter().map(|code| CodeFile {
            path: self.locate(&code.path),
            ..code.clone()
        });
        let located: Vec<CodeFile> = located.collect();
        let (pinned, pinned_others) = beside_first(&located);
        let (found, found_others) = beside_first(code);
        let mut pairs = Vec::new();
        let mut by_name: BTreeMap<&Path, VecDeque<&CodeFile>> = BTreeMap::new();
        for (name, found) in &found {
            by_name.entry(name).or_default().push_back(found);
        }
        for (name, pinned) in &pinned {
            let found = by_name
                .get_mut(name.as_path())
                .and_then(VecDeque::pop_front);
            pairs.push((Some(*pinned), found));
        }
        pairs.extend(
            by_name
                .into_values()
                .flatten()
                .map(|found| (None, Some(found))),
        );
        let longer = pinned_others.len().max(found_others.len());
        pairs.extend((0..longer).map(|at| {
            let (pinned, found) = (pinned_others.get(at), found_others.get(at));
            (pinned.copied(), found.copied())
        }));
        for pair in pairs {
            let reason = match pair {
                (Some(pinned), None) => {
                    let shown = pinned.path.display();
                    format!("{name} no longer has {shown}, which {lock} pins")
                }
                (None, Some(more)) => {
                    let more = more.path.display();
                    format!("{name} now has {more}, which {lock} does not pin")
                }
                // The same bytes may lie elsewhere: another machine's folders.
                (Some(pinned), Some(found)) if found.sha256 != pinned.sha256 => {
                    let moved = if found.path == pinned.path {
                        String::new()
                    } else {
                        format!(" instead of {}", pinned.path.display())
                    };
                    format!(
                        "{name} is not what {lock} pins: {}{moved} has SHA-256 {}, pinned is {}",
                        found.path.display(),
                        found.sha256,
                        pinned.sha256
                    )
                }
                _ => continue,
            };
            return Err(changed(reason));
        }
        Ok(())
    }
}

/// Files in the folder of the first, by their path there, and all others.
fn beside_first(code: &[CodeFile]) -> (Vec<(PathBuf, &CodeFile)>, Vec<&CodeFile>) {
    let folder = code.first().and_then(|first| first.path.parent());
    let mut beside = Vec::new();
    let mut others = Vec::new();
    for file in code {
        let inside = folder.and_then(|folder| file.path.strip_prefix(folder).ok());
        match inside {
            Some(name) => beside.push((name.to_owned(), file)),
            None => others.push(file),
        }
    }
    (beside, others)
}

/// The standing of a file in the lock.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Standing {
    /// There is no lock, or it does not concern this: the built-ins are the host.
    Free,
    /// Its code is pinned.
    Pinned,
    /// There is a lock, and the file is not in it.
    Unlisted,
}

/// The locks that say which code may be started.
#[derive(Debug, Clone, Default)]
pub struct Trust {
    /// The lock that applies.
    pub lock: Option<Lock>,
    /// True if files that are not in the lock are refused.
    pub locked: bool,
}

impl Trust {
    /// The standing of a file in the lock. Reads nothing of the file.
    pub fn standing(&self, file: &PluginFile) -> Standing {
        match &self.lock {
            Some(_) if *file == PluginFile::BuiltIn => Standing::Free,
            Some(lock) if lock.entry(file).is_some() => Standing::Pinned,
            Some(_) => Standing::Unlisted,
            None => Standing::Free,
        }
    }

    /// Refuses what may not be started, without starting anything. Called once more
    /// after the start, it finds what was put into the place of the file meanwhile.
    /// `hidden` is what no plugin is granted, and so is no part of one.
    pub(crate) fn admit(&self, file: &PluginFile, hidden: &[PathBuf]) -> Result<(), Fault> {
        if *file == PluginFile::BuiltIn {
            return Ok(());
        }
        let entry = self
            .lock
            .as_ref()
            .and_then(|lock| Some((lock, lock.entry(file)?)));
        match entry {
            Some((lock, entry)) => lock.compare(entry, file, hidden),
            None if self.locked => {
                let name = file.path().unwrap_or(Path::new("")).display();
                let reason = match &self.lock {
                    Some(lock) => format!("{name} is not in {}", lock.file.display()),
                    None => format!("{name} is not pinned: there is no {LOCK_FILE}"),
                };
                Err(Fault::Refused {
                    reason,
                    hint: Some(format!(
                        "if you trust it: `fleetyard plugins pin {name}`; without `--locked` it \
                         may run"
                    )),
                })
            }
            None => Ok(()),
        }
    }
}
