//! A control group of version 2 for one run, where the machine lets us have one.
//!
//! Any group gives exact processor time and a switch that ends everybody. Where the
//! group that this process is in was delegated with its controllers, the kernel also
//! enforces the limits of memory and processes. Version 1 is left alone: there is
//! no way to tell whose it is.

use std::fs;
use std::path::{Path, PathBuf};

use rustix::io::Errno;

/// A group; it is removed with the value.
#[derive(Debug)]
pub(crate) struct Cgroup {
    folder: PathBuf,
}

/// Controllers that are worth having.
const CONTROLLERS: [&str; 2] = ["memory", "pids"];

impl Cgroup {
    /// Makes a group below the one that this process is in.
    pub(crate) fn create(name: &str) -> Result<Self, (Errno, String)> {
        let own = own_folder().ok_or((
            Errno::NOENT,
            "no control groups of version 2 are mounted".to_owned(),
        ))?;
        Self::create_below(&own, name)
    }

    fn create_below(own: &Path, name: &str) -> Result<Self, (Errno, String)> {
        delegate(own);
        let folder = own.join(format!("fleetyard-{name}"));
        fs::create_dir(&folder).map_err(|error| {
            let errno = error
                .raw_os_error()
                .map_or(Errno::IO, Errno::from_raw_os_error);
            (errno, format!("making a group in {}", own.display()))
        })?;
        Ok(Self { folder })
    }

    /// Where it is.
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Moves a process, and all that it will start, into the group.
    pub(crate) fn add(&self, pid: i32) -> std::io::Result<()> {
        fs::write(self.folder.join("cgroup.procs"), pid.to_string())
    }

    /// Lets the kernel enforce limits; those without a controller are left to others.
    pub(crate) fn limit(&self, memory_bytes: u64, processes: u32) {
        let set = |file: &str, value: String| {
            let path = self.folder.join(file);
            if path.exists() {
                let _ = fs::write(path, value);
            }
        };
        if memory_bytes > 0 {
            set("memory.max", memory_bytes.to_string());
            set("memory.swap.max", "0".into());
            set("memory.oom.group", "1".into());
        }
        // One for the sandbox's own process, one so that too many can be seen.
        set("pids.max", (u64::from(processes) + 2).to_string());
    }

    /// Ends everybody in the group, where the kernel has the switch.
    pub(crate) fn kill(&self) {
        let _ = fs::write(self.folder.join("cgroup.kill"), "1");
    }

    fn number(&self, file: &str) -> Option<u64> {
        fs::read_to_string(self.folder.join(file))
            .ok()?
            .trim()
            .parse()
            .ok()
    }

    fn field(&self, file: &str, name: &str) -> Option<u64> {
        field(&fs::read_to_string(self.folder.join(file)).ok()?, name)
    }

    /// Processor time of everybody, ever, in microseconds.
    pub(crate) fn cpu_us(&self) -> Option<u64> {
        self.field("cpu.stat", "usage_usec")
    }

    /// The same in user mode and in the kernel.
    pub(crate) fn cpu_parts_us(&self) -> Option<(u64, u64)> {
        let text = fs::read_to_string(self.folder.join("cpu.stat")).ok()?;
        Some((field(&text, "user_usec")?, field(&text, "system_usec")?))
    }

    /// Time in which a bandwidth limit stopped the group.
    pub(crate) fn throttled_us(&self) -> Option<u64> {
        self.field("cpu.stat", "throttled_usec")
    }

    /// Memory in use, where the controller is there.
    pub(crate) fn memory_bytes(&self) -> Option<u64> {
        self.number("memory.current")
    }

    /// Most memory that was ever in use.
    pub(crate) fn memory_peak_bytes(&self) -> Option<u64> {
        self.number("memory.peak")
    }

    /// Whether the kernel ended processes because of the memory limit.
    pub(crate) fn out_of_memory(&self) -> bool {
        self.field("memory.events", "oom_kill").unwrap_or(0) > 0
    }
}

impl Drop for Cgroup {
    fn drop(&mut self) {
        // Groups with dying processes in them are busy for a moment.
        for _ in 0..50 {
            if fs::remove_dir(&self.folder).is_ok() || !self.folder.exists() {
                return;
            }
            self.kill();
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
    }
}

fn field(text: &str, name: &str) -> Option<u64> {
    text.lines()
        .filter_map(|line| line.split_once(' '))
        .find(|(known, _)| *known == name)
        .and_then(|(_, value)| value.trim().parse().ok())
}

/// The folder of the group that this process is in.
fn own_folder() -> Option<PathBuf> {
    let mounts = fs::read_to_string("/proc/self/mountinfo").ok()?;
    let groups = fs::read_to_string("/proc/self/cgroup").ok()?;
    folder_of(&mounts, &groups)
}

fn folder_of(mounts: &str, groups: &str) -> Option<PathBuf> {
    let group = groups.lines().find_map(|line| line.strip_prefix("0::"))?;
    mounts.lines().find_map(|line| {
        // ... root mount-point options [optional ...] - type source options
        let (before, after) = line.split_once(" - ")?;
        if !after.starts_with("cgroup2 ") {
            return None;
        }
        let mut fields = before.split(' ');
        let root = fields.nth(3)?;
        let mount = fields.next()?;
        let inside = Path::new(group).strip_prefix(root).ok()?;
        Some(Path::new(mount).join(inside))
    })
}

/// A group whose controllers go to its children may not have processes itself: moves
/// this process into a child and passes the controllers on, where the group was given
/// to us and nobody else is in it. A refusal costs the kernel's own limits only.
fn delegate(own: &Path) {
    let read = |file: &str| fs::read_to_string(own.join(file)).unwrap_or_default();
    let offered = read("cgroup.controllers");
    let passed_on = read("cgroup.subtree_control");
    let missing: Vec<&str> = CONTROLLERS
        .into_iter()
        .filter(|name| offered.split_whitespace().any(|known| known == *name))
        .filter(|name| !passed_on.split_whitespace().any(|known| known == *name))
        .collect();
    if missing.is_empty() {
        return;
    }
    let ours = |pid: &str| {
        let me = std::process::id().to_string();
        let parent = std::os::unix::process::parent_id().to_string();
        pid == me || pid == parent
    };
    let processes = read("cgroup.procs");
    if !processes.lines().all(ours) {
        return;
    }
    let host = own.join("fleetyard-host");
    if !processes.trim().is_empty() {
        if fs::create_dir_all(&host).is_err() {
            return;
        }
        for pid in processes.lines() {
            let _ = fs::write(host.join("cgroup.procs"), pid);
        }
    }
    for name in missing {
        let _ = fs::write(own.join("cgroup.subtree_control"), format!("+{name}"));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn finds_the_group_of_this_process() {
        let hybrid = "31 29 0:27 / /sys/fs/cgroup/memory rw - cgroup cgroup rw,memory\n\
                      33 29 0:29 / /sys/fs/cgroup/unified rw,relatime shared:4 - cgroup2 cgroup2 rw\n";
        let groups = "4:memory:/somewhere\n0::/user.slice/a.scope\n";
        assert_eq!(
            folder_of(hybrid, groups),
            Some("/sys/fs/cgroup/unified/user.slice/a.scope".into())
        );
        let container = "33 29 0:29 /docker/x /sys/fs/cgroup ro - cgroup2 cgroup2 rw\n";
        assert_eq!(
            folder_of(container, "0::/docker/x/y\n"),
            Some("/sys/fs/cgroup/y".into())
        );
        assert_eq!(folder_of(container, "0::/\n"), None);
        assert_eq!(folder_of("", groups), None);
        assert_eq!(folder_of(hybrid, "4:memory:/\n"), None);
    }

    #[test]
    fn a_delegated_group_passes_its_controllers_on() {
        let own = tempfile::tempdir().unwrap();
        let write = |file: &str, text: &str| fs::write(own.path().join(file), text).unwrap();
        let read = |file: &str| fs::read_to_string(own.path().join(file)).unwrap();
        let me = std::process::id().to_string();
        write("cgroup.controllers", "cpu memory pids\n");
        write("cgroup.subtree_control", "\n");
        write("cgroup.procs", &format!("{me}\n"));
        delegate(own.path());
        assert_eq!(read("fleetyard-host/cgroup.procs"), me);
        // A plain file keeps the last of what the kernel would add up.
        assert_eq!(read("cgroup.subtree_control"), "+pids");

        // With somebody else in it, it is not ours to change.
        write("cgroup.subtree_control", "");
        write("cgroup.procs", &format!("{me}\n1\n"));
        delegate(own.path());
        assert_eq!(read("cgroup.subtree_control"), "");
    }

    #[test]
    fn reads_what_there_is() {
        let own = tempfile::tempdir().unwrap();
        let group = Cgroup::create_below(own.path(), "test").unwrap();
        assert_eq!(group.cpu_us(), None);
        let folder = group.folder().to_owned();
        fs::write(
            folder.join("cpu.stat"),
            "usage_usec 12\nuser_usec 7\nsystem_usec 5\n",
        )
        .unwrap();
        fs::write(folder.join("memory.events"), "low 0\noom 1\noom_kill 1\n").unwrap();
        assert_eq!(group.cpu_us(), Some(12));
        assert_eq!(group.cpu_parts_us(), Some((7, 5)));
        assert_eq!(group.throttled_us(), None);
        assert!(group.out_of_memory());
        std::mem::forget(group);
    }
}
