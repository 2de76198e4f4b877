//! Poses of an agent and the ways between them: cells alone, or cells and headings.
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

    /// Whether headings matter.
    #[inline]
    pub fn turning(self) -> bool {
        self.turning
    }

    /// Number of poses.
    pub fn len(self) -> usize {
        self.graph.len() * if self.turning { DIRECTIONS } else { 1 }
    }

    /// Whether there is none.
    pub fn is_empty(self) -> bool {
        self.graph.is_empty()
    }

    /// The pose of a vertex and a direction as in [`Graph::around`].
    #[inline]
    pub fn pose(self, v: Vertex, direction: usize) -> Pose {
        if self.turning {
            v * DIRECTIONS as u32 + (direction % DIRECTIONS) as u32
        } else {
            v
        }
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
        let (v, d) = (pose / DIRECTIONS as u32, pose as usize % DIRECTIONS);
        next[1] = self.pose(v, d + 1);
        next[2] = self.pose(v, d + DIRECTIONS - 1);
        let ahead = self.graph.around(v)[d];
        next[3] = self.pose(ahead, d);
        3 + usize::from(ahead != wall)
    }

    /// Tells of the poses one step before.
    fn previous(self, pose: Pose, tell: &mut impl FnMut(Pose)) {
        let wall = self.graph.wall();
        if !self.turning {
            self.graph.neighbors(pose).for_each(tell);
            return;
        }
        let (v, d) = (pose / DIRECTIONS as u32, pose as usize % DIRECTIONS);
        tell(self.pose(v, d + 1));
        tell(self.pose(v, d + DIRECTIONS - 1));
        let behind = self.graph.around(v)[(d + 2) % DIRECTIONS];
        if behind != wall {
            tell(self.pose(behind, d));
        }
    }
}

/// The least number of steps from every pose to a goal cell, whatever the heading there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Way {
    goal: Vertex,
    steps: Vec<u16>,
}

/// No way, or none of less than 65535 steps.
pub const NO_WAY: u32 = u16::MAX as u32;

impl Way {
    /// Breadth-first search from the goal; `poses.len()` entries of two bytes.
    pub fn new(poses: Poses<'_>, goal: Vertex) -> Self {
        let mut steps = vec![u16::MAX; poses.len()];
        let directions = if poses.turning { DIRECTIONS } else { 1 };
        let mut queue: Vec<Pose> = (0..directions).map(|d| poses.pose(goal, d)).collect();
        for &pose in &queue {
            steps[pose as usize] = 0;
        }
        let mut next = 0;
        while let Some(&pose) = queue.get(next) {
            next += 1;
            let more = steps[pose as usize].saturating_add(1);
            poses.previous(pose, &mut |before| {
                let entry = &mut steps[before as usize];
                if *entry == u16::MAX && more < u16::MAX {
                    *entry = more;
                    queue.push(before);
                }
            });
        }
        Self { goal, steps }
    }

    /// The goal.
    #[inline]
    pub fn goal(&self) -> Vertex {
        self.goal
    }

    /// Steps to the goal; [`NO_WAY`] if there is no way.
    #[inline]
    pub fn steps(&self, pose: Pose) -> u32 {
        u32::from(self.steps[pose as usize])
    }

    /// Bytes that one takes.
    pub fn bytes(poses: Poses<'_>) -> usize {
        poses.len() * size_of::<u16>() + size_of::<Self>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn turning_takes_steps() {
        let graph = Graph::new(2, 3, &[true, true, true, true, false, true]);
        let pebbles = Way::new(Poses::new(&graph, false), 2);
        assert_eq!(
            (0..5).map(|v| pebbles.steps(v)).collect::<Vec<_>>(),
            [2, 1, 0, 3, 1]
        );
        let poses = Poses::new(&graph, true);
        let turning = Way::new(poses, 2);
        // Directions go round from up: right, down, left.
        let from = |v, d| turning.steps(poses.pose(v, d));
        assert_eq!((0..4).map(|d| from(0, d)).collect::<Vec<_>>(), [3, 2, 3, 4]);
        assert_eq!((0..4).map(|d| from(3, d)).collect::<Vec<_>>(), [4, 5, 6, 5]);
        assert_eq!((0..4).map(|d| from(2, d)).collect::<Vec<_>>(), [0; 4]);
        let mut next = [0; MOVES];
        assert_eq!(poses.next(poses.pose(0, 1), &mut next), 4);
        assert_eq!(next[3], poses.pose(1, 1));
        assert_eq!(poses.next(poses.pose(0, 0), &mut next), 3);
    }

    #[test]
    fn steps_agree_with_neighbours() {
        let passable: Vec<bool> = (0..63).map(|cell| cell % 5 != 3).collect();
        let graph = Graph::new(7, 9, &passable);
        for turning in [false, true] {
            let poses = Poses::new(&graph, turning);
            let way = Way::new(poses, 17);
            let mut next = [0; MOVES];
            for pose in (0..poses.len() as u32).filter(|&pose| way.steps(pose) != 0) {
                let count = poses.next(pose, &mut next);
                let best = next[1..count].iter().map(|&pose| way.steps(pose)).min();
                let best = best.map_or(NO_WAY, |steps| (steps + 1).min(NO_WAY));
                assert_eq!(way.steps(pose), best);
            }
        }
    }
}
