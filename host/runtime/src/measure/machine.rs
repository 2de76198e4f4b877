//! Facts about the machine, without which a time says nothing.
//!
//! Every fact is as the kernel tells it, and absent where it tells nothing: a
//! container may hide the firmware, a virtual machine has no governor, and ARM has
//! no model names. Nothing that identifies a person or one machine among its equals
//! (host name, serial numbers, addresses) is read.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::OnceLock;

use fleetyard_core::{Digest, Hasher};
use serde::{Deserialize, Serialize};

use super::Cpus;
use super::layout::{layout, online};
use super::source::{Source, values};

const CPU: &str = "sys/devices/system/cpu";

/// Names of vendors and products that only virtual machines have, in lower case.
const VIRTUAL: [&str; 13] = [
    "qemu",
    "kvm",
    "vmware",
    "virtualbox",
    "innotek",
    "xen",
    "bochs",
    "parallels",
    "bhyve",
    "openstack",
    "google compute engine",
    "virtual machine",
    "apple virtualization",
];

/// Texts of firmware where nobody has filled in the form.
const UNFILLED: [&str; 5] = [
    "to be filled by o.e.m.",
    "system manufacturer",
    "system product name",
    "default string",
    "not specified",
];

/// Facts about a machine that bear on its speed.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default)]
pub struct Machine {
    /// Instruction set, as `uname -m` says.
    pub architecture: Option<String>,
    /// Name of the CPU; several, if there are, joined by ` + `.
    pub cpu_model: Option<String>,
    /// Its maker.
    pub cpu_vendor: Option<String>,
    /// Numbers that identify the CPU: family, model and stepping, or implementer
    /// and part.
    pub cpu_id: Option<String>,
    /// Version of the CPU's microcode.
    pub microcode: Option<String>,
    /// Sockets with CPUs that are online.
    pub sockets: Option<u32>,
    /// Physical cores that are online.
    pub physical_cores: Option<u32>,
    /// Logical CPUs that are online.
    pub logical_cpus: Option<u32>,
    /// True if cores run several threads each.
    pub smt: Option<bool>,
    /// NUMA nodes and the CPUs of each; a node may have memory alone.
    pub numa: Option<BTreeMap<u32, Cpus>>,
    /// Driver of the kernel that sets the frequency. `mixed` when CPUs differ.
    pub scaling_driver: Option<String>,
    /// The rule by which the kernel sets the frequency. `mixed` when CPUs differ.
    pub governor: Option<String>,
    /// Hint to CPUs about speed against energy. `mixed` when they differ.
    pub energy_preference: Option<String>,
    /// True if CPUs may exceed their base frequency.
    pub turbo: Option<bool>,
    /// Lowest frequency that any CPU may run at.
    pub frequency_min_khz: Option<u64>,
    /// Highest frequency that any CPU may run at.
    pub frequency_max_khz: Option<u64>,
    /// Memory that the kernel manages, in KiB.
    pub memory_kb: Option<u64>,
    /// Release of the kernel.
    pub kernel: Option<String>,
    /// Name and version of the distribution.
    pub os: Option<String>,
    /// Clock source of the kernel.
    pub clock_source: Option<String>,
    /// True if there is a hypervisor below; absent when nothing tells.
    pub virtualised: Option<bool>,
    /// The hypervisor, by its own word.
    pub hypervisor: Option<String>,
    /// Vendor and product name of the computer or virtual machine.
    pub product: Option<String>,
    /// Kind of container around this process, as far as it shows.
    pub container: Option<String>,
}

impl Machine {
    /// This machine, read anew.
    pub fn read() -> Self {
        Self::from_source(&Source::system())
    }

    /// This machine, read once per process.
    pub fn here() -> &'static Self {
        static MACHINE: OnceLock<Machine> = OnceLock::new();
        MACHINE.get_or_init(Self::read)
    }

    /// Identifies what is known of the machine. Facts that are absent do not count,
    /// so that a later version may know more; memory counts in whole GiB, since a
    /// few KiB of it change from boot to boot.
    pub fn digest(&self) -> Digest {
        let mut rounded = self.clone();
        rounded.memory_kb = self
            .memory_kb
            .map(|kb| kb.saturating_add(1 << 19) >> 20 << 20);
        let mut hasher = Hasher::new("fleetyard machine");
        // Plain data is always writable as JSON, and its objects are sorted.
        let facts = serde_json::to_value(rounded).unwrap_or_default();
        for (name, value) in facts.as_object().into_iter().flatten() {
            if !value.is_null() {
                hasher.bytes(name.as_bytes());
                hasher.bytes(value.to_string().as_bytes());
            }
        }
        hasher.finish()
    }

    pub(super) fn from_source(source: &Source) -> Self {
        let cpuinfo = source.raw("proc/cpuinfo").unwrap_or_default();
        let cores = layout(source);
        let sockets = cores.as_ref().and_then(|cores| {
            let packages = cores.iter().map(|core| core.package);
            Some(packages.collect::<Option<BTreeSet<_>>>()?.len() as u32)
        });
        let smt = source
            .number::<u8>(&format!("{CPU}/smt/active"))
            .map(|active| active != 0);
        let shared = || Some(cores.as_ref()?.iter().any(|core| core.cpus.len() > 1));
        let frequency = Frequency::read(source);
        let product = product(source);
        let (virtualised, hypervisor) = virtualised(source, &cpuinfo, product.as_deref());
        Self {
            architecture: source.text("proc/sys/kernel/arch").or_else(|| {
                // Kernels before 6.1 tell by system call only, which knows no root.
                let known = source.exists("proc/version");
                known.then(|| rustix::system::uname().machine().to_string_lossy().into())
            }),
            cpu_model: ["model name", "cpu model", "cpu", "uarch"]
                .iter()
                .find_map(|key| distinct(&cpuinfo, key)),
            cpu_vendor: distinct(&cpuinfo, "vendor_id"),
            cpu_id: cpu_id(&cpuinfo),
            microcode: distinct(&cpuinfo, "microcode"),
            sockets,
            physical_cores: cores.as_ref().map(|cores| cores.len() as u32),
            logical_cpus: online(source, &cpuinfo)
                .map(|cpus| cpus.len() as u32)
                .filter(|count| *count > 0),
            smt: smt.or_else(shared),
            numa: numa(source),
            scaling_driver: frequency.driver,
            governor: frequency.governor,
            energy_preference: frequency.energy_preference,
            turbo: turbo(source),
            frequency_min_khz: frequency.min_khz,
            frequency_max_khz: frequency.max_khz,
            memory_kb: memory_kb(source),
            kernel: source.text("proc/sys/kernel/osrelease"),
            os: os(source),
            clock_source: source
                .text("sys/devices/system/clocksource/clocksource0/current_clocksource"),
            virtualised,
            hypervisor,
            product,
            container: container(source),
        }
    }
}

/// All different values of a key, in order, with single blanks.
fn distinct(cpuinfo: &str, key: &str) -> Option<String> {
    let mut seen: Vec<&str> = Vec::new();
    for value in values(cpuinfo, key) {
        if !value.is_empty() && !seen.contains(&value) {
            seen.push(value);
        }
    }
    let clean = |value: &str| value.split_whitespace().collect::<Vec<_>>().join(" ");
    let all: Vec<String> = seen.into_iter().map(clean).collect();
    (!all.is_empty()).then(|| all.join(" + "))
}

fn cpu_id(cpuinfo: &str) -> Option<String> {
    const X86: [(&str, &str); 3] = [
        ("cpu family", "family"),
        ("model", "model"),
        ("stepping", "stepping"),
    ];
    const ARM: [(&str, &str); 4] = [
        ("CPU implementer", "implementer"),
        ("CPU part", "part"),
        ("CPU variant", "variant"),
        ("CPU revision", "revision"),
    ];
    let mut seen: Vec<String> = Vec::new();
    for block in cpuinfo.split("\n\n") {
        let words: Vec<String> = X86
            .iter()
            .chain(&ARM)
            .filter_map(|(key, name)| Some(format!("{name} {}", values(block, key).next()?)))
            .collect();
        let id = words.join(" ");
        if !id.is_empty() && !seen.contains(&id) {
            seen.push(id);
        }
    }
    (!seen.is_empty()).then(|| seen.join(" + "))
}

fn numa(source: &Source) -> Option<BTreeMap<u32, Cpus>> {
    let folder = "sys/devices/system/node";
    let nodes = source.numbered(folder, "node").into_iter();
    let nodes: Option<BTreeMap<u32, Cpus>> = nodes
        .map(|node| Some((node, source.cpus(&format!("{folder}/node{node}/cpulist"))?)))
        .collect();
    nodes.filter(|nodes| !nodes.is_empty())
}

#[derive(Default)]
struct Frequency {
    driver: Option<String>,
    governor: Option<String>,
    energy_preference: Option<String>,
    min_khz: Option<u64>,
    max_khz: Option<u64>,
}

impl Frequency {
    fn read(source: &Source) -> Self {
        let folder = format!("{CPU}/cpufreq");
        let policies = source.numbered(&folder, "policy");
        // Reading the current frequency, alone of these, would interrupt the CPUs.
        let all = |name: &str| -> Vec<String> {
            let paths = policies
                .iter()
                .map(|n| format!("{folder}/policy{n}/{name}"));
            paths.filter_map(|path| source.text(&path)).collect()
        };
        let same = |name: &str| {
            let mut values = all(name).into_iter();
            let first = values.next()?;
            Some(if values.all(|value| value == first) {
                first
            } else {
                "mixed".into()
            })
        };
        let numbers = |name: &str| -> Vec<u64> {
            let values = all(name).into_iter();
            values.filter_map(|value| value.parse().ok()).collect()
        };
        Self {
            driver: same("scaling_driver"),
            governor: same("scaling_governor"),
            energy_preference: same("energy_performance_preference"),
            min_khz: numbers("scaling_min_freq").into_iter().min(),
            max_khz: numbers("scaling_max_freq").into_iter().max(),
        }
    }
}

fn turbo(source: &Source) -> Option<bool> {
    let off = source.number::<u8>(&format!("{CPU}/intel_pstate/no_turbo"));
    let on = || source.number::<u8>(&format!("{CPU}/cpufreq/boost"));
    off.map(|off| off == 0).or_else(|| on().map(|on| on != 0))
}

fn memory_kb(source: &Source) -> Option<u64> {
    let meminfo = source.raw("proc/meminfo")?;
    let total = values(&meminfo, "MemTotal").next()?;
    total.strip_suffix("kB")?.trim_end().parse().ok()
}

fn os(source: &Source) -> Option<String> {
    let release = source
        .raw("etc/os-release")
        .or_else(|| source.raw("usr/lib/os-release"))?;
    let name = release
        .lines()
        .find_map(|line| line.trim().strip_prefix("PRETTY_NAME="))?;
    let name = name.trim_matches(['"', '\'']).trim();
    (!name.is_empty()).then(|| name.to_owned())
}

fn product(source: &Source) -> Option<String> {
    let known = |name: &str| {
        let text = source.text(&format!("sys/class/dmi/id/{name}"))?;
        (!UNFILLED.contains(&text.to_lowercase().as_str())).then_some(text)
    };
    let words: Vec<String> = ["sys_vendor", "product_name"]
        .into_iter()
        .filter_map(known)
        .collect();
    if words.is_empty() {
        // Boards without such firmware have a device tree.
        return source.text("proc/device-tree/model");
    }
    Some(words.join(" "))
}

fn virtualised(
    source: &Source,
    cpuinfo: &str,
    product: Option<&str>,
) -> (Option<bool>, Option<String>) {
    let hypervisor = source
        .text("sys/hypervisor/type")
        .or_else(|| source.text("proc/device-tree/hypervisor/compatible"));
    let flags = values(cpuinfo, "flags").next();
    let flagged = flags.map(|flags| flags.split(' ').any(|flag| flag == "hypervisor"));
    let product = product.map(str::to_lowercase);
    let named = product.is_some_and(|product| {
        VIRTUAL.iter().any(|name| product.contains(name))
            || product.contains("amazon ec2") && !product.contains(".metal")
    });
    if hypervisor.is_some() || named || flagged == Some(true) {
        return (Some(true), hypervisor);
    }
    // Without the flag of x86, silence proves nothing.
    (flagged, None)
}

fn container(source: &Source) -> Option<String> {
    if let Some(kind) = source.text("run/systemd/container") {
        return Some(kind);
    }
    let markers = [
        (".dockerenv", "docker"),
        ("run/.containerenv", "podman"),
        (".singularity.d", "apptainer"),
    ];
    if let Some((_, kind)) = markers.iter().find(|(path, _)| source.exists(path)) {
        return Some((*kind).into());
    }
    let groups = source.raw("proc/self/cgroup")?;
    ["kubepods", "docker", "libpod", "lxc", "containerd"]
        .iter()
        .find(|kind| groups.contains(**kind))
        .map(|kind| (*kind).into())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::fixture::{Fixture, laptop, server};
    use serde_json::{Value, json};

    /// The facts that are known, as a record shows them.
    fn known(fixture: &Fixture) -> Value {
        let mut facts = serde_json::to_value(Machine::from_source(&fixture.source())).unwrap();
        facts.as_object_mut().unwrap().retain(|_, v| !v.is_null());
        facts
    }

    #[test]
    fn a_laptop_with_smt() {
        let expected = json!({
            "architecture": "x86_64",
            "cpu_model": "Intel(R) Core(TM) i7-8550U CPU @ 1.80GHz",
            "cpu_vendor": "GenuineIntel",
            "cpu_id": "family 6 model 142 stepping 10",
            "microcode": "0xf6",
            "sockets": 1,
            "physical_cores": 4,
            "logical_cpus": 8,
            "smt": true,
            "numa": {"0": "0-7"},
            "scaling_driver": "intel_pstate",
            "governor": "powersave",
            "turbo": true,
            "frequency_min_khz": 400_000,
            "frequency_max_khz": 4_000_000,
            "memory_kb": 16_219_496,
            "kernel": "6.8.0-45-generic",
            "os": "Ubuntu 24.04.1 LTS",
            "clock_source": "tsc",
            "virtualised": false,
            "product": "LENOVO 20L5CTO1WW",
        });
        assert_eq!(known(&laptop()), expected);
    }

    #[test]
    fn a_server_with_two_sockets() {
        let expected = json!({
            "cpu_model": "AMD EPYC 7302 16-Core Processor",
            "cpu_vendor": "AuthenticAMD",
            "sockets": 2,
            "physical_cores": 7,
            "logical_cpus": 7,
            "smt": false,
            "numa": {"0": "0-3", "1": "4-6", "2": ""},
            "scaling_driver": "intel_pstate",
            "governor": "mixed",
            "turbo": false,
            "frequency_min_khz": 1_500_000,
            "frequency_max_khz": 3_000_000,
            "memory_kb": 263_841_024,
            "kernel": "5.14.0-427.el9.x86_64",
            "os": "Rocky Linux 9.4 (Blue Onyx)",
            "virtualised": false,
            "product": "Dell Inc. PowerEdge R6525",
        });
        assert_eq!(known(&server()), expected);
    }

    #[test]
    fn an_arm_board_has_no_model_name() {
        let cpu = |n: u32, part: &str| {
            format!(
                "processor\t: {n}\nFeatures\t: fp asimd\nCPU implementer\t: 0x41\n\
                 CPU architecture: 8\nCPU variant\t: 0x0\nCPU part\t: {part}\nCPU revision\t: 3\n\n"
            )
        };
        let cpuinfo = cpu(0, "0xd08") + &cpu(1, "0xd08") + &cpu(2, "0xd03");
        let fixture = Fixture::new(&[
            ("proc/cpuinfo", &cpuinfo),
            ("proc/sys/kernel/arch", "aarch64"),
            ("sys/devices/system/cpu/online", "0-2"),
            ("proc/device-tree/model", "Rockchip RK3399\0"),
        ]);
        for cpu in 0..3 {
            // Some firmware gives no socket.
            fixture.cpu(cpu, &cpu.to_string(), -1, cpu);
        }
        let expected = json!({
            "architecture": "aarch64",
            "cpu_id": "implementer 0x41 part 0xd08 variant 0x0 revision 3 \
                       + implementer 0x41 part 0xd03 variant 0x0 revision 3",
            "physical_cores": 3,
            "logical_cpus": 3,
            "smt": false,
            "product": "Rockchip RK3399",
        });
        assert_eq!(known(&fixture), expected);
    }

    #[test]
    fn virtual_machines_are_told_by_flag_firmware_or_hypervisor() {
        let dmi = |vendor, product| {
            Fixture::new(&[
                ("sys/class/dmi/id/sys_vendor", vendor),
                ("sys/class/dmi/id/product_name", product),
            ])
        };
        let cpuinfo = |flags| Fixture::new(&[("proc/cpuinfo", flags)]);
        let cases = [
            (cpuinfo("flags\t: fpu hypervisor lm"), Some(true)),
            (cpuinfo("flags\t: fpu lm"), Some(false)),
            (cpuinfo("Features\t: fp asimd"), None),
            (dmi("QEMU", "Standard PC (Q35 + ICH9, 2009)"), Some(true)),
            (dmi("Microsoft Corporation", "Virtual Machine"), Some(true)),
            (dmi("Microsoft Corporation", "Surface Laptop 5"), None),
            (dmi("Amazon EC2", "m7g.large"), Some(true)),
            (dmi("Amazon EC2", "m7g.metal"), None),
            (dmi("To Be Filled By O.E.M.", "Default string"), None),
        ];
        for (fixture, expected) in cases {
            let machine = Machine::from_source(&fixture.source());
            assert_eq!(machine.virtualised, expected, "{machine:?}");
        }
        let xen = Fixture::new(&[
            ("sys/hypervisor/type", "xen"),
            (".dockerenv", ""),
            ("run/systemd/container", "lxc"),
        ]);
        let machine = Machine::from_source(&xen.source());
        assert_eq!(machine.hypervisor.as_deref(), Some("xen"));
        assert_eq!(machine.container.as_deref(), Some("lxc"));
    }

    #[test]
    fn a_machine_that_tells_nothing_has_no_facts() {
        let fixture = Fixture::new(&[]);
        assert_eq!(known(&fixture), json!({}));
        // Nor does one that tells nonsense.
        let fixture = Fixture::new(&[
            ("proc/cpuinfo", ":\n::\nprocessor : x\n"),
            ("proc/meminfo", "MemTotal: many"),
            ("etc/os-release", "PRETTY_NAME=\"\""),
            ("sys/devices/system/cpu/online", "all"),
            ("sys/devices/system/cpu/smt/active", "maybe"),
            ("sys/devices/system/node/node0/cpulist", "9-1"),
            (
                "sys/devices/system/cpu/cpufreq/policy0/scaling_min_freq",
                "low",
            ),
        ]);
        assert_eq!(known(&fixture), json!({}));
    }

    #[test]
    fn the_digest_is_of_what_is_known() {
        let machine = Machine::from_source(&laptop().source());
        let rebooted = Machine {
            memory_kb: machine.memory_kb.map(|kb| kb - 64),
            ..machine.clone()
        };
        assert_eq!(machine.digest(), rebooted.digest());
        let throttled = Machine {
            turbo: Some(false),
            ..machine.clone()
        };
        assert_ne!(machine.digest(), throttled.digest());
        let silent = Machine {
            turbo: None,
            ..machine.clone()
        };
        assert_ne!(machine.digest(), silent.digest());
        let text = serde_json::to_string(&machine).unwrap();
        assert_eq!(serde_json::from_str::<Machine>(&text).unwrap(), machine);
    }

    #[test]
    fn this_machine_has_cpus() {
        let machine = Machine::here();
        assert_ne!(machine.logical_cpus, Some(0));
        assert_eq!(machine.kernel, Machine::read().kernel);
    }
}
