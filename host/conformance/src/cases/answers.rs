//! Small instances of which the answer is known, and what other kinds of plugin
//! are asked.

use std::time::Duration;

use fleetyard_abi::{FleetStatus, GridPlan, Kind, Objective, Status};
use fleetyard_runtime::Closing;

use crate::question::Question;
use crate::scene::{Demand, Scene};
use crate::stop::{Step, Stop};
use crate::trial::{Answer, Call, Expectation, Said, Trial, invoke};

/// Drawings of which the best plan is known: name, starts, goals, sum of costs.
pub(crate) type Drawing = (
    &'static str,
    &'static [&'static str],
    &'static [&'static str],
    u64,
);

pub(crate) const ONE_CELL: Drawing = ("one-cell", &["a"], &["a"], 0);
pub(crate) const CORRIDOR: Drawing = ("corridor", &["a......."], &[".......a"], 7);
pub(crate) const WALL: Drawing = (
    "wall",
    &["a@...", ".@.@.", "...@."],
    &[".@...", ".@.@.", "...@a"],
    10,
);
pub(crate) const ARRIVED: Drawing = ("arrived", &["ab.@", "cd.e"], &["ab.@", "cd.e"], 0);
pub(crate) const FOLLOWING: Drawing = ("following", &["abc.."], &["..abc"], 6);
pub(crate) const CYCLE: Drawing = ("cycle", &["ab", "cd"], &["ca", "db"], 4);
pub(crate) const CROSSING: Drawing = (
    "crossing",
    &["..b..", ".....", "a....", ".....", "....."],
    &[".....", ".....", "....a", ".....", "..b.."],
    9,
);
pub(crate) const PASSING_BAY: Drawing =
    ("passing-bay", &["a...b", "@@.@@"], &["b...a", "@@.@@"], 11);

pub(crate) fn draw((name, starts, goals, best): Drawing) -> Step<Scene> {
    Ok(Scene::drawn(name, starts, goals)?.best(best))
}

fn known(trial: &mut Trial<'_>, drawing: Drawing) -> Step<()> {
    trial.solve_shown(&draw(drawing)?)
}

pub(crate) fn one_cell(trial: &mut Trial<'_>) -> Step<()> {
    known(trial, ONE_CELL)
}

pub(crate) fn one_agent(trial: &mut Trial<'_>) -> Step<()> {
    known(trial, CORRIDOR)?;
    known(trial, WALL)
}

pub(crate) fn arrived(trial: &mut Trial<'_>) -> Step<()> {
    known(trial, ARRIVED)
}

pub(crate) fn following(trial: &mut Trial<'_>) -> Step<()> {
    known(trial, FOLLOWING)
}

pub(crate) fn cycle(trial: &mut Trial<'_>) -> Step<()> {
    known(trial, CYCLE)
}

pub(crate) fn crossing(trial: &mut Trial<'_>) -> Step<()> {
    known(trial, CROSSING)
}

pub(crate) fn passing_bay(trial: &mut Trial<'_>) -> Step<()> {
    known(trial, PASSING_BAY)
}

pub(crate) fn random_instances(trial: &mut Trial<'_>) -> Step<()> {
    const HOW_MANY: usize = 6;
    const AGENTS: usize = 12;
    let mut random = trial.random();
    for number in 1..=HOW_MANY {
        let scene = Scene::random(&format!("random {number}"), &mut random, AGENTS)?;
        trial.solve_shown(&scene)?;
    }
    Ok(())
}

/// Asks what has no answer: a fail policy finds one all the same, since it need not
/// bring anybody to a goal.
pub(crate) fn impossible(trial: &mut Trial<'_>, scene: &Scene) -> Step<()> {
    let (expectation, wall) = match trial.kind() {
        Kind::FailPolicy => (Expectation::Plan, trial.wall()),
        _ => (Expectation::NoPlan, trial.config().slice()),
    };
    for question in trial.shown(scene)? {
        trial.solve_expecting(&*question, expectation, wall)?;
    }
    Ok(())
}

pub(crate) fn no_room(trial: &mut Trial<'_>) -> Step<()> {
    impossible(trial, &Scene::drawn("no-room", &["ab"], &["ba"])?.crowded())
}

pub(crate) fn unreachable_goal(trial: &mut Trial<'_>) -> Step<()> {
    let scene = Scene::drawn("unreachable-goal", &["a.@.", "b.@."], &["..@a", "b.@."])?;
    impossible(trial, &scene)
}

pub(crate) fn makespan(trial: &mut Trial<'_>) -> Step<()> {
    let mut scene = draw(CROSSING)?;
    scene.objective = Objective::Makespan;
    let mut session = trial.ready(&scene)?;
    let answer = trial.ask(&mut session, &scene, &Call::of(trial.wall()))?;
    // No capability says so, and hosts may ask for either.
    if answer.status != Status::Unsupported {
        trial.judge(&scene, &answer, Expectation::Plan)?;
    }
    trial.close(session);
    Ok(())
}

pub(crate) fn figures(trial: &mut Trial<'_>) -> Step<()> {
    let scene = draw(CROSSING)?;
    let mut session = trial.ready(&scene)?;
    // A figure outside of its domain breaks the contract, and ends this here.
    let answer = trial.ask(&mut session, &scene, &Call::of(trial.wall()))?;
    trial.judge(&scene, &answer, Expectation::Perhaps)?;
    trial.judge_figures(&answer, None)?;
    trial.close(session);
    Ok(())
}

pub(crate) fn node_limit(trial: &mut Trial<'_>) -> Step<()> {
    for question in trial.shown(&draw(PASSING_BAY)?)? {
        let mut session = trial.ready(&*question)?;
        let call = Call {
            nodes: 1,
            ..Call::of(trial.wall())
        };
        let answer = trial.ask(&mut session, &*question, &call)?;
        trial.judge(&*question, &answer, Expectation::Perhaps)?;
        trial.close(session);
    }
    Ok(())
}

pub(crate) fn failed_plan(trial: &mut Trial<'_>) -> Step<()> {
    let scene = draw(PASSING_BAY)?;
    let mut session = trial.ready(&scene)?;
    // Through each other; one that goes away and one that stays; nobody moves.
    let left: [[&[u32]; 2]; 3] = [
        [&[0, 1, 2, 3, 4], &[4, 3, 2, 1, 0]],
        [&[0, 1, 2, 3, 4], &[4]],
        [&[0], &[4]],
    ];
    for paths in left {
        let failed = GridPlan::from_paths(paths).into();
        let call = Call {
            failed: Some(&failed),
            ..Call::of(trial.wall())
        };
        let answer = trial.ask(&mut session, &scene, &call)?;
        trial.judge(&scene, &answer, Expectation::Plan)?;
    }
    trial.close(session);
    Ok(())
}

pub(crate) fn fleet_states(trial: &mut Trial<'_>) -> Step<()> {
    let mut random = trial.random();
    for demand in [Demand::Nothing, Demand::Everything, Demand::Some] {
        let mut scene = Scene::open(&format!("fleet {demand:?}"), 8, 9, &mut random)?;
        scene.demand = demand;
        scene.allows_cycles = false;
        trial.solve(&scene)?;
    }
    Ok(())
}

pub(crate) fn fleet_statuses(trial: &mut Trial<'_>) -> Step<()> {
    const LONG_S: f64 = 1e6;
    let status = |since_s: f64, limit_s: f64, actions_left: Vec<u32>| FleetStatus {
        time_s: since_s,
        since_last_call_s: since_s,
        planning_limit_s: limit_s,
        action_s: 0.5,
        actions_left,
    };
    let statuses = [
        status(0.0, 0.0, vec![0]),
        status(0.0, 0.0, vec![10; 3]),
        status(0.5, 100.0, vec![1; 3]),
        status(LONG_S, 0.1, vec![u32::MAX; 3]),
        status(3.0, 0.1, (0..5000).map(|agent| agent % 7).collect()),
        status(LONG_S, 0.1, vec![0; 3]),
    ];
    let mut asked: Vec<Vec<Answer>> = Vec::new();
    for _ in 0..2 {
        let mut session = trial.open()?;
        trial.create(&mut session)?;
        let mut answers = Vec::new();
        for status in &statuses {
            answers.push(invoke(&mut session, status, trial.wall())?);
        }
        trial.close(session);
        asked.push(answers);
    }
    for (answers, status) in asked[0].iter().zip(&asked[1]).zip(&statuses) {
        let (one, other) = answers;
        if one.said == Said::Nothing {
            let message = one.message.as_deref().unwrap_or("it did not say why");
            return Err(Stop::failed(format!("does not answer: {message}")));
        }
        // It has no seed: what it depends on it was told.
        if one.said != other.said {
            return Err(Stop::failed(format!(
                "answers differently from one start to the next {} s after the last call",
                status.since_last_call_s
            )));
        }
    }
    if asked[0].last().map(|answer| &answer.said) == Some(&Said::Invoke(false)) {
        trial.warn(format!(
            "does not call the planner although nobody has had anything to do for {LONG_S:e} s: \
             the fleet stands for good"
        ));
    }
    Ok(())
}

/// A scene for a plugin of any kind, with an answer that any should find.
pub(crate) fn easy(trial: &Trial<'_>) -> Step<Scene> {
    Scene::open("open", 8, 6, &mut trial.random())
}

/// The same as the plugin is to be asked.
pub(crate) fn small(trial: &Trial<'_>) -> Step<Box<dyn Question>> {
    let scene = easy(trial)?;
    // There is at least one.
    Ok(trial.any_representation()[0].of(&scene))
}

/// Makes a plugin do its work once, and ends it.
pub(crate) fn work(trial: &mut Trial<'_>) -> Step<Closing> {
    let scene = small(trial)?;
    let mut session = trial.ready(&*scene)?;
    trial.ask(&mut session, &*scene, &Call::of(trial.wall()))?;
    Ok(trial.close(session))
}

/// Never less than a plugin needs to look at the clock once.
pub(crate) fn at_least(wall: Duration, least_ms: u64) -> Duration {
    wall.max(Duration::from_millis(least_ms))
}

#[cfg(test)]
mod tests {
    use std::collections::{BTreeMap, BTreeSet};

    use fleetyard_core::Connectivity;

    use super::super::claims::ONE_WAY;
    use super::*;
    use crate::judge;
    use crate::rules::Arrival;

    /// Everybody's cell, and who has arrived for good.
    type State = (Vec<u32>, Vec<bool>);

    /// All joint moves, judged by the validator one step at a time.
    fn moves(scene: &Scene, at: &[u32], done: &[bool]) -> Vec<Vec<u32>> {
        let mut joint: Vec<Vec<u32>> = vec![Vec::new()];
        for (cell, done) in at.iter().zip(done) {
            let near = scene.grid.neighbors(*cell, Connectivity::Four);
            let near = near.filter(|_| !*done).collect::<Vec<_>>();
            let choices: Vec<u32> = near.into_iter().chain([*cell]).collect();
            joint = joint
                .into_iter()
                .flat_map(|so_far| {
                    choices.iter().map(move |choice| {
                        let mut longer = so_far.clone();
                        longer.push(*choice);
                        longer
                    })
                })
                .collect();
        }
        joint.retain(|to| {
            let mut now = scene.clone();
            now.starts = at.to_vec();
            let step = GridPlan::from_paths(at.iter().zip(to).map(|(from, to)| [*from, *to]));
            judge::plan(&now, &step, Arrival::Free, 0).is_ok()
        });
        joint
    }

    /// The least sum of costs, by Dijkstra over joint states.
    fn best(scene: &Scene) -> Option<u64> {
        let goals: Vec<u32> = scene.goals.iter().map(|goals| goals[0]).collect();
        let mut open: BTreeMap<u64, BTreeSet<State>> = BTreeMap::new();
        let mut closed: BTreeSet<State> = BTreeSet::new();
        open.entry(0)
            .or_default()
            .insert((scene.starts.clone(), vec![false; scene.agents()]));
        while let Some((cost, states)) = open.pop_first() {
            let mut states: Vec<State> = states.into_iter().collect();
            while let Some((at, done)) = states.pop() {
                if !closed.insert((at.clone(), done.clone())) {
                    continue;
                }
                if done.iter().all(|done| *done) {
                    return Some(cost);
                }
                // To arrive for good costs nothing.
                for agent in
                    (0..at.len()).filter(|agent| !done[*agent] && at[*agent] == goals[*agent])
                {
                    let mut arrived = done.clone();
                    arrived[agent] = true;
                    states.push((at.clone(), arrived));
                }
                let step = done.iter().filter(|done| !**done).count() as u64;
                for to in moves(scene, &at, &done) {
                    open.entry(cost + step)
                        .or_default()
                        .insert((to, done.clone()));
                }
            }
        }
        None
    }

    #[test]
    fn known_answers_are_right() {
        let drawings = [
            ONE_CELL,
            CORRIDOR,
            WALL,
            ARRIVED,
            FOLLOWING,
            CYCLE,
            CROSSING,
            PASSING_BAY,
        ];
        for drawing in drawings {
            let scene = draw(drawing).unwrap_or_else(|_| panic!("{}", drawing.0));
            assert_eq!(best(&scene), scene.best, "{}", drawing.0);
        }
        for (arrows, drawing) in ONE_WAY {
            let scene = draw(drawing).and_then(|scene| scene.one_way(arrows));
            let scene = scene.unwrap_or_else(|_| panic!("{}", drawing.0));
            assert_eq!(best(&scene), scene.best, "{}", drawing.0);
        }
        let stuck = Scene::drawn("stuck", &["ab"], &["ba"]).unwrap_or_else(|_| panic!("stuck"));
        assert_eq!(best(&stuck), None);
    }
}
