//! Time of a call: complete plans, and windows of a fleet in an open warehouse.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use fleetyard_abi::{Goals, GridEnvironment, Instance};
use fleetyard_plugin_priority::Control;
use fleetyard_plugin_priority::prioritized;
use fleetyard_plugin_priority::search;
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem};
use fleetyard_plugin_spacetime::random::Random;

/// Shelves of ten cells in rows, aisles of one cell between them.
fn warehouse(agents: usize, goals: usize, window: u32) -> Problem {
    let (rows, cols) = (33_u32, 36_u32);
    let shelf = |cell: u32| {
        let (row, col) = (cell / cols, cell % cols);
        row % 4 == 2 && (2..34).contains(&col) && (col - 2) % 11 != 10
    };
    let passable: Vec<u8> = (0..rows * cols).map(|c| u8::from(!shelf(c))).collect();
    let environment = GridEnvironment::four_connected(rows, cols, passable);
    let mut random = Random::new(1, 0);
    let mut free: Vec<u32> = (0..rows * cols).filter(|&c| !shelf(c)).collect();
    random.shuffle(&mut free);
    let starts = free[..agents].to_vec();
    random.shuffle(&mut free);
    let mut lists = Goals::default();
    for &last in &free[..agents] {
        let first = (1..goals).map(|_| free[random.below(free.len())]);
        lists.push(first.chain([last]));
    }
    let instance = Instance {
        goals: lists,
        window_steps: window,
        allows_cycles: false,
        ..Instance::one_shot(starts.clone(), starts)
    };
    Ground::new(&environment, 1 << 30)
        .and_then(|mut ground| ground.problem(&instance, GoalRule::Stay, &mut || false))
        .expect("the warehouse is connected")
}

fn unlimited(run: &mut dyn FnMut(&mut Control<'_>)) {
    run(&mut Control {
        stop: &mut || false,
        nodes: 0,
        memory: 1 << 30,
    });
}

fn planners(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("priority");
    group.sample_size(10);
    for (name, problem) in [
        ("one-shot-100", warehouse(100, 1, 0)),
        ("window-200", warehouse(200, 4, 20)),
    ] {
        group.bench_function(BenchmarkId::new("pp", name), |bencher| {
            let options = prioritized::Options::default();
            bencher.iter(|| {
                unlimited(&mut |control| {
                    prioritized::plan(&problem, options, 0, control);
                });
            });
        });
        group.bench_function(BenchmarkId::new("pbs", name), |bencher| {
            bencher.iter(|| {
                unlimited(&mut |control| {
                    search::plan(&problem, search::Options::default(), 0, control);
                });
            });
        });
    }
    group.finish();
}

criterion_group!(benches, planners);
criterion_main!(benches);
