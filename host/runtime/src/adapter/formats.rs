//! Answers of solvers: text with paths, read strictly by a [`Layout`].
//!
//! A layout is small on purpose. It says which lines carry paths, whether a line is
//! an agent's path or a time step of all agents, and how a position is written. The
//! named formats are layouts too, so there is one reader:
//!
//! - `lacam`, the result files of lacam, lacam2, lacam3 and pibt2: after a line
//!   `solution=` a line per time step, `t:(x,y),(x,y),`;
//! - `paths-txt`, the path files of the solvers CBSH2-RTC, EECBS, PBS and MAPF-LNS2:
//!   a line per agent, `Agent 0: (row,col)->(row,col)->`.
//!
//! Whether a plan is valid is not asked here; a position outside the map becomes
//! [`OFF_MAP`] for the validator to find.

use fleetyard_abi::Plan;
use fleetyard_abi::moves::OFF_MAP;
use fleetyard_core::InputError;
use regex::bytes::Regex;

use super::template;

/// The largest answer that is read, in bytes.
pub(super) const ANSWER_LIMIT: u64 = 1 << 28;

/// Most positions in an answer.
const MOST_CELLS: usize = 1 << 27;

/// What a line of paths is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Major {
    /// An agent's path.
    Agent,
    /// The positions of all agents at one time.
    Time,
}

/// A part of a line.
#[derive(Debug, Clone, PartialEq, Eq)]
enum Token {
    /// Exactly this, after any blanks.
    Text(String),
    /// The number of the agent or time step.
    Index,
    /// Positions with separators.
    Path,
    Row,
    Col,
    Cell,
}

/// How an answer is written.
#[derive(Debug, Clone)]
pub(super) struct Layout {
    pub(super) major: Major,
    /// A line with paths, one [`Token::Path`] in it.
    line: Vec<Token>,
    /// A position.
    position: Vec<Token>,
    /// Between positions; empty for blanks.
    separator: String,
    /// The first row, column and cell.
    pub(super) coordinates_from: i64,
    /// The first agent and time step.
    pub(super) index_from: i64,
    /// Lines at the beginning that carry nothing.
    pub(super) skip_lines: u64,
    /// Lines up to the first that matches carry nothing.
    pub(super) begin: Option<Begin>,
    /// The first line that matches, and all after it, carry nothing.
    pub(super) end: Option<Regex>,
    /// Lines that match carry nothing.
    pub(super) ignore: Option<Regex>,
}

/// The line after which the paths begin.
#[derive(Debug, Clone)]
pub(super) enum Begin {
    Line(&'static str),
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

/// What a text must be to be a part of a [`Layout`].
pub(super) struct LayoutError {
    pub(super) reason: String,
    pub(super) hint: &'static str,
}

impl Layout {
    /// From the texts of a manifest: `line` as in `Agent {agent}: {path}`,
    /// `position` as in `({row},{col})`, and what stands between positions. The
    /// error says which of the three it is about.
    pub(super) fn new(
        major: Major,
        line: &str,
        position: &str,
        separator: &str,
    ) -> Result<Self, (&'static str, LayoutError)> {
        let of = |what: &'static str| move |error: LayoutError| (what, error);
        let line = line_tokens(major, line).map_err(of("line"))?;
        let position = position_tokens(position).map_err(of("position"))?;
        let separator = separator.trim();
        if separator.starts_with(|letter: char| letter.is_ascii_digit()) {
            let error = LayoutError {
                reason: "the separator reads like a number".into(),
                hint: "a separator is text such as \",\" or \"->\", or a blank",
            };
            return Err(("separator", error));
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
    pub(super) fn lacam() -> Self {
        let line = vec![Token::Index, Token::Text(":".into()), Token::Path];
        let position = bracketed(Token::Col, Token::Row);
        Self {
            begin: Some(Begin::Line("solution=")),
            ..Self::plain(Major::Time, line, position, ",")
        }
    }

    /// The format `paths-txt`.
    pub(super) fn paths_txt() -> Self {
        let line = vec![
            Token::Text("Agent".into()),
            Token::Index,
            Token::Text(":".into()),
            Token::Path,
        ];
        Self::plain(Major::Agent, line, bracketed(Token::Row, Token::Col), "->")
    }

    /// Reads an answer for so many agents on a map of so many rows and columns;
    /// `source` is its name in errors.
    pub(super) fn read(
        &self,
        source: &str,
        bytes: &[u8],
        size: MapSize,
        agents: usize,
    ) -> Result<Plan, InputError> {
        let reader = Reader {
            layout: self,
            source,
            size,
            agents,
        };
        match self.major {
            Major::Agent => reader.by_agent(bytes),
            Major::Time => reader.by_time(bytes),
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
pub(super) struct MapSize {
    pub(super) rows: u32,
    pub(super) cols: u32,
}

fn fault<T>(reason: impl Into<String>, hint: &'static str) -> Result<T, LayoutError> {
    let reason = reason.into();
    Err(LayoutError { reason, hint })
}

/// Tokens of a text with names in braces.
fn tokens(
    text: &str,
    names: &[(&str, Token)],
    hint: &'static str,
) -> Result<Vec<Token>, LayoutError> {
    let Ok(pieces) = template::pieces(text) else {
        return fault("a single brace", hint);
    };
    let mut found = Vec::new();
    for piece in pieces {
        match piece {
            // Blanks in a text stand for any number of them, and none.
            Ok(literal) => {
                found.extend(
                    literal
                        .split_whitespace()
                        .map(|word| Token::Text(word.into())),
                );
            }
            Err(name) => match names.iter().find(|(known, _)| *known == name) {
                Some((_, token)) => found.push(token.clone()),
                None => {
                    let name = super::document::shown(&name);
                    return fault(format!("unknown placeholder `{{{name}}}`"), hint);
                }
            },
        }
    }
    Ok(found)
}

fn line_tokens(major: Major, text: &str) -> Result<Vec<Token>, LayoutError> {
    let (index, hint) = match major {
        Major::Agent => (
            "agent",
            "a line is one agent's path, as in \"Agent {agent}: {path}\"",
        ),
        Major::Time => ("time", "a line is one time step, as in \"{time}: {path}\""),
    };
    let names = [("path", Token::Path), (index, Token::Index)];
    let tokens = tokens(text, &names, hint)?;
    let count = |wanted: &Token| tokens.iter().filter(|token| *token == wanted).count();
    if count(&Token::Path) != 1 {
        return fault("the line needs `{path}` once", hint);
    }
    if count(&Token::Index) > 1 {
        return fault(format!("the line has `{{{index}}}` twice"), hint);
    }
    let touches = |pair: &[Token]| !pair.iter().any(|token| matches!(token, Token::Text(_)));
    if tokens.windows(2).any(touches) {
        return fault(
            format!("nothing stands between `{{{index}}}` and `{{path}}`"),
            hint,
        );
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
    let tokens = tokens(text, &names, HINT)?;
    let count = |wanted: &Token| tokens.iter().filter(|token| *token == wanted).count();
    if !matches!(
        (count(&Token::Row), count(&Token::Col), count(&Token::Cell)),
        (1, 1, 0) | (0, 0, 1)
    ) {
        return fault("the position needs a row and a column, or a cell", HINT);
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
            let mut found: String = text.chars().take(SHOWN).collect();
            if text.chars().nth(SHOWN).is_some() {
                found.push('…');
            }
            format!("'{}'", found.escape_debug())
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

struct Reader<'a> {
    layout: &'a Layout,
    source: &'a str,
    size: MapSize,
    agents: usize,
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
            if number <= layout.skip_lines {
                continue;
            }
            last = number;
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

    /// Reads a line and appends its positions; the number of its agent or time
    /// step, if it has one.
    fn line(
        &self,
        cursor: &mut Cursor<'_>,
        cells: &mut Vec<u32>,
    ) -> Result<Option<i64>, InputError> {
        let mut index = None;
        let tokens = &self.layout.line;
        for (at, token) in tokens.iter().enumerate() {
            match token {
                Token::Text(text) => cursor.text(text)?,
                Token::Index => {
                    let what = match self.layout.major {
                        Major::Agent => "the number of an agent",
                        Major::Time => "a time step",
                    };
                    index = Some(cursor.number(what)? - self.layout.index_from);
                }
                _ => self.path(cursor, tokens.get(at + 1), cells)?,
            }
        }
        cursor.skip_blanks();
        if cursor.at_end() {
            Ok(index)
        } else {
            Err(cursor.expected(&self.after_position(None)))
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

    fn by_agent(&self, bytes: &'a [u8]) -> Result<Plan, InputError> {
        let mut cells = Vec::new();
        // Per agent its line and its range of `cells`.
        let mut paths: Vec<Option<(u64, std::ops::Range<usize>)>> = vec![None; self.agents];
        let mut count = 0;
        let last = self.lines(bytes, |mut cursor| {
            let begin = cells.len();
            let index = self.line(&mut cursor, &mut cells)?.unwrap_or(count);
            cursor.at = 0;
            let from = self.layout.index_from;
            let agent = index + from;
            let Some(slot) = usize::try_from(index).ok().and_then(|at| paths.get_mut(at)) else {
                return Err(cursor.error(format!(
                    "a path for agent {agent}, but there are {} agents, from {from} on",
                    self.agents
                )));
            };
            if let Some((line, _)) = slot {
                return Err(cursor.error(format!(
                    "a second path for agent {agent}; the first is on line {line}"
                )));
            }
            *slot = Some((cursor.number, begin..cells.len()));
            count += 1;
            Ok(())
        })?;
        let mut plan = Plan::default();
        for (agent, path) in paths.iter().enumerate() {
            let Some((_, range)) = path else {
                let agent = agent as i64 + self.layout.index_from;
                let reason = format!(
                    "there is no path for agent {agent}: {count} paths for {} agents",
                    self.agents
                );
                return Err(InputError::new(self.source, reason).at_line(last));
            };
            plan.push_path(&cells[range.clone()]);
        }
        Ok(plan)
    }

    fn by_time(&self, bytes: &'a [u8]) -> Result<Plan, InputError> {
        let mut cells = Vec::new();
        let mut steps: i64 = 0;
        let last = self.lines(bytes, |mut cursor| {
            let before = cells.len();
            let index = self.line(&mut cursor, &mut cells)?;
            cursor.at = 0;
            if let Some(index) = index.filter(|index| *index != steps) {
                let from = self.layout.index_from;
                let (found, wanted) = (index + from, steps + from);
                return Err(cursor.error(format!("expected time step {wanted}, found {found}")));
            }
            let found = cells.len() - before;
            if found != self.agents {
                let wanted = self.agents;
                return Err(cursor.error(format!("{found} positions for {wanted} agents")));
            }
            steps += 1;
            Ok(())
        })?;
        if steps == 0 {
            let reason = "there are no time steps in the answer";
            return Err(InputError::new(self.source, reason).at_line(last));
        }
        let mut plan = Plan::default();
        let mut path = Vec::with_capacity(steps as usize);
        for agent in 0..self.agents {
            path.clear();
            path.extend(cells.iter().skip(agent).step_by(self.agents.max(1)));
            plan.push_path(&path);
        }
        Ok(plan)
    }
}
