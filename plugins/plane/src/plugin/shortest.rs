//! The planner of shortest paths behind the plugin contract: id `tangent`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Descriptor, Status};
use fleetyard_plugin_spacetime::plugin::{Call, NODE_LIMIT};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::robots::FINE;
use super::{InPlane, Method, Team, annotate};
use crate::obstacles::Obstacles;
use crate::prioritised::{Disc, World};
use crate::tangent::{Tangents, Way};
use crate::timing::Stop;

/// Options of `tangent`.
#[derive(Debug, Clone, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Shortest {
    /// Distance that the robot keeps from obstacles beyond touching, in metres, where there is room
    /// for it: who drives in steps cuts corners a little.
    #[schemars(range(min = 0.0, max = 1000.0))]
    clearance_m: f64,
}

/// The shortest path of one disc among polygons.
pub type ShortestTangents = InPlane<Shortest>;

impl Method for Shortest {
    const ID: &'static str = "tangent";
    const NAME: &'static str = "Tangent graph";
    const ABOUT: &'static str = "Plans one robot in the plane, as a disc: the shortest path among polygons, which is made of \
         tangents of circles round corners and arcs between them (Liu, Arimoto, IJRR 1992). Tangents are \
         made and tested as they are needed. Complete and optimal for discs; teams are for si-tangent.";
    const MORE_FEATURES: &'static [&'static str] = &[Descriptor::ONE_AGENT];
    const CAPABILITIES: &'static [Capability] = &[];

    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let Team { world, agents, .. } = team;
        let unsupported = |reason: String| Failure::new(Status::Unsupported, reason);
        let [agent] = agents.as_slice() else {
            return Err(unsupported(format!(
                "this planner plans for one agent, the instance has {}; hint: si-tangent plans for teams",
                agents.len()
            )));
        };
        if !world.movers.is_empty() {
            return Err(unsupported(format!(
                "this planner knows obstacles at rest only, the world has {} movers; hint: si-tangent keeps clear of them",
                world.movers.len()
            )));
        }
        let mut search = Search {
            world,
            disc: agent.disc,
            call,
            expanded: 0,
            offered: 0,
            tested: 0,
        };
        let clearance = self.clearance_m;
        let mut found = None;
        if clearance > 0.0 {
            found = search.shortest(agent.disc.radius + clearance);
        }
        let found = found.or_else(|| search.shortest(agent.disc.radius));
        for (name, value) in [
            ("expansions", search.expanded),
            ("generated", search.offered),
            ("tests", search.tested),
        ] {
            call.metric(name, value as f64);
        }
        let Some(way) = found else {
            if search.ended() {
                return Err(call.unfinished(NODE_LIMIT, "a way was found"));
            }
            return Err(team.no_way(0, call));
        };
        // Of the path with true arcs; the plan's is a little longer.
        call.metric("length_m", way.length);
        let stops = driven(&way, agent.disc.speed);
        let plans = [stops];
        annotate(call, &plans);
        team.submit(call, &plans);
        Ok(())
    }
}

/// Searches of a call, for one disc.
struct Search<'a> {
    world: &'a World,
    disc: Disc,
    call: &'a Call<'a>,
    expanded: u64,
    offered: u64,
    tested: u64,
}

impl Search<'_> {
    /// The shortest way of a disc of that radius, if a limit is not met before.
    fn shortest(&mut self, radius: f64) -> Option<Way> {
        let obstacles = Obstacles::new(self.world.polygons.clone(), self.world.bounds, radius);
        let mut tangents = Tangents::with_step(&obstacles, FINE);
        let nodes = self.call.node_limit().unwrap_or(u64::MAX);
        let mut left = nodes.saturating_sub(self.tested);
        let way = tangents.shortest(self.disc.start, self.disc.goal, &mut || {
            left = left.saturating_sub(1);
            left == 0 || self.call.stop()
        });
        self.expanded += tangents.expanded;
        self.offered += tangents.offered;
        self.tested += tangents.tested;
        way
    }

    /// A limit was met.
    fn ended(&self) -> bool {
        self.call
            .node_limit()
            .is_some_and(|nodes| self.tested >= nodes)
            || self.call.stop()
    }
}

/// The stops of a disc that drives along a way at this speed.
fn driven(way: &Way, speed: f64) -> Vec<Stop> {
    let mut time = 0.0;
    let mut stops: Vec<Stop> = Vec::with_capacity(way.places.len());
    for at in &way.places {
        if let Some(last) = stops.last_mut() {
            time += (at - last.at).norm() / speed;
        }
        stops.push(Stop {
            at: *at,
            arrival: time,
            departure: time,
        });
    }
    if let Some(last) = stops.last_mut() {
        last.departure = f64::INFINITY;
    }
    stops
}
