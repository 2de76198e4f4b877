//! The planner behind the plugin contract: id `db-lacam`.

use std::rc::Rc;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Status};
use fleetyard_plugin_spacetime::plugin::{Call, NODE_LIMIT, half_of_memory};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::db_cbs::shorten;
use super::{CLEARANCE_M, InStates, Method, Team};
use crate::robot::CARS;
use crate::search::astar::{
    Grain, Limits, NODE_BYTES, Pathfinder, Way, field, first_step, step_seconds,
};
use crate::search::cbs::{Effort, Search as Improver};
use crate::search::lacam::{Ended, Search};

/// LaCAM over motion primitives.
pub type DbLacam = InStates<Options>;

/// Options of `db-lacam`.
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
    /// Most configurations of the first search; each further one has twice as many.
    #[schemars(range(min = 1))]
    pub configurations: u64,
    /// Robots of the plan are planned anew, each among all others, until none gets sooner or the budget ends.
    pub improve: bool,
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
            delta_rate: 0.8,
            configurations: 500,
            improve: true,
            optimise: true,
            clearance_m: CLEARANCE_M,
        }
    }
}

/// Most searches.
const MOST_ROUNDS: u32 = 12;

/// Bytes of a robot in a configuration.
const ROBOT_BYTES: u64 = 2048;

/// The weight of bounds from below where robots are planned anew.
const WEIGHT: f64 = 1.2;

/// Most nodes of a search where a robot is planned anew.
const NODES: u64 = 3000;

impl Method for Options {
    const ID: &'static str = "db-lacam";
    const NAME: &'static str = "db-LaCAM";
    const ABOUT: &'static str = "Anytime: robots choose motion primitives step by step, and push each other out of the way; each can \
         always brake (LaCAM: Okumura, AAAI 2023, over motion primitives as db-LaCAM). Then each is planned anew among \
         the others. Discs and convex polygons, cars and their trailers; obstacles may move.";
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
        let mut left = call.node_limit().unwrap_or(u64::MAX);
        let given = left;
        let (mut factor, mut failure, mut found) = (1.0, None, false);
        for round in 0..MOST_ROUNDS {
            let grain = |agent: usize| Grain {
                step_m: self.step_m.unwrap_or_else(|| first_step(team, agent)) * factor,
                alpha: self.alpha,
                weight: WEIGHT,
            };
            // Steps are as long for all.
            let steps = (0..team.len())
                .map(|agent| step_seconds(&team.members[agent].robot, grain(agent).step_m));
            let step = steps.reduce(f64::min).unwrap_or(1.0);
            let own = |agent: usize| Pathfinder::in_steps(team, agent, &field, grain(agent), step);
            let agents = (0..team.len()).take_while(|_| !call.stop());
            let mut pathfinders: Vec<Pathfinder<'_>> = agents.map(own).collect();
            if pathfinders.len() < team.len() {
                break;
            }
            if let Some(agent) = pathfinders.iter().position(|own| !own.is_free_at_start()) {
                failure = Some(format!("agent {agent} touches an obstacle at its start"));
                break;
            }
            let seed = call.budget.seed.wrapping_add(u64::from(round));
            let mut search = Search::new(team, &mut pathfinders, &field, step, seed);
            let most = left.min(self.configurations << round);
            let robots = ROBOT_BYTES * team.len().max(1) as u64;
            let memory = (half_of_memory(call.budget) / robots).max(1) as usize;
            let ended = search.run(most, memory, &mut stop);
            left = left.saturating_sub(search.made);
            match ended {
                Ended::Found(courses) => {
                    team.submit(call, &courses)?;
                    found = true;
                    let mut ways: Vec<Rc<Way>> = courses
                        .into_iter()
                        .enumerate()
                        .map(|(agent, course)| Rc::new(Way::new(&team.members[agent], course)))
                        .collect();
                    let seconds: f64 = ways.iter().map(|way| way.course.seconds()).sum();
                    call.metric("first_cost_s", seconds);
                    if self.improve {
                        let effort = Effort {
                            w: 1.0,
                            window_s: 1.0,
                            penalty_s: 0.0,
                            nodes: NODES,
                        };
                        let mut limits = Limits {
                            nodes: left,
                            memory: (half_of_memory(call.budget) / NODE_BYTES) as usize,
                            stop: &mut stop,
                        };
                        let mut improver = Improver::new(team, &mut pathfinders, effort);
                        improver.improve(&mut ways, &mut limits, |ways| {
                            let courses: Vec<_> =
                                ways.iter().map(|way| way.course.clone()).collect();
                            // What is not valid is left out; the plan before it stands.
                            let _ = team.submit(call, &courses);
                        });
                        left = limits.nodes;
                    }
                    if self.optimise && left > 0 {
                        let courses: Vec<_> = ways.iter().map(|way| way.course.clone()).collect();
                        let _ = shorten(team, call, &courses);
                    }
                    break;
                }
                Ended::Unsafe => {
                    failure = Some("robots touch something before they can stop".to_owned());
                    break;
                }
                Ended::Exhausted | Ended::Stopped => {}
            }
            if left == 0 || stop() {
                break;
            }
            factor *= self.delta_rate;
        }
        call.metric("nodes", (given - left) as f64);
        if found {
            return Ok(());
        }
        if call.stop() || (failure.is_none() && left == 0) {
            return Err(call.unfinished(NODE_LIMIT, "a plan was found"));
        }
        let reason = failure.unwrap_or_else(|| {
            "no plan was found in the configurations that were allowed; hint: db-cbs searches further for small teams".to_owned()
        });
        Err(Failure::new(Status::GaveUp, reason))
    }
}
