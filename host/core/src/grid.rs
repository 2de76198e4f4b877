//! Grid maps: terrain letters on a rectangle of cells.
//!
//! `row` grows down, `col` grows right, and a cell's index is
//! `row * cols + col`, as in MovingAI files.

use crate::{Digest, Hasher, InputError};

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
}

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
/// Invariants: at least one cell, at most [`Grid::MAX_CELLS`], and every
/// terrain letter is one of [`Grid::LETTERS`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Grid {
    name: String,
    rows: u32,
    cols: u32,
    terrain: Vec<u8>,
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
        })
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

    /// Passable neighbours of a cell in the order north, east, south, west, and
    /// for eight-connected grids then north-east, south-east, south-west,
    /// north-west. Diagonal moves need both shared orthogonal cells free, as in
    /// the MovingAI benchmarks.
    pub fn neighbors(&self, cell: u32, connectivity: Connectivity) -> impl Iterator<Item = u32> {
        const ORTHOGONAL: [(i64, i64); 4] = [(-1, 0), (0, 1), (1, 0), (0, -1)];
        const DIAGONAL: [(i64, i64); 4] = [(-1, 1), (1, 1), (1, -1), (-1, -1)];
        let (row, col) = self.row_col(cell);
        let at = move |dr: i64, dc: i64| {
            let (row, col) = (i64::from(row) + dr, i64::from(col) + dc);
            let (row, col) = (u32::try_from(row).ok()?, u32::try_from(col).ok()?);
            self.cell(row, col).filter(|cell| self.is_passable(*cell))
        };
        let orthogonal = ORTHOGONAL
            .into_iter()
            .filter_map(move |(dr, dc)| at(dr, dc));
        let diagonal = DIAGONAL
            .into_iter()
            .filter(move |_| connectivity == Connectivity::Eight)
            .filter_map(move |(dr, dc)| at(dr, 0).and(at(0, dc)).and(at(dr, dc)));
        orthogonal.chain(diagonal)
    }

    /// Labels the connected components of the passable cells from 1, in the
    /// order of their first cells; blocked cells are 0.
    ///
    /// Diagonal moves never join components, since they need free orthogonal
    /// cells, so that four- and eight-connected grids have the same.
    pub fn components(&self) -> Vec<u32> {
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

    /// Digest of size and passability. Names, roles and letters of equal meaning do
    /// not change it: two files with the same free cells are the same map.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new("fleetyard.grid/1");
        hasher.u64(u64::from(self.rows));
        hasher.u64(u64::from(self.cols));
        let mut bits = vec![0u8; self.terrain.len().div_ceil(8)];
        for (cell, letter) in self.terrain.iter().enumerate() {
            bits[cell / 8] |= u8::from(Self::letter_is_passable(*letter)) << (cell % 8);
        }
        hasher.bytes(&bits);
        hasher.finish()
    }
}
