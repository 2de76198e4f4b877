//! Exact distances to goals, by search from the goal, breadth first.
//!
//! - [`Distances`]: per agent of a one-shot problem, carried on only as far as somebody
//!   asks. One row of 16-bit entries per agent. Rows are allocated zeroed and zero means
//!   "not reached yet", so that the operating system gives memory only for the part of a
//!   row that the search has touched.
//! - [`Table`]: from everywhere to one cell, complete, to be shared; also for robots that
//!   take a step to turn by 90°.
//! - [`Tables`]: those of a map, kept between calls.

use std::collections::BTreeMap;
use std::sync::Arc;

use fleetyard_abi::leftovers::Leftover;

use crate::graph::{DIRECTIONS, Graph, Vertex};
use crate::lanes::Lanes;
use crate::sipp::{Guidance, Team};

/// The largest distance a row can hold. Longer ones make the problem unsupported.
pub const MAX_DISTANCE: u32 = u16::MAX as u32 - 2;

/// Entry of the sentinel: further than any vertex, never expanded.
const WALL: u16 = u16::MAX;

/// Per agent, the distance from any vertex to its goal.
#[derive(Debug, Clone)]
pub struct Distances<'g> {
    graph: &'g Graph,
    /// Distance plus one, zero where unknown; `stride` entries per agent.
    table: Leftover<Vec<u16>>,
    stride: usize,
    searches: Leftover<Vec<Search>>,
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
            table: Leftover::new(table),
            stride,
            searches: Leftover::new(searches),
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

    /// The ways of all agents to their goals, in the same order as these were given in the
    /// beginning. For [`Distances::complete`] tables.
    pub fn team<'d>(&'d self, goals: &'d [Vertex]) -> Known<'d, 'g> {
        Known {
            distances: self,
            goals,
        }
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
            for &u in self.graph.sources(v) {
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

/// The ways of agents to their goals, by complete [`Distances`].
#[derive(Debug, Clone, Copy)]
pub struct Known<'d, 'g> {
    distances: &'d Distances<'g>,
    goals: &'d [Vertex],
}

impl Team for Known<'_, '_> {
    fn route(&self, agent: usize) -> impl Guidance {
        Towards {
            distances: self.distances,
            agent,
            goal: std::slice::from_ref(&self.goals[agent]),
        }
    }

    #[inline]
    fn distance(&self, agent: usize, v: Vertex) -> u32 {
        self.distances.known(agent, v)
    }
}

/// The way of one agent to its goal, by complete [`Distances`].
struct Towards<'d, 'g> {
    distances: &'d Distances<'g>,
    agent: usize,
    goal: &'d [Vertex],
}

impl Guidance for Towards<'_, '_> {
    fn goals(&self) -> &[Vertex] {
        self.goal
    }

    fn stays(&self) -> bool {
        true
    }

    #[inline]
    fn rest(&self, _: u32, v: Vertex, _: u8) -> u32 {
        self.distances.known(self.agent, v)
    }
}

/// States of a [`Table`] between two looks at the clock.
const PATIENCE: usize = 1 << 14;

/// Entry of a [`Table`] from where the goal cannot be reached.
const UNREACHABLE: u16 = u16::MAX;

/// Distances in steps from everywhere to one goal, with what lanes charge on the way.
///
/// 2 bytes per vertex; 8 for robots that turn, whose way depends on where they look.
#[derive(Debug)]
pub struct Table {
    steps: Box<[u16]>,
    /// Headings told apart: `1 << shift`.
    shift: u32,
}

impl Table {
    /// The table of a goal, for robots that turn or for pebbles.
    pub fn new(graph: &Graph, goal: Vertex, turning: bool, lanes: Option<&Lanes>) -> Self {
        let table = Self::within(graph, goal, turning, lanes, &mut || false);
        table.unwrap_or_else(|| unreachable!("nobody stops it"))
    }

    /// The same, unless `stop`, asked now and then, says so before it is made.
    pub fn within(
        graph: &Graph,
        goal: Vertex,
        turning: bool,
        lanes: Option<&Lanes>,
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<Self> {
        let shift = if turning { 2 } else { 0 };
        let mut steps = vec![UNREACHABLE; (graph.len() + 1) << shift].into_boxed_slice();
        let headings = 1 << shift;
        let charge = |v, d| lanes.map_or(0, |lanes| lanes.charge(v, d));
        // Those at each of the next distances, round and round (R. B. Dial, "Algorithm 360:
        // shortest-path forest with topological ordering", CACM 1969).
        let most = lanes.map_or(0, Lanes::most) as usize;
        let mut levels = vec![Vec::new(); most + 2];
        let count = levels.len();
        levels[0].extend((0..headings).map(|heading| (goal << shift) + heading));
        for &state in &levels[0] {
            steps[state as usize] = 0;
        }
        let mut waiting = levels[0].len();
        let (mut distance, mut unlooked) = (0, 0);
        while waiting > 0 {
            let mut level = std::mem::take(&mut levels[distance as usize % count]);
            waiting -= level.len();
            unlooked += level.len();
            if unlooked >= PATIENCE {
                unlooked = 0;
                if stop() {
                    return None;
                }
            }
            // What is further than the largest distance is left unreachable.
            let mut reach = |state: u32, charge: u32| {
                let entry = &mut steps[state as usize];
                let there = distance + 1 + charge;
                if there < u32::from(*entry) && there <= MAX_DISTANCE {
                    *entry = there as u16;
                    levels[there as usize % count].push(state);
                    waiting += 1;
                }
            };
            for &state in &level {
                let (v, heading) = (state >> shift, state & (headings - 1));
                if turning {
                    // Whoever looks this way here has come from behind, or has turned.
                    let behind = graph.sources(v)[(heading as usize + 2) % DIRECTIONS];
                    if behind != graph.wall() {
                        let charge = charge(behind, heading as usize);
                        reach((behind << shift) + heading, charge);
                    }
                    reach((v << shift) + (heading + 1) % 4, 0);
                    reach((v << shift) + (heading + 3) % 4, 0);
                } else {
                    for (back, &u) in graph.sources(v).iter().enumerate() {
                        if u != graph.wall() {
                            reach(u, charge(u, (back + 2) % DIRECTIONS));
                        }
                    }
                }
            }
            level.clear();
            levels[distance as usize % count] = level;
            distance += 1;
        }
        Some(Self { steps, shift })
    }

    /// Bytes of a table.
    pub fn bytes(graph: &Graph, turning: bool) -> u64 {
        let headings = if turning { DIRECTIONS as u64 } else { 1 };
        (graph.len() as u64 + 1) * headings * size_of::<u16>() as u64
    }

    /// The distance from `v`, looking in direction `heading` (of no account for pebbles);
    /// larger than [`MAX_DISTANCE`] where there is no way, and from [`Graph::wall`].
    #[inline]
    pub fn get(&self, v: Vertex, heading: u8) -> u32 {
        let mask = (1 << self.shift) - 1;
        u32::from(self.steps[((v << self.shift) | (u32::from(heading) & mask)) as usize])
    }

    /// The distance from `v` for a robot that may choose where it looks at first.
    pub fn least(&self, v: Vertex) -> u32 {
        let headings = 0..1_u8 << self.shift;
        headings.map(|h| self.get(v, h)).min().unwrap_or(u32::MAX)
    }
}

/// Tables by key, kept while they fit into a limit. The key of a table says all that decides about
/// it on the map: its goal, and what else differs between calls.
///
/// In a fleet that works without end most goals stay from one call to the next, and the
/// same places come again.
#[derive(Debug)]
pub struct Tables<K, T> {
    limit: u64,
    bytes: u64,
    call: u64,
    /// The keys that this call has asked for.
    asked: Vec<K>,
    kept: BTreeMap<K, Kept<T>>,
}

/// The reason why there is no table.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NoTable {
    /// All that are in use take more than the limit.
    Full,
    /// It was not made in time.
    Stopped,
}

#[derive(Debug)]
struct Kept<T> {
    table: Arc<T>,
    bytes: u64,
    /// The last call that asked for it.
    call: u64,
}

impl<K: Copy + Ord, T> Tables<K, T> {
    /// None yet; those kept between calls may take `limit` bytes.
    pub fn new(limit: u64) -> Self {
        Self {
            limit,
            bytes: 0,
            call: 0,
            asked: Vec::new(),
            kept: BTreeMap::new(),
        }
    }

    /// Bytes that they may take.
    pub fn limit(&self) -> u64 {
        self.limit
    }

    /// Bytes that the kept tables take.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The tables that are kept.
    pub fn iter(&self) -> impl Iterator<Item = &T> {
        self.kept.values().map(|kept| &*kept.table)
    }

    /// Counts anew how many bytes the tables take that the last call has asked for, as tables grow while
    /// they are in use. Where all take more than `idle`, the others go until they take three quarters of
    /// that, so that this is rare; and all go where they take more than three quarters of the limit, so
    /// that those of the next call grow from nothing.
    pub fn weigh(&mut self, idle: u64, bytes: impl Fn(&T) -> u64) {
        for key in &self.asked {
            if let Some(kept) = self.kept.get_mut(key) {
                self.bytes -= kept.bytes;
                kept.bytes = bytes(&kept.table);
                self.bytes += kept.bytes;
            }
        }
        if self.bytes > idle {
            self.drop_old(idle - idle / 4);
        }
        if self.bytes > self.limit - self.limit / 4 {
            self.kept.clear();
            self.bytes = 0;
        }
    }

    /// A call begins: tables that it does not ask for may go.
    pub fn begin(&mut self) {
        self.call += 1;
        self.asked.clear();
    }

    /// The table of a key, if it is kept.
    pub fn kept(&mut self, key: K) -> Option<Arc<T>> {
        let kept = self.kept.get_mut(&key)?;
        if kept.call != self.call {
            kept.call = self.call;
            self.asked.push(key);
        }
        Some(Arc::clone(&kept.table))
    }

    /// The table of a key, which takes so many bytes. What was not asked for since
    /// [`Tables::begin`] makes room; `None` when what was asked for exceeds the limit.
    pub fn get(&mut self, key: K, bytes: u64, make: impl FnOnce() -> T) -> Option<Arc<T>> {
        self.try_get(key, bytes, || Some(make())).ok()
    }

    /// The same with a table that may not be made in time. Where there is no room, nothing is made.
    pub fn try_get(
        &mut self,
        key: K,
        bytes: u64,
        make: impl FnOnce() -> Option<T>,
    ) -> Result<Arc<T>, NoTable> {
        if let Some(table) = self.kept(key) {
            return Ok(table);
        }
        if self.bytes + bytes > self.limit {
            // And a quarter of the limit beside, so that this is rare.
            let most = (self.limit - self.limit / 4).saturating_sub(bytes);
            self.drop_old(most);
            if self.bytes + bytes > self.limit {
                return Err(NoTable::Full);
            }
        }
        let table = Arc::new(make().ok_or(NoTable::Stopped)?);
        self.bytes += bytes;
        let kept = Kept {
            table: Arc::clone(&table),
            bytes,
            call: self.call,
        };
        self.asked.push(key);
        self.kept.insert(key, kept);
        Ok(table)
    }

    /// Drops tables that this call has not asked for, those that were not asked for longest first,
    /// until all take no more than `most` bytes.
    fn drop_old(&mut self, most: u64) {
        if self.bytes <= most {
            return;
        }
        let mut old: Vec<_> = self
            .kept
            .iter()
            .map(|(key, kept)| (kept.call, *key))
            .collect();
        old.retain(|(call, _)| *call < self.call);
        old.sort_unstable();
        for (_, key) in old {
            if self.bytes <= most {
                return;
            }
            if let Some(kept) = self.kept.remove(&key) {
                self.bytes -= kept.bytes;
            }
        }
    }
}
