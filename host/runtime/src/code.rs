//! The code of a plugin's file: which files it is, and what is in them.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::{self, Metadata};
use std::io::{ErrorKind, Read};
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{SystemTime, UNIX_EPOCH};

use fleetyard_core::{Digest, Hasher, open_regular};
use serde::{Deserialize, Serialize};
use sha2::{Digest as _, Sha256};

use crate::confinement::sandbox::{Hidden, aside, own};
use crate::sessions::adapter::Adapter;
use crate::{Fault, PluginFile};

/// A file of a plugin's code, or a place outside of its own folder that it may read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CodeFile {
    /// Its path.
    pub path: PathBuf,
    /// The SHA-256 of its content, in hexadecimal digits as `sha256sum` prints it; of a folder, of the
    /// names and digests of all files in it.
    pub sha256: String,
}

/// All that decides what a plugin does, besides the system's files.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// Stands for all of `code`, wherever it lies; for the built-ins, for this program.
    pub digest: Digest,
    /// The files that are started, the others of the plugin's own folder, and the places outside of it
    /// that the plugin may read; empty for the built-ins.
    pub code: Vec<CodeFile>,
    own: usize,
}

impl Identity {
    /// The part of `code` that is the plugin's own, as [`PluginFile::own_code`] finds it.
    pub fn own(&self) -> &[CodeFile] {
        &self.code[..self.own]
    }
}

/// A state of a file: while it is the same, so is what is in the file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Stamp {
    device: u64,
    inode: u64,
    bytes: u64,
    /// Times of the last change of the content, and of any change: the latter is not for the file's
    /// owner to set.
    times_ns: [i128; 2],
}

impl Stamp {
    fn of(meta: &Metadata) -> Self {
        let ns = |seconds: i64, rest: i64| i128::from(seconds) * 1_000_000_000 + i128::from(rest);
        Self {
            device: meta.dev(),
            inode: meta.ino(),
            bytes: meta.len(),
            times_ns: [
                ns(meta.mtime(), meta.mtime_nsec()),
                ns(meta.ctime(), meta.ctime_nsec()),
            ],
        }
    }

    /// The parts that are the same for a copy that keeps its times: bytes, and time of change.
    fn seen(&self) -> (u64, i128) {
        (self.bytes, self.times_ns[0])
    }

    /// True if the file had rested when it was looked at: within the resolution of its
    /// clock it could be changed once more without a trace.
    fn is_settled(&self, looked: SystemTime) -> bool {
        const RESOLUTION_NS: i128 = 2_000_000_000;
        let looked = looked
            .duration_since(UNIX_EPOCH)
            .map_or(0, |since| since.as_nanos());
        self.times_ns[1] + RESOLUTION_NS < looked as i128
    }
}

impl CodeFile {
    /// Reads the file and takes its digest. Of a link it is the digest of where it leads.
    pub fn read(path: PathBuf) -> Result<Self, Fault> {
        match Self::sha256(&path) {
            Ok(sha256) => Ok(Self { path, sha256 }),
            Err(error) => Err(Fault::file(&path, error)),
        }
    }

    fn sha256(path: &Path) -> std::io::Result<String> {
        static KNOWN: Mutex<BTreeMap<PathBuf, (Stamp, String)>> = Mutex::new(BTreeMap::new());
        let mut file = open_regular(path).map_err(|error| std::io::Error::other(error.reason))?;
        let stamp = Stamp::of(&file.metadata()?);
        let looked = SystemTime::now();
        let known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
        let known_digest = known.get(path).filter(|(known, _)| *known == stamp);
        if let Some((_, digest)) = known_digest {
            return Ok(digest.clone());
        }
        drop(known);
        let mut hasher = Sha256::new();
        let mut buffer = vec![0; 1 << 16];
        loop {
            match file.read(&mut buffer)? {
                0 => break,
                read => hasher.update(&buffer[..read]),
            }
        }
        let digest = hexadecimal(hasher);
        if stamp.is_settled(looked) && Stamp::of(&file.metadata()?) == stamp {
            let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
            known.insert(path.to_owned(), (stamp, digest.clone()));
        }
        Ok(digest)
    }

    /// The digest of a file or of where a link leads.
    fn of_entry(path: PathBuf) -> Result<Self, Fault> {
        let link = path.symlink_metadata().is_ok_and(|meta| meta.is_symlink());
        if link {
            Self::of_link(path)
        } else {
            Self::read(path)
        }
    }

    /// The digest of a place that is not a plugin's own: of the names and contents of its files if somebody
    /// names it, and of the upper levels of an installation, where contents follow from versions, of names
    /// and sizes. A place
    /// of very much has times of change for contents, of its first files. A file that is closed to the
    /// host's user is closed to the plugin, and stands by its name.
    fn of_place(path: PathBuf, is_named: bool, hidden: &[PathBuf]) -> Result<Self, Fault> {
        let meta = fs::metadata(&path).map_err(|error| Fault::file(&path, error))?;
        if !meta.is_dir() {
            return Self::read(path);
        }
        let hidden = Hidden::new(hidden, &[], &[]);
        let real = fs::canonicalize(&path).unwrap_or_else(|_| path.clone());
        let mut walk = Walk::tolerant(Walk::ELSEWHERE_BYTES);
        if !is_named {
            walk.deepest = real.components().count() + Walk::INSTALLED;
        }
        let is_whole = walk.enter(&real, &real, &hidden)?;
        let contents = match (is_named, is_whole) {
            (true, true) => Contents::Read,
            (true, false) => Contents::ByTime,
            (false, _) => Contents::BySize,
        };
        let sha256 = walk.digest(&real, contents);
        Ok(Self { path, sha256 })
    }

    /// The digest of where a link leads, which stands for it.
    fn of_link(path: PathBuf) -> Result<Self, Fault> {
        let target = fs::read_link(&path).map_err(|error| Fault::file(&path, error))?;
        let mut hasher = Sha256::new();
        hasher.update(target.as_os_str().as_bytes());
        let sha256 = hexadecimal(hasher);
        Ok(Self { path, sha256 })
    }
}

fn hexadecimal(hasher: Sha256) -> String {
    let mut text = String::with_capacity(64);
    for byte in hasher.finalize() {
        // Writing to a string cannot fail.
        let _ = write!(text, "{byte:02x}");
    }
    text
}

/// True of a file in which Python keeps what it compiled: it comes and goes with runs by hand.
fn is_cache(path: &Path) -> bool {
    path.iter().any(|part| part == "__pycache__")
}

impl PluginFile {
    /// The identity of a plugin: everything in [`whole`](Self::whole) but what Python compiled, and
    /// every place `elsewhere` that it may read, with true for those that somebody names. It identifies,
    /// and is no defence: a lock is.
    ///
    /// Fails where a file of the plugin's cannot be read.
    pub(crate) fn identity(
        &self,
        hidden: &[PathBuf],
        elsewhere: Vec<(PathBuf, bool)>,
    ) -> Result<Identity, Fault> {
        // This program does not change while it runs, and is large.
        static BUILT_IN: OnceLock<Digest> = OnceLock::new();
        if *self == Self::BuiltIn {
            let digest = if let Some(known) = BUILT_IN.get() {
                *known
            } else {
                let failed = |_: &Path, error| Fault::host("reading this program", error);
                let read = self.started(failed)?.finish();
                *BUILT_IN.get_or_init(|| read)
            };
            return Ok(Identity {
                digest,
                code: Vec::new(),
                own: 0,
            });
        }
        let mut hasher = self.started(Fault::file)?;
        let started = self.code_paths()?.len();
        let code = self.own_code(hidden)?;
        let base = self.path().and_then(Path::parent).unwrap_or(Path::new(""));
        for file in code.iter().skip(started) {
            // The same folder is the same planner wherever it lies.
            let name = file.path.strip_prefix(base).unwrap_or(&file.path);
            hasher.bytes(name.as_os_str().as_bytes());
            hasher.bytes(file.sha256.as_bytes());
        }
        let elsewhere: Vec<CodeFile> = elsewhere
            .into_iter()
            .filter(|(path, _)| !code.iter().any(|file| file.path == *path))
            .map(|(path, is_named)| CodeFile::of_place(path, is_named, hidden))
            .collect::<Result<_, _>>()?;
        for place in &elsewhere {
            hasher.bytes(place.sha256.as_bytes());
        }
        Ok(Identity {
            digest: hasher.finish(),
            own: code.len(),
            code: code.into_iter().chain(elsewhere).collect(),
        })
    }

    /// The part of the identity that is the plugin's own: cheap to look at again. Of a folder with more
    /// than a lock takes there are the files that are started, and one digest of names, sizes and times.
    pub fn own_code(&self, hidden: &[PathBuf]) -> Result<Vec<CodeFile>, Fault> {
        let mut code = self.code()?;
        let needed: Vec<PathBuf> = code.iter().map(|code| code.path.clone()).collect();
        let mut walk = Walk::tolerant(Walk::OWN_BYTES);
        let is_whole = self.walk_own(&mut walk, &needed, hidden)?;
        if !is_whole {
            let path = needed.first().and_then(|file| file.parent());
            let path = path.unwrap_or(Path::new("/")).to_owned();
            let sha256 = walk.digest(&path, Contents::ByTime);
            code.push(CodeFile { path, sha256 });
            return Ok(code);
        }
        for path in walk.files.into_iter().filter(|path| !needed.contains(path)) {
            // One that the host's user cannot read is closed to the plugin, too.
            let closed = |error: std::io::Error| error.kind() == ErrorKind::PermissionDenied;
            if path.is_symlink() || !fs::File::open(&path).is_err_and(closed) {
                code.push(CodeFile::of_entry(path)?);
            }
        }
        Ok(code)
    }

    /// The content of what is started.
    fn started(&self, failed: impl Fn(&Path, String) -> Fault) -> Result<Hasher, Fault> {
        let mut hasher = Hasher::new("fleetyard plugin");
        for path in self.code_paths()? {
            let file = open_regular(&path).map_err(|error| failed(&path, error.reason))?;
            file.metadata()
                .and_then(|meta| hasher.bytes_of(&file, meta.len()))
                .map_err(|error| failed(&path, error.to_string()))?;
        }
        Ok(hasher)
    }

    /// Every file that is started as the plugin, and what is in it: a library, a program or
    /// script, and of a command adapter the manifest and the program. Starts nothing, and
    /// is empty for the built-ins. What these load is in [`whole`](Self::whole).
    pub fn code(&self) -> Result<Vec<CodeFile>, Fault> {
        if *self == Self::BuiltIn {
            return Ok(Vec::new());
        }
        self.code_paths()?.into_iter().map(CodeFile::read).collect()
    }

    /// All that a lock vouches for: the files of [`code`](Self::code), and everything in the
    /// plugin's own folder, which is what it may read besides the system and what the
    /// host's user and its own words grant. Not covered, because not granted, are the
    /// history of its source (`.git`), build folders (those with a `CACHEDIR.TAG`), what is
    /// closed to others beside a file that is not, and `hidden`, the files of the host.
    ///
    /// If a folder has more than this plugin, the plugin has no folder of its own, and the files
    /// stand alone.
    pub fn whole(&self, hidden: &[PathBuf]) -> Result<Vec<CodeFile>, Fault> {
        let mut code = self.code()?;
        let needed: Vec<PathBuf> = code.iter().map(|code| code.path.clone()).collect();
        let mut walk = Walk::strict();
        self.walk_own(&mut walk, &needed, hidden)?;
        for path in walk.files.into_iter().filter(|path| !needed.contains(path)) {
            code.push(CodeFile::of_entry(path)?);
        }
        Ok(code)
    }

    /// Finds what is the plugin's own. False if that is more than the most.
    fn walk_own(
        &self,
        walk: &mut Walk,
        needed: &[PathBuf],
        hidden: &[PathBuf],
    ) -> Result<bool, Fault> {
        let Some(file) = self.path() else {
            return Ok(true);
        };
        let mut places = own(file);
        // The name that the file goes by is that of its neighbours.
        places.sort_by_key(|place| !file.starts_with(place));
        let mut walked = BTreeSet::new();
        let mut is_whole = true;
        for place in places {
            let real = fs::canonicalize(&place).unwrap_or_else(|_| place.clone());
            if walked.insert(real.clone()) {
                let hidden = Hidden::new(hidden, &aside(&place, file), needed);
                is_whole &= walk.enter(&place, &real, &hidden)?;
            }
        }
        Ok(is_whole)
    }

    fn code_paths(&self) -> Result<Vec<PathBuf>, Fault> {
        let path = self.path().unwrap_or(Path::new("/proc/self/exe"));
        let mut paths = vec![path.to_owned()];
        if let Self::Adapter(manifest) = self {
            paths.push(Adapter::open(manifest)?.program().to_owned());
        }
        Ok(paths)
    }
}

/// The files of a folder while they are being found, in order.
struct Walk {
    files: BTreeSet<PathBuf>,
    bytes: u64,
    most_files: usize,
    most_bytes: u64,
    /// True if more than that is a fault, and not a place that is known by less.
    refuses: bool,
    /// Parts of a path at which a folder is known by its name alone.
    deepest: usize,
}

/// The part of a digest of a folder that stands for the content of a file.
#[derive(Clone, Copy, PartialEq)]
enum Contents {
    /// Itself.
    Read,
    /// Its length and the time of its last change.
    ByTime,
    /// Its length.
    BySize,
}

impl Walk {
    const OWN_BYTES: u64 = 8 << 30;
    const ELSEWHERE_BYTES: u64 = 1 << 30;
    /// Levels of an installation: those of `lib/python3.11/site-packages` and of the packages in it, whose
    /// names have their versions.
    const INSTALLED: usize = 4;

    /// With a fault where there is too much.
    fn strict() -> Self {
        Self {
            refuses: true,
            ..Self::tolerant(Self::OWN_BYTES)
        }
    }

    /// With less said of what has more than so many bytes, or too many files, and nothing of what Python
    /// compiled.
    fn tolerant(most_bytes: u64) -> Self {
        Self {
            files: BTreeSet::new(),
            bytes: 0,
            most_files: 50_000,
            most_bytes,
            refuses: false,
            deepest: usize::MAX,
        }
    }

    /// One digest of all files, by their names from `base` on.
    fn digest(&self, base: &Path, contents: Contents) -> String {
        let mut hasher = Sha256::new();
        for file in &self.files {
            let known = if contents == Contents::Read {
                let entry = CodeFile::of_entry(file.clone());
                entry.map_or_else(|_| "closed".into(), |file| file.sha256)
            } else {
                let meta = file.symlink_metadata();
                let meta = meta.ok().filter(|meta| !meta.is_dir());
                let (bytes, time_ns) = meta.map_or((0, 0), |meta| Stamp::of(&meta).seen());
                let time_ns = if contents == Contents::ByTime {
                    time_ns
                } else {
                    0
                };
                format!("{bytes} {time_ns}")
            };
            let name = file.strip_prefix(base).unwrap_or(file).as_os_str();
            for part in [name.as_bytes(), known.as_bytes()] {
                hasher.update((part.len() as u64).to_le_bytes());
                hasher.update(part);
            }
        }
        hexadecimal(hasher)
    }

    /// Takes in what is at `path`, which without links is `real`. False if there is more than the most,
    /// and the rest was left.
    fn enter(&mut self, path: &Path, real: &Path, hidden: &Hidden) -> Result<bool, Fault> {
        let failed = |error| Fault::file(path, error);
        if hidden.has_real(real) || !self.refuses && is_cache(path) {
            return Ok(true);
        }
        let meta = path.symlink_metadata().map_err(failed)?;
        if meta.is_dir() && path.components().count() >= self.deepest {
            self.files.insert(path.to_owned());
            return Ok(true);
        }
        if meta.is_dir() {
            let entries = match fs::read_dir(path) {
                Err(error) if !self.refuses && error.kind() == ErrorKind::PermissionDenied => {
                    return Ok(true);
                }
                entries => entries.map_err(failed)?,
            };
            let names = entries.map(|entry| entry.map(|entry| entry.file_name()));
            let mut names: Vec<_> = names.collect::<Result<_, _>>().map_err(failed)?;
            // Which files are the first ones must not depend on the file system.
            names.sort();
            for name in names {
                let within = self.enter(&path.join(&name), &real.join(&name), hidden)?;
                if !within && self.files.len() > self.most_files {
                    return Ok(false);
                }
            }
            return Ok(self.bytes <= self.most_bytes);
        }
        // A pipe or a device has no content of its own.
        if meta.is_file() || meta.is_symlink() {
            self.files.insert(path.to_owned());
            self.bytes += meta.len();
        }
        let is_within = self.files.len() <= self.most_files && self.bytes <= self.most_bytes;
        if !is_within && self.refuses {
            return Err(Fault::Refused {
                reason: format!(
                    "the folder of the plugin has more than {} files or {} GiB, at {}",
                    self.most_files,
                    self.most_bytes >> 30,
                    path.display()
                ),
                hint: Some(
                    "put it into a folder of its own, with what it needs and nothing more".into(),
                ),
            });
        }
        Ok(is_within)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_too_much_there_is_a_digest_of_what_can_be_seen() {
        let folder = tempfile::tempdir().unwrap();
        let base = fs::canonicalize(folder.path()).unwrap();
        for name in ["b", "a", "d", "c", "__pycache__"] {
            fs::create_dir_all(base.join(name)).unwrap();
            fs::write(base.join(name).join("file"), name).unwrap();
        }
        let hidden = Hidden::new(&[], &[], &[]);
        let walk = |most_files, refuses| {
            let mut walk = Walk {
                most_files,
                refuses,
                ..Walk::tolerant(1 << 20)
            };
            let is_whole = walk.enter(&base, &base, &hidden);
            is_whole.map(|is_whole| (is_whole, walk))
        };
        let (is_whole, all) = walk(4, false).unwrap();
        assert_eq!((is_whole, all.files.len()), (true, 4));
        let (is_whole, first) = walk(2, false).unwrap();
        let names: Vec<_> = first
            .files
            .iter()
            .map(|file| file.strip_prefix(&base))
            .collect();
        assert!(!is_whole);
        assert_eq!(
            names,
            ["a/file", "b/file", "c/file"].map(|name| Ok(Path::new(name)))
        );
        assert!(walk(2, true).is_err_and(|fault| fault.to_string().contains("more than 2 files")));
        // What was compiled is no part but for a lock.
        assert_eq!(walk(5, true).unwrap().1.files.len(), 5);
        let digests = |contents| (walk(9, false).unwrap().1.digest(&base, contents), contents);
        let before = [Contents::Read, Contents::ByTime, Contents::BySize].map(digests);
        std::thread::sleep(std::time::Duration::from_millis(20));
        fs::write(base.join("a/file"), "A").unwrap();
        for (digest, contents) in before {
            let is_same = digests(contents).0 == digest;
            assert_eq!(is_same, contents == Contents::BySize);
        }
    }
}
