//! Sizes, distances and connections of a roadmap.

use serde::Serialize;

use super::connect;
use super::sample::halton;
use crate::Free;

/// Places at which coverage is tried.
const PROBES: u64 = 1000;

/// Nearest vertices that a place may see to count as covered.
const COVERING: usize = 8;

/// Properties of the roadmap that a builder made.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct RoadmapReport {
    /// Number of vertices, starts and goals included.
    pub vertices: usize,
    /// Number of edges, of which each can be driven both ways.
    pub edges: usize,
    /// Connected parts; a vertex without edges is one.
    pub parts: usize,
    /// Vertices of the largest part.
    pub largest_part: usize,
    /// Least distance that drawn vertices had to keep, in metres; none where nothing was drawn.
    pub spacing_m: Option<f64>,
    /// Pairs of vertices that are nearer than 2·r_com: a robot that rests on one blocks the other.
    pub close_pairs: usize,
    /// Share of the free places from which one of the eight nearest vertices can be reached straight,
    /// measured at 1000 places of a Halton sequence; none where none of these is free.
    pub coverage: Option<f64>,
    /// Mean length of edges in metres; 0 without edges.
    pub mean_edge_m: f64,
    /// Per vertex the number of its part, and per part its vertices.
    #[serde(skip)]
    part_of: Vec<u32>,
    #[serde(skip)]
    sizes: Vec<usize>,
}

impl RoadmapReport {
    pub(super) fn new(
        at_m: &[[f64; 2]],
        edges: &[(u32, u32)],
        spacing_m: Option<f64>,
        free: &Free,
        radius_m: f64,
    ) -> Self {
        let (part_of, sizes) = parts(at_m.len(), edges);
        let index = connect::index(at_m);
        // A thousandth of a contact is none.
        let reach = 2.0 * radius_m - crate::FREE_SLACK_M;
        let close_pairs = (0..)
            .zip(at_m)
            .map(|(vertex, at): (u32, _)| {
                let near = index.locate_within_distance(*at, reach * reach);
                near.filter(|other| other.data > vertex).count()
            })
            .sum();
        let bounds = free.bounds();
        let places = (1..=PROBES).map(|number| {
            let share = halton(number);
            [0, 1]
                .map(|axis| bounds.min[axis] + share[axis] * (bounds.max[axis] - bounds.min[axis]))
        });
        let places: Vec<[f64; 2]> = places.filter(|at| free.holds(*at, radius_m)).collect();
        let sees = |at: &&[f64; 2]| {
            let mut near = index.nearest_neighbor_iter(*at).take(COVERING);
            near.any(|other| free.sweeps(**at, *other.geom(), radius_m))
        };
        let covered = places.iter().filter(sees).count();
        let coverage = (!places.is_empty()).then(|| covered as f64 / places.len() as f64);
        let lengths = edges.iter().map(|(from, to)| {
            let [a, b] = [*from, *to].map(|vertex| at_m[vertex as usize]);
            let (x, y) = (a[0] - b[0], a[1] - b[1]);
            (x * x + y * y).sqrt()
        });
        Self {
            vertices: at_m.len(),
            edges: edges.len(),
            parts: sizes.len(),
            largest_part: sizes.iter().copied().max().unwrap_or(0),
            spacing_m,
            close_pairs,
            coverage,
            mean_edge_m: lengths.sum::<f64>() / edges.len().max(1) as f64,
            part_of,
            sizes,
        }
    }

    /// The first agent whose goal is in another part than its start.
    pub(super) fn first_cut_off(&self, starts: &[u32], goals: &[u32]) -> Option<usize> {
        let part = |vertex: &u32| self.part_of[*vertex as usize];
        let mut ends = starts.iter().zip(goals);
        ends.position(|(start, goal)| part(start) != part(goal))
    }

    /// Number of vertices that can be reached from one, itself included. The vertex must exist.
    pub fn size_around(&self, vertex: u32) -> usize {
        self.sizes[self.part_of[vertex as usize] as usize]
    }
}

/// Per vertex the number of its part, by first vertices, and the sizes of parts.
fn parts(vertices: usize, edges: &[(u32, u32)]) -> (Vec<u32>, Vec<usize>) {
    let mut parent: Vec<u32> = (0..vertices as u32).collect();
    for (from, to) in edges {
        let (a, b) = (root(&mut parent, *from), root(&mut parent, *to));
        parent[a.max(b) as usize] = a.min(b);
    }
    let (mut part_of, mut sizes) = (vec![0; vertices], Vec::new());
    for vertex in 0..vertices as u32 {
        let first = root(&mut parent, vertex);
        if first == vertex {
            part_of[vertex as usize] = sizes.len() as u32;
            sizes.push(0);
        }
        let part = part_of[first as usize];
        part_of[vertex as usize] = part;
        sizes[part as usize] += 1;
    }
    (part_of, sizes)
}

/// The first vertex of a part, by which it is known while parts grow together.
pub(crate) fn root(parent: &mut [u32], mut vertex: u32) -> u32 {
    while parent[vertex as usize] != vertex {
        let above = parent[parent[vertex as usize] as usize];
        parent[vertex as usize] = above;
        vertex = above;
    }
    vertex
}
