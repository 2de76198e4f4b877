//! Planners of teams on 4-connected grids behind the plugin contract.
//!
//! A planner is its options: a type that implements [`Method`] says what it is, how it learns
//! a map, and how it solves an instance. [`Team`] makes the plugin of it.

use fleetyard_abi::sdk::{Annotations, Failure, Options, Planner, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, Environment, GridEnvironment, Instance, Kind,
    PlanRef, SharedEnvironment, Status, monotonic_ns,
};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;

/// The limit of a budget's nodes, for [`Call::unfinished`].
pub const NODE_LIMIT: &str = "the limit of nodes";
/// That limit, or that of memory.
pub const ROOM_LIMIT: &str = "the limit of nodes or memory";

/// Bytes for tables of distances, and again for the search, where the budget says nothing.
pub const MEMORY: u64 = 1 << 30;

/// A way to solve instances; the type is that of its options.
pub trait Method: DeserializeOwned + JsonSchema + Send + 'static {
    /// The identifier.
    const ID: &'static str;
    /// The name.
    const NAME: &'static str;
    /// The method in a sentence or two, with its source.
    const ABOUT: &'static str;
    /// Capabilities besides [`Capability::Grid`] and [`Capability::Deterministic`].
    /// Those that go by the graph of the map alone take one-way streets.
    const CAPABILITIES: &'static [Capability];
    /// Identifiers of the parts of instances that the method reads.
    const PARTS: &'static [&'static str] = &[];
    /// The map as the method knows it, kept between calls.
    type Map: Send;

    /// The reason why the options are refused, beyond what their schema says.
    fn check(&self) -> Result<(), String> {
        Ok(())
    }

    /// Learns a map.
    fn learn(&self, grid: &GridEnvironment, budget: &Budget) -> Result<Self::Map, Failure>;

    /// Solves an instance, and submits plans to the call.
    fn solve(
        &self,
        map: &mut Self::Map,
        instance: &Instance,
        call: &Call<'_>,
    ) -> Result<(), Failure>;
}

/// The plugin of a [`Method`].
#[derive(Debug)]
pub struct Team<M>(M);

impl<M: Method> Plugin for Team<M> {
    fn descriptor() -> Descriptor {
        let common = &[Capability::Grid, Capability::Deterministic];
        let names = (M::ID, M::NAME);
        let features = M::PARTS.iter().map(|id| format!("part:{id}"));
        Descriptor {
            features: features.collect(),
            ..described::<M>(Kind::Planner, names, M::ABOUT, [common, M::CAPABILITIES])
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        parse(options, M::check).map(Self)
    }
}

impl<M: Method> Planner for Team<M> {
    type Map = M::Map;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        _: &dyn Sink,
    ) -> Result<M::Map, Failure> {
        self.0.learn(grid_of(environment)?, budget)
    }

    fn plan(
        &mut self,
        map: &mut M::Map,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        self.0.solve(map, instance, &Call::new(budget, sink))
    }
}

/// A descriptor of a plugin that comes with the host.
pub fn described<O: JsonSchema>(
    kind: Kind,
    (id, name): (&str, &str),
    about: &str,
    capabilities: [&[Capability]; 2],
) -> Descriptor {
    Descriptor {
        name: name.into(),
        version: env!("CARGO_PKG_VERSION").into(),
        license: env!("CARGO_PKG_LICENSE").into(),
        capabilities: Capabilities::of(&capabilities.concat()),
        options_schema: options_schema::<O>(),
        ..Descriptor::new(kind, id, about)
    }
}

/// The options of a plugin. `check` says what is wrong with them, beyond what their schema
/// says.
pub fn parse<O: DeserializeOwned>(
    options: Options<'_>,
    check: impl FnOnce(&O) -> Result<(), String>,
) -> Result<O, Failure> {
    let options = options.parse()?;
    let invalid = |reason| Failure::new(Status::InvalidInput, format!("options: {reason}"));
    check(&options).map_err(invalid)?;
    Ok(options)
}

/// The grid of an environment, which has to be one.
pub fn grid_of(environment: &Environment) -> Result<&GridEnvironment, Failure> {
    let other = "maps other than grids are not supported";
    let unsupported = || Failure::new(Status::Unsupported, other);
    environment.grid().ok_or_else(unsupported)
}

/// A call of a planner: the budget it has, and the host that listens.
pub struct Call<'a> {
    /// All that it may use.
    pub budget: &'a Budget,
    sink: &'a dyn Sink,
    answer_by_ns: u64,
}

impl<'a> Call<'a> {
    /// A call with a budget, which tells a sink.
    pub fn new(budget: &'a Budget, sink: &'a dyn Sink) -> Self {
        Self {
            budget,
            sink,
            answer_by_ns: budget.answer_by_ns,
        }
    }

    /// True when the call has to end: a little before the deadline, so that the last word is said
    /// in time, or when the host gave up. Reads the clock.
    pub fn stop(&self) -> bool {
        monotonic_ns() >= self.answer_by_ns || self.sink.cancelled()
    }

    /// The time by which a share of what is left of the call ends, one of so many.
    pub fn share_ends_ns(&self, shares: u32) -> u64 {
        let now_ns = monotonic_ns();
        now_ns + self.answer_by_ns.saturating_sub(now_ns) / u64::from(shares)
    }

    /// The most search nodes, if the budget limits them.
    pub fn node_limit(&self) -> Option<u64> {
        (self.budget.nodes > 0).then_some(self.budget.nodes)
    }

    /// The failure of a search that ended before there was `what`: its time was up, or it reached
    /// another limit.
    pub fn unfinished(&self, limit: &str, what: &str) -> Failure {
        if self.stop() {
            return Failure::new(Status::TimedOut, format!("the budget ended before {what}"));
        }
        Failure::new(Status::GaveUp, format!("{limit} was reached before {what}"))
    }

    /// Submits a plan. One that comes too late is no fault.
    pub fn submit<'p>(&self, plan: impl Into<PlanRef<'p>>) {
        let _ = self.sink.submit(plan);
    }

    /// Takes what is to be shown, if somebody wants to see it.
    pub fn annotations(&self) -> Option<&'a dyn Annotations> {
        self.sink.annotations()
    }

    /// Reports a figure.
    pub fn metric(&self, name: &str, value: f64) {
        self.sink.metric(name, value);
    }
}

/// Three quarters of what the budget allows, since there is more that nobody counts: for a search that has no tables
/// beside.
pub fn most_of_memory(budget: &Budget) -> u64 {
    match budget.memory_bytes {
        0 => 2 * MEMORY,
        bytes => bytes - bytes / 4,
    }
}

/// Half of what the budget allows: for tables of distances, and again for the search.
pub fn half_of_memory(budget: &Budget) -> u64 {
    match budget.memory_bytes {
        0 => MEMORY,
        bytes => bytes / 2,
    }
}
