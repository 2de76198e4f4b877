//! Planners in the plane behind the plugin contract.
//!
//! A planner is its options: a type that implements [`Method`] says what it is and how it plans. [`InPlane`] makes the plugin of it.
//! Here is that of `plane-pp`.

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Instance, Kind, KnotPlan, SharedEnvironment, Status,
};
use fleetyard_plugin_spacetime::plugin::{Call, described, parse};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::orders::End;
use crate::prioritised::{Disc, Effort, Outcome, World, plan};
use crate::timing::Stop;

pub mod robots;
pub mod safe_intervals;
pub mod shortest;
pub mod sssp;

use robots::{Agent, agents, no_way, show, world};

/// The dynamics of robots that may set out, turn and stop in no time.
const SINGLE_INTEGRATOR: &str = "fleetyard.single-integrator/1";

/// A way to plan; the type is that of its options.
pub trait Method: DeserializeOwned + JsonSchema + Send + 'static {
    /// The identifier.
    const ID: &'static str;
    /// The name.
    const NAME: &'static str;
    /// The method in a sentence or two, with its source.
    const ABOUT: &'static str;
    /// Features besides those of its dynamics, such as [`Descriptor::ONE_AGENT`].
    const MORE_FEATURES: &'static [&'static str] = &[];
    /// Capabilities besides [`Capability::Continuous`], [`Capability::Dynamics`] and [`Capability::Deterministic`].
    const CAPABILITIES: &'static [Capability];

    /// Plans for a team, and submits plans to the call.
    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure>;
}

/// A team in a world.
#[derive(Debug)]
pub struct Team<'a> {
    /// The world.
    pub world: &'a World,
    /// The instance.
    pub instance: &'a Instance,
    /// Its robots.
    pub agents: Vec<Agent>,
}

impl Team<'_> {
    /// The discs of all robots.
    pub fn discs(&self) -> Vec<Disc> {
        self.agents.iter().map(|agent| agent.disc).collect()
    }

    /// Submits a plan by the stops of every robot.
    pub fn submit(&self, call: &Call<'_>, plans: &[Vec<Stop>]) {
        let knots = self.agents.iter().zip(plans);
        let knots: KnotPlan = knots.map(|(agent, stops)| agent.knots(stops)).collect();
        call.submit(&knots);
    }

    /// The failure where a robot was not found to have a way, not even alone.
    pub fn no_way(&self, agent: usize, call: &Call<'_>) -> Failure {
        let of = (agent, &self.agents[agent].disc);
        no_way(self.world, self.instance, of, &mut || call.stop())
    }
}

/// Hands over the ways and waits of a plan, if somebody wants to see them.
pub fn annotate(call: &Call<'_>, plans: &[Vec<Stop>]) {
    if let Some(annotations) = call.annotations() {
        show(plans, annotations);
    }
}

/// The plugin of a [`Method`].
#[derive(Debug)]
pub struct InPlane<M>(M);

impl<M: Method> Plugin for InPlane<M> {
    fn descriptor() -> Descriptor {
        let common = &[
            Capability::Continuous,
            Capability::Dynamics,
            Capability::Deterministic,
        ];
        let names = (M::ID, M::NAME);
        Descriptor {
            features: [format!("dynamics:{SINGLE_INTEGRATOR}")]
                .into_iter()
                .chain(M::MORE_FEATURES.iter().map(|&feature| feature.to_owned()))
                .collect(),
            ..described::<M>(Kind::Planner, names, M::ABOUT, [common, M::CAPABILITIES])
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        parse(options, |_| Ok(())).map(Self)
    }
}

impl<M: Method> Planner for InPlane<M> {
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
        let team = Team {
            world,
            instance,
            agents: agents(instance)?,
        };
        self.0.solve(&team, &Call::new(budget, sink))
    }
}

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
pub type PlanePrioritised = InPlane<PlaneOptions>;

impl Method for PlaneOptions {
    const ID: &'static str = "plane-pp";
    const NAME: &'static str = "Prioritised planning in the plane";
    const ABOUT: &'static str = "Plans robots in the plane one after the other, as discs: each goes a shortest \
         way among the obstacles, by a tangent graph that is made as it is needed, and waits \
         where others pass (Cap, Novak, Kleiner, Selecky, IEEE T-ASE 2015). Neither complete \
         nor optimal.";
    const CAPABILITIES: &'static [Capability] = &[Capability::Heterogeneous];

    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let orders = OrderOptions {
            orders: self.orders,
        };
        let effort = Effort {
            clearance: self.clearance_m,
            limit: orders.within(call.budget),
            seed: call.budget.seed,
        };
        match plan(team.world, &team.discs(), effort, &mut || call.stop()) {
            Outcome::Ordered { end, orders } => {
                call.metric("nodes", orders as f64);
                let End::Solved(stops) = end else {
                    return Err(unsolved(end == End::Stopped, orders));
                };
                annotate(call, &stops);
                team.submit(call, &stops);
                Ok(())
            }
            Outcome::NoWay(agent) => Err(team.no_way(agent, call)),
            Outcome::Stopped => Err(unsolved(true, 0)),
        }
    }
}
