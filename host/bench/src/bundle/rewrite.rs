//! The suite of a bundle: what the store's suite says, with paths into the bundle's folder.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

use fleetyard_core::InputError;
use serde_json::{Map, Value, json};

use super::manifest::name_fault;
use crate::options::Robots;
use crate::suite::{FleetSetup, Source, Sources, Suite};

type Result<T> = std::result::Result<T, InputError>;

/// Folder of the files of the world in the bundle.
const INPUTS: &str = "inputs";

/// Folder of the files of plugins in the bundle.
const PLUGINS: &str = "plugins";

/// A key of `[fleet]` that names a plugin, and that plugin as it was read.
type Module = (&'static str, fn(&FleetSetup) -> &str);

const MODULES: [Module; 3] = [
    ("generator", |setup| &setup.generator.plugin),
    ("invocation", |setup| &setup.invocation.plugin),
    ("fail_policy", |setup| &setup.fail_policy.plugin),
];

/// Gives every file a name in the bundle. Files that have to lie together do, and keep their names,
/// after which maps and scenarios are called.
#[derive(Default)]
pub(super) struct Names {
    /// By names in the bundle.
    pub(super) files: BTreeMap<String, PathBuf>,
    /// Files that lie together, by where they were.
    units: BTreeMap<Vec<(String, PathBuf)>, String>,
}

/// A file that goes into the bundle under a name, from the folder that it is put into.
type Unit = Vec<(String, PathBuf)>;

impl Names {
    /// Puts files into the first folder where nothing else has their names, and says which it is.
    fn put(&mut self, unit: Unit) -> Result<String> {
        if let Some(folder) = self.units.get(&unit) {
            return Ok(folder.clone());
        }
        let fits = |folder: &str| {
            unit.iter().all(|(name, source)| {
                let there = self.files.get(&format!("{folder}/{name}"));
                there.is_none_or(|there| there == source)
            })
        };
        let mut folder = INPUTS.to_owned();
        let mut number = 1;
        while !fits(&folder) {
            number += 1;
            folder = format!("{INPUTS}/{number}");
        }
        for (name, source) in &unit {
            let path = format!("{folder}/{name}");
            if let Some(fault) = name_fault(&path) {
                let reason = format!("the file {fault}, which a bundle cannot hold");
                return Err(InputError::new(source.display().to_string(), reason)
                    .hint("give it another name in the suite"));
            }
            self.files.insert(path, source.clone());
        }
        self.units.insert(unit, folder.clone());
        Ok(folder)
    }

    /// Puts one file, and says its name in the bundle.
    fn put_one(&mut self, source: &Path) -> Result<String> {
        let name = file_name(source)?;
        let folder = self.put(vec![(name.clone(), source.to_owned())])?;
        Ok(format!("{folder}/{name}"))
    }

    /// Puts a scenario or a task, and what has to lie beside it.
    fn put_source(&mut self, source: &Source, map_beside: bool, hint: &str) -> Result<String> {
        let name = file_name(&source.file)?;
        let mut unit = vec![(name.clone(), source.file.clone())];
        if let Some(map) = source.map.as_ref().filter(|_| map_beside) {
            unit.push((file_name(map)?, map.clone()));
        }
        let folder = source.file.parent().unwrap_or(Path::new(""));
        for other in &source.others {
            let inside = other.strip_prefix(folder).ok().filter(|inside| {
                let mut parts = inside.components();
                parts.all(|part| matches!(part, Component::Normal(_)))
            });
            let Some(inside) = inside.and_then(Path::to_str) else {
                let reason = format!("it names {}, which is not in its folder", other.display());
                return Err(InputError::new(source.file.display().to_string(), reason).hint(hint));
            };
            unit.push((inside.to_owned(), other.clone()));
        }
        let folder = self.put(unit)?;
        Ok(format!("{folder}/{name}"))
    }
}

pub(super) fn file_name(path: &Path) -> Result<String> {
    let name = path.file_name().and_then(std::ffi::OsStr::to_str);
    name.map(str::to_owned).ok_or_else(|| {
        let reason = "the file's name is no UTF-8 text, which a bundle cannot hold";
        InputError::new(path.display().to_string(), reason)
    })
}

/// A plugin's file and where it is in the bundle.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct PluginPlace {
    /// The folder in the bundle.
    pub(super) folder: String,
    /// The plugin's file, where the trials were made.
    pub(super) file: PathBuf,
    /// Its file in the bundle.
    pub(super) name: String,
}

/// The suite of a bundle, and the files that it names.
pub(super) struct Rewritten {
    /// As JSON.
    pub(super) values: Map<String, Value>,
    /// Files of plugins by the planners' labels.
    pub(super) planners: BTreeMap<String, PluginPlace>,
    /// Files of plugins of fleets.
    pub(super) modules: Vec<PluginPlace>,
}

/// Points the suite's paths into the bundle. `planners` are the files of planners by label, and
/// `ids` what these are called; planners that a path of files found are only pointed there where
/// their files come along (`plugins`).
pub(super) fn rewrite(
    suite: &Suite,
    sources: &[Sources],
    planners: &BTreeMap<String, PathBuf>,
    ids: &BTreeMap<String, String>,
    plugins: bool,
    names: &mut Names,
) -> Result<Rewritten> {
    let mut values = suite.values().clone();
    instances(&mut values, sources, names)?;
    if let Some(Robots::File(file, _)) = &suite.robots {
        let path = names.put_one(Path::new(file))?;
        if let Some(Value::Object(execution)) = values.get_mut("execution") {
            execution.insert("fleet".into(), path.into());
        }
    }
    let reads = &suite.sandbox.policy.read;
    if let Some(Value::Object(sandbox)) = values.get_mut("sandbox")
        && !reads.is_empty()
    {
        // Where they are is what planners are told: they stay where they are.
        let reads: Vec<PathBuf> = reads.iter().map(|path| whole(path)).collect();
        sandbox.insert("read".into(), json!(reads));
    }
    let mut found = Rewritten {
        values,
        planners: BTreeMap::new(),
        modules: Vec::new(),
    };
    let mut number = 0;
    let mut place = |file: &Path| -> Result<PluginPlace> {
        number += 1;
        let folder = format!("{PLUGINS}/{number}");
        let name = format!("{folder}/{}", file_name(file)?);
        Ok(PluginPlace {
            folder,
            file: file.to_owned(),
            name,
        })
    };
    // What all planners of fleets have in common is looked at beside them.
    let mut common = found.values.remove("fleet");
    let mut tables = one_or_more(found.values.get_mut("planner"));
    for (planner, table) in suite.planners.iter().zip(&mut tables) {
        let Value::Object(table) = table else {
            continue;
        };
        table.insert("label".into(), planner.label.clone().into());
        let by_path = planner.plugin.contains('/');
        if let Some(file) = planners.get(&planner.label).filter(|_| by_path || plugins) {
            let place = place(file)?;
            let plugin = match ids.get(&planner.label) {
                Some(id) => format!("{}:{id}", place.name),
                None => place.name.clone(),
            };
            table.insert("plugin".into(), plugin.into());
            found.planners.insert(planner.label.clone(), place);
        }
    }
    for (key, of) in MODULES {
        // Who has none of its own has that of all, which is read as each of theirs.
        let mut without = None;
        for (planner, table) in suite.planners.iter().zip(&mut tables) {
            let Some(setup) = &planner.fleet else {
                continue;
            };
            let read = of(setup);
            match table.get_mut("fleet").and_then(|own| own.get_mut(key)) {
                Some(own) => module(own, read, &mut found.modules, &mut place)?,
                None => without = Some(read),
            }
        }
        let said = common.as_mut().and_then(|all| all.get_mut(key));
        if let (Some(said), Some(read)) = (said, without) {
            module(said, read, &mut found.modules, &mut place)?;
        }
    }
    found
        .values
        .extend(common.map(|common| ("fleet".to_owned(), common)));
    Ok(found)
}

/// Points a plugin of a fleet into the bundle, if it is a file. One that several planners name is
/// one there. `read` is what the suite's reader made of it.
fn module(
    said: &mut Value,
    read: &str,
    modules: &mut Vec<PluginPlace>,
    place: &mut dyn FnMut(&Path) -> Result<PluginPlace>,
) -> Result<()> {
    let said = match said {
        Value::Object(table) => table.get_mut("plugin"),
        text => Some(text),
    };
    let Some(said) = said.filter(|_| read.contains('/')) else {
        return Ok(());
    };
    let (path, id) = match read.rsplit_once(':') {
        Some((path, id)) if !id.contains('/') => (path, Some(id)),
        _ => (read, None),
    };
    let known = modules.iter().find(|known| known.file == Path::new(path));
    let name = if let Some(known) = known {
        known.name.clone()
    } else {
        let new = place(Path::new(path))?;
        let name = new.name.clone();
        modules.push(new);
        name
    };
    *said = match id {
        Some(id) => format!("{name}:{id}").into(),
        None => name.into(),
    };
    Ok(())
}

pub(super) fn whole(path: &Path) -> PathBuf {
    std::path::absolute(path).unwrap_or_else(|_| path.to_owned())
}

/// A table or a list of tables.
fn one_or_more(value: Option<&mut Value>) -> Vec<&mut Value> {
    match value {
        Some(Value::Array(items)) => items.iter_mut().collect(),
        Some(one) => vec![one],
        None => Vec::new(),
    }
}

fn instances(
    values: &mut Map<String, Value>,
    sources: &[Sources],
    names: &mut Names,
) -> Result<()> {
    for (set, table) in sources.iter().zip(one_or_more(values.get_mut("instances"))) {
        let Value::Object(table) = table else {
            continue;
        };
        if set.made {
            continue;
        }
        if table.contains_key("task") {
            let hint = "put the files together, and name them from there in the task";
            let tasks = set.files.iter();
            let tasks = tasks.map(|task| names.put_source(task, false, hint));
            let tasks: Vec<String> = tasks.collect::<Result<_>>()?;
            table.insert("task".into(), json!(tasks));
            continue;
        }
        if !table.contains_key("scen") {
            let maps: Result<Vec<String>> = (set.files.iter())
                .map(|map| names.put_one(&map.file))
                .collect();
            table.insert("map".into(), json!(maps?));
            continue;
        }
        let mut scenarios = Vec::new();
        let mut maps: Vec<String> = Vec::new();
        for source in &set.files {
            let hint = "put the files together, or write the instance with `fleetyard convert`";
            scenarios.push(names.put_source(source, !set.maps_named, hint)?);
            if let Some(map) = source.map.as_ref().filter(|_| set.maps_named) {
                let map = names.put_one(map)?;
                if !maps.contains(&map) {
                    maps.push(map);
                }
            }
        }
        table.remove("map");
        if !maps.is_empty() {
            table.insert("map".into(), json!(maps));
        }
        table.insert("scen".into(), json!(scenarios));
    }
    // A set of which every team is larger than its scenario asks for nothing.
    if let Some(Value::Array(sets)) = values.get_mut("instances") {
        let mut at = 0;
        sets.retain(|_| {
            at += 1;
            let set = sources.get(at - 1);
            set.is_none_or(|set| set.made || !set.files.is_empty())
        });
    }
    Ok(())
}
