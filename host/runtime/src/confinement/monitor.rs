//! Watches what a plugin uses, and says when it is too much.
//!
//! The kernel's own limits are the first line where they exist; this is what holds
//! everywhere. Without a control group memory is counted by `memory`, and processor time
//! is what `/proc` shows of processes that live or were waited for, or what a counter of the
//! kernel says, where we may have one: a lower bound, since nobody is told of those whose
//! parents ignore their end, and some programs are not counted.

use std::fs;
use std::os::fd::AsFd;
use std::time::Duration;

use fleetyard_abi::monotonic_ns;

use crate::confinement::cgroup::Cgroup;
use crate::confinement::memory::{Memory, SHARE, SHARE_NEAR};
use crate::confinement::process_tree::Census;
use crate::confinement::sandbox::jail::{Ended, Jail};
use crate::usage::{CallLimits, CallUsage, Limit, Source, Usage, Work};

/// The pause between two walks through a folder on somebody's disk.
const FOLDER_EVERY_NS: u64 = 50_000_000;

/// Processor time by which two clocks of the kernel may differ over the life of a plugin.
const COUNTED_OTHERWISE_US: u64 = 20_000;

/// Limits that hold all the time.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Standing {
    pub(crate) processes: u64,
    pub(crate) disk_bytes: u64,
    pub(crate) files: u64,
    /// True if the scratch folder is a file system of its own.
    pub(crate) own_disk: bool,
    /// True if the plugin has the network.
    pub(crate) network: bool,
}

/// Processor time and delays so far.
#[derive(Debug, Clone, Copy, Default)]
struct Times {
    cpu_us: Option<u64>,
    cpu_source: Option<Source>,
    run_delay_us: Option<u64>,
}

pub(crate) struct Monitor {
    standing: Standing,
    call: CallLimits,
    at_start: Times,
    /// At the end of the call before, or when the plugin had been made.
    at_end: Times,
    work: Work,
    tick_us: u64,
    memory: Memory,
    peak_memory_kb: u64,
    peak_tasks: u64,
    peak_disk_kb: u64,
    /// The cost of the last look, so that looking never takes much of a processor.
    cost_ns: u64,
    disk_looked_ns: u64,
    last_cpu_us: u64,
}

impl Monitor {
    pub(crate) fn new(standing: Standing, memory_bytes: u64) -> Self {
        let ticks = rustix::param::clock_ticks_per_second().max(1);
        Self {
            standing,
            call: CallLimits {
                memory_bytes,
                cpu_ns: 0,
            },
            at_start: Times::default(),
            at_end: Times::default(),
            work: Work::default(),
            tick_us: 1_000_000 / ticks,
            memory: Memory::new(standing.network),
            peak_memory_kb: 0,
            peak_tasks: 0,
            peak_disk_kb: 0,
            cost_ns: 0,
            disk_looked_ns: 0,
            last_cpu_us: 0,
        }
    }

    /// The wait before the next look.
    pub(crate) fn pause(&self) -> Duration {
        const SHORTEST: u64 = 5_000_000;
        const LONGEST: u64 = 50_000_000;
        // More than its share only for very many processes.
        let share = if self.memory.near { SHARE_NEAR } else { SHARE };
        Duration::from_nanos((self.cost_ns * share).clamp(SHORTEST, LONGEST))
    }

    /// A call begins: its limits count from here.
    pub(crate) fn begin(&mut self, jail: &Jail, call: CallLimits) {
        self.call = call;
        if let Some(group) = &jail.cgroup {
            // Where more is in use already, that is seen at the next look.
            group.limit_memory(call.memory_bytes);
        }
        self.at_start = self.times(jail, &jail.view.census());
    }

    /// A call has ended.
    pub(crate) fn finish(&mut self, jail: &Jail) -> CallUsage {
        let now = self.times(jail, &jail.view.census());
        let since = |now: Option<u64>, start: Option<u64>| Some(now?.saturating_sub(start?));
        let cpu_us = since(now.cpu_us, self.at_start.cpu_us);
        let before_us = since(self.at_start.cpu_us, self.at_end.cpu_us);
        self.work.calls_us += cpu_us.unwrap_or(0);
        self.work.between_us += before_us.unwrap_or(0);
        let usage = CallUsage {
            cpu_us,
            cpu_source: now.cpu_source,
            run_delay_us: since(now.run_delay_us, self.at_start.run_delay_us),
            before_us,
            work: Some(self.work),
        };
        // A call that is over is not counted again.
        self.at_start = Times::default();
        self.at_end = now;
        self.call.cpu_ns = 0;
        usage
    }

    /// Looks once; the limit that is exceeded, if one is.
    pub(crate) fn look(&mut self, jail: &Jail) -> Option<Limit> {
        let started = monotonic_ns();
        let over = self.check(jail);
        self.cost_ns = monotonic_ns() - started;
        over
    }

    /// Finds a limit that shows even when all processes are gone: a scratch folder that is full.
    pub(crate) fn last_look(&mut self, jail: &Jail) -> Option<Limit> {
        self.disk_looked_ns = 0;
        self.disk_is_over(jail).then_some(Limit::Disk)
    }

    fn check(&mut self, jail: &Jail) -> Option<Limit> {
        let census = jail.view.census();
        self.peak_tasks = self.peak_tasks.max(census.tasks);
        let refused = jail.cgroup.as_ref().is_some_and(Cgroup::out_of_processes);
        if refused || census.tasks > self.standing.processes {
            return Some(Limit::Processes);
        }
        if self.memory_is_over(jail, &census) {
            return Some(Limit::Memory);
        }
        if self.disk_is_over(jail) {
            return Some(Limit::Disk);
        }
        if self.call.cpu_ns > 0 {
            let start = self.at_start.cpu_us.unwrap_or(0);
            let now = self.cpu_us(jail, &census);
            if now.saturating_sub(start) * 1000 > self.call.cpu_ns {
                return Some(Limit::Cpu);
            }
        }
        None
    }

    fn memory_is_over(&mut self, jail: &Jail, census: &Census) -> bool {
        let limit_kb = self.call.memory_bytes / 1024;
        if let Some(group) = &jail.cgroup {
            if group.out_of_memory() {
                return true;
            }
            if let Some(bytes) = group.memory_bytes() {
                self.peak_memory_kb = self.peak_memory_kb.max(bytes / 1024);
                return limit_kb > 0 && bytes / 1024 > limit_kb;
            }
        }
        let proc = jail.view.folder();
        let used = self
            .memory
            .look(&proc, census, self.peak_memory_kb, limit_kb);
        self.peak_memory_kb = self.peak_memory_kb.max(used.unwrap_or(0));
        limit_kb > 0 && used.is_some_and(|used| used > limit_kb)
    }

    fn disk_is_over(&mut self, jail: &Jail) -> bool {
        if self.standing.own_disk {
            let Ok(stat) = rustix::fs::fstatfs(jail.scratch.as_fd()) else {
                return false;
            };
            let used = (stat.f_blocks - stat.f_bfree) * stat.f_bsize as u64;
            let files = stat.f_files - stat.f_ffree;
            self.peak_disk_kb = self.peak_disk_kb.max(used / 1024);
            return used > self.standing.disk_bytes || files > self.standing.files;
        }
        // A folder on somebody's disk has to be walked through: now and then.
        let now = monotonic_ns();
        if now < self.disk_looked_ns + FOLDER_EVERY_NS {
            return false;
        }
        let path = std::path::PathBuf::from(format!(
            "/proc/self/fd/{}",
            std::os::fd::AsRawFd::as_raw_fd(&jail.scratch)
        ));
        let mut total = Walk::default();
        total.walk(&path, self.standing.files, 0);
        self.disk_looked_ns = monotonic_ns();
        self.peak_disk_kb = self.peak_disk_kb.max(total.bytes / 1024);
        total.bytes > self.standing.disk_bytes || total.files > self.standing.files
    }

    /// As exactly as the kernel counts it for the group, else as much as is known.
    fn cpu_us(&mut self, jail: &Jail, census: &Census) -> u64 {
        let exact = jail.cgroup.as_ref().and_then(Cgroup::cpu_us);
        exact.unwrap_or_else(|| self.known_us(jail, census))
    }

    fn known_us(&mut self, jail: &Jail, census: &Census) -> u64 {
        self.ticks_us(census).max(jail.counted_us().unwrap_or(0))
    }

    /// Ticks are coarse but forget nobody; they never run backwards, whoever has just
    /// been waited for by whom.
    fn ticks_us(&mut self, census: &Census) -> u64 {
        self.last_cpu_us = self.last_cpu_us.max(census.ticks * self.tick_us);
        self.last_cpu_us
    }

    fn times(&mut self, jail: &Jail, census: &Census) -> Times {
        let folder = jail.view.folder();
        let mut run_us = 0;
        let mut delay_us = None;
        for member in &census.members {
            if let Some((run, delay)) = schedule_us(&folder, member.pid) {
                run_us += run;
                *delay_us.get_or_insert(0) += delay;
            }
        }
        let exact = jail.cgroup.as_ref().and_then(Cgroup::cpu_us);
        Times {
            // Of living threads the scheduler knows more than the ticks tell.
            cpu_us: Some(exact.unwrap_or_else(|| self.known_us(jail, census).max(run_us))),
            cpu_source: Some(exact.map_or(Source::Polled, |_| Source::Cgroup)),
            run_delay_us: delay_us,
        }
    }

    /// The use in all, once everybody is gone.
    pub(crate) fn usage(&self, jail: &Jail, ended: Option<&Ended>) -> Usage {
        let group = jail.cgroup.as_ref();
        let last_us = self.last_cpu_us.max(jail.counted_us().unwrap_or(0));
        // Who was waited for has all its time in there: what was seen before is not more, and what
        // was counted, by other clocks of the kernel, hardly.
        let lost = |ended: &Ended| {
            let told_us = ended.user_us + ended.system_us;
            told_us < self.last_cpu_us || told_us + told_us / 20 + COUNTED_OTHERWISE_US < last_us
        };
        let in_parts = jail.cpu_parts_us();
        let cpu_lost = in_parts.is_none() && ended.is_some_and(lost);
        let (user_us, system_us, cpu_source) = match (in_parts, ended) {
            (Some((user, system)), _) => (Some(user), Some(system), Source::Cgroup),
            (None, Some(ended)) if !cpu_lost => {
                (Some(ended.user_us), Some(ended.system_us), Source::Rusage)
            }
            // The last look is the least that it can have been, in one sum.
            (None, _) => (Some(last_us), None, Source::Polled),
        };
        let max_rss_kb = ended.map(|ended| ended.max_rss_kb);
        // Pages that were somebody else's before are in a resident set and not in the group.
        let of_group = group.and_then(Cgroup::memory_peak_bytes);
        let (peak_memory_kb, peak_memory_source) = [
            (of_group.unwrap_or(0) / 1024, Source::Cgroup),
            (max_rss_kb.unwrap_or(0), Source::Rusage),
            (self.peak_memory_kb, Source::Polled),
        ]
        .into_iter()
        .max_by_key(|(kb, source)| (*kb, *source == Source::Cgroup))
        .unwrap_or((0, Source::Polled));
        Usage {
            user_us,
            system_us,
            cpu_source: Some(cpu_source),
            cpu_lost,
            peak_memory_kb: (peak_memory_kb > 0).then_some(peak_memory_kb),
            peak_memory_source: (peak_memory_kb > 0).then_some(peak_memory_source),
            max_rss_kb,
            peak_tasks: (self.peak_tasks > 0).then_some(self.peak_tasks),
            peak_disk_kb: Some(self.peak_disk_kb),
            voluntary_switches: ended.map(|ended| ended.voluntary_switches),
            involuntary_switches: ended.map(|ended| ended.involuntary_switches),
            major_faults: ended.map(|ended| ended.major_faults),
            minor_faults: ended.map(|ended| ended.minor_faults),
            throttled_us: group.and_then(Cgroup::throttled_us),
        }
    }
}

/// Bytes and files below a folder.
#[derive(Default)]
struct Walk {
    bytes: u64,
    files: u64,
}

impl Walk {
    fn walk(&mut self, folder: &std::path::Path, most_files: u64, depth: u32) {
        use std::os::unix::fs::MetadataExt;
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            self.files += 1;
            // Links are not followed: `DirEntry` looks at the entry itself.
            let Ok(meta) = entry.metadata() else { continue };
            self.bytes += meta.blocks() * 512;
            if self.files > most_files {
                return;
            }
            if meta.is_dir() && depth < 64 {
                self.walk(&entry.path(), most_files, depth + 1);
            }
        }
    }
}

/// The times for which the threads of a process ran and waited for their turn.
fn schedule_us(proc: &str, pid: i32) -> Option<(u64, u64)> {
    let mut sum = None;
    for thread in fs::read_dir(format!("{proc}/{pid}/task")).ok()?.flatten() {
        let Ok(text) = fs::read_to_string(thread.path().join("schedstat")) else {
            continue;
        };
        let mut numbers = text
            .split_whitespace()
            .map_while(|word| word.parse::<u64>().ok());
        if let (Some(run), Some(delay)) = (numbers.next(), numbers.next()) {
            let (runs, delays) = sum.get_or_insert((0, 0));
            *runs += run / 1000;
            *delays += delay / 1000;
        }
    }
    sum
}
