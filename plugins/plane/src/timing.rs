//! The times at which a disc goes along a given way among discs on their ways: as early as it can be, with waits at the places
//! of the way only.
//!
//! This is SIPP (M. Phillips, M. Likhachev, ICRA 2011) on a way instead of a graph: a state is a place and one of the intervals of
//! time in which it is safe, and of the ways into it the earliest is kept.

use crate::Vector;
use crate::motion::{Motion, Span};
use crate::spans::Spans;

/// A motion of a disc that is to be kept clear of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Obstruction {
    /// Seconds at which the motion begins.
    pub start: f64,
    /// The motion; one at rest may last for ever.
    pub motion: Motion,
    /// The least distance of both centres, in metres.
    pub distance: f64,
}

/// A disc's times at a place of its way.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stop {
    /// The place, in metres.
    pub at: Vector,
    /// Seconds at which the disc arrives.
    pub arrival: f64,
    /// Seconds at which it leaves; infinite at the last place.
    pub departure: f64,
}

/// A state: a place's safe interval that was reached.
#[derive(Debug, Clone, Copy)]
struct Reached {
    interval: usize,
    arrival: f64,
    /// The state of the place before, and when the disc left it.
    parent: usize,
    set_out: f64,
}

/// The times of a disc that stands at the first place at time 0, goes from place to place at `speed` in metres per second,
/// and stays at the last. None where there are none.
pub fn earliest(way: &[Vector], speed: f64, obstructions: &[Obstruction]) -> Option<Vec<Stop>> {
    let taken: Vec<Spans> = way
        .iter()
        .map(|place| taken(*place, obstructions))
        .collect();
    let times = earliest_times(&taken, |leg| {
        let (from, to) = (way[leg], way[leg + 1]);
        let duration = (to - from).norm() / speed;
        let motion = Motion::between(from, to, duration);
        (duration, forbidden(&motion, obstructions))
    })?;
    let stops = way.iter().zip(times);
    let stops = stops.map(|(at, [arrival, departure])| Stop {
        at: *at,
        arrival,
        departure,
    });
    Some(stops.collect())
}

/// The times of arrival and departure at places that are taken at known times. A leg takes so many seconds, and there are times
/// at which nobody may set out on it.
pub fn earliest_times(
    taken: &[Spans],
    mut leg: impl FnMut(usize) -> (f64, Spans),
) -> Option<Vec<[f64; 2]>> {
    let first = taken.first()?.ended(0.0);
    if taken[0].safe(first).low > 0.0 {
        return None;
    }
    let mut layers = vec![vec![Reached {
        interval: first,
        arrival: 0.0,
        parent: 0,
        set_out: 0.0,
    }]];
    for (at, both) in taken.windows(2).enumerate() {
        let (duration, forbidden) = leg(at);
        let (here, there) = (&both[0], &both[1]);
        let mut next = Vec::new();
        for interval in 0..=there.as_slice().len() {
            let safe_there = there.safe(interval);
            // The earliest arrival in this interval from any of the place before.
            let arrivals = layers[at].iter().enumerate().filter_map(|(parent, from)| {
                let set_out = forbidden.first_outside(from.arrival.max(safe_there.low - duration));
                let arrival = (set_out + duration).max(safe_there.low);
                let safe = set_out <= here.safe(from.interval).high && arrival <= safe_there.high;
                (safe && set_out.is_finite()).then_some(Reached {
                    interval,
                    arrival,
                    parent,
                    set_out,
                })
            });
            next.extend(arrivals.min_by(|a, b| a.arrival.total_cmp(&b.arrival)));
        }
        if next.is_empty() {
            return None;
        }
        layers.push(next);
    }
    let (last, end) = (layers.last()?, taken.last()?.as_slice().len());
    let mut state = last.iter().position(|state| state.interval == end)?;
    let (mut times, mut departure) = (Vec::with_capacity(taken.len()), f64::INFINITY);
    for layer in layers.iter().rev() {
        let Reached {
            arrival,
            parent,
            set_out,
            ..
        } = layer[state];
        times.push([arrival, departure]);
        (state, departure) = (parent, set_out);
    }
    times.reverse();
    Some(times)
}

/// The motions of a disc with these times, its rests among them, for discs that have to keep `distance` from it.
pub fn obstructions(stops: &[Stop], distance: f64) -> impl Iterator<Item = Obstruction> {
    let rests = stops.iter().map(|stop| {
        (
            stop.arrival,
            Motion::rest(stop.at, stop.departure - stop.arrival),
        )
    });
    let legs = stops.windows(2).map(|leg| {
        let (from, to) = (leg[0], leg[1]);
        (
            from.departure,
            Motion::between(from.at, to.at, to.arrival - from.departure),
        )
    });
    rests.chain(legs).map(move |(start, motion)| Obstruction {
        start,
        motion,
        distance,
    })
}

/// Times at which no disc may be at a place.
fn taken(place: Vector, obstructions: &[Obstruction]) -> Spans {
    let mut taken = Spans::new();
    for other in obstructions {
        if let Some(near) = other.motion.near(place, other.distance) {
            taken.insert(near.after(other.start));
        }
    }
    taken
}

/// Times at which no disc may set out on a leg.
fn forbidden(leg: &Motion, obstructions: &[Obstruction]) -> Spans {
    let mut forbidden = Spans::new();
    for other in obstructions {
        if let Some(Span { low, high }) = other
            .motion
            .overlap(leg, other.distance)
            .map(|overlap| overlap.forward)
        {
            forbidden.insert(Span { low, high }.after(other.start));
        }
    }
    forbidden
}
