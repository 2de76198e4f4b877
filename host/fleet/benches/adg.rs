//! The action dependency graph of 10,000 robots: appending, cutting, a block of time, the
//! check for cycles, judging, goals.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

#[path = "../tests/it/walks/mod.rs"]
mod walks;

use std::hint::black_box;

use criterion::{BatchSize, Criterion, criterion_group, criterion_main};
use fleetyard_abi::Instance;
use fleetyard_core::GridPlan;
use fleetyard_fleet::adg::{Adg, Costs};
use fleetyard_fleet::assign::{Assigner, Source};
use fleetyard_fleet::batch::judge;
use fleetyard_world::WarehouseSpec;
use walks::{Walks, north};

const AGENTS: usize = 10_000;
const STEPS: usize = 10;
const QUEUE: u32 = 5;

fn bench(criterion: &mut Criterion) {
    let spec = WarehouseSpec {
        blocks_across: 20,
        blocks_down: 40,
        block_cols: 10,
        block_rows: 2,
        aisle: 2,
        ..WarehouseSpec::default()
    };
    let grid = spec.generate().expect("the warehouse is fine");
    let mut assigner = Assigner::new(&grid, Source::Random, AGENTS, 1).expect("there is room");
    let starts = assigner.starts();
    let mut walks = Walks::new(grid.clone(), 1);
    let adg = Adg::new(&grid, &starts, &north(AGENTS), Costs::default()).expect("a graph");

    let long = walks.plan(&starts, 2 * STEPS);
    let instance = Instance::one_shot(starts.clone(), starts.clone());
    criterion.bench_function("judge 10000 agents x 20 steps", |bencher| {
        bencher.iter_batched(
            || long.clone(),
            |plan: GridPlan| judge(&grid, black_box(&instance), plan),
            BatchSize::LargeInput,
        );
    });

    let batch = walks.batch(&starts, STEPS, 0);
    let nodes = adg
        .clone()
        .append(&batch, &mut |agent, index| assigner.goal(agent, index))
        .expect("it fits")
        .nodes;
    criterion.bench_function("append 10000 agents x 10 steps", |bencher| {
        bencher.iter_batched_ref(
            || adg.clone(),
            |adg| adg.append(&batch, &mut |agent, index| assigner.goal(agent, index)),
            BatchSize::LargeInput,
        );
    });

    // A second of simulated time is ten blocks; robots do two nodes in it.
    let mut running = adg.clone();
    let mut pending = Vec::new();
    let mut done = vec![0; AGENTS];
    for round in 0..20 {
        let ends: Vec<u32> = (0..AGENTS).map(|agent| running.end(agent)).collect();
        let batch = walks.batch(&ends, STEPS, 0);
        running
            .append(&batch, &mut |agent, index| assigner.goal(agent, index))
            .expect("it fits");
        for block in 0..20 {
            running.enqueue(QUEUE, &mut |_, _| {});
            report(&mut running, &mut done, round * 20 + block);
        }
        pending.push(running.pending());
        if round < 19 {
            running.cut(10);
        }
    }
    eprintln!(
        "{nodes} nodes in a batch; {:?} pending, {} bytes",
        pending.last(),
        running.memory_bytes()
    );
    criterion.bench_function("a block of 10000 agents, 2000 done", |bencher| {
        let mut block = 0;
        bencher.iter_batched_ref(
            || (running.clone(), done.clone()),
            |(running, done)| {
                block += 1;
                report(running, done, block);
                let mut told = 0;
                running.enqueue(QUEUE, &mut |_, _| told += 1);
                told
            },
            BatchSize::LargeInput,
        );
    });
    criterion.bench_function("cut of 10000 agents", |bencher| {
        bencher.iter_batched_ref(|| running.clone(), |adg| adg.cut(10), BatchSize::LargeInput);
    });
    criterion.bench_function("is_acyclic of 10000 agents", |bencher| {
        bencher.iter(|| black_box(&running).is_acyclic());
    });
    criterion.bench_function("upcoming goals of 10000 agents, window 20", |bencher| {
        let next = vec![0; AGENTS];
        bencher.iter(|| assigner.upcoming(black_box(&starts), &next, 20));
    });
}

/// A fifth of the robots has done one node more.
fn report(adg: &mut Adg, done: &mut [u32], block: usize) {
    for agent in (block % 5..AGENTS).step_by(5) {
        let (_, enqueued) = adg.progress(agent);
        if done[agent] < enqueued {
            done[agent] += 1;
            adg.complete(agent, done[agent], done[agent], &mut |_| {});
        }
    }
}

criterion_group!(benches, bench);
criterion_main!(benches);
