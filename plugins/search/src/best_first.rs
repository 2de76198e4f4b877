//! Best-first search with an open and a closed list: A*, weighted A*, Dijkstra's
//! algorithm and greedy best-first search differ in the priority alone.
//!
//! - A*: f = g + h. P. E. Hart, N. J. Nilsson, B. Raphael, "A formal basis for the
//!   heuristic determination of minimum cost paths", IEEE Transactions on Systems
//!   Science and Cybernetics 4(2), 1968.
//! - Dijkstra: f = g. E. W. Dijkstra, "A note on two problems in connexion with
//!   graphs", Numerische Mathematik 1, 1959.
//! - Weighted A*: f = g + w·h, and paths at most w times as long as the shortest. I.
//!   Pohl, "Heuristic search viewed as path finding in a graph", Artificial
//!   Intelligence 1, 1970.
//! - Greedy: f = h. J. E. Doran, D. Michie, "Experiments with the graph traverser
//!   program", Proceedings of the Royal Society A 294, 1966.
//!
//! *Expansions*: places taken from the open list for the first time or again after a
//! better path to them was found, the goal included.

use std::cmp::Reverse;

use crate::bfs::Bfs;
use crate::cost::{Cost, Exact, Guide, Heuristic, Octile, Open, Priority, Rank, TieBreaking};
use crate::grid::{DELTAS, EAST, Grid, NORTH, NOWHERE, Neighbors, Place, SOUTH, WEST, directions};
use crate::nodes::Nodes;
use crate::search::{Answer, Limit, Outcome, Search};

/// The order in which the straight neighbours of a place are looked at; the diagonal ones follow
/// clockwise from north-west.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// North, east, south, west.
    Clockwise,
    /// North, south, west, east.
    RowsFirst,
}

/// A*, weighted A* or greedy best-first search.
///
/// Without a heuristic named, it is the one that is exact where nothing is in the way:
/// Manhattan with four neighbours, octile with eight.
#[derive(Debug)]
pub struct BestFirst {
    heuristic: Option<Heuristic>,
    /// The cost so far is a part of the priority.
    cost: bool,
    weight: f64,
    ties: TieBreaking,
    order: Order,
    reopen: bool,
    four: Nodes<u32>,
    eight: Nodes<Octile>,
    whole: Open<u128>,
    exact: Open<Exact>,
}

impl BestFirst {
    fn new(heuristic: Option<Heuristic>, cost: bool, weight: f64, ties: TieBreaking) -> Self {
        Self {
            heuristic,
            cost,
            weight,
            ties,
            order: Order::Clockwise,
            reopen: cost,
            four: Nodes::default(),
            eight: Nodes::default(),
            whole: Open::new(),
            exact: Open::new(),
        }
    }

    /// A*. With a heuristic that does not overestimate, the path is a shortest one.
    pub fn astar(heuristic: Option<Heuristic>, ties: TieBreaking) -> Self {
        Self::new(heuristic, true, 1.0, ties)
    }

    /// Weighted A*. `reopen` says whether a place that was expanded is expanded again
    /// when a shorter way to it is found: with and without, the path is at most
    /// `weight` times as long as the shortest if the heuristic does not overestimate.
    pub fn weighted(
        heuristic: Option<Heuristic>,
        weight: f64,
        ties: TieBreaking,
        reopen: bool,
        order: Order,
    ) -> Self {
        Self {
            order,
            reopen,
            ..Self::new(heuristic, true, weight, ties)
        }
    }

    /// Greedy best-first search: fast, and the path may be of any length.
    pub fn greedy(heuristic: Option<Heuristic>, ties: TieBreaking) -> Self {
        Self::new(heuristic, false, 1.0, ties)
    }
}

impl Search for BestFirst {
    fn search(
        &mut self,
        grid: &Grid,
        start: u32,
        goal: u32,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        let ends = (grid.place(start), grid.place(goal));
        let how = How {
            order: self.order,
            reopen: self.reopen,
            cost: self.cost,
        };
        let priority = Priority {
            heuristic: Heuristic::or_fitting(self.heuristic, grid),
            cost: self.cost,
            weight: self.weight,
            ties: self.ties,
        };
        let exact = priority.exact(ends.1);
        match (grid.neighbors(), priority.whole(grid, ends.1)) {
            (Neighbors::Four, Some(guide)) => {
                let (nodes, open) = (&mut self.four, &mut self.whole);
                run(grid, ends, how, &guide, nodes, open, limit, path)
            }
            (Neighbors::Four, None) => {
                let (nodes, open) = (&mut self.four, &mut self.exact);
                run(grid, ends, how, &exact, nodes, open, limit, path)
            }
            (Neighbors::Eight, _) => {
                let (nodes, open) = (&mut self.eight, &mut self.exact);
                run(grid, ends, how, &exact, nodes, open, limit, path)
            }
        }
    }
}

/// Dijkstra's algorithm: the path is a shortest one.
///
/// With four neighbours every move costs the same, and places come to the open list in
/// the order in which they leave it: it is a queue, and the search is breadth-first.
#[derive(Debug)]
pub struct Dijkstra {
    four: Bfs,
    eight: BestFirst,
}

impl Default for Dijkstra {
    fn default() -> Self {
        Self {
            four: Bfs::default(),
            eight: BestFirst::new(None, true, 0.0, TieBreaking::Fifo),
        }
    }
}

impl Search for Dijkstra {
    fn search(
        &mut self,
        grid: &Grid,
        start: u32,
        goal: u32,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        match grid.neighbors() {
            Neighbors::Four => self.four.search(grid, start, goal, limit, path),
            Neighbors::Eight => self.eight.search(grid, start, goal, limit, path),
        }
    }
}

#[derive(Debug, Clone, Copy)]
struct How {
    order: Order,
    reopen: bool,
    /// A better path to a place is a better priority.
    cost: bool,
}

#[expect(
    clippy::too_many_arguments,
    reason = "the arrays are kept by the caller"
)]
fn run<C: Cost, G: Guide<C>>(
    grid: &Grid,
    (start, goal): (Place, Place),
    how: How,
    guide: &G,
    nodes: &mut Nodes<C>,
    open: &mut Open<G::Rank>,
    limit: &mut Limit<'_>,
    path: &mut Vec<u32>,
) -> Answer {
    path.clear();
    nodes.begin(grid.places());
    open.clear();
    let mut insertion = 0;
    let mut expansions = 0;
    nodes.open(start, C::default(), NOWHERE);
    open.push(Reverse(guide.rank(grid, start, C::default(), insertion)));
    while let Some(Reverse(rank)) = open.pop() {
        let place = rank.place();
        if nodes.is_closed(place) {
            continue;
        }
        if let Some(stop) = limit.reached(expansions) {
            return Answer::new(Outcome::Stopped(stop), expansions);
        }
        nodes.close(place);
        expansions += 1;
        if place == goal {
            nodes.trace(grid, place, path);
            return Answer::new(Outcome::Found, expansions);
        }
        let so_far = nodes.known(place);
        let onward = nodes.onward(grid, place);
        let mut reach = |direction: u8| {
            let near = grid.step(place, direction);
            let cost = so_far.step(direction);
            if let Some(known) = nodes.cost(near)
                && (!cost.less(known) || !how.reopen && nodes.is_closed(near))
            {
                return;
            }
            let is_new = how.cost || nodes.cost(near).is_none();
            nodes.open(near, cost, direction);
            // By the estimate alone the place is ranked as it is already.
            if is_new {
                insertion += 1;
                open.push(Reverse(guide.rank(grid, near, cost, insertion)));
            }
        };
        match how.order {
            Order::Clockwise => directions(onward).for_each(reach),
            Order::RowsFirst => [NORTH, SOUTH, WEST, EAST]
                .into_iter()
                .chain(4..DELTAS.len() as u8)
                .filter(|direction| onward >> direction & 1 == 1)
                .for_each(&mut reach),
        }
    }
    Answer::new(Outcome::NoPath, expansions)
}
