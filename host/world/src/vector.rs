//! Vectors of the plane, and the sides of polygons.

/// A vector or a point of the plane, in metres.
pub type Vector = nalgebra::Vector2<f64>;

/// The length of a vector, and its direction of length 1: along x for the zero vector.
pub(crate) fn length_and_direction(vector: Vector) -> (f64, Vector) {
    let length = vector.norm();
    if length > 0.0 {
        (length, vector / length)
    } else {
        (0.0, Vector::x())
    }
}

/// The sides of a polygon.
pub(crate) fn sides(vertices: &[Vector]) -> impl Iterator<Item = (Vector, Vector)> {
    let next = vertices.iter().cycle().skip(1);
    vertices.iter().copied().zip(next.copied())
}

/// From the point of a segment that is nearest to `point`, to it.
pub(crate) fn from_segment(a: Vector, b: Vector, point: Vector) -> Vector {
    let (along, to) = (b - a, point - a);
    let (progress, length) = (along.dot(&to), along.norm_squared());
    if progress <= 0.0 || length <= 0.0 {
        to
    } else if progress >= length {
        point - b
    } else {
        to - along * (progress / length)
    }
}

/// The least of the projections of points on a direction.
pub(crate) fn least_along(points: &[Vector], direction: Vector) -> f64 {
    points
        .iter()
        .map(|point| point.dot(&direction))
        .fold(f64::INFINITY, f64::min)
}
