//! Rapidly-exploring random trees in place, heading and time (S. M. LaValle, J. J. Kuffner, IJRR 20(5), 2001).
//!
//! A vertex is a stay: a pose, the time at which the robot comes to rest there, and the time until which it may rest. An edge is
//! a motion from rest to rest that begins at any time of the stay at which nothing is in the way, so that waits need not be
//! sampled. Of the vertices near a sample that becomes the parent from which it is reached first.

use std::f64::consts::TAU;
use std::rc::Rc;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::sssp::bodies::{Pose, wrapped};
use fleetyard_plugin_spacetime::random::Random;

use super::Options;
use super::barred::{Barred, Stay};
use super::edge::{Edge, Walker};
use super::way::{Way, along};
use crate::robot::State;

/// Vertices that may become the parent of a new one.
const PARENTS: usize = 5;

/// Motions to a sample that are tried, each half as long as the one before.
const HALVINGS: usize = 3;

/// Most pieces between two poses of a guide.
const MOST_PIECES: f64 = 1000.0;

/// Metres, and radians, between poses of a guide that are tried.
const PIECE: f64 = 0.4;

/// A tree that has grown.
#[derive(Debug)]
pub struct Grown {
    /// The way to the goal, if one was found.
    pub way: Option<Way>,
    /// The time from which on the goal is free.
    pub free: f64,
    /// Samples that were drawn.
    pub samples: u64,
    /// Its edges, as pairs of places.
    pub lines: Vec<[[f64; 2]; 2]>,
}

struct Vertex {
    state: State,
    stay: Stay,
    parent: usize,
    /// The motion that leads here, and its beginning.
    by: Option<(Rc<Edge>, f64)>,
}

/// A tree that grows.
pub struct Tree<'a> {
    walker: &'a Walker,
    barred: &'a Barred<'a>,
    options: &'a Options,
    bounds: Rectangle,
    /// Poses that lead to the goal if nothing new is in the way.
    guide: &'a [Pose],
    vertices: Vec<Vertex>,
    free: f64,
}

impl<'a> Tree<'a> {
    /// A tree of one robot.
    pub fn new(
        walker: &'a Walker,
        barred: &'a Barred<'a>,
        options: &'a Options,
        bounds: Rectangle,
        guide: &'a [Pose],
    ) -> Self {
        Self {
            walker,
            barred,
            options,
            bounds,
            guide,
            vertices: Vec::new(),
            free: 0.0,
        }
    }

    /// Grows until it reaches the goal, or so many samples are drawn, or `more` says no.
    pub fn grow(
        mut self,
        samples: u64,
        random: &mut Random,
        more: &mut dyn FnMut() -> bool,
    ) -> Grown {
        let mut drawn = 0;
        let way = self.search(samples, random, more, &mut drawn);
        let lines = self.vertices.iter().skip(1).map(|vertex| {
            let from = self.vertices[vertex.parent].state.at;
            [from, vertex.state.at].map(|at| [at.x, at.y])
        });
        Grown {
            way,
            free: self.free,
            samples: drawn,
            lines: lines.collect(),
        }
    }

    fn search(
        &mut self,
        samples: u64,
        random: &mut Random,
        more: &mut dyn FnMut() -> bool,
        drawn: &mut u64,
    ) -> Option<Way> {
        let walker = self.walker;
        let goal = walker.member.goal;
        let root = walker.root;
        let ready = walker.braking.map_or(0.0, |braking| braking.seconds);
        let stay = self.barred.stay(&root.pose(), ready)?;
        if goal.is_reached(&root) && stay.until == f64::INFINITY {
            return Some(Way::resting(stay));
        }
        // Where any place will do, it has to be one that is free for ever.
        let anywhere = goal.place_m.is_infinite();
        if !anywhere {
            self.free = self.barred.free_from(&goal.state.pose())?;
        }
        self.vertices.push(Vertex {
            state: root,
            stay,
            parent: 0,
            by: None,
        });
        if !anywhere && let Some(way) = self.finish(0) {
            return Some(way);
        }
        let led = led(self.guide);
        let mut led = led.iter();
        while *drawn < samples && more() {
            *drawn += 1;
            let wanted = led.next().copied();
            let wanted = wanted.unwrap_or_else(|| self.sample(random));
            let Some(added) = self.extend(&wanted, random) else {
                continue;
            };
            let vertex = &self.vertices[added];
            let is_end = vertex.stay.until == f64::INFINITY && goal.is_reached(&vertex.state);
            if is_end {
                return Some(self.way(added));
            }
            if !anywhere && let Some(way) = self.finish(added) {
                return Some(way);
            }
        }
        None
    }

    /// A pose: near the guide, or anywhere.
    fn sample(&self, random: &mut Random) -> Pose {
        let has_heading = self.walker.member.robot.has_heading;
        let any_turn = |random: &mut Random| (random.share() - 0.5) * TAU;
        if !self.guide.is_empty() && random.share() < self.options.guide_bias {
            let at = random.below(self.guide.len());
            let (one, next) = (
                self.guide[at],
                self.guide[(at + 1).min(self.guide.len() - 1)],
            );
            let pose = one.toward(&next, random.share());
            let spread = self.options.spread_m * random.share();
            let offset = Vector::new(spread, 0.0);
            let offset = crate::robot::rotated(offset, any_turn(random));
            let turn = if random.one_in(2) {
                0.0
            } else {
                any_turn(random) * 0.5
            };
            return Pose {
                at: pose.at + offset,
                heading: if has_heading {
                    pose.heading + turn
                } else {
                    0.0
                },
            };
        }
        let extent = self.bounds.max - self.bounds.min;
        let share = Vector::new(random.share(), random.share());
        let at = self.bounds.min + extent.component_mul(&share);
        let goal = &self.walker.member.goal.state;
        let heading = match random.below(4) {
            _ if !has_heading => 0.0,
            0 => goal.heading,
            1 => along(&goal.pose(), at, true),
            _ => any_turn(random),
        };
        Pose { at, heading }
    }

    /// The vertices nearest to a pose, the nearest first.
    fn nearest(&self, wanted: &Pose) -> Vec<(f64, usize)> {
        let speeds = self.walker.speeds();
        let mut best: Vec<(f64, usize)> = Vec::with_capacity(PARENTS + 1);
        for (number, vertex) in self.vertices.iter().enumerate() {
            let seconds = speeds.seconds(&vertex.state.pose(), wanted);
            if best.len() == PARENTS && seconds >= best[PARENTS - 1].0 {
                continue;
            }
            let place = best.partition_point(|(known, _)| *known <= seconds);
            best.insert(place, (seconds, number));
            best.truncate(PARENTS);
        }
        best
    }

    /// A new vertex at a pose, or on the way there.
    fn extend(&mut self, wanted: &Pose, random: &mut Random) -> Option<usize> {
        let near = self.nearest(wanted);
        let (seconds, nearest) = *near.first()?;
        let from = self.vertices[nearest].state.pose();
        let most = self.options.step_m / self.walker.speeds().travel().max(f64::MIN_POSITIVE);
        let mut wanted = *wanted;
        if seconds > most {
            wanted = from.toward(&wanted, most / seconds);
            // A body that is faster ahead had better look where it goes.
            if self.walker.member.robot.has_heading && random.one_in(2) {
                wanted.heading = along(&from, wanted.at, false);
            }
        }
        // As far as it is clear, more or less.
        let mut near = &near[..];
        for _ in 0..HALVINGS {
            if self.walker.is_free(&wanted)
                && let Some(added) = self.reach(near, &wanted)
            {
                return Some(added);
            }
            near = &near[..1];
            wanted = from.toward(&wanted, 0.5);
        }
        None
    }

    /// A new vertex at a pose by a motion from one of these, from where it is there first.
    fn reach(&mut self, near: &[(f64, usize)], wanted: &Pose) -> Option<usize> {
        let speeds = self.walker.speeds();
        let mut parents: Vec<(f64, usize)> = near
            .iter()
            .map(|(_, number)| {
                let vertex = &self.vertices[*number];
                let seconds = speeds.seconds(&vertex.state.pose(), wanted);
                (vertex.stay.from + seconds, *number)
            })
            .collect();
        parents.sort_by(|one, other| one.0.total_cmp(&other.0).then(one.1.cmp(&other.1)));
        parents
            .into_iter()
            .find_map(|(_, parent)| self.joined(parent, wanted, false, 0.0))
    }

    /// A new vertex at a pose by a motion from another one, which ends at a time or later.
    fn joined(
        &mut self,
        parent: usize,
        to: &Pose,
        heading_free: bool,
        not_before: f64,
    ) -> Option<usize> {
        let vertex = &self.vertices[parent];
        let edge = self.walker.edge(&vertex.state, to, heading_free)?;
        let earliest = not_before - edge.seconds;
        let (departure, stay) = self.barred.depart(&vertex.stay, &edge, earliest)?;
        self.vertices.push(Vertex {
            state: edge.end,
            stay,
            parent,
            by: Some((Rc::new(edge), departure)),
        });
        Some(self.vertices.len() - 1)
    }

    /// The way to the goal by a motion from a vertex.
    fn finish(&mut self, from: usize) -> Option<Way> {
        let goal = self.walker.member.goal;
        let last = self.joined(from, &goal.state.pose(), goal.free.heading, self.free)?;
        let vertex = &self.vertices[last];
        let is_end = vertex.stay.until == f64::INFINITY && goal.is_reached(&vertex.state);
        is_end.then(|| self.way(last))
    }

    fn way(&self, last: usize) -> Way {
        let mut way = Way::resting(self.vertices[last].stay);
        let mut at = last;
        while let Some((edge, departure)) = &self.vertices[at].by {
            way.edges.push(edge.clone());
            way.departures.push(*departure);
            at = self.vertices[at].parent;
            way.stays.push(self.vertices[at].stay);
        }
        way.edges.reverse();
        way.departures.reverse();
        way.stays.reverse();
        way
    }
}

/// The poses of a guide, then others between them.
fn led(guide: &[Pose]) -> Vec<Pose> {
    let mut poses = guide.to_vec();
    for pair in guide.windows(2) {
        let turn = wrapped(pair[1].heading - pair[0].heading).abs();
        let pieces = (pair[1].at - pair[0].at).norm().max(turn) / PIECE;
        let pieces = pieces.ceil().clamp(1.0, MOST_PIECES);
        let between = (1..pieces as u32).map(|piece| f64::from(piece) / pieces);
        poses.extend(between.map(|part| pair[0].toward(&pair[1], part)));
    }
    poses
}
