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

use super::document::shown;
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
    let touch = pieces
        .windows(2)
        .find(|pair| pair.iter().all(Result::is_err));
    if let Some([Err(one), Err(other)]) = touch {
        let (one, other) = (shown(one), shown(other));
        return fault(
            format!("nothing stands between `{{{one}}}` and `{{{other}}}`"),
            hint,
        );
    }
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
            Err(name) => {
                let token = names.iter().find(|(known, _)| *known == name);
                let Some((_, token)) = token else {
                    let name = shown(&name);
                    return fault(format!("unknown placeholder `{{{name}}}`"), hint);
                };
                found.push(token.clone());
            }
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

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use proptest::prelude::*;

    use super::*;

    const SIZE: MapSize = MapSize { rows: 3, cols: 4 };

    fn read(layout: &Layout, text: &str, agents: usize) -> Result<Vec<Vec<u32>>, String> {
        let plan = layout
            .read("answer", text.as_bytes(), SIZE, agents)
            .map_err(|error| error.to_string())?;
        Ok(plan.as_ref().paths().map(<[u32]>::to_vec).collect())
    }

    fn custom(major: Major, line: &str, position: &str, separator: &str) -> Layout {
        Layout::new(major, line, position, separator)
            .map_err(|(key, error)| format!("{key}: {}", error.reason))
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
        let binary = lacam.read("answer", b"solution=\n0:(1,\xff)", SIZE, 1);
        let error = binary.expect_err("binary").to_string();
        assert!(error.starts_with("answer:2:6: expected a row"), "{error}");
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
    fn write(layout: &Layout, plan: &Plan) -> String {
        let paths: Vec<&[u32]> = plan.as_ref().paths().collect();
        let by_time = layout.major == Major::Time;
        let steps = paths[0].len();
        let lines = if by_time { steps } else { paths.len() };
        let mut text = String::from("head\nBEGIN\n");
        for index in 0..lines {
            for token in &layout.line {
                let written = match token {
                    Token::Text(word) => word.clone(),
                    Token::Index => (index as i64 + layout.index_from).to_string(),
                    _ => {
                        let row: Vec<u32> = if by_time {
                            paths.iter().map(|path| path[index]).collect()
                        } else {
                            paths[index].to_vec()
                        };
                        let separator = if layout.separator.is_empty() {
                            " "
                        } else {
                            &layout.separator
                        };
                        let written = row.iter().map(|cell| position(layout, *cell));
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
        let major = prop_oneof![Just(Major::Agent), Just(Major::Time)];
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
                let index = match major {
                    Major::Agent => "{agent}",
                    Major::Time => "{time}",
                };
                Layout {
                    coordinates_from,
                    index_from,
                    begin: Some(Begin::Line("BEGIN")),
                    ..custom(major, &line.replace("{i}", index), &position, separator)
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
            let plan = Plan::from_paths(cells.chunks(6).take(agents).map(|path| &path[..steps]));
            let text = write(&layout, &plan);
            let again = layout.read("answer", text.as_bytes(), SIZE, agents);
            prop_assert_eq!(again, Ok(plan), "{}", text);
        }

        /// Whatever a solver writes is a plan for all agents or an error.
        #[test]
        fn any_answer_is_read_or_refused(
            layout in layouts(),
            text in "(BEGIN\n)?([0-9A-Za-z(),:;>\\[\\] \\-\n]|\\PC){0,60}",
            agents in 1..4_usize,
        ) {
            if let Ok(plan) = layout.read("answer", text.as_bytes(), SIZE, agents) {
                prop_assert_eq!(plan.as_ref().agents(), agents);
            }
        }
    }
}
