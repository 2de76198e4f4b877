//! Shortest paths of one agent, ignoring all others: the distances behind
//! lower bounds and scenario files.
//!
//! A* (Hart, Nilsson and Raphael 1968) with the exact distance on an empty map
//! as heuristic. It only gives lengths, so ties need no rule: the result does
//! not depend on the order of expansion.

use std::collections::BinaryHeap;

use crate::{Connectivity, Grid};

/// The length of a path as numbers of straight and diagonal moves, which is
/// exact where a float is not.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct OctileLength {
    /// Moves north, east, south or west.
    pub straight: u32,
    /// Diagonal moves.
    pub diagonal: u32,
}

impl OctileLength {
    /// Length in cells: 1 for a straight and √2 for a diagonal move.
    pub fn cells(self) -> f64 {
        f64::from(self.straight) + f64::from(self.diagonal) * std::f64::consts::SQRT_2
    }
}

/// Finds shortest path lengths on one grid, keeping its memory between queries.
#[derive(Debug, Clone)]
pub struct GridSearch {
    /// Columns with a border all around, so that the neighbours of cells are cells.
    stride: usize,
    cols: u32,
    passable: Vec<bool>,
    /// Allowed moves per cell.
    moves: Vec<u8>,
    /// Best length so far per cell, valid if `stamp` is the current query.
    best: Vec<OctileLength>,
    stamp: Vec<u32>,
    closed: Vec<bool>,
    query: u32,
    buckets: [Vec<(u32, u32)>; 3],
    heap: BinaryHeap<Open>,
}

/// An entry of the octile search's open list: the least estimate comes first,
/// among equals the one nearest to its goal.
#[derive(Debug, Clone, Copy)]
struct Open {
    estimate: f64,
    /// `length` as a number, kept for comparing.
    depth: f64,
    length: OctileLength,
    cell: u32,
}

impl Ord for Open {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        let deeper = self.depth.total_cmp(&other.depth);
        let cheaper = other.estimate.total_cmp(&self.estimate);
        cheaper.then(deeper).then(other.cell.cmp(&self.cell))
    }
}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Open {}

impl GridSearch {
    /// Prepares searches on `grid`.
    pub fn new(grid: &Grid) -> Self {
        let stride = grid.cols() as usize + 2;
        let cells = stride * (grid.rows() as usize + 2);
        let (mut passable, mut moves) = (vec![false; cells], vec![0; cells]);
        for cell in 0..grid.cell_count() {
            let (row, col) = grid.row_col(cell);
            let padded = (row as usize + 1) * stride + col as usize + 1;
            passable[padded] = grid.is_passable(cell);
            moves[padded] = grid.move_mask(cell, Connectivity::Eight);
        }
        Self {
            stride,
            cols: grid.cols(),
            passable,
            moves,
            best: vec![OctileLength::default(); cells],
            stamp: vec![0; cells],
            closed: vec![false; cells],
            query: 0,
            buckets: Default::default(),
            heap: BinaryHeap::new(),
        }
    }

    /// Fewest moves from a cell to another; `None` if one is not passable or
    /// there is no path.
    pub fn steps(&mut self, from: u32, to: u32, connectivity: Connectivity) -> Option<u32> {
        let (from, to) = (self.padded(from)?, self.padded(to)?);
        let stride = self.stride;
        let (to_row, to_col) = (to / stride, to % stride);
        let estimate = |cell: usize| {
            let rows = (cell / stride).abs_diff(to_row) as u32;
            let cols = (cell % stride).abs_diff(to_col) as u32;
            match connectivity {
                Connectivity::Four => rows + cols,
                Connectivity::Eight => rows.max(cols),
            }
        };
        self.begin();
        self.buckets.iter_mut().for_each(Vec::clear);
        // An estimate grows by 0, 1 or 2 with a step and never falls, so three
        // stacks in turn are a priority queue.
        let mut current = estimate(from);
        self.improve(from, OctileLength::default());
        self.buckets[current as usize % 3].push((from as u32, 0));
        let mut empty = 0;
        while empty < 3 {
            let Some((cell, steps)) = self.buckets[current as usize % 3].pop() else {
                current += 1;
                empty += 1;
                continue;
            };
            empty = 0;
            let cell = cell as usize;
            if cell == to {
                return Some(steps);
            }
            if std::mem::replace(&mut self.closed[cell], true) {
                continue;
            }
            for (next, _) in neighbors(stride, cell, self.moves[cell] & connectivity.mask()) {
                let length = OctileLength {
                    straight: steps + 1,
                    diagonal: 0,
                };
                if self.improve(next, length) {
                    let bucket = (steps + 1 + estimate(next)) as usize % 3;
                    self.buckets[bucket].push((next as u32, steps + 1));
                }
            }
        }
        None
    }

    /// The shortest path on the eight-connected grid by length, √2 per diagonal
    /// move; `None` if one cell is not passable or there is no path.
    pub fn octile(&mut self, from: u32, to: u32) -> Option<OctileLength> {
        let (from, to) = (self.padded(from)?, self.padded(to)?);
        let stride = self.stride;
        let (to_row, to_col) = (to / stride, to % stride);
        let estimate = |cell: usize, length: OctileLength| {
            let rows = (cell / stride).abs_diff(to_row) as u32;
            let cols = (cell % stride).abs_diff(to_col) as u32;
            let total = OctileLength {
                straight: length.straight + rows.abs_diff(cols),
                diagonal: length.diagonal + rows.min(cols),
            };
            total.cells()
        };
        self.begin();
        self.heap.clear();
        let zero = OctileLength::default();
        self.improve(from, zero);
        self.heap.push(Open {
            estimate: estimate(from, zero),
            depth: 0.0,
            length: zero,
            cell: from as u32,
        });
        while let Some(Open { length, cell, .. }) = self.heap.pop() {
            let cell = cell as usize;
            if cell == to {
                return Some(length);
            }
            if std::mem::replace(&mut self.closed[cell], true) {
                continue;
            }
            for (next, is_diagonal) in neighbors(stride, cell, self.moves[cell]) {
                let next_length = OctileLength {
                    straight: length.straight + u32::from(!is_diagonal),
                    diagonal: length.diagonal + u32::from(is_diagonal),
                };
                if self.improve(next, next_length) {
                    self.heap.push(Open {
                        estimate: estimate(next, next_length),
                        depth: next_length.cells(),
                        length: next_length,
                        cell: next as u32,
                    });
                }
            }
        }
        None
    }

    /// The padded index of a passable cell.
    fn padded(&self, cell: u32) -> Option<usize> {
        let (row, col) = ((cell / self.cols) as usize, (cell % self.cols) as usize);
        let padded = (row + 1) * self.stride + col + 1;
        self.passable.get(padded).filter(|free| **free)?;
        Some(padded)
    }

    fn begin(&mut self) {
        self.query = self.query.wrapping_add(1);
        if self.query == 0 {
            self.stamp.fill(0);
            self.query = 1;
        }
    }

    /// Records a length if it is the first or shortest to `cell` in this query.
    fn improve(&mut self, cell: usize, length: OctileLength) -> bool {
        let first = self.stamp[cell] != self.query;
        if first {
            self.stamp[cell] = self.query;
            self.closed[cell] = false;
        }
        let better = first || length.cells() < self.best[cell].cells();
        if better {
            self.best[cell] = length;
        }
        better
    }
}

/// The cells to which a mask of moves leads, and whether by a diagonal one.
fn neighbors(stride: usize, cell: usize, mut mask: u8) -> impl Iterator<Item = (usize, bool)> {
    // In the order of the bits of masks.
    let to = [
        cell - stride,
        cell + 1,
        cell + stride,
        cell - 1,
        cell - stride + 1,
        cell + stride + 1,
        cell + stride - 1,
        cell - stride - 1,
    ];
    core::iter::from_fn(move || {
        let bit = mask.trailing_zeros() as usize;
        mask &= mask.wrapping_sub(1);
        to.get(bit).map(|to| (*to, bit >= 4))
    })
}
