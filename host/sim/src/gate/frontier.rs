//! How far agents may go, given how far all have come.

use super::graph::DependencyGraph;

const NONE: u32 = u32::MAX;

/// The state of an execution as far as the dependency graph is concerned: per
/// agent, the knot it has reached and the knot that it may go to.
///
/// Every agent waits for at most one other agent at a time, the one that its
/// first unmet dependency names, and is in that agent's list. So the state is a
/// few numbers per agent, and a step costs as much as there are agents that wait
/// for the one that made it.
#[derive(Debug, Clone)]
pub(super) struct Frontier {
    reached: Vec<u32>,
    released: Vec<u32>,
    /// How many dependencies of the agent are met.
    met: Vec<u32>,
    /// The first agent that waits for this one, and the next one after that.
    head: Vec<u32>,
    next: Vec<u32>,
}

impl Frontier {
    /// Everybody at the start.
    pub(super) fn new(graph: &DependencyGraph) -> Self {
        let agents = graph.agents();
        let mut frontier = Self {
            reached: vec![0; agents],
            released: vec![0; agents],
            met: vec![0; agents],
            head: vec![NONE; agents],
            next: vec![NONE; agents],
        };
        for agent in 0..agents {
            frontier.settle(graph, agent);
        }
        frontier
    }

    pub(super) fn reached(&self, agent: usize) -> u32 {
        self.reached[agent]
    }

    pub(super) fn released(&self, agent: usize) -> u32 {
        self.released[agent]
    }

    /// Index of the agent's first dependency that is not met.
    pub(super) fn met(&self, agent: usize) -> usize {
        self.met[agent] as usize
    }

    /// The agent has reached a knot. Tells of every agent that may go farther now,
    /// and to which knot.
    pub(super) fn reach(
        &mut self,
        graph: &DependencyGraph,
        agent: usize,
        knot: u32,
        mut tell: impl FnMut(u32, u32),
    ) {
        if knot <= self.reached[agent] {
            return;
        }
        self.reached[agent] = knot;
        let mut waiting = std::mem::replace(&mut self.head[agent], NONE);
        while waiting != NONE {
            let next = self.next[waiting as usize];
            if self.settle(graph, waiting as usize) {
                tell(waiting, self.released[waiting as usize]);
            }
            waiting = next;
        }
    }

    /// Passes over dependencies that are met, and enters the agent with the other
    /// one that it waits for. Whether it may go farther than before.
    fn settle(&mut self, graph: &DependencyGraph, agent: usize) -> bool {
        let waits = graph.waits(agent);
        let mut met = self.met[agent] as usize;
        while waits
            .get(met)
            .is_some_and(|wait| self.reached[wait.other as usize] >= wait.knot)
        {
            met += 1;
        }
        self.met[agent] = met as u32;
        let released = match waits.get(met) {
            Some(wait) => {
                let head = &mut self.head[wait.other as usize];
                self.next[agent] = std::mem::replace(head, agent as u32);
                wait.action - 1
            }
            None => graph.actions(agent) as u32,
        };
        std::mem::replace(&mut self.released[agent], released) < released
    }

    /// Lets everybody go as far as the dependencies allow. Whether all arrive,
    /// which they do exactly if the graph has no cycle: of agents that stand
    /// still, each waits for another one of them.
    pub(super) fn run(&mut self, graph: &DependencyGraph) -> bool {
        let agents = graph.agents();
        let mut ready: Vec<u32> = (0..agents as u32).rev().collect();
        while let Some(agent) = ready.pop() {
            let knot = self.released[agent as usize];
            self.reach(graph, agent as usize, knot, |other, _| ready.push(other));
        }
        (0..agents).all(|agent| self.reached(agent) as usize == graph.actions(agent))
    }
}
