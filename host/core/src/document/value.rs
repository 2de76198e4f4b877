//! A value of a document, with its place.

use std::marker::PhantomData;
use std::rc::Rc;
use std::vec;

use serde::de::value::StrDeserializer;
use serde::de::{DeserializeSeed, Error as _, Expected, MapAccess, SeqAccess, Unexpected, Visitor};
use serde::{Deserialize, Deserializer, forward_to_deserialize_any};
use toml::Spanned;
use toml::de::{DeArray, DeTable, DeValue};

use super::{Fault, Place, Texts, Whole, text};
use crate::{InputError, nearest, shown};

/// A value of a document, with its place. Serde reads it as any type; what types alone do
/// not say is read from the values in it.
#[derive(Debug, Clone)]
pub struct Value<'t> {
    texts: &'t Texts<'t>,
    inner: &'t DeValue<'t>,
    /// A table whose values take the place of those of `inner`.
    over: Option<&'t DeTable<'t>>,
    at: usize,
    /// Its key, which items have of their list.
    key: &'t str,
    /// If it is a table, its name such as `[output.custom]`; empty for the root.
    name: Rc<str>,
    /// Keys that are none of the type's, and read one by one.
    apart: &'t [&'t str],
    /// The only keys.
    part: Option<&'t [&'t str]>,
}

impl<'t> Value<'t> {
    pub(super) fn root(texts: &'t Texts<'t>, inner: &'t DeValue<'t>) -> Self {
        Self {
            texts,
            inner,
            over: None,
            at: 0,
            key: "",
            name: "".into(),
            apart: &[],
            part: None,
        }
    }

    fn child(&self, key: &'t str, value: &'t Spanned<DeValue<'t>>) -> Self {
        let parent = self.name.trim_matches(['[', ']']);
        let dot = if parent.is_empty() { "" } else { "." };
        Self {
            name: format!("[{parent}{dot}{}]", shown(key)).into(),
            key,
            ..self.inside(value)
        }
    }

    fn inside(&self, value: &'t Spanned<DeValue<'t>>) -> Self {
        Self {
            inner: value.get_ref(),
            at: value.span().start,
            over: None,
            apart: &[],
            part: None,
            ..self.clone()
        }
    }

    /// Its key.
    pub fn key(&self) -> &'t str {
        self.key
    }

    /// The same value as a type.
    pub fn read<T: Deserialize<'t>>(&self) -> Result<T, InputError> {
        self.seed(PhantomData).map_err(Fault::error)
    }

    fn seed<S: DeserializeSeed<'t>>(&self, seed: S) -> Result<S::Value, Fault> {
        seed.deserialize(self.clone())
            .map_err(|fault| fault.placed(self))
    }

    /// A text that `read` understands.
    pub fn text<T>(&self, read: impl FnOnce(&str) -> Result<T, Fault>) -> Result<T, InputError> {
        self.told(text(self.clone(), "", read))
    }

    fn told<T>(&self, result: Result<T, Fault>) -> Result<T, InputError> {
        result.map_err(|fault| fault.placed(self).error())
    }

    /// The same table under another name in messages.
    #[must_use]
    pub fn named(self, name: &str) -> Self {
        Self {
            name: name.into(),
            ..self
        }
    }

    /// The same table without keys that are none of the type's, and are read one by one.
    #[must_use]
    pub fn apart(self, keys: &'t [&'t str]) -> Self {
        Self {
            apart: keys,
            ..self
        }
    }

    /// The same table with some of its keys alone.
    #[must_use]
    pub fn part(&self, keys: &'t [&'t str]) -> Self {
        Self {
            part: Some(keys),
            ..self.clone()
        }
    }

    /// The same table with the values of another one in the place of its own.
    pub fn under(&self, over: &Self) -> Result<Self, InputError> {
        let over = Some(self.told(over.table())?);
        Ok(Self {
            over,
            ..self.clone()
        })
    }

    /// The value of a key of a table, if it is there.
    pub fn get(&self, key: &'t str) -> Option<Self> {
        let own = match self.inner {
            DeValue::Table(table) => table.get(key),
            _ => None,
        };
        let value = self.over.and_then(|over| over.get(key)).or(own)?;
        Some(self.child(key, value))
    }

    /// The value of a key that must be there.
    pub fn require(&self, key: &'static str) -> Result<Self, InputError> {
        let missing = || Err(Fault::missing_field(key));
        self.told(
            self.table()
                .and_then(|_| self.get(key).map_or_else(missing, Ok)),
        )
    }

    /// Refuses a table with keys that are none of these.
    pub fn only(&self, known: &'static [&'static str]) -> Result<(), InputError> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Nothing {}
        let Nothing {} = self.clone().apart(known).read()?;
        Ok(())
    }

    /// An integer, both bounds included.
    pub fn whole(&self, low: u64, high: u64) -> Result<u64, InputError> {
        self.told(self.clone().deserialize_i128(Whole { low, high }))
    }

    /// The value of a key as `read` understands it, if it is there.
    pub fn optional<T>(
        &self,
        key: &'t str,
        read: impl FnOnce(&Self) -> Result<T, InputError>,
    ) -> Result<Option<T>, InputError> {
        self.get(key).as_ref().map(read).transpose()
    }

    /// The keys and values of a table, in the order of their places.
    pub fn entries(&self) -> Result<Vec<(Key<'t>, Self)>, InputError> {
        let table = self.told(self.table())?;
        Ok(self.entries_of(table))
    }

    fn entries_of(&self, table: &'t DeTable<'t>) -> Vec<(Key<'t>, Self)> {
        let over = self.over.into_iter().flatten();
        let own = table.iter().filter(|(key, _)| {
            let covers = |over: &DeTable<'_>| over.contains_key(key.get_ref().as_ref());
            !self.over.is_some_and(covers)
        });
        let entries = over.chain(own).map(|(key, value)| {
            let (text, at) = (key.get_ref().as_ref(), key.span().start);
            let table = self.clone();
            let key = Key(Self {
                key: text,
                at,
                ..table
            });
            (key, self.child(text, value))
        });
        let is_shown =
            |key| !self.apart.contains(&key) && self.part.is_none_or(|part| part.contains(&key));
        let entries = entries.filter(|(key, _)| is_shown(key.0.key));
        let mut entries: Vec<_> = entries.collect();
        entries.sort_by_key(|(key, _)| key.0.at);
        entries
    }

    /// The items of a list.
    pub fn list(&self) -> Result<Vec<Self>, InputError> {
        match self.inner {
            DeValue::Array(items) => Ok(self.items_of(items).collect()),
            _ => self.told(Err(self.wrong_type(&"a list"))),
        }
    }

    /// The items of a list, or the value itself where it is none.
    pub fn one_or_more(&self) -> Vec<Self> {
        match self.inner {
            DeValue::Array(items) => self.items_of(items).collect(),
            _ => vec![self.clone()],
        }
    }

    fn items_of(&self, items: &'t DeArray<'t>) -> impl Iterator<Item = Self> {
        let list = Self {
            name: format!("[{}]", self.name).into(),
            ..self.clone()
        };
        items.iter().map(move |item| list.inside(item))
    }

    /// True for a table.
    pub fn is_table(&self) -> bool {
        matches!(self.inner, DeValue::Table(_))
    }

    fn table(&self) -> Result<&'t DeTable<'t>, Fault> {
        match self.inner {
            DeValue::Table(table) => Ok(table),
            _ => Err(self.wrong_type(&"a table").placed(self)),
        }
    }

    /// The place where it begins.
    pub fn place(&self) -> Place {
        self.texts.place(self.at)
    }

    /// An error about the value.
    pub fn error(&self, reason: impl Into<String>) -> InputError {
        self.place().error(reason)
    }

    /// An error about the value of a key, or about the table if it is not there.
    pub fn error_at(&self, key: &'t str, reason: impl Into<String>) -> InputError {
        self.get(key).as_ref().unwrap_or(self).error(reason)
    }

    fn wrong_type(&self, expected: &dyn Expected) -> Fault {
        let found = match self.inner {
            DeValue::String(text) => Unexpected::Str(text),
            DeValue::Integer(_) => Unexpected::Signed(0),
            DeValue::Float(_) => Unexpected::Float(0.0),
            DeValue::Boolean(flag) => Unexpected::Bool(*flag),
            DeValue::Datetime(_) => Unexpected::Other("a date"),
            DeValue::Array(_) => Unexpected::Seq,
            DeValue::Table(_) => Unexpected::Map,
        };
        Fault::invalid_type(found, expected)
    }
}

impl Fault {
    /// The fault with its place, unless it has one already.
    fn placed(mut self, value: &Value<'_>) -> Self {
        if self.place.is_some() {
            return self;
        }
        if let Some(rest) = self.reason.strip_prefix("it ") {
            self.reason = format!("`{}` {rest}", shown(value.key));
        } else if let Some(rest) = self.reason.strip_suffix(" in it") {
            self.reason = match &*value.name {
                "" => rest.to_owned(),
                name => format!("{rest} in {name}"),
            };
        }
        if let Some(known) = self.known {
            let known = [known, value.apart].concat();
            self.hint = Some(match nearest(value.key, &known, 3) {
                Some(near) => format!("did you mean `{near}`?"),
                None => format!("known keys: {}", known.join(", ")),
            });
        }
        self.place = Some(value.place());
        self
    }
}

/// A key of a table, with its place. Serde reads it as any type that texts become.
#[derive(Debug, Clone)]
pub struct Key<'t>(Value<'t>);

impl<'t> Key<'t> {
    /// A text that `read` understands.
    pub fn text<T>(&self, read: impl FnOnce(&str) -> Result<T, Fault>) -> Result<T, InputError> {
        self.0.told(read(self.0.key))
    }

    fn seed<S: DeserializeSeed<'t>>(&self, seed: S) -> Result<S::Value, Fault> {
        let key = StrDeserializer::new(self.0.key);
        seed.deserialize(key)
            .map_err(|fault: Fault| fault.placed(&self.0))
    }
}

struct Entries<'t> {
    rest: vec::IntoIter<(Key<'t>, Value<'t>)>,
    value: Option<Value<'t>>,
}

impl<'t> MapAccess<'t> for Entries<'t> {
    type Error = Fault;

    fn next_key_seed<S: DeserializeSeed<'t>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Fault> {
        let Some((key, value)) = self.rest.next() else {
            return Ok(None);
        };
        self.value = Some(value);
        key.seed(seed).map(Some)
    }

    fn next_value_seed<S: DeserializeSeed<'t>>(&mut self, seed: S) -> Result<S::Value, Fault> {
        match self.value.take() {
            Some(value) => value.seed(seed),
            None => Err(Fault::new("a value is asked for before its key")),
        }
    }
}

struct Items<'t>(vec::IntoIter<Value<'t>>);

impl<'t> SeqAccess<'t> for Items<'t> {
    type Error = Fault;

    fn next_element_seed<S: DeserializeSeed<'t>>(
        &mut self,
        seed: S,
    ) -> Result<Option<S::Value>, Fault> {
        self.0.next().map(|item| item.seed(seed)).transpose()
    }
}

impl<'de> Deserializer<'de> for Value<'de> {
    type Error = Fault;

    fn deserialize_any<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match self.inner {
            DeValue::String(text) => visitor.visit_borrowed_str(text),
            DeValue::Integer(integer) => {
                let (text, radix) = (integer.as_str(), integer.radix());
                if let Ok(number) = i64::from_str_radix(text, radix) {
                    visitor.visit_i64(number)
                } else if let Ok(number) = u64::from_str_radix(text, radix) {
                    visitor.visit_u64(number)
                } else {
                    Err(Fault::new("it is out of range"))
                }
            }
            DeValue::Float(float) => match float.as_str().parse::<f64>() {
                Ok(number) if number.is_finite() => visitor.visit_f64(number),
                _ => Err(Fault::new("it is not a finite number")),
            },
            DeValue::Boolean(flag) => visitor.visit_bool(*flag),
            DeValue::Datetime(_) => Err(self.wrong_type(&visitor)),
            DeValue::Array(items) => {
                let items: Vec<Self> = self.items_of(items).collect();
                visitor.visit_seq(Items(items.into_iter()))
            }
            DeValue::Table(table) => visitor.visit_map(Entries {
                rest: self.entries_of(table).into_iter(),
                value: None,
            }),
        }
    }

    /// The widest integers, so that a reader sees those that are too large for others.
    fn deserialize_i128<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        match self.inner {
            DeValue::Integer(integer) => {
                let number = i128::from_str_radix(integer.as_str(), integer.radix());
                visitor.visit_i128(number.unwrap_or(i128::MAX))
            }
            _ => self.deserialize_any(visitor),
        }
    }

    fn deserialize_option<V: Visitor<'de>>(self, visitor: V) -> Result<V::Value, Fault> {
        visitor.visit_some(self)
    }

    fn deserialize_newtype_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        visitor: V,
    ) -> Result<V::Value, Fault> {
        visitor.visit_newtype_struct(self)
    }

    /// Only from a table: serde would take a list for the fields in order.
    fn deserialize_struct<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        self.table()?;
        self.deserialize_any(visitor)
    }

    fn deserialize_enum<V: Visitor<'de>>(
        self,
        _: &'static str,
        _: &'static [&'static str],
        visitor: V,
    ) -> Result<V::Value, Fault> {
        match self.inner {
            DeValue::String(text) => visitor.visit_enum(StrDeserializer::new(text)),
            _ => Err(self.wrong_type(&"a string")),
        }
    }

    forward_to_deserialize_any! {
        bool i8 i16 i32 i64 u8 u16 u32 u64 u128 f32 f64 char str string bytes byte_buf unit
        unit_struct seq tuple tuple_struct map identifier ignored_any
    }
}
