//! EPIBT: a few steps for all agents at once, by priority inheritance with backtracking over
//! *operations*, and large neighbourhood search on top.
//!
//! E. Yukhnevich, A. Andreychuk, "Enhancing PIBT via multi-action operations", arXiv 2511.09193
//! (2025).
//!
//! | paper | here |
//! | --- | --- |
//! | multi-action operation, of `ω` actions | `Operation`, of `D` cells; all of them: `operations::Maker` |
//! | operations of an agent, sorted by `h` | `Menu`, by `Operation::loss` |
//! | reservations of vertices and edges per step | `Team::held`, `Team::claim` |
//! | operations inherited from the step before | `Team::settle` |
//! | the loop over agents in order of priority | `Search::pass` |
//! | recursion of PIBT that displaces one agent per try | `Search::build`; each call is a `Frame` of its stack |
//! | re-visits of an agent, at most ten | `VISITS` |
//! | score of a step, to be large | `Search::loss`, to be small: the sum without what is the same for all steps |
//! | EPIBT+LNS | `Search::improve` |
//! | (not in the paper) parts of a large map are improved at the same time | `regions` |
//! | (not in the paper) rings of moves may be forbidden | `Search::closes_ring` |
//! | (not in the paper) agents step aside before dead ends | `Run::aside` |
//! | (not in the paper) goals after the next one | `operations::Aim` |
//!
//! This module makes one step of the planner. [`run`] makes one after the other, and tells agents
//! where they are.

mod aside;
pub(crate) mod operations;
mod regions;
pub mod run;

use std::sync::atomic::{AtomicU32, Ordering};

use fleetyard_plugin_spacetime::graph::{Graph, Vertex};
use fleetyard_plugin_spacetime::random::Random;

use self::regions::Zones;

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
    pub(crate) loss: i32,
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
struct Frame {
    agent: u32,
    /// The next of its candidates.
    next: u32,
    /// The agent that it displaces now.
    displaced: u32,
    /// The operation that it had before, as in [`Team::chosen`].
    before: u32,
}

/// Result of [`Search::build`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Built {
    /// Everybody has an operation, and it was accepted.
    Yes,
    /// It is as before.
    No,
    /// It is as before, because time is up.
    Stopped,
}

/// The operations of some agents that follow each other: of each its candidates, best first, then the
/// one that it has from the step before, and the one that is to wait.
#[derive(Debug, Default)]
pub(crate) struct Menu<const D: usize> {
    list: Vec<Operation<D>>,
    /// The first operation of each agent, and the end of the last agent's.
    first: Vec<u32>,
}

impl<const D: usize> Menu<D> {
    pub(crate) fn clear(&mut self) {
        self.list.clear();
        self.first.clear();
        self.first.push(0);
    }

    /// The operations of the next agent: `all` adds its candidates to the list.
    pub(crate) fn add(
        &mut self,
        all: impl FnOnce(&mut Vec<Operation<D>>),
        kept: Operation<D>,
        wait: Operation<D>,
    ) {
        all(&mut self.list);
        self.list.extend([kept, wait]);
        self.first.push(self.list.len() as u32);
    }
}

/// Agents of a [`Menu`].
pub(crate) const MENU: usize = 256;

/// All agents with the operations that they have now, which do not collide.
#[derive(Debug)]
pub(crate) struct Team<const D: usize> {
    /// True if agents may move round in a ring at the same step, each into the cell that the next
    /// one leaves.
    rings: bool,
    starts: Vec<Vertex>,
    /// The agent in each vertex at first.
    occupant: Vec<u32>,
    /// The agent in each vertex after each step: `D` entries a vertex. Searches in different regions
    /// write different ones.
    held: Vec<AtomicU32>,
    /// Operations of all agents, [`MENU`] in each.
    menus: Vec<Menu<D>>,
    /// The place of each agent's operation in its menu.
    chosen: Vec<AtomicU32>,
    /// Agents in order of priority, the place of each in it, and what its loss counts.
    order: Vec<u32>,
    rank: Vec<u32>,
    weight: Vec<i64>,
    /// The regions, if there is more than one, and that of each agent that stays in it whatever it does;
    /// [`NOBODY`] for an agent that does not.
    zones: Option<Zones>,
    within: Vec<u32>,
}

impl<const D: usize> Team<D> {
    pub(crate) fn new(graph: &Graph, agents: usize, rings: bool) -> Self {
        let nobody = |count| (0..count).map(|_| AtomicU32::new(NOBODY)).collect();
        Self {
            rings,
            starts: Vec::with_capacity(agents),
            occupant: vec![NOBODY; graph.len() + 1],
            held: nobody((graph.len() + 1) * D),
            menus: (0..agents.div_ceil(MENU))
                .map(|_| Menu::default())
                .collect(),
            chosen: nobody(agents),
            order: (0..agents as u32).collect(),
            rank: vec![0; agents],
            weight: vec![0; agents],
            zones: None,
            within: vec![0; agents],
        }
    }

    /// Begins a step: where everybody is, and how urgent it is to let each go first, the least
    /// first. Equals keep the order that they had in the last step.
    pub(crate) fn begin(&mut self, starts: &[Vertex], urgency: &[u64]) {
        for (agent, &v) in self.starts.iter().enumerate() {
            self.occupant[v as usize] = NOBODY;
            self.take(agent as u32);
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
        self.zones = None;
        self.within.fill(0);
    }

    /// Shuffles agents that are equally urgent.
    pub(crate) fn shuffle(&mut self, random: &mut Random) {
        random.shuffle(&mut self.order);
    }

    /// The menus of all agents, which are to be filled after [`Team::begin`].
    pub(crate) fn menus(&mut self) -> &mut Vec<Menu<D>> {
        &mut self.menus
    }

    /// The operation that an agent has.
    #[inline]
    pub(crate) fn chosen(&self, agent: u32) -> &Operation<D> {
        let place = self.chosen[agent as usize].load(Ordering::Relaxed);
        &self.menus[agent as usize / MENU].list[place as usize]
    }

    /// The places in its menu between which the operations of an agent are.
    #[inline]
    fn places(&self, agent: u32) -> (&Menu<D>, usize, usize) {
        let menu = &self.menus[agent as usize / MENU];
        let at = agent as usize % MENU;
        (menu, menu.first[at] as usize, menu.first[at + 1] as usize)
    }

    /// The candidates of an agent.
    #[inline]
    fn of(&self, agent: u32) -> &[Operation<D>] {
        let (menu, first, end) = self.places(agent);
        &menu.list[first..end - 2]
    }

    #[inline]
    fn at(&self, v: Vertex, step: usize) -> u32 {
        self.held[v as usize * D + step].load(Ordering::Relaxed)
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

    /// The region of a vertex.
    #[inline]
    fn region(&self, v: Vertex) -> u32 {
        self.zones.as_ref().map_or(0, |zones| zones.of(v))
    }

    /// True if an agent would move round in a ring with others, where nobody may; or might, with
    /// some of another region.
    fn closes_ring(&self, agent: u32, operation: &Operation<D>) -> bool {
        if self.rings {
            return false;
        }
        let mut from = self.starts[agent as usize];
        let region = self.region(from);
        for (step, &v) in operation.cells.iter().enumerate() {
            let mut at = v;
            while at != from {
                if self.region(at) != region {
                    return true;
                }
                let ahead = self.before(at, step);
                if ahead == NOBODY {
                    break;
                }
                let next = self.chosen(ahead).cells[step];
                if self.region(next) != region {
                    return true;
                }
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

    /// Gives an agent an operation of its menu.
    #[inline]
    fn put(&self, agent: u32, place: u32) {
        self.chosen[agent as usize].store(place, Ordering::Relaxed);
        for (step, &v) in self.chosen(agent).cells.iter().enumerate() {
            debug_assert_eq!(self.at(v, step), NOBODY);
            self.held[v as usize * D + step].store(agent, Ordering::Relaxed);
        }
    }

    /// Takes an agent's operation away.
    #[inline]
    fn take(&self, agent: u32) {
        for (step, &v) in self.chosen(agent).cells.iter().enumerate() {
            debug_assert_eq!(self.at(v, step), agent);
            self.held[v as usize * D + step].store(NOBODY, Ordering::Relaxed);
        }
    }

    /// Gives everybody the operation of the step before, or lets them wait where these collide.
    pub(crate) fn settle(&mut self) {
        let agents = self.starts.len();
        // The places of the last step mean nothing in these menus.
        for agent in 0..agents as u32 {
            let (_, _, end) = self.places(agent);
            *self.chosen[agent as usize].get_mut() = end as u32 - 1;
        }
        let mut waiting = vec![false; agents];
        let mut left: Vec<u32> = self.order.iter().rev().copied().collect();
        while let Some(agent) = left.pop() {
            let at = agent as usize;
            let (menu, _, end) = self.places(agent);
            if !waiting[at] {
                let kept = &menu.list[end - 2];
                if self.claim(agent, kept) == Claim::Free && !self.closes_ring(agent, kept) {
                    self.put(agent, end as u32 - 2);
                    continue;
                }
                waiting[at] = true;
            }
            // Starts differ, so that of those in the way nobody waits already.
            for step in 0..D {
                let other = self.at(self.starts[at], step);
                if other != NOBODY {
                    self.take(other);
                    waiting[other as usize] = true;
                    left.push(other);
                }
            }
            self.put(agent, end as u32 - 1);
        }
    }
}

/// Memory of searches of one thread.
#[derive(Debug)]
pub(crate) struct Search {
    /// The search that visited an agent last, and how often it did; and the search that has given
    /// it its operation, or is about to.
    visited: Vec<(u32, u8)>,
    fixed: Vec<u32>,
    number: u32,
    stack: Vec<Frame>,
    /// Sum of losses by weight, less what it was at the beginning.
    loss: i64,
    /// The region of the agents that may be displaced.
    region: u32,
}

impl Search {
    pub(crate) fn new(agents: usize) -> Self {
        Self {
            visited: vec![(0, 0); agents],
            fixed: vec![0; agents],
            number: 0,
            stack: Vec::new(),
            loss: 0,
            region: 0,
        }
    }

    #[inline]
    fn put<const D: usize>(&mut self, team: &Team<D>, agent: u32, place: u32) {
        team.put(agent, place);
        self.loss += team.weight[agent as usize] * i64::from(team.chosen(agent).loss);
    }

    /// Gives an agent back the operation that was taken from it.
    #[inline]
    fn put_back<const D: usize>(&mut self, team: &Team<D>, agent: u32) {
        self.put(
            team,
            agent,
            team.chosen[agent as usize].load(Ordering::Relaxed),
        );
    }

    #[inline]
    fn take<const D: usize>(&mut self, team: &Team<D>, agent: u32) {
        team.take(agent);
        self.loss -= team.weight[agent as usize] * i64::from(team.chosen(agent).loss);
    }

    /// Lets everybody choose, in order of priority. False when it was stopped; the operations are
    /// valid all the same.
    pub(crate) fn pass<const D: usize>(
        &mut self,
        team: &Team<D>,
        stop: &mut dyn FnMut() -> bool,
    ) -> bool {
        self.number += 1;
        self.region = 0;
        for (at, &agent) in (0..).zip(&team.order) {
            if at % PATIENCE == 0 && stop() {
                return false;
            }
            // Whoever was displaced has chosen already.
            if self.fixed[agent as usize] == self.number {
                continue;
            }
            if self.build(team, agent, Some(at), stop) == Built::Stopped {
                return false;
            }
        }
        true
    }

    /// Tries so often to make the step better, beginning with one of these agents of a region at
    /// random; as often as there is time for without a number.
    fn improve<const D: usize>(
        &mut self,
        team: &Team<D>,
        (region, agents): (u32, &[u32]),
        tries: Option<u64>,
        random: &mut Random,
        stop: &mut dyn FnMut() -> bool,
    ) {
        self.region = region;
        let mut tried: u64 = 0;
        while !agents.is_empty() && tries.is_none_or(|tries| tried < tries) {
            if tried.is_multiple_of(PATIENCE.into()) && stop() {
                return;
            }
            tried += 1;
            let agent = agents[random.below(agents.len())];
            self.number += 1;
            if self.build(team, agent, None, stop) == Built::Stopped {
                return;
            }
        }
    }

    /// Gives an agent the best operation for which others, one at a time, find another one. With
    /// an own priority only those of lower priority are displaced, and any change is accepted;
    /// without, anybody is, and only a change for the better, or for no worse.
    fn build<const D: usize>(
        &mut self,
        team: &Team<D>,
        agent: u32,
        rank: Option<u32>,
        stop: &mut dyn FnMut() -> bool,
    ) -> Built {
        let most = if rank.is_some() { i64::MAX } else { self.loss };
        self.stack.clear();
        self.take(team, agent);
        self.enter(team, agent);
        let mut entered: u32 = 0;
        let mut lost = false;
        while let Some(&top) = self.stack.last() {
            let Frame { agent, before, .. } = top;
            let mut next = top.next as usize;
            if std::mem::take(&mut lost) {
                self.take(team, agent);
                self.put_back(team, top.displaced);
            }
            let count = team.of(agent).len();
            let mut displaced = NOBODY;
            while next < count && displaced == NOBODY {
                displaced = self.attempt(team, agent, next, rank, most);
                next += 1;
                if displaced == agent {
                    return Built::Yes;
                }
            }
            if displaced == NOBODY {
                team.chosen[agent as usize].store(before, Ordering::Relaxed);
                self.fixed[agent as usize] = 0;
                self.stack.pop();
                if self.stack.is_empty() {
                    self.put(team, agent, before);
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
                self.give_up(team, displaced);
                return if stopped { Built::Stopped } else { Built::No };
            }
            self.enter(team, displaced);
        }
        Built::No
    }

    /// Gives an agent one of its candidates, if that can be. Gives the agent that has lost its
    /// operation thereby; the agent itself if nobody has and the change is accepted, since the sum of
    /// losses is at most `most`; [`NOBODY`] if nothing has changed.
    #[inline]
    fn attempt<const D: usize>(
        &mut self,
        team: &Team<D>,
        agent: u32,
        number: usize,
        rank: Option<u32>,
        most: i64,
    ) -> u32 {
        let (menu, first, _) = team.places(agent);
        let place = first + number;
        let operation = &menu.list[place];
        let other = match team.claim(agent, operation) {
            Claim::Several => return NOBODY,
            Claim::Free => agent,
            Claim::One(other) => other,
        };
        let loss = self.loss + team.weight[agent as usize] * i64::from(operation.loss);
        let gain = match other {
            _ if other == agent => 0,
            _ if !self.may_displace(team, other, rank) => return NOBODY,
            _ => most_gain(team, other),
        };
        if loss - gain > most {
            return NOBODY;
        }
        if other != agent {
            self.take(team, other);
        }
        if team.closes_ring(agent, operation) {
            if other != agent {
                self.put_back(team, other);
            }
            return NOBODY;
        }
        self.put(team, agent, place as u32);
        other
    }

    /// Undoes all that is under way; `displaced` has no operation.
    fn give_up<const D: usize>(&mut self, team: &Team<D>, displaced: u32) {
        let mut last = displaced;
        while let Some(frame) = self.stack.pop() {
            self.take(team, frame.agent);
            self.put_back(team, last);
            team.chosen[frame.agent as usize].store(frame.before, Ordering::Relaxed);
            last = frame.agent;
        }
        self.put_back(team, last);
    }

    fn may_displace<const D: usize>(&self, team: &Team<D>, other: u32, rank: Option<u32>) -> bool {
        let at = other as usize;
        if team.within[at] != self.region
            || self.fixed[at] == self.number
            || rank.is_some_and(|rank| team.rank[at] <= rank)
        {
            return false;
        }
        let (search, visits) = self.visited[at];
        search != self.number || visits < VISITS
    }

    fn enter<const D: usize>(&mut self, team: &Team<D>, agent: u32) {
        let at = agent as usize;
        let (search, visits) = self.visited[at];
        let visits = if search == self.number { visits } else { 0 };
        self.visited[at] = (self.number, visits + 1);
        self.fixed[at] = self.number;
        self.stack.push(Frame {
            agent,
            next: 0,
            displaced: NOBODY,
            before: team.chosen[at].load(Ordering::Relaxed),
        });
    }
}

/// The most by which an agent could make the sum of losses smaller.
fn most_gain<const D: usize>(team: &Team<D>, agent: u32) -> i64 {
    let chosen = team.chosen(agent).loss;
    let best = team.of(agent).first().map_or(chosen, |best| best.loss);
    team.weight[agent as usize] * i64::from(chosen - best)
}
