//! The tree of files that a plugin sees: a new root in memory, read-only, on which
//! the granted folders are mounted read-only at their own places, with a scratch
//! folder of fixed size at `/tmp`.

use std::collections::BTreeMap;
use std::fs;
use std::os::fd::{AsFd, AsRawFd, BorrowedFd, OwnedFd};
use std::path::{Path, PathBuf};

use rustix::fs::CWD;
use rustix::io::Errno;
use rustix::mount::{
    MountFlags, MountPropagationFlags, MoveMountFlags, OpenTreeFlags, UnmountFlags, mount,
    mount_change, move_mount, open_tree, unmount,
};

use super::devices::DEVICES;
use super::grants::{Grants, SCRATCH};

use super::refusal::as_errno;
use super::{Layer, Refusal};

/// The user that the plugin is inside of a user namespace.
pub(super) const INSIDE_USER: u32 = 1000;

/// Mounts that were taken by the host when it is root, so that files are readable
/// for a user whom they do not belong to; by path.
pub(super) type Trees = BTreeMap<PathBuf, OwnedFd>;

/// Files of `/proc` about the machine that numerical libraries, runtimes and tools go by. The rest
/// of `/proc`, and files that later kernels add, are none of a plugin's business.
pub(super) const OF_MACHINE: &[&str] = &[
    "cpuinfo",
    "meminfo",
    "stat",
    "loadavg",
    "uptime",
    "version",
    "filesystems",
];

/// The same of `/proc/sys`.
pub(super) const OF_KERNEL: &[&str] = &[
    "vm/overcommit_memory",
    "vm/max_map_count",
    "kernel/osrelease",
    "kernel/pid_max",
    "kernel/threads-max",
    "kernel/cap_last_cap",
    "kernel/ngroups_max",
];

/// Files and folders of a `/proc` that are neither a process nor in [`OF_MACHINE`], and
/// whether each is a folder. Links lead to processes.
pub(super) fn not_for_plugins(proc: &str) -> std::io::Result<Vec<(String, bool)>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(proc)? {
        let entry = entry?;
        let kind = entry.file_type()?;
        let Ok(name) = entry.file_name().into_string() else {
            continue;
        };
        let is_process = name.bytes().all(|byte| byte.is_ascii_digit());
        if !is_process && !kind.is_symlink() && !OF_MACHINE.contains(&name.as_str()) {
            found.push((name, kind.is_dir()));
        }
    }
    Ok(found)
}

/// The tree and the way in which it is made.
pub(super) struct Root<'a> {
    pub(super) read: &'a [PathBuf],
    /// Devices beside the usual ones.
    pub(super) devices: &'a [PathBuf],
    pub(super) trees: &'a Trees,
    pub(super) disk_bytes: u64,
    pub(super) files: u64,
    /// True if there is a new namespace of processes to show.
    pub(super) proc: bool,
}

/// A copy of what is mounted at a path, attached nowhere.
fn take(path: &Path) -> Result<OwnedFd, Errno> {
    let flags = OpenTreeFlags::OPEN_TREE_CLONE | OpenTreeFlags::OPEN_TREE_CLOEXEC;
    // A link that somebody put there since the grants were found leads nowhere.
    let flags = flags | OpenTreeFlags::AT_SYMLINK_NOFOLLOW;
    open_tree(CWD, path, flags | OpenTreeFlags::AT_RECURSIVE)
}

/// Changes what may be done through a mount that is attached nowhere, or that a
/// descriptor stands for.
fn set_attributes(
    tree: BorrowedFd<'_>,
    set: u64,
    owner: Option<BorrowedFd<'_>>,
    recursive: bool,
) -> Result<(), Errno> {
    let attributes = libc::mount_attr {
        attr_set: set | owner.map_or(0, |_| libc::MOUNT_ATTR_IDMAP),
        attr_clr: 0,
        propagation: 0,
        userns_fd: owner.map_or(0, |owner| owner.as_raw_fd() as u64),
    };
    let recursive = if recursive { libc::AT_RECURSIVE } else { 0 };
    // SAFETY: the structure outlives the call, and its size is its own.
    let result = unsafe {
        libc::syscall(
            libc::SYS_mount_setattr,
            tree.as_raw_fd(),
            c"".as_ptr(),
            libc::AT_EMPTY_PATH | recursive,
            &raw const attributes,
            size_of::<libc::mount_attr>(),
        )
    };
    if result == 0 {
        Ok(())
    } else {
        Err(Errno::from_io_error(&std::io::Error::last_os_error()).unwrap_or(Errno::IO))
    }
}

const HARMLESS: u64 = libc::MOUNT_ATTR_RDONLY | libc::MOUNT_ATTR_NOSUID;

/// Takes the mounts of the plugin's own paths as root: otherwise a plugin below a folder
/// that only root may enter could not be read by the user that it runs as. What the grants
/// say to be somebody's is shown as files of `user`; of all else that user may read what
/// anybody may. Paths that cannot be taken are left to be taken from inside.
pub(super) fn take_as_root(grants: &Grants, user: u32) -> Trees {
    let mut trees = Trees::new();
    let mut mappings: BTreeMap<u32, Option<OwnedFd>> = BTreeMap::new();
    for path in grants.beyond_the_system() {
        let path = &path;
        let Ok(meta) = fs::symlink_metadata(path) else {
            continue;
        };
        if meta.is_symlink() {
            continue;
        }
        let Ok(tree) = take(path) else { continue };
        let namespace = grants.owners.get(path).and_then(|owner| {
            let made = mappings.entry(*owner);
            made.or_insert_with(|| mapping(*owner, user)).as_ref()
        });
        if let Some(namespace) = namespace {
            // Not every file system can show other owners; whoever may read a file
            // anyway still can.
            let _ = set_attributes(tree.as_fd(), 0, Some(namespace.as_fd()), true);
        }
        trees.insert(path.clone(), tree);
    }
    trees
}

/// A user namespace in which files of `owner` are files of `user`.
fn mapping(owner: u32, user: u32) -> Option<OwnedFd> {
    let (ready, child_waits) = rustix::pipe::pipe_with(rustix::pipe::PipeFlags::CLOEXEC).ok()?;
    // SAFETY: this process has one thread, and the child only reads and ends.
    let child = unsafe {
        libc::syscall(
            libc::SYS_clone,
            libc::CLONE_NEWUSER | libc::SIGCHLD,
            0,
            0,
            0,
            0,
        )
    };
    if child == 0 {
        drop(child_waits);
        let _ = rustix::io::read(&ready, &mut [0_u8; 1][..]);
        // SAFETY: ends this process without running anything of the parent's.
        unsafe { libc::_exit(0) };
    }
    if child < 0 {
        return None;
    }
    let map = |kind: &str| {
        fs::write(
            format!("/proc/{child}/{kind}_map"),
            format!("{owner} {user} 1\n"),
        )
    };
    let namespace = map("uid")
        .and_then(|()| map("gid"))
        .and_then(|()| fs::File::open(format!("/proc/{child}/ns/user")));
    drop(child_waits);
    // SAFETY: waits for the child that was made above.
    unsafe { libc::waitpid(child as i32, std::ptr::null_mut(), 0) };
    namespace.ok().map(OwnedFd::from)
}

impl Root<'_> {
    /// Builds the tree and makes it the root of this process and of the mount
    /// namespace, which must be a new one. Returns what was refused although the
    /// tree stands.
    pub(super) fn enter(&self) -> Result<Vec<Refusal>, Refusal> {
        let refused = |what: &'static str| Refusal::of(Layer::MountNamespace, what);
        mount_change(
            "/",
            MountPropagationFlags::PRIVATE | MountPropagationFlags::REC,
        )
        .map_err(refused("making mounts private"))?;
        // Everything is taken before the new root hides what is below its place.
        let mut trees: Vec<(&Path, OwnedFd)> = Vec::new();
        let mut links: Vec<(&Path, PathBuf)> = Vec::new();
        for path in self.read {
            if let Ok(to) = fs::read_link(path) {
                links.push((path, to));
                continue;
            }
            let tree = match self.trees.get(path) {
                Some(tree) => tree.try_clone().map_err(|_| Errno::MFILE),
                None => take(path),
            };
            match tree {
                Ok(tree) => {
                    // A device that was granted is to be used as one.
                    let nodev = if is_device(path) {
                        0
                    } else {
                        libc::MOUNT_ATTR_NODEV
                    };
                    set_attributes(tree.as_fd(), HARMLESS | nodev, None, true)
                        .map_err(refused("mounting read-only"))?;
                    trees.push((path, tree));
                }
                // Grants are no promise: what this user cannot read stays away.
                Err(Errno::ACCESS | Errno::NOENT) => {}
                Err(errno) => {
                    return Err(refused("taking what is mounted")(errno));
                }
            }
        }
        let mut devices = Vec::new();
        let granted = self.devices.iter().map(PathBuf::as_path);
        for path in DEVICES.iter().map(Path::new).chain(granted) {
            match take(path) {
                Ok(tree) => devices.push((path, tree)),
                Err(Errno::ACCESS | Errno::NOENT) => {}
                Err(errno) => return Err(refused("taking devices")(errno)),
            }
        }
        let base = Path::new(SCRATCH);
        let size = "size=4m,nr_inodes=4k,mode=755";
        memory(base, size).map_err(refused("mounting a root in memory"))?;
        std::env::set_current_dir(base)
            .map_err(|error| refused("entering the new root")(as_errno(&error)))?;
        self.furnish(trees, links, devices)
            .map_err(refused("filling the new root"))?;
        let mut lost = Vec::new();
        if self.proc
            && let Err(refusal) = mount_proc()
        {
            // Part of it is worse than none.
            let _ = unmount("proc", UnmountFlags::DETACH);
            lost.push(refusal);
        }
        let here = take_descriptor(".").map_err(refused("entering the new root"))?;
        set_attributes(here.as_fd(), HARMLESS | libc::MOUNT_ATTR_NODEV, None, false)
            .map_err(refused("making the new root read-only"))?;
        drop(here);
        rustix::process::pivot_root(".", ".").map_err(refused("changing the root"))?;
        unmount(".", UnmountFlags::DETACH).map_err(refused("leaving the old root"))?;
        std::env::set_current_dir(SCRATCH)
            .map_err(|error| refused("entering the scratch folder")(as_errno(&error)))?;
        Ok(lost)
    }

    /// Fills the new root, which is the current folder.
    fn furnish(
        &self,
        trees: Vec<(&Path, OwnedFd)>,
        links: Vec<(&Path, PathBuf)>,
        devices: Vec<(&Path, OwnedFd)>,
    ) -> Result<(), Errno> {
        let io = |result: std::io::Result<()>| result.map_err(|error| as_errno(&error));
        for (at, to) in links {
            let place = below(at);
            io(parents(&place))?;
            io(std::os::unix::fs::symlink(to, place))?;
        }
        io(fs::create_dir_all("etc"))?;
        io(fs::write(
            "etc/passwd",
            format!("planner:x:{INSIDE_USER}:{INSIDE_USER}::{SCRATCH}:/bin/sh\n"),
        ))?;
        io(fs::write(
            "etc/group",
            format!("planner:x:{INSIDE_USER}:\n"),
        ))?;
        // Before the granted paths, some of which may be below it.
        io(fs::create_dir_all("tmp"))?;
        let size = format!(
            "size={},nr_inodes={},mode=1777",
            self.disk_bytes, self.files
        );
        memory(Path::new("tmp"), &size)?;
        for (at, tree) in trees {
            attach(at, &tree)?;
        }
        for (at, tree) in devices {
            attach(at, &tree)?;
        }
        io(fs::create_dir_all(EMPTY))?;
        if !Path::new("var/tmp").exists() {
            io(std::os::unix::fs::symlink(SCRATCH, "var/tmp"))?;
        }
        Ok(())
    }
}

/// Mounts the namespace's own `/proc`, read-only, with the sandbox's processes and what
/// runtimes go by.
///
/// Everything else is covered, by its name in the folder rather than by a list that
/// would have to know every kernel. The option `subset=pid` would leave nothing but
/// processes.
fn mount_proc() -> Result<(), Refusal> {
    let refused = |what: &'static str| Refusal::of(Layer::OwnProc, what);
    let io = |error: std::io::Error| as_errno(&error);
    let covering = refused("covering parts of /proc");
    let flags = MountFlags::NOSUID | MountFlags::NODEV | MountFlags::NOEXEC;
    fs::create_dir("proc")
        .map_err(io)
        .and_then(|()| mount("proc", "proc", "proc", flags | MountFlags::RDONLY, None))
        .map_err(refused("mounting a new /proc"))?;
    let hidden = not_for_plugins("proc").map_err(io).map_err(&covering)?;
    let values: Vec<(&str, Vec<u8>)> = OF_KERNEL
        .iter()
        .filter_map(|name| Some((*name, fs::read(format!("proc/sys/{name}")).ok()?)))
        .collect();
    for (name, is_folder) in hidden {
        let at = format!("proc/{name}");
        let cover = if name == "sys" {
            // Copies: a mount for each would cost more than the few bytes.
            copies(&at, &values)
        } else {
            let cover = if is_folder { EMPTY } else { "/dev/null" };
            take(Path::new(cover)).and_then(|tree| {
                let noexec = libc::MOUNT_ATTR_NOEXEC;
                set_attributes(tree.as_fd(), HARMLESS | noexec, None, false)?;
                move_mount(&tree, "", CWD, &at, MoveMountFlags::MOVE_MOUNT_F_EMPTY_PATH)
            })
        };
        cover.map_err(&covering)?;
    }
    Ok(())
}

/// An empty folder of the new root, below the current folder.
const EMPTY: &str = "var/empty";

/// Files in memory, read-only, in place of a folder.
fn copies(at: &str, files: &[(&str, Vec<u8>)]) -> Result<(), Errno> {
    memory(Path::new(at), "size=64k,nr_inodes=64,mode=755")?;
    for (name, content) in files {
        let place = Path::new(at).join(name);
        parents(&place)
            .and_then(|()| fs::write(&place, content))
            .map_err(|error| as_errno(&error))?;
    }
    let mounted = take_descriptor(at)?;
    set_attributes(
        mounted.as_fd(),
        HARMLESS | libc::MOUNT_ATTR_NODEV,
        None,
        false,
    )
}

/// An absolute path as one below the current folder.
fn below(path: &Path) -> PathBuf {
    path.strip_prefix("/").unwrap_or(path).to_owned()
}

fn parents(place: &Path) -> std::io::Result<()> {
    match place.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => fs::create_dir_all(parent),
        _ => Ok(()),
    }
}

/// Puts a tree at its place below the current folder.
fn attach(at: &Path, tree: &OwnedFd) -> Result<(), Errno> {
    let place = below(at);
    parents(&place).map_err(|error| as_errno(&error))?;
    let stat = rustix::fs::fstat(tree)?;
    let is_folder = rustix::fs::FileType::from_raw_mode(stat.st_mode).is_dir();
    let made = if is_folder {
        fs::create_dir_all(&place)
    } else if place.exists() {
        Ok(())
    } else {
        fs::File::create(&place).map(|_| ())
    };
    made.map_err(|error| as_errno(&error))?;
    move_mount(
        tree,
        "",
        CWD,
        &place,
        MoveMountFlags::MOVE_MOUNT_F_EMPTY_PATH,
    )
}

fn memory(at: &Path, options: &str) -> Result<(), Errno> {
    let options = std::ffi::CString::new(options).map_err(|_| Errno::INVAL)?;
    let flags = MountFlags::NOSUID | MountFlags::NODEV;
    mount("tmpfs", at, "tmpfs", flags, options.as_c_str())
}

fn take_descriptor(path: &str) -> Result<OwnedFd, Errno> {
    let flags = rustix::fs::OFlags::PATH | rustix::fs::OFlags::CLOEXEC;
    rustix::fs::open(path, flags, rustix::fs::Mode::empty())
}

fn is_device(path: &Path) -> bool {
    use std::os::unix::fs::FileTypeExt;
    fs::metadata(path).is_ok_and(|meta| meta.file_type().is_char_device())
}
