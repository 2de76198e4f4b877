//! Planning anew with PIBT.
//!
//! K. Okumura, M. Machida, X. Défago, Y. Tamura, "Priority inheritance with backtracking for
//! iterative multi-agent path finding", Artificial Intelligence 310 (2022). The steps are made
//! by the planner of that name; here is what a fail policy has besides.

use std::sync::Arc;

use fleetyard_abi::sdk::Failure;
use fleetyard_abi::{Environment, Goals, GridPlan, Instance};
use fleetyard_plugin_mapf::lifelong::{ByDistance, Lifelong, Query, Ranking};
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::plugin::Call;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::{Policy, Problem, Recovery, convoy};
use crate::ground::{Ground, Learn};

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

impl SteppingOptions {
    pub(super) fn faults(self) -> Result<(), String> {
        match self.steps {
            Some(0) => Err("`steps` is 0, but has to be 1 or more".into()),
            _ => Ok(()),
        }
    }

    /// Plans and submits. What `rank` makes says where agents had better go; it is told the
    /// problem, and the goals that agents can reach.
    pub(super) fn recover<'m, R: Ranking>(
        self,
        map: &'m mut SteppedMap,
        instance: &Instance,
        call: &Call<'_>,
        rank: impl FnOnce(&'m Ground, &Problem<'_>, &Goals) -> R,
    ) -> Result<(), Failure> {
        let SteppedMap { ground, planner } = map;
        let mut problem = Problem::new(ground, instance)?;
        let steps = self.steps.or(problem.window).unwrap_or(100);
        let goals = reachable(&problem, &instance.goals);
        let mut ranking = rank(ground, &problem, &goals);
        let query = Query {
            starts: &instance.starts,
            goals: &goals,
            headings: instance.headings.as_deref(),
            window: Some(steps),
            step_limit: steps.into(),
            swap: self.swap,
            // In a ring nobody could turn.
            rings: problem.rings && problem.headings.is_none(),
            memory_limit: call.budget.memory_bytes,
            samples: 1,
            retries: 0,
            seed: call.budget.seed,
        };
        let mut stop = || call.stop();
        // A plan that was stopped goes as far as it goes.
        let (plan, _) = planner.run(&query, &mut ranking, &mut stop)?;
        let vertex = |cell: &u32| ground.graph.vertex(*cell);
        let mut paths: Vec<Vec<Vertex>> = plan
            .paths()
            .map(|path| path.iter().filter_map(vertex).collect())
            .collect();
        if problem.headings.is_some() {
            problem.window = Some(steps);
            paths = convoy::drive(&problem, &paths, &mut stop);
        }
        problem.submit(&paths, call);
        Ok(())
    }
}

/// Data that both stepwise policies keep between calls.
#[derive(Debug)]
pub struct SteppedMap {
    ground: Ground,
    planner: Lifelong,
}

impl Learn for SteppedMap {
    fn learn(environment: &Environment) -> Result<Self, Failure> {
        let ground = Ground::learn(environment)?;
        let planner = Lifelong::new(Arc::clone(&ground.graph), TABLE_BYTES);
        Ok(Self { ground, planner })
    }
}

/// Of each agent's goals those that it can reach, up to the first that it cannot.
fn reachable(problem: &Problem<'_>, goals: &Goals) -> Goals {
    let agents = problem.starts.iter().zip(goals.iter());
    let reached = agents.map(|(start, goals)| {
        let good = move |cell: &u32| {
            let goal = problem.ground.graph.vertex(*cell);
            goal.is_some_and(|goal| problem.ground.leads(*start, goal))
        };
        goals.iter().copied().take_while(good)
    });
    reached.collect()
}

/// Plans anew with PIBT, whatever the planner has left.
pub type Pibt = Policy<PibtOptions>;

/// The options, for the policy that goes by distances.
#[derive(Debug, Serialize, Deserialize, JsonSchema)]
#[serde(transparent)]
pub struct PibtOptions(SteppingOptions);

impl Recovery for PibtOptions {
    const NAMES: (&'static str, &'static str) = ("pibt", "PIBT");
    const ABOUT: &'static str = "Plans anew with priority inheritance with backtracking, for the \
         window (Okumura, Machida, Défago, Tamura, AIJ 2022).";
    type Map = SteppedMap;

    fn check(&self) -> Result<(), String> {
        self.0.faults()
    }

    fn recover(
        &self,
        map: &mut SteppedMap,
        instance: &Instance,
        _: Option<&GridPlan>,
        call: &Call<'_>,
    ) -> Result<(), Failure> {
        self.0.recover(map, instance, call, |_, _, _| ByDistance)
    }
}
