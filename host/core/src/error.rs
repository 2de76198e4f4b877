//! The one error type for bad input: where, what, and what to do about it.

use std::fmt::{self, Write as _};

use crate::files::one_line;

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
            reason: short_numbers(reason.into()),
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
        f.write_str(&one_line(&self.source))?;
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

/// A message in which numbers of very many digits are short: `1e308`, and not a one with 308 zeros, as
/// numbers are printed that are far too large, or far too small.
pub fn short_numbers(message: String) -> String {
    /// Floats of fewer digits are left as they are; digests have exactly 32 letters.
    const MOST: usize = 32;
    let is_part = |letter: &u8| letter.is_ascii_digit() || *letter == b'.';
    let bytes = message.as_bytes();
    let longest = bytes
        .split(|letter| !is_part(letter))
        .map(<[u8]>::len)
        .max();
    if longest.unwrap_or(0) <= MOST {
        return message;
    }
    let mut short = String::with_capacity(message.len());
    let mut rest = message.as_str();
    while let Some(first) = rest.bytes().position(|letter| is_part(&letter)) {
        let (before, from) = rest.split_at(first);
        let end = from.bytes().position(|letter| !is_part(&letter));
        let (word, after) = from.split_at(end.unwrap_or(from.len()));
        // A point at the end is that of a sentence.
        let number = word.trim_end_matches('.');
        short.push_str(before);
        match number.parse::<f64>() {
            Ok(value) if number.len() > MOST && value.is_finite() => {
                // Writing to a string cannot fail.
                let _ = write!(short, "{value:e}");
            }
            _ => short.push_str(number),
        }
        short.push_str(&word[number.len()..]);
        rest = after;
    }
    short + rest
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_hundreds_of_digits_are_short() {
        for (value, expected) in [
            (1e308, "x is 1e308, too far."),
            (-f64::MAX, "x is -1.7976931348623157e308, too far."),
            (5e-324, "x is 5e-324, too far."),
            (0.25, "x is 0.25, too far."),
            (1e21, "x is 1000000000000000000000, too far."),
        ] {
            let error = InputError::new("a", format!("x is {value}, too far."));
            assert_eq!(error.reason, expected);
        }
        // The end of a sentence, digests, and what is no number of ours stay.
        assert_eq!(short_numbers(format!("It is {}.", 1e300)), "It is 1e300.");
        for text in [
            "",
            "a 0123456789 0123456789",
            "12345678901234567890123456789012",
            "1.2.3…",
        ] {
            assert_eq!(short_numbers(text.to_owned()), text);
        }
        let many = "1.".repeat(40);
        assert_eq!(short_numbers(many.clone()), many);
    }
}
