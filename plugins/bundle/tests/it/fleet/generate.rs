//! Instance generators: who is sent where.

use std::collections::BTreeSet;

use super::common::{BUDGET, drawn, map};
use fleetyard_abi::sdk::{Failure, InstanceGenerator, Options};
use fleetyard_abi::{
    Assignment, FleetState, Goals, Heading, Instance, Motion, Objective, Request,
    SharedEnvironment, Status, Task,
};
use fleetyard_plugin_fleet::generate::{DistinctOneGoal, OneGoal, WindowedMultiGoals};
use fleetyard_testkit::{Notes, grid};
use proptest::prelude::*;

fn lists(lists: &[&[u32]]) -> Goals {
    grid::goals(lists)
}

fn state(cells: &[u32], goals: &[&[u32]]) -> FleetState {
    FleetState {
        time_s: 3.0,
        next: Instance {
            starts: cells.to_vec(),
            headings: Some(vec![Heading::North; cells.len()]),
            goals: lists(goals),
            window_steps: 6,
            motion: Motion::Rotation,
            objective: Objective::Makespan,
            radius_m: 0.4,
            ..Instance::default()
        },
        tasks: Vec::new(),
        parts: Vec::new(),
    }
}

fn generate<P: InstanceGenerator>(
    environment: &SharedEnvironment,
    state: &FleetState,
) -> Result<Request, Failure> {
    let host = Notes::default();
    let mut generator = P::create(Options::new("{}"))?;
    let mut map = generator.prepare(environment, &BUDGET, &host)?;
    generator.generate(&mut map, state, &BUDGET, &host)?;
    let request = host.request.into_inner().unwrap().unwrap();
    assert_eq!(request.window_steps, state.next.window_steps);
    assert_eq!(request.goals.len(), state.next.agents());
    Ok(request)
}

/// The goals of a generator that gives one to each.
fn single<P: InstanceGenerator>(environment: &SharedEnvironment, state: &FleetState) -> Vec<u32> {
    let instance = generate::<P>(environment, state).unwrap();
    assert!(instance.goals.iter().all(|goals| goals.len() == 1));
    instance.goals.items().to_vec()
}

#[test]
fn one_goal_is_the_current_one() {
    let row = drawn(&["......"]);
    let state = state(&[0, 1, 5], &[&[3, 4], &[3], &[]]);
    assert_eq!(single::<OneGoal>(&row, &state), [3, 3, 5]);
}

#[test]
fn windows_are_filled() {
    let row = drawn(&["........"]);
    let goals: &[&[u32]] = &[&[1, 3, 7, 0, 5], &[7, 0, 7], &[4], &[]];
    let mut state = state(&[0, 1, 4, 5], goals);
    let filled = |state: &FleetState| generate::<WindowedMultiGoals>(&row, state).unwrap().goals;
    // Seven steps through three goals; six through the first of the second agent, and two at
    // least.
    assert_eq!(filled(&state), lists(&[&[1, 3, 7], &[7, 0], &[4], &[5]]));
    state.next.window_steps = 0;
    assert_eq!(filled(&state), lists(&[&[1, 3], &[7, 0], &[4], &[5]]));
    state.next.window_steps = 100;
    assert_eq!(
        filled(&state),
        lists(&[&[1, 3, 7, 0, 5], &[7, 0, 7], &[4], &[5]])
    );
}

#[test]
fn who_is_far_from_a_crowded_goal_comes_no_nearer() {
    let row = drawn(&[".".repeat(80).as_str()]);
    let sent = |at: &[u32]| {
        let goals: Vec<&[u32]> = vec![&[0, 79]; at.len()];
        let instance = generate::<WindowedMultiGoals>(&row, &state(at, &goals)).unwrap();
        let go = |(goals, here): (&[u32], &u32)| match goals {
            [0, 79] => true,
            goals => {
                assert_eq!(goals, [*here]);
                false
            }
        };
        instance.goals.iter().zip(at).map(go).collect::<Vec<bool>>()
    };
    // Two at a time go there, whoever is near; those behind them stay away by twelve steps
    // for each that is nearer.
    assert_eq!(sent(&[1, 2]), [true, true]);
    assert_eq!(sent(&[1, 2, 23]), [true, true, false]);
    assert_eq!(sent(&[1, 2, 24, 35]), [true, true, true, false]);
    assert_eq!(sent(&[40, 1, 2, 23]), [true, true, true, false]);
    assert_eq!(sent(&[5, 4, 3]), [false, true, true]);
}

#[test]
fn of_several_the_nearest_keeps_its_goal() {
    let open = drawn(&[".....", ".....", "....."]);
    let mut fleet = state(&[0, 6, 14], &[&[7], &[7], &[7]]);
    // Cells 2, 8, 12 and 6 are beside the goal.
    assert_eq!(single::<DistinctOneGoal>(&open, &fleet), [2, 7, 8]);
    // The way counts, not the beeline: the second has to go round the wall.
    let wall = drawn(&["..@.", "..@.", "...."]);
    let by_way = state(&[0, 3], &[&[5], &[5]]);
    assert_eq!(single::<DistinctOneGoal>(&wall, &by_way)[0], 5);
    let near_by_beeline = state(&[8, 3], &[&[1], &[1]]);
    assert_eq!(single::<DistinctOneGoal>(&wall, &near_by_beeline)[0], 1);
    // A cell that somebody else heads for is no substitute, and who has nothing to do is in
    // nobody's way.
    fleet.next.goals = lists(&[&[7], &[7], &[2]]);
    assert_eq!(single::<DistinctOneGoal>(&open, &fleet), [8, 7, 2]);
    let idle = state(&[0, 6, 7], &[&[7], &[7], &[]]);
    assert_eq!(single::<DistinctOneGoal>(&open, &idle), [2, 7, 8]);
}

#[test]
fn tasks_go_to_the_nearest_idle_agents() {
    let row = drawn(&["........", "@@@@@@@@", "...@...."]);
    let mut fleet = state(&[0, 4, 7, 16], &[&[], &[3], &[], &[]]);
    let task = |id, cells: &[u32]| Task {
        id,
        places: cells.to_vec(),
        released_s: 0.0,
    };
    fleet.tasks = vec![
        task(9, &[5, 1]),
        task(8, &[]),
        task(7, &[20, 22]),
        task(6, &[16, 20]),
        task(5, &[6]),
        task(4, &[3]),
    ];
    let given = [
        Assignment { agent: 0, task: 5 },
        Assignment { agent: 2, task: 9 },
    ];
    let instance = generate::<WindowedMultiGoals>(&row, &fleet).unwrap();
    assert_eq!(instance.assignments, given);
    assert_eq!(instance.goals, lists(&[&[6], &[3], &[5, 1], &[16]]));
    let instance = generate::<DistinctOneGoal>(&row, &fleet).unwrap();
    assert_eq!(instance.assignments, given);
    assert_eq!(instance.goals.items(), [6, 3, 5, 16]);
    let instance = generate::<OneGoal>(&row, &fleet).unwrap();
    assert_eq!(instance.assignments, given);
}

#[test]
fn states_that_are_none_are_refused() {
    let place = drawn(&["..@."]);
    let refused = |state: &FleetState, reason: &str| {
        for failure in [
            generate::<OneGoal>(&place, state).unwrap_err(),
            generate::<DistinctOneGoal>(&place, state).unwrap_err(),
            generate::<WindowedMultiGoals>(&place, state).unwrap_err(),
        ] {
            assert_eq!(failure.status, Status::InvalidInput);
            assert!(failure.message.contains(reason), "{failure}");
        }
    };
    refused(
        &state(&[0], &[&[3]]),
        "agent 0 cannot get from cell 0 to its goal, cell 3",
    );
    refused(&state(&[0], &[&[2]]), "cell 2, is not a free cell");
    refused(&state(&[0], &[&[9]]), "cell 9, is not a free cell");
    refused(
        &state(&[2], &[&[0]]),
        "agent 0: start cell 2 is not a passable cell",
    );
    refused(
        &state(&[1, 1], &[&[0], &[0]]),
        "agents 0 and 1 have the same start cell 1",
    );
    refused(&state(&[0, 1], &[&[0]]), "2 agents, but 1 lists");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(60))]

    /// Distinct goals are: one each, all different, within reach; the goals of those who are
    /// alone with theirs stay, and of several with one goal a nearest one keeps it.
    #[test]
    fn distinct_goals_are_distinct(
        walls in prop::collection::vec(prop::bool::weighted(0.2), 48),
        order in Just((0..48_u32).collect::<Vec<_>>()).prop_shuffle(),
        crowd in 1..48_usize,
        goals in prop::collection::vec((0..48_usize, 0..6_u8), 48),
    ) {
        let environment = map(6, 8, |cell| !walls[cell as usize]);
        let free: Vec<u32> = order.iter().copied().filter(|cell| !walls[*cell as usize]).collect();
        prop_assume!(!free.is_empty());
        let cells = &free[..crowd.min(free.len())];
        // Steps between cells, level by level.
        let steps = |from: u32| {
            let mut steps = vec![None; 48];
            steps[from as usize] = Some(0_u32);
            for level in 0..48 {
                let next: Vec<u32> = free
                    .iter()
                    .copied()
                    .filter(|near| {
                        free.iter().any(|cell| {
                            let rows = (cell / 8).abs_diff(near / 8);
                            steps[*cell as usize] == Some(level)
                                && rows + (cell % 8).abs_diff(near % 8) == 1
                        })
                    })
                    .collect();
                for near in next {
                    steps[near as usize].get_or_insert(level + 1);
                }
            }
            steps
        };
        let everywhere: Vec<Vec<Option<u32>>> = (0..48).map(steps).collect();
        let steps = |from: u32| &everywhere[from as usize];
        let wanted: Vec<Vec<u32>> = cells.iter().zip(&goals).map(|(cell, (pick, kind))| {
            let reach: Vec<u32> = free.iter().copied().filter(|to| steps(*cell)[*to as usize].is_some()).collect();
            // Few cells are wanted by many.
            let few = (reach.len() / 4).max(1);
            if *kind == 0 { Vec::new() } else { vec![reach[pick % few]] }
        }).collect();
        let wanted: Vec<&[u32]> = wanted.iter().map(Vec::as_slice).collect();
        let given = single::<DistinctOneGoal>(&environment, &state(cells, &wanted));
        let different: BTreeSet<u32> = given.iter().copied().collect();
        prop_assert_eq!(different.len(), given.len());
        for (agent, goal) in given.iter().enumerate() {
            prop_assert!(steps(cells[agent])[*goal as usize].is_some());
            let Some(want) = wanted[agent].first() else { continue };
            let rivals: Vec<usize> = (0..cells.len()).filter(|other| wanted[*other].first() == Some(want)).collect();
            let nearest = rivals.iter().map(|other| steps(*want)[cells[*other] as usize]).min().unwrap();
            let keeps: Vec<usize> = rivals.into_iter().filter(|other| given[*other] == *want).collect();
            prop_assert_eq!(keeps.len(), 1);
            prop_assert_eq!(steps(*want)[cells[keeps[0]] as usize], nearest);
        }
    }
}
