//! Poses of an agent and the steps between them: cells alone, or cells and headings.
//!
//! As a pebble an agent moves to a neighbouring cell or stays. In the rotation model it goes
//! forward, turns by a quarter on the spot, or stays, each in one step (the model with
//! rotation of Zhang et al., "Planning and execution in multi-agent path finding: models and
//! algorithms", ICAPS 2024).

use crate::graph::{DIRECTIONS, Graph, Vertex};

/// A vertex, or `4 · vertex + direction` where headings matter; see [`Poses`].
pub type Pose = u32;

/// Most successors that a pose has.
pub const MOVES: usize = DIRECTIONS + 1;

/// All poses on a graph and the steps between them.
#[derive(Debug, Clone, Copy)]
pub struct Poses<'g> {
    graph: &'g Graph,
    turning: bool,
}

impl<'g> Poses<'g> {
    /// Poses on a graph, with headings if `turning`.
    pub fn new(graph: &'g Graph, turning: bool) -> Self {
        Self { graph, turning }
    }

    /// The graph.
    #[inline]
    pub fn graph(self) -> &'g Graph {
        self.graph
    }

    /// True if headings matter.
    #[inline]
    pub fn turning(self) -> bool {
        self.turning
    }

    /// Number of poses.
    pub fn len(self) -> usize {
        self.graph.len() * if self.turning { DIRECTIONS } else { 1 }
    }

    /// True if there is none.
    pub fn is_empty(self) -> bool {
        self.graph.is_empty()
    }

    /// The pose of a vertex and a direction as in [`Graph::around`].
    #[inline]
    pub fn pose(self, v: Vertex, direction: u8) -> Pose {
        if self.turning {
            v * DIRECTIONS as u32 + u32::from(direction) % DIRECTIONS as u32
        } else {
            v
        }
    }

    /// The direction of a pose; of no account where headings do not matter.
    #[inline]
    pub fn direction(self, pose: Pose) -> u8 {
        (pose % DIRECTIONS as u32) as u8
    }

    /// The vertex of a pose.
    #[inline]
    pub fn vertex(self, pose: Pose) -> Vertex {
        if self.turning {
            pose / DIRECTIONS as u32
        } else {
            pose
        }
    }

    /// Writes the poses after one step and says how many there are. The first is to stay.
    #[inline]
    pub fn next(self, pose: Pose, next: &mut [Pose; MOVES]) -> usize {
        next[0] = pose;
        let wall = self.graph.wall();
        if !self.turning {
            let mut count = 1;
            for &u in self.graph.around(pose) {
                next[count] = u;
                count += usize::from(u != wall);
            }
            return count;
        }
        let (v, d) = (self.vertex(pose), self.direction(pose));
        next[1] = self.pose(v, d + 1);
        next[2] = self.pose(v, d + 3);
        let ahead = self.graph.around(v)[usize::from(d)];
        next[3] = self.pose(ahead, d);
        3 + usize::from(ahead != wall)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_turns_goes_forward_alone() {
        let graph = Graph::new(2, 3, &[true, true, true, true, false, true]);
        let mut next = [0; MOVES];
        let pebbles = Poses::new(&graph, false);
        let count = pebbles.next(0, &mut next);
        assert_eq!(next[..count], [0, 1, 3]);
        let poses = Poses::new(&graph, true);
        // Directions go round from north.
        let count = poses.next(poses.pose(0, 1), &mut next);
        let expected = [(0, 1), (0, 2), (0, 0), (1, 1)].map(|(v, d)| poses.pose(v, d));
        assert_eq!(next[..count], expected);
        let count = poses.next(poses.pose(0, 0), &mut next);
        assert_eq!(count, 3, "there is a wall ahead");
        assert_eq!((poses.vertex(next[2]), poses.direction(next[2])), (0, 3));
    }
}
