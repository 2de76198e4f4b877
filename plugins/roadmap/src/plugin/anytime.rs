//! The planners `roadmap-lns` and `roadmap-lacam`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Status};
use fleetyard_plugin_spacetime::plugin::{Call, NODE_LIMIT, half_of_memory};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Method, OnRoadmap, Team, no_way, submit};
use crate::anytime::{Begin, Control, End, Settings, plan};

/// Repairs until there is a plan, and makes it shorter until the budget ends.
pub type RoadmapLns = OnRoadmap<LnsOptions>;

/// Steps of all discs until there is a plan, and makes it shorter until the budget ends.
pub type RoadmapLacam = OnRoadmap<LacamOptions>;

/// Options of both planners.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct AnytimeOptions {
    /// Number of robots that are planned anew at a time.
    #[schemars(range(min = 1, max = 1000))]
    neighborhood: u32,
    /// Improve the first plan until the budget ends; else it is the only one.
    anytime: bool,
}

impl Default for AnytimeOptions {
    fn default() -> Self {
        Self {
            neighborhood: 8,
            anytime: true,
        }
    }
}

/// Options of `roadmap-lns`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct LnsOptions(AnytimeOptions);

/// Options of `roadmap-lacam`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct LacamOptions(AnytimeOptions);

impl Method for LnsOptions {
    const ID: &'static str = "roadmap-lns";
    const NAME: &'static str = "MAPF-LNS2 and MAPF-LNS on roadmaps";
    const ABOUT: &'static str = "Anytime, in continuous time: begins with paths that meet as few others as one robot at a time \
         can help it, and plans a few robots anew until nobody meets another (MAPF-LNS2: Li, \
         Chen, Harabor, Stuckey, Koenig, AAAI 2022), then until the budget ends to shorten \
         the plan (MAPF-LNS: the same, IJCAI 2021). Neither complete nor optimal.";
    const CAPABILITIES: &'static [Capability] = &[Capability::Anytime];

    fn solve(&self, mut team: Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        solve(Begin::Repair, &self.0, &mut team, call)
    }
}

impl Method for LacamOptions {
    const ID: &'static str = "roadmap-lacam";
    const NAME: &'static str = "LaCAM on roadmaps";
    const ABOUT: &'static str = "Anytime, for a thousand robots: searches for steps in which every robot drives an edge or \
         stays and no two come too close (LaCAM: Okumura, AAAI 2023), and gives them the \
         earliest times in which all pass each other in the same order; then another plan and \
         large neighbourhood search as in `roadmap-lns`. Finds every plan in steps, given \
         time; not optimal.";
    const CAPABILITIES: &'static [Capability] = &[Capability::Anytime];

    fn solve(&self, mut team: Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        solve(Begin::Steps, &self.0, &mut team, call)
    }
}

fn solve(
    begin: Begin,
    options: &AnytimeOptions,
    team: &mut Team<'_>,
    call: &Call<'_>,
) -> Result<(), Failure> {
    if team.until.is_finite() || team.discs.iter().any(|disc| disc.goals.len() != 1) {
        let reason = "this planner knows one goal per agent, and no windows";
        return Err(Failure::new(Status::Unsupported, reason));
    }
    let mut stop = || call.stop();
    let mut control = Control {
        stop: &mut stop,
        nodes: call.node_limit().unwrap_or(u64::MAX),
        memory: half_of_memory(call.budget),
    };
    let settings = Settings {
        begin,
        neighborhood: options.neighborhood as usize,
        anytime: options.anytime,
        seed: call.budget.seed,
    };
    let outcome = plan(
        team.closeness,
        team.known,
        &team.discs,
        settings,
        &mut control,
        &mut |paths| submit(call, paths),
    );
    let work = outcome.work;
    call.metric("nodes", work.nodes as f64);
    call.metric("expansions", work.expanded as f64);
    call.metric("configurations", work.configurations as f64);
    call.metric("repairs", work.repairs as f64);
    if work.plans > 0 {
        call.metric("first_cost_s", work.first_cost);
    }
    match outcome.end {
        End::Solved => Ok(()),
        End::NoWay(disc) => Err(no_way(disc)),
        End::Stopped => Err(call.unfinished(NODE_LIMIT, "a plan was found")),
        End::Memory => Err(Failure::new(
            Status::GaveUp,
            "the search reached its memory limit before a plan was found",
        )),
    }
}
