//! Polygons: obstacles of any simple outline, divided into convex parts.
//!
//! Exact predicates (the adaptive ones of Shewchuk, through geo) decide whether an
//! outline is a polygon, so that no rounding lets a crossing pass.
//! A polygon that is not convex is cut into triangles by ears (geo, earcut),
//! and triangles are joined again while their union stays convex, which leaves
//! at most four times the fewest possible parts.
//!
//! S. Hertel, K. Mehlhorn, "Fast triangulation of the plane with respect to
//! simple polygons", 1985 (the joining).

use std::collections::BTreeMap;
use std::sync::Arc;

use geo::kernels::{Kernel, Orientation};
use geo::{GeoNum, Intersects, Line, LineString, TriangulateEarcut, coord};

use crate::{Bounds, Pose, Shape};

/// A simple polygon with an area: what an obstacle covers. Copies share what it is made of.
#[derive(Debug, Clone, PartialEq)]
pub struct Polygon(Arc<Outline>);

#[derive(Debug, PartialEq)]
struct Outline {
    vertices: Vec<[f64; 2]>,
    parts: Vec<(Pose, Shape)>,
    bounds: Bounds,
}

/// The edge of a world: a simple polygon that everything stays within.
#[derive(Debug, Clone, PartialEq)]
pub struct Boundary {
    polygon: Polygon,
    outside: Vec<(Pose, Shape)>,
}

/// The reason why an outline is no polygon. Vertices and edges are counted from 0; an edge has the
/// number of the vertex that it begins at.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[allow(missing_docs, reason = "the messages document the fields")]
#[non_exhaustive]
pub enum PolygonError {
    #[error("a polygon has at least 3 vertices, this one has {count}")]
    TooFewVertices { count: usize },
    #[error("the polygon has {count} vertices, more than {most}")]
    TooManyVertices { count: usize, most: usize },
    #[error("vertex {vertex} is [{x}, {y}], which is no place")]
    NotFinite { vertex: usize, x: f64, y: f64 },
    #[error("vertex {vertex} is [{x}, {y}], farther than {most} m from the origin")]
    TooFar {
        vertex: usize,
        x: f64,
        y: f64,
        most: f64,
    },
    #[error("vertices {first} and {second} are at the same place")]
    SameVertex { first: usize, second: usize },
    #[error("the polygon has no area: its vertices are in line")]
    NoArea,
    #[error(
        "the polygon intersects itself: the edge from vertex {first} meets the edge from vertex {second}"
    )]
    SelfIntersection { first: usize, second: usize },
    #[error("the polygon intersects itself: it turns back at vertex {vertex}")]
    TurnsBack { vertex: usize },
    #[error("a rectangle's {field} is {value}")]
    Rectangle { field: &'static str, value: f64 },
}

impl PolygonError {
    /// Advice to the user.
    pub fn hint(&self) -> &'static str {
        match self {
            Self::TooFewVertices { .. } => "give [x, y] of every corner",
            Self::TooManyVertices { .. } => {
                "simplify the outline, or divide it into several polygons"
            }
            Self::NotFinite { .. } => "give coordinates in metres",
            Self::TooFar { .. } => Polygon::FAR_HINT,
            Self::SameVertex { .. } => {
                "give every corner once: the last is joined to the first without being repeated"
            }
            Self::NoArea => "give corners that are not on one line",
            Self::SelfIntersection { .. } | Self::TurnsBack { .. } => {
                "list the corners in the order in which they are met on a way around"
            }
            Self::Rectangle { .. } => {
                "give a size in metres that is above 0 and an angle in radians"
            }
        }
    }
}

impl Polygon {
    /// The most vertices.
    pub const MAX_VERTICES: usize = 4096;

    /// The largest coordinate, in metres.
    pub const MOST_M: f64 = 1e6;

    /// Advice to who has coordinates beyond that, such as those of a map projection.
    pub const FAR_HINT: &str = "coordinates are in metres and at most 1000000 from the origin: subtract one offset, such \
                                as the lower left corner, from everything in the world and its tasks";

    /// A polygon from its corners in either order; the last is joined to the
    /// first. Takes time quadratic in the number of corners at worst.
    pub fn new(vertices_m: &[[f64; 2]]) -> Result<Self, PolygonError> {
        let Ring { vertices, .. } = check_ring(vertices_m)?;
        let parts = shapes_of(&convex_parts(&vertices));
        if parts.is_empty() {
            return Err(PolygonError::NoArea);
        }
        let bounds = Bounds::of(&vertices);
        Ok(Self(Arc::new(Outline {
            vertices,
            parts,
            bounds,
        })))
    }

    /// A rectangle around a centre, turned by an angle in radians.
    pub fn rectangle(
        center_m: [f64; 2],
        size_m: [f64; 2],
        angle_rad: f64,
    ) -> Result<Self, PolygonError> {
        for (field, value) in [("width", size_m[0]), ("height", size_m[1])] {
            if !(value > 0.0 && value <= Self::MOST_M) {
                return Err(PolygonError::Rectangle { field, value });
            }
        }
        if !(-Self::MOST_M..=Self::MOST_M).contains(&angle_rad) {
            let field = "angle";
            return Err(PolygonError::Rectangle {
                field,
                value: angle_rad,
            });
        }
        let pose = Pose::new(center_m[0], center_m[1], angle_rad);
        let (x, y) = (0.5 * size_m[0], 0.5 * size_m[1]);
        Self::new(&[[x, y], [-x, y], [-x, -y], [x, -y]].map(|corner| pose.apply(corner)))
    }

    /// Corners in metres, counter-clockwise.
    pub fn vertices(&self) -> &[[f64; 2]] {
        &self.0.vertices
    }

    /// Convex shapes and where they are; together they cover the polygon and
    /// nothing else, and they overlap only in their borders.
    pub fn parts(&self) -> &[(Pose, Shape)] {
        &self.0.parts
    }

    /// The smallest box around the polygon.
    pub fn bounds(&self) -> Bounds {
        self.0.bounds
    }

    /// The area in square metres.
    pub fn area_m2(&self) -> f64 {
        0.5 * double_area(self.vertices())
    }
}

impl Boundary {
    /// An edge from its corners, as [`Polygon::new`] takes them.
    pub fn new(vertices_m: &[[f64; 2]]) -> Result<Self, PolygonError> {
        let polygon = Polygon::new(vertices_m)?;
        let Bounds { min, max } = polygon.bounds();
        let far = (max[0] - min[0]).max(max[1] - min[1]);
        let (left, bottom) = (min[0] - far, min[1] - far);
        let (right, top) = (max[0] + far, max[1] + far);
        let mut points = vec![[left, bottom], [right, bottom], [right, top], [left, top]];
        let frame = points.len();
        points.extend(polygon.vertices());
        let ring = |points: &[[f64; 2]]| points.iter().map(|[x, y]| (*x, *y)).collect();
        let around = geo::Polygon::new(ring(&points[..frame]), vec![ring(&points[frame..])]);
        let outside = shapes_of(&convex_unions(&points, &around));
        Ok(Self { polygon, outside })
    }

    /// The polygon inside.
    pub fn polygon(&self) -> &Polygon {
        &self.polygon
    }

    /// Convex shapes and where they are: together they cover all outside, as far from the
    /// polygon as that is wide or high.
    pub fn outside(&self) -> &[(Pose, Shape)] {
        &self.outside
    }
}

/// The outline of a simple polygon: counter-clockwise, no three neighbours in line.
pub(crate) struct Ring {
    pub(crate) vertices: Vec<[f64; 2]>,
    /// Indices of the vertices in the outline that was given.
    pub(crate) numbers: Vec<usize>,
}

/// Positive if the outline turns left at a vertex, 0 if it goes straight on.
pub(crate) fn turn_at(vertices: &[[f64; 2]], at: usize) -> f64 {
    let count = vertices.len();
    orientation(
        vertices[(at + count - 1) % count],
        vertices[at],
        vertices[(at + 1) % count],
    )
}

/// The sign of the area of the triangle, computed exactly: 1 if a, b, c go
/// counter-clockwise, −1 if clockwise, 0 if they are in line.
fn orientation(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    let point = |[x, y]: [f64; 2]| coord! { x: x, y: y };
    match <f64 as GeoNum>::Ker::orient2d(point(a), point(b), point(c)) {
        Orientation::CounterClockwise => 1.0,
        Orientation::Clockwise => -1.0,
        Orientation::Collinear => 0.0,
    }
}

fn double_area(vertices: &[[f64; 2]]) -> f64 {
    // Relative to one of them, so that a polygon far from the origin loses no digits.
    let [x, y] = vertices[0];
    let around = vertices.iter().zip(vertices.iter().skip(1));
    around
        .map(|(a, b)| (a[0] - x) * (b[1] - y) - (b[0] - x) * (a[1] - y))
        .sum()
}

/// Makes sure that the corners are those of a simple polygon.
pub(crate) fn check_ring(given: &[[f64; 2]]) -> Result<Ring, PolygonError> {
    let count = given.len();
    if count < 3 {
        return Err(PolygonError::TooFewVertices { count });
    }
    if count > Polygon::MAX_VERTICES {
        let most = Polygon::MAX_VERTICES;
        return Err(PolygonError::TooManyVertices { count, most });
    }
    for (vertex, [x, y]) in given.iter().copied().enumerate() {
        if !(x.is_finite() && y.is_finite()) {
            return Err(PolygonError::NotFinite { vertex, x, y });
        }
        let most = Polygon::MOST_M;
        if x.abs() > most || y.abs() > most {
            return Err(PolygonError::TooFar { vertex, x, y, most });
        }
    }
    if let Some((first, second)) = same_place(given) {
        return Err(PolygonError::SameVertex { first, second });
    }
    let turns: Vec<f64> = (0..count).map(|at| turn_at(given, at)).collect();
    if turns.iter().all(|turn| *turn == 0.0) {
        return Err(PolygonError::NoArea);
    }
    let edge = |at: usize| {
        let ([ax, ay], [bx, by]) = (given[at], given[(at + 1) % count]);
        Line::new(coord! { x: ax, y: ay }, coord! { x: bx, y: by })
    };
    for (vertex, turn) in turns.iter().enumerate() {
        let (before, after) = (
            edge((vertex + count - 1) % count).delta(),
            edge(vertex).delta(),
        );
        if *turn == 0.0 && before.x * after.x + before.y * after.y < 0.0 {
            return Err(PolygonError::TurnsBack { vertex });
        }
    }
    if let Some((first, second)) = crossing(given) {
        return Err(PolygonError::SelfIntersection { first, second });
    }
    let mut numbers: Vec<usize> = (0..count).filter(|at| turns[*at] != 0.0).collect();
    // The corner that is lowest and then leftmost is convex; which way the
    // outline turns there is which way it goes round, whatever the rounding.
    let lowest = numbers.iter().copied().min_by(|a, b| {
        let (a, b) = (given[*a], given[*b]);
        a[1].total_cmp(&b[1]).then(a[0].total_cmp(&b[0]))
    });
    if lowest.is_some_and(|at| turns[at] < 0.0) {
        numbers.reverse();
    }
    let vertices = numbers.iter().map(|at| given[*at]).collect();
    Ok(Ring { vertices, numbers })
}

/// Two edges that meet and are no neighbours, the lowest numbered: neighbours share a vertex and,
/// not turning back, nothing else.
fn crossing(given: &[[f64; 2]]) -> Option<(usize, usize)> {
    struct Edge {
        number: usize,
        line: Line,
        left: f64,
        right: f64,
        bottom: f64,
        top: f64,
    }
    let count = given.len();
    let edge = |number: usize| {
        let ([ax, ay], [bx, by]) = (given[number], given[(number + 1) % count]);
        Edge {
            number,
            line: Line::new(coord! { x: ax, y: ay }, coord! { x: bx, y: by }),
            left: ax.min(bx),
            right: ax.max(bx),
            bottom: ay.min(by),
            top: ay.max(by),
        }
    };
    let mut edges: Vec<Edge> = (0..count).map(edge).collect();
    edges.sort_by(|a, b| a.left.total_cmp(&b.left));
    let mut found: Option<(usize, usize)> = None;
    for (at, one) in edges.iter().enumerate() {
        let reached = edges[at + 1..]
            .iter()
            .take_while(|other| other.left <= one.right);
        for other in reached.filter(|other| other.bottom <= one.top && one.bottom <= other.top) {
            let pair = (one.number.min(other.number), one.number.max(other.number));
            let neighbours = pair.1 - pair.0 == 1 || pair == (0, count - 1);
            let known = found.is_some_and(|found| found <= pair);
            if !neighbours && !known && one.line.intersects(&other.line) {
                found = Some(pair);
            }
        }
    }
    found
}

/// Two vertices that cannot be told apart, the lowest numbered.
fn same_place(given: &[[f64; 2]]) -> Option<(usize, usize)> {
    let near = |a: [f64; 2], b: [f64; 2]| {
        let (x, y) = (a[0] - b[0], a[1] - b[1]);
        (x * x + y * y).sqrt() <= Shape::RESOLUTION_M
    };
    let mut order: Vec<usize> = (0..given.len()).collect();
    order.sort_by(|a, b| given[*a][0].total_cmp(&given[*b][0]).then(a.cmp(b)));
    let mut found: Option<(usize, usize)> = None;
    for (at, one) in order.iter().copied().enumerate() {
        let reach = given[one][0] + Shape::RESOLUTION_M;
        for other in order[at + 1..].iter().copied() {
            if given[other][0] > reach {
                break;
            }
            if near(given[one], given[other]) {
                let pair = (one.min(other), one.max(other));
                found = Some(found.map_or(pair, |known| known.min(pair)));
            }
        }
    }
    found
}

/// Convex outlines as shapes, without those that are too thin to be one.
fn shapes_of(parts: &[Vec<[f64; 2]>]) -> Vec<(Pose, Shape)> {
    let shape = |part: &Vec<[f64; 2]>| {
        let shape = Shape::convex(part)?;
        let [x, y] = shape.reference_m();
        Some((Pose::at(x, y), shape))
    };
    parts.iter().filter_map(shape).collect()
}

/// Divides a simple polygon into convex ones, all counter-clockwise.
fn convex_parts(vertices: &[[f64; 2]]) -> Vec<Vec<[f64; 2]>> {
    if (0..vertices.len()).all(|at| turn_at(vertices, at) > 0.0) {
        return vec![vertices.to_vec()];
    }
    let ring: LineString<f64> = vertices.iter().map(|[x, y]| (*x, *y)).collect();
    convex_unions(vertices, &geo::Polygon::new(ring, Vec::new()))
}

/// Divides an area with these corners, ring by ring, into convex ones, all
/// counter-clockwise.
fn convex_unions(vertices: &[[f64; 2]], area: &geo::Polygon<f64>) -> Vec<Vec<[f64; 2]>> {
    let raw = area.earcut_triangles_raw();
    let triangles = raw.triangle_indices.chunks_exact(3);
    let mut parts: Vec<Vec<usize>> = triangles
        .map(|corners| {
            let mut part = corners.to_vec();
            if orientation(vertices[part[0]], vertices[part[1]], vertices[part[2]]) < 0.0 {
                part.reverse();
            }
            part
        })
        .collect();
    join(vertices, &mut parts);
    let parts = parts.into_iter().filter(|part| !part.is_empty());
    parts
        .map(|part| part.into_iter().map(|at| vertices[at]).collect())
        .collect()
}

/// Joins parts over their common edges while the union is convex. A part that
/// was taken into another is left empty.
fn join(vertices: &[[f64; 2]], parts: &mut [Vec<usize>]) {
    // Every edge inside the polygon belongs to two parts, in opposite directions.
    let mut owner: BTreeMap<(usize, usize), usize> = BTreeMap::new();
    for (part, corners) in parts.iter().enumerate() {
        for at in 0..corners.len() {
            owner.insert((corners[at], corners[(at + 1) % corners.len()]), part);
        }
    }
    let diagonals: Vec<(usize, usize)> = owner
        .keys()
        .copied()
        .filter(|(from, to)| from < to && owner.contains_key(&(*to, *from)))
        .collect();
    for (from, to) in diagonals {
        let (Some(&one), Some(&two)) = (owner.get(&(from, to)), owner.get(&(to, from))) else {
            continue;
        };
        if one == two {
            continue;
        }
        let Some(joined) = union(&parts[one], &parts[two], from, to) else {
            continue;
        };
        let outline: Vec<[f64; 2]> = joined.iter().map(|at| vertices[*at]).collect();
        // Only at the ends of the common edge the outline has changed.
        let is_convex = joined
            .iter()
            .enumerate()
            .filter(|(_, vertex)| **vertex == from || **vertex == to)
            .all(|(at, _)| turn_at(&outline, at) >= 0.0);
        if !is_convex {
            continue;
        }
        for at in 0..joined.len() {
            owner.insert((joined[at], joined[(at + 1) % joined.len()]), one);
        }
        parts[one] = joined;
        parts[two].clear();
    }
}

/// The outline of two parts without their common edge, which the first goes
/// from `from` to `to` and the second back.
fn union(one: &[usize], two: &[usize], from: usize, to: usize) -> Option<Vec<usize>> {
    // From `to` around the first to `from`, and on around the second.
    let start = one.iter().position(|vertex| *vertex == to)?;
    let next = two.iter().position(|vertex| *vertex == from)?;
    let first = (0..one.len()).map(|step| one[(start + step) % one.len()]);
    let second = (1..two.len() - 1).map(|step| two[(next + step) % two.len()]);
    Some(first.chain(second).collect())
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// The parts are convex, cover what the polygon covers, and do not overlap.
    fn check_parts(polygon: &Polygon) {
        let mut area = 0.0;
        for (pose, shape) in polygon.parts() {
            let outline: Vec<[f64; 2]> = shape.corners(*pose).collect();
            let part = 0.5 * double_area(&outline);
            assert!(part > 0.0);
            area += part;
            for corner in &outline {
                assert!(
                    Bounds::of(polygon.vertices()).contains(*corner) || {
                        let near =
                            |v: &[f64; 2]| (v[0] - corner[0]).abs() + (v[1] - corner[1]).abs();
                        polygon.vertices().iter().map(near).fold(1.0, f64::min) < 1e-9
                    }
                );
            }
        }
        let whole = polygon.area_m2();
        assert!(
            (area - whole).abs() <= 1e-9 * whole.max(1.0),
            "{area} {whole}"
        );
    }

    #[test]
    fn polygons_and_their_parts() {
        let cases: [(&str, &[[f64; 2]], usize, f64); 5] = [
            ("triangle", &[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], 1, 0.5),
            (
                "clockwise square with a corner on a side",
                &[[0.0, 0.0], [0.0, 2.0], [1.0, 2.0], [2.0, 2.0], [2.0, 0.0]],
                1,
                4.0,
            ),
            (
                "L",
                &[
                    [0.0, 0.0],
                    [2.0, 0.0],
                    [2.0, 1.0],
                    [1.0, 1.0],
                    [1.0, 2.0],
                    [0.0, 2.0],
                ],
                2,
                3.0,
            ),
            (
                "arrow",
                &[[0.0, 0.0], [2.0, 1.0], [0.0, 2.0], [1.0, 1.0]],
                2,
                1.0,
            ),
            (
                "comb",
                &[
                    [0.0, 0.0],
                    [7.0, 0.0],
                    [7.0, 3.0],
                    [6.0, 3.0],
                    [6.0, 1.0],
                    [5.0, 1.0],
                    [5.0, 3.0],
                    [4.0, 3.0],
                    [4.0, 1.0],
                    [3.0, 1.0],
                    [3.0, 3.0],
                    [0.0, 3.0],
                ],
                5,
                17.0,
            ),
        ];
        for (name, vertices, most, area) in cases {
            let polygon = Polygon::new(vertices).unwrap();
            assert!((polygon.area_m2() - area).abs() < 1e-12, "{name}");
            assert!(
                polygon.parts().len() <= most,
                "{name}: {}",
                polygon.parts().len()
            );
            check_parts(&polygon);
        }
    }

    #[test]
    fn rectangles() {
        let polygon = Polygon::rectangle([3.0, 4.0], [2.0, 1.0], 0.5).unwrap();
        assert!((polygon.area_m2() - 2.0).abs() < 1e-12);
        let (pose, shape) = &polygon.parts()[0];
        assert!((pose.x - 3.0).abs() < 1e-12 && (pose.y - 4.0).abs() < 1e-12);
        assert!((shape.effective_radius_m() - 1.25f64.sqrt()).abs() < 1e-12);
        for (size, angle, message) in [
            ([0.0, 1.0], 0.0, "a rectangle's width is 0"),
            ([1.0, f64::NAN], 0.0, "a rectangle's height is NaN"),
            ([1.0, 1.0], f64::INFINITY, "a rectangle's angle is inf"),
        ] {
            let error = Polygon::rectangle([0.0, 0.0], size, angle).unwrap_err();
            assert_eq!(error.to_string(), message);
        }
        assert!(Polygon::rectangle([f64::NAN, 0.0], [1.0, 1.0], 0.0).is_err());
    }

    #[test]
    fn what_is_no_polygon_is_refused() {
        // A corner on the middle of another edge, and a corner visited twice.
        let touching = [[0.0, 0.0], [4.0, 0.0], [4.0, 2.0], [2.0, 0.0], [0.0, 2.0]];
        let pinched = [
            [0.0, 0.0],
            [1.0, 1.0],
            [2.0, 0.0],
            [2.0, 2.0],
            [1.0, 1.0],
            [0.0, 2.0],
        ];
        for (vertices, message) in [
            (
                &touching[..],
                "the polygon intersects itself: the edge from vertex 0 meets the edge from vertex 2",
            ),
            (&pinched[..], "vertices 1 and 4 are at the same place"),
        ] {
            assert_eq!(Polygon::new(vertices).unwrap_err().to_string(), message);
        }
        let many = vec![[0.0, 0.0]; Polygon::MAX_VERTICES + 1];
        let error = Polygon::new(&many).unwrap_err();
        assert_eq!(
            error.to_string(),
            "the polygon has 4097 vertices, more than 4096"
        );
    }

    fn coordinate() -> impl Strategy<Value = f64> {
        let odd = [f64::NAN, f64::INFINITY, 1e300, -1e-300];
        prop_oneof![
            8 => -2.0..2.0f64,
            8 => (-2..3i32).prop_map(f64::from),
            1 => proptest::sample::select(odd.to_vec()),
        ]
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(500))]

        /// Stars around a point are simple, whatever their spikes.
        #[test]
        fn stars_are_divided(radii in proptest::collection::vec(0.05..10.0f64, 5..40), x in -1e4..1e4f64) {
            let count = radii.len() as f64;
            let vertices: Vec<[f64; 2]> = radii
                .iter()
                .enumerate()
                .map(|(at, radius)| {
                    let angle = std::f64::consts::TAU * at as f64 / count;
                    [x + radius * libm::cos(angle), radius * libm::sin(angle)]
                })
                .collect();
            let polygon = Polygon::new(&vertices).unwrap();
            prop_assert!(polygon.parts().len() <= vertices.len() - 2);
            check_parts(&polygon);

            // What is outside of a world covers the frame around it but the world.
            let boundary = Boundary::new(&vertices).unwrap();
            let Bounds { min, max } = polygon.bounds();
            let (width, height) = (max[0] - min[0], max[1] - min[1]);
            let far = width.max(height);
            let frame = (width + 2.0 * far) * (height + 2.0 * far);
            let mut area = 0.0;
            for (pose, shape) in boundary.outside() {
                let outline: Vec<[f64; 2]> =
                    shape.corners(*pose).collect();
                area += 0.5 * double_area(&outline);
            }
            let whole = frame - polygon.area_m2();
            prop_assert!((area - whole).abs() <= 1e-9 * frame, "{area} {whole}");
        }

        /// The first two edges that meet are found as by a look at all pairs.
        #[test]
        fn edges_that_meet_are_found(
            vertices in proptest::collection::vec((-4..5i32, -4..5i32), 3..12),
        ) {
            let vertices: Vec<[f64; 2]> =
                vertices.into_iter().map(|(x, y)| [f64::from(x), f64::from(y)]).collect();
            let count = vertices.len();
            let edge = |at: usize| {
                let ([ax, ay], [bx, by]) = (vertices[at], vertices[(at + 1) % count]);
                Line::new(coord! { x: ax, y: ay }, coord! { x: bx, y: by })
            };
            let pairs = (0..count).flat_map(|first| (first + 2..count).map(move |second| (first, second)));
            let mut pairs = pairs.filter(|pair| *pair != (0, count - 1));
            let expected = pairs.find(|(first, second)| edge(*first).intersects(&edge(*second)));
            prop_assert_eq!(crossing(&vertices), expected);
        }

        /// Whatever is given, there is an answer.
        #[test]
        fn nothing_panics(
            vertices in proptest::collection::vec((coordinate(), coordinate()), 0..9),
        ) {
            let vertices: Vec<[f64; 2]> = vertices.into_iter().map(|(x, y)| [x, y]).collect();
            if let Ok(polygon) = Polygon::new(&vertices) {
                check_parts(&polygon);
            }
        }
    }
}
