//! JSON files of this project: one object with the key `format`, read strictly, every
//! error with its place.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::{self, Display, Write as _};
use std::marker::PhantomData;

use serde::Deserialize;
use serde::de::value::MapAccessDeserializer;
use serde::de::{
    self, DeserializeSeed, Deserializer, Error as _, IgnoredAny, MapAccess, SeqAccess, Visitor,
};

use crate::formats::foreign;
use crate::{Digest, InputError, shown};

/// Stands between reason and hint in an error that passes through serde, which has room
/// for one text only; see [`with_hint`].
pub(crate) const HINT: &str = "\nhint: ";

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
            if let Some(kind) = foreign(bytes) {
                return Err(kind.refused(source));
            }
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
        _ => input.maybe_hint(hint),
    }
}

/// An error for serde whose hint arrives at [`json_error`].
pub fn with_hint<E: de::Error>(error: &dyn Display, hint: Option<&str>) -> E {
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

/// A reader of one list, entry by entry; [`Listed`] hands it to serde.
pub trait ReadList<'de>: Sized {
    /// The list in the words of an error.
    const EXPECTED: &'static str;
    /// The content of the list.
    type Value;
    /// Reads the list to its end.
    fn read<A: SeqAccess<'de>>(self, list: A) -> Result<Self::Value, A::Error>;
}

/// A [`ReadList`] as a seed of serde.
pub struct Listed<T>(pub T);

impl<'de, T: ReadList<'de>> DeserializeSeed<'de> for Listed<T> {
    type Value = T::Value;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<T::Value, D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de, T: ReadList<'de>> Visitor<'de> for Listed<T> {
    type Value = T::Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(T::EXPECTED)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<T::Value, A::Error> {
        self.0.read(list)
    }
}

/// Reads an object and checks it before the reader goes on, so that what the check
/// complains of gets the place where the object ends. An error that is raised later, among
/// the elements of a list, would get that of the next one.
pub fn checked<'de, D: Deserializer<'de>, R: Deserialize<'de>, T>(
    deserializer: D,
    expected: &'static str,
    check: impl FnOnce(R) -> Result<T, D::Error>,
) -> Result<T, D::Error> {
    struct Checked<R, F>(&'static str, F, PhantomData<R>);

    impl<'de, R, T, E, F> Visitor<'de> for Checked<R, F>
    where
        R: Deserialize<'de>,
        E: de::Error,
        F: FnOnce(R) -> Result<T, E>,
    {
        type Value = T;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str(self.0)
        }

        fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<T, A::Error> {
            let raw = R::deserialize(MapAccessDeserializer::new(map))?;
            (self.1)(raw).map_err(de::Error::custom)
        }
    }

    deserializer.deserialize_map(Checked(expected, check, PhantomData))
}

/// Reads an object whose keys are names of the file's own: at least one entry, in the order
/// of the file. `one` and `all` are the entries in the words of an error.
pub fn named<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    deserializer: D,
    one: &'static str,
    all: &'static str,
) -> Result<Vec<(String, T)>, D::Error> {
    struct Named<T>(&'static str, &'static str, PhantomData<T>);

    impl<'de, T: Deserialize<'de>> Visitor<'de> for Named<T> {
        type Value = Vec<(String, T)>;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            write!(f, "an object of {} by name", self.1)
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
            let Self(one, all, _) = self;
            let mut entries = Vec::new();
            let mut names = BTreeSet::new();
            while let Some(name) = map.next_key::<String>()? {
                if !names.insert(name.clone()) {
                    let reason = format!("the {one} {:?} is there twice", shown(&name));
                    let hint = format!("give each {one} its own name");
                    return Err(with_hint(&reason, Some(&hint)));
                }
                entries.push((name, map.next_value()?));
            }
            if entries.is_empty() {
                return Err(A::Error::custom(format_args!("there are no {all}")));
            }
            Ok(entries)
        }
    }

    deserializer.deserialize_map(Named(one, all, PhantomData))
}

/// Reads one key of a file that [`read_object`] has read: the second pass for what can only
/// be understood when all the rest is known. An error has its place.
pub fn read_key<'de, S: DeserializeSeed<'de>>(
    source: &str,
    bytes: &'de [u8],
    key: &'static str,
    seed: S,
) -> Result<S::Value, InputError> {
    struct Key<S>(&'static str, S);

    impl<'de, S: DeserializeSeed<'de>> Visitor<'de> for Key<S> {
        type Value = S::Value;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a JSON object")
        }

        fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<S::Value, A::Error> {
            let Self(key, seed) = self;
            let (mut seed, mut value) = (Some(seed), None);
            while let Some(found) = map.next_key::<String>()? {
                match seed.take_if(|_| found == key) {
                    Some(seed) => value = Some(map.next_value_seed(seed)?),
                    None => drop(map.next_value::<IgnoredAny>()?),
                }
            }
            value.ok_or_else(|| de::Error::missing_field(key))
        }
    }

    let mut document = serde_json::Deserializer::from_slice(bytes);
    let value = document.deserialize_map(Key(key, seed));
    value.map_err(|error| json_error(source, bytes, &error))
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

/// A digest as an optional key of [`begin`].
pub(crate) fn text(digest: Option<Digest>) -> Option<String> {
    digest.map(|digest| digest.to_string())
}

/// Appends a key whose value is a list, one entry per line.
pub fn push_lines<T>(
    text: &mut String,
    key: &str,
    entries: impl IntoIterator<Item = T>,
    write: impl FnMut(&mut String, T),
) {
    let _ = write!(text, "  \"{key}\": [");
    let any = push_entries(text, entries, ["\n    ", ",\n    "], write);
    text.push_str(if any { "\n  ]" } else { "]" });
}

/// Appends a list on one line.
pub(crate) fn push_list<T>(
    text: &mut String,
    entries: impl IntoIterator<Item = T>,
    write: impl FnMut(&mut String, T),
) {
    text.push('[');
    push_entries(text, entries, ["", ","], write);
    text.push(']');
}

/// Appends entries after their separators, the first one's and the others'. Returns whether there are any.
fn push_entries<T>(
    text: &mut String,
    entries: impl IntoIterator<Item = T>,
    [first, other]: [&str; 2],
    mut write: impl FnMut(&mut String, T),
) -> bool {
    let mut separator = first;
    for entry in entries {
        text.push_str(separator);
        write(text, entry);
        separator = other;
    }
    separator == other
}

/// Appends a finite number in the fewest digits that are read as the same number.
pub(crate) fn push_number(text: &mut String, number: f64) {
    let at = text.len();
    let _ = write!(text, "{number:?}");
    if text[at..].ends_with(".0") {
        text.truncate(text.len() - 2);
    }
}
