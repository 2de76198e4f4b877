//! The locks by which processes of one user agree who has a core.

use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use rustix::fs::{
    AtFlags, FlockOperation, Mode, OFlags, Timespec, Timestamps, UTIME_NOW, fstat, futimens,
    openat, statat,
};

use super::cores::NoCores;
use crate::confinement::state;

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

impl From<state::Folder> for Folder {
    fn from(state::Folder { path, handle }: state::Folder) -> Self {
        Self { path, handle }
    }
}

impl From<state::NoFolder> for NoCores {
    fn from(state::NoFolder { folder, detail }: state::NoFolder) -> Self {
        Self::Folder { folder, detail }
    }
}

impl Folder {
    pub(super) fn open() -> Result<Self, NoCores> {
        state::folder("cores")
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
