//! Contention: whether a trial's times can be trusted, judged by the load meanwhile.
//!
//! [`contended`] compares a [`Difference`] of the kernel's counters with thresholds. Times from
//! `/proc/stat` come in ticks, mostly of 10 ms: a trial shorter than a few of them can hardly
//! be found contended.
//!
//! A planner may want to be measured again until the dice are good, so that each [`Reason`] also says
//! whether it is known to be *others'* doing. Time that threads wait counts only as far as somebody
//! else had the cores: who starts more threads than it has cores waits for itself. Most of the other
//! causes a planner can bring about: it can make the machine short of memory, its supervisor slow,
//! and its own claim too small.

use std::fmt;
use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::load::{Difference, Pressure, milliseconds};

/// The time from which on something counts as contention: a share of the time, and never less
/// than a fixed time that measurement itself blurs.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Threshold {
    /// Share of the time that was looked at.
    pub share: f64,
    /// The time that is too little to tell, in milliseconds.
    pub at_least_ms: f64,
}

/// Time that the hypervisor gave to others, per thread of the trial. It is lost as a
/// whole and in no planner's power, so one percent is already as much as planners
/// differ by. Two ticks may be rounding.
pub const STEAL: Threshold = Threshold::new(0.01, 20.0);

/// Time in which some task of the machine waited for a CPU, judged only where the
/// trial's own run delay is not known. The host's and the kernel's short tasks alone
/// make a percent or two.
pub const PRESSURE_CPU: Threshold = Threshold::new(0.05, 20.0);

/// Time in which some task waited for memory to be reclaimed or read back. A machine
/// with memory to spare shows none at all.
pub const PRESSURE_MEMORY: Threshold = Threshold::new(0.01, 10.0);

/// Time in which some task waited for a disk. A planner hardly reads, so what others
/// read touches it little, and logging alone makes some percent: only a disk that is
/// busy for a good part of the time counts.
pub const PRESSURE_IO: Threshold = Threshold::new(0.2, 50.0);

/// Time that the trial's threads were ready to run and did not, by the scheduler's
/// exact count. A process that starts and answers waits for a CPU a few times, some
/// tens of microseconds each; a larger allowance would leave short trials unmarked that
/// are disturbed as much as long ones.
pub const RUN_DELAY: Threshold = Threshold::new(0.02, 0.2);

/// Time of a single thread that was not CPU time, where its run delay is not known.
/// Waiting for the host's answers and reading files is in it, so it takes more.
pub const NOT_RUNNING: Threshold = Threshold::new(0.05, 20.0);

/// Time in which the CPU was too hot, or the control group had used up its quota:
/// all of it is lost, or runs at a fraction of the speed.
pub const THROTTLED: Threshold = Threshold::new(0.01, 5.0);

/// CPU time that others used on the trial's cores. Interrupts and the kernel's own
/// threads make a percent; ticks on both ends blur some tens of milliseconds.
pub const NEIGHBOUR: Threshold = Threshold::new(0.03, 50.0);

/// Time of the compared call in which the host's own thread was ready to run and did not, by the
/// scheduler's exact count: an answer that lies there looks like a slow planner. The supervisors of
/// plugins run on the host's core, and make it wait for a tenth of a millisecond.
pub const HOST_WAITED: Threshold = Threshold::new(0.02, 0.2);

/// Time of that call in which neither the plugin nor the host was at work, counted in nanoseconds.
/// To wake each other costs both sides some ten microseconds.
pub const HANDOVER: Threshold = Threshold::new(0.02, 0.05);

impl Threshold {
    const fn new(share: f64, at_least_ms: f64) -> Self {
        Self { share, at_least_ms }
    }

    fn ms(self, time_ms: f64) -> f64 {
        (self.share * time_ms).max(self.at_least_ms)
    }
}

/// The use of a trial between the same two snapshots.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Spent {
    /// Its wall time.
    pub wall: Duration,
    /// CPU time of its whole process tree, in user mode and in the kernel.
    pub cpu: Option<Duration>,
    /// CPU time of its process tree between the snapshots at most, that between its calls included;
    /// absent where processes may have used some of which nobody was told.
    pub cpu_most: Option<Duration>,
    /// Time that its threads were ready to run and did not.
    pub run_delay: Option<Duration>,
    /// The number of threads that it was allowed to compute with.
    pub threads: u32,
    /// The call that is compared.
    pub call: Call,
}

/// The times of a call of a plugin: its length by the host's clock, and the work of both sides.
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

/// A circumstance that makes a time doubtful.
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

impl Cause {
    /// Something that keeps it away from the next trial.
    pub fn remedy(self) -> &'static str {
        match self {
            Self::Steal => "use a machine that no other virtual machine shares",
            Self::PressureCpu
            | Self::Waited
            | Self::BusyNeighbour
            | Self::HostWaited
            | Self::Handover => "end what else computes here",
            Self::PressureMemory => "free memory",
            Self::PressureIo => "wait until the disks are idle",
            Self::Throttled => "let the processors cool, or raise their quota",
        }
    }
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

/// A reason for which a trial counts as contended.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Reason {
    /// The circumstance.
    pub cause: Cause,
    /// Its duration.
    pub ms: f64,
    /// The longest that would have passed.
    pub limit_ms: f64,
    /// True if it is known to be others' doing, which nothing that the planner does can bring about.
    #[serde(default)]
    pub by_others: bool,
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            cause,
            ms,
            limit_ms,
            by_others,
        } = self;
        let by = if *by_others { ", by others" } else { "" };
        let digits = if *limit_ms < 1.0 { 2 } else { 1 };
        write!(
            f,
            "{cause}: {ms:.digits$} ms, more than {limit_ms:.digits$} ms{by}"
        )
    }
}

/// The reasons for which a trial's times cannot be compared with others, in the order of [`Cause`];
/// empty when nothing is known against them.
pub fn contended(difference: &Difference, spent: &Spent) -> Vec<Reason> {
    let Difference { pressure, .. } = difference;
    let elapsed = difference.elapsed_ms;
    let threads = f64::from(spent.threads.max(1));
    let stalled = |pressure: Option<Pressure>| Some(pressure?.some_us as f64 / 1000.0);
    let wall = milliseconds(spent.wall);
    let call = milliseconds(spent.call.wall);
    let others = spent
        .cpu
        .and_then(|cpu| difference.others(cpu, spent.cpu_most));
    let others_most = others.map_or(f64::INFINITY, |others| others.most_ms);
    let others_least = others.map_or(0.0, |others| others.least_ms);
    // What the trial's threads got less than they might have had. More threads than
    // cores delay each other, and only this can be others' doing, so far as they had the cores.
    let idle = spent
        .cpu
        .map(|cpu| (threads * wall - milliseconds(cpu)).max(0.0));
    let waited = match (spent.run_delay, idle) {
        (Some(delay), Some(idle)) => Some((RUN_DELAY, milliseconds(delay).min(idle), threads)),
        (Some(delay), None) => Some((RUN_DELAY, milliseconds(delay), threads)),
        (None, Some(idle)) if spent.threads <= 1 => Some((NOT_RUNNING, idle, 1.0)),
        (None, _) => None,
    }
    .map(|(threshold, ms, threads)| (threshold, ms.min(others_most), threads));
    // Who sleeps does not run either.
    let waited_for_others = spent.run_delay.map_or(0.0, |_| others_least);
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
            let by_others = match cause {
                Cause::Steal => true,
                Cause::Waited => waited_for_others > limit_ms,
                Cause::BusyNeighbour => others_least > limit_ms,
                Cause::PressureCpu
                | Cause::PressureMemory
                | Cause::PressureIo
                | Cause::Throttled
                | Cause::HostWaited
                | Cause::Handover => false,
            };
            Some(Reason {
                cause,
                ms,
                limit_ms,
                by_others,
            })
        });
    reasons.collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Cpus;
    use crate::measure::load::{Bounds, Pressures};
    use proptest::prelude::*;

    fn ms(ms: u64) -> Duration {
        Duration::from_millis(ms)
    }

    fn busy(least_ms: f64, most_ms: f64) -> Bounds {
        Bounds { least_ms, most_ms }
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
            cpu_most: Some(ms(990)),
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
                &["steal: 21.0 ms, more than 20.0 ms, by others"],
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
                "children of its own had the core, and then all of them slept",
                |d, s| {
                    (s.cpu, s.cpu_most) = (Some(ms(400)), Some(ms(400)));
                    s.run_delay = Some(ms(1200));
                    d.busy_ms = Some(410);
                    d.busy = Some(busy(405.0, 415.0));
                },
                &[],
            ),
            (
                "others had the core meanwhile",
                |d, s| {
                    (s.cpu, s.cpu_most) = (Some(ms(400)), Some(ms(400)));
                    s.run_delay = Some(ms(1200));
                    d.busy_ms = Some(500);
                    d.busy = Some(busy(495.0, 505.0));
                },
                &[
                    "waited: 105.0 ms, more than 20.0 ms, by others",
                    "busy-neighbour: 100.0 ms, more than 50.0 ms, by others",
                ],
            ),
            (
                "perhaps they had: some of its own time may not have been counted",
                |d, s| {
                    (s.cpu, s.cpu_most) = (Some(ms(400)), None);
                    s.run_delay = Some(ms(1200));
                    d.busy_ms = Some(500);
                    d.busy = Some(busy(495.0, 505.0));
                },
                &[
                    "waited: 105.0 ms, more than 20.0 ms",
                    "busy-neighbour: 100.0 ms, more than 50.0 ms",
                ],
            ),
            (
                "perhaps they had: it was too short for ticks to tell",
                |d, s| {
                    *d = Difference {
                        elapsed_ms: 9.0,
                        cpus: d.cpus.take(),
                        busy_ms: Some(10),
                        busy: Some(busy(0.0, 9.0)),
                        ..Difference::default()
                    };
                    (s.wall, s.cpu, s.cpu_most) = (ms(9), Some(ms(2)), Some(ms(2)));
                    s.run_delay = Some(ms(1));
                },
                &["waited: 1.00 ms, more than 0.20 ms"],
            ),
            (
                "what it used between its calls is its own",
                |d, s| {
                    (s.cpu, s.cpu_most) = (Some(ms(400)), Some(ms(500)));
                    s.run_delay = Some(ms(1200));
                    d.busy_ms = Some(450);
                    d.busy = Some(busy(495.0, 505.0));
                },
                &["waited: 105.0 ms, more than 20.0 ms"],
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
                        cpu_most: None,
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
                busy: thermal_ms.map(|least| busy(least as f64, least as f64 + 20.0)),
                pressure: Pressures { cpu: stalled, memory: stalled, io: stalled },
                thermal_ms,
                quota_us,
                ..Difference::default()
            };
            let spent = Spent {
                wall: Duration::from_nanos(wall),
                cpu: cpu.map(Duration::from_micros),
                cpu_most: steal_ms.map(Duration::from_micros),
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
            by_others: true,
        };
        let text = r#"{"cause":"busy-neighbour","ms":100.0,"limit_ms":50.0,"by_others":true}"#;
        assert_eq!(serde_json::to_string(&reason).unwrap(), text);
        assert_eq!(serde_json::from_str::<Reason>(text).unwrap(), reason);
        for cause in [Cause::Steal, Cause::PressureIo, Cause::Waited] {
            let text = serde_json::to_string(&cause).unwrap();
            assert_eq!(text, format!("\"{cause}\""));
        }
    }
}
