//! Positions of cells in the world.
//!
//! Grid rows grow down; world y grows up. The map's lower left corner is the world's
//! origin, so that a map of R rows, C columns and cell side a spans
//! [0, C·a] × [0, R·a] metres.

use crate::Grid;

/// Centre of a cell in metres, x right and y up. The cell must be on the map.
pub fn cell_center_m(grid: &Grid, cell_size_m: f64, cell: u32) -> (f64, f64) {
    let (row, col) = grid.row_col(cell);
    let x = (f64::from(col) + 0.5) * cell_size_m;
    let y = (f64::from(grid.rows() - 1 - row) + 0.5) * cell_size_m;
    (x, y)
}

/// The cell that contains a point given in metres, if one does.
pub fn cell_of_point(grid: &Grid, cell_size_m: f64, x: f64, y: f64) -> Option<u32> {
    let (col, up) = ((x / cell_size_m).floor(), (y / cell_size_m).floor());
    let on_map =
        col >= 0.0 && up >= 0.0 && col < f64::from(grid.cols()) && up < f64::from(grid.rows());
    on_map.then(|| (grid.rows() - 1 - up as u32) * grid.cols() + col as u32)
}
