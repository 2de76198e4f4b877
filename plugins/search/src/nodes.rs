//! The places that a search has seen, kept between calls.
//!
//! Every entry carries the number of the call that wrote it, so that nothing is
//! cleared when a call begins, and a call touches the places that it comes to and no
//! other.

use crate::cost::Cost;
use crate::grid::{Grid, NOWHERE, Place, opposite};

/// Low bits of a tag: the direction in which the search came here.
const DIRECTION: u32 = 0xf;
/// The place has been expanded.
const CLOSED: u32 = 1 << 4;
/// The number of the call, above.
const CALL: u32 = 1 << 5;

#[derive(Debug, Clone, Copy, Default)]
struct Node<C> {
    cost: C,
    tag: u32,
}

/// Least known costs, the directions in which they were found, and what is closed.
#[derive(Debug, Default)]
pub(crate) struct Nodes<C> {
    nodes: Vec<Node<C>>,
    call: u32,
}

impl<C: Cost> Nodes<C> {
    /// Forgets everything; `places` is the size of the map.
    pub(crate) fn begin(&mut self, places: usize) {
        if self.nodes.len() != places || self.call > u32::MAX - 2 * CALL {
            self.nodes = vec![Node::default(); places];
            self.call = 0;
        }
        self.call += CALL;
    }

    /// The least known cost, if the place was seen.
    #[inline]
    pub(crate) fn cost(&self, place: Place) -> Option<C> {
        let node = self.nodes[place as usize];
        (node.tag >= self.call).then_some(node.cost)
    }

    /// The cost of a place that was seen.
    #[inline]
    pub(crate) fn known(&self, place: Place) -> C {
        self.nodes[place as usize].cost
    }

    /// Sets the cost and opens the place.
    #[inline]
    pub(crate) fn open(&mut self, place: Place, cost: C, direction: u8) {
        self.nodes[place as usize] = Node {
            cost,
            tag: self.call | u32::from(direction),
        };
    }

    /// Closes a place that was seen: false if it was closed already.
    #[inline]
    pub(crate) fn close(&mut self, place: Place) -> bool {
        let tag = &mut self.nodes[place as usize].tag;
        let open = *tag & CLOSED == 0;
        *tag |= CLOSED;
        open
    }

    /// True if a place that was seen is closed.
    #[inline]
    pub(crate) fn is_closed(&self, place: Place) -> bool {
        self.nodes[place as usize].tag & CLOSED != 0
    }

    /// The direction in which the search came to a place that was seen.
    #[inline]
    pub(crate) fn direction(&self, place: Place) -> u8 {
        (self.nodes[place as usize].tag & DIRECTION) as u8
    }

    /// The directions that lead on from a place: all exits but the way back.
    #[inline]
    pub(crate) fn onward(&self, grid: &Grid, place: Place) -> u8 {
        grid.exits(place) & !self.back(place)
    }

    /// The same where the search began at the goal: the directions of those who come here.
    #[inline]
    pub(crate) fn onward_back(&self, grid: &Grid, place: Place) -> u8 {
        grid.entries(place) & !self.back(place)
    }

    #[inline]
    fn back(&self, place: Place) -> u8 {
        // `NOWHERE` becomes a bit that no mask has.
        (1_u32 << opposite(self.direction(place))) as u8
    }

    /// The cells from the start of the search to a place.
    pub(crate) fn trace(&self, grid: &Grid, end: Place, path: &mut Vec<u32>) {
        path.clear();
        self.walk(grid, end, path);
        path.reverse();
    }

    /// Appends the cells from a place back to the start of the search.
    pub(crate) fn walk(&self, grid: &Grid, end: Place, path: &mut Vec<u32>) {
        let mut place = end;
        path.push(grid.cell(place));
        loop {
            let direction = self.direction(place);
            if direction == NOWHERE {
                return;
            }
            place = grid.step(place, opposite(direction));
            path.push(grid.cell(place));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_do_not_see_each_other() {
        let mut nodes = Nodes::<u32>::default();
        for call in 0..5 {
            nodes.begin(4);
            assert_eq!(nodes.cost(2), None, "call {call}");
            nodes.open(2, call, NOWHERE);
            assert!(nodes.close(2));
            assert!(!nodes.close(2));
            assert_eq!(nodes.cost(2), Some(call));
        }
        nodes.call = u32::MAX - CALL;
        nodes.begin(4);
        assert_eq!((nodes.cost(2), nodes.call), (None, CALL));
    }
}
