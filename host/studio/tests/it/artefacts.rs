//! Artefacts: what an edit makes stale, and what it leaves alone.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

use fleetyard_core::{Digest, RoadmapPlan, RoadmapPlanFile, Visit, write_roadmap_plan};
use fleetyard_core::{
    GridPlan, Knot, PlanFile, TrajectoryFile, TrajectoryPlan, write_plan, write_trajectories,
};
use fleetyard_studio::artefacts::{KeptPlan, State};
use fleetyard_studio::{Artefacts, Document, History};
use serde_json::{Value, json};

use crate::{edit, made};

/// Two robots in a room with a pillar, each with a way of 3 m.
fn room() -> Vec<Value> {
    vec![
        json!({"op": "set-bounds", "bounds_m": [0, 0, 4, 4]}),
        json!({"op": "add-obstacles", "obstacles": [{"rectangle": {"center": [2, 2], "size": [0.4, 0.4]}}]}),
        json!({"op": "set-view", "roadmap": {"builder": "tangent"}}),
        json!({"op": "add-agents", "agents": [
            {"robot": "robot", "start": [0.75, 0.75], "goal": [3.25, 0.75]},
            {"robot": "robot", "start": [0.75, 3.25], "goal": [3.25, 3.25]}]}),
    ]
}

fn derive(artefacts: &Artefacts, document: &Document) {
    artefacts.instance(document).unwrap();
    artefacts.roadmap(document).unwrap();
}

fn states(artefacts: &Artefacts, document: &Document) -> BTreeMap<String, State> {
    let list = artefacts.list(document).into_iter();
    list.map(|artefact| (artefact.id, artefact.state)).collect()
}

#[test]
fn an_edit_makes_stale_what_depends_on_it() {
    use State::{Fresh, Refused, Stale};
    let derived = ["world", "problem", "grid", "instance", "roadmap"];
    let agent = json!({"robot": "robot", "start": [0.75, 1.75], "goal": [3.25, 0.75]});
    for (operation, expected) in [
        (
            json!({"op": "set-name", "name": "x"}),
            [Fresh, Fresh, Fresh, Fresh, Fresh],
        ),
        (
            json!({"op": "set-agent", "index": 0, "agent": agent}),
            [Fresh, Fresh, Fresh, Stale, Stale],
        ),
        (
            json!({"op": "set-view", "roadmap": {"builder": "tangent", "sides": 8}}),
            [Fresh, Fresh, Fresh, Fresh, Stale],
        ),
        (
            json!({"op": "set-view", "grid": {"connectivity": 8}}),
            [Fresh, Fresh, Stale, Stale, Fresh],
        ),
        (
            json!({"op": "set-seed", "seed": 9}),
            [Fresh, Fresh, Fresh, Fresh, Stale],
        ),
        (
            json!({"op": "set-obstacle", "index": 0, "obstacle": {"rectangle": {"center": [2, 2], "size": [0.5, 0.4]}}}),
            [Fresh, Fresh, Stale, Stale, Stale],
        ),
        (
            json!({"op": "set-obstacle", "index": 0, "obstacle": {"rectangle": {"center": [1, 1], "size": [1, 1]}}}),
            [Fresh, Refused, Stale, Refused, Refused],
        ),
        (
            json!({"op": "set-tolerances", "goal_tolerance_m": 0.2}),
            [Fresh, Fresh, Fresh, Stale, Stale],
        ),
        (
            json!({"op": "set-robot", "name": "robot", "profile": {
                "footprint": {"disc": {"radius_m": 0.2}}, "model": "single-integrator"}}),
            [Fresh, Fresh, Stale, Stale, Stale],
        ),
    ] {
        let artefacts = Artefacts::default();
        let mut history = History::new(made(&room()));
        assert_eq!(states(&artefacts, history.document())["grid"], Stale);
        derive(&artefacts, history.document());
        let before = artefacts.list(history.document());
        assert!(before.iter().all(|artefact| artefact.state == Fresh));
        edit(&mut history, operation.clone()).unwrap();
        let found = states(&artefacts, history.document());
        assert_eq!(derived.map(|id| found[id]), expected, "{operation}");
        // A step back finds everything again, and all of it the same.
        history.undo();
        assert_eq!(artefacts.list(history.document()), before, "{operation}");
    }
}

/// Moving an agent leaves world and cells where they are; a new roadmap leaves the grid.
#[test]
fn nothing_is_derived_twice() {
    let artefacts = Artefacts::default();
    let mut history = History::new(made(&room()));
    let document = history.document().clone();
    let (world, grid) = (
        artefacts.world(&document).unwrap(),
        artefacts.grid(&document).unwrap(),
    );
    let instance = artefacts.instance(&document).unwrap();
    edit(
        &mut history,
        json!({"op": "set-view", "roadmap": {"builder": "tangent", "sides": 5}}),
    )
    .unwrap();
    assert!(Arc::ptr_eq(
        &artefacts.instance(history.document()).unwrap(),
        &instance
    ));
    let agent = json!({"robot": "robot", "start": [0.75, 1.75], "goal": [3.25, 0.75]});
    edit(
        &mut history,
        json!({"op": "set-agent", "index": 0, "agent": agent}),
    )
    .unwrap();
    assert!(Arc::ptr_eq(
        &artefacts.world(history.document()).unwrap(),
        &world
    ));
    assert!(Arc::ptr_eq(
        &artefacts.grid(history.document()).unwrap(),
        &grid
    ));
    assert!(!Arc::ptr_eq(
        &artefacts.instance(history.document()).unwrap(),
        &instance
    ));
}

#[test]
fn what_was_made_elsewhere_is_stale_when_its_sources_are() {
    let artefacts = Artefacts::default();
    let mut history = History::new(made(&room()));
    derive(&artefacts, history.document());
    let first = history.document().clone();
    let digest = |id: &str| {
        let list = artefacts.list(&first).into_iter();
        list.filter(|artefact| artefact.id == id)
            .find_map(|artefact| artefact.digest)
            .unwrap()
    };
    artefacts.register(
        "plan 1",
        Digest(1),
        vec![("instance".into(), digest("instance"))],
    );
    artefacts.register("trace 1", Digest(2), vec![("plan 1".into(), Digest(1))]);
    artefacts.register(
        "plan 2",
        Digest(3),
        vec![("roadmap".into(), digest("roadmap"))],
    );
    let stale = |history: &History| {
        let list = artefacts.list(history.document());
        ["plan 1", "trace 1", "plan 2"].map(|id| {
            let is_stale = artefacts.is_stale(history.document(), id);
            let listed = list.iter().find(|artefact| artefact.id == id).unwrap();
            // The list derives nothing, and may take for stale what is not.
            assert!(listed.state == State::Stale || !is_stale, "{id}");
            is_stale
        })
    };
    assert_eq!(stale(&history), [false; 3]);
    edit(
        &mut history,
        json!({"op": "set-view", "roadmap": {"builder": "tangent", "sides": 5}}),
    )
    .unwrap();
    assert_eq!(stale(&history), [false, false, true]);
    edit(
        &mut history,
        json!({"op": "remove-obstacles", "indices": [0]}),
    )
    .unwrap();
    assert_eq!(stale(&history), [true; 3]);
    history.undo();
    history.undo();
    assert_eq!(stale(&history), [false; 3]);
    // Another plan in the place of the first: its trace is of the old one.
    artefacts.register(
        "plan 1",
        Digest(7),
        vec![("instance".into(), digest("instance"))],
    );
    assert_eq!(stale(&history), [false, true, false]);
    artefacts.forget("plan 1");
    assert!(artefacts.is_stale(history.document(), "plan 1"));
}

/// Plans of all three views are judged in the document as it is now.
#[test]
fn plans_are_judged_again() {
    let artefacts = Artefacts::default();
    let mut history = History::new(made(&room()));
    let document = history.document().clone();
    let instance = artefacts.instance(&document).unwrap();
    let roadmap = artefacts.roadmap(&document).unwrap();
    // Along the rows of starts and goals.
    let grid = instance.instance.grid();
    let ends = instance
        .instance
        .starts()
        .iter()
        .zip(instance.instance.goals());
    let paths = ends.map(|(start, goal)| (*start..=*goal).collect::<Vec<u32>>());
    let cells = GridPlan::from_paths(paths.collect::<Vec<_>>());
    assert_eq!(grid.rows(), 8);
    let cells = write_plan(&PlanFile::new(&instance.instance, cells));
    let mut visits = RoadmapPlan::with_capacity(2, 4);
    let mut straight = TrajectoryPlan::with_capacity(2, 4);
    for (agent, (start, goal)) in document
        .agents()
        .iter()
        .map(|agent| (agent.start, agent.goal))
        .enumerate()
    {
        let visit = |vertex: u32, arrival_s: f64| Visit {
            vertex,
            arrival_s,
            departure_s: arrival_s,
        };
        visits
            .push_path([
                visit(roadmap.starts[agent], 0.0),
                visit(roadmap.goals[agent], 2.5),
            ])
            .unwrap();
        let knot = |[x_m, y_m]: [f64; 2], time_s: f64| Knot {
            time_s,
            x_m,
            y_m,
            heading_rad: None,
        };
        straight
            .push_path([knot(start.at_m(), 0.0), knot(goal.at_m(), 2.5)])
            .unwrap();
    }
    let visits = write_roadmap_plan(&RoadmapPlanFile::new(&roadmap.roadmap, None, visits));
    let straight = write_trajectories(&TrajectoryFile::new(straight));
    let read = |bytes: Vec<u8>| {
        artefacts
            .plan(&document, PathBuf::from("plan.json"), bytes)
            .unwrap()
    };
    let plans = [cells, visits, straight].map(read);
    assert!(matches!(
        plans,
        [
            KeptPlan::Grid { .. },
            KeptPlan::Roadmap { .. },
            KeptPlan::Continuous(_)
        ]
    ));
    let valid = |history: &History| {
        let verdict = |plan: &KeptPlan| {
            let verdict = artefacts.verdict(history.document(), plan, 8);
            verdict
                .map(|verdict| verdict.is_valid())
                .map_err(|error| error.reason)
        };
        [verdict(&plans[0]), verdict(&plans[1]), verdict(&plans[2])]
    };
    assert_eq!(valid(&history), [Ok(true), Ok(true), Ok(true)]);
    // An obstacle in the way of the first.
    edit(
        &mut history,
        json!({"op": "add-obstacles", "obstacles": [
        {"rectangle": {"center": [2.25, 0.75], "size": [0.1, 0.1]}}]}),
    )
    .unwrap();
    assert_eq!(valid(&history), [Ok(false), Ok(false), Ok(false)]);
    history.undo();
    // An obstacle that is in nobody's way.
    edit(
        &mut history,
        json!({"op": "add-obstacles", "obstacles": [
        {"rectangle": {"center": [2.25, 1.25], "size": [0.1, 0.1]}}]}),
    )
    .unwrap();
    assert_eq!(valid(&history), [Ok(true), Ok(true), Ok(true)]);
    // Another goal is missed; on a roadmap it is at no vertex.
    let agent = json!({"robot": "robot", "start": [0.75, 0.75], "goal": [3.25, 1.75]});
    edit(
        &mut history,
        json!({"op": "set-agent", "index": 0, "agent": agent}),
    )
    .unwrap();
    let [cells, visits, straight] = valid(&history);
    assert_eq!([cells, straight], [Ok(false), Ok(false)]);
    assert!(visits.unwrap_err().starts_with("the goal of agent 0 is "));
    history.undo();
    // Smaller robots have other cells.
    edit(
        &mut history,
        json!({"op": "set-robot", "name": "robot", "profile": {
        "footprint": {"disc": {"radius_m": 0.2}}, "model": "single-integrator"}}),
    )
    .unwrap();
    let [cells, visits, straight] = valid(&history);
    assert_eq!(
        cells,
        Err(
            "the plan is on a grid of 8 by 8 cells of 0.5 m, which the document has no longer"
                .into()
        )
    );
    assert_eq!([visits, straight], [Ok(true), Ok(true)]);
    // A robot in a wall: the document is no problem to plan for.
    let agent = json!({"robot": "robot", "start": [0.05, 0.75], "goal": [3.25, 0.75]});
    edit(
        &mut history,
        json!({"op": "set-agent", "index": 0, "agent": agent}),
    )
    .unwrap();
    let refused = valid(&history).map(|verdict| verdict.unwrap_err());
    assert!(
        refused
            .iter()
            .all(|reason| reason.starts_with("the start of agent 0 ")),
        "{refused:?}"
    );
}

#[test]
fn clearance_is_the_distance_to_what_stands() {
    let artefacts = Artefacts::default();
    let document = made(&room());
    let field = artefacts.clearance(&document, 0.25).unwrap();
    assert_eq!(
        (field.rows, field.cols, field.values_cm.len()),
        (16, 16, 256)
    );
    for (at, found) in field.values_cm.iter().enumerate() {
        let (row, col) = (at / 16, at % 16);
        let (x, y) = ((col as f64 + 0.5) * 0.25, (15.5 - row as f64) * 0.25);
        let edge = x.min(y).min(4.0 - x).min(4.0 - y);
        let away = [x, y].map(|value: f64| ((value - 2.0).abs() - 0.2).max(0.0));
        let pillar = away[0].hypot(away[1]);
        // Rounding of a number that is whole may go either way.
        let expected = 100.0 * edge.min(pillar);
        assert!(
            (expected - 1e-6..expected + 1.0).contains(&(f64::from(*found) + 0.999_999)),
            "{x} {y}"
        );
    }
    let error = artefacts.clearance(&document, 0.001).unwrap_err();
    assert_eq!(error.reason, "a field of 4000 by 4000 points is too large");
    assert!(artefacts.clearance(&document, f64::NAN).is_err());
}

/// The grid of a world is there before its robots are.
#[test]
fn a_grid_needs_no_agents() {
    let artefacts = Artefacts::default();
    let grid = artefacts.grid(&Document::default()).unwrap();
    assert_eq!((grid.grid.rows(), grid.grid.cols()), (12, 20));
    let error = artefacts.roadmap(&Document::default()).unwrap_err();
    assert_eq!(error.reason, "there are no agents");
    let wide = made(&[json!({"op": "set-bounds", "bounds_m": [0, 0, 9000, 9000]})]);
    assert!(
        artefacts
            .grid(&wide)
            .unwrap_err()
            .reason
            .ends_with("too many for the studio")
    );
}
