//! The path of one disc that meets the fewest others, and of these the earliest.
//!
//! SIPPS of J. Li, Z. Chen, D. Harabor, P. J. Stuckey, S. Koenig, "MAPF-LNS2: fast repairing for multi-agent path finding via large
//! neighborhood search", AAAI 2022, in continuous time and with nobody who may not be met. The time line of a vertex falls into
//! segments within which the same discs are near it, that of an edge into parts in which who sets out meets the same. A state is a
//! vertex and a segment; the way into it that meets the fewest is looked at first, and a later one only if it is earlier in time.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use fleetyard_plugin_plane::motion::Span;

use crate::crowd::{Claim, Crowd};
use crate::plan::{Path, Visit};
use crate::roadmap::{Edge, NONE, Roadmap, Vertex};
use crate::sipp::{Found, Task};

/// Expansions between two calls of `stop`.
const PATIENCE: u64 = 256;

/// Spans of one disc that are no further apart, in seconds, are one: it goes on.
const TOUCHING: f64 = 1e-6;

/// A time in which the same discs are near.
#[derive(Debug, Clone, Copy)]
struct Part {
    begin: f64,
    /// Infinite for the last one.
    end: f64,
    /// Number of discs that are near, and of those that come at the beginning.
    present: u32,
    fresh: u32,
}

/// A part of the time line of a vertex.
#[derive(Debug, Clone, Copy)]
struct Segment {
    part: Part,
    /// Time at which the way came in that was expanded last; it met no more than others will.
    closed: f64,
    /// A way into it on the open list: when it comes, and how many it meets.
    open: (f64, u32),
}

/// A vertex at a time.
#[derive(Debug, Clone, Copy)]
struct State {
    vertex: Vertex,
    segment: u32,
    time: f64,
    met: u32,
    /// The state before; [`NONE`] at the start.
    parent: u32,
    /// The edge by which it came, and when it set out; [`NONE`] if it stayed on.
    edge: Edge,
    set_out: f64,
    /// The path ends here, and `met` has everybody who comes later.
    ends: bool,
}

/// An entry of the open list; the greatest meets the fewest, then has the least estimate, and of equal ones the latest time.
#[derive(Debug, PartialEq)]
struct Entry {
    met: u32,
    estimate: f64,
    time: f64,
    state: u32,
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        (other.met.cmp(&self.met))
            .then(other.estimate.total_cmp(&self.estimate))
            .then(self.time.total_cmp(&other.time))
            .then(other.state.cmp(&self.state))
    }
}

/// A query's lines of time: where those of a vertex or an edge begin in a list, and how many there are.
type Line = (u32, u32, u32);

/// The search, with its memory.
#[derive(Debug)]
pub struct Fewest {
    states: Vec<State>,
    open: BinaryHeap<Entry>,
    segments: Vec<Segment>,
    parts: Vec<Part>,
    /// Per vertex and per edge, with the query that asked last.
    of_vertices: Vec<Line>,
    of_edges: Vec<Line>,
    query: u32,
    claims: Vec<Claim>,
    changes: Vec<(f64, bool)>,
    /// States expanded since the beginning.
    pub expanded: u64,
}

impl Fewest {
    /// For a roadmap.
    pub fn new(roadmap: &Roadmap) -> Self {
        Self {
            states: Vec::new(),
            open: BinaryHeap::new(),
            segments: Vec::new(),
            parts: Vec::new(),
            of_vertices: vec![(0, 0, 0); roadmap.vertices()],
            of_edges: vec![(0, 0, 0); roadmap.edges()],
            query: 0,
            claims: Vec::new(),
            changes: Vec::new(),
            expanded: 0,
        }
    }

    /// The path of a disc, which has none in the crowd, to the goal where it stays.
    pub fn find(
        &mut self,
        roadmap: &Roadmap,
        crowd: &Crowd<'_>,
        task: &Task<'_>,
        stop: &mut dyn FnMut() -> bool,
    ) -> Found {
        if self.query == u32::MAX {
            self.of_vertices.fill((0, 0, 0));
            self.of_edges.fill((0, 0, 0));
            self.query = 0;
        }
        self.query += 1;
        self.states.clear();
        self.open.clear();
        self.segments.clear();
        self.parts.clear();
        let (first, _) = self.of_vertex(crowd, task.start);
        let met = self.segments[first as usize].part.present;
        self.enter(
            roadmap,
            crowd,
            task,
            State {
                vertex: task.start,
                segment: first,
                time: 0.0,
                met,
                parent: NONE,
                edge: NONE,
                set_out: 0.0,
                ends: false,
            },
        );
        while let Some(Entry { state: id, .. }) = self.open.pop() {
            let state = self.states[id as usize];
            if state.ends {
                return Found::Path(self.path(id));
            }
            let segment = &mut self.segments[state.segment as usize];
            if segment.closed <= state.time {
                continue;
            }
            segment.closed = state.time;
            let end = segment.part.end;
            self.expanded += 1;
            if self.expanded.is_multiple_of(PATIENCE) && stop() {
                return Found::Stopped;
            }
            // Staying on, although somebody comes or has gone.
            if end < f64::INFINITY {
                let segment = state.segment + 1;
                let fresh = self.segments[segment as usize].part.fresh;
                let stayed = State {
                    segment,
                    time: end,
                    met: state.met + fresh,
                    parent: id,
                    edge: NONE,
                    ..state
                };
                self.enter(roadmap, crowd, task, stayed);
            }
            for edge in roadmap.leaving(state.vertex) {
                self.go(roadmap, crowd, task, (id, edge, end));
            }
        }
        Found::None
    }

    /// Enters the segments that an edge leads to from a state which lasts until `end`. Into each there is the earliest way, and those
    /// that wait for others on the edge and meet fewer.
    fn go(
        &mut self,
        roadmap: &Roadmap,
        crowd: &Crowd<'_>,
        task: &Task<'_>,
        (id, edge, end): (u32, Edge, f64),
    ) {
        let state = self.states[id as usize];
        let (vertex, duration) = (roadmap.target(edge), roadmap.duration(edge));
        let (line, count) = self.of_vertex(crowd, vertex);
        let (parts, number) = self.of_edge(crowd, edge);
        let earliest = state.time + duration;
        let before = self.segments[line as usize..(line + count) as usize]
            .partition_point(|segment| segment.part.end <= earliest);
        for at in line + before as u32..line + count {
            let into = self.segments[at as usize];
            let mut set_out = state.time.max(into.part.begin - duration);
            if set_out > end {
                break;
            }
            let last = end.min(into.part.end - duration);
            let from = self.parts[parts as usize..(parts + number) as usize]
                .partition_point(|part| part.end <= set_out);
            let mut fewest = u32::MAX;
            for part in parts + from as u32..parts + number {
                let part = self.parts[part as usize];
                if set_out > last {
                    break;
                }
                if part.present < fewest {
                    fewest = part.present;
                    let time = (set_out + duration).max(into.part.begin);
                    let met = state.met + fewest + into.part.present;
                    if time < into.part.end && !no_worse(into.open, (time, met)) {
                        let reached = State {
                            vertex,
                            segment: at,
                            time,
                            met,
                            parent: id,
                            edge,
                            set_out,
                            ends: false,
                        };
                        self.enter(roadmap, crowd, task, reached);
                    }
                }
                if fewest == 0 {
                    break;
                }
                set_out = part.end;
            }
        }
    }

    fn enter(&mut self, roadmap: &Roadmap, crowd: &Crowd<'_>, task: &Task<'_>, state: State) {
        let into = &mut self.segments[state.segment as usize];
        let way = (state.time, state.met);
        if no_worse(into.open, way) {
            return;
        }
        if no_worse(way, into.open) {
            into.open = way;
        }
        let rest = task.rest.from(roadmap, 0, state.vertex, |_| 0.0);
        if rest == f64::INFINITY {
            return;
        }
        if task.rest.is_over(0, state.vertex) {
            // Whoever is left to come would be met by staying.
            let (first, count) = self.of_vertex(crowd, state.vertex);
            let later = &self.segments[state.segment as usize + 1..(first + count) as usize];
            let later: u32 = later.iter().map(|segment| segment.part.fresh).sum();
            let ends = State {
                met: state.met + later,
                ends: true,
                ..state
            };
            self.push(ends, state.time);
            if later == 0 {
                return;
            }
        }
        self.push(state, state.time + rest);
    }

    fn push(&mut self, state: State, estimate: f64) {
        self.open.push(Entry {
            met: state.met,
            estimate,
            time: state.time,
            state: self.states.len() as u32,
        });
        self.states.push(state);
    }

    /// The segments of a vertex: where they begin, and how many there are.
    fn of_vertex(&mut self, crowd: &Crowd<'_>, vertex: Vertex) -> (u32, u32) {
        let (query, first, count) = self.of_vertices[vertex as usize];
        if query == self.query {
            return (first, count);
        }
        let first = self.segments.len() as u32;
        let mut segments = std::mem::take(&mut self.segments);
        self.divide(crowd.claims_to(vertex), |part| {
            segments.push(Segment {
                part,
                closed: f64::INFINITY,
                open: (f64::INFINITY, u32::MAX),
            });
        });
        self.segments = segments;
        let count = self.segments.len() as u32 - first;
        self.of_vertices[vertex as usize] = (self.query, first, count);
        (first, count)
    }

    /// The parts of an edge's times.
    fn of_edge(&mut self, crowd: &Crowd<'_>, edge: Edge) -> (u32, u32) {
        let (query, first, count) = self.of_edges[edge as usize];
        if query == self.query {
            return (first, count);
        }
        let first = self.parts.len() as u32;
        let mut parts = std::mem::take(&mut self.parts);
        self.divide(crowd.claims_to_edge(edge), |part| parts.push(part));
        self.parts = parts;
        let count = self.parts.len() as u32 - first;
        self.of_edges[edge as usize] = (self.query, first, count);
        (first, count)
    }

    /// Divides the time from zero on where discs come and go.
    fn divide(&mut self, claims: &[Claim], mut found: impl FnMut(Part)) {
        let Self {
            claims: sorted,
            changes,
            ..
        } = self;
        sorted.clear();
        sorted.extend(claims.iter().filter(|claim| claim.span.high > 0.0));
        sorted.sort_unstable_by(|one, other| {
            (one.disc.cmp(&other.disc)).then(one.span.low.total_cmp(&other.span.low))
        });
        sorted.dedup_by(|next, last| {
            let joins = next.disc == last.disc && next.span.low <= last.span.high + TOUCHING;
            if joins {
                last.span.high = last.span.high.max(next.span.high);
            }
            joins
        });
        changes.clear();
        for Claim {
            span: Span { low, high },
            ..
        } in sorted
        {
            changes.push((low.max(0.0), true));
            if *high < f64::INFINITY {
                changes.push((*high, false));
            }
        }
        changes.sort_unstable_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
        let (mut begin, mut present, mut fresh) = (0.0, 0, 0);
        for (time, comes) in changes {
            if *time > begin {
                found(Part {
                    begin,
                    end: *time,
                    present,
                    fresh,
                });
                (begin, fresh) = (*time, 0);
            }
            if *comes {
                present += 1;
                fresh += 1;
            } else {
                present -= 1;
            }
        }
        found(Part {
            begin,
            end: f64::INFINITY,
            present,
            fresh,
        });
    }

    fn path(&self, last: u32) -> Path {
        let mut state = self.states[last as usize];
        let mut path = Path::new();
        let (mut departure, mut onward) = (f64::INFINITY, NONE);
        loop {
            let before = (state.parent != NONE).then(|| self.states[state.parent as usize]);
            // Who stays on arrived before.
            if state.edge != NONE || before.is_none() {
                path.push(Visit {
                    vertex: state.vertex,
                    arrival: state.time,
                    departure,
                    onward,
                });
                (departure, onward) = (state.set_out, state.edge);
            }
            let Some(before) = before else { break };
            state = before;
        }
        path.reverse();
        path
    }
}

/// True if a way into a segment comes no later than another, and meets no more discs.
fn no_worse(way: (f64, u32), other: (f64, u32)) -> bool {
    way.0 <= other.0 && way.1 <= other.1
}
