//! SIPP: the best path of one agent among the paths of others.
//!
//! M. Phillips, M. Likhachev, "SIPP: safe interval path planning for dynamic
//! environments", ICRA 2011. A state is a vertex and one of its safe intervals; of the
//! ways into it only the earliest matters. Here a state also has the number of goals
//! visited before, so that a sequence of goals is planned at once, and for robots that turn
//! where they look.
//!
//! Paths of others that are better not met, but may be (*soft* ones), split safe intervals
//! further, and among paths of the same length one that meets few is preferred, as in
//! SIPPS (Li, Chen, Harabor, Stuckey, Koenig, "MAPF-LNS2: fast repairing for multi-agent
//! path finding via large neighborhood search", AAAI 2022).
//!
//! Among the paths of others the search finds the shortest path; tests compare it with an
//! exhaustive search. In a window, with turns and several goals, the rest of the way is a
//! lower bound, since a robot's heading at a goal is not known.
//!
//! Intervals are read off the bits of [`Reservations`], and the open list is an array of
//! buckets, because lengths are small integers.

use crate::graph::{DIRECTIONS, Graph, Vertex};
use crate::lanes::Lanes;
use crate::random::Random;
use crate::reservation::{NEVER, Reservations};

const NONE: u32 = u32::MAX;
/// No direction.
const STAYED: u8 = DIRECTIONS as u8;
/// Room for closed states at the beginning.
const LEAST_CLOSED: usize = 1 << 10;
/// Expansions between two calls of `stop`.
const PATIENCE: u64 = 512;
/// Number of degrees of preference among equally long paths.
const DEGREES: u32 = 32;

/// The goals of an agent, and the distances to them.
pub trait Guidance {
    /// The goals, in the order in which they are to be visited.
    fn goals(&self) -> &[Vertex];

    /// True if the agent has to stay at the last goal for good. Otherwise it may go anywhere when
    /// it has been there.
    fn stays(&self) -> bool;

    /// A lower bound of the steps from `v`, looking in direction `heading`, through goal
    /// number `label` and all later ones; 0 when there is none. It must not fall by more
    /// than one in a step, and by what lanes charge for it.
    fn rest(&self, label: u32, v: Vertex, heading: u8) -> u32;

    /// Number of goals visited after a visit of `v`, if it was `label` before. A last goal to stay
    /// at is never counted.
    #[inline]
    fn reached(&self, mut label: u32, v: Vertex) -> u32 {
        let goals = self.goals();
        let all = goals.len() - usize::from(self.stays());
        while (label as usize) < all && goals[label as usize] == v {
            label += 1;
        }
        label
    }
}

impl<G: Guidance> Guidance for &G {
    fn goals(&self) -> &[Vertex] {
        (*self).goals()
    }

    fn stays(&self) -> bool {
        (*self).stays()
    }

    #[inline]
    fn rest(&self, label: u32, v: Vertex, heading: u8) -> u32 {
        (*self).rest(label, v, heading)
    }
}

/// The goals of each agent of a team: one, where it stays.
pub trait Team: Sync {
    /// The way of one of them.
    fn route(&self, agent: usize) -> impl Guidance;

    /// Steps from `v` to the goal of an agent.
    #[inline]
    fn distance(&self, agent: usize, v: Vertex) -> u32 {
        self.route(agent).rest(0, v, 0)
    }
}

/// The input of a search.
#[derive(Debug)]
pub struct Query<'a, G> {
    /// The map.
    pub graph: &'a Graph,
    /// Reservations of agents that must not be met.
    pub hard: &'a Reservations,
    /// Reservations of agents that should not be met.
    pub soft: Option<&'a Reservations>,
    /// The goals, and the distances to them.
    pub route: &'a G,
    /// The first vertex of the path.
    pub start: Vertex,
    /// The direction in which the agent looks at the beginning.
    pub heading: u8,
    /// Charge of a turn by 90°, in steps, without `turning`: robots stop for turns, even where
    /// plans do not say so.
    pub turn_charge: u32,
    /// Lanes, and the charge of moves against them; without `bound`.
    pub lanes: Option<&'a Lanes>,
    /// True if turning by 90° takes a step.
    pub turning: bool,
    /// Paths may end at this time, wherever they have come; 0: at the last goal only.
    pub window: u32,
    /// Lets the agent move in rings with others.
    pub cycles: bool,
    /// The last goal is to be reached by this time; [`NEVER`] for no limit.
    pub bound: u32,
}

/// A path that was found.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Found {
    /// A vertex per step.
    pub path: Vec<Vertex>,
    /// Time of the last visit of the last goal; where it ends with a window before that, the
    /// estimate. Charges of turns and moves come on top.
    pub length: u32,
}

/// The reason why there is no path.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Miss {
    /// None exists.
    NoPath,
    /// The search was stopped.
    Stopped,
}

/// A vertex reached at `time`, where the agent may stay until `until`.
#[derive(Debug, Clone, Copy)]
struct State {
    v: Vertex,
    time: u32,
    until: u32,
    parent: u32,
    /// Time of the visit of the last goal, or [`NEVER`].
    visited: u32,
    /// [`Found::length`] at best.
    length: u32,
    label: u32,
    /// Soft collisions on the way.
    met: u32,
    /// Sum of the charges of turns and moves on the way, in steps.
    charged: u32,
    heading: u8,
    /// The direction of the agent's last move; at the beginning its heading.
    looks: u8,
    /// The direction of the move that led here, or [`STAYED`].
    crossed: u8,
    /// The path may end here.
    ends: bool,
}

/// The search, with its scratch memory: 44 bytes per state that it meets, and 16 per state
/// that it expands.
#[derive(Debug, Default)]
pub struct Sipp {
    states: Vec<State>,
    buckets: Vec<Vec<u32>>,
    /// First bucket that may not be empty, and how many are in use.
    current: usize,
    used: usize,
    /// Expanded states, by place and interval: an open hash table of query and state, where
    /// what earlier queries left counts as empty.
    closed: Vec<(u32, u32)>,
    query: u32,
    /// States in `closed`.
    count: usize,
    /// States expanded since the beginning.
    pub expansions: u64,
    limit: u64,
}

impl Sipp {
    /// A search that is stopped when it has expanded so many states, in all queries
    /// together; 0 for no limit.
    pub fn limited(expansions: u64) -> Self {
        Self {
            limit: expansions,
            ..Self::default()
        }
    }

    /// The best path: earliest arrival at the last goal, or, in a window, the least
    /// estimate of it at the end of the window; among these one with few soft collisions.
    /// It begins at time 0 with the start and ends where the agent may stay for ever, or
    /// with the window. An agent that need not stay at its last goal goes on from there to
    /// where it is in nobody's way.
    ///
    /// A stay at the start is taken for granted: whether somebody else is there at time 0
    /// is asked only of `hard`.
    pub fn plan<G: Guidance>(
        &mut self,
        query: &Query<'_, G>,
        random: &mut Random,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Found, Miss> {
        let Query {
            hard,
            soft,
            route,
            start,
            heading,
            ..
        } = *query;
        let label = route.reached(0, start);
        let earliest = match (query.window, route.stays(), route.goals().last()) {
            (0, true, Some(&goal)) => hard.free_for_ever(goal),
            _ => 0,
        };
        let least = route.rest(label, start, heading).max(earliest);
        if least > query.bound || least == NEVER || hard.busy(start, 0) {
            return Err(Miss::NoPath);
        }
        self.begin();
        let degrees = if soft.is_none() && (route.stays() || query.window > 0) {
            1
        } else {
            DEGREES
        };
        let mut search = Search {
            query,
            goals: route.goals().len() as u32,
            least,
            degrees,
            memory: self,
        };
        let step = Step {
            parent: NONE,
            v: start,
            time: 0,
            label,
            heading,
            rest: route.rest(label, start, heading),
            visited: NEVER,
            met: 0,
            charged: 0,
            looks: heading,
            crossed: STAYED,
        };
        let change = soft.map_or(NEVER, |soft| soft.next_change(start, 0));
        search.enter(step, hard.next_busy(start, 0), change);
        // Which direction comes first decides between equals.
        let turn = random.below(2 * DIRECTIONS);
        let mut patience = PATIENCE;
        while let Some(id) = search.memory.pop() {
            let state = search.memory.states[id as usize];
            if state.ends {
                return Ok(Found {
                    path: self.trace(id, query.window),
                    length: state.length,
                });
            }
            if state.crossed != STAYED && state.until != NEVER {
                search.cross(state.parent, usize::from(state.crossed), state.until + 1);
            }
            if search.memory.is_closed(&state) {
                continue;
            }
            search.memory.close(id);
            patience -= 1;
            if patience == 0 {
                patience = PATIENCE;
                if stop() {
                    return Err(Miss::Stopped);
                }
            }
            let memory = &search.memory;
            if memory.limit > 0 && memory.expansions >= memory.limit {
                return Err(Miss::Stopped);
            }
            search.expand(id, &state, turn);
        }
        Err(Miss::NoPath)
    }

    fn begin(&mut self) {
        if self.closed.is_empty() || self.query == u32::MAX {
            self.closed.clear();
            self.closed.resize(LEAST_CLOSED, (0, NONE));
            self.query = 0;
        }
        self.query += 1;
        self.count = 0;
        self.states.clear();
        for bucket in &mut self.buckets[..self.used] {
            bucket.clear();
        }
        self.current = 0;
        self.used = 0;
    }

    #[inline]
    fn pop(&mut self) -> Option<u32> {
        while self.current < self.used {
            let last = self.buckets[self.current].pop();
            if last.is_some() {
                return last;
            }
            self.current += 1;
        }
        None
    }

    #[inline]
    fn push(&mut self, bucket: usize, state: State) {
        // A later arrival that meets fewer than the one before it comes too late for its
        // bucket, where both are less than the least length.
        let bucket = bucket.max(self.current);
        if bucket >= self.used {
            if bucket >= self.buckets.len() {
                self.buckets.resize_with(bucket + 1, Vec::new);
            }
            self.used = bucket + 1;
        }
        self.buckets[bucket].push(self.states.len() as u32);
        self.states.push(state);
    }

    /// The slot in `closed` that holds a state, or would hold it.
    #[inline]
    fn slot(&self, state: &State) -> usize {
        let place = u64::from(state.v) << 32 | u64::from(state.until);
        let rest = u64::from(state.label) << 2 | u64::from(state.heading);
        let hash = (place ^ rest.rotate_left(24)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        let mask = self.closed.len() - 1;
        let mut at = (hash >> 32) as usize & mask;
        loop {
            let (query, id) = self.closed[at];
            if query != self.query {
                return at;
            }
            let other = &self.states[id as usize];
            if other.v == state.v
                && other.until == state.until
                && other.label == state.label
                && other.heading == state.heading
            {
                return at;
            }
            at = (at + 1) & mask;
        }
    }

    /// True if the same vertex and interval was expanded, and no later.
    #[inline]
    fn is_closed(&self, state: &State) -> bool {
        let (query, id) = self.closed[self.slot(state)];
        query == self.query && self.states[id as usize].time <= state.time
    }

    fn close(&mut self, id: u32) {
        self.expansions += 1;
        let slot = self.slot(&self.states[id as usize]);
        // What is there already is later, or the state would be closed.
        self.count += usize::from(self.closed[slot].0 != self.query);
        self.closed[slot] = (self.query, id);
        if self.count * 2 > self.closed.len() {
            let old = std::mem::take(&mut self.closed);
            self.closed = vec![(0, NONE); old.len() * 2];
            for (query, id) in old {
                if query == self.query {
                    let slot = self.slot(&self.states[id as usize]);
                    self.closed[slot] = (query, id);
                }
            }
        }
    }

    /// The path to a state: waiting happens before each move.
    fn trace(&self, last: u32, window: u32) -> Vec<Vertex> {
        let mut state = self.states[last as usize];
        let mut path = vec![state.v; state.time as usize + 1];
        while state.parent != NONE {
            let before = self.states[state.parent as usize];
            path[before.time as usize..state.time as usize].fill(before.v);
            state = before;
        }
        if window > 0 {
            path.truncate(window as usize + 1);
        }
        path
    }
}

/// Quarter turns from one direction to another.
#[inline]
fn quarters(from: usize, to: usize) -> u32 {
    let turn = (from + DIRECTIONS - to) % DIRECTIONS;
    turn.min(DIRECTIONS - turn) as u32
}

/// The state to which an expansion leads.
#[derive(Clone, Copy)]
struct Step {
    parent: u32,
    v: Vertex,
    time: u32,
    label: u32,
    heading: u8,
    /// [`Guidance::rest`] from here.
    rest: u32,
    /// Time of the visit of the last goal, or [`NEVER`].
    visited: u32,
    met: u32,
    charged: u32,
    looks: u8,
    /// The direction of the move, or [`STAYED`].
    crossed: u8,
}

/// A query that is being answered.
struct Search<'s, 'a, G> {
    query: &'s Query<'a, G>,
    goals: u32,
    least: u32,
    degrees: u32,
    memory: &'s mut Sipp,
}

impl<G: Guidance> Search<'_, '_, G> {
    #[inline]
    fn expand(&mut self, id: u32, state: &State, turn: usize) {
        let turning = self.query.turning;
        let &State { v, time, until, .. } = state;
        let here = Step {
            parent: id,
            v,
            time,
            label: state.label,
            heading: state.heading,
            rest: 0,
            visited: state.visited,
            met: state.met,
            charged: state.charged,
            looks: state.looks,
            crossed: STAYED,
        };
        if turning {
            for heading in [(here.heading + 1) % 4, (here.heading + 3) % 4] {
                self.stay(here, until, time + 1, heading);
            }
        }
        if until != NEVER && self.query.soft.is_some() {
            self.stay(here, until, until + 1, here.heading);
        }
        for k in 0..DIRECTIONS {
            let d = (if turn < DIRECTIONS {
                k + turn
            } else {
                turn - k
            }) % DIRECTIONS;
            if !turning || d == usize::from(here.heading) {
                self.cross(id, d, time + 1);
            }
        }
    }

    /// The first arrival at the next vertex in direction `d` that is not before `time`. Later
    /// ones, in other intervals of that vertex, follow when this one is taken from the open
    /// list: they cost more.
    #[inline]
    fn cross(&mut self, from: u32, d: usize, mut time: u32) {
        let Query {
            graph,
            hard,
            soft,
            route,
            cycles,
            bound,
            turning,
            turn_charge,
            lanes,
            ..
        } = *self.query;
        let state = &self.memory.states[from as usize];
        let turns = if turning {
            0
        } else {
            quarters(usize::from(state.looks), d)
        };
        let (v, heading) = (state.v, state.heading);
        let u = graph.around(v)[d];
        if u == graph.wall() {
            return;
        }
        let label = route.reached(state.label, u);
        let rest = route.rest(label, u, heading);
        let step = Step {
            parent: from,
            v: u,
            time,
            label,
            heading,
            rest,
            visited: state.visited,
            met: state.met,
            charged: state.charged
                + turn_charge * turns
                + lanes.map_or(0, |lanes| lanes.charge(v, d)),
            looks: d as u8,
            crossed: d as u8,
        };
        let latest = state
            .until
            .saturating_add(1)
            .min(bound.saturating_sub(rest));
        let latest = latest.min(NEVER - 1);
        let back = (d + 2) % DIRECTIONS;
        while time <= latest {
            let free = hard.next_free(u, time);
            if free != time {
                time = free;
                continue;
            }
            // Whoever leaves as we come must not come to where we leave from.
            let blocked = if cycles {
                hard.leaves(u, back, time - 1)
            } else {
                hard.closes_ring(graph, v, u, time - 1)
            };
            if blocked {
                time += 1;
                continue;
            }
            let busy = hard.next_busy(u, time);
            let (change, met) = soft.map_or((NEVER, false), |soft| {
                let met = soft.busy(u, time) || soft.leaves(u, back, time - 1);
                (soft.next_change(u, time), met)
            });
            let step = Step {
                time,
                met: step.met + u32::from(met),
                ..step
            };
            if self.enter(step, busy, change) {
                return;
            }
            time = busy.min(change);
        }
    }

    /// Enters the states that need no move: a turn, and a stay although somebody comes that is
    /// better not met, or has gone.
    fn stay(&mut self, here: Step, until: u32, time: u32, heading: u8) {
        let Query {
            hard, soft, route, ..
        } = *self.query;
        let rest = route.rest(here.label, here.v, heading);
        if hard.busy(here.v, time) || time > self.query.bound.saturating_sub(rest) {
            return;
        }
        // Whoever is here all the time has been counted.
        let met = time > until && soft.is_some_and(|soft| soft.busy(here.v, time));
        let step = Step {
            time,
            heading,
            rest,
            met: here.met + u32::from(met),
            ..here
        };
        let change = soft.map_or(NEVER, |soft| soft.next_change(here.v, time));
        self.enter(step, hard.next_busy(here.v, time), change);
    }

    /// Puts a state on the open list, unless it is closed. Nobody is in the way until before `busy`, and nothing
    /// changes about soft collisions until before `change`.
    #[inline]
    fn enter(&mut self, step: Step, busy: u32, change: u32) -> bool {
        let Query {
            soft,
            route,
            window,
            ..
        } = *self.query;
        let (v, time) = (step.v, step.time);
        let done = step.label == self.goals;
        let visited = if done { step.visited.min(time) } else { NEVER };
        let settled = busy == NEVER
            && (done
                || step.label + 1 == self.goals
                    && route.stays()
                    && route.goals().last() == Some(&v));
        let ends = settled || window > 0 && time >= window;
        let until = match busy.min(change) {
            NEVER => NEVER,
            end => end - 1,
        };
        let length = if done {
            visited
        } else {
            time.saturating_add(step.rest)
        };
        let length = length.saturating_add(step.charged);
        let state = State {
            v,
            time,
            until,
            parent: step.parent,
            visited,
            length,
            label: step.label,
            met: step.met,
            charged: step.charged,
            looks: step.looks,
            heading: step.heading,
            crossed: step.crossed,
            ends,
        };
        if self.memory.is_closed(&state) {
            return false;
        }
        let mut degree = step.met;
        if ends && let Some(soft) = soft {
            degree += soft.visits(v, change, self.degrees);
        }
        if done {
            degree += time - visited;
        }
        let bucket =
            (length.max(self.least) - self.least) * self.degrees + degree.min(self.degrees - 1);
        self.memory.push(bucket as usize, state);
        true
    }
}
