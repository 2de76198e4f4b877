//! The times that the paths of others leave.

use fleetyard_plugin_plane::motion::Span;
use fleetyard_plugin_plane::spans::Spans;

use crate::closeness::Closeness;
use crate::plan::Visit;
use crate::roadmap::{Edge, NONE, Vertex};
use crate::sipp::Taken;

/// Hears what a path takes: times at which no other disc may be at a vertex, or set out on an edge.
pub trait Listener {
    /// A vertex is taken.
    fn vertex(&mut self, vertex: Vertex, span: Span);

    /// An edge is taken.
    fn edge(&mut self, edge: Edge, span: Span);
}

/// Tells what a path takes until a time, after which it may be in anybody's way.
pub fn tell(closeness: &Closeness, path: &[Visit], until: f64, listener: &mut impl Listener) {
    for visit in path.iter().take_while(|visit| visit.arrival < until) {
        let (from, to) = (visit.arrival, visit.departure.min(until));
        for vertex in closeness.vertices_of_vertex(visit.vertex) {
            let stay = Span {
                low: from,
                high: to,
            };
            listener.vertex(*vertex, stay);
        }
        for (edge, near) in closeness.edges_of_vertex(visit.vertex) {
            // Who sets out later is near after the stay, and who sets out earlier was near before.
            let (low, high) = (from - near.high, to - near.low);
            listener.edge(*edge, Span { low, high });
        }
        if visit.onward != NONE && visit.departure < until {
            for (vertex, near) in closeness.vertices_of_edge(visit.onward) {
                listener.vertex(vertex, near.after(visit.departure));
            }
            for (other, later) in closeness.edges_of_edge(visit.onward) {
                listener.edge(other, later.after(visit.departure));
            }
        }
    }
}

/// Discs without a path that hold the places where they start: others would come while they cannot be gone.
#[derive(Debug, Clone)]
pub struct Held {
    /// Per edge, discs that hold it at first, and until when nobody should set out on it.
    edges: Vec<Vec<(u32, f64)>>,
}

impl Held {
    /// By nobody.
    pub fn new(closeness: &Closeness) -> Self {
        Self {
            edges: vec![Vec::new(); closeness.roadmap().edges()],
        }
    }

    /// Lets a disc hold its start until a time.
    pub fn hold(&mut self, closeness: &Closeness, disc: usize, (start, until): (Vertex, f64)) {
        if until > 0.0 {
            for (edge, near) in closeness.edges_of_vertex(start) {
                self.edges[*edge as usize].push((disc as u32, until - near.low));
            }
        }
    }

    /// The first time from `time` on at which a disc should set out on an edge with regard to those that count.
    pub fn first_free(&self, edge: Edge, time: f64, counts: impl Fn(u32) -> bool) -> f64 {
        let held = self.edges[edge as usize].iter();
        let held = held.filter(|(disc, _)| counts(*disc));
        held.fold(time, |time, (_, until)| time.max(*until))
    }
}

/// Times at which a disc must not be at a vertex, or must not set out on an edge.
#[derive(Debug, Clone)]
pub struct Reservations {
    vertices: Vec<Spans>,
    edges: Vec<Spans>,
    used_vertices: Vec<Vertex>,
    used_edges: Vec<Edge>,
    held: Held,
    /// True per disc that holds nothing any more.
    released: Vec<bool>,
}

impl Reservations {
    /// Nobody's.
    pub fn new(closeness: &Closeness) -> Self {
        Self {
            vertices: vec![Spans::new(); closeness.roadmap().vertices()],
            edges: vec![Spans::new(); closeness.roadmap().edges()],
            used_vertices: Vec::new(),
            used_edges: Vec::new(),
            held: Held::new(closeness),
            released: Vec::new(),
        }
    }

    /// Lets a disc that has no path yet, the next one of those for which this is called, hold the place where it starts until a time.
    pub fn hold(&mut self, closeness: &Closeness, start: Vertex, until: f64) {
        let disc = self.released.len();
        self.released.push(false);
        self.held.hold(closeness, disc, (start, until));
    }

    /// Gives up what a disc holds, which is about to get its path.
    pub fn release(&mut self, disc: usize) {
        self.released[disc] = true;
    }

    /// Takes what a path needs until a time, after which it may be in anybody's way.
    pub fn reserve(&mut self, closeness: &Closeness, path: &[Visit], until: f64) {
        tell(closeness, path, until, self);
    }

    /// Gives all paths back; discs hold again what they held.
    pub fn clear(&mut self) {
        self.released.fill(false);
        for vertex in self.used_vertices.drain(..) {
            self.vertices[vertex as usize].clear();
        }
        for edge in self.used_edges.drain(..) {
            self.edges[edge as usize].clear();
        }
    }
}

impl Listener for Reservations {
    fn vertex(&mut self, vertex: Vertex, span: Span) {
        let spans = &mut self.vertices[vertex as usize];
        if spans.as_slice().is_empty() {
            self.used_vertices.push(vertex);
        }
        spans.insert(span);
    }

    fn edge(&mut self, edge: Edge, span: Span) {
        let spans = &mut self.edges[edge as usize];
        if spans.as_slice().is_empty() {
            self.used_edges.push(edge);
        }
        spans.insert(span);
    }
}

impl Taken for Reservations {
    fn vertex(&self, vertex: Vertex) -> &Spans {
        &self.vertices[vertex as usize]
    }

    fn first_free(&self, edge: Edge, time: f64) -> f64 {
        let counts = |disc: u32| !self.released[disc as usize];
        let time = self.held.first_free(edge, time, counts);
        self.edges[edge as usize].first_outside(time)
    }

    fn first_free_after(&self, edge: Edge, time: f64, at: &mut usize) -> f64 {
        let counts = |disc: u32| !self.released[disc as usize];
        let time = self.held.first_free(edge, time, counts);
        self.edges[edge as usize].first_outside_after(time, at)
    }
}
