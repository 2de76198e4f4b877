//! Perfect mazes on a lattice: exactly one simple way between any two cells.
//!
//! The two algorithms are those of the deterministic grid-maze benchmark for
//! planners: depth-first search with an explicit stack (the recursive
//! backtracker), and randomised Prim with a list of frontier edges. They are the
//! same algorithms on our own random numbers, so that a seed here gives another
//! maze than the same seed there.

use fleetyard_core::{Grid, InputError};

use crate::SeededRandom;
use crate::canvas::{Canvas, at_least};

/// How a maze is carved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MazeAlgorithm {
    /// Depth-first: long winding corridors.
    Backtracker,
    /// Randomised Prim: many short dead ends.
    Prim,
}

impl MazeAlgorithm {
    /// `backtracker` or `prim`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Backtracker => "backtracker",
            Self::Prim => "prim",
        }
    }
}

/// A maze of corridors of equal width between walls of one cell.
///
/// Walls stand in rows and columns whose number is a multiple of `corridor + 1`.
/// The map is cut at `rows` and `cols`: with `corridor` 1 and odd sizes this is
/// the usual lattice, (2H + 1) × (2W + 1) for H × W maze cells
/// ([`MazeSpec::lattice`]); with 32, 32 and 4 it is shaped like MovingAI's
/// `maze-32-32-4`, which has no walls at its south and east edges.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct MazeSpec {
    /// Rows of the map.
    pub rows: u32,
    /// Columns of the map.
    pub cols: u32,
    /// Width of corridors in cells.
    pub corridor: u32,
    /// How it is carved.
    pub algorithm: MazeAlgorithm,
    /// Chooses the maze.
    pub seed: u64,
}

impl MazeSpec {
    /// A maze of `height` × `width` maze cells, each one cell of the map, closed
    /// on all sides.
    pub fn lattice(height: u32, width: u32, algorithm: MazeAlgorithm, seed: u64) -> Self {
        let lattice = |cells: u32| cells.saturating_mul(2).saturating_add(1);
        Self {
            rows: lattice(height),
            cols: lattice(width),
            corridor: 1,
            algorithm,
            seed,
        }
    }

    /// `maze-ROWS-COLS-CORRIDOR`.
    pub fn name(&self) -> String {
        format!("maze-{}-{}-{}", self.rows, self.cols, self.corridor)
    }

    /// The map.
    pub fn generate(&self) -> Result<Grid, InputError> {
        at_least("rows", self.rows, 2)?;
        at_least("cols", self.cols, 2)?;
        at_least("corridor", self.corridor, 1)?;
        let mut canvas = Canvas::new(self.rows, self.cols, b'.')?;
        let pitch = self.corridor.saturating_add(1);
        for row in (0..self.rows).step_by(pitch as usize) {
            canvas.fill(row, 0, 1, self.cols, b'@');
        }
        for col in (0..self.cols).step_by(pitch as usize) {
            canvas.fill(0, col, self.rows, 1, b'@');
        }
        let lattice = Lattice {
            rows: (self.rows - 1).div_ceil(pitch),
            cols: (self.cols - 1).div_ceil(pitch),
        };
        let mut random = SeededRandom::new("map maze", self.seed);
        let passages = match self.algorithm {
            MazeAlgorithm::Backtracker => lattice.backtracker(&mut random),
            MazeAlgorithm::Prim => lattice.prim(&mut random),
        };
        for (a, b) in passages {
            let (a, b) = (lattice.row_col(a.min(b)), lattice.row_col(a.max(b)));
            if a.0 == b.0 {
                // East: the wall column before `b`, over the corridor's height.
                canvas.fill(a.0 * pitch + 1, b.1 * pitch, self.corridor, 1, b'.');
            } else {
                canvas.fill(b.0 * pitch, a.1 * pitch + 1, 1, self.corridor, b'.');
            }
        }
        canvas.grid(self.name())
    }
}

/// The maze's own cells, before they are drawn.
struct Lattice {
    rows: u32,
    cols: u32,
}

impl Lattice {
    fn row_col(&self, cell: u32) -> (u32, u32) {
        (cell / self.cols, cell % self.cols)
    }

    /// Neighbours in the order north, east, south, west.
    fn neighbors(&self, cell: u32) -> impl Iterator<Item = u32> + use<> {
        let (row, col) = self.row_col(cell);
        [
            (row > 0).then(|| cell - self.cols),
            (col + 1 < self.cols).then(|| cell + 1),
            (row + 1 < self.rows).then(|| cell + self.cols),
            (col > 0).then(|| cell - 1),
        ]
        .into_iter()
        .flatten()
    }

    fn backtracker(&self, random: &mut SeededRandom) -> Vec<(u32, u32)> {
        let mut visited = vec![false; (self.rows * self.cols) as usize];
        let mut passages = Vec::with_capacity(visited.len());
        let mut stack = vec![0];
        visited[0] = true;
        while let Some(cell) = stack.last().copied() {
            let open: Vec<u32> = self
                .neighbors(cell)
                .filter(|to| !visited[*to as usize])
                .collect();
            if open.is_empty() {
                stack.pop();
                continue;
            }
            let to = open[random.below(open.len())];
            visited[to as usize] = true;
            passages.push((cell, to));
            stack.push(to);
        }
        passages
    }

    fn prim(&self, random: &mut SeededRandom) -> Vec<(u32, u32)> {
        let mut visited = vec![false; (self.rows * self.cols) as usize];
        let mut passages = Vec::with_capacity(visited.len());
        // Edges, with a target as often as it has visited neighbours.
        let mut frontier: Vec<(u32, u32)> = self.neighbors(0).map(|to| (0, to)).collect();
        visited[0] = true;
        while !frontier.is_empty() {
            let (from, to) = frontier.swap_remove(random.below(frontier.len()));
            if std::mem::replace(&mut visited[to as usize], true) {
                continue;
            }
            passages.push((from, to));
            let open = self
                .neighbors(to)
                .filter(|next| !visited[*next as usize])
                .map(|next| (to, next));
            frontier.extend(open);
        }
        passages
    }
}
