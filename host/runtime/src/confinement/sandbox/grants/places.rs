//! Folders and files: those that belong together, and those that others may read.

use std::fs::{self, Metadata};
use std::io::Read;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use fleetyard_core::{SQLITE_MAGIC, STORE_MARK, open_regular};

use crate::folders::holds_several;

/// A path, and what it leads to if it is a link or below one.
pub(super) fn with_target(path: &Path) -> Vec<PathBuf> {
    let mut paths = vec![path.to_owned()];
    paths.extend(fs::canonicalize(path).ok().filter(|real| real != path));
    paths
}

/// Places that belong to a file and stand beside it: the folder that it is in, of an installed
/// program the folders beside its `bin`, of one in a virtual environment the environment.
/// The file alone where its folder holds more than one plugin's files.
pub(crate) fn own(file: &Path) -> Vec<PathBuf> {
    let mut found: Vec<PathBuf> = Vec::new();
    for path in with_target(file) {
        let folder = path.parent().filter(|folder| {
            !is_too_wide(folder) && !is_build_folder(folder) && !holds_several(folder)
        });
        let Some(folder) = folder else {
            found.push(path);
            continue;
        };
        let above = folder
            .parent()
            .filter(|above| folder.ends_with("bin") && !is_too_wide(above));
        match above {
            Some(above) if is_file(&above.join(ENVIRONMENT)) => found.push(above.to_owned()),
            _ => {
                found.push(folder.to_owned());
                let beside = ["lib", "lib64", "libexec", "share"];
                let beside = above
                    .into_iter()
                    .flat_map(|above| beside.map(|name| above.join(name)));
                found.extend(beside.filter(|folder| folder.is_dir()));
            }
        }
    }
    found.sort();
    found.dedup();
    let all = found.clone();
    found.retain(|path| {
        !all.iter()
            .any(|other| path != other && path.starts_with(other))
    });
    found
}

/// Entries of a plugin's own folder that are not the plugin's: the history of its source, what
/// tools build there, stores and suites, and what is closed to others if its file is not.
pub(crate) fn aside(own: &Path, file: &Path) -> Vec<PathBuf> {
    const HISTORY: [&str; 3] = [".git", ".hg", ".svn"];
    let closed = fs::metadata(file).is_ok_and(|meta| !is_open(&meta));
    let kept = with_target(file);
    let entries = fs::read_dir(own).into_iter().flatten().flatten();
    let aside = entries.filter(|entry| {
        let path = entry.path();
        if kept.iter().any(|kept| kept.starts_with(&path)) {
            return false;
        }
        let history = HISTORY.iter().any(|name| entry.file_name() == *name);
        history
            || is_of_the_host(&path)
            || is_build_folder_itself(&path)
            || !closed
                && entry
                    .metadata()
                    .is_ok_and(|meta| !meta.is_symlink() && !is_open(&meta))
    });
    aside.map(|entry| entry.path()).collect()
}

/// True if a file is this program's own by its content, a store with what stands beside it or a suite:
/// trials change it, and what a planner does must not depend on them.
fn is_of_the_host(path: &Path) -> bool {
    let text = path.to_string_lossy();
    let beside = ["-wal", "-shm", "-journal"];
    let store = if let Some(name) = text.strip_suffix(".manifest.json") {
        format!("{name}.sqlite")
    } else {
        let store = beside.iter().find_map(|end| text.strip_suffix(end));
        store.unwrap_or(&text).to_owned()
    };
    is_store(Path::new(&store)) || is_suite(path)
}

fn is_store(path: &Path) -> bool {
    let begin = start_of(path, 72);
    begin.starts_with(SQLITE_MAGIC) && begin.ends_with(&STORE_MARK)
}

fn is_suite(path: &Path) -> bool {
    let is_toml = path
        .extension()
        .is_some_and(|extension| extension == "toml");
    let text = || start_of(path, 1 << 16);
    is_toml
        && text()
            .split(|byte| *byte == b'\n')
            .any(|line| line.starts_with(b"[[planner]]"))
}

/// The first bytes of a file; none of one that cannot be read.
fn start_of(path: &Path, bytes: u64) -> Vec<u8> {
    let mut start = Vec::new();
    let read = open_regular(path).map(|file| file.take(bytes).read_to_end(&mut start));
    if matches!(read, Ok(Ok(_))) {
        start
    } else {
        Vec::new()
    }
}

/// True if a folder is, or is in, one that a tool marked as its cache, as cargo does with
/// `target`: what is built there for others may be large and is nobody's plugin.
fn is_build_folder(folder: &Path) -> bool {
    folder.ancestors().any(is_build_folder_itself)
}

fn is_build_folder_itself(folder: &Path) -> bool {
    // Virtual environments are marked so too.
    is_file(&folder.join("CACHEDIR.TAG")) && !is_file(&folder.join(ENVIRONMENT))
}

/// The file that makes a folder a virtual environment.
pub(super) const ENVIRONMENT: &str = "pyvenv.cfg";

pub(super) fn is_file(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|meta| meta.is_file())
}

pub(super) fn is_executable(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|meta| meta.is_file() && meta.mode() & 0o111 != 0)
}

/// True if others than its owner may read a file, or read and enter a folder.
pub(super) fn is_open(meta: &Metadata) -> bool {
    let needed = if meta.is_dir() { 0o005 } else { 0o004 };
    meta.mode() & needed == needed
}

/// True if others may come from a folder to a path and read it: whoever closed a folder on
/// the way closed what is in it. Folders above both are not on the way.
pub(super) fn is_open_from(folder: &Path, path: &Path) -> bool {
    let mut above = path
        .ancestors()
        .skip(1)
        .take_while(|part| !folder.starts_with(part));
    fs::metadata(path).is_ok_and(|meta| is_open(&meta))
        && above.all(|part| fs::metadata(part).is_ok_and(|meta| meta.mode() & 0o001 != 0))
}

/// Most files of a declared folder that are looked at.
pub(super) const LOOKED_AT: usize = 20_000;

/// Paths below a path that are closed to others; `None` where there is too much to look at.
pub(super) fn closed_below(path: &Path, most: usize) -> Option<Vec<PathBuf>> {
    let mut closed = Vec::new();
    let mut folders = vec![path.to_owned()];
    let mut seen = 0;
    while let Some(folder) = folders.pop() {
        // The path itself may be a file, which has no entries.
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            seen += 1;
            if seen > most {
                return None;
            }
            let Ok(meta) = entry.metadata() else { continue };
            if meta.is_symlink() {
                continue;
            }
            if !is_open(&meta) {
                closed.push(entry.path());
            } else if meta.is_dir() {
                folders.push(entry.path());
            }
        }
    }
    Some(closed)
}

/// The home of the host's user.
pub(super) fn home() -> Option<PathBuf> {
    let home = std::env::var_os("HOME").filter(|home| !home.is_empty());
    home.map(PathBuf::from).filter(|home| home.is_absolute())
}

/// Folders that hold other people's files, or all of a person's.
pub(super) fn is_too_wide(folder: &Path) -> bool {
    const SHARED: [&str; 29] = [
        "/",
        "/home",
        "/root",
        "/tmp",
        "/var",
        "/var/tmp",
        "/etc",
        "/dev",
        "/proc",
        "/run",
        "/srv",
        "/mnt",
        "/media",
        "/sys",
        "/bin",
        "/sbin",
        "/lib",
        "/lib64",
        "/opt",
        "/usr",
        "/usr/bin",
        "/usr/sbin",
        "/usr/lib",
        "/usr/share",
        "/usr/local",
        "/usr/local/bin",
        "/usr/local/sbin",
        "/usr/local/lib",
        "/usr/local/share",
    ];
    let of_a_home = home().is_some_and(|home| {
        home.starts_with(folder) || home.join(".local") == folder || home.join(".config") == folder
    });
    of_a_home
        || folder.parent() == Some(Path::new("/home"))
        || SHARED.iter().any(|shared| Path::new(shared) == folder)
}
