//! Costs of the way to a goal from every move of a map on, for agents whose turns cost.
//!
//! A distance by cell and heading would have four entries a cell, most of them for headings in which
//! nobody ever gets there: along an aisle one looks one way or the other, and in a one-way street
//! only one. A table has an entry per *move* instead, which is the arrival in its cell with its
//! heading. The search goes back from the goal, move by move (R. B. Dial, "Algorithm 360:
//! shortest-path forest with topological ordering", CACM 1969).

use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Graph, Vertex};

/// The number of a move.
pub type Move = u32;

/// No move.
const NONE: Move = Move::MAX;
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
    /// Moves that lead to the beginning of a move, and the quarter turns between: those of move
    /// `i` are from `before_at[i]` up to but not including `before_at[i + 1]`.
    before: Box<[(Move, u32)]>,
    before_at: Box<[u32]>,
}

impl Moves {
    /// The moves of a map, of which `may` says if ways may lead along them.
    pub fn new(graph: &Graph, may: impl Fn(Vertex, usize) -> bool) -> Self {
        let mut away = vec![[NONE; DIRECTIONS]; graph.len() + 1];
        let (mut from, mut heading) = (Vec::new(), Vec::new());
        for v in 0..graph.len() as Vertex {
            for (d, &u) in graph.around(v).iter().enumerate() {
                if u != graph.wall() && may(v, d) {
                    away[v as usize][d] = from.len() as Move;
                    from.push(v);
                    heading.push(d as u8);
                }
            }
        }
        let mut moves = Self {
            away: away.into(),
            from: from.into(),
            heading: heading.into(),
            before: Box::default(),
            before_at: Box::default(),
        };
        let (mut before, mut before_at) = (Vec::new(), vec![0]);
        for (&v, &heading) in moves.from.iter().zip(&moves.heading) {
            let into = moves.leading_to(graph, v);
            before.extend(into.map(|(d, number)| (number, quarters(heading, d))));
            before_at.push(before.len() as u32);
        }
        moves.before = before.into();
        moves.before_at = before_at.into();
        moves
    }

    /// The moves that lead to `v`, by their directions.
    fn leading_to(&self, graph: &Graph, v: Vertex) -> impl Iterator<Item = (usize, Move)> {
        (0..DIRECTIONS).filter_map(move |d| {
            let behind = graph.around(v)[(d + 2) % DIRECTIONS];
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
        let most = costs.iter().copied().max().unwrap_or(0);
        Tolls { costs, most, turn }
    }
}

/// Costs of moves, at least 1 each, and of turns.
#[derive(Debug)]
pub struct Tolls {
    costs: Box<[u16]>,
    most: u16,
    turn: u32,
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
}

/// The cost of the way to a goal from the end of each move on: 2 bytes a move.
#[derive(Debug)]
pub struct Ways {
    goal: Vertex,
    rest: Box<[u16]>,
}

/// Memory that searches need, to be used again.
#[derive(Debug, Default)]
pub struct Room(Vec<Vec<Move>>);

/// Quarter turns from one direction to another.
#[inline]
pub fn quarters(from: u8, to: usize) -> u32 {
    const BY_DIFFERENCE: [u32; DIRECTIONS] = [0, 1, 2, 1];
    BY_DIFFERENCE[(usize::from(from) + DIRECTIONS - to) % DIRECTIONS]
}

impl Ways {
    /// The ways to a goal, where any heading will do.
    pub fn new(graph: &Graph, moves: &Moves, goal: Vertex, tolls: &Tolls, room: &mut Room) -> Self {
        let mut rest = vec![FAR as u16; moves.len()].into_boxed_slice();
        let count = usize::from(tolls.most) + 2 * tolls.turn as usize + 1;
        let levels = &mut room.0;
        levels.resize_with(levels.len().max(count), Vec::new);
        let mut waiting = 0;
        for (_, last) in moves.leading_to(graph, goal) {
            rest[last as usize] = 0;
            levels[0].push(last);
            waiting += 1;
        }
        let (mut distance, mut at) = (0, 0);
        while waiting > 0 {
            let mut level = std::mem::take(&mut levels[at]);
            waiting -= level.len();
            for &number in &level {
                // One that was found again nearer has gone on from there.
                if u32::from(rest[number as usize]) != distance {
                    continue;
                }
                let here = distance + tolls.of(number);
                let at_of = |number: Move| moves.before_at[number as usize] as usize;
                for &(before, quarters) in &moves.before[at_of(number)..at_of(number + 1)] {
                    let cost = here + tolls.turn * quarters;
                    let entry = &mut rest[before as usize];
                    if cost < u32::from(*entry) {
                        *entry = cost as u16;
                        let mut level = at + (cost - distance) as usize;
                        if level >= count {
                            level -= count;
                        }
                        levels[level].push(before);
                        waiting += 1;
                    }
                }
            }
            level.clear();
            levels[at] = level;
            distance += 1;
            at += 1;
            if at == count {
                at = 0;
            }
        }
        Self { goal, rest }
    }

    /// Bytes of one.
    pub fn bytes(moves: &Moves) -> u64 {
        (moves.len() * size_of::<u16>()) as u64
    }

    /// The cost of the way that begins with a move in direction `d`, for an agent that looks this way
    /// before it, or any way; [`FAR`] or more where there is none.
    #[inline]
    pub fn along(&self, number: Move, d: usize, heading: Option<u8>, tolls: &Tolls) -> u32 {
        let turns = heading.map_or(0, |heading| quarters(heading, d));
        tolls.turn * turns + tolls.of(number) + u32::from(self.rest[number as usize])
    }

    /// The cost of the way from a vertex for an agent that looks this way, or any way.
    #[inline]
    pub fn from(&self, moves: &Moves, v: Vertex, heading: Option<u8>, tolls: &Tolls) -> u32 {
        if v == self.goal {
            return 0;
        }
        let ways = self.on(moves, v, heading, tolls);
        ways.map(|(cost, _)| cost).min().unwrap_or(FAR)
    }

    /// The direction in which that way begins; `None` at the goal, and where it is out of reach.
    pub fn best(
        &self,
        moves: &Moves,
        v: Vertex,
        heading: Option<u8>,
        tolls: &Tolls,
    ) -> Option<usize> {
        let ways = self.on(moves, v, heading, tolls);
        let best = ways.filter(|(cost, _)| *cost < FAR && v != self.goal).min();
        best.map(|(_, d)| d)
    }

    /// The ways from a vertex by their first direction, with what they cost.
    #[inline]
    fn on(
        &self,
        moves: &Moves,
        v: Vertex,
        heading: Option<u8>,
        tolls: &Tolls,
    ) -> impl Iterator<Item = (u32, usize)> {
        (0..DIRECTIONS).filter_map(move |d| {
            let number = moves.away(v, d)?;
            Some((self.along(number, d, heading, tolls), d))
        })
    }
}
