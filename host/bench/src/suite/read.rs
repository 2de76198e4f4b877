//! From TOML to a suite. No file but the suite's own is read here.

use std::path::Path;

use fleetyard_check::PathRule;
use fleetyard_core::document::{Document, Setting, Table, Value};
use fleetyard_core::{Connectivity, InputError, Words as _, is_unseen, shown};
use fleetyard_runtime::Attach;
use fleetyard_sim::SimConfig;
use fleetyard_world::{
    EmptySpec, MapSpec, MazeAlgorithm, MazeRandom, MazeSeeds, MazeSpec, RandomSpec, RoomSpec,
    WarehouseSpec,
};
use serde_json::Map;

use crate::evaluate::{Order, Unit};
use crate::options::{BudgetOptions, SandboxOptions};

use super::fleet::{self, Around, FLEET};
use super::sets::{Generated, InstanceSet, Kind, Mazes, Numbers, SeriesSeeds, Teams};
use super::settings::{self, BUDGET, EXECUTION, SANDBOX};
use super::{Clock, Named, PlannerSetup, Protocol, Reuse, Suite};

/// Every table of a suite file with its keys; the root has no name.
pub const KEYS: &[(&str, &[&str])] = &[
    ("", ROOT),
    ("protocol", PROTOCOL),
    ("budget", BUDGET),
    ("sandbox", SANDBOX),
    ("execution", EXECUTION),
    ("fleet", FLEET),
    ("planner", PLANNER),
    ("instances", INSTANCES),
    ("maze", MAZE),
    ("generate", GENERATE),
    ("series", SERIES),
];

const ROOT: &[&str] = &[
    "name",
    "description",
    "protocol",
    "budget",
    "sandbox",
    "execution",
    "fleet",
    "planner",
    "instances",
];
const PROTOCOL: &[&str] = &[
    "repeats",
    "warm_ups",
    "retry_contended",
    "keep_plans",
    "seeds",
    "reuse",
    "clock",
    "path_rule",
    "ranking",
    "generalise_over",
];
const PLANNER: &[&str] = &["label", "plugin", "attach", "options", "fleet"];
const INSTANCES: &[&str] = &[
    "scen",
    "map",
    "maze",
    "generate",
    "agents",
    "too_many_agents",
    "connectivity",
];
const MAZE: &[&str] = &[
    "algorithm",
    "size",
    "width",
    "height",
    "random",
    "seeds",
    "base_seed",
    "count",
];
/// Of all kinds; each has some of them.
const GENERATE: &[&str] = &[
    "kind",
    "rows",
    "cols",
    "obstacle_density",
    "room_size",
    "doors",
    "corridor",
    "algorithm",
    "random",
    "blocks_across",
    "blocks_down",
    "block_cols",
    "block_rows",
    "aisle",
    "margin",
    "aisle_rows",
    "edge_rows",
    "open",
    "endpoints",
    "workstations",
    "seeds",
    "scenario_seeds",
];
/// Of numbers that are not written one by one.
const SERIES: &[&str] = &["from", "to", "count", "step"];

const MOST_AGENTS: u64 = 1 << 24;

/// The folder that paths in a suite are relative to, and the values of variables in them.
pub(super) struct Paths<'p> {
    pub(super) folder: &'p Path,
    pub(super) variable: &'p dyn Fn(&str) -> Option<String>,
}

impl Paths<'_> {
    /// The text of a value with its variables replaced.
    pub(super) fn expanded(&self, value: &Value<'_, '_>) -> Result<String, InputError> {
        let text = value.nonempty()?;
        if text.contains(char::is_control) {
            let key = shown(&value.key);
            return Err(value.error(format!("`{key}` has a control character")));
        }
        let mut expanded = String::new();
        let mut rest = text;
        while let Some((before, after)) = rest.split_once("${") {
            let Some((name, after)) = after.split_once('}') else {
                return Err(value
                    .error(format!(
                        "`{}` has a variable without an end",
                        shown(&value.key)
                    ))
                    .hint("write ${NAME}"));
            };
            let known = (self.variable)(name).filter(|set| !set.is_empty());
            let Some(set) = known else {
                let name = shown(name);
                return Err(value
                    .error(format!("the environment variable `{name}` is not set"))
                    .hint(format!("set it, as in {name}=/path/to/it fleetyard …")));
            };
            expanded.push_str(before);
            expanded.push_str(&set);
            rest = after;
        }
        expanded.push_str(rest);
        Ok(expanded)
    }

    /// The name of a plugin: an identifier has no slash.
    pub(super) fn plugin(&self, named: String) -> String {
        if named.contains('/') {
            self.folder.join(named).display().to_string()
        } else {
            named
        }
    }

    pub(super) fn path(&self, value: &Value<'_, '_>) -> Result<Named, InputError> {
        Ok(Named {
            path: self.folder.join(self.expanded(value)?),
            place: value.place(),
        })
    }

    fn paths(&self, value: &Value<'_, '_>) -> Result<Vec<Named>, InputError> {
        let items = some(value)?;
        items.iter().map(|item| self.path(item)).collect()
    }
}

/// One value or several; a list without any makes a suite without trials.
pub(super) fn some<'t, 'a>(value: &Value<'t, 'a>) -> Result<Vec<Value<'t, 'a>>, InputError> {
    let items = value.one_or_more()?;
    if items.is_empty() {
        let reason = format!(
            "`{}` is empty, so there is nothing to run",
            shown(&value.key)
        );
        return Err(value.error(reason));
    }
    Ok(items)
}

pub(super) fn suite(
    source: &str,
    text: &str,
    settings: &[Setting],
    paths: &Paths<'_>,
) -> Result<Suite, InputError> {
    if text.len() as u64 > super::SUITE_LIMIT {
        let reason = format!("a suite has at most {} bytes", super::SUITE_LIMIT);
        return Err(InputError::new(source, reason));
    }
    let document = Document::with_settings(source, text, settings);
    let root = document.parse()?;
    let root = Table::new(document, "", 0, root.get_ref(), ROOT)?;
    let lifelong = root.get("fleet").is_some();
    let protocol = match root.get("protocol") {
        Some(value) => protocol(&value, lifelong)?,
        None => Protocol::default(),
    };
    let budget = match root.get("budget") {
        Some(value) => settings::budget(&value)?,
        None => BudgetOptions::default(),
    };
    let sandbox = match root.get("sandbox") {
        Some(value) => settings::sandbox(&value, paths)?,
        None => SandboxOptions::default(),
    };
    let (config, robots) = match root.get("execution") {
        Some(value) => settings::execution(&value, paths)?,
        None => (SimConfig::default(), None),
    };
    let execution = root.get("execution");
    let step = execution.map(|value| value.table("[execution]", EXECUTION));
    let around = Around {
        budget: &budget,
        config: &config,
        step_given: step
            .transpose()?
            .is_some_and(|table| table.get("step_s").is_some()),
    };
    let planners = planners(&root, &around, paths)?;
    let sets = some(&root.require("instances")?)?;
    let sets: Result<Vec<InstanceSet>, InputError> = (sets.iter())
        .map(|set| instance_set(set, lifelong, paths))
        .collect();
    Ok(Suite {
        name: name(&root.require("name")?)?,
        description: root.text("description")?.unwrap_or_default().to_owned(),
        text: text.to_owned(),
        protocol,
        budget,
        sandbox,
        config,
        robots,
        planners,
        sets: sets?,
        place: root.place(),
        normal: root.object()?,
    })
}

fn name(value: &Value<'_, '_>) -> Result<String, InputError> {
    let name = value.nonempty()?;
    let fits = |letter: char| letter.is_ascii_alphanumeric() || "._-".contains(letter);
    if !name.chars().all(fits) || name.starts_with(['.', '-']) || name.len() > 100 {
        let reason = format!("\"{}\" cannot be the name of a suite", shown(name));
        return Err(value.error(reason).hint(
            "files are named after it: it has letters, digits, '.', '_' and '-', begins with a \
             letter or digit, and is no longer than 100",
        ));
    }
    Ok(name.to_owned())
}

/// Numbers between two, all different: one, a list, or a series.
fn numbers(value: &Value<'_, '_>, low: u64, high: u64) -> Result<Numbers, InputError> {
    if value.is_table() {
        return series(value, low, high);
    }
    let items = some(value)?;
    let mut numbers = Vec::with_capacity(items.len());
    let mut seen = std::collections::HashSet::new();
    for item in &items {
        let number = item.whole(low, high)?;
        if !seen.insert(number) {
            let reason = format!("`{}` has {number} twice", shown(&value.key));
            return Err(item.error(reason).hint("remove one of them"));
        }
        numbers.push(number);
    }
    Ok(Numbers::List(numbers))
}

fn series(value: &Value<'_, '_>, low: u64, high: u64) -> Result<Numbers, InputError> {
    let key = value.key.clone();
    let table = value.table(format!("`{}`", shown(&key)), SERIES)?;
    let first = table.require("from")?.whole(low, high)?;
    let step = match table.get("step") {
        Some(step) => step.whole(1, high.max(1))?,
        None => 1,
    };
    let count = match (table.get("to"), table.get("count")) {
        (Some(to), None) => {
            let count = (to.whole(first, high)? - first) / step;
            if count >= super::MOST_INSTANCES {
                let reason = format!(
                    "`{}` has more than {} numbers",
                    shown(&key),
                    super::MOST_INSTANCES
                );
                return Err(to.error(reason));
            }
            count + 1
        }
        (None, Some(given)) => {
            let count = given.whole(1, super::MOST_INSTANCES)?;
            let last = step
                .checked_mul(count - 1)
                .and_then(|far| first.checked_add(far));
            if last.is_none_or(|last| last > high) {
                let reason = format!("`{}` goes on beyond {high}", shown(&key));
                return Err(given.error(reason));
            }
            count
        }
        (Some(_), Some(count)) => {
            return Err(count.error("`to` and `count` both say where the series ends"));
        }
        (None, None) => {
            let reason = format!("`{}` has no end", shown(&key));
            return Err(table.error(reason).hint("add `to = …` or `count = …`"));
        }
    };
    Ok(Numbers::Series { first, step, count })
}

pub(super) fn small(value: &Value<'_, '_>, low: u32, high: u32) -> Result<u32, InputError> {
    let number = value.whole(u64::from(low), u64::from(high))?;
    // It is between two that fit.
    Ok(number as u32)
}

fn protocol(value: &Value<'_, '_>, lifelong: bool) -> Result<Protocol, InputError> {
    let table = value.table("[protocol]", PROTOCOL)?;
    let mut protocol = Protocol::default();
    if let Some(repeats) = table.get("repeats") {
        protocol.repeats = small(&repeats, 1, 1_000_000)?;
    }
    if let Some(warm_ups) = table.get("warm_ups") {
        protocol.warm_ups = small(&warm_ups, 0, 1000)?;
    }
    if let Some(retries) = table.get("retry_contended") {
        protocol.retry_contended = small(&retries, 0, 1000)?;
    }
    if let Some(keep) = table.get("keep_plans") {
        protocol.keep_plans = keep.flag()?;
        if protocol.keep_plans && lifelong {
            return Err(keep
                .error("a fleet has no plan that could be kept")
                .hint("leave it out; `fleetyard fleet --record FILE` keeps all of a run"));
        }
    }
    if let Some(seeds) = table.get("seeds") {
        protocol.seeds = numbers(&seeds, 0, u64::MAX)?.iter().collect();
    }
    if let Some(reuse) = table.get("reuse") {
        protocol.reuse = reuse.choice(Reuse::CHOICES)?;
    }
    if let Some(clock) = table.get("clock") {
        protocol.clock = clock.choice(Clock::CHOICES)?;
    }
    if let Some(rule) = table.get("path_rule") {
        let rules = PathRule::ALL.iter().map(|rule| (rule.name(), *rule));
        protocol.path_rule = rule.choice(&rules.collect::<Vec<_>>())?;
    }
    if let Some(ranking) = table.get("ranking") {
        protocol.ranking = ranking.choice(RANKINGS)?;
    }
    if let Some(unit) = table.get("generalise_over") {
        protocol.generalise_over = unit.choice(Unit::CHOICES)?;
    }
    Ok(protocol)
}

const RANKINGS: &[(&str, Order)] = &[("text", Order::Text), ("appendix", Order::Appendix)];

fn planners(
    root: &Table<'_, '_>,
    around: &Around<'_>,
    paths: &Paths<'_>,
) -> Result<Vec<PlannerSetup>, InputError> {
    let fleet = root.get("fleet");
    let mut planners: Vec<PlannerSetup> = Vec::new();
    for value in some(&root.require("planner")?)? {
        let table = value.table("[[planner]]", PLANNER)?;
        let plugin = table.require("plugin")?;
        let options = table.get("options");
        let given = match &options {
            Some(options) => options.object()?,
            None => Map::new(),
        };
        let named = paths.expanded(&plugin)?;
        let label = match table.get("label") {
            Some(label) => {
                let text = label.nonempty()?;
                if text.contains(is_unseen) || text.chars().count() > 100 {
                    let reason = format!("\"{}\" cannot be a label", shown(text));
                    return Err(label
                        .error(reason)
                        .hint("it is one line of at most 100 characters"));
                }
                text.trim().to_owned()
            }
            None => default_label(&named, &given),
        };
        if planners.iter().any(|planner| planner.label == label) {
            let at = table.get("label").unwrap_or(value);
            let reason = format!("two planners are called \"{}\"", shown(&label));
            return Err(at.error(reason).hint("give each a `label` of its own"));
        }
        let own = table.get("fleet");
        let fleet = match (&fleet, &own) {
            (Some(common), own) => Some(fleet::setup(common, own.as_ref(), around, paths)?),
            (None, Some(own)) => {
                return Err(own
                    .error("`fleet` says what is otherwise for a planner than in [fleet]")
                    .hint("write a table [fleet], which makes the suite one of fleets"));
            }
            (None, None) => None,
        };
        planners.push(PlannerSetup {
            label,
            fleet,
            plugin: paths.plugin(named),
            attach: table
                .get("attach")
                .map(|at| at.choice(ATTACH))
                .transpose()?,
            options: given,
            plugin_place: plugin.place(),
            options_place: options.unwrap_or(value.clone()).place(),
        });
    }
    Ok(planners)
}

const ATTACH: &[(&str, Attach)] = &[
    ("in-process", Attach::InProcess),
    ("worker", Attach::Worker),
    ("stdio", Attach::Stdio),
    ("command", Attach::Command),
];

/// The plugin's identifier or the stem of its file, and its options.
fn default_label(plugin: &str, options: &Map<String, serde_json::Value>) -> String {
    let (path, id) = match plugin.rsplit_once(':') {
        Some((path, id)) if !id.contains('/') => (path, Some(id)),
        _ => (plugin, None),
    };
    let stem = Path::new(path).file_stem().and_then(|stem| stem.to_str());
    let name = id.or(stem).unwrap_or(plugin);
    let mut label = name.to_owned();
    for (key, value) in options {
        let value = match value {
            serde_json::Value::String(text) => text.clone(),
            other => other.to_string(),
        };
        label.extend([" ", key, "=", &value]);
    }
    label
}

fn connectivity(value: &Value<'_, '_>) -> Result<Connectivity, InputError> {
    match value.integer(i64::MIN, i64::MAX)? {
        4 => Ok(Connectivity::Four),
        8 => Ok(Connectivity::Eight),
        _ => Err(value.error("grids have 4 or 8 neighbours")),
    }
}

fn instance_set(
    value: &Value<'_, '_>,
    lifelong: bool,
    paths: &Paths<'_>,
) -> Result<InstanceSet, InputError> {
    let table = value.table("[[instances]]", INSTANCES)?;
    let kinds: &[&str] = if lifelong {
        for key in ["scen", "maze", "connectivity", "too_many_agents"] {
            if let Some(value) = table.get(key) {
                let reason = format!("`{key}` is not for fleets, whose starts and goals are drawn");
                let hint = "name maps: `map = [\"hall.map\"]` and `agents = [50, 100]`";
                return Err(value.error(reason).hint(hint));
            }
        }
        &["map", "generate"]
    } else {
        &["scen", "maze", "generate"]
    };
    let given: Vec<Value<'_, '_>> = kinds.iter().filter_map(|kind| table.get(kind)).collect();
    let kind = match given.as_slice() {
        [one] => one,
        [] => {
            return Err(table
                .error("the instances have no source")
                .hint(if lifelong {
                    "write `map = […]` or `generate = { … }`"
                } else {
                    "write `scen = […]`, `maze = { … }` or `generate = { … }`"
                }));
        }
        [_, other, ..] => {
            let reason = format!("`{}` and `{}` are two sources", given[0].key, other.key);
            return Err(other
                .error(reason)
                .hint("write another [[instances]] for it"));
        }
    };
    let is_files = kind.key == "scen";
    let connectivity = match table.get("connectivity") {
        Some(value) => {
            let mut all = Vec::new();
            for item in some(&value)? {
                let one = connectivity(&item)?;
                if all.contains(&one) {
                    let reason = format!("`connectivity` has {} twice", one.degree());
                    return Err(item.error(reason).hint("remove one of them"));
                }
                all.push(one);
            }
            all
        }
        None => vec![Connectivity::Four],
    };
    let skip = match table.get("too_many_agents") {
        Some(value) if !is_files => {
            return Err(value.error("`too_many_agents` belongs to `scen`"));
        }
        Some(value) => value.choice(&[("refuse", false), ("skip", true)])?,
        None => false,
    };
    let teams = match table.get("agents") {
        Some(value) => Some(Teams {
            sizes: numbers(&value, 1, MOST_AGENTS)?,
            place: value.place(),
            skip,
        }),
        None => None,
    };
    let maps = match table.get("map").filter(|_| !lifelong) {
        Some(value) if !is_files => {
            return Err(value.error("`map` says where the maps of `scen` are"));
        }
        Some(value) => paths
            .paths(&value)?
            .into_iter()
            .map(|map| map.path)
            .collect(),
        None => Vec::new(),
    };
    let kind = if is_files {
        Kind::Files {
            files: paths.paths(kind)?,
            maps,
        }
    } else if kind.key == "map" {
        table.require("agents")?;
        Kind::Maps(paths.paths(kind)?)
    } else if kind.key == "maze" {
        if let Some(teams) = &teams {
            return Err(teams
                .place
                .error("a maze of a series has one agent")
                .hint("leave out `agents`; `generate = { kind = \"maze\", … }` has random teams"));
        }
        Kind::Mazes(mazes(kind)?)
    } else {
        // How many there are is for the suite to say.
        table.require("agents")?;
        Kind::Generated(generated(kind)?)
    };
    Ok(InstanceSet {
        kind,
        teams,
        connectivity,
        lifelong,
        place: table.place(),
    })
}

fn mazes(value: &Value<'_, '_>) -> Result<Mazes, InputError> {
    let table = value.table("`maze`", MAZE)?;
    let side = |value: &Value<'_, '_>| small(value, 1, MOST_MAZE_CELLS);
    let sizes = match (table.get("size"), table.get("width"), table.get("height")) {
        (Some(size), None, None) => {
            let sizes = numbers(&size, 1, u64::from(MOST_MAZE_CELLS))?;
            sizes
                .iter()
                .map(|size| (size as u32, size as u32))
                .collect()
        }
        (Some(size), _, _) => {
            return Err(size.error("`size` is width and height, which are there as well"));
        }
        (None, None, None) => {
            let fault = table.error("the maze has no size");
            return Err(fault.hint("add `size = …`, or `width = …` and `height = …`"));
        }
        (None, _, _) => {
            let (width, height) = (table.require("width")?, table.require("height")?);
            vec![(side(&width)?, side(&height)?)]
        }
    };
    let mut algorithms = Vec::new();
    if let Some(value) = table.get("algorithm") {
        for item in some(&value)? {
            let algorithm = item.choice(ALGORITHMS)?;
            if algorithms.contains(&algorithm) {
                let reason = format!("`algorithm` has \"{}\" twice", algorithm.name());
                return Err(item.error(reason).hint("remove one of them"));
            }
            algorithms.push(algorithm);
        }
    } else {
        algorithms.push(MazeAlgorithm::Backtracker);
    }
    Ok(Mazes {
        sizes,
        algorithms,
        random: match table.get("random") {
            Some(value) => value.choice(RANDOM)?,
            None => MazeRandom::default(),
        },
        seeds: series_seeds(&table)?,
        place: value.place(),
    })
}

fn series_seeds(table: &Table<'_, '_>) -> Result<SeriesSeeds, InputError> {
    let seeds = table.get("seeds");
    if let Some(seeds) = seeds.as_ref().filter(|seeds| seeds.text().is_err()) {
        for key in ["base_seed", "count"] {
            if let Some(other) = table.get(key) {
                let reason = format!("`{key}` belongs to a schedule, and `seeds` are numbers");
                return Err(other.error(reason));
            }
        }
        return Ok(SeriesSeeds::Numbers(numbers(seeds, 0, u64::MAX)?));
    }
    let schedule = match &seeds {
        Some(seeds) => seeds.choice(SCHEDULES)?,
        None => MazeSeeds::default(),
    };
    let base = match table.get("base_seed") {
        Some(base) => base.whole(0, u64::MAX)?,
        None => DEFAULT_BASE_SEED,
    };
    let given = table.require("count")?;
    let count = given.whole(1, super::MOST_INSTANCES)?;
    if schedule.seed(base, count - 1).is_none() {
        return Err(given.error("the last seeds are more than a seed can be"));
    }
    Ok(SeriesSeeds::Schedule {
        schedule,
        base,
        count,
    })
}

/// The maze paper's first seed.
const DEFAULT_BASE_SEED: u64 = 7;

/// Width and height are at most so many; the map's size decides before.
const MOST_MAZE_CELLS: u32 = 1 << 15;

const RANDOM: &[(&str, MazeRandom)] = &[
    ("chacha", MazeRandom::ChaCha),
    ("python", MazeRandom::Python),
];

const SCHEDULES: &[(&str, MazeSeeds)] = &[
    ("benchmark", MazeSeeds::Benchmark),
    ("episodes", MazeSeeds::Episodes),
];

/// What is made, and the keys beside `kind` and `scenario_seeds` that say how.
const KINDS: &[(&str, &[&str])] = &[
    ("empty", &["rows", "cols"]),
    ("random", &["rows", "cols", "obstacle_density", "seeds"]),
    ("room", &["rows", "cols", "room_size", "doors", "seeds"]),
    (
        "maze",
        &["rows", "cols", "corridor", "algorithm", "random", "seeds"],
    ),
    (
        "warehouse",
        &[
            "blocks_across",
            "blocks_down",
            "block_cols",
            "block_rows",
            "aisle",
            "margin",
            "aisle_rows",
            "edge_rows",
            "open",
            "endpoints",
            "workstations",
        ],
    ),
];

fn generated(value: &Value<'_, '_>) -> Result<Generated, InputError> {
    let any = value.table("`generate`", GENERATE)?;
    let kinds: Vec<(&str, usize)> = KINDS
        .iter()
        .enumerate()
        .map(|(index, (name, _))| (*name, index))
        .collect();
    let (name, keys) = KINDS[any.require("kind")?.choice(&kinds)?];
    let mut known = vec!["kind", "scenario_seeds"];
    known.extend(keys);
    let table = value.table(format!("`generate` of kind \"{name}\""), &known)?;
    let size = |key: &'static str| small(&table.require(key)?, 1, u32::MAX);
    let optional = |key: &'static str, default: u32| match table.get(key) {
        Some(value) => small(&value, 1, u32::MAX),
        None => Ok(default),
    };
    let given = |key: &'static str| {
        let value = table.get(key);
        value.map(|value| small(&value, 0, u32::MAX)).transpose()
    };
    let flag = |key: &'static str| table.get(key).map_or(Ok(false), |value| value.flag());
    let seed = 0;
    let map = match name {
        "empty" => MapSpec::Empty(EmptySpec {
            rows: size("rows")?,
            cols: size("cols")?,
        }),
        "random" => MapSpec::Random(RandomSpec {
            rows: size("rows")?,
            cols: size("cols")?,
            obstacle_density: table.require("obstacle_density")?.number()?,
            seed,
        }),
        "room" => MapSpec::Room(RoomSpec {
            rows: size("rows")?,
            cols: size("cols")?,
            room_size: size("room_size")?,
            doors: optional("doors", 1)?,
            seed,
        }),
        "maze" => MapSpec::Maze(MazeSpec {
            rows: size("rows")?,
            cols: size("cols")?,
            corridor: optional("corridor", 1)?,
            algorithm: match table.get("algorithm") {
                Some(value) => value.choice(ALGORITHMS)?,
                None => MazeAlgorithm::Backtracker,
            },
            random: match table.get("random") {
                Some(value) => value.choice(RANDOM)?,
                None => MazeRandom::default(),
            },
            seed,
        }),
        _ => MapSpec::Warehouse(WarehouseSpec {
            blocks_across: size("blocks_across")?,
            blocks_down: size("blocks_down")?,
            block_cols: size("block_cols")?,
            block_rows: size("block_rows")?,
            aisle: size("aisle")?,
            margin: given("margin")?,
            aisle_rows: given("aisle_rows")?,
            edge_rows: given("edge_rows")?,
            open: flag("open")?,
            endpoints: flag("endpoints")?,
            workstations: given("workstations")?,
        }),
    };
    let seeds = |key: &'static str| match table.get(key) {
        Some(value) => numbers(&value, 0, u64::MAX),
        None => Ok(Numbers::List(vec![1])),
    };
    Ok(Generated {
        map,
        map_seeds: if keys.contains(&"seeds") {
            Some(seeds("seeds")?)
        } else {
            None
        },
        scenario_seeds: seeds("scenario_seeds")?,
        place: value.place(),
    })
}

const ALGORITHMS: &[(&str, MazeAlgorithm)] = &[
    ("backtracker", MazeAlgorithm::Backtracker),
    ("prim", MazeAlgorithm::Prim),
];
