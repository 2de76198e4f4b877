//! Speed of the exact checker, in simulated seconds per second of wall time: "elem/s" is the
//! real-time factor. Random walks that obey the rules of grids in a warehouse of 540 by 140 cells,
//! one cell a second, of discs from the grid plan as it is, and of rectangles that turn into their
//! direction.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

use std::f64::consts::{FRAC_PI_2, PI};
use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use fleetyard_core::{Connectivity, Grid, GridPlan, Knot, TrajectoryPlan, cell_center_m};
use fleetyard_world::exact::{ContactSearch, GridMotions, Obstacles, contacts};
use fleetyard_world::{Footprint, SeededRandom};

const STEPS: usize = 60;

/// Shelves of ten by two cells with aisles between them.
fn warehouse() -> Grid {
    let (rows, cols) = (140, 540);
    let terrain = (0..rows * cols).map(|cell| {
        let (row, col) = (cell / cols, cell % cols);
        let shelf = row % 3 != 0 && col % 11 != 0 && (10..530).contains(&col);
        if shelf { b'@' } else { b'.' }
    });
    Grid::new("warehouse", rows, cols, terrain.collect()).expect("a valid map")
}

/// Agents go on as they went, as far as they can, and only where nobody is.
fn walks(grid: &Grid, agents: usize) -> GridPlan {
    let mut random = SeededRandom::new("walks", agents as u64);
    let mut free: Vec<u32> = (0..grid.cell_count())
        .filter(|cell| grid.is_passable(*cell))
        .collect();
    random.shuffle(&mut free);
    let mut paths: Vec<Vec<u32>> = free[..agents].iter().map(|cell| vec![*cell]).collect();
    let mut taken = vec![false; grid.cell_count() as usize];
    for path in &paths {
        taken[path[0] as usize] = true;
    }
    let mut moves = vec![0i64; agents];
    for _ in 0..STEPS {
        let mut left = Vec::new();
        for (path, step) in paths.iter_mut().zip(&mut moves) {
            let here = path[path.len() - 1];
            let near: Vec<u32> = grid
                .neighbors(here, Connectivity::Four)
                .filter(|cell| !taken[*cell as usize])
                .collect();
            let ahead = (i64::from(here) + *step) as u32;
            let next = if *step != 0 && near.contains(&ahead) {
                ahead
            } else {
                near.get(random.below(near.len())).copied().unwrap_or(here)
            };
            *step = i64::from(next) - i64::from(here);
            taken[next as usize] = true;
            if next != here {
                left.push(here);
            }
            path.push(next);
        }
        for cell in left {
            taken[cell as usize] = false;
        }
    }
    GridPlan::from_paths(paths)
}

/// The same walks with headings: who turns does so where it is, a quarter turn
/// in a second, and comes later everywhere.
fn turning(grid: &Grid, plan: &GridPlan) -> TrajectoryPlan {
    let mut turning = TrajectoryPlan::with_capacity(plan.agents(), plan.cells().len());
    for path in plan.paths() {
        let (mut time_s, mut heading) = (0.0, 0.0);
        let mut knots = Vec::new();
        for step in path.windows(2) {
            let mut knot = |time_s: f64, cell: u32, heading: f64| {
                let (x_m, y_m) = cell_center_m(grid, 1.0, cell);
                let heading_rad = Some(heading);
                knots.push(Knot {
                    time_s,
                    x_m,
                    y_m,
                    heading_rad,
                });
            };
            knot(time_s, step[0], heading);
            let wanted = match i64::from(step[1]) - i64::from(step[0]) {
                0 => heading,
                1 => 0.0,
                -1 => PI,
                down if down > 0 => -FRAC_PI_2,
                _ => FRAC_PI_2,
            };
            if (wanted - heading).abs() > 0.1 {
                time_s += 1.0;
                heading = wanted;
                knot(time_s, step[0], heading);
            }
            time_s += 1.0;
            knot(time_s, step[1], heading);
        }
        turning.push_path(knots).expect("times ascend");
    }
    turning
}

fn bench(criterion: &mut Criterion) {
    let grid = warehouse();
    let obstacles = Obstacles::cells(&grid, 1.0).expect("cells of a metre");
    let disc = Footprint::Disc { radius_m: 0.35 };
    let disc = disc.shape().expect("a valid disc");
    let mut group = criterion.benchmark_group("exact contacts, grid plans of discs");
    group.sample_size(10);
    group.throughput(Throughput::Elements(STEPS as u64));
    for agents in [550, 1000, 2500, 10_000] {
        let plan = walks(&grid, agents);
        let shapes = vec![&disc; agents];
        let motions = GridMotions::new(&plan, &grid, 1.0, 1.0).expect("a valid plan");
        let search = ContactSearch::default();
        let found = contacts(&motions, &shapes, &obstacles, &search);
        assert_eq!(found.contacts, [], "the walks obey the rules");
        group.bench_function(BenchmarkId::from_parameter(agents), |bencher| {
            bencher.iter(|| contacts(black_box(&motions), &shapes, &obstacles, &search));
        });
    }
    group.finish();

    let footprint = Footprint::Rectangle {
        length_m: 0.8,
        width_m: 0.5,
    };
    let rectangle = footprint.shape().expect("a valid rectangle");
    let mut group = criterion.benchmark_group("exact contacts, rectangles that turn");
    group.sample_size(10);
    for agents in [1000, 10_000] {
        let motions = turning(&grid, &walks(&grid, agents));
        let shapes = vec![&rectangle; agents];
        let search = ContactSearch::default();
        let found = contacts(&motions, &shapes, &obstacles, &search);
        group.throughput(Throughput::Elements(found.until_s as u64));
        group.bench_function(BenchmarkId::from_parameter(agents), |bencher| {
            bencher.iter(|| contacts(black_box(&motions), &shapes, &obstacles, &search));
        });
    }
    group.finish();
}

criterion_group!(benches, bench);
criterion_main!(benches);
