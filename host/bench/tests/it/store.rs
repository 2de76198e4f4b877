//! The store: what it keeps, what it refuses, and what it leaves alone.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

use fleetyard_bench::{Asked, COLUMNS, ColumnType, Incumbent, Meta, Places, Row, Store};
use fleetyard_core::{Digest, InputError};
use fleetyard_runtime::CodeFile;

fn meta() -> Meta {
    Meta {
        suite: "small".into(),
        suite_text: "name = \"small\"\n".into(),
        suite_values: "{}".into(),
        suite_digest: "d".into(),
        fleetyard: "0.0.0".into(),
        created_unix_ms: 7,
        asked: Some(1008),
        places: Places {
            planners: BTreeMap::from([("mine".into(), "/plugins/mine.so".into())]),
            ..Places::default()
        },
    }
}

fn row(trial: u64) -> Row {
    Row {
        key: format!("key {trial}"),
        trial,
        planner: "A".into(),
        seed: u64::MAX - trial,
        success: trial.is_multiple_of(2),
        // Whole numbers of a real column come back as reals.
        solve_time_ms: trial as f64,
        rtf: (trial > 3).then_some(2.5),
        incumbents: (0..trial)
            .map(|number| Incumbent {
                time_ms: number as f64 + 0.5,
                soc_steps: Some(100 - number),
                valid: (number > 0).then_some(true),
            })
            .collect(),
        ..Row::default()
    }
}

fn filled(path: &Path, trials: impl IntoIterator<Item = u64>) {
    let mut store = Store::create(path, &meta()).unwrap();
    for trial in trials {
        store.insert(&row(trial)).unwrap();
    }
}

#[track_caller]
fn refused<T>(result: Result<T, InputError>, reason: &str) {
    let Err(error) = result else {
        panic!("nothing was refused")
    };
    assert!(error.reason.contains(reason), "{error}");
    assert!(error.hint.is_some(), "{error} has no hint");
}

#[test]
fn what_goes_in_comes_out() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a b%.sqlite");
    filled(&path, [2, 0, 5, 1]);
    let mut store = Store::open(&path).unwrap();
    assert_eq!(store.rows().unwrap(), [0, 1, 2, 5].map(row));
    assert_eq!(store.counts().unwrap(), (4, 0));
    assert_eq!(store.meta().unwrap(), meta());
    assert!(store.keys().unwrap().contains("key 5"));
    store.add_machine(Digest(1), "{}").unwrap();
    store.add_machine(Digest(1), "{}").unwrap();
    let file = |path: &str| CodeFile {
        path: path.into(),
        sha256: "00".into(),
    };
    store.add_code(Digest(2), &[file("b"), file("a")]).unwrap();
    assert_eq!(store.machines().unwrap().len(), 1);
    assert_eq!(
        store.code().unwrap()[&Digest(2).to_string()],
        [file("a"), file("b")]
    );
    // A key is there once.
    assert!(store.insert(&row(5)).is_err());
    assert_eq!(store.counts().unwrap(), (4, 0));
    drop(store);
    let names: Vec<_> = fs::read_dir(folder.path()).unwrap().collect();
    assert_eq!(names.len(), 1, "{names:?}");
}

#[test]
fn what_a_suite_no_longer_asks_is_kept_apart() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.sqlite");
    filled(&path, 0..4);
    let mut store = Store::open(&path).unwrap();
    let asked = [
        Asked {
            key: "key 3",
            trial: 0,
            planner: "B",
            view: Some("wide"),
        },
        Asked {
            key: "key 1",
            trial: 1,
            planner: "A",
            view: None,
        },
        Asked {
            key: "key 9",
            trial: 2,
            planner: "A",
            view: None,
        },
    ];
    let new = Meta {
        suite_digest: "other".into(),
        ..meta()
    };
    store.adopt(&new, asked).unwrap();
    assert_eq!(store.meta().unwrap(), new);
    let rows = store.rows().unwrap();
    let told: Vec<(&str, u64, String)> = rows
        .iter()
        .map(|row| (row.key.as_str(), row.trial, row.entrant().into_owned()))
        .collect();
    assert_eq!(
        told,
        [
            ("key 3", 0, "B on wide".to_owned()),
            ("key 1", 1, "A".to_owned())
        ]
    );
    assert_eq!(store.counts().unwrap(), (2, 2));
    // And back.
    let all: Vec<Row> = (0..4).map(row).collect();
    let asked = all.iter().map(|row| Asked {
        key: &row.key,
        trial: row.trial,
        planner: &row.planner,
        view: row.view.as_deref(),
    });
    store.adopt(&meta(), asked).unwrap();
    assert_eq!(store.rows().unwrap(), all);
}

#[test]
fn one_writes_and_others_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.sqlite");
    let mut store = Store::create(&path, &meta()).unwrap();
    let me = format!("process {} is writing", std::process::id());
    refused(Store::open(&path), &me);
    refused(Store::create(&path, &meta()), &me);
    let reader = Store::open_read_only(&path).unwrap();
    for trial in 0..3 {
        store.insert(&row(trial)).unwrap();
        assert_eq!(reader.counts().unwrap().0, trial + 1);
    }
    drop(store);
    refused(
        Store::create(&path, &meta()),
        "there is a file of this name",
    );
    assert_eq!(Store::open(&path).unwrap().counts().unwrap().0, 3);
}

#[test]
fn shards_are_merged() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let [one, two, three, out] = ["1", "2", "3", "out"].map(path);
    filled(&one, [0, 2]);
    filled(&two, [1, 3]);
    filled(&three, [3]);
    let merged = Store::merge(&out, &[one.clone(), two.clone(), three.clone()]).unwrap();
    assert_eq!((merged.trials, merged.repeated), (4, 1));
    let store = Store::open_read_only(&out).unwrap();
    assert_eq!(store.rows().unwrap(), (0..4).map(row).collect::<Vec<_>>());
    refused(
        Store::merge(&out, std::slice::from_ref(&one)),
        "there is a file of this name",
    );
    let mut store = Store::open(&three).unwrap();
    store
        .insert(&Row {
            solve_time_ms: 9.0,
            ..row(2)
        })
        .unwrap();
    drop(store);
    let again = path("again");
    refused(
        Store::merge(&again, &[one.clone(), three]),
        "1 trials have two results each, which differ:\n  A on ",
    );
    let four = path("4");
    let other = Meta {
        suite_digest: "e".into(),
        ..meta()
    };
    drop(Store::create(&four, &other).unwrap());
    refused(
        Store::merge(&again, &[one, four]),
        "another state of the suite",
    );
    refused(
        Store::merge(&again, &[path("nowhere")]),
        "there is no such store",
    );
    assert!(!again.exists());
    let left: Vec<_> = fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name())
        .filter(|name| name.to_string_lossy().contains("again"))
        .collect();
    assert!(left.is_empty(), "{left:?}");
}

/// A store with three trials, closed, as bytes.
fn bytes(folder: &Path) -> Vec<u8> {
    let path = folder.join("whole");
    filled(&path, 0..3);
    fs::read(path).unwrap()
}

#[test]
fn what_is_no_store_is_refused_and_left_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let whole = bytes(folder.path());
    let changed = |at: usize, value: u8| {
        let mut bytes = whole.clone();
        bytes[at] = value;
        bytes
    };
    let mut torn = whole.clone();
    let middle = torn.len() / 2;
    torn[4096..middle].fill(0xa5);
    let cases: [(&str, Vec<u8>, &str); 7] = [
        ("empty", Vec::new(), "the file is empty"),
        (
            "text",
            b"name = \"suite\"\n".repeat(20),
            "no SQLite database",
        ),
        ("start", whole[..60].to_vec(), "ends within its header"),
        (
            "version",
            changed(63, 2),
            "a store of version 2, and this program knows 1",
        ),
        ("owner", changed(70, 0), "belongs to another program"),
        (
            "half",
            whole[..middle / 4096 * 4096].to_vec(),
            "the store is damaged",
        ),
        ("torn", torn, "the store is damaged"),
    ];
    for (name, content, reason) in cases {
        let path = folder.path().join(name);
        fs::write(&path, &content).unwrap();
        refused(Store::open(&path), reason);
        refused(
            Store::open_read_only(&path).and_then(|store| store.rows()),
            reason,
        );
        assert!(fs::read(&path).unwrap() == content, "{name} was changed");
    }
    refused(Store::open(folder.path()), "this is a folder, not a file");
    refused(
        Store::open_read_only(&PathBuf::from("/nowhere/s")),
        "no such store",
    );
    refused(
        Store::create(&PathBuf::from("/nowhere/s"), &meta()),
        "cannot be locked",
    );
}

#[test]
fn damage_anywhere_is_an_error_or_a_row_and_never_a_panic() {
    let folder = tempfile::tempdir().unwrap();
    let whole = bytes(folder.path());
    let path = folder.path().join("damaged");
    // Every byte of the pages would take minutes: steps that share no factor with a page.
    for at in (100..whole.len()).step_by(61) {
        let mut content = whole.clone();
        content[at] ^= 0x55;
        fs::write(&path, &content).unwrap();
        if let Ok(store) = Store::open_read_only(&path) {
            let _ = (store.rows(), store.meta(), store.machines(), store.code());
        }
    }
}

#[test]
fn a_store_from_before_a_column_was_added_is_read_and_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.sqlite");
    filled(&path, 0..2);
    let alter = |statement: &str| {
        let connection = rusqlite::Connection::open(&path).unwrap();
        connection.execute_batch(statement).unwrap();
    };
    let optional = COLUMNS.iter().find(|column| column.name == "rtf").unwrap();
    assert!(optional.optional);
    alter("ALTER TABLE trials DROP COLUMN rtf");
    assert_eq!(
        Store::open_read_only(&path).unwrap().rows().unwrap(),
        [row(0), row(1)]
    );
    Store::open(&path).unwrap().insert(&row(4)).unwrap();
    assert_eq!(
        Store::open_read_only(&path).unwrap().rows().unwrap()[2],
        row(4)
    );
    alter("ALTER TABLE trials DROP COLUMN map");
    refused(Store::open(&path), "lacks the column `map`");
    refused(Store::open_read_only(&path), "lacks the column `map`");
}

#[test]
fn the_guide_has_every_column() {
    let guide = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/benchmarking.md");
    let guide = fs::read_to_string(guide).unwrap();
    let mut list = String::new();
    for column in COLUMNS {
        let kind = match column.kind {
            ColumnType::Text => "text",
            ColumnType::Integer => "integer",
            ColumnType::Real => "real",
            ColumnType::Boolean => "boolean",
        };
        let optional = if column.optional { "?" } else { "" };
        let meaning = column.doc.trim();
        // Writing to a string cannot fail.
        let _ = writeln!(list, "- `{}` ({kind}{optional}): {meaning}", column.name);
    }
    assert!(
        guide.contains(&list),
        "docs/benchmarking.md has to have:\n{list}"
    );
}

#[test]
fn a_second_writer_is_refused_whichever_name_it_has() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.sqlite");
    let other = folder.path().join("other");
    fs::create_dir(&other).unwrap();
    for by_create in [true, false] {
        let mut writer = if by_create {
            Store::create(&path, &meta()).unwrap()
        } else {
            Store::open(&path).unwrap()
        };
        let links = ["soft.sqlite", "hard.sqlite"].map(|name| other.join(name));
        std::os::unix::fs::symlink(&path, &links[0]).unwrap();
        fs::hard_link(&path, &links[1]).unwrap();
        std::os::unix::fs::symlink(folder.path(), other.join("folder")).unwrap();
        for name in links.iter().chain([&path, &other.join("folder/s.sqlite")]) {
            refused(Store::open(name), "is writing this store");
            // Reading is for everybody.
            Store::open_read_only(name).unwrap();
        }
        writer.insert(&row(u64::from(by_create))).unwrap();
        drop(writer);
        for name in &links {
            drop(Store::open(name).unwrap());
        }
        fs::remove_dir_all(&other).unwrap();
        fs::create_dir(&other).unwrap();
    }
    assert_eq!(Store::open(&path).unwrap().counts().unwrap(), (2, 0));
}

#[test]
fn times_of_an_earlier_version_are_no_claims() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("s.sqlite");
    let mut store = Store::create(&path, &meta()).unwrap();
    for (trial, attach) in ["worker", "in-process"].into_iter().enumerate() {
        let claimed = Row {
            attach: attach.into(),
            solve_time_ms: 1e-6,
            call_time_ms: Some(1e-6),
            planning_time_ms: 300.0,
            ..row(trial as u64)
        };
        store.insert(&claimed).unwrap();
    }
    let times: Vec<f64> = store
        .rows()
        .unwrap()
        .iter()
        .map(|row| row.solve_time_ms)
        .collect();
    assert_eq!(times, [300.0, 1e-6]);
}

/// A store as its writer's death leaves it, with a change half made: the file and its journal, as they
/// were in the middle of a transaction.
fn half_written(folder: &Path) -> PathBuf {
    let (whole, half) = (folder.join("whole.sqlite"), folder.join("half.sqlite"));
    filled(&whole, 0..80);
    let connection = rusqlite::Connection::open(&whole).unwrap();
    connection.pragma_update(None, "cache_size", 1).unwrap();
    connection
        .execute_batch("BEGIN IMMEDIATE; UPDATE incumbents SET time_ms = 1e9; UPDATE trials SET solve_time_ms = 1e9;")
        .unwrap();
    fs::copy(&whole, &half).unwrap();
    let journal = |path: &Path| path.with_extension("sqlite-journal");
    fs::copy(journal(&whole), journal(&half)).unwrap();
    half
}

#[test]
fn a_change_that_a_killed_writer_has_half_made_is_taken_back_by_who_reads() {
    let folder = tempfile::tempdir().unwrap();
    let path = half_written(folder.path());
    let store = Store::open_read_only(&path).unwrap();
    assert_eq!(store.rows().unwrap(), (0..80).map(row).collect::<Vec<_>>());
    assert!(!path.with_extension("sqlite-journal").exists());
}
