//! Scenario files, and the instances that they make.

use std::collections::BTreeSet;
use std::sync::Arc;

use fleetyard_core::{
    Connectivity, Grid, GridInstance, GridSearch, Scenario, ScenarioEntry, read_map, read_scen,
    write_scen,
};

use super::check_error;

const SOURCE: &str = "a.scen";

/// Two rooms of three rows and two columns with a wall between them.
const ROOMS: &[u8] = b"type octile\nheight 3\nwidth 5\nmap\n..@..\n..T..\n.GW.S\n";

/// Most rows and columns of a map that is made to fit.
const LARGEST: u32 = 64;

/// Reads a `.scen` file; makes instances on two maps: that of two rooms, named `rooms`,
/// and an empty one as the first entry names it.
pub fn run(data: &[u8]) {
    let scenario = match read_scen(SOURCE, data) {
        Ok(scenario) => scenario,
        Err(error) => {
            check_error(&error, SOURCE, data);
            // Every fault but absence has a place.
            let absent = ["the file is empty", "the scenario has no entries"];
            assert!(
                error.line.is_some() || absent.contains(&error.reason.as_str()),
                "{error:?}"
            );
            return;
        }
    };
    // Nine fields and eight separators for each.
    assert!(scenario.entries.len() * 17 <= data.len() + 1);
    round_trip(&scenario);
    let rooms = read_map("rooms.map", ROOMS).expect("a map");
    make_instances(&scenario, rooms, data);
    let first = &scenario.entries[0];
    if (1..=LARGEST).contains(&first.map_rows) && (1..=LARGEST).contains(&first.map_cols) {
        let cells = vec![b'.'; (first.map_rows * first.map_cols) as usize];
        // The name that a map's file gives to it.
        let name = read_map(&first.map, ROOMS).expect("a map");
        let empty = Grid::new(name.name(), first.map_rows, first.map_cols, cells);
        make_instances(&scenario, empty.expect("a map"), data);
    }
}

/// Writing and reading keeps everything but lines and digits after the eighth.
fn round_trip(scenario: &Scenario) {
    let written = write_scen(scenario);
    let again = read_scen(SOURCE, &written).expect("what was written can be read");
    assert_eq!(again.entries.len(), scenario.entries.len());
    for (at, (entry, read)) in scenario.entries.iter().zip(&again.entries).enumerate() {
        assert!(entry.optimal_length.is_finite() && entry.optimal_length >= 0.0);
        let rounded = format!("{:.8}", entry.optimal_length).parse();
        let expected = ScenarioEntry {
            line: at as u64 + 2,
            optimal_length: rounded.expect("a number"),
            ..entry.clone()
        };
        assert_eq!(*read, expected);
    }
    assert_eq!(write_scen(&again), written);
}

fn make_instances(scenario: &Scenario, grid: Grid, data: &[u8]) {
    let grid = Arc::new(grid);
    let most = scenario.entries.len();
    let mut good = true;
    for agents in BTreeSet::from([0, 1, 2, most / 2, most, most + 1]) {
        let make = |connectivity| scenario.instance(Arc::clone(&grid), agents, connectivity);
        let (four, eight) = (make(Connectivity::Four), make(Connectivity::Eight));
        // Which moves are allowed does not decide what can be reached.
        assert_eq!(four.as_ref().err(), eight.as_ref().err());
        match four {
            Ok(instance) => {
                assert!((1..=most).contains(&agents));
                // Fewer agents of a good instance are a good instance.
                assert!(good, "{agents} agents are fine, but fewer were not");
                check_instance(scenario, &instance);
            }
            Err(error) => {
                check_error(&error, SOURCE, data);
                // Entries at fault have a line; the number of agents has none.
                assert!(
                    error.line.is_some() || agents == 0 || agents > most,
                    "{error:?}"
                );
                good &= agents == 0;
            }
        }
    }
}

fn check_instance(scenario: &Scenario, instance: &GridInstance) {
    let grid = instance.grid();
    let agents = instance.agents();
    assert_eq!(instance.goals().len(), agents);
    let at = |(row, col): (u32, u32)| grid.cell(row, col).expect("a cell");
    for (agent, entry) in scenario.entries[..agents].iter().enumerate() {
        assert_eq!(instance.starts()[agent], at(entry.start));
        assert_eq!(instance.goals()[agent], at(entry.goal));
    }
    let mut search = GridSearch::new(grid);
    for (start, goal) in instance.starts().iter().zip(instance.goals()) {
        assert!(grid.is_passable(*start) && grid.is_passable(*goal));
        assert!(search.steps(*start, *goal, Connectivity::Four).is_some());
    }
    for cells in [instance.starts(), instance.goals()] {
        assert_eq!(cells.iter().collect::<BTreeSet<_>>().len(), agents);
    }
    let (starts, goals) = (instance.starts().to_vec(), instance.goals().to_vec());
    let again = GridInstance::new(Arc::clone(grid), instance.connectivity(), starts, goals);
    assert_eq!(again.expect("the same").digest(), instance.digest());
}
