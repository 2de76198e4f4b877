//! Maps of LSMART (smart-mapf/lifelong-smart): JSON with the rows of the map as texts.
//!
//! ```json
//! {
//!   "name": "kiva_large_w_mode",
//!   "weight": false,
//!   "n_row": 33,
//!   "n_col": 36,
//!   "layout": ["....", "w.e.", "..@."]
//! }
//! ```
//!
//! `.` is free, `@` and `T` are not, `e` is an endpoint (beside a shelf) and `w` a
//! workstation; both are free. `n_row` and `n_col` have to agree with `layout` where they are
//! there. `weights_matrix`, costs of moves with five or seven numbers per cell, is checked and
//! not kept. What else there is belongs to generators of layouts and is passed over.

use serde::Deserialize;

use super::rows::{Rows, Text};
use crate::json::read_object;
use crate::{Grid, InputError, Role};

const HINT: &str =
    "a map of LSMART is a JSON object with `layout`, a list of rows such as \"..@e\"";

const LETTERS: &str = "letters are . (free), @ and T (not free), e (endpoint) and w (workstation)";

/// Limit of the simulation, which LSMART's programs want to be told in the map.
const MAX_TIME: u32 = 2000;

#[derive(Deserialize)]
struct MapFile<'a> {
    #[serde(borrow)]
    layout: Vec<Text<'a>>,
    n_row: Option<u32>,
    n_col: Option<u32>,
    weights_matrix: Option<Vec<f64>>,
}

/// A map, and whether its file has costs of moves, which are not kept.
pub(super) struct LsmartMap {
    pub(super) grid: Grid,
    pub(super) weights: bool,
}

/// True if a file that may be a map is a JSON object.
pub(crate) fn is_json(bytes: &[u8]) -> bool {
    bytes.trim_ascii_start().first() == Some(&b'{')
}

/// Reads a map of LSMART. `source` is named in errors, and its stem becomes the map's name.
pub fn read_lsmart(source: &str, bytes: &[u8]) -> Result<Grid, InputError> {
    read(source, bytes).map(|map| map.grid)
}

pub(super) fn read(source: &str, bytes: &[u8]) -> Result<LsmartMap, InputError> {
    let file: MapFile<'_> = read_object(source, bytes, HINT)?;
    let layout =
        Rows::new(source, bytes, "layout", &file.layout).map_err(|error| error.or_hint(HINT))?;
    let (rows, cols) = (layout.count, layout.cols);
    for (key, said, found, what) in [
        ("n_row", file.n_row, rows, "rows"),
        ("n_col", file.n_col, cols, "columns"),
    ] {
        if let Some(said) = said.filter(|said| *said != found) {
            let reason = format!("{key} is {said}, but the layout has {found} {what}");
            return Err(layout.fault_at(key, reason).hint(format!(
                "write the {key} that the layout has, or leave it out"
            )));
        }
    }
    let grid = layout.grid(LETTERS)?;
    let cells = u64::from(grid.cell_count());
    if let Some(weights) = &file.weights_matrix {
        let per_cell = [5, 7].map(|each| each * cells);
        if !per_cell.contains(&(weights.len() as u64)) {
            let reason = format!(
                "weights_matrix has {} numbers, which is neither five nor seven for each of \
                 {cells} cells",
                weights.len()
            );
            return Err(layout
                .fault_at("weights_matrix", reason)
                .hint("leave it out: costs of moves are not kept in any case"));
        }
    }
    Ok(LsmartMap {
        grid,
        weights: file.weights_matrix.is_some(),
    })
}

/// The content of a file with this map, in the letters that LSMART knows: what is free and has
/// no role is `.`, what is not free is `T` if it was, else `@`.
pub fn write_lsmart(grid: &Grid) -> Vec<u8> {
    let letter = |letter: &u8| match *letter {
        known @ (b'.' | b'e' | b'w' | b'@' | b'T') => known,
        other if Grid::letter_is_passable(other) => b'.',
        _ => b'@',
    };
    let terrain: Vec<u8> = grid.terrain().iter().map(letter).collect();
    let endpoints = grid.cells_with(Role::Endpoint).count();
    let name = serde_json::Value::from(grid.name());
    let mut text = format!(
        "{{\n    \"name\": {name},\n    \"weight\": false,\n    \"n_row\": {},\n    \
         \"n_col\": {},\n    \"n_endpoint\": {endpoints},\n    \"n_agent_loc\": 0,\n    \
         \"maxtime\": {MAX_TIME},\n    \"layout\": [",
        grid.rows(),
        grid.cols()
    )
    .into_bytes();
    for (number, row) in terrain.chunks(grid.cols() as usize).enumerate() {
        let before: &[u8] = if number == 0 { b"" } else { b"," };
        text.extend([before, b"\n        \"", row, b"\""].concat());
    }
    text.extend(b"\n    ]\n}\n");
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read_map;

    const MAP: &str = "{\"name\": \"small\", \"n_row\": 2, \"n_col\": 4,\n  \"layout\": [\n    \"w.e.\",\n    \"..@T\"\n  ]}";

    fn fault(text: &str) -> (String, String) {
        let error = read_lsmart("a/b.json", text.as_bytes()).expect_err("the map is bad");
        (error.to_string(), error.hint.unwrap_or_default())
    }

    #[test]
    fn letters_are_roles_and_survive_writing() {
        let grid = read_lsmart("maps/hall.json", MAP.as_bytes()).expect("a map");
        assert_eq!((grid.name(), grid.rows(), grid.cols()), ("hall", 2, 4));
        assert_eq!(grid.terrain(), b"w.e...@T");
        assert_eq!(grid.role(0), Some(Role::Workstation));
        assert_eq!(grid.role(1), None);
        assert_eq!(grid.role(99), None);
        assert_eq!(grid.cells_with(Role::Endpoint).collect::<Vec<_>>(), [2]);
        let again = read_map("maps/hall.json", &write_lsmart(&grid)).expect("a map");
        assert_eq!(again, grid);
        // What LSMART does not know becomes what it takes for the same.
        let other = Grid::new(
            "x",
            1,
            6,
            b"GSE OW".map(|l| if l == b' ' { b'T' } else { l }).to_vec(),
        );
        let text = write_lsmart(&other.expect("a map"));
        assert!(
            String::from_utf8(text)
                .expect("text")
                .contains("\"...T@@\"")
        );
    }

    #[test]
    fn what_is_wrong_is_told_with_its_place() {
        let (error, hint) = fault(&MAP.replace("..@T", "..x@"));
        assert_eq!(
            error,
            "a/b.json:4:8: unknown terrain letter 'x' in row 1 of the layout"
        );
        assert!(hint.contains("endpoint"), "{hint}");
        let (error, _) = fault(&MAP.replace("..@T", "..é@"));
        assert_eq!(
            error,
            "a/b.json:4:8: unknown terrain letter 'é' in row 1 of the layout"
        );
        let (error, _) = fault(&MAP.replace("..@T", "..@"));
        assert_eq!(
            error,
            "a/b.json:4:9: row 1 of the layout has 3 letters, but the first one has 4"
        );
        let (error, hint) = fault(&MAP.replace("\"n_row\": 2", "\"n_row\": 3"));
        assert_eq!(
            error,
            "a/b.json:1:19: n_row is 3, but the layout has 2 rows"
        );
        assert!(hint.contains("leave it out"), "{hint}");
        let (error, _) = fault("{\"layout\": []}");
        assert_eq!(error, "a/b.json:1:2: the layout has no rows");
        let (error, _) = fault("{\"layout\": [\"..\", 7]}");
        assert!(error.starts_with("a/b.json:1:"), "{error}");
        assert!(error.contains("a row of the map"), "{error}");
        let (error, _) = fault("{\"n_row\": 3}");
        assert!(error.contains("missing field `layout`"), "{error}");
        let (error, hint) = fault("{\"layout\": [\"..\"], \"weights_matrix\": [1, 2]}");
        assert!(error.contains("has 2 numbers"), "{error}");
        assert!(hint.contains("not kept"), "{hint}");
        let (error, _) = fault("{\"layout\": [\"\"]}");
        assert!(error.contains("1 rows and 0 columns"), "{error}");
    }
}
