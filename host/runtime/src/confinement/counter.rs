//! Processor time of a process and of all that come of it, by a counter of the kernel.
//!
//! The kernel adds a child's time to its parent's when the parent waits for it, and forgets that of
//! a child whose parent says that it will not. A counter goes on counting: it is inherited by every
//! process and thread that is made, and keeps what they counted when they end. It is no proof
//! either, as a program that its user may not read is not counted.

use std::fs::File;
use std::io::Read;
use std::os::fd::{FromRawFd, OwnedFd};

use rustix::process::Pid;

/// A counter of the time for which a process and its descendants run.
#[derive(Debug)]
pub(crate) struct Counter {
    file: File,
    /// The count when the plugin began.
    before_ns: u64,
}

/// The first version of what describes a counter, `perf_event_attr`.
#[repr(C)]
struct Attributes {
    kind: u32,
    size: u32,
    config: u64,
    period: u64,
    sample: u64,
    format: u64,
    flags: u64,
    wakeup: u32,
    breakpoint: u32,
    config1: u64,
}

const SOFTWARE: u32 = 1;
const TASK_CLOCK: u64 = 1;
const INHERIT: u64 = 1 << 1;
/// An ordinary user may count only so; the time in the kernel is in it all the same.
const EXCLUDE_KERNEL: u64 = 1 << 5;
const EXCLUDE_HYPERVISOR: u64 = 1 << 6;
const CLOSE_ON_EXEC: libc::c_ulong = 1 << 3;

impl Counter {
    /// Begins to count for a process, before it makes others; `None` where that is refused, as in most
    /// containers.
    pub(crate) fn of(pid: Pid) -> Option<Self> {
        let attributes = Attributes {
            kind: SOFTWARE,
            size: size_of::<Attributes>() as u32,
            config: TASK_CLOCK,
            period: 0,
            sample: 0,
            format: 0,
            flags: INHERIT | EXCLUDE_KERNEL | EXCLUDE_HYPERVISOR,
            wakeup: 0,
            breakpoint: 0,
            config1: 0,
        };
        // SAFETY: the structure is as long as it says and outlives the call.
        let fd = unsafe {
            libc::syscall(
                libc::SYS_perf_event_open,
                &raw const attributes,
                pid.as_raw_nonzero().get(),
                -1,
                -1,
                CLOSE_ON_EXEC,
            )
        };
        let fd = i32::try_from(fd).ok().filter(|fd| *fd >= 0)?;
        // SAFETY: the descriptor is new, and nobody else's.
        let file = File::from(unsafe { OwnedFd::from_raw_fd(fd) });
        let counter = Self { file, before_ns: 0 };
        counter.count_ns().is_some().then_some(counter)
    }

    /// The plugin begins: what was counted until now is the sandbox's.
    pub(crate) fn begin(&mut self) {
        self.before_ns = self.count_ns().unwrap_or(0);
    }

    fn count_ns(&self) -> Option<u64> {
        let mut count = [0; 8];
        (&self.file).read_exact(&mut count).ok()?;
        Some(u64::from_ne_bytes(count))
    }

    /// Processor time since then, in microseconds.
    pub(crate) fn cpu_us(&self) -> Option<u64> {
        Some(self.count_ns()?.saturating_sub(self.before_ns) / 1000)
    }
}
