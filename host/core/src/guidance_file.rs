//! Guidance files: the format `fleetyard.guidance/1`, one JSON object.
//!
//! ```json
//! {
//!   "format": "fleetyard.guidance/1",
//!   "map": "corridor",
//!   "map_digest": "fedcba9876543210fedcba9876543210",
//!   "moves": [
//!     [100,80,100,100,100,80,100,320,100,100,100,320]
//!   ],
//!   "waits": [
//!     [100,250,100]
//!   ]
//! }
//! ```
//!
//! `moves` has a list per row of the map, with four factors per cell: of its moves to the north,
//! east, south and west. `waits` has one per cell. Factors are in units of 1/100, from 10 to
//! 10000; those of moves that the map does not have mean nothing. `map` is for people; `map_digest`
//! is optional, and a map with another digest is refused, as is one of another size. Unknown keys
//! are refused.

use std::fmt::Write as _;
use std::path::Path;

use fleetyard_abi::{Guidance, c};
use serde::{Deserialize, Deserializer};

use crate::files::{load_file, write_atomically};
use crate::json::{self, push_lines, push_list, read_object, with_hint};
use crate::{Digest, Grid, InputError};

/// Largest guidance file that is read, in bytes.
pub const GUIDANCE_FILE_LIMIT: u64 = 1 << 28;

/// The value of `format`.
const GUIDANCE_FORMAT: &str = "fleetyard.guidance/1";

const HINT: &str = "a guidance file is a JSON object with format, moves and waits; `fleetyard maps guide` makes one";

const FACTORS: &str =
    "a factor is a whole number from 10 to 10000, in hundredths: 100 changes nothing";

const OTHER_MAP: &str =
    "name the map that it was made for, or make another with `fleetyard maps guide`";

/// Moves of a cell.
const MOVES: usize = 4;

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a guidance file: a JSON object")]
struct Document {
    #[serde(deserialize_with = "format")]
    format: (),
    #[serde(default)]
    map: Option<String>,
    #[serde(default)]
    map_digest: Option<Digest>,
    moves: Vec<Vec<Factor>>,
    waits: Vec<Vec<Factor>>,
}

fn format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    json::format(deserializer, GUIDANCE_FORMAT)
}

/// A factor in hundredths.
struct Factor(u16);

impl<'de> Deserialize<'de> for Factor {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let found = f64::deserialize(deserializer)?;
        let bounds = f64::from(c::GUIDANCE_LEAST)..=f64::from(c::GUIDANCE_MOST);
        if bounds.contains(&found) && found.fract() == 0.0 {
            Ok(Self(found as u16))
        } else {
            Err(with_hint(
                &format_args!("{found} is no factor"),
                Some(FACTORS),
            ))
        }
    }
}

/// Reads the guidance graph of a map.
///
/// # Errors
///
/// A file that is none, and one that is of another map.
pub fn load_guidance(path: impl AsRef<Path>, grid: &Grid) -> Result<Guidance, InputError> {
    load_file(path, GUIDANCE_FILE_LIMIT, |source, bytes| {
        read_guidance(source, bytes, grid)
    })
}

/// Parses the content of a guidance file. `source` is named in errors.
///
/// # Errors
///
/// As [`load_guidance`].
pub fn read_guidance(source: &str, bytes: &[u8], grid: &Grid) -> Result<Guidance, InputError> {
    let document: Document = read_object(source, bytes, HINT)?;
    let () = document.format;
    let wrong = |reason: String| Err(InputError::new(source, reason).hint(OTHER_MAP));
    if let Some(digest) = document.map_digest
        && digest != grid.digest()
    {
        let name = document.map.as_deref().unwrap_or("another map");
        return wrong(format!(
            "it is for {name} with the digest {digest}, but {} has {}",
            grid.name(),
            grid.digest()
        ));
    }
    let (rows, cols) = (grid.rows() as usize, grid.cols() as usize);
    for (key, lists, each) in [
        ("moves", &document.moves, MOVES),
        ("waits", &document.waits, 1),
    ] {
        if lists.len() != rows {
            return wrong(format!(
                "{key} has {} rows, but {} has {rows}",
                lists.len(),
                grid.name()
            ));
        }
        if let Some(row) = lists.iter().position(|list| list.len() != each * cols) {
            return wrong(format!(
                "row {row} of {key} has {} factors, but {} has {cols} cells in a row, which take {}",
                lists[row].len(),
                grid.name(),
                each * cols
            ));
        }
    }
    let flat = |lists: Vec<Vec<Factor>>| lists.into_iter().flatten().map(|Factor(f)| f).collect();
    Ok(Guidance {
        moves: flat(document.moves),
        waits: flat(document.waits),
    })
}

/// The content of a file with the guidance graph of a map. Reading it gives the same one.
pub fn write_guidance(guidance: &Guidance, grid: &Grid) -> Vec<u8> {
    let optional = [
        ("map", Some(grid.name().to_owned())),
        ("map_digest", json::text(Some(grid.digest()))),
    ];
    let mut text = json::begin(GUIDANCE_FORMAT, &optional);
    let cols = grid.cols() as usize;
    let mut lists = |key, factors: &[u16], each: usize| {
        push_lines(&mut text, key, factors.chunks(each * cols), |text, row| {
            push_list(text, row, |text, factor| {
                // Writing to a string cannot fail.
                let _ = write!(text, "{factor}");
            });
        });
        text.push_str(if key == "moves" { ",\n" } else { "\n}\n" });
    };
    lists("moves", &guidance.moves, MOVES);
    lists("waits", &guidance.waits, 1);
    text.into_bytes()
}

/// Writes a file with the guidance graph of a map.
///
/// # Errors
///
/// A file that cannot be written.
pub fn save_guidance(
    guidance: &Guidance,
    grid: &Grid,
    path: impl AsRef<Path>,
) -> Result<(), InputError> {
    write_atomically(path.as_ref(), &write_guidance(guidance, grid))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        Grid::new("corridor", 1, 3, b"...".to_vec()).unwrap()
    }

    fn guidance() -> Guidance {
        Guidance {
            moves: vec![100, 80, 100, 100, 100, 80, 100, 320, 100, 100, 10, 10_000],
            waits: vec![100, 250, 100],
        }
    }

    #[test]
    fn a_file_is_read_as_it_was_written() {
        let text = write_guidance(&guidance(), &grid());
        assert_eq!(read_guidance("a.json", &text, &grid()), Ok(guidance()));
    }

    #[test]
    fn files_of_other_maps_are_refused() {
        let text = write_guidance(&guidance(), &grid());
        let other = Grid::new("other", 1, 3, b".@.".to_vec()).unwrap();
        let error = read_guidance("a.json", &text, &other).unwrap_err();
        assert!(
            error
                .reason
                .starts_with("it is for corridor with the digest"),
            "{error}"
        );
        assert_eq!(error.hint.as_deref(), Some(OTHER_MAP));
        let text = String::from_utf8(text).unwrap();
        let digest = format!("  \"map_digest\": \"{}\",\n", grid().digest());
        let nameless = text.replace(&digest, "");
        assert_eq!(
            read_guidance("a.json", nameless.as_bytes(), &other),
            Ok(guidance())
        );
        let wide = Grid::new("wide", 1, 4, b"....".to_vec()).unwrap();
        let error = read_guidance("a.json", nameless.as_bytes(), &wide).unwrap_err();
        assert_eq!(
            error.reason,
            "row 0 of moves has 12 factors, but wide has 4 cells in a row, which take 16"
        );
        let high = Grid::new("high", 2, 3, b"......".to_vec()).unwrap();
        let error = read_guidance("a.json", nameless.as_bytes(), &high).unwrap_err();
        assert_eq!(error.reason, "moves has 1 rows, but high has 2");
    }

    #[test]
    fn hostile_factors_are_refused_with_their_place() {
        let text = String::from_utf8(write_guidance(&guidance(), &grid())).unwrap();
        for (hostile, reason) in [
            ("-80", "-80 is no factor"),
            ("0", "0 is no factor"),
            ("9", "9 is no factor"),
            ("10001", "10001 is no factor"),
            ("80.5", "80.5 is no factor"),
            ("1e300", "is no factor"),
            ("NaN", "expected value"),
            ("null", "invalid type: null"),
            ("\"80\"", "invalid type: string"),
        ] {
            let text = text.replacen("80", hostile, 1);
            let error = read_guidance("a.json", text.as_bytes(), &grid()).unwrap_err();
            assert!(error.reason.contains(reason), "{error}");
            assert_eq!(error.line, Some(6), "{error}");
            assert!(
                error.column.is_some() && error.hint.is_some()
                    || hostile.contains('"')
                    || hostile == "null"
            );
        }
    }
}
