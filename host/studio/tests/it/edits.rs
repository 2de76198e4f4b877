//! Edits one by one: what they do, and how they are refused.

use fleetyard_studio::{Artefacts, Document, Edit, History};
use serde_json::{Value, json};

use crate::{edit, made};

fn room() -> Vec<Value> {
    vec![
        json!({"op": "add-obstacles", "obstacles": [{"rectangle": {"center": [5, 1.5], "size": [0.4, 3]}}]}),
        json!({"op": "set-robot", "name": "a/b", "profile": {
            "footprint": {"disc": {"radius_m": 0.3}}, "model": "single-integrator"}}),
        json!({"op": "add-agents", "agents": [
            {"robot": "robot", "start": [1, 1], "goal": [9, 5]},
            {"robot": "a/b", "start": [1, 2], "goal": [9, 4, 1.5]}]}),
    ]
}

fn cells() -> Vec<Value> {
    vec![json!({"op": "replace", "document": {"name": "cells",
        "ground": {"map": {"rows": 3, "cols": 4, "cell_size_m": 0.5, "blocked": [5, 2], "endpoints": [11, 1]}},
        "robots": {"robot": {"footprint": {"disc": {"radius_m": 0.25}}, "model": "single-integrator"}},
        "agents": [{"start": [0.25, 0.25], "goal": [1.75, 1.25]}]}})]
}

#[test]
fn what_is_wrong_has_its_place() {
    let polygon =
        |corners: Value| json!({"op": "add-obstacles", "obstacles": [{"polygon": corners}]});
    for (before, operation, place, told) in [
        (
            room(),
            json!({"op": "jump"}),
            "/op/op",
            "there is no operation \"jump\"",
        ),
        (
            room(),
            json!({"name": "x"}),
            "/op/op",
            "the operation has no name",
        ),
        (
            room(),
            json!({"op": "set-name"}),
            "/op",
            "missing field `name`",
        ),
        (
            room(),
            json!({"op": "set-name", "name": "a\nb"}),
            "/name",
            "the name \"a\\\\nb\" has a control character",
        ),
        (
            room(),
            json!({"op": "set-seed", "seed": -1}),
            "/op/seed",
            "invalid value: integer `-1`, expected u64",
        ),
        (
            room(),
            json!({"op": "set-seed", "seed": 1, "sed": 2}),
            "/op/sed",
            "unknown field `sed`, expected `seed`",
        ),
        (
            room(),
            polygon(json!([[0, 0], [1, 1], [1, 0], [0, 1]])),
            "/op/obstacles/0",
            "the polygon intersects itself: the edge from vertex 0 meets the edge from vertex 2",
        ),
        (
            room(),
            json!({"op": "set-bounds", "bounds_m": [0, 0, 1, 1]}),
            "/agents/0/goal",
            "the goal of agent 0 at (9, 5) is outside of the world",
        ),
        (
            room(),
            json!({"op": "set-agent", "index": 1, "agent": {"robot": "robot", "start": [11, 1], "goal": [1, 1]}}),
            "/agents/1/start",
            "the start of agent 1 at (11, 1) is outside of the world",
        ),
        (
            room(),
            json!({"op": "set-agent", "index": 2, "agent": {"robot": "robot", "start": [1, 1], "goal": [1, 1]}}),
            "/op/index",
            "there is no agent 2",
        ),
        (
            room(),
            json!({"op": "add-agents", "agents": [{"robot": "dog", "start": [1, 1], "goal": [1, 1]}]}),
            "/agents/2/robot",
            "\"dog\" is not one of the robots",
        ),
        (
            room(),
            json!({"op": "add-agents", "agents": [{"start": [1, 1], "goal": [1]}]}),
            "/op/agents/0/goal",
            "invalid length 1, expected a place [x, y] or [x, y, heading]",
        ),
        (
            room(),
            json!({"op": "remove-robot", "name": "a/b"}),
            "/robots/a~1b",
            "\"a/b\" is the robot of 1 agents, the first of them agent 1",
        ),
        (
            room(),
            json!({"op": "remove-agents", "indices": [1, 1]}),
            "/op/indices/1",
            "the agent 1 is named twice",
        ),
        (
            room(),
            json!({"op": "remove-obstacles", "indices": [1]}),
            "/op/indices/0",
            "there is no obstacle 1",
        ),
        (
            room(),
            json!({"op": "paint", "as": "free", "runs": [0, 1]}),
            "/op/op",
            "the ground is a world in the plane, which has no cells",
        ),
        (
            room(),
            json!({"op": "set-view", "roadmap": {"builder": "lattice"}}),
            "/views/roadmap",
            "a roadmap cannot be made of a lattice with sides of NaN m",
        ),
        (
            room(),
            json!({"op": "set-view", "grid": {"connectivity": 6}}),
            "/op/grid/connectivity",
            "a cell with 6 neighbours",
        ),
        (
            room(),
            json!({"op": "scatter", "count": 100_000}),
            "/agents",
            "there are 100002 agents, more than 100000",
        ),
        (
            room(),
            json!({"op": "scatter", "count": 5000}),
            "/op/count",
            "there is room for",
        ),
        (
            room(),
            json!({"op": "batch", "name": "two", "ops": [{"op": "set-seed", "seed": 2},
                {"op": "remove-movers", "indices": [0]}]}),
            "/op/ops/1/indices/0",
            "operation 1, remove-movers: there is no moving obstacle 0",
        ),
        (
            room(),
            json!({"op": "batch", "name": "two", "ops": [{"op": "batch", "name": "one", "ops": []}]}),
            "/op/ops/0/op",
            "a batch within a batch",
        ),
        (
            room(),
            json!({"op": "replace", "document": {"ground": {"world": {"bounds_m": [0, 0, 1, 1]}},
                "robots": {"x": "agv"}, "agents": [{"start": [0.5, 0.5], "goal": [2, 2]}]}}),
            "/op/document/agents/0/goal",
            "the goal of agent 0 at (2, 2) is outside of the world",
        ),
        (
            room(),
            json!({"op": "replace", "document": {"ground": {"world": {"bounds_m": [0, 0, 1, 1]}}, "robots": {}}}),
            "/op/document/robots",
            "there are no robots",
        ),
        (
            cells(),
            json!({"op": "paint", "as": "blocked", "runs": [0, 2, 10, 3]}),
            "/op/runs/2",
            "3 cells from cell 10 are no run here",
        ),
        (
            cells(),
            json!({"op": "resize-map", "rows": 60_000, "cols": 60_000}),
            "/ground/map",
            "a map of 60000 rows and 60000 columns is empty or too large",
        ),
        (
            cells(),
            json!({"op": "resize-map", "rows": 3, "cols": 2}),
            "/agents/0/goal",
            "the goal of agent 0 at (1.75, 1.25) is outside of the world",
        ),
        (
            cells(),
            json!({"op": "set-bounds", "bounds_m": [0, 0, 1, 1]}),
            "/op/op",
            "the ground is a map, which has cells and no outlines",
        ),
    ] {
        let mut history = History::new(made(&before));
        let kept = history.document().clone();
        let refusal = edit(&mut history, operation.clone()).expect_err(&operation.to_string());
        assert!(refusal.error.starts_with(told), "{operation}: {refusal:?}");
        assert_eq!(refusal.place, place, "{operation}: {refusal:?}");
        assert!(!refusal.hint.is_empty());
        assert_eq!(history.document(), &kept);
        assert_eq!(history.version(), 0);
    }
}

#[test]
fn problems_are_told_in_the_words_of_the_command() {
    let artefacts = Artefacts::default();
    let mut operations = room();
    operations.push(json!({"op": "add-agents", "agents": [
        {"robot": "robot", "start": [5, 1], "goal": [1, 4]},
        {"robot": "robot", "start": [1.25, 1], "goal": [3, 4]},
        {"robot": "robot", "start": [0.1, 3], "goal": [3, 3]}]}));
    let whole = artefacts.whole(&made(&operations)).unwrap();
    let told: Vec<Value> = whole
        .problems
        .iter()
        .map(|problem| json!(problem))
        .collect();
    let move_it = "move it, or give the agent a smaller footprint";
    assert_eq!(
        told,
        [
            json!({"error": "the start of agent 2 at (5, 1) is outside of the free space", "hint": move_it,
                "place": "/agents/2/start", "agents": [2]}),
            json!({"error": "the start of agent 4 at (0.1, 3) is 0.1500 m inside an obstacle or the edge",
                "hint": move_it, "place": "/agents/4/start", "agents": [4]}),
            json!({"error": "the starts of agents 0 and 3 overlap by 0.2500 m", "hint": "move one of them",
                "place": "/agents/0/start", "agents": [0, 3]}),
        ]
    );
    let none = artefacts.whole(&Document::default()).unwrap();
    assert_eq!(none.problems[0].error, "there are no agents");
    assert!(artefacts.whole(&made(&room())).unwrap().problems.is_empty());
}

#[test]
fn cells_are_painted_and_maps_resized() {
    let mut operations = cells();
    let ground = |operations: &[Value]| serde_json::to_value(made(operations).ground()).unwrap();
    operations.push(json!({"op": "paint", "as": "workstation", "runs": [4, 3]}));
    operations.push(json!({"op": "paint", "as": "free", "runs": [5, 1, 11, 1]}));
    assert_eq!(
        ground(&operations),
        json!({"map": {"rows": 3, "cols": 4, "cell_size_m": 0.5, "blocked": [], "workstations": [4, 1, 6, 1],
            "endpoints": []}})
    );
    // The lower left corner stays where it is.
    operations.push(json!({"op": "resize-map", "rows": 4, "cols": 5}));
    operations.push(json!({"op": "set-cell-size", "cell_size_m": 1.0}));
    assert_eq!(
        ground(&operations),
        json!({"map": {"rows": 4, "cols": 5, "cell_size_m": 1.0, "blocked": [], "workstations": [10, 1, 12, 1],
            "endpoints": []}})
    );
    let agent = made(&operations).agents()[0];
    assert_eq!(
        (agent.start.at_m(), agent.goal.at_m()),
        ([0.5, 0.5], [3.5, 2.5])
    );
}

#[test]
fn robots_are_renamed_and_removed() {
    let mut operations = room();
    operations.push(json!({"op": "set-robot", "name": "spare", "profile": "agv"}));
    operations.push(json!({"op": "set-agents", "indices": [0], "agents": [
        {"robot": "a/b", "start": [1, 1], "goal": [9, 5]}]}));
    operations.push(json!({"op": "remove-robot", "name": "robot"}));
    operations.push(json!({"op": "rename-robot", "name": "a/b", "to": "cart"}));
    let document = made(&operations);
    let names: Vec<&str> = document
        .robots()
        .iter()
        .map(|(name, _)| name.as_str())
        .collect();
    assert_eq!(names, ["cart", "spare"]);
    assert!(document.agents().iter().all(|agent| agent.robot == 0));
}

/// Scattered robots can be planned for in every view, and the same seed puts them where they were.
#[test]
fn robots_are_scattered_and_snapped() {
    let artefacts = Artefacts::default();
    let scatter = |seed: u64| json!({"op": "scatter", "count": 12, "robot": "robot", "seed": seed});
    for before in [room(), cells()[..1].to_vec()] {
        let count = if before.len() == 1 { 6 } else { 12 };
        let scatter = |seed: u64| {
            let mut operation = scatter(seed);
            operation["count"] = count.into();
            [before.clone(), vec![operation]].concat()
        };
        let document = made(&scatter(1));
        assert_eq!(document, made(&scatter(1)));
        assert_ne!(document, made(&scatter(2)));
        let whole = artefacts.whole(&document).unwrap();
        assert!(whole.problems.is_empty(), "{:?}", whole.problems);
        let crowd = [
            before.clone(),
            vec![json!({"op": "add-agents", "agents": vec![
            json!({"robot": "robot", "start": [1.1, 1.1], "goal": [1.0, 0.6]}); 5]})],
        ]
        .concat();
        for view in ["grid", "roadmap", "continuous"] {
            let snapped =
                made(&[crowd.clone(), vec![json!({"op": "snap", "view": view})]].concat());
            let whole = artefacts.whole(&snapped).unwrap();
            assert!(whole.problems.is_empty(), "{view}: {:?}", whole.problems);
            if view == "grid" {
                let view = artefacts.instance(&snapped).unwrap();
                assert!(view.snapped_m.iter().flatten().all(|far| *far < 1e-9));
            }
            // Who is at a place that will do stays there.
            let again =
                made(&[crowd.clone(), vec![json!({"op": "snap", "view": view}); 2]].concat());
            assert_eq!(again, snapped, "{view}");
        }
    }
}

#[test]
fn a_batch_is_one_step() {
    let mut history = History::new(Document::default());
    let operation = json!({"op": "batch", "name": "rooms", "ops": room()});
    let read = Edit::read(operation).unwrap();
    assert_eq!(read.name(), "rooms");
    history.edit(&read).unwrap();
    assert_eq!(history.undoable(), Some("rooms"));
    assert!(history.undo() && !history.undo());
    assert_eq!((history.version(), history.redoable()), (2, Some("rooms")));
    edit(&mut history, json!({"op": "set-seed", "seed": 4})).unwrap();
    assert_eq!(history.redoable(), None);
}
