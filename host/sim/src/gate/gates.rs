//! State of a gated execution: progress and releases of robots, and the messages between
//! them and the server that holds the graph.

use super::channel::Channel;
use super::frontier::Frontier;
use super::graph::DependencyGraph;
use crate::noise::Messages;
use crate::trace::Awaited;

/// Releases of agents while a plan is executed by order.
///
/// Robots report the knots that they have reached; the server replies with the actions
/// that are thereby released. All messages are cumulative ("up to here") and each is sent
/// again in every period until it has arrived: losses delay an execution and change
/// nothing else. Time advances in blocks of one period each; progress within a block
/// reaches the server at the end of it.
///
/// The state depends on the graph, the reports and the seed alone, not on the order of
/// reports within a block.
#[derive(Debug, Clone)]
pub struct Gates {
    graph: DependencyGraph,
    /// Progress and releases that the server knows.
    server: Frontier,
    /// Channels of the reached and of the released knots.
    reports: Channel,
    releases: Channel,
    finished: usize,
}

impl Gates {
    /// All robots at the start of their routes, knowing their first releases; messages
    /// without latency.
    pub fn new(graph: DependencyGraph) -> Self {
        let agents = graph.agents();
        let server = Frontier::new(&graph);
        let released = (0..agents).map(|agent| server.released(agent)).collect();
        let finished = (0..agents).filter(|agent| graph.actions(*agent) == 0);
        Self {
            finished: finished.count(),
            reports: Channel::new(vec![0; agents]),
            releases: Channel::new(released),
            server,
            graph,
        }
    }

    /// Adds latency and loss of messages. A block takes `period_s` seconds, a positive
    /// number.
    pub fn with_messages(
        graph: DependencyGraph,
        messages: &Messages,
        seed: u64,
        period_s: f64,
    ) -> Self {
        let mut gates = Self::new(graph);
        gates.reports = gates.reports.over("report", messages, seed, period_s);
        gates.releases = gates.releases.over("release", messages, seed, period_s);
        gates
    }

    /// The graph, which defines the numbers of actions and knots in this type.
    pub fn graph(&self) -> &DependencyGraph {
        &self.graph
    }

    /// Records that the robot has reached a knot of its route. Knots before the last
    /// reached one have no effect.
    pub fn done(&mut self, agent: usize, knot: usize) {
        let last = self.graph.actions(agent) as u32;
        let knot = u32::try_from(knot).map_or(last, |knot| knot.min(last));
        if self.reports.say(agent as u32, knot) {
            self.finished += usize::from(knot == last);
        }
    }

    /// Exchanges messages at the beginning of a block. Blocks are exchanged in
    /// order, each once.
    pub fn exchange(&mut self, block: u64) {
        let Self {
            graph,
            server,
            reports,
            releases,
            ..
        } = self;
        reports.exchange(block, |agent, knot| {
            server.reach(graph, agent as usize, knot, |other, knot| {
                releases.say(other, knot);
            });
        });
        releases.exchange(block, |_, _| {});
    }

    /// Per agent, the last released knot.
    pub fn released(&self) -> &[u32] {
        self.releases.known()
    }

    /// Per agent, the last reached knot.
    pub fn reached(&self) -> &[u32] {
        self.reports.latest()
    }

    /// The reason why an agent cannot begin its next action.
    pub fn awaited(&self, agent: usize) -> Awaited {
        let (reached, released) = (self.reached(), self.released()[agent]);
        if reached[agent] < released || released as usize == self.graph.actions(agent) {
            return Awaited::Nothing;
        }
        let unmet = self.graph.waits(agent).get(self.server.met(agent));
        match unmet.filter(|wait| wait.action == released + 1) {
            Some(wait) if reached[wait.other as usize] < wait.knot => Awaited::Agent(wait.other),
            // What it waits for has come about, and it does not know yet.
            _ => Awaited::Message,
        }
    }

    /// True once all agents have reached the ends of their routes.
    pub fn is_finished(&self) -> bool {
        self.finished == self.graph.agents()
    }
}
