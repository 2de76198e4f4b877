//! Parameters of roadmaps.

use fleetyard_core::{InputError, words};
use serde::{Deserialize, Serialize};

use crate::Problem;

/// Most vertices of a roadmap that an operator makes.
pub const ROADMAP_MOST_VERTICES: usize = 1 << 20;

/// Origin of the vertices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Sampling {
    /// Independent places, any equally likely.
    #[default]
    Uniform,
    /// The Halton sequence of bases 2 and 3, shifted by the seed (Cranley and Patterson 1976): places
    /// that fill space evenly.
    Halton,
}

words!(Sampling {
    Uniform = "uniform", "Independent places, any equally likely";
    Halton = "halton", "A Halton sequence, which fills space evenly, shifted by the seed";
});

/// The construction of a roadmap.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Builder {
    /// A probabilistic roadmap (Kavraki et al. 1996): drawn vertices, each with its nearest that it sees.
    Prm {
        /// The source of vertices.
        sampling: Sampling,
        /// Vertices beside starts and goals.
        vertices: usize,
        /// Neighbours that a vertex is joined with.
        neighbors: usize,
    },
    /// PRM\* (Karaman and Frazzoli 2011): the same with ⌈e·(1 + 1/2)·ln n⌉ neighbours, by which
    /// shortest paths converge to the optimum.
    PrmStar {
        /// The source of vertices.
        sampling: Sampling,
        /// Vertices beside starts and goals.
        vertices: usize,
    },
    /// A square lattice with moves in 4, 8, 16 or 32 directions (2ᵏ neighbourhoods, Rivera et al. 2020).
    Lattice {
        /// Distance of neighbours in metres.
        side_m: f64,
        /// 4, 8, 16 or 32.
        directions: u32,
    },
    /// The Delaunay triangulation of drawn vertices, starts and goals: short edges, none of which cross.
    Delaunay {
        /// The source of vertices.
        sampling: Sampling,
        /// Vertices beside starts and goals.
        vertices: usize,
    },
    /// Corners of obstacles, widened by the robot's radius, and the straight lines that bend round them:
    /// it has nearly shortest paths for one robot.
    Tangent {
        /// Sides of the polygon that stands for the circle round a corner, at least 4.
        sides: u32,
    },
}

/// Sizes of GRACE's three densities, which the paper does not publish.
const PRESETS: [(&str, usize, usize); 3] = [("S", 160, 5), ("D", 900, 9), ("SD", 4000, 14)];

impl Builder {
    /// One of the presets `S`, `D` and `SD`: uniform roadmaps of 160, 900 and 4000 vertices with 5, 9 and
    /// 14 neighbours.
    pub fn preset(name: &str) -> Option<Self> {
        let found = PRESETS.iter().find(|(known, ..)| *known == name)?;
        let &(_, vertices, neighbors) = found;
        let sampling = Sampling::Uniform;
        Some(Self::Prm {
            sampling,
            vertices,
            neighbors,
        })
    }

    /// The names of the presets.
    pub fn presets() -> impl Iterator<Item = &'static str> {
        PRESETS.iter().map(|(name, ..)| *name)
    }

    fn check(&self) -> Result<(), String> {
        let (vertices, least) = match *self {
            Self::Prm {
                vertices,
                neighbors,
                ..
            } => (vertices, neighbors),
            Self::PrmStar { vertices, .. } | Self::Delaunay { vertices, .. } => (vertices, 1),
            Self::Lattice { side_m, directions } => {
                if !(side_m.is_finite() && side_m > 0.0) {
                    return Err(format!("a lattice with sides of {side_m} m"));
                }
                if ![4, 8, 16, 32].contains(&directions) {
                    return Err(format!("a lattice with {directions} directions"));
                }
                (0, 1)
            }
            Self::Tangent { sides } => {
                if !(4..=256).contains(&sides) {
                    return Err(format!("circles of {sides} sides"));
                }
                (0, 1)
            }
        };
        if vertices > ROADMAP_MOST_VERTICES {
            return Err(format!(
                "{vertices} vertices, more than {ROADMAP_MOST_VERTICES}"
            ));
        }
        if least == 0 || least > 1024 {
            return Err(format!("{least} neighbours"));
        }
        Ok(())
    }
}

/// Parameters of a roadmap view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RoadmapSpec {
    /// The construction of vertices and edges.
    pub builder: Builder,
    /// Least distance of drawn vertices from each other and from starts and goals, in metres; 2·r_com if
    /// not given. Where so many vertices find no room, the distance shrinks, and the report says to what.
    pub spacing_m: Option<f64>,
    /// Seed of the drawing; the task's if not given.
    pub seed: Option<u64>,
    /// The common speed ν in m/s; if not given, the largest that every robot has in every direction.
    pub speed_m_per_s: Option<f64>,
}

impl RoadmapSpec {
    /// A builder with the usual distance, seed and speed.
    pub fn new(builder: Builder) -> Self {
        Self {
            builder,
            spacing_m: None,
            seed: None,
            speed_m_per_s: None,
        }
    }

    /// Refuses parameters of which no roadmap can be made, whatever the problem. `source` is named in
    /// errors.
    pub fn check(&self, source: &str) -> Result<(), InputError> {
        let refuse = |reason: String, hint: &str| Err(InputError::new(source, reason).hint(hint));
        if let Err(what) = self.builder.check() {
            let reason = format!("a roadmap cannot be made of {what}");
            return refuse(reason, "see `fleetyard world roadmap --help` for limits");
        }
        match self.spacing_m {
            Some(spacing_m) if !(spacing_m.is_finite() && spacing_m >= 0.0) => refuse(
                format!("vertices cannot be {spacing_m} m apart"),
                "give a distance in metres, or 0 for none",
            ),
            _ => Ok(()),
        }
    }

    /// The distance of drawn vertices that is asked for of a problem, in metres.
    pub(crate) fn spacing_m(&self, problem: &Problem) -> f64 {
        self.spacing_m.unwrap_or(2.0 * problem.common_radius_m())
    }

    /// The seed by which a problem's roadmap is drawn.
    pub(crate) fn seed(&self, problem: &Problem) -> u64 {
        self.seed.unwrap_or(problem.task.seed)
    }
}
