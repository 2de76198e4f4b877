//! WPPL: windowed paths for all agents, made better by parallel large neighbourhood search.
//!
//! H. Jiang, Y. Zhang, R. Veerapaneni, J. Li, "Scaling lifelong multi-agent path finding to more
//! realistic settings: research challenges and opportunities", SoCS 2024: the winner of the League of
//! Robot Runners 2023.
//!
//! | paper | here |
//! | --- | --- |
//! | windowed PIBT, which gives the first plan | [`epibt`](crate::epibt), from the end of the last plan on |
//! | LNS in the window | [`Refiner`], with `Window` as its task |
//! | destroy heuristics, chosen adaptively | [`Kind`], the arms of [`Refiner`] |
//! | prioritised planning in a random order | `search`: A\* over poses and steps, at costs of `errand` |
//! | heuristic at the end of the window | the tables of [`Streets`](crate::streets::Streets): lanes, turns and waiting count |
//! | parallel search | rounds of [`Refiner`], which are the same on any number of threads |
//!
//! Three things are not as in the paper:
//!
//! - the agents nearest to their goals count more in the sum that is to become small, as in EPIBT: who
//!   arrives makes a goal;
//! - the last plan is kept and gets steps at its end, where the paper makes all steps anew;
//! - that is for agents who find their ways round one another. In a *crowd* they have to push one
//!   another away, for which paths one by one are no help: where agents lose more than `CROWD` of
//!   their time, the window is as short as can be, and EPIBT makes it anew with a search of its own.

mod errand;
mod search;

use std::sync::Arc;

use fleetyard_abi::{GridPlan, Lists};
use fleetyard_plugin_spacetime::graph::{Graph, Vertex, direction, heading};
use fleetyard_plugin_spacetime::neighborhood::Kind;
use fleetyard_plugin_spacetime::plan::{Paths, plan_of};
use fleetyard_plugin_spacetime::problem::{ProblemError, goals_of, vertices_of};
use fleetyard_plugin_spacetime::random::Random;
use fleetyard_plugin_spacetime::refine::{Refiner, Single, Task};
use fleetyard_plugin_spacetime::reservation::Reservations;

use self::errand::{Errand, Ground, Leg, Pose};
use self::search::Search;
use crate::epibt::operations::Maker;
use crate::epibt::run::{self as epibt, End, turned};
use crate::streets::ways::FAR;
use crate::streets::{ByStreet, STEP};
use crate::watch::Watch;

/// The longest window that is planned at once. Longer ones are, as if there were none, in parts.
pub const MOST_STEPS: u32 = 128;
/// Goals of an agent that are looked at in a window.
const LEGS: usize = 8;
/// The weight of the agent that is nearest to its goal; that of the last is 1.
const WHOLE: u64 = 64;
/// Agents are in a crowd that lose more than this share of their time.
const CROWD: [u64; 2] = [3, 20];
/// Tries of EPIBT in a crowd, where no number is given.
const TRIES: u32 = 5;

/// The input of [`run`].
#[derive(Debug, Clone, Copy)]
pub struct Query<'a> {
    /// The team, and how its first plan is made, but for [`epibt::Query::tries`].
    pub first: epibt::Query<'a>,
    /// Steps that are planned at least, from 1 to [`MOST_STEPS`].
    pub depth: u32,
    /// Times that an agent is planned anew in a window, on average; `None`: as often as there is time
    /// for.
    pub tries: Option<u32>,
}

/// The work of a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Effort {
    /// Neighbourhoods that were planned anew.
    pub neighborhoods: u64,
    /// Those of them that were kept made the plan cheaper by so many units of cost.
    pub gain: u64,
    /// True if the clock ended the search.
    pub stopped: bool,
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
) -> Result<(GridPlan, End, Effort), ProblemError> {
    let mut run = Run::new(graph, streets, query)?;
    let end = run.go(watch)?;
    for path in &mut run.paths {
        while let [.., before, last] = path[..]
            && before == last
        {
            path.pop();
        }
    }
    Ok((plan_of(&run.paths, graph), end, run.effort))
}

struct Run<'a, 'b, 's> {
    graph: &'a Arc<Graph>,
    streets: &'b mut ByStreet<'s>,
    query: &'a Query<'a>,
    goals: Lists<Vertex>,
    /// Agents that have to be at their last goal in the end.
    stays: Vec<bool>,
    /// Poses of the agents.
    poses: Vec<Pose>,
    paths: Paths,
    effort: Effort,
}

impl<'a, 'b, 's> Run<'a, 'b, 's> {
    fn new(
        graph: &'a Arc<Graph>,
        streets: &'b mut ByStreet<'s>,
        query: &'a Query<'a>,
    ) -> Result<Self, ProblemError> {
        let team = &query.first;
        let (starts, goals) = (team.starts.len(), team.goals.len());
        if starts != goals || team.headings.is_some_and(|all| all.len() != starts) {
            let reason = format!("{starts} starts, {goals} lists of goals, and other headings");
            return Err(ProblemError::Malformed { reason });
        }
        let starts = vertices_of(graph, team.starts, "start")?;
        let goals = goals_of(graph, team.goals)?;
        let mut sharers = vec![0_u32; graph.len()];
        for last in goals.iter().filter_map(<[Vertex]>::last) {
            sharers[*last as usize] += 1;
        }
        let alone = |goals: &[Vertex]| goals.last().is_some_and(|v| sharers[*v as usize] == 1);
        let stays = goals
            .iter()
            .map(|goals| team.window.is_none() && alone(goals));
        let poses = starts.iter().enumerate().map(|(agent, &v)| Pose {
            v,
            heading: match team.headings {
                Some(headings) => Some(direction(headings[agent])),
                None => team.turning.then_some(0),
            },
            visited: 0,
        });
        let mut run = Self {
            stays: stays.collect(),
            poses: poses.collect(),
            paths: starts.iter().map(|&v| vec![v]).collect(),
            effort: Effort::default(),
            graph,
            streets,
            query,
            goals,
        };
        for agent in 0..starts.len() {
            run.arrive(agent);
        }
        Ok(run)
    }

    fn go(&mut self, watch: &mut dyn Watch) -> Result<End, ProblemError> {
        let team = self.query.first;
        let mut kept = self.rest();
        let mut step = 0;
        loop {
            let left = match team.window {
                Some(window) => window.saturating_sub(step),
                None if self.is_done() => return Ok(End::Done),
                None if u64::from(step) >= team.step_limit => return Ok(End::Steps),
                None => u32::MAX,
            };
            // So much is planned at a time, and where more is left the second half of it anew.
            let depth = self.query.depth.clamp(1, MOST_STEPS);
            let whole = team.window.is_some() && left <= MOST_STEPS;
            let (least, parts) = if whole {
                (left, 1)
            } else {
                (depth, left / depth.div_ceil(2))
            };
            watch.begin(parts.max(1));
            let (paths, ended) = self.window(kept, [least, depth.max(least)], step, watch)?;
            let steps = paths.first().map_or(least, |path| path.len() as u32 - 1);
            let taken = if ended && !whole {
                steps.div_ceil(2)
            } else {
                steps
            };
            self.follow(&paths, taken as usize);
            if !ended {
                return Ok(End::Stopped);
            }
            if whole {
                return Ok(End::Done);
            }
            step += taken;
            kept = paths;
            for path in &mut kept {
                path.drain(..taken as usize);
            }
        }
    }

    /// Paths of everybody, which begin with some that are kept: for the second number of steps, and in a
    /// crowd, which those show, for the first, and without them. False when there was no time for
    /// everybody to choose.
    fn window(
        &mut self,
        mut kept: Paths,
        [least, depth]: [u32; 2],
        step: u32,
        watch: &mut dyn Watch,
    ) -> Result<(Paths, bool), ProblemError> {
        let agents = kept.len();
        if agents == 0 {
            return Ok((kept, true));
        }
        let errands = self.errands(depth)?;
        let seed = self.query.first.seed.wrapping_add(step.into());
        for path in &mut kept {
            path.truncate(depth as usize + 1);
        }
        let mut whole = true;
        if kept[0].len() == 1 || self.is_crowded(&errands, &kept) {
            kept = self.poses.iter().map(|pose| vec![pose.v]).collect();
            let least = least.max(self.query.first.horizon as u32);
            let tries = self.query.tries.unwrap_or(TRIES);
            whole = self.extend(&mut kept, least, tries, watch)?;
        }
        if whole && !self.is_crowded(&errands, &kept) {
            whole = self.extend(&mut kept, depth, 0, watch)?;
        }
        if !whole {
            return Ok((kept, false));
        }
        let task = self.task(&errands, kept[0].len() as u32 - 1);
        let mut excess = task.excess(&kept);
        let query = self.query;
        let mut refiner = Refiner::new(
            self.graph,
            &[],
            kept,
            query.first.rings,
            query.first.threads,
            seed,
        );
        let most = query.tries.map(|tries| u64::from(tries) * agents as u64);
        let mut effort = self.effort;
        let mut replanned = 0;
        while excess > 0 && most.is_none_or(|most| replanned < most) {
            let mut stop = || watch.stop() || most.is_none() && watch.pause();
            let round = refiner.round(&task, &mut stop);
            if stop() {
                effort.stopped = true;
                break;
            }
            // In the unlikely case that nobody was chosen, it counts all the same.
            replanned += round.agents.max(1);
            excess = excess.saturating_sub(round.gain);
            effort.neighborhoods += round.attempts;
            effort.gain += round.gain;
        }
        self.effort = effort;
        Ok((refiner.into_paths(), true))
    }

    /// True if agents lose much of their time on some paths because of others.
    fn is_crowded(&self, errands: &[Errand], paths: &Paths) -> bool {
        let steps = paths[0].len() as u32 - 1;
        let task = self.task(errands, steps);
        let weights: u64 = errands.iter().map(|errand| errand.weight).sum();
        let time = weights * u64::from(steps * STEP);
        task.excess(paths) * CROWD[1] > time * CROWD[0]
    }

    /// The search of a window of so many steps.
    fn task<'e>(&'e self, errands: &'e [Errand], window: u32) -> Window<'e> {
        let ground = Ground {
            graph: self.graph,
            moves: self.streets.moves(),
            streets: self.streets,
            turning: self.query.first.turning,
        };
        Window {
            ground,
            errands,
            steps: window,
        }
    }

    /// Adds steps of EPIBT, with so many tries for each, to paths until they have so many. False when
    /// it was stopped; agents wait then.
    fn extend(
        &mut self,
        paths: &mut Paths,
        steps: u32,
        tries: u32,
        watch: &mut dyn Watch,
    ) -> Result<bool, ProblemError> {
        let length = steps as usize + 1;
        if paths.iter().all(|path| path.len() >= length) {
            return Ok(true);
        }
        let begin = self.poses.clone();
        for (agent, path) in paths.iter().enumerate() {
            self.walk(agent, path);
        }
        let ends = std::mem::replace(&mut self.poses, begin);
        let steps = length - paths[0].len();
        let team = self.query.first;
        let starts: Vec<u32> = ends.iter().map(|pose| self.graph.cell(pose.v)).collect();
        let visited: Vec<usize> = ends.iter().map(|pose| pose.visited).collect();
        let headings = ends.iter().map(|pose| pose.heading.map(heading));
        let headings: Option<Vec<_>> = headings.collect();
        let query = epibt::Query {
            starts: &starts,
            visited: &visited,
            headings: headings.as_deref(),
            window: team.window.map(|_| steps as u32),
            step_limit: steps as u64,
            rest: team
                .rest
                .filter(|_| length == steps + 1 && self.paths[0].len() == 1),
            tries: Some(tries),
            ..team
        };
        let (plan, end) = epibt::run(self.graph, self.streets, &query, watch)?;
        for (path, cells) in paths.iter_mut().zip(plan.paths()) {
            let more = cells
                .iter()
                .skip(1)
                .filter_map(|&cell| self.graph.vertex(cell));
            path.extend(more.take(steps));
            let last = path[path.len() - 1];
            path.resize(length, last);
        }
        Ok(end != End::Stopped)
    }

    /// The rest of the last plan, if everybody can follow it and nobody is met.
    fn rest(&self) -> Paths {
        let here = || self.paths.clone();
        let team = &self.query.first;
        let Some(plan) = team.rest.filter(|plan| plan.agents() == self.paths.len()) else {
            return here();
        };
        let length = plan.horizon().min(MOST_STEPS as usize) + 1;
        let maker = Maker {
            graph: self.graph,
            moves: self.streets.moves(),
            turning: team.turning,
        };
        let mut others = Reservations::new(self.graph, length + 2);
        let mut paths = Paths::with_capacity(plan.agents());
        for (pose, cells) in self.poses.iter().zip(plan.paths()) {
            let vertices = cells.iter().map(|&cell| self.graph.vertex(cell));
            let Some(mut path) = vertices.take(length).collect::<Option<Vec<_>>>() else {
                return here();
            };
            let last = path.last().copied().unwrap_or(pose.v);
            path.resize(length, last);
            let able = path[0] == pose.v && maker.can(pose.v, pose.heading, &path[1..]);
            if !able || !others.admits(self.graph, &path, team.rings) {
                return here();
            }
            others.flip(self.graph, &path);
            paths.push(path);
        }
        paths
    }

    /// Lets an agent go along a path from where it is. Robots that turn have turned at its end towards
    /// where they want to go.
    fn walk(&mut self, agent: usize, path: &[Vertex]) {
        let turning = self.query.first.turning;
        let mut waited = 0;
        for &v in &path[1..] {
            let pose = &mut self.poses[agent];
            if v == pose.v {
                waited += 1;
                continue;
            }
            let around = self.graph.around(pose.v);
            let d = around.iter().position(|u| *u == v);
            if let (Some(heading), Some(d)) = (&mut pose.heading, d) {
                *heading = d as u8;
            }
            pose.v = v;
            waited = 0;
            self.arrive(agent);
        }
        let Pose {
            v,
            heading,
            visited,
        } = self.poses[agent];
        if turning
            && waited > 0
            && let Some(from) = heading
            && visited < self.goals[agent].len()
            && let Some((ways, tolls)) = self.streets.ways(agent, visited)
        {
            let tolls = self.streets.tolls(tolls);
            let best = ways.best(self.streets.moves(), v, heading, tolls);
            let turn = |looks, _| best.map_or(looks, |d| turned(looks, d));
            self.poses[agent].heading = Some((0..waited.min(2)).fold(from, turn));
        }
    }

    /// Counts the goals that an agent has come to.
    fn arrive(&mut self, agent: usize) {
        let pose = &mut self.poses[agent];
        let goals = &self.goals[agent];
        // A goal where it stays is never done with.
        let count = goals.len() - usize::from(self.stays[agent]);
        while pose.visited < count && goals[pose.visited] == pose.v {
            pose.visited += 1;
        }
    }

    /// Lets everybody do the first steps of its path.
    fn follow(&mut self, paths: &Paths, steps: usize) {
        for (agent, path) in paths.iter().enumerate() {
            let path = &path[..path.len().min(steps + 1)];
            self.walk(agent, path);
            self.paths[agent].extend(&path[1..]);
        }
    }

    /// True if nobody has anything left to do.
    fn is_done(&self) -> bool {
        self.poses.iter().enumerate().all(|(agent, pose)| {
            let left = &self.goals[agent][pose.visited..];
            left.is_empty() || self.stays[agent] && left == [pose.v]
        })
    }

    /// The tasks of all agents in a window.
    fn errands(&mut self, window: u32) -> Result<Vec<Errand>, ProblemError> {
        let mut errands = Vec::with_capacity(self.poses.len());
        for agent in 0..self.poses.len() {
            errands.push(self.errand(agent, window)?);
        }
        let task = self.task(&[], window);
        let ground = task.ground;
        for errand in &mut errands {
            errand.rest = ground.rest(errand, errand.begin());
        }
        let mut order: Vec<usize> = (0..errands.len()).collect();
        order.sort_by_key(|&agent| (errands[agent].legs.is_empty(), errands[agent].rest));
        let agents = order.len() as u64;
        for (rank, agent) in (0..).zip(order) {
            let share = agents - rank;
            errands[agent].weight = (WHOLE * share * share / (agents * agents)).max(1);
        }
        Ok(errands)
    }

    fn errand(&mut self, agent: usize, window: u32) -> Result<Errand, ProblemError> {
        let Pose {
            v,
            heading,
            visited,
        } = self.poses[agent];
        let mut errand = Errand {
            start: v,
            heading,
            legs: Vec::new(),
            stays: false,
            rest: 0,
            weight: 1,
        };
        let (mut from, mut looks) = (v, heading);
        let mut way: u32 = 0;
        let mut parts = Vec::new();
        let goals = &self.goals[agent];
        let next = goals.iter().enumerate().skip(visited).take(LEGS);
        for (number, &goal) in next {
            if way > window * STEP {
                break;
            }
            let ways = self.streets.ways(agent, number);
            let cost = match &ways {
                Some((ways, tolls)) => {
                    let tolls = self.streets.tolls(*tolls);
                    ways.from(self.streets.moves(), from, looks, tolls)
                }
                None => self.graph.manhattan(from, goal) * STEP,
            };
            if cost >= FAR {
                return Err(ProblemError::Unreachable {
                    agent,
                    from: self.graph.cell(from),
                    goal: self.graph.cell(goal),
                    limit: FAR / STEP,
                });
            }
            way += cost;
            parts.push(cost);
            (from, looks) = (goal, None);
            errand.legs.push(Leg {
                goal,
                ways,
                after: 0,
            });
        }
        for leg in (1..parts.len()).rev() {
            errand.legs[leg - 1].after = errand.legs[leg].after + parts[leg];
        }
        errand.stays = self.stays[agent] && visited + parts.len() == goals.len();
        Ok(errand)
    }
}

/// Paths in a window, as the search sees them.
struct Window<'a> {
    ground: Ground<'a>,
    errands: &'a [Errand],
    steps: u32,
}

impl Window<'_> {
    /// Cost by which paths exceed those that the agents would have alone.
    fn excess(&self, paths: &Paths) -> u64 {
        let all = paths.iter().enumerate();
        let excess = all.map(|(agent, path)| {
            let cost = self.cost(agent, path);
            cost.saturating_sub(self.alone(agent, path[0]))
        });
        excess.sum()
    }
}

impl Task for Window<'_> {
    type Search = Search;
    const KINDS: &'static [Kind] = &[Kind::Delay, Kind::Place, Kind::Random];

    fn cost(&self, agent: usize, path: &[Vertex]) -> u64 {
        let errand = &self.errands[agent];
        errand.weight * u64::from(self.ground.cost(errand, path))
    }

    #[inline]
    fn alone(&self, agent: usize, _: Vertex) -> u64 {
        let errand = &self.errands[agent];
        errand.weight * u64::from(errand.rest)
    }

    #[inline]
    fn through(&self, agent: usize, v: Vertex, time: usize) -> u64 {
        if time > self.steps as usize {
            return u64::MAX;
        }
        let errand = &self.errands[agent];
        let heading = None;
        let rest = (0..errand.legs.len()).map(|visited| {
            let pose = Pose {
                v,
                heading,
                visited,
            };
            self.ground.rest(errand, pose)
        });
        let rest = u64::from(rest.min().unwrap_or(0));
        errand.weight * (rest + time as u64 * u64::from(STEP))
    }

    fn path(
        &self,
        search: &mut Search,
        query: Single<'_>,
        random: &mut Random,
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<(Vec<Vertex>, u64)> {
        let Single { agent, most, .. } = query;
        let errand = &self.errands[agent];
        let query = search::Query {
            ground: self.ground,
            errand,
            others: query.others,
            window: self.steps,
            cycles: query.cycles,
            most: most / errand.weight,
        };
        let path = search.path(&query, random, stop)?;
        let cost = self.cost(agent, &path);
        Some((path, cost))
    }

    fn expansions(search: &Search) -> u64 {
        search.expansions
    }
}
