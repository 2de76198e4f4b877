//! Maps of RHCR, <https://github.com/Jiaoyang-Li/RHCR>, in its two forms.
//!
//! A `.map` is a line `rows,columns`, three numbers (endpoints, homes of robots, a limit of the time)
//! and the rows of the map:
//!
//! ```text
//! 3,5
//! 2
//! 1
//! 5000
//! .....
//! .e@e.
//! ..r..
//! ```
//!
//! `.` is free, `@` is not, `e` is an endpoint and `r` the home of a robot, which is free ground here.
//!
//! A `.grid` is a table with a line per cell, x by x, whose y grows upwards, and what each move costs:
//!
//! ```text
//! Grid size (x, y)
//! 77,37
//! id,type,station,x,y,weight_to_NORTH,weight_to_WEST,weight_to_SOUTH,weight_to_EAST,weight_for_WAIT
//! 0,Obstacle,None,0,0,inf,inf,inf,inf,1
//! ```
//!
//! A move that costs `inf` is forbidden; other costs are not kept. `Endpoint` and `Eject` are
//! endpoints, `Induct` is a workstation, `Home` and `Travel` are ground.

use super::pibt2::whole_number;
use crate::files::{Lines, column, quote, stem};
use crate::{Connectivity, Grid, InputError};

const HINT: &str = "a map of RHCR is a line 'rows,columns', three numbers, and the rows of the map";

/// The columns of a `.grid` with the costs of moves, in the order of a mask: north, east, south, west.
const WEIGHTS: [&str; 4] = [
    "weight_to_NORTH",
    "weight_to_EAST",
    "weight_to_SOUTH",
    "weight_to_WEST",
];

/// A map, and whether its file has costs of moves, which are not kept.
pub(super) struct RhcrMap {
    pub(super) grid: Grid,
    pub(super) weights: bool,
}

/// Reads a map of RHCR. `source` is named in errors, and its stem becomes the map's name.
pub fn read_rhcr(source: &str, bytes: &[u8]) -> Result<Grid, InputError> {
    read(source, bytes).map(|map| map.grid)
}

pub(super) fn read(source: &str, bytes: &[u8]) -> Result<RhcrMap, InputError> {
    let mut reader = Reader {
        source,
        lines: Lines::new(bytes),
    };
    if bytes.trim_ascii_start().starts_with(b"Grid") {
        reader.line()?;
        return reader.table(bytes.len());
    }
    let grid = reader.rows(bytes.len())?;
    Ok(RhcrMap {
        grid,
        weights: false,
    })
}

struct Reader<'a> {
    source: &'a str,
    lines: Lines<'a>,
}

impl<'a> Reader<'a> {
    fn line(&mut self) -> Result<(u64, &'a [u8]), InputError> {
        let ends = self.lines.only_blank_left();
        self.lines.next().filter(|_| !ends).ok_or_else(|| {
            InputError::new(self.source, "the map ends too early")
                .at(self.lines.next_number(), 1)
                .hint("the file is truncated, or its first line is wrong")
        })
    }

    /// Whole numbers with commas between them.
    fn numbers<const N: usize>(&mut self, what: &str) -> Result<([u32; N], u64), InputError> {
        let (number, line) = self.line()?;
        let text = std::str::from_utf8(line).unwrap_or_default();
        let mut words = text.split(',').map(|word| whole_number(word.trim()));
        let values = std::array::from_fn(|_| words.next().flatten());
        if words.next().is_none() && values.iter().all(Option::is_some) {
            return Ok((values.map(Option::unwrap_or_default), number));
        }
        let reason = format!("expected {what}, found {}", quote(line));
        Err(InputError::new(self.source, reason)
            .at(number, 1)
            .hint(HINT))
    }

    /// Two numbers, the first named first, that are the size of a map.
    fn size(&mut self, what: &str) -> Result<[u32; 2], InputError> {
        let (size, number) = self.numbers(what)?;
        let cells = u64::from(size[0]) * u64::from(size[1]);
        if (1..=Grid::MAX_CELLS).contains(&cells) {
            return Ok(size);
        }
        let reason = format!(
            "a map of {} by {} cells is empty or too large",
            size[0], size[1]
        );
        Err(InputError::new(self.source, reason)
            .at_line(number)
            .hint(format!("a map has between 1 and {} cells", Grid::MAX_CELLS)))
    }

    fn grid(&self, rows: u32, cols: u32, terrain: Vec<u8>) -> Result<Grid, InputError> {
        if !self.lines.only_blank_left() {
            return Err(
                InputError::new(self.source, "the map goes on after its last row")
                    .at(self.lines.next_number(), 1)
                    .hint("the size in its first lines is wrong, or lines were added at the end"),
            );
        }
        Grid::new(stem(self.source), rows, cols, terrain).map_err(|error| InputError {
            source: self.source.to_owned(),
            ..error
        })
    }

    fn rows(mut self, bytes: usize) -> Result<Grid, InputError> {
        let [rows, cols] = self.size("rows,columns")?;
        for what in [
            "the number of endpoints",
            "the number of homes",
            "a limit of the time",
        ] {
            self.numbers::<1>(what)?;
        }
        // A small file that claims a huge map must not make us allocate one.
        let cells = u64::from(rows) * u64::from(cols);
        let mut terrain = Vec::with_capacity(cells.min(bytes as u64) as usize);
        for row in 0..rows {
            let (number, line) = self.line()?;
            let fault = |at: usize, reason: String| {
                InputError::new(self.source, reason).at(number, column(line, at))
            };
            let known = |letter: &u8| matches!(letter, b'.' | b'@' | b'e' | b'r');
            if let Some(at) = line.iter().position(|letter| !known(letter)) {
                let letter = quote(&line[at..=at]);
                let reason = format!("unknown letter {letter} in map row {row}");
                return Err(fault(at, reason)
                    .hint("letters are . (free), @ (not free), e (endpoint) and r (home)"));
            }
            if line.len() != cols as usize {
                let reason = format!(
                    "map row {row} has {} letters, but there are {cols} columns",
                    line.len()
                );
                return Err(fault(line.len().min(cols as usize), reason));
            }
            let letters = line.iter().map(|letter| match letter {
                b'r' => b'.',
                letter => *letter,
            });
            terrain.extend(letters);
        }
        self.grid(rows, cols, terrain)
    }

    fn table(mut self, bytes: usize) -> Result<RhcrMap, InputError> {
        let [cols, rows] = self.size("the size x,y")?;
        let cells = rows as usize * cols as usize;
        if bytes < cells {
            let reason = format!("the file is too short for {cols} by {rows} cells");
            return Err(InputError::new(self.source, reason)
                .at_line(2)
                .hint("the file is truncated, or its size is wrong"));
        }
        let (number, line) = self.line()?;
        let names: Vec<&[u8]> = line.split(|byte| *byte == b',').collect();
        let place = |name: &str| {
            let found = names
                .iter()
                .position(|found| found.trim_ascii() == name.as_bytes());
            found.ok_or_else(|| {
                let reason = format!("there is no column {name}");
                InputError::new(self.source, reason).at(number, 1).hint(
                    "columns are id, type, x, y, weight_to_NORTH, weight_to_WEST, weight_to_SOUTH, \
                     weight_to_EAST and weight_for_WAIT",
                )
            })
        };
        let (kind_at, x_at, y_at) = (place("type")?, place("x")?, place("y")?);
        let mut weights_at = [0; 4];
        for (at, name) in weights_at.iter_mut().zip(WEIGHTS) {
            *at = place(name)?;
        }
        let count = names.len();
        let mut terrain = vec![b'@'; cells];
        let mut moves = vec![0_u8; cells];
        let mut weights = false;
        for at in 0..cells as u32 {
            let (number, line) = self.line()?;
            let fault = |reason: String| InputError::new(self.source, reason).at(number, 1);
            let fields: Vec<&[u8]> = line.split(|byte| *byte == b',').collect();
            if fields.len() != count {
                let found = fields.len();
                return Err(fault(format!(
                    "the line has {found} fields, the names {count}"
                )));
            }
            let field = |at: usize| {
                let text = std::str::from_utf8(fields[at]).unwrap_or_default();
                text.trim()
            };
            let (x, y) = (at / rows, at % rows);
            if [x, y].map(Some) != [x_at, y_at].map(|at| whole_number(field(at))) {
                let found = format!("{},{}", field(x_at), field(y_at));
                let reason = format!(
                    "expected the cell {x},{y}, found {}",
                    quote(found.as_bytes())
                );
                return Err(fault(reason).hint("cells are listed x by x, and by y for each x"));
            }
            let cell = ((rows - 1 - y) * cols + x) as usize;
            terrain[cell] = match field(kind_at) {
                "Obstacle" => b'@',
                "Travel" | "Home" => b'.',
                "Endpoint" | "Eject" => b'e',
                "Induct" => b'w',
                other => {
                    let reason = format!("unknown type {}", quote(other.as_bytes()));
                    return Err(fault(reason)
                        .hint("types are Obstacle, Travel, Home, Endpoint, Eject and Induct"));
                }
            };
            for (bit, at) in weights_at.into_iter().enumerate() {
                let weight: f64 = field(at).parse().map_err(|_| {
                    let found = quote(field(at).as_bytes());
                    fault(format!("the {} is {found}, not a number", WEIGHTS[bit]))
                })?;
                weights |= weight.is_finite() && (weight - 1.0).abs() > f64::EPSILON;
                moves[cell] |= u8::from(weight.is_finite()) << bit;
            }
        }
        let grid = self.grid(rows, cols, terrain)?;
        // Moves that lead off the map or into an obstacle are none, whatever they cost.
        let open = grid.move_masks(Connectivity::Four);
        for (mask, open) in moves.iter_mut().zip(&open) {
            *mask &= open;
        }
        if moves == open {
            return Ok(RhcrMap { grid, weights });
        }
        let grid = grid
            .with_moves(moves)
            .map_err(|error| InputError::new(self.source, error.to_string()))?;
        Ok(RhcrMap { grid, weights })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_of_both_forms_are_read() {
        let text = "3,5\n2\n1\n5000\n.....\r\n.e@e.\n..r..\n\n";
        let grid = read_rhcr("m/kiva.map", text.as_bytes()).expect("a map");
        assert_eq!((grid.name(), grid.rows(), grid.cols()), ("kiva", 3, 5));
        assert_eq!(grid.terrain(), b"......e@e......");

        // Two columns, three rows; one goes up in x = 0 alone, and (1, 2) is an obstacle.
        let head = "Grid size (x, y)\n2,3\nid,type,station,x,y,weight_to_NORTH,weight_to_WEST,\
                    weight_to_SOUTH,weight_to_EAST,weight_for_WAIT\n";
        let cells = "0,Travel,None,0,0,1,inf,inf,1,1\n1,Eject,7,0,1,1,inf,inf,1,1\n\
                     2,Induct,9,0,2,inf,inf,inf,1,1\n3,Travel,None,1,0,1,1,inf,inf,1\n\
                     4,Home,None,1,1,1,1,1,inf,2\n5,Obstacle,None,1,2,inf,inf,inf,inf,1\n";
        let map = read("s.grid", format!("{head}{cells}").as_bytes()).expect("a map");
        let grid = &map.grid;
        assert_eq!((grid.rows(), grid.cols()), (3, 2));
        assert_eq!(grid.terrain(), b"w@e...");
        assert!(!map.weights);
        // North 1, east 2, south 4, west 8.
        assert_eq!(grid.move_masks(Connectivity::Four), [0, 0, 3, 12, 3, 9]);
        // What may be driven both ways everywhere is a plain map.
        let free = "Grid size (x, y)\n1,2\nid,type,x,y,weight_to_NORTH,weight_to_WEST,weight_to_SOUTH,\
                    weight_to_EAST,weight_for_WAIT\n0,Travel,0,0,2,inf,inf,inf,1\n\
                    1,Travel,0,1,inf,inf,1,inf,1\n";
        let map = read("s.grid", free.as_bytes()).expect("a map");
        assert!(!map.grid.has_move_masks() && map.weights);
    }

    #[test]
    fn malformed_maps_are_told_by_line() {
        let head = "Grid size (x, y)\n1,1\nid,type,x,y,weight_to_NORTH,weight_to_WEST,\
                    weight_to_SOUTH,weight_to_EAST,weight_for_WAIT\n";
        for (text, expected) in [
            (
                "3;5\n".to_owned(),
                "k:1:1: expected rows,columns, found '3;5'",
            ),
            ("0,5\n".to_owned(), "k:1: a map of 0 by 5 cells is empty"),
            (
                "1,2\n1\nx\n1\n..\n".to_owned(),
                "k:3:1: expected the number of homes",
            ),
            (
                "1,2\n1\n1\n1\n.x\n".to_owned(),
                "k:5:2: unknown letter 'x' in map row 0",
            ),
            (
                "1,2\n1\n1\n1\n...\n".to_owned(),
                "k:5:3: map row 0 has 3 letters",
            ),
            (
                "2,2\n1\n1\n1\n..\n".to_owned(),
                "k:6:1: the map ends too early",
            ),
            (
                "1,2\n1\n1\n1\n..\n..\n".to_owned(),
                "k:6:1: the map goes on after",
            ),
            (
                "Grid size\n9999,9999\n".to_owned(),
                "k:2: the file is too short",
            ),
            (
                "Grid size\n1,1\nid,kind\n".to_owned(),
                "k:3:1: there is no column type",
            ),
            (
                format!("{head}0,Lake,0,0,1,1,1,1,1\n"),
                "k:4:1: unknown type 'Lake'",
            ),
            (
                format!("{head}0,Travel,0,1,1,1,1,1,1\n"),
                "k:4:1: expected the cell 0,0",
            ),
            (
                format!("{head}0,Travel,0,0,x,1,1,1,1\n"),
                "k:4:1: the weight_to_NORTH is 'x'",
            ),
            (format!("{head}0,Travel\n"), "k:4:1: the line has 2 fields"),
        ] {
            let error = read_rhcr("k", text.as_bytes()).expect_err(&text);
            assert!(error.to_string().starts_with(expected), "{text}: {error}");
        }
    }
}
