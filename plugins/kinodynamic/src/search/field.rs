//! Distances on a grid over the world: of every place from what stands, and of every place from a goal.
//!
//! Most questions whether a body touches a wall are answered by its distance: discs that cover the body are clear, or the largest disc inside it
//! is not. Only where neither is so the body itself is looked at.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f32::consts::SQRT_2;
use std::rc::Rc;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::{Bins, Rectangle};
use fleetyard_plugin_plane::obstacles::Obstacles;
use fleetyard_plugin_plane::prioritised::World;
use fleetyard_plugin_plane::sssp::bodies::{Body, Leg, Pose, Space, wrapped};

use crate::course::{Knot, between};
use crate::plugin::Member;

/// Cells between two looks at the clock.
const UNLOOKED: usize = 1024;

/// Most cells along one side.
const MOST_CELLS: f64 = 256.0;

/// Steps between cells: columns, rows, and their length in cells. Ways of such steps are longer than straight ones by a factor of
/// [`DETOUR`] at most.
const STEPS: [(isize, isize, f32); 16] = [
    (1, 0, 1.0),
    (0, 1, 1.0),
    (-1, 0, 1.0),
    (0, -1, 1.0),
    (1, 1, SQRT_2),
    (-1, 1, SQRT_2),
    (1, -1, SQRT_2),
    (-1, -1, SQRT_2),
    (2, 1, 2.236_068),
    (1, 2, 2.236_068),
    (-1, 2, 2.236_068),
    (-2, 1, 2.236_068),
    (-2, -1, 2.236_068),
    (-1, -2, 2.236_068),
    (1, -2, 2.236_068),
    (2, -1, 2.236_068),
];
const DETOUR: f64 = 1.0275;

/// A grid of distances from what stands.
#[derive(Debug)]
pub struct Field {
    origin: Vector,
    cell: f64,
    columns: usize,
    rows: usize,
    /// Of the middle of each cell, below zero inside of obstacles; no more than the cap.
    clearance: Vec<f32>,
    /// The least number is distance from the box around the world, which is exact anywhere.
    bounds: Rectangle,
}

impl Field {
    /// Of a world, in cells of about that side, with distances of up to `cap` metres; `None` where `stop`, which is
    /// asked now and then, says so first.
    pub fn new(world: &World, cell: f64, cap: f64, stop: &mut dyn FnMut() -> bool) -> Option<Self> {
        let extent = world.bounds.max - world.bounds.min;
        let cell = cell.max(extent.max() / MOST_CELLS).max(1e-9);
        let count = |length: f64| (length / cell).ceil().clamp(1.0, MOST_CELLS + 1.0) as usize;
        let (columns, rows) = (count(extent.x), count(extent.y));
        let edges: Vec<[Vector; 2]> = world
            .polygons
            .iter()
            .flat_map(|corners| {
                (0..corners.len()).map(|at| [corners[at], corners[(at + 1) % corners.len()]])
            })
            .collect();
        let boxes = edges.iter().map(|[a, b]| Rectangle::around(*a, *b, 0.0));
        let bins = Bins::new(boxes.collect());
        let solid = Obstacles::new(world.polygons.clone(), world.bounds, 0.0);
        let mut field = Self {
            origin: world.bounds.min,
            cell,
            columns,
            rows,
            clearance: Vec::with_capacity(columns * rows),
            bounds: world.bounds,
        };
        for number in 0..columns * rows {
            if number % UNLOOKED == UNLOOKED - 1 && stop() {
                return None;
            }
            let place = field.middle(number);
            let mut nearest = cap * cap;
            bins.meeting(&Rectangle::around(place, place, cap), |edge| {
                let [a, b] = edges[edge as usize];
                nearest = nearest.min(squared_distance(a, b, place));
            });
            let distance = nearest.sqrt();
            let free = edges.is_empty() || solid.free(place);
            field
                .clearance
                .push(if free { distance } else { -distance } as f32);
        }
        Some(field)
    }

    fn middle(&self, number: usize) -> Vector {
        let (column, row) = (number % self.columns, number / self.columns);
        self.origin + Vector::new(column as f64 + 0.5, row as f64 + 0.5) * self.cell
    }

    fn number(&self, place: Vector) -> usize {
        let at = (place - self.origin) / self.cell;
        let column = (at.x.max(0.0) as usize).min(self.columns - 1);
        let row = (at.y.max(0.0) as usize).min(self.rows - 1);
        row * self.columns + column
    }

    /// Least and most distance of a place from what stands; both are no more than the cap.
    fn clearance(&self, place: Vector) -> (f64, f64) {
        let number = self.number(place);
        let (known, off) = (
            f64::from(self.clearance[number]),
            (place - self.middle(number)).norm() + 1e-6,
        );
        let (low, high) = (place - self.bounds.min, self.bounds.max - place);
        let edge = low.min().min(high.min());
        ((known - off).min(edge), (known + off).min(edge))
    }

    /// Metres from every cell to a place, infinite where there is no way. `factor` of the clearance of a cell, in metres, is that of
    /// ways into it.
    fn distances(&self, to: Vector, factor: impl Fn(f64) -> f32) -> Vec<f32> {
        let mut distances = vec![f32::INFINITY; self.clearance.len()];
        let goal = self.number(to);
        distances[goal] = 0.0;
        let mut open = BinaryHeap::from([(Reverse(0_u32), goal)]);
        while let Some((Reverse(bits), number)) = open.pop() {
            // Bits of numbers above zero are in their order.
            let distance = f32::from_bits(bits);
            if distance > distances[number] {
                continue;
            }
            let (column, row) = (number % self.columns, number / self.columns);
            for (right, up, length) in STEPS {
                let place = column
                    .checked_add_signed(right)
                    .zip(row.checked_add_signed(up));
                let Some((column, row)) = place else { continue };
                if column >= self.columns || row >= self.rows {
                    continue;
                }
                let next = row * self.columns + column;
                let after = distance + length * factor(f64::from(self.clearance[next]));
                if after < distances[next] {
                    distances[next] = after;
                    open.push((Reverse(after.to_bits()), next));
                }
            }
        }
        let scale = (self.cell / DETOUR) as f32;
        distances.iter().map(|distance| distance * scale).collect()
    }

    /// The side of a cell, in metres.
    pub fn cell(&self) -> f64 {
        self.cell
    }
}

fn squared_distance(a: Vector, b: Vector, place: Vector) -> f64 {
    let along = b - a;
    let length = along.norm_squared();
    let part = if length > 0.0 {
        ((place - a).dot(&along) / length).clamp(0.0, 1.0)
    } else {
        0.0
    };
    (place - a - along * part).norm_squared()
}

/// Obstacles that stand, as a body sees them.
#[derive(Debug)]
pub struct Walls {
    field: Rc<Field>,
    space: Rc<Space>,
    /// Discs that cover the body: centres and radii.
    cover: Vec<(Vector, f64)>,
    /// Of the largest disc about the origin inside of the body.
    inner: f64,
}

/// Most discs that cover a body.
const MOST_DISCS: f64 = 8.0;

impl Walls {
    /// As the body of that space sees it.
    pub fn new(field: Rc<Field>, space: Rc<Space>) -> Self {
        let (cover, inner) = (cover(&space.body), inner(&space.body));
        Self {
            field,
            space,
            cover,
            inner,
        }
    }

    /// The body is clear wherever its origin is in this circle, and however it turns.
    pub fn is_open(&self, centre: Vector, reach: f64) -> bool {
        self.field.clearance(centre).0 >= reach + self.space.body.radius
    }

    /// The body touches something for certain.
    pub fn is_shut(&self, place: Vector) -> bool {
        self.field.clearance(place).1 < self.inner
    }

    /// A body on its way from knot to knot touches nothing. Where it begins has to be free.
    pub fn is_clear(&self, knots: &[Knot]) -> bool {
        knots
            .windows(2)
            .all(|pair| self.is_part_clear(pair, pair[0].time, pair[1].time))
    }

    fn is_part_clear(&self, pair: &[Knot], from: f64, to: f64) -> bool {
        let (before, next) = (&pair[0], &pair[1]);
        if to <= from {
            return true;
        }
        let [begin, middle, end] =
            [from, f64::midpoint(from, to), to].map(|time| between(before, next, time));
        if self.is_shut(middle.at) {
            return false;
        }
        let (reach, turn) = (
            (end.at - begin.at).norm() / 2.0,
            (end.heading - begin.heading).abs() / 2.0,
        );
        let (sin, cos) = libm::sincos(middle.heading);
        let past = |(offset, radius): &(Vector, f64)| {
            let centre = middle.at
                + Vector::new(
                    cos * offset.x - sin * offset.y,
                    sin * offset.x + cos * offset.y,
                );
            self.field.clearance(centre).0 >= radius + reach + offset.norm() * turn
        };
        if self.cover.iter().all(past) {
            return true;
        }
        if reach * 2.0 > self.field.cell || turn * 2.0 > HALVED_RAD {
            let half = f64::midpoint(from, to);
            return self.is_part_clear(pair, from, half) && self.is_part_clear(pair, half, to);
        }
        self.space.is_clear(&Leg {
            from: begin,
            to: end,
            duration: to - from,
        })
    }
}

/// A part of a motion that turns by more than this is cut in two, in radians.
const HALVED_RAD: f64 = 0.2;

/// Equal discs along the longer side of the box around a body.
fn cover(body: &Body) -> Vec<(Vector, f64)> {
    if body.is_disc() {
        return vec![(Vector::zeros(), body.radius)];
    }
    let first = body.corners[0];
    let (low, high) = body.corners.iter().fold((first, first), |(low, high), at| {
        (low.inf(at), high.sup(at))
    });
    let (middle, extent) = ((low + high) / 2.0, high - low);
    let along = usize::from(extent.y > extent.x);
    let count = (2.0 * extent[along] / extent[1 - along])
        .ceil()
        .clamp(1.0, MOST_DISCS);
    let radius = libm::hypot(extent[along] / count, extent[1 - along]) / 2.0;
    let place = |number: u32| {
        let mut centre = middle;
        centre[along] += extent[along] * ((f64::from(number) + 0.5) / count - 0.5);
        (centre, radius)
    };
    (0..count as u32).map(place).collect()
}

/// The radius of the largest disc about the origin inside of a body.
fn inner(body: &Body) -> f64 {
    if body.is_disc() {
        return body.radius;
    }
    let count = body.corners.len();
    let edges = (0..count).map(|at| {
        let (from, to) = (body.corners[at], body.corners[(at + 1) % count]);
        let along = (to - from).normalize();
        // Corners are counter-clockwise, so that the inside is to the left.
        along.x * -from.y - along.y * -from.x
    });
    edges.fold(f64::INFINITY, f64::min).max(0.0)
}

/// Bounds of the time from a state to rest at a goal.
#[derive(Debug)]
pub struct Remaining {
    field: Rc<Field>,
    distances: Vec<f32>,
    goal: Pose,
    heading_free: bool,
    anywhere: bool,
    travel: Axis,
    turn: Axis,
}

/// The limits of travel along a line, or of turning.
#[derive(Debug, Clone, Copy)]
struct Axis {
    top: f64,
    /// Of speeding up and slowing down; infinite of robots of first order.
    changes: f64,
}

impl Axis {
    /// Least time over a distance from a speed to rest, both at least zero.
    fn seconds(&self, distance: f64, speed: f64) -> f64 {
        if self.changes.is_infinite() {
            return if distance > 0.0 {
                distance / self.top
            } else {
                0.0
            };
        }
        let slowing = speed / self.changes;
        if distance <= slowing * speed / 2.0 {
            return slowing;
        }
        let peak = libm::sqrt(self.changes * distance + speed * speed / 2.0);
        if peak <= self.top {
            return (2.0 * peak - speed) / self.changes;
        }
        let top = self.top.max(speed);
        let ways = (2.0 * top * top - speed * speed) / (2.0 * self.changes);
        (2.0 * top - speed) / self.changes + (distance - ways).max(0.0) / top
    }
}

impl Remaining {
    /// Of a robot on the way to its goal.
    pub fn new(field: Rc<Field>, member: &Member) -> Self {
        let robot = &member.robot;
        let goal = member.goal.state.pose();
        let changes = |most: f64| if robot.is_second { most } else { f64::INFINITY };
        let most = |axis: usize| robot.changes[axis][1].max(-robot.changes[axis][0]);
        // No more is in the way than there is.
        let (least, cell) = (inner(&member.space.body), field.cell);
        let open = |clearance: f64| {
            if clearance + cell >= least {
                1.0
            } else {
                f32::INFINITY
            }
        };
        Self {
            distances: field.distances(goal.at, open),
            field,
            goal,
            heading_free: member.goal.free.heading,
            anywhere: member.goal.place_m.is_infinite(),
            travel: Axis {
                top: robot.top_speed(),
                changes: changes(if robot.polar_changes {
                    most(0).max(most(1))
                } else {
                    libm::hypot(most(0), most(1))
                }),
            },
            turn: Axis {
                top: robot.top_turn_rate(),
                changes: changes(most(2)),
            },
        }
    }

    /// Least seconds that remain; infinite where there is no way.
    pub fn seconds(&self, pose: &Pose, rates: &[f64; 3]) -> f64 {
        let speed = libm::hypot(rates[0], rates[1]);
        let (distance, turn) = if self.anywhere {
            (0.0, 0.0)
        } else {
            let known = f64::from(self.distances[self.field.number(pose.at)]);
            let off = 2.0 * self.field.cell;
            let turn = if self.heading_free {
                0.0
            } else {
                wrapped(self.goal.heading - pose.heading).abs()
            };
            ((known - off).max((self.goal.at - pose.at).norm()), turn)
        };
        self.travel
            .seconds(distance, speed)
            .max(self.turn.seconds(turn, rates[2].abs()))
    }
}

/// A place on the way of a disc to the goal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Waypoint {
    /// The place, and the direction in which the way goes on there; the goal's heading at the goal.
    pub pose: Pose,
    /// Metres that remain from there; zero at the goal.
    pub remaining_m: f64,
}

/// Ways of a body that keep to where there is room.
#[derive(Debug)]
pub struct Guide {
    field: Rc<Field>,
    distances: Vec<f32>,
    goal: Pose,
    least: f64,
}

/// Ways where a body cannot turn count so many times.
const NARROW: f32 = 3.0;

impl Guide {
    /// To the goal of a robot.
    pub fn new(field: Rc<Field>, member: &Member) -> Self {
        let body = &member.space.body;
        let goal = member.goal.state.pose();
        let least = inner(body);
        let cell = field.cell;
        let roomy = |clearance: f64| {
            if clearance >= body.radius + cell / 2.0 {
                1.0
            } else if clearance >= least {
                NARROW
            } else if clearance + cell >= least {
                NARROW * NARROW
            } else {
                f32::INFINITY
            }
        };
        Self {
            distances: field.distances(goal.at, roomy),
            field,
            goal,
            least,
        }
    }

    /// The farthest place that is seen on the way, of those about so many metres ahead at most, or the goal.
    pub fn ahead(&self, from: Vector, metres: f64) -> Waypoint {
        let field = &self.field;
        let mut number = field.number(from);
        let goal = Waypoint {
            pose: self.goal,
            remaining_m: 0.0,
        };
        let mut seen = goal;
        let (mut is_first, mut way) = (true, 0.0);
        while way < metres {
            let (column, row) = (number % field.columns, number / field.columns);
            let next = STEPS.iter().filter_map(|(right, up, length)| {
                let column = column.checked_add_signed(*right)?;
                let row = row.checked_add_signed(*up)?;
                let inside = column < field.columns && row < field.rows;
                let step = (*right as f64, *up as f64, f64::from(*length));
                inside.then_some((row * field.columns + column, step))
            });
            let least = next.min_by(|(one, _), (other, _)| {
                self.distances[*one].total_cmp(&self.distances[*other])
            });
            let Some((next, (right, up, length))) = least else {
                break;
            };
            if self.distances[next] >= self.distances[number] || self.distances[next].is_infinite()
            {
                if self.sees(from, self.goal.at) {
                    return goal;
                }
                break;
            }
            number = next;
            way += length * field.cell;
            let at = field.middle(number);
            if !is_first && !self.sees(from, at) {
                break;
            }
            is_first = false;
            seen = Waypoint {
                pose: Pose {
                    at,
                    heading: libm::atan2(up, right),
                },
                // Where a step ends at the goal there is no way left, but the goal is beyond.
                remaining_m: f64::from(self.distances[number]).max(f64::MIN_POSITIVE),
            };
        }
        seen
    }

    /// The largest disc inside of the body has a straight way.
    pub fn sees(&self, from: Vector, to: Vector) -> bool {
        let steps = ((to - from).norm() / self.field.cell).ceil().max(1.0);
        (1..=steps as u32).all(|step| {
            let place = from + (to - from) * (f64::from(step) / steps);
            self.field.clearance(place).1 >= self.least
        })
    }
}
