//! Bodies among obstacles, movers and each other.

use std::rc::Rc;

use fleetyard_plugin_plane::prioritised::World;
use fleetyard_plugin_plane::sssp::bodies::{Body, Leg, Pose, Space, together};

use crate::course::{Knot, Track, between};

/// The world of a team: what stands, and what moves.
#[derive(Debug)]
pub struct Scene<'a> {
    /// The obstacles at rest, and the bounds.
    pub world: &'a World,
    /// Discs that give way to nobody.
    pub movers: Vec<Mover>,
}

/// A body that moves in a known way.
#[derive(Debug)]
pub struct Mover {
    /// Its body.
    pub body: Body,
    /// Its motion.
    pub track: Track,
}

impl<'a> Scene<'a> {
    /// Of a world.
    pub fn new(world: &'a World) -> Self {
        let mover = |mover: &fleetyard_plugin_plane::prioritised::Mover| {
            let mut knots: Vec<Knot> = Vec::new();
            for stop in &mover.stops {
                let pose = Pose {
                    at: stop.at,
                    heading: 0.0,
                };
                let times = [stop.arrival, stop.departure];
                for time in times.into_iter().filter(|time| time.is_finite()) {
                    if knots.last().is_none_or(|last| last.time < time) {
                        knots.push(Knot { time, pose });
                    }
                }
            }
            Mover {
                body: Body {
                    radius: mover.radius,
                    corners: Vec::new(),
                },
                track: Track::of(knots),
            }
        };
        Self {
            world,
            movers: world.movers.iter().map(mover).collect(),
        }
    }

    /// The obstacles at rest as a body sees them that keeps so many metres of distance. Movers are not among them.
    pub fn space(&self, body: &Body, clearance: f64) -> Rc<Space> {
        let body = body.grown(clearance);
        let (polygons, bounds) = (&self.world.polygons, self.world.bounds);
        Rc::new(Space::new(body, polygons, bounds, &[]))
    }

    /// A body on its way touches no mover; afterwards it rests for ever, or is gone.
    pub fn is_clear_of_movers(&self, body: &Body, track: &Track, rests: bool) -> bool {
        let horizon = if rests {
            f64::INFINITY
        } else {
            track.seconds()
        };
        let meets = |mover: &Mover| clash((body, track), (&mover.body, &mover.track), 0.0, horizon);
        self.movers.iter().all(|mover| meets(mover).is_none())
    }
}

/// A body on its way touches nothing that stands.
pub fn is_clear(space: &Space, track: &Track) -> bool {
    space.is_free(&track.knots[0].pose) && track.legs().all(|leg| space.is_clear(&leg))
}

/// The first time from `from` on and before `until` at which two bodies, or what they tow, touch. All rest after their last knots.
pub fn clash(one: (&Body, &Track), other: (&Body, &Track), from: f64, until: f64) -> Option<f64> {
    let mut first: Option<f64> = None;
    for own in parts(one) {
        for others in parts(other) {
            let until = first.unwrap_or(until);
            first = clash_of(own, others, from, until).or(first);
        }
    }
    first
}

/// A body and what it tows.
fn parts<'a>((body, track): (&'a Body, &'a Track)) -> impl Iterator<Item = (&'a Body, &'a Track)> {
    let trail = track.trail.iter();
    let trail = trail.map(|trail| (&*trail.body, &*trail.track));
    std::iter::once((body, track)).chain(trail)
}

fn clash_of(
    (body, track): (&Body, &Track),
    (other, other_track): (&Body, &Track),
    from: f64,
    until: f64,
) -> Option<f64> {
    let (mut own, mut others) = (track.knot_at(from), other_track.knot_at(from));
    let mut time = from;
    loop {
        let next_of = |track: &Track, knot: usize| track.knots.get(knot + 1).map(|knot| knot.time);
        let (own_next, other_next) = (next_of(track, own), next_of(other_track, others));
        let next = match (own_next, other_next) {
            (Some(one), Some(other)) => one.min(other),
            (Some(one), None) | (None, Some(one)) => one,
            (None, None) => until.min(time + 1.0),
        };
        let next = next.min(until);
        let leg = part(track, own, time, next);
        let other_leg = part(other_track, others, time, next);
        if let Some(after) = together(body, &leg, other, &other_leg) {
            return Some(time + after);
        }
        if next >= until || (own_next.is_none() && other_next.is_none()) {
            return None;
        }
        own += usize::from(own_next == Some(next));
        others += usize::from(other_next == Some(next));
        time = next;
    }
}

/// The motion from one time to another, both between a knot and the next one, or after the last.
fn part(track: &Track, knot: usize, from: f64, to: f64) -> Leg {
    let before = &track.knots[knot];
    let duration = to - from;
    match track.knots.get(knot + 1) {
        Some(next) => Leg {
            from: between(before, next, from.max(before.time)),
            to: between(before, next, to.max(before.time)),
            duration,
        },
        None => Leg::rest(before.pose, duration),
    }
}
