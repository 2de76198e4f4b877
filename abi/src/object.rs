//! Plugins that have been made, as hosts call them: one trait for each kind, the same for a
//! Rust crate, for a library that was loaded and for an adapter.
//!
//! [`Object::planner`] and its like make one of a plugin that is written with the
//! [SDK](crate::sdk): they keep the map that `prepare` learns, and refuse what authors would
//! have to refuse otherwise, each in the same words: calls before a map, instances that are
//! not whole, and what an instance needs and the descriptor does not claim.

use std::fmt;

use crate::leftovers;
use crate::model::{
    Budget, Capabilities, Capability, Descriptor, FleetState, FleetStatus, Instance, Kind,
    SharedEnvironment, Status, critical,
};
use crate::plan::Plan;
use crate::sdk::{self, Failure, Sink};

/// Learns maps.
pub trait Prepare: Send {
    /// True if the last calls have left memory that is yet to be [freed](Self::free_leftovers).
    fn has_leftovers(&self) -> bool {
        false
    }

    /// Frees memory that calls have left so that they were answered sooner. From the thread of these
    /// calls, when they have been answered; the next call does it otherwise, in its own time.
    fn free_leftovers(&mut self) {}

    /// Learns a map, within a budget of its own.
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure>;
}

/// A planner that has been made.
pub trait Planner: Prepare {
    /// Solves an instance on the map that it has learnt; `Ok` claims that the last plan
    /// submitted solves it.
    fn plan(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure>;
}

/// A fail policy that has been made.
pub trait FailPolicy: Prepare {
    /// Submits a collision-free plan; `failed` is what the planner left.
    fn recover(
        &mut self,
        instance: &Instance,
        failed: Option<&Plan>,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure>;
}

/// An instance generator that has been made.
pub trait InstanceGenerator: Prepare {
    /// Submits one request.
    fn generate(
        &mut self,
        state: &FleetState,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure>;
}

/// An invocation policy that has been made.
pub trait InvocationPolicy: Send {
    /// True if the planner has to be called now.
    fn should_invoke(&mut self, status: &FleetStatus, sink: &dyn Sink) -> Result<bool, Failure>;
}

/// A plugin that has been made.
pub enum Object {
    /// A planner.
    Planner(Box<dyn Planner>),
    /// A fail policy.
    FailPolicy(Box<dyn FailPolicy>),
    /// An instance generator.
    InstanceGenerator(Box<dyn InstanceGenerator>),
    /// An invocation policy.
    InvocationPolicy(Box<dyn InvocationPolicy>),
}

impl fmt::Debug for Object {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_tuple("Object").field(&self.kind()).finish()
    }
}

impl Object {
    /// Its kind.
    pub fn kind(&self) -> Kind {
        match self {
            Self::Planner(_) => Kind::Planner,
            Self::FailPolicy(_) => Kind::FailPolicy,
            Self::InstanceGenerator(_) => Kind::InstanceGenerator,
            Self::InvocationPolicy(_) => Kind::InvocationPolicy,
        }
    }

    /// Teaches it a map; `None` for a kind that learns none.
    pub fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Option<Result<(), Failure>> {
        let learner = self.learner()?;
        Some(learner.prepare(environment, budget, sink))
    }

    /// A plugin that learns maps, of any kind that does.
    fn learner(&mut self) -> Option<&mut dyn Prepare> {
        match self {
            Self::Planner(plugin) => Some(&mut **plugin),
            Self::FailPolicy(plugin) => Some(&mut **plugin),
            Self::InstanceGenerator(plugin) => Some(&mut **plugin),
            Self::InvocationPolicy(_) => None,
        }
    }

    /// As [`Prepare::has_leftovers`].
    pub fn has_leftovers(&mut self) -> bool {
        self.learner()
            .is_some_and(|learner| learner.has_leftovers())
    }

    /// As [`Prepare::free_leftovers`].
    pub fn free_leftovers(&mut self) {
        if let Some(learner) = self.learner() {
            learner.free_leftovers();
        }
    }

    /// Of a planner that is written with the SDK.
    pub fn planner<P: sdk::Planner>(plugin: P) -> Self {
        Self::Planner(Box::new(PlannerOf(Held::new(plugin))))
    }

    /// Of a fail policy that is written with the SDK.
    pub fn fail_policy<P: sdk::FailPolicy>(plugin: P) -> Self {
        Self::FailPolicy(Box::new(FailPolicyOf(Held::new(plugin))))
    }

    /// Of an instance generator that is written with the SDK.
    pub fn instance_generator<P: sdk::InstanceGenerator>(plugin: P) -> Self {
        Self::InstanceGenerator(Box::new(InstanceGeneratorOf(Held::new(plugin))))
    }

    /// Of an invocation policy that is written with the SDK.
    pub fn invocation_policy<P: sdk::InvocationPolicy>(plugin: P) -> Self {
        Self::InvocationPolicy(Box::new(InvocationPolicyOf(plugin)))
    }
}

/// A plugin of an author, and what it has learnt.
struct Held<P, M> {
    plugin: P,
    descriptor: Descriptor,
    map: Option<Learnt<M>>,
}

/// A map as the plugin knows it, and as the host gave it.
struct Learnt<M> {
    map: M,
    environment: SharedEnvironment,
}

impl<P, M> Drop for Held<P, M> {
    fn drop(&mut self) {
        leftovers::free();
    }
}

impl<P: sdk::Plugin, M> Held<P, M> {
    fn new(plugin: P) -> Self {
        Self {
            plugin,
            descriptor: P::descriptor(),
            map: None,
        }
    }

    /// Learns with `learn`; a map that was known is forgotten, whatever comes of it.
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        learn: impl FnOnce(&mut P) -> Result<M, Failure>,
    ) -> Result<(), Failure> {
        self.map = None;
        self.claims("map", environment.needs())?;
        self.lists("map", critical(&environment.parts))?;
        let map = learn(&mut self.plugin)?;
        let environment = environment.clone();
        self.map = Some(Learnt { map, environment });
        Ok(())
    }

    /// The plugin with its map.
    fn ready(&mut self) -> Result<(&mut P, &mut Learnt<M>), Failure> {
        match &mut self.map {
            Some(learnt) => Ok((&mut self.plugin, learnt)),
            None => Err(Failure::new(
                Status::InvalidInput,
                "the call came before a successful `prepare`",
            )),
        }
    }

    /// The plugin with its map, for an instance that is whole and needs no more than it claims.
    fn ready_for(
        &mut self,
        instance: &Instance,
        needed: Capabilities,
    ) -> Result<(&mut P, &mut M), Failure> {
        let (_, learnt) = self.ready()?;
        instance
            .check(learnt.environment.places())
            .map_err(|reason| Failure::new(Status::InvalidInput, reason))?;
        self.claims("instance", needed)?;
        self.lists("instance", instance.needs_features())?;
        let (plugin, learnt) = self.ready()?;
        Ok((plugin, &mut learnt.map))
    }

    /// That the plugin claims what a map or an instance needs.
    fn claims(&self, what: &str, needed: Capabilities) -> Result<(), Failure> {
        let claims = self.descriptor.capabilities;
        match needed.iter().find(|needed| !claims.has(*needed)) {
            Some(lacking) => Err(lacks(what, "capability", lacking.as_str())),
            None => Ok(()),
        }
    }

    /// That the plugin lists the features that a map or an instance needs.
    fn lists(&self, what: &str, needed: impl IntoIterator<Item = String>) -> Result<(), Failure> {
        let features = &self.descriptor.features;
        let mut needed = needed.into_iter();
        match needed.find(|needed| !features.contains(needed)) {
            Some(lacking) => Err(lacks(what, "feature", &lacking)),
            None => Ok(()),
        }
    }
}

fn lacks(what: &str, kind: &str, name: &str) -> Failure {
    let reason = format!(
        "the {what} needs the {kind} `{name}`, which this plugin does not claim; hint: \
         `fleetyard plugins list` names others, and `plugins info` what they claim"
    );
    Failure::new(Status::Unsupported, reason)
}

/// Makes a call into a plugin of an author. Where a host does not free what calls leave, the next one
/// does.
fn call<R>(call: impl FnOnce() -> R) -> R {
    leftovers::free();
    leftovers::during(call)
}

struct PlannerOf<P: sdk::Planner>(Held<P, P::Map>);
struct FailPolicyOf<P: sdk::FailPolicy>(Held<P, P::Map>);
struct InstanceGeneratorOf<P: sdk::InstanceGenerator>(Held<P, P::Map>);
struct InvocationPolicyOf<P>(P);

macro_rules! prepares {
    ($($held:ident: $kind:ident),*) => {$(
        impl<P: sdk::$kind> Prepare for $held<P> {
            fn has_leftovers(&self) -> bool {
                leftovers::any()
            }

            fn free_leftovers(&mut self) {
                leftovers::free();
            }

            fn prepare(
                &mut self,
                environment: &SharedEnvironment,
                budget: &Budget,
                sink: &dyn Sink,
            ) -> Result<(), Failure> {
                let learn = |plugin: &mut P| plugin.prepare(environment, budget, sink);
                call(|| self.0.prepare(environment, learn))
            }
        }
    )*};
}

prepares!(
    PlannerOf: Planner,
    FailPolicyOf: FailPolicy,
    InstanceGeneratorOf: InstanceGenerator
);

impl<P: sdk::Planner> Planner for PlannerOf<P> {
    fn plan(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let (planner, map) = self.0.ready_for(instance, instance.needs())?;
        call(|| planner.plan(map, instance, budget, sink))
    }
}

impl<P: sdk::FailPolicy> FailPolicy for FailPolicyOf<P> {
    fn recover(
        &mut self,
        instance: &Instance,
        failed: Option<&Plan>,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        // It gets the fleet moving whatever the planner was asked to do, but authors count on goals.
        let idle = Capabilities::of(&[Capability::Idle]);
        let needed = instance.needs().and(idle);
        let (policy, map) = self.0.ready_for(instance, needed)?;
        call(|| policy.recover(map, instance, failed, budget, sink))
    }
}

impl<P: sdk::InstanceGenerator> InstanceGenerator for InstanceGeneratorOf<P> {
    fn generate(
        &mut self,
        state: &FleetState,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        self.0.ready()?;
        let parts = state.parts.iter().chain(&state.next.parts);
        self.0.lists("state", critical(parts))?;
        let (generator, learnt) = self.0.ready()?;
        call(|| generator.generate(&mut learnt.map, state, budget, sink))
    }
}

impl<P: sdk::InvocationPolicy> InvocationPolicy for InvocationPolicyOf<P> {
    fn should_invoke(&mut self, status: &FleetStatus, sink: &dyn Sink) -> Result<bool, Failure> {
        self.0.should_invoke(status, sink)
    }
}
