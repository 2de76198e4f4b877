//! The Rust SDK: a trait per kind of plugin, and what the host gives to each.
//!
//! A plugin is a crate of its own. In its `Cargo.toml`:
//!
//! ```toml
//! [lib]
//! crate-type = ["cdylib"]
//!
//! [dependencies]
//! fleetyard-abi = { path = "…/abi" } # of a checkout of Fleetyard
//! ```
//!
//! and in its `src/lib.rs` a whole planner:
//!
//! ```
//! use fleetyard_abi::sdk::{Failure, Options, Plugin, Planner, Sink};
//! use fleetyard_abi::{Budget, Capabilities, Capability, Descriptor, GridPlan, Instance, Kind};
//! use fleetyard_abi::SharedEnvironment;
//!
//! /// Leaves everybody at their start.
//! struct Stay;
//!
//! impl Plugin for Stay {
//!     fn descriptor() -> Descriptor {
//!         Descriptor {
//!             version: "0.1.0".into(),
//!             capabilities: Capabilities::of(&[Capability::Grid, Capability::Pebble]),
//!             ..Descriptor::new(Kind::Planner, "stay", "Leaves everybody at their start")
//!         }
//!     }
//!
//!     fn create(_options: Options<'_>) -> Result<Self, Failure> {
//!         Ok(Self)
//!     }
//! }
//!
//! impl Planner for Stay {
//!     type Map = SharedEnvironment;
//!
//!     fn prepare(
//!         &mut self,
//!         environment: &SharedEnvironment,
//!         _: &Budget,
//!         _: &dyn Sink,
//!     ) -> Result<SharedEnvironment, Failure> {
//!         Ok(environment.clone())
//!     }
//!
//!     fn plan(
//!         &mut self,
//!         _map: &mut SharedEnvironment,
//!         instance: &Instance,
//!         _: &Budget,
//!         sink: &dyn Sink,
//!     ) -> Result<(), Failure> {
//!         sink.submit(&GridPlan::from_paths(instance.starts.iter().map(|cell| [*cell])))?;
//!         Ok(())
//!     }
//! }
//!
//! fleetyard_abi::export! { planners: [Stay] }
//! # fn main() {}
//! ```
//!
//! Then `cargo build --release` makes `target/release/lib….so`, which is a plugin:
//!
//! ```sh
//! fleetyard run --planner target/release/libstay.so --map MAP --scen SCENARIO --agents 10
//! ```
//!
//! Its plan is judged invalid, because nobody reaches a goal: that is the place to begin. A
//! real planner makes of the map what it needs in [`Planner::prepare`], asks [`Sink::cancelled`]
//! often, and draws all that is random from the budget's seed. With [`serve_stdio`](crate::serve::serve_stdio) the same crate
//! makes a program as well. `plugins/examples/rust` has a plugin of each kind, with options.

use serde::de::DeserializeOwned;

use crate::annotation::Annotation;
use crate::model::{
    Budget, Capabilities, Descriptor, FleetState, FleetStatus, Instance, Kind, LogLevel,
    PathEncoding, Request, SharedEnvironment, Status,
};
use crate::object::Object;
use crate::plan::{Plan, PlanRef};

/// The reason why a call did not succeed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{status}: {message}")]
pub struct Failure {
    /// The claim; never [`Status::Solved`].
    pub status: Status,
    /// For people.
    pub message: String,
    /// True if the plugin broke the contract, which it does not say by itself: the code between it
    /// and the host found out.
    pub broke_contract: bool,
}

impl Failure {
    /// The plugin submitted or returned something that the contract forbids.
    pub fn broke_contract(reason: impl Into<String>) -> Self {
        Self {
            broke_contract: true,
            ..Self::new(Status::InternalError, reason)
        }
    }

    /// A failure with its explanation.
    pub fn new(status: Status, message: impl Into<String>) -> Self {
        Self {
            status,
            message: message.into(),
            broke_contract: false,
        }
    }
}

/// The host did not take what was submitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Rejected {
    /// It is malformed, or the call asks for something else: the call is lost.
    #[error("the host rejected what was submitted: it is malformed")]
    Malformed,
    /// It came after the deadline, or after the host gave up on the call.
    #[error("what was submitted came too late")]
    TooLate,
    /// There is no room at the moment; nothing is wrong.
    #[error("the host has no room for what was submitted")]
    Busy,
}

impl From<Rejected> for Failure {
    fn from(rejected: Rejected) -> Self {
        let status = match rejected {
            Rejected::Malformed | Rejected::Busy => Status::InternalError,
            Rejected::TooLate => Status::TimedOut,
        };
        Self::new(status, rejected.to_string())
    }
}

/// Receives what a plugin has to say during a call, from any thread.
pub trait Sink: Sync {
    /// Hands over a plan; [`submit`](#method.submit) takes one of any form.
    fn submit_plan(&self, plan: PlanRef<'_>) -> Result<(), Rejected>;
    /// Hands over what a generator decided, in `generate`.
    fn submit_request(&self, request: &Request) -> Result<(), Rejected>;
    /// Lets the host keep bytes in place of those before, at most
    /// [`KEPT_LIMIT`](crate::c::KEPT_LIMIT): the next call has them as
    /// [`Instance::kept`] or [`FleetState::kept`], if the descriptor lists `part:fleetyard.kept/1`.
    /// The last ones of a call count, and only if it ends well and in time.
    fn keep(&self, bytes: &[u8]) -> Result<(), Rejected> {
        let _ = bytes;
        Err(Rejected::Malformed)
    }
    /// Reports a figure such as `expansions`, kept as a claim; those of
    /// [`FIGURES`](crate::figures::FIGURES) have a domain.
    fn metric(&self, name: &str, value: f64);
    /// Notes a fact about the plugin's inputs, such as the digest of its weights; kept as a claim.
    fn note(&self, name: &str, text: &str);
    /// Writes to the run's log.
    fn log(&self, level: LogLevel, text: &str);
    /// Says how much of the work is done; `total` 0 if unknown.
    fn progress(&self, done: u64, total: u64);
    /// True if the call should end: its [`answer_by_ns`](Budget::answer_by_ns) has passed, or the
    /// host gave up on it. Cheap; ask often.
    fn cancelled(&self) -> bool;
    /// Takes what a planner wants to show, in `plan` and `recover`; `None` unless somebody wants to
    /// see it. The plan must not depend on it.
    fn annotations(&self) -> Option<&dyn Annotations> {
        None
    }
}

/// Receives what a planner wants to show, from any thread.
pub trait Annotations: Sync {
    /// Hands over an annotation. [`Rejected::Busy`] says that the host keeps no more of them, and
    /// may be ignored.
    fn annotate(&self, annotation: &Annotation) -> Result<(), Rejected>;
}

impl dyn Sink + '_ {
    /// Hands over a plan on a grid, on a roadmap or in the plane. May be called any number of
    /// times, each plan better than the last.
    pub fn submit<'p>(&self, plan: impl Into<PlanRef<'p>>) -> Result<(), Rejected> {
        self.submit_plan(plan.into())
    }
}

/// The options that the user gave: a JSON object.
#[derive(Debug, Clone, Copy)]
pub struct Options<'a>(&'a str);

impl<'a> Options<'a> {
    /// From JSON text; empty text stands for no options.
    pub fn new(json: &'a str) -> Self {
        Self(if json.trim().is_empty() { "{}" } else { json })
    }

    /// The JSON text.
    pub fn json(self) -> &'a str {
        self.0
    }

    /// The options as a type, usually one with `#[serde(default,
    /// deny_unknown_fields)]` whose schema is in the descriptor.
    pub fn parse<T: DeserializeOwned>(self) -> Result<T, Failure> {
        // A structure would also take a list, field by field: insist on an object.
        serde_json::from_str::<serde_json::Map<_, _>>(self.0)
            .and_then(|object| serde_json::from_value(object.into()))
            .map_err(|error| Failure::new(Status::InvalidInput, format!("options: {error}")))
    }
}

/// The part that plugins of all kinds share.
pub trait Plugin: Sized + 'static {
    /// Identity and capabilities of the plugin.
    fn descriptor() -> Descriptor;
    /// Makes one from its options.
    fn create(options: Options<'_>) -> Result<Self, Failure>;
}

/// Solves instances.
pub trait Planner: Plugin + Send {
    /// The map as this planner knows it. The SDK keeps it until the next map, and lends it
    /// to every call.
    type Map: Send;
    /// Learns a map, within a budget of its own.
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<Self::Map, Failure>;
    /// Solves an instance on that map and submits plans to the sink; `Ok` claims
    /// that the last one solves it. The instance is whole ([`Instance::check`]) and needs
    /// nothing that the descriptor's capabilities lack ([`Instance::needs`]).
    fn plan(
        &mut self,
        map: &mut Self::Map,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure>;
}

/// Gets the fleet moving again when the planner has failed.
pub trait FailPolicy: Plugin + Send {
    /// The map as this policy knows it, kept by the SDK.
    type Map: Send;
    /// Learns a map, within a budget of its own.
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<Self::Map, Failure>;
    /// Submits a collision-free plan; `failed` is what the planner left.
    fn recover(
        &mut self,
        map: &mut Self::Map,
        instance: &Instance,
        failed: Option<&Plan>,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure>;
}

/// Decides what the planner is asked next.
pub trait InstanceGenerator: Plugin + Send {
    /// The map as this generator knows it, kept by the SDK.
    type Map: Send;
    /// Learns a map, within a budget of its own.
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<Self::Map, Failure>;
    /// Submits one request.
    fn generate(
        &mut self,
        map: &mut Self::Map,
        state: &FleetState,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure>;
}

/// Decides when the planner is called.
pub trait InvocationPolicy: Plugin + Send {
    /// True if the planner has to be called now.
    fn should_invoke(&mut self, status: &FleetStatus, sink: &dyn Sink) -> Result<bool, Failure>;
}

/// Some plugins that can be described and made: those of a Rust crate, or of a
/// library that was loaded.
pub trait Catalog: Sync {
    /// Every plugin, in a fixed order.
    fn descriptors(&self) -> Vec<Descriptor>;
    /// Makes one.
    fn create(
        &self,
        kind: Kind,
        id: &str,
        options: Options<'_>,
        sink: &dyn Sink,
    ) -> Result<Object, Failure>;

    /// Major and minor version of the C ABI that the plugins were built for, if they
    /// were loaded through it.
    fn abi_version(&self) -> Option<[u16; 2]> {
        None
    }
}

/// One plugin type in a [`StaticCatalog`].
pub struct Entry {
    /// Describes it.
    pub descriptor: fn() -> Descriptor,
    /// Makes one.
    pub create: fn(Options<'_>) -> Result<Object, Failure>,
}

/// The plugins of a Rust crate, listed by [`export!`](crate::export!).
pub struct StaticCatalog(pub &'static [Entry]);

impl Catalog for StaticCatalog {
    fn descriptors(&self) -> Vec<Descriptor> {
        self.0.iter().map(|entry| (entry.descriptor)()).collect()
    }

    fn create(
        &self,
        kind: Kind,
        id: &str,
        options: Options<'_>,
        _: &dyn Sink,
    ) -> Result<Object, Failure> {
        let wanted = self.0.iter().find(|entry| {
            let descriptor = (entry.descriptor)();
            descriptor.kind == kind && descriptor.id == id
        });
        match wanted {
            Some(entry) => (entry.create)(options),
            None => Err(Failure::new(
                Status::Unsupported,
                format!("there is no {kind} `{id}`"),
            )),
        }
    }
}

impl Descriptor {
    /// A descriptor without capabilities and options, for struct update syntax.
    pub fn new(kind: Kind, id: impl Into<String>, description: impl Into<String>) -> Self {
        let id = id.into();
        Self {
            kind,
            name: id.clone(),
            id,
            version: String::new(),
            description: description.into(),
            license: String::new(),
            capabilities: Capabilities::default(),
            features: Vec::new(),
            options_schema: serde_json::Value::Null,
            path_encoding: PathEncoding::Moves,
        }
    }
}

/// The JSON Schema of an options type, for [`Descriptor::options_schema`].
pub fn options_schema<T: schemars::JsonSchema>() -> serde_json::Value {
    schemars::schema_for!(T).to_value()
}
