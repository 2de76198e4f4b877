//! A map while it is being drawn.

use fleetyard_core::document::between;
use fleetyard_core::{Grid, InputError};
use serde::Deserializer;

/// Terrain letters on a rectangle of checked size.
pub(crate) struct Canvas {
    pub(crate) rows: u32,
    pub(crate) cols: u32,
    terrain: Vec<u8>,
}

impl Canvas {
    pub(crate) fn new(rows: u32, cols: u32, letter: u8) -> Result<Self, InputError> {
        check_size(rows, cols)?;
        Ok(Self {
            rows,
            cols,
            terrain: vec![letter; rows as usize * cols as usize],
        })
    }

    /// Sets a cell; outside the canvas nothing happens.
    pub(crate) fn set(&mut self, row: u32, col: u32, letter: u8) {
        if row < self.rows && col < self.cols {
            self.terrain[row as usize * self.cols as usize + col as usize] = letter;
        }
    }

    /// Sets a rectangle of cells, cut at the canvas.
    pub(crate) fn fill(&mut self, row: u32, col: u32, rows: u32, cols: u32, letter: u8) {
        for row in row..row.saturating_add(rows).min(self.rows) {
            for col in col..col.saturating_add(cols).min(self.cols) {
                self.set(row, col, letter);
            }
        }
    }

    pub(crate) fn set_cell(&mut self, cell: u32, letter: u8) {
        self.terrain[cell as usize] = letter;
    }

    pub(crate) fn grid(self, name: String) -> Result<Grid, InputError> {
        Grid::new(name, self.rows, self.cols, self.terrain)
    }
}

/// Refuses sizes that a map may not have.
pub(crate) fn check_size(rows: u32, cols: u32) -> Result<(), InputError> {
    for (what, size) in [("rows", rows), ("cols", cols)] {
        at_least(what, size, 1)?;
    }
    if u64::from(rows) * u64::from(cols) <= Grid::MAX_CELLS {
        return Ok(());
    }
    Err(InputError::new(
        "rows",
        format!("a map of {rows} rows and {cols} columns is too large"),
    )
    .hint(format!("a map has at most {} cells", Grid::MAX_CELLS)))
}

pub(crate) fn at_least(what: &str, value: u32, least: u32) -> Result<(), InputError> {
    if value >= least {
        return Ok(());
    }
    Err(InputError::new(what, format!("{what} is {value}"))
        .hint(format!("{what} is a whole number of {least} or more")))
}

/// Reads a number of cells, at least one.
pub(crate) fn cells<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
    between::<1, { u32::MAX as u64 }, u32, _, _>(deserializer)
}

/// One of what comes in several.
pub(crate) fn one() -> u32 {
    1
}
