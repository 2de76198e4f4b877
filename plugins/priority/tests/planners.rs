//! Both planners: every plan is checked by rules written down here once more, small cases
//! with known answers, and what is promised about seeds, limits and failures.

use std::collections::BTreeMap;

use fleetyard_abi::{Goals, GridEnvironment, Heading, Instance, Motion};
use fleetyard_plugin_priority::prioritized;
use fleetyard_plugin_priority::search::{self, Prefer};
use fleetyard_plugin_priority::{Control, Outcome};
use fleetyard_plugin_spacetime::plan::Paths;
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem};
use fleetyard_plugin_spacetime::random::Random;
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

/// A map and an instance from a drawing: `@` is blocked, letters in the first drawing are
/// starts, in the second goals.
fn drawn(from: &[&str], to: &[&str]) -> (GridEnvironment, Instance) {
    let passable: Vec<bool> = from.concat().bytes().map(|b| b != b'@').collect();
    let places = |rows: &[&str]| -> Vec<u32> {
        let text = rows.concat();
        let mut found: Vec<(u8, u32)> = text
            .bytes()
            .zip(0..)
            .filter(|(b, _)| b.is_ascii_lowercase())
            .collect();
        found.sort_unstable();
        found.into_iter().map(|(_, cell)| cell).collect()
    };
    let map = environment(from.len() as u32, from[0].len() as u32, &passable);
    (map, Instance::one_shot(places(from), places(to)))
}

fn environment(rows: u32, cols: u32, passable: &[bool]) -> GridEnvironment {
    let passable: Vec<u8> = passable.iter().map(|free| u8::from(*free)).collect();
    GridEnvironment::four_connected(rows, cols, passable)
}

fn problem(map: &GridEnvironment, instance: &Instance, rule: GoalRule) -> Option<Problem> {
    let mut ground = Ground::new(map, 1 << 20).unwrap();
    ground.problem(instance, rule, &mut || false).ok()
}

/// The first thing that is wrong with paths, if anything is; collisions only on request.
fn fault(
    map: &GridEnvironment,
    instance: &Instance,
    rule: GoalRule,
    delay: u32,
    paths: &Paths,
    collisions: bool,
) -> Option<String> {
    let grid = map;
    let cols = grid.cols as i64;
    let problem = problem(map, instance, rule).unwrap();
    let cells: Vec<Vec<i64>> = paths
        .iter()
        .map(|path| {
            path.iter()
                .map(|&v| i64::from(problem.graph.cell(v)))
                .collect()
        })
        .collect();
    let at = |agent: usize, t: usize| *cells[agent].get(t).or(cells[agent].last()).unwrap();
    for (agent, path) in cells.iter().enumerate() {
        if path.first() != Some(&i64::from(instance.starts[agent])) {
            return Some(format!("agent {agent} begins elsewhere"));
        }
        let mut heading = instance.headings.as_ref().map_or(0, |all| {
            HEADINGS.iter().position(|h| *h == all[agent]).unwrap()
        });
        let mut stood = 0;
        for (t, step) in path.windows(2).enumerate() {
            let moves = [-cols, 1, cols, -1];
            let by = step[1] - step[0];
            if by == 0 {
                stood += 1;
                continue;
            }
            let Some(d) = moves.iter().position(|m| *m == by) else {
                return Some(format!("agent {agent} jumps at {t}"));
            };
            if by.abs() == 1 && step[0] / cols != step[1] / cols {
                return Some(format!("agent {agent} leaves the row at {t}"));
            }
            let apart = (d + 4 - heading) % 4;
            if instance.motion == Motion::Rotation && stood < apart.min(4 - apart) {
                return Some(format!("agent {agent} turns in no time at {t}"));
            }
            (heading, stood) = (d, 0);
        }
        if instance.window_steps == 0 && collisions {
            let mut left = path.iter();
            let mut visited = true;
            let mut before = None;
            for &goal in instance.goals.get(agent) {
                // The next goal may be where the agent is.
                if before != Some(goal) {
                    visited &= left.any(|cell| *cell == i64::from(goal));
                }
                before = Some(goal);
            }
            if !visited {
                return Some(format!("agent {agent} does not visit all goals"));
            }
            let last = instance
                .goals
                .get(agent)
                .last()
                .map(|&goal| i64::from(goal));
            let shared = instance
                .goals
                .iter()
                .filter(|goals| goals.last().map(|&g| i64::from(g)) == last)
                .count()
                > 1;
            if rule == GoalRule::Stay && !shared && path.last().copied() != last {
                return Some(format!("agent {agent} does not stay at its goal"));
            }
        }
    }
    if !collisions {
        return None;
    }
    let horizon = match instance.window_steps {
        0 => cells.iter().map(Vec::len).max().unwrap() + delay as usize + 1,
        window => window as usize,
    };
    let agents = cells.len();
    for t in 0..=horizon {
        for a in 0..agents {
            for b in (0..agents).filter(|&b| b != a) {
                for later in t..=(t + delay as usize).min(horizon) {
                    if at(a, t) == at(b, later) {
                        return Some(format!("{a} and {b} meet at {t}"));
                    }
                }
                if t > 0 && at(a, t) == at(b, t - 1) && at(b, t) == at(a, t - 1) {
                    return Some(format!("{a} and {b} change places at {t}"));
                }
            }
        }
        if t > 0 && !instance.allows_cycles {
            let next: BTreeMap<i64, i64> = (0..agents)
                .filter(|&a| at(a, t - 1) != at(a, t))
                .map(|a| (at(a, t - 1), at(a, t)))
                .collect();
            for &begin in next.keys() {
                let mut place = begin;
                for _ in 0..agents {
                    match next.get(&place) {
                        Some(&ahead) => place = ahead,
                        None => break,
                    }
                    if place == begin {
                        return Some(format!("a ring through {begin} at {t}"));
                    }
                }
            }
        }
    }
    None
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
    ) -> (GridEnvironment, Instance) {
        let mut random = Random::new(seed, 9);
        let passable: Vec<bool> = (0..rows * cols).map(|_| !random.one_in(8)).collect();
        let mut free: Vec<u32> = (0..rows * cols).filter(|&cell| passable[cell as usize]).collect();
        random.shuffle(&mut free);
        let agents = (free.len() * share / 10).max(1).min(free.len());
        let starts = free[..agents.min(free.len())].to_vec();
        random.shuffle(&mut free);
        let mut cells = Vec::new();
        for agent in 0..starts.len() {
            cells.extend((1..goals).map(|_| free[random.below(free.len())]));
            // Last goals of their own, or any.
            cells.push(if apart { free[agent] } else { free[random.below(free.len())] });
        }
        let offsets = (0..=starts.len() as u64).map(|agent| agent * goals as u64).collect();
        let headings = starts.iter().map(|_| HEADINGS[random.below(4)]).collect();
        let instance = Instance {
            headings: Some(headings),
            goals: Goals::from_flat(offsets, cells).unwrap(),
            motion: if turning { Motion::Rotation } else { Motion::Pebble },
            window_steps: window,
            allows_cycles: cycles,
            ..Instance::one_shot(starts.clone(), starts)
        };
        (environment(rows, cols, &passable), instance)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn plans_are_plans_and_failures_are_paths(
        (map, instance) in crowd(),
        rule in prop::sample::select(vec![GoalRule::Stay, GoalRule::Transient]),
        delay in 0_u32..3,
        seed in 0_u64..4,
    ) {
        let Some(problem) = problem(&map, &instance, rule) else { return Ok(()) };
        for planner in [Planner::Prioritized { delay }].into_iter().chain(PLANNERS) {
            let delay = if let Planner::Prioritized { delay } = planner { delay } else { 0 };
            let outcome = run(&problem, planner, seed, 50_000);
            let solved = matches!(outcome, Outcome::Solved(_));
            prop_assert_eq!(outcome.paths().len(), instance.agents());
            let fault = fault(&map, &instance, rule, delay, outcome.paths(), solved);
            prop_assert_eq!(fault, None, "{:?} {:?}", planner, &outcome);
            prop_assert_eq!(&outcome, &run(&problem, planner, seed, 50_000));
        }
    }
}

fn solve(from: &[&str], to: &[&str], planner: Planner) -> (Outcome, Option<String>) {
    let (map, instance) = drawn(from, to);
    let problem = problem(&map, &instance, GoalRule::Stay).unwrap();
    let outcome = run(&problem, planner, 7, 0);
    let wrong = fault(&map, &instance, GoalRule::Stay, 0, outcome.paths(), true);
    (outcome, wrong)
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
        let (outcome, wrong) = solve(&from, &to, planner);
        assert!(matches!(outcome, Outcome::Solved(_)), "{planner:?}");
        assert_eq!(wrong, None, "{planner:?}");
    }
}

#[test]
fn who_parks_in_the_corridor_comes_last() {
    // `b` is at its goal, in the way of `a`.
    let (from, to) = (["@@.@@", "a.b.."], ["@@.@@", "..b.a"]);
    for planner in PLANNERS {
        let (outcome, wrong) = solve(&from, &to, planner);
        assert!(matches!(outcome, Outcome::Solved(_)), "{planner:?}");
        assert_eq!(wrong, None);
        assert_eq!(cost(&outcome), 4 + 3, "{planner:?}");
    }
}

#[test]
fn without_room_paths_collide_and_say_so() {
    for planner in PLANNERS {
        let (outcome, wrong) = solve(&["ab"], &["ba"], planner);
        assert!(matches!(outcome, Outcome::Exhausted(_)), "{planner:?}");
        assert!(wrong.is_some_and(|wrong| wrong.starts_with("0 and 1")));
    }
}

#[test]
fn a_ring_turns_only_where_it_may() {
    let (map, mut instance) = drawn(&["ab", "dc"], &["da", "cb"]);
    for planner in PLANNERS {
        instance.allows_cycles = true;
        let free = problem(&map, &instance, GoalRule::Stay).unwrap();
        let outcome = run(&free, planner, 0, 0);
        assert!(matches!(outcome, Outcome::Solved(_)), "{planner:?}");
        assert_eq!(cost(&outcome), 4);
        instance.allows_cycles = false;
        let held = problem(&map, &instance, GoalRule::Stay).unwrap();
        assert!(!matches!(run(&held, planner, 0, 0), Outcome::Solved(_)));
    }
}

#[test]
fn robots_face_to_face_turn_round() {
    // In a corridor, in a window: one has to go back, which takes two turns.
    let (map, instance) = drawn(&["....ab....", "@@@@.@@@@@"], &["b........a", "@@@@.@@@@@"]);
    let instance = Instance {
        headings: Some(vec![Heading::East, Heading::West]),
        motion: Motion::Rotation,
        window_steps: 20,
        allows_cycles: false,
        ..instance
    };
    let problem = problem(&map, &instance, GoalRule::Stay).unwrap();
    for planner in PLANNERS {
        let outcome = run(&problem, planner, 0, 0);
        assert!(
            matches!(outcome, Outcome::Solved(_)),
            "{planner:?} {outcome:?}"
        );
        let wrong = fault(&map, &instance, GoalRule::Stay, 0, outcome.paths(), true);
        assert_eq!(wrong, None, "{planner:?}");
    }
}

#[test]
fn one_goal_for_all_is_visited_by_all() {
    let (map, mut instance) = drawn(&["a...", ".@..", "b..c"], &["....", ".@..", "...."]);
    instance.goals = Goals::single(vec![3, 3, 3]);
    for rule in [GoalRule::Stay, GoalRule::Transient] {
        let problem = problem(&map, &instance, rule).unwrap();
        for planner in PLANNERS {
            let outcome = run(&problem, planner, 0, 0);
            assert!(matches!(outcome, Outcome::Solved(_)), "{planner:?}");
            assert_eq!(fault(&map, &instance, rule, 0, outcome.paths(), true), None);
        }
    }
}

#[test]
fn who_is_done_in_a_window_makes_way() {
    // `b` has nothing to do and stands in the corridor.
    let (map, instance) = drawn(&["a.b...", "@@@@.@"], &["..b..a", "@@@@.@"]);
    let instance = Instance {
        window_steps: 8,
        ..instance
    };
    let problem = problem(&map, &instance, GoalRule::Stay).unwrap();
    for planner in PLANNERS {
        let outcome = run(&problem, planner, 0, 0);
        assert!(matches!(outcome, Outcome::Solved(_)), "{planner:?}");
        assert_eq!(outcome.paths()[0].last(), Some(&5), "{planner:?}");
    }
}

#[test]
fn limits_are_kept() {
    let (map, instance) = drawn(&["a..c", ".@..", "b..d"], &["d..b", ".@..", "c..a"]);
    let problem = problem(&map, &instance, GoalRule::Stay).unwrap();
    for planner in PLANNERS {
        let outcome = run(&problem, planner, 0, 3);
        assert!(matches!(outcome, Outcome::Stopped(_)), "{planner:?}");
        assert_eq!(
            fault(&map, &instance, GoalRule::Stay, 0, outcome.paths(), false),
            None
        );
        let mut control = Control {
            stop: &mut || true,
            nodes: 0,
            memory: 1 << 20,
        };
        let (outcome, _) = search::plan(&problem, by(Prefer::Cost), 0, &mut control);
        assert!(matches!(outcome, Outcome::Stopped(_)));
        assert_eq!(
            fault(&map, &instance, GoalRule::Stay, 0, outcome.paths(), false),
            None
        );
    }
    // Somebody has to be asked to wait, and that takes memory.
    let (map, instance) = drawn(&["@@.@@@@", "a.b...."], &["@@.@@@@", "b....a."]);
    let problem = self::problem(&map, &instance, GoalRule::Stay).unwrap();
    let mut control = Control {
        stop: &mut || false,
        nodes: 0,
        memory: 1,
    };
    let (outcome, _) = search::plan(&problem, by(Prefer::Cost), 0, &mut control);
    assert!(matches!(outcome, Outcome::Memory(_)), "{outcome:?}");
}
