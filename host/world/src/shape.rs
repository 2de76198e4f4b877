//! Shapes: discs and convex polygons, validated and ready for computing.

use crate::enclosing::minimum_enclosing_circle;
use crate::vector::{least_along, sides};
use crate::{Bounds, Pose, Vector};

/// A disc or a convex polygon around the centre of its minimum enclosing circle.
///
/// GRACE (section III-B) takes this centre, c_eff, as a robot's reference point:
/// a pose of a robot says where c_eff is. Rotation about any other point would
/// reach farther. Shapes come from [`Footprint::shape`](crate::Footprint::shape)
/// and [`Polygon::parts`](crate::Polygon::parts).
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Counter-clockwise; none for a disc.
    vertices: Vec<Vector>,
    /// `edges[i]` goes from vertex i to the next.
    edges: Vec<Edge>,
    effective_radius: f64,
    inner_radius: f64,
    reference: [f64; 2],
}

/// The line through an edge of a convex polygon: the polygon is where
/// `normal · p ≤ offset`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Edge {
    /// Outward, of length 1.
    pub(crate) normal: Vector,
    pub(crate) offset: f64,
}

impl Shape {
    /// Vertices that are nearer to each other than this are one, in metres.
    pub(crate) const RESOLUTION_M: f64 = 1e-9;

    /// A disc; the radius is positive and finite.
    pub(crate) fn disc(radius_m: f64) -> Self {
        Self {
            vertices: Vec::new(),
            edges: Vec::new(),
            effective_radius: radius_m,
            inner_radius: radius_m,
            reference: [0.0, 0.0],
        }
    }

    /// A convex polygon from its vertices in counter-clockwise order. `None` if
    /// it is thinner than can be told.
    pub(crate) fn convex(vertices_m: &[[f64; 2]]) -> Option<Self> {
        let (center, _) = minimum_enclosing_circle(vertices_m);
        Self::around(vertices_m, center)
    }

    /// The same with the centre of the enclosing circle known.
    pub(crate) fn around(vertices_m: &[[f64; 2]], center: [f64; 2]) -> Option<Self> {
        let center = Vector::from(center);
        let mut vertices: Vec<Vector> = Vec::with_capacity(vertices_m.len());
        for vertex in vertices_m {
            let vertex = Vector::from(*vertex) - center;
            let is_new = |other: &Vector| (vertex - other).norm() > Self::RESOLUTION_M;
            if vertices.last().is_none_or(is_new) && vertices.first().is_none_or(is_new) {
                vertices.push(vertex);
            }
        }
        if vertices.len() < 3 {
            return None;
        }
        let edges = sides(&vertices).map(|(a, b)| {
            let along = b - a;
            let normal = Vector::new(along.y, -along.x) / along.norm();
            // All vertices count, so that rounding leaves none outside.
            let offsets = vertices.iter().map(|vertex| normal.dot(vertex));
            Edge {
                normal,
                offset: offsets.fold(f64::NEG_INFINITY, f64::max),
            }
        });
        let edges: Vec<Edge> = edges.collect();
        let inner_radius = edges
            .iter()
            .map(|edge| edge.offset)
            .fold(f64::INFINITY, f64::min);
        let effective_radius = vertices.iter().map(Vector::norm).fold(0.0, f64::max);
        // Seen from inside, some edge of a polygon that is nothing but a line
        // has the whole of it on itself.
        let is_flat = edges
            .iter()
            .any(|edge| edge.offset - least_along(&vertices, edge.normal) <= Self::RESOLUTION_M);
        (!is_flat).then_some(Self {
            vertices,
            edges,
            effective_radius,
            inner_radius: inner_radius.max(0.0),
            reference: center.into(),
        })
    }

    /// The disc of the effective radius around c_eff: all that the shape can cover
    /// by turning.
    #[must_use]
    pub fn enclosing_disc(&self) -> Self {
        Self::disc(self.effective_radius)
    }

    /// True if this is a disc.
    pub fn is_disc(&self) -> bool {
        self.vertices.is_empty()
    }

    /// Vertices in metres, counter-clockwise around c_eff at (0, 0); none for a
    /// disc.
    pub fn vertices(&self) -> &[Vector] {
        &self.vertices
    }

    pub(crate) fn edges(&self) -> &[Edge] {
        &self.edges
    }

    /// The smallest box around the shape at a pose, which a disc's turns do not change.
    pub fn bounds(&self, at: Pose) -> Bounds {
        if self.is_disc() {
            let radius = self.effective_radius;
            return Bounds {
                min: [at.x - radius, at.y - radius],
                max: [at.x + radius, at.y + radius],
            };
        }
        Bounds::of(&self.corners(at).collect::<Vec<_>>())
    }

    /// The vertices at a pose; none for a disc.
    pub fn corners(&self, at: Pose) -> impl Iterator<Item = [f64; 2]> {
        let vertices = self.vertices.iter();
        vertices.map(move |vertex| at.apply((*vertex).into()))
    }

    /// r_eff, the radius of the minimum enclosing circle, in metres.
    pub fn effective_radius_m(&self) -> f64 {
        self.effective_radius
    }

    /// The radius of the largest disc around c_eff that the shape contains, in
    /// metres. It is 0 where c_eff is on an edge, as in a triangle with a right
    /// angle.
    pub fn inner_radius_m(&self) -> f64 {
        self.inner_radius
    }

    /// Position of c_eff in the frame in which the shape was given, in metres.
    pub fn reference_m(&self) -> [f64; 2] {
        self.reference
    }
}

/// r_com of GRACE (section III-B): the largest effective radius, with which all
/// robots become discs of one size; 0 if there are no shapes.
pub fn common_radius_m<'a>(shapes: impl IntoIterator<Item = &'a Shape>) -> f64 {
    shapes
        .into_iter()
        .map(Shape::effective_radius_m)
        .fold(0.0, f64::max)
}
