//! Costs of a tick of an agent, per model and kind of motion: criterion's time is that of
//! [`AGENTS`] agents over a block of [`TICKS`] ticks, "elem/s" are agent-ticks. Every pose is
//! written to memory, as the simulator does.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fleetyard_sim::motion::{Model, State, Target};

const AGENTS: usize = 64;
/// A tenth of a second.
const TICKS: usize = 6;
const TICK_S: f64 = 1.0 / 60.0;

/// Agents of a benchmark: states after some blocks, and targets.
struct Scene {
    name: &'static str,
    model: &'static str,
    agents: Vec<(State, Target)>,
}

/// Agents in different places on their way, `spread` blocks apart at most.
fn scene(
    name: &'static str,
    model: &'static str,
    target: Target,
    skip: usize,
    spread: usize,
) -> Scene {
    let moves: Model = model.parse().expect("a preset");
    let agents = (0..AGENTS)
        .map(|agent| {
            let mut state = State::at_rest(0.0, 0.0, 0.0);
            for _ in 0..skip + agent % spread.max(1) {
                moves.run(&mut state, &target, TICKS, TICK_S, 1.0, &mut |_| ());
            }
            (state, target)
        })
        .collect();
    Scene {
        name,
        model,
        agents,
    }
}

fn motion(criterion: &mut Criterion) {
    let at = |x: f64, y: f64| Target {
        x,
        y,
        heading: None,
    };
    let heading = |heading: f64| Target {
        heading: Some(heading),
        ..at(0.0, 0.0)
    };
    let scenes = [
        scene("rest", "agv", at(0.0, 0.0), 0, 1),
        scene("cruise", "agv", at(1000.0, 0.0), 12, 10),
        scene("accelerate", "agv", at(1000.0, 0.0), 0, 8),
        scene("brake", "agv", at(4.0, 0.0), 21, 7),
        scene("all of a leg of 4 m", "agv", at(4.0, 0.0), 0, 30),
        scene("turn", "agv", heading(1.5), 0, 15),
        scene("turn and drive", "agv", at(0.0, 4.0), 0, 50),
        scene("turn and drive", "unicycle-1", at(0.0, 4.0), 0, 100),
        scene("turn and drive", "unicycle-2", at(0.0, 4.0), 0, 130),
        scene("all of a leg", "pebble", at(1.0, 1.0), 0, 1),
        scene("all of a leg", "single-integrator", at(1.0, 1.0), 0, 14),
        scene("all of a leg", "double-integrator", at(1.0, 1.5), 0, 34),
        scene("all of a leg", "go2", at(3.0, 1.5), 0, 30),
        scene(
            "all of a leg, turning",
            "go2",
            Target {
                heading: Some(1.0),
                ..at(3.0, 1.5)
            },
            0,
            30,
        ),
        scene("all of a leg", "waypoint-law", at(1.0, 1.5), 0, 40),
    ];
    let mut group = criterion.benchmark_group("motion");
    group.throughput(Throughput::Elements((AGENTS * TICKS) as u64));
    for Scene {
        name,
        model,
        agents,
    } in scenes
    {
        let moves: Model = model.parse().expect("a preset");
        let mut history = vec![[0.0; 3]; AGENTS * TICKS];
        group.bench_function(format!("{model}, {name}"), |bencher| {
            bencher.iter(|| {
                for (agent, (state, target)) in agents.iter().enumerate() {
                    let mut state = *state;
                    let mut slot = agent;
                    black_box(&moves).run(&mut state, target, TICKS, TICK_S, 1.0, &mut |now| {
                        history[slot] = [now.x, now.y, now.heading];
                        slot += AGENTS;
                    });
                    black_box(&state);
                }
                black_box(&mut history);
            });
        });
    }
    group.finish();
}

criterion_group!(benches, motion);
criterion_main!(benches);
