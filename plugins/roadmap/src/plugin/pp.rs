//! The planner `roadmap-pp`.

use fleetyard_abi::Capability;
use fleetyard_abi::sdk::Failure;
use fleetyard_plugin_plane::orders::End;
use fleetyard_plugin_plane::plugin::{OrderOptions, unsolved};
use fleetyard_plugin_spacetime::plugin::Call;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Method, OnRoadmap, Team, submit};
use crate::priority::plan;

/// Prioritised planning of discs on roadmaps.
pub type RoadmapPrioritised = OnRoadmap<Options>;

/// Options of `roadmap-pp`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct Options(OrderOptions);

impl Method for Options {
    const ID: &'static str = "roadmap-pp";
    const NAME: &'static str = "Prioritised planning on roadmaps";
    const ABOUT: &'static str = "Plans discs on a roadmap one after the other by safe intervals, with the exact \
         times at which discs on edges and vertices are too close to each other (Kasaura, \
         Nishimura, Yonetani, RA-L 2022). For the motion `slower`, robots on wheels whose headings \
         are given turn in place and drive from rest to rest (Yan, Li, AAAI 2025). Neither complete \
         nor optimal.";
    const CAPABILITIES: &'static [Capability] =
        &[Capability::Slower, Capability::Windowed, Capability::Idle];

    fn solve(&self, team: Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let (limit, seed) = (self.0.within(call.budget), call.budget.seed);
        let discs = (team.discs.as_slice(), team.until);
        let mut stop = || call.stop();
        let outcome = plan(team.closeness, team.known, discs, limit, seed, &mut stop);
        call.metric("nodes", outcome.orders as f64);
        call.metric("expansions", outcome.expanded as f64);
        match outcome.end {
            End::Solved(paths) => {
                submit(call, &paths);
                Ok(())
            }
            end => Err(unsolved(end == End::Stopped, outcome.orders)),
        }
    }
}
