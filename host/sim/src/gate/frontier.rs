//! Releases of agents, given the progress of all.

use super::graph::DependencyGraph;

const NONE: u32 = u32::MAX;

/// State of an execution in the dependency graph: per agent, the last reached and the
/// last released knot.
///
/// An agent waits for at most one other agent at a time, the one of its first unmet
/// dependency, and is in that agent's list of waiting agents. So the state is a few
/// numbers per agent, and a step costs time in proportion to the agents waiting for it.
#[derive(Debug, Clone)]
pub(super) struct Frontier {
    reached: Vec<u32>,
    released: Vec<u32>,
    /// Number of met dependencies per agent.
    met: Vec<u32>,
    /// Lists of waiting agents: the first agent that waits for this one, and the next one
    /// in the list of this agent.
    head: Vec<u32>,
    next: Vec<u32>,
}

impl Frontier {
    /// All agents at the start.
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

    /// Index of the agent's first unmet dependency.
    pub(super) fn met(&self, agent: usize) -> usize {
        self.met[agent] as usize
    }

    /// Records that the agent has reached a knot. Calls `tell` with each agent that is
    /// released farther, and the knot.
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

    /// Skips met dependencies, and enters the agent in the list of the one that it waits
    /// for. Returns true if its release has grown.
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

    /// Lets all agents advance as far as the dependencies allow. Returns true if all
    /// arrive, which they do exactly if the graph has no cycle: among deadlocked agents,
    /// each waits for another one of them.
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
