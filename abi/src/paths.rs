//! How paths are written in JSON, here and in plan files.
//!
//! Per agent one of
//!
//! - pairs, `[[row, col], …]`;
//! - cells, `[row * cols + col, …]`;
//! - moves, a string from the agent's start: `N`, `E`, `S`, `W` for a step up,
//!   right, down, left, `.` for a wait, and for diagonal steps the lower-case
//!   letter of the direction 45° anticlockwise of it: `n` up-right, `e`
//!   down-right, `s` down-left, `w` up-left. The start itself is not written:
//!   a string of k letters is a path of k + 1 cells.
//!
//! Reading takes any of the three for any agent, so a writer need not announce
//! what it writes. Positions outside the map become [`OFF_MAP`], which is a
//! fault of the plan and not of its encoding.

use serde::de::{self, DeserializeSeed, SeqAccess, Visitor};
use serde::ser::SerializeSeq;
use serde::{Deserializer, Serialize, Serializer};

use crate::model::{PathEncoding, Plan, PlanRef};

/// A cell index that is on no map.
pub const OFF_MAP: u32 = u32::MAX;

/// The letters of moves and what they do: letter, row change, column change.
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

/// What is needed to read and write paths: the map's size, and where each agent
/// starts (for moves).
#[derive(Debug, Clone, Copy)]
pub struct PathContext<'a> {
    /// Rows of the map.
    pub rows: u32,
    /// Columns of the map.
    pub cols: u32,
    /// Start cell of every agent.
    pub starts: &'a [u32],
    /// Most cells that a plan may have.
    pub max_cells: usize,
}

/// Writes a path as moves, or says that it cannot: it is empty, does not begin
/// at `start`, leaves the map or has a step that is not a move.
pub fn encode_moves(path: &[u32], start: u32, rows: u32, cols: u32) -> Option<String> {
    if path.first() != Some(&start) || cols == 0 || start / cols >= rows {
        return None;
    }
    let mut text = String::with_capacity(path.len() - 1);
    let (mut row, mut col) = (start / cols, start % cols);
    let mut at = start;
    for &cell in &path[1..] {
        if cell == at {
            text.push('.');
            continue;
        }
        let (to_row, to_col) = (cell / cols, cell % cols);
        let dr = i64::from(to_row) - i64::from(row);
        let dc = i64::from(to_col) - i64::from(col);
        let (letter, ..) = MOVES
            .iter()
            .find(|(_, r, c)| i64::from(*r) == dr && i64::from(*c) == dc)
            .filter(|_| to_row < rows)?;
        text.push(char::from(*letter));
        (at, row, col) = (cell, to_row, to_col);
    }
    Some(text)
}

/// Appends the cells of a move string to `path`. Once a step leaves the map the
/// rest is [`OFF_MAP`]. Fails with the index of a letter that is no move.
pub fn decode_moves(
    text: &str,
    start: u32,
    rows: u32,
    cols: u32,
    mut push: impl FnMut(u32),
) -> Result<(), usize> {
    push(start);
    let cols = cols.max(1);
    let (mut row, mut col) = (i64::from(start / cols), i64::from(start % cols));
    let mut on_map = row < i64::from(rows);
    for (index, letter) in text.bytes().enumerate() {
        let (dr, dc) = match letter {
            b'.' => (0, 0),
            b'N' => (-1, 0),
            b'E' => (0, 1),
            b'S' => (1, 0),
            b'W' => (0, -1),
            b'n' => (-1, 1),
            b'e' => (1, 1),
            b's' => (1, -1),
            b'w' => (-1, -1),
            _ => return Err(index),
        };
        row += dr;
        col += dc;
        on_map &= (0..i64::from(rows)).contains(&row) && (0..i64::from(cols)).contains(&col);
        push(if on_map {
            (row * i64::from(cols) + col) as u32
        } else {
            OFF_MAP
        });
    }
    Ok(())
}

/// Serialises the paths of a plan as a list with one entry per agent.
///
/// A path that cannot be written as moves is written as cells, and one with
/// [`OFF_MAP`] too, so that nothing is lost on the way to the validator.
#[derive(Debug, Clone, Copy)]
pub struct WritePaths<'a> {
    /// The plan.
    pub plan: PlanRef<'a>,
    /// The map's size and the starts.
    pub context: PathContext<'a>,
    /// The encoding.
    pub encoding: PathEncoding,
}

impl Serialize for WritePaths<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let PathContext {
            rows, cols, starts, ..
        } = self.context;
        let mut list = serializer.serialize_seq(Some(self.plan.agents()))?;
        for (agent, path) in self.plan.paths().enumerate() {
            match self.encoding {
                PathEncoding::Pairs if path.iter().all(|cell| cell / cols.max(1) < rows) => {
                    list.serialize_element(&Pairs { path, cols })?;
                }
                PathEncoding::Moves => {
                    let start = starts.get(agent).copied().unwrap_or(OFF_MAP);
                    match encode_moves(path, start, rows, cols) {
                        Some(text) => list.serialize_element(&text)?,
                        None => list.serialize_element(path)?,
                    }
                }
                PathEncoding::Pairs | PathEncoding::Cells => list.serialize_element(path)?,
            }
        }
        list.end()
    }
}

struct Pairs<'a> {
    path: &'a [u32],
    cols: u32,
}

impl Serialize for Pairs<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(
            self.path
                .iter()
                .map(|cell| [cell / self.cols, cell % self.cols]),
        )
    }
}

/// Reads what [`WritePaths`] writes, straight into flat arrays.
impl<'de> DeserializeSeed<'de> for PathContext<'_> {
    type Value = Plan;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<Plan, D::Error> {
        deserializer.deserialize_seq(PlanVisitor { context: self })
    }
}

struct PlanVisitor<'a> {
    context: PathContext<'a>,
}

impl<'de> Visitor<'de> for PlanVisitor<'_> {
    type Value = Plan;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a list with one path per agent")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Plan, A::Error> {
        let mut plan = Plan::default();
        let mut agent = 0;
        while seq
            .next_element_seed(PathVisitor {
                context: self.context,
                agent,
                plan: &mut plan,
            })?
            .is_some()
        {
            plan.end_path();
            agent += 1;
        }
        Ok(plan)
    }
}

struct PathVisitor<'a> {
    context: PathContext<'a>,
    agent: usize,
    plan: &'a mut Plan,
}

impl PathVisitor<'_> {
    fn push<E: de::Error>(&mut self, cell: u32) -> Result<(), E> {
        if self.plan.as_ref().cells().len() >= self.context.max_cells {
            let (agent, limit) = (self.agent, self.context.max_cells);
            return Err(E::custom(format_args!(
                "the plan is longer than {limit} cells in the path of agent {agent}"
            )));
        }
        self.plan.push_cell(cell);
        Ok(())
    }
}

impl<'de> DeserializeSeed<'de> for PathVisitor<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for PathVisitor<'_> {
    type Value = ();

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let agent = self.agent;
        write!(
            f,
            "the path of agent {agent}: a list of [row, col], of cell indices, or moves"
        )
    }

    fn visit_str<E: de::Error>(mut self, text: &str) -> Result<(), E> {
        let PathContext {
            rows,
            cols,
            starts,
            max_cells,
        } = self.context;
        let agent = self.agent;
        let start = *starts.get(agent).ok_or_else(|| {
            E::custom(format_args!(
                "moves for agent {agent}, but there are {} agents",
                starts.len()
            ))
        })?;
        let room = max_cells.saturating_sub(self.plan.as_ref().cells().len());
        if text.len() >= room {
            // Let the common message say it.
            return self.push::<E>(start).and_then(|()| {
                Err(E::custom(format_args!(
                    "the plan is longer than {max_cells} cells"
                )))
            });
        }
        decode_moves(text, start, rows, cols, |cell| self.plan.push_cell(cell)).map_err(|index| {
            let letter = text.as_bytes()[index];
            E::custom(format_args!(
                "letter '{}' at position {index} of the path of agent {agent} is no move",
                letter.escape_ascii()
            ))
        })
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut seq: A) -> Result<(), A::Error> {
        let PathContext { rows, cols, .. } = self.context;
        let cells = u64::from(rows) * u64::from(cols);
        while let Some(position) = seq.next_element::<Position>()? {
            let cell = match position {
                Position::Cell(cell) if (cell as u64) < cells && cell >= 0 => cell as u32,
                Position::Pair(row, col)
                    if (0..i64::from(rows)).contains(&row)
                        && (0..i64::from(cols)).contains(&col) =>
                {
                    (row * i64::from(cols) + col) as u32
                }
                Position::Cell(_) | Position::Pair(..) => OFF_MAP,
            };
            self.push(cell)?;
        }
        Ok(())
    }
}

enum Position {
    Cell(i64),
    Pair(i64, i64),
}

impl<'de> serde::Deserialize<'de> for Position {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct PositionVisitor;

        impl<'de> Visitor<'de> for PositionVisitor {
            type Value = Position;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a cell index or [row, col]")
            }

            fn visit_u64<E: de::Error>(self, cell: u64) -> Result<Position, E> {
                Ok(Position::Cell(i64::try_from(cell).unwrap_or(-1)))
            }

            fn visit_i64<E: de::Error>(self, cell: i64) -> Result<Position, E> {
                Ok(Position::Cell(cell))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Position, A::Error> {
                let missing = || de::Error::custom("a position is [row, col]");
                let row = seq.next_element()?.ok_or_else(missing)?;
                let col = seq.next_element()?.ok_or_else(missing)?;
                if seq.next_element::<de::IgnoredAny>()?.is_some() {
                    return Err(missing());
                }
                Ok(Position::Pair(row, col))
            }
        }

        deserializer.deserialize_any(PositionVisitor)
    }
}
