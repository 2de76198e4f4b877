//! The searches at their boundary: the optimum where brute force can find it, validity,
//! symmetric cases in few nodes, proofs, budgets.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap, VecDeque};

use fleetyard_abi::{GridEnvironment, Instance};
use fleetyard_plugin_conflict::{End, Outcome, Settings, solve};
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem};
use fleetyard_testkit::{Case, grid};
use proptest::prelude::*;

fn problem(case: &Case) -> Problem {
    Ground::new(&case.map, 1 << 30)
        .and_then(|mut ground| ground.problem(&case.instance, GoalRule::Stay, &mut || false))
        .expect("a problem that is well formed")
}

fn run(case: &Case, settings: &Settings) -> (Outcome, Vec<Vec<u32>>) {
    let problem = problem(case);
    let outcome = solve(&problem, settings, &mut || false);
    let plan = problem.plan(&outcome.paths);
    let paths = plan.paths().map(<[u32]>::to_vec).collect();
    (outcome, paths)
}

fn optimal(delay: u32) -> Settings {
    Settings {
        delay,
        node_limit: Some(120),
        ..Settings::default()
    }
}

/// A cell and a heading (0 for pebbles) per agent, the cells of the last `delay` steps, and
/// who rests for good.
type State = (Vec<(u32, i32)>, VecDeque<Vec<u32>>, u32);

/// Every way in which agents that do not rest can go on.
fn successors(case: &Case, (poses, history, resting): &State, delay: u32) -> Vec<State> {
    let turning = case.instance.headings.is_some();
    let options = |agent: usize| {
        let (cell, heading) = poses[agent];
        if resting >> agent & 1 == 1 {
            return vec![(cell, heading)];
        }
        let mut options = vec![(cell, heading)];
        for next in grid::near(&case.map, cell) {
            let towards = case.towards(i64::from(next) - i64::from(cell)).code();
            if !turning {
                options.push((next, 0));
            } else if towards == heading {
                options.push((next, heading));
            }
        }
        if turning {
            options.extend([(cell, (heading + 1) % 4), (cell, (heading + 3) % 4)]);
        }
        options
    };
    let mut found: Vec<Vec<(u32, i32)>> = vec![Vec::new()];
    for agent in 0..poses.len() {
        found = found
            .into_iter()
            .flat_map(|prefix| {
                options(agent).into_iter().map(move |pose| {
                    let mut longer = prefix.clone();
                    longer.push(pose);
                    longer
                })
            })
            .collect();
    }
    let now: Vec<u32> = poses.iter().map(|pose| pose.0).collect();
    let mut history = history.clone();
    history.push_back(now.clone());
    if history.len() > delay as usize {
        history.pop_front();
    }
    found.retain(|next| {
        let pairs = (0..next.len()).flat_map(|a| (0..next.len()).map(move |b| (a, b)));
        let mut pairs = pairs.filter(|(a, b)| a != b);
        let clash = pairs.any(|(a, b)| {
            next[a].0 == next[b].0
                || (next[a].0 == now[b] && next[b].0 == now[a])
                || history.iter().any(|before| before[a] == next[b].0)
        });
        let ring = !case.instance.allows_cycles && {
            let paths: Vec<Vec<u32>> = now.iter().zip(next).map(|(a, b)| vec![*a, b.0]).collect();
            let mut one_step = case.clone();
            one_step.instance.starts.clone_from(&now);
            one_step.instance.headings = None;
            one_step.instance.window_steps = 1;
            one_step.judge(&paths, 0).is_err()
        };
        !clash && !ring
    });
    found
        .into_iter()
        .map(|next| (next, history.clone(), *resting))
        .collect()
}

/// The least sum of costs, by Dijkstra over configurations and who rests for good.
fn brute_force(case: &Case, delay: u32) -> Option<u64> {
    let agents = case.instance.agents();
    let heading = |agent: usize| match &case.instance.headings {
        Some(headings) => headings[agent].code(),
        None => 0,
    };
    let starts = (0..agents).map(|agent| (case.instance.starts[agent], heading(agent)));
    let start: State = (starts.collect(), VecDeque::new(), 0);
    let mut best: BTreeMap<State, u64> = BTreeMap::from([(start.clone(), 0)]);
    let mut open = BinaryHeap::from([Reverse((0, start))]);
    while let Some(Reverse((cost, state))) = open.pop() {
        if best.get(&state).is_some_and(|&known| known < cost) {
            continue;
        }
        if state.2 == (1 << agents) - 1 {
            return Some(cost);
        }
        let mut offer = |state: State, cost: u64| {
            if best.get(&state).is_none_or(|&known| cost < known) {
                best.insert(state.clone(), cost);
                open.push(Reverse((cost, state)));
            }
        };
        for agent in 0..agents {
            let there = state.0[agent].0 == case.instance.goals[agent][0];
            if state.2 >> agent & 1 == 0 && there {
                offer(
                    (state.0.clone(), state.1.clone(), state.2 | 1 << agent),
                    cost,
                );
            }
        }
        let paid = u64::from(agents as u32 - state.2.count_ones());
        for next in successors(case, &state, delay) {
            offer(next, cost + paid);
        }
    }
    None
}

/// Small grids with a few agents anywhere.
fn grid(rows: u32, cols: u32, agents: usize) -> impl Strategy<Value = Case> {
    (1..=rows, 2..=cols)
        .prop_flat_map(|(rows, cols)| {
            let cells = prop::collection::vec(prop::bool::weighted(0.88), (rows * cols) as usize);
            (Just((rows, cols)), cells)
        })
        .prop_flat_map(move |((rows, cols), passable)| {
            let free: Vec<u32> = (0..rows * cols).filter(|&c| passable[c as usize]).collect();
            let shuffled = (Just(free.clone()).prop_shuffle(), Just(free).prop_shuffle());
            (Just((rows, cols, passable)), shuffled, 1..=agents)
        })
        .prop_filter_map(
            "connected",
            |((rows, cols, passable), (starts, goals), agents)| {
                let passable = passable.into_iter().map(u8::from).collect();
                let map = GridEnvironment::four_connected(rows, cols, passable);
                let agents = agents.min(starts.len());
                let pairs = starts.iter().zip(&goals).take(agents);
                let all = agents > 0 && { pairs }
                    .all(|(start, goal)| grid::region(&map, *start).contains(goal));
                let instance =
                    Instance::one_shot(starts[..agents].to_vec(), goals[..agents].to_vec());
                all.then_some(Case { map, instance })
            },
        )
}

/// The search finds the same cost as brute force, or runs into its limit.
fn agrees(case: &Case, delay: u32) -> Result<(), TestCaseError> {
    let expected = brute_force(case, delay);
    let bare = Settings {
        bypass: false,
        symmetry: false,
        wdg: false,
        ..optimal(delay)
    };
    for settings in [optimal(delay), bare] {
        let (outcome, paths) = run(case, &settings);
        match outcome.end {
            End::Solved => {
                prop_assert_eq!(case.judge(&paths, delay), Ok(()));
                prop_assert_eq!(Some(outcome.cost), expected);
                prop_assert_eq!(outcome.lower_bound, outcome.cost);
                let sum: usize = paths.iter().map(|path| path.len() - 1).sum();
                prop_assert_eq!(sum as u64, outcome.cost);
            }
            End::Infeasible => prop_assert_eq!(expected, None),
            _ => {
                prop_assert!(expected.is_none_or(|best| outcome.lower_bound <= best));
            }
        }
        let bounded = Settings {
            weight: 1.3,
            ..settings
        };
        let (outcome, paths) = run(case, &bounded);
        if outcome.end == End::Solved {
            prop_assert_eq!(case.judge(&paths, delay), Ok(()));
            let best = expected.expect("there is a plan");
            prop_assert!(outcome.lower_bound <= best);
            prop_assert!(outcome.cost as f64 <= 1.3 * best as f64 + 1e-9);
        }
        prop_assert!(outcome.end != End::Infeasible || expected.is_none());
    }
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 32,
        failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn pebbles_cost_what_brute_force_finds(case in grid(3, 4, 3), delay in 0_u32..2) {
        agrees(&case, delay)?;
    }

    #[test]
    fn turning_costs_what_brute_force_finds(case in grid(3, 3, 2), delay in 0_u32..2) {
        agrees(&case.turning(), delay)?;
    }

    #[test]
    fn without_rings_too(case in grid(3, 3, 4)) {
        agrees(&case.without_rings(), 0)?;
    }

    /// Windows, several goals, shared goals, headings: what is called a plan is one.
    #[test]
    fn plans_are_valid(
        case in grid(8, 8, 10),
        window in 0_u32..8,
        delay in 0_u32..2,
        weight in prop::sample::select(vec![1.0, 1.2, 2.0]),
        turning: bool,
        rings: bool,
        lists in prop::collection::vec(prop::collection::vec(0_usize..10, 1..4), 10),
    ) {
        let starts = case.instance.starts.clone();
        let mut case = if turning { case.turning() } else { case };
        if !rings {
            case = case.without_rings();
        }
        if window > 0 {
            // Starts are cells of the part of the map in which the agent is, if it is its own.
            let goals = lists.iter().zip(&starts).enumerate().map(|(agent, (list, start))| {
                let goal = case.instance.goals[agent][0];
                list.iter().map(|n| if n % 2 == 0 { *start } else { goal }).collect()
            });
            let goals: Vec<_> = goals.collect();
            case = case.windowed(window, &goals);
        }
        let settings = Settings { weight, delay, node_limit: Some(400), ..Settings::default() };
        let (outcome, paths) = run(&case, &settings);
        let (again, _) = run(&case, &settings);
        prop_assert_eq!(&outcome, &again);
        if outcome.end == End::Solved {
            prop_assert_eq!(case.judge(&paths, delay), Ok(()));
            prop_assert_eq!(&outcome.conflicts, &[]);
            prop_assert!(outcome.lower_bound <= outcome.cost);
        }
    }
}

/// Solved at a known cost with few nodes.
#[track_caller]
fn within(case: &Case, settings: &Settings, cost: u64, nodes: u64) {
    let (outcome, paths) = run(case, settings);
    assert_eq!(outcome.end, End::Solved, "{outcome:?}");
    assert_eq!(case.judge(&paths, settings.delay), Ok(()));
    assert_eq!(outcome.cost, cost);
    assert!(outcome.expanded <= nodes, "{} nodes", outcome.expanded);
}

#[test]
fn a_rectangle_takes_few_nodes() {
    let map = ["..........."; 11];
    // Both go down and to the right, through each other.
    let case = Case::new(&map, &[(1, 10 * 11 + 9), (11, 9 * 11 + 10)]);
    within(&case, &optimal(0), 37, 2);
    let blind = Settings {
        symmetry: false,
        wdg: false,
        bypass: false,
        node_limit: Some(101),
        ..optimal(0)
    };
    let (outcome, _) = run(&case, &blind);
    assert!(outcome.expanded > 100, "{} nodes", outcome.expanded);
}

#[test]
fn a_corridor_takes_few_nodes() {
    let chain = ["..@@@@@@@..", "...........", "..@@@@@@@.."];
    let case = Case::new(&chain, &[(11, 21), (21, 11)]);
    within(
        &case,
        &optimal(0),
        brute_force(&case, 0).expect("there is room"),
        12,
    );
    let case = case.turning();
    within(
        &case,
        &optimal(0),
        brute_force(&case, 0).expect("there is room"),
        40,
    );
}

#[test]
fn a_target_takes_few_nodes() {
    // The first is home at once, on the only short way of the second.
    let map = [".......", "@@@.@@@", "@@@.@@@", "......."];
    let case = Case::new(&map, &[(2, 3), (0, 27)]);
    let (outcome, paths) = run(&case, &optimal(0));
    assert_eq!(outcome.end, End::Solved);
    assert_eq!(case.judge(&paths, 0), Ok(()));
    assert!(outcome.expanded <= 6, "{} nodes", outcome.expanded);
    assert_eq!(Some(outcome.cost), brute_force(&case, 0));
}

#[test]
fn who_cannot_pass_never_has_a_plan() {
    for map in [&[".."][..], &["....", "@@@."][..]] {
        let last = (map[0].len() - 1) as u32;
        let case = Case::new(map, &[(0, last), (last, 0)]);
        let (outcome, _) = run(&case, &optimal(0));
        assert_ne!(outcome.end, End::Solved, "{outcome:?}");
    }
}

#[test]
fn rings_are_split_where_they_are_forbidden() {
    let ring = Case::new(&["..", ".."], &[(0, 1), (1, 3), (3, 2), (2, 0)]);
    within(&ring, &optimal(0), 4, 0);
    let (outcome, _) = run(&ring.without_rings(), &optimal(0));
    assert_ne!(outcome.end, End::Solved);
    let roomy = Case::new(&["...", "...", "..."], &[(0, 1), (1, 4), (4, 3), (3, 0)]);
    let case = roomy.without_rings();
    let (outcome, paths) = run(&case, &optimal(0));
    assert_eq!(outcome.end, End::Solved);
    assert_eq!(case.judge(&paths, 0), Ok(()));
    assert_eq!(Some(outcome.cost), brute_force(&case, 0));
}

#[test]
fn limits_are_named_and_leave_paths() {
    let map = ["......"; 6];
    let agents: Vec<(u32, u32)> = (0..18).map(|i| (i, 35 - i)).collect();
    let case = Case::new(&map, &agents);
    let problem = problem(&case);
    let nodes = Settings {
        node_limit: Some(1),
        ..Settings::default()
    };
    let outcome = solve(&problem, &nodes, &mut || false);
    assert_eq!(outcome.end, End::Nodes);
    assert_eq!(outcome.paths.len(), 18);
    assert!(
        outcome
            .paths
            .iter()
            .zip(&problem.routes)
            .all(|(path, route)| path[0] == route.start)
    );
    let memory = Settings {
        memory_limit: 0,
        ..Settings::default()
    };
    assert_eq!(solve(&problem, &memory, &mut || false).end, End::Memory);
    for questions in 1..60 {
        let mut left = questions;
        let outcome = solve(&problem, &Settings::default(), &mut || {
            left -= i32::from(left > 0);
            left == 0
        });
        assert_eq!(outcome.end, End::Stopped);
        assert!(outcome.lower_bound >= problem.lower_bound());
    }
}

/// The benchmark files, where they are at hand: costs that CBSH2-RTC finds as well.
#[test]
fn benchmark_scenarios_cost_what_is_known() {
    for (map, scenario, agents, cost) in [
        ("random-32-32-20", 1, 40, 837),
        ("random-32-32-20", 2, 40, 919),
        ("empty-32-32", 1, 80, 1657),
        ("room-64-64-16", 2, 30, 1914),
    ] {
        let Some((map_file, scenario)) = grid::movingai(map, scenario) else {
            continue;
        };
        let case = Case::read(&map_file, &scenario, agents).expect("readable files");
        let patient = Settings {
            node_limit: Some(2000),
            ..optimal(0)
        };
        within(&case, &patient, cost, 2000);
        let bounded = Settings {
            weight: 1.2,
            ..patient
        };
        let (outcome, paths) = run(&case, &bounded);
        assert_eq!(outcome.end, End::Solved, "{map}");
        assert_eq!(case.judge(&paths, 0), Ok(()));
        assert!(outcome.cost <= cost * 6 / 5);
    }
}
