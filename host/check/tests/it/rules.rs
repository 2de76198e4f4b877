//! Every rule of the validator, against small plans and against geometry.

use std::sync::Arc;

use fleetyard_check::{Rule, Terms, Verdict, metrics, validate, validate_terms};
use fleetyard_core::{
    Connectivity, Grid, GridInstance, GridPlan, Heading, OFF_MAP, Separation, Words as _,
};

/// A map, starts and goals drawn with letters: `a` starts where it stands and
/// has its goal at `A`.
fn instance(connectivity: Connectivity, drawing: &[&str]) -> GridInstance {
    let cols = drawing[0].len() as u32;
    let letters: Vec<u8> = drawing.iter().flat_map(|row| row.bytes()).collect();
    let find = |letter: u8| letters.iter().position(|found| *found == letter);
    let agents = (b'a'..=b'z').map_while(|letter| {
        let start = find(letter)?;
        Some((
            start as u32,
            find(letter.to_ascii_uppercase()).unwrap_or(start) as u32,
        ))
    });
    let (starts, goals) = agents.unzip();
    let terrain = letters
        .iter()
        .map(|letter| if *letter == b'@' { b'@' } else { b'.' })
        .collect();
    let grid = Grid::new("drawn", drawing.len() as u32, cols, terrain).unwrap();
    GridInstance::new(Arc::new(grid), connectivity, starts, goals).unwrap()
}

fn plan(instance: &GridInstance, paths: &[&[(i32, i32)]]) -> GridPlan {
    let grid = instance.grid();
    GridPlan::from_paths(paths.iter().map(|path| {
        let cell = |(row, col): &(i32, i32)| {
            let (row, col) = (u32::try_from(*row).ok()?, u32::try_from(*col).ok()?);
            grid.cell(row, col)
        };
        path.iter()
            .map(|at| cell(at).unwrap_or(OFF_MAP))
            .collect::<Vec<_>>()
    }))
}

fn judge(connectivity: Connectivity, drawing: &[&str], paths: &[&[(i32, i32)]]) -> Verdict {
    let instance = instance(connectivity, drawing);
    validate(&instance, &plan(&instance, paths), 100)
}

#[track_caller]
fn check(connectivity: Connectivity, drawing: &[&str], paths: &[&[(i32, i32)]], expected: &[&str]) {
    let verdict = judge(connectivity, drawing, paths);
    let found: Vec<String> = verdict
        .violations
        .iter()
        .map(|found| format!("{}: {}", found.rule, found.sentence))
        .collect();
    assert_eq!(found, expected);
    assert_eq!(verdict.valid, expected.is_empty());
    assert_eq!(verdict.violation_count, expected.len() as u64);
}

use Connectivity::{Eight, Four};

#[test]
fn valid_plans_have_no_violations() {
    check(Four, &["aA"], &[&[(0, 0), (0, 1)]], &[]);
    check(Four, &["a"], &[&[(0, 0)]], &[]);
    check(Four, &["a"], &[&[(0, 0), (0, 0), (0, 0)]], &[]);
    // Following in line and round a corner.
    check(
        Four,
        &["ab.", "..B", ".A."],
        &[&[(0, 0), (0, 1), (1, 1), (2, 1)], &[(0, 1), (1, 1), (1, 2)]],
        &[],
    );
    // A rotation of four.
    check(
        Four,
        &["ab", "dc"],
        &[
            &[(0, 0), (0, 1), (1, 1), (1, 0), (0, 0)],
            &[(0, 1), (1, 1), (1, 0), (0, 0), (0, 1)],
            &[(1, 1), (1, 0), (0, 0), (0, 1), (1, 1)],
            &[(1, 0), (0, 0), (0, 1), (1, 1), (1, 0)],
        ],
        &[],
    );
    check(Eight, &["a.", ".A"], &[&[(0, 0), (1, 1)]], &[]);
}

#[test]
fn one_agent_rules() {
    let row = &["aA."];
    check(
        Four,
        row,
        &[&[]],
        &["empty-path: agent 0 has an empty path"],
    );
    check(
        Four,
        row,
        &[],
        &["agent-count: the plan has 0 paths, the instance 1 agents"],
    );
    check(
        Four,
        row,
        &[&[(0, 0), (0, 1)], &[(0, 2)]],
        &["agent-count: the plan has 2 paths, the instance 1 agents"],
    );
    check(
        Four,
        row,
        &[&[(0, 1)]],
        &["wrong-start: agent 0 begins at (0, 1), its start is (0, 0)"],
    );
    check(
        Four,
        row,
        &[&[(0, 0)]],
        &["wrong-goal: agent 0 ends at (0, 0) at time 0, its goal is (0, 1)"],
    );
    check(
        Four,
        row,
        &[&[(0, 0), (0, 1), (0, 2)]],
        &["wrong-goal: agent 0 ends at (0, 2) at time 2, its goal is (0, 1)"],
    );
    check(
        Four,
        row,
        &[&[(0, 0), (-1, 0), (-1, 0), (0, 0), (0, 1)]],
        &["out-of-bounds: agent 0 is outside the map at time 1"],
    );
    check(
        Four,
        row,
        &[&[(0, 0), (0, 2), (0, 1)]],
        &["not-adjacent: agent 0 jumps from (0, 0) to (0, 2) between times 0 and 1"],
    );
    let wall = &["a@A", "..."];
    check(
        Four,
        wall,
        &[&[(0, 0), (0, 1), (0, 1), (0, 2)]],
        &["obstacle: agent 0 is on an obstacle at (0, 1) at time 1"],
    );
    // Where it begins counts too, and what explains the rest comes first.
    check(
        Four,
        wall,
        &[&[(0, 1), (0, 2)]],
        &[
            "wrong-start: agent 0 begins at (0, 1), its start is (0, 0)",
            "obstacle: agent 0 is on an obstacle at (0, 1) at time 0",
        ],
    );
    check(
        Four,
        wall,
        &[&[(-1, 0), (0, 2)], &[(1, 0)]],
        &[
            "agent-count: the plan has 2 paths, the instance 1 agents",
            "wrong-start: agent 0 begins at outside the map, its start is (0, 0)",
            "out-of-bounds: agent 0 is outside the map at time 0",
        ],
    );
    check(
        Four,
        wall,
        &[&[(0, 0), (1, 1), (1, 2), (0, 2)]],
        &["not-adjacent: agent 0 jumps from (0, 0) to (1, 1) between times 0 and 1"],
    );
    check(
        Eight,
        wall,
        &[&[(0, 0), (1, 1), (0, 2)]],
        &[
            "corner-cut: agent 0 cuts an obstacle's corner from (0, 0) to (1, 1) between times 0 and 1",
            "corner-cut: agent 0 cuts an obstacle's corner from (1, 1) to (0, 2) between times 1 and 2",
        ],
    );
    // The end of a row and the begin of the next have neighbouring indices.
    check(
        Four,
        &["..a", "A.."],
        &[&[(0, 2), (1, 0)]],
        &["not-adjacent: agent 0 jumps from (0, 2) to (1, 0) between times 0 and 1"],
    );
}

#[test]
fn two_agent_rules() {
    // Who never moves stays from the beginning.
    check(
        Four,
        &["abA"],
        &[&[(0, 0), (0, 1), (0, 2)], &[(0, 1)]],
        &["parked-conflict: agent 0 is at (0, 1) at time 1, where agent 1 stays from time 0"],
    );
    check(
        Four,
        &["aB", "bA"],
        &[&[(0, 0), (1, 0), (1, 1)], &[(1, 0), (0, 0), (0, 1)]],
        &["swap-conflict: agents 0 and 1 exchange (0, 0) and (1, 0) between times 0 and 1"],
    );
    check(
        Four,
        &["a.b", "BA."],
        &[&[(0, 0), (0, 1), (1, 1)], &[(0, 2), (0, 1), (0, 0), (1, 0)]],
        &["vertex-conflict: agents 0 and 1 are both at (0, 1) at time 1"],
    );
    // An agent passes one that has parked, in both orders of numbers.
    check(
        Four,
        &["bA.", ".aB"],
        &[&[(1, 1), (0, 1)], &[(0, 0), (0, 0), (0, 1), (0, 2), (1, 2)]],
        &["parked-conflict: agent 1 is at (0, 1) at time 2, where agent 0 stays from time 1"],
    );
    check(
        Four,
        &["aB.", ".bA"],
        &[
            &[(0, 0), (0, 0), (0, 1), (0, 2), (1, 2)],
            &[(1, 1), (0, 1), (0, 1), (0, 1), (0, 1)],
        ],
        &["parked-conflict: agent 0 is at (0, 1) at time 2, where agent 1 stays from time 1"],
    );
    // Arriving for good while somebody passes is a vertex conflict.
    check(
        Four,
        &["bA.", ".aB"],
        &[&[(1, 1), (0, 1)], &[(0, 0), (0, 1), (0, 2), (1, 2)]],
        &["vertex-conflict: agents 0 and 1 are both at (0, 1) at time 1"],
    );
    check(
        Eight,
        &["aB", "bA"],
        &[&[(0, 0), (1, 1)], &[(1, 0), (0, 1)]],
        &[
            "diagonal-crossing: agents 0 and 1 cross diagonally between times 0 and 1: \
         agent 0 from (0, 0) to (1, 1), agent 1 from (1, 0) to (0, 1)",
        ],
    );
    check(
        Eight,
        &["a.", ".b"],
        &[&[(0, 0), (1, 1), (0, 0)], &[(1, 1), (0, 0), (1, 1)]],
        &[
            "swap-conflict: agents 0 and 1 exchange (0, 0) and (1, 1) between times 0 and 1",
            "swap-conflict: agents 0 and 1 exchange (1, 1) and (0, 0) between times 1 and 2",
        ],
    );
    check(
        Eight,
        &["aB", "Ab"],
        &[&[(0, 0), (1, 0)], &[(1, 1), (0, 1)]],
        &[],
    );
    check(
        Eight,
        &["a.", "bA", ".."],
        &[&[(0, 0), (1, 1)], &[(1, 0), (0, 0), (1, 0)]],
        &[
            "corner-meet: agents 0 and 1 meet at a corner between times 0 and 1: \
         agent 0 from (0, 0) to (1, 1), agent 1 from (1, 0) to (0, 0)",
        ],
    );
}

#[test]
fn many_agents_in_one_cell_are_counted_linearly() {
    let drawing = ["abcdefgh"];
    let paths: Vec<Vec<(i32, i32)>> = (0..8).map(|_| vec![(0, 0)]).collect();
    let paths: Vec<&[(i32, i32)]> = paths.iter().map(Vec::as_slice).collect();
    let verdict = judge(Four, &drawing, &paths);
    let of = |rule: Rule| {
        verdict
            .violations
            .iter()
            .filter(|found| found.rule == rule)
            .count()
    };
    assert_eq!(of(Rule::VertexConflict), 7);
    assert_eq!(of(Rule::WrongStart), 7);
    assert_eq!(of(Rule::WrongGoal), 7);
    assert_eq!(verdict.violation_count, 21);
    let instance = instance(Four, &drawing);
    let cut = validate(&instance, &plan(&instance, &paths), 3);
    assert_eq!(cut.violations[..], verdict.violations[..3]);
    assert_eq!(cut.violation_count, 21);
    let none = validate(&instance, &plan(&instance, &paths), 0);
    assert!(!none.valid && none.violations.is_empty());
}

#[test]
fn verdicts_are_json() {
    let verdict = judge(
        Four,
        &["aB", "bA"],
        &[&[(0, 0), (1, 0), (1, 1)], &[(1, 0), (0, 0), (0, 1)]],
    );
    let text = serde_json::to_string(&verdict).unwrap();
    assert_eq!(
        text,
        "{\"valid\":false,\"violations\":[{\"rule\":\"swap-conflict\",\"agents\":[0,1],\"time\":1,\
         \"cells\":[{\"row\":0,\"col\":0},{\"row\":1,\"col\":0}],\"sentence\":\"agents 0 and 1 \
         exchange (0, 0) and (1, 0) between times 0 and 1\"}],\"violation_count\":1}"
    );
    assert_eq!(serde_json::from_str::<Verdict>(&text).unwrap(), verdict);
    for rule in Rule::ALL {
        assert_eq!(serde_json::to_value(rule).unwrap(), rule.name());
    }
}

/// Squared least distance of two linear motions within a step, times |w|² so
/// that it is an integer, and |w|² (1 if there is no relative motion).
fn least_distance(offset: (i64, i64), w: (i64, i64)) -> (i64, i64) {
    let dot = offset.0 * w.0 + offset.1 * w.1;
    let ww = w.0 * w.0 + w.1 * w.1;
    let square = |v: (i64, i64)| v.0 * v.0 + v.1 * v.1;
    if ww == 0 || dot >= 0 {
        (square(offset), 1)
    } else if -dot >= ww {
        (square((offset.0 + w.0, offset.1 + w.1)), 1)
    } else {
        let cross = offset.0 * w.1 - offset.1 * w.0;
        (cross * cross, ww)
    }
}

/// The derivations in the validator's documentation, for every pair of moves: a pair is
/// forbidden exactly if centres come nearer than the square root of `limit.0 / limit.1` cells.
/// Counts the forbidden pairs.
fn forbidden_pairs(connectivity: Connectivity, separation: Separation, limit: (i64, i64)) -> u32 {
    let steps = || {
        let all = (-1..=1).flat_map(|dr: i64| (-1..=1).map(move |dc: i64| (dr, dc)));
        all.filter(move |step| connectivity == Eight || step.0 == 0 || step.1 == 0)
    };
    let near = || (-3..=3).flat_map(|dr| (-3..=3).map(move |dc| (dr, dc)));
    let side = 15u32;
    let grid = Grid::new("open", side, side, vec![b'.'; (side * side) as usize]).unwrap();
    let grid = Arc::new(grid);
    let cell = |(row, col): (i64, i64)| (row * i64::from(side) + col) as u32;
    let add = |a: (i64, i64), b: (i64, i64)| (a.0 + b.0, a.1 + b.1);
    let home = (7, 7);
    let (mut forbidden, mut allowed) = (0, 0);
    for offset in near().filter(|offset| *offset != (0, 0)) {
        for (one, other) in steps().flat_map(|one| steps().map(move |other| (one, other))) {
            let starts = [home, add(home, offset)];
            let ends = [add(starts[0], one), add(starts[1], other)];
            if ends[0] == ends[1] {
                continue;
            }
            let instance = GridInstance::new(
                Arc::clone(&grid),
                connectivity,
                starts.map(cell).to_vec(),
                ends.map(cell).to_vec(),
            )
            .unwrap();
            let paths = [
                [starts[0], ends[0]].map(cell),
                [starts[1], ends[1]].map(cell),
            ];
            let terms = Terms {
                separation,
                ..(&instance).into()
            };
            let verdict = validate_terms(&terms, &GridPlan::from_paths(paths), 10);
            let w = (other.0 - one.0, other.1 - one.1);
            let (numerator, denominator) = least_distance(offset, w);
            let near = limit.1 * numerator < limit.0 * denominator;
            assert_eq!(
                verdict.valid, !near,
                "{offset:?} {one:?} {other:?} {verdict:?}"
            );
            if near {
                forbidden += 1;
                assert_eq!(verdict.violation_count, 1);
                let expected = match (numerator, denominator) {
                    (0, _) if ends == [starts[1], starts[0]] => Rule::SwapConflict,
                    (0, _) => Rule::DiagonalCrossing,
                    (1, 5) => Rule::CornerMeet,
                    (1, 2) => Rule::CornerFollow,
                    _ => panic!("the derivation has no such case: {numerator}/{denominator}"),
                };
                assert_eq!(verdict.violations[0].rule, expected);
            } else {
                allowed += 1;
            }
        }
    }
    assert!(allowed > 1000);
    forbidden
}

#[test]
fn eight_connected_rules_are_two_radii() {
    // 2r are 1/√2 cells; 8 swaps, 8 crossings, 4 diagonals × 4 straight moves × 2 roles
    // corner-meets. There is nothing to add where robots keep strictly apart.
    for separation in [Separation::Rules, Separation::Strict] {
        assert_eq!(forbidden_pairs(Eight, separation, (1, 2)), 8 + 8 + 32);
    }
}

#[test]
fn four_connected_rules_are_two_radii_where_nobody_follows_round_corners() {
    // 2r are one cell: 4 swaps, 4 moves × 2 corners × 2 roles.
    assert_eq!(forbidden_pairs(Four, Separation::Strict, (1, 1)), 4 + 16);
    // Without it, only wider cells keep two radii.
    assert_eq!(forbidden_pairs(Four, Separation::Rules, (1, 2)), 4);
}

#[test]
fn following_round_a_corner_is_named_where_robots_keep_strictly_apart() {
    let instance = instance(Four, &["ab.", "..B", ".A."]);
    let paths: [&[(i32, i32)]; 2] = [&[(0, 0), (0, 1), (1, 1), (2, 1)], &[(0, 1), (1, 1), (1, 2)]];
    let plan = plan(&instance, &paths);
    let judge = |separation| {
        let terms = Terms {
            separation,
            ..(&instance).into()
        };
        let found = validate_terms(&terms, &plan, 10).violations;
        found.iter().map(ToString::to_string).collect::<Vec<_>>()
    };
    assert_eq!(judge(Separation::Rules), [""; 0]);
    assert_eq!(
        judge(Separation::Strict),
        [
            "agent 0 follows agent 1 round a corner at (0, 1) between times 0 and 1: \
             agent 0 from (0, 0) to (0, 1), agent 1 from (0, 1) to (1, 1)",
            "agent 0 follows agent 1 round a corner at (1, 1) between times 1 and 2: \
             agent 0 from (0, 1) to (1, 1), agent 1 from (1, 1) to (1, 2)",
        ]
    );
}

#[test]
fn metrics_of_a_small_plan() {
    let instance = instance(Eight, &["a...", ".A..", "b..B"]);
    let plan = plan(
        &instance,
        &[
            &[(0, 0), (0, 0), (1, 1), (1, 1)],
            &[(2, 0), (1, 0), (2, 1), (2, 2), (2, 3)],
        ],
    );
    let found = metrics(&instance, &plan, 0.5);
    assert_eq!(found.costs, [2, 4]);
    assert_eq!((found.sum_of_costs, found.makespan), (6, 4));
    assert_eq!((found.moves, found.waits), (5, 1));
    assert_eq!(
        (found.lower_bound_steps, found.lower_bound_makespan),
        (4, 3)
    );
    let root = std::f64::consts::SQRT_2;
    assert!((found.length_m - 0.5 * (3.0 + 2.0 * root)).abs() < 1e-12);
    assert!((found.lower_bound_m - 0.5 * (3.0 + root)).abs() < 1e-12);
    // A plan of nobody costs nothing.
    let none = metrics(&instance, &GridPlan::default(), 0.5);
    assert_eq!((none.sum_of_costs, none.makespan, none.moves), (0, 0, 0));
    assert!(none.costs.is_empty() && none.length_m <= 0.0);
}

/// Violations of one agent on a map of ten columns that looks to the east first.
fn turning(path: &[u32]) -> Vec<String> {
    let grid = Grid::new("open", 2, 10, vec![b'.'; 20]).unwrap();
    let terms = Terms {
        grid: &grid,
        connectivity: Four,
        starts: &path[..1],
        goals: None,
        headings: Some(&[Heading::East]),
        window_steps: 1,
        separation: Separation::Rules,
    };
    let verdict = validate_terms(&terms, &GridPlan::from_paths([path]), 10);
    verdict.violations.iter().map(ToString::to_string).collect()
}

#[test]
fn turning_takes_steps() {
    for path in [
        &[0, 1, 1, 11][..],
        &[1, 1, 1, 0],
        &[10, 10, 0],
        &[0, 0, 10, 10, 11],
    ] {
        assert_eq!(turning(path), [""; 0], "{path:?}");
    }
    assert_eq!(
        turning(&[1, 1, 0]),
        [
            "agent 0 looks east and moves from (0, 1) to (0, 0) between times 1 and 2: \
          it needs 2 steps to turn and had 1"
        ]
    );
    // From east to north is a quarter, not three; and who has turned looks there.
    assert_eq!(
        turning(&[10, 0, 10]),
        [
            "agent 0 looks east and moves from (1, 0) to (0, 0) between times 0 and 1: \
             it needs 1 step to turn and had 0",
            "agent 0 looks north and moves from (0, 0) to (1, 0) between times 1 and 2: \
             it needs 2 steps to turn and had 0"
        ]
    );
}

#[test]
fn behind_the_window_agents_collide_but_keep_to_the_map() {
    let grid = Grid::new("corridor", 1, 5, b"....@".to_vec()).unwrap();
    let found = |window_steps, paths: [&[u32]; 2]| -> Vec<Rule> {
        let terms = Terms {
            grid: &grid,
            connectivity: Four,
            starts: &[0, 3],
            goals: None,
            headings: None,
            window_steps,
            separation: Separation::Rules,
        };
        let verdict = validate_terms(&terms, &GridPlan::from_paths(paths), 10);
        verdict.violations.iter().map(|found| found.rule).collect()
    };
    let into_each_other: [&[u32]; 2] = [&[0, 1, 2, 1], &[3, 3, 1, 2]];
    assert_eq!(found(1, into_each_other), [Rule::NotAdjacent]);
    assert_eq!(found(2, into_each_other), [Rule::NotAdjacent]);
    assert_eq!(
        found(3, into_each_other),
        [Rule::NotAdjacent, Rule::SwapConflict]
    );
    assert_eq!(found(2, [&[0, 1, 2, 3], &[3]]), []);
    assert_eq!(found(3, [&[0, 1, 2, 3], &[3]]), [Rule::ParkedConflict]);
    assert_eq!(found(1, [&[0], &[3, 3, 4]]), [Rule::Obstacle]);
    // Nobody has to arrive anywhere, but everybody begins at its start.
    assert_eq!(found(0, [&[0, 1], &[2]]), [Rule::WrongStart]);
}
