//! Polygons and discs at rest that a disc must not touch, in a box that it must not leave.

use crate::Vector;
use crate::bins::{Bins, Rectangle};

/// Polygons, discs at rest and a box, seen by the centre of a disc.
#[derive(Debug, Clone)]
pub struct Obstacles {
    discs: Vec<Disc>,
    /// Counter-clockwise corners of each polygon.
    polygons: Vec<Vec<Vector>>,
    edges: Vec<[Vector; 2]>,
    bins: Bins,
    inner: Rectangle,
    radius: f64,
}

/// A disc at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Disc {
    /// Its centre.
    pub at: Vector,
    /// In metres.
    pub radius: f64,
}

/// A corner that sticks out of a polygon, or a disc at rest: a path may lead round it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Corner {
    /// Its place.
    pub at: Vector,
    /// Of a disc, in metres; zero for a corner.
    pub radius: f64,
    /// Of a corner the outward unit normals of the edges before and after it, counter-clockwise. A disc that touches the
    /// corner and neither edge has its centre between them.
    pub normals: Option<[Vector; 2]>,
}

/// A centre may be so much nearer than the radius, in metres, before that counts as a contact.
const TOLERANCE: f64 = 1e-9;

impl Obstacles {
    /// Of simple polygons in any orientation, inside of `bounds`, for a disc of that radius in metres. Polygons may overlap.
    /// Those of fewer than three corners or without an area are left out.
    pub fn new(
        polygons: impl IntoIterator<Item = Vec<Vector>>,
        bounds: Rectangle,
        radius: f64,
    ) -> Self {
        let oriented = polygons.into_iter().filter_map(|mut polygon| {
            polygon.dedup();
            let area = twice_area(&polygon);
            if area < 0.0 {
                polygon.reverse();
            }
            (polygon.len() > 2 && area.abs() > 0.0).then_some(polygon)
        });
        let polygons: Vec<Vec<Vector>> = oriented.collect();
        let edges: Vec<[Vector; 2]> = polygons.iter().flat_map(|polygon| edges(polygon)).collect();
        let boxes = edges.iter().map(|[a, b]| Rectangle::around(*a, *b, radius));
        Self {
            discs: Vec::new(),
            bins: Bins::new(boxes.collect()),
            inner: Rectangle::around(bounds.min, bounds.max, -radius),
            polygons,
            edges,
            radius,
        }
    }

    /// The same with these discs at rest, and no others.
    #[must_use]
    pub fn with_discs(&self, discs: Vec<Disc>) -> Self {
        Self {
            discs,
            ..self.clone()
        }
    }

    /// The same with these discs at rest as well.
    #[must_use]
    pub fn with_more_discs(&self, discs: impl IntoIterator<Item = Disc>) -> Self {
        let known = self.discs.iter().copied();
        self.with_discs(known.chain(discs).collect())
    }

    /// The disc's radius, in metres.
    pub fn radius(&self) -> f64 {
        self.radius
    }

    /// The box that the disc's centre must not leave.
    pub fn inner(&self) -> Rectangle {
        self.inner
    }

    /// The corners that stick out, and the discs.
    pub fn corners(&self) -> impl Iterator<Item = Corner> {
        let corners = self.polygons.iter().flat_map(|polygon| {
            (0..polygon.len()).filter_map(|at| {
                let [before, corner, after] =
                    [polygon.len() - 1, 0, 1].map(|shift| polygon[(at + shift) % polygon.len()]);
                let normals = [corner - before, after - corner].map(|edge| right(edge).normalize());
                (cross(normals[0], normals[1]) > 0.0).then_some(Corner {
                    at: corner,
                    radius: 0.0,
                    normals: Some(normals),
                })
            })
        });
        let discs = self.discs.iter().map(|disc| Corner {
            at: disc.at,
            radius: disc.radius,
            normals: None,
        });
        corners.chain(discs)
    }

    /// A disc whose centre is at a place touches nothing.
    pub fn free(&self, place: Vector) -> bool {
        self.clear(place, place) && !self.polygons.iter().any(|polygon| inside(polygon, place))
    }

    /// A disc whose centre goes along a line touches no edge and stays in the box. Where it begins has to be free.
    pub fn clear(&self, from: Vector, to: Vector) -> bool {
        let within = |place: Vector| {
            let (low, high) = (place - self.inner.min, self.inner.max - place);
            low.min().min(high.min()) >= -TOLERANCE
        };
        let least = (self.radius - TOLERANCE).max(0.0).powi(2);
        let past = |disc: &Disc| {
            let least = (self.radius + disc.radius - TOLERANCE).max(0.0);
            squared_distance_to(from, to, disc.at) >= least * least
        };
        within(from)
            && within(to)
            && self.discs.iter().all(past)
            && !self.bins.any_along(from, to, |edge| {
                let [a, b] = self.edges[edge as usize];
                crossing(from, to, a, b) || squared_distance(from, to, a, b) < least
            })
    }
}

/// Turned by a quarter to the right.
pub(crate) fn right(vector: Vector) -> Vector {
    Vector::new(vector.y, -vector.x)
}

/// The sine of the angle from one vector to another, times both lengths.
pub(crate) fn cross(a: Vector, b: Vector) -> f64 {
    a.x * b.y - a.y * b.x
}

fn edges(polygon: &[Vector]) -> impl Iterator<Item = [Vector; 2]> {
    (0..polygon.len()).map(|at| [polygon[at], polygon[(at + 1) % polygon.len()]])
}

fn twice_area(polygon: &[Vector]) -> f64 {
    edges(polygon).map(|[a, b]| cross(a, b)).sum()
}

/// A place is inside when a ray to the right crosses the border an odd number of times.
fn inside(polygon: &[Vector], place: Vector) -> bool {
    let crossed = edges(polygon).filter(|[a, b]| {
        (a.y > place.y) != (b.y > place.y) && {
            let along = (place.y - a.y) / (b.y - a.y);
            place.x < a.x + along * (b.x - a.x)
        }
    });
    crossed.count() % 2 == 1
}

/// Two segments cross at a point inside of both.
fn crossing(a: Vector, b: Vector, c: Vector, d: Vector) -> bool {
    let sides = |from: Vector, to: Vector, p: Vector, q: Vector| {
        let (p, q) = (cross(to - from, p - from), cross(to - from, q - from));
        (p > 0.0 && q < 0.0) || (p < 0.0 && q > 0.0)
    };
    sides(a, b, c, d) && sides(c, d, a, b)
}

/// The squared distance of two segments that do not cross.
fn squared_distance(a: Vector, b: Vector, c: Vector, d: Vector) -> f64 {
    let both = squared_distance_to(a, b, c).min(squared_distance_to(a, b, d));
    both.min(squared_distance_to(c, d, a))
        .min(squared_distance_to(c, d, b))
}

/// The squared distance of a segment and a place.
pub(crate) fn squared_distance_to(from: Vector, to: Vector, place: Vector) -> f64 {
    let (along, offset) = (to - from, place - from);
    let length = along.norm_squared();
    let part = if length > 0.0 {
        (offset.dot(&along) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (offset - along * part).norm_squared()
}
