//! The code of a plugin's file: which files it is, and what is in them.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::fs::{self, Metadata};
use std::io::Read;
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

/// A file of a plugin's code.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CodeFile {
    /// Its path.
    pub path: PathBuf,
    /// The SHA-256 of its content, in hexadecimal digits as `sha256sum` prints it.
    pub sha256: String,
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

impl PluginFile {
    /// Stands for the content of the code; of the built-ins, for this program. It
    /// identifies, and is no defence: [`code`](Self::code) is.
    pub fn digest(&self) -> Result<Digest, Fault> {
        // This program does not change while it runs, and is large.
        static BUILT_IN: OnceLock<Digest> = OnceLock::new();
        if *self != Self::BuiltIn {
            return self.read_digest(Fault::file);
        }
        if let Some(known) = BUILT_IN.get() {
            return Ok(*known);
        }
        let read = self.read_digest(|_, error| Fault::host("reading this program", error))?;
        Ok(*BUILT_IN.get_or_init(|| read))
    }

    fn read_digest(&self, failed: impl Fn(&Path, String) -> Fault) -> Result<Digest, Fault> {
        let mut hasher = Hasher::new("fleetyard plugin");
        for path in self.code_paths()? {
            let file = open_regular(&path).map_err(|error| failed(&path, error.reason))?;
            file.metadata()
                .and_then(|meta| hasher.bytes_of(&file, meta.len()))
                .map_err(|error| failed(&path, error.to_string()))?;
        }
        Ok(hasher.finish())
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
        let Some(file) = self.path() else {
            return Ok(code);
        };
        let needed: Vec<PathBuf> = code.iter().map(|code| code.path.clone()).collect();
        let mut places = own(file);
        // The name that the file goes by is that of its neighbours.
        places.sort_by_key(|place| !file.starts_with(place));
        let mut walk = Walk::default();
        let mut walked = BTreeSet::new();
        for place in places {
            let real = fs::canonicalize(&place).unwrap_or_else(|_| place.clone());
            if walked.insert(real.clone()) {
                let hidden = Hidden::new(hidden, &aside(&place, file), &needed);
                walk.enter(&place, &real, &hidden)?;
            }
        }
        for path in walk.files.into_iter().filter(|path| !needed.contains(path)) {
            let link = path.symlink_metadata().is_ok_and(|meta| meta.is_symlink());
            code.push(if link {
                CodeFile::of_link(path)?
            } else {
                CodeFile::read(path)?
            });
        }
        Ok(code)
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

/// The files of a plugin's own folder while they are being found, in order.
#[derive(Default)]
struct Walk {
    files: BTreeSet<PathBuf>,
    bytes: u64,
}

impl Walk {
    /// Most files and bytes that are a plugin's own.
    const MOST_FILES: usize = 50_000;
    const MOST_BYTES: u64 = 8 << 30;

    /// Takes in what is at `path`, which without links is `real`.
    fn enter(&mut self, path: &Path, real: &Path, hidden: &Hidden) -> Result<(), Fault> {
        let failed = |error| Fault::file(path, error);
        if hidden.has_real(real) {
            return Ok(());
        }
        let meta = path.symlink_metadata().map_err(failed)?;
        if meta.is_dir() {
            let mut entries = fs::read_dir(path).map_err(failed)?;
            return entries.try_for_each(|entry| {
                let entry = entry.map_err(failed)?;
                self.enter(&entry.path(), &real.join(entry.file_name()), hidden)
            });
        }
        // A pipe or a device has no content of its own.
        if meta.is_file() || meta.is_symlink() {
            self.files.insert(path.to_owned());
            self.bytes += meta.len();
        }
        if self.files.len() > Self::MOST_FILES || self.bytes > Self::MOST_BYTES {
            return Err(Fault::Refused {
                reason: format!(
                    "the folder of the plugin has more than {} files or {} GiB, at {}",
                    Self::MOST_FILES,
                    Self::MOST_BYTES >> 30,
                    path.display()
                ),
                hint: Some(
                    "pin it in a folder of its own, with what it needs and nothing more".into(),
                ),
            });
        }
        Ok(())
    }
}
