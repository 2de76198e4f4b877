//! Resources: those with limits, and what calls and plugins used of them.

use std::time::Duration;

use fleetyard_core::words;
use serde::{Deserialize, Serialize};

/// A resource with a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Limit {
    /// Wall time of a call.
    Wall,
    /// Processor time of a call, over all processes and threads.
    Cpu,
    /// Memory, over all processes.
    Memory,
    /// Processes and threads.
    Processes,
    /// Output that is no message.
    Output,
    /// Bytes or files in the scratch folder.
    Disk,
}

words!(Limit {
    Wall = "wall";
    Cpu = "cpu";
    Memory = "memory";
    Processes = "processes";
    Output = "output";
    Disk = "disk";
});

/// Origin of a figure.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// The kernel counted it for the control group.
    Cgroup,
    /// The kernel counted it for processes that were waited for.
    Rusage,
    /// Read from `/proc` every few milliseconds.
    Polled,
}

impl Source {
    /// True if processor time from here is the least that it can have been: without a
    /// control group, processes that nobody waited for are missing.
    pub fn is_lower_bound(self) -> bool {
        self != Self::Cgroup
    }
}

/// Resources that a plugin's processes used, as the kernel counted them. Unknown ones are absent.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Usage {
    /// Processor time in user mode.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub user_us: Option<u64>,
    /// Processor time in the kernel.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub system_us: Option<u64>,
    /// Origin of processor times; they are a lower bound unless it is the group.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpu_source: Option<Source>,
    /// True if processes are known to have ended whose processor time nobody was told.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub cpu_lost: bool,
    /// Most memory that was seen in use, over all processes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_memory_kb: Option<u64>,
    /// Origin of the peak.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_memory_source: Option<Source>,
    /// Largest resident set of any one process.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub max_rss_kb: Option<u64>,
    /// Most processes and threads that were seen at a time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_tasks: Option<u64>,
    /// Most bytes that were seen in the scratch folder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub peak_disk_kb: Option<u64>,
    /// Switches to another process while waiting for something.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub voluntary_switches: Option<u64>,
    /// Switches because somebody else had a turn.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub involuntary_switches: Option<u64>,
    /// Page faults that read from a disk.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub major_faults: Option<u64>,
    /// Page faults that did not.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minor_faults: Option<u64>,
    /// Time in which a bandwidth limit stopped the plugin.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub throttled_us: Option<u64>,
}

/// The use of one call.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct CallUsage {
    /// Processor time of all processes and threads.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpu_us: Option<u64>,
    /// Origin of the processor time; it is a lower bound unless it is the group.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cpu_source: Option<Source>,
    /// Time in which they could have run but others did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub run_delay_us: Option<u64>,
    /// Processor time of all from the end of the call before, or of making the plugin, until this
    /// one began; absent where there was none before.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub before_us: Option<u64>,
    /// Processor times of all calls so far, this one included, and between them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub work: Option<Work>,
}

/// Processor time of a plugin's calls, and between them.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Work {
    /// In calls, their grace included.
    pub calls_us: u64,
    /// From when the plugin had been made until the last call, without the calls.
    pub between_us: u64,
}

impl Work {
    /// Processor time between calls that needs no calls to be explained.
    pub const FREE: Duration = Duration::from_millis(100);
    /// The part of its calls' processor time that a plugin may use between them: to free what they
    /// have left takes less.
    pub const SHARE: f64 = 0.1;

    /// The work between calls, in words, where it is more than calls leave to be done: who works
    /// then has longer than its budget, and the processors of others.
    pub fn excess(self) -> Option<String> {
        let Self {
            calls_us,
            between_us,
        } = self;
        let most_us = Self::FREE.as_micros() as f64 + Self::SHARE * calls_us as f64;
        (between_us as f64 > most_us).then(|| {
            format!(
                "its processes used {:.2} s of processor time between calls, and {:.2} s in them",
                between_us as f64 / 1e6,
                calls_us as f64 / 1e6
            )
        })
    }
}

/// The limits of one call; 0 stands for none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CallLimits {
    pub(crate) cpu_ns: u64,
    pub(crate) memory_bytes: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_little_work_between_calls_is_left_from_them() {
        let work = |calls_ms: u64, between_ms: u64| Work {
            calls_us: calls_ms * 1000,
            between_us: between_ms * 1000,
        };
        assert_eq!(work(0, 100).excess(), None);
        assert_eq!(work(10_000, 1100).excess(), None);
        let told = work(91, 5000).excess().unwrap();
        let expected =
            "its processes used 5.00 s of processor time between calls, and 0.09 s in them";
        assert_eq!(told, expected);
        assert!(work(10_000, 1101).excess().is_some());
    }
}
