//! Both planners: every plan is checked by rules written down here once more, small cases
//! with known answers, and what is promised about seeds, limits and failures.

use fleetyard_abi::{Goals, GridEnvironment, Heading, Instance, Motion};
use fleetyard_plugin_priority::prioritized;
use fleetyard_plugin_priority::search;
use fleetyard_plugin_priority::{Control, Outcome};
use fleetyard_plugin_spacetime::order::Prefer;
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem};
use fleetyard_plugin_spacetime::random::Random;
use fleetyard_testkit::{Case, grid};
use proptest::prelude::*;

const HEADINGS: [Heading; 4] = [Heading::North, Heading::East, Heading::South, Heading::West];

#[derive(Debug, Clone, Copy, PartialEq)]
enum Planner {
    Prioritized { delay: u32 },
    Search(Prefer),
}

const PLANNERS: [Planner; 3] = [
    Planner::Prioritized { delay: 0 },
    Planner::Search(Prefer::Collisions),
    Planner::Search(Prefer::Cost),
];

fn by(prefer: Prefer) -> search::Options {
    search::Options {
        prefer,
        ..Default::default()
    }
}

fn run(problem: &Problem, planner: Planner, seed: u64, nodes: u64) -> Outcome {
    // Not a clock: every question counts.
    let mut patience = 20_000;
    let mut stop = || {
        patience -= 1;
        patience <= 0
    };
    let mut control = Control {
        stop: &mut stop,
        nodes,
        memory: 1 << 24,
    };
    match planner {
        Planner::Prioritized { delay } => {
            let options = prioritized::Options {
                delay,
                ..Default::default()
            };
            prioritized::plan(problem, options, seed, &mut control).0
        }
        Planner::Search(prefer) => search::plan(problem, by(prefer), seed, &mut control).0,
    }
}

fn problem(case: &Case, rule: GoalRule) -> Option<Problem> {
    let mut ground = Ground::new(&case.map, 1 << 20).unwrap();
    ground.problem(&case.instance, rule, &mut || false).ok()
}

fn cells(problem: &Problem, outcome: &Outcome) -> Vec<Vec<u32>> {
    let plan = problem.plan(outcome.paths());
    plan.paths().map(<[u32]>::to_vec).collect()
}

/// The reason why the paths of a solved problem are no plan: goals that are shared or transient are
/// visited, others are kept.
fn judge(case: &Case, rule: GoalRule, delay: u32, paths: &[Vec<u32>]) -> Result<(), String> {
    let Instance {
        goals,
        window_steps,
        ..
    } = &case.instance;
    case.motions(paths)?;
    for (agent, (list, path)) in goals.iter().zip(paths).enumerate() {
        let shared = goals.iter().filter(|other| other.last() == list.last());
        let stays = rule == GoalRule::Stay && shared.count() == 1;
        let visits = grid::visited(list, path) == list.len();
        if *window_steps == 0 && !(visits && (!stays || path.last() == list.last())) {
            return Err(format!("agent {agent} does not keep to its goals"));
        }
    }
    case.collisions(paths, delay)
}

prop_compose! {
    fn crowd()(
        rows in 2_u32..7,
        cols in 2_u32..7,
        seed: u64,
        share in 1_usize..8,
        goals in 1_usize..4,
        window in prop::sample::select(vec![0, 0, 1, 4, 9]),
        turning: bool,
        cycles: bool,
        apart: bool,
    ) -> Case {
        let mut random = Random::new(seed, 9);
        let passable = (0..rows * cols).map(|_| u8::from(!random.one_in(8))).collect();
        let map = GridEnvironment::four_connected(rows, cols, passable);
        let mut free = grid::free(&map);
        random.shuffle(&mut free);
        let agents = (free.len() * share / 10).max(1).min(free.len());
        let starts = free[..agents.min(free.len())].to_vec();
        random.shuffle(&mut free);
        let mut lists = Goals::default();
        for agent in 0..starts.len() {
            let mut list: Vec<u32> = (1..goals).map(|_| free[random.below(free.len())]).collect();
            // Last goals of their own, or any.
            list.push(if apart { free[agent] } else { free[random.below(free.len())] });
            lists.push(list);
        }
        let headings = starts.iter().map(|_| HEADINGS[random.below(4)]).collect();
        let instance = Instance {
            headings: Some(headings),
            goals: lists,
            motion: if turning { Motion::Rotation } else { Motion::Pebble },
            window_steps: window,
            allows_cycles: cycles,
            ..Instance::one_shot(starts.clone(), starts)
        };
        Case { map, instance }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn plans_are_plans_and_failures_are_paths(
        case in crowd(),
        rule in prop::sample::select(vec![GoalRule::Stay, GoalRule::Transient]),
        delay in 0_u32..3,
        seed in 0_u64..4,
    ) {
        let Some(problem) = problem(&case, rule) else { return Ok(()) };
        for planner in [Planner::Prioritized { delay }].into_iter().chain(PLANNERS) {
            let delay = if let Planner::Prioritized { delay } = planner { delay } else { 0 };
            let outcome = run(&problem, planner, seed, 50_000);
            let solved = matches!(outcome, Outcome::Solved(_));
            let paths = cells(&problem, &outcome);
            let verdict = if solved {
                judge(&case, rule, delay, &paths)
            } else {
                case.motions(&paths)
            };
            prop_assert_eq!(verdict, Ok(()), "{:?} {:?}", planner, &outcome);
            prop_assert_eq!(&outcome, &run(&problem, planner, seed, 50_000));
        }
    }
}

fn solve(from: &[&str], to: &[&str], planner: Planner) -> (Outcome, Result<(), String>) {
    let case = Case::lettered(from, to);
    let problem = problem(&case, GoalRule::Stay).unwrap();
    let outcome = run(&problem, planner, 7, 0);
    let verdict = judge(&case, GoalRule::Stay, 0, &cells(&problem, &outcome));
    (outcome, verdict)
}

fn cost(outcome: &Outcome) -> usize {
    outcome.paths().iter().map(|path| path.len() - 1).sum()
}

#[test]
fn whoever_has_to_wait_in_the_bay_has_no_priority() {
    // By length of way `a` comes first, runs straight at `b`, and `b` cannot give way:
    // another order is needed.
    let (from, to) = (["@@.@@@@", "a.b...."], ["@@.@@@@", "b....a."]);
    for planner in PLANNERS {
        let (outcome, verdict) = solve(&from, &to, planner);
        assert!(matches!(outcome, Outcome::Solved(_)), "{planner:?}");
        assert_eq!(verdict, Ok(()), "{planner:?}");
    }
}

#[test]
fn who_parks_in_the_corridor_comes_last() {
    // `b` is at its goal, in the way of `a`.
    let (from, to) = (["@@.@@", "a.b.."], ["@@.@@", "..b.a"]);
    for planner in PLANNERS {
        let (outcome, verdict) = solve(&from, &to, planner);
        assert!(matches!(outcome, Outcome::Solved(_)), "{planner:?}");
        assert_eq!(verdict, Ok(()));
        assert_eq!(cost(&outcome), 4 + 3, "{planner:?}");
    }
}

#[test]
fn without_room_paths_collide_and_say_so() {
    for planner in PLANNERS {
        let (outcome, verdict) = solve(&["ab"], &["ba"], planner);
        assert!(matches!(outcome, Outcome::Exhausted(_)), "{planner:?}");
        assert!(verdict.is_err_and(|why| why.contains("agents 0 and 1")));
    }
}

#[test]
fn a_ring_turns_only_where_it_may() {
    let mut case = Case::lettered(&["ab", "dc"], &["da", "cb"]);
    for planner in PLANNERS {
        case.instance.allows_cycles = true;
        let free = problem(&case, GoalRule::Stay).unwrap();
        let outcome = run(&free, planner, 0, 0);
        assert!(matches!(outcome, Outcome::Solved(_)), "{planner:?}");
        assert_eq!(cost(&outcome), 4);
        case.instance.allows_cycles = false;
        let held = problem(&case, GoalRule::Stay).unwrap();
        assert!(!matches!(run(&held, planner, 0, 0), Outcome::Solved(_)));
    }
}

#[test]
fn robots_face_to_face_turn_round() {
    // In a corridor, in a window: one has to go back, which takes two turns.
    let mut case = Case::lettered(&["....ab....", "@@@@.@@@@@"], &["b........a", "@@@@.@@@@@"]);
    case.instance = Instance {
        headings: Some(vec![Heading::East, Heading::West]),
        motion: Motion::Rotation,
        window_steps: 20,
        allows_cycles: false,
        ..case.instance
    };
    let problem = problem(&case, GoalRule::Stay).unwrap();
    for planner in PLANNERS {
        let outcome = run(&problem, planner, 0, 0);
        assert!(
            matches!(outcome, Outcome::Solved(_)),
            "{planner:?} {outcome:?}"
        );
        let verdict = judge(&case, GoalRule::Stay, 0, &cells(&problem, &outcome));
        assert_eq!(verdict, Ok(()), "{planner:?}");
    }
}

#[test]
fn one_goal_for_all_is_visited_by_all() {
    let mut case = Case::lettered(&["a...", ".@..", "b..c"], &["....", ".@..", "...."]);
    case.instance.goals = Goals::single(vec![3, 3, 3]);
    for rule in [GoalRule::Stay, GoalRule::Transient] {
        let problem = problem(&case, rule).unwrap();
        for planner in PLANNERS {
            let outcome = run(&problem, planner, 0, 0);
            assert!(matches!(outcome, Outcome::Solved(_)), "{planner:?}");
            let paths = cells(&problem, &outcome);
            assert_eq!(judge(&case, rule, 0, &paths), Ok(()));
        }
    }
}

#[test]
fn who_is_done_in_a_window_makes_way() {
    // `b` has nothing to do and stands in the corridor.
    let mut case = Case::lettered(&["a.b...", "@@@@.@"], &["..b..a", "@@@@.@"]);
    case.instance.window_steps = 8;
    let problem = problem(&case, GoalRule::Stay).unwrap();
    for planner in PLANNERS {
        let outcome = run(&problem, planner, 0, 0);
        assert!(matches!(outcome, Outcome::Solved(_)), "{planner:?}");
        assert_eq!(outcome.paths()[0].last(), Some(&5), "{planner:?}");
    }
}

#[test]
fn limits_are_kept() {
    let case = Case::lettered(&["a..c", ".@..", "b..d"], &["d..b", ".@..", "c..a"]);
    let problem = problem(&case, GoalRule::Stay).unwrap();
    for planner in PLANNERS {
        let outcome = run(&problem, planner, 0, 3);
        assert!(matches!(outcome, Outcome::Stopped(_)), "{planner:?}");
        assert_eq!(case.motions(&cells(&problem, &outcome)), Ok(()));
        let mut control = Control {
            stop: &mut || true,
            nodes: 0,
            memory: 1 << 20,
        };
        let (outcome, _) = search::plan(&problem, by(Prefer::Cost), 0, &mut control);
        assert!(matches!(outcome, Outcome::Stopped(_)));
        assert_eq!(case.motions(&cells(&problem, &outcome)), Ok(()));
    }
    // Somebody has to be asked to wait, and that takes memory.
    let case = Case::lettered(&["@@.@@@@", "a.b...."], &["@@.@@@@", "b....a."]);
    let problem = self::problem(&case, GoalRule::Stay).unwrap();
    let mut control = Control {
        stop: &mut || false,
        nodes: 0,
        memory: 1,
    };
    let (outcome, _) = search::plan(&problem, by(Prefer::Cost), 0, &mut control);
    assert!(matches!(outcome, Outcome::Memory(_)), "{outcome:?}");
}
