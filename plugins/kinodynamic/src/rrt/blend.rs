//! Two motions from rest to rest in one, without a stop between them.
//!
//! A body that goes in all directions slows down from one motion while it sets out on the next one: changes of rates are added up.
//! Without turning, displacements add up as well. With it the place is missed a little, and the second displacement is corrected
//! by Newton's method until the motion ends where both of them did.

use nalgebra::{Matrix3, Vector3};

use super::edge::{Edge, Walker};
use crate::course::{Course, Segment};
use crate::robot::{Robot, State};

/// Parts of the time of slowing down in which the next motion may be under way.
const OVERLAPS: [f64; 2] = [1.0, 0.5];

/// The second motion may take so much longer to make room for its correction.
const STRETCHES: [f64; 4] = [1.0, 1.03, 1.1, 1.3];

/// Steps of Newton's method.
const STEPS: usize = 8;

/// The end is met to so much, in metres and radians.
const EXACT: f64 = 1e-11;

/// Instants nearer than this are one, in seconds.
const INSTANT: f64 = 1e-12;

/// Changes in proportion to a displacement.
struct Ramp {
    /// The displacement along the axes of the robot.
    by: [f64; 3],
    /// Changes per displacement, and the seconds that each lasts.
    phases: Vec<(f64, f64)>,
}

impl Ramp {
    /// Of controls that are in proportion to each other, from rest to rest.
    fn new(segments: &[Segment]) -> Option<Self> {
        let (mut rates, mut by) = ([0.0; 3], [0.0; 3]);
        for segment in segments {
            let seconds = segment.seconds;
            for axis in 0..3 {
                by[axis] += (rates[axis] + segment.control[axis] * seconds / 2.0) * seconds;
                rates[axis] += segment.control[axis] * seconds;
            }
        }
        let longest = (0..3).max_by(|one, other| by[*one].abs().total_cmp(&by[*other].abs()))?;
        let phase = |segment: &Segment| (segment.control[longest] / by[longest], segment.seconds);
        let phases: Vec<(f64, f64)> = segments.iter().map(phase).collect();
        let near = segments.iter().zip(&phases).all(|(segment, (factor, _))| {
            let off = |axis: usize| (segment.control[axis] - by[axis] * factor).abs();
            (0..3).all(|axis| off(axis) < 1e-9)
        });
        (near && by[longest] != 0.0).then_some(Self { by, phases })
    }

    /// The same displacement in more time.
    fn stretched(&self, by: f64) -> Self {
        let phases = self.phases.iter();
        Self {
            by: self.by,
            phases: phases
                .map(|(factor, seconds)| (factor / (by * by), seconds * by))
                .collect(),
        }
    }

    fn segments(&self) -> Vec<Segment> {
        let segment = |(factor, seconds): &(f64, f64)| Segment {
            control: self.by.map(|number| number * factor),
            seconds: *seconds,
        };
        self.phases.iter().map(segment).collect()
    }
}

/// One motion in place of two, shorter than both; none where limits or what stands do not allow it.
pub fn blended(walker: &Walker, one: &Edge, other: &Edge) -> Option<Edge> {
    let robot = &walker.member.robot;
    if !robot.is_second || !robot.goes_sideways {
        return None;
    }
    let next = Ramp::new(&other.segments)?;
    let slowing = one.segments.last()?.seconds;
    for part in OVERLAPS {
        for stretch in STRETCHES {
            let mut next = next.stretched(stretch);
            let overlap = slowing.min(next.phases[0].1) * part;
            if next.phases.iter().map(|(_, seconds)| seconds).sum::<f64>() - overlap
                >= other.seconds
            {
                continue;
            }
            let course = corrected(robot, one, &mut next, overlap, &other.end);
            if let Some(course) = course.filter(|course| course.is_allowed(robot))
                && let Some(edge) = walker.driven(course)
            {
                return Some(edge);
            }
        }
    }
    None
}

/// Both motions, the second one begun before the first one ends, and made to end in a state.
fn corrected(
    robot: &Robot,
    one: &Edge,
    next: &mut Ramp,
    overlap: f64,
    end: &State,
) -> Option<Course> {
    let course = |next: &Ramp| Course {
        start: one.start,
        segments: added(&one.segments, one.seconds - overlap, &next.segments()),
    };
    let missed = |course: &Course| {
        let state = course.end(robot);
        Vector3::new(
            state.at.x - end.at.x,
            state.at.y - end.at.y,
            state.heading - end.heading,
        )
    };
    for _ in 0..STEPS {
        let driven = course(next);
        let off = missed(&driven);
        if off.amax() < EXACT {
            return Some(driven);
        }
        let step = 1e-6;
        let columns = [0, 1, 2].map(|axis| {
            let mut moved = Ramp {
                by: next.by,
                phases: next.phases.clone(),
            };
            moved.by[axis] += step;
            (missed(&course(&moved)) - off) / step
        });
        // A robot without a heading does not turn.
        let mut columns = Matrix3::from_columns(&columns);
        if !robot.has_heading {
            columns[(2, 2)] = 1.0;
        }
        let change = columns.lu().solve(&off)?;
        for axis in 0..3 {
            next.by[axis] -= change[axis];
        }
    }
    None
}

/// Controls, and others that are added to them from a time on.
fn added(segments: &[Segment], from: f64, others: &[Segment]) -> Vec<Segment> {
    let ends = |begin: f64, segments: &[Segment]| -> Vec<f64> {
        let sum = segments.iter().scan(begin, |time, segment| {
            *time += segment.seconds;
            Some(*time)
        });
        std::iter::once(begin).chain(sum).collect()
    };
    let (own, other) = (ends(0.0, segments), ends(from, others));
    let mut times: Vec<f64> = own.iter().chain(&other).copied().collect();
    times.sort_by(f64::total_cmp);
    times.dedup_by(|next, before| *next - *before < INSTANT);
    let at = |ends: &[f64], segments: &[Segment], time: f64| {
        let number = ends.partition_point(|end| *end <= time).checked_sub(1);
        let segment = number.and_then(|number| segments.get(number));
        segment.map_or([0.0; 3], |segment| segment.control)
    };
    let spans = times.windows(2).map(|span| {
        let middle = f64::midpoint(span[0], span[1]);
        let (one, two) = (at(&own, segments, middle), at(&other, others, middle));
        Segment {
            control: [0, 1, 2].map(|axis| one[axis] + two[axis]),
            seconds: span[1] - span[0],
        }
    });
    spans.collect()
}
