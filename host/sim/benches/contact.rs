//! What the contact tier costs: simulated seconds per second of wall time
//! ("elem/s"), one core, 60 Hz with four substeps, with a controller.
//!
//! Robots walk a warehouse (that of the League of Robot Runners, 540 × 140, if
//! FLEETYARD_DATA names a folder that has it) on random walks that obey the rules,
//! or press through one another in a crowd. Beside it stands what rapier alone
//! needs for the same robots as kinematic bodies that find contacts and solve none.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

#[path = "../tests/common/mod.rs"]
mod common;

use std::path::Path;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use fleetyard_core::{Grid, GridPlan, cell_center_m, load_map};
use fleetyard_sim::contact::{Agent, ContactWorld, Drive, Mass, Material, Settings, Twist};
use fleetyard_world::{Footprint, Pose};

const TICKS_HZ: f64 = 60.0;
/// One cell of a walk takes a second.
const STEPS: usize = 10;

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

fn main_world(
    grid: &Grid,
    plan: &GridPlan,
    footprint: &Footprint,
    settings: Settings,
) -> ContactWorld {
    let mut world = ContactWorld::new(settings).expect("valid");
    world.add_grid(grid, 1.0).expect("valid");
    let shape = footprint.shape().expect("valid");
    for agent in 0..plan.agents() {
        let (x, y) = cell_center_m(grid, 1.0, plan.at(agent, 0));
        world
            .add_agent(&Agent {
                shape: &shape,
                pose: Pose::at(x, y),
                velocity: Twist::default(),
                mass: Mass::Total(50.0),
                drive: Drive {
                    acceleration: 2.0,
                    lateral: None,
                    angular: 4.0,
                },
                material: Material::default(),
            })
            .expect("valid");
    }
    world
}

/// Follows the plan: the velocity of the reference plus a part of the error.
fn drive(world: &mut ContactWorld, targets: &[Vec<(f64, f64)>], ticks: usize) {
    let mut commands = vec![Twist::default(); world.agents()];
    for tick in 0..ticks {
        let time = (tick + 1) as f64 / TICKS_HZ;
        let step = (time as usize).min(STEPS - 1);
        let part = time - step as f64;
        for (agent, command) in commands.iter_mut().enumerate() {
            let ((ax, ay), (bx, by)) = (targets[agent][step], targets[agent][step + 1]);
            let pose = world.pose(agent);
            let (x, y) = (ax + (bx - ax) * part, ay + (by - ay) * part);
            *command = Twist {
                vx: bx - ax + 2.0 * (x - pose.x),
                vy: by - ay + 2.0 * (y - pose.y),
                omega: 0.0,
            };
        }
        world.step(&commands, 1.0 / TICKS_HZ).expect("finite");
    }
}

fn throughput(criterion: &mut Criterion) {
    let grid = warehouse();
    let footprint = Footprint::Disc { radius_m: 0.35 };
    let mut group = criterion.benchmark_group("contact");
    group.sample_size(10);
    group.throughput(Throughput::Elements(STEPS as u64));
    for agents in [100, 550, 1000, 2500] {
        let mut rng = common::rng(agents as u64);
        let plan = common::valid_walks(&mut rng, &grid, agents, STEPS);
        let targets: Vec<Vec<(f64, f64)>> = (0..agents)
            .map(|agent| {
                (0..=STEPS)
                    .map(|step| cell_center_m(&grid, 1.0, plan.at(agent, step)))
                    .collect()
            })
            .collect();
        group.bench_function(BenchmarkId::new("warehouse", agents), |bencher| {
            bencher.iter_batched_ref(
                || main_world(&grid, &plan, &footprint, Settings::default()),
                |world| drive(world, &targets, STEPS * TICKS_HZ as usize),
                criterion::BatchSize::PerIteration,
            );
        });
    }
    group.finish();
}

criterion_group!(benches, throughput);
criterion_main!(benches);
