//! Points that constraints name and bodies on known ways, which one robot has to keep clear of.

use std::rc::Rc;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::sssp::bodies::{Body, Leg, Pose, hits, near};

use super::edge::Edge;
use crate::course::Track;
use crate::scene::clash;

/// A departure is put off by so much where a body is in the way, in seconds, and by half as much more each time.
const PAUSE: f64 = 0.2;

/// A departure is so much later than a constraint asks for, in seconds: times are rounded.
const LATER: f64 = 1e-6;

/// Departures that are tried on one edge.
const DEPARTURES: usize = 12;

/// The footprint must not contain a point for some time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Constraint {
    /// The point, in metres.
    pub point: Vector,
    /// Beginning of the time, in seconds.
    pub from: f64,
    /// Its end.
    pub to: f64,
}

/// A body on a known way; it rests in the end.
#[derive(Debug)]
pub struct Moving {
    /// Its body.
    pub body: Body,
    /// Its way.
    pub track: Track,
}

/// All that one robot has to keep clear of.
#[derive(Debug)]
pub struct Barred<'a> {
    /// The robot's body.
    pub body: &'a Body,
    /// Points that it must not contain.
    pub constraints: Vec<Constraint>,
    /// Bodies that it must not touch.
    pub moving: Vec<Rc<Moving>>,
}

/// A stay in a pose.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stay {
    /// When it begins, in seconds.
    pub from: f64,
    /// The time until which it may last.
    pub until: f64,
}

/// A reason why an edge cannot be driven.
enum Hindrance {
    Nothing,
    /// A constraint, for departures before this time.
    Until(f64),
    Body,
}

impl Barred<'_> {
    /// The stay that begins in a pose at a time; none where something is in the way just then.
    pub fn stay(&self, pose: &Pose, from: f64) -> Option<Stay> {
        let mut until = f64::INFINITY;
        for constraint in &self.constraints {
            if constraint.to >= from && constraint.from < until && self.contains(pose, constraint) {
                until = constraint.from;
            }
        }
        let rest = Track::rest(*pose);
        for moving in &self.moving {
            if until < from {
                break;
            }
            let other = (&moving.body, &moving.track);
            if let Some(time) = clash((self.body, &rest), other, from, until) {
                until = time;
            }
        }
        (until > from).then_some(Stay { from, until })
    }

    /// The time from which on it may stay in a pose for ever; none if there is none.
    pub fn free_from(&self, pose: &Pose) -> Option<f64> {
        let mut free = 0.0_f64;
        for constraint in self
            .constraints
            .iter()
            .filter(|known| self.contains(pose, known))
        {
            free = free.max(constraint.to);
        }
        let rest = Track::rest(*pose);
        for moving in &self.moving {
            let own = (self.body, &rest);
            let other = (&moving.body, &moving.track);
            let end = moving.track.seconds();
            if clash(own, other, end, f64::INFINITY).is_some() {
                return None;
            }
            while free < end
                && let Some(time) = clash(own, other, free, end)
            {
                free = time + PAUSE / 4.0;
            }
        }
        Some(free)
    }

    /// The first departure on an edge found that meets nothing, from a stay and not before a time, with the stay at its end.
    pub fn depart(&self, stay: &Stay, edge: &Edge, earliest: f64) -> Option<(f64, Stay)> {
        let mut departure = stay.from.max(earliest);
        let mut pause = PAUSE;
        for _ in 0..DEPARTURES {
            if departure > stay.until {
                return None;
            }
            let hindrance = self.hindrance(edge, departure);
            if let Hindrance::Nothing = hindrance
                && let Some(end) = self.stay(&edge.end.pose(), departure + edge.seconds)
            {
                return Some((departure, end));
            }
            if let Hindrance::Until(time) = hindrance {
                departure = time;
            } else {
                departure += pause;
                pause *= 1.5;
            }
        }
        None
    }

    /// The first reason found why an edge cannot be driven with a departure.
    fn hindrance(&self, edge: &Edge, departure: f64) -> Hindrance {
        let end = departure + edge.seconds;
        for constraint in &self.constraints {
            if constraint.from <= end
                && constraint.to >= departure
                && let Some(after) = self.meets(edge, departure, constraint)
            {
                return Hindrance::Until(constraint.to - after + LATER);
            }
        }
        if self.moving.is_empty() {
            return Hindrance::Nothing;
        }
        let track = edge.track_at(departure);
        let meets = |moving: &Rc<Moving>| {
            let other = (&moving.body, &moving.track);
            clash((self.body, &track), other, departure, end).is_some()
        };
        if self.moving.iter().any(meets) {
            Hindrance::Body
        } else {
            Hindrance::Nothing
        }
    }

    /// Seconds after the departure at which the body first contains a point while it must not.
    fn meets(&self, edge: &Edge, departure: f64, constraint: &Constraint) -> Option<f64> {
        if !edge.may_reach(constraint.point) {
            return None;
        }
        let mut begin = 0.0;
        for leg in edge.track.legs() {
            let time = departure + begin;
            if time <= constraint.to
                && time + leg.duration >= constraint.from
                && let Some(span) = near(self.body, &leg, &POINT, &at(constraint.point))
                && time + span.low <= constraint.to
                && time + span.high >= constraint.from
            {
                return Some(begin + span.low);
            }
            begin += leg.duration;
        }
        None
    }

    fn contains(&self, pose: &Pose, constraint: &Constraint) -> bool {
        hits(
            self.body,
            &Leg::rest(*pose, 1.0),
            &POINT,
            &at(constraint.point),
        )
    }
}

/// A body without extent.
const POINT: Body = Body {
    radius: 0.0,
    corners: Vec::new(),
};

fn at(place: Vector) -> Pose {
    Pose {
        at: place,
        heading: 0.0,
    }
}
