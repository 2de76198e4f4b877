//! Task files: world or map, robots, starts and goals.

use fleetyard_views::{Fleets, read_task, write_task};

use super::check_error;

const SOURCE: &str = "a.task.json";

/// Reads a task file.
pub fn run(data: &[u8]) {
    let task = match read_task(SOURCE, data) {
        Ok(task) => task,
        Err(error) => return check_error(&error, SOURCE, data),
    };
    assert!(!task.agents.is_empty());
    for agent in &task.agents {
        let [start, goal] = [agent.start, agent.goal].map(fleetyard_views::State::at_m);
        assert!(start.iter().chain(&goal).all(|number| number.is_finite()));
        if let Fleets::Kinds(kinds) = &task.fleet {
            assert!((agent.robot as usize) < kinds.len());
        }
    }
    assert!(task.goal_tolerance_m > 0.0 && task.goal_tolerance_rad > 0.0);
    assert!(task.goal_tolerance_rate > 0.0 && task.dynamics_tolerance > 0.0);
    // Written once, a task does not change any more.
    let written = write_task(&task);
    let again = read_task(SOURCE, &written).expect("what was written can be read");
    assert_eq!(again, task);
    assert_eq!(write_task(&again), written);
}
