//! Time to the plan on generated maps, optimal and within a factor, pebbles and robots that turn.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use fleetyard_plugin_conflict::{Settings, solve};
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground};
use fleetyard_testkit::Case;

/// An empty square; starts and goals are spread by multiplication.
fn case(side: u32, agents: u32) -> Case {
    let row = ".".repeat(side as usize);
    let map = vec![row.as_str(); side as usize];
    let noise = |cell: u32| {
        cell.wrapping_mul(0x9e37_79b1)
            .rotate_left(15)
            .wrapping_mul(0x85eb_ca6b)
    };
    let pick = |salt: u32| {
        let mut cells: Vec<u32> = (0..side * side).collect();
        cells.sort_by_key(|&cell| noise(cell ^ salt));
        cells.into_iter().take(agents as usize)
    };
    let pairs: Vec<(u32, u32)> = pick(0x5bd1_e995).zip(pick(0x1b87_3593)).collect();
    Case::new(&map, &pairs)
}

fn planners(criterion: &mut Criterion) {
    let settings = |weight| Settings {
        weight,
        node_limit: Some(2000),
        ..Settings::default()
    };
    let cases = [
        ("optimal", settings(1.0), case(32, 60)),
        ("optimal, turning", settings(1.0), case(32, 20).turning()),
        ("within 1.2", settings(1.2), case(32, 200)),
        ("within 1.2, turning", settings(1.2), case(32, 60).turning()),
    ];
    let mut group = criterion.benchmark_group("conflict");
    group.sample_size(10);
    for (name, settings, case) in cases {
        let problem = Ground::new(&case.map, 1 << 30)
            .and_then(|mut ground| ground.problem(&case.instance, GoalRule::Stay, &mut || false))
            .expect("a square without obstacles");
        let id = BenchmarkId::new(name, case.instance.agents());
        group.bench_function(id, |bencher| {
            bencher.iter(|| solve(&problem, &settings, &mut || false));
        });
    }
    group.finish();
}

criterion_group!(benches, planners);
criterion_main!(benches);
