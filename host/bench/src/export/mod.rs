//! Rows in the formats of other tools. Every export is bytes that
//! depend on the rows alone: the same rows in any order give the same file.

mod columns;
mod csv;
mod error;
mod json_lines;
mod parquet;
mod planner_arena;
mod time;

pub use csv::{read_csv, without_formulas};
pub use error::ExportError;
pub use time::rfc3339;

use crate::Row;

/// The formats to which rows can be exported.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Format {
    /// Every column; RFC 4180.
    Csv,
    /// The columns of the maze paper, then the others; RFC 4180.
    MazeCsv,
    /// An object per trial and line.
    JsonLines,
    /// Apache Parquet, compressed with Zstandard.
    Parquet,
    /// A SQLite database as OMPL's Planner Arena reads it.
    PlannerArena,
}

/// The bytes of a file of that format.
pub fn export(format: Format, rows: &[Row]) -> Result<Vec<u8>, ExportError> {
    let mut rows: Vec<&Row> = rows.iter().collect();
    rows.sort_by_key(|row| (row.trial, row.repeat, &row.key));
    match format {
        Format::Csv => csv::csv(&rows),
        Format::MazeCsv => csv::maze_csv(&rows),
        Format::JsonLines => json_lines::json_lines(&rows),
        Format::Parquet => parquet::parquet(&rows),
        Format::PlannerArena => planner_arena::planner_arena(&rows),
    }
}
