//! A roadmap: vertices in the plane, and straight directed edges between them.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::ops::Range;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::motion::Motion;

/// A vertex by its number.
pub type Vertex = u32;

/// A directed edge by its number.
pub type Edge = u32;

/// No vertex and no edge.
pub const NONE: u32 = u32::MAX;

/// The reason why there is no roadmap of the input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refused {
    /// An edge names a vertex that is none.
    NoVertex {
        /// The edge, in the order in which edges were given.
        edge: usize,
    },
    /// An edge takes no time, or no finite one.
    NoDuration {
        /// The edge, in the order in which edges were given.
        edge: usize,
    },
    /// A vertex has a coordinate that is no finite number.
    NoPlace {
        /// The vertex.
        vertex: usize,
    },
    /// More vertices or edges than numbers for them.
    TooLarge,
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoVertex { edge } => write!(f, "edge {edge} names a vertex that is none"),
            Self::NoDuration { edge } => write!(f, "edge {edge} takes no finite time above zero"),
            Self::NoPlace { vertex } => {
                write!(f, "vertex {vertex} has a coordinate that is no number")
            }
            Self::TooLarge => f.write_str("the roadmap has too many vertices or edges"),
        }
    }
}

impl std::error::Error for Refused {}

/// Vertices, and the edges that leave each of them.
#[derive(Debug, Clone)]
pub struct Roadmap {
    places: Vec<Vector>,
    starts: Vec<Edge>,
    sources: Vec<Vertex>,
    targets: Vec<Vertex>,
    durations: Vec<f64>,
    /// Of every edge the one that leads back in the same time.
    twins: Vec<Edge>,
    separation: f64,
}

impl Roadmap {
    /// From places in metres, edges as (source, target, seconds), and the least distance of two centres in metres. Edges
    /// from a vertex to itself lead nowhere and are left out.
    pub fn new(
        places: Vec<Vector>,
        edges: impl IntoIterator<Item = (Vertex, Vertex, f64)>,
        separation: f64,
    ) -> Result<Self, Refused> {
        let count = places.len();
        if u32::try_from(count).is_err() {
            return Err(Refused::TooLarge);
        }
        let finite = |place: &Vector| place.x.is_finite() && place.y.is_finite();
        if let Some(vertex) = places.iter().position(|place| !finite(place)) {
            return Err(Refused::NoPlace { vertex });
        }
        let mut list = Vec::new();
        for (edge, (source, target, duration)) in edges.into_iter().enumerate() {
            if source as usize >= count || target as usize >= count {
                return Err(Refused::NoVertex { edge });
            }
            if !(duration > 0.0 && duration.is_finite()) {
                return Err(Refused::NoDuration { edge });
            }
            if source != target {
                list.push((source, target, duration));
            }
        }
        if u32::try_from(list.len()).is_err() {
            return Err(Refused::TooLarge);
        }
        list.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)));
        // Of parallel edges a planner needs the fastest.
        list.dedup_by_key(|edge| (edge.0, edge.1));
        let mut starts = vec![0; count + 1];
        for edge in &list {
            starts[edge.0 as usize + 1] += 1;
        }
        for vertex in 0..count {
            starts[vertex + 1] += starts[vertex];
        }
        let back = |&(source, target, duration): &(Vertex, Vertex, f64)| {
            let found = list.binary_search_by(|edge| (edge.0, edge.1).cmp(&(target, source)));
            found
                .ok()
                .filter(|edge| list[*edge].2.total_cmp(&duration).is_eq())
                .map_or(NONE, |edge| edge as Edge)
        };
        let twins = list.iter().map(back).collect();
        Ok(Self {
            places,
            starts,
            sources: list.iter().map(|edge| edge.0).collect(),
            targets: list.iter().map(|edge| edge.1).collect(),
            durations: list.iter().map(|edge| edge.2).collect(),
            twins,
            separation,
        })
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.places.len()
    }

    /// Number of directed edges.
    pub fn edges(&self) -> usize {
        self.targets.len()
    }

    /// The place of a vertex, in metres.
    pub fn place(&self, vertex: Vertex) -> Vector {
        self.places[vertex as usize]
    }

    /// The edges that leave a vertex.
    pub fn leaving(&self, vertex: Vertex) -> Range<Edge> {
        self.starts[vertex as usize]..self.starts[vertex as usize + 1]
    }

    /// The edge from one vertex to another.
    pub fn edge(&self, source: Vertex, target: Vertex) -> Option<Edge> {
        let leaving = self.leaving(source);
        let targets = &self.targets[leaving.start as usize..leaving.end as usize];
        let found = targets.binary_search(&target).ok()?;
        Some(leaving.start + found as Edge)
    }

    /// The vertex where an edge begins.
    pub fn source(&self, edge: Edge) -> Vertex {
        self.sources[edge as usize]
    }

    /// The vertex where an edge ends.
    pub fn target(&self, edge: Edge) -> Vertex {
        self.targets[edge as usize]
    }

    /// Seconds that an edge takes.
    pub fn duration(&self, edge: Edge) -> f64 {
        self.durations[edge as usize]
    }

    /// The edge that leads back in the same time, or [`NONE`].
    pub fn twin(&self, edge: Edge) -> Edge {
        self.twins[edge as usize]
    }

    /// The least distance of two centres, in metres.
    pub fn separation(&self) -> f64 {
        self.separation
    }

    /// A disc's centre along an edge.
    pub fn motion(&self, edge: Edge) -> Motion {
        Motion::between(
            self.place(self.source(edge)),
            self.place(self.target(edge)),
            self.duration(edge),
        )
    }

    /// Seconds from every vertex to `goal` with nobody else on the roadmap; infinite where no way leads there.
    pub fn times_to(&self, goal: Vertex) -> Vec<f64> {
        let mut times = vec![f64::INFINITY; self.vertices()];
        let mut entering: Vec<Vec<Edge>> = vec![Vec::new(); self.vertices()];
        for edge in 0..self.edges() as Edge {
            entering[self.target(edge) as usize].push(edge);
        }
        let mut open = BinaryHeap::from([Reached {
            time: 0.0,
            vertex: goal,
        }]);
        times[goal as usize] = 0.0;
        while let Some(Reached { time, vertex }) = open.pop() {
            if time > times[vertex as usize] {
                continue;
            }
            for edge in &entering[vertex as usize] {
                let (source, time) = (self.source(*edge), time + self.duration(*edge));
                if time < times[source as usize] {
                    times[source as usize] = time;
                    open.push(Reached {
                        time,
                        vertex: source,
                    });
                }
            }
        }
        times
    }
}

/// A vertex in the queue of Dijkstra's algorithm; the greatest is the earliest.
#[derive(PartialEq)]
struct Reached {
    time: f64,
    vertex: Vertex,
}

impl Eq for Reached {}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .time
            .total_cmp(&self.time)
            .then(other.vertex.cmp(&self.vertex))
    }
}
