//! OPEN and FOCAL of ECBS (Barer et al., SoCS 2014): all open nodes by lower bound, and those
//! within the weight of the least bound by their number of conflicts.

use std::cmp::Reverse;
use std::collections::BTreeSet;

/// The keys of a node's place in the queue.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Rank {
    /// Lower bound of the sum of costs below the node.
    pub(crate) bound: u64,
    /// Sum of costs of its paths.
    pub(crate) cost: u64,
    /// Number of conflicts.
    pub(crate) conflicts: u32,
}

impl Rank {
    /// Least bound for which the node is good enough at weight 1.
    fn worth(&self) -> u64 {
        self.cost.max(self.bound)
    }

    fn focal(&self, id: u32) -> (u32, u64, Reverse<u32>) {
        (self.conflicts, self.cost, Reverse(id))
    }
}

/// The open nodes. With a weight of 1 those of least bound come first.
#[derive(Debug, Default)]
pub(crate) struct Queue {
    weight: f64,
    /// Most of a sum that the weight counts for: steps within the window.
    counted: u64,
    limit: u64,
    open: BTreeSet<(u64, u32)>,
    beyond: BTreeSet<(u64, u32)>,
    focal: BTreeSet<(u32, u64, Reverse<u32>)>,
}

impl Queue {
    /// None open.
    pub(crate) fn new(weight: f64, counted: u64) -> Self {
        Self {
            weight,
            counted,
            limit: 0,
            open: BTreeSet::new(),
            beyond: BTreeSet::new(),
            focal: BTreeSet::new(),
        }
    }

    /// Forgets all.
    pub(crate) fn clear(&mut self) {
        self.limit = 0;
        self.open.clear();
        self.beyond.clear();
        self.focal.clear();
    }

    /// Opens a node.
    pub(crate) fn push(&mut self, id: u32, rank: Rank) {
        self.open.insert((rank.bound, id));
        if rank.worth() <= self.limit {
            self.focal.insert(rank.focal(id));
        } else {
            self.beyond.insert((rank.worth(), id));
        }
    }

    /// A lower bound of what any node below the open ones costs.
    pub(crate) fn bound(&self) -> Option<u64> {
        self.open.first().map(|(bound, _)| *bound)
    }

    /// Takes the node to be expanded next.
    pub(crate) fn pop(&mut self, rank: impl Fn(u32) -> Rank) -> Option<u32> {
        let least = self.bound()?;
        let slack = least.min(self.counted) as f64 * (self.weight - 1.0);
        self.limit = self.limit.max(least + (slack + 1e-6) as u64);
        while let Some(&(worth, id)) = self.beyond.first() {
            // One at least, whatever the paths of the node with the least bound cost.
            if worth > self.limit && !self.focal.is_empty() {
                break;
            }
            self.beyond.pop_first();
            self.focal.insert(rank(id).focal(id));
        }
        let (_, _, Reverse(id)) = self.focal.pop_first()?;
        self.open.remove(&(rank(id).bound, id));
        Some(id)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn order(weight: f64, ranks: &[(u64, u64, u32)]) -> Vec<u32> {
        let rank = |id: u32| {
            let (bound, cost, conflicts) = ranks[id as usize];
            Rank {
                bound,
                cost,
                conflicts,
            }
        };
        let mut queue = Queue::new(weight, u64::MAX);
        for id in 0..ranks.len() as u32 {
            queue.push(id, rank(id));
        }
        std::iter::from_fn(|| queue.pop(rank)).collect()
    }

    #[test]
    fn good_enough_nodes_come_by_conflicts() {
        let ranks = [(10, 10, 5), (10, 11, 1), (10, 10, 4), (11, 13, 0)];
        assert_eq!(order(1.0, &ranks), [2, 0, 1, 3]);
        assert_eq!(order(1.1, &ranks), [1, 2, 0, 3]);
        assert_eq!(order(1.3, &ranks), [3, 1, 2, 0]);
    }
}
