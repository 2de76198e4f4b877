//! What both planners do: the path of one agent among those of others.

use fleetyard_plugin_spacetime::plan::Paths;
use fleetyard_plugin_spacetime::problem::{Problem, Route};
use fleetyard_plugin_spacetime::random::Random;
use fleetyard_plugin_spacetime::reservation::{NEVER, Reservations};
use fleetyard_plugin_spacetime::sipp::{Found, Miss, Query, Sipp};

/// When to stop.
pub struct Control<'a> {
    /// Whether the budget is spent; asked often.
    pub stop: &'a mut dyn FnMut() -> bool,
    /// At most so many states are expanded in searches for paths; 0 for no limit.
    pub nodes: u64,
    /// About how many bytes the search may hold besides the problem.
    pub memory: u64,
}

/// How a run ended.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Outcome {
    /// Paths that do not collide.
    Solved(Paths),
    /// Some collide: the best that was found until the run was stopped.
    Stopped(Paths),
    /// Some collide, and there is nothing left to try.
    Exhausted(Paths),
    /// Some collide, and to go on takes more memory than there is.
    Memory(Paths),
}

impl Outcome {
    /// The paths, colliding or not.
    pub fn paths(&self) -> &Paths {
        match self {
            Self::Solved(paths)
            | Self::Stopped(paths)
            | Self::Exhausted(paths)
            | Self::Memory(paths) => paths,
        }
    }
}

/// The search for one agent, with its tables.
pub(crate) struct Single<'p> {
    pub(crate) problem: &'p Problem,
    pub(crate) sipp: Sipp,
    /// Paths not to meet, and to meet rather not.
    pub(crate) hard: Reservations,
    pub(crate) soft: Reservations,
    random: Random,
}

impl<'p> Single<'p> {
    pub(crate) fn new(problem: &'p Problem, nodes: u64, random: Random) -> Self {
        let table = if problem.window > 0 {
            Reservations::windowed(&problem.graph, problem.window)
        } else {
            let longest = problem.routes.iter().map(Route::length);
            Reservations::new(&problem.graph, longest.max().unwrap_or(0) as usize + 1)
        };
        Self {
            problem,
            sipp: Sipp::limited(nodes),
            soft: table.clone(),
            hard: table,
            random,
        }
    }

    /// The best path of an agent by both tables, or by the one that keeps it from others.
    pub(crate) fn path(
        &mut self,
        agent: usize,
        soft: bool,
        stop: &mut dyn FnMut() -> bool,
    ) -> Result<Found, Miss> {
        let Problem {
            graph,
            routes,
            turning,
            window,
            cycles,
        } = self.problem;
        let route = &routes[agent];
        let query = Query {
            graph,
            hard: &self.hard,
            soft: soft.then_some(&self.soft),
            route,
            start: route.start,
            heading: route.heading,
            turning: *turning,
            window: *window,
            cycles: *cycles,
            bound: NEVER,
        };
        self.sipp.plan(&query, &mut self.random, stop)
    }
}
