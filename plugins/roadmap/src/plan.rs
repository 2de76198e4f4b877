//! Paths in continuous time.

use fleetyard_plugin_plane::Vector;

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

impl Visit {
    /// The times at which it begins and ends, without an end that is infinite.
    pub fn times(&self) -> impl Iterator<Item = f64> + use<> {
        [self.arrival, self.departure]
            .into_iter()
            .filter(|time| time.is_finite())
    }
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

/// The centre of a disc at a time, in metres.
pub fn position(roadmap: &Roadmap, path: &[Visit], time: f64) -> Vector {
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
