//! The planners behind the plugin contract: ids `mapf-lns2` and `mapf-lns`.

use fleetyard_abi::sdk::{Failure, Options as Given, Planner, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Instance, Motion, SharedEnvironment, Status, monotonic_ns,
};
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::plan::sum_of_costs;
use fleetyard_plugin_spacetime::plugin::{self, MEMORY};
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem, Route};
use fleetyard_plugin_spacetime::refine::Refiner;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::repair::{Control, Repaired, repair};

/// Telling of a plan costs about as much as working on so many times its cells.
const REPORT: u64 = 4;

/// What both planners keep between calls: the map, and distances.
#[derive(Default)]
struct Prepared(Option<Ground>);

impl Prepared {
    fn learn(&mut self, environment: &SharedEnvironment, budget: &Budget) -> Result<(), Failure> {
        let memory = match budget.memory_bytes {
            0 => MEMORY,
            bytes => bytes,
        };
        self.0 = Some(Ground::new(environment, memory)?);
        Ok(())
    }

    /// The problem of an instance, if it is one for these planners.
    fn problem(
        &mut self,
        instance: &Instance,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Problem, Failure> {
        let unsupported = |reason: &str| Failure::new(Status::Unsupported, reason);
        let ground = self.0.as_mut().ok_or_else(|| {
            Failure::new(Status::InvalidInput, "there was no map before the instance")
        })?;
        if instance.motion != Motion::Pebble {
            return Err(unsupported("only the pebble motion model is supported"));
        }
        if instance.window_steps > 0 {
            return Err(unsupported(
                "only complete plans are supported, without a window",
            ));
        }
        let problem = ground.problem(instance, GoalRule::Stay, stop)?;
        let own = |route: &Route| route.stays && route.goals.len() == 1;
        if !problem.routes.iter().all(own) {
            return Err(unsupported("only one goal per agent is supported, its own"));
        }
        Ok(problem)
    }
}

/// Hands over paths. Those that come too late are no fault.
fn tell(problem: &Problem, paths: &[Vec<Vertex>], sink: &dyn Sink) {
    let _ = sink.submit_plan(problem.plan(paths).as_ref());
}

/// Repairs, and tells of what comes of it, valid or not.
fn first_plan(
    problem: &Problem,
    size: u32,
    seed: u64,
    control: &mut Control<'_>,
    sink: &dyn Sink,
) -> Result<Repaired, Failure> {
    sink.metric("lower_bound", problem.lower_bound() as f64);
    let repaired = repair(problem, size as usize, seed, control);
    sink.metric("pairs_at_first", repaired.pairs_at_first as f64);
    sink.metric("repairs", repaired.neighborhoods as f64);
    tell(problem, &repaired.paths, sink);
    if repaired.valid {
        return Ok(repaired);
    }
    let status = match control.nodes {
        0 => Status::GaveUp,
        _ => Status::TimedOut,
    };
    let reason = "a limit was met before a plan was found; these paths collide";
    Err(Failure::new(status, reason))
}

fn nodes(budget: &Budget) -> u64 {
    match budget.nodes {
        0 => u64::MAX,
        nodes => nodes,
    }
}

fn descriptor(id: &str, name: &str, description: &str, extra: &[Capability]) -> Descriptor {
    let common = [
        Capability::Grid,
        Capability::Pebble,
        Capability::CollidingPlans,
        Capability::Deterministic,
    ];
    plugin::descriptor(id, name, description, &common, extra)
}

/// Options of both planners.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct Options {
    /// How many agents are planned anew at a time while paths collide.
    #[schemars(range(min = 1, max = 1000))]
    neighborhood: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self { neighborhood: 8 }
    }
}

/// Repairs until there is a plan: the planner `mapf-lns2`.
pub struct MapfLns2 {
    options: Options,
    prepared: Prepared,
}

impl Plugin for MapfLns2 {
    fn descriptor() -> Descriptor {
        Descriptor {
            options_schema: options_schema::<Options>(),
            ..descriptor(
                "mapf-lns2",
                "MAPF-LNS2",
                "Begins with paths that collide as little as one agent at a time can help it, and \
                 plans a few agents anew until nobody collides (Li, Chen, Harabor, Stuckey, \
                 Koenig, AAAI 2022). Ends with the first plan.",
                &[],
            )
        }
    }

    fn create(given: Given<'_>) -> Result<Self, Failure> {
        Ok(Self {
            options: given.parse()?,
            prepared: Prepared::default(),
        })
    }
}

impl Planner for MapfLns2 {
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        _: &dyn Sink,
    ) -> Result<(), Failure> {
        self.prepared.learn(environment, budget)
    }

    fn plan(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let answer_by = budget.answer_by_ns();
        let mut stop = || monotonic_ns() >= answer_by || sink.cancelled();
        let problem = self.prepared.problem(instance, &mut stop)?;
        let mut control = Control {
            stop: &mut stop,
            nodes: nodes(budget),
        };
        let size = self.options.neighborhood;
        first_plan(&problem, size, budget.seed, &mut control, sink).map(drop)
    }
}

/// Repairs until there is a plan, and makes it cheaper until the budget ends: the planner
/// `mapf-lns`.
pub struct MapfLns {
    options: Options,
    prepared: Prepared,
}

impl Plugin for MapfLns {
    fn descriptor() -> Descriptor {
        Descriptor {
            options_schema: options_schema::<Options>(),
            ..descriptor(
                "mapf-lns",
                "MAPF-LNS",
                "Anytime: the first plan of MAPF-LNS2, made cheaper by planning a few agents anew \
                 at a time, chosen around delayed agents, around places and goals, and at random, \
                 whatever has led further more often (Li, Chen, Harabor, Stuckey, Koenig, IJCAI \
                 2021), until the budget ends.",
                &[Capability::Anytime, Capability::Threads],
            )
        }
    }

    fn create(given: Given<'_>) -> Result<Self, Failure> {
        Ok(Self {
            options: given.parse()?,
            prepared: Prepared::default(),
        })
    }
}

impl Planner for MapfLns {
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        _: &dyn Sink,
    ) -> Result<(), Failure> {
        self.prepared.learn(environment, budget)
    }

    fn plan(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let answer_by = budget.answer_by_ns();
        let mut stop = || monotonic_ns() >= answer_by || sink.cancelled();
        let problem = self.prepared.problem(instance, &mut stop)?;
        let mut control = Control {
            stop: &mut stop,
            nodes: nodes(budget),
        };
        let size = self.options.neighborhood;
        let first = first_plan(&problem, size, budget.seed, &mut control, sink)?;
        improve(&problem, first, budget, &mut control, sink);
        Ok(())
    }
}

/// Makes a plan cheaper until a limit is met, or it is as cheap as the shortest paths.
fn improve(
    problem: &Problem,
    first: Repaired,
    budget: &Budget,
    control: &mut Control<'_>,
    sink: &dyn Sink,
) {
    let goals: Vec<Vertex> = problem
        .routes
        .iter()
        .filter_map(|route| route.goals.last().copied())
        .collect();
    let lower_bound = problem.lower_bound();
    let mut cost = sum_of_costs(&first.paths);
    let cells = cost + first.paths.len() as u64;
    let threads = budget.threads as usize;
    let mut refiner = Refiner::new(
        &problem.graph,
        &goals,
        first.paths,
        problem.cycles,
        threads,
        budget.seed,
    );
    let (mut work, mut told) = (0, cost);
    while cost > lower_bound && control.nodes > 0 {
        let round = refiner.round(&problem.routes[..], control.stop);
        cost -= round.gain;
        control.nodes = control.nodes.saturating_sub(round.attempts.max(1));
        work += round.work;
        let stopped = (control.stop)();
        if cost < told && (stopped || work > REPORT * cells) {
            tell(problem, refiner.paths(), sink);
            (work, told) = (0, cost);
        }
        if stopped {
            break;
        }
    }
    if cost < told {
        tell(problem, refiner.paths(), sink);
    }
}
