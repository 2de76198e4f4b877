//! What has to outlive a host: which runs there are, so that the next host can end
//! what a killed one left, and where their scratch folders are.

use std::fs;
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt};
use std::path::{Path, PathBuf};

use rustix::process::{Pid, Signal, geteuid, kill_process};
use serde::{Deserialize, Serialize};

use crate::tree::started_ticks;

/// The variable that all processes of a run have.
pub(crate) const RUN: &str = "FLEETYARD_RUN";

/// A folder of this user alone, made when it is not there: below the folder that the
/// system empties when the user leaves, or below `/tmp`.
pub(crate) fn folder(name: &str) -> io::Result<PathBuf> {
    let base = std::env::var_os("XDG_RUNTIME_DIR")
        .map(PathBuf::from)
        .filter(|folder| folder.is_absolute() && owned(folder).is_ok())
        .map_or_else(
            || PathBuf::from(format!("/tmp/fleetyard-{}", geteuid().as_raw())),
            |folder| folder.join("fleetyard"),
        );
    let folder = base.join(name);
    for folder in [&base, &folder] {
        // Others may pass through it, which a sandbox of another user has to do.
        match fs::DirBuilder::new().mode(0o711).create(folder) {
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(error),
            _ => owned(folder)?,
        }
    }
    Ok(folder)
}

/// Somebody else's folder, or a link, under our name would be a trap.
fn owned(folder: &Path) -> io::Result<()> {
    let meta = fs::symlink_metadata(folder)?;
    if meta.is_dir() && meta.uid() == geteuid().as_raw() && meta.mode() & 0o022 == 0 {
        return Ok(());
    }
    let reason = format!("{} is not a folder of this user alone", folder.display());
    Err(io::Error::new(io::ErrorKind::PermissionDenied, reason))
}

/// A process that cannot be mistaken for a later one of the same number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
struct Identity {
    pid: i32,
    started_ticks: u64,
}

impl Identity {
    fn of(pid: i32) -> Option<Self> {
        let started_ticks = started_ticks(pid)?;
        Some(Self { pid, started_ticks })
    }

    fn is_alive(self) -> bool {
        started_ticks(self.pid) == Some(self.started_ticks)
    }
}

/// What is written down about a run.
#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    host: Identity,
    supervisor: Identity,
    scratch: Option<PathBuf>,
    cgroup: Option<PathBuf>,
}

/// A run that is written down; the note is removed with the value.
pub(crate) struct Registered {
    note: PathBuf,
}

impl Registered {
    /// Called by a supervisor. Where nothing can be written, nothing is: the
    /// supervisor ends everybody by itself, unless it is killed too.
    pub(crate) fn write(run: &str, scratch: Option<&Path>, cgroup: Option<&Path>) -> Option<Self> {
        let entry = Entry {
            host: Identity::of(std::os::unix::process::parent_id() as i32)?,
            supervisor: Identity::of(std::process::id() as i32)?,
            scratch: scratch.map(Path::to_owned),
            cgroup: cgroup.map(Path::to_owned),
        };
        let note = folder("runs").ok()?.join(format!("{run}.json"));
        fs::write(&note, serde_json::to_vec(&entry).ok()?).ok()?;
        Some(Self { note })
    }
}

impl Drop for Registered {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.note);
    }
}

/// Ends what hosts that were killed have left, and says how many runs that were.
pub(crate) fn reap_orphans() -> usize {
    let Ok(runs) = folder("runs") else { return 0 };
    let mut reaped = 0;
    for note in fs::read_dir(runs).into_iter().flatten().flatten() {
        let path = note.path();
        let entry = fs::read(&path)
            .ok()
            .and_then(|text| serde_json::from_slice::<Entry>(&text).ok());
        let Some(entry) = entry else {
            // Half-written by somebody who was killed, or being written right now:
            // only the former is old.
            let old = note
                .metadata()
                .and_then(|meta| meta.modified())
                .is_ok_and(|at| at.elapsed().is_ok_and(|age| age.as_secs() > 60));
            if old {
                let _ = fs::remove_file(&path);
            }
            continue;
        };
        if entry.host.is_alive() {
            continue;
        }
        // A supervisor ends by itself when its host is gone; one that does not is
        // ended, and takes its sandbox along.
        if entry.supervisor.is_alive()
            && let Some(pid) = Pid::from_raw(entry.supervisor.pid)
        {
            let _ = kill_process(pid, Signal::KILL);
        }
        if let Some(group) = &entry.cgroup {
            let _ = fs::write(group.join("cgroup.kill"), "1");
        }
        if let Some(run) = path.file_stem().and_then(|name| name.to_str()) {
            kill_marked(run);
        }
        if let Some(scratch) = &entry.scratch {
            let _ = fs::remove_dir_all(scratch);
        }
        if let Some(group) = &entry.cgroup {
            let _ = fs::remove_dir(group);
        }
        let _ = fs::remove_file(&path);
        reaped += 1;
    }
    reaped
}

/// Kills every process whose environment says that it belongs to a run.
fn kill_marked(run: &str) {
    let mark = format!("{RUN}={run}");
    // Whoever was about to make another process is found in the next round.
    for _ in 0..100 {
        let mut found = false;
        for entry in fs::read_dir("/proc").into_iter().flatten().flatten() {
            let pid = entry
                .file_name()
                .to_str()
                .and_then(|name| name.parse().ok());
            let Some(pid) = pid.and_then(Pid::from_raw) else {
                continue;
            };
            let Ok(environment) = fs::read(entry.path().join("environ")) else {
                continue;
            };
            if environment
                .split(|byte| *byte == 0)
                .any(|variable| variable == mark.as_bytes())
            {
                found = true;
                let _ = kill_process(pid, Signal::KILL);
            }
        }
        if !found {
            return;
        }
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_link_is_no_folder_of_ours() {
        let base = tempfile::tempdir().unwrap();
        let link = base.path().join("link");
        std::os::unix::fs::symlink(base.path(), &link).unwrap();
        assert!(owned(base.path()).is_ok());
        assert!(owned(&link).is_err());
        assert!(owned(Path::new("/tmp")).is_err());
    }

    #[test]
    fn identities_tell_processes_apart() {
        let me = Identity::of(std::process::id() as i32).unwrap();
        assert!(me.is_alive());
        let other = Identity {
            started_ticks: me.started_ticks + 1,
            ..me
        };
        assert!(!other.is_alive());
    }
}
