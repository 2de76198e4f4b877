//! The planners behind the plugin contract: ids `lacam`, `pibt`, `epibt` and `wppl`.

mod wppl;

use std::sync::Arc;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{
    Budget, Capability, GridEnvironment, GridPlan, Guidance, Instance, Motion, Status, c,
    monotonic_ns,
};
use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Graph};
use fleetyard_plugin_spacetime::lanes::Lanes;
use fleetyard_plugin_spacetime::plugin::{Call, Method, Team, half_of_memory};
use fleetyard_plugin_spacetime::problem::{ProblemError, graph_of};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::epibt::run as epibt;
use crate::lifelong::{ByDistance, End, Lifelong, Query};
use crate::streets::{ByStreet, Journeys, Streets, Survey, Turning};
use crate::watch::Watch;
use crate::{Algorithm, Limit, Observer, Options, Outcome, Problem, solve};

/// Figure: agents that are held back.
const HELD_BACK: &str = "held_back";

/// Charge of a move against a lane, in steps: where streets are narrow, agents that meet push each
/// other far.
const LANE_CHARGE: u16 = 4;

/// Tables of goals that nobody has any longer are kept up to so many bytes, and up to half
/// of what the planner may use.
const TABLE_BYTES: u64 = 512 << 20;

/// Retries of `lacam` under a window: always as many, so that its plans do not depend on the speed
/// of the machine.
const RETRIES: u32 = 8;

/// Tries of `epibt` in each step, for each agent.
const TRIES: u32 = 5;
/// Steps of `epibt` and `wppl` without a window.
const MOVING_STEPS: u64 = 10_000;

pub use self::wppl::WpplOptions;

/// LaCAM*: complete, anytime.
pub type Lacam = Team<LacamOptions>;

/// PIBT: fastest, not complete.
pub type Pibt = Team<PibtOptions>;

/// EPIBT: a few steps at a time, for robots that turn as well.
pub type Epibt = Team<EpibtOptions>;

/// WPPL: windows of paths that a search makes better, for robots that turn as well.
pub type Wppl = Team<WpplOptions>;

/// Options of `lacam`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct LacamOptions {
    /// Let two agents change places at the end of a corridor.
    swap: bool,
    /// PIBT runs per successor; the best is taken.
    #[schemars(range(min = 1, max = 1000))]
    samples: u32,
    /// Most steps by which a guide path may be longer than its shortest path; `null` for no
    /// guidance.
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

impl Method for LacamOptions {
    const ID: &'static str = "lacam";
    const NAME: &'static str = "LaCAM*";
    const ABOUT: &'static str = "Complete, anytime planner for grids: lazy constraints addition \
         search with PIBT as configuration generator (Okumura, IJCAI 2023 and AAMAS 2024), then \
         large-neighbourhood refinement until the budget ends. With a window, several or shared \
         goals it plans for fleets that work without end, and is not complete.";
    const CAPABILITIES: &'static [Capability] = &[
        Capability::Pebble,
        Capability::Anytime,
        Capability::Threads,
        Capability::MoveMask,
        Capability::Windowed,
        Capability::DuplicateGoals,
    ];
    type Map = Roads;

    fn learn(&self, grid: &GridEnvironment, budget: &Budget) -> Result<Roads, Failure> {
        Roads::learn(grid, budget, 0)
    }

    fn solve(
        &self,
        roads: &mut Roads,
        instance: &Instance,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        let options = Options {
            algorithm: Algorithm::LacamStar,
            swap: self.swap,
            samples: self.samples,
            scatter_margin: self.scatter_margin,
            anytime: self.anytime,
            ..Options::default()
        };
        roads.plan(&options, instance, call)
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
    /// Charge of a move against the lanes of the map, in steps, in windows: its streets lead east
    /// and west in turn, and south and north.
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

impl Method for PibtOptions {
    const ID: &'static str = "pibt";
    const NAME: &'static str = "PIBT";
    const ABOUT: &'static str = "Priority inheritance with backtracking (Okumura, Machida, Défago, \
         Tamura, AIJ 2022): one step at a time, very fast, not complete on every map. With a \
         window, several or shared goals it plans for fleets that work without end.";
    const CAPABILITIES: &'static [Capability] = &[
        Capability::Pebble,
        Capability::MoveMask,
        Capability::Windowed,
        Capability::DuplicateGoals,
    ];
    const PARTS: &'static [&'static str] = &[c::TRAFFIC_ID, c::GOAL_TASKS_ID, c::GUIDANCE_ID];
    type Map = Roads;

    fn learn(&self, grid: &GridEnvironment, budget: &Budget) -> Result<Roads, Failure> {
        Roads::learn(grid, budget, self.lane_charge.into())
    }

    fn solve(
        &self,
        roads: &mut Roads,
        instance: &Instance,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        let options = Options {
            algorithm: Algorithm::Pibt,
            swap: self.swap,
            step_limit: self.step_limit,
            ..Options::default()
        };
        roads.plan(&options, instance, call)
    }
}

/// Options of `epibt`.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct EpibtOptions {
    /// Actions of an operation, which is planned at a time; `null` for 3, and 4 where robots turn.
    #[schemars(range(min = 3, max = 5))]
    horizon: Option<u8>,
    /// Tries in each step, for each agent, to make it better by large neighbourhood search; 0 for
    /// none, `null` for as many as the budget has time for.
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

impl Default for EpibtOptions {
    fn default() -> Self {
        Self {
            horizon: None,
            tries: Some(TRIES),
            step_limit: MOVING_STEPS,
            lane_charge: None,
        }
    }
}

impl Method for EpibtOptions {
    const ID: &'static str = "epibt";
    const NAME: &'static str = "EPIBT";
    const ABOUT: &'static str = "Priority inheritance with backtracking over operations of several \
         actions, and large neighbourhood search (Yukhnevich, Andreychuk, arXiv 2511.09193): for \
         fleets that work without end, of robots that turn as well.";
    const CAPABILITIES: &'static [Capability] = &[
        Capability::Pebble,
        Capability::Rotation,
        Capability::Threads,
        Capability::MoveMask,
        Capability::Windowed,
        Capability::DuplicateGoals,
        Capability::Idle,
    ];
    const PARTS: &'static [&'static str] = &[c::REST_OF_PLAN_ID, c::GUIDANCE_ID];
    type Map = Block;

    fn check(&self) -> Result<(), String> {
        let (least, most) = epibt::horizons();
        match self.horizon {
            Some(horizon) if !(least..=most).contains(&usize::from(horizon)) => Err(format!(
                "a `horizon` of {horizon} actions; hint: give {least} to {most}, or `null`"
            )),
            _ => Ok(()),
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
        let query = epibt::Query {
            step_limit: self.step_limit,
            horizon: self.horizon.map_or(3 + usize::from(turning), usize::from),
            tries: self.tries,
            ..first_query(instance, turning, rest.as_ref(), call)
        };
        let mut clock = Clock::new(call);
        let (graph, streets) = block.streets(instance, &mut clock);
        let mut by_street = clock.ranking(streets, journeys);
        let (plan, end) = epibt::run(graph, &mut by_street, &query, &mut clock)?;
        answer(&plan, end, instance, call)
    }
}

/// True for robots that take a step to turn, false for pebbles.
fn turns(instance: &Instance) -> Result<bool, ProblemError> {
    match instance.motion {
        Motion::Pebble => Ok(false),
        Motion::Rotation => Ok(true),
        _ => {
            let what = "motion other than pebbles' and with turns is";
            Err(ProblemError::Unsupported { what })
        }
    }
}

/// The query of an instance to EPIBT, without tries.
fn first_query<'a>(
    instance: &'a Instance,
    turning: bool,
    rest: Option<&'a GridPlan>,
    call: &Call<'_>,
) -> epibt::Query<'a> {
    epibt::Query {
        starts: &instance.starts,
        goals: &instance.goals,
        visited: &[],
        headings: instance.headings.as_deref(),
        turning,
        window: (instance.window_steps > 0).then_some(instance.window_steps),
        step_limit: MOVING_STEPS,
        horizon: 3 + usize::from(turning),
        tries: Some(0),
        rings: instance.allows_cycles,
        rest,
        seed: call.budget.seed,
        threads: call.budget.threads as usize,
    }
}

/// Hands over a plan, and says how it ended.
fn answer(
    plan: &GridPlan,
    end: epibt::End,
    instance: &Instance,
    call: &Call<'_>,
) -> Result<(), Failure> {
    if end == epibt::End::Done || instance.window_steps > 0 {
        call.submit(plan);
    }
    let failure = |status, reason: &str| Err(Failure::new(status, reason));
    match end {
        epibt::End::Done => Ok(()),
        epibt::End::Stopped => failure(
            Status::TimedOut,
            "the budget ended before everybody had chosen",
        ),
        epibt::End::Steps => failure(
            Status::GaveUp,
            "not everybody arrived within the step limit; the planner is not complete",
        ),
    }
}

/// Data that `epibt` and `wppl` keep between calls.
pub struct Block {
    graph: Arc<Graph>,
    /// With lanes, for fleets; and without, once they are asked for.
    streets: Survey,
    plain: Option<Streets>,
    /// Bytes of tables.
    bytes: u64,
    /// Rows and columns.
    size: [u32; 2],
    step_s: f64,
}

impl Block {
    fn learn(
        grid: &GridEnvironment,
        budget: &Budget,
        lane_charge: Option<u16>,
    ) -> Result<Self, Failure> {
        let graph = Arc::new(graph_of(grid)?);
        let bytes = half_of_memory(budget);
        let usual = || {
            if Lanes::are_worth(&graph) {
                LANE_CHARGE
            } else {
                0
            }
        };
        let lane_charge = lane_charge.unwrap_or_else(usual);
        Ok(Self {
            streets: Survey::new(&graph, lane_charge.into(), grid.step_s, bytes),
            plain: None,
            bytes,
            graph,
            size: [grid.rows, grid.cols],
            step_s: grid.step_s,
        })
    }

    /// The map, and its streets for an instance: without lanes where it ends, and as long as half of a
    /// call's time does not suffice to learn them.
    fn streets(
        &mut self,
        instance: &Instance,
        clock: &mut Clock<'_>,
    ) -> (&Arc<Graph>, &mut Streets) {
        clock.begin(2);
        let lanes = instance.window_steps > 0;
        let streets = lanes.then(|| self.streets.streets(&mut || clock.pause()));
        let streets = if let Some(streets) = streets.flatten() {
            self.plain = None;
            streets
        } else {
            let survey = || Survey::new(&self.graph, 0, self.step_s, self.bytes);
            self.plain.get_or_insert_with(|| survey().finish())
        };
        (&self.graph, streets)
    }

    fn journeys<'a>(
        &self,
        instance: &'a Instance,
        turning: bool,
        call: &Call<'_>,
    ) -> Result<Journeys<'a>, ProblemError> {
        let mut turn = Turning::of(instance);
        if turning {
            turn.quarter_s = turn.quarter_s.max(self.step_s);
        }
        Ok(Journeys {
            starts: &instance.starts,
            goals: &instance.goals,
            headings: instance.headings.as_deref(),
            turning: turn,
            // Several steps ahead crowds are seen for themselves.
            traffic: None,
            tasks: None,
            threads: call.budget.threads as usize,
            until_ns: search_until_ns(call),
            guidance: guidance_of(instance, &self.graph)?,
        })
    }

    /// The rest of the last plan, if there is one on this map.
    fn rest(&self, instance: &Instance) -> Option<GridPlan> {
        let [rows, cols] = self.size;
        let rest = instance.rest_of_plan()?;
        rest.plan(&instance.starts, rows, cols).ok()
    }
}

/// The time of a call, shared out among its steps.
struct Clock<'a> {
    call: &'a Call<'a>,
    begun_ns: u64,
    until_ns: u64,
    /// Of the last step the time until it was ready.
    made_ready_ns: u64,
}

impl<'a> Clock<'a> {
    fn new(call: &'a Call<'a>) -> Self {
        Self {
            call,
            begun_ns: monotonic_ns(),
            until_ns: 0,
            made_ready_ns: 0,
        }
    }

    /// Makes ready for a fleet. Half of the time is for tables, so that the first call of many agents
    /// has a plan as well; what was made is kept to the next call.
    fn ranking<'s>(&mut self, streets: &'s mut Streets, journeys: Journeys<'s>) -> ByStreet<'s> {
        self.begin(2);
        streets.ranking(journeys, &mut || self.pause())
    }
}

impl Watch for Clock<'_> {
    fn stop(&mut self) -> bool {
        self.call.stop()
    }

    fn begin(&mut self, left: u32) -> bool {
        self.begun_ns = monotonic_ns();
        self.until_ns = self.call.share_ends_ns(left.max(1));
        self.call.share_ends_ns(1) > self.begun_ns + self.made_ready_ns
    }

    fn ready(&mut self) {
        self.made_ready_ns = monotonic_ns() - self.begun_ns;
    }

    fn pause(&mut self) -> bool {
        monotonic_ns() >= self.until_ns || self.call.stop()
    }
}

/// The instant after which nobody looks for ways any more: the last quarter of a call is for steps along
/// those that are known.
fn search_until_ns(call: &Call<'_>) -> u64 {
    let now_ns = monotonic_ns();
    let answer_by_ns = call.share_ends_ns(1);
    answer_by_ns - (answer_by_ns - now_ns) / 4
}

/// True if an instance is more than one goal of its own for each agent.
fn is_lifelong(instance: &Instance) -> bool {
    let needs = instance.needs();
    needs.has(Capability::Windowed) || needs.has(Capability::DuplicateGoals)
}

/// The guidance graph of an instance, if there is one and it is of the map.
fn guidance_of<'a>(
    instance: &'a Instance,
    graph: &Graph,
) -> Result<Option<&'a Guidance>, ProblemError> {
    let guidance = instance.guidance();
    if let Some(guidance) = guidance {
        let cells = graph.cell_count();
        let fits = guidance.check_size(DIRECTIONS * cells, cells);
        fits.map_err(|reason| ProblemError::Malformed { reason })?;
    }
    Ok(guidance)
}

/// Data that both planners keep between calls: the map, and the distances to goals.
pub struct Roads {
    lifelong: Lifelong,
    lane_charge: u32,
    /// Learnt when there are windows, and lanes or guidance.
    streets: Survey,
}

impl Roads {
    fn learn(grid: &GridEnvironment, budget: &Budget, lane_charge: u32) -> Result<Self, Failure> {
        let graph = Arc::new(graph_of(grid)?);
        let bytes = half_of_memory(budget);
        Ok(Self {
            streets: Survey::new(&graph, lane_charge, grid.step_s, bytes / 2).with_signals(),
            lifelong: Lifelong::new(graph, TABLE_BYTES.min(bytes)),
            lane_charge,
        })
    }

    fn plan(
        &mut self,
        options: &Options,
        instance: &Instance,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        if is_lifelong(instance) {
            return self.go_on(options, instance, call);
        }
        let problem = Problem {
            graph: self.lifelong.graph(),
            starts: &instance.starts,
            goals: instance.goals.items(),
        };
        let options = Options {
            rings: instance.allows_cycles,
            threads: call.budget.threads as usize,
            node_limit: call.node_limit(),
            memory_limit: match call.budget.memory_bytes {
                0 => options.memory_limit,
                bytes => bytes,
            },
            ..options.clone()
        };
        let failure = |status, reason: &str| Err(Failure::new(status, reason));
        match solve(&problem, &options, call.budget.seed, &mut Submitter(call))? {
            Outcome::Solved { .. } => Ok(()),
            Outcome::Infeasible => failure(Status::Infeasible, "the search space is exhausted"),
            Outcome::GaveUp(Limit::Stopped) => {
                failure(Status::TimedOut, "the budget ended before a plan was found")
            }
            Outcome::GaveUp(Limit::Nodes) => failure(Status::GaveUp, "the node limit was reached"),
            Outcome::GaveUp(Limit::Memory) => failure(
                Status::GaveUp,
                "the search reached its memory limit before a plan was found",
            ),
            Outcome::GaveUp(Limit::Steps) => failure(
                Status::GaveUp,
                "not everybody arrived within the step limit; the planner is not complete",
            ),
        }
    }

    /// Plans for instances with windows, several goals per agent, or shared goals.
    fn go_on(
        &mut self,
        options: &Options,
        instance: &Instance,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
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
            memory_limit: call.budget.memory_bytes,
            samples,
            retries,
            seed: call.budget.seed,
        };
        let guidance = guidance_of(instance, self.lifelong.graph())?;
        // A call without lanes goes by distances alone, whatever calls before it had.
        let by_street = query.window.is_some() && (self.lane_charge > 0 || guidance.is_some());
        // Half of the time is for streets, so that a fleet that learns them has a plan as well; what was made
        // is kept to the next call.
        let clock = &mut Clock::new(call);
        clock.begin(2);
        let pause = &mut || clock.pause();
        let streets = by_street.then(|| self.streets.streets(pause));
        let ranking = streets.flatten().map(|streets| {
            let journeys = Journeys {
                starts: &instance.starts,
                goals: &instance.goals,
                headings: instance.headings.as_deref(),
                turning: Turning::of(instance),
                traffic: instance.traffic(),
                tasks: instance.goal_tasks(),
                threads: 1,
                until_ns: search_until_ns(call),
                guidance,
            };
            streets.ranking(journeys, pause)
        });
        let (plan, end) = match ranking {
            Some(mut by_street) => {
                if by_street.held() > 0 {
                    call.metric(HELD_BACK, by_street.held() as f64);
                }
                self.lifelong.run(&query, &mut by_street, clock)
            }
            None => self.lifelong.run(&query, &mut ByDistance, clock),
        }?;
        // Under a window a plan may be shorter than asked for: everybody stays then.
        if end == End::Done || (query.window.is_some() && end == End::Stopped) {
            call.submit(&plan);
        }
        let failure = |status, reason: &str| Err(Failure::new(status, reason));
        match end {
            End::Done => Ok(()),
            End::Stopped => failure(
                Status::TimedOut,
                "the budget ended before the plan was complete",
            ),
            End::Steps => failure(
                Status::GaveUp,
                "not everybody arrived within the step limit; the planner is not complete",
            ),
            End::Memory => failure(
                Status::GaveUp,
                "the ways to the goals would take more memory than the budget has",
            ),
        }
    }
}

/// Hands incumbents to the host.
struct Submitter<'a>(&'a Call<'a>);

impl Observer for Submitter<'_> {
    fn incumbent(&mut self, plan: &GridPlan, _: u64) {
        self.0.submit(plan);
    }

    fn stop(&mut self) -> bool {
        self.0.stop()
    }

    fn metric(&mut self, name: &str, value: f64) {
        self.0.metric(name, value);
    }
}
