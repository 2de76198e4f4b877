//! The planners behind the plugin contract: ids `pp` and `pbs`.

use fleetyard_abi::sdk::{Annotations, Failure};
use fleetyard_abi::{Annotation, Budget, Capability, GridEnvironment, Instance, Status};
use fleetyard_plugin_spacetime::order::Prefer;
use fleetyard_plugin_spacetime::plugin::{Call, Method, NODE_LIMIT, Team, half_of_memory};
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::planner::{Control, Outcome};
use crate::prioritized;
use crate::search;

/// Charge of a turn, in steps, for a robot that drives about as fast as it turns: it stops, turns
/// and sets out again.
const TURN_CHARGE: u16 = 2;

/// Charge of a move against a lane, in steps: a short way against it is better than a long one
/// round, since others let an agent pass.
const LANE_CHARGE: u16 = 2;

fn learn(grid: &GridEnvironment, budget: &Budget, lane_charge: u16) -> Result<Ground, Failure> {
    let ground = Ground::new(grid, half_of_memory(budget))?;
    Ok(ground.with_lanes(lane_charge.into()))
}

/// Plans with `run` and hands over what comes of it, at the end of the budget too.
fn solve(
    ground: &mut Ground,
    rule: GoalRule,
    instance: &Instance,
    call: &Call<'_>,
    run: impl FnOnce(&Problem, &mut Control<'_>) -> Outcome,
) -> Result<(), Failure> {
    let mut stop = || call.stop();
    let problem = ground.problem(instance, rule, &mut stop)?;
    if problem.lanes.is_none() {
        call.metric("lower_bound", problem.lower_bound() as f64);
    }
    let mut control = Control {
        stop: &mut stop,
        nodes: call.budget.nodes,
        memory: half_of_memory(call.budget),
    };
    let outcome = run(&problem, &mut control);
    call.submit(&problem.plan(outcome.paths()));
    match outcome {
        Outcome::Solved(_) => Ok(()),
        Outcome::Stopped(_) => {
            Err(call.unfinished(NODE_LIMIT, "a plan was found; these paths collide"))
        }
        Outcome::Exhausted(_) => Err(Failure::new(
            Status::GaveUp,
            "no order of priorities leads to a plan; these paths collide",
        )),
        Outcome::Memory(_) => Err(Failure::new(
            Status::GaveUp,
            "the search reached its memory limit before a plan was found; these paths collide",
        )),
    }
}

/// Hands over agents with their ranks, 0 for the first, in the layer `priority`.
fn show(ranked: impl Iterator<Item = (usize, u32)>, problem: &Problem, to: &dyn Annotations) {
    for (agent, rank) in ranked {
        let start = problem.graph.cell(problem.routes[agent].start);
        // What is not kept the host counts.
        let _ = to.annotate(&Annotation {
            agent: Some(agent as u32),
            to_s: Some(0.0),
            text: format!("comes {}. in the order", rank + 1),
            values: vec![rank.into()],
            ..Annotation::places("priority", [[start]])
        });
    }
}

/// Prioritized planning.
pub type Prioritized = Team<PrioritizedOptions>;

/// Options of `pp`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PrioritizedOptions {
    /// Behaviour of an agent after its last goal. In a window a visit is always enough.
    goals: GoalRule,
    /// Nobody enters a cell within so many steps after somebody else was there.
    #[schemars(range(max = 1000))]
    k: u16,
    /// Charge of a turn by 90°, in steps, where agents have headings and turns take no steps of the
    /// plan: robots that are not pebbles stop for them.
    #[schemars(range(max = 1000))]
    turn_charge: u16,
    /// Charge of a move against the lanes of the map, in steps, in windows: its streets lead east
    /// and west in turn, and south and north.
    #[schemars(range(max = 100))]
    lane_charge: u16,
}

impl Default for PrioritizedOptions {
    fn default() -> Self {
        Self {
            goals: GoalRule::default(),
            k: 0,
            turn_charge: TURN_CHARGE,
            lane_charge: LANE_CHARGE,
        }
    }
}

impl Method for PrioritizedOptions {
    const ID: &'static str = "pp";
    const NAME: &'static str = "Prioritized planning";
    const ABOUT: &'static str = "One agent after the other, each out of the way of those before \
         it (Erdmann, Lozano-Pérez, Algorithmica 1987), by SIPP; other orders when somebody finds \
         no path, until the budget ends. Not complete, not optimal.";
    const CAPABILITIES: &'static [Capability] = &[
        Capability::Pebble,
        Capability::MoveMask,
        Capability::Rotation,
        Capability::Windowed,
        Capability::DuplicateGoals,
        Capability::CollidingPlans,
        Capability::KRobust,
    ];
    type Map = Ground;

    fn learn(&self, grid: &GridEnvironment, budget: &Budget) -> Result<Ground, Failure> {
        learn(grid, budget, self.lane_charge)
    }

    fn solve(
        &self,
        ground: &mut Ground,
        instance: &Instance,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        let options = prioritized::Options {
            delay: self.k.into(),
            turn_charge: self.turn_charge.into(),
        };
        solve(ground, self.goals, instance, call, |problem, control| {
            let seed = call.budget.seed;
            let (outcome, effort) = prioritized::plan(problem, options, seed, control);
            call.metric("orders", effort.orders as f64);
            call.metric("expansions", effort.expansions as f64);
            if let Some(annotations) = call.annotations() {
                show(effort.order.iter().copied().zip(0..), problem, annotations);
            }
            outcome
        })
    }
}

/// Priority-based search.
pub type PriorityBasedSearch = Team<SearchOptions>;

/// Options of `pbs`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SearchOptions {
    /// Behaviour of an agent after its last goal. In a window a visit is always enough.
    goals: GoalRule,
    /// The one of two decisions that is followed first: `collisions` ends sooner, `cost` gives
    /// shorter plans.
    prefer: Prefer,
    /// Charge of a turn by 90°, in steps, where agents have headings and turns take no steps of the
    /// plan: robots that are not pebbles stop for them.
    #[schemars(range(max = 1000))]
    turn_charge: u16,
    /// Charge of a move against the lanes of the map, in steps, in windows: its streets lead east
    /// and west in turn, and south and north.
    #[schemars(range(max = 100))]
    lane_charge: u16,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self {
            goals: GoalRule::default(),
            prefer: Prefer::default(),
            turn_charge: TURN_CHARGE,
            lane_charge: LANE_CHARGE,
        }
    }
}

impl Method for SearchOptions {
    const ID: &'static str = "pbs";
    const NAME: &'static str = "PBS";
    const ABOUT: &'static str = "Priority-based search (Ma, Harabor, Stuckey, Li, Koenig, AAAI \
         2019): decides who goes first only where two agents collide, depth first; windowed as in \
         rolling-horizon collision resolution (Li et al., AAAI 2021). Not complete, not optimal.";
    const CAPABILITIES: &'static [Capability] = &[
        Capability::Pebble,
        Capability::MoveMask,
        Capability::Rotation,
        Capability::Windowed,
        Capability::DuplicateGoals,
        Capability::CollidingPlans,
    ];
    type Map = Ground;

    fn learn(&self, grid: &GridEnvironment, budget: &Budget) -> Result<Ground, Failure> {
        learn(grid, budget, self.lane_charge)
    }

    fn solve(
        &self,
        ground: &mut Ground,
        instance: &Instance,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        let options = search::Options {
            prefer: self.prefer,
            turn_charge: self.turn_charge.into(),
        };
        solve(ground, self.goals, instance, call, |problem, control| {
            let (outcome, effort) = search::plan(problem, options, call.budget.seed, control);
            call.metric("nodes", effort.nodes as f64);
            call.metric("paths", effort.paths as f64);
            call.metric("expansions", effort.expansions as f64);
            if let Some(annotations) = call.annotations() {
                show((0..).zip(effort.ranks), problem, annotations);
            }
            outcome
        })
    }
}
