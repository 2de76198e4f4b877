//! The times that the paths of others leave.

use fleetyard_plugin_plane::motion::Span;
use fleetyard_plugin_plane::spans::Spans;

use crate::closeness::Closeness;
use crate::plan::Visit;
use crate::roadmap::{Edge, NONE, Vertex};

/// Times at which a disc must not be at a vertex, or must not set out on an edge.
#[derive(Debug, Clone)]
pub struct Reservations {
    vertices: Vec<Spans>,
    edges: Vec<Spans>,
    used_vertices: Vec<Vertex>,
    used_edges: Vec<Edge>,
    /// Per edge, discs that hold it at first, and until when nobody should set out on it.
    held: Vec<Vec<(u32, f64)>>,
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
            held: vec![Vec::new(); closeness.roadmap().edges()],
            released: Vec::new(),
        }
    }

    /// Times at which a vertex is taken.
    pub fn vertex(&self, vertex: Vertex) -> &Spans {
        &self.vertices[vertex as usize]
    }

    /// Times at which no disc may set out on an edge.
    pub fn edge(&self, edge: Edge) -> &Spans {
        &self.edges[edge as usize]
    }

    /// The first time from `time` on at which a disc may set out on an edge, and should with regard to those who hold it.
    pub fn first_free(&self, edge: Edge, time: f64) -> f64 {
        let held = self.held[edge as usize].iter();
        let held = held.filter(|(disc, _)| !self.released[*disc as usize]);
        let time = held.fold(time, |time, (_, until)| time.max(*until));
        self.edge(edge).first_outside(time)
    }

    /// Lets a disc that has no path yet, the next one of those for which this is called, hold the place where it starts until a time:
    /// others would come while it cannot be gone.
    pub fn hold(&mut self, closeness: &Closeness, start: Vertex, until: f64) {
        let disc = self.released.len() as u32;
        self.released.push(false);
        if until > 0.0 {
            for (edge, near) in closeness.edges_of_vertex(start) {
                self.held[*edge as usize].push((disc, until - near.low));
            }
        }
    }

    /// Gives up what a disc holds, which is about to get its path.
    pub fn release(&mut self, disc: usize) {
        self.released[disc] = true;
    }

    /// Takes what a path needs until a time, after which it may be in anybody's way.
    pub fn reserve(&mut self, closeness: &Closeness, path: &[Visit], until: f64) {
        for visit in path.iter().take_while(|visit| visit.arrival < until) {
            self.reserve_stay(closeness, visit, until);
            if visit.onward != NONE && visit.departure < until {
                self.reserve_edge(closeness, visit.onward, visit.departure);
            }
        }
    }

    fn reserve_stay(&mut self, closeness: &Closeness, visit: &Visit, until: f64) {
        let (from, to) = (visit.arrival, visit.departure.min(until));
        for vertex in closeness.vertices_of_vertex(visit.vertex) {
            let stay = Span {
                low: from,
                high: to,
            };
            self.take_vertex(*vertex, stay);
        }
        for (edge, near) in closeness.edges_of_vertex(visit.vertex) {
            // Who sets out later is near after the stay, and who sets out earlier was near before.
            let (low, high) = (from - near.high, to - near.low);
            self.take_edge(*edge, Span { low, high });
        }
    }

    fn reserve_edge(&mut self, closeness: &Closeness, edge: Edge, departure: f64) {
        for (vertex, near) in closeness.vertices_of_edge(edge) {
            self.take_vertex(vertex, near.after(departure));
        }
        for (other, later) in closeness.edges_of_edge(edge) {
            self.take_edge(other, later.after(departure));
        }
    }

    fn take_vertex(&mut self, vertex: Vertex, span: Span) {
        let spans = &mut self.vertices[vertex as usize];
        if spans.as_slice().is_empty() {
            self.used_vertices.push(vertex);
        }
        spans.insert(span);
    }

    fn take_edge(&mut self, edge: Edge, span: Span) {
        let spans = &mut self.edges[edge as usize];
        if spans.as_slice().is_empty() {
            self.used_edges.push(edge);
        }
        spans.insert(span);
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
