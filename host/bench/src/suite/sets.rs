//! Sets of instances, before and after their files were read.

use std::collections::{BTreeMap, HashSet};
use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use fleetyard_check::PathRule;
use fleetyard_core::document::Place;
use fleetyard_core::formats::{Contents, Format, Known};
use fleetyard_core::{
    Connectivity, Digest, Grid, GridInstance, InputError, SCEN_FILE_LIMIT, find_map, load_map,
    read_file, read_scen,
};
use fleetyard_views::{Task, load_problem, load_task};

use super::instance::SuiteInstance;
use super::recipe::{Generated, Loaded, LoadedTask, Made, Mazes, Numbers, Recipe, Tasks};
use super::values::{MOST_INSTANCES, Named};
use super::view::SuiteView;

/// Team sizes.
#[derive(Debug, Clone)]
pub(super) struct Teams {
    pub(super) sizes: Numbers,
    pub(super) place: Place,
    /// Leave out what a scenario has too few agents for.
    pub(super) skip: bool,
}

/// `[[instances]]`: some bases, each with all team sizes and connectivities.
#[derive(Debug, Clone)]
pub(super) struct InstanceSet {
    pub(super) kind: Kind,
    /// `None` for as many as there are.
    pub(super) teams: Option<Teams>,
    pub(super) connectivity: Vec<Connectivity>,
    /// True if fleets drive there, whose starts and goals are drawn.
    pub(super) lifelong: bool,
    pub(super) place: Place,
}

impl InstanceSet {
    /// The files and folders that it names, with wildcards as they are.
    pub(super) fn named(&self) -> Vec<PathBuf> {
        let (named, maps) = self.kind.named();
        let named = named.iter().map(|named| named.path.clone());
        named.chain(maps.iter().cloned()).collect()
    }

    /// The files that it names; a folder of maps may hold anything.
    pub(super) fn files(&self) -> Result<Vec<PathBuf>, InputError> {
        let (named, maps) = self.kind.named();
        let mut files: Vec<PathBuf> = maps.iter().filter(|map| map.is_file()).cloned().collect();
        for named in named {
            for file in expand(named)? {
                if self.is_of_tasks() {
                    files.extend(files_of(&load_task(&file)?, &file));
                }
                files.push(file);
            }
        }
        Ok(files)
    }

    /// True if its instances are views of tasks.
    pub(super) fn is_of_tasks(&self) -> bool {
        matches!(self.kind, Kind::Tasks { .. })
    }
}

/// The files that a task names; `path` is its own.
fn files_of(task: &Task, path: &Path) -> Vec<PathBuf> {
    let folder = path.parent().unwrap_or(Path::new(""));
    task.files().map(|file| folder.join(file)).collect()
}

/// The bases of a set.
#[derive(Debug, Clone)]
pub(super) enum Kind {
    /// Files with starts and goals, and where their maps are.
    Files {
        files: Vec<Named>,
        maps: Vec<PathBuf>,
    },
    /// Maps on which fleets drive.
    Maps(Vec<Named>),
    /// Series of mazes with one agent each.
    Mazes(Mazes),
    /// Maps that are made, and scenarios of random starts and goals on them.
    Generated(Generated),
    /// Tasks, and the views of each that planners are asked.
    Tasks {
        tasks: Vec<Named>,
        views: Vec<SuiteView>,
        /// Trials of a view that cannot be derived fail, rather than the suite be refused.
        may_lack: bool,
    },
}

impl Kind {
    /// Files with starts and goals or maps of fleets, with wildcards, and where maps are.
    fn named(&self) -> (&[Named], &[PathBuf]) {
        match self {
            Self::Files { files, maps } => (files, maps),
            Self::Maps(named) | Self::Tasks { tasks: named, .. } => (named, &[]),
            Self::Mazes(_) | Self::Generated(_) => (&[], &[]),
        }
    }
}

/// Maps that were read already.
#[derive(Default)]
pub(super) struct Library(BTreeMap<PathBuf, Arc<Grid>>);

impl Library {
    fn map(&mut self, path: PathBuf) -> Result<Arc<Grid>, InputError> {
        if let Some(grid) = self.0.get(&path) {
            return Ok(Arc::clone(grid));
        }
        let grid = Arc::new(load_map(&path)?);
        self.0.insert(path, Arc::clone(&grid));
        Ok(grid)
    }
}

/// A set whose files were read.
pub(super) struct FoundSet<'s> {
    set: &'s InstanceSet,
    recipe: Arc<Recipe>,
}

/// The files of a set of instances.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Sources {
    /// True if its instances are made, and have no files.
    pub(crate) made: bool,
    /// True if the set says where the maps of its scenarios are.
    pub(crate) maps_named: bool,
    /// Scenarios, tasks, or the maps of fleets.
    pub(crate) files: Vec<Source>,
}

/// A file with starts and goals, a task, or the map of a fleet.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Source {
    pub(crate) file: PathBuf,
    /// Its map, if that is a file of its own.
    pub(crate) map: Option<PathBuf>,
    /// Other files that it names.
    pub(crate) others: Vec<PathBuf>,
}

impl InstanceSet {
    /// Reads the files of the set, and makes one of what is made.
    pub(super) fn find(&self, library: &mut Library) -> Result<FoundSet<'_>, InputError> {
        let recipe = match &self.kind {
            Kind::Files { files, maps } => {
                let mut loaded = Vec::new();
                for file in files {
                    for path in expand(file)? {
                        loaded.extend(self.load(file, path, maps, library)?);
                    }
                }
                Recipe::Loaded(loaded)
            }
            Kind::Maps(maps) => {
                let mut loaded = Vec::new();
                for map in maps {
                    for path in expand(map)? {
                        let blamed = |error| map.place.error_in_file(error);
                        let grid = library.map(path.clone()).map_err(blamed)?;
                        loaded.push((path, grid));
                    }
                }
                Recipe::Maps(loaded)
            }
            Kind::Tasks {
                tasks,
                views,
                may_lack,
            } => {
                let mut loaded = Vec::new();
                for task in tasks {
                    for path in expand(task)? {
                        loaded.extend(self.load_task(task, path)?);
                    }
                }
                Recipe::Tasks(Tasks {
                    files: loaded,
                    views: views.clone(),
                    may_lack: *may_lack,
                })
            }
            Kind::Mazes(mazes) => Recipe::made(Made::Mazes(mazes.clone())),
            Kind::Generated(generated) => {
                let most = self.teams.as_ref().map_or(0, |teams| teams.sizes.max());
                Recipe::made(Made::Generated {
                    generated: generated.clone(),
                    most: u32::try_from(most).unwrap_or(u32::MAX),
                })
            }
        };
        if matches!(recipe, Recipe::Made { .. }) {
            recipe.base(0)?;
        }
        Ok(FoundSet {
            set: self,
            recipe: Arc::new(recipe),
        })
    }

    /// The largest team that is asked for of a file with so many agents; nothing if all are larger, and
    /// that is allowed.
    fn most(&self, source: &str, has: usize) -> Result<Option<usize>, InputError> {
        let Some(teams) = &self.teams else {
            return Ok(Some(has));
        };
        let fits = |size: &u64| *size <= has as u64;
        match teams.sizes.iter().find(|size| !fits(size)) {
            Some(size) if !teams.skip => {
                let reason = format!("{size} agents asked for, but {source} has {has}");
                let hint =
                    format!("ask for at most {has} agents, or write `too_many_agents = \"skip\"`");
                Err(teams.place.error(reason).hint(hint))
            }
            _ => {
                let most = teams.sizes.iter().filter(fits).max();
                Ok(most.map(|most| most as usize))
            }
        }
    }

    /// A task with the largest team that is asked for; nothing if all are larger than it has, and that is
    /// allowed.
    fn load_task(&self, named: &Named, path: PathBuf) -> Result<Option<LoadedTask>, InputError> {
        let blamed = |error| named.place.error_in_file(error);
        let problem = load_problem(&path).map_err(blamed)?;
        let has = problem.task.agents.len();
        let Some(agents) = self.most(&path.display().to_string(), has)? else {
            return Ok(None);
        };
        Ok(Some(LoadedTask {
            others: files_of(&problem.task, &path),
            path,
            problem,
            agents,
        }))
    }

    /// The instance of a file with the largest team that is asked for; nothing if all are
    /// larger than it has, and that is allowed.
    fn load(
        &self,
        file: &Named,
        path: PathBuf,
        maps: &[PathBuf],
        library: &mut Library,
    ) -> Result<Option<Loaded>, InputError> {
        let source = path.display().to_string();
        let blamed = |error| file.place.error_in_file(error);
        let read = || -> Result<Parts, InputError> {
            let bytes = read_file(&path, SCEN_FILE_LIMIT)?;
            if Format::guess(&path, &bytes) == Some(Format::Scen) {
                let scenario = read_scen(&source, &bytes)?;
                return Ok(Parts::Scenario(scenario));
            }
            Contents::read(&path, &bytes, None, Known::default())
                .map(|contents| Parts::Other(Box::new(contents)))
        };
        let parts = read().map_err(blamed)?;
        let has = parts.agents().ok_or_else(|| {
            let formats = Format::ALL.iter().copied();
            let known: Vec<&str> = formats
                .filter(|format| format.carries_agents())
                .map(Format::name)
                .collect();
            let reason = format!("{source}: the file has no starts and goals");
            let hint = format!("formats that have them are {}", known.join(", "));
            file.place.error(reason).hint(hint)
        })?;
        let Some(agents) = self.most(&source, has)? else {
            return Ok(None);
        };
        let (map, grid) = if let Some(grid) = parts.grid() {
            (None, grid)
        } else {
            let nameless = || file.place.error(format!("{source}: the file names no map"));
            let name = parts.map_name().ok_or_else(nameless)?;
            let map = find_map(name, &path, maps, "`map`").map_err(blamed)?;
            (Some(map.clone()), library.map(map).map_err(blamed)?)
        };
        let instance = parts.instance(grid, agents).map_err(blamed)?;
        Ok(Some(Loaded {
            path,
            map,
            others: parts.files(),
            instance: Arc::new(instance),
        }))
    }
}

/// The content of a file of starts and goals.
enum Parts {
    /// Of which the size of the map is checked.
    Scenario(fleetyard_core::Scenario),
    Other(Box<Contents>),
}

impl Parts {
    fn agents(&self) -> Option<usize> {
        match self {
            Self::Scenario(scenario) => Some(scenario.entries.len()),
            Self::Other(contents) => contents.agents.as_ref().map(|list| list.agents.len()),
        }
    }

    fn grid(&self) -> Option<Arc<Grid>> {
        match self {
            Self::Scenario(_) => None,
            Self::Other(contents) => contents.grid.clone(),
        }
    }

    /// Files that were read besides the file itself and a map that it only names.
    fn files(&self) -> Vec<PathBuf> {
        match self {
            Self::Scenario(_) => Vec::new(),
            Self::Other(contents) => contents.files.clone(),
        }
    }

    fn map_name(&self) -> Option<&str> {
        match self {
            Self::Scenario(scenario) => scenario.map_name(),
            Self::Other(contents) => {
                let file = contents.agents.as_ref()?.map_file.as_deref()?;
                Path::new(file).file_stem()?.to_str()
            }
        }
    }

    fn instance(&self, grid: Arc<Grid>, agents: usize) -> Result<GridInstance, InputError> {
        // A suite stays what it is: a map under another name is another map here.
        match self {
            Self::Scenario(scenario) => {
                scenario.check_name(&grid)?;
                scenario.instance(grid, agents, Connectivity::Four)
            }
            Self::Other(contents) => match &contents.agents {
                Some(list) => {
                    list.check_name(&grid)?;
                    list.instance(grid, Some(agents), Connectivity::Four)
                }
                None => Err(InputError::new(
                    "agents",
                    "the file has no starts and goals",
                )),
            },
        }
    }
}

impl FoundSet<'_> {
    /// The files of the set, in the order of its instances; none of what is made.
    pub(super) fn sources(&self) -> Sources {
        let mut found = Vec::new();
        let mut maps_named = false;
        match &*self.recipe {
            Recipe::Loaded(loaded) => {
                if let Kind::Files { maps, .. } = &self.set.kind {
                    maps_named = !maps.is_empty();
                }
                found.extend(loaded.iter().map(|loaded| Source {
                    file: loaded.path.clone(),
                    map: loaded.map.clone(),
                    others: loaded.others.clone(),
                }));
            }
            Recipe::Maps(maps) => found.extend(maps.iter().map(|(file, _)| Source {
                file: file.clone(),
                map: None,
                others: Vec::new(),
            })),
            Recipe::Tasks(all) => found.extend(all.files.iter().map(|task| Source {
                file: task.path.clone(),
                map: None,
                others: task.others.clone(),
            })),
            Recipe::Made { .. } => {}
        }
        Sources {
            made: matches!(*self.recipe, Recipe::Made { .. }),
            maps_named,
            files: found,
        }
    }

    /// The most instances that there are; nothing if that is more than can be counted.
    pub(super) fn count(&self) -> Option<u64> {
        let teams = self.set.teams.as_ref();
        let teams = teams.map_or(1, |teams| teams.sizes.len());
        let each = teams.checked_mul(self.set.connectivity.len() as u64)?;
        self.recipe.bases()?.checked_mul(each)
    }

    /// Refuses a fleet with more robots than the map has cells for.
    fn check_room(&self, instance: &SuiteInstance) -> Result<(), InputError> {
        let free = instance.grid()?.passable_count();
        if instance.agents() as u64 <= u64::from(free) {
            return Ok(());
        }
        let place = self.set.teams.as_ref();
        let place = place.map_or(&self.set.place, |teams| &teams.place);
        let reason = format!("{instance}: the map has {free} free cells");
        Err(place
            .error(reason)
            .hint("ask for fewer agents, or name a larger map"))
    }

    /// Adds the instances of the set; two that are the same would be one in every table.
    pub(super) fn instances(
        &self,
        rule: PathRule,
        seen: &mut HashSet<(Digest, u64, Connectivity)>,
        instances: &mut Vec<SuiteInstance>,
    ) -> Result<(), InputError> {
        for base in 0..self.recipe.bases().unwrap_or(0) {
            let identity = self.recipe.identity(base);
            let team = self.recipe.team(base);
            let all = Numbers::List(vec![team.unwrap_or(1) as u64]);
            let teams = self.set.teams.as_ref();
            let sizes = teams.map_or(&all, |teams| &teams.sizes);
            for connectivity in &self.set.connectivity {
                for agents in sizes.iter() {
                    if team.is_some_and(|team| agents > team as u64) {
                        continue;
                    }
                    let lifelong = self.set.lifelong;
                    let instance =
                        SuiteInstance::new(&self.recipe, base, agents, *connectivity, lifelong);
                    if lifelong {
                        self.check_room(&instance)?;
                    }
                    if !rule.allows_agents(instance.agents()) {
                        let place = teams.map_or(&self.set.place, |teams| &teams.place);
                        let reason = format!("{instance}: path rule {rule} is for one agent");
                        let hint = "write `agents = 1`, or `path_rule = \"steps\"` in [protocol]";
                        return Err(place.error(reason).hint(hint));
                    }
                    if !seen.insert((identity, agents, *connectivity)) {
                        let reason = format!("the suite asks twice for {instance}");
                        return Err(self.set.place.error(reason).hint("remove one of them"));
                    }
                    instances.push(instance);
                }
            }
        }
        Ok(())
    }
}

/// The files that a path with wildcards stands for, in the order of their names. A part that is there as
/// it is written stands for itself, whatever letters it has.
fn expand(named: &Named) -> Result<Vec<PathBuf>, InputError> {
    let has_wildcards = |part: &OsStr| {
        let bytes = part.as_encoded_bytes();
        bytes.iter().any(|byte| b"*?[".contains(byte))
    };
    if !has_wildcards(named.path.as_os_str()) || named.path.exists() {
        return Ok(vec![named.path.clone()]);
    }
    let mut found = vec![PathBuf::new()];
    for part in &named.path {
        let mut next = Vec::new();
        for folder in &found {
            let written = folder.join(part);
            if !has_wildcards(part) || written.exists() {
                next.push(written);
                continue;
            }
            let names = matching(folder, &part.to_string_lossy());
            next.extend(names.into_iter().map(|name| folder.join(name)));
            if next.len() as u64 > MOST_INSTANCES {
                let reason = format!("more than {MOST_INSTANCES} files match");
                return Err(named.place.error(reason));
            }
        }
        found = next;
    }
    found.retain(|path| path.exists());
    if found.is_empty() {
        let reason = format!("no file matches {}", named.path.display());
        return Err(named.place.error(reason).hint(
            "`*` stands for any letters, `?` for one, `[abc]` and `[0-9]` for one of these",
        ));
    }
    Ok(found)
}

/// The names in a folder that a pattern stands for, in order. Brackets in which nothing matches are
/// letters: files have them in their names.
fn matching(folder: &Path, pattern: &str) -> Vec<String> {
    let listed = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let names: Vec<String> = fs::read_dir(listed)
        .into_iter()
        .flatten()
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| !name.starts_with('.') || pattern.starts_with('.'))
        .collect();
    let of = |pattern: &[Piece]| {
        let fitting = names.iter().filter(|name| matches(pattern, name));
        let mut fitting: Vec<String> = fitting.cloned().collect();
        fitting.sort_unstable();
        fitting
    };
    let by_sets = of(&pieces(pattern, true));
    if by_sets.is_empty() && pattern.contains('[') {
        return of(&pieces(pattern, false));
    }
    by_sets
}

/// A piece of a pattern.
enum Piece {
    /// Any letters.
    Any,
    /// One letter: any, or one that is in the ranges or, turned round, in none of them.
    One {
        ranges: Vec<(char, char)>,
        is_turned: bool,
    },
}

impl Piece {
    fn fits(&self, letter: char) -> bool {
        match self {
            Self::Any => false,
            Self::One { ranges, is_turned } => {
                let within = |(first, last): &(char, char)| (*first..=*last).contains(&letter);
                ranges.iter().any(within) != *is_turned
            }
        }
    }
}

/// The pieces of a pattern: `*`, `?` and, with `sets`, `[a-z]` and `[!a-z]`. A bracket that is not closed
/// is a letter.
fn pieces(pattern: &str, sets: bool) -> Vec<Piece> {
    let letters: Vec<char> = pattern.chars().collect();
    let mut pieces = Vec::new();
    let mut at = 0;
    while let Some(&letter) = letters.get(at) {
        at += 1;
        let (ranges, is_turned) = match letter {
            '*' => {
                pieces.push(Piece::Any);
                continue;
            }
            '?' => (Vec::new(), true),
            '[' if sets => {
                let is_turned = matches!(letters.get(at), Some('!' | '^'));
                let from = at + usize::from(is_turned);
                // One that comes first is in the set.
                let rest = letters.get(from + 1..).unwrap_or_default();
                match rest.iter().position(|letter| *letter == ']') {
                    Some(more) => {
                        at = from + more + 2;
                        (ranges(&letters[from..=from + more]), is_turned)
                    }
                    None => (vec![('[', '[')], false),
                }
            }
            letter => (vec![(letter, letter)], false),
        };
        pieces.push(Piece::One { ranges, is_turned });
    }
    pieces
}

/// The ranges of a set: `a-z` is one, any other letter one of its own.
fn ranges(set: &[char]) -> Vec<(char, char)> {
    let mut ranges = Vec::new();
    let mut left = set;
    loop {
        left = match left {
            [first, '-', last, rest @ ..] => {
                ranges.push((*first, *last));
                rest
            }
            [only, rest @ ..] => {
                ranges.push((*only, *only));
                rest
            }
            [] => return ranges,
        };
    }
}

/// True if a name matches a pattern.
fn matches(pattern: &[Piece], name: &str) -> bool {
    let name: Vec<char> = name.chars().collect();
    let (mut at, mut letter) = (0, 0);
    // The last `*`, and the letter up to which it reaches.
    let mut star: Option<(usize, usize)> = None;
    while letter < name.len() {
        match pattern.get(at) {
            Some(Piece::Any) => {
                star = Some((at, letter));
                at += 1;
            }
            Some(wanted) if wanted.fits(name[letter]) => {
                at += 1;
                letter += 1;
            }
            _ => match star {
                Some((from, reached)) => {
                    star = Some((from, reached + 1));
                    at = from + 1;
                    letter = reached + 1;
                }
                None => return false,
            },
        }
    }
    pattern[at..]
        .iter()
        .all(|piece| matches!(piece, Piece::Any))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wildcards() {
        let cases = [
            ("*", "", true),
            ("*.scen", "a.scen", true),
            ("*.scen", "a.scene", false),
            ("a*b*c", "aXbYbZc", true),
            ("a*b*c", "aXbYbZ", false),
            ("?-1?", "ä-12", true),
            ("?", "", false),
            ("**", "x", true),
            ("a-[13].scen", "a-3.scen", true),
            ("a-[13].scen", "a-2.scen", false),
            ("[a-c]*[!0-9]", "b7x", true),
            ("[a-c]*[!0-9]", "b77", false),
            ("[]-]", "]", true),
            ("[]-]", "-", true),
            ("[z", "[z", true),
        ];
        for (pattern, name, expected) in cases {
            assert_eq!(
                matches(&pieces(pattern, true), name),
                expected,
                "{pattern} {name}"
            );
        }
    }

    #[test]
    fn names_with_brackets_are_found_as_they_are_written() {
        let yard = tempfile::tempdir().expect("a folder");
        let folder = yard.path().join("runs [old] *");
        fs::create_dir(&folder).expect("made");
        for name in ["a[1].scen", "a[2].scen", "b1.scen", "b2.scen", "b3.scen"] {
            fs::write(folder.join(name), "").expect("written");
        }
        let found = |pattern: &str| -> Vec<String> {
            let named = Named {
                path: folder.join(pattern),
                place: Place::outside("scen"),
            };
            let found = expand(&named).expect("files");
            let names = found.iter().map(|path| path.strip_prefix(&folder));
            names
                .map(|name| name.expect("inside").display().to_string())
                .collect()
        };
        assert_eq!(found("a[1].scen"), ["a[1].scen"]);
        assert_eq!(found("a[*].scen"), ["a[1].scen", "a[2].scen"]);
        assert_eq!(found("a[*"), ["a[1].scen", "a[2].scen"]);
        assert_eq!(found("b[12].scen"), ["b1.scen", "b2.scen"]);
        assert_eq!(found("b[!2]*"), ["b1.scen", "b3.scen"]);
    }
}
