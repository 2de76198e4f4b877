//! Costs of a roadmap of 4032 vertices and of a plan of 60 robots for the host, by attachment: handing the view over,
//! and a call that answers with 64 visits for each robot.
//!
//! The planner is a part of this benchmark: its answer is ready, so that a call is what crossing costs. The program for
//! `stdio` is this benchmark itself, which serves the planner when it is told to.

#![allow(missing_docs, reason = "criterion generates undocumented items")]

use std::time::Duration;

use criterion::{Criterion, criterion_group};
use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, Environment, Instance, Kind, Lists, Motion,
    RoadmapEnvironment, SharedEnvironment, Visit, VisitPlan, c, serve,
};
use fleetyard_runtime::{Attach, Limits, PluginFile, Runtime, Session, supervisor};

const SERVE: &str = "__serve";
const SIDE: u32 = 64;
const ROBOTS: u32 = 60;
const VISITS: u32 = 64;

/// Answers every call with the same walk.
struct Walk(VisitPlan);

impl Plugin for Walk {
    fn descriptor() -> Descriptor {
        Descriptor {
            capabilities: Capabilities::of(&[Capability::Roadmap, Capability::StopGo]),
            ..Descriptor::new(Kind::Planner, "walk", "")
        }
    }

    fn create(_: Options<'_>) -> Result<Self, Failure> {
        let path = |robot: u32| {
            (0..VISITS)
                .map(move |number| visit(robot, number))
                .collect()
        };
        Ok(Self(
            (0..ROBOTS)
                .map(path)
                .collect::<Vec<Vec<Visit>>>()
                .into_iter()
                .collect(),
        ))
    }
}

/// Each robot goes along a row of the lattice.
fn visit(robot: u32, number: u32) -> Visit {
    let time_s = f64::from(number) * 0.503;
    Visit {
        vertex: robot * SIDE + number,
        arrival_s: time_s,
        departure_s: time_s,
    }
}

impl Planner for Walk {
    type Map = ();

    fn prepare(&mut self, _: &SharedEnvironment, _: &Budget, _: &dyn Sink) -> Result<(), Failure> {
        Ok(())
    }

    fn plan(
        &mut self,
        (): &mut (),
        _: &Instance,
        _: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        Ok(sink.submit(&self.0)?)
    }
}

fleetyard_abi::export! { planners: [Walk] }

static BUILT_IN: &[&c::PluginEntry] = &[&fleetyard_plugin_entry_v1];

/// Row and column of a vertex.
fn place(vertex: u32) -> [u32; 2] {
    [vertex / SIDE, vertex % SIDE]
}

/// A lattice whose vertices are no round numbers, each joined with the twelve nearest.
fn roadmap() -> SharedEnvironment {
    let vertices = 0..SIDE * (SIDE - 1);
    let axis = |axis: usize| -> Vec<f64> {
        let shifted =
            |at: [u32; 2]| 0.503 * f64::from(at[axis]) + 0.001 / (1.0 + f64::from(at[1 - axis]));
        vertices
            .clone()
            .map(|vertex| shifted(place(vertex)))
            .collect()
    };
    let apart = |a: [u32; 2], b: [u32; 2]| a[0].abs_diff(b[0]).pow(2) + a[1].abs_diff(b[1]).pow(2);
    let near = |from: u32| -> Vec<u32> {
        let ends = vertices.clone();
        ends.filter(|to| (1..=4).contains(&apart(place(from), place(*to))))
            .collect()
    };
    let edges: Lists<u32> = vertices.clone().map(near).collect();
    let roadmap = RoadmapEnvironment::straight(axis(1), axis(0), edges, 1.0, 0.1);
    SharedEnvironment::new(Environment::from(roadmap).named("lattice"))
}

fn instance() -> Instance {
    let end = |number: u32| (0..ROBOTS).map(move |robot| visit(robot, number).vertex);
    Instance {
        starts: end(0).collect(),
        goals: Lists::single(end(VISITS - 1).collect()),
        motion: Motion::StopGo,
        radius_m: 0.05,
        ..Instance::default()
    }
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

fn session(file: &PluginFile, attach: Attach) -> Session {
    let runtime = Runtime::new(BUILT_IN, Limits::default()).expect("a runtime");
    let mut session = runtime.open(file, attach).expect("the plugin starts");
    session
        .create(Kind::Planner, "walk", serde_json::json!({}))
        .expect("it is made");
    session
}

fn roadmaps(criterion: &mut Criterion) {
    let (environment, instance) = (roadmap(), instance());
    let itself = std::env::current_exe().expect("a path");
    let serve = vec![itself.display().to_string(), SERVE.to_owned()];
    let program = PluginFile::Program(itself, serve);
    let cases = [
        ("in-process", &PluginFile::BuiltIn, Attach::InProcess),
        ("worker", &PluginFile::BuiltIn, Attach::Worker),
        ("stdio", &program, Attach::Stdio),
    ];
    let mut group = criterion.benchmark_group("roadmap of 4032 vertices");
    group
        .measurement_time(Duration::from_secs(3))
        .sample_size(50);
    for (name, file, attach) in cases {
        let mut session = session(file, attach);
        group.bench_function(format!("view, {name}"), |bencher| {
            bencher.iter(|| {
                session
                    .prepare(&environment, &budget())
                    .expect("it is prepared")
            });
        });
        group.bench_function(format!("plan of 60 robots, {name}"), |bencher| {
            bencher.iter(|| {
                let run = session.plan(&instance, &budget());
                assert!(run.fault.is_none(), "{:?}", run.fault);
                run
            });
        });
        session.close();
    }
    group.finish();
}

criterion_group!(benches, roadmaps);

fn main() {
    supervisor::intercept(BUILT_IN);
    if std::env::args().nth(1).as_deref() == Some(SERVE) {
        std::process::exit(serve::serve_stdio(catalog()));
    }
    benches();
    Criterion::default().configure_from_args().final_summary();
}
