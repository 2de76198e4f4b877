//! The simulator's table of figures: real-time factors on one and more threads,
//! nanoseconds per agent and tick, and memory per agent.
//!
//!     cargo bench -p fleetyard-sim --bench table [-- [--quick] [--threads 1,2] [FILTER …]]
//!
//! Every row runs in a process of its own, so that its memory is its own: what the
//! execution takes beyond map and plan. Plans are random drives that obey the rules
//! of grid plans and mostly go straight on; maps are warehouses.

#![allow(missing_docs, reason = "a program")]
#![allow(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

#[path = "../tests/it/common/mod.rs"]
mod common;
#[path = "../tests/it/common/rapier_observer.rs"]
mod rapier_observer;

use std::process::{Command, ExitCode};
use std::time::Instant;

use fleetyard_core::{Grid, GridPlan, cell_center_m};
use fleetyard_world::{Footprint, Pose};
use nalgebra::{DMatrix, DVector};
use rapier_observer::RapierObserver;

use fleetyard_sim::{Fleet, NoTrace, Policy, Profile, SimConfig, Simulator, Tier};

/// A row of the table.
struct Row {
    name: &'static str,
    /// The goal for the real-time factor on one thread.
    goal: Option<f64>,
    agents: usize,
    /// Rows and columns of the map.
    map: (u32, u32),
    steps: usize,
    kind: Kind,
}

#[derive(Clone, Copy, PartialEq)]
enum Kind {
    Replay,
    Drive,
    Gated,
    Contact,
    /// Not ours: bodies put where the plan has them, contacts found by rapier.
    Rapier,
}

const WAREHOUSE: (u32, u32) = (140, 540);

const fn row(name: &'static str, goal: f64, agents: usize, kind: Kind) -> Row {
    Row {
        name,
        goal: Some(goal),
        agents,
        map: WAREHOUSE,
        steps: 120,
        kind,
    }
}

const ROWS: &[Row] = &[
    row("replay", 2500.0, 550, Kind::Replay),
    row("replay", 1300.0, 1000, Kind::Replay),
    row("replay", 500.0, 2500, Kind::Replay),
    row("diff-drive", 220.0, 1000, Kind::Drive),
    row("diff-drive", 90.0, 2500, Kind::Drive),
    row("diff-drive, gated, noise", 120.0, 1000, Kind::Gated),
    Row {
        steps: 40,
        ..row("diff-drive, gated, noise", 10.0, 10_000, Kind::Gated)
    },
    Row {
        map: (1400, 1400),
        steps: 20,
        ..row("diff-drive", 2.0, 100_000, Kind::Drive)
    },
    Row {
        map: (10_000, 10_000),
        steps: 8,
        ..row("replay", 0.5, 1_000_000, Kind::Replay)
    },
    Row {
        steps: 10,
        ..row("contact tier, diff-drive", 45.0, 1000, Kind::Contact)
    },
    rapier(550),
    rapier(1000),
    rapier(2500),
];

const fn rapier(agents: usize) -> Row {
    Row {
        goal: None,
        steps: 5,
        ..row("rapier's pipeline, replay", 0.0, agents, Kind::Rapier)
    }
}

/// Shelves of ten by two cells with aisles between them, and room at both ends.
fn warehouse((rows, cols): (u32, u32)) -> Grid {
    let margin = cols / 20;
    let terrain = (0..rows * cols)
        .map(|cell| {
            let (row, col) = (cell / cols, cell % cols);
            let shelf = row % 3 != 0 && col % 11 != 0 && (margin..cols - margin).contains(&col);
            if shelf { b'@' } else { b'.' }
        })
        .collect();
    Grid::new("warehouse", rows, cols, terrain).expect("a valid map")
}

fn config(kind: Kind, threads: usize) -> SimConfig {
    let mut config = SimConfig {
        threads,
        max_pairs: 1 << 26,
        ..SimConfig::default()
    };
    match kind {
        Kind::Replay | Kind::Drive | Kind::Rapier => {}
        Kind::Contact => config.tier = Tier::Contact,
        Kind::Gated => {
            config.policy = Policy::Adg;
            config.disturbance.delay = "bernoulli:0.05,1s".parse().expect("a delay");
            config.disturbance.velocity = "0.1,0.5".parse().expect("a noise");
        }
    }
    config
}

/// Figures of a run of one row.
struct Figures {
    rtf: f64,
    ns_per_agent_tick: f64,
    bytes: f64,
    contacts: u64,
    digest: String,
}

/// A line of `/proc/self/status` in bytes.
fn memory(field: &str) -> f64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix(field));
    let kib: f64 = line
        .and_then(|line| {
            line.trim_matches(|c: char| !c.is_ascii_digit())
                .parse()
                .ok()
        })
        .unwrap_or(0.0);
    kib * 1024.0
}

fn measure(row: &Row, threads: usize, repeats: usize) -> Figures {
    let grid = warehouse(row.map);
    let mut rng = common::rng(row.agents as u64);
    let plan = common::valid_drives(&mut rng, &grid, row.agents, row.steps);
    if row.kind == Kind::Rapier {
        return observe(&grid, &plan);
    }
    let (config, fleet) = (config(row.kind, threads), agvs(row.agents));
    let mut simulator = Simulator::new(&config).on_grid(&grid);
    if row.kind != Kind::Replay {
        simulator = simulator.with_fleet(&fleet);
    }
    run(&simulator, &plan, row.agents, repeats)
}

/// The same plan in rapier: bodies are put where the plan has them at every tick of
/// 60 Hz, and its pipeline finds who touches whom.
fn observe(grid: &Grid, plan: &GridPlan) -> Figures {
    let radius_m = SimConfig::DEFAULT_RADIUS_CELLS;
    let shape = Footprint::Disc { radius_m }.shape().expect("a disc");
    let shapes = vec![&shape; plan.agents()];
    let pose = |agent: usize, tick: usize| {
        let (step, part) = (tick / 60, (tick % 60) as f64 / 60.0);
        let (ax, ay) = cell_center_m(grid, 1.0, plan.at(agent, step));
        let (bx, by) = cell_center_m(grid, 1.0, plan.at(agent, step + 1));
        Pose::at(ax + (bx - ax) * part, ay + (by - ay) * part)
    };
    let poses = |tick| (0..plan.agents()).map(|agent| pose(agent, tick)).collect();
    let start: Vec<Pose> = poses(0);
    let mut observer = RapierObserver::new(&shapes, &start, Some((grid, 1.0)));
    let ticks = 60 * plan.horizon();
    let frames: Vec<Vec<Pose>> = (1..=ticks).map(poses).collect();
    let begin = Instant::now();
    let contacts: usize = frames
        .iter()
        .map(|poses| observer.step(poses, 1.0 / 60.0).len())
        .sum();
    let wall = begin.elapsed().as_secs_f64();
    Figures {
        rtf: plan.horizon() as f64 / wall,
        ns_per_agent_tick: wall * 1e9 / (ticks * plan.agents()) as f64,
        bytes: 0.0,
        contacts: contacts as u64,
        digest: "none".to_owned(),
    }
}

fn run(simulator: &Simulator<'_>, plan: &GridPlan, agents: usize, repeats: usize) -> Figures {
    // Writing 5 begins a new high-water mark.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let before = memory("VmRSS:");
    let mut all: Vec<Figures> = (0..repeats)
        .map(|_| {
            let start = Instant::now();
            let outcome = simulator
                .run(plan, &mut NoTrace)
                .expect("the plan can be executed");
            let wall = start.elapsed().as_secs_f64();
            Figures {
                rtf: outcome.simulated_s / wall,
                ns_per_agent_tick: wall * 1e9 / (outcome.ticks as f64 * agents as f64),
                bytes: memory("VmHWM:") - before,
                contacts: outcome.contacts.total(),
                digest: outcome.trace_digest.to_string(),
            }
        })
        .collect();
    all.sort_by(|a, b| a.rtf.total_cmp(&b.rtf));
    let bytes = all.iter().map(|figures| figures.bytes).fold(0.0, f64::max);
    let median = all.swap_remove(all.len() / 2);
    Figures { bytes, ..median }
}

/// Runs a row in a process of its own.
fn elsewhere(index: usize, threads: usize, repeats: usize) -> Option<Figures> {
    let program = std::env::current_exe().ok()?;
    let arguments = [index, threads, repeats].map(|number| number.to_string());
    let output = Command::new(program)
        .arg("--row")
        .args(arguments)
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let mut words = text.split_whitespace();
    let figures = Figures {
        rtf: words.next()?.parse().ok()?,
        ns_per_agent_tick: words.next()?.parse().ok()?,
        bytes: words.next()?.parse().ok()?,
        contacts: words.next()?.parse().ok()?,
        digest: words.next()?.to_owned(),
    };
    Some(figures)
}

/// Slope and coefficient of determination of the least-squares line through points.
fn fit(points: &[(f64, f64)]) -> (f64, f64) {
    let design = DMatrix::from_fn(points.len(), 2, |row, column| {
        if column == 0 { 1.0 } else { points[row].0 }
    });
    let values = DVector::from_iterator(points.len(), points.iter().map(|point| point.1));
    let line = design.clone().svd(true, true).solve(&values, 1e-9);
    let Ok(line) = line else {
        return (f64::NAN, f64::NAN);
    };
    let spread = values.add_scalar(-values.mean()).norm_squared();
    let residual = (&values - design * &line).norm_squared();
    (line[1], 1.0 - residual / spread)
}

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let Some(at) = arguments.iter().position(|word| word == "--row") {
        let numbers: Vec<usize> = arguments[at + 1..]
            .iter()
            .filter_map(|w| w.parse().ok())
            .collect();
        let &[index, threads, repeats] = numbers.as_slice() else {
            return ExitCode::FAILURE;
        };
        let f = measure(&rows()[index], threads, repeats);
        println!(
            "{} {} {} {} {}",
            f.rtf, f.ns_per_agent_tick, f.bytes, f.contacts, f.digest
        );
        return ExitCode::SUCCESS;
    }
    let quick = arguments.iter().any(|word| word == "--quick");
    let threads: Vec<usize> = arguments
        .iter()
        .position(|word| word == "--threads")
        .and_then(|at| arguments.get(at + 1))
        .map_or(vec![1, 2], |list| {
            list.split(',').filter_map(|n| n.parse().ok()).collect()
        });
    let filters: Vec<&String> = arguments
        .iter()
        .filter(|word| !word.starts_with('-') && !word.contains(|c: char| c.is_ascii_digit()))
        .collect();
    let repeats = if quick { 1 } else { 3 };
    println!(
        "{:26} {:>9} {:>8} {:>10} {:>8} {:>9} {:>11} {:>9}",
        "", "agents", "threads", "RTF", "goal", "ns/tick", "bytes/agent", "contacts"
    );
    let mut ok = true;
    let mut replays: Vec<(usize, f64)> = Vec::new();
    for (index, row) in rows().iter().enumerate().take(ROWS.len()) {
        let wanted = filters.is_empty() || filters.iter().any(|filter| row.name.contains(*filter));
        if !wanted || (quick && row.agents > 100_000) {
            continue;
        }
        let mut one: Option<Figures> = None;
        for threads in &threads {
            if matches!(row.kind, Kind::Contact | Kind::Rapier) && *threads > 1 {
                continue;
            }
            let Some(figures) = elsewhere(index, *threads, repeats) else {
                println!("{:26} {:>9} {threads:>8} failed", row.name, row.agents);
                ok = false;
                continue;
            };
            if row.kind == Kind::Replay && *threads == 1 {
                replays.push((row.agents, figures.rtf));
            }
            let ours = replays.iter().find(|(agents, _)| *agents == row.agents);
            let goal = match (&one, row.goal) {
                (None, None) if row.kind == Kind::Rapier && ours.is_some() => {
                    let ratio = ours.map_or(0.0, |(_, rtf)| rtf / figures.rtf);
                    format!("ours {ratio:.0} ×")
                }
                (None, Some(goal)) => format!("{goal}"),
                (Some(one), _) => format!("{:.2} ×", figures.rtf / one.rtf),
                (None, None) => String::new(),
            };
            println!(
                "{:26} {:>9} {threads:>8} {:>10.1} {goal:>8} {:>9.1} {:>11.0} {:>9}",
                row.name,
                row.agents,
                figures.rtf,
                figures.ns_per_agent_tick,
                figures.bytes / row.agents as f64,
                figures.contacts
            );
            if one.as_ref().is_some_and(|one| one.digest != figures.digest) {
                println!("  the digests differ between numbers of threads");
                ok = false;
            }
            one.get_or_insert(figures);
        }
    }
    for kind in [Kind::Replay, Kind::Drive, Kind::Gated] {
        let name = memory_name(kind);
        if !(filters.is_empty() || filters.iter().any(|filter| "memory".contains(*filter))) {
            continue;
        }
        let points: Vec<(f64, f64)> = rows()
            .iter()
            .enumerate()
            .skip(ROWS.len())
            .filter(|(_, row)| row.kind == kind)
            .filter_map(|(index, row)| Some((row.agents as f64, elsewhere(index, 1, 1)?.bytes)))
            .collect();
        let (slope, r2) = fit(&points);
        println!("memory, {name}: {slope:.0} bytes per agent, R² = {r2:.5}");
    }
    if ok {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    }
}

fn memory_name(kind: Kind) -> &'static str {
    match kind {
        Kind::Replay => "replay",
        Kind::Drive => "diff-drive",
        Kind::Gated => "diff-drive, gated, noise",
        Kind::Contact => "contact tier",
        Kind::Rapier => "rapier's pipeline",
    }
}

/// The rows of the table, and after them those that show how memory grows: the
/// same density at several sizes.
fn rows() -> Vec<Row> {
    let mut rows: Vec<Row> = ROWS.iter().map(|row| Row { ..*row }).collect();
    for kind in [Kind::Replay, Kind::Drive, Kind::Gated] {
        for agents in [20_000, 40_000, 60_000, 80_000, 100_000] {
            let side = ((agents * 20) as f64).sqrt() as u32;
            rows.push(Row {
                name: memory_name(kind),
                goal: None,
                agents,
                map: (side, side),
                steps: 10,
                kind,
            });
        }
    }
    rows
}

fn agvs(agents: usize) -> Fleet {
    let profile = Profile::preset("agv").expect("a preset");
    Fleet::uniform(profile, agents).expect("a fleet")
}
