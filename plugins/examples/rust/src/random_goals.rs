//! An instance generator: whoever has reached its goal gets another one at random.
//!
//! It looks at no tasks. Every goal is free, reachable from where its agent stands, and
//! the goal of nobody else, so that planners without shared goals can take the instance.

use std::collections::BTreeSet;

use fleetyard_abi::sdk::{Failure, InstanceGenerator, Options, Plugin, Sink};
use fleetyard_abi::{
    Budget, Capabilities, Capability, Descriptor, FleetState, Goals, Kind, SharedEnvironment,
    Status,
};
use rand_chacha::ChaCha8Rng;
use rand_core::{Rng as _, SeedableRng};

use crate::{NoOptions, four_connected, neighbours};

/// Gives agents without a goal a random one.
pub struct RandomGoals;

/// Per cell the number of its connected region; `u32::MAX` where it is blocked.
pub struct Regions(Vec<u32>);

impl Plugin for RandomGoals {
    fn descriptor() -> Descriptor {
        Descriptor {
            name: "Random goals (Rust example)".into(),
            version: env!("CARGO_PKG_VERSION").into(),
            license: env!("CARGO_PKG_LICENSE").into(),
            capabilities: Capabilities::of(&[
                Capability::Grid,
                Capability::Pebble,
                Capability::Rotation,
                Capability::Deterministic,
            ]),
            ..Descriptor::new(
                Kind::InstanceGenerator,
                "random-goals",
                "Keeps goals that are not reached and draws new ones for all other agents, \
                 reachable and no two alike.",
            )
        }
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        options.parse::<NoOptions>()?;
        Ok(Self)
    }
}

impl InstanceGenerator for RandomGoals {
    type Map = Regions;

    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<Regions, Failure> {
        let grid = four_connected(environment)?;
        let neighbours = neighbours(grid);
        let mut region = vec![u32::MAX; neighbours.len()];
        for cell in 0..neighbours.len() {
            if grid.passable[cell] == 0 || region[cell] != u32::MAX {
                continue;
            }
            let mut stack = vec![cell as u32];
            region[cell] = cell as u32;
            while let Some(at) = stack.pop() {
                for near in &neighbours[at as usize] {
                    if region[*near as usize] == u32::MAX {
                        region[*near as usize] = cell as u32;
                        stack.push(*near);
                    }
                }
            }
        }
        Ok(Regions(region))
    }

    fn generate(
        &mut self,
        regions: &mut Regions,
        state: &FleetState,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let cells = regions.0.len();
        let fleet = &state.next;
        if fleet.goals.len() != fleet.starts.len()
            || fleet.starts.iter().any(|cell| *cell as usize >= cells)
        {
            let reason = "the fleet's state does not fit the map, or its goals the agents";
            return Err(Failure::new(Status::InvalidInput, reason));
        }
        // The seed differs from call to call, and is the same in the same run.
        let mut random = ChaCha8Rng::seed_from_u64(budget.seed);

        let mut taken: BTreeSet<u32> = fleet
            .goals
            .iter()
            .filter_map(<[u32]>::last)
            .copied()
            .collect();
        let mut goals = Goals::default();
        for (agent, open) in fleet.goals.iter().enumerate() {
            if sink.cancelled() {
                return Err(Failure::new(Status::Cancelled, "cancelled"));
            }
            if open.is_empty() {
                let goal = regions.draw(&mut random, fleet.starts[agent], &taken)?;
                taken.insert(goal);
                goals.push([goal]);
            } else {
                goals.push(open.iter().copied());
            }
        }
        sink.submit_request(&state.request(goals))?;
        Ok(())
    }
}

impl Regions {
    /// A free cell of the same region that nobody goes to.
    fn draw(
        &self,
        random: &mut ChaCha8Rng,
        from: u32,
        taken: &BTreeSet<u32>,
    ) -> Result<u32, Failure> {
        let region = self.0[from as usize];
        let fits =
            |cell: &u32| self.0[*cell as usize] == region && *cell != from && !taken.contains(cell);
        let cells = self.0.len() as u32;
        // Most draws hit; where few cells are left, count them instead.
        for _ in 0..64 {
            let cell = (random.next_u64() % u64::from(cells)) as u32;
            if region != u32::MAX && fits(&cell) {
                return Ok(cell);
            }
        }
        let left: Vec<u32> = (0..cells).filter(fits).collect();
        if region == u32::MAX || left.is_empty() {
            let reason = format!("no goal is left for the agent in cell {from}");
            return Err(Failure::new(Status::GaveUp, reason));
        }
        Ok(left[(random.next_u64() % left.len() as u64) as usize])
    }
}
