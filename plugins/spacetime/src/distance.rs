//! Exact distances to each agent's goal, by breadth-first search from the goal
//! that is carried on only as far as somebody asks.
//!
//! One row of 16-bit entries per agent. Rows are allocated zeroed and zero means
//! "not reached yet", so that the operating system gives memory only for the part
//! of a row that the search has touched.

use crate::graph::{Graph, Vertex};

/// The largest distance a row can hold. Longer ones make the problem unsupported.
pub const MAX_DISTANCE: u32 = u16::MAX as u32 - 2;

/// Entry of the sentinel: further than any vertex, never expanded.
const WALL: u16 = u16::MAX;

/// Per agent, the distance from any vertex to its goal.
#[derive(Debug, Clone)]
pub struct Distances<'g> {
    graph: &'g Graph,
    /// Distance plus one, zero where unknown; `stride` entries per agent.
    table: Vec<u16>,
    stride: usize,
    searches: Vec<Search>,
    /// Buffer for the level under construction.
    spare: Vec<Vertex>,
}

/// The edge of one agent's search: all vertices at distance `level`.
#[derive(Debug, Clone)]
struct Search {
    frontier: Vec<Vertex>,
    level: u32,
}

impl<'g> Distances<'g> {
    /// Searches from the goals, one per agent, none of them begun.
    pub fn new(graph: &'g Graph, goals: &[Vertex]) -> Self {
        let stride = graph.len() + 1;
        let mut table = vec![0; stride * goals.len()];
        let mut searches = Vec::with_capacity(goals.len());
        for (row, &goal) in table.chunks_exact_mut(stride).zip(goals) {
            row[goal as usize] = 1;
            row[stride - 1] = WALL;
            searches.push(Search {
                frontier: vec![goal],
                level: 0,
            });
        }
        Self {
            graph,
            table,
            stride,
            searches,
            spare: Vec::new(),
        }
    }

    /// Bytes that the tables of a team may take.
    pub fn bytes(graph: &Graph, agents: usize) -> u64 {
        (graph.len() as u64 + 1) * agents as u64 * size_of::<u16>() as u64
    }

    /// The graph the distances are measured on.
    pub fn graph(&self) -> &'g Graph {
        self.graph
    }

    /// The distance from `v` to the goal of `agent`; larger than [`MAX_DISTANCE`]
    /// when the goal cannot be reached (or only over a longer way).
    #[inline]
    pub fn get(&mut self, agent: usize, v: Vertex) -> u32 {
        let entry = self.table[agent * self.stride + v as usize];
        if entry != 0 {
            return u32::from(entry) - 1;
        }
        self.extend(agent, v)
    }

    /// The distance to the goal if [`Distances::complete`] has run.
    #[inline]
    pub fn known(&self, agent: usize, v: Vertex) -> u32 {
        u32::from(self.table[agent * self.stride + v as usize]).wrapping_sub(1)
    }

    /// Finishes every search, so that [`Distances::known`] may be used; false when
    /// `stop`, which is asked between agents, has prevented it.
    pub fn complete(&mut self, stop: &mut dyn FnMut() -> bool) -> bool {
        (0..self.searches.len()).all(|agent| {
            while self.advance(agent) {}
            !stop()
        })
    }

    #[cold]
    fn extend(&mut self, agent: usize, v: Vertex) -> u32 {
        let at = agent * self.stride + v as usize;
        while self.table[at] == 0 {
            if !self.advance(agent) {
                return u32::MAX;
            }
        }
        u32::from(self.table[at]) - 1
    }

    /// Expands one level. False when nothing was left to expand.
    fn advance(&mut self, agent: usize) -> bool {
        let search = &mut self.searches[agent];
        if search.frontier.is_empty() || search.level >= MAX_DISTANCE {
            return false;
        }
        let row = &mut self.table[agent * self.stride..(agent + 1) * self.stride];
        search.level += 1;
        let mark = search.level as u16 + 1;
        let next = &mut self.spare;
        next.clear();
        for &v in &search.frontier {
            for &u in self.graph.around(v) {
                let entry = &mut row[u as usize];
                if *entry == 0 {
                    *entry = mark;
                    next.push(u);
                }
            }
        }
        std::mem::swap(&mut search.frontier, next);
        true
    }
}
