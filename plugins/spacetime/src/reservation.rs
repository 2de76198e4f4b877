//! Reservations: the paths of a team as bit sets over time.
//!
//! Per vertex one bit per time step for "occupied", and one for each direction for
//! "left in this direction". Safe intervals of SIPP are runs of zeros, found a word
//! at a time; adding or removing a path touches one bit per step.
//!
//! A vertex has words from the first to the last time at which something happens there, and a flag
//! for what stays so for ever: 40 bytes per 64 steps of that, none where nobody comes, and 16 bytes of
//! memory that is not touched before per vertex.

use crate::graph::{DIRECTIONS, Graph, Vertex};

/// Later than any time: of what never happens.
pub const NEVER: u32 = u32::MAX;

/// Rows per vertex: occupied, and left in each direction.
const ROWS: usize = 1 + DIRECTIONS;
const WORD: usize = u64::BITS as usize;

/// 64 steps of a vertex, by row.
type Word = [u64; ROWS];

/// The words of a vertex. All zeros, which memory is from the beginning, where there are none.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
struct Line {
    /// Place of the words in all words.
    place: u32,
    /// The number of the first word in time, and how many there are.
    first: u32,
    count: u32,
    /// [`KEPT`], [`OCCUPIED`] and the logarithm of the words that there is room for.
    state: u32,
}

/// The vertex is listed as touched.
const KEPT: u32 = 1 << 31;
/// It is occupied for ever after the last word.
const OCCUPIED: u32 = 1 << 30;
/// The rest of [`Line::state`].
const ROOM: u32 = OCCUPIED - 1;

impl Line {
    fn read(raw: [u32; 4]) -> Self {
        let [place, first, count, state] = raw;
        Self {
            place,
            first,
            count,
            state,
        }
    }

    fn raw(self) -> [u32; 4] {
        [self.place, self.first, self.count, self.state]
    }

    /// The bits of the occupied row after the last word.
    #[inline]
    fn rest(self) -> u64 {
        if self.state & OCCUPIED == 0 {
            0
        } else {
            u64::MAX
        }
    }

    /// The first word in time that is not represented.
    #[inline]
    fn end(self) -> usize {
        (self.first + self.count) as usize
    }
}

/// The occupancy of a set of paths.
#[derive(Debug, Clone)]
pub struct Reservations {
    /// Times from here on are not represented: then everything is free, or as it was in
    /// the step before.
    end: u32,
    windowed: bool,
    /// Per vertex its [`Line`].
    lines: Vec<[u32; 4]>,
    words: Vec<Word>,
    /// Places of words that nobody has, by the logarithm of their number.
    unused: Vec<Vec<u32>>,
    /// Vertices with a line.
    touched: Vec<Vertex>,
}

/// The bits of a path in tables of one size, to be entered often.
#[derive(Debug, Clone, Default)]
pub struct Imprint(Vec<Mark>);

/// Bits of a word of a vertex.
#[derive(Debug, Clone, Copy)]
struct Mark {
    v: Vertex,
    /// `ROWS · word + row`; [`FOREVER`] stands for the occupied row of all later words as well.
    at: u32,
    bits: u64,
}

/// Bit of [`Mark::at`].
const FOREVER: u32 = 1 << 31;

impl Reservations {
    /// An empty table. Agents stay at the end of their paths for good, and paths must have
    /// ended by the time `horizon`.
    pub fn new(graph: &Graph, horizon: usize) -> Self {
        Self {
            end: ((horizon / WORD + 1) * WORD) as u32,
            windowed: false,
            lines: vec![[0; 4]; graph.len()],
            words: Vec::new(),
            unused: Vec::new(),
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

    /// Times at and beyond this one are not represented.
    pub fn horizon(&self) -> u32 {
        self.end
    }

    /// Makes the table empty, and fit for paths that end before `horizon`.
    pub fn reset(&mut self, horizon: usize) {
        if !self.windowed && horizon >= self.end as usize {
            self.end = (((horizon + horizon / 2) / WORD + 1) * WORD) as u32;
        }
        for v in self.touched.drain(..) {
            self.lines[v as usize] = [0; 4];
        }
        self.words.clear();
        self.unused.clear();
    }

    #[inline]
    fn line(&self, v: Vertex) -> Line {
        Line::read(self.lines[v as usize])
    }

    /// The words of a line; what is after them is [`Line::rest`].
    #[inline]
    fn words_of(&self, line: Line) -> &[Word] {
        &self.words[line.place as usize..(line.place + line.count) as usize]
    }

    /// Room for `count` words, and its logarithm.
    fn room(&mut self, count: u32) -> (u32, u32) {
        let class = count.next_power_of_two().trailing_zeros();
        if let Some(place) = self.unused.get_mut(class as usize).and_then(Vec::pop) {
            let place_end = (place as usize) + (1 << class);
            self.words[place as usize..place_end].fill([0; ROWS]);
            return (place, class);
        }
        let place = self.words.len();
        self.words.resize(place + (1 << class), [0; ROWS]);
        (place as u32, class)
    }

    fn give_back(&mut self, line: Line) {
        if line.count == 0 {
            return;
        }
        let class = (line.state & ROOM) as usize;
        if self.unused.len() <= class {
            self.unused.resize_with(class + 1, Vec::new);
        }
        self.unused[class].push(line.place);
    }

    /// The word of a vertex, made if it is not there.
    #[inline]
    fn word(&mut self, v: Vertex, word: usize) -> &mut Word {
        let line = self.line(v);
        let at = word.wrapping_sub(line.first as usize);
        let place = if at < line.count as usize {
            line.place as usize + at
        } else {
            self.stretch(v, line, word)
        };
        &mut self.words[place]
    }

    /// Gives a vertex words up to one that it has not, and says where that is.
    #[cold]
    fn stretch(&mut self, v: Vertex, line: Line, word: usize) -> usize {
        let word = word as u32;
        let (first, end) = match line.count {
            0 => (word, word + 1),
            _ => (
                line.first.min(word),
                (line.first + line.count).max(word + 1),
            ),
        };
        let count = end - first;
        let had = line.count > 0;
        let mut new = Line {
            first,
            count,
            ..line
        };
        if !had || count > 1 << (line.state & ROOM) {
            let (place, class) = self.room(count);
            let shift = (line.first.wrapping_sub(first)) as usize;
            for at in 0..line.count as usize {
                self.words[place as usize + shift + at] = self.words[line.place as usize + at];
            }
            self.give_back(line);
            new.place = place;
            new.state = line.state & !ROOM | class;
        } else if first < line.first {
            let (place, shift) = (line.place as usize, (line.first - first) as usize);
            self.words
                .copy_within(place..place + line.count as usize, place + shift);
            self.words[place..place + shift].fill([0; ROWS]);
        }
        // New words at the end are as what was after the last one.
        let old_end = if had { line.end() } else { first as usize };
        for later in old_end..end as usize {
            let place = new.place as usize + later - first as usize;
            self.words[place] = [0; ROWS];
            self.words[place][0] = line.rest();
        }
        if line.state & KEPT == 0 {
            self.touched.push(v);
            new.state |= KEPT;
        }
        self.lines[v as usize] = new.raw();
        new.place as usize + (word - first) as usize
    }

    /// Forgets the words of a vertex where nothing happens any more.
    fn settle(&mut self, v: Vertex) {
        let line = self.line(v);
        let empty = |word: &Word| *word == [0; ROWS];
        if line.state & OCCUPIED == 0 && self.words_of(line).iter().all(empty) {
            self.give_back(line);
            self.lines[v as usize] = Line {
                state: line.state & KEPT,
                ..Line::default()
            }
            .raw();
        }
    }

    /// The occupied row of a vertex in a word.
    #[inline]
    fn bits(&self, line: Line, word: usize) -> u64 {
        let at = word.wrapping_sub(line.first as usize);
        if at < line.count as usize {
            self.words[line.place as usize + at][0]
        } else if word < line.first as usize {
            0
        } else {
            line.rest()
        }
    }

    #[inline]
    fn bit(&self, v: Vertex, row: usize, t: u32) -> bool {
        if t >= self.end {
            if self.windowed {
                return false;
            }
            return row == 0 && self.line(v).rest() != 0;
        }
        let (line, t) = (self.line(v), t as usize);
        let bits = if row == 0 {
            self.bits(line, t / WORD)
        } else {
            let at = (t / WORD).wrapping_sub(line.first as usize);
            if at >= line.count as usize {
                return false;
            }
            self.words[line.place as usize + at][row]
        };
        bits >> (t % WORD) & 1 == 1
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
        let line = self.line(v);
        let (mut word, mut mask) = (t as usize / WORD, u64::MAX << (t as usize % WORD));
        if word < line.first as usize {
            // Nothing happens yet.
            if flip != 0 {
                return t;
            }
            (word, mask) = (line.first as usize, u64::MAX);
        }
        while word < line.end() {
            let bits = (self.bits(line, word) ^ flip) & mask;
            if bits != 0 {
                return (word * WORD) as u32 + bits.trailing_zeros();
            }
            (word, mask) = (word + 1, u64::MAX);
        }
        // From the word on nothing changes any more.
        if line.rest() ^ flip == 0 {
            return NEVER;
        }
        t.max((word * WORD) as u32)
    }

    /// The first time from which `v` is free for ever, or [`NEVER`].
    pub fn free_for_ever(&self, v: Vertex) -> u32 {
        let line = self.line(v);
        if line.rest() != 0 {
            return NEVER;
        }
        let words = self.words_of(line);
        let last = words.iter().rposition(|word| word[0] != 0);
        last.map_or(0, |at| {
            let end = (line.first as usize + at + 1) * WORD;
            end as u32 - words[at][0].leading_zeros()
        })
    }

    /// Adds a path, its agent staying at the end, or removes it: the bits flip. For tables
    /// without a window whose paths do not collide.
    pub fn flip(&mut self, graph: &Graph, path: &[Vertex]) {
        for (t, step) in path.windows(2).enumerate() {
            let bit = 1 << (t % WORD);
            let word = self.word(step[0], t / WORD);
            word[0] ^= bit;
            if step[0] != step[1] {
                let around = graph.around(step[0]);
                if let Some(d) = around.iter().position(|&u| u == step[1]) {
                    word[1 + d] ^= bit;
                }
                if *word == [0; ROWS] {
                    self.settle(step[0]);
                }
            }
        }
        if let Some(&last) = path.last() {
            let arrival = path.len() - 1;
            self.word(last, arrival / WORD)[0] ^= u64::MAX << (arrival % WORD);
            let mut line = self.line(last);
            let later = arrival / WORD + 1 - line.first as usize;
            let words = line.place as usize..(line.place + line.count) as usize;
            for word in &mut self.words[words][later..] {
                word[0] ^= u64::MAX;
            }
            line.state ^= OCCUPIED;
            self.lines[last as usize] = line.raw();
            self.settle(last);
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
        for &Mark { v, at, bits } in &imprint.0 {
            let place = (at & !FOREVER) as usize;
            self.word(v, place / ROWS)[place % ROWS] |= bits;
            if at & FOREVER != 0 {
                let mut line = self.line(v);
                let later = place / ROWS + 1 - line.first as usize;
                let words = line.place as usize..(line.place + line.count) as usize;
                for word in &mut self.words[words][later..] {
                    word[0] = u64::MAX;
                }
                line.state |= OCCUPIED;
                self.lines[v as usize] = line.raw();
            }
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
                    imprint.push(departure(v, d, next - 1));
                }
            }
            at = next;
        }
        Imprint(imprint)
    }

    /// Words and bits of being at `v` from `first` to before `end`: for ever where that is the end of
    /// the table.
    #[inline]
    fn occupy(&self, v: Vertex, first: u32, end: u32, imprint: &mut Vec<Mark>) {
        if end == self.end && !self.windowed {
            let at = (first as usize / WORD * ROWS) as u32 | FOREVER;
            let bits = u64::MAX << (first as usize % WORD);
            imprint.push(Mark { v, at, bits });
            return;
        }
        let (first, end) = (first as usize, end as usize);
        for word in first / WORD..end.div_ceil(WORD) {
            let low = first.saturating_sub(word * WORD);
            let high = (end - word * WORD).min(WORD);
            let bits = u64::MAX >> (WORD - high) & u64::MAX << low;
            let at = (word * ROWS) as u32;
            imprint.push(Mark { v, at, bits });
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
                imprint.push(departure(v, d, t));
            }
        }
        self.stamp(&Imprint(imprint));
    }

    /// Forgets what happens at a vertex before the time `end`.
    pub fn release(&mut self, v: Vertex, end: u32) {
        let end = end.min(self.end) as usize;
        for word in 0..end.div_ceil(WORD) {
            let line = self.line(v);
            let is_there = word < line.end() && word >= line.first as usize;
            if is_there || self.bits(line, word) != 0 {
                let kept = match end - word * WORD {
                    bits if bits < WORD => u64::MAX << bits,
                    _ => 0,
                };
                for row in self.word(v, word) {
                    *row &= kept;
                }
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

/// The word and bit of leaving a vertex at `t`.
#[inline]
fn departure(v: Vertex, d: usize, t: usize) -> Mark {
    let at = (t / WORD * ROWS + 1 + d) as u32;
    let bits = 1 << (t % WORD);
    Mark { v, at, bits }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const COLS: u32 = 4;
    /// Steps that the plain table looks at, well behind the ends of paths.
    const STEPS: u32 = 600;

    fn graph() -> Graph {
        let cols = COLS as usize;
        Graph::new(cols, cols, &vec![true; cols * cols])
    }

    /// A walk that waits for a long time now and then.
    fn walk() -> impl Strategy<Value = Vec<Vertex>> {
        let step = (0_u32..4, prop_oneof![4 => 0_usize..2, 1 => 50_usize..140]);
        (0..COLS * COLS, prop::collection::vec(step, 0..6)).prop_map(|(start, steps)| {
            let graph = graph();
            let mut path = vec![start];
            for (d, waits) in steps {
                let v = path[path.len() - 1];
                path.extend(std::iter::repeat_n(v, waits));
                let u = graph.around(v)[d as usize];
                path.push(if u == graph.wall() { v } else { u });
            }
            path
        })
    }

    /// Occupied, and left in each direction, by step and vertex: what a table says, plainly.
    #[derive(Clone)]
    struct Plain(Vec<[[u32; ROWS]; (COLS * COLS) as usize]>);

    impl Plain {
        fn new() -> Self {
            Self(vec![[[0; ROWS]; (COLS * COLS) as usize]; STEPS as usize])
        }

        fn add(&mut self, path: &[Vertex], delay: u32, end: u32, change: i32) {
            let graph = graph();
            for t in 0..end.min(STEPS) as usize {
                let at = |t: usize| path[t.min(path.len() - 1)];
                let mut marked = Vec::new();
                for near in t.saturating_sub(delay as usize)..=t + delay as usize {
                    if (near as u32) < end && !marked.contains(&at(near)) {
                        marked.push(at(near));
                        let count = &mut self.0[t][at(near) as usize][0];
                        *count = count.wrapping_add_signed(change);
                    }
                }
                let (v, u) = (at(t), at(t + 1));
                if v != u && t as u32 + 1 < end {
                    let d = graph
                        .around(v)
                        .iter()
                        .position(|&x| x == u)
                        .expect("a move");
                    let count = &mut self.0[t][v as usize][1 + d];
                    *count = count.wrapping_add_signed(change);
                }
            }
        }

        fn check(&self, table: &Reservations, end: u32) -> Result<(), TestCaseError> {
            for v in 0..COLS * COLS {
                let busy = |t: u32| self.0[t as usize][v as usize][0] > 0;
                for t in (0..STEPS).step_by(7).chain(0..9).chain(60..70) {
                    prop_assert_eq!(table.busy(v, t), busy(t), "{} at {}", v, t);
                    for d in 0..DIRECTIONS {
                        let leaves = self.0[t as usize][v as usize][1 + d] > 0;
                        prop_assert_eq!(table.leaves(v, d, t), leaves, "{} at {}", v, t);
                    }
                    let next = |wanted| (t..STEPS).find(|&t| busy(t) == wanted).unwrap_or(NEVER);
                    prop_assert_eq!(table.next_busy(v, t), next(true), "{} after {}", v, t);
                    prop_assert_eq!(table.next_free(v, t), next(false), "{} after {}", v, t);
                }
                let last = (0..STEPS).rev().find(|&t| busy(t));
                let free = last.map_or(0, |t| t + 1);
                let free = if free == STEPS { NEVER } else { free };
                prop_assert_eq!(table.free_for_ever(v), free, "{} until {}", v, end);
            }
            Ok(())
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        /// Reservations that are added and taken back out, with delays and windows, are those of a plain table.
        #[test]
        fn sparse_tables_say_what_plain_ones_do(
            paths in prop::collection::vec(walk(), 1..5),
            delay in 0_u32..3,
            window in prop_oneof![Just(0_u32), 1_u32..90],
        ) {
            let graph = graph();
            let longest = paths.iter().map(Vec::len).max().unwrap_or(0);
            let mut table = match window {
                0 => Reservations::new(&graph, longest + delay as usize + 1),
                window => Reservations::windowed(&graph, window),
            };
            let end = if window > 0 { window + 1 } else { u32::MAX };
            for _ in 0..2 {
                let mut plain = Plain::new();
                for path in &paths {
                    table.add(&graph, path, delay);
                    plain.add(path, delay, end, 1);
                    plain.check(&table, end)?;
                }
                table.reset(0);
                Plain::new().check(&table, end)?;
            }
        }

        /// Paths that are flipped in and out again leave nothing.
        #[test]
        fn flipping_twice_is_nothing(paths in prop::collection::vec(walk(), 1..4), order: bool) {
            let graph = graph();
            let mut table = Reservations::new(&graph, 64 * 16);
            let mut plain = Plain::new();
            // Paths that never meet: one may be in at a time.
            for path in &paths {
                table.flip(&graph, path);
                plain.add(path, 0, u32::MAX, 1);
                plain.check(&table, u32::MAX)?;
                table.flip(&graph, path);
                plain.add(path, 0, u32::MAX, -1);
            }
            plain.check(&table, u32::MAX)?;
            // Together they share bits, which come and go in any order.
            let mut again = paths.clone();
            for path in &paths {
                table.flip(&graph, path);
            }
            if order {
                again.reverse();
            }
            for path in &again {
                table.flip(&graph, path);
            }
            plain.check(&table, u32::MAX)?;
            prop_assert!(table.lines.iter().all(|line| Line::read(*line).count == 0));
        }
    }

    #[test]
    fn who_is_held_and_released_leaves_what_was_there() {
        let graph = graph();
        let mut table = Reservations::new(&graph, 200);
        table.add(&graph, &[[5; 130].as_slice(), &[6]].concat(), 0);
        table.hold(6, [2, 3, 0, 70]);
        assert_eq!((table.next_free(6, 0), table.next_busy(6, 2)), (2, 130));
        assert!(table.leaves(6, 3, 68) && !table.leaves(6, 3, 69) && table.leaves(6, 1, 1));
        table.release(6, 70);
        assert_eq!(
            (table.next_busy(6, 0), table.free_for_ever(6)),
            (130, NEVER)
        );
        table.release(6, 140);
        assert_eq!(
            (table.next_busy(6, 0), table.next_free(6, 140)),
            (140, NEVER)
        );
        assert_eq!(table.free_for_ever(5), 130);
    }

    #[test]
    fn memory_follows_what_is_touched() {
        let side = 1000;
        let graph = Graph::new(side, side, &vec![true; side * side]);
        let mut table = Reservations::new(&graph, 2 * side);
        let path: Vec<Vertex> = (0..side as Vertex).collect();
        table.add(&graph, &path, 0);
        assert!(table.words.len() < 2 * side, "{} words", table.words.len());
    }
}
