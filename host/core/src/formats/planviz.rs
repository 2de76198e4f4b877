//! Results of the League of Robot Runners, which PlanViz shows,
//! <https://github.com/MAPF-Competition/PlanViz>: one JSON object, as the Start-Kit's
//! `Input_Output_Format.md` describes it, versions 2023 to 2026.
//!
//! Of a result, `actionModel`, `teamSize`, `start`, `actualPaths` and `agentMaxCounter`
//! are read; other keys are passed over, since each year has others. The first
//! `teamSize` starts and paths are those of the team. A start is row, column and
//! heading, `E`, `S`, `W`, `N` or its number from 0 as in the Start-Kit. A path is a text of actions from the start:
//!
//! - model `MAPF_T`: `F` forward, `R` and `C` a quarter turn clockwise and counter-
//!   clockwise, `W` wait, also `FW`, `CR`, `CCR`, and `T` and `NA` for waits;
//! - model `MAPF`: `U` to the next row, `D` to the row before (as PlanViz draws
//!   them), `L`, `R`, `W`. Other files, an example of PlanViz among them, mean `U` and
//!   `D` the other way round: one is read so if only that keeps everybody on the map.
//!
//! Actions are separated by commas and take a step each. Since 2026 they are written
//! as runs, `[(tick,row,column,heading,counter):(F 10,W 3)]…`, and an action takes
//! `agentMaxCounter` ticks, which need not follow each other. A step of the plan is
//! then a tick, and an agent counts as in the cell that it leaves until it has left
//! it. Turns are waits in either case. The positions that runs repeat are not
//! compared: PlanViz does not look at them, and its own example has wrong ones.
//!
//! Files are written in version `2024 LoRR` with the model `MAPF`: one task of one
//! errand per agent, released at time 0 and finished when the agent has come to its
//! goal for good.

use std::fmt;

use serde::Deserialize;
use serde::de::{self, Deserializer, Unexpected, Visitor};
use serde_json::json;

use super::MapSize;
use super::layout::{check_paths, row_col};
use crate::files::quote;
use crate::json::json_error;
use crate::{GridPlan, InputError, OFF_MAP};

/// Positions that a small text may have; a run is short, whatever its length.
const FREE_POSITIONS: usize = 1 << 20;

/// Positions per byte of a larger text.
const POSITIONS_PER_BYTE: usize = 256;

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Outcome {
    action_model: Model,
    team_size: usize,
    start: Vec<(i64, i64, Heading)>,
    actual_paths: Vec<String>,
    agent_max_counter: Option<u32>,
}

#[derive(Clone, Copy, PartialEq, Eq, Deserialize)]
enum Model {
    #[serde(rename = "MAPF")]
    Pebble,
    #[serde(rename = "MAPF_T")]
    Turning,
}

/// The heading of an agent, counted clockwise from east, as a letter or as its number from 0.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Heading {
    E,
    S,
    W,
    N,
    None,
}

impl<'de> Deserialize<'de> for Heading {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Clone, Copy)]
        struct Read;
        impl Visitor<'_> for Read {
            type Value = Heading;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a heading: E, S, W or N, its number 0, 1, 2 or 3, or N/A")
            }
            fn visit_str<E: de::Error>(self, text: &str) -> Result<Heading, E> {
                match text {
                    "E" | "0" => Ok(Heading::E),
                    "S" | "1" => Ok(Heading::S),
                    "W" | "2" => Ok(Heading::W),
                    "N" | "3" => Ok(Heading::N),
                    "N/A" | "-1" => Ok(Heading::None),
                    other => Err(E::invalid_value(Unexpected::Str(other), &self)),
                }
            }
            fn visit_i64<E: de::Error>(self, number: i64) -> Result<Heading, E> {
                self.visit_str(&number.to_string())
                    .map_err(|_: E| E::invalid_value(Unexpected::Signed(number), &self))
            }
            fn visit_u64<E: de::Error>(self, number: u64) -> Result<Heading, E> {
                self.visit_str(&number.to_string())
                    .map_err(|_: E| E::invalid_value(Unexpected::Unsigned(number), &self))
            }
        }
        deserializer.deserialize_any(Read)
    }
}

impl Heading {
    fn turned(self, quarters: usize) -> Self {
        const ROUND: [Heading; 4] = [Heading::E, Heading::S, Heading::W, Heading::N];
        let at = ROUND.iter().position(|heading| *heading == self);
        at.map_or(self, |at| ROUND[(at + quarters) % 4])
    }

    /// Rows and columns of a step.
    fn step(self) -> Option<(i64, i64)> {
        match self {
            Self::E => Some((0, 1)),
            Self::S => Some((1, 0)),
            Self::W => Some((0, -1)),
            Self::N => Some((-1, 0)),
            Self::None => None,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Action {
    Wait,
    Forward,
    /// Quarter turns clockwise.
    Turn(usize),
    /// Rows and columns.
    Step(i64, i64),
}

impl Action {
    fn read(model: Model, text: &str) -> Option<Self> {
        match (model, text) {
            (_, "W" | "T" | "NA") => Some(Self::Wait),
            (Model::Turning, "F" | "FW") => Some(Self::Forward),
            (Model::Turning, "R" | "CR") => Some(Self::Turn(1)),
            (Model::Turning, "C" | "CCR") => Some(Self::Turn(3)),
            (Model::Pebble, "U") => Some(Self::Step(1, 0)),
            (Model::Pebble, "D") => Some(Self::Step(-1, 0)),
            (Model::Pebble, "L") => Some(Self::Step(0, -1)),
            (Model::Pebble, "R") => Some(Self::Step(0, 1)),
            _ => None,
        }
    }
}

/// Parses the content of a result on a map of `size`. `source` is named in errors.
pub fn read_planviz(source: &str, bytes: &[u8], size: MapSize) -> Result<GridPlan, InputError> {
    if bytes.trim_ascii_start().first() != Some(&b'{') {
        return Err(InputError::new(source, "this is not a JSON object")
            .at_line(1)
            .hint("a result is an object with actionModel, start and actualPaths"));
    }
    let outcome: Outcome = serde_json::from_slice(bytes).map_err(|error| {
        let error = json_error(source, bytes, &error);
        if error.reason.contains("actualPaths") {
            error.hint("ask the League's program for a full output, --outputScreen 1")
        } else {
            error
        }
    })?;
    let team = outcome.team_size;
    for (key, entries) in [
        ("start", outcome.start.len()),
        ("actualPaths", outcome.actual_paths.len()),
    ] {
        if entries < team {
            let reason = format!("teamSize is {team}, but {key} has {entries} entries");
            return Err(InputError::new(source, reason));
        }
    }
    if team == 0 {
        return Err(InputError::new(source, "there are no agents"));
    }
    let most = FREE_POSITIONS + POSITIONS_PER_BYTE * bytes.len();
    let walked = |up: i64| {
        outcome
            .plan(size, up, most)
            .map_err(|reason| InputError::new(source, reason))
    };
    let plan = walked(1)?;
    let leaves = |plan: &GridPlan| plan.cells().contains(&OFF_MAP);
    if outcome.action_model == Model::Pebble && leaves(&plan) {
        let other = walked(-1)?;
        if !leaves(&other) {
            return Ok(other);
        }
    }
    Ok(plan)
}

impl Outcome {
    /// Everybody's cells, if `U` leads `up` rows on; at most so many.
    fn plan(&self, size: MapSize, up: i64, most: usize) -> Result<GridPlan, String> {
        let mut cells = Vec::new();
        let mut plan = GridPlan::default();
        let mut used = 0;
        let paths = self.actual_paths.iter().zip(&self.start);
        for (agent, (text, start)) in paths.take(self.team_size).enumerate() {
            let mut robot = Robot {
                model: self.action_model,
                size,
                row: start.0,
                col: start.1,
                heading: start.2,
                begun: Action::Wait,
                ticks: 0,
                ticks_per_action: 1,
                up,
            };
            cells.clear();
            cells.push(robot.cell());
            let walked = if text.trim_start().starts_with('[') {
                robot.ticks_per_action = self.agent_max_counter.unwrap_or(10);
                robot.runs(text, most.saturating_sub(used), &mut cells)
            } else {
                robot.actions(text, most.saturating_sub(used), &mut cells)
            };
            walked.map_err(|reason| format!("actualPaths of agent {agent}: {reason}"))?;
            used += cells.len();
            plan.push_path(cells.iter().copied());
        }
        Ok(plan)
    }
}

struct Robot {
    model: Model,
    size: MapSize,
    row: i64,
    col: i64,
    heading: Heading,
    /// The action that it has begun, and the ticks of that.
    begun: Action,
    ticks: u32,
    ticks_per_action: u32,
    /// Rows of `U`.
    up: i64,
}

impl Robot {
    fn cell(&self) -> u32 {
        let MapSize { rows, cols } = self.size;
        let inside =
            (0..i64::from(rows)).contains(&self.row) && (0..i64::from(cols)).contains(&self.col);
        if inside {
            (self.row * i64::from(cols) + self.col) as u32
        } else {
            OFF_MAP
        }
    }

    /// One action, or one tick of it.
    fn act(&mut self, action: Action) -> Result<(), String> {
        if action == Action::Wait {
            return Ok(());
        }
        if self.ticks > 0 && self.begun != action {
            return Err("an action begins before the last one has ended".into());
        }
        self.begun = action;
        self.ticks += 1;
        if self.ticks < self.ticks_per_action {
            return Ok(());
        }
        self.ticks = 0;
        let (rows, cols) = match action {
            Action::Wait => (0, 0),
            Action::Turn(quarters) => {
                self.heading = self.heading.turned(quarters);
                (0, 0)
            }
            Action::Forward => self
                .heading
                .step()
                .ok_or("the agent goes forward, but its start has no heading")?,
            Action::Step(rows, cols) => (rows * self.up, cols),
        };
        self.row = self.row.saturating_add(rows);
        self.col = self.col.saturating_add(cols);
        Ok(())
    }

    fn action(&self, text: &str) -> Result<Action, String> {
        Action::read(self.model, text).ok_or_else(|| {
            let known = match self.model {
                Model::Turning => "F, R, C, W",
                Model::Pebble => "U, D, L, R, W",
            };
            let found = quote(text.as_bytes());
            format!("unknown action {found}; actions of this model are {known}")
        })
    }

    /// Comma-separated actions.
    fn actions(&mut self, text: &str, most: usize, cells: &mut Vec<u32>) -> Result<(), String> {
        let text = text.trim();
        let text = text.strip_suffix(',').unwrap_or(text);
        if text.is_empty() {
            return Ok(());
        }
        for word in text.split(',') {
            let action = self.action(word.trim())?;
            self.act(action)
                .map_err(|reason| format!("step {}: {reason}", cells.len()))?;
            if cells.len() >= most {
                return Err(too_long());
            }
            cells.push(self.cell());
        }
        Ok(())
    }

    /// Runs, `[(tick,row,column,heading,counter):(F 10,W 3)]…`.
    fn runs(&mut self, text: &str, most: usize, cells: &mut Vec<u32>) -> Result<(), String> {
        let mut rest = text.trim();
        while !rest.is_empty() {
            let malformed = || {
                let found = quote(rest.as_bytes());
                format!(
                    "expected [(tick,row,column,heading,counter):(ACTION TICKS,…)], found {found}"
                )
            };
            let inner = rest.strip_prefix("[(").ok_or_else(malformed)?;
            let (state, inner) = inner.split_once("):(").ok_or_else(malformed)?;
            let (runs, after) = inner.split_once(")]").ok_or_else(malformed)?;
            let tick = state
                .split(',')
                .next()
                .and_then(|tick| tick.trim().parse().ok());
            if state.split(',').count() != 5 {
                return Err(malformed());
            }
            let expected = cells.len() - 1;
            if tick != Some(expected) {
                let found = quote(state.as_bytes());
                return Err(format!("expected runs from tick {expected}, found {found}"));
            }
            for run in runs.split(',').map(str::trim).filter(|run| !run.is_empty()) {
                self.run(run, most, cells)?;
            }
            rest = after.trim_start();
        }
        Ok(())
    }

    fn run(&mut self, run: &str, most: usize, cells: &mut Vec<u32>) -> Result<(), String> {
        let (action, count) = run
            .split_once(' ')
            .and_then(|(action, count)| Some((action, count.trim().parse::<u32>().ok()?)))
            .ok_or_else(|| format!("expected ACTION TICKS, found {}", quote(run.as_bytes())))?;
        let action = self.action(action)?;
        if count as usize > most.saturating_sub(cells.len()) {
            return Err(too_long());
        }
        for _ in 0..count {
            self.act(action)
                .map_err(|reason| format!("tick {}: {reason}", cells.len()))?;
            cells.push(self.cell());
        }
        Ok(())
    }
}

fn too_long() -> String {
    "there are more actions than a file of this size may have".into()
}

/// The content of a result for PlanViz: a plan, and the goals of its agents.
///
/// Errors are a plan without agents or with an empty path, another number of goals,
/// and moves that the model `MAPF` does not have: diagonal ones, jumps, and positions
/// outside the map.
pub fn write_planviz(plan: &GridPlan, goals: &[u32], size: MapSize) -> Result<Vec<u8>, InputError> {
    check_paths(plan)?;
    if plan.agents() != goals.len() {
        let reason = format!(
            "the plan has {} paths for {} goals",
            plan.agents(),
            goals.len()
        );
        return Err(InputError::new("plan", reason));
    }
    let plan = plan.trimmed();
    let horizon = plan.horizon();
    let mut paths = Vec::with_capacity(plan.agents());
    let mut events = Vec::new();
    for (agent, (path, goal)) in plan.paths().zip(goals).enumerate() {
        let mut text = String::with_capacity(2 * horizon);
        for (time, pair) in path.windows(2).enumerate() {
            let letter = letter(pair[0], pair[1], size).ok_or_else(|| {
                let (from, to) = (row_col(pair[0], size), row_col(pair[1], size));
                let reason = format!(
                    "agent {agent} goes from {from:?} to {to:?} (row, column) at time {}, \
                     for which PlanViz has no letter",
                    time + 1
                );
                InputError::new("plan", reason)
                    .hint("PlanViz shows moves up, down, left and right, and waits")
            })?;
            text.push(letter);
            text.push(',');
        }
        for _ in path.len() - 1..horizon {
            text.push_str("W,");
        }
        text.pop();
        paths.push(text);
        if row_col(path[0], size).0 < 0 {
            let reason = format!("agent {agent} begins outside the map");
            return Err(InputError::new("plan", reason));
        }
        if path.last() == Some(goal) {
            events.push((path.len() - 1, agent, agent, 1));
        }
    }
    events.sort_unstable();
    let starts = plan.paths().map(|path| row_col(path[0], size));
    let tasks = goals.iter().map(|goal| row_col(*goal, size));
    let schedule: Vec<String> = (0..plan.agents())
        .map(|agent| format!("0:{agent}"))
        .collect();
    let none: [(); 0] = [];
    let outcome = json!({
        "version": "2024 LoRR",
        "actionModel": "MAPF",
        "teamSize": plan.agents(),
        "numTaskFinished": events.len(),
        "makespan": horizon,
        "start": starts.map(|(row, col)| (row, col, "N/A")).collect::<Vec<_>>(),
        "actualPaths": paths,
        "plannerPaths": paths,
        "plannerTimes": none,
        "errors": none,
        "scheduleErrors": none,
        "actualSchedule": schedule,
        "plannerSchedule": schedule,
        "events": events,
        "tasks": tasks.enumerate().map(|(id, (row, col))| (id, 0, [row, col])).collect::<Vec<_>>(),
    });
    let mut text = outcome.to_string().into_bytes();
    text.push(b'\n');
    Ok(text)
}

/// The letter of a move in the model `MAPF`.
fn letter(from: u32, to: u32, size: MapSize) -> Option<char> {
    let ((row, col), (next_row, next_col)) = (row_col(from, size), row_col(to, size));
    if row < 0 || next_row < 0 {
        return None;
    }
    match (next_row - row, next_col - col) {
        (0, 0) => Some('W'),
        (1, 0) => Some('U'),
        (-1, 0) => Some('D'),
        (0, -1) => Some('L'),
        (0, 1) => Some('R'),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const SIZE: MapSize = MapSize { rows: 3, cols: 4 };

    fn result(model: &str, start: &str, paths: &str, more: &str) -> String {
        format!(
            "{{\"actionModel\": \"{model}\", \"teamSize\": 1, \"start\": [{start}], \
             \"actualPaths\": [{paths}]{more}}}"
        )
    }

    fn read(text: &str) -> Result<Vec<Vec<u32>>, String> {
        let plan = read_planviz("r.json", text.as_bytes(), SIZE);
        plan.map(|plan| plan.paths().map(<[u32]>::to_vec).collect())
            .map_err(|error| error.to_string())
    }

    #[test]
    fn paths_of_every_year_are_read() {
        // East, a turn to the south, on, a wait; off the map at the end.
        let turning = vec![0, 1, 1, 5, 5, 9, OFF_MAP];
        for path in ["F,R,F,W,F,F", "FW,CR,FW,NA,FW,FW,"] {
            let text = result("MAPF_T", "[0, 0, \"E\"]", &format!("\"{path}\""), "");
            assert_eq!(read(&text), Ok(vec![turning.clone()]), "{path}");
        }
        for north in ["\"N\"", "3"] {
            let start = format!("[1, 1, {north}]");
            let text = result("MAPF_T", &start, "\"C,F,C,F\"", "");
            assert_eq!(read(&text), Ok(vec![vec![5, 5, 4, 4, 8]]));
        }
        let text = result("MAPF_T", "[1, 1, 4]", "\"W\"", "");
        assert!(read(&text).unwrap_err().contains("its number 0, 1, 2 or 3"));
        let text = result("MAPF", "[0, 0, \"N/A\"]", "\"U,R,D,L,W\"", "");
        assert_eq!(read(&text), Ok(vec![vec![0, 4, 5, 1, 0, 0]]));
        let text = result("MAPF", "[2, 3, \"N/A\"]", "\"\"", "");
        assert_eq!(read(&text), Ok(vec![vec![11]]));
        // Starts beyond the team are nobody's, as in an example of PlanViz.
        let starts = "[0, 0, \"N/A\"], [1, 1, \"N/A\"]";
        let text = result("MAPF", starts, "\"U\", \"W\"", "");
        assert_eq!(read(&text), Ok(vec![vec![0, 4]]));
        // Up and down the other way round, since the map has three rows.
        let text = result("MAPF", "[2, 0, \"N/A\"]", "\"U,R,D\"", "");
        assert_eq!(read(&text), Ok(vec![vec![8, 4, 5, 9]]));
        let text = result("MAPF", "[0, 0, \"N/A\"]", "\"L,U\"", "");
        assert_eq!(read(&text), Ok(vec![vec![0, OFF_MAP, OFF_MAP]]));
        // Two ticks per action, one of them delayed; the second chunk's state is stale.
        let text = result(
            "MAPF_T",
            "[0, 0, \"E\"]",
            "\"[(0,0,0,0,0):(F 1,W 2,F 1)][(4,0,0,0,0):(R 2,F 2)]\"",
            ", \"agentMaxCounter\": 2, \"version\": \"2026 LoRR\"",
        );
        assert_eq!(read(&text), Ok(vec![vec![0, 0, 0, 0, 1, 1, 1, 1, 5]]));
    }

    #[test]
    fn malformed_results_are_told() {
        let path = |path: &str| result("MAPF_T", "[0, 0, \"E\"]", &format!("\"{path}\""), "");
        let cases = [
            (String::new(), "r.json:1: this is not a JSON object"),
            ("{}".into(), "r.json:1:2: missing field `actionModel`"),
            (
                result("CAR", "", "", ""),
                "r.json:1:21: unknown variant `CAR`",
            ),
            (
                result("MAPF", "", "", ""),
                "r.json: teamSize is 1, but start has 0 entries",
            ),
            (
                result("MAPF", "", "\"W\"", ""),
                "r.json: teamSize is 1, but start has 0 entries",
            ),
            (result("MAPF", "[0, 0]", "\"W\"", ""), "r.json:1:"),
            (
                path("F,X"),
                "r.json: actualPaths of agent 0: unknown action 'X'; actions of this model are F, R, C, W",
            ),
            (
                path("F,,F"),
                "r.json: actualPaths of agent 0: unknown action ''",
            ),
            (
                result("MAPF_T", "[0, 0, \"N/A\"]", "\"W,F\"", ""),
                "r.json: actualPaths of agent 0: step 2: the agent goes forward, but its start",
            ),
            (
                path("[(0,0,0,0,0):(F 1,R 1)]"),
                "r.json: actualPaths of agent 0: tick 2: an action begins before",
            ),
            (
                path("[(1,0,0,0,0):(F 1)]"),
                "r.json: actualPaths of agent 0: expected runs from tick 0",
            ),
            (
                path("[(0,0,0):(F 1)]"),
                "r.json: actualPaths of agent 0: expected [(tick",
            ),
            (
                path("[(0,0,0,0,0):(F 1]"),
                "r.json: actualPaths of agent 0: expected [(tick",
            ),
            (
                path("[(0,0,0,0,0):(F)]"),
                "r.json: actualPaths of agent 0: expected ACTION TICKS, found 'F'",
            ),
            (
                path("[(0,0,0,0,0):(F -1)]"),
                "r.json: actualPaths of agent 0: expected ACTION TICKS",
            ),
            (
                path("[(0,0,0,0,0):(W 4000000000)]"),
                "r.json: actualPaths of agent 0: there are more actions",
            ),
        ];
        for (text, expected) in cases {
            let error = read(&text).expect_err(&text);
            assert!(error.starts_with(expected), "{text}: {error}");
        }
    }

    #[test]
    fn what_planviz_has_no_letter_for_is_not_written() {
        let write = |plan: &GridPlan, goals: &[u32]| {
            let written = write_planviz(plan, goals, SIZE);
            written.expect_err("no letter").to_string()
        };
        let plan = |path: &[u32]| GridPlan::from_paths([path]);
        let diagonal = write(&plan(&[0, 5]), &[5]);
        assert!(
            diagonal.starts_with("plan: agent 0 goes from (0, 0) to (1, 1)"),
            "{diagonal}"
        );
        for path in [&[0, OFF_MAP][..], &[OFF_MAP, 0], &[0, 2]] {
            assert!(write(&plan(path), &[0]).starts_with("plan: agent 0 goes from"));
        }
        assert!(write(&plan(&[OFF_MAP]), &[0]).contains("begins outside"));
        assert!(write(&plan(&[0]), &[]).contains("1 paths for 0 goals"));
        assert!(write(&GridPlan::default(), &[]).contains("no agents"));
    }

    /// Legal and other walks on the map, one step at a time.
    fn walks() -> impl Strategy<Value = GridPlan> {
        let walk =
            (0..12_u32, prop::collection::vec(0..5_usize, 0..6)).prop_map(|(start, moves)| {
                let mut path = vec![start];
                for turn in moves {
                    let (row, col) = row_col(path[path.len() - 1], SIZE);
                    let (rows, cols) = [(0, 0), (1, 0), (-1, 0), (0, 1), (0, -1)][turn];
                    let (row, col) = ((row + rows).clamp(0, 2), (col + cols).clamp(0, 3));
                    path.push((row * 4 + col) as u32);
                }
                path
            });
        prop::collection::vec(walk, 1..5).prop_map(GridPlan::from_paths)
    }

    proptest! {
        #[test]
        fn results_keep_the_plan(plan in walks()) {
            let goals: Vec<u32> = plan.paths().map(|path| path[path.len() - 1]).collect();
            let text = write_planviz(&plan, &goals, SIZE).expect("a result");
            let again = read_planviz("r.json", &text, SIZE).expect("a plan");
            prop_assert_eq!(again.trimmed(), plan.trimmed());
        }

        #[test]
        fn any_path_is_read_or_refused(path in "([\\[(]{2}0,0,0,0,0\\):\\()?([FRCW0-9 ,:()\\[\\]]|\\PC){0,40}") {
            let path = serde_json::Value::from(path).to_string();
            let _ = read(&result("MAPF_T", "[0, 0, \"E\"]", &path, ""));
        }
    }
}
