//! Ways of one robot: motions from rest to rest with waits between them, and shorter ones by shortcuts.

use std::f64::consts::{PI, TAU};
use std::rc::Rc;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::sssp::bodies::{Pose, wrapped};
use fleetyard_plugin_spacetime::random::Random;

use super::barred::{Barred, Stay};
use super::blend::blended;
use super::edge::{Edge, Walker};
use crate::course::{Course, Segment};
use crate::robot::State;
use crate::steer::steer;

/// A way has to be shorter by so many seconds to be taken instead of another.
const SHORTER: f64 = 1e-6;

/// Motions one after the other.
#[derive(Debug, Clone)]
pub struct Way {
    /// The stay before each motion, and after the last one.
    pub stays: Vec<Stay>,
    /// When each motion begins, in seconds.
    pub departures: Vec<f64>,
    /// The motions.
    pub edges: Vec<Rc<Edge>>,
}

impl Way {
    /// Of a robot that stays where it is.
    pub fn resting(stay: Stay) -> Self {
        Self {
            stays: vec![stay],
            departures: Vec::new(),
            edges: Vec::new(),
        }
    }

    /// When it is at rest for ever, in seconds.
    pub fn arrival(&self) -> f64 {
        self.stays[self.edges.len()].from
    }

    /// Seconds in motion.
    fn moving(&self) -> f64 {
        self.edges.iter().map(|edge| edge.seconds).sum()
    }

    /// Its controls.
    pub fn course(&self, walker: &Walker) -> Course {
        let mut segments: Vec<Segment> = walker.braking.into_iter().collect();
        for ((stay, departure), edge) in self.stays.iter().zip(&self.departures).zip(&self.edges) {
            if *departure > stay.from {
                segments.push(Segment {
                    control: [0.0; 3],
                    seconds: departure - stay.from,
                });
            }
            segments.extend(&edge.segments);
        }
        Course {
            start: walker.member.start,
            segments,
        }
    }

    /// The poses at which it rests.
    pub fn poses(&self, walker: &Walker) -> Vec<Pose> {
        let ends = self.edges.iter().map(|edge| edge.end.pose());
        std::iter::once(walker.root.pose()).chain(ends).collect()
    }

    /// The same motions among other bodies; none where they do not lead to a stay without end.
    pub fn again(&self, walker: &Walker, barred: &Barred<'_>, free: f64) -> Option<Self> {
        let root = barred.stay(&walker.root.pose(), self.stays[0].from)?;
        Self::resting(root).timed(barred, 0, self.edges.clone(), free)
    }

    /// The same motions from the one with this number on, at the earliest departures that are found.
    fn timed(
        &self,
        barred: &Barred<'_>,
        kept: usize,
        edges: Vec<Rc<Edge>>,
        free: f64,
    ) -> Option<Self> {
        let mut way = Self {
            stays: self.stays[..=kept].to_vec(),
            departures: self.departures[..kept].to_vec(),
            edges,
        };
        for number in kept..way.edges.len() {
            let edge = &way.edges[number];
            let earliest = if number + 1 == way.edges.len() {
                free - edge.seconds
            } else {
                0.0
            };
            let (departure, stay) = barred.depart(&way.stays[number], edge, earliest)?;
            way.departures.push(departure);
            way.stays.push(stay);
        }
        (way.stays[way.edges.len()].until == f64::INFINITY).then_some(way)
    }

    fn is_better(&self, other: &Self) -> bool {
        let sooner = other.arrival() - self.arrival();
        sooner > SHORTER || (sooner > -SHORTER && self.moving() < other.moving() - SHORTER)
    }
}

/// Makes a way shorter by attempts at random: direct motions between two of its places, and other places to turn at. `free` is the
/// time from which on its end is free for ever. Returns attempts that were worth a look at obstacles.
pub fn shorten(
    walker: &Walker,
    barred: &Barred<'_>,
    way: &mut Way,
    free: f64,
    attempts: u32,
    random: &mut Random,
) -> u64 {
    let mut looks = 0;
    for _ in 0..attempts {
        if way.edges.is_empty() {
            break;
        }
        let found = if way.edges.len() > 1 && random.one_in(3) {
            moved(walker, way, random)
        } else {
            shortcut(walker, way, random)
        };
        let Some((kept, replaced, links)) = found else {
            continue;
        };
        looks += 1;
        let mut edges = way.edges[..kept].to_vec();
        let Some(links) = linked(walker, way.start_of(walker, kept), &links) else {
            continue;
        };
        edges.extend(links);
        edges.extend_from_slice(&way.edges[kept + replaced..]);
        if let Some(next) = way.timed(barred, kept, edges, free)
            && next.is_better(way)
        {
            *way = next;
        }
    }
    looks
}

/// Leaves out stops where limits allow it and the way becomes shorter by it. `free` as of [`shorten`].
pub fn blend(walker: &Walker, barred: &Barred<'_>, way: &mut Way, free: f64) {
    let mut joint = 0;
    while joint + 1 < way.edges.len() {
        let mut edges = way.edges.clone();
        let both = blended(walker, &edges[joint], &edges[joint + 1]);
        let next = both.and_then(|both| {
            edges.splice(joint..joint + 2, [Rc::new(both)]);
            way.timed(barred, joint, edges, free)
        });
        match next.filter(|next| next.is_better(way)) {
            Some(next) => *way = next,
            None => joint += 1,
        }
    }
}

/// Number of motions that are kept, of those that are replaced, and the poses that new ones lead to instead.
type Change = (usize, usize, Vec<(Pose, bool)>);

impl Way {
    fn start_of(&self, walker: &Walker, edge: usize) -> State {
        match edge.checked_sub(1) {
            Some(before) => self.edges[before].end,
            None => walker.root,
        }
    }

    /// Seconds from the beginning of one motion's stay to the end of another motion.
    fn lasts(&self, from: usize, to: usize) -> f64 {
        self.stays[to + 1].from - self.stays[from].from
    }
}

/// The motions to poses one after the other, or none where one of them is blocked.
fn linked(walker: &Walker, from: State, poses: &[(Pose, bool)]) -> Option<Vec<Rc<Edge>>> {
    let mut at = from;
    let mut edges = Vec::with_capacity(poses.len());
    for (pose, heading_free) in poses {
        let edge = walker.edge(&at, pose, *heading_free)?;
        at = edge.end;
        edges.push(Rc::new(edge));
    }
    Some(edges)
}

/// Seconds of motions to poses one after the other, where nothing is in the way.
fn seconds(walker: &Walker, from: &Pose, poses: &[(Pose, bool)]) -> f64 {
    let mut at = *from;
    let mut sum = 0.0;
    for (pose, heading_free) in poses {
        let Some(segments) = steer(&walker.member.robot, &at, pose, *heading_free) else {
            return f64::INFINITY;
        };
        sum += segments.iter().map(|segment| segment.seconds).sum::<f64>();
        at = *pose;
    }
    sum
}

/// A direct motion between two places of a way.
fn shortcut(walker: &Walker, way: &Way, random: &mut Random) -> Option<Change> {
    let count = way.edges.len();
    let (mut one, mut other) = (random.below(count), random.below(count));
    if one > other {
        (one, other) = (other, one);
    }
    let inside = |edge: &Edge, random: &mut Random| edge.track.at(edge.seconds * random.share());
    let is_last = other + 1 == count;
    let heading_free = walker.member.goal.free.heading;
    let to_end = (way.edges[other].end.pose(), is_last && heading_free);
    // From the beginning of a motion, or from within.
    let first = random.one_in(2).then(|| inside(&way.edges[one], random));
    let last = random.one_in(2).then(|| inside(&way.edges[other], random));
    if one == other && first.is_none() && last.is_none() {
        return None;
    }
    let from = first.unwrap_or_else(|| way.start_of(walker, one).pose());
    let mut poses: Vec<(Pose, bool)> = first.into_iter().map(|pose| (pose, false)).collect();
    let target = last.map_or(to_end, |pose| (pose, false));
    // Straight there, or turning at one of the ends.
    match random.below(4) {
        0 => poses.push((
            Pose {
                heading: from.heading,
                ..target.0
            },
            false,
        )),
        1 => poses.push((
            Pose {
                at: from.at,
                heading: target.0.heading,
            },
            false,
        )),
        _ => {}
    }
    poses.push(target);
    if last.is_some() {
        poses.push(to_end);
    }
    let start = way.start_of(walker, one).pose();
    let is_shorter = seconds(walker, &start, &poses) < way.lasts(one, other) - SHORTER;
    is_shorter.then_some((one, other - one + 1, poses))
}

/// Another pose between two motions.
fn moved(walker: &Walker, way: &Way, random: &mut Random) -> Option<Change> {
    let first = random.below(way.edges.len() - 1);
    let (before, middle, after) = (
        way.start_of(walker, first).pose(),
        way.edges[first].end.pose(),
        way.edges[first + 1].end.pose(),
    );
    let span = (after.at - before.at).norm().min(2.0) * 0.5;
    let offset = Vector::new(random.share() - 0.5, random.share() - 0.5) * (span * random.share());
    let heading = match random.below(4) {
        0 => before.heading,
        1 => after.heading,
        2 => middle.heading + (random.share() - 0.5) * TAU * random.share(),
        _ => before.heading + wrapped(after.heading - before.heading) * random.share(),
    };
    let heading = if walker.member.robot.has_heading {
        heading
    } else {
        0.0
    };
    let moved = Pose {
        at: middle.at + offset,
        heading,
    };
    let is_last = first + 2 == way.edges.len();
    let poses = vec![
        (moved, false),
        (after, is_last && walker.member.goal.free.heading),
    ];
    let is_shorter = seconds(walker, &before, &poses) < way.lasts(first, first + 1) - SHORTER;
    is_shorter.then_some((first, 2, poses))
}

/// The direction from one place to another, or back, as a heading; that of the body where both are the same.
pub fn along(from: &Pose, to: Vector, back: bool) -> f64 {
    let way = to - from.at;
    if way.norm() <= 0.0 {
        return from.heading;
    }
    libm::atan2(way.y, way.x) + if back { PI } else { 0.0 }
}
