//! Reservations: the paths of a team as bit sets over time.
//!
//! Per vertex one bit per time step for "occupied", and one for each direction for
//! "left in this direction". Safe intervals of SIPP are runs of zeros, found a word
//! at a time; adding or removing a path touches one bit per step.
//!
//! 40 bytes per vertex and 64 steps.

use crate::graph::{DIRECTIONS, Graph, Vertex};

/// Later than any time: of what never happens.
pub const NEVER: u32 = u32::MAX;

/// Rows per vertex: occupied, and left in each direction.
const ROWS: usize = 1 + DIRECTIONS;
const WORD: usize = u64::BITS as usize;

/// The occupancy of a set of paths.
#[derive(Debug, Clone)]
pub struct Reservations {
    words: usize,
    /// Times from here on are not represented: then everything is free, or as it was in
    /// the step before.
    end: u32,
    windowed: bool,
    bits: Vec<u64>,
    /// Words that were set other than by [`Reservations::flip`].
    touched: Vec<u32>,
}

/// The bits of a path in tables of one size, to be entered often.
#[derive(Debug, Clone, Default)]
pub struct Imprint(Vec<(u32, u64)>);

impl Reservations {
    /// An empty table. Agents stay at the end of their paths for good, and paths must have
    /// ended by the time `horizon`.
    pub fn new(graph: &Graph, horizon: usize) -> Self {
        let words = horizon / WORD + 1;
        Self {
            words,
            end: (words * WORD) as u32,
            windowed: false,
            bits: vec![0; graph.len() * ROWS * words],
            touched: Vec::new(),
        }
    }

    /// An empty table of what happens until the time `window`; later everything is free.
    pub fn windowed(graph: &Graph, window: u32) -> Self {
        Self {
            end: window.saturating_add(1),
            windowed: true,
            ..Self::new(graph, window as usize)
        }
    }

    /// Bytes of a table for times up to `horizon`.
    pub fn size(graph: &Graph, horizon: usize) -> u64 {
        (graph.len() * ROWS * size_of::<u64>()) as u64 * (horizon as u64 / WORD as u64 + 1)
    }

    /// Times at and beyond this one are not represented.
    pub fn horizon(&self) -> u32 {
        self.end
    }

    /// Makes the table empty, and large enough for paths that end before `horizon`.
    pub fn reset(&mut self, graph: &Graph, horizon: usize) {
        let words = horizon / WORD + 1;
        if !self.windowed && words > self.words {
            *self = Self::new(graph, horizon + horizon / 2);
            return;
        }
        for word in self.touched.drain(..) {
            self.bits[word as usize] = 0;
        }
    }

    /// Sets bits of a word.
    #[inline]
    fn set(&mut self, word: u32, bits: u64) {
        let entry = &mut self.bits[word as usize];
        if *entry == 0 {
            self.touched.push(word);
        }
        *entry |= bits;
    }

    #[inline]
    fn row(&self, v: Vertex, row: usize) -> &[u64] {
        let begin = (v as usize * ROWS + row) * self.words;
        &self.bits[begin..begin + self.words]
    }

    #[inline]
    fn bit(&self, v: Vertex, row: usize, t: u32) -> bool {
        if t >= self.end {
            if self.windowed {
                return false;
            }
            return row == 0 && self.bit(v, row, self.end - 1);
        }
        let t = t as usize;
        self.bits[(v as usize * ROWS + row) * self.words + t / WORD] >> (t % WORD) & 1 == 1
    }

    /// True if `v` is occupied at `t`.
    #[inline]
    pub fn busy(&self, v: Vertex, t: u32) -> bool {
        self.bit(v, 0, t)
    }

    /// True if an agent leaves `v` in direction `d` at `t`, to arrive at `t + 1`.
    #[inline]
    pub fn leaves(&self, v: Vertex, d: usize, t: u32) -> bool {
        self.bit(v, 1 + d, t)
    }

    /// The first time from `t` on when `v` is free, or [`NEVER`].
    #[inline]
    pub fn next_free(&self, v: Vertex, t: u32) -> u32 {
        self.scan(v, t, u64::MAX)
    }

    /// The first time from `t` on when `v` is occupied, or [`NEVER`].
    #[inline]
    pub fn next_busy(&self, v: Vertex, t: u32) -> u32 {
        self.scan(v, t, 0)
    }

    /// The first time after `t` when `v` is not as it is at `t`, occupied or free, or
    /// [`NEVER`].
    #[inline]
    pub fn next_change(&self, v: Vertex, t: u32) -> u32 {
        if self.busy(v, t) {
            self.next_free(v, t)
        } else {
            self.next_busy(v, t)
        }
    }

    /// Number of times that `v` becomes occupied from `t` on, or is so then; at most `most`.
    pub fn visits(&self, v: Vertex, mut t: u32, most: u32) -> u32 {
        for count in 0..most {
            t = match self.next_busy(v, t) {
                NEVER => return count,
                busy => self.next_free(v, busy),
            };
            if t == NEVER {
                return count + 1;
            }
        }
        most
    }

    /// The first time from `t` on whose bit, after flipping with `flip`, is set.
    #[inline]
    fn scan(&self, v: Vertex, t: u32, flip: u64) -> u32 {
        if t >= self.end {
            // Nothing changes any more.
            return if self.busy(v, t) == (flip == 0) {
                t
            } else {
                NEVER
            };
        }
        let row = self.row(v, 0);
        let mut word = t as usize / WORD;
        let mut bits = (row[word] ^ flip) & u64::MAX << (t as usize % WORD);
        while bits == 0 {
            word += 1;
            if word == row.len() {
                let free = self.windowed && flip != 0;
                return if free { self.end } else { NEVER };
            }
            bits = row[word] ^ flip;
        }
        (word * WORD) as u32 + bits.trailing_zeros()
    }

    /// The first time from which `v` is free for ever, or [`NEVER`].
    pub fn free_for_ever(&self, v: Vertex) -> u32 {
        let row = self.row(v, 0);
        let last = row.iter().rposition(|&bits| bits != 0);
        let free = last.map_or(0, |w| ((w + 1) * WORD) as u32 - row[w].leading_zeros());
        if free == self.end && !self.windowed {
            NEVER
        } else {
            free
        }
    }

    /// Adds a path, its agent staying at the end, or removes it: the bits flip. For tables
    /// without a window whose paths do not collide.
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

    /// Adds a path, its agent staying at the end, to others that it may collide with. With
    /// `delay` above zero a vertex counts as occupied so many steps before and after a
    /// visit as well: who keeps out is not met even if either is so late (k-robust plans:
    /// Atzmon, Stern, Felner, Wagner, Barták, Zhou, JAIR 2020). What is added goes by
    /// [`Reservations::reset`].
    pub fn add(&mut self, graph: &Graph, path: &[Vertex], delay: u32) {
        self.stamp(&self.imprint(graph, path, delay));
    }

    /// The same, by what [`Reservations::imprint`] says of the path, of this table or one of
    /// the same size.
    pub fn stamp(&mut self, imprint: &Imprint) {
        for &(word, bits) in &imprint.0 {
            self.set(word, bits);
        }
    }

    /// The bits that [`Reservations::add`] would set.
    pub fn imprint(&self, graph: &Graph, path: &[Vertex], delay: u32) -> Imprint {
        let mut imprint = Vec::with_capacity(2 * path.len());
        let mut at = 0;
        while at < path.len() && (at as u32) < self.end {
            let v = path[at];
            let mut next = at + 1;
            while next < path.len() && path[next] == v {
                next += 1;
            }
            let first = (at as u32).saturating_sub(delay);
            if next == path.len() {
                self.occupy(v, first, self.end, &mut imprint);
                break;
            }
            let end = (next as u32).saturating_add(delay).min(self.end);
            self.occupy(v, first, end, &mut imprint);
            // A move that ends after the window is nobody's business.
            if (next as u32) < self.end {
                let around = graph.around(v);
                if let Some(d) = around.iter().position(|&u| u == path[next]) {
                    imprint.push(self.departure(v, d, next - 1));
                }
            }
            at = next;
        }
        Imprint(imprint)
    }

    /// The word and bit of leaving a vertex at `t`.
    #[inline]
    fn departure(&self, v: Vertex, d: usize, t: usize) -> (u32, u64) {
        let row = (v as usize * ROWS + 1 + d) * self.words;
        ((row + t / WORD) as u32, 1 << (t % WORD))
    }

    /// Words and bits of being at `v` from `first` to before `end`.
    #[inline]
    fn occupy(&self, v: Vertex, first: u32, end: u32, imprint: &mut Vec<(u32, u64)>) {
        let row = v as usize * ROWS * self.words;
        let (first, end) = (first as usize, end as usize);
        for word in first / WORD..end.div_ceil(WORD) {
            let low = first.saturating_sub(word * WORD);
            let high = (end - word * WORD).min(WORD);
            let bits = u64::MAX >> (WORD - high) & u64::MAX << low;
            imprint.push(((row + word) as u32, bits));
        }
    }

    /// Keeps others from coming to a vertex, whose agent has no path yet: from direction `d`
    /// nobody arrives before `earliest[d]`; 0 where nobody comes from.
    pub fn hold(&mut self, v: Vertex, earliest: [u32; DIRECTIONS]) {
        let free = earliest.into_iter().filter(|&t| t > 0).min().unwrap_or(0);
        let mut imprint = Vec::new();
        self.occupy(v, 0, free.min(self.end), &mut imprint);
        for (d, earliest) in earliest.into_iter().enumerate() {
            // As if the agent left to where the other one would come from.
            for t in 0..earliest.saturating_sub(1).min(self.end) as usize {
                imprint.push(self.departure(v, d, t));
            }
        }
        self.stamp(&Imprint(imprint));
    }

    /// Forgets what happens at a vertex before the time `end`.
    pub fn release(&mut self, v: Vertex, end: u32) {
        let end = end.min(self.end) as usize;
        for row in 0..ROWS {
            let begin = (v as usize * ROWS + row) * self.words;
            for t in 0..end {
                self.bits[begin + t / WORD] &= !(1 << (t % WORD));
            }
        }
    }

    /// True if a path, its agent staying at the end, collides with nothing, and closes no ring of
    /// moves unless agents may move in such `cycles`.
    pub fn admits(&self, graph: &Graph, path: &[Vertex], cycles: bool) -> bool {
        let Some(&last) = path.last() else {
            return true;
        };
        let free = |t: usize, v: Vertex| !self.busy(v, t as u32);
        let no_swap = |t: usize, from: Vertex, to: Vertex| {
            from == to
                || graph
                    .around(to)
                    .iter()
                    .position(|&u| u == from)
                    .is_none_or(|d| !self.leaves(to, d, t as u32))
                    && (cycles || !self.closes_ring(graph, from, to, t as u32))
        };
        path.iter().enumerate().all(|(t, &v)| free(t, v))
            && path
                .windows(2)
                .enumerate()
                .all(|(t, s)| no_swap(t, s[0], s[1]))
            && self.next_busy(last, path.len() as u32) == NEVER
    }

    /// True if moving at `t` from one vertex into the next closes a ring of moves of the same step,
    /// an exchange of places among them: `to` is left towards a vertex that is left … towards
    /// `from`.
    pub fn closes_ring(&self, graph: &Graph, from: Vertex, to: Vertex, t: u32) -> bool {
        // Nearly always nobody leaves.
        if !self.busy(to, t) {
            return false;
        }
        // Paths that collide may fork, and hold rings of their own.
        let mut chain = vec![to];
        let mut next = 0;
        while let Some(&at) = chain.get(next) {
            next += 1;
            for d in (0..DIRECTIONS).filter(|&d| self.leaves(at, d, t)) {
                let ahead = graph.around(at)[d];
                if ahead == from {
                    return true;
                }
                if !chain.contains(&ahead) {
                    chain.push(ahead);
                }
            }
        }
        false
    }
}
