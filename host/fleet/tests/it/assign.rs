//! Starts and goals: who may be where, what comes after what, and what is refused.

use std::collections::{BTreeMap, BTreeSet};

use fleetyard_abi::{GoalTasks, Task};
use fleetyard_core::formats::{TaskList, read_lorr_tasks};
use fleetyard_core::{Connectivity, Grid, OFF_MAP, Role};
use fleetyard_fleet::Assign;
use fleetyard_fleet::assign::{Assigner, Giving, Source};

fn grid(rows: &[&str]) -> Grid {
    let terrain = rows.concat().into_bytes();
    Grid::new("drawn", rows.len() as u32, rows[0].len() as u32, terrain).unwrap()
}

fn tasks(grid: &Grid, text: &str, reveal: f64) -> Source {
    let list = read_lorr_tasks("t.tasks", text.as_bytes(), grid).unwrap();
    Source::Tasks { list, reveal }
}

fn refused(assigner: Result<Assigner, fleetyard_core::InputError>) -> String {
    let error = assigner.map(|_| ()).unwrap_err();
    match &error.hint {
        Some(hint) => format!("{error} (hint: {hint})"),
        None => error.to_string(),
    }
}

/// Two rooms and a cell by itself.
const ROOMS: &[&str] = &["...@..", "...@@@", "...@.@"];

#[test]
fn starts_are_distinct_and_have_somewhere_to_go() {
    let grid = grid(ROOMS);
    let assigner = Assigner::new(&grid, Source::Random, 11, 3).unwrap();
    let starts = assigner.starts();
    let distinct: BTreeSet<u32> = starts.iter().copied().collect();
    let alone = grid.cell(2, 4).unwrap();
    assert_eq!(distinct.len(), 11);
    assert!(!distinct.contains(&alone));
    assert!(starts.iter().all(|cell| grid.is_passable(*cell)));
    // The first of more agents are those of fewer; other seeds are others.
    let few = Assigner::new(&grid, Source::Random, 4, 3).unwrap();
    assert_eq!(few.starts(), starts[..4]);
    let other = Assigner::new(&grid, Source::Random, 11, 4).unwrap();
    assert_ne!(other.starts(), starts);
    assert_eq!(
        refused(Assigner::new(&grid, Source::Random, 12, 3)),
        "agents: 12 agents on drawn, which has room for 11 (hint: ask for 1 to 11 agents)"
    );
}

#[test]
fn starts_are_uniform() {
    let grid = grid(ROOMS);
    let mut counts = vec![0; grid.cell_count() as usize];
    for seed in 0..5500 {
        let assigner = Assigner::new(&grid, Source::Random, 2, seed).unwrap();
        for cell in assigner.starts() {
            counts[cell as usize] += 1;
        }
    }
    // 1000 each: five standard deviations are 143.
    let off: Vec<_> = counts
        .iter()
        .filter(|count| **count > 0 && !(850..1150).contains(*count))
        .collect();
    assert!(off.is_empty(), "{counts:?}");
}

#[test]
fn random_goals_are_uniform_and_never_the_cell_before() {
    let grid = grid(ROOMS);
    let parts = grid.components(Connectivity::Four);
    let mut assigner = Assigner::new(&grid, Source::Random, 11, 1).unwrap();
    let starts = assigner.starts();
    let mut counts = vec![0; grid.cell_count() as usize];
    for (agent, start) in starts.iter().enumerate() {
        let mut before = *start;
        for index in 0..2000 {
            let goal = assigner.goal(agent, index);
            assert_ne!(goal, before);
            assert_eq!(parts[goal as usize], parts[*start as usize]);
            counts[goal as usize] += 1;
            before = goal;
        }
    }
    // All are as likely after each other one, not on the whole alone: 250 of each of 72 pairs. Five
    // standard deviations are 80.
    let mut pairs = BTreeMap::new();
    for (agent, start) in starts.iter().enumerate() {
        let goals = (0..2000).map(|index| assigner.goal(agent, index));
        let all: Vec<u32> = [*start].into_iter().chain(goals).collect();
        for pair in all.windows(2).filter(|pair| pair[0] % 6 < 3) {
            *pairs.entry((pair[0], pair[1])).or_insert(0) += 1;
        }
    }
    assert_eq!(pairs.len(), 72);
    assert!(
        pairs.values().all(|count| (170..330).contains(count)),
        "{pairs:?}"
    );
    // Nine agents have nine cells, two have two. Five standard deviations are 210.
    for (cell, count) in counts.iter().enumerate() {
        let expected = if grid.is_passable(cell as u32) && cell != 16 {
            2000
        } else {
            0
        };
        assert!(
            (expected - 210..=expected + 210).contains(count),
            "{cell}: {count}"
        );
    }
}

#[test]
fn goals_depend_on_seed_agent_and_index_alone() {
    let grid = grid(ROOMS);
    let new = |agents, seed| Assigner::new(&grid, Source::Random, agents, seed).unwrap();
    let (mut one, mut other, mut fewer) = (new(8, 9), new(8, 9), new(3, 9));
    let goals: Vec<Vec<u32>> = (0..8)
        .map(|agent| (0..50).map(|index| one.goal(agent, index)).collect())
        .collect();
    for index in (0..50).rev() {
        for agent in (0..8).rev() {
            assert_eq!(other.goal(agent, index), goals[agent][index as usize]);
        }
    }
    assert_eq!(fewer.goal(2, 49), goals[2][49]);
    // What was reached is forgotten, what comes is the same.
    other.reached(5, 20);
    assert_eq!(other.goal(5, 20), OFF_MAP);
    assert_eq!(other.goal(5, 21), goals[5][21]);
    let mut late = new(8, 9);
    late.reached(5, 30);
    assert_eq!(late.goal(5, 31), goals[5][31]);
    assert_ne!(new(8, 10).goal(5, 31), OFF_MAP);
}

#[test]
fn roles_take_turns() {
    let grid = grid(&["w..e", "...e", "@@@@", "w..."]);
    let mut assigner = Assigner::new(&grid, Source::Roles, 8, 5).unwrap();
    // The lower room has no endpoint.
    assert!(assigner.starts().iter().all(|cell| *cell < 8));
    for (agent, start) in assigner.starts().into_iter().enumerate() {
        let first = if start == 0 {
            Role::Endpoint
        } else {
            Role::Workstation
        };
        for index in 0..20 {
            let role = grid.role(assigner.goal(agent, index));
            assert_eq!(role == Some(first), index % 2 == 0);
        }
    }
    assert_eq!(
        refused(Assigner::new(&grid, Source::Roles, 9, 5)),
        "agents: 9 agents on drawn, which has room for 8 (hint: ask for 1 to 8 agents)"
    );
}

#[test]
fn auto_is_tasks_then_roles_then_random() {
    let plain = grid(&["...."]);
    let roles = grid(&["w..e"]);
    let half = grid(&["w..."]);
    let list = || read_lorr_tasks("t", b"1\n1\n", &plain).unwrap();
    let source = |assign, grid, list| Source::new(assign, grid, list, 1.0);
    assert_eq!(source(Assign::Auto, &plain, None), Ok(Source::Random));
    assert_eq!(source(Assign::Auto, &half, None), Ok(Source::Random));
    assert_eq!(source(Assign::Auto, &roles, None), Ok(Source::Roles));
    assert_eq!(source(Assign::Random, &roles, None), Ok(Source::Random));
    for assign in [Assign::Auto, Assign::Tasks, Assign::Generator] {
        let found = source(assign, &roles, Some(list()));
        assert!(matches!(found, Ok(Source::Tasks { .. })));
    }
    let text = |found: Result<Source, fleetyard_core::InputError>| found.unwrap_err().to_string();
    assert_eq!(
        text(source(Assign::Tasks, &plain, None)),
        "assign: there are no tasks"
    );
    assert_eq!(
        text(source(Assign::Roles, &half, None)),
        "drawn: the map has not both workstations (w) and endpoints (e)"
    );
    assert_eq!(
        text(source(Assign::Random, &plain, Some(list()))),
        "t: tasks are given, but goals do not come from tasks"
    );
}

#[test]
fn enough_goals_for_the_window_are_told_and_two_at_least() {
    let grid = grid(&["w........e"]);
    let mut assigner = Assigner::with_starts(&grid, Source::Roles, &[1], 0).unwrap();
    let told = |assigner: &mut Assigner, window| assigner.upcoming(&[1], &[0], window)[0].to_vec();
    assert_eq!(told(&mut assigner, 0), [0, 9]);
    // 1 and 9 steps are 10, which is not longer than 10.
    assert_eq!(told(&mut assigner, 9), [0, 9]);
    assert_eq!(told(&mut assigner, 10), [0, 9, 0]);
    assert_eq!(told(&mut assigner, 40), [0, 9, 0, 9, 0, 9]);
    assert_eq!(assigner.upcoming(&[1], &[3], 0)[0], [9, 0]);
    // However large the window is, there is an end.
    assert_eq!(told(&mut assigner, u32::MAX).len(), 1000);
}

#[test]
fn tasks_are_revealed_given_and_done() {
    let grid = grid(&["..........", ".........."]);
    // Cells of tasks 0 to 3, and from the beginning again.
    let source = tasks(&grid, "4\n9,8\n2\n0\n19,11\n", 1.5);
    let mut assigner = Assigner::with_starts(&grid, source, &[1, 5], 0).unwrap();
    let ids = |assigner: &Assigner| -> Vec<u64> {
        assigner.open_tasks().iter().map(|task| task.id).collect()
    };
    assert_eq!(ids(&assigner), [0, 1, 2]);
    // Nobody has a goal before tasks are given: the nearest first, the older of two.
    assert_eq!(assigner.goal(0, 0), OFF_MAP);
    let goals = assigner.upcoming(&[1, 5], &[0, 0], 0);
    assert_eq!((&goals[0], &goals[1]), (&[2][..], &[9, 8][..]));
    assert_eq!(ids(&assigner), [2]);
    assert_eq!(assigner.goal(1, 1), 8);
    assert_eq!(assigner.goal(1, 2), OFF_MAP);
    // The first of two errands is no task done; a task done makes room for the next.
    assigner.reached(1, 0);
    assert_eq!(ids(&assigner), [2]);
    assigner.reached(0, 0);
    assigner.reached(0, 0);
    assert_eq!(ids(&assigner), [2, 3]);
    // Who runs out of goals within the window gets its next task now.
    let goals = assigner.upcoming(&[2, 9], &[1, 1], 5);
    assert_eq!((&goals[0], &goals[1]), (&[0][..], &[8, 19, 11][..]));
    // Nobody has a task for the first one when its own is planned: it stays.
    let goals = assigner.upcoming(&[0, 9], &[2, 1], 0);
    assert_eq!(goals[0], [0]);
    assert_eq!(assigner.goal(0, 2), OFF_MAP);
    assigner.reached(1, 1);
    assert_eq!(
        assigner.open_tasks(),
        [Task {
            id: 4,
            places: vec![9, 8],
            released_s: 0.0,
        }]
    );
    // A generator may give tasks itself.
    assert_eq!(assigner.give(0, 4), Ok(()));
    assert_eq!(assigner.goal(0, 2), 9);
    assert_eq!(
        assigner.give(0, 4),
        Err("task 4 is given to agent 0, but it is not open".into())
    );
    assert_eq!(
        assigner.give(7, 4),
        Err("task 4 is given to agent 7, there are 2 agents".into())
    );
}

#[test]
fn memory_of_tasks_does_not_grow() {
    let grid = grid(&["......"]);
    let mut assigner =
        Assigner::with_starts(&grid, tasks(&grid, "3\n1,1\n2\n5\n", 2.0), &[0, 4], 0).unwrap();
    let mut next = [0, 0];
    for _ in 0..1000 {
        let goals = assigner.upcoming(&[0, 4], &next, 4);
        for (agent, next) in next.iter_mut().enumerate() {
            assert!((1..=10).contains(&goals[agent].len()));
            if assigner.goal(agent, *next) != OFF_MAP {
                assigner.reached(agent, *next);
                *next += 1;
            }
        }
        assert!(assigner.open_tasks().len() <= 4);
    }
    assert!(next.iter().all(|next| *next > 400));
}

#[test]
fn what_cannot_be_is_refused_with_its_place() {
    let grid = grid(ROOMS);
    assert_eq!(
        refused(Assigner::new(
            &grid,
            tasks(&grid, "2\n0,1\n2,5\n", 1.0),
            1,
            0
        )),
        "t.tasks:3: cell 5 (row 0, column 5) of task 1 cannot be reached from the tasks before \
         it (hint: keep the tasks of one part of the map)"
    );
    let blocked = Source::Tasks {
        list: TaskList {
            source: "t".into(),
            tasks: vec![vec![0], vec![3]],
            lines: vec![2, 3],
        },
        reveal: 1.0,
    };
    assert_eq!(
        refused(Assigner::new(&grid, blocked, 1, 0)),
        "t:3: cell 3 of task 1 is no free cell of the map"
    );
    for reveal in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e9] {
        let text = refused(Assigner::new(&grid, tasks(&grid, "1\n0\n", reveal), 2, 0));
        assert!(text.starts_with("reveal: "), "{text}");
    }
    let alone = self::grid(&[".@."]);
    assert_eq!(
        refused(Assigner::new(&alone, Source::Random, 1, 0)),
        "agents: 1 agents on drawn, which has room for 0 \
         (hint: no part of the map has two free cells beside each other)"
    );
    let with_starts =
        |starts: &[u32]| refused(Assigner::with_starts(&grid, Source::Random, starts, 0));
    assert_eq!(with_starts(&[]), "starts: there are no agents");
    assert_eq!(
        with_starts(&[0, 3]),
        "starts: agent 1 starts in no free cell"
    );
    assert_eq!(
        with_starts(&[0, 99]),
        "starts: agent 1 starts in no free cell"
    );
    assert_eq!(
        with_starts(&[2, 2]),
        "starts: agents 0 and 1 both start at row 0, column 2"
    );
    assert_eq!(
        with_starts(&[16]),
        "starts: agent 0 starts at row 2, column 4, with no goals to go to \
         (hint: start in a part of the map that has two free cells beside each other)"
    );
}

/// As the League's own scheduler: who has no task gets the one with the shortest way through all
/// its places, one at a time.
#[test]
fn the_shortest_task_is_given_to_who_has_none() {
    let grid = grid(&["..........", ".........."]);
    // From cell 0 the ways are 9 + 9, 2 + 7 and 8; from cell 1, 8 + 9, 1 + 7 and 7.
    let list = "3\n9,0\n2,9\n8\n";
    let new = |giving| {
        let source = tasks(&grid, list, 1.5);
        let assigner = Assigner::with_starts(&grid, source, &[0, 1], 0).unwrap();
        assigner.giving(giving)
    };
    let mut assigner = new(Giving::Shortest);
    assert_eq!(assigner.busy(), [false, false]);
    let goals = assigner.upcoming(&[0, 1], &[0, 0], 100);
    assert_eq!((&goals[0], &goals[1]), (&[8][..], &[2, 9][..]));
    assert_eq!(assigner.busy(), [true, true]);
    // However near its end is: the window gives nobody a second task.
    assert_eq!(assigner.open_tasks().len(), 1);
    let goals = assigner.upcoming(&[7, 1], &[0, 0], 100);
    assert_eq!((&goals[0], &goals[1]), (&[8][..], &[2, 9][..]));
    assigner.reached(0, 0);
    assert_eq!(assigner.busy(), [false, true]);
    // Task 3 is task 0 once more; of two equal ones the older is given.
    let goals = assigner.upcoming(&[8, 1], &[1, 0], 100);
    assert_eq!(
        (&goals[0], assigner.errand(0, 1).unwrap().task),
        (&[9, 0][..], 0)
    );

    let mut assigner = new(Giving::Nobody);
    let goals = assigner.upcoming(&[0, 1], &[0, 0], 100);
    assert!(goals[0].is_empty() && goals[1].is_empty());
    assert_eq!(assigner.give(0, 2), Ok(()));
    assert_eq!(assigner.busy(), [true, false]);
    assert_eq!(assigner.upcoming(&[0, 1], &[0, 0], 100)[0], [8]);
}

#[test]
fn goals_that_are_sent_come_after_those_there_are() {
    let grid = grid(ROOMS);
    let new = |source| Assigner::with_starts(&grid, source, &[0, 4], 0).unwrap();
    let mut assigner = new(Source::Random);
    let refused = |assigner: &Assigner, agent, cell| assigner.can_send(agent, cell).unwrap_err();
    for (agent, cell, reason) in [
        (2, 0, "there is no robot 2 among 2"),
        (0, 3, "3 is no free cell of the map"),
        (0, 99, "99 is no free cell of the map"),
        (0, 5, "robot 0 cannot reach cell 5"),
        (1, 0, "robot 1 cannot reach cell 0"),
        (0, 0, "robot 0 goes to cell 0 already"),
    ] {
        assert_eq!(refused(&assigner, agent, cell), reason);
    }
    let first = assigner.goal(0, 0);
    let sent = (0..3).find(|cell| *cell != first).unwrap();
    assert_eq!(assigner.can_send(0, sent), Ok(()));
    assigner.send(0, sent);
    assert_eq!((assigner.goal(0, 0), assigner.goal(0, 1)), (first, sent));
    let drawn = assigner.goal(0, 2);
    assert_ne!(drawn, sent);
    assert_eq!(assigner.goal(1, 0), 5, "the other one goes its own way");
    assert_eq!(
        refused(&assigner, 0, drawn),
        format!("robot 0 goes to cell {drawn} already")
    );
    // What was reached makes room.
    let last = assigner.goal(0, 999);
    let other = (0..3).find(|cell| *cell != last).unwrap();
    assert_eq!(
        refused(&assigner, 0, other),
        "robot 0 has 1000 goals already"
    );
    assigner.reached(0, 0);
    assert_eq!(assigner.can_send(0, other), Ok(()));
    let source = tasks(&grid, "1\n0,1\n", 1.0);
    let listed = Assigner::with_starts(&grid, source, &[0], 0).unwrap();
    assert_eq!(
        listed.can_send(0, 1).unwrap_err(),
        "robots of this fleet get their goals from tasks"
    );
}

#[test]
fn tasks_of_goals_are_told_with_their_times() {
    let grid = grid(&["..........", ".........."]);
    let source = tasks(&grid, "4\n9,8\n2\n0\n19,11,12\n", 1.5);
    let mut assigner = Assigner::with_starts(&grid, source, &[1, 5], 0).unwrap();
    assigner.set_time(2.5);
    let goals = assigner.upcoming(&[1, 5], &[0, 0], 0);
    assert_eq!((&goals[0], &goals[1]), (&[2][..], &[9, 8][..]));
    let errand = |assigner: &Assigner, agent, index| {
        let found = assigner.errand(agent, index);
        found.map(|errand| (errand.task, errand.at, errand.of))
    };
    assert_eq!(errand(&assigner, 0, 0), Some((1, 0, 1)));
    assert_eq!(errand(&assigner, 0, 1), None);
    assert_eq!(errand(&assigner, 1, 0), Some((0, 0, 2)));
    assert_eq!(errand(&assigner, 1, 1), Some((0, 1, 2)));
    assert_eq!(errand(&assigner, 1, 2), None);
    // Task 3 is known when task 1 is done, and given with task 2 when the way is short.
    assigner.set_time(4.0);
    assigner.reached(0, 0);
    assert_eq!(assigner.tasks_done(), Some(1));
    assigner.reached(1, 0);
    assert_eq!(assigner.tasks_done(), Some(1));
    assigner.set_time(6.0);
    let goals = assigner.upcoming(&[2, 9], &[1, 1], 5);
    assert_eq!((&goals[0], &goals[1]), (&[0][..], &[8, 19, 11][..]));
    assert_eq!(errand(&assigner, 1, 1), Some((0, 1, 2)));
    assert_eq!(errand(&assigner, 1, 2), Some((3, 0, 3)));
    assert_eq!(errand(&assigner, 1, 4), Some((3, 2, 3)));
    assert_eq!(errand(&assigner, 1, 5), None);
    assigner.set_time(7.0);
    let wanted = GoalTasks {
        time_s: 7.0,
        tasks: [2, 0, 3, 3].map(Some).to_vec(),
        errands: [0, 1, 0, 1].map(Some).to_vec(),
        released_s: vec![0.0, 0.0, 4.0, 4.0],
        given_s: vec![6.0, 2.5, 6.0, 6.0],
    };
    assert_eq!(assigner.goal_tasks(&goals, &[1, 1]), wanted);
    // Who has none stays, from now on.
    let stays = assigner.upcoming(&[0, 9], &[2, 5], 0);
    assert_eq!(stays[0], [0]);
    let told = assigner.goal_tasks(&stays, &[2, 5]);
    assert_eq!(
        (told.tasks[0], told.given_s[0].to_bits()),
        (None, 7.0f64.to_bits())
    );
}

#[test]
fn goals_of_no_task_are_had_since_the_one_before_was_reached() {
    let grid = grid(ROOMS);
    let mut assigner = Assigner::with_starts(&grid, Source::Random, &[0, 4], 0).unwrap();
    assigner.set_time(1.0);
    let goals = assigner.upcoming(&[0, 4], &[0, 0], 0);
    let told = assigner.goal_tasks(&goals, &[0, 0]);
    assert_eq!(
        (&told.tasks, &told.errands),
        (&vec![None; 4], &vec![None; 4])
    );
    // The first ones since the start, the others are still to come.
    assert_eq!(told.given_s, [0.0, 1.0, 0.0, 1.0]);
    assert_eq!(told.released_s, told.given_s);
    assigner.set_time(3.0);
    assigner.reached(1, 0);
    assigner.set_time(5.0);
    let goals = assigner.upcoming(&[0, 5], &[1, 1], 0);
    let told = assigner.goal_tasks(&goals, &[1, 1]);
    // The first robot is told of its second goal on, and has not reached the first.
    assert_eq!(told.given_s, [5.0, 5.0, 3.0, 5.0]);
    assert_eq!((assigner.errand(0, 1), assigner.tasks_done()), (None, None));
    assert!(assigner.busy().is_empty() && assigner.open_tasks().is_empty());
}
