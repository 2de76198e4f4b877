//! Path rules, against geometry in rational numbers and against each other.

use std::sync::Arc;

use fleetyard_check::{PathRule, Rule, Verdict, metrics, validate, validate_paths};
use fleetyard_core::{Connectivity, Grid, GridInstance, GridPlan, OFF_MAP};
use proptest::prelude::*;

/// A map of `.` and `@`, and a path of (row, col) on it whose ends are start and goal.
fn question(rows: &[&str], path: &[(u32, u32)]) -> (GridInstance, GridPlan) {
    let grid = Grid::new(
        "map",
        rows.len() as u32,
        rows[0].len() as u32,
        rows.concat().into(),
    );
    let grid = Arc::new(grid.unwrap());
    let cells: Vec<u32> = path
        .iter()
        .map(|(row, col)| row * grid.cols() + col)
        .collect();
    let (start, goal) = (cells[0], cells[cells.len() - 1]);
    let instance = GridInstance::new(grid, Connectivity::Eight, vec![start], vec![goal]).unwrap();
    (instance, GridPlan::from_paths([cells]))
}

fn verdict(rows: &[&str], path: &[(u32, u32)], rule: PathRule) -> Verdict {
    let (instance, plan) = question(rows, path);
    validate_paths(&instance, &plan, rule, 10)
}

fn sentences(verdict: &Verdict) -> Vec<&str> {
    verdict
        .violations
        .iter()
        .map(|found| found.sentence.as_str())
        .collect()
}

#[test]
fn a_line_keeps_to_allowed_moves() {
    let path = [(0, 0), (0, 2), (2, 2)];
    let (instance, plan) = question(&["...", "...", "..."], &path);
    let plain: &Grid = instance.grid();
    // No way to the south from the middle of the last column.
    let mut masks = plain.move_masks(Connectivity::Eight);
    masks[5] &= !4;
    let grid = plain.clone().with_moves(masks).unwrap();
    let (starts, goals) = (instance.starts().to_vec(), instance.goals().to_vec());
    let masked = GridInstance::new(Arc::new(grid), Connectivity::Eight, starts, goals).unwrap();
    for rule in [PathRule::Bresenham, PathRule::Supercover] {
        assert!(validate_paths(&instance, &plan, rule, 10).valid);
        let verdict = validate_paths(&masked, &plan, rule, 10);
        assert_eq!(verdict.violations[0].rule, Rule::MoveNotAllowed);
        let sentence = "agent 0 makes a move that the map does not allow to (2, 2) on its way from (0, 2) to (2, 2)";
        assert_eq!(sentences(&verdict), [sentence]);
    }
    let steps = GridPlan::from_paths([[0, 1, 2, 5, 8]]);
    let verdict = validate(&masked, &steps, 10);
    let sentence =
        "agent 0 moves from (1, 2) to (2, 2) between times 3 and 4, which the map does not allow";
    assert_eq!(sentences(&verdict), [sentence]);
}

#[test]
fn what_a_line_may_cut() {
    use PathRule::{Bresenham, Steps, Supercover};
    let open = [".....", ".....", "....."];
    let jump = [(0, 0), (2, 4)];
    assert_eq!(
        [Steps, Bresenham, Supercover].map(|rule| verdict(&open, &jump, rule).valid),
        [false, true, true]
    );
    // One corner, then the gap between two.
    for (map, gap) in [
        (["....", ".@..", "...."], [(1, 0), (2, 1)]),
        ([".@..", "..@.", "...."], [(0, 2), (1, 1)]),
    ] {
        assert!(verdict(&map, &gap, Bresenham).valid);
        let verdict = verdict(&map, &gap, Supercover);
        assert_eq!(verdict.violations[0].rule, Rule::CornerCut);
    }
    assert_eq!(
        sentences(&verdict(
            &["...", ".@.", "..."],
            &[(1, 0), (2, 1)],
            Supercover
        )),
        ["agent 0 touches the corner of an obstacle at (1, 1) on its way from (1, 0) to (2, 1)"]
    );
    let wall = ["..@..", "..@..", "....."];
    for rule in [Bresenham, Supercover] {
        assert_eq!(
            sentences(&verdict(&wall, &[(0, 0), (0, 4)], rule)),
            ["agent 0 crosses an obstacle at (0, 2) on its way from (0, 0) to (0, 4)"]
        );
    }
    // Along a column as along a row: no corner is touched, and the end is told once.
    let column = ["...", "@..", "..."];
    for rule in [Bresenham, Supercover] {
        assert_eq!(
            sentences(&verdict(&column, &[(0, 0), (2, 0)], rule)),
            ["agent 0 crosses an obstacle at (1, 0) on its way from (0, 0) to (2, 0)"]
        );
        assert_eq!(
            sentences(&verdict(&column, &[(0, 0), (1, 0), (1, 1), (2, 0)], rule))[..1],
            ["cell 1 of the path of agent 0, (1, 0), is an obstacle"]
        );
    }
    // A segment of slope one half is halfway between two cells in its middle, and the
    // line's is the one nearer to the start.
    assert!(!verdict(&["...", ".@."], &[(1, 2), (0, 0)], Bresenham).valid);
    assert!(verdict(&["...", ".@."], &[(0, 0), (1, 2)], Bresenham).valid);
    assert!(!verdict(&["...", ".@."], &[(0, 0), (1, 2)], Supercover).valid);
}

#[test]
fn mistakes_are_named() {
    let map = ["....", ".@..", "...."];
    let (instance, _) = question(&map, &[(0, 0), (2, 3)]);
    let judge = |path: &[u32]| {
        let plan = GridPlan::from_paths([path]);
        validate_paths(&instance, &plan, PathRule::Bresenham, 10)
    };
    assert_eq!(sentences(&judge(&[])), ["agent 0 has an empty path"]);
    assert_eq!(
        sentences(&judge(&[1, 3, 10])),
        [
            "agent 0 begins at (0, 1), its start is (0, 0)",
            "agent 0 ends at (2, 2), its goal is (2, 3)"
        ]
    );
    assert_eq!(
        sentences(&judge(&[0, 0, 5, 5, 11])),
        ["cell 2 of the path of agent 0, (1, 1), is an obstacle"]
    );
    assert_eq!(
        sentences(&judge(&[OFF_MAP, 0, 12, 11, OFF_MAP])),
        [
            "agent 0 begins outside the map, its start is (0, 0)",
            "cell 0 of the path of agent 0 is outside the map",
            "cell 2 of the path of agent 0 is outside the map",
            "cell 4 of the path of agent 0 is outside the map",
            "agent 0 ends outside the map, its goal is (2, 3)"
        ]
    );
    let none = validate_paths(&instance, &GridPlan::default(), PathRule::Supercover, 10);
    assert_eq!(none.violations[0].rule, Rule::AgentCount);
    let few = GridPlan::from_paths([[1, 3, 10]]);
    let few = validate_paths(&instance, &few, PathRule::Supercover, 1);
    assert_eq!((few.violations.len(), few.violation_count), (1, 2));
}

#[test]
fn paths_without_times_are_for_one_agent() {
    let grid = Arc::new(Grid::new("map", 1, 4, b"....".to_vec()).unwrap());
    let instance = GridInstance::new(grid, Connectivity::Four, vec![0, 3], vec![1, 2]).unwrap();
    let plan = GridPlan::from_paths([[0, 1], [3, 2]]);
    assert!(validate_paths(&instance, &plan, PathRule::Steps, 1).valid);
    let verdict = validate_paths(&instance, &plan, PathRule::Bresenham, 1);
    assert_eq!(
        sentences(&verdict),
        ["the path rule bresenham is for one agent, the instance has 2"]
    );
}

#[test]
fn lengths_are_those_of_the_lines() {
    let (instance, plan) = question(
        &["......", "......", "......"],
        &[(0, 0), (0, 0), (2, 5), (1, 4), (1, 0)],
    );
    let found = metrics(&instance, &plan, 0.5);
    assert_eq!(found.length_cells, 5 + 1 + 4);
    let expected = (29f64.sqrt() + 2f64.sqrt() + 4.0) * 0.5;
    assert!((found.length_m - expected).abs() < 1e-12);
}

const SIZE: u32 = 9;

fn maps() -> impl Strategy<Value = Vec<u8>> {
    let letter = prop_oneof![6 => Just(b'.'), 1 => Just(b'@')];
    prop::collection::vec(letter, (SIZE * SIZE) as usize)
}

/// An instance whose start and goal are the path's, where they are free and connected.
fn instance(map: Vec<u8>, path: &[u32]) -> Option<GridInstance> {
    let grid = Arc::new(Grid::new("map", SIZE, SIZE, map).unwrap());
    let (start, goal) = (path[0], path[path.len() - 1]);
    GridInstance::new(grid, Connectivity::Eight, vec![start], vec![goal]).ok()
}

/// True if a segment between centres touches a cell as a closed square, by separating axes in whole
/// numbers of half a cell.
fn touches(from: (i64, i64), to: (i64, i64), cell: (i64, i64)) -> bool {
    let (dr, dc) = (2 * (to.0 - from.0), 2 * (to.1 - from.1));
    let (r, c) = (2 * (cell.0 - from.0), 2 * (cell.1 - from.1));
    let within = |d: i64, at: i64| at >= d.min(0) - 1 && at <= d.max(0) + 1;
    within(dr, r) && within(dc, c) && (dr * c - dc * r).abs() <= dr.abs() + dc.abs()
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_supercover_is_what_a_segment_touches(map in maps(), path in prop::collection::vec(0..SIZE * SIZE, 2)) {
        let Some(instance) = instance(map, &path) else { return Ok(()) };
        let grid = instance.grid();
        let at = |cell| { let (row, col) = grid.row_col(cell); (i64::from(row), i64::from(col)) };
        let clear = (0..grid.cell_count())
            .filter(|cell| touches(at(path[0]), at(path[1]), at(*cell)))
            .all(|cell| grid.is_passable(cell));
        let plan = GridPlan::from_paths([&path]);
        prop_assert_eq!(validate_paths(&instance, &plan, PathRule::Supercover, 1).valid, clear);
    }

    /// The line's cells are the nearest to the segment, halves towards the start; in
    /// numbers that are exact here.
    #[test]
    fn a_line_is_the_nearest_cells(map in maps(), path in prop::collection::vec(0..SIZE * SIZE, 2)) {
        let Some(instance) = instance(map, &path) else { return Ok(()) };
        let grid = instance.grid();
        let (from, to) = (grid.row_col(path[0]), grid.row_col(path[1]));
        let length = from.0.abs_diff(to.0).max(from.1.abs_diff(to.1));
        let nearest = |k: u32, from: u32, to: u32| {
            let by = f64::from(k) * (f64::from(to) - f64::from(from)) / f64::from(length);
            let rounded = by.signum() * (by.abs() - 0.5).ceil();
            (f64::from(from) + rounded) as u32
        };
        let clear = (1..length).all(|k| {
            grid.is_passable(nearest(k, from.0, to.0) * SIZE + nearest(k, from.1, to.1))
        });
        let plan = GridPlan::from_paths([&path]);
        prop_assert_eq!(validate_paths(&instance, &plan, PathRule::Bresenham, 1).valid, clear);
    }

    #[test]
    fn supercover_allows_no_more_than_bresenham(map in maps(), path in prop::collection::vec(0..SIZE * SIZE, 1..6)) {
        let Some(one) = instance(map, &path) else { return Ok(()) };
        let plan = GridPlan::from_paths([&path]);
        let verdict = |instance, plan, rule| validate_paths(instance, plan, rule, 1).valid;
        let strict = verdict(&one, &plan, PathRule::Supercover);
        let back = GridInstance::new(
            Arc::clone(one.grid()),
            Connectivity::Eight,
            one.goals().to_vec(),
            one.starts().to_vec(),
        ).unwrap();
        let reverse = GridPlan::from_paths([path.iter().rev().copied().collect::<Vec<_>>()]);
        prop_assert_eq!(verdict(&back, &reverse, PathRule::Supercover), strict);
        if strict {
            prop_assert!(verdict(&one, &plan, PathRule::Bresenham));
            prop_assert!(verdict(&back, &reverse, PathRule::Bresenham));
        }
    }

    /// Paths of unit moves: the supercover rule is that of eight-connected grids, and of
    /// cardinal moves all rules say the same.
    #[test]
    fn unit_moves_are_judged_alike(
        map in maps(),
        start in 0..SIZE * SIZE,
        moves in prop::collection::vec((-1i64..2, -1i64..2), 0..12),
        cardinal: bool,
    ) {
        let mut path = vec![start];
        let mut at = (i64::from(start / SIZE), i64::from(start % SIZE));
        for (rows, cols) in moves {
            let cols = if cardinal && rows != 0 { 0 } else { cols };
            at = ((at.0 + rows).clamp(0, i64::from(SIZE) - 1), (at.1 + cols).clamp(0, i64::from(SIZE) - 1));
            path.push((at.0 * i64::from(SIZE) + at.1) as u32);
        }
        let Some(instance) = instance(map, &path) else { return Ok(()) };
        let plan = GridPlan::from_paths([&path]);
        let verdict = |rule| validate_paths(&instance, &plan, rule, 1).valid;
        let steps = validate(&instance, &plan, 1).valid;
        prop_assert_eq!(verdict(PathRule::Steps), steps);
        prop_assert_eq!(verdict(PathRule::Supercover), steps);
        if cardinal {
            prop_assert_eq!(verdict(PathRule::Bresenham), steps);
            let found = metrics(&instance, &plan, 1.0);
            prop_assert_eq!(found.length_cells, found.moves);
        }
    }
}
