//! TOML by serde, with places: what a file says becomes the types that it is for, and every
//! fault has its line, its column and a way out.
//!
//! ```
//! use fleetyard_core::document;
//!
//! #[derive(serde::Deserialize)]
//! #[serde(deny_unknown_fields)]
//! struct Robot {
//!     speed: f64,
//!     colour: String,
//! }
//!
//! let read = |text| document::read("robot.toml", text, &[], |root| root.read::<Robot>());
//! let robot = read("speed = 2\ncolour = \"red\"\n")?;
//! assert_eq!((robot.speed, robot.colour.as_str()), (2.0, "red"));
//! let fault = read("speed = 2\ncolor = \"red\"\n").map(|robot| robot.speed).unwrap_err();
//! assert_eq!(fault.to_string(), "robot.toml:2:1: unknown key `color`");
//! assert_eq!(fault.hint.as_deref(), Some("did you mean `colour`?"));
//! # Ok::<(), fleetyard_core::InputError>(())
//! ```

mod value;

use std::fmt;

use serde::Deserializer;
use serde::de::{self, Unexpected, Visitor};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::json::{HINT, with_hint};
use crate::{InputError, Words, nearest, shown};

pub use value::Value;

/// Reads a document: `source` is its name in errors, the values of `settings` take the place
/// of its own, and `reader` gets its root.
pub fn read<T>(
    source: &str,
    text: &str,
    settings: &[Setting],
    reader: impl FnOnce(Value<'_>) -> Result<T, InputError>,
) -> Result<T, InputError> {
    let texts = Texts {
        source,
        text,
        settings,
    };
    // A byte is counted from the start of the text, on through the settings: each begins one
    // byte after the end of what is before it, here after so much space.
    let mut begin = text.len() + 1;
    let mut spaced = Vec::new();
    for setting in settings {
        spaced.push(" ".repeat(begin) + &setting.text);
        begin += setting.text.len() + 1;
    }
    let mut root = texts.parse(text)?;
    for set in &spaced {
        merge(&mut root, texts.parse(set)?);
    }
    reader(Value::root(&texts, &DeValue::Table(root)))
}

/// The text that is read, and what is set over it.
#[derive(Debug)]
struct Texts<'a> {
    source: &'a str,
    text: &'a str,
    settings: &'a [Setting],
}

impl Texts<'_> {
    fn parse<'t>(&self, text: &'t str) -> Result<DeTable<'t>, InputError> {
        let parsed = DeTable::parse(text).map(Spanned::into_inner);
        parsed.map_err(|error| {
            let reason = not_toml(&error);
            match error.span() {
                Some(span) => self.place(span.start).error(reason),
                None => InputError::new(self.source, reason),
            }
        })
    }

    /// The place of a byte.
    fn place(&self, at: usize) -> Place {
        let mut end = self.text.len();
        for setting in self.settings {
            if at <= end {
                break;
            }
            end += setting.text.len() + 1;
            if at <= end {
                return Place {
                    source: setting.option.clone(),
                    line_column: None,
                };
            }
        }
        let before = &self.text[..self.text.floor_char_boundary(at)];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = before.matches('\n').count() + 1;
        let column = before[line_start..].chars().count() + 1;
        Place {
            source: self.source.to_owned(),
            line_column: Some((line as u64, column as u64)),
        }
    }
}

fn not_toml(error: &toml::de::Error) -> String {
    let lines: Vec<&str> = error.message().lines().collect();
    format!("this is not TOML: {}", lines.join(", "))
}

/// Values of `from` take the place of those in `into`, key by key in tables.
fn merge<'a>(into: &mut DeTable<'a>, from: DeTable<'a>) {
    for (key, value) in from {
        let span = value.span();
        let value = match (into.get_mut(&key).map(Spanned::get_mut), value.into_inner()) {
            (Some(DeValue::Table(old)), DeValue::Table(new)) => {
                merge(old, new);
                continue;
            }
            (_, value) => value,
        };
        into.remove(&key);
        into.insert(key, Spanned::new(span, value));
    }
}

/// A value that is set from elsewhere, such as the command line: `protocol.repeats=3`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Setting {
    /// Its name in errors.
    option: String,
    /// As TOML.
    text: String,
}

impl Setting {
    /// The same as text that [`Setting::new`] reads.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// Reads `NAME=VALUE`, where the name is that of a key with dots between the tables
    /// that it is in. The value is TOML, and text where it is not. `option` says in errors
    /// how it was given.
    pub fn new(option: &str, given: &str) -> Result<Self, InputError> {
        let named = format!("{option} {}", shown(given));
        let wrong = |reason: String| {
            let hint = format!("write {option} TABLE.KEY=VALUE");
            Err(InputError::new(named.as_str(), reason).hint(hint))
        };
        let Some((key, value)) = given.split_once('=') else {
            return wrong("there is no value".to_owned());
        };
        if given.contains(char::is_control) {
            return wrong("there is a control character".to_owned());
        }
        let quoted = serde_json::Value::from(value.trim()).to_string();
        let texts = [given.to_owned(), format!("{key}={quoted}")];
        let mut fault = String::new();
        for text in texts {
            match DeTable::parse(&text) {
                // A comment sets nothing.
                Ok(root) if root.get_ref().is_empty() => {}
                Ok(_) => {
                    let option = named;
                    return Ok(Self { option, text });
                }
                Err(error) => fault = not_toml(&error),
            }
        }
        if fault.is_empty() {
            "there is no key".clone_into(&mut fault);
        }
        wrong(fault)
    }
}

/// A place in a document, for errors that are found once the text is gone.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Place {
    source: String,
    line_column: Option<(u64, u64)>,
}

impl Place {
    /// A place without lines, such as an option of a command line.
    pub fn outside(source: impl Into<String>) -> Self {
        Self {
            source: source.into(),
            line_column: None,
        }
    }

    /// An error here.
    pub fn error(&self, reason: impl Into<String>) -> InputError {
        let error = InputError::new(self.source.as_str(), reason);
        match self.line_column {
            Some((line, column)) => error.at(line, column),
            None => error,
        }
    }

    /// An error about a file that is named here. Within the file it has a place of its
    /// own; what is wrong with the file as a whole is wrong here.
    pub fn error_in_file(&self, error: InputError) -> InputError {
        if error.line.is_some() {
            return error;
        }
        InputError {
            hint: error.hint,
            ..self.error(format!("{}: {}", error.source, error.reason))
        }
    }
}

/// A fault of a value, on its way through serde to the place of the value.
#[derive(Debug)]
pub struct Fault {
    /// A reason that begins with `it ` or ends with ` in it` is about a value or a table, whose
    /// name takes the pronoun's place.
    reason: String,
    hint: Option<String>,
    /// The keys that are known, if the fault is an unknown one.
    known: Option<&'static [&'static str]>,
    place: Option<Place>,
}

impl Fault {
    /// A fault without a hint.
    pub fn new(reason: impl Into<String>) -> Self {
        Self {
            reason: reason.into(),
            hint: None,
            known: None,
            place: None,
        }
    }

    /// Adds what to do about it.
    #[must_use]
    pub fn hint(mut self, hint: impl Into<String>) -> Self {
        self.hint = Some(hint.into());
        self
    }

    /// A word that is none of those that are known.
    pub fn word(word: &str, known: &[&str]) -> Self {
        let fault = Self::new(format!("it cannot be \"{}\"", shown(word)));
        fault.hint(match nearest(word, known, 3) {
            Some(near) => format!("did you mean \"{near}\"?"),
            None => format!("it is one of {}", known.join(", ")),
        })
    }

    fn error(self) -> InputError {
        let error = self.place.unwrap_or_default().error(self.reason);
        InputError {
            hint: self.hint,
            ..error
        }
    }
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.reason)
    }
}

impl std::error::Error for Fault {}

impl de::Error for Fault {
    fn custom<T: fmt::Display>(message: T) -> Self {
        let text = message.to_string();
        match text.split_once(HINT) {
            Some((reason, hint)) => Self::new(reason).hint(hint),
            None => Self::new(text),
        }
    }

    fn invalid_type(found: Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        let found = match found {
            Unexpected::Bool(_) => "a boolean",
            Unexpected::Signed(_) | Unexpected::Unsigned(_) => "an integer",
            Unexpected::Float(_) => "a number",
            Unexpected::Str(_) => "a string",
            Unexpected::Seq => "a list",
            Unexpected::Map => "a table",
            Unexpected::Other(other) => other,
            _ => "something else",
        };
        let expected = expected.to_string();
        let expected = match expected.as_str() {
            "a boolean" => "true or false",
            "u32" | "u64" | "usize" => "an integer",
            "f64" | "a JSON number" => "a number",
            "any valid JSON value" => "a string, a number or a boolean",
            "a sequence" => "a list",
            "a map" => "a table",
            other => other,
        };
        Self::custom(format_args!("it is {found}, expected {expected}"))
    }

    fn invalid_value(found: Unexpected<'_>, expected: &dyn de::Expected) -> Self {
        let most = match expected.to_string().as_str() {
            "u32" => u32::MAX.into(),
            "u64" | "usize" => u64::MAX,
            other => return Self::new(format!("it is {found}, expected {other}")),
        };
        Self::new(format!("it is not between 0 and {most}"))
    }

    fn unknown_variant(word: &str, known: &'static [&'static str]) -> Self {
        Self::word(word, known)
    }

    fn unknown_field(key: &str, known: &'static [&'static str]) -> Self {
        Self {
            known: Some(known),
            ..Self::new(format!("unknown key `{}` in it", shown(key)))
        }
    }

    fn missing_field(key: &'static str) -> Self {
        Self::new(format!("the key `{key}` is missing in it")).hint(format!("add `{key} = …`"))
    }
}

/// Reads a text that `read` understands. `hint` says how to write one.
pub fn text<'de, D: Deserializer<'de>, T>(
    deserializer: D,
    hint: &str,
    read: impl FnOnce(&str) -> Result<T, Fault>,
) -> Result<T, D::Error> {
    struct Text<'h, F>(&'h str, F);

    impl<T, F: FnOnce(&str) -> Result<T, Fault>> Visitor<'_> for Text<'_, F> {
        type Value = T;

        fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
            f.write_str("a string")?;
            match self.0 {
                "" => Ok(()),
                hint => write!(f, "{HINT}{hint}"),
            }
        }

        fn visit_str<E: de::Error>(self, text: &str) -> Result<T, E> {
            (self.1)(text).map_err(|fault| with_hint(&fault, fault.hint.as_deref()))
        }
    }

    deserializer.deserialize_str(Text(hint, read))
}

/// Reads a text that says something. For a field with `deserialize_with`.
pub fn nonempty<'de, D: Deserializer<'de>, T: From<String>>(
    deserializer: D,
) -> Result<T, D::Error> {
    text(deserializer, "", |text| {
        not_empty(text).map(|text| text.to_owned().into())
    })
}

/// Refuses a text that says nothing.
pub fn not_empty(text: &str) -> Result<&str, Fault> {
    match text.trim() {
        "" => Err(Fault::new("it is empty")),
        _ => Ok(text),
    }
}

/// Reads an integer, both bounds included, as an `N`. For a field with `deserialize_with`.
pub fn between<'de, const LOW: u64, const HIGH: u64, N, T, D>(
    deserializer: D,
) -> Result<T, D::Error>
where
    N: TryFrom<u64>,
    T: From<N>,
    D: Deserializer<'de>,
{
    let bounds = Whole {
        low: LOW,
        high: HIGH,
    };
    let number = N::try_from(deserializer.deserialize_i128(bounds)?);
    let number = number.map_err(|_| de::Error::custom(bounds.reason()))?;
    Ok(number.into())
}

/// An integer, both bounds included.
#[derive(Clone, Copy)]
struct Whole {
    low: u64,
    high: u64,
}

impl Whole {
    fn reason(self) -> String {
        format!("it is not between {} and {}", self.low, self.high)
    }
}

impl Visitor<'_> for Whole {
    type Value = u64;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("an integer")
    }

    fn visit_i128<E: de::Error>(self, number: i128) -> Result<u64, E> {
        let number = u64::try_from(number).ok();
        let fits = number.filter(|number| (self.low..=self.high).contains(number));
        fits.ok_or_else(|| E::custom(self.reason()))
    }
}

/// Reads one of some words of an enum that has more.
pub fn one_of<'de, D: Deserializer<'de>, T: Words>(
    deserializer: D,
    values: &[T],
) -> Result<T, D::Error> {
    text(deserializer, "", |text| {
        let found = values.iter().find(|value| value.name() == text);
        found.copied().ok_or_else(|| {
            let words: Vec<&str> = values.iter().map(|value| value.name()).collect();
            Fault::word(text, &words)
        })
    })
}

#[cfg(test)]
mod tests {
    use serde::Deserialize;

    use super::*;

    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Root {
        #[serde(default)]
        name: String,
        protocol: Protocol,
    }

    #[derive(Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Protocol {
        #[serde(deserialize_with = "between::<1, 9, u64, _, _>")]
        repeats: u64,
        seeds: Vec<Seed>,
        clock: Option<Clock>,
    }

    #[derive(Deserialize)]
    struct Seed(#[serde(deserialize_with = "between::<0, 99, u64, _, _>")] u64);

    #[derive(Debug, Deserialize)]
    #[serde(rename_all = "kebab-case")]
    enum Clock {
        Host,
        LessEmpty,
    }

    const TEXT: &str = "[protocol]\nrepeats = 1\nseeds = [1]\n";

    fn set(settings: &[&str]) -> Result<String, InputError> {
        let settings: Result<Vec<Setting>, InputError> = settings
            .iter()
            .map(|given| Setting::new("--set", given))
            .collect();
        let read: Root = read("a.toml", TEXT, &settings?, |root| root.read())?;
        let Root { name, protocol } = read;
        let seeds: Vec<u64> = protocol.seeds.iter().map(|seed| seed.0).collect();
        let (repeats, clock) = (protocol.repeats, protocol.clock);
        Ok(format!("{repeats} {seeds:?} {clock:?} {name}"))
    }

    #[test]
    fn settings_take_the_place_of_values() {
        let told = |settings: &[&str]| set(settings).unwrap();
        assert_eq!(told(&[]), "1 [1] None ");
        let both = ["protocol.repeats=3", "protocol.seeds=[4, 5]"];
        assert_eq!(told(&both), "3 [4, 5] None ");
        // The last one counts, and a word needs no quotes.
        let both = [
            "protocol.clock=host",
            "protocol.clock = less-empty",
            "name=x y",
        ];
        assert_eq!(told(&both), "1 [1] Some(LessEmpty) x y");
    }

    #[test]
    fn what_is_wrong_with_a_setting_is_said_of_it() {
        let cases = [
            (
                "protocol.repeats=0",
                "--set protocol.repeats=0: `repeats` is not between 1 and 9",
            ),
            (
                "protocol.repeat=2",
                "--set protocol.repeat=2: unknown key `repeat` in [protocol]",
            ),
            (
                "protocol.seeds=[1, 100]",
                "--set protocol.seeds=[1, 100]: `seeds` is not between 0 and 99",
            ),
            (
                "protocol=3",
                "--set protocol=3: `protocol` is an integer, expected a table",
            ),
            (
                "protocol.repeats",
                "--set protocol.repeats: there is no value",
            ),
            ("#a=1", "--set #a=1: there is no key"),
        ];
        for (given, told) in cases {
            assert_eq!(set(&[given]).unwrap_err().to_string(), told);
        }
        // The text is blamed for what it says itself.
        let settings = [Setting::new("--set", "protocol.clock=call").unwrap()];
        let fault = read("a.toml", "b = ", &settings, |_| Ok(())).unwrap_err();
        let fault = fault.to_string();
        assert!(fault.starts_with("a.toml:1:5: this is not TOML"), "{fault}");
    }

    /// The error of a protocol and its hint.
    fn fault(protocol: &str) -> String {
        let text = format!("[protocol]\n{protocol}");
        let read: Result<Root, InputError> = read("a.toml", &text, &[], |root| root.read());
        let error = read.err().expect(protocol);
        format!("{error} | {}", error.hint.clone().unwrap_or_default())
    }

    #[test]
    fn types_that_do_not_fit_are_named_as_toml_has_them() {
        let cases = [
            (
                "'1'",
                "a.toml:2:11: `repeats` is a string, expected an integer | ",
            ),
            (
                "1.0",
                "a.toml:2:11: `repeats` is a number, expected an integer | ",
            ),
            (
                "2001-01-01",
                "a.toml:2:11: `repeats` is a date, expected an integer | ",
            ),
            (
                "[1]",
                "a.toml:2:11: `repeats` is a list, expected an integer | ",
            ),
            (
                "0xffffffffffffffffffff",
                "a.toml:2:11: `repeats` is not between 1 and 9 | ",
            ),
            ("nan", "a.toml:2:11: `repeats` is not a finite number | "),
        ];
        for (value, told) in cases {
            assert_eq!(fault(&format!("repeats = {value}")), told);
        }
    }

    #[test]
    fn the_first_fault_of_a_file_is_told() {
        let cases = [
            (
                "seeds = 1\nrepeats = 0",
                "a.toml:2:9: `seeds` is an integer, expected a list | ",
            ),
            (
                "repeats = 1\nseed = [1]\nseeds = 1",
                "a.toml:3:1: unknown key `seed` in [protocol] | did you mean `seeds`?",
            ),
            (
                "seeds = [1]",
                "a.toml:1:1: the key `repeats` is missing in [protocol] | add `repeats = …`",
            ),
            (
                "clock = 'monotonic'\n",
                "a.toml:2:9: `clock` cannot be \"monotonic\" | it is one of host, less-empty",
            ),
        ];
        for (protocol, told) in cases {
            assert_eq!(fault(protocol), told);
        }
        // A list is not taken for the values of a table in order.
        let read: Result<Root, InputError> =
            read("a.toml", "protocol = [1, [1]]", &[], |root| root.read());
        let told = read.err().map(|error| error.reason);
        let expected = "`protocol` is a list, expected a table";
        assert_eq!(told.as_deref(), Some(expected));
    }

    #[test]
    fn a_table_over_another_one_has_its_own_values_first() {
        let text = "a = { x = 1, y = 2 }\nb = { y = 3, z = 4, more = 5 }";
        let told = read("a.toml", text, &[], |root| {
            let (a, b) = (root.require("a")?, root.require("b")?);
            let both = a.under(&b)?.apart(&["more"]);
            let values: serde_json::Value = both.read()?;
            Ok((values.to_string(), both.require("y")?.error("here")))
        });
        let (values, here) = told.unwrap();
        assert_eq!(values, r#"{"x":1,"y":3,"z":4}"#);
        assert_eq!(here.to_string(), "a.toml:2:11: here");
    }

    #[test]
    fn tables_become_objects() {
        let text = "x = { a = { b = [1, { c = 2.5 }] }, d = \"e\" }";
        let read: Result<serde_json::Value, InputError> =
            read("a.toml", text, &[], |root| root.require("x")?.read());
        let expected = serde_json::json!({ "a": { "b": [1, { "c": 2.5 }] }, "d": "e" });
        assert_eq!(read, Ok(expected));
    }
}
