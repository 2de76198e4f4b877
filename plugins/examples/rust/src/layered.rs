//! A planner: agents plan one after the other, each by breadth-first search through
//! layers of time.
//!
//! Layer `t` holds the cells that the agent can be in at time `t` without meeting
//! anybody who has planned before; the first layer in which it may stay at its goal
//! for good gives a path of least arrival time. Prioritized planning after Erdmann
//! and Lozano-Pérez, "On Multiple Moving Objects" (Algorithmica 1987). An agent that
//! finds no path goes first in the next attempt.
//!
//! Neither complete nor optimal, and slower than A*; but the search is one loop.

use fleetyard_abi::sdk::{Failure, Options, Planner, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, GridPlan, Instance, Kind, SharedEnvironment,
    Status, monotonic_ns,
};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng as _, SeedableRng};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::{four_connected, neighbours};

const NOBODY: u32 = u32::MAX;
const NEVER: usize = usize::MAX;

/// Plans agents one after the other, layer of time by layer of time.
pub struct Layered {
    options: LayeredOptions,
}

/// The map as it is searched.
pub struct Map {
    neighbours: Vec<Vec<u32>>,
    passable: Vec<u8>,
}

#[derive(Debug, Default, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct LayeredOptions {
    /// Most orders of the agents to try; 0 for as many as the budget allows.
    attempts: u32,
}

impl Plugin for Layered {
    fn descriptor() -> Descriptor {
        Descriptor {
            name: "Layered (Rust example)".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            license: env!("CARGO_PKG_LICENSE").into(),
            capabilities: Capabilities::of(&[
                Capability::Grid,
                Capability::Pebble,
                Capability::Deterministic,
            ]),
            options_schema: options_schema::<LayeredOptions>(),
            ..Descriptor::new(
                Kind::Planner,
                "layered",
                "Prioritized planning (Erdmann and Lozano-Pérez 1987) by breadth-first search \
                 through layers of time.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        Ok(Self {
            options: options.parse()?,
        })
    }
}

impl Planner for Layered {
    type Map = Map;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<Map, Failure> {
        let grid = four_connected(environment)?;
        Ok(Map {
            neighbours: neighbours(grid),
            passable: grid.passable.clone(),
        })
    }

    fn plan(
        &mut self,
        map: &mut Map,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let goals = map.check(instance)?;
        let agents = instance.agents();
        let mut random = ChaCha8Rng::seed_from_u64(budget.seed);
        let mut order: Vec<usize> = (0..agents).collect();
        let mut attempts: u32 = 0;
        loop {
            attempts += 1;
            let mut traffic = Traffic::new(map.passable.len());
            let mut paths = vec![Vec::new(); agents];
            let mut failed = None;
            for (rank, agent) in order.iter().enumerate() {
                let (start, goal) = (instance.starts[*agent], goals[*agent]);
                match map.path(start, goal, &traffic, budget, sink)? {
                    Some(path) => {
                        traffic.reserve(*agent as u32, &path);
                        paths[*agent] = path;
                    }
                    None if rank == 0 => {
                        let reason = format!("no path leads agent {agent} to its goal");
                        return Err(Failure::new(Status::Infeasible, reason));
                    }
                    None => {
                        failed = Some(rank);
                        break;
                    }
                }
            }
            sink.metric("attempts", f64::from(attempts));
            let Some(rank) = failed else {
                sink.submit(&GridPlan::from_paths(paths))?;
                return Ok(());
            };
            if attempts == self.options.attempts {
                let reason = format!("no order of {attempts} worked");
                return Err(Failure::new(Status::GaveUp, reason));
            }
            order[..=rank].rotate_right(1);
            // Two agents that send each other forward would do so for ever.
            let (a, b) = (random.next_u64(), random.next_u64());
            order.swap((a % agents as u64) as usize, (b % agents as u64) as usize);
        }
    }
}

impl Map {
    /// The goals, if agents can stand at them and at their starts. What this planner does not
    /// claim (windows, several or shared goals, other motions) the SDK refuses.
    fn check(&self, instance: &Instance) -> Result<Vec<u32>, Failure> {
        let invalid = |reason: String| Failure::new(Status::InvalidInput, reason);
        let goals = instance.goals.items().to_vec();
        for cells in [&instance.starts, &goals] {
            if let Some(cell) = cells
                .iter()
                .find(|cell| self.passable[**cell as usize] == 0)
            {
                return Err(invalid(format!("nobody can stand in cell {cell}")));
            }
        }
        let all_differ = |cells: &[u32]| {
            let mut sorted = cells.to_vec();
            sorted.sort_unstable();
            sorted.windows(2).all(|pair| pair[0] != pair[1])
        };
        if !all_differ(&instance.starts) {
            return Err(invalid("two agents start in the same cell".into()));
        }
        Ok(goals)
    }

    /// A path of least arrival time through the traffic, if there is one.
    fn path(
        &self,
        start: u32,
        goal: u32,
        traffic: &Traffic,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<Option<Vec<u32>>, Failure> {
        let cells = self.passable.len();
        // came_from[t][cell]: where the agent was at t - 1, if it can be there at t.
        let mut came_from = vec![vec![NOBODY; cells]];
        came_from[0][start as usize] = start;
        let mut layer = vec![start];
        for time in 0.. {
            if came_from[time][goal as usize] != NOBODY && time >= traffic.quiet_from(goal) {
                let mut path = vec![goal];
                for earlier in (1..=time).rev() {
                    let at = path[path.len() - 1];
                    path.push(came_from[earlier][at as usize]);
                }
                path.reverse();
                return Ok(Some(path));
            }
            if sink.cancelled() || monotonic_ns() >= budget.answer_by_ns {
                return Err(Failure::new(
                    Status::TimedOut,
                    "no plan before the end of the budget",
                ));
            }
            let mut reached = vec![NOBODY; cells];
            let mut next_layer = Vec::with_capacity(layer.len() + 4);
            for &from in &layer {
                let moves = self.neighbours[from as usize].iter().copied();
                for to in std::iter::once(from).chain(moves) {
                    if reached[to as usize] == NOBODY && traffic.lets_pass(from, to, time) {
                        reached[to as usize] = from;
                        next_layer.push(to);
                    }
                }
            }
            // Once nobody moves any more, layers only grow, until they do not.
            if next_layer.is_empty()
                || (time >= traffic.layers.len() && next_layer.len() == layer.len())
            {
                return Ok(None);
            }
            came_from.push(reached);
            layer = next_layer;
        }
        Ok(None)
    }
}

/// The paths of those who have planned.
struct Traffic {
    /// The agent in each cell, by time step, as long as anybody moves.
    layers: Vec<Vec<u32>>,
    /// Per cell, from when on somebody stays there for good.
    parked_from: Vec<usize>,
    /// Per cell, the time after the last visit.
    quiet_from: Vec<usize>,
}

impl Traffic {
    fn new(cells: usize) -> Self {
        Self {
            layers: Vec::new(),
            parked_from: vec![NEVER; cells],
            quiet_from: vec![0; cells],
        }
    }

    fn quiet_from(&self, cell: u32) -> usize {
        self.quiet_from[cell as usize]
    }

    fn at(&self, time: usize, cell: u32) -> u32 {
        let layer = self.layers.get(time);
        layer.map_or(NOBODY, |layer| layer[cell as usize])
    }

    /// True if a step that begins at `time` meets nobody.
    fn lets_pass(&self, from: u32, to: u32, time: usize) -> bool {
        if self.parked_from[to as usize] <= time + 1 || self.at(time + 1, to) != NOBODY {
            return false;
        }
        let other = self.at(time, to);
        other == NOBODY || self.at(time + 1, from) != other
    }

    fn reserve(&mut self, agent: u32, path: &[u32]) {
        let cells = self.parked_from.len();
        while self.layers.len() < path.len() {
            self.layers.push(vec![NOBODY; cells]);
        }
        for (time, cell) in path.iter().enumerate() {
            self.layers[time][*cell as usize] = agent;
            let quiet = &mut self.quiet_from[*cell as usize];
            *quiet = (*quiet).max(time + 1);
        }
        if let Some(goal) = path.last() {
            self.parked_from[*goal as usize] = path.len() - 1;
        }
    }
}
