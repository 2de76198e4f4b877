//! From TOML to a suite. No file but the suite's own is read here.

use std::collections::HashSet;
use std::hash::Hash;
use std::path::Path;

use fleetyard_check::PathRule;
use fleetyard_core::document::{self, Fault, Setting, Value, not_empty, text};
use fleetyard_core::{Connectivity, InputError, shown};
use fleetyard_runtime::{Attach, plugin_name};
use fleetyard_sim::SimConfig;
use fleetyard_world::{MapSpec, MazeAlgorithm, MazeSeeds};
use serde::{Deserialize, Deserializer};
use serde_json::{Map, Value as Json};

use crate::options::BudgetOptions;

use super::fleet::{self, Around};
use super::recipe::{Generated, Mazes, Numbers, SeriesSeeds};
use super::sets::{InstanceSet, Kind, Teams};
use super::values::{MOST_INSTANCES, Paths, connectivity, label, said, some};
use super::{Clock, PlannerSetup, Protocol, Suite};
use super::{settings, view};

const MOST_AGENTS: u64 = 1 << 24;

/// One value or several, all different.
fn distinct<'t, T: Copy + Eq + Hash>(
    value: &Value<'t>,
    read: impl Fn(&Value<'t>) -> Result<T, InputError>,
) -> Result<Vec<T>, InputError> {
    let mut seen = HashSet::new();
    let items = some(value)?;
    let all = items.iter().map(|item| match read(item)? {
        one if seen.insert(one) => Ok(one),
        _ => {
            let one: Json = item.read()?;
            let reason = format!("`{}` has {one} twice", shown(value.key()));
            Err(item.error(reason).hint("remove one of them"))
        }
    });
    all.collect()
}

/// The keys of a suite of which each stands for itself.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Head {
    #[serde(deserialize_with = "name")]
    name: String,
    #[serde(default)]
    description: String,
    #[serde(default)]
    budget: BudgetOptions,
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
    document::read(source, text, settings, |root| {
        let tables = [
            "protocol",
            "sandbox",
            "execution",
            "fleet",
            "planner",
            "instances",
        ];
        let head: Head = root.clone().apart(&tables).read()?;
        let lifelong = root.get("fleet").is_some();
        let protocol = root.optional("protocol", |table| protocol(table, lifelong))?;
        let protocol = protocol.unwrap_or_default();
        let sandbox = root.optional("sandbox", |table| settings::sandbox(table, paths))?;
        let execution = root.get("execution");
        let (config, robots) = match &execution {
            Some(table) => settings::execution(table, paths)?,
            None => (SimConfig::default(), None),
        };
        let around = Around {
            fleet: root.get("fleet"),
            budget: &head.budget,
            config: &config,
            step_given: execution
                .as_ref()
                .is_some_and(|table| table.get("step_s").is_some()),
            paths,
        };
        let planners = planners(&root.require("planner")?, &around)?;
        let sets = some(&root.require("instances")?)?;
        let sets = sets.iter();
        let sets = sets.map(|set| instance_set(set, lifelong, &protocol, paths));
        let sets: Vec<InstanceSet> = sets.collect::<Result<_, _>>()?;
        if let Some(table) = execution.filter(|_| sets.iter().all(InstanceSet::is_of_tasks)) {
            of_tasks(&table)?;
        }
        Ok(Suite {
            name: head.name,
            description: head.description,
            text: text.to_owned(),
            protocol,
            budget: head.budget,
            sandbox: sandbox.unwrap_or_default(),
            robots,
            planners,
            sets,
            place: root.place(),
            normal: root.read()?,
            config,
        })
    })
}

/// Refuses keys of `[execution]` that a task says by itself.
fn of_tasks(execution: &Value<'_>) -> Result<(), InputError> {
    let own = ["model", "fleet", "radius_m", "cell_size_m", "step_s"];
    match own.into_iter().find_map(|key| execution.get(key)) {
        None => Ok(()),
        Some(value) => {
            let reason = format!(
                "`{}` is not for tasks, which name their worlds and robots",
                value.key()
            );
            let hint = "leave it out; a view of a grid has a `step`";
            Err(value.error(reason).hint(hint))
        }
    }
}

fn name<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    text(deserializer, "", |name| {
        let fits = |letter: char| letter.is_ascii_alphanumeric() || "._-".contains(letter);
        let begins = !not_empty(name)?.starts_with(['.', '-']);
        if begins && name.chars().all(fits) && name.len() <= 100 {
            return Ok(name.to_owned());
        }
        let reason = format!("\"{}\" cannot be the name of a suite", shown(name));
        Err(Fault::new(reason).hint(
            "files are named after it: it has letters, digits, '.', '_' and '-', begins with a \
             letter or digit, and is no longer than 100",
        ))
    })
}

/// Numbers between two, all different: one, a list, or a series.
fn numbers(value: &Value<'_>, low: u64, high: u64) -> Result<Numbers, InputError> {
    if value.is_table() {
        return series(value, low, high);
    }
    distinct(value, |item| item.whole(low, high)).map(Numbers::List)
}

fn series(table: &Value<'_>, low: u64, high: u64) -> Result<Numbers, InputError> {
    table.only(&["from", "to", "count", "step"])?;
    let key = shown(table.key());
    let first = table.require("from")?.whole(low, high)?;
    let step = table.optional("step", |step| step.whole(1, high.max(1)))?;
    let step = step.unwrap_or(1);
    let count = match (table.get("to"), table.get("count")) {
        (Some(to), None) => {
            let count = (to.whole(first, high)? - first) / step;
            if count >= MOST_INSTANCES {
                let reason = format!("`{key}` has more than {MOST_INSTANCES} numbers");
                return Err(to.error(reason));
            }
            count + 1
        }
        (None, Some(given)) => {
            let count = given.whole(1, MOST_INSTANCES)?;
            let last = step
                .checked_mul(count - 1)
                .and_then(|far| first.checked_add(far));
            if last.is_none_or(|last| last > high) {
                return Err(given.error(format!("`{key}` goes on beyond {high}")));
            }
            count
        }
        (Some(_), Some(count)) => {
            return Err(count.error("`to` and `count` both say where the series ends"));
        }
        (None, None) => {
            let reason = format!("`{key}` has no end");
            return Err(table.error(reason).hint("add `to = …` or `count = …`"));
        }
    };
    Ok(Numbers::Series { first, step, count })
}

fn protocol(table: &Value<'_>, lifelong: bool) -> Result<Protocol, InputError> {
    let mut protocol: Protocol = table.clone().apart(&["seeds"]).read()?;
    if let Some(seeds) = table.get("seeds") {
        protocol.seeds = numbers(&seeds, 0, u64::MAX)?.iter().collect();
    }
    if protocol.keep_plans && lifelong {
        return Err(table
            .error_at("keep_plans", "a fleet has no plan that could be kept")
            .hint("leave it out; `fleetyard fleet --record FILE` keeps all of a run"));
    }
    Ok(protocol)
}

/// The keys of a planner of which each stands for itself.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PlannerTable {
    #[serde(default, deserialize_with = "label")]
    label: Option<String>,
    attach: Option<Attach>,
    #[serde(default)]
    options: Map<String, Json>,
}

fn planners(value: &Value<'_>, around: &Around<'_>) -> Result<Vec<PlannerSetup>, InputError> {
    let mut planners: Vec<PlannerSetup> = Vec::new();
    for value in some(value)? {
        let table: PlannerTable = value.clone().apart(&["plugin", "fleet"]).read()?;
        let plugin = value.require("plugin")?;
        let named = around.paths.expanded(&plugin)?;
        let label = table.label;
        let label = label.unwrap_or_else(|| default_label(&named, &table.options));
        if planners.iter().any(|planner| planner.label == label) {
            let reason = format!("two planners are called \"{}\"", shown(&label));
            return Err(value
                .error_at("label", reason)
                .hint("give each a `label` of its own"));
        }
        planners.push(PlannerSetup {
            label,
            fleet: fleet::setup(value.get("fleet").as_ref(), around)?,
            plugin: around.paths.plugin(named),
            attach: table.attach,
            options: table.options,
            plugin_place: plugin.place(),
            options_place: value.get("options").unwrap_or(value).place(),
        });
    }
    Ok(planners)
}

/// The plugin's identifier or the name of its file, and its options.
fn default_label(plugin: &str, options: &Map<String, Json>) -> String {
    let (path, id) = match plugin.rsplit_once(':') {
        Some((path, id)) if !id.contains('/') => (path, Some(id)),
        _ => (plugin, None),
    };
    let name = plugin_name(Path::new(path));
    said(id.or(name.as_deref()).unwrap_or(plugin), options)
}

/// The treatment of team sizes for which a scenario has too few agents.
#[derive(PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum TooManyAgents {
    Refuse,
    Skip,
}

/// The treatment of views that cannot be derived from a task.
#[derive(PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum NoView {
    Refuse,
    Fail,
}

fn instance_set(
    table: &Value<'_>,
    lifelong: bool,
    protocol: &Protocol,
    paths: &Paths<'_>,
) -> Result<InstanceSet, InputError> {
    table.only(&[
        "scen",
        "map",
        "maze",
        "generate",
        "task",
        "views",
        "no_view",
        "agents",
        "too_many_agents",
        "connectivity",
    ])?;
    let kinds: &[&str] = if lifelong {
        for key in ["scen", "maze", "task", "connectivity", "too_many_agents"] {
            if let Some(value) = table.get(key) {
                let reason = format!("`{key}` is not for fleets, whose starts and goals are drawn");
                let hint = "name maps: `map = [\"hall.map\"]` and `agents = [50, 100]`";
                return Err(value.error(reason).hint(hint));
            }
        }
        &["map", "generate"]
    } else {
        &["scen", "maze", "generate", "task"]
    };
    let given: Vec<Value<'_>> = kinds.iter().filter_map(|kind| table.get(kind)).collect();
    let source = match given.as_slice() {
        [one] => one,
        [] => {
            let hint = if lifelong {
                "write `map = […]` or `generate = { … }`"
            } else {
                "write `scen = […]`, `maze = { … }`, `generate = { … }` or `task = […]`"
            };
            return Err(table.error("the instances have no source").hint(hint));
        }
        [one, other, ..] => {
            let reason = format!("`{}` and `{}` are two sources", one.key(), other.key());
            return Err(other
                .error(reason)
                .hint("write another [[instances]] for it"));
        }
    };
    let moves = table.optional("connectivity", |value| distinct(value, connectivity))?;
    let (of_scen, of_task) = (source.key() == "scen", source.key() == "task");
    for (key, fits, reason) in [
        (
            "too_many_agents",
            of_scen || of_task,
            "`too_many_agents` belongs to `scen` and `task`",
        ),
        ("map", of_scen, "`map` says where the maps of `scen` are"),
        ("views", of_task, "`views` are those of a `task`"),
        (
            "no_view",
            of_task,
            "`no_view` is about the views of a `task`",
        ),
        (
            "connectivity",
            !of_task,
            "`connectivity` belongs to the view of a task that is a grid",
        ),
    ] {
        if let Some(value) = table.get(key).filter(|_| !fits && source.key() != key) {
            return Err(value.error(reason));
        }
    }
    let too_many: Option<TooManyAgents> = table.optional("too_many_agents", Value::read)?;
    let teams = table.optional("agents", |value| {
        Ok(Teams {
            sizes: numbers(value, 1, MOST_AGENTS)?,
            place: value.place(),
            skip: too_many == Some(TooManyAgents::Skip),
        })
    })?;
    let kind = match source.key() {
        "scen" => Kind::Files {
            files: paths.paths(source)?,
            maps: match table.optional("map", |maps| paths.paths(maps))? {
                Some(maps) => maps.into_iter().map(|map| map.path).collect(),
                None => Vec::new(),
            },
        },
        "maze" => match &teams {
            Some(teams) => {
                let fault = teams.place.error("a maze of a series has one agent");
                return Err(fault.hint(
                    "leave out `agents`; `generate = { kind = \"maze\", … }` has random teams",
                ));
            }
            None => Kind::Mazes(mazes(source)?),
        },
        "task" => {
            for (fits, reason, hint) in [
                (
                    protocol.path_rule == PathRule::Steps,
                    "another path rule than `steps` is for grids with one agent",
                    "leave out `path_rule` in [protocol], or the task",
                ),
                (
                    protocol.clock != Clock::LessEmpty,
                    "empty calls, which the clock `call` leaves out, are made on maps alone",
                    "write another `clock` in [protocol], or leave out the task",
                ),
            ] {
                if !fits {
                    return Err(source.error(reason).hint(hint));
                }
            }
            let no_view: Option<NoView> = table.optional("no_view", Value::read)?;
            Kind::Tasks {
                tasks: paths.paths(source)?,
                views: view::views(&table.require("views")?)?,
                may_lack: no_view == Some(NoView::Fail),
            }
        }
        // How many agents there are is for the suite to say.
        other => {
            table.require("agents")?;
            match other {
                "map" => Kind::Maps(paths.paths(source)?),
                _ => Kind::Generated(generated(source)?),
            }
        }
    };
    Ok(InstanceSet {
        kind,
        teams,
        connectivity: moves.unwrap_or_else(|| vec![Connectivity::Four]),
        lifelong,
        place: table.place(),
    })
}

/// Width and height are at most so many; the map's size decides before.
const MOST_MAZE_CELLS: u64 = 1 << 15;

/// The maze paper's first seed.
const DEFAULT_BASE_SEED: u64 = 7;

fn mazes(table: &Value<'_>) -> Result<Mazes, InputError> {
    table.only(&[
        "algorithm",
        "size",
        "width",
        "height",
        "random",
        "seeds",
        "base_seed",
        "count",
    ])?;
    let sizes = match (table.get("size"), table.get("width"), table.get("height")) {
        (Some(size), None, None) => {
            let sizes = numbers(&size, 1, MOST_MAZE_CELLS)?;
            let square = |size| (size as u32, size as u32);
            sizes.iter().map(square).collect()
        }
        (Some(size), _, _) => {
            return Err(size.error("`size` is width and height, which are there as well"));
        }
        (None, None, None) => {
            let fault = table.error("the maze has no size");
            return Err(fault.hint("add `size = …`, or `width = …` and `height = …`"));
        }
        (None, _, _) => {
            let side = |key| table.require(key)?.whole(1, MOST_MAZE_CELLS);
            vec![(side("width")? as u32, side("height")? as u32)]
        }
    };
    let algorithms = table.optional("algorithm", |value| distinct(value, Value::read))?;
    Ok(Mazes {
        sizes,
        algorithms: algorithms.unwrap_or_else(|| vec![MazeAlgorithm::default()]),
        random: table.optional("random", Value::read)?.unwrap_or_default(),
        seeds: series_seeds(table)?,
        place: table.place(),
    })
}

fn series_seeds(table: &Value<'_>) -> Result<SeriesSeeds, InputError> {
    let seeds = table.get("seeds");
    if let Some(seeds) = seeds.as_ref().filter(|seeds| seeds.read::<&str>().is_err()) {
        for key in ["base_seed", "count"] {
            if let Some(other) = table.get(key) {
                let reason = format!("`{key}` belongs to a schedule, and `seeds` are numbers");
                return Err(other.error(reason));
            }
        }
        return Ok(SeriesSeeds::Numbers(numbers(seeds, 0, u64::MAX)?));
    }
    let schedule: Option<MazeSeeds> = seeds.as_ref().map(Value::read).transpose()?;
    let schedule = schedule.unwrap_or_default();
    let base = table.optional("base_seed", |base| base.whole(0, u64::MAX))?;
    let base = base.unwrap_or(DEFAULT_BASE_SEED);
    let given = table.require("count")?;
    let count = given.whole(1, MOST_INSTANCES)?;
    if schedule.seed(base, count - 1).is_none() {
        return Err(given.error("the last seeds are more than a seed can be"));
    }
    Ok(SeriesSeeds::Schedule {
        schedule,
        base,
        count,
    })
}

/// The kinds of maps that are made.
#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum MapKind {
    Empty,
    Random,
    Room,
    Maze,
    Warehouse,
}

fn generated(value: &Value<'_>) -> Result<Generated, InputError> {
    let kind = value.require("kind")?;
    let name: &str = kind.read()?;
    let kind: MapKind = kind.read()?;
    let random = !matches!(kind, MapKind::Empty | MapKind::Warehouse);
    let apart: &[&str] = if random {
        &["kind", "seeds", "scenario_seeds"]
    } else {
        &["kind", "scenario_seeds"]
    };
    let name = format!("`generate` of kind \"{name}\"");
    let table = value.clone().named(&name).apart(apart);
    let map = match kind {
        MapKind::Empty => MapSpec::Empty(table.read()?),
        MapKind::Random => MapSpec::Random(table.read()?),
        MapKind::Room => MapSpec::Room(table.read()?),
        MapKind::Maze => MapSpec::Maze(table.read()?),
        MapKind::Warehouse => MapSpec::Warehouse(table.read()?),
    };
    let seeds = |key| {
        let given = value.optional(key, |value| numbers(value, 0, u64::MAX))?;
        Ok(given.unwrap_or_else(|| Numbers::List(vec![1])))
    };
    Ok(Generated {
        map,
        map_seeds: random.then(|| seeds("seeds")).transpose()?,
        scenario_seeds: seeds("scenario_seeds")?,
        place: value.place(),
    })
}
