//! SIPP: the path of one disc among the paths of others that arrives earliest.
//!
//! M. Phillips, M. Likhachev, "SIPP: safe interval path planning for dynamic environments", ICRA 2011. A state is a vertex
//! and one of its safe intervals; of the ways into it only the earliest matters, since a disc may wait there. On a roadmap
//! with crossing edges an edge has times of its own at which nobody may set out on it (Kasaura et al., RA-L 2022).

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::plan::{Path, Visit};
use crate::reservation::Reservations;
use crate::roadmap::{Roadmap, Vertex};

/// Expansions between two calls of `stop`.
const PATIENCE: u64 = 256;

/// Result of a search.
#[derive(Debug, Clone, PartialEq)]
pub enum Found {
    /// With the earliest path.
    Path(Path),
    /// There is none.
    None,
    /// It was told to stop.
    Stopped,
}

/// A state that was reached.
#[derive(Debug, Clone, Copy)]
struct Node {
    vertex: Vertex,
    /// The number of the vertex's safe interval.
    interval: u32,
    arrival: f64,
    /// The state before, or its own number at the start.
    parent: u32,
    /// Time at which the disc left the vertex before.
    set_out: f64,
}

/// An entry of the open list; the greatest has the least estimate, and of equal ones the latest arrival.
#[derive(PartialEq)]
struct Entry {
    estimate: f64,
    arrival: f64,
    node: u32,
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        let least = other.estimate.total_cmp(&self.estimate);
        least
            .then(self.arrival.total_cmp(&other.arrival))
            .then(other.node.cmp(&self.node))
    }
}

/// The memory of searches on one roadmap, used again and again.
#[derive(Debug)]
pub struct Search {
    nodes: Vec<Node>,
    /// Per vertex the best state of each safe interval that was reached, by interval.
    best: Vec<Vec<(u32, u32)>>,
    touched: Vec<Vertex>,
    /// States that were expanded, in all searches.
    pub expanded: u64,
}

impl Search {
    /// For a roadmap.
    pub fn new(roadmap: &Roadmap) -> Self {
        Self {
            nodes: Vec::new(),
            best: vec![Vec::new(); roadmap.vertices()],
            touched: Vec::new(),
            expanded: 0,
        }
    }

    /// The earliest path from `start` at time 0 to `goal`, where the disc stays for good. `rest` is a lower bound of the
    /// seconds from each vertex to the goal.
    pub fn find(
        &mut self,
        roadmap: &Roadmap,
        taken: &Reservations,
        (start, goal): (Vertex, Vertex),
        rest: &[f64],
        stop: &mut dyn FnMut() -> bool,
    ) -> Found {
        self.nodes.clear();
        for vertex in self.touched.drain(..) {
            self.best[vertex as usize].clear();
        }
        let mut open = BinaryHeap::new();
        let interval = taken.vertex(start).ended(0.0);
        if taken.vertex(start).safe(interval).low > 0.0 || rest[start as usize].is_infinite() {
            return Found::None;
        }
        let first = Node {
            vertex: start,
            interval: interval as u32,
            arrival: 0.0,
            parent: 0,
            set_out: 0.0,
        };
        self.reach(first, rest, &mut open);
        while let Some(Entry { arrival, node, .. }) = open.pop() {
            let from = self.nodes[node as usize];
            if arrival > from.arrival {
                continue;
            }
            self.expanded += 1;
            if self.expanded.is_multiple_of(PATIENCE) && stop() {
                return Found::Stopped;
            }
            let safe = taken.vertex(from.vertex).safe(from.interval as usize);
            if from.vertex == goal && safe.high == f64::INFINITY {
                return Found::Path(self.path(node));
            }
            for edge in roadmap.leaving(from.vertex) {
                let (target, duration) = (roadmap.target(edge), roadmap.duration(edge));
                if rest[target as usize].is_infinite() {
                    continue;
                }
                let (there, forbidden) = (taken.vertex(target), taken.edge(edge));
                let mut interval = there.ended(from.arrival + duration);
                loop {
                    let at = there.safe(interval);
                    if at.low - duration > safe.high || interval > there.as_slice().len() {
                        break;
                    }
                    // The arrival is what counts: a departure that is rounded must not lie in the interval before.
                    let earliest = forbidden.first_outside(from.arrival.max(at.low - duration));
                    if earliest == f64::INFINITY {
                        break;
                    }
                    let arrival = (earliest + duration).max(at.low);
                    if earliest <= safe.high && arrival <= at.high {
                        let reached = Node {
                            vertex: target,
                            interval: interval as u32,
                            arrival,
                            parent: node,
                            set_out: earliest,
                        };
                        self.reach(reached, rest, &mut open);
                    }
                    interval += 1;
                }
            }
        }
        Found::None
    }

    /// Keeps a state if it is reached for the first time, or earlier than before.
    fn reach(&mut self, reached: Node, rest: &[f64], open: &mut BinaryHeap<Entry>) {
        let best = &mut self.best[reached.vertex as usize];
        let known = best
            .iter()
            .find(|(interval, _)| *interval == reached.interval);
        let node = if let Some((_, node)) = known {
            if self.nodes[*node as usize].arrival <= reached.arrival {
                return;
            }
            self.nodes[*node as usize] = reached;
            *node
        } else {
            if best.is_empty() {
                self.touched.push(reached.vertex);
            }
            best.push((reached.interval, self.nodes.len() as u32));
            self.nodes.push(reached);
            self.nodes.len() as u32 - 1
        };
        open.push(Entry {
            estimate: reached.arrival + rest[reached.vertex as usize],
            arrival: reached.arrival,
            node,
        });
    }

    fn path(&self, last: u32) -> Path {
        let mut path = Path::new();
        let (mut node, mut departure) = (last, f64::INFINITY);
        loop {
            let Node {
                vertex,
                arrival,
                parent,
                set_out,
                ..
            } = self.nodes[node as usize];
            path.push(Visit {
                vertex,
                arrival,
                departure,
            });
            if parent == node {
                break;
            }
            (node, departure) = (parent, set_out);
        }
        path.reverse();
        path
    }
}
