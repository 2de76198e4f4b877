//! The planner behind the plugin contract: id `plane-pp`.

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Instance, Kind, KnotPlan, SharedEnvironment, Status,
};
use fleetyard_plugin_spacetime::plugin::{Call, described, parse};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::orders::End;
use crate::prioritised::{Disc, Effort, Outcome, World, plan};

pub mod robots;
pub mod safe_intervals;
pub mod shortest;
pub mod sssp;

use robots::{agents, no_way, show, world};

/// The dynamics of robots that may set out, turn and stop in no time.
pub const SINGLE_INTEGRATOR: &str = "fleetyard.single-integrator/1";

/// Options of `plane-pp` and `roadmap-pp`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OrderOptions {
    /// Most orders of priority to try.
    #[schemars(range(min = 1))]
    pub orders: u64,
}

impl Default for OrderOptions {
    fn default() -> Self {
        Self { orders: 1000 }
    }
}

impl OrderOptions {
    /// Most orders to try within a budget, whose search nodes they are.
    pub fn within(&self, budget: &Budget) -> u64 {
        match budget.nodes {
            0 => self.orders,
            nodes => self.orders.min(nodes),
        }
    }
}

/// The failure of a search that was told to stop, or that tried all orders it may.
pub fn unsolved(stopped: bool, orders: u64) -> Failure {
    if stopped {
        return Failure::new(Status::TimedOut, "the budget ended before a plan was found");
    }
    let reason = format!("none of {orders} orders of priority leads to a plan");
    Failure::new(Status::GaveUp, reason)
}

/// Options of `plane-pp`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PlaneOptions {
    /// Most orders of priority to try.
    #[schemars(range(min = 1))]
    pub orders: u64,
    /// Distance that robots keep from obstacles and from each other beyond touching, in metres,
    /// where there is room for it: who drives in steps cuts corners a little.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub clearance_m: f64,
}

impl Default for PlaneOptions {
    fn default() -> Self {
        Self {
            orders: OrderOptions::default().orders,
            clearance_m: 0.01,
        }
    }
}

/// Prioritised planning of discs in the plane.
#[derive(Debug)]
pub struct PlanePrioritised(PlaneOptions);

impl Plugin for PlanePrioritised {
    fn descriptor() -> Descriptor {
        let about = "Plans robots in the plane one after the other, as discs: each goes a shortest \
            way among the obstacles, by a tangent graph that is made as it is needed, and waits \
            where others pass (Cap, Novak, Kleiner, Selecky, IEEE T-ASE 2015). Neither complete \
            nor optimal.";
        let names = ("plane-pp", "Prioritised planning in the plane");
        let capabilities = [
            Capability::Continuous,
            Capability::Dynamics,
            Capability::Heterogeneous,
            Capability::Deterministic,
        ];
        Descriptor {
            features: vec![format!("dynamics:{SINGLE_INTEGRATOR}")],
            ..described::<PlaneOptions>(Kind::Planner, names, about, [&capabilities, &[]])
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        parse(options, |_| Ok(())).map(Self)
    }
}

impl Planner for PlanePrioritised {
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
        let orders = OrderOptions {
            orders: self.0.orders,
        };
        let effort = Effort {
            clearance: self.0.clearance_m,
            limit: orders.within(budget),
            seed: budget.seed,
        };
        match plan(world, &discs, effort, &mut || call.stop()) {
            Outcome::Ordered { end, orders } => {
                call.metric("nodes", orders as f64);
                let End::Solved(stops) = end else {
                    return Err(unsolved(end == End::Stopped, orders));
                };
                if let Some(annotations) = call.annotations() {
                    show(&stops, annotations);
                }
                let knots = agents.iter().zip(&stops);
                let knots: KnotPlan = knots.map(|(agent, stops)| agent.knots(stops)).collect();
                Ok(sink.submit(&knots)?)
            }
            Outcome::NoWay(agent) => {
                let of = (agent, &discs[agent]);
                Err(no_way(world, instance, of, &mut || call.stop()))
            }
            Outcome::Stopped => Err(unsolved(true, 0)),
        }
    }
}
