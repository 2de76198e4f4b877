//! Costs of a simulated second of robots that drive about a warehouse without an end: messages,
//! motion, contacts, approaches and digest, on one thread. The server that sends the orders is not
//! part of it. On Linux times are those that the thread had a processor, so that other work on the
//! machine does not count.
//!
//!     cargo bench -p fleetyard-sim --bench live [-- FILTER]
//!
//! With `-- --long [AGENTS [AGENT_TICKS]]` one execution of so many robots and ticks
//! (10⁹ by default), with delays, noise and lost messages: contacts, time and memory.

#![allow(missing_docs, reason = "a program")]
#![allow(clippy::disallowed_methods, reason = "a benchmark reads the clock")]

#[path = "../tests/it/common/mod.rs"]
mod common;

use std::sync::OnceLock;
use std::time::{Duration, Instant};

use common::passing::Passing;
use criterion::{BenchmarkId, Criterion, Throughput};
use fleetyard_core::Grid;
use fleetyard_sim::{Fleet, Live, NoTrace, Profile, SimConfig};
use rand_chacha::ChaCha8Rng;

/// Shelves of ten by two cells with aisles between them, and seven free cells per robot.
fn warehouse(agents: usize) -> Grid {
    let side = ((agents * 12) as f64).sqrt() as u32;
    let terrain = (0..side * side)
        .map(|cell| {
            let (row, col) = (cell / side, cell % side);
            let shelf = row % 4 > 1 && col % 12 > 1 && row + 2 < side && col + 2 < side;
            if shelf { b'@' } else { b'.' }
        })
        .collect();
    Grid::new("warehouse", side, side, terrain).expect("a valid map")
}

/// Time for which the thread has run; where that is not known, time since the first call.
fn now() -> Duration {
    static START: OnceLock<Instant> = OnceLock::new();
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap_or_default();
    match stat.split(' ').next().and_then(|time| time.parse().ok()) {
        Some(nanoseconds) => Duration::from_nanos(nanoseconds),
        None => START.get_or_init(Instant::now).elapsed(),
    }
}

/// Robots with a server that always has something for them to do.
struct Traffic<'a> {
    grid: &'a Grid,
    live: Live<'a>,
    passing: Passing,
    rng: ChaCha8Rng,
}

impl<'a> Traffic<'a> {
    fn new(config: &'a SimConfig, grid: &'a Grid, fleet: &'a Fleet) -> Self {
        let mut rng = common::rng(1);
        let cells = common::starts(&mut rng, grid, fleet.agents());
        let starts: Vec<(u32, f64)> = cells.iter().map(|cell| (*cell, 0.0)).collect();
        let mut live = Live::new(config, grid, Some(fleet), &starts).expect("starts");
        live.begin(&mut NoTrace).expect("a beginning");
        Self {
            passing: Passing::new(grid, &cells, true),
            grid,
            live,
            rng,
        }
    }

    /// Simulates a second. The time that it takes, without the server.
    fn second(&mut self) -> Duration {
        let mut time = Duration::ZERO;
        for _ in 0..(1.0 / self.live.period_s()).round() as u32 {
            self.passing.wander(&mut self.rng, self.grid, 6, 0.0);
            self.passing.serve(&mut self.live);
            let start = now();
            self.live.advance(&mut NoTrace).expect("a block");
            time += now().saturating_sub(start);
        }
        time
    }

    fn moving(&self) -> usize {
        let agents = 0..self.live.agents();
        agents.filter(|agent| self.live.is_moving(*agent)).count()
    }
}

fn agvs(agents: usize) -> Fleet {
    let profile = Profile::preset("agv").expect("a preset");
    Fleet::uniform(profile, agents).expect("a fleet")
}

fn driving(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("live/driving");
    group.sample_size(10);
    for agents in [1000, 10_000] {
        let (config, grid, fleet) = (SimConfig::default(), warehouse(agents), agvs(agents));
        let mut traffic = Traffic::new(&config, &grid, &fleet);
        for _ in 0..20 {
            traffic.second();
        }
        let moving = traffic.moving();
        println!("{moving} of {agents} robots are moving");
        group.throughput(Throughput::Elements(60 * agents as u64));
        group.bench_function(BenchmarkId::from_parameter(agents), |bencher| {
            bencher.iter_custom(|seconds| (0..seconds).map(|_| traffic.second()).sum());
        });
        assert_eq!(traffic.live.contacts().total(), 0);
    }
    group.finish();
}

/// A minute at a time: the clock of the thread has steps of milliseconds.
fn resting(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("live/a minute of rest");
    group.sample_size(10);
    for agents in [1000, 10_000] {
        let (config, grid, fleet) = (SimConfig::default(), warehouse(agents), agvs(agents));
        let Traffic { mut live, .. } = Traffic::new(&config, &grid, &fleet);
        group.throughput(Throughput::Elements(3600 * agents as u64));
        group.bench_function(BenchmarkId::from_parameter(agents), |bencher| {
            bencher.iter_custom(|minutes| {
                let start = now();
                for _ in 0..600 * minutes {
                    live.advance(&mut NoTrace).expect("a block");
                }
                now().saturating_sub(start)
            });
        });
    }
    group.finish();
}

/// Resident memory in MiB.
fn memory() -> u64 {
    let pages = std::fs::read_to_string("/proc/self/statm").unwrap_or_default();
    let resident = pages.split_whitespace().nth(1);
    resident.map_or(0, |pages| pages.parse().unwrap_or(0) / 256)
}

fn long(agents: usize, agent_ticks: u64) {
    let mut config = SimConfig::default();
    let noise = &mut config.disturbance;
    noise.delay = "bernoulli:0.05,1s".parse().expect("a delay");
    noise.velocity = "0.1,0.5".parse().expect("a noise");
    noise.messages = "0s,0.3s,0.05".parse().expect("messages");
    let (grid, fleet) = (warehouse(agents), agvs(agents));
    let mut traffic = Traffic::new(&config, &grid, &fleet);
    let seconds = agent_ticks.div_ceil(60 * agents as u64);
    let mut time = Duration::ZERO;
    for second in 1..=seconds {
        time += traffic.second();
        if second.is_power_of_two() || second == seconds {
            println!(
                "{second} s, {:.1} × real time, {} orders, {} MiB, {} moving, nearest {:.4} m, {} contacts",
                second as f64 / time.as_secs_f64(),
                traffic.passing.done(),
                memory(),
                traffic.moving(),
                traffic
                    .live
                    .nearest_approach()
                    .map_or(f64::NAN, |near| near.distance_m),
                traffic.live.contacts().total(),
            );
        }
    }
    let outcome = traffic.live.finish(&mut NoTrace).expect("an end");
    println!(
        "{} agent-ticks, digest {}",
        outcome.ticks * agents as u64,
        outcome.trace_digest
    );
    assert_eq!(outcome.contacts.total(), 0);
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    if let Some(at) = arguments.iter().position(|word| word == "--long") {
        let number = |at: usize| arguments.get(at).and_then(|word| word.parse::<u64>().ok());
        let agents = number(at + 1).unwrap_or(1000);
        long(agents as usize, number(at + 2).unwrap_or(1_000_000_000));
        return;
    }
    let mut criterion = Criterion::default().configure_from_args();
    driving(&mut criterion);
    resting(&mut criterion);
    criterion.final_summary();
}
