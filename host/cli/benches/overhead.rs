//! Costs of a `plan` call for the host, by attachment: an empty planner, 1000 agents on
//! `warehouse-10-20-10-2-1`.
//!
//! `copy` is the baseline: copying the plan once. The program for `stdio` is this
//! benchmark itself, which serves the built-in plugins when it is told to.

#![allow(missing_docs)]

use std::sync::Arc;
use std::time::Duration;

use criterion::{Criterion, criterion_group};
use fleetyard_abi::{Budget, GridPlan, Instance, Kind, Lists, SharedEnvironment, c, serve};
use fleetyard_core::{Connectivity, GridInstance};
use fleetyard_runtime::{Attach, Limits, PluginFile, Runtime, Session, plan_from_abi, supervisor};
use fleetyard_world::{ScenarioSpec, WarehouseSpec};

static BUILT_IN: &[&c::PluginEntry] = &[&fleetyard_plugins::fleetyard_plugin_entry_v1];
const SERVE: &str = "__serve-built-ins";
const AGENTS: usize = 1000;

fn world() -> (SharedEnvironment, Instance) {
    let warehouse = WarehouseSpec {
        blocks_across: 10,
        blocks_down: 20,
        block_cols: 10,
        block_rows: 2,
        aisle: 1,
        ..WarehouseSpec::default()
    };
    let grid = warehouse
        .generate()
        .expect("the parameters are those of the benchmark");
    let scenario = ScenarioSpec {
        agents: AGENTS as u32,
        seed: 1,
    }
    .generate(&grid)
    .expect("room");
    let instance: GridInstance = scenario
        .instance(Arc::new(grid), AGENTS, Connectivity::Four)
        .expect("an instance");
    let environment = fleetyard_runtime::environment(&instance, 1.0, 1.0);
    (environment, fleetyard_runtime::instance(&instance, 0.35))
}

fn budget() -> Budget {
    Budget {
        deadline_monotonic_ns: 0,
        answer_by_ns: 0,
        wall_ns: 10_000_000_000,
        nodes: 0,
        memory_bytes: 0,
        threads: 1,
        seed: 0,
    }
}

fn session(file: &PluginFile, attach: Attach, environment: &SharedEnvironment) -> Session {
    let runtime = Runtime::new(BUILT_IN, Limits::default()).expect("a runtime");
    let mut session = runtime.open(file, attach).expect("the plugin starts");
    session
        .create(Kind::Planner, "empty", serde_json::json!({}))
        .expect("it is made");
    session
        .prepare(environment, &budget())
        .expect("it is prepared");
    session
}

fn overhead(criterion: &mut Criterion) {
    let (environment, instance) = world();
    let itself = std::env::current_exe().expect("a path");
    let serve = vec![itself.display().to_string(), SERVE.to_owned()];
    let program = PluginFile::Program(itself, serve);
    let mut group = criterion.benchmark_group("plan call, empty planner, 1000 agents");
    group
        .measurement_time(Duration::from_secs(3))
        .sample_size(50);
    let plan = GridPlan::from(Lists::single(instance.starts.clone()));
    group.bench_function("copy", |bencher| {
        bencher.iter(|| plan_from_abi(&plan, u32::MAX));
    });
    let cases = [
        ("in-process", &PluginFile::BuiltIn, Attach::InProcess),
        ("worker", &PluginFile::BuiltIn, Attach::Worker),
        ("stdio", &program, Attach::Stdio),
    ];
    for (name, file, attach) in cases {
        let mut session = session(file, attach, &environment);
        group.bench_function(name, |bencher| {
            bencher.iter(|| {
                let run = session.plan(&instance, &budget());
                assert!(run.fault.is_none(), "{:?}", run.fault);
                run
            });
        });
        session.close();
    }
    group.finish();

    let mut group = criterion.benchmark_group("session, from start to nothing left");
    group
        .measurement_time(Duration::from_secs(3))
        .sample_size(20);
    group.bench_function("worker", |bencher| {
        bencher.iter(|| session(&PluginFile::BuiltIn, Attach::Worker, &environment).close());
    });
    group.finish();
}

criterion_group!(benches, overhead);

fn main() {
    supervisor::intercept(BUILT_IN);
    if std::env::args().nth(1).as_deref() == Some(SERVE) {
        std::process::exit(serve::serve_stdio(fleetyard_plugins::catalog()));
    }
    benches();
    Criterion::default().configure_from_args().final_summary();
}
