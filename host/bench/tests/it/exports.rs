//! Exports are read by others: by the readers of their formats, by pandas, and by what
//! OMPL's Planner Arena asks of a database.

use fleetyard_bench::export::{Format, export, read_csv, without_formulas};
use fleetyard_bench::{COLUMNS, ColumnType, Incumbent, Row, Value};
use fleetyard_testkit::python;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::{Field, RowAccessor};
use proptest::prelude::*;
use rusqlite::Connection;

const FORMATS: [Format; 5] = [
    Format::Csv,
    Format::MazeCsv,
    Format::JsonLines,
    Format::Parquet,
    Format::PlannerArena,
];

/// Two planners on three mazes; the second fails on the last.
fn rows() -> Vec<Row> {
    let mut rows = Vec::new();
    for (number, planner) in ["R1 Weighted A*", "R4 IDA*, \"slow\"\nand | odd"]
        .into_iter()
        .enumerate()
    {
        for maze in 0..3u64 {
            let failed = number == 1 && maze == 2;
            rows.push(Row {
                key: format!("{number}-{maze}"),
                trial: maze * 2 + number as u64,
                planner: planner.into(),
                planner_id: "weighted-astar".into(),
                planner_version: "0.1.0".into(),
                options: "{\"weight\":1.5}".into(),
                attach: "worker".into(),
                ranked: true,
                instance_digest: format!("digest-{maze}"),
                map: format!("maze-{maze}"),
                scenario: "maze".into(),
                agents: 1,
                connectivity: Some(4),
                map_rows: Some(31),
                map_cols: Some(31),
                maze_index: Some(maze),
                maze_seed: Some(7 + maze),
                maze_width: Some(15),
                maze_height: Some(15),
                maze_algorithm: Some("backtracker".into()),
                budget_ms: 10_000.0,
                seed: u64::MAX,
                termination: if failed { "timed-out" } else { "completed" }.into(),
                message: failed.then(|| "the budget ended, and \u{1f422} too".into()),
                valid: !failed,
                success: !failed,
                solve_time_ms: 0.25 * (maze + 1) as f64 + 1e-7,
                planning_time_ms: 0.5,
                soc_steps: (!failed).then_some(142),
                lower_bound_steps: Some(140),
                path_length_cells: (!failed).then_some(142.0),
                expansions: (!failed).then_some(187.0),
                peak_memory_kb: Some(2048),
                contended: if maze == 1 { "other load" } else { "" }.into(),
                machine: "machine".into(),
                started_unix_ms: 1_772_107_200_000 + maze,
                incumbents: match maze {
                    0 => Vec::new(),
                    _ => vec![
                        plan(0.125, Some(150), Some(true)),
                        plan(0.2, None, None),
                        plan(0.25, Some(142), Some(true)),
                    ],
                },
                ..Row::default()
            });
        }
    }
    rows.sort_by_key(|row| row.trial);
    rows
}

fn plan(time_ms: f64, soc_steps: Option<u64>, valid: Option<bool>) -> Incumbent {
    Incumbent {
        time_ms,
        soc_steps,
        valid,
    }
}

fn text(format: Format, rows: &[Row]) -> String {
    String::from_utf8(export(format, rows).unwrap()).unwrap()
}

#[test]
fn every_export_is_the_same_every_time_and_in_any_order() {
    let rows = rows();
    let mut reversed = rows.clone();
    reversed.reverse();
    for format in FORMATS {
        let first = export(format, &rows).unwrap();
        assert!(!first.is_empty());
        assert!(
            first == export(format, &rows).unwrap(),
            "{format:?} differs"
        );
        assert!(
            first == export(format, &reversed).unwrap(),
            "{format:?} differs by order"
        );
    }
}

#[test]
fn nothing_can_be_exported_too() {
    for format in FORMATS {
        export(format, &[]).unwrap();
    }
    assert_eq!(
        read_csv("empty", &export(Format::Csv, &[]).unwrap()),
        Ok(Vec::new())
    );
}

#[test]
fn a_spreadsheet_finds_no_formula() {
    let mut rows = rows();
    rows[0].message = Some("=cmd|' /C calc'!A0".into());
    rows[0].map = "@SUM(1)".into();
    rows[0].planner = "-1".into();
    for format in [Format::Csv, Format::MazeCsv] {
        let written = export(format, &rows).unwrap();
        let harmless = without_formulas(&written).unwrap();
        let text = String::from_utf8(harmless).unwrap();
        assert!(
            text.contains(",'@SUM(1),") && !text.contains(",@SUM(1)"),
            "{text}"
        );
        assert!(text.contains("'=cmd|' /C calc'!A0"), "{text}");
        // A number is none.
        assert!(!text.contains("'-1"), "{text}");
        let written = String::from_utf8(written).unwrap();
        assert_eq!(text.lines().count(), written.lines().count());
    }
    let harmless = without_formulas(&export(Format::Csv, &rows[1..]).unwrap()).unwrap();
    assert_eq!(read_csv("rows.csv", &harmless).unwrap(), rows[1..]);
}

#[test]
fn csv_reads_as_what_was_written() {
    let rows = rows();
    let written = export(Format::Csv, &rows).unwrap();
    assert_eq!(read_csv("rows.csv", &written).unwrap(), rows);
}

fn any_value(kind: ColumnType, optional: bool) -> BoxedStrategy<Value> {
    let value = match kind {
        // An absent text and an empty one look alike.
        ColumnType::Text if optional => "\\PC{1,12}".prop_map(Value::Text).boxed(),
        ColumnType::Text => "(\\PC|[\r\n\",;])*".prop_map(Value::Text).boxed(),
        ColumnType::Integer => any::<u32>()
            .prop_map(|number| Value::Integer(number.into()))
            .boxed(),
        ColumnType::Real => any::<f64>()
            .prop_filter("a number", |number| !number.is_nan())
            .prop_map(Value::Real)
            .boxed(),
        ColumnType::Boolean => any::<bool>().prop_map(Value::Boolean).boxed(),
    };
    if optional {
        prop_oneof![Just(Value::Null), value].boxed()
    } else {
        value
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn csv_reads_any_row_as_what_was_written(
        values in COLUMNS.iter().map(|column| any_value(column.kind, column.optional)).collect::<Vec<_>>(),
    ) {
        let row = Row::from_values(values).unwrap();
        let written = export(Format::Csv, std::slice::from_ref(&row)).unwrap();
        prop_assert_eq!(read_csv("rows.csv", &written).unwrap(), [row]);
    }

    #[test]
    fn no_text_makes_the_csv_reader_panic(text in "(\\PC|[\r\n\",])*") {
        let _ = read_csv("rows.csv", text.as_bytes());
    }
}

#[test]
fn csv_errors_say_where() {
    let written = text(Format::Csv, &rows());
    let error = |from: &str, to: &str| {
        let changed = written.replacen(from, to, 1);
        assert_ne!(changed, written);
        read_csv("rows.csv", changed.as_bytes()).unwrap_err()
    };
    let found = error("solve_time_ms", "solve_time");
    let at = written.find("solve_time_ms").unwrap() + 1;
    let wanted = format!("rows.csv:1:{at}: there is no column `solve_time`");
    assert_eq!(found.to_string(), wanted);
    assert_eq!(found.hint.as_deref(), Some("did you mean `solve_time_ms`?"));
    let found = error("planner_id,", "").to_string();
    assert!(
        found.contains("fields, the header") || found.contains("planner_id"),
        "{found}"
    );
    let found = error("142", "many").to_string();
    assert!(found.starts_with("rows.csv:2: `many` is not a"), "{found}");
    let found = error("key,trial", "trial,trial").to_string();
    assert_eq!(found, "rows.csv:1:7: there are two columns `trial`");
    let found = read_csv("rows.csv", b"key\r\na\r\n")
        .unwrap_err()
        .to_string();
    assert_eq!(found, "rows.csv:1: the column `trial` is missing");
}

#[test]
fn the_csv_of_the_maze_paper_has_its_columns_first() {
    let written = text(Format::MazeCsv, &rows());
    let mut lines = written.split("\r\n");
    let header = lines.next().unwrap();
    let of_the_paper = "planner,maze_index,maze_seed,width,height,algorithm,success,\
                        solve_time_ms,path_length,expansions,error";
    assert!(
        header.starts_with(&format!("{of_the_paper},key,trial,")),
        "{header}"
    );
    let first = "R1 Weighted A*,0,7,15,15,backtracker,1,0.2500001,142,187,,0-0,0,";
    assert!(lines.next().unwrap().starts_with(first));
    let failed = "backtracker,0,0.7500001,,,\"timed-out: the budget ended, and \u{1f422} too\",";
    assert!(written.contains(failed), "{written}");
    // Nothing is there twice or missing.
    let names: Vec<&str> = header.split(',').collect();
    assert_eq!(names.len(), COLUMNS.len() + 1);
}

#[test]
fn json_lines_are_objects() {
    let rows = rows();
    let written = text(Format::JsonLines, &rows);
    let lines: Vec<serde_json::Value> = written
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(lines.len(), rows.len());
    assert_eq!(lines[0]["seed"].as_u64(), Some(u64::MAX));
    assert_eq!(lines[0]["success"].as_bool(), Some(true));
    assert!(lines[0]["rtf"].is_null());
    assert_eq!(lines[2]["incumbents"][2]["soc_steps"].as_u64(), Some(142));
    assert!(
        lines
            .iter()
            .all(|line| line.as_object().unwrap().len() == COLUMNS.len() + 1)
    );
}

#[test]
fn parquet_is_read_by_its_reader() {
    let rows = rows();
    let written = export(Format::Parquet, &rows).unwrap();
    let reader = SerializedFileReader::new(parquet_bytes(&written)).unwrap();
    let read: Vec<_> = reader
        .get_row_iter(None)
        .unwrap()
        .map(Result::unwrap)
        .collect();
    assert_eq!(read.len(), rows.len());
    for (read, row) in read.iter().zip(&rows) {
        for ((name, field), (column, value)) in
            read.get_column_iter().zip(COLUMNS.iter().zip(row.values()))
        {
            assert_eq!(name, column.name);
            let same = match (field, value) {
                (Field::Null, Value::Null) => true,
                (Field::Str(read), Value::Text(text)) => *read == text,
                (Field::ULong(read), Value::Integer(number)) => *read == number.cast_unsigned(),
                (Field::Double(read), Value::Real(number)) => read.to_bits() == number.to_bits(),
                (Field::Bool(read), Value::Boolean(yes)) => *read == yes,
                _ => false,
            };
            assert!(same, "{name}: {field:?}");
        }
        let plans = read.get_list(COLUMNS.len()).unwrap();
        assert_eq!(plans.len(), row.incumbents.len());
        for (plan, wanted) in plans.elements().iter().zip(&row.incumbents) {
            let Field::Group(plan) = plan else {
                panic!("{plan:?} is no structure");
            };
            assert_eq!(
                plan.get_double(0).unwrap().to_bits(),
                wanted.time_ms.to_bits()
            );
            assert_eq!(plan.get_ulong(1).ok(), wanted.soc_steps);
            assert_eq!(plan.get_bool(2).ok(), wanted.valid);
        }
    }
}

/// A reader of bytes in memory.
fn parquet_bytes(bytes: &[u8]) -> std::fs::File {
    use std::io::Write as _;
    let mut file = tempfile::tempfile().unwrap();
    file.write_all(bytes).unwrap();
    file
}

#[test]
fn pandas_reads_parquet_and_csv_alike() {
    const SCRIPT: &str = "
import io, json, sys, pandas
size, data = sys.stdin.buffer.readline(), sys.stdin.buffer.read()
parquet = pandas.read_parquet(io.BytesIO(data[:int(size)]))
csv = pandas.read_csv(io.BytesIO(data[int(size):]))
assert list(parquet.columns) == list(csv.columns)
for name in csv.columns.drop(['incumbents', 'success', 'valid', 'ranked']):
    a, b = parquet[name], csv[name]
    if a.dtype == object or a.dtype == 'str':
        assert [x for x in a.dropna() if x] == [str(x) for x in b.dropna()], name
    else:
        assert a.astype(float).equals(b.astype(float)), name
assert list(parquet['success'].astype(int)) == list(csv['success'])
plans = [[dict(plan) for plan in plans] for plans in parquet['incumbents']]
assert plans == [json.loads(plans) for plans in csv['incumbents']]
json.dump({'types': {name: str(kind) for name, kind in parquet.dtypes.items()}}, sys.stdout)
";
    let rows = rows();
    let parquet = export(Format::Parquet, &rows).unwrap();
    let csv = export(Format::Csv, &rows).unwrap();
    let size = format!("{}\n", parquet.len()).into_bytes();
    let input = [size, parquet, csv].concat();
    let Some(answer) = python::run("pandas, pyarrow", SCRIPT, &input) else {
        return;
    };
    let answer: serde_json::Value = serde_json::from_slice(&answer).unwrap();
    for (column, wanted) in [
        ("seed", "uint64"),
        ("solve_time_ms", "float64"),
        ("success", "bool"),
    ] {
        assert_eq!(answer["types"][column], wanted);
    }
}

#[test]
fn the_database_has_what_planner_arena_asks_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("benchmark.db");
    std::fs::write(&path, export(Format::PlannerArena, &rows()).unwrap()).unwrap();
    let database = Connection::open(&path).unwrap();
    let names = |table: &str| -> Vec<String> {
        let query = format!("SELECT name FROM pragma_table_info('{table}')");
        let mut query = database.prepare(&query).unwrap();
        query
            .query_map([], |row| row.get(0))
            .unwrap()
            .map(Result::unwrap)
            .collect()
    };
    let experiments = "id name totaltime timelimit memorylimit runcount version hostname cpuinfo \
                       date seed setup agents scenario instance";
    assert_eq!(names("experiments").join(" "), experiments);
    assert_eq!(names("plannerConfigs").join(" "), "id name settings");
    assert_eq!(names("enums").join(" "), "name value description");
    assert_eq!(
        names("runs")[..4].join(" "),
        "id experimentid plannerid time"
    );
    assert_eq!(names("progress").join(" "), "runid time best_cost");
    // Joined tables have no column in common but their keys.
    for run in &names("runs")[1..] {
        assert!(!names("experiments").contains(run) && !names("plannerConfigs").contains(run));
    }

    let one = |query: &str| -> String {
        database
            .query_row(query, [], |row| row.get::<_, rusqlite::types::Value>(0))
            .map(|value| format!("{value:?}"))
            .unwrap()
    };
    assert_eq!(one("PRAGMA integrity_check"), "Text(\"ok\")");
    assert_eq!(
        one("SELECT count(*) FROM pragma_foreign_key_check"),
        "Integer(0)"
    );
    assert_eq!(
        one("SELECT count(DISTINCT name) FROM experiments"),
        "Integer(1)"
    );
    assert_eq!(
        one("SELECT date FROM experiments"),
        "Text(\"2026-02-26 12:00:00\")"
    );
    assert_eq!(one("SELECT count(*) FROM experiments"), "Integer(3)");
    assert_eq!(one("SELECT runcount FROM experiments"), "Integer(1)");
    assert_eq!(one("SELECT sum(solved) FROM runs"), "Integer(5)");
    assert_eq!(one("SELECT memory FROM runs"), "Real(2.0)");
    let status = "SELECT description FROM enums JOIN runs ON value = status WHERE name = 'status' AND solved = 0";
    assert_eq!(one(status), "Text(\"timed-out\")");
    let times = "SELECT time - 0.00025 < 1e-9 AND time > 0.00025 FROM runs WHERE id = 1";
    assert_eq!(one(times), "Integer(1)");
    // What was not judged is no progress.
    assert_eq!(one("SELECT count(*) FROM progress"), "Integer(8)");
}
