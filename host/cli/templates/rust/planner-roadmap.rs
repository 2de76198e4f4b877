//! One robot after the other drives along edges to its goal while all others rest.
//!
//! A robot takes a shortest way (Dijkstra 1959) among the edges that stay away from every robot
//! that rests. Simple and slow, for nobody drives beside another, and neither complete nor
//! optimal. Put your own algorithm into `plan`.

use std::collections::BTreeSet;

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, Instance, Kind, RoadmapEnvironment,
    SharedEnvironment, Status, Visit, VisitPlan,
};
use schemars::JsonSchema;
use serde::Deserialize;

fleetyard_abi::export! { planners: [InTurn] }

/// The options, as in `--option NAME=VALUE`. The host checks them before the planner starts.
#[derive(Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct InTurnOptions {
    /// Time that passes between two robots, in seconds.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pause_s: f64,
}

impl Default for InTurnOptions {
    fn default() -> Self {
        Self { pause_s: 0.0 }
    }
}

/// One robot after the other drives while the others rest.
pub struct InTurn {
    options: InTurnOptions,
}

/// The map.
pub struct Map(SharedEnvironment);

impl Plugin for InTurn {
    fn descriptor() -> Descriptor {
        Descriptor {
            version: env!("CARGO_PKG_VERSION").into(),
            // What the host may ask; docs/conformance.md lists all there is.
            capabilities: Capabilities::of(&[
                Capability::Roadmap,
                Capability::StopGo,
                Capability::Slower,
                Capability::Heterogeneous,
                Capability::Deterministic,
            ]),
            options_schema: options_schema::<InTurnOptions>(),
            ..Descriptor::new(
                Kind::Planner,
                env!("CARGO_PKG_NAME"),
                "One robot after the other drives while the others rest.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        Ok(Self {
            options: options.parse()?,
        })
    }
}

impl Planner for InTurn {
    type Map = Map;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<Map, Failure> {
        Ok(Map(environment.clone()))
    }

    fn plan(
        &mut self,
        map: &mut Map,
        instance: &Instance,
        _budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let unknown = || Failure::new(Status::Unsupported, "this planner knows `roadmap` only");
        let roadmap = map.0.roadmap().ok_or_else(unknown)?;
        let mut at = instance.starts.clone();
        let start = |vertex: &u32| vec![visit(*vertex, 0.0)];
        let mut paths: Vec<Vec<Visit>> = at.iter().map(start).collect();
        let mut left: Vec<usize> = (0..instance.agents()).collect();
        let mut time_s = 0.0;
        while !left.is_empty() {
            let mut stuck = Vec::new();
            for &agent in &left {
                let goal = instance.goals[agent][0];
                let Some(way) = find_way(roadmap, &at, agent, goal, sink)? else {
                    stuck.push(agent);
                    continue;
                };
                let path = &mut paths[agent];
                for (vertex, duration_s) in way {
                    // It has waited where it was until now.
                    path.last_mut().expect("its start").departure_s = time_s;
                    time_s += duration_s;
                    path.push(visit(vertex, time_s));
                }
                time_s += self.options.pause_s;
                at[agent] = goal;
            }
            if stuck.len() == left.len() {
                let reason = format!("{} robots have no way past those that rest", stuck.len());
                return Err(Failure::new(Status::GaveUp, reason));
            }
            left = stuck;
        }
        sink.submit(&paths.into_iter().collect::<VisitPlan>())?;
        Ok(())
    }
}

fn visit(vertex: u32, time_s: f64) -> Visit {
    Visit {
        vertex,
        arrival_s: time_s,
        departure_s: time_s,
    }
}

/// The vertices of a shortest way in time, and how long each edge takes; none if robots that rest
/// are in every way.
fn find_way(
    roadmap: &RoadmapEnvironment,
    at: &[u32],
    agent: usize,
    goal: u32,
    sink: &dyn Sink,
) -> Result<Option<Vec<(u32, f64)>>, Failure> {
    let place = |vertex: u32| [roadmap.x_m[vertex as usize], roadmap.y_m[vertex as usize]];
    let others: Vec<[f64; 2]> = (0..at.len())
        .filter(|other| *other != agent)
        .map(|other| place(at[other]))
        .collect();
    let is_free = |from: u32, to: u32| {
        let apart = |other: &[f64; 2]| from_segment(*other, place(from), place(to));
        others
            .iter()
            .all(|other| apart(other) >= roadmap.separation_m)
    };
    // Per vertex the time from the start, and the vertex and the edge before it.
    let mut best = vec![(f64::INFINITY, 0, 0.0); roadmap.vertices()];
    best[at[agent] as usize].0 = 0.0;
    // Times are not negative, so that their bits have their order.
    let mut open = BTreeSet::from([(0, at[agent])]);
    while let Some((bits, vertex)) = open.pop_first() {
        if vertex == goal {
            break;
        }
        if sink.cancelled() {
            return Err(Failure::new(Status::TimedOut, "the time is up"));
        }
        let edges = roadmap.edges.range(vertex as usize);
        for (next, duration_s) in
            std::iter::zip(&roadmap.edges[vertex as usize], &roadmap.duration_s[edges])
        {
            let time_s = f64::from_bits(bits) + duration_s;
            let known = &mut best[*next as usize];
            if time_s < known.0 && is_free(vertex, *next) {
                open.remove(&(known.0.to_bits(), *next));
                *known = (time_s, vertex, *duration_s);
                open.insert((time_s.to_bits(), *next));
            }
        }
    }
    if best[goal as usize].0 == f64::INFINITY {
        return Ok(None);
    }
    let mut way = Vec::new();
    let mut vertex = goal;
    while vertex != at[agent] {
        let (_, before, duration_s) = best[vertex as usize];
        way.push((vertex, duration_s));
        vertex = before;
    }
    way.reverse();
    Ok(Some(way))
}

/// The distance of a point from a segment.
fn from_segment(point: [f64; 2], from: [f64; 2], to: [f64; 2]) -> f64 {
    let along = [to[0] - from[0], to[1] - from[1]];
    let aside = [point[0] - from[0], point[1] - from[1]];
    let length = along[0] * along[0] + along[1] * along[1];
    let ahead = aside[0] * along[0] + aside[1] * along[1];
    let part = if length > 0.0 {
        (ahead / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (aside[0] - part * along[0]).hypot(aside[1] - part * along[1])
}
