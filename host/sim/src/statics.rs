//! The static world: which cells are solid, as a bitmap and as rectangles.

use fleetyard_core::Grid;
use fleetyard_world::{Inside, Relative};

use crate::bodies::{Bodies, Span};
use crate::event::{Change, EventKind, Other};

/// The solid cells of a grid in the world frame.
#[derive(Debug)]
pub(crate) struct Statics {
    rows: u32,
    cols: u32,
    cell: f64,
    solid: Vec<u64>,
}

/// Solid cells merged: columns `left..right` of rows `top..bottom`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Block {
    pub(crate) top: u32,
    pub(crate) bottom: u32,
    pub(crate) left: u32,
    pub(crate) right: u32,
}

impl Statics {
    pub(crate) fn new(grid: &Grid, cell_size_m: f64) -> Self {
        let mut solid = vec![0u64; (grid.cell_count() as usize).div_ceil(64)];
        for (cell, letter) in grid.terrain().iter().enumerate() {
            solid[cell / 64] |= u64::from(!Grid::letter_is_passable(*letter)) << (cell % 64);
        }
        Self {
            rows: grid.rows(),
            cols: grid.cols(),
            cell: cell_size_m,
            solid,
        }
    }

    pub(crate) fn is_solid(&self, cell: u32) -> bool {
        self.solid[cell as usize / 64] >> (cell % 64) & 1 == 1
    }

    /// Whether a disc of at most half a cell provably meets no solid cell on
    /// its straight way between the centres of two cells: they are the same,
    /// or neighbours, or diagonal neighbours, and all cells of the block that
    /// they span are free. The centre then stays half a cell away from
    /// everything outside the block.
    pub(crate) fn way_is_clear(&self, from: u32, to: u32) -> bool {
        if self.is_solid(from) || self.is_solid(to) {
            return false;
        }
        if from == to {
            return true;
        }
        let (row, col) = (from / self.cols, from % self.cols);
        let (to_row, to_col) = (to / self.cols, to % self.cols);
        match (row.abs_diff(to_row), col.abs_diff(to_col)) {
            (0, 1) | (1, 0) => true,
            (1, 1) => {
                !self.is_solid(row * self.cols + to_col) && !self.is_solid(to_row * self.cols + col)
            }
            _ => false,
        }
    }

    /// Finds where the disc of one agent begins and ends to overlap solid cells
    /// in a span. The cell of a beginning is the first one met, the cell of an
    /// end the last one left, and in ties the one of the lowest index.
    pub(crate) fn sweep(
        &self,
        agent: u32,
        bodies: &Bodies,
        span: Span,
        first: bool,
        radius: f64,
        changes: &mut Vec<Change>,
    ) {
        let at = agent as usize;
        let (x0, y0, x1, y1) = (bodies.x0[at], bodies.y0[at], bodies.x1[at], bodies.y1[at]);
        let index = |value: f64, count: u32| {
            (value / self.cell).floor().clamp(0.0, f64::from(count - 1)) as u32
        };
        let (left, right) = (
            index(x0.min(x1) - radius, self.cols),
            index(x0.max(x1) + radius, self.cols),
        );
        let (low, high) = (
            index(y0.min(y1) - radius, self.rows),
            index(y0.max(y1) + radius, self.rows),
        );
        let half = 0.5 * self.cell;
        let mut met: Vec<(Inside, u32)> = Vec::new();
        for row in self.rows - 1 - high..=self.rows - 1 - low {
            for col in left..=right {
                let cell = row * self.cols + col;
                if !self.is_solid(cell) {
                    continue;
                }
                let (cx, cy) = (
                    (f64::from(col) + 0.5) * self.cell,
                    (f64::from(self.rows - 1 - row) + 0.5) * self.cell,
                );
                let way = Relative {
                    x0: x0 - cx,
                    y0: y0 - cy,
                    x1: x1 - cx,
                    y1: y1 - cy,
                };
                if let Some(inside) = way.inside_square(half, radius) {
                    met.push((inside, cell));
                }
            }
        }
        // Cells come in ascending order and the sort is stable.
        met.sort_by(|a, b| a.0.enter.total_cmp(&b.0.enter));
        let mut rest = met.into_iter();
        let Some((mut whole, mut begin_cell)) = rest.next() else {
            return;
        };
        let mut end_cell = begin_cell;
        let mut report = |whole: &Inside, begin_cell: u32, end_cell: u32| {
            if first || !whole.at_start {
                let when = span.at(whole.enter);
                let other = Other::Obstacle { cell: begin_cell };
                changes.push(Change::new(when, EventKind::Begin, agent, other));
            }
            if !whole.at_end {
                let when = span.at(whole.leave);
                let other = Other::Obstacle { cell: end_cell };
                changes.push(Change::new(when, EventKind::End, agent, other));
            }
        };
        for (inside, cell) in rest {
            if inside.enter > whole.leave {
                report(&whole, begin_cell, end_cell);
                (whole, begin_cell, end_cell) = (inside, cell, cell);
                continue;
            }
            whole.at_start |= inside.at_start;
            whole.at_end |= inside.at_end;
            if inside.leave > whole.leave {
                whole.leave = inside.leave;
                end_cell = cell;
            }
        }
        report(&whole, begin_cell, end_cell);
    }

    /// The solid cell whose centre is nearest to a point, among those around it;
    /// the lowest index in ties.
    pub(crate) fn nearest_solid(&self, x: f64, y: f64) -> Option<u32> {
        let index = |value: f64, count: u32| {
            (value / self.cell).floor().clamp(0.0, f64::from(count - 1)) as i64
        };
        let (col, up) = (index(x, self.cols), index(y, self.rows));
        let row = i64::from(self.rows) - 1 - up;
        let mut best: Option<(f64, u32)> = None;
        for row in (row - 1).max(0)..=(row + 1).min(i64::from(self.rows) - 1) {
            for col in (col - 1).max(0)..=(col + 1).min(i64::from(self.cols) - 1) {
                let cell = row as u32 * self.cols + col as u32;
                let dx = (col as f64 + 0.5) * self.cell - x;
                let dy = (f64::from(self.rows - 1 - row as u32) + 0.5) * self.cell - y;
                let squared = dx * dx + dy * dy;
                if self.is_solid(cell) && best.is_none_or(|(least, _)| squared < least) {
                    best = Some((squared, cell));
                }
            }
        }
        best.map(|(_, cell)| cell)
    }

    /// The solid cells merged into rectangles: maximal runs of a row, joined
    /// with equal runs of the rows below. Every solid cell is in exactly one.
    pub(crate) fn blocks(&self) -> Vec<Block> {
        let mut done = Vec::new();
        let mut open: Vec<Block> = Vec::new();
        for row in 0..self.rows {
            let mut runs = Vec::new();
            let mut col = 0;
            while col < self.cols {
                let start = col;
                while col < self.cols && self.is_solid(row * self.cols + col) {
                    col += 1;
                }
                if col > start {
                    runs.push((start, col));
                }
                col += 1;
            }
            // Both lists are ordered by column; runs of a row never overlap.
            let mut above = open.into_iter().peekable();
            let mut next = Vec::with_capacity(runs.len());
            for (left, right) in runs {
                while let Some(block) = above.next_if(|block| block.left < left) {
                    done.push(block);
                }
                let same = above.next_if(|block| block.left == left);
                match same {
                    Some(block) if block.right == right => next.push(Block {
                        bottom: row + 1,
                        ..block
                    }),
                    other => {
                        done.extend(other);
                        next.push(Block {
                            top: row,
                            bottom: row + 1,
                            left,
                            right,
                        });
                    }
                }
            }
            done.extend(above);
            open = next;
        }
        done.extend(open);
        done
    }

    /// The cell of a block that is nearest to a point in metres.
    pub(crate) fn cell_in_block(&self, block: Block, x: f64, y: f64) -> u32 {
        let index = |value: f64, from: u32, to: u32| {
            (value / self.cell)
                .floor()
                .clamp(f64::from(from), f64::from(to - 1)) as u32
        };
        let col = index(x, block.left, block.right);
        let up = index(y, self.rows - block.bottom, self.rows - block.top);
        (self.rows - 1 - up) * self.cols + col
    }

    /// Centre and half extents of a block in metres.
    pub(crate) fn block_m(&self, block: Block) -> (f64, f64, f64, f64) {
        let (left, right) = (f64::from(block.left), f64::from(block.right));
        let bottom = f64::from(self.rows - block.bottom);
        let top = f64::from(self.rows - block.top);
        let half = 0.5 * self.cell;
        (
            (left + right) * half,
            (bottom + top) * half,
            (right - left) * half,
            (top - bottom) * half,
        )
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::convert::cell_center_m;

    fn maps() -> impl Strategy<Value = Grid> {
        (1u32..8, 1u32..8)
            .prop_flat_map(|(rows, cols)| {
                let cells = (rows * cols) as usize;
                let terrain = prop_oneof![Just(b'.'), Just(b'@')];
                (
                    Just((rows, cols)),
                    proptest::collection::vec(terrain, cells),
                )
            })
            .prop_map(|((rows, cols), terrain)| {
                Grid::new("random", rows, cols, terrain).expect("a valid map")
            })
    }

    proptest! {
        #[test]
        fn blocks_cover_solid_cells_once(grid in maps()) {
            let statics = Statics::new(&grid, 1.0);
            let mut covered = vec![0; grid.cell_count() as usize];
            for block in statics.blocks() {
                for row in block.top..block.bottom {
                    for col in block.left..block.right {
                        covered[(row * grid.cols() + col) as usize] += 1;
                    }
                }
            }
            for (cell, count) in covered.into_iter().enumerate() {
                prop_assert_eq!(count, i32::from(!grid.is_passable(cell as u32)));
            }
        }

        /// Clear ways are clear for the largest discs, and the others are not:
        /// a sweep from cell to cell touches something solid.
        #[test]
        fn clear_ways_meet_nothing(grid in maps(), cell_size_m in 0.1..10.0f64) {
            let statics = Statics::new(&grid, cell_size_m);
            let span = Span { start: 0.0, end: 1.0 };
            let radius = (0.5 - 1e-6) * cell_size_m;
            for from in 0..grid.cell_count() {
                for to in 0..grid.cell_count() {
                    let (x0, y0) = cell_center_m(&grid, cell_size_m, from);
                    let (x1, y1) = cell_center_m(&grid, cell_size_m, to);
                    let bodies = Bodies { x0: vec![x0], y0: vec![y0], x1: vec![x1], y1: vec![y1] };
                    let mut changes = Vec::new();
                    statics.sweep(0, &bodies, span, true, radius, &mut changes);
                    let (row, col) = grid.row_col(from);
                    let (to_row, to_col) = grid.row_col(to);
                    let near = row.abs_diff(to_row).max(col.abs_diff(to_col)) <= 1;
                    let clear = statics.way_is_clear(from, to);
                    prop_assert!(!clear || changes.is_empty());
                    prop_assert!(!near || clear == changes.is_empty());
                }
            }
        }
    }
}
