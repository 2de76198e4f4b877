//! Beam search: breadth-first search that keeps the most promising places of each
//! layer.
//!
//! B. T. Lowerre, "The HARPY speech recognition system", Carnegie Mellon University,
//! 1976; R. Bisiani, "Beam search", Encyclopedia of Artificial Intelligence, 1987.
//!
//! A layer is what was found, or found at a lower cost, from the layer before. The
//! `width` places with the least (f, h), then row by row, are kept. Paths need not be
//! shortest, and may be missed; only a search that never had to drop a place proves
//! that there is none. *Expansions*: places whose neighbours were looked at; the goal
//! ends the search when it is found, and is not one of them.

use crate::cost::{Cost, Heuristic, Octile};
use crate::grid::{Grid, NOWHERE, Neighbors, Place, directions};
use crate::nodes::Nodes;
use crate::search::{Answer, Limit, Outcome, Search};

/// Beam search.
#[derive(Debug)]
pub struct Beam {
    heuristic: Option<Heuristic>,
    width: usize,
    four: Layers<u32>,
    eight: Layers<Octile>,
}

impl Beam {
    /// With a heuristic, or else the one that is exact where nothing is in the way, and
    /// at least one place per layer.
    pub fn new(heuristic: Option<Heuristic>, width: usize) -> Self {
        Self {
            heuristic,
            width: width.max(1),
            four: Layers::default(),
            eight: Layers::default(),
        }
    }
}

impl Search for Beam {
    fn search(
        &mut self,
        grid: &Grid,
        start: u32,
        goal: u32,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        let heuristic = Heuristic::or_fitting(self.heuristic, grid);
        let ends = (grid.place(start), grid.place(goal));
        match grid.neighbors() {
            Neighbors::Four => self
                .four
                .run(grid, ends, heuristic, self.width, limit, path),
            Neighbors::Eight => self
                .eight
                .run(grid, ends, heuristic, self.width, limit, path),
        }
    }
}

/// A place that was found, by what it is kept for: f, h, place; and its cost then.
type Candidate<C> = ((u64, u64, Place), C);

#[derive(Debug, Default)]
struct Layers<C> {
    nodes: Nodes<C>,
    layer: Vec<Place>,
    found: Vec<Candidate<C>>,
}

impl<C: Cost> Layers<C> {
    fn run(
        &mut self,
        grid: &Grid,
        (start, goal): (Place, Place),
        heuristic: Heuristic,
        width: usize,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        let Self {
            nodes,
            layer,
            found,
        } = self;
        path.clear();
        nodes.begin(grid.places());
        nodes.open(start, C::default(), NOWHERE);
        layer.clear();
        layer.push(start);
        if start == goal {
            path.push(grid.cell(start));
            return Answer::new(Outcome::Found, 0);
        }
        let mut expansions = 0;
        let mut dropped = false;
        while !layer.is_empty() {
            found.clear();
            for place in layer.iter().copied() {
                if let Some(stop) = limit.reached(expansions) {
                    return Answer::new(Outcome::Stopped(stop), expansions);
                }
                expansions += 1;
                let so_far = nodes.known(place);
                for direction in directions(nodes.onward(grid, place)) {
                    let near = grid.step(place, direction);
                    let cost = so_far.step(direction);
                    if nodes.cost(near).is_some_and(|known| !cost.less(known)) {
                        continue;
                    }
                    nodes.open(near, cost, direction);
                    if near == goal {
                        nodes.trace(grid, goal, path);
                        return Answer::new(Outcome::Found, expansions);
                    }
                    let left = heuristic.value(grid.apart(near, goal));
                    let f = cost.value() + left;
                    found.push(((f.to_bits(), left.to_bits(), near), cost));
                }
            }
            // What was found again at a lower cost counts once.
            found.retain(|((_, _, place), cost)| nodes.known(*place) == *cost);
            if found.len() > width {
                dropped = true;
                found.select_nth_unstable_by_key(width - 1, |(rank, _)| *rank);
                found.truncate(width);
            }
            found.sort_unstable_by_key(|(rank, _)| *rank);
            layer.clear();
            layer.extend(found.iter().map(|((_, _, place), _)| *place));
        }
        let outcome = if dropped {
            Outcome::GaveUp
        } else {
            Outcome::NoPath
        };
        Answer::new(outcome, expansions)
    }
}
