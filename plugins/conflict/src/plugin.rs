//! The planners behind the plugin contract: ids `cbs` and `ecbs`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Budget, Capability, GridEnvironment, Instance, Status};
use fleetyard_plugin_spacetime::plugin::{Call, Method, NODE_LIMIT, Team, half_of_memory};
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::show::show;
use crate::{End, Settings, solve};

/// The end that a search did not come to.
const FOUND: &str = "a plan was found; these paths collide";

/// Capabilities of both planners.
const CAPABILITIES: &[Capability] = &[
    Capability::Pebble,
    Capability::MoveMask,
    Capability::Rotation,
    Capability::Windowed,
    Capability::DuplicateGoals,
    Capability::CollidingPlans,
    Capability::KRobust,
];

/// The map as both planners know it.
#[derive(Debug)]
pub struct Map {
    ground: Ground,
    step_s: f64,
}

fn learn(grid: &GridEnvironment, budget: &Budget) -> Result<Map, Failure> {
    Ok(Map {
        ground: Ground::new(grid, half_of_memory(budget))?,
        step_s: grid.step_s,
    })
}

/// Searches, and hands over the paths that come of it, colliding or not.
fn search(
    map: &mut Map,
    rule: GoalRule,
    settings: &Settings,
    instance: &Instance,
    call: &Call<'_>,
) -> Result<(), Failure> {
    let mut stop = || call.stop();
    let problem = map.ground.problem(instance, rule, &mut stop)?;
    let settings = Settings {
        node_limit: call.node_limit(),
        memory_limit: half_of_memory(call.budget),
        ..settings.clone()
    };
    let outcome = solve(&problem, &settings, &mut stop);
    call.metric("expansions", outcome.expanded as f64);
    call.metric("generated", outcome.generated as f64);
    call.metric("bypassed", outcome.bypassed as f64);
    call.metric("low_level_expansions", outcome.low_level as f64);
    call.metric("lower_bound", outcome.lower_bound as f64);
    call.submit(&problem.plan(&outcome.paths));
    if let Some(annotations) = call.annotations() {
        show(&outcome, &problem, map.step_s, annotations);
    }
    let failure = |status, reason: &str| Err(Failure::new(status, reason));
    match outcome.end {
        End::Solved => Ok(()),
        End::Infeasible if settings.delay > 0 => {
            failure(Status::GaveUp, "no plan tolerates that many steps of delay")
        }
        End::Infeasible => failure(Status::Infeasible, "the constraint tree is exhausted"),
        End::Stopped => Err(call.unfinished("the memory of one search", FOUND)),
        End::Nodes => Err(call.unfinished(NODE_LIMIT, FOUND)),
        End::Memory => failure(
            Status::GaveUp,
            "the tree reached its memory limit before a plan was found; these paths collide",
        ),
    }
}

/// Conflict-based search: optimal.
pub type ConflictBasedSearch = Team<OptimalOptions>;

/// Options of `cbs`.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OptimalOptions {
    /// Behaviour of an agent after its last goal. In a window a visit is always enough.
    goals: GoalRule,
    /// Nobody enters a cell within so many steps after somebody else was there.
    #[schemars(range(max = 1000))]
    k: u16,
}

impl Method for OptimalOptions {
    const ID: &'static str = "cbs";
    const NAME: &'static str = "CBS";
    const ABOUT: &'static str = "Conflict-based search (Sharon, Stern, Felner, Sturtevant, AIJ \
         2015): plans with the least sum of costs. With cardinal conflicts first, bypass, the \
         heuristic of pairs (WDG, Li et al., IJCAI 2019), and target, corridor and rectangle \
         reasoning (Li et al., AIJ 2021).";
    const CAPABILITIES: &'static [Capability] = CAPABILITIES;
    type Map = Map;

    fn learn(&self, grid: &GridEnvironment, budget: &Budget) -> Result<Map, Failure> {
        learn(grid, budget)
    }

    fn solve(&self, map: &mut Map, instance: &Instance, call: &Call<'_>) -> Result<(), Failure> {
        let settings = Settings {
            delay: self.k.into(),
            ..Settings::default()
        };
        search(map, self.goals, &settings, instance, call)
    }
}

/// Conflict-based search with focal lists: within a factor of the least cost.
pub type BoundedSearch = Team<BoundedOptions>;

/// Options of `ecbs`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BoundedOptions {
    /// Behaviour of an agent after its last goal. In a window a visit is always enough.
    goals: GoalRule,
    /// Nobody enters a cell within so many steps after somebody else was there.
    #[schemars(range(max = 1000))]
    k: u16,
    /// The sum of costs is at most so many times the least one. In a window only the steps
    /// within it are multiplied.
    #[schemars(range(min = 1.0, max = 100.0))]
    suboptimality: f64,
}

impl Default for BoundedOptions {
    fn default() -> Self {
        Self {
            goals: GoalRule::Stay,
            k: 0,
            suboptimality: 1.2,
        }
    }
}

impl Method for BoundedOptions {
    const ID: &'static str = "ecbs";
    const NAME: &'static str = "ECBS";
    const ABOUT: &'static str = "Enhanced conflict-based search (Barer, Sharon, Stern, Felner, SoCS \
         2014): plans within a factor of the least sum of costs, much sooner than optimal ones. In \
         a window as RHCR does it (Li et al., AAAI 2021).";
    const CAPABILITIES: &'static [Capability] = CAPABILITIES;
    type Map = Map;

    fn check(&self) -> Result<(), String> {
        if (1.0..=100.0).contains(&self.suboptimality) {
            return Ok(());
        }
        Err(format!(
            "`suboptimality` is {}; hint: give a factor from 1 to 100",
            self.suboptimality
        ))
    }

    fn learn(&self, grid: &GridEnvironment, budget: &Budget) -> Result<Map, Failure> {
        learn(grid, budget)
    }

    fn solve(&self, map: &mut Map, instance: &Instance, call: &Call<'_>) -> Result<(), Failure> {
        let settings = Settings {
            delay: self.k.into(),
            weight: self.suboptimality,
            ..Settings::default()
        };
        search(map, self.goals, &settings, instance, call)
    }
}
