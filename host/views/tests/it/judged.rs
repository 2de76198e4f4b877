//! Plans of views in the world of their task: rules and footprints say the same where robots keep
//! strictly apart, and differ where the rules of MAPF let them come nearer.

use fleetyard_check::{ContinuousRule, Pace, Rule};
use fleetyard_core::{
    Connectivity, GridPlan, Knot, RoadmapPlan, Separation, TrajectoryPlan, Visit, load_roadmap_plan,
};
use fleetyard_views::{
    Builder, GridSpec, GridTerms, GridView, Judged, Problem, RoadmapSpec, Sampling, ViewVerdict,
    load_problem, world_to_grid, world_to_roadmap,
};
use fleetyard_world::SeededRandom;

use crate::tasks::{maps, problem_in};

const PILLAR: &str = r#"{"rectangle": {"center": [2, 2], "size": [0.4, 0.4]}}"#;

/// A problem of robots with a radius of 0.25 m that go from place to place, if it is one.
fn problem(ends: impl Iterator<Item = [[f64; 2]; 2]>) -> Option<Problem> {
    let agents = ends.map(|[start, goal]| format!(r#"{{"start": {start:?}, "goal": {goal:?}}}"#));
    problem_in(PILLAR, &agents.collect::<Vec<_>>().join(", ")).ok()
}

fn alone() -> Problem {
    problem([[[0.25, 0.25]; 2]].into_iter()).unwrap()
}

fn middle(view: &GridView, cell: u32) -> [f64; 2] {
    let (x, y) = fleetyard_core::cell_center_m(view.instance.grid(), view.cell_m, cell);
    [view.corner_m[0] + x, view.corner_m[1] + y]
}

/// Walks from random free cells that are made step by step; some stay where a step would hit
/// another, most do not look.
fn walks(view: &GridView, agents: usize, steps: usize, random: &mut SeededRandom) -> Vec<Vec<u32>> {
    let (grid, moves) = (view.instance.grid(), view.spec.connectivity);
    let mut cells: Vec<u32> = (0..grid.cell_count())
        .filter(|cell| grid.is_passable(*cell))
        .collect();
    random.shuffle(&mut cells);
    let mut paths: Vec<Vec<u32>> = cells[..agents].iter().map(|cell| vec![*cell]).collect();
    for _ in 0..steps {
        for agent in 0..agents {
            let at = *paths[agent].last().unwrap();
            let ways: Vec<u32> = grid.neighbors(at, moves).chain([at]).collect();
            let next = ways[random.below(ways.len())];
            let is_taken = paths.iter().any(|path| path.contains(&next));
            let careful = random.below(4) == 0;
            paths[agent].push(if careful && is_taken { at } else { next });
        }
    }
    paths
}

#[test]
fn strict_rules_and_footprints_agree_on_grids() {
    let (mut valid, mut invalid, mut corners) = (0, 0, 0);
    for (connectivity, cells, judged) in [
        (Connectivity::Four, Separation::Rules, Separation::Strict),
        (Connectivity::Four, Separation::Strict, Separation::Strict),
        (Connectivity::Eight, Separation::Rules, Separation::Strict),
    ] {
        let spec = GridSpec {
            connectivity,
            separation: cells,
        };
        let geometry = world_to_grid(&alone(), spec).unwrap();
        for seed in 0..300 {
            let mut random = SeededRandom::new("walks", seed);
            let agents = 2 + random.below(3);
            let paths = walks(&geometry, agents, 5, &mut random);
            let ends = paths
                .iter()
                .map(|path| [path[0], path[path.len() - 1]].map(|cell| middle(&geometry, cell)));
            // Goals may be too near to each other.
            let Some(problem) = problem(ends) else {
                continue;
            };
            let view = world_to_grid(&problem, spec).unwrap();
            let plan = GridPlan::from_paths(&paths);
            let terms = GridTerms {
                separation: judged,
                step_s: 0.5,
            };
            let found = view.judge(&problem, &plan, terms, 100);
            let Some(ViewVerdict::Grid(rules)) = &found.view else {
                panic!("a grid has rules");
            };
            let world = found.world.as_ref().unwrap();
            assert_eq!(rules.valid, world.valid, "{spec:?} {paths:?} {found:?}");
            assert_eq!(found.is_valid(), rules.valid);
            let named = rules.violations.iter();
            let round = named.filter(|found| found.rule == Rule::CornerFollow);
            corners += round.count();
            *if rules.valid {
                &mut valid
            } else {
                &mut invalid
            } += 1;
            let steps = found.steps.unwrap();
            let last_s = steps.makespan as f64 * 0.5;
            assert!((found.costs.unwrap().makespan_s - last_s).abs() < 1e-9);
        }
    }
    assert!(
        valid > 100 && invalid > 100 && corners > 10,
        "{valid} {invalid} {corners}"
    );
}

/// Two robots of which one follows the other round a corner, on a grid of published side.
fn round_a_corner() -> (Problem, GridView, GridPlan) {
    let ends = [[[0.25, 0.25], [1.25, 0.25]], [[0.75, 0.25], [0.75, 1.25]]];
    let problem = problem(ends.into_iter()).unwrap();
    let spec = GridSpec {
        connectivity: Connectivity::Four,
        separation: Separation::Rules,
    };
    let view = world_to_grid(&problem, spec).unwrap();
    let grid = view.instance.grid();
    let cell = |col: u32, up: u32| grid.cell(grid.rows() - 1 - up, col).unwrap();
    let plan = GridPlan::from_paths([
        [cell(0, 0), cell(1, 0), cell(2, 0)],
        [cell(1, 0), cell(1, 1), cell(1, 2)],
    ]);
    (problem, view, plan)
}

fn judged(view: &GridView, problem: &Problem, plan: &GridPlan, separation: Separation) -> Judged {
    let terms = GridTerms {
        separation,
        step_s: 1.0,
    };
    view.judge(problem, plan, terms, 100)
}

#[test]
fn following_round_a_corner_keeps_the_rules_and_not_the_distance() {
    let (problem, view, plan) = round_a_corner();
    assert!((view.cell_m - 0.5).abs() < 1e-12);
    let by_rules = judged(&view, &problem, &plan, Separation::Rules);
    assert!(by_rules.view.as_ref().unwrap().is_valid());
    let world = by_rules.world.as_ref().unwrap();
    assert_eq!(world.violations.len(), 1, "{world:?}");
    assert_eq!(world.violations[0].rule, ContinuousRule::AgentContact);
    assert!(!by_rules.is_valid());
    let strict = judged(&view, &problem, &plan, Separation::Strict);
    let Some(ViewVerdict::Grid(rules)) = &strict.view else {
        panic!("a grid has rules");
    };
    assert_eq!(rules.violations[0].rule, Rule::CornerFollow);
    assert_eq!(strict.world, by_rules.world);
    // Costs are those of the way in the world, whoever judges.
    let costs = by_rules.costs.unwrap();
    assert_eq!(
        (costs.length_m, costs.sum_of_costs_s, costs.makespan_s),
        (2.0, 4.0, 2.0)
    );
}

#[test]
fn a_plan_without_a_place_in_the_world_is_judged_by_the_rules_alone() {
    let (problem, view, plan) = round_a_corner();
    let outside = GridPlan::from_paths([plan.path(0).to_vec(), vec![fleetyard_core::OFF_MAP]]);
    let found = judged(&view, &problem, &outside, Separation::Rules);
    assert!(!found.is_valid());
    assert_eq!((found.world, found.costs), (None, None));
    let told = found.no_place.unwrap();
    assert_eq!(told, "agent 1 is not on the map at time 0");
    // A plan for fewer agents has a place, and is refused by both.
    let fewer = GridPlan::from_paths([plan.path(0)]);
    let found = judged(&view, &problem, &fewer, Separation::Rules);
    assert!(!found.view.unwrap().is_valid());
    let world = found.world.unwrap();
    assert_eq!(world.violations[0].rule, ContinuousRule::AgentCount);
}

#[test]
fn distances_and_footprints_agree_on_roadmaps() {
    let (mut valid, mut invalid) = (0, 0);
    let builders = [
        Builder::Lattice {
            side_m: 0.7,
            directions: 8,
        },
        Builder::Prm {
            sampling: Sampling::Halton,
            vertices: 30,
            neighbors: 4,
        },
    ];
    for seed in 0..200 {
        let spec = RoadmapSpec::new(builders[seed as usize % 2]);
        let geometry = world_to_roadmap(&alone(), spec).unwrap();
        let mut random = SeededRandom::new("drives", seed);
        let agents = 2 + random.below(2);
        let roadmap = &geometry.roadmap;
        let at = |vertex: u32| <[f64; 2]>::from(roadmap.position_m(vertex));
        let mut plan = RoadmapPlan::default();
        for _ in 0..agents {
            let mut vertex = random.below(roadmap.vertices()) as u32;
            let (mut time, mut visits) = (0.0, Vec::new());
            for _ in 0..4 {
                let arrival_s = time;
                time += random.below(2) as f64 * random.unit();
                visits.push((vertex, arrival_s, time));
                let ways = roadmap.neighbors(vertex);
                if ways.is_empty() {
                    break;
                }
                let next = ways[random.below(ways.len())];
                let ([ax, ay], [bx, by]) = (at(vertex), at(next));
                time += (ax - bx).hypot(ay - by) / geometry.speed_m_per_s;
                vertex = next;
            }
            visits.push((vertex, time, time));
            plan.push_path(
                visits
                    .into_iter()
                    .map(|(vertex, arrival_s, departure_s)| Visit {
                        vertex,
                        arrival_s,
                        departure_s,
                    }),
            )
            .unwrap();
        }
        let ends = plan
            .paths()
            .map(|path| [path[0], path[path.len() - 1]].map(|end| at(end.vertex)));
        let Some(problem) = problem(ends) else {
            continue;
        };
        // The same roadmap, with these agents' starts and goals.
        let own =
            |pick: fn(&[Visit]) -> Visit| plan.paths().map(|path| pick(path).vertex).collect();
        let view = fleetyard_views::RoadmapView {
            starts: own(|path| path[0]),
            goals: own(|path| path[path.len() - 1]),
            ..geometry.clone()
        };
        let found = view.judge(&problem, &plan, Pace::StopGo, 100).unwrap();
        let Some(ViewVerdict::Roadmap(rules)) = &found.view else {
            panic!("a roadmap has rules");
        };
        let world = found.world.as_ref().unwrap();
        assert_eq!(rules.valid, world.valid, "{found:?}");
        let of_rules = rules
            .violations
            .iter()
            .map(|found| (&found.agents, found.time_s));
        let of_world = world
            .violations
            .iter()
            .map(|found| (&found.agents, found.time_s));
        assert!(of_rules.eq(of_world), "{found:?}");
        *if rules.valid {
            &mut valid
        } else {
            &mut invalid
        } += 1;
    }
    assert!(valid > 30 && invalid > 30, "{valid} {invalid}");
}

#[test]
fn a_task_judges_plans_in_the_plane_by_everything_it_asks_for() {
    use ContinuousRule::{ObstacleContact, TooFast, WrongGoal, WrongStart};

    let problem = problem([[[0.5, 0.5], [3.5, 0.5]]].into_iter()).unwrap();
    let rules = |knots: &[(f64, f64, f64)]| -> Vec<ContinuousRule> {
        let mut plan = TrajectoryPlan::default();
        plan.push_path(knots.iter().map(|(time_s, x_m, y_m)| Knot {
            time_s: *time_s,
            x_m: *x_m,
            y_m: *y_m,
            heading_rad: None,
        }))
        .unwrap();
        let found = problem.judge(&plan, 100);
        assert_eq!((&found.view, &found.steps), (&None, &None));
        assert_eq!(found.is_valid(), found.world.as_ref().unwrap().valid);
        let violations = found.world.unwrap().violations;
        violations.into_iter().map(|found| found.rule).collect()
    };
    assert_eq!(rules(&[(0.0, 0.5, 0.5), (3.0, 3.5, 0.5)]), []);
    assert_eq!(rules(&[(0.0, 0.5, 0.5), (2.0, 3.5, 0.5)]), [TooFast]);
    assert_eq!(rules(&[(0.0, 0.6, 0.5), (3.0, 3.5, 0.5)]), [WrongStart]);
    let through = [(0.0, 0.5, 0.5), (3.0, 2.0, 2.0)];
    assert_eq!(rules(&through), [ObstacleContact, WrongGoal]);
}

#[test]
fn smaller_robots_may_pass_where_the_discs_of_the_view_do_not() {
    // A box is judged by the disc around it, whatever its heading; the view plans for the largest.
    let problem = load_problem(maps("window.task.json")).unwrap();
    let spec = RoadmapSpec::new(Builder::Lattice {
        side_m: 0.037,
        directions: 4,
    });
    let view = world_to_roadmap(&problem, spec).unwrap();
    let still = |moved: Option<(usize, u32)>| {
        let mut plan = RoadmapPlan::default();
        for (agent, vertex) in view.starts.iter().copied().enumerate() {
            let vertex = moved
                .filter(|(who, _)| *who == agent)
                .map_or(vertex, |(_, to)| to);
            let visit = Visit {
                vertex,
                arrival_s: 0.0,
                departure_s: 0.0,
            };
            plan.push_path([visit]).unwrap();
        }
        let found = view.judge(&problem, &plan, Pace::StopGo, 100).unwrap();
        let Some(ViewVerdict::Roadmap(rules)) = found.view else {
            panic!("a roadmap has rules");
        };
        let contacts = rules
            .violations
            .iter()
            .filter(|found| found.agents.len() == 2);
        (contacts.count(), found.world.unwrap().violations.len())
    };
    assert_eq!(still(None), (0, 0));
    // The wedge beside the box: between the sum of their radii and twice the largest.
    let (x, y) = view.roadmap.position_m(view.starts[1]);
    let beside = (0..view.roadmap.vertices() as u32).find(|vertex| {
        let (at_x, at_y) = view.roadmap.position_m(*vertex);
        let far = (at_x - x).hypot(at_y - y);
        let sum: f64 = [1, 2]
            .map(|agent| problem.shape(agent).effective_radius_m())
            .iter()
            .sum();
        far > sum + 1e-3 && far < 0.16 - 1e-3
    });
    assert_eq!(still(Some((2, beside.unwrap()))), (1, 0));
}

#[test]
fn the_plan_of_the_repository_is_valid_in_its_world() {
    let problem = load_problem(maps("two-rooms.task.json")).unwrap();
    let file = load_roadmap_plan(maps("two-rooms.roadmap-plan.json")).unwrap();
    let roadmap = fleetyard_core::load_roadmap(maps("two-rooms.roadmap.json")).unwrap();
    let view = world_to_roadmap(&problem, RoadmapSpec::new(Builder::Tangent { sides: 8 })).unwrap();
    let ends =
        |pick: fn(&[Visit]) -> Visit| file.plan.paths().map(|path| pick(path).vertex).collect();
    let view = fleetyard_views::RoadmapView {
        starts: ends(|path| path[0]),
        goals: ends(|path| path[path.len() - 1]),
        roadmap,
        ..view
    };
    // Written by hand, with times rounded up.
    let slower = view.judge(&problem, &file.plan, Pace::Slower, 100).unwrap();
    assert!(slower.is_valid(), "{slower:?}");
    let exact = view.judge(&problem, &file.plan, Pace::StopGo, 100).unwrap();
    assert!(!exact.view.unwrap().is_valid() && exact.world.unwrap().valid);
}
