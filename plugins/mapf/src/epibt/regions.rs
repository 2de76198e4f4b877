//! Parts of a map in which a step is improved at the same time.
//!
//! An agent belongs to a region if all its operations lie there. Only those are displaced, so that
//! what happens in one region does not depend on any other, nor on the number of threads. Regions
//! are shifted from round to round, since agents at their borders have no part in a round.

use std::sync::Arc;

use fleetyard_plugin_spacetime::graph::{Graph, Vertex};
use fleetyard_plugin_spacetime::random::Random;

use super::{NOBODY, Search, Team};
use crate::share::share;

/// Least rows, and columns, of a region, for each action of an operation.
const SIDE: u32 = 12;
/// Rounds in which all tries of a step are made, where there are several regions.
const ROUNDS: u64 = 4;
/// Random streams of regions begin here.
const STREAM: u64 = 1 << 32;

/// The regions of a map.
#[derive(Debug)]
pub(super) struct Regions {
    /// Rows and columns of the map, and of a region.
    size: [u32; 2],
    side: [u32; 2],
    places: Arc<[[u32; 2]]>,
}

/// The regions of a round.
#[derive(Debug)]
pub(super) struct Zones {
    side: [u32; 2],
    /// Rows, and columns, by which they are shifted.
    shift: [u32; 2],
    /// Regions beside each other.
    across: u32,
    places: Arc<[[u32; 2]]>,
}

impl Zones {
    /// The region of a vertex; any for what is none.
    #[inline]
    pub(super) fn of(&self, v: Vertex) -> u32 {
        self.places
            .get(v as usize)
            .map_or(0, |place| self.at(*place))
    }

    /// The region of a place.
    fn at(&self, place: [u32; 2]) -> u32 {
        let number = |axis: usize| (place[axis] + self.shift[axis]) / self.side[axis];
        number(0) * self.across + number(1)
    }
}

impl Regions {
    /// For operations of so many actions.
    pub(super) fn new(graph: &Graph, actions: usize) -> Self {
        let places: Arc<[[u32; 2]]> = (0..graph.len() as Vertex).map(|v| graph.place(v)).collect();
        let last = |axis: usize| places.iter().map(|place| place[axis]).max();
        let size = [0, 1].map(|axis| last(axis).map_or(1, |last| last + 1));
        let side = size.map(|size| size.div_ceil((size / (SIDE * actions as u32)).max(1)));
        Self { size, side, places }
    }

    /// True if the whole map is one region.
    fn is_one(&self) -> bool {
        self.size == self.side
    }

    /// The regions of a round.
    fn zones(&self, round: u64) -> Zones {
        // Every second round is shifted by half a region, first both ways and then one way each.
        let shifted = match round % ROUNDS {
            0 => [0, 0],
            1 => [1, 1],
            2 => [0, 1],
            _ => [1, 0],
        };
        Zones {
            side: self.side,
            shift: [0, 1].map(|axis| shifted[axis] * self.side[axis] / 2),
            across: (self.size[1] + self.side[1] / 2) / self.side[1] + 1,
            places: Arc::clone(&self.places),
        }
    }

    /// Says where everybody belongs in a round. Gives the agents of each region.
    fn assign<const D: usize>(&self, team: &mut Team<D>, round: u64) -> Vec<Vec<u32>> {
        let zones = self.zones(round);
        let mut members: Vec<Vec<u32>> = Vec::new();
        for (agent, &start) in team.starts.iter().enumerate() {
            let place = self.places[start as usize];
            let first = place.map(|at| at.saturating_sub(D as u32));
            let last = [0, 1].map(|axis| (place[axis] + D as u32).min(self.size[axis] - 1));
            let region = zones.at(first);
            let inside = region == zones.at(last);
            team.within[agent] = if inside { region } else { NOBODY };
            if inside {
                let region = region as usize;
                members.resize_with(members.len().max(region + 1), Vec::new);
                members[region].push(agent as u32);
            }
        }
        team.zones = Some(zones);
        members
    }

    /// Tries so often for each agent to make a step better; as often as there is time for without a
    /// number. `step` is the number of the step: with the seed it decides where searches begin. The
    /// result depends on the number of threads, one per search, only if it is stopped.
    pub(super) fn improve<const D: usize>(
        &self,
        team: &mut Team<D>,
        searches: &mut [Search],
        tries: Option<u32>,
        (seed, step): (u64, u64),
        random: &mut Random,
        stop: &mut dyn FnMut() -> bool,
    ) {
        if self.is_one() {
            let tries = tries.map(|tries| u64::from(tries) * team.starts.len() as u64);
            let all: Vec<u32> = (0..team.starts.len() as u32).collect();
            if let Some(search) = searches.first_mut() {
                search.improve(team, (0, &all), tries, random, stop);
            }
            return;
        }
        for round in 0..tries.map_or(u64::MAX, |_| ROUNDS) {
            if stop() {
                return;
            }
            let members = self.assign(team, round);
            let count = members.len() as u64;
            let team = &*team;
            share(
                searches,
                (0_u32..).zip(&members),
                |search, (region, agents)| {
                    let stream = STREAM + (step * ROUNDS + round) * count + u64::from(region);
                    let mut random = Random::new(seed, stream);
                    let tries = match tries {
                        Some(tries) => u64::from(tries) * agents.len() as u64 / ROUNDS,
                        None => agents.len() as u64,
                    };
                    search.improve(
                        team,
                        (region, agents),
                        Some(tries),
                        &mut random,
                        &mut || false,
                    );
                },
            );
        }
    }
}
