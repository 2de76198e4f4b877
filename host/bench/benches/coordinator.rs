//! Costs of the coordinator: trials that do nothing, into a store on the disk.
//!
//! `cargo bench -p fleetyard-bench --bench coordinator` gives the cost of a trial;
//! with `-- --trials 100000` it prints time, memory and size of the store for so many.

use std::path::Path;
use std::time::{Duration, Instant};

use criterion::{BatchSize, Criterion, Throughput};
use fleetyard_bench::{Meta, Planned, Row, Schedule, Shard, SharedStore, Store, run};
use fleetyard_core::Digest;

/// A suite of ten planners on so many trials.
fn schedule(trials: u64) -> Schedule {
    let digests = |count: u64| (0..count).map(|index| Digest(index.into())).collect();
    Schedule::new(digests(10), digests(trials / 10), vec![0], 1, 0)
}

/// A row as trials of suites have it, with as much text.
fn row(schedule: &Schedule, planned: &Planned) -> Row {
    let digest = |number: u64| Digest(u128::from(number) << 64 | 0x5eed).to_string();
    let instance = planned.instance as u64;
    Row {
        key: schedule.key(planned),
        trial: planned.number,
        planner: format!("Planner {}", planned.planner),
        planner_id: "weighted-astar".into(),
        planner_version: "0.1.0".into(),
        planner_digest: Some(digest(7)),
        options: r#"{"heuristic":"manhattan","weight":1.5}"#.into(),
        attach: "worker".into(),
        ranked: true,
        instance_digest: digest(instance),
        map: format!("random-64-64-20-{instance}"),
        scenario: format!("random-64-64-20-random-{instance}.scen"),
        agents: 100,
        connectivity: Some(4),
        map_rows: Some(64),
        map_cols: Some(64),
        budget_ms: 10_000.0,
        termination: "completed".into(),
        claim: Some("solved".into()),
        valid: true,
        success: true,
        solve_time_ms: 0.12 * planned.number as f64,
        planning_time_ms: 0.12 * planned.number as f64,
        call_time_ms: Some(0.1 * planned.number as f64),
        soc_steps: Some(planned.number),
        makespan_steps: Some(99),
        lower_bound_steps: Some(1000),
        suboptimality: Some(1.25),
        path_length_cells: Some(1250.0),
        path_length_m: Some(1250.0),
        expansions: Some(planned.number as f64),
        cpu_time_ms: Some(0.1),
        machine: digest(9),
        plan_digest: Some(digest(planned.number)),
        started_unix_ms: 1_700_000_000_000,
        ..Row::default()
    }
}

fn create(path: &Path) -> SharedStore {
    let meta = Meta {
        suite: "no-op".into(),
        suite_values: "{}".into(),
        ..Meta::default()
    };
    SharedStore::new(Store::create(path, &meta).expect("a store"))
}

fn run_all(schedule: &Schedule, store: &SharedStore) {
    let longest = Duration::from_secs(10);
    let ran = run(
        schedule,
        Shard::ALL,
        &store.with(|store| store.keys()).expect("keys"),
        longest,
        0,
        &mut |planned| Ok(row(schedule, planned)),
        &mut |row, progress| {
            std::hint::black_box(progress.left);
            Ok(store.with(|store| store.insert(&row))?)
        },
    );
    assert_eq!(ran.expect("no-op trials").made, schedule.len());
}

fn cost_of_a_trial(criterion: &mut Criterion) {
    const TRIALS: u64 = 2000;
    let schedule = schedule(TRIALS);
    let mut group = criterion.benchmark_group("coordinator");
    group
        .sample_size(10)
        .throughput(Throughput::Elements(TRIALS));
    group.bench_function("no-op trials", |bencher| {
        bencher.iter_batched(
            || {
                let folder = tempfile::tempdir().expect("a folder");
                let store = create(&folder.path().join("s.sqlite"));
                (folder, store)
            },
            |(folder, store)| {
                run_all(&schedule, &store);
                (folder, store)
            },
            BatchSize::PerIteration,
        );
    });
    group.finish();
}

/// The high-water mark of this process's memory in MiB.
fn memory_mib() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    let kb = line.and_then(|line| line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok());
    kb.unwrap_or(0) / 1024
}

fn statement(trials: u64) {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("s.sqlite");
    let before = memory_mib();
    let schedule = schedule(trials);
    let store = create(&path);
    let started = Instant::now();
    run_all(&schedule, &store);
    let made = started.elapsed();
    let while_running = memory_mib();
    let closing = Instant::now();
    store.close(drop);
    let closed = closing.elapsed();
    let size = std::fs::metadata(&path).map_or(0, |meta| meta.len());
    let reading = Instant::now();
    let rows = Store::open_read_only(&path).and_then(|store| store.rows());
    assert_eq!(rows.expect("rows").len() as u64, schedule.len());
    println!(
        "{trials} trials: {:.1} s ({:.1} µs each), closed in {:.2} s; memory {before} MiB before, \
         {while_running} MiB at most; store {} MiB; read in {:.2} s",
        made.as_secs_f64(),
        made.as_secs_f64() * 1e6 / trials as f64,
        closed.as_secs_f64(),
        size >> 20,
        reading.elapsed().as_secs_f64(),
    );
}

fn main() {
    let mut arguments = std::env::args().skip_while(|argument| argument != "--trials");
    if let Some(trials) = arguments.nth(1).and_then(|count| count.parse().ok()) {
        statement(trials);
    } else {
        let mut criterion = Criterion::default().configure_from_args();
        cost_of_a_trial(&mut criterion);
        criterion.final_summary();
    }
}
