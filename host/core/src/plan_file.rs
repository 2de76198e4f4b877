//! Plan files: the format `fleetyard.plan/1`, one JSON object.
//!
//! ```json
//! {
//!   "format": "fleetyard.plan/1",
//!   "planner": "pibt 0.1.0",
//!   "instance_digest": "0123456789abcdef0123456789abcdef",
//!   "plan_digest": "fedcba9876543210fedcba9876543210",
//!   "map": "empty-8-8",
//!   "rows": 8,
//!   "cols": 8,
//!   "encoding": "pairs",
//!   "paths": [
//!     [[0, 0], [0, 1], [0, 1]],
//!     [[4, 4]]
//!   ]
//! }
//! ```
//!
//! `paths` is needed, and `rows` and `cols` where nothing else says how large the map is. The rest is
//! optional and unknown keys are refused. Keys may come in any order. `paths` has one entry
//! per agent, in the order of the instance, from time 0 to its last arrival;
//! `encoding` says how each is written:
//!
//! | encoding | a path is |
//! | --- | --- |
//! | `pairs` (default) | a list of `[row, column]` |
//! | `cells` | a list of cell indices, `row · cols + column` |
//! | `moves` | an object `{"start": [row, column], "moves": "NNE."}` with the letters of [`crate::moves`] |
//!
//! Positions outside the map, negative ones included, are read as
//! [`OFF_MAP`], so that the validator can say which agent is where at
//! which time; they are written as `[-1, -1]` or `-1`. `instance_digest` ties a
//! plan to its instance, and `plan_digest` to its content: a file whose paths do
//! not have the digest that it names is refused.

use std::fmt;
use std::fmt::Write as _;
use std::path::Path;

use serde::Deserialize;
use serde::de::{self, DeserializeSeed, Deserializer, IgnoredAny, MapAccess, SeqAccess, Visitor};

use crate::files::{load_file, write_atomically};
use crate::formats::MapSize;
use crate::json::{self, Listed, ReadList, check_digest, push_lines, push_list, read_object};
use crate::path_list::{Paths, ReadPaths};
use crate::{Digest, Grid, GridInstance, GridPlan, InputError, OFF_MAP, PathEncoding, moves};

/// Largest plan file that is read, in bytes.
pub const PLAN_FILE_LIMIT: u64 = 1 << 31;

/// Most cells all paths of a plan file may have together.
pub const PLAN_MAX_CELLS: usize = 1 << 29;

/// The value of `format`.
pub const PLAN_FORMAT: &str = "fleetyard.plan/1";

/// The content of a plan file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PlanFile {
    /// The file, for error messages.
    pub source: String,
    /// The author of the plan, as free text.
    pub planner: Option<String>,
    /// The instance that the plan is for.
    pub instance_digest: Option<Digest>,
    /// Digest of the paths; after reading it is known to be right.
    pub plan_digest: Option<Digest>,
    /// Name of the map.
    pub map: Option<String>,
    /// Rows of the map.
    pub rows: u32,
    /// Columns of the map.
    pub cols: u32,
    /// Encoding of the paths in the file that was read or will be written.
    pub encoding: PathEncoding,
    /// The paths.
    pub plan: GridPlan,
}

impl PlanFile {
    /// A plan for an instance, with digests, ready to be written.
    pub fn new(instance: &GridInstance, plan: GridPlan) -> Self {
        let grid = instance.grid();
        Self {
            source: "plan".to_owned(),
            planner: None,
            instance_digest: Some(instance.digest()),
            plan_digest: Some(Digest::of_plan(&plan)),
            map: Some(grid.name().to_owned()),
            rows: grid.rows(),
            cols: grid.cols(),
            encoding: PathEncoding::default(),
            plan,
        }
    }

    /// Refuses a plan that is for a map of another size.
    pub fn check_map(&self, grid: &Grid) -> Result<(), InputError> {
        let (rows, cols) = (grid.rows(), grid.cols());
        if (self.rows, self.cols) == (rows, cols) {
            return Ok(());
        }
        let reason = format!(
            "the plan is for a map of {} rows and {} columns, but {} has {rows} and {cols}",
            self.rows,
            self.cols,
            grid.name()
        );
        let error = InputError::new(self.source.as_str(), reason);
        Err(match &self.map {
            Some(map) => error.hint(format!("the plan names the map {map}")),
            None => error.hint("is --map the right map?"),
        })
    }

    /// Refuses a plan that is for a map of another size, or that names another
    /// instance. The number of agents is left to the validator.
    pub fn check_for(&self, instance: &GridInstance) -> Result<(), InputError> {
        self.check_map(instance.grid())?;
        match self.instance_digest {
            Some(named) if named != instance.digest() => Err(InputError::new(
                self.source.as_str(),
                format!(
                    "the plan is for instance {named}, but this instance is {}",
                    instance.digest()
                ),
            )
            .hint(
                "check map, scenario, number of agents and connectivity; \
                 to judge it all the same, remove instance_digest from the file",
            )),
            _ => Ok(()),
        }
    }
}

/// Reads and parses a plan file.
pub fn load_plan(path: impl AsRef<Path>) -> Result<PlanFile, InputError> {
    load_file(path, PLAN_FILE_LIMIT, read_plan)
}

/// Parses the content of a plan file. `source` is named in errors.
pub fn read_plan(source: &str, bytes: &[u8]) -> Result<PlanFile, InputError> {
    read_plan_on(source, bytes, None)
}

/// The same of a plan on a map whose size is known, which the file need not say then.
pub fn read_plan_on(
    source: &str,
    bytes: &[u8],
    size: Option<MapSize>,
) -> Result<PlanFile, InputError> {
    let hint = "a plan file is a JSON object with paths, and with rows and cols of its map";
    read_object::<Document>(source, bytes, hint)?.into_plan_file(source, size)
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a plan: a JSON object")]
struct Document {
    #[serde(default, deserialize_with = "format")]
    format: (),
    planner: Option<String>,
    instance_digest: Option<Digest>,
    plan_digest: Option<Digest>,
    map: Option<String>,
    rows: Option<u32>,
    cols: Option<u32>,
    #[serde(default)]
    encoding: PathEncoding,
    paths: Paths<RawPaths>,
}

impl Document {
    fn into_plan_file(self, source: &str, size: Option<MapSize>) -> Result<PlanFile, InputError> {
        let () = self.format;
        let rows = self.rows.or(size.map(|size| size.rows));
        let cols = self.cols.or(size.map(|size| size.cols));
        let (Some(rows), Some(cols)) = (rows, cols) else {
            let reason = "the file does not say how large its map is";
            return Err(InputError::new(source, reason)
                .hint("name the map with --map FILE, or give the file `rows` and `cols`"));
        };
        let cells = u64::from(rows) * u64::from(cols);
        if cells == 0 || cells > Grid::MAX_CELLS {
            let reason = format!("a map of {rows} rows and {cols} columns is empty or too large");
            return Err(InputError::new(source, reason)
                .hint(format!("a map has between 1 and {} cells", Grid::MAX_CELLS)));
        }
        let Paths(paths) = self.paths;
        if let Some((agent, found)) = paths.kind_of(self.encoding) {
            let encoding = self.encoding;
            let reason = format!("the encoding is {encoding}, but path {agent} is {found}");
            return Err(InputError::new(source, reason)
                .hint("set \"encoding\" to pairs, cells or moves, as the paths are"));
        }
        let plan = paths.into_plan(rows, cols);
        let named = self.plan_digest;
        check_digest(source, "plan_digest", named, "the paths have", || {
            Digest::of_plan(&plan)
        })?;
        Ok(PlanFile {
            source: source.to_owned(),
            planner: self.planner,
            instance_digest: self.instance_digest,
            plan_digest: self.plan_digest,
            map: self.map,
            rows,
            cols,
            encoding: self.encoding,
            plan,
        })
    }
}

fn format<'de, D: Deserializer<'de>>(deserializer: D) -> Result<(), D::Error> {
    json::format(deserializer, PLAN_FORMAT)
}

/// All paths as the file has them. Rows and columns of the map may come later
/// in the file, so cells are only computed at the end.
#[derive(Default)]
struct RawPaths {
    paths: Vec<RawPath>,
    /// Positions of all paths in pairs or cells, one after the other.
    positions: Vec<Position>,
    /// Number of cells of all paths with moves.
    walked: usize,
}

/// Row and column, or a cell index and `CELL`. Negative and huge values are
/// already saturated to `OUTSIDE`.
type Position = (u32, u32);
const OUTSIDE: u32 = u32::MAX;
const CELL: u32 = u32::MAX - 1;

enum RawPath {
    Empty,
    /// End of the path in `RawPaths::positions`.
    Pairs(usize),
    Cells(usize),
    Moves {
        start: Position,
        letters: String,
    },
}

impl RawPaths {
    /// The first path that is not in `encoding`, and what it is.
    fn kind_of(&self, encoding: PathEncoding) -> Option<(usize, &'static str)> {
        self.paths.iter().enumerate().find_map(|(agent, path)| {
            let (kind, found) = match path {
                RawPath::Empty => return None,
                RawPath::Pairs(_) => (PathEncoding::Pairs, "a list of pairs"),
                RawPath::Cells(_) => (PathEncoding::Cells, "a list of cells"),
                RawPath::Moves { .. } => (PathEncoding::Moves, "an object with moves"),
            };
            (kind != encoding).then_some((agent, found))
        })
    }

    fn into_plan(self, rows: u32, cols: u32) -> GridPlan {
        let to_cell = |(row, col): Position| match (row, col) {
            (cell, CELL) if cell < rows * cols => cell,
            (row, col) if row < rows && col < cols => row * cols + col,
            _ => OFF_MAP,
        };
        let mut plan = GridPlan::with_capacity(self.paths.len(), self.positions.len());
        let mut begin = 0;
        let mut walked = Vec::new();
        for path in self.paths {
            match path {
                RawPath::Empty => plan.push_path([]),
                RawPath::Pairs(end) | RawPath::Cells(end) => {
                    let range = &self.positions[begin..end];
                    plan.push_path(range.iter().map(|at| to_cell(*at)));
                    begin = end;
                }
                RawPath::Moves { start, letters } => {
                    walked.clear();
                    // The letters were checked while they were read.
                    let known =
                        moves::decode_into(to_cell(start), &letters, rows, cols, &mut walked);
                    debug_assert_eq!(known, Ok(()));
                    plan.push_path(walked.iter().copied());
                }
            }
        }
        plan
    }
}

impl ReadPaths for RawPaths {
    fn read_path<'de, A: SeqAccess<'de>>(&mut self, list: &mut A) -> Result<Option<()>, A::Error> {
        let Some(path) = list.next_element_seed(PathSeed(&mut self.positions))? else {
            return Ok(None);
        };
        if let RawPath::Moves { letters, .. } = &path {
            self.walked += letters.len() + 1;
        }
        if self.positions.len() + self.walked > PLAN_MAX_CELLS {
            return Err(too_long());
        }
        self.paths.push(path);
        Ok(Some(()))
    }

    fn agents(&self) -> usize {
        self.paths.len()
    }
}

fn too_long<E: de::Error>() -> E {
    E::custom(format!("the paths have more than {PLAN_MAX_CELLS} cells"))
}

struct PathSeed<'a>(&'a mut Vec<Position>);

impl<'de> DeserializeSeed<'de> for PathSeed<'_> {
    type Value = RawPath;

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<RawPath, D::Error> {
        deserializer.deserialize_any(self)
    }
}

impl<'de> Visitor<'de> for PathSeed<'_> {
    type Value = RawPath;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a path: a list of [row, column], a list of cells, or an object with moves")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<RawPath, A::Error> {
        let Some(first) = list.next_element::<AnyPosition>()? else {
            return Ok(RawPath::Empty);
        };
        self.0.push(first.0);
        if first.0.1 == CELL {
            while let Some(cell) = list.next_element::<CellPosition>()? {
                if self.0.len() == PLAN_MAX_CELLS {
                    return Err(too_long());
                }
                self.0.push((cell.0, CELL));
            }
            return Ok(RawPath::Cells(self.0.len()));
        }
        while let Some(pair) = list.next_element::<PairPosition>()? {
            if self.0.len() == PLAN_MAX_CELLS {
                return Err(too_long());
            }
            self.0.push(pair.0);
        }
        Ok(RawPath::Pairs(self.0.len()))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<RawPath, A::Error> {
        #[derive(Deserialize)]
        #[serde(field_identifier, rename_all = "lowercase")]
        enum Key {
            Start,
            Moves,
        }

        let mut start: Option<PairPosition> = None;
        let mut letters: Option<String> = None;
        while let Some(key) = map.next_key::<Key>()? {
            match key {
                Key::Start if start.is_some() => return Err(de::Error::duplicate_field("start")),
                Key::Start => start = Some(map.next_value()?),
                Key::Moves if letters.is_some() => return Err(de::Error::duplicate_field("moves")),
                Key::Moves => {
                    let text: String = map.next_value()?;
                    moves::check(&text).map_err(de::Error::custom)?;
                    letters = Some(text);
                }
            }
        }
        let start = start.ok_or_else(|| de::Error::missing_field("start"))?.0;
        let letters = letters.ok_or_else(|| de::Error::missing_field("moves"))?;
        Ok(RawPath::Moves { start, letters })
    }
}

/// A coordinate or cell index; what is not on any map is [`OUTSIDE`].
#[derive(Clone, Copy)]
struct CellPosition(u32);

impl<'de> Deserialize<'de> for CellPosition {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct IntegerVisitor;

        impl Visitor<'_> for IntegerVisitor {
            type Value = CellPosition;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an integer")
            }

            fn visit_u64<E: de::Error>(self, value: u64) -> Result<CellPosition, E> {
                Ok(CellPosition(saturate(value)))
            }

            fn visit_i64<E: de::Error>(self, value: i64) -> Result<CellPosition, E> {
                Ok(CellPosition(u64::try_from(value).map_or(OUTSIDE, saturate)))
            }
        }

        deserializer.deserialize_u64(IntegerVisitor)
    }
}

/// Keeps what can be an index on the largest map.
fn saturate(value: u64) -> u32 {
    if value < Grid::MAX_CELLS {
        value as u32
    } else {
        OUTSIDE
    }
}

struct PairPosition(Position);

impl<'de> Deserialize<'de> for PairPosition {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Listed(Pair).deserialize(deserializer).map(Self)
    }
}

struct Pair;

impl<'de> ReadList<'de> for Pair {
    const EXPECTED: &'static str = "a pair [row, column]";
    type Value = Position;

    fn read<A: SeqAccess<'de>>(self, mut list: A) -> Result<Position, A::Error> {
        let wrong = |found: &str| {
            de::Error::custom(format!("a position is a pair [row, column], found {found}"))
        };
        let row: CellPosition = list.next_element()?.ok_or_else(|| wrong("an empty list"))?;
        let col: CellPosition = list.next_element()?.ok_or_else(|| wrong("one number"))?;
        if list.next_element::<IgnoredAny>()?.is_some() {
            return Err(wrong("more than two entries"));
        }
        Ok((row.0, col.0))
    }
}

/// The first position of a path, which decides between pairs and cells.
struct AnyPosition(Position);

impl<'de> Deserialize<'de> for AnyPosition {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct AnyVisitor;

        impl<'de> Visitor<'de> for AnyVisitor {
            type Value = AnyPosition;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a pair [row, column] or a cell index")
            }

            fn visit_u64<E: de::Error>(self, value: u64) -> Result<AnyPosition, E> {
                Ok(AnyPosition((saturate(value), CELL)))
            }

            fn visit_i64<E: de::Error>(self, value: i64) -> Result<AnyPosition, E> {
                let cell = u64::try_from(value).map_or(OUTSIDE, saturate);
                Ok(AnyPosition((cell, CELL)))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<AnyPosition, A::Error> {
                Pair.read(list).map(AnyPosition)
            }
        }

        deserializer.deserialize_any(AnyVisitor)
    }
}

/// The content of a plan file, one path per line.
///
/// A plan with an empty path, or with a step that is not a unit move, has no
/// move strings; asked for [`PathEncoding::Moves`], it is written in pairs.
pub fn write_plan(file: &PlanFile) -> Vec<u8> {
    let mut encoding = file.encoding;
    let mut strings = Vec::new();
    if encoding == PathEncoding::Moves {
        let paths = file.plan.paths();
        match paths.map(|path| moves::encode(path, file.cols)).collect() {
            Some(all) => strings = all,
            None => encoding = PathEncoding::Pairs,
        }
    }
    let optional = [
        ("planner", file.planner.clone()),
        ("instance_digest", json::text(file.instance_digest)),
        ("plan_digest", json::text(file.plan_digest)),
        ("map", file.map.clone()),
    ];
    let mut text = json::begin(PLAN_FORMAT, &optional);
    text.reserve(256 + 8 * file.plan.cells().len());
    let (rows, cols) = (file.rows, file.cols);
    let _ = writeln!(text, "  \"rows\": {rows},\n  \"cols\": {cols},");
    let _ = writeln!(text, "  \"encoding\": \"{encoding}\",");
    let paths = file.plan.paths().enumerate();
    push_lines(
        &mut text,
        "paths",
        paths,
        |text, (agent, path)| match encoding {
            PathEncoding::Moves => {
                let (row, col) = row_col(path[0], file);
                let letters = &strings[agent];
                let _ = write!(text, r#"{{"start": [{row}, {col}], "moves": "{letters}"}}"#);
            }
            PathEncoding::Pairs => push_list(text, path, |text, cell| {
                let (row, col) = row_col(*cell, file);
                let _ = write!(text, "[{row},{col}]");
            }),
            PathEncoding::Cells => push_list(text, path, |text, cell| {
                let cell = if is_on_map(*cell, file) {
                    i64::from(*cell)
                } else {
                    -1
                };
                let _ = write!(text, "{cell}");
            }),
        },
    );
    text.push_str("\n}\n");
    text.into_bytes()
}

fn is_on_map(cell: u32, file: &PlanFile) -> bool {
    u64::from(cell) < u64::from(file.rows) * u64::from(file.cols)
}

fn row_col(cell: u32, file: &PlanFile) -> (i64, i64) {
    if is_on_map(cell, file) {
        (i64::from(cell / file.cols), i64::from(cell % file.cols))
    } else {
        (-1, -1)
    }
}

/// Writes a plan file, replacing an old one as a whole.
pub fn save_plan(file: &PlanFile, path: impl AsRef<Path>) -> Result<(), InputError> {
    write_atomically(path.as_ref(), &write_plan(file))
}
