//! How many simulated seconds a second of wall time buys: "elem/s" is the
//! real-time factor. Random walks that obey the rules, on the large warehouse
//! of the League of Robot Runners if FLEETYARD_DATA names a folder that has it,
//! else on a generated warehouse of the same size.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

#[path = "../tests/common/mod.rs"]
mod common;

use std::hint::black_box;
use std::path::Path;

use criterion::{
    BenchmarkGroup, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main,
    measurement::WallTime,
};
use fleetyard_core::{Grid, GridPlan, load_map};
use fleetyard_sim::{NoTrace, SimConfig, Simulator, Tier, TraceWriter};

/// Steps of the plan, one second each.
const STEPS: usize = 60;

fn warehouse() -> Grid {
    let file = "lorr/warehouse.domain/maps/warehouse_long_corridor_large.map";
    let public = std::env::var_os("FLEETYARD_DATA")
        .and_then(|folder| load_map(Path::new(&folder).join(file)).ok());
    public.unwrap_or_else(|| {
        // Shelves of ten by two cells with aisles between them.
        let (rows, cols) = (140, 540);
        let terrain = (0..rows * cols)
            .map(|cell| {
                let (row, col) = (cell / cols, cell % cols);
                let shelf = row % 3 != 0 && col % 11 != 0 && (10..530).contains(&col);
                if shelf { b'@' } else { b'.' }
            })
            .collect();
        Grid::new("warehouse", rows, cols, terrain).expect("a valid map")
    })
}

fn bench(
    group: &mut BenchmarkGroup<'_, WallTime>,
    name: &str,
    grid: &Grid,
    plan: &GridPlan,
    config: &SimConfig,
) {
    let id = BenchmarkId::new(name, plan.agents());
    group.throughput(Throughput::Elements(plan.horizon() as u64));
    group.bench_function(id, |bencher| {
        bencher.iter(|| {
            Simulator::new(config)
                .on_grid(grid)
                .run(black_box(plan), &mut NoTrace)
        });
    });
}

fn throughput(criterion: &mut Criterion) {
    let grid = warehouse();
    let mut group = criterion.benchmark_group(grid.name());
    group.sample_size(10);
    for agents in [100, 550, 1000, 2500, 10_000] {
        let mut rng = common::rng(agents as u64);
        let plan = common::valid_walks(&mut rng, &grid, agents, STEPS);
        let kinematic = SimConfig::default();
        bench(&mut group, "kinematic", &grid, &plan, &kinematic);
        let substeps = SimConfig {
            every_substep: true,
            ..kinematic.clone()
        };
        bench(
            &mut group,
            "kinematic, every substep",
            &grid,
            &plan,
            &substeps,
        );
        if agents <= 2500 {
            let brief = GridPlan::from_paths(plan.paths().map(|path| &path[..=5]));
            let contact = SimConfig {
                tier: Tier::Contact,
                ..kinematic.clone()
            };
            bench(&mut group, "contact", &grid, &brief, &contact);
        }
        group.throughput(Throughput::Elements(STEPS as u64));
        group.bench_function(
            BenchmarkId::new("kinematic, all states traced", agents),
            |b| {
                b.iter(|| {
                    let mut sink = TraceWriter::new(std::io::sink(), 1);
                    Simulator::new(&kinematic)
                        .on_grid(&grid)
                        .run(black_box(&plan), &mut sink)
                });
            },
        );
    }
    group.finish();
}

criterion_group!(benches, throughput);
criterion_main!(benches);
