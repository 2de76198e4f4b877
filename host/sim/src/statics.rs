//! The static world: solid cells, as a bitmap and as rectangles.

use fleetyard_core::Grid;

use crate::event::{Change, EventKind, Other};
use crate::track::{Span, Track};
use fleetyard_world::{Inside, Relative, Vector};

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

    /// True if no solid cell shares more than an edge with a box.
    pub(crate) fn box_is_clear(&self, left: f64, bottom: f64, right: f64, top: f64) -> bool {
        let cols = self.columns(left)..=self.columns(right);
        let (high, low) = (self.rows_up(top), self.rows_up(bottom));
        (self.rows - 1 - high..=self.rows - 1 - low).all(|row| {
            cols.clone()
                .all(|col| !self.is_solid(row * self.cols + col))
        })
    }

    /// Visits every solid cell that intersects a box, in ascending order, with its
    /// centre.
    pub(crate) fn each_solid(
        &self,
        [left, bottom, right, top]: [f64; 4],
        mut visit: impl FnMut(u32, (f64, f64)),
    ) {
        let cols = self.columns(left)..=self.columns(right);
        let (high, low) = (self.rows_up(top), self.rows_up(bottom));
        for row in self.rows - 1 - high..=self.rows - 1 - low {
            for col in cols.clone() {
                let cell = row * self.cols + col;
                if self.is_solid(cell) {
                    let x = (f64::from(col) + 0.5) * self.cell;
                    let y = (f64::from(self.rows - 1 - row) + 0.5) * self.cell;
                    visit(cell, (x, y));
                }
            }
        }
    }

    /// Column of a place, clamped to the map.
    fn columns(&self, x: f64) -> u32 {
        (x / self.cell).floor().clamp(0.0, f64::from(self.cols - 1)) as u32
    }

    /// Row of a place, counted from below.
    fn rows_up(&self, y: f64) -> u32 {
        (y / self.cell).floor().clamp(0.0, f64::from(self.rows - 1)) as u32
    }

    /// Finds the begins and ends of a disc's overlaps with solid cells on its track
    /// through a block, span by span.
    pub(crate) fn sweep_track(
        &self,
        agent: u32,
        track: Track<'_>,
        first: bool,
        radius: f64,
        changes: &mut Vec<Change>,
    ) {
        for at in 1..track.t.len() {
            let span = Span {
                start: track.t[at - 1],
                end: track.t[at],
            };
            let way = Relative {
                start: track.place(at - 1),
                end: track.place(at),
            };
            self.sweep(agent, way, span, first && at == 1, radius, changes);
        }
    }

    /// Finds the begins and ends of an agent's overlaps with solid cells in a span. The
    /// cell of a begin is the first one met, the cell of an end the last one left; the
    /// lowest index wins ties.
    pub(crate) fn sweep(
        &self,
        agent: u32,
        way: Relative,
        span: Span,
        first: bool,
        radius: f64,
        changes: &mut Vec<Change>,
    ) {
        let (low, high) = way.start.inf_sup(&way.end);
        let around = [
            low.x - radius,
            low.y - radius,
            high.x + radius,
            high.y + radius,
        ];
        let half = 0.5 * self.cell;
        let mut met: Vec<(Inside, u32)> = Vec::new();
        self.each_solid(around, |cell, (x, y)| {
            let seen = way.seen_from(Vector::new(x, y));
            if let Some(inside) = seen.inside_square(half, radius) {
                met.push((inside, cell));
            }
        });
        report_union(
            &mut met,
            agent,
            span,
            first,
            |cell| Other::Obstacle { cell },
            changes,
        );
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

/// Reports a contact with a thing of several parts, given the overlaps with each part: it
/// begins when the first part is met and ends when the last is left. Parts come in
/// ascending order.
pub(crate) fn report_union(
    met: &mut [(Inside, u32)],
    agent: u32,
    span: Span,
    first: bool,
    other: impl Fn(u32) -> Other,
    changes: &mut Vec<Change>,
) {
    // The sort is stable: in ties the part of the lowest index counts.
    met.sort_by(|a, b| a.0.enter.total_cmp(&b.0.enter));
    let mut rest = met.iter().copied();
    let Some((mut whole, mut begin_part)) = rest.next() else {
        return;
    };
    let mut end_part = begin_part;
    let mut report = |whole: &Inside, begin_part: u32, end_part: u32| {
        if first || !whole.at_start {
            let when = span.at(whole.enter);
            changes.push(Change::new(
                when,
                EventKind::Begin,
                agent,
                other(begin_part),
            ));
        }
        if !whole.at_end {
            let when = span.at(whole.leave);
            changes.push(Change::new(when, EventKind::End, agent, other(end_part)));
        }
    };
    for (inside, part) in rest {
        if inside.enter > whole.leave {
            report(&whole, begin_part, end_part);
            (whole, begin_part, end_part) = (inside, part, part);
            continue;
        }
        whole.at_start |= inside.at_start;
        whole.at_end |= inside.at_end;
        if inside.leave > whole.leave {
            whole.leave = inside.leave;
            end_part = part;
        }
    }
    report(&whole, begin_part, end_part);
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

        /// Ways from cell to cell that the quick test finds clear are clear.
        #[test]
        fn clear_ways_meet_nothing(grid in maps(), cell_size_m in 0.1..10.0f64) {
            let statics = Statics::new(&grid, cell_size_m);
            let span = Span { start: 0.0, end: 1.0 };
            let radius = (0.5 - 1e-6) * cell_size_m;
            for from in 0..grid.cell_count() {
                for to in 0..grid.cell_count() {
                    let (x0, y0) = cell_center_m(&grid, cell_size_m, from);
                    let (x1, y1) = cell_center_m(&grid, cell_size_m, to);
                    let way = Relative { start: Vector::new(x0, y0), end: Vector::new(x1, y1) };
                    let (mut swept, mut glanced) = (Vec::new(), Vec::new());
                    statics.sweep(0, way, span, true, radius, &mut swept);
                    let (t, x, y) = ([0.0, 1.0], [x0, x1], [y0, y1]);
                    let track = Track { t: &t, x: &x, y: &y, heading: &[] };
                    statics.sweep_track(0, track, true, radius, &mut glanced);
                    prop_assert_eq!(swept, glanced);
                }
            }
        }
    }
}
