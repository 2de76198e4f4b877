//! Jump point search: A* that goes straight on until there is a reason to turn.
//!
//! D. Harabor, A. Grastien, "Online graph pruning for pathfinding on grid maps", AAAI
//! 2011, in the variant whose diagonal moves need both cells beside them free, and its
//! counterpart with four neighbours.
//!
//! Of several paths of the same length one is *canonical*: with eight neighbours the
//! one that goes diagonally first, with four the one that goes along its column first.
//! A place that was reached in some direction has to make those successors alone that
//! continue canonical paths. These are few, and are followed at once up to a *jump
//! point*: the goal, a place beside the end of an obstacle (where another path may turn
//! round it), or one from which a jump point lies to the side.
//!
//! With four neighbours, a corridor of width one has a jump point at every opening to
//! its sides. *Expansions*: places taken from the open list, the goal not included.

use std::cmp::Reverse;

use crate::cost::{Cost, Exact, Guide, Heuristic, Octile, Open, Priority, Rank, TieBreaking};
use crate::grid::{
    EAST, Grid, NORTH, NORTH_EAST, NORTH_WEST, NOWHERE, Neighbors, Place, SOUTH, SOUTH_EAST,
    SOUTH_WEST, WEST, directions, opposite, sides,
};
use crate::search::{Answer, Limit, Outcome, Search};
use crate::slate::Slate;

#[derive(Debug, Clone, Copy)]
struct Node<C> {
    cost: C,
    parent: Place,
    /// The direction in which the place was reached.
    direction: u8,
    closed: bool,
}

impl<C: Cost> Default for Node<C> {
    fn default() -> Self {
        Self {
            cost: C::FAR,
            parent: 0,
            direction: NOWHERE,
            closed: false,
        }
    }
}

/// Jump point search. With a heuristic that does not overestimate, the path is a
/// shortest one.
#[derive(Debug)]
pub struct JumpPoint {
    heuristic: Option<Heuristic>,
    ties: TieBreaking,
    four: Slate<Node<u32>>,
    eight: Slate<Node<Octile>>,
    whole: Open<u128>,
    exact: Open<Exact>,
}

impl JumpPoint {
    /// With a heuristic, or else the one that is exact where nothing is in the way.
    pub fn new(heuristic: Option<Heuristic>, ties: TieBreaking) -> Self {
        Self {
            heuristic,
            ties,
            four: Slate::default(),
            eight: Slate::default(),
            whole: Open::new(),
            exact: Open::new(),
        }
    }
}

impl Search for JumpPoint {
    fn search(
        &mut self,
        grid: &Grid,
        start: u32,
        goal: u32,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        let (start, goal) = (grid.place(start), grid.place(goal));
        let jump = Jump { grid, goal };
        let priority = Priority {
            heuristic: Heuristic::or_fitting(self.heuristic, grid),
            cost: true,
            weight: 1.0,
            ties: self.ties,
        };
        let exact = priority.exact(goal);
        match (grid.neighbors(), priority.whole(grid, goal)) {
            (Neighbors::Four, Some(guide)) => {
                jump.run(start, &guide, &mut self.four, &mut self.whole, limit, path)
            }
            (Neighbors::Four, None) => {
                jump.run(start, &exact, &mut self.four, &mut self.exact, limit, path)
            }
            (Neighbors::Eight, _) => {
                jump.run(start, &exact, &mut self.eight, &mut self.exact, limit, path)
            }
        }
    }
}

/// The two directions to the sides of a straight one.
fn beside(direction: u8) -> [u8; 2] {
    match direction {
        EAST | WEST => [NORTH, SOUTH],
        _ => [WEST, EAST],
    }
}

/// The diagonal direction between two straight ones.
fn between(one: u8, other: u8) -> u8 {
    match (one, other) {
        (NORTH, WEST) | (WEST, NORTH) => NORTH_WEST,
        (NORTH, EAST) | (EAST, NORTH) => NORTH_EAST,
        (SOUTH, EAST) | (EAST, SOUTH) => SOUTH_EAST,
        _ => SOUTH_WEST,
    }
}

/// Directions in which a place is left, in order.
#[derive(Debug, Default)]
struct Ways {
    all: [u8; 8],
    count: usize,
}

impl Ways {
    fn add(&mut self, direction: u8) {
        self.all[self.count] = direction;
        self.count += 1;
    }
}

struct Jump<'g> {
    grid: &'g Grid,
    goal: Place,
}

impl Jump<'_> {
    #[inline]
    fn free(&self, place: Place, direction: u8) -> bool {
        self.grid.free_at(self.grid.step(place, direction))
    }

    /// True if an obstacle ends beside a place that was reached in a straight direction: to that
    /// side there may be paths that go through here and nowhere else.
    #[inline]
    fn turns(&self, place: Place, direction: u8, side: u8) -> bool {
        let before = self.grid.step(place, opposite(direction));
        !self.free(before, side) && self.free(place, side)
    }

    /// The first place straight ahead that is the goal or beside the end of an obstacle, and the
    /// number of moves to it.
    #[inline]
    fn straight(&self, from: Place, direction: u8) -> Option<(Place, u32)> {
        let [one, other] = beside(direction);
        let mut before = [self.free(from, one), self.free(from, other)];
        let mut place = from;
        let mut moves = 0;
        loop {
            place = self.grid.step(place, direction);
            moves += 1;
            if !self.grid.free_at(place) {
                return None;
            }
            let now = [self.free(place, one), self.free(place, other)];
            let turns = now[0] && !before[0] || now[1] && !before[1];
            if turns || place == self.goal {
                return Some((place, moves));
            }
            before = now;
        }
    }

    /// With four neighbours along a column: also where a row has something.
    fn along_column(&self, from: Place, direction: u8) -> Option<(Place, u32)> {
        let mut place = from;
        let mut moves = 0;
        loop {
            let next = self.grid.step(place, direction);
            moves += 1;
            if !self.grid.free_at(next) {
                return None;
            }
            let stops = next == self.goal
                || self.turns(next, direction, WEST)
                || self.turns(next, direction, EAST)
                || self.straight(next, WEST).is_some()
                || self.straight(next, EAST).is_some();
            if stops {
                return Some((next, moves));
            }
            place = next;
        }
    }

    /// With eight neighbours along a diagonal: also where a row or a column has
    /// something.
    fn along_diagonal(&self, from: Place, direction: u8) -> Option<(Place, u32)> {
        let (row, col) = sides(direction);
        let mut place = from;
        let mut moves = 0;
        while self.grid.exits(place) >> direction & 1 == 1 {
            place = self.grid.step(place, direction);
            moves += 1;
            let stops = place == self.goal
                || self.straight(place, row).is_some()
                || self.straight(place, col).is_some();
            if stops {
                return Some((place, moves));
            }
        }
        None
    }

    fn jump(&self, from: Place, direction: u8) -> Option<(Place, u32)> {
        match (self.grid.neighbors(), direction) {
            (_, 4..) => self.along_diagonal(from, direction),
            (Neighbors::Four, NORTH | SOUTH) => self.along_column(from, direction),
            _ => self.straight(from, direction),
        }
    }

    /// The directions that continue canonical paths.
    fn ways(&self, place: Place, direction: u8) -> Ways {
        let exits = self.grid.exits(place);
        let open = |direction: u8| exits >> direction & 1 == 1;
        let mut ways = Ways::default();
        match direction {
            NOWHERE => directions(exits).for_each(|direction| ways.add(direction)),
            4.. => {
                let (row, col) = sides(direction);
                for way in [direction, row, col] {
                    if open(way) {
                        ways.add(way);
                    }
                }
            }
            _ => {
                if open(direction) {
                    ways.add(direction);
                }
                let along_column = matches!(direction, NORTH | SOUTH);
                let all = self.grid.neighbors() == Neighbors::Four && along_column;
                for side in beside(direction) {
                    if open(side) && (all || self.turns(place, direction, side)) {
                        ways.add(side);
                        let diagonal = between(direction, side);
                        if open(diagonal) {
                            ways.add(diagonal);
                        }
                    }
                }
            }
        }
        ways
    }

    fn run<C: Cost, G: Guide<C>>(
        &self,
        start: Place,
        guide: &G,
        nodes: &mut Slate<Node<C>>,
        open: &mut Open<G::Rank>,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        let grid = self.grid;
        path.clear();
        nodes.begin(grid.places());
        open.clear();
        let mut insertion = 0;
        let mut expansions = 0;
        *nodes.entry(start) = Node {
            cost: C::default(),
            parent: start,
            ..Node::default()
        };
        open.push(Reverse(guide.rank(grid, start, C::default(), insertion)));
        while let Some(Reverse(rank)) = open.pop() {
            let place = rank.place();
            if nodes.entry(place).closed {
                continue;
            }
            if place == self.goal {
                self.trace(nodes, start, path);
                return Answer::new(Outcome::Found, expansions);
            }
            if let Some(stop) = limit.reached(expansions) {
                return Answer::new(Outcome::Stopped(stop), expansions);
            }
            expansions += 1;
            nodes.entry(place).closed = true;
            let Node {
                cost, direction, ..
            } = *nodes.entry(place);
            let ways = self.ways(place, direction);
            for way in &ways.all[..ways.count] {
                let Some((near, moves)) = self.jump(place, *way) else {
                    continue;
                };
                let reached = cost.ahead(*way, moves);
                let node = nodes.entry(near);
                if reached.less(node.cost) {
                    *node = Node {
                        cost: reached,
                        parent: place,
                        direction: *way,
                        closed: false,
                    };
                    insertion += 1;
                    open.push(Reverse(guide.rank(grid, near, reached, insertion)));
                }
            }
        }
        Answer::new(Outcome::NoPath, expansions)
    }

    /// All cells of the path, those between jump points too.
    fn trace<C: Cost>(&self, nodes: &mut Slate<Node<C>>, start: Place, path: &mut Vec<u32>) {
        let mut place = self.goal;
        path.push(self.grid.cell(place));
        while place != start {
            let Node {
                parent, direction, ..
            } = *nodes.entry(place);
            while place != parent {
                place = self.grid.step(place, opposite(direction));
                path.push(self.grid.cell(place));
            }
        }
        path.reverse();
    }
}
