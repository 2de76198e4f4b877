//! State that outlives a host: the runs that there are, so that the next host can end the leftovers
//! of a killed one, and their scratch folders.

use std::path::{Path, PathBuf};
use std::{fs, io};

use fleetyard_core::Hasher;
use rustix::process::{Resource, Rlimit, getrlimit, setrlimit};
use serde::{Deserialize, Serialize};

use crate::confinement::cgroup::{self, Places};
use crate::confinement::process_tree::{self, started_ticks};
use crate::confinement::remove::remove_tree;
use crate::user_folder::{below, folder, places};

/// The variable that all processes of a run have.
pub(crate) const RUN: &str = "FLEETYARD_RUN";

/// Marks this process, and all that come of it, as those of a run, by a limit that limits
/// nothing: it goes with every `fork` and `exec`, also of a process that has cleared its
/// environment, left its session and closed its descriptors; everybody may read it, and
/// nobody may raise it without rights. Where something lower is set already, there is none.
pub(crate) fn mark(run: &str) {
    if getrlimit(Resource::Rttime).maximum.is_none() {
        let mark = Some(mark_of(run));
        let marked = Rlimit {
            current: mark,
            maximum: mark,
        };
        let _ = setrlimit(Resource::Rttime, marked);
    }
}

/// More microseconds than a machine will run, and no two runs have the same.
fn mark_of(run: &str) -> u64 {
    const BASE: u64 = 1 << 62;
    let mut hasher = Hasher::new("fleetyard.run/1");
    hasher.bytes(run.as_bytes());
    BASE + (hasher.finish().0 as u64 >> 4)
}

/// The mark that a process has, if it has one.
fn mark_on(pid: i32) -> Option<u64> {
    let limits = fs::read_to_string(format!("/proc/{pid}/limits")).ok()?;
    let line = limits
        .lines()
        .find_map(|line| line.strip_prefix("Max realtime timeout"))?;
    // The hard one: a process may set the other as it likes.
    line.split_whitespace().nth(1)?.parse().ok()
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

    fn is_gone(self) -> bool {
        process_tree::is_gone(self.pid, self.started_ticks)
    }
}

/// The note of a run.
#[derive(Debug, Serialize, Deserialize)]
struct Entry {
    host: Identity,
    supervisor: Identity,
    scratch: PathBuf,
    #[serde(default)]
    cgroups: Vec<PathBuf>,
    /// The namespace that the processes' numbers are of: folders may be shared with others.
    #[serde(default)]
    namespace: Option<PathBuf>,
}

/// The namespace of processes that this one is in.
fn namespace() -> Option<PathBuf> {
    fs::read_link("/proc/self/ns/pid").ok()
}

impl Entry {
    /// Reads a note; `None` when only half of it is there.
    fn read(note: &Path) -> io::Result<Option<Self>> {
        Ok(serde_json::from_slice(&fs::read(note)?).ok())
    }

    /// Nobody is left who would end this run: its host is surely gone.
    fn is_orphan(&self) -> bool {
        self.namespace == namespace() && self.host.is_gone()
    }

    /// Nothing of it is left, and nobody who could still make something.
    fn is_over(&self) -> bool {
        self.supervisor.is_gone() && self.is_gone()
    }

    /// True if nothing is left that would have to be removed.
    fn is_gone(&self) -> bool {
        let gone = |path: &PathBuf| {
            let found = path.symlink_metadata();
            found.is_err_and(|error| error.kind() == std::io::ErrorKind::NotFound)
        };
        gone(&self.scratch) && self.cgroups.iter().all(gone)
    }
}

/// A run that is written down; the note is removed with the value, when what it names is gone.
pub(crate) struct Registered {
    note: PathBuf,
    entry: Entry,
}

impl Registered {
    /// Called by a supervisor before it makes any of this: it may be killed between two calls.
    /// Where nothing can be written, nothing is: the supervisor ends everybody by itself,
    /// unless it is killed too.
    pub(crate) fn write(run: &str, scratch: &Path, cgroups: Vec<PathBuf>) -> Option<Self> {
        let entry = Entry {
            host: Identity::of(std::os::unix::process::parent_id() as i32)?,
            supervisor: Identity::of(std::process::id() as i32)?,
            scratch: scratch.to_owned(),
            cgroups,
            namespace: namespace(),
        };
        let note = folder("runs").ok()?.path.join(format!("{run}.json"));
        if fs::write(&note, serde_json::to_vec(&entry).ok()?).is_err() {
            // A note that says nothing would stay.
            let _ = fs::remove_file(&note);
            return None;
        }
        Some(Self { note, entry })
    }
}

impl Drop for Registered {
    fn drop(&mut self) {
        // What could not be removed is left to the next host, which finds it by the note.
        if self.entry.is_gone() {
            let _ = fs::remove_file(&self.note);
        }
    }
}

/// Ends what hosts that were killed have left, and says how many runs that were.
pub(crate) fn reap_orphans() -> usize {
    // Wherever it was written down: a better place may have been refused just then.
    let there = places()
        .into_iter()
        .filter(|(base, ours, _)| base.join(ours).join("runs").is_dir());
    let runs = there.filter_map(|(base, ours, private)| below(&base, &ours, "runs", private).ok());
    let mut reaped = 0;
    let notes = runs.flat_map(|runs| fs::read_dir(runs.path).into_iter().flatten().flatten());
    for note in notes {
        let path = note.path();
        // One that cannot be read now is left to a host that can.
        let Ok(entry) = Entry::read(&path) else {
            continue;
        };
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
        if !entry.is_orphan() {
            continue;
        }
        let run = path.file_stem().and_then(|name| name.to_str());
        end(run, &entry);
        if entry.is_over() {
            let _ = fs::remove_file(&path);
        }
        reaped += 1;
    }
    reaped
}

/// Ends what is left of a run whose supervisor cannot, and removes what it made.
pub(crate) fn end_run(run: &str) {
    let note = folder("runs").map(|runs| runs.path.join(format!("{run}.json")));
    let entry = note.as_ref().ok().map(|note| Entry::read(note));
    let written = entry.and_then(Result::ok);
    if let Some(Some(entry)) = &written {
        end(Some(run), entry);
    } else {
        // It could not write anything down, or what it wrote cannot be read.
        cgroup::remove(&Places::of(run).folders());
        kill_marked(run);
        if let Ok(folder) = folder("scratch") {
            let _ = remove_tree(&folder.path.join(run));
        }
    }
    // A group whose processes are just dying is left to the next host, and so is a note that
    // this one cannot read: it may name groups.
    if let (Ok(note), Some(entry)) = (note, written)
        && entry.as_ref().is_none_or(Entry::is_over)
    {
        let _ = fs::remove_file(note);
    }
}

fn end(run: Option<&str>, entry: &Entry) {
    // A supervisor ends by itself when its host is gone; one that does not is
    // ended, and takes its sandbox along. What it was about to make is there then.
    process_tree::kill_and_wait(entry.supervisor.pid, |_| entry.supervisor.is_alive());
    cgroup::remove(&entry.cgroups);
    if let Some(run) = run {
        kill_marked(run);
    }
    let _ = remove_tree(&entry.scratch);
}

/// Kills every process that says by its environment, or by its limits, that it belongs to
/// a run.
fn kill_marked(run: &str) {
    let (mark, number) = (format!("{RUN}={run}"), mark_of(run));
    let is_marked = |pid: i32| {
        if mark_on(pid) == Some(number) {
            return true;
        }
        let environment = fs::read(format!("/proc/{pid}/environ")).unwrap_or_default();
        let mut variables = environment.split(|byte| *byte == 0);
        variables.any(|variable| variable == mark.as_bytes())
    };
    // Whoever was about to make another process is found in the next round.
    for _ in 0..100 {
        let mut found = false;
        for entry in fs::read_dir("/proc").into_iter().flatten().flatten() {
            let pid = entry
                .file_name()
                .to_str()
                .and_then(|name| name.parse().ok());
            if let Some(pid) = pid.filter(|pid| is_marked(*pid)) {
                found = true;
                process_tree::kill(pid, is_marked);
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
    fn a_run_whose_scratch_folder_could_not_be_removed_stays_written_down() {
        let base = tempfile::tempdir().unwrap();
        let scratch = base.path().join("scratch");
        fs::create_dir(&scratch).unwrap();
        let me = Identity::of(std::process::id() as i32).unwrap();
        let note = base.path().join("run.json");
        let registered = || {
            fs::write(&note, "{}").unwrap();
            Registered {
                note: note.clone(),
                entry: Entry {
                    host: me,
                    supervisor: me,
                    scratch: scratch.clone(),
                    cgroups: Vec::new(),
                    namespace: namespace(),
                },
            }
        };
        drop(registered());
        assert!(note.exists());
        fs::remove_dir(&scratch).unwrap();
        drop(registered());
        assert!(!note.exists());
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
        assert!(other.is_gone() && !me.is_gone());
        let run = |namespace: Option<PathBuf>| Entry {
            host: other,
            supervisor: other,
            scratch: PathBuf::new(),
            cgroups: Vec::new(),
            namespace,
        };
        assert!(run(namespace()).is_orphan());
        // Where numbers mean other processes, nobody here can tell.
        assert!(!run(Some("pid:[1]".into())).is_orphan());
    }
}
