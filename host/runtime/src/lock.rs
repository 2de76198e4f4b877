//! The lock file: which code of plugins may run.
//!
//! A lock lists files with the SHA-256 of all that is their code. It is consulted before
//! anything of a plugin is executed, its descriptors included, and once more when the
//! plugin has started: code that is not what was pinned gives no result. A file is known
//! by its path, since what plugins it has is known only to who runs it.

use std::fs;
use std::path::{Path, PathBuf};

use fleetyard_abi::{Descriptor, Kind};
use fleetyard_core::{InputError, read_file, write_atomically};
use serde::{Deserialize, Serialize};

use crate::Fault;
use crate::plugin_file::{CodeFile, PluginFile};

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
    /// Where it is: relative to the lock's folder if it is inside.
    pub path: PathBuf,
    /// What it has.
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

    /// Where a path of the lock is.
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

    /// Whether code is what is pinned, file by file.
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
        for (index, pinned) in entry.code.iter().enumerate() {
            let known = self.locate(&pinned.path);
            let shown = known.display();
            let Some(found) = code.get(index) else {
                return Err(changed(format!(
                    "{name} no longer has {shown}, which {lock} pins"
                )));
            };
            // The same bytes may lie elsewhere: another machine's folders.
            if found.sha256 != pinned.sha256 {
                let moved = if found.path == known {
                    String::new()
                } else {
                    format!(" instead of {shown}")
                };
                return Err(changed(format!(
                    "{name} is not what {lock} pins: {}{moved} has SHA-256 {}, pinned is {}",
                    found.path.display(),
                    found.sha256,
                    pinned.sha256
                )));
            }
        }
        if let Some(more) = code.get(entry.code.len()) {
            let more = more.path.display();
            return Err(changed(format!(
                "{name} now has {more}, which {lock} does not pin"
            )));
        }
        Ok(())
    }
}

/// What a file is to the lock.
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

/// Whose code may be started.
#[derive(Debug, Clone, Default)]
pub struct Trust {
    /// The lock that applies.
    pub lock: Option<Lock>,
    /// Whether files that are not in the lock are refused.
    pub locked: bool,
}

impl Trust {
    /// What a file is to the lock. Reads nothing of it.
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
    pub(crate) fn admit(&self, file: &PluginFile) -> Result<(), Fault> {
        if *file == PluginFile::BuiltIn {
            return Ok(());
        }
        let entry = self
            .lock
            .as_ref()
            .and_then(|lock| Some((lock, lock.entry(file)?)));
        match entry {
            Some((lock, entry)) => lock.check(entry, &file.code()?),
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
