//! The map as the searches see it: a border of blocked cells all round, a stride
//! that is a power of two, and for every cell the directions in which a robot may
//! leave it.
//!
//! Rows follow each other in one array with a stride `2^k > cols`, so that the
//! padding behind a row is the border to the left of the next one. A *place* is an
//! index of that array. A neighbour is one addition away and never outside, and row
//! and column are a shift and a mask.

use std::f64::consts::SQRT_2;

/// An index of the array with its border.
pub(crate) type Place = u32;

/// Directions by number: the straight ones clockwise from north, then the diagonal
/// ones clockwise from north-west. This is also the order in which successors are
/// made, unless a planner says otherwise.
pub(crate) const NORTH: u8 = 0;
pub(crate) const EAST: u8 = 1;
pub(crate) const SOUTH: u8 = 2;
pub(crate) const WEST: u8 = 3;
pub(crate) const NORTH_WEST: u8 = 4;
pub(crate) const NORTH_EAST: u8 = 5;
pub(crate) const SOUTH_EAST: u8 = 6;
pub(crate) const SOUTH_WEST: u8 = 7;
/// No direction: where a search begins.
pub(crate) const NOWHERE: u8 = 8;

/// Rows and columns that a direction leads on.
pub(crate) const DELTAS: [(i32, i32); 8] = [
    (-1, 0),
    (0, 1),
    (1, 0),
    (0, -1),
    (-1, -1),
    (-1, 1),
    (1, 1),
    (1, -1),
];

/// The way back.
pub(crate) fn opposite(direction: u8) -> u8 {
    direction ^ 2
}

/// The two straight directions that a diagonal one is made of: rows, columns.
pub(crate) fn sides(diagonal: u8) -> (u8, u8) {
    match diagonal {
        NORTH_WEST => (NORTH, WEST),
        NORTH_EAST => (NORTH, EAST),
        SOUTH_EAST => (SOUTH, EAST),
        _ => (SOUTH, WEST),
    }
}

/// Number of neighbours of a cell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Neighbors {
    /// North, east, south, west.
    Four,
    /// Those and the diagonal ones; a diagonal move needs both cells beside it free.
    Eight,
}

/// A grid of free and blocked cells, `cell = row · cols + col`.
#[derive(Debug, Clone)]
pub struct Grid {
    rows: u32,
    cols: u32,
    neighbors: Neighbors,
    shift: u32,
    offsets: [i32; 8],
    free: Vec<bool>,
    exits: Vec<u8>,
    /// The moves that may be made, and the directions of neighbours from which one leads here, where
    /// streets are one-way.
    one_way: Option<OneWay>,
}

#[derive(Debug, Clone, PartialEq, Eq)]
struct OneWay {
    allowed: Vec<u8>,
    entries: Vec<u8>,
}

/// Directions of the bits of a map's moves: the straight ones, then those a turn of 45° to the right of
/// them.
const OF_BITS: [u8; 8] = [
    NORTH, EAST, SOUTH, WEST, NORTH_EAST, SOUTH_EAST, SOUTH_WEST, NORTH_WEST,
];

impl Grid {
    /// From one entry per cell, row by row. `None` if there are not `rows · cols` of
    /// them, none at all, or more than an array of 2³¹ places takes.
    pub fn new(rows: u32, cols: u32, passable: &[bool], neighbors: Neighbors) -> Option<Self> {
        let stride = u64::from(cols).checked_add(1)?.next_power_of_two();
        let places = stride.checked_mul(u64::from(rows) + 2)?.checked_add(1)?;
        let cells = u64::from(rows) * u64::from(cols);
        if cells == 0 || passable.len() as u64 != cells || places > 1 << 31 {
            return None;
        }
        let shift = stride.trailing_zeros();
        let stride = stride as i32;
        let mut grid = Self {
            rows,
            cols,
            neighbors,
            shift,
            offsets: DELTAS.map(|(rows, cols)| rows * stride + cols),
            free: vec![false; places as usize],
            exits: vec![0; places as usize],
            one_way: None,
        };
        for (row, cells) in passable.chunks(cols as usize).enumerate() {
            let first = ((row + 1) << shift) + 1;
            grid.free[first..first + cells.len()].copy_from_slice(cells);
        }
        for row in 0..rows {
            let first = grid.place(row * cols);
            for place in first..first + cols {
                grid.exits[place as usize] = grid.exits_of(place);
            }
        }
        Some(grid)
    }

    /// The same with one-way streets: bit i of a cell's mask allows the move of letter i of
    /// `NESWnesw`, if nothing is in the way.
    #[must_use]
    pub fn with_moves(mut self, moves: &[u8]) -> Self {
        let mut allowed = vec![0; self.places()];
        for (cell, mask) in (0..).zip(moves) {
            let directions = OF_BITS.iter().enumerate();
            let bits = directions.map(|(bit, direction)| (mask >> bit & 1) << direction);
            allowed[self.place(cell) as usize] = bits.fold(0, |all, bit| all | bit);
        }
        let entries = vec![0; self.places()];
        self.one_way = Some(OneWay { allowed, entries });
        let cells = || 0..self.rows * self.cols;
        let places: Vec<Place> = cells().map(|cell| self.place(cell)).collect();
        for &place in &places {
            self.exits[place as usize] = self.exits_of(place);
        }
        for &place in &places {
            self.enter(place);
        }
        self
    }

    /// Works out from where moves lead to a place.
    fn enter(&mut self, place: Place) {
        let comes = |direction: u8| {
            let near = self.step(place, direction);
            self.exits[near as usize] >> opposite(direction) & 1
        };
        let mask = (0..8).fold(0, |mask, direction| mask | comes(direction) << direction);
        if let Some(one_way) = &mut self.one_way {
            one_way.entries[place as usize] = mask;
        }
    }

    /// Number of rows.
    pub fn rows(&self) -> u32 {
        self.rows
    }

    /// Number of columns.
    pub fn cols(&self) -> u32 {
        self.cols
    }

    /// Number of neighbours of a cell.
    pub fn neighbors(&self) -> Neighbors {
        self.neighbors
    }

    /// True if a robot may be in a cell.
    pub fn is_free(&self, cell: u32) -> bool {
        cell < self.rows * self.cols && self.free_at(self.place(cell))
    }

    /// Blocks or frees a cell, and says whether that changed anything.
    pub fn set_free(&mut self, cell: u32, free: bool) -> bool {
        if cell >= self.rows * self.cols || self.is_free(cell) == free {
            return false;
        }
        let place = self.place(cell);
        self.free[place as usize] = free;
        self.exits[place as usize] = self.exits_of(place);
        let near: [Place; 8] = std::array::from_fn(|direction| self.step(place, direction as u8));
        for near in near {
            self.exits[near as usize] = self.exits_of(near);
        }
        if self.one_way.is_some() {
            // Nobody leaves a cell that is not free, before or now.
            let left = near.into_iter().filter(|near| self.free_at(*near));
            let left: Vec<Place> = left.chain([place]).collect();
            for changed in left {
                for direction in 0..8 {
                    let beyond = self.step(changed, direction);
                    if self.free_at(beyond) {
                        self.enter(beyond);
                    }
                }
                self.enter(changed);
            }
        }
        true
    }

    /// The cells that are free here and not there, or the other way round, with what they are here; `None` if one grid
    /// has another size, other neighbours or other one-way streets.
    pub fn changes_from(&self, other: &Self) -> Option<Vec<(u32, bool)>> {
        let shape = |grid: &Self| (grid.rows, grid.cols, grid.neighbors);
        if shape(self) != shape(other) || self.one_way != other.one_way {
            return None;
        }
        // Whole rows are compared at once.
        let changed = (0..self.rows).flat_map(|row| {
            let first = self.place(row * self.cols) as usize;
            let places = first..first + self.cols as usize;
            let (now, before) = (&self.free[places.clone()], &other.free[places]);
            let cells = if now == before { &[] } else { now };
            let cells = cells.iter().zip(before).enumerate();
            cells
                .filter(|(_, (now, before))| now != before)
                .map(move |(col, (now, _))| (row * self.cols + col as u32, *now))
        });
        Some(changed.collect())
    }

    /// The length of a path in cells' sides: 1 for a straight move, √2 for a diagonal
    /// one, and the Euclidean distance between cells that are further apart.
    pub fn length(&self, path: &[u32]) -> f64 {
        let (mut straight, mut diagonal, mut others) = (0_u32, 0_u32, 0.0);
        for pair in path.windows(2) {
            let [from, to] = [pair[0], pair[1]].map(|cell| self.place(cell));
            match self.apart(from, to) {
                (0, 0) => {}
                (0, 1) | (1, 0) => straight += 1,
                (1, 1) => diagonal += 1,
                (rows, cols) => others += f64::from(rows).hypot(f64::from(cols)),
            }
        }
        f64::from(straight) + f64::from(diagonal) * SQRT_2 + others
    }

    pub(crate) fn places(&self) -> usize {
        self.free.len()
    }

    pub(crate) fn place(&self, cell: u32) -> Place {
        (((cell / self.cols) + 1) << self.shift) + cell % self.cols + 1
    }

    pub(crate) fn cell(&self, place: Place) -> u32 {
        let (row, col) = self.at(place);
        (row - 1) * self.cols + col - 1
    }

    /// Row and column in the array with its border.
    #[inline]
    pub(crate) fn at(&self, place: Place) -> (u32, u32) {
        (place >> self.shift, place & ((1 << self.shift) - 1))
    }

    pub(crate) fn place_at(&self, row: u32, col: u32) -> Place {
        (row << self.shift) + col
    }

    /// Rows and columns between two places.
    #[inline]
    pub(crate) fn apart(&self, from: Place, to: Place) -> (u32, u32) {
        let ((row, col), (other_row, other_col)) = (self.at(from), self.at(to));
        (row.abs_diff(other_row), col.abs_diff(other_col))
    }

    #[inline]
    pub(crate) fn step(&self, place: Place, direction: u8) -> Place {
        place.wrapping_add_signed(self.offsets[usize::from(direction & 7)])
    }

    #[inline]
    pub(crate) fn free_at(&self, place: Place) -> bool {
        self.free[place as usize]
    }

    /// The directions in which a robot may leave a place, as a mask.
    #[inline]
    pub(crate) fn exits(&self, place: Place) -> u8 {
        self.exits[place as usize]
    }

    /// The directions of the neighbours from which a robot may come to a place, as a mask.
    #[inline]
    pub(crate) fn entries(&self, place: Place) -> u8 {
        match &self.one_way {
            None => self.exits(place),
            Some(one_way) => one_way.entries[place as usize],
        }
    }

    fn exits_of(&self, place: Place) -> u8 {
        if !self.free_at(place) {
            return 0;
        }
        let open = |direction| self.free_at(self.step(place, direction));
        let mut mask = 0;
        for direction in 0..4 {
            mask |= u8::from(open(direction)) << direction;
        }
        if self.neighbors == Neighbors::Eight {
            for direction in 4..8 {
                let (row, col) = sides(direction);
                let both = mask >> row & mask >> col & 1 == 1;
                mask |= u8::from(both && open(direction)) << direction;
            }
        }
        match &self.one_way {
            None => mask,
            Some(one_way) => mask & one_way.allowed[place as usize],
        }
    }
}

/// The directions of a mask, in their order.
pub(crate) fn directions(mask: u8) -> impl Iterator<Item = u8> {
    let mut left = mask;
    std::iter::from_fn(move || {
        if left == 0 {
            return None;
        }
        let direction = left.trailing_zeros() as u8;
        left &= left - 1;
        Some(direction)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid(rows: &[&str], neighbors: Neighbors) -> Grid {
        let passable: Vec<bool> = rows.concat().bytes().map(|letter| letter == b'.').collect();
        Grid::new(
            rows.len() as u32,
            rows[0].len() as u32,
            &passable,
            neighbors,
        )
        .expect("a grid")
    }

    #[test]
    fn diagonal_moves_need_both_sides() {
        let grid = grid(&["..", "#."], Neighbors::Eight);
        let exits = |cell| grid.exits(grid.place(cell));
        assert_eq!(exits(0), 1 << EAST);
        assert_eq!(exits(1), 1 << SOUTH | 1 << WEST);
        assert_eq!(exits(2), 0);
    }

    #[test]
    fn nothing_leaves_the_map() {
        for (rows, cols) in [(1, 1), (1, 7), (7, 1), (3, 4), (4, 3), (3, 7), (3, 8)] {
            let free = vec![true; rows * cols];
            let grid =
                Grid::new(rows as u32, cols as u32, &free, Neighbors::Eight).expect("a grid");
            for cell in 0..(rows * cols) as u32 {
                let place = grid.place(cell);
                assert_eq!(grid.cell(place), cell);
                let near: Vec<u32> = directions(grid.exits(place))
                    .map(|direction| grid.cell(grid.step(place, direction)))
                    .collect();
                for other in 0..(rows * cols) as u32 {
                    let apart = grid.apart(place, grid.place(other));
                    let expected = apart.0.max(apart.1) == 1;
                    assert_eq!(
                        near.contains(&other),
                        expected,
                        "{rows}x{cols} {cell} {other}"
                    );
                }
            }
        }
    }

    #[test]
    fn changes_reach_the_neighbours() {
        for neighbors in [Neighbors::Four, Neighbors::Eight] {
            let mut changed = grid(&["...", "...", "..."], neighbors);
            assert!(changed.set_free(4, false));
            assert!(!changed.set_free(4, false));
            let fresh = grid(&["...", ".#.", "..."], neighbors);
            assert_eq!(changed.exits, fresh.exits);
            assert!(!changed.set_free(9, true));
        }
    }

    #[test]
    fn one_way_streets_are_left_and_entered_in_one_direction() {
        // East along the first row, south in the last column, and diagonally down to the right.
        let masks = [0x22, 0x04, 0x00, 0x00];
        let mut grid = grid(&["..", ".."], Neighbors::Eight).with_moves(&masks);
        let masks = |grid: &Grid, cell: u32| {
            let place = grid.place(cell);
            (grid.exits(place), grid.entries(place))
        };
        assert_eq!(masks(&grid, 0), (1 << EAST | 1 << SOUTH_EAST, 0));
        assert_eq!(masks(&grid, 1), (1 << SOUTH, 1 << WEST));
        assert_eq!(masks(&grid, 3), (0, 1 << NORTH | 1 << NORTH_WEST));
        assert!(grid.set_free(1, false));
        assert_eq!(masks(&grid, 0), (0, 0));
        assert_eq!(masks(&grid, 3), (0, 0));
        assert!(grid.set_free(1, true));
        assert_eq!(masks(&grid, 3), (0, 1 << NORTH | 1 << NORTH_WEST));
    }

    #[test]
    fn odd_sizes_are_refused() {
        assert!(Grid::new(0, 3, &[], Neighbors::Four).is_none());
        assert!(Grid::new(2, 2, &[true; 3], Neighbors::Four).is_none());
        assert!(Grid::new(u32::MAX, u32::MAX, &[true], Neighbors::Four).is_none());
    }

    #[test]
    fn opposites_are_opposite() {
        for direction in 0..8 {
            let ((row, col), back) = (
                DELTAS[direction as usize],
                DELTAS[opposite(direction) as usize],
            );
            assert_eq!((-row, -col), back);
        }
    }
}
