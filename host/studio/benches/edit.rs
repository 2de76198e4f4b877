//! Time from an edit to what a page shows of it. One of 2000 obstacles is moved in a world of 500 by
//! 500 cells with 100 robots: problems and digest, the grid with its instance, a roadmap of 2000 drawn
//! vertices, the verdict on a plan of 500 steps, and all of these one after the other.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

use std::hint::black_box;
use std::path::PathBuf;

use criterion::{Criterion, criterion_group, criterion_main};
use fleetyard_core::{GridPlan, PlanFile, write_plan};
use fleetyard_studio::artefacts::KeptPlan;
use fleetyard_studio::{Artefacts, Document, Edit, History};
use serde_json::{Value, json};

const SIDE_M: f64 = 250.0;
const ROBOTS: usize = 100;

/// Turned boxes in 40 rows and 50 columns, with a lane of 2.5 m below each row of them.
fn document() -> Document {
    let boxes = (0..2000_u32).map(|number| {
        let (row, col) = (f64::from(number / 50), f64::from(number % 50));
        let center = [5.0 * col + 2.5, 6.25 * row + 4.4];
        json!({"rectangle": {"center": center, "size": [2.0, 1.5], "angle_rad": 0.1 * f64::from(number % 7)}})
    });
    // Two and a half robots in each lane, from its left end to its right one.
    let agents = (0..ROBOTS).map(|number| {
        let y = 6.25 * (number * 40 / ROBOTS) as f64 + 0.25 + 0.5 * (number % 3) as f64;
        let y = (y / 0.5).floor() * 0.5 + 0.25;
        json!({"start": [0.25, y], "goal": [SIDE_M - 0.25, y]})
    });
    let operation = json!({"op": "replace", "document": {
        "ground": {"world": {"bounds_m": [0, 0, SIDE_M, SIDE_M], "obstacles": boxes.collect::<Vec<_>>()}},
        "robots": {"cart": {"footprint": {"disc": {"radius_m": 0.25}}, "model": "single-integrator"}},
        "agents": agents.collect::<Vec<_>>(),
        "views": {"roadmap": {"vertices": 2000}}}});
    let mut history = History::new(Document::default());
    history
        .edit(&Edit::read(operation).expect("an edit"))
        .expect("a document");
    history.document().clone()
}

/// Every robot goes straight along its lane.
fn plan(artefacts: &Artefacts, document: &Document) -> KeptPlan {
    let view = artefacts.instance(document).expect("a grid");
    let ends = view.instance.starts().iter().zip(view.instance.goals());
    let paths = ends.map(|(start, goal)| (*start..=*goal).collect::<Vec<u32>>());
    let plan = GridPlan::from_paths(paths.collect::<Vec<_>>());
    let file = write_plan(&PlanFile::new(&view.instance, plan));
    let plan = artefacts.plan(document, PathBuf::from("plan.json"), file);
    plan.expect("a plan")
}

/// A place for the first obstacle where it has never been.
fn operation(number: u32) -> Value {
    let center = [2.5 + 1e-4 * f64::from(number % 5000), 4.4];
    json!({"op": "set-obstacle", "index": 0, "obstacle":
        {"rectangle": {"center": center, "size": [2.0, 1.5], "angle_rad": 0.3}}})
}

fn edits(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("edit");
    group.sample_size(20);
    let artefacts = Artefacts::default();
    let first = document();
    let plan = plan(&artefacts, &first);
    artefacts.roadmap(&first).expect("a roadmap");
    let mut number = 0;
    let mut edited = move || {
        number += 1;
        let edit = Edit::read(operation(number)).expect("an edit");
        first.edited(&edit).expect("a document")
    };
    group.bench_function("document", |bencher| bencher.iter(&mut edited));
    let mut part = |name: &str, derive: &dyn Fn(&Document)| {
        group.bench_function(name, |bencher| {
            let prepared = || {
                let document = edited();
                artefacts.whole(&document).expect("a problem");
                document
            };
            let size = criterion::BatchSize::PerIteration;
            bencher.iter_batched(prepared, |document| derive(&document), size);
        });
    };
    part("grid", &|document| {
        black_box(artefacts.instance(document).expect("a grid"));
    });
    part("roadmap", &|document| {
        black_box(artefacts.roadmap(document).expect("a roadmap"));
    });
    part("grid and verdict", &|document| {
        let judged = artefacts.verdict(document, &plan, 100).expect("a verdict");
        assert!(judged.is_valid());
    });
    group.bench_function("problems", |bencher| {
        let size = criterion::BatchSize::PerIteration;
        bencher.iter_batched(
            &mut edited,
            |document| artefacts.whole(&document).expect("a problem").digest,
            size,
        );
    });
    group.bench_function("all", |bencher| {
        bencher.iter(|| {
            let document = edited();
            let whole = artefacts.whole(&document).expect("a problem");
            artefacts.roadmap(&document).expect("a roadmap");
            let judged = artefacts.verdict(&document, &plan, 100);
            assert!(judged.expect("a verdict").is_valid() && whole.problems.is_empty());
        });
    });
    group.finish();
}

criterion_group!(benches, edits);
criterion_main!(benches);
