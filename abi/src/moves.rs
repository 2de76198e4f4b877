//! Paths as move strings: one letter per unit step.
//!
//! | letter | step | letter | step |
//! | --- | --- | --- | --- |
//! | `.` | wait | | |
//! | `N` | row − 1 | `n` | row − 1, col + 1 (north-east) |
//! | `E` | col + 1 | `e` | row + 1, col + 1 (south-east) |
//! | `S` | row + 1 | `s` | row + 1, col − 1 (south-west) |
//! | `W` | col − 1 | `w` | row − 1, col − 1 (north-west) |
//!
//! A lower-case letter is the direction of its upper-case letter turned by 45°
//! clockwise. A path of `k` cells is its start and a string of `k − 1` letters,
//! about a tenth of the size of row–column pairs.

/// A cell index that is on no map: a position outside it.
pub const OFF_MAP: u32 = u32::MAX;

/// A letter that is not a move.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("unknown move '{}' at position {position}, expected one of .NESWnesw", .letter.escape_ascii())]
pub struct MoveError {
    /// Byte offset in the string, from 0.
    pub position: usize,
    /// The byte found there.
    pub letter: u8,
}

/// Every move: its letter, row step and column step; the wait comes first.
pub const MOVES: [(u8, i8, i8); 9] = [
    (b'.', 0, 0),
    (b'N', -1, 0),
    (b'E', 0, 1),
    (b'S', 1, 0),
    (b'W', 0, -1),
    (b'n', -1, 1),
    (b'e', 1, 1),
    (b's', 1, -1),
    (b'w', -1, -1),
];

/// Row and column step by letter; `NO_MOVE` where the letter is none.
const STEPS: [(i8, i8); 256] = {
    let mut steps = [NO_MOVE; 256];
    let mut at = 0;
    while at < MOVES.len() {
        let (letter, dr, dc) = MOVES[at];
        steps[letter as usize] = (dr, dc);
        at += 1;
    }
    steps
};
const NO_MOVE: (i8, i8) = (i8::MAX, i8::MAX);

/// Writes the moves along `path` on a grid of `cols` columns.
///
/// `None` if the path is empty, leaves the map, or has a step that is not one
/// of [`MOVES`].
pub fn encode(path: &[u32], cols: u32) -> Option<String> {
    let mut letters = String::with_capacity(path.len().saturating_sub(1));
    encode_into(path, cols, &mut letters).then_some(letters)
}

/// As [`encode`], appending to a string; `false` if the path has no moves, and
/// then what was appended means nothing.
pub fn encode_into(path: &[u32], cols: u32, letters: &mut String) -> bool {
    let Some(&first) = path.first().filter(|_| cols > 0) else {
        return false;
    };
    if first == OFF_MAP {
        return false;
    }
    let width = i64::from(cols);
    let deltas = MOVES.map(|(_, dr, dc)| i64::from(dr) * width + i64::from(dc));
    // Followed step by step, so that a division per cell is not needed.
    let mut col = i64::from(first % cols);
    for step in path.windows(2) {
        let delta = i64::from(step[1]) - i64::from(step[0]);
        // On narrow maps several moves have the same delta; only one of them
        // stays between the columns 0 and `width`.
        let found = (0..MOVES.len()).find(|at| {
            let to = col + i64::from(MOVES[*at].2);
            deltas[*at] == delta && (0..width).contains(&to)
        });
        let Some(at) = found.filter(|_| step[1] != OFF_MAP) else {
            return false;
        };
        col += i64::from(MOVES[at].2);
        letters.push(char::from(MOVES[at].0));
    }
    true
}

/// The cells along `moves` from `start` on a map of `rows` × `cols` cells.
///
/// Obstacles are not looked at. A walk that leaves the map is [`OFF_MAP`] from
/// there to its end, also if it would come back; so is one that starts outside.
pub fn decode(start: u32, moves: &str, rows: u32, cols: u32) -> Result<Vec<u32>, MoveError> {
    let mut cells = Vec::new();
    decode_into(start, moves, rows, cols, &mut cells)?;
    Ok(cells)
}

/// As [`decode`], appending to `cells`; after an error, what was appended means
/// nothing.
pub fn decode_into(
    start: u32,
    moves: &str,
    rows: u32,
    cols: u32,
    cells: &mut Vec<u32>,
) -> Result<(), MoveError> {
    cells.reserve(moves.len() + 1);
    let mut walk = Walk::new(start, rows, cols);
    cells.push(walk.cell());
    for (position, letter) in moves.bytes().enumerate() {
        let cell = walk.step(letter).ok_or(MoveError { position, letter })?;
        cells.push(cell);
    }
    Ok(())
}

/// A walk over a map, a letter at a time. Obstacles are not looked at.
#[derive(Debug, Clone, Copy)]
pub struct Walk {
    rows: u32,
    cols: u32,
    row: i64,
    col: i64,
    cell: u32,
}

impl Walk {
    /// Begins at a cell of a map of `rows` × `cols` cells, or outside of it.
    pub fn new(start: u32, rows: u32, cols: u32) -> Self {
        let outside = cols == 0 || u64::from(start) >= u64::from(rows) * u64::from(cols);
        let (row, col, cell) = if outside {
            (-1, -1, OFF_MAP)
        } else {
            (i64::from(start / cols), i64::from(start % cols), start)
        };
        Self {
            rows,
            cols,
            row,
            col,
            cell,
        }
    }

    /// Its cell: [`OFF_MAP`] once it has left the map, for good.
    pub fn cell(&self) -> u32 {
        self.cell
    }

    /// Takes a step; `None` if the letter is no move.
    pub fn step(&mut self, letter: u8) -> Option<u32> {
        let step = STEPS[usize::from(letter)];
        if step == NO_MOVE {
            return None;
        }
        if self.cell != OFF_MAP {
            self.row += i64::from(step.0);
            self.col += i64::from(step.1);
            let inside = (0..i64::from(self.rows)).contains(&self.row)
                && (0..i64::from(self.cols)).contains(&self.col);
            self.cell = if inside {
                (self.row * i64::from(self.cols) + self.col) as u32
            } else {
                OFF_MAP
            };
        }
        Some(self.cell)
    }
}

/// The first letter that is not a move, if there is one.
pub fn check(moves: &str) -> Result<(), MoveError> {
    let bad = |(_, letter): &(usize, u8)| STEPS[usize::from(*letter)] == NO_MOVE;
    match moves.bytes().enumerate().find(bad) {
        Some((position, letter)) => Err(MoveError { position, letter }),
        None => Ok(()),
    }
}
