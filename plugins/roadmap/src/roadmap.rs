//! A roadmap: vertices in the plane, and straight directed edges between them.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::ops::Range;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::motion::Motion;

use crate::drive::Limits;

/// A vertex by its number.
pub type Vertex = u32;

/// A directed edge by its number.
pub type Edge = u32;

/// No vertex and no edge.
pub const NONE: u32 = u32::MAX;

/// Seconds that an edge between two vertices at one place takes at least: less than judges tell apart, and more than rounding.
const NO_TIME: f64 = 1e-9;

/// The reason why there is no roadmap of the input.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Refused {
    /// An edge names a vertex that is none.
    NoVertex {
        /// The edge, in the order in which edges were given.
        edge: usize,
    },
    /// An edge between two places takes no time, or one takes no finite time.
    NoDuration {
        /// The edge, in the order in which edges were given.
        edge: usize,
    },
    /// A vertex has a coordinate that is no finite number.
    NoPlace {
        /// The vertex.
        vertex: usize,
    },
    /// More vertices or edges than numbers for them.
    TooLarge,
}

impl std::fmt::Display for Refused {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::NoVertex { edge } => write!(f, "edge {edge} names a vertex that is none"),
            Self::NoDuration { edge } => write!(f, "edge {edge} takes no finite time above zero"),
            Self::NoPlace { vertex } => {
                write!(f, "vertex {vertex} has a coordinate that is no number")
            }
            Self::TooLarge => f.write_str("the roadmap has too many vertices or edges"),
        }
    }
}

impl std::error::Error for Refused {}

/// The state in which a disc begins an edge, and in which it ends it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Gait {
    /// At rest at both ends.
    StopToStop,
    /// From rest to motion.
    SetOut,
    /// In motion at both ends.
    GoOn,
    /// From motion to rest.
    ComeToRest,
}

impl Gait {
    /// The gait of the way back with time running backwards.
    fn reversed(self) -> Self {
        match self {
            Self::SetOut => Self::ComeToRest,
            Self::ComeToRest => Self::SetOut,
            both => both,
        }
    }
}

/// The times that robots need because they speed up, brake and turn.
#[derive(Debug, Clone)]
pub struct Driving {
    limits: Limits,
    /// Of every line the one that leads straight on, or [`NONE`].
    ahead: Vec<Edge>,
    /// The direction of every edge, in radians.
    directions: Vec<f64>,
    /// Of every edge the number of its line.
    numbers: Vec<u32>,
    /// The least time that a drive along lines of a straight way takes beyond their times in motion.
    stopping: f64,
}

/// Vertices, and the edges that leave each of them.
///
/// Of a roadmap for robots that [speed up and brake](Roadmap::driven) an edge that begins or ends a straight way is there in each
/// [`Gait`], as edges that follow each other; the first of them is its *line*. Of others every edge is a line of its own.
#[derive(Debug, Clone)]
pub struct Roadmap {
    places: Vec<Vector>,
    starts: Vec<Edge>,
    sources: Vec<Vertex>,
    targets: Vec<Vertex>,
    durations: Vec<f64>,
    gaits: Vec<Gait>,
    /// Of every edge the one that leads back in the same time.
    twins: Vec<Edge>,
    /// The edges that enter each vertex.
    entering: Vec<Edge>,
    entering_starts: Vec<u32>,
    /// Of each of them the vertex where it begins, and its seconds.
    ways_in: Vec<(Vertex, f64)>,
    /// Mean seconds of an edge.
    mean: f64,
    /// Of every vertex the radius of the discs that come there.
    radii: Vec<f64>,
    driving: Option<Driving>,
}

/// Source, target, gait, and seconds.
type Row = (Vertex, Vertex, Gait, f64);

impl Roadmap {
    /// From places in metres, edges as (source, target, seconds), and the least distance of two centres in metres. Edges
    /// from a vertex to itself lead nowhere and are left out.
    pub fn new(
        places: Vec<Vector>,
        edges: impl IntoIterator<Item = (Vertex, Vertex, f64)>,
        separation: f64,
    ) -> Result<Self, Refused> {
        let count = places.len();
        if u32::try_from(count).is_err() {
            return Err(Refused::TooLarge);
        }
        let finite = |place: &Vector| place.x.is_finite() && place.y.is_finite();
        if let Some(vertex) = places.iter().position(|place| !finite(place)) {
            return Err(Refused::NoPlace { vertex });
        }
        let mut list = Vec::new();
        for (edge, (source, target, duration)) in edges.into_iter().enumerate() {
            if source as usize >= count || target as usize >= count {
                return Err(Refused::NoVertex { edge });
            }
            let is_in_place = places[source as usize] == places[target as usize];
            let duration = if is_in_place && duration == 0.0 {
                NO_TIME
            } else {
                duration
            };
            if !(duration > 0.0 && duration.is_finite()) {
                return Err(Refused::NoDuration { edge });
            }
            if source != target {
                list.push((source, target, Gait::StopToStop, duration));
            }
        }
        // Each edge may be there in four gaits.
        if u32::try_from(list.len() * 4).is_err() {
            return Err(Refused::TooLarge);
        }
        list.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.3.total_cmp(&b.3)));
        // Of parallel edges a planner needs the fastest.
        list.dedup_by_key(|edge| (edge.0, edge.1));
        let radii = vec![separation / 2.0; places.len()];
        Ok(Self::of_rows(places, &list, radii))
    }

    /// Of rows in their order, of which no two have the same ends and gait.
    fn of_rows(places: Vec<Vector>, list: &[Row], radii: Vec<f64>) -> Self {
        let starts = offsets(places.len(), list.iter().map(|row| row.0));
        let back = |&(source, target, gait, duration): &Row| {
            let key = (target, source, gait.reversed());
            let found = list.binary_search_by(|row| (row.0, row.1, row.2).cmp(&key));
            found
                .ok()
                .filter(|edge| list[*edge].3.total_cmp(&duration).is_eq())
                .map_or(NONE, |edge| edge as Edge)
        };
        let entering_starts = offsets(places.len(), list.iter().map(|row| row.1));
        let mut entering: Vec<Edge> = (0..list.len() as Edge).collect();
        entering.sort_by_key(|edge| list[*edge as usize].1);
        Self {
            places,
            starts,
            sources: list.iter().map(|edge| edge.0).collect(),
            targets: list.iter().map(|edge| edge.1).collect(),
            durations: list.iter().map(|edge| edge.3).collect(),
            gaits: list.iter().map(|edge| edge.2).collect(),
            twins: list.iter().map(back).collect(),
            ways_in: entering
                .iter()
                .map(|edge| (list[*edge as usize].0, list[*edge as usize].3))
                .collect(),
            mean: list.iter().map(|edge| edge.3).sum::<f64>() / list.len().max(1) as f64,
            entering,
            entering_starts,
            radii,
            driving: None,
        }
    }

    /// The roadmap for robots with limits: edges from rest to rest take their time, and those that a straight way has begin or end
    /// in motion, at the speed that is reached within the shortest of them. On the way along an edge a robot counts as going
    /// evenly. Nobody is faster than before.
    #[must_use]
    pub fn driven(&self, limits: Limits) -> Self {
        let length =
            |edge: Edge| (self.place(self.target(edge)) - self.place(self.source(edge))).norm();
        let ahead: Vec<Edge> = (0..self.edges() as Edge)
            .map(|edge| self.straight_on(edge))
            .collect();
        let mut straight = vec![false; self.edges()];
        for (edge, next) in ahead.iter().enumerate().filter(|(_, next)| **next != NONE) {
            (straight[edge], straight[*next as usize]) = (true, true);
        }
        let lengths = (0..self.edges()).filter(|edge| straight[*edge]);
        let shortest = lengths
            .map(|edge| length(edge as Edge))
            .fold(f64::INFINITY, f64::min);
        let speed = limits.speed_within(shortest);
        let mut rows: Vec<Row> = Vec::new();
        let mut lines = Vec::with_capacity(self.edges());
        let mut stopping = f64::INFINITY;
        for edge in 0..self.edges() as Edge {
            lines.push(rows.len() as Edge);
            let (metres, least) = (length(edge), self.duration(edge));
            let (source, target) = (self.source(edge), self.target(edge));
            let mut row = |gait, seconds: f64| {
                let seconds = seconds.max(least);
                rows.push((source, target, gait, seconds));
                seconds
            };
            let alone = row(Gait::StopToStop, limits.stop_to_stop(metres));
            if straight[edge as usize] && speed.is_finite() {
                let first = row(Gait::SetOut, limits.set_out(metres, speed));
                let even = row(Gait::GoOn, metres / speed);
                let last = row(Gait::ComeToRest, limits.come_to_rest(metres, speed));
                stopping = stopping
                    .min(alone - even)
                    .min((first - even) + (last - even));
            }
        }
        let mut driven = Self::of_rows(self.places.clone(), &rows, self.radii.clone());
        let mut line_ahead = vec![NONE; rows.len()];
        for (edge, next) in ahead.iter().enumerate().filter(|_| speed.is_finite()) {
            if *next != NONE {
                line_ahead[lines[edge] as usize] = lines[*next as usize];
            }
        }
        let mut number = 0;
        let numbers = driven.gaits.iter().map(|gait| {
            number += u32::from(*gait == Gait::StopToStop);
            number - 1
        });
        driven.driving = Some(Driving {
            limits,
            numbers: numbers.collect(),
            ahead: line_ahead,
            directions: (0..rows.len() as Edge)
                .map(|edge| driven.direction(edge))
                .collect(),
            stopping: if stopping.is_finite() {
                stopping.max(0.0)
            } else {
                0.0
            },
        });
        driven
    }

    /// The edge that leads on in the direction of an edge, or [`NONE`].
    fn straight_on(&self, edge: Edge) -> Edge {
        let way = |edge: Edge| self.place(self.target(edge)) - self.place(self.source(edge));
        let along = way(edge);
        let mut onward = self.leaving(self.target(edge));
        let found = onward.find(|next| {
            let next = way(*next);
            along.dot(&next) > 0.0 && along.perp(&next).abs() <= 1e-6 * along.norm() * next.norm()
        });
        found.unwrap_or(NONE)
    }

    /// The direction of an edge, in radians.
    fn direction(&self, edge: Edge) -> f64 {
        let way = self.place(self.target(edge)) - self.place(self.source(edge));
        way.y.atan2(way.x)
    }

    /// True if robots need time to turn, speed up and brake.
    pub fn is_driven(&self) -> bool {
        self.driving.is_some()
    }

    /// The first gait of each edge that leaves a vertex.
    pub fn lines(&self, vertex: Vertex) -> impl Iterator<Item = Edge> + '_ {
        let leaving = self.leaving(vertex);
        leaving.filter(|edge| self.gaits[*edge as usize] == Gait::StopToStop)
    }

    /// The line of an edge.
    fn line(&self, edge: Edge) -> Edge {
        edge - self.gaits[edge as usize] as Edge
    }

    /// The line straight on from a line.
    pub fn line_ahead(&self, line: Edge) -> Option<Edge> {
        let ahead = self.driving.as_ref()?.ahead[line as usize];
        (ahead != NONE).then_some(ahead)
    }

    /// The edges of a drive along so many lines, from rest to rest.
    pub fn drive(&self, first: Edge, lines: u32) -> impl Iterator<Item = Edge> + '_ {
        let all = std::iter::successors(Some(first), |line| self.line_ahead(*line));
        let all = all.take(lines as usize).zip(1..);
        all.map(move |(line, number)| self.edge_of_drive(line, number, lines))
    }

    /// The edge of a line that is the one of this number, from 1, of so many lines of a drive from rest to rest.
    pub fn edge_of_drive(&self, line: Edge, number: u32, lines: u32) -> Edge {
        let gait = match (number == 1, number == lines) {
            (true, true) => Gait::StopToStop,
            (true, false) => Gait::SetOut,
            (false, false) => Gait::GoOn,
            (false, true) => Gait::ComeToRest,
        };
        line + gait as Edge
    }

    /// Seconds to turn from a direction to that of an edge.
    pub fn turn(&self, from: f64, edge: Edge) -> f64 {
        let driving = self.driving.as_ref();
        driving.map_or(0.0, |driving| {
            driving.limits.turn(from, driving.directions[edge as usize])
        })
    }

    /// Seconds to turn from the direction of one edge to that of another.
    pub fn turn_between(&self, from: Edge, edge: Edge) -> f64 {
        let driving = self.driving.as_ref();
        driving.map_or(0.0, |driving| {
            self.turn(driving.directions[from as usize], edge)
        })
    }

    /// Number of vertices.
    pub fn vertices(&self) -> usize {
        self.places.len()
    }

    /// Number of directed edges.
    pub fn edges(&self) -> usize {
        self.targets.len()
    }

    /// The place of a vertex, in metres.
    pub fn place(&self, vertex: Vertex) -> Vector {
        self.places[vertex as usize]
    }

    /// The edges that leave a vertex.
    pub fn leaving(&self, vertex: Vertex) -> Range<Edge> {
        self.starts[vertex as usize]..self.starts[vertex as usize + 1]
    }

    /// The edge from one vertex to another, of several gaits the first.
    pub fn edge(&self, source: Vertex, target: Vertex) -> Option<Edge> {
        let leaving = self.leaving(source);
        let targets = &self.targets[leaving.start as usize..leaving.end as usize];
        let first = targets.partition_point(|other| *other < target);
        (targets.get(first) == Some(&target)).then_some(leaving.start + first as Edge)
    }

    /// The vertex where an edge begins.
    pub fn source(&self, edge: Edge) -> Vertex {
        self.sources[edge as usize]
    }

    /// The vertex where an edge ends.
    pub fn target(&self, edge: Edge) -> Vertex {
        self.targets[edge as usize]
    }

    /// Seconds that an edge takes.
    pub fn duration(&self, edge: Edge) -> f64 {
        self.durations[edge as usize]
    }

    /// The edge that leads back in the same time, or [`NONE`].
    pub fn twin(&self, edge: Edge) -> Edge {
        self.twins[edge as usize]
    }

    /// The same for discs of several radii, each on a part of its own: the radius of those at each vertex, in metres.
    #[must_use]
    pub fn with_radii(self, radii: Vec<f64>) -> Self {
        debug_assert_eq!(radii.len(), self.vertices(), "a radius for each vertex");
        Self { radii, ..self }
    }

    /// The least distance of the centres of two discs at vertices, or on edges that leave them, in metres.
    pub fn separation(&self, one: Vertex, other: Vertex) -> f64 {
        self.radius(one) + self.radius(other)
    }

    /// The radius of discs at a vertex, in metres.
    pub fn radius(&self, vertex: Vertex) -> f64 {
        self.radii[vertex as usize]
    }

    /// A disc's centre along an edge.
    pub fn motion(&self, edge: Edge) -> Motion {
        Motion::between(
            self.place(self.source(edge)),
            self.place(self.target(edge)),
            self.duration(edge),
        )
    }

    /// The edges that lead to a vertex.
    pub fn entering(&self, vertex: Vertex) -> &[Edge] {
        let from = self.entering_starts[vertex as usize] as usize;
        &self.entering[from..self.entering_starts[vertex as usize + 1] as usize]
    }

    /// The number of an edge's line among all lines.
    pub fn line_number(&self, edge: Edge) -> usize {
        let driving = self.driving.as_ref();
        driving.map_or(edge, |driving| driving.numbers[edge as usize]) as usize
    }

    /// Lower bounds of the seconds from the end of every line, in motion, to `goal` with nobody else on the roadmap; infinite
    /// where no way leads there.
    pub fn times_of_lines(&self, goal: Vertex) -> Vec<f64> {
        let lines = self
            .edges()
            .checked_sub(1)
            .map_or(0, |last| self.line_number(last as Edge) + 1);
        let mut times = vec![f64::INFINITY; lines];
        let mut open = BinaryHeap::new();
        for edge in self
            .entering(goal)
            .iter()
            .filter(|edge| self.line(**edge) == **edge)
        {
            times[self.line_number(*edge)] = 0.0;
            open.push(Reached {
                time: 0.0,
                vertex: *edge,
            });
        }
        while let Some(Reached { time, vertex: line }) = open.pop() {
            if time > times[self.line_number(line)] {
                continue;
            }
            let own = self.in_motion(line);
            for before in self.entering(self.source(line)) {
                if self.line(*before) != *before {
                    continue;
                }
                let straight = self.line_ahead(*before) == Some(line);
                let between = if straight {
                    0.0
                } else {
                    self.turn_between(*before, line) + self.stopping(line)
                };
                let time = time + own + between;
                let known = &mut times[self.line_number(*before)];
                if time < *known {
                    *known = time;
                    open.push(Reached {
                        time,
                        vertex: *before,
                    });
                }
            }
        }
        times
    }

    /// The least time that a line takes in any gait.
    pub fn in_motion(&self, line: Edge) -> f64 {
        let gaits = line..self.starts[self.source(line) as usize + 1];
        let own = gaits.take_while(|edge| self.line(*edge) == line);
        own.map(|edge| self.duration(edge))
            .fold(f64::INFINITY, f64::min)
    }

    /// The least time that a drive from rest to rest which begins with a line takes beyond that of its lines in motion.
    pub fn stopping(&self, line: Edge) -> f64 {
        let driving = self.driving.as_ref();
        let is_straight = self.gaits.get(line as usize + 1) == Some(&Gait::SetOut);
        driving
            .filter(|_| is_straight)
            .map_or(0.0, |driving| driving.stopping)
    }

    /// Seconds from every vertex to `goal` with nobody else on the roadmap; infinite where no way leads there. Dijkstra's algorithm
    /// with a queue in buckets (Meyer, Sanders, "Δ-stepping", Journal of Algorithms 49(1), 2003): within one the order is free.
    pub fn times_to(&self, goal: Vertex) -> Vec<f64> {
        let mut times = vec![f64::INFINITY; self.vertices()];
        times[goal as usize] = 0.0;
        let per_bucket = 2.0 / self.mean;
        // First come, first served: where a bucket holds whole ways the work stays within that of Bellman and Ford.
        let (mut buckets, mut at, mut next) = (vec![vec![(goal, 0.0)]], 0, 0);
        while at < buckets.len() {
            let Some((vertex, time)) = buckets[at].get(next).copied() else {
                buckets[at] = Vec::new();
                (at, next) = (at + 1, 0);
                continue;
            };
            next += 1;
            if time > times[vertex as usize] {
                continue;
            }
            let from = self.entering_starts[vertex as usize] as usize;
            let to = self.entering_starts[vertex as usize + 1] as usize;
            for (source, seconds) in &self.ways_in[from..to] {
                let time = time + seconds;
                if time < times[*source as usize] {
                    times[*source as usize] = time;
                    let bucket = ((time * per_bucket) as usize).max(at);
                    if bucket >= buckets.len() {
                        buckets.resize_with(bucket + 1, Vec::new);
                    }
                    buckets[bucket].push((*source, time));
                }
            }
        }
        times
    }

    /// Mean seconds of an edge; 0 without edges.
    pub fn mean_duration(&self) -> f64 {
        self.mean
    }
}

/// Of each vertex the number of rows before its own, and of all.
fn offsets(vertices: usize, rows: impl Iterator<Item = Vertex>) -> Vec<u32> {
    let mut starts = vec![0; vertices + 1];
    for vertex in rows {
        starts[vertex as usize + 1] += 1;
    }
    for vertex in 0..vertices {
        starts[vertex + 1] += starts[vertex];
    }
    starts
}

/// A vertex, or a line, in the queue of Dijkstra's algorithm; the greatest is the earliest.
#[derive(PartialEq)]
struct Reached {
    time: f64,
    vertex: Vertex,
}

impl Eq for Reached {}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        other
            .time
            .total_cmp(&self.time)
            .then(other.vertex.cmp(&self.vertex))
    }
}
