//! The one error type for bad input: where, what, and what to do about it.

use std::fmt;

/// Something read from outside (a file, an argument, a plugin's answer) is not
/// what it must be.
///
/// `Display` prints `source:line:column: reason`; the hint is kept apart so that
/// the command line can print it on a `hint:` line of its own.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InputError {
    /// File path as the user gave it, or a name such as `plan`.
    pub source: String,
    /// Line, counted from 1, where there is one.
    pub line: Option<u64>,
    /// Column in characters, counted from 1, where there is one.
    pub column: Option<u64>,
    /// The reason, in one sentence without a full stop.
    pub reason: String,
    /// A way out.
    pub hint: Option<String>,
}

impl InputError {
    /// An error about `source` as a whole.
    pub fn new(source: impl Into<String>, reason: impl Into<String>) -> Self {
        Self {
            source: source.into(),
            line: None,
            column: None,
            reason: reason.into(),
            hint: None,
        }
    }

    /// Adds the place, both counted from 1.
    #[must_use]
    pub fn at(mut self, line: u64, column: u64) -> Self {
        self.line = Some(line);
        self.column = Some(column);
        self
    }

    /// Adds the line alone, counted from 1.
    #[must_use]
    pub fn at_line(mut self, line: u64) -> Self {
        self.line = Some(line);
        self
    }

    /// Adds what the user can do about it.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// Adds what the user can do about it, where that is known.
    #[must_use]
    pub fn maybe_hint(self, hint: Option<impl Into<String>>) -> Self {
        match hint {
            Some(hint) => self.hint(hint),
            None => self,
        }
    }

    /// Adds what the user can do about it, unless that was said already.
    #[must_use]
    pub fn or_hint(self, hint: &str) -> Self {
        match self.hint {
            Some(_) => self,
            None => self.hint(hint),
        }
    }
}

impl fmt::Display for InputError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.source)?;
        if let Some(line) = self.line {
            write!(f, ":{line}")?;
            if let Some(column) = self.column {
                write!(f, ":{column}")?;
            }
        }
        write!(f, ": {}", self.reason)
    }
}

impl std::error::Error for InputError {}

/// The candidate that was probably meant, for a hint: at most `most` edits away.
pub fn nearest<T: AsRef<str> + Ord>(
    name: &str,
    candidates: impl IntoIterator<Item = T>,
    most: usize,
) -> Option<T> {
    candidates
        .into_iter()
        .map(|candidate| {
            let distance = strsim::damerau_levenshtein(name, candidate.as_ref());
            (distance, candidate)
        })
        .min()
        .filter(|(distance, _)| *distance <= most)
        .map(|(_, candidate)| candidate)
}
