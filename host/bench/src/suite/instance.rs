//! One instance of a suite, made when it is asked for.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use fleetyard_check::PathRule;
use fleetyard_core::{Connectivity, Digest, Grid, GridInstance, Hasher, InputError, Role};
use fleetyard_views::{Problem, View};
use serde_json::Value;

use super::recipe::{Loaded, LoadedTask, Origin, Recipe, Tasks};
use super::view::{AskedView, SuiteView};
use crate::trial_instance::TrialInstance;

/// The origin of starts and goals of fleets.
const LIFELONG: &str = "lifelong";

/// An instance of a suite, which is made when it is asked for, and its origin.
#[derive(Debug, Clone)]
pub struct SuiteInstance {
    recipe: Arc<Recipe>,
    base: u64,
    agents: u32,
    /// Of a grid.
    connectivity: Option<Connectivity>,
    /// True if starts and goals are drawn while a fleet drives.
    lifelong: bool,
    digest: OnceLock<Digest>,
}

/// An instance as planners are asked it.
#[derive(Debug, Clone)]
pub enum Question {
    /// On a grid.
    Grid(GridInstance),
    /// A view of a task.
    View(Box<AskedView>),
}

impl Question {
    /// The instance of a trial, on a grid judged by a rule.
    pub fn trial(&self, path_rule: PathRule) -> TrialInstance<'_> {
        match self {
            Self::Grid(instance) => TrialInstance::Grid {
                instance,
                path_rule,
            },
            Self::View(asked) => TrialInstance::View {
                problem: &asked.problem,
                view: &asked.view,
                terms: asked.terms,
            },
        }
    }

    /// The cells, of a grid or of a view that is one.
    pub fn cells(&self) -> Option<&GridInstance> {
        match self {
            Self::Grid(instance) => Some(instance),
            Self::View(asked) => match &asked.view {
                View::Grid(view) => Some(&view.instance),
                View::Roadmap(_) | View::Continuous => None,
            },
        }
    }
}

impl SuiteInstance {
    pub(super) fn new(
        recipe: &Arc<Recipe>,
        base: u64,
        agents: u64,
        connectivity: Connectivity,
        lifelong: bool,
    ) -> Self {
        let view = recipe.view(base).map(|(_, view)| view);
        Self {
            recipe: Arc::clone(recipe),
            base,
            agents: u32::try_from(agents).unwrap_or(u32::MAX),
            connectivity: view.map_or(Some(connectivity), SuiteView::connectivity),
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

    /// Views of a task that was read from this file.
    pub fn of_task(
        path: impl Into<PathBuf>,
        problem: Problem,
        views: Vec<SuiteView>,
    ) -> impl Iterator<Item = Self> {
        let agents = problem.task.agents.len();
        let count = views.len() as u64;
        let task = LoadedTask {
            path: path.into(),
            others: Vec::new(),
            problem,
            agents,
        };
        let recipe = Arc::new(Recipe::Tasks(Tasks {
            files: vec![task],
            views,
            may_lack: false,
        }));
        (0..count)
            .map(move |base| Self::new(&recipe, base, agents as u64, Connectivity::Four, false))
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.agents as usize
    }

    /// Neighbours of a cell, of a grid.
    pub fn connectivity(&self) -> Option<Connectivity> {
        self.connectivity
    }

    /// The view, of a task.
    pub fn view(&self) -> Option<&SuiteView> {
        self.recipe.view(self.base).map(|(_, view)| view)
    }

    /// The file of the task, and the number of agents that this has.
    pub(crate) fn task(&self) -> Option<(&Path, usize)> {
        let (task, _) = self.recipe.view(self.base)?;
        Some((&task.path, task.problem.task.agents.len()))
    }

    /// The task with the instance's agents.
    pub(crate) fn problem(&self) -> Option<Problem> {
        let (task, _) = self.recipe.view(self.base)?;
        Some(task.problem.clone().first(self.agents()))
    }

    /// True if trials fail where the view cannot be derived.
    pub(crate) fn may_lack(&self) -> bool {
        self.recipe.may_lack()
    }

    /// The instance as planners are asked it: a view is derived anew.
    pub fn question(&self) -> Result<Question, InputError> {
        match (self.view(), self.problem()) {
            (Some(view), Some(problem)) => Ok(Question::View(Box::new(view.derive(problem)?))),
            _ => self.grid_instance().map(Question::Grid),
        }
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

    /// The map; a task has none.
    pub fn grid(&self) -> Result<Arc<Grid>, InputError> {
        self.recipe.grid(self.base)
    }

    /// The instance on a grid; a task is none. Maps that were read are shared; what is generated is made
    /// anew unless the instance before was about the same map and scenario.
    pub fn grid_instance(&self) -> Result<GridInstance, InputError> {
        let base = self.recipe.base(self.base)?;
        let agents = self.agents();
        let first = |cells: &[u32]| cells[..agents.min(cells.len())].to_vec();
        let (starts, goals) = (first(base.starts()), first(base.goals()));
        let grid = Arc::clone(base.grid());
        let connectivity = self.connectivity.unwrap_or(Connectivity::Four);
        let instance = GridInstance::new(grid, connectivity, starts, goals)
            .map_err(|error| InputError::new(self.to_string(), error.to_string()))?;
        let _ = self.digest.set(instance.digest());
        Ok(instance)
    }

    /// Digest of a view with its task and rules, or else of the reason why it cannot be derived where
    /// that is allowed.
    fn view_digest(&self, view: &SuiteView, problem: Problem) -> Result<Digest, InputError> {
        let mut hasher = Hasher::new("fleetyard.view-instance/1");
        hasher.bytes(&problem.digest().0.to_le_bytes());
        match view.derive(problem) {
            Ok(asked) => {
                let parameters = view.spec.parameters(&asked.problem, asked.terms);
                hasher.bytes(&asked.view.digest(&asked.problem).0.to_le_bytes());
                hasher.bytes(Value::Object(parameters).to_string().as_bytes());
            }
            Err(_) if self.may_lack() => view.hash(&mut hasher),
            Err(error) => {
                let hint =
                    "give other parameters, or write `no_view = \"fail\"` to count it as failed";
                return Err(view.place.error_in_file(error.or_hint(hint)));
            }
        }
        Ok(hasher.finish())
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
            None => match (self.view(), self.problem()) {
                (Some(view), Some(problem)) => {
                    let digest = self.view_digest(view, problem)?;
                    Ok(*self.digest.get_or_init(|| digest))
                }
                _ => Ok(self.grid_instance()?.digest()),
            },
        }
    }
}

impl fmt::Display for SuiteInstance {
    /// Such as `random-32-32-20, random-32-32-20-random-1.scen, 10 agents`, or `two rooms,
    /// two-rooms.task.json, 3 agents, view grid`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Origin { map, scenario, .. } = self.origin();
        write!(f, "{map}, {scenario}, {} agent", self.agents)?;
        if self.agents != 1 {
            f.write_str("s")?;
        }
        match (self.view(), self.connectivity) {
            (Some(view), _) => write!(f, ", view {}", view.label),
            (None, Some(Connectivity::Eight)) => f.write_str(", 8-connected"),
            (None, _) => Ok(()),
        }
    }
}
