//! LPA* and D* Lite: shortest paths on a map that changes.
//!
//! - S. Koenig, M. Likhachev, D. Furcy, "Lifelong planning A*", Artificial Intelligence
//!   155, 2004 (Koenig, Likhachev, "Incremental A*", NIPS 2001).
//! - S. Koenig, M. Likhachev, "D* Lite", AAAI 2002.
//!
//! Both keep for every place its cost g and what its neighbours make of it, rhs = min
//! (g' + 1), and expand the places where the two differ until they agree wherever it
//! matters. After a change few do not agree. They are the same algorithm: LPA* searches
//! from the start, and D* Lite from the goal, so that the start may move on while costs
//! stay what they are; what the priorities owe to the place where the robot was before
//! is added to all later ones (k_m).
//!
//! Priorities are (min(g, rhs) + h + k_m, min(g, rhs)), then the order in which places
//! were put in. The heuristic h is the one that is exact where nothing is in the way, so
//! that all of it is counts of moves and priorities that are equal are so to the last
//! bit: sums of rounded numbers would end a search before the cost of a cell that was
//! blocked is forgotten. *Expansions*: places taken from the open list at their right priority,
//! whether their cost falls (overconsistent) or becomes unknown (underconsistent); the
//! target is expanded too if nothing else with its priority ends the search before.

use std::cmp::Reverse;

use crate::cost::{Cost, Exact, Octile, Open, Rank};
use crate::grid::{Grid, Neighbors, Place, directions, opposite};
use crate::search::{Answer, Limit, Outcome, Search, Stop};
use crate::slate::Slate;

/// The end from which the search starts.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// From the start. When the start moves, everything begins anew.
    LpaStar,
    /// From the goal. The start may move.
    DStarLite,
}

#[derive(Debug, Clone, Copy)]
struct Node<C> {
    g: C,
    rhs: C,
    /// The number of its entry in the open list, 0 if it has none.
    entry: u32,
}

impl<C: Cost> Default for Node<C> {
    fn default() -> Self {
        Self {
            g: C::FAR,
            rhs: C::FAR,
            entry: 0,
        }
    }
}

/// The search tree from one end of the path, on the way to the other.
#[derive(Debug)]
struct Tree<C> {
    nodes: Slate<Node<C>>,
    open: Open<Exact>,
    entries: u32,
    root: Place,
    target: Place,
    /// The root is the goal: costs are those of ways to it.
    backwards: bool,
    /// k_m.
    moved: C,
}

impl<C: Cost> Default for Tree<C> {
    fn default() -> Self {
        Self {
            nodes: Slate::default(),
            open: Open::new(),
            entries: 0,
            root: 0,
            target: 0,
            backwards: false,
            moved: C::default(),
        }
    }
}

/// One more move, if there is a path at all.
#[inline]
fn further<C: Cost>(cost: C, direction: u8) -> C {
    if cost == C::FAR {
        cost
    } else {
        cost.step(direction)
    }
}

impl<C: Cost> Tree<C> {
    fn begin(&mut self, grid: &Grid, [root, target]: [Place; 2], method: Method) {
        self.nodes.begin(grid.places());
        self.open.clear();
        (self.entries, self.moved) = (0, C::default());
        (self.root, self.target) = (root, target);
        self.backwards = method == Method::DStarLite;
        self.nodes.entry(root).rhs = C::default();
        self.update(grid, root);
    }

    /// The priority of a place: two numbers that are compared one after the other.
    fn key(&self, grid: &Grid, place: Place, node: Node<C>) -> (u64, u64) {
        let least = if node.g.less(node.rhs) {
            node.g
        } else {
            node.rhs
        };
        if least == C::FAR {
            return (f64::INFINITY.to_bits(), f64::INFINITY.to_bits());
        }
        let left = C::estimate(grid.apart(place, self.target));
        let all = least.join(left).join(self.moved);
        (all.value().to_bits(), least.value().to_bits())
    }

    /// Puts a place in the open list, or takes it out, as its costs say.
    fn update(&mut self, grid: &Grid, place: Place) {
        let node = *self.nodes.entry(place);
        let entry = if node.g == node.rhs {
            0
        } else {
            self.entries = self.entries.wrapping_add(1).max(1);
            let (first, second) = self.key(grid, place, node);
            let last = u64::from(self.entries) << 32 | u64::from(place);
            self.open.push(Reverse((first, second, last)));
            self.entries
        };
        self.nodes.entry(place).entry = entry;
    }

    /// The directions of the neighbours whose costs make that of a place.
    fn before(&self, grid: &Grid, place: Place) -> u8 {
        if self.backwards {
            grid.exits(place)
        } else {
            grid.entries(place)
        }
    }

    /// The directions of the neighbours whose costs a place makes.
    fn after(&self, grid: &Grid, place: Place) -> u8 {
        if self.backwards {
            grid.entries(place)
        } else {
            grid.exits(place)
        }
    }

    /// Computes `rhs` of a place from its neighbours.
    fn look_around(&mut self, grid: &Grid, place: Place) {
        if place == self.root {
            return;
        }
        let mut best = C::FAR;
        for direction in directions(self.before(grid, place)) {
            let near = grid.step(place, direction);
            let g = self.nodes.get(near).unwrap_or_default().g;
            let cost = further(g, direction);
            if cost.less(best) {
                best = cost;
            }
        }
        self.nodes.entry(place).rhs = best;
    }

    /// The first entry that is still true.
    fn first(&mut self) -> Option<Exact> {
        loop {
            let Reverse(rank) = *self.open.peek()?;
            let entry = (rank.2 >> 32) as u32;
            if self.nodes.entry(rank.place()).entry == entry {
                return Some(rank);
            }
            self.open.pop();
        }
    }

    /// Makes costs right as far as the way to the target needs them.
    fn settle(&mut self, grid: &Grid, limit: &mut Limit<'_>) -> (Option<Stop>, u64) {
        let mut expansions = 0;
        while let Some(rank) = self.first() {
            let target = *self.nodes.entry(self.target);
            let key = (rank.0, rank.1);
            if key >= self.key(grid, self.target, target) && target.g == target.rhs {
                break;
            }
            if let Some(stop) = limit.reached(expansions) {
                return (Some(stop), expansions);
            }
            self.open.pop();
            let place = rank.place();
            let node = self.nodes.entry(place);
            node.entry = 0;
            let node = *node;
            if key < self.key(grid, place, node) {
                self.update(grid, place);
                continue;
            }
            expansions += 1;
            if node.rhs.less(node.g) {
                self.nodes.entry(place).g = node.rhs;
                for direction in directions(self.after(grid, place)) {
                    let near = grid.step(place, direction);
                    let cost = further(node.rhs, direction);
                    let other = self.nodes.entry(near);
                    if near != self.root && cost.less(other.rhs) {
                        other.rhs = cost;
                        self.update(grid, near);
                    }
                }
            } else {
                self.nodes.entry(place).g = C::FAR;
                self.look_around(grid, place);
                self.update(grid, place);
                for direction in directions(self.after(grid, place)) {
                    let near = grid.step(place, direction);
                    // Only those are concerned who came from here.
                    if self.nodes.entry(near).rhs == further(node.g, direction) {
                        self.look_around(grid, near);
                        self.update(grid, near);
                    }
                }
            }
        }
        (None, expansions)
    }

    /// Places have other neighbours now.
    fn changed(&mut self, grid: &Grid, places: &[Place]) {
        for place in places {
            self.look_around(grid, *place);
            if !grid.free_at(*place) {
                // Nobody asks for the cost of a blocked cell: nothing is to be expanded.
                let node = self.nodes.entry(*place);
                node.g = node.rhs;
            }
            self.update(grid, *place);
        }
    }

    /// The target is elsewhere now.
    fn retarget(&mut self, grid: &Grid, target: Place) {
        let moved = C::estimate(grid.apart(self.target, target));
        self.moved = self.moved.join(moved);
        self.target = target;
    }

    /// The cells from the target back to the root.
    fn walk(&mut self, grid: &Grid, path: &mut Vec<u32>) {
        let mut place = self.target;
        path.push(grid.cell(place));
        while place != self.root {
            let mut best = (C::FAR, place);
            for direction in directions(self.before(grid, place)) {
                let near = grid.step(place, direction);
                let g = self.nodes.get(near).unwrap_or_default().g;
                let cost = further(g, opposite(direction));
                if cost.less(best.0) {
                    best = (cost, near);
                }
            }
            place = best.1;
            path.push(grid.cell(place));
        }
    }

    fn solve(
        &mut self,
        grid: &Grid,
        from_start: bool,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        path.clear();
        let (stopped, expansions) = self.settle(grid, limit);
        let outcome = match stopped {
            Some(stop) => Outcome::Stopped(stop),
            None if self.nodes.entry(self.target).g == C::FAR => Outcome::NoPath,
            None => {
                self.walk(grid, path);
                if from_start {
                    path.reverse();
                }
                Outcome::Found
            }
        };
        Answer::new(outcome, expansions)
    }
}

#[derive(Debug, Default)]
struct Trees {
    four: Tree<u32>,
    eight: Tree<Octile>,
}

/// LPA* or D* Lite behind a call: once per call, or with what the last call left.
#[derive(Debug)]
pub struct Incremental {
    method: Method,
    trees: Trees,
    /// True if trees are kept from call to call; then the robot of the last one.
    keeps: bool,
    kept: Option<Replanner>,
}

impl Incremental {
    /// One of the two, which begins anew in each call.
    pub fn new(method: Method) -> Self {
        Self {
            method,
            trees: Trees::default(),
            keeps: false,
            kept: None,
        }
    }

    /// The same with a tree that stays from call to call, and is repaired where the map has changed or the robot has
    /// moved. Another root (the goal of D* Lite, the start of LPA*) or a map of another size begins anew. Of several
    /// shortest paths earlier calls decide which is found.
    #[must_use]
    pub fn keeping(self) -> Self {
        Self {
            keeps: true,
            ..self
        }
    }
}

impl Method {
    /// Root and target of the search.
    fn ends(self, start: Place, goal: Place) -> [Place; 2] {
        match self {
            Self::LpaStar => [start, goal],
            Self::DStarLite => [goal, start],
        }
    }
}

impl Search for Incremental {
    fn search(
        &mut self,
        grid: &Grid,
        start: u32,
        goal: u32,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer {
        if self.keeps {
            let known = self.kept.take().filter(|known| known.goal == goal);
            let again = known.and_then(|mut known| {
                known.set_free(grid.changes_from(&known.grid)?);
                known.move_to(start);
                Some(known)
            });
            let robot = again.or_else(|| Replanner::new(self.method, grid.clone(), start, goal));
            self.kept = robot;
            return match &mut self.kept {
                Some(robot) => robot.plan(limit, path),
                None => Answer::new(Outcome::NoPath, 0),
            };
        }
        let ends = self.method.ends(grid.place(start), grid.place(goal));
        let from_start = self.method == Method::LpaStar;
        match grid.neighbors() {
            Neighbors::Four => {
                let tree = &mut self.trees.four;
                tree.begin(grid, ends, self.method);
                tree.solve(grid, from_start, limit, path)
            }
            Neighbors::Eight => {
                let tree = &mut self.trees.eight;
                tree.begin(grid, ends, self.method);
                tree.solve(grid, from_start, limit, path)
            }
        }
    }
}

/// A robot on a map that changes: paths are found anew with what is known from before.
///
/// ```
/// use fleetyard_plugin_search::{Grid, Limit, Method, Neighbors, Outcome, Replanner};
///
/// let grid = Grid::new(3, 3, &[true; 9], Neighbors::Four).expect("nine cells");
/// let mut robot = Replanner::new(Method::DStarLite, grid, 0, 8).expect("two cells");
/// let mut path = Vec::new();
/// robot.plan(&mut Limit::none(), &mut path);
/// assert_eq!(path.len(), 5);
/// robot.move_to(path[1]);
/// robot.set_free([(path[2], false)]);
/// let answer = robot.plan(&mut Limit::none(), &mut path);
/// assert_eq!(answer.outcome, Outcome::Found);
/// ```
#[derive(Debug)]
pub struct Replanner {
    method: Method,
    grid: Grid,
    start: u32,
    goal: u32,
    trees: Trees,
}

impl Replanner {
    /// For a robot in the cell `start` that has to get to `goal`; `None` if one of them
    /// is not on the map.
    pub fn new(method: Method, grid: Grid, start: u32, goal: u32) -> Option<Self> {
        let cells = grid.rows() * grid.cols();
        let mut made = Self {
            method,
            grid,
            start,
            goal,
            trees: Trees::default(),
        };
        (start < cells && goal < cells).then(|| {
            made.begin();
            made
        })
    }

    /// The map as it is now.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    fn begin(&mut self) {
        let (start, goal) = (self.grid.place(self.start), self.grid.place(self.goal));
        let ends = self.method.ends(start, goal);
        match self.grid.neighbors() {
            Neighbors::Four => self.trees.four.begin(&self.grid, ends, self.method),
            Neighbors::Eight => self.trees.eight.begin(&self.grid, ends, self.method),
        }
    }

    /// Blocks or frees cells; nothing happens off the map. To say all changes at once
    /// is less work than one after the other.
    pub fn set_free(&mut self, changes: impl IntoIterator<Item = (u32, bool)>) {
        let mut places = Vec::new();
        for (cell, free) in changes {
            if self.grid.set_free(cell, free) {
                let place = self.grid.place(cell);
                places.push(place);
                places.extend((0..8).map(|direction| self.grid.step(place, direction)));
            }
        }
        places.sort_unstable();
        places.dedup();
        match self.grid.neighbors() {
            Neighbors::Four => self.trees.four.changed(&self.grid, &places),
            Neighbors::Eight => self.trees.eight.changed(&self.grid, &places),
        }
    }

    /// The robot is in another cell now; nothing happens off the map.
    pub fn move_to(&mut self, cell: u32) {
        if cell >= self.grid.rows() * self.grid.cols() || cell == self.start {
            return;
        }
        self.start = cell;
        let place = self.grid.place(cell);
        match (self.method, self.grid.neighbors()) {
            (Method::LpaStar, _) => self.begin(),
            (Method::DStarLite, Neighbors::Four) => self.trees.four.retarget(&self.grid, place),
            (Method::DStarLite, Neighbors::Eight) => self.trees.eight.retarget(&self.grid, place),
        }
    }

    /// Finds a shortest path, and leaves its cells in `path`. The expansions are those
    /// of this call. A search that was stopped goes on when it is called again.
    pub fn plan(&mut self, limit: &mut Limit<'_>, path: &mut Vec<u32>) -> Answer {
        path.clear();
        if !self.grid.is_free(self.start) || !self.grid.is_free(self.goal) {
            return Answer::new(Outcome::NoPath, 0);
        }
        let from_start = self.method == Method::LpaStar;
        match self.grid.neighbors() {
            Neighbors::Four => self.trees.four.solve(&self.grid, from_start, limit, path),
            Neighbors::Eight => self.trees.eight.solve(&self.grid, from_start, limit, path),
        }
    }
}
