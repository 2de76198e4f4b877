//! Validating and measuring the plan of a large team: 1000 agents, 200 steps; and
//! the lower bounds of 1000 agents in a large warehouse.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use fleetyard_check::{metrics, validate};
use fleetyard_core::{Connectivity, Grid, GridInstance, GridPlan};
use fleetyard_world::{ScenarioSpec, WarehouseSpec};

/// Agents go round rings of ten cells' perimeter without ever meeting.
fn rings(agents: u32, steps: usize, rows: u32, cols: u32) -> (GridInstance, GridPlan) {
    let grid = Grid::new("rings", rows, cols, vec![b'.'; (rows * cols) as usize])
        .expect("the size is fine");
    let ring: Vec<(u32, u32)> = (0..4)
        .map(|col| (0, col))
        .chain((0..4).rev().map(|col| (1, col)))
        .collect();
    let per_row = cols / 4;
    let paths: Vec<Vec<u32>> = (0..agents)
        .map(|agent| {
            // Four agents share a ring, two cells apart.
            let (block, phase) = (agent / 4, (agent % 4) as usize * 2);
            let (row, col) = (block / per_row * 2, block % per_row * 4);
            (0..=steps)
                .map(|time| {
                    let (dr, dc) = ring[(time + phase) % ring.len()];
                    (row + dr) * cols + col + dc
                })
                .collect()
        })
        .collect();
    let starts = paths.iter().map(|path| path[0]).collect();
    let goals = paths.iter().map(|path| path[steps]).collect();
    let instance = GridInstance::new(Arc::new(grid), Connectivity::Four, starts, goals)
        .expect("starts and goals are distinct");
    (instance, GridPlan::from_paths(paths))
}

fn bench(criterion: &mut Criterion) {
    let (instance, plan) = rings(1000, 200, 140, 500);
    assert!(validate(&instance, &plan, 10).valid);
    criterion.bench_function(
        "validate 1000 agents x 200 steps, 140 x 500 cells",
        |bencher| {
            bencher.iter(|| validate(black_box(&instance), black_box(&plan), 100));
        },
    );
    criterion.bench_function(
        "metrics 1000 agents x 200 steps, 140 x 500 cells",
        |bencher| {
            bencher.iter(|| metrics(black_box(&instance), black_box(&plan), 1.0));
        },
    );

    let spec = WarehouseSpec {
        blocks_across: 20,
        blocks_down: 40,
        block_cols: 10,
        block_rows: 2,
        aisle: 2,
        ..WarehouseSpec::default()
    };
    let grid = Arc::new(spec.generate().expect("the warehouse is fine"));
    let agents = 1000;
    let scenario = ScenarioSpec { agents, seed: 1 }
        .generate(&grid)
        .expect("there is room");
    for connectivity in [Connectivity::Four, Connectivity::Eight] {
        let instance = scenario
            .instance(Arc::clone(&grid), agents as usize, connectivity)
            .expect("the scenario is fine");
        let plan = GridPlan::from_paths(instance.starts().iter().map(|start| [*start]));
        let degree = connectivity.degree();
        let name = format!("lower bounds of 1000 agents, 164 x 340 cells, {degree}-connected");
        criterion.bench_function(&name, |bencher| {
            bencher.iter(|| metrics(black_box(&instance), black_box(&plan), 1.0));
        });
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
