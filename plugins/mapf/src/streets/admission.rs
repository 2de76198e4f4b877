//! Agents that are held back, so that no crowd closes the ways to a door.
//!
//! One door may carry the ways of many: all of them come to the rooms before it, and nobody who has passed
//! gets away through them. So no more than a few agents have leave to go to a passage at a time:
//! those that have had their goals for longest, whom nobody overtakes. The others stay where they are
//! in nobody's way, and whoever comes by pushes them aside. This is perimeter control, as road traffic
//! has it (Daganzo, Transportation Research B 41, 2007), of each passage by itself.

/// Agents that have leave to go to a passage at a time, from near or far. Fewer, and doors stand
/// empty while the next one comes; many more, and rooms fill up.
const LEAVES: u32 = 20;

/// Leaves to go to passages, given to one agent after the other.
#[derive(Debug)]
pub(super) struct Admission {
    /// Per passage, the agents that have leave to go there.
    leaves: Vec<u32>,
}

impl Admission {
    /// For so many passages.
    pub(super) fn new(passages: usize) -> Self {
        Self {
            leaves: vec![0; passages],
        }
    }

    /// True if the next agent is held back. `passages` are those between it and its goal; one that
    /// cannot wait where it is is never held back, and counts.
    pub(super) fn holds(&mut self, passages: &[u32], can_wait: bool) -> bool {
        let is_full = |passage: &u32| self.leaves[*passage as usize] >= LEAVES;
        if can_wait && passages.iter().any(is_full) {
            return true;
        }
        for passage in passages {
            self.leaves[*passage as usize] += 1;
        }
        false
    }
}
