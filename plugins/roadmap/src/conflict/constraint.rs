//! Constraints of the tree, and the times that they leave to one agent.

use std::collections::BTreeMap;
use std::rc::Rc;

use fleetyard_plugin_plane::motion::Span;
use fleetyard_plugin_plane::spans::Spans;

use super::Team;
use crate::roadmap::{Edge, Roadmap, Vertex};

/// An agent that does not set out on an edge in [from, until), or is not at a vertex in (from, until).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ban {
    pub(super) agent: u32,
    pub(super) place: Place,
    pub(super) from: f64,
    pub(super) until: f64,
}

/// An edge or a vertex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Place {
    Edge(Edge),
    Vertex(Vertex),
}

/// A constraint of one node of the tree.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Constraint {
    /// The agent is not there at these times.
    Ban(Ban),
    /// The agent of the second ban is not there, since another one sets out on the edge of the first ban in its time (disjoint
    /// splitting: Andreychuk et al., AAAI 2021).
    Pass([Ban; 2]),
    /// The agent's last arrival at its goal is not before a time.
    ArriveFrom { agent: u32, time: f64 },
    /// The agent's last arrival is before a time. From that time on others keep clear of its goal.
    ArriveBefore { agent: u32, time: f64 },
}

impl Constraint {
    /// The agent that has to change its path, or that arrives in time.
    pub(super) fn agent(&self) -> u32 {
        let (Self::Ban(Ban { agent, .. })
        | Self::Pass([_, Ban { agent, .. }])
        | Self::ArriveFrom { agent, .. }
        | Self::ArriveBefore { agent, .. }) = self;
        *agent
    }

    /// True if paths of the agent are forbidden by it.
    pub(super) fn binds(&self, agent: u32) -> bool {
        match self {
            Self::Pass(both) => both.iter().any(|ban| ban.agent == agent),
            Self::ArriveBefore { .. } => true,
            _ => self.agent() == agent,
        }
    }
}

/// A start that an agent has to make.
#[derive(Debug, Clone)]
pub(super) struct Landmark {
    pub(super) edge: Edge,
    /// The start is in [from, until).
    pub(super) from: f64,
    pub(super) until: f64,
    /// Seconds from every vertex to the edge.
    pub(super) times: Rc<[f64]>,
}

/// Most tables of times to landmarks that are kept, in numbers of eight bytes.
const MOST_KEPT: usize = 1 << 20;

/// Most landmarks of one agent.
pub(super) const MOST_LANDMARKS: usize = 64;

/// A start may be so much earlier than its landmark says: times are rounded.
const EARLY: f64 = 1e-9;

/// Times at which one agent must not be at vertices or set out on edges, and bounds of its arrival.
#[derive(Debug)]
pub(super) struct Bans {
    vertices: Vec<Spans>,
    edges: Vec<Spans>,
    used_vertices: Vec<Vertex>,
    used_edges: Vec<Edge>,
    /// The last arrival is not before this time,
    pub(super) least: f64,
    /// but before that one.
    pub(super) most: f64,
    /// Starts that it has to make.
    pub(super) landmarks: Vec<Landmark>,
    /// Seconds to the sources of landmarks.
    tables: BTreeMap<Vertex, Rc<[f64]>>,
}

impl Bans {
    /// None.
    pub(super) fn new(roadmap: &Roadmap) -> Self {
        Self {
            vertices: vec![Spans::new(); roadmap.vertices()],
            edges: vec![Spans::new(); roadmap.edges()],
            used_vertices: Vec::new(),
            used_edges: Vec::new(),
            least: 0.0,
            most: f64::INFINITY,
            landmarks: Vec::new(),
            tables: BTreeMap::new(),
        }
    }

    /// Lifts all bans.
    pub(super) fn clear(&mut self) {
        for vertex in self.used_vertices.drain(..) {
            self.vertices[vertex as usize].clear();
        }
        for edge in self.used_edges.drain(..) {
            self.edges[edge as usize].clear();
        }
        (self.least, self.most) = (0.0, f64::INFINITY);
        self.landmarks.clear();
    }

    /// Adds what a constraint forbids an agent.
    pub(super) fn add(&mut self, team: &Team<'_>, agent: u32, constraint: &Constraint) {
        let own = constraint.agent() == agent;
        match *constraint {
            Constraint::Ban(ban) | Constraint::Pass([_, ban]) if own => self.ban(&ban),
            Constraint::Pass([start, _]) if start.agent == agent => self.need(team, &start),
            Constraint::ArriveFrom { time, .. } if own => self.least = self.least.max(time),
            Constraint::ArriveBefore { time, .. } if own => self.most = self.most.min(time),
            Constraint::ArriveBefore { agent, time } => {
                let beside = team.beside(agent);
                for vertex in &beside.vertices {
                    self.ban_vertex(*vertex, time, f64::INFINITY);
                }
                for (edge, near) in &beside.edges {
                    self.ban_edge(*edge, time - near.high, f64::INFINITY);
                }
            }
            _ => {}
        }
    }

    fn ban(&mut self, ban: &Ban) {
        match ban.place {
            Place::Edge(edge) => self.ban_edge(edge, ban.from, ban.until),
            Place::Vertex(vertex) => self.ban_vertex(vertex, ban.from, ban.until),
        }
    }

    /// Makes a start in the time of a ban a landmark.
    fn need(&mut self, team: &Team<'_>, start: &Ban) {
        let (Place::Edge(edge), roadmap) = (start.place, team.closeness.roadmap()) else {
            return;
        };
        let source = roadmap.source(edge);
        if self.tables.len() * roadmap.vertices() > MOST_KEPT {
            self.tables.clear();
        }
        let table = self.tables.entry(source);
        let times = table.or_insert_with(|| roadmap.times_to(source).into());
        self.landmarks.push(Landmark {
            edge,
            from: start.from - EARLY,
            until: start.until,
            times: Rc::clone(times),
        });
    }

    fn ban_edge(&mut self, edge: Edge, from: f64, until: f64) {
        let spans = &mut self.edges[edge as usize];
        if spans.as_slice().is_empty() {
            self.used_edges.push(edge);
        }
        // Spans are open, and nobody sets out at the beginning either.
        spans.insert(Span {
            low: from.next_down(),
            high: until,
        });
    }

    fn ban_vertex(&mut self, vertex: Vertex, from: f64, until: f64) {
        let spans = &mut self.vertices[vertex as usize];
        if spans.as_slice().is_empty() {
            self.used_vertices.push(vertex);
        }
        spans.insert(Span {
            low: from,
            high: until,
        });
    }

    /// Times at which the agent must not be at a vertex.
    pub(super) fn vertex(&self, vertex: Vertex) -> &Spans {
        &self.vertices[vertex as usize]
    }

    /// Times at which the agent must not set out on an edge.
    pub(super) fn edge(&self, edge: Edge) -> &Spans {
        &self.edges[edge as usize]
    }
}
