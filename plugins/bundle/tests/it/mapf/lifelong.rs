//! Plans for fleets that work without end: what is promised about single calls, and that
//! the fleet goes on working from call to call.

use std::sync::Arc;

use fleetyard_abi::{
    Footprint, GoalTasks, Goals, GridEnvironment, GridPlan, Guidance, Heading, Instance, Robot,
    Snapshot, Traffic,
};
use fleetyard_plugin_mapf::ProblemError;
use fleetyard_plugin_mapf::lifelong::{ByDistance, End, Lifelong, Place, Query, Ranking};
use fleetyard_plugin_mapf::streets::{Journeys, Streets, Survey, Turning};
use fleetyard_plugin_spacetime::graph::Graph;
use fleetyard_testkit::{Case, grid};
use proptest::prelude::*;

fn open(side: u32) -> GridEnvironment {
    GridEnvironment::four_connected(side, side, vec![1; (side * side) as usize])
}

fn lifelong(map: &GridEnvironment) -> Lifelong {
    let passable: Vec<bool> = map.passable.iter().map(|free| *free != 0).collect();
    let graph = Graph::new(map.rows as usize, map.cols as usize, &passable);
    Lifelong::new(Arc::new(graph), 1 << 20)
}

fn journeys<'a>(starts: &'a [u32], goals: &'a Goals) -> Journeys<'a> {
    Journeys {
        starts,
        goals,
        headings: None,
        turning: Turning::default(),
        traffic: None,
        tasks: None,
        threads: 1,
        until_ns: u64::MAX,
        guidance: None,
    }
}

/// Starts, moves, collisions, and rings if not allowed; nobody has to arrive.
fn judge(
    map: &GridEnvironment,
    starts: &[u32],
    plan: &GridPlan,
    rings: bool,
) -> Result<(), String> {
    let case = Case {
        map: map.clone(),
        instance: Instance {
            allows_cycles: rings,
            ..Instance::one_shot(starts.to_vec(), starts.to_vec())
        },
    };
    let paths: Vec<&[u32]> = plan.paths().collect();
    case.motions(&paths)?;
    case.collisions(&paths, 0)
}

fn query<'a>(starts: &'a [u32], goals: &'a Goals, window: Option<u32>) -> Query<'a> {
    Query {
        starts,
        goals,
        headings: None,
        window,
        step_limit: 10_000,
        swap: true,
        rings: false,
        memory_limit: 0,
        samples: 1,
        retries: 0,
        seed: 1,
    }
}

fn run(planner: &mut Lifelong, query: &Query<'_>) -> (GridPlan, End) {
    planner.run(query, &mut ByDistance, &mut || false).unwrap()
}

/// Result of driving a fleet call after call.
struct Drive {
    reached: u64,
    /// Steps that the slowest goal has taken, and goals of the least successful agent.
    longest: u32,
    least: u32,
    cells: Vec<u32>,
}

/// Drives a fleet, each time by a planner that knows nothing of before if it is `fresh`, and
/// along lanes if moves against them are charged.
fn drive(
    map: &GridEnvironment,
    agents: usize,
    window: u32,
    calls: u32,
    fresh: bool,
    charge: u32,
) -> Drive {
    let free = grid::free(map);
    let stream = |agent: usize, index: u32| {
        free[(grid::mix((agent as u64) << 32 | u64::from(index)) % free.len() as u64) as usize]
    };
    let mut cells = free.clone();
    cells.sort_by_key(|&cell| grid::mix(u64::from(cell)));
    cells.truncate(agents);
    let (mut next, mut since) = (vec![0_u32; agents], vec![0_u32; agents]);
    let mut planner = lifelong(map);
    let streets_of = |planner: &Lifelong| {
        Survey::new(planner.graph(), charge, 1.0, 1 << 24)
            .with_signals()
            .finish()
    };
    let mut streets = streets_of(&planner);
    let (mut reached, mut longest) = (0, 0);
    for call in 0..calls {
        if fresh {
            planner = lifelong(map);
            streets = streets_of(&planner);
        }
        let lists: Vec<Vec<u32>> = (0..agents)
            .map(|a| (0..3).map(|k| stream(a, next[a] + k)).collect())
            .collect();
        let goals = grid::goals(&lists);
        let query = Query {
            seed: grid::mix(u64::from(call)),
            ..query(&cells, &goals, Some(window))
        };
        let (plan, end) = if charge > 0 {
            let mut by_street = streets.ranking(journeys(&cells, &goals), &mut || false);
            let run = planner.run(&query, &mut by_street, &mut || false);
            run.unwrap()
        } else {
            run(&mut planner, &query)
        };
        assert_eq!(end, End::Done);
        assert_eq!(judge(map, &cells, &plan, false), Ok(()));
        assert!(plan.horizon() <= window as usize);
        for agent in 0..agents {
            let path = plan.path(agent);
            let done = grid::visited(&lists[agent], path) as u32;
            next[agent] += done;
            reached += u64::from(done);
            since[agent] = if done > 0 { 0 } else { since[agent] + window };
            longest = longest.max(since[agent]);
            cells[agent] = path[path.len() - 1];
        }
    }
    Drive {
        reached,
        longest,
        least: next.iter().copied().min().unwrap(),
        cells,
    }
}

#[test]
fn a_window_is_used_up_going_from_goal_to_goal() {
    let map = grid::drawn(&["......"]);
    let goals = grid::goals(&[vec![2, 4, 3, 3, 0]]);
    let (plan, end) = run(&mut lifelong(&map), &query(&[0], &goals, Some(7)));
    assert_eq!(end, End::Done);
    assert_eq!(plan.path(0), [0, 1, 2, 3, 4, 3, 2, 1]);
    // Without a window, up to the last goal.
    let (plan, end) = run(&mut lifelong(&map), &query(&[0], &goals, None));
    assert_eq!(end, End::Done);
    assert_eq!(plan.path(0), [0, 1, 2, 3, 4, 3, 2, 1, 0]);
}

#[test]
fn agents_without_goals_make_room() {
    let bay = grid::drawn(&["....", "@.@@"]);
    let lane = grid::drawn(&["....", "...."]);
    for (map, lists, starts) in [
        (&bay, vec![vec![3], vec![]], vec![0, 1]),
        (&lane, vec![vec![3], vec![], vec![2]], vec![0, 1, 2]),
    ] {
        let goals = grid::goals(&lists);
        for window in [Some(12), None] {
            let (plan, end) = run(&mut lifelong(map), &query(&starts, &goals, window));
            assert_eq!(end, End::Done);
            assert_eq!(judge(map, &starts, &plan, false), Ok(()));
            assert_eq!(grid::visited(&[3], plan.path(0)), 1, "{plan:?}");
        }
    }
}

#[test]
fn a_goal_can_be_shared() {
    let map = open(4);
    let goals = grid::goals(&vec![vec![5]; 6]);
    let starts = [0, 3, 12, 15, 6, 9];
    for window in [Some(40), None] {
        let (plan, end) = run(&mut lifelong(&map), &query(&starts, &goals, window));
        assert_eq!(end, End::Done);
        assert_eq!(judge(&map, &starts, &plan, false), Ok(()));
        for path in plan.paths() {
            assert_eq!(grid::visited(&[5], path), 1, "{plan:?}");
        }
    }
}

#[test]
fn without_a_window_everybody_ends_at_the_last_goal() {
    let map = grid::drawn(&[".....", ".@.@.", "....."]);
    let lists = [vec![14, 0], vec![4, 10], vec![0, 4, 14]];
    let goals = grid::goals(&lists);
    let starts = [0, 14, 7];
    let (plan, end) = run(&mut lifelong(&map), &query(&starts, &goals, None));
    assert_eq!(end, End::Done);
    assert_eq!(judge(&map, &starts, &plan, false), Ok(()));
    for (list, path) in lists.iter().zip(plan.paths()) {
        assert_eq!(grid::visited(list, path), list.len());
        assert_eq!(path.last(), list.last());
    }
}

#[test]
fn four_in_a_square_turn_only_if_they_may() {
    let map = open(2);
    let starts = [0, 1, 3, 2];
    let goals = grid::goals(&[vec![1], vec![3], vec![2], vec![0]]);
    for rings in [true, false] {
        let query = Query {
            rings,
            ..query(&starts, &goals, Some(3))
        };
        let (plan, _) = run(&mut lifelong(&map), &query);
        assert_eq!(judge(&map, &starts, &plan, rings), Ok(()));
        assert_eq!(plan.horizon() > 0, rings);
    }
}

#[test]
fn a_ranking_has_the_last_word() {
    /// Up wherever that is possible.
    struct Up;
    impl Ranking for Up {
        fn rank(&mut self, Place { step, agent, .. }: Place, cells: &mut [u32]) -> usize {
            assert!(step < 3 && agent == 0 && (3..=5).contains(&cells.len()));
            cells.sort_unstable();
            0
        }
    }
    let map = open(3);
    let goals = grid::goals(&[vec![8]]);
    let query = query(&[7], &goals, Some(3));
    let run = lifelong(&map).run(&query, &mut Up, &mut || false);
    let (plan, _) = run.unwrap();
    assert_eq!(plan.path(0), [7, 4, 1, 0]);
}

#[test]
fn what_is_wrong_is_said() {
    let map = grid::drawn(&[".@.."]);
    let mut planner = lifelong(&map);
    let mut ask = |starts: &[u32], lists: &[Vec<u32>]| {
        let goals = grid::goals(lists);
        let query = query(starts, &goals, Some(5));
        planner.run(&query, &mut ByDistance, &mut || false)
    };
    let error = ask(&[2], &[vec![3], vec![2]]).unwrap_err();
    assert_eq!(error.to_string(), "1 starts and 2 lists of goals");
    let error = ask(&[2, 2], &[vec![3], vec![2]]).unwrap_err();
    assert!(matches!(
        error,
        ProblemError::Duplicate { what: "start", .. }
    ));
    let error = ask(&[2, 3], &[vec![3], vec![2, 9]]).unwrap_err();
    let (agent, what, cell) = (1, "goal", 9);
    assert_eq!(error, ProblemError::Blocked { agent, what, cell });
    let error = ask(&[2, 3], &[vec![3], vec![0]]).unwrap_err();
    assert!(matches!(
        error,
        ProblemError::Unreachable {
            agent: 1,
            goal: 0,
            ..
        }
    ));
    // Nothing is held back: the next call works.
    assert!(ask(&[2, 3], &[vec![3], vec![2]]).is_ok());
}

#[test]
fn limits_end_a_run() {
    let map = open(8);
    let starts: Vec<u32> = (0..40).collect();
    let lists: Vec<Vec<u32>> = (0..40).map(|cell| vec![63 - cell]).collect();
    let goals = grid::goals(&lists);
    let mut planner = lifelong(&map);
    let tight = Query {
        memory_limit: 100,
        ..query(&starts, &goals, Some(5))
    };
    assert_eq!(run(&mut planner, &tight).1, End::Memory);
    let few = Query {
        step_limit: 2,
        ..query(&starts, &goals, None)
    };
    let (plan, end) = run(&mut planner, &few);
    assert_eq!((plan.horizon(), end), (2, End::Steps));
    let long = query(&starts, &goals, Some(10_000));
    let (plan, end) = planner.run(&long, &mut ByDistance, &mut || true).unwrap();
    assert_eq!(end, End::Stopped);
    assert_eq!(judge(&map, &starts, &plan, false), Ok(()));
}

/// Sum of distances by which agents come nearer to their first goals, on an open map.
#[test]
fn samples_and_retries_bring_agents_further() {
    let map = open(10);
    let (mut plain, mut searched) = (0, 0);
    for seed in 0..20 {
        let mut cells: Vec<u32> = grid::free(&map);
        cells.sort_by_key(|&cell| grid::mix(seed ^ u64::from(cell)));
        let (starts, ends) = (cells[..60].to_vec(), cells[40..].to_vec());
        let lists: Vec<Vec<u32>> = ends.iter().map(|&end| vec![end]).collect();
        let goals = grid::goals(&lists);
        let gained = |samples, retries| {
            let query = Query {
                samples,
                retries,
                seed,
                ..query(&starts, &goals, Some(6))
            };
            let (plan, _) = run(&mut lifelong(&map), &query);
            assert_eq!(judge(&map, &starts, &plan, false), Ok(()));
            let away = |cell: u32, goal: u32| {
                (cell / 10).abs_diff(goal / 10) + (cell % 10).abs_diff(goal % 10)
            };
            let agents = plan.paths().zip(&ends);
            let gain = agents.map(|(path, &end)| {
                // Whoever has been there need not stay.
                let left = if path.contains(&end) {
                    0
                } else {
                    away(path[path.len() - 1], end)
                };
                i64::from(away(path[0], end)) - i64::from(left)
            });
            gain.sum::<i64>()
        };
        plain += gained(1, 0);
        searched += gained(10, 8);
    }
    assert!(searched > plain * 21 / 20, "{searched} {plain}");
}

#[test]
fn what_went_before_makes_no_difference() {
    let map = grid::warehouse(16, 30);
    for charge in [0, 2] {
        let kept = drive(&map, 60, 5, 30, false, charge);
        let fresh = drive(&map, 60, 5, 30, true, charge);
        assert_eq!(kept.cells, fresh.cells);
        assert_eq!(kept.reached, fresh.reached);
    }
}

/// However short the windows, and however crowded the map: everybody comes to goals again
/// and again.
#[test]
fn a_crowded_fleet_goes_on() {
    for (map, agents, least) in [
        (open(12), 100, 1),
        (grid::warehouse(22, 41), 120, 1),
        (grid::warehouse(22, 41), 240, 0),
    ] {
        for (window, charge) in [(1, 0), (2, 0), (10, 0), (1, 2), (2, 3), (10, 2)] {
            let drive = drive(&map, agents, window, 600 / window, false, charge);
            let per_agent = drive.reached as f64 / agents as f64;
            println!(
                "{}x{} {agents} agents, window {window}, charge {charge}: {per_agent:.1} goals each, least {}, \
                 longest {} steps",
                map.rows, map.cols, drive.least, drive.longest
            );
            assert!(per_agent > 4.0 && drive.least >= least);
        }
    }
}

#[test]
fn a_lane_is_worth_a_way_round() {
    // Row 0 leads east and row 1 west; column 0 leads south and column 5 north.
    let map = open(6);
    let goals = grid::goals(&[vec![0], vec![11]]);
    let mut planner = lifelong(&map);
    let starts = [5, 6];
    let query = query(&starts, &goals, Some(20));
    let way = |plan: &GridPlan| {
        assert_eq!(judge(&map, &starts, plan, false), Ok(()));
        plan.path(0).iter().position(|cell| *cell == 0)
    };
    assert_eq!(way(&run(&mut planner, &query).0), Some(5));
    let mut streets = Survey::new(planner.graph(), 2, 1.0, 1 << 24).finish();
    // Without time for tables everybody goes by distance.
    for (stopped, length) in [(true, 5), (false, 7)] {
        let mut by_street = streets.ranking(journeys(&starts, &goals), &mut || stopped);
        let run = planner.run(&query, &mut by_street, &mut || false);
        assert_eq!(way(&run.unwrap().0), Some(length));
    }
    // Where there is room for the ways of the nearest only, the furthest goes by distance.
    let mut streets = Survey::new(planner.graph(), 2, 1.0, 10_000).finish();
    let lists = [vec![0], vec![7]];
    let goals = grid::goals(&lists);
    let mut by_street = streets.ranking(journeys(&starts, &goals), &mut || false);
    let query = Query {
        goals: &goals,
        ..query
    };
    let run = planner.run(&query, &mut by_street, &mut || false);
    let plan = run.unwrap().0;
    assert_eq!(way(&plan), Some(5));
    // From the west end of the second row, east against its lane.
    assert!(plan.path(1).iter().position(|cell| *cell == 7) > Some(1));
}

/// The ways to goals on a large map, of so many agents that not all fit.
#[test]
fn tables_keep_to_their_share_of_memory() {
    let map = grid::warehouse(100, 200);
    let planner = lifelong(&map);
    let free = grid::free(&map);
    let pick = |salt: u64| -> Vec<u32> {
        let mut cells = free.clone();
        cells.sort_by_key(|&cell| grid::mix(salt ^ u64::from(cell)));
        cells.truncate(300);
        cells
    };
    let (starts, ends) = (pick(1), pick(2));
    let goals = grid::goals(&ends.iter().map(|&end| vec![end]).collect::<Vec<_>>());
    for bytes in [1 << 20, 1 << 22, 1 << 24] {
        let mut streets = Survey::new(planner.graph(), 4, 1.0, bytes).finish();
        for _ in 0..3 {
            drop(streets.ranking(journeys(&starts, &goals), &mut || false));
            let taken = streets.bytes();
            println!("of {bytes} bytes {taken} are taken");
            assert!(taken <= bytes);
        }
    }
}

/// Two rooms with a door of one cell, and agents on both sides that want to get to the other.
#[test]
fn a_door_is_open_in_one_direction_at_a_time() {
    let map = grid::drawn(&[
        "....@....",
        "....@....",
        ".........",
        "....@....",
        "....@....",
    ]);
    let (west, east) = ([18_u32, 19, 20, 21], [23_u32, 24, 25]);
    let starts: Vec<u32> = west.iter().chain(&east).copied().collect();
    let goals = grid::goals(&[
        vec![8],
        vec![17],
        vec![35],
        vec![44],
        vec![0],
        vec![9],
        vec![27],
    ]);
    let planner = lifelong(&map);
    let mut streets = Survey::new(planner.graph(), 4, 1.0, 1 << 24)
        .with_signals()
        .finish();
    let snapshot = |number| Snapshot {
        number,
        waiting: vec![0; 45],
        flow: Vec::new(),
    };
    let mut ways = Vec::new();
    for period in [0, 2] {
        let traffic = Traffic {
            period_s: 20.0,
            time_constant_s: 50.0,
            since_s: 0.0,
            flow_unit_per_s: 1.0,
            last: snapshot(period),
            before: snapshot(period),
        };
        let journeys = Journeys {
            traffic: Some(&traffic),
            ..journeys(&starts, &goals)
        };
        let mut by_street = streets.ranking(journeys, &mut || false);
        let query = query(&starts, &goals, Some(6));
        let run = lifelong(&map).run(&query, &mut by_street, &mut || false);
        let (plan, _) = run.unwrap();
        assert_eq!(judge(&map, &starts, &plan, false), Ok(()));
        // Who has come through the door, and from which side.
        let through = |agent: &usize| plan.path(*agent).contains(&22);
        let from_west = (0..4).filter(through).count();
        let from_east = (4..7).filter(through).count();
        assert_eq!(from_west.min(from_east), 0, "{plan:?}");
        assert!(from_west.max(from_east) >= 2, "{plan:?}");
        ways.push(from_west > 0);
    }
    assert_ne!(ways[0], ways[1], "either side has its turn");
}

/// All of a crowd want through one door: only some have leave, those who have waited longest for their
/// goals, and nobody who stands in the way is held back.
#[test]
fn a_crowd_is_held_back_from_a_door() {
    // Two rooms of 9 by 9 cells with a door between them.
    let rows: Vec<String> = (0..9)
        .map(|row| format!(".........{}.........", if row == 4 { '.' } else { '@' }))
        .collect();
    let map = grid::drawn(&rows);
    let cell = |row: u32, col: u32| row * 19 + col;
    let west: Vec<u32> = (0..9)
        .flat_map(|row| (0..9).map(move |col| cell(row, col)))
        .collect();
    let starts: Vec<u32> = west.iter().copied().step_by(2).collect();
    let goals: Vec<Vec<u32>> = starts.iter().map(|start| vec![start + 10]).collect();
    let goals = grid::goals(&goals);
    let agents = starts.len();
    let tasks = |given_s: Vec<f64>| GoalTasks {
        time_s: 100.0,
        tasks: vec![None; agents],
        errands: vec![None; agents],
        released_s: given_s.clone(),
        given_s,
    };
    let planner = lifelong(&map);
    let mut streets = Survey::new(planner.graph(), 4, 1.0, 1 << 24)
        .with_signals()
        .finish();
    let mut through = |tasks: Option<&GoalTasks>| {
        let journeys = Journeys {
            tasks,
            ..journeys(&starts, &goals)
        };
        let mut by_street = streets.ranking(journeys, &mut || false);
        let held = by_street.held();
        let query = query(&starts, &goals, Some(30));
        let run = lifelong(&map).run(&query, &mut by_street, &mut || false);
        let (plan, _) = run.unwrap();
        assert_eq!(judge(&map, &starts, &plan, false), Ok(()));
        let passed = |agent: &usize| plan.path(*agent).contains(&cell(4, 9));
        (held, (0..agents).filter(passed).collect::<Vec<usize>>())
    };
    let oldest_first = tasks((0..agents).map(|agent| agent as f64).collect());
    let oldest_last = tasks((0..agents).map(|agent| -(agent as f64)).collect());
    assert_eq!(through(None).0, 0);
    let (held, first) = through(Some(&oldest_first));
    // Not those at walls, nor before the door.
    assert!((5..agents - 20).contains(&held), "{held} of {agents}");
    let (_, last) = through(Some(&oldest_last));
    assert!(!first.is_empty() && !last.is_empty());
    let mean = |agents: &[usize]| agents.iter().sum::<usize>() as f64 / agents.len() as f64;
    assert!(mean(&first) < mean(&last), "{first:?} {last:?}");
}

/// Another run, in which the number of a snapshot stood for other averages, makes no difference.
#[test]
fn averages_count_by_what_is_in_them() {
    let map = open(8);
    let starts = [0, 7];
    let goals = grid::goals(&[vec![63], vec![56]]);
    let planner = lifelong(&map);
    let traffic = |waiting: &[u8]| {
        let snapshot = Snapshot {
            number: 3,
            waiting: waiting.to_vec(),
            flow: Vec::new(),
        };
        Traffic {
            period_s: 20.0,
            time_constant_s: 50.0,
            since_s: 10.0,
            flow_unit_per_s: 1.0,
            last: snapshot.clone(),
            before: snapshot,
        }
    };
    let crowded: Vec<u8> = (0..64).map(|cell| grid::mix(cell) as u8).collect();
    let plan = |streets: &mut Streets, waiting: &[u8]| {
        let traffic = traffic(waiting);
        let journeys = Journeys {
            traffic: Some(&traffic),
            ..journeys(&starts, &goals)
        };
        let mut by_street = streets.ranking(journeys, &mut || false);
        let query = query(&starts, &goals, Some(20));
        lifelong(&map)
            .run(&query, &mut by_street, &mut || false)
            .unwrap()
            .0
    };
    let streets = || Survey::new(planner.graph(), 4, 1.0, 1 << 24).finish();
    let fresh = plan(&mut streets(), &crowded);
    let mut used = streets();
    assert_ne!(plan(&mut used, &[0; 64]), fresh, "crowds are gone round");
    assert_eq!(plan(&mut used, &crowded), fresh);
}

#[test]
fn guidance_leads_along_cheap_moves_and_keeps_others_allowed() {
    let map = open(5);
    let (starts, goals) = ([0], grid::goals(&[vec![4]]));
    let mut streets = Survey::new(lifelong(&map).graph(), 0, 1.0, 1 << 24).finish();
    let mut plan = |guidance: Option<&Guidance>| {
        let journeys = Journeys {
            guidance,
            ..journeys(&starts, &goals)
        };
        let mut by_street = streets.ranking(journeys, &mut || false);
        let query = query(&starts, &goals, Some(8));
        let run = lifelong(&map).run(&query, &mut by_street, &mut || false);
        run.unwrap().0.path(0).to_vec()
    };
    assert_eq!(plan(None), [0, 1, 2, 3, 4]);
    let mut guidance = Guidance::neutral(100, 25);
    assert_eq!(plan(Some(&guidance)), plan(None));
    // Moves to the east, of which those in the first row are dear.
    for cell in 0..5 {
        guidance.moves[4 * cell + 1] = 400;
    }
    assert_eq!(plan(Some(&guidance)), [0, 5, 6, 7, 8, 9, 4]);
    // Factors count by their proportions where all are high: the way is no longer than tables hold.
    guidance
        .moves
        .iter_mut()
        .for_each(|factor| *factor = 10_000);
    assert_eq!(plan(Some(&guidance)), plan(None));
    // The only way is dear, and allowed.
    let corridor = GridEnvironment::four_connected(1, 5, vec![1; 5]);
    let mut streets = Survey::new(lifelong(&corridor).graph(), 0, 1.0, 1 << 24).finish();
    let mut guidance = Guidance::neutral(20, 5);
    guidance
        .moves
        .iter_mut()
        .skip(1)
        .step_by(4)
        .for_each(|factor| *factor = 10_000);
    let journeys = Journeys {
        guidance: Some(&guidance),
        ..journeys(&starts, &goals)
    };
    let mut by_street = streets.ranking(journeys, &mut || false);
    let query = query(&starts, &goals, Some(4));
    let run = lifelong(&corridor).run(&query, &mut by_street, &mut || false);
    assert_eq!(run.unwrap().0.path(0), [0, 1, 2, 3, 4]);
}

#[test]
fn a_turn_costs_what_it_costs_the_robot() {
    let robot = |dynamics: &str, state_limits: &[f64], control_limits: &[f64]| {
        let limits = |most: &[f64]| most.iter().map(|most| [Some(-most), Some(*most)]).collect();
        Instance {
            headings: Some(vec![Heading::North]),
            robots: vec![Robot {
                dynamics: format!("fleetyard.{dynamics}/1"),
                state_limits: limits(state_limits),
                control_limits: limits(control_limits),
                name: String::new(),
                footprint: Footprint {
                    radius_m: 0.3,
                    corners_m: Vec::new(),
                },
                has_heading: true,
                polar_state: false,
                polar_control: false,
                parameters: Vec::new(),
            }],
            ..Instance::one_shot(vec![0], vec![1])
        }
    };
    let quarter = std::f64::consts::FRAC_PI_2;
    let slow = robot(
        "unicycle-2",
        &[9.0, 9.0, 9.0, 2.0, quarter / 2.0],
        &[2.0, f64::MAX],
    );
    // A second to brake and to set out again, and two to turn.
    assert!((Turning::of(&slow).quarter_s - 3.0).abs() < 1e-9);
    // A turn in which the robot never comes to its highest rate: twice half of it.
    let eager = robot(
        "unicycle-2",
        &[9.0, 9.0, 9.0, 2.0, 1e9],
        &[2.0, 4.0 * quarter],
    );
    assert!((Turning::of(&eager).quarter_s - 2.0).abs() < 1e-9);
    let ideal = robot("unicycle", &[], &[2.0, quarter]);
    assert!((Turning::of(&ideal).quarter_s - 1.0).abs() < 1e-9);
    // Neither who drives any way nor whose heading nobody knows.
    let holonomic = robot("holonomic", &[], &[2.0, 2.0, quarter]);
    assert_eq!(Turning::of(&holonomic), Turning::default());
    let unknown = Instance {
        headings: None,
        ..slow
    };
    assert_eq!(Turning::of(&unknown), Turning::default());
    // Limits that are none make no turn endless.
    let stuck = robot("unicycle-2", &[9.0, 9.0, 9.0, 0.0, 0.0], &[0.0, 0.0]);
    let graph = Arc::clone(lifelong(&open(3)).graph());
    let mut streets = Survey::new(&graph, 4, 1.0, 1 << 24).finish();
    let goals = grid::goals(&[vec![8]]);
    let journeys = Journeys {
        turning: Turning::of(&stuck),
        ..journeys(&[0], &goals)
    };
    let mut by_street = streets.ranking(journeys, &mut || false);
    let run = lifelong(&open(3)).run(&query(&[0], &goals, Some(9)), &mut by_street, &mut || false);
    assert_eq!(grid::visited(&[8], run.unwrap().0.path(0)), 1);
}

/// A map that hangs together, starts, and goals.
pub(super) fn crowds() -> impl Strategy<Value = (GridEnvironment, Vec<u32>, Vec<Vec<u32>>)> {
    (2_u32..7, 2_u32..7, any::<u64>(), 1_usize..30, 0_u64..4).prop_map(
        |(rows, cols, seed, agents, blocked)| {
            let size = u64::from(rows * cols);
            let mut passable: Vec<u8> = (0..size)
                .map(|cell| u8::from(grid::mix(seed ^ cell) % 8 >= blocked))
                .collect();
            passable[0] = 1;
            let mut map = GridEnvironment::four_connected(rows, cols, passable);
            // Only what hangs together with the first cell.
            let reached = grid::region(&map, 0);
            map.passable.fill(0);
            for cell in reached {
                map.passable[cell as usize] = 1;
            }
            let mut starts = grid::free(&map);
            let free = starts.clone();
            starts.sort_by_key(|&cell| grid::mix(seed ^ 0x4d ^ u64::from(cell)));
            starts.truncate(agents);
            let lists = (0..starts.len() as u64)
                .map(|agent| {
                    let count = grid::mix(seed ^ agent ^ 5) % 4;
                    let goal =
                        |k| free[(grid::mix(seed ^ agent << 8 ^ k) % free.len() as u64) as usize];
                    (0..count).map(goal).collect()
                })
                .collect();
            (map, starts, lists)
        },
    )
}

proptest! {
    #[test]
    fn plans_are_valid(
        (map, starts, lists) in crowds(), seed: u64, swap: bool, rings: bool,
        window in 1_u32..12, samples in 1_u32..4, retries in 0_u32..3
    ) {
        let goals = grid::goals(&lists);
        let window = Some(window).filter(|window| *window < 10);
        let query = Query {
            seed, swap, rings, samples, retries, step_limit: 200, ..query(&starts, &goals, window)
        };
        let (plan, end) = run(&mut lifelong(&map), &query);
        prop_assert_eq!(judge(&map, &starts, &plan, rings), Ok(()));
        if end == End::Done && window.is_none() {
            for (list, path) in lists.iter().zip(plan.paths()) {
                prop_assert_eq!(grid::visited(list, path), list.len());
            }
        }
    }
}
