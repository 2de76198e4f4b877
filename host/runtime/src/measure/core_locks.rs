//! The locks by which processes of one user agree who has a core.

use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use rustix::fs::{
    AtFlags, FlockOperation, Mode, OFlags, Timespec, Timestamps, UTIME_NOW, fstat, futimens,
    openat, statat,
};
use serde::Serialize;

use crate::user_folder;

/// The wait for another process that is choosing, which takes it milliseconds. Only one that
/// was stopped in the middle takes longer.
const PATIENCE: Duration = Duration::from_secs(10);

/// A lock that a process holds until it drops it or ends.
#[derive(Debug)]
pub(super) struct Lock(OwnedFd);

impl Drop for Lock {
    fn drop(&mut self) {
        // Closing is not enough when a process that is just being started has a copy
        // of the descriptor for a moment.
        let _ = rustix::fs::flock(&self.0, FlockOperation::Unlock);
    }
}

/// The folder of the locks, which only this user can write to.
#[derive(Debug)]
pub(super) struct Folder {
    pub(super) path: PathBuf,
    handle: OwnedFd,
}

impl From<user_folder::Folder> for Folder {
    fn from(user_folder::Folder { path, handle }: user_folder::Folder) -> Self {
        Self { path, handle }
    }
}

/// The reason why no cores are reserved. A trial can run without, and should say so.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, thiserror::Error)]
#[serde(tag = "reason", rename_all = "kebab-case")]
pub enum NoCores {
    /// There are not enough.
    #[error("{}", too_few(*.needed, *.free, *.reserved))]
    TooFew {
        /// Cores that the trial needs, the host's not counted.
        needed: u32,
        /// Cores that it could have had.
        free: u32,
        /// Cores that other trials and hosts hold.
        reserved: u32,
    },
    /// The kernel does not say which CPUs share a core.
    #[error("this machine does not tell which CPUs share a physical core")]
    UnknownTopology,
    /// The folder for the locks cannot be used.
    #[error("cannot reserve cores in {}: {detail}", .folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// The system's reason.
        detail: String,
    },
}

fn too_few(needed: u32, free: u32, reserved: u32) -> String {
    let cores = if needed == 1 { "core" } else { "cores" };
    let are = |count| if count == 1 { "is" } else { "are" };
    let others = match reserved {
        0 => String::new(),
        _ => format!(" and {reserved} {} reserved by others", are(reserved)),
    };
    let are = are(free);
    format!("needs {needed} physical {cores} beside the host's, {free} {are} free{others}")
}

impl NoCores {
    /// A way out for the user.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::TooFew { reserved: 0, .. } => {
                Some("ask for fewer threads, or use a machine with more cores")
            }
            Self::TooFew { .. } => Some("wait until other trials on this machine have ended"),
            Self::UnknownTopology => None,
            Self::Folder { .. } => {
                Some("set XDG_RUNTIME_DIR to a folder that only you may write to")
            }
        }
    }
}

impl From<user_folder::NoFolder> for NoCores {
    fn from(user_folder::NoFolder { folder, detail, .. }: user_folder::NoFolder) -> Self {
        Self::Folder { folder, detail }
    }
}

impl Folder {
    pub(super) fn open() -> Result<Self, NoCores> {
        user_folder::folder("cores")
            .map(Self::from)
            .map_err(NoCores::from)
    }

    fn failed(&self, error: &(impl ToString + ?Sized)) -> NoCores {
        NoCores::Folder {
            folder: self.path.clone(),
            detail: error.to_string(),
        }
    }

    /// Locks a file, alone or with others; absent when somebody else holds it.
    pub(super) fn try_lock(&self, name: &str, alone: bool) -> Result<Option<Lock>, NoCores> {
        let flags = OFlags::CREATE | OFlags::RDWR | OFlags::CLOEXEC | OFlags::NOFOLLOW;
        let operation = if alone {
            FlockOperation::NonBlockingLockExclusive
        } else {
            FlockOperation::NonBlockingLockShared
        };
        loop {
            let file = openat(&self.handle, name, flags, Mode::RUSR | Mode::WUSR)
                .map_err(|error| self.failed(&error))?;
            match rustix::fs::flock(&file, operation) {
                Ok(()) => {}
                Err(rustix::io::Errno::WOULDBLOCK) => return Ok(None),
                Err(rustix::io::Errno::INTR) => continue,
                Err(error) => return Err(self.failed(&error)),
            }
            // What cleans `/tmp` must see that the file is in use; and if it was
            // quicker than we, others will lock another file.
            let now = Timespec {
                tv_sec: 0,
                tv_nsec: UTIME_NOW,
            };
            let _ = futimens(
                &file,
                &Timestamps {
                    last_access: now,
                    last_modification: now,
                },
            );
            let opened = fstat(&file).map_err(|error| self.failed(&error))?;
            let named = statat(&self.handle, name, AtFlags::SYMLINK_NOFOLLOW);
            if named.is_ok_and(|named| named.st_ino == opened.st_ino) {
                return Ok(Some(Lock(file)));
            }
        }
    }

    /// Locks a file alone as soon as nobody else has it.
    pub(super) fn wait_for(&self, name: &str) -> Result<Lock, NoCores> {
        let started = Instant::now();
        loop {
            if let Some(lock) = self.try_lock(name, true)? {
                return Ok(lock);
            }
            if started.elapsed() > PATIENCE {
                return Err(self.failed("another process has been choosing for too long"));
            }
            std::thread::sleep(Duration::from_micros(200));
        }
    }
}
