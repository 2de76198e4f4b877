//! Resources: those with limits, and what calls and plugins used of them.

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
}

/// The limits of one call; 0 stands for none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CallLimits {
    pub(crate) cpu_ns: u64,
    pub(crate) memory_bytes: u64,
}
