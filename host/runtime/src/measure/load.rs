//! The kernel's counters of load, and what they gained while a trial ran.
//!
//! A [`Snapshot`] before and one after give a [`Difference`], which
//! [`contended`](super::contended) judges. The counters are the kernel's own, of
//! the machine or of single CPUs, so they see other users, other containers and,
//! as stolen time, other virtual machines. They do not see shared caches, memory
//! bandwidth, or a frequency that sank.

use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};

use super::Cpus;
use super::source::Source;

/// The kernel's counters at one moment.
#[derive(Debug, Clone)]
pub struct Snapshot {
    at: Instant,
    cpus: Option<Cpus>,
    ticks: Option<Ticks>,
    /// The time for which tasks ran on those CPUs, to the nanosecond.
    ran_ns: Option<u64>,
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
    /// Times in which a CPU had nothing to run, waiting for a disk included.
    idle: u64,
    steal: Option<u64>,
}

/// Bounds of a time in milliseconds.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Bounds {
    /// It was at least as long.
    pub least_ms: f64,
    /// It was at most as long.
    pub most_ms: f64,
}

impl Bounds {
    /// The time without a part of it, which has bounds of its own; no part is known to be at most
    /// so long without `most`.
    fn less(self, least: Duration, most: Option<Duration>) -> Self {
        let less = |ms: f64, part: Duration| (ms - milliseconds(part)).max(0.0);
        Self {
            least_ms: most.map_or(0.0, |most| less(self.least_ms, most)),
            most_ms: less(self.most_ms, least),
        }
    }
}

/// The time for which tasks were stalled for want of something, in microseconds.
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
            ran_ns: cpus.and_then(|cpus| read_ran(&source.raw("proc/schedstat")?, cpus)),
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

    /// The gains of the counters since an earlier snapshot of the same CPUs.
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
        let elapsed_ms = milliseconds(self.at.saturating_duration_since(before.at));
        Difference {
            elapsed_ms,
            busy: self
                .cpus
                .as_ref()
                .filter(|_| same)
                .and_then(|cpus| self.busy(before, elapsed_ms * cpus.len() as f64, hertz)),
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

impl Snapshot {
    /// The time for which the watched CPUs ran tasks since then, of `whole_ms` of all of them
    /// together.
    ///
    /// Busy times of `/proc/stat` are not used: where the kernel counts them at its ticks, who runs
    /// at every tick for a moment has all of the time. Idle times are measured, and only written
    /// in ticks.
    fn busy(&self, before: &Self, whole_ms: f64, hertz: u64) -> Option<Bounds> {
        if let (Some(now), Some(then)) = (self.ran_ns, before.ran_ns) {
            let ran_ms = now.saturating_sub(then) as f64 / 1e6;
            return Some(Bounds {
                least_ms: ran_ms,
                most_ms: ran_ms,
            });
        }
        let (now, then) = self.ticks.zip(before.ticks)?;
        let cpus = self.cpus.as_ref()?.len() as f64;
        let tick_ms = 1000.0 / hertz.max(1) as f64;
        let ms = |now: u64, then: u64| now.saturating_sub(then) as f64 * tick_ms;
        let idle_ms = ms(now.idle, then.idle);
        let stolen_ms = match (now.steal, then.steal) {
            (Some(now), Some(then)) => ms(now, then) + cpus * tick_ms,
            _ => 0.0,
        };
        // Idle time is the sum of two figures, and each loses up to a tick at both ends.
        let blur_ms = 2.0 * cpus * tick_ms;
        Some(Bounds {
            least_ms: (whole_ms - idle_ms - blur_ms - stolen_ms).max(0.0),
            most_ms: (whole_ms - (idle_ms - blur_ms).max(0.0)).max(0.0),
        })
    }
}

impl Ticks {
    /// The sum over these CPUs, or all; absent when one of them is not there.
    fn read(stat: &str, cpus: Option<&Cpus>) -> Option<Self> {
        let mut sum = Self {
            busy: 0,
            idle: 0,
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
            let [user, nice, system, idle, iowait, irq, softirq, rest @ ..] = times.as_slice()
            else {
                return None;
            };
            for time in [user, nice, system, irq, softirq] {
                sum.busy = sum.busy.saturating_add(*time);
            }
            sum.idle = sum.idle.saturating_add(*idle).saturating_add(*iowait);
            let steal = rest.first();
            sum.steal = sum.steal.and_then(|sum| sum.checked_add(*steal?));
        }
        (missing == 0).then_some(sum)
    }
}

/// The time for which tasks ran on these CPUs, in nanoseconds; absent when one of them is not there.
fn read_ran(schedstat: &str, cpus: &Cpus) -> Option<u64> {
    let mut missing = cpus.len();
    let mut sum: u64 = 0;
    for line in schedstat.lines() {
        let mut fields = line.split_whitespace();
        let name = fields.next().and_then(|name| name.strip_prefix("cpu"));
        if !name.is_some_and(|name| name.parse().is_ok_and(|cpu| cpus.has(cpu))) {
            continue;
        }
        // The seventh figure, in all versions of the file.
        sum = sum.saturating_add(fields.nth(6)?.parse().ok()?);
        missing = missing.saturating_sub(1);
    }
    (missing == 0).then_some(sum)
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

/// The gains of the counters between two snapshots.
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
    /// Bounds of that where CPUs were given, which nobody's choice of moments changes.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub busy: Option<Bounds>,
    /// Stalls on the whole machine.
    pub pressure: Pressures,
    /// Load averages over 1, 5 and 15 minutes at the beginning.
    pub load_before: Option<[f64; 3]>,
    /// And at the end.
    pub load_after: Option<[f64; 3]>,
    /// Times that one of those CPUs was too hot.
    pub thermal_events: Option<u64>,
    /// Time for which they were too hot, in milliseconds.
    pub thermal_ms: Option<u64>,
    /// Number of periods in which our control group had used up its quota.
    pub quota_events: Option<u64>,
    /// The time for which it was stopped.
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

    /// Bounds of the same, for a trial that used at least `least` and at most `most`, if that is known.
    pub(super) fn others(&self, least: Duration, most: Option<Duration>) -> Option<Bounds> {
        Some(self.busy?.less(least, most))
    }
}

pub(super) fn milliseconds(duration: Duration) -> f64 {
    duration.as_secs_f64() * 1000.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::fixture::Fixture;
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

    /// A CPU was busy when it was not idle, or exactly so long as tasks are counted to have run.
    #[test]
    fn busy_times_have_bounds() {
        let cpus: Cpus = "1".parse().unwrap();
        let stat = |idle: u64, steal: u64| format!("cpu 0\ncpu1 9 0 9 {idle} 0 0 0 {steal}");
        let fixture = Fixture::new(&[]);
        let take = |files: &[(&str, &str)]| {
            for (path, text) in files {
                fixture.write(path, text);
            }
            Snapshot::from_source(&fixture.source(), Some(&cpus))
        };
        let before = take(&[("proc/stat", &stat(5000, 0))]);
        // A second, of which it was idle for 600 ms and stolen for 100 ms, give or take 10 ms.
        let after = take(&[("proc/stat", &stat(5060, 10))]);
        let bounds = |least_ms, most_ms| Some(Bounds { least_ms, most_ms });
        assert_eq!(after.busy(&before, 1000.0, 100), bounds(270.0, 420.0));
        // Too short for ticks to tell.
        assert_eq!(before.busy(&before, 9.0, 100), bounds(0.0, 9.0));
        // Versions differ in what stands around the figure.
        let schedstat = |ran: u64| {
            format!(
                "version 17\ntimestamp 4\ncpu0 1 0 2 3 4 5 6 7 8\ncpu1 1 0 2 3 4 5 {ran} 7 8\ndomain0 MC 3 1 2"
            )
        };
        let before = take(&[("proc/schedstat", &schedstat(1_000_000))]);
        let after = take(&[("proc/schedstat", &schedstat(4_500_000))]);
        assert_eq!(after.busy(&before, 1000.0, 100), bounds(3.5, 3.5));
        let busy = after.busy(&before, 1000.0, 100).unwrap();
        let ms = Duration::from_millis;
        assert_eq!(Some(busy.less(ms(2), Some(ms(3)))), bounds(0.5, 1.5));
        assert_eq!(Some(busy.less(ms(2), None)), bounds(0.0, 1.5));
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

    /// Counters are there exactly where the kernel has them.
    #[test]
    fn this_machine_is_read() {
        let difference = Snapshot::take(None).since(&Snapshot::take(None));
        let told = |path: &str| std::fs::read_to_string(path).is_ok();
        assert_eq!(difference.cpus, None);
        assert_eq!(difference.busy_ms.is_some(), told("/proc/stat"));
        assert_eq!(difference.load_after.is_some(), told("/proc/loadavg"));
        let Pressures { cpu, memory, io } = difference.pressure;
        assert_eq!(cpu.is_some(), told("/proc/pressure/cpu"));
        assert_eq!(memory.is_some(), told("/proc/pressure/memory"));
        assert_eq!(io.is_some(), told("/proc/pressure/io"));
    }
}
