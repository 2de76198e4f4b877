//! One-way messages between robots and the server.

use std::collections::BTreeMap;

use crate::noise::{MessageNoise, Messages};

/// Increasing numbers, one per agent, sent from one side to the other.
///
/// A message is cumulative ("up to here"), so that a later one stands for all before
/// it, and is sent again in every block until the other side has it: losses and latency
/// delay what is known, and change nothing else. What arrives depends on what was said
/// up to a block and on the seed alone, not on the order in which it was said.
#[derive(Debug, Clone)]
pub(crate) struct Channel {
    /// Latest numbers of the sender, and the numbers that the receiver knows.
    latest: Vec<u32>,
    known: Vec<u32>,
    /// Agents whose numbers differ between the sides, and membership flags.
    waiting: Vec<u32>,
    waits: Vec<bool>,
    network: Option<Network>,
}

/// State of a network with latency or loss.
#[derive(Debug, Clone)]
struct Network {
    noise: MessageNoise,
    /// By block of arrival: agents and their numbers.
    due: BTreeMap<u64, Vec<(u32, u32)>>,
}

impl Channel {
    /// A channel without latency. Both sides know the first numbers.
    pub(crate) fn new(first: Vec<u32>) -> Self {
        Self {
            waiting: Vec::new(),
            waits: vec![false; first.len()],
            known: first.clone(),
            latest: first,
            network: None,
        }
    }

    /// Adds latency and loss. A block takes `period_s` seconds; `direction` keeps the
    /// random values of the two directions apart.
    pub(crate) fn over(
        mut self,
        direction: &str,
        messages: &Messages,
        seed: u64,
        period_s: f64,
    ) -> Self {
        self.network = (!messages.is_none()).then(|| Network {
            noise: MessageNoise::new(direction, messages, seed, period_s),
            due: BTreeMap::new(),
        });
        self
    }

    /// Sets the sender's number of an agent. Returns true if it is larger than the one
    /// before; otherwise nothing changes.
    pub(crate) fn say(&mut self, agent: u32, number: u32) -> bool {
        let latest = &mut self.latest[agent as usize];
        if number <= *latest {
            return false;
        }
        *latest = number;
        if !std::mem::replace(&mut self.waits[agent as usize], true) {
            self.waiting.push(agent);
        }
        true
    }

    /// Sends and receives at the beginning of a block; calls `tell` with every number new
    /// to the receiver. Blocks are exchanged in order, each once.
    pub(crate) fn exchange(&mut self, block: u64, mut tell: impl FnMut(u32, u32)) {
        let Self {
            latest,
            known,
            waiting,
            waits,
            network,
        } = self;
        let Some(Network { noise, due }) = network else {
            for agent in waiting.drain(..) {
                let at = agent as usize;
                waits[at] = false;
                known[at] = latest[at];
                tell(agent, latest[at]);
            }
            return;
        };
        waiting.sort_unstable();
        waiting.retain(|agent| {
            let at = *agent as usize;
            waits[at] = known[at] < latest[at];
            if waits[at]
                && let Some(blocks) = noise.travel(block, *agent)
            {
                let arrival = block.saturating_add(blocks);
                due.entry(arrival).or_default().push((*agent, latest[at]));
            }
            waits[at]
        });
        for (agent, number) in due.remove(&block).into_iter().flatten() {
            let known = &mut known[agent as usize];
            if number > *known {
                *known = number;
                tell(agent, number);
            }
        }
    }

    /// Memory of the channel in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        let numbers = self.latest.capacity() + self.known.capacity() + self.waiting.capacity();
        let due = self.network.iter().flat_map(|network| network.due.values());
        let due: usize = due.map(Vec::capacity).sum();
        numbers * size_of::<u32>() + self.waits.capacity() + due * size_of::<(u32, u32)>()
    }

    /// Latest numbers of the sender.
    pub(crate) fn latest(&self) -> &[u32] {
        &self.latest
    }

    /// Numbers that the receiver knows.
    pub(crate) fn known(&self) -> &[u32] {
        &self.known
    }
}
