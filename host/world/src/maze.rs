//! Perfect mazes: exactly one simple way between any two cells.
//!
//! The algorithms are those of the deterministic grid-maze benchmark for planners
//! (Contreras 2026): depth-first search with an explicit stack (the recursive
//! backtracker), and randomised Prim with a list of frontier edges. On
//! [`MazeRandom::Python`] the mazes are the benchmark's own, cell by cell; on
//! [`MazeRandom::ChaCha`], the project's own random numbers, a seed gives another maze.
//!
//! # Contract
//!
//! A [`Maze`] is a spanning tree of its cells as it is carved. So every cell can be reached
//! from every other one, whatever start and goal are, and the shortest way is the only
//! one that visits no cell twice, until [`Maze::open_loops`] opens others.

use std::collections::VecDeque;
use std::sync::Arc;

use fleetyard_core::{Connectivity, Grid, GridInstance, InputError, words};
use serde::{Deserialize, Serialize};

use crate::canvas::{Canvas, at_least, cells, check_size, one};
use crate::{PythonRandom, SeededRandom};

/// The algorithm that carves a maze.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Hash)]
pub enum MazeAlgorithm {
    /// Depth-first: long winding corridors. The next cell is uniform among the
    /// neighbours that were not visited yet.
    #[default]
    Backtracker,
    /// Randomised Prim: many short dead ends. The next edge is uniform among those
    /// that led out of the maze when their first cell joined it; edges whose other
    /// cell has joined since are drawn and dropped.
    Prim,
}

words!(MazeAlgorithm {
    Backtracker = "backtracker", "Depth-first: long winding corridors";
    Prim = "prim", "Randomised Prim: many short dead ends";
});

/// The source of a maze's random numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MazeRandom {
    /// Those of this project's other generators ([`SeededRandom`]).
    #[default]
    ChaCha,
    /// Those of Python's `random` ([`PythonRandom`]): the mazes of the benchmark.
    Python,
}

words!(MazeRandom {
    ChaCha = "chacha", "Those of this program's other generators";
    Python = "python", "Those of Python's random module: the mazes of the grid-maze benchmark";
});

/// The rule by which the seeds of a series of mazes follow from one base seed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum MazeSeeds {
    /// base, base + 1, base + 2, …: the planner benchmark, with base 7.
    #[default]
    Benchmark,
    /// base + 2e − 1 for the episodes e = 1, 2, …: the episode runtime, where the
    /// runtime and its generator each add the episode's number.
    Episodes,
}

words!(MazeSeeds {
    Benchmark = "benchmark", "base, base + 1, base + 2, …: the planner benchmark";
    Episodes = "episodes", "base + 2e − 1 for the episodes e = 1, 2, …: the episode runtime";
});

impl MazeSeeds {
    /// The seed of the maze with a number, counted from 0 (episode e has number
    /// e − 1); nothing if it would be more than a seed can be.
    pub fn seed(self, base: u64, index: u64) -> Option<u64> {
        match self {
            Self::Benchmark => base.checked_add(index),
            Self::Episodes => base.checked_add(index.checked_mul(2)?.checked_add(1)?),
        }
    }
}

/// A maze of cells with walls between them, before it is drawn on a grid.
///
/// Cell (x, y) has index `y * width + x`; x grows right and y grows down.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Maze {
    width: u32,
    height: u32,
    /// Per cell, [`EAST`] and [`SOUTH`] if the wall there is open.
    open: Vec<u8>,
}

const EAST: u8 = 1;
const SOUTH: u8 = 2;

impl Maze {
    /// Carves a maze of at least one cell, beginning at cell (0, 0).
    pub fn carve(
        width: u32,
        height: u32,
        algorithm: MazeAlgorithm,
        random: MazeRandom,
        seed: u64,
    ) -> Result<Self, InputError> {
        at_least("width", width, 1)?;
        at_least("height", height, 1)?;
        check_size(lattice_size(height), lattice_size(width))?;
        let mut maze = Self {
            width,
            height,
            open: vec![0; width as usize * height as usize],
        };
        let mut draws = match random {
            MazeRandom::ChaCha => Draws::ChaCha(Box::new(SeededRandom::new("map maze", seed))),
            MazeRandom::Python => Draws::Python(Box::new(PythonRandom::new(seed))),
        };
        match algorithm {
            MazeAlgorithm::Backtracker => maze.backtracker(&mut draws),
            MazeAlgorithm::Prim => maze.prim(&mut draws),
        }
        Ok(maze)
    }

    /// Cells from west to east.
    pub fn width(&self) -> u32 {
        self.width
    }

    /// Cells from north to south.
    pub fn height(&self) -> u32 {
        self.height
    }

    /// Number of cells.
    pub fn cell_count(&self) -> u32 {
        self.width * self.height
    }

    /// The cell at a position, if it is in the maze.
    pub fn cell(&self, x: u32, y: u32) -> Option<u32> {
        (x < self.width && y < self.height).then(|| y * self.width + x)
    }

    /// Column x and row y of a cell.
    pub fn position(&self, cell: u32) -> (u32, u32) {
        (cell % self.width, cell / self.width)
    }

    /// The benchmark's start: (0, 0).
    pub fn start(&self) -> u32 {
        0
    }

    /// The benchmark's goal: (width / 2, height / 2), rounded down.
    pub fn goal(&self) -> u32 {
        self.height / 2 * self.width + self.width / 2
    }

    /// True if there is no wall between two cells that are neighbours.
    pub fn passage(&self, a: u32, b: u32) -> bool {
        self.wall(a, b)
            .is_some_and(|(cell, side)| self.open[cell as usize] & side != 0)
    }

    /// The cells beyond the open walls of a cell, in the order north, east, south, west.
    pub fn neighbors(&self, cell: u32) -> impl Iterator<Item = u32> {
        self.adjacent(cell)
            .filter(move |to| self.passage(cell, *to))
    }

    /// The cells of the shortest way, both ends included; nothing if an end is not
    /// in the maze.
    pub fn shortest_path(&self, from: u32, to: u32) -> Option<Vec<u32>> {
        if from.max(to) >= self.cell_count() {
            return None;
        }
        // Backwards, so that the way comes out in its order.
        let mut next = vec![u32::MAX; self.open.len()];
        next[to as usize] = to;
        let mut queue = VecDeque::from([to]);
        while let Some(cell) = queue.pop_front() {
            if cell == from {
                break;
            }
            for before in self.neighbors(cell) {
                if next[before as usize] == u32::MAX {
                    next[before as usize] = cell;
                    queue.push_back(before);
                }
            }
        }
        let mut path = vec![from];
        let mut cell = from;
        while cell != to {
            cell = next[cell as usize];
            path.push(cell);
        }
        Some(path)
    }

    /// Place of a cell on the lattice, as row and column: φ(x, y) = (2y + 1, 2x + 1), the
    /// benchmark's equation 2.
    pub fn on_lattice(&self, cell: u32) -> (u32, u32) {
        let (x, y) = self.position(cell);
        (2 * y + 1, 2 * x + 1)
    }

    /// The occupancy lattice of equation 1: (2H + 1) × (2W + 1) cells, of which the
    /// maze's cells and its passages are free.
    pub fn lattice(&self, name: impl Into<String>) -> Result<Grid, InputError> {
        self.draw(lattice_size(self.height), lattice_size(self.width), 1, name)
    }

    /// Corridors of a width on a map of `rows` and `cols`, cut where it ends.
    fn draw(
        &self,
        rows: u32,
        cols: u32,
        corridor: u32,
        name: impl Into<String>,
    ) -> Result<Grid, InputError> {
        let mut canvas = Canvas::new(rows, cols, b'@')?;
        let pitch = corridor.saturating_add(1);
        for cell in 0..self.cell_count() {
            let (x, y) = self.position(cell);
            let (row, col) = (y * pitch + 1, x * pitch + 1);
            let open = self.open[cell as usize];
            let across = corridor.saturating_add(u32::from(open & EAST != 0));
            let down = corridor.saturating_add(u32::from(open & SOUTH != 0));
            canvas.fill(row, col, corridor, across, b'.');
            canvas.fill(row, col, down, corridor, b'.');
        }
        canvas.grid(name.into())
    }

    /// The wall between two neighbours: the cell that has it at its east or south.
    fn wall(&self, a: u32, b: u32) -> Option<(u32, u8)> {
        let (first, second) = (a.min(b), a.max(b));
        if second >= self.cell_count() {
            return None;
        }
        let ((x, y), to) = (self.position(first), self.position(second));
        match to {
            _ if to == (x + 1, y) => Some((first, EAST)),
            _ if to == (x, y + 1) => Some((first, SOUTH)),
            _ => None,
        }
    }

    fn open_wall(&mut self, a: u32, b: u32) {
        if let Some((cell, side)) = self.wall(a, b) {
            self.open[cell as usize] |= side;
        }
    }

    /// Opens so many of the walls that are left, any equally likely, or all if there are fewer: it has that many loops then,
    /// and is no tree any more. Walls and seed decide; the numbers are this project's own.
    pub fn open_loops(&mut self, loops: u32, seed: u64) {
        let cells = 0..self.cell_count();
        let mut walls: Vec<(u32, u32)> = cells
            .flat_map(|cell| self.adjacent(cell).map(move |to| (cell, to)))
            .filter(|(cell, to)| cell < to && !self.passage(*cell, *to))
            .collect();
        SeededRandom::new("map maze loops", seed).shuffle(&mut walls);
        for (cell, to) in walls.into_iter().take(loops as usize) {
            self.open_wall(cell, to);
        }
    }

    /// Neighbours, walls or not, in the order north, east, south, west.
    fn adjacent(&self, cell: u32) -> impl Iterator<Item = u32> + use<> {
        let (x, y) = self.position(cell);
        [
            (y > 0).then(|| cell - self.width),
            (x + 1 < self.width).then(|| cell + 1),
            (y + 1 < self.height).then(|| cell + self.width),
            (x > 0).then(|| cell - 1),
        ]
        .into_iter()
        .flatten()
    }

    fn backtracker(&mut self, draws: &mut Draws) {
        let mut visited = vec![false; self.open.len()];
        let mut stack = vec![0];
        visited[0] = true;
        while let Some(cell) = stack.last().copied() {
            let closed: Vec<u32> = self
                .adjacent(cell)
                .filter(|to| !visited[*to as usize])
                .collect();
            if closed.is_empty() {
                stack.pop();
                continue;
            }
            let to = closed[draws.below(closed.len())];
            visited[to as usize] = true;
            self.open_wall(cell, to);
            stack.push(to);
        }
    }

    fn prim(&mut self, draws: &mut Draws) {
        let mut visited = vec![false; self.open.len()];
        // Edges, with a target as often as it has visited neighbours.
        let mut frontier = draws.frontier();
        self.adjacent(0).for_each(|to| frontier.push((0, to)));
        visited[0] = true;
        while frontier.len() > 0 {
            let (from, to) = frontier.take(draws.below(frontier.len()));
            if std::mem::replace(&mut visited[to as usize], true) {
                continue;
            }
            self.open_wall(from, to);
            self.adjacent(to)
                .filter(|next| !visited[*next as usize])
                .for_each(|next| frontier.push((to, next)));
        }
    }
}

/// Rows or columns of the lattice of so many maze cells.
fn lattice_size(cells: u32) -> u32 {
    cells.saturating_mul(2).saturating_add(1)
}

/// Random choices while a maze is carved.
enum Draws {
    ChaCha(Box<SeededRandom>),
    Python(Box<PythonRandom>),
}

impl Draws {
    fn below(&mut self, bound: usize) -> usize {
        match self {
            Self::ChaCha(random) => random.below(bound),
            Self::Python(random) => random.below(bound),
        }
    }

    /// The list from which edges are drawn.
    fn frontier(&self) -> Frontier {
        match self {
            Self::ChaCha(_) => Frontier::Swapping(Vec::new()),
            Self::Python(_) => Frontier::Keeping(Vec::new()),
        }
    }
}

/// Edges to cells that may not have been visited. The order in which the others stay
/// when one is taken decides what later draws mean.
enum Frontier {
    /// The last one comes to the place of the one that is taken.
    Swapping(Vec<(u32, u32)>),
    /// The others keep their order, as with Python's `list.pop`. In blocks, none of them
    /// empty, so that taking one moves few.
    Keeping(Vec<Vec<(u32, u32)>>),
}

impl Frontier {
    const BLOCK: usize = 512;

    fn len(&self) -> usize {
        match self {
            Self::Swapping(edges) => edges.len(),
            Self::Keeping(blocks) => blocks.iter().map(Vec::len).sum(),
        }
    }

    fn push(&mut self, edge: (u32, u32)) {
        match self {
            Self::Swapping(edges) => edges.push(edge),
            Self::Keeping(blocks) => match blocks.last_mut() {
                Some(last) if last.len() < Self::BLOCK => last.push(edge),
                _ => blocks.push(vec![edge]),
            },
        }
    }

    /// Takes the edge at a place below [`Frontier::len`].
    fn take(&mut self, mut at: usize) -> (u32, u32) {
        match self {
            Self::Swapping(edges) => edges.swap_remove(at),
            Self::Keeping(blocks) => {
                let mut block = 0;
                while at >= blocks[block].len() {
                    at -= blocks[block].len();
                    block += 1;
                }
                let edge = blocks[block].remove(at);
                if blocks[block].is_empty() {
                    blocks.remove(block);
                }
                edge
            }
        }
    }
}

/// A map of a maze: corridors of equal width between walls of one cell.
///
/// Walls stand in rows and columns whose number is a multiple of `corridor + 1`.
/// The map is cut at `rows` and `cols`: with `corridor` 1 and odd sizes this is
/// the usual lattice, (2H + 1) × (2W + 1) for H × W maze cells
/// ([`MazeSpec::lattice`]); with 32, 32 and 4 it is shaped like MovingAI's
/// `maze-32-32-4`, which has no walls at its south and east edges.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MazeSpec {
    /// Rows of the map.
    #[serde(deserialize_with = "cells")]
    pub rows: u32,
    /// Columns of the map.
    #[serde(deserialize_with = "cells")]
    pub cols: u32,
    /// Width of corridors in cells.
    #[serde(default = "one", deserialize_with = "cells")]
    pub corridor: u32,
    /// The algorithm that carves it.
    #[serde(default)]
    pub algorithm: MazeAlgorithm,
    /// The source of its random numbers.
    #[serde(default)]
    pub random: MazeRandom,
    /// Number of walls that are opened besides, each of which closes a loop; all of them if there are fewer.
    #[serde(default, skip_serializing_if = "is_none")]
    pub loops: u32,
    /// Chooses the maze.
    #[serde(skip_deserializing)]
    pub seed: u64,
}

/// A maze without loops is written as it was before there were any.
#[expect(clippy::trivially_copy_pass_by_ref, reason = "as serde calls it")]
fn is_none(loops: &u32) -> bool {
    *loops == 0
}

impl MazeSpec {
    /// A maze of `height` × `width` maze cells, each one cell of the map, closed
    /// on all sides.
    pub fn lattice(
        height: u32,
        width: u32,
        algorithm: MazeAlgorithm,
        random: MazeRandom,
        seed: u64,
    ) -> Self {
        Self {
            rows: lattice_size(height),
            cols: lattice_size(width),
            corridor: 1,
            algorithm,
            random,
            loops: 0,
            seed,
        }
    }

    /// `maze-ROWS-COLS-CORRIDOR`; with Python's numbers `maze-ROWS-COLS-CORRIDOR-ALGORITHM-SEED`,
    /// since such mazes come in series. Loops are added as `-loops-N`.
    pub fn name(&self) -> String {
        let name = format!("maze-{}-{}-{}", self.rows, self.cols, self.corridor);
        let name = match self.random {
            MazeRandom::ChaCha => name,
            MazeRandom::Python => format!("{name}-{}-{}", self.algorithm.name(), self.seed),
        };
        match self.loops {
            0 => name,
            loops => format!("{name}-loops-{loops}"),
        }
    }

    /// The maze itself.
    pub fn maze(&self) -> Result<Maze, InputError> {
        at_least("rows", self.rows, 2)?;
        at_least("cols", self.cols, 2)?;
        at_least("corridor", self.corridor, 1)?;
        check_size(self.rows, self.cols)?;
        let pitch = self.corridor.saturating_add(1);
        let (height, width) = (
            (self.rows - 1).div_ceil(pitch),
            (self.cols - 1).div_ceil(pitch),
        );
        let mut maze = Maze::carve(width, height, self.algorithm, self.random, self.seed)?;
        maze.open_loops(self.loops, self.seed);
        Ok(maze)
    }

    /// The map.
    pub fn generate(&self) -> Result<Grid, InputError> {
        self.map_of(&self.maze()?)
    }

    /// The map with one agent, from the north-west corner of the maze's start to that
    /// of its goal; both are single cells where corridors are one cell wide.
    pub fn instance(&self, connectivity: Connectivity) -> Result<GridInstance, InputError> {
        let maze = self.maze()?;
        let grid = self.map_of(&maze)?;
        let pitch = self.corridor.saturating_add(1);
        let cell = |of_maze: u32| {
            let (x, y) = maze.position(of_maze);
            (y * pitch + 1) * self.cols + x * pitch + 1
        };
        let (start, goal) = (cell(maze.start()), cell(maze.goal()));
        GridInstance::new(Arc::new(grid), connectivity, vec![start], vec![goal])
            .map_err(|error| InputError::new(self.name(), error.to_string()))
    }

    fn map_of(&self, maze: &Maze) -> Result<Grid, InputError> {
        maze.draw(self.rows, self.cols, self.corridor, self.name())
    }
}
