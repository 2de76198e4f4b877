//! Folders of the host that only its user can write to.

use std::os::fd::OwnedFd;
use std::path::{Path, PathBuf};

use rustix::fs::{Mode, OFlags, fstat, mkdirat, open, openat};
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
}

/// The first of these that can be had, so that processes with and without a login
/// session agree: `$XDG_RUNTIME_DIR/fleetyard/NAME`, `/run/user/UID/fleetyard/NAME`,
/// `/tmp/fleetyard-UID/NAME`.
pub(crate) fn folder(name: &str) -> Result<Folder, NoFolder> {
    let mut places = places();
    let last = places.pop();
    for (base, ours, private) in places {
        if let Ok(folder) = below(&base, &ours, name, private) {
            return Ok(folder);
        }
    }
    let (base, ours, private) = last.unwrap_or_default();
    below(&base, &ours, name, private)
}

/// Places for folders, best first: the parent, the name below it, and true if the parent must be
/// ours.
pub(crate) fn places() -> Vec<(PathBuf, String, bool)> {
    let user = geteuid().as_raw();
    let runtime = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    let runtime = runtime.filter(|path| path.is_absolute());
    let usual = PathBuf::from(format!("/run/user/{user}"));
    let private = runtime.into_iter().chain([usual]);
    let mut places: Vec<_> = private
        .map(|base| (base, "fleetyard".to_owned(), true))
        .collect();
    places.push(("/tmp".into(), format!("fleetyard-{user}"), false));
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
            Ok(()) | Err(rustix::io::Errno::EXIST) => {}
            Err(error) => return Err(failed(&path, error.to_string())),
        }
        // Without following links: anybody may put one into `/tmp`.
        handle = openat(&handle, name, flags | OFlags::NOFOLLOW, Mode::empty())
            .map_err(|error| failed(&path, error.to_string()))?;
        check_private(&handle).map_err(|detail| failed(&path, detail))?;
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
}
