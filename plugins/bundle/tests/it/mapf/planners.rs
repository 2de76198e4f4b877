//! The planners at their boundary: validity, proofs, errors, determinism, and, on
//! instances tiny enough for brute force, the optimum.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::ops::Range;

use super::support::{Patient, solve, verify};
use fleetyard_abi::{Goals, GridEnvironment, GridPlan, Instance};
use fleetyard_plugin_mapf::{Algorithm, Limit, Observer, Options, Outcome, ProblemError};
use fleetyard_testkit::{Case, grid};
use proptest::prelude::*;

fn pibt() -> Options {
    Options {
        algorithm: Algorithm::Pibt,
        step_limit: 500,
        ..Options::default()
    }
}

fn outcome(problem: &Case, options: &Options) -> Outcome {
    solve(problem, options, 7, &mut Patient::default()).expect("the problem is well formed")
}

/// All joint moves from a configuration without conflicts.
fn successors(problem: &Case, q: &[u32]) -> Vec<Vec<u32>> {
    let choices = |v: u32| [v].into_iter().chain(grid::near(&problem.map, v));
    let mut found: Vec<Vec<u32>> = vec![Vec::new()];
    for &v in q {
        let mut longer = Vec::new();
        for prefix in &found {
            for u in choices(v) {
                let clash = prefix.iter().enumerate();
                if clash.clone().any(|(b, &w)| w == u || (w == v && q[b] == u)) {
                    continue;
                }
                let mut next = prefix.clone();
                next.push(u);
                longer.push(next);
            }
        }
        found = longer;
    }
    found
}

/// Cheapest way from all starts to all goals by Dijkstra over configurations together
/// with the set of agents that rest for good. With `retire`, the sum of costs; without,
/// the sum of loss.
fn brute_force(problem: &Case, retire: bool) -> Option<u64> {
    let Instance { starts, goals, .. } = &problem.instance;
    let (agents, goals) = (starts.len(), goals.items());
    let all = (1_u32 << agents) - 1;
    let mut best: BTreeMap<(Vec<u32>, u32), u64> = BTreeMap::new();
    let mut open = BinaryHeap::from([Reverse((0, starts.clone(), 0_u32))]);
    while let Some(Reverse((cost, q, resting))) = open.pop() {
        if q == goals && (resting == all || !retire) {
            return Some(cost);
        }
        if best
            .get(&(q.clone(), resting))
            .is_some_and(|&known| known <= cost)
        {
            continue;
        }
        best.insert((q.clone(), resting), cost);
        if retire {
            for agent in 0..agents {
                if resting >> agent & 1 == 0 && q[agent] == goals[agent] {
                    open.push(Reverse((cost, q.clone(), resting | 1 << agent)));
                }
            }
        }
        for next in successors(problem, &q) {
            let moved = (0..agents).any(|a| resting >> a & 1 == 1 && next[a] != q[a]);
            if moved {
                continue;
            }
            let paid = (0..agents).filter(|&a| {
                let goal = goals[a];
                if retire {
                    resting >> a & 1 == 0
                } else {
                    q[a] != goal || next[a] != goal
                }
            });
            let cost = cost + paid.count() as u64;
            if best
                .get(&(next.clone(), resting))
                .is_none_or(|&known| cost < known)
            {
                open.push(Reverse((cost, next, resting)));
            }
        }
    }
    None
}

/// Grids with so many rows, columns and agents anywhere, reachable or not.
fn cases(
    rows: Range<u32>,
    cols: Range<u32>,
    agents: Range<usize>,
    share: f64,
) -> impl Strategy<Value = Case> {
    (rows, cols)
        .prop_flat_map(move |(rows, cols)| {
            let cell = prop::bool::weighted(share).prop_map(u8::from);
            let cells = prop::collection::vec(cell, (rows * cols) as usize);
            cells.prop_map(move |cells| GridEnvironment::four_connected(rows, cols, cells))
        })
        .prop_flat_map(move |map| {
            let free = grid::free(&map);
            let shuffled = (Just(free.clone()).prop_shuffle(), Just(free).prop_shuffle());
            (Just(map), shuffled, agents.clone())
        })
        .prop_map(|(map, (mut starts, mut goals), agents)| {
            starts.truncate(agents);
            goals.truncate(agents);
            let instance = Instance::one_shot(starts, goals);
            Case { map, instance }
        })
}

/// Up to three agents.
fn tiny() -> impl Strategy<Value = Case> {
    cases(1..4, 2..5, 1..4, 0.9)
}

/// Middling grids for validity.
fn small() -> impl Strategy<Value = Case> {
    cases(3..12, 3..12, 1..24, 0.85)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    /// Run to the end, LaCAM* proves what brute force finds.
    #[test]
    fn exhausted_search_is_exact(problem in tiny(), samples in 1_u32..4, guided: bool) {
        let scatter_margin = guided.then_some(4);
        let options = Options { samples, scatter_margin, ..Options::default() };
        let expected = brute_force(&problem, false);
        match solve(&problem, &options, 1, &mut Patient::default()) {
            Ok(Outcome::Solved { plan, sum_of_costs, lower_bound }) => {
                prop_assert_eq!(verify(&problem, &plan), Ok(()));
                prop_assert_eq!(plan.sum_of_costs(), sum_of_costs);
                let best = brute_force(&problem, true).expect("there is a plan");
                prop_assert!(sum_of_costs >= best);
                if lower_bound < sum_of_costs {
                    prop_assert_eq!(Some(lower_bound), expected);
                } else {
                    prop_assert_eq!(sum_of_costs, best);
                }
            }
            Ok(Outcome::Infeasible) => prop_assert_eq!(expected, None),
            Ok(Outcome::GaveUp(limit)) => prop_assert!(false, "gave up: {limit:?}"),
            Err(ProblemError::Unreachable { .. }) => prop_assert_eq!(expected, None),
            Err(error) => prop_assert!(false, "{error}"),
        }
    }

    /// Everything that is called a plan is one, whatever the options.
    #[test]
    fn plans_are_valid(
        mut problem in small(), seed: u64, swap: bool, refine: bool, guided: bool, rings: bool
    ) {
        problem.instance.allows_cycles = rings;
        let lacam = Options {
            swap,
            rings,
            refine,
            scatter_margin: guided.then_some(10),
            node_limit: Some(2000),
            ..Options::default()
        };
        for options in [lacam, Options { swap, rings, ..pibt() }] {
            let mut observer = Patient::default();
            let result = solve(&problem, &options, seed, &mut observer);
            for (plan, sum) in observer.plans.iter().zip(&observer.sums) {
                prop_assert_eq!(verify(&problem, plan), Ok(()));
                prop_assert_eq!(plan.sum_of_costs(), *sum);
            }
            prop_assert!(observer.sums.is_sorted_by(|a, b| a > b));
            if let Ok(Outcome::Solved { plan, sum_of_costs, lower_bound }) = result {
                prop_assert_eq!(Some(&plan), observer.plans.last());
                prop_assert!(lower_bound <= sum_of_costs);
            } else {
                prop_assert!(observer.plans.is_empty());
            }
        }
    }

    /// The course of events depends on the seed, not on the number of threads.
    #[test]
    fn threads_do_not_matter(problem in small(), seed: u64) {
        let run = |threads| {
            let options = Options { threads, node_limit: Some(600), ..Options::default() };
            let mut observer = Patient::default();
            let result = solve(&problem, &options, seed, &mut observer);
            (result, observer.plans, observer.metrics)
        };
        let alone = run(1);
        prop_assert_eq!(&alone, &run(1));
        prop_assert_eq!(&alone, &run(3));
    }
}

#[test]
fn a_team_large_enough_for_many_slots_is_deterministic() {
    let passable = (0..24 * 24).map(|cell| u8::from(cell * 7 % 11 != 0));
    let map = GridEnvironment::four_connected(24, 24, passable.collect());
    let free = grid::free(&map);
    let goals = free.iter().rev().take(200).copied().collect();
    let instance = Instance::one_shot(free[..200].to_vec(), goals);
    let problem = Case { map, instance };
    let run = |threads| {
        let options = Options {
            threads,
            node_limit: Some(1500),
            ..Options::default()
        };
        let mut observer = Patient::default();
        let result = solve(&problem, &options, 3, &mut observer);
        for plan in &observer.plans {
            assert_eq!(verify(&problem, plan), Ok(()));
        }
        (result, observer.sums)
    };
    let alone = run(1);
    assert!(alone.1.len() > 1, "nothing was refined: {:?}", alone.1);
    assert_eq!(alone, run(4));
}

#[test]
fn impossible_swaps_are_proven_infeasible() {
    let corridor: (&[&str], &[(u32, u32)]) = (&["...."], &[(0, 3), (3, 0)]);
    let adjacent: (&[&str], &[(u32, u32)]) = (&[".."], &[(0, 1), (1, 0)]);
    let full: (&[&str], &[(u32, u32)]) = (&["..", ".@"], &[(0, 1), (1, 0), (2, 2)]);
    let dead_end: (&[&str], &[(u32, u32)]) = (&["..@", "@.@"], &[(0, 4), (4, 0)]);
    for (map, agents) in [corridor, adjacent, full, dead_end] {
        let problem = Case::new(map, agents);
        assert_eq!(
            outcome(&problem, &Options::default()),
            Outcome::Infeasible,
            "{map:?}"
        );
        let limit = Outcome::GaveUp(Limit::Steps);
        assert_eq!(
            outcome(&problem, &pibt()),
            limit,
            "{map:?}: PIBT proves nothing"
        );
    }
}

#[test]
fn a_bay_makes_the_swap_possible() {
    let problem = Case::new(&["....", "@.@@"], &[(0, 3), (3, 0)]);
    let Outcome::Solved {
        plan,
        sum_of_costs,
        lower_bound,
    } = outcome(&problem, &Options::default())
    else {
        panic!("there is a plan");
    };
    assert_eq!(verify(&problem, &plan), Ok(()));
    assert_eq!((sum_of_costs, lower_bound), (8, 8));
}

#[test]
fn no_agents_and_agents_at_home_cost_nothing() {
    for agents in [&[][..], &[(0, 0), (3, 3)][..]] {
        let problem = Case::new(&["..", ".."], agents);
        for options in [Options::default(), pibt()] {
            let Outcome::Solved {
                plan,
                sum_of_costs,
                lower_bound,
            } = outcome(&problem, &options)
            else {
                panic!("there is a plan");
            };
            assert_eq!((sum_of_costs, lower_bound, plan.horizon()), (0, 0, 0));
            assert_eq!(verify(&problem, &plan), Ok(()));
        }
    }
    let nothing = Case::new(&[], &[]);
    assert!(matches!(
        outcome(&nothing, &Options::default()),
        Outcome::Solved { .. }
    ));
}

#[test]
fn what_is_wrong_with_a_problem_is_said() {
    let good = Case::new(&["..@.", "..@."], &[(0, 1), (4, 5)]);
    let change = |f: &dyn Fn(&mut Vec<u32>, &mut Vec<u32>)| {
        let mut problem = good.clone();
        let mut goals = vec![1, 5];
        f(&mut problem.instance.starts, &mut goals);
        problem.instance.goals = Goals::single(goals);
        problem
    };
    let cases = [
        (
            change(&|_, goals| goals.truncate(1)),
            "2 starts and 1 goals: each agent needs one of both",
        ),
        (
            change(&|starts, _| starts[1] = 2),
            "agent 1: start cell 2 is not a passable cell of the map",
        ),
        (
            change(&|_, goals| goals[0] = 99),
            "agent 0: goal cell 99 is not a passable cell of the map",
        ),
        (
            change(&|starts, _| starts[1] = 0),
            "agents 0 and 1 have the same start cell 0",
        ),
        (
            change(&|_, goals| goals[1] = 1),
            "agents 0 and 1 have the same goal cell 1",
        ),
        (
            change(&|_, goals| goals[1] = 3),
            "agent 1: no path of at most 65533 steps from cell 4 to cell 3",
        ),
    ];
    for (problem, message) in cases {
        for options in [Options::default(), pibt()] {
            let error = solve(&problem, &options, 0, &mut Patient::default())
                .expect_err("the problem is not well formed");
            assert_eq!(error.to_string(), message);
            assert!(!error.hint().is_empty());
        }
    }
}

#[test]
fn extreme_options_are_harmless() {
    let problem = Case::new(&["....", ".@..", "...."], &[(0, 11), (11, 0), (3, 8)]);
    let base = Options {
        node_limit: Some(300),
        ..Options::default()
    };
    let cases = [
        Options {
            samples: 0,
            ..base.clone()
        },
        Options {
            samples: 1000,
            node_limit: Some(20),
            ..base.clone()
        },
        Options {
            scatter_margin: Some(u32::MAX),
            ..base.clone()
        },
        Options {
            scatter_margin: Some(0),
            ..base.clone()
        },
        Options {
            threads: 0,
            ..base.clone()
        },
        Options {
            threads: usize::MAX,
            ..base.clone()
        },
        Options {
            refine: false,
            swap: false,
            ..base.clone()
        },
        Options {
            step_limit: u64::MAX,
            ..pibt()
        },
    ];
    for options in cases {
        let Outcome::Solved { plan, .. } = outcome(&problem, &options) else {
            panic!("{options:?} prevents a plan");
        };
        assert_eq!(verify(&problem, &plan), Ok(()));
    }
}

/// Stops after so many questions.
struct Impatient(u64);

impl Observer for Impatient {
    fn incumbent(&mut self, _: &GridPlan, _: u64) {}
    fn stop(&mut self) -> bool {
        self.0 = self.0.saturating_sub(1);
        self.0 == 0
    }
    fn metric(&mut self, _: &str, _: f64) {}
}

#[test]
fn stopping_at_any_moment_gives_a_valid_outcome() {
    let map = ["......", ".@..@.", "......", ".@..@.", "......"];
    let agents: Vec<(u32, u32)> = [(0, 29), (29, 0), (5, 24), (24, 5), (14, 15), (15, 14)].into();
    let problem = Case::new(&map, &agents);
    for options in [Options::default(), pibt()] {
        let mut solved = 0;
        for questions in 1..200 {
            let result = solve(&problem, &options, 5, &mut Impatient(questions));
            match result.expect("the problem is well formed") {
                Outcome::Solved { plan, .. } => {
                    assert_eq!(verify(&problem, &plan), Ok(()));
                    solved += 1;
                }
                other => assert_eq!(other, Outcome::GaveUp(Limit::Stopped)),
            }
        }
        assert!(solved > 0);
    }
}

#[test]
fn limits_are_named() {
    let hard = Case::new(&["....", "@.@@"], &[(0, 3), (3, 0)]);
    let nodes = Options {
        node_limit: Some(1),
        anytime: false,
        ..Options::default()
    };
    assert_eq!(outcome(&hard, &nodes), Outcome::GaveUp(Limit::Nodes));
    let memory = Options {
        memory_limit: 0,
        anytime: false,
        ..Options::default()
    };
    assert_eq!(outcome(&hard, &memory), Outcome::GaveUp(Limit::Memory));
    let steps = Options {
        step_limit: 1,
        ..pibt()
    };
    assert_eq!(outcome(&hard, &steps), Outcome::GaveUp(Limit::Steps));
}

#[test]
fn a_reserve_plan_stands_in_when_the_search_is_cut_short() {
    let problem = Case::new(&["....", "...."], &[(0, 7), (7, 0)]);
    let options = Options {
        node_limit: Some(1),
        ..Options::default()
    };
    let Outcome::Solved { plan, .. } = outcome(&problem, &options) else {
        panic!("PIBT solves this");
    };
    assert_eq!(verify(&problem, &plan), Ok(()));
}

/// The benchmark files, where they are at hand.
#[test]
fn benchmark_scenarios_are_solved() {
    for (map, agents) in [
        ("random-32-32-20", 200),
        ("maze-32-32-4", 100),
        ("den312d", 300),
    ] {
        let Some((map_file, scenario)) = grid::movingai(map, 1) else {
            continue;
        };
        let problem = Case::read(&map_file, &scenario, agents).expect("readable files");
        let mut observer = Patient::default();
        let options = Options {
            node_limit: Some(5000),
            ..Options::default()
        };
        let result = solve(&problem, &options, 0, &mut observer);
        let Ok(Outcome::Solved { plan, .. }) = result else {
            panic!("{}: {result:?}", scenario.display());
        };
        assert_eq!(verify(&problem, &plan), Ok(()));
    }
}
