//! Time of the operators, in processor time of the process, so that other work of the machine counts
//! less. The world is a hall of 48 by 48 m with turned boxes, four corners each, whose robots start
//! at its left edge and go to its right one.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

use std::fmt::Write as _;
use std::hint::black_box;
use std::time::Duration;

use criterion::measurement::{Measurement, ValueFormatter, WallTime};
use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use fleetyard_core::{Connectivity, Grid, Separation};
use fleetyard_views::{
    Builder, GridSpec, OverlaySpec, Problem, RoadmapSpec, Sampling, grid_to_roadmap, grid_to_world,
    load_problem, roadmap_to_grid, roadmap_to_world, world_to_grid, world_to_roadmap,
};
use fleetyard_world::SeededRandom;
use rustix::time::{ClockId, clock_gettime};

/// Processor time of this process, shown as criterion shows wall time.
struct Processor;

fn processor_time() -> Duration {
    let time = clock_gettime(ClockId::ProcessCPUTime);
    let [seconds, nanos] = [time.tv_sec, time.tv_nsec].map(|part| u64::try_from(part).unwrap_or(0));
    Duration::from_secs(seconds) + Duration::from_nanos(nanos)
}

impl Measurement for Processor {
    type Intermediate = Duration;
    type Value = Duration;

    fn start(&self) -> Duration {
        processor_time()
    }

    fn end(&self, start: Duration) -> Duration {
        processor_time().saturating_sub(start)
    }

    fn add(&self, a: &Duration, b: &Duration) -> Duration {
        *a + *b
    }

    fn zero(&self) -> Duration {
        Duration::ZERO
    }

    fn to_f64(&self, value: &Duration) -> f64 {
        WallTime.to_f64(value)
    }

    fn formatter(&self) -> &dyn ValueFormatter {
        WallTime.formatter()
    }
}

/// A task with so many corners of obstacles and robots.
fn problem(corners: usize, robots: usize) -> Problem {
    const SIDE_M: f64 = 48.0;
    let mut random = SeededRandom::new("views bench", 1);
    let boxes = corners / 4;
    let across = (boxes as f64).sqrt().ceil();
    let pitch = (SIDE_M - 4.0) / across;
    let mut obstacles = Vec::new();
    for number in 0..boxes {
        let (row, col) = (number as f64 / across, number as f64 % across);
        let [x, y] = [col.floor(), row.floor()].map(|at| 2.0 + (at + 0.5) * pitch);
        let [width, height, turn] = [0.4, 0.4, 3.0].map(|most| most * (0.25 + random.unit()));
        let scale = (pitch / 2.75).min(1.0);
        obstacles.push(format!(
            r#"{{"rectangle": {{"center": [{x}, {y}], "size": [{}, {}], "angle_rad": {turn}}}}}"#,
            width * scale,
            height * scale,
        ));
    }
    let mut agents = String::new();
    for number in 0..robots {
        let y = (number as f64 + 0.5) * SIDE_M / robots as f64;
        let comma = if number == 0 { "" } else { "," };
        let _ = write!(
            agents,
            r#"{comma}{{"start": [0.5, {y}], "goal": [{}, {y}]}}"#,
            SIDE_M - 0.5,
        );
    }
    let folder = tempfile::tempdir().expect("a folder");
    let world = format!(
        r#"{{"format": "fleetyard.world/1", "bounds_m": [0, 0, {SIDE_M}, {SIDE_M}], "obstacles": [{}]}}"#,
        obstacles.join(","),
    );
    let task = format!(
        r#"{{"format": "fleetyard.task/1", "world": "w.json", "seed": 1, "robots": {{"disc": {{
        "footprint": {{"disc": {{"radius_m": 0.08}}}}, "model": {{"single-integrator": {{"speed_m_per_s": 1}}}}}}}},
        "agents": [{agents}]}}"#,
    );
    let file = folder.path().join("t.task.json");
    std::fs::write(folder.path().join("w.json"), world)
        .and_then(|()| std::fs::write(&file, task))
        .expect("files");
    load_problem(&file).expect("a task")
}

fn prm(vertices: usize) -> RoadmapSpec {
    RoadmapSpec::new(Builder::Prm {
        sampling: Sampling::Uniform,
        vertices,
        neighbors: 9,
    })
}

const SPEC: GridSpec = GridSpec {
    connectivity: Connectivity::Four,
    separation: Separation::Rules,
};

fn worlds(c: &mut Criterion<Processor>) {
    let mut group = c.benchmark_group("views");
    for (corners, robots) in [(1000, 50), (4000, 50), (16_000, 50), (1000, 200)] {
        let problem = problem(corners, robots);
        let name = format!("{corners} corners, {robots} robots");
        group.bench_function(BenchmarkId::new("grid", &name), |b| {
            b.iter(|| world_to_grid(black_box(&problem), SPEC).expect("a grid"));
        });
        group.bench_function(BenchmarkId::new("roadmap of 1000", &name), |b| {
            b.iter(|| world_to_roadmap(black_box(&problem), prm(1000)).expect("a roadmap"));
        });
    }
    let problem = problem(1000, 50);
    for vertices in [1000, 3000, 10_000] {
        group.bench_function(BenchmarkId::new("roadmap", vertices), |b| {
            b.iter(|| world_to_roadmap(black_box(&problem), prm(vertices)).expect("a roadmap"));
        });
        let roadmap = world_to_roadmap(&problem, prm(vertices))
            .expect("a roadmap")
            .roadmap;
        group.bench_function(BenchmarkId::new("roadmap to grid", vertices), |b| {
            let spec = OverlaySpec {
                grid: GridSpec {
                    connectivity: Connectivity::Eight,
                    ..SPEC
                },
                cell_m: Some(0.1),
            };
            b.iter(|| roadmap_to_grid(black_box(&problem), &roadmap, spec).expect("a grid"));
        });
        group.bench_function(BenchmarkId::new("roadmap to world", vertices), |b| {
            b.iter(|| roadmap_to_world(black_box(&problem), &roadmap).expect("a check"));
        });
    }
    group.finish();
}

fn maps(c: &mut Criterion<Processor>) {
    let mut group = c.benchmark_group("maps");
    for side in [250, 500, 1000] {
        let mut random = SeededRandom::new("views bench", 2);
        let letters = (0..side * side).map(|_| if random.unit() < 0.2 { b'@' } else { b'.' });
        let grid = Grid::new("random", side, side, letters.collect()).expect("a map");
        group.bench_function(BenchmarkId::new("grid to world", side), |b| {
            b.iter(|| grid_to_world(black_box(&grid), 1.0, [0.0, 0.0]).expect("a world"));
        });
        group.bench_function(BenchmarkId::new("grid to roadmap", side), |b| {
            let four = Connectivity::Four;
            b.iter(|| grid_to_roadmap(black_box(&grid), four, 1.0, [0.0, 0.0]).expect("a roadmap"));
        });
    }
    group.finish();
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .with_measurement(Processor)
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1));
    targets = worlds, maps
}
criterion_main!(benches);
