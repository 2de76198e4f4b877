//! SIPP: the path of one disc among the paths of others that arrives earliest.
//!
//! M. Phillips, M. Likhachev, "SIPP: safe interval path planning for dynamic environments", ICRA 2011. A state is a vertex
//! and one of its safe intervals; of the ways into it only the earliest matters, since a disc may wait there. On a roadmap
//! with crossing edges an edge has times of its own at which nobody may set out on it (Kasaura et al., RA-L 2022).

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use fleetyard_plugin_plane::spans::Spans;

use crate::plan::{Path, Visit};
use crate::rest::Rest;
use crate::roadmap::{Edge, NONE, Roadmap, Vertex};

/// Expansions between two calls of `stop`.
const PATIENCE: u64 = 256;

/// The times that others take from a disc.
pub trait Taken {
    /// Times at which a vertex is taken.
    fn vertex(&self, vertex: Vertex) -> &Spans;

    /// The first time from `time` on at which the disc may set out on an edge.
    fn first_free(&self, edge: Edge, time: f64) -> f64;

    /// The same for times that grow from call to call: `at` is 0 at first, and belongs to whoever answers.
    fn first_free_after(&self, edge: Edge, time: f64, at: &mut usize) -> f64 {
        let _ = at;
        self.first_free(edge, time)
    }
}

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

/// The question for one disc.
#[derive(Debug, Clone, Copy)]
pub struct Task<'a> {
    /// Its start.
    pub start: Vertex,
    /// The direction in which it looks there, in radians; none where that does not matter.
    pub direction: Option<f64>,
    /// Its goals.
    pub rest: &'a Rest,
    /// Seconds after which nothing is in its way and its goals need not be met; infinite for a whole path.
    pub until: f64,
}

impl Task<'_> {
    /// Lower bound of the seconds that the disc needs, were it alone; infinite where no way leads to its goals.
    pub fn alone(&self, roadmap: &Roadmap) -> f64 {
        let met = self.rest.met(0, self.start);
        self.rest.from(roadmap, met, self.start, |_| 0.0)
    }

    /// Seconds in which a disc that has to turn first has neither turned to where its way leads nor come to the next vertex; none
    /// for one that may set out at once.
    pub fn least_stay(&self, roadmap: &Roadmap) -> f64 {
        let met = self.rest.met(0, self.start);
        let Some(direction) = self
            .direction
            .filter(|_| !self.rest.is_over(met, self.start))
        else {
            return 0.0;
        };
        let way = |line: &Edge| {
            let onward = self.rest.after(roadmap, met, roadmap.target(*line), *line);
            roadmap.turn(direction, *line) + roadmap.in_motion(*line) + onward
        };
        let lines = roadmap.lines(self.start).map(|line| (way(&line), line));
        let first = lines.min_by(|one, other| one.0.total_cmp(&other.0));
        first.map_or(0.0, |(_, line)| match roadmap.turn(direction, line) {
            turn if turn > 0.0 => turn + roadmap.duration(line),
            _ => 0.0,
        })
    }
}

/// A state that was reached: at rest.
#[derive(Debug, Clone, Copy)]
struct Node {
    vertex: Vertex,
    key: Key,
    arrival: f64,
    /// The state before, or its own number at the start.
    parent: u32,
    /// Time at which the disc left the vertex before, and its drive from there: the first line and the number of lines.
    set_out: f64,
    drive: (Edge, u32),
}

/// The difference between states at one vertex.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Key {
    /// The number of the vertex's safe interval.
    interval: u32,
    /// Goals that are met.
    met: u32,
    /// The line by which it came, which says where it looks; [`NONE`] where that does not matter, and at the start.
    line: Edge,
}

/// An entry of the open list; the greatest has the least estimate, and of equal ones the latest arrival.
#[derive(PartialEq)]
struct Entry {
    estimate: f64,
    arrival: f64,
    node: u32,
    /// A state by an edge from the node that has yet to be reached, no earlier than that.
    later: Option<Later>,
}

/// The states at the end of an edge come one at a time: most are later than anybody needs.
#[derive(Clone, Copy, PartialEq)]
struct Later {
    edge: Edge,
    /// The safe interval of the edge's target to go on with.
    interval: u32,
    /// The arrival at the node when it was expanded.
    since: f64,
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
            .then_with(|| {
                let edge = |entry: &Self| entry.later.map(|later| later.edge);
                edge(other).cmp(&edge(self))
            })
    }
}

/// The memory of searches on one roadmap, used again and again.
#[derive(Debug)]
pub struct Search {
    nodes: Vec<Node>,
    /// Per vertex the best states that were reached.
    best: Vec<Vec<(Key, u32)>>,
    touched: Vec<Vertex>,
    /// Edges of a drive, and the seconds after which each is entered.
    drive: Vec<(Edge, f64)>,
    /// Seconds beyond which an arrival is of no use; infinite at first.
    pub most: f64,
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
            drive: Vec::new(),
            most: f64::INFINITY,
            expanded: 0,
        }
    }

    /// The earliest path from the start at time 0 through all goals, where the disc stays for good. In a window the path may end
    /// with the first visit behind it, when it is as early as may be.
    pub fn find(
        &mut self,
        roadmap: &Roadmap,
        taken: &impl Taken,
        task: &Task<'_>,
        stop: &mut dyn FnMut() -> bool,
    ) -> Found {
        self.nodes.clear();
        for vertex in self.touched.drain(..) {
            self.best[vertex as usize].clear();
        }
        let mut open = BinaryHeap::new();
        let (start, rest) = (task.start, task.rest);
        let interval = taken.vertex(start).ended(0.0);
        if taken.vertex(start).safe(interval).low > 0.0 {
            return Found::None;
        }
        let met = rest.met(0, start);
        let first = Node {
            vertex: start,
            key: Key {
                interval: interval as u32,
                met: met as u32,
                line: NONE,
            },
            arrival: 0.0,
            parent: 0,
            set_out: 0.0,
            drive: (NONE, 0),
        };
        let turn = |line| task.direction.map_or(0.0, |from| roadmap.turn(from, line));
        self.reach(first, rest.from(roadmap, met, start, turn), &mut open);
        let mut taken_up = 0_u64;
        while let Some(Entry {
            arrival,
            node,
            later,
            ..
        }) = open.pop()
        {
            taken_up += 1;
            if taken_up.is_multiple_of(PATIENCE) && stop() {
                return Found::Stopped;
            }
            let from = self.nodes[node as usize];
            if let Some(later) = later {
                if later.since <= from.arrival {
                    self.go_on(roadmap, taken, task, (node, later), &mut open);
                }
                continue;
            }
            if arrival > from.arrival {
                continue;
            }
            self.expanded += 1;
            let safe = taken.vertex(from.vertex).safe(from.key.interval as usize);
            let is_over = rest.is_over(from.key.met as usize, from.vertex);
            if from.arrival >= task.until || is_over && safe.high >= task.until {
                return Found::Path(self.path(roadmap, node));
            }
            if !roadmap.is_driven() {
                for edge in roadmap.leaving(from.vertex) {
                    let there = taken.vertex(roadmap.target(edge));
                    let first = Later {
                        edge,
                        interval: there.ended(from.arrival + roadmap.duration(edge)) as u32,
                        since: from.arrival,
                    };
                    self.go_on(roadmap, taken, task, (node, first), &mut open);
                }
                continue;
            }
            for line in roadmap.lines(from.vertex) {
                let turn = if node == 0 {
                    turn(line)
                } else {
                    match from.key.line {
                        NONE => 0.0,
                        last => roadmap.turn_between(last, line),
                    }
                };
                self.drive_on(
                    roadmap,
                    taken,
                    task,
                    (node, line, from.arrival + turn),
                    &mut open,
                );
            }
        }
        Found::None
    }

    /// Reaches the next state by an edge where nobody needs time to speed up, and puts those after it off.
    fn go_on(
        &mut self,
        roadmap: &Roadmap,
        taken: &impl Taken,
        task: &Task<'_>,
        (node, later): (u32, Later),
        open: &mut BinaryHeap<Entry>,
    ) {
        let from = self.nodes[node as usize];
        let leaves_by = taken
            .vertex(from.vertex)
            .safe(from.key.interval as usize)
            .high;
        let (target, duration) = (roadmap.target(later.edge), roadmap.duration(later.edge));
        let met = task.rest.met(from.key.met as usize, target);
        let rest = task.rest.after(roadmap, met, target, NONE);
        let (there, mut at_edge) = (taken.vertex(target), 0);
        let mut is_reached = false;
        for interval in later.interval as usize..=there.as_slice().len() {
            let at = there.safe(interval);
            if at.low - duration > leaves_by {
                return;
            }
            if is_reached {
                if at.low + rest <= self.most {
                    open.push(Entry {
                        estimate: at.low + rest,
                        arrival: at.low,
                        node,
                        later: Some(Later {
                            interval: interval as u32,
                            ..later
                        }),
                    });
                }
                return;
            }
            // The arrival is what counts: a departure that is rounded must not lie in the interval before.
            let ready = from.arrival.max(at.low - duration);
            let earliest = taken.first_free_after(later.edge, ready, &mut at_edge);
            if earliest > leaves_by || earliest == f64::INFINITY {
                return;
            }
            let arrival = (earliest + duration).max(at.low);
            if arrival <= at.high {
                let reached = Node {
                    vertex: target,
                    key: Key {
                        interval: interval as u32,
                        met: met as u32,
                        line: NONE,
                    },
                    arrival,
                    parent: node,
                    set_out: earliest,
                    drive: (later.edge, 1),
                };
                self.reach(reached, rest, open);
                is_reached = rest < f64::INFINITY;
                if !is_reached {
                    return;
                }
            }
        }
    }

    /// Reaches what a state leads to by drives from rest to rest that begin with a line, not before a time.
    fn drive_on(
        &mut self,
        roadmap: &Roadmap,
        taken: &impl Taken,
        task: &Task<'_>,
        (node, line, ready): (u32, Edge, f64),
        open: &mut BinaryHeap<Entry>,
    ) {
        let from = self.nodes[node as usize];
        let safe = taken.vertex(from.vertex).safe(from.key.interval as usize);
        let (mut last, mut met) = (line, from.key.met as usize);
        // The part in motion, which longer drives begin with, its duration, and when it may begin.
        let mut drive = std::mem::take(&mut self.drive);
        drive.clear();
        let (mut moving, mut begin) = (0.0, ready);
        for lines in 1.. {
            let edge = roadmap.edge_of_drive(last, lines, lines);
            let duration = moving + roadmap.duration(edge);
            drive.push((edge, moving));
            let target = roadmap.target(last);
            met = task.rest.met(met, target);
            let arrived_by = if roadmap.is_driven() { last } else { NONE };
            let estimate = task.rest.after(roadmap, met, target, arrived_by);
            let there = taken.vertex(target);
            let (mut interval, mut at_edge) = (there.ended(begin + duration), 0);
            while estimate.is_finite() && interval <= there.as_slice().len() {
                let at = there.safe(interval);
                if at.low - duration > safe.high {
                    break;
                }
                // The arrival is what counts: a departure that is rounded must not lie in the interval before.
                let earliest = match drive.as_slice() {
                    [(edge, _)] => {
                        taken.first_free_after(*edge, begin.max(at.low - duration), &mut at_edge)
                    }
                    drive => free_from(taken, drive, begin.max(at.low - duration)),
                };
                if earliest > safe.high || earliest == f64::INFINITY {
                    break;
                }
                let arrival = (earliest + duration).max(at.low);
                if arrival <= at.high {
                    let reached = Node {
                        vertex: target,
                        key: Key {
                            interval: interval as u32,
                            met: met as u32,
                            line: arrived_by,
                        },
                        arrival,
                        parent: node,
                        set_out: earliest,
                        drive: (line, lines),
                    };
                    self.reach(reached, estimate, open);
                }
                interval += 1;
            }
            drive.pop();
            let Some(next) = roadmap.line_ahead(last) else {
                break;
            };
            let edge = roadmap.edge_of_drive(last, lines, lines + 1);
            drive.push((edge, moving));
            moving += roadmap.duration(edge);
            begin = free_from(taken, &drive, begin);
            // Behind the window a drive is as good as its beginning.
            if begin > safe.high || begin + moving >= task.until {
                break;
            }
            last = next;
        }
        self.drive = drive;
    }

    /// Keeps a state if it is reached for the first time, or earlier than before; `rest` is a lower bound of the seconds from
    /// there.
    fn reach(&mut self, reached: Node, rest: f64, open: &mut BinaryHeap<Entry>) {
        if rest.is_infinite() || reached.arrival + rest > self.most {
            return;
        }
        let best = &mut self.best[reached.vertex as usize];
        let known = best.iter().find(|(key, _)| *key == reached.key);
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
            best.push((reached.key, self.nodes.len() as u32));
            self.nodes.push(reached);
            self.nodes.len() as u32 - 1
        };
        open.push(Entry {
            estimate: reached.arrival + rest,
            arrival: reached.arrival,
            node,
            later: None,
        });
    }

    fn path(&self, roadmap: &Roadmap, last: u32) -> Path {
        let mut path = Path::new();
        let end = self.nodes[last as usize];
        path.push(Visit {
            vertex: end.vertex,
            arrival: end.arrival,
            departure: f64::INFINITY,
            onward: NONE,
        });
        let mut node = last;
        while self.nodes[node as usize].parent != node {
            let Node {
                parent,
                set_out,
                drive: (line, lines),
                ..
            } = self.nodes[node as usize];
            let begin = path.len();
            let mut departure = set_out;
            for edge in roadmap.drive(line, lines) {
                // In motion, vertices are left when they are reached.
                path.push(Visit {
                    vertex: roadmap.source(edge),
                    arrival: departure,
                    departure,
                    onward: edge,
                });
                departure += roadmap.duration(edge);
            }
            path[begin].arrival = self.nodes[parent as usize].arrival;
            path[begin..].reverse();
            node = parent;
        }
        path.reverse();
        path
    }
}

/// The first time from `time` on at which nobody is in the way of a drive; infinite if there is none.
fn free_from(taken: &impl Taken, drive: &[(Edge, f64)], mut time: f64) -> f64 {
    loop {
        let before = time;
        for (edge, after) in drive {
            let enters = time + after;
            let free = taken.first_free(*edge, enters);
            if free > enters {
                time += free - enters;
                while time + after < free {
                    time = time.next_up();
                }
            }
        }
        if time <= before || time.is_infinite() {
            return time;
        }
    }
}
