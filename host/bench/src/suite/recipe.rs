//! The ways in which instances are made: read from files, generated, or views of tasks.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use fleetyard_core::document::Place;
use fleetyard_core::{Connectivity, Digest, Grid, GridInstance, Hasher, InputError};
use fleetyard_views::Problem;
use fleetyard_world::{MapSpec, MazeAlgorithm, MazeRandom, MazeSeeds, MazeSpec, ScenarioSpec};

use super::view::SuiteView;

/// Numbers of a suite file, all different.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Numbers {
    List(Vec<u64>),
    /// From the first on with equal steps; none is more than a number can be.
    Series {
        first: u64,
        step: u64,
        count: u64,
    },
}

impl Numbers {
    pub(super) fn len(&self) -> u64 {
        match self {
            Self::List(numbers) => numbers.len() as u64,
            Self::Series { count, .. } => *count,
        }
    }

    pub(super) fn get(&self, index: u64) -> u64 {
        match self {
            Self::List(numbers) => numbers[index as usize],
            Self::Series { first, step, .. } => first + step * index,
        }
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = u64> {
        (0..self.len()).map(|index| self.get(index))
    }

    pub(super) fn max(&self) -> u64 {
        self.iter().max().unwrap_or(0)
    }
}

/// Series of mazes: every size by every algorithm with every seed.
#[derive(Debug, Clone)]
pub(super) struct Mazes {
    /// Width and height.
    pub(super) sizes: Vec<(u32, u32)>,
    pub(super) algorithms: Vec<MazeAlgorithm>,
    pub(super) random: MazeRandom,
    pub(super) seeds: SeriesSeeds,
    pub(super) place: Place,
}

/// The seeds of a series.
#[derive(Debug, Clone)]
pub(super) enum SeriesSeeds {
    /// As the maze paper has them; none is more than a seed can be.
    Schedule {
        schedule: MazeSeeds,
        base: u64,
        count: u64,
    },
    Numbers(Numbers),
}

impl SeriesSeeds {
    fn len(&self) -> u64 {
        match self {
            Self::Schedule { count, .. } => *count,
            Self::Numbers(numbers) => numbers.len(),
        }
    }

    fn get(&self, index: u64) -> u64 {
        match self {
            // It is less than the last one, which is a seed.
            Self::Schedule { schedule, base, .. } => {
                schedule.seed(*base, index).unwrap_or(u64::MAX)
            }
            Self::Numbers(numbers) => numbers.get(index),
        }
    }
}

/// The parameters of random scenarios on generated maps.
#[derive(Debug, Clone)]
pub(super) struct Generated {
    /// With any seed.
    pub(super) map: MapSpec,
    /// `None` for maps in which nothing is random.
    pub(super) map_seeds: Option<Numbers>,
    pub(super) scenario_seeds: Numbers,
    pub(super) place: Place,
}

/// The origin of an instance.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Origin {
    /// Name of the map. Maps that differ by their seed have the same.
    pub map: String,
    /// The file of starts and goals, or the seeds that stand for them.
    pub scenario: String,
    /// The maze, if it is one of a series.
    pub maze: Option<MazeOrigin>,
}

/// A maze's place in a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MazeOrigin {
    /// Its number, from 0.
    pub index: u64,
    /// The seed that it was carved with.
    pub seed: u64,
    /// Cells of the maze from west to east.
    pub width: u32,
    /// Cells of the maze from north to south.
    pub height: u32,
    /// The algorithm that carved it.
    pub algorithm: MazeAlgorithm,
}

/// An instance that is there, with the largest team.
#[derive(Debug)]
pub(super) struct Loaded {
    pub(super) path: PathBuf,
    /// The file of its map, if it has one of its own.
    pub(super) map: Option<PathBuf>,
    /// Files that it names.
    pub(super) others: Vec<PathBuf>,
    pub(super) instance: Arc<GridInstance>,
}

/// A task that was read, with the largest team.
#[derive(Debug)]
pub(super) struct LoadedTask {
    pub(super) path: PathBuf,
    /// Files that it names.
    pub(super) others: Vec<PathBuf>,
    pub(super) problem: Problem,
    pub(super) agents: usize,
}

/// Tasks with their views: a base is a view of a task.
#[derive(Debug)]
pub(super) struct Tasks {
    pub(super) files: Vec<LoadedTask>,
    pub(super) views: Vec<SuiteView>,
    /// Trials of a view that cannot be derived fail, rather than the suite be refused.
    pub(super) may_lack: bool,
}

impl Tasks {
    /// Task and view of a base, view by view.
    pub(super) fn get(&self, base: u64) -> (&LoadedTask, &SuiteView) {
        let views = self.views.len();
        let base = base as usize;
        (&self.files[base / views], &self.views[base % views])
    }
}

/// The way in which the bases of a set are made. A base is an instance of the largest team; smaller
/// teams are its first agents.
#[derive(Debug)]
pub(super) enum Recipe {
    Loaded(Vec<Loaded>),
    /// Maps, whose agents are drawn while a fleet drives.
    Maps(Vec<(PathBuf, Arc<Grid>)>),
    Tasks(Tasks),
    Made {
        made: Made,
        /// The one that was made last: its instances follow each other.
        latest: Mutex<Option<(u64, Arc<GridInstance>)>>,
    },
}

/// Instances that are made when they are asked for.
#[derive(Debug)]
pub(super) enum Made {
    Mazes(Mazes),
    Generated { generated: Generated, most: u32 },
}

impl Made {
    fn bases(&self) -> Option<u64> {
        match self {
            Self::Mazes(mazes) => {
                let series = mazes.sizes.len() as u64 * mazes.algorithms.len() as u64;
                series.checked_mul(mazes.seeds.len())
            }
            Self::Generated { generated, .. } => {
                let maps = generated.map_seeds.as_ref().map_or(1, Numbers::len);
                maps.checked_mul(generated.scenario_seeds.len())
            }
        }
    }

    fn make(&self, base: u64) -> Result<GridInstance, InputError> {
        let (made, place) = match self {
            Self::Mazes(mazes) => {
                let made = mazes.spec(base).0.instance(Connectivity::Four);
                (made, &mazes.place)
            }
            Self::Generated { generated, most } => (generated.make(base, *most), &generated.place),
        };
        made.map_err(|error| {
            // The error's source is a parameter, which the reason names as well.
            InputError {
                hint: error.hint,
                ..place.error(error.reason)
            }
        })
    }

    fn origin(&self, base: u64) -> Origin {
        match self {
            Self::Mazes(mazes) => {
                let (spec, origin) = mazes.spec(base);
                let (rows, cols) = (spec.rows, spec.cols);
                Origin {
                    map: format!("maze-{rows}-{cols}-1-{}", spec.algorithm.name()),
                    scenario: format!("{} seed {}", mazes.random.name(), spec.seed),
                    maze: Some(origin),
                }
            }
            Self::Generated { generated, .. } => {
                let (map_seed, seed) = generated.seeds(base);
                let map = match &generated.map {
                    MapSpec::Maze(spec) => {
                        format!("{}-{}", generated.map.name(), spec.algorithm.name())
                    }
                    spec => spec.name(),
                };
                Origin {
                    map,
                    scenario: match map_seed {
                        Some(map_seed) => format!("{MAP_SEED}{map_seed}, agents seed {seed}"),
                        None => format!("agents seed {seed}"),
                    },
                    maze: None,
                }
            }
        }
    }
}

/// The seed of a generated map as its scenario has it, where the map has one.
pub(crate) fn map_seed_of(scenario: &str) -> Option<&str> {
    let (seed, _) = scenario.strip_prefix(MAP_SEED)?.split_once(", ")?;
    Some(seed)
}

/// The beginning of the scenario of a generated map.
const MAP_SEED: &str = "map seed ";

impl Mazes {
    /// A maze by its number in the set: size by size, algorithm by algorithm.
    fn spec(&self, base: u64) -> (MazeSpec, MazeOrigin) {
        let (series, index) = (base / self.seeds.len(), base % self.seeds.len());
        let algorithms = self.algorithms.len();
        let (width, height) = self.sizes[series as usize / algorithms];
        let algorithm = self.algorithms[series as usize % algorithms];
        let seed = self.seeds.get(index);
        let origin = MazeOrigin {
            index,
            seed,
            width,
            height,
            algorithm,
        };
        let spec = MazeSpec::lattice(height, width, algorithm, self.random, seed);
        (spec, origin)
    }
}

impl Generated {
    fn seeds(&self, base: u64) -> (Option<u64>, u64) {
        let scenarios = self.scenario_seeds.len();
        let map_seed = self.map_seeds.as_ref();
        (
            map_seed.map(|seeds| seeds.get(base / scenarios)),
            self.scenario_seeds.get(base % scenarios),
        )
    }

    fn make(&self, base: u64, agents: u32) -> Result<GridInstance, InputError> {
        let (map_seed, seed) = self.seeds(base);
        let mut spec = self.map.clone();
        if let Some(map_seed) = map_seed {
            match &mut spec {
                MapSpec::Random(spec) => spec.seed = map_seed,
                MapSpec::Room(spec) => spec.seed = map_seed,
                MapSpec::Maze(spec) => spec.seed = map_seed,
                MapSpec::Empty(_) | MapSpec::Warehouse(_) => {}
            }
        }
        let grid = Arc::new(spec.generate()?);
        let scenario = ScenarioSpec { agents, seed }.generate(&grid)?;
        scenario.instance(grid, agents as usize, Connectivity::Four)
    }
}

impl Recipe {
    pub(super) fn made(made: Made) -> Self {
        Self::Made {
            made,
            latest: Mutex::new(None),
        }
    }

    pub(super) fn bases(&self) -> Option<u64> {
        match self {
            Self::Loaded(loaded) => Some(loaded.len() as u64),
            Self::Maps(maps) => Some(maps.len() as u64),
            Self::Tasks(all) => (all.files.len() as u64).checked_mul(all.views.len() as u64),
            Self::Made { made, .. } => made.bases(),
        }
    }

    /// The largest team of a base, if it is known before it is made.
    pub(super) fn team(&self, base: u64) -> Option<usize> {
        match self {
            Self::Loaded(loaded) => Some(loaded[base as usize].instance.agents()),
            Self::Tasks(tasks) => Some(tasks.get(base).0.agents),
            Self::Maps(_) | Self::Made { .. } => None,
        }
    }

    pub(super) fn base(&self, base: u64) -> Result<Arc<GridInstance>, InputError> {
        match self {
            Self::Loaded(loaded) => Ok(Arc::clone(&loaded[base as usize].instance)),
            Self::Maps(_) => Err(InputError::new("map", "a map alone is no instance")),
            Self::Tasks(_) => Err(InputError::new("task", "a task is no instance on a grid")),
            Self::Made { made, latest } => {
                let mut latest = latest.lock().unwrap_or_else(PoisonError::into_inner);
                match &*latest {
                    Some((number, instance)) if *number == base => Ok(Arc::clone(instance)),
                    _ => {
                        let instance = Arc::new(made.make(base)?);
                        *latest = Some((base, Arc::clone(&instance)));
                        Ok(instance)
                    }
                }
            }
        }
    }

    /// The map of a base.
    pub(super) fn grid(&self, base: u64) -> Result<Arc<Grid>, InputError> {
        match self {
            Self::Maps(maps) => Ok(Arc::clone(&maps[base as usize].1)),
            _ => Ok(Arc::clone(self.base(base)?.grid())),
        }
    }

    /// Task and view of a base, if it is one.
    pub(super) fn view(&self, base: u64) -> Option<(&LoadedTask, &SuiteView)> {
        match self {
            Self::Tasks(tasks) => Some(tasks.get(base)),
            _ => None,
        }
    }

    /// True if trials of a view that cannot be derived fail, rather than the suite be refused.
    pub(super) fn may_lack(&self) -> bool {
        matches!(self, Self::Tasks(tasks) if tasks.may_lack)
    }

    pub(super) fn origin(&self, base: u64) -> Origin {
        let named = |path: &Path| {
            let file = path.file_name().unwrap_or(path.as_os_str());
            file.to_string_lossy().into_owned()
        };
        match self {
            Self::Tasks(tasks) => {
                let LoadedTask { path, problem, .. } = tasks.get(base).0;
                Origin {
                    map: problem.task.title().to_owned(),
                    scenario: named(path),
                    maze: None,
                }
            }
            Self::Maps(maps) => Origin {
                map: maps[base as usize].1.name().to_owned(),
                scenario: String::new(),
                maze: None,
            },
            Self::Loaded(loaded) => {
                let Loaded { path, instance, .. } = &loaded[base as usize];
                Origin {
                    map: instance.grid().name().to_owned(),
                    scenario: named(path),
                    maze: None,
                }
            }
            Self::Made { made, .. } => made.origin(base),
        }
    }

    /// The map and the scenario of a base, if each is a file.
    pub(super) fn files(&self, base: u64) -> Option<[&Path; 2]> {
        match self {
            Self::Loaded(loaded) => {
                let Loaded { path, map, .. } = &loaded[base as usize];
                Some([map.as_deref()?, path])
            }
            Self::Maps(_) | Self::Tasks(_) | Self::Made { .. } => None,
        }
    }

    /// The files of a base: of its map, if that has one, then of its starts and goals.
    pub(super) fn places(&self, base: u64) -> Vec<&Path> {
        match self {
            Self::Maps(maps) => vec![&maps[base as usize].0],
            Self::Loaded(loaded) => {
                let Loaded { path, map, .. } = &loaded[base as usize];
                map.iter().chain([path]).map(PathBuf::as_path).collect()
            }
            Self::Tasks(tasks) => {
                let LoadedTask { path, others, .. } = tasks.get(base).0;
                others.iter().chain([path]).map(PathBuf::as_path).collect()
            }
            Self::Made { .. } => Vec::new(),
        }
    }

    /// The identity of a base: equal ones have equal starts, goals and maps.
    pub(super) fn identity(&self, base: u64) -> Digest {
        let mut hasher = Hasher::new("fleetyard.base/2");
        match self {
            Self::Maps(maps) => {
                let path = &maps[base as usize].0;
                hasher.bytes(path.as_os_str().as_encoded_bytes());
            }
            Self::Loaded(loaded) => {
                let path = &loaded[base as usize].path;
                hasher.bytes(path.as_os_str().as_encoded_bytes());
            }
            Self::Tasks(tasks) => {
                let (task, view) = tasks.get(base);
                hasher.bytes(task.path.as_os_str().as_encoded_bytes());
                view.hash(&mut hasher);
            }
            Self::Made { made, .. } => match made {
                Made::Mazes(mazes) => {
                    hasher.value(&mazes.spec(base).0);
                }
                Made::Generated { generated, most } => {
                    let (map_seed, seed) = generated.seeds(base);
                    hasher.value(&(&generated.map, map_seed, seed, most));
                }
            },
        }
        hasher.finish()
    }
}
