//! Removes a folder that a stranger has filled.
//!
//! Modes that keep even the owner out, names of any bytes, folders that stand deeper in each
//! other than a path can be long: nothing of it is in the way. No link is followed and no
//! other file system is entered. Folders are emptied from above, and what they have in them
//! comes up to the first one, so that three descriptors are enough for any depth.

use std::ffi::{CStr, CString};
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::os::unix::ffi::OsStrExt;
use std::path::Path;

use rustix::fs::{
    AtFlags, Dir, IFlags, Mode, OFlags, ResolveFlags, chmod, fstat, ioctl_getflags, ioctl_setflags,
    open, openat, openat2, renameat, unlinkat,
};
use rustix::io::Errno;

/// Most rounds in which a folder is looked through again; in each one level comes up.
const ROUNDS: usize = 1 << 17;

/// Most names that are taken at once.
const NAMES: usize = 1 << 14;

/// Removes a folder with all that is in it, as far as it can be.
pub(crate) fn remove_tree(folder: &Path) -> Result<(), Errno> {
    let (Some(above), Some(name)) = (folder.parent(), folder.file_name()) else {
        return Err(Errno::INVAL);
    };
    let name = CString::new(name.as_bytes()).map_err(|_| Errno::INVAL)?;
    let flags = OFlags::PATH | OFlags::DIRECTORY | OFlags::CLOEXEC;
    let above = open(above, flags, Mode::empty())?;
    if remove(above.as_fd(), &name).is_ok() {
        return Ok(());
    }
    let top = enter(above.as_fd(), &name)?;
    empty(&top)?;
    remove(above.as_fd(), &name)
}

/// Empties a folder.
fn empty(top: &OwnedFd) -> Result<(), Errno> {
    let mut numbers = 0..u64::MAX;
    let mut why = Errno::BUSY;
    for _ in 0..ROUNDS {
        let names = names(top)?;
        if names.is_empty() {
            return Ok(());
        }
        let mut less = false;
        for name in &names {
            match remove(top.as_fd(), name) {
                Ok(()) => less = true,
                Err(_) => match lift(top, name, &mut numbers) {
                    Ok(lifted) => less |= lifted || remove(top.as_fd(), name).is_ok(),
                    Err(error) => why = error,
                },
            }
        }
        if !less {
            return Err(why);
        }
    }
    Err(why)
}

/// Removes what is in a folder of `top`, or moves it up into `top`; whether there was
/// anything.
fn lift(
    top: &OwnedFd,
    name: &CStr,
    numbers: &mut impl Iterator<Item = u64>,
) -> Result<bool, Errno> {
    let folder = enter(top.as_fd(), name)?;
    let mut lifted = false;
    for inner in names(&folder)? {
        if remove(folder.as_fd(), &inner).is_ok() {
            lifted = true;
            continue;
        }
        // Whoever moves a folder writes to it.
        drop(enter(folder.as_fd(), &inner)?);
        // Names that are taken are those of others: the next one is free at some time.
        let moved = numbers.by_ref().take(NAMES).find_map(|number| {
            let free = CString::new(format!(".fleetyard-{number}")).ok()?;
            let flags = rustix::fs::RenameFlags::NOREPLACE;
            match rustix::fs::renameat_with(&folder, &*inner, top, &*free, flags) {
                Err(Errno::EXIST) => None,
                Err(Errno::INVAL | Errno::NOSYS) => Some(renameat(&folder, &*inner, top, &*free)),
                other => Some(other),
            }
        });
        moved.unwrap_or(Err(Errno::EXIST))?;
        lifted = true;
    }
    Ok(lifted)
}

/// Removes a file, a link or an empty folder.
fn remove(folder: BorrowedFd<'_>, name: &CStr) -> Result<(), Errno> {
    let once = || match unlinkat(folder, name, AtFlags::empty()) {
        Ok(()) | Err(Errno::NOENT) => Ok(()),
        Err(Errno::ISDIR | Errno::PERM) => unlinkat(folder, name, AtFlags::REMOVEDIR),
        Err(error) => Err(error),
    };
    match once() {
        // It may not be changed, or its folder may not.
        Err(Errno::PERM | Errno::ACCESS | Errno::NOTDIR) => {
            let flags = OFlags::RDONLY | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
            for of in [c".", name] {
                if let Ok(file) = openat(folder, of, flags, Mode::empty()) {
                    make_changeable(&file);
                }
            }
            once()
        }
        done => done,
    }
}

/// Opens a folder that stands in another one, whatever its mode was.
fn enter(above: BorrowedFd<'_>, name: &CStr) -> Result<OwnedFd, Errno> {
    let flags = OFlags::PATH | OFlags::DIRECTORY | OFlags::NOFOLLOW | OFlags::CLOEXEC;
    let only_here = ResolveFlags::NO_XDEV | ResolveFlags::NO_SYMLINKS | ResolveFlags::BENEATH;
    let folder = match openat2(above, name, flags, Mode::empty(), only_here) {
        Err(Errno::NOSYS | Errno::PERM) => {
            let folder = openat(above, name, flags, Mode::empty())?;
            if fstat(&folder)?.st_dev != fstat(above)?.st_dev {
                return Err(Errno::XDEV);
            }
            folder
        }
        opened => opened?,
    };
    if Mode::from_raw_mode(fstat(&folder)?.st_mode) & Mode::RWXU != Mode::RWXU {
        // By its descriptor: what has its name now may be a link.
        let path = format!("/proc/self/fd/{}", folder.as_raw_fd());
        // Where it cannot be changed, the reason shows at what is done next.
        let _ = chmod(path, Mode::RWXU);
    }
    let flags = OFlags::RDONLY | OFlags::DIRECTORY | OFlags::CLOEXEC;
    let open = openat(&folder, c".", flags, Mode::empty())?;
    make_changeable(&open);
    Ok(open)
}

fn make_changeable(file: &OwnedFd) {
    let fixed = IFlags::IMMUTABLE | IFlags::APPEND;
    if let Ok(flags) = ioctl_getflags(file)
        && flags.intersects(fixed)
    {
        // Who may not do this finds out at what it was for.
        let _ = ioctl_setflags(file, flags - fixed);
    }
}

/// Some of the names in a folder.
fn names(folder: &OwnedFd) -> Result<Vec<CString>, Errno> {
    let mut names = Vec::new();
    for entry in Dir::read_from(folder)? {
        let name = entry?.file_name().to_owned();
        if ![c".", c".."].contains(&name.as_c_str()) {
            names.push(name);
        }
        if names.len() == NAMES {
            break;
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::os::unix::ffi::OsStrExt;
    use std::os::unix::fs::{PermissionsExt, symlink};

    use rustix::fs::mkdirat;

    use super::*;

    fn close_to_all(path: &Path) {
        fs::set_permissions(path, fs::Permissions::from_mode(0o0)).unwrap();
    }

    #[test]
    fn folders_that_let_nobody_in_are_removed() {
        let base = tempfile::tempdir().unwrap();
        let top = base.path().join("scratch");
        let inner = top.join("a/b/c");
        fs::create_dir_all(&inner).unwrap();
        for folder in [&inner, &top.join("a/b"), &top.join("a")] {
            fs::write(folder.join("file"), "left").unwrap();
            close_to_all(&folder.join("file"));
            close_to_all(folder);
        }
        close_to_all(&top);
        remove_tree(&top).unwrap();
        assert!(!top.exists());
    }

    #[test]
    fn folders_deeper_than_a_path_can_be_long_are_removed() {
        let base = tempfile::tempdir().unwrap();
        let top = base.path().join("scratch");
        fs::create_dir(&top).unwrap();
        let flags = OFlags::RDONLY | OFlags::DIRECTORY;
        let mut at = open(&top, flags, Mode::empty()).unwrap();
        let name = CString::new("d".repeat(100)).unwrap();
        for _ in 0..1500 {
            mkdirat(&at, &*name, Mode::RWXU).unwrap();
            at = openat(&at, &*name, flags, Mode::empty()).unwrap();
        }
        remove_tree(&top).unwrap();
        assert!(!top.exists());
    }

    #[test]
    fn what_links_point_to_stays() {
        let base = tempfile::tempdir().unwrap();
        let kept = base.path().join("kept");
        fs::create_dir(&kept).unwrap();
        fs::write(kept.join("file"), "as it was").unwrap();
        let top = base.path().join("scratch");
        fs::create_dir_all(top.join("inner")).unwrap();
        symlink(&kept, top.join("link")).unwrap();
        symlink(&kept, top.join("inner/link")).unwrap();
        // Names that are no text, and the one that a folder comes up under.
        let odd = std::ffi::OsStr::from_bytes(b"\xff\n\xfe");
        fs::write(top.join(odd), "").unwrap();
        fs::create_dir_all(top.join("inner/deep/deeper")).unwrap();
        fs::write(top.join(".fleetyard-0"), "").unwrap();
        for number in 0..3000 {
            fs::write(top.join(format!("inner/{number}")), "").unwrap();
        }
        remove_tree(&top).unwrap();
        assert!(!top.exists());
        assert_eq!(fs::read_to_string(kept.join("file")).unwrap(), "as it was");
        // A link in the place of the folder is removed as a link.
        symlink(&kept, &top).unwrap();
        remove_tree(&top).unwrap();
        assert!(kept.join("file").exists() && fs::symlink_metadata(&top).is_err());
    }

    #[test]
    fn files_that_may_not_be_changed_are_removed() {
        let base = tempfile::tempdir().unwrap();
        let top = base.path().join("scratch");
        fs::create_dir_all(top.join("inner")).unwrap();
        fs::write(top.join("inner/file"), "left").unwrap();
        for name in ["inner/file", "inner"] {
            let file = open(top.join(name), OFlags::RDONLY, Mode::empty()).unwrap();
            if ioctl_setflags(&file, IFlags::IMMUTABLE).is_err() {
                eprintln!("skipped: this user or this file system has no files that stay");
            }
        }
        remove_tree(&top).unwrap();
        assert!(!top.exists());
    }
}
