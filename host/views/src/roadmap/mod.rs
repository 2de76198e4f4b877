//! World to roadmap: vertices in the free space of the largest robot's disc, and straight edges along
//! which that disc can be swept.
//!
//! GRACE (section IV-B) draws vertices by OMPL, pins starts and goals, and leaves sizes, samplers and
//! distances open. Here these are parameters of a [`RoadmapSpec`], and a [`RoadmapReport`] says what
//! came of them.

mod connect;
mod given;
mod report;
mod sample;
mod tangent;

use core::fmt;

use fleetyard_core::{Digest, InputError, Roadmap, words};
use fleetyard_world::Travel;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use spade::{DelaunayTriangulation, Point2, Triangulation as _};

pub use given::given_roadmap;
pub use report::RoadmapReport;
pub(crate) use report::root;

use crate::origin::WORLD_TO_ROADMAP;
use crate::{Free, Origin, Problem, Representation, VIEW_FORMAT};
use connect::nearest_visible;

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

    /// The distance of drawn vertices that is asked for of a problem, in metres.
    pub(crate) fn spacing_m(&self, problem: &Problem) -> f64 {
        self.spacing_m.unwrap_or(2.0 * problem.common_radius_m())
    }

    /// The seed by which a problem's roadmap is drawn.
    pub(crate) fn seed(&self, problem: &Problem) -> u64 {
        self.seed.unwrap_or(problem.task.seed)
    }
}

/// A task on a roadmap.
#[derive(Debug, Clone)]
pub struct RoadmapView {
    /// Vertices and edges. Each that an operator makes can be driven both ways.
    pub roadmap: Roadmap,
    /// Start of every agent, a vertex at exactly the place that the task has.
    pub starts: Vec<u32>,
    /// Goal of every agent, likewise.
    pub goals: Vec<u32>,
    /// r_com: discs of this radius are planned for, in metres.
    pub radius_m: f64,
    /// The common speed ν, in m/s.
    pub speed_m_per_s: f64,
    /// Sizes, distances and connections.
    pub report: RoadmapReport,
    /// Operator, parameters and sources.
    pub origin: Origin,
}

impl RoadmapView {
    /// Origin of the view, and its starts and goals as vertices.
    pub fn about(&self) -> Value {
        json!({
            "format": VIEW_FORMAT,
            "representation": Representation::Roadmap,
            "origin": self.origin,
            "view_digest": self.digest(),
            "roadmap_digest": self.roadmap.digest(),
            "radius_m": self.radius_m,
            "speed_m_per_s": self.speed_m_per_s,
            "starts": self.starts,
            "goals": self.goals,
            "report": self.report,
        })
    }

    /// Digest of the roadmap with starts, goals, radius and speed.
    pub fn digest(&self) -> Digest {
        let mut hasher = fleetyard_core::Hasher::new("fleetyard.roadmap-view/1");
        let roadmap = self.roadmap.digest().0;
        hasher.u64(roadmap as u64);
        hasher.u64((roadmap >> 64) as u64);
        hasher.u32s(&self.starts);
        hasher.u32s(&self.goals);
        hasher.f64(self.radius_m);
        hasher.f64(self.speed_m_per_s);
        hasher.finish()
    }
}

/// Vertices and undirected edges while they are made.
#[derive(Debug, Default)]
struct Sketch {
    at_m: Vec<[f64; 2]>,
    edges: Vec<(u32, u32)>,
}

/// The roadmap of a problem's world, with starts and goals as vertices.
///
/// A start is one vertex with a goal at the same place. Refused are starts and goals at which a disc of
/// radius r_com is not free, and roadmaps on which an agent cannot reach its goal. Movers are left out.
pub fn world_to_roadmap(problem: &Problem, spec: RoadmapSpec) -> Result<RoadmapView, InputError> {
    let source = problem.task.source.as_str();
    let refuse = |reason: String, hint: &str| Err(InputError::new(source, reason).hint(hint));
    if let Err(what) = spec.builder.check() {
        let reason = format!("a roadmap cannot be made of {what}");
        return refuse(reason, "see `fleetyard world roadmap --help` for limits");
    }
    let radius_m = problem.common_radius_m();
    let spacing_m = spec.spacing_m(problem);
    if !(spacing_m.is_finite() && spacing_m >= 0.0) {
        let reason = format!("vertices cannot be {spacing_m} m apart");
        return refuse(reason, "give a distance in metres, or 0 for none");
    }
    let speed_m_per_s = common_speed(problem, spec.speed_m_per_s)?;
    let seed = spec.seed(problem);
    let free = Free::new(&problem.world);
    let Pinned {
        at_m,
        starts,
        goals,
    } = pin(problem, &free, radius_m)?;
    let pinned = at_m.len();
    let mut sketch = Sketch {
        at_m,
        edges: Vec::new(),
    };
    let mut achieved_m = None;
    let mut draw = |sketch: &mut Sketch, sampling, count| {
        let space = sample::Space {
            free: &free,
            radius_m,
            seed,
        };
        let drawn = space.draw(sampling, count, spacing_m, &mut sketch.at_m);
        let drawn = drawn.map_err(|reason| {
            InputError::new(source, reason)
                .hint("widen the passages of the world, or use smaller robots")
        })?;
        achieved_m = Some(drawn);
        Ok::<_, InputError>(())
    };
    match spec.builder {
        Builder::Prm {
            sampling,
            vertices,
            neighbors,
        } => {
            draw(&mut sketch, sampling, vertices)?;
            sketch.edges = nearest_visible(&sketch.at_m, 0, neighbors, &free, radius_m);
        }
        Builder::PrmStar { sampling, vertices } => {
            draw(&mut sketch, sampling, vertices)?;
            let neighbors = star_neighbors(sketch.at_m.len());
            sketch.edges = nearest_visible(&sketch.at_m, 0, neighbors, &free, radius_m);
        }
        Builder::Delaunay { sampling, vertices } => {
            draw(&mut sketch, sampling, vertices)?;
            sketch.edges = triangulate(&sketch.at_m).map_err(|reason| {
                InputError::new(source, reason).hint("move starts and goals away from the origin")
            })?;
            let at = &sketch.at_m;
            sketch
                .edges
                .retain(|(from, to)| free.sweeps(at[*from as usize], at[*to as usize], radius_m));
        }
        Builder::Lattice { side_m, directions } => {
            lattice(&mut sketch, &free, radius_m, side_m, directions).map_err(|reason| {
                InputError::new(source, reason).hint("give the lattice longer sides")
            })?;
            let near = nearest_visible(&sketch.at_m, pinned, directions as usize, &free, radius_m);
            sketch.edges.extend(near);
        }
        Builder::Tangent { sides } => {
            tangent::build(&mut sketch, &problem.world, &free, radius_m, sides).map_err(
                |reason| {
                    InputError::new(source, reason).hint("use fewer sides, or another builder")
                },
            )?;
        }
    }
    let Sketch { at_m, mut edges } = sketch;
    for edge in &mut edges {
        *edge = (edge.0.min(edge.1), edge.0.max(edge.1));
    }
    edges.sort_unstable();
    edges.dedup();
    let report = RoadmapReport::new(&at_m, &edges, achieved_m, &free, radius_m);
    if let Some(agent) = report.first_cut_off(&starts, &goals) {
        let [from, to] = [starts[agent], goals[agent]].map(|vertex| report.size_around(vertex));
        let reason = format!(
            "agent {agent} cannot reach its goal: the roadmap has {} parts, its start is in one of {from} \
             vertices, its goal in one of {to}",
            report.parts,
        );
        let hint = "use more vertices or neighbours, another seed, or the builder `tangent`, which misses no \
                    passage; if that one fails too, the largest robot does not fit through";
        return refuse(reason, hint);
    }
    let (x_m, y_m) = at_m.iter().map(|[x, y]| (*x, *y)).unzip();
    let both = edges
        .iter()
        .flat_map(|&(from, to)| [(from, to), (to, from)]);
    let roadmap =
        Roadmap::new(x_m, y_m, both).map_err(|error| InputError::new(source, error.to_string()))?;
    let parameters = json!({
        "builder": spec.builder,
        "spacing_m": spacing_m,
        "r_com_m": radius_m,
        "speed_m_per_s": speed_m_per_s,
    });
    Ok(RoadmapView {
        roadmap,
        starts,
        goals,
        radius_m,
        speed_m_per_s,
        report,
        origin: Origin::of(problem, WORLD_TO_ROADMAP, parameters, Some(seed)),
    })
}

/// The speed of all robots: the one that is asked for, or the largest that all have.
pub(crate) fn common_speed(
    problem: &Problem,
    asked_m_per_s: Option<f64>,
) -> Result<f64, InputError> {
    let speed_m_per_s = asked_m_per_s.unwrap_or_else(|| problem.common_speed_m_per_s());
    if speed_m_per_s.is_finite() && speed_m_per_s > 0.0 {
        return Ok(speed_m_per_s);
    }
    let reason = format!("robots on a roadmap need a speed, not {speed_m_per_s} m/s");
    Err(InputError::new(problem.task.source.as_str(), reason)
        .hint("give --speed, or robots a model with a largest speed"))
}

/// Starts and goals as vertices.
struct Pinned {
    at_m: Vec<[f64; 2]>,
    starts: Vec<u32>,
    goals: Vec<u32>,
}

fn pin(problem: &Problem, free: &Free, radius_m: f64) -> Result<Pinned, InputError> {
    let mut pinned = Pinned {
        at_m: Vec::new(),
        starts: Vec::new(),
        goals: Vec::new(),
    };
    let mut known = std::collections::BTreeMap::new();
    for (number, agent) in problem.task.agents.iter().enumerate() {
        for (end, state) in [(End::Start, agent.start), (End::Goal, agent.goal)] {
            let place = state.at_m();
            if !free.holds(place, radius_m) {
                let clearance = free.clearance_m(place);
                let reason = format!(
                    "the {end} of agent {number} at ({}, {}) is {clearance:.4} m from what stands there, but the \
                     roadmap is for discs of {radius_m:.4} m, the largest robot's",
                    place[0], place[1],
                );
                return Err(InputError::new(problem.task.source.as_str(), reason)
                    .hint("move it, or give the largest robot a smaller footprint"));
            }
            let next = pinned.at_m.len() as u32;
            let vertex = *known.entry(place.map(f64::to_bits)).or_insert(next);
            if vertex == next {
                pinned.at_m.push(place);
            }
            match end {
                End::Start => pinned.starts.push(vertex),
                End::Goal => pinned.goals.push(vertex),
            }
        }
    }
    Ok(pinned)
}

#[derive(Clone, Copy)]
enum End {
    Start,
    Goal,
}

impl fmt::Display for End {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Start => "start",
            Self::Goal => "goal",
        })
    }
}

impl Problem {
    /// The largest speed in m/s that every robot has in every direction.
    pub fn common_speed_m_per_s(&self) -> f64 {
        let speed = |agent: usize| match self.fleet.model(agent).dynamics().travel {
            Travel::Polar { speed, .. } | Travel::Axes { speed, .. } => speed,
            // Robots on a roadmap turn to where they go.
            Travel::Body { forward, .. } | Travel::Wheels { forward, .. } => forward,
        };
        (0..self.task.agents.len())
            .map(speed)
            .fold(f64::INFINITY, f64::min)
    }
}

/// Neighbours of PRM\* in the plane: k(n) = ⌈e·(1 + 1/2)·ln n⌉.
fn star_neighbors(vertices: usize) -> usize {
    let many = core::f64::consts::E * 1.5 * libm::log(vertices.max(2) as f64);
    many.ceil() as usize
}

fn triangulate(at_m: &[[f64; 2]]) -> Result<Vec<(u32, u32)>, String> {
    let points = at_m.iter().map(|[x, y]| Point2::new(*x, *y)).collect();
    let triangulation = DelaunayTriangulation::<Point2<f64>>::bulk_load_stable(points)
        .map_err(|error| format!("the vertices cannot be triangulated: {error}"))?;
    let edges = triangulation.undirected_edges();
    Ok(edges
        .map(|edge| edge.vertices().map(|vertex| vertex.fix().index() as u32))
        .map(|[from, to]| (from, to))
        .collect())
}

/// The directions of one quadrant, from (1, 0) on and without (0, 1): 1, 2, 4 or 8 of them. Each
/// doubling puts the sum of two neighbours between them.
fn quadrant(directions: u32) -> Vec<[i64; 2]> {
    let mut fan = vec![[1, 0], [0, 1]];
    while (fan.len() - 1) * 4 < directions as usize {
        let between = fan.windows(2).flat_map(|pair| {
            let [a, b] = [pair[0], pair[1]];
            [a, [a[0] + b[0], a[1] + b[1]]]
        });
        fan = between.chain([[0, 1]]).collect();
    }
    fan.pop();
    fan
}

fn lattice(
    sketch: &mut Sketch,
    free: &Free,
    radius_m: f64,
    side_m: f64,
    directions: u32,
) -> Result<(), String> {
    let bounds = free.bounds();
    let count = |axis: usize| {
        let room = bounds.max[axis] - bounds.min[axis] - 2.0 * radius_m;
        (room / side_m + 1e-9).floor() + 1.0
    };
    let (cols, rows) = (count(0), count(1));
    if cols * rows > ROADMAP_MOST_VERTICES as f64 {
        return Err(format!(
            "the lattice has {cols} by {rows} places, more than {ROADMAP_MOST_VERTICES}"
        ));
    }
    let (cols, rows) = (cols.max(0.0) as i64, rows.max(0.0) as i64);
    let place = |col: i64, row: i64| {
        let along = |axis: usize, number: i64| {
            (bounds.min[axis] + radius_m + number as f64 * side_m).min(bounds.max[axis] - radius_m)
        };
        [along(0, col), along(1, row)]
    };
    let taken: std::collections::BTreeMap<[u64; 2], u32> = (0..)
        .zip(&sketch.at_m)
        .map(|(vertex, at)| (at.map(f64::to_bits), vertex))
        .collect();
    let mut vertex_of = vec![None; (cols * rows) as usize];
    for row in 0..rows {
        for col in 0..cols {
            let at = place(col, row);
            let slot = &mut vertex_of[(row * cols + col) as usize];
            *slot = taken.get(&at.map(f64::to_bits)).copied();
            if slot.is_none() && free.holds(at, radius_m) {
                *slot = Some(sketch.at_m.len() as u32);
                sketch.at_m.push(at);
            }
        }
    }
    // Half of all directions: the other half is the way back.
    let quadrant = quadrant(directions);
    let turned = quadrant.iter().map(|[x, y]| [-y, *x]);
    let half: Vec<[i64; 2]> = quadrant.iter().copied().chain(turned).collect();
    for row in 0..rows {
        for col in 0..cols {
            let Some(from) = vertex_of[(row * cols + col) as usize] else {
                continue;
            };
            for [x, y] in &half {
                let (col, row) = (col + x, row + y);
                if !(0..cols).contains(&col) || !(0..rows).contains(&row) {
                    continue;
                }
                let Some(to) = vertex_of[(row * cols + col) as usize] else {
                    continue;
                };
                let [a, b] = [from, to].map(|vertex| sketch.at_m[vertex as usize]);
                if free.sweeps(a, b, radius_m) {
                    sketch.edges.push((from, to));
                }
            }
        }
    }
    Ok(())
}
