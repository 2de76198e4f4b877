//! `ctc`: orders of all discs, then priorities between two.

use fleetyard_plugin_roadmap::closeness::Closeness;
use fleetyard_plugin_roadmap::crowd::{Crowd, Others, Scratch};
use fleetyard_plugin_roadmap::ctc::{Ended, Outcome, Settings, plan};
use fleetyard_plugin_roadmap::pbs::{Control, End};
use fleetyard_plugin_roadmap::priority::{Disc, sum_of_costs};
use fleetyard_plugin_roadmap::rest::{Known, Rest};
use fleetyard_plugin_roadmap::roadmap::{Roadmap, Vertex};
use fleetyard_plugin_roadmap::sipp::{Found, Search, Taken, Task};
use fleetyard_plugin_spacetime::order::Prefer;
use proptest::prelude::*;

use super::support::{Case, apart, discs, least_distance, shared};
use super::{SEPARATION, Vector, judge_path, lattice, roadmap, tasks, walk};

/// Whole paths with so many orders, and then so many nodes.
fn solve(closeness: &Closeness, tasks: &[(Vertex, Vertex)], orders: u64, nodes: u64) -> Outcome {
    let settings = Settings {
        orders,
        prefer: Prefer::default(),
        seed: 1,
    };
    let mut control = Control {
        stop: &mut || false,
        nodes,
        memory: 1 << 28,
    };
    let discs = discs(tasks);
    let team = (discs.as_slice(), f64::INFINITY);
    let mut best = f64::INFINITY;
    let outcome = plan(
        closeness,
        &mut Known::default(),
        team,
        settings,
        &mut control,
        &mut |paths| {
            assert!(sum_of_costs(paths) < best, "each plan is better");
            best = sum_of_costs(paths);
        },
    );
    if let Ended::Tried(End::Solved(paths)) = &outcome.end {
        assert!((sum_of_costs(paths) - best).abs() < 1e-9);
    }
    outcome
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn priorities_keep_discs_apart(
        roadmap in roadmap(), wanted in proptest::collection::vec((0..16_usize, 0..16_usize), 1..7), orders in 0..3_u64,
    ) {
        let tasks = tasks(&roadmap, &wanted);
        let closeness = Closeness::new(roadmap.clone());
        let outcome = solve(&closeness, &tasks, orders, 200);
        prop_assert_eq!(&outcome, &solve(&Closeness::new(roadmap.clone()), &tasks, orders, 200));
        prop_assert!(outcome.orders + outcome.nodes <= 200);
        match outcome.end {
            Ended::Tried(End::Solved(paths)) => {
                for (path, task) in paths.iter().zip(&tasks) {
                    judge_path(&roadmap, path, *task)?;
                }
                let apart = least_distance(&roadmap, &paths);
                prop_assert!(apart > SEPARATION - 1e-7, "{apart} m apart");
            }
            end => prop_assert!(tasks.len() > 1, "one disc alone has a path: {end:?}"),
        }
    }

    #[test]
    fn a_crowd_knows_who_meets_whom_and_keeps_a_disc_from_those_that_count(
        diagonals in proptest::collection::vec(any::<bool>(), 9),
        walks in proptest::collection::vec((0..16_u32, proptest::collection::vec((0..8_u32, 0..6_u8), 1..6)), 2..6),
        changes in proptest::collection::vec((0..6_usize, 0..6_usize), 0..6),
        counted in proptest::collection::vec(any::<bool>(), 6),
        task in (0..16_u32, 0..16_u32),
    ) {
        let roadmap = lattice(&diagonals);
        let closeness = Closeness::new(roadmap.clone());
        let paths: Vec<_> = walks.iter().map(|(start, choices)| walk(&roadmap, *start, choices)).collect();
        let count = paths.len();
        let mut crowd = Crowd::new(&closeness, count + 1, f64::INFINITY);
        for (disc, path) in paths.iter().enumerate() {
            crowd.exchange(disc as u32, path.clone());
        }
        for (disc, other) in changes {
            let (disc, other) = ((disc % count) as u32, other % count);
            crowd.exchange(disc, paths[other].clone());
        }
        for one in 0..count as u32 {
            for other in 0..one {
                let least = apart(&roadmap, crowd.path(one), crowd.path(other), 0.0, 100.0);
                let meets = crowd.meetings(one).iter().any(|meeting| meeting.disc == other);
                let met = crowd.meetings(other).iter().any(|meeting| meeting.disc == one);
                prop_assert_eq!(meets, met);
                prop_assert!(if meets { least < SEPARATION + 1e-6 } else { least > SEPARATION - 1e-7 }, "{least} {meets}");
            }
        }
        let mut scratch = Scratch::new(&closeness);
        let rest = Rest::to(&roadmap, &[task.1], true, &mut Known::default());
        let asked = Task { start: task.0, direction: None, rest: &rest, until: f64::INFINITY };
        let others = Others::new(&crowd, &mut scratch, count as u32, |disc| counted[disc as usize]);
        let found = Search::new(&roadmap).find(&roadmap, &others, &asked, &mut || false);
        if let Found::Path(path) = found {
            for other in (0..count).filter(|other| counted[*other]) {
                let least = apart(&roadmap, &path, crowd.path(other as u32), 0.0, 100.0);
                prop_assert!(least > SEPARATION - 1e-7, "{least} m apart");
            }
        } else {
            let nobody = Others::new(&crowd, &mut scratch, count as u32, |_| false);
            prop_assert!(nobody.vertex(task.0).as_slice().is_empty());
            let alone = Search::new(&roadmap).find(&roadmap, &nobody, &asked, &mut || false);
            prop_assert!(matches!(alone, Found::Path(_)));
        }
    }
}

/// Two discs change places on a lattice, where priorities alone lead to a plan and both orders do.
#[test]
fn orders_and_priorities_both_lead_to_plans() {
    let closeness = Closeness::new(lattice(&[false; 9]));
    let tasks = [(0, 3), (3, 0), (12, 15), (15, 12)];
    for orders in [0, 5] {
        let outcome = solve(&closeness, &tasks, orders, 100);
        let Ended::Tried(End::Solved(paths)) = outcome.end else {
            panic!("{outcome:?}")
        };
        assert!(least_distance(closeness.roadmap(), &paths) > SEPARATION - 1e-9);
        assert_eq!(outcome.orders == 0, orders == 0);
        assert!(outcome.nodes > 0);
    }
}

#[test]
fn a_goal_to_which_no_way_leads_is_said_to_be_such() {
    let places = vec![
        Vector::zeros(),
        Vector::new(1.0, 0.0),
        Vector::new(5.0, 0.0),
    ];
    let roadmap = Roadmap::new(places, [(0, 1, 1.0), (1, 0, 1.0)], SEPARATION).unwrap();
    let closeness = Closeness::new(roadmap);
    assert_eq!(
        solve(&closeness, &[(0, 1), (2, 0)], 5, 100).end,
        Ended::NoWay(1)
    );
    // Nobody passes on a line of two.
    assert_eq!(
        solve(&closeness, &[(0, 1), (1, 0)], 5, 100).end,
        Ended::Tried(End::Exhausted)
    );
    assert_eq!(
        solve(&closeness, &[(0, 1)], 0, 1).end,
        solve(&closeness, &[(0, 1)], 1, 1).end
    );
}

/// Priorities are found again after the roadmap was searched in a window with goals one after the other.
#[test]
fn windows_end_with_the_first_plan() {
    let closeness = Closeness::new(lattice(&[true; 9]));
    let disc = |start, goals: &[Vertex]| Disc {
        start,
        direction: None,
        goals: goals.to_vec(),
    };
    let discs = [disc(0, &[3, 0]), disc(3, &[0, 15]), disc(5, &[])];
    for orders in [0, 20] {
        let settings = Settings {
            orders,
            prefer: Prefer::Cost,
            seed: 1,
        };
        let mut control = Control {
            stop: &mut || false,
            nodes: 100,
            memory: 1 << 28,
        };
        let mut plans = 0;
        let outcome = plan(
            &closeness,
            &mut Known::default(),
            (&discs, 4.0),
            settings,
            &mut control,
            &mut |_| plans += 1,
        );
        let Ended::Tried(End::Solved(paths)) = outcome.end else {
            panic!("{outcome:?}")
        };
        assert_eq!((plans, outcome.nodes == 0), (1, orders > 0));
        for (one, other) in [(0, 1), (0, 2), (1, 2)] {
            let least = apart(
                closeness.roadmap(),
                &paths[one],
                &paths[other],
                0.0,
                4.0 - 1e-6,
            );
            assert!(least > SEPARATION - 1e-9, "{least}");
        }
    }
}

#[test]
fn a_limit_of_memory_ends_the_search() {
    let closeness = Closeness::new(lattice(&[false; 9]));
    let discs = discs(&[(0, 3), (3, 0)]);
    let settings = Settings {
        orders: 0,
        prefer: Prefer::default(),
        seed: 1,
    };
    let mut control = Control {
        stop: &mut || false,
        nodes: 100,
        memory: 0,
    };
    let team = (discs.as_slice(), f64::INFINITY);
    let outcome = plan(
        &closeness,
        &mut Known::default(),
        team,
        settings,
        &mut control,
        &mut |_| {},
    );
    assert_eq!(outcome.end, Ended::Tried(End::Memory));
}

/// Problems of the shared data, where they are at hand: sixty discs, with few orders and with none.
#[test]
fn sixty_discs_have_plans_by_priorities_alone() {
    for name in ["rooms-32-sparse-2", "empty-32-dense-1"] {
        let Some(file) = shared(name) else { return };
        let case = Case::read(&file, 60).unwrap();
        let closeness = Closeness::new(case.roadmap.clone());
        let outcome = solve(&closeness, &case.tasks, 0, 5000);
        let Ended::Tried(End::Solved(paths)) = outcome.end else {
            panic!("{}: {:?}", file.display(), outcome.end)
        };
        let apart = least_distance(&case.roadmap, &paths);
        assert!(apart > case.roadmap.separation(0, 0) - 1e-7, "{apart}");
    }
}
