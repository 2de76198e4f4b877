//! Breadth-first search, from one end and from both.
//!
//! E. F. Moore, "The shortest path through a maze", International Symposium on the
//! Theory of Switching, 1959; from both ends: I. Pohl, "Bi-directional search",
//! Machine Intelligence 6, 1971.
//!
//! Paths have as few moves as possible, a diagonal one counting as much as a straight
//! one.

use crate::grid::{Grid, NOWHERE, Place, directions};
use crate::nodes::Nodes;
use crate::search::{Answer, Limit, Outcome, Search};

/// Places in the order in which they were found; those before `next` are expanded.
#[derive(Debug, Default)]
struct Wave {
    nodes: Nodes<u32>,
    found: Vec<Place>,
    next: usize,
}

impl Wave {
    fn begin(&mut self, grid: &Grid, start: Place) {
        self.nodes.begin(grid.places());
        self.found.clear();
        self.next = 0;
        self.nodes.open(start, 0, NOWHERE);
        self.found.push(start);
    }

    fn waiting(&self) -> usize {
        self.found.len() - self.next
    }

    fn take(&mut self) -> Option<Place> {
        let place = self.found.get(self.next).copied();
        self.next += usize::from(place.is_some());
        place
    }

    /// The moves to the next place, if there is one.
    fn depth(&self) -> Option<u32> {
        self.found
            .get(self.next)
            .map(|place| self.nodes.known(*place))
    }

    /// Finds a neighbour; false if it was found before.
    #[inline]
    fn find(&mut self, near: Place, moves: u32, direction: u8) -> bool {
        let is_new = self.nodes.cost(near).is_none();
        if is_new {
            self.nodes.open(near, moves, direction);
            self.found.push(near);
        }
        is_new
    }
}

/// Breadth-first search.
///
/// *Expansions*: places taken from the queue, the goal included.
#[derive(Debug, Default)]
pub struct Bfs {
    wave: Wave,
}

impl Search for Bfs {
    fn search(
        &mut self,
        grid: &Grid,
        start: u32,
        goal: u32,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        path.clear();
        let goal = grid.place(goal);
        let wave = &mut self.wave;
        wave.begin(grid, grid.place(start));
        let mut expansions = 0;
        while let Some(place) = wave.take() {
            if let Some(stop) = limit.reached(expansions) {
                return Answer::new(Outcome::Stopped(stop), expansions);
            }
            expansions += 1;
            if place == goal {
                wave.nodes.trace(grid, goal, path);
                return Answer::new(Outcome::Found, expansions);
            }
            let moves = wave.nodes.known(place) + 1;
            for direction in directions(wave.nodes.onward(grid, place)) {
                wave.find(grid.step(place, direction), moves, direction);
            }
        }
        Answer::new(Outcome::NoPath, expansions)
    }
}

/// Breadth-first search from both ends, a layer at a time.
///
/// The smaller of the two layers is next; of equal ones the start's in odd rounds and
/// the goal's in even ones. The search ends when the two next layers together are no
/// nearer than the best meeting. *Expansions*: places taken from either queue; a layer
/// is always finished.
#[derive(Debug, Default)]
pub struct BidirectionalBfs {
    waves: [Wave; 2],
}

impl Search for BidirectionalBfs {
    fn search(
        &mut self,
        grid: &Grid,
        start: u32,
        goal: u32,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        path.clear();
        if start == goal {
            path.push(start);
            return Answer::new(Outcome::Found, 0);
        }
        let [from_start, from_goal] = &mut self.waves;
        from_start.begin(grid, grid.place(start));
        from_goal.begin(grid, grid.place(goal));
        let mut expansions = 0;
        let mut best: Option<(u32, Place)> = None;
        let mut odd = true;
        while let (Some(ahead), Some(behind)) = (from_start.depth(), from_goal.depth()) {
            if let Some((moves, meeting)) = best
                && ahead + behind >= moves
            {
                from_start.nodes.trace(grid, meeting, path);
                path.pop();
                from_goal.nodes.walk(grid, meeting, path);
                return Answer::new(Outcome::Found, expansions);
            }
            let forward = match from_start.waiting().cmp(&from_goal.waiting()) {
                std::cmp::Ordering::Less => true,
                std::cmp::Ordering::Equal => odd,
                std::cmp::Ordering::Greater => false,
            };
            odd = !odd;
            let (wave, other) = if forward {
                (&mut *from_start, &*from_goal)
            } else {
                (&mut *from_goal, &*from_start)
            };
            let layer = wave.found.len();
            while wave.next < layer {
                if let Some(stop) = limit.reached(expansions) {
                    return Answer::new(Outcome::Stopped(stop), expansions);
                }
                let Some(place) = wave.take() else { break };
                expansions += 1;
                let moves = wave.nodes.known(place) + 1;
                let onward = if forward {
                    wave.nodes.onward(grid, place)
                } else {
                    wave.nodes.onward_back(grid, place)
                };
                for direction in directions(onward) {
                    let near = grid.step(place, direction);
                    if wave.find(near, moves, direction)
                        && let Some(rest) = other.nodes.cost(near)
                        && best.is_none_or(|(best, at)| (moves + rest, near) < (best, at))
                    {
                        best = Some((moves + rest, near));
                    }
                }
            }
        }
        match best {
            // One side has nothing left to expand, and every path has been met.
            Some((_, meeting)) => {
                from_start.nodes.trace(grid, meeting, path);
                path.pop();
                from_goal.nodes.walk(grid, meeting, path);
                Answer::new(Outcome::Found, expansions)
            }
            None => Answer::new(Outcome::NoPath, expansions),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Neighbors;

    #[test]
    fn both_ends_meet_next_to_each_other() {
        let grid = Grid::new(1, 2, &[true; 2], Neighbors::Four).expect("a grid");
        let mut path = Vec::new();
        let answer = BidirectionalBfs::default().search(&grid, 0, 1, &mut Limit::none(), &mut path);
        assert_eq!(answer.outcome, Outcome::Found);
        assert_eq!(path, [0, 1]);
    }
}
