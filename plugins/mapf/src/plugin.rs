//! The planners behind the plugin contract: ids `lacam` and `pibt`.

use std::marker::PhantomData;

use fleetyard_abi::sdk::{Failure, Options as Given, Planner, Plugin, Sink, options_schema};
use fleetyard_abi::{
    Budget, Capability, Descriptor, Instance, Motion, PlanRef, SharedEnvironment, Status,
    monotonic_ns,
};
use fleetyard_plugin_spacetime::plugin;
use schemars::JsonSchema;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use crate::lanes::Streets;
use crate::lifelong::{ByDistance, End, Lifelong, Query};
use crate::{Algorithm, Limit, Observer, Options, Outcome, Plan, Problem, ProblemError, solve};

/// What a move against a lane is charged: where streets are narrow, agents that meet push
/// each other far.
const LANE_CHARGE: u16 = 4;

/// Tables of goals that nobody has any longer are kept up to so many bytes, and up to half
/// of what the planner may use.
const TABLE_BYTES: u64 = 512 << 20;
/// The same for tables of the ways along lanes. A fleet that needs more than half of that at a
/// time does without lanes: to make them takes longer than a call.
const LANE_BYTES: u64 = 128 << 20;

/// How often `lacam` tries another way on under a window: as often every time, so that its
/// plans do not depend on the speed of the machine.
const RETRIES: u32 = 8;

/// What both planners keep between calls: the map, and the ways to goals.
#[derive(Default)]
struct Prepared {
    rows: u32,
    cols: u32,
    passable: Vec<bool>,
    lifelong: Option<Lifelong>,
    streets: Option<Streets>,
}

fn unsupported(reason: &str) -> Failure {
    Failure::new(Status::Unsupported, reason)
}

/// What is wrong with an instance, as a status.
fn refused(error: &ProblemError) -> Failure {
    let message = format!("{error}; {}", error.hint());
    Failure::new(Status::InvalidInput, message)
}

/// Whether an instance is more than one goal of its own for each agent.
fn is_lifelong(instance: &Instance) -> bool {
    let shared = || {
        let mut goals = instance.goals.cells().to_vec();
        goals.sort_unstable();
        goals.windows(2).any(|pair| pair[0] == pair[1])
    };
    instance.window_steps > 0 || instance.goals.iter().any(|goals| goals.len() != 1) || shared()
}

impl Prepared {
    fn learn(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        lane_charge: u32,
    ) -> Result<(), Failure> {
        let grid = environment
            .grid()
            .ok_or_else(|| unsupported("only grids are supported"))?;
        if grid.connectivity != 4 {
            return Err(unsupported("only 4-connected grids are supported"));
        }
        self.rows = grid.rows;
        self.cols = grid.cols;
        self.passable = grid.passable.iter().map(|free| *free != 0).collect();
        let bytes = match budget.memory_bytes {
            0 => TABLE_BYTES,
            bytes => TABLE_BYTES.min(bytes / 2),
        };
        let lifelong = Lifelong::new(self.rows, self.cols, &self.passable, bytes);
        let lifelong = lifelong.map_err(|error| refused(&error))?;
        let streets = || {
            let bytes = LANE_BYTES.min(bytes / 2);
            Streets::new(lifelong.graph(), lane_charge, bytes)
        };
        self.streets = (lane_charge > 0).then(streets);
        self.lifelong = Some(lifelong);
        Ok(())
    }

    /// Plans for instances with windows, several goals per agent, or shared goals.
    fn go_on(
        &mut self,
        options: &Options,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let lifelong = self.lifelong.as_mut();
        let lifelong = lifelong.ok_or_else(|| unsupported("there is no map to plan on"))?;
        let (samples, retries) = match options.algorithm {
            Algorithm::Pibt => (1, 0),
            Algorithm::LacamStar if options.anytime => (options.samples, RETRIES),
            Algorithm::LacamStar => (options.samples, 0),
        };
        let query = Query {
            starts: &instance.starts,
            goals: &instance.goals,
            headings: instance.headings.as_deref(),
            window: (instance.window_steps > 0).then_some(instance.window_steps),
            step_limit: options.step_limit,
            swap: options.swap,
            rings: instance.allows_cycles,
            memory_limit: budget.memory_bytes,
            samples,
            retries,
            seed: budget.seed,
        };
        let mut submitter = Submitter::new(budget, sink);
        let stop = &mut || submitter.stop();
        let streets = self.streets.as_mut().filter(|_| query.window.is_some());
        let ranking = streets.and_then(|streets| streets.ranking(&instance.goals, stop));
        let (plan, end) = match ranking {
            Some(mut by_lane) => lifelong.run(&query, &mut by_lane, stop),
            None => lifelong.run(&query, &mut ByDistance, stop),
        }
        .map_err(|error| refused(&error))?;
        // Under a window a plan may be shorter than asked for: everybody stays then.
        if end == End::Done || (query.window.is_some() && end == End::Stopped) {
            submitter.incumbent(&plan, plan.sum_of_costs());
        }
        match end {
            End::Done => Ok(()),
            End::Stopped => Err(Failure::new(
                Status::TimedOut,
                "the budget ended before the plan was complete",
            )),
            End::Steps => Err(Failure::new(
                Status::GaveUp,
                "not everybody arrived within the step limit; the planner is not complete",
            )),
            End::Memory => Err(Failure::new(
                Status::GaveUp,
                "the ways to the goals would take more memory than the budget has",
            )),
        }
    }

    fn plan(
        &mut self,
        options: &Options,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        if instance.motion != Motion::Pebble {
            return Err(unsupported("only the pebble motion model is supported"));
        }
        if is_lifelong(instance) {
            return self.go_on(options, instance, budget, sink);
        }
        let problem = Problem {
            rows: self.rows,
            cols: self.cols,
            passable: self.passable.clone(),
            starts: instance.starts.clone(),
            goals: instance.goals.cells().to_vec(),
        };
        let options = Options {
            rings: instance.allows_cycles,
            threads: budget.threads as usize,
            node_limit: (budget.nodes > 0).then_some(budget.nodes),
            memory_limit: match budget.memory_bytes {
                0 => options.memory_limit,
                bytes => bytes,
            },
            ..options.clone()
        };
        let mut observer = Submitter::new(budget, sink);
        match solve(&problem, &options, budget.seed, &mut observer) {
            Ok(Outcome::Solved { .. }) => Ok(()),
            Ok(Outcome::Infeasible) => Err(Failure::new(
                Status::Infeasible,
                "the search space is exhausted",
            )),
            Ok(Outcome::GaveUp(Limit::Stopped)) => Err(Failure::new(
                Status::TimedOut,
                "the budget ended before a plan was found",
            )),
            Ok(Outcome::GaveUp(Limit::Nodes)) => {
                Err(Failure::new(Status::GaveUp, "the node limit was reached"))
            }
            Ok(Outcome::GaveUp(Limit::Memory)) => Err(Failure::new(
                Status::GaveUp,
                "the search reached its memory limit before a plan was found",
            )),
            Ok(Outcome::GaveUp(Limit::Steps)) => Err(Failure::new(
                Status::GaveUp,
                "not everybody arrived within the step limit; the planner is not complete",
            )),
            Err(error) => Err(refused(&error)),
        }
    }
}

/// Hands incumbents to the host, and stops a little before the deadline so that
/// the last word is said in time.
struct Submitter<'a> {
    sink: &'a dyn Sink,
    stop_ns: u64,
    offsets: Vec<u64>,
}

impl<'a> Submitter<'a> {
    fn new(budget: &Budget, sink: &'a dyn Sink) -> Self {
        Self {
            sink,
            stop_ns: budget.answer_by_ns(),
            offsets: Vec::new(),
        }
    }
}

impl Observer for Submitter<'_> {
    fn incumbent(&mut self, plan: &Plan, _: u64) {
        self.offsets.clear();
        self.offsets
            .extend(plan.offsets().iter().map(|offset| *offset as u64));
        if let Some(plan) = PlanRef::new(&self.offsets, plan.cells()) {
            // A plan that comes too late is no fault; `stop` ends the search.
            let _ = self.sink.submit_plan(plan);
        }
    }

    fn stop(&mut self) -> bool {
        monotonic_ns() >= self.stop_ns || self.sink.cancelled()
    }

    fn metric(&mut self, name: &str, value: f64) {
        self.sink.metric(name, value);
    }
}

fn descriptor(id: &str, name: &str, description: &str, extra: &[Capability]) -> Descriptor {
    let common = [
        Capability::Grid,
        Capability::Pebble,
        Capability::Deterministic,
    ];
    plugin::descriptor(id, name, description, &common, extra)
}

/// Options of `lacam`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LacamOptions {
    /// Let two agents change places at the end of a corridor.
    swap: bool,
    /// PIBT runs per successor; the best is taken.
    #[schemars(range(min = 1, max = 1000))]
    samples: u32,
    /// How many steps longer than its shortest path a guide path may be; `null`
    /// for no guidance.
    scatter_margin: Option<u32>,
    /// Go on improving after the first plan, until the budget ends.
    anytime: bool,
}

impl Default for LacamOptions {
    fn default() -> Self {
        let Options {
            swap,
            samples,
            scatter_margin,
            anytime,
            ..
        } = Options::default();
        Self {
            swap,
            samples,
            scatter_margin,
            anytime,
        }
    }
}

impl Variety for LacamOptions {
    fn descriptor() -> Descriptor {
        Descriptor {
            options_schema: options_schema::<Self>(),
            ..descriptor(
                "lacam",
                "LaCAM*",
                "Complete, anytime planner for grids: lazy constraints addition search with PIBT \
                 as configuration generator (Okumura, IJCAI 2023 and AAMAS 2024), then \
                 large-neighbourhood refinement until the budget ends. With a window, several or \
                 shared goals it plans for fleets that work without end, and is not complete.",
                &[
                    Capability::Anytime,
                    Capability::Threads,
                    Capability::Windowed,
                    Capability::DuplicateGoals,
                ],
            )
        }
    }

    fn options(self) -> Options {
        let Self {
            swap,
            samples,
            scatter_margin,
            anytime,
        } = self;
        let algorithm = Algorithm::LacamStar;
        let defaults = Options::default();
        Options {
            algorithm,
            swap,
            samples,
            scatter_margin,
            anytime,
            ..defaults
        }
    }
}

/// Options of `pibt`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct PibtOptions {
    /// Let two agents change places at the end of a corridor.
    swap: bool,
    /// Give up when not everybody has arrived after so many steps.
    #[schemars(range(min = 1))]
    step_limit: u64,
    /// What a move against the lanes of the map is charged in steps, in windows: its streets
    /// lead east and west in turn, and south and north.
    #[schemars(range(max = 100))]
    lane_charge: u16,
}

impl Default for PibtOptions {
    fn default() -> Self {
        let Options {
            swap, step_limit, ..
        } = Options::default();
        Self {
            swap,
            step_limit,
            lane_charge: LANE_CHARGE,
        }
    }
}

impl Variety for PibtOptions {
    fn descriptor() -> Descriptor {
        Descriptor {
            options_schema: options_schema::<Self>(),
            ..descriptor(
                "pibt",
                "PIBT",
                "Priority inheritance with backtracking (Okumura, Machida, Défago, Tamura, AIJ \
                 2022): one step at a time, very fast, not complete on every map. With a \
                 window, several or shared goals it plans for fleets that work without end.",
                &[Capability::Windowed, Capability::DuplicateGoals],
            )
        }
    }

    fn options(self) -> Options {
        let Self {
            swap, step_limit, ..
        } = self;
        Options {
            algorithm: Algorithm::Pibt,
            swap,
            step_limit,
            ..Options::default()
        }
    }

    fn lane_charge(&self) -> u32 {
        self.lane_charge.into()
    }
}

/// LaCAM*: complete, anytime.
pub type Lacam = GridPlanner<LacamOptions>;

/// PIBT: fastest, not complete.
pub type Pibt = GridPlanner<PibtOptions>;

/// A planner of this crate as a plugin: the options that a user may give decide
/// which.
pub trait Variety: DeserializeOwned + Send + 'static {
    /// What the plugin is and can do.
    fn descriptor() -> Descriptor;
    /// The options of the library that the user's stand for.
    fn options(self) -> Options;
    /// What a move against a lane is charged in windows, in steps.
    fn lane_charge(&self) -> u32 {
        0
    }
}

/// A planner that was made with options of type `V`.
pub struct GridPlanner<V> {
    options: Options,
    lane_charge: u32,
    prepared: Prepared,
    variety: PhantomData<V>,
}

impl<V: Variety> Plugin for GridPlanner<V> {
    fn descriptor() -> Descriptor {
        V::descriptor()
    }

    fn create(given: Given<'_>) -> Result<Self, Failure> {
        let variety = given.parse::<V>()?;
        Ok(Self {
            lane_charge: variety.lane_charge(),
            options: variety.options(),
            prepared: Prepared::default(),
            variety: PhantomData,
        })
    }
}

impl<V: Variety> Planner for GridPlanner<V> {
    fn prepare(
        &mut self,
        environment: &SharedEnvironment,
        budget: &Budget,
        _: &dyn Sink,
    ) -> Result<(), Failure> {
        self.prepared.learn(environment, budget, self.lane_charge)
    }

    fn plan(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        self.prepared.plan(&self.options, instance, budget, sink)
    }
}
