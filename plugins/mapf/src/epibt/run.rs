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

use super::operations::{Aim, Costs, Errand, Maker, Near};
use super::regions::Regions;
use super::{MENU, NOBODY, Search, Team};
use crate::share::share;
use crate::streets::ways::{FAR, Ways, quarters};
use crate::streets::{ByStreet, STEP};
use crate::watch::Watch;

/// Goals of an agent that are looked at in a step.
const AIMS: usize = 2;

/// The input of [`run`].
#[derive(Debug, Clone, Copy)]
pub struct Query<'a> {
    /// Start cell of each agent, all different.
    pub starts: &'a [u32],
    /// Goal cells of each agent, to be visited in order. Agents may share goals, and have none.
    pub goals: &'a Goals,
    /// Number of its goals that each agent has visited before; empty for none.
    pub visited: &'a [usize],
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
    /// Threads that share the work. The plan does not depend on their number, unless the clock ends
    /// the search.
    pub threads: usize,
}

/// The least and the largest number of actions of an operation.
pub const fn horizons() -> (usize, usize) {
    (3, 5)
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
pub(super) struct Agent {
    pub(super) at: Vertex,
    pub(super) heading: Option<u8>,
    pub(super) goals: Vec<Vertex>,
    /// Goals that it has visited.
    pub(super) visited: usize,
    /// True if it has to be at its last goal in the end.
    pub(super) stays: bool,
    /// Costs of the ways to the next goals, where they have been looked up.
    pub(super) ways: [Option<(Arc<Ways>, usize)>; AIMS],
    known: usize,
    /// Costs of the ways to the next goal that stand in for these, from the cells around.
    near: Option<Near>,
    /// The cost of the way to the next goal.
    rest: u32,
}

pub(super) struct Run<'a, 'b, 's, const D: usize> {
    pub(super) graph: &'a Arc<Graph>,
    pub(super) streets: &'b mut ByStreet<'s>,
    query: &'a Query<'a>,
    pub(super) agents: Vec<Agent>,
    team: Team<D>,
    regions: Regions,
    /// The agent in each vertex while agents look round; nobody between.
    occupant: Vec<u32>,
    /// One per thread.
    searches: Vec<Search>,
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
                visited: query.visited.get(agent).map_or(0, |n| *n),
                stays: false,
                ways: [const { None }; AIMS],
                known: 0,
                near: None,
                rest: 0,
            });
        }
        for agent in &mut agents {
            let last = agent.goals.last();
            let alone = last.is_some_and(|&last| sharers[last as usize] == 1);
            agent.stays = alone && query.window.is_none();
        }
        Ok(Self {
            team: Team::new(graph, starts.len(), query.rings),
            regions: Regions::new(graph, D),
            occupant: vec![NOBODY; graph.len() + 1],
            searches: (0..query.threads.max(1))
                .map(|_| Search::new(starts.len()))
                .collect(),
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
        let Query { tries, seed, .. } = *self.query;
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
            // What is left of the step before is a plan as well.
            if !watch.begin(u32::try_from(left).unwrap_or(u32::MAX)) && step > 0 {
                for (path, kept) in self.paths.iter_mut().zip(&kept) {
                    path.extend(kept);
                }
                break End::Stopped;
            }
            self.prepare(&kept)?;
            watch.ready();
            let (team, searches) = (&mut self.team, &mut self.searches);
            let whole = searches[0].pass(team, &mut || watch.stop());
            if whole {
                let stop = &mut || watch.stop() || tries.is_none() && watch.pause();
                let regions = &self.regions;
                regions.improve(team, searches, tries, (seed, step), &mut random, stop);
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

    /// Sees to the ways to the next goals of all agents, and to those after them where they are near.
    fn look(&mut self) -> Result<(), ProblemError> {
        for agent in 0..self.agents.len() {
            if self.agents[agent].known == 0 {
                self.learn(agent);
            }
            self.agents[agent].near = self.near(agent);
        }
        let mut occupant = std::mem::take(&mut self.occupant);
        for (number, agent) in (0..).zip(&self.agents) {
            occupant[agent.at as usize] = number;
        }
        let mut found = vec![(0, None); self.agents.len()];
        let chunks = found.chunks_mut(MENU).enumerate();
        self.share(chunks, |run, (number, found)| {
            for (agent, found) in (number * MENU..).zip(found) {
                let rest = run.errand(agent, |maker, errand| errand.rest(maker));
                *found = (rest, run.aside(agent, &occupant));
            }
        });
        for agent in &self.agents {
            occupant[agent.at as usize] = NOBODY;
        }
        self.occupant = occupant;
        for (at, (rest, aside)) in found.into_iter().enumerate() {
            let agent = &mut self.agents[at];
            agent.rest = rest;
            if aside.is_some() {
                agent.near = aside;
            }
            if rest >= FAR {
                return Err(ProblemError::Unreachable {
                    agent: at,
                    from: self.graph.cell(agent.at),
                    goal: self.graph.cell(agent.goals[agent.visited]),
                    limit: FAR / STEP,
                });
            }
            if rest <= D as u32 * STEP && (1..AIMS).contains(&agent.known) {
                self.learn(at);
            }
        }
        Ok(())
    }

    /// Looks up the ways to the first goal of an agent whose ways are not known.
    fn learn(&mut self, agent: usize) {
        let Agent { known, visited, .. } = self.agents[agent];
        if visited + known < self.agents[agent].goals.len() {
            self.agents[agent].ways[known] = self.streets.ways(agent, visited + known);
            self.agents[agent].known += 1;
        }
    }

    /// Distances to the next goal from the cells around an agent for whose ways along streets there is
    /// no room.
    fn near(&mut self, agent: usize) -> Option<Near> {
        let Agent {
            at,
            visited,
            known,
            ref ways,
            ..
        } = self.agents[agent];
        if known == 0 || ways[0].is_some() {
            return None;
        }
        let mut cells = vec![at];
        let mut done = 0;
        for _ in 0..D {
            for number in std::mem::replace(&mut done, cells.len())..cells.len() {
                for u in self.graph.neighbors(cells[number]) {
                    if !cells.contains(&u) {
                        cells.push(u);
                    }
                }
            }
        }
        let steps = self.streets.distances(agent, visited, &cells)?;
        Some(Near::new(
            cells
                .into_iter()
                .zip(steps.into_iter().map(|steps| steps * STEP)),
        ))
    }

    /// Does some work on every item, in all threads.
    fn share<T>(&self, items: impl Iterator<Item = T> + Send, work: impl Fn(&Self, T) + Sync) {
        let mut workers = vec![(); self.query.threads.max(1)];
        share(&mut workers, items, |(), item| work(self, item));
    }

    /// Asks about the task of an agent at this moment.
    fn errand<T>(&self, agent: usize, ask: impl FnOnce(&Maker<'_>, &Errand<'_>) -> T) -> T {
        let agent = &self.agents[agent];
        let aim = |number: usize| {
            let ways = agent.ways[number].as_ref();
            let ways = ways.map(|(ways, tolls)| Costs::Ways(ways, self.streets.tolls(*tolls)));
            let near = agent.near.as_ref().filter(|_| number == 0);
            Aim {
                goal: agent.goals[agent.visited + number],
                costs: near.map(Costs::Near).or(ways),
            }
        };
        let nothing = Aim {
            goal: agent.at,
            costs: None,
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
        self.look()?;
        let window = self.query.window;
        let urgency = self.agents.iter().map(|agent| {
            // Those who want nothing go last. Without a window everybody else keeps its turn
            // until it arrives, as in PIBT.
            let rest = if window.is_some() { agent.rest } else { 0 };
            u64::from(agent.is_done()) << 32 | u64::from(rest)
        });
        let urgency: Vec<u64> = urgency.collect();
        let starts: Vec<Vertex> = self.agents.iter().map(|agent| agent.at).collect();
        self.team.begin(&starts, &urgency);
        let mut menus = std::mem::take(self.team.menus());
        let parts = menus.iter_mut().zip(kept.chunks(MENU)).enumerate();
        self.share(parts, |run, (number, (menu, kept))| {
            menu.clear();
            for (agent, kept) in (number * MENU..).zip(kept) {
                run.errand(agent, |maker, errand| {
                    let (kept, wait) = (maker.along(errand, kept), maker.wait(errand));
                    menu.add(|list| maker.all(errand, list), kept, wait);
                });
            }
        });
        *self.team.menus() = menus;
        self.team.settle();
        Ok(())
    }

    /// Does the first action of everybody. Gives the rest of the operations, with a wait at the end.
    fn advance(&mut self) -> Vec<[Vertex; D]> {
        let mut kept = Vec::with_capacity(self.agents.len());
        for at in 0..self.agents.len() {
            let mut cells = self.team.chosen(at as u32).cells;
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
            path.extend(self.team.chosen(at as u32).cells);
        }
    }
}

impl Agent {
    /// True if it has nothing left to do where it is.
    pub(super) fn is_done(&self) -> bool {
        let left = &self.goals[self.visited..];
        left.is_empty() || self.stays && left == [self.at]
    }
}

/// The heading after a quarter turn from one direction towards another.
pub(crate) fn turned(from: u8, to: usize) -> u8 {
    let right = (from + 1) % 4;
    if quarters(right, to) < quarters(from, to) {
        right
    } else if usize::from(from) == to {
        from
    } else {
        (from + 3) % 4
    }
}
