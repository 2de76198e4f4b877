//! World to roadmap: vertices in the free space of the largest robot's disc, and straight edges along
//! which that disc can be swept.
//!
//! GRACE (section IV-B) draws vertices by OMPL, pins starts and goals, and leaves sizes, samplers and
//! distances open. Here these are parameters of a [`RoadmapSpec`], and a [`RoadmapReport`] says what
//! came of them.

mod builder;
mod connect;
mod given;
mod lattice;
mod report;
mod sample;
mod sketch;
mod tangent;

use fleetyard_core::{Digest, InputError, Roadmap};
use fleetyard_world::Travel;
use serde_json::{Value, json};
use spade::{DelaunayTriangulation, Point2, Triangulation as _};

pub use builder::{Builder, ROADMAP_MOST_VERTICES, RoadmapSpec, Sampling};
pub use given::given_roadmap;
pub use report::RoadmapReport;
pub(crate) use report::root;

use crate::origin::WORLD_TO_ROADMAP;
use crate::{End, Free, Origin, Problem, Representation, VIEW_FORMAT};
use connect::nearest_visible;
use sketch::Sketch;

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

/// The roadmap of a problem's world, with starts and goals as vertices.
///
/// A start is one vertex with a goal at the same place. Refused are starts and goals at which a disc of
/// radius r_com is not free, and roadmaps on which an agent cannot reach its goal. Movers are left out.
pub fn world_to_roadmap(problem: &Problem, spec: RoadmapSpec) -> Result<RoadmapView, InputError> {
    let source = problem.task.source.as_str();
    let refuse = |reason: String, hint: &str| Err(InputError::new(source, reason).hint(hint));
    spec.check(source)?;
    let radius_m = problem.common_radius_m();
    let spacing_m = spec.spacing_m(problem);
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
            lattice::build(&mut sketch, &free, radius_m, side_m, directions).map_err(|reason| {
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
