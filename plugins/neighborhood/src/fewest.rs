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

#[cfg(test)]
mod tests {
    use super::*;
    use fleetyard_plugin_spacetime::conflict::Rules;
    use fleetyard_plugin_spacetime::distance::Distances;
    use fleetyard_plugin_spacetime::sipp::Team;

    const SIDE: usize = 5;
    const HORIZON: u32 = 60;

    /// Number of agents that come to a vertex at a time.
    fn coming(team: &Conflicts, v: Vertex, t: u32) -> u32 {
        team.visits(v)
            .iter()
            .filter(|visit| visit.from == t)
            .count() as u32
    }

    /// Number of collisions in the step from one vertex to another, or in a stay.
    fn meetings(team: &Conflicts, v: Vertex, u: Vertex, t: u32) -> u32 {
        if u == v {
            return coming(team, v, t + 1);
        }
        let visits = team.visits(u).iter();
        let there = visits.filter(|visit| visit.from <= t + 1 && t < visit.until);
        let ring = team.rules().rings && team.ring(99, v, u, t).is_some();
        there.count() as u32 + u32::from(team.swaps(99, v, u, t) || ring)
    }

    /// The least (meetings, length) of a path, step by step through time.
    fn by_steps(graph: &Graph, team: &Conflicts, start: Vertex, goal: Vertex) -> (u32, u32) {
        let mut now = vec![NEVER; graph.len()];
        now[start as usize] = 0;
        let mut best = (NEVER, NEVER);
        for t in 0..HORIZON {
            let met = now[goal as usize];
            if met != NEVER {
                let later: u32 = (t + 1..=HORIZON).map(|t| coming(team, goal, t)).sum();
                best = best.min((met + later, t));
            }
            let mut next = vec![NEVER; graph.len()];
            for v in (0..graph.len() as Vertex).filter(|&v| now[v as usize] != NEVER) {
                for u in graph.neighbors(v).chain([v]) {
                    let sum = now[v as usize] + meetings(team, v, u, t);
                    next[u as usize] = next[u as usize].min(sum);
                }
            }
            now = next;
        }
        best
    }

    #[test]
    fn nobody_meets_fewer_or_is_there_earlier() {
        for seed in 0..300 {
            let mut random = Random::new(seed, 0);
            let passable: Vec<bool> = (0..SIDE * SIDE).map(|_| !random.one_in(6)).collect();
            let graph = Graph::new(SIDE, SIDE, &passable);
            let rules = Rules {
                rings: seed % 2 == 0,
                ..Rules::default()
            };
            let mut team = Conflicts::new(graph.len(), 100, rules);
            let others = 1 + random.below(8);
            for agent in 0..others {
                let mut path = vec![random.below(graph.len()) as Vertex];
                for _ in 0..random.below(20) {
                    let v = path[path.len() - 1];
                    let step = random.below(graph.degree(v) as usize + 1);
                    path.push(graph.neighbors(v).nth(step).unwrap_or(v));
                }
                team.set(agent, &path);
            }
            let (start, goal) = (
                random.below(graph.len()) as Vertex,
                random.below(graph.len()) as Vertex,
            );
            let goals = [goal];
            let mut distances = Distances::new(&graph, &goals);
            distances.complete(&mut || false);
            let known = distances.team(&goals);
            let route = known.route(0);
            let mut search = Fewest::default();
            let found = search.plan(&graph, &team, (99, start), &route, &mut random, &mut || {
                false
            });
            let expected = by_steps(&graph, &team, start, goal);
            let Some(path) = found else {
                assert_eq!(expected, (NEVER, NEVER), "seed {seed}");
                continue;
            };
            assert_eq!((path[0], path[path.len() - 1]), (start, goal));
            let length = path.len() as u32 - 1;
            let steps = path.windows(2).zip(0..);
            let on_the_way: u32 = steps
                .map(|(step, t)| meetings(&team, step[0], step[1], t))
                .sum();
            let later: u32 = (length + 1..=HORIZON).map(|t| coming(&team, goal, t)).sum();
            assert_eq!((on_the_way + later, length), expected, "seed {seed}");
        }
    }
}
