//! Views of a task, and the files by which they are derived again.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use fleetyard_core::json::{self, read_object};
use fleetyard_core::{
    Connectivity, Digest, InputError, Roadmap, Separation, load_file, load_roadmap,
};
use serde::Deserialize;
use serde::de::{DeserializeOwned, Deserializer};

use crate::grid::neighbors;
use crate::origin::{WORLD_TO_GRID, WORLD_TO_ROADMAP};
use crate::{
    Builder, GridSpec, GridView, Problem, Representation, RoadmapSpec, RoadmapView, VIEW_FORMAT,
    given_roadmap, world_to_grid, world_to_roadmap,
};

/// Largest view file that is read, in bytes.
pub const VIEW_FILE_LIMIT: u64 = 1 << 28;

/// The operator that makes a view, with its parameters.
#[derive(Debug, Clone, PartialEq)]
pub enum ViewSpec {
    /// A grid.
    Grid(GridSpec),
    /// A roadmap.
    Roadmap(RoadmapSpec),
    /// A roadmap as it is.
    Given(Given),
    /// The world itself.
    Continuous,
}

/// A roadmap that was read from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Given {
    /// The file.
    pub path: PathBuf,
    /// Its content.
    pub roadmap: Arc<Roadmap>,
    /// The speed of all robots in metres per second, if it is not that of the slowest.
    pub speed_m_per_s: Option<f64>,
}

impl Given {
    /// Reads a roadmap file.
    pub fn load(path: PathBuf, speed_m_per_s: Option<f64>) -> Result<Self, InputError> {
        Ok(Self {
            roadmap: Arc::new(load_roadmap(&path)?),
            path,
            speed_m_per_s,
        })
    }
}

/// A task as planners of one representation are given it.
#[derive(Debug, Clone)]
pub enum View {
    /// A grid.
    Grid(Box<GridView>),
    /// A roadmap.
    Roadmap(Box<RoadmapView>),
    /// The world itself.
    Continuous,
}

impl ViewSpec {
    /// The kind of the view.
    pub fn representation(&self) -> Representation {
        match self {
            Self::Grid(_) => Representation::Grid,
            Self::Roadmap(_) | Self::Given(_) => Representation::Roadmap,
            Self::Continuous => Representation::Continuous,
        }
    }

    /// Derives the view from a task.
    pub fn derive(&self, problem: &Problem) -> Result<View, InputError> {
        Ok(match self {
            Self::Grid(spec) => View::Grid(Box::new(world_to_grid(problem, *spec)?)),
            Self::Roadmap(spec) => View::Roadmap(Box::new(world_to_roadmap(problem, *spec)?)),
            Self::Given(given) => {
                let roadmap = Roadmap::clone(&given.roadmap);
                let view = given_roadmap(problem, roadmap, given.speed_m_per_s)?;
                View::Roadmap(Box::new(view))
            }
            Self::Continuous => View::Continuous,
        })
    }
}

impl View {
    /// The kind of the view.
    pub fn representation(&self) -> Representation {
        match self {
            Self::Grid(_) => Representation::Grid,
            Self::Roadmap(_) => Representation::Roadmap,
            Self::Continuous => Representation::Continuous,
        }
    }

    /// Digest of the view of a problem: of its instance, if it is a grid.
    pub fn digest(&self, problem: &Problem) -> Digest {
        match self {
            Self::Grid(view) => view.instance.digest(),
            Self::Roadmap(view) => view.digest(),
            Self::Continuous => problem.digest(),
        }
    }
}

/// The content of a view file, `fleetyard.view/1`: operator, parameters and digests. What was derived
/// is not read but derived again, and has to come out the same.
#[derive(Debug, Clone, PartialEq)]
pub struct ViewFile {
    /// The file, for error messages.
    pub source: String,
    /// Operator and parameters.
    pub spec: ViewSpec,
    /// Digest of the problem from which the view was derived.
    pub problem_digest: Digest,
    /// Digest of the view.
    pub digest: Digest,
}

impl ViewFile {
    /// Derives the view from a task, which has to be the one that it was made of.
    pub fn derive(&self, problem: &Problem) -> Result<View, InputError> {
        let other = |what: &str, named: Digest, found: Digest, hint: String| {
            let reason = format!("the view is of {what} {named}, but this {what} is {found}");
            Err(InputError::new(self.source.as_str(), reason).hint(hint))
        };
        let task = &problem.task.source;
        let again = |name: &str| {
            let source = &self.source;
            format!(
                "name the task that {source} was made of, or make it again with `fleetyard world {name} {task}`"
            )
        };
        let name = match self.spec {
            ViewSpec::Roadmap(_) | ViewSpec::Given(_) => "roadmap",
            ViewSpec::Grid(_) | ViewSpec::Continuous => "grid",
        };
        if problem.digest() != self.problem_digest {
            return other(
                "problem",
                self.problem_digest,
                problem.digest(),
                again(name),
            );
        }
        let view = self.spec.derive(problem)?;
        let found = view.digest(problem);
        if found != self.digest {
            return other(name, self.digest, found, again(name));
        }
        Ok(view)
    }
}

/// Reads a view file.
pub fn load_view(path: impl AsRef<Path>) -> Result<ViewFile, InputError> {
    load_file(path, VIEW_FILE_LIMIT, read_view)
}

/// Parses the content of a view file. Errors name `source`. Keys that tell what came of the
/// parameters are passed over.
pub fn read_view(source: &str, bytes: &[u8]) -> Result<ViewFile, InputError> {
    let Head {
        format: (),
        representation,
        origin: Operator { operator },
    } = object(source, bytes)?;
    let of_task = match representation {
        Representation::Grid => WORLD_TO_GRID,
        Representation::Roadmap => WORLD_TO_ROADMAP,
        Representation::Continuous => operator.as_str(),
    };
    if operator != of_task {
        let reason =
            format!("the operator {operator:?} does not derive its view from a task alone");
        return Err(InputError::new(source, reason).hint(format!(
            "name a view of the operator {of_task:?}, or map or roadmap in place of the view"
        )));
    }
    match representation {
        Representation::Grid => {
            let Document {
                origin,
                digest: GridDigest { instance_digest },
            } = object(source, bytes)?;
            let GridParameters {
                neighbors: connectivity,
                separation,
            } = origin.parameters;
            Ok(ViewFile {
                source: source.to_owned(),
                spec: ViewSpec::Grid(GridSpec {
                    connectivity,
                    separation,
                }),
                problem_digest: origin.problem_digest,
                digest: instance_digest,
            })
        }
        Representation::Roadmap => {
            let Document {
                origin,
                digest: RoadmapDigest { view_digest },
            } = object(source, bytes)?;
            let RoadmapParameters {
                builder,
                spacing_m,
                speed_m_per_s,
            } = origin.parameters;
            Ok(ViewFile {
                source: source.to_owned(),
                spec: ViewSpec::Roadmap(RoadmapSpec {
                    builder,
                    spacing_m: Some(spacing_m),
                    seed: origin.seed,
                    speed_m_per_s: Some(speed_m_per_s),
                }),
                problem_digest: origin.problem_digest,
                digest: view_digest,
            })
        }
        Representation::Continuous => Err(InputError::new(
            source,
            "the continuous view of a task is the task itself",
        )
        .hint("name the task alone, with --representation continuous")),
    }
}

fn object<T: DeserializeOwned>(source: &str, bytes: &[u8]) -> Result<T, InputError> {
    let hint = "a view file is written by `fleetyard world grid` or `fleetyard world roadmap`, beside \
                the map or roadmap";
    read_object(source, bytes, hint).map_err(|error| error.or_hint(hint))
}

#[derive(Deserialize)]
#[serde(expecting = "a view: a JSON object")]
struct Head {
    #[serde(deserialize_with = "format")]
    format: (),
    representation: Representation,
    origin: Operator,
}

#[derive(Deserialize)]
#[serde(expecting = "the origin of a view: an object")]
struct Operator {
    operator: String,
}

fn format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    json::format(deserializer, VIEW_FORMAT)
}

#[derive(Deserialize)]
#[serde(expecting = "a view: a JSON object")]
struct Document<P, T> {
    origin: OriginDocument<P>,
    #[serde(flatten)]
    digest: T,
}

#[derive(Deserialize)]
#[serde(expecting = "the origin of a view: an object")]
struct OriginDocument<P> {
    parameters: P,
    seed: Option<u64>,
    problem_digest: Digest,
}

#[derive(Deserialize)]
struct GridDigest {
    instance_digest: Digest,
}

#[derive(Deserialize)]
struct RoadmapDigest {
    view_digest: Digest,
}

#[derive(Deserialize)]
#[serde(expecting = "the parameters of a grid: an object")]
struct GridParameters {
    #[serde(deserialize_with = "neighbors")]
    neighbors: Connectivity,
    separation: Separation,
}

#[derive(Deserialize)]
#[serde(expecting = "the parameters of a roadmap: an object")]
struct RoadmapParameters {
    builder: Builder,
    spacing_m: f64,
    speed_m_per_s: f64,
}
