//! Costs of measurement: once per process (the machine), or twice per trial (a snapshot; reserving
//! and releasing a core).

use criterion::{Criterion, criterion_group, criterion_main};
use fleetyard_runtime::measure::{Machine, Snapshot, Topology, pin};

fn measure(c: &mut Criterion) {
    let mut group = c.benchmark_group("measure");
    group.bench_function("machine", |b| {
        b.iter(Machine::read);
    });
    group.bench_function("snapshot of all CPUs", |b| b.iter(|| Snapshot::take(None)));
    if let Ok(topology) = Topology::of_this_process() {
        let cpus = topology.cpus();
        group.bench_function("snapshot of given CPUs", |b| {
            b.iter(|| Snapshot::take(Some(&cpus)));
        });
        group.bench_function("pin", |b| b.iter(|| pin(None, &cpus)));
        if topology.reserve(1).is_ok() {
            group.bench_function("reserve one core", |b| b.iter(|| topology.reserve(1)));
        }
    }
    group.finish();
}

criterion_group!(benches, measure);
criterion_main!(benches);
