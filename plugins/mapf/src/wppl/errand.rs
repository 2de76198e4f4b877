//! The cost of a path in a window.
//!
//! It is that of EPIBT: of the steps up to the last goal that an agent knows, and of the way that is
//! left behind the window. No way leads along a move against a lane, so that one which is a short cut
//! makes a path cheaper than the way that an agent would go alone.

use std::sync::Arc;

use fleetyard_plugin_spacetime::graph::{Graph, Vertex};

use crate::epibt::operations::{Aim, Costs};
use crate::streets::ways::{Moves, Tolls, Ways, quarters};
use crate::streets::{ByStreet, STEP};

/// A goal of an agent.
#[derive(Debug)]
pub(super) struct Leg {
    pub(super) goal: Vertex,
    /// Costs of the way there, and which tolls they are made of.
    pub(super) ways: Option<(Arc<Ways>, usize)>,
    /// Cost of the way from there through all later goals.
    pub(super) after: u32,
}

/// The task of an agent.
#[derive(Debug)]
pub(super) struct Errand {
    pub(super) start: Vertex,
    /// The direction in which it looks, if that matters.
    pub(super) heading: Option<u8>,
    /// Its next goals.
    pub(super) legs: Vec<Leg>,
    /// True if it has to be at the last of them in the end.
    pub(super) stays: bool,
    /// Cost of the way through all of them, from the start.
    pub(super) rest: u32,
    /// The weight of its cost in the sum.
    pub(super) weight: u64,
}

/// An agent under way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Pose {
    pub(super) v: Vertex,
    pub(super) heading: Option<u8>,
    /// Goals that it has visited.
    pub(super) visited: usize,
}

impl Errand {
    /// The pose in which the agent begins.
    pub(super) fn begin(&self) -> Pose {
        self.arrived(Pose {
            v: self.start,
            heading: self.heading,
            visited: 0,
        })
    }

    /// Counts the goals that the agent has come to.
    #[inline]
    fn arrived(&self, mut pose: Pose) -> Pose {
        let count = self.legs.len() - usize::from(self.stays);
        while pose.visited < count && self.legs[pose.visited].goal == pose.v {
            pose.visited += 1;
        }
        pose
    }

    /// The cost of a step in which the agent stays: none where it wants to be.
    #[inline]
    pub(super) fn wait(&self, pose: Pose) -> u32 {
        match self.legs.get(pose.visited) {
            Some(leg) if leg.goal != pose.v => STEP,
            _ => 0,
        }
    }
}

/// The streets by which paths are valued.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ground<'a> {
    pub(super) graph: &'a Graph,
    pub(super) moves: &'a Moves,
    pub(super) streets: &'a ByStreet<'a>,
    /// True if a turn by 90° takes a step.
    pub(super) turning: bool,
}

impl Ground<'_> {
    /// The next goal, with the way there.
    #[inline]
    fn aim<'e>(&'e self, errand: &'e Errand, visited: usize) -> Option<(Aim<'e>, u32)> {
        let leg = errand.legs.get(visited)?;
        let ways = leg.ways.as_ref();
        let tolls = |number: usize| -> &'e Tolls { self.streets.tolls(number) };
        let aim = Aim {
            goal: leg.goal,
            costs: ways.map(|(ways, number)| Costs::Ways(ways, tolls(*number))),
        };
        Some((aim, leg.after))
    }

    /// The cost of the way through all goals that are left.
    #[inline]
    pub(super) fn rest(&self, errand: &Errand, pose: Pose) -> u32 {
        match self.aim(errand, pose.visited) {
            Some((aim, after)) => aim.from(self.graph, self.moves, pose.v, pose.heading) + after,
            None => 0,
        }
    }

    /// The cost of a step in which an agent turns by 90°.
    #[inline]
    pub(super) fn turn(&self, errand: &Errand, visited: usize) -> u32 {
        match self.aim(errand, visited) {
            Some((aim, _)) => aim.turn().max(STEP),
            None => 0,
        }
    }

    /// The cost of a move, with turns that take no step, and the pose after it.
    #[inline]
    pub(super) fn advance(&self, errand: &Errand, pose: Pose, d: usize) -> (u32, Pose) {
        let to = Pose {
            v: self.graph.around(pose.v)[d],
            heading: pose.heading.map(|_| d as u8),
            ..pose
        };
        let Some((aim, _)) = self.aim(errand, pose.visited) else {
            return (0, to);
        };
        let turns = pose.heading.map_or(0, |heading| quarters(heading, d));
        let turns = if self.turning { 0 } else { turns * aim.turn() };
        let cost = aim.toll(self.moves, pose.v, d) + turns;
        (cost, errand.arrived(to))
    }

    /// The cost of a path from the start to the end of the window. Robots that turn do so as early as
    /// they can, and at the end in the way that helps most.
    pub(super) fn cost(&self, errand: &Errand, path: &[Vertex]) -> u32 {
        let mut pose = errand.begin();
        let (mut cost, mut waited) = (0, 0);
        for &v in &path[1..] {
            if v == pose.v {
                cost += errand.wait(pose);
                waited += 1;
                continue;
            }
            let around = self.graph.around(pose.v);
            let d = around.iter().position(|u| *u == v).unwrap_or(0);
            let turns = pose.heading.map_or(0, |heading| quarters(heading, d));
            if self.turning {
                cost += turns * self.dearer(errand, pose);
                pose.heading = Some(d as u8);
            }
            let (step, to) = self.advance(errand, pose, d);
            cost += step;
            pose = to;
            waited = 0;
        }
        let ahead = self.rest(errand, pose);
        let turned = (0..4_u8).filter_map(|d| {
            let turns = quarters(pose.heading?, d.into());
            let heading = Some(d);
            (self.turning && turns <= waited).then(|| {
                turns * self.dearer(errand, pose) + self.rest(errand, Pose { heading, ..pose })
            })
        });
        cost + turned.min().map_or(ahead, |least| least.min(ahead))
    }

    /// Cost of a turn less that of a wait.
    fn dearer(&self, errand: &Errand, pose: Pose) -> u32 {
        let turn = self.turn(errand, pose.visited);
        turn.saturating_sub(errand.wait(pose))
    }
}
