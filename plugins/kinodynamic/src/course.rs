//! Controls one after the other, and the motion that they make.

use std::rc::Rc;

use fleetyard_plugin_plane::sssp::bodies::{Body, Leg, Pose};

use crate::robot::{Control, Robot, State};

/// Greatest distance of a track from the motion that it stands for, in metres, and the same of its heading in radians.
pub const CHORD: f64 = 1e-4;

/// A control that is held for a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Segment {
    /// The control.
    pub control: Control,
    /// Seconds, at least zero.
    pub seconds: f64,
}

/// Controls of a robot, one after the other; after the last it rests.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    /// Its state at time zero.
    pub start: State,
    /// Its controls.
    pub segments: Vec<Segment>,
}

impl Course {
    /// A robot that stays where it is.
    pub fn stay(start: State) -> Self {
        Self {
            start,
            segments: Vec::new(),
        }
    }

    /// Seconds until the last control ends.
    pub fn seconds(&self) -> f64 {
        self.segments.iter().map(|segment| segment.seconds).sum()
    }

    /// The states at the beginning and after each control.
    pub fn states<'a>(&'a self, robot: &'a Robot) -> impl Iterator<Item = State> + 'a {
        let later = self.segments.iter().scan(self.start, |state, segment| {
            *state = robot.after(state, &segment.control, segment.seconds);
            Some(*state)
        });
        std::iter::once(self.start).chain(later)
    }

    /// The state after the last control.
    pub fn end(&self, robot: &Robot) -> State {
        self.states(robot).last().unwrap_or(self.start)
    }

    /// Every control and the rates that it leads to are within the limits.
    pub fn is_allowed(&self, robot: &Robot) -> bool {
        let near = |segment: &Segment| {
            let clamped = robot.clamped(&segment.control);
            let both = clamped.iter().zip(&segment.control);
            both.into_iter()
                .all(|(clamped, own)| (clamped - own).abs() <= 1e-12 * own.abs().max(1.0))
        };
        let allowed = |state: State| robot.allows(&state.rates) && robot.allows_joint(&state);
        self.segments.iter().all(near) && self.states(robot).all(allowed)
    }

    /// The motion in straight lines that keep within [`CHORD`] of it.
    pub fn track(&self, robot: &Robot) -> Track {
        self.track_within(robot, CHORD)
    }

    /// The motion in straight lines that keep within so many metres and radians of it.
    pub fn track_within(&self, robot: &Robot, distance: f64) -> Track {
        let (mut state, mut time) = (self.start, 0.0);
        let mut knots = vec![knot(time, state.pose())];
        let mut behind: Vec<Knot> = Vec::new();
        let mut tow = |time: f64, state: &State| {
            if let Some(trailer) = robot.trailer() {
                behind.push(knot(time, trailer.pose(state.at, state.behind)));
            }
        };
        tow(time, &state);
        for segment in &self.segments {
            let pieces = pieces(robot, &state, segment, distance);
            for piece in 1..=pieces {
                let after = segment.seconds * (f64::from(piece) / f64::from(pieces));
                let next = robot.after(&state, &segment.control, after);
                knots.push(knot(time + after, next.pose()));
                tow(time + after, &next);
            }
            state = robot.after(&state, &segment.control, segment.seconds);
            time += segment.seconds;
        }
        for knots in [&mut knots, &mut behind] {
            knots.dedup_by(|next, before| next.time <= before.time);
        }
        Track {
            knots,
            trail: robot.trailer().map(|trailer| Trail {
                body: Rc::clone(&trailer.body),
                reach: trailer.reach(),
                track: Box::new(Track::of(behind)),
            }),
        }
    }
}

fn knot(time: f64, pose: Pose) -> Knot {
    Knot { time, pose }
}

/// Most pieces of a segment.
const MOST_PIECES: f64 = 10_000.0;

/// Straight pieces of a segment: a chord over h seconds is off by h²/8 of the greatest change of the velocity.
fn pieces(robot: &Robot, state: &State, segment: &Segment, distance: f64) -> u32 {
    let end = robot.after(state, &segment.control, segment.seconds);
    let speed = |rates: &[f64; 3]| libm::hypot(rates[0], rates[1]);
    let (rates, changes) = if robot.is_second {
        let faster = |axis: usize| state.rates[axis].abs().max(end.rates[axis].abs());
        ([faster(0), faster(1), faster(2)], segment.control)
    } else {
        (segment.control, [0.0; 3])
    };
    let bend = if robot.turns_axes {
        speed(&rates) * rates[2].abs()
    } else {
        0.0
    };
    let change = (speed(&changes) + bend).max(changes[2].abs());
    let mut pieces = segment.seconds * libm::sqrt(change / (8.0 * distance));
    if let Some(trailer) = robot.trailer() {
        let way = segment.control[0] * segment.seconds;
        let joints = [state, &end].map(|state| state.heading - state.behind);
        let turn = end.heading - state.heading;
        pieces = pieces.max(trailer.pieces(turn, way, joints, distance));
    }
    pieces.ceil().clamp(1.0, MOST_PIECES) as u32
}

/// A pose at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Knot {
    /// In seconds.
    pub time: f64,
    /// The pose; its heading is not wrapped.
    pub pose: Pose,
}

/// A motion that is linear between knots; after the last one it rests.
#[derive(Debug, Clone, PartialEq)]
pub struct Track {
    /// At least one, by ascending time.
    pub knots: Vec<Knot>,
    /// The motion of what is towed.
    pub trail: Option<Trail>,
}

/// A trailer on its way.
#[derive(Debug, Clone, PartialEq)]
pub struct Trail {
    /// The body.
    pub body: Rc<Body>,
    /// Farthest that a point of it is from the origin of its car, in metres.
    pub reach: f64,
    /// Its motion.
    pub track: Box<Track>,
}

impl Track {
    /// Of a body that tows nothing.
    pub fn of(knots: Vec<Knot>) -> Self {
        Self { knots, trail: None }
    }

    /// A body that stays where it is.
    pub fn rest(pose: Pose) -> Self {
        Self::of(vec![Knot { time: 0.0, pose }])
    }

    /// The same, so many seconds later.
    #[must_use]
    pub fn later(mut self, seconds: f64) -> Self {
        self.knots.iter_mut().for_each(|knot| knot.time += seconds);
        self.trail = self.trail.map(|trail| Trail {
            track: Box::new(trail.track.later(seconds)),
            ..trail
        });
        self
    }

    /// Adds a motion that begins where and when this one ends, its times counted from there.
    pub fn append(&mut self, next: Self) {
        let begin = self.last().time;
        let next = next.later(begin);
        self.knots.extend(next.knots.into_iter().skip(1));
        if let (Some(own), Some(other)) = (&mut self.trail, next.trail) {
            let knots = other.track.knots.into_iter();
            own.track.knots.extend(knots.skip(1));
        }
    }

    /// Seconds until it rests.
    pub fn seconds(&self) -> f64 {
        self.last().time
    }

    /// The last knot.
    pub fn last(&self) -> Knot {
        self.knots[self.knots.len() - 1]
    }

    /// The number of the last knot at this time or before it; the first one before all.
    pub fn knot_at(&self, time: f64) -> usize {
        let later = self.knots.partition_point(|knot| knot.time <= time);
        later.saturating_sub(1)
    }

    /// The pose at a time.
    pub fn at(&self, time: f64) -> Pose {
        let number = self.knot_at(time);
        match self.knots.get(number + 1) {
            Some(next) if time > self.knots[number].time => {
                between(&self.knots[number], next, time)
            }
            _ => self.knots[number].pose,
        }
    }

    /// Its straight parts.
    pub fn legs(&self) -> impl Iterator<Item = Leg> {
        self.knots.windows(2).map(|pair| Leg {
            from: pair[0].pose,
            to: pair[1].pose,
            duration: pair[1].time - pair[0].time,
        })
    }
}

/// The pose at a time between two knots.
pub fn between(before: &Knot, next: &Knot, time: f64) -> Pose {
    let part = (time - before.time) / (next.time - before.time);
    Pose {
        at: before.pose.at + (next.pose.at - before.pose.at) * part,
        heading: before.pose.heading + (next.pose.heading - before.pose.heading) * part,
    }
}
