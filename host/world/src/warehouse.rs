//! Warehouses: blocks of shelves between aisles, with free space at both sides.
//!
//! The layout is that of the `warehouse-A-B-C-D-E` maps of the MAPF benchmarks
//! (Stern et al. 2019), deduced from the maps: A blocks of shelves beside and B
//! above each other, a block C cells wide and D cells high, aisles of E cells, a
//! wall of one cell all around, and at the left and right a free margin of a
//! quarter of all shelf cells of a row, A·C/4. The same numbers give the same
//! bytes.
//!
//! Cells may have roles, as in the maps of LSMART: the free cells above and below
//! shelves are endpoints, and workstations stand at the left and right borders.

use fleetyard_core::{Grid, InputError, Role};
use serde::{Deserialize, Serialize};

use crate::canvas::{Canvas, at_least, cells};

/// The parameters of a warehouse. There is nothing random in it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WarehouseSpec {
    /// Blocks of shelves beside each other (A).
    #[serde(deserialize_with = "cells")]
    pub blocks_across: u32,
    /// Blocks of shelves above each other (B).
    #[serde(deserialize_with = "cells")]
    pub blocks_down: u32,
    /// Width of a block in cells (C).
    #[serde(deserialize_with = "cells")]
    pub block_cols: u32,
    /// Height of a block in cells (D).
    #[serde(deserialize_with = "cells")]
    pub block_rows: u32,
    /// Width of aisles in cells (E).
    #[serde(deserialize_with = "cells")]
    pub aisle: u32,
    /// Free columns at the left and right; A·C/4 if not given.
    pub margin: Option<u32>,
    /// Height of the aisles between blocks above each other; E if not given.
    pub aisle_rows: Option<u32>,
    /// Free rows at the top and bottom; as between blocks if not given.
    pub edge_rows: Option<u32>,
    /// Without the wall all around.
    #[serde(default)]
    pub open: bool,
    /// True if the free cells above and below shelves are endpoints.
    #[serde(default)]
    pub endpoints: bool,
    /// Rows from a workstation to the next, in the middle of the outermost free columns;
    /// without workstations if not given.
    pub workstations: Option<u32>,
}

impl WarehouseSpec {
    /// `warehouse-A-B-C-D-E`, and after it what else is given: `-m` and the margin, `-a` and
    /// the rows of aisles, `-b` and those at the borders, `-open`, `-e` for endpoints, `-w` and
    /// the rows between workstations.
    pub fn name(&self) -> String {
        let given = |letter: char, number: Option<u32>| {
            number.map_or(String::new(), |number| format!("-{letter}{number}"))
        };
        let said = |text: &str, is: bool| if is { text } else { "" }.to_owned();
        let more = [
            given('m', self.margin),
            given('a', self.aisle_rows),
            given('b', self.edge_rows),
            said("-open", self.open),
            said("-e", self.endpoints),
            given('w', self.workstations),
        ];
        format!(
            "warehouse-{}-{}-{}-{}-{}{}",
            self.blocks_across,
            self.blocks_down,
            self.block_cols,
            self.block_rows,
            self.aisle,
            more.concat()
        )
    }

    /// Shelves of maps with roles are `@`, as LSMART writes them, else `T`, as the benchmarks.
    fn shelf(&self) -> u8 {
        if self.endpoints || self.workstations.is_some() {
            b'@'
        } else {
            b'T'
        }
    }

    /// The map.
    pub fn generate(&self) -> Result<Grid, InputError> {
        for (what, value) in [
            ("blocks-across", self.blocks_across),
            ("blocks-down", self.blocks_down),
            ("block-cols", self.block_cols),
            ("block-rows", self.block_rows),
            ("aisle", self.aisle),
            ("aisle-rows", self.aisle_rows.unwrap_or(1)),
            ("edge-rows", self.edge_rows.unwrap_or(1)),
            ("workstations", self.workstations.unwrap_or(1)),
        ] {
            at_least(what, value, 1)?;
        }
        let aisle_rows = self.aisle_rows.unwrap_or(self.aisle);
        let edge_rows = self.edge_rows.unwrap_or(aisle_rows);
        let wall = u32::from(!self.open);
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
        let (between, edge, walls) = (
            u128::from(aisle_rows),
            u128::from(edge_rows),
            u128::from(2 * wall),
        );
        let cols = walls + 2 * margin + across * width + (across - 1) * aisle;
        let rows = walls + 2 * edge + down * height + (down - 1) * between;
        let (Ok(rows), Ok(cols)) = (u32::try_from(rows), u32::try_from(cols)) else {
            return Err(InputError::new(
                "blocks-across",
                format!("a warehouse of {rows} rows and {cols} columns is too large"),
            )
            .hint(format!("a map has at most {} cells", Grid::MAX_CELLS)));
        };
        let shelf = self.shelf();
        let mut canvas = Canvas::new(rows, cols, shelf)?;
        canvas.fill(wall, wall, rows - 2 * wall, cols - 2 * wall, b'.');
        let margin = margin as u32;
        for down in 0..self.blocks_down {
            let row = wall + edge_rows + down * (self.block_rows + aisle_rows);
            for across in 0..self.blocks_across {
                let col = wall + margin + across * (self.block_cols + self.aisle);
                if self.endpoints {
                    // There is a free row at either side of a block, whatever the aisles.
                    let endpoint = Role::Endpoint.letter();
                    canvas.fill(row - 1, col, self.block_rows + 2, self.block_cols, endpoint);
                }
                canvas.fill(row, col, self.block_rows, self.block_cols, shelf);
            }
        }
        if let Some(every) = self.workstations {
            let inside = rows - 2 * wall;
            let first = wall + (inside - 1) % every / 2;
            for row in (first..rows - wall).step_by(every as usize) {
                for col in [wall, cols - 1 - wall] {
                    canvas.set(row, col, Role::Workstation.letter());
                }
            }
        }
        canvas.grid(self.name())
    }
}
