//! MovingAI `.map` files.
//!
//! The format is that of Sturtevant's "Benchmarks for Grid-Based Pathfinding"
//! (2012): a header of `type octile`, `height H` and `width W`, the line `map`,
//! and `H` lines of `W` letters. `\r\n` line ends, blank lines at the end, a header in capitals and
//! one without `type` (many solvers come with such maps) are accepted; anything else that differs
//! is an error that says where.
//!
//! Beside the letters of the benchmarks there are those of [`Role`](crate::Role)s,
//! `e` and `w`. Maps in JSON, those of LSMART and those of this project with allowed moves, and those
//! of RHCR, POGEMA and Continuous-CBS are read in place of a `.map` file wherever one is.

use std::path::Path;

use crate::files::{Lines, check_line_ends, column, load_file, quote, stem, write_atomically};
use crate::formats::{
    Format, foreign, is_json, own_format, read_ccbs_map, read_grid, read_lsmart, read_pogema,
    read_rhcr, write_grid,
};
use crate::{Grid, InputError};

/// Largest map file that is read, in bytes.
pub const MAP_FILE_LIMIT: u64 = 4 * Grid::MAX_CELLS + 4096;

/// Reads and parses a map file, by its content a `.map` file, one of this project, of LSMART, RHCR,
/// POGEMA or Continuous-CBS; the map's name is the file's stem.
pub fn load_map(path: impl AsRef<Path>) -> Result<Grid, InputError> {
    load_file(path, MAP_FILE_LIMIT, read_map)
}

/// Parses the content of a map file. `source` is named in errors, and its
/// stem becomes the map's name.
pub fn read_map(source: &str, bytes: &[u8]) -> Result<Grid, InputError> {
    if is_json(bytes) {
        return match own_format(bytes) {
            Some(b"grid") => read_grid(source, bytes),
            _ => read_lsmart(source, bytes),
        };
    }
    match Format::guess(Path::new(source), bytes) {
        Some(Format::Rhcr) => return read_rhcr(source, bytes),
        Some(Format::CcbsMap) => return read_ccbs_map(source, bytes),
        Some(Format::Pogema) => return read_pogema(source, bytes).map(|(grid, _)| grid),
        _ => {}
    }
    if let Some(kind) = foreign(bytes) {
        return Err(kind.refused(source));
    }
    check_line_ends(source, bytes)?;
    let mut lines = Lines::new(bytes);
    let header = read_header(source, &mut lines)?;
    let (rows, cols) = (header.rows, header.cols);
    let cells = u64::from(rows) * u64::from(cols);
    // A small file that claims a huge map must not make us allocate one.
    let mut terrain = Vec::with_capacity(cells.min(bytes.len() as u64) as usize);
    let mut last_line = header.last_line;
    for row in 0..rows {
        let Some((number, line)) = lines
            .next()
            .filter(|(_, line)| !line.is_empty() || !lines.only_blank_left())
        else {
            return Err(InputError::new(
                source,
                format!("the map ends after {row} of {rows} rows"),
            )
            .at(last_line + 1, 1)
            .hint("the file is truncated, or its height is wrong"));
        };
        last_line = number;
        read_row(source, number, row, &header, line, &mut terrain)?;
    }
    if !lines.only_blank_left() {
        let extra = lines.find(|(_, line)| !line.trim_ascii().is_empty());
        let (number, line) = extra.unwrap_or((last_line + 1, b""));
        let reason = format!("the map goes on after its {rows} rows with {}", quote(line));
        return Err(InputError::new(source, reason)
            .at(number, 1)
            .hint("the header's height is wrong, or lines were added at the end: remove them"));
    }
    Grid::new(stem(source), rows, cols, terrain).map_err(|error| InputError {
        source: source.to_owned(),
        ..error
    })
}

struct Header {
    rows: u32,
    cols: u32,
    last_line: u64,
}

fn read_header(source: &str, lines: &mut Lines<'_>) -> Result<Header, InputError> {
    if lines.only_blank_left() {
        return Err(InputError::new(source, "the file is empty")
            .hint("a map file begins with the line 'type octile'"));
    }
    // Values with the lines that gave them.
    let mut kind: Option<u64> = None;
    let mut height: Option<(u32, u64)> = None;
    let mut width: Option<(u32, u64)> = None;
    for (number, line) in lines.by_ref() {
        let fault = |at: usize, reason: String| {
            InputError::new(source, reason).at(number, column(line, at))
        };
        let mut words = words(line);
        let Some((key_at, key)) = words.next() else {
            return Err(fault(0, "blank line in the header".into())
                .hint("the header is 'type octile', 'height H', 'width W', 'map'"));
        };
        let key = key.to_ascii_lowercase();
        let is_first = kind.is_none() && height.is_none() && width.is_none();
        if is_first && !matches!(&*key, b"type" | b"height" | b"width" | b"map") {
            let reason = format!("expected 'type octile', found {}", quote(line));
            return Err(fault(key_at, reason).hint(if key.starts_with(b"#") {
                "map files have no comments: remove the line"
            } else {
                "is this a MovingAI .map file?"
            }));
        }
        let value = words.next();
        if let Some((extra_at, extra)) = words.next() {
            return Err(fault(
                extra_at,
                format!("unexpected {} in the header", quote(extra)),
            ));
        }
        match (&*key, value) {
            (b"map", None) => {
                let missing = |what: &str| {
                    fault(key_at, format!("the header has no {what}"))
                        .hint(format!("add a line '{what} NUMBER' before 'map'"))
                };
                let (rows, _) = height.ok_or_else(|| missing("height"))?;
                let (cols, _) = width.ok_or_else(|| missing("width"))?;
                let cells = u64::from(rows) * u64::from(cols);
                if cells > Grid::MAX_CELLS {
                    let line = height.max(width).map_or(number, |(_, line)| line);
                    return Err(InputError::new(
                        source,
                        format!("a map of {rows} rows and {cols} columns is too large"),
                    )
                    .at_line(line)
                    .hint(format!("a map has at most {} cells", Grid::MAX_CELLS)));
                }
                return Ok(Header {
                    rows,
                    cols,
                    last_line: number,
                });
            }
            (b"map", Some((at, extra))) => {
                return Err(fault(
                    at,
                    format!("unexpected {} after 'map'", quote(extra)),
                ));
            }
            (b"type", value) => {
                if let Some(first) = kind {
                    return Err(fault(
                        key_at,
                        format!("type given twice, first on line {first}"),
                    ));
                }
                match value {
                    Some((_, kind_of_map)) if kind_of_map.eq_ignore_ascii_case(b"octile") => {
                        kind = Some(number);
                    }
                    Some((at, other)) => {
                        return Err(fault(
                            at,
                            format!("map type {} is not supported", quote(other)),
                        )
                        .hint("the only type is 'octile'"));
                    }
                    None => return Err(fault(line.len(), "the type has no value".into())),
                }
            }
            (b"height", value) => {
                let value = size(source, number, line, "height", value)?;
                if let Some((_, first)) = height.replace((value, number)) {
                    let reason = format!("height given twice, first on line {first}");
                    return Err(fault(key_at, reason));
                }
            }
            (b"width", value) => {
                let value = size(source, number, line, "width", value)?;
                if let Some((_, first)) = width.replace((value, number)) {
                    let reason = format!("width given twice, first on line {first}");
                    return Err(fault(key_at, reason));
                }
            }
            (other, _) => {
                return Err(
                    fault(key_at, format!("unknown header line {}", quote(other)))
                        .hint("the header is 'type octile', 'height H', 'width W', 'map'"),
                );
            }
        }
    }
    Err(
        InputError::new(source, "the file ends before the line 'map'")
            .at(lines.next_number(), 1)
            .hint("the file is truncated, or not a map"),
    )
}

fn size(
    source: &str,
    number: u64,
    line: &[u8],
    what: &str,
    value: Option<(usize, &[u8])>,
) -> Result<u32, InputError> {
    let at = value.map_or(line.len(), |(at, _)| at);
    let fault = |reason: String| InputError::new(source, reason).at(number, column(line, at));
    let Some((_, digits)) = value else {
        return Err(fault(format!("the {what} has no value")));
    };
    let parsed = std::str::from_utf8(digits)
        .ok()
        .filter(|_| digits.iter().all(u8::is_ascii_digit))
        .map(str::parse::<u32>);
    let hint = format!("the {what} is a whole number of 1 or more");
    match parsed {
        Some(Ok(0)) => Err(fault(format!("the {what} is 0")).hint(hint)),
        Some(Ok(value)) if u64::from(value) <= Grid::MAX_CELLS => Ok(value),
        Some(_) => Err(fault(format!("the {what} {} is too large", quote(digits)))
            .hint(format!("a map has at most {} cells", Grid::MAX_CELLS))),
        None => Err(fault(format!("the {what} {} is not a number", quote(digits))).hint(hint)),
    }
}

fn read_row(
    source: &str,
    number: u64,
    row: u32,
    header: &Header,
    line: &[u8],
    terrain: &mut Vec<u8>,
) -> Result<(), InputError> {
    let cols = header.cols;
    let letters = &line[..line.len().min(cols as usize)];
    if let Some(at) = letters
        .iter()
        .position(|letter| !Grid::LETTERS.contains(letter))
    {
        let end = line[at..].utf8_chunks().next().and_then(|chunk| {
            let first = chunk.valid().chars().next()?;
            Some(at + first.len_utf8())
        });
        let letter = quote(&line[at..end.unwrap_or(at + 1)]);
        let reason = format!("unknown terrain letter {letter} in map row {row}");
        return Err(InputError::new(source, reason)
            .at(number, column(line, at))
            .hint(LETTERS_HINT));
    }
    if line.len() != cols as usize {
        let found = String::from_utf8_lossy(line).chars().count();
        let reason = format!("map row {row} has {found} letters, but the width is {cols}");
        let error = InputError::new(source, reason).at(number, column(line, letters.len()));
        return Err(if line.last().is_some_and(u8::is_ascii_whitespace) {
            error.hint("remove the blanks at the end of the line")
        } else if row == 0 && found as u64 == u64::from(header.rows) {
            error.hint("are height and width in the header exchanged?")
        } else {
            error
        });
    }
    terrain.extend_from_slice(line);
    Ok(())
}

const LETTERS_HINT: &str = "terrain letters are .GSEew, which are free, and @OTW, which are not";

/// Words of a header line with their byte offsets.
fn words(line: &[u8]) -> impl Iterator<Item = (usize, &[u8])> {
    let blank = |byte: &u8| *byte == b' ' || *byte == b'\t';
    let mut at = 0;
    std::iter::from_fn(move || {
        at += line[at..].iter().position(|byte| !blank(byte))?;
        let rest = &line[at..];
        let end = rest.iter().position(blank).unwrap_or(rest.len());
        let word = (at, &rest[..end]);
        at += end;
        Some(word)
    })
}

/// The content of a `.map` file for this grid. Reading it gives the same grid, without masks of
/// moves.
pub fn write_map(grid: &Grid) -> Vec<u8> {
    let header = format!(
        "type octile\nheight {}\nwidth {}\nmap\n",
        grid.rows(),
        grid.cols()
    );
    let mut bytes = header.into_bytes();
    bytes.reserve(grid.terrain().len() + grid.rows() as usize);
    for row in grid.terrain().chunks(grid.cols() as usize) {
        bytes.extend_from_slice(row);
        bytes.push(b'\n');
    }
    bytes
}

/// The content of a file that [`read_map`] reads as the same grid: a `.map` file, or
/// `fleetyard.grid/1` for a grid with masks of moves.
pub fn map_bytes(grid: &Grid) -> Vec<u8> {
    if grid.has_move_masks() {
        write_grid(grid)
    } else {
        write_map(grid)
    }
}

/// Writes [`map_bytes`], replacing an old file as a whole.
pub fn save_map(grid: &Grid, path: impl AsRef<Path>) -> Result<(), InputError> {
    write_atomically(path.as_ref(), &map_bytes(grid))
}
