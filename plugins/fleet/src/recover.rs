//! Fail policies: they give paths when the planner has failed.
//!
//! Every policy answers with paths that do not collide within the window (without one, ever), and
//! in which agents move round in a ring only where that is allowed. The paths need not lead any
//! agent to a goal.
//!
//! - [`Pibt`] and [`GuidedPibt`] plan anew, from step to step;
//! - [`Lrgw`] and [`RuleBased`] save what they can of the paths that the planner left;
//! - [`AllWait`] stays.
//!
//! If robots take a step to turn, [`Pibt`], [`GuidedPibt`] and [`Lrgw`] drive their paths
//! in the order in which agents pass, with the time that turning takes; see the module
//! `convoy`.

mod convoy;
mod guided;
mod lrgw;
mod pibt;
mod rules;
mod wait;

use fleetyard_abi::sdk::{FailPolicy, Failure, Options, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capability, Descriptor, GridPlan, Instance, Kind, Motion, Plan, SharedEnvironment,
    Status,
};
use fleetyard_plugin_spacetime::graph::{Vertex, direction};
use fleetyard_plugin_spacetime::plan::plan_of;
use fleetyard_plugin_spacetime::plugin::{Call, described, parse};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;

pub use guided::GuidedPibt;
pub use lrgw::Lrgw;
pub use pibt::Pibt;
pub use rules::RuleBased;
pub use wait::AllWait;

use crate::ground::{Ground, Learn};
use crate::invalid;

/// A way to get the fleet moving; the type is that of its options.
pub trait Recovery: DeserializeOwned + JsonSchema + Send + 'static {
    /// Identifier and name.
    const NAMES: (&'static str, &'static str);
    /// Description of the policy, with its source.
    const ABOUT: &'static str;
    /// Capabilities besides those that all policies have.
    const EXTRA: &'static [Capability] = &[];
    /// The map as the policy knows it, kept between calls.
    type Map: Learn;

    /// The reason why the options are refused, beyond what their schema says.
    fn check(&self) -> Result<(), String> {
        Ok(())
    }

    /// Submits paths that do not collide; `failed` is what the planner left.
    fn recover(
        &self,
        map: &mut Self::Map,
        instance: &Instance,
        failed: Option<&GridPlan>,
        call: &Call<'_>,
    ) -> Result<(), Failure>;
}

/// The plugin of a [`Recovery`].
#[derive(Debug)]
pub struct Policy<R>(R);

impl<R: Recovery> Plugin for Policy<R> {
    fn descriptor() -> Descriptor {
        let common = &[
            Capability::Grid,
            Capability::Pebble,
            Capability::MoveMask,
            Capability::Rotation,
            Capability::Windowed,
            Capability::DuplicateGoals,
            Capability::Deterministic,
        ];
        described::<R>(Kind::FailPolicy, R::NAMES, R::ABOUT, [common, R::EXTRA])
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        parse(options, R::check).map(Self)
    }
}

impl<R: Recovery> FailPolicy for Policy<R> {
    type Map = R::Map;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<R::Map, Failure> {
        R::Map::learn(environment)
    }

    fn recover(
        &mut self,
        map: &mut R::Map,
        instance: &Instance,
        failed: Option<&Plan>,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        self.0.recover(
            map,
            instance,
            failed.and_then(Plan::cells),
            &Call::new(budget, sink),
        )
    }
}

/// An instance over the vertices of the map.
struct Problem<'a> {
    ground: &'a Ground,
    starts: Vec<Vertex>,
    /// Headings of the agents, if they matter.
    headings: Option<Vec<u8>>,
    /// True if agents may move round in a ring.
    rings: bool,
    /// Steps that count; `None`: all.
    window: Option<u32>,
}

impl<'a> Problem<'a> {
    fn new(ground: &'a Ground, instance: &Instance) -> Result<Self, Failure> {
        let agents = instance.agents();
        let headings = match instance.motion {
            Motion::Pebble => None,
            Motion::Rotation => {
                let given = instance.headings.as_deref();
                let headings = given.filter(|all| all.len() == agents).ok_or_else(|| {
                    invalid("agents turn, but their headings are not given, or not all of them")
                })?;
                Some(headings.iter().copied().map(direction).collect())
            }
            Motion::AnyAngle | Motion::StopGo | Motion::Slower | Motion::Dynamics => {
                let reason = "motion other than pebbles' and with turns is not supported";
                return Err(Failure::new(Status::Unsupported, reason));
            }
        };
        Ok(Self {
            ground,
            starts: ground.places(&instance.starts)?,
            headings,
            rings: instance.allows_cycles,
            window: (instance.window_steps > 0).then_some(instance.window_steps),
        })
    }

    /// The usable part of each path that the planner left: as much as begins where the agent is,
    /// goes from cell to cell, and lies within the window. At least the start.
    fn paths(&self, failed: Option<&GridPlan>) -> Vec<Vec<Vertex>> {
        let graph = &self.ground.graph;
        let most = self.window.map_or(usize::MAX, |steps| steps as usize);
        let mut left = failed.map(GridPlan::paths);
        let usable = |start: &Vertex| {
            let mut path = vec![*start];
            let cells = left.as_mut().and_then(Iterator::next).unwrap_or_default();
            if cells.first() != Some(&graph.cell(*start)) {
                return path;
            }
            let mut here = *start;
            for cell in cells.iter().skip(1).take(most) {
                match graph.vertex(*cell) {
                    Some(v) if v == here || graph.neighbors(here).any(|near| near == v) => {
                        path.push(v);
                        here = v;
                    }
                    _ => break,
                }
            }
            path
        };
        self.starts.iter().map(usable).collect()
    }

    /// Submits paths without the waits at their ends.
    fn submit(&self, paths: &[Vec<Vertex>], call: &Call<'_>) {
        call.submit(&plan_of(paths, &self.ground.graph).trimmed());
    }
}
