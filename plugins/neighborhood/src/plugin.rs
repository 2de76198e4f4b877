//! The planners behind the plugin contract: ids `mapf-lns2` and `mapf-lns`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Budget, Capability, GridEnvironment, Instance};
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::plan::sum_of_costs;
use fleetyard_plugin_spacetime::plugin::{Call, MEMORY, Method, NODE_LIMIT, Team};
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem};
use fleetyard_plugin_spacetime::refine::{Refiner, Shortest};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::repair::{Control, Repaired, repair};

/// Telling of a plan costs about as much as working on so many times its cells.
const REPORT: u64 = 4;

/// Repairs until there is a plan.
pub type MapfLns2 = Team<Options>;

/// Repairs until there is a plan, and makes it cheaper until the budget ends.
pub type MapfLns = Team<Anytime>;

/// Options of both planners.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Number of agents that are planned anew at a time while paths collide.
    #[schemars(range(min = 1, max = 1000))]
    neighborhood: u32,
}

impl Default for Options {
    fn default() -> Self {
        Self { neighborhood: 8 }
    }
}

impl Method for Options {
    const ID: &'static str = "mapf-lns2";
    const NAME: &'static str = "MAPF-LNS2";
    const ABOUT: &'static str = "Begins with paths that collide as little as one agent at a time \
         can help it, and plans a few agents anew until nobody collides (Li, Chen, Harabor, \
         Stuckey, Koenig, AAAI 2022). Ends with the first plan.";
    const CAPABILITIES: &'static [Capability] = &[
        Capability::Pebble,
        Capability::MoveMask,
        Capability::CollidingPlans,
    ];
    type Map = Ground;

    fn learn(&self, grid: &GridEnvironment, budget: &Budget) -> Result<Ground, Failure> {
        learn(grid, budget)
    }

    fn solve(
        &self,
        ground: &mut Ground,
        instance: &Instance,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        first_plan(ground, instance, self, call, |_, _, _| ())
    }
}

/// The same options, for the planner that goes on after its first plan.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Anytime(Options);

impl Method for Anytime {
    const ID: &'static str = "mapf-lns";
    const NAME: &'static str = "MAPF-LNS";
    const ABOUT: &'static str = "Anytime: the first plan of MAPF-LNS2, made cheaper by planning a \
         few agents anew at a time, chosen around delayed agents, around places and goals, and at \
         random, whatever has led further more often (Li, Chen, Harabor, Stuckey, Koenig, IJCAI \
         2021), until the budget ends.";
    const CAPABILITIES: &'static [Capability] = &[
        Capability::Pebble,
        Capability::MoveMask,
        Capability::CollidingPlans,
        Capability::Anytime,
        Capability::Threads,
    ];
    type Map = Ground;

    fn learn(&self, grid: &GridEnvironment, budget: &Budget) -> Result<Ground, Failure> {
        learn(grid, budget)
    }

    fn solve(
        &self,
        ground: &mut Ground,
        instance: &Instance,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        first_plan(
            ground,
            instance,
            &self.0,
            call,
            |problem, first, control| {
                improve(problem, first, call, control);
            },
        )
    }
}

/// Tables of distances get all memory: repairs need little beside them.
fn learn(grid: &GridEnvironment, budget: &Budget) -> Result<Ground, Failure> {
    let memory = match budget.memory_bytes {
        0 => MEMORY,
        bytes => bytes,
    };
    Ok(Ground::new(grid, memory)?)
}

/// Repairs, tells of what comes of it, valid or not, and goes `on` from a plan.
fn first_plan(
    ground: &mut Ground,
    instance: &Instance,
    options: &Options,
    call: &Call<'_>,
    on: impl FnOnce(&Problem, Repaired, &mut Control<'_>),
) -> Result<(), Failure> {
    let mut stop = || call.stop();
    let problem = ground.problem(instance, GoalRule::Stay, &mut stop)?;
    let mut control = Control {
        stop: &mut stop,
        nodes: call.node_limit().unwrap_or(u64::MAX),
    };
    call.metric("lower_bound", problem.lower_bound() as f64);
    let size = options.neighborhood as usize;
    let repaired = repair(&problem, size, call.budget.seed, &mut control);
    call.metric("pairs_at_first", repaired.pairs_at_first as f64);
    call.metric("repairs", repaired.neighborhoods as f64);
    call.submit(&problem.plan(&repaired.paths));
    if repaired.valid {
        on(&problem, repaired, &mut control);
        return Ok(());
    }
    Err(call.unfinished(NODE_LIMIT, "a plan was found; these paths collide"))
}

/// Makes a plan cheaper until a limit is met, or it is as cheap as the shortest paths.
fn improve(problem: &Problem, first: Repaired, call: &Call<'_>, control: &mut Control<'_>) {
    let goals: Vec<Vertex> = problem
        .routes
        .iter()
        .filter_map(|route| route.goals.last().copied())
        .collect();
    let lower_bound = problem.lower_bound();
    let mut cost = sum_of_costs(&first.paths);
    let cells = cost + first.paths.len() as u64;
    let mut refiner = Refiner::new(
        &problem.graph,
        &goals,
        first.paths,
        problem.cycles,
        call.budget.threads as usize,
        call.budget.seed,
    );
    let shortest = Shortest {
        goals: &goals,
        team: &problem.routes[..],
    };
    let (mut work, mut told) = (0, cost);
    while cost > lower_bound && control.nodes > 0 {
        let round = refiner.round(&shortest, control.stop);
        cost -= round.gain;
        control.nodes = control.nodes.saturating_sub(round.attempts.max(1));
        work += round.work;
        let stopped = (control.stop)();
        if cost < told && (stopped || work > REPORT * cells) {
            call.submit(&problem.plan(refiner.paths()));
            (work, told) = (0, cost);
        }
        if stopped {
            break;
        }
    }
    if cost < told {
        call.submit(&problem.plan(refiner.paths()));
    }
}
