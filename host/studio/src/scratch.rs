//! The folder in which the studio's jobs work, which goes with the studio.
//!
//! It stands in the user's cache, and nobody else may look into it. A studio has its own locked as
//! long as it lives, whatever ends it; the next one removes those that nobody has locked.

use std::fs::{self, DirBuilder, File};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use fleetyard_core::InputError;
use tempfile::TempDir;

/// The beginning of the names of folders.
const PREFIX: &str = "studio-";

/// A folder of this studio alone, removed with it.
#[derive(Debug)]
pub(crate) struct Scratch {
    folder: TempDir,
    /// Says that the folder is in use.
    _lock: File,
}

impl Scratch {
    /// Makes a folder below `base`, and removes what studios that were killed have left there.
    pub(crate) fn below(base: &Path) -> Result<Self, InputError> {
        Self::make(base).map_err(|error| {
            InputError::new(
                base.display().to_string(),
                format!("jobs cannot be kept here: {error}"),
            )
            .hint("set XDG_CACHE_HOME to a folder of your own that you may write to")
        })
    }

    fn make(base: &Path) -> io::Result<Self> {
        let mut private = DirBuilder::new();
        private.recursive(true).mode(0o700).create(base)?;
        if fs::metadata(base)?.uid() != fleetyard_runtime::user() {
            return Err(io::Error::other("the folder belongs to somebody else"));
        }
        // A folder is locked before another studio can look for those that are not.
        let turn = File::open(base)?;
        turn.lock()?;
        sweep(base)?;
        let folder = tempfile::Builder::new().prefix(PREFIX).tempdir_in(base)?;
        let lock = File::open(folder.path())?;
        lock.lock()?;
        Ok(Self {
            folder,
            _lock: lock,
        })
    }

    /// The folder.
    pub(crate) fn path(&self) -> &Path {
        self.folder.path()
    }
}

/// Removes folders that nobody has locked.
fn sweep(base: &Path) -> io::Result<()> {
    for entry in fs::read_dir(base)? {
        let entry = entry?;
        let is_ours = entry.file_name().to_string_lossy().starts_with(PREFIX);
        // A link is not followed.
        if !is_ours || !entry.file_type()?.is_dir() {
            continue;
        }
        let path = entry.path();
        if File::open(&path).is_ok_and(|folder| folder.try_lock().is_ok()) {
            // What cannot be removed is in nobody's way.
            let _ = fs::remove_dir_all(&path);
        }
    }
    Ok(())
}

/// The place of such folders: in the user's cache, or beside other temporary files.
pub(crate) fn usual_base() -> PathBuf {
    let set = |name: &str| std::env::var_os(name).map(PathBuf::from);
    let cache = set("XDG_CACHE_HOME").filter(|path| path.is_absolute());
    let home = || {
        Some(
            set("HOME")
                .filter(|path| path.is_absolute())?
                .join(".cache"),
        )
    };
    let cache = cache.or_else(home);
    let temporary =
        || std::env::temp_dir().join(format!("fleetyard-{}", fleetyard_runtime::user()));
    cache.map_or_else(temporary, |cache| cache.join("fleetyard"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_killed_studio_left_is_removed_and_what_is_in_use_stays() {
        let base = tempfile::tempdir().unwrap();
        let left = base.path().join("studio-left");
        fs::create_dir(&left).unwrap();
        fs::write(left.join("trace"), "half").unwrap();
        fs::create_dir(base.path().join("of-others")).unwrap();
        std::os::unix::fs::symlink("/", base.path().join("studio-link")).unwrap();
        let first = Scratch::below(base.path()).unwrap();
        let second = Scratch::below(base.path()).unwrap();
        assert!(first.path().exists() && second.path().exists() && !left.exists());
        let (one, other) = (first.path().to_owned(), second.path().to_owned());
        drop(first);
        assert!(!one.exists() && other.exists());
        drop(second);
        let names: Vec<_> = fs::read_dir(base.path())
            .unwrap()
            .map(|entry| entry.unwrap().file_name())
            .collect();
        assert_eq!(names.len(), 2, "{names:?}");
    }
}
