//! Cells of one side laid over a world.

use fleetyard_core::{Connectivity, Grid, InputError, move_step};
use fleetyard_world::Bounds;

/// Rows and columns of cells that cover the box around a world from its lower left corner; the last
/// ones may reach over it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Frame {
    pub(crate) corner_m: [f64; 2],
    pub(crate) cell_m: f64,
    pub(crate) cols: u32,
    pub(crate) rows: u32,
}

impl Frame {
    /// Refuses cells that are no size, or that are too many.
    pub(crate) fn over(bounds: &Bounds, cell_m: f64, source: &str) -> Result<Self, InputError> {
        if !(cell_m.is_finite() && cell_m > 0.0) {
            let reason = format!("cells cannot have sides of {cell_m} m");
            return Err(InputError::new(source, reason).hint("give the side in metres"));
        }
        // A length that is a whole number of cells but for rounding has no cell more.
        let count = |axis: usize| ((bounds.max[axis] - bounds.min[axis]) / cell_m - 1e-9).ceil();
        let [cols, rows] = [count(0).max(1.0), count(1).max(1.0)];
        if cols * rows > Grid::MAX_CELLS as f64 {
            let reason = format!("the grid has {cols} by {rows} cells of {cell_m} m, too many");
            return Err(InputError::new(source, reason)
                .hint("use larger cells or robots, or a smaller world"));
        }
        Ok(Self {
            corner_m: bounds.min,
            cell_m,
            cols: cols as u32,
            rows: rows as u32,
        })
    }

    /// Number of cells.
    pub(crate) fn cells(&self) -> usize {
        self.rows as usize * self.cols as usize
    }

    /// The cell in a column and in a row that is counted from below.
    pub(crate) fn cell(&self, up: u32, col: u32) -> u32 {
        (self.rows - 1 - up) * self.cols + col
    }

    /// The middle of a cell, in metres.
    pub(crate) fn center_m(&self, cell: u32) -> [f64; 2] {
        let (row, col) = self.row_col(cell);
        let middle = |axis: usize, number: u32| {
            self.corner_m[axis] + (f64::from(number) + 0.5) * self.cell_m
        };
        [middle(0, col), middle(1, self.rows - 1 - row)]
    }

    /// Row and column of a cell.
    pub(crate) fn row_col(&self, cell: u32) -> (u32, u32) {
        (cell / self.cols, cell % self.cols)
    }

    /// The cells beside a cell, in the order of the bits of masks of moves.
    pub(crate) fn beside(
        &self,
        cell: u32,
        connectivity: Connectivity,
    ) -> impl Iterator<Item = u32> {
        let (row, col) = self.row_col(cell);
        let steps = (0..connectivity.degree()).map(move_step);
        steps.filter_map(move |(rows, cols)| {
            let row = row.checked_add_signed(rows.into())?;
            let col = col.checked_add_signed(cols.into())?;
            (row < self.rows && col < self.cols).then_some(row * self.cols + col)
        })
    }

    fn column_and_up(&self, point: [f64; 2]) -> [u32; 2] {
        let most = [self.cols, self.rows];
        [0, 1].map(|axis| {
            let at = (point[axis] - self.corner_m[axis]) / self.cell_m;
            (at as u32).min(most[axis] - 1)
        })
    }

    /// The cell that contains a place of the world, and how far its centre is.
    pub(crate) fn snap(&self, point: [f64; 2]) -> (u32, f64) {
        let [col, up] = self.column_and_up(point);
        let middle = [col, up].map(|number| (f64::from(number) + 0.5) * self.cell_m);
        let (x, y) = (
            point[0] - self.corner_m[0] - middle[0],
            point[1] - self.corner_m[1] - middle[1],
        );
        (self.cell(up, col), (x * x + y * y).sqrt())
    }

    /// The cells through which a straight line goes, in order, each beside the one before
    /// (Amanatides and Woo 1987). Through a corner it goes by the cell in the same row.
    pub(crate) fn line(&self, from: [f64; 2], to: [f64; 2]) -> Vec<u32> {
        let (mut at, end) = (self.column_and_up(from), self.column_and_up(to));
        let mut cells = vec![self.cell(at[1], at[0])];
        // The share of the way at which the line leaves the cell along an axis.
        let share = |axis: usize, at: u32| {
            let edge = f64::from(at) + f64::from(u8::from(end[axis] > at));
            let edge = self.corner_m[axis] + edge * self.cell_m;
            (edge - from[axis]) / (to[axis] - from[axis])
        };
        while at != end {
            let by_col = at[0] != end[0] && (at[1] == end[1] || share(0, at[0]) <= share(1, at[1]));
            let axis = usize::from(!by_col);
            at[axis] = if at[axis] < end[axis] {
                at[axis] + 1
            } else {
                at[axis] - 1
            };
            cells.push(self.cell(at[1], at[0]));
        }
        cells
    }
}
