//! Folders of the host that only its user can write to.

use std::fs::Permissions;
use std::os::fd::OwnedFd;
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags, fstat, mkdirat, open, openat};
use rustix::io::Errno;
use rustix::process::geteuid;

/// A folder that only this user can write to.
#[derive(Debug)]
pub(crate) struct Folder {
    pub(crate) path: PathBuf,
    pub(crate) handle: OwnedFd,
}

/// The reason why there is no folder.
#[derive(Debug, thiserror::Error)]
#[error("cannot use {}: {detail}", .folder.display())]
pub(crate) struct NoFolder {
    pub(crate) folder: PathBuf,
    pub(crate) detail: String,
    /// It is there, and somebody else's.
    is_others: bool,
}

/// The first of these that can be had, so that processes with and without a login
/// session agree: `$XDG_RUNTIME_DIR/fleetyard/NAME`, `/run/user/UID/fleetyard/NAME`,
/// `/tmp/fleetyard-UID/NAME`, and where somebody else has made that one,
/// `/tmp/fleetyard-UID-XXXXXX/NAME` with a name that nobody can guess.
pub(crate) fn folder(name: &str) -> Result<Folder, NoFolder> {
    let mut failed = None;
    for (base, ours, private) in usual_places() {
        match below(&base, &ours, name, private) {
            Ok(folder) => return Ok(folder),
            Err(error) => failed = Some(error),
        }
    }
    match failed {
        // Another name does not help where a disk is full.
        Some(failed) if !failed.is_others => Err(failed),
        _ => spare(Path::new(TMP), name),
    }
}

/// The folder that everybody may write to.
const TMP: &str = "/tmp";

/// The name of this user's folder there.
fn usual_name() -> String {
    format!("fleetyard-{}", geteuid().as_raw())
}

/// A folder of ours below `base` whose name nobody could take before.
fn spare(base: &Path, name: &str) -> Result<Folder, NoFolder> {
    let mut names = spare_names(base);
    if names.is_empty() {
        let _ = tempfile::Builder::new()
            .prefix(&format!("{}-", usual_name()))
            .permissions(Permissions::from_mode(0o711))
            .tempdir_in(base)
            .map_err(|error| NoFolder {
                folder: base.to_owned(),
                detail: error.to_string(),
                is_others: false,
            })?
            .keep();
        // Of several that were made at a time, everybody takes the first.
        names = spare_names(base);
    }
    let first = names.into_iter().next().unwrap_or_default();
    below(base, &first, name, false)
}

/// Names of the folders that were made so, and are ours.
fn spare_names(base: &Path) -> Vec<String> {
    let prefix = format!("{}-", usual_name());
    let user = geteuid().as_raw();
    let entries = std::fs::read_dir(base).into_iter().flatten().flatten();
    let ours = entries.filter_map(|entry| {
        let name = entry.file_name().into_string().ok()?;
        // The entry itself is looked at, not what a link leads to.
        let meta = name
            .starts_with(&prefix)
            .then(|| entry.metadata().ok())
            .flatten()?;
        (meta.is_dir() && meta.uid() == user).then_some(name)
    });
    let mut names: Vec<String> = ours.collect();
    names.sort_unstable();
    names
}

/// Places for folders, best first: the parent, the name below it, and true if the parent must be
/// ours.
pub(crate) fn places() -> Vec<(PathBuf, String, bool)> {
    let mut places = usual_places();
    let spare = spare_names(Path::new(TMP)).into_iter();
    places.extend(spare.map(|name| (PathBuf::from(TMP), name, false)));
    places
}

/// The places that need no looking for.
fn usual_places() -> Vec<(PathBuf, String, bool)> {
    let user = geteuid().as_raw();
    let runtime = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let runtime = runtime.filter(|path| path.is_absolute());
    let usual = PathBuf::from(format!("/run/user/{user}"));
    let private = runtime.into_iter().chain([usual]);
    let mut places: Vec<_> = private
        .map(|base| (base, "fleetyard".to_owned(), true))
        .collect();
    places.push((TMP.into(), usual_name(), false));
    places
}

/// `BASE/OURS/NAME`, made if need be; `private` when the base must be ours as well.
pub(crate) fn below(
    base: &Path,
    ours: &str,
    name: &str,
    private: bool,
) -> Result<Folder, NoFolder> {
    // Others may pass through, as a sandbox of another user has to.
    const MODE: Mode = Mode::RWXU.union(Mode::XGRP).union(Mode::XOTH);
    let mut path = base.to_owned();
    let failed = |path: &Path, detail: String| NoFolder {
        folder: path.to_owned(),
        detail,
        is_others: false,
    };
    let flags = OFlags::DIRECTORY | OFlags::RDONLY | OFlags::CLOEXEC;
    let mut handle =
        open(base, flags, Mode::empty()).map_err(|error| failed(base, error.to_string()))?;
    if private {
        check_private(&handle).map_err(|detail| failed(base, detail))?;
    }
    for name in [ours, name] {
        path.push(name);
        match mkdirat(&handle, name, MODE) {
            Ok(()) | Err(Errno::EXIST) => {}
            Err(error) => return Err(failed(&path, error.to_string())),
        }
        // Without following links: anybody may put one into `/tmp`.
        handle =
            openat(&handle, name, flags | OFlags::NOFOLLOW, Mode::empty()).map_err(|error| {
                NoFolder {
                    // A file or a link, or closed to us.
                    is_others: matches!(error, Errno::NOTDIR | Errno::LOOP | Errno::ACCESS),
                    ..failed(&path, error.to_string())
                }
            })?;
        check_private(&handle).map_err(|detail| NoFolder {
            is_others: true,
            ..failed(&path, detail)
        })?;
    }
    Ok(Folder { path, handle })
}

/// Nobody but us may put files there.
fn check_private(folder: &OwnedFd) -> Result<(), String> {
    let stat = fstat(folder).map_err(|error| error.to_string())?;
    let user = geteuid().as_raw();
    if stat.st_uid != user {
        return Err(format!("it belongs to user {}, not {user}", stat.st_uid));
    }
    if stat.st_mode & 0o022 != 0 {
        return Err("others may write to it".into());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_is_no_folder_of_ours() {
        let base = tempfile::tempdir().unwrap();
        let made = below(base.path(), "ours", "runs", true).unwrap();
        assert!(made.path.ends_with("ours/runs") && made.path.is_dir());
        std::os::unix::fs::symlink(base.path(), base.path().join("link")).unwrap();
        assert!(below(base.path(), "link", "runs", true).is_err());
        // Anybody may write there.
        assert!(below(Path::new("/tmp"), "ours", "runs", true).is_err());
    }

    /// Whoever made `/tmp/fleetyard-UID` first kept its user from starting any plugin.
    #[test]
    fn a_name_that_somebody_took_is_not_needed() {
        let base = tempfile::tempdir().unwrap();
        std::fs::write(base.path().join(usual_name()), "taken").unwrap();
        let taken = below(base.path(), &usual_name(), "runs", false).unwrap_err();
        assert!(taken.is_others, "{taken}");
        assert_eq!(spare_names(base.path()), Vec::<String>::new());
        let made = spare(base.path(), "runs").unwrap();
        // Links, and what has another name, are not ours.
        let link = base.path().join(format!("{}-!", usual_name()));
        std::os::unix::fs::symlink("/", link).unwrap();
        std::fs::create_dir(base.path().join("fleetyard-x")).unwrap();
        let names = spare_names(base.path());
        assert_eq!(names.len(), 1, "{names:?}");
        assert_eq!(made.path, base.path().join(&names[0]).join("runs"));
        let again = below(base.path(), &names[0], "cores", false).unwrap();
        assert!(again.path.is_dir());
        assert_eq!(spare(base.path(), "runs").unwrap().path, made.path);
    }
}
