//! Large neighbourhood search: takes a few agents out of a plan and puts them back
//! with shorter paths.
//!
//! J. Li, Z. Chen, D. Harabor, P. J. Stuckey, S. Koenig, "Anytime multi-agent path
//! finding via large neighborhood search", IJCAI 2021. Repair is prioritised planning in random
//! order. What paths cost and how one is found is a [`Task`]: [`Shortest`] for one goal per agent.
//!
//! Work is done in rounds. In a round some disjoint neighbourhoods are chosen, each is
//! repaired against the plan as it was at the beginning of the round, and the repairs
//! are taken over one after the other if they still fit. Repairs do not depend on one
//! another and have random streams of their own, so it makes no difference how many
//! threads do them.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::graph::{Graph, Vertex};
use crate::neighborhood::{Chooser, Kind, Standing};
use crate::plan::Paths;
use crate::random::Random;
use crate::reservation::Reservations;
use crate::sipp::{Query, Sipp, Team};

/// Most neighbourhoods in a round.
const SLOTS: usize = 16;
/// Agents per neighbourhood and round, at least, in the whole team.
const AGENTS_PER_SLOT: usize = 32;
/// Neighbourhood sizes tried.
const SIZES: [usize; 5] = [1, 2, 4, 8, 16];
/// The share of its past that an arm keeps when it is tried once more.
const MEMORY: f64 = 0.97;
/// Once in so many choices any arm will do.
const EXPLORE_ONE_IN: usize = 6;
/// First random stream of the repairs.
const STREAMS: u64 = 1 << 32;

/// The measure of paths, and the way to find that of one agent.
pub trait Task: Sync {
    /// Scratch memory of a thread.
    type Search: Default + Send;
    /// Neighbourhoods that make sense.
    const KINDS: &'static [Kind];

    /// The cost of a path of an agent.
    fn cost(&self, agent: usize, path: &[Vertex]) -> u64;

    /// The least cost of an agent's paths from its start, if nobody were in the way.
    fn alone(&self, agent: usize, start: Vertex) -> u64;

    /// A lower bound of that cost among the paths of others.
    fn least(&self, agent: usize, start: Vertex, _others: &Reservations) -> u64 {
        self.alone(agent, start)
    }

    /// A lower bound of the cost of paths that are at `v` at this time; [`u64::MAX`] for none.
    fn through(&self, agent: usize, v: Vertex, time: usize) -> u64;

    /// The cheapest path of an agent from its start among the paths of others, and its cost, which is
    /// `most` at most.
    fn path(
        &self,
        search: &mut Self::Search,
        query: Single<'_>,
        random: &mut Random,
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<(Vec<Vertex>, u64)>;

    /// States expanded by a search since its beginning.
    fn expansions(search: &Self::Search) -> u64;
}

/// The agent for which [`Task::path`] is asked.
#[derive(Debug, Clone, Copy)]
pub struct Single<'a> {
    /// The map.
    pub graph: &'a Graph,
    /// True if agents may move round in a ring, each into the cell that the next one leaves.
    pub cycles: bool,
    /// Number of the agent.
    pub agent: usize,
    /// The vertex where it begins.
    pub start: Vertex,
    /// The paths of the others, which must not be met.
    pub others: &'a Reservations,
    /// The most that the path may cost.
    pub most: u64,
}

/// One goal per agent, where it stays; a path costs the steps up to its arrival.
#[derive(Debug, Clone, Copy)]
pub struct Shortest<'a, T: ?Sized> {
    /// The goals.
    pub goals: &'a [Vertex],
    /// The ways to them.
    pub team: &'a T,
}

impl<T: Team + ?Sized> Task for Shortest<'_, T> {
    type Search = Sipp;
    const KINDS: &'static [Kind] = &[Kind::Delay, Kind::Place, Kind::Goal, Kind::Random];

    fn cost(&self, _: usize, path: &[Vertex]) -> u64 {
        path.len() as u64 - 1
    }

    fn alone(&self, agent: usize, start: Vertex) -> u64 {
        self.team.distance(agent, start).into()
    }

    fn least(&self, agent: usize, start: Vertex, others: &Reservations) -> u64 {
        let free = others.free_for_ever(self.goals[agent]);
        self.alone(agent, start).max(free.into())
    }

    #[inline]
    fn through(&self, agent: usize, v: Vertex, time: usize) -> u64 {
        time as u64 + u64::from(self.team.distance(agent, v))
    }

    fn path(
        &self,
        search: &mut Sipp,
        query: Single<'_>,
        random: &mut Random,
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<(Vec<Vertex>, u64)> {
        // The last step is kept free of arrivals, so that staying for ever shows.
        let horizon = query.others.horizon() - 2;
        let query = Query {
            graph: query.graph,
            hard: query.others,
            soft: None,
            route: &self.team.route(query.agent),
            start: query.start,
            heading: 0,
            turn_charge: 0,
            lanes: None,
            turning: false,
            window: 0,
            cycles: query.cycles,
            bound: horizon.min(query.most as u32),
        };
        let found = search.plan(&query, random, stop).ok()?;
        let cost = found.path.len() as u64 - 1;
        Some((found.path, cost))
    }

    fn expansions(search: &Sipp) -> u64 {
        search.expansions
    }
}

/// A way to choose neighbourhoods, and how well it has done lately.
#[derive(Debug, Clone, Copy)]
struct Arm {
    kind: Kind,
    size: usize,
    /// Exponentially forgetting sums.
    gain: f64,
    work: f64,
    attempts: f64,
}

impl Arm {
    fn record(&mut self, gain: u64, work: u64) {
        self.gain = self.gain * MEMORY + gain as f64;
        self.work = self.work * MEMORY + work as f64;
        self.attempts = self.attempts * MEMORY + 1.0;
    }

    /// Weight with which an arm is chosen: the work spent on it goes with the square of its gain
    /// per work.
    fn preference(&self) -> f64 {
        let rate = self.gain / self.work.max(1.0);
        rate * rate * self.attempts / self.work.max(1.0)
    }
}

/// Neighbourhood to repair.
#[derive(Debug)]
struct Job {
    arm: usize,
    members: Vec<u32>,
    stream: u64,
}

/// Outcome of a repair: new paths of the members, and what they cost, unless it failed.
#[derive(Debug, Default)]
struct Repair {
    paths: Option<Vec<(Vec<Vertex>, u64)>>,
    work: u64,
}

/// One thread's table and scratch memory.
#[derive(Debug)]
struct Worker<'g, S> {
    graph: &'g Graph,
    cycles: bool,
    reservations: Reservations,
    search: S,
}

/// The search.
#[derive(Debug)]
pub struct Refiner<'g, S> {
    graph: &'g Graph,
    goals: Vec<Vertex>,
    seed: u64,
    cycles: bool,
    paths: Paths,
    /// The cost of each, from the first round on.
    costs: Vec<u64>,
    workers: Vec<Worker<'g, S>>,
    chooser: Chooser<'g>,
    arms: Vec<Arm>,
    random: Random,
    jobs_done: u64,
    slots: usize,
}

/// Result and work of a round.
#[derive(Debug, Clone, Copy, Default)]
pub struct Round {
    /// Decrease of the sum of costs.
    pub gain: u64,
    /// Neighbourhoods tried.
    pub attempts: u64,
    /// Agents in them.
    pub agents: u64,
    /// States expanded, agents planned: comparable to agent steps of PIBT.
    pub work: u64,
}

/// The paths of a task with their costs.
struct Paying<'a, T> {
    task: &'a T,
    paths: &'a Paths,
    costs: &'a [u64],
}

impl<T: Task> Standing for Paying<'_, T> {
    fn delay(&self, agent: usize) -> usize {
        let alone = self.task.alone(agent, self.paths[agent][0]);
        self.costs[agent].saturating_sub(alone) as usize
    }

    #[inline]
    fn gains(&self, agent: usize, v: Vertex, time: usize) -> bool {
        self.task.through(agent, v, time) < self.costs[agent]
    }
}

impl<'g, S: Default + Send> Refiner<'g, S> {
    /// Begins with paths that do not collide, one per agent, each from where it begins to where the
    /// agent stays: at one of the `goals`, where all plans have the same ends. Agents move in rings
    /// only if `cycles` are allowed.
    pub fn new(
        graph: &'g Graph,
        goals: &[Vertex],
        paths: Paths,
        cycles: bool,
        threads: usize,
        seed: u64,
    ) -> Self {
        let reservations = table_of(graph, &paths);
        let worker = || Worker {
            graph,
            cycles,
            reservations: reservations.clone(),
            search: S::default(),
        };
        let workers = (0..threads.clamp(1, SLOTS)).map(|_| worker()).collect();
        let chooser = Chooser::new(graph, goals, &paths);
        let slots = (paths.len() / AGENTS_PER_SLOT).clamp(1, SLOTS);
        let random = Random::new(seed, STREAMS - 1);
        Self {
            graph,
            goals: goals.to_vec(),
            seed,
            cycles,
            paths,
            costs: Vec::new(),
            workers,
            chooser,
            arms: Vec::new(),
            random,
            jobs_done: 0,
            slots,
        }
    }

    /// Goes on from another plan.
    pub fn adopt(&mut self, paths: Paths) {
        let graph = self.graph;
        let table = table_of(graph, &paths);
        for worker in &mut self.workers {
            worker.reservations = table.clone();
            worker.search = S::default();
        }
        self.chooser = Chooser::new(graph, &self.goals, &paths);
        self.costs.clear();
        self.paths = paths;
    }

    /// The plan as it is now, to keep.
    pub fn into_paths(self) -> Paths {
        self.paths
    }

    /// Values the paths, and begins with all kinds of neighbourhoods alike.
    fn begin<T: Task<Search = S>>(&mut self, task: &T) {
        if self.costs.is_empty() {
            let all = self.paths.iter().enumerate();
            self.costs = all.map(|(agent, path)| task.cost(agent, path)).collect();
        }
        if self.arms.is_empty() {
            let arm = |kind, size| Arm {
                kind,
                size,
                gain: 1.0,
                work: 1.0,
                attempts: 1.0,
            };
            let kinds = T::KINDS.iter();
            let arms = kinds.flat_map(|&k| SIZES.iter().map(move |&s| arm(k, s)));
            self.arms = arms.collect();
        }
    }

    /// The plan as it is now.
    pub fn paths(&self) -> &Paths {
        &self.paths
    }

    /// One round, for the same task each time. A round during which `stop` says so changes nothing.
    pub fn round<T: Task<Search = S>>(
        &mut self,
        task: &T,
        stop: &mut dyn FnMut() -> bool,
    ) -> Round {
        self.begin(task);
        let jobs = self.choose(task);
        let repairs: Vec<Mutex<Repair>> = jobs.iter().map(|_| Mutex::default()).collect();
        let next = AtomicUsize::new(0);
        let stopped = AtomicBool::new(false);
        let (paths, costs, seed) = (&self.paths, &self.costs[..], self.seed);
        let work = |worker: &mut Worker<'_, S>, stop: &mut dyn FnMut() -> bool| {
            loop {
                let slot = next.fetch_add(1, Ordering::Relaxed);
                let Some(job) = jobs.get(slot) else { return };
                let random = Random::new(seed, job.stream);
                let repair = worker.repair(task, &job.members, (paths, costs), random, stop);
                if let Ok(mut place) = repairs[slot].lock() {
                    *place = repair;
                }
            }
        };
        if let Some((first, others)) = self.workers.split_first_mut() {
            let mut ask = || {
                if stop() {
                    stopped.store(true, Ordering::Relaxed);
                }
                stopped.load(Ordering::Relaxed)
            };
            if others.is_empty() || jobs.len() < 2 {
                work(first, &mut ask);
            } else {
                std::thread::scope(|scope| {
                    for other in others {
                        scope.spawn(|| work(other, &mut || stopped.load(Ordering::Relaxed)));
                    }
                    work(first, &mut ask);
                });
            }
        }
        if stopped.load(Ordering::Relaxed) {
            return Round::default();
        }
        let mut round = Round {
            attempts: jobs.len() as u64,
            ..Round::default()
        };
        for (job, repair) in jobs.iter().zip(repairs) {
            let repair = repair.into_inner().unwrap_or_default();
            round.agents += job.members.len() as u64;
            round.work += repair.work;
            let gain = repair
                .paths
                .map_or(0, |new| self.take_over(&job.members, new));
            round.gain += gain;
            self.arms[job.arm].record(gain, repair.work);
        }
        round
    }

    /// Disjoint neighbourhoods for a round.
    fn choose<T: Task<Search = S>>(&mut self, task: &T) -> Vec<Job> {
        self.chooser.release();
        let standing = Paying {
            task,
            paths: &self.paths,
            costs: &self.costs,
        };
        let rates: Vec<f64> = self.arms.iter().map(Arm::preference).collect();
        let total: f64 = rates.iter().sum();
        let mut jobs = Vec::with_capacity(self.slots);
        for _ in 0..self.slots {
            let mut arm = self.random.below(self.arms.len());
            if !self.random.one_in(EXPLORE_ONE_IN) {
                let mut left = total * self.random.below(1 << 24) as f64 / f64::from(1 << 24);
                let found = rates.iter().position(|rate| {
                    left -= rate;
                    left < 0.0
                });
                arm = found.unwrap_or(arm);
            }
            let Arm { kind, size, .. } = self.arms[arm];
            let size = size.min(self.paths.len());
            let random = &mut self.random;
            let members = self
                .chooser
                .choose(kind, size, &self.paths, &standing, random);
            if members.is_empty() {
                continue;
            }
            self.jobs_done += 1;
            jobs.push(Job {
                arm,
                members,
                stream: STREAMS + self.jobs_done,
            });
        }
        jobs
    }

    /// Replaces the paths of the members if the new ones still fit. Gives the gain.
    fn take_over(&mut self, members: &[u32], new: Vec<(Vec<Vertex>, u64)>) -> u64 {
        let graph = self.graph;
        let Some((first, others)) = self.workers.split_first_mut() else {
            return 0;
        };
        let table = &mut first.reservations;
        for &agent in members {
            table.flip(graph, &self.paths[agent as usize]);
        }
        // One after the other: a ring is closed by the last of its members.
        let added = new.iter().take_while(|(path, _)| {
            let fits = table.admits(graph, path, self.cycles);
            if fits {
                table.flip(graph, path);
            }
            fits
        });
        let added = added.count();
        if added < new.len() {
            for (path, _) in &new[..added] {
                table.flip(graph, path);
            }
            for &agent in members {
                table.flip(graph, &self.paths[agent as usize]);
            }
            return 0;
        }
        let (mut before, mut after) = (0, 0);
        for (&agent, (path, cost)) in members.iter().zip(new) {
            let at = agent as usize;
            for other in &mut *others {
                other.reservations.flip(graph, &self.paths[at]);
                other.reservations.flip(graph, &path);
            }
            self.chooser.remove(agent, &self.paths[at]);
            self.chooser.add(agent, &path);
            before += std::mem::replace(&mut self.costs[at], cost);
            after += cost;
            self.paths[at] = path;
        }
        before.saturating_sub(after)
    }
}

/// The occupancy of a plan.
fn table_of(graph: &Graph, paths: &Paths) -> Reservations {
    let makespan = paths.iter().map(Vec::len).max().unwrap_or(1);
    let mut table = Reservations::new(graph, makespan + 2);
    for path in paths {
        table.flip(graph, path);
    }
    table
}

impl<S> Worker<'_, S> {
    /// Replans the members one after the other; a repair that would cost more than
    /// before is none. The table is left as it was.
    fn repair<T: Task<Search = S>>(
        &mut self,
        task: &T,
        members: &[u32],
        (paths, costs): (&Paths, &[u64]),
        mut random: Random,
        stop: &mut dyn FnMut() -> bool,
    ) -> Repair {
        let graph = self.graph;
        let before = T::expansions(&self.search);
        let mut order: Vec<usize> = (0..members.len()).collect();
        random.shuffle(&mut order);
        let mut new: Vec<(Vec<Vertex>, u64)> = vec![(Vec::new(), 0); members.len()];
        // What may still be spent, and what those not yet planned need at least.
        let mut budget = 0;
        for &agent in members {
            self.reservations.flip(graph, &paths[agent as usize]);
            budget += costs[agent as usize];
        }
        let mut complete = true;
        for (k, &slot) in order.iter().enumerate() {
            let agent = members[slot] as usize;
            let others = &self.reservations;
            let least = |slot: &usize| {
                let agent = members[*slot] as usize;
                task.least(agent, paths[agent][0], others)
            };
            let needed = order[k + 1..].iter().map(least).sum();
            let found = budget.checked_sub(needed).and_then(|most| {
                let query = Single {
                    graph,
                    cycles: self.cycles,
                    agent,
                    start: paths[agent][0],
                    others,
                    most,
                };
                task.path(&mut self.search, query, &mut random, stop)
            });
            let Some((path, cost)) = found else {
                complete = false;
                break;
            };
            budget -= cost;
            self.reservations.flip(graph, &path);
            new[slot] = (path, cost);
        }
        for (path, _) in &new {
            self.reservations.flip(graph, path);
        }
        for &agent in members {
            self.reservations.flip(graph, &paths[agent as usize]);
        }
        let work = T::expansions(&self.search) - before + 10 * members.len() as u64;
        Repair {
            paths: complete.then_some(new),
            work,
        }
    }
}
