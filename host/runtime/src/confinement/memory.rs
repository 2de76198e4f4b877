//! The memory of a plugin's processes, where no control group counts it.
//!
//! Resident sets are cheap to read and count shared pages several times; proportional
//! ones, which are dear, are read when their sum is too large, so that sharing is not held
//! against a plugin. Neither shows all memory. Page tables and huge pages are no part of
//! them. Shared memory that no file stands for stays when a process gives its pages back:
//! it counts by its size. What is written into sockets and pipes is in no process: each
//! counts by the most that it can hold.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;

use fleetyard_abi::monotonic_ns;

use crate::confinement::process_tree::Census;

/// Parts of a processor of which observing may take one: for a plugin that is far from its limits,
/// and for one that comes near to one.
pub(crate) const SHARE: u64 = 100;
pub(crate) const SHARE_NEAR: u64 = 20;

/// The least pause between two readings of proportional sets that no limit asks for.
const SHARES_EVERY_NS: u64 = 100_000_000;

/// Sockets, and pipes, that do not count: honest programs have some, nearly empty.
const FREE_BUFFERS: u64 = 64;

/// The size of a pipe; plugins may not make them larger.
const PIPE_KB: u64 = 64;

/// The size that a socket is allowed to have where the kernel does not say.
const SOCKET_BYTES: u64 = 212_992;

/// Counts the memory of processes.
pub(crate) struct Memory {
    page_kb: u64,
    /// The device of shared memory without a file, as it is in lists of mappings.
    shared_device: Option<String>,
    socket_kb: u64,
    /// Sizes of shared memory, by inode; the largest of which a part was ever seen.
    shared: BTreeMap<u64, u64>,
    unseen: Unseen,
    /// Time from which on memory that resident sets do not show may be counted again.
    unseen_again_ns: u64,
    /// Time from which on proportional sets may be read again.
    shares_again_ns: u64,
    /// True if memory comes near to its limit.
    pub(crate) near: bool,
}

/// Memory that resident sets do not show, in KiB.
#[derive(Debug, Clone, Copy, Default)]
struct Unseen {
    /// Page tables, huge pages and buffers.
    kernel: u64,
    /// Shared memory without a file, each once.
    shared: u64,
    /// Shared memory in the resident sets.
    resident_shared: u64,
}

/// Memory by proportional sets.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
struct Share {
    kb: u64,
    shared_kb: u64,
}

impl Memory {
    /// For a plugin that has the network or not: without, it may not make its sockets
    /// larger than they are.
    pub(crate) fn new(network: bool) -> Self {
        let most = if network { "wmem_max" } else { "wmem_default" };
        let socket_bytes = fs::read_to_string(format!("/proc/sys/net/core/{most}"));
        let socket_bytes = socket_bytes
            .ok()
            .and_then(|text| text.trim().parse().ok())
            .unwrap_or(SOCKET_BYTES);
        Self {
            page_kb: rustix::param::page_size() as u64 / 1024,
            shared_device: shared_device(),
            // The kernel doubles what is asked for, and takes in one message more than it is.
            socket_kb: 2 * socket_bytes / 1024,
            shared: BTreeMap::new(),
            unseen: Unseen::default(),
            unseen_again_ns: 0,
            shares_again_ns: 0,
            near: false,
        }
    }

    /// The memory in use, if it may be above the peak so far or above the limit; no
    /// limit is 0.
    pub(crate) fn look(
        &mut self,
        proc: &str,
        census: &Census,
        peak_kb: u64,
        limit_kb: u64,
    ) -> Option<u64> {
        let now = monotonic_ns();
        let is_over = |used: u64| limit_kb > 0 && used > limit_kb;
        let fresh = now >= self.unseen_again_ns;
        if fresh {
            self.unseen = self.count_unseen(proc, census);
            // What is not seen is mapped, but for buffers.
            let mapped = census.members.iter().map(|member| member.mapped_bytes);
            let room = is_over(mapped.sum::<u64>() / 1024);
            let share = if self.near || room { SHARE_NEAR } else { SHARE };
            self.unseen_again_ns = now + (monotonic_ns() - now) * share;
        }
        let resident = Share {
            kb: census.resident_pages * self.page_kb,
            shared_kb: self.unseen.resident_shared,
        };
        let most = self.unseen.beside(resident);
        // Half of the rest can be filled between two looks.
        self.near = is_over(most * 2);
        if most <= peak_kb && !is_over(most) {
            return None;
        }
        let mut used = most;
        let mut share = resident;
        if census.members.len() > 1 {
            // Some ten milliseconds for half a gibibyte: for the limit when need be, for the
            // peak now and then.
            if !is_over(most) && now < self.shares_again_ns {
                return None;
            }
            let started = monotonic_ns();
            share = self.shares(proc, census, if is_over(most) { 3 } else { 1 });
            let cost_ns = monotonic_ns() - started;
            self.shares_again_ns = now + (cost_ns * SHARE).max(SHARES_EVERY_NS);
            used = self.unseen.beside(share);
        }
        if is_over(used) && !fresh {
            // Somebody may have ended since.
            self.unseen = self.count_unseen(proc, census);
            used = self.unseen.beside(share);
        }
        Some(used)
    }

    /// The memory of all processes, what several of them have counted once.
    ///
    /// Shares are read one after the other while they change: whoever is the first to
    /// touch common memory has all of it for a moment, and so has, for another moment,
    /// the next. So every share is the least of a few readings; what really is too much
    /// does not get less.
    fn shares(&self, proc: &str, census: &Census, readings: u32) -> Share {
        let mut sum = Share {
            kb: 0,
            shared_kb: 0,
        };
        let mut least = vec![None; census.members.len()];
        for _ in 0..readings {
            for (least, member) in least.iter_mut().zip(&census.members) {
                let share = proportional(&member.folder(proc)).unwrap_or(Share {
                    kb: member.resident_pages * self.page_kb,
                    shared_kb: 0,
                });
                *least = Some(least.map_or(share, |least: Share| least.min(share)));
            }
        }
        for share in least.into_iter().flatten() {
            sum.kb += share.kb;
            sum.shared_kb += share.shared_kb;
        }
        sum
    }

    fn count_unseen(&mut self, proc: &str, census: &Census) -> Unseen {
        let mut unseen = Unseen::default();
        let mut places = 0;
        let mut shared = BTreeMap::new();
        for member in &census.members {
            let folder = member.folder(proc);
            // Who has just ended has nothing.
            let status = fs::read_to_string(format!("{folder}/status")).unwrap_or_default();
            let number = |name: &str| field(&status, name).unwrap_or(0);
            unseen.kernel += number("VmPTE:") + number("HugetlbPages:");
            unseen.resident_shared += number("RssShmem:");
            places += number("FDSize:");
            if let Some(device) = &self.shared_device {
                let maps = fs::read(format!("{folder}/maps")).unwrap_or_default();
                add_shared(&String::from_utf8_lossy(&maps), device, &mut shared);
            }
        }
        // Of what is left when most of a mapping was taken away the size is not seen.
        for (inode, bytes) in &mut shared {
            *bytes = self.shared.get(inode).copied().unwrap_or(0).max(*bytes);
        }
        self.shared = shared;
        unseen.shared = self.shared.values().sum::<u64>() / 1024;
        if places > FREE_BUFFERS {
            unseen.kernel += self.buffers_kb(proc, census);
        }
        unseen
    }

    /// The most that sockets and pipes can hold.
    fn buffers_kb(&self, proc: &str, census: &Census) -> u64 {
        let (mut sockets, mut pipes) = (BTreeSet::new(), BTreeSet::new());
        for member in &census.members {
            let descriptors = fs::read_dir(format!("{}/fd", member.folder(proc)));
            for descriptor in descriptors.into_iter().flatten().flatten() {
                let Ok(target) = fs::read_link(descriptor.path()) else {
                    continue;
                };
                let target = target.to_string_lossy();
                if target.starts_with("socket:") {
                    sockets.insert(target.into_owned());
                } else if target.starts_with("pipe:") {
                    pipes.insert(target.into_owned());
                }
            }
        }
        let count = |found: BTreeSet<String>| (found.len() as u64).saturating_sub(FREE_BUFFERS);
        count(sockets) * self.socket_kb + count(pipes) * PIPE_KB
    }
}

impl Unseen {
    /// All memory, with what sets of pages show.
    fn beside(self, seen: Share) -> u64 {
        seen.kb + self.kernel + self.shared.saturating_sub(seen.shared_kb)
    }
}

/// A line's number in a file of `/proc`.
fn field(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.split_whitespace().next()?.parse().ok()
}

/// A process's share of the memory that it uses together with others; nothing once it
/// has ended, and `None` where it may not be read.
fn proportional(folder: &str) -> Option<Share> {
    let text = match fs::read_to_string(format!("{folder}/smaps_rollup")) {
        Ok(text) => text,
        Err(error) => {
            let gone = [Some(libc::ENOENT), Some(libc::ESRCH)].contains(&error.raw_os_error());
            return gone.then_some(Share {
                kb: 0,
                shared_kb: 0,
            });
        }
    };
    let kb = field(&text, "Pss:")?;
    // Where the kernel does not tell them apart, nothing is held against anybody.
    let shared_kb = field(&text, "Pss_Shmem:").unwrap_or(kb);
    Some(Share { kb, shared_kb })
}

/// The device of memory files, and of all other shared memory without a file.
fn shared_device() -> Option<String> {
    let file = rustix::fs::memfd_create("fleetyard", rustix::fs::MemfdFlags::CLOEXEC).ok()?;
    let device = rustix::fs::fstat(&file).ok()?.st_dev;
    let (major, minor) = (rustix::fs::major(device), rustix::fs::minor(device));
    Some(format!("{major:02x}:{minor:02x}"))
}

/// Adds the sizes of a process's shared memory without a file.
fn add_shared(maps: &str, device: &str, sizes: &mut BTreeMap<u64, u64>) {
    for line in maps.lines() {
        // from-to rights offset device inode name
        let mut words = line.split_ascii_whitespace();
        let (Some(range), Some(_), Some(offset), Some(on), Some(inode)) = (
            words.next(),
            words.next(),
            words.next(),
            words.next(),
            words.next(),
        ) else {
            continue;
        };
        if on != device {
            continue;
        }
        let hex = |text: &str| u64::from_str_radix(text, 16).ok();
        let size = || {
            let (from, to) = range.split_once('-')?;
            hex(offset)?.checked_add(hex(to)?.checked_sub(hex(from)?)?)
        };
        if let (Ok(inode), Some(size)) = (inode.parse(), size()) {
            let known = sizes.entry(inode).or_insert(0);
            *known = size.max(*known);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shared_memory_counts_by_its_size_and_once() {
        let maps = "7f00000000-7f00400000 rw-s 00000000 00:01 77   /dev/zero (deleted)\n\
                    7f00400000-7f00600000 rw-s 00400000 00:01 77   [anon_shmem:name (x)]\n\
                    7f00700000-7f00701000 rw-s 00000000 00:01 78   /SYSV00000000 (deleted)\n\
                    7f00800000-7f00900000 rw-s 00000000 00:05 79   /dev/zero (deleted)\n\
                    7f00900000-7f00a00000 rw-p 00000000 00:00 0    [heap]\n\
                    nonsense\n";
        let mut sizes = BTreeMap::new();
        add_shared(maps, "00:01", &mut sizes);
        add_shared(maps, "00:01", &mut sizes);
        assert_eq!(sizes, BTreeMap::from([(77, 6 << 20), (78, 4096)]));
        assert_eq!(
            field("VmPeak:\t 7 kB\nVmPTE:\t    52 kB\n", "VmPTE:"),
            Some(52)
        );
    }

    #[test]
    fn what_is_resident_does_not_count_twice() {
        let unseen = Unseen {
            kernel: 10,
            shared: 100,
            resident_shared: 0,
        };
        let with = |kb, shared_kb| unseen.beside(Share { kb, shared_kb });
        assert_eq!((with(50, 0), with(50, 30), with(500, 400)), (160, 130, 510));
    }
}
