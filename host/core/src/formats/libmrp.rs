//! Instances and schedules of libMultiRobotPlanning,
//! <https://github.com/whoenig/libMultiRobotPlanning>, in YAML.
//!
//! ```yaml
//! map:
//!   dimensions: [5, 2]       # columns, rows
//!   obstacles:
//!   - [0, 1]                 # x, y: the column and the row
//! agents:
//! - name: agent0
//!   start: [0, 0]
//!   goal: [4, 0]
//! ```
//!
//! A schedule has the states of every agent under `schedule: agent0:`, each with
//! `x`, `y` and `t`, and `statistics`, or figures beside it (`cost`, `makespan`, `runtime`), which are
//! not kept. Some of its programs write one state for a wait of several steps: the agent is then where
//! it was. Files of Python's dumper are read in its orders and styles, tuples (`!!python/tuple`) and
//! floats (`1.0`) among them.
//!
//! Agents are counted by their order in an instance, and by the number in
//! `agent<number>` in a schedule, which is how the library's programs name them. Other names with
//! numbers after one word are ordered by those, and all others count as they come.
//! Instances with `potentialGoals` ask for an assignment of goals and are refused, and
//! so are those on a roadmap.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use super::layout::{check_paths, row_col};
use super::pibt2::whole_number;
use super::yaml::Yaml;
use super::{AgentEntry, AgentList, MapSize};
use crate::files::{quote, shown, stem};
use crate::path_list::PLAN_MAX_AGENTS;
use crate::{Grid, GridPlan, InputError, OFF_MAP};

/// Largest map of an instance, in cells: dimensions are two numbers, so that a small
/// text may claim any.
const MOST_CELLS: i64 = 1 << 24;

/// Positions of a schedule beyond those that it lists: a small text may claim a wait
/// of any length.
const MOST_WAITS: usize = 1 << 20;

pub(super) fn text<'a>(source: &str, bytes: &'a [u8]) -> Result<&'a str, InputError> {
    let fault = |at: usize, reason: &str| {
        let line = bytes[..at].split(|byte| *byte == b'\n').count();
        InputError::new(source, reason).at_line(line as u64)
    };
    let text = std::str::from_utf8(bytes)
        .map_err(|error| fault(error.valid_up_to(), "the file is not UTF-8 text"))?;
    // YAML ends a line there, and nothing else does.
    let alone = bytes
        .windows(2)
        .position(|pair| pair[0] == b'\r' && pair[1] != b'\n');
    match alone {
        Some(at) => Err(fault(at, "a carriage return that ends no line")),
        None => Ok(text),
    }
}

fn unknown(yaml: &Yaml<'_>, key: &str, place: saphyr_parser::Marker, known: &str) -> InputError {
    let reason = format!("unknown key {}", quote(key.as_bytes()));
    yaml.error(place, reason)
        .hint(format!("known keys: {known}"))
}

/// Parses the content of an instance. `source` is named in errors, and its stem
/// becomes the map's name.
pub fn read_libmrp(source: &str, bytes: &[u8]) -> Result<(Grid, AgentList), InputError> {
    let mut yaml = Yaml::new(source, text(source, bytes)?)?;
    let mut dimensions = None;
    let mut obstacles = Vec::new();
    let mut agents = None;
    let whole = yaml.mapping(
        "an instance with map and agents",
        |yaml, key, place| match key {
            "map" => yaml
                .mapping("a map with dimensions and obstacles", |yaml, key, place| {
                    match key {
                        "dimensions" => dimensions = Some(size(yaml)?),
                        "obstacles" => {
                            yaml.list("a list of obstacles", |yaml| {
                                obstacles.push(yaml.pair("an obstacle [x, y]")?);
                                Ok(())
                            })?;
                        }
                        key => return Err(unknown(yaml, key, place, "dimensions, obstacles")),
                    }
                    Ok(())
                })
                .map(drop),
            "agents" => {
                agents = Some(read_agents(yaml)?);
                Ok(())
            }
            "roadmap" => Err(yaml
                .error(place, "the instance is on a roadmap, not on a grid")
                .hint("instances with a map are read")),
            key => Err(unknown(yaml, key, place, "map, agents")),
        },
    )?;
    let missing = |what: &str| {
        let reason = format!("there is no key `{what}`");
        InputError::new(source, reason).at(whole.line() as u64, whole.col() as u64 + 1)
    };
    let (cols, rows) = dimensions.ok_or_else(|| missing("dimensions"))?;
    let agents = agents.ok_or_else(|| missing("agents"))?;
    let mut terrain = vec![b'.'; rows as usize * cols as usize];
    for ((x, y), place) in obstacles {
        let inside = (0..i64::from(cols)).contains(&x) && (0..i64::from(rows)).contains(&y);
        if !inside {
            let reason = format!("the obstacle [{x}, {y}] is not on a map of {cols} by {rows}");
            return Err(yaml
                .error(place, reason)
                .hint("obstacles are [x, y]: the column before the row"));
        }
        terrain[y as usize * cols as usize + x as usize] = b'@';
    }
    yaml.finish()?;
    let grid = Grid::new(stem(source), rows, cols, terrain).map_err(|error| InputError {
        source: source.to_owned(),
        ..error
    })?;
    let list = AgentList {
        source: source.to_owned(),
        map_file: None,
        agents,
    };
    Ok((grid, list))
}

/// Columns and rows.
fn size(yaml: &mut Yaml<'_>) -> Result<(u32, u32), InputError> {
    let ((cols, rows), place) = yaml.pair("dimensions [columns, rows]")?;
    let fits = cols > 0 && rows > 0 && cols.checked_mul(rows).is_some_and(|n| n <= MOST_CELLS);
    if fits {
        return Ok((cols as u32, rows as u32));
    }
    let reason = format!("a map of {cols} columns and {rows} rows is empty or too large");
    Err(yaml
        .error(place, reason)
        .hint(format!("a map has between 1 and {MOST_CELLS} cells")))
}

fn read_agents(yaml: &mut Yaml<'_>) -> Result<Vec<AgentEntry>, InputError> {
    let mut agents = Vec::new();
    yaml.list("a list of agents", |yaml| {
        let (mut start, mut goal) = (None, None);
        let place = yaml.mapping("an agent with start and goal", |yaml, key, place| {
            match key {
                "name" => yaml.skip()?,
                "start" => start = Some(position(yaml, "a start [x, y]")?),
                "goal" => goal = Some(position(yaml, "a goal [x, y]")?),
                "potentialGoals" => {
                    return Err(yaml
                        .error(place, "an agent with several potential goals")
                        .hint("give every agent one goal; goals are not assigned here"));
                }
                key => return Err(unknown(yaml, key, place, "name, start, goal")),
            }
            Ok(())
        })?;
        let missing = |what: &str| yaml.error(place, format!("the agent has no {what}"));
        agents.push(AgentEntry::new(
            place.line() as u64,
            start.ok_or_else(|| missing("start"))?,
            goal.ok_or_else(|| missing("goal"))?,
        ));
        if agents.len() > PLAN_MAX_AGENTS {
            let reason = format!("more than {PLAN_MAX_AGENTS} agents");
            return Err(yaml.error(place, reason));
        }
        Ok(())
    })?;
    Ok(agents)
}

/// Row and column.
fn position(yaml: &mut Yaml<'_>, what: &str) -> Result<(u32, u32), InputError> {
    let ((x, y), place) = yaml.pair(what)?;
    match (u32::try_from(y), u32::try_from(x)) {
        (Ok(row), Ok(col)) => Ok((row, col)),
        _ => Err(yaml.error(place, format!("[{x}, {y}] is not on any map"))),
    }
}

/// Parses the content of a schedule on a map of `size`. `source` is named in errors.
pub fn read_libmrp_schedule(
    source: &str,
    bytes: &[u8],
    size: MapSize,
) -> Result<GridPlan, InputError> {
    let mut yaml = Yaml::new(source, text(source, bytes)?)?;
    let mut paths: Vec<(String, Vec<u32>)> = Vec::new();
    let mut waits = 0;
    let mut found = None;
    let whole = yaml.mapping("a schedule", |yaml, key, place| {
        match key {
            "statistics" | "cost" | "makespan" | "runtime" => yaml.skip()?,
            "schedule" => {
                let schedule = yaml.mapping("the agents' states", |yaml, name, place| {
                    let path = states(yaml, size, &mut waits)?;
                    if path.is_empty() {
                        let reason = format!("there is no path for {}", shown(name));
                        return Err(yaml
                            .error(place, reason)
                            .hint("the planner did not find one for every agent"));
                    }
                    paths.push((name.to_owned(), path));
                    Ok(())
                })?;
                found = Some(schedule);
            }
            key => {
                let known = "statistics, cost, makespan, runtime, schedule";
                return Err(unknown(yaml, key, place, known));
            }
        }
        Ok(())
    })?;
    if found.is_none() {
        return Err(yaml.error(whole, "there is no key `schedule`"));
    }
    let agents = paths.len();
    if agents == 0 {
        return Err(yaml.error(whole, "there are no agents in the schedule"));
    }
    let cells = paths.iter().map(|(_, path)| path.len()).sum();
    let paths = in_order(paths).map_err(|reason| yaml.error(whole, reason))?;
    let mut plan = GridPlan::with_capacity(agents, cells);
    for path in paths {
        plan.push_path(path);
    }
    yaml.finish()?;
    Ok(plan)
}

/// Paths in the order of their agents: by the numbers in their names, where those are one word and a
/// number each, and as they came otherwise.
fn in_order(paths: Vec<(String, Vec<u32>)>) -> Result<Vec<Vec<u32>>, String> {
    let word_and_number = |name: &str| {
        let word = name.trim_end_matches(|letter: char| letter.is_ascii_digit());
        let number = whole_number(&name[word.len()..])?;
        Some((word.to_owned(), number))
    };
    let names: Option<Vec<(String, u32)>> = paths
        .iter()
        .map(|(name, _)| word_and_number(name))
        .collect();
    let names = names.filter(|names| names.iter().all(|(word, _)| *word == names[0].0));
    let paths = paths.into_iter().map(|(_, path)| path);
    let Some(names) = names else {
        return Ok(paths.collect());
    };
    let is_own = names[0].0 == "agent";
    let (agents, mut numbered) = (names.len(), BTreeMap::new());
    for ((_, number), path) in names.into_iter().zip(paths) {
        if numbered.insert(number, path).is_some() {
            return Err(format!("a second path for agent {number}"));
        }
    }
    let mut numbers = (0..).zip(numbered.keys());
    match numbers.find(|(index, number)| index != *number) {
        Some((index, number)) if is_own => Err(format!(
            "there is no path for agent{index}: {agents} agents, and {number} is one of them"
        )),
        _ => Ok(numbered.into_values().collect()),
    }
}

/// The cells of an agent at times 0, 1, 2, ….
fn states(yaml: &mut Yaml<'_>, size: MapSize, waits: &mut usize) -> Result<Vec<u32>, InputError> {
    let mut path: Vec<u32> = Vec::new();
    yaml.list("a list of states", |yaml| {
        let (mut x, mut y, mut t) = (None, None, None);
        let place = yaml.mapping("a state with x, y and t", |yaml, key, place| {
            let slot = match key {
                "x" => &mut x,
                "y" => &mut y,
                "t" => &mut t,
                key => return Err(unknown(yaml, key, place, "x, y, t")),
            };
            *slot = Some(yaml.integer("a whole number")?.0);
            Ok(())
        })?;
        let (Some(x), Some(y), Some(t)) = (x, y, t) else {
            return Err(yaml.error(place, "a state has x, y and t"));
        };
        let inside =
            (0..i64::from(size.cols)).contains(&x) && (0..i64::from(size.rows)).contains(&y);
        let cell = if inside {
            (y * i64::from(size.cols) + x) as u32
        } else {
            OFF_MAP
        };
        let next = path.len() as i64;
        if t < next {
            let reason = format!("time {t} after time {}", next - 1);
            let first = format!("the first state is at time {t}, not 0");
            return Err(yaml.error(place, if next == 0 { first } else { reason }));
        }
        if t > next {
            let Some(last) = path.last().filter(|last| **last == cell) else {
                let reason = if next == 0 {
                    format!("the first state is at time {t}, not 0")
                } else {
                    format!("a move that takes from time {} to {t}", next - 1)
                };
                return Err(yaml.error(place, reason).hint(
                    "a plan has a position for every time; only waits may be longer than a step",
                ));
            };
            let (last, more) = (*last, (t - next) as usize);
            *waits = waits.saturating_add(more);
            if *waits > MOST_WAITS {
                let reason = format!("waits of more than {MOST_WAITS} steps");
                return Err(yaml.error(place, reason));
            }
            path.extend(std::iter::repeat_n(last, more));
        }
        path.push(cell);
        Ok(())
    })?;
    Ok(path)
}

/// The content of an instance. Starts and goals are cells of `grid`, equally many.
pub fn write_libmrp(grid: &Grid, starts: &[u32], goals: &[u32]) -> Vec<u8> {
    let (rows, cols) = (grid.rows(), grid.cols());
    let mut text = format!("map:\n  dimensions: [{cols}, {rows}]\n");
    let blocked = || (0..grid.cell_count()).filter(|cell| !grid.is_passable(*cell));
    text.push_str(if blocked().next().is_some() {
        "  obstacles:\n"
    } else {
        "  obstacles: []\n"
    });
    for cell in blocked() {
        let (row, col) = grid.row_col(cell);
        let _ = writeln!(text, "  - [{col}, {row}]");
    }
    text.push_str("agents:\n");
    let size = MapSize { rows, cols };
    for (agent, (start, goal)) in starts.iter().zip(goals).enumerate() {
        let (start, goal) = (row_col(*start, size), row_col(*goal, size));
        let _ = writeln!(
            text,
            "- name: agent{agent}\n  start: [{}, {}]\n  goal: [{}, {}]",
            start.1, start.0, goal.1, goal.0
        );
    }
    text.into_bytes()
}

/// The content of a schedule.
///
/// A plan without agents or with an empty path is an error.
pub fn write_libmrp_schedule(plan: &GridPlan, size: MapSize) -> Result<Vec<u8>, InputError> {
    check_paths(plan)?;
    let mut text = String::from("schedule:\n");
    for (agent, path) in plan.paths().enumerate() {
        let _ = writeln!(text, "  agent{agent}:");
        for (time, cell) in path.iter().enumerate() {
            let (y, x) = row_col(*cell, size);
            let _ = writeln!(text, "    - x: {x}\n      y: {y}\n      t: {time}");
        }
    }
    Ok(text.into_bytes())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SIZE: MapSize = MapSize { rows: 3, cols: 4 };

    const INSTANCE: &str = "map:\n  dimensions: [3, 2]\n  obstacles:\n    - [0, 1]\nagents:\n  \
                            - name: agent0\n    start: [0, 0]\n    goal: [2, 1]\n";

    /// Start and goal of each agent.
    fn ways(list: &AgentList) -> Vec<((u32, u32), (u32, u32))> {
        let agents = list.agents.iter();
        agents.map(|agent| (agent.start, agent.goal)).collect()
    }

    #[test]
    fn an_instance_is_read() {
        for text in [
            INSTANCE.to_owned(),
            // As the benchmarks have it: agents first.
            "agents:\n-   goal: [2, 1]\n    name: agent0\n    start: [0, 0]\n\
             map:\n    dimensions: [3, 2]\n    obstacles:\n    - [0, 1]\n"
                .to_owned(),
            "{map: {dimensions: [3, 2], obstacles: [[0, 1], [0, 1]]}, agents: \
             [{start: [0, 0], goal: [2, 1]}]}"
                .to_owned(),
        ] {
            let (grid, list) = read_libmrp("a/b.yaml", text.as_bytes()).expect(&text);
            assert_eq!(grid.name(), "b");
            assert_eq!((grid.rows(), grid.cols()), (2, 3));
            assert_eq!(grid.terrain(), b"...@..");
            assert_eq!(ways(&list), [((0, 0), (1, 2))], "{text}");
        }
    }

    #[test]
    fn malformed_instances_are_told_by_line_and_column() {
        let cases = [
            ("", "i:", "the file is empty"),
            (
                "[]",
                "i:1:1:",
                "expected an instance with map and agents, found a list",
            ),
            ("map: [", "i:", "expected a map with dimensions"),
            ("colour: 1", "i:1:1:", "unknown key 'colour'"),
            ("agents: []", "i:1:1:", "there is no key `dimensions`"),
            (
                "map: {dimensions: [1, 1]}",
                "i:1:1:",
                "there is no key `agents`",
            ),
            ("map: {dimensions: [1]}", "i:1:19:", "found 1 numbers"),
            (
                "map: {dimensions: [1, 2, 3]}",
                "i:1:26:",
                "found a third number",
            ),
            ("map: {dimensions: [0, 2]}", "i:1:19:", "empty or too large"),
            (
                "map: {dimensions: [99999999, 99999999]}",
                "i:1:19:",
                "empty or too large",
            ),
            (
                "map: {dimensions: [1.5, 2]}",
                "i:1:20:",
                "expected a coordinate, found '1.5'",
            ),
            (
                "map: {dimensions: ['1', 2]}",
                "i:1:20:",
                "expected a coordinate, found '1'",
            ),
            (
                "map: !!python/object:a.Map {}",
                "i:1:",
                "the tag 'tag:yaml.org,2002:!python/object:a.Map' is not accepted",
            ),
            ("map: {dimensions: *b}", "i:1:", "this is not YAML"),
            ("roadmap: {}", "i:1:1:", "the instance is on a roadmap"),
            (
                "map: {dimensions: [2, 2], obstacles: [[0, 2]]}\nagents: []",
                "i:1:39:",
                "the obstacle [0, 2] is not on a map of 2 by 2",
            ),
            (
                "agents:\n- start: [0, 0]\n",
                "i:2:3:",
                "the agent has no goal",
            ),
            (
                "agents:\n- start: [0, 0]\n  start: [0, 0]\n",
                "i:3:3:",
                "'start' is given twice",
            ),
            (
                "agents:\n- start: [-1, 0]\n",
                "i:2:10:",
                "[-1, 0] is not on any map",
            ),
            (
                "agents:\n- potentialGoals: []\n",
                "i:2:3:",
                "an agent with several potential goals",
            ),
            (
                "map: {dimensions: [1, 1]}\nagents: []\n---\nmore: 1\n",
                "i:3:",
                "the document goes on after its end",
            ),
        ];
        for (text, place, reason) in cases {
            let error = read_libmrp("i", text.as_bytes())
                .expect_err(text)
                .to_string();
            assert!(
                error.starts_with(place) && error.contains(reason),
                "{text}: {error}"
            );
        }
    }

    /// Ten lines that would be gigabytes, if aliases were followed.
    #[test]
    fn a_bomb_does_not_go_off() {
        let mut text = String::from("a0: &a0 [x, x]\n");
        for level in 1..40 {
            let below = level - 1;
            let _ = writeln!(text, "a{level}: &a{level} [*a{below}, *a{below}]");
        }
        let error = read_libmrp("i", text.as_bytes()).expect_err("a bomb");
        assert!(error.to_string().contains("unknown key 'a0'"), "{error}");
        let text = format!("statistics:\n  {}", text.replace('\n', "\n  "));
        let error = read_libmrp_schedule("i", text.as_bytes(), SIZE).expect_err("a bomb");
        assert!(
            error.to_string().contains("aliases of long values"),
            "{error}"
        );
        // Deep nesting takes no stack.
        let deep = format!("statistics: {}", "[".repeat(100_000));
        let error = read_libmrp_schedule("i", deep.as_bytes(), SIZE).expect_err("deep");
        assert!(error.to_string().contains("not YAML"), "{error}");
    }

    #[test]
    fn a_schedule_is_read() {
        // agent1 waits from 1 to 3, as the program for SIPP writes it.
        let text = "statistics:\n  cost: 3\nschedule:\n  agent1:\n    - x: 1\n      y: 0\n      t: 0\n\
                    \x20   - x: 2\n      y: 0\n      t: 1\n    - x: 2\n      y: 0\n      t: 3\n\
                    \x20 agent0:\n    - {x: 9, y: 0, t: 0}\n";
        let plan = read_libmrp_schedule("s", text.as_bytes(), SIZE).expect("a plan");
        assert_eq!(plan, GridPlan::from_paths([&[OFF_MAP][..], &[1, 2, 2, 2]]));
    }

    /// The orders and styles of Python's dumper, and names of its users.
    #[test]
    fn schedules_of_python_are_read() {
        let expected = GridPlan::from_paths([&[0, 1][..], &[4, 4]]);
        for text in [
            "cost: 3\nschedule:\n  agent0:\n  - {t: 0, x: 0, y: 0}\n  - {t: 1.0, x: 1.0, y: 0.0}\n\
             \x20 agent1:\n  - &id001 {t: 0, x: 0, y: 1}\n  - {t: 1, x: 0, y: 1}\n",
            "---\nschedule: {'agent1': [{t: 0, x: 0, y: 1}, {y: 1, x: 0, t: 1}], \"agent0\": \
             [{t: 0, x: 0, y: 0}, {t: 1, x: 1, y: 0}]}\ncost: 3.0\nruntime: 0.1\n...\n",
            "schedule:\n  robot10: [{t: 0, x: 0, y: 1}, {t: 1, x: 0, y: 1}]\n\
             \x20 robot9: [{t: 0, x: 0, y: 0}, {t: 1, x: 1, y: 0}]\n",
            "schedule:\n  carla: [{t: 0, x: 0, y: 0}, {t: 1, x: 1, y: 0}]\n\
             \x20 bert: [{t: 0, x: 0, y: 1}, {t: 1, x: 0, y: 1}]\n",
        ] {
            let plan = read_libmrp_schedule("s", text.as_bytes(), SIZE);
            assert_eq!(plan, Ok(expected.clone()), "{text}");
        }
    }

    /// A position that the dumper wrote once for two agents, and tuples.
    #[test]
    fn tuples_and_short_aliases_are_read() {
        let text = "agents:\n-   goal: &id001\n    - 2\n    - 1\n    start: !!python/tuple [0, 0]\n\
                    -   goal: [0, 0]\n    start: *id001\nmap:\n    dimensions: !!python/tuple\n    - 3\n\
                    \x20   - 2\n    obstacles:\n    - !!python/tuple [0, 1]\n";
        let (grid, list) = read_libmrp("a.yaml", text.as_bytes()).expect("an instance");
        assert_eq!(grid.terrain(), b"...@..");
        assert_eq!(ways(&list), [((0, 0), (1, 2)), ((1, 2), (0, 0))]);
        let text = text.replace("python/tuple [0, 1]", "python/object:a.B [0, 1]");
        let error = read_libmrp("a.yaml", text.as_bytes()).expect_err("an object");
        assert!(error.reason.contains("python/object:a.B"), "{error}");
    }

    #[test]
    fn malformed_schedules_are_told_by_line_and_column() {
        let cases = [
            ("{}", "s:1:1:", "there is no key `schedule`"),
            ("schedule: {}", "s:1:1:", "there are no agents"),
            (
                "schedule: {agent0: []}",
                "s:1:12:",
                "there is no path for agent0",
            ),
            (
                "schedule: {robot: []}",
                "s:1:12:",
                "there is no path for robot",
            ),
            (
                "schedule: {agent1: [{x: 0, y: 0, t: 0}]}",
                "s:1:1:",
                "there is no path for agent0",
            ),
            (
                "schedule: {agent0: [{x: 0, y: 0}]}",
                "s:1:21:",
                "a state has x, y and t",
            ),
            (
                "schedule: {agent0: [{x: 0, y: 0, t: 1}]}",
                "s:1:21:",
                "the first state is at time 1",
            ),
            (
                "schedule: {agent0: [{x: 0, y: 0, t: -1}]}",
                "s:1:21:",
                "the first state is at time -1",
            ),
            (
                "schedule: {agent0: [{x: 0, y: 0, t: 0}, {x: 0, y: 0, t: 0}]}",
                "s:1:41:",
                "time 0 after time 0",
            ),
            (
                "schedule: {agent0: [{x: 0, y: 0, t: 0}, {x: 1, y: 0, t: 2}]}",
                "s:1:41:",
                "a move that takes from time 0 to 2",
            ),
            (
                "schedule: {agent0: [{x: 0, y: 0, t: 0}, {x: 0, y: 0, t: 999999999999999}]}",
                "s:1:41:",
                "waits of more than 1048576 steps",
            ),
            (
                "schedule: {agent0: [{x: 0.5, y: 0, t: 0}]}",
                "s:1:25:",
                "found '0.5'",
            ),
            (
                "schedule: {agent0: 1}",
                "s:1:20:",
                "expected a list of states, found '1'",
            ),
        ];
        for (text, place, reason) in cases {
            let error = read_libmrp_schedule("s", text.as_bytes(), SIZE).expect_err(text);
            let error = error.to_string();
            assert!(
                error.starts_with(place) && error.contains(reason),
                "{text}: {error}"
            );
        }
    }

    proptest! {
        #[test]
        fn instances_go_out_and_come_back(
            terrain in prop::collection::vec(prop::sample::select(Grid::LETTERS.to_vec()), 12),
            cells in prop::collection::vec((0..12_u32, 0..12_u32), 1..6),
        ) {
            let grid = Grid::new("a", 3, 4, terrain).expect("a grid");
            let (starts, goals): (Vec<u32>, Vec<u32>) = cells.into_iter().unzip();
            let text = write_libmrp(&grid, &starts, &goals);
            let (again, list) = read_libmrp("a.yaml", &text).expect("an instance");
            prop_assert_eq!(again.digest(), grid.digest());
            let cell = |(row, col): (u32, u32)| row * 4 + col;
            let found: Vec<u32> = list.agents.iter().map(|agent| cell(agent.start)).collect();
            prop_assert_eq!(found, starts);
            let found: Vec<u32> = list.agents.iter().map(|agent| cell(agent.goal)).collect();
            prop_assert_eq!(found, goals);
        }

        #[test]
        fn schedules_keep_the_plan(
            lengths in prop::collection::vec(1..5_usize, 1..5),
            cells in prop::collection::vec(prop_oneof![0..12_u32, Just(OFF_MAP)], 20),
        ) {
            let paths = lengths.iter().zip(cells.chunks(4)).map(|(length, path)| &path[..*length]);
            let plan = GridPlan::from_paths(paths);
            let text = write_libmrp_schedule(&plan, SIZE).expect("a plan");
            prop_assert_eq!(read_libmrp_schedule("s", &text, SIZE), Ok(plan));
        }

        #[test]
        fn any_text_is_read_or_refused(
            text in "(map|agents|schedule)?: ?([0-9:,\\[\\]{}&*!#\n -]|agent0|dimensions|\\PC){0,60}",
        ) {
            let _ = read_libmrp("i", text.as_bytes());
            let _ = read_libmrp_schedule("s", text.as_bytes(), SIZE);
        }
    }
}
