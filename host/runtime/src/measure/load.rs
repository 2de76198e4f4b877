//! What else happened on the machine while a trial ran, and whether its times can
//! be trusted.
//!
//! A [`Snapshot`] of the kernel's counters before and one after give a
//! [`Difference`]; [`contended`] judges it. The counters are the kernel's own, of
//! the machine or of single CPUs, so they see other users, other containers and,
//! as stolen time, other virtual machines. They do not see shared caches, memory
//! bandwidth, or a frequency that sank.
//!
//! Times from `/proc/stat` come in ticks, mostly of 10 ms: a trial shorter than a
//! few of them can hardly be found contended.

use std::fmt;
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::Cpus;
use super::source::Source;

/// From when on something counts as contention: a share of the time, and never less
/// than a fixed time that measurement itself blurs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Threshold {
    /// Share of the time that was looked at.
    pub share: f64,
    /// What is too little to tell, in milliseconds.
    pub at_least_ms: f64,
}

/// Time that the hypervisor gave to others, per thread of the trial. It is lost as a
/// whole and in no planner's power, so one percent is already as much as planners
/// differ by. Two ticks may be rounding.
pub const STEAL: Threshold = Threshold {
    share: 0.01,
    at_least_ms: 20.0,
};

/// Time in which some task of the machine waited for a CPU, judged only where the
/// trial's own run delay is not known. The host's and the kernel's short tasks alone
/// make a percent or two.
pub const PRESSURE_CPU: Threshold = Threshold {
    share: 0.05,
    at_least_ms: 20.0,
};

/// Time in which some task waited for memory to be reclaimed or read back. A machine
/// with memory to spare shows none at all.
pub const PRESSURE_MEMORY: Threshold = Threshold {
    share: 0.01,
    at_least_ms: 10.0,
};

/// Time in which some task waited for a disk. A planner hardly reads, so what others
/// read touches it little, and logging alone makes some percent: only a disk that is
/// busy for a good part of the time counts.
pub const PRESSURE_IO: Threshold = Threshold {
    share: 0.2,
    at_least_ms: 50.0,
};

/// Time that the trial's threads were ready to run and did not, by the scheduler's
/// exact count. A process that starts and answers waits for a CPU a few times, some
/// tens of microseconds each; a larger allowance would leave short trials unmarked that
/// are disturbed as much as long ones.
pub const RUN_DELAY: Threshold = Threshold {
    share: 0.02,
    at_least_ms: 0.2,
};

/// Time of a single thread that was not CPU time, where its run delay is not known.
/// Waiting for the host's answers and reading files is in it, so it takes more.
pub const NOT_RUNNING: Threshold = Threshold {
    share: 0.05,
    at_least_ms: 20.0,
};

/// Time in which the CPU was too hot, or the control group had used up its quota:
/// all of it is lost, or runs at a fraction of the speed.
pub const THROTTLED: Threshold = Threshold {
    share: 0.01,
    at_least_ms: 5.0,
};

/// CPU time that others used on the trial's cores. Interrupts and the kernel's own
/// threads make a percent; ticks on both ends blur some tens of milliseconds.
pub const NEIGHBOUR: Threshold = Threshold {
    share: 0.03,
    at_least_ms: 50.0,
};

/// Time of the compared call in which the host's own thread was ready to run and did not, by the
/// scheduler's exact count: an answer that lies there looks like a slow planner. The supervisors of
/// plugins run on the host's core, and make it wait for a tenth of a millisecond.
pub const HOST_WAITED: Threshold = Threshold {
    share: 0.02,
    at_least_ms: 0.2,
};

/// Time of that call in which neither the plugin nor the host was at work, counted in nanoseconds.
/// To wake each other costs both sides some ten microseconds.
pub const HANDOVER: Threshold = Threshold {
    share: 0.02,
    at_least_ms: 0.05,
};

impl Threshold {
    fn ms(self, time_ms: f64) -> f64 {
        (self.share * time_ms).max(self.at_least_ms)
    }
}

/// The kernel's counters at one moment.
#[derive(Debug, Clone)]
pub struct Snapshot {
    at: Instant,
    cpus: Option<Cpus>,
    ticks: Option<Ticks>,
    pressure: Pressures,
    load: Option<[f64; 3]>,
    /// Of each CPU.
    thermal: Vec<Thermal>,
    /// Of our control group and those above it.
    quota: Vec<Quota>,
}

/// Times of some CPUs together, in the unit of `/proc/stat`.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Ticks {
    busy: u64,
    steal: Option<u64>,
}

/// How long tasks were stalled for want of something, in microseconds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pressure {
    /// At least one task was.
    pub some_us: u64,
    /// All tasks that had something to do were. Of CPUs there is no such time: some
    /// task has them.
    pub full_us: Option<u64>,
}

/// Pressure of the whole machine; absent where the kernel does not count it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Pressures {
    /// Waiting for a CPU.
    pub cpu: Option<Pressure>,
    /// Waiting for memory.
    pub memory: Option<Pressure>,
    /// Waiting for disks.
    pub io: Option<Pressure>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Thermal {
    core_events: Option<u64>,
    core_ms: Option<u64>,
    package_events: Option<u64>,
    package_ms: Option<u64>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Quota {
    events: Option<u64>,
    us: Option<u64>,
}

impl Snapshot {
    /// The counters now: those of the given CPUs where the kernel keeps them apart,
    /// else of all.
    pub fn take(cpus: Option<&Cpus>) -> Self {
        Self::from_source(&Source::system(), cpus)
    }

    fn from_source(source: &Source, cpus: Option<&Cpus>) -> Self {
        let stat = source.raw("proc/stat").unwrap_or_default();
        let pressure = |name| read_pressure(&source.raw(&format!("proc/pressure/{name}"))?);
        Self {
            at: Instant::now(),
            cpus: cpus.cloned(),
            ticks: Ticks::read(&stat, cpus),
            pressure: Pressures {
                // The second line of this one is there, and always zero.
                cpu: pressure("cpu").map(|cpu| Pressure {
                    full_us: None,
                    ..cpu
                }),
                memory: pressure("memory"),
                io: pressure("io"),
            },
            load: source.text("proc/loadavg").and_then(|text| {
                let mut numbers = text.split(' ').map_while(|number| number.parse().ok());
                Some([numbers.next()?, numbers.next()?, numbers.next()?])
            }),
            thermal: read_thermal(source, &stat, cpus),
            quota: read_quota(source),
        }
    }

    /// What the counters gained since an earlier snapshot of the same CPUs.
    pub fn since(&self, before: &Self) -> Difference {
        self.since_at(before, rustix::param::clock_ticks_per_second())
    }

    fn since_at(&self, before: &Self, hertz: u64) -> Difference {
        let same = self.cpus == before.cpus;
        let ticks = self.ticks.zip(before.ticks).filter(|_| same);
        let ms = |ticks: u64| ticks.saturating_mul(1000) / hertz.max(1);
        // Some counters of the kernel go back a little at times.
        let gained = |now: Option<u64>, then: Option<u64>| Some(now?.saturating_sub(then?));
        let pressure = |now: Option<Pressure>, then: Option<Pressure>| {
            let (now, then) = (now?, then?);
            Some(Pressure {
                some_us: now.some_us.saturating_sub(then.some_us),
                full_us: gained(now.full_us, then.full_us),
            })
        };
        let thermal = || {
            let pairs = self.thermal.iter().zip(&before.thermal);
            pairs.filter(|_| same && self.thermal.len() == before.thermal.len())
        };
        let quota = || {
            let pairs = self.quota.iter().zip(&before.quota);
            pairs.filter(|_| self.quota.len() == before.quota.len())
        };
        Difference {
            elapsed_ms: self.at.saturating_duration_since(before.at).as_secs_f64() * 1000.0,
            cpus: self.cpus.clone(),
            steal_ms: ticks
                .and_then(|(now, then)| gained(now.steal, then.steal))
                .map(ms),
            busy_ms: ticks.map(|(now, then)| ms(now.busy.saturating_sub(then.busy))),
            pressure: Pressures {
                cpu: pressure(self.pressure.cpu, before.pressure.cpu),
                memory: pressure(self.pressure.memory, before.pressure.memory),
                io: pressure(self.pressure.io, before.pressure.io),
            },
            load_before: before.load,
            load_after: self.load,
            // Threads of a core and cores of a package count the same events.
            thermal_events: thermal()
                .flat_map(|(now, then)| {
                    [
                        gained(now.core_events, then.core_events),
                        gained(now.package_events, then.package_events),
                    ]
                })
                .flatten()
                .max(),
            thermal_ms: thermal()
                .flat_map(|(now, then)| {
                    [
                        gained(now.core_ms, then.core_ms),
                        gained(now.package_ms, then.package_ms),
                    ]
                })
                .flatten()
                .max(),
            quota_events: quota()
                .filter_map(|(now, then)| gained(now.events, then.events))
                .max(),
            quota_us: quota()
                .filter_map(|(now, then)| gained(now.us, then.us))
                .max(),
        }
    }
}

impl Ticks {
    /// The sum over these CPUs, or all; absent when one of them is not there.
    fn read(stat: &str, cpus: Option<&Cpus>) -> Option<Self> {
        let mut sum = Self {
            busy: 0,
            steal: Some(0),
        };
        let mut missing = cpus.map_or(1, |cpus| cpus.len());
        for line in stat.lines() {
            let Some(rest) = line.strip_prefix("cpu") else {
                break;
            };
            let mut fields = rest.split(' ');
            let name = fields.next()?;
            let wanted = match cpus {
                None => name.is_empty(),
                Some(cpus) => name.parse().is_ok_and(|cpu| cpus.has(cpu)),
            };
            if !wanted {
                continue;
            }
            missing = missing.saturating_sub(1);
            // user nice system idle iowait irq softirq steal; guests' time is in
            // user and nice already.
            let fields = fields.filter(|field| !field.is_empty());
            let times: Vec<u64> = fields.map_while(|field| field.parse().ok()).collect();
            let [user, nice, system, _idle, _iowait, irq, softirq, rest @ ..] = times.as_slice()
            else {
                return None;
            };
            for time in [user, nice, system, irq, softirq] {
                sum.busy = sum.busy.saturating_add(*time);
            }
            let steal = rest.first();
            sum.steal = sum.steal.and_then(|sum| sum.checked_add(*steal?));
        }
        (missing == 0).then_some(sum)
    }
}

fn read_pressure(text: &str) -> Option<Pressure> {
    let total = |kind: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(kind))?;
        let mut words = line.split_whitespace();
        words.find_map(|word| word.strip_prefix("total=")?.parse::<u64>().ok())
    };
    Some(Pressure {
        some_us: total("some ")?,
        full_us: total("full "),
    })
}

fn read_thermal(source: &Source, stat: &str, cpus: Option<&Cpus>) -> Vec<Thermal> {
    const CPU: &str = "sys/devices/system/cpu";
    if !source.exists(&format!("{CPU}/cpu0/thermal_throttle")) {
        return Vec::new();
    }
    let every = || {
        let names = stat.lines().map_while(|line| line.strip_prefix("cpu"));
        names
            .filter_map(|line| line.split(' ').next()?.parse().ok())
            .collect()
    };
    let cpus = cpus.cloned().unwrap_or_else(every);
    let read = |cpu: &u32| {
        let number = |name| source.number(&format!("{CPU}/cpu{cpu}/thermal_throttle/{name}"));
        Thermal {
            core_events: number("core_throttle_count"),
            core_ms: number("core_throttle_total_time_ms"),
            package_events: number("package_throttle_count"),
            package_ms: number("package_throttle_total_time_ms"),
        }
    };
    cpus.iter().map(read).collect()
}

/// Counters of our group of cgroup v2 and of all above it that can be seen: a quota
/// anywhere on the way stops us.
fn read_quota(source: &Source) -> Vec<Quota> {
    let groups = source.raw("proc/self/cgroup").unwrap_or_default();
    let Some(group) = groups.lines().find_map(|line| line.strip_prefix("0::")) else {
        return Vec::new();
    };
    let mounts = ["sys/fs/cgroup", "sys/fs/cgroup/unified"];
    let mut mounts = mounts.into_iter();
    let Some(mount) = mounts.find(|mount| source.exists(&format!("{mount}/cgroup.controllers")))
    else {
        return Vec::new();
    };
    // A group outside of our namespace begins with `/..` and cannot be seen.
    let parts = group.split('/').filter(|part| !part.is_empty());
    let mut folder = mount.to_owned();
    let mut quotas = Vec::new();
    for part in std::iter::once("").chain(parts.take_while(|part| *part != "..")) {
        if !part.is_empty() {
            folder.push('/');
            folder.push_str(part);
        }
        let Some(stat) = source.raw(&format!("{folder}/cpu.stat")) else {
            continue;
        };
        let number = |key: &str| {
            let line = stat.lines().find_map(|line| line.strip_prefix(key))?;
            line.strip_prefix(' ')?.parse().ok()
        };
        quotas.push(Quota {
            events: number("nr_throttled"),
            us: number("throttled_usec"),
        });
    }
    quotas
}

/// What happened between two snapshots.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Difference {
    /// Time between them.
    pub elapsed_ms: f64,
    /// The CPUs that were watched; all, when absent.
    pub cpus: Option<Cpus>,
    /// Time that the hypervisor withheld from those CPUs.
    pub steal_ms: Option<u64>,
    /// CPU time of everybody on those CPUs, the trial's included.
    pub busy_ms: Option<u64>,
    /// Stalls on the whole machine.
    pub pressure: Pressures,
    /// Load averages over 1, 5 and 15 minutes at the beginning.
    pub load_before: Option<[f64; 3]>,
    /// And at the end.
    pub load_after: Option<[f64; 3]>,
    /// How often one of those CPUs was too hot.
    pub thermal_events: Option<u64>,
    /// For how long.
    pub thermal_ms: Option<u64>,
    /// In how many periods our control group had used up its quota.
    pub quota_events: Option<u64>,
    /// How long it was stopped.
    pub quota_us: Option<u64>,
}

impl Difference {
    /// CPU time that others than the trial, which used `cpu`, used on its CPUs;
    /// absent when the trial had none of its own.
    pub fn neighbours_ms(&self, cpu: Duration) -> Option<f64> {
        self.cpus.as_ref()?;
        let busy = self.busy_ms? as f64;
        Some((busy - milliseconds(cpu)).max(0.0))
    }
}

/// What a trial used between the same two snapshots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Spent {
    /// Its wall time.
    pub wall: Duration,
    /// CPU time of its whole process tree, in user mode and in the kernel.
    pub cpu: Option<Duration>,
    /// Time that its threads were ready to run and did not.
    pub run_delay: Option<Duration>,
    /// How many threads it was allowed to compute with.
    pub threads: u32,
    /// The call that is compared.
    pub call: Call,
}

/// A call of a plugin: how long it took by the host's clock, and who was at work meanwhile.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Call {
    /// Wall time by the host's clock.
    pub wall: Duration,
    /// Wall time as the plugin's process claims it, without transport.
    pub claimed: Option<Duration>,
    /// CPU time of the plugin's processes.
    pub cpu: Option<Duration>,
    /// CPU time of the host's thread.
    pub host_cpu: Option<Duration>,
    /// Time that the host's thread was ready to run and did not.
    pub host_run_delay: Option<Duration>,
}

impl Call {
    /// Time in which neither side was at work, in milliseconds. Transport is work: who writes and
    /// reads much has the CPU time for it. A claim can shorten this only as far as the
    /// plugin did not compute, so that it gains nothing by claiming too little.
    fn handover_ms(&self) -> Option<f64> {
        let plugin = self.claimed?.max(self.cpu?);
        let idle = self.wall.saturating_sub(plugin + self.host_cpu?);
        Some(milliseconds(idle))
    }
}

/// What makes a time doubtful.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cause {
    /// The hypervisor gave CPU time to others.
    Steal,
    /// Tasks waited for CPUs.
    PressureCpu,
    /// Tasks waited for memory.
    PressureMemory,
    /// Tasks waited for disks.
    PressureIo,
    /// The trial was ready to run and did not.
    Waited,
    /// A CPU was too hot, or a quota was used up.
    Throttled,
    /// Somebody else used the trial's cores.
    BusyNeighbour,
    /// The host was ready to run and did not.
    HostWaited,
    /// A request or an answer lay there, and nobody was at work.
    Handover,
}

impl fmt::Display for Cause {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Steal => "steal",
            Self::PressureCpu => "pressure-cpu",
            Self::PressureMemory => "pressure-memory",
            Self::PressureIo => "pressure-io",
            Self::Waited => "waited",
            Self::Throttled => "throttled",
            Self::BusyNeighbour => "busy-neighbour",
            Self::HostWaited => "host-waited",
            Self::Handover => "handover",
        })
    }
}

/// Why a trial counts as contended.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reason {
    /// What happened.
    pub cause: Cause,
    /// For how long.
    pub ms: f64,
    /// The longest that would have passed.
    pub limit_ms: f64,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            cause,
            ms,
            limit_ms,
        } = self;
        let digits = if *limit_ms < 1.0 { 2 } else { 1 };
        write!(
            f,
            "{cause}: {ms:.digits$} ms, more than {limit_ms:.digits$} ms"
        )
    }
}

/// Why a trial's times cannot be compared with others, in the order of [`Cause`];
/// empty when nothing is known against them.
pub fn contended(difference: &Difference, spent: &Spent) -> Vec<Reason> {
    let Difference { pressure, .. } = difference;
    let elapsed = difference.elapsed_ms;
    let threads = f64::from(spent.threads.max(1));
    let stalled = |pressure: Option<Pressure>| Some(pressure?.some_us as f64 / 1000.0);
    let wall = milliseconds(spent.wall);
    let call = milliseconds(spent.call.wall);
    // What the trial's threads got less than they might have had. More threads than
    // cores delay each other, and only this can be others' doing.
    let idle = spent
        .cpu
        .map(|cpu| (threads * wall - milliseconds(cpu)).max(0.0));
    let waited = match (spent.run_delay, idle) {
        (Some(delay), Some(idle)) => Some((RUN_DELAY, milliseconds(delay).min(idle), threads)),
        (Some(delay), None) => Some((RUN_DELAY, milliseconds(delay), threads)),
        (None, Some(idle)) if spent.threads <= 1 => Some((NOT_RUNNING, idle, 1.0)),
        (None, _) => None,
    };
    let quota = difference.quota_us.map(|us| us as f64 / 1000.0);
    let thermal = difference.thermal_ms.map(|ms| ms as f64);
    let throttled = [quota, thermal].into_iter().flatten().reduce(f64::max);
    let neighbours = spent.cpu.and_then(|cpu| difference.neighbours_ms(cpu));
    let steal = difference.steal_ms.map(|ms| ms as f64);
    let pressure_cpu = stalled(pressure.cpu).filter(|_| spent.run_delay.is_none());
    let judged = [
        (Cause::Steal, STEAL, elapsed * threads, steal),
        (Cause::PressureCpu, PRESSURE_CPU, elapsed, pressure_cpu),
        (
            Cause::PressureMemory,
            PRESSURE_MEMORY,
            elapsed,
            stalled(pressure.memory),
        ),
        (
            Cause::PressureIo,
            PRESSURE_IO,
            elapsed,
            stalled(pressure.io),
        ),
        (
            Cause::Waited,
            waited.map_or(RUN_DELAY, |(threshold, ..)| threshold),
            wall * waited.map_or(1.0, |(.., threads)| threads),
            waited.map(|(_, ms, _)| ms),
        ),
        (Cause::Throttled, THROTTLED, elapsed, throttled),
        (
            Cause::BusyNeighbour,
            NEIGHBOUR,
            elapsed * threads,
            neighbours,
        ),
        (
            Cause::HostWaited,
            HOST_WAITED,
            call,
            spent.call.host_run_delay.map(milliseconds),
        ),
        (Cause::Handover, HANDOVER, call, spent.call.handover_ms()),
    ];
    let reasons = judged
        .into_iter()
        .filter_map(|(cause, threshold, time, ms)| {
            let limit_ms = threshold.ms(time);
            let ms = ms.filter(|ms| *ms > limit_ms)?;
            Some(Reason {
                cause,
                ms,
                limit_ms,
            })
        });
    reasons.collect()
}

fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1000.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::fixture::Fixture;
    use proptest::prelude::*;
    use serde_json::json;

    const BEFORE: &[(&str, &str)] = &[
        (
            "proc/stat",
            "cpu  100 0 50 9000 10 5 5 7 3 0\ncpu0 60 0 30 4000 10 5 5 5 3 0\n\
             cpu1 40 0 20 5000 0 0 0 2 0 0\nintr 1 2 3",
        ),
        (
            "proc/pressure/cpu",
            "some avg10=0.00 avg60=0.00 avg300=0.00 total=1000\n\
             full avg10=0.00 avg60=0.00 avg300=0.00 total=0",
        ),
        (
            "proc/pressure/memory",
            "some avg10=0.00 avg60=0.00 avg300=0.00 total=50\n\
             full avg10=0.00 avg60=0.00 avg300=0.00 total=20",
        ),
        ("proc/loadavg", "0.29 0.27 0.91 1/89 29093"),
        ("proc/self/cgroup", "1:cpu:/\n0::/job/step"),
        ("sys/fs/cgroup/cgroup.controllers", "cpu memory"),
        ("sys/fs/cgroup/cpu.stat", "usage_usec 5"),
        (
            "sys/fs/cgroup/job/cpu.stat",
            "usage_usec 5\nnr_periods 9\nnr_throttled 1\nthrottled_usec 500",
        ),
        (
            "sys/fs/cgroup/job/step/cpu.stat",
            "nr_throttled 0\nthrottled_usec 0",
        ),
        (
            "sys/devices/system/cpu/cpu0/thermal_throttle/core_throttle_count",
            "4",
        ),
        (
            "sys/devices/system/cpu/cpu0/thermal_throttle/core_throttle_total_time_ms",
            "40",
        ),
        (
            "sys/devices/system/cpu/cpu1/thermal_throttle/package_throttle_count",
            "8",
        ),
    ];

    const AFTER: &[(&str, &str)] = &[
        (
            "proc/stat",
            "cpu  150 0 60 9900 10 5 5 10 3 0\ncpu0 60 0 30 4900 10 5 5 5 3 0\n\
             cpu1 90 0 30 5000 0 0 0 5 0 0\nintr 1 2 3",
        ),
        ("proc/pressure/cpu", "some total=2500\nfull total=0"),
        ("proc/pressure/memory", "some total=90\nfull total=30"),
        ("proc/loadavg", "0.39 0.28 0.91 1/89 29093"),
        (
            "sys/fs/cgroup/job/cpu.stat",
            "nr_throttled 3\nthrottled_usec 2500",
        ),
        (
            "sys/devices/system/cpu/cpu0/thermal_throttle/core_throttle_count",
            "6",
        ),
        (
            "sys/devices/system/cpu/cpu0/thermal_throttle/core_throttle_total_time_ms",
            "45",
        ),
        (
            "sys/devices/system/cpu/cpu1/thermal_throttle/package_throttle_count",
            "9",
        ),
    ];

    /// The difference as a record shows it, without what is absent and its time.
    fn difference(fixture: &Fixture, cpus: Option<&str>, change: &[(&str, &str)]) -> Difference {
        let cpus: Option<Cpus> = cpus.map(|cpus| cpus.parse().unwrap());
        let before = Snapshot::from_source(&fixture.source(), cpus.as_ref());
        for (path, text) in change {
            fixture.write(path, text);
        }
        let after = Snapshot::from_source(&fixture.source(), cpus.as_ref());
        let mut difference = after.since_at(&before, 100);
        assert!(difference.elapsed_ms >= 0.0);
        difference.elapsed_ms = 0.0;
        difference
    }

    #[test]
    fn counters_of_all_cpus() {
        let all = difference(&Fixture::new(BEFORE), None, AFTER);
        let expected = json!({
            "elapsed_ms": 0.0,
            "cpus": null,
            "steal_ms": 30,
            "busy_ms": 600,
            "pressure": {
                "cpu": {"some_us": 1500, "full_us": null},
                "memory": {"some_us": 40, "full_us": 10},
                "io": null,
            },
            "load_before": [0.29, 0.27, 0.91],
            "load_after": [0.39, 0.28, 0.91],
            "thermal_events": 2,
            "thermal_ms": 5,
            "quota_events": 2,
            "quota_us": 2000,
        });
        assert_eq!(serde_json::to_value(&all).unwrap(), expected);
        assert_eq!(all.neighbours_ms(Duration::ZERO), None);
        let read: Difference = serde_json::from_value(expected).unwrap();
        assert_eq!(read, all);
    }

    #[test]
    fn counters_of_given_cpus() {
        let one = difference(&Fixture::new(BEFORE), Some("1"), AFTER);
        assert_eq!((one.steal_ms, one.busy_ms), (Some(30), Some(600)));
        assert_eq!((one.thermal_events, one.thermal_ms), (Some(1), None));
        assert_eq!(one.neighbours_ms(Duration::from_millis(550)), Some(50.0));
        assert_eq!(one.neighbours_ms(Duration::from_secs(1)), Some(0.0));
        let idle = difference(&Fixture::new(BEFORE), Some("0"), AFTER);
        assert_eq!((idle.steal_ms, idle.busy_ms), (Some(0), Some(0)));
        // A CPU that is not there makes the sum unknown, not smaller.
        let missing = difference(&Fixture::new(BEFORE), Some("1-2"), AFTER);
        assert_eq!((missing.steal_ms, missing.busy_ms), (None, None));
    }

    #[test]
    fn what_is_not_told_is_absent() {
        let nothing = difference(&Fixture::new(&[]), Some("0"), &[]);
        let expected = Difference {
            cpus: Some("0".parse().unwrap()),
            ..Difference::default()
        };
        assert_eq!(nothing, expected);
        // Old kernels have fewer columns, and some files fill with nonsense.
        let old = Fixture::new(&[
            ("proc/stat", "cpu  1 2 3 4 5 6 7\ncpu0 1 2 3 4 5 6 7\nx"),
            ("proc/pressure/cpu", "some total=many"),
            ("proc/loadavg", "low"),
            ("proc/self/cgroup", "0::/../../outside"),
            ("sys/fs/cgroup/unified/cgroup.controllers", ""),
            ("sys/fs/cgroup/outside/cpu.stat", "throttled_usec 1"),
        ]);
        let old = difference(&old, None, &[]);
        assert_eq!((old.steal_ms, old.busy_ms), (None, Some(0)));
        assert_eq!(old.pressure, Pressures::default());
        assert_eq!((old.load_before, old.quota_us), (None, None));
        // Counters that go back did not gain.
        let fixture = Fixture::new(BEFORE);
        for (path, text) in AFTER {
            fixture.write(path, text);
        }
        let back = difference(&fixture, None, BEFORE);
        assert_eq!((back.steal_ms, back.quota_us), (Some(0), Some(0)));
    }

    #[test]
    fn this_machine_is_read_without_harm() {
        let before = Snapshot::take(None);
        let difference = Snapshot::take(None).since(&before);
        assert!(difference.elapsed_ms >= 0.0 && difference.cpus.is_none());
    }

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    /// A trial of a second on one CPU, with nothing to say against it.
    fn quiet() -> (Difference, Spent) {
        let pressure = |some_us| {
            Some(Pressure {
                some_us,
                full_us: None,
            })
        };
        let difference = Difference {
            elapsed_ms: 1000.0,
            cpus: Some("1,5".parse().unwrap()),
            steal_ms: Some(20),
            busy_ms: Some(1040),
            pressure: Pressures {
                cpu: pressure(50_000),
                memory: pressure(10_000),
                io: pressure(200_000),
            },
            thermal_ms: Some(10),
            quota_us: Some(10_000),
            ..Difference::default()
        };
        let spent = Spent {
            wall: ms(1000),
            cpu: Some(ms(990)),
            run_delay: Some(ms(10)),
            threads: 1,
            call: Call {
                wall: ms(1000),
                claimed: Some(ms(975)),
                cpu: Some(ms(970)),
                host_cpu: Some(ms(5)),
                host_run_delay: Some(ms(20)),
            },
        };
        (difference, spent)
    }

    #[test]
    fn every_cause_is_told_by_its_figure() {
        type Change = fn(&mut Difference, &mut Spent);
        let cases: &[(&str, Change, &[&str])] = &[
            ("nothing", |_, _| {}, &[]),
            (
                "steal",
                |d, _| d.steal_ms = Some(21),
                &["steal: 21.0 ms, more than 20.0 ms"],
            ),
            (
                "as much steal for four threads",
                |d, s| {
                    d.steal_ms = Some(40);
                    d.busy_ms = Some(3950);
                    s.threads = 4;
                    s.cpu = Some(ms(3900));
                },
                &[],
            ),
            (
                "stalls for memory and disks",
                |d, _| {
                    d.pressure.memory.as_mut().unwrap().some_us = 11_000;
                    d.pressure.io.as_mut().unwrap().some_us = 201_000;
                },
                &[
                    "pressure-memory: 11.0 ms, more than 10.0 ms",
                    "pressure-io: 201.0 ms, more than 200.0 ms",
                ],
            ),
            (
                "the trial's own delay is better than the machine's pressure",
                |d, _| d.pressure.cpu.as_mut().unwrap().some_us = 900_000,
                &[],
            ),
            (
                "pressure where the delay is not known",
                |d, s| {
                    d.pressure.cpu.as_mut().unwrap().some_us = 900_000;
                    s.run_delay = None;
                },
                &["pressure-cpu: 900.0 ms, more than 50.0 ms"],
            ),
            (
                "ready to run, and not running",
                |d, s| {
                    d.busy_ms = Some(960);
                    s.run_delay = Some(ms(30));
                    s.cpu = Some(ms(960));
                },
                &["waited: 30.0 ms, more than 20.0 ms"],
            ),
            (
                "sleeping is no waiting",
                |d, s| {
                    d.busy_ms = Some(100);
                    s.cpu = Some(ms(100));
                    s.run_delay = Some(ms(1));
                },
                &[],
            ),
            (
                "too many threads of its own wait for each other",
                |_, s| {
                    s.cpu = Some(ms(999));
                    s.run_delay = Some(ms(7000));
                },
                &[],
            ),
            (
                "wall without CPU, of one thread",
                |d, s| {
                    d.busy_ms = Some(900);
                    s.run_delay = None;
                    s.cpu = Some(ms(900));
                },
                &["waited: 100.0 ms, more than 50.0 ms"],
            ),
            (
                "which says nothing of several threads",
                |d, s| {
                    d.busy_ms = Some(900);
                    s.run_delay = None;
                    s.cpu = Some(ms(900));
                    s.threads = 2;
                },
                &[],
            ),
            (
                "heat",
                |d, _| d.thermal_ms = Some(300),
                &["throttled: 300.0 ms, more than 10.0 ms"],
            ),
            (
                "a quota",
                |d, _| {
                    d.thermal_ms = None;
                    d.quota_us = Some(12_500);
                },
                &["throttled: 12.5 ms, more than 10.0 ms"],
            ),
            (
                "somebody else",
                |d, _| d.busy_ms = Some(1090),
                &["busy-neighbour: 100.0 ms, more than 50.0 ms"],
            ),
            (
                "somebody else on CPUs that were not the trial's own",
                |d, _| {
                    d.busy_ms = Some(9000);
                    d.cpus = None;
                },
                &[],
            ),
            (
                "the supervisor died, so its CPU time is not known",
                |d, s| {
                    d.busy_ms = Some(9000);
                    s.cpu = None;
                    s.run_delay = None;
                },
                &[],
            ),
            (
                "the host waited",
                |_, s| s.call.host_run_delay = Some(ms(21)),
                &["host-waited: 21.0 ms, more than 20.0 ms"],
            ),
            (
                "a request or an answer lay there",
                |_, s| s.call.claimed = Some(ms(974)),
                &["handover: 21.0 ms, more than 20.0 ms"],
            ),
            (
                "to write and read a large answer is work",
                |_, s| {
                    s.call.claimed = Some(ms(400));
                    s.call.cpu = Some(ms(700));
                    s.call.host_cpu = Some(ms(280));
                },
                &[],
            ),
            (
                "who computed gains no mark by claiming nothing",
                |_, s| {
                    s.call.claimed = Some(Duration::ZERO);
                    s.call.cpu = Some(ms(975));
                },
                &[],
            ),
            (
                "who slept in its call took that long",
                |_, s| s.call.cpu = Some(ms(1)),
                &[],
            ),
            (
                "nobody says how long the planner worked, or what it used",
                |_, s| {
                    s.call.claimed = None;
                    s.call.host_run_delay = None;
                },
                &[],
            ),
            (
                "a short call is judged as a long one is",
                |_, s| {
                    s.call = Call {
                        wall: Duration::from_micros(2460),
                        claimed: Some(Duration::from_micros(490)),
                        cpu: Some(Duration::from_micros(500)),
                        host_cpu: Some(Duration::from_micros(60)),
                        host_run_delay: Some(Duration::from_micros(1850)),
                    };
                },
                &[
                    "host-waited: 1.85 ms, more than 0.20 ms",
                    "handover: 1.90 ms, more than 0.05 ms",
                ],
            ),
            (
                "which takes an undisturbed call of no time as such",
                |_, s| {
                    s.call = Call {
                        wall: Duration::from_micros(310),
                        claimed: Some(Duration::from_micros(168)),
                        cpu: Some(Duration::from_micros(223)),
                        host_cpu: Some(Duration::from_micros(50)),
                        host_run_delay: Some(Duration::from_micros(137)),
                    };
                },
                &[],
            ),
            (
                "nothing is known",
                |d, s| {
                    *d = Difference::default();
                    s.run_delay = None;
                    s.call = Call::default();
                },
                &[],
            ),
            (
                "a trial of no time and no threads",
                |d, s| {
                    *d = Difference::default();
                    *s = Spent {
                        wall: Duration::ZERO,
                        cpu: Some(Duration::ZERO),
                        run_delay: Some(Duration::ZERO),
                        threads: 0,
                        call: Call::default(),
                    };
                },
                &[],
            ),
        ];
        for (name, change, expected) in cases {
            let (mut difference, mut spent) = quiet();
            change(&mut difference, &mut spent);
            let reasons = contended(&difference, &spent);
            let reasons: Vec<_> = reasons.iter().map(ToString::to_string).collect();
            assert_eq!(&reasons, expected, "{name}");
        }
    }

    proptest! {
        #[test]
        fn every_reason_is_over_its_limit(
            figures in prop::array::uniform7(prop::option::of(any::<u64>())),
            wall in any::<u64>(),
            elapsed_ms in 0.0..1e12f64,
            threads in any::<u32>(),
        ) {
            let [steal_ms, busy_ms, stalled, thermal_ms, quota_us, cpu, delay] = figures;
            let stalled = stalled.map(|some_us| Pressure { some_us, full_us: None });
            let difference = Difference {
                elapsed_ms,
                cpus: busy_ms.map(|_| Cpus::default()),
                steal_ms,
                busy_ms,
                pressure: Pressures { cpu: stalled, memory: stalled, io: stalled },
                thermal_ms,
                quota_us,
                ..Difference::default()
            };
            let spent = Spent {
                wall: Duration::from_nanos(wall),
                cpu: cpu.map(Duration::from_micros),
                run_delay: delay.map(Duration::from_micros),
                threads,
                call: Call {
                    wall: Duration::from_nanos(wall),
                    claimed: cpu.map(Duration::from_nanos),
                    cpu: delay.map(Duration::from_nanos),
                    host_cpu: steal_ms.map(Duration::from_nanos),
                    host_run_delay: busy_ms.map(Duration::from_nanos),
                },
            };
            let reasons = contended(&difference, &spent);
            prop_assert!(reasons.is_sorted_by_key(|reason| reason.cause));
            for reason in reasons {
                prop_assert!(reason.ms.is_finite() && reason.ms > reason.limit_ms);
                prop_assert!(reason.limit_ms > 0.0);
            }
        }
    }

    #[test]
    fn reasons_are_data() {
        let reason = Reason {
            cause: Cause::BusyNeighbour,
            ms: 100.0,
            limit_ms: 50.0,
        };
        let text = r#"{"cause":"busy-neighbour","ms":100.0,"limit_ms":50.0}"#;
        assert_eq!(serde_json::to_string(&reason).unwrap(), text);
        assert_eq!(serde_json::from_str::<Reason>(text).unwrap(), reason);
        for cause in [Cause::Steal, Cause::PressureIo, Cause::Waited] {
            let text = serde_json::to_string(&cause).unwrap();
            assert_eq!(text, format!("\"{cause}\""));
        }
    }
}
