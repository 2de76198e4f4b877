//! Corners of obstacles widened by a disc, and the lines that bend round them.
//!
//! A disc that goes round a corner of an obstacle turns on a circle about it. The circle is replaced by
//! a polyline around it whose first and last segments lie on the obstacle's shifted sides. Two of its
//! vertices are joined when a disc can be swept from one to the other and the line between them can
//! belong to a shortest path: at both ends it leaves the polyline on one side (de Berg et al.,
//! *Computational Geometry*, 3rd ed., section 15.2).

use fleetyard_world::Workspace;

use super::sketch::Sketch;
use crate::Free;

/// Most vertices: pairs of them are tried.
const MOST: usize = 20_000;

/// By how much polylines are farther out than circles, in metres, so that segments along shifted
/// sides touch nothing.
const OUT_M: f64 = 1e-7;

type Point = [f64; 2];

/// A vertex of a polyline round a corner, with the directions in which it goes on.
struct Bend {
    at: Point,
    before: Point,
    after: Point,
}

impl Bend {
    /// True if a straight line through the vertex has both sides of the bend on one side: a shortest
    /// path may turn here from, or into, this direction.
    fn is_taut(&self, direction: Point) -> bool {
        let side = |arm: Point| cross(direction, arm);
        side(self.before) * side(self.after) >= -1e-12
    }
}

/// Adds vertices round corners, and the edges among them, starts and goals.
pub(super) fn build(
    sketch: &mut Sketch,
    world: &Workspace,
    free: &Free,
    radius_m: f64,
    sides: u32,
) -> Result<(), String> {
    let pinned = sketch.at_m.len();
    let mut bends: Vec<Option<Bend>> = (0..pinned).map(|_| None).collect();
    let obstacles = world.obstacles.iter().map(|polygon| (polygon, 1.0));
    let boundary = world.boundary.iter().map(|edge| (edge.polygon(), -1.0));
    for (polygon, sign) in obstacles.chain(boundary) {
        let corners = polygon.vertices();
        for number in 0..corners.len() {
            let before = corners[(number + corners.len() - 1) % corners.len()];
            let after = corners[(number + 1) % corners.len()];
            // Counter-clockwise round what is solid: obstacles, and the world from outside.
            let (before, after) = if sign > 0.0 {
                (before, after)
            } else {
                (after, before)
            };
            let round = bend(before, corners[number], after, radius_m + OUT_M, sides);
            bends.extend(
                round
                    .into_iter()
                    .filter(|bend| free.holds(bend.at, radius_m))
                    .map(Some),
            );
        }
    }
    let known = &sketch.at_m[..pinned];
    let at: Vec<Point> = bends
        .iter()
        .enumerate()
        .map(|(vertex, bend)| bend.as_ref().map_or_else(|| known[vertex], |bend| bend.at))
        .collect();
    if at.len() > MOST {
        return Err(format!(
            "corners of obstacles, starts and goals are {} vertices, more than {MOST}",
            at.len()
        ));
    }
    for (from, one) in bends.iter().enumerate() {
        for (to, other) in bends.iter().enumerate().skip(from + 1) {
            let direction = [0, 1].map(|axis| at[to][axis] - at[from][axis]);
            let is_taut =
                |bend: &Option<Bend>| bend.as_ref().is_none_or(|bend| bend.is_taut(direction));
            if direction == [0.0, 0.0] || !is_taut(one) || !is_taut(other) {
                continue;
            }
            if free.sweeps(at[from], at[to], radius_m) {
                sketch.edges.push((from as u32, to as u32));
            }
        }
    }
    sketch.at_m = at;
    Ok(())
}

/// The vertices round a corner that stands out; none where it does not.
fn bend(before: Point, corner: Point, after: Point, radius_m: f64, sides: u32) -> Vec<Bend> {
    let into = unit([corner[0] - before[0], corner[1] - before[1]]);
    let out = unit([after[0] - corner[0], after[1] - corner[1]]);
    let turn = libm::atan2(cross(into, out), into[0] * out[0] + into[1] * out[1]);
    // Nearly straight sides need no bend.
    if turn <= 1e-9 {
        return Vec::new();
    }
    let most = 2.0 * core::f64::consts::PI / f64::from(sides);
    let count = (turn / most - 1e-9).ceil().max(1.0);
    let step = turn / count;
    let reach = radius_m / libm::cos(step / 2.0);
    // Normals point to the right of the sides, out of a polygon that runs counter-clockwise.
    let first = libm::atan2(-into[0], into[1]);
    let heading = |number: f64| {
        let angle = first + number * step;
        // The direction of travel where the normal has that angle.
        [-libm::sin(angle), libm::cos(angle)]
    };
    (0..count as u32)
        .map(f64::from)
        .map(|number| {
            let angle = first + (number + 0.5) * step;
            let at = [
                corner[0] + reach * libm::cos(angle),
                corner[1] + reach * libm::sin(angle),
            ];
            let (back, ahead) = (heading(number), heading(number + 1.0));
            Bend {
                at,
                before: back.map(|x| -x),
                after: ahead,
            }
        })
        .collect()
}

fn unit([x, y]: Point) -> Point {
    let length = (x * x + y * y).sqrt();
    [x / length, y / length]
}

fn cross(a: Point, b: Point) -> f64 {
    a[0] * b[1] - a[1] * b[0]
}
