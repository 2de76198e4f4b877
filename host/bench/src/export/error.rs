//! Errors of exports.

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
