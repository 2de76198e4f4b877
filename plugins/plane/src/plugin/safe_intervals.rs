//! The planner of teams in space and time behind the plugin contract: id `si-tangent`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Status};
use fleetyard_plugin_spacetime::plugin::{Call, NODE_LIMIT};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{InPlane, Method, Team, annotate};
use crate::team::plan::{Effort, Outcome, plan};
use crate::team::search::Control;
use crate::timing::Stop;

/// Options of `si-tangent`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SafeIntervals {
    /// Distance that robots keep from obstacles and from each other beyond touching, in metres,
    /// where there is room for it: who drives in steps cuts corners a little.
    #[schemars(range(min = 0.0, max = 1000.0))]
    clearance_m: f64,
    /// Most robots that are planned anew at a time.
    #[schemars(range(min = 1, max = 1000))]
    neighborhood: u32,
    /// Most times that some robots are planned anew after the first plan; null for as many as the
    /// budget allows.
    rounds: Option<u64>,
}

impl Default for SafeIntervals {
    fn default() -> Self {
        Self {
            clearance_m: 0.01,
            neighborhood: 8,
            rounds: None,
        }
    }
}

/// Safe-interval path planning of discs in the plane.
pub type SafeIntervalTangents = InPlane<SafeIntervals>;

impl Method for SafeIntervals {
    const ID: &'static str = "si-tangent";
    const NAME: &'static str = "Safe intervals on a tangent graph";
    const ABOUT: &'static str = "Anytime: plans robots in the plane as discs, each the earliest way in space and \
         time among the others by safe intervals (Phillips, Likhachev, ICRA 2011), on a \
         tangent graph with places to wait at. Who finds no way pushes others out, who plan \
         anew; then a few robots at a time are planned again (Li, Chen, Harabor, Stuckey, \
         Koenig, IJCAI 2021), until the budget ends. Neither complete nor optimal.";
    const CAPABILITIES: &'static [Capability] = &[Capability::Heterogeneous, Capability::Anytime];

    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let effort = Effort {
            clearance: self.clearance_m,
            neighborhood: self.neighborhood as usize,
            rounds: self.rounds.unwrap_or(u64::MAX),
            memory: call.budget.memory_bytes,
            seed: call.budget.seed,
        };
        let mut control = Control {
            stop: &mut || call.stop(),
            nodes: call.node_limit().unwrap_or(u64::MAX),
            searches: 0,
            expanded: 0,
        };
        let mut best: Vec<Vec<Stop>> = Vec::new();
        let mut told = |plans: &[Vec<Stop>]| {
            team.submit(call, plans);
            best = plans.to_vec();
        };
        let discs = team.discs();
        let (outcome, figures) = plan(team.world, &discs, effort, &mut control, &mut told);
        for (name, value) in [
            ("expansions", control.expanded),
            ("nodes", control.searches),
            ("ejections", figures.ejections),
            ("rounds", figures.rounds),
        ] {
            call.metric(name, value as f64);
        }
        match outcome {
            Outcome::Solved => {
                annotate(call, &best);
                Ok(())
            }
            Outcome::NoWay(agent) => Err(team.no_way(agent, call)),
            Outcome::GaveUp(0) => {
                let reason = "a robot finds no way among the movers, not even alone";
                Err(Failure::new(Status::GaveUp, reason))
            }
            Outcome::GaveUp(ejections) => {
                let reason = format!(
                    "robots pushed each other out {ejections} times, and not all have a way"
                );
                Err(Failure::new(Status::GaveUp, reason))
            }
            Outcome::Stopped => Err(call.unfinished(NODE_LIMIT, "a plan was found")),
        }
    }
}
