//! Partial orders of agents, as priority-based search decides them.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// The child of a node that is looked at first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Prefer {
    /// The one with fewer collisions, of equal ones that of less cost.
    #[default]
    Collisions,
    /// The one of less cost, of equal ones that with fewer collisions.
    Cost,
}

/// A partial order: per agent those directly before and after it.
#[derive(Debug, Clone)]
pub struct Order {
    before: Vec<Vec<u32>>,
    after: Vec<Vec<u32>>,
    /// Stamps of the last walk over the agents.
    seen: Vec<u32>,
    walk: u32,
    stack: Vec<u32>,
}

impl Order {
    /// Of so many agents, none before another.
    pub fn new(agents: usize) -> Self {
        Self {
            before: vec![Vec::new(); agents],
            after: vec![Vec::new(); agents],
            seen: vec![0; agents],
            walk: 0,
            stack: Vec::new(),
        }
    }

    /// Orders two agents, which must not be ordered the other way.
    pub fn decide(&mut self, (first, then): (u32, u32)) {
        self.before[then as usize].push(first);
        self.after[first as usize].push(then);
    }

    /// Takes the last decision back.
    pub fn forget(&mut self, (first, then): (u32, u32)) {
        self.before[then as usize].pop();
        self.after[first as usize].pop();
    }

    /// Marks all that come before an agent; asked for by [`Order::is_before`].
    pub fn mark_before(&mut self, agent: u32) {
        self.walk += 1;
        self.stack.clear();
        self.stack.push(agent);
        while let Some(at) = self.stack.pop() {
            for &up in &self.before[at as usize] {
                if self.seen[up as usize] != self.walk {
                    self.seen[up as usize] = self.walk;
                    self.stack.push(up);
                }
            }
        }
    }

    /// True if an agent was marked by the last [`Order::mark_before`].
    pub fn is_before(&self, agent: u32) -> bool {
        self.seen[agent as usize] == self.walk
    }

    /// True if one of two agents comes before the other.
    pub fn are_ordered(&mut self, (a, b): (u32, u32)) -> bool {
        self.mark_before(a);
        if self.is_before(b) {
            return true;
        }
        self.mark_before(b);
        self.is_before(a)
    }

    /// An agent and all that come after it, each after those before it.
    pub fn from(&mut self, agent: u32) -> Vec<u32> {
        let met = self.walk + 1;
        self.walk += 2;
        let mut sorted = Vec::new();
        self.stack.clear();
        self.stack.push(agent);
        while let Some(&at) = self.stack.last() {
            let seen = &mut self.seen[at as usize];
            if *seen < met {
                *seen = met;
                for &down in &self.after[at as usize] {
                    if self.seen[down as usize] < met {
                        self.stack.push(down);
                    }
                }
                continue;
            }
            // All after it are done.
            if *seen == met {
                *seen = self.walk;
                sorted.push(at);
            }
            self.stack.pop();
        }
        sorted.reverse();
        sorted
    }
}
