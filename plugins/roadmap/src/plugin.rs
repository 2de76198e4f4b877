//! Planners of discs on roadmaps behind the plugin contract.
//!
//! A planner is its options: a type that implements [`Method`] says what it is and how it plans. [`OnRoadmap`] makes the plugin
//! of it. [`CbsMp`] plans in the plane, on roadmaps of its own.

mod anytime;
mod conflict;
mod ctc;
mod growing;
mod pp;

pub use anytime::{AnytimeOptions, LacamOptions, LnsOptions, RoadmapLacam, RoadmapLns};
pub use conflict::{BoundedOptions, Ccbs, Eccbs, OptimalOptions};
pub use ctc::{Ctc, Options as CtcOptions};
pub use growing::{CbsMp, Options as GrowingOptions};
pub use pp::{Options as PrioritisedOptions, RoadmapPrioritised};

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Environment, Instance, Kind, Motion, RoadmapEnvironment,
    SharedEnvironment, Status, Visit, VisitPlan,
};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_spacetime::plugin::{Call, described, parse};
use schemars::JsonSchema;
use serde::de::DeserializeOwned;

use crate::closeness::Closeness;
use crate::drive::Limits;
use crate::plan::Path;
use crate::priority::Disc;
use crate::rest::Known;
use crate::roadmap::{Roadmap, Vertex};

/// A way to plan; the type is that of its options.
pub trait Method: DeserializeOwned + JsonSchema + Send + 'static {
    /// The identifier.
    const ID: &'static str;
    /// The name.
    const NAME: &'static str;
    /// The method in a sentence or two, with its source.
    const ABOUT: &'static str;
    /// Capabilities besides [`Capability::Roadmap`], [`Capability::StopGo`], [`Capability::Heterogeneous`] and
    /// [`Capability::Deterministic`].
    const CAPABILITIES: &'static [Capability];

    /// The reason why the options are refused, beyond what their schema says.
    fn check(&self) -> Result<(), String> {
        Ok(())
    }

    /// Plans for a team, and submits plans to the call.
    fn solve(&self, team: Team<'_>, call: &Call<'_>) -> Result<(), Failure>;
}

/// A team on a roadmap.
#[derive(Debug)]
pub struct Team<'a> {
    /// The roadmap, and what is close on it.
    pub closeness: &'a Closeness,
    /// Bounds of the ways to goals that are known.
    pub known: &'a mut Known,
    /// The discs.
    pub discs: Vec<Disc>,
    /// Seconds after which discs may be in each other's way; infinite for whole paths.
    pub until: f64,
}

/// The plugin of a [`Method`].
#[derive(Debug)]
pub struct OnRoadmap<M>(M);

impl<M: Method> Plugin for OnRoadmap<M> {
    fn descriptor() -> Descriptor {
        let common = &[
            Capability::Roadmap,
            Capability::StopGo,
            Capability::Heterogeneous,
            Capability::Deterministic,
        ];
        let names = (M::ID, M::NAME);
        described::<M>(Kind::Planner, names, M::ABOUT, [common, M::CAPABILITIES])
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        parse(options, M::check).map(Self)
    }
}

/// A roadmap, with what is worked out about it from call to call.
#[derive(Debug)]
pub struct Learnt {
    closeness: Closeness,
    known: Known,
}

impl Learnt {
    fn new(roadmap: Roadmap) -> Self {
        Self {
            closeness: Closeness::new(roadmap),
            known: Known::default(),
        }
    }
}

/// A map: the roadmap at full speed, and for the limits of robots that were asked about last.
#[derive(Debug)]
pub struct Map {
    plain: Learnt,
    driven: Option<(Limits, Learnt)>,
}

impl Map {
    /// The roadmap for robots with limits, or at full speed.
    fn of(&mut self, limits: Option<Limits>) -> &mut Learnt {
        let Some(limits) = limits else {
            return &mut self.plain;
        };
        let plain = &self.plain;
        let learn = || Learnt::new(plain.closeness.roadmap().driven(limits));
        let kept = self.driven.take().filter(|(known, _)| *known == limits);
        let (_, learnt) = self
            .driven
            .insert(kept.unwrap_or_else(|| (limits, learn())));
        learnt
    }
}

/// The limits that all robots keep, where edges may take longer, all turn before they drive, and it is known where they look.
fn limits(instance: &Instance) -> Option<Limits> {
    if instance.motion != Motion::Slower || instance.headings.is_none() {
        return None;
    }
    let limits: Option<Vec<Limits>> = instance.robots.iter().map(Limits::of).collect();
    limits?.into_iter().reduce(Limits::and)
}

impl<M: Method> Planner for OnRoadmap<M> {
    type Map = Map;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<Map, Failure> {
        let unsupported = || Failure::new(Status::Unsupported, "this planner knows roadmaps only");
        let roadmap = roadmap(Environment::roadmap(environment).ok_or_else(unsupported)?)?;
        Ok(Map {
            plain: Learnt::new(roadmap),
            driven: None,
        })
    }

    fn plan(
        &mut self,
        map: &mut Map,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let call = Call::new(budget, sink);
        let limits = limits(instance);
        let Learnt { closeness, known } = map.of(limits);
        let headings = instance.headings.as_ref().filter(|_| limits.is_some());
        let discs = instance.starts.iter().zip(instance.goals.iter());
        let discs: Vec<Disc> = discs
            .enumerate()
            .map(|(agent, (start, goals))| Disc {
                start: *start,
                direction: headings.map(|headings| headings[agent].radians()),
                goals: goals.to_vec(),
            })
            .collect();
        let until = if instance.window_s > 0.0 {
            instance.window_s
        } else {
            f64::INFINITY
        };
        let team = Team {
            closeness,
            known,
            discs,
            until,
        };
        self.0.solve(team, &call)
    }
}

/// The failure of a team of which a disc has no way to its goals.
fn no_way(disc: usize) -> Failure {
    let reason = format!("no way leads agent {disc} to its goal, not even alone");
    Failure::new(Status::Infeasible, reason)
}

fn roadmap(given: &RoadmapEnvironment) -> Result<Roadmap, Failure> {
    let places = given.x_m.iter().zip(&given.y_m);
    let places = places.map(|(x, y)| Vector::new(*x, *y)).collect();
    let edges = given.edges.iter().enumerate().flat_map(|(from, targets)| {
        let range = given.edges.range(from);
        let durations = &given.duration_s[range];
        let ends = targets.iter().zip(durations);
        ends.map(move |(to, duration)| (from as Vertex, *to, *duration))
    });
    Roadmap::new(places, edges, given.separation_m)
        .map_err(|refused| Failure::new(Status::InvalidInput, refused.to_string()))
}

/// Hands over paths; for the host the last visit ends when it begins.
fn submit(call: &Call<'_>, paths: &[Path]) {
    let visit = |visit: &crate::plan::Visit| Visit {
        vertex: visit.vertex,
        arrival_s: visit.arrival,
        departure_s: if visit.departure.is_finite() {
            visit.departure
        } else {
            visit.arrival
        },
    };
    let visits = |path: &Path| -> Vec<Visit> { path.iter().map(visit).collect() };
    let plan: VisitPlan = paths.iter().map(visits).collect();
    call.submit(&plan);
}
