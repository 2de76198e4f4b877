//! Grid maps: terrain letters on a rectangle of cells.
//!
//! `row` grows down, `col` grows right, and a cell's index is
//! `row * cols + col`, as in MovingAI files.

use crate::moves::MOVES;
use crate::{Digest, GridSearch, Hasher, InputError, words};

/// The moves that a grid allows besides waiting.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Connectivity {
    /// North, east, south, west.
    Four,
    /// The four above and the diagonals.
    Eight,
}

impl Connectivity {
    /// 4 or 8.
    pub fn degree(self) -> u32 {
        match self {
            Self::Four => 4,
            Self::Eight => 8,
        }
    }

    /// The bits of a mask that count: its lowest 4 or all 8.
    pub fn mask(self) -> u8 {
        match self {
            Self::Four => 0x0f,
            Self::Eight => 0xff,
        }
    }
}

/// The move of a bit of a mask as row and column step; see [`Grid::move_mask`].
pub fn move_step(bit: u32) -> (i8, i8) {
    let (_, rows, cols) = MOVES[bit as usize + 1];
    (rows, cols)
}

/// The bit of a mask that stands for the move between two neighbouring cells, given as rows and
/// columns; none for cells that are not neighbours.
pub fn move_bit(from: (u32, u32), to: (u32, u32)) -> Option<u32> {
    let step = |from: u32, to: u32| i8::try_from(i64::from(to) - i64::from(from)).ok();
    let steps = (step(from.0, to.0)?, step(from.1, to.1)?);
    (0..8).find(|bit| move_step(*bit) == steps)
}

/// The bit of the way back.
pub fn opposite_move(bit: u32) -> u32 {
    (bit & 4) | ((bit + 2) & 3)
}

/// The reason why masks of moves do not fit a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs)]
pub enum MovesError {
    #[error("there are {found} masks of moves, but the map has {cells} cells")]
    LengthMismatch { found: usize, cells: usize },
    #[error(
        "the mask of row {row}, column {col} allows the move {}, which leaves the map, leads from or to an \
         obstacle, or cuts a corner",
        char::from(MOVES[*.bit as usize + 1].0)
    )]
    Impossible { row: u32, col: u32, bit: u32 },
}

/// The distance that robots keep on a grid. Cells have the side 2r or more, for discs of radius r.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub enum Separation {
    /// That of the rules of MAPF in cells of side 2r, as published: on four neighbours a robot
    /// that follows another one round a corner comes as near as √2·r.
    #[default]
    Rules,
    /// 2r between the centres of any two robots at all times.
    Strict,
}

words!(Separation {
    Rules = "rules", "The rules of MAPF in cells of side 2r: round corners robots come as near as √2·r to each other";
    Strict = "strict", "Always 2r: nobody follows another one round a corner, or cells have the side 2√2·r";
});

/// The purpose of a cell of a warehouse. Robots pass either like any other free cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Role {
    /// Beside a shelf: where goods are fetched and put back. Its letter is `e`.
    Endpoint,
    /// Place where people handle the goods. Its letter is `w`.
    Workstation,
}

impl Role {
    /// Its letter in map files, those of LSMART and ours alike.
    pub fn letter(self) -> u8 {
        match self {
            Self::Endpoint => b'e',
            Self::Workstation => b'w',
        }
    }

    fn of(letter: u8) -> Option<Self> {
        [Self::Endpoint, Self::Workstation]
            .into_iter()
            .find(|role| role.letter() == letter)
    }
}

/// A grid map.
///
/// Invariants: at least one cell, at most [`Grid::MAX_CELLS`], every terrain letter is one of
/// [`Grid::LETTERS`], and masks of moves allow nothing that the terrain forbids.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grid {
    name: String,
    rows: u32,
    cols: u32,
    terrain: Vec<u8>,
    /// Per cell its allowed moves, where those are fewer than the terrain leaves.
    moves: Option<Vec<u8>>,
}

impl Grid {
    /// The largest map that is accepted, in cells.
    pub const MAX_CELLS: u64 = 1 << 30;

    /// Every terrain letter that is understood; see [`Grid::letter_is_passable`].
    pub const LETTERS: &'static [u8] = b".GSEew@OTW";

    /// True if a robot may stand on terrain `letter`.
    ///
    /// `.` and `G` are ground and `S` is swamp; in maps of the League of Robot Runners
    /// `S` and `E` mark stations and endpoints. `e` and `w` are [`Role`]s. `@` and `O` are out
    /// of bounds, `T` is trees, and `W` is water, which the MovingAI format
    /// forbids to enter from ground.
    pub fn letter_is_passable(letter: u8) -> bool {
        matches!(letter, b'.' | b'G' | b'S' | b'E' | b'e' | b'w')
    }

    /// Builds a grid from row-major terrain letters.
    pub fn new(
        name: impl Into<String>,
        rows: u32,
        cols: u32,
        terrain: Vec<u8>,
    ) -> Result<Self, InputError> {
        let name = name.into();
        let cells = u64::from(rows) * u64::from(cols);
        if cells == 0 || cells > Self::MAX_CELLS {
            return Err(InputError::new(
                name,
                format!("a map of {rows} rows and {cols} columns is empty or too large"),
            )
            .hint(format!("a map has between 1 and {} cells", Self::MAX_CELLS)));
        }
        if terrain.len() as u64 != cells {
            let reason = format!(
                "{rows} rows and {cols} columns need {cells} cells, got {}",
                terrain.len()
            );
            return Err(InputError::new(name, reason));
        }
        if let Some(at) = terrain
            .iter()
            .position(|letter| !Self::LETTERS.contains(letter))
        {
            let (row, col) = (at as u64 / u64::from(cols), at as u64 % u64::from(cols));
            let letter = char::from(terrain[at]).escape_default();
            let reason = format!("unknown terrain letter '{letter}' at row {row}, column {col}");
            return Err(InputError::new(name, reason));
        }
        Ok(Self {
            name,
            rows,
            cols,
            terrain,
            moves: None,
        })
    }

    /// The same map under another name.
    #[must_use]
    pub fn named(self, name: impl Into<String>) -> Self {
        let name = name.into();
        Self { name, ..self }
    }

    /// The same map with a mask of allowed moves per cell, as [`Grid::move_mask`] gives them. Masks
    /// that allow all moves of the terrain are not kept: they are the plain map.
    pub fn with_moves(mut self, moves: Vec<u8>) -> Result<Self, MovesError> {
        let (found, cells) = (moves.len(), self.terrain.len());
        if found != cells {
            return Err(MovesError::LengthMismatch { found, cells });
        }
        self.moves = None;
        let mut is_plain = true;
        for (cell, mask) in (0..).zip(&moves) {
            let possible = self.move_mask(cell, Connectivity::Eight);
            is_plain &= *mask == possible;
            let wrong = mask & !possible;
            if wrong != 0 {
                let ((row, col), bit) = (self.row_col(cell), wrong.trailing_zeros());
                return Err(MovesError::Impossible { row, col, bit });
            }
        }
        self.moves = (!is_plain).then_some(moves);
        Ok(self)
    }

    /// Gives cells another terrain letter, one of [`Grid::LETTERS`]. Masks of moves are lost: they
    /// may allow what the new terrain forbids. Refuses cells that are not on the map, and other letters,
    /// and then changes nothing.
    pub fn fill(&mut self, cells: core::ops::Range<u32>, letter: u8) -> Result<(), InputError> {
        if !Self::LETTERS.contains(&letter) {
            let reason = format!("unknown terrain letter '{}'", letter.escape_ascii());
            return Err(InputError::new(self.name.as_str(), reason));
        }
        let most = self.terrain.len();
        let filled = self
            .terrain
            .get_mut(cells.start as usize..cells.end as usize);
        let filled = filled.ok_or_else(|| {
            let reason = format!(
                "cells {} to {} are not all on the map",
                cells.start, cells.end
            );
            InputError::new(self.name.as_str(), reason).hint(format!("the map has {most} cells"))
        })?;
        filled.fill(letter);
        self.moves = None;
        Ok(())
    }

    /// True if the map allows fewer moves than its terrain leaves.
    pub fn has_move_masks(&self) -> bool {
        self.moves.is_some()
    }

    /// The moves that are allowed from a cell of the map. Bit i stands for letter i of `NESWnesw`:
    /// north, east, south, west, north-east, south-east, south-west, north-west. A bit is set only
    /// where the move is allowed: it stays on the map, both cells are free, a diagonal one has
    /// both cells at its sides free, as in the MovingAI benchmarks, and the map's mask has it.
    pub fn move_mask(&self, cell: u32, connectivity: Connectivity) -> u8 {
        match &self.moves {
            Some(moves) => moves[cell as usize] & connectivity.mask(),
            None => self.terrain_mask(cell, connectivity),
        }
    }

    /// The [`Grid::move_mask`] of every cell.
    pub fn move_masks(&self, connectivity: Connectivity) -> Vec<u8> {
        let cells = 0..self.cell_count();
        cells
            .map(|cell| self.move_mask(cell, connectivity))
            .collect()
    }

    /// True if the terrain allows a move from a cell and the map does not.
    pub fn forbids_move(&self, cell: u32, bit: u32) -> bool {
        self.moves.as_ref().is_some_and(|moves| {
            let forbidden = self.terrain_mask(cell, Connectivity::Eight) & !moves[cell as usize];
            forbidden & (1 << bit) != 0
        })
    }

    fn terrain_mask(&self, cell: u32, connectivity: Connectivity) -> u8 {
        if !self.is_passable(cell) {
            return 0;
        }
        let is_free = |rows: i8, cols: i8| {
            self.beside(cell, (rows, cols))
                .is_some_and(|to| self.is_passable(to))
        };
        (0..connectivity.degree()).fold(0, |mask, bit| {
            let (rows, cols) = move_step(bit);
            let is_straight = rows == 0 || cols == 0;
            let is_open =
                is_free(rows, cols) && (is_straight || (is_free(rows, 0) && is_free(0, cols)));
            mask | (u8::from(is_open) << bit)
        })
    }

    /// The cell so many rows and columns from a cell, if it is on the map.
    fn beside(&self, cell: u32, (rows, cols): (i8, i8)) -> Option<u32> {
        let (row, col) = self.row_col(cell);
        self.cell(
            row.checked_add_signed(rows.into())?,
            col.checked_add_signed(cols.into())?,
        )
    }

    /// The map's name: its file name without folders and extension.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of rows (the map's height in cells).
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Number of columns (the map's width in cells).
    pub fn cols(&self) -> u32 {
        self.cols
    }

    /// Terrain letters, row-major.
    pub fn terrain(&self) -> &[u8] {
        &self.terrain
    }

    /// Number of cells.
    pub fn cell_count(&self) -> u32 {
        self.rows * self.cols
    }

    /// Number of cells that a robot may stand on.
    pub fn passable_count(&self) -> u32 {
        self.terrain
            .iter()
            .filter(|letter| Self::letter_is_passable(**letter))
            .count() as u32
    }

    /// True if `cell` is on the map and free.
    pub fn is_passable(&self, cell: u32) -> bool {
        self.terrain
            .get(cell as usize)
            .is_some_and(|letter| Self::letter_is_passable(*letter))
    }

    /// The purpose of a cell, if the map says so.
    pub fn role(&self, cell: u32) -> Option<Role> {
        self.terrain
            .get(cell as usize)
            .and_then(|letter| Role::of(*letter))
    }

    /// The cells with a role, ascending.
    pub fn cells_with(&self, role: Role) -> impl Iterator<Item = u32> {
        let cells = (0..).zip(&self.terrain);
        cells.filter_map(move |(cell, letter)| (*letter == role.letter()).then_some(cell))
    }

    /// The cell at a position, if it is on the map.
    pub fn cell(&self, row: u32, col: u32) -> Option<u32> {
        (row < self.rows && col < self.cols).then(|| row * self.cols + col)
    }

    /// Row and column of a cell; the cell must be on the map.
    pub fn row_col(&self, cell: u32) -> (u32, u32) {
        (cell / self.cols, cell % self.cols)
    }

    /// The cells to which a robot may move from a cell, in the order of [`Grid::move_mask`].
    pub fn neighbors(&self, cell: u32, connectivity: Connectivity) -> impl Iterator<Item = u32> {
        let mask = self.move_mask(cell, connectivity);
        let bits = (0..8).filter(move |bit| mask & (1 << bit) != 0);
        bits.map(move |bit| {
            let (rows, cols) = move_step(bit);
            (i64::from(cell) + i64::from(rows) * i64::from(self.cols) + i64::from(cols)) as u32
        })
    }

    /// Labels the parts of the passable cells from 1, in the order of their first cells; blocked
    /// cells are 0. Within a part every cell can be reached from every other.
    ///
    /// Without masks of moves four- and eight-connected grids have the same parts, since diagonal
    /// moves need free orthogonal cells. With masks, whose moves may be one-way, parts are
    /// strongly connected.
    pub fn components(&self, connectivity: Connectivity) -> Vec<u32> {
        if self.has_move_masks() {
            return self.strong_components(connectivity);
        }
        let mut label = vec![0u32; self.cell_count() as usize];
        let mut next = 0;
        let mut stack = Vec::new();
        for seed in 0..self.cell_count() {
            if label[seed as usize] != 0 || !self.is_passable(seed) {
                continue;
            }
            next += 1;
            label[seed as usize] = next;
            stack.push(seed);
            while let Some(cell) = stack.pop() {
                for to in self.neighbors(cell, Connectivity::Four) {
                    if label[to as usize] == 0 {
                        label[to as usize] = next;
                        stack.push(to);
                    }
                }
            }
        }
        label
    }

    /// Kosaraju's two passes: cells in the order in which a search leaves them, then backwards
    /// from the last.
    fn strong_components(&self, connectivity: Connectivity) -> Vec<u32> {
        let masks = self.move_masks(connectivity);
        let mut left = Vec::with_capacity(masks.len());
        let mut is_seen = vec![false; masks.len()];
        let mut stack: Vec<(u32, u8)> = Vec::new();
        for seed in 0..self.cell_count() {
            if is_seen[seed as usize] || !self.is_passable(seed) {
                continue;
            }
            is_seen[seed as usize] = true;
            stack.push((seed, masks[seed as usize]));
            while let Some((cell, mask)) = stack.last_mut() {
                if *mask == 0 {
                    left.push(*cell);
                    stack.pop();
                    continue;
                }
                let bit = mask.trailing_zeros();
                *mask &= *mask - 1;
                let to = self.beside(*cell, move_step(bit));
                if let Some(to) = to.filter(|to| !is_seen[*to as usize]) {
                    is_seen[to as usize] = true;
                    stack.push((to, masks[to as usize]));
                }
            }
        }
        let mut root = vec![u32::MAX; masks.len()];
        let mut cells = Vec::new();
        for seed in left.into_iter().rev() {
            if root[seed as usize] != u32::MAX {
                continue;
            }
            root[seed as usize] = seed;
            cells.push(seed);
            while let Some(cell) = cells.pop() {
                for bit in 0..connectivity.degree() {
                    let from = self.beside(cell, move_step(opposite_move(bit)));
                    let Some(from) = from.filter(|from| {
                        masks[*from as usize] & (1 << bit) != 0 && root[*from as usize] == u32::MAX
                    }) else {
                        continue;
                    };
                    root[from as usize] = seed;
                    cells.push(from);
                }
            }
        }
        let mut label_of = vec![0; masks.len()];
        let mut next = 0;
        let label = root.into_iter().map(|root| {
            let Some(label) = label_of.get_mut(root as usize) else {
                return 0;
            };
            if *label == 0 {
                next += 1;
                *label = next;
            }
            *label
        });
        label.collect()
    }

    /// The first agent that cannot reach its goal.
    pub(crate) fn first_cut_off(
        &self,
        starts: &[u32],
        goals: &[u32],
        connectivity: Connectivity,
    ) -> Option<usize> {
        let part = self.components(connectivity);
        let mut search = None;
        starts.iter().zip(goals).position(|(start, goal)| {
            if part[*start as usize] == part[*goal as usize] {
                return false;
            }
            // Moves that are one-way lead from one part to another.
            !self.has_move_masks()
                || search
                    .get_or_insert_with(|| GridSearch::new(self))
                    .steps(*start, *goal, connectivity)
                    .is_none()
        })
    }

    /// Digest of size, passability and, where the map has them, masks of moves. Names, roles and
    /// letters of equal meaning do not change it: two files with the same free cells and the
    /// same moves are the same map.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("fleetyard.grid/1");
        hasher.u64(u64::from(self.rows));
        hasher.u64(u64::from(self.cols));
        let mut bits = vec![0u8; self.terrain.len().div_ceil(8)];
        for (cell, letter) in self.terrain.iter().enumerate() {
            bits[cell / 8] |= u8::from(Self::letter_is_passable(*letter)) << (cell % 8);
        }
        hasher.bytes(&bits);
        if let Some(moves) = &self.moves {
            hasher.bytes(moves);
        }
        hasher.finish()
    }
}
