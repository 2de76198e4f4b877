//! The low level: the path of one agent that keeps its constraints and arrives earliest.
//!
//! SIPP (M. Phillips, M. Likhachev, ICRA 2011) with the safe intervals that constraints leave (Andreychuk et al., AIJ 305, 2022,
//! section 4.2), and with lower bounds of the time to the goal that are exact without constraints.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::constraint::Bans;
use super::path::Single;
use crate::roadmap::{Edge, NONE, Roadmap, Vertex};

/// Expansions between two calls of `stop`.
const PATIENCE: u64 = 1024;

/// The interval of a state at the goal from which nobody leaves again.
pub(super) const FINAL: u32 = u32::MAX;

/// A search was told to stop.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Stopped;

/// A vertex's safe interval that was reached.
#[derive(Debug, Clone, Copy)]
struct State {
    vertex: Vertex,
    interval: u32,
    /// A bit for each landmark that was met.
    met: u64,
    arrival: f64,
    /// The state before, the edge from there, and the time at which the agent set out on it.
    parent: u32,
    edge: Edge,
    departure: f64,
    /// Another state at this vertex, or [`NONE`].
    next: u32,
}

/// An entry of the open list; the greatest has the least estimate. Of equal ones, which are many where the arrival must not be
/// before a time, it is on the shortest way, and of those as far as may be.
#[derive(Debug, PartialEq)]
struct Entry {
    estimate: f64,
    /// The estimate without that time.
    way: f64,
    arrival: f64,
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
        let least = other.estimate.total_cmp(&self.estimate);
        least
            .then(other.way.total_cmp(&self.way))
            .then(self.arrival.total_cmp(&other.arrival))
            .then(other.state.cmp(&self.state))
    }
}

/// The memory of searches on one roadmap, used again and again.
#[derive(Debug)]
pub(super) struct Low {
    states: Vec<State>,
    /// Per vertex the state that was added last, and the search in which that was.
    last: Vec<(u32, u32)>,
    search: u32,
    open: BinaryHeap<Entry>,
    /// States that were expanded, in all searches.
    pub(super) expanded: u64,
}

/// The question for one agent.
#[derive(Debug, Clone, Copy)]
pub(super) struct Query<'a> {
    pub(super) start: Vertex,
    pub(super) goal: Vertex,
    /// Seconds from every vertex to the goal.
    pub(super) times: &'a [f64],
}

impl Low {
    /// For a roadmap.
    pub(super) fn new(roadmap: &Roadmap) -> Self {
        Self {
            states: Vec::new(),
            last: vec![(NONE, 0); roadmap.vertices()],
            search: 0,
            open: BinaryHeap::new(),
            expanded: 0,
        }
    }

    /// The number of searches.
    pub(super) fn searches(&self) -> u64 {
        self.search.into()
    }

    /// The path that arrives earliest, if there is one.
    pub(super) fn find(
        &mut self,
        roadmap: &Roadmap,
        bans: &Bans,
        query: &Query<'_>,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Single>, Stopped> {
        self.states.clear();
        self.open.clear();
        self.search += 1;
        let at_start = bans.vertex(query.start);
        let interval = at_start.ended(0.0);
        if at_start.safe(interval).low > 0.0 {
            return Ok(None);
        }
        let first = State {
            vertex: query.start,
            interval: interval as u32,
            met: 0,
            arrival: 0.0,
            parent: NONE,
            edge: NONE,
            departure: 0.0,
            next: NONE,
        };
        let all = u64::MAX
            .checked_shr(u64::BITS - bans.landmarks.len() as u32)
            .unwrap_or(0);
        self.reach(roadmap, bans, query, first);
        while let Some(Entry { arrival, state, .. }) = self.open.pop() {
            let from = self.states[state as usize];
            if arrival > from.arrival {
                continue;
            }
            let safe = bans.vertex(from.vertex).safe(from.interval as usize);
            let rests = from.vertex == query.goal && safe.high == f64::INFINITY;
            if from.interval == FINAL || rests && bans.least <= 0.0 && from.met == all {
                return Ok(Some(self.path(roadmap, query.start, state)));
            }
            self.expanded += 1;
            if self.expanded.is_multiple_of(PATIENCE) && stop() {
                return Err(Stopped);
            }
            for edge in roadmap.leaving(from.vertex) {
                if query.times[roadmap.target(edge) as usize] == f64::INFINITY {
                    continue;
                }
                self.drive(roadmap, bans, query, (state, edge, from.arrival));
                // It may wait to meet landmarks.
                for landmark in bans
                    .landmarks
                    .iter()
                    .filter(|landmark| landmark.edge == edge)
                {
                    if landmark.from > from.arrival {
                        self.drive(roadmap, bans, query, (state, edge, landmark.from));
                    }
                }
            }
        }
        Ok(None)
    }

    /// Reaches what a drive leads to that does not begin before a time.
    fn drive(
        &mut self,
        roadmap: &Roadmap,
        bans: &Bans,
        query: &Query<'_>,
        (state, edge, ready): (u32, Edge, f64),
    ) {
        let from = self.states[state as usize];
        let safe = bans.vertex(from.vertex).safe(from.interval as usize);
        let (target, duration) = (roadmap.target(edge), roadmap.duration(edge));
        let (there, banned) = (bans.vertex(target), bans.edge(edge));
        let intervals = there.as_slice().len();
        for interval in there.ended(ready + duration)..=intervals {
            let at = there.safe(interval);
            let departure = banned.first_outside(ready.max(at.low - duration));
            if departure > safe.high || departure == f64::INFINITY {
                break;
            }
            let arrival = (departure + duration).max(at.low);
            if arrival > at.high {
                continue;
            }
            let reached = State {
                vertex: target,
                interval: interval as u32,
                met: met(bans, from.met, edge, departure),
                arrival,
                parent: state,
                edge,
                departure,
                next: NONE,
            };
            self.reach(roadmap, bans, query, reached);
            if target != query.goal || interval < intervals || bans.least <= 0.0 {
                continue;
            }
            // Who may leave again and arrives early does not stand for those that arrive for good.
            let departure = banned.first_outside(departure.max(bans.least - duration));
            if departure <= safe.high && departure < f64::INFINITY {
                let arrival = (departure + duration).max(bans.least);
                let reached = State {
                    interval: FINAL,
                    met: met(bans, from.met, edge, departure),
                    arrival,
                    departure,
                    ..reached
                };
                self.reach(roadmap, bans, query, reached);
            }
        }
    }

    /// Keeps a state if it is reached for the first time, or earlier than before.
    fn reach(&mut self, roadmap: &Roadmap, bans: &Bans, query: &Query<'_>, reached: State) {
        let State {
            vertex,
            interval,
            met,
            arrival,
            ..
        } = reached;
        let mut way = way(roadmap, bans, query, (vertex, interval, met, arrival));
        let estimate = way.max(bans.least);
        if estimate >= bans.most || way == f64::INFINITY {
            return;
        }
        if reached.interval == FINAL {
            way = f64::NEG_INFINITY;
        }
        let (last, search) = &mut self.last[reached.vertex as usize];
        if *search != self.search {
            (*last, *search) = (NONE, self.search);
        }
        let mut known = *last;
        while known != NONE {
            let state = &self.states[known as usize];
            if (state.interval, state.met) == (reached.interval, reached.met) {
                break;
            }
            known = state.next;
        }
        if known == NONE {
            known = self.states.len() as u32;
            self.states.push(State {
                next: *last,
                ..reached
            });
            *last = known;
        } else {
            let state = &mut self.states[known as usize];
            if state.arrival <= reached.arrival {
                return;
            }
            *state = State {
                next: state.next,
                ..reached
            };
        }
        self.open.push(Entry {
            estimate,
            way,
            arrival: reached.arrival,
            state: known,
        });
    }

    fn path(&self, roadmap: &Roadmap, start: Vertex, last: u32) -> Single {
        let mut drives = Vec::new();
        let mut state = &self.states[last as usize];
        while state.parent != NONE {
            drives.push((state.edge, state.departure));
            state = &self.states[state.parent as usize];
        }
        drives.reverse();
        Single::new(roadmap, start, &drives)
    }
}

/// The earliest arrival at the goal from a vertex's interval with landmarks that are met, from a time on, as far as the shortest
/// ways tell; infinite where a landmark is missed.
pub(super) fn way(
    roadmap: &Roadmap,
    bans: &Bans,
    query: &Query<'_>,
    (vertex, interval, met, arrival): (Vertex, u32, u64, f64),
) -> f64 {
    let mut way = arrival + query.times[vertex as usize];
    for (number, landmark) in bans.landmarks.iter().enumerate() {
        if met >> number & 1 != 0 {
            continue;
        }
        let there = arrival + landmark.times[vertex as usize];
        if there >= landmark.until || interval == FINAL {
            return f64::INFINITY;
        }
        let target = roadmap.target(landmark.edge) as usize;
        let onward = roadmap.duration(landmark.edge) + query.times[target];
        way = way.max(there.max(landmark.from) + onward);
    }
    way
}

/// The landmarks that are met with one start more.
pub(super) fn met(bans: &Bans, before: u64, edge: Edge, departure: f64) -> u64 {
    let landmarks = bans.landmarks.iter().enumerate();
    let now = landmarks.filter(|(_, landmark)| {
        landmark.edge == edge && landmark.from <= departure && departure < landmark.until
    });
    now.fold(before, |met, (number, _)| met | 1 << number)
}
