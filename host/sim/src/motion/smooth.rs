//! Rounding the corners of a path with Bézier curves.
//!
//! A corner is replaced by a quadratic curve with a given largest deviation δ. The curve
//! begins and ends at the distance t from the corner on both legs, t = min(4·δ / |u − w|, half
//! of either leg) with the directions u, w of the legs; its nearest point to the corner is
//! t·|u − w| / 4 away from it. Headings follow the same curve.

use super::error::{MotionError, within};

/// A point of a path: x and y in metres and the heading in radians, unwrapped.
pub type Waypoint = [f64; 3];

/// Replaces every corner of a path by a quadratic Bézier curve that stays within
/// `max_deviation_m` of the path, as `pieces` straight pieces (Multi-Quadruped MAPF,
/// section 3, refines its plans so). First and last waypoint stay.
///
/// A curve begins and ends on the legs of its corner, at the same distance from it and at
/// most half a leg away, tangent to both. Its nearest point to the corner is a quarter of
/// that distance times |u − w| away, with the directions u and w of the legs, and no other
/// point is farther from the path. Headings follow the same curve, so they are
/// interpolated along it. Corners that turn back on themselves, and corners at which the
/// path stands still, stay as they are.
pub fn smooth(
    path: &[Waypoint],
    max_deviation_m: f64,
    pieces: usize,
) -> Result<Vec<Waypoint>, MotionError> {
    within(
        "max_deviation_m",
        max_deviation_m,
        0.0,
        1e6,
        "give metres, at least 0",
    )?;
    within(
        "pieces",
        pieces as f64,
        2.0,
        1e3,
        "give 2 to 1000 pieces per corner",
    )?;
    // With an even number the nearest point to the corner is one of the path, and no
    // piece lies farther from the legs than its ends.
    let pieces = pieces + pieces % 2;
    let mut smoothed = Vec::with_capacity(path.len());
    smoothed.extend(path.first());
    for corner in path.windows(3) {
        let [before, at, after] = [corner[0], corner[1], corner[2]];
        match round(before, at, after, max_deviation_m) {
            None => smoothed.push(at),
            Some((from, to)) => smoothed.extend((0..=pieces).map(|piece| {
                let t = piece as f64 / pieces as f64;
                [0, 1, 2].map(|side| {
                    let s = 1.0 - t;
                    s * s * from[side] + 2.0 * s * t * at[side] + t * t * to[side]
                })
            })),
        }
    }
    if path.len() > 1 {
        smoothed.extend(path.last());
    }
    smoothed.dedup();
    Ok(smoothed)
}

/// Begin and end of a corner's curve.
fn round(
    before: Waypoint,
    at: Waypoint,
    after: Waypoint,
    max_deviation_m: f64,
) -> Option<(Waypoint, Waypoint)> {
    let length = |a: Waypoint, b: Waypoint| {
        let (x, y) = (b[0] - a[0], b[1] - a[1]);
        (x * x + y * y).sqrt()
    };
    let (first, second) = (length(before, at), length(at, after));
    if !(first > 0.0 && second > 0.0) {
        return None;
    }
    let along = |side: usize| {
        (
            (at[side] - before[side]) / first,
            (after[side] - at[side]) / second,
        )
    };
    let ((ux, wx), (uy, wy)) = (along(0), along(1));
    let (x, y) = (wx - ux, wy - uy);
    let sharpness = (x * x + y * y).sqrt();
    // No corner, or a turn on the spot, whose end a curve would cut off.
    if sharpness <= 1e-9 || sharpness >= 2.0 - 1e-9 {
        return None;
    }
    let reach = (4.0 * max_deviation_m / sharpness)
        .min(0.5 * first)
        .min(0.5 * second);
    let toward = |end: Waypoint, length: f64| {
        [0, 1, 2].map(|side| at[side] + (end[side] - at[side]) * (reach / length))
    };
    Some((toward(before, first), toward(after, second)))
}
