//! The planner behind the plugin contract: id `db-astar`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Descriptor, Status};
use fleetyard_plugin_spacetime::plugin::{Call, NODE_LIMIT, half_of_memory};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::db_cbs::shorten;
use super::{CLEARANCE_M, InStates, Method, Team, show_tree};
use crate::robot::CARS;
use crate::search::astar::{Grain, Limits, NODE_BYTES, Outcome, Pathfinder, field, first_step};

/// A\* over motion primitives for one robot.
pub type DbAstar = InStates<Options>;

/// Options of `db-astar`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Metres that a primitive leads at full speed in the first search; without it, the size of the robot, and in a wide world
    /// more.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub step_m: Option<f64>,
    /// States nearer than this part of a primitive count as the same.
    #[schemars(range(min = 0.05, max = 1.0))]
    pub alpha: f64,
    /// The factor of bounds from below in the first search; its excess is halved in each one after the first plan. Without it, 1
    /// for robots of first order without a trailer, and 2 for others.
    #[schemars(range(min = 1.0, max = 100.0))]
    pub weight: Option<f64>,
    /// The factor of the length of primitives from one search to the next.
    #[schemars(range(min = 0.1, max = 0.95))]
    pub delta_rate: f64,
    /// Most searches after the first plan, each with shorter primitives.
    #[schemars(range(max = 20))]
    pub refinements: u32,
    /// Trajectory optimisation makes plans shorter.
    pub optimise: bool,
    /// Distance that the robot keeps from all others beyond touching, in metres, where there is room for it.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clearance_m: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            step_m: None,
            alpha: 0.5,
            weight: None,
            delta_rate: 0.6,
            refinements: 2,
            optimise: true,
            clearance_m: CLEARANCE_M,
        }
    }
}

/// Most searches without a plan.
const MOST_ROUNDS: u32 = 12;

impl Method for Options {
    const ID: &'static str = "db-astar";
    const NAME: &'static str = "db-A*";
    const ABOUT: &'static str = "Anytime: one robot, A* over motion primitives that join exactly, with exact connections \
         to the goal, and again with shorter primitives (db-A*: Hönig, Ortiz-Haro, Toussaint, IROS 2022). Discs and convex \
         polygons, cars and their trailers; obstacles may move.";
    const MORE_DYNAMICS: &'static [&'static str] = &CARS;
    const MORE_FEATURES: &'static [&'static str] = &[Descriptor::ONE_AGENT];
    const CAPABILITIES: &'static [Capability] = &[Capability::Anytime];

    fn clearance_m(&self) -> f64 {
        self.clearance_m
    }

    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        if team.len() > 1 {
            return Err(Failure::new(
                Status::Unsupported,
                format!(
                    "this planner is for one robot, not for {}; hint: db-cbs and db-lacam plan for teams",
                    team.len()
                ),
            ));
        }
        if team.is_empty() {
            return Ok(team.submit(call, &[])?);
        }
        let mut stop = || call.stop();
        let Some(field) = field(team, &mut stop) else {
            return Err(call.unfinished(NODE_LIMIT, "a plan was found"));
        };
        let given = call.node_limit().unwrap_or(u64::MAX);
        let mut limits = Limits {
            nodes: given,
            memory: (half_of_memory(call.budget) / NODE_BYTES) as usize,
            stop: &mut stop,
        };
        let mut step_m = self.step_m.unwrap_or_else(|| first_step(team, 0));
        let is_hard = team.members[0].robot.is_hard_to_bound();
        let mut weight = self.weight.unwrap_or(if is_hard { 2.0 } else { 1.0 });
        let (mut best, mut after, mut failure) = (f64::INFINITY, 0, None);
        // The tree of the last plan.
        let mut lines = Vec::new();
        for round in 0..MOST_ROUNDS {
            let grain = Grain {
                step_m,
                alpha: self.alpha,
                weight,
            };
            let mut pathfinder = Pathfinder::new(team, 0, &field, grain);
            if !pathfinder.is_free_at_start() {
                failure = Some("the robot touches an obstacle at its start");
                break;
            }
            pathfinder.lines = call.annotations().map(|_| Vec::new());
            let outcome = pathfinder.find(&[], (&[], 0.0), best, &mut limits);
            if let Outcome::Found(way) = &outcome {
                lines = pathfinder.lines.take().unwrap_or_default();
                let seconds = way.course.seconds();
                team.submit(call, std::slice::from_ref(&way.course))?;
                if best.is_infinite() {
                    call.metric("first_cost_s", seconds);
                }
                best = seconds;
                if self.optimise && limits.nodes > 0 {
                    let shorter = shorten(team, call, std::slice::from_ref(&way.course));
                    best = shorter.map_or(best, |shorter| shorter[0].seconds());
                }
            }
            after += u32::from(best.is_finite());
            if after > self.refinements || matches!(outcome, Outcome::Stopped) || (limits.stop)() {
                break;
            }
            call.metric("rounds", f64::from(round + 1));
            step_m *= self.delta_rate;
            if best.is_finite() {
                weight = f64::midpoint(weight, 1.0);
            }
        }
        call.metric("nodes", (given - limits.nodes) as f64);
        show_tree(call, lines);
        if best.is_finite() {
            return Ok(());
        }
        if call.stop() || (failure.is_none() && limits.nodes == 0) {
            return Err(call.unfinished(NODE_LIMIT, "a plan was found"));
        }
        let reason = failure.unwrap_or(
            "no plan was found with the primitives and nodes that were allowed; hint: shorter primitives (step_m) fit \
             narrower gaps",
        );
        Err(Failure::new(Status::GaveUp, reason))
    }
}
