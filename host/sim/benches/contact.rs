//! Costs of the contact tier: simulated seconds per second of wall time ("elem/s"), one core, 60 Hz
//! with four substeps, with a controller.
//!
//! Robots walk a warehouse (that of the League of Robot Runners, 540 × 140, if
//! FLEETYARD_DATA names a folder that has it) on random walks that obey the rules,
//! or press through one another in a crowd. Beside it stands what rapier alone
//! needs for the same robots as kinematic bodies that find contacts and solve none.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

#[path = "../tests/it/common/mod.rs"]
mod common;
#[path = "../tests/it/common/rapier_observer.rs"]
mod rapier_observer;

use std::hint::black_box;
use std::path::Path;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use fleetyard_core::{Grid, cell_center_m, load_map};
use fleetyard_sim::contact::{Agent, ContactWorld, Drive, Mass, Material, Settings, Twist};
use fleetyard_world::{Footprint, Pose, Shape};
use rapier_observer::RapierObserver;

const TICKS_HZ: f64 = 60.0;
/// One cell of a walk takes a second.
const STEPS: usize = 10;
const RADIUS_M: f64 = 0.35;

fn warehouse() -> Grid {
    let file = "lorr/warehouse.domain/maps/warehouse_long_corridor_large.map";
    let public = std::env::var_os("FLEETYARD_DATA")
        .and_then(|folder| load_map(Path::new(&folder).join(file)).ok());
    public.unwrap_or_else(|| {
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

fn robot(shape: &Shape, pose: Pose) -> Agent<'_> {
    Agent {
        shape,
        pose,
        velocity: Twist::default(),
        mass: Mass::Total(50.0),
        drive: Drive {
            acceleration: 2.0,
            lateral: None,
            angular: 4.0,
        },
        material: Material::default(),
    }
}

/// Planned pose of a robot that moves to the next cell of its path once a second.
fn on_way(way: &[(f64, f64)], time: f64) -> Pose {
    let step = (time as usize).min(STEPS - 1);
    let part = time - step as f64;
    let ((ax, ay), (bx, by)) = (way[step], way[step + 1]);
    Pose::at(ax + (bx - ax) * part, ay + (by - ay) * part)
}

fn walkers(grid: &Grid, targets: &[Vec<(f64, f64)>], shape: &Shape) -> ContactWorld {
    let mut world = ContactWorld::new(Settings::default()).expect("valid settings");
    world.add_grid(grid, 1.0).expect("a valid grid");
    for way in targets {
        let pose = on_way(way, 0.0);
        world.add_agent(&robot(shape, pose)).expect("a valid agent");
    }
    world
}

/// Follows the ways: the velocity of the reference plus a part of the error.
fn drive(world: &mut ContactWorld, targets: &[Vec<(f64, f64)>], ticks: usize) {
    let mut commands = vec![Twist::default(); world.agents()];
    for tick in 0..ticks {
        let time = (tick + 1) as f64 / TICKS_HZ;
        for (agent, command) in commands.iter_mut().enumerate() {
            let way = &targets[agent];
            let step = (time as usize).min(STEPS - 1);
            let ((ax, ay), (bx, by)) = (way[step], way[step + 1]);
            let (wanted, pose) = (on_way(way, time), world.pose(agent));
            *command = Twist {
                vx: bx - ax + 2.0 * (wanted.x - pose.x),
                vy: by - ay + 2.0 * (wanted.y - pose.y),
                omega: 0.0,
            };
        }
        world
            .step(&commands, 1.0 / TICKS_HZ)
            .expect("a finite step");
    }
}

/// The same ways with rapier's pipeline alone: bodies are put where the plan has
/// them, and contacts found.
fn observe(observer: &mut RapierObserver, targets: &[Vec<(f64, f64)>], ticks: usize) {
    for tick in 0..ticks {
        let time = (tick + 1) as f64 / TICKS_HZ;
        let poses: Vec<Pose> = targets.iter().map(|way| on_way(way, time)).collect();
        black_box(observer.step(&poses, 1.0 / TICKS_HZ));
    }
}

/// A square full of robots that all want to its middle.
fn crowd(agents: usize) -> ContactWorld {
    let mut world = ContactWorld::new(Settings::default()).expect("valid settings");
    let shape = Footprint::Disc { radius_m: RADIUS_M }
        .shape()
        .expect("a valid shape");
    let side = (agents as f64).sqrt().ceil() as usize;
    for agent in 0..agents {
        let pose = Pose::at((agent % side) as f64, (agent / side) as f64);
        world
            .add_agent(&robot(&shape, pose))
            .expect("a valid agent");
    }
    world
}

fn press(world: &mut ContactWorld, ticks: usize) {
    let middle = 0.5 * (world.agents() as f64).sqrt();
    let mut commands = vec![Twist::default(); world.agents()];
    for _ in 0..ticks {
        for (agent, command) in commands.iter_mut().enumerate() {
            let pose = world.pose(agent);
            let (x, y) = (middle - pose.x, middle - pose.y);
            let scale = 1.0 / (x * x + y * y).sqrt().max(1.0);
            *command = Twist {
                vx: x * scale,
                vy: y * scale,
                omega: 0.0,
            };
        }
        world
            .step(&commands, 1.0 / TICKS_HZ)
            .expect("a finite step");
    }
}

fn throughput(criterion: &mut Criterion) {
    let grid = warehouse();
    let shape = Footprint::Disc { radius_m: RADIUS_M }
        .shape()
        .expect("a valid shape");
    let mut group = criterion.benchmark_group("contact");
    group.sample_size(10);
    group.throughput(Throughput::Elements(STEPS as u64));
    let ticks = STEPS * TICKS_HZ as usize;
    for agents in [100, 550, 1000, 2500] {
        let mut rng = common::rng(agents as u64);
        let plan = common::valid_walks(&mut rng, &grid, agents, STEPS);
        let way = |agent| {
            let center = |step| cell_center_m(&grid, 1.0, plan.at(agent, step));
            (0..=STEPS).map(center).collect()
        };
        let targets: Vec<Vec<(f64, f64)>> = (0..agents).map(way).collect();
        group.bench_function(BenchmarkId::new("warehouse", agents), |bencher| {
            bencher.iter_batched_ref(
                || walkers(&grid, &targets, &shape),
                |world| drive(world, &targets, ticks),
                BatchSize::PerIteration,
            );
        });
        group.bench_function(BenchmarkId::new("rapier observing", agents), |bencher| {
            let poses: Vec<Pose> = targets.iter().map(|way| on_way(way, 0.0)).collect();
            bencher.iter_batched_ref(
                || RapierObserver::new(&vec![&shape; agents], &poses, Some((&grid, 1.0))),
                |observer| observe(observer, &targets, ticks),
                BatchSize::PerIteration,
            );
        });
        group.bench_function(BenchmarkId::new("crowd", agents), |bencher| {
            bencher.iter_batched_ref(
                || crowd(agents),
                |world| press(world, ticks),
                BatchSize::PerIteration,
            );
        });
    }
    group.finish();
}

criterion_group!(benches, throughput);
criterion_main!(benches);
