//! The classic mistake with somebody else's paths: x,y read as row,column.

use super::MapSize;
use crate::{GridPlan, OFF_MAP};

/// The hint for a plan that [`looks_transposed`].
pub const TRANSPOSED_HINT: &str = "rows and columns look swapped: with the two exchanged, every \
     agent begins at its start; is the file in x,y order where row,column is expected, or the \
     other way round?";

/// True if a plan that does not begin at the starts would, if rows and columns of all its positions
/// were exchanged.
///
/// A position whose exchange is not on the map was read as [`OFF_MAP`]. It fits, but
/// at least one agent must be seen at the exchange of its start.
pub fn looks_transposed(size: MapSize, starts: &[u32], plan: &GridPlan) -> bool {
    let MapSize { rows, cols } = size;
    if cols == 0 || plan.agents() != starts.len() {
        return false;
    }
    let mut seen = false;
    for (path, start) in plan.paths().zip(starts) {
        let (row, col) = (start / cols, start % cols);
        let exchanged = if col < rows && row < cols {
            col * cols + row
        } else {
            OFF_MAP
        };
        if path.first() != Some(&exchanged) {
            return false;
        }
        seen |= exchanged != OFF_MAP && exchanged != *start;
    }
    seen
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_an_exchange_of_all_starts_is_one() {
        let size = MapSize { rows: 2, cols: 4 };
        // Row 0, column 1; row 1, column 1; row 1, column 3.
        let starts = [1, 5, 7];
        let cases: [(&[u32], bool); 7] = [
            // Column 3 is no row of this map.
            (&[4, 5, OFF_MAP], true),
            (&[1, 5, 7], false),
            (&[4, 5, 7], false),
            (&[OFF_MAP, 5, OFF_MAP], false),
            (&[4, 5], false),
            (&[4, 5, OFF_MAP, 4], false),
            (&[], false),
        ];
        for (firsts, expected) in cases {
            let plan = GridPlan::from_paths(firsts.iter().map(|cell| [*cell, 0]));
            assert_eq!(
                looks_transposed(size, &starts, &plan),
                expected,
                "{firsts:?}"
            );
        }
        // Starts on the diagonal look the same either way.
        let plan = GridPlan::from_paths([[5]]);
        assert!(!looks_transposed(size, &[5], &plan));
        let empty = GridPlan::from_paths([[], []] as [[u32; 0]; 2]);
        assert!(!looks_transposed(size, &[1, 2], &empty));
    }
}
