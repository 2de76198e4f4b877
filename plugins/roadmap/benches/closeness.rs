//! Time for the conflict intervals of all pairs of edges of a roadmap: of the benchmark's `dense` (900 vertices) and
//! `superdense` (4000) where `FLEETYARD_DATA` has them, and of drawn roadmaps of the same sizes.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

#[path = "../../bundle/tests/it/roadmap/support.rs"]
mod support;

use std::env;
use std::hint::black_box;
use std::path::Path;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_roadmap::closeness::Closeness;
use fleetyard_plugin_roadmap::roadmap::{Roadmap, Vertex};
use fleetyard_plugin_spacetime::random::Random;

/// Radius of a disc, in metres.
const RADIUS_M: f64 = 0.353_554;

/// Places drawn in a square of 32 m, each joined with its nearest ones.
fn drawn(vertices: usize, neighbors: usize) -> Roadmap {
    let mut random = Random::new(1, 0);
    let mut coordinate = || 32.0 * random.below(1 << 20) as f64 / f64::from(1 << 20);
    let places: Vec<Vector> = (0..vertices)
        .map(|_| Vector::new(coordinate(), coordinate()))
        .collect();
    let mut edges = std::collections::BTreeMap::new();
    for (from, place) in places.iter().enumerate() {
        let mut near: Vec<(f64, usize)> = places
            .iter()
            .enumerate()
            .filter(|(to, _)| *to != from)
            .map(|(to, other)| ((other - place).norm(), to))
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (length, to) in near.into_iter().take(neighbors) {
            let [from, to] = [from, to].map(|vertex| vertex as Vertex);
            edges.insert((from, to), length);
            edges.insert((to, from), length);
        }
    }
    let edges = edges
        .into_iter()
        .map(|((from, to), length)| (from, to, length));
    Roadmap::new(places, edges, 2.0 * RADIUS_M).expect("a roadmap")
}

fn closeness(c: &mut Criterion) {
    let mut roadmaps = vec![
        ("drawn, 900 vertices".to_owned(), drawn(900, 9)),
        ("drawn, 4000 vertices".to_owned(), drawn(4000, 14)),
    ];
    if let Some(data) = env::var_os("FLEETYARD_DATA") {
        for density in ["dense", "superdense"] {
            let name = format!("boxes-32-{density}");
            let tasks = format!("continuous/roadmap-tasks/{name}-1.tasks.json");
            let case = support::Case::read(&Path::new(&data).join(tasks), 0).expect("a roadmap");
            roadmaps.push((name, case.roadmap));
        }
    }
    let mut group = c.benchmark_group("conflict intervals");
    group
        .sample_size(10)
        .measurement_time(Duration::from_secs(3));
    for (name, roadmap) in &roadmaps {
        group.bench_function(BenchmarkId::from_parameter(name), |b| {
            b.iter(|| {
                let closeness = Closeness::new(black_box(roadmap).clone());
                closeness.annotate();
                closeness
            });
        });
    }
    group.finish();
}

criterion_group!(benches, closeness);
criterion_main!(benches);
