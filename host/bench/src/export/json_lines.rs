//! JSON Lines: an object per trial, with every column in order; `null` where it is
//! absent, and where a number is not finite, for which JSON has no word.

use serde::ser::{Serialize, SerializeMap, Serializer};

use super::ExportError;
use super::columns::{INCUMBENTS, Plan};
use crate::{COLUMNS, Row, Value};

struct Line<'a>(&'a Row);

impl Serialize for Line<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(COLUMNS.len() + 1))?;
        for (column, value) in COLUMNS.iter().zip(self.0.values()) {
            match value {
                Value::Null => map.serialize_entry(column.name, &())?,
                Value::Text(text) => map.serialize_entry(column.name, &text)?,
                Value::Integer(number) => {
                    map.serialize_entry(column.name, &number.cast_unsigned())?;
                }
                Value::Real(number) => map.serialize_entry(column.name, &number)?,
                Value::Boolean(yes) => map.serialize_entry(column.name, &yes)?,
            }
        }
        let plans: Vec<Plan> = self.0.incumbents.iter().map(Plan::from).collect();
        map.serialize_entry(INCUMBENTS, &plans)?;
        map.end()
    }
}

pub(super) fn json_lines(rows: &[&Row]) -> Result<Vec<u8>, ExportError> {
    let mut bytes = Vec::new();
    for row in rows {
        serde_json::to_writer(&mut bytes, &Line(row))?;
        bytes.push(b'\n');
    }
    Ok(bytes)
}
