//! EPIBT: a few steps for all agents at once, by priority inheritance with backtracking over
//! *operations*, and large neighbourhood search on top.
//!
//! E. Yukhnevich, A. Andreychuk, "Enhancing PIBT via multi-action operations", arXiv 2511.09193
//! (2025).
//!
//! | paper | here |
//! | --- | --- |
//! | multi-action operation, of `ω` actions | `Operation`, of `D` cells; all of them: `operations::Maker` |
//! | operations of an agent, sorted by `h` | `Team::candidates`, by `Operation::loss` |
//! | reservations of vertices and edges per step | `Team::held`, `Team::claim` |
//! | operations inherited from the step before | `Team::settle` |
//! | the loop over agents in order of priority | `Team::pass` |
//! | recursion of PIBT that displaces one agent per try | `Team::build`; each call is a `Frame` of its stack |
//! | re-visits of an agent, at most ten | `VISITS` |
//! | score of a step, to be large | `Team::loss`, to be small: the sum without what is the same for all steps |
//! | EPIBT+LNS | `Team::improve` |
//! | (not in the paper) rings of moves may be forbidden | `Team::closes_ring` |
//! | (not in the paper) goals after the next one | `operations::Aim` |
//!
//! This module makes one step of the planner. [`run`] makes one after the other, and tells agents
//! where they are.

pub(crate) mod operations;
pub mod run;

use fleetyard_plugin_spacetime::graph::{Graph, Vertex};
use fleetyard_plugin_spacetime::random::Random;

/// No agent.
const NOBODY: u32 = u32::MAX;
/// Times that an agent may be displaced while one place is looked for.
const VISITS: u8 = 10;
/// Agents displaced between two looks at the clock.
const PATIENCE: u32 = 32;
/// Agents displaced in a try of the large neighbourhood search.
const EFFORT: u32 = 100;
/// The weight of the first agent.
const WHOLE: i64 = 1 << 10;

/// The cells where an agent is after each of the next steps, and what that leaves to be done.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Operation<const D: usize> {
    pub(crate) cells: [Vertex; D],
    /// Cost of its steps and of the way from its end on, in units of which the least preference
    /// among equals is 1.
    pub(crate) loss: i64,
}

/// Agents that stand against an operation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Claim {
    Free,
    One(u32),
    Several,
}

/// An agent that tries its operations, waiting for the one that it displaces.
#[derive(Debug, Clone, Copy)]
struct Frame<const D: usize> {
    agent: u32,
    /// The next of its candidates.
    next: u32,
    /// The agent that it displaces now.
    displaced: u32,
    /// The operation that it had before.
    before: Operation<D>,
}

/// Result of [`Team::build`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Built {
    /// Everybody has an operation, and it was accepted.
    Yes,
    /// It is as before.
    No,
    /// It is as before, because time is up.
    Stopped,
}

/// All agents with the operations that they have now, which do not collide.
#[derive(Debug)]
pub(crate) struct Team<const D: usize> {
    /// True if agents may move round in a ring at the same step, each into the cell that the next
    /// one leaves.
    rings: bool,
    starts: Vec<Vertex>,
    /// The agent in each vertex at first.
    occupant: Vec<u32>,
    /// The agent in each vertex after each step: `D` entries a vertex.
    held: Vec<u32>,
    chosen: Vec<Operation<D>>,
    /// Operations of all agents, best first; those of agent `i` are from `first[i]` up to but not
    /// including `first[i + 1]`.
    candidates: Vec<Operation<D>>,
    first: Vec<u32>,
    /// Agents in order of priority, the place of each in it, and what its loss counts.
    order: Vec<u32>,
    rank: Vec<u32>,
    weight: Vec<i64>,
    /// Sum of losses by weight.
    loss: i64,
    /// The search that visited an agent last, and how often it did; and the search that has given
    /// it its operation, or is about to.
    visited: Vec<(u32, u8)>,
    fixed: Vec<u32>,
    search: u32,
    stack: Vec<Frame<D>>,
}

impl<const D: usize> Team<D> {
    pub(crate) fn new(graph: &Graph, agents: usize, rings: bool) -> Self {
        let nowhere = Operation {
            cells: [graph.wall(); D],
            loss: 0,
        };
        Self {
            rings,
            starts: Vec::with_capacity(agents),
            occupant: vec![NOBODY; graph.len() + 1],
            held: vec![NOBODY; (graph.len() + 1) * D],
            chosen: vec![nowhere; agents],
            candidates: Vec::new(),
            first: vec![0; agents + 1],
            order: (0..agents as u32).collect(),
            rank: vec![0; agents],
            weight: vec![0; agents],
            loss: 0,
            visited: vec![(0, 0); agents],
            fixed: vec![0; agents],
            search: 0,
            stack: Vec::new(),
        }
    }

    /// Begins a step: where everybody is, and how urgent it is to let each go first, the least
    /// first. Equals keep the order that they had in the last step.
    pub(crate) fn begin(&mut self, starts: &[Vertex], urgency: &[u64]) {
        for &v in &self.starts {
            self.occupant[v as usize] = NOBODY;
        }
        self.starts.clear();
        self.starts.extend_from_slice(starts);
        for (agent, &v) in (0..).zip(starts) {
            self.occupant[v as usize] = agent;
        }
        self.order.sort_by_key(|&agent| urgency[agent as usize]);
        let agents = starts.len() as i64;
        for (rank, &agent) in (0..).zip(&self.order) {
            self.rank[agent as usize] = rank;
            let share = (agents - i64::from(rank)) * WHOLE / agents;
            self.weight[agent as usize] = share * share / WHOLE;
        }
        self.candidates.clear();
    }

    /// Shuffles agents that are equally urgent.
    pub(crate) fn shuffle(&mut self, random: &mut Random) {
        random.shuffle(&mut self.order);
    }

    /// The list to which the operations of the agents are added, of one after the other.
    pub(crate) fn candidates(&mut self) -> &mut Vec<Operation<D>> {
        &mut self.candidates
    }

    /// The operations of an agent end there in the list.
    pub(crate) fn end_candidates(&mut self, agent: usize, end: usize) {
        self.first[agent + 1] = end as u32;
    }

    /// The operation that an agent has.
    pub(crate) fn chosen(&self, agent: usize) -> &Operation<D> {
        &self.chosen[agent]
    }

    #[inline]
    fn of(&self, agent: u32) -> &[Operation<D>] {
        let agent = agent as usize;
        &self.candidates[self.first[agent] as usize..self.first[agent + 1] as usize]
    }

    #[inline]
    fn at(&self, v: Vertex, step: usize) -> u32 {
        self.held[v as usize * D + step]
    }

    /// The agent in a cell before a step.
    #[inline]
    fn before(&self, v: Vertex, step: usize) -> u32 {
        if step == 0 {
            self.occupant[v as usize]
        } else {
            self.at(v, step - 1)
        }
    }

    /// The agents against an operation of an agent that has none now.
    #[inline]
    fn claim(&self, agent: u32, operation: &Operation<D>) -> Claim {
        let mut other = NOBODY;
        let mut from = self.starts[agent as usize];
        for (step, &v) in operation.cells.iter().enumerate() {
            let there = self.at(v, step);
            if there != NOBODY {
                if other != NOBODY && other != there {
                    return Claim::Several;
                }
                other = there;
            }
            if v != from {
                let ahead = self.before(v, step);
                if ahead != NOBODY && self.at(from, step) == ahead {
                    if other != NOBODY && other != ahead {
                        return Claim::Several;
                    }
                    other = ahead;
                }
            }
            from = v;
        }
        if other == NOBODY {
            Claim::Free
        } else {
            Claim::One(other)
        }
    }

    /// True if an agent would move round in a ring with others, where nobody may.
    fn closes_ring(&self, agent: u32, operation: &Operation<D>) -> bool {
        if self.rings {
            return false;
        }
        let mut from = self.starts[agent as usize];
        for (step, &v) in operation.cells.iter().enumerate() {
            let mut at = v;
            while at != from {
                let ahead = self.before(at, step);
                if ahead == NOBODY {
                    break;
                }
                let next = self.chosen[ahead as usize].cells[step];
                // One that has no operation now is nowhere after its start.
                if next == at || self.at(next, step) != ahead {
                    break;
                }
                at = next;
                if at == from {
                    return true;
                }
            }
            from = v;
        }
        false
    }

    #[inline]
    fn add(&mut self, agent: u32, operation: Operation<D>) {
        for (step, &v) in operation.cells.iter().enumerate() {
            debug_assert_eq!(self.at(v, step), NOBODY);
            self.held[v as usize * D + step] = agent;
        }
        self.loss += self.weight[agent as usize] * operation.loss;
        self.chosen[agent as usize] = operation;
    }

    #[inline]
    fn remove(&mut self, agent: u32) {
        let operation = &self.chosen[agent as usize];
        for (step, &v) in operation.cells.iter().enumerate() {
            debug_assert_eq!(self.held[v as usize * D + step], agent);
            self.held[v as usize * D + step] = NOBODY;
        }
        self.loss -= self.weight[agent as usize] * operation.loss;
    }

    /// Gives everybody an operation of the step before, or lets them wait where these collide.
    pub(crate) fn settle(&mut self, kept: &[Operation<D>], waits: &[Operation<D>]) {
        self.held.fill(NOBODY);
        self.loss = 0;
        let agents = self.starts.len();
        let mut waiting = vec![false; agents];
        let mut left: Vec<u32> = self.order.iter().rev().copied().collect();
        while let Some(agent) = left.pop() {
            let at = agent as usize;
            if !waiting[at] {
                let free = self.claim(agent, &kept[at]) == Claim::Free;
                if free && !self.closes_ring(agent, &kept[at]) {
                    self.add(agent, kept[at]);
                    continue;
                }
                waiting[at] = true;
            }
            // Starts differ, so that of those in the way nobody waits already.
            for step in 0..D {
                let other = self.at(self.starts[at], step);
                if other != NOBODY {
                    self.remove(other);
                    waiting[other as usize] = true;
                    left.push(other);
                }
            }
            self.add(agent, waits[at]);
        }
    }

    /// Lets everybody choose, in order of priority. False when it was stopped; the operations are
    /// valid all the same.
    pub(crate) fn pass(&mut self, stop: &mut dyn FnMut() -> bool) -> bool {
        self.search += 1;
        for at in 0..self.order.len() {
            if (at as u32).is_multiple_of(PATIENCE) && stop() {
                return false;
            }
            let agent = self.order[at];
            // Whoever was displaced has chosen already.
            if self.fixed[agent as usize] == self.search {
                continue;
            }
            if self.build(agent, Some(at as u32), stop) == Built::Stopped {
                return false;
            }
        }
        true
    }

    /// Tries so often to make the step better, beginning with an agent at random; as often as
    /// there is time for without a number.
    pub(crate) fn improve(
        &mut self,
        tries: Option<u64>,
        random: &mut Random,
        stop: &mut dyn FnMut() -> bool,
    ) {
        let agents = self.starts.len();
        let mut tried: u64 = 0;
        while agents > 0 && tries.is_none_or(|tries| tried < tries) {
            if tried.is_multiple_of(PATIENCE.into()) && stop() {
                return;
            }
            tried += 1;
            let agent = random.below(agents) as u32;
            self.search += 1;
            if self.build(agent, None, stop) == Built::Stopped {
                return;
            }
        }
    }

    /// Gives an agent the best operation for which others, one at a time, find another one. With
    /// an own priority only those of lower priority are displaced, and any change is accepted;
    /// without, anybody is, and only a change for the better, or for no worse.
    fn build(&mut self, agent: u32, rank: Option<u32>, stop: &mut dyn FnMut() -> bool) -> Built {
        let most = if rank.is_some() { i64::MAX } else { self.loss };
        self.stack.clear();
        self.enter(agent);
        let mut entered: u32 = 0;
        let mut lost = false;
        while let Some(&top) = self.stack.last() {
            let Frame { agent, before, .. } = top;
            let mut next = top.next as usize;
            if std::mem::take(&mut lost) {
                self.remove(agent);
                let displaced = top.displaced;
                self.add(displaced, self.chosen[displaced as usize]);
            }
            let count = self.of(agent).len();
            let mut displaced = NOBODY;
            while next < count && displaced == NOBODY {
                displaced = self.attempt(agent, next, rank, most);
                next += 1;
                if displaced == agent {
                    return Built::Yes;
                }
            }
            if displaced == NOBODY {
                self.chosen[agent as usize] = before;
                self.fixed[agent as usize] = 0;
                self.stack.pop();
                if self.stack.is_empty() {
                    self.add(agent, before);
                }
                lost = true;
                continue;
            }
            if let Some(top) = self.stack.last_mut() {
                top.next = next as u32;
                top.displaced = displaced;
            }
            entered += 1;
            let stopped = entered.is_multiple_of(PATIENCE) && stop();
            if stopped || rank.is_none() && entered == EFFORT {
                self.give_up(displaced);
                return if stopped { Built::Stopped } else { Built::No };
            }
            self.enter_displaced(displaced);
        }
        Built::No
    }

    /// Gives an agent one of its candidates, if that can be. Gives the agent that has lost its
    /// operation thereby; the agent itself if nobody has and the change is accepted, since the sum of
    /// losses is at most `most`; [`NOBODY`] if nothing has changed.
    #[inline]
    fn attempt(&mut self, agent: u32, number: usize, rank: Option<u32>, most: i64) -> u32 {
        let operation = &self.of(agent)[number];
        let other = match self.claim(agent, operation) {
            Claim::Several => return NOBODY,
            Claim::Free => agent,
            Claim::One(other) => other,
        };
        let operation = *operation;
        let loss = self.loss + self.weight[agent as usize] * operation.loss;
        let gain = match other {
            _ if other == agent => 0,
            _ if !self.may_displace(other, rank) => return NOBODY,
            _ => self.most_gain(other),
        };
        if loss - gain > most {
            return NOBODY;
        }
        if other != agent {
            self.remove(other);
        }
        if self.closes_ring(agent, &operation) {
            if other != agent {
                self.add(other, self.chosen[other as usize]);
            }
            return NOBODY;
        }
        self.add(agent, operation);
        other
    }

    /// The most by which an agent could make the sum of losses smaller.
    fn most_gain(&self, agent: u32) -> i64 {
        let chosen = self.chosen[agent as usize].loss;
        let best = self.of(agent).first().map_or(chosen, |best| best.loss);
        self.weight[agent as usize] * (chosen - best)
    }

    /// Undoes all that is under way; `displaced` has no operation.
    fn give_up(&mut self, displaced: u32) {
        let mut last = displaced;
        while let Some(frame) = self.stack.pop() {
            self.remove(frame.agent);
            self.add(last, self.chosen[last as usize]);
            self.chosen[frame.agent as usize] = frame.before;
            last = frame.agent;
        }
        self.add(last, self.chosen[last as usize]);
    }

    fn may_displace(&self, other: u32, rank: Option<u32>) -> bool {
        let at = other as usize;
        if self.fixed[at] == self.search || rank.is_some_and(|rank| self.rank[at] <= rank) {
            return false;
        }
        let (search, visits) = self.visited[at];
        search != self.search || visits < VISITS
    }

    fn enter(&mut self, agent: u32) {
        self.remove(agent);
        self.enter_displaced(agent);
    }

    fn enter_displaced(&mut self, agent: u32) {
        let at = agent as usize;
        let (search, visits) = self.visited[at];
        let visits = if search == self.search { visits } else { 0 };
        self.visited[at] = (self.search, visits + 1);
        self.fixed[at] = self.search;
        self.stack.push(Frame {
            agent,
            next: 0,
            displaced: NOBODY,
            before: self.chosen[at],
        });
    }
}
