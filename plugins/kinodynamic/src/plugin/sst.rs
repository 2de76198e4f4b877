//! The planner behind the plugin contract: id `sst`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Descriptor, Status};
use fleetyard_plugin_spacetime::plugin::{Call, ROOM_LIMIT, half_of_memory};

use super::rrt_star::{alone, submitted};
use super::{InStates, Method, Team, show_tree};
use crate::sampling::drive::Drive;
use crate::sampling::sst::{NODE_BYTES, Options, Sparse};

/// The clock is read after so many controls.
const CONTROLS: u64 = 16;

/// A plan that is better by less than this part of its cost waits for the end of the budget.
const BETTER: f64 = 1e-3;

/// A plan is best if it costs more than the bound by this part of it.
const BEST: f64 = 1e-6;

/// A sparse tree of random controls.
pub type Sst = InStates<Options>;

impl Method for Options {
    const ID: &'static str = "sst";
    const NAME: &'static str = "SST*";
    const ABOUT: &'static str = "Anytime: one robot of any dynamics, driven by random controls, of which the fastest to \
         each neighbourhood are kept, and neighbourhoods shrink (SST, SST*: Li, Littlefield, Bekris, IJRR 2016). \
         New states are led to the goal exactly where nothing is in the way. Keeps clear of movers.";
    const MORE_FEATURES: &'static [&'static str] = &[Descriptor::ONE_AGENT];
    const CAPABILITIES: &'static [Capability] = &[Capability::Anytime];

    fn clearance_m(&self) -> f64 {
        self.clearance_m
    }

    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let member = alone(team, "k-cbs plans for teams")?;
        let drive = Drive::new(team, 0);
        let start = member.start.pose();
        if !member.space.is_free(&start) {
            let reason = "the robot touches an obstacle at its start";
            return Err(Failure::new(Status::GaveUp, reason));
        }
        let mut tree = Sparse::new(&drive, self, call.budget.seed);
        let nodes = call.node_limit().unwrap_or(u64::MAX);
        let room = (half_of_memory(call.budget) / NODE_BYTES).clamp(1, u64::from(u32::MAX) - 1);
        let least = drive.bound(&member.start);
        let mut told = f64::INFINITY;
        let mut tell = |tree: &Sparse<'_>, part: f64| {
            let Some(course) = tree.course() else {
                return Ok(());
            };
            let cost = tree.best_seconds;
            if cost >= told * (1.0 - part) {
                return Ok(());
            }
            if told.is_infinite() {
                call.metric("first_cost_s", cost);
            }
            told = cost;
            submitted(team, call, course)
        };
        tell(&tree, 0.0)?;
        while tree.tried < nodes
            && (tree.nodes() as u64) < room
            && tree.best_seconds > least * (1.0 + BEST)
        {
            if tree.tried.is_multiple_of(CONTROLS) && call.stop() {
                break;
            }
            if tree.grow() {
                tell(&tree, BETTER)?;
            }
        }
        tell(&tree, 0.0)?;
        show_tree(call, tree.lines());
        call.metric("nodes", tree.tried as f64);
        call.metric("vertices", tree.added as f64);
        if told.is_finite() {
            return Ok(());
        }
        Err(call.unfinished(ROOM_LIMIT, "a way was found"))
    }
}
