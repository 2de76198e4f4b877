//! Constraints of one agent, as constraint-based searches hand them to their low level.
//!
//! - a cell during a range of steps: vertex conflicts, k-robust ones (ranges, Atzmon et al.
//!   2020; Chen et al. 2021), corridors (range constraints), rectangles (barriers are cells
//!   at single steps), and targets (a cell from a step on), all after Li et al., "Pairwise
//!   symmetry reasoning for multi-agent path finding search" (AIJ 301, 2021);
//! - a move at a step: swaps and rings;
//! - an arrival for good not before, or not after, a step: the two sides of a target conflict.

use crate::conflict::FOREVER;
use crate::graph::Vertex;

const NONE: u32 = u32::MAX;

/// One entry of a cell's list: it may not be entered from `from`, or [`NONE`] for at all.
#[derive(Debug, Clone, Copy)]
struct Entry {
    from: Vertex,
    begin: u32,
    end: u32,
    next: u32,
}

/// The constraints of one agent; made once for a graph and filled again for every search.
#[derive(Debug, Clone)]
pub struct Constraints {
    /// First entry of each vertex.
    heads: Vec<u32>,
    entries: Vec<Entry>,
    used: Vec<Vertex>,
    last: u32,
    earliest: u32,
    latest: u32,
}

impl Constraints {
    /// None, on a graph of so many vertices.
    pub fn new(vertices: usize) -> Self {
        Self {
            heads: vec![NONE; vertices],
            entries: Vec::new(),
            used: Vec::new(),
            last: 0,
            earliest: 0,
            latest: FOREVER,
        }
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        for v in self.used.drain(..) {
            self.heads[v as usize] = NONE;
        }
        self.entries.clear();
        (self.last, self.earliest, self.latest) = (0, 0, FOREVER);
    }

    fn insert(&mut self, v: Vertex, from: Vertex, begin: u32, end: u32) {
        let head = &mut self.heads[v as usize];
        if *head == NONE {
            self.used.push(v);
        }
        let next = std::mem::replace(head, self.entries.len() as u32);
        self.entries.push(Entry {
            from,
            begin,
            end,
            next,
        });
        let known = if end == FOREVER { begin } else { end };
        self.last = self.last.max(known);
    }

    /// Not in `v` from step `begin` to step `end`, both included; [`FOREVER`] for no end.
    pub fn forbid(&mut self, v: Vertex, begin: u32, end: u32) {
        self.insert(v, NONE, begin, end);
    }

    /// Not from `from` to `to` in the step that begins at `time`.
    pub fn forbid_move(&mut self, from: Vertex, to: Vertex, time: u32) {
        self.insert(to, from, time + 1, time + 1);
    }

    /// At the goal for good at `time` at the earliest.
    pub fn arrive_from(&mut self, time: u32) {
        self.earliest = self.earliest.max(time);
        self.last = self.last.max(time);
    }

    /// At the goal for good at `time` at the latest.
    pub fn arrive_by(&mut self, time: u32) {
        self.latest = self.latest.min(time);
    }

    /// The earliest step of an arrival for good that has been asked for.
    pub fn earliest(&self) -> u32 {
        self.earliest
    }

    /// The latest one.
    pub fn latest(&self) -> u32 {
        self.latest
    }

    /// The step after which nothing changes any more.
    pub fn last(&self) -> u32 {
        self.last
    }

    fn entries(&self, v: Vertex) -> impl Iterator<Item = &Entry> {
        let mut at = self.heads[v as usize];
        std::iter::from_fn(move || {
            let entry = self.entries.get(at as usize)?;
            at = entry.next;
            Some(entry)
        })
    }

    /// True if an agent that is in `from` may not be in `to` at `time`, one step later.
    #[inline]
    pub fn forbids(&self, from: Vertex, to: Vertex, time: u32) -> bool {
        self.heads[to as usize] != NONE && self.search(from, to, time)
    }

    fn search(&self, from: Vertex, to: Vertex, time: u32) -> bool {
        self.entries(to).any(|entry| {
            entry.begin <= time
                && time <= entry.end
                && (entry.from == NONE || (entry.from == from && from != to))
        })
    }

    /// The first step from which `v` is allowed for ever; [`FOREVER`] if there is none.
    pub fn free_from(&self, v: Vertex) -> u32 {
        let ends = self.entries(v).filter(|entry| entry.from == NONE);
        ends.map(|entry| entry.end.saturating_add(1))
            .max()
            .unwrap_or(0)
    }

    /// True if an agent that stays in `v` from `time` on comes into a forbidden cell no later than
    /// `until`.
    pub fn forbids_staying(&self, v: Vertex, time: u32, until: u32) -> bool {
        self.entries(v)
            .any(|entry| entry.from == NONE && entry.end >= time && entry.begin <= until)
    }

    /// True if a path keeps to the constraints, its agent staying at the end until step `until`.
    pub fn admit(&self, path: &[Vertex], until: u32) -> bool {
        let Some((&first, &last)) = path.first().zip(path.last()) else {
            return true;
        };
        !self.forbids(first, first, 0)
            && path
                .windows(2)
                .zip(1..)
                .all(|(step, time)| time > until || !self.forbids(step[0], step[1], time))
            && !self.forbids_staying(last, path.len() as u32 - 1, until)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const CELLS: Vertex = 4;
    const STEPS: u32 = 9;

    #[derive(Debug, Clone, Copy)]
    enum One {
        /// A cell, and the steps from which and up to which it is forbidden.
        Cell(Vertex, u32, u32),
        Move(Vertex, Vertex, u32),
        From(u32),
        By(u32),
    }

    fn one() -> impl Strategy<Value = One> {
        let end = prop_oneof![3 => 0..STEPS, 1 => Just(FOREVER)];
        let cell = (0..CELLS, 0..STEPS, end);
        prop_oneof![
            4 => cell.prop_map(|(v, begin, more)| One::Cell(v, begin, begin.saturating_add(more))),
            2 => (0..CELLS, 0..CELLS, 0..STEPS).prop_map(|(from, to, time)| One::Move(from, to, time)),
            1 => (0..STEPS).prop_map(One::From),
            1 => (0..STEPS).prop_map(One::By),
        ]
    }

    fn fill(table: &mut Constraints, all: &[One]) {
        for one in all {
            match *one {
                One::Cell(v, begin, end) => table.forbid(v, begin, end),
                One::Move(from, to, time) => table.forbid_move(from, to, time),
                One::From(time) => table.arrive_from(time),
                One::By(time) => table.arrive_by(time),
            }
        }
    }

    /// By the list itself.
    fn is_forbidden(all: &[One], from: Vertex, to: Vertex, time: u32) -> bool {
        all.iter().any(|one| match *one {
            One::Cell(v, begin, end) => v == to && (begin..=end).contains(&time),
            One::Move(one, other, at) => from != to && (one, other, at + 1) == (from, to, time),
            _ => false,
        })
    }

    proptest! {
        #[test]
        fn a_table_says_what_its_list_says(
            before in prop::collection::vec(one(), 0..6),
            all in prop::collection::vec(one(), 0..6),
            path in prop::collection::vec(0..CELLS, 1..6),
            until in 0..3 * STEPS,
        ) {
            let mut table = Constraints::new(CELLS as usize);
            fill(&mut table, &before);
            table.clear();
            prop_assert!(table.entries.is_empty(), "what is forgotten takes no room");
            fill(&mut table, &all);
            // Long after the last one everything is as it stays.
            let late = 4 * STEPS;
            let mut last = 0;
            for to in 0..CELLS {
                for time in 0..=late {
                    for from in 0..CELLS {
                        let wanted = is_forbidden(&all, from, to, time);
                        prop_assert_eq!(table.forbids(from, to, time), wanted);
                        let later = is_forbidden(&all, from, to, time + 1);
                        last = last.max(if wanted == later { 0 } else { time });
                    }
                    for until in time..=late {
                        let staying = (time..=until).any(|at| is_forbidden(&all, to, to, at));
                        prop_assert_eq!(table.forbids_staying(to, time, until), staying);
                    }
                }
                let free = (0..=late).rev().find(|at| is_forbidden(&all, to, to, *at));
                let free = match free {
                    Some(at) if at == late => FOREVER,
                    Some(at) => at + 1,
                    None => 0,
                };
                prop_assert_eq!(table.free_from(to), free);
            }
            let times = |of: fn(&One) -> Option<u32>| all.iter().filter_map(of);
            let from = times(|one| if let One::From(time) = one { Some(*time) } else { None });
            let by = times(|one| if let One::By(time) = one { Some(*time) } else { None });
            prop_assert_eq!(table.earliest(), from.max().unwrap_or(0));
            prop_assert_eq!(table.latest(), by.min().unwrap_or(FOREVER));
            prop_assert!(table.last() >= last.max(table.earliest()), "{}", table.last());
            prop_assert!(table.last() <= 3 * STEPS);
            let at = |time: u32| path[(time as usize).min(path.len() - 1)];
            let until = until.max(path.len() as u32 - 1);
            let keeps = (0..=until)
                .all(|time| !is_forbidden(&all, at(time.saturating_sub(1)), at(time), time));
            prop_assert_eq!(table.admit(&path, until), keeps);
        }
    }
}
