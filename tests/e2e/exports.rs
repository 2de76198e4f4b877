//! `fleetyard store export`: a store in the formats of other tools.

use std::fs;

use fleetyard_bench::{Meta, Row, Store};
use fleetyard_testkit::{INPUT, SUCCESS, USAGE, Yard};

/// A store with two planners on two instances, whose suite ranks as the appendix does.
fn yard() -> Yard {
    let yard = Yard::new();
    let meta = Meta {
        suite_values: r#"{"protocol": {"ranking": "appendix"}}"#.into(),
        ..Meta::default()
    };
    let mut store = Store::create(&yard.path("a.sqlite"), &meta).unwrap();
    for trial in 0..4u64 {
        let row = Row {
            key: trial.to_string(),
            trial,
            planner: ["fast", "slow"][trial as usize % 2].into(),
            instance_digest: (trial / 2).to_string(),
            success: true,
            solve_time_ms: 1.0 + trial as f64,
            maze_seed: Some(7 + trial / 2),
            ..Row::default()
        };
        store.insert(&row).unwrap();
    }
    yard
}

#[test]
fn a_store_is_written_in_every_format() {
    let yard = yard();
    let line = "store export a.sqlite --csv a.csv --maze-csv m.csv --jsonl a.jsonl --parquet a.parquet \
                --markdown a.md --planner-arena a.db";
    let printed = yard.line(line).expect(SUCCESS).stdout;
    assert_eq!(printed, "a.csv\nm.csv\na.jsonl\na.parquet\na.db\na.md\n");
    let read = |name: &str| fs::read(yard.path(name)).unwrap();
    let first = ["a.csv", "m.csv", "a.jsonl", "a.parquet", "a.md", "a.db"].map(read);
    let starts: [&[u8]; 6] = [
        b"key,trial,planner,",
        b"planner,maze_index,maze_seed,",
        b"{\"key\":\"0\"",
        b"PAR1",
        b"# Trials",
        b"SQLite format 3",
    ];
    for (bytes, start) in first.iter().zip(starts) {
        assert!(
            bytes.starts_with(start),
            "{}",
            String::from_utf8_lossy(bytes)
        );
    }
    yard.line(line).expect(SUCCESS);
    let second = ["a.csv", "m.csv", "a.jsonl", "a.parquet", "a.md", "a.db"].map(read);
    assert!(first == second, "a second export differs");

    let printed = yard
        .line("store export a.sqlite --maze-csv -")
        .expect(SUCCESS)
        .stdout;
    assert_eq!(printed.as_bytes(), first[1]);
    let suite = yard
        .line("store export a.sqlite --markdown -")
        .expect(SUCCESS)
        .stdout;
    assert!(
        suite.contains("mean time, comparable mean length"),
        "{suite}"
    );
    let asked = yard
        .line("store export a.sqlite --markdown - --rank text")
        .expect(SUCCESS)
        .stdout;
    assert!(
        !asked.contains("mean time, comparable mean length"),
        "{asked}"
    );
}

#[test]
fn what_cannot_be_written_is_refused() {
    let yard = yard();
    yard.line("store export a.sqlite").expect(USAGE);
    yard.line("store export a.sqlite --csv a --jsonl a")
        .expect(USAGE);
    yard.line("store export a.sqlite --markdown - --rank best")
        .expect(USAGE);
    yard.line("store export none.sqlite --csv a.csv")
        .expect(INPUT);
    let before = fs::read(yard.path("a.sqlite")).unwrap();
    yard.line("store export a.sqlite --csv a.sqlite")
        .expect(INPUT);
    yard.line("store export a.sqlite --csv none/a.csv --jsonl a.jsonl")
        .expect(INPUT);
    assert!(before == fs::read(yard.path("a.sqlite")).unwrap());
    assert!(!yard.path("a.jsonl").exists());
}

#[test]
fn extreme_values_of_a_store_are_shown() {
    let yard = Yard::new();
    let latest = u64::MAX >> 1;
    let meta = Meta {
        created_unix_ms: latest,
        suite: "s\u{202e}".into(),
        suite_values: "[".repeat(100_000),
        ..Meta::default()
    };
    let mut store = Store::create(&yard.path("a.sqlite"), &meta).unwrap();
    for trial in 0..4u64 {
        let (number, real) = match trial {
            0 => (latest, f64::MAX),
            1 => (u64::MAX, f64::INFINITY),
            2 => (1 << 63, -f64::MAX),
            _ => (0, f64::NEG_INFINITY),
        };
        let row = Row {
            key: trial.to_string(),
            trial: number,
            planner: ["fast", "slow"][trial as usize % 2].into(),
            instance_digest: (trial / 2).to_string(),
            success: true,
            agents: number,
            seed: number,
            map_rows: Some(u32::MAX),
            maze_seed: Some(number),
            maze_width: Some(u32::MAX),
            maze_height: Some(0),
            budget_ms: real,
            solve_time_ms: real,
            planning_time_ms: real,
            correction_ms: Some(real),
            correction_uncertainty_ms: Some(real),
            expansions: Some(real),
            peak_memory_kb: Some(number),
            soc_steps: Some(number),
            started_unix_ms: number,
            incumbents: vec![fleetyard_bench::Incumbent {
                time_ms: real,
                soc_steps: Some(number),
                valid: Some(true),
            }],
            ..Row::default()
        };
        store.insert(&row).unwrap();
    }
    drop(store);
    for line in [
        "store info a.sqlite",
        "report a.sqlite --html a.html --markdown r.md --svg figures --csv r.csv",
        "report a.sqlite --format json",
        "report a.sqlite --compare fast slow",
        "store export a.sqlite --csv a.csv --maze-csv m.csv --jsonl a.jsonl --parquet a.parquet \
         --markdown a.md --planner-arena a.db",
    ] {
        yard.line(line).expect(SUCCESS);
    }
    let page = fs::read_to_string(yard.path("a.html")).unwrap();
    assert!(page.contains("9999-12-31T23:59:59Z"));
}
