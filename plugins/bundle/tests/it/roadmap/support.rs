//! Problems from files, and a judge of paths that knows nothing of intervals.

#![allow(dead_code)]

use std::error::Error;
use std::fs;
use std::path::{Path as File, PathBuf};

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_roadmap::closeness::Closeness;
use fleetyard_plugin_roadmap::plan::{Path, cost};
use fleetyard_plugin_roadmap::priority::{Disc, Outcome, plan};
use fleetyard_plugin_roadmap::rest::Known;
use fleetyard_plugin_roadmap::roadmap::{Roadmap, Vertex};
use serde::Deserialize;

#[derive(Deserialize)]
struct Tasks {
    roadmap: String,
    radius_m: f64,
    speed_m_per_s: f64,
    starts: Vec<Vertex>,
    goals: Vec<Vertex>,
}

#[derive(Deserialize)]
struct Graph {
    directed: bool,
    vertices: Vec<[f64; 2]>,
    edges: Vec<[Vertex; 2]>,
}

/// A roadmap and the tasks of a team.
pub(crate) struct Case {
    pub(crate) roadmap: Roadmap,
    pub(crate) tasks: Vec<(Vertex, Vertex)>,
}

impl Case {
    /// The first `agents` tasks of a file.
    pub(crate) fn read(file: &File, agents: usize) -> Result<Self, Box<dyn Error>> {
        let tasks: Tasks = serde_json::from_str(&fs::read_to_string(file)?)?;
        let graph = file.parent().unwrap_or(File::new(".")).join(&tasks.roadmap);
        let graph: Graph = serde_json::from_str(&fs::read_to_string(graph)?)?;
        let places: Vec<Vector> = graph
            .vertices
            .iter()
            .map(|[x, y]| Vector::new(*x, *y))
            .collect();
        let seconds = |a: Vertex, b: Vertex| {
            (places[b as usize] - places[a as usize]).norm() / tasks.speed_m_per_s
        };
        let mut edges = Vec::new();
        for [a, b] in graph.edges {
            edges.push((a, b, seconds(a, b)));
            if !graph.directed {
                edges.push((b, a, seconds(a, b)));
            }
        }
        Ok(Self {
            roadmap: Roadmap::new(places, edges, 2.0 * tasks.radius_m)?,
            tasks: tasks
                .starts
                .into_iter()
                .zip(tasks.goals)
                .take(agents)
                .collect(),
        })
    }
}

/// A file of tasks of the shared data, where that is at hand.
pub(crate) fn shared(name: &str) -> Option<PathBuf> {
    let Some(data) = std::env::var_os("FLEETYARD_DATA") else {
        eprintln!("skipped: FLEETYARD_DATA is not set");
        return None;
    };
    let file = File::new(&data).join(format!("continuous/roadmap-tasks/{name}.tasks.json"));
    if !file.exists() {
        eprintln!("skipped: {} is not there", file.display());
        return None;
    }
    Some(file)
}

/// Position of a disc at a time.
pub(crate) fn position(roadmap: &Roadmap, path: &Path, time: f64) -> Vector {
    let at = path.partition_point(|visit| visit.arrival <= time).max(1) - 1;
    let visit = &path[at];
    let from = roadmap.place(visit.vertex);
    if time <= visit.departure || at + 1 == path.len() {
        return from;
    }
    let next = &path[at + 1];
    let part = (time - visit.departure) / (next.arrival - visit.departure);
    from + (roadmap.place(next.vertex) - from) * part
}

/// The least distance of two centres from one time to another. Between the times at which one of two discs sets out or
/// arrives their displacement is linear in time.
pub(crate) fn apart(roadmap: &Roadmap, a: &Path, b: &Path, from: f64, to: f64) -> f64 {
    let visits = a.iter().chain(b);
    let mut times: Vec<f64> = visits
        .flat_map(|visit| [visit.arrival, visit.departure])
        .collect();
    times.retain(|time| from < *time && *time < to);
    times.extend([from, to]);
    times.sort_by(f64::total_cmp);
    let part = |pair: &[f64]| {
        let offset = |time| position(roadmap, a, time) - position(roadmap, b, time);
        let (from, drift) = (offset(pair[0]), offset(pair[1]) - offset(pair[0]));
        let square = drift.norm_squared();
        let at = if square > 0.0 {
            (-from.dot(&drift) / square).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (from + drift * at).norm()
    };
    times.windows(2).map(part).fold(f64::INFINITY, f64::min)
}

/// The least distance of any two centres at any time.
pub(crate) fn least_distance(roadmap: &Roadmap, paths: &[Path]) -> f64 {
    let pairs = paths
        .iter()
        .enumerate()
        .flat_map(|(number, a)| paths[..number].iter().map(move |b| (a, b)));
    let apart = pairs.map(|(a, b)| apart(roadmap, a, b, 0.0, cost(a).max(cost(b)) + 1.0));
    apart.fold(f64::INFINITY, f64::min)
}

/// Discs with one goal each.
pub(crate) fn discs(tasks: &[(Vertex, Vertex)]) -> Vec<Disc> {
    let disc = |(start, goal): &(Vertex, Vertex)| Disc {
        start: *start,
        direction: None,
        goals: vec![*goal],
    };
    tasks.iter().map(disc).collect()
}

/// Whole paths from starts to goals, with at most so many orders.
pub(crate) fn planned(
    closeness: &Closeness,
    tasks: &[(Vertex, Vertex)],
    limit: u64,
    seed: u64,
) -> Outcome {
    let discs = discs(tasks);
    let team = (discs.as_slice(), f64::INFINITY);
    plan(
        closeness,
        &mut Known::default(),
        team,
        limit,
        seed,
        &mut || false,
    )
}
