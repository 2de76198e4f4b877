//! The shortest path of a disc among polygons.
//!
//! The centre must keep a radius of distance to every polygon. A shortest path goes straight, or turns round a corner at
//! that distance: it is made of common tangents of circles round corners, and arcs between them (Y.-H. Liu, S. Arimoto,
//! "Path planning using a tangent graph for mobile robots among polygonal and curved obstacles", IJRR 11(4), 1992). The
//! graph has a tangent for every pair of corners and each way round them. Here none is made before A\* asks for it, and none
//! is tested against the obstacles before it is the best that is left.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use crate::Vector;
use crate::obstacles::{Corner, Obstacles, cross, right};

/// A way of a disc's centre.
#[derive(Debug, Clone, PartialEq)]
pub struct Way {
    /// Its length with true arcs, in metres.
    pub length: f64,
    /// Places to drive between straight. An arc is a few tangents of it, so that the obstacle is never nearer than the radius;
    /// they are longer than the arc by less than 0.3 %.
    pub places: Vec<Vector>,
}

/// Circles are so much larger than the radius, in metres, that rounding makes no contact.
const CLEARANCE: f64 = 1e-7;

/// Longest turn of an arc that is driven as one corner, in radians: ten degrees.
const STEP: f64 = std::f64::consts::PI / 18.0;

/// Sine of an angle that counts as none.
const LEVEL: f64 = 1e-9;

/// Sine of an angle by which a tangent may lean towards an edge of its corner: one to a place that touches the edge leans a
/// little, for the circle is larger than the radius. It is tested like all others.
const GRAZE: f64 = 1e-5;

/// The direction of driving round a corner: with it to the left, or to the right.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Round {
    Left,
    Right,
}

impl Round {
    fn sign(self) -> f64 {
        match self {
            Self::Left => 1.0,
            Self::Right => -1.0,
        }
    }
}

/// An end of a tangent.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Place {
    Start,
    Goal,
    Corner(u32, Round),
}

/// A place that was reached.
#[derive(Debug, Clone, Copy)]
struct Node {
    place: Place,
    /// From the corner to where the centre meets its circle, of length 1; nothing at the start.
    normal: Vector,
    length: f64,
    parent: u32,
    /// Of the circle of the node before, where the centre left it.
    left: Vector,
}

/// A tangent that was not tested yet; the greatest is the one with the least estimate.
struct Entry {
    estimate: f64,
    node: Node,
}

impl PartialEq for Entry {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other).is_eq()
    }
}

impl Eq for Entry {}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> Ordering {
        let least = other.estimate.total_cmp(&self.estimate);
        least.then(self.node.length.total_cmp(&other.node.length))
    }
}

/// Searches among the same obstacles.
#[derive(Debug)]
pub struct Tangents<'a> {
    obstacles: &'a Obstacles,
    corners: Vec<Corner>,
    radius: f64,
    step: f64,
    /// Places from which tangents were offered, in all searches.
    pub expanded: u64,
    /// Tangents that were offered, in all searches.
    pub offered: u64,
    /// Tangents that were tested against the obstacles, in all searches.
    pub tested: u64,
}

impl<'a> Tangents<'a> {
    /// Among these obstacles, for the disc that they know.
    pub fn new(obstacles: &'a Obstacles) -> Self {
        Self::with_step(obstacles, STEP)
    }

    /// The same with arcs of corners that turn by at most `step`, in radians.
    pub fn with_step(obstacles: &'a Obstacles, step: f64) -> Self {
        Self {
            corners: obstacles.corners().collect(),
            radius: obstacles.radius() + CLEARANCE,
            obstacles,
            step,
            expanded: 0,
            offered: 0,
            tested: 0,
        }
    }

    /// The shortest way, or none where there is none or where start or goal are not free.
    pub fn shortest(
        &mut self,
        start: Vector,
        goal: Vector,
        stop: &mut dyn FnMut() -> bool,
    ) -> Option<Way> {
        if !self.obstacles.free(start) || !self.obstacles.free(goal) {
            return None;
        }
        if start == goal {
            return Some(Way {
                length: 0.0,
                places: vec![start],
            });
        }
        let mut nodes: Vec<Node> = Vec::new();
        let mut closed: Vec<Vec<u32>> = vec![Vec::new(); 2 * self.corners.len()];
        let mut open = BinaryHeap::new();
        let ends = [start, goal];
        let first = Node {
            place: Place::Start,
            normal: Vector::zeros(),
            length: 0.0,
            parent: 0,
            left: Vector::zeros(),
        };
        open.push(Entry {
            estimate: (goal - start).norm(),
            node: first,
        });
        while let Some(Entry { node, .. }) = open.pop() {
            if let Place::Corner(corner, round) = node.place {
                let list = &closed[2 * corner as usize + usize::from(round == Round::Right)];
                let reached = |known: &u32| {
                    let known = &nodes[*known as usize];
                    let turn = self.turned(node.place, known.normal, node.normal);
                    turn.is_some_and(|turn| {
                        known.length + turn * self.size(node.place) <= node.length
                    }) && self.clear(&self.arc(known, node.normal, ends))
                };
                if list.iter().any(reached) {
                    continue;
                }
            }
            if !nodes.is_empty() && !self.passes(&nodes[node.parent as usize], &node, ends) {
                continue;
            }
            if node.place == Place::Goal {
                return Some(self.way(&nodes, node, ends));
            }
            if let Place::Corner(corner, round) = node.place {
                closed[2 * corner as usize + usize::from(round == Round::Right)]
                    .push(nodes.len() as u32);
            }
            let number = nodes.len() as u32;
            nodes.push(node);
            if stop() {
                return None;
            }
            self.expand(&node, number, ends, &mut open);
        }
        None
    }

    /// Offers all tangents that leave a node.
    fn expand(
        &mut self,
        from: &Node,
        number: u32,
        ends: [Vector; 2],
        open: &mut BinaryHeap<Entry>,
    ) {
        self.expanded += 1;
        let before = open.len();
        let mut offer = |to: Place| {
            if let Some(node) = self.tangent(from, number, to, ends) {
                let at = self.centre(node.place, ends) + node.normal * self.size(node.place);
                let estimate = node.length + (ends[1] - at).norm();
                open.push(Entry { estimate, node });
            }
        };
        offer(Place::Goal);
        for corner in 0..self.corners.len() as u32 {
            offer(Place::Corner(corner, Round::Left));
            offer(Place::Corner(corner, Round::Right));
        }
        self.offered += (open.len() - before) as u64;
    }

    /// The tangent from a node to a place, if both circles may be left and met there.
    fn tangent(&self, from: &Node, number: u32, to: Place, ends: [Vector; 2]) -> Option<Node> {
        let (leave, meet) = (self.size(from.place), self.size(to));
        let (leave_sign, meet_sign) = (sign(from.place), sign(to));
        let between = self.centre(to, ends) - self.centre(from.place, ends);
        // With the unit direction u of the tangent and its right normal w the centres are apart by L·u + k·w.
        let k = leave * leave_sign - meet * meet_sign;
        let square = between.norm_squared();
        if square <= k * k {
            return None;
        }
        let length = (square - k * k).sqrt();
        let direction = (between * length - right(between) * k) / square;
        let (left, normal) = (right(direction) * leave_sign, right(direction) * meet_sign);
        if !self.exposed(from.place, left) || !self.exposed(to, normal) {
            return None;
        }
        let turn = self.turned(from.place, from.normal, left)?;
        Some(Node {
            place: to,
            normal,
            length: from.length + turn * leave + length,
            parent: number,
            left,
        })
    }

    /// A disc that touches the corner on this side touches neither of its edges.
    fn exposed(&self, place: Place, normal: Vector) -> bool {
        let Some([before, after]) = self.corner(place).and_then(|corner| corner.normals) else {
            return true;
        };
        cross(before, normal) > -GRAZE
            && cross(normal, after) > -GRAZE
            && (before + after).dot(&normal) > 0.0
    }

    /// The arc from where a node was met to where it is left, and the tangent from there, touch nothing.
    fn passes(&mut self, from: &Node, to: &Node, ends: [Vector; 2]) -> bool {
        self.tested += 1;
        let mut places = self.arc(from, to.left, ends);
        places.push(self.centre(to.place, ends) + to.normal * self.size(to.place));
        self.clear(&places)
    }

    /// Nothing is touched on straight lines between places.
    fn clear(&self, places: &[Vector]) -> bool {
        // The last piece is most often what is blocked.
        let mut pieces = places.windows(2).rev();
        pieces.all(|piece| self.obstacles.clear(piece[0], piece[1]))
    }

    /// Places along the circle of a node, from where it was met to where it is left.
    fn arc(&self, node: &Node, left: Vector, ends: [Vector; 2]) -> Vec<Vector> {
        let (centre, size) = (self.centre(node.place, ends), self.size(node.place));
        let Place::Corner(_, round) = node.place else {
            return vec![centre];
        };
        let turn = self.turned(node.place, node.normal, left).unwrap_or(0.0);
        let pieces = (turn / self.step).ceil().max(1.0);
        let half = turn / pieces / 2.0;
        let reach = size / libm::cos(half);
        let mut places = vec![centre + node.normal * size];
        for piece in 0..pieces as u32 {
            let angle = half * f64::from(2 * piece + 1) * round.sign();
            let (sin, cos) = (libm::sin(angle), libm::cos(angle));
            let normal = node.normal;
            let turned = Vector::new(
                normal.x * cos - normal.y * sin,
                normal.x * sin + normal.y * cos,
            );
            places.push(centre + turned * reach);
        }
        places.push(centre + left * size);
        places
    }

    fn way(&self, nodes: &[Node], last: Node, ends: [Vector; 2]) -> Way {
        let mut pieces = vec![vec![ends[1]]];
        let mut node = last;
        loop {
            let parent = nodes[node.parent as usize];
            pieces.push(self.arc(&parent, node.left, ends));
            if parent.place == Place::Start {
                break;
            }
            node = parent;
        }
        let mut places: Vec<Vector> = pieces.into_iter().rev().flatten().collect();
        places.dedup();
        Way {
            length: last.length,
            places,
        }
    }

    fn corner(&self, place: Place) -> Option<&Corner> {
        match place {
            Place::Corner(corner, _) => Some(&self.corners[corner as usize]),
            _ => None,
        }
    }

    fn centre(&self, place: Place, [start, goal]: [Vector; 2]) -> Vector {
        match place {
            Place::Start => start,
            Place::Goal => goal,
            Place::Corner(corner, _) => self.corners[corner as usize].at,
        }
    }

    /// The radius of a place's circle.
    fn size(&self, place: Place) -> f64 {
        self.corner(place)
            .map_or(0.0, |corner| self.radius + corner.radius)
    }

    /// The angle from one normal to another on the way round a place. A corner is left before half a turn; none is made at
    /// a start.
    fn turned(&self, place: Place, from: Vector, to: Vector) -> Option<f64> {
        let Place::Corner(corner, round) = place else {
            return Some(0.0);
        };
        let sine = cross(from, to) * round.sign();
        if sine > -LEVEL {
            return Some(libm::atan2(sine.max(0.0), from.dot(&to)));
        }
        let whole = self.corners[corner as usize].normals.is_none();
        whole.then(|| std::f64::consts::TAU + libm::atan2(sine, from.dot(&to)))
    }
}

/// The side of its circle's centre on which a tangent passes: 1 where that is to the left.
fn sign(place: Place) -> f64 {
    match place {
        Place::Corner(_, round) => round.sign(),
        _ => 1.0,
    }
}
