//! Members of a neighbourhood, and the ways on which they are found.

use std::collections::VecDeque;

use fleetyard_plugin_spacetime::random::Random;

use crate::crowd::Crowd;
use crate::roadmap::{NONE, Roadmap, Vertex};

/// Edges of a walk over the roadmap in search of somebody.
const WALK: usize = 32;
/// Walks tried for each place that is left in a neighbourhood.
const WALKS: usize = 4;

/// A neighbourhood that grows up to a size.
#[derive(Debug)]
pub(super) struct Members {
    list: Vec<u32>,
    chosen: Vec<bool>,
    size: usize,
    /// Per vertex the number of the last round that came there.
    seen: Vec<u32>,
    round: u32,
}

impl Members {
    pub(super) fn new(discs: usize, vertices: usize) -> Self {
        Self {
            list: Vec::new(),
            chosen: vec![false; discs],
            size: 0,
            seen: vec![0; vertices],
            round: 0,
        }
    }

    /// Begins with nobody.
    pub(super) fn begin(&mut self, size: usize) {
        self.size = size;
    }

    /// Gives the members, and has none after that.
    pub(super) fn finish(&mut self) -> Vec<u32> {
        let list = std::mem::take(&mut self.list);
        for disc in &list {
            self.chosen[*disc as usize] = false;
        }
        list
    }

    pub(super) fn is_full(&self) -> bool {
        self.list.len() >= self.size
    }

    pub(super) fn as_slice(&self) -> &[u32] {
        &self.list
    }

    /// Makes a disc a member, if there is room.
    pub(super) fn take(&mut self, disc: u32) {
        if !self.is_full() && !self.chosen[disc as usize] {
            self.chosen[disc as usize] = true;
            self.list.push(disc);
        }
    }

    /// Takes discs, who may come more than once, in random order.
    pub(super) fn take_all(&mut self, mut discs: Vec<u32>, random: &mut Random) {
        discs.sort_unstable();
        discs.dedup();
        random.shuffle(&mut discs);
        for disc in discs {
            self.take(disc);
        }
    }

    /// Takes those that are met on walks which begin on the path of a member.
    pub(super) fn walk(&mut self, roadmap: &Roadmap, crowd: &Crowd<'_>, random: &mut Random) {
        for _ in 0..WALKS * self.size {
            if self.is_full() || self.list.is_empty() {
                return;
            }
            let path = crowd.path(self.list[random.below(self.list.len())]);
            let Some(visit) = path.get(random.below(path.len())) else {
                return;
            };
            let (mut vertex, mut time) = (visit.vertex, visit.arrival);
            for _ in 0..WALK {
                let leaving = roadmap.leaving(vertex);
                if leaving.is_empty() {
                    break;
                }
                let edge = leaving.start + random.below(leaving.len()) as u32;
                let there = crowd.claims_to_edge(edge).iter();
                let mut there =
                    there.filter(|claim| claim.span.low < time && time < claim.span.high);
                if let Some(claim) = there.find(|claim| !self.chosen[claim.disc as usize]) {
                    self.take(claim.disc);
                    break;
                }
                (vertex, time) = (roadmap.target(edge), time + roadmap.duration(edge));
            }
        }
    }

    /// Takes those that are near a vertex at any time, then near those around it, and so on.
    pub(super) fn around(
        &mut self,
        roadmap: &Roadmap,
        crowd: &Crowd<'_>,
        center: Vertex,
        random: &mut Random,
    ) {
        self.round += 1;
        self.seen[center as usize] = self.round;
        let mut queue = VecDeque::from([center]);
        while let Some(vertex) = queue.pop_front() {
            if self.is_full() {
                return;
            }
            let near = crowd.claims_to(vertex).iter().map(|claim| claim.disc);
            self.take_all(near.collect(), random);
            for edge in roadmap.leaving(vertex) {
                let next = roadmap.target(edge);
                if self.seen[next as usize] != self.round {
                    self.seen[next as usize] = self.round;
                    queue.push_back(next);
                }
            }
        }
    }

    /// Takes those that park near the path of a disc, and those that pass its goal.
    pub(super) fn parking(&mut self, crowd: &Crowd<'_>, disc: u32, random: &mut Random) {
        let path = crowd.path(disc);
        let claims = path.iter().flat_map(|visit| {
            let is_goal = visit.onward == NONE;
            let near = crowd.claims_to(visit.vertex).iter();
            near.filter(move |claim| is_goal || claim.span.high == f64::INFINITY)
        });
        let others = claims.map(|claim| claim.disc);
        self.take_all(others.filter(|other| *other != disc).collect(), random);
    }
}

/// A number with a probability in proportion to its weight.
pub(super) fn by_weight(weights: &[f64], random: &mut Random) -> Option<u32> {
    let total: f64 = weights.iter().sum();
    let mut left = total * random.below(1 << 24) as f64 / f64::from(1 << 24);
    let found = weights.iter().position(|weight| {
        left -= weight;
        left < 0.0
    });
    // What rounding leaves goes to the last one with a weight.
    let last = || weights.iter().rposition(|weight| *weight > 0.0);
    found.or_else(last).map(|number| number as u32)
}
