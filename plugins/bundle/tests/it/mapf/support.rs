//! Cases as the planner sees them, and an observer; for tests, example and benchmark.
#![allow(dead_code, reason = "each user takes what it needs")]

use fleetyard_abi::GridPlan;
use fleetyard_plugin_mapf::{Observer, Options, Outcome, Problem, ProblemError};
use fleetyard_plugin_spacetime::graph::Graph;
use fleetyard_testkit::Case;

/// Never stops; remembers the sums of costs it is told.
#[derive(Debug, Default)]
pub(crate) struct Patient {
    pub(crate) sums: Vec<u64>,
    pub(crate) plans: Vec<GridPlan>,
    pub(crate) metrics: Vec<(String, f64)>,
}

impl Observer for Patient {
    fn incumbent(&mut self, plan: &GridPlan, sum_of_costs: u64) {
        self.sums.push(sum_of_costs);
        self.plans.push(plan.clone());
    }
    fn stop(&mut self) -> bool {
        false
    }
    fn metric(&mut self, name: &str, value: f64) {
        self.metrics.push((name.to_owned(), value));
    }
}

pub(crate) fn graph(case: &Case) -> Graph {
    let map = &case.map;
    let passable: Vec<bool> = map.passable.iter().map(|free| *free != 0).collect();
    Graph::new(map.rows as usize, map.cols as usize, &passable)
}

pub(crate) fn solve(
    case: &Case,
    options: &Options,
    seed: u64,
    observer: &mut dyn Observer,
) -> Result<Outcome, ProblemError> {
    let problem = Problem {
        graph: &graph(case),
        starts: &case.instance.starts,
        goals: case.instance.goals.items(),
    };
    fleetyard_plugin_mapf::solve(&problem, options, seed, observer)
}

/// Says what is wrong with a plan, if anything is.
pub(crate) fn verify(case: &Case, plan: &GridPlan) -> Result<(), String> {
    case.judge(&plan.paths().collect::<Vec<_>>(), 0)
}
