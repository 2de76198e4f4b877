//! The planner `wppl`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Budget, Capability, GridEnvironment, Instance, c};
use fleetyard_plugin_spacetime::plugin::{Call, Method};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Block, Clock, MOVING_STEPS, answer, epibt, first_query, turns};
use crate::wppl::{MOST_STEPS, Query, run};

/// Steps that are planned at least.
const DEPTH: u32 = 15;
/// Times that an agent is planned anew in each window.
const TRIES: u32 = 2;

/// Options of `wppl`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WpplOptions {
    /// Steps that are planned at least, also where the window is shorter.
    #[schemars(range(min = 1, max = 128))]
    depth: u32,
    /// Times that an agent is planned anew in each window, on average, together with a few others; 0
    /// for never, `null` for as often as the budget has time for: the clock decides about the plan then.
    #[schemars(range(max = 10_000))]
    tries: Option<u32>,
    /// Without a window: give up when not everybody has arrived after so many steps.
    #[schemars(range(min = 1))]
    step_limit: u64,
    /// In windows, charge of a move against the lanes of the map, in steps: its streets lead east and
    /// west in turn, and south and north. 0 for no lanes; `null` for 4 where streets are long, and else 0.
    #[schemars(range(max = 100))]
    lane_charge: Option<u16>,
}

impl Default for WpplOptions {
    fn default() -> Self {
        Self {
            depth: DEPTH,
            tries: Some(TRIES),
            step_limit: MOVING_STEPS,
            lane_charge: None,
        }
    }
}

impl Method for WpplOptions {
    const ID: &'static str = "wppl";
    const NAME: &'static str = "WPPL";
    const ABOUT: &'static str = "Windows of paths of all agents, from the end of the last plan on by \
         EPIBT, made better by parallel large neighbourhood search (Jiang, Zhang, Veerapaneni, Li, \
         SoCS 2024): for fleets that work without end, of robots that turn as well.";
    const CAPABILITIES: &'static [Capability] = &[
        Capability::Pebble,
        Capability::Rotation,
        Capability::MoveMask,
        Capability::Windowed,
        Capability::DuplicateGoals,
        Capability::Idle,
        Capability::Threads,
    ];
    const PARTS: &'static [&'static str] = &[c::REST_OF_PLAN_ID];
    type Map = Block;

    fn check(&self) -> Result<(), String> {
        match self.depth {
            1..=MOST_STEPS => Ok(()),
            depth => Err(format!(
                "a `depth` of {depth} steps; hint: give 1 to {MOST_STEPS}"
            )),
        }
    }

    fn learn(&self, grid: &GridEnvironment, budget: &Budget) -> Result<Block, Failure> {
        Block::learn(grid, budget, self.lane_charge)
    }

    fn solve(
        &self,
        block: &mut Block,
        instance: &Instance,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        let turning = turns(instance)?;
        let journeys = block.journeys(instance, turning, call)?;
        let rest = block.rest(instance);
        let query = Query {
            first: epibt::Query {
                step_limit: self.step_limit,
                ..first_query(instance, turning, rest.as_ref(), call)
            },
            depth: self.depth,
            tries: self.tries,
        };
        let mut clock = Clock::new(call);
        let (graph, streets) = block.streets(instance, &mut clock);
        let mut by_street = clock.ranking(streets, journeys);
        let (plan, end, effort) = run(graph, &mut by_street, &query, &mut clock)?;
        call.metric("neighborhoods", effort.neighborhoods as f64);
        call.metric("ended_by_clock", f64::from(u8::from(effort.stopped)));
        answer(&plan, end, instance, call)
    }
}
