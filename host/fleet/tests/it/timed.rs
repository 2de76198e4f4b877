//! Plans in continuous time: what is refused, and the order that is left of the others.

use std::collections::BTreeMap;

use fleetyard_abi::{Instance, Lists, Motion, Visit, VisitPlan};
use fleetyard_core::{Grid, OFF_MAP};
use fleetyard_fleet::adg::{Adg, Costs};
use fleetyard_fleet::timed::{Ordered, Timed};
use fleetyard_sim::SimConfig;
use proptest::prelude::*;

use crate::walks::{Walks, north};

/// Vertices with the seconds at which they are left, driven at 1 m/s.
type Way<'a> = &'a [(u32, f64)];

fn open() -> Grid {
    Grid::new("open", 3, 3, vec![b'.'; 9]).unwrap()
}

fn timed(grid: &Grid, radius_m: f64, motion: Motion) -> Timed {
    Timed::new(grid, &SimConfig::default(), radius_m, motion).unwrap()
}

fn visits(ways: &[Way<'_>]) -> VisitPlan {
    let path = |way: &Way<'_>| {
        let arrivals = std::iter::once(0.0).chain(way.iter().map(|(_, left_s)| left_s + 1.0));
        let visits = way
            .iter()
            .zip(arrivals)
            .map(|((vertex, left_s), arrival_s)| Visit {
                vertex: *vertex,
                arrival_s,
                departure_s: left_s.max(arrival_s),
            });
        visits.collect::<Vec<Visit>>()
    };
    ways.iter().map(path).collect()
}

fn judged(timed: &Timed, grid: &Grid, window_s: f64, plan: &VisitPlan) -> Result<Ordered, String> {
    let starts: Vec<u32> = plan.iter().map(|path| path[0].vertex).collect();
    let asked = Instance {
        window_s,
        motion: Motion::StopGo,
        ..Instance::one_shot(starts.clone(), starts)
    };
    timed.judge(grid, &asked, plan)
}

fn paths(ordered: &Ordered) -> Vec<Vec<u32>> {
    let agents = 0..ordered.batch.agents();
    agents
        .map(|agent| ordered.batch.path(agent).to_vec())
        .collect()
}

#[test]
fn who_sets_out_early_comes_after_the_one_who_leaves() {
    let grid = open();
    let timed = timed(&grid, 0.3, Motion::StopGo);
    // The second one is under way before the first one leaves.
    let plan = visits(&[&[(1, 1.35), (2, 9.0)], &[(0, 1.0), (1, 9.0)]]);
    let ordered = judged(&timed, &grid, 0.0, &plan).unwrap();
    assert_eq!(paths(&ordered), [[1, 1, 2], [0, 0, 1]]);
    // And where the leader's step is a later one, the follower's is that as well.
    let plan = visits(&[&[(1, 2.1), (2, 9.0)], &[(0, 1.8), (1, 9.0)]]);
    let ordered = judged(&timed, &grid, 0.0, &plan).unwrap();
    assert_eq!(paths(&ordered), [[1, 1, 1, 2], [0, 0, 0, 1]]);
    assert!(ordered.circles.is_empty());
}

#[test]
fn rings_are_cut_with_all_that_come_behind() {
    let grid = open();
    let timed = timed(&grid, 0.3, Motion::StopGo);
    let plan = visits(&[
        &[(0, 0.0), (1, 9.0)],
        &[(1, 0.0), (4, 9.0)],
        &[(4, 0.0), (3, 9.0)],
        &[(3, 0.0), (0, 9.0)],
        // It comes where one of them stays, after a move of its own.
        &[(8, 0.0), (5, 1.0), (4, 9.0)],
    ]);
    let mut with_last = plan.iter().map(<[Visit]>::to_vec).collect::<Vec<_>>();
    let ordered = judged(&timed, &grid, 1.2, &plan).unwrap();
    assert_eq!(ordered.circles, [[0, 1, 2, 3]]);
    let ends = paths(&ordered);
    assert_eq!(ends, [vec![0], vec![1], vec![4], vec![3], vec![8, 5]]);
    // Without one of them it is a row in which all follow.
    with_last.remove(1);
    let row: VisitPlan = with_last[..3].iter().cloned().collect();
    let ordered = judged(&timed, &grid, 0.0, &row).unwrap();
    assert_eq!(paths(&ordered), [[0, 1], [4, 3], [3, 0]]);
}

/// Four robots go round in a ring, and a fifth one passes through it in between: it would wait for the one ahead of it, and the
/// last of the ring for that one's next move.
#[test]
fn larger_circles_are_found_too() {
    let grid = open();
    let timed = timed(&grid, 0.2, Motion::StopGo);
    let plan = visits(&[
        &[(3, 0.0), (4, 1.0), (1, 9.0)],
        &[(4, 0.0), (5, 9.0)],
        &[(5, 0.0), (8, 9.0)],
        &[(8, 0.2), (7, 9.0)],
        &[(7, 0.45), (4, 9.0)],
    ]);
    let ordered = judged(&timed, &grid, 0.0, &plan).unwrap();
    assert_eq!(ordered.circles, [[0, 1, 2, 3, 4]]);
    assert_eq!(paths(&ordered), [[3], [4], [5], [8], [7]]);
}

#[test]
fn refusals_say_who_when_and_why() {
    let grid = open();
    let stop_go = timed(&grid, 0.3, Motion::StopGo);
    let reason = |ways: &[Way<'_>]| judged(&stop_go, &grid, 0.0, &visits(ways)).unwrap_err();
    let meet: &[Way<'_>] = &[&[(0, 0.0), (1, 9.0)], &[(2, 1.0), (1, 9.0)]];
    let found = reason(meet);
    assert!(
        found.contains("agents 0 and 1") && found.ends_with("(vertex-conflict)"),
        "{found}"
    );
    assert!(reason(&[&[(0, 0.0), (9, 9.0)]]).ends_with("(no-such-vertex)"));
    // Behind the window they may collide, and moves that begin there are left out.
    let ordered = judged(&stop_go, &grid, 1.0, &visits(meet)).unwrap();
    assert_eq!(paths(&ordered), [vec![0, 1], vec![2]]);
    // An edge takes its time, or longer where it may.
    let to = |vertex: u32, takes_s: f64| {
        let visit = |vertex, arrival_s, departure_s| Visit {
            vertex,
            arrival_s,
            departure_s,
        };
        let path = vec![visit(0, 0.0, 0.0), visit(vertex, takes_s, takes_s)];
        VisitPlan::from_iter([path])
    };
    let slow = |takes_s| to(1, takes_s);
    let slower = timed(&grid, 0.3, Motion::Slower);
    let found = judged(&slower, &grid, 0.0, &to(4, 2.0)).unwrap_err();
    assert!(found.contains("no edge from 0 to 4"), "{found}");
    assert!(
        judged(&stop_go, &grid, 0.0, &slow(1.5))
            .unwrap_err()
            .ends_with("(too-slow)")
    );
    assert!(
        judged(&slower, &grid, 0.0, &slow(0.9))
            .unwrap_err()
            .ends_with("(too-fast)")
    );
    judged(&slower, &grid, 0.0, &slow(1.5)).unwrap();
    let far = judged(&slower, &grid, 0.0, &slow(1e6)).unwrap();
    assert_eq!(paths(&far), [[0, 1]]);
    // A wait of years is no path in steps.
    let late = judged(
        &stop_go,
        &grid,
        0.0,
        &visits(&[&[(0, 1e8), (1, 1e8 + 1.0)]]),
    )
    .unwrap_err();
    assert!(late.contains("steps of 1 s"), "{late}");
    let other = Instance::one_shot(vec![1], vec![1]);
    let found = stop_go.judge(&grid, &other, &slow(1.0)).unwrap_err();
    assert!(found.ends_with("(wrong-start)"), "{found}");
}

#[test]
fn robots_that_touch_in_neighbouring_cells_have_no_roadmap() {
    let grid = open();
    let error = Timed::new(&grid, &SimConfig::default(), 0.6, Motion::StopGo).unwrap_err();
    assert!(error.to_string().contains("touch each other"), "{error}");
    let error = Timed::new(&grid, &SimConfig::default(), 0.3, Motion::Pebble).unwrap_err();
    assert!(error.to_string().contains("none of roadmaps"), "{error}");
}

#[test]
fn instances_are_those_of_the_free_cells() {
    let grid = Grid::new("gap", 1, 4, b".@..".to_vec()).unwrap();
    let timed = timed(&grid, 0.3, Motion::Slower);
    let mut asked = Instance::one_shot(vec![2], vec![3]);
    asked.window_steps = 4;
    let found = timed.instance(&asked).unwrap();
    assert_eq!(
        (found.starts.as_slice(), &found.goals[0][..]),
        (&[1][..], &[2][..])
    );
    assert_eq!((found.window_steps, found.window_s), (0, 4.0));
    assert_eq!(found.motion, Motion::Slower);
    asked.starts[0] = 1;
    assert_eq!(timed.instance(&asked).unwrap_err(), "cell 1 is not free");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Whatever is left of a plan passes through each cell in the plan's order and can be done; without circles and a window it
    /// is all of it.
    #[test]
    fn the_order_of_passing_is_the_plans(seed: u64, agents in 1..20_usize, rings in 0.0..1.0_f64, window in 0..6_u32) {
        let grid = Grid::new("open", 5, 5, vec![b'.'; 25]).unwrap();
        let mut walks = Walks::new(grid.clone(), seed);
        walks.rings = rings;
        let mut starts: Vec<u32> = (0..25).collect();
        walks.random.shuffle(&mut starts);
        starts.truncate(agents);
        let plan = walks.plan(&starts, 6);
        let way = |path: &[u32]| {
            let mut way: Vec<Visit> = Vec::new();
            for (step, vertex) in path.iter().enumerate() {
                match way.last_mut() {
                    Some(last) if last.vertex == *vertex => last.departure_s = step as f64,
                    _ => way.push(Visit { vertex: *vertex, arrival_s: step as f64, departure_s: step as f64 }),
                }
            }
            way
        };
        let visits: Lists<Visit> = plan.paths().map(way).collect();
        let timed = timed(&grid, 0.3, Motion::StopGo);
        let ordered = judged(&timed, &grid, f64::from(window), &visits).unwrap();
        let mut planned: BTreeMap<u32, Vec<(usize, usize)>> = BTreeMap::new();
        for (agent, path) in plan.paths().enumerate() {
            for step in 1..path.len() {
                if path[step] != path[step - 1] {
                    planned.entry(path[step]).or_default().push((step, agent));
                }
            }
        }
        let mut adg = Adg::new(&grid, &starts, &north(agents), Costs::default()).unwrap();
        let appended = adg.append(&ordered.batch, &mut |_, _| OFF_MAP).unwrap();
        prop_assert_eq!((appended.rings_cut, appended.stopped), (0, 0));
        prop_assert!(adg.is_acyclic());
        for cell in 0..25 {
            let mut order = planned.remove(&cell).unwrap_or_default();
            order.sort_unstable();
            let found: Vec<u32> = adg.visitors(cell).collect();
            let first = usize::from(found.first().is_some_and(|agent| starts[*agent as usize] == cell));
            let expected: Vec<u32> = order.iter().map(|(_, agent)| *agent as u32).collect();
            prop_assert!(expected.starts_with(&found[first..]), "{cell}: {found:?} of {expected:?}");
            if window == 0 && ordered.circles.is_empty() {
                prop_assert_eq!(expected.len(), found.len() - first);
            }
        }
    }
}
