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

/// One vertex in so many has its distance written out: a number that has no factor in
/// common with the width of most maps, so that ways up and down meet them as well.
const MILESTONE: usize = 17;
/// Vertices in a byte of codes.
const PER_BYTE: usize = 4;
/// Code of a vertex that is not reached yet; others are the distance modulo three plus one.
const UNKNOWN: u8 = 0;
/// No row.
const NONE: u32 = u32::MAX;

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
    /// The edge of the search: all vertices at distance `level`.
    frontier: Vec<Vertex>,
    level: u32,
    /// How many hold this row, and how often it was let go: only the entry of the last
    /// time in [`Gradients::idle`] counts.
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
                for &u in graph.around(at) {
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

/// Tables of goals, kept while there is room.
#[derive(Debug)]
pub struct Gradients {
    rows: Vec<Row>,
    /// The row of each goal.
    row_of: Vec<u32>,
    /// Rows that nobody holds, longest unused first, with [`Row::released`] of then.
    idle: VecDeque<(u32, u32)>,
    /// Rows kept at most, unless more are held.
    capacity: usize,
    spare: Vec<Vertex>,
}

impl Gradients {
    /// Tables that may take about so many bytes beyond those that are in use.
    pub fn new(graph: &Graph, bytes: u64) -> Self {
        Self {
            rows: Vec::new(),
            row_of: vec![NONE; graph.len()],
            idle: VecDeque::new(),
            capacity: usize::try_from(bytes / Self::row_bytes(graph)).unwrap_or(usize::MAX),
            spare: Vec::new(),
        }
    }

    /// Bytes of one row.
    pub fn row_bytes(graph: &Graph) -> u64 {
        let vertices = graph.len() + 1;
        let codes = vertices.div_ceil(PER_BYTE);
        (codes + vertices.div_ceil(MILESTONE) * size_of::<u32>() + size_of::<Row>()) as u64
    }

    /// The row of a goal, for questions; it stays until it is [released](Self::release) as
    /// often as it was held.
    pub fn hold(&mut self, graph: &Graph, goal: Vertex) -> u32 {
        let mut at = self.row_of[goal as usize];
        if at == NONE {
            at = self.place(graph);
            let row = &mut self.rows[at as usize];
            row.reset(graph, goal);
            self.row_of[goal as usize] = at;
        }
        self.rows[at as usize].holders += 1;
        at
    }

    /// A row for a goal that has none: that of one not asked for longest, if there are
    /// enough.
    fn place(&mut self, graph: &Graph) -> u32 {
        if self.rows.len() >= self.capacity {
            while let Some((at, released)) = self.idle.pop_front() {
                let row = &self.rows[at as usize];
                if row.holders == 0 && row.released == released {
                    self.row_of[row.goal as usize] = NONE;
                    return at;
                }
            }
        }
        let vertices = graph.len() + 1;
        self.rows.push(Row {
            goal: 0,
            codes: vec![UNKNOWN; vertices.div_ceil(PER_BYTE)].into(),
            milestones: vec![0; vertices.div_ceil(MILESTONE)].into(),
            frontier: Vec::new(),
            level: 0,
            holders: 0,
            released: 0,
        });
        self.rows.len() as u32 - 1
    }

    /// Lets go of a row.
    pub fn release(&mut self, at: u32) {
        let row = &mut self.rows[at as usize];
        row.holders -= 1;
        if row.holders == 0 {
            row.released = row.released.wrapping_add(1);
            // What is out of date goes when it makes up most of the list.
            if self.idle.len() > 2 * self.rows.len() {
                let rows = &self.rows;
                self.idle.retain(|&(at, released)| {
                    let row = &rows[at as usize];
                    row.holders == 0 && row.released == released
                });
            }
            self.idle.push_back((at, self.rows[at as usize].released));
        }
    }

    /// The goal of a row.
    pub fn goal(&self, at: u32) -> Vertex {
        self.rows[at as usize].goal
    }

    /// The distance from `v` to the goal of a row; `None` when there is no way.
    pub fn distance(&mut self, graph: &Graph, at: u32, v: Vertex) -> Option<u32> {
        let row = &mut self.rows[at as usize];
        if !row.reaches(graph, v, &mut self.spare) {
            return None;
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
    pub fn directions(&mut self, graph: &Graph, at: u32, v: Vertex) -> u8 {
        let row = &mut self.rows[at as usize];
        if !row.reaches(graph, v, &mut self.spare) {
            return 0;
        }
        let (code, wall) = (nearer(row.code(v)), graph.wall());
        let mut directions = 0;
        for d in 0..DIRECTIONS {
            let u = graph.around(v)[d];
            directions |= u8::from(u != wall && row.code(u) == code) << d;
        }
        directions
    }

    /// Whether `a` is nearer to the goal of a row than its neighbour `b`.
    #[inline]
    pub fn nearer(&mut self, graph: &Graph, at: u32, a: Vertex, b: Vertex) -> bool {
        let row = &mut self.rows[at as usize];
        // If only one of two neighbours is known, it is the nearer one.
        row.reaches(graph, a, &mut self.spare)
            && matches!(row.code(b), code if code == UNKNOWN || code == further(row.code(a)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::distance::Distances;
    use crate::random::Random;

    /// A map with a third of its cells blocked, so that some are cut off.
    fn rubble(side: usize, seed: u64) -> Graph {
        let mut random = Random::new(seed, 0);
        let passable: Vec<bool> = (0..side * side).map(|_| !random.one_in(3)).collect();
        Graph::new(side, side, &passable)
    }

    #[test]
    fn agrees_with_tables_of_distances_in_any_order_of_questions() {
        for seed in 0..20 {
            let graph = rubble(24, seed);
            let mut random = Random::new(seed, 1);
            // Room for three rows, seven held at a time: goals come and go.
            let mut gradients = Gradients::new(&graph, 3 * Gradients::row_bytes(&graph));
            let mut held: VecDeque<u32> = VecDeque::new();
            for _ in 0..60 {
                let goal = random.below(graph.len()) as Vertex;
                let row = gradients.hold(&graph, goal);
                held.push_back(row);
                if held.len() > 7 {
                    gradients.release(held.pop_front().unwrap());
                }
                let mut distances = Distances::new(&graph, &[goal]);
                for _ in 0..30 {
                    let v = random.below(graph.len()) as Vertex;
                    let truth = distances.get(0, v);
                    let reachable = truth != u32::MAX;
                    assert_eq!(gradients.goal(row), goal);
                    assert_eq!(
                        gradients.distance(&graph, row, v),
                        reachable.then_some(truth)
                    );
                    let directions = gradients.directions(&graph, row, v);
                    for (d, &u) in graph.around(v).iter().enumerate() {
                        let nearer = u != graph.wall() && distances.get(0, u) < truth;
                        assert_eq!(directions >> d & 1 == 1, nearer);
                        if u != graph.wall() {
                            assert_eq!(gradients.nearer(&graph, row, u, v), nearer);
                        }
                    }
                }
            }
            assert!(gradients.rows.len() <= 9, "{}", gradients.rows.len());
            assert!(gradients.idle.len() <= 2 * gradients.rows.len() + 1);
        }
    }
}
