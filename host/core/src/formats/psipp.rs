//! Problems and plans of PSIPP/CTC, <https://github.com/omron-sinicx/PSIPP-CTC>, in text.
//!
//! A problem is a roadmap with tasks: numbers of vertices, edges and agents; a line for each
//! vertex with its position, for each edge with its ends, for each agent with its start and its
//! goal; and the radius of all agents. Edges are directed and driven at unit speed.
//!
//! ```text
//! 3 2 1
//! 0 0
//! 3 0
//! 3 4
//! 0 1
//! 1 2
//! 0 2
//! 0.5
//! ```
//!
//! A plan has the numbers of agents and their radius, and for each agent the number of its points
//! and these, a time and a position each:
//!
//! ```text
//! 1 0.500000
//! 3
//! 0.000000
//! 0.000000 0.000000
//! 3.000000
//! 3.000000 0.000000
//! 7.000000
//! 3.000000 4.000000
//! ```
//!
//! Its numbers have six decimals, so that discs that touch may overlap by a millionth of the unit.
//! Write problems in small units to lose less.

use std::fmt::Write as _;

use crate::files::{column, quote};
use crate::json::push_number;
use crate::path_list::PLAN_MAX_AGENTS;
use crate::{InputError, Knot, Roadmap, TrajectoryPlan};

/// The content of a problem: a roadmap, starts and goals as its vertices, and the radius of all
/// agents in the unit of the roadmap's positions.
pub fn write_psipp_problem(
    roadmap: &Roadmap,
    starts: &[u32],
    goals: &[u32],
    radius: f64,
) -> Vec<u8> {
    let mut text = String::with_capacity(40 * roadmap.vertices() + 14 * roadmap.edge_count());
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "{} {} {}",
        roadmap.vertices(),
        roadmap.edge_count(),
        starts.len()
    );
    for vertex in 0..roadmap.vertices() as u32 {
        let (x, y) = roadmap.position_m(vertex);
        push_number(&mut text, x);
        text.push(' ');
        push_number(&mut text, y);
        text.push('\n');
    }
    let tasks = starts.iter().copied().zip(goals.iter().copied());
    for (from, to) in roadmap.edges().chain(tasks) {
        let _ = writeln!(text, "{from} {to}");
    }
    push_number(&mut text, radius);
    text.push('\n');
    text.into_bytes()
}

/// The words of a text, one after the other.
struct Words<'a> {
    source: &'a str,
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Words<'a> {
    /// The next word with the byte at which it begins; none at the end.
    fn next(&mut self) -> Option<(usize, &'a [u8])> {
        let rest = &self.bytes[self.at..];
        let skipped = rest.iter().position(|byte| !byte.is_ascii_whitespace())?;
        let word = &rest[skipped..];
        let length = word.iter().position(u8::is_ascii_whitespace);
        let word = &word[..length.unwrap_or(word.len())];
        let begin = self.at + skipped;
        self.at = begin + word.len();
        Some((begin, word))
    }

    fn error(&self, byte: usize, reason: impl Into<String>) -> InputError {
        let before = &self.bytes[..byte];
        let begin = before.iter().rposition(|byte| *byte == b'\n');
        let begin = begin.map_or(0, |newline| newline + 1);
        let line = before.split(|byte| *byte == b'\n').count();
        InputError::new(self.source, reason)
            .at(line as u64, column(&self.bytes[begin..], byte - begin))
    }

    fn read<T: std::str::FromStr>(&mut self, what: &str) -> Result<(usize, T), InputError> {
        let Some((byte, word)) = self.next() else {
            let reason = format!("the plan ends before {what}");
            return Err(self
                .error(self.bytes.trim_ascii_end().len(), reason)
                .hint("the program was stopped while it wrote, or found no plan"));
        };
        let value = std::str::from_utf8(word)
            .ok()
            .and_then(|text| text.parse().ok());
        let value = value
            .ok_or_else(|| self.error(byte, format!("expected {what}, found {}", quote(word))))?;
        Ok((byte, value))
    }
}

/// Parses a plan. `source` is named in errors.
pub fn read_psipp_plan(source: &str, bytes: &[u8]) -> Result<TrajectoryPlan, InputError> {
    let mut words = Words {
        source,
        bytes,
        at: 0,
    };
    let (byte, agents) = words.read::<usize>("the number of agents")?;
    if !(1..=PLAN_MAX_AGENTS).contains(&agents) {
        let reason = format!("the number of agents is {agents}, not 1 to {PLAN_MAX_AGENTS}");
        return Err(words.error(byte, reason));
    }
    words.read::<f64>("the agents' radius")?;
    // A number in the text allocates nothing: what it announces may not be there.
    let mut plan = TrajectoryPlan::default();
    for agent in 0..agents {
        let (begin, points) = words.read::<usize>(&format!("the points of agent {agent}"))?;
        let (mut knots, mut places) = (Vec::new(), Vec::new());
        for _ in 0..points {
            let (place, time_s) = words.read("a time")?;
            places.push(place);
            knots.push(Knot {
                time_s,
                x_m: words.read("x")?.1,
                y_m: words.read("y")?.1,
                heading_rad: None,
            });
        }
        plan.push_path(knots).map_err(|error| {
            let at = error.place().and_then(|(_, knot)| places.get(knot));
            words.error(*at.unwrap_or(&begin), error.to_string())
        })?;
    }
    match words.next() {
        Some((byte, _)) => Err(words
            .error(byte, "the text goes on after the last agent's path")
            .hint("the program appends to a file that exists; remove it before")),
        None => Ok(plan),
    }
}
