//! The way from a problem to an outcome: checks, guidance, search, refinement.

use crate::distance::{Distances, MAX_DISTANCE};
use crate::graph::Graph;
use crate::lacam::{Lacam, Step};
use crate::one_shot;
use crate::plan::{Paths, Plan, paths_of, plan_of, sum_of_costs};
use crate::problem::{Checked, Problem, ProblemError};
use crate::random::Random;
use crate::refine::Refiner;
use crate::scatter::{Guide, scatter};

/// Which planner.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Algorithm {
    /// Complete and anytime.
    #[default]
    LacamStar,
    /// Fastest; may fail to bring everybody to the goal.
    Pibt,
}

/// Options of the planners.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Options {
    /// Which planner.
    pub algorithm: Algorithm,
    /// Whether PIBT may let two agents change places at the end of a corridor.
    pub swap: bool,
    /// PIBT runs per successor; the best is taken.
    pub samples: u32,
    /// How much longer than its shortest path a guide path may be; `None`: no guidance.
    pub scatter_margin: Option<u32>,
    /// Go on after the first plan.
    pub anytime: bool,
    /// Threads for the work after the first plan. The result does not depend on it.
    pub threads: usize,
    /// At most so many search iterations.
    pub node_limit: Option<u64>,
    /// At most so many steps of [`Algorithm::Pibt`].
    pub step_limit: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            algorithm: Algorithm::default(),
            swap: true,
            samples: 10,
            scatter_margin: Some(10),
            anytime: true,
            threads: 1,
            node_limit: None,
            step_limit: 100_000,
        }
    }
}

/// What a planner reports to while it works.
pub trait Observer {
    /// A plan better than any before, and its sum of costs.
    fn incumbent(&mut self, plan: &Plan, sum_of_costs: u64);
    /// Whether to stop now: a deadline has passed or the work is cancelled. Asked often.
    fn stop(&mut self) -> bool;
    /// A figure about the work.
    fn metric(&mut self, name: &str, value: f64);
}

/// Which limit ended an unsuccessful run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limit {
    /// [`Observer::stop`].
    Stopped,
    /// [`Options::node_limit`].
    Nodes,
    /// [`Options::step_limit`], of PIBT only.
    Steps,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// The best plan found.
    Solved {
        /// The plan.
        plan: Plan,
        /// Its sum of costs.
        sum_of_costs: u64,
        /// A proven lower bound of the sum of costs.
        lower_bound: u64,
    },
    /// Proven: no plan exists.
    Infeasible,
    /// Nothing found and nothing proven.
    GaveUp(Limit),
}

/// Plans. The same problem, options and seed give the same first plan, and, as long as
/// only [`Options::node_limit`] ends the run, the same sequence of plans.
pub fn solve(
    problem: &Problem,
    options: &Options,
    seed: u64,
    observer: &mut dyn Observer,
) -> Result<Outcome, ProblemError> {
    let Checked {
        graph,
        starts,
        goals,
    } = problem.check()?;
    let mut distances = Distances::new(&graph, &goals);
    let mut lower_bound = 0;
    for (agent, &start) in starts.iter().enumerate() {
        let distance = distances.get(agent, start);
        if distance > MAX_DISTANCE {
            let (start, goal) = (problem.starts[agent], problem.goals[agent]);
            return Err(ProblemError::Unreachable {
                agent,
                start,
                goal,
                limit: MAX_DISTANCE,
            });
        }
        lower_bound += u64::from(distance);
    }
    observer.metric("lower_bound", lower_bound as f64);

    if options.algorithm == Algorithm::Pibt {
        let random = Random::new(seed, 0);
        let found = one_shot::pibt(
            &starts,
            &goals,
            &mut distances,
            options.swap,
            options.step_limit,
            random,
            &mut || observer.stop(),
        );
        let Some(configurations) = found else {
            let limit = if observer.stop() {
                Limit::Stopped
            } else {
                Limit::Steps
            };
            return Ok(Outcome::GaveUp(limit));
        };
        let configurations: Vec<&[u32]> = configurations.iter().map(|q| &**q).collect();
        let plan = plan_of(&paths_of(&configurations), &graph);
        let sum_of_costs = plan.sum_of_costs();
        observer.incumbent(&plan, sum_of_costs);
        return Ok(Outcome::Solved {
            plan,
            sum_of_costs,
            lower_bound,
        });
    }

    let guide = options
        .scatter_margin
        .map_or_else(Guide::default, |margin| {
            let mut random = Random::new(seed, 1);
            scatter(
                &mut distances,
                &starts,
                &goals,
                margin,
                10,
                &mut random,
                &mut || observer.stop(),
            )
        });
    let random = Random::new(seed, 2);
    let mut search = Lacam::new(
        &starts,
        &goals,
        &mut distances,
        guide,
        options.swap,
        options.samples as usize,
        random,
    );
    let mut budget = Budget {
        observer,
        left: options.node_limit.unwrap_or(u64::MAX),
    };
    let mut best = Best {
        graph: &graph,
        found: None,
    };
    let limit = 'first: loop {
        if let Some(limit) = budget.spend(1) {
            break 'first Some(limit);
        }
        match search.step(&mut distances) {
            Step::Searching => {}
            Step::Exhausted => return Ok(Outcome::Infeasible),
            Step::Improved => {
                best.offer(paths_of(&search.solution()), budget.observer);
                break 'first None;
            }
        }
    };
    if let Some(limit) = limit {
        return Ok(Outcome::GaveUp(limit));
    }
    if options.anytime && best.sum() > lower_bound {
        distances.complete();
        let mut refiner = Refiner::new(&distances, &goals, best.paths(), options.threads, seed);
        loop {
            if budget.observer.stop() {
                break;
            }
            let round = refiner.round(&mut || budget.observer.stop());
            if round.gain > 0 {
                best.offer(refiner.paths().clone(), budget.observer);
            }
            if budget.spend(round.attempts).is_some() || best.sum() == lower_bound {
                break;
            }
        }
    }
    budget
        .observer
        .metric("configurations", search.len() as f64);
    Ok(best.outcome(lower_bound))
}

/// The limits of a run.
struct Budget<'o> {
    observer: &'o mut dyn Observer,
    left: u64,
}

impl Budget<'_> {
    /// Takes `work` from what is left; says which limit has been met.
    fn spend(&mut self, work: u64) -> Option<Limit> {
        if self.left == 0 {
            return Some(Limit::Nodes);
        }
        self.left = self.left.saturating_sub(work);
        self.observer.stop().then_some(Limit::Stopped)
    }
}

/// The best plan so far.
struct Best<'g> {
    graph: &'g Graph,
    found: Option<(Paths, u64)>,
}

impl Best<'_> {
    fn sum(&self) -> u64 {
        self.found.as_ref().map_or(u64::MAX, |(_, sum)| *sum)
    }

    fn paths(&self) -> Paths {
        self.found
            .as_ref()
            .map(|(paths, _)| paths.clone())
            .unwrap_or_default()
    }

    fn offer(&mut self, paths: Paths, observer: &mut dyn Observer) {
        let sum = sum_of_costs(&paths);
        if sum < self.sum() {
            observer.incumbent(&plan_of(&paths, self.graph), sum);
            self.found = Some((paths, sum));
        }
    }

    fn outcome(self, lower_bound: u64) -> Outcome {
        match self.found {
            Some((paths, sum_of_costs)) => {
                let plan = plan_of(&paths, self.graph);
                Outcome::Solved {
                    plan,
                    sum_of_costs,
                    lower_bound,
                }
            }
            None => Outcome::GaveUp(Limit::Stopped),
        }
    }
}
