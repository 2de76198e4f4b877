//! The search for one agent against an exhaustive one over all states at all times, and
//! problems against what instances say.

use std::collections::BTreeSet;

use fleetyard_abi::{GridEnvironment, Heading, Instance, Motion, Status};
use fleetyard_plugin_spacetime::distance::{Table, Tables};
use fleetyard_plugin_spacetime::graph::{Graph, Vertex};
use fleetyard_plugin_spacetime::lanes::Lanes;
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem, ProblemError};
use fleetyard_plugin_spacetime::random::Random;
use fleetyard_plugin_spacetime::reservation::{NEVER, Reservations};
use fleetyard_plugin_spacetime::sipp::{Guidance, Miss, Query, Sipp};
use proptest::prelude::*;

fn environment(rows: u32, cols: u32, passable: &[bool]) -> GridEnvironment {
    let passable: Vec<u8> = passable.iter().map(|free| u8::from(*free)).collect();
    GridEnvironment::four_connected(rows, cols, passable)
}

fn problem(
    environment: &GridEnvironment,
    instance: &Instance,
    rule: GoalRule,
) -> Result<Problem, ProblemError> {
    Ground::new(environment, 1 << 20)?.problem(instance, rule, &mut || false)
}

/// One agent and the paths of others.
#[derive(Debug, Clone)]
struct Case {
    problem: Problem,
    others: Vec<Vec<Vertex>>,
    seed: u64,
}

fn at(path: &[Vertex], t: u32) -> Vertex {
    *path
        .get(t as usize)
        .or(path.last())
        .expect("paths have a start")
}

impl Case {
    fn in_window(&self, t: u32) -> bool {
        self.problem.window == 0 || t <= self.problem.window
    }

    fn free(&self, v: Vertex, t: u32) -> bool {
        !self.in_window(t) || self.others.iter().all(|path| at(path, t) != v)
    }

    /// True if `v` is free from `t` on for ever.
    fn settled(&self, v: Vertex, t: u32) -> bool {
        (t..=t.max(self.last())).all(|t| self.free(v, t))
    }

    /// Time at which all others are at rest.
    fn last(&self) -> u32 {
        let last = self.others.iter().map(|path| path.len() as u32).max();
        last.unwrap_or(0).max(self.problem.window) + 1
    }

    /// True if nobody is in the way of a move from `t` to `t + 1`.
    fn allowed(&self, from: Vertex, to: Vertex, t: u32) -> bool {
        if !self.free(to, t + 1) {
            return false;
        }
        if from == to || !self.in_window(t + 1) {
            return true;
        }
        let mut places = BTreeSet::from([to]);
        let mut length = 0;
        // Everywhere the chain of movers leads; others may collide, so it may fork.
        loop {
            let next: BTreeSet<Vertex> = self
                .others
                .iter()
                .filter(|path| places.contains(&at(path, t)) && at(path, t) != at(path, t + 1))
                .map(|path| at(path, t + 1))
                .chain(places.iter().copied())
                .collect();
            length += 1;
            if next.contains(&from) && (length == 1 || !self.problem.cycles) {
                return false;
            }
            if next == places || self.problem.cycles {
                return true;
            }
            places = next;
        }
    }

    /// The least length, by all states at all times.
    fn exhaustive(&self) -> Option<u32> {
        let Problem {
            graph,
            routes,
            turning,
            window,
            ..
        } = &self.problem;
        let route = &routes[0];
        let goals = route.goals.len() as u32;
        if !self.free(route.start, 0) {
            return None;
        }
        let visited =
            |label: u32, before: u32, t: u32| if label < goals { NEVER } else { before.min(t) };
        let label = route.reached(0, route.start);
        let mut layer =
            BTreeSet::from([(route.start, route.heading, label, visited(label, NEVER, 0))]);
        let mut best: Option<u32> = None;
        for t in 0..=self.last() + 60 {
            for &(v, heading, label, visited) in &layer {
                let length = if *window > 0 && t == *window {
                    Some(if label == goals {
                        visited
                    } else {
                        t + route.rest(label, v, heading)
                    })
                } else if self.settled(v, t) {
                    let here = route.stays && label + 1 == goals && route.goals.last() == Some(&v);
                    if here {
                        Some(t)
                    } else {
                        (label == goals).then_some(visited)
                    }
                } else {
                    None
                };
                best = [best, length].into_iter().flatten().min();
            }
            if *window > 0 && t == *window {
                break;
            }
            let mut next = BTreeSet::new();
            for &(v, heading, label, before) in &layer {
                let mut go = |to: Vertex, heading: u8| {
                    if self.allowed(v, to, t) {
                        let label = route.reached(label, to);
                        next.insert((to, heading, label, visited(label, before, t + 1)));
                    }
                };
                go(v, heading);
                if *turning {
                    go(v, (heading + 1) % 4);
                    go(v, (heading + 3) % 4);
                }
                for (d, &to) in graph.around(v).iter().enumerate() {
                    if to != graph.wall() && (!turning || d == usize::from(heading)) {
                        go(to, heading);
                    }
                }
            }
            layer = next;
        }
        best
    }

    /// True if a length is the least, or longer where estimates are not exact: the heading of a
    /// robot at a goal is not known before, so that estimates grow there, and staying away from
    /// goals until the window ends seems to be good.
    fn is_least(&self, length: u32, least: Option<u32>) -> bool {
        let goals = self.problem.routes[0].goals.len();
        let exact = self.problem.window == 0 || !self.problem.turning || goals == 1;
        least.is_some_and(|least| length == least || !exact && length > least)
    }

    fn table(&self) -> Reservations {
        let mut table = if self.problem.window > 0 {
            Reservations::windowed(&self.problem.graph, self.problem.window)
        } else {
            Reservations::new(&self.problem.graph, self.last() as usize)
        };
        for path in &self.others {
            table.add(&self.problem.graph, path, 0);
        }
        table
    }

    fn search(&self, soft: Option<&Reservations>) -> Result<(Vec<Vertex>, u32), Miss> {
        self.search_charged(soft, 0, None)
    }

    fn search_charged(
        &self,
        soft: Option<&Reservations>,
        turn_charge: u32,
        lanes: Option<&Lanes>,
    ) -> Result<(Vec<Vertex>, u32), Miss> {
        let route = &self.problem.routes[0];
        let query = Query {
            graph: &self.problem.graph,
            hard: &self.table(),
            soft,
            route,
            start: route.start,
            heading: route.heading,
            turn_charge,
            lanes,
            turning: self.problem.turning,
            window: self.problem.window,
            cycles: self.problem.cycles,
            bound: NEVER,
        };
        let found = Sipp::default().plan(&query, &mut Random::new(self.seed, 0), &mut || false)?;
        Ok((found.path, found.length))
    }

    /// Quarter turns on a path, where they take no steps.
    fn quarters(&self, path: &[Vertex]) -> u32 {
        let Problem {
            graph,
            routes,
            turning,
            ..
        } = &self.problem;
        let mut heading = routes[0].heading;
        let moves = path.windows(2).filter(|step| step[0] != step[1]);
        let turns = moves.map(|step| {
            let d = graph.around(step[0]).iter().position(|u| *u == step[1]);
            let d = d.expect("moves lead to neighbours") as u8;
            let apart = (d + 4 - std::mem::replace(&mut heading, d)) % 4;
            u32::from(apart.min(4 - apart))
        });
        if *turning { 0 } else { turns.sum() }
    }

    /// Charges of lanes on a path.
    fn against(&self, path: &[Vertex], lanes: &Lanes) -> u32 {
        let moves = path.windows(2).filter(|step| step[0] != step[1]);
        let charges = moves.map(|step| {
            let around = self.problem.graph.around(step[0]);
            let d = around.iter().position(|u| *u == step[1]);
            lanes.charge(step[0], d.expect("moves lead to neighbours"))
        });
        charges.sum()
    }

    /// Checks that a path is one of this agent, in nobody's way, and as long as it says.
    fn check(&self, path: &[Vertex], length: u32) {
        let Problem {
            graph,
            routes,
            turning,
            window,
            ..
        } = &self.problem;
        let route = &routes[0];
        let goals = route.goals.len() as u32;
        assert_eq!(path[0], route.start);
        let (mut heading, mut stood) = (route.heading, 0);
        let mut label = route.reached(0, route.start);
        let mut visited = if label == goals { 0 } else { NEVER };
        for (t, step) in path.windows(2).enumerate() {
            let (t, from, to) = (t as u32, step[0], step[1]);
            assert!(self.allowed(from, to, t), "{from} to {to} at {t}");
            if from == to {
                stood += 1;
            } else {
                let d = graph.around(from).iter().position(|&u| u == to);
                let d = d.expect("moves lead to neighbours") as u8;
                let apart = (d + 4 - heading) % 4;
                assert!(
                    !turning || stood >= apart.min(4 - apart),
                    "no time to turn at {t}"
                );
                (heading, stood) = (d, 0);
            }
            label = route.reached(label, to);
            if label == goals {
                visited = visited.min(t + 1);
            }
        }
        let end = path.len() as u32 - 1;
        let last = path[end as usize];
        if *window == 0 || end < *window {
            assert!(self.settled(last, end), "the end is not free for ever");
            if route.stays {
                assert_eq!((label + 1, last), (goals, *route.goals.last().unwrap()));
                assert_eq!(length, end);
            } else {
                assert_eq!(length, visited);
            }
        } else {
            assert_eq!(end, *window);
            let least = [0, 1, 2].map(|turns| route.rest(label, last, (heading + turns) % 4));
            assert!(length >= least.into_iter().min().unwrap().min(visited));
        }
    }
}

fn walk(random: &mut Random, graph: &Graph, steps: usize) -> Vec<Vertex> {
    let mut path = vec![random.below(graph.len()) as Vertex];
    for _ in 0..steps {
        let v = path[path.len() - 1];
        let mut choices: Vec<Vertex> = graph.neighbors(v).collect();
        choices.push(v);
        path.push(choices[random.below(choices.len())]);
    }
    path
}

prop_compose! {
    fn case()(
        rows in 1_u32..5,
        cols in 2_u32..5,
        seed: u64,
        others in 0_usize..5,
        goals in 1_usize..4,
        window in prop::sample::select(vec![0, 0, 1, 3, 7, 12]),
        turning: bool,
        cycles: bool,
        rule in prop::sample::select(vec![GoalRule::Stay, GoalRule::Transient]),
    ) -> Option<Case> {
        let mut random = Random::new(seed, 1);
        let passable: Vec<bool> = (0..rows * cols).map(|_| !random.one_in(6)).collect();
        let free: Vec<u32> = (0..rows * cols).filter(|&cell| passable[cell as usize]).collect();
        if free.is_empty() {
            return None;
        }
        let mut cell = || free[random.below(free.len())];
        let start = cell();
        let goals: Vec<u32> = (0..goals).map(|_| cell()).collect();
        let heading = [Heading::North, Heading::East, Heading::South, Heading::West][random.below(4)];
        let instance = Instance {
            headings: Some(vec![heading]),
            goals: [goals].into_iter().collect(),
            motion: if turning { Motion::Rotation } else { Motion::Pebble },
            window_steps: window,
            allows_cycles: cycles,
            ..Instance::one_shot(vec![start], vec![start])
        };
        let problem = problem(&environment(rows, cols, &passable), &instance, rule).ok()?;
        let others = (0..others).map(|_| {
            let steps = random.below(10);
            walk(&mut random, &problem.graph, steps)
        });
        let others = others.collect();
        Some(Case { problem, others, seed })
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(800))]

    #[test]
    fn paths_are_as_short_as_can_be(case in case()) {
        let Some(case) = case else { return Ok(()) };
        let least = case.exhaustive();
        match case.search(None) {
            Ok((path, length)) => {
                case.check(&path, length);
                prop_assert!(case.is_least(length, least));
            }
            Err(miss) => prop_assert_eq!((miss, None), (Miss::NoPath, least)),
        }
        // Charging turns, or moves against lanes, makes no path impossible.
        let lanes = Lanes::new(&case.problem.graph, 2);
        for (turn_charge, lanes) in [(3, None), (0, Some(&lanes))] {
            match case.search_charged(None, turn_charge, lanes) {
                Ok((path, length)) if case.problem.window == 0 => {
                    let against = lanes.map_or(0, |lanes| case.against(&path, lanes));
                    let charged = turn_charge * case.quarters(&path) + against;
                    case.check(&path, length - charged);
                    prop_assert!(least.is_some_and(|least| length - charged >= least));
                }
                Ok(_) => prop_assert!(least.is_some()),
                Err(miss) => prop_assert_eq!((miss, None), (Miss::NoPath, least)),
            }
        }
        // Whom one would rather not meet makes no path longer, or impossible.
        let mut soft = case.table();
        soft.reset(0);
        let mut random = Random::new(case.seed, 2);
        for _ in 0..3 {
            let path = walk(&mut random, &case.problem.graph, 8);
            soft.add(&case.problem.graph, &path, 0);
        }
        match case.search(Some(&soft)) {
            Ok((path, length)) => {
                case.check(&path, length);
                prop_assert!(case.is_least(length, least));
            }
            Err(miss) => prop_assert_eq!((miss, None), (Miss::NoPath, least)),
        }
    }

    #[test]
    fn tables_hold_the_steps_that_it_takes(rows in 1_u32..6, cols in 1_u32..6, seed: u64, turning: bool, charge in 0_u32..4) {
        let mut random = Random::new(seed, 0);
        let passable: Vec<bool> = (0..rows * cols).map(|_| !random.one_in(4)).collect();
        let graph = Graph::new(rows as usize, cols as usize, &passable);
        prop_assume!(!graph.is_empty());
        let goal = random.below(graph.len()) as Vertex;
        let lanes = Lanes::new(&graph, charge);
        let table = Table::new(&graph, goal, turning, (charge > 0).then_some(&lanes));
        // One step of anybody costs one and its charge, so that a table that is zero at the
        // goal alone and has a way down by just that from everywhere else is the one.
        for v in 0..graph.len() as Vertex {
            for heading in 0..4_u8 {
                let here = table.get(v, heading);
                let mut next = Vec::new();
                for (d, &u) in graph.around(v).iter().enumerate() {
                    if u != graph.wall() && (!turning || d == usize::from(heading)) {
                        next.push(table.get(u, heading) + lanes.charge(v, d));
                    }
                }
                if turning {
                    next.push(table.get(v, (heading + 1) % 4));
                    next.push(table.get(v, (heading + 3) % 4));
                }
                prop_assert_eq!(here == 0, v == goal);
                prop_assert!(next.iter().all(|&there| there <= 65535 + charge && there + 1 >= here));
                if here > 0 && here < 65535 {
                    prop_assert!(next.contains(&(here - 1)));
                }
            }
        }
    }
}

#[test]
fn soft_paths_are_gone_round_where_that_costs_nothing() {
    // Two ways of four steps each; somebody is on the one through the first row.
    let environment = environment(2, 3, &[true; 6]);
    let instance = Instance::one_shot(vec![0], vec![5]);
    let problem = problem(&environment, &instance, GoalRule::Stay).unwrap();
    for seed in 0..20 {
        for (soft_path, avoided) in [(vec![1], 1), (vec![4], 4)] {
            let case = Case {
                problem: problem.clone(),
                others: Vec::new(),
                seed,
            };
            let mut soft = case.table();
            soft.add(&problem.graph, &soft_path, 0);
            let (path, length) = case.search(Some(&soft)).unwrap();
            assert_eq!(length, 3);
            assert!(!path.contains(&avoided), "{path:?}");
        }
    }
}

#[test]
fn a_robot_waits_rather_than_turn_where_turns_are_charged() {
    // Somebody is in the way for a while, and one can go round by the other row.
    let environment = environment(2, 5, &[true; 10]);
    let instance = Instance {
        headings: Some(vec![Heading::East]),
        ..Instance::one_shot(vec![0], vec![4])
    };
    let problem = problem(&environment, &instance, GoalRule::Transient).unwrap();
    let (across, aside) = (problem.graph.vertex(2), problem.graph.vertex(7));
    let (across, aside) = (across.unwrap(), aside.unwrap());
    for seed in 0..20 {
        let case = Case {
            problem: problem.clone(),
            others: vec![[[across; 6].as_slice(), &[aside]].concat()],
            seed,
        };
        let (path, length) = case.search(None).unwrap();
        assert!(length == 6 && case.quarters(&path) > 0, "{path:?}");
        let (path, length) = case.search_charged(None, 1, None).unwrap();
        assert_eq!((length, case.quarters(&path)), (8, 0), "{path:?}");
    }
}

#[test]
fn with_a_delay_nobody_comes_soon_after_or_before() {
    let graph = Graph::new(1, 5, &[true; 5]);
    let mut table = Reservations::new(&graph, 16);
    table.add(&graph, &[0, 1, 2, 3, 4], 2);
    let busy = |v: Vertex| (0..10).filter(|&t| table.busy(v, t)).collect::<Vec<_>>();
    assert_eq!(busy(0), [0, 1, 2]);
    assert_eq!(busy(2), [0, 1, 2, 3, 4]);
    assert_eq!(busy(4), [2, 3, 4, 5, 6, 7, 8, 9]);
    table.reset(8);
    assert!((0..5).all(|v| table.next_busy(v, 0) == NEVER));
}

#[test]
fn tables_are_kept_until_room_is_needed() {
    let (each, make) = (202, |goal: u32| move || goal);
    let mut tables = Tables::new(8 * each);
    tables.begin();
    for goal in 0..8 {
        assert!(tables.get(goal, each, make(goal)).is_some());
    }
    assert!(
        tables.get(8, each, make(8)).is_none(),
        "all eight are in use"
    );
    tables.begin();
    let kept = tables.get(7, each, make(7)).unwrap();
    assert!(tables.get(8, each, make(8)).is_some());
    assert!(tables.bytes() <= tables.limit());
    // Those of this call have stayed.
    assert!(std::sync::Arc::ptr_eq(
        &kept,
        &tables.get(7, each, make(7)).unwrap()
    ));
}

#[test]
fn what_is_wrong_is_said() {
    let map = environment(2, 3, &[true, false, true, true, false, true]);
    let asked = |instance: &Instance| {
        let error = problem(&map, instance, GoalRule::Stay).unwrap_err();
        (error.status(), error.to_string())
    };
    let (status, text) = asked(&Instance::one_shot(vec![0, 0], vec![3, 0]));
    assert_eq!(status, Status::InvalidInput);
    assert_eq!(text, "agents 0 and 1 have the same start cell 0");
    let (_, text) = asked(&Instance::one_shot(vec![0], vec![1]));
    assert_eq!(
        text,
        "agent 0: goal cell 1 is not a passable cell of the map"
    );
    let (_, text) = asked(&Instance::one_shot(vec![0], vec![2]));
    assert_eq!(
        text,
        "agent 0: no path of at most 65533 steps from cell 0 to cell 2"
    );
    let (_, text) = asked(&Instance::one_shot(vec![0], vec![9]));
    assert_eq!(
        text,
        "agent 0: goal cell 9 is not a passable cell of the map"
    );
    let any_angle = Instance {
        motion: Motion::AnyAngle,
        ..Instance::one_shot(vec![0], vec![3])
    };
    assert_eq!(asked(&any_angle).0, Status::Unsupported);
    let mut ground = Ground::new(&map, 9).unwrap();
    let error = ground.problem(
        &Instance::one_shot(vec![0], vec![3]),
        GoalRule::Stay,
        &mut || false,
    );
    assert_eq!(
        error.unwrap_err(),
        ProblemError::Memory { goals: 1, limit: 9 }
    );
    let error = Ground::new(&map, 1000).unwrap().problem(
        &Instance::one_shot(vec![0], vec![3]),
        GoalRule::Stay,
        &mut || true,
    );
    assert_eq!(error.unwrap_err().status(), Status::TimedOut);
}

#[test]
fn who_shares_a_last_goal_need_not_stay() {
    let map = environment(1, 4, &[true; 4]);
    let instance = Instance::one_shot(vec![0, 1, 2], vec![3, 3, 0]);
    let stays = |instance: &Instance, rule| {
        let problem = problem(&map, instance, rule).unwrap();
        problem
            .routes
            .iter()
            .map(|route| route.stays)
            .collect::<Vec<_>>()
    };
    assert_eq!(stays(&instance, GoalRule::Stay), [false, false, true]);
    assert_eq!(stays(&instance, GoalRule::Transient), [false; 3]);
    let windowed = Instance {
        window_steps: 3,
        ..instance
    };
    assert_eq!(stays(&windowed, GoalRule::Stay), [false; 3]);
}

#[test]
fn lanes_are_worth_a_way_round() {
    // Row 0 leads east and row 1 west; column 0 leads south and column 5 north.
    let environment = environment(3, 6, &[true; 18]);
    let instance = Instance {
        window_steps: 12,
        ..Instance::one_shot(vec![5], vec![0])
    };
    for (charge, steps, row) in [(0, 5, 0), (2, 11, 1)] {
        let ground = Ground::new(&environment, 1 << 20).unwrap();
        let mut ground = ground.with_lanes(charge);
        let mut ask = |instance| {
            ground
                .problem(instance, GoalRule::Transient, &mut || false)
                .unwrap()
        };
        // Five steps against the lane are charged ten; to change to the other one and back is
        // two steps more, which are charged four.
        let problem = ask(&instance);
        assert_eq!(problem.routes[0].length(), steps);
        let case = Case {
            others: Vec::new(),
            seed: 0,
            problem,
        };
        let lanes = case.problem.lanes.clone();
        let (path, length) = case.search_charged(None, 0, lanes.as_deref()).unwrap();
        assert_eq!(length, steps);
        let here = |v: &Vertex| case.problem.graph.place(*v) == [row, 3];
        assert!(path.iter().any(here), "{path:?}");
        // Plans to the end are to be short.
        let whole = ask(&Instance::one_shot(vec![5], vec![0]));
        assert_eq!(whole.routes[0].length(), 5);
        assert!(whole.lanes.is_none());
    }
}
