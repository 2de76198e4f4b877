//! Apache Parquet: a file with a column per column, nullable where it is optional, and the
//! plans on the way as a list of structures.

use std::fmt::Write as _;
use std::sync::Arc;

use parquet::basic::{Compression, ZstdLevel};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::{BoolType, ByteArray, ByteArrayType, DoubleType, Int64Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedFileWriter, SerializedRowGroupWriter};
use parquet::schema::parser::parse_message_type;

use super::ExportError;
use super::columns::INCUMBENTS;
use crate::{COLUMNS, ColumnType, Incumbent, Row, Value};

/// Rows of a group, which is what is in memory at a time.
const GROUP: usize = 1 << 16;

pub(super) fn parquet(rows: &[&Row]) -> Result<Vec<u8>, ExportError> {
    let properties = WriterProperties::builder()
        .set_compression(Compression::ZSTD(ZstdLevel::default()))
        .set_created_by(concat!("fleetyard ", env!("CARGO_PKG_VERSION")).to_owned())
        .build();
    let schema = Arc::new(parse_message_type(&schema())?);
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, schema, Arc::new(properties))?;
    for rows in rows.chunks(GROUP) {
        let mut group = file.next_row_group()?;
        let mut columns: Vec<Vec<Value>> = vec![Vec::with_capacity(rows.len()); COLUMNS.len()];
        for row in rows {
            for (column, value) in columns.iter_mut().zip(row.values()) {
                column.push(value);
            }
        }
        for (column, values) in COLUMNS.iter().zip(columns) {
            let levels: Vec<i16> = values
                .iter()
                .map(|value| i16::from(*value != Value::Null))
                .collect();
            let levels = Levels {
                definition: column.optional.then_some(levels),
                repetition: None,
            };
            write(&mut group, values, &levels)?;
        }
        write_plans(&mut group, rows)?;
        group.close()?;
    }
    file.close()?;
    Ok(bytes)
}

fn schema() -> String {
    let mut text = "message trials {\n".to_owned();
    for column in COLUMNS {
        let (physical, logical) = match column.kind {
            ColumnType::Text => ("BYTE_ARRAY", " (STRING)"),
            ColumnType::Integer => ("INT64", " (INTEGER(64,false))"),
            ColumnType::Real => ("DOUBLE", ""),
            ColumnType::Boolean => ("BOOLEAN", ""),
        };
        let presence = if column.optional {
            "OPTIONAL"
        } else {
            "REQUIRED"
        };
        let _ = writeln!(text, "{presence} {physical} {}{logical};", column.name);
    }
    let _ = writeln!(
        text,
        "REQUIRED GROUP {INCUMBENTS} (LIST) {{
            REPEATED GROUP list {{
                REQUIRED GROUP element {{
                    REQUIRED DOUBLE time_ms;
                    OPTIONAL INT64 soc_steps (INTEGER(64,false));
                    OPTIONAL BOOLEAN valid;
                }}
            }}
        }}\n}}"
    );
    text
}

/// Definition and repetition levels of a column: Melnik and others, "Dremel: interactive analysis
/// of web-scale datasets", Proceedings of the VLDB Endowment 3 (2010).
struct Levels {
    /// Absent where nothing can be absent.
    definition: Option<Vec<i16>>,
    /// Absent where nothing is repeated.
    repetition: Option<Vec<i16>>,
}

/// Writes the next column of the group. Absent values are in the levels alone.
fn write<W: std::io::Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    values: Vec<Value>,
    levels: &Levels,
) -> Result<(), ExportError> {
    let missing = || ParquetError::General("the schema has fewer columns than the rows".into());
    let mut column = group.next_column()?.ok_or_else(missing)?;
    let (definition, repetition) = (levels.definition.as_deref(), levels.repetition.as_deref());
    let values = values.into_iter();
    match column.untyped() {
        ColumnWriter::ByteArrayColumnWriter(_) => {
            let texts: Vec<ByteArray> = values
                .filter_map(|value| match value {
                    Value::Text(text) => Some(ByteArray::from(text.into_bytes())),
                    _ => None,
                })
                .collect();
            column
                .typed::<ByteArrayType>()
                .write_batch(&texts, definition, repetition)?;
        }
        ColumnWriter::Int64ColumnWriter(_) => {
            let numbers: Vec<i64> = values
                .filter_map(|value| match value {
                    Value::Integer(number) => Some(number),
                    _ => None,
                })
                .collect();
            column
                .typed::<Int64Type>()
                .write_batch(&numbers, definition, repetition)?;
        }
        ColumnWriter::DoubleColumnWriter(_) => {
            let numbers: Vec<f64> = values
                .filter_map(|value| match value {
                    Value::Real(number) => Some(number),
                    _ => None,
                })
                .collect();
            column
                .typed::<DoubleType>()
                .write_batch(&numbers, definition, repetition)?;
        }
        ColumnWriter::BoolColumnWriter(_) => {
            let answers: Vec<bool> = values
                .filter_map(|value| match value {
                    Value::Boolean(yes) => Some(yes),
                    _ => None,
                })
                .collect();
            column
                .typed::<BoolType>()
                .write_batch(&answers, definition, repetition)?;
        }
        _ => return Err(ParquetError::General("a column of no type that rows have".into()).into()),
    }
    column.close()?;
    Ok(())
}

/// The three columns of the list. A level of 0 says that a trial has no plans, 1 that a plan
/// is there, 2 that its optional value is there too.
fn write_plans<W: std::io::Write + Send>(
    group: &mut SerializedRowGroupWriter<'_, W>,
    rows: &[&Row],
) -> Result<(), ExportError> {
    type Of = fn(&Incumbent) -> Value;
    let columns: [(bool, Of); 3] = [
        (false, |plan| Value::Real(plan.time_ms)),
        (true, |plan| {
            let soc = plan.soc_steps.map(u64::cast_signed);
            soc.map_or(Value::Null, Value::Integer)
        }),
        (true, |plan| plan.valid.map_or(Value::Null, Value::Boolean)),
    ];
    for (optional, of) in columns {
        let (mut values, mut definition, mut repetition) = (Vec::new(), Vec::new(), Vec::new());
        for row in rows {
            if row.incumbents.is_empty() {
                definition.push(0);
                repetition.push(0);
            }
            for (at, plan) in row.incumbents.iter().enumerate() {
                let value = of(plan);
                definition.push(1 + i16::from(optional && value != Value::Null));
                repetition.push(i16::from(at > 0));
                values.push(value);
            }
        }
        let levels = Levels {
            definition: Some(definition),
            repetition: Some(repetition),
        };
        write(group, values, &levels)?;
    }
    Ok(())
}
