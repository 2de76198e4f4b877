//! Edges and vertices that are too close to each other, and when a disc on one is in the way of a disc on the other.
//!
//! K. Kasaura, M. Nishimura, R. Yonetani ("Prioritized safe interval path planning for multi-agent pathfinding with
//! continuous time on 2D roadmaps", RA-L 7(4), 2022) annotate a roadmap with all of this before they plan. Here it is worked
//! out in closed form, and only for the edges and vertices that somebody's path has: a team uses few of a large roadmap.

use std::cell::OnceCell;

use fleetyard_plugin_plane::bins::{Bins, Rectangle};
use fleetyard_plugin_plane::motion::{Motion, Span};

use crate::roadmap::{Edge, NONE, Roadmap, Vertex};

/// What is close to an edge or a vertex.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Close {
    /// Edges. Of an edge: how much later another disc must not set out on them. Of a vertex: the part of the way along
    /// them, in seconds, that is too close to it.
    pub edges: Vec<(Edge, Span)>,
    /// Vertices. Of an edge: the part of the way along it that is too close to them. Of a vertex: always.
    pub vertices: Vec<(Vertex, Span)>,
}

/// Which edges and vertices of a roadmap are close to each other.
#[derive(Debug)]
pub struct Closeness<'a> {
    roadmap: &'a Roadmap,
    /// Boxes of the edges that are not the twin of an earlier one.
    tracks: Bins,
    track_edges: Vec<Edge>,
    places: Bins,
    of_edges: Vec<OnceCell<Close>>,
    of_vertices: Vec<OnceCell<Close>>,
    distance: f64,
}

/// A planner keeps so much more distance, as a share of the separation: its times are rounded, and a plan that touches has
/// to be one that only touches for whoever judges it.
const MARGIN: f64 = 1e-9;

impl<'a> Closeness<'a> {
    /// Of a roadmap; nothing but boxes is worked out before it is asked for.
    pub fn new(roadmap: &'a Roadmap) -> Self {
        let distance = roadmap.separation() * (1.0 + MARGIN);
        let edges = 0..roadmap.edges() as Edge;
        let track_edges: Vec<Edge> = edges.filter(|edge| *edge < roadmap.twin(*edge)).collect();
        let around = |edge: &Edge| {
            let ends = [roadmap.source(*edge), roadmap.target(*edge)].map(|end| roadmap.place(end));
            Rectangle::around(ends[0], ends[1], 0.0)
        };
        let vertices = 0..roadmap.vertices() as Vertex;
        let places = vertices.map(|vertex| roadmap.place(vertex));
        Self {
            roadmap,
            tracks: Bins::new(track_edges.iter().map(around).collect()),
            places: Bins::new(
                places
                    .map(|place| Rectangle::around(place, place, distance / 2.0))
                    .collect(),
            ),
            track_edges,
            of_edges: vec![OnceCell::new(); roadmap.edges()],
            of_vertices: vec![OnceCell::new(); roadmap.vertices()],
            distance,
        }
    }

    /// The roadmap.
    pub fn roadmap(&self) -> &'a Roadmap {
        self.roadmap
    }

    /// What is close to an edge: itself and its twin among them.
    pub fn of_edge(&self, edge: Edge) -> &Close {
        self.of_edges[edge as usize].get_or_init(|| {
            let motion = self.roadmap.motion(edge);
            let mut close = Close::default();
            self.tracks_near(&motion, |other| {
                let Some(overlap) = motion.overlap(&self.roadmap.motion(other), self.distance)
                else {
                    return;
                };
                close.edges.push((other, overlap.forward));
                let twin = self.roadmap.twin(other);
                if twin != NONE {
                    close.edges.push((twin, overlap.backward));
                }
            });
            self.places_near(&motion, |vertex| {
                let near = motion.near(self.roadmap.place(vertex), self.distance);
                close.vertices.extend(near.map(|span| (vertex, span)));
            });
            close
        })
    }

    /// What is close to a vertex: itself among it.
    pub fn of_vertex(&self, vertex: Vertex) -> &Close {
        self.of_vertices[vertex as usize].get_or_init(|| {
            let place = self.roadmap.place(vertex);
            let motion = Motion::rest(place, 0.0);
            let mut close = Close::default();
            self.tracks_near(&motion, |other| {
                let Some(span) = self.roadmap.motion(other).near(place, self.distance) else {
                    return;
                };
                close.edges.push((other, span));
                let twin = self.roadmap.twin(other);
                if twin != NONE {
                    let duration = self.roadmap.duration(other);
                    let (low, high) = (duration - span.high, duration - span.low);
                    close.edges.push((twin, Span { low, high }));
                }
            });
            self.places_near(&motion, |other| {
                if (self.roadmap.place(other) - place).norm() < self.distance {
                    let (low, high) = (f64::NEG_INFINITY, f64::INFINITY);
                    close.vertices.push((other, Span { low, high }));
                }
            });
            close
        })
    }

    fn tracks_near(&self, motion: &Motion, mut found: impl FnMut(Edge)) {
        let asked = Rectangle::around(motion.from, motion.at(motion.duration), self.distance);
        self.tracks
            .meeting(&asked, |track| found(self.track_edges[track as usize]));
    }

    fn places_near(&self, motion: &Motion, found: impl FnMut(Vertex)) {
        let asked = Rectangle::around(motion.from, motion.at(motion.duration), self.distance);
        self.places.meeting(&asked, found);
    }
}
