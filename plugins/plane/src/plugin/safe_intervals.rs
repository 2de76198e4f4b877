//! The planner of teams in space and time behind the plugin contract: id `si-tangent`.

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Instance, Kind, KnotPlan, SharedEnvironment, Status,
};
use fleetyard_plugin_spacetime::plugin::{Call, described, parse};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::SINGLE_INTEGRATOR;
use super::robots::{agents, no_way, show, world};
use crate::prioritised::{Disc, World};
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
#[derive(Debug)]
pub struct SafeIntervalTangents(SafeIntervals);

impl Plugin for SafeIntervalTangents {
    fn descriptor() -> Descriptor {
        let about = "Anytime: plans robots in the plane as discs, each the earliest way in space and \
            time among the others by safe intervals (Phillips, Likhachev, ICRA 2011), on a \
            tangent graph with places to wait at. Who finds no way pushes others out, who plan \
            anew; then a few robots at a time are planned again (Li, Chen, Harabor, Stuckey, \
            Koenig, IJCAI 2021), until the budget ends. Neither complete nor optimal.";
        let names = ("si-tangent", "Safe intervals on a tangent graph");
        let capabilities = [
            Capability::Continuous,
            Capability::Dynamics,
            Capability::Heterogeneous,
            Capability::Anytime,
            Capability::Deterministic,
        ];
        Descriptor {
            features: vec![format!("dynamics:{SINGLE_INTEGRATOR}")],
            ..described::<SafeIntervals>(Kind::Planner, names, about, [&capabilities, &[]])
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        parse(options, |_| Ok(())).map(Self)
    }
}

impl Planner for SafeIntervalTangents {
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
        let agents = agents(instance)?;
        let discs: Vec<Disc> = agents.iter().map(|agent| agent.disc).collect();
        let effort = Effort {
            clearance: self.0.clearance_m,
            neighborhood: self.0.neighborhood as usize,
            rounds: self.0.rounds.unwrap_or(u64::MAX),
            memory: budget.memory_bytes,
            seed: budget.seed,
        };
        let mut control = Control {
            stop: &mut || call.stop(),
            nodes: call.node_limit().unwrap_or(u64::MAX),
            searches: 0,
            expanded: 0,
        };
        let mut best: Vec<Vec<Stop>> = Vec::new();
        let (outcome, figures) = plan(world, &discs, effort, &mut control, &mut |plans| {
            let knots = agents.iter().zip(plans);
            let knots: KnotPlan = knots.map(|(agent, stops)| agent.knots(stops)).collect();
            // One that comes too late is no fault.
            let _ = sink.submit(&knots);
            best = plans.to_vec();
        });
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
                if let Some(annotations) = call.annotations() {
                    show(&best, annotations);
                }
                Ok(())
            }
            Outcome::NoWay(agent) => {
                let of = (agent, &discs[agent]);
                Err(no_way(world, instance, of, &mut || call.stop()))
            }
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
            Outcome::Stopped if call.stop() => {
                let reason = "the budget ended before a plan was found";
                Err(Failure::new(Status::TimedOut, reason))
            }
            Outcome::Stopped => {
                let reason = "the limit of nodes was met before a plan was found";
                Err(Failure::new(Status::GaveUp, reason))
            }
        }
    }
}
