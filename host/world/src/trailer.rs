//! Trailers: bodies that follow the motion of a car.
//!
//! A trailer is hitched to the reference point of its car, and rolls behind on an axle in its own
//! middle. So its heading is no choice: it follows from where it was and from how the car moves
//! (Lamiraux, Laumond, IEEE T-RA 17(1), 2001). While a car drives by s at an even turn by Δθ, the angle
//! of the joint α, the car's heading less the trailer's, obeys
//!
//! ```text
//! dα/du = a − b·sin α,   a = Δθ,  b = s / hitch,  u from 0 to 1
//! ```
//!
//! an equation of Riccati in tan(α/2), whose solution is that of a linear one: closed, and without a
//! step. It does not depend on times. α goes one way only within such a part, so that it is largest at
//! an end.

use core::f64::consts::{PI, TAU};

use fleetyard_core::{Knot, Knots, TrajectoryError, TrajectoryPlan};
use serde::{Deserialize, Serialize};

use crate::exact::Motions;
use crate::{CHORD_M, CHORD_RAD, DYNAMICS_TOLERANCE, Footprint, FootprintError, Pose, Shape};

/// A rectangle that is towed. The defaults are those of `car1_v0` of dynobench.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Trailer {
    /// Metres from the reference point of the car to the middle of the trailer; by default 0.5.
    pub hitch_m: f64,
    /// Length of the trailer in metres; by default 0.3.
    pub length_m: f64,
    /// Width of the trailer in metres; by default 0.25.
    pub width_m: f64,
    /// Largest angle between car and trailer in radians; by default π/4.
    pub max_joint_rad: f64,
}

impl Default for Trailer {
    fn default() -> Self {
        Self {
            hitch_m: 0.5,
            length_m: 0.3,
            width_m: 0.25,
            max_joint_rad: 0.25 * PI,
        }
    }
}

/// The angle of a joint after the car drove on by `hitches` hitch lengths, below 0 if it reversed, while
/// it turned evenly by `turn` radians; above −π and at most π.
pub fn joint_after(joint_rad: f64, turn: f64, hitches: f64) -> f64 {
    let (sin, cos) = libm::sincos(0.5 * joint_rad);
    let square = 0.25 * (hitches * hitches - turn * turn);
    let root = square.abs().sqrt();
    // exp of half the matrix [−b a; −a b], but for a factor above 0.
    let (even, change) = if root == 0.0 {
        (1.0, 1.0)
    } else if square > 0.0 {
        (1.0, libm::tanh(root) / root)
    } else {
        let (sin, cos) = libm::sincos(root);
        (cos, sin / root)
    };
    let by = 0.5 * change;
    let after = [
        even * sin + by * (turn * cos - hitches * sin),
        even * cos + by * (hitches * cos - turn * sin),
    ];
    wrapped(2.0 * libm::atan2(after[0], after[1]))
}

fn wrapped(angle: f64) -> f64 {
    let angle = angle - TAU * (angle / TAU).round();
    if angle <= -PI { PI } else { angle }
}

/// The motion of a trailer.
#[derive(Debug, Clone, PartialEq)]
pub struct Towed {
    /// Its poses, between which chords keep to [`CHORD_M`] and [`CHORD_RAD`].
    pub knots: Vec<Knot>,
    /// The place where the joint is bent most, the first among equal ones.
    pub bend: Bend,
}

/// A joint at a time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bend {
    /// Time in seconds.
    pub time_s: f64,
    /// Place of the car in metres.
    pub place_m: [f64; 2],
    /// Heading of the car less that of the trailer, in radians.
    pub joint_rad: f64,
}

impl Trailer {
    /// Area that it covers, about its middle.
    pub fn footprint(&self) -> Footprint {
        let Self {
            length_m, width_m, ..
        } = *self;
        Footprint::Rectangle { length_m, width_m }
    }

    /// The body.
    pub fn shape(&self) -> Result<Shape, FootprintError> {
        self.footprint().shape()
    }

    /// Farthest distance of a point of the trailer from the reference point of the car, in metres.
    pub fn reach_m(&self) -> f64 {
        let (x, y) = (self.hitch_m + 0.5 * self.length_m, 0.5 * self.width_m);
        (x * x + y * y).sqrt()
    }

    /// The pose of the trailer behind a place of the car.
    pub fn pose(&self, [x, y]: [f64; 2], heading_rad: f64) -> Pose {
        let (sin, cos) = libm::sincos(heading_rad);
        let hitch = self.hitch_m;
        Pose::new(x - hitch * cos, y - hitch * sin, heading_rad)
    }

    /// True if the joint is bent beyond its limit and what rounding explains.
    pub fn is_beyond(&self, bend: &Bend) -> bool {
        bend.joint_rad.abs() > self.max_joint_rad * (1.0 + DYNAMICS_TOLERANCE) + DYNAMICS_TOLERANCE
    }

    /// The motion of the trailer behind a car, from this heading on, in at most `most` knots; none if it
    /// has more.
    ///
    /// A leg between two knots of the car is taken for the chord of an arc.
    pub fn follow(&self, car: Knots<'_>, heading_rad: f64, most: usize) -> Option<Towed> {
        let first = car.get(0);
        let heading = |knot: &Knot| knot.heading_rad.unwrap_or(0.0);
        let mut joint = wrapped(heading(&first) - heading_rad);
        let mut behind = heading_rad;
        let mut knots = vec![self.knot(&first, behind)];
        let mut bend = Bend {
            time_s: first.time_s,
            place_m: [first.x_m, first.y_m],
            joint_rad: joint,
        };
        for number in 1..car.len() {
            let (from, to) = (car.get(number - 1), car.get(number));
            let (turn, hitches) = self.drive(&from, &to);
            let end = joint_after(joint, turn, hitches);
            let parts = self.parts(turn, hitches, [joint, end]);
            if parts.is_nan() || parts > most.saturating_sub(knots.len()) as f64 {
                return None;
            }
            for part in 1..=parts as u32 {
                let share = f64::from(part) / parts;
                let (now, own) = if share < 1.0 {
                    let between = |from: f64, to: f64| from + (to - from) * share;
                    let at = Knot {
                        time_s: between(from.time_s, to.time_s),
                        x_m: between(from.x_m, to.x_m),
                        y_m: between(from.y_m, to.y_m),
                        heading_rad: Some(heading(&from) + turn * share),
                    };
                    (at, joint_after(joint, turn * share, hitches * share))
                } else {
                    (to, end)
                };
                let wanted = heading(&now) - own;
                behind = wanted + TAU * ((behind - wanted) / TAU).round();
                let knot = self.knot(&now, behind);
                // Times that are too close to be told apart.
                match knots.last_mut() {
                    Some(same) if same.time_s >= knot.time_s => *same = knot,
                    _ => knots.push(knot),
                }
            }
            joint = end;
            if joint.abs() > bend.joint_rad.abs() {
                bend = Bend {
                    time_s: to.time_s,
                    place_m: [to.x_m, to.y_m],
                    joint_rad: joint,
                };
            }
        }
        Some(Towed { knots, bend })
    }

    /// Turn of a leg, and its way in hitch lengths.
    fn drive(&self, from: &Knot, to: &Knot) -> (f64, f64) {
        let (begin, end) = (
            from.heading_rad.unwrap_or(0.0),
            to.heading_rad.unwrap_or(0.0),
        );
        let turn = end - begin;
        let (sin, cos) = libm::sincos(begin + 0.5 * turn);
        let ahead = (to.x_m - from.x_m) * cos + (to.y_m - from.y_m) * sin;
        let half = 0.5 * turn;
        let arc = if half != 0.0 && half.abs() < 0.5 * PI {
            half / libm::sin(half)
        } else {
            1.0
        };
        (turn, ahead * arc / self.hitch_m)
    }

    /// Parts of a leg that chords keep to: over one, they are off by an eighth of the largest second
    /// derivative.
    fn parts(&self, turn: f64, hitches: f64, joints: [f64; 2]) -> f64 {
        let sin = if joints.iter().all(|joint| joint.abs() < 0.5 * PI) {
            joints.map(|joint| libm::sin(joint.abs()))
        } else {
            [1.0; 2]
        };
        let sin = sin[0].max(sin[1]);
        let (turn, hitches) = (turn.abs(), hitches.abs());
        let twist = hitches * (turn + hitches * sin);
        let way = self.hitch_m * (twist + hitches * hitches * sin * sin);
        let parts = (twist / (8.0 * CHORD_RAD)).max(way / (8.0 * CHORD_M));
        parts.sqrt().ceil().max(1.0)
    }

    fn knot(&self, car: &Knot, heading_rad: f64) -> Knot {
        let pose = self.pose([car.x_m, car.y_m], heading_rad);
        Knot {
            time_s: car.time_s,
            x_m: pose.x,
            y_m: pose.y,
            heading_rad: Some(heading_rad),
        }
    }
}

/// Motions of cars and other robots, and after them those of their trailers.
#[derive(Debug, Clone)]
pub struct Trains<'a> {
    cars: &'a TrajectoryPlan,
    trailers: TrajectoryPlan,
    car_of: Vec<u32>,
}

impl<'a> Trains<'a> {
    /// The motions of a plan, without trailers.
    pub fn new(cars: &'a TrajectoryPlan) -> Self {
        Self {
            cars,
            trailers: TrajectoryPlan::default(),
            car_of: Vec::new(),
        }
    }

    /// Adds the trailer of an agent.
    pub fn push(
        &mut self,
        car: u32,
        knots: impl IntoIterator<Item = Knot>,
    ) -> Result<(), TrajectoryError> {
        self.trailers.push_path(knots)?;
        self.car_of.push(car);
        Ok(())
    }

    /// The agent to which a body belongs: agents are the first bodies, trailers the others.
    pub fn agent_of(&self, body: u32) -> u32 {
        let trailer = (body as usize).checked_sub(self.cars.agents());
        trailer.map_or(body, |trailer| self.car_of[trailer])
    }

    /// The paths of all bodies.
    pub fn paths(&self) -> impl Iterator<Item = Knots<'_>> {
        self.cars.paths().chain(self.trailers.paths())
    }

    fn of(&self, body: usize) -> (&TrajectoryPlan, usize) {
        match body.checked_sub(self.cars.agents()) {
            None => (self.cars, body),
            Some(trailer) => (&self.trailers, trailer),
        }
    }
}

impl Motions for Trains<'_> {
    fn agents(&self) -> usize {
        self.cars.agents() + self.car_of.len()
    }

    fn knots(&self, body: usize) -> usize {
        let (plan, own) = self.of(body);
        Motions::knots(plan, own)
    }

    fn time_s(&self, body: usize, knot: usize) -> f64 {
        let (plan, own) = self.of(body);
        Motions::time_s(plan, own, knot)
    }

    fn pose(&self, body: usize, knot: usize) -> Pose {
        let (plan, own) = self.of(body);
        Motions::pose(plan, own, knot)
    }

    fn are_joined(&self, one: usize, other: usize) -> bool {
        self.agent_of(one as u32) == self.agent_of(other as u32)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::Vector;

    /// The direction of a heading.
    fn direction(heading: f64) -> Vector {
        let (sin, cos) = libm::sincos(heading);
        Vector::new(cos, sin)
    }

    /// By steps of Runge and Kutta.
    fn integrated(joint: f64, turn: f64, hitches: f64) -> f64 {
        let steps = 4000;
        let h = 1.0 / f64::from(steps);
        let rate = |joint: f64| turn - hitches * libm::sin(joint);
        let mut at = joint;
        for _ in 0..steps {
            let one = rate(at);
            let two = rate(at + 0.5 * h * one);
            let three = rate(at + 0.5 * h * two);
            let four = rate(at + h * three);
            at += h / 6.0 * (one + 2.0 * two + 2.0 * three + four);
        }
        at
    }

    proptest! {
        #[test]
        fn joints_agree_with_fine_integration(
            joint in -3.0..3.0f64, turn in -3.0..3.0f64, hitches in -4.0..4.0f64,
        ) {
            let (closed, fine) = (joint_after(joint, turn, hitches), integrated(joint, turn, hitches));
            prop_assert!(wrapped(closed - fine).abs() < 1e-8, "{closed} and {fine}");
            // Half and half are the whole.
            let half = joint_after(joint, 0.5 * turn, 0.5 * hitches);
            let both = joint_after(half, 0.5 * turn, 0.5 * hitches);
            prop_assert!(wrapped(both - closed).abs() < 1e-11);
        }
    }

    #[test]
    fn joints_of_equal_rates_and_at_rest() {
        for joint in [-2.0, -0.3, 0.0, 0.7, 3.0] {
            assert!((joint_after(joint, 0.0, 0.0) - joint).abs() < 1e-15);
            for rate in [1.5, -1.5] {
                let off = joint_after(joint, rate, rate) - integrated(joint, rate, rate);
                assert!(wrapped(off).abs() < 1e-9);
            }
        }
        // A joint that is in line stays so, ahead and back.
        assert!(joint_after(0.0, 0.0, 20.0).abs() < 1e-15);
        assert!(joint_after(0.0, 0.0, -20.0).abs() < 1e-15);
    }

    #[test]
    fn trailers_follow_arcs_whatever_the_knots() {
        let trailer = Trailer::default();
        let arc = |knots: u32| -> TrajectoryPlan {
            let at = |knot: u32| {
                let share = f64::from(knot) / f64::from(knots);
                let place = direction(2.0 * share) * 1.5;
                Knot {
                    time_s: 6.0 * share,
                    x_m: place.x,
                    y_m: place.y,
                    heading_rad: Some(2.0 * share + 0.5 * PI),
                }
            };
            let mut plan = TrajectoryPlan::default();
            plan.push_path((0..=knots).map(at)).unwrap();
            plan
        };
        let towed = |knots: u32| {
            let towed = trailer.follow(arc(knots).knots(0), 1.2, 1 << 12).unwrap();
            (towed.knots[towed.knots.len() - 1], towed)
        };
        let (end, fine) = towed(500);
        let expected = 2.0 + 0.5 * PI - joint_after(0.5 * PI - 1.2, 2.0, 2.0 * 1.5 / 0.5);
        assert!((end.heading_rad.unwrap() - expected).abs() < 1e-11);
        for knots in [3, 10, 77] {
            let (other, coarse) = towed(knots);
            assert!((other.heading_rad.unwrap() - expected).abs() < 1e-11);
            // Chords keep to their bounds between all knots, but for those of the car.
            if knots == 77 {
                let mut plan = TrajectoryPlan::default();
                plan.push_path(coarse.knots).unwrap();
                for knot in &fine.knots {
                    let near = plan.knots(0).at(knot.time_s);
                    let off = Vector::new(near.x_m - knot.x_m, near.y_m - knot.y_m).norm();
                    assert!(off < 4.0 * CHORD_M, "{off}");
                    let turn = near.heading_rad.unwrap() - knot.heading_rad.unwrap();
                    assert!(turn.abs() < 2.0 * CHORD_RAD, "{turn}");
                }
            }
        }
        // The joint is bent most at the begin, where it comes from 0.37 rad to less.
        assert!((fine.bend.joint_rad - (0.5 * PI - 1.2)).abs() < 1e-12);
        assert!(trailer.follow(arc(500).knots(0), 1.2, 400).is_none());
    }
}
