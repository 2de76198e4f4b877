//! Machines written to a temporary folder.

use std::fmt::Write as _;
use std::fs;

use super::source::Source;

/// A folder that looks like `/`.
pub(super) struct Fixture(tempfile::TempDir);

impl Fixture {
    pub(super) fn new(files: &[(&str, &str)]) -> Self {
        let fixture = Self(tempfile::tempdir().unwrap());
        for (path, text) in files {
            fixture.write(path, text);
        }
        fixture
    }

    pub(super) fn write(&self, path: &str, text: &str) {
        let path = self.0.path().join(path);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, format!("{text}\n")).unwrap();
    }

    pub(super) fn source(&self) -> Source {
        Source::at(self.0.path())
    }

    /// Topology files of one CPU.
    pub(super) fn cpu(&self, cpu: u32, siblings: &str, package: i32, core: u32) {
        let folder = format!("sys/devices/system/cpu/cpu{cpu}/topology");
        self.write(&format!("{folder}/thread_siblings_list"), siblings);
        self.write(
            &format!("{folder}/physical_package_id"),
            &package.to_string(),
        );
        self.write(&format!("{folder}/core_id"), &core.to_string());
    }

    /// Frequency files of one CPU, in the policy of its own number.
    pub(super) fn policy(&self, cpu: u32, governor: &str, min: u32, max: u32) {
        let folder = format!("sys/devices/system/cpu/cpufreq/policy{cpu}");
        self.write(&format!("{folder}/scaling_governor"), governor);
        self.write(&format!("{folder}/scaling_driver"), "intel_pstate");
        self.write(&format!("{folder}/scaling_min_freq"), &min.to_string());
        self.write(&format!("{folder}/scaling_max_freq"), &max.to_string());
    }
}

/// Four cores with two threads each, numbered as Intel does.
pub(super) fn laptop() -> Fixture {
    let mut cpuinfo = String::new();
    for cpu in 0..8 {
        let _ = writeln!(
            cpuinfo,
            "processor\t: {cpu}\nvendor_id\t: GenuineIntel\ncpu family\t: 6\nmodel\t\t: 142\n\
             model name\t: Intel(R) Core(TM)  i7-8550U CPU @ 1.80GHz\nstepping\t: 10\n\
             microcode\t: 0xf6\nflags\t\t: fpu vme de pse\n"
        );
    }
    let fixture = Fixture::new(&[
        ("proc/cpuinfo", &cpuinfo),
        (
            "proc/meminfo",
            "MemTotal:       16219496 kB\nMemFree: 123 kB",
        ),
        ("proc/sys/kernel/osrelease", "6.8.0-45-generic"),
        ("proc/sys/kernel/arch", "x86_64"),
        (
            "etc/os-release",
            "NAME=\"Ubuntu\"\nPRETTY_NAME=\"Ubuntu 24.04.1 LTS\"",
        ),
        ("sys/devices/system/cpu/online", "0-7"),
        ("sys/devices/system/cpu/smt/active", "1"),
        ("sys/devices/system/cpu/intel_pstate/no_turbo", "0"),
        ("sys/devices/system/node/node0/cpulist", "0-7"),
        (
            "sys/devices/system/clocksource/clocksource0/current_clocksource",
            "tsc",
        ),
        ("sys/class/dmi/id/sys_vendor", "LENOVO"),
        ("sys/class/dmi/id/product_name", "20L5CTO1WW"),
    ]);
    for cpu in 0..8 {
        let core = cpu % 4;
        fixture.cpu(cpu, &format!("{core},{}", core + 4), 0, core);
        fixture.policy(cpu, "powersave", 400_000, 4_000_000);
    }
    fixture
}

/// Two sockets of four cores without SMT, a NUMA node each, CPU 7 offline.
pub(super) fn server() -> Fixture {
    let cpuinfo = "model name\t: AMD EPYC 7302 16-Core Processor\nvendor_id\t: AuthenticAMD\n\
                   flags\t\t: fpu vme svm\n";
    let fixture = Fixture::new(&[
        ("proc/cpuinfo", cpuinfo),
        ("proc/meminfo", "MemTotal: 263841024 kB"),
        ("proc/sys/kernel/osrelease", "5.14.0-427.el9.x86_64"),
        (
            "usr/lib/os-release",
            "PRETTY_NAME='Rocky Linux 9.4 (Blue Onyx)'",
        ),
        ("sys/devices/system/cpu/online", "0-6"),
        ("sys/devices/system/cpu/cpufreq/boost", "0"),
        ("sys/devices/system/node/node0/cpulist", "0-3"),
        ("sys/devices/system/node/node1/cpulist", "4-6"),
        ("sys/devices/system/node/node2/cpulist", ""),
        ("sys/class/dmi/id/sys_vendor", "Dell Inc."),
        ("sys/class/dmi/id/product_name", "PowerEdge R6525"),
    ]);
    for cpu in 0..7 {
        // The numbers of cores repeat from socket to socket.
        fixture.cpu(cpu, &cpu.to_string(), (cpu / 4) as i32, cpu % 4);
        let governor = if cpu == 3 { "schedutil" } else { "performance" };
        fixture.policy(cpu, governor, 1_500_000, 3_000_000);
    }
    fixture
}
