//! Warehouses: blocks of shelves between aisles, with free space at both sides.
//!
//! The layout is that of the `warehouse-A-B-C-D-E` maps of the MAPF benchmarks
//! (Stern et al. 2019), deduced from the maps: A blocks of shelves beside and B
//! above each other, a block C cells wide and D cells high, aisles of E cells, a
//! wall of one cell all around, and at the left and right a free margin of a
//! quarter of all shelf cells of a row, A·C/4. The same numbers give the same
//! bytes.

use fleetyard_core::{Grid, InputError};

use crate::canvas::{Canvas, at_least};

/// The parameters of a warehouse. There is nothing random in it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WarehouseSpec {
    /// Blocks of shelves beside each other (A).
    pub blocks_across: u32,
    /// Blocks of shelves above each other (B).
    pub blocks_down: u32,
    /// Width of a block in cells (C).
    pub block_cols: u32,
    /// Height of a block in cells (D).
    pub block_rows: u32,
    /// Width of aisles in cells (E).
    pub aisle: u32,
    /// Free columns at the left and right; A·C/4 if not given.
    pub margin: Option<u32>,
}

impl WarehouseSpec {
    /// `warehouse-A-B-C-D-E`, and `-mMARGIN` if the margin is given.
    pub fn name(&self) -> String {
        let margin = self
            .margin
            .map_or(String::new(), |margin| format!("-m{margin}"));
        format!(
            "warehouse-{}-{}-{}-{}-{}{margin}",
            self.blocks_across, self.blocks_down, self.block_cols, self.block_rows, self.aisle
        )
    }

    /// The map.
    pub fn generate(&self) -> Result<Grid, InputError> {
        for (what, value) in [
            ("blocks-across", self.blocks_across),
            ("blocks-down", self.blocks_down),
            ("block-cols", self.block_cols),
            ("block-rows", self.block_rows),
            ("aisle", self.aisle),
        ] {
            at_least(what, value, 1)?;
        }
        let [across, down, width, height, aisle] = [
            self.blocks_across,
            self.blocks_down,
            self.block_cols,
            self.block_rows,
            self.aisle,
        ]
        .map(u128::from);
        let margin = self.margin.map_or(across * width / 4, u128::from);
        if margin == 0 {
            return Err(
                InputError::new("margin", "the warehouse has no free margin")
                    .hint("give a margin of 1 or more, or more shelves"),
            );
        }
        let cols = 2 + 2 * margin + across * width + (across - 1) * aisle;
        let rows = 2 + down * height + (down + 1) * aisle;
        let (Ok(rows), Ok(cols)) = (u32::try_from(rows), u32::try_from(cols)) else {
            return Err(InputError::new(
                "blocks-across",
                format!("a warehouse of {rows} rows and {cols} columns is too large"),
            )
            .hint(format!("a map has at most {} cells", Grid::MAX_CELLS)));
        };
        let mut canvas = Canvas::new(rows, cols, b'T')?;
        canvas.fill(1, 1, rows - 2, cols - 2, b'.');
        let margin = margin as u32;
        for down in 0..self.blocks_down {
            let row = 1 + self.aisle + down * (self.block_rows + self.aisle);
            for across in 0..self.blocks_across {
                let col = 1 + margin + across * (self.block_cols + self.aisle);
                canvas.fill(row, col, self.block_rows, self.block_cols, b'T');
            }
        }
        canvas.grid(self.name())
    }
}
