//! Sets of logical CPUs, in the notation of the kernel: `0-3,8`.

use std::fmt;
use std::io;
use std::ops::Deref;
use std::str::FromStr;

use rustix::process::Pid;
use serde::{Deserialize, Serialize};

/// CPUs are numbered below this; no kernel is built for more.
pub(super) const CPU_LIMIT: u32 = 8192;

/// Bits of a word of a mask.
pub(super) const WORD: usize = libc::c_ulong::BITS as usize;

/// The kernel's form of a mask: longer than `cpu_set_t`, which ends at 1024.
pub(super) type Words = [libc::c_ulong; CPU_LIMIT as usize / WORD];

/// Logical CPUs, ascending. Printed and serialised as the kernel lists them.
#[derive(Debug, Clone, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Cpus(Vec<u32>);

/// A list of CPUs is not written as the kernel writes it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a list of CPUs looks like `0-3,8`, with numbers below {CPU_LIMIT}")]
pub struct NoCpuList;

impl Cpus {
    /// The CPUs of both.
    #[must_use]
    pub fn union(&self, other: &Self) -> Self {
        self.iter().chain(other.iter()).copied().collect()
    }

    /// True if a CPU is one of them.
    pub fn has(&self, cpu: u32) -> bool {
        self.0.binary_search(&cpu).is_ok()
    }
}

impl Deref for Cpus {
    type Target = [u32];

    fn deref(&self) -> &[u32] {
        &self.0
    }
}

impl FromIterator<u32> for Cpus {
    fn from_iter<I: IntoIterator<Item = u32>>(cpus: I) -> Self {
        let mut cpus: Vec<u32> = cpus.into_iter().collect();
        cpus.sort_unstable();
        cpus.dedup();
        Self(cpus)
    }
}

impl FromStr for Cpus {
    type Err = NoCpuList;

    fn from_str(text: &str) -> Result<Self, NoCpuList> {
        let number = |text: &str| {
            let number = text.trim().parse::<u32>().ok();
            number.filter(|cpu| *cpu < CPU_LIMIT).ok_or(NoCpuList)
        };
        let text = text.trim();
        let mut cpus = Vec::new();
        // No CPU at all is an empty line.
        for part in text.split(',').filter(|_| !text.is_empty()) {
            let (first, last) = part.split_once('-').unwrap_or((part, part));
            let (first, last) = (number(first)?, number(last)?);
            if last < first || cpus.len() > CPU_LIMIT as usize {
                return Err(NoCpuList);
            }
            cpus.extend(first..=last);
        }
        Ok(cpus.into_iter().collect())
    }
}

impl fmt::Display for Cpus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let runs = self.0.chunk_by(|a, b| a + 1 == *b);
        for (at, run) in runs.enumerate() {
            let separator = if at == 0 { "" } else { "," };
            match run {
                [first, .., last] => write!(f, "{separator}{first}-{last}")?,
                only => write!(f, "{separator}{}", only[0])?,
            }
        }
        Ok(())
    }
}

impl Serialize for Cpus {
    fn serialize<S: serde::Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for Cpus {
    fn deserialize<D: serde::Deserializer<'de>>(d: D) -> Result<Self, D::Error> {
        let text = std::borrow::Cow::<'de, str>::deserialize(d)?;
        text.parse().map_err(serde::de::Error::custom)
    }
}

/// The CPUs that a thread, by default the calling one, may run on.
pub fn affinity(thread: Option<Pid>) -> io::Result<Cpus> {
    let words = words_of(thread)?;
    let cpus = (0..CPU_LIMIT).filter(|cpu| {
        let cpu = *cpu as usize;
        words[cpu / WORD] & (1 << (cpu % WORD)) != 0
    });
    Ok(cpus.collect())
}

/// The mask of a thread, as the kernel has it.
pub(super) fn words_of(thread: Option<Pid>) -> io::Result<Words> {
    let mut words: Words = [0; _];
    let raw = Pid::as_raw(thread);
    // SAFETY: the kernel writes at most as many bytes as the array has.
    let done =
        unsafe { libc::sched_getaffinity(raw, size_of::<Words>(), words.as_mut_ptr().cast()) };
    if done != 0 {
        return Err(io::Error::last_os_error());
    }
    Ok(words)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn lists_are_read_as_the_kernel_writes_them() {
        let cases = [
            ("", Some("")),
            ("\n", Some("")),
            ("0\n", Some("0")),
            ("0-3,8", Some("0-3,8")),
            ("8,0-1,1-2", Some("0-2,8")),
            ("3-1", None),
            ("0,,1", None),
            ("-", None),
            ("none", None),
            ("0-4294967295", None),
            ("8191", Some("8191")),
            ("8192", None),
        ];
        for (text, expected) in cases {
            let read = text.parse::<Cpus>().ok().map(|cpus| cpus.to_string());
            assert_eq!(read.as_deref(), expected, "{text:?}");
        }
    }

    proptest! {
        #[test]
        fn what_is_written_is_read(cpus in prop::collection::vec(0..CPU_LIMIT, 0..40)) {
            let cpus: Cpus = cpus.into_iter().collect();
            prop_assert_eq!(cpus.to_string().parse::<Cpus>(), Ok(cpus.clone()));
            let json = serde_json::to_string(&cpus).unwrap();
            prop_assert_eq!(serde_json::from_str::<Cpus>(&json).unwrap(), cpus);
        }

        #[test]
        fn no_text_is_a_panic(text in "[0-9,\\- \n]{0,40}") {
            let _ = text.parse::<Cpus>();
        }
    }
}
