//! The planner behind the plugin contract: id `roadmap-pp`.

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Environment, Instance, Kind, Motion, RoadmapEnvironment,
    SharedEnvironment, Status, Visit, VisitPlan,
};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::orders::End;
use fleetyard_plugin_plane::plugin::{OrderOptions, unsolved};
use fleetyard_plugin_spacetime::plugin::{Call, described, parse};

use crate::closeness::Closeness;
use crate::drive::Limits;
use crate::plan::Path;
use crate::priority::{Disc, Outcome, plan};
use crate::rest::Known;
use crate::roadmap::{Roadmap, Vertex};

/// Prioritised planning of discs on roadmaps.
#[derive(Debug)]
pub struct RoadmapPrioritised(OrderOptions);

impl Plugin for RoadmapPrioritised {
    fn descriptor() -> Descriptor {
        let about = "Plans discs on a roadmap one after the other by safe intervals, with the exact \
            times at which discs on edges and vertices are too close to each other (Kasaura, \
            Nishimura, Yonetani, RA-L 2022). For the motion `slower`, robots on wheels whose headings \
            are given turn in place and drive from rest to rest (Yan, Li, AAAI 2025). Neither complete \
            nor optimal.";
        let names = ("roadmap-pp", "Prioritised planning on roadmaps");
        let capabilities = [
            Capability::Roadmap,
            Capability::StopGo,
            Capability::Slower,
            Capability::Windowed,
            Capability::Idle,
            Capability::Heterogeneous,
            Capability::Deterministic,
        ];
        described::<OrderOptions>(Kind::Planner, names, about, [&capabilities, &[]])
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        parse(options, |_| Ok(())).map(Self)
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

impl Planner for RoadmapPrioritised {
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
        let limit = self.0.within(budget);
        let team = (discs.as_slice(), until);
        let Outcome {
            end,
            orders,
            expanded,
        } = plan(closeness, known, team, limit, budget.seed, &mut || {
            call.stop()
        });
        call.metric("nodes", orders as f64);
        call.metric("expansions", expanded as f64);
        let End::Solved(paths) = end else {
            return Err(unsolved(end == End::Stopped, orders));
        };
        let visits: VisitPlan = paths.iter().map(visits).collect();
        Ok(sink.submit(&visits)?)
    }
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

/// A path for the host, where the last visit ends when it begins.
fn visits(path: &Path) -> Vec<Visit> {
    let visit = |visit: &crate::plan::Visit| Visit {
        vertex: visit.vertex,
        arrival_s: visit.arrival,
        departure_s: if visit.departure.is_finite() {
            visit.departure
        } else {
            visit.arrival
        },
    };
    path.iter().map(visit).collect()
}
