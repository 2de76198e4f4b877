//! The control groups of one run, where the machine lets us have any.
//!
//! A group gives exact processor time and a way to end everybody; with its controllers
//! the kernel also enforces the limits of memory and processes, of everything that it
//! counts: page tables, buffers of sockets and pipes, and shared memory that nobody maps
//! any more. Version 2 is tried first. Of version 1, hierarchies are used whose controller
//! version 2 does not have here; a group of ours is made below the one that this process is
//! in, and where that is refused, the hierarchy is somebody else's. Nothing else of them
//! is touched.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::io::Errno;

use crate::confinement::process_tree;

/// The version of a hierarchy; files have other names in each.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Version {
    One,
    Two,
}

/// A hierarchy that this process is in.
#[derive(Debug, PartialEq, Eq)]
struct Hierarchy {
    version: Version,
    /// Of version 1, its controllers.
    controllers: Vec<String>,
    /// The folder of the group that this process is in.
    own: PathBuf,
}

/// A controller of a group.
#[derive(Debug)]
struct Controller {
    version: Version,
    folder: PathBuf,
}

/// Future folders of the groups of a run: a note of them can be left before there are any.
#[derive(Debug)]
pub(crate) struct Places {
    hierarchies: Vec<Hierarchy>,
    name: String,
}

/// The groups of a run, one in each hierarchy that is used; they are removed with the
/// value.
#[derive(Debug, Default)]
pub(crate) struct Cgroup {
    /// The one of version 2, if there is any, comes first.
    folders: Vec<PathBuf>,
    unified: bool,
    cpu: Option<Controller>,
    memory: Option<Controller>,
    pids: Option<Controller>,
    /// The reasons why there are no groups in other hierarchies.
    refused: Vec<(Errno, String)>,
}

/// Controllers whose limits are worth having.
const CONTROLLERS: [&str; 2] = ["memory", "pids"];

impl Controller {
    /// The name of one of its files, which differs by version.
    fn either(&self, one: &'static str, two: &'static str) -> &'static str {
        match self.version {
            Version::One => one,
            Version::Two => two,
        }
    }

    fn read(&self, file: &str) -> Option<String> {
        fs::read_to_string(self.folder.join(file)).ok()
    }

    fn number(&self, file: &str) -> Option<u64> {
        self.read(file)?.trim().parse().ok()
    }

    fn field(&self, file: &str, name: &str) -> Option<u64> {
        field(&self.read(file)?, name)
    }

    fn set(&self, file: &str, value: &str) -> io::Result<()> {
        let path = self.folder.join(file);
        // Writing would make it where there is no such file.
        path.metadata()?;
        fs::write(path, value)
    }
}

impl Hierarchy {
    fn folder(&self, name: &str) -> PathBuf {
        self.own.join(format!("fleetyard-{name}"))
    }
}

impl Places {
    /// Below the groups that this process is in.
    pub(crate) fn of(name: &str) -> Self {
        let mounts = fs::read_to_string("/proc/self/mountinfo").unwrap_or_default();
        let groups = fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
        Self {
            hierarchies: hierarchies(&mounts, &groups),
            name: name.to_owned(),
        }
    }

    /// Every group that may be made.
    pub(crate) fn folders(&self) -> Vec<PathBuf> {
        let folder = |hierarchy: &Hierarchy| hierarchy.folder(&self.name);
        self.hierarchies.iter().map(folder).collect()
    }
}

impl Cgroup {
    /// Makes groups; why not, where there is none to be had.
    pub(crate) fn create(places: &Places) -> Result<Self, (Errno, String)> {
        let mut made = Self::create_below(&places.hierarchies, &places.name);
        let options = fs::read_to_string("/proc/cmdline").unwrap_or_default();
        if made.memory.is_some() && counts_no_kernel_memory(&options) {
            made.memory = None;
            let reason = "the machine was booted with cgroup.memory=nokmem";
            made.refused.push((Errno::OPNOTSUPP, reason.into()));
        }
        if made.folders.is_empty() {
            let none = (Errno::NOENT, "no control groups are mounted".to_owned());
            return Err(made.refused.drain(..).next().unwrap_or(none));
        }
        Ok(made)
    }

    fn create_below(hierarchies: &[Hierarchy], name: &str) -> Self {
        let mut made = Self::default();
        for hierarchy in hierarchies {
            made.join(hierarchy, name);
        }
        made
    }

    /// Makes a group in a hierarchy, if it has what no other has given yet.
    fn join(&mut self, hierarchy: &Hierarchy, name: &str) {
        let Hierarchy { version, own, .. } = hierarchy;
        let one = |controller: &str| {
            *version == Version::One && hierarchy.controllers.iter().any(|one| one == controller)
        };
        let two = *version == Version::Two;
        let wanted = two
            || (self.cpu.is_none() && one("cpuacct"))
            || (self.memory.is_none() && one("memory"))
            || (self.pids.is_none() && one("pids"));
        if !wanted {
            return;
        }
        if two {
            delegate(own);
        }
        let folder = hierarchy.folder(name);
        if let Err(error) = fs::create_dir(&folder) {
            let errno = error
                .raw_os_error()
                .map_or(Errno::IO, Errno::from_raw_os_error);
            let reason = format!("making a group in {}", own.display());
            self.refused.push((errno, reason));
            return;
        }
        let offered = fs::read_to_string(folder.join("cgroup.controllers")).unwrap_or_default();
        let has = |controller: &str| {
            one(controller) || (two && offered.split_whitespace().any(|known| known == controller))
        };
        let controller = || Controller {
            version: *version,
            folder: folder.clone(),
        };
        // Version 2 counts processor time in every group.
        if self.cpu.is_none() && (two || has("cpuacct")) {
            self.cpu = Some(controller());
        }
        if self.memory.is_none() && has("memory") {
            self.memory = Some(controller());
        }
        if self.pids.is_none() && has("pids") {
            self.pids = Some(controller());
        }
        self.unified |= two;
        self.folders.push(folder);
    }

    /// The group of version 2: a process can be started in it.
    pub(crate) fn unified(&self) -> Option<&Path> {
        self.folders
            .first()
            .filter(|_| self.unified)
            .map(PathBuf::as_path)
    }

    /// The reasons why some groups could not be made.
    pub(crate) fn refused(&self) -> &[(Errno, String)] {
        &self.refused
    }

    /// Moves a process, and all that it will start, into the groups; but into that of
    /// version 2 where it was started in it.
    pub(crate) fn add(&self, pid: i32, in_unified: bool) -> io::Result<()> {
        self.folders
            .iter()
            .skip(usize::from(in_unified && self.unified))
            .try_for_each(|folder| fs::write(folder.join("cgroup.procs"), pid.to_string()))
    }

    /// Lets the kernel enforce the limit of memory, 0 standing for none; false where it
    /// does not.
    pub(crate) fn limit_memory(&self, bytes: u64) -> bool {
        let Some(memory) = &self.memory else {
            return false;
        };
        let limit = bytes.to_string();
        let taken = match memory.version {
            Version::Two => {
                let limit = if bytes > 0 { &limit } else { "max" };
                let _ = memory.set("memory.swap.max", "0");
                let _ = memory.set("memory.oom.group", "1");
                memory.set("memory.max", limit)
            }
            Version::One => {
                let limit = if bytes > 0 { &limit } else { "-1" };
                // The limit with swap is never below that without: the one that goes
                // the right way is set first.
                let set = || memory.set("memory.limit_in_bytes", limit);
                let first = set();
                if memory.set("memory.memsw.limit_in_bytes", limit).is_err() {
                    let _ = memory.set("memory.swappiness", "0");
                }
                first.or_else(|_| set())
            }
        };
        taken.is_ok()
    }

    /// Lets the kernel enforce the limit of processes and threads; false where it does
    /// not.
    pub(crate) fn limit_processes(&self, most: u64) -> bool {
        // One for the sandbox's own process, one so that too many can be seen.
        let most = (most + 2).to_string();
        let set = |pids: &Controller| pids.set("pids.max", &most).is_ok();
        self.pids.as_ref().is_some_and(set)
    }

    /// Ends everybody in the groups.
    pub(crate) fn kill(&self) {
        kill(&self.folders);
    }

    /// Processor time of everybody, ever, in microseconds.
    pub(crate) fn cpu_us(&self) -> Option<u64> {
        let cpu = self.cpu.as_ref()?;
        match cpu.version {
            Version::One => Some(cpu.number("cpuacct.usage")? / 1000),
            Version::Two => cpu.field("cpu.stat", "usage_usec"),
        }
    }

    /// The same in user mode and in the kernel.
    pub(crate) fn cpu_parts_us(&self) -> Option<(u64, u64)> {
        let cpu = self.cpu.as_ref()?;
        match cpu.version {
            Version::One => Some((
                cpu.number("cpuacct.usage_user")? / 1000,
                cpu.number("cpuacct.usage_sys")? / 1000,
            )),
            Version::Two => Some((
                cpu.field("cpu.stat", "user_usec")?,
                cpu.field("cpu.stat", "system_usec")?,
            )),
        }
    }

    /// Time in which a bandwidth limit stopped the group.
    pub(crate) fn throttled_us(&self) -> Option<u64> {
        let two = |cpu: &&Controller| cpu.version == Version::Two;
        let cpu = self.cpu.as_ref().filter(two)?;
        cpu.field("cpu.stat", "throttled_usec")
    }

    /// Memory in use, where the controller is there.
    pub(crate) fn memory_bytes(&self) -> Option<u64> {
        let memory = self.memory.as_ref()?;
        memory.number(memory.either("memory.usage_in_bytes", "memory.current"))
    }

    /// Most memory that was ever in use.
    pub(crate) fn memory_peak_bytes(&self) -> Option<u64> {
        let memory = self.memory.as_ref()?;
        memory.number(memory.either("memory.max_usage_in_bytes", "memory.peak"))
    }

    /// True if the kernel ended processes because of the memory limit.
    pub(crate) fn out_of_memory(&self) -> bool {
        let ended = |memory: &Controller| {
            memory.field(
                memory.either("memory.oom_control", "memory.events"),
                "oom_kill",
            )
        };
        self.memory.as_ref().and_then(ended).unwrap_or(0) > 0
    }

    /// True if the kernel refused a process or a thread because of their limit.
    pub(crate) fn out_of_processes(&self) -> bool {
        let refused = |pids: &Controller| pids.field("pids.events", "max");
        self.pids.as_ref().and_then(refused).unwrap_or(0) > 0
    }
}

impl Drop for Cgroup {
    fn drop(&mut self) {
        remove(&self.folders);
    }
}

/// Ends everybody in groups: by the kernel's switch, or one after the other when nobody
/// may start another process.
fn kill(folders: &[PathBuf]) {
    for folder in folders {
        let switch = folder.join("cgroup.kill");
        if switch.exists() && fs::write(switch, "1").is_ok() {
            continue;
        }
        let most = folder.join("pids.max");
        if most.exists() {
            let _ = fs::write(most, "0");
        }
        let members = || -> Vec<i32> {
            let text = fs::read_to_string(folder.join("cgroup.procs")).unwrap_or_default();
            text.lines().filter_map(|line| line.parse().ok()).collect()
        };
        for pid in members() {
            process_tree::kill(pid, |pid| members().contains(&pid));
        }
    }
}

/// Ends everybody in groups and removes them.
pub(crate) fn remove(folders: &[PathBuf]) {
    // Groups with dying processes in them are busy for a moment, on a busy machine for longer:
    // two seconds in all.
    for attempt in 0..100 {
        let is_busy = |folder: &&PathBuf| {
            fs::remove_dir(folder).is_err_and(|error| error.kind() == io::ErrorKind::ResourceBusy)
        };
        if folders.iter().filter(is_busy).count() == 0 {
            return;
        }
        kill(folders);
        std::thread::sleep(Duration::from_millis(1 << (attempt / 10).min(5)));
    }
}

fn field(text: &str, name: &str) -> Option<u64> {
    text.lines()
        .filter_map(|line| line.split_once(' '))
        .find(|(known, _)| *known == name)
        .and_then(|(_, value)| value.trim().parse().ok())
}

/// True if the options of a boot leave page tables and buffers out of what is counted.
fn counts_no_kernel_memory(options: &str) -> bool {
    let options = options.split_whitespace();
    let mut of_groups = options.filter_map(|option| option.strip_prefix("cgroup.memory="));
    of_groups.any(|words| words.split(',').any(|word| word == "nokmem"))
}

/// The hierarchies that this process is in and that are mounted, version 2 first.
fn hierarchies(mounts: &str, groups: &str) -> Vec<Hierarchy> {
    let mut found: Vec<Hierarchy> = groups
        .lines()
        .filter_map(|line| {
            // number:controllers:group
            let (controllers, group) = line.split_once(':')?.1.split_once(':')?;
            let version = if line.starts_with("0::") {
                Version::Two
            } else {
                Version::One
            };
            let controllers: Vec<String> = controllers
                .split(',')
                .filter(|name| !name.is_empty())
                .map(str::to_owned)
                .collect();
            let own = folder_of(mounts, version, &controllers, group)?;
            Some(Hierarchy {
                version,
                controllers,
                own,
            })
        })
        .collect();
    found.sort_by_key(|hierarchy| hierarchy.version == Version::One);
    found
}

/// Folder in which a group of a hierarchy is seen.
fn folder_of(
    mounts: &str,
    version: Version,
    controllers: &[String],
    group: &str,
) -> Option<PathBuf> {
    mounts.lines().find_map(|line| {
        // ... root mount-point options [optional ...] - type source options
        let (before, after) = line.split_once(" - ")?;
        let mut after = after.split(' ');
        let kind = after.next()?;
        let options = after.nth(1).unwrap_or_default();
        let is_it = match version {
            Version::Two => kind == "cgroup2",
            Version::One => {
                let has = |name: &String| options.split(',').any(|known| known == name);
                kind == "cgroup" && !controllers.is_empty() && controllers.iter().all(has)
            }
        };
        if !is_it {
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

    fn one(controllers: &[&str], own: &Path) -> Hierarchy {
        Hierarchy {
            version: Version::One,
            controllers: controllers.iter().map(|name| (*name).to_owned()).collect(),
            own: own.to_owned(),
        }
    }

    fn two(own: &Path) -> Hierarchy {
        Hierarchy {
            version: Version::Two,
            controllers: Vec::new(),
            own: own.to_owned(),
        }
    }

    #[test]
    fn finds_the_groups_of_this_process() {
        let hybrid = "31 29 0:27 / /sys/fs/cgroup/memory rw - cgroup cgroup rw,memory\n\
                      32 29 0:28 / /sys/fs/cgroup/cpu,cpuacct rw - cgroup cgroup rw,cpu,cpuacct\n\
                      33 29 0:29 / /sys/fs/cgroup/unified rw,relatime shared:4 - cgroup2 cgroup2 rw\n";
        let groups =
            "5:cpu,cpuacct:/\n4:memory:/somewhere\n1:name=systemd:/\n0::/user.slice/a.scope\n";
        let folder = |path: &str| PathBuf::from(format!("/sys/fs/cgroup/{path}"));
        assert_eq!(
            hierarchies(hybrid, groups),
            [
                two(&folder("unified/user.slice/a.scope")),
                one(&["cpu", "cpuacct"], &folder("cpu,cpuacct")),
                one(&["memory"], &folder("memory/somewhere")),
            ]
        );
        let container = "33 29 0:29 /docker/x /sys/fs/cgroup ro - cgroup2 cgroup2 rw\n";
        assert_eq!(
            hierarchies(container, "0::/docker/x/y\n"),
            [two(Path::new("/sys/fs/cgroup/y"))]
        );
        assert_eq!(hierarchies(container, "0::/\n"), []);
        assert_eq!(hierarchies("", groups), []);
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
    fn each_controller_is_taken_where_it_is_and_once() {
        let base = tempfile::tempdir().unwrap();
        let folder = |name: &str| {
            let path = base.path().join(name);
            fs::create_dir(&path).unwrap();
            path
        };
        let hybrid = [
            two(&folder("unified")),
            one(&["cpuacct"], &folder("cpuacct")),
            one(&["memory"], &folder("memory")),
            one(&["freezer"], &folder("freezer")),
            one(&["pids"], &base.path().join("not there")),
        ];
        let group = Cgroup::create_below(&hybrid, "test");
        let made = |name: &str| base.path().join(name).join("fleetyard-test");
        assert_eq!(group.folders, [made("unified"), made("memory")]);
        assert_eq!(group.unified(), Some(made("unified").as_path()));
        assert_eq!(group.refused().len(), 1);
        assert!(!group.limit_processes(3));

        // The kernel makes these files.
        let write = |name: &str, file: &str, text: &str| {
            fs::write(made(name).join(file), text).unwrap();
        };
        assert!(!group.limit_memory(4096), "nothing to be written to");
        write("memory", "memory.limit_in_bytes", "");
        write("memory", "memory.memsw.limit_in_bytes", "");
        write("memory", "memory.oom_control", "under_oom 0\noom_kill 1\n");
        write("memory", "memory.usage_in_bytes", "17\n");
        let times = "usage_usec 12\nuser_usec 7\nsystem_usec 5\n";
        write("unified", "cpu.stat", times);
        assert!(group.limit_memory(4096) && group.out_of_memory());
        assert_eq!(group.memory_bytes(), Some(17));
        assert_eq!(
            (group.cpu_us(), group.cpu_parts_us()),
            (Some(12), Some((7, 5)))
        );
        assert_eq!(group.throttled_us(), None);
        std::mem::forget(group);

        let group = Cgroup::create_below(&hybrid[1..2], "test");
        fs::write(made("cpuacct").join("cpuacct.usage"), "12000\n").unwrap();
        assert_eq!((group.unified(), group.cpu_us()), (None, Some(12)));
        std::mem::forget(group);
    }

    #[test]
    fn memory_of_the_kernel_may_be_left_out_of_the_count() {
        assert!(counts_no_kernel_memory(
            "quiet cgroup.memory=nosocket,nokmem ro\n"
        ));
        assert!(!counts_no_kernel_memory(
            "quiet cgroup.memory=nosocket ro\n"
        ));
    }
}
