//! The state of a gated execution: what robots have done and may do, and the
//! messages between them and the server that knows the graph.

use std::collections::BTreeMap;

use super::frontier::Frontier;
use super::graph::DependencyGraph;
use crate::noise::{MessageNoise, Messages};

/// Who may go how far, while a plan is executed by order.
///
/// Robots report the knots that they have reached, the server passes on which
/// actions that releases. All messages are cumulative ("up to here"), so that a
/// later one stands for all before it, and each is sent again in every period
/// until the other side has it: losses delay an execution, and change nothing
/// else. Time advances in blocks of one period each; what robots do within a
/// block reaches the server at the end of it.
///
/// The state depends on the graph, the reports and the seed alone, not on the
/// order in which reports come within a block.
#[derive(Debug, Clone)]
pub struct Gates {
    graph: DependencyGraph,
    /// What the server knows and grants.
    server: Frontier,
    /// What robots have done, and know that they may do.
    reached: Vec<u32>,
    released: Vec<u32>,
    /// Agents with something that the other side does not have yet, and marks of
    /// who is among them.
    reports: Outbox,
    releases: Outbox,
    network: Option<Network>,
    finished: usize,
}

/// Agents whose state has still to get to the other side.
#[derive(Debug, Clone, Default)]
struct Outbox {
    agents: Vec<u32>,
    waits: Vec<bool>,
}

impl Outbox {
    fn new(agents: usize) -> Self {
        Self {
            agents: Vec::new(),
            waits: vec![false; agents],
        }
    }

    fn add(&mut self, agent: u32) {
        if !std::mem::replace(&mut self.waits[agent as usize], true) {
            self.agents.push(agent);
        }
    }

    /// Keeps the agents that still wait, in ascending order.
    fn retain(&mut self, mut still: impl FnMut(u32) -> bool) {
        self.agents.sort_unstable();
        let waits = &mut self.waits;
        self.agents.retain(|agent| {
            let keep = still(*agent);
            waits[*agent as usize] = keep;
            keep
        });
    }
}

/// Messages under way.
#[derive(Debug, Clone)]
struct Network {
    noise: MessageNoise,
    /// By block of arrival: agents and the knots that they report, or that they
    /// are released to.
    reports: BTreeMap<u64, Vec<(u32, u32)>>,
    releases: BTreeMap<u64, Vec<(u32, u32)>>,
}

impl Gates {
    /// All robots at the start of their routes, knowing what they may do without
    /// waiting for anybody; messages take no time.
    pub fn new(graph: DependencyGraph) -> Self {
        let agents = graph.agents();
        let server = Frontier::new(&graph);
        let released = (0..agents).map(|agent| server.released(agent)).collect();
        let finished = (0..agents).filter(|agent| graph.actions(*agent) == 0);
        Self {
            finished: finished.count(),
            reached: vec![0; agents],
            released,
            reports: Outbox::new(agents),
            releases: Outbox::new(agents),
            network: None,
            server,
            graph,
        }
    }

    /// The same with messages that are late or lost. A block takes `period_s`
    /// seconds, a positive number.
    pub fn with_messages(
        graph: DependencyGraph,
        messages: &Messages,
        seed: u64,
        period_s: f64,
    ) -> Self {
        let mut gates = Self::new(graph);
        if !messages.is_none() {
            gates.network = Some(Network {
                noise: MessageNoise::new(messages, seed, period_s),
                reports: BTreeMap::new(),
                releases: BTreeMap::new(),
            });
        }
        gates
    }

    /// The graph, whose numbers of actions and knots everything here is in.
    pub fn graph(&self) -> &DependencyGraph {
        &self.graph
    }

    /// The robot has reached a knot of its route. Knots that it had reached
    /// before say nothing new.
    pub fn done(&mut self, agent: usize, knot: usize) {
        let last = self.graph.actions(agent) as u32;
        let knot = u32::try_from(knot).map_or(last, |knot| knot.min(last));
        if knot > self.reached[agent] {
            self.reached[agent] = knot;
            self.finished += usize::from(knot == last);
            self.reports.add(agent as u32);
        }
    }

    /// Exchanges messages at the beginning of a block. Blocks are exchanged in
    /// order, each once.
    pub fn exchange(&mut self, block: u64) {
        let Self {
            graph,
            server,
            reached,
            released,
            reports,
            releases,
            network,
            ..
        } = self;
        let Some(network) = network else {
            for agent in reports.agents.drain(..) {
                reports.waits[agent as usize] = false;
                server.reach(graph, agent as usize, reached[agent as usize], |other| {
                    releases.add(other);
                });
            }
            for agent in releases.agents.drain(..) {
                releases.waits[agent as usize] = false;
                released[agent as usize] = server.released(agent as usize);
            }
            return;
        };
        let Network {
            noise,
            reports: reports_due,
            releases: releases_due,
        } = network;
        reports.retain(|agent| {
            let knot = reached[agent as usize];
            if knot <= server.reached(agent as usize) {
                return false;
            }
            if let Some(blocks) = noise.report(block, agent) {
                let due = reports_due.entry(block + blocks).or_default();
                due.push((agent, knot));
            }
            true
        });
        for (agent, knot) in reports_due.remove(&block).into_iter().flatten() {
            server.reach(graph, agent as usize, knot, |other| releases.add(other));
        }
        releases.retain(|agent| {
            let knot = server.released(agent as usize);
            if knot <= released[agent as usize] {
                return false;
            }
            if let Some(blocks) = noise.release(block, agent) {
                let due = releases_due.entry(block + blocks).or_default();
                due.push((agent, knot));
            }
            true
        });
        for (agent, knot) in releases_due.remove(&block).into_iter().flatten() {
            let released = &mut released[agent as usize];
            *released = knot.max(*released);
        }
    }

    /// Per agent, the last knot that it may go to.
    pub fn released(&self) -> &[u32] {
        &self.released
    }

    /// Per agent, the last knot that it has reached.
    pub fn reached(&self) -> &[u32] {
        &self.reached
    }

    /// Whether all agents have reached the ends of their routes.
    pub fn is_finished(&self) -> bool {
        self.finished == self.reached.len()
    }
}
