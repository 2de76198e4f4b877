//! Time to the first plan by repair, and of improvement up to a fixed limit, on generated maps.

use criterion::{BenchmarkId, Criterion, criterion_group, criterion_main};
use fleetyard_plugin_neighborhood::repair::{Control, repair};
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem};
use fleetyard_plugin_spacetime::refine::{Refiner, Shortest};
use fleetyard_testkit::Case;

/// Rounds of improvement.
const ROUNDS: usize = 200;

fn problem(side: u32, agents: usize) -> Problem {
    let case = Case::square(side, agents, 2, 0);
    Ground::new(&case.map, 1 << 30)
        .and_then(|mut ground| ground.problem(&case.instance, GoalRule::Stay, &mut || false))
        .expect("agents are in one part of the map")
}

fn planners(criterion: &mut Criterion) {
    let mut group = criterion.benchmark_group("repair");
    group.sample_size(10);
    for (side, agents) in [(32, 200), (32, 300), (64, 400)] {
        let problem = problem(side, agents);
        let id = BenchmarkId::from_parameter(format!("{side}x{side}, {agents} agents"));
        group.bench_with_input(id, &problem, |bencher, problem| {
            bencher.iter(|| {
                let mut control = Control {
                    stop: &mut || false,
                    nodes: u64::MAX,
                };
                repair(problem, 8, 0, &mut control)
            });
        });
    }
    group.finish();
    let mut group = criterion.benchmark_group("improve");
    group.sample_size(10);
    for (side, agents) in [(32, 200), (64, 400)] {
        let problem = problem(side, agents);
        let mut control = Control {
            stop: &mut || false,
            nodes: u64::MAX,
        };
        let first = repair(&problem, 8, 0, &mut control).paths;
        let last = |path: &Vec<Vertex>| path.last().copied();
        let goals: Vec<Vertex> = first.iter().filter_map(last).collect();
        let id = BenchmarkId::from_parameter(format!("{side}x{side}, {agents} agents"));
        group.bench_with_input(id, &problem, |bencher, problem| {
            bencher.iter(|| {
                let mut refiner = Refiner::new(&problem.graph, &goals, first.clone(), false, 1, 0);
                let shortest = Shortest {
                    goals: &goals,
                    team: &problem.routes[..],
                };
                let gains = (0..ROUNDS).map(|_| refiner.round(&shortest, &mut || false).gain);
                gains.sum::<u64>()
            });
        });
    }
    group.finish();
}

criterion_group!(benches, planners);
criterion_main!(benches);
