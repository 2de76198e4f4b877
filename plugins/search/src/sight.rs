//! Lines of sight between the centres of cells.
//!
//! A robot in the one cell sees the other when every cell whose inside the straight
//! line between the centres crosses is free, and every corner that it passes exactly
//! through is open. Decided in whole numbers: nothing is a matter of rounding.

use std::cmp::Ordering;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::grid::{Grid, Place};

/// Rule for a line that passes exactly through the corner where four cells meet, on its way from
/// one to the one opposite.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Corners {
    /// At least one of the other two cells has to be free.
    OneFree,
    /// Both have to be: no robot of any size touches an obstacle's corner.
    BothFree,
}

impl Corners {
    /// True if a line may pass a corner with these two cells beside it; `true` is a free cell.
    #[inline]
    pub(crate) fn open(self, one: bool, other: bool) -> bool {
        match self {
            Self::OneFree => one || other,
            Self::BothFree => one && other,
        }
    }
}

/// True if there is a line of sight between two free places.
pub(crate) fn visible(grid: &Grid, from: Place, to: Place, corners: Corners) -> bool {
    let ((row, col), (last_row, last_col)) = (grid.at(from), grid.at(to));
    let (rows, cols) = (row.abs_diff(last_row), col.abs_diff(last_col));
    let down = grid.place_at(1, 0);
    // One row or one column on, as an addition that may wrap.
    let by_row = if last_row < row {
        down.wrapping_neg()
    } else {
        down
    };
    let by_col = if last_col < col {
        1_u32.wrapping_neg()
    } else {
        1
    };
    let (rows, cols) = (i64::from(rows), i64::from(cols));
    let mut place = from;
    let (mut rows_left, mut cols_left) = (rows, cols);
    // The line leaves a cell through the side that it reaches first. With i rows and j
    // columns behind it, it reaches the next row at (2i + 1) / (2 · rows) of its way
    // and the next column at (2j + 1) / (2 · cols): the sign of their difference.
    let mut sooner = cols - rows;
    while rows_left > 0 || cols_left > 0 {
        match sooner.cmp(&0) {
            Ordering::Less => {
                place = place.wrapping_add(by_row);
                rows_left -= 1;
                sooner += 2 * cols;
            }
            Ordering::Greater => {
                place = place.wrapping_add(by_col);
                cols_left -= 1;
                sooner -= 2 * rows;
            }
            Ordering::Equal => {
                let beside = [place.wrapping_add(by_row), place.wrapping_add(by_col)];
                let [one, other] = beside.map(|place| grid.free_at(place));
                if !corners.open(one, other) {
                    return false;
                }
                place = beside[0].wrapping_add(by_col);
                rows_left -= 1;
                cols_left -= 1;
                sooner += 2 * (cols - rows);
            }
        }
        if !grid.free_at(place) {
            return false;
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Neighbors;

    fn sees(rows: &[&str], corners: Corners) -> bool {
        let text = rows.concat();
        let free: Vec<bool> = text.bytes().map(|letter| letter != b'#').collect();
        let grid = Grid::new(
            rows.len() as u32,
            rows[0].len() as u32,
            &free,
            Neighbors::Four,
        )
        .expect("a grid");
        let of = |letter| grid.place(text.find(letter).expect("a letter") as u32);
        let (a, b) = (of('a'), of('b'));
        let one = visible(&grid, a, b, corners);
        assert_eq!(visible(&grid, b, a, corners), one, "both ways");
        one
    }

    #[test]
    fn lines_cross_cells() {
        let loose = |rows: &[&str]| sees(rows, Corners::OneFree);
        assert!(loose(&["a...b"]));
        assert!(!loose(&["a.#.b"]));
        assert!(loose(&["a..", "..b"]));
        // From (0, 0) to (1, 2): the line crosses (0, 1) and (1, 1).
        assert!(!loose(&["a#.", "..b"]));
        assert!(!loose(&["a..", ".#b"]));
        assert!(loose(&["a.#", "#.b"]));
        assert!(loose(&["a", ".", "b"]));
    }

    #[test]
    fn corners_are_passed_or_not() {
        let open: &[&str] = &["a.", ".b"];
        let half: &[&str] = &["a#", ".b"];
        let shut: &[&str] = &["a#", "#b"];
        let judged = |corners| [open, half, shut].map(|rows| sees(rows, corners));
        assert_eq!(judged(Corners::OneFree), [true, true, false]);
        assert_eq!(judged(Corners::BothFree), [true, false, false]);
    }
}
