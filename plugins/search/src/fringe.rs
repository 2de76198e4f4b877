//! Fringe search: IDA* that goes on where the last round ended.
//!
//! Y. Björnsson, M. Enzenberger, R. C. Holte, J. Schaeffer, "Fringe search: beating A*
//! at pathfinding on game maps", IEEE Symposium on Computational Intelligence and
//! Games, 2005.
//!
//! Places are in two lists, *now* and *later*. Now's last is taken: if its f exceeds
//! the bound it goes to the end of later, else it is expanded, and what it leads to goes
//! to the end of now or of later, by its f. When now is empty, later becomes now, and
//! the bound the least f in it. (The paper keeps one list and visits it from its head;
//! taking from the end needs no links.) *Expansions*: places taken with an f within the
//! bound, the goal included.

use crate::cost::{Cost, Heuristic, Octile};
use crate::grid::{Grid, NOWHERE, Neighbors, Place, directions};
use crate::nodes::Nodes;
use crate::search::{Answer, Limit, Outcome, Search};

/// Fringe search. With a heuristic that does not overestimate, the path is a shortest
/// one.
#[derive(Debug)]
pub struct Fringe {
    heuristic: Option<Heuristic>,
    four: Lists<u32>,
    eight: Lists<Octile>,
}

impl Fringe {
    /// With a heuristic, or else the one that is exact where nothing is in the way.
    pub fn new(heuristic: Option<Heuristic>) -> Self {
        Self {
            heuristic,
            four: Lists::default(),
            eight: Lists::default(),
        }
    }
}

impl Search for Fringe {
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
            Neighbors::Four => self.four.run(grid, ends, heuristic, limit, path),
            Neighbors::Eight => self.eight.run(grid, ends, heuristic, limit, path),
        }
    }
}

#[derive(Debug, Default)]
struct Lists<C> {
    nodes: Nodes<C>,
    /// Places with the costs that they were put here for.
    now: Vec<(Place, C)>,
    later: Vec<(Place, C)>,
}

impl<C: Cost> Lists<C> {
    fn run(
        &mut self,
        grid: &Grid,
        (start, goal): (Place, Place),
        heuristic: Heuristic,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        let Self { nodes, now, later } = self;
        let f = |place, cost: C| cost.value() + heuristic.value(grid.apart(place, goal));
        path.clear();
        if start == goal {
            path.push(grid.cell(start));
            return Answer::new(Outcome::Found, 0);
        }
        nodes.begin(grid.places());
        nodes.open(start, C::default(), NOWHERE);
        now.clear();
        later.clear();
        now.push((start, C::default()));
        let mut bound = f(start, C::default());
        let mut expansions = 0;
        loop {
            let mut next = f64::INFINITY;
            while let Some((place, so_far)) = now.pop() {
                // A better way was found after this was put here.
                if nodes.known(place) != so_far {
                    continue;
                }
                let priority = f(place, so_far);
                if priority > bound {
                    next = next.min(priority);
                    later.push((place, so_far));
                    continue;
                }
                if let Some(stop) = limit.reached(expansions) {
                    return Answer::new(Outcome::Stopped(stop), expansions);
                }
                expansions += 1;
                if place == goal {
                    nodes.trace(grid, goal, path);
                    return Answer::new(Outcome::Found, expansions);
                }
                for direction in directions(nodes.onward(grid, place)) {
                    let near = grid.step(place, direction);
                    let cost = so_far.step(direction);
                    if nodes.cost(near).is_some_and(|known| !cost.less(known)) {
                        continue;
                    }
                    nodes.open(near, cost, direction);
                    let priority = f(near, cost);
                    if priority > bound {
                        next = next.min(priority);
                        later.push((near, cost));
                    } else {
                        now.push((near, cost));
                    }
                }
            }
            if later.is_empty() {
                return Answer::new(Outcome::NoPath, expansions);
            }
            std::mem::swap(now, later);
            bound = next;
        }
    }
}
