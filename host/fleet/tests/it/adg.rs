//! Promises of the action dependency graph, whatever robots do: arbitrary valid plans, arbitrary
//! cuts, and completions that come late, out of order and more than once.

use std::collections::{BTreeSet, VecDeque};

use crate::walks::{Walks, north};
use fleetyard_abi::{Heading, Instance, Motion, RestOfPlan};
use fleetyard_core::{Grid, GridPlan, OFF_MAP};
use fleetyard_fleet::adg::{Adg, AdgError, Appended, Costs, Cut, Node, Pace};
use fleetyard_fleet::batch::{Batch, judge};
use fleetyard_world::SeededRandom;
use proptest::prelude::*;

const QUEUE: u32 = 3;

/// Bytes of a pending node.
const VISIT: usize = 48;

/// An AGV of 2 m/s, 2 m/s² and 45°/s.
const PACE: Pace = Pace {
    move_s: 0.5,
    set_out_s: 0.5,
    quarter_turn_s: 2.0,
    dwell_s: 1.0,
};

fn batch(grid: &Grid, paths: &[&[u32]]) -> Batch {
    let starts: Vec<u32> = paths.iter().map(|path| path[0]).collect();
    let instance = Instance::one_shot(starts.clone(), starts);
    judge(grid, &instance, GridPlan::from_paths(paths)).expect("the batch is valid")
}

fn no_goals(_: usize, _: u32) -> u32 {
    OFF_MAP
}

fn open(rows: u32, cols: u32) -> Grid {
    Grid::new("open", rows, cols, vec![b'.'; (rows * cols) as usize]).unwrap()
}

/// The visible state of a graph.
fn state(adg: &Adg, cells: u32) -> (Vec<Vec<Node>>, Vec<Vec<u32>>) {
    let nodes = |agent| adg.nodes(agent).copied().collect();
    let visitors = |cell| adg.visitors(cell).collect();
    (
        (0..adg.agents()).map(nodes).collect(),
        (0..cells).map(visitors).collect(),
    )
}

/// A robot that does what it is told, some day.
#[derive(Clone, Default)]
struct Robot {
    cell: u32,
    /// Its cell as far as it is known.
    known: u32,
    told: VecDeque<Node>,
    /// The node that is under way, and how many are done.
    under_way: Option<Node>,
    /// True if it is so far on its way that its cell is free.
    left: bool,
    done: u32,
    /// Batch and step in which it goes, as planned, for every pending node.
    planned: VecDeque<(usize, usize)>,
    next_goal: u32,
}

/// A yard where robots move when the scheduler wants them to.
struct Yard {
    adg: Adg,
    walks: Walks,
    chance: SeededRandom,
    robots: Vec<Robot>,
    /// The agent in each cell, or on the way to it or from it.
    inside: Vec<Option<usize>>,
    /// Batch and step in which each cell was last entered by plan.
    entered: Vec<(usize, usize)>,
    goals: Vec<Vec<u32>>,
    batches: usize,
}

impl Yard {
    fn new(grid: Grid, agents: usize, seed: u64, rings: f64, costs: Costs) -> Self {
        let cells = grid.cell_count() as usize;
        let mut walks = Walks::new(grid, seed);
        walks.rings = rings;
        let free = (0..walks.grid.cell_count()).filter(|cell| walks.grid.is_passable(*cell));
        let mut starts: Vec<u32> = free.collect();
        walks.random.shuffle(&mut starts);
        starts.truncate(agents);
        let agents = starts.len();
        let mut adg = Adg::new(&walks.grid, &starts, &north(agents), costs).unwrap();
        adg.tell_rest();
        let mut inside = vec![None; cells];
        let mut robots = Vec::new();
        for (agent, cell) in starts.iter().enumerate() {
            inside[*cell as usize] = Some(agent);
            robots.push(Robot {
                cell: *cell,
                known: *cell,
                ..Robot::default()
            });
        }
        let mut chance = SeededRandom::new("chance", seed);
        // Few different goals, so that many are met; the same may come twice.
        let mut goals = || (0..400).map(|_| chance.below(cells) as u32).collect();
        let goals = (0..agents).map(|_| goals()).collect();
        Self {
            adg,
            walks,
            chance,
            robots,
            inside,
            entered: vec![(0, 0); cells],
            goals,
            batches: 0,
        }
    }

    fn append(&mut self, steps: usize, window: u32) -> Appended {
        self.batches += 1;
        let ends: Vec<u32> = (0..self.robots.len())
            .map(|agent| self.adg.end(agent))
            .collect();
        let batch = self.walks.batch(&ends, steps, window);
        let goals = &self.goals;
        let appended = self
            .adg
            .append(&batch, &mut |agent, index| {
                goals[agent].get(index as usize).copied().unwrap_or(OFF_MAP)
            })
            .unwrap();
        assert!(self.adg.is_acyclic());
        for (agent, robot) in self.robots.iter_mut().enumerate() {
            let path = batch.path(agent);
            let moves = (1..path.len()).filter(|step| path[*step] != path[step - 1]);
            let mut moves = moves.map(|step| (self.batches, step));
            let mut cell = robot.known;
            for (at, node) in self.adg.nodes(agent).enumerate() {
                let stays = std::mem::replace(&mut cell, node.cell) == node.cell;
                if at < robot.planned.len() {
                    continue;
                }
                let planned = if stays {
                    Some((self.batches, 0))
                } else {
                    moves.next()
                };
                robot
                    .planned
                    .push_back(planned.expect("only what was planned"));
            }
        }
        self.check();
        appended
    }

    fn cut(&mut self, lookahead: u32) {
        let before: Vec<u32> = (0..self.robots.len())
            .map(|agent| self.adg.actions_left(agent))
            .collect();
        let pending = self.pending();
        let cut = self.adg.cut(lookahead);
        for (agent, before) in before.iter().enumerate() {
            assert!(self.adg.actions_left(agent) >= *before.min(&lookahead));
        }
        self.judge_cut(&pending, &cut);
    }

    /// The cells of what is pending, per agent.
    fn pending(&self) -> Vec<Vec<u32>> {
        let nodes = |agent| self.adg.nodes(agent).map(|node| node.cell).collect();
        (0..self.robots.len()).map(nodes).collect()
    }

    fn cut_within(&mut self, horizon_s: f64, since_s: f64) {
        let pending = self.pending();
        let told: Vec<u32> = (0..self.robots.len())
            .map(|agent| self.adg.progress(agent).1)
            .collect();
        let cut = self.adg.cut_within(horizon_s, since_s, &PACE);
        for (agent, told) in told.iter().enumerate() {
            assert_eq!(self.adg.progress(agent).1, *told, "what robots have stays");
        }
        self.judge_cut(&pending, &cut);
    }

    fn judge_cut(&mut self, pending: &[Vec<u32>], cut: &Cut) {
        let before: usize = pending.iter().map(Vec::len).sum();
        assert_eq!(before - self.adg.pending(), cut.dropped);
        self.judge_rest(pending, cut);
        let distinct: BTreeSet<u32> = cut.cells.iter().copied().collect();
        assert_eq!(
            distinct.len(),
            cut.cells.len(),
            "ends of the cut are distinct"
        );
        for (agent, robot) in self.robots.iter_mut().enumerate() {
            assert_eq!(cut.cells[agent], self.adg.end(agent));
            robot.planned.truncate(self.adg.nodes(agent).count());
            let matched = self
                .adg
                .nodes(agent)
                .filter(|node| node.goal.is_some())
                .count() as u32;
            let told = robot.next_goal + matched;
            assert_eq!(cut.next_goal[agent], told, "a cut un-matches what it drops");
        }
        self.check();
    }

    /// The rest has the moves that were dropped, and is a plan that may be executed.
    fn judge_rest(&self, pending: &[Vec<u32>], cut: &Cut) {
        let grid = &self.walks.grid;
        let rest = RestOfPlan {
            paths: cut.rest.clone(),
        };
        let plan = rest.plan(&cut.cells, grid.rows(), grid.cols()).unwrap();
        for (agent, pending) in pending.iter().enumerate() {
            let kept = self.adg.nodes(agent).count();
            let mut dropped = vec![cut.cells[agent]];
            dropped.extend(&pending[kept..]);
            dropped.dedup();
            let mut path = plan.path(agent).to_vec();
            path.dedup();
            assert_eq!(path, dropped);
        }
        let instance = Instance::one_shot(cut.cells.clone(), cut.cells.clone());
        judge(grid, &instance, plan).expect("nobody collides who keeps to the rest");
    }

    fn check(&self) {
        let mut pending = 0;
        for agent in 0..self.robots.len() {
            let actions: u32 = self.adg.nodes(agent).map(|node| node.actions).sum();
            assert_eq!(self.adg.actions_left(agent), actions);
            pending += self.adg.nodes(agent).count();
        }
        assert_eq!(self.adg.pending(), pending);
        assert!(self.adg.is_acyclic());
    }

    /// Some robots may be held, and are told later.
    fn enqueue(&mut self) {
        let hold = |_| self.chance.unit() < 0.2;
        let held: Vec<bool> = (0..self.robots.len()).map(hold).collect();
        let robots = &mut self.robots;
        let mut last = 0;
        let is_held = |agent: usize| held[agent];
        self.adg.enqueue_but(QUEUE, &is_held, &mut |agent, node| {
            assert!(agent >= last, "agents ascend");
            assert!(!held[agent]);
            last = agent;
            robots[agent].told.push_back(*node);
        });
        for (agent, robot) in self.robots.iter().enumerate() {
            let (done, enqueued) = self.adg.progress(agent);
            assert!(enqueued - done <= QUEUE);
            let open = robot.told.len() as u32 + u32::from(robot.under_way.is_some());
            assert_eq!(robot.done + open, enqueued);
        }
    }

    /// Some robots begin or end a move.
    fn drive(&mut self) {
        for _ in 0..2 * self.robots.len() {
            let agent = self.chance.below(self.robots.len());
            let robot = &mut self.robots[agent];
            if let Some(node) = robot.under_way {
                if node.cell != robot.cell && !std::mem::replace(&mut robot.left, true) {
                    self.inside[robot.cell as usize] = None;
                    if self.chance.unit() < 0.5 {
                        continue;
                    }
                }
                (robot.under_way, robot.left) = (None, false);
                robot.cell = node.cell;
                robot.done += 1;
            } else if let Some(node) = robot.told.pop_front() {
                let inside = &mut self.inside[node.cell as usize];
                if node.cell == robot.cell {
                    assert_eq!(*inside, Some(agent));
                } else {
                    assert_eq!(*inside, None, "two robots in one cell");
                    *inside = Some(agent);
                    let (known, _) = self.adg.progress(agent);
                    let planned = robot.planned[(robot.done - known) as usize];
                    let entered = &mut self.entered[node.cell as usize];
                    assert!(*entered < planned, "passing order is that of the plan");
                    *entered = planned;
                    let (here, there) = (robot.cell, node.cell);
                    let apart = self.walks.grid.row_col(here);
                    let beside = self.walks.grid.row_col(there);
                    assert_eq!(apart.0.abs_diff(beside.0) + apart.1.abs_diff(beside.1), 1);
                }
                robot.under_way = Some(node);
            }
        }
    }

    /// News of some robots, in two orders that come to the same.
    fn report(&mut self, share: f64) {
        let mut news = Vec::new();
        for (agent, robot) in self.robots.iter().enumerate() {
            if self.chance.unit() < share {
                let left = robot.done + u32::from(robot.left);
                news.push((agent, robot.done, left));
                // Late and repeated ones.
                if self.chance.unit() < 0.3 {
                    let earlier = robot.done.saturating_sub(2);
                    news.push((agent, robot.done, left));
                    news.push((agent, earlier, robot.done.min(earlier + 1)));
                }
            }
        }
        let mut twin = self.adg.clone();
        let mut shuffled = news.clone();
        self.chance.shuffle(&mut shuffled);
        for (agent, done, left) in shuffled {
            twin.complete(agent, done, left, &mut |_| {});
        }
        for (agent, done, left) in news {
            let (robot, goals) = (&mut self.robots[agent], &self.goals[agent]);
            self.adg.complete(agent, done, left, &mut |node| {
                robot.planned.pop_front();
                robot.known = node.cell;
                if let Some(goal) = node.goal {
                    assert_eq!(goal, robot.next_goal, "goals are reached in order");
                    assert_eq!(node.cell, goals[goal as usize]);
                    robot.next_goal += 1;
                }
            });
        }
        let cells = self.walks.grid.cell_count();
        assert_eq!(state(&twin, cells), state(&self.adg, cells));
        let told = |adg: &mut Adg| {
            let mut told = Vec::new();
            adg.enqueue(QUEUE, &mut |agent, node| told.push((agent, *node)));
            told
        };
        assert_eq!(told(&mut twin), told(&mut self.adg.clone()));
    }

    /// Everything that is pending gets done.
    fn finish(&mut self) {
        let most = 20 * self.adg.pending() + 100;
        for _ in 0..most {
            if self.adg.pending() == 0 {
                break;
            }
            self.enqueue();
            self.drive();
            self.report(0.9);
        }
        assert_eq!(self.adg.pending(), 0, "a deadlock");
    }
}

fn maps() -> impl Strategy<Value = Grid> {
    let size = (2..8u32, 2..8u32);
    size.prop_flat_map(|(rows, cols)| {
        let cells = (rows * cols) as usize;
        let walls = prop::collection::vec(prop::bool::weighted(0.15), cells);
        walls.prop_map(move |walls| {
            let letter = |wall| if wall { b'@' } else { b'.' };
            let mut terrain: Vec<u8> = walls.into_iter().map(letter).collect();
            terrain[0] = b'.';
            Grid::new("any", rows, cols, terrain).unwrap()
        })
    })
}

proptest! {
    #![proptest_config(ProptestConfig {
        cases: 192,
        failure_persistence: None,
        ..ProptestConfig::default()
    })]

    #[test]
    fn whatever_robots_do_they_keep_apart_and_arrive(
        grid in maps(),
        share in 0.1..1.0f64,
        seed in any::<u64>(),
        rings in prop_oneof![Just(0.0), Just(0.5)],
        dwell in 0..2u32,
        rounds in prop::collection::vec((1..12usize, 0..6u32, 0..10u32, 0..8usize, 0.1..1.0f64), 1..10),
    ) {
        let agents = (f64::from(grid.passable_count()) * share).ceil() as usize;
        let costs = Costs { quarter_turn: 1, dwell };
        let mut yard = Yard::new(grid, agents, seed, rings, costs);
        for (steps, window, lookahead, blocks, reported) in rounds {
            let appended = yard.append(steps, window);
            prop_assert!(rings > 0.0 || appended.rings_cut == 0);
            prop_assert!(appended.rings_cut == 0 || appended.stopped >= 3);
            for _ in 0..blocks {
                yard.enqueue();
                yard.drive();
                yard.report(reported);
            }
            // Either kind of cut may follow on the other.
            match lookahead % 2 {
                0 => yard.cut(lookahead),
                _ => yard.cut_within(f64::from(lookahead), f64::from(lookahead / 3)),
            }
            // Robots go on while somebody plans.
            for _ in 0..blocks / 2 {
                yard.enqueue();
                yard.drive();
                yard.report(reported);
            }
        }
        yard.finish();
    }
}

#[test]
fn memory_is_that_of_what_is_pending() {
    let mut yard = Yard::new(open(12, 12), 60, 7, 0.1, Costs::default());
    let mut early = 0;
    for round in 0..3000 {
        yard.append(4, 0);
        for _ in 0..3 {
            yard.enqueue();
            yard.drive();
            yard.report(0.9);
        }
        yard.cut(2);
        if round == 100 {
            early = yard.adg.memory_bytes();
        }
    }
    assert!(yard.batches == 3000 && yard.robots.iter().all(|robot| robot.done > 1000));
    let late = yard.adg.memory_bytes();
    assert!(late <= 2 * early, "{early} bytes have become {late}");
}

#[test]
fn moves_count_quarter_turns_and_dwelling() {
    let grid = open(3, 3);
    let costs = Costs {
        quarter_turn: 1,
        dwell: 1,
    };
    let mut adg = Adg::new(&grid, &[0], &north(1), costs).unwrap();
    // East, east, back west, and south with a wait in between.
    let batch = batch(&grid, &[&[0, 1, 2, 1, 1, 4]]);
    let goals = [2, 2, 4];
    adg.append(&batch, &mut |_, index| {
        *goals.get(index as usize).unwrap_or(&OFF_MAP)
    })
    .unwrap();
    let node = |cell, actions, goal| Node {
        cell,
        actions,
        goal,
    };
    let nodes: Vec<Node> = adg.nodes(0).copied().collect();
    let expected = [
        node(1, 2, None),
        node(2, 2, Some(0)),
        // The same goal again is reached without leaving the cell.
        node(2, 1, Some(1)),
        node(1, 3, None),
        node(4, 3, Some(2)),
    ];
    assert_eq!(nodes, expected);
    assert_eq!(adg.actions_left(0), 11);
    // Three actions are those of two nodes.
    let cut = adg.clone().cut(3);
    assert_eq!((cut.cells[0], cut.headings[0]), (2, Heading::East));
    assert_eq!((cut.next_goal[0], cut.dropped), (1, 3));
    let cut = adg.cut(0);
    assert_eq!(
        (cut.cells[0], cut.headings[0], cut.dropped),
        (0, Heading::North, 5)
    );
    assert_eq!((adg.actions_left(0), adg.pending()), (0, 0));

    let free = Costs {
        quarter_turn: 0,
        dwell: 0,
    };
    let mut adg = Adg::new(&grid, &[0], &north(1), free).unwrap();
    adg.append(&batch, &mut no_goals).unwrap();
    assert_eq!(adg.actions_left(0), 4);
}

#[test]
fn a_goal_where_a_batch_begins_is_reached_there() {
    let grid = open(1, 3);
    let mut adg = Adg::new(&grid, &[1], &north(1), Costs::default()).unwrap();
    let mut goals = |_: usize, index: u32| if index == 0 { 1 } else { OFF_MAP };
    adg.append(&batch(&grid, &[&[1]]), &mut goals).unwrap();
    let mut told = Vec::new();
    adg.enqueue(5, &mut |_, node| told.push(*node));
    assert_eq!(
        told,
        [Node {
            cell: 1,
            actions: 0,
            goal: Some(0)
        }]
    );
    let mut done = Vec::new();
    adg.complete(0, 1, 1, &mut |node| done.push(*node));
    assert_eq!(done, told);
    // And it leaves from there.
    adg.append(&batch(&grid, &[&[1, 2]]), &mut goals).unwrap();
    assert_eq!(adg.visitors(1).collect::<Vec<_>>(), [0]);
    adg.enqueue(5, &mut |_, node| told.push(*node));
    adg.complete(0, 2, 2, &mut |node| done.push(*node));
    assert_eq!((done.len(), adg.pending()), (2, 0));
    assert_eq!(adg.visitors(1).count(), 0);
}

#[test]
fn who_follows_waits_until_the_cell_is_left() {
    let grid = open(1, 4);
    let mut adg = Adg::new(&grid, &[1, 0], &north(2), Costs::default()).unwrap();
    adg.append(&batch(&grid, &[&[1, 2, 3], &[0, 1, 2]]), &mut no_goals)
        .unwrap();
    let mut told = Vec::new();
    adg.enqueue(5, &mut |agent, node| told.push((agent, node.cell)));
    assert_eq!(told, [(0, 2), (0, 3)]);
    adg.complete(0, 1, 1, &mut |_| {});
    adg.enqueue(5, &mut |agent, node| told.push((agent, node.cell)));
    assert_eq!(told[2..], [(1, 1)]);
    // Old news, and news of what was never sent.
    adg.complete(0, 0, 0, &mut |_| panic!("nothing new"));
    adg.complete(0, 99, 99, &mut |node| assert_eq!(node.cell, 3));
    adg.complete(0, 99, 99, &mut |_| panic!("nothing new"));
    adg.enqueue(5, &mut |agent, node| told.push((agent, node.cell)));
    assert_eq!(told[3..], [(1, 2)]);
}

#[test]
fn who_follows_may_go_when_the_cell_is_left_before_the_next_one_is_reached() {
    let grid = open(1, 4);
    let mut adg = Adg::new(&grid, &[1, 0], &north(2), Costs::default()).unwrap();
    adg.append(&batch(&grid, &[&[1, 2, 3], &[0, 1, 2]]), &mut no_goals)
        .unwrap();
    let mut told = Vec::new();
    adg.enqueue(5, &mut |agent, node| told.push((agent, node.cell)));
    adg.complete(0, 0, 1, &mut |_| panic!("nothing is done"));
    assert_eq!((adg.progress(0), adg.pending()), ((0, 2), 4));
    adg.enqueue(5, &mut |agent, node| told.push((agent, node.cell)));
    assert_eq!(told, [(0, 2), (0, 3), (1, 1)]);
    // Nobody is told of it twice, and what is done is the same in the end.
    adg.complete(0, 0, 1, &mut |_| panic!("nothing is done"));
    let mut done = 0;
    adg.complete(0, 2, 2, &mut |_| done += 1);
    adg.enqueue(5, &mut |agent, node| told.push((agent, node.cell)));
    adg.complete(1, 2, 2, &mut |_| done += 1);
    assert_eq!((done, told.len(), adg.pending()), (4, 4, 0));
}

/// Otherwise a plan that is made anew every second would never begin to turn about.
#[test]
fn a_turn_that_takes_steps_begins_with_the_first_of_them() {
    let grid = open(1, 4);
    let west = vec![Heading::West];
    let mut adg = Adg::new(&grid, &[0], &west, Costs::default()).unwrap();
    let instance = Instance {
        headings: Some(west),
        motion: Motion::Rotation,
        ..Instance::one_shot(vec![0], vec![2])
    };
    let plan = GridPlan::from_paths([[0, 0, 0, 1, 2]]);
    let batch = judge(&grid, &instance, plan).expect("the batch is valid");
    adg.append(&batch, &mut no_goals).unwrap();
    assert_eq!(adg.cut_within(0.5, 0.0, &PACE).cells, [1]);
}

/// A cell closes only where nobody is, was told to come, or is to come.
#[test]
fn cells_are_held_by_who_is_there_and_who_was_told() {
    let grid = open(1, 6);
    let mut adg = Adg::new(&grid, &[1, 0], &north(2), Costs::default()).unwrap();
    adg.append(&batch(&grid, &[&[1, 2, 3], &[0, 1, 2]]), &mut no_goals)
        .unwrap();
    let held = |adg: &Adg, planned| -> Vec<u32> {
        let cells = (0..10).filter(|cell| adg.is_held(*cell, planned));
        cells.collect()
    };
    let leads = |adg: &Adg| -> Vec<u32> {
        let cells = (0..10).filter(|cell| adg.leads_into(&|one| one == *cell));
        cells.collect()
    };
    assert_eq!(
        (held(&adg, false), leads(&adg)),
        (vec![0, 1], vec![1, 2, 3])
    );
    assert_eq!(held(&adg, true), [0, 1, 2, 3]);
    adg.enqueue(1, &mut |_, _| {});
    // One is told of cell 2, into which the other is to go as well.
    assert_eq!(
        (held(&adg, false), leads(&adg)),
        (vec![0, 1, 2], vec![1, 2, 3])
    );
    // It has left its cell, which the other was not told of.
    adg.complete(0, 0, 1, &mut |_| {});
    assert_eq!(
        (held(&adg, false), held(&adg, true)),
        (vec![0, 2], vec![0, 1, 2, 3])
    );
    // Who is held is told nothing, and what it was to be told as soon as it is not.
    let mut told = Vec::new();
    adg.enqueue_but(1, &|agent| agent == 1, &mut |agent, node| {
        told.push((agent, node.cell));
    });
    assert_eq!(told, []);
    adg.enqueue(1, &mut |agent, node| told.push((agent, node.cell)));
    assert_eq!(told, [(1, 1)]);
    assert_eq!(
        (held(&adg, false), leads(&adg)),
        (vec![0, 1, 2], vec![2, 3])
    );
    adg.complete(0, 1, 1, &mut |_| {});
    adg.complete(1, 1, 1, &mut |_| {});
    adg.enqueue(1, &mut |_, _| {});
    adg.complete(0, 2, 2, &mut |_| {});
    assert_eq!((held(&adg, false), leads(&adg)), (vec![1, 3], vec![2]));
    assert_eq!(held(&adg, true), [1, 2, 3]);
}

#[test]
fn many_robots_are_held_and_told_each_by_itself() {
    let grid = open(2, 130);
    let starts: Vec<u32> = (0..130).collect();
    let mut adg = Adg::new(&grid, &starts, &north(130), Costs::default()).unwrap();
    let paths: Vec<[u32; 2]> = starts.iter().map(|cell| [*cell, cell + 130]).collect();
    let paths: Vec<&[u32]> = paths.iter().map(|path| &path[..]).collect();
    adg.append(&batch(&grid, &paths), &mut no_goals).unwrap();
    let told = |adg: &mut Adg, is_held: &dyn Fn(usize) -> bool| {
        let mut told = Vec::new();
        adg.enqueue_but(3, is_held, &mut |agent, _| told.push(agent));
        told
    };
    let thirds = |rest| {
        (0..130)
            .filter(|agent| agent % 3 == rest)
            .collect::<Vec<_>>()
    };
    assert_eq!(told(&mut adg, &|agent| agent % 3 != 0), thirds(0));
    assert_eq!(told(&mut adg, &|agent| agent % 3 != 1), thirds(1));
    assert_eq!(told(&mut adg, &|_| false), thirds(2));
    assert_eq!(told(&mut adg, &|_| false), [0; 0]);
}

#[test]
fn memory_is_counted() {
    let grid = open(30, 40);
    let starts: Vec<u32> = (0..100).collect();
    let mut adg = Adg::new(&grid, &starts, &north(100), Costs::default()).unwrap();
    // Two words of flags and a byte of fate for each agent, beside what the module's head says.
    let few = 1200 * 12 + 100 * (40 + VISIT) + 16 + 100;
    assert_eq!(adg.memory_bytes(), few);
    let paths: Vec<Vec<u32>> = (0..100)
        .map(|start| {
            (0..20)
                .map(|row| start % 40 + 40 * (start / 40 + row))
                .collect()
        })
        .collect();
    let paths: Vec<&[u32]> = paths.iter().map(Vec::as_slice).collect();
    let appended = adg.append(&batch(&grid, &paths), &mut no_goals).unwrap();
    assert_eq!(appended.nodes, 1900);
    // Room for twice as many at most, and 16 bytes an agent for what calls need.
    let many = few + 1900 * VISIT;
    let found = adg.memory_bytes();
    assert!(
        (many..=few + 3900 * VISIT + 1600).contains(&found),
        "{found} {many}"
    );
    let before = adg.memory_bytes();
    adg.cut(0);
    assert_eq!(adg.pending(), 0);
    // What is dropped is kept for others: four bytes of each.
    let kept = adg.memory_bytes() - before;
    assert!((1900 * 4..=4000 * 4).contains(&kept), "{kept}");
}

#[test]
fn a_robot_has_at_most_so_many_nodes_at_a_time() {
    let grid = open(1, 9);
    let mut adg = Adg::new(&grid, &[0], &north(1), Costs::default()).unwrap();
    adg.append(&batch(&grid, &[&[0, 1, 2, 3, 4, 5, 6]]), &mut no_goals)
        .unwrap();
    let cells = |adg: &mut Adg| {
        let mut cells = Vec::new();
        adg.enqueue(2, &mut |_, node| cells.push(node.cell));
        cells
    };
    assert_eq!(cells(&mut adg), [1, 2]);
    assert_eq!(cells(&mut adg), [0; 0]);
    adg.complete(0, 1, 1, &mut |_| {});
    assert_eq!(cells(&mut adg), [3]);
    adg.complete(0, 3, 3, &mut |_| {});
    assert_eq!(cells(&mut adg), [4, 5]);
    assert_eq!(adg.progress(0), (3, 5));
    // What is enqueued stays, whatever the look-ahead is.
    assert_eq!(adg.cut(0).cells, [5]);
}

#[test]
fn a_cut_keeps_what_has_to_be_done_before() {
    let grid = open(2, 4);
    let mut adg = Adg::new(
        &grid,
        &[0, 5, 2],
        &north(3),
        Costs {
            quarter_turn: 0,
            dwell: 0,
        },
    )
    .unwrap();
    // Agent 0 needs agent 1 out of its way, which needs agent 2 out of its own.
    let paths: [&[u32]; 3] = [
        &[0, 0, 0, 0, 1, 2],
        &[5, 1, 1, 2, 2, 3],
        &[2, 3, 7, 7, 7, 6],
    ];
    adg.append(&batch(&grid, &paths), &mut no_goals).unwrap();
    let cut = adg.cut(1);
    assert_eq!(cut.cells, [1, 2, 3]);
    assert_eq!(adg.visitors(2).collect::<Vec<_>>(), [2, 1]);
}

#[test]
fn a_cut_in_time_keeps_what_begins_before_its_end() {
    let grid = open(3, 6);
    let mut adg = Adg::new(&grid, &[6, 0, 12], &north(3), Costs::default()).unwrap();
    // Agent 0 turns east (2 s) and sets out, agent 1 drives behind it into its row after
    // turning about, agent 2 goes north behind both.
    let paths: [&[u32]; 3] = [
        &[6, 7, 8, 9, 10, 11],
        &[0, 0, 6, 7, 8, 9],
        &[12, 12, 12, 6, 6, 6],
    ];
    adg.append(&batch(&grid, &paths), &mut no_goals).unwrap();
    let ends = |horizon_s| adg.clone().cut_within(horizon_s, 1.0, &PACE).cells;
    assert_eq!(ends(0.0), [6, 0, 12]);
    // Everybody who waits for nobody begins at once.
    assert_eq!(ends(0.1), [7, 0, 12]);
    // Agent 0 is in cell 7 after 3 s, and in another one every half a second from then on.
    assert_eq!(ends(3.0), [7, 0, 12]);
    assert_eq!(ends(3.1), [8, 6, 12]);
    assert_eq!(ends(3.6), [9, 6, 12]);
    // Agent 1 turns twice and sets out, 5 s, and is in cell 6 after 8 s; then it turns.
    assert_eq!(ends(8.0), [11, 6, 12]);
    assert_eq!(ends(8.1), [11, 7, 12]);
    assert_eq!(ends(11.1), [11, 8, 6]);
    assert_eq!(ends(1e9), [11, 9, 6]);
}

#[test]
fn a_cut_in_time_counts_dwelling() {
    let grid = open(1, 5);
    let mut adg = Adg::new(&grid, &[0], &[Heading::East], Costs::default()).unwrap();
    // Two goals in cell 1, a second of dwelling at each.
    let mut goals = |_: usize, index: u32| if index < 2 { 1 } else { OFF_MAP };
    adg.append(&batch(&grid, &[&[0, 1, 2, 3]]), &mut goals)
        .unwrap();
    let told = |horizon_s| {
        let cut = adg.clone().cut_within(horizon_s, 100.0, &PACE);
        (cut.cells[0], cut.next_goal[0])
    };
    assert_eq!(told(0.0), (0, 0));
    // It drives half a second, for it has nothing to turn, and is at its first goal until 1.5 s.
    assert_eq!(told(0.1), (1, 1));
    assert_eq!(told(1.5), (1, 1));
    assert_eq!(told(1.6), (1, 2));
    assert_eq!(told(2.5), (1, 2));
    assert_eq!(told(2.6), (2, 2));
    assert_eq!(told(3.0), (2, 2));
    assert_eq!(told(3.1), (3, 2));
}

#[test]
fn rings_are_cut_with_all_who_come_behind() {
    let grid = open(2, 5);
    let starts = [0, 1, 6, 5, 7, 8, 4];
    let mut adg = Adg::new(&grid, &starts, &north(7), Costs::default()).unwrap();
    let paths: [&[u32]; 7] = [
        // Four go round in a ring at the second step.
        &[0, 0, 1, 2, 2, 2, 2],
        &[1, 1, 6, 6, 1, 1, 1],
        &[6, 6, 5, 5, 5, 5, 5],
        &[5, 5, 0, 0, 0, 0, 0],
        // Two would come to where they are then not gone from.
        &[7, 7, 7, 7, 7, 6, 6],
        &[8, 8, 8, 8, 8, 8, 7],
        // And one is elsewhere.
        &[4, 4, 4, 4, 4, 4, 3],
    ];
    let appended = adg.append(&batch(&grid, &paths), &mut no_goals).unwrap();
    let expected = Appended {
        nodes: 1,
        rings_cut: 1,
        stopped: 6,
    };
    assert_eq!(appended, expected);
    let ends: Vec<u32> = (0..7).map(|agent| adg.end(agent)).collect();
    assert_eq!(ends, [0, 1, 6, 5, 7, 8, 3]);
}

#[test]
fn what_does_not_fit_is_refused_and_changes_nothing() {
    let grid = Grid::new("wall", 1, 4, b"..@.".to_vec()).unwrap();
    let new = |starts: &[u32], headings: usize| {
        Adg::new(&grid, starts, &north(headings), Costs::default()).map(|_| ())
    };
    assert_eq!(
        new(&[0, 1], 1),
        Err(AdgError::LengthMismatch {
            starts: 2,
            headings: 1
        })
    );
    assert_eq!(
        new(&[0, 2], 2),
        Err(AdgError::Blocked { agent: 1, cell: 2 })
    );
    assert_eq!(
        new(&[0, 9], 2),
        Err(AdgError::Blocked { agent: 1, cell: 9 })
    );
    assert_eq!(
        new(&[0, 0], 2),
        Err(AdgError::Occupied {
            first: 0,
            agent: 1,
            cell: 0
        })
    );
    let mut adg = Adg::new(&grid, &[0, 3], &north(2), Costs::default()).unwrap();
    let wrong = adg.append(&batch(&grid, &[&[0, 1]]), &mut no_goals);
    assert_eq!(
        wrong,
        Err(AdgError::WrongAgents {
            found: 1,
            agents: 2
        })
    );
    let wrong = adg.append(&batch(&grid, &[&[1, 0], &[3]]), &mut no_goals);
    assert_eq!(
        wrong,
        Err(AdgError::WrongStart {
            agent: 0,
            found: 1,
            end: 0
        })
    );
    assert_eq!(adg.pending(), 0);
    assert!(adg.is_acyclic());
}
