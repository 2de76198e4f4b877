//! JSON files of this project: one object with the key `format`, read strictly, every
//! error with its place.

use std::borrow::Cow;
use std::fmt::Write as _;

use serde::de::{Deserializer, Error as _};
use serde::{Deserialize, de};

use crate::{Digest, InputError};

/// Stands between reason and hint in an error that passes through serde, which has room
/// for one text only; see [`with_hint`].
const HINT: &str = "\nhint: ";

/// Parses a file that is one JSON object. `source` is named in errors, and `hint` says
/// what such a file is.
pub fn read_object<'de, T: Deserialize<'de>>(
    source: &str,
    bytes: &'de [u8],
    hint: &str,
) -> Result<T, InputError> {
    match bytes.iter().position(|byte| !byte.is_ascii_whitespace()) {
        None => return Err(InputError::new(source, "the file is empty").hint(hint)),
        Some(at) if bytes[at] != b'{' => {
            // Serde would take a list for the fields in order.
            let line = bytes[..at].split(|byte| *byte == b'\n');
            let number = line.clone().count() as u64;
            let column = line.clone().next_back().map_or(0, <[u8]>::len) as u64 + 1;
            return Err(InputError::new(source, "this is not a JSON object")
                .at(number, column)
                .hint(hint));
        }
        Some(_) => {}
    }
    serde_json::from_slice(bytes).map_err(|error| json_error(source, bytes, &error))
}

/// Turns serde_json's error about a text into ours: place apart from reason.
pub fn json_error(source: &str, text: &[u8], error: &serde_json::Error) -> InputError {
    let place = format!(" at line {} column {}", error.line(), error.column());
    let whole = error.to_string();
    let reason = whole.strip_suffix(&place).unwrap_or(&whole);
    let (reason, hint) = match reason.split_once(HINT) {
        Some((reason, hint)) => (reason, Some(hint).filter(|hint| !hint.is_empty())),
        None => (reason, None),
    };
    let input = InputError::new(source, reason);
    let input = match error.line() {
        0 => input,
        line => {
            // Serde counts the bytes that it has read, the one at fault included.
            let found = text.split(|byte| *byte == b'\n').nth(line - 1);
            let found = found.unwrap_or_default();
            let read = &found[..error.column().min(found.len())];
            let column = String::from_utf8_lossy(read).chars().count();
            input.at(line as u64, column.max(1) as u64)
        }
    };
    match error.classify() {
        serde_json::error::Category::Eof => input.hint("the file is truncated"),
        serde_json::error::Category::Syntax => input.hint("the file is not valid JSON"),
        _ => match hint {
            Some(hint) => input.hint(hint),
            None => input,
        },
    }
}

/// An error for serde whose hint arrives at [`json_error`].
pub fn with_hint<E: de::Error>(error: &dyn std::fmt::Display, hint: Option<&str>) -> E {
    match hint {
        Some(hint) => E::custom(format_args!("{error}{HINT}{hint}")),
        None => E::custom(error),
    }
}

/// Reads the key `format`, so that a wrong one is an error with its place. For a field
/// with `deserialize_with`.
pub fn format<'de, D: Deserializer<'de>>(
    deserializer: D,
    expected: &'static str,
) -> Result<(), D::Error> {
    let found = Cow::<'de, str>::deserialize(deserializer)?;
    if found == expected {
        return Ok(());
    }
    let shown: String = found.chars().take(40).collect();
    Err(D::Error::custom(format!(
        "format is {shown:?}, expected {expected:?}"
    )))
}

/// Refuses content that does not have the digest that its file names under `key`.
pub(crate) fn check_digest(
    source: &str,
    key: &str,
    named: Option<Digest>,
    what: &str,
    digest: impl FnOnce() -> Digest,
) -> Result<(), InputError> {
    let Some(named) = named else { return Ok(()) };
    let found = digest();
    if named == found {
        return Ok(());
    }
    let reason = format!("{key} is {named}, but {what} {found}");
    Err(InputError::new(source, reason).hint(format!(
        "the file was changed after it was written; remove {key} if that was on purpose"
    )))
}

/// Begins a file: its format, and the optional keys that are texts.
pub(crate) fn begin(format: &str, optional: &[(&str, Option<String>)]) -> String {
    let mut text = format!("{{\n  \"format\": \"{format}\",\n");
    for (key, value) in optional {
        if let Some(value) = value {
            let quoted = serde_json::Value::from(value.as_str());
            // Writing to a string cannot fail.
            let _ = writeln!(text, "  \"{key}\": {quoted},");
        }
    }
    text
}

/// Appends a finite number in the fewest digits that are read as the same number.
pub(crate) fn push_number(text: &mut String, number: f64) {
    let at = text.len();
    let _ = write!(text, "{number:?}");
    if text[at..].ends_with(".0") {
        text.truncate(text.len() - 2);
    }
}
