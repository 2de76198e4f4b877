//! A point that two bodies have in common.

use std::f64::consts::TAU;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::sssp::bodies::{Body, Pose};

use crate::robot::rotated;

/// A disc has so many corners here.
const ROUND: u32 = 24;

/// The centroid of what two bodies have in common; of bodies that hardly touch, a point between them.
pub fn common_point(one: (&Body, &Pose), other: (&Body, &Pose)) -> Vector {
    let mut common = placed(one);
    let cutter = placed(other);
    for at in 0..cutter.len() {
        common = cut(&common, cutter[at], cutter[(at + 1) % cutter.len()]);
    }
    centroid(&common).unwrap_or_else(|| {
        let (from, to) = (one.1.at, other.1.at);
        from + (to - from) * (one.0.radius / (one.0.radius + other.0.radius).max(f64::MIN_POSITIVE))
    })
}

/// The area that two bodies have in common, in square metres.
pub fn common_area(one: (&Body, &Pose), other: (&Body, &Pose)) -> f64 {
    let mut common = placed(one);
    let cutter = placed(other);
    for at in 0..cutter.len() {
        common = cut(&common, cutter[at], cutter[(at + 1) % cutter.len()]);
    }
    twice_area(&common) / 2.0
}

/// Its corners, counter-clockwise.
fn placed((body, pose): (&Body, &Pose)) -> Vec<Vector> {
    let turned = |corner: &Vector| pose.at + rotated(*corner, pose.heading);
    if body.is_disc() {
        let round = (0..ROUND).map(|number| {
            let angle = f64::from(number) * TAU / f64::from(ROUND);
            pose.at + rotated(Vector::new(body.radius, 0.0), angle)
        });
        return round.collect();
    }
    body.corners.iter().map(turned).collect()
}

/// The part of a convex polygon on the left of a line.
fn cut(polygon: &[Vector], from: Vector, to: Vector) -> Vec<Vector> {
    let along = to - from;
    let side = |point: &Vector| along.perp(&(point - from));
    let mut left = Vec::with_capacity(polygon.len() + 1);
    for (number, point) in polygon.iter().enumerate() {
        let next = &polygon[(number + 1) % polygon.len()];
        let (here, there) = (side(point), side(next));
        if here >= 0.0 {
            left.push(*point);
        }
        if (here >= 0.0) != (there >= 0.0) {
            left.push(point + (next - point) * (here / (here - there)));
        }
    }
    left
}

fn twice_area(polygon: &[Vector]) -> f64 {
    let pairs = (0..polygon.len()).map(|at| polygon[at].perp(&polygon[(at + 1) % polygon.len()]));
    pairs.sum()
}

fn centroid(polygon: &[Vector]) -> Option<Vector> {
    let first = *polygon.first()?;
    // About a corner, where numbers are small.
    let corners: Vec<Vector> = polygon.iter().map(|corner| corner - first).collect();
    let twice = twice_area(&corners);
    if twice <= 1e-12 {
        let sum: Vector = corners.iter().sum();
        return Some(first + sum / corners.len() as f64);
    }
    let moments = (0..corners.len()).map(|at| {
        let (here, next) = (corners[at], corners[(at + 1) % corners.len()]);
        (here + next) * here.perp(&next)
    });
    let sum: Vector = moments.sum();
    Some(first + sum / (3.0 * twice))
}
