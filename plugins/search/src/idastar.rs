//! IDA*: depth-first searches under a rising bound on f.
//!
//! R. E. Korf, "Depth-first iterative-deepening: an optimal admissible tree search",
//! Artificial Intelligence 27, 1985.
//!
//! Neighbours are visited in the order of their estimate, then row by row. The next
//! bound is the least f that exceeded this one. *Expansions*: places whose neighbours
//! were looked at, in all rounds together; the goal is not one of them.
//!
//! On a grid many paths lead to a place, and a search that remembers nothing but the
//! path it is on visits it along each: exponentially many in the open. [`Memory`] says
//! what is remembered. In a maze without loops there is one path to each place, and all
//! variants expand the same.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::cost::{Cost, Heuristic, Octile};
use crate::grid::{Grid, NOWHERE, Neighbors, Place, directions};
use crate::nodes::Nodes;
use crate::search::{Answer, Limit, Outcome, Search, Stop};

/// The part of a round that IDA* remembers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Memory {
    /// The path that it is on, as in Korf's paper: exponentially slow in the open.
    Path,
    /// The least cost at which each place was reached in this round: it is visited
    /// again only at a lower one.
    Costs,
}

/// IDA*. With a heuristic that does not overestimate, the path is a shortest one.
#[derive(Debug)]
pub struct IdaStar {
    heuristic: Option<Heuristic>,
    memory: Memory,
    four: Frames<u32>,
    eight: Frames<Octile>,
}

impl IdaStar {
    /// With a heuristic, or else the one that is exact where nothing is in the way.
    pub fn new(heuristic: Option<Heuristic>, memory: Memory) -> Self {
        Self {
            heuristic,
            memory,
            four: Frames::default(),
            eight: Frames::default(),
        }
    }
}

impl Search for IdaStar {
    fn search(
        &mut self,
        grid: &Grid,
        start: u32,
        goal: u32,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        let heuristic = Heuristic::or_fitting(self.heuristic, grid);
        let (start, goal) = (grid.place(start), grid.place(goal));
        path.clear();
        match grid.neighbors() {
            Neighbors::Four => {
                let round = Round::new(grid, goal, heuristic, self.memory, &mut self.four, limit);
                round.run(start, path)
            }
            Neighbors::Eight => {
                let round = Round::new(grid, goal, heuristic, self.memory, &mut self.eight, limit);
                round.run(start, path)
            }
        }
    }
}

/// A place on the path, and the directions that have not been tried there, first to be
/// tried last.
#[derive(Debug, Clone, Copy)]
struct Frame {
    place: Place,
    untried: [u8; 8],
    count: u8,
}

#[derive(Debug, Default)]
struct Frames<C> {
    stack: Vec<Frame>,
    nodes: Nodes<C>,
}

/// Result of the visit to a place.
enum Visit {
    Goal,
    /// Its neighbours are next.
    Expanded,
    Cut,
}

struct Round<'r, 'l, C> {
    grid: &'r Grid,
    goal: Place,
    heuristic: Heuristic,
    memory: Memory,
    frames: &'r mut Frames<C>,
    limit: &'r mut Limit<'l>,
    expansions: u64,
    bound: f64,
    /// The least f that exceeded the bound.
    next: f64,
}

impl<'r, 'l, C: Cost> Round<'r, 'l, C> {
    fn new(
        grid: &'r Grid,
        goal: Place,
        heuristic: Heuristic,
        memory: Memory,
        frames: &'r mut Frames<C>,
        limit: &'r mut Limit<'l>,
    ) -> Self {
        Self {
            grid,
            goal,
            heuristic,
            memory,
            frames,
            limit,
            expansions: 0,
            bound: 0.0,
            next: f64::INFINITY,
        }
    }

    fn left(&self, place: Place) -> f64 {
        self.heuristic.value(self.grid.apart(place, self.goal))
    }

    fn run(mut self, start: Place, path: &mut Vec<u32>) -> Answer {
        self.bound = self.left(start);
        loop {
            match self.round(start, path) {
                Err(stop) => return Answer::new(Outcome::Stopped(stop), self.expansions),
                Ok(true) => return Answer::new(Outcome::Found, self.expansions),
                Ok(false) if self.next.is_infinite() => {
                    return Answer::new(Outcome::NoPath, self.expansions);
                }
                Ok(false) => self.bound = self.next,
            }
        }
    }

    /// One search under the bound: whether it found the goal.
    fn round(&mut self, start: Place, path: &mut Vec<u32>) -> Result<bool, Stop> {
        self.next = f64::INFINITY;
        self.frames.stack.clear();
        self.frames.nodes.begin(self.grid.places());
        let mut visit = self.visit(start, C::default(), NOWHERE)?;
        loop {
            if let Visit::Goal = visit {
                path.clear();
                path.extend(self.frames.stack.iter().map(|at| self.grid.cell(at.place)));
                path.push(self.grid.cell(self.goal));
                return Ok(true);
            }
            let Some(frame) = self.frames.stack.last_mut() else {
                return Ok(false);
            };
            let place = frame.place;
            if frame.count == 0 {
                self.frames.stack.pop();
                // Closed is who is not on the path.
                self.frames.nodes.close(place);
                continue;
            }
            frame.count -= 1;
            let direction = frame.untried[usize::from(frame.count)];
            let near = self.grid.step(place, direction);
            let cost = self.frames.nodes.known(place).step(direction);
            visit = match self.frames.nodes.cost(near) {
                Some(known) if !self.again(near, cost, known) => Visit::Cut,
                _ => self.visit(near, cost, direction)?,
            };
        }
    }

    /// True if a place that was seen in this round is visited again.
    fn again(&self, place: Place, cost: C, known: C) -> bool {
        match self.memory {
            Memory::Path => self.frames.nodes.is_closed(place),
            Memory::Costs => cost.less(known),
        }
    }

    fn visit(&mut self, place: Place, cost: C, direction: u8) -> Result<Visit, Stop> {
        let f = cost.value() + self.left(place);
        if f > self.bound {
            self.next = self.next.min(f);
            return Ok(Visit::Cut);
        }
        if place == self.goal {
            return Ok(Visit::Goal);
        }
        if let Some(stop) = self.limit.reached(self.expansions) {
            return Err(stop);
        }
        self.expansions += 1;
        self.frames.nodes.open(place, cost, direction);
        // The way back is on the path.
        let onward = self.frames.nodes.onward(self.grid, place);
        let mut ranked = [(f64::INFINITY, u32::MAX, 0_u8); 8];
        let mut count = 0;
        for direction in directions(onward) {
            let near = self.grid.step(place, direction);
            let rank = (self.left(near), near, direction);
            let mut at = count;
            while at > 0 && (ranked[at - 1].0, ranked[at - 1].1) < (rank.0, rank.1) {
                ranked[at] = ranked[at - 1];
                at -= 1;
            }
            ranked[at] = rank;
            count += 1;
        }
        self.frames.stack.push(Frame {
            place,
            untried: ranked.map(|(_, _, direction)| direction),
            count: count as u8,
        });
        Ok(Visit::Expanded)
    }
}
