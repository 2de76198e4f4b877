//! The planners behind the plugin contract: ids `pp` and `pbs`.

use fleetyard_abi::sdk::{Failure, Options as Given, Planner, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Instance, SharedEnvironment, Status, monotonic_ns,
};
use fleetyard_plugin_spacetime::plugin::{self, Goals, half_of_memory};
use fleetyard_plugin_spacetime::problem::{GoalRule, Ground, Problem};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::planner::{Control, Outcome};
use crate::prioritized;
use crate::search::{self, Prefer};

/// What both planners keep between calls: the map, and distances.
#[derive(Default)]
struct Prepared(Option<Ground>);

impl Prepared {
    fn learn(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        lane_charge: u16,
    ) -> Result<(), Failure> {
        let ground = Ground::new(environment, half_of_memory(budget))?;
        self.0 = Some(ground.with_lanes(lane_charge.into()));
        Ok(())
    }

    /// Plans with `run` and hands over what comes of it, at the end of the budget too.
    fn plan(
        &mut self,
        rule: GoalRule,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
        run: impl FnOnce(&Problem, &mut Control<'_>) -> Outcome,
    ) -> Result<(), Failure> {
        let ground = self.0.as_mut().ok_or_else(|| {
            Failure::new(Status::InvalidInput, "there was no map before the instance")
        })?;
        let answer_by = budget.answer_by_ns();
        let mut stop = || monotonic_ns() >= answer_by || sink.cancelled();
        let problem = ground.problem(instance, rule, &mut stop)?;
        if problem.lanes.is_none() {
            sink.metric("lower_bound", problem.lower_bound() as f64);
        }
        let mut control = Control {
            stop: &mut stop,
            nodes: budget.nodes,
            memory: half_of_memory(budget),
        };
        let outcome = run(&problem, &mut control);
        // A plan that comes too late is no fault.
        let _ = sink.submit_plan(problem.plan(outcome.paths()).as_ref());
        match outcome {
            Outcome::Solved(_) => Ok(()),
            Outcome::Stopped(_) => Err(Failure::new(
                Status::TimedOut,
                "the budget ended before a plan was found; these paths collide",
            )),
            Outcome::Exhausted(_) => Err(Failure::new(
                Status::GaveUp,
                "no order of priorities leads to a plan; these paths collide",
            )),
            Outcome::Memory(_) => Err(Failure::new(
                Status::GaveUp,
                "the search reached its memory limit before a plan was found; these paths collide",
            )),
        }
    }
}

fn descriptor(id: &str, name: &str, description: &str, extra: &[Capability]) -> Descriptor {
    let common = [
        Capability::Grid,
        Capability::Pebble,
        Capability::Rotation,
        Capability::Windowed,
        Capability::DuplicateGoals,
        Capability::CollidingPlans,
        Capability::Deterministic,
    ];
    plugin::descriptor(id, name, description, &common, extra)
}

/// What a turn costs a robot that drives about as fast as it turns: it stops, turns and sets
/// out again.
const TURN_CHARGE: u16 = 2;

/// What a move against a lane is charged: a short way against it is better than a long one
/// round, since others let an agent pass.
const LANE_CHARGE: u16 = 2;

/// Options of `pp`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct PrioritizedOptions {
    /// What an agent does after its last goal. In a window a visit is always enough.
    goals: Goals,
    /// Nobody enters a cell within so many steps after somebody else was there.
    #[schemars(range(max = 1000))]
    k: u16,
    /// What a turn by 90° is charged in steps, where agents look somewhere and turns take no
    /// steps of the plan: robots that are not pebbles stop for them.
    #[schemars(range(max = 1000))]
    turn_charge: u16,
    /// What a move against the lanes of the map is charged in steps, in windows: its streets
    /// lead east and west in turn, and south and north.
    #[schemars(range(max = 100))]
    lane_charge: u16,
}

impl Default for PrioritizedOptions {
    fn default() -> Self {
        Self {
            goals: Goals::default(),
            k: 0,
            turn_charge: TURN_CHARGE,
            lane_charge: LANE_CHARGE,
        }
    }
}

/// Prioritized planning.
pub struct Prioritized {
    options: PrioritizedOptions,
    prepared: Prepared,
}

impl Plugin for Prioritized {
    fn descriptor() -> Descriptor {
        Descriptor {
            options_schema: options_schema::<PrioritizedOptions>(),
            ..descriptor(
                "pp",
                "Prioritized planning",
                "One agent after the other, each out of the way of those before it (Erdmann, \
                 Lozano-Pérez, Algorithmica 1987), by SIPP; other orders when somebody finds no \
                 path, until the budget ends. Not complete, not optimal.",
                &[Capability::KRobust],
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

impl Planner for Prioritized {
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        _: &dyn Sink,
    ) -> Result<(), Failure> {
        self.prepared
            .learn(environment, budget, self.options.lane_charge)
    }

    fn plan(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let PrioritizedOptions {
            goals,
            k,
            turn_charge,
            ..
        } = self.options;
        let options = prioritized::Options {
            delay: u32::from(k),
            turn_charge: turn_charge.into(),
        };
        let run = |problem: &Problem, control: &mut Control<'_>| {
            let (outcome, effort) = prioritized::plan(problem, options, budget.seed, control);
            sink.metric("orders", effort.orders as f64);
            sink.metric("expansions", effort.expansions as f64);
            outcome
        };
        self.prepared
            .plan(goals.into(), instance, budget, sink, run)
    }
}

/// Options of `pbs`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
struct SearchOptions {
    /// What an agent does after its last goal. In a window a visit is always enough.
    goals: Goals,
    /// Which of two decisions is followed first: `collisions` ends sooner, `cost` gives
    /// shorter plans.
    prefer: Prefer,
    /// What a turn by 90° is charged in steps, where agents look somewhere and turns take no
    /// steps of the plan: robots that are not pebbles stop for them.
    #[schemars(range(max = 1000))]
    turn_charge: u16,
    /// What a move against the lanes of the map is charged in steps, in windows: its streets
    /// lead east and west in turn, and south and north.
    #[schemars(range(max = 100))]
    lane_charge: u16,
}

impl Default for SearchOptions {
    fn default() -> Self {
        Self {
            goals: Goals::default(),
            prefer: Prefer::default(),
            turn_charge: TURN_CHARGE,
            lane_charge: LANE_CHARGE,
        }
    }
}

/// Priority-based search.
pub struct PriorityBasedSearch {
    options: SearchOptions,
    prepared: Prepared,
}

impl Plugin for PriorityBasedSearch {
    fn descriptor() -> Descriptor {
        Descriptor {
            options_schema: options_schema::<SearchOptions>(),
            ..descriptor(
                "pbs",
                "PBS",
                "Priority-based search (Ma, Harabor, Stuckey, Li, Koenig, AAAI 2019): decides \
                 who goes first only where two agents collide, depth first; windowed as in \
                 rolling-horizon collision resolution (Li et al., AAAI 2021). Not complete, not \
                 optimal.",
                &[],
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

impl Planner for PriorityBasedSearch {
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        _: &dyn Sink,
    ) -> Result<(), Failure> {
        self.prepared
            .learn(environment, budget, self.options.lane_charge)
    }

    fn plan(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let SearchOptions {
            goals,
            prefer,
            turn_charge,
            ..
        } = self.options;
        let options = search::Options {
            prefer,
            turn_charge: turn_charge.into(),
        };
        let run = |problem: &Problem, control: &mut Control<'_>| {
            let (outcome, effort) = search::plan(problem, options, budget.seed, control);
            sink.metric("nodes", effort.nodes as f64);
            sink.metric("paths", effort.paths as f64);
            sink.metric("expansions", effort.expansions as f64);
            outcome
        };
        self.prepared
            .plan(goals.into(), instance, budget, sink, run)
    }
}
