//! Tests of many rows.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Tries every row of a table, and fails at the end with the names of all rows that fail.
#[track_caller]
pub fn each<Row>(
    rows: impl IntoIterator<Item = Row>,
    name: impl Fn(&Row) -> String,
    test: impl Fn(Row),
) {
    let mut failed = Vec::new();
    let mut count = 0;
    for row in rows {
        let name = name(&row);
        // Before what a failure says.
        println!("row: {name}");
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
