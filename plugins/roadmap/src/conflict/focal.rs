//! The low level of bounded searches: the path with the fewest conflicts of those that arrive early enough.
//!
//! As in ECBS (M. Barer, G. Sharon, R. Stern, A. Felner, SoCS 2014) a path may arrive later than the earliest one by a factor.
//! States are safe intervals (SIPP) with the earliest arrivals for each number of conflicts, and an agent may wait until those
//! that it would meet are gone, as SIPPS does (J. Li et al., AAAI 2022).

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use super::Team;
use super::constraint::Bans;
use super::low::{FINAL, Query, Stopped, met, way};
use super::path::{Segment, Single};
use super::traffic::Traffic;
use crate::roadmap::{Edge, NONE, Roadmap, Vertex};

/// Expansions after which the earliest path has to do.
const PATIENCE: u32 = 3000;

/// Expansions between two calls of `stop`: one counts whom each of its drives meets.
const BETWEEN_STOPS: u32 = 32;

/// Departures on one edge that are tried.
const DEPARTURES: usize = 3;

/// An arrival at a vertex's safe interval.
#[derive(Debug, Clone, Copy)]
struct State {
    vertex: Vertex,
    interval: u32,
    met: u64,
    arrival: f64,
    conflicts: u32,
    /// The state before, the edge from there, and the time at which the agent set out on it.
    parent: u32,
    edge: Edge,
    departure: f64,
    /// Another state at this vertex, or [`NONE`].
    next: u32,
    /// Another one arrives no later with no more conflicts.
    is_worse: bool,
}

/// An entry of the open list; the greatest has the fewest conflicts, and of equal ones the least estimate.
#[derive(Debug, PartialEq)]
struct Entry {
    conflicts: u32,
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
        let fewest = other.conflicts.cmp(&self.conflicts);
        fewest
            .then(other.way.total_cmp(&self.way))
            .then(self.arrival.total_cmp(&other.arrival))
            .then(other.state.cmp(&self.state))
    }
}

/// The memory of searches on one roadmap, used again and again.
#[derive(Debug)]
pub(super) struct Focal {
    states: Vec<State>,
    /// Per vertex the state that was added last, and the search in which that was.
    last: Vec<(u32, u32)>,
    search: u32,
    open: BinaryHeap<Entry>,
    /// The tracks of all others.
    pub(super) traffic: Traffic,
    /// States that were expanded, in all searches.
    pub(super) expanded: u64,
}

/// The question for one agent.
struct Asked<'a> {
    team: &'a Team<'a>,
    roadmap: &'a Roadmap,
    bans: &'a Bans,
    query: &'a Query<'a>,
    /// The last arrival is not after this time.
    most: f64,
}

impl Asked<'_> {
    /// The earliest last arrival by way of a state, as far as the shortest ways tell.
    fn way(&self, state: &State) -> f64 {
        let State {
            vertex,
            interval,
            met,
            arrival,
            ..
        } = *state;
        let at = (vertex, interval, met, arrival);
        way(self.roadmap, self.bans, self.query, at).max(self.bans.least)
    }
}

impl Focal {
    /// For a roadmap.
    pub(super) fn new(roadmap: &Roadmap) -> Self {
        Self {
            states: Vec::new(),
            last: vec![(NONE, 0); roadmap.vertices()],
            search: 0,
            open: BinaryHeap::new(),
            traffic: Traffic::default(),
            expanded: 0,
        }
    }

    /// The path with the fewest conflicts that arrives by `most`; none if the search for it takes too long.
    pub(super) fn find(
        &mut self,
        team: &Team<'_>,
        bans: &Bans,
        query: &Query<'_>,
        most: f64,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<Single>, Stopped> {
        if stop() {
            return Err(Stopped);
        }
        let roadmap = team.closeness.roadmap();
        let asked = Asked {
            team,
            roadmap,
            bans,
            query,
            most,
        };
        self.states.clear();
        self.open.clear();
        self.search += 1;
        let first = State {
            vertex: query.start,
            interval: bans.vertex(query.start).ended(0.0) as u32,
            met: 0,
            arrival: 0.0,
            conflicts: 0,
            parent: NONE,
            edge: NONE,
            departure: 0.0,
            next: NONE,
            is_worse: false,
        };
        self.reach(&asked, first);
        if query.start == query.goal && bans.least <= 0.0 {
            self.finish(&asked, first);
        }
        let mut patience = PATIENCE;
        while let Some(Entry { state, .. }) = self.open.pop() {
            let from = self.states[state as usize];
            if from.interval == FINAL {
                return Ok(Some(self.path(roadmap, query.start, state)));
            }
            if from.is_worse {
                continue;
            }
            self.expanded += 1;
            patience -= 1;
            if patience == 0 {
                return Ok(None);
            }
            if patience.is_multiple_of(BETWEEN_STOPS) && stop() {
                return Err(Stopped);
            }
            for edge in roadmap.leaving(from.vertex) {
                self.drive(&asked, (state, edge, from.arrival));
                for landmark in bans
                    .landmarks
                    .iter()
                    .filter(|landmark| landmark.edge == edge)
                {
                    if landmark.from > from.arrival {
                        self.drive(&asked, (state, edge, landmark.from));
                    }
                }
            }
        }
        Ok(None)
    }

    /// Reaches what drives along an edge lead to that do not begin before a time.
    fn drive(&mut self, asked: &Asked<'_>, (state, edge, ready): (u32, Edge, f64)) {
        let from = self.states[state as usize];
        let (roadmap, bans) = (asked.roadmap, asked.bans);
        let safe = bans.vertex(from.vertex).safe(from.interval as usize);
        let (target, duration) = (roadmap.target(edge), roadmap.duration(edge));
        let (there, banned) = (bans.vertex(target), bans.edge(edge));
        let place = roadmap.place(from.vertex);
        let velocity = (roadmap.place(target) - place) / duration;
        for interval in there.ended(ready + duration)..=there.as_slice().len() {
            let at = there.safe(interval);
            let mut earliest = ready.max(at.low - duration);
            for _ in 0..DEPARTURES {
                let departure = banned.first_outside(earliest);
                let arrival = (departure + duration).max(at.low);
                if departure > safe.high || departure == f64::INFINITY || arrival > at.high {
                    break;
                }
                let reached = State {
                    vertex: target,
                    interval: interval as u32,
                    met: met(bans, from.met, edge, departure),
                    arrival,
                    conflicts: from.conflicts,
                    parent: state,
                    edge,
                    departure,
                    next: NONE,
                    is_worse: false,
                };
                if asked.way(&reached) > asked.most {
                    break;
                }
                let (mut conflicts, mut clear) = (0, f64::INFINITY);
                let drive = Segment {
                    from: departure,
                    to: departure + duration,
                    place,
                    velocity,
                    edge,
                    vertex: from.vertex,
                };
                for other in self.traffic.met(asked.team, &drive) {
                    conflicts += 1;
                    clear = clear.min(asked.team.clear_of(&drive, other));
                }
                let is_free = conflicts == 0;
                if departure > from.arrival {
                    let rest = Segment::rest(roadmap, from.vertex, from.arrival, departure);
                    conflicts += self.traffic.met(asked.team, &rest).count() as u32;
                }
                let reached = State {
                    conflicts: from.conflicts + conflicts,
                    ..reached
                };
                self.reach(asked, reached);
                if target == asked.query.goal {
                    // To arrive for good it may have to set out later.
                    let departure = banned.first_outside(departure.max(bans.least - duration));
                    if departure <= safe.high {
                        let arrival = (departure + duration).max(bans.least);
                        let met = met(bans, from.met, edge, departure);
                        self.finish(
                            asked,
                            State {
                                met,
                                arrival,
                                departure,
                                ..reached
                            },
                        );
                    }
                }
                if is_free || clear <= departure {
                    break;
                }
                earliest = clear;
            }
        }
    }

    /// Ends at the goal for good, if nothing forbids it.
    fn finish(&mut self, asked: &Asked<'_>, reached: State) {
        let spans = asked.bans.vertex(reached.vertex);
        if (reached.interval as usize) < spans.as_slice().len() || !reached.arrival.is_finite() {
            return;
        }
        let rest = Segment::rest(
            asked.roadmap,
            reached.vertex,
            reached.arrival,
            f64::INFINITY,
        );
        let more = self.traffic.met(asked.team, &rest).count() as u32;
        self.reach(
            asked,
            State {
                interval: FINAL,
                conflicts: reached.conflicts + more,
                ..reached
            },
        );
    }

    /// Keeps a state if none that arrives as early has as few conflicts.
    fn reach(&mut self, asked: &Asked<'_>, reached: State) {
        let State {
            vertex,
            interval,
            met,
            arrival,
            conflicts,
            ..
        } = reached;
        let way = asked.way(&reached);
        if way > asked.most {
            return;
        }
        let (last, search) = &mut self.last[vertex as usize];
        if *search != self.search {
            (*last, *search) = (NONE, self.search);
        }
        let mut known = *last;
        while known != NONE {
            let state = &mut self.states[known as usize];
            known = state.next;
            if (state.interval, state.met) == (interval, met) {
                if state.arrival <= arrival && state.conflicts <= conflicts {
                    return;
                }
                state.is_worse |= arrival <= state.arrival && conflicts <= state.conflicts;
            }
        }
        let state = self.states.len() as u32;
        self.states.push(State {
            next: *last,
            ..reached
        });
        *last = state;
        self.open.push(Entry {
            conflicts,
            way,
            arrival,
            state,
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
