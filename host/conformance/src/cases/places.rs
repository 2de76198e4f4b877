//! Cases of roadmaps and of the plane, beside those that are about every representation.

use std::f64::consts::SQRT_2;

use fleetyard_abi::{Motion, Plan, Robot};

use super::answers::{PASSING_BAY, draw};
use super::claims::round_the_block;
use crate::representation::Representation;
use crate::scene::roadmap::{RoadmapScene, Sketch};
use crate::scene::robots::{disc, moved_by, rectangle};
use crate::scene::workspace::WorkspaceScene;
use crate::stop::{Step, Stop};
use crate::trial::{Expectation, Trial};

/// Distance of centres in the sketches.
const SEPARATION_M: f64 = 1.0;

/// Four short edges are a shorter way than two long ones.
const ONE: Sketch = (
    "shortest by length",
    &[
        [0.0, 0.0],
        [1.0, 0.0],
        [2.0, 0.0],
        [3.0, 0.0],
        [4.0, 0.0],
        [2.0, 3.0],
    ],
    &[[0, 1], [1, 2], [2, 3], [3, 4], [0, 5], [5, 4]],
    &[[0, 4]],
    Some(4.0),
);

/// Two lines that cross in the middle, where there is no vertex. One of two waits until it has
/// fallen back by √2 times the separation.
const CROSSING: Sketch = (
    "crossing edges",
    &[[0.0, 2.0], [4.0, 2.0], [2.0, 0.0], [2.0, 4.0]],
    &[[0, 1], [2, 3]],
    &[[0, 1], [2, 3]],
    Some(8.0 + SQRT_2),
);

/// The goal of one is nearer than the separation to the way of the other, without an edge between
/// them.
const NEAR: Sketch = (
    "near vertices",
    &[[0.0, 0.0], [3.0, 0.0], [6.0, 0.0], [3.0, 0.5], [3.0, 3.0]],
    &[[0, 1], [1, 2], [3, 4]],
    &[[0, 2], [4, 3]],
    None,
);

fn solve_sketch(trial: &mut Trial<'_>, sketch: Sketch) -> Step<()> {
    let scene = RoadmapScene::sketched(sketch, SEPARATION_M, trial.pace());
    trial.solve(&scene)?;
    Ok(())
}

pub(crate) fn roadmap_one(trial: &mut Trial<'_>) -> Step<()> {
    solve_sketch(trial, ONE)?;
    let one_way = RoadmapScene::of(&round_the_block()?, trial.pace());
    trial.solve(&one_way)?;
    Ok(())
}

pub(crate) fn roadmap_crossing(trial: &mut Trial<'_>) -> Step<()> {
    solve_sketch(trial, CROSSING)
}

pub(crate) fn roadmap_near(trial: &mut Trial<'_>) -> Step<()> {
    solve_sketch(trial, NEAR)
}

/// The same roads with one motion along them.
fn driven(trial: &mut Trial<'_>, motion: Motion) -> Step<()> {
    for sketch in [CROSSING, NEAR] {
        trial.solve(&RoadmapScene::sketched(sketch, SEPARATION_M, motion))?;
    }
    let bay = Representation::Roadmap(motion).of(&draw(PASSING_BAY)?);
    trial.solve(&*bay)?;
    Ok(())
}

pub(crate) fn stop_go(trial: &mut Trial<'_>) -> Step<()> {
    driven(trial, Motion::StopGo)
}

pub(crate) fn slower(trial: &mut Trial<'_>) -> Step<()> {
    driven(trial, Motion::Slower)
}

const FLOOR_M: [f64; 2] = [6.0, 4.0];
const DISC_M: f64 = 0.3;

/// A wall across the floor with one gap, from one height to another.
fn wall(from_m: f64, to_m: f64) -> [[f64; 4]; 2] {
    [[2.9, 0.0, 3.1, from_m], [2.9, to_m, 3.1, FLOOR_M[1]]]
}

fn one(name: &str, obstacles: &[[f64; 4]], robot: Robot) -> WorkspaceScene {
    WorkspaceScene::new(
        name,
        FLOOR_M,
        obstacles,
        vec![(robot, [1.0, 2.0], [5.0, 2.0])],
    )
}

pub(crate) fn workspace_one(trial: &mut Trial<'_>) -> Step<()> {
    let block = [[2.5, 1.0, 3.5, 3.0]];
    for scene in [
        one("open floor", &[], disc(DISC_M)),
        one("round a block", &block, disc(DISC_M)),
    ] {
        trial.solve(&scene)?;
    }
    let shut = one("behind a wall", &[[2.9, 0.0, 3.1, 4.0]], disc(DISC_M));
    let wall = trial.config().slice();
    trial.solve_expecting(&shut, Expectation::NoPlan, wall)?;
    Ok(())
}

pub(crate) fn workspace_gap(trial: &mut Trial<'_>) -> Step<()> {
    const ROOM_M: f64 = 0.01;
    let (low, high) = (0.5 - ROOM_M, 0.5 + 2.0 * DISC_M + ROOM_M);
    trial.solve(&one("narrow gap", &wall(low, high), disc(DISC_M)))?;
    // Lengthwise, which the circle round it could not.
    let slot = one("slot", &wall(1.8, 2.2), rectangle(0.8, 0.3));
    trial.solve(&slot)?;
    Ok(())
}

pub(crate) fn workspace_mover(trial: &mut Trial<'_>) -> Step<()> {
    // It comes by where a robot at 1 m/s would be then.
    let crossing = one("mover", &[], disc(DISC_M));
    let crossing = crossing.with_mover(DISC_M, &[[0.0, 3.0, 3.7], [4.0, 3.0, 0.3]]);
    trial.solve(&crossing)?;
    Ok(())
}

/// The dynamics that a planner lists, or the reason why cases about them are not for it.
fn listed(trial: &Trial<'_>) -> Step<Vec<&'static str>> {
    let listed = trial.dynamics();
    if listed.is_empty() {
        return Err(Stop::Skipped(
            "the plugin lists no `dynamics:NAME` that the host can judge".into(),
        ));
    }
    Ok(listed)
}

/// Two discs that cross, as fast as they may be.
pub(crate) fn limits(trial: &mut Trial<'_>) -> Step<()> {
    for name in listed(trial)? {
        for speed_m_per_s in [0.5, 2.0] {
            let slow = moved_by(disc(DISC_M), name, speed_m_per_s);
            let title = format!("{name} at {speed_m_per_s} m/s");
            let agents = vec![
                (slow.clone(), [1.0, 2.0], [5.0, 2.0]),
                (slow, [3.0, 0.5], [3.0, 3.5]),
            ];
            trial.solve(&WorkspaceScene::new(&title, FLOOR_M, &[], agents))?;
        }
    }
    Ok(())
}

/// Courses with bends. Wherever a plan has controls they are judged; here there have to be some.
pub(crate) fn controls(trial: &mut Trial<'_>) -> Step<()> {
    let block = [[2.5, 0.0, 3.5, 2.4]];
    let mut found = false;
    for name in listed(trial)? {
        let robot = moved_by(disc(DISC_M), name, 1.0);
        for (title, obstacles) in [("along", &[][..]), ("round a block", &block)] {
            let title = format!("{name} {title}");
            let answer = trial.solve(&one(&title, obstacles, robot.clone()))?;
            let motions = answer.plans().iter().filter_map(|plan| match plan {
                Plan::Trajectories(motions) => motions.controls(),
                _ => None,
            });
            found |= motions.count() > 0;
        }
    }
    if found || trial.is_ignorant() {
        return Ok(());
    }
    Err(Stop::Skipped("its plans have no controls".into()))
}

/// A pair of discs with different dynamics, if the planner lists several.
pub(crate) fn two_dynamics(trial: &Trial<'_>) -> Option<WorkspaceScene> {
    let [first, second, ..] = trial.dynamics()[..] else {
        return None;
    };
    let agents = vec![
        (moved_by(disc(DISC_M), first, 1.0), [1.0, 2.0], [5.0, 2.0]),
        (moved_by(disc(DISC_M), second, 1.0), [3.0, 0.5], [3.0, 3.5]),
    ];
    Some(WorkspaceScene::new("two dynamics", FLOOR_M, &[], agents))
}

/// A body with a heading and one without cross.
pub(crate) fn two_bodies() -> WorkspaceScene {
    let agents = vec![
        (rectangle(0.8, 0.3), [1.0, 2.0], [5.0, 2.0]),
        (disc(DISC_M), [3.0, 0.5], [3.0, 3.5]),
    ];
    WorkspaceScene::new("two bodies", FLOOR_M, &[], agents)
}

/// A wide gap far away and a narrow one at hand, which only the smaller of two discs fits through.
pub(crate) fn two_gaps() -> WorkspaceScene {
    let wall = [[2.9, 0.4, 3.1, 2.8]];
    let agents = vec![
        (disc(DISC_M), [1.0, 0.5], [5.0, 0.5]),
        (disc(DISC_M / 2.0), [1.0, 1.5], [5.0, 1.5]),
    ];
    WorkspaceScene::new("two gaps", FLOOR_M, &wall, agents)
}
