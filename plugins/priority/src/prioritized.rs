//! Prioritized planning: one agent after the other in a total order.
//!
//! M. Erdmann, T. Lozano-Pérez, "On multiple moving objects", Algorithmica 2 (1987). The
//! first order is by the length of the way, longest first. When an agent finds no path,
//! another order is tried: the one in which it comes first, and now and then a random one
//! (Bennewitz, Burgard, Thrun, "Finding and optimizing solvable priority schemes for
//! decoupled path planning techniques for teams of mobile robots", 2002, tried random
//! exchanges).

use std::collections::BTreeSet;

use fleetyard_plugin_spacetime::plan::Paths;
use fleetyard_plugin_spacetime::problem::Problem;
use fleetyard_plugin_spacetime::random::Random;
use fleetyard_plugin_spacetime::sipp::Miss;

use crate::planner::{Control, Outcome, Single};

/// Random streams.
const ORDER_STREAM: u64 = 0;
const PATH_STREAM: u64 = 1;
/// One restart in so many has a random order; the others put first who found no path.
const SHUFFLE_EVERY: u64 = 16;
/// Of teams up to this size all orders are remembered that were tried, at most 720.
const SMALL_TEAM: usize = 6;

/// Options of prioritized planning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Options {
    /// A cell is left alone for so many steps after a visit, so that nobody is met who is
    /// so late (k-robust plans: Atzmon et al., JAIR 2020).
    pub delay: u32,
    /// Charge of a turn by 90°, in steps, where it takes none.
    pub turn_charge: u32,
}

/// Work of a run.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Effort {
    /// Orders that were tried.
    pub orders: u64,
    /// States expanded for paths.
    pub expansions: u64,
    /// The order that led to a plan without collisions, if one did.
    pub order: Vec<usize>,
}

/// Plans. Ends with the first plan without collisions, when it is stopped, or when every
/// order of a small team has failed.
pub fn plan(
    problem: &Problem,
    options: Options,
    seed: u64,
    control: &mut Control<'_>,
) -> (Outcome, Effort) {
    let agents = problem.agents();
    let mut random = Random::new(seed, ORDER_STREAM);
    let mut run = Run {
        single: Single::new(
            problem,
            options.turn_charge,
            control.nodes,
            Random::new(seed, PATH_STREAM),
        ),
        delay: options.delay,
        paths: vec![Vec::new(); agents],
        longest: 0,
    };
    let mut order: Vec<usize> = (0..agents).collect();
    order.sort_by_key(|&agent| std::cmp::Reverse(problem.routes[agent].length()));
    let mut tried = BTreeSet::new();
    let all: usize = (1..=agents.min(SMALL_TEAM)).product();
    let mut best: Option<(usize, Paths)> = None;
    let mut restarts = 0;
    loop {
        if agents <= SMALL_TEAM {
            tried.insert(order.clone());
        }
        // The first time everybody is tried, for the case that no other order does better.
        let attempt = run.attempt(&order, restarts == 0, control.stop);
        let missing = run.paths.iter().filter(|path| path.is_empty()).count();
        if best.as_ref().is_none_or(|(least, _)| missing < *least) {
            best = Some((missing, run.paths.clone()));
        }
        let failed = match attempt {
            Ok(None) => {
                let effort = Effort {
                    order,
                    ..run.effort(restarts)
                };
                return (Outcome::Solved(run.paths), effort);
            }
            Ok(Some(failed)) => Some(failed),
            Err(Stopped) => None,
        };
        let exhausted = agents <= SMALL_TEAM && tried.len() == all;
        let (false, Some(failed)) = (exhausted, failed) else {
            let mut paths = best.map(|(_, paths)| paths).unwrap_or_default();
            for (agent, path) in paths.iter_mut().enumerate() {
                if path.is_empty() {
                    *path = problem.shortest(agent);
                }
            }
            let outcome = if exhausted {
                Outcome::Exhausted(paths)
            } else {
                Outcome::Stopped(paths)
            };
            return (outcome, run.effort(restarts));
        };
        restarts += 1;
        if let Some(at) = order.iter().position(|&agent| agent == failed) {
            order[..=at].rotate_right(1);
        }
        while restarts % SHUFFLE_EVERY == 0 || tried.contains(&order) {
            random.shuffle(&mut order);
            if !tried.contains(&order) {
                break;
            }
        }
    }
}

/// The run was stopped.
struct Stopped;

struct Run<'p> {
    single: Single<'p>,
    delay: u32,
    /// Empty where none is found yet.
    paths: Paths,
    /// Steps of the longest path.
    longest: usize,
}

impl Run<'_> {
    fn effort(&self, restarts: u64) -> Effort {
        Effort {
            orders: restarts + 1,
            expansions: self.single.sipp.expansions,
            order: Vec::new(),
        }
    }

    /// Plans in an order. Gives the first agent that found no path; the others are planned
    /// nevertheless if `everybody` is to be tried.
    fn attempt(
        &mut self,
        order: &[usize],
        everybody: bool,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Option<usize>, Stopped> {
        self.paths.iter_mut().for_each(Vec::clear);
        self.longest = 0;
        let problem = self.single.problem;
        self.single.hard.reset(0);
        for agent in 0..problem.agents() {
            self.single.hold(agent, self.delay);
        }
        let mut failed = None;
        for &agent in order {
            if stop() {
                return Err(Stopped);
            }
            self.release(agent);
            match self.single.path(agent, false, stop) {
                Ok(found) => {
                    self.paths[agent] = found.path;
                    self.reserve(agent);
                }
                Err(Miss::Stopped) => return Err(Stopped),
                Err(Miss::NoPath) => {
                    failed = failed.or(Some(agent));
                    if !everybody {
                        break;
                    }
                }
            }
        }
        Ok(failed)
    }

    /// Lets an agent begin. Paths that come to its start soon after stay in the table.
    fn release(&mut self, agent: usize) {
        let start = self.single.problem.routes[agent].start;
        let end = (self.single.release(agent, self.delay) + self.delay) as usize;
        let Single { problem, hard, .. } = &mut self.single;
        for path in &self.paths {
            if path.iter().take(end + 1).any(|&v| v == start) {
                hard.add(&problem.graph, path, self.delay);
            }
        }
    }

    /// Enters the path of an agent into the table, which grows if it has to.
    fn reserve(&mut self, agent: usize) {
        let Single { problem, hard, .. } = &mut self.single;
        let path = &self.paths[agent];
        self.longest = self.longest.max(path.len());
        let needed = self.longest + self.delay as usize + 1;
        if problem.window > 0 || needed <= hard.horizon() as usize {
            hard.add(&problem.graph, path, self.delay);
            return;
        }
        hard.reset(needed);
        for (other, path) in self.paths.iter().enumerate() {
            if path.is_empty() {
                self.single.hold(other, self.delay);
            } else {
                let Single { problem, hard, .. } = &mut self.single;
                hard.add(&problem.graph, path, self.delay);
            }
        }
    }
}
