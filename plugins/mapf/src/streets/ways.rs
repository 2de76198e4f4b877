//! Costs of the way to a goal from every move of a map on, for agents whose turns cost.
//!
//! A distance by cell and heading would have four entries a cell, most of them for headings in which
//! nobody ever gets there: along an aisle one looks one way or the other, and in a one-way street
//! only one. A table has an entry per *move* instead, which is the arrival in its cell with its
//! heading.
//!
//! The search goes back from the goal, towards the place where an agent is, and no further than
//! somebody asks; the next question resumes it (reverse resumable A\*: D. Silver, "Cooperative
//! pathfinding", AIIDE 2005). Its bound is the cost on a map without obstacles, which is consistent:
//! what is settled is exact, whatever was asked before. The queue has a bucket per cost (R. B. Dial,
//! "Algorithm 360: shortest-path forest with topological ordering", CACM 1969), and entries are
//! allocated in pages as the search reaches them.

use std::sync::atomic::{AtomicU16, AtomicU32, AtomicU64, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

use fleetyard_abi::monotonic_ns;
use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Graph, Vertex};

/// The number of a move.
pub type Move = u32;

/// No move.
const NONE: Move = Move::MAX;
/// Rows and columns of cells whose moves have numbers that follow each other.
const TILE: u32 = 16;
/// Moves in a line of a table, which is a cache line.
const LINE: usize = 30;
/// Lines in a page: about the moves of a tile with lanes.
const PAGE: usize = 16;
/// About so many rows, and columns, does a search cover beside those between its ends.
const DETOURS: u64 = 48;
/// Bytes of a table at the beginning, and of each move, with the edge of the search.
const BASE: u64 = 4096;
const EACH: u64 = 3;
/// Moves that a search settles between two looks at the clock.
const PATIENCE: u32 = 256;
/// From where the goal is out of reach.
pub const FAR: u32 = u16::MAX as u32;

/// The moves of a map that ways may lead along.
#[derive(Debug)]
pub struct Moves {
    /// By vertex and direction the move that leads away; [`NONE`] where there is none.
    away: Box<[[Move; DIRECTIONS]]>,
    /// Per move the vertex that it begins at, and its direction.
    from: Box<[Vertex]>,
    heading: Box<[u8]>,
    /// Per move the row and the column that it begins at.
    places: Box<[[i32; 2]]>,
    /// Rows and columns up to the last that have any.
    size: [u32; 2],
    /// Moves that lead to the beginning of a move, and the quarter turns between in the lowest two bits:
    /// those of move `i` are from `before_at[i]` up to but not including `before_at[i + 1]`.
    before: Box<[u32]>,
    before_at: Box<[u32]>,
}

impl Moves {
    /// The moves of a map, of which `may` says if ways may lead along them.
    pub fn new(graph: &Graph, may: impl Fn(Vertex, usize) -> bool) -> Self {
        // Moves that are near each other on the map share pages.
        let mut vertices: Vec<Vertex> = (0..graph.len() as Vertex).collect();
        vertices.sort_by_key(|&v| graph.place(v).map(|at| at / TILE));
        let mut away = vec![[NONE; DIRECTIONS]; graph.len() + 1];
        let (mut from, mut heading, mut places) = (Vec::new(), Vec::new(), Vec::new());
        for v in vertices {
            for (d, &u) in graph.around(v).iter().enumerate() {
                if u != graph.wall() && may(v, d) {
                    away[v as usize][d] = from.len() as Move;
                    from.push(v);
                    heading.push(d as u8);
                    places.push(graph.place(v).map(|at| at as i32));
                }
            }
        }
        let mut moves = Self {
            away: away.into(),
            from: from.into(),
            heading: heading.into(),
            size: [0, 1].map(|axis| {
                let last = places.iter().map(|place: &[i32; 2]| place[axis]).max();
                last.map_or(0, |last| last as u32 + 1)
            }),
            places: places.into(),
            before: Box::default(),
            before_at: Box::default(),
        };
        // There are the most of these, by far: no more room than they need, also while they are made.
        let ends = || moves.from.iter().zip(&moves.heading);
        let count = ends().map(|(&v, _)| moves.leading_to(graph, v).count());
        let mut before = Vec::with_capacity(count.sum());
        let mut before_at = Vec::with_capacity(moves.len() + 1);
        before_at.push(0);
        for (&v, &heading) in ends() {
            let into = moves.leading_to(graph, v);
            before.extend(into.map(|(d, number)| number << 2 | quarters(heading, d)));
            before_at.push(before.len() as u32);
        }
        moves.before = before.into();
        moves.before_at = before_at.into();
        moves
    }

    /// The moves that lead to `v`, by their directions.
    fn leading_to(&self, graph: &Graph, v: Vertex) -> impl Iterator<Item = (usize, Move)> {
        (0..DIRECTIONS).filter_map(move |d| {
            let behind = graph.sources(v)[(d + 2) % DIRECTIONS];
            self.away(behind, d).map(|found| (d, found))
        })
    }

    /// Number of moves.
    pub fn len(&self) -> usize {
        self.from.len()
    }

    /// True if there is no move.
    pub fn is_empty(&self) -> bool {
        self.from.is_empty()
    }

    /// The move from `v` in direction `d`, if ways may lead along it.
    #[inline]
    pub fn away(&self, v: Vertex, d: usize) -> Option<Move> {
        Some(self.away[v as usize][d]).filter(|found| *found != NONE)
    }

    /// Costs of all moves, from those by vertex and direction, and of a turn by 90°.
    pub fn tolls(&self, turn: u32, toll: impl Fn(Vertex, usize) -> u32) -> Tolls {
        let ends = self.from.iter().zip(&self.heading);
        let costs: Box<[u16]> = ends
            .map(|(&v, &d)| toll(v, d.into()).min(FAR) as u16)
            .collect();
        let least = costs.iter().copied().min().unwrap_or(0).into();
        let most = costs.iter().copied().max().unwrap_or(0).into();
        Tolls {
            costs,
            least,
            most,
            turn,
            until_ns: AtomicU64::new(u64::MAX),
        }
    }
}

/// Costs of moves, at least 1 each, and of turns; and the time for which searches may go on.
#[derive(Debug)]
pub struct Tolls {
    costs: Box<[u16]>,
    least: u32,
    most: u32,
    turn: u32,
    until_ns: AtomicU64,
}

impl Tolls {
    /// The cost of a move.
    #[inline]
    pub fn of(&self, number: Move) -> u32 {
        self.costs[number as usize].into()
    }

    /// The cost of a turn by 90°.
    pub fn turn(&self) -> u32 {
        self.turn
    }

    /// Searches end at this instant, by the monotonic clock: until others are allowed, costs that nobody has
    /// asked for are then what they are at least. At first searches go on for as long as they take.
    pub fn search_until(&self, until_ns: u64) {
        self.until_ns.store(until_ns, Ordering::Relaxed);
    }

    /// True once that is over.
    pub fn is_late(&self) -> bool {
        let until_ns = self.until_ns.load(Ordering::Relaxed);
        until_ns < u64::MAX && monotonic_ns() >= until_ns
    }
}

/// The cost of the way to a goal from the end of each move on, as far as somebody has asked.
///
/// All questions about one table have to come with the same moves and costs. They may come from
/// several threads.
#[derive(Debug)]
pub struct Ways {
    goal: Vertex,
    /// Row and column of the place that the search goes to.
    towards: [i32; 2],
    pages: Box<[OnceLock<Box<[Line; PAGE]>>]>,
    /// No entry that is not settled has less than so much left to the goal and, at least, to the
    /// place that the search goes to. Settled entries are stored before it rises.
    level: AtomicU32,
    search: Mutex<Search>,
}

/// Entries of moves whose numbers follow each other. One that is not settled may become less.
#[derive(Debug)]
#[repr(align(64))]
struct Line {
    /// A bit per entry.
    settled: AtomicU32,
    rest: [AtomicU16; LINE],
}

impl Line {
    /// Nothing is found yet.
    const fn new() -> Self {
        Self {
            settled: AtomicU32::new(0),
            rest: [const { AtomicU16::new(FAR as u16) }; LINE],
        }
    }
}

/// The edge of the search.
#[derive(Debug)]
struct Search {
    /// Per cost, round and round, the first of the entries of `list` that wait there; [`NONE`]
    /// where nothing does.
    heads: Box<[u32]>,
    /// Moves, and the next entry with the same cost.
    list: Vec<(Move, u32)>,
    /// The first entry of the list that is free.
    free: u32,
    waiting: u32,
    pages: u32,
}

impl Search {
    #[inline]
    fn push(&mut self, number: Move, cost: u32) {
        let mask = self.heads.len() - 1;
        let head = &mut self.heads[cost as usize & mask];
        let entry = (number, *head);
        if self.free == NONE {
            *head = self.list.len() as u32;
            self.list.push(entry);
        } else {
            *head = self.free;
            self.free = std::mem::replace(&mut self.list[self.free as usize], entry).1;
        }
        self.waiting += 1;
    }

    /// A move that waits with this cost.
    #[inline]
    fn pop(&mut self, cost: u32) -> Option<Move> {
        let mask = self.heads.len() - 1;
        let head = &mut self.heads[cost as usize & mask];
        if *head == NONE {
            return None;
        }
        let at = std::mem::replace(head, self.list[*head as usize].1);
        self.list[at as usize].1 = std::mem::replace(&mut self.free, at);
        self.waiting -= 1;
        Some(self.list[at as usize].0)
    }
}

/// Quarter turns from one direction to another.
#[inline]
pub fn quarters(from: u8, to: usize) -> u32 {
    const BY_DIFFERENCE: [u32; DIRECTIONS] = [0, 1, 2, 1];
    BY_DIFFERENCE[(usize::from(from) + DIRECTIONS - to) % DIRECTIONS]
}

impl Ways {
    /// The ways to a goal, where any heading will do, for agents that are about so far from it.
    /// Nothing is searched yet.
    pub fn new(graph: &Graph, moves: &Moves, goal: Vertex, towards: Vertex, tolls: &Tolls) -> Self {
        // No step of the search adds more than this: a move, turns before it, and the same again in
        // the bound.
        let most = tolls.most + tolls.least + 4 * tolls.turn;
        let heads = (most as usize + 1).next_power_of_two();
        let ways = Self {
            goal,
            towards: graph.place(towards).map(|at| at as i32),
            pages: (0..moves.len().div_ceil(PAGE * LINE))
                .map(|_| OnceLock::new())
                .collect(),
            level: AtomicU32::new(0),
            search: Mutex::new(Search {
                heads: vec![NONE; heads].into(),
                list: Vec::new(),
                free: NONE,
                waiting: 0,
                pages: 0,
            }),
        };
        let mut search = ways.search();
        let last = moves.leading_to(graph, goal).map(|(_, last)| last);
        let last: Vec<(Move, u32)> = last
            .map(|last| (last, ways.bound(moves, last, tolls)))
            .collect();
        ways.level.store(
            last.iter().map(|entry| entry.1).min().unwrap_or(0),
            Ordering::Relaxed,
        );
        for (last, bound) in last {
            let line = ways.line(&mut search, last);
            line.rest[last as usize % LINE].store(0, Ordering::Relaxed);
            search.push(last, bound);
        }
        drop(search);
        ways
    }

    fn search(&self) -> MutexGuard<'_, Search> {
        self.search.lock().unwrap_or_else(PoisonError::into_inner)
    }

    #[inline]
    fn line(&self, search: &mut Search, number: Move) -> &Line {
        let line = number as usize / LINE;
        let page = self.pages[line / PAGE].get_or_init(|| {
            search.pages += 1;
            Box::new([const { Line::new() }; PAGE])
        });
        &page[line % PAGE]
    }

    /// About so many bytes are taken by the ways from a place to a goal.
    pub fn expected(graph: &Graph, moves: &Moves, from: Vertex, goal: Vertex) -> u64 {
        let [rows, cols] = moves.size.map(u64::from);
        let (from, goal) = (graph.place(from), graph.place(goal));
        let span = |axis: usize, all: u64| {
            let between = from[axis].abs_diff(goal[axis]);
            (u64::from(between) + DETOURS).min(all)
        };
        let part = span(0, rows) * span(1, cols);
        let moves = moves.len() as u64 * part / (rows * cols).max(1);
        BASE + moves * EACH
    }

    /// Bytes that it takes now.
    pub fn bytes(&self) -> u64 {
        let search = self.search();
        let lists = size_of_val(&*self.pages)
            + size_of_val(&*search.heads)
            + search.list.capacity() * size_of::<(Move, u32)>();
        (size_of::<Self>() + lists) as u64
            + u64::from(search.pages) * size_of::<[Line; PAGE]>() as u64
    }

    /// The cost of the way from the place that the search goes to up to the end of a move, if nothing
    /// were in the way.
    #[inline]
    fn bound(&self, moves: &Moves, number: Move, tolls: &Tolls) -> u32 {
        let [row, col] = moves.places[number as usize];
        let (rows, cols) = (row - self.towards[0], col - self.towards[1]);
        // The way along the direction of the move, and across.
        let (along, across) = match moves.heading[number as usize] {
            0 => (-rows, cols),
            1 => (cols, rows),
            2 => (rows, cols),
            _ => (-cols, rows),
        };
        let quarters = if along < 0 { 2 } else { u32::from(across != 0) };
        tolls.least * (along.unsigned_abs() + across.unsigned_abs() + 1) + tolls.turn * quarters
    }

    /// The entry of a move, if it is settled.
    #[inline]
    fn settled(&self, number: Move) -> Option<u32> {
        let line = number as usize / LINE;
        let line = &self.pages[line / PAGE].get()?[line % PAGE];
        let at = number as usize % LINE;
        let settled = line.settled.load(Ordering::Acquire) >> at & 1 == 1;
        settled.then(|| line.rest[at].load(Ordering::Relaxed).into())
    }

    /// The cost of the way from the end of a move on; [`FAR`] where there is none.
    #[inline]
    fn rest(&self, moves: &Moves, number: Move, tolls: &Tolls) -> u32 {
        let settled = self.settled(number);
        settled.unwrap_or_else(|| self.resume(moves, number, tolls))
    }

    /// Goes on with the search until a move is settled, or until there is no more time: then its cost is
    /// what it is at least.
    #[cold]
    fn resume(&self, moves: &Moves, wanted: Move, tolls: &Tolls) -> u32 {
        let mut search = self.search();
        let mut level = self.level.load(Ordering::Relaxed);
        let at_of = |number: Move| moves.before_at[number as usize] as usize;
        let mut rest = self.settled(wanted);
        let mut popped: u32 = 0;
        while rest.is_none() && search.waiting > 0 {
            if popped.is_multiple_of(PATIENCE) && tolls.is_late() {
                self.level.store(level, Ordering::Release);
                let least = level.saturating_sub(self.bound(moves, wanted, tolls));
                return least.min(FAR - 1);
            }
            popped += 1;
            let Some(number) = search.pop(level) else {
                level += 1;
                continue;
            };
            let line = self.line(&mut search, number);
            let at = number as usize % LINE;
            let (settled, bit) = (&line.settled, 1 << at);
            let before = settled.load(Ordering::Relaxed);
            // One that was found again nearer has gone on from there.
            if before & bit != 0 {
                continue;
            }
            let here = u32::from(line.rest[at].load(Ordering::Relaxed));
            settled.store(before | bit, Ordering::Release);
            if number == wanted {
                rest = Some(here);
            }
            let here = here + tolls.of(number);
            for &before in &moves.before[at_of(number)..at_of(number + 1)] {
                let (before, quarters) = (before >> 2, before & 3);
                let cost = here + tolls.turn * quarters;
                let line = self.line(&mut search, before);
                let entry = &line.rest[before as usize % LINE];
                if cost < u32::from(entry.load(Ordering::Relaxed)) {
                    entry.store(cost as u16, Ordering::Relaxed);
                    search.push(before, cost + self.bound(moves, before, tolls));
                }
            }
        }
        if search.waiting == 0 {
            level = u32::MAX;
        }
        self.level.store(level, Ordering::Release);
        rest.unwrap_or(FAR)
    }

    /// The cost of the way that begins with a move in direction `d`, for an agent that looks this way
    /// before it, or any way; [`FAR`] or more where there is none.
    #[inline]
    pub fn along(
        &self,
        moves: &Moves,
        number: Move,
        d: usize,
        heading: Option<u8>,
        tolls: &Tolls,
    ) -> u32 {
        let turns = heading.map_or(0, |heading| quarters(heading, d));
        tolls.turn * turns + tolls.of(number) + self.rest(moves, number, tolls)
    }

    /// The cost of the way from a vertex for an agent that looks this way, or any way.
    #[inline]
    pub fn from(&self, moves: &Moves, v: Vertex, heading: Option<u8>, tolls: &Tolls) -> u32 {
        if v == self.goal {
            return 0;
        }
        self.least(moves, v, heading, tolls)
            .map_or(FAR, |(cost, _)| cost)
    }

    /// The direction in which that way begins; `None` at the goal, and where it is out of reach.
    pub fn best(
        &self,
        moves: &Moves,
        v: Vertex,
        heading: Option<u8>,
        tolls: &Tolls,
    ) -> Option<usize> {
        let best = self.least(moves, v, heading, tolls);
        let best = best.filter(|(cost, _)| *cost < FAR && v != self.goal);
        best.map(|(_, d)| d)
    }

    /// The least of the ways from a vertex, and its first direction.
    #[inline]
    fn least(
        &self,
        moves: &Moves,
        v: Vertex,
        heading: Option<u8>,
        tolls: &Tolls,
    ) -> Option<(u32, usize)> {
        let level = self.level.load(Ordering::Acquire);
        let mut least = None;
        let mut open = [None; DIRECTIONS];
        for (d, open) in open.iter_mut().enumerate() {
            let Some(number) = moves.away(v, d) else {
                continue;
            };
            let turns = heading.map_or(0, |heading| quarters(heading, d));
            let first = tolls.turn * turns + tolls.of(number);
            match self.settled(number) {
                Some(rest) => least = Some(nearer(least, (first + rest, d))),
                None => *open = Some((number, first)),
            }
        }
        // Settled is only what may be less.
        for (d, entry) in open.into_iter().enumerate() {
            let Some((number, first)) = entry else {
                continue;
            };
            let bound = level.saturating_sub(self.bound(moves, number, tolls));
            if least.is_none_or(|least| (first.saturating_add(bound), d) < least) {
                least = Some(nearer(least, (first + self.rest(moves, number, tolls), d)));
            }
        }
        least
    }
}

fn nearer(least: Option<(u32, usize)>, other: (u32, usize)) -> (u32, usize) {
    least.map_or(other, |least| least.min(other))
}
