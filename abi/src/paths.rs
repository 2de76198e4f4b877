//! Plans in JSON, and the encodings of paths on grids, here and in plan files.
//!
//! A path is for each agent one of
//!
//! - pairs, `[[row, col], …]`;
//! - cells, `[row * cols + col, …]`;
//! - moves, a string with a letter per step from the agent's start, see
//!   [`crate::moves`]. The start itself is not written: a string of k letters is
//!   a path of k + 1 cells.
//!
//! Reading takes any of the three for any agent, so a writer need not announce
//! what it writes. Positions outside the map become [`OFF_MAP`], which is a
//! fault of the plan and not of its encoding.

mod motions;
mod reader;

use serde::de::{self, DeserializeOwned, DeserializeSeed, SeqAccess, Visitor};
use serde::ser::{SerializeMap, SerializeSeq};
use serde::{Deserializer, Serialize, Serializer};
use serde_json::value::RawValue;

use crate::environment::{Environment, View};
use crate::lists::Lists;
use crate::model::{Instance, PathEncoding};
use crate::moves::{self, OFF_MAP};
use crate::plan::{GridPlan, Plan, PlanRef};
use crate::wire::PlanText;

pub use reader::{PathsError, PathsReader};

/// The context of reading and writing paths: the map's size, and the start of each agent (for
/// moves).
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

impl PathContext<'_> {
    /// The sentence for a plan with more cells than [`Self::max_cells`].
    pub fn too_long(&self, agent: usize) -> String {
        let limit = self.max_cells;
        format!("the plan is longer than {limit} cells in the path of agent {agent}")
    }
}

/// The context of reading and writing plans: their form, and what it takes to read one.
#[derive(Debug, Clone, Copy)]
pub enum PlanContext<'a> {
    /// On a grid.
    Paths(PathContext<'a>),
    /// On a roadmap; the most visits that a plan may have.
    Visits(usize),
    /// In the plane; the most knots and segments that a plan may have.
    Trajectories(usize),
}

impl<'a> PlanContext<'a> {
    /// Of the plans for an instance in an environment, of at most so many entries.
    pub fn new(environment: &Environment, instance: &'a Instance, most: usize) -> Self {
        match &environment.view {
            View::Grid(grid) => Self::Paths(PathContext {
                rows: grid.rows,
                cols: grid.cols,
                starts: &instance.starts,
                max_cells: most,
            }),
            View::Roadmap(_) => Self::Visits(most),
            View::Workspace(_) => Self::Trajectories(most),
        }
    }

    /// The field of a message that has a plan of this form.
    pub fn field(&self) -> &'static str {
        match self {
            Self::Paths(_) => "paths",
            Self::Visits(_) => "visits",
            Self::Trajectories(_) => "trajectories",
        }
    }

    /// Refuses a plan of another form.
    pub fn check(&self, plan: PlanRef<'_>) -> Result<(), String> {
        if plan.field() == self.field() {
            return Ok(());
        }
        Err(self.other_form())
    }

    fn other_form(&self) -> String {
        format!(
            "a plan of another form than `{}`, which this map takes",
            self.field()
        )
    }

    /// The context of paths, if they are on a grid.
    pub fn paths(self) -> Option<PathContext<'a>> {
        match self {
            Self::Paths(context) => Some(context),
            Self::Visits(_) | Self::Trajectories(_) => None,
        }
    }

    /// The plan of a message; `None` when it has none.
    pub fn read(&self, text: &PlanText<'_>) -> Result<Option<Plan>, String> {
        let (own, others) = match self {
            Self::Paths(_) => (text.paths, [text.visits, text.trajectories]),
            Self::Visits(_) => (text.visits, [text.paths, text.trajectories]),
            Self::Trajectories(_) => (text.trajectories, [text.paths, text.visits]),
        };
        if others.iter().any(Option::is_some) {
            return Err(self.other_form());
        }
        own.map(|own| self.read_field(own)).transpose()
    }

    fn read_field(&self, text: &RawValue) -> Result<Plan, String> {
        let text = text.get();
        match *self {
            Self::Paths(context) => context
                .deserialize(&mut serde_json::Deserializer::from_str(text))
                .map(Plan::Cells)
                .map_err(|error| error.to_string()),
            Self::Visits(most) => lists(text, most).map(Plan::Visits),
            Self::Trajectories(most) => motions::read(text, most).map(Plan::Trajectories),
        }
    }
}

fn lists<T: DeserializeOwned>(text: &str, most: usize) -> Result<Lists<T>, String> {
    let lists: Lists<T> = serde_json::from_str(text).map_err(|error| error.to_string())?;
    if lists.items().len() > most {
        return Err(format!("the plan is longer than {most} entries"));
    }
    Ok(lists)
}

/// Serialises a plan as an object with the field of its form.
#[derive(Debug, Clone, Copy)]
pub struct WritePlan<'a> {
    /// The plan.
    pub plan: PlanRef<'a>,
    /// The map's size and the starts, when it is one on a grid.
    pub context: PlanContext<'a>,
    /// The encoding of paths.
    pub encoding: PathEncoding,
}

impl Serialize for WritePlan<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut object = serializer.serialize_map(Some(1))?;
        match (self.plan, self.context) {
            (PlanRef::Cells(plan), PlanContext::Paths(context)) => {
                let paths = WritePaths {
                    plan,
                    context,
                    encoding: self.encoding,
                };
                object.serialize_entry("paths", &paths)?;
            }
            // The reader finds that cells are no plan here.
            (PlanRef::Cells(plan), _) => object.serialize_entry("paths", plan.lists())?,
            (PlanRef::Visits(plan), _) => object.serialize_entry("visits", plan)?,
            (PlanRef::Trajectories(plan), _) => {
                object.serialize_entry("trajectories", &motions::Write(plan))?;
            }
        }
        object.end()
    }
}

/// Serialises the paths of a plan as a list with one entry per agent.
///
/// A path that cannot be written as moves is written as cells, and one that leaves
/// the map too, so that nothing is lost on the way to the validator.
#[derive(Debug, Clone, Copy)]
pub struct WritePaths<'a> {
    /// The plan.
    pub plan: &'a GridPlan,
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
        let cells = u64::from(rows) * u64::from(cols);
        let mut list = serializer.serialize_seq(Some(self.plan.agents()))?;
        for (agent, path) in self.plan.paths().enumerate() {
            // What is outside has no pair, and a walk that leaves the map does not
            // come back.
            let on_map = || path.iter().all(|cell| u64::from(*cell) < cells);
            match self.encoding {
                PathEncoding::Pairs if on_map() => {
                    list.serialize_element(&Pairs { path, cols })?;
                }
                PathEncoding::Moves if on_map() => {
                    let start = starts.get(agent).copied().unwrap_or(OFF_MAP);
                    let moves = moves::encode(path, cols).filter(|_| path[0] == start);
                    match moves {
                        Some(text) => list.serialize_element(&text)?,
                        None => list.serialize_element(path)?,
                    }
                }
                PathEncoding::Pairs | PathEncoding::Cells | PathEncoding::Moves => {
                    list.serialize_element(path)?;
                }
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
    type Value = GridPlan;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<GridPlan, D::Error> {
        deserializer.deserialize_seq(PlanVisitor { context: self })
    }
}

struct PlanVisitor<'a> {
    context: PathContext<'a>,
}

impl<'de> Visitor<'de> for PlanVisitor<'_> {
    type Value = GridPlan;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a list with one path per agent")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<GridPlan, A::Error> {
        let mut plan = GridPlan::default();
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
    plan: &'a mut GridPlan,
}

impl PathVisitor<'_> {
    fn too_long<E: de::Error>(&self) -> E {
        E::custom(self.context.too_long(self.agent))
    }

    fn push<E: de::Error>(&mut self, cell: u32) -> Result<(), E> {
        if self.plan.cells_mut().len() >= self.context.max_cells {
            return Err(self.too_long());
        }
        self.plan.cells_mut().push(cell);
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

    fn visit_str<E: de::Error>(self, text: &str) -> Result<(), E> {
        let PathContext {
            rows,
            cols,
            starts,
            max_cells,
        } = self.context;
        let agent = self.agent;
        let no_agent = || E::custom(reader::no_agent(agent, starts.len()));
        let start = *starts.get(agent).ok_or_else(no_agent)?;
        let cells = self.plan.cells_mut();
        if text.len() >= max_cells.saturating_sub(cells.len()) {
            return Err(self.too_long());
        }
        moves::decode_into(start, text, rows, cols, cells)
            .map_err(|error| E::custom(format_args!("{error} of the path of agent {agent}")))
    }

    fn visit_seq<A: SeqAccess<'de>>(mut self, mut seq: A) -> Result<(), A::Error> {
        while let Some(position) = seq.next_element::<Position>()? {
            let cell = position.cell(&self.context);
            self.push(cell)?;
        }
        Ok(())
    }
}

enum Position {
    Cell(i64),
    Pair(i64, i64),
}

impl Position {
    /// The cell of a map; [`OFF_MAP`] outside of it.
    fn cell(&self, context: &PathContext<'_>) -> u32 {
        let PathContext { rows, cols, .. } = *context;
        let cells = u64::from(rows) * u64::from(cols);
        match *self {
            Self::Cell(cell) if cell >= 0 && (cell as u64) < cells => cell as u32,
            Self::Pair(row, col)
                if (0..i64::from(rows)).contains(&row) && (0..i64::from(cols)).contains(&col) =>
            {
                (row * i64::from(cols) + col) as u32
            }
            Self::Cell(_) | Self::Pair(..) => OFF_MAP,
        }
    }
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
                Ok(Position::Cell(saturate(cell)))
            }

            fn visit_i64<E: de::Error>(self, cell: i64) -> Result<Position, E> {
                Ok(Position::Cell(cell))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Position, A::Error> {
                let missing = || de::Error::custom("a position is [row, col]");
                let Coordinate(row) = seq.next_element()?.ok_or_else(missing)?;
                let Coordinate(col) = seq.next_element()?.ok_or_else(missing)?;
                if seq.next_element::<de::IgnoredAny>()?.is_some() {
                    return Err(missing());
                }
                Ok(Position::Pair(row, col))
            }
        }

        deserializer.deserialize_any(PositionVisitor)
    }
}

/// A row or a column: any integer that JSON can hold, however far outside it is.
struct Coordinate(i64);

impl<'de> serde::Deserialize<'de> for Coordinate {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct CoordinateVisitor;

        impl Visitor<'_> for CoordinateVisitor {
            type Value = Coordinate;

            fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                f.write_str("a row or column")
            }

            fn visit_u64<E: de::Error>(self, value: u64) -> Result<Coordinate, E> {
                Ok(Coordinate(saturate(value)))
            }

            fn visit_i64<E: de::Error>(self, value: i64) -> Result<Coordinate, E> {
                Ok(Coordinate(value))
            }
        }

        deserializer.deserialize_i64(CoordinateVisitor)
    }
}

/// A number that is too large stays outside every map.
fn saturate(value: u64) -> i64 {
    i64::try_from(value).unwrap_or(i64::MAX)
}
