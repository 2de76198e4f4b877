//! Maps of POGEMA, <https://github.com/CognitiveAISystems/pogema>: the rows of the map as a text, alone
//! in a file or, as its experiments keep them, under a name in YAML:
//!
//! ```yaml
//! small: |-
//!   ..#B
//!   a.#A
//!   b...
//! ```
//!
//! `.` is free and `#` is not. `@`, `$` and `!` are free as well: cells of possible starts, of possible
//! goals, and of neither. A small letter is the start of an agent and the capital its goal; agents are
//! in the order of the alphabet.

use std::collections::BTreeMap;

use super::libmrp::text;
use super::yaml::Yaml;
use super::{AgentEntry, AgentList};
use crate::files::{quote, stem};
use crate::{Grid, InputError};

const HINT: &str = "letters are . @ $ ! (free), # (not free), a to z (starts) and A to Z (goals)";

/// True of what stands in a map of POGEMA.
pub(super) fn is_letter(letter: u8) -> bool {
    matches!(letter, b'.' | b'#' | b'@' | b'$' | b'!') || letter.is_ascii_alphabetic()
}

/// Reads a map of POGEMA, and starts and goals if it has them. `source` is named in errors, and its
/// stem becomes the map's name.
pub fn read_pogema(source: &str, bytes: &[u8]) -> Result<(Grid, Option<AgentList>), InputError> {
    let whole = text(source, bytes)?;
    let first = whole.split_whitespace().next().unwrap_or_default();
    if !first.is_empty() && first.bytes().all(is_letter) {
        let lines = (1..).zip(whole.lines());
        return read_rows(source, 1, lines.map(|(line, row)| (Some(line), row.trim())));
    }
    let mut yaml = Yaml::new(source, whole)?;
    let mut maps: Vec<(String, String, u64)> = Vec::new();
    yaml.mapping("maps by their names", |yaml, name, place| {
        let (rows, _) = yaml.text("the rows of a map as a text")?;
        maps.push((name.to_owned(), rows, place.line() as u64));
        Ok(())
    })?;
    yaml.finish()?;
    match maps.as_slice() {
        [(_, rows, line)] => {
            let lines = rows.lines().map(|row| (None, row.trim()));
            read_rows(source, *line, lines)
        }
        [] => Err(InputError::new(source, "there is no map")
            .at_line(1)
            .hint(HINT)),
        [_, (name, _, line), ..] => {
            let reason = format!(
                "there are {} maps in the file, {} the second of them",
                maps.len(),
                quote(name.as_bytes())
            );
            Err(InputError::new(source, reason)
                .at_line(*line)
                .hint("keep the one that is meant in a file of its own"))
        }
    }
}

/// Reads rows, with their lines where those are known; the map begins in line `first`.
fn read_rows<'a>(
    source: &str,
    first: u64,
    lines: impl Iterator<Item = (Option<u64>, &'a str)>,
) -> Result<(Grid, Option<AgentList>), InputError> {
    let mut terrain = Vec::new();
    let mut cols = 0;
    let mut rows = 0_u32;
    let (mut starts, mut goals) = (BTreeMap::new(), BTreeMap::new());
    for (line, row) in lines.filter(|(_, row)| !row.is_empty()) {
        let fault = |col: usize, reason: String| {
            let error = InputError::new(source, reason);
            match line {
                Some(line) => error.at(line, col as u64 + 1),
                None => error.at_line(first),
            }
        };
        if rows == 0 {
            cols = row.len();
        }
        for (col, letter) in row.bytes().enumerate() {
            if !is_letter(letter) {
                let letter = row[col..].chars().next().unwrap_or_default().to_string();
                let found = quote(letter.as_bytes());
                let reason = format!("unknown letter {found} in map row {rows}");
                return Err(fault(col, reason).hint(HINT));
            }
            terrain.push(if letter == b'#' { b'@' } else { b'.' });
            let list = match letter {
                b'a'..=b'z' => &mut starts,
                b'A'..=b'Z' => &mut goals,
                _ => continue,
            };
            let at = (rows, col as u32);
            if let Some((row, col)) = list.insert(letter.to_ascii_lowercase(), at) {
                let letter = char::from(letter);
                let reason = format!("'{letter}' stands at row {row}, column {col} already");
                return Err(fault(at.1 as usize, reason));
            }
        }
        if row.len() != cols {
            let reason = format!(
                "map row {rows} has {} letters, but the first one has {cols}",
                row.len()
            );
            return Err(fault(row.len().min(cols), reason));
        }
        rows += 1;
    }
    let cols = u32::try_from(cols).unwrap_or(u32::MAX);
    let grid = Grid::new(stem(source), rows, cols, terrain).map_err(|error| {
        let source = source.to_owned();
        InputError { source, ..error }.at_line(first)
    })?;
    if !starts.keys().eq(goals.keys()) {
        let lone = starts.keys().find(|letter| !goals.contains_key(*letter));
        let lone = lone.map(|letter| ("goal", letter.to_ascii_uppercase()));
        let (what, letter) = lone.unwrap_or_else(|| {
            let lone = goals.keys().find(|letter| !starts.contains_key(*letter));
            ("start", lone.copied().unwrap_or_default())
        });
        let reason = format!("an agent has no {what} '{}'", char::from(letter));
        return Err(InputError::new(source, reason).at_line(first).hint(HINT));
    }
    let agents = starts.into_values().zip(goals.into_values());
    let agents: Vec<AgentEntry> = agents
        .map(|(start, goal)| AgentEntry::new(0, start, goal))
        .collect();
    let list = (!agents.is_empty()).then(|| AgentList {
        source: source.to_owned(),
        map_file: None,
        agents,
    });
    Ok((grid, list))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_are_read_as_text_and_in_yaml() {
        for text in [
            "..#B\na.#A\nb...\n",
            "\n  ..#B\r\n  a.#A\r\n  b...",
            "small: |-\n  ..#B\n  a.#A\n  b...\n",
            "\"small\": |\n    !$#B\n    a@#A\n    b...\n",
            "small: \"..#B\\na.#A\\nb...\"\n",
        ] {
            let (grid, list) = read_pogema("m/small.yaml", text.as_bytes()).expect(text);
            assert_eq!((grid.name(), grid.rows(), grid.cols()), ("small", 3, 4));
            assert_eq!(grid.terrain(), b"..@...@.....", "{text}");
            let agents: Vec<_> = list
                .expect("agents")
                .agents
                .iter()
                .map(|agent| (agent.start, agent.goal))
                .collect();
            assert_eq!(agents, [((1, 0), (1, 3)), ((2, 0), (0, 3))], "{text}");
        }
        let (_, list) = read_pogema("m.txt", b".#\n..\n").expect("a map");
        assert!(list.is_none());
    }

    #[test]
    fn malformed_maps_are_told() {
        for (text, expected) in [
            (".#\n.\n", "m:2:2: map row 1 has 1 letters"),
            (".#\n.2\n", "m:2:2: unknown letter '2' in map row 1"),
            (".#\na.\n", "m:1: an agent has no goal 'A'"),
            (".#\nA.\n", "m:1: an agent has no start 'a'"),
            ("aA\na.\n", "m:2:1: 'a' stands at row 0, column 0 already"),
            (
                "one: |\n  ..\ntwo: |\n  ..\n",
                "m:3: there are 2 maps in the file, 'two'",
            ),
            (
                "one: [1]\n",
                "m:1:6: expected the rows of a map as a text, found a list",
            ),
            ("one: \"\"\n", "m:1: a map of 0 rows"),
        ] {
            let error = read_pogema("m", text.as_bytes()).expect_err(text);
            assert!(error.to_string().starts_with(expected), "{text}: {error}");
        }
    }
}
