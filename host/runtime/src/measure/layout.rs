//! The physical cores of the machine: their CPUs, sockets, nodes, caches and kinds.

use std::collections::BTreeMap;

use super::Cpus;
use super::source::{Source, values};

/// A core with less than this share of the strongest core's capacity is a slow
/// one. Favoured cores of one kind differ by a few percent, kinds by half.
const FAST: f64 = 0.8;

/// One physical core as the machine tells.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Core {
    /// Its logical CPUs that are online.
    pub(super) cpus: Cpus,
    /// The socket.
    pub(super) package: Option<u32>,
    /// The NUMA node.
    pub(super) node: Option<u32>,
    /// The lowest CPU that shares the last-level cache.
    pub(super) cache: Option<u32>,
    pub(super) slow: bool,
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
