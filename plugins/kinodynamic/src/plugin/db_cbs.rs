//! The planner behind the plugin contract: id `db-cbs`.

use std::rc::Rc;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Status};
use fleetyard_plugin_spacetime::plugin::{Call, NODE_LIMIT, half_of_memory};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{CLEARANCE_M, InStates, Method, Team};
use crate::course::Course;
use crate::optimise::shortened;
use crate::robot::CARS;
use crate::search::astar::{Grain, Limits, NODE_BYTES, Pathfinder, Way, field, first_step};
use crate::search::cbs::{Effort, Ended, Search};

/// Conflict-based search over motion primitives.
pub type DbCbs = InStates<Options>;

/// Options of `db-cbs`.
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
    /// The factor of the length of primitives from one search to the next, where one ends without a plan.
    #[schemars(range(min = 0.1, max = 0.95))]
    pub delta_rate: f64,
    /// The factor of bounds from below in searches of one robot. Without it, 1 for robots of first order without a trailer, and 1.5
    /// for others.
    #[schemars(range(min = 1.0, max = 100.0))]
    pub weight: Option<f64>,
    /// The factor of the least cost within which the node with the fewest pairs that touch is expanded.
    #[schemars(range(min = 1.0, max = 100.0))]
    pub w: f64,
    /// Seconds before and after a contact in which one robot keeps clear of the other; doubles with each constraint of both.
    #[schemars(range(min = 0.01, max = 1000.0))]
    pub window_s: f64,
    /// Seconds that a motion which touches another robot costs more in searches of one robot.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub penalty_s: f64,
    /// Most nodes of one search of one robot.
    #[schemars(range(min = 1))]
    pub low_level_nodes: u64,
    /// At last trajectory optimisation makes the plan shorter.
    pub optimise: bool,
    /// Distance that robots keep from all others beyond touching, in metres, where there is room for it.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub clearance_m: f64,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            step_m: None,
            alpha: 0.5,
            delta_rate: 0.7,
            weight: None,
            w: 1.2,
            window_s: 0.5,
            penalty_s: 0.5,
            low_level_nodes: 20_000,
            optimise: true,
            clearance_m: CLEARANCE_M,
        }
    }
}

/// Most searches.
const MOST_ROUNDS: u32 = 12;

/// The weight of bounds from below for robots of second order and those with a trailer, whose bounds are farther off.
const HARD_WEIGHT: f64 = 1.5;

/// Added to that weight after searches of one robot that met their limit.
const HURRY: f64 = 0.5;

impl Method for Options {
    const ID: &'static str = "db-cbs";
    const NAME: &'static str = "db-CBS";
    const ABOUT: &'static str = "Anytime: conflict-based search over motion primitives that join exactly; robots keep clear of \
         each other's motions round a contact (db-CBS: Moldagalieva, Ortiz-Haro, Toussaint, Hönig, ICRA 2024). Discs and \
         convex polygons, cars and their trailers; obstacles may move.";
    const MORE_DYNAMICS: &'static [&'static str] = &CARS;
    const CAPABILITIES: &'static [Capability] = &[Capability::Heterogeneous, Capability::Anytime];

    fn clearance_m(&self) -> f64 {
        self.clearance_m
    }

    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
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
        let effort = Effort {
            w: self.w,
            window_s: self.window_s,
            penalty_s: self.penalty_s,
            nodes: self.low_level_nodes,
        };
        let (mut factor, mut hurry, mut conflicts, mut failure) = (1.0, 0.0, 0, None);
        let mut found = false;
        for _ in 0..MOST_ROUNDS {
            let own = |agent: usize| {
                let is_hard = team.members[agent].robot.is_hard_to_bound();
                let grain = Grain {
                    step_m: self.step_m.unwrap_or_else(|| first_step(team, agent)) * factor,
                    alpha: self.alpha,
                    weight: hurry
                        + self
                            .weight
                            .unwrap_or(if is_hard { HARD_WEIGHT } else { 1.0 }),
                };
                Pathfinder::new(team, agent, &field, grain)
            };
            let agents = (0..team.len()).take_while(|_| !call.stop());
            let mut pathfinders: Vec<Pathfinder<'_>> = agents.map(own).collect();
            if pathfinders.len() < team.len() {
                break;
            }
            if let Some(agent) = pathfinders.iter().position(|own| !own.is_free_at_start()) {
                failure = Some(format!("agent {agent} touches an obstacle at its start"));
                break;
            }
            let mut search = Search::new(team, &mut pathfinders, effort);
            let ended = search.run(&mut limits);
            conflicts += search.expanded;
            match ended {
                Ended::Found(mut ways) => {
                    submit(team, call, &ways)?;
                    call.metric("first_cost_s", cost(&ways));
                    found = true;
                    search.improve(&mut ways, &mut limits, |ways| {
                        // Checked before; a plan that fails is left out.
                        let _ = submit(team, call, ways);
                    });
                    if self.optimise && limits.nodes > 0 {
                        let _ = shorten(team, call, &courses(&ways));
                    }
                    break;
                }
                Ended::NoWay(agent) => {
                    failure = Some(format!(
                        "agent {agent} was found no way, not even alone; hint: shorter primitives (step_m) fit narrower gaps"
                    ));
                    factor *= self.delta_rate;
                }
                Ended::Exhausted => factor *= self.delta_rate,
                // Searches of one robot took too long.
                Ended::Stopped => hurry += HURRY,
            }
            if limits.nodes == 0 || (limits.stop)() {
                break;
            }
        }
        call.metric("nodes", (given - limits.nodes) as f64);
        call.metric("conflicts", conflicts as f64);
        if found {
            return Ok(());
        }
        if call.stop() || (failure.is_none() && limits.nodes == 0) {
            return Err(call.unfinished(NODE_LIMIT, "a plan was found"));
        }
        let reason = failure.unwrap_or_else(|| {
            "no plan was found with the primitives and nodes that were allowed; hint: db-lacam plans for crowds".to_owned()
        });
        Err(Failure::new(Status::GaveUp, reason))
    }
}

fn cost(ways: &[Rc<Way>]) -> f64 {
    ways.iter().map(|way| way.course.seconds()).sum()
}

fn courses(ways: &[Rc<Way>]) -> Vec<Course> {
    ways.iter().map(|way| way.course.clone()).collect()
}

/// A plan that ends sooner in sum, if trajectory optimisation finds one and it is valid; then it was submitted.
pub(super) fn shorten(team: &Team<'_>, call: &Call<'_>, courses: &[Course]) -> Option<Vec<Course>> {
    let (shorter, figures) = shortened(team, courses, &mut || call.stop());
    call.metric("programs", figures.programs as f64);
    shorter.filter(|shorter| team.submit(call, shorter).is_ok())
}

fn submit(team: &Team<'_>, call: &Call<'_>, ways: &[Rc<Way>]) -> Result<(), Failure> {
    Ok(team.submit(call, &courses(ways))?)
}
