//! Grids of worlds: what is free holds a disc, and what does not fit is refused with distances.

use fleetyard_core::{Connectivity, InputError, Separation};
use fleetyard_views::{Free, GridSpec, GridView, load_problem, world_to_grid};
use proptest::prelude::*;

use crate::tasks::{maps, problem_in};

const RULES: GridSpec = GridSpec {
    connectivity: Connectivity::Four,
    separation: Separation::Rules,
};

const STRICT: GridSpec = GridSpec {
    separation: Separation::Strict,
    ..RULES
};

fn middle(view: &GridView, cell: u32) -> [f64; 2] {
    let (x, y) = fleetyard_core::cell_center_m(view.instance.grid(), view.cell_m, cell);
    [view.corner_m[0] + x, view.corner_m[1] + y]
}

#[test]
fn the_examples_have_grids() {
    let window = load_problem(maps("window.task.json")).unwrap();
    let view = world_to_grid(&window, RULES).unwrap();
    // 5 m are 31.25 cells of 0.16 m; the disc in the last ones reaches over the edge.
    let grid = view.instance.grid();
    assert_eq!((grid.rows(), grid.cols()), (32, 32));
    assert!((0..32).all(|row| !grid.is_passable(grid.cell(row, 31).unwrap())));
    assert!((0..32).all(|col| !grid.is_passable(grid.cell(0, col).unwrap())));
    assert_eq!(view.instance.agents(), 8);
    let far = view
        .snapped_m
        .iter()
        .flatten()
        .fold(0.0, |most: f64, far| most.max(*far));
    assert!(far > 0.0 && far <= view.cell_m / 2.0_f64.sqrt());
    // The same again, and other parameters are another grid.
    let again = world_to_grid(&window, RULES).unwrap();
    assert_eq!(again.instance.digest(), view.instance.digest());
    assert_eq!(again.origin, view.origin);
    let strict = world_to_grid(&window, STRICT).unwrap();
    assert!((strict.cell_m - view.cell_m * 2.0_f64.sqrt()).abs() < 1e-12);
}

/// Digests of the grids of worlds, equal in every build and on every machine.
#[test]
fn grids_are_golden() {
    let found = ["window.task.json", "two-rooms.task.json"].map(|name| {
        let problem = load_problem(maps(name)).unwrap();
        let eight = GridSpec {
            connectivity: Connectivity::Eight,
            ..RULES
        };
        [RULES, STRICT, eight].map(|spec| {
            let view = world_to_grid(&problem, spec).unwrap();
            view.instance.digest().to_string()
        })
    });
    assert_eq!(found.concat(), GOLDEN);
}

const GOLDEN: [&str; 6] = [
    "985a6bd53d08cd8d5d29c1d7e144d0de",
    "171ff7104f3f0fdf143c89826ad89286",
    "ec1c62231aded4678125938a93b65a7f",
    "046a12baf05611c02353e0e4a548c498",
    "407162fb6a6f7ebe439a36da2294ccaf",
    "8b9720092b80c3c5e6209276121ad80e",
];

#[test]
fn what_does_not_fit_is_refused_with_distances() {
    let refused = |obstacle: &str, agents: &str| -> InputError {
        let problem = problem_in(obstacle, agents).unwrap();
        world_to_grid(&problem, RULES).unwrap_err()
    };
    let shelf = r#"{"rectangle": {"center": [2, 2], "size": [1.1, 1.1]}}"#;
    let blocked = refused(shelf, r#"{"start": [1.2, 2.2], "goal": [3, 3.3]}"#);
    assert_eq!(
        blocked.reason,
        "the start of agent 0 snaps 0.071 m to the cell at row 3, column 2, which is blocked"
    );
    let hint = "the nearest free cell is 0.453 m away, around (0.750, 2.250)";
    assert_eq!(blocked.hint.as_deref(), Some(hint));
    // Apart by more than two radii, and in one cell all the same.
    let two = r#"{"start": [0.5, 0.5], "goal": [3, 3.3]}, {"start": [0.9, 0.9], "goal": [3, 0.6]}"#;
    let shared = refused(shelf, two);
    assert_eq!(
        shared.reason,
        "the starts of agents 0 and 1 snap 0.354 m and 0.212 m to one cell, at row 6, column 1"
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(100))]

    #[test]
    fn a_free_cell_holds_the_disc_and_a_blocked_one_is_reached_into(
        center in (0.8..3.2f64, 0.8..3.2f64),
        size in (0.05..1.2f64, 0.05..1.2f64),
        angle in 0.0..3.0f64,
    ) {
        let obstacle = format!(
            r#"{{"rectangle": {{"center": [{}, {}], "size": [{}, {}], "angle_rad": {angle}}}}}"#,
            center.0, center.1, size.0, size.1,
        );
        let agents = r#"{"start": [0.25, 0.25], "goal": [0.25, 0.25]}"#;
        let Ok(problem) = problem_in(&obstacle, agents) else { return Ok(()) };
        let Ok(view) = world_to_grid(&problem, RULES) else { return Ok(()) };
        let (free, radius) = (Free::new(&problem.world), problem.common_radius_m());
        let grid = view.instance.grid();
        for cell in 0..grid.cell_count() {
            let [x, y] = middle(&view, cell);
            // Places of the cell, as dense as the obstacle is thin.
            let steps = 40;
            let place = |at: i32, middle: f64| {
                middle + (f64::from(at) / f64::from(steps) - 0.5) * (view.cell_m - 1e-7)
            };
            let mut places = (0..=steps).flat_map(|i| (0..=steps).map(move |j| (i, j)));
            let is_hit = places.any(|(i, j)| !free.is_inside([place(i, x), place(j, y)]));
            if grid.is_passable(cell) {
                prop_assert!(free.holds([x, y], radius));
                prop_assert!(!is_hit);
                for to in grid.neighbors(cell, Connectivity::Four) {
                    prop_assert!(free.sweeps([x, y], middle(&view, to), radius));
                }
            } else {
                // A corner may reach into a cell between the places.
                let near = 0.75 * view.cell_m;
                prop_assert!(is_hit || !free.holds([x, y], near));
            }
        }
    }
}
