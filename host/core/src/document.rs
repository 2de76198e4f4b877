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

/// The text that is read, for places in it.
#[derive(Debug, Clone, Copy)]
pub struct Document<'a> {
    source: &'a str,
    text: &'a str,
}

impl<'a> Document<'a> {
    /// `source` is the text's name in errors.
    pub fn new(source: &'a str, text: &'a str) -> Self {
        Self { source, text }
    }

    /// An error at a byte of the text.
    pub fn error(self, at: usize, reason: impl Into<String>) -> InputError {
        let before = &self.text[..self.text.floor_char_boundary(at)];
        let line_start = before.rfind('\n').map_or(0, |newline| newline + 1);
        let line = before.matches('\n').count() + 1;
        let column = before[line_start..].chars().count() + 1;
        InputError::new(self.source, reason).at(line as u64, column as u64)
    }

    /// The root table of the text.
    pub fn parse(self) -> Result<Spanned<DeTable<'a>>, InputError> {
        DeTable::parse(self.text).map_err(|error| {
            let reason = format!("this is not TOML: {}", first_line(error.message()));
            match error.span() {
                Some(span) => self.error(span.start, reason),
                None => InputError::new(self.source, reason),
            }
        })
    }
}

fn first_line(text: &str) -> String {
    text.lines().collect::<Vec<_>>().join(", ")
}

/// A table whose keys are known.
#[derive(Debug)]
pub struct Table<'t, 'a> {
    /// The text that it is from.
    pub document: Document<'a>,
    /// What it is called in messages: empty for the root, else as `[program]`.
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
                let reason = format!("unknown key `{}`{}", shown(key), table.place());
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

    /// In which table, for messages.
    fn place(&self) -> String {
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
            self.error(format!("the key `{key}` is missing{}", self.place()))
                .hint(format!("add `{key} = …`"))
        })
    }

    /// An error about the table as a whole.
    pub fn error(&self, reason: impl Into<String>) -> InputError {
        self.document.error(self.at, reason)
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

    /// Whether it is a table.
    pub fn is_table(&self) -> bool {
        matches!(self.inner, DeValue::Table(_))
    }

    /// The value as JSON; dates, `inf` and `nan` are refused.
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
                let value = i64::from_str_radix(integer.as_str(), integer.radix());
                number(value.ok().map(Into::into))
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
}
