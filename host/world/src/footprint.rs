//! Footprints: what a robot covers of the floor, as users write it.
//!
//! The model of GRACE (section III-B): a footprint is convex and fixed, its
//! reference point is the centre of its minimum enclosing circle, and r_com is
//! the largest radius of these circles over a team.

use serde::{Deserialize, Serialize};

use crate::Shape;
use crate::polygon::{PolygonError, check_ring, turn_at};

/// The area that a robot covers, in its own frame: x along its heading, y to its left.
///
/// In JSON `{"disc": {"radius_m": 0.35}}`,
/// `{"rectangle": {"length_m": 0.8, "width_m": 0.5}}` or
/// `{"polygon": {"vertices_m": [[0.4, 0], [-0.3, 0.3], [-0.3, -0.3]]}}`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase", deny_unknown_fields)]
pub enum Footprint {
    /// A disc around the origin.
    Disc {
        /// Metres.
        radius_m: f64,
    },
    /// A rectangle around the origin.
    Rectangle {
        /// Metres along the heading.
        length_m: f64,
        /// Metres across.
        width_m: f64,
    },
    /// A convex polygon. Its origin is where the user says; poses of the robot
    /// are poses of the centre of the minimum enclosing circle.
    Polygon {
        /// Metres, in either direction of rotation, the first not repeated.
        vertices_m: Vec<[f64; 2]>,
    },
}

/// The reason why a footprint is none. Vertices are counted from 0.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages document the fields")]
#[non_exhaustive]
pub enum FootprintError {
    #[error("{field} is {value}, which is not between {least} and {most}")]
    Size {
        field: &'static str,
        value: f64,
        least: f64,
        most: f64,
    },
    #[error("the footprint has {count} vertices, more than {most}")]
    TooManyVertices { count: usize, most: usize },
    #[error("the footprint is not convex: it is dented at vertex {vertex}")]
    NotConvex { vertex: usize },
    #[error(transparent)]
    Polygon(#[from] PolygonError),
}

impl FootprintError {
    /// Advice to the user.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::Size { .. } => "give a size in metres",
            Self::TooManyVertices { .. } => "use fewer vertices, or a disc",
            Self::NotConvex { .. } => "use the convex hull, or check the order of the vertices",
            Self::Polygon(error) => error.hint(),
        }
    }
}

impl Footprint {
    /// The least radius, length and width, in metres.
    pub const LEAST_M: f64 = 1e-6;

    /// The largest radius, length, width and coordinate, in metres.
    pub const MOST_M: f64 = 1e6;

    /// The most vertices.
    pub const MAX_VERTICES: usize = 64;

    /// The validated shape.
    pub fn shape(&self) -> Result<Shape, FootprintError> {
        match self {
            Self::Disc { radius_m } => {
                let radius_m = size("radius_m", *radius_m)?;
                Ok(Shape::disc(radius_m))
            }
            Self::Rectangle { length_m, width_m } => {
                let x = 0.5 * size("length_m", *length_m)?;
                let y = 0.5 * size("width_m", *width_m)?;
                let corners = [[x, y], [-x, y], [-x, -y], [x, -y]];
                let shape = Shape::around(&corners, [0.0, 0.0]);
                Ok(shape.expect("a rectangle of positive sides has an area"))
            }
            Self::Polygon { vertices_m } => polygon_shape(vertices_m),
        }
    }
}

fn size(field: &'static str, value: f64) -> Result<f64, FootprintError> {
    // NaN is in no range.
    if (Footprint::LEAST_M..=Footprint::MOST_M).contains(&value) {
        return Ok(value);
    }
    Err(FootprintError::Size {
        field,
        value,
        least: Footprint::LEAST_M,
        most: Footprint::MOST_M,
    })
}

fn polygon_shape(vertices_m: &[[f64; 2]]) -> Result<Shape, FootprintError> {
    let (count, most) = (vertices_m.len(), Footprint::MAX_VERTICES);
    if count > most {
        return Err(FootprintError::TooManyVertices { count, most });
    }
    let ring = check_ring(vertices_m)?;
    let mut corners = ring.numbers.iter().enumerate();
    if let Some((_, vertex)) = corners.find(|(at, _)| turn_at(&ring.vertices, *at) < 0.0) {
        return Err(FootprintError::NotConvex { vertex: *vertex });
    }
    let shape = Shape::convex(&ring.vertices).ok_or(PolygonError::NoArea)?;
    size(
        "the radius of the enclosing circle",
        shape.effective_radius_m(),
    )?;
    Ok(shape)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Pose, common_radius_m};

    fn disc(radius_m: f64) -> Footprint {
        Footprint::Disc { radius_m }
    }

    fn rectangle(length_m: f64, width_m: f64) -> Footprint {
        Footprint::Rectangle { length_m, width_m }
    }

    fn polygon(vertices_m: &[[f64; 2]]) -> Footprint {
        let vertices_m = vertices_m.to_vec();
        Footprint::Polygon { vertices_m }
    }

    #[test]
    #[expect(clippy::float_cmp, reason = "these numbers have no rounding")]
    fn shapes_are_centred_and_counter_clockwise() {
        let shape = rectangle(4.0, 3.0).shape().unwrap();
        assert_eq!(shape.effective_radius_m(), 2.5);
        assert_eq!(shape.inner_radius_m(), 1.5);
        assert_eq!(shape.reference_m(), [0.0, 0.0]);
        assert!(!shape.is_disc());

        // Clockwise, away from the origin, with a vertex on an edge.
        let square = [[3.0, 3.0], [4.0, 3.0], [5.0, 3.0], [5.0, 1.0], [3.0, 1.0]];
        let shape = polygon(&square).shape().unwrap();
        assert_eq!(shape.reference_m(), [4.0, 2.0]);
        assert_eq!(shape.vertices().len(), 4);
        assert!((shape.effective_radius_m() - 2f64.sqrt()).abs() < 1e-15);
        assert_eq!(shape.inner_radius_m(), 1.0);
        let corners: Vec<[f64; 2]> = shape.corners(Pose::default()).collect();
        for at in 0..4 {
            assert!(turn_at(&corners, at) > 0.0);
        }

        // The centre of the circle is on the longest side.
        let shape = polygon(&[[0.0, 0.0], [2.0, 0.0], [1.0, 1.0]])
            .shape()
            .unwrap();
        assert!((shape.effective_radius_m() - 1.0).abs() < 1e-15);
        assert!(shape.inner_radius_m() < 1e-15);

        let shapes = [disc(0.3), rectangle(0.8, 0.6)].map(|footprint| footprint.shape().unwrap());
        assert_eq!(common_radius_m(&shapes), 0.5);
        assert_eq!(common_radius_m(&[]), 0.0);
    }

    #[test]
    fn what_is_no_footprint_is_refused() {
        let nan = f64::NAN;
        let many: Vec<[f64; 2]> = (0..65).map(|i| [f64::from(i), f64::from(i * i)]).collect();
        let star = [
            [0.0, 3.0],
            [-2.0, -3.0],
            [3.0, 1.0],
            [-3.0, 1.0],
            [2.0, -3.0],
        ];
        let cases = [
            (
                disc(nan),
                "radius_m is NaN, which is not between 0.000001 and 1000000",
            ),
            (
                disc(f64::INFINITY),
                "radius_m is inf, which is not between 0.000001 and 1000000",
            ),
            (
                disc(0.0),
                "radius_m is 0, which is not between 0.000001 and 1000000",
            ),
            (
                disc(-1.0),
                "radius_m is -1, which is not between 0.000001 and 1000000",
            ),
            (
                rectangle(1.0, nan),
                "width_m is NaN, which is not between 0.000001 and 1000000",
            ),
            (
                rectangle(0.0, 1.0),
                "length_m is 0, which is not between 0.000001 and 1000000",
            ),
            (
                polygon(&[]),
                "a polygon has at least 3 vertices, this one has 0",
            ),
            (
                polygon(&[[0.0, 0.0], [1.0, 0.0]]),
                "a polygon has at least 3 vertices, this one has 2",
            ),
            (
                polygon(&many),
                "the footprint has 65 vertices, more than 64",
            ),
            (
                polygon(&[[0.0, 0.0], [1.0, nan], [1.0, 1.0]]),
                "vertex 1 is [1, NaN], which is no place",
            ),
            (
                polygon(&[[0.0, 0.0], [1.0, 0.0], [2e6, 1.0]]),
                "vertex 2 is [2000000, 1], farther than 1000000 m from the origin",
            ),
            (
                polygon(&[[0.0, 0.0], [1.0, 1.0], [2.0, 2.0]]),
                "the polygon has no area: its vertices are in line",
            ),
            (
                polygon(&[[0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]),
                "vertices 0 and 1 are at the same place",
            ),
            (
                polygon(&[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 0.0]]),
                "vertices 0 and 3 are at the same place",
            ),
            (
                polygon(&[[0.0, 0.0], [4.0, 0.0], [1.0, 1.0], [0.0, 4.0]]),
                "the footprint is not convex: it is dented at vertex 2",
            ),
            (
                polygon(&[[0.0, 0.0], [1.0, 1.0], [1.0, 0.0], [0.0, 1.0]]),
                "the polygon intersects itself: the edge from vertex 0 meets the edge from vertex 2",
            ),
            (
                polygon(&star),
                "the polygon intersects itself: the edge from vertex 0 meets the edge from vertex 2",
            ),
            (
                polygon(&[[0.0, 0.0], [2.0, 0.0], [1.0, 0.0], [1.0, 1.0]]),
                "the polygon intersects itself: it turns back at vertex 1",
            ),
        ];
        for (footprint, message) in cases {
            let error = footprint.shape().unwrap_err();
            assert_eq!(error.to_string(), message);
            assert!(!error.hint().is_empty());
        }
    }

    #[test]
    fn json() {
        for (footprint, json) in [
            (disc(0.35), r#"{"disc":{"radius_m":0.35}}"#),
            (
                rectangle(0.8, 0.5),
                r#"{"rectangle":{"length_m":0.8,"width_m":0.5}}"#,
            ),
            (
                polygon(&[[0.0, 1.0], [2.0, 3.0]]),
                r#"{"polygon":{"vertices_m":[[0.0,1.0],[2.0,3.0]]}}"#,
            ),
        ] {
            assert_eq!(serde_json::to_string(&footprint).unwrap(), json);
            assert_eq!(serde_json::from_str::<Footprint>(json).unwrap(), footprint);
        }
        for wrong in [
            r#"{"disc":{"radius":1}}"#,
            r#"{"circle":{}}"#,
            r#"{"disc":{"radius_m":1,"x":2}}"#,
        ] {
            assert!(serde_json::from_str::<Footprint>(wrong).is_err());
        }
    }
}
