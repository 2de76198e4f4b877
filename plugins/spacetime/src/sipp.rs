//! SIPP: the earliest arrival of one agent among the paths of the others.
//!
//! M. Phillips, M. Likhachev, "SIPP: safe interval path planning for dynamic
//! environments", ICRA 2011. A state is a vertex and one of its safe intervals; only
//! the earliest arrival in it matters. On the grid a state's intervals are read off
//! the bits of [`Reservations`], and the open list is an array of buckets, because
//! lengths are small integers.

use crate::distance::Distances;
use crate::graph::{DIRECTIONS, Vertex};
use crate::random::Random;
use crate::reservation::Reservations;

const NONE: u32 = u32::MAX;
/// Expansions between two questions whether to stop.
const PATIENCE: u64 = 512;

/// A vertex reached at `time`, where the agent may stay until `until`.
#[derive(Debug, Clone, Copy)]
struct State {
    v: Vertex,
    time: u32,
    until: u32,
    parent: u32,
}

/// The search, with its scratch memory.
#[derive(Debug, Default)]
pub struct Sipp {
    states: Vec<State>,
    buckets: Vec<Vec<u32>>,
    /// One bit per vertex and end of interval; what to clear is in `touched`.
    closed: Vec<u64>,
    touched: Vec<u32>,
    /// States expanded since the beginning.
    pub expansions: u64,
}

impl Sipp {
    /// The path of earliest arrival among those that arrive by `bound`.
    pub fn plan(
        &mut self,
        reservations: &Reservations,
        distances: &Distances<'_>,
        (agent, start, goal): (usize, Vertex, Vertex),
        bound: usize,
        random: &mut Random,
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<Vec<Vertex>> {
        let graph = distances.graph();
        let horizon = reservations.horizon();
        // The last time step is kept free of arrivals so that "stays for ever" shows.
        let bound = bound.min(horizon - 2) as u32;
        let earliest = reservations.free_for_ever(goal) as u32;
        let least = distances.known(agent, start).max(earliest);
        if least > bound || reservations.busy(start, 0) {
            return None;
        }
        let words = graph.len() * horizon / 64;
        if self.closed.len() < words {
            self.closed.resize(words, 0);
        }
        self.states.clear();
        for bucket in &mut self.buckets {
            bucket.clear();
        }
        let needed = (bound - least + 1) as usize;
        if self.buckets.len() < needed {
            self.buckets.resize_with(needed, Vec::new);
        }
        let until = reservations.next_busy(start, 0) as u32 - 1;
        self.states.push(State {
            v: start,
            time: 0,
            until,
            parent: NONE,
        });
        self.buckets[0].push(0);
        // Which direction comes first decides between equals.
        let turn = random.below(2 * DIRECTIONS);

        let mut found = None;
        let mut current = 0;
        let mut patience = PATIENCE;
        while current < needed {
            let Some(id) = self.buckets[current].pop() else {
                current += 1;
                continue;
            };
            let state = self.states[id as usize];
            let key = state.v as usize * horizon + state.until as usize;
            let mask = 1 << (key % 64);
            if self.closed[key / 64] & mask != 0 {
                continue;
            }
            self.closed[key / 64] |= mask;
            self.touched.push((key / 64) as u32);
            self.expansions += 1;
            let for_ever = state.until as usize == horizon - 1;
            if state.v == goal && for_ever {
                found = Some(id);
                break;
            }
            patience -= 1;
            if patience == 0 {
                patience = PATIENCE;
                if stop() {
                    break;
                }
            }
            let around = graph.around(state.v);
            for k in 0..DIRECTIONS {
                let d = (if turn < DIRECTIONS {
                    k + turn
                } else {
                    turn - k
                }) % DIRECTIONS;
                let u = around[d];
                if u == graph.wall() {
                    continue;
                }
                let rest = distances.known(agent, u);
                let latest = state
                    .until
                    .saturating_add(1)
                    .min(bound.saturating_sub(rest)) as usize;
                let back = (d + 2) % DIRECTIONS;
                let mut time = reservations.next_free(u, state.time as usize + 1);
                while time <= latest {
                    let busy = reservations.next_busy(u, time);
                    let arrival = time + usize::from(reservations.leaves(u, back, time - 1));
                    let key = u as usize * horizon + busy - 1;
                    if arrival < busy
                        && arrival <= latest
                        && self.closed[key / 64] >> (key % 64) & 1 == 0
                    {
                        let f = (arrival as u32 + rest).max(least);
                        let child = self.states.len() as u32;
                        let (time, until) = (arrival as u32, busy as u32 - 1);
                        self.states.push(State {
                            v: u,
                            time,
                            until,
                            parent: id,
                        });
                        self.buckets[(f - least) as usize].push(child);
                    }
                    time = reservations.next_free(u, busy);
                }
            }
        }
        for word in self.touched.drain(..) {
            self.closed[word as usize] = 0;
        }
        found.map(|id| self.trace(id))
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
