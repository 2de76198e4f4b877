//! One step of all discs, in the manner of PIBT.
//!
//! K. Okumura, M. Machida, X. Défago, Y. Tamura, "Priority inheritance with backtracking for iterative multi-agent path finding",
//! AIJ 310, 2022. A disc takes the best edge, or stays; whoever is in the way has to move first, with the right of way of the one
//! that pushes. Here several may be in the way, at vertices and beside edges, and what did not lead to a step is taken back.

use std::cell::OnceCell;

use crate::closeness::Closeness;
use crate::roadmap::{Edge, NONE, Vertex};
use crate::sipp::Task;

/// Discs that may be pushed for the sake of one.
const PATIENCE: u32 = 64;

/// The edge that a disc drives, or none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Choice(pub Edge);

impl Choice {
    /// It stays.
    pub const STAY: Self = Self(NONE);
}

/// Makes steps.
#[derive(Debug)]
pub struct Generator<'a> {
    closeness: &'a Closeness,
    tasks: &'a [Task<'a>],
    /// Per edge those that nobody may drive at the same time.
    clashes: Vec<OnceCell<Box<[Edge]>>>,
    /// Per vertex the disc there at the beginning of the step.
    at: Vec<u32>,
    /// Per edge the disc that drives it.
    using: Vec<u32>,
    places: Vec<Vertex>,
    decided: Vec<bool>,
    edges: Vec<Edge>,
    /// Discs in the order in which they were decided about.
    trail: Vec<u32>,
    patience: u32,
    /// Cost of staying a step away from the goal, in seconds: of half a drive of middling length.
    wait: f64,
}

impl<'a> Generator<'a> {
    /// For discs that go to the goals where they stay.
    pub fn new(closeness: &'a Closeness, tasks: &'a [Task<'a>]) -> Self {
        let roadmap = closeness.roadmap();
        Self {
            clashes: vec![OnceCell::new(); roadmap.edges()],
            at: vec![NONE; roadmap.vertices()],
            using: vec![NONE; roadmap.edges()],
            places: Vec::new(),
            decided: vec![false; tasks.len()],
            edges: vec![NONE; tasks.len()],
            trail: Vec::new(),
            patience: 0,
            wait: 0.5 * roadmap.mean_duration(),
            closeness,
            tasks,
        }
    }

    /// A step from places, with the edge of each disc: those that are fixed, and for the others, in the order of their priorities,
    /// what is best. None if those that are fixed do not go together.
    pub fn successor(
        &mut self,
        places: &[Vertex],
        order: &[u32],
        fixed: &[(u32, Choice)],
    ) -> Option<&[Edge]> {
        for place in self.places.drain(..) {
            self.at[place as usize] = NONE;
        }
        self.undo(0);
        self.places.extend_from_slice(places);
        for (disc, place) in places.iter().enumerate() {
            self.at[*place as usize] = disc as u32;
        }
        for (disc, choice) in fixed {
            if !self.is_free(*disc, *choice) {
                return None;
            }
            self.decide(*disc, *choice);
        }
        for (disc, choice) in fixed {
            if !self.push(*disc, *choice) {
                return None;
            }
        }
        for disc in order {
            self.patience = PATIENCE;
            if !self.decided[*disc as usize] && !self.plan(*disc) {
                return None;
            }
        }
        Some(&self.edges)
    }

    /// Decides about a disc, and about whoever is in its way. False if it can neither drive nor stay.
    fn plan(&mut self, disc: u32) -> bool {
        let mut choices = self.choices(disc);
        if self.patience == 0 {
            choices.retain(|(_, choice)| *choice == Choice::STAY);
        }
        self.patience = self.patience.saturating_sub(1);
        for (_, choice) in choices {
            if !self.is_free(disc, choice) {
                continue;
            }
            let before = self.trail.len();
            self.decide(disc, choice);
            if self.push(disc, choice) {
                return true;
            }
            self.undo(before);
        }
        false
    }

    /// Decides about those who stand in the way of a disc. False if one of them can neither drive nor stay.
    fn push(&mut self, disc: u32, choice: Choice) -> bool {
        let Choice(edge) = choice;
        if edge == NONE {
            return true;
        }
        let closeness = self.closeness;
        closeness.vertices_of_edge(edge).all(|(vertex, _)| {
            let other = self.at[vertex as usize];
            other == NONE || other == disc || self.decided[other as usize] || self.plan(other)
        })
    }

    /// The choices of a disc with the seconds that they leave, the best first.
    fn choices(&self, disc: u32) -> Vec<(f64, Choice)> {
        let roadmap = self.closeness.roadmap();
        let (place, rest) = (self.places[disc as usize], self.tasks[disc as usize].rest);
        let here = rest.from(roadmap, 0, place, |_| 0.0);
        let stay = if rest.is_over(0, place) {
            0.0
        } else {
            here + self.wait
        };
        let leaving = roadmap.leaving(place).map(|edge| {
            let after = rest.from(roadmap, 0, roadmap.target(edge), |_| 0.0);
            (roadmap.duration(edge) + after, Choice(edge))
        });
        let mut choices: Vec<(f64, Choice)> =
            leaving.filter(|(left, _)| left.is_finite()).collect();
        choices.push((stay, Choice::STAY));
        choices.sort_by(|one, other| one.0.total_cmp(&other.0));
        choices
    }

    /// True if a choice keeps a disc away from those that were decided about.
    fn is_free(&self, disc: u32, Choice(edge): Choice) -> bool {
        let stands = |vertex: Vertex| {
            let other = self.at[vertex as usize];
            other != NONE
                && other != disc
                && self.decided[other as usize]
                && self.edges[other as usize] == NONE
        };
        if edge == NONE {
            let place = self.places[disc as usize];
            let near = self.closeness.edges_of_vertex(place).iter();
            return near
                .map(|(edge, _)| edge)
                .all(|edge| self.using[*edge as usize] == NONE);
        }
        let mut near = self.closeness.vertices_of_edge(edge);
        near.all(|(vertex, _)| !stands(vertex))
            && self
                .clashing(edge)
                .iter()
                .all(|other| self.using[*other as usize] == NONE)
    }

    /// The edges that nobody may drive in a step in which somebody drives this one.
    fn clashing(&self, edge: Edge) -> &[Edge] {
        self.clashes[edge as usize].get_or_init(|| {
            let (roadmap, closeness) = (self.closeness.roadmap(), self.closeness);
            // Motions have to miss each other by so many seconds, seen from either.
            let rounding = closeness.rounding();
            let here = closeness.edges_of_edge(edge);
            let at_once = here.filter(|(_, later)| later.low < rounding && later.high > -rounding);
            // Who arrives first stands there until the other has arrived.
            let early = |first: Edge, other: Edge| {
                let mut near = closeness.vertices_of_edge(other);
                near.any(|(vertex, near)| {
                    vertex == roadmap.target(first)
                        && near.high > roadmap.duration(first) - rounding
                })
            };
            let near = closeness.edges_of_vertex(roadmap.target(edge)).iter();
            let parked = near
                .filter(|(_, near)| near.high > roadmap.duration(edge) - rounding)
                .map(|(other, _)| *other);
            let near = closeness.vertices_of_edge(edge);
            let passed = near.flat_map(|(vertex, _)| {
                let entering = roadmap.entering(vertex).iter().copied();
                entering.filter(|first| early(*first, edge))
            });
            let mut all: Vec<Edge> = at_once
                .map(|(other, _)| other)
                .chain(parked)
                .chain(passed)
                .collect();
            all.sort_unstable();
            all.dedup();
            all.into()
        })
    }

    fn decide(&mut self, disc: u32, Choice(edge): Choice) {
        self.decided[disc as usize] = true;
        self.edges[disc as usize] = edge;
        if edge != NONE {
            self.using[edge as usize] = disc;
        }
        self.trail.push(disc);
    }

    /// Takes decisions back but for the first ones.
    fn undo(&mut self, kept: usize) {
        for disc in self.trail.drain(kept..) {
            self.decided[disc as usize] = false;
            let edge = std::mem::replace(&mut self.edges[disc as usize], NONE);
            if edge != NONE {
                self.using[edge as usize] = NONE;
            }
        }
    }
}
