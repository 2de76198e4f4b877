//! Motions that need not be possible, and their steps.

use crate::course::{Course, Knot, Segment, Track};
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
        Track { knots }
    }

    /// It has a state more than segments, all numbers are finite, and it begins there.
    pub(super) fn is_sound(&self, start: &State) -> bool {
        let finite = |state: &State| {
            let numbers = [state.at.x, state.at.y, state.heading];
            numbers.iter().chain(&state.rates).all(|number| number.is_finite())
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

    /// The same without segments of no duration, and where a control that is held on is one.
    fn joined(&self) -> Self {
        let mut joined = Self {
            states: vec![self.states[0]],
            segments: Vec::with_capacity(self.segments.len()),
        };
        for (segment, state) in self.segments.iter().zip(&self.states[1..]) {
            match joined.segments.last_mut() {
                Some(last) if last.control == segment.control || segment.seconds == 0.0 => {
                    last.seconds += segment.seconds;
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
        let guess = guess.joined();
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
        whole.cut(robot, |segment, _| (segment.seconds / seconds).ceil().max(1.0) as u32)
    }

    /// The same with each step in so many equal pieces, which is asked of the step and the time at its end.
    fn cut(&self, robot: &Robot, pieces: impl Fn(&Segment, f64) -> u32) -> Self {
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

    /// The same with steps halved at these times.
    pub(super) fn halved(&self, robot: &Robot, times: &[f64]) -> Self {
        self.cut(robot, |segment, end| {
            let begin = end - segment.seconds;
            let is_hit = times.iter().any(|time| begin <= *time && *time <= end);
            1 + u32::from(is_hit)
        })
    }
}
