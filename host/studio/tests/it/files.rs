//! Files that are opened, and files that are written.

use std::path::PathBuf;
use std::sync::Arc;

use fleetyard_core::formats::{Contents, Known, write_lsmart};
use fleetyard_core::{Connectivity, GridInstance, Scenario, read_map, read_scen, write_scen};
use fleetyard_studio::document::Ground;
use fleetyard_studio::files::{Kind, Opened, Source, export, exports, open};
use fleetyard_studio::{Artefacts, Document};
use fleetyard_views::load_problem;
use serde_json::json;

use crate::{digest, made};

fn maps(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
        .join("../../maps")
        .join(name)
}

fn sent(name: &str, bytes: impl Into<Vec<u8>>) -> Source {
    Source {
        name: name.into(),
        bytes: bytes.into(),
        folder: None,
    }
}

fn opened(sources: &[Source]) -> Opened {
    open(sources, &Document::default()).unwrap()
}

#[test]
fn tasks_of_the_repository_are_opened() {
    for name in [
        "two-rooms.task.json",
        "window.task.json",
        "maze.task.json",
        "floor.task.json",
    ] {
        let Opened {
            document,
            notes,
            files,
        } = opened(&[Source::load(&maps(name)).unwrap()]);
        let problem = load_problem(maps(name)).unwrap();
        assert_eq!(digest(&document), problem.digest(), "{name}");
        assert!(notes.is_empty(), "{notes:?}");
        let files = files.unwrap();
        assert_eq!(files.task, maps(name));
        assert!(files.ground.is_file());
    }
}

/// A page sends the files themselves: together, or the ground first.
#[test]
fn tasks_are_opened_with_their_ground() {
    let load = |name: &str| sent(name, std::fs::read(maps(name)).unwrap());
    let (task, world) = (load("window.task.json"), load("window.world.json"));
    let both = opened(&[task.clone(), world.clone()]);
    let problem = load_problem(maps("window.task.json")).unwrap();
    assert_eq!(digest(&both.document), problem.digest());
    assert_eq!(both.files, None);
    let ground = opened(&[world]).document;
    let then = open(std::slice::from_ref(&task), &ground).unwrap().document;
    assert_eq!(digest(&then), problem.digest());
    let map = made(&[json!({"op": "replace", "document": {
        "ground": {"map": {"rows": 1, "cols": 1, "cell_size_m": 1.0}}, "robots": {"a": "agv"}}})]);
    let error = open(&[task], &map).unwrap_err();
    assert_eq!(
        error.reason,
        "the task names window.world.json, which is not here"
    );
}

/// A map and a scenario become a document whose grid view is their instance.
#[test]
fn a_benchmark_is_its_own_grid_view() {
    let bytes = |name: &str| std::fs::read(maps(name)).unwrap();
    let (map, scen) = ("random-32-32-20.map", "random-32-32-20-random-1.scen");
    let both = [sent(map, bytes(map)), sent(scen, bytes(scen))];
    let Opened {
        document, notes, ..
    } = opened(&both);
    let grid = Arc::new(read_map(map, &bytes(map)).unwrap());
    let scenario = read_scen(scen, &bytes(scen)).unwrap();
    let agents = scenario.entries.len();
    let instance = scenario.instance(grid, agents, Connectivity::Four).unwrap();
    let artefacts = Artefacts::default();
    let view = artefacts.instance(&document).unwrap();
    assert_eq!(view.instance.digest(), instance.digest(), "{notes:?}");
    // The scenario alone goes onto the map that is open.
    let ground = opened(&both[..1]).document;
    assert!(ground.agents().is_empty());
    let then = open(&both[1..], &ground).unwrap().document;
    assert_eq!(digest(&then), digest(&document));
    // Of a list with an agent too many the others are used.
    let mut long = scenario;
    long.entries.push(long.entries[0].clone());
    let Opened {
        document: cut,
        notes,
        ..
    } = open(&[sent(scen, write_scen(&long))], &ground).unwrap();
    assert_eq!(digest(&cut), digest(&document));
    assert!(notes[0].starts_with(&format!(
        "the first {agents} of {} agents are used",
        agents + 1
    )));
}

#[test]
fn other_formats_are_opened() {
    let map = "type octile\nheight 2\nwidth 3\nmap\n.@.\new.\n";
    let grid = Arc::new(read_map("a.map", map.as_bytes()).unwrap());
    let plain = opened(&[sent("a.map", map)]).document;
    let lsmart = opened(&[sent("a.json", write_lsmart(&grid))]).document;
    assert_eq!(
        serde_json::to_value(lsmart.ground()).unwrap(),
        serde_json::to_value(plain.ground()).unwrap()
    );
    let one_way =
        r#"{"format": "fleetyard.grid/1", "terrain": ["..", ".."], "moves": ["24", "18"]}"#;
    let Opened {
        document, notes, ..
    } = opened(&[sent("ring.map", one_way)]);
    assert!(matches!(document.ground(), Ground::Map { grid, .. } if !grid.has_move_masks()));
    assert_eq!(notes.len(), 1);
    let yaml = "map:\n  dimensions: [3, 2]\n  obstacles: [[1, 0]]\nagents:\n- start: [0, 0]\n  goal: [2, 1]\n  name: agent0\n";
    assert_eq!(opened(&[sent("a.yaml", yaml)]).document.agents().len(), 1);
}

#[test]
fn what_is_no_document_is_refused() {
    let world = r#"{"format": "fleetyard.world/1", "bounds_m": [0, 0, 4, 4]}"#;
    let plan = r#"{"format": "fleetyard.plan/1", "rows": 1, "cols": 1, "paths": [[[0, 0]]]}"#;
    let roadmap = r#"{"format": "fleetyard.roadmap/1", "vertices": [[0, 0]], "edges": []}"#;
    let league = r#"{"mapFile": "/etc/passwd", "agentFile": "b", "taskFile": "c", "teamSize": 1}"#;
    let map = "type octile\nheight 1\nwidth 1\nmap\n.\n";
    let scen = "version 1\n0\ta.map\t1\t1\t0\t0\t0\t0\t0\n";
    for (sources, told) in [
        (vec![sent("a", "")], "the file is empty"),
        (
            vec![sent("a", "hello")],
            "this is in no format that is known",
        ),
        (
            vec![sent("a.json", plan)],
            "this is a plan, and no piece of ground",
        ),
        (
            vec![sent("a.json", roadmap)],
            "this is a roadmap, and no piece of ground",
        ),
        (
            vec![sent("a.json", league)],
            "the map is in another file, which is not here",
        ),
        (
            vec![sent("a.scen", scen)],
            "there is no piece of ground in this file",
        ),
        (
            vec![sent("a.json", world), sent("b.json", world)],
            "there is another file with the same content",
        ),
        (
            vec![sent("a.json", world), sent("b.map", map)],
            "there is another file with the same content",
        ),
    ] {
        let error = open(&sources, &Document::default()).unwrap_err();
        assert_eq!(error.reason, told, "{sources:?}");
    }
    assert!(Kind::of("a.json", plan.as_bytes()).unwrap().is_plan());
    assert!(!Kind::of("a.json", world.as_bytes()).unwrap().is_plan());
}

/// Every form is written, and those that have all of a document's ground are read as the same.
#[test]
fn every_form_is_written() {
    let artefacts = Artefacts::default();
    let world = made(&[
        json!({"op": "set-name", "name": "two rooms, 3"}),
        json!({"op": "add-obstacles", "obstacles": [{"rectangle": {"center": [5, 1.5], "size": [0.4, 3]}}]}),
        json!({"op": "scatter", "count": 5}),
        json!({"op": "set-view", "roadmap": {"vertices": 60}}),
    ]);
    let (map, scen) = ("empty-16-16.map", "empty-16-16-random-1.scen");
    let cells =
        opened(&[map, scen].map(|name| sent(name, std::fs::read(maps(name)).unwrap()))).document;
    for document in [&world, &cells] {
        for (form, _) in exports() {
            let written = export(document, &artefacts, form);
            let written = written.unwrap_or_else(|error| panic!("{form}: {error}"));
            let name = written.name.as_str();
            let mut sources = vec![sent(name, written.bytes.clone())];
            sources.extend(
                written
                    .others
                    .iter()
                    .map(|(name, bytes)| sent(name, bytes.clone())),
            );
            if form == "task" {
                assert_eq!(
                    digest(&opened(&sources).document),
                    digest(document),
                    "{name}"
                );
            }
            if form == "world" {
                let again = opened(&sources).document;
                let digest = |document: &Document| artefacts.world(document).unwrap().digest;
                assert_eq!(digest(&again), digest(document));
            }
            if form == "scen" {
                let again = artefacts.instance(&opened(&sources).document).unwrap();
                let own: &GridInstance = &artefacts.instance(document).unwrap().instance;
                assert_eq!(again.instance.digest(), own.digest(), "{name}");
            }
        }
    }
    let task = export(&world, &artefacts, "task").unwrap();
    assert_eq!(
        (task.name.as_str(), task.others[0].0.as_str()),
        ("two-rooms-3.task.json", "two-rooms-3.world.json")
    );
    let error = export(&world, &artefacts, "plan").unwrap_err();
    assert!(
        error
            .hint
            .unwrap()
            .starts_with("forms are task, world, grid-view, roadmap-view, map, grid, lsmart")
    );
    let error = export(&Document::default(), &artefacts, "task").unwrap_err();
    assert_eq!(error.reason, "there are no agents");
    // Files of the League name each other.
    let league = export(&cells, &artefacts, "lorr").unwrap();
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join(&league.name), &league.bytes).unwrap();
    for (name, bytes) in &league.others {
        std::fs::write(folder.path().join(name), bytes).unwrap();
    }
    let source = Source::load(&folder.path().join(&league.name)).unwrap();
    let league_path = folder.path().join(&league.name);
    let contents = Contents::load(&league_path, None, Known::default()).unwrap();
    assert_eq!(
        opened(&[source]).document.agents().len(),
        contents.agents.unwrap().agents.len()
    );
    assert!(
        Scenario::of(contents.grid.as_ref().unwrap(), "a.map", [])
            .entries
            .is_empty()
    );
}
