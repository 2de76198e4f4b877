//! PIBT without end: agents have goals one after the other, which others may share, and
//! plans are made a few steps at a time.
//!
//! K. Okumura, M. Machida, X. Défago, Y. Tamura, "Priority inheritance with backtracking
//! for iterative multi-agent path finding", Artificial Intelligence 310 (2022).
//!
//! There the priority of an agent grows while it is under way. Here a call knows nothing
//! of those before it, so that a recorded run can be resumed anywhere, and priorities have
//! to follow from the places alone. Under a window *whoever is nearest to its goal goes
//! first*: the first of all comes one step nearer with every step, stays the first, and
//! arrives, however short the windows are; then it has another goal and others are first.
//! With the furthest one first, as PIBT begins by habit, the one that was first may be
//! pushed back by the next, and short windows can go to and fro for ever.
//!
//! With more than one sample the best of several steps is made, and with retries other ways
//! on from earlier configurations are tried: what LaCAM (Okumura, AAAI 2023) comes to when
//! no configuration is a dead end, because all that is asked for is the next few steps.

use std::sync::Arc;

use fleetyard_abi::{Goals, GridPlan, Heading, Lists};
use fleetyard_plugin_spacetime::gradient::{Expected, Gradients};
use fleetyard_plugin_spacetime::graph::{DIRECTIONS, Graph, Vertex, direction};
use fleetyard_plugin_spacetime::plan::{paths_of, plan_of};
use fleetyard_plugin_spacetime::problem::{ProblemError, goals_of, vertices_of};
use fleetyard_plugin_spacetime::random::Random;

use crate::pibt::swap::Will;
use crate::pibt::{Pibt, Wishes};
use crate::watch::Watch;

/// No row of [`Gradients`]: an agent that wants nothing.
const NOTHING: u32 = u32::MAX;
/// No direction.
const NOWHERE: u8 = DIRECTIONS as u8;
/// Agents moved between two calls of `stop`.
const PATIENCE: usize = 2000;

/// The input of [`Lifelong::run`].
#[derive(Debug, Clone, Copy)]
pub struct Query<'a> {
    /// Start cell of each agent, all different.
    pub starts: &'a [u32],
    /// Goal cells of each agent, to be visited in order. Agents may share goals, and have
    /// none.
    pub goals: &'a Goals,
    /// Headings of the agents at the beginning. Where they are known, an agent goes straight on
    /// rather than round a corner if both bring it nearer: robots take time to turn.
    pub headings: Option<&'a [Heading]>,
    /// Number of steps to plan; `None`: until every agent has visited all its goals, and is at the
    /// last one unless another agent has the same.
    pub window: Option<u32>,
    /// At most so many steps without a window.
    pub step_limit: u64,
    /// Lets two agents change places at the end of a corridor.
    pub swap: bool,
    /// Lets agents move round in a ring at the same step, each into the cell that the next one
    /// leaves.
    pub rings: bool,
    /// Most bytes of tables that may be in use; 0: no limit.
    pub memory_limit: u64,
    /// Steps tried each time, of which the one that brings most agents nearer is made; at
    /// least 1.
    pub samples: u32,
    /// Number of times that the search goes back to a step of the best plan, drawn at random, and
    /// goes on differently from there.
    pub retries: u32,
    /// Decides between equals.
    pub seed: u64,
}

/// Reason why a run ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum End {
    /// The window is full; or, without one, all goals are visited.
    Done,
    /// It was asked to stop. The plan goes as far as it had come.
    Stopped,
    /// [`Query::step_limit`]. The plan goes as far as that.
    Steps,
    /// [`Query::memory_limit`]. In the plan everybody stays.
    Memory,
}

/// The agent, and its state, for which [`Ranking::rank`] is asked.
#[derive(Debug, Clone, Copy)]
pub struct Place {
    /// The step that is to be made, counted from 0.
    pub step: u32,
    /// Number of the agent.
    pub agent: usize,
    /// The cell where it is.
    pub cell: u32,
    /// The direction in which it looks, where headings are known.
    pub heading: Option<u8>,
    /// Number of its goals that it has visited.
    pub visited: usize,
}

/// Has a say in where agents go.
pub trait Ranking {
    /// Puts into order, best first, the cells where an agent may be after a step: those
    /// around it and its own, which are given as PIBT would try them. Gives how many of them, at
    /// the end, the agent goes to only when it is pushed out of its cell. Asked once or more per
    /// agent and step; the answer must not depend on how often.
    fn rank(&mut self, place: Place, cells: &mut [u32]) -> usize;

    /// Remaining cost of an agent, by default its distance: under a window the agent with the
    /// least goes first. A ranking whose first choice always makes this less lets the first of all
    /// agents arrive.
    #[inline]
    fn urgency(&mut self, _: Place, distance: u32) -> u32 {
        distance
    }
}

/// PIBT's own order.
#[derive(Debug, Clone, Copy, Default)]
pub struct ByDistance;

impl Ranking for ByDistance {
    #[inline]
    fn rank(&mut self, _: Place, _: &mut [u32]) -> usize {
        0
    }
}

/// Plans for a fleet on one map. Tables of the ways to goals are kept from call to call;
/// what a call answers does not depend on the calls before it.
#[derive(Debug)]
pub struct Lifelong {
    graph: Arc<Graph>,
    gradients: Gradients,
}

impl Lifelong {
    /// For a map. Tables of goals that nobody has any longer are kept as long as all together
    /// take no more than `table_bytes`; one is three bits per passable cell. For as many agents
    /// that labels of the map take less than their tables there are labels instead.
    pub fn new(graph: Arc<Graph>, table_bytes: u64) -> Self {
        let gradients = Gradients::new(&graph, table_bytes);
        Self { graph, gradients }
    }

    /// The map.
    pub fn graph(&self) -> &Arc<Graph> {
        &self.graph
    }

    /// Makes steps. In the plan no path goes on after its last move; agents that have
    /// visited all their goals make room for the others. Half of the time is for tables; under a window
    /// agents who have none then go where the ranking sends them, or where others push them, and the next
    /// call goes on with the tables.
    ///
    /// # Errors
    ///
    /// Starts or goals that are none, and goals that cannot be reached.
    pub fn run<R: Ranking>(
        &mut self,
        query: &Query<'_>,
        ranking: &mut R,
        watch: &mut dyn Watch,
    ) -> Result<(GridPlan, End), ProblemError> {
        let graph = &self.graph;
        if query.starts.len() != query.goals.len() {
            let (starts, goals) = (query.starts.len(), query.goals.len());
            let reason = format!("{starts} starts and {goals} lists of goals");
            return Err(ProblemError::Malformed { reason });
        }
        let starts = vertices_of(graph, query.starts, "start")?;
        let goals = goals_of(graph, query.goals)?;
        let mut fleet = Fleet {
            graph,
            gradients: &mut self.gradients,
            goals: &goals,
            stays: vec![false; starts.len()],
            next: vec![0; starts.len()],
            row: vec![NOTHING; starts.len()],
            distance: vec![0; starts.len()],
            ways: vec![0; starts.len()],
            arrived: vec![false; starts.len()],
            headings: query.headings,
            ahead: vec![NOWHERE; starts.len()],
            step: 0,
            late: false,
            ranking,
        };
        let run = fleet.run(query, &starts, watch);
        for row in fleet.row {
            if row != NOTHING {
                self.gradients.release(row);
            }
        }
        run
    }
}

/// A plan, and how good it is.
struct Attempt {
    /// Configurations one after the other.
    steps: Vec<Vertex>,
    score: i64,
    end: End,
}

/// A call under way.
struct Fleet<'a, R> {
    graph: &'a Graph,
    gradients: &'a mut Gradients,
    goals: &'a Lists<Vertex>,
    /// Agents that have to be at their last goal in the end.
    stays: Vec<bool>,
    /// Number of goals that each agent has visited.
    next: Vec<usize>,
    /// The table of the goal that an agent wants to reach, how far that is, and the
    /// directions that lead there from where the agent is.
    row: Vec<u32>,
    distance: Vec<u32>,
    ways: Vec<u8>,
    /// Agents that have come to a goal in the last step.
    arrived: Vec<bool>,
    /// Headings of the agents at the beginning.
    headings: Option<&'a [Heading]>,
    /// The direction in which each looks, or [`NOWHERE`].
    ahead: Vec<u8>,
    step: u32,
    /// True once there is no time for more tables.
    late: bool,
    ranking: &'a mut R,
}

impl<R: Ranking> Wishes for Fleet<'_, R> {
    #[inline]
    fn preference(&mut self, _: &Graph, agent: usize, _: Vertex) -> u8 {
        let (nearer, ahead) = (self.ways[agent], self.ahead[agent]);
        if ahead != NOWHERE && nearer >> ahead & 1 == 1 {
            nearer | (ahead + 1) << DIRECTIONS
        } else {
            nearer
        }
    }

    #[inline]
    fn rank(
        &mut self,
        graph: &Graph,
        agent: usize,
        here: Vertex,
        candidates: &mut [Vertex],
    ) -> usize {
        let mut cells = [0; DIRECTIONS + 1];
        let cells = &mut cells[..candidates.len()];
        for (cell, &v) in cells.iter_mut().zip(&*candidates) {
            *cell = graph.cell(v);
        }
        let place = self.place(agent, here);
        let refused = self.ranking.rank(place, cells);
        for (v, &cell) in candidates.iter_mut().zip(&*cells) {
            *v = graph.vertex(cell).unwrap_or(*v);
        }
        refused
    }
}

impl<R: Ranking> Will for Fleet<'_, R> {
    #[inline]
    fn nearer(&mut self, graph: &Graph, agent: usize, a: Vertex, b: Vertex) -> bool {
        let row = self.row[agent];
        row != NOTHING && self.gradients.nearer(graph, row, a, b)
    }

    fn willing(&mut self, graph: &Graph, agent: usize, a: Vertex, b: Vertex) -> bool {
        self.row[agent] == NOTHING || self.nearer(graph, agent, a, b)
    }

    fn rests(&self, agent: usize, v: Vertex) -> bool {
        let row = self.row[agent];
        row != NOTHING && self.next[agent] == self.of(agent).len() && self.gradients.goal(row) == v
    }
}

impl<'a, R: Ranking> Fleet<'a, R> {
    fn of(&self, agent: usize) -> &'a [Vertex] {
        &self.goals[agent]
    }

    /// Tells an agent where to go from `v`, when it begins or has moved there from a
    /// neighbour. Gives by how much it has come nearer to its goal.
    fn arrive(
        &mut self,
        agent: usize,
        before: Option<Vertex>,
        v: Vertex,
    ) -> Result<i64, ProblemError> {
        let graph = self.graph;
        let goals = self.of(agent);
        let mut progress = 0;
        if let Some(before) = before {
            let moved = direction_to(graph, before, v);
            if self.headings.is_some() {
                self.ahead[agent] = moved;
            }
            progress = self.gain(agent, moved);
            self.distance[agent] = self.distance[agent].saturating_add_signed(-progress);
        }
        let visited = self.next[agent];
        while goals.get(self.next[agent]) == Some(&v) {
            self.next[agent] += 1;
        }
        let row = self.row[agent];
        self.arrived[agent] = self.next[agent] > visited;
        if self.arrived[agent] || row == NOTHING {
            // Without a window an agent comes back to its last goal when it is pushed away.
            let wanted = match goals.get(self.next[agent]) {
                None if self.stays[agent] => goals.last(),
                wanted => wanted,
            };
            let known = wanted.filter(|goal| !self.late || self.gradients.is_kept(**goal));
            self.row[agent] = match known {
                Some(&goal) => self.gradients.hold(graph, goal),
                None => NOTHING,
            };
            if row != NOTHING {
                self.gradients.release(row);
            }
            if let Some(&goal) = wanted.filter(|_| known.is_none()) {
                self.distance[agent] = graph.manhattan(v, goal);
            }
            if let Some(&goal) = known {
                let way = self.gradients.distance(graph, self.row[agent], v);
                self.distance[agent] = way.ok_or_else(|| ProblemError::Unreachable {
                    agent,
                    from: graph.cell(v),
                    goal: graph.cell(goal),
                    limit: graph.len() as u32,
                })?;
            }
        }
        self.ways[agent] = match self.row[agent] {
            NOTHING => 0,
            row => {
                let distance = self.distance[agent];
                self.gradients.directions(graph, row, v, distance)
            }
        };
        Ok(i64::from(progress))
    }

    /// Distance by which a move in a direction brings an agent nearer to its goal.
    fn gain(&self, agent: usize, direction: u8) -> i32 {
        match self.row[agent] {
            NOTHING => 0,
            _ if self.ways[agent] >> direction & 1 == 1 => 1,
            _ => -1,
        }
    }

    /// True if an agent has nothing left to do at `v`.
    fn done(&self, agent: usize, v: Vertex) -> bool {
        let goals = self.of(agent);
        self.next[agent] == goals.len() && (!self.stays[agent] || goals.last() == Some(&v))
    }

    fn run(
        &mut self,
        query: &Query<'_>,
        starts: &[Vertex],
        watch: &mut dyn Watch,
    ) -> Result<(GridPlan, End), ProblemError> {
        let graph = self.graph;
        let agents = starts.len();
        if query.window.is_none() {
            let mut sharers = vec![0_u32; graph.len()];
            for agent in 0..agents {
                if let Some(&last) = self.of(agent).last() {
                    sharers[last as usize] += 1;
                }
            }
            for agent in 0..agents {
                let last = self.of(agent).last();
                self.stays[agent] = last.is_some_and(|&last| sharers[last as usize] == 1);
            }
        }
        let limit = match query.memory_limit {
            0 => u64::MAX,
            bytes => bytes,
        };
        watch.begin(2);
        let pause = &mut || watch.pause();
        if self.gradients.expect(graph, agents, limit, pause) == Expected::TooLarge {
            return Ok((plan_of(paths_of(&[starts]), graph), End::Memory));
        }
        let mut random = Random::new(query.seed, 0);
        let mut best = Attempt {
            steps: starts.to_vec(),
            score: i64::MIN,
            end: End::Stopped,
        };
        for retry in 0..=query.retries {
            // Up to a step of the best, and on from there.
            let kept = match retry {
                0 => 1,
                _ => 1 + random.below(best.steps.len() / agents.max(1)),
            };
            let kept = best.steps[..kept * agents].to_vec();
            let attempt = self.attempt(query, kept, &mut random, watch)?;
            let stopped = attempt.end == End::Stopped;
            if retry == 0 || attempt.end == End::Done && attempt.score > best.score {
                best = attempt;
            }
            if stopped || agents == 0 {
                break;
            }
        }
        let configurations: Vec<&[Vertex]> = best.steps.chunks_exact(agents.max(1)).collect();
        Ok((plan_of(paths_of(&configurations), graph), best.end))
    }

    /// Puts everybody at the start again. False when it was stopped. Under a window nobody waits for tables
    /// for longer than their share of the time.
    fn begin(
        &mut self,
        starts: &[Vertex],
        windowed: bool,
        watch: &mut dyn Watch,
    ) -> Result<bool, ProblemError> {
        self.step = 0;
        for (agent, &v) in starts.iter().enumerate() {
            let row = std::mem::replace(&mut self.row[agent], NOTHING);
            if row != NOTHING {
                self.gradients.release(row);
            }
            self.next[agent] = 0;
            self.ahead[agent] = self
                .headings
                .and_then(|headings| headings.get(agent))
                .map_or(NOWHERE, |heading| direction(*heading));
            // Each may need a table of its own, which takes a while on a large map.
            if windowed {
                self.late = self.late || watch.pause();
            } else if watch.stop() {
                return Ok(false);
            }
            self.arrive(agent, None, v)?;
        }
        Ok(!watch.stop())
    }

    /// Makes the given steps, and others from there to the end.
    fn attempt(
        &mut self,
        query: &Query<'_>,
        mut steps: Vec<Vertex>,
        random: &mut Random,
        watch: &mut dyn Watch,
    ) -> Result<Attempt, ProblemError> {
        let agents = self.row.len();
        let mut now = steps[..agents].to_vec();
        let mut score = 0;
        if !self.begin(&now, query.window.is_some(), watch)? {
            steps.truncate(agents);
            let end = End::Stopped;
            return Ok(Attempt { steps, score, end });
        }
        let kept = steps.len() / agents.max(1);
        for step in 1..kept {
            score += self.take(&mut now, &steps[step * agents..(step + 1) * agents])?;
        }
        let mut pibt = Pibt::new(self.graph, agents, query.swap, query.rings);
        // Equals keep the order that chance has given them.
        let mut order: Vec<u32> = (0..agents as u32).collect();
        random.shuffle(&mut order);
        let limit = query.window.map_or(query.step_limit, u64::from);
        let mut moved = 0;
        let mut urgency = vec![0; agents];
        let mut chosen = now.clone();
        let end = loop {
            if query.window.is_none() && (0..agents).all(|agent| self.done(agent, now[agent])) {
                break End::Done;
            }
            if u64::from(self.step) >= limit {
                break match query.window {
                    Some(_) => End::Done,
                    None => End::Steps,
                };
            }
            moved += agents * query.samples as usize;
            if moved >= PATIENCE {
                moved = 0;
                if !watch.begin(1) || watch.stop() {
                    break End::Stopped;
                }
            }
            match query.window {
                Some(_) => {
                    for agent in 0..agents {
                        urgency[agent] = self.urgency(agent, now[agent]);
                    }
                    order.sort_by_key(|&agent| urgency[agent as usize]);
                }
                // Priority grows while an agent is under way to a goal.
                None => order.sort_by_key(|&agent| {
                    let agent = agent as usize;
                    self.arrived[agent] || self.done(agent, now[agent])
                }),
            }
            pibt.load(&now, self);
            let mut most = i64::MIN;
            for _ in 0..query.samples.max(1) {
                // Without constraints every agent can at least stay or be moved away.
                if !pibt.sample(&order, &[], self, random) {
                    continue;
                }
                let gain = match query.samples {
                    0 | 1 => 0,
                    _ => self.progress(&now, pibt.step()),
                };
                if gain > most {
                    most = gain;
                    chosen.copy_from_slice(pibt.step());
                }
            }
            score += self.take(&mut now, &chosen)?;
            if query.window.is_none() {
                // What counts then is when everybody is done.
                let busy = (0..agents).filter(|&agent| !self.done(agent, now[agent]));
                score -= busy.count() as i64;
            }
            steps.extend_from_slice(&now);
            watch.ready();
        };
        Ok(Attempt { steps, score, end })
    }

    /// Sum of distances by which a step brings the agents nearer to their goals.
    fn progress(&self, now: &[Vertex], next: &[Vertex]) -> i64 {
        let moves = now.iter().zip(next).enumerate();
        moves
            .filter(|(_, (from, to))| from != to)
            .map(|(agent, (&from, &to))| self.gain(agent, direction_to(self.graph, from, to)))
            .map(i64::from)
            .sum()
    }

    /// Makes a step; gives what it is worth.
    fn take(&mut self, now: &mut [Vertex], next: &[Vertex]) -> Result<i64, ProblemError> {
        let mut progress = 0;
        for (agent, (here, &v)) in now.iter_mut().zip(next).enumerate() {
            self.arrived[agent] = false;
            if *here != v {
                let before = std::mem::replace(here, v);
                progress += self.arrive(agent, Some(before), v)?;
            }
        }
        self.step += 1;
        Ok(progress)
    }

    /// The nearest first, those who want nothing last.
    fn urgency(&mut self, agent: usize, v: Vertex) -> u32 {
        if self.next[agent] == self.of(agent).len() && self.row[agent] == NOTHING {
            return u32::MAX;
        }
        let place = self.place(agent, v);
        self.ranking.urgency(place, self.distance[agent])
    }

    fn place(&self, agent: usize, v: Vertex) -> Place {
        Place {
            step: self.step,
            agent,
            cell: self.graph.cell(v),
            heading: Some(self.ahead[agent]).filter(|ahead| *ahead != NOWHERE),
            visited: self.next[agent],
        }
    }
}

/// The direction from a vertex to its neighbour.
#[inline]
fn direction_to(graph: &Graph, from: Vertex, to: Vertex) -> u8 {
    let found = graph.around(from).iter().position(|u| *u == to);
    found.map_or(NOWHERE, |d| d as u8)
}
