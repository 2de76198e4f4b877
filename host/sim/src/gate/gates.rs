//! The state of a gated execution: what robots have done and may do, and the
//! messages between them and the server that knows the graph.

use super::channel::Channel;
use super::frontier::Frontier;
use super::graph::DependencyGraph;
use crate::noise::Messages;

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
    /// The knots that robots have reached, and those that they may go to.
    reports: Channel,
    releases: Channel,
    finished: usize,
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
            reports: Channel::new(vec![0; agents]),
            releases: Channel::new(released),
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
        gates.reports = gates.reports.over("report", messages, seed, period_s);
        gates.releases = gates.releases.over("release", messages, seed, period_s);
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

    /// Per agent, the last knot that it may go to.
    pub fn released(&self) -> &[u32] {
        self.releases.known()
    }

    /// Per agent, the last knot that it has reached.
    pub fn reached(&self) -> &[u32] {
        self.reports.latest()
    }

    /// Whether all agents have reached the ends of their routes.
    pub fn is_finished(&self) -> bool {
        self.finished == self.graph.agents()
    }
}
