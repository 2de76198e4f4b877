//! A* from both ends.
//!
//! I. Pohl, "Bi-directional search", Machine Intelligence 6, 1971, with the front-to-end
//! heuristics of that paper and the stopping rule that a shortest path needs.
//!
//! Each side estimates the distance to the other end. The side whose best place has
//! the lower f is next; of equal ones the side that has expanded less, the start's
//! first. *Expansions*: places taken from either open list.

use std::cmp::Reverse;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::cost::{Cost, Exact, Guide, Heuristic, Octile, Open, Priority, Rank, TieBreaking};
use crate::grid::{Grid, NOWHERE, Neighbors, Place, directions};
use crate::nodes::Nodes;
use crate::search::{Answer, Limit, Outcome, Search};

/// Condition for the end of A* from both ends, `best` being the best path that both sides have met
/// on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Done {
    /// Neither side has a place left with f below `best`.
    Both,
    /// One side has none: a better path would have to be open on both. The same paths with about
    /// half of the expansions.
    Either,
}

#[derive(Debug)]
struct Side<C, R: Rank> {
    nodes: Nodes<C>,
    open: Open<R>,
    expansions: u64,
    insertion: u32,
}

impl<C: Cost, R: Rank> Default for Side<C, R> {
    fn default() -> Self {
        Self {
            nodes: Nodes::default(),
            open: Open::new(),
            expansions: 0,
            insertion: 0,
        }
    }
}

impl<C: Cost, R: Rank> Side<C, R> {
    fn begin<G: Guide<C, Rank = R>>(&mut self, grid: &Grid, start: Place, guide: &G) {
        self.nodes.begin(grid.places());
        self.open.clear();
        (self.expansions, self.insertion) = (0, 0);
        self.push(grid, start, C::default(), NOWHERE, guide);
    }

    fn push<G: Guide<C, Rank = R>>(
        &mut self,
        grid: &Grid,
        place: Place,
        cost: C,
        direction: u8,
        guide: &G,
    ) {
        self.nodes.open(place, cost, direction);
        let rank = guide.rank(grid, place, cost, self.insertion);
        self.insertion += 1;
        self.open.push(Reverse(rank));
    }

    /// The best place that is not closed.
    fn first(&mut self) -> Option<R> {
        loop {
            let Reverse(rank) = *self.open.peek()?;
            if !self.nodes.is_closed(rank.place()) {
                return Some(rank);
            }
            self.open.pop();
        }
    }
}

/// A* from both ends.
///
/// With a heuristic that does not overestimate, the path is a shortest one.
#[derive(Debug)]
pub struct BidirectionalAstar {
    heuristic: Option<Heuristic>,
    ties: TieBreaking,
    done: Done,
    whole: [Side<u32, u128>; 2],
    four: [Side<u32, Exact>; 2],
    eight: [Side<Octile, Exact>; 2],
}

impl BidirectionalAstar {
    /// With a heuristic, or else the one that is exact where nothing is in the way.
    pub fn new(heuristic: Option<Heuristic>, ties: TieBreaking, done: Done) -> Self {
        Self {
            heuristic,
            ties,
            done,
            whole: Default::default(),
            four: Default::default(),
            eight: Default::default(),
        }
    }
}

impl Search for BidirectionalAstar {
    fn search(
        &mut self,
        grid: &Grid,
        start: u32,
        goal: u32,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        let priority = Priority {
            heuristic: Heuristic::or_fitting(self.heuristic, grid),
            cost: true,
            weight: 1.0,
            ties: self.ties,
        };
        let ends = [grid.place(start), grid.place(goal)];
        // Each side is guided to the other's end.
        let targets = [ends[1], ends[0]];
        let whole = targets.map(|target| priority.whole(grid, target));
        match (grid.neighbors(), whole) {
            (Neighbors::Four, [Some(ahead), Some(behind)]) => run(
                grid,
                ends,
                [&ahead, &behind],
                self.done,
                &mut self.whole,
                limit,
                path,
            ),
            (neighbors, _) => {
                let [ahead, behind] = targets.map(|target| priority.exact(target));
                let guides = [&ahead, &behind];
                match neighbors {
                    Neighbors::Four => {
                        run(grid, ends, guides, self.done, &mut self.four, limit, path)
                    }
                    Neighbors::Eight => {
                        run(grid, ends, guides, self.done, &mut self.eight, limit, path)
                    }
                }
            }
        }
    }
}

/// The best path so far: its cost and the place where the sides meet.
type Meeting<C> = Option<(C, Place)>;

fn run<C: Cost, G: Guide<C>>(
    grid: &Grid,
    ends: [Place; 2],
    guides: [&G; 2],
    done: Done,
    sides: &mut [Side<C, G::Rank>; 2],
    limit: &mut Limit<'_>,
    path: &mut Vec<u32>,
) -> Answer {
    path.clear();
    if ends[0] == ends[1] {
        path.push(grid.cell(ends[0]));
        return Answer::new(Outcome::Found, 0);
    }
    for (index, side) in sides.iter_mut().enumerate() {
        side.begin(grid, ends[index], guides[index]);
    }
    let mut best: Meeting<C> = None;
    loop {
        let [ahead, behind] = sides;
        let expansions = ahead.expansions + behind.expansions;
        let (Some(first), Some(second)) = (ahead.first(), behind.first()) else {
            break;
        };
        if let Some((cost, _)) = best {
            let beyond = [(first, guides[0]), (second, guides[1])]
                .map(|(rank, guide)| !guide.before(rank, cost));
            let finished = match done {
                Done::Both => beyond[0] && beyond[1],
                Done::Either => beyond[0] || beyond[1],
            };
            if finished {
                break;
            }
        }
        if let Some(stop) = limit.reached(expansions) {
            return Answer::new(Outcome::Stopped(stop), expansions);
        }
        let forward = match first.priority().cmp(&second.priority()) {
            std::cmp::Ordering::Less => true,
            std::cmp::Ordering::Equal => ahead.expansions <= behind.expansions,
            std::cmp::Ordering::Greater => false,
        };
        if forward {
            expand(grid, ahead, behind, guides[0], Nodes::onward, &mut best);
        } else {
            expand(
                grid,
                behind,
                ahead,
                guides[1],
                Nodes::onward_back,
                &mut best,
            );
        }
    }
    let [ahead, behind] = sides;
    let expansions = ahead.expansions + behind.expansions;
    match best {
        Some((_, meeting)) => {
            ahead.nodes.trace(grid, meeting, path);
            path.pop();
            behind.nodes.walk(grid, meeting, path);
            Answer::new(Outcome::Found, expansions)
        }
        None => Answer::new(Outcome::NoPath, expansions),
    }
}

/// Expands the best place of a side.
fn expand<C: Cost, G: Guide<C>>(
    grid: &Grid,
    side: &mut Side<C, G::Rank>,
    other: &Side<C, G::Rank>,
    guide: &G,
    onward: impl Fn(&Nodes<C>, &Grid, Place) -> u8,
    best: &mut Meeting<C>,
) {
    let Some(Reverse(rank)) = side.open.pop() else {
        return;
    };
    let place = rank.place();
    side.nodes.close(place);
    side.expansions += 1;
    let so_far = side.nodes.known(place);
    for direction in directions(onward(&side.nodes, grid, place)) {
        let near = grid.step(place, direction);
        let cost = so_far.step(direction);
        if side.nodes.cost(near).is_some_and(|known| !cost.less(known)) {
            continue;
        }
        side.push(grid, near, cost, direction, guide);
        if let Some(rest) = other.nodes.cost(near) {
            let whole = cost.join(rest);
            if best.is_none_or(|(best, _)| whole.less(best)) {
                *best = Some((whole, near));
            }
        }
    }
}
