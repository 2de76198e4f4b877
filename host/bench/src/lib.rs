//! Suites of trials: what is run, how it is kept, and what it says.

#![forbid(unsafe_code)]

mod row;
pub mod statistics;

pub use row::{COLUMNS, Column, ColumnType, Incumbent, Row, Value};
