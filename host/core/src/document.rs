//! TOML with places: tables that are read key by key, and errors that say where.
//!
//! Not a general reader: it exists so that every fault of a manifest or a suite names
//! its line, its column and a way out, and so that no unknown key goes unnoticed.
//!
//! ```
//! use fleetyard_core::document::{Document, Table};
//!
//! let document = Document::new("robots.toml", "speed = 2\ncolor = \"red\"\n");
//! let root = document.parse()?;
//! let fault = Table::new(document, "", 0, root.get_ref(), &["speed", "colour"]).unwrap_err();
//! assert_eq!(fault.to_string(), "robots.toml:2:1: unknown key `color`");
//! assert_eq!(fault.hint.as_deref(), Some("did you mean `colour`?"));
//! # Ok::<(), fleetyard_core::InputError>(())
//! ```

use std::borrow::Cow;

use toml::Spanned;
use toml::de::{DeTable, DeValue};

use crate::{InputError, nearest, shown};

/// The text that is read, for places in it, and what is set over it.
///
/// A byte is counted from the start of the text, on through the settings: each begins
/// one byte after the end of what is before it.
#[derive(Debug, Clone, Copy)]
pub struct Document<'a> {
    source: &'a str,
    text: &'a str,
    settings: &'a [Setting],
}

impl<'a> Document<'a> {
    /// `source` is the text's name in errors.
    pub fn new(source: &'a str, text: &'a str) -> Self {
        Self::with_settings(source, text, &[])
    }

    /// The same with values from elsewhere in place of those of the text.
    pub fn with_settings(source: &'a str, text: &'a str, settings: &'a [Setting]) -> Self {
        Self {
            source,
            text,
            settings,
        }
    }

    /// The place of a byte.
    pub fn place(self, at: usize) -> Place {
        if at > self.text.len() {
            let mut begin = self.text.len() + 1;
            for setting in self.settings {
                begin += setting.text.len() + 1;
                if at < begin {
                    return Place {
                        source: setting.option.clone(),
                        line_column: None,
                    };
                }
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

    /// An error at a byte.
    pub fn error(self, at: usize, reason: impl Into<String>) -> InputError {
        self.place(at).error(reason)
    }

    /// The root table of the text.
    pub fn parse(self) -> Result<Spanned<DeTable<'a>>, InputError> {
        let mut root = self.parse_part(self.text, 0)?;
        let mut begin = self.text.len() + 1;
        for setting in self.settings {
            let set = self.parse_part(&setting.text, begin)?.into_inner();
            merge(root.get_mut(), shifted(set, begin));
            begin += setting.text.len() + 1;
        }
        Ok(root)
    }

    fn parse_part(self, text: &'a str, begin: usize) -> Result<Spanned<DeTable<'a>>, InputError> {
        DeTable::parse(text).map_err(|error| {
            let reason = not_toml(&error);
            match error.span() {
                Some(span) => self.error(begin + span.start, reason),
                None => InputError::new(self.source, reason),
            }
        })
    }
}

fn not_toml(error: &toml::de::Error) -> String {
    let lines: Vec<&str> = error.message().lines().collect();
    format!("this is not TOML: {}", lines.join(", "))
}

/// A table whose places count from `begin`.
fn shifted(table: DeTable<'_>, begin: usize) -> DeTable<'_> {
    fn moved<T>(spanned: Spanned<T>, begin: usize, change: impl FnOnce(T) -> T) -> Spanned<T> {
        let span = spanned.span();
        let span = span.start + begin..span.end + begin;
        Spanned::new(span, change(spanned.into_inner()))
    }
    fn of_value(value: DeValue<'_>, begin: usize) -> DeValue<'_> {
        match value {
            DeValue::Table(table) => DeValue::Table(shifted(table, begin)),
            DeValue::Array(items) => {
                let items = items.into_iter();
                let items = items.map(|item| moved(item, begin, |item| of_value(item, begin)));
                DeValue::Array(items.collect())
            }
            plain => plain,
        }
    }
    let entries = table.into_iter();
    let entries = entries.map(|(key, item)| {
        let key = moved(key, begin, |key| key);
        (key, moved(item, begin, |item| of_value(item, begin)))
    });
    entries.collect()
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
#[derive(Debug, Clone, PartialEq, Eq)]
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

/// A table whose keys are known.
#[derive(Debug)]
pub struct Table<'t, 'a> {
    /// The text that it is from.
    pub document: Document<'a>,
    /// Its name in messages: empty for the root, else as `[program]`.
    name: Cow<'t, str>,
    at: usize,
    entries: &'t DeTable<'a>,
}

impl<'t, 'a> Table<'t, 'a> {
    /// Refuses keys that are not in `known`.
    pub fn new(
        document: Document<'a>,
        name: impl Into<Cow<'t, str>>,
        at: usize,
        entries: &'t DeTable<'a>,
        known: &[&str],
    ) -> Result<Self, InputError> {
        let table = Self::open(document, name, at, entries);
        let unknown = table
            .keys()
            .filter(|(key, _)| !known.contains(key))
            .min_by_key(|(_, at)| *at);
        match unknown {
            None => Ok(table),
            Some((key, at)) => {
                let hint = match nearest(key, known, 3) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("known keys: {}", known.join(", ")),
                };
                let reason = format!("unknown key `{}`{}", shown(key), table.within());
                Err(document.error(at, reason).hint(hint))
            }
        }
    }

    /// A table whose keys are names that the author chose.
    pub fn open(
        document: Document<'a>,
        name: impl Into<Cow<'t, str>>,
        at: usize,
        entries: &'t DeTable<'a>,
    ) -> Self {
        Self {
            document,
            name: name.into(),
            at,
            entries,
        }
    }

    /// The table's name for messages.
    fn within(&self) -> String {
        match self.name.as_ref() {
            "" => String::new(),
            name => format!(" in {name}"),
        }
    }

    /// Its keys and where they stand, in alphabetical order.
    pub fn keys(&self) -> impl Iterator<Item = (&'t str, usize)> {
        let entries = self.entries;
        entries
            .keys()
            .map(|key| (key.get_ref().as_ref(), key.span().start))
    }

    /// Its values with their keys, in alphabetical order.
    pub fn values(&self) -> impl Iterator<Item = (&'t str, Value<'t, 'a>)> {
        let (document, entries) = (self.document, self.entries);
        entries.iter().map(move |(key, value)| {
            let name = key.get_ref().as_ref();
            (name, Value::new(document, name, value))
        })
    }

    /// The value of a key, if it is there.
    pub fn get(&self, key: &'t str) -> Option<Value<'t, 'a>> {
        let value = self.entries.get(key)?;
        Some(Value::new(self.document, key, value))
    }

    /// The value of a key that must be there.
    pub fn require(&self, key: &'t str) -> Result<Value<'t, 'a>, InputError> {
        self.get(key).ok_or_else(|| {
            self.error(format!("the key `{key}` is missing{}", self.within()))
                .hint(format!("add `{key} = …`"))
        })
    }

    /// The place where it begins.
    pub fn place(&self) -> Place {
        self.document.place(self.at)
    }

    /// An error about the table as a whole.
    pub fn error(&self, reason: impl Into<String>) -> InputError {
        self.document.error(self.at, reason)
    }

    /// As a JSON object, with the tables in it; dates, `inf` and `nan` are refused.
    pub fn object(&self) -> Result<serde_json::Map<String, serde_json::Value>, InputError> {
        let values = self.values();
        values
            .map(|(key, value)| Ok((key.to_owned(), value.tree()?)))
            .collect()
    }

    /// The text of a key, if it is there.
    pub fn text(&self, key: &'t str) -> Result<Option<&'t str>, InputError> {
        self.get(key).map(|value| value.text()).transpose()
    }
}

/// A value and its key.
#[derive(Debug, Clone)]
pub struct Value<'t, 'a> {
    document: Document<'a>,
    /// Its name in messages.
    pub key: Cow<'t, str>,
    at: usize,
    inner: &'t DeValue<'a>,
}

impl<'t, 'a> Value<'t, 'a> {
    fn new(
        document: Document<'a>,
        key: impl Into<Cow<'t, str>>,
        value: &'t Spanned<DeValue<'a>>,
    ) -> Self {
        Self {
            document,
            key: key.into(),
            at: value.span().start,
            inner: value.get_ref(),
        }
    }

    /// The place where it begins.
    pub fn place(&self) -> Place {
        self.document.place(self.at)
    }

    /// An error about the value.
    pub fn error(&self, reason: impl Into<String>) -> InputError {
        self.document.error(self.at, reason)
    }

    fn wrong_type(&self, expected: &str) -> InputError {
        let found = match self.inner {
            DeValue::String(_) => "a string",
            DeValue::Integer(_) => "an integer",
            DeValue::Float(_) => "a number",
            DeValue::Boolean(_) => "a boolean",
            DeValue::Datetime(_) => "a date",
            DeValue::Array(_) => "a list",
            DeValue::Table(_) => "a table",
        };
        self.error(format!(
            "`{}` is {found}, expected {expected}",
            shown(&self.key)
        ))
    }

    /// The value as text.
    pub fn text(&self) -> Result<&'t str, InputError> {
        match self.inner {
            DeValue::String(text) => Ok(text),
            _ => Err(self.wrong_type("a string")),
        }
    }

    /// Text that says something.
    pub fn nonempty(&self) -> Result<&'t str, InputError> {
        match self.text()? {
            text if text.trim().is_empty() => {
                Err(self.error(format!("`{}` is empty", shown(&self.key))))
            }
            text => Ok(text),
        }
    }

    /// The value as yes or no.
    pub fn flag(&self) -> Result<bool, InputError> {
        match self.inner {
            DeValue::Boolean(flag) => Ok(*flag),
            _ => Err(self.wrong_type("true or false")),
        }
    }

    /// The value as an integer, both bounds included.
    pub fn integer(&self, low: i64, high: i64) -> Result<i64, InputError> {
        let DeValue::Integer(integer) = self.inner else {
            return Err(self.wrong_type("an integer"));
        };
        i64::from_str_radix(integer.as_str(), integer.radix())
            .ok()
            .filter(|value| (low..=high).contains(value))
            .ok_or_else(|| {
                let reason = format!("`{}` is not between {low} and {high}", shown(&self.key));
                self.error(reason)
            })
    }

    /// The value as an integer that may be larger than most of TOML's, both bounds
    /// included.
    pub fn whole(&self, low: u64, high: u64) -> Result<u64, InputError> {
        let DeValue::Integer(integer) = self.inner else {
            return Err(self.wrong_type("an integer"));
        };
        u64::from_str_radix(integer.as_str(), integer.radix())
            .ok()
            .filter(|value| (low..=high).contains(value))
            .ok_or_else(|| {
                let reason = format!("`{}` is not between {low} and {high}", shown(&self.key));
                self.error(reason)
            })
    }

    /// The value as a finite number.
    pub fn number(&self) -> Result<f64, InputError> {
        let text = match self.inner {
            DeValue::Integer(integer) if integer.radix() == 10 => integer.as_str(),
            DeValue::Float(float) => float.as_str(),
            _ => return Err(self.wrong_type("a number")),
        };
        let value: Option<f64> = text.parse().ok().filter(|value: &f64| value.is_finite());
        value.ok_or_else(|| self.error(format!("`{}` is not a finite number", shown(&self.key))))
    }

    /// Its items, or the value itself where it is no list.
    pub fn one_or_more(&self) -> Result<Vec<Self>, InputError> {
        match self.inner {
            DeValue::Array(_) => self.list(),
            _ => Ok(vec![self.clone()]),
        }
    }

    /// Its items; errors name each as the list itself.
    pub fn list(&self) -> Result<Vec<Self>, InputError> {
        let DeValue::Array(items) = self.inner else {
            return Err(self.wrong_type("a list"));
        };
        let items = items.iter();
        Ok(items
            .map(|item| Self::new(self.document, self.key.clone(), item))
            .collect())
    }

    /// One of some words, and what it stands for.
    pub fn choice<T: Copy>(&self, choices: &[(&str, T)]) -> Result<T, InputError> {
        let text = self.text()?;
        let found = choices.iter().find(|(word, _)| *word == text);
        found.map(|(_, meaning)| *meaning).ok_or_else(|| {
            let known: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
            let hint = match nearest(text, &known, 3) {
                Some(near) => format!("did you mean \"{near}\"?"),
                None => format!("it is one of {}", known.join(", ")),
            };
            let reason = format!("`{}` cannot be \"{}\"", shown(&self.key), shown(text));
            self.error(reason).hint(hint)
        })
    }

    /// A table with known keys.
    pub fn table(
        &self,
        name: impl Into<Cow<'t, str>>,
        known: &[&str],
    ) -> Result<Table<'t, 'a>, InputError> {
        match self.inner {
            DeValue::Table(entries) => Table::new(self.document, name, self.at, entries, known),
            _ => Err(self.wrong_type("a table")),
        }
    }

    /// A table with names that the author chose.
    pub fn names(&self, name: impl Into<Cow<'t, str>>) -> Result<Table<'t, 'a>, InputError> {
        match self.inner {
            DeValue::Table(entries) => Ok(Table::open(self.document, name, self.at, entries)),
            _ => Err(self.wrong_type("a table")),
        }
    }

    /// True if it is a table.
    pub fn is_table(&self) -> bool {
        matches!(self.inner, DeValue::Table(_))
    }

    /// The value as JSON; tables, dates, `inf` and `nan` are refused.
    pub fn json(&self) -> Result<serde_json::Value, InputError> {
        let number = |found: Option<serde_json::Number>| {
            found
                .map(serde_json::Value::Number)
                .ok_or_else(|| self.error(format!("`{}` is out of range", shown(&self.key))))
        };
        match self.inner {
            DeValue::String(text) => Ok(text.as_ref().into()),
            DeValue::Boolean(flag) => Ok((*flag).into()),
            DeValue::Integer(integer) => {
                let (text, radix) = (integer.as_str(), integer.radix());
                let value = i64::from_str_radix(text, radix).map(Into::into);
                let value = value.or_else(|_| u64::from_str_radix(text, radix).map(Into::into));
                number(value.ok())
            }
            DeValue::Float(float) => {
                let value = float.as_str().parse().ok();
                number(value.and_then(serde_json::Number::from_f64))
            }
            DeValue::Array(_) => {
                let items = self.list()?;
                items.iter().map(Value::json).collect()
            }
            DeValue::Datetime(_) | DeValue::Table(_) => {
                Err(self.wrong_type("a string, a number or a boolean"))
            }
        }
    }
    /// A table as a JSON object, with the tables in it; dates, `inf` and `nan` are
    /// refused.
    pub fn object(&self) -> Result<serde_json::Map<String, serde_json::Value>, InputError> {
        self.names("")?.object()
    }

    fn tree(&self) -> Result<serde_json::Value, InputError> {
        match self.inner {
            DeValue::Table(_) => Ok(self.object()?.into()),
            DeValue::Array(_) => self.list()?.iter().map(Self::tree).collect(),
            _ => self.json(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "[protocol]\nrepeats = 1\nseeds = [1]\n";

    fn set(settings: &[&str]) -> Result<Vec<String>, InputError> {
        let settings: Result<Vec<Setting>, InputError> = settings
            .iter()
            .map(|given| Setting::new("--set", given))
            .collect();
        let settings = settings?;
        let document = Document::with_settings("a.toml", TEXT, &settings);
        let root = document.parse()?;
        let root = Table::new(document, "", 0, root.get_ref(), &["name", "protocol"])?;
        let protocol = root.require("protocol")?;
        let protocol = protocol.table("[protocol]", &["repeats", "seeds", "clock"])?;
        let repeats = protocol.require("repeats")?.integer(1, 9)?;
        let seeds = protocol.require("seeds")?.list()?;
        let seeds: Result<Vec<u64>, _> = seeds.iter().map(|seed| seed.whole(0, 99)).collect();
        let clock = match protocol.get("clock") {
            Some(clock) => clock.choice(&[("host", "h"), ("call", "c")])?,
            None => "",
        };
        let name = root.text("name")?.unwrap_or_default();
        Ok(vec![
            repeats.to_string(),
            format!("{:?}", seeds?),
            clock.into(),
            name.into(),
        ])
    }

    #[test]
    fn settings_take_the_place_of_values() {
        let told = |settings: &[&str]| set(settings).map(|told| told.join(" "));
        assert_eq!(told(&[]).as_deref(), Ok("1 [1]  "));
        assert_eq!(
            told(&["protocol.repeats=3", "protocol.seeds=[4, 5]"]).as_deref(),
            Ok("3 [4, 5]  ")
        );
        // The last one counts, and a word needs no quotes.
        let both = ["protocol.clock=host", "protocol.clock = call", "name=x y"];
        assert_eq!(told(&both).as_deref(), Ok("1 [1] c x y"));
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
        let document = Document::with_settings("a.toml", "b = ", &settings);
        let fault = document.parse().unwrap_err().to_string();
        assert!(fault.starts_with("a.toml:1:5: this is not TOML"), "{fault}");
    }

    #[test]
    fn tables_become_objects() {
        let text = "x = { a = { b = [1, { c = 2.5 }] }, d = \"e\" }";
        let document = Document::new("a.toml", text);
        let root = document.parse().unwrap();
        let root = Table::open(document, "", 0, root.get_ref());
        let object = root.require("x").unwrap().object().unwrap();
        let expected = serde_json::json!({ "a": { "b": [1, { "c": 2.5 }] }, "d": "e" });
        assert_eq!(serde_json::Value::Object(object), expected);
    }
}
