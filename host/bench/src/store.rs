//! The store: the trials of a suite in one SQLite file.
//!
//! The table `trials` has the columns of [`COLUMNS`], `incumbents` the plans that came in
//! time, `meta` what the trials belong to, `machines` and `code` what their digests stand
//! for, `plans` the plans of a suite that keeps them. A trial is one transaction, written when it has ended: whatever kills the process
//! costs the trial in flight and nothing else. A power cut costs the trials of the last
//! second at most, for so often the log is forced to the disk; the file is whole all the same.
//!
//! One process writes a store at a time, and holds a lock on a file beside it; any number
//! may read meanwhile. A new store appears whole under its name or not at all. What is no
//! store of this program is told so from the file's first bytes, and is not touched.

use std::collections::{BTreeMap, BTreeSet};
use std::ffi::OsString;
use std::fmt::Write as _;
use std::fs::{self, File};
use std::io::{self, Read, Seek, Write};
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use fleetyard_core::{Digest, InputError, SQLITE_MAGIC, STORE_MARK, open_regular};
use fleetyard_runtime::CodeFile;
use rusqlite::limits::Limit;
use rusqlite::types::{ToSqlOutput, ValueRef};
use rusqlite::{
    Connection, ErrorCode, OpenFlags, OptionalExtension, ToSql, Transaction, TransactionBehavior,
    ffi,
};
use rustix::fs::FlockOperation;

use crate::kept::{digest_of, unpacked};
use crate::places::Places;
use crate::row::{COLUMNS, Column, ColumnType, Incumbent, Row, Value};

/// Says in the header of the file whose it is: `FlYd`.
const APPLICATION_ID: i32 = i32::from_be_bytes(STORE_MARK);

/// Version of the tables. Columns that are added do not change it.
const VERSION: i32 = 1;

/// The time for which written trials may be in the machine's memory alone.
const SYNC_EVERY: Duration = Duration::from_secs(1);

/// The time to wait for a process that is just ending.
const PATIENCE: Duration = Duration::from_millis(500);

/// Most bytes of plans that a store keeps; trials are kept beyond.
const PLANS_LIMIT: u64 = 16 << 30;

/// File systems on which a lock of the whole file and SQLite's locks of its parts are of one
/// kind, and in each other's way: NFS, SMB and CIFS, 9p. Nothing but the name is locked there.
const ONE_LOCK: [u32; 5] = [0x6969, 0x517b, 0xff53_4d42, 0xfe53_4d42, 0x0102_1997];

/// Conflicts that an error names; all are counted.
const NAMED: usize = 5;

type Result<T> = std::result::Result<T, InputError>;

/// The names of all columns, for a statement.
static NAMES: LazyLock<String> = LazyLock::new(|| {
    let names: Vec<String> = COLUMNS.iter().map(quoted).collect();
    names.join(", ")
});

fn quoted(column: &Column) -> String {
    format!("\"{}\"", column.name)
}

/// Longest value, and longest row, that is read or written, in bytes.
const LONGEST: i32 = 1 << 27;

/// A store of trials.
pub struct Store {
    connection: Connection,
    path: PathBuf,
    /// The expression that is read for each column of [`COLUMNS`].
    select: String,
    synced: Option<Instant>,
    /// Bytes of its plans, once one was written.
    plan_bytes: Option<u64>,
    /// True if this process has begun to write it, with a log beside it.
    has_log: bool,
    /// The right to write it, released after the connection is closed.
    _lock: Option<Lock>,
}

/// The suite that the trials of a store belong to.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Meta {
    /// Name of the suite.
    pub suite: String,
    /// The suite's file as it was.
    pub suite_text: String,
    /// Its values as a JSON object, those of the command line included.
    pub suite_values: String,
    /// Digest of all that the suite asks, its instances included.
    pub suite_digest: String,
    /// Version of the program that wrote the store last.
    pub fleetyard: String,
    /// Time at which the store was made, in milliseconds since 1970.
    pub created_unix_ms: u64,
    /// Trials that the suite asks for, all its parts together; unknown in older stores.
    pub asked: Option<u64>,
    /// The places of the suite's files when the store was written last; unknown in older stores.
    pub places: Places,
}

/// A trial that the suite asks for, as far as a store has to know it.
#[derive(Debug, Clone, Copy)]
pub struct Asked<'a> {
    /// Key of the trial.
    pub key: &'a str,
    /// Its place in the suite's order.
    pub trial: u64,
    /// The planner's label.
    pub planner: &'a str,
    /// The label of the view, of a task.
    pub view: Option<&'a str>,
}

/// The outcome of merging stores.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Merged {
    /// Trials in the new store.
    pub trials: u64,
    /// Trials that several stores had, equal in every column.
    pub repeated: u64,
}

impl Drop for Store {
    fn drop(&mut self) {
        if self.has_log {
            // One file without a log beside it is what can be copied, and read where
            // nobody may write. If somebody is reading just now it stays as it is.
            let _ = self
                .connection
                .pragma_update_and_check(None, "journal_mode", "delete", |_| Ok(()));
        }
    }
}

impl ToSql for Value {
    fn to_sql(&self) -> rusqlite::Result<ToSqlOutput<'_>> {
        Ok(ToSqlOutput::Borrowed(match self {
            Self::Null => ValueRef::Null,
            Self::Text(text) => ValueRef::Text(text.as_bytes()),
            Self::Integer(value) => ValueRef::Integer(*value),
            // SQLite has no NaN: it would read as absent.
            Self::Real(value) => ValueRef::Real(*value),
            Self::Boolean(value) => ValueRef::Integer(i64::from(*value)),
        }))
    }
}

/// The type of a column in SQLite.
fn sql_type(kind: ColumnType) -> &'static str {
    match kind {
        ColumnType::Text => "TEXT",
        ColumnType::Integer | ColumnType::Boolean => "INTEGER",
        ColumnType::Real => "REAL",
    }
}

fn definition(column: &Column) -> String {
    let mut text = format!("{} {}", quoted(column), sql_type(column.kind));
    if !column.optional {
        text += " NOT NULL";
    }
    if column.kind == ColumnType::Boolean {
        let _ = write!(text, " CHECK ({} IN (0, 1))", quoted(column));
    }
    text
}

/// The statements that make the tables of a store.
pub fn schema() -> String {
    let columns: Vec<String> = COLUMNS.iter().map(definition).collect();
    format!(
        "CREATE TABLE trials (\n  \
           id INTEGER PRIMARY KEY,\n  \
           current INTEGER NOT NULL DEFAULT 1 CHECK (current IN (0, 1)),\n  \
           {},\n  \
           UNIQUE (\"key\")\n\
         ) STRICT;\n\
         CREATE TABLE incumbents (\n  \
           trial_id INTEGER NOT NULL REFERENCES trials (id),\n  \
           number INTEGER NOT NULL,\n  \
           time_ms REAL NOT NULL,\n  \
           soc_steps INTEGER,\n  \
           valid INTEGER CHECK (valid IN (0, 1)),\n  \
           PRIMARY KEY (trial_id, number)\n\
         ) STRICT, WITHOUT ROWID;\n\
         CREATE TABLE meta (name TEXT PRIMARY KEY NOT NULL, value TEXT NOT NULL) STRICT;\n\
         CREATE TABLE machines (digest TEXT PRIMARY KEY NOT NULL, description TEXT NOT NULL) STRICT;\n\
         CREATE TABLE code (\n  \
           planner_digest TEXT NOT NULL,\n  \
           path TEXT NOT NULL,\n  \
           sha256 TEXT NOT NULL,\n  \
           PRIMARY KEY (planner_digest, path)\n\
         ) STRICT, WITHOUT ROWID;\n\
         {PLANS};\n",
        columns.join(",\n  ")
    )
}

/// The table of plans, which stores of earlier versions lack. The digest of a plan does not say how
/// large its map is.
const PLANS: &str = "CREATE TABLE IF NOT EXISTS plans (
  plan_digest TEXT NOT NULL,
  map_rows INTEGER NOT NULL,
  map_cols INTEGER NOT NULL,
  file BLOB NOT NULL,
  UNIQUE (plan_digest, map_rows, map_cols)
) STRICT";

const INSERT_PLAN: &str = "INSERT OR IGNORE INTO plans VALUES (?1, ?2, ?3, ?4)";

/// A plan that a store keeps.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptPlan {
    /// Its digest.
    pub digest: String,
    /// Rows of its map; 0 of a plan that is on no grid.
    pub map_rows: u32,
    /// Columns of its map, likewise.
    pub map_cols: u32,
    /// The plan as a file of this project.
    pub file: Vec<u8>,
}

impl Store {
    /// A new store, to be written by this process. There must be nothing of that name.
    pub fn create(path: &Path, meta: &Meta) -> Result<Self> {
        let mut lock = Lock::take(path)?;
        if path.symlink_metadata().is_ok() {
            return Err(InputError::new(shown(path), "there is a file of this name")
                .hint("name another store, or go on with this one by --resume"));
        }
        // Nobody else has this name while the lock is held, so that what a killed process
        // left of it may go.
        let draft = beside(path, ".draft");
        remove(&draft)?;
        let made = Self::write_draft(&draft, meta, path);
        let named = made.and_then(|()| {
            fs::rename(&draft, path)
                .map_err(|error| InputError::new(shown(path), format!("cannot write: {error}")))
        });
        if let Err(error) = named {
            let _ = remove(&draft);
            return Err(error);
        }
        lock.hold(path)?;
        let mut store = Self::connect(path, Some(lock))?;
        store.begin_log()?;
        Ok(store)
    }

    /// Tables and header are in the file itself, not in a log beside it, before it has its name.
    fn write_draft(draft: &Path, meta: &Meta, path: &Path) -> Result<()> {
        let write = || -> rusqlite::Result<()> {
            let mut connection = Connection::open(draft)?;
            connection.pragma_update(None, "application_id", APPLICATION_ID)?;
            connection.pragma_update(None, "user_version", VERSION)?;
            let transaction = connection.transaction()?;
            transaction.execute_batch(&schema())?;
            put_meta(&transaction, meta)?;
            transaction.commit()?;
            connection.close().map_err(|(_, error)| error)
        };
        write().map_err(|error| failed(path, &error))
    }

    /// A store that is there, to be written by this process.
    pub fn open(path: &Path) -> Result<Self> {
        identify(path)?;
        let lock = Lock::take(path)?;
        let mut store = Self::connect(path, Some(lock))?;
        store.check_whole()?;
        store.begin_log()?;
        store.add_columns()?;
        store.run(|connection| connection.execute_batch(PLANS))?;
        Ok(store)
    }

    /// A store that is there, to be read. Others may write it meanwhile.
    pub fn open_read_only(path: &Path) -> Result<Self> {
        identify(path)?;
        Self::connect(path, None)
    }

    fn connect(path: &Path, lock: Option<Lock>) -> Result<Self> {
        let no_mutex = OpenFlags::SQLITE_OPEN_NO_MUTEX;
        let access = match lock {
            Some(_) => OpenFlags::SQLITE_OPEN_READ_WRITE,
            None => OpenFlags::SQLITE_OPEN_READ_ONLY,
        };
        let open = |access: OpenFlags| -> rusqlite::Result<Connection> {
            let connection = Connection::open_with_flags(path, access | no_mutex)?;
            connection.set_limit(Limit::SQLITE_LIMIT_LENGTH, LONGEST)?;
            // Nothing is read before the first statement.
            connection.query_row("SELECT count(*) FROM sqlite_schema", [], |_| Ok(()))?;
            Ok(connection)
        };
        let connection = match open(access) {
            // What its last writer had half done when it was killed goes first.
            Err(error) if is_half_written(&error) => {
                let recovered = open(OpenFlags::SQLITE_OPEN_READ_WRITE);
                recovered.and_then(|_| open(access)).map_err(|_| {
                    let reason = "its last writer was stopped halfway through a change";
                    InputError::new(shown(path), reason)
                        .hint("to take that back, you have to have the right to write to it")
                })
            }
            other => other.map_err(|error| failed(path, &error)),
        }?;
        let mut store = Self {
            connection,
            path: path.to_owned(),
            select: String::new(),
            synced: None,
            plan_bytes: None,
            has_log: false,
            _lock: lock,
        };
        store.select = store.selection()?;
        Ok(store)
    }

    /// The names of the columns that the file has.
    fn columns(&self) -> Result<BTreeSet<String>> {
        self.run(|connection| {
            let mut statement =
                connection.prepare("SELECT name FROM pragma_table_info('trials')")?;
            let names = statement.query_map([], |row| row.get(0))?;
            names.collect()
        })
    }

    /// The expressions that stand for every column in a query: an earlier version did not know
    /// them all.
    fn selection(&self) -> Result<String> {
        let there = self.columns()?;
        let terms: Vec<String> = COLUMNS
            .iter()
            .map(
                |column| match (there.contains(column.name), column.optional) {
                    (true, _) => Ok(quoted(column)),
                    (false, true) => Ok("NULL".to_owned()),
                    (false, false) => {
                        let reason =
                            format!("the table `trials` lacks the column `{}`", column.name);
                        Err(InputError::new(shown(&self.path), reason)
                            .hint("the store was changed by another program, or is damaged"))
                    }
                },
            )
            .collect::<Result<_>>()?;
        Ok(terms.join(", "))
    }

    /// Adds the columns that an earlier version did not know.
    fn add_columns(&self) -> Result<()> {
        let there = self.columns()?;
        let missing = COLUMNS.iter().filter(|column| !there.contains(column.name));
        for column in missing {
            let statement = format!("ALTER TABLE trials ADD COLUMN {}", definition(column));
            self.run(|connection| connection.execute_batch(&statement))?;
        }
        Ok(())
    }

    /// From here on who reads is not in the way of who writes, nor the other way round.
    fn begin_log(&mut self) -> Result<()> {
        self.run(|connection| {
            connection.pragma_update_and_check(None, "journal_mode", "wal", |_| Ok(()))
        })?;
        self.has_log = true;
        Ok(())
    }

    /// Nothing is written to a file that is damaged.
    fn check_whole(&self) -> Result<()> {
        let found: String = self.run(|connection| {
            connection.query_row("PRAGMA quick_check(1)", [], |row| row.get(0))
        })?;
        if found == "ok" {
            return Ok(());
        }
        let first = found.lines().last().unwrap_or_default();
        Err(damaged(&self.path, first))
    }

    fn run<T>(&self, work: impl FnOnce(&Connection) -> rusqlite::Result<T>) -> Result<T> {
        work(&self.connection).map_err(|error| failed(&self.path, &error))
    }

    fn transact<T>(
        &mut self,
        work: impl FnOnce(&Transaction<'_>) -> rusqlite::Result<T>,
    ) -> Result<T> {
        let run = || -> rusqlite::Result<T> {
            let due = self
                .synced
                .is_none_or(|synced| synced.elapsed() >= SYNC_EVERY);
            // A commit forces the log, and with it the commits before, to the disk.
            let level = if due { "FULL" } else { "NORMAL" };
            self.connection.pragma_update(None, "synchronous", level)?;
            let transaction = self
                .connection
                .transaction_with_behavior(TransactionBehavior::Immediate)?;
            let result = work(&transaction)?;
            transaction.commit()?;
            if due {
                self.synced = Some(Instant::now());
            }
            Ok(result)
        };
        run().map_err(|error| failed(&self.path, &error))
    }

    /// Its path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a trial as a whole or not at all. A key that is there already is an error.
    /// The plan of it is kept as long as there is room for plans.
    pub fn insert(&mut self, row: &Row) -> Result<()> {
        let plan = row.plan_digest.as_ref().zip(row.plan.as_ref());
        let mut bytes = 0;
        if let Some((_, plan)) = plan {
            bytes = match self.plan_bytes {
                Some(bytes) => bytes,
                None => self.run(|connection| {
                    let sum = "SELECT coalesce(sum(length(file)), 0) FROM plans";
                    connection.query_row(sum, [], |row| row.get(0).map(i64::cast_unsigned))
                })?,
            }
            .saturating_add(plan.len() as u64);
        }
        let plan = plan.filter(|_| bytes <= PLANS_LIMIT);
        let added = self.transact(|transaction| {
            insert(transaction, row, true)?;
            match plan {
                Some((digest, plan)) => {
                    // A roadmap has no rows.
                    let [rows, cols] = [row.map_rows, row.map_cols].map(Option::unwrap_or_default);
                    transaction.execute(INSERT_PLAN, (digest, rows, cols, plan))
                }
                None => Ok(0),
            }
        })?;
        if added > 0 {
            self.plan_bytes = Some(bytes);
        }
        Ok(())
    }

    /// False for stores of earlier versions, which have no table of plans.
    fn has_plans(&self) -> Result<bool> {
        self.run(|connection| {
            let found =
                "SELECT count(*) FROM sqlite_schema WHERE type = 'table' AND name = 'plans'";
            connection.query_row(found, [], |row| row.get(0))
        })
    }

    /// Hands over the plans that were kept, one after the other in the order of their digests.
    pub fn plans(&self, each: &mut dyn FnMut(KeptPlan) -> Result<()>) -> Result<()> {
        self.packed_plans(|digest, map_rows, map_cols, packed| {
            let file = unpacked(packed)
                .ok_or_else(|| damaged(&self.path, &format!("plan {digest} cannot be unpacked")))?;
            let digest = digest.to_owned();
            each(KeptPlan {
                digest,
                map_rows,
                map_cols,
                file,
            })
        })
    }

    fn packed_plans(
        &self,
        mut each: impl FnMut(&str, u32, u32, &[u8]) -> Result<()>,
    ) -> Result<()> {
        if !self.has_plans()? {
            return Ok(());
        }
        let failed = |error: rusqlite::Error| failed(&self.path, &error);
        let mut statement = self
            .connection
            .prepare("SELECT plan_digest, map_rows, map_cols, file FROM plans ORDER BY 1, 2, 3")
            .map_err(failed)?;
        let mut found = statement.query([]).map_err(failed)?;
        while let Some(row) = found.next().map_err(failed)? {
            let digest: String = row.get(0).map_err(failed)?;
            let [rows, cols] = [row.get(1), row.get(2)];
            let file = row.get_ref(3).map_err(failed)?;
            let file = file
                .as_blob()
                .map_err(|_| damaged(&self.path, &format!("plan {digest} is no file")))?;
            each(&digest, rows.map_err(failed)?, cols.map_err(failed)?, file)?;
        }
        Ok(())
    }

    /// Writes a copy without a log, free pages or a lock: equal content gives equal bytes. There
    /// must be nothing at `path`.
    pub fn copy(&self, path: &Path) -> Result<()> {
        // SQLite takes a text.
        let Some(text) = path.to_str() else {
            let reason = "the name of the file is no UTF-8 text";
            return Err(InputError::new(shown(path), reason));
        };
        self.connection
            .execute("VACUUM INTO ?1", [text])
            .map(drop)
            .map_err(|error| failed(path, &error))
    }

    /// Every trial that the suite asks for, in its order. What is compared of them is the
    /// host's time, also where an earlier version took the planner's word for it.
    pub fn rows(&self) -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        self.each(&mut |row| {
            rows.push(row);
            Ok(())
        })?;
        Ok(rows)
    }

    /// Hands over the same trials one after the other.
    pub fn each(&self, each: &mut dyn FnMut(Row) -> Result<()>) -> Result<()> {
        self.visit(true, None, &mut |mut row| {
            let claimed = row.call_time_ms == Some(row.solve_time_ms);
            if claimed && row.round_trip_ms.is_none() && row.attach != "in-process" {
                row.solve_time_ms = row.planning_time_ms;
            }
            each(row)
        })
    }

    /// The trial of a key, if the suite asks for it and it is there.
    pub fn trial(&self, key: &str) -> Result<Option<Row>> {
        let mut trial = None;
        self.visit(true, Some(key), &mut |row| {
            trial = Some(row);
            Ok(())
        })?;
        Ok(trial)
    }

    /// True if the plan of a trial was kept.
    pub fn has_plan(&self, row: &Row) -> Result<bool> {
        Ok(self.packed_plan(row, "1")?.is_some())
    }

    /// The plan file of a trial, if it was kept. Its plan has the digest that the trial has.
    pub fn plan(&self, row: &Row) -> Result<Option<Vec<u8>>> {
        let Some(rusqlite::types::Value::Blob(packed)) = self.packed_plan(row, "file")? else {
            return Ok(None);
        };
        let digest = row.plan_digest.as_deref().unwrap_or_default();
        let wrong = |what: &str| damaged(&self.path, &format!("plan {digest} {what}"));
        let file = unpacked(&packed).ok_or_else(|| wrong("cannot be unpacked"))?;
        if digest_of(&shown(&self.path), &file)?.to_string() != digest {
            return Err(wrong("is another plan"));
        }
        Ok(Some(file))
    }

    /// A column of the plan of a trial.
    fn packed_plan(&self, row: &Row, column: &str) -> Result<Option<rusqlite::types::Value>> {
        let Some(digest) = row.plan_digest.as_deref() else {
            return Ok(None);
        };
        if !self.has_plans()? {
            return Ok(None);
        }
        let [rows, cols] = [row.map_rows, row.map_cols].map(Option::unwrap_or_default);
        let asked = format!(
            "SELECT {column} FROM plans WHERE plan_digest = ?1 AND map_rows = ?2 AND map_cols = ?3"
        );
        self.run(|connection| {
            let found = connection.query_row(&asked, (digest, rows, cols), |row| row.get(0));
            found.optional()
        })
    }

    /// Every trial that belongs to an earlier state of the suite or of a planner's code.
    pub fn superseded(&self) -> Result<Vec<Row>> {
        let mut rows = Vec::new();
        self.visit(false, None, &mut |row| {
            rows.push(row);
            Ok(())
        })?;
        Ok(rows)
    }

    /// Reads trials one after the other, those that are current or those that are not; that of a key alone,
    /// if one is named.
    fn visit(
        &self,
        current: bool,
        key: Option<&str>,
        each: &mut dyn FnMut(Row) -> Result<()>,
    ) -> Result<()> {
        let failed = |error: rusqlite::Error| failed(&self.path, &error);
        let mut trials = self
            .connection
            .prepare(&format!(
                "SELECT id, {} FROM trials WHERE current = ?1 AND {} ORDER BY \"trial\", \"key\"",
                self.select,
                if key.is_some() {
                    "\"key\" = ?2"
                } else {
                    "?2 IS NULL"
                }
            ))
            .map_err(failed)?;
        let mut incumbents = self
            .connection
            .prepare(
                "SELECT time_ms, soc_steps, valid FROM incumbents WHERE trial_id = ?1 ORDER BY number",
            )
            .map_err(failed)?;
        let mut found = trials.query((current, key)).map_err(failed)?;
        while let Some(row) = found.next().map_err(failed)? {
            let id: i64 = row.get(0).map_err(failed)?;
            let values = COLUMNS
                .iter()
                .enumerate()
                .map(|(index, column)| value(column, row.get_ref(index + 1)));
            let mut trial = Row::from_values(values).map_err(|column| {
                damaged(
                    &self.path,
                    &format!("row {id} has no fitting value in `{column}`"),
                )
            })?;
            let plans = incumbents
                .query_map([id], |row| {
                    Ok(Incumbent {
                        time_ms: row.get(0)?,
                        soc_steps: row.get::<_, Option<i64>>(1)?.map(i64::cast_unsigned),
                        valid: row.get(2)?,
                    })
                })
                .map_err(failed)?;
            trial.incumbents = plans.collect::<rusqlite::Result<_>>().map_err(failed)?;
            each(trial)?;
        }
        Ok(())
    }

    /// The keys of all trials that the suite asks for.
    pub fn keys(&self) -> Result<BTreeSet<String>> {
        self.run(|connection| {
            let mut statement = connection.prepare("SELECT \"key\" FROM trials WHERE current")?;
            let keys = statement.query_map([], |row| row.get(0))?;
            keys.collect()
        })
    }

    /// The planners of all trials that the suite asks for: labels and the digests of their code.
    pub fn planners(&self) -> Result<BTreeMap<String, BTreeSet<String>>> {
        let pairs: Vec<(String, Option<String>)> = self.run(|connection| {
            let mut statement = connection
                .prepare("SELECT DISTINCT planner, planner_digest FROM trials WHERE current")?;
            let pairs = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
            pairs.collect()
        })?;
        let mut planners: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
        for (label, digest) in pairs {
            planners.entry(label).or_default().extend(digest);
        }
        Ok(planners)
    }

    /// The numbers of the trials that the suite asks for and are there, and of those that belong
    /// to an earlier state.
    pub fn counts(&self) -> Result<(u64, u64)> {
        let count = |current: bool| {
            self.run(|connection| {
                connection.query_row(
                    "SELECT count(*) FROM trials WHERE current = ?1",
                    [current],
                    |row| row.get(0),
                )
            })
            .map(i64::cast_unsigned)
        };
        Ok((count(true)?, count(false)?))
    }

    /// The suite that the trials belong to.
    pub fn meta(&self) -> Result<Meta> {
        let values: BTreeMap<String, String> = self.run(|connection| {
            let mut statement = connection.prepare("SELECT name, value FROM meta")?;
            let pairs = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
            pairs.collect()
        })?;
        let value = |name: &str| {
            values
                .get(name)
                .cloned()
                .ok_or_else(|| damaged(&self.path, &format!("the table `meta` lacks `{name}`")))
        };
        Ok(Meta {
            suite: value("suite")?,
            suite_text: value("suite_text")?,
            suite_values: value("suite_values")?,
            suite_digest: value("suite_digest")?,
            fleetyard: value("fleetyard")?,
            created_unix_ms: value("created_unix_ms")?
                .parse()
                .map_err(|_| damaged(&self.path, "`created_unix_ms` of `meta` is no number"))?,
            asked: value("asked").ok().and_then(|text| text.parse().ok()),
            places: (value("places").ok())
                .and_then(|text| serde_json::from_str(&text).ok())
                .unwrap_or_default(),
        })
    }

    /// Makes the store that of `meta`, which asks for just these trials: what it has beside
    /// them is kept apart, and the others get the places and labels that they now have.
    pub fn adopt<'a>(
        &mut self,
        meta: &Meta,
        asked: impl IntoIterator<Item = Asked<'a>>,
    ) -> Result<()> {
        self.transact(|transaction| {
            transaction.execute_batch(
                "CREATE TEMP TABLE asked (key TEXT PRIMARY KEY, trial INTEGER, planner TEXT, view TEXT)",
            )?;
            let mut statement =
                transaction.prepare("INSERT OR IGNORE INTO temp.asked VALUES (?1, ?2, ?3, ?4)")?;
            for Asked {
                key,
                trial,
                planner,
                view,
            } in asked
            {
                statement.execute((key, trial.cast_signed(), planner, view))?;
            }
            drop(statement);
            transaction.execute_batch(
                "UPDATE trials SET current = 0
                 WHERE current AND \"key\" NOT IN (SELECT key FROM temp.asked);
                 UPDATE trials SET current = 1, \"trial\" = asked.trial, \"planner\" = asked.planner, \
                 \"view\" = asked.view
                 FROM temp.asked AS asked WHERE asked.key = trials.\"key\"
                 AND (NOT current OR trials.\"trial\" <> asked.trial
                      OR trials.\"planner\" <> asked.planner OR trials.\"view\" IS NOT asked.view);
                 DROP TABLE temp.asked",
            )?;
            put_meta(transaction, meta)
        })
    }

    /// Keeps the description of a machine, a JSON object.
    pub fn add_machine(&mut self, digest: Digest, description: &str) -> Result<()> {
        self.transact(|transaction| {
            let digest = digest.to_string();
            transaction
                .execute(
                    "INSERT OR IGNORE INTO machines VALUES (?1, ?2)",
                    (digest, description),
                )
                .map(drop)
        })
    }

    /// The descriptions of all machines, by digest.
    pub fn machines(&self) -> Result<BTreeMap<String, String>> {
        self.run(|connection| {
            let mut statement = connection.prepare("SELECT digest, description FROM machines")?;
            let pairs = statement.query_map([], |row| Ok((row.get(0)?, row.get(1)?)))?;
            pairs.collect()
        })
    }

    /// Keeps which files a planner's digest stands for.
    pub fn add_code(&mut self, planner: Digest, code: &[CodeFile]) -> Result<()> {
        self.transact(|transaction| {
            let planner = planner.to_string();
            let mut statement =
                transaction.prepare("INSERT OR IGNORE INTO code VALUES (?1, ?2, ?3)")?;
            for file in code {
                let path = file.path.to_string_lossy();
                statement.execute((&planner, &path, &file.sha256))?;
            }
            Ok(())
        })
    }

    /// The files that are the code of planners, by digest.
    pub fn code(&self) -> Result<BTreeMap<String, Vec<CodeFile>>> {
        let files: Vec<(String, CodeFile)> = self.run(|connection| {
            let mut statement = connection
                .prepare("SELECT planner_digest, path, sha256 FROM code ORDER BY 1, 2")?;
            let files = statement.query_map([], |row| {
                let path: String = row.get(1)?;
                let file = CodeFile {
                    path: path.into(),
                    sha256: row.get(2)?,
                };
                Ok((row.get(0)?, file))
            })?;
            files.collect()
        })?;
        let mut code: BTreeMap<String, Vec<CodeFile>> = BTreeMap::new();
        for (planner, file) in files {
            code.entry(planner).or_default().push(file);
        }
        Ok(code)
    }

    /// Writes the trials of several stores of one suite into a new one.
    ///
    /// Trials that several stores have must be equal: two results for one key are an error,
    /// for nobody could say which one counts. Then nothing is written.
    pub fn merge(path: &Path, parts: &[PathBuf]) -> Result<Merged> {
        let Some((first, others)) = parts.split_first() else {
            return Err(InputError::new(shown(path), "there is nothing to merge"));
        };
        // One after the other: a process may open fewer files than a cluster has shards.
        let meta = Self::open_read_only(first)?.meta()?;
        for part in others {
            let other = Self::open_read_only(part)?.meta()?;
            if other.suite_digest != meta.suite_digest {
                let reason = format!(
                    "belongs to another state of the suite than {}: `{}` with digest {}, and `{}` \
                     with {}",
                    first.display(),
                    other.suite,
                    other.suite_digest,
                    meta.suite,
                    meta.suite_digest
                );
                return Err(InputError::new(shown(part), reason)
                    .hint("`fleetyard bench SUITE --resume` on each brings them to one state"));
            }
        }
        let lock = Lock::take(path)?;
        if path.symlink_metadata().is_ok() {
            return Err(InputError::new(shown(path), "there is a file of this name")
                .hint("merge into a new store"));
        }
        let draft = beside(path, ".draft");
        remove(&draft)?;
        let merged = Self::write_draft(&draft, &meta, path)
            .and_then(|()| Self::connect(&draft, None))
            .map(drop)
            .and_then(|()| Self::fill(&draft, path, parts))
            .and_then(|merged| {
                fs::rename(&draft, path)
                    .map(|()| merged)
                    .map_err(|error| InputError::new(shown(path), format!("cannot write: {error}")))
            });
        if merged.is_err() {
            let _ = remove(&draft);
        }
        drop(lock);
        merged
    }

    /// Writes the trials of all parts into the draft, in one transaction.
    fn fill(draft: &Path, path: &Path, parts: &[PathBuf]) -> Result<Merged> {
        let failed = |error: rusqlite::Error| failed(path, &error);
        let mut connection = Connection::open(draft).map_err(failed)?;
        let transaction = connection.transaction().map_err(failed)?;
        let mut merged = Merged::default();
        let mut conflicts = 0;
        let mut named = String::new();
        for part in parts {
            let store = Self::open_read_only(part)?;
            for (digest, description) in store.machines()? {
                transaction
                    .execute(
                        "INSERT OR IGNORE INTO machines VALUES (?1, ?2)",
                        (digest, description),
                    )
                    .map_err(failed)?;
            }
            for (planner, files) in store.code()? {
                for file in files {
                    let path = file.path.to_string_lossy();
                    transaction
                        .execute(
                            "INSERT OR IGNORE INTO code VALUES (?1, ?2, ?3)",
                            (&planner, &path, &file.sha256),
                        )
                        .map_err(failed)?;
                }
            }
            store.packed_plans(|digest, rows, cols, file| {
                transaction
                    .execute(INSERT_PLAN, (digest, rows, cols, file))
                    .map(drop)
                    .map_err(failed)
            })?;
            for current in [true, false] {
                store.visit(current, None, &mut |row| {
                    let there = same_key(&transaction, &row.key).map_err(failed)?;
                    match there {
                        None => {
                            insert(&transaction, &row, current).map_err(failed)?;
                            merged.trials += u64::from(current);
                        }
                        Some(values) if values == row.values() => merged.repeated += 1,
                        Some(_) => {
                            conflicts += 1;
                            if conflicts <= NAMED {
                                let _ = write!(
                                    named,
                                    "\n  {} on {}, {}, {} agents, seed {}, repeat {} (key {})",
                                    row.planner,
                                    row.map,
                                    row.scenario,
                                    row.agents,
                                    row.seed,
                                    row.repeat,
                                    row.key
                                );
                            }
                        }
                    }
                    Ok(())
                })?;
            }
        }
        if conflicts > 0 {
            let more = if conflicts > NAMED { "\n  …" } else { "" };
            let reason =
                format!("{conflicts} trials have two results each, which differ:{named}{more}");
            return Err(InputError::new(shown(path), reason)
                .hint("merge shards of one run, each trial of which was made once"));
        }
        transaction.commit().map_err(failed)?;
        connection.close().map_err(|(_, error)| failed(error))?;
        Ok(merged)
    }
}

fn put_meta(transaction: &Transaction<'_>, meta: &Meta) -> rusqlite::Result<()> {
    let created = meta.created_unix_ms.to_string();
    let asked = meta.asked.map_or(String::new(), |asked| asked.to_string());
    // Names that are no text are not kept.
    let places = serde_json::to_string(&meta.places).unwrap_or_default();
    let pairs = [
        ("suite", &meta.suite),
        ("suite_text", &meta.suite_text),
        ("suite_values", &meta.suite_values),
        ("suite_digest", &meta.suite_digest),
        ("fleetyard", &meta.fleetyard),
        ("created_unix_ms", &created),
        ("asked", &asked),
        ("places", &places),
    ];
    for (name, value) in pairs {
        transaction.execute("INSERT OR REPLACE INTO meta VALUES (?1, ?2)", (name, value))?;
    }
    Ok(())
}

fn insert(transaction: &Transaction<'_>, row: &Row, current: bool) -> rusqlite::Result<()> {
    static STATEMENT: LazyLock<String> = LazyLock::new(|| {
        let values = ", ?".repeat(COLUMNS.len());
        format!(
            "INSERT INTO trials (current, {}) VALUES (?{values})",
            *NAMES
        )
    });
    let values = std::iter::once(Value::Boolean(current)).chain(row.values());
    let id = transaction
        .prepare(&STATEMENT)?
        .insert(rusqlite::params_from_iter(values))?;
    let mut statement =
        transaction.prepare("INSERT INTO incumbents VALUES (?1, ?2, ?3, ?4, ?5)")?;
    for (number, plan) in row.incumbents.iter().enumerate() {
        let soc = plan.soc_steps.map(u64::cast_signed);
        statement.execute((id, number as i64, plan.time_ms, soc, plan.valid))?;
    }
    Ok(())
}

/// The values of the trial with a key.
fn same_key(transaction: &Transaction<'_>, key: &str) -> rusqlite::Result<Option<Vec<Value>>> {
    let statement = format!("SELECT {} FROM trials WHERE \"key\" = ?1", *NAMES);
    let mut statement = transaction.prepare(&statement)?;
    let mut rows = statement.query([key])?;
    let Some(row) = rows.next()? else {
        return Ok(None);
    };
    let values = COLUMNS.iter().enumerate();
    let values = values.map(|(index, column)| value(column, row.get_ref(index)));
    Ok(Some(values.collect()))
}

/// A value as its column means it; what cannot be one is absent.
fn value(column: &Column, found: rusqlite::Result<ValueRef<'_>>) -> Value {
    match (found, column.kind) {
        (Ok(ValueRef::Integer(value)), ColumnType::Boolean) => Value::Boolean(value != 0),
        (Ok(ValueRef::Integer(value)), ColumnType::Real) => Value::Real(value as f64),
        (Ok(ValueRef::Integer(value)), _) => Value::Integer(value),
        (Ok(ValueRef::Real(value)), _) => Value::Real(value),
        (Ok(ValueRef::Text(text)), _) => match std::str::from_utf8(text) {
            Ok(text) => Value::Text(text.to_owned()),
            Err(_) => Value::Null,
        },
        (Ok(ValueRef::Null | ValueRef::Blob(_)) | Err(_), _) => Value::Null,
    }
}

fn shown(path: &Path) -> String {
    path.display().to_string()
}

/// A file beside another one, by the end of its name.
fn beside(path: &Path, end: &str) -> PathBuf {
    let mut name = path.file_name().map_or_else(OsString::new, OsString::from);
    name.push(end);
    path.with_file_name(name)
}

fn remove(path: &Path) -> Result<()> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(InputError::new(
            shown(path),
            format!("cannot remove: {error}"),
        )),
        _ => Ok(()),
    }
}

/// True if the file's header says that it is a store that this program knows.
fn identify(path: &Path) -> Result<()> {
    if matches!(fs::metadata(path), Err(error) if error.kind() == io::ErrorKind::NotFound) {
        return Err(InputError::new(shown(path), "there is no such store")
            .hint("`fleetyard bench SUITE.toml` makes one"));
    }
    let file = open_regular(path)?;
    let mut header = Vec::with_capacity(100);
    file.take(100)
        .read_to_end(&mut header)
        .map_err(|error| InputError::new(shown(path), format!("cannot read: {error}")))?;
    if header.len() < 100 || !header.starts_with(SQLITE_MAGIC) {
        let reason = match header.len() {
            0 => "the file is empty, and no store",
            _ if header.starts_with(SQLITE_MAGIC) => "the file ends within its header",
            _ => "the file is no SQLite database",
        };
        return Err(InputError::new(shown(path), reason)
            .hint("a store is a file that `fleetyard bench` has made"));
    }
    let field = |at: usize| i32::from_be_bytes([0, 1, 2, 3].map(|byte| header[at + byte]));
    if field(68) != APPLICATION_ID {
        return Err(
            InputError::new(shown(path), "the database belongs to another program")
                .hint("a store is a file that `fleetyard bench` has made"),
        );
    }
    let version = field(60);
    if version != VERSION {
        let reason = format!("a store of version {version}, and this program knows {VERSION}");
        return Err(InputError::new(shown(path), reason)
            .hint("use the version of fleetyard that wrote it, or a newer one"));
    }
    Ok(())
}

fn damaged(path: &Path, what: &str) -> InputError {
    let what = fleetyard_core::shown(what);
    InputError::new(shown(path), format!("the store is damaged: {what}")).hint(
        "nothing was changed; restore a copy, or recover what is left with `sqlite3 FILE .recover`",
    )
}

/// The log or the journal of a writer that was killed has to be worked off, which a reader may not.
fn is_half_written(error: &rusqlite::Error) -> bool {
    let code = error.sqlite_error().map(|error| error.extended_code);
    matches!(
        code,
        Some(ffi::SQLITE_READONLY_ROLLBACK | ffi::SQLITE_READONLY_RECOVERY)
    )
}

/// An error of SQLite in the user's terms.
fn failed(path: &Path, error: &rusqlite::Error) -> InputError {
    let text = |reason: &str| InputError::new(shown(path), reason);
    let Some(code) = error.sqlite_error_code() else {
        return damaged(path, &error.to_string());
    };
    match code {
        ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase | ErrorCode::ConstraintViolation => {
            damaged(path, &error.to_string())
        }
        ErrorCode::DiskFull => full(path),
        ErrorCode::SystemIoFailure if no_space(path) => full(path),
        ErrorCode::DatabaseBusy | ErrorCode::DatabaseLocked => {
            text("another program holds the store").hint("close it and try again")
        }
        ErrorCode::ReadOnly | ErrorCode::PermissionDenied => {
            text("the store cannot be written").hint("check who may write the file and its folder")
        }
        ErrorCode::CannotOpen => text("the store cannot be opened")
            .hint("does its folder exist, and may you write to it?"),
        _ => text(&format!("the store fails: {error}")),
    }
}

fn full(path: &Path) -> InputError {
    InputError::new(shown(path), "cannot write: no space is left on the disk")
        .hint("what was stored before is kept; free some space, then go on with --resume")
}

/// True if the file system has no room for another page.
fn no_space(path: &Path) -> bool {
    let folder = path.parent().filter(|folder| *folder != Path::new(""));
    rustix::fs::statvfs(folder.unwrap_or(Path::new(".")))
        .is_ok_and(|found| found.f_bavail * found.f_frsize < 1 << 16)
}

/// The right to write a store: a lock on a file beside it, with the number of the process.
/// The file is there while somebody holds it, and after a process that was killed. It is beside
/// the store itself, whichever link it was named by.
struct Lock {
    file: File,
    path: PathBuf,
    /// The store itself, locked too: it may have other names.
    store: Option<File>,
}

impl Lock {
    fn take(named: &Path) -> Result<Self> {
        let store = &real(named);
        let path = beside(store, ".lock");
        let failed = |error: &dyn std::fmt::Display| {
            InputError::new(shown(&path), format!("cannot be locked: {error}"))
                .hint("does its folder exist, and may you write to it?")
        };
        let started = Instant::now();
        loop {
            let file = File::options()
                .create(true)
                .truncate(false)
                .read(true)
                .write(true)
                .open(&path);
            let mut file = match file {
                Err(error) if error.kind() == io::ErrorKind::StorageFull => {
                    return Err(full(&path));
                }
                other => other.map_err(|error| failed(&error))?,
            };
            match rustix::fs::flock(&file, FlockOperation::NonBlockingLockExclusive) {
                Ok(()) => {}
                Err(rustix::io::Errno::INTR) => continue,
                // A process that was killed holds it until the kernel is done with it.
                Err(rustix::io::Errno::WOULDBLOCK) if started.elapsed() < PATIENCE => {
                    std::thread::sleep(Duration::from_millis(10));
                    continue;
                }
                Err(rustix::io::Errno::WOULDBLOCK) => {
                    let mut holder = String::new();
                    let _ = file.take(32).read_to_string(&mut holder);
                    let who = match holder.trim().parse::<u32>() {
                        Ok(process) => format!("process {process}"),
                        Err(_) => "another process".to_owned(),
                    };
                    return Err(taken(named, &who));
                }
                Err(error) => return Err(failed(&error)),
            }
            // The one before may have removed the file between our opening and locking it.
            let mine = file.metadata().map_err(|error| failed(&error))?.ino();
            if fs::metadata(&path).is_ok_and(|now| now.ino() == mine) {
                // Without the number an error names nobody; the lock holds all the same.
                let _ = file
                    .set_len(0)
                    .and_then(|()| file.rewind())
                    .and_then(|()| writeln!(file, "{}", std::process::id()));
                // Dropped, it is released.
                let mut lock = Self {
                    file,
                    path,
                    store: None,
                };
                lock.hold(named)?;
                return Ok(lock);
            }
        }
    }
}

/// The path at which a store is, or will be, links resolved.
fn real(path: &Path) -> PathBuf {
    fs::canonicalize(path).unwrap_or_else(|_| {
        let folder = path.parent().filter(|folder| *folder != Path::new(""));
        let folder = fs::canonicalize(folder.unwrap_or(Path::new(".")));
        match (folder, path.file_name()) {
            (Ok(folder), Some(name)) => folder.join(name),
            _ => path.to_owned(),
        }
    })
}

fn taken(store: &Path, who: &str) -> InputError {
    InputError::new(shown(store), format!("{who} is writing this store"))
        .hint("wait until it has ended, or name another store with --store")
}

impl Lock {
    /// Locks the store itself if it is there, so that another name of the file is no way round.
    fn hold(&mut self, named: &Path) -> Result<()> {
        if !fs::metadata(named).is_ok_and(|meta| meta.is_file()) {
            return Ok(());
        }
        let file = open_regular(named)?;
        if rustix::fs::fstatfs(&file).is_ok_and(|found| ONE_LOCK.contains(&(found.f_type as u32))) {
            return Ok(());
        }
        let started = Instant::now();
        loop {
            match rustix::fs::flock(&file, FlockOperation::NonBlockingLockExclusive) {
                Ok(()) => {
                    self.store = Some(file);
                    return Ok(());
                }
                Err(rustix::io::Errno::INTR) => {}
                Err(rustix::io::Errno::WOULDBLOCK) if started.elapsed() < PATIENCE => {
                    std::thread::sleep(Duration::from_millis(10));
                }
                Err(rustix::io::Errno::WOULDBLOCK) => {
                    return Err(taken(named, "another process, by another name,"));
                }
                Err(error) => {
                    let reason = format!("cannot be locked: {error}");
                    return Err(InputError::new(shown(named), reason)
                        .hint("copy the store to a disk of this machine"));
                }
            }
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
        // Closing is not enough when a process that is just being started has a copy of the
        // descriptor for a moment.
        let _ = rustix::fs::flock(&self.file, FlockOperation::Unlock);
    }
}

/// A store that may be closed from another thread, when the process is told to end.
#[derive(Clone)]
pub struct SharedStore(Arc<Mutex<Option<Store>>>);

impl SharedStore {
    /// Of a store that is open for writing.
    pub fn new(store: Store) -> Self {
        Self(Arc::new(Mutex::new(Some(store))))
    }

    fn lock(&self) -> MutexGuard<'_, Option<Store>> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Works with the store; an error once it was closed.
    pub fn with<T>(&self, work: impl FnOnce(&mut Store) -> Result<T>) -> Result<T> {
        match self.lock().as_mut() {
            Some(store) => work(store),
            None => Err(InputError::new("store", "the store was closed")),
        }
    }

    /// Takes the store away from everybody else, and waits for a trial that is just being
    /// written. Nobody gets at it as long as `last` runs.
    pub fn close(&self, last: impl FnOnce(Option<Store>)) {
        let mut store = self.lock();
        last(store.take());
    }
}
