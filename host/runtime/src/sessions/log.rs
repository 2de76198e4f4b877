//! A plugin's log, as much of it as is kept.

use fleetyard_abi::LogLevel;
use serde::Serialize;

/// Longest line that is kept whole, in bytes.
const LONGEST: usize = 16 << 10;

/// A line that a plugin wrote to the run's log.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct LogLine {
    /// Its level.
    pub level: LogLevel,
    /// The line.
    pub text: String,
}

/// The first lines of a log, within a limit of bytes.
#[derive(Debug, Default)]
pub(crate) struct Log {
    lines: Vec<LogLine>,
    bytes: usize,
    full: bool,
}

impl Log {
    /// Keeps a line, cut when it is very long, as long as there is room for it
    /// within `limit` bytes; says once that there is none.
    pub(crate) fn push(&mut self, level: LogLevel, text: &str, limit: usize) {
        if self.full {
            return;
        }
        let end = text.floor_char_boundary(LONGEST);
        let mut kept = text[..end].to_owned();
        if end < text.len() {
            kept.push('…');
        }
        // What an empty line costs is not nothing.
        self.bytes += kept.len() + size_of::<LogLine>();
        self.full = self.bytes > limit;
        let line = if self.full {
            let text = format!("the log is longer than {limit} bytes; the rest is not kept");
            LogLine {
                level: LogLevel::Warning,
                text,
            }
        } else {
            LogLine { level, text: kept }
        };
        self.lines.push(line);
    }

    /// Appends what another log kept, as long as there is room for it.
    pub(crate) fn append(&mut self, other: Self, limit: usize) {
        for LogLine { level, text } in other.lines {
            self.push(level, &text, limit);
        }
    }

    /// Hands over what was kept.
    pub(crate) fn take(&mut self) -> Vec<LogLine> {
        std::mem::take(self).lines
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_is_cut_and_says_so() {
        let mut log = Log::default();
        log.push(LogLevel::Info, &"ä".repeat(LONGEST), usize::MAX);
        for _ in 0..1000 {
            log.push(LogLevel::Info, "line", 40_000);
        }
        let lines = log.take();
        assert!(lines[0].text.len() < LONGEST + 4 && lines[0].text.ends_with('…'));
        assert!(lines.len() < 1000);
        let last = &lines[lines.len() - 1];
        assert_eq!(
            last.text,
            "the log is longer than 40000 bytes; the rest is not kept"
        );
    }
}
