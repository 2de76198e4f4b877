//! Physical cores: which there are, which a trial gets, and who else holds one.
//!
//! A trial of N threads gets N physical cores. All hardware threads of a core
//! belong to the trial that has the core, because two threads on one core slow
//! each other down by a third and more; but the planner's mask has *one* logical
//! CPU per core, and the siblings stay idle, so that N threads always have N
//! whole cores and never half of two. The cores are as close to each other as they
//! come: one NUMA node if possible, then one last-level cache. One core, usually
//! that of CPU 0, which also serves most interrupts, is left for the host.
//!
//! On a machine with fast and slow cores (big.LITTLE, P and E cores) trials run on
//! fast ones only, as they could not be compared otherwise; the host takes a slow
//! one.
//!
//! Processes of one user agree by `flock` on a file per core in a private folder:
//! a trial holds its cores alone, hosts share theirs. The kernel drops the locks of
//! a process that ends, however it ends. Other users, and containers with a `/tmp`
//! of their own, do not take part; what they do shows in
//! [`load`](super::load) as a busy neighbour.
//!
//! This is no limit: without a `cpuset` a hostile planner can change its own mask.

use std::collections::BTreeMap;
use std::io;
use std::os::fd::OwnedFd;
use std::path::PathBuf;
use std::sync::OnceLock;
use std::time::{Duration, Instant};

use rustix::fs::{
    AtFlags, FlockOperation, Mode, OFlags, Timespec, Timestamps, UTIME_NOW, fstat, futimens,
    openat, statat,
};
use rustix::process::Pid;
use serde::Serialize;

use super::Cpus;
use super::cpus::CPU_LIMIT;
use super::source::{Source, values};
use crate::confinement::state;

/// A core with less than this share of the strongest core's capacity is a slow
/// one. Favoured cores of one kind differ by a few percent, kinds by half.
const FAST: f64 = 0.8;

/// How long to wait for another process that is choosing, which takes it
/// milliseconds. Only one that was stopped in the middle takes longer.
const PATIENCE: Duration = Duration::from_secs(10);

/// Why no cores are reserved. A trial can run without, and should say so.
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
        /// What is wrong with it.
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
    /// What the user can do.
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

/// One physical core as the machine tells.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Core {
    /// Its logical CPUs that are online.
    pub(super) cpus: Cpus,
    /// The socket.
    pub(super) package: Option<u32>,
    /// The NUMA node.
    node: Option<u32>,
    /// The lowest CPU that shares the last-level cache.
    cache: Option<u32>,
    slow: bool,
}

/// All cores that are online, by their lowest CPU; absent where the machine does
/// not tell which CPUs share one.
pub(super) fn layout(source: &Source) -> Option<Vec<Core>> {
    const CPU: &str = "sys/devices/system/cpu";
    let cpuinfo = source.raw("proc/cpuinfo").unwrap_or_default();
    let online = online(source, &cpuinfo).filter(|online| !online.is_empty())?;
    let mut nodes = BTreeMap::new();
    for node in source.numbered("sys/devices/system/node", "node") {
        let cpus = source.cpus(&format!("sys/devices/system/node/node{node}/cpulist"));
        nodes.extend(cpus.iter().flat_map(|cpus| cpus.iter()).map(|c| (*c, node)));
    }
    let efficient = ["cpu_atom", "cpu_lowpower"].map(|kind| {
        let cpus = source.cpus(&format!("sys/devices/{kind}/cpus"));
        cpus.unwrap_or_default()
    });
    let mut identifiers = None;
    let mut cores: Vec<Core> = Vec::new();
    let mut capacities = Vec::new();
    let mut placed = Cpus::default();
    for &cpu in online.iter() {
        if placed.has(cpu) {
            continue;
        }
        let topology = format!("{CPU}/cpu{cpu}/topology");
        let siblings = source
            .cpus(&format!("{topology}/core_cpus_list"))
            .or_else(|| source.cpus(&format!("{topology}/thread_siblings_list")));
        let siblings = if let Some(siblings) = siblings {
            siblings
        } else {
            let identifiers =
                identifiers.get_or_insert_with(|| identifiers_of(source, &online, &cpuinfo));
            let own = identifiers.get(&cpu)?;
            let same = identifiers.iter().filter(|(_, other)| *other == own);
            same.map(|(cpu, _)| *cpu).collect()
        };
        // Whatever the lists say, every CPU ends up in one core.
        let cpus: Cpus = siblings
            .iter()
            .copied()
            .filter(|sibling| online.has(*sibling) && !placed.has(*sibling))
            .chain([cpu])
            .collect();
        placed = placed.union(&cpus);
        capacities.push(source.number::<u32>(&format!("{CPU}/cpu{cpu}/cpu_capacity")));
        let cache = source.cpus(&format!("{CPU}/cpu{cpu}/cache/index3/shared_cpu_list"));
        cores.push(Core {
            cpus,
            package: source.number(&format!("{topology}/physical_package_id")),
            node: nodes.get(&cpu).copied(),
            cache: cache.and_then(|cpus| cpus.first().copied()),
            slow: efficient.iter().any(|cpus| cpus.has(cpu)),
        });
    }
    let strongest = capacities.iter().flatten().max().copied().unwrap_or(0);
    for (core, capacity) in cores.iter_mut().zip(capacities) {
        let weak = |capacity: u32| f64::from(capacity) < FAST * f64::from(strongest);
        core.slow |= capacity.is_some_and(weak);
    }
    if cores.iter().all(|core| core.slow) {
        // All of one kind.
        for core in &mut cores {
            core.slow = false;
        }
    }
    Some(cores)
}

/// The CPUs that are online; `/proc/cpuinfo` lists no others.
pub(super) fn online(source: &Source, cpuinfo: &str) -> Option<Cpus> {
    source
        .cpus("sys/devices/system/cpu/online")
        .or_else(|| processors(cpuinfo))
}

fn processors(cpuinfo: &str) -> Option<Cpus> {
    let numbers = values(cpuinfo, "processor").map(|number| number.parse::<u32>().ok());
    numbers.collect()
}

/// Socket and core number of each CPU, where there are no lists of siblings.
fn identifiers_of(source: &Source, online: &Cpus, cpuinfo: &str) -> BTreeMap<u32, (u32, u32)> {
    let mut identifiers = BTreeMap::new();
    for block in cpuinfo.split("\n\n") {
        let number = |key| values(block, key).next()?.parse::<u32>().ok();
        if let (Some(cpu), Some(package), Some(core)) = (
            number("processor"),
            number("physical id"),
            number("core id"),
        ) {
            identifiers.insert(cpu, (package, core));
        }
    }
    for &cpu in online.iter() {
        let folder = format!("sys/devices/system/cpu/cpu{cpu}/topology");
        let package = source.number(&format!("{folder}/physical_package_id"));
        let core = source.number(&format!("{folder}/core_id"));
        if let (Some(package), Some(core)) = (package, core) {
            identifiers.insert(cpu, (package, core));
        }
    }
    identifiers
}

/// A core that this process may use.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Usable {
    core: Core,
    /// Those of its CPUs that this process may use.
    own: Cpus,
}

impl Usable {
    /// What the core is called, for everybody alike.
    fn name(&self) -> u32 {
        self.core.cpus[0]
    }

    fn is_whole(&self) -> bool {
        self.own == self.core.cpus
    }
}

/// The physical cores that this process may use.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Topology {
    cores: Vec<Usable>,
}

impl Topology {
    /// The cores of the CPUs that this process was allowed when it first asked:
    /// pinning the host does not take them away. An affinity mask or `cpuset` that
    /// was set from outside is kept to.
    pub fn of_this_process() -> Result<&'static Self, NoCores> {
        static TOPOLOGY: OnceLock<Result<Topology, NoCores>> = OnceLock::new();
        let topology = TOPOLOGY.get_or_init(|| {
            let allowed = affinity(None).map_err(|_| NoCores::UnknownTopology)?;
            Self::read(&Source::system(), &allowed)
        });
        topology.as_ref().map_err(Clone::clone)
    }

    fn read(source: &Source, allowed: &Cpus) -> Result<Self, NoCores> {
        let cores = layout(source).ok_or(NoCores::UnknownTopology)?;
        let cores = cores.into_iter().filter_map(|core| {
            let own: Cpus = core
                .cpus
                .iter()
                .copied()
                .filter(|cpu| allowed.has(*cpu))
                .collect();
            (!own.is_empty()).then_some(Usable { core, own })
        });
        Ok(Self {
            cores: cores.collect(),
        })
    }

    /// The CPUs that this process may use.
    pub fn cpus(&self) -> Cpus {
        let cores = self.cores.iter();
        cores.flat_map(|core| core.own.iter()).copied().collect()
    }

    /// The number of physical cores.
    pub fn cores(&self) -> u32 {
        self.cores.len() as u32
    }

    /// Reserves `threads` physical cores (at least one) for a trial, and one for
    /// the host. Nobody else gets them before the reservation is dropped.
    pub fn reserve(&self, threads: u32) -> Result<Reservation, NoCores> {
        self.reserve_in(&Folder::open()?, threads)
    }

    fn reserve_in(&self, folder: &Folder, threads: u32) -> Result<Reservation, NoCores> {
        let needed = threads.max(1);
        // Two that choose at the same time could take half each.
        let _choosing = folder.wait_for("choosing")?;
        // The first core that no trial has. Slow ones and parts of cores are no use
        // for trials; and everybody with the same CPUs comes to the same one.
        let mut candidates: Vec<&Usable> = self.cores.iter().collect();
        candidates.sort_by_key(|core| (!core.core.slow, core.is_whole(), core.name()));
        let mut host = None;
        for core in &candidates {
            if let Some(lock) = folder.try_lock(&file_name(core), false)? {
                host = Some((*core, lock));
                break;
            }
        }
        let mut reserved = 0;
        let mut free = Vec::new();
        for &core in candidates.iter().filter(|core| !core.core.slow) {
            if host.as_ref().is_some_and(|(host, _)| *host == core) {
                continue;
            }
            match folder.try_lock(&file_name(core), true)? {
                Some(lock) => free.push((core, lock)),
                None => reserved += 1,
            }
        }
        let names = choose(
            &free.iter().map(|(core, _)| *core).collect::<Vec<_>>(),
            needed,
        );
        let (Some(names), Some((host, host_lock))) = (names, host) else {
            let free = free.len() as u32;
            return Err(NoCores::TooFew {
                needed,
                free,
                reserved,
            });
        };
        free.retain(|(core, _)| names.contains(&core.name()));
        let cores = || free.iter().map(|(core, _)| *core);
        let mask: Cpus = cores().map(|core| core.own[0]).collect();
        let all: Cpus = cores()
            .flat_map(|core| core.core.cpus.iter())
            .copied()
            .collect();
        let mut nodes: Vec<u32> = cores().filter_map(|core| core.core.node).collect();
        nodes.sort_unstable();
        nodes.dedup();
        Ok(Reservation {
            siblings: all.iter().copied().filter(|cpu| !mask.has(*cpu)).collect(),
            mask,
            host: host.own.clone(),
            nodes,
            _locks: free
                .into_iter()
                .map(|(_, lock)| lock)
                .chain([host_lock])
                .collect(),
        })
    }
}

fn file_name(core: &Usable) -> String {
    format!("core-{}", core.name())
}

/// The names of `count` cores that are whole if possible and close to each other.
fn choose(free: &[&Usable], count: u32) -> Option<Vec<u32>> {
    let count = count as usize;
    let whole: Vec<&Usable> = free
        .iter()
        .copied()
        .filter(|core| core.is_whole())
        .collect();
    let mut from = if whole.len() >= count {
        whole
    } else {
        free.to_vec()
    };
    if from.len() < count {
        return None;
    }
    from.sort_by_key(|core| core.name());
    let near: [fn(&Usable) -> Option<u32>; 2] = [|core| core.core.node, |core| core.core.cache];
    Some(closest(&from, count, &near))
}

/// `count` of at least as many cores: from the smallest group that has enough, or
/// else from as few groups as will do, and within a group likewise.
fn closest(from: &[&Usable], count: usize, near: &[fn(&Usable) -> Option<u32>]) -> Vec<u32> {
    let Some((key, nearer)) = near.split_first() else {
        return from.iter().take(count).map(|core| core.name()).collect();
    };
    let mut groups: BTreeMap<Option<u32>, Vec<&Usable>> = BTreeMap::new();
    for core in from {
        groups.entry(key(core)).or_default().push(core);
    }
    let mut groups: Vec<_> = groups.into_values().collect();
    groups.sort_by_key(Vec::len);
    let mut chosen = Vec::new();
    while chosen.len() < count {
        let missing = count - chosen.len();
        let enough = groups.partition_point(|group| group.len() < missing);
        if groups.is_empty() {
            break;
        }
        let group = groups.remove(enough.min(groups.len() - 1));
        chosen.extend(closest(&group, missing.min(group.len()), nearer));
    }
    chosen
}

/// Cores that a trial has to itself until this is dropped.
#[derive(Debug, Serialize)]
pub struct Reservation {
    /// Where the planner runs: one logical CPU of each of its cores.
    pub mask: Cpus,
    /// The other logical CPUs of those cores, which stay idle.
    pub siblings: Cpus,
    /// Where the host runs meanwhile.
    pub host: Cpus,
    /// The NUMA nodes of the planner's cores; more than one if it did not fit.
    pub nodes: Vec<u32>,
    #[serde(skip)]
    _locks: Vec<Lock>,
}

impl Reservation {
    /// All CPUs on which nobody else should run: what to watch the load of.
    pub fn watched(&self) -> Cpus {
        self.mask.union(&self.siblings)
    }
}

/// A lock that a process holds until it drops it or ends.
#[derive(Debug)]
struct Lock(OwnedFd);

impl Drop for Lock {
    fn drop(&mut self) {
        // Closing is not enough when a process that is just being started has a copy
        // of the descriptor for a moment.
        let _ = rustix::fs::flock(&self.0, FlockOperation::Unlock);
    }
}

/// The folder of the locks, which only this user can write to.
#[derive(Debug)]
struct Folder {
    path: PathBuf,
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
    fn open() -> Result<Self, NoCores> {
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
    fn try_lock(&self, name: &str, alone: bool) -> Result<Option<Lock>, NoCores> {
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
    fn wait_for(&self, name: &str) -> Result<Lock, NoCores> {
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

const WORD: usize = libc::c_ulong::BITS as usize;

/// The kernel's form of a mask: longer than `cpu_set_t`, which ends at 1024.
type Words = [libc::c_ulong; CPU_LIMIT as usize / WORD];

/// Confines a thread, by default the calling one, to these CPUs. Threads and
/// processes that it starts from then on inherit that; its other threads do not.
///
/// Allocates nothing, so it may be called between `fork` and `exec`. A mask that
/// the kernel would cut short, since a CPU is offline or not ours, is an error.
pub fn pin(thread: Option<Pid>, cpus: &Cpus) -> io::Result<()> {
    let refused = || io::Error::from_raw_os_error(libc::EINVAL);
    let mut wanted: Words = [0; _];
    for &cpu in cpus.iter() {
        let word = wanted.get_mut(cpu as usize / WORD).ok_or_else(refused)?;
        *word |= 1 << (cpu as usize % WORD);
    }
    let raw = Pid::as_raw(thread);
    // SAFETY: the kernel reads as many bytes as the array has.
    let done = unsafe { libc::sched_setaffinity(raw, size_of::<Words>(), wanted.as_ptr().cast()) };
    if done != 0 {
        return Err(io::Error::last_os_error());
    }
    if words_of(thread)? != wanted {
        return Err(refused());
    }
    Ok(())
}

/// Confines every thread of this process to these CPUs.
pub fn pin_this_process(cpus: &Cpus) -> io::Result<()> {
    // What we may use at all is to be known before there is less of it.
    let _ = Topology::of_this_process();
    let mut pinned = Vec::new();
    loop {
        let before = pinned.len();
        for thread in Source::system().numbered("proc/self/task", "") {
            let Some(pid) = Pid::from_raw(thread as i32).filter(|_| !pinned.contains(&thread))
            else {
                continue;
            };
            match pin(Some(pid), cpus) {
                Ok(()) => pinned.push(thread),
                // It has just ended.
                Err(error) if error.raw_os_error() == Some(libc::ESRCH) => {}
                Err(error) => return Err(error),
            }
        }
        // A thread that was not pinned yet may have started another meanwhile.
        if pinned.len() == before {
            return Ok(());
        }
    }
}

/// The CPUs that a thread, by default the calling one, may run on.
pub fn affinity(thread: Option<Pid>) -> io::Result<Cpus> {
    let words = words_of(thread)?;
    let cpus = (0..CPU_LIMIT).filter(|cpu| {
        let cpu = *cpu as usize;
        words[cpu / WORD] & (1 << (cpu % WORD)) != 0
    });
    Ok(cpus.collect())
}

fn words_of(thread: Option<Pid>) -> io::Result<Words> {
    let mut words: Words = [0; _];
    let raw = Pid::as_raw(thread);
    // SAFETY: the kernel writes at most as many bytes as the array has.
    let done =
        unsafe { libc::sched_getaffinity(raw, size_of::<Words>(), words.as_mut_ptr().cast()) };
    if done != 0 {
        return Err(io::Error::last_os_error());
    }
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::fixture::{Fixture, laptop, server};
    use proptest::prelude::*;
    use std::collections::BTreeSet;
    use std::io::{BufRead, BufReader, Write};
    use std::os::unix::fs::{PermissionsExt, symlink};
    use std::process::{Child, Command, Stdio};

    fn cpus(text: &str) -> Cpus {
        text.parse().unwrap()
    }

    fn folder(at: &tempfile::TempDir) -> Folder {
        state::below(at.path(), "fleetyard", "cores", true)
            .unwrap()
            .into()
    }

    fn topology(fixture: &Fixture, allowed: &str) -> Topology {
        Topology::read(&fixture.source(), &cpus(allowed)).unwrap()
    }

    /// What reservations of these sizes look like, one after the other and all held.
    fn reserve_all(topology: &Topology, threads: &[u32]) -> Vec<String> {
        let place = tempfile::tempdir().unwrap();
        let folder = folder(&place);
        let held: Vec<_> = threads
            .iter()
            .map(|threads| topology.reserve_in(&folder, *threads))
            .collect();
        let show = |held: &Result<Reservation, NoCores>| match held {
            Ok(held) => {
                let Reservation {
                    mask,
                    siblings,
                    host,
                    nodes,
                    ..
                } = held;
                format!("{mask} idle {siblings} host {host} nodes {nodes:?}")
            }
            Err(reason) => reason.to_string(),
        };
        held.iter().map(show).collect()
    }

    #[test]
    fn a_trial_gets_whole_cores_and_the_host_keeps_one() {
        assert_eq!(
            reserve_all(&topology(&laptop(), "0-7"), &[2, 1, 1]),
            [
                "1-2 idle 5-6 host 0,4 nodes [0]",
                "3 idle 7 host 0,4 nodes [0]",
                "needs 1 physical core beside the host's, 0 are free and 3 are reserved by others",
            ]
        );
        assert_eq!(
            reserve_all(&topology(&laptop(), "0-7"), &[4]),
            ["needs 4 physical cores beside the host's, 3 are free"]
        );
    }

    #[test]
    fn a_trial_stays_on_one_node_if_it_fits() {
        let topology = topology(&server(), "0-7");
        // The host has core 0, so node 1 has three cores as well as node 0.
        assert_eq!(
            reserve_all(&topology, &[1, 3, 2]),
            [
                "1 idle  host 0 nodes [0]",
                "4-6 idle  host 0 nodes [1]",
                "2-3 idle  host 0 nodes [0]",
            ]
        );
        assert_eq!(
            reserve_all(&topology, &[4]),
            ["1,4-6 idle  host 0 nodes [0, 1]"]
        );
    }

    #[test]
    fn only_allowed_cpus_are_used_and_broken_cores_last() {
        // Of core 2 and core 3 one thread each is not ours.
        let topology = topology(&laptop(), "0-5,7");
        assert_eq!(topology.cpus(), cpus("0-5,7"));
        assert_eq!(
            reserve_all(&topology, &[1, 1, 1]),
            [
                // The host takes the broken one, of which nobody can have the rest.
                "0 idle 4 host 2 nodes [0]",
                "1 idle 5 host 2 nodes [0]",
                "3 idle 7 host 2 nodes [0]",
            ]
        );
    }

    #[test]
    fn trials_run_on_fast_cores_and_the_host_on_a_slow_one() {
        let hybrid = laptop();
        hybrid.write("sys/devices/cpu_core/cpus", "0-1,4-5");
        hybrid.write("sys/devices/cpu_atom/cpus", "2-3,6-7");
        let big_little = laptop();
        for cpu in 0..8 {
            let capacity = if cpu % 4 < 2 { 1024 - cpu } else { 446 };
            let file = format!("sys/devices/system/cpu/cpu{cpu}/cpu_capacity");
            big_little.write(&file, &capacity.to_string());
        }
        for fixture in [hybrid, big_little] {
            assert_eq!(
                reserve_all(&topology(&fixture, "0-7"), &[2, 1]),
                [
                    "0-1 idle 4-5 host 2,6 nodes [0]",
                    "needs 1 physical core beside the host's, 0 are free and 2 are reserved by others",
                ]
            );
        }
    }

    #[test]
    fn cores_are_known_by_their_numbers_where_siblings_are_not_listed() {
        let block = |cpu: u32, core: u32| {
            format!("processor\t: {cpu}\nphysical id\t: 0\ncore id\t\t: {core}\n\n")
        };
        let cpuinfo: String = (0..4).map(|cpu| block(cpu, cpu / 2)).collect();
        let fixture = Fixture::new(&[("proc/cpuinfo", &cpuinfo)]);
        let cores = layout(&fixture.source()).unwrap();
        let cores: Vec<_> = cores.iter().map(|core| core.cpus.to_string()).collect();
        assert_eq!(cores, ["0-1", "2-3"]);
        let silent = Fixture::new(&[("proc/cpuinfo", "processor : 0\n")]);
        assert_eq!(
            Topology::read(&silent.source(), &cpus("0")),
            Err(NoCores::UnknownTopology)
        );
    }

    #[test]
    fn hosts_with_other_cpus_keep_off_each_others_trials() {
        let place = tempfile::tempdir().unwrap();
        let folder = folder(&place);
        let (all, last) = (topology(&laptop(), "0-7"), topology(&laptop(), "2-3,6-7"));
        let first = last.reserve_in(&folder, 1).unwrap();
        assert_eq!(
            (first.host.clone(), first.mask.clone()),
            (cpus("2,6"), cpus("3"))
        );
        let second = all.reserve_in(&folder, 1).unwrap();
        assert_eq!(
            (second.host.clone(), second.mask.clone()),
            (cpus("0,4"), cpus("1"))
        );
        // What is left is the core of the first one's host.
        assert!(all.reserve_in(&folder, 1).is_err());
        drop(first);
        let third = all.reserve_in(&folder, 2).unwrap();
        assert_eq!(third.mask, cpus("2-3"));
        // And now the other host has nowhere to be.
        let refused = last.reserve_in(&folder, 1).unwrap_err();
        assert!(
            matches!(refused, NoCores::TooFew { free: 0, .. }),
            "{refused}"
        );
    }

    #[test]
    fn folders_of_others_are_refused() {
        let place = tempfile::tempdir().unwrap();
        let real = place.path().join("real");
        std::fs::create_dir(&real).unwrap();
        let open = |name: &str| state::below(place.path(), name, "cores", false).map(|_| ());
        symlink(&real, place.path().join("link")).unwrap();
        assert!(open("link").is_err());
        assert!(real.read_dir().unwrap().next().is_none());
        let wide = place.path().join("wide");
        std::fs::create_dir(&wide).unwrap();
        std::fs::set_permissions(&wide, std::fs::Permissions::from_mode(0o777)).unwrap();
        let refused = open("wide").unwrap_err();
        assert!(
            refused.to_string().ends_with("others may write to it"),
            "{refused}"
        );
        std::fs::write(place.path().join("file"), "").unwrap();
        assert!(open("file").is_err());
        assert!(state::below(&place.path().join("none"), "x", "cores", true).is_err());
        // Nobody else's files are locked, even if they are put there.
        let folder = folder(&place);
        symlink(&real, folder.path.join("core-0")).unwrap();
        assert!(folder.try_lock("core-0", true).is_err());
        let made = place.path().join("fleetyard").metadata().unwrap();
        assert_eq!(made.permissions().mode() & 0o777, 0o711);
    }

    #[test]
    fn a_lock_survives_the_cleaning_of_the_folder() {
        let place = tempfile::tempdir().unwrap();
        let folder = folder(&place);
        let lock = folder.try_lock("core-0", true).unwrap();
        assert!(lock.is_some() && folder.try_lock("core-0", false).unwrap().is_none());
        drop(lock);
        assert!(folder.try_lock("core-0", true).unwrap().is_some());
    }

    /// A machine of nodes, caches, cores and threads, numbered at random.
    #[derive(Debug, Clone)]
    struct Shape {
        cores: Vec<Core>,
        allowed: Cpus,
    }

    fn shape() -> impl Strategy<Value = Shape> {
        let core = (1..=3usize, any::<bool>(), 0..3u32, 0..3u32);
        let cores = prop::collection::vec(core, 1..10);
        let numbers = Just((0..64u32).collect::<Vec<_>>()).prop_shuffle();
        let allowed = prop::collection::vec(prop::bool::weighted(0.8), 64);
        (cores, numbers, allowed, any::<bool>()).prop_map(|(cores, numbers, allowed, uniform)| {
            let mut numbers = numbers.into_iter();
            let cores = cores.into_iter().map(|(threads, slow, node, cache)| Core {
                cpus: numbers.by_ref().take(threads).collect(),
                package: Some(node),
                node: Some(node),
                cache: Some(node * 3 + cache),
                slow: slow && !uniform,
            });
            let allowed = (0..64).filter(|cpu| allowed[*cpu as usize]).collect();
            Shape {
                cores: cores.collect(),
                allowed,
            }
        })
    }

    impl Shape {
        fn topology(&self) -> Topology {
            let own = |core: &Core| -> Cpus {
                let cpus = core.cpus.iter().copied();
                cpus.filter(|cpu| self.allowed.has(*cpu)).collect()
            };
            let cores = self.cores.iter().map(|core| Usable {
                own: own(core),
                core: core.clone(),
            });
            let mut cores: Vec<_> = cores.filter(|core| !core.own.is_empty()).collect();
            cores.sort_by_key(Usable::name);
            Topology { cores }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn reservations_never_overlap(
            shape in shape(),
            steps in prop::collection::vec((1..5u32, any::<bool>(), 0..8usize), 1..20),
        ) {
            let place = tempfile::tempdir().unwrap();
            let folder = folder(&place);
            let topology = shape.topology();
            let mut held: Vec<Reservation> = Vec::new();
            for (threads, drop_one, which) in steps {
                if drop_one && !held.is_empty() {
                    held.remove(which % held.len());
                    continue;
                }
                match topology.reserve_in(&folder, threads) {
                    Ok(reservation) => held.push(reservation),
                    Err(NoCores::TooFew { needed, free, .. }) => {
                        prop_assert_eq!(needed, threads);
                        prop_assert!(free < needed);
                    }
                    Err(other) => prop_assert!(false, "{}", other),
                }
                let mut taken = BTreeSet::new();
                for reservation in &held {
                    let watched = reservation.watched();
                    for cpu in watched.iter() {
                        prop_assert!(taken.insert(*cpu), "CPU {} twice", cpu);
                    }
                    let on = |cpu: &u32| shape.cores.iter().find(|core| core.cpus.has(*cpu));
                    let cores: BTreeSet<_> = reservation
                        .mask
                        .iter()
                        .map(|cpu| on(cpu).unwrap().cpus.clone())
                        .collect();
                    // One thread a core, and all its siblings idle.
                    prop_assert_eq!(cores.len(), reservation.mask.len());
                    let all: Cpus = cores.iter().flat_map(|core| core.iter()).copied().collect();
                    prop_assert_eq!(&all, &watched);
                    for cpu in reservation.mask.iter().chain(reservation.host.iter()) {
                        prop_assert!(shape.allowed.has(*cpu));
                    }
                    prop_assert!(reservation.mask.iter().all(|cpu| !on(cpu).unwrap().slow));
                    prop_assert!(!reservation.host.is_empty());
                }
                // No trial runs on any host's core.
                for reservation in &held {
                    prop_assert!(reservation.host.iter().all(|cpu| !taken.contains(cpu)));
                }
            }
            // All of it is free again.
            drop(held);
            let fast = topology.cores.iter().filter(|core| !core.core.slow).count();
            let slow = topology.cores.len() - fast;
            let most = if slow > 0 { fast } else { fast.saturating_sub(1) };
            if most > 0 {
                let all = topology.reserve_in(&folder, most as u32);
                prop_assert_eq!(all.unwrap().mask.len(), most);
            }
        }

        #[test]
        fn a_choice_that_fits_into_one_node_or_cache_is_made_there(
            shape in shape(),
            count in 1..6u32,
        ) {
            let topology = shape.topology();
            let free: Vec<&Usable> = topology.cores.iter().filter(|core| core.is_whole()).collect();
            let Some(names) = choose(&free, count) else {
                prop_assert!(free.len() < count as usize);
                return Ok(());
            };
            prop_assert_eq!(names.len(), count as usize);
            let chosen: Vec<_> = free.iter().filter(|core| names.contains(&core.name())).collect();
            prop_assert_eq!(chosen.len(), names.len());
            for key in [|core: &Usable| core.core.node, |core: &Usable| core.core.cache] {
                let mut sizes = BTreeMap::new();
                for core in &free {
                    *sizes.entry(key(core)).or_insert(0) += 1;
                }
                let groups: BTreeSet<_> = chosen.iter().map(|core| key(core)).collect();
                let node = |core: &Usable| core.core.node;
                let nodes: BTreeSet<_> = chosen.iter().map(|core| node(core)).collect();
                // A cache counts only within the node that was chosen.
                let near: Vec<_> = free.iter().filter(|core| nodes.contains(&node(core))).collect();
                let fits = near.iter().any(|core| sizes[&key(core)] >= count);
                prop_assert!(!fits || groups.len() == 1 || nodes.len() > 1);
            }
        }

        #[test]
        fn whatever_the_files_say_every_cpu_is_in_one_core(
            lists in prop::collection::vec("[0-9]{0,1}(-[0-9])?(,[0-9]){0,2}", 1..8),
        ) {
            let fixture = Fixture::new(&[]);
            let last = lists.len() - 1;
            fixture.write("sys/devices/system/cpu/online", &format!("0-{last}"));
            for (cpu, list) in lists.iter().enumerate() {
                fixture.cpu(cpu as u32, list, 0, cpu as u32 / 2);
            }
            let cores = layout(&fixture.source()).unwrap();
            let mut all: Vec<u32> = cores.iter().flat_map(|core| core.cpus.iter()).copied().collect();
            all.sort_unstable();
            prop_assert_eq!(all, (0..=last as u32).collect::<Vec<_>>());
        }
    }

    #[test]
    fn threads_never_share_a_core() {
        let place = tempfile::tempdir().unwrap();
        let topology = topology(&laptop(), "0-7");
        let taken = std::sync::Mutex::new(BTreeSet::new());
        std::thread::scope(|scope| {
            for thread in 0..6u32 {
                let (topology, taken, place) = (&topology, &taken, &place);
                scope.spawn(move || {
                    let folder = folder(place);
                    for _ in 0..30 {
                        match topology.reserve_in(&folder, 1 + thread % 2) {
                            Ok(reservation) => {
                                let watched = reservation.watched();
                                let mut all = taken.lock().unwrap();
                                assert!(watched.iter().all(|cpu| all.insert(*cpu)));
                                drop(all);
                                std::thread::yield_now();
                                let mut all = taken.lock().unwrap();
                                assert!(watched.iter().all(|cpu| all.remove(cpu)));
                            }
                            Err(NoCores::TooFew { .. }) => std::thread::yield_now(),
                            Err(other) => panic!("{other}"),
                        }
                    }
                });
            }
        });
    }

    /// What the processes of the next tests do; alone it does nothing. Stays until
    /// its input is closed.
    #[test]
    fn a_process_of_its_own() {
        let Some(place) = std::env::var_os("FLEETYARD_TEST_CORES") else {
            return;
        };
        let folder: Folder = state::below(std::path::Path::new(&place), "fleetyard", "cores", true)
            .unwrap()
            .into();
        let topology = topology(&laptop(), "0-7");
        let held = topology.reserve_in(&folder, 1);
        let text = held
            .as_ref()
            .map_or("none".into(), |held| held.mask.to_string());
        println!("\nreserved {text}");
        std::io::stdout().flush().unwrap();
        let _ = std::io::stdin().lines().next();
        let own = Topology::of_this_process().unwrap().cpus();
        let one: Cpus = own.iter().take(1).copied().collect();
        let (send, receive) = std::sync::mpsc::channel::<()>();
        let (tell, told) = std::sync::mpsc::channel();
        let other = std::thread::spawn(move || {
            let _ = receive.recv();
            tell.send(affinity(None).unwrap()).unwrap();
        });
        pin_this_process(&one).unwrap();
        send.send(()).unwrap();
        assert_eq!(told.recv().unwrap(), one);
        other.join().unwrap();
        assert_eq!(affinity(None).unwrap(), one);
        // What there is besides is not forgotten, and can be had again.
        assert_eq!(Topology::of_this_process().unwrap().cpus(), own);
        pin_this_process(&own).unwrap();
        assert_eq!(affinity(None).unwrap(), own);
    }

    fn process(place: &tempfile::TempDir) -> (Child, String) {
        let mut child = Command::new(std::env::current_exe().unwrap())
            .args([
                "--exact",
                "--nocapture",
                "measure::cores::tests::a_process_of_its_own",
            ])
            .env("FLEETYARD_TEST_CORES", place.path())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut output = BufReader::new(child.stdout.take().unwrap()).lines();
        let said =
            output.find_map(|line| Some(line.unwrap().strip_prefix("reserved ")?.to_owned()));
        // Whatever else it prints must have somewhere to go.
        std::thread::spawn(move || output.for_each(drop));
        (child, said.unwrap())
    }

    #[test]
    fn processes_never_share_a_core_and_free_it_when_they_are_killed() {
        let place = tempfile::tempdir().unwrap();
        let mut processes: Vec<_> = (0..4).map(|_| process(&place)).collect();
        let mut said: Vec<_> = processes.iter().map(|(_, said)| said.as_str()).collect();
        said.sort_unstable();
        assert_eq!(said, ["1", "2", "3", "none"]);
        let at = processes.iter().position(|(_, said)| said == "2").unwrap();
        let (mut child, _) = processes.remove(at);
        child.kill().unwrap();
        child.wait().unwrap();
        let topology = topology(&laptop(), "0-7");
        let reservation = topology.reserve_in(&folder(&place), 1).unwrap();
        assert_eq!(reservation.mask, cpus("2"));
        for (mut child, _) in processes {
            drop(child.stdin.take());
            assert!(child.wait().unwrap().success());
        }
    }

    #[test]
    fn a_thread_is_pinned_or_told_that_it_is_not() {
        std::thread::spawn(|| {
            let own = affinity(None).unwrap();
            let one: Cpus = own.iter().rev().take(1).copied().collect();
            pin(None, &one).unwrap();
            assert_eq!(affinity(None).unwrap(), one);
            for refused in [Cpus::default(), cpus("8191"), one.union(&cpus("8191"))] {
                let error = pin(None, &refused).unwrap_err();
                assert_eq!(error.kind(), io::ErrorKind::InvalidInput, "{refused}");
            }
        })
        .join()
        .unwrap();
    }

    #[test]
    fn this_machine_is_asked_without_harm() {
        match Topology::of_this_process() {
            Ok(topology) => assert!(topology.cores() as usize <= topology.cpus().len()),
            Err(reason) => assert_eq!(reason, NoCores::UnknownTopology),
        }
    }

    #[test]
    fn reasons_are_data() {
        let reason = NoCores::TooFew {
            needed: 4,
            free: 1,
            reserved: 0,
        };
        assert_eq!(
            serde_json::to_string(&reason).unwrap(),
            r#"{"reason":"too-few","needed":4,"free":1,"reserved":0}"#
        );
        assert_eq!(
            reason.to_string(),
            "needs 4 physical cores beside the host's, 1 is free"
        );
        assert!(reason.hint().is_some());
    }
}
