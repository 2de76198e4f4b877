//! The planner.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use fleetyard_abi::sdk::{self, Failure, Options, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, GridPlan, Heading, Instance, Kind, LogLevel,
    Motion, Objective, SharedEnvironment, Status, c, monotonic_ns,
};

use crate::{Choice, Mistake};

const HOUR: Duration = Duration::from_hours(1);

/// Agents go at once or one after the other.
pub(crate) struct Planner {
    choice: Choice,
    map: Map,
    prepared: bool,
    cancelled: bool,
    answers: BTreeMap<usize, GridPlan>,
    /// Calls with memory.
    reminded: usize,
}

#[derive(Default)]
struct Map {
    cols: u32,
    passable: Vec<bool>,
    /// Masks of moves.
    moves: Vec<u8>,
    diagonal: bool,
}

impl Map {
    fn near(&self, cell: u32, diagonal: bool, walls: bool) -> Vec<u32> {
        let (rows, cols) = (self.passable.len() as u32 / self.cols, self.cols);
        let (row, col) = (cell / cols, cell % cols);
        let mut near = Vec::new();
        for (rows_on, cols_on) in [
            (0, 1),
            (1, 2),
            (2, 1),
            (1, 0),
            (0, 0),
            (0, 2),
            (2, 0),
            (2, 2),
        ] {
            let is_diagonal = rows_on != 1 && cols_on != 1;
            let (row, col) = (row + rows_on, col + cols_on);
            // Counted from one, so that nothing is below zero.
            let inside = row >= 1 && col >= 1 && row <= rows && col <= cols;
            if inside && (diagonal || !is_diagonal) {
                let to = (row - 1) * cols + col - 1;
                let one_way = match (rows_on, cols_on) {
                    (0, 1) => c::MOVE_NORTH,
                    (1, 2) => c::MOVE_EAST,
                    (2, 1) => c::MOVE_SOUTH,
                    (1, 0) => c::MOVE_WEST,
                    _ => u8::MAX,
                };
                let open = self.passable[to as usize] && self.moves[cell as usize] & one_way != 0;
                if walls || open {
                    near.push(to);
                }
            }
        }
        near
    }

    /// A shortest way round the cells where somebody stands, without its first cell.
    fn way(&self, from: u32, to: u32, standing: &BTreeSet<u32>, walls: bool) -> Option<Vec<u32>> {
        let mut came = BTreeMap::from([(from, from)]);
        let mut queue = VecDeque::from([from]);
        while let Some(cell) = queue.pop_front() {
            if cell == to {
                let mut way = Vec::new();
                let mut at = to;
                while at != from {
                    way.push(at);
                    at = came[&at];
                }
                way.reverse();
                return Some(way);
            }
            for next in self.near(cell, self.diagonal, walls) {
                if !standing.contains(&next) && !came.contains_key(&next) {
                    came.insert(next, cell);
                    queue.push_back(next);
                }
            }
        }
        None
    }
}

static MADE: AtomicBool = AtomicBool::new(false);

impl Plugin for Planner {
    fn descriptor() -> Descriptor {
        let claims = Capability::ALL.iter().copied().filter(|claim| {
            !matches!(
                claim,
                Capability::Roadmap
                    | Capability::Continuous
                    | Capability::StopGo
                    | Capability::Slower
                    | Capability::Dynamics
                    | Capability::Heterogeneous
            )
        });
        Descriptor {
            capabilities: Capabilities::of(&claims.collect::<Vec<_>>()),
            features: [c::GOAL_TASKS_ID, c::KEPT_ID]
                .map(|part| format!("part:{part}"))
                .to_vec(),
            ..Choice::descriptor(Kind::Planner, "promising")
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        let choice = Choice::read(options)?;
        if choice.mistake == Mistake::MadeOnce && MADE.swap(true, Ordering::Relaxed) {
            return Err(Failure::new(Status::InternalError, "made once already"));
        }
        Ok(Self {
            choice,
            map: Map::default(),
            prepared: false,
            cancelled: false,
            answers: BTreeMap::new(),
            reminded: 0,
        })
    }
}

impl Drop for Planner {
    fn drop(&mut self) {
        if self.choice.mistake == Mistake::LingersAtEnd {
            std::thread::sleep(HOUR);
        }
    }
}

impl sdk::Planner for Planner {
    // It keeps the map by itself, and so may keep an old one.
    type Map = ();

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<(), Failure> {
        let grid = environment
            .grid()
            .ok_or_else(|| Failure::new(Status::Unsupported, "no grid"))?;
        match self.choice.mistake {
            Mistake::OldMap if self.prepared => return Ok(()),
            Mistake::SlowPrepare if grid.passable.len() > 10_000 => std::thread::sleep(HOUR),
            Mistake::NoOneCell if grid.passable.len() == 1 => {
                return Err(Failure::new(Status::Unsupported, "too small"));
            }
            Mistake::RefusesParts if !environment.parts.is_empty() => {
                return Err(Failure::new(Status::InvalidInput, "what is this?"));
            }
            _ => {}
        }
        self.prepared = true;
        self.map = Map {
            cols: grid.cols,
            passable: grid.passable.iter().map(|free| *free != 0).collect(),
            moves: match self.choice.mistake {
                Mistake::IgnoresArrows => vec![u8::MAX; grid.passable.len()],
                _ => grid.moves.clone(),
            },
            diagonal: grid.connectivity == 8 && self.choice.mistake == Mistake::CutsCorners,
        };
        Ok(())
    }

    fn plan(
        &mut self,
        (): &mut (),
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let mistake = self.choice.mistake;
        let stay = || GridPlan::from_paths(instance.starts.iter().map(|start| [*start]));
        self.check(instance, budget, sink)?;
        match mistake {
            Mistake::LimitedByNodesLies if budget.nodes == 1 => {
                sink.submit(&stay())?;
                return Ok(());
            }
            Mistake::SeesThroughWalls if instance.motion == Motion::AnyAngle => {
                let lines = instance.starts.iter().zip(instance.goals.iter());
                let lines = lines.map(|(start, goals)| [*start, goals[0]]);
                sink.submit(&GridPlan::from_paths(lines))?;
                return Ok(());
            }
            Mistake::OldAnswer => {
                if let Some(plan) = self.answers.get(&instance.agents()) {
                    sink.submit(plan)?;
                    return Ok(());
                }
            }
            _ => {}
        }
        match self.solve(instance) {
            Ok(mut steps) => {
                if mistake == Mistake::PlansForTheGallery && sink.annotations().is_some() {
                    steps.insert(0, steps[0].clone());
                }
                if mistake == Mistake::Unseeded {
                    let waits = monotonic_ns() % 20_011;
                    let first = steps[0].clone();
                    steps.splice(0..0, (0..waits).map(|_| first.clone()));
                }
                if instance.goal_tasks().is_some() {
                    self.reminded += 1;
                    if mistake == Mistake::RemembersCalls && self.reminded > 1 {
                        steps.insert(0, steps[0].clone());
                    }
                }
                let plan = plan_of(&steps);
                sink.submit(&plan)?;
                sink.keep(b"answered")?;
                if mistake == Mistake::WorseLater && instance.agents() >= 25 {
                    steps.insert(0, steps[0].clone());
                    sink.submit(&plan_of(&steps))?;
                }
                self.answers.insert(instance.agents(), plan);
                Ok(())
            }
            Err(failure) => {
                let left = self.shortest(instance, mistake == Mistake::LeavesNonsense);
                sink.submit(&left)?;
                if mistake == Mistake::SwapsPlaces {
                    return Ok(());
                }
                Err(failure)
            }
        }
    }
}

impl Planner {
    /// Refuses instances that are wrong before anything is planned.
    fn check(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let failed = |status, reason: &str| Err(Failure::new(status, reason));
        let mistake = self.choice.mistake;
        let blocked = |cell: &u32| {
            !self
                .map
                .passable
                .get(*cell as usize)
                .is_some_and(|free| *free)
        };
        let different: BTreeSet<u32> = instance.starts.iter().copied().collect();
        let everybody_home = instance
            .starts
            .iter()
            .zip(instance.goals.iter())
            .all(|(start, goals)| goals == [*start]);
        if instance
            .starts
            .iter()
            .chain(instance.goals.items())
            .any(blocked)
            || different.len() < instance.agents()
        {
            if mistake == Mistake::DiesOfBadInput {
                std::process::abort();
            }
            if mistake != Mistake::OldMap {
                return failed(Status::InvalidInput, "an agent cannot be where it is to be");
            }
        }
        if mistake == Mistake::StaleCancel && self.cancelled {
            return failed(Status::Cancelled, "cancelled some time ago");
        }
        match mistake {
            Mistake::Deaf if instance.agents() >= 40 => std::thread::sleep(HOUR),
            Mistake::Chatters => {
                for _ in 0..2000 {
                    sink.log(LogLevel::Debug, "still here");
                }
            }
            Mistake::Leaks => {
                Box::leak(vec![1_u8; 8 << 20].into_boxed_slice());
            }
            Mistake::DiesOfBytes if instance.kept().is_some_and(|kept| kept.bytes.len() == 7) => {
                std::process::abort();
            }
            Mistake::SpinsThreads => spin(budget, sink),
            Mistake::NothingToDoFails if everybody_home => {
                return failed(Status::Infeasible, "there is nothing to do");
            }
            Mistake::NoMakespan if instance.objective == Objective::Makespan => {
                return failed(Status::Infeasible, "not by makespan");
            }
            Mistake::ShortSeeds if budget.seed > u32::MAX.into() => {
                return failed(Status::InternalError, "so large a seed");
            }
            Mistake::OneThreadOnly if budget.threads > 1 => {
                return failed(Status::InternalError, "too many threads");
            }
            _ => {}
        }
        if sink.cancelled() {
            self.cancelled = true;
            return failed(Status::TimedOut, "no time");
        }
        Ok(())
    }

    /// The positions of all agents, step by step.
    fn solve(&self, instance: &Instance) -> Result<Vec<Vec<u32>>, Failure> {
        let mistake = self.choice.mistake;
        let alone = instance.agents() == 1;
        if alone && mistake == Mistake::OneAgentJumps && instance.goals[0] != instance.starts {
            let goal = instance.goals[0][0];
            return Ok(vec![instance.starts.clone(), vec![goal]]);
        }
        let blind = mistake == Mistake::WindowBlind && instance.window_steps > 0;
        let tight = mistake == Mistake::TooTight || self.choice.k == 0;
        if instance.motion == Motion::Pebble && (tight || blind) {
            let at_once = steps_of(&self.shortest(instance, false));
            let careless = blind || mistake == Mistake::IgnoresOthers;
            let visits_all = instance.goals.iter().all(|goals| goals.len() == 1) || blind;
            if self.reaches(instance) && visits_all && (careless || nobody_meets(&at_once)) {
                let followed = followed(&at_once);
                if mistake == Mistake::FollowsNobody && followed {
                    return Err(Failure::new(Status::Infeasible, "nobody can follow"));
                }
                return Ok(at_once);
            }
        }
        self.one_by_one(instance)
    }

    /// True if every agent could reach its goals with nobody in the way.
    fn reaches(&self, instance: &Instance) -> bool {
        let mut ways = instance.starts.iter().zip(instance.goals.iter());
        ways.all(|(start, goals)| {
            goals.iter().all(|goal| {
                self.map
                    .way(*start, *goal, &BTreeSet::new(), false)
                    .is_some()
            })
        })
    }

    /// Everybody's shortest path to all goals, or a jump to the last.
    fn shortest(&self, instance: &Instance, jump: bool) -> GridPlan {
        let path = |(start, goals): (&u32, &[u32])| {
            let mut path = vec![*start];
            for goal in goals {
                let at = path[path.len() - 1];
                let way = self.map.way(at, *goal, &BTreeSet::new(), false);
                path.extend(if jump {
                    vec![*goal]
                } else {
                    way.unwrap_or_default()
                });
            }
            path
        };
        GridPlan::from_paths(instance.starts.iter().zip(instance.goals.iter()).map(path))
    }

    fn one_by_one(&self, instance: &Instance) -> Result<Vec<Vec<u32>>, Failure> {
        let mistake = self.choice.mistake;
        let mut walk = Walk {
            steps: vec![instance.starts.clone()],
            headings: instance.headings.clone(),
            cols: self.map.cols,
            turns: mistake != Mistake::TurnsInNoTime,
        };
        let mut waiting: VecDeque<(usize, usize)> =
            (0..instance.agents()).map(|a| (a, 0)).collect();
        let mut tries = 0;
        while let Some((agent, visited)) = waiting.pop_front() {
            let goals = &instance.goals[agent];
            let Some(goal) = goals.get(visited).copied() else {
                continue;
            };
            let at = walk.now()[agent];
            let mut standing: BTreeSet<u32> = walk.now().iter().copied().collect();
            standing.remove(&at);
            let shared = instance
                .goals
                .iter()
                .filter(|other| other.last() == Some(&goal));
            if mistake == Mistake::ParksTogether && shared.count() > 1 {
                standing.remove(&goal);
            }
            if mistake == Mistake::IdleAgentBlocks {
                let idle = (0..instance.agents()).filter(|other| instance.goals[*other].is_empty());
                for other in idle {
                    standing.remove(&walk.now()[other]);
                }
            }
            let nobody = BTreeSet::new();
            if self.map.way(at, goal, &nobody, false).is_none() {
                if mistake != Mistake::ThroughWalls {
                    return Err(Failure::new(Status::Infeasible, "there is no way"));
                }
                walk.go(
                    agent,
                    &self.map.way(at, goal, &nobody, true).unwrap_or_default(),
                );
                continue;
            }
            match self.map.way(at, goal, &standing, false) {
                Some(way) => {
                    walk.go(agent, &way);
                    for _ in 0..self.choice.k {
                        walk.wait();
                    }
                    // The next goal at once: on a goal it may be in the way.
                    waiting.push_front((agent, visited + 1));
                    tries = 0;
                }
                None if tries > waiting.len() => {
                    return Err(Failure::new(Status::GaveUp, "somebody is in the way"));
                }
                None => {
                    waiting.push_back((agent, visited));
                    tries += 1;
                }
            }
        }
        Ok(walk.steps)
    }
}

/// The positions of all agents, step by step, and their present headings.
struct Walk {
    steps: Vec<Vec<u32>>,
    headings: Option<Vec<Heading>>,
    cols: u32,
    turns: bool,
}

impl Walk {
    fn now(&self) -> &Vec<u32> {
        // There is a first step.
        &self.steps[self.steps.len() - 1]
    }

    fn wait(&mut self) {
        self.steps.push(self.now().clone());
    }

    fn go(&mut self, agent: usize, way: &[u32]) {
        for to in way {
            let from = self.now()[agent];
            let towards = if *to == from + self.cols {
                Heading::South
            } else if from == *to + self.cols {
                Heading::North
            } else if *to > from {
                Heading::East
            } else {
                Heading::West
            };
            if let Some(headings) = &mut self.headings {
                let apart = (headings[agent].code() - towards.code()).rem_euclid(4);
                headings[agent] = towards;
                if self.turns {
                    for _ in 0..apart.min(4 - apart) {
                        self.wait();
                    }
                }
            }
            self.wait();
            if let Some(last) = self.steps.last_mut() {
                last[agent] = *to;
            }
        }
    }
}

fn plan_of(steps: &[Vec<u32>]) -> GridPlan {
    let agents = steps.first().map_or(0, Vec::len);
    GridPlan::from_paths((0..agents).map(|agent| {
        let path: Vec<u32> = steps.iter().map(|step| step[agent]).collect();
        path
    }))
}

fn steps_of(plan: &GridPlan) -> Vec<Vec<u32>> {
    let paths: Vec<&[u32]> = plan.paths().collect();
    let length = paths.iter().map(|path| path.len()).max().unwrap_or(0);
    let at = |time: usize| paths.iter().map(move |path| path[time.min(path.len() - 1)]);
    (0..length).map(|time| at(time).collect()).collect()
}

/// True if no two agents share a cell or swap cells.
fn nobody_meets(steps: &[Vec<u32>]) -> bool {
    let apart = |step: &Vec<u32>| {
        let cells: BTreeSet<u32> = step.iter().copied().collect();
        cells.len() == step.len()
    };
    let no_swap = |pair: &[Vec<u32>]| {
        let moves: BTreeSet<(u32, u32)> = pair[0]
            .iter()
            .copied()
            .zip(pair[1].iter().copied())
            .filter(|(from, to)| from != to)
            .collect();
        moves
            .iter()
            .all(|(from, to)| !moves.contains(&(*to, *from)))
    };
    steps.iter().all(apart) && steps.windows(2).all(no_swap)
}

/// True if an agent enters a cell that another one leaves in the same step.
fn followed(steps: &[Vec<u32>]) -> bool {
    steps.windows(2).any(|pair| {
        let moved = |agent: &usize| pair[0][*agent] != pair[1][*agent];
        (0..pair[0].len())
            .filter(moved)
            .any(|agent| pair[0].contains(&pair[1][agent]))
    })
}

/// As many threads as there are, and more, until the budget ends.
fn spin(budget: &Budget, sink: &dyn Sink) {
    let until = Instant::now() + Duration::from_nanos(budget.wall_ns / 10 * 9);
    std::thread::scope(|scope| {
        for _ in 0..16 {
            scope.spawn(|| {
                while Instant::now() < until && !sink.cancelled() {
                    std::hint::spin_loop();
                }
            });
        }
    });
}
