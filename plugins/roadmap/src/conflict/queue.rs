//! OPEN and FOCAL of ECBS (M. Barer, G. Sharon, R. Stern, A. Felner, SoCS 2014): all open nodes by lower bound, and those within
//! the weight of the least bound by their number of conflicts.

use std::cmp::Reverse;
use std::collections::BTreeSet;

/// Costs that differ by a smaller share are the same: sums are rounded.
const SAME: f64 = 1e-9;

/// The keys of a node's place in the queue.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rank {
    /// Lower bound of the sum of costs below the node.
    pub(super) bound: f64,
    /// Sum of costs of its paths.
    pub(super) cost: f64,
    /// Number of pairs of agents with conflicts.
    pub(super) conflicts: u32,
}

impl Rank {
    /// Least bound for which the node is good enough at weight 1.
    fn worth(&self) -> f64 {
        self.cost.max(self.bound)
    }

    fn focal(&self, id: u32) -> (u32, u64, Reverse<u32>) {
        (self.conflicts, key(self.worth()), Reverse(id))
    }
}

/// A number that is not negative, as one that has an order.
fn key(cost: f64) -> u64 {
    cost.max(0.0).to_bits()
}

/// The open nodes. With a weight of 1 those of least bound come first.
#[derive(Debug, Default)]
pub(super) struct Queue {
    weight: f64,
    limit: f64,
    open: BTreeSet<(u64, u32)>,
    beyond: BTreeSet<(u64, u32)>,
    focal: BTreeSet<(u32, u64, Reverse<u32>)>,
}

impl Queue {
    /// None open.
    pub(super) fn new(weight: f64) -> Self {
        Self {
            weight,
            limit: f64::NEG_INFINITY,
            open: BTreeSet::new(),
            beyond: BTreeSet::new(),
            focal: BTreeSet::new(),
        }
    }

    /// Forgets all.
    pub(super) fn clear(&mut self) {
        self.limit = f64::NEG_INFINITY;
        self.open.clear();
        self.beyond.clear();
        self.focal.clear();
    }

    /// Opens a node.
    pub(super) fn push(&mut self, id: u32, rank: Rank) {
        self.open.insert((key(rank.bound), id));
        if rank.worth() <= self.limit {
            self.focal.insert(rank.focal(id));
        } else {
            self.beyond.insert((key(rank.worth()), id));
        }
    }

    /// A lower bound of what any node below the open ones costs.
    pub(super) fn bound(&self) -> Option<f64> {
        self.open.first().map(|(bound, _)| f64::from_bits(*bound))
    }

    /// Takes the node to be expanded next.
    pub(super) fn pop(&mut self, rank: impl Fn(u32) -> Rank) -> Option<u32> {
        let most = self.bound()? * self.weight;
        self.limit = self.limit.max(most + most * SAME);
        while let Some(&(worth, id)) = self.beyond.first() {
            // One at least, whatever the paths of the node with the least bound cost.
            if f64::from_bits(worth) > self.limit && !self.focal.is_empty() {
                break;
            }
            self.beyond.pop_first();
            self.focal.insert(rank(id).focal(id));
        }
        let (_, _, Reverse(id)) = self.focal.pop_first()?;
        self.open.remove(&(key(rank(id).bound), id));
        Some(id)
    }

    /// Takes nodes out, those with the greatest bounds: half of them, and no more than so many.
    pub(super) fn forget(&mut self, most: usize, rank: impl Fn(u32) -> Rank) -> Vec<u32> {
        let count = most.min(self.open.len() / 2);
        let gone: Vec<u32> = (0..count)
            .filter_map(|_| self.open.pop_last())
            .map(|(_, id)| id)
            .collect();
        for id in &gone {
            let rank = rank(*id);
            self.focal.remove(&rank.focal(*id));
            self.beyond.remove(&(key(rank.worth()), *id));
        }
        gone
    }
}
