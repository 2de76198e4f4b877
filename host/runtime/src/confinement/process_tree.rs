//! The processes below one process, as `/proc` tells.

use std::collections::{BTreeMap, BTreeSet};
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use std::{fs, io};

use rustix::event::{PollFd, PollFlags, poll};
use rustix::io::Errno;
use rustix::process::{Pid, PidfdFlags, Signal, pidfd_open, pidfd_send_signal};
use rustix::time::Timespec;

/// One process.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Member {
    pub(crate) pid: i32,
    parent: i32,
    zombie: bool,
    /// In user mode and in the kernel, of this process.
    own_ticks: u64,
    /// The same of its children that were waited for.
    reaped_ticks: u64,
    pub(crate) threads: u64,
    pub(crate) started_ticks: u64,
    /// Addresses that are mapped, used or not.
    pub(crate) mapped_bytes: u64,
    pub(crate) resident_pages: u64,
    /// A thread that lives: its files show the memory of the process.
    thread: i32,
}

impl Member {
    fn read(proc: &str, pid: i32) -> Option<Self> {
        let mut member = Self::parse(pid, &fs::read(format!("{proc}/{pid}/stat")).ok()?)?;
        // A process whose first thread has ended looks dead, and without memory.
        if member.zombie && member.threads > 1 {
            let threads = fs::read_dir(format!("{proc}/{pid}/task")).ok()?.flatten();
            let mut threads = threads.filter_map(|thread| {
                let number = thread.file_name().to_str()?.parse().ok()?;
                Self::parse(number, &fs::read(thread.path().join("stat")).ok()?)
            });
            if let Some(living) = threads.find(|thread| !thread.zombie) {
                member = Self {
                    zombie: false,
                    mapped_bytes: living.mapped_bytes,
                    resident_pages: living.resident_pages,
                    thread: living.pid,
                    ..member
                };
            }
        }
        Some(member)
    }

    /// The folder with the files that show its memory.
    pub(crate) fn folder(&self, proc: &str) -> String {
        format!("{proc}/{}/task/{}", self.pid, self.thread)
    }

    fn parse(pid: i32, stat: &[u8]) -> Option<Self> {
        // The name, in parentheses, may contain anything.
        let end = stat.iter().rposition(|byte| *byte == b')')?;
        let fields: Vec<&str> = std::str::from_utf8(&stat[end + 1..])
            .ok()?
            .split_ascii_whitespace()
            .collect();
        // proc(5) counts from 1 and begins with the number and the name.
        let number = |field: usize| fields.get(field - 3)?.parse::<u64>().ok();
        Some(Self {
            pid,
            parent: fields.get(1)?.parse().ok()?,
            zombie: matches!(*fields.first()?, "Z" | "X"),
            own_ticks: number(14)? + number(15)?,
            reaped_ticks: number(16)? + number(17)?,
            threads: number(20)?,
            started_ticks: number(22)?,
            mapped_bytes: number(23)?,
            resident_pages: number(24)?,
            thread: pid,
        })
    }
}

/// The place where a plugin's processes are found.
#[derive(Debug)]
pub(crate) enum View {
    /// A `/proc` that shows them alone; its first process is the sandbox's.
    Inside(PathBuf),
    /// Everything below a process, in the host's `/proc`.
    Below(i32),
}

/// A look at all processes.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(crate) struct Census {
    /// Living processes of the plugin, and where their files are.
    pub(crate) members: Vec<Member>,
    /// Processes and threads, with those that have ended and that nobody has waited for:
    /// the kernel counts them too.
    pub(crate) tasks: u64,
    /// Processor time of all, dead ones included.
    pub(crate) ticks: u64,
    pub(crate) resident_pages: u64,
}

impl View {
    /// The folder that has a process's files.
    pub(crate) fn folder(&self) -> String {
        match self {
            Self::Inside(proc) => proc.display().to_string(),
            Self::Below(_) => "/proc".into(),
        }
    }

    /// Counts everybody.
    pub(crate) fn census(&self) -> Census {
        let proc = self.folder();
        let everybody = everybody(&proc);
        let (init, members) = match self {
            Self::Inside(_) => everybody.into_iter().partition(|member| member.pid == 1),
            Self::Below(top) => {
                let init = everybody.iter().filter(|member| member.pid == *top);
                (init.copied().collect(), below(*top, &everybody))
            }
        };
        let init: Vec<Member> = init;
        let mut census = Census {
            // What the first process has waited for was the plugin's.
            ticks: init.iter().map(|member| member.reaped_ticks).sum(),
            ..Census::default()
        };
        for member in members {
            census.ticks += member.own_ticks + member.reaped_ticks;
            census.tasks += member.threads;
            if !member.zombie {
                census.resident_pages += member.resident_pages;
                census.members.push(member);
            }
        }
        census
    }
}

fn everybody(proc: &str) -> Vec<Member> {
    let entries = fs::read_dir(proc).into_iter().flatten().flatten();
    let numbers = entries.filter_map(|entry| entry.file_name().to_str()?.parse().ok());
    numbers.filter_map(|pid| Member::read(proc, pid)).collect()
}

/// Everybody below a process, the process itself aside.
fn below(top: i32, everybody: &[Member]) -> Vec<Member> {
    let mut children: BTreeMap<i32, Vec<&Member>> = BTreeMap::new();
    // Numbers are used again while the folder is being read: nobody twice, and no circles.
    let mut seen = BTreeSet::from([top]);
    for member in everybody.iter().filter(|member| seen.insert(member.pid)) {
        children.entry(member.parent).or_default().push(member);
    }
    let mut found = Vec::new();
    let mut parents = vec![top];
    while let Some(parent) = parents.pop() {
        for member in children.remove(&parent).unwrap_or_default() {
            found.push(*member);
            parents.push(member.pid);
        }
    }
    found
}

/// Kills everybody below this process, once; false when nobody can be found, as this
/// process may not read `/proc`.
pub(crate) fn kill_descendants() -> bool {
    let me = std::process::id() as i32;
    let everybody = everybody("/proc");
    for member in below(me, &everybody) {
        kill(member.pid, |pid| {
            started_ticks(pid) == Some(member.started_ticks)
        });
    }
    !everybody.is_empty()
}

/// Kills a process if it still is the one that was meant: by the time that a list of
/// processes has been read, a number of it may be somebody else's. Returns what tells when it
/// is gone.
pub(crate) fn kill(pid: i32, is_meant: impl Fn(i32) -> bool) -> Option<OwnedFd> {
    // Whoever this descriptor stands for does not change any more.
    let process = pidfd_open(Pid::from_raw(pid)?, PidfdFlags::empty()).ok()?;
    if !is_meant(pid) {
        return None;
    }
    // Gone already is as good.
    let _ = pidfd_send_signal(&process, Signal::KILL);
    Some(process)
}

/// Kills a process if it is the one that was meant, and waits until what it was doing in the
/// kernel is done; two seconds at most.
pub(crate) fn kill_and_wait(pid: i32, is_meant: impl Fn(i32) -> bool) {
    let Some(process) = kill(pid, is_meant) else {
        return;
    };
    let end = Instant::now() + Duration::from_secs(2);
    loop {
        let left = end.saturating_duration_since(Instant::now());
        let left = Timespec::try_from(left).ok();
        let ready = poll(&mut [PollFd::new(&process, PollFlags::IN)], left.as_ref());
        if !matches!(ready, Err(Errno::INTR)) {
            return;
        }
    }
}

/// Start of a process, in ticks since that of the machine; tells it from a later one of the same
/// number.
pub(crate) fn started_ticks(pid: i32) -> Option<u64> {
    Member::read("/proc", pid).map(|member| member.started_ticks)
}

/// Nobody is the process of that number that was started then: there is none, it is another,
/// or it has ended and nobody has waited for it yet. Where that cannot be found out, as when this process has no descriptor left, it
/// is taken to live.
pub(crate) fn is_gone(pid: i32, started_ticks: u64) -> bool {
    match fs::read(format!("/proc/{pid}/stat")) {
        Ok(stat) => {
            let ended = |member: &Member| member.zombie && member.threads <= 1;
            Member::parse(pid, &stat)
                .is_some_and(|member| member.started_ticks != started_ticks || ended(&member))
        }
        Err(error) => means_gone(&error),
    }
}

/// The process ended before its file was opened, or between that and reading it.
fn means_gone(error: &io::Error) -> bool {
    error.kind() == io::ErrorKind::NotFound
        || error.raw_os_error() == Some(Errno::SRCH.raw_os_error())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_cannot_be_looked_at_is_not_gone() {
        let me = std::process::id() as i32;
        let started = started_ticks(me).unwrap();
        assert!(!is_gone(me, started));
        assert!(is_gone(me, started + 1));
        assert!(is_gone(i32::MAX, started));
        let mut child = std::process::Command::new("sleep")
            .arg("60")
            .spawn()
            .unwrap();
        let pid = child.id() as i32;
        let started = started_ticks(pid).unwrap();
        assert!(!is_gone(pid, started));
        kill_and_wait(pid, |_| true);
        // Nobody has waited for it.
        assert!(is_gone(pid, started));
        child.wait().unwrap();
        for errno in [Errno::NOENT, Errno::SRCH] {
            assert!(means_gone(&errno.into()));
        }
        for errno in [
            Errno::MFILE,
            Errno::NFILE,
            Errno::IO,
            Errno::NOMEM,
            Errno::ACCESS,
        ] {
            assert!(!means_gone(&errno.into()), "{errno}");
        }
    }

    #[test]
    fn names_cannot_forge_fields() {
        let stat = b"7 (a) S 1 (b) R 5 7 7 0 -1 4194304 9 0 0 0 11 12 13 14 20 0 3 0 99 1000 42 x";
        let member = Member::parse(7, stat).unwrap();
        assert_eq!(member.parent, 5);
        assert_eq!((member.own_ticks, member.reaped_ticks), (23, 27));
        assert_eq!((member.threads, member.started_ticks), (3, 99));
        assert_eq!((member.mapped_bytes, member.resident_pages), (1000, 42));
        for end in 0..stat.len() {
            let _ = Member::parse(7, &stat[..end]);
        }
    }

    #[test]
    fn this_process_has_children() {
        let mut child = std::process::Command::new("sleep")
            .arg("60")
            .spawn()
            .unwrap();
        let census = View::Below(std::process::id() as i32).census();
        let found = census
            .members
            .iter()
            .any(|member| member.pid == child.id() as i32);
        let _ = child.kill();
        let _ = child.wait();
        assert!(found && census.tasks >= 1);
    }
}
