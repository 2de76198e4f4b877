//! Grids of roadmaps and roadmaps of grids: masks allow the edges and nothing else, and plans lift.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use fleetyard_core::{
    Connectivity, Grid, GridPlan, GridSearch, Roadmap, Separation, cell_center_m, map_bytes,
    read_map,
};
use fleetyard_views::{
    GridSpec, OverlaySpec, OverlayView, Problem, RoadmapSpec, grid_to_roadmap, load_problem,
    roadmap_to_grid, world_to_roadmap,
};
use proptest::prelude::*;

use crate::roadmaps::builders;
use crate::tasks::{maps, problem_in};

fn spec(connectivity: Connectivity, cell_m: Option<f64>) -> OverlaySpec {
    OverlaySpec {
        grid: GridSpec {
            connectivity,
            separation: Separation::Rules,
        },
        cell_m,
    }
}

fn pairs(roadmap: &Roadmap) -> impl Iterator<Item = (u32, u32)> {
    let edges = roadmap.edges();
    edges.filter(|(from, to)| from < to || !roadmap.has_edge(*to, *from))
}

/// The cells with vertices that are joined, found by walking from one to the next: between them every
/// cell has one way on.
fn corridors(view: &OverlayView) -> BTreeSet<(u32, u32)> {
    let grid = view.view.instance.grid();
    let connectivity = view.view.instance.connectivity();
    let homes: BTreeSet<u32> = view.cell_of.iter().flatten().copied().collect();
    let mut found = BTreeSet::new();
    for home in &homes {
        for next in grid.neighbors(*home, connectivity) {
            let (mut before, mut at) = (*home, next);
            while !homes.contains(&at) {
                let on = grid.neighbors(at, connectivity).filter(|to| *to != before);
                let on: Vec<u32> = on.collect();
                assert_eq!(on.len(), 1, "cell {at} is on one edge");
                (before, at) = (at, on[0]);
            }
            assert_ne!(at, *home);
            found.insert((*home, at));
        }
    }
    found
}

fn check(view: &OverlayView, roadmap: &Roadmap) {
    let report = &view.report;
    let joined = corridors(view);
    let mut edges = BTreeSet::new();
    let (mut merged, mut missing, mut cut) = (0, 0, 0);
    for (from, to) in pairs(roadmap) {
        let [Some(a), Some(b)] = [from, to].map(|vertex| view.cell_of[vertex as usize]) else {
            cut += 1;
            continue;
        };
        if a == b {
            merged += 1;
            continue;
        }
        edges.insert((a, b));
        if roadmap.has_edge(to, from) {
            edges.insert((b, a));
        }
        missing += usize::from(!joined.contains(&(a, b)));
    }
    // No link that the roadmap does not have, and none is missing that is not told.
    assert!(joined.is_subset(&edges));
    assert!(missing + cut <= report.edges_lost, "{report:?}");
    assert!(report.edges_merged >= merged);
    assert!(report.edges_merged + report.edges_lost <= report.edges);
    let placed = view.cell_of.iter().flatten().count();
    assert_eq!(placed + report.vertices_lost, report.vertices);
    let starts = view.start_vertices.iter().zip(view.view.instance.starts());
    for (vertex, cell) in starts {
        assert_eq!(view.cell_of[*vertex as usize], Some(*cell));
    }
}

/// A way between two cells, by breadth.
fn way(grid: &Grid, connectivity: Connectivity, from: u32, to: u32) -> Vec<u32> {
    let mut next = BTreeMap::from([(from, from)]);
    let mut open = VecDeque::from([from]);
    while let Some(cell) = open.pop_front() {
        for near in grid.neighbors(cell, connectivity) {
            next.entry(near).or_insert_with(|| {
                open.push_back(near);
                cell
            });
        }
    }
    let mut path = vec![to];
    while path[path.len() - 1] != from {
        path.push(next[&path[path.len() - 1]]);
    }
    path.reverse();
    path
}

/// Lifts wandering agents that come to their goals in the end.
fn check_lift(view: &OverlayView, roadmap: &Roadmap, noise: &[u8]) {
    let instance = &view.view.instance;
    let (grid, connectivity) = (instance.grid(), instance.connectivity());
    let ends = instance.starts().iter().zip(instance.goals());
    let paths = ends.map(|(start, goal)| {
        let mut path = vec![*start];
        for noise in noise {
            let here = path[path.len() - 1];
            let near: Vec<u32> = grid.neighbors(here, connectivity).chain([here]).collect();
            path.push(near[usize::from(*noise) % near.len()]);
        }
        path.extend(&way(grid, connectivity, path[path.len() - 1], *goal)[1..]);
        path
    });
    let plan = GridPlan::from_paths(paths.collect::<Vec<_>>());
    let lifted = view.lift(roadmap, &plan, 0.5).unwrap();
    lifted.check(roadmap).unwrap();
    for (agent, visits) in lifted.paths().enumerate() {
        assert_eq!(visits[0].vertex, view.start_vertices[agent]);
        let last = visits[visits.len() - 1];
        assert_eq!(last.vertex, view.goal_vertices[agent]);
        // Nobody is earlier than in the plan, and a goal beside another vertex takes a step.
        let steps = (last.arrival_s / 0.5).round() as usize;
        assert!(steps <= plan.path(agent).len());
    }
}

#[test]
fn crossing_edges_make_no_links() {
    let agents = r#"{"start": [0.75, 0.75], "goal": [3.25, 3.25]}"#;
    let problem = problem_in("", agents).unwrap();
    let corners = [[0.75, 0.75], [3.25, 0.75], [0.75, 3.25], [3.25, 3.25]];
    let (x, y) = corners.iter().map(|[x, y]| (*x, *y)).unzip();
    let cross = Roadmap::new(x, y, [(0, 3), (3, 0), (1, 2), (2, 1)]).unwrap();
    let view = roadmap_to_grid(&problem, &cross, spec(Connectivity::Four, None)).unwrap();
    check(&view, &cross);
    // Equally long: the first is kept.
    assert_eq!((view.report.edges, view.report.edges_lost), (2, 1));
    let grid = view.view.instance.grid();
    let mut search = GridSearch::new(grid);
    let home = |vertex: usize| view.cell_of[vertex].unwrap();
    for (from, to, steps) in [
        (0, 3, Some(10)),
        (3, 0, Some(10)),
        (0, 1, None),
        (2, 1, None),
    ] {
        let found = search.steps(home(from), home(to), Connectivity::Four);
        assert_eq!(found, steps, "{from} {to}");
    }
    // Ten cells of 0.5 m for 3.54 m.
    let stretch = view.report.stretch_max.unwrap();
    assert!((stretch - 2.0_f64.sqrt()).abs() < 1e-12, "{stretch}");
    assert_eq!(view.view.about()["origin"]["operator"], "roadmap-to-grid");
    let about = view.about();
    assert_eq!(
        about["origin"]["roadmap_digest"],
        cross.digest().to_string()
    );
    assert_eq!(about["report"]["edges_lost"], 1);
    // Diagonal moves keep the length, and the file keeps the masks.
    let eight = roadmap_to_grid(&problem, &cross, spec(Connectivity::Eight, Some(0.5))).unwrap();
    check(&eight, &cross);
    assert!((eight.report.stretch_max.unwrap() - 1.0).abs() < 1e-12);
    let grid = eight.view.instance.grid();
    assert!(grid.has_move_masks());
    let again = read_map("a.map", &map_bytes(grid)).unwrap();
    assert_eq!(again.digest(), grid.digest());
}

#[test]
fn one_way_edges_are_one_way_moves() {
    let agents = r#"{"start": [0.25, 0.25], "goal": [3.25, 0.25]}"#;
    let problem = problem_in("", agents).unwrap();
    let ring = |edges: &[(u32, u32)]| {
        let (x, y) = (vec![0.25, 3.25, 3.25, 0.25], vec![0.25, 0.25, 3.25, 3.25]);
        Roadmap::new(x, y, edges.iter().copied()).unwrap()
    };
    let four = spec(Connectivity::Four, None);
    let roadmap = ring(&[(0, 1), (1, 2), (2, 3), (3, 0)]);
    let view = roadmap_to_grid(&problem, &roadmap, four).unwrap();
    check(&view, &roadmap);
    let instance = &view.view.instance;
    let (start, goal) = (instance.starts()[0], instance.goals()[0]);
    let mut search = GridSearch::new(instance.grid());
    assert_eq!(search.steps(start, goal, Connectivity::Four), Some(6));
    assert_eq!(search.steps(goal, start, Connectivity::Four), Some(18));
    // Against the edges there is no plan to lift.
    let against = GridPlan::from_paths([[start, start - instance.grid().cols()]]);
    let error = view.lift(&roadmap, &against, 1.0).unwrap_err();
    assert!(error.reason.contains("agent 0"), "{error}");
    let back = ring(&[(1, 0)]);
    let error = roadmap_to_grid(&problem, &back, four).unwrap_err();
    assert!(error.reason.contains("cannot reach its goal"), "{error}");
    let far = Roadmap::new(vec![0.25, 2.5], vec![0.25, 2.5], [(0, 1)]).unwrap();
    let error = roadmap_to_grid(&problem, &far, four).unwrap_err();
    assert!(
        error.reason.contains("the goal of agent 0 is 2.372 m from"),
        "{error}"
    );
    let outside = Roadmap::new(vec![0.25, 7.0], vec![0.25, 2.5], [(0, 1)]).unwrap();
    let error = roadmap_to_grid(&problem, &outside, four).unwrap_err();
    assert!(error.reason.contains("outside of the world"), "{error}");
}

/// Vertices, edges, what is lost, and the digest of the instance, equal in every build and on every
/// machine.
#[test]
fn grids_of_roadmaps_are_golden() {
    let problem = load_problem(maps("two-rooms.task.json")).unwrap();
    let found = builders(300).map(|builder| {
        let roadmap = world_to_roadmap(&problem, RoadmapSpec::new(builder))
            .unwrap()
            .roadmap;
        [(Connectivity::Four, 0.1), (Connectivity::Eight, 0.1)].map(|(connectivity, cell_m)| {
            let spec = spec(connectivity, Some(cell_m));
            let view = roadmap_to_grid(&problem, &roadmap, spec).unwrap();
            check(&view, &roadmap);
            check_lift(&view, &roadmap, &[1, 2, 0, 3, 1, 1, 5, 2]);
            let report = &view.report;
            let digest = view.view.instance.digest();
            format!("{} {} {digest}", report.vertices_lost, report.edges_lost)
        })
    });
    assert_eq!(found.concat(), GOLDEN);
}

const GOLDEN: [&str; 14] = [
    "0 854 9d40c24ca245d22cc7478c991617d165",
    "0 492 5cb509221327381ea762e507440dc73c",
    "0 859 594c3a07c7b9f13b9818904f735dd52a",
    "0 501 25c04f115802e7016d98de6662476548",
    "0 3634 eab0c50d98ccaa5091a8a65b9b47824f",
    "0 3252 126f06e4b01cb4eb74b0cd8739e6463d",
    "0 312 4f5e9790f8a5fb2ab861910c8c212c3f",
    "0 27 cd67a76c2a04d069dc7d98e8b1a72ecd",
    "0 22 dc6f99a163068efa6dd9b1562d8db068",
    "0 14 000b1a7296fb14c4a8c5dfd3b745b2c2",
    "0 1306 1cf797fa1f5472894a748e9ca7f58125",
    "0 495 d245c618df2067146273a3a833cb406b",
    "0 8080 c42f30336f7e92c4ad1c379cbd28fd5f",
    "0 7251 999942aedfef9b50c915946d77fd5a1a",
];

#[test]
fn cells_are_vertices_and_moves_are_edges() {
    let text =
        r#"{"format": "fleetyard.grid/1", "terrain": ["...", ".@."], "moves": ["6ac", "101"]}"#;
    let grid = read_map("a.map", text.as_bytes()).unwrap();
    let view = grid_to_roadmap(&grid, Connectivity::Four, 0.5, [10.0, 20.0]).unwrap();
    assert_eq!(view.cells, [0, 1, 2, 3, 5]);
    assert_eq!((view.vertex(5), view.vertex(4)), (Some(4), None));
    assert_eq!(view.roadmap.position_m(4), (11.25, 20.25));
    let edges: Vec<_> = view.roadmap.edges().collect();
    assert_eq!(
        edges,
        [
            (0, 1),
            (0, 3),
            (1, 0),
            (1, 2),
            (2, 1),
            (2, 4),
            (3, 0),
            (4, 2)
        ]
    );
    assert_eq!(view.origin.operator, "grid-to-roadmap");
    assert_eq!(view.origin.map_digest, Some(grid.digest()));
    assert_eq!(
        view.about()["roadmap_digest"],
        view.roadmap.digest().to_string()
    );
    assert_eq!(
        view.roadmap.digest().to_string(),
        "ac8df4392e938d9778250870ae4478b0"
    );
    let error = grid_to_roadmap(&grid, Connectivity::Four, f64::NAN, [0.0, 0.0]).unwrap_err();
    assert!(error.reason.contains("NaN"), "{error}");
}

fn problem_with(center: (f64, f64), size: (f64, f64), angle: f64) -> Option<Problem> {
    let obstacle = format!(
        r#"{{"rectangle": {{"center": [{}, {}], "size": [{}, {}], "angle_rad": {angle}}}}}"#,
        center.0, center.1, size.0, size.1,
    );
    let agents =
        r#"{"start": [0.3, 0.3], "goal": [3.7, 3.7]}, {"start": [3.7, 0.3], "goal": [0.3, 3.7]}"#;
    problem_in(&obstacle, agents).ok()
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn masks_allow_the_edges_and_plans_lift(
        center in (0.8..3.2f64, 0.8..3.2f64),
        size in (0.05..1.2f64, 0.05..1.2f64),
        angle in 0.0..3.0f64,
        seed in any::<u64>(),
        which in 0..7usize,
        eight: bool,
        cell_m in prop_oneof![Just(None), (0.02..0.6f64).prop_map(Some)],
        noise in proptest::collection::vec(any::<u8>(), 0..40),
    ) {
        let Some(problem) = problem_with(center, size, angle) else { return Ok(()) };
        let made = RoadmapSpec { seed: Some(seed), ..RoadmapSpec::new(builders(60)[which]) };
        let Ok(roadmap) = world_to_roadmap(&problem, made) else { return Ok(()) };
        let roadmap = roadmap.roadmap;
        let connectivity = if eight { Connectivity::Eight } else { Connectivity::Four };
        let Ok(view) = roadmap_to_grid(&problem, &roadmap, spec(connectivity, cell_m)) else {
            return Ok(());
        };
        check(&view, &roadmap);
        check_lift(&view, &roadmap, &noise);
        let again = roadmap_to_grid(&problem, &roadmap, spec(connectivity, cell_m)).unwrap();
        prop_assert_eq!(again.view.instance.digest(), view.view.instance.digest());
        prop_assert_eq!(again.about(), view.about());
    }

    /// A roadmap of cells, rasterised on the same cells, is the same grid.
    #[test]
    fn there_and_back_again(
        rows in 2..8u32,
        cols in 2..8u32,
        blocked in proptest::collection::vec(0..4u8, 64),
        thin in proptest::collection::vec(any::<u8>(), 64),
    ) {
        let cells = (rows * cols) as usize;
        let letters = blocked[..cells].iter().map(|blocked| if *blocked == 0 { b'@' } else { b'.' });
        let grid = Grid::new("random", rows, cols, letters.collect()).unwrap();
        let masks = grid.move_masks(Connectivity::Four);
        let masks = masks.iter().zip(&thin).map(|(mask, thin)| mask & thin).collect();
        let grid = grid.with_moves(masks).unwrap();
        let Some(cell) = (0..grid.cell_count()).find(|cell| grid.is_passable(*cell)) else {
            return Ok(());
        };
        let roadmap = grid_to_roadmap(&grid, Connectivity::Four, 0.5, [0.0, 0.0]).unwrap().roadmap;
        let (x, y) = cell_center_m(&grid, 0.5, cell);
        let [width, height] = [cols, rows].map(|count| f64::from(count) * 0.5);
        let mut problem = problem_in("", r#"{"start": [0.25, 0.25], "goal": [0.25, 0.25]}"#).unwrap();
        problem.world.bounds.max = [width, height];
        let agent = &mut problem.task.agents[0];
        for state in [&mut agent.start, &mut agent.goal] {
            (state.x_m, state.y_m) = (x, y);
        }
        let view = roadmap_to_grid(&problem, &roadmap, spec(Connectivity::Four, None)).unwrap();
        let again = view.view.instance.grid();
        let kept = again.move_masks(Connectivity::Four);
        prop_assert_eq!(kept, grid.move_masks(Connectivity::Four));
        prop_assert_eq!(view.report.edges_lost, 0);
        for cell in 0..grid.cell_count() {
            prop_assert_eq!(again.is_passable(cell), grid.is_passable(cell));
        }
    }
}
