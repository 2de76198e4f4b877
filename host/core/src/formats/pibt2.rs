//! Instance files of pibt2, <https://github.com/Kei18/pibt2>, as its
//! `instances/mapf/sample.txt` describes them.
//!
//! Lines `key=value`, comments that begin with `#`, and then a line `x,y,x,y` per
//! agent: start and goal, x is the column and 0,0 the upper left corner. The map is
//! a MovingAI file that is only named: pibt2 looks for it in the folder `map` of its
//! sources. `agents` says how many of the lines are used, from the first.
//!
//! An instance with `random_problem=1` lists nothing: pibt2 makes starts and goals
//! itself from the seed. It is refused. pibt2 passes over lines that it does not
//! know; here they are errors.

use std::fmt::Write as _;

use super::layout::row_col;
use super::{AgentEntry, AgentList, MapSize};
use crate::InputError;
use crate::files::{Lines, column, quote};

/// Keys whose values are whole numbers; they are settings of the solver.
const SETTINGS: [&str; 4] = ["seed", "well_formed", "max_timestep", "max_comp_time"];

const HINT: &str = "lines are map_file=NAME, agents=N, seed=N, random_problem=0, well_formed=N, \
                    max_timestep=N, max_comp_time=MS, and x,y,x,y (start and goal) per agent";

/// Parses the content of an instance file. `source` is named in errors.
pub fn read_pibt2(source: &str, bytes: &[u8]) -> Result<AgentList, InputError> {
    let mut map_file = None;
    let mut wanted: Option<usize> = None;
    let mut agents = Vec::new();
    let mut seen: Vec<(&str, u64)> = Vec::new();
    let mut last = 0;
    for (number, line) in Lines::new(bytes) {
        last = number;
        let fault = |at: usize, reason: String| {
            InputError::new(source, reason).at(number, column(line, at))
        };
        if line.first() == Some(&b'#') || line.trim_ascii().is_empty() {
            continue;
        }
        let text = std::str::from_utf8(line)
            .map_err(|error| fault(error.valid_up_to(), "the line is not UTF-8 text".into()))?;
        let Some((key, value)) = text.split_once('=') else {
            let (Some(wanted), Some(_)) = (wanted, &map_file) else {
                let reason = "map_file and agents come before starts and goals".into();
                return Err(fault(0, reason).hint(HINT));
            };
            let entry = entry(text, number).map_err(|(at, reason)| fault(at, reason).hint(HINT))?;
            // pibt2 takes the first so many.
            if agents.len() < wanted {
                agents.push(entry);
            }
            continue;
        };
        if let Some((_, first)) = seen.iter().find(|(known, _)| *known == key) {
            let reason = format!("{key} given twice, first on line {first}");
            return Err(fault(0, reason));
        }
        seen.push((key, number));
        let at = key.len() + 1;
        let integer = || {
            whole_number(value).ok_or_else(|| {
                let reason = format!("{key} is {}, not a whole number", quote(value.as_bytes()));
                fault(at, reason)
            })
        };
        match key {
            "map_file" if value.is_empty() => return Err(fault(at, "map_file is empty".into())),
            "map_file" => map_file = Some(value.to_owned()),
            "agents" => match integer()? {
                0 => return Err(fault(at, "there are no agents".into())),
                value => wanted = Some(value as usize),
            },
            "random_problem" => {
                if integer()? != 0 {
                    let reason = "the instance is random: pibt2 makes its starts and goals";
                    return Err(fault(at, reason.into())
                        .hint("write random_problem=0 and a line x,y,x,y per agent"));
                }
            }
            key if SETTINGS.contains(&key) => {
                integer()?;
            }
            key => {
                let reason = format!("unknown key {}", quote(key.as_bytes()));
                return Err(fault(0, reason).hint(HINT));
            }
        }
    }
    let missing = |what: &str| InputError::new(source, format!("there is no line {what}"));
    let map_file = map_file.ok_or_else(|| missing("map_file=NAME").hint(HINT))?;
    let wanted = wanted.ok_or_else(|| missing("agents=N").hint(HINT))?;
    if agents.len() < wanted {
        let found = agents.len();
        let reason = format!("{wanted} agents, but starts and goals of {found}");
        return Err(InputError::new(source, reason)
            .at_line(last)
            .hint("pibt2 would make all of them at random"));
    }
    Ok(AgentList {
        source: source.to_owned(),
        map_file: Some(map_file),
        agents,
    })
}

/// Digits alone, and few enough for 32 bits.
pub(super) fn whole_number(text: &str) -> Option<u32> {
    let digits = !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
    digits.then(|| text.parse().ok()).flatten()
}

/// A line `x,y,x,y`; the error has its byte.
fn entry(text: &str, line: u64) -> Result<AgentEntry, (usize, String)> {
    let mut values = [0; 4];
    let mut at = 0;
    let mut found = 0;
    for word in text.split(',') {
        if let Some(value) = values.get_mut(found) {
            *value = whole_number(word).ok_or_else(|| {
                let word = quote(word.as_bytes());
                (at, format!("{word} is not a coordinate of 0 or more"))
            })?;
        }
        found += 1;
        at += word.len() + 1;
    }
    if found != 4 {
        let reason = format!("start and goal are four numbers, found {found}");
        return Err((0, reason));
    }
    let [start_x, start_y, goal_x, goal_y] = values;
    Ok(AgentEntry::new(line, (start_y, start_x), (goal_y, goal_x)))
}

/// Settings of the solver in an instance file. Those that are `None` are left to pibt2.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Pibt2Settings {
    /// Seed of its random choices.
    pub seed: Option<u32>,
    /// Most time steps of a plan.
    pub max_timestep: Option<u32>,
    /// Most milliseconds.
    pub max_comp_time: Option<u32>,
}

/// The content of an instance file. `map_file` is what pibt2 will look for, in its
/// folder `map`; starts and goals are cells of a map of `size`, equally many.
pub fn write_pibt2(
    map_file: &str,
    size: MapSize,
    starts: &[u32],
    goals: &[u32],
    settings: &Pibt2Settings,
) -> Vec<u8> {
    let map_file = map_file.replace(char::is_control, " ");
    let mut text = format!(
        "map_file={map_file}\nagents={}\nrandom_problem=0\n",
        starts.len()
    );
    for (key, value) in [
        ("seed", settings.seed),
        ("max_timestep", settings.max_timestep),
        ("max_comp_time", settings.max_comp_time),
    ] {
        if let Some(value) = value {
            let _ = writeln!(text, "{key}={value}");
        }
    }
    for (start, goal) in starts.iter().zip(goals) {
        let (start, goal) = (row_col(*start, size), row_col(*goal, size));
        let _ = writeln!(text, "{},{},{},{}", start.1, start.0, goal.1, goal.0);
    }
    text.into_bytes()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn an_instance_is_read_as_pibt2_does() {
        // x is the column; lines beyond the number of agents are not used.
        let text = "## custom\nmap_file=arena.map\r\n\nagents=2\nseed=1\nrandom_problem=0\n\
                    max_timestep=1000\nmax_comp_time=5000\n# 9,9,9,9\n0,1,4,2\n3,1,3,0\n7,7,7,7\n";
        let list = read_pibt2("i.txt", text.as_bytes()).expect("an instance");
        let entry = AgentEntry::new;
        assert_eq!(list.map_file.as_deref(), Some("arena.map"));
        assert_eq!(
            list.agents,
            [entry(10, (1, 0), (2, 4)), entry(11, (1, 3), (0, 3))]
        );
    }

    #[test]
    fn malformed_instances_are_told_by_line_and_column() {
        let head = "map_file=a.map\nagents=1\n";
        let cases = [
            ("", "i.txt: there is no line map_file=NAME"),
            ("agents=1\n", "i.txt: there is no line map_file=NAME"),
            ("map_file=\n", "i.txt:1:10: map_file is empty"),
            (
                "map_file=a\nmap_file=b\n",
                "i.txt:2:1: map_file given twice, first on line 1",
            ),
            ("map_file=a\n", "i.txt: there is no line agents=N"),
            (
                "map_file=a\n0,0,0,0\n",
                "i.txt:2:1: map_file and agents come before",
            ),
            ("agents=0\n", "i.txt:1:8: there are no agents"),
            (
                "agents=-1\n",
                "i.txt:1:8: agents is '-1', not a whole number",
            ),
            (
                "agents=99999999999\n",
                "i.txt:1:8: agents is '99999999999', not a whole",
            ),
            (
                "agents= 1\n",
                "i.txt:1:8: agents is ' 1', not a whole number",
            ),
            ("colour=1\n", "i.txt:1:1: unknown key 'colour'"),
            ("random_problem=1\n", "i.txt:1:16: the instance is random"),
            ("seed=x\n", "i.txt:1:6: seed is 'x', not a whole number"),
        ];
        for (text, expected) in cases {
            let error = read_pibt2("i.txt", text.as_bytes())
                .expect_err(text)
                .to_string();
            assert!(error.starts_with(expected), "{text}: {error}");
        }
        for (text, expected) in [
            ("", "i.txt:2: 1 agents, but starts and goals of 0"),
            (
                "0,0,0\n",
                "i.txt:3:1: start and goal are four numbers, found 3",
            ),
            (
                "0,0,0,0,0\n",
                "i.txt:3:1: start and goal are four numbers, found 5",
            ),
            ("0,0,-1,0\n", "i.txt:3:5: '-1' is not a coordinate"),
            ("0,ä,x,0\n", "i.txt:3:3: 'ä' is not a coordinate"),
            ("nonsense\n", "i.txt:3:1: 'nonsense' is not a coordinate"),
        ] {
            let text = format!("{head}{text}");
            let error = read_pibt2("i.txt", text.as_bytes())
                .expect_err(&text)
                .to_string();
            assert!(error.starts_with(expected), "{text}: {error}");
        }
        let error = read_pibt2("i.txt", b"seed=\xff")
            .expect_err("no text")
            .to_string();
        assert_eq!(error, "i.txt:1:6: the line is not UTF-8 text");
    }

    proptest! {
        #[test]
        fn what_is_written_is_read_again(
            cells in prop::collection::vec((0..12_u32, 0..12_u32), 1..6),
            seed in prop::option::of(any::<u32>()),
        ) {
            let size = MapSize { rows: 3, cols: 4 };
            let (starts, goals): (Vec<u32>, Vec<u32>) = cells.into_iter().unzip();
            let settings = Pibt2Settings { seed, ..Pibt2Settings::default() };
            let text = write_pibt2("b c.map", size, &starts, &goals, &settings);
            let list = read_pibt2("i.txt", &text).expect("an instance");
            let cells = |pick: fn(&AgentEntry) -> (u32, u32)| -> Vec<u32> {
                list.agents.iter().map(pick).map(|(row, col)| row * 4 + col).collect()
            };
            prop_assert_eq!(list.map_file.as_deref(), Some("b c.map"));
            prop_assert_eq!(cells(|agent| agent.start), starts);
            prop_assert_eq!(cells(|agent| agent.goal), goals);
        }

        #[test]
        fn any_text_is_read_or_refused(text in "(map_file=a\nagents=[12]\n)?([a-z_=0-9,#\n]|\\PC){0,60}") {
            let _ = read_pibt2("i.txt", text.as_bytes());
        }
    }
}
