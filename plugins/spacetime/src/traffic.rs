//! Numbers of agents by cell and step, which a search uses to avoid the paths of others.
//!
//! A count per step and cell suffices for most steps; the visits of [`Conflicts`] are looked at
//! only where an agent is on the spot.

use crate::conflict::{Conflicts, FOREVER, Rules, stays};
use crate::graph::Vertex;

/// Bytes that counts may take; steps beyond that are not counted.
const MOST_COUNTS: usize = 1 << 28;

/// Counts that are allocated at a time: so many that the system gives memory only for the pages of them
/// that agents come to.
const BLOCK: usize = 1 << 18;

/// The paths of a team with their conflicts and the number of agents per step and cell.
#[derive(Debug, Clone)]
pub struct Traffic {
    conflicts: Conflicts,
    vertices: usize,
    /// Agents per step and cell, `1 << shift` steps in a block; parked ones are not in it.
    counts: Vec<Vec<u8>>,
    shift: u32,
    /// Step at which the first of those who park in a cell arrives.
    parked: Vec<u32>,
    horizon: u32,
}

impl Traffic {
    /// Nobody is anywhere.
    pub fn new(vertices: usize, agents: usize, rules: Rules) -> Self {
        Self {
            conflicts: Conflicts::new(vertices, agents, rules),
            vertices,
            counts: Vec::new(),
            shift: (BLOCK / vertices.max(1)).max(1).ilog2(),
            parked: vec![FOREVER; vertices],
            horizon: 0,
        }
    }

    /// The conflicts between the paths.
    pub fn conflicts(&self) -> &Conflicts {
        &self.conflicts
    }

    /// The step from which on everybody was parked so far.
    pub fn horizon(&self) -> u32 {
        self.horizon
    }

    /// Gives an agent a path in place of the one that it has.
    pub fn set(&mut self, agent: usize, path: &[Vertex]) {
        self.clear(agent);
        self.conflicts.set(agent, path);
        self.mark(path, 1);
    }

    /// Takes an agent away.
    pub fn clear(&mut self, agent: usize) {
        if self.conflicts.path(agent).is_empty() {
            return;
        }
        let path = self.conflicts.path(agent).to_vec();
        self.conflicts.clear(agent);
        self.mark(&path, -1);
    }

    fn mark(&mut self, path: &[Vertex], change: i8) {
        let Rules { until, delay, .. } = self.conflicts.rules();
        self.horizon = self.horizon.max((path.len() as u32).saturating_add(delay));
        let most = (MOST_COUNTS / self.vertices.max(1)) as u32;
        let steps = self.horizon.min(until.saturating_add(1)).min(most);
        let (blocks, size) = (steps.div_ceil(1 << self.shift), self.vertices << self.shift);
        while self.counts.len() < blocks as usize {
            self.counts.push(vec![0; size]);
        }
        for (v, from, until, _) in stays(path) {
            let begin = from.saturating_sub(delay);
            let end = if until == FOREVER {
                let visits = self.conflicts.visits(v).iter();
                let parked = visits.filter(|visit| visit.until == FOREVER);
                let first = parked.map(|visit| visit.from).min();
                self.parked[v as usize] = first.unwrap_or(FOREVER);
                from
            } else {
                until.saturating_add(delay).saturating_add(1)
            };
            for time in begin..end.min(steps) {
                let (block, at) = self.place(v, time);
                let count = &mut self.counts[block][at];
                *count = count.saturating_add_signed(change);
            }
        }
    }

    /// The block of a count, and its place there.
    #[inline]
    fn place(&self, v: Vertex, time: u32) -> (usize, usize) {
        let row = time as usize & ((1 << self.shift) - 1);
        (
            (time >> self.shift) as usize,
            row * self.vertices + v as usize,
        )
    }

    /// Number of agents that are somewhere and not parked there.
    #[inline]
    fn count(&self, v: Vertex, time: u32) -> u8 {
        let (block, at) = self.place(v, time);
        self.counts.get(block).map_or(0, |block| block[at])
    }

    /// Number of conflicts of an agent that goes from `from` to `to` and is there at `time`.
    #[inline]
    pub fn collisions(&self, agent: u32, from: Vertex, to: Vertex, time: u32) -> u32 {
        let there = self.count(to, time);
        let parked = u32::from(self.parked[to as usize] <= time);
        let count = u32::from(there) + parked;
        if from == to {
            return count;
        }
        // Whoever swaps or goes on in a ring leaves the cell that this one enters.
        if time == 0 || self.count(to, time - 1) == 0 {
            return count;
        }
        count + self.moves(agent, from, to, time - 1)
    }

    fn moves(&self, agent: u32, from: Vertex, to: Vertex, time: u32) -> u32 {
        let rules = self.conflicts.rules();
        if rules.delay > 0 {
            return 0;
        }
        let swaps = self.conflicts.swaps(agent, from, to, time);
        let rings = rules.rings && !swaps && self.conflicts.ring(agent, from, to, time).is_some();
        u32::from(swaps) + u32::from(rings)
    }

    /// Number of conflicts of an agent that stays in `v` after `time` for ever.
    pub fn collisions_parked(&self, agent: u32, v: Vertex, time: u32) -> u32 {
        let Rules { until, delay, .. } = self.conflicts.rules();
        let visits = self.conflicts.visits(v).iter();
        let later = visits.filter(|visit| {
            visit.agent != agent
                && visit.from <= until
                && visit.until.saturating_add(delay) > time
                && visit.from > time
        });
        later.count() as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const COLS: u32 = 5;

    fn walk() -> impl Strategy<Value = Vec<Vertex>> {
        (0..COLS * COLS, prop::collection::vec(0_u32..5, 1..9)).prop_map(|(start, moves)| {
            let mut path = vec![start];
            for step in moves {
                let v = path[path.len() - 1];
                let (row, col) = (v / COLS, v % COLS);
                path.push(match step {
                    0 if row > 0 => v - COLS,
                    1 if row + 1 < COLS => v + COLS,
                    2 if col > 0 => v - 1,
                    3 if col + 1 < COLS => v + 1,
                    _ => v,
                });
            }
            path
        })
    }

    proptest! {
        /// A path meets somebody, step by step, where it has conflicts, and nobody where it
        /// has none; whatever came and went before.
        #[test]
        fn meetings_are_conflicts(
            paths in prop::collection::vec(walk(), 1..6),
            mine in walk(),
            delay in 0_u32..3,
            rings: bool,
        ) {
            let rules = Rules { delay, rings, ..Rules::default() };
            let mut traffic = Traffic::new((COLS * COLS) as usize, paths.len() + 1, rules);
            for (agent, path) in paths.iter().enumerate() {
                traffic.set(agent, &mine);
                traffic.set(agent, path);
            }
            let me = paths.len() as u32;
            let steps = mine.windows(2).zip(1..);
            let meetings: u32 = steps.map(|(s, time)| traffic.collisions(me, s[0], s[1], time)).sum();
            let last = mine.len() as u32 - 1;
            let parked = traffic.collisions_parked(me, mine[last as usize], last);
            let conflicts = traffic.conflicts().count_on(me as usize, &mine);
            let at_start = traffic.collisions(me, mine[0], mine[0], 0);
            prop_assert_eq!(meetings + parked + at_start > 0, conflicts > 0);
        }
    }
}
