//! Instances of the League of Robot Runners: four files, and tasks on their own.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use fleetyard_core::formats::{
    AgentList, LorrInstance, TaskList, load_lorr, load_lorr_tasks, read_lorr_tasks, write_lorr,
};
use fleetyard_core::{Grid, InputError, read_map};
use fleetyard_fleet::assign::{Assigner, Source};
use tempfile::TempDir;

use super::check_error;

/// Between the files: the JSON file, the map, the starts, the tasks.
const NEXT: &str = "\n=====\n";

/// Names of the last three, by which the first one names them.
const NAMES: [(&str, &str); 3] = [
    ("mapFile", "a.map"),
    ("agentFile", "a.agents"),
    ("taskFile", "a.tasks"),
];

const MAP: &[u8] = b"type octile\nheight 3\nwidth 4\nmap\n..S@\n.T..\n@E..\n";

const TASKS: &str = "a.tasks";

/// Reads tasks, or an instance of four files.
pub fn run(data: &[u8]) {
    let Ok(text) = std::str::from_utf8(data) else {
        return tasks(data);
    };
    let parts: Vec<&str> = text.split(NEXT).collect();
    let [problem, map, agents, list] = parts[..] else {
        return tasks(data);
    };
    // A file elsewhere is not ours to read.
    let named = serde_json::from_str::<serde_json::Value>(problem).ok();
    let named = |(key, name): (&str, &str)| named.as_ref().is_some_and(|file| file[key] == name);
    if !NAMES.into_iter().all(named) {
        return;
    }
    let folder = TempDir::new().expect("a folder");
    let files = [
        ("a.json", problem),
        (NAMES[0].1, map),
        (NAMES[1].1, agents),
        (NAMES[2].1, list),
    ];
    for (name, content) in files {
        fs::write(folder.path().join(name), content).expect("a file");
    }
    match load_lorr(folder.path().join("a.json")) {
        Ok(instance) => whole(&instance, folder.path()),
        Err(error) => {
            let (name, content) = of_this(&error, folder.path(), &files);
            check_error(&error, &name, content.as_bytes());
        }
    }
}

/// The file that an error is about.
fn of_this<'a>(error: &InputError, folder: &Path, files: &[(&str, &'a str)]) -> (String, &'a str) {
    let path = |name: &str| folder.join(name).display().to_string();
    let found = files.iter().find(|(name, _)| error.source == path(name));
    let (name, content) = found.unwrap_or_else(|| panic!("about no file: {error:?}"));
    (path(name), *content)
}

/// An instance keeps what it promises, and is the same when it is written and read again.
fn whole(instance: &LorrInstance, folder: &Path) {
    let LorrInstance { grid, agents, .. } = instance;
    assert_eq!(instance.files.len(), 3);
    assert!(instance.errands >= instance.tasks && instance.tasks >= agents.agents.len());
    assert!(instance.passed_over <= instance.tasks);
    let cells = |list: &AgentList, grid: &Grid| -> (Vec<u32>, Vec<u32>) {
        let cell = |(row, col)| grid.cell(row, col).expect("a cell of the map");
        let both =
            |agent: &fleetyard_core::formats::AgentEntry| (cell(agent.start), cell(agent.goal));
        list.agents.iter().map(both).unzip()
    };
    let (starts, goals) = cells(agents, grid);
    assert!(!starts.is_empty());
    let free = |cell: &u32| grid.is_passable(*cell);
    assert!(starts.iter().all(free) && goals.iter().all(free));
    assert_eq!(goals.iter().collect::<BTreeSet<_>>().len(), goals.len());
    for (name, content) in write_lorr("again", grid, &starts, &goals) {
        fs::write(folder.join(name), content).expect("a file");
    }
    let again = load_lorr(folder.join("again.json")).expect("what was written can be read");
    assert_eq!(
        (again.grid.rows(), again.grid.cols()),
        (grid.rows(), grid.cols())
    );
    let passable = |grid: &Grid| -> Vec<bool> {
        (0..grid.cell_count())
            .map(|cell| grid.is_passable(cell))
            .collect()
    };
    assert_eq!(passable(&again.grid), passable(grid));
    assert_eq!(cells(&again.agents, &again.grid), (starts, goals));
    assert_eq!(again.passed_over, 0);
    let list = load_lorr_tasks(folder.join(TASKS), grid).expect("what was read before");
    deal(grid, &list);
}

/// Tasks on a small map.
fn tasks(data: &[u8]) {
    let grid = read_map("a.map", MAP).expect("a map");
    match read_lorr_tasks(TASKS, data, &grid) {
        Ok(list) => deal(&grid, &list),
        Err(error) => check_error(&error, TASKS, data),
    }
}

/// Robots get tasks and do them, in any order.
fn deal(grid: &Grid, list: &TaskList) {
    assert!(!list.tasks.is_empty() && list.tasks.len() == list.lines.len());
    assert!(list.lines.is_sorted_by(|one, next| one < next));
    let free = |cell: &u32| grid.is_passable(*cell);
    assert!(
        list.tasks
            .iter()
            .all(|task| !task.is_empty() && task.iter().all(free))
    );
    for (agents, reveal) in [(1, 1.0), (2, 1.5), (3, 100.0)] {
        let source = Source::Tasks {
            list: list.clone(),
            reveal,
        };
        let grid = Arc::new(grid.clone());
        let Ok(mut assigner) = Assigner::new(&grid, source, agents, 1) else {
            continue;
        };
        let mut cells = assigner.starts();
        let mut next = vec![0; agents];
        for round in 0..8 {
            if let Some(open) = assigner.open_tasks().first() {
                let given = assigner.give(round % agents as u32, open.id);
                assert_eq!(given, Ok(()));
                assert!(assigner.give(round % agents as u32, open.id).is_err());
            }
            let goals = assigner.upcoming(&cells, &next, round);
            assert_eq!(goals.len(), agents);
            for agent in 0..agents {
                let goal = goals[agent][0];
                assert!(grid.is_passable(goal));
                if assigner.goal(agent, next[agent]) == goal {
                    assigner.reached(agent, next[agent]);
                    next[agent] += 1;
                    cells[agent] = goal;
                }
            }
        }
        assert!(assigner.tasks_done().is_some());
    }
}
