//! Plans in continuous time: the map as a roadmap, and the order in which visits pass through cells.
//!
//! A planner of roadmaps is asked about the same robots as one of grids: free cells are vertices, moves are edges, and the
//! window is in seconds. Its plan says when robots are in the middles of cells. It is judged by the distance of centres at all
//! times of the window, and by the time that edges take. Then only the order counts in which robots pass through each cell,
//! which is that of their arrivals: it becomes a plan in steps, which the [graph](crate::adg) takes like any other.
//!
//! In continuous time a robot may be under way to a cell that another one is only about to leave, and robots may go round in a
//! ring, or wait for each other in a larger circle, although nobody touches anybody. Who keeps to an order would wait for ever.
//! So moves are taken in an order in which each begins after its robot's move before, and after the one by which the earlier
//! visitor leaves the cell; a move that has no such place is left out, with all that depend on it.

use std::collections::VecDeque;

use fleetyard_abi::{
    Environment, Heading, Instance, Motion, RoadmapEnvironment, Robot, SharedEnvironment, Visit,
    VisitPlan,
};
use fleetyard_check::{Pace, RoadmapRule, RoadmapTask, validate_roadmap};
use fleetyard_core::{Connectivity, Grid, GridPlan, InputError, RoadmapPlan};
use fleetyard_sim::SimConfig;
use fleetyard_views::{CellsView, grid_to_roadmap, visits_of};
use fleetyard_world::{Footprint, Shape};

use crate::batch::{Batch, judge};

/// Most cells of the paths of a plan in steps.
const MOST_CELLS: usize = 1 << 26;

/// Most violations of a plan that are described.
const DESCRIBED: usize = 10;

/// A share of a step by which departures may be early, for times are rounded.
const ROUNDING: f64 = 1e-6;

/// A map as a roadmap, and the rules of plans on it.
#[derive(Debug)]
pub struct Timed {
    view: CellsView,
    environment: SharedEnvironment,
    disc: Shape,
    speed_m_per_s: f64,
    step_s: f64,
    motion: Motion,
    robots: Vec<Robot>,
    robot_of: Vec<u32>,
    /// The time that plans have for a turn by 90° before a move.
    quarter_turn_s: f64,
}

/// A plan that may be executed.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Ordered {
    /// The order as steps.
    pub batch: Batch,
    /// Circles of robots that would wait for each other, before which they stop.
    pub circles: Vec<Vec<u32>>,
}

/// True for motions on roadmaps, in continuous time.
pub fn is_timed(motion: Motion) -> bool {
    matches!(motion, Motion::StopGo | Motion::Slower)
}

impl Timed {
    /// The roadmap of a map for robots of a radius, which drive a cell in a step at full speed. Refuses robots that touch when
    /// they stand in neighbouring cells, and motions without a roadmap.
    pub fn new(
        grid: &Grid,
        sim: &SimConfig,
        radius_m: f64,
        motion: Motion,
    ) -> Result<Self, InputError> {
        let wrong = |reason: String, hint: &str| Err(InputError::new("motion", reason).hint(hint));
        if !is_timed(motion) {
            let reason = format!("the motion `{motion}` is none of roadmaps");
            return wrong(reason, "ask for `stop-go` or `slower`");
        }
        if 2.0 * radius_m > sim.cell_size_m {
            let reason = format!(
                "robots of {radius_m} m touch each other in neighbouring cells of {} m",
                sim.cell_size_m
            );
            return wrong(
                reason,
                "give larger cells with `--cell-size`, or smaller robots",
            );
        }
        let view = grid_to_roadmap(grid, Connectivity::Four, sim.cell_size_m, [0.0, 0.0])?;
        let disc = Footprint::Disc { radius_m }.shape();
        let disc = disc.map_err(|error| InputError::new("radius_m", error.to_string()))?;
        let speed_m_per_s = sim.cell_size_m / sim.step_s;
        let roadmap = &view.roadmap;
        let vertices = 0..roadmap.vertices() as u32;
        let places = vertices.clone().map(|vertex| roadmap.position_m(vertex));
        let (x_m, y_m) = places.unzip();
        let edges = vertices.map(|vertex| roadmap.neighbors(vertex).iter().copied());
        let environment = Environment::from(RoadmapEnvironment::straight(
            x_m,
            y_m,
            edges.collect(),
            speed_m_per_s,
            2.0 * radius_m,
        ));
        Ok(Self {
            environment: SharedEnvironment::new(Environment {
                digest: roadmap.digest().to_string(),
                ..environment.named(grid.name())
            }),
            view,
            disc,
            speed_m_per_s,
            step_s: sim.step_s,
            motion,
            robots: Vec::new(),
            robot_of: Vec::new(),
            quarter_turn_s: 0.0,
        })
    }

    /// The same with models of robots that planners are told, and the model of each agent. Where edges may take longer, plans are
    /// taken to have the time that a turn by 90° takes before a move, which robots begin so much earlier.
    #[must_use]
    pub fn with_robots(self, robots: Vec<Robot>, robot_of: Vec<u32>, quarter_turn_s: f64) -> Self {
        let turns = self.motion == Motion::Slower;
        Self {
            robots,
            robot_of,
            quarter_turn_s: if turns { quarter_turn_s } else { 0.0 },
            ..self
        }
    }

    /// The map as planners are told it.
    pub fn environment(&self) -> &SharedEnvironment {
        &self.environment
    }

    /// The instance of a grid as planners of roadmaps are asked it. Says which place is no free cell.
    pub fn instance(&self, instance: &Instance) -> Result<Instance, String> {
        let vertex = |cell: &u32| {
            let vertex = self.view.vertex(*cell);
            vertex.ok_or_else(|| format!("cell {cell} is not free"))
        };
        let goals = instance.goals.iter();
        let goals = goals.map(|own| own.iter().map(vertex).collect::<Result<Vec<u32>, _>>());
        Ok(Instance {
            starts: instance
                .starts
                .iter()
                .map(vertex)
                .collect::<Result<_, _>>()?,
            goals: goals.collect::<Result<Vec<_>, _>>()?.into_iter().collect(),
            window_steps: 0,
            window_s: f64::from(instance.window_steps) * self.step_s,
            motion: self.motion,
            robots: self.robots.clone(),
            robot_of: self.robot_of.clone(),
            allows_cycles: false,
            ..instance.clone()
        })
    }

    /// Judges a plan for an instance of [`Timed::instance`], and gives its order.
    ///
    /// There are visits for every agent. They begin at its start and lead along edges, which take as long as the motion says. At
    /// no time of the window, or at no time at all without one, are two centres nearer than two radii. Moves that begin behind
    /// the window are not executed. Goals are not looked at.
    pub fn judge(
        &self,
        grid: &Grid,
        instance: &Instance,
        visits: &VisitPlan,
    ) -> Result<Ordered, String> {
        let window_s = match instance.window_s {
            0.0 => f64::INFINITY,
            window_s => window_s,
        };
        let plan = within(&visits_of(visits)?, window_s)?;
        let task = RoadmapTask {
            pace: match self.motion {
                Motion::Slower => Pace::Slower,
                _ => Pace::StopGo,
            },
            starts: Some(&instance.starts),
            ..RoadmapTask::new(&self.view.roadmap, &self.disc, self.speed_m_per_s)
        };
        let verdict = validate_roadmap(&plan, &task, DESCRIBED);
        let counts = |rule: RoadmapRule| !rule.is_contact();
        let mut found = verdict.violations.iter();
        // After the window they stop where they are: what happens then is not part of the plan.
        if let Some(first) = found.find(|found| found.time_s < window_s || counts(found.rule)) {
            return Err(format!("{first} ({})", first.rule));
        }
        let begins = |agent: usize| self.begins(grid, instance, agent, plan.path(agent));
        let (steps, circles) = in_order(&plan, &self.view.cells, self.step_s, begins)?;
        let starts: Vec<u32> = steps.paths().map(|path| path[0]).collect();
        let asked = Instance::one_shot(starts.clone(), starts);
        match judge(grid, &asked, steps) {
            Ok(batch) => Ok(Ordered { batch, circles }),
            Err(refused) => Err(refused.to_string()),
        }
    }

    /// Earliest times of the moves from each visit, turns before them included: waits are the plan's, and edges are driven at full
    /// speed. A robot may be in motion where the planner has it at rest, and has to know how it goes on before it must brake.
    fn begins(&self, grid: &Grid, instance: &Instance, agent: usize, path: &[Visit]) -> Vec<f64> {
        let cell = |visit: &Visit| self.view.cells[visit.vertex as usize];
        let headings = instance.headings.as_deref();
        let mut looks = headings.and_then(|headings| headings.get(agent).copied());
        let mut time_s = 0.0;
        let moves = path.windows(2).map(|ends| {
            let towards = Heading::of_move(cell(&ends[0]), cell(&ends[1]), grid.cols());
            let quarters = looks.map_or(0, |looks| looks.quarters_to(towards));
            looks = looks.map(|_| towards);
            let turn_s = f64::from(quarters) * self.quarter_turn_s;
            let begins_s = time_s + (ends[0].departure_s - ends[0].arrival_s - turn_s).max(0.0);
            time_s = begins_s + turn_s + self.step_s;
            begins_s
        });
        moves.collect()
    }
}

/// The moves that begin before the end of the window.
fn within(plan: &RoadmapPlan, window_s: f64) -> Result<RoadmapPlan, String> {
    let mut kept = RoadmapPlan::with_capacity(plan.agents(), plan.visit_count());
    for path in plan.paths() {
        let leaves = path.iter().take_while(|visit| visit.departure_s < window_s);
        let visits = path[..path.len().min(leaves.count() + 1)].iter().copied();
        kept.push_path(visits).map_err(|error| error.to_string())?;
    }
    Ok(kept)
}

/// A visit by its agent and its number.
#[derive(Debug, Clone, Copy)]
struct Stop {
    agent: u32,
    number: u32,
}

/// The order of passing of a plan on the roadmap as paths in steps, and the circles that were cut. `begins` says when a robot
/// begins the moves from its visits.
///
/// A move has the step in which it begins, or a later one: it comes after the move before it, and not before the one by which
/// the earlier visitor leaves the cell. With V visits this takes time O(V log V) beside the steps.
fn in_order(
    plan: &RoadmapPlan,
    cells: &[u32],
    step_s: f64,
    begins: impl Fn(usize) -> Vec<f64>,
) -> Result<(GridPlan, Vec<Vec<u32>>), String> {
    let agents = plan.agents();
    // Per visit the one before and the one behind it in its vertex.
    let mut first = Vec::with_capacity(agents + 1);
    let mut stops: Vec<(u32, f64, Stop)> = Vec::with_capacity(plan.visit_count());
    for (agent, path) in (0..).zip(plan.paths()) {
        first.push(stops.len());
        let stop = |(number, visit): (u32, &Visit)| {
            (visit.vertex, visit.arrival_s, Stop { agent, number })
        };
        stops.extend((0..).zip(path).map(stop));
    }
    let at = |stop: Stop| first[stop.agent as usize] + stop.number as usize;
    stops.sort_by(|one, other| {
        let by_time = one.0.cmp(&other.0).then(one.1.total_cmp(&other.1));
        by_time.then(one.2.agent.cmp(&other.2.agent))
    });
    let mut ahead: Vec<Option<Stop>> = vec![None; stops.len()];
    let mut behind: Vec<Option<Stop>> = vec![None; stops.len()];
    for pair in stops.windows(2) {
        let (one, other) = (pair[0].2, pair[1].2);
        // Who comes back has left before.
        if pair[0].0 == pair[1].0 && one.agent != other.agent {
            ahead[at(other)] = Some(one);
            behind[at(one)] = Some(other);
        }
    }
    let begins_s: Vec<Vec<f64>> = (0..agents).map(begins).collect();
    // The visits that each has done, and the steps at which they begin.
    let mut done = vec![0_u32; agents];
    let mut steps = vec![0_usize; stops.len()];
    let waits_for = |agent: usize, done: &[u32]| {
        let next = done[agent] + 1;
        let ahead = ahead[at(Stop {
            agent: agent as u32,
            number: next,
        })];
        ahead.filter(|ahead| done[ahead.agent as usize] <= ahead.number)
    };
    let has_next = |agent: usize, done: &[u32]| done[agent] as usize + 1 < plan.path(agent).len();
    let mut ready: VecDeque<usize> = (0..agents).collect();
    while let Some(agent) = ready.pop_front() {
        while has_next(agent, &done) && waits_for(agent, &done).is_none() {
            let number = done[agent] + 1;
            let to = at(Stop {
                agent: agent as u32,
                number,
            });
            let planned = (begins_s[agent][number as usize - 1] / step_s + ROUNDING) as usize + 1;
            let leaves = ahead[to].map_or(0, |ahead| steps[at(ahead) + 1]);
            steps[to] = planned.max(steps[to - 1] + 1).max(leaves);
            done[agent] = number;
            ready.extend(behind[to - 1].map(|next| next.agent as usize));
        }
    }
    let lengths = (0..agents).map(|agent| steps[first[agent] + done[agent] as usize] + 1);
    if lengths.sum::<usize>() > MOST_CELLS {
        return Err(format!(
            "the visits take more than {MOST_CELLS} steps of {step_s} s"
        ));
    }
    let mut paths = GridPlan::with_capacity(agents, 0);
    for (agent, path) in plan.paths().enumerate() {
        let mut cells_of: Vec<u32> = Vec::new();
        for number in 0..=done[agent] as usize {
            let enters = steps[first[agent] + number];
            if let Some(here) = cells_of.last().copied() {
                cells_of.resize(enters, here);
            }
            cells_of.push(cells[path[number].vertex as usize]);
        }
        paths.push_path(cells_of);
    }
    let waits = |agent: usize| {
        let waits = has_next(agent, &done).then(|| waits_for(agent, &done));
        waits.flatten().map(|ahead| ahead.agent as usize)
    };
    Ok((paths, circles(agents, waits)))
}

/// The circles of robots of which each waits for one other at most.
fn circles(agents: usize, waits: impl Fn(usize) -> Option<usize>) -> Vec<Vec<u32>> {
    // The walk in which a robot was met first.
    let mut met = vec![usize::MAX; agents];
    let mut found = Vec::new();
    for walk in 0..agents {
        let mut at = Some(walk);
        while let Some(agent) = at
            && met[agent] == usize::MAX
        {
            met[agent] = walk;
            at = waits(agent);
        }
        if let Some(agent) = at
            && met[agent] == walk
        {
            let around = std::iter::successors(Some(agent), |last| {
                waits(*last).filter(|next| *next != agent)
            });
            let mut circle: Vec<u32> = around.map(|agent| agent as u32).collect();
            circle.sort_unstable();
            found.push(circle);
        }
    }
    found
}
