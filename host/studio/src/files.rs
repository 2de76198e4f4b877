//! Documents and files: what is opened becomes a document, and a document is written as the files that
//! the command takes.
//!
//! Every file is read and written by the readers and writers of the command. A document is two files: its
//! ground, `NAME.world.json` or `NAME.map`, and its task, `NAME.task.json`.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use fleetyard_core::formats::{AgentList, Contents, Format, Known, Parts, Written, own_format};
use fleetyard_core::{
    Connectivity, Grid, GridInstance, InputError, MAP_FILE_LIMIT, Scenario, cell_center_m,
    cell_of_point, map_bytes, read_file, read_map, write_all_atomically, write_roadmap, write_scen,
};
use fleetyard_sim::motion::{FleetFile, read_fleet};
use fleetyard_views::{
    Agent, End, Fleets, Place, Problem, State, TASK_FILE_LIMIT, Task, read_task, write_task,
};
use fleetyard_world::{Workspace, read_workspace, write_workspace};
use serde_json::Value;

use crate::artefacts::Artefacts;
use crate::document::{
    Document, Ground, MOST_AGENTS, Tolerances, Views, check_map, check_world, too_many,
};
use crate::edit::Refusal;

/// A file that is to be opened.
#[derive(Debug, Clone)]
pub struct Source {
    /// Its name, without folders.
    pub name: String,
    /// Its content.
    pub bytes: Vec<u8>,
    /// Its folder, where files are that it names; none for a file that a page has sent.
    pub folder: Option<PathBuf>,
}

impl Source {
    /// Reads a file.
    pub fn load(path: &Path) -> Result<Self, InputError> {
        let bytes = read_file(path, MAP_FILE_LIMIT.min(TASK_FILE_LIMIT))?;
        let name = path.file_name().unwrap_or(path.as_os_str());
        Ok(Self {
            name: name.to_string_lossy().into_owned(),
            bytes,
            folder: Some(path.parent().unwrap_or(Path::new("")).to_owned()),
        })
    }

    /// The file in the words of errors.
    fn path(&self) -> PathBuf {
        match &self.folder {
            Some(folder) => folder.join(&self.name),
            None => PathBuf::from(&self.name),
        }
    }

    fn source(&self) -> String {
        self.path().display().to_string()
    }

    /// The path of a file on a disk.
    fn on_disk(&self) -> Option<PathBuf> {
        self.folder.is_some().then(|| self.path())
    }
}

/// The files of a document on a disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Files {
    /// The task.
    pub task: PathBuf,
    /// The world or the map.
    pub ground: PathBuf,
}

impl Files {
    /// Files in a folder, called after the document.
    pub fn within(folder: &Path, document: &Document) -> Self {
        Self {
            task: folder.join(task_file(document)),
            ground: folder.join(ground_file(document)),
        }
    }

    /// The ground as the task names it: from its folder on, or from the root where it is elsewhere.
    fn named_ground(&self) -> String {
        let folder = self.task.parent().unwrap_or(Path::new(""));
        let named = self.ground.strip_prefix(folder).map(Path::to_owned);
        let named = named.or_else(|_| std::path::absolute(&self.ground));
        let named = named.unwrap_or_else(|_| self.ground.clone());
        named.display().to_string()
    }

    /// Each of the files that would be replaced, and what it has to be now.
    fn expected(&self, document: &Document) -> [(&Path, Kind); 2] {
        let ground = match document.ground {
            Ground::World(_) => Kind::World,
            Ground::Map { .. } => Kind::Format(Format::Map),
        };
        [(&self.task, Kind::Task), (&self.ground, ground)]
    }

    /// True places of the files that are not in a folder or below it, as links and names with `..`
    /// lead out of it.
    pub fn outside(&self, folder: &Path) -> Vec<PathBuf> {
        let folder = real(folder);
        let places = [&self.task, &self.ground].map(|file| real(file));
        let mut outside: Vec<PathBuf> = Vec::from(places);
        outside.retain(|place| !place.starts_with(&folder));
        outside
    }

    /// Refuses to replace what is no earlier state of a file: a file of another format stays.
    pub fn check(&self, document: &Document) -> Result<(), InputError> {
        for (file, expected) in self.expected(document) {
            // What leads nowhere would be made where it leads.
            if file.symlink_metadata().is_err() {
                continue;
            }
            let name = file.file_name().unwrap_or_default().to_string_lossy();
            let found = read_file(file, MAP_FILE_LIMIT.min(TASK_FILE_LIMIT));
            let found = found.map(|bytes| Kind::of(&name, &bytes));
            if found.as_ref().is_ok_and(|found| *found == Some(expected)) {
                continue;
            }
            let reason = format!("this is no {}, and is not replaced", expected.in_words());
            return Err(InputError::new(file.display().to_string(), reason)
                .hint("save the document under another name"));
        }
        Ok(())
    }
}

/// A path without links and `..`, although its file need not be there.
fn real(path: &Path) -> PathBuf {
    let path = std::path::absolute(path).unwrap_or_else(|_| path.to_owned());
    let beside = || Some(path.parent()?.canonicalize().ok()?.join(path.file_name()?));
    path.canonicalize()
        .ok()
        .or_else(beside)
        .unwrap_or(path.clone())
}

/// A document that was opened.
#[derive(Debug, Clone)]
pub struct Opened {
    /// The document.
    pub document: Document,
    /// Parts of the files that are not kept.
    pub notes: Vec<String>,
    /// The files from which it was read, if they are a task with its ground on a disk.
    pub files: Option<Files>,
}

/// The kinds of files that are told apart by their content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Kind {
    /// `fleetyard.world/1`.
    World,
    /// `fleetyard.task/1`.
    Task,
    /// `fleetyard.fleet/1`.
    Fleet,
    /// A format of `fleetyard convert`.
    Format(Format),
}

impl Kind {
    /// The kind of a file; none if nobody knows it.
    pub fn of(name: &str, bytes: &[u8]) -> Option<Self> {
        match own_format(bytes) {
            Some(b"world") => Some(Self::World),
            Some(b"task") => Some(Self::Task),
            Some(b"fleet") => Some(Self::Fleet),
            _ => Format::guess(Path::new(name), bytes).map(Self::Format),
        }
    }

    /// The kind in words, after "no".
    fn in_words(self) -> String {
        match self {
            Self::World => "world of this project".to_owned(),
            Self::Task => "task of this project".to_owned(),
            Self::Fleet => "fleet of this project".to_owned(),
            Self::Format(format) => format!("file of the format `{}`", format.name()),
        }
    }

    /// True for a plan, on a grid, on a roadmap or in the plane.
    pub fn is_plan(self) -> bool {
        match self {
            Self::Format(format) => format.carries_plan() || format.carries_trajectories(),
            Self::World | Self::Task | Self::Fleet => false,
        }
    }
}

/// Makes a document of files that belong together: a task, a world or a map, starts and goals. What they
/// lack is taken from the files that a task names, if it is on a disk, and else from the ground of the
/// current document.
pub fn open(sources: &[Source], current: &Document) -> Result<Opened, InputError> {
    let mut given = Given::default();
    for source in sources {
        given.add(source)?;
    }
    match given.task.take() {
        Some((source, task)) => given.with_task(source, &task, sources, current),
        None => given.without_task(sources, current),
    }
}

#[derive(Default)]
struct Given<'a> {
    task: Option<(&'a Source, Task)>,
    /// With where it was read.
    world: Option<(&'a Source, Workspace)>,
    fleet: Option<FleetFile>,
    /// With where it was read.
    grid: Option<(&'a Source, Arc<Grid>)>,
    agents: Option<AgentList>,
    notes: Vec<String>,
}

impl<'a> Given<'a> {
    fn add(&mut self, source: &'a Source) -> Result<(), InputError> {
        let name = source.source();
        let refuse =
            |reason: String, hint: &str| Err(InputError::new(name.as_str(), reason).hint(hint));
        let is_second = match Kind::of(&source.name, &source.bytes) {
            Some(Kind::World) => {
                let world = read_workspace(&name, &source.bytes)?;
                self.world.replace((source, world)).is_some()
            }
            Some(Kind::Task) => {
                let task = read_task(&name, &source.bytes)?;
                self.task.replace((source, task)).is_some()
            }
            Some(Kind::Fleet) => {
                let fleet = read_fleet(&name, &source.bytes)?;
                self.fleet.replace(fleet).is_some()
            }
            Some(kind) if kind.is_plan() => {
                let hint =
                    "name the world or the map that it is for; plans are opened as recordings";
                return refuse("this is a plan, and no piece of ground".into(), hint);
            }
            Some(Kind::Format(Format::Lorr)) if source.folder.is_none() => {
                let hint = "name the file on the command line: `fleetyard studio FILE`";
                return refuse("the map is in another file, which is not here".into(), hint);
            }
            format => {
                let format = match format {
                    Some(Kind::Format(format)) => Some(format),
                    _ => None,
                };
                let Contents {
                    grid,
                    agents,
                    roadmap,
                    notes,
                    ..
                } = Contents::read(&source.path(), &source.bytes, format, Known::default())?;
                if roadmap.is_some() {
                    let hint = "make a grid of it: `fleetyard world grid TASK --roadmap FILE`";
                    return refuse("this is a roadmap, and no piece of ground".into(), hint);
                }
                self.notes.extend(notes);
                let grids = grid.is_some_and(|grid| self.grid.replace((source, grid)).is_some());
                let lists = agents.is_some_and(|list| self.agents.replace(list).is_some());
                grids || lists
            }
        };
        if is_second || (self.world.is_some() && self.grid.is_some()) {
            let hint = "open files together that make one document";
            return refuse("there is another file with the same content".into(), hint);
        }
        Ok(())
    }

    fn with_task(
        mut self,
        source: &Source,
        task: &Task,
        sources: &[Source],
        current: &Document,
    ) -> Result<Opened, InputError> {
        let missing = |file: &str| {
            let reason = format!("the task names {file}, which is not here");
            InputError::new(task.source.as_str(), reason).hint("open both files together")
        };
        let beside = |file: &str| source.folder.as_ref().map(|folder| folder.join(file));
        let named = |file: &str| {
            let name = Path::new(file).file_name();
            let is_it = |source: &&Source| name.is_some_and(|name| *name == *source.name);
            sources
                .iter()
                .find(is_it)
                .cloned()
                .map(Ok)
                .or_else(|| Some(Source::load(&beside(file)?)))
        };
        // The ground, and the file in which it is.
        let (ground, read) = match &task.place {
            Place::World(file) => match (self.world.take(), named(file)) {
                (Some((source, world)), _) => (world_ground(world), source.on_disk()),
                (None, Some(found)) => {
                    let found = found?;
                    let world = read_workspace(&found.source(), &found.bytes)?;
                    (world_ground(world), found.on_disk())
                }
                (None, None) => match &current.ground {
                    Ground::World(_) => (current.ground.clone(), None),
                    Ground::Map { .. } => return Err(missing(file)),
                },
            },
            Place::Map { file, cell_size_m } => {
                let (grid, read) = match (self.grid.take(), named(file), &current.ground) {
                    (Some((source, grid)), ..) => (grid, source.on_disk()),
                    (None, Some(found), _) => {
                        let found = found?;
                        let grid = read_map(&found.source(), &found.bytes)?;
                        (Arc::new(grid), found.on_disk())
                    }
                    (None, None, Ground::Map { grid, .. }) => (Arc::clone(grid), None),
                    (None, None, Ground::World(_)) => return Err(missing(file)),
                };
                (self.map_ground(&grid, *cell_size_m)?, read)
            }
        };
        let (robots, agents) = match &task.fleet {
            Fleets::Kinds(kinds) => (kinds.clone(), task.agents.clone()),
            Fleets::File(file) => {
                let fleet = match (self.fleet.take(), named(file)) {
                    (Some(fleet), _) => fleet,
                    (None, Some(found)) => {
                        let found = found?;
                        read_fleet(&found.source(), &found.bytes)?
                    }
                    (None, None) => return Err(missing(file)),
                };
                let dealt = fleet.fleet(task.agents.len()).map_err(|error| {
                    InputError::new(task.source.as_str(), error.to_string()).hint(error.hint())
                })?;
                let agents = task.agents.iter().zip(dealt.profile_of());
                let agents = agents.map(|(agent, robot)| Agent {
                    robot: *robot,
                    ..*agent
                });
                (fleet.profiles, agents.collect())
            }
        };
        // A task is saved where it was read, and its ground where that was read: the task may name anything.
        let files = source.on_disk().zip(read);
        let files = files.map(|(task, ground)| Files { task, ground });
        let document = Document {
            name: task.title().to_owned(),
            ground,
            robots: Arc::new(robots),
            agents: Arc::new(agents),
            tolerances: Tolerances::of(task),
            seed: task.seed,
            views: current.views,
        };
        self.opened(document, &task.source, files)
    }

    fn without_task(
        mut self,
        sources: &[Source],
        current: &Document,
    ) -> Result<Opened, InputError> {
        let first = sources.first().map_or_else(String::new, Source::source);
        if let Some((_, world)) = self.world.take() {
            let stem = sources.first().map_or("", |source| source.name.as_str());
            let stem = stem.trim_end_matches(".json").trim_end_matches(".world");
            let name = if world.name.is_empty() {
                stem.to_owned()
            } else {
                world.name.clone()
            };
            let document = Document {
                name,
                ground: world_ground(world),
                ..Document::default()
            };
            return self.opened(document, &first, None);
        }
        let mut document = match (self.grid.take(), &current.ground) {
            (Some((_, grid)), _) => {
                let cell_size_m = 1.0;
                Document {
                    name: grid.name().to_owned(),
                    ground: self.map_ground(&grid, cell_size_m)?,
                    robots: Arc::new(vec![Document::disc(0.5 * cell_size_m)]),
                    ..Document::default()
                }
            }
            (None, Ground::Map { .. }) => current.clone(),
            (None, Ground::World(_)) => {
                let reason = "there is no piece of ground in this file";
                let hint = "open it together with its map";
                return Err(InputError::new(first, reason).hint(hint));
            }
        };
        if let (Some(list), Ground::Map { grid, cell_size_m }) =
            (self.agents.take(), &document.ground)
        {
            let at = |cell: u32| resting(grid, *cell_size_m, cell);
            let instance = self.instance(&list, grid)?;
            let ends = instance.starts().iter().zip(instance.goals());
            let agents = ends.map(|(start, goal)| Agent {
                robot: 0,
                start: at(*start),
                goal: at(*goal),
            });
            document.agents = Arc::new(agents.collect());
        }
        self.opened(document, &first, None)
    }

    /// Starts and goals on a map: all, or the first so many that are an instance.
    fn instance(&mut self, list: &AgentList, grid: &Grid) -> Result<GridInstance, InputError> {
        let named = list.map_file.as_deref().unwrap_or_default();
        let stem = Path::new(named).file_stem().unwrap_or_default();
        // A map that was edited may have another name than the one that the list was made for.
        let name = stem.to_string_lossy().into_owned();
        let grid = Arc::new(renamed(
            grid,
            if named.is_empty() { grid.name() } else { &name },
        )?);
        let first =
            |agents: usize| list.instance(Arc::clone(&grid), Some(agents), Connectivity::Four);
        let all = list.agents.len().min(MOST_AGENTS);
        let error = match first(all) {
            Ok(instance) if all == list.agents.len() => return Ok(instance),
            Ok(_) => InputError::new("", format!("there are more than {MOST_AGENTS} agents")),
            Err(error) => error,
        };
        // The first agents of an instance are one too.
        let (mut good, mut bad) = (0, all + 1);
        while good + 1 < bad {
            let middle = usize::midpoint(good, bad);
            match first(middle) {
                Ok(_) => good = middle,
                Err(_) => bad = middle,
            }
        }
        if good == 0 {
            return Err(error);
        }
        let count = list.agents.len();
        let note = format!(
            "the first {good} of {count} agents are used: {}",
            error.reason
        );
        self.notes.push(note);
        first(good)
    }

    /// The ground of a map, without what a document does not keep.
    fn map_ground(&mut self, grid: &Arc<Grid>, cell_size_m: f64) -> Result<Ground, InputError> {
        let refuse = |refusal| refused(grid.name(), refusal);
        check_map(grid.rows(), grid.cols(), cell_size_m).map_err(refuse)?;
        let mut grid = Arc::clone(grid);
        if grid.has_move_masks() {
            self.notes.push(
                "moves that the map forbids are not kept: in the plane nothing forbids them".into(),
            );
            grid = Arc::new(renamed(&grid, grid.name())?);
        }
        Ok(Ground::Map { grid, cell_size_m })
    }

    fn opened(
        self,
        document: Document,
        source: &str,
        files: Option<Files>,
    ) -> Result<Opened, InputError> {
        if self.task.is_some() || self.world.is_some() || self.grid.is_some() {
            let reason = "there are more files than belong to one document";
            return Err(InputError::new(source, reason).hint("open one document at a time"));
        }
        check(&document).map_err(|refusal| refused(source, refusal))?;
        Ok(Opened {
            document,
            notes: self.notes,
            files,
        })
    }
}

/// A world as the ground of a document, which has the name.
fn world_ground(mut world: Workspace) -> Ground {
    world.name.clear();
    Ground::World(Arc::new(world))
}

/// Refuses a document that no edit could have made.
fn check(document: &Document) -> Result<(), Refusal> {
    document.clone().set_name(document.name.clone())?;
    if let Ground::World(world) = &document.ground {
        check_world(world)?;
    }
    document.check_robots()?;
    if document.agents.len() > MOST_AGENTS {
        return Err(too_many(
            "/agents",
            "agents",
            document.agents.len(),
            MOST_AGENTS,
        ));
    }
    document.check_places()
}

pub(crate) fn refused(source: &str, refusal: Refusal) -> InputError {
    InputError::new(source, refusal.error).hint(refusal.hint)
}

/// The document of a problem, whose files it does not have.
pub(crate) fn of_problem(problem: &Problem, views: Views) -> Result<Document, InputError> {
    let task = &problem.task;
    let ground = match (&problem.map, &task.place) {
        (Some(grid), Place::Map { cell_size_m, .. }) => Ground::Map {
            grid: Arc::new(renamed(grid, grid.name())?),
            cell_size_m: *cell_size_m,
        },
        _ => world_ground(problem.world.clone()),
    };
    let profiles = problem.fleet.profiles();
    let names: Vec<String> = match &task.fleet {
        Fleets::Kinds(kinds) if kinds.len() == profiles.len() => {
            kinds.iter().map(|(name, _)| name.clone()).collect()
        }
        _ => (0..profiles.len())
            .map(|number| format!("robot-{number}"))
            .collect(),
    };
    let agents = task.agents.iter().zip(problem.fleet.profile_of());
    let agents = agents.map(|(agent, robot)| Agent {
        robot: *robot,
        ..*agent
    });
    let document = Document {
        name: task.title().to_owned(),
        ground,
        robots: Arc::new(names.into_iter().zip(profiles.iter().cloned()).collect()),
        agents: Arc::new(agents.collect()),
        tolerances: Tolerances::of(task),
        seed: task.seed,
        views,
    };
    check(&document).map_err(|refusal| refused(&task.source, refusal))?;
    Ok(document)
}

/// The document of an instance on a map: discs as wide as its cells.
pub(crate) fn of_instance(
    instance: &GridInstance,
    cell_size_m: f64,
    notes: &mut Vec<String>,
) -> Result<Document, InputError> {
    let grid = instance.grid();
    let at = |cell: &u32| resting(grid, cell_size_m, *cell);
    let ends = instance.starts().iter().zip(instance.goals());
    let agents = ends.map(|(start, goal)| Agent {
        robot: 0,
        start: at(start),
        goal: at(goal),
    });
    let mut document = of_map(grid, cell_size_m, notes)?;
    document.agents = Arc::new(agents.collect());
    document.views.grid.connectivity = instance.connectivity();
    check(&document).map_err(|refusal| refused(grid.name(), refusal))?;
    Ok(document)
}

/// A document with a map and nobody on it.
pub(crate) fn of_map(
    grid: &Arc<Grid>,
    cell_size_m: f64,
    notes: &mut Vec<String>,
) -> Result<Document, InputError> {
    let mut given = Given::default();
    let document = Document {
        name: grid.name().to_owned(),
        ground: given.map_ground(grid, cell_size_m)?,
        robots: Arc::new(vec![Document::disc(0.5 * cell_size_m)]),
        ..Document::default()
    };
    notes.append(&mut given.notes);
    check(&document).map_err(|refusal| refused(grid.name(), refusal))?;
    Ok(document)
}

/// A robot that stands in the middle of a cell.
fn resting(grid: &Grid, cell_size_m: f64, cell: u32) -> State {
    let (x_m, y_m) = cell_center_m(grid, cell_size_m, cell);
    State {
        x_m,
        y_m,
        heading_rad: None,
        trailer_rad: None,
    }
}

/// The terrain of a map under another name.
fn renamed(grid: &Grid, name: &str) -> Result<Grid, InputError> {
    Grid::new(name, grid.rows(), grid.cols(), grid.terrain().to_vec())
}

/// The name of a document's files without their ends.
pub fn stem(document: &Document) -> String {
    let plain = |letter: char| letter.is_ascii_alphanumeric() || "._-".contains(letter);
    let words = document.name.split(|letter| !plain(letter));
    let words: Vec<&str> = words.filter(|word| !word.is_empty()).collect();
    let name: String = words.join("-").chars().take(60).collect();
    match name.trim_start_matches(['.', '-']) {
        "" => "document".to_owned(),
        name => name.to_owned(),
    }
}

/// The name of a document's task file.
pub fn task_file(document: &Document) -> String {
    format!("{}.task.json", stem(document))
}

/// The name of the file of a document's ground.
pub fn ground_file(document: &Document) -> String {
    match document.ground {
        Ground::World(_) => format!("{}.world.json", stem(document)),
        Ground::Map { .. } => format!("{}.map", stem(document)),
    }
}

/// The content of the file of a document's ground.
fn ground_bytes(document: &Document) -> Vec<u8> {
    match &document.ground {
        Ground::World(world) => write_workspace(&Workspace {
            name: document.name.clone(),
            ..Workspace::clone(world)
        }),
        Ground::Map { grid, .. } => map_bytes(grid),
    }
}

/// The content of a document's task file, in which its ground is in a file.
fn task_bytes(document: &Document, ground: &str) -> Result<Vec<u8>, InputError> {
    let task = document.task(ground);
    if task.agents.is_empty() {
        return Err(InputError::new(task.source, "there are no agents")
            .hint("give each a start and a goal; the ground can be written alone"));
    }
    Ok(write_task(&task))
}

/// Writes a document: the files with which the command is run, and which are opened again.
pub fn write(document: &Document, files: &Files) -> Result<(), InputError> {
    let task = task_bytes(document, &files.named_ground())?;
    let ground = ground_bytes(document);
    write_all_atomically(&[(&files.ground, &ground), (&files.task, &task)])
}

/// Writes a document for people who go on with it later, and says which files have it. A task needs robots: of
/// a document that has none yet, and no task file either, the ground alone is written.
pub fn save(document: &Document, files: &Files) -> Result<Vec<PathBuf>, InputError> {
    if document.agents.is_empty() && !files.task.exists() {
        write_all_atomically(&[(&files.ground, &ground_bytes(document))])?;
        return Ok(vec![files.ground.clone()]);
    }
    write(document, files)?;
    Ok(vec![files.task.clone(), files.ground.clone()])
}

/// A file that a document is written as, and those that belong to it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Exported {
    /// The name of the file.
    pub name: String,
    /// Its content.
    pub bytes: Vec<u8>,
    /// Names and contents of the others.
    pub others: Vec<(String, Vec<u8>)>,
}

/// The forms that a document is written in, each with a line about it.
pub fn exports() -> impl Iterator<Item = (&'static str, &'static str)> {
    let own = [
        ("task", "task of this project, with its world or map"),
        ("world", "world of this project, fleetyard.world/1"),
        (
            "grid-view",
            "map and scenario of the grid view, and how they came about",
        ),
        (
            "roadmap-view",
            "roadmap of the roadmap view, and how it came about",
        ),
    ];
    let formats = Format::ALL.iter().filter(|format| end(**format).is_some());
    own.into_iter()
        .chain(formats.map(|format| (format.name(), format.about())))
}

/// The end of a file's name by its format, if a document can be written in it.
fn end(format: Format) -> Option<&'static str> {
    Some(match format {
        Format::Map => "map",
        Format::Grid => "cells.json",
        Format::Lsmart => "lsmart.json",
        Format::Scen => "scen",
        Format::Pibt2 => "txt",
        Format::Lorr => "json",
        Format::Libmrp => "yaml",
        Format::Roadmap => "roadmap.json",
        Format::CcbsRoadmap => "xml",
        _ => return None,
    })
}

/// Writes a document in one of the forms of [`exports`]. Maps, scenarios and instances are of the
/// document's map; of a world they are of its grid view.
pub fn export(
    document: &Document,
    artefacts: &Artefacts,
    form: &str,
) -> Result<Exported, InputError> {
    let name = stem(document);
    let file = |name: String, bytes: Vec<u8>, others: Vec<(String, Vec<u8>)>| Exported {
        name,
        bytes,
        others,
    };
    match form {
        "task" => {
            let ground = ground_file(document);
            let task = task_bytes(document, &ground)?;
            let others = vec![(ground, ground_bytes(document))];
            Ok(file(task_file(document), task, others))
        }
        "world" => {
            let world = artefacts.world(document)?;
            let world = Workspace {
                name: document.name.clone(),
                ..Workspace::clone(&world.world)
            };
            Ok(file(
                format!("{name}.world.json"),
                write_workspace(&world),
                Vec::new(),
            ))
        }
        "grid-view" => {
            let view = artefacts.instance(document)?;
            let grid = view.instance.grid();
            let (map, scen) = (format!("{name}.map"), format!("{name}.scen"));
            let ends = view.instance.starts().iter().zip(view.instance.goals());
            let ends = ends.map(|(start, goal)| (*start, *goal));
            let scenario = write_scen(&Scenario::of(grid, &map, ends));
            let others = vec![(map, map_bytes(grid)), (scen, scenario)];
            Ok(file(
                format!("{name}.grid.json"),
                pretty(&view.about()),
                others,
            ))
        }
        "roadmap-view" => {
            let view = artefacts.roadmap(document)?;
            let others = vec![(format!("{name}.roadmap.json"), write_roadmap(&view.roadmap))];
            Ok(file(
                format!("{name}.view.json"),
                pretty(&view.about()),
                others,
            ))
        }
        _ => {
            let format = Format::by_name(form).and_then(|format| Some((format, end(format)?)));
            let Some((format, end)) = format else {
                let names: Vec<&str> = exports().map(|(name, _)| name).collect();
                let reason = "a document is not written in this form";
                return Err(
                    InputError::new("as", reason).hint(format!("forms are {}", names.join(", ")))
                );
            };
            let parts = parts(document, artefacts, format, &name)?;
            let Written { bytes, mut others } = parts.write(format, &name)?;
            // A scenario of another tool's instance comes with the map that it is on.
            if matches!(format, Format::Scen | Format::Pibt2) {
                let map = parts.write(Format::Map, &name)?;
                others.push((format!("{name}.map"), map.bytes));
            }
            Ok(file(format!("{name}.{end}"), bytes, others))
        }
    }
}

fn pretty(about: &Value) -> Vec<u8> {
    format!("{about:#}\n").into_bytes()
}

/// The parts of a document that a format needs.
fn parts(
    document: &Document,
    artefacts: &Artefacts,
    format: Format,
    name: &str,
) -> Result<Parts, InputError> {
    if format.carries_roadmap() {
        let view = artefacts.roadmap(document)?;
        return Ok(Parts {
            roadmap: Some(Arc::new(view.roadmap.clone())),
            ..Parts::default()
        });
    }
    let grid = match &document.ground {
        Ground::Map { grid, .. } => Arc::clone(grid),
        Ground::World(_) => Arc::clone(&artefacts.grid(document)?.grid),
    };
    let grid = Arc::new(renamed(&grid, name)?);
    let instance = if format.carries_agents() {
        let (connectivity, [starts, goals]) = match &document.ground {
            Ground::Map { cell_size_m, .. } => {
                let cells = |end: End| {
                    let agents = document.agents.iter().map(|agent| end.of(agent));
                    let cells = agents.map(|State { x_m, y_m, .. }| {
                        // The upper and the right edge belong to the last cells.
                        let [x, y] = [(x_m, grid.cols()), (y_m, grid.rows())]
                            .map(|(at, count)| at.min((f64::from(count) - 0.5) * cell_size_m));
                        cell_of_point(&grid, *cell_size_m, x, y).unwrap_or(0)
                    });
                    cells.collect()
                };
                let connectivity = document.views.grid.connectivity;
                (connectivity, [cells(End::Start), cells(End::Goal)])
            }
            Ground::World(_) => {
                let instance = &artefacts.instance(document)?.instance;
                let cells = [instance.starts().to_vec(), instance.goals().to_vec()];
                (instance.connectivity(), cells)
            }
        };
        let instance = GridInstance::new(Arc::clone(&grid), connectivity, starts, goals);
        let refuse = |error: fleetyard_core::InstanceError| {
            InputError::new(task_file(document), error.to_string())
                .hint("move starts and goals to free cells of their own, or snap them to the grid")
        };
        Some(instance.map_err(refuse)?)
    } else {
        None
    };
    Ok(Parts {
        map_file: Some(format!("{name}.map")),
        grid: Some(grid),
        instance,
        ..Parts::default()
    })
}
