//! Paths as lines of text, as most solvers write them, read strictly by a [`Layout`].
//!
//! A layout is small on purpose. It says which lines carry paths, whether a line is
//! an agent's path, a time step of all agents, or one agent at one time, and how a
//! position is written. The named formats are layouts too, so there is one reader:
//!
//! - `lacam`, the result files of lacam, lacam2, lacam3 and pibt2: after a line
//!   `solution=` a line per time step, `t:(x,y),(x,y),`;
//! - `paths-txt`, the path files of the solvers CBSH2-RTC, EECBS, PBS and MAPF-LNS2:
//!   a line per agent, `Agent 0: (row,col)->(row,col)->`;
//! - `mapf-visualizer`, what that program shows, <https://github.com/Kei18/mapf-visualizer>:
//!   the lines of `lacam` alone. A position may say where its agent looks,
//!   `(x,y,Y_MINUS)`; a plan does not keep it, so that turns become waits.
//!
//! Plans are not validated here; a position outside the map becomes [`OFF_MAP`] for
//! the validator to find.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use regex::bytes::Regex;
use serde::Deserialize;

use super::{Piece, pieces};
use crate::files::{cut, shown};
use crate::path_list::PLAN_MAX_AGENTS;
use crate::{GridPlan, InputError, OFF_MAP};

/// The largest file of paths that is read, in bytes.
pub const PATHS_LIMIT: u64 = 1 << 28;

/// Most positions in an answer.
const MOST_CELLS: usize = 1 << 27;

/// The content of a line of paths.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
pub enum Major {
    /// An agent's path.
    #[serde(rename = "agent-major")]
    Agent,
    /// The positions of all agents at one time.
    #[serde(rename = "time-major")]
    Time,
    /// The position of one agent at one time.
    #[serde(rename = "rows")]
    Row,
}

/// A part of a line.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Token {
    /// Exactly this, after any blanks.
    Text(String),
    /// The number of the agent.
    Agent,
    /// The number of the time step.
    Time,
    /// Positions with separators, or a single one in a row.
    Path,
    Row,
    Col,
    Cell,
    /// The heading of an agent, after a comma: `,Y_MINUS`. It may be missing.
    Heading,
}

/// The form of an answer.
#[derive(Debug, Clone)]
pub struct Layout {
    /// The content of a line of paths.
    pub major: Major,
    /// A line with paths, one [`Token::Path`] in it.
    line: Vec<Token>,
    /// A position.
    position: Vec<Token>,
    /// Between positions; empty for blanks.
    separator: String,
    /// The first row, column and cell.
    pub coordinates_from: i64,
    /// The first agent and time step.
    pub index_from: i64,
    /// Lines at the beginning that carry nothing.
    pub skip_lines: u64,
    /// Lines up to the first that matches carry nothing.
    pub begin: Option<Begin>,
    /// The first line that matches, and all after it, carry nothing.
    pub end: Option<Regex>,
    /// Lines that match carry nothing.
    pub ignore: Option<Regex>,
}

/// The line after which the paths begin.
#[derive(Debug, Clone)]
pub enum Begin {
    /// The line that is this.
    Line(&'static str),
    /// The first line that matches.
    Pattern(Regex),
}

impl Begin {
    fn is(&self, line: &[u8]) -> bool {
        match self {
            Self::Line(text) => line == text.as_bytes(),
            Self::Pattern(pattern) => pattern.is_match(line),
        }
    }
}

impl std::fmt::Display for Begin {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Line(text) => write!(f, "'{text}'"),
            Self::Pattern(pattern) => write!(f, "that matches '{pattern}'"),
        }
    }
}

/// The reason why a text is no part of a [`Layout`].
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LayoutError {
    /// The part: `line`, `position` or `separator`.
    pub part: &'static str,
    /// The reason.
    pub reason: String,
    /// A way out.
    pub hint: &'static str,
}

impl Layout {
    /// From the texts of a manifest: `line` as in `Agent {agent}: {path}` or, of rows,
    /// `{agent},{time},{position}`, `position` as in `({row},{col})`, and what stands
    /// between positions.
    pub fn new(
        major: Major,
        line: &str,
        position: &str,
        separator: &str,
    ) -> Result<Self, LayoutError> {
        let line = line_tokens(major, line)?;
        let position = position_tokens(position)?;
        let separator = separator.trim();
        if separator.starts_with(|letter: char| letter.is_ascii_digit()) {
            return fault(
                "separator",
                "the separator reads like a number",
                "a separator is text such as \",\" or \"->\", or a blank",
            );
        }
        Ok(Self::plain(major, line, position, separator))
    }

    fn plain(major: Major, line: Vec<Token>, position: Vec<Token>, separator: &str) -> Self {
        Self {
            major,
            line,
            position,
            separator: separator.into(),
            coordinates_from: 0,
            index_from: 0,
            skip_lines: 0,
            begin: None,
            end: None,
            ignore: None,
        }
    }

    /// The format `lacam`.
    pub fn lacam() -> Self {
        let line = vec![Token::Time, Token::Text(":".into()), Token::Path];
        let position = bracketed(Token::Col, Token::Row);
        Self {
            begin: Some(Begin::Line("solution=")),
            ..Self::plain(Major::Time, line, position, ",")
        }
    }

    /// The format `mapf-visualizer`.
    pub fn mapf_visualizer() -> Self {
        let mut layout = Self {
            begin: None,
            ..Self::lacam()
        };
        let end = layout.position.len() - 1;
        layout.position.insert(end, Token::Heading);
        layout
    }

    /// The format `paths-txt`.
    pub fn paths_txt() -> Self {
        let line = vec![
            Token::Text("Agent".into()),
            Token::Agent,
            Token::Text(":".into()),
            Token::Path,
        ];
        Self::plain(Major::Agent, line, bracketed(Token::Row, Token::Col), "->")
    }

    /// Reads the paths of so many agents, or of as many as there are, on a map of so
    /// many rows and columns; `source` is named in errors.
    pub fn read(
        &self,
        source: &str,
        bytes: &[u8],
        size: MapSize,
        agents: Option<usize>,
    ) -> Result<GridPlan, InputError> {
        let reader = Reader {
            layout: self,
            source,
            size,
            agents,
        };
        match self.major {
            Major::Agent => reader.by_agent(bytes),
            Major::Time => reader.by_time(bytes),
            Major::Row => reader.by_row(bytes),
        }
    }
}

/// `(first,second)`
fn bracketed(first: Token, second: Token) -> Vec<Token> {
    let text = |text: &str| Token::Text(text.into());
    vec![text("("), first, text(","), second, text(")")]
}

/// Rows and columns.
#[derive(Debug, Clone, Copy)]
pub struct MapSize {
    /// Number of rows, the height in cells.
    pub rows: u32,
    /// Number of columns, the width in cells.
    pub cols: u32,
}

fn fault<T>(
    part: &'static str,
    reason: impl Into<String>,
    hint: &'static str,
) -> Result<T, LayoutError> {
    let reason = reason.into();
    Err(LayoutError { part, reason, hint })
}

/// Tokens of a text with names in braces.
fn tokens(
    part: &'static str,
    text: &str,
    names: &[(&str, Token)],
    hint: &'static str,
) -> Result<Vec<Token>, LayoutError> {
    let Ok(pieces) = pieces(text) else {
        return fault(part, "a single brace", hint);
    };
    for pair in pieces.windows(2) {
        if let [Piece::Name(one), Piece::Name(other)] = pair {
            let (one, other) = (shown(one), shown(other));
            let reason = format!("nothing stands between `{{{one}}}` and `{{{other}}}`");
            return fault(part, reason, hint);
        }
    }
    let mut found = Vec::new();
    for piece in pieces {
        match piece {
            // Blanks in a text stand for any number of them, and none.
            Piece::Text(literal) => {
                let words = literal.split_whitespace();
                found.extend(words.map(|word| Token::Text(word.into())));
            }
            Piece::Name(name) => {
                let token = names.iter().find(|(known, _)| *known == name);
                let Some((_, token)) = token else {
                    let name = shown(&name);
                    return fault(part, format!("unknown placeholder `{{{name}}}`"), hint);
                };
                found.push(token.clone());
            }
        }
    }
    Ok(found)
}

fn line_tokens(major: Major, text: &str) -> Result<Vec<Token>, LayoutError> {
    let agent = ("agent", Token::Agent);
    let time = ("time", Token::Time);
    let (path, numbers, hint) = match major {
        Major::Agent => (
            "path",
            vec![agent],
            "a line is one agent's path, as in \"Agent {agent}: {path}\"",
        ),
        Major::Time => (
            "path",
            vec![time],
            "a line is one time step, as in \"{time}: {path}\"",
        ),
        Major::Row => (
            "position",
            vec![agent, time],
            "a line is one agent at one time, as in \"{agent},{time},{position}\"",
        ),
    };
    let mut names = vec![(path, Token::Path)];
    names.extend(numbers.iter().cloned());
    let tokens = tokens("line", text, &names, hint)?;
    let count = |wanted: &Token| tokens.iter().filter(|token| *token == wanted).count();
    // Who and when can be counted, but not both.
    let needed = names.iter().take(if major == Major::Row { 3 } else { 1 });
    for (name, token) in needed {
        if count(token) != 1 {
            return fault("line", format!("the line needs `{{{name}}}` once"), hint);
        }
    }
    for (name, token) in &numbers {
        if count(token) > 1 {
            return fault("line", format!("the line has `{{{name}}}` twice"), hint);
        }
    }
    Ok(tokens)
}

fn position_tokens(text: &str) -> Result<Vec<Token>, LayoutError> {
    const HINT: &str = "a position is \"({row},{col})\", \"({x},{y})\" or \"{cell}\", \
                        with any text around the names";
    let names = [
        ("row", Token::Row),
        ("col", Token::Col),
        ("y", Token::Row),
        ("x", Token::Col),
        ("cell", Token::Cell),
    ];
    let tokens = tokens("position", text, &names, HINT)?;
    let count = |wanted: &Token| tokens.iter().filter(|token| *token == wanted).count();
    if !matches!(
        (count(&Token::Row), count(&Token::Col), count(&Token::Cell)),
        (1, 1, 0) | (0, 0, 1)
    ) {
        return fault(
            "position",
            "the position needs a row and a column, or a cell",
            HINT,
        );
    }
    Ok(tokens)
}

/// A line that is read from left to right.
struct Cursor<'a> {
    source: &'a str,
    number: u64,
    line: &'a [u8],
    at: usize,
}

impl Cursor<'_> {
    fn rest(&self) -> &[u8] {
        &self.line[self.at..]
    }

    fn skip_blanks(&mut self) {
        let blank = |byte: &&u8| matches!(byte, b' ' | b'\t');
        self.at += self.rest().iter().take_while(blank).count();
    }

    fn at_end(&self) -> bool {
        self.at == self.line.len()
    }

    fn next_is(&self, text: &str) -> bool {
        self.rest().starts_with(text.as_bytes())
    }

    fn error(&self, reason: impl Into<String>) -> InputError {
        let before = String::from_utf8_lossy(&self.line[..self.at]);
        let column = before.chars().count() as u64 + 1;
        InputError::new(self.source, reason).at(self.number, column)
    }

    fn expected(&self, what: &str) -> InputError {
        const SHOWN: usize = 20;
        let rest = self.rest();
        let found = if rest.is_empty() {
            "the end of the line".to_owned()
        } else {
            let text = String::from_utf8_lossy(&rest[..rest.len().min(4 * SHOWN)]);
            format!("'{}'", cut(&text, SHOWN))
        };
        self.error(format!("expected {what}, found {found}"))
    }

    fn text(&mut self, text: &str) -> Result<(), InputError> {
        self.skip_blanks();
        if !self.next_is(text) {
            return Err(self.expected(&format!("'{}'", text.escape_debug())));
        }
        self.at += text.len();
        Ok(())
    }

    /// A comma and where an agent looks, if there is a comma.
    fn heading(&mut self) -> Result<(), InputError> {
        const HEADINGS: [&str; 4] = ["X_PLUS", "X_MINUS", "Y_PLUS", "Y_MINUS"];
        self.skip_blanks();
        if !self.next_is(",") {
            return Ok(());
        }
        self.at += 1;
        let Some(heading) = HEADINGS.iter().find(|heading| self.next_is(heading)) else {
            return Err(self.expected("X_PLUS, X_MINUS, Y_PLUS or Y_MINUS"));
        };
        self.at += heading.len();
        Ok(())
    }

    /// A whole number; never so long that arithmetic on it overflows.
    fn number(&mut self, what: &str) -> Result<i64, InputError> {
        const DIGITS: usize = 15;
        self.skip_blanks();
        let negative = self.next_is("-");
        let digits = &self.rest()[usize::from(negative)..];
        let count = digits
            .iter()
            .take_while(|byte| byte.is_ascii_digit())
            .count();
        if count == 0 {
            return Err(self.expected(what));
        }
        if count > DIGITS {
            return Err(self.error(format!("{what} has more than {DIGITS} digits")));
        }
        let value = digits[..count]
            .iter()
            .fold(0, |value, digit| value * 10 + i64::from(digit - b'0'));
        self.at += usize::from(negative) + count;
        Ok(if negative { -value } else { value })
    }
}

/// The agent and the time that a line names.
#[derive(Debug, Default)]
struct Numbers {
    agent: Option<i64>,
    time: Option<i64>,
}

struct Reader<'a> {
    layout: &'a Layout,
    source: &'a str,
    size: MapSize,
    agents: Option<usize>,
}

impl<'a> Reader<'a> {
    /// Calls `each` with every line that carries paths and says which line was the
    /// last. Blank lines at the end carry nothing.
    fn lines(
        &self,
        bytes: &'a [u8],
        mut each: impl FnMut(Cursor<'a>) -> Result<(), InputError>,
    ) -> Result<u64, InputError> {
        let layout = self.layout;
        let mut begin = layout.begin.as_ref();
        let mut blank: Option<Cursor<'a>> = None;
        let mut last = 0;
        for (number, line) in (1..).zip(bytes.split(|byte| *byte == b'\n')) {
            let line = line.strip_suffix(b"\r").unwrap_or(line);
            last = number;
            if number <= layout.skip_lines {
                continue;
            }
            if let Some(pattern) = begin {
                if pattern.is(line) {
                    begin = None;
                }
                continue;
            }
            let matches = |pattern: &Option<Regex>| {
                pattern
                    .as_ref()
                    .is_some_and(|pattern| pattern.is_match(line))
            };
            if matches(&layout.end) {
                break;
            }
            if matches(&layout.ignore) {
                continue;
            }
            let cursor = Cursor {
                source: self.source,
                number,
                line,
                at: 0,
            };
            if line.trim_ascii().is_empty() {
                blank.get_or_insert(cursor);
                continue;
            }
            if let Some(blank) = blank {
                return Err(blank.error("a blank line between lines with paths"));
            }
            each(cursor)?;
        }
        match begin {
            None => Ok(last),
            Some(pattern) => {
                let reason = format!("there is no line {pattern}");
                Err(InputError::new(self.source, reason)
                    .hint("the answer is in another format, or was cut off"))
            }
        }
    }

    /// Reads a line and appends its positions; the numbers of its agent and time step,
    /// those that it has.
    fn line(&self, cursor: &mut Cursor<'_>, cells: &mut Vec<u32>) -> Result<Numbers, InputError> {
        let mut numbers = Numbers::default();
        let from = self.layout.index_from;
        let tokens = &self.layout.line;
        for (at, token) in tokens.iter().enumerate() {
            match token {
                Token::Text(text) => cursor.text(text)?,
                Token::Agent => {
                    numbers.agent = Some(cursor.number("the number of an agent")? - from);
                }
                Token::Time => numbers.time = Some(cursor.number("a time step")? - from),
                _ if self.layout.major == Major::Row => cells.push(self.position(cursor)?),
                _ => self.path(cursor, tokens.get(at + 1), cells)?,
            }
        }
        cursor.skip_blanks();
        if cursor.at_end() {
            Ok(numbers)
        } else {
            Err(cursor.expected("the end of the line"))
        }
    }

    fn after_position(&self, after: Option<&Token>) -> String {
        let end = match after {
            Some(Token::Text(text)) => format!("'{}'", text.escape_debug()),
            _ => "the end of the line".to_owned(),
        };
        match self.layout.separator.as_str() {
            "" => end,
            separator => format!("'{}' or {end}", separator.escape_debug()),
        }
    }

    /// Positions up to the end of the line, or up to the text in `after`. One
    /// separator too many at the end is usual.
    fn path(
        &self,
        cursor: &mut Cursor<'_>,
        after: Option<&Token>,
        cells: &mut Vec<u32>,
    ) -> Result<(), InputError> {
        let separator = &self.layout.separator;
        let ended = |cursor: &mut Cursor<'_>| {
            cursor.skip_blanks();
            match after {
                Some(Token::Text(text)) => cursor.next_is(text),
                _ => cursor.at_end(),
            }
        };
        loop {
            cells.push(self.position(cursor)?);
            if cells.len() > MOST_CELLS {
                return Err(cursor.error(format!("more than {MOST_CELLS} positions")));
            }
            if ended(cursor) {
                return Ok(());
            }
            if separator.is_empty() {
                continue;
            }
            if !cursor.next_is(separator) {
                return Err(cursor.expected(&self.after_position(after)));
            }
            cursor.at += separator.len();
            if ended(cursor) {
                return Ok(());
            }
        }
    }

    fn position(&self, cursor: &mut Cursor<'_>) -> Result<u32, InputError> {
        let from = self.layout.coordinates_from;
        let (rows, cols) = (i64::from(self.size.rows), i64::from(self.size.cols));
        let (mut row, mut col) = (0, 0);
        for token in &self.layout.position {
            match token {
                Token::Text(text) => cursor.text(text)?,
                Token::Row => row = cursor.number("a row")? - from,
                Token::Col => col = cursor.number("a column")? - from,
                Token::Heading => cursor.heading()?,
                _ => {
                    let cell = cursor.number("a cell")? - from;
                    (row, col) = (cell.div_euclid(cols.max(1)), cell.rem_euclid(cols.max(1)));
                }
            }
        }
        let inside = (0..rows).contains(&row) && (0..cols).contains(&col);
        Ok(if inside {
            (row * cols + col) as u32
        } else {
            OFF_MAP
        })
    }

    fn most_agents(&self) -> i64 {
        self.agents.unwrap_or(PLAN_MAX_AGENTS) as i64
    }

    fn no_such_agent(&self, cursor: &Cursor<'_>, agent: i64) -> InputError {
        let many = if self.agents.is_some() {
            ""
        } else {
            "at most "
        };
        let (most, from) = (self.most_agents(), self.layout.index_from);
        cursor.error(format!(
            "a path for agent {agent}, but there are {many}{most} agents, from {from} on"
        ))
    }

    fn by_agent(&self, bytes: &'a [u8]) -> Result<GridPlan, InputError> {
        let from = self.layout.index_from;
        let most = self.most_agents();
        let mut cells = Vec::new();
        // Per agent its line and its range of `cells`.
        let mut paths: BTreeMap<i64, (u64, std::ops::Range<usize>)> = BTreeMap::new();
        let last = self.lines(bytes, |mut cursor| {
            let begin = cells.len();
            let index = self.line(&mut cursor, &mut cells)?.agent;
            let index = index.unwrap_or(paths.len() as i64);
            cursor.at = 0;
            let agent = index + from;
            if !(0..most).contains(&index) {
                return Err(self.no_such_agent(&cursor, agent));
            }
            if let Some((line, _)) = paths.get(&index) {
                return Err(cursor.error(format!(
                    "a second path for agent {agent}; the first is on line {line}"
                )));
            }
            paths.insert(index, (cursor.number, begin..cells.len()));
            Ok(())
        })?;
        let agents = match (self.agents, paths.last_key_value()) {
            (Some(agents), _) => agents as i64,
            (None, Some((index, _))) => index + 1,
            (None, None) => {
                let reason = "there are no paths";
                return Err(InputError::new(self.source, reason).at_line(last));
            }
        };
        let mut plan = GridPlan::with_capacity(paths.len(), cells.len());
        for index in 0..agents {
            let Some((_, range)) = paths.get(&index) else {
                let reason = format!(
                    "there is no path for agent {}: {} paths for {agents} agents",
                    index + from,
                    paths.len(),
                );
                return Err(InputError::new(self.source, reason).at_line(last));
            };
            plan.push_path(cells[range.clone()].iter().copied());
        }
        Ok(plan)
    }

    fn by_time(&self, bytes: &'a [u8]) -> Result<GridPlan, InputError> {
        let mut cells = Vec::new();
        let mut steps: i64 = 0;
        let mut agents = self.agents;
        let last = self.lines(bytes, |mut cursor| {
            let before = cells.len();
            let index = self.line(&mut cursor, &mut cells)?.time;
            cursor.at = 0;
            if let Some(index) = index.filter(|index| *index != steps) {
                let from = self.layout.index_from;
                let (found, wanted) = (index + from, steps + from);
                return Err(cursor.error(format!("expected time step {wanted}, found {found}")));
            }
            let found = cells.len() - before;
            let wanted = *agents.get_or_insert(found);
            if found != wanted {
                return Err(cursor.error(format!("{found} positions for {wanted} agents")));
            }
            if found > PLAN_MAX_AGENTS {
                return Err(cursor.error(format!("more than {PLAN_MAX_AGENTS} agents")));
            }
            steps += 1;
            Ok(())
        })?;
        let Some(agents) = agents.filter(|_| steps > 0) else {
            let reason = "there are no time steps in the answer";
            return Err(InputError::new(self.source, reason).at_line(last));
        };
        let mut plan = GridPlan::with_capacity(agents, cells.len());
        for agent in 0..agents {
            plan.push_path(cells.iter().skip(agent).step_by(agents).copied());
        }
        Ok(plan)
    }
}

impl<'a> Reader<'a> {
    /// Rows in any order, without gaps in the time of an agent.
    fn by_row(&self, bytes: &'a [u8]) -> Result<GridPlan, InputError> {
        let from = self.layout.index_from;
        // Agent, time, line and cell of each.
        let mut rows: Vec<(u32, u32, u32, u32)> = Vec::new();
        let mut cells = Vec::new();
        let last = self.lines(bytes, |mut cursor| {
            cells.clear();
            let numbers = self.line(&mut cursor, &mut cells)?;
            cursor.at = 0;
            let (agent, time) = (numbers.agent.unwrap_or(0), numbers.time.unwrap_or(0));
            if !(0..self.most_agents()).contains(&agent) {
                return Err(self.no_such_agent(&cursor, agent + from));
            }
            if !(0..MOST_CELLS as i64).contains(&time) {
                let reason = format!("time step {} is out of range", time + from);
                return Err(cursor.error(reason));
            }
            if rows.len() == MOST_CELLS {
                return Err(cursor.error(format!("more than {MOST_CELLS} positions")));
            }
            let numbers = (agent as u32, time as u32, cursor.number as u32);
            let cells = cells.iter();
            rows.extend(cells.map(|cell| (numbers.0, numbers.1, numbers.2, *cell)));
            Ok(())
        })?;
        rows.sort_unstable();
        let mut agents = 0;
        let mut plan =
            GridPlan::with_capacity(self.agents.unwrap_or(0).min(rows.len()), rows.len());
        let fault = |line: u64, reason: String| InputError::new(self.source, reason).at_line(line);
        for own in rows.chunk_by(|a, b| a.0 == b.0) {
            let agent = i64::from(own[0].0) + from;
            let line = u64::from(own[0].2);
            if own[0].0 != agents {
                let missing = i64::from(agents) + from;
                let reason = format!("there is no row for agent {missing}, but one for {agent}");
                return Err(fault(line, reason));
            }
            let mut steps = 0;
            for (_, time, line, _) in own {
                let reason = match time.checked_sub(steps) {
                    Some(0) => {
                        steps += 1;
                        continue;
                    }
                    Some(_) => "there is none for time step",
                    None => "there is a second one for time step",
                };
                let step = i64::from(steps.min(*time)) + from;
                let reason = format!("of the rows for agent {agent} {reason} {step}");
                return Err(fault(u64::from(*line), reason));
            }
            plan.push_path(own.iter().map(|row| row.3));
            agents += 1;
        }
        let wanted = self.agents.unwrap_or((agents as usize).max(1));
        if (agents as usize) < wanted {
            let missing = i64::from(agents) + from;
            let reason = format!("there is no row for agent {missing} of {wanted}");
            return Err(fault(last, reason));
        }
        Ok(plan)
    }
}

/// Refuses plans that cannot be written as lines of positions: there has to be an agent, and every
/// agent needs a position.
pub(super) fn check_paths(plan: &GridPlan) -> Result<(), InputError> {
    if plan.agents() == 0 {
        return Err(InputError::new("plan", "there are no agents in the plan"));
    }
    match plan.paths().position(<[u32]>::is_empty) {
        None => Ok(()),
        Some(agent) => {
            let reason =
                format!("the path of agent {agent} is empty, which this format cannot say");
            Err(InputError::new("plan", reason))
        }
    }
}

/// Row and column for writing; what is not on the map is at -1, -1.
pub(super) fn row_col(cell: u32, size: MapSize) -> (i64, i64) {
    if u64::from(cell) < u64::from(size.rows) * u64::from(size.cols) {
        (i64::from(cell / size.cols), i64::from(cell % size.cols))
    } else {
        (-1, -1)
    }
}

/// The content of a file in the format `paths-txt`.
///
/// A plan without agents or with an empty path is an error.
pub fn write_paths_txt(plan: &GridPlan, size: MapSize) -> Result<Vec<u8>, InputError> {
    check_paths(plan)?;
    let mut text = String::with_capacity(10 * plan.cells().len());
    for (agent, path) in plan.paths().enumerate() {
        let _ = write!(text, "Agent {agent}: ");
        for cell in path {
            let (row, col) = row_col(*cell, size);
            let _ = write!(text, "({row},{col})->");
        }
        text.push('\n');
    }
    Ok(text.into_bytes())
}

/// Lines above the paths in a file of the format `lacam`.
#[derive(Debug, Clone, Copy, Default)]
pub struct LacamHeader<'a> {
    /// Name of the map's file.
    pub map_file: Option<&'a str>,
    /// Start cells.
    pub starts: Option<&'a [u32]>,
    /// Goal cells.
    pub goals: Option<&'a [u32]>,
}

/// The content of a file in the format `lacam`. Agents whose paths are shorter stay
/// where they are.
///
/// A plan without agents or with an empty path is an error.
pub fn write_lacam(
    header: &LacamHeader<'_>,
    plan: &GridPlan,
    size: MapSize,
) -> Result<Vec<u8>, InputError> {
    let steps = write_mapf_visualizer(plan, size)?;
    let mut text = format!("agents={}\n", plan.agents());
    if let Some(name) = header.map_file {
        let name = name.replace(char::is_control, " ");
        let _ = writeln!(text, "map_file={name}");
    }
    text.push_str("solved=1\n");
    for (key, cells) in [("starts", header.starts), ("goals", header.goals)] {
        if let Some(cells) = cells {
            let _ = write!(text, "{key}=");
            positions(&mut text, cells.iter().copied(), size);
        }
    }
    text.push_str("solution=\n");
    let mut bytes = text.into_bytes();
    bytes.extend_from_slice(&steps);
    Ok(bytes)
}

/// The content of a file in the format `mapf-visualizer`: a line per time step.
///
/// A plan without agents or with an empty path is an error.
pub fn write_mapf_visualizer(plan: &GridPlan, size: MapSize) -> Result<Vec<u8>, InputError> {
    check_paths(plan)?;
    let steps = plan.horizon() + 1;
    if steps.saturating_mul(plan.agents()) > MOST_CELLS {
        let reason = format!("the plan has more than {MOST_CELLS} positions, written step by step");
        return Err(InputError::new("plan", reason));
    }
    let mut text = String::with_capacity(8 * steps * plan.agents());
    for time in 0..steps {
        let _ = write!(text, "{time}:");
        positions(
            &mut text,
            (0..plan.agents()).map(|agent| plan.at(agent, time)),
            size,
        );
    }
    Ok(text.into_bytes())
}

fn positions(text: &mut String, cells: impl Iterator<Item = u32>, size: MapSize) {
    for cell in cells {
        let (row, col) = row_col(cell, size);
        let _ = write!(text, "({col},{row}),");
    }
    text.push('\n');
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SIZE: MapSize = MapSize { rows: 3, cols: 4 };

    fn read(layout: &Layout, text: &str, agents: usize) -> Result<Vec<Vec<u32>>, String> {
        let plan = layout
            .read("answer", text.as_bytes(), SIZE, Some(agents))
            .map_err(|error| error.to_string())?;
        Ok(plan.paths().map(<[u32]>::to_vec).collect())
    }

    fn custom(major: Major, line: &str, position: &str, separator: &str) -> Layout {
        Layout::new(major, line, position, separator)
            .map_err(|error| format!("{}: {}", error.part, error.reason))
            .expect("a layout")
    }

    #[test]
    fn named_formats_are_read() {
        let both = vec![vec![1, 5, 6], vec![11, 11, 7]];
        // As lacam3 writes it: x is the column.
        let lacam = "agents=2\nmap_file=x\nsolved=1\nsolution=\n0:(1,0),(3,2),\n1:(1,1),(3,2),\n\
                     2:(2,1),(3,1),\n";
        assert_eq!(read(&Layout::lacam(), lacam, 2), Ok(both.clone()));
        // As the CBS family writes it, and as MAPF-LNS2 does.
        for text in [
            "Agent 0: (0,1)->(1,1)->(1,2)->\nAgent 1: (2,3)->(2,3)->(1,3)->\n",
            "Agent 1:(2,3)->(2,3)->(1,3)->\r\nAgent 0:(0,1)->(1,1)->(1,2)",
        ] {
            assert_eq!(read(&Layout::paths_txt(), text, 2), Ok(both.clone()));
        }
    }

    #[test]
    fn headings_are_passed_over() {
        let layout = Layout::mapf_visualizer();
        let text = "0:(0,0,Y_MINUS),(3,2),\n1:(0,0,X_PLUS),(3,2,X_MINUS),\n";
        assert_eq!(read(&layout, text, 2), Ok(vec![vec![0, 0], vec![11, 11]]));
        let error = read(&layout, "0:(0,0,NORTH),", 1).expect_err("no heading");
        assert!(
            error.starts_with("answer:1:8: expected X_PLUS, X_MINUS"),
            "{error}"
        );
    }

    #[test]
    fn custom_formats_are_read() {
        let agent = |line, position, separator| custom(Major::Agent, line, position, separator);
        let cases: Vec<(Layout, &str)> = vec![
            (agent("{path}", "{cell}", ""), "1 5 6\n11\t11  7\n\n \n"),
            (
                agent("[{path}]", "[{row},{col}]", ","),
                "[[0, 1], [1,1],[1,2]]\n[[2,3],[2,3],[1,3],]",
            ),
            (
                agent("{path}", "{row} {col}", ""),
                "0 1 1 1 1 2\n2 3 2 3 1 3",
            ),
            (
                agent("#{agent} = {path};", "{x}/{y}", "|"),
                "#1=3/2|3/2|3/1;\n#0=1/0|1/1|2/1;",
            ),
            (
                custom(Major::Time, "{path}", "({row},{col})", " "),
                "(0,1)(2,3)\n(1,1) (2,3)\n(1,2) (1,3)",
            ),
            (
                Layout {
                    coordinates_from: 1,
                    index_from: 1,
                    skip_lines: 1,
                    begin: Some(Begin::Pattern(Regex::new("^BEGIN").expect("a pattern"))),
                    end: Regex::new("^END$").ok(),
                    ignore: Regex::new("^#").ok(),
                    ..custom(Major::Time, "step {time} {path}", "{cell}", ";")
                },
                "BEGIN too early\nhead\nBEGIN here\n# a remark\nstep 1 2;12\nstep 2 6;12\n#\nstep 3 7;8\n\nEND\njunk",
            ),
        ];
        for (layout, text) in cases {
            let expected = vec![vec![1, 5, 6], vec![11, 11, 7]];
            assert_eq!(read(&layout, text, 2), Ok(expected), "{text}");
        }
    }

    #[test]
    fn places_outside_the_map_are_for_the_validator() {
        let layout = custom(Major::Agent, "{path}", "{row},{col}", ";");
        let text = "0,0; -1,0; 0,4; 3,0; 999999999999999,999999999999999; 2,3";
        let path = vec![0, OFF_MAP, OFF_MAP, OFF_MAP, OFF_MAP, 11];
        assert_eq!(read(&layout, text, 1), Ok(vec![path]));
        let cells = custom(Major::Agent, "{path}", "{cell}", ",");
        let path = vec![11, OFF_MAP, OFF_MAP];
        assert_eq!(read(&cells, "11,12,-1", 1), Ok(vec![path]));
    }

    #[test]
    fn malformed_answers_are_told_by_line_and_column() {
        let (lacam, paths) = (Layout::lacam(), Layout::paths_txt());
        let cells = custom(Major::Agent, "{path}", "{cell}", "");
        let steps = custom(Major::Time, "[{path}]", "({x},{y})", ",");
        let cases: [(&Layout, &str, &str); 24] = [
            (&lacam, "", "answer: there is no line 'solution='"),
            (&lacam, "solved=1\n", "answer: there is no line 'solution='"),
            (&lacam, "solution=\n", "answer:2: there are no time steps"),
            (
                &lacam,
                "solution=\n0:(1,0)",
                "answer:2:1: 1 positions for 2 agents",
            ),
            (
                &lacam,
                "solution=\n0:(1,0),(1,1),(1,2)",
                "answer:2:1: 3 positions for 2",
            ),
            (
                &lacam,
                "solution=\n1:(1,0),(1,1)",
                "answer:2:1: expected time step 0, found 1",
            ),
            (
                &lacam,
                "solution=\n0:(1,0);(1,1)",
                "answer:2:8: expected ',' or the end of the line, found ';(1,1)'",
            ),
            (
                &lacam,
                "solution=\n0:(1.5,0),",
                "answer:2:5: expected ',', found '.5,0),'",
            ),
            (
                &lacam,
                "solution=\n0:(1,0,(1,1)",
                "answer:2:7: expected ')', found ',(1,1)'",
            ),
            (
                &lacam,
                "solution=\n0:",
                "answer:2:3: expected '(', found the end of the line",
            ),
            (
                &lacam,
                "solution=\n0:(1,0),(1,1),\n\n1:(1,0),(1,1)",
                "answer:3:1: a blank line",
            ),
            (
                &lacam,
                "solution=\n0:(1,0),(1234567890123456,1)",
                "answer:2:10: a column has more than 15 digits",
            ),
            (
                &paths,
                "Agent 0: (0,1)->\n",
                "answer:2: there is no path for agent 1: 1 paths for 2 agents",
            ),
            (
                &paths,
                "Agent 0: (0,1)\nAgent 0: (0,1)",
                "answer:2:1: a second path for agent 0; the first is on line 1",
            ),
            (
                &paths,
                "Agent 2: (0,1)",
                "answer:1:1: a path for agent 2, but there are 2 agents, from 0 on",
            ),
            (
                &paths,
                "Agent -1: (0,1)",
                "answer:1:1: a path for agent -1, but",
            ),
            (
                &paths,
                "Agent x: (0,1)",
                "answer:1:7: expected the number of an agent, found 'x: (0,1)'",
            ),
            (
                &paths,
                "agent 0: (0,1)",
                "answer:1:1: expected 'Agent', found 'agent 0: (0,1)'",
            ),
            (
                &paths,
                "Agent 0: (0,ä)",
                "answer:1:13: expected a column, found 'ä)'",
            ),
            (
                &paths,
                "Agent 0:",
                "answer:1:9: expected '(', found the end of the line",
            ),
            (&cells, "1 2\n1 a", "answer:2:3: expected a cell, found 'a'"),
            (
                &cells,
                "1\n2\n3",
                "answer:3:1: a path for agent 2, but there are 2",
            ),
            (
                &steps,
                "[(0,0),(1,1)",
                "answer:1:13: expected ',' or ']', found the end of the line",
            ),
            (
                &steps,
                "[(0,0),(1,1)] x",
                "answer:1:15: expected the end of the line, found 'x'",
            ),
        ];
        for (layout, text, expected) in cases {
            let error = read(layout, text, 2).expect_err(text);
            assert!(error.starts_with(expected), "{text}: {error}");
        }
        let binary = lacam.read("answer", b"solution=\n0:(1,\xff)", SIZE, Some(1));
        let error = binary.expect_err("binary").to_string();
        assert!(error.starts_with("answer:2:6: expected a row"), "{error}");
    }

    #[test]
    fn agents_are_counted_where_nobody_says_how_many() {
        let alone = |layout: &Layout, text: &str| {
            let plan = layout.read("file", text.as_bytes(), SIZE, None);
            plan.map(|plan| plan.agents())
                .map_err(|error| error.to_string())
        };
        let (lacam, paths) = (Layout::lacam(), Layout::paths_txt());
        let cases: [(&Layout, &str, Result<usize, &str>); 8] = [
            (&lacam, "solution=\n0:(1,0),(1,1),\n1:(1,0),(1,1),", Ok(2)),
            (
                &lacam,
                "solution=\n0:(1,0),(1,1)\n1:(1,0)",
                Err("file:3:1: 1 positions for 2 agents"),
            ),
            (
                &lacam,
                "solution=\n",
                Err("file:2: there are no time steps"),
            ),
            (&paths, "Agent 1: (0,1)\nAgent 0: (0,0)", Ok(2)),
            (&paths, "", Err("file:1: there are no paths")),
            (
                &paths,
                "Agent 2: (0,1)\nAgent 0: (0,0)",
                Err("file:2: there is no path for agent 1: 2 paths for 3 agents"),
            ),
            (
                &paths,
                "Agent 99999999999: (0,1)",
                Err("file:1:1: a path for agent 99999999999, but there are at most 4194304"),
            ),
            (
                &paths,
                "Agent -1: (0,1)",
                Err("file:1:1: a path for agent -1, but"),
            ),
        ];
        for (layout, text, expected) in cases {
            match (alone(layout, text), expected) {
                (Err(error), Err(expected)) => {
                    assert!(error.starts_with(expected), "{text}: {error}");
                }
                (found, expected) => assert_eq!(found, expected.map_err(str::to_owned), "{text}"),
            }
        }
    }

    #[test]
    fn what_lines_of_positions_cannot_say_is_not_written() {
        let nobody = GridPlan::default();
        let nowhere = GridPlan::from_paths([&[0][..], &[]]);
        for (plan, expected) in [
            (nobody, "plan: there are no agents"),
            (nowhere, "plan: the path of agent 1 is empty"),
        ] {
            for written in [
                write_paths_txt(&plan, SIZE),
                write_lacam(&LacamHeader::default(), &plan, SIZE),
            ] {
                let error = written.expect_err(expected).to_string();
                assert!(error.starts_with(expected), "{error}");
            }
        }
    }

    #[test]
    fn an_answer_of_skipped_lines_alone_is_told_by_its_last_line() {
        for (major, expected) in [
            (Major::Agent, "answer:2: there is no path for agent 0"),
            (Major::Time, "answer:2: there are no time steps"),
        ] {
            let layout = Layout {
                skip_lines: 9,
                ..custom(major, "{path}", "{cell}", ",")
            };
            let error = read(&layout, "1\n2", 1).expect_err("no answer");
            assert!(error.starts_with(expected), "{error}");
        }
    }

    /// Writes paths as a layout says.
    fn write(layout: &Layout, plan: &GridPlan) -> String {
        let paths: Vec<&[u32]> = plan.paths().collect();
        let agents = 0..paths.len();
        let steps = 0..paths[0].len();
        let at = |(agent, time): (usize, usize)| (agent, time, vec![paths[agent][time]]);
        // Agent, time and positions of each.
        let lines: Vec<(usize, usize, Vec<u32>)> = match layout.major {
            Major::Agent => agents
                .map(|agent| (agent, 0, paths[agent].to_vec()))
                .collect(),
            Major::Time => steps
                .map(|time| (0, time, paths.iter().map(|path| path[time]).collect()))
                .collect(),
            // The last come first, for the order does not matter.
            Major::Row => agents
                .flat_map(|agent| steps.clone().rev().map(move |time| (agent, time)))
                .map(at)
                .collect(),
        };
        let number = |index: usize| (index as i64 + layout.index_from).to_string();
        let separator = if layout.separator.is_empty() {
            " "
        } else {
            &layout.separator
        };
        let mut text = String::from("head\nBEGIN\n");
        for (agent, time, cells) in lines {
            for token in &layout.line {
                let written = match token {
                    Token::Text(word) => word.clone(),
                    Token::Agent => number(agent),
                    Token::Time => number(time),
                    _ => {
                        let written = cells.iter().map(|cell| position(layout, *cell));
                        written.collect::<Vec<_>>().join(separator)
                    }
                };
                write!(text, "{written} ").expect("a string");
            }
            text.push('\n');
        }
        text
    }

    fn position(layout: &Layout, cell: u32) -> String {
        let from = layout.coordinates_from;
        let words = layout.position.iter().map(|token| match token {
            Token::Text(word) => word.clone(),
            Token::Row => (i64::from(cell / SIZE.cols) + from).to_string(),
            Token::Col => (i64::from(cell % SIZE.cols) + from).to_string(),
            _ => (i64::from(cell) + from).to_string(),
        });
        words.collect::<Vec<_>>().join(" ")
    }

    fn layouts() -> impl Strategy<Value = Layout> {
        let major = prop_oneof![Just(Major::Agent), Just(Major::Time), Just(Major::Row)];
        let position = prop_oneof![
            Just("({row},{col})"),
            Just("({x},{y})"),
            Just("{cell}"),
            Just("<{col} {row}>"),
        ];
        let separator = prop_oneof![Just(","), Just("->"), Just(" "), Just(";;")];
        let line = prop_oneof![Just("{path}"), Just("I {i}: {path}"), Just("[{path}]")];
        (major, position, separator, line, 0..2_i64, 0..2_i64).prop_map(
            |(major, position, separator, line, coordinates_from, index_from)| {
                let position = position.replace("{col} {row}", "{x} {y}");
                let line = match major {
                    Major::Agent => line.replace("{i}", "{agent}"),
                    Major::Time => line.replace("{i}", "{time}"),
                    Major::Row => format!("{{time}};{{agent}} {line}")
                        .replace("{i}", "x")
                        .replace("{path}", "{position}"),
                };
                Layout {
                    coordinates_from,
                    index_from,
                    begin: Some(Begin::Line("BEGIN")),
                    ..custom(major, &line, &position, separator)
                }
            },
        )
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_again(
            layout in layouts(),
            agents in 1..5_usize,
            steps in 1..6_usize,
            cells in prop::collection::vec(0..12_u32, 30),
        ) {
            let plan = GridPlan::from_paths(cells.chunks(6).take(agents).map(|path| &path[..steps]));
            let text = write(&layout, &plan);
            let again = layout.read("answer", text.as_bytes(), SIZE, Some(agents));
            prop_assert_eq!(again, Ok(plan), "{}", text);
        }

        #[test]
        fn named_formats_keep_the_plan(
            lengths in prop::collection::vec(1..5_usize, 1..5),
            cells in prop::collection::vec(prop_oneof![0..12_u32, Just(OFF_MAP)], 20),
        ) {
            let paths = lengths.iter().zip(cells.chunks(4)).map(|(length, path)| &path[..*length]);
            let plan = GridPlan::from_paths(paths);
            let starts: Vec<u32> = plan.paths().map(|path| path[0]).collect();
            let header = LacamHeader {
                map_file: Some("a\n.map"),
                starts: Some(&starts),
                goals: None,
            };
            let lacam = write_lacam(&header, &plan, SIZE).expect("a plan");
            let paths_txt = write_paths_txt(&plan, SIZE).expect("a plan");
            let steps = write_mapf_visualizer(&plan, SIZE).expect("a plan");
            for (layout, text) in [
                (Layout::lacam(), lacam),
                (Layout::paths_txt(), paths_txt),
                (Layout::mapf_visualizer(), steps),
            ] {
                let again = layout.read("answer", &text, SIZE, None).expect("a plan");
                prop_assert_eq!(again.agents(), plan.agents());
                prop_assert_eq!(again.trimmed(), plan.trimmed());
            }
        }

        /// Whatever a solver writes is a plan for all agents or an error.
        #[test]
        fn any_answer_is_read_or_refused(
            layout in layouts(),
            text in "(BEGIN\n)?([0-9A-Za-z(),:;>\\[\\] \\-\n]|\\PC){0,60}",
            agents in 1..4_usize,
        ) {
            if let Ok(plan) = layout.read("answer", text.as_bytes(), SIZE, Some(agents)) {
                prop_assert_eq!(plan.agents(), agents);
            }
        }
    }
}
