//! Rows in the formats of other tools. Every export is bytes that
//! depend on the rows alone: the same rows in any order give the same file.

mod columns;
mod csv;
mod json_lines;
mod parquet;
mod planner_arena;

use std::time::{Duration, UNIX_EPOCH};

pub use csv::read_csv;

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

/// The reason why an export could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// The CSV writer refused a record.
    #[error("cannot write CSV: {0}")]
    Csv(#[from] ::csv::Error),
    /// A value could not be written as JSON.
    #[error("cannot write JSON: {0}")]
    Json(#[from] serde_json::Error),
    /// The Parquet writer refused a value.
    #[error("cannot write Parquet: {0}")]
    Parquet(#[from] ::parquet::errors::ParquetError),
    /// The database could not be made.
    #[error("cannot write the database: {0}")]
    Sqlite(#[from] rusqlite::Error),
    /// A temporary file could not be written or read.
    #[error("cannot use a temporary file: {0}")]
    Io(#[from] std::io::Error),
}

/// A time in milliseconds since 1970, such as `2026-02-26T12:00:00Z`. A store may have any
/// number; what is beyond the year 9999 is shown as its end.
pub fn rfc3339(unix_ms: u64) -> String {
    const LAST_MS: u64 = 253_402_300_799_000;
    let time = UNIX_EPOCH + Duration::from_millis(unix_ms.min(LAST_MS));
    humantime::format_rfc3339_seconds(time).to_string()
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
