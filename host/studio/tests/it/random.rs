//! Random edits, good and bad, and what holds for all of them.

use fleetyard_studio::files::{self, Files, Source};
use fleetyard_studio::{Artefacts, Document, History};
use proptest::prelude::*;
use serde_json::{Value, json};

use crate::{digest, edit};

fn place() -> impl Strategy<Value = Value> {
    let number = || prop_oneof![4 => (0..24u8).prop_map(|n| f64::from(n) * 0.5), 1 => -3.0..14.0];
    (
        number(),
        number(),
        proptest::option::weighted(0.3, -4.0..4.0f64),
    )
        .prop_map(|(x, y, heading)| match heading {
            Some(heading) => json!([x, y, heading]),
            None => json!([x, y]),
        })
}

fn name() -> impl Strategy<Value = String> {
    prop_oneof![4 => "robot|cart|a/b~c", 1 => "\\PC{0,8}", 1 => ".{0,3}"]
}

fn agent() -> impl Strategy<Value = Value> {
    (name(), place(), place())
        .prop_map(|(robot, start, goal)| json!({"robot": robot, "start": start, "goal": goal}))
}

fn corners(count: std::ops::Range<usize>) -> impl Strategy<Value = Vec<[f64; 2]>> {
    let corner = (0.0..12.0, 0.0..8.0).prop_map(|(x, y)| [x, y]);
    proptest::collection::vec(corner, count)
}

fn obstacle() -> impl Strategy<Value = Value> {
    let rectangle = (0.0..10.0, 0.0..6.0, 0.05..2.0, -0.2..2.0, 0.0..3.0).prop_map(
        |(x, y, width, height, angle)| json!({"rectangle": {"center": [x, y], "size": [width, height], "angle_rad": angle}}),
    );
    let polygon = corners(2..6).prop_map(|corners| json!({ "polygon": corners }));
    prop_oneof![3 => rectangle, 2 => polygon]
}

fn indices() -> impl Strategy<Value = Vec<usize>> {
    proptest::collection::vec(0..5usize, 0..3)
}

fn profile() -> impl Strategy<Value = Value> {
    let model = prop_oneof![Just("single-integrator"), Just("pebble"), Just("go2")];
    let disc = (-0.1..0.8, model).prop_map(
        |(radius, model)| json!({"footprint": {"disc": {"radius_m": radius}}, "model": model}),
    );
    let sides = (0.1..1.0, 0.1..1.0).prop_map(|(length, width)| {
        json!({"footprint": {"rectangle": {"length_m": length, "width_m": width}}, "model": "agv"})
    });
    prop_oneof![3 => disc, 2 => sides, 1 => Just(json!("spot")), 1 => Just(json!("nobody"))]
}

fn runs() -> impl Strategy<Value = Vec<u32>> {
    proptest::collection::vec(0..40u32, 0..5)
}

fn map() -> impl Strategy<Value = Value> {
    (1..9u32, 1..9u32, 0.2..2.0, runs()).prop_map(|(rows, cols, side, blocked)| {
        json!({"op": "replace", "document": {"name": "cells", "robots": {"robot": {
            "footprint": {"disc": {"radius_m": 0.4 * side}}, "model": "single-integrator"}},
            "ground": {"map": {"rows": rows, "cols": cols, "cell_size_m": side, "blocked": blocked}}}})
    })
}

fn view() -> impl Strategy<Value = Value> {
    let builder = prop_oneof![
        Just("prm"),
        Just("lattice"),
        Just("tangent"),
        Just("delaunay")
    ];
    (builder, 0..40usize, 0..9u32, proptest::option::of(0.3..2.0)).prop_map(
        |(builder, vertices, directions, side)| {
            json!({"op": "set-view", "roadmap":
                {"builder": builder, "vertices": vertices, "directions": directions, "side": side}})
        },
    )
}

fn one() -> impl Strategy<Value = Value> {
    let index = || 0..5usize;
    let world = prop_oneof![
        name().prop_map(|name| json!({"op": "set-name", "name": name})),
        proptest::array::uniform4(-2.0..12.0f64)
            .prop_map(|bounds| json!({"op": "set-bounds", "bounds_m": bounds})),
        corners(3..5).prop_map(|edge| json!({"op": "set-boundary", "boundary_m": edge})),
        proptest::collection::vec(obstacle(), 0..3)
            .prop_map(|obstacles| json!({"op": "add-obstacles", "obstacles": obstacles})),
        (index(), obstacle())
            .prop_map(|(at, one)| json!({"op": "set-obstacle", "index": at, "obstacle": one})),
        indices().prop_map(|indices| json!({"op": "remove-obstacles", "indices": indices})),
        (0.0..5.0, 0.0..5.0).prop_map(|(from, to)| json!({"op": "add-mover", "mover":
            {"footprint": {"disc": {"radius_m": 0.2}}, "knots": [[from, 1, 1, 0], [to, 2, 2, 0]]}})),
        indices().prop_map(|indices| json!({"op": "remove-movers", "indices": indices})),
    ];
    let cells = prop_oneof![
        map(),
        ("free|blocked|workstation|endpoint|wall", runs())
            .prop_map(|(paint, runs)| json!({"op": "paint", "as": paint, "runs": runs})),
        (0.0..3.0).prop_map(|side| json!({"op": "set-cell-size", "cell_size_m": side})),
        (0..9u32, 0..9u32)
            .prop_map(|(rows, cols)| json!({"op": "resize-map", "rows": rows, "cols": cols})),
    ];
    let robots = prop_oneof![
        (name(), profile()).prop_map(
            |(name, profile)| json!({"op": "set-robot", "name": name, "profile": profile})
        ),
        (name(), name())
            .prop_map(|(name, to)| json!({"op": "rename-robot", "name": name, "to": to})),
        name().prop_map(|name| json!({"op": "remove-robot", "name": name})),
    ];
    let agents = prop_oneof![
        proptest::collection::vec(agent(), 0..3)
            .prop_map(|agents| json!({"op": "add-agents", "agents": agents})),
        (index(), agent())
            .prop_map(|(at, agent)| json!({"op": "set-agent", "index": at, "agent": agent})),
        (indices(), proptest::collection::vec(agent(), 0..3)).prop_map(
            |(indices, agents)| json!({"op": "set-agents", "indices": indices, "agents": agents})
        ),
        indices().prop_map(|indices| json!({"op": "remove-agents", "indices": indices})),
        (0..6u32, any::<u64>(), any::<bool>()).prop_map(|(count, seed, replace)| {
            json!({"op": "scatter", "count": count, "seed": seed, "replace": replace})
        }),
        "grid|roadmap|continuous|plane".prop_map(|view| json!({"op": "snap", "view": view})),
    ];
    let others = prop_oneof![
        (-1.0..1.0).prop_map(|most| json!({"op": "set-tolerances", "goal_tolerance_m": most})),
        any::<u64>().prop_map(|seed| json!({"op": "set-seed", "seed": seed})),
        view(),
        Just(json!({"op": "paint"})),
        Just(json!({"op": "nothing"})),
        Just(json!([])),
    ];
    prop_oneof![3 => world, 3 => cells, 2 => robots, 4 => agents, 2 => others]
}

fn any_edit() -> impl Strategy<Value = Value> {
    let batch = proptest::collection::vec(one(), 0..4)
        .prop_map(|ops| json!({"op": "batch", "name": "several", "ops": ops}));
    prop_oneof![8 => one(), 1 => batch]
}

/// Some good documents to begin with.
fn first() -> impl Strategy<Value = Value> {
    let room = json!({"op": "batch", "name": "room", "ops": [
        {"op": "set-robot", "name": "cart", "profile": "agv"},
        {"op": "add-obstacles", "obstacles": [{"rectangle": {"center": [5, 1.5], "size": [0.4, 3]}}]},
        {"op": "scatter", "count": 4, "seed": 3}]});
    prop_oneof![Just(room), map()]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, max_shrink_iters: 300, ..ProptestConfig::default() })]

    /// No edit panics, a refusal changes nothing and says where and what to do, the history goes back to
    /// the first document and forth to the last one, and what is written is read as the same.
    #[test]
    fn edits_can_be_taken_back_and_made_again(
        first in first(), edits in proptest::collection::vec(any_edit(), 1..14),
    ) {
        let mut history = History::new(Document::default());
        let begin = history.document().clone();
        let mut made = 0;
        for operation in [first].into_iter().chain(edits) {
            let (before, version) = (history.document().clone(), history.version());
            match edit(&mut history, operation.clone()) {
                Ok(()) => {
                    made += 1;
                    prop_assert_eq!(history.version(), version + 1);
                    prop_assert!(history.undoable().is_some() && history.redoable().is_none());
                }
                Err(refusal) => {
                    prop_assert_eq!(history.document(), &before);
                    prop_assert_eq!(history.version(), version);
                    prop_assert!(refusal.place.starts_with('/'), "{} {:?}", operation, refusal);
                    prop_assert!(!refusal.error.is_empty() && !refusal.hint.is_empty());
                }
            }
            let now = history.document();
            let json = serde_json::to_value(now).unwrap();
            let again = Document::read(json.clone(), "").unwrap();
            prop_assert_eq!(serde_json::to_value(&again).unwrap(), json);
            prop_assert_eq!(digest(&again), digest(now));
        }
        let last = history.document().clone();
        for _ in 0..made {
            prop_assert!(history.undo());
        }
        prop_assert!(!history.undo());
        prop_assert_eq!(history.document(), &begin);
        for _ in 0..made {
            prop_assert!(history.redo());
        }
        prop_assert!(!history.redo());
        prop_assert_eq!(history.document(), &last);
    }

    /// The files of a document make the same document again, whoever reads them.
    #[test]
    fn files_of_a_document_are_the_same_document(
        first in first(), edits in proptest::collection::vec(any_edit(), 0..8),
    ) {
        let mut history = History::new(Document::default());
        for operation in [first].into_iter().chain(edits) {
            let _ = edit(&mut history, operation);
        }
        let document = history.document();
        let folder = tempfile::tempdir().unwrap();
        let place = Files::within(folder.path(), document);
        let written = files::write(document, &place);
        prop_assert_eq!(written.is_err(), document.agents().is_empty());
        if written.is_ok() {
            let source = Source::load(&place.task).unwrap();
            let opened = files::open(&[source], &Document::default()).unwrap();
            prop_assert_eq!(digest(&opened.document), digest(document));
            prop_assert_eq!(opened.files, Some(place));
            let artefacts = Artefacts::default();
            let world = |document: &Document| artefacts.world(document).unwrap().digest;
            prop_assert_eq!(world(&opened.document), world(document));
        }
    }
}
