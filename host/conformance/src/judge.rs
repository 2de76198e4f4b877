//! The judge of answers. Collisions and moves are for `fleetyard-check`; here is the part that a
//! one-shot instance does not have: lists of goals, tolerance of delays, and requests as answers.

use std::collections::BTreeSet;

use fleetyard_abi::{Assignment, FleetState, Motion, Request};
use fleetyard_check::{PathRule, Rule, Terms, validate_paths, validate_terms};
use fleetyard_core::{Connectivity, GridPlan};

use crate::question::Question;
use crate::rules::{Arrival, VIOLATIONS, broken};
use crate::scene::Scene;

/// Judges a plan: its sum of costs, or the reason why it is none.
pub(crate) fn plan(
    scene: &Scene,
    plan: &GridPlan,
    arrival: Arrival,
    delay: u32,
) -> Result<u64, String> {
    rules(scene, plan, |rule| rule != Rule::WrongGoal)?;
    // In a window the goals may be too far away.
    if scene.window_steps == 0 {
        for (agent, path) in plan.paths().enumerate() {
            arrives(&scene.goals[agent], path, arrival)
                .map_err(|reason| format!("agent {agent} {reason}"))?;
        }
    }
    tolerates(plan, delay, scene.window_steps)?;
    Ok(plan.sum_of_costs())
}

/// Checks that paths which may collide are at least paths of these agents.
pub(crate) fn paths(scene: &Scene, plan: &GridPlan) -> Result<(), String> {
    rules(scene, plan, |rule| {
        matches!(
            rule,
            Rule::AgentCount
                | Rule::EmptyPath
                | Rule::WrongStart
                | Rule::OutOfBounds
                | Rule::Obstacle
                | Rule::NotAdjacent
                | Rule::CornerCut
                | Rule::MoveNotAllowed
        )
    })
}

fn rules(scene: &Scene, plan: &GridPlan, counts: impl Fn(Rule) -> bool) -> Result<(), String> {
    let instance = scene.home()?;
    let verdict = match scene.motion {
        // The most that a planner of any-angle paths may allow itself is asked of it here.
        Motion::AnyAngle => validate_paths(&instance, plan, PathRule::Bresenham, VIOLATIONS),
        Motion::Pebble | Motion::Rotation | Motion::StopGo | Motion::Slower | Motion::Dynamics => {
            let turning = scene.motion == Motion::Rotation;
            let terms = Terms {
                goals: None,
                headings: scene.headings.as_deref().filter(|_| turning),
                window_steps: scene.window_steps,
                ..(&instance).into()
            };
            validate_terms(&terms, plan, VIOLATIONS)
        }
    };
    let found = verdict.violations.iter().find(|found| counts(found.rule));
    match found {
        Some(found) => Err(broken(&found.sentence, found.rule)),
        None => Ok(()),
    }
}

fn arrives(goals: &[u32], path: &[u32], arrival: Arrival) -> Result<(), String> {
    if arrival == Arrival::Free {
        return Ok(());
    }
    let mut left = path.iter();
    for goal in goals {
        // The next goal may be the cell where the agent is already.
        let mut rest = left.clone();
        if !rest.any(|cell| cell == goal) {
            return Err(format!("does not visit its goal, cell {goal}"));
        }
        while left.as_slice().first().is_some_and(|cell| cell != goal) {
            left.next();
        }
    }
    match (arrival, goals.last(), path.last()) {
        (Arrival::Stay, Some(goal), Some(end)) if goal != end => Err(format!(
            "ends in cell {end} and not at its goal, cell {goal}"
        )),
        _ => Ok(()),
    }
}

/// Checks that no agent is in a cell within `delay` steps after another one (Atzmon et al., "Robust
/// Multi-Agent Path Finding", SoCS 2018).
fn tolerates(plan: &GridPlan, delay: u32, window_steps: u32) -> Result<(), String> {
    let (delay, agents, horizon) = (delay as usize, plan.agents(), plan.horizon());
    if delay == 0 {
        return Ok(());
    }
    for time in 0..=horizon + delay {
        for (first, second) in
            (0..agents).flat_map(|a| (0..agents).filter(move |b| a != *b).map(move |b| (a, b)))
        {
            for later in time..=time + delay {
                if window_steps > 0 && later > window_steps as usize {
                    break;
                }
                if plan.at(first, time) == plan.at(second, later) {
                    return Err(format!(
                        "agent {second} enters cell {} at step {later}, {} steps after agent \
                         {first}: a delay of {delay} makes them collide",
                        plan.at(first, time),
                        later - time
                    ));
                }
            }
        }
    }
    Ok(())
}

/// Judges the answer of an instance generator.
pub(crate) fn request(scene: &Scene, answer: &Request) -> Result<(), String> {
    let asked = scene.state();
    let cells = scene.grid.cell_count();
    answer.check(scene.agents(), cells as usize)?;
    let window = asked.next.window_steps;
    if window > 0 && answer.window_steps > window {
        return Err(format!(
            "the request has a window of {} steps, longer than the {window} that are asked for",
            answer.window_steps
        ));
    }
    assignments(&asked, answer)?;
    let component = scene.grid.components(Connectivity::Four);
    for (agent, goals) in answer.goals.iter().enumerate() {
        let home = component[scene.starts[agent] as usize];
        for goal in goals {
            if !scene.grid.is_passable(*goal) {
                return Err(format!(
                    "the goal of agent {agent}, cell {goal}, is blocked"
                ));
            }
            if component[*goal as usize] != home {
                return Err(format!(
                    "agent {agent} cannot reach its goal, cell {goal}: it is in another part of \
                     the map"
                ));
            }
        }
    }
    Ok(())
}

/// Checks that the tasks that a generator gives away were offered, and that each goes to one agent.
/// [`Request::check`] checks that agents exist.
fn assignments(asked: &FleetState, answer: &Request) -> Result<(), String> {
    let mut given = BTreeSet::new();
    for Assignment { agent, task } in &answer.assignments {
        if !asked.tasks.iter().any(|offered| offered.id == *task) {
            return Err(format!(
                "agent {agent} is given task {task}, which is not among the open ones"
            ));
        }
        if !given.insert(*task) {
            return Err(format!("task {task} is given away twice"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use fleetyard_abi::Goals;

    use super::*;

    fn corridor() -> Scene {
        Scene::drawn("corridor", &["a..b.."], &["..a..b"]).unwrap_or_else(|_| panic!("a scene"))
    }

    #[test]
    fn arrival_is_judged_as_asked() {
        let scene = corridor();
        let stays = GridPlan::from_paths([vec![0, 1, 2], vec![3, 4, 5]]);
        let passes = GridPlan::from_paths([vec![0, 1, 2, 1], vec![3, 4, 5]]);
        let nowhere = GridPlan::from_paths([vec![0], vec![3]]);
        let judged = |paths, arrival| plan(&scene, paths, arrival, 0).is_ok();
        assert_eq!(plan(&scene, &stays, Arrival::Stay, 0), Ok(4));
        assert!(!judged(&passes, Arrival::Stay));
        assert!(judged(&passes, Arrival::Visit));
        assert!(!judged(&nowhere, Arrival::Visit));
        assert!(judged(&nowhere, Arrival::Free));
    }

    #[test]
    fn goals_are_visited_in_order() {
        let visits = |goals: &[u32], path: &[u32]| arrives(goals, path, Arrival::Stay).is_ok();
        assert!(visits(&[2, 0], &[0, 1, 2, 1, 0]));
        assert!(visits(&[0, 0], &[0]));
        assert!(!visits(&[2, 0], &[0]));
        assert!(!visits(&[0, 2, 1, 2], &[0, 1, 2]));
    }

    #[test]
    fn requests_keep_to_what_is_offered() {
        let mut scene = corridor();
        scene.window_steps = 5;
        let asked = scene.state();
        let good = asked.request(Goals::single(vec![0, 3]));
        assert_eq!(request(&scene, &good), Ok(()));
        let given = |tasks: &[u64]| Request {
            assignments: tasks
                .iter()
                .map(|task| Assignment {
                    agent: 0,
                    task: *task,
                })
                .collect(),
            ..good.clone()
        };
        let window = |window_steps| Request {
            window_steps,
            ..good.clone()
        };
        let offered = asked.tasks[0].id;
        for (answer, reason) in [
            (window(6), "longer than the 5"),
            (given(&[7]), "not among the open ones"),
            (given(&[offered, offered]), "given away twice"),
            (asked.request(Goals::single(vec![0])), "1 goal lists"),
        ] {
            let found = request(&scene, &answer).unwrap_err();
            assert!(found.contains(reason), "{found}");
        }
        assert_eq!(request(&scene, &given(&[offered])), Ok(()));
        assert_eq!(request(&scene, &window(0)), Ok(()));
    }

    #[test]
    fn delays_are_tolerated_or_not() {
        let close = GridPlan::from_paths([vec![1, 2, 3], vec![0, 1, 2]]);
        let far = GridPlan::from_paths([vec![1, 2, 3], vec![0, 0, 1]]);
        assert!(tolerates(&close, 0, 0).is_ok());
        assert!(tolerates(&close, 1, 0).is_err());
        assert!(tolerates(&far, 1, 0).is_ok());
        assert!(tolerates(&far, 2, 0).is_err());
        assert!(tolerates(&far, 2, 1).is_ok());
    }

    #[test]
    fn collisions_after_the_window_do_not_matter() {
        let mut scene = corridor();
        let late = GridPlan::from_paths([vec![0, 1, 2, 3], vec![3]]);
        assert!(plan(&scene, &late, Arrival::Free, 0).is_err());
        scene.window_steps = 2;
        assert!(plan(&scene, &late, Arrival::Free, 0).is_ok());
        scene.window_steps = 3;
        assert!(plan(&scene, &late, Arrival::Free, 0).is_err());
    }
}
