//! The planners `ccbs` and `eccbs`.

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Capability, Status};
use fleetyard_plugin_spacetime::plugin::{Call, NODE_LIMIT, most_of_memory};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Method, OnRoadmap, Team, submit};
use crate::conflict::{Branching, End, Settings, solve};
use crate::priority::Disc;
use crate::roadmap::Vertex;

/// Options of `ccbs`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OptimalOptions {
    /// The constraints that resolve a move past an agent at rest.
    branching: Branching,
    /// Take over paths of children that avoid a conflict at no cost.
    bypass: bool,
    /// Let one child of a split say what the other forbids; the original branching never does.
    disjoint_splitting: bool,
    /// Bound the cost of a node by searches for pairs of agents.
    heuristic: bool,
}

impl Default for OptimalOptions {
    fn default() -> Self {
        Self {
            branching: Branching::Sound,
            bypass: true,
            disjoint_splitting: true,
            heuristic: true,
        }
    }
}

impl Method for OptimalOptions {
    const ID: &'static str = "ccbs";
    const NAME: &'static str = "CCBS: conflict-based search in continuous time";
    const ABOUT: &'static str = "Conflict-based search of discs on a roadmap in continuous time (Andreychuk, Yakovlev, \
         Surynek, Atzmon, Stern, AIJ 2022): plans with the least sum of arrival times. With \
         branching that loses no solution (Combrink, Roselli, Fabian, 2025), prioritised conflicts, \
         bypass, bounds of pairs, and target reasoning.";
    const CAPABILITIES: &'static [Capability] = &[];

    fn solve(&self, team: Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let settings = Settings {
            branching: self.branching,
            bypass: self.bypass,
            disjoint: self.disjoint_splitting,
            pairs: self.heuristic,
            ..Settings::default()
        };
        search(&team, settings, call)
    }
}

/// Options of `eccbs`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BoundedOptions {
    /// The constraints that resolve a move past an agent at rest.
    branching: Branching,
    /// The sum of arrival times is at most so many times the least one.
    #[schemars(range(min = 1.0, max = 100.0))]
    suboptimality: f64,
}

impl Default for BoundedOptions {
    fn default() -> Self {
        Self {
            branching: Branching::Sound,
            suboptimality: 1.2,
        }
    }
}

impl Method for BoundedOptions {
    const ID: &'static str = "eccbs";
    const NAME: &'static str = "ECCBS: bounded conflict-based search in continuous time";
    const ABOUT: &'static str = "Conflict-based search of discs on a roadmap in continuous time with focal lists at both \
         levels (Barer, Sharon, Stern, Felner, SoCS 2014; Andreychuk et al., AIJ 2022): plans within \
         a factor of the least sum of arrival times, much sooner than optimal ones.";
    const CAPABILITIES: &'static [Capability] = &[];

    fn check(&self) -> Result<(), String> {
        if (1.0..=100.0).contains(&self.suboptimality) {
            return Ok(());
        }
        Err(format!(
            "`suboptimality` is {}; hint: give a factor from 1 to 100",
            self.suboptimality
        ))
    }

    fn solve(&self, team: Team<'_>, call: &Call<'_>) -> Result<(), Failure> {
        let settings = Settings {
            branching: self.branching,
            weight: self.suboptimality,
            ..Settings::default()
        };
        search(&team, settings, call)
    }
}

/// Conflict-based search in continuous time: optimal.
pub type Ccbs = OnRoadmap<OptimalOptions>;

/// Conflict-based search in continuous time with focal lists: within a factor of the least cost.
pub type Eccbs = OnRoadmap<BoundedOptions>;

/// Searches, and hands over the plan that comes of it.
fn search(team: &Team<'_>, settings: Settings, call: &Call<'_>) -> Result<(), Failure> {
    let failure = |status, reason: &str| Err(Failure::new(status, reason));
    let task = |disc: &Disc| Some((disc.start, *disc.goals.first()?));
    let tasks: Option<Vec<(Vertex, Vertex)>> = team.discs.iter().map(task).collect();
    let Some(tasks) = tasks.filter(|_| team.discs.iter().all(|disc| disc.goals.len() == 1)) else {
        return failure(Status::Unsupported, "each agent has to have one goal");
    };
    let settings = Settings {
        node_limit: call.node_limit(),
        memory_limit: most_of_memory(call.budget),
        ..settings
    };
    let outcome = solve(team.closeness, &tasks, &settings, &mut || call.stop());
    call.metric("nodes", outcome.generated as f64);
    call.metric("expansions", outcome.expanded as f64);
    call.metric("bypassed", outcome.bypassed as f64);
    call.metric("searches", outcome.searches as f64);
    call.metric("low_level_expansions", outcome.low_level as f64);
    if outcome.lower_bound.is_finite() {
        call.metric("lower_bound", outcome.lower_bound);
    }
    match outcome.end {
        End::Solved => {
            submit(call, &outcome.paths);
            Ok(())
        }
        End::Infeasible if settings.branching == Branching::Original => failure(
            Status::GaveUp,
            "the constraint tree is exhausted, but the original branching loses plans",
        ),
        End::Infeasible => failure(Status::Infeasible, "the constraint tree is exhausted"),
        End::Stopped => Err(call.unfinished("the memory of one search", "a plan was found")),
        End::Nodes => Err(call.unfinished(NODE_LIMIT, "a plan was found")),
        End::Memory => failure(
            Status::GaveUp,
            "the tree reached its memory limit before a plan was found",
        ),
    }
}
