//! The planner behind the plugin contract: id `k-cbs`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Status};
use fleetyard_plugin_spacetime::plugin::{Call, half_of_memory};

use super::{InStates, Method, Team};
use crate::course::Course;
use crate::sampling::k_cbs::{Limits, Options, Search};

/// Conflict-based search over trees of controls.
pub type KCbs = InStates<Options>;

impl Method for Options {
    const ID: &'static str = "k-cbs";
    const NAME: &'static str = "K-CBS";
    const ABOUT: &'static str = "Teams of any dynamics by conflict-based search over random trees of controls; pairs that \
         conflict too often are merged and move in one tree (K-CBS: Kottinger, Almagor, Lahijanian, IROS 2022). \
         New states are led to their goals exactly where nothing is in the way. Keeps clear of movers.";
    const CAPABILITIES: &'static [Capability] = &[Capability::Heterogeneous, Capability::Anytime];

    fn clearance_m(&self) -> f64 {
        self.clearance_m
    }

    fn solve(&self, team: &Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        for (agent, member) in team.members.iter().enumerate() {
            if !member.space.is_free(&member.start.pose()) {
                let reason = format!("agent {agent} touches an obstacle at its start");
                return Err(Failure::new(Status::GaveUp, reason));
            }
        }
        let mut stop = || call.stop();
        let limits = Limits {
            controls: call.node_limit().unwrap_or(u64::MAX),
            memory: half_of_memory(call.budget),
            stop: &mut stop,
        };
        let mut search = Search::new(team, self, call.budget.seed, limits);
        let mut best = f64::INFINITY;
        let (mut round, mut before) = (0, 0);
        while self.rounds.is_none_or(|rounds| round < rounds) && !search.is_over() {
            // Rounds differ by the controls that they draw: one without any is all that can be had.
            let drawn = search.effort.controls;
            if round > 1 && drawn == before {
                break;
            }
            before = drawn;
            round += 1;
            let Some(courses) = search.run() else {
                search.again(best);
                continue;
            };
            let seconds: f64 = courses.iter().map(Course::seconds).sum();
            if seconds < best {
                team.submit(call, &courses)?;
                if best.is_infinite() {
                    call.metric("first_cost_s", seconds);
                }
                best = seconds;
            }
            if best <= 0.0 {
                break;
            }
            search.again(best);
        }
        let effort = search.effort;
        call.metric("rounds", round as f64);
        call.metric("nodes", effort.controls as f64);
        call.metric("generated", effort.nodes as f64);
        call.metric("plans", effort.plans as f64);
        call.metric("merges", effort.merges as f64);
        if best.is_finite() {
            return Ok(());
        }
        Err(call.unfinished("a limit of rounds, controls or memory", "a plan was found"))
    }
}
