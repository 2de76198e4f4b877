//! Theta* and Lazy Theta*: any-angle paths on grids.
//!
//! - A. Nash, K. Daniel, S. Koenig, A. Felner, "Theta*: Any-angle path planning on
//!   grids", AAAI 2007.
//! - A. Nash, S. Koenig, C. Tovey, "Lazy Theta*: Any-angle path planning and path
//!   length analysis in 3D", AAAI 2010.
//!
//! Both expand places as A* does, with all eight neighbours whatever the map says, but
//! let a neighbour have the parent of the place that is expanded when it sees it.
//! Theta* looks when it finds a neighbour; Lazy Theta* takes for granted that there is a
//! line of sight and looks when the neighbour is expanded, which is far less often.
//!
//! Paths are short, not shortest. Theta* expands a place again when a shorter way to it
//! is found, so that a path is never longer than the shortest one along the grid, if
//! the heuristic does not overestimate. Lazy Theta* does not, and promises no bound.
//! *Expansions*: places taken from the open list, the goal included.

use std::cmp::Reverse;

use crate::cost::{Exact, Heuristic, Open, Rank, TieBreaking};
use crate::grid::{Grid, Place, sides};
use crate::search::{Answer, Limit, Outcome, Search};
use crate::sight::{Corners, visible};
use crate::slate::Slate;

/// A way is shorter when it is so by more than the rounding of its sum.
const ROUNDING: f64 = 1e-9;

/// Row by row, as the neighbours are looked at.
const AROUND: [u8; 8] = {
    use crate::grid::{EAST, NORTH, NORTH_EAST, NORTH_WEST, SOUTH, SOUTH_EAST, SOUTH_WEST, WEST};
    [
        NORTH_WEST, NORTH, NORTH_EAST, WEST, EAST, SOUTH_WEST, SOUTH, SOUTH_EAST,
    ]
};

#[derive(Debug, Clone, Copy)]
struct Node {
    cost: f64,
    parent: Place,
    closed: bool,
}

impl Default for Node {
    fn default() -> Self {
        Self {
            cost: f64::INFINITY,
            parent: 0,
            closed: false,
        }
    }
}

/// The time at which lines of sight are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Looks {
    /// When a neighbour is found: Theta*.
    Early,
    /// When it is expanded: Lazy Theta*.
    Late,
}

/// Theta* or Lazy Theta*. The path has the cells where it turns.
#[derive(Debug)]
pub struct ThetaStar {
    looks: Looks,
    heuristic: Heuristic,
    ties: TieBreaking,
    corners: Corners,
    nodes: Slate<Node>,
    open: Open<Exact>,
}

impl ThetaStar {
    /// With a heuristic, which should not exceed the Euclidean one, and a rule for
    /// corners.
    pub fn new(looks: Looks, heuristic: Heuristic, ties: TieBreaking, corners: Corners) -> Self {
        Self {
            looks,
            heuristic,
            ties,
            corners,
            nodes: Slate::default(),
            open: Open::new(),
        }
    }

    fn push(&mut self, grid: &Grid, place: Place, goal: Place, cost: f64, insertion: u32) {
        let left = self.heuristic.value(grid.apart(place, goal));
        let tie = match self.ties {
            TieBreaking::LowH => left.to_bits(),
            TieBreaking::HighG => !cost.to_bits(),
            TieBreaking::LowG => cost.to_bits(),
            TieBreaking::Fifo => 0,
        };
        let last = u64::from(insertion) << 32 | u64::from(place);
        self.open
            .push(Reverse(((cost + left).to_bits(), tie, last)));
    }

    fn sees(&self, grid: &Grid, from: Place, to: Place) -> bool {
        visible(grid, from, to, self.corners)
    }

    /// Takes back what Lazy Theta* took for granted: if a place does not see its
    /// parent, the best of its expanded neighbours becomes its parent.
    fn look(&mut self, grid: &Grid, place: Place) {
        let parent = self.nodes.entry(place).parent;
        if self.sees(grid, parent, place) {
            return;
        }
        let mut best = (f64::INFINITY, parent);
        for near in around(grid, place, self.corners) {
            if let Some(node) = self.nodes.get(near).filter(|node| node.closed) {
                let cost = node.cost + distance(grid, near, place);
                if cost < best.0 {
                    best = (cost, near);
                }
            }
        }
        let node = self.nodes.entry(place);
        (node.cost, node.parent) = best;
    }
}

/// The neighbours of a place, row by row.
fn around(grid: &Grid, place: Place, corners: Corners) -> impl Iterator<Item = Place> + use<> {
    let free = |direction| grid.free_at(grid.step(place, direction));
    let near = AROUND.map(|direction| {
        let open = free(direction)
            && (direction < 4 || {
                let (row, col) = sides(direction);
                corners.open(free(row), free(col))
            });
        open.then(|| grid.step(place, direction))
    });
    near.into_iter().flatten()
}

fn distance(grid: &Grid, from: Place, to: Place) -> f64 {
    Heuristic::Euclidean.value(grid.apart(from, to))
}

impl Search for ThetaStar {
    fn search(
        &mut self,
        grid: &Grid,
        start: u32,
        goal: u32,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        path.clear();
        let (start, goal) = (grid.place(start), grid.place(goal));
        self.nodes.begin(grid.places());
        self.open.clear();
        let mut insertion = 0;
        let mut expansions = 0;
        *self.nodes.entry(start) = Node {
            cost: 0.0,
            parent: start,
            closed: false,
        };
        self.push(grid, start, goal, 0.0, insertion);
        while let Some(Reverse(rank)) = self.open.pop() {
            let place = rank.place();
            if self.nodes.entry(place).closed {
                continue;
            }
            if let Some(stop) = limit.reached(expansions) {
                return Answer::new(Outcome::Stopped(stop), expansions);
            }
            expansions += 1;
            if self.looks == Looks::Late {
                self.look(grid, place);
            }
            self.nodes.entry(place).closed = true;
            if place == goal {
                self.trace(grid, start, goal, path);
                return Answer::new(Outcome::Found, expansions);
            }
            let Node { cost, parent, .. } = *self.nodes.entry(place);
            let of_parent = self.nodes.entry(parent).cost;
            for near in around(grid, place, self.corners) {
                let straight = match self.looks {
                    Looks::Early => parent != place && self.sees(grid, parent, near),
                    Looks::Late => true,
                };
                let (from, so_far) = if straight {
                    (parent, of_parent)
                } else {
                    (place, cost)
                };
                let reached = so_far + distance(grid, from, near);
                let node = self.nodes.entry(near);
                // Lazy Theta* may have to fall back on who was expanded.
                let settled = node.closed && self.looks == Looks::Late;
                if reached + ROUNDING < node.cost && !settled {
                    *node = Node {
                        cost: reached,
                        parent: from,
                        closed: false,
                    };
                    insertion += 1;
                    self.push(grid, near, goal, reached, insertion);
                }
            }
        }
        Answer::new(Outcome::NoPath, expansions)
    }
}

impl ThetaStar {
    /// The cells where the path turns.
    fn trace(&self, grid: &Grid, start: Place, goal: Place, path: &mut Vec<u32>) {
        let mut place = goal;
        path.push(grid.cell(place));
        while place != start {
            let Some(node) = self.nodes.get(place) else {
                break;
            };
            place = node.parent;
            path.push(grid.cell(place));
        }
        path.reverse();
    }
}
