//! Paths as their bytes come: what [`PathContext`] reads of a text, read of a stream.
//!
//! A plan may be hundreds of megabytes of text. Here it becomes cells byte by byte, so
//! that whoever reads it keeps the cells and nothing else, knows at every byte how many
//! there are, and may stop at any.

use serde::Deserialize;

use crate::moves::{MoveError, Walk};
use crate::paths::{Coordinate, PathContext, Position};
use crate::plan::GridPlan;

/// The longest number that is looked at. JSON allows any length.
const LONGEST_NUMBER: usize = 40;

/// An end of reading before the paths have ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum PathsError {
    /// This is not JSON: the reason, and the offset among the bytes that were given last.
    Syntax {
        /// Offset of the byte that cannot stand there.
        at: usize,
        /// The mistake.
        reason: &'static str,
    },
    /// There are more cells than the context allows.
    TooLong {
        /// The agent whose path it was.
        agent: usize,
    },
}

/// A place in the text, from outside to inside.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Place {
    Path,
    Position,
    Coordinate,
}

impl Place {
    /// Number of lists that are open around it.
    fn depth(self) -> u32 {
        self as u32 + 1
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum State {
    /// Before the list of paths.
    Before,
    /// In a list: before its first value or its end.
    First(Place),
    /// After a comma: before the next value.
    Next(Place),
    /// Before a comma or the end of the list.
    After(Place),
    /// In a number, or in a word that is none.
    Scalar(Place),
    /// In a string of moves.
    Moves,
    /// In it, after a backslash.
    Escape,
    /// Something was no path: the rest is passed over, with so many lists and objects
    /// open.
    Skip {
        depth: u32,
        string: bool,
        escaped: bool,
    },
    Done,
}

/// Reads paths as their bytes come, in any of their encodings.
///
/// ```
/// use fleetyard_abi::paths::{PathContext, PathsReader};
///
/// let context = PathContext { rows: 2, cols: 3, starts: &[0], max_cells: 100 };
/// let mut paths = PathsReader::new();
/// for part in ["[\"E", "ES\"]"] {
///     assert_eq!(paths.feed(&context, part.as_bytes()), Ok(part.len()));
/// }
/// assert!(paths.is_done());
/// let (plan, paths) = paths.finish().unwrap();
/// assert_eq!((plan.cells(), paths), (&[0, 1, 2, 5][..], 1));
/// ```
#[derive(Debug)]
pub struct PathsReader {
    plan: GridPlan,
    /// Paths that have ended, those included that nobody asked for.
    paths: usize,
    state: State,
    /// The number, the word or the escaped letter that is being read.
    token: Vec<u8>,
    /// The position that is being read, and how much of it there is.
    pair: [i64; 2],
    coordinates: usize,
    walk: Walk,
    /// Letters of the moves so far.
    letters: usize,
    /// The first thing that is JSON and no path.
    wrong: Option<String>,
}

impl Default for PathsReader {
    fn default() -> Self {
        Self::new()
    }
}

impl PathsReader {
    /// Before the bracket that opens the list.
    pub fn new() -> Self {
        Self {
            plan: GridPlan::default(),
            paths: 0,
            state: State::Before,
            token: Vec::new(),
            pair: [0; 2],
            coordinates: 0,
            walk: Walk::new(0, 0, 0),
            letters: 0,
            wrong: None,
        }
    }

    /// The list is complete.
    pub fn is_done(&self) -> bool {
        self.state == State::Done
    }

    /// The plan and the number of its paths, or why it is none. Where there are more paths
    /// than agents, the plan has only theirs.
    pub fn finish(mut self) -> Result<(GridPlan, usize), String> {
        if let Some(wrong) = self.wrong.take() {
            return Err(wrong);
        }
        self.plan.cells_mut().shrink_to_fit();
        Ok((self.plan, self.paths))
    }

    /// Reads on, up to the end of the list: how many of the bytes belonged to it.
    pub fn feed(&mut self, context: &PathContext<'_>, bytes: &[u8]) -> Result<usize, PathsError> {
        let mut at = 0;
        while let Some(&byte) = bytes.get(at) {
            let blank = matches!(byte, b' ' | b'\t' | b'\r' | b'\n');
            let syntax = |reason| Err(PathsError::Syntax { at, reason });
            match self.state {
                State::Done => break,
                State::Moves => {
                    at += self.moves(context, &bytes[at..])?;
                    continue;
                }
                State::Scalar(place) => {
                    if byte.is_ascii_alphanumeric() || matches!(byte, b'+' | b'-' | b'.') {
                        if self.token.len() < LONGEST_NUMBER {
                            self.token.push(byte);
                        } else {
                            self.refuse("a number is too long".into(), place.depth(), false);
                        }
                    } else {
                        // The byte is looked at again, after the number.
                        if !self.scalar(context, place)? {
                            return syntax("expected value");
                        }
                        continue;
                    }
                }
                State::Escape => self.escape(context, byte)?,
                State::Skip { .. } => self.skip(byte),
                _ if blank => {}
                State::Before => {
                    if byte != b'[' {
                        return syntax("expected a list of paths");
                    }
                    self.state = State::First(Place::Path);
                }
                State::First(place) if byte == b']' => self.close(context, place)?,
                State::First(place) | State::Next(place) => {
                    if !self.open(context, place, byte)? {
                        return syntax("expected value");
                    }
                }
                State::After(place) => match byte {
                    b',' => self.state = State::Next(place),
                    b']' => self.close(context, place)?,
                    _ => return syntax("expected `,` or `]`"),
                },
            }
            at += 1;
        }
        Ok(at)
    }

    /// A value begins; false where none can begin so.
    fn open(
        &mut self,
        context: &PathContext<'_>,
        place: Place,
        byte: u8,
    ) -> Result<bool, PathsError> {
        if place == Place::Coordinate && self.coordinates == 2 {
            self.refuse(NO_POSITION.into(), place.depth(), false);
            self.skip(byte);
            return Ok(true);
        }
        match (byte, place) {
            (b'[', Place::Path) => self.state = State::First(Place::Position),
            (b'[', Place::Position) => {
                self.coordinates = 0;
                self.state = State::First(Place::Coordinate);
            }
            (b'"', Place::Path) => self.begin_moves(context)?,
            (b'[' | b'{' | b'"', _) => {
                let found = match byte {
                    b'[' => "a list",
                    b'{' => "an object",
                    _ => "a string",
                };
                let wrong = self.mistyped(found, place);
                self.refuse(wrong, place.depth(), false);
                self.skip(byte);
            }
            _ if byte.is_ascii_alphanumeric() || byte == b'-' => {
                self.token.clear();
                self.token.push(byte);
                self.state = State::Scalar(place);
            }
            _ => return Ok(false),
        }
        Ok(true)
    }

    /// A list ends.
    fn close(&mut self, context: &PathContext<'_>, place: Place) -> Result<(), PathsError> {
        match place {
            Place::Path => self.state = State::Done,
            Place::Position => self.end_path(context),
            Place::Coordinate if self.coordinates == 2 => {
                let [row, col] = self.pair;
                self.push(context, Position::Pair(row, col).cell(context))?;
                self.state = State::After(Place::Position);
            }
            Place::Coordinate => {
                self.refuse(NO_POSITION.into(), Place::Position.depth(), false);
            }
        }
        Ok(())
    }

    /// A number or a word has ended; false if it is neither a number nor a word of JSON.
    fn scalar(&mut self, context: &PathContext<'_>, place: Place) -> Result<bool, PathsError> {
        let token = std::mem::take(&mut self.token);
        let number = number(&token);
        let read = match place {
            Place::Path => parse::<serde::de::IgnoredAny>(&token)
                .map(|_| Err(self.mistyped(&String::from_utf8_lossy(&token), place))),
            Place::Position => match number {
                Some(number) => Some(Ok(Position::Cell(number))),
                None => parse(&token),
            }
            .map(|position| position.map(|position| Value::Cell(position.cell(context)))),
            Place::Coordinate => match number {
                Some(number) => Some(Ok(Coordinate(number))),
                None => parse(&token),
            }
            .map(|coordinate| coordinate.map(|Coordinate(value)| Value::Coordinate(value))),
        };
        self.token = token;
        match read {
            None => return Ok(false),
            Some(Ok(Value::Cell(cell))) => self.push(context, cell)?,
            Some(Ok(Value::Coordinate(value))) => {
                self.pair[self.coordinates] = value;
                self.coordinates += 1;
            }
            Some(Err(wrong)) => {
                self.refuse(wrong, place.depth(), false);
                return Ok(true);
            }
        }
        self.state = State::After(place);
        Ok(true)
    }

    fn begin_moves(&mut self, context: &PathContext<'_>) -> Result<(), PathsError> {
        let agent = self.paths;
        let Some(&start) = context.starts.get(agent) else {
            let wrong = no_agent(agent, context.starts.len());
            self.refuse(wrong, Place::Path.depth(), true);
            return Ok(());
        };
        self.walk = Walk::new(start, context.rows, context.cols);
        self.letters = 0;
        self.state = State::Moves;
        self.push(context, self.walk.cell())
    }

    /// Letters, up to what is none: how many bytes were read.
    fn moves(&mut self, context: &PathContext<'_>, bytes: &[u8]) -> Result<usize, PathsError> {
        let agent = self.paths;
        let cells = self.plan.cells_mut();
        for (at, &letter) in bytes.iter().enumerate() {
            if let Some(cell) = self.walk.step(letter) {
                if cells.len() >= context.max_cells {
                    return Err(PathsError::TooLong { agent });
                }
                cells.push(cell);
                self.letters += 1;
                continue;
            }
            match letter {
                b'"' => self.end_path(context),
                b'\\' => {
                    self.token.clear();
                    self.token.push(letter);
                    self.state = State::Escape;
                }
                _ => self.no_move(letter),
            }
            return Ok(at + 1);
        }
        Ok(bytes.len())
    }

    /// A letter may be written as an escape, though nobody does.
    fn escape(&mut self, context: &PathContext<'_>, byte: u8) -> Result<(), PathsError> {
        self.token.push(byte);
        let wanted = if self.token[1] == b'u' { 6 } else { 2 };
        if self.token.len() < wanted {
            return Ok(());
        }
        let quoted = [b"\"", &self.token[..], b"\""].concat();
        let letters: Option<String> = serde_json::from_slice(&quoted).ok();
        let letter = match letters.as_deref().map(str::as_bytes) {
            Some(&[letter]) => letter,
            _ => b'\\',
        };
        match self.walk.step(letter) {
            Some(cell) => {
                self.push(context, cell)?;
                self.letters += 1;
                self.state = State::Moves;
            }
            None => self.no_move(letter),
        }
        Ok(())
    }

    fn no_move(&mut self, letter: u8) {
        let error = MoveError {
            position: self.letters,
            letter,
        };
        let agent = self.paths;
        let wrong = format!("{error} of the path of agent {agent}");
        self.refuse(wrong, Place::Path.depth(), true);
    }

    fn push(&mut self, context: &PathContext<'_>, cell: u32) -> Result<(), PathsError> {
        let agent = self.paths;
        // The paths of agents that do not exist are counted and not kept.
        if agent < context.starts.len() {
            let cells = self.plan.cells_mut();
            if cells.len() >= context.max_cells {
                return Err(PathsError::TooLong { agent });
            }
            cells.push(cell);
        }
        Ok(())
    }

    fn end_path(&mut self, context: &PathContext<'_>) {
        if self.paths < context.starts.len() {
            self.plan.end_path();
        }
        self.paths += 1;
        self.state = State::After(Place::Path);
    }

    fn mistyped(&self, found: &str, place: Place) -> String {
        let expected = match place {
            Place::Path => {
                let agent = self.paths;
                format!(
                    "the path of agent {agent}: a list of [row, col], of cell indices, or moves"
                )
            }
            Place::Position => "a cell index or [row, col]".into(),
            Place::Coordinate => "a row or column".into(),
        };
        format!("invalid type: {found}, expected {expected}")
    }

    /// Gives up the plan; the rest of it is skipped.
    fn refuse(&mut self, wrong: String, depth: u32, string: bool) {
        self.wrong.get_or_insert(wrong);
        self.plan = GridPlan::default();
        self.state = State::Skip {
            depth,
            string,
            escaped: false,
        };
    }

    fn skip(&mut self, byte: u8) {
        let State::Skip {
            mut depth,
            mut string,
            mut escaped,
        } = self.state
        else {
            return;
        };
        match byte {
            _ if escaped => escaped = false,
            b'\\' if string => escaped = true,
            b'"' => string = !string,
            b'[' | b'{' if !string => depth = depth.saturating_add(1),
            b']' | b'}' if !string => depth -= 1,
            _ => {}
        }
        self.state = match depth {
            0 => State::Done,
            _ => State::Skip {
                depth,
                string,
                escaped,
            },
        };
    }
}

/// The meaning of a number.
enum Value {
    Cell(u32),
    Coordinate(i64),
}

const NO_POSITION: &str = "a position is [row, col]";

/// The sentence for moves of an agent that does not exist.
pub(super) fn no_agent(agent: usize, agents: usize) -> String {
    format!("moves for agent {agent}, but there are {agents} agents")
}

/// A number as nearly all are.
fn number(token: &[u8]) -> Option<i64> {
    let plain = token.len() <= 18
        && token.iter().all(u8::is_ascii_digit)
        && (token.len() == 1 || token[0] != b'0');
    plain.then(|| {
        let digits = token.iter();
        digits.fold(0, |value, digit| value * 10 + i64::from(digit - b'0'))
    })
}

/// A number or a word of JSON, or why it is not what is wanted; `None` if it is none.
fn parse<'a, T: Deserialize<'a>>(token: &'a [u8]) -> Option<Result<T, String>> {
    match serde_json::from_slice(token) {
        Ok(value) => Some(Ok(value)),
        Err(error) if error.is_data() => {
            let text = error.to_string();
            let reason = text.rsplit_once(" at line ").map(|(reason, _)| reason);
            Some(Err(reason.unwrap_or(&text).to_owned()))
        }
        Err(_) => None,
    }
}
