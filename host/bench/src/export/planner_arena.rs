//! A database for OMPL's Planner Arena: Moll, Şucan and Kavraki, "Benchmarking motion
//! planning algorithms", IEEE Robotics & Automation Magazine 22 (2015).
//!
//! Its tables are `experiments`, `plannerConfigs`, `enums`, `runs` and `progress`. It shows
//! every column of `runs` beyond the third as an attribute, every column of `progress` beyond
//! the second as a series over time, and lets one choose by every column of `experiments`
//! beyond the twelfth. Names of columns in different tables must differ, because it joins them.

use std::collections::BTreeMap;

use rusqlite::types::Value as Sql;
use rusqlite::{Connection, params};

use super::ExportError;
use crate::Row;
use crate::evaluate::{METRICS, Metric, SOLVE_TIME};

/// Columns that OMPL names otherwise, or has in other units, with the factor.
const RENAMED: [(&str, &str, f64); 3] = [
    ("solve_time_ms", "time", 1e-3),
    ("peak_memory_kb", "memory", 1.0 / 1024.0),
    ("path_length_m", "solution_length", 1.0),
];

pub(super) fn planner_arena(rows: &[&Row]) -> Result<Vec<u8>, ExportError> {
    let folder = tempfile::tempdir()?;
    let path = folder.path().join("benchmark.db");
    let mut connection = Connection::open(&path)?;
    // Nobody reads it before it is whole, and a copy of it is what is kept.
    connection.execute_batch("PRAGMA journal_mode = OFF; PRAGMA synchronous = OFF;")?;
    let transaction = connection.transaction()?;
    fill(&transaction, rows)?;
    transaction.commit()?;
    connection.close().map_err(|(_, error)| error)?;
    Ok(std::fs::read(path)?)
}

/// A metric's column: its name, and what its values are multiplied by.
fn column(metric: &Metric) -> (&'static str, f64) {
    let renamed = RENAMED.iter().find(|(ours, ..)| *ours == metric.column);
    renamed.map_or((metric.column, 1.0), |(_, name, scale)| (name, *scale))
}

fn fill(connection: &Connection, rows: &[&Row]) -> Result<(), ExportError> {
    let has = |metric: &&Metric| rows.iter().any(|row| metric.of(row).is_some());
    // Attributes without a value would only be in the way. There is a time, even of nothing.
    let metrics: Vec<&Metric> = METRICS
        .iter()
        .filter(|metric| **metric == SOLVE_TIME || has(metric))
        .collect();
    let names: Vec<&str> = metrics.iter().map(|metric| column(metric).0).collect();
    let attributes = names.join(" REAL, ");
    connection.execute_batch(&format!(
        "CREATE TABLE experiments (
            id INTEGER PRIMARY KEY AUTOINCREMENT, name VARCHAR(512), totaltime REAL,
            timelimit REAL, memorylimit REAL, runcount INTEGER, version VARCHAR(128),
            hostname VARCHAR(1024), cpuinfo TEXT, date DATETIME, seed VARCHAR(24), setup TEXT,
            agents INTEGER, scenario TEXT, instance TEXT);
        CREATE TABLE plannerConfigs (
            id INTEGER PRIMARY KEY AUTOINCREMENT, name VARCHAR(512) NOT NULL, settings TEXT);
        CREATE TABLE enums (
            name VARCHAR(512), value INTEGER, description TEXT, PRIMARY KEY (name, value));
        CREATE TABLE runs (
            id INTEGER PRIMARY KEY AUTOINCREMENT,
            experimentid INTEGER REFERENCES experiments(id) ON DELETE CASCADE,
            plannerid INTEGER REFERENCES plannerConfigs(id) ON DELETE CASCADE,
            {attributes} REAL,
            solved BOOLEAN, correct_solution BOOLEAN, status ENUM, disturbed BOOLEAN);
        CREATE TABLE progress (
            runid INTEGER REFERENCES runs(id) ON DELETE CASCADE, time REAL, best_cost REAL,
            PRIMARY KEY (runid, time));"
    ))?;
    let planners = planners(connection, rows)?;
    let experiments = experiments(connection, rows)?;
    let statuses = statuses(connection, rows)?;

    let mut insert = connection.prepare(&format!(
        "INSERT INTO runs (experimentid, plannerid, {}, solved, correct_solution, status, disturbed)
         VALUES (?{})",
        names.join(", "),
        ", ?".repeat(names.len() + 5)
    ))?;
    // Of several plans at the same time the last counts.
    let mut insert_plan = connection.prepare("INSERT OR REPLACE INTO progress VALUES (?, ?, ?)")?;
    for row in rows {
        let mut values = vec![
            Sql::Integer(experiments[&experiment(row)]),
            Sql::Integer(planners[&config(row)]),
        ];
        values.extend(metrics.iter().map(|metric| {
            let value = metric.of(row).map(|value| value * column(metric).1);
            value.map_or(Sql::Null, Sql::Real)
        }));
        let yes_or_no = |yes: bool| Sql::Integer(yes.into());
        values.push(yes_or_no(row.success));
        values.push(yes_or_no(row.valid));
        values.push(Sql::Integer(statuses[&status(row)]));
        values.push(yes_or_no(!row.contended.is_empty()));
        insert.execute(rusqlite::params_from_iter(values))?;
        let run = connection.last_insert_rowid();
        let judged = row
            .incumbents
            .iter()
            .filter(|plan| plan.valid == Some(true));
        for (plan, soc) in judged.filter_map(|plan| Some((plan, plan.soc_steps?))) {
            insert_plan.execute(params![run, plan.time_ms / 1e3, soc as f64])?;
        }
    }
    Ok(())
}

type Config<'a> = (&'a str, &'a str, &'a str, &'a str, Option<&'a str>);

fn config(row: &Row) -> Config<'_> {
    let digest = row.planner_digest.as_deref();
    (
        &row.planner,
        &row.planner_id,
        &row.planner_version,
        &row.options,
        digest,
    )
}

fn planners<'a>(
    connection: &Connection,
    rows: &[&'a Row],
) -> Result<BTreeMap<Config<'a>, i64>, ExportError> {
    let mut known = BTreeMap::new();
    let mut insert =
        connection.prepare("INSERT INTO plannerConfigs (name, settings) VALUES (?, ?)")?;
    for row in rows {
        if known.contains_key(&config(row)) {
            continue;
        }
        let (name, id, version, options, digest) = config(row);
        let digest = digest.unwrap_or("unknown");
        let settings = format!(
            "plugin = {id};\nversion = {version};\noptions = {options};\ncode = {digest};\n"
        );
        insert.execute(params![name, settings])?;
        known.insert(config(row), connection.last_insert_rowid());
    }
    Ok(known)
}

type Experiment<'a> = (&'a str, u64, u64);

/// Runs that answer the same question.
fn experiment(row: &Row) -> Experiment<'_> {
    (&row.instance_digest, row.seed, row.budget_ms.to_bits())
}

fn experiments<'a>(
    connection: &Connection,
    rows: &[&'a Row],
) -> Result<BTreeMap<Experiment<'a>, i64>, ExportError> {
    let mut order: Vec<Experiment<'_>> = Vec::new();
    let mut runs: BTreeMap<Experiment<'_>, Vec<&Row>> = BTreeMap::new();
    for row in rows {
        let of_experiment = runs.entry(experiment(row)).or_default();
        if of_experiment.is_empty() {
            order.push(experiment(row));
        }
        of_experiment.push(row);
    }
    let mut insert = connection.prepare(
        "INSERT INTO experiments (name, totaltime, timelimit, memorylimit, runcount, version,
             hostname, cpuinfo, date, seed, setup, agents, scenario, instance)
         VALUES (?, ?, ?, 0, ?, ?, ?, NULL, ?, ?, ?, ?, ?, ?)",
    )?;
    let mut known = BTreeMap::new();
    for question in order {
        let rows = &runs[&question];
        let row = rows[0];
        // Mazes of one kind are one problem, of which each is a parameter.
        let (name, instance) = match (&row.maze_algorithm, row.maze_width, row.maze_height) {
            (Some(algorithm), Some(width), Some(height)) => {
                let seed = row
                    .maze_seed
                    .map_or_else(String::new, |seed| format!("seed {seed}"));
                (format!("{algorithm} maze {width}×{height}"), seed)
            }
            _ => (row.map.clone(), row.instance_digest.clone()),
        };
        let total_ms: f64 = rows.iter().map(|row| row.planning_time_ms).sum();
        let mut repeats: BTreeMap<&str, u32> = BTreeMap::new();
        for row in rows {
            *repeats.entry(&row.planner).or_default() += 1;
        }
        let started_ms = rows
            .iter()
            .map(|row| row.started_unix_ms)
            .min()
            .unwrap_or(0);
        let setup = format!(
            "map = {}\nrows = {}\ncolumns = {}\nconnectivity = {}\nscenario = {}\nagents = {}\ninstance = {}\n",
            row.map,
            number_of(row.map_rows),
            number_of(row.map_cols),
            number_of(row.connectivity),
            row.scenario,
            row.agents,
            row.instance_digest
        );
        insert.execute(params![
            name,
            total_ms / 1e3,
            row.budget_ms / 1e3,
            repeats.values().max(),
            concat!("Fleetyard ", env!("CARGO_PKG_VERSION")),
            row.machine,
            date(started_ms),
            row.seed.to_string(),
            setup,
            row.agents.cast_signed(),
            row.scenario,
            instance
        ])?;
        known.insert(question, connection.last_insert_rowid());
    }
    Ok(known)
}

/// A number of a grid; a roadmap has none.
fn number_of(number: Option<u32>) -> String {
    number.map_or_else(|| "none".to_owned(), |number| number.to_string())
}

/// Such as `2026-02-26 12:00:00`, in UTC.
fn date(unix_ms: u64) -> String {
    let text = super::rfc3339(unix_ms);
    text.replace('T', " ").replace('Z', "")
}

/// The end of a run, in words.
fn status(row: &Row) -> String {
    row.failure().unwrap_or_else(|| "solved".into())
}

fn statuses(connection: &Connection, rows: &[&Row]) -> Result<BTreeMap<String, i64>, ExportError> {
    let mut known: BTreeMap<String, i64> = rows.iter().map(|row| (status(row), 0)).collect();
    let mut insert = connection.prepare("INSERT INTO enums VALUES ('status', ?, ?)")?;
    for ((description, number), value) in known.iter_mut().zip(0..) {
        *number = value;
        insert.execute(params![value, description])?;
    }
    Ok(known)
}
