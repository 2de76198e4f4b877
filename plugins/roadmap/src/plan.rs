//! Paths in continuous time.

use crate::roadmap::{Edge, Roadmap, Vertex};

/// A stay at a vertex. Between two visits a disc drives the edge at its speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Visit {
    /// The vertex.
    pub vertex: Vertex,
    /// Seconds at which the disc arrives.
    pub arrival: f64,
    /// Seconds at which it leaves; infinite at the last vertex.
    pub departure: f64,
    /// The edge by which it leaves; [`NONE`](crate::roadmap::NONE) at the last vertex.
    pub onward: Edge,
}

/// The visits of one disc, from its start at time 0 to its goal, where it stays.
pub type Path = Vec<Visit>;

/// The time at which a path arrives at its goal.
pub fn cost(path: &[Visit]) -> f64 {
    path.last().map_or(0.0, |visit| visit.arrival)
}

/// Metres that a path drives.
pub fn length(roadmap: &Roadmap, path: &[Visit]) -> f64 {
    let hops = path.windows(2);
    hops.map(|hop| (roadmap.place(hop[1].vertex) - roadmap.place(hop[0].vertex)).norm())
        .sum()
}
