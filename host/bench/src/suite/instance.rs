//! One instance of a suite, made when it is asked for.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use fleetyard_core::{Connectivity, Digest, Grid, GridInstance, Hasher, InputError, Role};
use fleetyard_world::MazeAlgorithm;

use super::sets::{Loaded, Recipe};

/// The origin of starts and goals of fleets.
const LIFELONG: &str = "lifelong";

/// An instance of a suite, which is made when it is asked for, and its origin.
#[derive(Debug, Clone)]
pub struct SuiteInstance {
    recipe: Arc<Recipe>,
    base: u64,
    agents: u32,
    connectivity: Connectivity,
    /// True if starts and goals are drawn while a fleet drives.
    lifelong: bool,
    digest: OnceLock<Digest>,
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

impl SuiteInstance {
    pub(super) fn new(
        recipe: &Arc<Recipe>,
        base: u64,
        agents: u64,
        connectivity: Connectivity,
        lifelong: bool,
    ) -> Self {
        Self {
            recipe: Arc::clone(recipe),
            base,
            agents: u32::try_from(agents).unwrap_or(u32::MAX),
            connectivity,
            lifelong,
            digest: OnceLock::new(),
        }
    }

    /// An instance that was read from this file.
    pub fn of_file(path: impl Into<PathBuf>, instance: GridInstance) -> Self {
        let (agents, connectivity) = (instance.agents() as u64, instance.connectivity());
        let loaded = Loaded {
            path: path.into(),
            map: None,
            others: Vec::new(),
            instance: Arc::new(instance),
        };
        let recipe = Arc::new(Recipe::Loaded(vec![loaded]));
        Self::new(&recipe, 0, agents, connectivity, false)
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.agents as usize
    }

    /// Neighbours of a cell.
    pub fn connectivity(&self) -> Connectivity {
        self.connectivity
    }

    /// The instance's origin.
    pub fn origin(&self) -> Origin {
        let origin = self.recipe.origin(self.base);
        if self.lifelong {
            Origin {
                scenario: LIFELONG.to_owned(),
                ..origin
            }
        } else {
            origin
        }
    }

    /// The files of its map and its scenario, if it was read from two.
    pub fn files(&self) -> Option<[&Path; 2]> {
        self.recipe.files(self.base)
    }

    /// The files that it was read from, its map before its scenario; none of what is made.
    pub(crate) fn places(&self) -> Vec<&Path> {
        self.recipe.places(self.base)
    }

    /// The map.
    pub fn grid(&self) -> Result<Arc<Grid>, InputError> {
        self.recipe.grid(self.base)
    }

    /// The instance. Maps that were read are shared; what is generated is made anew unless
    /// the instance before was about the same map and scenario.
    pub fn grid_instance(&self) -> Result<GridInstance, InputError> {
        let base = self.recipe.base(self.base)?;
        let agents = self.agents();
        let first = |cells: &[u32]| cells[..agents.min(cells.len())].to_vec();
        let (starts, goals) = (first(base.starts()), first(base.goals()));
        let grid = Arc::clone(base.grid());
        let instance = GridInstance::new(grid, self.connectivity, starts, goals)
            .map_err(|error| InputError::new(self.to_string(), error.to_string()))?;
        let _ = self.digest.set(instance.digest());
        Ok(instance)
    }

    /// Digest of the instance, computed once; of a fleet's, which has no starts and goals yet,
    /// of its map with the roles of cells and of the number of agents.
    pub fn digest(&self) -> Result<Digest, InputError> {
        match self.digest.get() {
            Some(digest) => Ok(*digest),
            None if self.lifelong => {
                let grid = self.grid()?;
                let mut hasher = Hasher::new("fleetyard.fleet-instance/1");
                hasher.bytes(&grid.digest().0.to_le_bytes());
                for role in [Role::Endpoint, Role::Workstation] {
                    hasher.u32s(&grid.cells_with(role).collect::<Vec<_>>());
                }
                hasher.u64(self.agents.into());
                Ok(*self.digest.get_or_init(|| hasher.finish()))
            }
            None => Ok(self.grid_instance()?.digest()),
        }
    }
}

impl fmt::Display for SuiteInstance {
    /// Such as `random-32-32-20, random-32-32-20-random-1.scen, 10 agents`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Origin { map, scenario, .. } = self.origin();
        write!(f, "{map}, {scenario}, {} agent", self.agents)?;
        if self.agents != 1 {
            f.write_str("s")?;
        }
        match self.connectivity {
            Connectivity::Four => Ok(()),
            Connectivity::Eight => f.write_str(", 8-connected"),
        }
    }
}
