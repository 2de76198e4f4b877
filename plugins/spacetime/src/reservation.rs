//! Who is where when: the paths of all agents as bit sets over time.
//!
//! Per vertex one bit per time step for "occupied", and one for each direction for
//! "left in this direction". Safe intervals of SIPP are runs of zeros, found a word
//! at a time; adding or removing a path touches one bit per step.

use crate::graph::{DIRECTIONS, Graph, Vertex};

/// Rows per vertex: occupied, and left in each direction.
const ROWS: usize = 1 + DIRECTIONS;
const WORD: usize = u64::BITS as usize;

/// The occupancy of a set of paths up to a horizon.
#[derive(Debug, Clone)]
pub struct Reservations {
    words: usize,
    bits: Vec<u64>,
}

impl Reservations {
    /// An empty table for times below some multiple of the word size above `horizon`.
    pub fn new(graph: &Graph, horizon: usize) -> Self {
        let words = horizon / WORD + 1;
        Self {
            words,
            bits: vec![0; graph.len() * ROWS * words],
        }
    }

    /// Times at and beyond this one are not represented; paths must have ended by then.
    pub fn horizon(&self) -> usize {
        self.words * WORD
    }

    #[inline]
    fn row(&self, v: Vertex, row: usize) -> &[u64] {
        let begin = (v as usize * ROWS + row) * self.words;
        &self.bits[begin..begin + self.words]
    }

    /// Whether `v` is occupied at `t`.
    #[inline]
    pub fn busy(&self, v: Vertex, t: usize) -> bool {
        self.row(v, 0)[t / WORD] >> (t % WORD) & 1 == 1
    }

    /// Whether somebody leaves `v` in direction `d` at `t`, to arrive at `t + 1`.
    #[inline]
    pub fn leaves(&self, v: Vertex, d: usize, t: usize) -> bool {
        self.row(v, 1 + d)[t / WORD] >> (t % WORD) & 1 == 1
    }

    /// The first time from `t` on when `v` is free; the horizon if there is none.
    #[inline]
    pub fn next_free(&self, v: Vertex, t: usize) -> usize {
        self.scan(v, t, u64::MAX)
    }

    /// The first time from `t` on when `v` is occupied; the horizon if there is none.
    #[inline]
    pub fn next_busy(&self, v: Vertex, t: usize) -> usize {
        self.scan(v, t, 0)
    }

    /// The first time from `t` on whose bit, after flipping with `flip`, is set.
    #[inline]
    fn scan(&self, v: Vertex, t: usize, flip: u64) -> usize {
        let row = self.row(v, 0);
        let mut word = t / WORD;
        if word >= row.len() {
            return self.horizon();
        }
        let mut bits = (row[word] ^ flip) & u64::MAX << (t % WORD);
        while bits == 0 {
            word += 1;
            if word == row.len() {
                return self.horizon();
            }
            bits = row[word] ^ flip;
        }
        word * WORD + bits.trailing_zeros() as usize
    }

    /// The first time from which `v` is free for ever; the horizon if there is none.
    pub fn free_for_ever(&self, v: Vertex) -> usize {
        let row = self.row(v, 0);
        let last = row.iter().rposition(|&bits| bits != 0);
        last.map_or(0, |w| (w + 1) * WORD - row[w].leading_zeros() as usize)
    }

    /// Adds a path, its agent staying at the end, or removes it: the bits flip.
    pub fn flip(&mut self, graph: &Graph, path: &[Vertex]) {
        let words = self.words;
        for (t, step) in path.windows(2).enumerate() {
            let begin = step[0] as usize * ROWS * words + t / WORD;
            let bit = 1 << (t % WORD);
            self.bits[begin] ^= bit;
            if step[0] != step[1] {
                let around = graph.around(step[0]);
                if let Some(d) = around.iter().position(|&u| u == step[1]) {
                    self.bits[begin + (1 + d) * words] ^= bit;
                }
            }
        }
        if let Some(&last) = path.last() {
            let begin = last as usize * ROWS * words;
            let arrival = path.len() - 1;
            let row = &mut self.bits[begin..begin + words];
            row[arrival / WORD] ^= u64::MAX << (arrival % WORD);
            for word in &mut row[arrival / WORD + 1..] {
                *word ^= u64::MAX;
            }
        }
    }

    /// Whether a path, its agent staying at the end, collides with nothing.
    pub fn admits(&self, graph: &Graph, path: &[Vertex]) -> bool {
        let Some(&last) = path.last() else {
            return true;
        };
        let free = |t: usize, v: Vertex| !self.busy(v, t);
        let no_swap = |t: usize, from: Vertex, to: Vertex| {
            from == to
                || graph
                    .around(to)
                    .iter()
                    .position(|&u| u == from)
                    .is_none_or(|d| !self.leaves(to, d, t))
        };
        path.iter().enumerate().all(|(t, &v)| free(t, v))
            && path
                .windows(2)
                .enumerate()
                .all(|(t, s)| no_swap(t, s[0], s[1]))
            && self.free_for_ever(last) < path.len()
    }
}
