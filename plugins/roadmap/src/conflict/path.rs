//! Paths as the constraint tree keeps them, and as they are compared.

use fleetyard_plugin_plane::Vector;

use crate::plan::{Path, Visit};
use crate::roadmap::{Edge, NONE, Roadmap, Vertex};

/// Shorter waits are none: sums of durations are rounded.
pub(super) const MOMENT: f64 = 1e-12;

/// A path of one agent: the edges it drives, and the waits between them. A tree has many paths.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Single {
    start: Vertex,
    edges: Box<[Edge]>,
    /// Numbers of edges before which the agent waits, and the time at which it then sets out.
    waits: Box<[(u32, f64)]>,
    /// The time of its last arrival.
    pub(super) cost: f64,
    /// No path that keeps the agent's constraints arrives earlier.
    pub(super) bound: f64,
}

/// A drive: the edge, and the times at which the agent came to its source and left it.
#[derive(Debug, Clone, Copy)]
pub(super) struct Hop {
    pub(super) edge: Edge,
    pub(super) arrival: f64,
    pub(super) departure: f64,
}

impl Single {
    /// From the edges of a path and the times at which the agent sets out on them.
    pub(super) fn new(roadmap: &Roadmap, start: Vertex, drives: &[(Edge, f64)]) -> Self {
        let (mut time, mut waits) = (0.0, Vec::new());
        for (number, (edge, departure)) in (0..).zip(drives) {
            if *departure > time + MOMENT {
                waits.push((number, *departure));
                time = *departure;
            }
            time += roadmap.duration(*edge);
        }
        Self {
            start,
            edges: drives.iter().map(|(edge, _)| *edge).collect(),
            waits: waits.into(),
            cost: time,
            bound: time,
        }
    }

    /// The drives, in order.
    pub(super) fn hops<'a>(&'a self, roadmap: &'a Roadmap) -> impl Iterator<Item = Hop> + 'a {
        let mut waits = self.waits.iter().peekable();
        let mut time = 0.0;
        (0..).zip(&self.edges).map(move |(number, edge)| {
            let arrival = time;
            let wait = waits.next_if(|(before, _)| *before == number);
            let departure = wait.map_or(arrival, |(_, departure)| *departure);
            time = departure + roadmap.duration(*edge);
            Hop {
                edge: *edge,
                arrival,
                departure,
            }
        })
    }

    /// The path as visits.
    pub(super) fn visits(&self, roadmap: &Roadmap) -> Path {
        let visit = |hop: Hop| Visit {
            vertex: roadmap.source(hop.edge),
            arrival: hop.arrival,
            departure: hop.departure,
            onward: hop.edge,
        };
        let last = Visit {
            vertex: self.goal(roadmap),
            arrival: self.cost,
            departure: f64::INFINITY,
            onward: NONE,
        };
        let hops = self.hops(roadmap).map(visit);
        hops.chain(std::iter::once(last)).collect()
    }

    /// The vertex at which it ends.
    fn goal(&self, roadmap: &Roadmap) -> Vertex {
        let last = self.edges.last();
        last.map_or(self.start, |edge| roadmap.target(*edge))
    }

    /// Bytes that it takes.
    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val(&*self.edges) + size_of_val(&*self.waits) + 48
    }
}

/// A part of a path during which the agent rests or drives an edge.
#[derive(Debug, Clone, Copy)]
pub(super) struct Segment {
    /// Seconds at which it begins and ends; the last one never ends.
    pub(super) from: f64,
    pub(super) to: f64,
    /// The centre at the beginning, and metres per second.
    pub(super) place: Vector,
    pub(super) velocity: Vector,
    /// The edge; [`NONE`] at rest.
    pub(super) edge: Edge,
    /// The vertex at which it begins.
    pub(super) vertex: Vertex,
}

impl Segment {
    /// A rest at a vertex.
    pub(super) fn rest(roadmap: &Roadmap, vertex: Vertex, from: f64, to: f64) -> Self {
        Self {
            from,
            to,
            place: roadmap.place(vertex),
            velocity: Vector::zeros(),
            edge: NONE,
            vertex,
        }
    }

    /// True where the agent rests.
    pub(super) fn is_rest(&self) -> bool {
        self.edge == NONE
    }

    /// The centre at a time.
    pub(super) fn at(&self, time: f64) -> Vector {
        self.place + self.velocity * (time - self.from)
    }
}

/// All segments of a path, in order.
#[derive(Debug, Default)]
pub(super) struct Track(pub(super) Vec<Segment>);

impl Track {
    /// Makes it the track of a path.
    pub(super) fn fill(&mut self, roadmap: &Roadmap, path: &Single) {
        self.0.clear();
        for hop in path.hops(roadmap) {
            let vertex = roadmap.source(hop.edge);
            if hop.departure > hop.arrival {
                let rest = Segment::rest(roadmap, vertex, hop.arrival, hop.departure);
                self.0.push(rest);
            }
            let duration = roadmap.duration(hop.edge);
            let place = roadmap.place(vertex);
            self.0.push(Segment {
                from: hop.departure,
                to: hop.departure + duration,
                place,
                velocity: (roadmap.place(roadmap.target(hop.edge)) - place) / duration,
                edge: hop.edge,
                vertex,
            });
        }
        let goal = path.goal(roadmap);
        self.0
            .push(Segment::rest(roadmap, goal, path.cost, f64::INFINITY));
    }
}
