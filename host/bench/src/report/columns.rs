//! Rows as columns, packed for the page.
//!
//! A column that has one value is that value; words are numbered; digests are bytes;
//! numbers are whole numbers over a power of ten where that gives back every bit of
//! them, and doubles where it does not. Bytes are little-endian, in base64.

use std::collections::HashMap;

use fleetyard_view::base64;
use serde::Serialize;

use crate::{COLUMNS, Column, Row, Value};

/// The largest whole number up to which a double has all.
const WHOLE: u64 = 1 << 53;

/// Decimals that are tried: times in milliseconds are whole nanoseconds.
const DECIMALS: [u32; 5] = [0, 1, 3, 6, 9];

#[derive(Debug, Serialize)]
pub(super) struct Packed {
    name: &'static str,
    doc: &'static str,
    #[serde(flatten)]
    form: Form,
}

#[derive(Debug, PartialEq, Serialize)]
#[serde(tag = "form", rename_all = "snake_case")]
enum Form {
    /// All rows have this value.
    Same { value: serde_json::Value },
    /// An index into `words` per row, of `width` bytes.
    Words {
        words: Vec<serde_json::Value>,
        width: usize,
        bytes: String,
    },
    /// `width` bytes per row, which are lower-case hexadecimal digits.
    Hex { width: usize, bytes: String },
    /// `(first + n) / 10^decimals` per row; n, of `width` bytes, is all ones where
    /// there is no value.
    Decimal {
        first: f64,
        decimals: u32,
        width: usize,
        bytes: String,
    },
    /// A double per row, which is no number where there is no value.
    Double { bytes: String },
}

/// A column in the making.
enum Values {
    Words(Words),
    Numbers(Vec<Option<f64>>),
}

#[derive(Default)]
struct Words {
    number: HashMap<Option<String>, u32>,
    order: Vec<Option<String>>,
    codes: Vec<u32>,
}

impl Words {
    fn push(&mut self, word: Option<String>) {
        let code = *self.number.entry(word).or_insert_with_key(|word| {
            self.order.push(word.clone());
            self.order.len() as u32 - 1
        });
        self.codes.push(code);
    }
}

/// Every column of rows.
pub(super) fn pack(rows: &[&Row]) -> Vec<Packed> {
    let mut columns: Vec<Option<Values>> = COLUMNS.iter().map(|_| None).collect();
    for row in rows {
        for (column, value) in columns.iter_mut().zip(row.values()) {
            push(column, value, rows.len());
        }
    }
    let packed = COLUMNS.iter().zip(columns);
    packed
        .map(|(Column { name, doc, .. }, values)| Packed {
            name,
            doc: doc.trim(),
            form: form(values),
        })
        .collect()
}

/// Words that are no column of rows.
pub(super) fn pack_words(name: &'static str, values: impl Iterator<Item = String>) -> Packed {
    let mut words = Words::default();
    for value in values {
        words.push(Some(value));
    }
    let form = if words.codes.is_empty() {
        form(None)
    } else {
        words_form(words)
    };
    Packed {
        name,
        doc: "",
        form,
    }
}

/// Numbers that are no column of rows.
pub(super) fn pack_numbers(name: &'static str, numbers: &[Option<f64>]) -> Packed {
    Packed {
        name,
        doc: "",
        form: numbers_form(numbers),
    }
}

/// Absent values are kept with whatever comes first; a column of nothing else is
/// one of words.
fn push(column: &mut Option<Values>, value: Value, rows: usize) {
    let number = match value {
        Value::Null => None,
        Value::Real(value) => Some(value).filter(|value| value.is_finite()),
        Value::Integer(value) if value.cast_unsigned() <= WHOLE => Some(value as f64),
        Value::Integer(value) => {
            return words(column).push(Some(value.cast_unsigned().to_string()));
        }
        Value::Text(word) => return words(column).push(Some(word)),
        Value::Boolean(value) => Some(f64::from(u8::from(value))),
    };
    match column {
        Some(Values::Words(words)) => words.push(number.map(|number| number.to_string())),
        Some(Values::Numbers(numbers)) => numbers.push(number),
        None => {
            let mut numbers = Vec::with_capacity(rows);
            numbers.push(number);
            *column = Some(Values::Numbers(numbers));
        }
    }
}

/// The column as one of words. What it had so far, absent values or numbers that
/// turned out to have larger ones among them, become words.
fn words(column: &mut Option<Values>) -> &mut Words {
    if !matches!(column, Some(Values::Words(_))) {
        let mut words = Words::default();
        if let Some(Values::Numbers(numbers)) = column {
            for number in numbers {
                words.push(number.map(|number| number.to_string()));
            }
        }
        *column = Some(Values::Words(words));
    }
    match column {
        Some(Values::Words(words)) => words,
        _ => unreachable!("it was made one of words"),
    }
}

fn form(values: Option<Values>) -> Form {
    match values {
        None => Form::Same {
            value: serde_json::Value::Null,
        },
        Some(Values::Words(words)) => words_form(words),
        Some(Values::Numbers(numbers)) => numbers_form(&numbers),
    }
}

fn words_form(words: Words) -> Form {
    if let [word] = &words.order[..] {
        return Form::Same {
            value: word.clone().into(),
        };
    }
    let rows = words.codes.len();
    if words.order.len() * 4 > rows
        && let Some(form) = hex_form(&words)
    {
        return form;
    }
    let width = width(words.order.len() as u64);
    Form::Words {
        words: words.order.into_iter().map(Into::into).collect(),
        width,
        bytes: pack_whole(words.codes.iter().map(|code| u64::from(*code)), width),
    }
}

fn hex_form(words: &Words) -> Option<Form> {
    let digits = words.order.first()?.as_ref()?.len();
    let mut decoded = Vec::with_capacity(words.order.len() * digits / 2);
    for word in &words.order {
        let word = word.as_ref().filter(|word| word.len() == digits)?;
        for pair in word.as_bytes().chunks(2) {
            let &[high, low] = pair else { return None };
            decoded.push(nibble(high)? << 4 | nibble(low)?);
        }
    }
    let width = digits / 2;
    let mut bytes = Vec::with_capacity(words.codes.len() * width);
    for code in &words.codes {
        let at = *code as usize * width;
        bytes.extend_from_slice(&decoded[at..at + width]);
    }
    (width > 0).then(|| Form::Hex {
        width,
        bytes: base64(&bytes),
    })
}

fn nibble(digit: u8) -> Option<u8> {
    match digit {
        b'0'..=b'9' => Some(digit - b'0'),
        b'a'..=b'f' => Some(digit - b'a' + 10),
        _ => None,
    }
}

fn numbers_form(numbers: &[Option<f64>]) -> Form {
    if numbers.windows(2).all(|pair| pair[0] == pair[1]) {
        let value = numbers.first().copied().flatten().map(json_number);
        return Form::Same {
            value: value.unwrap_or_default(),
        };
    }
    let decimal = DECIMALS.iter().find_map(|d| decimal_form(numbers, *d));
    decimal.unwrap_or_else(|| {
        let doubles = numbers.iter().map(|number| number.unwrap_or(f64::NAN));
        let bytes: Vec<u8> = doubles.flat_map(f64::to_le_bytes).collect();
        Form::Double {
            bytes: base64(&bytes),
        }
    })
}

fn json_number(number: f64) -> serde_json::Value {
    if number.fract() == 0.0 && number.abs() <= WHOLE as f64 {
        (number as i64).into()
    } else {
        number.into()
    }
}

/// The numbers as whole ones over a power of ten, if that is exact and shorter than
/// doubles.
fn decimal_form(numbers: &[Option<f64>], decimals: u32) -> Option<Form> {
    let scale = 10f64.powi(decimals as i32);
    let whole = |number: f64| {
        let whole = (number * scale).round();
        let exact =
            whole.abs() <= WHOLE as f64 && (whole / scale).to_bits() == (number + 0.0).to_bits();
        exact.then_some(whole as i64)
    };
    let (mut least, mut most) = (i64::MAX, i64::MIN);
    for number in numbers.iter().flatten() {
        let whole = whole(*number)?;
        least = least.min(whole);
        most = most.max(whole);
    }
    // One more for what is absent.
    let width = width((most - least) as u64 + 2);
    if width > 4 {
        return None;
    }
    let absent = u64::MAX;
    let codes = numbers.iter().map(|number| {
        let whole = number.and_then(whole);
        whole.map_or(absent, |whole| (whole - least) as u64)
    });
    Some(Form::Decimal {
        first: least as f64,
        decimals,
        width,
        bytes: pack_whole(codes, width),
    })
}

/// Bytes that hold that many different numbers.
fn width(count: u64) -> usize {
    match count {
        0..=0x100 => 1,
        0x101..=0x1_0000 => 2,
        0x1_0001..=0x1_0000_0000 => 4,
        _ => 8,
    }
}

fn pack_whole(codes: impl Iterator<Item = u64>, width: usize) -> String {
    let mut bytes = Vec::new();
    for code in codes {
        bytes.extend_from_slice(&code.to_le_bytes()[..width]);
    }
    base64(&bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn packed<const N: usize>(values: [Value; N]) -> Form {
        let mut column = None;
        for value in values {
            push(&mut column, value, N);
        }
        form(column)
    }

    #[test]
    fn a_column_takes_the_shortest_form_that_keeps_its_values() {
        let text = |text: &str| Value::Text(text.into());
        let same = |value: serde_json::Value| Form::Same { value };
        assert_eq!(packed([]), same(serde_json::Value::Null));
        assert_eq!(
            packed([Value::Null, Value::Null]),
            same(serde_json::Value::Null)
        );
        assert_eq!(packed([text("a"), text("a")]), same("a".into()));
        assert_eq!(packed([Value::Real(2.0), Value::Real(2.0)]), same(2.into()));
        let words = packed([Value::Null, text("a"), text("b"), text("a"), text("a")]);
        assert_eq!(
            words,
            Form::Words {
                words: vec![().into(), "a".into(), "b".into()],
                width: 1,
                bytes: base64(&[0, 1, 2, 1, 1]),
            }
        );
        let hex = packed([text("00ff"), text("a1b2"), text("00ff")]);
        assert_eq!(
            hex,
            Form::Hex {
                width: 2,
                bytes: base64(&[0x00, 0xff, 0xa1, 0xb2, 0x00, 0xff]),
            }
        );
        // A millisecond has a million nanoseconds.
        let times = packed([Value::Real(1.000_001), Value::Null, Value::Real(1.000_003)]);
        assert_eq!(
            times,
            Form::Decimal {
                first: 1_000_001.0,
                decimals: 6,
                width: 1,
                bytes: base64(&[0, 255, 2]),
            }
        );
        let third = packed([Value::Real(1.0 / 3.0), Value::Null]);
        assert!(matches!(third, Form::Double { .. }), "{third:?}");
        // Seeds are larger than what doubles hold.
        let seeds = packed([Value::Integer(7), Value::Integer(-1)]);
        assert_eq!(
            seeds,
            Form::Words {
                words: vec!["7".into(), u64::MAX.to_string().into()],
                width: 1,
                bytes: base64(&[0, 1]),
            }
        );
    }
}
