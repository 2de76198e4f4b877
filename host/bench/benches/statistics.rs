//! Costs of the resampling in a comparison of two planners: flips of signs, and the posterior of a
//! signed-rank test.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use fleetyard_bench::statistics::{BOOTSTRAP_SEED, bayesian_signed_rank, sign_flip_test};
use fleetyard_world::SeededRandom;

fn comparison(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("comparison");
    group.sample_size(10);
    for n in [50, 500] {
        let mut random = SeededRandom::new("values", n as u64);
        let values: Vec<f64> = (0..n).map(|_| random.unit() - 0.4).collect();
        group.bench_with_input(
            BenchmarkId::new("sign flips", n),
            &values,
            |bencher, values| {
                bencher.iter(|| sign_flip_test(black_box(values), BOOTSTRAP_SEED));
            },
        );
        group.bench_with_input(
            BenchmarkId::new("signed rank", n),
            &values,
            |bencher, values| {
                bencher
                    .iter(|| bayesian_signed_rank(black_box(values), 0.05, 2000, BOOTSTRAP_SEED));
            },
        );
    }
    group.finish();
}

criterion_group!(benches, comparison);
criterion_main!(benches);
