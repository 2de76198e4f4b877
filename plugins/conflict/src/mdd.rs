//! Multi-valued decision diagrams: all cheapest paths of one agent, level by level (Sharon et
//! al., "The increasing cost tree search", AIJ 195, 2013).
//!
//! Only the levels that have a single cell are kept: a conflict there cannot be avoided at that
//! cost, which makes it cardinal (Boyarski et al., "ICBS", IJCAI 2015).

use fleetyard_plugin_spacetime::astar::settling;
use fleetyard_plugin_spacetime::constraints::Constraints;
use fleetyard_plugin_spacetime::graph::Vertex;
use fleetyard_plugin_spacetime::pose::{MOVES, Pose, Poses};
use fleetyard_plugin_spacetime::problem::Route;
use fleetyard_plugin_spacetime::sipp::Guidance;

/// Entry of a level with several cells.
pub(crate) const SEVERAL: Vertex = Vertex::MAX;

/// Working memory, kept from one diagram to the next.
#[derive(Debug, Default)]
pub(crate) struct Builder {
    /// Index of a state in the level under construction, with the level's mark.
    places: Vec<(u32, u32)>,
    mark: u32,
    levels: Vec<Vec<(Pose, u32)>>,
    alive: Vec<Vec<bool>>,
}

impl Builder {
    /// All paths of one cost. Empty if there is none.
    fn build(
        &mut self,
        poses: Poses<'_>,
        route: &Route,
        constraints: &Constraints,
        cost: u32,
        until: u32,
    ) -> usize {
        let stages = route.goals.len() as u32 + 1;
        let size = poses.len() * stages as usize;
        if self.places.len() < size {
            self.places.resize(size, (0, 0));
        }
        let Some((settle, _)) = settling(route, constraints, until) else {
            return 0;
        };
        let depth = cost.min(until) as usize;
        if self.levels.len() <= depth {
            self.levels.resize(depth + 1, Vec::new());
            self.alive.resize(depth + 1, Vec::new());
        }
        let start = (
            poses.pose(route.start, route.heading),
            route.reached(0, route.start),
        );
        self.levels[0].clear();
        self.levels[0].push(start);
        let mut next = [0; MOVES];
        for level in 0..depth {
            let time = level as u32 + 1;
            let mark = self.next_mark();
            let (before, after) = self.levels.split_at_mut(level + 1);
            let reached = &mut after[0];
            reached.clear();
            for &(pose, stage) in &before[level] {
                let v = poses.vertex(pose);
                let count = poses.next(pose, &mut next);
                for &pose in &next[..count] {
                    let u = poses.vertex(pose);
                    let stage = route.reached(stage, u);
                    let rest = route.rest(stage, u, poses.direction(pose));
                    // Whoever is there the step before has arrived at less cost.
                    let early = route.stays && rest == 0 && time + 1 == cost;
                    if early || (time + rest).max(settle) > cost || constraints.forbids(v, u, time)
                    {
                        continue;
                    }
                    let place = &mut self.places[(pose * stages + stage) as usize];
                    if place.1 != mark {
                        *place = (reached.len() as u32, mark);
                        reached.push((pose, stage));
                    }
                }
            }
        }
        // Whoever is not at the end by the last level has taken a way that costs more.
        let last = &self.levels[depth];
        let ends = |&(pose, stage): &(Pose, u32)| {
            if cost >= until {
                return true;
            }
            let all = route.goals.len() as u32;
            if route.stays {
                stage + 1 == all && Some(&poses.vertex(pose)) == route.goals.last()
            } else {
                stage == all
            }
        };
        self.alive[depth].clear();
        self.alive[depth].extend(last.iter().map(ends));
        for level in (0..depth).rev() {
            let time = level as u32 + 1;
            let mark = self.next_mark();
            for (place, &(pose, stage)) in self.levels[level + 1].iter().enumerate() {
                self.places[(pose * stages + stage) as usize] = (place as u32, mark);
            }
            let (before, after) = self.alive.split_at_mut(level + 1);
            before[level].clear();
            for &(pose, stage) in &self.levels[level] {
                let v = poses.vertex(pose);
                let count = poses.next(pose, &mut next);
                let lives = next[..count].iter().any(|&pose| {
                    let u = poses.vertex(pose);
                    let stage = route.reached(stage, u);
                    let place = self.places[(pose * stages + stage) as usize];
                    place.1 == mark
                        && after[0][place.0 as usize]
                        && !constraints.forbids(v, u, time)
                });
                before[level].push(lives);
            }
        }
        depth + 1
    }

    fn next_mark(&mut self) -> u32 {
        if self.mark == u32::MAX {
            self.places.fill((0, 0));
            self.mark = 0;
        }
        self.mark += 1;
        self.mark
    }

    /// Per step the only cell in which paths of one cost are, or [`SEVERAL`].
    pub(crate) fn singletons(
        &mut self,
        poses: Poses<'_>,
        route: &Route,
        constraints: &Constraints,
        cost: u32,
        until: u32,
    ) -> Vec<Vertex> {
        let levels = self.build(poses, route, constraints, cost, until);
        (0..levels)
            .map(|level| {
                let mut cells = self.cells(poses, level);
                let first = cells.next().unwrap_or(SEVERAL);
                if cells.all(|v| v == first) {
                    first
                } else {
                    SEVERAL
                }
            })
            .collect()
    }

    /// Keeps those of the cells, each at a step, that paths of one cost come through.
    pub(crate) fn members(
        &mut self,
        poses: Poses<'_>,
        route: &Route,
        constraints: &Constraints,
        cost: u32,
        until: u32,
        cells: &mut Vec<(Vertex, u32)>,
    ) {
        let levels = self.build(poses, route, constraints, cost, until);
        cells.retain(|&(v, time)| {
            (time as usize) < levels && self.cells(poses, time as usize).any(|u| u == v)
        });
    }

    fn cells(&self, poses: Poses<'_>, level: usize) -> impl Iterator<Item = Vertex> {
        let states = self.levels[level].iter().zip(&self.alive[level]);
        states
            .filter(|(_, alive)| **alive)
            .map(move |((pose, _), _)| poses.vertex(*pose))
    }
}
