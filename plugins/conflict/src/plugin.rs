//! The planners behind the plugin contract: ids `cbs` and `ecbs`.

use fleetyard_abi::sdk::{Failure, Options as Given, Planner, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Instance, SharedEnvironment, Status, monotonic_ns,
};
use fleetyard_plugin_spacetime::plugin::{self, Goals, half_of_memory};
use fleetyard_plugin_spacetime::problem::Ground;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{End, Settings, solve};

/// What both planners keep between calls: the map, and distances.
#[derive(Default)]
struct Prepared {
    ground: Option<Ground>,
    cols: u32,
}

impl Prepared {
    fn learn(&mut self, environment: &SharedEnvironment, budget: &Budget) -> Result<(), Failure> {
        self.ground = Some(Ground::new(environment, half_of_memory(budget))?);
        self.cols = environment.grid().map_or(0, |grid| grid.cols);
        Ok(())
    }

    fn plan(
        &mut self,
        goals: Goals,
        settings: &Settings,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let ground = self.ground.as_mut().ok_or_else(|| {
            Failure::new(Status::InvalidInput, "there was no map before the instance")
        })?;
        let answer_by = budget.answer_by_ns();
        let mut stop = || monotonic_ns() >= answer_by || sink.cancelled();
        let problem = ground.problem(instance, goals.into(), &mut stop)?;
        let settings = Settings {
            node_limit: (budget.nodes > 0).then_some(budget.nodes),
            memory_limit: half_of_memory(budget),
            ..settings.clone()
        };
        let outcome = solve(&problem, self.cols, &settings, &mut stop);
        sink.metric("expansions", outcome.expanded as f64);
        sink.metric("generated", outcome.generated as f64);
        sink.metric("bypassed", outcome.bypassed as f64);
        sink.metric("low_level_expansions", outcome.low_level as f64);
        sink.metric("lower_bound", outcome.lower_bound as f64);
        // A plan that comes too late is no fault.
        let _ = sink.submit_plan(problem.plan(&outcome.paths).as_ref());
        let failure = |status, reason: &str| Err(Failure::new(status, reason));
        match outcome.end {
            End::Solved => Ok(()),
            End::Infeasible if settings.delay > 0 => {
                failure(Status::GaveUp, "no plan tolerates that many steps of delay")
            }
            End::Infeasible => failure(Status::Infeasible, "the constraint tree is exhausted"),
            End::Stopped => failure(
                Status::TimedOut,
                "the budget ended before a plan was found; these paths collide",
            ),
            End::Nodes => failure(
                Status::GaveUp,
                "the node limit was reached; these paths collide",
            ),
            End::Memory => failure(
                Status::GaveUp,
                "the tree reached its memory limit before a plan was found; these paths collide",
            ),
        }
    }
}

fn descriptor(id: &str, name: &str, description: &str) -> Descriptor {
    let all = [
        Capability::Grid,
        Capability::Pebble,
        Capability::Rotation,
        Capability::Windowed,
        Capability::DuplicateGoals,
        Capability::CollidingPlans,
        Capability::KRobust,
        Capability::Deterministic,
    ];
    plugin::descriptor(id, name, description, &all, &[])
}

/// Options of `cbs`.
#[derive(Debug, Clone, Copy, Default, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OptimalOptions {
    /// What an agent does after its last goal. In a window a visit is always enough.
    goals: Goals,
    /// Nobody enters a cell within so many steps after somebody else was there.
    #[schemars(range(max = 1000))]
    k: u16,
}

/// Options of `ecbs`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct BoundedOptions {
    /// What an agent does after its last goal. In a window a visit is always enough.
    goals: Goals,
    /// Nobody enters a cell within so many steps after somebody else was there.
    #[schemars(range(max = 1000))]
    k: u16,
    /// The sum of costs is at most so many times the least one. In a window only the steps
    /// within it are multiplied.
    #[schemars(range(min = 1.0, max = 100.0))]
    suboptimality: f64,
}

impl Default for BoundedOptions {
    fn default() -> Self {
        Self {
            goals: Goals::Stay,
            k: 0,
            suboptimality: 1.2,
        }
    }
}

/// Conflict-based search: optimal.
pub struct ConflictBasedSearch {
    options: OptimalOptions,
    prepared: Prepared,
}

impl Plugin for ConflictBasedSearch {
    fn descriptor() -> Descriptor {
        Descriptor {
            options_schema: options_schema::<OptimalOptions>(),
            ..descriptor(
                "cbs",
                "CBS",
                "Conflict-based search (Sharon, Stern, Felner, Sturtevant, AIJ 2015): plans with \
                 the least sum of costs. With cardinal conflicts first, bypass, the heuristic of \
                 pairs (WDG, Li et al., IJCAI 2019), and target, corridor and rectangle \
                 reasoning (Li et al., AIJ 2021).",
            )
        }
    }

    fn create(given: Given<'_>) -> Result<Self, Failure> {
        Ok(Self {
            options: given.parse()?,
            prepared: Prepared::default(),
        })
    }
}

impl Planner for ConflictBasedSearch {
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        _: &dyn Sink,
    ) -> Result<(), Failure> {
        self.prepared.learn(environment, budget)
    }

    fn plan(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let OptimalOptions { goals, k } = self.options;
        let settings = Settings {
            delay: u32::from(k),
            ..Settings::default()
        };
        self.prepared.plan(goals, &settings, instance, budget, sink)
    }
}

/// Conflict-based search with focal lists: within a factor of the least cost.
pub struct BoundedSearch {
    options: BoundedOptions,
    prepared: Prepared,
}

impl Plugin for BoundedSearch {
    fn descriptor() -> Descriptor {
        Descriptor {
            options_schema: options_schema::<BoundedOptions>(),
            ..descriptor(
                "ecbs",
                "ECBS",
                "Enhanced conflict-based search (Barer, Sharon, Stern, Felner, SoCS 2014): plans \
                 within a factor of the least sum of costs, much sooner than optimal ones. In a \
                 window as RHCR does it (Li et al., AAAI 2021).",
            )
        }
    }

    fn create(given: Given<'_>) -> Result<Self, Failure> {
        let options: BoundedOptions = given.parse()?;
        if !(1.0..=100.0).contains(&options.suboptimality) {
            let reason = format!(
                "options: `suboptimality` is {}; hint: give a factor from 1 to 100",
                options.suboptimality
            );
            return Err(Failure::new(Status::InvalidInput, reason));
        }
        Ok(Self {
            options,
            prepared: Prepared::default(),
        })
    }
}

impl Planner for BoundedSearch {
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        _: &dyn Sink,
    ) -> Result<(), Failure> {
        self.prepared.learn(environment, budget)
    }

    fn plan(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let BoundedOptions {
            goals,
            k,
            suboptimality,
        } = self.options;
        let settings = Settings {
            delay: u32::from(k),
            weight: suboptimality,
            ..Settings::default()
        };
        self.prepared.plan(goals, &settings, instance, budget, sink)
    }
}
