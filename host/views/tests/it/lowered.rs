//! Plans of views in the world, and back; tasks with fewer agents; views again by their parameters.

use fleetyard_check::Pace;
use fleetyard_core::{Connectivity, GridPlan, Knot, Separation, TrajectoryPlan};
use fleetyard_views::{
    Builder, BuilderKind, GridSpec, GridView, RoadmapParameters, RoadmapSpec, ViewName, ViewSpec,
    load_problem, world_to_grid, world_to_roadmap,
};
use fleetyard_world::SeededRandom;
use serde_json::Value;

use crate::tasks::{TASKS, maps};

const GRID: GridSpec = GridSpec {
    connectivity: Connectivity::Four,
    separation: Separation::Rules,
};

fn walks(view: &GridView, random: &mut SeededRandom) -> GridPlan {
    let grid = view.instance.grid();
    let mut paths = Vec::new();
    for start in view.instance.starts() {
        let mut path = vec![*start];
        for _ in 0..random.below(12) {
            let at = path[path.len() - 1];
            let ways: Vec<u32> = grid
                .neighbors(at, view.spec.connectivity)
                .chain([at])
                .collect();
            path.push(ways[random.below(ways.len())]);
        }
        paths.push(path);
    }
    GridPlan::from_paths(paths)
}

#[test]
fn plans_on_grids_come_back_from_the_world() {
    let problem = load_problem(maps("two-rooms.task.json")).unwrap();
    let view = world_to_grid(&problem, GRID).unwrap();
    let mut random = SeededRandom::new("walks", 7);
    for _ in 0..50 {
        let plan = walks(&view, &mut random);
        for step_s in [0.5, 0.1, 3.0] {
            let lifted = view.lift(&plan, step_s).unwrap();
            let lowered = view.lower(&lifted, step_s).unwrap();
            // Waits at the end mean nothing.
            assert_eq!(lowered.trimmed(), plan.trimmed());
        }
    }
}

#[test]
fn ways_that_are_none_of_a_grid_are_named() {
    let problem = load_problem(maps("two-rooms.task.json")).unwrap();
    let view = world_to_grid(&problem, GRID).unwrap();
    let way = |knots: &[[f64; 3]]| {
        let mut plan = TrajectoryPlan::default();
        let knots = knots.iter().map(|[time_s, x_m, y_m]| Knot {
            time_s: *time_s,
            x_m: *x_m,
            y_m: *y_m,
            heading_rad: None,
        });
        plan.push_path(knots).unwrap();
        plan
    };
    let lower = |knots: &[[f64; 3]], step_s: f64| view.lower(&way(knots), step_s);
    // Six cells in six steps, though no knot is between them.
    let straight = [[0.0, 0.25, 0.25], [3.0, 3.25, 0.25]];
    let lowered = lower(&straight, 0.5).unwrap();
    assert_eq!(lowered.path(0).len(), 7);
    let cases = [
        (lower(&straight, 0.4), "agent 0 turns or stops at 3 s"),
        (
            lower(&straight, 0.25),
            "agent 0 is at (0.5, 0.25) at 0.25 s, 0.250 m from the middle",
        ),
        (
            lower(&[[0.0, 0.3, 0.25]], 0.5),
            "agent 0 is at (0.3, 0.25) at 0 s, 0.050 m from",
        ),
        (lower(&straight, 0.0), "a step of 0 s is none"),
        (lower(&straight, 1e-9), "the paths have more than"),
    ];
    for (lowered, expected) in cases {
        let reason = lowered.unwrap_err();
        assert!(reason.starts_with(expected), "{reason}");
    }
}

#[test]
fn plans_on_roadmaps_come_back_from_the_world() {
    let problem = load_problem(maps("two-rooms.task.json")).unwrap();
    let spec = RoadmapSpec::new(Builder::Tangent { sides: 16 });
    let view = world_to_roadmap(&problem, spec).unwrap();
    let mut random = SeededRandom::new("visits", 3);
    let mut plan = fleetyard_core::RoadmapPlan::default();
    for start in &view.starts {
        let (mut vertex, mut time_s) = (*start, 0.0);
        let mut visits = Vec::new();
        for _ in 0..8 {
            let wait_s = random.below(3) as f64;
            visits.push(fleetyard_core::Visit {
                vertex,
                arrival_s: time_s,
                departure_s: time_s + wait_s,
            });
            let next = view.roadmap.neighbors(vertex);
            vertex = next[random.below(next.len())];
            time_s += wait_s + 0.75;
        }
        plan.push_path(visits).unwrap();
    }
    let lowered = view.lower(&view.lift(&plan).unwrap()).unwrap();
    assert_eq!(lowered.digest(), plan.digest());
}

#[test]
fn a_task_is_cut_to_its_first_agents() {
    for name in TASKS {
        let problem = load_problem(maps(name)).unwrap();
        let all = problem.task.agents.len();
        assert_eq!(problem.clone().first(all + 5).digest(), problem.digest());
        let two = problem.clone().first(2);
        assert_eq!((two.task.agents.len(), two.fleet.agents()), (2, 2));
        assert_eq!(two.task.agents, problem.task.agents[..2]);
        assert_eq!(two.fleet.profile_of(), &problem.fleet.profile_of()[..2]);
        assert_ne!(two.digest(), problem.digest());
        assert!(two.common_radius_m() <= problem.common_radius_m());
    }
}

#[test]
fn parameters_derive_the_same_view_again() {
    let problem = load_problem(maps("two-rooms.task.json")).unwrap();
    let specs = [
        ViewName::Grid.spec(GRID, None),
        ViewName::Sparse.spec(GRID, Some(4)),
        ViewSpec::Roadmap(RoadmapSpec::new(Builder::Tangent { sides: 8 })),
        ViewSpec::Roadmap(RoadmapSpec::new(
            RoadmapParameters {
                kind: BuilderKind::Lattice,
                side_m: Some(0.5),
                ..RoadmapParameters::default()
            }
            .builder(),
        )),
    ];
    for spec in specs {
        let view = spec.derive(&problem).unwrap();
        let terms = view.terms(&problem, Separation::Rules, Pace::StopGo, None);
        let told = spec.parameters(&problem, terms);
        let again = match spec {
            ViewSpec::Roadmap(_) => {
                let own = told.iter();
                let own =
                    own.filter(|(key, _)| !["representation", "pace"].contains(&key.as_str()));
                let own: serde_json::Map<String, Value> = own
                    .map(|(key, value)| (key.clone(), value.clone()))
                    .collect();
                let own: RoadmapParameters = serde_json::from_value(own.into()).unwrap();
                ViewSpec::Roadmap(own.spec())
            }
            other => other,
        };
        let again = again.derive(&problem).unwrap();
        assert_eq!(again.digest(&problem), view.digest(&problem), "{told:?}");
    }
}
