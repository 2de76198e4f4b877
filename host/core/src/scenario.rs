//! MovingAI `.scen` files: start and goal pairs on a named map.
//!
//! The format is that of Sturtevant's "Benchmarks for Grid-Based Pathfinding"
//! (2012), as the MAPF benchmarks of Stern et al. (2019) use it: a line
//! `version 1` (old files have none), then per agent nine fields separated by
//! tabs or blanks: bucket, map, map width, map height, start column, start row,
//! goal column, goal row, optimal length. An instance of `n` agents takes the
//! first `n` lines. Coordinates in a file are x, y; here they are row, column.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::files::{Lines, check_line_ends, column, load_file, quote, stem, write_atomically};
use crate::{Connectivity, Grid, GridInstance, GridSearch, InputError, InstanceError};

/// Largest `.scen` file that is read, in bytes.
pub const SCEN_FILE_LIMIT: u64 = 1 << 28;

/// One line of a scenario: an agent's start and goal.
#[derive(Debug, Clone, PartialEq)]
pub struct ScenarioEntry {
    /// Line in the file, from 1; 0 if it is from no file.
    pub line: u64,
    /// Quarter of the optimal length, rounded down, by convention.
    pub bucket: u32,
    /// The map as the file names it, often a path.
    pub map: String,
    /// Width of the map.
    pub map_cols: u32,
    /// Height of the map.
    pub map_rows: u32,
    /// Row and column of the start.
    pub start: (u32, u32),
    /// Row and column of the goal.
    pub goal: (u32, u32),
    /// Length of a shortest path of straight moves of 1 and diagonal moves of √2.
    pub optimal_length: f64,
}

/// A scenario: a list of start–goal pairs.
#[derive(Debug, Clone, PartialEq)]
pub struct Scenario {
    /// The file, for error messages.
    pub source: String,
    /// In the order of the file.
    pub entries: Vec<ScenarioEntry>,
}

impl Scenario {
    /// A scenario of starts and goals, cells of `grid`, with the lengths of shortest
    /// paths, which take a search each; a goal that is out of reach has length 0. `map` is the map's
    /// file.
    pub fn of(grid: &Grid, map: &str, agents: impl IntoIterator<Item = (u32, u32)>) -> Self {
        let mut search = GridSearch::new(grid);
        let agents = agents.into_iter().map(|(start, goal)| {
            let length = search.octile(start, goal).unwrap_or_default().cells();
            ((start, goal), length)
        });
        let agents: Vec<_> = agents.collect();
        Self::with_lengths(grid, map, agents)
    }

    /// The same where lengths are known, or taken to be 0.
    pub fn with_lengths(
        grid: &Grid,
        map: &str,
        agents: impl IntoIterator<Item = ((u32, u32), f64)>,
    ) -> Self {
        let entry = |((start, goal), length): ((u32, u32), f64)| ScenarioEntry {
            line: 0,
            bucket: (length / 4.0).floor() as u32,
            map: map.to_owned(),
            map_cols: grid.cols(),
            map_rows: grid.rows(),
            start: grid.row_col(start),
            goal: grid.row_col(goal),
            optimal_length: length,
        };
        Self {
            source: format!("{}.scen", grid.name()),
            entries: agents.into_iter().map(entry).collect(),
        }
    }

    /// The map that the first entry names, without folders and extension.
    pub fn map_name(&self) -> Option<&str> {
        self.entries.first().map(|entry| stem(&entry.map))
    }

    /// The instance of the first `agents` entries on `grid`.
    ///
    /// Everything that can be wrong is an error that names the scenario's line:
    /// too few entries, entries for a map of another size, starts or goals outside the map,
    /// on obstacles or twice among those agents, goals out of reach. A map of another name is none:
    /// see [`Scenario::check_name`].
    pub fn instance(
        &self,
        grid: Arc<Grid>,
        agents: usize,
        connectivity: Connectivity,
    ) -> Result<GridInstance, InputError> {
        if agents == 0 {
            return Err(InputError::new(
                self.source.as_str(),
                "an instance needs at least one agent",
            )
            .hint(format!("ask for 1 to {} agents", self.entries.len())));
        }
        let Some(entries) = self.entries.get(..agents) else {
            let available = self.entries.len();
            let reason = format!("{agents} agents asked for, but the scenario has {available}");
            let error = InputError::new(self.source.as_str(), reason);
            return Err(match available {
                0 => error,
                _ => error.hint(format!("ask for at most {available} agents")),
            });
        };
        let mut starts = Vec::with_capacity(agents);
        let mut goals = Vec::with_capacity(agents);
        for entry in entries {
            self.check_size(entry, &grid)?;
            for (what, at, cells) in [
                ("start", entry.start, &mut starts),
                ("goal", entry.goal, &mut goals),
            ] {
                let (row, col) = at;
                let Some(cell) = grid.cell(row, col) else {
                    let (rows, cols) = (grid.rows(), grid.cols());
                    let reason = format!(
                        "the {what} at row {row}, column {col} is outside the map \
                         of {rows} rows and {cols} columns"
                    );
                    return Err(self
                        .fault(entry, reason)
                        .hint("scenario files give x (the column) before y (the row)"));
                };
                cells.push(cell);
            }
        }
        GridInstance::new(grid, connectivity, starts, goals)
            .map_err(|error| self.instance_fault(&error))
    }

    /// Refuses a map of another name than that which the entries name.
    pub fn check_name(&self, grid: &Grid) -> Result<(), InputError> {
        let mut entries = self.entries.iter();
        let Some(entry) = entries.find(|entry| stem(&entry.map) != grid.name()) else {
            return Ok(());
        };
        let named = stem(&entry.map);
        let reason = format!("the scenario is for map {named}, not for {}", grid.name());
        let hint = format!("use the map {}", entry.map);
        Err(self.fault(entry, reason).hint(hint))
    }

    fn check_size(&self, entry: &ScenarioEntry, grid: &Grid) -> Result<(), InputError> {
        let (rows, cols) = (grid.rows(), grid.cols());
        if (entry.map_rows, entry.map_cols) == (rows, cols) {
            return Ok(());
        }
        let reason = format!(
            "the scenario is for a map of {} rows and {} columns, but {} has {rows} and {cols}",
            entry.map_rows,
            entry.map_cols,
            grid.name()
        );
        let hint = if (entry.map_cols, entry.map_rows) == (rows, cols) {
            "scenario files give the width before the height".to_owned()
        } else {
            format!(
                "use the map {}; if this is it, write its width {cols} and height {rows} as the third \
                 and fourth field",
                entry.map
            )
        };
        Err(self.fault(entry, reason).hint(hint))
    }

    fn instance_fault(&self, error: &InstanceError) -> InputError {
        let line_of = |agent: usize| self.entries.get(agent).map_or(0, |entry| entry.line);
        let mut reason = error.to_string();
        if let InstanceError::Duplicate { first, .. } = error
            && line_of(*first) > 0
        {
            let _ = write!(reason, " (agent {first} is on line {})", line_of(*first));
        }
        let fault = InputError::new(self.source.as_str(), reason);
        match error.agent().map(line_of) {
            Some(line) if line > 0 => fault.at_line(line),
            _ => fault,
        }
    }

    fn fault(&self, entry: &ScenarioEntry, reason: impl Into<String>) -> InputError {
        let error = InputError::new(self.source.as_str(), reason);
        match entry.line {
            0 => error,
            line => error.at_line(line),
        }
    }
}

/// The file of the map `name` that a scenario is for: one of `places`, each the file of a
/// map or a folder with `NAME.map`, or else beside the scenario's file. `option` is what
/// users name places with.
pub fn find_map(
    name: &str,
    scenario: &Path,
    places: &[PathBuf],
    option: &str,
) -> Result<PathBuf, InputError> {
    let inside = |folder: &Path| folder.join(format!("{name}.map"));
    let mut candidates: Vec<PathBuf> = Vec::new();
    for place in places {
        if place.is_dir() {
            candidates.push(inside(place));
        } else if places.len() == 1 || place.file_stem().is_some_and(|stem| stem == name) {
            // A file that is the only one is meant: reading it says what is wrong with it.
            return Ok(place.clone());
        }
    }
    if places.is_empty() {
        candidates.push(inside(scenario.parent().unwrap_or(Path::new(""))));
    }
    let found = candidates.iter().find(|candidate| candidate.is_file());
    found.cloned().ok_or_else(|| {
        let reason = format!("the scenario is for map {name}, which was not found");
        let hint = match candidates.as_slice() {
            [] => format!("name its file by {option} as well"),
            [only] => format!("there is no {}; {option} says where it is", only.display()),
            _ => format!("none of the folders of {option} has {name}.map"),
        };
        InputError::new(scenario.display().to_string(), reason).hint(hint)
    })
}

/// Reads and parses a `.scen` file.
pub fn load_scen(path: impl AsRef<Path>) -> Result<Scenario, InputError> {
    load_file(path, SCEN_FILE_LIMIT, read_scen)
}

/// Parses the content of a `.scen` file. `source` is named in errors.
pub fn read_scen(source: &str, bytes: &[u8]) -> Result<Scenario, InputError> {
    check_line_ends(source, bytes)?;
    let mut lines = Lines::new(bytes);
    let mut entries = Vec::new();
    while !lines.only_blank_left() {
        let Some((number, line)) = lines.next() else {
            break;
        };
        let begin = line.trim_ascii_start();
        let is_version = is_version(begin);
        if is_version && number == 1 {
            read_version(source, number, line)?;
            continue;
        }
        if is_version || begin.starts_with(b"#") {
            let what = if is_version {
                "another version line"
            } else {
                "a comment"
            };
            let reason = format!("{what}, which scenarios do not have here");
            return Err(InputError::new(source, reason)
                .at(number, 1)
                .hint("remove the line"));
        }
        entries.push(read_entry(source, number, line)?);
    }
    if entries.is_empty() {
        let reason = if bytes.trim_ascii().is_empty() {
            "the file is empty"
        } else {
            "the scenario has no entries"
        };
        return Err(InputError::new(source, reason)
            .hint("a scenario has a line 'version 1' and then one line of nine fields per agent"));
    }
    Ok(Scenario {
        source: source.to_owned(),
        entries,
    })
}

/// True of a line with the version, in whatever case.
fn is_version(line: &[u8]) -> bool {
    let word = line.get(..b"version".len());
    word.is_some_and(|word| word.eq_ignore_ascii_case(b"version"))
}

fn read_version(source: &str, number: u64, line: &[u8]) -> Result<(), InputError> {
    let value = &line.trim_ascii()[b"version".len()..];
    match value.trim_ascii() {
        b"1" | b"1.0" if value.first().is_some_and(u8::is_ascii_whitespace) => Ok(()),
        other => {
            let reason = format!("scenario version {} is not supported", quote(other));
            let at = line.len() - line.trim_ascii_start().len();
            Err(InputError::new(source, reason)
                .at(number, column(line, at))
                .hint("supported is 'version 1', or no version line"))
        }
    }
}

const FIELDS: [&str; 9] = [
    "bucket",
    "map name",
    "map width",
    "map height",
    "start x",
    "start y",
    "goal x",
    "goal y",
    "optimal length",
];

fn read_entry(source: &str, number: u64, line: &[u8]) -> Result<ScenarioEntry, InputError> {
    let place =
        |at: usize, reason: String| InputError::new(source, reason).at(number, column(line, at));
    if line.trim_ascii().is_empty() {
        return Err(place(0, "blank line between entries".into()).hint("remove the line"));
    }
    let text = std::str::from_utf8(line)
        .map_err(|error| place(error.valid_up_to(), "the line is not UTF-8 text".into()))?;
    // Map names may contain blanks, so tabs decide where there are any.
    let fields = split(text, |letter| letter == '\t')
        .or_else(|_| split(text, |letter| letter == ' ' || letter == '\t'));
    let fields = fields.map_err(|found| {
        let reason = format!("a scenario line has 9 fields, found {found}");
        let at = if found > 9 { 0 } else { line.len() };
        place(at, reason).hint(
            "the fields are bucket, map, width, height, start x, start y, goal x, goal y, \
             optimal length",
        )
    })?;
    let integer = |at: usize| -> Result<u32, InputError> {
        let (offset, field) = fields[at];
        let digits = !field.is_empty() && field.bytes().all(|byte| byte.is_ascii_digit());
        match field.parse::<u32>() {
            Ok(value) if digits => Ok(value),
            _ => {
                let wrong = if digits {
                    "too large"
                } else {
                    "not a whole number of 0 or more"
                };
                let what = FIELDS[at];
                Err(place(
                    offset,
                    format!("the {what} {} is {wrong}", quote(field.as_bytes())),
                ))
            }
        }
    };
    let (length_at, length) = fields[8];
    let optimal_length = length
        .parse::<f64>()
        .ok()
        .filter(|value| value.is_finite() && *value >= 0.0)
        .ok_or_else(|| {
            let reason = format!(
                "the optimal length {} is not a number of 0 or more",
                quote(length.as_bytes())
            );
            let hint = length
                .contains(',')
                .then_some("write a point before its decimals");
            place(length_at, reason).maybe_hint(hint)
        })?;
    let (map_at, map) = fields[1];
    if map.is_empty() {
        return Err(place(map_at, "the map name is empty".into()));
    }
    if let Some(at) = map.find(char::is_control) {
        let reason = format!(
            "the map name {} has a control character",
            quote(map.as_bytes())
        );
        return Err(place(map_at + at, reason));
    }
    Ok(ScenarioEntry {
        line: number,
        bucket: integer(0)?,
        map: map.to_owned(),
        map_cols: integer(2)?,
        map_rows: integer(3)?,
        start: (integer(5)?, integer(4)?),
        goal: (integer(7)?, integer(6)?),
        optimal_length,
    })
}

/// Exactly nine trimmed fields with their byte offsets, or how many there are.
/// Empty fields between blanks do not count; between tabs they do.
fn split(text: &str, separator: impl Fn(char) -> bool) -> Result<[(usize, &str); 9], usize> {
    let blanks = separator(' ');
    let mut fields = [(0, ""); 9];
    let mut found = 0;
    let mut at = 0;
    let whole = text.trim_end_matches([' ', '\t']);
    for part in whole.split(separator) {
        let field = part.trim_matches(' ');
        if !(blanks && field.is_empty()) {
            if let Some(slot) = fields.get_mut(found) {
                let lead = part.len() - part.trim_start_matches(' ').len();
                *slot = (at + lead, field);
            }
            found += 1;
        }
        at += part.len() + 1;
    }
    if found == 9 { Ok(fields) } else { Err(found) }
}

/// The content of a `.scen` file. Reading it gives the same scenario but for the
/// source, the lines, and digits of the optimal length beyond the eighth.
///
/// Control characters in a map's name, which the format cannot hold, are written
/// as blanks.
pub fn write_scen(scenario: &Scenario) -> Vec<u8> {
    let mut text = String::from("version 1\n");
    for entry in &scenario.entries {
        let map = entry.map.replace(char::is_control, " ");
        let _ = writeln!(
            text,
            "{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}\t{:.8}",
            entry.bucket,
            map,
            entry.map_cols,
            entry.map_rows,
            entry.start.1,
            entry.start.0,
            entry.goal.1,
            entry.goal.0,
            entry.optimal_length
        );
    }
    text.into_bytes()
}

/// Writes a `.scen` file, replacing an old one as a whole.
pub fn save_scen(scenario: &Scenario, path: impl AsRef<Path>) -> Result<(), InputError> {
    write_atomically(path.as_ref(), &write_scen(scenario))
}
