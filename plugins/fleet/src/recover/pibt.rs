//! Planning anew with PIBT.
//!
//! K. Okumura, M. Machida, X. Défago, Y. Tamura, "Priority inheritance with backtracking for
//! iterative multi-agent path finding", Artificial Intelligence 310 (2022). The steps are made
//! by the planner of that name; here is what a fail policy has besides.

use std::sync::Arc;

use fleetyard_abi::sdk::{FailPolicy, Failure, Options, Plugin, Sink};
use fleetyard_abi::{Budget, Capability, Descriptor, Goals, Instance, Kind, PlanRef};
use fleetyard_plugin_mapf::lifelong::{ByDistance, Lifelong, Query, Ranking};
use fleetyard_plugin_spacetime::graph::Vertex;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Question, convoy, stop};
use crate::ground::Ground;
use crate::{described, invalid, unprepared};

/// Tables of ways to goals that are kept from call to call.
const TABLE_BYTES: u64 = 256 << 20;

/// Options of `pibt` and `guided-pibt`.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub(super) struct SteppingOptions {
    /// Steps to plan; `null` for those of the window, or 100 where there is no window.
    #[schemars(range(min = 1, max = 100_000))]
    steps: Option<u32>,
    /// Let two agents change places at the end of a corridor.
    swap: bool,
}

impl Default for SteppingOptions {
    fn default() -> Self {
        Self {
            steps: None,
            swap: true,
        }
    }
}

/// What both policies that plan step by step keep and do.
#[derive(Debug)]
pub(super) struct Stepping {
    options: SteppingOptions,
    map: Option<(Arc<Ground>, Lifelong)>,
}

impl Stepping {
    pub(super) fn new(options: Options<'_>) -> Result<Self, Failure> {
        let options: SteppingOptions = options.parse()?;
        if options.steps == Some(0) {
            return Err(invalid("options: `steps` is 0, but has to be 1 or more"));
        }
        Ok(Self { options, map: None })
    }

    pub(super) fn learn(
        &mut self,
        environment: &fleetyard_abi::Environment,
    ) -> Result<(), Failure> {
        self.map = None;
        let ground = Ground::learn(environment)?;
        let planner = Lifelong::new(ground.rows, ground.cols, &ground.passable, TABLE_BYTES)
            .map_err(|error| invalid(error.to_string()))?;
        self.map = Some((Arc::new(ground), planner));
        Ok(())
    }

    /// Plans and submits. What `rank` makes says where agents had better go; it is told the
    /// map, the question, and the goals that agents can reach.
    pub(super) fn recover<R: Ranking>(
        &mut self,
        instance: &Instance,
        budget: &Budget,
        sink: &dyn Sink,
        rank: impl FnOnce(&Arc<Ground>, &Question<'_>, &Goals) -> R,
    ) -> Result<(), Failure> {
        let (ground, planner) = self.map.as_mut().ok_or_else(unprepared)?;
        let mut question = Question::new(ground, instance)?;
        let steps = self.options.steps.or(question.window).unwrap_or(100);
        let goals = reachable(&question, &instance.goals);
        let mut ranking = rank(ground, &question, &goals);
        let query = Query {
            starts: &instance.starts,
            goals: &goals,
            headings: instance.headings.as_deref(),
            window: Some(steps),
            step_limit: steps.into(),
            swap: self.options.swap,
            // In a ring nobody could turn.
            rings: question.rings && question.headings.is_none(),
            memory_limit: budget.memory_bytes,
            samples: 1,
            retries: 0,
            seed: budget.seed,
        };
        let mut stop = stop(budget, sink);
        // A plan that was stopped goes as far as it goes.
        let (plan, _) = planner
            .run(&query, &mut ranking, &mut stop)
            .map_err(|error| invalid(error.to_string()))?;
        let vertex = |cell: &u32| ground.graph.vertex(*cell);
        let mut paths: Vec<Vec<Vertex>> = plan
            .paths()
            .map(|path| path.iter().filter_map(vertex).collect())
            .collect();
        if question.headings.is_some() {
            question.window = Some(steps);
            paths = convoy::drive(&question, &paths, &mut stop);
        }
        question.submit(&paths, sink)
    }
}

/// Of each agent's goals those that it can reach, up to the first that it cannot.
fn reachable(question: &Question<'_>, goals: &Goals) -> Goals {
    let mut offsets = Vec::with_capacity(goals.len() + 1);
    let mut cells = Vec::with_capacity(goals.cells().len());
    offsets.push(0);
    for (start, goals) in question.starts.iter().zip(goals.iter()) {
        let region = question.ground.region(*start);
        let good = |cell: &&u32| {
            let goal = question.ground.graph.vertex(**cell);
            goal.is_some_and(|goal| question.ground.region(goal) == region)
        };
        cells.extend(goals.iter().take_while(good));
        offsets.push(cells.len() as u64);
    }
    // The offsets fit by construction.
    Goals::from_flat(offsets, cells).unwrap_or_else(|| Goals::single(Vec::new()))
}

pub(super) const CAPABILITIES: &[Capability] = &[
    Capability::Grid,
    Capability::Pebble,
    Capability::Rotation,
    Capability::Windowed,
    Capability::DuplicateGoals,
    Capability::Deterministic,
];

/// Plans anew with PIBT, whatever the planner has left.
#[derive(Debug)]
pub struct Pibt(Stepping);

impl Plugin for Pibt {
    fn descriptor() -> Descriptor {
        described::<SteppingOptions>(
            Kind::FailPolicy,
            ("pibt", "PIBT"),
            "Plans anew with priority inheritance with backtracking, for the window (Okumura, \
             Machida, Défago, Tamura, AIJ 2022).",
            CAPABILITIES,
        )
    }

    fn create(options: Options<'_>) -> Result<Self, Failure> {
        Stepping::new(options).map(Self)
    }
}

impl FailPolicy for Pibt {
    fn prepare(
        &mut self,
        environment: &fleetyard_abi::SharedEnvironment,
        _: &Budget,
        _: &dyn Sink,
    ) -> Result<(), Failure> {
        self.0.learn(environment)
    }

    fn recover(
        &mut self,
        instance: &Instance,
        _: Option<PlanRef<'_>>,
        budget: &Budget,
        sink: &dyn Sink,
    ) -> Result<(), Failure> {
        let by_distance = |_: &Arc<Ground>, _: &Question<'_>, _: &Goals| ByDistance;
        self.0.recover(instance, budget, sink, by_distance)
    }
}
