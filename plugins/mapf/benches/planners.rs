//! Time to the first plan, of refinement up to a fixed limit, and of calls for a fleet that
//! works without end, on generated maps.

#[path = "../../bundle/tests/it/mapf/floor.rs"]
mod floor;
#[path = "../../bundle/tests/it/mapf/support.rs"]
mod support;

use std::sync::Arc;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use fleetyard_abi::{Goals, GridEnvironment, Instance};
use fleetyard_plugin_mapf::lifelong::{ByDistance, Lifelong, Query};
use fleetyard_plugin_mapf::{Algorithm, Options};
use fleetyard_testkit::{Case, grid};
use floor::{Floor, Manner, Planner};
use support::Patient;

/// A square map with scattered obstacles; starts and goals spread by multiplication.
fn instance(side: u32, agents: usize) -> Case {
    let size = side * side;
    let noise = |cell: u32| {
        cell.wrapping_mul(0x9e37_79b1)
            .rotate_left(15)
            .wrapping_mul(0x85eb_ca6b)
    };
    let passable = (0..size).map(|cell| u8::from(noise(cell) >> 16 & 15 != 0));
    let map = GridEnvironment::four_connected(side, side, passable.collect());
    let first = grid::free(&map)[0];
    let region = grid::region(&map, first);
    let pick = |salt: u32| {
        let mut cells = region.clone();
        cells.sort_by_key(|&cell| noise(cell ^ salt));
        cells.truncate(agents);
        cells
    };
    let instance = Instance::one_shot(pick(0x5bd1_e995), pick(0x1b87_3593));
    Case { map, instance }
}

fn planners(criterion: &mut Criterion) {
    let first = Options {
        anytime: false,
        ..Options::default()
    };
    let plain = Options {
        samples: 1,
        scatter_margin: None,
        ..first.clone()
    };
    let pibt = Options {
        algorithm: Algorithm::Pibt,
        ..first.clone()
    };
    let refined = Options {
        node_limit: Some(2000),
        ..Options::default()
    };
    let all = [
        ("pibt", pibt),
        ("lacam, one sample", plain),
        ("lacam", first),
        ("refined", refined),
    ];
    for (name, options) in all {
        let mut group = criterion.benchmark_group(name);
        group.sample_size(10);
        for (side, agents) in [(32, 100), (64, 400)] {
            let problem = instance(side, agents);
            let id = BenchmarkId::from_parameter(format!("{side}x{side}, {agents} agents"));
            group.bench_with_input(id, &problem, |bencher, problem| {
                bencher.iter(|| support::solve(problem, &options, 0, &mut Patient::default()));
            });
        }
        group.finish();
    }
}

/// Ten steps, with the ways to all goals known from calls before.
fn calls(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("ten steps of a fleet");
    group.sample_size(20);
    for (name, samples, retries) in [("pibt", 1, 0), ("lacam", 10, 8)] {
        for (side, agents) in [(64, 400), (80, 1000)] {
            let problem = instance(side, agents);
            let goals = problem.instance.goals.clone();
            let query = query(&problem, &goals, samples, retries);
            let mut planner = planner(&problem);
            let id = BenchmarkId::new(name, format!("{side}x{side}, {agents} agents"));
            group.bench_function(id, |bencher| {
                bencher.iter(|| planner.run(&query, &mut ByDistance, &mut || false));
            });
        }
    }
    group.finish();
}

/// Ten steps from a cold start.
fn first_calls(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("first ten steps of a fleet");
    group.sample_size(10);
    for (side, agents) in [(64, 400), (80, 1000), (200, 10_000)] {
        let problem = instance(side, agents);
        let goals = problem.instance.goals.clone();
        let query = query(&problem, &goals, 1, 0);
        let id = BenchmarkId::new("pibt", format!("{side}x{side}, {agents} agents"));
        group.bench_function(id, |bencher| {
            bencher.iter(|| planner(&problem).run(&query, &mut ByDistance, &mut || false));
        });
    }
    group.finish();
}

/// A step of EPIBT in a crowd of robots that turn, by the number of tries for each.
fn steps(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("a step of robots that turn");
    group.sample_size(20);
    for (side, agents) in [(32, 400), (64, 400)] {
        for tries in [0, 5] {
            let manner = Manner {
                horizon: 4,
                tries: Some(tries),
                window: 1,
                threads: 1,
                planner: Planner::Epibt,
            };
            let map = instance(side, agents).map;
            let mut floor = Floor::new(map, agents, true, 1, 0, 1);
            floor.drive(20, manner);
            let name = format!("{side}x{side}, {agents} agents");
            let id = BenchmarkId::new(name, format!("{tries} tries"));
            group.bench_function(id, |bencher| {
                bencher.iter(|| floor.plan(manner, &mut floor::Patient));
            });
        }
    }
    group.finish();
}

fn planner(problem: &Case) -> Lifelong {
    Lifelong::new(Arc::new(support::graph(problem)), 512 << 20)
}

fn query<'a>(problem: &'a Case, goals: &'a Goals, samples: u32, retries: u32) -> Query<'a> {
    Query {
        starts: &problem.instance.starts,
        goals,
        headings: None,
        window: Some(10),
        step_limit: 0,
        swap: true,
        rings: false,
        memory_limit: 0,
        samples,
        retries,
        seed: 0,
    }
}

criterion_group!(benches, planners, calls, first_calls, steps);
criterion_main!(benches);
