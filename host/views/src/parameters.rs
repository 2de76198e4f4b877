//! Parameters of views by the names that the command line and suites give them.

use fleetyard_core::words;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::roadmap::common_speed;
use crate::{Builder, GridSpec, PlanTerms, Problem, RoadmapSpec, Sampling, ViewSpec};

/// The builders by their words.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum BuilderKind {
    /// [`Builder::Prm`].
    #[default]
    Prm,
    /// [`Builder::PrmStar`].
    PrmStar,
    /// [`Builder::Lattice`].
    Lattice,
    /// [`Builder::Delaunay`].
    Delaunay,
    /// [`Builder::Tangent`].
    Tangent,
}

words!(BuilderKind {
    Prm = "prm", "Drawn vertices, each joined with its nearest that it sees";
    PrmStar = "prm-star", "The same with as many neighbours as make shortest paths converge to the optimum";
    Lattice = "lattice", "A square lattice";
    Delaunay = "delaunay", "The Delaunay triangulation of drawn vertices";
    Tangent = "tangent", "Corners of obstacles and the lines that bend round them: misses no passage";
});

/// Parameters of a roadmap, with those of every builder, of which each has its own.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RoadmapParameters {
    /// The builder.
    #[serde(rename = "builder")]
    pub kind: BuilderKind,
    /// Drawn vertices, beside starts and goals.
    pub vertices: usize,
    /// Neighbours that a vertex is joined with.
    pub neighbors: usize,
    /// Origin of drawn vertices.
    pub sampling: Sampling,
    /// Distance of a lattice's neighbours in metres; a lattice needs one.
    #[serde(rename = "side", skip_serializing_if = "Option::is_none")]
    pub side_m: Option<f64>,
    /// Directions of a lattice's edges.
    pub directions: u32,
    /// Sides of the polygons that stand for circles round corners.
    pub sides: u32,
    /// Least distance of drawn vertices in metres; see [`RoadmapSpec`].
    #[serde(rename = "spacing", skip_serializing_if = "Option::is_none")]
    pub spacing_m: Option<f64>,
    /// Common speed in m/s; likewise.
    #[serde(rename = "speed", skip_serializing_if = "Option::is_none")]
    pub speed_m_per_s: Option<f64>,
    /// Seed of the drawing; likewise.
    #[serde(rename = "roadmap_seed", skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
}

impl Default for RoadmapParameters {
    fn default() -> Self {
        Self {
            kind: BuilderKind::default(),
            vertices: 900,
            neighbors: 9,
            sampling: Sampling::default(),
            side_m: None,
            directions: 8,
            sides: 16,
            spacing_m: None,
            speed_m_per_s: None,
            seed: None,
        }
    }
}

impl RoadmapParameters {
    /// The parameters of the operator.
    pub fn spec(self) -> RoadmapSpec {
        RoadmapSpec {
            builder: self.builder(),
            spacing_m: self.spacing_m,
            seed: self.seed,
            speed_m_per_s: self.speed_m_per_s,
        }
    }

    /// The builder with its own parameters; a lattice without a side is refused where it is made.
    pub fn builder(self) -> Builder {
        let Self {
            vertices, sampling, ..
        } = self;
        match self.kind {
            BuilderKind::Prm => Builder::Prm {
                sampling,
                vertices,
                neighbors: self.neighbors,
            },
            BuilderKind::PrmStar => Builder::PrmStar { sampling, vertices },
            BuilderKind::Delaunay => Builder::Delaunay { sampling, vertices },
            BuilderKind::Lattice => Builder::Lattice {
                side_m: self.side_m.unwrap_or(f64::NAN),
                directions: self.directions,
            },
            BuilderKind::Tangent => Builder::Tangent { sides: self.sides },
        }
    }
}

impl Builder {
    /// Kind and parameters by their names.
    fn parameters(self) -> Value {
        let drawn = |kind: BuilderKind, sampling: Sampling, vertices: usize| json!({"builder": kind, "vertices": vertices, "sampling": sampling});
        match self {
            Self::Prm {
                sampling,
                vertices,
                neighbors,
            } => {
                let mut all = drawn(BuilderKind::Prm, sampling, vertices);
                all["neighbors"] = json!(neighbors);
                all
            }
            Self::PrmStar { sampling, vertices } => drawn(BuilderKind::PrmStar, sampling, vertices),
            Self::Delaunay { sampling, vertices } => {
                drawn(BuilderKind::Delaunay, sampling, vertices)
            }
            Self::Lattice { side_m, directions } => {
                json!({"builder": BuilderKind::Lattice, "side": side_m, "directions": directions})
            }
            Self::Tangent { sides } => json!({"builder": BuilderKind::Tangent, "sides": sides}),
        }
    }
}

/// A view by a word: a grid, a roadmap of one of the presets, or the plane.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ViewName {
    /// A grid.
    Grid,
    /// The preset `S`.
    Sparse,
    /// The preset `D`.
    Dense,
    /// The preset `SD`.
    SuperDense,
    /// The plane.
    Continuous,
}

words!(ViewName {
    Grid = "grid", "The grid that the connectivity and the separation make";
    Sparse = "S", "A roadmap of 160 vertices with 5 neighbours";
    Dense = "D", "A roadmap of 900 vertices with 9 neighbours";
    SuperDense = "SD", "A roadmap of 4000 vertices with 14 neighbours";
    Continuous = "continuous", "The plane";
});

impl ViewName {
    /// The view, with the parameters that a grid has and the seed that a roadmap is drawn by.
    pub fn spec(self, grid: GridSpec, seed: Option<u64>) -> ViewSpec {
        match (self, Builder::preset(self.name())) {
            (Self::Grid, _) => ViewSpec::Grid(grid),
            (_, Some(builder)) => ViewSpec::Roadmap(RoadmapSpec {
                seed,
                ..RoadmapSpec::new(builder)
            }),
            _ => ViewSpec::Continuous,
        }
    }
}

impl ViewSpec {
    /// All parameters of the view of a problem, with those that follow from it, by the names that the
    /// command line gives them: so much derives the view again and judges its plans alike.
    pub fn parameters(&self, problem: &Problem, terms: PlanTerms) -> Map<String, Value> {
        let own = match self {
            Self::Grid(spec) => json!({
                "connectivity": spec.connectivity.degree(),
                "separation": terms.separation,
                "step": terms.step_s,
            }),
            Self::Roadmap(spec) => {
                let mut all = spec.builder.parameters();
                all["spacing"] = json!(spec.spacing_m(problem));
                all["speed"] = json!(common_speed(problem, spec.speed_m_per_s).ok());
                all["roadmap_seed"] = json!(spec.seed(problem));
                all["pace"] = json!(terms.pace);
                all
            }
            Self::Given(given) => json!({
                "roadmap": given.path,
                "speed": common_speed(problem, given.speed_m_per_s).ok(),
                "pace": terms.pace,
            }),
            Self::Continuous => json!({}),
        };
        let mut all = Map::new();
        if !matches!(self, Self::Given(_)) {
            all.insert("representation".into(), json!(self.representation()));
        }
        if let Value::Object(own) = own {
            all.extend(own);
        }
        all
    }
}
