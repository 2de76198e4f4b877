//! Large neighbourhood search: takes a few agents out of a plan and puts them back
//! with shorter paths.
//!
//! J. Li, Z. Chen, D. Harabor, P. J. Stuckey, S. Koenig, "Anytime multi-agent path
//! finding via large neighborhood search", IJCAI 2021. Repair is prioritised planning
//! with SIPP in random order.
//!
//! Work is done in rounds. In a round some disjoint neighbourhoods are chosen, each is
//! repaired against the plan as it was at the beginning of the round, and the repairs
//! are taken over one after the other if they still fit. Repairs do not depend on one
//! another and have random streams of their own, so it makes no difference how many
//! threads do them.

use std::sync::Mutex;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::graph::{Graph, Vertex};
use crate::neighborhood::{Chooser, KINDS, Kind};
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

/// Outcome of a repair: new paths of the members unless it failed.
#[derive(Debug, Default)]
struct Repair {
    paths: Option<Vec<Vec<Vertex>>>,
    work: u64,
}

/// One thread's table and scratch memory.
#[derive(Debug)]
struct Worker<'g> {
    graph: &'g Graph,
    reservations: Reservations,
    sipp: Sipp,
    cycles: bool,
}

/// The search.
#[derive(Debug)]
pub struct Refiner<'a, 'g> {
    graph: &'g Graph,
    goals: &'a [Vertex],
    seed: u64,
    cycles: bool,
    paths: Paths,
    workers: Vec<Worker<'g>>,
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
    /// States expanded, agents planned: comparable to agent steps of PIBT.
    pub work: u64,
}

impl<'a, 'g> Refiner<'a, 'g> {
    /// Begins with paths that do not collide, one per agent, ending at the goals. Agents move
    /// in rings only if `cycles` are allowed.
    pub fn new(
        graph: &'g Graph,
        goals: &'a [Vertex],
        paths: Paths,
        cycles: bool,
        threads: usize,
        seed: u64,
    ) -> Self {
        let reservations = table_of(graph, &paths);
        let worker = || Worker {
            graph,
            reservations: reservations.clone(),
            sipp: Sipp::default(),
            cycles,
        };
        let workers = (0..threads.clamp(1, SLOTS)).map(|_| worker()).collect();
        let arm = |kind, size| Arm {
            kind,
            size,
            gain: 1.0,
            work: 1.0,
            attempts: 1.0,
        };
        let arms = KINDS
            .iter()
            .flat_map(|&k| SIZES.iter().map(move |&s| arm(k, s)))
            .collect();
        let chooser = Chooser::new(graph, goals, &paths);
        let slots = (paths.len() / AGENTS_PER_SLOT).clamp(1, SLOTS);
        let random = Random::new(seed, STREAMS - 1);
        Self {
            graph,
            goals,
            seed,
            cycles,
            paths,
            workers,
            chooser,
            arms,
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
            worker.sipp = Sipp::default();
        }
        self.chooser = Chooser::new(graph, self.goals, &paths);
        self.paths = paths;
    }

    /// The plan as it is now.
    pub fn paths(&self) -> &Paths {
        &self.paths
    }

    /// One round, for the same `team` each time. A round during which `stop` says so changes
    /// nothing.
    pub fn round(&mut self, team: &(impl Team + ?Sized), stop: &mut dyn FnMut() -> bool) -> Round {
        let jobs = self.choose(team);
        let repairs: Vec<Mutex<Repair>> = jobs.iter().map(|_| Mutex::default()).collect();
        let next = AtomicUsize::new(0);
        let stopped = AtomicBool::new(false);
        let (paths, goals, seed) = (&self.paths, self.goals, self.seed);
        let work = |worker: &mut Worker<'_>, stop: &mut dyn FnMut() -> bool| {
            loop {
                let slot = next.fetch_add(1, Ordering::Relaxed);
                let Some(job) = jobs.get(slot) else { return };
                let random = Random::new(seed, job.stream);
                let repair = worker.repair(&job.members, paths, goals, team, random, stop);
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
    fn choose(&mut self, team: &(impl Team + ?Sized)) -> Vec<Job> {
        self.chooser.release();
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
            let members = self.chooser.choose(kind, size, &self.paths, team, random);
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
    fn take_over(&mut self, members: &[u32], new: Vec<Vec<Vertex>>) -> u64 {
        let graph = self.graph;
        let Some((first, others)) = self.workers.split_first_mut() else {
            return 0;
        };
        let table = &mut first.reservations;
        for &agent in members {
            table.flip(graph, &self.paths[agent as usize]);
        }
        // One after the other: a ring is closed by the last of its members.
        let added = new.iter().take_while(|path| {
            let fits = table.admits(graph, path, self.cycles);
            if fits {
                table.flip(graph, path);
            }
            fits
        });
        let added = added.count();
        if added < new.len() {
            for path in &new[..added] {
                table.flip(graph, path);
            }
            for &agent in members {
                table.flip(graph, &self.paths[agent as usize]);
            }
            return 0;
        }
        let mut gain = 0;
        for (&agent, path) in members.iter().zip(new) {
            for other in &mut *others {
                other.reservations.flip(graph, &self.paths[agent as usize]);
                other.reservations.flip(graph, &path);
            }
            self.chooser.remove(agent, &self.paths[agent as usize]);
            self.chooser.add(agent, &path);
            gain += self.paths[agent as usize].len() as i64 - path.len() as i64;
            self.paths[agent as usize] = path;
        }
        gain.max(0) as u64
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

impl Worker<'_> {
    /// Replans the members one after the other; a repair that would cost more than
    /// before is none. The table is left as it was.
    fn repair(
        &mut self,
        members: &[u32],
        paths: &Paths,
        goals: &[Vertex],
        team: &(impl Team + ?Sized),
        mut random: Random,
        stop: &mut dyn FnMut() -> bool,
    ) -> Repair {
        let graph = self.graph;
        let before = self.sipp.expansions;
        let mut order: Vec<usize> = (0..members.len()).collect();
        random.shuffle(&mut order);
        let mut new: Vec<Vec<Vertex>> = vec![Vec::new(); members.len()];
        // What may still be spent, and what those not yet planned need at least.
        let mut budget = 0;
        for &agent in members {
            self.reservations.flip(graph, &paths[agent as usize]);
            budget += paths[agent as usize].len() - 1;
        }
        let least = |table: &Reservations, agent: usize| {
            let distance = team.distance(agent, paths[agent][0]) as usize;
            distance.max(table.free_for_ever(goals[agent]) as usize)
        };
        let mut complete = true;
        for (k, &slot) in order.iter().enumerate() {
            let agent = members[slot] as usize;
            let table = &self.reservations;
            // The last step is kept free of arrivals, so that staying for ever shows.
            let horizon = table.horizon() - 2;
            let others = order[k + 1..]
                .iter()
                .map(|&s| least(table, members[s] as usize));
            let found = budget.checked_sub(others.sum()).and_then(|bound| {
                let query = Query {
                    graph,
                    hard: table,
                    soft: None,
                    route: &team.route(agent),
                    start: paths[agent][0],
                    heading: 0,
                    turn_charge: 0,
                    lanes: None,
                    turning: false,
                    window: 0,
                    cycles: self.cycles,
                    bound: horizon.min(bound as u32),
                };
                let found = self.sipp.plan(&query, &mut random, stop);
                found.ok().map(|found| found.path)
            });
            let Some(path) = found else {
                complete = false;
                break;
            };
            budget -= path.len() - 1;
            self.reservations.flip(graph, &path);
            new[slot] = path;
        }
        for path in &new {
            self.reservations.flip(graph, path);
        }
        for &agent in members {
            self.reservations.flip(graph, &paths[agent as usize]);
        }
        let work = self.sipp.expansions - before + 10 * members.len() as u64;
        Repair {
            paths: complete.then_some(new),
            work,
        }
    }
}
