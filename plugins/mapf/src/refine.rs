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

use crate::distance::Distances;
use crate::graph::Vertex;
use crate::neighborhood::{Chooser, KINDS, Kind};
use crate::plan::Paths;
use crate::random::Random;
use crate::reservation::Reservations;
use crate::sipp::Sipp;

/// Most neighbourhoods in a round.
const SLOTS: usize = 16;
/// Agents per neighbourhood and round, at least, in the whole team.
const AGENTS_PER_SLOT: usize = 32;
/// Neighbourhood sizes tried.
const SIZES: [usize; 4] = [2, 5, 10, 20];
/// First random stream of the repairs.
const STREAMS: u64 = 1 << 32;

/// A way to choose neighbourhoods, and how well it has done lately.
#[derive(Debug, Clone, Copy)]
struct Arm {
    kind: Kind,
    size: usize,
    gain: f64,
    work: f64,
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
struct Worker {
    reservations: Reservations,
    sipp: Sipp,
}

/// The search.
#[derive(Debug)]
pub(crate) struct Refiner<'a, 'g> {
    distances: &'a Distances<'g>,
    goals: &'a [Vertex],
    seed: u64,
    paths: Paths,
    workers: Vec<Worker>,
    chooser: Chooser<'g>,
    arms: Vec<Arm>,
    random: Random,
    jobs_done: u64,
    slots: usize,
}

/// What a round has done.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Round {
    /// By how much the sum of costs has fallen.
    pub(crate) gain: u64,
    /// Neighbourhoods tried.
    pub(crate) attempts: u64,
    /// States expanded, agents planned: comparable to agent steps of PIBT.
    pub(crate) work: u64,
}

impl<'a, 'g> Refiner<'a, 'g> {
    /// `distances` must be complete.
    pub(crate) fn new(
        distances: &'a Distances<'g>,
        goals: &'a [Vertex],
        paths: Paths,
        threads: usize,
        seed: u64,
    ) -> Self {
        let graph = distances.graph();
        let makespan = paths.iter().map(Vec::len).max().unwrap_or(1);
        let mut reservations = Reservations::new(graph, makespan + 2);
        for path in &paths {
            reservations.flip(graph, path);
        }
        let worker = || Worker {
            reservations: reservations.clone(),
            sipp: Sipp::default(),
        };
        let workers = (0..threads.max(1)).map(|_| worker()).collect();
        let arm = |kind, size| Arm {
            kind,
            size,
            gain: 1.0,
            work: 1.0,
        };
        let arms = KINDS
            .iter()
            .flat_map(|&k| SIZES.iter().map(move |&s| arm(k, s)))
            .collect();
        let chooser = Chooser::new(graph, goals, &paths);
        let slots = (paths.len() / AGENTS_PER_SLOT).clamp(1, SLOTS);
        let random = Random::new(seed, STREAMS - 1);
        Self {
            distances,
            goals,
            seed,
            paths,
            workers,
            chooser,
            arms,
            random,
            jobs_done: 0,
            slots,
        }
    }

    /// The plan as it is now.
    pub(crate) fn paths(&self) -> &Paths {
        &self.paths
    }

    /// One round. A round during which `stop` says so changes nothing.
    pub(crate) fn round(&mut self, stop: &mut dyn FnMut() -> bool) -> Round {
        let jobs = self.choose();
        let repairs: Vec<Mutex<Repair>> = jobs.iter().map(|_| Mutex::default()).collect();
        let next = AtomicUsize::new(0);
        let stopped = AtomicBool::new(false);
        let (paths, distances, goals, seed) = (&self.paths, self.distances, self.goals, self.seed);
        let work = |worker: &mut Worker, stop: &mut dyn FnMut() -> bool| {
            loop {
                let slot = next.fetch_add(1, Ordering::Relaxed);
                let Some(job) = jobs.get(slot) else { return };
                let random = Random::new(seed, job.stream);
                let repair = worker.repair(&job.members, paths, goals, distances, random, stop);
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
            let arm = &mut self.arms[job.arm];
            arm.gain = arm.gain * 0.97 + gain as f64;
            arm.work = arm.work * 0.97 + repair.work as f64;
        }
        round
    }

    /// Disjoint neighbourhoods for a round.
    fn choose(&mut self) -> Vec<Job> {
        self.chooser.release();
        let rates: Vec<f64> = self
            .arms
            .iter()
            .map(|arm| arm.gain / arm.work.max(1.0))
            .collect();
        let total: f64 = rates.iter().sum();
        let mut jobs = Vec::with_capacity(self.slots);
        for _ in 0..self.slots {
            let mut arm = self.random.below(self.arms.len());
            if !self.random.one_in(6) {
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
                .choose(kind, size, &self.paths, self.distances, random);
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
        let graph = self.distances.graph();
        let Some((first, others)) = self.workers.split_first_mut() else {
            return 0;
        };
        let table = &mut first.reservations;
        for &agent in members {
            table.flip(graph, &self.paths[agent as usize]);
        }
        let fits = new.iter().all(|path| table.admits(graph, path));
        for (&agent, path) in members.iter().zip(&new) {
            table.flip(
                graph,
                if fits {
                    path
                } else {
                    &self.paths[agent as usize]
                },
            );
        }
        if !fits {
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

impl Worker {
    /// Replans the members one after the other; a repair that would cost more than
    /// before is none. The table is left as it was.
    fn repair(
        &mut self,
        members: &[u32],
        paths: &Paths,
        goals: &[Vertex],
        distances: &Distances<'_>,
        mut random: Random,
        stop: &mut dyn FnMut() -> bool,
    ) -> Repair {
        let graph = distances.graph();
        let before = self.sipp.expansions;
        let mut order: Vec<usize> = (0..members.len()).collect();
        random.shuffle(&mut order);
        let mut new: Vec<Vec<Vertex>> = vec![Vec::new(); members.len()];
        // What may still be spent, and what those not yet planned need at least.
        let mut budget = 0;
        for &agent in members {
            let path = &paths[agent as usize];
            self.reservations.flip(graph, path);
            budget += path.len() - 1;
            budget -= distances.known(agent as usize, path[0]) as usize;
        }
        let mut complete = true;
        for &slot in &order {
            let agent = members[slot] as usize;
            let start = paths[agent][0];
            let least = distances.known(agent, start) as usize;
            let query = (agent, start, goals[agent]);
            let bound = budget + least;
            let table = &self.reservations;
            let found = self
                .sipp
                .plan(graph, table, distances, query, bound, &mut random, stop);
            let Some(path) = found else {
                complete = false;
                break;
            };
            budget -= path.len() - 1 - least;
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
