//! Rows of trials as CSV, and everything that is made of rows.

use std::collections::BTreeSet;

use fleetyard_bench::Row;
use fleetyard_bench::evaluate::{Order, Unit};
use fleetyard_bench::export::{Format, export, read_csv};
use fleetyard_bench::report::{Report, Subject, svg, two_runs};

use super::check_error;

const SOURCE: &str = "a.csv";

/// Of more rows there is no report: that would be most of the time.
const FEW: usize = 12;

/// Reads rows, writes them in every format, and makes a report of them.
pub fn run(data: &[u8]) {
    let mut rows = match read_csv(SOURCE, data) {
        Ok(rows) => rows,
        Err(error) => return check_error(&error, SOURCE, data),
    };
    assert!(rows.len() <= data.len());
    // As a store has them: no key twice.
    let mut keys = BTreeSet::new();
    rows.retain(|row| keys.insert(row.key.clone()));
    round_trip(&rows);
    rows.truncate(FEW);
    for format in [Format::MazeCsv, Format::JsonLines] {
        let text = export(format, &rows).expect("rows can be exported");
        assert!(std::str::from_utf8(&text).is_ok());
    }
    for format in [Format::Parquet, Format::PlannerArena] {
        // Either takes longer than all the rest.
        if data.len() % 16 == format as usize {
            export(format, &rows).expect("rows can be exported");
        }
    }
    report(&rows);
}

/// Rows are the same when they are written and read again, whatever their order.
fn round_trip(rows: &[Row]) {
    let written = export(Format::Csv, rows).expect("rows can be written");
    let again = read_csv(SOURCE, &written).expect("what was written can be read");
    assert_eq!(again.len(), rows.len());
    // Numbers that are none are not equal to themselves.
    assert_eq!(export(Format::Csv, &again).expect("the same"), written);
    let other: Vec<Row> = rows.iter().rev().cloned().collect();
    assert_eq!(export(Format::Csv, &other).expect("the same"), written);
}

/// A report says the same of the same rows in any order, and never what is no number.
fn report(rows: &[Row]) {
    let units = [
        (Order::Text, Unit::Scenarios),
        (Order::Appendix, Unit::Maps),
    ];
    for (order, unit) in units {
        let subject = || Subject {
            title: "rows".into(),
            order,
            unit,
            ..Subject::default()
        };
        let report = Report::new(subject(), rows);
        let text = report.markdown(Some("figures"), &[]);
        let other = Report::new(subject(), rows.iter().rev());
        assert_eq!(other.markdown(Some("figures"), &[]), text);
        let numbers = report.json().expect("a report is JSON");
        assert_eq!(numbers["title"], "rows");
        for figure in report.figures() {
            assert!(!svg(&figure).is_empty());
        }
        let planners = report.planners();
        if let [one, .., other] = planners[..] {
            assert!(report.two_planners(one, other).is_some());
            report.pair_json(one, other).expect("a pair is JSON");
        }
        assert!(report.html().contains("rows"));
    }
    let (one, other) = rows.split_at(rows.len() / 2);
    two_runs(Unit::Scenarios, ("one", one), ("other", other));
    two_runs(Unit::Instances, ("all", rows), ("all", rows));
}
