//! Motions that need not be possible, and their steps.

use std::f64::consts::PI;

use fleetyard_plugin_plane::Vector;

use crate::course::{Course, Knot, Segment, Track};
use crate::plugin::Member;
use crate::robot::{Robot, State};

/// A motion to begin with. It need not be possible.
#[derive(Debug, Clone, PartialEq)]
pub struct Guess {
    /// The states at the beginning of each segment, and in the end.
    pub states: Vec<State>,
    /// Controls that lead from each state to about the next one.
    pub segments: Vec<Segment>,
}

/// Longest and shortest duration of a step, in seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Span {
    pub(super) least: f64,
    pub(super) most: f64,
}

/// A guess in steps that have a span each.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Steps {
    pub(super) guess: Guess,
    pub(super) spans: Vec<Span>,
}

/// A robot that is slower, in m/s or rad/s, is taken to be as fast.
pub(super) const SLOWEST: f64 = 1e-3;

/// A step that is too long is cut in so many.
const FINER: u32 = 4;

/// A step may become so much longer than its usual duration, and shorter by so much.
const LONGER: f64 = 1.5;
/// See [`LONGER`].
const SHORTER: f64 = 1e-3;

impl Guess {
    /// A course as it is.
    pub fn of(course: &Course, robot: &Robot) -> Self {
        Self {
            states: course.states(robot).collect(),
            segments: course.segments.clone(),
        }
    }

    /// Seconds until the last control ends.
    pub fn seconds(&self) -> f64 {
        self.segments.iter().map(|segment| segment.seconds).sum()
    }

    /// The controls alone.
    pub fn course(&self) -> Course {
        Course {
            start: self.states[0],
            segments: self.segments.clone(),
        }
    }

    /// The same beside the straight line between its ends, to the right by so many metres half-way.
    pub(super) fn aside(&self, metres: f64) -> Self {
        let mut aside = self.clone();
        let (first, last) = (self.states[0].at, self.states[self.segments.len()].at);
        let Some(ahead) = (last - first).try_normalize(f64::EPSILON) else {
            return aside;
        };
        let (whole, mut time) = (self.seconds(), 0.0);
        let right = Vector::new(ahead.y, -ahead.x);
        for (segment, state) in self.segments.iter().zip(&mut aside.states[1..]) {
            time += segment.seconds;
            state.at += right * (metres * libm::sin(PI * time / whole));
        }
        aside
    }

    /// Straight from state to state.
    pub(super) fn track(&self) -> Track {
        let mut time = 0.0;
        let mut knots = vec![Knot {
            time,
            pose: self.states[0].pose(),
        }];
        for (segment, state) in self.segments.iter().zip(&self.states[1..]) {
            time += segment.seconds;
            knots.push(Knot {
                time,
                pose: state.pose(),
            });
        }
        knots.dedup_by(|next, before| next.time <= before.time);
        Track::of(knots)
    }

    /// It has a state more than segments, all numbers are finite, and it begins there.
    pub(super) fn is_sound(&self, start: &State) -> bool {
        let finite = |state: &State| {
            let numbers = [state.at.x, state.at.y, state.heading];
            numbers
                .iter()
                .chain(&state.rates)
                .all(|number| number.is_finite())
        };
        self.states.len() == self.segments.len() + 1
            && self.states[0] == *start
            && self.states.iter().all(finite)
            && self.segments.iter().all(|segment| {
                let numbers = &segment.control;
                segment.seconds >= 0.0
                    && segment.seconds.is_finite()
                    && numbers.iter().all(|number| number.is_finite())
            })
    }

    /// The same without numbers that a robot does not have. A robot that does nothing, though it is not at its goal, rests for as
    /// long as it may take.
    pub(super) fn begun(&self, member: &Member) -> Self {
        let (robot, goal) = (&member.robot, &member.goal);
        let mut own = self.clone();
        let there = robot.axes();
        for state in &mut own.states[1..] {
            if !robot.has_heading {
                state.heading = self.states[0].heading;
            }
            for (rate, there) in state.rates.iter_mut().zip(there) {
                if !there || !robot.is_second {
                    *rate = 0.0;
                }
            }
        }
        let last = &own.states[own.segments.len()];
        if own.seconds() > 0.0 || goal.is_reached(last) {
            return own;
        }
        let (place, turn, _) = goal.missed(last);
        let seconds = place.norm() / robot.top_speed().max(SLOWEST)
            + turn.abs() / robot.top_turn_rate().max(SLOWEST);
        Self {
            states: vec![self.states[0], *last],
            segments: vec![Segment {
                control: [0.0; 3],
                seconds: seconds.max(1.0),
            }],
        }
    }

    /// The same without segments of no duration, and where a control that is held on is one. Controls that last shorter together
    /// than `seconds` become their mean.
    fn joined(&self, seconds: f64) -> Self {
        let mut joined = Self {
            states: vec![self.states[0]],
            segments: Vec::with_capacity(self.segments.len()),
        };
        let same = |one: &Segment, other: &Segment| {
            let mut both = one.control.iter().zip(&other.control);
            both.all(|(one, other)| one.to_bits() == other.to_bits())
        };
        for (segment, state) in self.segments.iter().zip(&self.states[1..]) {
            match joined.segments.last_mut() {
                Some(last)
                    if same(last, segment)
                        || segment.seconds == 0.0
                        || last.seconds + segment.seconds <= seconds =>
                {
                    let whole = last.seconds + segment.seconds;
                    if whole > 0.0 && !same(last, segment) {
                        let part = segment.seconds / whole;
                        for (mean, own) in last.control.iter_mut().zip(&segment.control) {
                            *mean += (own - *mean) * part;
                        }
                    }
                    last.seconds = whole;
                    let end = joined.states.len() - 1;
                    joined.states[end] = *state;
                }
                _ => {
                    joined.segments.push(*segment);
                    joined.states.push(*state);
                }
            }
        }
        joined
    }
}

impl Steps {
    /// Steps of a guess that last about so long.
    pub(super) fn new(guess: &Guess, robot: &Robot, seconds: f64) -> Self {
        let guess = guess.joined(seconds);
        let spans = guess.segments.iter().map(|segment| {
            let pieces = (segment.seconds / seconds).ceil().max(1.0);
            Span {
                least: SHORTER * seconds * pieces,
                most: LONGER * seconds * pieces,
            }
        });
        let whole = Self {
            spans: spans.collect(),
            guess,
        };
        whole.cut(robot, |segment, _| {
            (segment.seconds / seconds).ceil().max(1.0) as u32
        })
    }

    /// The same with each step in so many equal pieces, which is asked of the step and the time at its end.
    fn cut(&self, robot: &Robot, mut pieces: impl FnMut(&Segment, f64) -> u32) -> Self {
        let Self { guess, spans } = self;
        let mut cut = Self {
            guess: Guess {
                states: vec![guess.states[0]],
                segments: Vec::with_capacity(guess.segments.len()),
            },
            spans: Vec::with_capacity(spans.len()),
        };
        let mut time = 0.0;
        for (number, segment) in guess.segments.iter().enumerate() {
            time += segment.seconds;
            let pieces = pieces(segment, time);
            let part = segment.seconds / f64::from(pieces);
            for piece in 1..=pieces {
                cut.guess.segments.push(Segment {
                    seconds: part,
                    ..*segment
                });
                let span = &spans[number];
                cut.spans.push(Span {
                    least: span.least / f64::from(pieces),
                    most: span.most / f64::from(pieces),
                });
                cut.guess.states.push(if piece == pieces {
                    guess.states[number + 1]
                } else {
                    let before = &guess.states[number];
                    robot.after(before, &segment.control, part * f64::from(piece))
                });
            }
        }
        cut
    }

    /// The same with shorter steps at these times.
    pub(super) fn finer(&self, robot: &Robot, times: &[f64]) -> Self {
        self.cut(robot, |segment, end| {
            let begin = end - segment.seconds;
            let is_hit = times.iter().any(|time| begin <= *time && *time <= end);
            if is_hit { FINER } else { 1 }
        })
    }

    /// The same, so that it may last longer where steps are as long as they may be. None if none is.
    pub(super) fn extended(&self, robot: &Robot) -> Option<Self> {
        let mut spans = Vec::with_capacity(self.spans.len());
        let mut pieces = Vec::with_capacity(self.spans.len());
        for (segment, span) in self.guess.segments.iter().zip(&self.spans) {
            let count = if segment.seconds > 0.9 * span.most {
                2
            } else {
                1
            };
            pieces.push(count);
            spans.extend(std::iter::repeat_n(*span, count as usize));
        }
        let mut pieces = pieces.into_iter();
        let cut = self.cut(robot, |_, _| pieces.next().unwrap_or(1));
        (spans.len() > self.spans.len()).then_some(Self { spans, ..cut })
    }
}
