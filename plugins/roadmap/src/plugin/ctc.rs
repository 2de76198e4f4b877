//! The planner `ctc`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Status};
use fleetyard_plugin_spacetime::order::Prefer;
use fleetyard_plugin_spacetime::plugin::{Call, NODE_LIMIT, half_of_memory};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Method, OnRoadmap, Team, no_way, submit};
use crate::ctc::{Ended, Outcome, Settings, plan};
use crate::pbs::{Control, End};

/// Orders of discs on roadmaps, then priority-based search.
pub type Ctc = OnRoadmap<Options>;

/// Options of `ctc`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct Options {
    /// Most orders of all robots to try before priorities are searched for between two at a time.
    orders: u64,
    /// The one of two priorities that is followed first: `collisions` ends sooner, `cost` gives shorter plans.
    prefer: Prefer,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            orders: 20,
            prefer: Prefer::default(),
        }
    }
}

impl Method for Options {
    const ID: &'static str = "ctc";
    const NAME: &'static str = "CTC: prioritised planning and search for priorities on roadmaps";
    const ABOUT: &'static str = "Prioritised safe-interval path planning on roadmaps with the exact times at which discs \
         are too close (Kasaura, Nishimura, Yonetani, RA-L 2022): some orders of all robots, then \
         priority-based search in continuous time, which decides who goes first only where two \
         meet (Ma, Harabor, Stuckey, Li, Koenig, AAAI 2019). Submits the better plan of both. Neither complete nor optimal.";
    const CAPABILITIES: &'static [Capability] = &[
        Capability::Slower,
        Capability::Windowed,
        Capability::Idle,
        Capability::Anytime,
    ];

    fn solve(&self, team: Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let mut stop = || call.stop();
        let mut control = Control {
            stop: &mut stop,
            nodes: call.node_limit().unwrap_or(u64::MAX),
            memory: half_of_memory(call.budget),
        };
        let settings = Settings {
            orders: self.orders,
            prefer: self.prefer,
            seed: call.budget.seed,
        };
        let discs = (team.discs.as_slice(), team.until);
        let Outcome {
            end,
            orders,
            nodes,
            expanded,
        } = plan(
            team.closeness,
            team.known,
            discs,
            settings,
            &mut control,
            &mut |paths| submit(call, paths),
        );
        call.metric("orders", orders as f64);
        call.metric("nodes", (orders + nodes) as f64);
        call.metric("expansions", expanded as f64);
        let gave_up = |reason: &str| Err(Failure::new(Status::GaveUp, reason));
        match end {
            Ended::NoWay(disc) => Err(no_way(disc)),
            Ended::Tried(End::Solved(_)) => Ok(()),
            Ended::Tried(End::Stopped) => Err(call.unfinished(NODE_LIMIT, "a plan was found")),
            Ended::Tried(End::Exhausted) => gave_up("no priorities lead to a plan"),
            Ended::Tried(End::Memory) => {
                gave_up("the search reached its memory limit before a plan was found")
            }
        }
    }
}
