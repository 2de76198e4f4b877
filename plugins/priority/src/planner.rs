//! The part that both planners share: the path of one agent among those of others.
//!
//! An agent of higher priority leaves the others time to turn and to get away from their starts:
//! otherwise two robots that face each other in a corridor have no plan in either order.

use fleetyard_plugin_spacetime::graph::DIRECTIONS;
use fleetyard_plugin_spacetime::plan::Paths;
use fleetyard_plugin_spacetime::problem::{Problem, Route};
use fleetyard_plugin_spacetime::random::Random;
use fleetyard_plugin_spacetime::reservation::{NEVER, Reservations};
use fleetyard_plugin_spacetime::sipp::{Found, Miss, Query, Sipp};

/// Limits of a run.
pub struct Control<'a> {
    /// True once the budget is spent; asked often.
    pub stop: &'a mut dyn FnMut() -> bool,
    /// At most so many states are expanded in searches for paths; 0 for no limit.
    pub nodes: u64,
    /// About how many bytes the search may hold besides the problem.
    pub memory: u64,
}

/// Result of a run.
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
    /// Charge of a turn by 90°, in steps.
    turn_charge: u32,
    random: Random,
    /// Per agent [`earliest`].
    earliest: Vec<[u32; DIRECTIONS]>,
    /// The agents that others have to wait for there.
    slow: Vec<usize>,
}

/// Nobody has to wait longer for an agent that cannot leave its start.
const MOST_STAY: u32 = 1 << 10;

/// Earliest times at which others can come to the start of an agent, by the direction that they
/// come from, whatever path the agent takes. An agent of higher priority must not count on more, or
/// the agent has no path at all.
fn earliest(problem: &Problem, agent: usize) -> [u32; DIRECTIONS] {
    let Route { start, heading, .. } = problem.routes[agent];
    let (around, sources) = (problem.graph.around(start), problem.graph.sources(start));
    let open = |d: &usize| around[*d] != problem.graph.wall();
    let comes = |d: usize| sources[d] != problem.graph.wall();
    let turns = |d: usize| match (problem.turning, (d + 4 - usize::from(heading)) % 4) {
        (false, _) | (true, 0) => 0,
        (true, 2) => 2,
        (true, _) => 1,
    };
    std::array::from_fn(|d| {
        if !comes(d) {
            return 0;
        }
        // Either the agent goes where the other one does not come from, or it goes there,
        // and on, before the other one is there.
        let others = (0..DIRECTIONS).filter(|e| *e != d).filter(open);
        let elsewhere = others.map(|e| turns(e) + 1).min();
        let on = if open(&d) { turns(d) + 3 } else { u32::MAX };
        elsewhere.unwrap_or(u32::MAX).min(on).min(MOST_STAY)
    })
}

impl<'p> Single<'p> {
    /// `turn_charge` is for turns that take no steps, where it is known how agents look.
    pub(crate) fn new(problem: &'p Problem, turn_charge: u32, nodes: u64, random: Random) -> Self {
        let table = if problem.window > 0 {
            Reservations::windowed(&problem.graph, problem.window)
        } else {
            let longest = problem.routes.iter().map(Route::length);
            Reservations::new(&problem.graph, longest.max().unwrap_or(0) as usize + 1)
        };
        let earliest: Vec<_> = (0..problem.agents())
            .map(|agent| earliest(problem, agent))
            .collect();
        // In the first step nobody comes anywhere.
        let slow = |agent: &usize| earliest[*agent].iter().any(|&step| step > 1);
        Self {
            slow: (0..problem.agents()).filter(slow).collect(),
            problem,
            sipp: Sipp::limited(nodes),
            turn_charge: if problem.faces { turn_charge } else { 0 },
            soft: table.clone(),
            hard: table,
            random,
            earliest,
        }
    }

    /// [`Single::hold`] for all agents but one, where others have to wait at all.
    pub(crate) fn hold_others(&mut self, agent: usize) {
        for at in 0..self.slow.len() {
            if self.slow[at] != agent {
                self.hold(self.slow[at], 0);
            }
        }
    }

    /// Enters into the table of those not to be met that an agent without path is at its
    /// start at first, and that it must be left alone for `delay` steps.
    pub(crate) fn hold(&mut self, agent: usize, delay: u32) {
        let start = self.problem.routes[agent].start;
        let earliest = self.earliest[agent].map(|step| match step {
            0 => 0,
            step => step + delay,
        });
        self.hard.hold(start, earliest);
    }

    /// Takes what [`Single::hold`] has entered out again; gives the time from which on the
    /// table is as it was, at that vertex.
    pub(crate) fn release(&mut self, agent: usize, delay: u32) -> u32 {
        let last = self.earliest[agent].into_iter().max().unwrap_or(0) + delay;
        self.hard.release(self.problem.routes[agent].start, last);
        last
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
            lanes,
            ..
        } = self.problem;
        let route = &routes[agent];
        let query = Query {
            graph,
            hard: &self.hard,
            soft: soft.then_some(&self.soft),
            route,
            start: route.start,
            heading: route.heading,
            turn_charge: self.turn_charge,
            lanes: lanes.as_deref(),
            turning: *turning,
            window: *window,
            cycles: *cycles,
            bound: NEVER,
        };
        self.sipp.plan(&query, &mut self.random, stop)
    }
}
