//! The planner `cbs-mp`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Status};
use fleetyard_plugin_plane::plugin::{InPlane, Method, Team, annotate};
use fleetyard_plugin_plane::timing::Stop;
use fleetyard_plugin_spacetime::plugin::{Call, NODE_LIMIT, most_of_memory};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::growing::{Control, End, Settings, plan};

/// Options of `cbs-mp`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Vertices that are drawn at first for the robots of one radius and speed. Each time roadmaps grow they have twice as many.
    #[schemars(range(min = 1, max = 10000))]
    vertices: u32,
    /// Distance that robots keep from obstacles and from each other beyond touching, in metres, where starts and goals leave room
    /// for it: who drives in steps cuts corners a little.
    #[schemars(range(min = 0.0, max = 1000.0))]
    clearance_m: f64,
    /// Let roadmaps grow after the first plan, until the budget ends.
    anytime: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            vertices: 100,
            clearance_m: 0.01,
            anytime: true,
        }
    }
}

/// Conflict-based search of discs in the plane, on roadmaps that grow.
pub type CbsMp = InPlane<Options>;

impl Method for Options {
    const ID: &'static str = "cbs-mp";
    const NAME: &'static str = "CBS-MP: conflict-based search on growing roadmaps";
    const ABOUT: &'static str = "Anytime: plans robots in the plane, as discs, by conflict-based search in continuous \
         time on roadmaps that are drawn for each kind of robots, and again when these have grown \
         (CBS-MP: Solis, Motes, Sandstrom, Amato, RA-L 2021). Plans of small teams are the best of \
         their roadmaps. Not complete in finite time.";
    const CAPABILITIES: &'static [Capability] = &[Capability::Heterogeneous, Capability::Anytime];

    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let world = team.world;
        if !world.movers.is_empty() {
            let reason = "this planner knows no moving obstacles; hint: si-tangent does";
            return Err(Failure::new(Status::Unsupported, reason));
        }
        let settings = Settings {
            vertices: self.vertices as usize,
            clearance: self.clearance_m,
            anytime: self.anytime,
            memory: most_of_memory(call.budget),
            seed: call.budget.seed,
        };
        let mut control = Control {
            stop: &mut || call.stop(),
            nodes: call.node_limit().unwrap_or(u64::MAX),
            made: 0,
        };
        let mut best: Vec<Vec<Stop>> = Vec::new();
        let mut told = |plans: &[Vec<Stop>]| {
            team.submit(call, plans);
            best = plans.to_vec();
        };
        let (end, figures) = plan(world, &team.discs(), settings, &mut control, &mut told);
        call.metric("nodes", control.made as f64);
        call.metric("vertices", figures.vertices as f64);
        call.metric("growths", figures.growths as f64);
        call.metric("optimal_roadmaps", figures.optimal as f64);
        if end == End::Solved {
            call.metric("first_cost_s", figures.first_cost);
            annotate(call, &best);
            return Ok(());
        }
        Err(match end {
            End::NoWay(agent) => team.no_way(agent, call),
            End::Spent => call.unfinished(NODE_LIMIT, "a plan was found"),
            _ => Failure::new(
                Status::GaveUp,
                format!(
                    "roadmaps of {} vertices have no plan that is found in time",
                    figures.vertices
                ),
            ),
        })
    }
}
