//! Maps in JSON: a list with the rows of the map as texts, read letter by letter so that an error
//! has its place.

use std::borrow::Cow;
use std::fmt;

use serde::Deserialize;
use serde::de::{self, Deserializer, Visitor};

use crate::files::{column, quote, stem};
use crate::{Grid, InputError};

/// A row, borrowed from the file where it has no escapes, so that its place is known.
pub(crate) struct Text<'a>(Cow<'a, str>);

impl<'de: 'a, 'a> Deserialize<'de> for Text<'a> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Row;
        impl<'de> Visitor<'de> for Row {
            type Value = Text<'de>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a row of the map as a text")
            }
            fn visit_borrowed_str<E: de::Error>(self, text: &'de str) -> Result<Text<'de>, E> {
                Ok(Text(Cow::Borrowed(text)))
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<Text<'de>, E> {
                Ok(Text(Cow::Owned(text.to_owned())))
            }
        }
        deserializer.deserialize_str(Row)
    }
}

impl Text<'_> {
    pub(crate) fn as_str(&self) -> &str {
        &self.0
    }

    fn width(&self) -> u32 {
        u32::try_from(self.0.chars().count()).unwrap_or(u32::MAX)
    }
}

/// The rows under a key of a file.
pub(crate) struct Rows<'a> {
    source: &'a str,
    bytes: &'a [u8],
    key: &'static str,
    texts: &'a [Text<'a>],
    pub(crate) count: u32,
    pub(crate) cols: u32,
}

impl<'a> Rows<'a> {
    /// Counts rows and columns, of which there has to be one at least.
    pub(crate) fn new(
        source: &'a str,
        bytes: &'a [u8],
        key: &'static str,
        texts: &'a [Text<'a>],
    ) -> Result<Self, InputError> {
        let mut rows = Self {
            source,
            bytes,
            key,
            texts,
            count: u32::try_from(texts.len()).unwrap_or(u32::MAX),
            cols: 0,
        };
        let Some(first) = texts.first() else {
            return Err(rows.fault_at(key, format!("the {key} has no rows")));
        };
        rows.cols = first.width();
        Ok(rows)
    }

    /// An error at the place of a key of the file.
    pub(crate) fn fault_at(&self, key: &str, reason: String) -> InputError {
        let wanted = format!("\"{key}\"");
        let found = (self.bytes.windows(wanted.len())).position(|at| at == wanted.as_bytes());
        let (line, column) = line_column(self.bytes, found.unwrap_or(0));
        InputError::new(self.source, reason).at(line, column)
    }

    /// An error at a byte of a row.
    pub(crate) fn fault_in(&self, row: &Text<'_>, at: usize, reason: String) -> InputError {
        match place(self.bytes, row, at) {
            Some((line, column)) => InputError::new(self.source, reason).at(line, column),
            None => self.fault_at(self.key, reason),
        }
    }

    /// The letters of all rows, which have to be of one width. `name` is what a letter is called.
    pub(crate) fn letters(
        &self,
        name: &str,
        hint: &str,
        is_known: impl Fn(u8) -> bool,
    ) -> Result<Vec<u8>, InputError> {
        let (key, cols) = (self.key, self.cols);
        let cells = u64::from(self.count) * u64::from(cols);
        let mut letters = Vec::with_capacity(cells.min(self.bytes.len() as u64) as usize);
        let is_wrong = |(_, letter): &(usize, char)| !u8::try_from(*letter).is_ok_and(&is_known);
        for (number, row) in self.texts.iter().enumerate() {
            let text = row.as_str();
            if let Some((at, letter)) = text.char_indices().find(is_wrong) {
                let letter = quote(letter.encode_utf8(&mut [0; 4]).as_bytes());
                let reason = format!("unknown {name} {letter} in row {number} of the {key}");
                return Err(self.fault_in(row, at, reason).hint(hint));
            }
            if row.width() != cols {
                let reason = format!(
                    "row {number} of the {key} has {} letters, but the first one has {cols}",
                    row.width()
                );
                return Err(self.fault_in(row, text.len().min(cols as usize), reason));
            }
            letters.extend_from_slice(text.as_bytes());
        }
        Ok(letters)
    }

    /// The map whose terrain letters these are; its name is the file's stem.
    pub(crate) fn grid(&self, hint: &str) -> Result<Grid, InputError> {
        let letters = self.letters("terrain letter", hint, |letter| {
            Grid::LETTERS.contains(&letter)
        })?;
        Grid::new(stem(self.source), self.count, self.cols, letters).map_err(|error| InputError {
            hint: error.hint,
            ..self.fault_at(self.key, error.reason)
        })
    }
}

/// Line and column of the letter at byte `at` of a row, if the row is a part of the file.
fn place(bytes: &[u8], row: &Text<'_>, at: usize) -> Option<(u64, u64)> {
    let Cow::Borrowed(text) = row.0 else {
        return None;
    };
    let at = (text.as_ptr() as usize + at).checked_sub(bytes.as_ptr() as usize)?;
    (at < bytes.len()).then(|| line_column(bytes, at))
}

fn line_column(bytes: &[u8], at: usize) -> (u64, u64) {
    let lines = bytes[..at].split(|byte| *byte == b'\n');
    let begin = lines.clone().next_back().map_or(at, |last| at - last.len());
    (lines.count() as u64, column(&bytes[begin..], at - begin))
}
