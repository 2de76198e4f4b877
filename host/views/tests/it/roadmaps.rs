//! Roadmaps of worlds: edges are free for the largest disc, the same parameters give the same bits, and
//! what does not work is refused with its reason.

use fleetyard_views::{
    Builder, Free, Problem, RoadmapSpec, RoadmapView, Sampling, load_problem, world_to_roadmap,
};
use proptest::prelude::*;

use crate::tasks::{TASKS, maps, problem_in};

fn prm(sampling: Sampling, vertices: usize) -> Builder {
    Builder::Prm {
        sampling,
        vertices,
        neighbors: 8,
    }
}

pub(crate) fn builders(vertices: usize) -> [Builder; 7] {
    let sampling = Sampling::Halton;
    [
        prm(Sampling::Uniform, vertices),
        prm(sampling, vertices),
        Builder::PrmStar { sampling, vertices },
        Builder::Delaunay { sampling, vertices },
        Builder::Tangent { sides: 8 },
        Builder::Lattice {
            side_m: 0.25,
            directions: 8,
        },
        Builder::Lattice {
            side_m: 0.25,
            directions: 32,
        },
    ]
}

/// Checks a roadmap against the free space of its problem.
fn check(problem: &Problem, view: &RoadmapView) {
    let free = Free::new(&problem.world);
    let radius = problem.common_radius_m();
    let at = |vertex: u32| <[f64; 2]>::from(view.roadmap.position_m(vertex));
    for (agent, ends) in problem.task.agents.iter().enumerate() {
        let bits = |place: [f64; 2]| place.map(f64::to_bits);
        assert_eq!(bits(at(view.starts[agent])), bits(ends.start.at_m()));
        assert_eq!(bits(at(view.goals[agent])), bits(ends.goal.at_m()));
    }
    for vertex in 0..view.roadmap.vertices() as u32 {
        assert!(free.holds(at(vertex), radius), "vertex {vertex}");
    }
    for (from, to) in view.roadmap.edges() {
        assert!(free.sweeps(at(from), at(to), radius), "{from} to {to}");
    }
    assert!(view.roadmap.is_symmetric());
    assert_eq!(2 * view.report.edges, view.roadmap.edge_count());
    for (start, goal) in view.starts.iter().zip(&view.goals) {
        let (from, to) = (
            view.report.size_around(*start),
            view.report.size_around(*goal),
        );
        assert_eq!(from, to);
    }
}

#[test]
fn every_builder_serves_every_example() {
    for name in TASKS {
        let problem = load_problem(maps(name)).unwrap();
        let mut digests = std::collections::BTreeSet::new();
        // The maze's corridors leave a robot a strip of 0.1 m.
        let vertices = if name == "maze.task.json" { 3000 } else { 300 };
        for builder in builders(vertices) {
            let spec = RoadmapSpec::new(builder);
            let view = world_to_roadmap(&problem, spec).unwrap();
            check(&problem, &view);
            let again = world_to_roadmap(&problem, spec).unwrap();
            assert_eq!(again.digest(), view.digest(), "{name} {builder:?}");
            assert_eq!(again.report, view.report);
            digests.insert(view.roadmap.digest());
        }
        assert_eq!(digests.len(), 7, "{name}");
    }
}

/// Vertices of one roadmap, its edges, and its digest, equal in every build and on every machine.
#[test]
fn roadmaps_are_golden() {
    let problem = load_problem(maps("two-rooms.task.json")).unwrap();
    let found: Vec<String> = builders(300)
        .map(|builder| {
            let view = world_to_roadmap(&problem, RoadmapSpec::new(builder)).unwrap();
            let (vertices, edges) = (view.report.vertices, view.report.edges);
            format!("{vertices} {edges} {}", view.digest())
        })
        .to_vec();
    assert_eq!(found, GOLDEN);
}

const GOLDEN: [&str; 7] = [
    "306 1382 fb7b43c29e5d162fa2665a350c7cd4ea",
    "306 1390 203889b22f6b04eba659f253018d9ea0",
    "306 4171 1c1b47a97abf0fe537b7a822449c8d32",
    "306 835 f2a6ee13ad5e8ef5b494f41255402a4c",
    "32 58 ab091962e210131e1c3f88e0a18474ef",
    "762 2730 350aef11940cddfe0e48dc5f70a8c419",
    "762 9505 2f522894cd169b3bba64dfc0b1814ef4",
];

#[test]
fn the_seed_draws_and_the_distance_is_kept_or_told() {
    let problem = load_problem(maps("two-rooms.task.json")).unwrap();
    let spec = RoadmapSpec::new(prm(Sampling::Uniform, 60));
    let one = world_to_roadmap(&problem, spec).unwrap();
    let other = RoadmapSpec {
        seed: Some(2),
        ..spec
    };
    let other = world_to_roadmap(&problem, other).unwrap();
    assert_ne!(one.roadmap.digest(), other.roadmap.digest());
    assert_eq!(one.report.spacing_m, Some(2.0 * problem.common_radius_m()));
    assert_eq!(one.report.close_pairs, 0);
    // More than fit 2r apart: the distance shrinks, and vertices are close.
    let crowded = RoadmapSpec::new(prm(Sampling::Uniform, 2000));
    let crowded = world_to_roadmap(&problem, crowded).unwrap();
    assert!(crowded.report.spacing_m.unwrap() < 2.0 * problem.common_radius_m());
    assert!(crowded.report.close_pairs > 0);
    assert!(crowded.report.coverage.unwrap() > 0.999);
}

/// Shortest paths on a tangent graph of 64 sides are no longer than those of the densest lattice, and
/// those round a box are as long as the string round its corners.
#[test]
fn tangent_graphs_hold_nearly_shortest_paths() {
    let box_between = r#"{"rectangle": {"center": [2, 2], "size": [1, 1]}}"#;
    let agent = r#"{"start": [0.5, 2], "goal": [3.5, 2]}"#;
    let problem = problem_in(box_between, agent).unwrap();
    let length = |builder| {
        let view = world_to_roadmap(&problem, RoadmapSpec::new(builder)).unwrap();
        shortest_m(&view, 0)
    };
    // Two lines of length 1 m and 0.5 m legs tangent to circles of 0.25 m round two corners.
    let (dx, dy, r) = (1.0_f64, 0.5_f64, 0.25_f64);
    let far = dx.hypot(dy);
    let line = (far * far - r * r).sqrt();
    let turn = dy.atan2(dx) + (r / far).asin();
    let exact = 1.0 + 2.0 * (line + r * turn);
    let tangent = length(Builder::Tangent { sides: 64 });
    assert!(
        tangent >= exact - 1e-9 && tangent < exact + 1e-3,
        "{tangent} {exact}"
    );
    let lattice = length(Builder::Lattice {
        side_m: 0.05,
        directions: 32,
    });
    assert!(lattice > tangent, "{lattice} {tangent}");
}

/// Length of an agent's shortest path, by Bellman's relaxation.
fn shortest_m(view: &RoadmapView, agent: usize) -> f64 {
    let roadmap = &view.roadmap;
    let mut far = vec![f64::INFINITY; roadmap.vertices()];
    far[view.starts[agent] as usize] = 0.0;
    loop {
        let mut changed = false;
        for (from, to) in roadmap.edges() {
            let (a, b) = (roadmap.position_m(from), roadmap.position_m(to));
            let through = far[from as usize] + (a.0 - b.0).hypot(a.1 - b.1);
            if through < far[to as usize] - 1e-12 {
                far[to as usize] = through;
                changed = true;
            }
        }
        if !changed {
            return far[view.goals[agent] as usize];
        }
    }
}

#[test]
fn what_cannot_be_a_roadmap_is_refused() {
    let wall = r#"{"rectangle": {"center": [2, 2], "size": [0.2, 4]}}"#;
    let agent = r#"{"start": [1, 2], "goal": [3, 2]}"#;
    let problem = problem_in(wall, agent).unwrap();
    for builder in builders(100) {
        let error = world_to_roadmap(&problem, RoadmapSpec::new(builder)).unwrap_err();
        let told = "agent 0 cannot reach its goal: the roadmap has ";
        assert!(error.reason.starts_with(told), "{error}");
        assert!(error.hint.is_some());
    }
    let wrong = [
        (Builder::Tangent { sides: 3 }, "circles of 3 sides"),
        (prm(Sampling::Uniform, usize::MAX), "more than 1048576"),
        (
            Builder::Lattice {
                side_m: f64::NAN,
                directions: 8,
            },
            "sides of NaN m",
        ),
        (
            Builder::Lattice {
                side_m: 1.0,
                directions: 6,
            },
            "6 directions",
        ),
        (
            Builder::Lattice {
                side_m: 1e-6,
                directions: 4,
            },
            "more than 1048576",
        ),
    ];
    for (builder, told) in wrong {
        let error = world_to_roadmap(&problem, RoadmapSpec::new(builder)).unwrap_err();
        assert!(error.reason.contains(told), "{error}");
    }
    let spec = RoadmapSpec {
        speed_m_per_s: Some(0.0),
        ..RoadmapSpec::new(prm(Sampling::Uniform, 10))
    };
    let error = world_to_roadmap(&problem, spec).unwrap_err();
    assert!(error.reason.contains("not 0 m/s"), "{error}");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    #[test]
    fn roadmaps_of_any_world_are_free(
        center in (0.8..3.2f64, 0.8..3.2f64),
        size in (0.05..1.2f64, 0.05..1.2f64),
        angle in 0.0..3.0f64,
        seed in any::<u64>(),
        which in 0..7usize,
    ) {
        let obstacle = format!(
            r#"{{"rectangle": {{"center": [{}, {}], "size": [{}, {}], "angle_rad": {angle}}}}}"#,
            center.0, center.1, size.0, size.1,
        );
        let agents = r#"{"start": [0.3, 0.3], "goal": [3.7, 3.7]}"#;
        let Ok(problem) = problem_in(&obstacle, agents) else { return Ok(()) };
        let spec = RoadmapSpec { seed: Some(seed), ..RoadmapSpec::new(builders(100)[which]) };
        if let Ok(view) = world_to_roadmap(&problem, spec) {
            check(&problem, &view);
        }
    }
}
