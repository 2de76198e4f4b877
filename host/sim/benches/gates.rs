//! Costs of gated execution: building the dependency graph, keeping it up to date, drawing random
//! values. Memory is printed before the times.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

#[path = "../tests/it/common/mod.rs"]
mod common;

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use fleetyard_core::{Grid, GridPlan, Knot, TrajectoryPlan, cell_center_m};
use fleetyard_sim::gate::{DependencyGraph, GateOptions, Gates, GridRoutes};
use fleetyard_sim::motion::wrap;
use fleetyard_sim::noise::{Disturbance, Messages, Noise, VelocityNoise};
use fleetyard_world::{Footprint, Shape};

/// Blocks per simulated second.
const BLOCKS: u64 = 10;

/// Shelves of ten by two cells with aisles between them.
fn warehouse() -> Grid {
    let (rows, cols) = (140, 540);
    let terrain = (0..rows * cols)
        .map(|cell| {
            let (row, col) = (cell / cols, cell % cols);
            let shelf = row % 3 != 0 && col % 11 != 0 && (10..530).contains(&col);
            if shelf { b'@' } else { b'.' }
        })
        .collect();
    Grid::new("warehouse", rows, cols, terrain).expect("a valid map")
}

fn build(routes: &GridRoutes<'_>, shape: &Shape, by_cell: bool) -> DependencyGraph {
    let options = GateOptions {
        margin_m: 0.05,
        cell_size_m: by_cell.then_some(1.0),
        longest_action_m: Some(1.0),
        ..GateOptions::default()
    };
    DependencyGraph::build(routes, &|_| shape, &options).expect("a graph")
}

/// Walks on cells of 1.5 m, a second and a half each, of robots that head where they go and
/// turn in the first third of it.
fn turning(walks: &GridPlan, grid: &Grid) -> TrajectoryPlan {
    let mut plan = TrajectoryPlan::default();
    for path in walks.paths() {
        let mut heading = 0.0;
        let mut knots = Vec::new();
        let mut time_s = 0.0;
        let mut push = |cell: u32, heading: f64, time_s: f64| {
            let (x_m, y_m) = cell_center_m(grid, 1.5, cell);
            knots.push(Knot {
                time_s,
                x_m,
                y_m,
                heading_rad: Some(heading),
            });
        };
        push(path[0], heading, 0.0);
        for pair in path.windows(2) {
            let (from, to) = (
                cell_center_m(grid, 1.5, pair[0]),
                cell_center_m(grid, 1.5, pair[1]),
            );
            if from != to {
                heading += wrap(libm::atan2(to.1 - from.1, to.0 - from.0) - heading);
                push(pair[0], heading, time_s + 0.5);
            }
            time_s += 1.5;
            push(pair[1], heading, time_s);
        }
        plan.push_path(knots).expect("a path");
    }
    plan
}

/// Executes a plan as fast as it goes, with a tenth of the agents at a knot in
/// every block. Returns the number of blocks.
fn execute(mut gates: Gates) -> u64 {
    let agents = gates.graph().agents();
    let mut block = 0;
    while !gates.is_finished() {
        gates.exchange(block);
        for agent in ((block % BLOCKS) as usize..agents).step_by(BLOCKS as usize) {
            let reached = gates.reached()[agent];
            if reached < gates.released()[agent] {
                gates.done(agent, reached as usize + 1);
            }
        }
        block += 1;
    }
    block
}

fn gates(criterion: &mut Criterion) {
    let grid = warehouse();
    let footprint = Footprint::Disc { radius_m: 0.35 };
    let shape = footprint.shape().expect("a footprint");
    let mut group = criterion.benchmark_group("gates");
    group.sample_size(10);
    for (agents, actions) in [(1000, 200), (10_000, 100)] {
        let mut rng = common::rng(agents as u64);
        let plan: GridPlan = common::valid_walks(&mut rng, &grid, agents, actions);
        let routes = GridRoutes {
            grid: &grid,
            plan: &plan,
            cell_size_m: 1.0,
            step_s: 1.0,
        };
        let name = format!("{agents} x {actions}");
        for (how, by_cell) in [("build by cell", true), ("build by distance", false)] {
            let graph = build(&routes, &shape, by_cell);
            eprintln!(
                "{how}, {name}: {} dependencies, {:.0} bytes per agent and 50 actions",
                graph.edges(),
                graph.memory_bytes() as f64 / (agents * actions) as f64 * 50.0,
            );
            group.throughput(Throughput::Elements((agents * actions) as u64));
            group.bench_function(BenchmarkId::new(how, &name), |bencher| {
                bencher.iter(|| build(black_box(&routes), &shape, by_cell));
            });
        }
        // Elements are blocks: a simulated second takes ten.
        let graph = build(&routes, &shape, true);
        for (how, messages) in [
            ("block", "0,0,0"),
            ("block, messages late and lost", "50ms,300ms,0.1"),
        ] {
            let messages: Messages = messages.parse().expect("messages");
            let start = || Gates::with_messages(graph.clone(), &messages, 1, 0.1);
            group.throughput(Throughput::Elements(execute(start())));
            group.bench_function(BenchmarkId::new(how, &name), |bencher| {
                bencher.iter_with_setup(start, execute);
            });
        }
    }
    // Rings all over: every four agents in a square go round together.
    let open = Grid::new("open", 50, 50, vec![b'.'; 2500]).expect("a valid map");
    for radius_m in [0.3, 0.35] {
        let plan = common::turning_blocks(&mut common::rng(1), &open, 1000, 20);
        let routes = GridRoutes {
            grid: &open,
            plan: &plan,
            cell_size_m: 1.0,
            step_s: 1.0,
        };
        let footprint = Footprint::Disc { radius_m };
        let shape = footprint.shape().expect("a footprint");
        let graph = build(&routes, &shape, true);
        let pieces = (0..1000).map(|agent| graph.actions(agent)).sum::<usize>();
        eprintln!(
            "rings, radius {radius_m} m: {pieces} actions of 20000, {} dependencies, margin {} m",
            graph.edges(),
            graph.margin_m()
        );
        group.throughput(Throughput::Elements(20_000));
        group.bench_function(BenchmarkId::new("build with rings", radius_m), |bencher| {
            bencher.iter(|| build(black_box(&routes), &shape, true));
        });
    }
    // Quadrupeds on lanes, each turning to where it goes.
    let go2 = Footprint::Rectangle {
        length_m: 0.7,
        width_m: 0.31,
    };
    let go2 = go2.shape().expect("a footprint");
    for (agents, actions) in [(100, 200), (1000, 100)] {
        let walks = common::valid_drives(&mut common::rng(2), &grid, agents, actions);
        let routes = turning(&walks, &grid);
        let build = || {
            let options = GateOptions {
                margin_m: 0.05,
                ..GateOptions::default()
            };
            DependencyGraph::build(black_box(&routes), &|_| &go2, &options).expect("a graph")
        };
        let name = format!("{agents} x {actions}");
        let graph = build();
        let pieces = (0..agents).map(|agent| graph.actions(agent)).sum::<usize>();
        eprintln!(
            "rectangles, {name}: {pieces} actions, {} dependencies",
            graph.edges()
        );
        group.throughput(Throughput::Elements((agents * actions) as u64));
        group.bench_function(BenchmarkId::new("build for rectangles", &name), |bencher| {
            bencher.iter(build);
        });
    }
    group.finish();

    let mut group = criterion.benchmark_group("noise");
    let disturbance = Disturbance {
        delay: "bernoulli:0.1,2s".parse().expect("a delay"),
        velocity: VelocityNoise {
            std: 0.1,
            floor: 0.2,
        },
        ..Disturbance::default()
    };
    let noise = Noise::new(&disturbance, 0.1);
    let mut factors = [0.0; 64];
    group.throughput(Throughput::Elements(64));
    group.bench_function("speed factors of 64 agents", |bencher| {
        bencher.iter(|| noise.speed_factors(black_box(7), black_box(640), &mut factors));
    });
    group.throughput(Throughput::Elements(1));
    group.bench_function("delay of an action", |bencher| {
        bencher.iter(|| noise.start_delay_s(black_box(640), black_box(7)));
    });
    group.finish();
}

criterion_group!(benches, gates);
criterion_main!(benches);
