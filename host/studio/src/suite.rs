//! The trials of a suite: a store of `fleetyard bench` that the studio was started with.
//!
//! A store may come from anywhere. Nothing that it says names a file to read, but for its suite, which has to
//! be there word for word ([`Questions`]); its texts are clipped, and lists have ends.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use fleetyard_bench::report::{Loaded, Report};
use fleetyard_bench::suite::Question;
use fleetyard_bench::{Questions, Robots, Row, Store, Value as Cell};
use fleetyard_check::PathRule;
use fleetyard_core::{InputError, SQLITE_MAGIC, shown};
use fleetyard_sim::SimConfig;
use fleetyard_sim::motion::PRESETS;
use fleetyard_sim::noise::Delay;
use fleetyard_views::Representation;
use serde::Deserialize;
use serde_json::{Value, json};

use crate::answer::{Refused, Result};
use crate::document::{Document, Views};
use crate::files;

/// Most trials that are listed.
const MOST_TRIALS: usize = 1 << 20;
/// Most names of planners, maps or outcomes; trials beyond have the last one.
const MOST_NAMES: usize = 4096;
/// Most trials of a page.
const MOST_AT_ONCE: usize = 200;
/// Most characters of a text that is told.
const MOST_CHARACTERS: usize = 2000;
/// Most files of a folder among which a store is looked for.
const MOST_FILES: usize = 10_000;

/// True if a file begins as a store does.
pub(crate) fn is_store(begin: &[u8]) -> bool {
    begin.starts_with(SQLITE_MAGIC)
}

/// The only store in a folder.
pub(crate) fn store_in(
    folder: &Path,
    is_store: &dyn Fn(&Path) -> bool,
) -> std::result::Result<PathBuf, InputError> {
    let source = folder.display().to_string();
    let cannot = |error| {
        InputError::new(
            source.as_str(),
            format!("the folder cannot be read: {error}"),
        )
    };
    let mut stores = Vec::new();
    for entry in fs::read_dir(folder).map_err(cannot)?.take(MOST_FILES) {
        let path = entry.map_err(cannot)?.path();
        if is_store(&path) {
            stores.push(path);
        }
    }
    stores.sort();
    match &stores[..] {
        [store] => Ok(store.clone()),
        [] => Err(InputError::new(source, "there is no store in this folder")
            .hint("name a file that `fleetyard bench` has made")),
        [first, ..] => {
            let reason = format!("there are {} stores in this folder", stores.len());
            let hint = format!("name one of them, such as {}", first.display());
            Err(InputError::new(source, reason).hint(hint))
        }
    }
}

/// A suite's store with what is known of it.
pub(crate) struct Suite {
    path: PathBuf,
    store: Mutex<Store>,
    index: Mutex<Arc<Index>>,
    /// The suite itself, once a trial was opened.
    questions: Mutex<Option<Arc<Questions>>>,
}

/// The trials in their order, with what they are looked for by.
#[derive(Debug, Default)]
struct Index {
    counts: (u64, u64),
    trials: Vec<Entry>,
    names: [Names; 3],
}

#[derive(Debug)]
struct Entry {
    trial: u64,
    key: String,
    /// Numbers of its planner, its map and its outcome.
    codes: [u16; 3],
}

/// The names that trials are looked for by, in the order of [`Entry::codes`].
const NAMED: [&str; 3] = ["planners", "maps", "outcomes"];

#[derive(Debug, Default)]
struct Names {
    code: BTreeMap<String, u16>,
    all: Vec<String>,
}

impl Names {
    fn code(&mut self, name: &str) -> u16 {
        let name = clipped(name);
        if let Some(code) = self.code.get(&name) {
            return *code;
        }
        if self.all.len() == MOST_NAMES {
            return MOST_NAMES as u16 - 1;
        }
        let code = self.all.len() as u16;
        self.all.push(name.clone());
        self.code.insert(name, code);
        code
    }
}

/// A part of the list of trials.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Part {
    planner: Option<String>,
    map: Option<String>,
    outcome: Option<String>,
    #[serde(default)]
    from: usize,
    #[serde(default = "usual_count")]
    count: usize,
}

fn usual_count() -> usize {
    50
}

/// A trial as the studio opens it.
pub(crate) struct Reopened {
    pub(crate) name: String,
    pub(crate) trial: u64,
    pub(crate) document: Document,
    pub(crate) view: Representation,
    /// Parameters of the view by their names; none of a map's own cells.
    pub(crate) views: Option<Value>,
    /// Arguments of the execution.
    pub(crate) terms: Vec<String>,
    pub(crate) plan: Option<Vec<u8>>,
    pub(crate) notes: Vec<String>,
}

impl Suite {
    /// Opens a store.
    pub(crate) fn open(path: &Path) -> std::result::Result<Self, InputError> {
        let store = Store::open_read_only(path)?;
        store.meta()?;
        let index = Index::of(&store)?;
        Ok(Self {
            path: path.to_owned(),
            store: Mutex::new(store),
            index: Mutex::new(Arc::new(index)),
            questions: Mutex::default(),
        })
    }

    fn store(&self) -> MutexGuard<'_, Store> {
        // It is only read.
        self.store.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The trials that there are now.
    fn index(&self) -> Result<Arc<Index>> {
        let store = self.store();
        let mut index = self.index.lock().unwrap_or_else(PoisonError::into_inner);
        if store.counts()? != index.counts {
            *index = Arc::new(Index::of(&store)?);
        }
        Ok(Arc::clone(&index))
    }

    /// The suite, and what its trials can be looked for by.
    pub(crate) fn tell(&self) -> Result<Value> {
        let index = self.index()?;
        let meta = self.store().meta()?;
        let mut told = json!({
            "name": clipped(&meta.suite),
            "store": self.path.display().to_string(),
            "trials": index.trials.len(),
            "asked": meta.asked,
            "complete": index.trials.len() as u64 == index.counts.0,
        });
        for (name, names) in NAMED.iter().zip(&index.names) {
            told[name] = json!(names.all);
        }
        Ok(told)
    }

    /// A part of the trials that there are, in their order.
    pub(crate) fn list(&self, part: &Part) -> Result<Value> {
        let index = self.index()?;
        let asked = [&part.planner, &part.map, &part.outcome];
        let mut wanted = [None; 3];
        for ((wanted, asked), names) in wanted.iter_mut().zip(asked).zip(&index.names) {
            if let Some(name) = asked.as_deref().filter(|name| !name.is_empty()) {
                let Some(code) = names.code.get(name) else {
                    return Ok(json!({"total": 0, "from": part.from, "trials": []}));
                };
                *wanted = Some(*code);
            }
        }
        let fits = |entry: &&Entry| {
            let mut pairs = entry.codes.iter().zip(wanted);
            pairs.all(|(code, wanted)| wanted.is_none_or(|wanted| wanted == *code))
        };
        let found: Vec<&Entry> = index.trials.iter().filter(fits).collect();
        let count = part.count.min(MOST_AT_ONCE);
        let store = self.store();
        let shown = found.iter().skip(part.from).take(count);
        let rows = shown.map(|entry| Ok(store.trial(&entry.key)?));
        let rows: Vec<Option<Row>> = rows.collect::<Result<_>>()?;
        let trials: Vec<Value> = rows.iter().flatten().map(listed).collect();
        Ok(json!({"total": found.len(), "from": part.from, "trials": trials}))
    }

    /// The row of a trial, by its number or its key.
    fn row(&self, trial: &str) -> Result<Row> {
        let index = self.index()?;
        let number = trial.parse::<u64>().ok();
        let found = match number {
            Some(number) => {
                let at = index.trials.partition_point(|entry| entry.trial < number);
                let entry = index.trials.get(at);
                entry.filter(|entry| entry.trial == number)
            }
            None => index.trials.iter().find(|entry| entry.key == trial),
        };
        let row = found.map(|entry| self.store().trial(&entry.key));
        row.transpose()?.flatten().ok_or_else(|| {
            let last = index.trials.last().map_or(0, |entry| entry.trial);
            Refused::unknown("trial").hint(format!("trials have numbers up to {last}"))
        })
    }

    /// All that the store has of a trial.
    pub(crate) fn trial(&self, trial: &str) -> Result<Value> {
        let row = self.row(trial)?;
        let kept = self.store().has_plan(&row)?;
        let columns = fleetyard_bench::COLUMNS.iter().zip(row.values());
        let columns = columns.map(|(column, value)| (column.name.to_owned(), told(value)));
        let mut told = listed(&row);
        told["columns"] = Value::Object(columns.collect());
        told["has_plan"] = kept.into();
        told["why_not"] = json!(why_no_plan(&row, kept));
        told["again"] = again(&row);
        Ok(told)
    }

    /// The page of the suite's report.
    pub(crate) fn report(&self) -> Result<String> {
        let mut loaded = Loaded::load(std::slice::from_ref(&self.path), None)?;
        loaded.subject.in_studio = true;
        Ok(Report::new(loaded.subject, &loaded.rows).html())
    }

    fn questions(&self) -> Result<Arc<Questions>> {
        let mut known = self
            .questions
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        if let Some(questions) = &*known {
            return Ok(Arc::clone(questions));
        }
        let meta = self.store().meta()?;
        let questions = Arc::new(Questions::of(&meta, &self.path)?);
        *known = Some(Arc::clone(&questions));
        Ok(questions)
    }

    /// Makes a trial's question again, with the plan that was kept.
    pub(crate) fn open_trial(&self, trial: &str) -> Result<Reopened> {
        let row = self.row(trial)?;
        let questions = self.questions()?;
        let plan = self.store().plan(&row)?;
        let kept = plan.is_some();
        let config = questions.config();
        let mut terms = conduct(config);
        let mut notes = Vec::new();
        let question = if is_fleet(&row) {
            None
        } else {
            Some(questions.question(&row)?)
        };
        let (document, view, views) = match question {
            None => {
                let map = questions.map(&row)?;
                let document = files::of_map(&map, config.cell_size_m, &mut notes)?;
                (document, Representation::Grid, None)
            }
            Some((Question::Grid(instance), _)) => {
                on_map(config, questions.robots(), &mut terms, &mut notes);
                if questions.protocol().path_rule != PathRule::Steps {
                    pair(&mut terms, "--path-rule", &questions.protocol().path_rule);
                }
                let document = files::of_instance(&instance, config.cell_size_m, &mut notes)?;
                (document, Representation::Grid, None)
            }
            Some((Question::View(asked), mut parameters)) => {
                let view = asked.view.representation();
                let views = json!({view.name(): parameters});
                for name in ["representation", "step", "pace"] {
                    parameters.remove(name);
                }
                let own = if view == Representation::Continuous {
                    json!({})
                } else {
                    json!({view.name(): parameters})
                };
                let own = Views::deserialize(own).map_err(|error| {
                    Refused::value(format!("the view cannot be shown: {error}"))
                })?;
                let document = files::of_problem(&asked.problem, own)?;
                (document, view, Some(views))
            }
        };
        notes.extend(why_no_plan(&row, kept).map(str::to_owned));
        Ok(Reopened {
            name: format!("trial {}, {}", row.trial, clipped(&row.entrant())),
            trial: row.trial,
            document,
            view,
            views,
            terms,
            plan,
            notes,
        })
    }
}

impl Index {
    fn of(store: &Store) -> std::result::Result<Self, InputError> {
        let mut index = Self {
            counts: store.counts()?,
            ..Self::default()
        };
        store.each(&mut |row| {
            if index.trials.len() < MOST_TRIALS {
                let outcome = outcome(&row);
                let named = [&*row.entrant(), row.map.as_str(), outcome.as_str()];
                let mut codes = [0; 3];
                for ((code, names), name) in codes.iter_mut().zip(&mut index.names).zip(named) {
                    *code = names.code(name);
                }
                index.trials.push(Entry {
                    trial: row.trial,
                    key: row.key,
                    codes,
                });
            }
            Ok(())
        })?;
        Ok(index)
    }
}

fn outcome(row: &Row) -> String {
    row.failure().unwrap_or_else(|| "success".to_owned())
}

/// A text of a store, not longer than anybody reads.
fn clipped(text: &str) -> String {
    match text.char_indices().nth(MOST_CHARACTERS) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// A trial as lists show it.
fn listed(row: &Row) -> Value {
    json!({
        "trial": row.trial,
        "key": clipped(&row.key),
        "planner": clipped(&row.entrant()),
        "map": clipped(&row.map),
        "scenario": clipped(&row.scenario),
        "agents": row.agents,
        "seed": row.seed,
        "repeat": row.repeat,
        "outcome": clipped(&outcome(row)),
        "solve_time_ms": row.solve_time_ms,
        "plan_digest": row.plan_digest.as_deref().map(clipped),
    })
}

fn told(value: Cell) -> Value {
    match value {
        Cell::Null => Value::Null,
        Cell::Text(text) => clipped(&text).into(),
        Cell::Integer(value) => value.cast_unsigned().into(),
        Cell::Real(value) => value.into(),
        Cell::Boolean(value) => value.into(),
    }
}

/// The reason why a trial has no plan to watch.
fn why_no_plan(row: &Row, kept: bool) -> Option<&'static str> {
    match (&row.plan_digest, kept) {
        (_, true) => None,
        _ if is_fleet(row) => Some(
            "fleets have no plan to keep: this one can drive again, with the usual settings of fleets where the \
             column `fleet` has others",
        ),
        (None, false) => Some("the trial ended without a plan"),
        (Some(_), false) => {
            Some("its plan was not kept: a suite with `keep_plans = true` in [protocol] keeps them")
        }
    }
}

/// True of a trial of a fleet.
fn is_fleet(row: &Row) -> bool {
    row.fleet.as_deref().is_some_and(|fleet| !fleet.is_empty())
}

/// The job that plans again as the trial did, or that drives again as its fleet did.
fn again(row: &Row) -> Value {
    let options: Value = serde_json::from_str(&row.options).unwrap_or_else(|_| json!({}));
    if is_fleet(row) {
        let said: Value =
            serde_json::from_str(row.fleet.as_deref().unwrap_or_default()).unwrap_or_default();
        let model = said["robots"].as_str();
        let delay = Delay::deserialize(&said["sim"]["disturbance"]["delay"]).unwrap_or_default();
        return json!({"fleet": {
            "planner": shown(&row.planner_id),
            "options": options,
            "agents": row.agents,
            "duration_s": row.budget_ms.clamp(1.0, 1e9) / 1e3,
            "model": model.filter(|model| PRESETS.iter().any(|preset| preset.name == *model)),
            "cell_size_m": said["sim"]["cell_size_m"].as_f64(),
            "limit_ms": said["limit_s"].as_f64().map(|limit_s| (limit_s * 1e3).ceil() as u64),
            "delay": delay.to_string(),
            "seed": row.seed,
            "live": true,
        }});
    }
    let budget_ms = row.budget_ms.clamp(1.0, 1e9).ceil() as u64;
    let view = row.representation.as_deref().unwrap_or("grid");
    json!({"run": {
        "planner": shown(&row.planner_id),
        "options": options,
        "view": shown(view),
        "budget_ms": budget_ms,
        "seed": row.seed,
        "execute": {},
    }})
}

fn pair(words: &mut Vec<String>, flag: &str, value: &dyn ToString) {
    // A number may begin as an argument does.
    words.push(format!("{flag}={}", value.to_string()));
}

/// The terms of an execution that are not the usual ones, as arguments.
fn conduct(config: &SimConfig) -> Vec<String> {
    let usual = SimConfig::default();
    let mut words = Vec::new();
    let (own, of_usual) = (&config.disturbance, &usual.disturbance);
    let mut put = |flag: &str, own: String, usual: String| {
        if own != usual {
            words.push(format!("{flag}={own}"));
        }
    };
    let text = |value: &dyn ToString| value.to_string();
    let pairs: [(&str, &dyn ToString, &dyn ToString); 11] = [
        ("--policy", &config.policy, &usual.policy),
        ("--tier", &config.tier, &usual.tier),
        ("--ticks-hz", &config.ticks_hz, &usual.ticks_hz),
        ("--substeps", &config.substeps, &usual.substeps),
        (
            "--message-period",
            &config.message_period_s,
            &usual.message_period_s,
        ),
        ("--margin", &config.margin_m, &usual.margin_m),
        ("--smooth", &config.smooth_m, &usual.smooth_m),
        ("--delay", &own.delay, &of_usual.delay),
        ("--velocity-noise", &own.velocity, &of_usual.velocity),
        ("--twist-noise", &own.twist, &of_usual.twist),
        ("--messages", &own.messages, &of_usual.messages),
    ];
    for (flag, own, usual) in pairs {
        put(flag, text(own), text(usual));
    }
    put("--seed", own.seed.to_string(), of_usual.seed.to_string());
    let heading = |config: &SimConfig| config.start_heading_rad.to_degrees().to_string();
    put("--start-heading", heading(config), heading(&usual));
    if let Some(limit_s) = config.time_limit_s {
        pair(&mut words, "--time-limit", &limit_s);
    }
    if config.until_done {
        words.push("--until-done".into());
    }
    if config.overlapping_starts {
        words.push("--allow-overlaps".into());
    }
    words
}

/// The terms of an execution on a map, which has no robots of its own.
fn on_map(
    config: &SimConfig,
    robots: Option<&Robots>,
    words: &mut Vec<String>,
    notes: &mut Vec<String>,
) {
    pair(words, "--cell-size", &config.cell_size_m);
    pair(words, "--step", &config.step_s);
    if let Some(radius_m) = config.radius_m {
        pair(words, "--radius", &radius_m);
    }
    match robots {
        Some(Robots::Model(name)) => pair(words, "--model", name),
        Some(Robots::File(..)) => notes.push(
            "the suite's robots are those of a fleet file; here discs follow the plan".into(),
        ),
        Some(Robots::Pebbles) | None => {}
    }
}
