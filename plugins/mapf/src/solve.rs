//! The way from a problem to an outcome: checks, guidance, search, refinement.

use fleetyard_abi::GridPlan;

use crate::lacam::{Lacam, Step};
use crate::one_shot;
use crate::scatter::{Guide, scatter};
use fleetyard_plugin_spacetime::distance::{Distances, MAX_DISTANCE};
use fleetyard_plugin_spacetime::graph::{Graph, Vertex};
use fleetyard_plugin_spacetime::plan::{Paths, configurations_of, paths_of, plan_of, sum_of_costs};
use fleetyard_plugin_spacetime::problem::{ProblemError, vertices_of};
use fleetyard_plugin_spacetime::random::Random;
use fleetyard_plugin_spacetime::refine::{Refiner, Shortest};

/// The algorithm that plans.
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
#[allow(
    clippy::struct_excessive_bools,
    reason = "switches that have nothing to do with one another"
)]
pub struct Options {
    /// The algorithm that plans.
    pub algorithm: Algorithm,
    /// Lets PIBT have two agents change places at the end of a corridor.
    pub swap: bool,
    /// Lets agents move round in a ring at the same step, each into the cell that the next one
    /// leaves. Real robots cannot, unless they keep step.
    pub rings: bool,
    /// PIBT runs per successor; the best is taken.
    pub samples: u32,
    /// Most steps by which a guide path may be longer than its shortest path, at most 100; `None`:
    /// no guidance.
    pub scatter_margin: Option<u32>,
    /// Go on after the first plan. Also keeps a plan by PIBT in reserve, for the case that
    /// a limit is met before the search has found one.
    pub anytime: bool,
    /// Threads for the work after the first plan. The result does not depend on it.
    pub threads: usize,
    /// Refines plans by replanning small groups, beside searching on.
    pub refine: bool,
    /// About how many bytes the distance tables, and again the search, may take. Without a
    /// plan the run gives up there; with one, refinement goes on alone.
    pub memory_limit: u64,
    /// At most so many search iterations and neighbourhoods tried.
    pub node_limit: Option<u64>,
    /// At most so many steps of [`Algorithm::Pibt`].
    pub step_limit: u64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            algorithm: Algorithm::default(),
            swap: true,
            rings: true,
            samples: 10,
            scatter_margin: Some(10),
            anytime: true,
            threads: 1,
            refine: true,
            memory_limit: 4 << 30,
            node_limit: None,
            step_limit: 100_000,
        }
    }
}

/// The caller of a planner, which hears of plans and figures while the planner works.
pub trait Observer {
    /// A plan better than any before, and its sum of costs.
    fn incumbent(&mut self, plan: &GridPlan, sum_of_costs: u64);
    /// True if the planner has to stop now: a deadline has passed or the work is cancelled. Asked
    /// often.
    fn stop(&mut self) -> bool;
    /// A figure about the work.
    fn metric(&mut self, name: &str, value: f64);
}

/// The limit that ended an unsuccessful run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Limit {
    /// [`Observer::stop`].
    Stopped,
    /// [`Options::node_limit`].
    Nodes,
    /// [`Options::step_limit`], of PIBT only.
    Steps,
    /// [`Options::memory_limit`].
    Memory,
}

/// Result of a run.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// The best plan found.
    Solved {
        /// The plan.
        plan: GridPlan,
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

/// A one-shot multi-agent path finding problem.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// The map.
    pub graph: &'a Graph,
    /// Start cell of each agent, all different.
    pub starts: &'a [u32],
    /// Goal cell of each agent, all different.
    pub goals: &'a [u32],
}

/// Plans. The same problem, options and seed give the same first plan, and, as long as
/// only [`Options::node_limit`] ends the run, the same sequence of plans.
pub fn solve(
    problem: &Problem<'_>,
    options: &Options,
    seed: u64,
    observer: &mut dyn Observer,
) -> Result<Outcome, ProblemError> {
    let graph = problem.graph;
    if problem.starts.len() != problem.goals.len() {
        let (starts, goals) = (problem.starts.len(), problem.goals.len());
        let reason = format!("{starts} starts and {goals} goals: each agent needs one of both");
        return Err(ProblemError::Malformed { reason });
    }
    let starts = vertices_of(graph, problem.starts, "start")?;
    let goals = vertices_of(graph, problem.goals, "goal")?;
    if Distances::bytes(graph, goals.len()) > options.memory_limit {
        return Ok(Outcome::GaveUp(Limit::Memory));
    }
    let mut distances = Distances::new(graph, &goals);
    let mut lower_bound = 0;
    for (agent, &start) in starts.iter().enumerate() {
        let distance = distances.get(agent, start);
        if distance > MAX_DISTANCE {
            let (from, goal) = (problem.starts[agent], problem.goals[agent]);
            return Err(ProblemError::Unreachable {
                agent,
                from,
                goal,
                limit: MAX_DISTANCE,
            });
        }
        lower_bound += u64::from(distance);
        if observer.stop() {
            return Ok(Outcome::GaveUp(Limit::Stopped));
        }
    }
    observer.metric("lower_bound", lower_bound as f64);
    let run = Run {
        options,
        seed,
        starts: &starts,
        goals: &goals,
        graph,
        left: options.node_limit.unwrap_or(u64::MAX),
        observer,
        lower_bound,
        best: None,
        untold: false,
    };
    Ok(match options.algorithm {
        Algorithm::Pibt => run.pibt(&mut distances),
        Algorithm::LacamStar => run.lacam_star(distances),
    })
}

/// Random streams.
const PIBT_STREAM: u64 = 0;
const SCATTER_STREAM: u64 = 1;
const SEARCH_STREAM: u64 = 2;

/// Before it begins anew, the search may take so many times as many steps as the longest
/// of the shortest paths,
const PATIENCE: u64 = 20;
/// and so many more.
const MIN_PATIENCE: u64 = 200;

/// After the first plan the search gets one part in so many of the work of refinement,
const SEARCH_SHARE: u64 = 16;
/// and as much as refinement once that has found nothing for so many rounds.
const IDLE_ROUNDS: u64 = 32;
/// When the search has nothing left to do, refinement ends after so many such rounds.
const FINAL_ROUNDS: u64 = 1000;

/// A run: what is asked, what is left to spend, what has been found.
struct Run<'r, 'g> {
    options: &'r Options,
    seed: u64,
    starts: &'r [Vertex],
    goals: &'r [Vertex],
    graph: &'g Graph,
    left: u64,
    observer: &'r mut dyn Observer,
    lower_bound: u64,
    best: Option<(Paths, u64)>,
    /// True while the best plan has yet to be told to the observer.
    untold: bool,
}

impl<'g> Run<'_, 'g> {
    fn pibt(mut self, distances: &mut Distances<'g>) -> Outcome {
        match self.one_shot(distances, self.options.step_limit) {
            Some(paths) => {
                self.offer(&paths);
                self.outcome()
            }
            None if self.observer.stop() => Outcome::GaveUp(Limit::Stopped),
            None => Outcome::GaveUp(Limit::Steps),
        }
    }

    fn one_shot(&mut self, distances: &mut Distances<'g>, step_limit: u64) -> Option<Paths> {
        let random = Random::new(self.seed, PIBT_STREAM);
        let moves = (self.options.swap, self.options.rings);
        let stop = &mut || self.observer.stop();
        let configurations = one_shot::pibt(
            self.starts,
            self.goals,
            distances,
            moves,
            step_limit,
            random,
            stop,
        )?;
        let configurations: Vec<&[Vertex]> = configurations.iter().map(|q| &**q).collect();
        Some(paths_of(&configurations))
    }

    fn lacam_star(mut self, mut distances: Distances<'g>) -> Outcome {
        let longest = (0..self.starts.len())
            .map(|a| distances.get(a, self.starts[a]))
            .max();
        let longest = u64::from(longest.unwrap_or(0));
        // A plan in reserve, told only if time runs out before there is a better one.
        if self.options.anytime
            && let Some(paths) = self.one_shot(&mut distances, longest * 4 + MIN_PATIENCE)
        {
            self.keep(&paths);
            if self.sum() == self.lower_bound {
                self.tell();
                return self.outcome();
            }
        }
        let guide = self
            .options
            .scatter_margin
            .map_or_else(Guide::default, |margin| {
                let mut random = Random::new(self.seed, SCATTER_STREAM);
                let stop = &mut || self.observer.stop();
                scatter(
                    &mut distances,
                    self.starts,
                    self.goals,
                    margin,
                    &mut random,
                    stop,
                )
            });
        let mut search = Lacam::new(
            self.starts,
            self.goals,
            &mut distances,
            guide,
            (self.options.swap, self.options.rings),
            self.options.samples as usize,
            Random::new(self.seed, SEARCH_STREAM),
        );
        // Depth first as it is, the search may lose its way among configurations that
        // differ little. Then beginning anew is better; patience grows, so that an
        // exhaustive search is not prevented.
        let mut patience = longest * PATIENCE + MIN_PATIENCE;
        let mut restarts = 0;
        let mut until = self.spent() + patience;
        let mut found = false;
        while !found {
            if self.spent() >= until {
                restarts += 1;
                patience += patience / 2;
                until = self.spent() + patience;
                let random = Random::new(self.seed, SEARCH_STREAM + restarts);
                search.restart(self.starts, &mut distances, random);
            }
            if let Some(limit) = self.spend(1) {
                return self.give_up(limit);
            }
            if search.bytes() > self.options.memory_limit {
                return self.give_up(Limit::Memory);
            }
            match search.step(&mut distances) {
                Step::Searching => {}
                Step::Exhausted => return Outcome::Infeasible,
                Step::Improved => {
                    found = true;
                    self.offer(&paths_of(&search.solution()));
                }
            }
        }
        self.observer
            .metric("first_iterations", self.spent() as f64);
        self.observer
            .metric("first_configurations", search.len() as f64);
        if self.options.anytime && self.sum() > self.lower_bound {
            self.improve(search, distances);
        }
        self.tell();
        self.observer.metric("iterations", self.spent() as f64);
        self.outcome()
    }

    /// Improves the first plan until a limit is met or nothing is left to do.
    ///
    /// The search and the refinement of its best plan take turns, by work done and not
    /// by time, so that the course of events is the same on every machine.
    fn improve(&mut self, mut search: Lacam<'g>, mut distances: Distances<'g>) {
        if !distances.complete(&mut || self.observer.stop()) {
            return;
        }
        let Options {
            threads,
            refine,
            rings,
            ..
        } = *self.options;
        let (graph, goals, seed) = (self.graph, self.goals, self.seed);
        let mut refiner = Refiner::new(graph, goals, self.paths(), rings, threads, seed);
        let (mut searching, mut search_work, mut refine_work) = (true, 0, 0);
        let mut idle = 0;
        let mut inserted = false;
        let mut reported = 0;
        while self.sum() > self.lower_bound && (searching || refine) {
            if refine {
                let team = &distances.team(goals);
                let round = refiner.round(&Shortest { goals, team }, &mut || self.observer.stop());
                if self.spend(round.attempts.max(1)).is_some() {
                    return;
                }
                refine_work += round.work;
                idle += 1;
                if round.gain > 0 {
                    idle = 0;
                    inserted = false;
                    self.keep(refiner.paths());
                }
                // Telling costs about as much as working on so many cells.
                if self.untold && refine_work - reported > 4 * self.cells() {
                    reported = refine_work;
                    self.tell();
                }
                if !searching && idle >= FINAL_ROUNDS {
                    return;
                }
            }
            let share = if idle < IDLE_ROUNDS { SEARCH_SHARE } else { 1 };
            if searching && refine && !inserted && idle == IDLE_ROUNDS {
                inserted = true;
                search.insert(&configurations_of(refiner.paths()), &mut distances);
            }
            while searching && (!refine || search_work * share < refine_work) {
                if self.spend(1).is_some() {
                    return;
                }
                search_work += search.work_per_step();
                match search.step(&mut distances) {
                    Step::Searching => {}
                    Step::Improved => {
                        let paths = paths_of(&search.solution());
                        if sum_of_costs(&paths) < self.sum() {
                            self.offer(&paths);
                            refiner.adopt(paths);
                            idle = 0;
                        }
                    }
                    Step::Exhausted => {
                        searching = false;
                        self.lower_bound = self.lower_bound.max(search.cost().unwrap_or(0));
                        self.observer.metric("lower_bound", self.lower_bound as f64);
                    }
                }
                searching &= search.bytes() <= self.options.memory_limit;
            }
        }
    }

    /// Takes `work` from what is left; says which limit has been met.
    fn spend(&mut self, work: u64) -> Option<Limit> {
        if self.left == 0 {
            return Some(Limit::Nodes);
        }
        self.left = self.left.saturating_sub(work);
        self.observer.stop().then_some(Limit::Stopped)
    }

    fn spent(&self) -> u64 {
        self.options.node_limit.unwrap_or(u64::MAX) - self.left
    }

    fn sum(&self) -> u64 {
        self.best.as_ref().map_or(u64::MAX, |(_, sum)| *sum)
    }

    fn paths(&self) -> Paths {
        self.best
            .as_ref()
            .map(|(paths, _)| paths.clone())
            .unwrap_or_default()
    }

    /// Keeps a plan if it is better than the best.
    fn keep(&mut self, paths: &Paths) {
        let sum = sum_of_costs(paths);
        if sum < self.sum() {
            self.best = Some((paths.clone(), sum));
            self.untold = true;
        }
    }

    /// Keeps a plan if it is better than the best, and tells the observer.
    fn offer(&mut self, paths: &Paths) {
        self.keep(paths);
        self.tell();
    }

    /// Tells the observer of the best plan if it has not heard of it.
    fn tell(&mut self) {
        if let (true, Some((paths, sum))) = (self.untold, &self.best) {
            self.observer.incumbent(&plan_of(paths, self.graph), *sum);
            self.untold = false;
        }
    }

    /// Length of the best plan.
    fn cells(&self) -> u64 {
        self.best
            .as_ref()
            .map_or(0, |(paths, sum)| sum + paths.len() as u64)
    }

    /// The end of a search without a plan: what is in reserve, if anything is.
    fn give_up(mut self, limit: Limit) -> Outcome {
        self.tell();
        if self.best.is_some() {
            self.outcome()
        } else {
            Outcome::GaveUp(limit)
        }
    }

    fn outcome(self) -> Outcome {
        match self.best {
            Some((paths, sum_of_costs)) => {
                let plan = plan_of(&paths, self.graph);
                Outcome::Solved {
                    plan,
                    sum_of_costs,
                    lower_bound: self.lower_bound,
                }
            }
            None => Outcome::GaveUp(Limit::Stopped),
        }
    }
}
