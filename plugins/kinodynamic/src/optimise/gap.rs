//! Signed distances of bodies, and which way they grow.
//!
//! Where bodies are apart it is the distance of their nearest points, otherwise minus the least depth along the normal of an
//! edge. An obstacle that is not convex is the edges of it, which are deep on their inner side alone.

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::{Bins, Rectangle};
use fleetyard_plugin_plane::prioritised::World;
use fleetyard_plugin_plane::sssp::bodies::{Body, Pose};

/// A convex polygon, an edge or a place, and all that is within a distance of it.
#[derive(Debug, Clone)]
pub struct Shape {
    corners: Vec<Vector>,
    /// Outward, of the edge from each corner to the next; one of an edge, none of a place.
    normals: Vec<Vector>,
    rounding: f64,
    /// Of the circle about the origin that encloses it.
    pub radius: f64,
}

/// The signed distance of a shape from another one.
#[derive(Debug, Clone, Copy)]
pub struct Gap {
    /// In metres.
    pub distance: f64,
    /// The direction in which the shape gets away from the other one.
    pub away: Vector,
    /// A place on the line of both nearest points.
    pub at: Vector,
}

impl Shape {
    /// Of a body at the origin, with heading zero.
    pub fn new(body: &Body) -> Self {
        if body.is_disc() {
            return Self {
                corners: vec![Vector::zeros()],
                normals: Vec::new(),
                rounding: body.radius,
                radius: body.radius,
            };
        }
        Self {
            radius: body.radius,
            ..Self::polygon(body.corners.clone())
        }
    }

    /// Of counter-clockwise corners.
    fn polygon(corners: Vec<Vector>) -> Self {
        let edge = |at: usize| corners[(at + 1) % corners.len()] - corners[at];
        let normals = (0..corners.len()).map(|at| outward(edge(at)));
        Self {
            normals: normals.collect(),
            rounding: 0.0,
            radius: 0.0,
            corners,
        }
    }

    /// An edge from one place to another, with the obstacle to its left.
    fn edge(from: Vector, to: Vector) -> Self {
        Self {
            corners: vec![from, to],
            normals: vec![outward(to - from)],
            rounding: 0.0,
            radius: 0.0,
        }
    }

    /// Puts it into a pose, in the place of what was there.
    pub fn place(&self, pose: &Pose, placed: &mut Self) {
        placed.rounding = self.rounding;
        placed.radius = self.radius;
        placed.corners.clear();
        placed.normals.clear();
        if self.normals.is_empty() {
            placed.corners.push(pose.at);
            return;
        }
        let (sin, cos) = libm::sincos(pose.heading);
        let turn = |v: &Vector| Vector::new(cos * v.x - sin * v.y, sin * v.x + cos * v.y);
        let corners = self.corners.iter().map(|corner| pose.at + turn(corner));
        placed.corners.extend(corners);
        placed.normals.extend(self.normals.iter().map(turn));
    }

    /// The gap from another shape.
    pub fn gap(&self, other: &Self) -> Gap {
        let rounding = self.rounding + other.rounding;
        let gap = |distance: f64, away: Vector, at: Vector| Gap {
            distance: distance - rounding,
            away,
            at,
        };
        let mut best: Option<Gap> = None;
        let mut see = |distance: f64, away: Vector, at: Vector| {
            if best.is_none_or(|best| best.distance < distance - rounding) {
                best = Some(gap(distance, away, at));
            }
        };
        for (corner, normal) in self.corners.iter().zip(&self.normals) {
            let (low, at) = other.lowest(normal);
            see(low - normal.dot(corner), -normal, at);
        }
        for (corner, normal) in other.corners.iter().zip(&other.normals) {
            let (low, at) = self.lowest(normal);
            see(low - normal.dot(corner), *normal, at);
        }
        let behind = other.corners.len() == 2 && {
            let normal = -other.normals[0];
            self.lowest(&normal).0 > normal.dot(&other.corners[0])
        };
        match best {
            Some(best) if best.distance + rounding <= 0.0 && !behind => best,
            _ => {
                let (own, others) = self.nearest(other);
                let between = own - others;
                let distance = between.norm();
                let away = if distance > 0.0 {
                    between / distance
                } else {
                    best.map_or(Vector::x(), |best| best.away)
                };
                gap(distance, away, own)
            }
        }
    }

    /// The least of its extent along a direction, and a corner there.
    fn lowest(&self, along: &Vector) -> (f64, Vector) {
        let mut lowest = (f64::INFINITY, self.corners[0]);
        for corner in &self.corners {
            let extent = along.dot(corner);
            if extent < lowest.0 {
                lowest = (extent, *corner);
            }
        }
        lowest
    }

    /// The nearest places of both without their rounding; they are apart.
    fn nearest(&self, other: &Self) -> (Vector, Vector) {
        let mut nearest = (self.corners[0], other.corners[0]);
        let mut least = f64::INFINITY;
        let mut see = |own: Vector, others: Vector| {
            let square = (own - others).norm_squared();
            if square < least {
                (least, nearest) = (square, (own, others));
            }
        };
        for corner in &self.corners {
            for (from, to) in other.edges() {
                see(*corner, onto(*corner, from, to));
            }
        }
        for corner in &other.corners {
            for (from, to) in self.edges() {
                see(onto(*corner, from, to), *corner);
            }
        }
        nearest
    }

    fn edges(&self) -> impl Iterator<Item = (Vector, Vector)> {
        let count = self.corners.len();
        (0..self.normals.len().max(1))
            .map(move |at| (self.corners[at], self.corners[(at + 1) % count]))
    }
}

impl Gap {
    /// Growth of the distance with the place and the heading of a body whose origin is there.
    pub fn growth(&self, origin: Vector) -> [f64; 3] {
        let arm = self.at - origin;
        [
            self.away.x,
            self.away.y,
            self.away.y * arm.x - self.away.x * arm.y,
        ]
    }
}

/// Obstacles that stand.
#[derive(Debug)]
pub struct Walls {
    shapes: Vec<Shape>,
    bins: Bins,
    bounds: Rectangle,
}

impl Walls {
    /// Of a world.
    pub fn new(world: &World) -> Self {
        let mut shapes = Vec::new();
        for polygon in &world.polygons {
            let mut corners = polygon.clone();
            corners.dedup();
            if corners.len() > 1 && corners.first() == corners.last() {
                corners.pop();
            }
            let count = corners.len();
            let area: f64 = (0..count)
                .map(|at| corners[at].perp(&corners[(at + 1) % count]))
                .sum();
            if area < 0.0 {
                corners.reverse();
            }
            if count > 2 && area != 0.0 {
                shapes.extend(parts(corners));
            }
        }
        let boxes = shapes.iter().map(|shape| {
            let first = shape.corners[0];
            let both = shape
                .corners
                .iter()
                .fold((first, first), |(low, high), at| {
                    (low.inf(at), high.sup(at))
                });
            Rectangle::around(both.0, both.1, 0.0)
        });
        Self {
            bins: Bins::new(boxes.collect()),
            bounds: world.bounds,
            shapes,
        }
    }

    /// Calls `found` with every gap of a placed body, whose origin is there, that may be smaller than `reach`.
    pub fn near(&self, body: &Shape, origin: Vector, reach: f64, mut found: impl FnMut(Gap)) {
        let around = Rectangle::around(origin, origin, body.radius + reach);
        self.bins.meeting(&around, |number| {
            let gap = body.gap(&self.shapes[number as usize]);
            if gap.distance < reach {
                found(gap);
            }
        });
        let sides = [
            (Vector::x(), self.bounds.min.x),
            (-Vector::x(), -self.bounds.max.x),
            (Vector::y(), self.bounds.min.y),
            (-Vector::y(), -self.bounds.max.y),
        ];
        for (away, least) in sides {
            if away.dot(&origin) - least - body.radius < reach {
                let (low, at) = body.lowest(&away);
                found(Gap {
                    distance: low - body.rounding - least,
                    away,
                    at,
                });
            }
        }
    }
}

/// The whole polygon if it is convex, otherwise its edges.
fn parts(corners: Vec<Vector>) -> Vec<Shape> {
    let count = corners.len();
    let edge = |at: usize| corners[(at + 1) % count] - corners[at % count];
    if (0..count).all(|at| edge(at).perp(&edge(at + 1)) >= 0.0) {
        return vec![Shape::polygon(corners)];
    }
    let edges = (0..count).map(|at| Shape::edge(corners[at], corners[(at + 1) % count]));
    edges.collect()
}

fn outward(edge: Vector) -> Vector {
    Vector::new(edge.y, -edge.x).normalize()
}

/// The place of an edge that is nearest to another place.
fn onto(place: Vector, from: Vector, to: Vector) -> Vector {
    let along = to - from;
    let length = along.norm_squared();
    if length > 0.0 {
        from + along * ((place - from).dot(&along) / length).clamp(0.0, 1.0)
    } else {
        from
    }
}
