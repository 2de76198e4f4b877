//! WPPL: what its plans keep to, and how far a fleet gets with it.

use fleetyard_abi::sdk::{Options, Plugin};
use fleetyard_abi::{GridEnvironment, GridPlan, Heading, Instance, Motion, Status, monotonic_ns};
use fleetyard_plugin_mapf::epibt::run::End;
use fleetyard_plugin_mapf::plugin::{Pibt, Wppl};
use fleetyard_testkit::{Case, grid};
use proptest::prelude::*;

use super::floor::{Floor, Hasty, Manner, Patient, Planner};
use super::lifelong::crowds;
use super::{alone, ask, at_once, followers, open, paths_of};

const MANNER: Manner = Manner {
    horizon: 4,
    tries: Some(2),
    window: 1,
    threads: 1,
    planner: Planner::Wppl { depth: 15 },
};

/// An agent's way without lanes, from the first goal to the last.
fn path_of(case: &Case) -> Vec<u32> {
    paths_of::<Wppl>(case, "{\"lane_charge\": 0}").swap_remove(0)
}

#[test]
fn a_robot_takes_the_way_with_the_fewest_turns() {
    let case = alone(open(3, 4), 0, &[11], 9).turning();
    assert_eq!(path_of(&case)[..7], [0, 1, 2, 3, 3, 7, 11]);
    // A pebble goes there at once, and on to the next goal.
    let case = alone(open(1, 6), 2, &[4, 3, 5], 5);
    assert_eq!(path_of(&case)[..6], [2, 3, 4, 3, 4, 5]);
    // Twice a quarter in a dead end, whichever way round.
    let mut case = alone(open(1, 4), 0, &[3], 6).turning();
    case.instance.headings = Some(vec![Heading::West]);
    assert_eq!(path_of(&case)[..6], [0, 0, 0, 1, 2, 3]);
}

#[test]
fn odd_instances_have_plans() {
    // One cell; a cell apart; nobody has a goal, or everybody has reached it.
    assert_eq!(path_of(&alone(open(1, 1), 0, &[0], 4)), [0]);
    assert_eq!(path_of(&alone(open(1, 1), 0, &[], 4).turning()), [0]);
    assert_eq!(path_of(&alone(grid::drawn(&[".@."]), 2, &[2, 2], 4)), [2]);
    assert_eq!(path_of(&alone(open(2, 2), 3, &[], 200)), [3]);
    let instance = Instance::one_shot(vec![0, 1, 2], vec![0, 1, 2]);
    let map = open(1, 3);
    let none = Case { map, instance }.windowed(5, &[vec![], vec![], vec![]]);
    assert_eq!(paths_of::<Wppl>(&none, ""), [[0], [1], [2]]);
    // A window of more steps than are planned at a time.
    let case = alone(open(1, 200), 0, &[199, 0], 400);
    let path = path_of(&case);
    assert_eq!((path[199], path[398]), (199, 0));
}

#[test]
fn agents_without_goals_make_room() {
    let map = grid::drawn(&["....", "@.@@"]);
    let instance = Instance::one_shot(vec![0, 1], vec![3, 1]);
    let case = Case { map, instance }.windowed(8, &[vec![3], vec![]]);
    let path = path_of(&case);
    assert!(path.contains(&3), "{path:?}");
}

#[test]
fn without_a_window_everybody_stays_at_the_last_goal() {
    for turning in [false, true] {
        let case = Case::square(8, 12, 2, 5);
        let case = if turning { case.turning() } else { case };
        paths_of::<Wppl>(&case, "");
    }
    // Two cannot pass.
    let case = Case::new(&["...."], &[(0, 3), (3, 0)]);
    let (said, plan, _) = ask::<Wppl>(&case, "{\"step_limit\": 50}", (60, 1));
    assert_eq!(said.unwrap_err().status, Status::GaveUp);
    assert!(plan.is_none());
}

#[test]
fn the_rest_of_the_last_plan_is_followed_from_the_first_moment_on() {
    let paths = |rest| at_once::<Wppl>(&followers(3, rest));
    assert_eq!(paths(None), [vec![0], vec![6]]);
    let rest = Some(["EEE", "E.N"]);
    assert_eq!(paths(rest), [vec![0, 1, 2, 3], vec![6, 7, 7, 1]]);
    // What collides or leaves the map is of no use.
    for rest in [["SSS", ".N."], ["WWW", "S"], ["x", "E"]] {
        let paths = paths(Some(rest));
        assert_eq!(paths[1], [6], "{paths:?}");
    }
    let paths = paths_of::<Wppl>(&followers(6, Some(["EEEEEEEE", "SEN"])), "");
    assert!(paths[0][5] == 5 && paths[1].contains(&11), "{paths:?}");
}

#[test]
fn a_cancelled_call_leaves_a_valid_plan() {
    let map = Case::square(14, 1, 3, 2).map;
    let mut floor = Floor::new(map, 60, true, 2, 4, 3);
    for step in 0..6 {
        let (plan, end) = match step % 2 {
            0 => floor.plan(MANNER, &mut Patient),
            _ => floor.plan(MANNER, &mut Hasty),
        };
        assert_eq!(floor.judge(&plan), Ok(()));
        assert_eq!(end == End::Done, step % 2 == 0);
        floor.follow(&plan);
    }
}

#[test]
fn wrong_options_and_instances_are_refused() {
    for options in [
        "{\"depth\": 0}",
        "{\"depth\": 129}",
        "{\"tries\": -1}",
        "{\"sideways\": true}",
        "[]",
    ] {
        let made = Wppl::create(Options::new(options));
        let status = made.err().map(|failure| failure.status);
        assert_eq!(status, Some(Status::InvalidInput), "{options}");
    }
    let reason = Wppl::create(Options::new("{\"depth\": 129}"))
        .err()
        .unwrap();
    assert!(reason.message.contains("hint: give 1 to 128"), "{reason:?}");
    let mut case = alone(grid::drawn(&[".@.."]), 2, &[3], 5);
    case.instance.motion = Motion::AnyAngle;
    let (said, _, _) = ask::<Wppl>(&case, "", (60, 1));
    assert_eq!(said.unwrap_err().status, Status::Unsupported);
    for (start, goals) in [(1, vec![3]), (2, vec![1]), (2, vec![0]), (2, vec![3, 0])] {
        let case = alone(grid::drawn(&[".@.."]), start, &goals, 5);
        let (said, plan, _) = ask::<Wppl>(&case, "", (60, 1));
        let failure = said.unwrap_err();
        assert_eq!(failure.status, Status::InvalidInput, "{failure:?}");
        assert!(failure.message.contains("hint:"), "{failure:?}");
        assert!(plan.is_none());
    }
}

/// A team on a map with obstacles, each of which has a goal of its own, with a window.
fn team(agents: usize, window: u32, turning: bool) -> Case {
    let case = Case::square(20, agents, 3, 2);
    let goals: Vec<Vec<u32>> = case.instance.goals.iter().map(<[u32]>::to_vec).collect();
    let case = if turning { case.turning() } else { case };
    case.windowed(window, &goals)
}

#[test]
fn the_plan_is_the_same_with_any_number_of_threads() {
    for (agents, turning) in [(60, true), (100, false), (180, true)] {
        let case = team(agents, 12, turning);
        let plan = |threads| {
            let (said, plan, notes) = ask::<Wppl>(&case, "{\"tries\": 6}", (600, threads));
            assert_eq!(said, Ok(()));
            let figures = notes.figures.into_inner().unwrap();
            assert_eq!(figures[1], ("ended_by_clock".to_owned(), 0.0));
            assert!(figures[0].1 > 20.0, "{figures:?}");
            plan.unwrap()
        };
        let one = plan(1);
        assert_eq!(plan(2), one);
        assert_eq!(plan(4), one);
    }
}

#[test]
fn without_a_number_of_tries_time_is_used_up_and_the_plan_says_so() {
    let case = team(120, 12, true);
    let begin = monotonic_ns();
    let (said, plan, notes) = ask::<Wppl>(&case, "{\"tries\": null}", (1, 2));
    assert_eq!(said, Ok(()));
    assert!(monotonic_ns() - begin > 700_000_000);
    let plan = plan.unwrap();
    assert_eq!(case.judge(&plan.paths().collect::<Vec<_>>(), 0), Ok(()));
    let figures = notes.figures.into_inner().unwrap();
    assert_eq!(figures[1], ("ended_by_clock".to_owned(), 1.0));
}

/// Steps of the shortest way between two cells.
fn steps(map: &GridEnvironment, from: u32, to: u32) -> u64 {
    let mut reached = vec![from];
    for steps in 0.. {
        if reached.contains(&to) {
            return steps;
        }
        let around = reached.iter().flat_map(|&cell| grid::near(map, cell));
        let around: Vec<u32> = around.collect();
        reached.extend(around);
        reached.sort_unstable();
        reached.dedup();
    }
    unreachable!("there is a way")
}

/// Sum of the steps up to everybody's goal: those in the window, and the shortest way from there.
fn loss(case: &Case, plan: &GridPlan, window: u32) -> u64 {
    let loss = |(agent, path): (usize, &[u32])| {
        let goal = case.instance.goals[agent][0];
        let end = path.len().min(window as usize + 1);
        match path[..end].iter().position(|cell| *cell == goal) {
            Some(steps) => steps as u64,
            None => u64::from(window) + steps(&case.map, path[end - 1], goal),
        }
    };
    plan.paths().enumerate().map(loss).sum()
}

#[test]
fn the_search_makes_plans_cheaper() {
    for agents in [40, 80, 120] {
        let case = team(agents, 20, false);
        let plan = |tries: u32| {
            let options = format!("{{\"lane_charge\": 0, \"tries\": {tries}}}");
            ask::<Wppl>(&case, &options, (60, 1)).1.unwrap()
        };
        let pibt = ask::<Pibt>(&case, "{\"lane_charge\": 0}", (60, 1))
            .1
            .unwrap();
        let [pibt, first, few, many] =
            [pibt, plan(0), plan(2), plan(20)].map(|plan| loss(&case, &plan, 20));
        println!("{agents} agents: {pibt} with PIBT, {first} at first, then {few} and {many}");
        // What counts is weighted, so that the sum of steps may be a little larger.
        assert!(few < first && many < first && many * 50 <= pibt * 51);
    }
}

#[test]
fn fleets_get_further_than_with_epibt_where_there_is_room() {
    let map = Case::square(24, 1, 3, 1).map;
    for turning in [false, true] {
        let floor = || Floor::new(map.clone(), 70, turning, 1, 0, 1);
        let epibt = Manner {
            horizon: 3 + usize::from(turning),
            tries: Some(5),
            planner: Planner::Epibt,
            ..MANNER
        };
        let wppl = Manner {
            horizon: 3 + usize::from(turning),
            ..MANNER
        };
        let [epibt, wppl] = [epibt, wppl].map(|manner| floor().drive(80, manner));
        println!("turning: {turning}, {epibt} goals with EPIBT, {wppl} with WPPL");
        assert!(wppl > epibt, "{wppl} {epibt}");
    }
}

#[test]
fn a_crowded_fleet_goes_on() {
    let map = Case::square(16, 1, 3, 4).map;
    for (turning, least) in [(false, 100), (true, 50)] {
        let manner = Manner {
            horizon: 3 + usize::from(turning),
            ..MANNER
        };
        let reached = Floor::new(map.clone(), 90, turning, 1, 0, 1).drive(60, manner);
        assert!(reached > least, "{reached}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(150))]

    #[test]
    fn plans_are_valid(
        (map, starts, lists) in crowds(), seed: u64, turning: bool, rings: bool,
        window in 1_u32..12, depth in 1_u32..20, tries in 0_u32..6, charge in 0_u32..5,
        stopped in 0_u32..4, rounds in 1_usize..3,
    ) {
        let agents = starts.len();
        let mut floor = Floor::new(map, agents, turning, 1, charge, seed >> 24);
        floor.case.instance.starts = starts;
        floor.case.instance.goals = grid::goals(&lists);
        floor.case.instance.allows_cycles = rings;
        if turning {
            let all = [Heading::North, Heading::East, Heading::South, Heading::West];
            let look = |agent| all[(grid::mix(seed ^ agent) % 4) as usize];
            floor.case.instance.headings = Some((0..agents as u64).map(look).collect());
        }
        let manner = Manner {
            horizon: 3 + usize::from(turning),
            tries: Some(tries),
            window,
            threads: 1 + (seed % 2) as usize,
            planner: Planner::Wppl { depth },
        };
        for _ in 0..rounds {
            let (plan, end) = if stopped == 0 {
                floor.plan(manner, &mut Hasty)
            } else {
                floor.plan(manner, &mut Patient)
            };
            prop_assert_eq!(floor.judge(&plan), Ok(()));
            prop_assert!(end == End::Done || stopped == 0);
            floor.follow(&plan);
        }
    }
}
