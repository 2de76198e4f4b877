//! Steps of EPIBT one after the other: where agents are, which goals come next, and when it is
//! enough.
//!
//! A step is planned with its horizon, and then its first actions are done. The last step of a
//! window is done to the end of its horizon.

use std::sync::Arc;

use fleetyard_abi::{Goals, GridPlan, Heading};
use fleetyard_plugin_spacetime::graph::{Graph, Vertex, direction};
use fleetyard_plugin_spacetime::plan::plan_of;
use fleetyard_plugin_spacetime::problem::{ProblemError, vertex_of, vertices_of};
use fleetyard_plugin_spacetime::random::Random;

use super::Team;
use super::operations::{Aim, Errand, Maker};
use crate::streets::ways::{FAR, Ways, quarters};
use crate::streets::{ByStreet, STEP};

/// Goals of an agent that are looked at in a step.
const AIMS: usize = 2;

/// The input of [`run`].
#[derive(Debug, Clone, Copy)]
pub struct Query<'a> {
    /// Start cell of each agent, all different.
    pub starts: &'a [u32],
    /// Goal cells of each agent, to be visited in order. Agents may share goals, and have none.
    pub goals: &'a Goals,
    /// Headings of the agents at the beginning, if they are known.
    pub headings: Option<&'a [Heading]>,
    /// True if a turn by 90° takes a step. Robots whose headings are not known look north.
    pub turning: bool,
    /// Number of steps to plan; `None`: until every agent has visited all its goals, and is at the
    /// last one unless another agent has the same.
    pub window: Option<u32>,
    /// At most so many steps without a window.
    pub step_limit: u64,
    /// Actions of an operation: see [`horizons`].
    pub horizon: usize,
    /// Tries of the large neighbourhood search in each step, for each agent; `None`: as many as
    /// there is time for.
    pub tries: Option<u32>,
    /// Lets agents move round in a ring at the same step, each into the cell that the next one
    /// leaves.
    pub rings: bool,
    /// The rest of the last plan. Agents follow it until they find something better, as far as it
    /// leads from their starts and its paths do not collide.
    pub rest: Option<&'a GridPlan>,
    /// Decides between equals, and where the search begins.
    pub seed: u64,
}

/// The least and the largest number of actions of an operation.
pub const fn horizons() -> (usize, usize) {
    (3, 5)
}

/// A clock, and somebody who looks at it.
pub trait Watch {
    /// True when the call has to end.
    fn stop(&mut self) -> bool;
    /// A step begins, the first of so many that are left.
    fn begin(&mut self, left: u32);
    /// True when the step has had its share of the time.
    fn pause(&mut self) -> bool;
}

/// Reason why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The window is full; or, without one, all goals are visited.
    Done,
    /// It was asked to stop before everybody had chosen in every step. The plan goes as far as it had
    /// come, and to the end of that horizon.
    Stopped,
    /// [`Query::step_limit`]. The plan goes as far as that.
    Steps,
}

/// Plans for a team along the streets that a call has been made ready for.
///
/// # Errors
///
/// Starts or goals that are none, and goals that cannot be reached.
pub fn run(
    graph: &Arc<Graph>,
    streets: &mut ByStreet<'_>,
    query: &Query<'_>,
    watch: &mut dyn Watch,
) -> Result<(GridPlan, End), ProblemError> {
    match query.horizon {
        3 => Run::<3>::new(graph, streets, query)?.run(watch),
        4 => Run::<4>::new(graph, streets, query)?.run(watch),
        5 => Run::<5>::new(graph, streets, query)?.run(watch),
        other => {
            let reason = format!("a horizon of {other} actions, not of 3 to 5");
            Err(ProblemError::Malformed { reason })
        }
    }
}

/// An agent under way.
#[derive(Debug, Clone)]
struct Agent {
    at: Vertex,
    heading: Option<u8>,
    goals: Vec<Vertex>,
    /// Goals that it has visited.
    visited: usize,
    /// True if it has to be at its last goal in the end.
    stays: bool,
    /// Costs of the ways to the next goals, where they have been looked up.
    ways: [Option<(Arc<Ways>, usize)>; AIMS],
    known: usize,
}

struct Run<'a, 'b, 's, const D: usize> {
    graph: &'a Arc<Graph>,
    streets: &'b mut ByStreet<'s>,
    query: &'a Query<'a>,
    agents: Vec<Agent>,
    team: Team<D>,
    paths: Vec<Vec<Vertex>>,
}

impl<'a, 'b, 's, const D: usize> Run<'a, 'b, 's, D> {
    fn new(
        graph: &'a Arc<Graph>,
        streets: &'b mut ByStreet<'s>,
        query: &'a Query<'a>,
    ) -> Result<Self, ProblemError> {
        let (starts, goals) = (query.starts.len(), query.goals.len());
        if starts != goals || query.headings.is_some_and(|all| all.len() != starts) {
            let reason = format!("{starts} starts, {goals} lists of goals, and other headings");
            return Err(ProblemError::Malformed { reason });
        }
        let starts = vertices_of(graph, query.starts, "start")?;
        let mut sharers = vec![0_u32; graph.len()];
        let mut agents = Vec::with_capacity(starts.len());
        for (agent, (&at, cells)) in starts.iter().zip(query.goals.iter()).enumerate() {
            let cells = cells.iter();
            let goals = cells.map(|&cell| vertex_of(graph, agent, "goal", cell));
            let goals = goals.collect::<Result<Vec<_>, _>>()?;
            if let Some(&last) = goals.last() {
                sharers[last as usize] += 1;
            }
            let heading = match query.headings {
                Some(headings) => Some(direction(headings[agent])),
                None => query.turning.then_some(0),
            };
            agents.push(Agent {
                at,
                heading,
                goals,
                visited: 0,
                stays: false,
                ways: [const { None }; AIMS],
                known: 0,
            });
        }
        for agent in &mut agents {
            let last = agent.goals.last();
            let alone = last.is_some_and(|&last| sharers[last as usize] == 1);
            agent.stays = alone && query.window.is_none();
        }
        Ok(Self {
            team: Team::new(graph, starts.len(), query.rings),
            paths: starts.iter().map(|&v| vec![v]).collect(),
            graph,
            streets,
            query,
            agents,
        })
    }

    fn run(mut self, watch: &mut dyn Watch) -> Result<(GridPlan, End), ProblemError> {
        let mut random = Random::new(self.query.seed, 0);
        self.team.shuffle(&mut random);
        let mut kept = self.rest();
        let tries = self.query.tries;
        let tries = tries.map(|tries| u64::from(tries) * self.agents.len() as u64);
        for agent in 0..self.agents.len() {
            self.arrive(agent);
        }
        let mut step = 0;
        let end = loop {
            let left = match self.query.window {
                Some(window) => u64::from(window).saturating_sub(step + D as u64 - 1).max(1),
                None if self.agents.iter().all(Agent::is_done) => break End::Done,
                None if step >= self.query.step_limit => break End::Steps,
                None => u64::MAX,
            };
            watch.begin(u32::try_from(left).unwrap_or(u32::MAX));
            self.prepare(&kept)?;
            let whole = self.team.pass(&mut || watch.stop());
            if whole {
                self.team.improve(tries, &mut random, &mut || {
                    watch.stop() || tries.is_none() && watch.pause()
                });
            }
            if !whole || left == 1 {
                self.finish();
                break if whole { End::Done } else { End::Stopped };
            }
            kept = self.advance();
            step += 1;
        };
        for path in &mut self.paths {
            while let [.., before, last] = path[..]
                && before == last
            {
                path.pop();
            }
        }
        Ok((plan_of(&self.paths, self.graph), end))
    }

    /// The first steps of the rest of the last plan, for those who can follow it.
    fn rest(&self) -> Vec<[Vertex; D]> {
        let maker = self.maker();
        let wall = self.graph.wall();
        let rest = |(at, agent): (usize, &Agent)| {
            let mut cells = [agent.at; D];
            let Some(plan) = self.query.rest.filter(|rest| at < rest.agents()) else {
                return cells;
            };
            let path = plan.path(at).iter();
            let vertices = path.map(|&cell| self.graph.vertex(cell).unwrap_or(wall));
            let mut last = agent.at;
            let mut vertices = vertices.skip(1);
            for cell in &mut cells {
                last = vertices.next().unwrap_or(last);
                *cell = last;
            }
            if maker.can(agent.at, agent.heading, &cells) {
                cells
            } else {
                [agent.at; D]
            }
        };
        self.agents.iter().enumerate().map(rest).collect()
    }

    fn maker(&self) -> Maker<'_> {
        Maker {
            graph: self.graph,
            moves: self.streets.moves(),
            turning: self.query.turning,
        }
    }

    /// Counts the goals that an agent has come to.
    fn arrive(&mut self, agent: usize) {
        let agent = &mut self.agents[agent];
        let visited = agent.visited;
        // A goal where it stays is never done with.
        let count = agent.goals.len() - usize::from(agent.stays);
        while agent.visited < count && agent.goals[agent.visited] == agent.at {
            agent.visited += 1;
        }
        let passed = (agent.visited - visited).min(AIMS);
        agent.ways[..].rotate_left(passed);
        for ways in &mut agent.ways[AIMS - passed..] {
            *ways = None;
        }
        agent.known = agent.known.saturating_sub(passed);
    }

    /// Sees to the ways to the next goal of an agent, and to the one after it if it is near.
    fn look(&mut self, agent: usize) -> Result<(), ProblemError> {
        loop {
            let Agent {
                known,
                ref goals,
                visited,
                ..
            } = self.agents[agent];
            let number = visited + known;
            let next = goals.get(number).copied();
            if known > 0 {
                let rest = self.errand(agent, |maker, errand| errand.rest(maker));
                if rest >= FAR {
                    return Err(ProblemError::Unreachable {
                        agent,
                        from: self.graph.cell(self.agents[agent].at),
                        goal: self.graph.cell(self.agents[agent].goals[visited]),
                        limit: FAR / STEP,
                    });
                }
                if rest > D as u32 * STEP {
                    return Ok(());
                }
            }
            if known == AIMS || next.is_none() {
                return Ok(());
            }
            self.agents[agent].ways[known] = self.streets.ways(agent, number);
            self.agents[agent].known += 1;
        }
    }

    /// Asks about the task of an agent at this moment.
    fn errand<T>(&self, agent: usize, ask: impl FnOnce(&Maker<'_>, &Errand<'_>) -> T) -> T {
        let agent = &self.agents[agent];
        let aim = |number: usize| {
            let ways = agent.ways[number].as_ref();
            Aim {
                goal: agent.goals[agent.visited + number],
                ways: ways.map(|(ways, tolls)| (&**ways, self.streets.tolls(*tolls))),
            }
        };
        let nothing = Aim {
            goal: agent.at,
            ways: None,
        };
        let mut aims = [nothing; AIMS];
        for (number, entry) in aims.iter_mut().enumerate().take(agent.known) {
            *entry = aim(number);
        }
        let errand = Errand {
            start: agent.at,
            heading: agent.heading,
            aims: &aims[..agent.known],
            stays: agent.stays && agent.visited + agent.known == agent.goals.len(),
        };
        ask(&self.maker(), &errand)
    }

    /// Makes operations for everybody, and gives everybody one to begin with.
    fn prepare(&mut self, kept: &[[Vertex; D]]) -> Result<(), ProblemError> {
        for agent in 0..self.agents.len() {
            self.look(agent)?;
        }
        let urgency: Vec<u64> = (0..self.agents.len())
            .map(|at| {
                let agent = &self.agents[at];
                // Those who want nothing go last. Without a window everybody else keeps its turn
                // until it arrives, as in PIBT.
                let done = agent.is_done();
                let rest = match self.query.window {
                    Some(_) => self.errand(at, |maker, errand| errand.rest(maker)),
                    None => 0,
                };
                u64::from(done) << 32 | u64::from(rest)
            })
            .collect();
        let starts: Vec<Vertex> = self.agents.iter().map(|agent| agent.at).collect();
        self.team.begin(&starts, &urgency);
        let mut list = std::mem::take(self.team.candidates());
        let (mut first, mut waits) = (Vec::new(), Vec::new());
        for (agent, kept) in kept.iter().enumerate() {
            self.errand(agent, |maker, errand| {
                maker.all(errand, &mut list);
                first.push(maker.along(errand, kept));
                waits.push(maker.wait(errand));
            });
            self.team.end_candidates(agent, list.len());
        }
        *self.team.candidates() = list;
        self.team.settle(&first, &waits);
        Ok(())
    }

    /// Does the first action of everybody. Gives the rest of the operations, with a wait at the end.
    fn advance(&mut self) -> Vec<[Vertex; D]> {
        let mut kept = Vec::with_capacity(self.agents.len());
        for at in 0..self.agents.len() {
            let mut cells = self.team.chosen(at).cells;
            let first = cells[0];
            let towards = cells.iter().find(|&&v| v != self.agents[at].at);
            let agent = &mut self.agents[at];
            if let (Some(heading), Some(&v)) = (agent.heading, towards) {
                let around = self.graph.around(agent.at);
                let d = around.iter().position(|&u| u == v).unwrap_or(0);
                agent.heading = Some(if first == v || !self.query.turning {
                    if first == v { d as u8 } else { heading }
                } else {
                    turned(heading, d)
                });
            }
            agent.at = first;
            self.paths[at].push(first);
            self.arrive(at);
            cells.rotate_left(1);
            cells[D - 1] = cells[D.saturating_sub(2)];
            kept.push(cells);
        }
        kept
    }

    /// Does all actions of everybody's operation.
    fn finish(&mut self) {
        for (at, path) in self.paths.iter_mut().enumerate() {
            path.extend(self.team.chosen(at).cells);
        }
    }
}

impl Agent {
    /// True if it has nothing left to do where it is.
    fn is_done(&self) -> bool {
        let left = &self.goals[self.visited..];
        left.is_empty() || self.stays && left == [self.at]
    }
}

/// The heading after a quarter turn from one direction towards another.
fn turned(from: u8, to: usize) -> u8 {
    let right = (from + 1) % 4;
    if quarters(right, to) < quarters(from, to) {
        right
    } else if usize::from(from) == to {
        from
    } else {
        (from + 3) % 4
    }
}
