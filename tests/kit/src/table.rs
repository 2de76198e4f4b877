//! Tests of many rows.

use std::fmt::Debug;
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Tries every row of a table, and fails at the end with all rows that fail.
#[track_caller]
pub fn each<Row: Debug>(rows: impl IntoIterator<Item = Row>, test: impl Fn(Row)) {
    let mut failed = Vec::new();
    let mut count = 0;
    for row in rows {
        let name: String = format!("{row:?}").chars().take(200).collect();
        // Before the message of a failure.
        println!("row {count}: {name}");
        count += 1;
        if catch_unwind(AssertUnwindSafe(|| test(row))).is_err() {
            failed.push(name);
        }
    }
    assert!(
        failed.is_empty(),
        "{} of {count} rows fail: {failed:#?}",
        failed.len()
    );
}
