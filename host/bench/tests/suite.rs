//! Suite files: what they mean, and what is said about those that mean nothing.

use std::path::Path;

use fleetyard_bench::suite::{Question, Suite};
use fleetyard_core::document::Setting;
use fleetyard_core::{Connectivity, InputError};

/// Reads a suite whose paths are relative to the folder of the repository's own maps.
fn read(text: &str) -> Result<Suite, InputError> {
    read_with(text, &[])
}

fn read_with(text: &str, settings: &[&str]) -> Result<Suite, InputError> {
    let settings: Result<Vec<Setting>, InputError> = settings
        .iter()
        .map(|setting| Setting::new("--set", setting))
        .collect();
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../maps");
    let variable = |name: &str| (name == "PLACE").then(|| ".".to_owned());
    Suite::read("s.toml", text, &settings?, &folder, &variable)
}

/// A suite with these instances.
fn with(instances: &str) -> String {
    format!("name = \"test\"\nplanner = [{{ plugin = \"lacam\" }}]\n[[instances]]\n{instances}\n")
}

fn questions(text: &str) -> Result<Vec<Question>, InputError> {
    read(text)?.questions()
}

fn told(questions: &[Question]) -> Vec<String> {
    questions.iter().map(ToString::to_string).collect()
}

#[test]
fn scenarios_by_team_size_and_connectivity() {
    let text = with(
        "scen = \"${PLACE}/random-32-32-20-random-?.scen\"\nagents = [20, 10]\nconnectivity = [4, 8]",
    );
    let questions = questions(&text).unwrap();
    let first = "random-32-32-20, random-32-32-20-random-1.scen";
    assert_eq!(
        told(&questions),
        [
            format!("{first}, 20 agents"),
            format!("{first}, 10 agents"),
            format!("{first}, 20 agents, 8-connected"),
            format!("{first}, 10 agents, 8-connected"),
        ]
    );
    let large = questions[0].instance().unwrap();
    let small = questions[3].instance().unwrap();
    assert_eq!(small.connectivity(), Connectivity::Eight);
    assert_eq!(small.starts(), &large.starts()[..10]);
    assert!(std::sync::Arc::ptr_eq(small.grid(), large.grid()));
    assert_eq!(questions[3].digest().unwrap(), small.digest());
}

#[test]
fn mazes_of_the_paper() {
    let text = with("maze = { width = 15, height = 15, random = \"python\", count = 50 }");
    let questions = questions(&text).unwrap();
    assert_eq!(questions.len(), 50);
    let last = questions[49].origin();
    let maze = last.maze.unwrap();
    assert_eq!((maze.index, maze.seed, maze.width), (49, 56, 15));
    assert_eq!(last.map, "maze-31-31-1-backtracker");
    assert_eq!(last.scenario, "python seed 56");
    let instance = questions[49].instance().unwrap();
    let grid = instance.grid();
    assert_eq!((grid.rows(), grid.cols()), (31, 31));
    assert_eq!(grid.row_col(instance.starts()[0]), (1, 1));
    assert_eq!(grid.row_col(instance.goals()[0]), (15, 15));
}
