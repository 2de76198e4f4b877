//! Edges and vertices that are too close to each other, and when a disc on one is in the way of a disc on the other.
//!
//! K. Kasaura, M. Nishimura, R. Yonetani ("Prioritized safe interval path planning for multi-agent pathfinding with
//! continuous time on 2D roadmaps", RA-L 7(4), 2022) annotate a roadmap with all of this before they plan. Here it is worked
//! out in closed form, once for both directions of both edges, and unless [`Closeness::annotate`] is asked for only for the
//! edges and vertices that somebody's path has: a team uses few of a large roadmap.

use std::cell::OnceCell;

use fleetyard_plugin_plane::bins::{Bins, Rectangle};
use fleetyard_plugin_plane::motion::{Motion, Span};

use crate::roadmap::{Edge, NONE, Roadmap, Vertex};

/// A planner keeps so much more distance, as a share of the separation: its times are rounded, and a plan that touches has
/// to be one that only touches for whoever judges it.
const MARGIN: f64 = 1e-9;

/// Ends of spans of edges are rounded by at most this share of the longest drive, or by so many seconds where motions are nearly
/// parallel.
const ROUNDING: (f64, f64) = (1e-6, 1e-5);

/// The edges and vertices of a roadmap that are close to each other.
#[derive(Debug)]
pub struct Closeness {
    roadmap: Roadmap,
    /// The largest radius, with the margin.
    widest: f64,
    rounding: f64,
    /// Edges that are not the twin of an earlier one, in boxes.
    tracks: Bins,
    edge_of_track: Vec<Edge>,
    motions: Vec<Motion>,
    track_of_edge: Vec<u32>,
    places: Bins,
    pairs: Vec<OnceCell<Vec<Pair>>>,
    beside_tracks: Vec<OnceCell<Vec<(Vertex, Span)>>>,
    beside_vertices: Vec<OnceCell<Beside>>,
}

/// A track that is close to another one. Ends of spans are rounded outwards: a superdense roadmap has millions of pairs.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Pair {
    other: u32,
    /// Delays of a start on the other track against one on this track, in seconds, that bring two
    /// discs too close.
    forward: [f32; 2],
    /// The same for who drives the other one back.
    backward: [f32; 2],
}

impl Pair {
    fn new(other: u32, forward: Span, backward: Span) -> Self {
        Self {
            other,
            forward: rounded(forward),
            backward: rounded(backward),
        }
    }
}

fn rounded(span: Span) -> [f32; 2] {
    [(span.low as f32).next_down(), (span.high as f32).next_up()]
}

fn span([low, high]: [f32; 2]) -> Span {
    Span {
        low: f64::from(low),
        high: f64::from(high),
    }
}

/// The edges close to a vertex, with the part of the way along them that is, in seconds; and the
/// vertices close to it.
#[derive(Debug, Default)]
struct Beside {
    edges: Vec<(Edge, Span)>,
    vertices: Vec<Vertex>,
}

impl Closeness {
    /// Of a roadmap; nothing but boxes is worked out before it is asked for.
    pub fn new(roadmap: Roadmap) -> Self {
        let radii = (0..roadmap.vertices() as Vertex).map(|vertex| roadmap.radius(vertex));
        let widest = radii.fold(0.0, f64::max) * (1.0 + MARGIN);
        let edges = 0..roadmap.edges() as Edge;
        let edge_of_track: Vec<Edge> = edges.filter(|edge| *edge < roadmap.twin(*edge)).collect();
        let mut track_of_edge = vec![NONE; roadmap.edges()];
        for (track, edge) in edge_of_track.iter().enumerate() {
            let twin = Some(roadmap.twin(*edge)).filter(|twin| *twin != NONE);
            for edge in [Some(*edge), twin].into_iter().flatten() {
                track_of_edge[edge as usize] = track as u32;
            }
        }
        let around = |edge: &Edge| {
            let ends = [roadmap.source(*edge), roadmap.target(*edge)].map(|end| roadmap.place(end));
            Rectangle::around(ends[0], ends[1], 0.0)
        };
        let durations = (0..roadmap.edges() as Edge).map(|edge| roadmap.duration(edge));
        let (share, least) = ROUNDING;
        let rounding = least.max(share * durations.fold(0.0, f64::max));
        let places = (0..roadmap.vertices() as Vertex).map(|vertex| roadmap.place(vertex));
        let boxes = places.map(|place| Rectangle::around(place, place, widest));
        Self {
            tracks: Bins::new(edge_of_track.iter().map(around).collect()),
            places: Bins::new(boxes.collect()),
            motions: edge_of_track
                .iter()
                .map(|edge| roadmap.motion(*edge))
                .collect(),
            pairs: vec![OnceCell::new(); edge_of_track.len()],
            beside_tracks: vec![OnceCell::new(); edge_of_track.len()],
            beside_vertices: (0..roadmap.vertices()).map(|_| OnceCell::new()).collect(),
            roadmap,
            widest,
            rounding,
            edge_of_track,
            track_of_edge,
        }
    }

    /// The roadmap.
    pub fn roadmap(&self) -> &Roadmap {
        &self.roadmap
    }

    /// Centres of discs at two vertices, or on edges that leave them, are too close if they are closer than this, in metres.
    pub fn distance(&self, one: Vertex, other: Vertex) -> f64 {
        self.roadmap.separation(one, other) * (1.0 + MARGIN)
    }

    /// Seconds by which the ends of spans of edges may be off, outwards.
    pub fn rounding(&self) -> f64 {
        self.rounding
    }

    /// Works out all pairs of edges, each once.
    pub fn annotate(&self) {
        let tracks = self.edge_of_track.len() as u32;
        let mut all: Vec<Vec<Pair>> = vec![Vec::new(); tracks as usize];
        for track in 0..tracks {
            let (motion, mut found) = (self.motion(track), Vec::new());
            self.tracks_near(&motion, track, |other| {
                found.extend(self.pair(track, other));
            });
            for pair in &found {
                if pair.other != track {
                    let mirrored = self.mirrored(track, pair);
                    all[pair.other as usize].push(mirrored);
                }
            }
            all[track as usize].append(&mut found);
        }
        for (cell, mut pairs) in self.pairs.iter().zip(all) {
            pairs.shrink_to_fit();
            cell.get_or_init(|| pairs);
        }
    }

    /// The edges that are close to an edge, itself and its twin among them, each with how much later than on this edge
    /// another disc must not set out on it.
    pub fn edges_of_edge(&self, edge: Edge) -> impl Iterator<Item = (Edge, Span)> {
        let track = self.track_of_edge[edge as usize];
        let duration = self.roadmap.duration(edge);
        let ahead = edge == self.edge_of_track[track as usize];
        let pairs = self.pairs[track as usize].get_or_init(|| {
            let (motion, mut found) = (self.motion(track), Vec::new());
            self.tracks_near(&motion, 0, |other| found.extend(self.pair(track, other)));
            found
        });
        pairs.iter().flat_map(move |pair| {
            let other = self.edge_of_track[pair.other as usize];
            let (mut forward, mut backward) = (span(pair.forward), span(pair.backward));
            if !ahead {
                // Who is t seconds along the track is as many before its end on the way back: differences become sums.
                let shift = duration - self.roadmap.duration(other);
                (forward, backward) = (
                    negative(backward).after(shift),
                    negative(forward).after(shift),
                );
            }
            let twin = Some(self.roadmap.twin(other)).filter(|twin| *twin != NONE);
            std::iter::once((other, forward)).chain(twin.map(|twin| (twin, backward)))
        })
    }

    /// The vertices that are close to an edge, each with the part of the way along the edge that is.
    pub fn vertices_of_edge(&self, edge: Edge) -> impl Iterator<Item = (Vertex, Span)> {
        let track = self.track_of_edge[edge as usize];
        let (ahead, duration) = (
            edge == self.edge_of_track[track as usize],
            self.roadmap.duration(edge),
        );
        let beside = self.beside_tracks[track as usize].get_or_init(|| {
            let (motion, mut found) = (self.motion(track), Vec::new());
            let source = self.source(track);
            self.places_near(&motion, |vertex| {
                let distance = self.distance(source, vertex);
                let near = motion.near(self.roadmap.place(vertex), distance);
                found.extend(near.map(|near| (vertex, near)));
            });
            found
        });
        let way = move |near: Span| {
            if ahead {
                near
            } else {
                negative(near).after(duration)
            }
        };
        beside
            .iter()
            .map(move |(vertex, near)| (*vertex, way(*near)))
    }

    /// The edges that are close to a vertex, each with the part of the way along it that is.
    pub fn edges_of_vertex(&self, vertex: Vertex) -> &[(Edge, Span)] {
        &self.beside(vertex).edges
    }

    /// The vertices that are close to a vertex, itself among them.
    pub fn vertices_of_vertex(&self, vertex: Vertex) -> &[Vertex] {
        &self.beside(vertex).vertices
    }

    fn beside(&self, vertex: Vertex) -> &Beside {
        self.beside_vertices[vertex as usize].get_or_init(|| {
            let place = self.roadmap.place(vertex);
            let motion = Motion::rest(place, 0.0);
            let mut beside = Beside::default();
            self.tracks_near(&motion, 0, |track| {
                let edge = self.edge_of_track[track as usize];
                let distance = self.distance(vertex, self.roadmap.source(edge));
                let Some(near) = self.motion(track).near(place, distance) else {
                    return;
                };
                beside.edges.push((edge, near));
                let twin = self.roadmap.twin(edge);
                if twin != NONE {
                    let back = negative(near).after(self.roadmap.duration(edge));
                    beside.edges.push((twin, back));
                }
            });
            self.places_near(&motion, |other| {
                let apart = (self.roadmap.place(other) - place).norm();
                if apart < self.distance(vertex, other) {
                    beside.vertices.push(other);
                }
            });
            beside
        })
    }

    fn motion(&self, track: u32) -> Motion {
        self.motions[track as usize]
    }

    fn source(&self, track: u32) -> Vertex {
        self.roadmap.source(self.edge_of_track[track as usize])
    }

    fn pair(&self, track: u32, other: u32) -> Option<Pair> {
        let distance = self.distance(self.source(track), self.source(other));
        let overlap = self.motion(track).overlap(&self.motion(other), distance)?;
        Some(Pair::new(other, overlap.forward, overlap.backward))
    }

    /// The pair of `track`, seen from the other one. With t on the first and s on the second, its
    /// differences t − s are differences s − t for the other, and sums stay.
    fn mirrored(&self, track: u32, pair: &Pair) -> Pair {
        let duration = |track: u32| self.roadmap.duration(self.edge_of_track[track as usize]);
        let shift = duration(pair.other) - duration(track);
        let forward = negative(span(pair.forward));
        Pair::new(track, forward, span(pair.backward).after(shift))
    }

    fn tracks_near(&self, motion: &Motion, first: u32, found: impl FnMut(u32)) {
        let asked = Rectangle::around(motion.from, motion.at(motion.duration), 2.0 * self.widest);
        self.tracks.meeting_from(&asked, first, found);
    }

    fn places_near(&self, motion: &Motion, found: impl FnMut(Vertex)) {
        let asked = Rectangle::around(motion.from, motion.at(motion.duration), 2.0 * self.widest);
        self.places.meeting(&asked, found);
    }
}

fn negative(span: Span) -> Span {
    Span {
        low: -span.high,
        high: -span.low,
    }
}
