//! Maps of this project, `fleetyard.grid/1`: JSON with the rows of the map as texts, and the moves
//! that are allowed from each cell.
//!
//! ```json
//! {
//!   "format": "fleetyard.grid/1",
//!   "terrain": [
//!     "...",
//!     ".@."
//!   ],
//!   "moves": [
//!     "6ac",
//!     "101"
//!   ]
//! }
//! ```
//!
//! `terrain` has the letters of `.map` files. `moves` has for each cell a mask in one
//! hexadecimal digit, of straight moves alone, or in two; its bits are those of
//! [`Grid::move_mask`]. A mask allows nothing that the terrain forbids. Without `moves` all moves of
//! the terrain are allowed. The map is called after its file. Unknown keys are refused.

use std::fmt::Write as _;

use serde::Deserialize;
use serde::de::Deserializer;

use super::rows::{Rows, Text};
use crate::json::{self, push_lines, read_object};
use crate::{Grid, InputError, MovesError};

/// The value of `format`.
pub const GRID_FORMAT: &str = "fleetyard.grid/1";

const HINT: &str = "a map is a JSON object with format and terrain, such as \"..@.\", and moves";

const LETTERS: &str = "terrain letters are those of .map files: . is free, @ is not";

const MASKS: &str = "a mask is one or two hexadecimal digits: bit 0 is north, then east, south, west, north-east, \
                     south-east, south-west, north-west";

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a map: a JSON object")]
struct Document<'a> {
    #[serde(deserialize_with = "format", rename = "format")]
    _format: (),
    #[serde(borrow)]
    terrain: Vec<Text<'a>>,
    #[serde(borrow)]
    moves: Option<Vec<Text<'a>>>,
}

fn format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    json::format(deserializer, GRID_FORMAT)
}

/// Reads a map of this project. `source` is named in errors, and its stem becomes the map's name.
pub fn read_grid(source: &str, bytes: &[u8]) -> Result<Grid, InputError> {
    let document: Document<'_> = read_object(source, bytes, HINT)?;
    let terrain = Rows::new(source, bytes, "terrain", &document.terrain);
    let grid = terrain
        .map_err(|error| error.or_hint(HINT))?
        .grid(LETTERS)?;
    let Some(texts) = &document.moves else {
        return Ok(grid);
    };
    let moves = Rows::new(source, bytes, "moves", texts).map_err(|error| error.or_hint(MASKS))?;
    let (cols, digits) = (grid.cols(), moves.cols / grid.cols());
    if moves.count != grid.rows() || moves.cols % cols != 0 || !(1..=2).contains(&digits) {
        let reason = format!(
            "the moves have {} rows of {} digits, but the map has {} rows of {cols} cells",
            moves.count,
            moves.cols,
            grid.rows(),
        );
        return Err(moves.fault_at("moves", reason).hint(MASKS));
    }
    let letters = moves.letters("mask of moves", MASKS, |letter| letter.is_ascii_hexdigit())?;
    let digit = |letter: &u8| char::from(*letter).to_digit(16).unwrap_or(0) as u8;
    let mask = |digits: &[u8]| {
        digits
            .iter()
            .fold(0, |mask, letter| mask << 4 | digit(letter))
    };
    let masks = letters.chunks(digits as usize).map(mask).collect();
    grid.with_moves(masks).map_err(|error| {
        let fault = match error {
            MovesError::Impossible { row, col, .. } => {
                let at = (col * digits) as usize;
                moves.fault_in(&texts[row as usize], at, error.to_string())
            }
            MovesError::LengthMismatch { .. } => moves.fault_at("moves", error.to_string()),
        };
        fault.hint("a mask allows nothing that the terrain forbids: clear the bit")
    })
}

/// The content of a file with this map. Reading it gives the same map.
pub fn write_grid(grid: &Grid) -> Vec<u8> {
    let cols = grid.cols() as usize;
    let mut text = json::begin(GRID_FORMAT, &[]);
    text.reserve(4 * grid.terrain().len());
    push_lines(
        &mut text,
        "terrain",
        grid.terrain().chunks(cols),
        |text, row| {
            text.push('"');
            text.extend(row.iter().map(|letter| char::from(*letter)));
            text.push('"');
        },
    );
    if grid.has_move_masks() {
        let masks = grid.move_masks(crate::Connectivity::Eight);
        let digits = if masks.iter().all(|mask| *mask < 16) {
            1
        } else {
            2
        };
        text.push_str(",\n");
        push_lines(&mut text, "moves", masks.chunks(cols), |text, row| {
            text.push('"');
            for mask in row {
                // Writing to a string cannot fail.
                let _ = write!(text, "{mask:0digits$x}");
            }
            text.push('"');
        });
    }
    text.push_str("\n}\n");
    text.into_bytes()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Connectivity, read_map};

    fn file(rows: &str, moves: &str) -> String {
        format!(
            "{{\"format\": \"fleetyard.grid/1\",\n\"terrain\": [{rows}],\n\"moves\": [{moves}]}}"
        )
    }

    #[test]
    fn a_ring_that_is_driven_one_way() {
        let text = file(r#""...", ".@.", "...""#, r#""448", "2D4""#)
            .replace(r#""448", "2D4""#, r#""224", "104", "188""#);
        let grid = read_map("ring.map", text.as_bytes()).expect("a map");
        assert_eq!((grid.name(), grid.rows(), grid.cols()), ("ring", 3, 3));
        assert_eq!(
            grid.move_masks(Connectivity::Four),
            [2, 2, 4, 1, 0, 4, 1, 8, 8]
        );
        assert_eq!(
            grid.components(Connectivity::Four),
            [1, 1, 1, 1, 0, 1, 1, 1, 1]
        );
        assert_eq!(read_map("ring.map", &write_grid(&grid)).as_ref(), Ok(&grid));
        // All moves of the terrain are a plain map.
        let all = file(r#"".""#, r#""00""#);
        let all = read_map("a.map", all.as_bytes()).expect("a map");
        assert!(!all.has_move_masks());
    }

    #[test]
    fn what_is_wrong_has_its_place() {
        for (rows, moves, told) in [
            (
                r#""..""#,
                r#""12""#,
                "a.map:3:12: the mask of row 0, column 0 allows the move N, which leaves the map",
            ),
            (
                r#"".@""#,
                r#""0200""#,
                "a.map:3:12: the mask of row 0, column 0 allows the move E,",
            ),
            (
                r#""..""#,
                r#""2""#,
                "a.map:3:1: the moves have 1 rows of 1 digits, but the map has 1 rows of 2 cells",
            ),
            (
                r#""..""#,
                r#""28", "28""#,
                "a.map:3:1: the moves have 2 rows",
            ),
            (
                r#""..""#,
                r#""2g""#,
                "a.map:3:13: unknown mask of moves 'g' in row 0 of the moves",
            ),
            (
                r#""..", ".""#,
                r#""28""#,
                "a.map:2:21: row 1 of the terrain has 1 letters",
            ),
            ("", "", "a.map:2:1: the terrain has no rows"),
        ] {
            let error = read_map("a.map", file(rows, moves).as_bytes()).expect_err("a wrong map");
            assert!(error.to_string().starts_with(told), "{error}");
        }
    }
}
