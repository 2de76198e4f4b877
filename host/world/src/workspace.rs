//! Workspaces: bounds, obstacles and moving obstacles in continuous space, and
//! their file, `fleetyard.world/1`, one JSON object.
//!
//! ```json
//! {
//!   "format": "fleetyard.world/1",
//!   "name": "two rooms",
//!   "bounds_m": [0, 0, 10, 5],
//!   "obstacles": [
//!     {"polygon": [[4.9, 0], [5.1, 0], [5.1, 2], [4.9, 2]]},
//!     {"rectangle": {"center": [5, 4], "size": [0.2, 2], "angle_rad": 0}}
//!   ],
//!   "movers": [
//!     {"footprint": {"disc": {"radius_m": 0.3}}, "knots": [[0, 1, 1, 0], [8, 9, 1, 0]]}
//!   ]
//! }
//! ```
//!
//! `format` and one of `bounds_m` (left, bottom, right, top) and `boundary_m`
//! (the corners of any simple polygon) are needed, and unknown keys are refused. A mover is an obstacle that goes from knot to knot, each
//! `[time in s, x, y, heading in rad]`, uniformly; before the first and after
//! the last it rests. Lengths are in metres, x grows to the right, y upwards,
//! angles counter-clockwise.
//!
//! Bounds and obstacles are Ω and O of GRACE (section III-A): free is what is
//! within the bounds and not inside an obstacle.

use std::path::Path;

use fleetyard_core::json::{checked, push_lines, read_object, with_hint};
use fleetyard_core::{Digest, Hasher, InputError, load_file, write_atomically};
use serde::de::Deserializer;
use serde::ser::Serializer;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use crate::{Boundary, Bounds, Footprint, Polygon, Pose, Shape};

/// The value of `format`.
pub const WORLD_FORMAT: &str = "fleetyard.world/1";

/// Largest world file that is read, in bytes.
pub const WORLD_FILE_LIMIT: u64 = 1 << 28;

/// A bounded piece of floor with what stands and moves on it.
#[derive(Debug, Clone, PartialEq)]
pub struct Workspace {
    /// A name for output; may be empty.
    pub name: String,
    /// Robots stay within; the box around the boundary, if there is one.
    pub bounds: Bounds,
    /// The edge that robots stay within, where it is no rectangle.
    pub boundary: Option<Boundary>,
    /// Obstacles that stand; they may overlap and reach over the bounds.
    pub obstacles: Vec<Polygon>,
    /// Obstacles that move, whatever robots do.
    pub movers: Vec<Mover>,
}

/// An obstacle that moves as it was told.
#[derive(Debug, Clone, PartialEq)]
pub struct Mover {
    footprint: Footprint,
    shape: Shape,
    times_s: Vec<f64>,
    poses: Vec<Pose>,
}

impl Mover {
    /// A mover from its knots, whose times ascend.
    pub fn new(footprint: Footprint, knots: &[(f64, Pose)]) -> Result<Self, InputError> {
        let source = "mover";
        let shape = footprint
            .shape()
            .map_err(|error| InputError::new(source, error.to_string()).hint(error.hint()))?;
        if knots.is_empty() {
            return Err(InputError::new(source, "a mover has no knots")
                .hint("give [time in s, x, y, heading] at least once"));
        }
        for (at, (time_s, pose)) in knots.iter().enumerate() {
            if pose.is_finite() && pose.x.abs().max(pose.y.abs()) > Polygon::MOST_M {
                let reason = format!(
                    "knot {at} is at [{}, {}], farther than {} m from the origin",
                    pose.x,
                    pose.y,
                    Polygon::MOST_M
                );
                return Err(InputError::new(source, reason).hint(Polygon::FAR_HINT));
            }
            if !pose.is_finite() {
                return Err(InputError::new(source, format!("knot {at} is at no place"))
                    .hint("give coordinates in metres and a heading in radians"));
            }
            let earliest = if at == 0 { 0.0 } else { knots[at - 1].0 };
            if !(time_s.is_finite() && (*time_s > earliest || (at == 0 && *time_s >= earliest))) {
                let reason = format!("knot {at} is at {time_s} s, not after {earliest} s");
                return Err(InputError::new(source, reason)
                    .hint("the times of knots ascend from 0 s or later"));
            }
        }
        let (times_s, poses) = knots.iter().copied().unzip();
        Ok(Self {
            footprint,
            shape,
            times_s,
            poses,
        })
    }

    /// The area that it covers.
    pub fn shape(&self) -> &Shape {
        &self.shape
    }

    /// Times of its knots in seconds, ascending.
    pub fn times_s(&self) -> &[f64] {
        &self.times_s
    }

    /// Its pose at every knot.
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// Its pose at a time.
    pub fn pose_at(&self, time_s: f64) -> Pose {
        let next = self.times_s.partition_point(|knot| *knot <= time_s);
        if next == 0 {
            return self.poses[0];
        }
        let Some(end) = self.times_s.get(next) else {
            return self.poses[next - 1];
        };
        let start = self.times_s[next - 1];
        let fraction = (time_s - start) / (end - start);
        self.poses[next - 1].toward(self.poses[next], fraction)
    }
}

impl Workspace {
    /// A world of which either the rectangle or the edge is given, as its file has it.
    pub fn new(
        name: String,
        bounds: Option<Bounds>,
        boundary: Option<Boundary>,
        obstacles: Vec<Polygon>,
        movers: Vec<Mover>,
    ) -> Result<Self, InputError> {
        let bounds = match (bounds, &boundary) {
            (Some(bounds), None) => bounds,
            (None, Some(boundary)) => boundary.polygon().bounds(),
            (given, _) => {
                let reason = if given.is_some() {
                    "there are both bounds_m and boundary_m"
                } else {
                    "there are neither bounds_m nor boundary_m"
                };
                return Err(InputError::new("world", reason).hint(
                    "give bounds_m [left, bottom, right, top] of a rectangle, or boundary_m with the \
                     corners of another edge",
                ));
            }
        };
        Ok(Self {
            name,
            bounds,
            boundary,
            obstacles,
            movers,
        })
    }

    /// Digest of bounds, obstacles and movers; the name is no part of it.
    pub fn digest(&self) -> Digest {
        let mut hasher = Hasher::new(WORLD_FORMAT);
        let outline = |hasher: &mut Hasher, vertices: &[[f64; 2]]| {
            hasher.u64(vertices.len() as u64);
            for coordinate in vertices.iter().flatten() {
                hasher.f64(*coordinate);
            }
        };
        outline(&mut hasher, &[self.bounds.min, self.bounds.max]);
        let boundary = self.boundary.as_ref().map(|edge| edge.polygon().vertices());
        outline(&mut hasher, boundary.unwrap_or_default());
        hasher.u64(self.obstacles.len() as u64);
        for obstacle in &self.obstacles {
            outline(&mut hasher, obstacle.vertices());
        }
        hasher.u64(self.movers.len() as u64);
        for mover in &self.movers {
            hasher.value(&mover.footprint);
            hasher.u64(mover.poses.len() as u64);
            for (time_s, pose) in mover.times_s.iter().zip(&mover.poses) {
                for number in [*time_s, pose.x, pose.y, pose.heading] {
                    hasher.f64(number);
                }
            }
        }
        hasher.finish()
    }
}

/// Reads and parses a world file.
pub fn load_workspace(path: impl AsRef<Path>) -> Result<Workspace, InputError> {
    load_file(path, WORLD_FILE_LIMIT, read_workspace)
}

/// Parses the content of a world file. `source` is named in errors.
pub fn read_workspace(source: &str, bytes: &[u8]) -> Result<Workspace, InputError> {
    let hint = "a world file is a JSON object with format, bounds_m, obstacles and movers";
    let read: Result<Document, InputError> = read_object(source, bytes, hint);
    let document = read.map_err(|error| error.or_hint(hint))?;
    let Document {
        _format,
        name,
        bounds_m,
        boundary_m,
        obstacles,
        movers,
    } = document;
    let world = Workspace::new(name, bounds_m, boundary_m, obstacles, movers);
    world.map_err(|error| InputError {
        source: source.to_owned(),
        ..error
    })
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields, expecting = "a world: a JSON object")]
struct Document {
    #[serde(rename = "format")]
    _format: Format,
    #[serde(default)]
    name: String,
    #[serde(default)]
    bounds_m: Option<Bounds>,
    #[serde(default)]
    boundary_m: Option<Boundary>,
    #[serde(default)]
    obstacles: Vec<Polygon>,
    #[serde(default)]
    movers: Vec<Mover>,
}

struct Format;

impl<'de> Deserialize<'de> for Format {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let found = std::borrow::Cow::<'de, str>::deserialize(deserializer)?;
        if found == WORLD_FORMAT {
            return Ok(Self);
        }
        let reason = format!(
            "format is {:?}, expected {WORLD_FORMAT:?}",
            fleetyard_core::shown(&found)
        );
        let hint = "is this another kind of file, or of a newer version?";
        Err(with_hint(&reason, Some(hint)))
    }
}

/// As world files have it: `[left, bottom, right, top]`, an area.
impl<'de> Deserialize<'de> for Bounds {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let [x0, y0, x1, y1] = <[f64; 4]>::deserialize(deserializer)?;
        let most = Polygon::MOST_M;
        let is_far = [x0, y0, x1, y1].iter().any(|value| value.abs() > most);
        if is_far {
            let reason = format!(
                "bounds_m is [{x0}, {y0}, {x1}, {y1}], farther than {most} m from the origin"
            );
            return Err(with_hint(&reason, Some(Polygon::FAR_HINT)));
        }
        if !(x1 - x0 >= Shape::RESOLUTION_M && y1 - y0 >= Shape::RESOLUTION_M) {
            let reason = format!("bounds_m is [{x0}, {y0}, {x1}, {y1}], which is no area");
            let hint = "give [left, bottom, right, top] in metres";
            return Err(with_hint(&reason, Some(hint)));
        }
        Ok(Self {
            min: [x0, y0],
            max: [x1, y1],
        })
    }
}

impl Serialize for Bounds {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let ([x0, y0], [x1, y1]) = (self.min, self.max);
        [x0, y0, x1, y1].serialize(serializer)
    }
}

/// As world files have it: the list of its corners.
impl<'de> Deserialize<'de> for Boundary {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let vertices = Vec::<[f64; 2]>::deserialize(deserializer)?;
        let boundary = Boundary::new(&vertices);
        let refuse = |error: crate::PolygonError| {
            let reason = format!("boundary_m is no edge: {error}");
            with_hint(&reason, Some(error.hint()))
        };
        boundary.map_err(refuse)
    }
}

impl Serialize for Boundary {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.polygon().vertices().serialize(serializer)
    }
}

/// As world files have it: `{"polygon": …}` or `{"rectangle": …}`.
impl<'de> Deserialize<'de> for Polygon {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(rename_all = "lowercase", deny_unknown_fields)]
        enum Outline {
            Polygon(Vec<[f64; 2]>),
            Rectangle {
                center: [f64; 2],
                size: [f64; 2],
                #[serde(default)]
                angle_rad: f64,
            },
        }
        let expected = "an obstacle: an object with polygon or rectangle";
        checked(deserializer, expected, |outline| {
            let polygon = match outline {
                Outline::Polygon(vertices) => Polygon::new(&vertices),
                Outline::Rectangle {
                    center,
                    size,
                    angle_rad,
                } => Polygon::rectangle(center, size, angle_rad),
            };
            polygon.map_err(|error| with_hint(&error, Some(error.hint())))
        })
    }
}

/// A rectangle is written as the polygon that it is.
impl Serialize for Polygon {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Raw<'a> {
            polygon: &'a [[f64; 2]],
        }
        let polygon = self.vertices();
        Raw { polygon }.serialize(serializer)
    }
}

/// As world files have it: footprint and knots.
impl<'de> Deserialize<'de> for Mover {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        #[derive(Deserialize)]
        #[serde(deny_unknown_fields)]
        struct Raw {
            footprint: Footprint,
            knots: Vec<[f64; 4]>,
        }
        let expected = "a mover: an object with footprint and knots";
        checked(deserializer, expected, |raw: Raw| {
            let knots = raw.knots.iter();
            let knots: Vec<(f64, Pose)> = knots
                .map(|[time_s, x, y, heading]| (*time_s, Pose::new(*x, *y, *heading)))
                .collect();
            Mover::new(raw.footprint, &knots)
                .map_err(|error| with_hint(&error.reason, error.hint.as_deref()))
        })
    }
}

impl Serialize for Mover {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        #[derive(Serialize)]
        struct Raw<'a> {
            footprint: &'a Footprint,
            knots: Vec<[f64; 4]>,
        }
        let knots = self.times_s.iter().zip(&self.poses);
        let knots = knots.map(|(time_s, pose)| [*time_s, pose.x, pose.y, pose.heading]);
        Raw {
            footprint: &self.footprint,
            knots: knots.collect(),
        }
        .serialize(serializer)
    }
}

/// The content of a world file, one obstacle or mover per line. Rectangles are
/// written as the polygons that they are.
pub fn write_workspace(workspace: &Workspace) -> Vec<u8> {
    let obstacles = workspace.obstacles.iter().map(|polygon| json!(polygon));
    let movers = workspace.movers.iter().map(|mover| json!(mover));
    let name = json!(workspace.name);
    let (key, bounds) = match &workspace.boundary {
        Some(boundary) => ("boundary_m", json!(boundary)),
        None => ("bounds_m", json!(workspace.bounds)),
    };
    let mut text = format!(
        "{{\n  \"format\": \"{WORLD_FORMAT}\",\n  \"name\": {name},\n  \"{key}\": {bounds},\n"
    );
    let push = |text: &mut String, value: Value| text.push_str(&value.to_string());
    push_lines(&mut text, "obstacles", obstacles, push);
    text.push_str(",\n");
    push_lines(&mut text, "movers", movers, push);
    text.push_str("\n}\n");
    text.into_bytes()
}

/// Writes a world file, replacing an old one as a whole.
pub fn save_workspace(workspace: &Workspace, path: impl AsRef<Path>) -> Result<(), InputError> {
    write_atomically(path.as_ref(), &write_workspace(workspace))
}

#[cfg(test)]
mod tests {
    use super::*;

    const EXAMPLE: &str = r#"{
  "format": "fleetyard.world/1",
  "name": "two rooms",
  "bounds_m": [0, 0, 10, 5],
  "obstacles": [
    {"polygon": [[4.9, 0], [5.1, 0], [5.1, 2], [4.9, 2]]},
    {"rectangle": {"center": [5, 4], "size": [0.2, 2], "angle_rad": 0.25}}
  ],
  "movers": [
    {"footprint": {"disc": {"radius_m": 0.3}}, "knots": [[1, 1, 1, 0], [9, 9, 1, 4]]}
  ]
}
"#;

    #[test]
    fn files_are_read_and_written() {
        let workspace = read_workspace("a.json", EXAMPLE.as_bytes()).unwrap();
        assert_eq!(workspace.name, "two rooms");
        assert!(workspace.bounds.contains([10.0, 5.0]));
        assert_eq!(workspace.obstacles.len(), 2);
        assert!((workspace.obstacles[1].area_m2() - 0.4).abs() < 1e-12);
        let mover = &workspace.movers[0];
        assert_eq!(mover.pose_at(0.0), Pose::at(1.0, 1.0));
        assert_eq!(mover.pose_at(1.0), Pose::at(1.0, 1.0));
        assert_eq!(mover.pose_at(5.0), Pose::new(5.0, 1.0, 2.0));
        assert_eq!(mover.pose_at(100.0), Pose::new(9.0, 1.0, 4.0));

        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("world.json");
        save_workspace(&workspace, &path).unwrap();
        assert_eq!(load_workspace(&path).unwrap(), workspace);

        let empty = br#"{"format": "fleetyard.world/1", "bounds_m": [0, 0, 1, 1]}"#;
        let empty = read_workspace("b.json", empty).unwrap();
        assert_eq!(
            read_workspace("b.json", &write_workspace(&empty)),
            Ok(empty)
        );
    }

    #[test]
    fn the_edge_of_a_world_need_not_be_a_rectangle() {
        let world = |rest: &str| {
            let text = format!("{{\"format\": \"fleetyard.world/1\"{rest}}}");
            read_workspace("a.json", text.as_bytes())
        };
        let l_shaped = world(r#", "boundary_m": [[0, 0], [4, 0], [4, 1], [1, 1], [1, 3], [0, 3]]"#);
        let l_shaped = l_shaped.unwrap();
        assert_eq!(
            (l_shaped.bounds.min, l_shaped.bounds.max),
            ([0.0, 0.0], [4.0, 3.0])
        );
        let boundary = l_shaped.boundary.as_ref().unwrap();
        assert!((boundary.polygon().area_m2() - 6.0).abs() < 1e-12);
        assert_eq!(
            read_workspace("a.json", &write_workspace(&l_shaped)),
            Ok(l_shaped)
        );
        for (rest, reason) in [
            ("", "there are neither bounds_m nor boundary_m"),
            (
                r#", "bounds_m": [0, 0, 4, 3], "boundary_m": [[0, 0], [4, 0], [4, 1]]"#,
                "there are both bounds_m and boundary_m",
            ),
            (
                r#", "boundary_m": [[0, 0], [4, 0]]"#,
                "boundary_m is no edge: a polygon has at least 3 vertices, this one has 2",
            ),
            (
                r#", "boundary_m": [[0, 0], [4, 4], [4, 0], [0, 4]]"#,
                "boundary_m is no edge: the polygon intersects itself: the edge from vertex 0 \
                 meets the edge from vertex 2",
            ),
            (
                r#", "boundary_m": [[0, 0], [4, 4], [8, 8]]"#,
                "boundary_m is no edge: the polygon has no area: its vertices are in line",
            ),
            (
                r#", "boundary_m": [0, 0, 4, 3]"#,
                "expected an array of length 2",
            ),
        ] {
            let error = world(rest).unwrap_err();
            assert!(error.to_string().contains(reason), "{error}");
            assert!(error.hint.is_some(), "{error}");
        }
    }

    /// Every mistake is named with its place and a way out.
    #[test]
    fn mistakes_have_a_place_and_a_hint() {
        let cases = [
            (
                "world/1",
                "world/2",
                "2:31: format is \"fleetyard.world/2\", expected \"fleetyard.world/1\"",
            ),
            (
                "10, 5]",
                "0, 5]",
                "4:26: bounds_m is [0, 0, 0, 5], which is no area",
            ),
            ("[4.9, 2]]", "[4.9, 1e999]]", "6:58: number out of range"),
            (
                "[5.1, 2], [4.9, 2]",
                "[4.9, 2], [5.1, 2]",
                "6:57: the polygon intersects itself: the edge from vertex 1 meets the edge from vertex 3",
            ),
            ("[0.2, 2]", "[0.2, -2]", "7:75: a rectangle's height is -2"),
            (
                "\"angle_rad\"",
                "\"angle\"",
                "7:62: unknown field `angle`, expected one of `center`, `size`, `angle_rad`",
            ),
            (
                "0.3}",
                "0}",
                "10:83: radius_m is 0, which is not between 0.000001 and 1000000",
            ),
            ("[9, 9", "[1, 9", "10:85: knot 1 is at 1 s, not after 1 s"),
            (
                "[[1, 1, 1, 0], [9, 9, 1, 4]]",
                "[]",
                "10:59: a mover has no knots",
            ),
            (
                "\"movers\"",
                "\"robots\"",
                "9:10: unknown field `robots`, expected one of `format`, `name`, `bounds_m`, `boundary_m`, `obstacles`, `movers`",
            ),
        ];
        for (from, to, message) in cases {
            let text = EXAMPLE.replacen(from, to, 1);
            assert_ne!(text, EXAMPLE, "{from}");
            let error = read_workspace("a.json", text.as_bytes()).unwrap_err();
            assert_eq!(error.to_string(), format!("a.json:{message}"));
            assert!(error.hint.is_some_and(|hint| !hint.is_empty()), "{message}");
        }
        // Coordinates of a map projection, and a number that would fill the screen.
        for (from, to, place) in [
            ("10, 5]", "4500000, 5]", "bounds_m is [0, 0, 4500000, 5]"),
            ("[4.9, 2]]", "[4.9, 1e308]]", "vertex 3 is [4.9, 1e308]"),
            ("[9, 9", "[9, 5200000", "knot 1 is at [5200000, 1]"),
        ] {
            let text = EXAMPLE.replacen(from, to, 1);
            let error = read_workspace("a.json", text.as_bytes()).unwrap_err();
            assert_eq!(
                error.reason,
                format!("{place}, farther than 1000000 m from the origin")
            );
            assert!(
                error.hint.unwrap().contains("subtract one offset"),
                "{from}"
            );
        }
        for cut in 0..EXAMPLE.trim_end().len() {
            let error = read_workspace("a.json", &EXAMPLE.as_bytes()[..cut]).unwrap_err();
            assert!(error.hint.is_some());
        }
    }
}
