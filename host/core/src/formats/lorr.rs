//! Instances of the League of Robot Runners: a JSON file that names a map, a file of
//! starts and a file of tasks, as `Input_Output_Format.md` of the Start-Kit describes
//! them, <https://github.com/MAPF-Competition/Start-Kit>, versions 2023 to 3.1 (2026).
//!
//! A cell is `row · columns + column`. The map is a MovingAI file. `.agents` is a
//! number and then so many start cells, a line each; `.tasks` is a number and then
//! so many tasks, a line each, of comma-separated cells, the errands of the task in
//! order. Lines that begin with `#` are comments.
//!
//! Those instances are lifelong: tasks come as agents get free, and a task has
//! several errands. A [`League`] holds an instance as it is. What an [`AgentList`]
//! holds of it is one goal per agent: tasks are dealt in the order of the file, one to
//! each agent, and the goal is the first errand of the agent's task that is not
//! somebody's goal already, since goals of a one-shot instance are distinct; a task
//! without such an errand is passed over. How the League turns its robots is not kept,
//! and of its delays only that there are some.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::pibt2::whole_number;
use super::{AgentEntry, AgentList};
use crate::files::{Lines, column, load_file, quote, read_file};
use crate::json::json_error;
use crate::path_list::PLAN_MAX_AGENTS;
use crate::{Grid, InputError, load_map, write_map};

/// Largest JSON file, and largest list, that is read, in bytes.
const PROBLEM_LIMIT: u64 = 1 << 20;
const LIST_LIMIT: u64 = 1 << 28;

/// Most errands of all tasks.
const MOST_ERRANDS: usize = 1 << 25;

/// The content of the JSON file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
struct Problem {
    map_file: PathBuf,
    agent_file: PathBuf,
    task_file: PathBuf,
    team_size: u32,
    // How the simulation goes on, which a one-shot instance does not hold.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    num_tasks_reveal: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    version: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    agent_size: Option<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    agent_counter: Option<u32>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    task_assignment_strategy: Option<String>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    delay_config: Option<serde_json::Map<String, Value>>,
}

/// A League instance, read as a one-shot one.
#[derive(Debug, Clone)]
pub struct LorrInstance {
    /// The map.
    pub grid: Grid,
    /// Start and goal of every agent; lines are those of the file of starts.
    pub agents: AgentList,
    /// The files that were read besides the JSON file.
    pub files: Vec<PathBuf>,
    /// Tasks in the file of tasks.
    pub tasks: usize,
    /// Errands of all of them.
    pub errands: usize,
    /// Tasks that were passed over because their errands were goals already.
    pub passed_over: usize,
}

/// A file of tasks.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TaskList {
    /// Name of the file in errors.
    pub source: String,
    /// The errands of every task in order: free cells, at least one.
    pub tasks: Vec<Vec<u32>>,
    /// The line of every task, counted from 1.
    pub lines: Vec<u64>,
}

/// Reads a file of tasks on a map. It has at least one task.
pub fn load_lorr_tasks(path: impl AsRef<Path>, grid: &Grid) -> Result<TaskList, InputError> {
    load_file(path, LIST_LIMIT, |source, bytes| {
        read_lorr_tasks(source, bytes, grid)
    })
}

/// A League instance as it is: robots that get tasks as long as they drive.
#[derive(Debug, Clone)]
pub struct League {
    /// The map.
    pub grid: Grid,
    /// Start cells of the first `teamSize` robots of the file: free, no two the same.
    pub starts: Vec<u32>,
    /// The tasks, which begin anew after the last one.
    pub tasks: TaskList,
    /// Number of tasks that are known and not done at a time, per robot
    /// (`numTasksReveal`; 1 where the file has none).
    pub reveal: f64,
    /// Ticks of a move or a turn (`agentCounter`; 1 where the file has none).
    pub ticks: u32,
    /// True if robots are delayed (`delayConfig` with a `pDelay` above 0).
    pub delays: bool,
    /// The name of the map as the instance has it.
    pub map_file: String,
    /// The files that were read besides the JSON file.
    pub files: Vec<PathBuf>,
    /// The file of starts, and the line of each of them.
    starts_source: String,
    start_lines: Vec<u64>,
}

/// Reads a League instance, and the files that it names, which are found from its own
/// folder.
pub fn load_league(path: impl AsRef<Path>) -> Result<League, InputError> {
    let path = path.as_ref();
    let bytes = read_file(path, PROBLEM_LIMIT)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    read_league(&path.display().to_string(), &bytes, folder)
}

fn read_league(source: &str, bytes: &[u8], folder: &Path) -> Result<League, InputError> {
    let problem = read_problem(source, bytes)?;
    let named = |file: &Path| folder.join(file);
    // Of a file as a whole only its name can be wrong here.
    let said = |key: &'static str| {
        move |error: InputError| match (error.line, &error.hint) {
            (None, None) => error.hint(format!(
                "`{key}` of {source} names it; names are found from the folder of that file"
            )),
            _ => error,
        }
    };
    let map_path = named(&problem.map_file);
    let grid = load_map(&map_path).map_err(said("mapFile"))?;
    let starts_path = named(&problem.agent_file);
    let starts_source = starts_path.display().to_string();
    let starts = read_file(&starts_path, LIST_LIMIT).map_err(said("agentFile"))?;
    let starts = read_agents(&starts_source, &starts, &grid)?;
    let team = problem.team_size as usize;
    if team == 0 || team > starts.len() {
        let reason = format!(
            "teamSize is {team}, but {starts_source} has {} starts",
            starts.len()
        );
        return Err(InputError::new(source, reason)
            .hint(format!("write a teamSize of 1 to {}", starts.len())));
    }
    let mut lines = std::collections::HashMap::new();
    for (line, start) in &starts[..team] {
        if let Some(first) = lines.insert(*start, *line) {
            let reason = format!("cell {start} is the start of line {first} already");
            return Err(InputError::new(starts_source, reason)
                .at_line(*line)
                .hint("no two robots are in one cell"));
        }
    }
    let tasks_path = named(&problem.task_file);
    let tasks = load_lorr_tasks(&tasks_path, &grid).map_err(said("taskFile"))?;
    let (start_lines, starts) = starts.into_iter().take(team).unzip();
    let p_delay = problem.delay_config.as_ref().and_then(|delays| {
        let chance = delays.get("pDelay")?;
        chance.as_f64()
    });
    Ok(League {
        starts,
        tasks,
        reveal: problem.num_tasks_reveal.unwrap_or(1.0),
        ticks: problem.agent_counter.unwrap_or(1),
        delays: p_delay.is_some_and(|chance| chance > 0.0),
        map_file: problem.map_file.display().to_string(),
        files: vec![map_path, starts_path, tasks_path],
        starts_source,
        start_lines,
        grid,
    })
}

/// Reads a League instance and the files that it names, which are found from its
/// own folder, as a one-shot one.
pub fn load_lorr(path: impl AsRef<Path>) -> Result<LorrInstance, InputError> {
    load_league(path)?.one_shot()
}

/// Parses the content of the JSON file, named `source` in errors, and reads the files
/// that it names from a folder.
pub(super) fn read_lorr(
    source: &str,
    bytes: &[u8],
    folder: &Path,
) -> Result<LorrInstance, InputError> {
    read_league(source, bytes, folder)?.one_shot()
}

impl League {
    /// One goal per agent, from the tasks in their order.
    fn one_shot(self) -> Result<LorrInstance, InputError> {
        let team = self.starts.len();
        let tasks = &self.tasks.tasks;
        let (goals, passed_over) = deal(tasks, team);
        if goals.len() < team {
            let reason = format!(
                "the {} tasks give only {} distinct goals, for a teamSize of {team}",
                tasks.len(),
                goals.len()
            );
            return Err(InputError::new(&self.tasks.source, reason)
                .hint("every agent needs a goal of its own; write a smaller teamSize"));
        }
        let starts = self.starts.iter().zip(&self.start_lines);
        let agents = starts.zip(goals).map(|((start, line), goal)| {
            AgentEntry::new(*line, self.grid.row_col(*start), self.grid.row_col(goal))
        });
        Ok(LorrInstance {
            agents: AgentList {
                agents: agents.collect(),
                source: self.starts_source,
                map_file: Some(self.map_file),
            },
            files: self.files,
            errands: tasks.iter().map(Vec::len).sum(),
            tasks: tasks.len(),
            passed_over,
            grid: self.grid,
        })
    }
}

fn read_problem(source: &str, bytes: &[u8]) -> Result<Problem, InputError> {
    if bytes.trim_ascii_start().first() != Some(&b'{') {
        return Err(InputError::new(source, "this is not a JSON object")
            .at_line(1)
            .hint("an instance is an object with mapFile, agentFile, taskFile and teamSize"));
    }
    serde_json::from_slice(bytes).map_err(|error| {
        json_error(source, bytes, &error)
            .hint("an instance is an object with mapFile, agentFile, taskFile and teamSize")
    })
}

/// A goal for each agent from a task of its own, in the order of the tasks and all
/// distinct, and how many tasks were passed over.
fn deal(tasks: &[Vec<u32>], team: usize) -> (Vec<u32>, usize) {
    let mut goals = Vec::with_capacity(team);
    let mut taken = std::collections::HashSet::new();
    let mut passed_over = 0;
    for task in tasks {
        if goals.len() == team {
            break;
        }
        match task.iter().find(|errand| taken.insert(**errand)) {
            Some(goal) => goals.push(*goal),
            None => passed_over += 1,
        }
    }
    (goals, passed_over)
}

/// Start cells with their lines.
fn read_agents(source: &str, bytes: &[u8], grid: &Grid) -> Result<Vec<(u64, u32)>, InputError> {
    let mut starts = Vec::new();
    list(source, bytes, "agents", |number, line| {
        starts.push((number, cell(source, number, line, 0, line, grid)?));
        Ok(())
    })?;
    Ok(starts)
}

/// Parses a file of tasks, named `source` in errors.
pub fn read_lorr_tasks(source: &str, bytes: &[u8], grid: &Grid) -> Result<TaskList, InputError> {
    let (mut tasks, mut lines) = (Vec::new(), Vec::new());
    let mut errands = 0;
    list(source, bytes, "tasks", |number, line| {
        let mut task = Vec::new();
        let mut at = 0;
        // One comma too many at the end is usual.
        for word in line
            .strip_suffix(b",")
            .unwrap_or(line)
            .split(|byte| *byte == b',')
        {
            task.push(cell(source, number, line, at, word, grid)?);
            at += word.len() + 1;
        }
        errands += task.len();
        if errands > MOST_ERRANDS {
            let reason = format!("more than {MOST_ERRANDS} errands");
            return Err(InputError::new(source, reason).at_line(number));
        }
        tasks.push(task);
        lines.push(number);
        Ok(())
    })?;
    Ok(TaskList {
        source: source.to_owned(),
        tasks,
        lines,
    })
}

/// Calls `each` with the lines after the one that says how many there are.
fn list(
    source: &str,
    bytes: &[u8],
    what: &str,
    mut each: impl FnMut(u64, &[u8]) -> Result<(), InputError>,
) -> Result<(), InputError> {
    let mut lines = Lines::new(bytes);
    let mut wanted = None;
    let mut found = 0;
    let mut last = 0;
    while !lines.only_blank_left() {
        let Some((number, line)) = lines.next() else {
            break;
        };
        last = number;
        if line.first() == Some(&b'#') {
            continue;
        }
        let line = line.trim_ascii_end();
        let Some(wanted) = wanted else {
            let count = std::str::from_utf8(line).ok().and_then(whole_number);
            let most = |count: &usize| (1..=PLAN_MAX_AGENTS).contains(count);
            wanted = count.map(|count| count as usize).filter(most);
            if wanted.is_none() {
                let reason = format!("expected the number of {what}, found {}", quote(line));
                return Err(InputError::new(source, reason)
                    .at(number, 1)
                    .hint("the first line that is no comment says how many lines follow"));
            }
            continue;
        };
        if found == wanted {
            let reason = format!("a line more than the {wanted} {what} of the first line");
            return Err(InputError::new(source, reason).at(number, 1));
        }
        each(number, line)?;
        found += 1;
    }
    match wanted {
        Some(wanted) if wanted == found => Ok(()),
        Some(wanted) => {
            let reason = format!("{wanted} {what} by the first line, but {found} lines");
            Err(InputError::new(source, reason)
                .at_line(last)
                .hint("the file is truncated, or its first line is wrong"))
        }
        None => Err(InputError::new(source, format!("there are no {what}"))),
    }
}

fn cell(
    source: &str,
    number: u64,
    line: &[u8],
    at: usize,
    word: &[u8],
    grid: &Grid,
) -> Result<u32, InputError> {
    let fault = |reason: String| InputError::new(source, reason).at(number, column(line, at));
    let cell = std::str::from_utf8(word).ok().and_then(whole_number);
    let Some(cell) = cell else {
        let reason = format!("expected a cell, found {}", quote(word));
        return Err(fault(reason).hint("a cell is a whole number, row · columns + column"));
    };
    if cell >= grid.cell_count() {
        let reason = format!("cell {cell} is not on a map of {} cells", grid.cell_count());
        return Err(fault(reason));
    }
    if !grid.is_passable(cell) {
        let (row, col) = grid.row_col(cell);
        let reason = format!("cell {cell} (row {row}, column {col}) is an obstacle");
        return Err(fault(reason));
    }
    Ok(cell)
}

/// The files of an instance, each with its name: `NAME.json`, `NAME.map`,
/// `NAME.agents` and `NAME.tasks`, for one folder.
///
/// Every agent gets one task of one errand, its goal, and nobody is delayed. In the
/// League tasks are free to take, so that another agent may be the one that serves
/// a goal.
pub fn write_lorr(
    name: &str,
    grid: &Grid,
    starts: &[u32],
    goals: &[u32],
) -> [(String, Vec<u8>); 4] {
    let file = |extension: &str| format!("{name}.{extension}");
    let delays = serde_json::json!({
        "seed": 0,
        "minDelay": 1,
        "maxDelay": 1,
        "eventModel": "bernoulli",
        "pDelay": 0.0,
        "durationModel": "uniform",
        "gaussMeanRatio": 0.5,
        "gaussStdRatio": 0.22,
    });
    let problem = Problem {
        map_file: file("map").into(),
        agent_file: file("agents").into(),
        task_file: file("tasks").into(),
        team_size: starts.len() as u32,
        num_tasks_reveal: Some(1.0),
        version: Some("2026 LoRR".into()),
        agent_size: Some(1.0),
        agent_counter: Some(1),
        task_assignment_strategy: None,
        delay_config: delays.as_object().cloned(),
    };
    let lines = |cells: &[u32]| {
        let mut text = format!("{}\n", cells.len());
        for cell in cells {
            text.push_str(&cell.to_string());
            text.push('\n');
        }
        text.into_bytes()
    };
    // Names of files are the only text in it, so that it cannot fail.
    let mut json = serde_json::to_string_pretty(&problem).unwrap_or_default();
    json.push('\n');
    [
        (file("json"), json.into_bytes()),
        (file("map"), league_map(grid)),
        (file("agents"), lines(starts)),
        (file("tasks"), lines(goals)),
    ]
}

/// The map in the letters that the League knows: `.`, `E` and `S` are free, `@` and
/// `T` are not, and whatever else there is would be free as well.
fn league_map(grid: &Grid) -> Vec<u8> {
    let mut text = write_map(grid);
    let head = text.len() - grid.rows() as usize * (grid.cols() as usize + 1);
    for letter in &mut text[head..] {
        *letter = match *letter {
            known @ (b'.' | b'E' | b'S' | b'@' | b'T' | b'\n') => known,
            other if Grid::letter_is_passable(other) => b'.',
            _ => b'@',
        };
    }
    text
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::sync::Arc;

    use proptest::prelude::*;

    use super::*;
    use crate::Connectivity;

    fn grid() -> Grid {
        Grid::new("a", 3, 4, b"..ST@.wO....".to_vec()).expect("a grid")
    }

    #[test]
    fn tasks_are_dealt_one_to_each_agent() {
        let tasks = [vec![5, 1], vec![5], vec![2, 0], vec![8]];
        assert_eq!(deal(&tasks, 2), (vec![5, 2], 1));
        assert_eq!(deal(&tasks, 3), (vec![5, 2, 8], 1));
        assert_eq!(deal(&tasks, 4), (vec![5, 2, 8], 1));
        let tasks = [vec![5, 1], vec![5, 1, 3], vec![5, 1]];
        assert_eq!(deal(&tasks, 3), (vec![5, 1], 1));
    }

    #[test]
    fn lists_are_read() {
        let starts = read_agents("a.agents", b"# 2026\n2\r\n0\n# two\n11\n\n", &grid());
        assert_eq!(starts, Ok(vec![(3, 0), (5, 11)]));
        let tasks = read_lorr_tasks("a.tasks", b"2\n0,1,2\n# far\n10,\n", &grid());
        let expected = TaskList {
            source: "a.tasks".into(),
            tasks: vec![vec![0, 1, 2], vec![10]],
            lines: vec![2, 4],
        };
        assert_eq!(tasks, Ok(expected));
    }

    #[test]
    fn malformed_lists_are_told_by_line_and_column() {
        for (text, expected) in [
            ("", "t: there are no tasks"),
            ("# only\n", "t: there are no tasks"),
            ("x\n", "t:1:1: expected the number of tasks, found 'x'"),
            ("0\n", "t:1:1: expected the number of tasks, found '0'"),
            ("-1\n", "t:1:1: expected the number of tasks, found '-1'"),
            (
                "99999999\n",
                "t:1:1: expected the number of tasks, found '99999999'",
            ),
            ("2\n0\n", "t:2: 2 tasks by the first line, but 1 lines"),
            ("1\n0\n1\n", "t:3:1: a line more than the 1 tasks"),
            ("1\n0,12\n", "t:2:3: cell 12 is not on a map of 12 cells"),
            ("1\n0,4\n", "t:2:3: cell 4 (row 1, column 0) is an obstacle"),
            ("1\n0,,1\n", "t:2:3: expected a cell, found ''"),
            ("1\n0, 1\n", "t:2:3: expected a cell, found ' 1'"),
            ("2\n0\n\n1\n", "t:3:1: expected a cell, found ''"),
            ("1\n0;1\n", "t:2:1: expected a cell, found '0;1'"),
        ] {
            let error = read_lorr_tasks("t", text.as_bytes(), &grid()).expect_err(text);
            assert!(error.to_string().starts_with(expected), "{text}: {error}");
        }
    }

    #[test]
    fn malformed_problems_are_told_by_line_and_column() {
        for (text, expected) in [
            ("", "p.json:1: this is not a JSON object"),
            ("[]", "p.json:1: this is not a JSON object"),
            ("{}", "p.json:1:2: missing field `mapFile`"),
            ("{\n\"colour\": 1}", "p.json:2:8: unknown field `colour`"),
            (
                "{\"teamSize\": -1}",
                "p.json:1:15: invalid value: integer `-1`",
            ),
            ("{\"mapFile\": \"a\"", "p.json:1:15: EOF while parsing"),
        ] {
            let error = read_problem("p.json", text.as_bytes()).expect_err(text);
            assert!(error.to_string().starts_with(expected), "{text}: {error}");
        }
    }

    #[test]
    fn an_instance_goes_out_and_comes_back() {
        let folder = tempfile::tempdir().expect("a folder");
        for (name, bytes) in write_lorr("a", &grid(), &[0, 6], &[11, 1]) {
            fs::write(folder.path().join(name), bytes).expect("written");
        }
        let path = folder.path().join("a.json");
        let read = load_lorr(&path).expect("an instance");
        // A workstation is plain ground to the League, and water is an obstacle.
        assert_eq!(read.grid.terrain(), b"..ST@..@....");
        assert_eq!((read.tasks, read.errands, read.passed_over), (2, 2, 0));
        let instance = read
            .agents
            .instance(Arc::new(read.grid), None, Connectivity::Four)
            .expect("an instance");
        assert_eq!(
            (instance.starts(), instance.goals()),
            (&[0, 6][..], &[11, 1][..])
        );

        let change = |file: &str, from: &str, to: &str, expected: &str| {
            let path = folder.path().join(file);
            let old = fs::read_to_string(&path).expect("read");
            assert!(old.contains(from), "{old}");
            fs::write(&path, old.replace(from, to)).expect("written");
            let error = load_lorr(folder.path().join("a.json"))
                .expect_err(to)
                .to_string();
            assert!(error.contains(expected), "{error}");
            fs::write(&path, old).expect("written");
        };
        change(
            "a.json",
            "\"teamSize\": 2",
            "\"teamSize\": 3",
            "teamSize is 3, but ",
        );
        change("a.json", "a.agents", "b.agents", "b.agents: no such file");
        change(
            "a.tasks",
            "11\n1\n",
            "1\n1\n",
            "the 2 tasks give only 1 distinct goals",
        );
        change(
            "a.agents",
            "6",
            "4",
            "a.agents:3:1: cell 4 (row 1, column 0) is an obstacle",
        );
    }

    #[test]
    fn an_instance_is_read_as_it_is() {
        let folder = tempfile::tempdir().expect("a folder");
        let write = |name: &str, text: &str| {
            fs::write(folder.path().join(name), text).expect("written");
        };
        write(
            "a.map",
            "type octile\nheight 3\nwidth 4\nmap\n....\n....\n....\n",
        );
        write("a.agents", "3\n0\n5\n0\n");
        write("a.tasks", "2\n1,2,1\n11\n");
        let read = |more: &str| {
            let files = r#""mapFile": "a.map", "agentFile": "a.agents", "taskFile": "a.tasks""#;
            write("a.json", &format!("{{{files}, {more}}}"));
            load_league(folder.path().join("a.json"))
        };
        let plain = read(r#""teamSize": 2"#).expect("an instance");
        assert_eq!((&plain.starts, plain.reveal), (&vec![0, 5], 1.0));
        assert_eq!(plain.tasks.tasks, [vec![1, 2, 1], vec![11]]);
        assert_eq!((plain.ticks, plain.delays), (1, false));
        assert_eq!(plain.files.len(), 3);
        let late = read(
            r#""teamSize": 1, "numTasksReveal": 1.5, "agentCounter": 3, "delayConfig": {"pDelay": 0.01}"#,
        );
        let late = late.expect("an instance");
        assert_eq!((late.starts, late.reveal), (vec![0], 1.5));
        assert_eq!((late.ticks, late.delays), (3, true));
        // The third robot stands where the first one does.
        let error = read(r#""teamSize": 3"#).expect_err("two in a cell");
        assert!(
            error
                .to_string()
                .ends_with("a.agents:4: cell 0 is the start of line 2 already"),
            "{error}"
        );
        assert!(error.hint.is_some());
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "([0-9,#\n{}\":a-z]|\\PC){0,60}") {
            let _ = read_agents("a", text.as_bytes(), &grid());
            let _ = read_lorr_tasks("t", text.as_bytes(), &grid());
            let _ = read_problem("p", text.as_bytes());
        }
    }
}
