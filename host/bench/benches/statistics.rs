//! The bootstrap of 40,000 resamples, beside one that draws every value of every
//! resample and sorts it: the ratio of both is what `bootstrap_median` saves.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

use std::hint::black_box;

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use fleetyard_bench::statistics::{
    BOOTSTRAP_SEED, RESAMPLES, bootstrap_mean, bootstrap_median, median, quantile, sorted,
};
use fleetyard_world::SeededRandom;

fn plain(values: &[f64]) -> Option<[f64; 2]> {
    let mut random = SeededRandom::new("plain", BOOTSTRAP_SEED);
    let medians = (0..RESAMPLES).filter_map(|_| {
        let resample = values.iter().map(|_| values[random.below(values.len())]);
        median(&sorted(resample))
    });
    let medians = sorted(medians);
    Some([quantile(&medians, 0.025)?, quantile(&medians, 0.975)?])
}

fn bootstrap(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("bootstrap");
    group.sample_size(10);
    for n in [50, 1000] {
        let mut random = SeededRandom::new("values", n as u64);
        let values: Vec<f64> = (0..n).map(|_| -random.unit().ln()).collect();
        group.bench_with_input(BenchmarkId::new("median", n), &values, |bencher, values| {
            bencher.iter(|| bootstrap_median(black_box(values), RESAMPLES, BOOTSTRAP_SEED));
        });
        group.bench_with_input(BenchmarkId::new("mean", n), &values, |bencher, values| {
            bencher.iter(|| bootstrap_mean(black_box(values), RESAMPLES, BOOTSTRAP_SEED));
        });
        group.bench_with_input(
            BenchmarkId::new("plain median", n),
            &values,
            |bencher, values| {
                bencher.iter(|| plain(black_box(values)));
            },
        );
    }
    group.finish();
}

criterion_group!(benches, bootstrap);
criterion_main!(benches);
