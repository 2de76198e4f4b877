//! Comma-separated values as RFC 4180 has them: lines end with CR LF, quotes where
//! they are needed, a header.

use fleetyard_core::{InputError, unmarked};

use super::ExportError;
use super::columns::{INCUMBENTS, Plan, field, plans};
use crate::failure::is_invalid;
use crate::{COLUMNS, Column, ColumnType, Row, Value};

/// The columns of the maze paper's file, in its order, with ours that they are; the
/// last has none.
const OF_THE_PAPER: [(&str, Option<&str>); 11] = [
    ("planner", Some("planner")),
    ("maze_index", Some("maze_index")),
    ("maze_seed", Some("maze_seed")),
    ("width", Some("maze_width")),
    ("height", Some("maze_height")),
    ("algorithm", Some("maze_algorithm")),
    ("success", Some("success")),
    ("solve_time_ms", Some("solve_time_ms")),
    ("path_length", Some("path_length_cells")),
    ("expansions", Some("expansions")),
    ("error", None),
];

fn writer() -> csv::Writer<Vec<u8>> {
    let mut builder = csv::WriterBuilder::new();
    builder.terminator(csv::Terminator::CRLF);
    builder.from_writer(Vec::new())
}

fn finish(writer: csv::Writer<Vec<u8>>) -> Result<Vec<u8>, ExportError> {
    writer
        .into_inner()
        .map_err(|error| ExportError::Io(error.into_error()))
}

/// Every column by its name, and the plans on the way as JSON in the last.
pub(super) fn csv(rows: &[&Row]) -> Result<Vec<u8>, ExportError> {
    let mut writer = writer();
    writer.write_record(COLUMNS.iter().map(|column| column.name).chain([INCUMBENTS]))?;
    for row in rows {
        let mut record: Vec<String> = row.values().iter().map(field).collect();
        record.push(plans(&row.incumbents)?);
        writer.write_record(&record)?;
    }
    finish(writer)
}

/// The columns of the paper first, then those of ours that are not among them.
pub(super) fn maze_csv(rows: &[&Row]) -> Result<Vec<u8>, ExportError> {
    let place = |name: &str| COLUMNS.iter().position(|column| column.name == name);
    let of_the_paper = OF_THE_PAPER.map(|(_, ours)| ours.and_then(place));
    let others: Vec<usize> = (0..COLUMNS.len())
        .filter(|at| !of_the_paper.contains(&Some(*at)))
        .collect();
    let mut writer = writer();
    let names = OF_THE_PAPER.iter().map(|(name, _)| *name);
    writer.write_record(names.chain(others.iter().map(|at| COLUMNS[*at].name)))?;
    for row in rows {
        let values = row.values();
        let record = of_the_paper.iter().map(|at| match at {
            Some(at) => field(&values[*at]),
            None => why(row),
        });
        writer.write_record(record.chain(others.iter().map(|at| field(&values[*at]))))?;
    }
    finish(writer)
}

/// The text that the paper calls the error: nothing if the trial succeeded.
fn why(row: &Row) -> String {
    let Some(reason) = row.failure() else {
        return String::new();
    };
    // What is wrong with a plan is no detail of another reason.
    let violation = row.first_violation.as_ref();
    let violation = violation.filter(|_| is_invalid(&reason));
    let details = [violation, row.message.as_ref(), row.fault.as_ref()];
    let detail = details.into_iter().flatten().find(|text| !text.is_empty());
    detail.map_or_else(|| reason.clone(), |detail| format!("{reason}: {detail}"))
}

/// The same values with a `'` before each that a spreadsheet would take for a formula: names and texts of a
/// planner begin as they like.
pub fn without_formulas(csv: &[u8]) -> Result<Vec<u8>, ExportError> {
    let mut reader = csv::ReaderBuilder::new()
        .has_headers(false)
        .from_reader(csv);
    let mut writer = writer();
    for record in reader.records() {
        let record = record?;
        writer.write_record(record.iter().map(|field| {
            let is_formula = field.starts_with(['=', '+', '-', '@', '\t', '\r', '\n']);
            if is_formula && field.parse::<f64>().is_err() {
                format!("'{field}")
            } else {
                field.to_owned()
            }
        }))?;
    }
    finish(writer)
}

/// Reads what [`Format::Csv`](super::Format::Csv) writes; `source` names it in errors.
///
/// Columns may be in any order, and optional ones may be missing. Empty fields of optional
/// columns are absent.
pub fn read_csv(source: &str, bytes: &[u8]) -> Result<Vec<Row>, InputError> {
    let bytes = unmarked(source, bytes)?;
    let malformed = |error: &csv::Error| {
        let line = error.position().map(|at| line_at(bytes, at));
        let reason = match error.kind() {
            csv::ErrorKind::UnequalLengths {
                expected_len, len, ..
            } => {
                format!("the line has {len} fields, the header {expected_len}")
            }
            csv::ErrorKind::Utf8 { .. } => "the line is not UTF-8".to_owned(),
            _ => format!("this is no CSV: {error}"),
        };
        let base = InputError::new(source, reason);
        match line {
            Some(line) => base.at_line(line),
            None => base,
        }
    };
    let mut reader = csv::Reader::from_reader(bytes);
    let header = reader.headers().map_err(|error| malformed(&error))?.clone();
    // Blank lines may come first.
    let first = header.position().map_or(1, |at| line_at(bytes, at));
    for (at, name) in header.iter().enumerate() {
        let known = || COLUMNS.iter().map(|column| column.name).chain([INCUMBENTS]);
        let before = header.iter().take(at);
        let column = 1 + before
            .map(|name| name.chars().count() as u64 + 1)
            .sum::<u64>();
        // Columns of the file's line, unless a name goes over several.
        let blame = |reason: String| {
            let error = InputError::new(source, reason);
            if header.iter().take(at + 1).any(|name| name.contains('\n')) {
                error.at_line(first)
            } else {
                error.at(first, column)
            }
        };
        if !known().any(|known| known == name) {
            let nearest = known().min_by_key(|known| strsim::damerau_levenshtein(name, known));
            let reason = format!("there is no column `{}`", fleetyard_core::shown(name));
            let error = blame(reason);
            return Err(match nearest {
                Some(nearest) => error.hint(format!("did you mean `{nearest}`?")),
                None => error,
            });
        }
        if header.iter().take(at).any(|other| other == name) {
            return Err(blame(format!("there are two columns `{name}`")));
        }
    }
    let place = |name: &str| header.iter().position(|column| column == name);
    let places: Vec<Option<usize>> = COLUMNS.iter().map(|column| place(column.name)).collect();
    for (column, place) in COLUMNS.iter().zip(&places) {
        if place.is_none() && !column.optional {
            let reason = format!("the column `{}` is missing", column.name);
            return Err(InputError::new(source, reason).at_line(first));
        }
    }
    let of_plans = place(INCUMBENTS);
    let mut rows = Vec::new();
    for record in reader.records() {
        let record = record.map_err(|error| malformed(&error))?;
        let position = record
            .position()
            .cloned()
            .unwrap_or_else(csv::Position::new);
        let wrong = |name: &str, text: &str, what: &str| {
            let reason = format!(
                "`{}` is not {what} (column {name})",
                fleetyard_core::shown(text)
            );
            InputError::new(source, reason).at_line(line_at(bytes, &position))
        };
        let mut values = Vec::with_capacity(COLUMNS.len());
        for (column, place) in COLUMNS.iter().zip(&places) {
            let text = place
                .and_then(|place| record.get(place))
                .unwrap_or_default();
            let value = value(column, text).map_err(|what| wrong(column.name, text, what))?;
            values.push(value);
        }
        let mut row = Row::from_values(values).map_err(|name| {
            let text = place(name).and_then(|place| record.get(place));
            wrong(name, text.unwrap_or_default(), "in the range of the column")
        })?;
        let plans = of_plans.and_then(|place| record.get(place)).unwrap_or("[]");
        let plans: Vec<Plan> = serde_json::from_str(if plans.is_empty() { "[]" } else { plans })
            .map_err(|_| wrong(INCUMBENTS, plans, "a JSON array of plans"))?;
        row.incumbents = plans.into_iter().map(Into::into).collect();
        rows.push(row);
    }
    Ok(rows)
}

/// The line on which the record begins that was read from there. The reader's own count is
/// of lines that it has seen the end of, which it has not where they end with CR LF.
fn line_at(bytes: &[u8], position: &csv::Position) -> u64 {
    let (before, rest) = bytes.split_at(bytes.len().min(position.byte() as usize));
    let blank = rest.iter().take_while(|byte| b"\r\n".contains(byte));
    let ends = before.iter().chain(blank).filter(|byte| **byte == b'\n');
    1 + ends.count() as u64
}

/// A field as a value; what it should have been otherwise.
fn value(column: &Column, text: &str) -> Result<Value, &'static str> {
    if text.is_empty() && column.optional {
        return Ok(Value::Null);
    }
    match column.kind {
        ColumnType::Text => Ok(Value::Text(text.to_owned())),
        ColumnType::Integer => {
            let number: u64 = text.parse().map_err(|_| "a whole number")?;
            Ok(Value::Integer(number.cast_signed()))
        }
        ColumnType::Real => Ok(Value::Real(text.parse().map_err(|_| "a number")?)),
        ColumnType::Boolean => match text {
            "1" | "true" => Ok(Value::Boolean(true)),
            "0" | "false" => Ok(Value::Boolean(false)),
            _ => Err("1 or 0"),
        },
    }
}
