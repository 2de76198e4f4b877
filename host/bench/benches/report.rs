//! Time for a report of a large store, and size of its page.

#[path = "../tests/it/support/mod.rs"]
mod support;

use std::time::Instant;

use fleetyard_bench::report::{Report, Subject, svg};
use fleetyard_bench::{Meta, Store};
use support::{Shape, rows};

/// Trials of the store.
const TRIALS: usize = 100_000;

fn main() {
    let names: Vec<String> = (1..=10).map(|number| format!("planner {number}")).collect();
    let planners: Vec<&str> = names.iter().map(String::as_str).collect();
    let mut rows = rows(
        &Shape {
            planners: &planners,
            maps: &[
                "random-32-32-20",
                "room-32-32-4",
                "maze-32-32-2",
                "empty-32-32",
            ],
            scenarios: 625,
            ..Shape::default()
        },
        1,
    );
    rows.truncate(TRIALS);
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join("trials.sqlite");
    let mut store = Store::create(&path, &Meta::default()).expect("a store");
    for row in &rows {
        store.insert(row).expect("a row");
    }
    drop(store);
    let clock = Instant::now();
    let rows = Store::open_read_only(&path).and_then(|store| store.rows());
    let rows = rows.expect("the rows of the store");
    let read = clock.elapsed();
    let clock = Instant::now();
    let report = Report::new(Subject::default(), &rows);
    let evaluated = clock.elapsed();
    let clock = Instant::now();
    let page = report.html();
    let html = clock.elapsed();
    let clock = Instant::now();
    let figures: usize = report
        .figures()
        .iter()
        .map(|figure| svg(figure).len())
        .sum();
    let drawn = clock.elapsed();
    println!("{} trials read from the store in {read:.2?}", rows.len());
    println!("evaluated in {evaluated:.2?}");
    println!("page of {:.1} MB in {html:.2?}", page.len() as f64 / 1e6);
    println!("figures of {:.1} MB in {drawn:.2?}", figures as f64 / 1e6);
    println!("report in {:.2?}", read + evaluated + html);
    if let Some(out) = std::env::var_os("REPORT_PAGE") {
        std::fs::write(out, page).expect("the page is written");
    }
}
