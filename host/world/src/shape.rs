//! Shapes: discs and convex polygons, validated and ready for computing.

use crate::enclosing::minimum_enclosing_circle;
use crate::{Bounds, Pose};

/// A disc or a convex polygon around the centre of its minimum enclosing circle.
///
/// GRACE (section III-B) takes this centre, c_eff, as a robot's reference point:
/// a pose of a robot says where c_eff is. Rotation about any other point would
/// reach farther. Shapes come from [`Footprint::shape`](crate::Footprint::shape)
/// and [`Polygon::parts`](crate::Polygon::parts).
#[derive(Debug, Clone, PartialEq)]
pub struct Shape {
    /// Counter-clockwise; none for a disc.
    vertices: Vec<[f64; 2]>,
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
    pub(crate) normal: [f64; 2],
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
        let length = |x: f64, y: f64| (x * x + y * y).sqrt();
        let mut vertices: Vec<[f64; 2]> = Vec::with_capacity(vertices_m.len());
        for vertex in vertices_m {
            let vertex = [vertex[0] - center[0], vertex[1] - center[1]];
            let is_new = |other: &[f64; 2]| {
                length(vertex[0] - other[0], vertex[1] - other[1]) > Self::RESOLUTION_M
            };
            if vertices.last().is_none_or(is_new) && vertices.first().is_none_or(is_new) {
                vertices.push(vertex);
            }
        }
        if vertices.len() < 3 {
            return None;
        }
        let edges = (0..vertices.len()).map(|at| {
            let (a, b) = (vertices[at], vertices[(at + 1) % vertices.len()]);
            let (x, y) = (b[0] - a[0], b[1] - a[1]);
            let length = length(x, y);
            let normal = [y / length, -x / length];
            // All vertices count, so that rounding leaves none outside.
            let offset = vertices
                .iter()
                .map(|vertex| normal[0] * vertex[0] + normal[1] * vertex[1])
                .fold(f64::NEG_INFINITY, f64::max);
            Edge { normal, offset }
        });
        let edges: Vec<Edge> = edges.collect();
        let inner_radius = edges
            .iter()
            .map(|edge| edge.offset)
            .fold(f64::INFINITY, f64::min);
        let effective_radius = vertices
            .iter()
            .map(|vertex| length(vertex[0], vertex[1]))
            .fold(0.0, f64::max);
        let shape = Self {
            vertices,
            edges,
            effective_radius,
            inner_radius: inner_radius.max(0.0),
            reference: center,
        };
        // Seen from inside, some edge of a polygon that is nothing but a line
        // has the whole of it on itself.
        let is_flat = shape.edges.iter().any(|edge| {
            let least = shape.vertices.iter();
            let least = least.map(|v| edge.normal[0] * v[0] + edge.normal[1] * v[1]);
            edge.offset - least.fold(f64::INFINITY, f64::min) <= Self::RESOLUTION_M
        });
        (!is_flat).then_some(shape)
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
    pub fn vertices(&self) -> &[[f64; 2]] {
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
        let corners = self.vertices.iter().map(|vertex| at.apply(*vertex));
        Bounds::of(&corners.collect::<Vec<_>>())
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
