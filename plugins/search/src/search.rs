//! The interface of all searches: limits and answers.

use crate::grid::Grid;

/// Reason why a search was stopped.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stop {
    /// It was to expand no more nodes.
    Nodes,
    /// It was told to, by the clock or by the caller.
    Told,
}

/// Result of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// With a path.
    Found,
    /// Everything was searched: there is no path.
    NoPath,
    /// Nothing is left to search, but not everything was searched.
    GaveUp,
    /// Before it was done.
    Stopped(Stop),
}

/// The answer of a search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Answer {
    /// Result of the search.
    pub outcome: Outcome,
    /// Number of nodes expanded; each planner says what it counts.
    pub expansions: u64,
}

impl Answer {
    pub(crate) fn new(outcome: Outcome, expansions: u64) -> Self {
        Self {
            outcome,
            expansions,
        }
    }
}

/// Limits of a search.
pub struct Limit<'a> {
    most: u64,
    /// The next count at which something is to be looked at.
    next: u64,
    told: Option<&'a mut dyn FnMut() -> bool>,
}

/// So many expansions, a few hundred microseconds at most, between two looks at the
/// clock.
const BETWEEN_LOOKS: u64 = 1 << 11;

impl<'a> Limit<'a> {
    /// No limit.
    pub fn none() -> Self {
        Self {
            most: u64::MAX,
            next: u64::MAX,
            told: None,
        }
    }

    /// So many expansions, and as long as `told` does not say so; it is asked rarely.
    pub fn new(nodes: Option<u64>, told: &'a mut dyn FnMut() -> bool) -> Self {
        Self {
            most: nodes.unwrap_or(u64::MAX),
            next: 0,
            told: Some(told),
        }
    }

    /// Reason to stop before the next expansion, after so many.
    #[inline]
    pub(crate) fn reached(&mut self, expansions: u64) -> Option<Stop> {
        if expansions < self.next {
            return None;
        }
        self.look(expansions)
    }

    #[cold]
    fn look(&mut self, expansions: u64) -> Option<Stop> {
        if expansions >= self.most {
            return Some(Stop::Nodes);
        }
        if self.told.as_mut().is_some_and(|told| told()) {
            return Some(Stop::Told);
        }
        self.next = self.most.min(expansions + BETWEEN_LOOKS);
        None
    }
}

impl std::fmt::Debug for Limit<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Limit").field("most", &self.most).finish()
    }
}

/// Finds paths for one robot. What a search keeps between calls are arrays to work
/// in: answers depend on the arguments alone.
pub trait Search: Send {
    /// Searches for a path between two free cells, and leaves its cells in `path`,
    /// both ends included; `path` is empty if there is none.
    fn search(
        &mut self,
        grid: &Grid,
        start: u32,
        goal: u32,
        limit: &mut Limit<'_>,
        path: &mut Vec<u32>,
    ) -> Answer;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_are_kept_to_the_node() {
        let mut never = || false;
        let mut limit = Limit::new(Some(3000), &mut never);
        let reached: Vec<u64> = (0..=3000).filter(|n| limit.reached(*n).is_some()).collect();
        assert_eq!(reached, [3000]);
        let mut asked = 0;
        let mut told = || {
            asked += 1;
            asked == 3
        };
        let mut limit = Limit::new(None, &mut told);
        let stopped = (0..=4 * BETWEEN_LOOKS).find(|n| limit.reached(*n).is_some());
        assert_eq!(stopped, Some(2 * BETWEEN_LOOKS));
    }
}
