//! The way to a goal from everywhere, for many goals at a time and from call to call.
//!
//! In a fleet that works without end most goals stay the same from one call to the next,
//! and tasks come back to the same places, so tables are kept by goal, as many as a limit
//! of memory allows. They are made for that: two bits per vertex hold the distance modulo
//! three, which tells the nearer neighbours from the further ones, since on a grid the
//! distances of neighbours differ by exactly one. The fourth value means "not reached
//! yet": a breadth-first search from the goal is carried on only as far as somebody asks.
//! Every seventeenth vertex has its distance in full, from which any other follows in a
//! few steps. Together that is three bits per vertex, a fifth of a table of distances.

use std::collections::VecDeque;

use crate::graph::{DIRECTIONS, Graph, Vertex};
use crate::labels::{Labels, TooFar};

/// One vertex in so many has its distance written out: a number that has no factor in
/// common with the width of most maps, so that ways up and down meet them as well.
const MILESTONE: usize = 17;
/// Vertices in a byte of codes.
const PER_BYTE: usize = 4;
/// Code of a vertex that is not reached yet; others are the distance modulo three plus one.
const UNKNOWN: u8 = 0;
/// No row.
const NONE: u32 = u32::MAX;
/// Bytes of labels per vertex that there are at least, as a rule.
const SHORTEST: u64 = 32;

/// The code of vertices one step nearer.
#[inline]
fn nearer(code: u8) -> u8 {
    if code == 1 { 3 } else { code - 1 }
}

/// The code of vertices one step further.
#[inline]
fn further(code: u8) -> u8 {
    if code == 3 { 1 } else { code + 1 }
}

/// The table of one goal.
#[derive(Debug)]
struct Row {
    goal: Vertex,
    codes: Box<[u8]>,
    milestones: Box<[u32]>,
    /// All distances, where streets are one-way: those of neighbours differ by more than one then, and
    /// codes do not tell which is nearer. Empty elsewhere.
    distances: Box<[u32]>,
    /// The edge of the search: all vertices at distance `level`.
    frontier: Vec<Vertex>,
    level: u32,
    /// Number of agents that hold this row, and number of times it was let go: only the entry of
    /// the last time in [`Rows::idle`] counts.
    holders: u32,
    released: u32,
}

impl Row {
    #[inline]
    fn code(&self, v: Vertex) -> u8 {
        let v = v as usize;
        self.codes[v / PER_BYTE] >> (2 * (v % PER_BYTE)) & 3
    }

    /// Begins the search from another goal. The sentinel counts as reached.
    fn reset(&mut self, graph: &Graph, goal: Vertex) {
        self.codes.fill(UNKNOWN);
        self.goal = goal;
        self.level = 0;
        self.frontier.clear();
        self.frontier.push(goal);
        self.mark(graph.wall(), 1);
        self.mark(goal, 1);
        self.reach(goal, 0);
    }

    #[inline]
    fn mark(&mut self, v: Vertex, code: u8) {
        let v = v as usize;
        self.codes[v / PER_BYTE] |= code << (2 * (v % PER_BYTE));
    }

    #[inline]
    fn reach(&mut self, v: Vertex, distance: u32) {
        if (v as usize).is_multiple_of(MILESTONE) {
            self.milestones[v as usize / MILESTONE] = distance;
        }
        if let Some(entry) = self.distances.get_mut(v as usize) {
            *entry = distance;
        }
    }

    /// Carries the search on until it has met `v`. False when there is no way.
    #[inline]
    fn reaches(&mut self, graph: &Graph, v: Vertex, spare: &mut Vec<Vertex>) -> bool {
        self.code(v) != UNKNOWN || self.extend(graph, v, spare)
    }

    #[cold]
    fn extend(&mut self, graph: &Graph, v: Vertex, spare: &mut Vec<Vertex>) -> bool {
        while self.code(v) == UNKNOWN {
            if self.frontier.is_empty() {
                return false;
            }
            self.level += 1;
            let (level, code) = (self.level, (self.level % 3) as u8 + 1);
            let frontier = std::mem::take(&mut self.frontier);
            spare.clear();
            for &at in &frontier {
                for &u in graph.sources(at) {
                    if self.code(u) == UNKNOWN {
                        self.mark(u, code);
                        self.reach(u, level);
                        spare.push(u);
                    }
                }
            }
            self.frontier = std::mem::replace(spare, frontier);
        }
        if self.frontier.is_empty() {
            self.frontier = Vec::new();
        }
        true
    }
}

/// The ways to goals: by tables, or by labels where these take less memory.
#[derive(Debug)]
pub struct Gradients {
    rows: Rows,
    /// Labels, once they have been begun. Once complete they give all distances, and the handle of
    /// a goal is its vertex.
    labels: Option<Result<Labels, TooFar>>,
}

/// Result of [`Gradients::expect`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Expected {
    /// Questions may be asked.
    Ready,
    /// It was asked to stop; the next time it goes on from there.
    Stopped,
    /// It would take more memory than it may.
    TooLarge,
}

impl Gradients {
    /// None yet. Tables that nobody holds are kept as long as all together take no more than
    /// so many bytes.
    pub fn new(graph: &Graph, bytes: u64) -> Self {
        Self {
            rows: Rows::new(graph, bytes),
            labels: None,
        }
    }

    /// Makes ready for so many goals held at a time, in at most `limit` bytes, while none
    /// is held. Where it was stopped, questions may be asked all the same: each goal that is held gets
    /// a table, as if there were no labels.
    pub fn expect(
        &mut self,
        graph: &Graph,
        goals: usize,
        limit: u64,
        stop: &mut dyn FnMut() -> bool,
    ) -> Expected {
        let fits = |bytes| {
            if bytes <= limit {
                Expected::Ready
            } else {
                Expected::TooLarge
            }
        };
        if let Some(labels) = self.labels() {
            return fits(labels.bytes());
        }
        let tables = Rows::bytes(graph).saturating_mul(goals as u64);
        if self.labels.is_none() && !graph.is_directed() && tables > graph.len() as u64 * SHORTEST {
            self.labels = Some(Ok(Labels::new(graph)));
        }
        if let Some(Ok(labels)) = &mut self.labels
            && labels.bytes() < tables
        {
            if labels.bytes() > limit {
                return Expected::TooLarge;
            }
            match labels.complete(graph, stop) {
                Ok(true) => {
                    self.rows = Rows::new(graph, 0);
                    return Expected::Ready;
                }
                Ok(false) => return Expected::Stopped,
                Err(too_far) => self.labels = Some(Err(too_far)),
            }
        }
        fits(tables)
    }

    /// True if distances to a goal are known as far as anybody has asked, or no table is needed.
    pub fn is_kept(&self, goal: Vertex) -> bool {
        self.labels().is_some() || self.rows.row_of[goal as usize] != NONE
    }

    #[inline]
    fn labels(&self) -> Option<&Labels> {
        let labels = self.labels.as_ref()?.as_ref().ok();
        labels.filter(|labels| labels.is_complete())
    }

    /// A handle for the distances to a goal; it is good until it is [released](Self::release) as
    /// often as it was held.
    pub fn hold(&mut self, graph: &Graph, goal: Vertex) -> u32 {
        match self.labels() {
            Some(_) => goal,
            None => self.rows.hold(graph, goal),
        }
    }

    /// Lets go of a goal.
    pub fn release(&mut self, at: u32) {
        if self.labels().is_none() {
            self.rows.release(at);
        }
    }

    /// The goal of a handle.
    pub fn goal(&self, at: u32) -> Vertex {
        match self.labels() {
            Some(_) => at,
            None => self.rows.goal(at),
        }
    }

    /// The distance from `v` to a goal; `None` when there is no way.
    pub fn distance(&mut self, graph: &Graph, at: u32, v: Vertex) -> Option<u32> {
        match self.labels() {
            Some(labels) => labels.distance(at, v),
            None => self.rows.distance(graph, at, v),
        }
    }

    /// The directions that lead nearer to a goal from `v`, which is so far away, a bit each.
    #[inline]
    pub fn directions(&mut self, graph: &Graph, at: u32, v: Vertex, distance: u32) -> u8 {
        match self.labels() {
            Some(labels) => labels.directions(graph, at, v, distance),
            None => self.rows.directions(graph, at, v),
        }
    }

    /// True if `a` is nearer to a goal than its neighbour `b`.
    #[inline]
    pub fn nearer(&mut self, graph: &Graph, at: u32, a: Vertex, b: Vertex) -> bool {
        let Some(labels) = self.labels() else {
            return self.rows.nearer(graph, at, a, b);
        };
        let there = labels.distance(at, b);
        labels
            .distance(at, a)
            .is_some_and(|a| there.is_some_and(|b| a < b))
    }
}

/// Tables of goals, kept while there is room.
#[derive(Debug)]
struct Rows {
    kept: Vec<Row>,
    /// The row of each goal.
    row_of: Vec<u32>,
    /// Rows that nobody holds, longest unused first, with [`Row::released`] of then.
    idle: VecDeque<(u32, u32)>,
    /// Rows kept at most, unless more are held.
    capacity: usize,
    spare: Vec<Vertex>,
}

impl Rows {
    /// Tables that may take about so many bytes beyond those that are in use.
    fn new(graph: &Graph, bytes: u64) -> Self {
        Self {
            kept: Vec::new(),
            row_of: vec![NONE; graph.len()],
            idle: VecDeque::new(),
            capacity: usize::try_from(bytes / Self::bytes(graph)).unwrap_or(usize::MAX),
            spare: Vec::new(),
        }
    }

    /// Bytes of one row.
    fn bytes(graph: &Graph) -> u64 {
        let vertices = graph.len() + 1;
        let codes = vertices.div_ceil(PER_BYTE);
        let distances = if graph.is_directed() { vertices } else { 0 };
        let codes = codes + distances * size_of::<u32>();
        (codes + vertices.div_ceil(MILESTONE) * size_of::<u32>() + size_of::<Row>()) as u64
    }

    /// The row of a goal; it stays until it is [released](Self::release) as often as it was held.
    fn hold(&mut self, graph: &Graph, goal: Vertex) -> u32 {
        let mut at = self.row_of[goal as usize];
        if at == NONE {
            at = self.place(graph);
            let row = &mut self.kept[at as usize];
            row.reset(graph, goal);
            self.row_of[goal as usize] = at;
        }
        self.kept[at as usize].holders += 1;
        at
    }

    /// A row for a goal that has none: that of one not asked for longest, if there are
    /// enough.
    fn place(&mut self, graph: &Graph) -> u32 {
        if self.kept.len() >= self.capacity {
            while let Some((at, released)) = self.idle.pop_front() {
                let row = &self.kept[at as usize];
                if row.holders == 0 && row.released == released {
                    self.row_of[row.goal as usize] = NONE;
                    return at;
                }
            }
        }
        let vertices = graph.len() + 1;
        self.kept.push(Row {
            goal: 0,
            codes: vec![UNKNOWN; vertices.div_ceil(PER_BYTE)].into(),
            milestones: vec![0; vertices.div_ceil(MILESTONE)].into(),
            distances: vec![0; if graph.is_directed() { vertices } else { 0 }].into(),
            frontier: Vec::new(),
            level: 0,
            holders: 0,
            released: 0,
        });
        self.kept.len() as u32 - 1
    }

    /// Lets go of a row.
    fn release(&mut self, at: u32) {
        let row = &mut self.kept[at as usize];
        row.holders -= 1;
        if row.holders == 0 {
            row.released = row.released.wrapping_add(1);
            // What is out of date goes when it makes up most of the list.
            if self.idle.len() > 2 * self.kept.len() {
                let kept = &self.kept;
                self.idle.retain(|&(at, released)| {
                    let row = &kept[at as usize];
                    row.holders == 0 && row.released == released
                });
            }
            self.idle.push_back((at, self.kept[at as usize].released));
        }
    }

    /// The goal of a row.
    fn goal(&self, at: u32) -> Vertex {
        self.kept[at as usize].goal
    }

    /// The distance from `v` to the goal of a row; `None` when there is no way.
    fn distance(&mut self, graph: &Graph, at: u32, v: Vertex) -> Option<u32> {
        let row = &mut self.kept[at as usize];
        if !row.reaches(graph, v, &mut self.spare) {
            return None;
        }
        if let Some(distance) = row.distances.get(v as usize) {
            return Some(*distance);
        }
        let (mut v, mut steps) = (v, 0);
        while !(v as usize).is_multiple_of(MILESTONE) && v != row.goal {
            let code = nearer(row.code(v));
            let wall = graph.wall();
            v = *graph
                .around(v)
                .iter()
                .find(|&&u| u != wall && row.code(u) == code)?;
            steps += 1;
        }
        let rest = if v == row.goal {
            0
        } else {
            row.milestones[v as usize / MILESTONE]
        };
        Some(steps + rest)
    }

    /// The directions that lead from `v` nearer to the goal of a row, a bit each; none
    /// when there is no way.
    #[inline]
    fn directions(&mut self, graph: &Graph, at: u32, v: Vertex) -> u8 {
        let row = &mut self.kept[at as usize];
        if !row.reaches(graph, v, &mut self.spare) {
            return 0;
        }
        let (code, wall) = (nearer(row.code(v)), graph.wall());
        let here = row.distances.get(v as usize).copied();
        let mut directions = 0;
        for d in 0..DIRECTIONS {
            let u = graph.around(v)[d];
            let mut leads = u != wall && row.code(u) == code;
            if let Some(here) = here {
                leads &= row.distances[u as usize] < here;
            }
            directions |= u8::from(leads) << d;
        }
        directions
    }

    /// True if `a` is nearer to the goal of a row than its neighbour `b`.
    #[inline]
    fn nearer(&mut self, graph: &Graph, at: u32, a: Vertex, b: Vertex) -> bool {
        let row = &mut self.kept[at as usize];
        if !row.reaches(graph, a, &mut self.spare) {
            return false;
        }
        // If only one of two neighbours is known, it is the nearer one.
        match (row.code(b), row.distances.get(a as usize)) {
            (UNKNOWN, _) => true,
            (code, None) => code == further(row.code(a)),
            (_, Some(distance)) => *distance < row.distances[b as usize],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::{Distances, Table};
    use crate::random::Random;

    /// A map with a third of its cells blocked, so that some are cut off.
    fn rubble(side: usize, seed: u64) -> Graph {
        let mut random = Random::new(seed, 0);
        let passable: Vec<bool> = (0..side * side).map(|_| !random.one_in(3)).collect();
        Graph::new(side, side, &passable)
    }

    /// A map of which a third of the moves are forbidden, each way by itself.
    fn one_way(side: usize, seed: u64) -> Graph {
        let mut random = Random::new(seed, 2);
        let moves: Vec<u8> = (0..side * side)
            .map(|_| (0..4).fold(0, |mask, d| mask | u8::from(!random.one_in(3)) << d))
            .collect();
        let graph = Graph::with_moves(side, side, &vec![true; side * side], &moves);
        assert!(graph.is_directed());
        graph
    }

    /// Questions in any order, with goals that come and go.
    fn agrees(graph: &Graph, gradients: &mut Gradients, random: &mut Random) {
        let mut held: VecDeque<u32> = VecDeque::new();
        for _ in 0..60 {
            let goal = random.below(graph.len()) as Vertex;
            let at = gradients.hold(graph, goal);
            held.push_back(at);
            if held.len() > 7 {
                gradients.release(held.pop_front().unwrap());
            }
            let mut distances = Distances::new(graph, &[goal]);
            for _ in 0..30 {
                let v = random.below(graph.len()) as Vertex;
                let truth = distances.get(0, v);
                let reachable = truth != u32::MAX;
                assert_eq!(gradients.goal(at), goal);
                assert_eq!(gradients.distance(graph, at, v), reachable.then_some(truth));
                let directions = if reachable {
                    gradients.directions(graph, at, v, truth)
                } else {
                    0
                };
                for (d, &u) in graph.around(v).iter().enumerate() {
                    let nearer = u != graph.wall() && distances.get(0, u) < truth;
                    assert_eq!(directions >> d & 1 == 1, nearer);
                    if u != graph.wall() {
                        assert_eq!(gradients.nearer(graph, at, u, v), nearer);
                    }
                }
            }
        }
    }

    #[test]
    fn tables_agree_with_searches() {
        for seed in 0..20 {
            let graph = rubble(24, seed);
            // Room for three rows, seven held at a time.
            let mut gradients = Gradients::new(&graph, 3 * Rows::bytes(&graph));
            let ready = gradients.expect(&graph, 7, u64::MAX, &mut || false);
            assert_eq!(ready, Expected::Ready);
            agrees(&graph, &mut gradients, &mut Random::new(seed, 1));
            assert!(gradients.labels().is_none());
            let rows = gradients.rows;
            assert!(rows.kept.len() <= 9, "{}", rows.kept.len());
            assert!(rows.idle.len() <= 2 * rows.kept.len() + 1);
        }
    }

    #[test]
    fn distances_are_those_of_ways_along_one_way_streets() {
        for seed in 0..20 {
            let graph = one_way(9, seed);
            let goal = Random::new(seed, 3).below(graph.len()) as Vertex;
            let mut distances = Distances::new(&graph, &[goal]);
            let table = Table::new(&graph, goal, false, None);
            for start in 0..graph.len() as Vertex {
                // Breadth first along the streets, from the start.
                let mut steps = vec![u32::MAX; graph.len()];
                steps[start as usize] = 0;
                let mut queue = VecDeque::from([start]);
                while let Some(v) = queue.pop_front() {
                    for u in graph.neighbors(v) {
                        if steps[u as usize] == u32::MAX {
                            steps[u as usize] = steps[v as usize] + 1;
                            queue.push_back(u);
                        }
                    }
                }
                let truth = steps[goal as usize];
                assert_eq!(distances.get(0, start), truth);
                assert_eq!(table.get(start, 0), truth.min(u32::from(u16::MAX)));
            }
        }
    }

    #[test]
    fn tables_agree_with_searches_along_one_way_streets() {
        for seed in 0..20 {
            let graph = one_way(24, seed);
            let mut gradients = Gradients::new(&graph, 3 * Rows::bytes(&graph));
            let ready = gradients.expect(&graph, 10_000, u64::MAX, &mut || false);
            assert_eq!(ready, Expected::Ready);
            assert!(gradients.labels().is_none());
            agrees(&graph, &mut gradients, &mut Random::new(seed, 1));
        }
    }

    #[test]
    fn labels_agree_with_searches() {
        for seed in 0..20 {
            let graph = rubble(24, seed);
            let mut gradients = Gradients::new(&graph, 0);
            // Asked to stop every other time, it gets on all the same.
            let mut asked = 0;
            let mut stop = || {
                asked += 1;
                asked % 2 == 0
            };
            while gradients.expect(&graph, 10_000, u64::MAX, &mut stop) == Expected::Stopped {}
            assert!(asked > 2);
            agrees(&graph, &mut gradients, &mut Random::new(seed, 1));
            assert!(gradients.labels().is_some());
            assert!(gradients.rows.kept.is_empty());
        }
    }

    #[test]
    fn what_takes_more_than_the_limit_is_not_begun() {
        let graph = rubble(24, 0);
        let mut gradients = Gradients::new(&graph, 0);
        let mut expect = |goals, limit| gradients.expect(&graph, goals, limit, &mut || false);
        assert_eq!(expect(7, Rows::bytes(&graph) * 7 - 1), Expected::TooLarge);
        assert_eq!(expect(7, Rows::bytes(&graph) * 7), Expected::Ready);
        assert_eq!(expect(10_000, 1000), Expected::TooLarge);
        assert_eq!(expect(10_000, 1 << 20), Expected::Ready);
    }

    #[test]
    fn on_a_way_too_long_for_labels_there_are_tables() {
        let graph = Graph::new(1, 70_000, &vec![true; 70_000]);
        let mut gradients = Gradients::new(&graph, 0);
        for _ in 0..2 {
            let ready = gradients.expect(&graph, 10_000, u64::MAX, &mut || false);
            assert_eq!(ready, Expected::Ready);
            assert!(gradients.labels().is_none());
        }
        let at = gradients.hold(&graph, 69_999);
        assert_eq!(gradients.distance(&graph, at, 0), Some(69_999));
    }
}
