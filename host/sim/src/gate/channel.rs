//! Messages of one direction, between robots and the server.

use std::collections::BTreeMap;

use crate::noise::{MessageNoise, Messages};

/// Numbers that only grow, one per agent, on their way to the other side.
///
/// A message is cumulative ("up to here"), so that a later one stands for all before
/// it, and is sent again in every block until the other side has it: losses and latency
/// delay what is known, and change nothing else. What arrives depends on what was said
/// up to a block and on the seed alone, not on the order in which it was said.
#[derive(Debug, Clone)]
pub(crate) struct Channel {
    /// What the one side has to say, and what the other side knows of it.
    latest: Vec<u32>,
    known: Vec<u32>,
    /// Agents of which the two differ, and marks of who is among them.
    waiting: Vec<u32>,
    waits: Vec<bool>,
    network: Option<Network>,
}

/// Messages that take time or are lost.
#[derive(Debug, Clone)]
struct Network {
    noise: MessageNoise,
    /// By block of arrival: agents and their numbers.
    due: BTreeMap<u64, Vec<(u32, u32)>>,
}

impl Channel {
    /// Both sides know the first numbers; messages take no time.
    pub(crate) fn new(first: Vec<u32>) -> Self {
        Self {
            waiting: Vec::new(),
            waits: vec![false; first.len()],
            known: first.clone(),
            latest: first,
            network: None,
        }
    }

    /// The same with messages that are late or lost. A block takes `period_s` seconds;
    /// `direction` keeps the random values of the two directions apart.
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

    /// The one side has a number to say. Whether it is a new one: a smaller one says
    /// nothing.
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

    /// Sends and receives at the beginning of a block, and tells of every number that
    /// the other side did not know. Blocks are exchanged in order, each once.
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

    /// What the channel takes in memory, in bytes.
    pub(crate) fn memory_bytes(&self) -> usize {
        let numbers = self.latest.capacity() + self.known.capacity() + self.waiting.capacity();
        let due = self.network.iter().flat_map(|network| network.due.values());
        let due: usize = due.map(Vec::capacity).sum();
        numbers * size_of::<u32>() + self.waits.capacity() + due * size_of::<(u32, u32)>()
    }

    /// What the one side has to say.
    pub(crate) fn latest(&self) -> &[u32] {
        &self.latest
    }

    /// What the other side knows.
    pub(crate) fn known(&self) -> &[u32] {
        &self.known
    }
}
