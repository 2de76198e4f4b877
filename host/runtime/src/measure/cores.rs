//! Reservations of physical cores for trials.
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
use std::sync::OnceLock;

use serde::Serialize;

use super::core_locks::{Folder, Lock, NoCores};
use super::cpus::{Cpus, affinity};
use super::layout::{Core, layout};
use super::source::Source;

/// A core that this process may use.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Usable {
    core: Core,
    /// Those of its CPUs that this process may use.
    own: Cpus,
}

impl Usable {
    /// The core's name, for everybody alike.
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
    /// The CPUs where the planner runs: one logical CPU of each of its cores.
    pub mask: Cpus,
    /// The other logical CPUs of those cores, which stay idle.
    pub siblings: Cpus,
    /// The CPUs where the host runs meanwhile.
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

#[cfg(test)]
mod tests;
