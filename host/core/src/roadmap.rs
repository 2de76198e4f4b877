//! Roadmaps, graphs whose vertices lie in the plane, and plans on them.

use fleetyard_abi::Lists;
pub use fleetyard_abi::Visit;

use crate::trajectory::{Knot, TrajectoryError, TrajectoryPlan};
use crate::{Digest, Hasher};

/// A roadmap: vertices in the plane, and directed edges that are driven straight.
///
/// Invariants: at least one vertex, at most [`Roadmap::MAX_VERTICES`] and
/// [`Roadmap::MAX_EDGES`], coordinates finite and at most [`TrajectoryPlan::LARGEST`] in
/// magnitude, no edge from a vertex to itself, every edge once. An edge that can be driven
/// both ways is two.
#[derive(Debug, Clone, PartialEq)]
pub struct Roadmap {
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    /// Edges from vertex v go to `targets[offsets[v]..offsets[v + 1]]`, ascending.
    offsets: Vec<usize>,
    targets: Vec<u32>,
}

/// The reason why vertices and edges do not make a roadmap, or a plan does not fit one. Vertices,
/// edges and agents are counted from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum RoadmapError {
    #[error("there are {xs} x and {ys} y coordinates")]
    LengthMismatch { xs: usize, ys: usize },
    #[error("there are no vertices")]
    NoVertices,
    #[error("there are {found} {what}, more than {most}")]
    TooMany {
        what: &'static str,
        found: usize,
        most: usize,
    },
    #[error("vertex {vertex} is at ({x_m}, {y_m}), which is not finite or beyond ±{most:e}")]
    Position {
        vertex: usize,
        x_m: f64,
        y_m: f64,
        most: f64,
    },
    #[error("edge {edge} goes from {from} to {to}, but there are {vertices} vertices")]
    NoSuchVertex {
        edge: usize,
        from: u32,
        to: u32,
        vertices: usize,
    },
    #[error("edge {edge} goes from vertex {vertex} to itself")]
    Loop { edge: usize, vertex: u32 },
}

impl Roadmap {
    /// Most vertices that are accepted.
    pub const MAX_VERTICES: usize = 1 << 26;

    /// Most edges that are accepted.
    pub const MAX_EDGES: usize = 1 << 28;

    /// Checks the invariants and builds the roadmap. An edge given twice is kept once.
    pub fn new(
        x_m: Vec<f64>,
        y_m: Vec<f64>,
        edges: impl IntoIterator<Item = (u32, u32)>,
    ) -> Result<Self, RoadmapError> {
        let (xs, ys) = (x_m.len(), y_m.len());
        if xs != ys {
            return Err(RoadmapError::LengthMismatch { xs, ys });
        }
        let vertices = xs;
        if vertices == 0 {
            return Err(RoadmapError::NoVertices);
        }
        let too_many = |what, found: usize, most: usize| {
            let many = found > most;
            many.then_some(RoadmapError::TooMany { what, found, most })
                .map_or(Ok(()), Err)
        };
        too_many("vertices", vertices, Self::MAX_VERTICES)?;
        let most = TrajectoryPlan::LARGEST;
        for (vertex, (x, y)) in x_m.iter().zip(&y_m).enumerate() {
            // Also false for what is not a number.
            if !(x.abs() <= most && y.abs() <= most) {
                let (x_m, y_m) = (*x, *y);
                return Err(RoadmapError::Position {
                    vertex,
                    x_m,
                    y_m,
                    most,
                });
            }
        }
        let mut sorted: Vec<(u32, u32)> = Vec::new();
        for (edge, (from, to)) in edges.into_iter().enumerate() {
            if from as usize >= vertices || to as usize >= vertices {
                return Err(RoadmapError::NoSuchVertex {
                    edge,
                    from,
                    to,
                    vertices,
                });
            }
            if from == to {
                return Err(RoadmapError::Loop { edge, vertex: from });
            }
            sorted.push((from, to));
            too_many("edges", sorted.len(), Self::MAX_EDGES)?;
        }
        sorted.sort_unstable();
        sorted.dedup();
        let mut offsets = vec![0; vertices + 1];
        for (from, _) in &sorted {
            offsets[*from as usize + 1] += 1;
        }
        for vertex in 0..vertices {
            offsets[vertex + 1] += offsets[vertex];
        }
        Ok(Self {
            // One zero, as in trajectories.
            x_m: x_m.into_iter().map(|x| x + 0.0).collect(),
            y_m: y_m.into_iter().map(|y| y + 0.0).collect(),
            offsets,
            targets: sorted.into_iter().map(|(_, to)| to).collect(),
        })
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.x_m.len()
    }

    /// Number of directed edges.
    pub fn edge_count(&self) -> usize {
        self.targets.len()
    }

    /// Position of a vertex, in metres, x right and y up. It must exist.
    pub fn position_m(&self, vertex: u32) -> (f64, f64) {
        (self.x_m[vertex as usize], self.y_m[vertex as usize])
    }

    /// Targets of the edges from a vertex, ascending. The vertex must exist.
    pub fn neighbors(&self, vertex: u32) -> &[u32] {
        let vertex = vertex as usize;
        &self.targets[self.offsets[vertex]..self.offsets[vertex + 1]]
    }

    /// The edges as lines from point to point in metres; an edge there and back is one.
    pub fn lines(&self) -> impl Iterator<Item = [[f64; 2]; 2]> {
        let edges = self.edges();
        let lines = edges.filter(|(from, to)| from < to || !self.has_edge(*to, *from));
        lines.map(|(from, to)| [from, to].map(|vertex| self.position_m(vertex).into()))
    }

    /// True if there is an edge from one vertex to another; both must exist.
    pub fn has_edge(&self, from: u32, to: u32) -> bool {
        self.neighbors(from).binary_search(&to).is_ok()
    }

    /// Every edge, ascending.
    pub fn edges(&self) -> impl Iterator<Item = (u32, u32)> + '_ {
        let from = 0..self.vertices() as u32;
        from.flat_map(|from| self.neighbors(from).iter().map(move |to| (from, *to)))
    }

    /// True if every edge can be driven both ways.
    pub fn is_symmetric(&self) -> bool {
        self.edges().all(|(from, to)| self.has_edge(to, from))
    }

    /// Digest of positions and edges.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("fleetyard.roadmap/1");
        hasher.u64(self.vertices() as u64);
        for (x, y) in self.x_m.iter().zip(&self.y_m) {
            hasher.f64(*x);
            hasher.f64(*y);
        }
        for vertex in 0..self.vertices() as u32 {
            hasher.u32s(self.neighbors(vertex));
        }
        hasher.finish()
    }
}

/// A plan on a roadmap: per agent, the vertices that it visits, and when. Between two
/// visits it drives the edge at one speed.
///
/// Invariants: every agent visits a vertex, the first from time 0 on; times are finite, at
/// most [`TrajectoryPlan::LARGEST`], and ascend: nobody leaves before it arrives, and every
/// edge takes time. Whether the vertices and edges exist is for [`RoadmapPlan::check`].
#[derive(Debug, Clone, PartialEq)]
pub struct RoadmapPlan {
    paths: Lists<Visit>,
}

/// The reason why a plan on a roadmap is refused. Agents and their visits are counted from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs)]
pub enum RoadmapPlanError {
    #[error("agent {agent} visits no vertex")]
    NoVisits { agent: usize },
    #[error(
        "visit {visit} of agent {agent} is from {arrival_s} s to {departure_s} s, which is not finite or beyond {most:e}"
    )]
    Time {
        agent: usize,
        visit: usize,
        arrival_s: f64,
        departure_s: f64,
        most: f64,
    },
    #[error("agent {agent} begins at time {time_s} s, not at 0")]
    LateBegin { agent: usize, time_s: f64 },
    #[error(
        "visit {visit} of agent {agent} ends at {departure_s} s, before it begins at {arrival_s} s"
    )]
    LeavesBefore {
        agent: usize,
        visit: usize,
        arrival_s: f64,
        departure_s: f64,
    },
    #[error(
        "visit {visit} of agent {agent} begins at {arrival_s} s, but the one before ends at {departure_s} s"
    )]
    ArrivesBefore {
        agent: usize,
        visit: usize,
        arrival_s: f64,
        departure_s: f64,
    },
    #[error("visit {visit} of agent {agent} is to vertex {vertex}, but the roadmap has {vertices}")]
    NoSuchVertex {
        agent: usize,
        visit: usize,
        vertex: u32,
        vertices: usize,
    },
    #[error("visit {visit} of agent {agent}: the roadmap has no edge from {from} to {to}")]
    NoSuchEdge {
        agent: usize,
        visit: usize,
        from: u32,
        to: u32,
    },
    #[error("there are paths for {found} agents, but {expected} starts")]
    Agents { found: usize, expected: usize },
    #[error(
        "agent {agent} is at ({x_m}, {y_m}) at {time_s} s, which is neither vertex {vertex} nor an end of an edge from there"
    )]
    OffEdges {
        agent: usize,
        knot: usize,
        time_s: f64,
        x_m: f64,
        y_m: f64,
        vertex: u32,
    },
    #[error(transparent)]
    Trajectory(#[from] TrajectoryError),
}

impl RoadmapPlanError {
    /// The agent at fault, and which of its visits or knots.
    pub fn place(&self) -> Option<(usize, usize)> {
        match self {
            Self::Agents { .. } => None,
            Self::OffEdges { agent, knot, .. } => Some((*agent, *knot)),
            Self::NoVisits { agent } | Self::LateBegin { agent, .. } => Some((*agent, 0)),
            Self::Time { agent, visit, .. }
            | Self::LeavesBefore { agent, visit, .. }
            | Self::ArrivesBefore { agent, visit, .. }
            | Self::NoSuchVertex { agent, visit, .. }
            | Self::NoSuchEdge { agent, visit, .. } => Some((*agent, *visit)),
            Self::Trajectory(error) => error.place(),
        }
    }

    /// Advice to the author of the plan, if there is any.
    pub fn hint(&self) -> Option<&'static str> {
        match self {
            Self::NoVisits { .. } => Some("an agent that rests visits one vertex, from time 0 on"),
            Self::LateBegin { .. } => Some("begin with a visit that arrives at time 0"),
            Self::ArrivesBefore { .. } => Some("give the edge the time that it takes"),
            Self::NoSuchEdge { .. } => Some("edges are directed: the other way is another edge"),
            _ => None,
        }
    }
}

impl Default for RoadmapPlan {
    fn default() -> Self {
        Self::with_capacity(0, 0)
    }
}

impl RoadmapPlan {
    /// A plan without agents, ready for [`RoadmapPlan::push_path`].
    pub fn with_capacity(agents: usize, visits: usize) -> Self {
        Self {
            paths: Lists::with_capacity(agents, visits),
        }
    }

    /// Appends the visits of the next agent. Visits to one vertex that follow each other
    /// are one. A path that is refused leaves the plan as it was.
    pub fn push_path(
        &mut self,
        visits: impl IntoIterator<Item = Visit>,
    ) -> Result<(), RoadmapPlanError> {
        let mut visits = visits.into_iter().enumerate();
        let result = visits
            .try_for_each(|(number, visit)| self.push_visit(number, visit))
            .and_then(|()| self.finish_path());
        if result.is_err() {
            self.paths.drop_open_list();
        }
        result
    }

    /// Appends a visit to the path that comes after those of [`RoadmapPlan::agents`].
    /// After an error the plan is of no use. `number` counts the visits of the path, those
    /// that are not kept included.
    pub(crate) fn push_visit(
        &mut self,
        number: usize,
        given: Visit,
    ) -> Result<(), RoadmapPlanError> {
        let agent = self.agents();
        let next = Visit {
            vertex: given.vertex,
            arrival_s: given.arrival_s + 0.0,
            departure_s: given.departure_s + 0.0,
        };
        let (arrival_s, departure_s) = (next.arrival_s, next.departure_s);
        let most = TrajectoryPlan::LARGEST;
        // Also false for what is not a number.
        if !(arrival_s.abs() <= most && departure_s.abs() <= most) {
            return Err(RoadmapPlanError::Time {
                agent,
                visit: number,
                arrival_s,
                departure_s,
                most,
            });
        }
        if departure_s < arrival_s {
            return Err(RoadmapPlanError::LeavesBefore {
                agent,
                visit: number,
                arrival_s,
                departure_s,
            });
        }
        let Some(before) = self.paths.open_list().last_mut() else {
            if arrival_s != 0.0 {
                let time_s = arrival_s;
                return Err(RoadmapPlanError::LateBegin { agent, time_s });
            }
            self.paths.push_item(next);
            return Ok(());
        };
        let stays = before.vertex == next.vertex;
        let takes_s = arrival_s - before.departure_s;
        if takes_s < 0.0 || (takes_s <= 0.0 && !stays) {
            return Err(RoadmapPlanError::ArrivesBefore {
                agent,
                visit: number,
                arrival_s,
                departure_s: before.departure_s,
            });
        }
        if stays {
            before.departure_s = departure_s;
        } else {
            self.paths.push_item(next);
        }
        Ok(())
    }

    /// Makes the visits that were appended the path of the next agent.
    pub(crate) fn finish_path(&mut self) -> Result<(), RoadmapPlanError> {
        if self.paths.open_list().is_empty() {
            let agent = self.agents();
            return Err(RoadmapPlanError::NoVisits { agent });
        }
        self.paths.end_list();
        Ok(())
    }

    /// Number of agents.
    pub fn agents(&self) -> usize {
        self.paths.len()
    }

    /// One agent's visits, at least one.
    pub fn path(&self, agent: usize) -> &[Visit] {
        &self.paths[agent]
    }

    /// Every agent's visits, in order.
    pub fn paths(&self) -> impl ExactSizeIterator<Item = &[Visit]> {
        self.paths.iter()
    }

    /// Number of visits of all agents.
    pub fn visit_count(&self) -> usize {
        self.paths.items().len()
    }

    /// Time at which the last agent arrives at its last vertex, in seconds.
    pub fn horizon_s(&self) -> f64 {
        let last = self.paths().map(|path| path[path.len() - 1].arrival_s);
        last.fold(0.0, f64::max)
    }

    /// Every vertex and every edge of the plan that the roadmap lacks, by agent and visit.
    pub fn faults(&self, roadmap: &Roadmap) -> impl Iterator<Item = RoadmapPlanError> {
        let paths = self.paths().enumerate();
        paths.flat_map(move |(agent, path)| {
            (0..path.len()).filter_map(move |visit| fault(roadmap, agent, path, visit))
        })
    }

    /// Checks that every vertex and every edge of the plan is on the roadmap.
    pub fn check(&self, roadmap: &Roadmap) -> Result<(), RoadmapPlanError> {
        self.faults(roadmap).next().map_or(Ok(()), Err)
    }

    /// The same plan in the plane, without headings. The plan must fit the roadmap, which
    /// is checked.
    pub fn to_trajectories(&self, roadmap: &Roadmap) -> Result<TrajectoryPlan, RoadmapPlanError> {
        self.check(roadmap)?;
        let mut plan = TrajectoryPlan::with_capacity(self.agents(), self.visit_count());
        for path in self.paths() {
            let last = path.len() - 1;
            plan.push_path(path.iter().enumerate().flat_map(|(visit, at)| {
                let (x_m, y_m) = roadmap.position_m(at.vertex);
                let knot = |time_s| Knot {
                    time_s,
                    x_m,
                    y_m,
                    heading_rad: None,
                };
                // At its last vertex an agent rests anyway.
                let leaves = (visit < last).then(|| knot(at.departure_s));
                [Some(knot(at.arrival_s)), leaves].into_iter().flatten()
            }))?;
        }
        Ok(plan)
    }

    /// The visits of a plan in the plane that goes from vertex to vertex: each agent begins at its
    /// start, and every knot is at a vertex, the one before or the end of an edge from there. Knots
    /// may be `within_m` off; of several vertices the nearest counts, the first among equals.
    ///
    /// Times are kept as they are: how long an edge takes is not looked at.
    pub fn of_trajectories(
        plan: &TrajectoryPlan,
        roadmap: &Roadmap,
        starts: &[u32],
        within_m: f64,
    ) -> Result<Self, RoadmapPlanError> {
        if plan.agents() != starts.len() {
            return Err(RoadmapPlanError::Agents {
                found: plan.agents(),
                expected: starts.len(),
            });
        }
        let mut visits = Self::with_capacity(starts.len(), plan.knot_count());
        for (agent, (knots, start)) in plan.paths().zip(starts).enumerate() {
            let vertices = roadmap.vertices();
            if *start as usize >= vertices {
                return Err(RoadmapPlanError::NoSuchVertex {
                    agent,
                    visit: 0,
                    vertex: *start,
                    vertices,
                });
            }
            let mut vertex = *start;
            for (number, knot) in knots.iter().enumerate() {
                let next = nearest(roadmap, vertex, number > 0, knot);
                vertex = next.filter(|(_, far_m)| *far_m <= within_m).map_or(
                    Err(RoadmapPlanError::OffEdges {
                        agent,
                        knot: number,
                        time_s: knot.time_s,
                        x_m: knot.x_m,
                        y_m: knot.y_m,
                        vertex,
                    }),
                    |(vertex, _)| Ok(vertex),
                )?;
                let visit = Visit {
                    vertex,
                    arrival_s: knot.time_s,
                    departure_s: knot.time_s,
                };
                visits.push_visit(number, visit)?;
            }
            visits.finish_path()?;
        }
        Ok(visits)
    }

    /// Digest of the visits. How long an agent stays at its last vertex means nothing.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("fleetyard.roadmap-plan/1");
        hasher.u64(self.agents() as u64);
        for path in self.paths() {
            hasher.u64(path.len() as u64);
            for (visit, at) in path.iter().enumerate() {
                hasher.u64(u64::from(at.vertex));
                hasher.f64(at.arrival_s);
                if visit + 1 < path.len() {
                    hasher.f64(at.departure_s);
                }
            }
        }
        hasher.finish()
    }
}

/// Among a vertex and, if the agent may have moved, the ends of its edges the one that is nearest to a
/// knot, and its distance.
fn nearest(roadmap: &Roadmap, vertex: u32, moves: bool, knot: Knot) -> Option<(u32, f64)> {
    let ends = roadmap.neighbors(vertex).iter().filter(|_| moves);
    let all = [&vertex].into_iter().chain(ends);
    let far = all.map(|vertex| {
        let (x_m, y_m) = roadmap.position_m(*vertex);
        let (x, y) = (knot.x_m - x_m, knot.y_m - y_m);
        (*vertex, (x * x + y * y).sqrt())
    });
    far.min_by(|one, other| one.1.total_cmp(&other.1))
}

/// The fault of a visit, if the roadmap lacks its vertex or the edge that leads there. An edge
/// from a vertex that is not there is none of its own.
fn fault(
    roadmap: &Roadmap,
    agent: usize,
    path: &[Visit],
    visit: usize,
) -> Option<RoadmapPlanError> {
    let vertices = roadmap.vertices();
    let vertex = path[visit].vertex;
    if vertex as usize >= vertices {
        return Some(RoadmapPlanError::NoSuchVertex {
            agent,
            visit,
            vertex,
            vertices,
        });
    }
    let from = path[visit.checked_sub(1)?].vertex;
    let lacks = (from as usize) < vertices && !roadmap.has_edge(from, vertex);
    lacks.then_some(RoadmapPlanError::NoSuchEdge {
        agent,
        visit,
        from,
        to: vertex,
    })
}
