//! Controls that lead from rest to rest exactly, and controls that bring to rest.
//!
//! A constant proportion of rates leads a holonomic body along one curve, however fast: in its own frame the exponential of a
//! twist. So a curve from pose to pose is found first, and the time on it is the shortest that limits allow: one control for
//! rates, and three (faster, even, slower) for their changes. Wheels turn, drive and turn.

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::sssp::bodies::{Pose, wrapped};

use crate::course::Segment;
use crate::robot::{Robot, State, rotated};

/// The control that brings a robot to rest as soon as its limits allow, with all rates in proportion; none at rest, or if it
/// cannot slow down.
pub fn brake(robot: &Robot, state: &State) -> Option<Segment> {
    let seconds = parts(
        &state.rates.map(|rate| -rate),
        &robot.changes,
        robot.polar_changes,
    );
    (seconds > 0.0 && seconds.is_finite()).then(|| Segment {
        control: state.rates.map(|rate| -rate / seconds),
        seconds,
    })
}

/// Controls from rest in one pose to rest in another, where nothing is in the way; `heading_free` leaves the heading at the end
/// open. None if its limits do not lead there.
pub fn steer(robot: &Robot, from: &Pose, to: &Pose, heading_free: bool) -> Option<Vec<Segment>> {
    let turn = if robot.has_heading && !heading_free {
        wrapped(to.heading - from.heading)
    } else {
        0.0
    };
    let way = to.at - from.at;
    if robot.goes_sideways {
        let along = if robot.turns_axes {
            straightened(rotated(way, -from.heading), turn)
        } else {
            way
        };
        return proportional(robot, &[along.x, along.y, turn]);
    }
    // A car does not turn where it stands.
    if robot.car.is_some() {
        return None;
    }
    // Of driving ahead and back what is sooner.
    let distance = way.norm();
    let direction = if distance > 0.0 {
        libm::atan2(way.y, way.x)
    } else {
        from.heading
    };
    let driven = |heading: f64, distance: f64| {
        let first = wrapped(heading - from.heading);
        let last = if heading_free {
            0.0
        } else {
            wrapped(to.heading - from.heading - first)
        };
        let mut segments = proportional(robot, &[0.0, 0.0, first])?;
        segments.extend(proportional(robot, &[distance, 0.0, 0.0])?);
        segments.extend(proportional(robot, &[0.0, 0.0, last])?);
        Some(segments)
    };
    let seconds = |segments: &Vec<Segment>| -> f64 { segments.iter().map(|one| one.seconds).sum() };
    if distance == 0.0 {
        return proportional(robot, &[0.0, 0.0, turn]);
    }
    let (ahead, back) = (
        driven(direction, distance),
        driven(direction + std::f64::consts::PI, -distance),
    );
    [ahead, back]
        .into_iter()
        .flatten()
        .min_by(|one, other| seconds(one).total_cmp(&seconds(other)))
}

/// Seconds that a displacement along the robot's axes takes with all rates in proportion, at full speed; infinite where a limit is
/// zero.
pub fn seconds_at_rates(robot: &Robot, by: &[f64; 3]) -> f64 {
    parts(by, &robot.rates, robot.polar_rates)
}

/// Seconds more that it takes from rest to rest, where full speed is reached on the way.
pub fn seconds_lost(robot: &Robot, by: &[f64; 3]) -> f64 {
    if !robot.is_second {
        return 0.0;
    }
    let up_to = |by: &[f64; 3]| parts(by, &robot.changes, robot.polar_changes);
    (up_to(by) + up_to(&by.map(|number| -number))) / (2.0 * seconds_at_rates(robot, by))
}

/// Controls from rest to rest over a displacement along the robot's axes, with all rates in proportion.
pub fn proportional(robot: &Robot, by: &[f64; 3]) -> Option<Vec<Segment>> {
    if by.iter().all(|number| *number == 0.0) {
        return Some(Vec::new());
    }
    let least = seconds_at_rates(robot, by);
    if !least.is_finite() {
        return None;
    }
    let control = |factor: f64| by.map(|number| number * factor);
    if !robot.is_second {
        return Some(vec![Segment {
            control: control(1.0 / least),
            seconds: least,
        }]);
    }
    // Changes, and the peak of the rate, in whole displacements per second.
    let faster = 1.0 / parts(by, &robot.changes, robot.polar_changes);
    let slower = 1.0
        / parts(
            &by.map(|number| -number),
            &robot.changes,
            robot.polar_changes,
        );
    let peak = (1.0 / least).min(libm::sqrt(2.0 * faster * slower / (faster + slower)));
    if peak.is_nan() || peak <= 0.0 {
        return None;
    }
    let (up, down) = (peak / faster, peak / slower);
    let even = ((1.0 - peak * (up + down) / 2.0) / peak).max(0.0);
    let phases = [(faster, up), (0.0, even), (-slower, down)];
    let lasting = phases.into_iter().filter(|(_, seconds)| *seconds > 0.0);
    let segments = lasting.map(|(factor, seconds)| Segment {
        control: control(factor),
        seconds,
    });
    Some(segments.collect())
}

/// The least time over which these numbers are within limits, as rates of it; infinite where a limit is zero.
fn parts(by: &[f64; 3], limits: &[[f64; 2]; 3], polar: bool) -> f64 {
    let part = |number: f64, [least, most]: [f64; 2]| {
        let limit = if number > 0.0 { most } else { -least };
        if number == 0.0 {
            0.0
        } else if limit > 0.0 {
            number.abs() / limit
        } else {
            f64::INFINITY
        }
    };
    let axes = (0..3).map(|axis| part(by[axis], limits[axis]));
    let length = if polar {
        let most = |[least, most]: [f64; 2]| most.max(-least);
        part(
            libm::hypot(by[0], by[1]),
            [0.0, most(limits[0]).max(most(limits[1]))],
        )
    } else {
        0.0
    };
    axes.fold(length, f64::max)
}

/// The displacement in the body's frame that leads to `way` while the body turns evenly by `turn`.
fn straightened(way: Vector, turn: f64) -> Vector {
    if turn.abs() < 1e-9 {
        return rotated(way, -turn / 2.0);
    }
    let half = turn / 2.0;
    rotated(way, -half) * (half / libm::sin(half))
}
