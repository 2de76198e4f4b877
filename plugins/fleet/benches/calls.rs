//! Costs of a call of each plugin: fleets of 1000 and 10,000 agents on warehouses of shelves 2 × 10
//! with aisles of two cells.

#![allow(missing_docs)]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Duration;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use fleetyard_abi::sdk::{
    FailPolicy, InstanceGenerator, InvocationPolicy, Options, Plugin, Rejected, Sink,
};
use fleetyard_abi::{
    Budget, FleetState, FleetStatus, Goals, GridEnvironment, GridPlan, Instance, LogLevel, Plan,
    PlanRef, Request, SharedEnvironment,
};
use fleetyard_plugin_fleet::generate::{DistinctOneGoal, OneGoal, WindowedMultiGoals};
use fleetyard_plugin_fleet::invocation::{EventBased, Periodic};
use fleetyard_plugin_fleet::recover::{AllWait, GuidedPibt, Lrgw, Pibt, RuleBased};

const BUDGET: Budget = Budget {
    deadline_monotonic_ns: u64::MAX,
    answer_by_ns: u64::MAX,
    wall_ns: 1_000_000_000,
    nodes: 0,
    memory_bytes: 0,
    threads: 1,
    seed: 1,
};

struct Taken;

impl Sink for Taken {
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected> {
        black_box(plan.entries());
        Ok(())
    }
    fn submit_request(&self, request: &Request) -> Result<(), Rejected> {
        black_box(request.goals.len());
        Ok(())
    }
    fn note(&self, _: &str, _: &str) {}
    fn metric(&self, _: &str, _: f64) {}
    fn log(&self, _: LogLevel, _: &str) {}
    fn progress(&self, _: u64, _: u64) {}
    fn cancelled(&self) -> bool {
        false
    }
}

fn below(state: &mut u64, bound: usize) -> usize {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1);
    (*state >> 33) as usize % bound
}

type Yard = (usize, SharedEnvironment, FleetState, Plan);

/// A warehouse, a fleet in a fifth of its free cells, and walks of twenty steps that collide.
fn yard(agents: usize) -> Yard {
    let side = ((agents * 8) as f64).sqrt() as u32;
    let free = |cell: u32| !((cell / side) % 4 < 2 && (cell % side) % 12 < 10);
    let passable: Vec<u8> = (0..side * side).map(|cell| free(cell).into()).collect();
    let environment = Arc::new(GridEnvironment::four_connected(side, side, passable).into());
    let mut state = 1;
    let mut cells: Vec<u32> = (0..side * side).filter(|cell| free(*cell)).collect();
    let all = cells.clone();
    for last in (1..cells.len()).rev() {
        cells.swap(last, below(&mut state, last + 1));
    }
    cells.truncate(agents);
    let goals = (0..agents).map(|_| [(); 4].map(|()| all[below(&mut state, all.len())]));
    let goals: Goals = goals.collect();
    let walks = cells.iter().map(|start| {
        let mut path = vec![*start];
        let mut direction = below(&mut state, 4);
        for _ in 0..20 {
            let here = path[path.len() - 1];
            let to = match direction {
                0 if here >= side => here - side,
                1 if here % side + 1 < side => here + 1,
                2 if here + side < side * side => here + side,
                3 if here % side > 0 => here - 1,
                _ => here,
            };
            if !free(to) || below(&mut state, 6) == 0 {
                direction = below(&mut state, 4);
            }
            path.push(if free(to) { to } else { here });
        }
        path
    });
    let walks = GridPlan::from_paths(walks.collect::<Vec<_>>()).into();
    let fleet = FleetState {
        time_s: 10.0,
        next: Instance {
            starts: cells,
            goals,
            window_steps: 20,
            radius_m: 0.4,
            ..Instance::default()
        },
        tasks: Vec::new(),
        parts: Vec::new(),
    };
    (agents, environment, fleet, walks)
}

/// The time of this thread that some calls cost, whatever else the machine has to do.
fn timed<R>(times: u64, mut call: impl FnMut() -> R) -> Duration {
    let now = || {
        let now = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
        Duration::new(now.tv_sec as u64, now.tv_nsec as u32)
    };
    let start = now();
    for _ in 0..times {
        black_box(call());
    }
    now().saturating_sub(start)
}

fn made<P: Plugin>() -> P {
    P::create(Options::new("{}")).unwrap_or_else(|failure| panic!("{failure}"))
}

fn generator<P: InstanceGenerator>(c: &mut Criterion, fleets: &[Yard]) {
    for (agents, environment, fleet, _) in fleets {
        let mut generator = made::<P>();
        let mut map = generator
            .prepare(environment, &BUDGET, &Taken)
            .expect("it learns the map");
        c.bench_function(&format!("{}/{agents}", P::descriptor().id), |b| {
            b.iter_custom(|times| {
                timed(times, || {
                    generator.generate(&mut map, fleet, &BUDGET, &Taken)
                })
            });
        });
    }
}

fn policy<P: FailPolicy>(c: &mut Criterion, fleets: &[Yard]) {
    for (agents, environment, fleet, walks) in fleets {
        let mut policy = made::<P>();
        let mut map = policy
            .prepare(environment, &BUDGET, &Taken)
            .expect("it learns the map");
        let instance = fleet.next.clone();
        c.bench_function(&format!("{}/{agents}", P::descriptor().id), |b| {
            b.iter_custom(|times| {
                timed(times, || {
                    policy.recover(&mut map, &instance, Some(walks), &BUDGET, &Taken)
                })
            });
        });
    }
}

fn benches(c: &mut Criterion) {
    let fleets = [1000, 10_000].map(yard);
    generator::<OneGoal>(c, &fleets);
    generator::<DistinctOneGoal>(c, &fleets);
    generator::<WindowedMultiGoals>(c, &fleets);
    policy::<AllWait>(c, &fleets);
    policy::<Pibt>(c, &fleets);
    policy::<GuidedPibt>(c, &fleets);
    policy::<Lrgw>(c, &fleets);
    policy::<RuleBased>(c, &fleets);
    for (agents, _, fleet, _) in &fleets {
        let status = FleetStatus {
            time_s: 10.0,
            since_last_call_s: 0.5,
            planning_limit_s: 1.0,
            action_s: 0.5,
            actions_left: vec![7; fleet.next.agents()],
        };
        let (mut periodic, mut event) = (made::<Periodic>(), made::<EventBased>());
        c.bench_with_input(
            BenchmarkId::new("periodic", agents),
            &status,
            |b, status| {
                b.iter_custom(|times| timed(times, || periodic.should_invoke(status, &Taken)));
            },
        );
        c.bench_with_input(
            BenchmarkId::new("event-based", agents),
            &status,
            |b, status| {
                b.iter_custom(|times| timed(times, || event.should_invoke(status, &Taken)));
            },
        );
    }
}

criterion_group! {
    name = calls;
    config = Criterion::default().sample_size(10);
    targets = benches
}
criterion_main!(calls);
