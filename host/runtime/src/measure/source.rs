//! The kernel's files below a root, so that tests can bring a machine of their own.

use std::fs::{self, File};
use std::io::Read;
use std::path::PathBuf;
use std::str::FromStr;

use super::Cpus;

/// No file that is read here is longer, not even `/proc/cpuinfo` of 8192 CPUs.
const LONGEST: u64 = 64 << 20;

/// The root above `/proc`, `/sys` and `/etc`. Paths are given without the first `/`.
#[derive(Debug, Clone)]
pub(super) struct Source(PathBuf);

impl Source {
    /// This machine.
    pub(super) fn system() -> Self {
        Self::at("/")
    }

    pub(super) fn at(root: impl Into<PathBuf>) -> Self {
        Self(root.into())
    }

    /// A file as it is; absent when it does not exist or may not be read.
    pub(super) fn raw(&self, path: &str) -> Option<String> {
        let file = File::open(self.0.join(path)).ok()?;
        let mut bytes = Vec::new();
        file.take(LONGEST).read_to_end(&mut bytes).ok()?;
        // Strings from the firmware are not always UTF-8.
        Some(match String::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => String::from_utf8_lossy(error.as_bytes()).into_owned(),
        })
    }

    /// One line of text; absent when there is nothing in it.
    pub(super) fn text(&self, path: &str) -> Option<String> {
        let raw = self.raw(path)?;
        let text = raw.trim_matches(|c: char| c.is_whitespace() || c == '\0');
        (!text.is_empty()).then(|| text.to_owned())
    }

    pub(super) fn number<T: FromStr>(&self, path: &str) -> Option<T> {
        self.text(path)?.parse().ok()
    }

    pub(super) fn cpus(&self, path: &str) -> Option<Cpus> {
        self.raw(path)?.parse().ok()
    }

    pub(super) fn exists(&self, path: &str) -> bool {
        self.0.join(path).exists()
    }

    /// The numbers N for which `folder` has an entry `prefixN`, ascending.
    pub(super) fn numbered(&self, folder: &str, prefix: &str) -> Vec<u32> {
        let entries = fs::read_dir(self.0.join(folder)).into_iter().flatten();
        let number = |name: &str| name.strip_prefix(prefix)?.parse().ok();
        let mut numbers: Vec<u32> = entries
            .filter_map(|entry| number(entry.ok()?.file_name().to_str()?))
            .collect();
        numbers.sort_unstable();
        numbers
    }
}

/// The values of one key in lines of `key : value`, in order.
pub(super) fn values<'a>(text: &'a str, key: &'a str) -> impl Iterator<Item = &'a str> {
    text.lines().filter_map(move |line| {
        let (name, value) = line.split_once(':')?;
        (name.trim_end() == key).then(|| value.trim())
    })
}
