//! A document of the studio and the command on its files: the same digests, and the same words.

use fleetyard_studio::document::Ground;
use fleetyard_studio::files::{Files, write};
use fleetyard_studio::{Artefacts, Document, Edit, History};
use fleetyard_testkit::{INPUT, SUCCESS, Yard};
use serde_json::{Value, json};

fn made(operations: &[Value]) -> Document {
    let mut history = History::new(Document::default());
    for operation in operations {
        let edit = Edit::read(operation.clone()).unwrap();
        history.edit(&edit).unwrap();
    }
    history.document().clone()
}

/// Rooms with turned walls and a round edge, robots of three kinds, and a map of cells.
fn documents() -> Vec<Document> {
    let rooms = json!({"op": "add-obstacles", "obstacles": [
        {"rectangle": {"center": [5, 1.5], "size": [0.4, 3.1], "angle_rad": 0.1}},
        {"polygon": [[2, 4], [3.3, 4.1], [2.6, 5.7], [2.5, 4.6]]}]});
    let edge =
        json!({"op": "set-boundary", "boundary_m": [[0, 0], [10, 0], [10, 6], [4, 6.3], [0, 5]]});
    let kinds = [
        json!({"op": "set-robot", "name": "dog", "profile": "go2"}),
        json!({"op": "set-robot", "name": "tri", "profile": {"footprint": {"polygon": {
            "vertices_m": [[0.4, 0], [-0.2, 0.2], [-0.2, -0.2]]}}, "model": "unicycle-2"}}),
    ];
    let scatter =
        |robot: &str, seed: u64| json!({"op": "scatter", "count": 3, "robot": robot, "seed": seed});
    let cells = json!({"op": "replace", "document": {"name": "cells", "robots": {"robot": "agv"},
        "ground": {"map": {"rows": 9, "cols": 12, "cell_size_m": 0.7, "blocked": [14, 3, 40, 2, 52, 2, 80, 7]}}}});
    let lattice = json!({"op": "set-view", "roadmap": {"builder": "lattice", "side": 0.35, "directions": 16},
        "grid": {"connectivity": 8, "separation": "strict"}});
    let prm = json!({"op": "set-view", "roadmap": {"vertices": 150, "sampling": "halton", "spacing": 0.2,
        "speed": 0.5, "roadmap_seed": 12}});
    let seed = json!({"op": "set-seed", "seed": 77});
    vec![
        made(&[
            rooms.clone(),
            scatter("robot", 1),
            prm,
            json!({"op": "set-name", "name": "two rooms"}),
        ]),
        made(&[
            rooms,
            edge,
            kinds[0].clone(),
            kinds[1].clone(),
            scatter("dog", 2),
            scatter("tri", 3),
            scatter("robot", 4),
            json!({"op": "set-tolerances", "goal_tolerance_m": 0.123_456_789}),
            json!({"op": "set-view", "roadmap": {"builder": "prm-star", "vertices": 120}}),
            seed,
        ]),
        made(&[cells, lattice, scatter("robot", 5)]),
    ]
}

#[test]
fn digests_are_those_of_the_command() {
    for document in documents() {
        let artefacts = Artefacts::default();
        let yard = Yard::new();
        let place = Files::within(&yard.path("."), &document);
        write(&document, &place).unwrap();
        let task = place.task.file_name().unwrap().to_str().unwrap();
        let run = |line: &str| yard.line(line).expect(SUCCESS).json();
        let info = run(&format!("world info {task} --format json"));
        let whole = artefacts.whole(&document).unwrap();
        assert_eq!(whole.problems, []);
        assert_eq!(info["problem_digest"], json!(whole.digest));
        assert_eq!(
            info["world_digest"],
            json!(artefacts.world(&document).unwrap().digest)
        );
        let views = serde_json::to_value(document.views()).unwrap();
        let flags = |view: &Value| {
            let keys = view.as_object().unwrap().iter();
            let flags = keys.map(|(key, value)| {
                let value = value
                    .as_str()
                    .map_or_else(|| value.to_string(), str::to_owned);
                let flag = if key == "roadmap_seed" { "seed" } else { key };
                format!("--{flag} {value}")
            });
            flags.collect::<Vec<_>>().join(" ")
        };
        // Under its own name a grid would replace the map of the task.
        let grid = run(&format!(
            "world grid {task} {} --name view --format json",
            flags(&views["grid"])
        ));
        let view = artefacts.instance(&document).unwrap();
        assert_eq!(grid["instance_digest"], json!(view.instance.digest()));
        assert_eq!(grid["cell_m"], json!(view.cell_m));
        let roadmap = run(&format!(
            "world roadmap {task} {} --name view --format json",
            flags(&views["roadmap"])
        ));
        assert_eq!(
            roadmap["view_digest"],
            json!(artefacts.roadmap(&document).unwrap().digest())
        );
        if let Ground::Map { .. } = document.ground() {
            let map = place.ground.file_name().unwrap().to_str().unwrap();
            run(&format!("maps info {map} --format json"));
        }
    }
}

#[test]
fn problems_are_those_of_the_command() {
    let agents = |places: [[f64; 2]; 4]| {
        let [a, b, c, d] = places;
        json!({"op": "add-agents", "agents": [{"start": a, "goal": b}, {"start": c, "goal": d}]})
    };
    for places in [
        [[1.0, 1.0], [9.0, 5.0], [1.0, 0.1], [5.0, 5.0]],
        [[1.0, 1.0], [9.0, 5.0], [1.4, 1.0], [5.0, 5.0]],
        [[1.0, 1.0], [5.0, 1.5], [9.0, 5.0], [2.0, 2.0]],
    ] {
        let wall = json!({"op": "add-obstacles", "obstacles": [{"rectangle": {"center": [5, 1.5], "size": [0.4, 3]}}]});
        let document = made(&[wall, agents(places)]);
        let yard = Yard::new();
        let place = Files::within(&yard.path("."), &document);
        write(&document, &place).unwrap();
        let whole = Artefacts::default().whole(&document).unwrap();
        let [problem] = whole.problems.as_slice() else {
            panic!("{:?}", whole.problems)
        };
        let told = yard
            .line("world info untitled.task.json")
            .expect(INPUT)
            .stderr;
        assert!(
            told.contains(&problem.error) && told.contains(&problem.hint),
            "{told}\n{problem:?}"
        );
    }
}
