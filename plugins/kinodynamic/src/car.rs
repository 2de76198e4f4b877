//! Cars: what steering adds to a robot on wheels, and the trailer that it may tow.
//!
//! A car drives as wheels do, but its turn rate is at most its curvature times its speed. Controls here are speed and turn rate as of
//! other wheels; the contract's steering angle is made of them in the end ([`Car::steering`]). A trailer follows by itself: over a
//! motion of constant rates the angle of its joint obeys an equation of Riccati, dα/du = a − b sin α, whose solution is closed.

use std::f64::consts::PI;
use std::rc::Rc;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::sssp::bodies::{Body, Pose, wrapped};

/// Sizes of a robot that steers.
#[derive(Debug, Clone, PartialEq)]
pub struct Car {
    /// Distance of the axles, in metres.
    pub wheelbase: f64,
    /// Greatest turn on a metre of way, in radians.
    pub curvature: f64,
    /// The trailer that it tows.
    pub trailer: Option<Trailer>,
}

/// A body behind a car.
#[derive(Debug, Clone, PartialEq)]
pub struct Trailer {
    /// Metres from the origin of the car to that of the trailer.
    pub hitch: f64,
    /// Greatest angle of the joint, in radians.
    pub most: f64,
    /// The body; of a member of a team with half of the distance that robots keep from each other.
    pub body: Rc<Body>,
}

impl Car {
    /// Of parameters of the contract, with the greatest steering angle; none if they are no sizes.
    pub fn new(parameters: &[f64], steering: f64) -> Option<Self> {
        let are_sizes = parameters.iter().all(|size| SIZES.contains(size));
        let (wheelbase, trailer) = match *parameters {
            [wheelbase] => (wheelbase, None),
            [wheelbase, hitch, length, width, most] => {
                let (x, y) = (length / 2.0, width / 2.0);
                let corners = [[x, y], [-x, y], [-x, -y], [x, -y]];
                let body = Body {
                    radius: libm::hypot(x, y),
                    corners: corners.map(|[x, y]| Vector::new(x, y)).to_vec(),
                };
                let body = Rc::new(body);
                (wheelbase, Some(Trailer { hitch, most, body }))
            }
            _ => return None,
        };
        let curvature = libm::tan(steering.clamp(0.0, STEEPEST)) / wheelbase;
        are_sizes.then_some(Self {
            wheelbase,
            curvature,
            trailer,
        })
    }

    /// The steering angle of a speed and a turn rate.
    pub fn steering(&self, speed: f64, turn_rate: f64) -> f64 {
        if turn_rate == 0.0 {
            0.0
        } else {
            libm::atan(turn_rate * self.wheelbase / speed)
        }
    }
}

/// Parameters in metres, and radians.
const SIZES: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// Steering angles are less than a quarter turn, in radians.
const STEEPEST: f64 = 1.5;

impl Trailer {
    /// The pose behind a car's origin.
    pub fn pose(&self, at: Vector, heading: f64) -> Pose {
        let (sin, cos) = libm::sincos(heading);
        Pose {
            at: at - Vector::new(cos, sin) * self.hitch,
            heading,
        }
    }

    /// Its heading after the car turned evenly from one heading to another and drove so many metres, below zero for back.
    pub fn after(&self, own: f64, [from, to]: [f64; 2], way: f64) -> f64 {
        let (turn, hitches) = (to - from, way / self.hitch);
        let joint = wrapped(from - own);
        // Whole turns between both headings stay.
        let turns = from - own - joint;
        to - joint_after(joint, turn, hitches) - turns
    }

    /// Farthest that a point of it is from the origin of the car, in metres.
    pub fn reach(&self) -> f64 {
        self.hitch + self.body.radius
    }

    /// The joint may be so.
    pub fn allows(&self, heading: f64, own: f64) -> bool {
        wrapped(heading - own).abs() <= self.most
    }

    /// Straight pieces of its motion that keep so near to it: a turn of the car, its way, and the joint at both ends.
    pub fn pieces(&self, turn: f64, way: f64, joints: [f64; 2], distance: f64) -> f64 {
        let steep = joints.map(|joint| wrapped(joint).abs());
        let sin = if steep[0].max(steep[1]) < PI / 2.0 {
            libm::sin(steep[0].max(steep[1]))
        } else {
            1.0
        };
        let (turn, hitches) = (turn.abs(), way.abs() / self.hitch);
        let twist = hitches * (turn + hitches * sin);
        let bend = self.hitch * (twist + hitches * hitches * sin * sin);
        libm::sqrt(twist.max(bend) / (8.0 * distance))
    }
}

/// The angle of a joint after the car turned evenly and drove so many hitch lengths.
///
/// With p = sin(α/2) and q = cos(α/2), p' = (a q − b p)/2 and q' = (b q − a p)/2 but for a common factor.
fn joint_after(joint: f64, turn: f64, hitches: f64) -> f64 {
    let (sin, cos) = libm::sincos(joint / 2.0);
    let square = (hitches * hitches - turn * turn) / 4.0;
    let root = libm::sqrt(square.abs());
    let (even, change) = if root == 0.0 {
        (1.0, 1.0)
    } else if square > 0.0 {
        (1.0, libm::tanh(root) / root)
    } else {
        let (sin, cos) = libm::sincos(root);
        (cos, sin / root)
    };
    let p = even * sin + change * (turn * cos - hitches * sin) / 2.0;
    let q = even * cos + change * (hitches * cos - turn * sin) / 2.0;
    wrapped(2.0 * libm::atan2(p, q))
}
