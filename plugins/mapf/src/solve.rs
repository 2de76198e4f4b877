//! The way from a problem to an outcome: checks, guidance, search, refinement.

use crate::distance::{Distances, MAX_DISTANCE};
use crate::lacam::{Lacam, Step};
use crate::one_shot;
use crate::plan::{Paths, Plan, paths_of, plan_of, sum_of_costs};
use crate::problem::{Checked, Problem, ProblemError};
use crate::random::Random;
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
    let mut iterations = 0_u64;
    let mut best: Option<(Paths, u64)> = None;
    let limit = loop {
        if observer.stop() {
            break Limit::Stopped;
        }
        if options.node_limit.is_some_and(|limit| iterations >= limit) {
            break Limit::Nodes;
        }
        iterations += 1;
        match search.step(&mut distances) {
            Step::Searching => {}
            Step::Exhausted => {
                let Some(cost) = search.cost() else {
                    return Ok(Outcome::Infeasible);
                };
                lower_bound = cost;
                break Limit::Nodes;
            }
            Step::Improved => {
                let paths = paths_of(&search.solution());
                let sum = sum_of_costs(&paths);
                if best.as_ref().is_none_or(|(_, known)| sum < *known) {
                    observer.incumbent(&plan_of(&paths, &graph), sum);
                    best = Some((paths, sum));
                }
                if !options.anytime {
                    break Limit::Nodes;
                }
            }
        }
    };
    observer.metric("iterations", iterations as f64);
    observer.metric("configurations", search.len() as f64);
    Ok(match best {
        Some((paths, sum_of_costs)) => Outcome::Solved {
            plan: plan_of(&paths, &graph),
            sum_of_costs,
            lower_bound,
        },
        None => Outcome::GaveUp(limit),
    })
}
