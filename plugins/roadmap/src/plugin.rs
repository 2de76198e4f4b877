//! The planner behind the plugin contract: id `roadmap-pp`.

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Environment, Instance, Kind, RoadmapEnvironment,
    SharedEnvironment, Status, Visit, VisitPlan,
};
use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::orders::End;
use fleetyard_plugin_plane::plugin::{OrderOptions, unsolved};
use fleetyard_plugin_spacetime::plugin::{Call, described, parse};

use crate::closeness::Closeness;
use crate::plan::Path;
use crate::priority::{Outcome, plan};
use crate::roadmap::{Roadmap, Vertex};

/// Prioritised planning of discs on roadmaps.
#[derive(Debug)]
pub struct RoadmapPrioritised(OrderOptions);

impl Plugin for RoadmapPrioritised {
    fn descriptor() -> Descriptor {
        let about = "Plans discs on a roadmap one after the other by safe intervals, with the exact \
            times at which discs on edges and vertices are too close to each other (Kasaura, \
            Nishimura, Yonetani, RA-L 2022). Neither complete nor optimal.";
        let names = ("roadmap-pp", "Prioritised planning on roadmaps");
        let capabilities = [
            Capability::Roadmap,
            Capability::StopGo,
            Capability::Slower,
            Capability::Heterogeneous,
            Capability::Deterministic,
        ];
        described::<OrderOptions>(Kind::Planner, names, about, [&capabilities, &[]])
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        parse(options, |_| Ok(())).map(Self)
    }
}

impl Planner for RoadmapPrioritised {
    type Map = Roadmap;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<Roadmap, Failure> {
        let unsupported = || Failure::new(Status::Unsupported, "this planner knows roadmaps only");
        roadmap(Environment::roadmap(environment).ok_or_else(unsupported)?)
    }

    fn plan(
        &mut self,
        roadmap: &mut Roadmap,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let call = Call::new(budget, sink);
        // The SDK refuses what this planner does not claim: there is one goal for each.
        let tasks = instance.starts.iter().zip(instance.goals.items());
        let tasks: Vec<(Vertex, Vertex)> = tasks.map(|(start, goal)| (*start, *goal)).collect();
        let closeness = Closeness::new(roadmap);
        let limit = self.0.within(budget);
        let Outcome {
            end,
            orders,
            expanded,
        } = plan(&closeness, &tasks, limit, budget.seed, &mut || call.stop());
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
