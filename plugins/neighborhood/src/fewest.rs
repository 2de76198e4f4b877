//! The path of one agent that meets the fewest others, and of these the shortest.
//!
//! SIPPS of J. Li, Z. Chen, D. Harabor, P. J. Stuckey, S. Koenig, "MAPF-LNS2: fast
//! repairing for multi-agent path finding via large neighborhood search", AAAI 2022, with
//! nobody who may not be met. The time line of a vertex falls into segments, within which
//! the same agents stand there. A state is a vertex and a segment; the way into it that
//! meets the fewest is looked at first, and a later one only if it is earlier in time.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use fleetyard_plugin_spacetime::conflict::{Conflicts, FOREVER};
use fleetyard_plugin_spacetime::graph::{Graph, Vertex};
use fleetyard_plugin_spacetime::random::Random;
use fleetyard_plugin_spacetime::sipp::Guidance;

/// No state.
const NONE: u32 = u32::MAX;
/// Later than any time.
const NEVER: u32 = u32::MAX;
/// Times from here on are equally late.
const LATEST: u32 = (1 << 24) - 1;
/// Expansions between two calls of `stop`.
const PATIENCE: u64 = 512;

/// A time during which the same agents stand at a vertex.
#[derive(Debug, Clone, Copy)]
struct Segment {
    begin: u32,
    /// First time after it; [`NEVER`] for none.
    end: u32,
    /// Number of agents at the vertex, and of those that arrived at the beginning of the segment.
    present: u32,
    fresh: u32,
    /// Time at which the way came in that was expanded last; it met no more than others will.
    closed: u32,
    /// A way into it on the open list: when it comes, and how many it meets.
    open: (u32, u32),
}

/// A vertex at a time.
#[derive(Debug, Clone, Copy)]
struct State {
    v: Vertex,
    segment: u32,
    time: u32,
    met: u32,
    parent: u32,
    /// The path ends here, and `met` has everybody who comes later.
    ends: bool,
}

/// The search, with its scratch memory.
#[derive(Debug, Default)]
pub struct Fewest {
    states: Vec<State>,
    /// Fewest meetings first, then shortest, then latest in time, then in the order of a
    /// draw and of coming up.
    open: BinaryHeap<Reverse<(u64, u64)>>,
    segments: Vec<Segment>,
    /// Per vertex the query of the last visit, and its segments.
    lines: Vec<(u32, u32, u32)>,
    query: u32,
    edges: Vec<(u32, bool)>,
    /// States expanded since the beginning.
    pub expansions: u64,
}

impl Fewest {
    /// The path of an `agent` from `start` to its goal; `None` if it was stopped or there is no
    /// way. The agent itself must be nowhere in `team`.
    pub fn plan(
        &mut self,
        graph: &Graph,
        team: &Conflicts,
        (agent, start): (u32, Vertex),
        route: &impl Guidance,
        random: &mut Random,
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<Vec<Vertex>> {
        let &goal = route.goals().last()?;
        if self.lines.len() != graph.len() || self.query == u32::MAX {
            self.lines.clear();
            self.lines.resize(graph.len(), (0, 0, 0));
            self.query = 0;
        }
        self.query += 1;
        self.states.clear();
        self.open.clear();
        self.segments.clear();
        let (first, _) = self.line(team, start);
        let mut search = Search {
            route,
            goal,
            salt: random.below(1 << 16) as u32,
            memory: self,
        };
        search.enter(team, start, first, 0, 0, NONE);
        let rings = team.rules().rings;
        let mut patience = PATIENCE;
        while let Some(Reverse((_, key))) = search.memory.open.pop() {
            let id = key as u32;
            let state = search.memory.states[id as usize];
            if state.ends {
                return Some(self.trace(id));
            }
            let segment = &mut search.memory.segments[state.segment as usize];
            if segment.closed <= state.time {
                continue;
            }
            segment.closed = state.time;
            let end = segment.end;
            search.memory.expansions += 1;
            patience -= 1;
            if patience == 0 {
                patience = PATIENCE;
                if stop() {
                    return None;
                }
            }
            // Staying on, although somebody comes or has gone.
            if end != NEVER {
                let next = state.segment + 1;
                let met = state.met + search.memory.segments[next as usize].fresh;
                search.enter(team, state.v, next, end, met, id);
            }
            for u in graph.neighbors(state.v) {
                let (line, count) = search.memory.line(team, u);
                let earliest = state.time + 1;
                let before = search.memory.segments[line as usize..(line + count) as usize]
                    .partition_point(|segment| segment.end <= earliest);
                for at in line + before as u32..line + count {
                    let into = search.memory.segments[at as usize];
                    let time = into.begin.max(earliest);
                    if time > end {
                        break;
                    }
                    if no_worse(into.open, (time, state.met + into.present)) {
                        continue;
                    }
                    let mut met = state.met + into.present;
                    // Whoever leaves as we come may come to where we leave from.
                    if time == into.begin && time > 0 {
                        met += u32::from(
                            team.swaps(agent, state.v, u, time - 1)
                                || rings && team.ring(agent, state.v, u, time - 1).is_some(),
                        );
                    }
                    search.enter(team, u, at, time, met, id);
                }
            }
        }
        None
    }

    /// The segments of a vertex: where they begin, and how many there are.
    fn line(&mut self, team: &Conflicts, v: Vertex) -> (u32, u32) {
        let (query, first, count) = self.lines[v as usize];
        if query == self.query {
            return (first, count);
        }
        let first = self.segments.len() as u32;
        // Each visit begins and ends: what changes when.
        self.edges.clear();
        for visit in team.visits(v) {
            self.edges.push((visit.from, true));
            if visit.until != FOREVER {
                self.edges.push((visit.until + 1, false));
            }
        }
        self.edges.sort_unstable();
        let (mut begin, mut present, mut fresh) = (0, 0, 0);
        for &(time, comes) in &self.edges {
            if time > begin {
                self.segments.push(Segment {
                    begin,
                    end: time,
                    present,
                    fresh,
                    closed: NEVER,
                    open: (NEVER, NEVER),
                });
                (begin, fresh) = (time, 0);
            }
            if comes {
                present += 1;
                fresh += 1;
            } else {
                present -= 1;
            }
        }
        self.segments.push(Segment {
            begin,
            end: NEVER,
            present,
            fresh,
            closed: NEVER,
            open: (NEVER, NEVER),
        });
        let count = self.segments.len() as u32 - first;
        self.lines[v as usize] = (self.query, first, count);
        (first, count)
    }

    /// The path to a state: waiting happens before each move.
    fn trace(&self, last: u32) -> Vec<Vertex> {
        let mut state = self.states[last as usize];
        let mut path = vec![state.v; state.time as usize + 1];
        while state.parent != NONE {
            let before = self.states[state.parent as usize];
            path[before.time as usize..state.time as usize].fill(before.v);
            state = before;
        }
        path
    }
}

/// True if a way into a segment comes no later than another, and meets no more agents.
#[inline]
fn no_worse(way: (u32, u32), other: (u32, u32)) -> bool {
    way.0 <= other.0 && way.1 <= other.1
}

/// A query that is being answered.
struct Search<'s, R> {
    route: &'s R,
    goal: Vertex,
    /// Decides between equals.
    salt: u32,
    memory: &'s mut Fewest,
}

impl<R: Guidance> Search<'_, R> {
    #[inline]
    fn enter(
        &mut self,
        team: &Conflicts,
        v: Vertex,
        segment: u32,
        time: u32,
        met: u32,
        parent: u32,
    ) {
        let into = &mut self.memory.segments[segment as usize];
        if no_worse(into.open, (time, met)) {
            return;
        }
        if no_worse((time, met), into.open) {
            into.open = (time, met);
        }
        let rest = self.route.rest(0, v, 0);
        if rest == NEVER {
            return;
        }
        let state = State {
            v,
            segment,
            time,
            met,
            parent,
            ends: false,
        };
        if v == self.goal {
            // Whoever is left to come would be met by staying.
            let (first, count) = self.memory.line(team, v);
            let later = &self.memory.segments[segment as usize + 1..(first + count) as usize];
            let later: u32 = later.iter().map(|segment| segment.fresh).sum();
            self.push(
                State {
                    met: met + later,
                    ends: true,
                    ..state
                },
                time,
            );
            if later == 0 {
                return;
            }
        }
        self.push(state, time.saturating_add(rest));
    }

    #[inline]
    fn push(&mut self, state: State, length: u32) {
        let id = self.memory.states.len() as u32;
        let draw = (id ^ self.salt).wrapping_mul(0x9e37_79b1) >> 24;
        let late = u64::from(LATEST.saturating_sub(state.time)) << 8 | u64::from(draw);
        let key = u64::from(state.met) << 32 | u64::from(length);
        self.memory.states.push(state);
        self.memory
            .open
            .push(Reverse((key, late << 32 | u64::from(id))));
    }
}
