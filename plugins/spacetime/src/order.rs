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

    /// The rank of each agent: 0 where nobody comes before it, else one more than the highest of
    /// those that do.
    pub fn ranks(&self) -> Vec<u32> {
        let mut ranks = vec![0; self.before.len()];
        let mut left: Vec<usize> = self.before.iter().map(Vec::len).collect();
        let mut free: Vec<usize> = (0..left.len()).filter(|agent| left[*agent] == 0).collect();
        while let Some(agent) = free.pop() {
            for &down in &self.after[agent] {
                let down = down as usize;
                ranks[down] = ranks[down].max(ranks[agent] + 1);
                left[down] -= 1;
                if left[down] == 0 {
                    free.push(down);
                }
            }
        }
        ranks
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ranks_are_lengths_of_the_longest_chains() {
        let mut order = Order::new(6);
        for decision in [(3, 1), (1, 4), (3, 4), (0, 4)] {
            order.decide(decision);
        }
        assert_eq!(order.ranks(), [0, 1, 0, 0, 2, 0]);
        order.forget((0, 4));
        order.decide((4, 5));
        assert_eq!(order.ranks(), [0, 1, 0, 0, 2, 3]);
    }
}
