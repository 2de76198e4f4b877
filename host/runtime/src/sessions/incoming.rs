//! The output of a plugin, cut into messages as its bytes come.
//!
//! A pipe gives pieces of lines. [`Incoming`] keeps a line until it is complete, but not
//! the paths in it: they become cells at once ([`PathsReader`]), and the line that is
//! then read has an empty list in their place. So a plan of any length costs its cells,
//! the client looks at its clock between two pieces of it, and fields may come in any
//! order. A reader that pulls (`serde_json::from_reader`) would have to wait inside of a
//! message, and would hold a string of moves whole before it is one.

use fleetyard_abi::Plan;
use fleetyard_abi::paths::{PathContext, PathsError, PathsReader, PlanContext};
use fleetyard_abi::wire::PlanText;

use crate::sessions::bounds::MESSAGE_BYTES;
use crate::sessions::message::{self, Cut, Message};

/// Bytes that are kept of a line that is no message.
const STRAY_KEPT: usize = 400;

/// Bytes before and after the one that is wrong, in an explanation.
const NEAR: (usize, usize) = (10, 20);

/// Messages that a running call accepts.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Expected<'a> {
    /// The context of plans; absent in calls that ask for none.
    pub(crate) plan: Option<PlanContext<'a>>,
    /// Longest message, without paths.
    pub(crate) bytes: usize,
}

impl Expected<'_> {
    /// No plan, and messages of the usual length.
    pub(crate) const NO_PLAN: Self = Self {
        plan: None,
        bytes: MESSAGE_BYTES,
    };

    /// The plan of a message, whose paths may have been taken out of it.
    pub(crate) fn read(&self, text: &PlanText<'_>, found: Option<Read>) -> Read {
        let Some(context) = self.plan else {
            return Err("a plan was submitted in a call that asks for none".into());
        };
        let read = found.unwrap_or_else(|| {
            let plan = context.read(text)?.ok_or("there is none")?;
            let paths = plan.agents();
            Ok((plan, paths))
        });
        let what = context.field();
        read.map_err(|reason| format!("the {what} are malformed: {reason}"))
    }

    /// The context of paths, where a plan is some.
    fn paths(&self) -> Option<PathContext<'_>> {
        self.plan.and_then(PlanContext::paths)
    }
}

/// A plan and how many paths its writer gave, or why it is none.
pub(crate) type Read = Result<(Plan, usize), String>;

/// The field of a message that has `paths`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Part {
    Params,
    Result,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
enum Kind {
    /// Nothing but blanks so far.
    #[default]
    Blank,
    /// Begins with a bracket: stray, unless it is a list of messages.
    Bracket,
    Stray,
    Message,
}

/// The line that is arriving.
#[derive(Debug, Default)]
struct Line {
    kind: Kind,
    /// The message without its paths, or the beginning of what is none.
    kept: Vec<u8>,
    /// Bytes that are not kept, from the first that is not blank.
    cut: Cut,
    scan: Scan,
    paths: Option<PathsReader>,
    found: Option<(Part, Read)>,
    /// It began before the host asked.
    early: bool,
}

/// Position in a message of its next byte.
#[derive(Debug, Default)]
struct Scan {
    /// Open lists and objects.
    depth: u32,
    string: bool,
    escaped: bool,
    /// The last string, with its quotes, as a range of what is kept.
    last: (usize, usize),
    /// The field of the message.
    part: Option<Part>,
    /// The value that begins is that of `paths`.
    at_paths: bool,
}

impl Scan {
    /// Takes the last byte of what is kept.
    fn step(&mut self, byte: u8, kept: &[u8]) {
        if self.string {
            match byte {
                _ if self.escaped => self.escaped = false,
                b'\\' => self.escaped = true,
                b'"' => {
                    self.string = false;
                    self.last.1 = kept.len();
                }
                _ => {}
            }
            return;
        }
        if matches!(byte, b' ' | b'\t' | b'\r') {
            return;
        }
        self.at_paths = false;
        match (byte, self.depth) {
            (b'"', _) => {
                self.string = true;
                self.last = (kept.len() - 1, kept.len());
            }
            (b':', 1) if self.is_last(kept, "params") => self.part = Some(Part::Params),
            (b':', 1) if self.is_last(kept, "result") => self.part = Some(Part::Result),
            (b':', 2) => self.at_paths = self.part.is_some() && self.is_last(kept, "paths"),
            (b',', 1) => self.part = None,
            (b'{' | b'[', _) => self.depth = self.depth.saturating_add(1),
            (b'}' | b']', _) => self.depth = self.depth.saturating_sub(1),
            _ => {}
        }
    }

    /// The last string was this one.
    fn is_last(&self, kept: &[u8], name: &str) -> bool {
        let text = kept.get(self.last.0..self.last.1).unwrap_or_default();
        // Escapes are rare, so that they may cost something.
        let plain = !text.contains(&b'\\');
        match text {
            [b'"', text @ .., b'"'] if plain => text == name.as_bytes(),
            _ => serde_json::from_slice::<String>(text).is_ok_and(|text| text == name),
        }
    }
}

/// A line that is complete.
#[derive(Debug)]
pub(crate) struct Whole {
    line: Line,
}

impl Whole {
    /// The message, and the paths that were taken out of it.
    pub(crate) fn read(&mut self) -> Result<(Message<'_>, Option<(Part, Read)>), String> {
        let found = self.line.found.take();
        let message = message::read_without(&self.line.kept, self.line.cut)?;
        Ok((message, found))
    }

    /// The beginning of the line.
    pub(crate) fn text(&self) -> String {
        let shown = &self.line.kept[..self.line.kept.len().min(STRAY_KEPT)];
        String::from_utf8_lossy(shown).into_owned()
    }

    /// It began before the host asked.
    pub(crate) fn is_early(&self) -> bool {
        self.line.early
    }
}

/// Takes what a plugin writes to standard output.
#[derive(Debug, Default)]
pub(crate) struct Incoming {
    line: Line,
    /// Bytes of lines that are no messages.
    pub(crate) stray_bytes: u64,
}

impl Incoming {
    /// The host asks: what has come of a line until now was not asked for.
    pub(crate) fn ask(&mut self) {
        self.line.early = self.line.kind == Kind::Message;
    }

    /// Bytes that are kept of the line that is arriving.
    #[cfg(test)]
    pub(crate) fn held_bytes(&self) -> usize {
        self.line.kept.capacity()
    }

    /// Takes bytes up to the end of a line, at most. Returns how many, and the line if it is
    /// complete, or how it breaks the protocol.
    pub(crate) fn take(
        &mut self,
        bytes: &[u8],
        expected: &Expected<'_>,
    ) -> (usize, Result<Option<Whole>, String>) {
        let newline = bytes.iter().position(|byte| *byte == b'\n');
        let part = &bytes[..newline.unwrap_or(bytes.len())];
        if let Err(reason) = self.take_part(part, newline.is_some(), expected) {
            return (bytes.len(), Err(reason));
        }
        let Some(newline) = newline else {
            return (bytes.len(), Ok(None));
        };
        if self.line.kind != Kind::Message {
            self.stray_bytes += 1;
        }
        let line = std::mem::take(&mut self.line);
        (newline + 1, Ok(Some(Whole { line })))
    }

    fn take_part(
        &mut self,
        mut part: &[u8],
        ends: bool,
        expected: &Expected<'_>,
    ) -> Result<(), String> {
        if self.line.kind == Kind::Blank {
            let rest = part.trim_ascii_start();
            self.stray_bytes += (part.len() - rest.len()) as u64;
            self.line.kind = match rest.first() {
                None => return Ok(()),
                Some(b'{') => Kind::Message,
                Some(b'[') => Kind::Bracket,
                Some(_) => Kind::Stray,
            };
            part = rest;
        }
        let line = &mut self.line;
        if line.kind == Kind::Message {
            return line.take(part, ends, expected);
        }
        self.stray_bytes += part.len() as u64;
        let room = STRAY_KEPT.saturating_sub(line.kept.len());
        line.kept.extend_from_slice(&part[..part.len().min(room)]);
        if let (Kind::Bracket, [_, second, ..]) = (line.kind, &line.kept[..]) {
            line.kind = Kind::Stray;
            if matches!(second, b'{' | b'[') {
                message::read(&line.kept)?;
            }
        }
        Ok(())
    }
}

impl Line {
    /// Takes a part of a message.
    fn take(&mut self, part: &[u8], ends: bool, expected: &Expected<'_>) -> Result<(), String> {
        let mut at = 0;
        let context = expected.paths();
        while at < part.len() {
            let (Some(paths), Some(context)) = (&mut self.paths, &context) else {
                at += self.keep(&part[at..], context.is_some());
                if self.kept.len() > expected.bytes {
                    let limit = expected.bytes >> 20;
                    return Err(format!(
                        "a message is longer than {limit} MiB without its paths"
                    ));
                }
                continue;
            };
            match paths.feed(context, &part[at..]) {
                Ok(read) => {
                    at += read;
                    self.cut.bytes += read as u64;
                }
                Err(PathsError::TooLong { agent }) => {
                    let agents = context.starts.len();
                    let limit = context.too_long(agent);
                    return Err(format!("{limit}, the most for {agents} agents on this map"));
                }
                Err(PathsError::Syntax { at: wrong, reason }) => {
                    return Err(self.not_json(part, at, at + wrong, reason));
                }
            }
            if let Some(paths) = self.paths.take_if(|paths| paths.is_done()) {
                let part = self.scan.part.unwrap_or(Part::Result);
                let read = paths.finish().map(|(plan, paths)| (plan.into(), paths));
                if self.found.replace((part, read)).is_some() {
                    return Err("a message has `paths` twice".into());
                }
                // The two brackets that stand for them are kept.
                self.cut.bytes -= 2;
            }
        }
        if ends && self.paths.is_some() {
            return Err(self.not_json(part, part.len(), part.len(), "EOF while parsing a list"));
        }
        Ok(())
    }

    /// Keeps bytes up to the next paths; how many.
    fn keep(&mut self, bytes: &[u8], wants_paths: bool) -> usize {
        let mut at = 0;
        while let Some(&byte) = bytes.get(at) {
            if self.scan.string && !self.scan.escaped {
                let rest = &bytes[at..];
                let run = rest.iter().position(|byte| matches!(byte, b'"' | b'\\'));
                let run = run.unwrap_or(rest.len());
                self.kept.extend_from_slice(&rest[..run]);
                at += run;
                if run > 0 {
                    continue;
                }
            }
            if wants_paths && self.scan.at_paths && byte == b'[' {
                self.scan.at_paths = false;
                self.kept.extend_from_slice(b"[]");
                self.cut.at = self.kept.len();
                self.paths = Some(PathsReader::new());
                break;
            }
            self.kept.push(byte);
            self.scan.step(byte, &self.kept);
            at += 1;
        }
        at
    }

    /// The reason why paths are not JSON, with the place and the text there; `begun` is the
    /// position in this part at which the reader began.
    fn not_json(&self, part: &[u8], begun: usize, wrong: usize, reason: &str) -> String {
        let from = wrong.saturating_sub(NEAR.0);
        let near = &part[from..part.len().min(wrong + NEAR.1)];
        let near = String::from_utf8_lossy(near);
        // The brackets that stand for the paths are not among them.
        let before = self.kept.len() as u64 - 2 + self.cut.bytes;
        let column = before + (wrong - begun) as u64 + 1;
        format!("a message is not JSON: {reason} at column {column}, near `{near}`")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STARTS: [u32; 2] = [0, 5];

    fn expected() -> Expected<'static> {
        let paths = PathContext {
            rows: 2,
            cols: 3,
            starts: &STARTS,
            max_cells: 50,
        };
        Expected {
            plan: Some(PlanContext::Paths(paths)),
            bytes: 1 << 20,
        }
    }

    /// The outcome of bytes that arrive in pieces of so many.
    fn heard(bytes: &[u8], size: usize) -> Vec<Result<String, String>> {
        let mut incoming = Incoming::default();
        let mut heard = Vec::new();
        for mut piece in bytes.chunks(size) {
            while !piece.is_empty() {
                let (taken, line) = incoming.take(piece, &expected());
                piece = &piece[taken..];
                match line {
                    Ok(None) => {}
                    Ok(Some(mut line)) => {
                        let read = line.read();
                        heard.push(read.map(|read| format!("{read:?}")));
                    }
                    Err(reason) => {
                        heard.push(Err(reason));
                        return heard;
                    }
                }
            }
        }
        heard
    }

    #[test]
    fn a_line_is_the_same_in_whatever_pieces_it_comes() {
        let text = concat!(
            "Hello\n",
            "\r\n",
            "[1]\n",
            r#"{"jsonrpc":"2.0","method":"incumbent","params":{"paths":["EE",[5,4]]}}"#,
            "\n",
            r#"  {"params":{"paths":[[0],"W"],"x":{"paths":[7]}},"method":"incumbent","jsonrpc":"2.0"}"#,
            "\n",
            r#"{"jsonrpc":"2.0","id":7,"result":{"message":"\"paths\":[","\u0070aths" : [[],[]]}}"#,
            "\n",
            r#"{"jsonrpc":"2.0","id":8,"result":{"status":"solved","paths":null}}"#,
            "\n",
            r#"{"jsonrpc":"2.0","method":"x","params":{"paths":["no way"]},"paths":[[9]]}"#,
            "\n",
        );
        let whole = heard(text.as_bytes(), text.len());
        assert_eq!(whole.len(), 8, "{whole:?}");
        let found = |paths: &str| {
            let paths = format!("paths: [{paths}]");
            whole.iter().flatten().any(|line| line.contains(&paths))
        };
        assert!(
            found("[0, 1, 2], [5, 4]") && found("[0], [5, 4]"),
            "{whole:?}"
        );
        for size in [1, 2, 5, 64] {
            assert_eq!(heard(text.as_bytes(), size), whole);
        }
    }

    #[test]
    fn what_breaks_the_protocol_is_said_where_it_is() {
        for (line, reason) in [
            (
                r#"{"jsonrpc":"2.0","method":"incumbent","params":{"paths":[[0,NaN],[]]}}"#,
                "a message is not JSON: expected value at column 64, near ",
            ),
            (
                r#"{"jsonrpc":"2.0","method":"incumbent","params":{"paths":[[0,1],[]]},"id":NaN}"#,
                "a message is not JSON: expected value at column 74, near `:[]},\"id\":NaN}`",
            ),
            (
                r#"{"jsonrpc":"2.0","id":7,"result":{"paths":[[0"#,
                "a message is not JSON: EOF while parsing a list at column 46, near `paths\":[[0`",
            ),
            (
                r#"{"result":{"paths":[]},"params":{"paths":[]}}"#,
                "a message has `paths` twice",
            ),
            (
                r#"[{"jsonrpc":"2.0"}]"#,
                "a message is a list: batches are not supported",
            ),
            (
                r#"{"jsonrpc":"2.0","id":7,"result":{"paths":["..........................................................."#,
                "the plan is longer than 50 cells in the path of agent 0, the most for 2 agents",
            ),
        ] {
            let heard = heard(format!("{line}\n").as_bytes(), 1 << 10);
            let found = heard[0].as_ref().expect_err(line);
            assert!(found.starts_with(reason), "{line}: {found}");
        }
    }

    #[test]
    fn what_is_no_plan_does_not_pile_up() {
        let mut incoming = Incoming::default();
        let mut feed = |bytes: &[u8]| {
            let (_, line) = incoming.take(bytes, &expected());
            (incoming.line.kept.len(), line.map(drop))
        };
        assert_eq!(feed(&vec![b' '; 1 << 16]), (0, Ok(())));
        assert_eq!(feed(&vec![b'x'; 1 << 16]), (STRAY_KEPT, Ok(())));
        assert_eq!(incoming.stray_bytes, 2 << 16);

        let mut incoming = Incoming::default();
        let head = br#"{"jsonrpc":"2.0","id":7,"result":{"paths":["#;
        let blanks = vec![b' '; 1 << 16];
        for piece in [&head[..], &blanks, &blanks] {
            let (_, line) = incoming.take(piece, &expected());
            assert!(line.is_ok_and(|line| line.is_none()));
            assert!(incoming.line.kept.len() < 64);
        }
    }
}
