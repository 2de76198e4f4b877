//! One case per capability beyond pebbles on grids with four neighbours.

use fleetyard_abi::{Capability, Status};
use fleetyard_core::Connectivity;
use serde_json::{Map, json};

use super::answers::{CORRIDOR, CROSSING, Drawing, FOLLOWING, WALL, at_least, draw, impossible};
use super::places::{two_bodies, two_dynamics, two_gaps};
use crate::rules::Arrival;
use crate::scene::{RADIUS_M, Scene};
use crate::stop::{Step, Stop};
use crate::trial::{Call, Expectation, Trial, same};

pub(crate) fn eight_connected(trial: &mut Trial<'_>) -> Step<()> {
    let mut random = trial.random();
    let drawn = [
        Scene::drawn(
            "diagonals",
            &["a..b", "....", "....", "c..d"],
            &["d..c", "....", "....", "b..a"],
        )?,
        // The diagonal would be the shortest way, past the corner of the obstacle.
        Scene::drawn("corner", &["a@.", "..."], &[".@.", ".a."])?,
    ];
    let random = [
        Scene::random("random 1", &mut random, 10)?,
        Scene::random("random 2", &mut random, 10)?,
    ];
    for mut scene in drawn.into_iter().chain(random) {
        scene.connectivity = Connectivity::Eight;
        trial.solve(&scene)?;
    }
    Ok(())
}

pub(crate) fn rotation(trial: &mut Trial<'_>) -> Step<()> {
    let mut random = trial.random();
    let scenes = [
        Scene::drawn("about-turn", &["....a"], &["a...."])?,
        draw(CROSSING)?,
        Scene::random("random", &mut random, 8)?,
    ];
    for scene in scenes {
        trial.solve(&scene.turning())?;
    }
    Ok(())
}

pub(crate) fn any_angle(trial: &mut Trial<'_>) -> Step<()> {
    let mut random = trial.random();
    let known = [
        draw(CORRIDOR)?,
        draw(WALL)?,
        // The straight line is open, and so are lines past each of the corners.
        Scene::drawn(
            "open",
            &["a....", ".....", "....."],
            &[".....", ".....", "....a"],
        )?,
        Scene::drawn(
            "corners",
            &["a....", ".@.@.", "....."],
            &[".....", ".@.@.", "....a"],
        )?,
        Scene::drawn(
            "touching",
            &["a.@.", ".@..", "...."],
            &["..@a", ".@..", "...."],
        )?,
        Scene::random("random 1", &mut random, 1)?,
        Scene::random("random 2", &mut random, 1)?,
    ];
    for scene in known {
        trial.solve(&scene.straight())?;
    }
    let shut = Scene::drawn("unreachable-goal", &["a.@.", "..@."], &["..@a", "..@."])?;
    let wall = trial.config().slice();
    trial.solve_expecting(&shut.straight(), Expectation::NoPlan, wall)?;
    Ok(())
}

pub(crate) fn windowed(trial: &mut Trial<'_>) -> Step<()> {
    let mut random = trial.random();
    for window in [1, 5, 50] {
        let mut scene = Scene::open(&format!("window of {window}"), 8, 8, &mut random)?;
        scene.window_steps = window;
        // Everybody comes back to the start, where nobody else has a last goal.
        for (goals, start) in scene.goals.iter_mut().zip(&scene.starts) {
            goals.push(*start);
        }
        trial.solve(&scene)?;
    }
    Ok(())
}

pub(crate) fn duplicate_goals(trial: &mut Trial<'_>) -> Step<()> {
    let mut shared = Scene::drawn(
        "shared",
        &["a...", ".@..", "b..c"],
        &["..a.", ".@b.", "...c"],
    )?;
    let goal = shared.goals[0].clone();
    shared.goals[1] = goal;
    let mut windowed = shared.clone();
    windowed.name = "shared, in a window".into();
    windowed.window_steps = 5;
    for scene in [shared, windowed] {
        if scene.window_steps > 0 && !trial.claims(Capability::Windowed) {
            continue;
        }
        let mut session = trial.ready(&scene)?;
        let answer = trial.ask(&mut session, &scene, &Call::of(trial.wall()))?;
        if answer.status == Status::Infeasible {
            trial.warn("claims that agents with one goal cannot both arrive: a visit is enough");
        } else {
            // Only one of two can stay there.
            trial.judge_as(&scene, &answer, Expectation::Plan, Arrival::Visit)?;
        }
        trial.close(session);
    }
    Ok(())
}

pub(crate) fn anytime(trial: &mut Trial<'_>) -> Step<()> {
    let mut random = trial.random();
    let scene = Scene::open("open", 12, 30, &mut random)?;
    let wall = at_least(trial.config().slice() * 2, 100);
    let answer = trial.solve_expecting(&scene, Expectation::Plan, wall)?;
    trial.figure("plans", answer.plans().len() as f64);
    Ok(())
}

pub(crate) fn colliding_plans(trial: &mut Trial<'_>) -> Step<()> {
    let mut random = trial.random();
    let scenes = [
        Scene::drawn("no-room", &["ab"], &["ba"])?.crowded(),
        Scene::jam(&mut random)?,
    ];
    let wall = at_least(trial.config().slice(), 100);
    for scene in scenes {
        let answer = trial.solve_expecting(&scene, Expectation::NoPlan, wall)?;
        if answer.plans().is_empty() {
            trial.warn(format!("{}: left no paths, as it may", scene.name));
        }
    }
    Ok(())
}

pub(crate) fn k_robust(trial: &mut Trial<'_>) -> Step<()> {
    let schema = &trial.descriptor().options_schema;
    if schema.pointer("/properties/k").is_none() {
        return Err(Stop::failed("its schema has no option `k`"));
    }
    trial.delay = 1;
    let options = Map::from_iter([("k".to_owned(), json!(1))]);
    for drawing in [FOLLOWING, CROSSING] {
        let mut scene = draw(drawing)?;
        scene.best = None;
        let mut session = trial.open()?;
        trial.create_with(&mut session, &options)?;
        trial.prepare(&mut session, &scene)?;
        let answer = trial.ask(&mut session, &scene, &Call::of(trial.wall()))?;
        trial.judge(&scene, &answer, Expectation::Plan)?;
        trial.close(session);
    }
    Ok(())
}

pub(crate) fn threads(trial: &mut Trial<'_>) -> Step<()> {
    let mut random = trial.random();
    let scene = Scene::open("open", 12, 20, &mut random)?;
    let mut session = trial.ready(&scene)?;
    let call = Call {
        threads: 2,
        ..Call::of(trial.wall())
    };
    let answer = trial.ask(&mut session, &scene, &call)?;
    trial.judge(&scene, &answer, Expectation::Plan)?;
    trial.close(session);
    Ok(())
}

/// A street round the block.
const ROUND: &[&str] = &["v<<<<<", ">>>>>^"];

/// Drawings of one-way streets, by arrows, and who is on them.
pub(super) const ONE_WAY: [(&[&str], Drawing); 3] = [
    (
        ROUND,
        (
            "round the block",
            &["a.....", "......"],
            &[".a....", "......"],
            11,
        ),
    ),
    (
        ROUND,
        (
            "one after the other",
            &[".....a", "b....."],
            &[".....b", "a....."],
            12,
        ),
    ),
    (
        &["..>..", ".@.@.", "..<.."],
        (
            "there and back",
            &["a....", ".@.@.", "....b"],
            &["b....", ".@.@.", "....a"],
            12,
        ),
    ),
];

/// One agent who would be there at once if the street were not one-way.
pub(crate) fn round_the_block() -> Step<Scene> {
    let (arrows, drawing) = ONE_WAY[0];
    draw(drawing)?.one_way(arrows)
}

pub(crate) fn move_mask(trial: &mut Trial<'_>) -> Step<()> {
    for (arrows, drawing) in ONE_WAY {
        trial.solve(&draw(drawing)?.one_way(arrows)?)?;
    }
    let against = Scene::drawn("against the arrows", &["a..."], &["...a"])?;
    impossible(trial, &against.one_way(&["<<<<"])?)
}

pub(crate) fn idle_agents(trial: &mut Trial<'_>) -> Step<()> {
    // The second agent stands in the way, beside a bay.
    let mut in_the_way = Scene::drawn("in-the-way", &["a.b..", "@@.@@"], &["..b.a", "@@.@@"])?;
    in_the_way.goals[1].clear();
    let mut nobody = in_the_way.clone();
    nobody.name = "nobody has a goal".into();
    nobody.goals[0].clear();
    for scene in [in_the_way, nobody] {
        trial.solve_shown(&scene)?;
    }
    Ok(())
}

pub(crate) fn heterogeneous(trial: &mut Trial<'_>) -> Step<()> {
    let mut scene = draw(CROSSING)?;
    scene.radii_m = vec![RADIUS_M, RADIUS_M / 2.0];
    trial.solve_shown(&scene)?;
    if trial.claims(Capability::Continuous) {
        trial.solve(&two_gaps())?;
        trial.solve(&two_bodies())?;
        if let Some(scene) = two_dynamics(trial) {
            trial.solve(&scene)?;
        }
    }
    Ok(())
}

pub(crate) fn deterministic(trial: &mut Trial<'_>) -> Step<()> {
    // Few enough that planners which count nodes stop by themselves.
    const NODES: u64 = 1000;
    let mut random = trial.random();
    let scenes = [
        Scene::open("open", 8, 8, &mut random)?,
        Scene::random("random", &mut random, 8)?,
    ];
    let mut questions = Vec::new();
    for scene in &scenes {
        questions.extend(trial.shown(scene)?);
    }
    for question in questions {
        let mut answers = Vec::new();
        for _ in 0..2 {
            let mut session = trial.ready(&*question)?;
            let call = Call {
                nodes: NODES,
                ..Call::of(trial.wall())
            };
            let answer = trial.ask(&mut session, &*question, &call)?;
            trial.judge(&*question, &answer, Expectation::Perhaps)?;
            trial.close(session);
            answers.push(answer);
        }
        if answers.iter().any(|answer| answer.by_clock) {
            trial.figure("first_plans_only", 1.0);
        }
        same(&answers[0], &answers[1])
            .map_err(|reason| Stop::failed(format!("{}: {reason}", question.name())))?;
    }
    Ok(())
}
