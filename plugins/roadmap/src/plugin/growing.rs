//! The planner `cbs-mp`.

use fleetyard_abi::sdk::{Failure, Options as Given, Planner, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Instance, Kind, KnotPlan, SharedEnvironment, Status,
};
use fleetyard_plugin_plane::plugin::SINGLE_INTEGRATOR;
use fleetyard_plugin_plane::plugin::robots::{agents, no_way, show, world};
use fleetyard_plugin_plane::prioritised::{Disc, World};
use fleetyard_plugin_plane::timing::Stop;
use fleetyard_plugin_spacetime::plugin::{Call, described, half_of_memory, parse};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::conflict::MOST_MEMORY;
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
#[derive(Debug)]
pub struct CbsMp(Options);

impl Plugin for CbsMp {
    fn descriptor() -> Descriptor {
        let about = "Anytime: plans robots in the plane, as discs, by conflict-based search in continuous \
            time on roadmaps that are drawn for each kind of robots, and again when these have grown \
            (CBS-MP: Solis, Motes, Sandstrom, Amato, RA-L 2021). Plans of small teams are the best of \
            their roadmaps. Not complete in finite time.";
        let names = (
            "cbs-mp",
            "CBS-MP: conflict-based search on growing roadmaps",
        );
        let capabilities = [
            Capability::Continuous,
            Capability::Dynamics,
            Capability::Heterogeneous,
            Capability::Anytime,
            Capability::Deterministic,
        ];
        Descriptor {
            features: vec![format!("dynamics:{SINGLE_INTEGRATOR}")],
            ..described::<Options>(Kind::Planner, names, about, [&capabilities, &[]])
        }
    }

    fn create(options: Given<'_>) -> Result<Self, Failure> {
        parse(options, |_| Ok(())).map(Self)
    }
}

impl Planner for CbsMp {
    type Map = World;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<World, Failure> {
        world(environment)
    }

    fn plan(
        &mut self,
        world: &mut World,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let call = Call::new(budget, sink);
        if !world.movers.is_empty() {
            let reason = "this planner knows no moving obstacles; hint: si-tangent does";
            return Err(Failure::new(Status::Unsupported, reason));
        }
        let agents = agents(instance)?;
        let discs: Vec<Disc> = agents.iter().map(|agent| agent.disc).collect();
        let settings = Settings {
            vertices: self.0.vertices as usize,
            clearance: self.0.clearance_m,
            anytime: self.0.anytime,
            memory: half_of_memory(budget).min(MOST_MEMORY),
            seed: budget.seed,
        };
        let mut control = Control {
            stop: &mut || call.stop(),
            nodes: call.node_limit().unwrap_or(u64::MAX),
            made: 0,
        };
        let mut best: Vec<Vec<Stop>> = Vec::new();
        let (end, figures) = plan(world, &discs, settings, &mut control, &mut |plans| {
            let knots = agents.iter().zip(plans);
            let knots: KnotPlan = knots.map(|(agent, stops)| agent.knots(stops)).collect();
            call.submit(&knots);
            best = plans.to_vec();
        });
        call.metric("nodes", control.made as f64);
        call.metric("vertices", figures.vertices as f64);
        call.metric("growths", figures.growths as f64);
        call.metric("optimal_roadmaps", figures.optimal as f64);
        if end == End::Solved {
            call.metric("first_cost_s", figures.first_cost);
            if let Some(annotations) = call.annotations() {
                show(&best, annotations);
            }
            return Ok(());
        }
        Err(match end {
            End::NoWay(agent) => {
                no_way(world, instance, (agent, &discs[agent]), &mut || call.stop())
            }
            End::Spent if call.stop() => {
                Failure::new(Status::TimedOut, "the budget ended before a plan was found")
            }
            End::Spent => Failure::new(
                Status::GaveUp,
                "the limit of nodes was met before a plan was found",
            ),
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
