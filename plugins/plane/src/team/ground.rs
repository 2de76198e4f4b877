//! Places of a disc among obstacles at rest, and the straight lines between them that it may drive.
//!
//! There are two kinds of places. *Turns* stand round corners that stick out: the corners of a line round the circle of the
//! disc's radius, so that lines between turns that bend the right way are the tangent graph with arcs of few corners
//! ([`crate::tangent`] has true arcs). *Bays* are where a disc may wait or go aside for others: a hexagonal lattice, and rings
//! round the starts and goals of others. Lines are found when they are asked for, and kept for all searches.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::f64::consts::{PI, TAU};

use crate::Vector;
use crate::bins::{Bins, Rectangle};
use crate::obstacles::{Disc, Obstacles};

/// Longest turn of an arc that is one place, in radians: 20 degrees. The line is longer than the arc by 1.1 % of it at most.
const STEP: f64 = PI / 9.0;
/// Sine of an angle by which a line may bend the wrong way at a turn: what is rounded must not be lost.
const LEVEL: f64 = 1e-6;
/// Turns are so much farther from corners than the radius, in metres, that rounding makes no contact.
const CLEARANCE: f64 = 1e-7;
/// Distance of neighbours in the lattice, in radii.
const SPACING: f64 = 2.5;
/// Longest line to a bay, in that distance.
const REACH: f64 = 3.1;
/// Most lines from a place to bays, the shortest first.
const MOST_LINES: usize = 40;
/// Most places of the lattice.
const MOST_BAYS: usize = 10_000;
/// Bays round a start or a goal.
const RING: u32 = 6;

/// A straight line to a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Line {
    /// The place where it ends.
    pub to: u32,
    /// Metres.
    pub length: f64,
}

/// A turn: the direction away from the corner, of length 1, and the largest sine of the angle from a line of it to a line
/// that touches the circle there.
#[derive(Debug, Clone, Copy)]
struct Bend {
    outward: Vector,
    sine: f64,
}

/// Places for the discs of one radius.
#[derive(Debug)]
pub struct Ground {
    obstacles: Obstacles,
    /// Turns, then bays.
    places: Vec<Vector>,
    bends: Vec<Bend>,
    bays: Bins,
    reach: f64,
    to_turns: Vec<Option<Box<[Line]>>>,
    to_bays: Vec<Option<Box<[Line]>>>,
}

impl Ground {
    /// Among these obstacles, with so many bays at most. Rings of bays are made round `others`: the place of each and the
    /// distance that centres have to keep from it. The places of `ways` are turns that bend any way.
    pub fn new(obstacles: Obstacles, most: usize, others: &[Disc], ways: &[Vec<Vector>]) -> Self {
        let radius = obstacles.radius();
        let (mut places, mut bends) = (Vec::new(), Vec::new());
        for corner in obstacles.corners() {
            let Some([before, after]) = corner.normals else {
                continue;
            };
            let angle = libm::atan2(before.x * after.y - before.y * after.x, before.dot(&after));
            let pieces = (angle / STEP).ceil().max(1.0);
            let half = angle / pieces / 2.0;
            for piece in 0..pieces as u32 {
                let outward = turned(before, half * f64::from(2 * piece + 1));
                let at = corner.at + outward * ((radius + CLEARANCE) / libm::cos(half));
                if obstacles.free(at) {
                    places.push(at);
                    bends.push(Bend {
                        outward,
                        sine: libm::sin(half) + LEVEL,
                    });
                }
            }
        }
        for at in ways.iter().flatten() {
            places.push(*at);
            bends.push(Bend {
                outward: Vector::zeros(),
                sine: 1.0,
            });
        }
        let turns = places.len();
        let in_rings = others.len() * RING as usize;
        let (others, most) = if in_rings > most / 2 {
            (&[][..], most)
        } else {
            (others, most - in_rings)
        };
        let most = most.clamp(1, MOST_BAYS) as f64;
        let (lattice, spacing) = lattice(obstacles.inner(), SPACING * radius, most);
        let rings = others.iter().flat_map(|other| {
            let away = other.radius / libm::cos(PI / f64::from(RING));
            (0..RING).map(move |step| {
                let angle = TAU * f64::from(step) / f64::from(RING);
                other.at + turned(Vector::new(away, 0.0), angle)
            })
        });
        // A bay too narrow for the lattice may hold a place beside it.
        let shifted = lattice.filter_map(|at| {
            let beside = (0..6).map(|step| {
                let angle = TAU * f64::from(step) / 6.0;
                at + turned(Vector::new(spacing / 3.0, 0.0), angle)
            });
            let mut tried = std::iter::once(at).chain(beside);
            tried.find(|at| obstacles.free(*at))
        });
        places.extend(shifted.chain(rings.filter(|at| obstacles.free(*at))));
        let bays = places[turns..].iter();
        Self {
            // So wide that a bin holds a few.
            bays: Bins::new(
                bays.map(|at| Rectangle::around(*at, *at, spacing))
                    .collect(),
            ),
            reach: REACH * spacing,
            to_turns: vec![None; places.len()],
            to_bays: vec![None; places.len()],
            obstacles,
            places,
            bends,
        }
    }

    /// Number of places.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// True without places.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// A place.
    pub fn at(&self, place: u32) -> Vector {
        self.places[place as usize]
    }

    /// The obstacles.
    pub fn obstacles(&self) -> &Obstacles {
        &self.obstacles
    }

    /// The lines from a place to turns where a shortest path may go on.
    pub fn to_turns(&mut self, place: u32) -> &[Line] {
        let at = place as usize;
        if self.to_turns[at].is_none() {
            self.to_turns[at] = Some(self.turns_from(self.places[at], self.bends.get(at)).into());
        }
        self.to_turns[at].as_deref().unwrap_or_default()
    }

    /// The lines from a place to bays that are near.
    pub fn to_bays(&mut self, place: u32) -> &[Line] {
        let at = place as usize;
        if self.to_bays[at].is_none() {
            self.to_bays[at] = Some(self.bays_from(self.places[at]).into());
        }
        self.to_bays[at].as_deref().unwrap_or_default()
    }

    /// The lines from a place that bends as said, or any way.
    fn turns_from(&self, at: Vector, bend: Option<&Bend>) -> Vec<Line> {
        let taut = |bend: &Bend, between: Vector| {
            let across = bend.outward.dot(&between);
            across * across <= bend.sine * bend.sine * between.norm_squared()
        };
        let turns = self.bends.iter().zip(&self.places).zip(0..);
        let lines = turns.filter_map(|((other, place), to)| {
            let between = place - at;
            let bends = taut(other, between) && bend.is_none_or(|bend| taut(bend, between));
            bends.then(|| self.line(at, to)).flatten()
        });
        lines.collect()
    }

    fn bays_from(&self, at: Vector) -> Vec<Line> {
        let turns = self.bends.len() as u32;
        let mut lines: Vec<Line> = Vec::new();
        self.bays
            .meeting(&Rectangle::around(at, at, self.reach), |bay| {
                let to = turns + bay;
                if (self.at(to) - at).norm_squared() <= self.reach * self.reach {
                    lines.extend(self.line(at, to));
                }
            });
        // Beside many starts and goals there are many bays.
        lines.sort_by(|a, b| a.length.total_cmp(&b.length).then(a.to.cmp(&b.to)));
        lines.truncate(MOST_LINES);
        lines
    }

    fn line(&self, at: Vector, to: u32) -> Option<Line> {
        let length = (self.at(to) - at).norm();
        let clear = length > 0.0 && self.obstacles.clear(at, self.at(to));
        clear.then_some(Line { to, length })
    }
}

/// The places of a hexagonal lattice in a box, about `most`, and the distance of neighbours, which is at least `spacing`.
fn lattice(within: Rectangle, spacing: f64, most: f64) -> (impl Iterator<Item = Vector>, f64) {
    let extent = (within.max - within.min).sup(&Vector::zeros());
    let least = (extent.x * extent.y / most / ROW).sqrt();
    let spacing = spacing
        .max(least)
        .max(extent.max() / most)
        .max(f64::MIN_POSITIVE);
    let count = |length: f64, step: f64| (length / step) as u32 + 1;
    let (columns, rows) = (count(extent.x, spacing), count(extent.y, spacing * ROW));
    // What is left over at the borders is shared by both sides.
    let rest = |length: f64, step: f64, count: u32| (length - step * f64::from(count - 1)) / 2.0;
    let first = within.min
        + Vector::new(
            rest(extent.x, spacing, columns),
            rest(extent.y, spacing * ROW, rows),
        );
    let places = (0..rows).flat_map(move |row| {
        (0..columns).map(move |column| {
            let shift = if row % 2 == 1 { 0.5 } else { 0.0 };
            first + Vector::new(f64::from(column) + shift, f64::from(row) * ROW) * spacing
        })
    });
    (places, spacing)
}

/// Distance of two rows of a hexagonal lattice, in that of neighbours.
const ROW: f64 = 0.866_025_403_784_438_6;

fn turned(vector: Vector, angle: f64) -> Vector {
    let (sin, cos) = (libm::sin(angle), libm::cos(angle));
    Vector::new(
        vector.x * cos - vector.y * sin,
        vector.x * sin + vector.y * cos,
    )
}

/// Lengths of ways to a goal.
#[derive(Debug)]
pub struct Distances {
    goal: Vector,
    /// From turns, on ways that may go on from a line that bends the right way there.
    turns: Vec<f64>,
    /// From every place that was asked for, else NaN, and true where the goal is seen.
    places: Vec<(f64, bool)>,
}

/// A turn that waits to be settled; the greatest is the nearest.
#[derive(PartialEq)]
struct Waiting(f64, u32);

impl Eq for Waiting {}

impl PartialOrd for Waiting {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Waiting {
    fn cmp(&self, other: &Self) -> Ordering {
        other.0.total_cmp(&self.0).then(other.1.cmp(&self.1))
    }
}

impl Distances {
    /// To a goal on this ground; none if it is told to stop.
    pub fn new(ground: &mut Ground, goal: Vector, stop: &mut dyn FnMut() -> bool) -> Option<Self> {
        let mut turns = vec![f64::INFINITY; ground.bends.len()];
        let mut open = BinaryHeap::new();
        for line in ground.turns_from(goal, None) {
            turns[line.to as usize] = line.length;
            open.push(Waiting(line.length, line.to));
        }
        while let Some(Waiting(length, turn)) = open.pop() {
            if length > turns[turn as usize] {
                continue;
            }
            if stop() {
                return None;
            }
            for line in ground.to_turns(turn) {
                let (to, longer) = (line.to as usize, length + line.length);
                if longer < turns[to] {
                    turns[to] = longer;
                    open.push(Waiting(longer, line.to));
                }
            }
        }
        Some(Self {
            goal,
            turns,
            places: vec![(f64::NAN, false); ground.len()],
        })
    }

    /// The goal.
    pub fn goal(&self) -> Vector {
        self.goal
    }

    /// The length of the shortest way from a place, infinite without one, and true if it is straight.
    pub fn from(&mut self, ground: &mut Ground, place: u32) -> (f64, bool) {
        let known = self.places[place as usize];
        if !known.0.is_nan() {
            return known;
        }
        let at = ground.at(place);
        let found = if ground.obstacles.clear(at, self.goal) {
            ((self.goal - at).norm(), true)
        } else {
            (self.over(ground.to_turns(place)), false)
        };
        self.places[place as usize] = found;
        found
    }

    /// The least length over lines to turns.
    fn over(&self, lines: &[Line]) -> f64 {
        let lengths = lines
            .iter()
            .map(|line| line.length + self.turns[line.to as usize]);
        lengths.fold(f64::INFINITY, f64::min)
    }
}

/// A disc's start and goal, joined to the ground.
#[derive(Debug)]
pub struct Course {
    /// The place at the beginning.
    pub start: Vector,
    /// The lines from there.
    pub lines: Vec<Line>,
    /// The length of the shortest way, infinite without one, and true if it is straight.
    pub from_start: (f64, bool),
    /// To the goal.
    pub distances: Distances,
}

impl Course {
    /// None if it is told to stop.
    pub fn new(
        ground: &mut Ground,
        [start, goal]: [Vector; 2],
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<Self> {
        let distances = Distances::new(ground, goal, stop)?;
        let mut lines = ground.turns_from(start, None);
        let from_start = if ground.obstacles.clear(start, goal) {
            ((goal - start).norm(), true)
        } else {
            (distances.over(&lines), false)
        };
        lines.extend(ground.bays_from(start));
        Some(Self {
            start,
            lines,
            from_start,
            distances,
        })
    }
}
