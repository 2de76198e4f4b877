//! The quickest motions of a robot with two driven wheels where nothing is in the way.
//!
//! Where speed and turn rate are limited each by itself, a quickest motion of first order drives at full speed all the time, ahead
//! or back, and turns as fast as it can or not at all (by the maximum principle). So it is a shortest curve of Reeds and Shepp (Optimal paths for a car that
//! goes both forwards and backwards, Pacific Journal of Mathematics 145(2), 1990) with the radius of the fastest arc. Formulas are
//! numbered as in that paper.

use std::f64::consts::{FRAC_PI_2, PI};

use fleetyard_plugin_plane::sssp::bodies::{Pose, wrapped};

use crate::course::Segment;
use crate::robot::{Robot, rotated};

/// Curves of a robot.
#[derive(Debug, Clone, Copy)]
pub struct Curves {
    /// Of arcs, in metres.
    radius: f64,
    /// In m/s, above zero.
    ahead: f64,
    /// In m/s, at least zero.
    back: f64,
}

/// Signs of turns, and angles or lengths in radii; below zero: driven back.
type Word = [(f64, f64); 5];

impl Curves {
    /// None of a robot that moves in another way. One of second order needs more time than these say.
    pub fn new(robot: &Robot) -> Option<Self> {
        let [back, ahead] = robot.rates[0];
        let [right, left] = robot.rates[2];
        let turn = left.min(-right);
        let wheeled = robot.turns_axes && !robot.goes_sideways;
        (wheeled && turn > 0.0 && ahead > 0.0).then(|| Self {
            radius: ahead.max(-back) / turn,
            ahead,
            back: -back,
        })
    }

    /// The same with arcs of at least this radius, in metres.
    #[must_use]
    pub fn wider(&self, radius: f64) -> Self {
        Self {
            radius: radius.max(self.radius),
            ..*self
        }
    }

    /// Seconds of the quickest motion, and its controls.
    pub fn quickest(&self, from: &Pose, to: &Pose) -> Option<(f64, Vec<Segment>)> {
        let (seconds, word) = self.word(from, to)?;
        let parts = word.iter().filter(|(_, length)| length.abs() > 1e-12);
        let segments = parts.map(|(turn, length)| {
            let speed = if *length > 0.0 {
                self.ahead
            } else {
                -self.back
            };
            Segment {
                control: [
                    speed,
                    0.0,
                    turn * speed.abs() / self.radius * length.signum(),
                ],
                seconds: length * self.radius / speed,
            }
        });
        Some((seconds, segments.collect()))
    }

    /// Seconds of the quickest motion.
    pub fn seconds(&self, from: &Pose, to: &Pose) -> f64 {
        self.word(from, to)
            .map_or(f64::INFINITY, |(seconds, _)| seconds)
    }

    fn word(&self, from: &Pose, to: &Pose) -> Option<(f64, Word)> {
        let way = rotated(to.at - from.at, -from.heading) / self.radius;
        let turn = wrapped(to.heading - from.heading);
        let mut best: Option<(f64, Word)> = None;
        let mut consider = |word: Word| {
            let parts = word.iter().map(|(_, length)| {
                let speed = if *length >= 0.0 {
                    self.ahead
                } else {
                    self.back
                };
                if *length == 0.0 {
                    0.0
                } else {
                    length.abs() * self.radius / speed
                }
            });
            let seconds: f64 = parts.sum();
            if seconds.is_finite() && best.is_none_or(|(known, _)| seconds < known - 1e-12) {
                best = Some((seconds, word));
            }
        };
        let (sin, cos) = libm::sincos(turn);
        let forth = (way.x, way.y);
        let back = (way.x * cos + way.y * sin, way.x * sin - way.y * cos);
        for (reversed, (x, y)) in [(false, forth), (true, back)] {
            for (flip, mirror) in [(1.0, 1.0), (-1.0, 1.0), (1.0, -1.0), (-1.0, -1.0)] {
                let goal = Goal::new(x * flip, y * mirror, turn * flip * mirror);
                let mut add = |letters: &[f64], lengths: &[f64]| {
                    let mut word = [(0.0, 0.0); 5];
                    let count = letters.len();
                    for number in 0..count {
                        let place = if reversed { count - 1 - number } else { number };
                        word[place] = (letters[number] * mirror, lengths[number] * flip);
                    }
                    consider(word);
                };
                goal.words(reversed, &mut add);
            }
        }
        best
    }
}

const LEFT: f64 = 1.0;
const RIGHT: f64 = -1.0;
const STRAIGHT: f64 = 0.0;

/// Angles may be below zero by rounding.
const ROUNDING: f64 = 1e-12;

/// A pose seen from the start, in radii.
struct Goal {
    x: f64,
    y: f64,
    turn: f64,
    sin: f64,
    cos: f64,
}

fn polar(x: f64, y: f64) -> (f64, f64) {
    (libm::hypot(x, y), libm::atan2(y, x))
}

fn least(angle: f64) -> bool {
    angle >= -ROUNDING
}

impl Goal {
    fn new(x: f64, y: f64, turn: f64) -> Self {
        let (sin, cos) = libm::sincos(turn);
        Self {
            x,
            y,
            turn,
            sin,
            cos,
        }
    }

    /// Words that begin with a left turn ahead. `reversed` asks for those alone that read differently from the end.
    fn words(&self, reversed: bool, add: &mut dyn FnMut(&[f64], &[f64])) {
        let (x, y, turn) = (self.x, self.y, self.turn);
        // Of the circle to the left at the goal, and of that to the right.
        let (left_x, left_y) = (x - self.sin, y - 1.0 + self.cos);
        let (right_x, right_y) = (x + self.sin, y - 1.0 - self.cos);
        let (left, left_angle) = polar(left_x, left_y);
        let (right, right_angle) = polar(right_x, right_y);
        // 8.3: C | C | C and C | C C.
        if left <= 4.0 {
            let u = -2.0 * libm::asin(left / 4.0);
            let t = wrapped(left_angle + u / 2.0 + PI);
            let v = wrapped(turn - t + u);
            if least(t) {
                add(&[LEFT, RIGHT, LEFT], &[t, u, v]);
            }
        }
        if left >= 2.0 {
            // 8.9: C | C S C.
            let root = libm::sqrt((left * left - 4.0).max(0.0));
            let u = 2.0 - root;
            let t = wrapped(left_angle + libm::atan2(root, -2.0));
            let v = wrapped(turn - FRAC_PI_2 - t);
            if least(t) && u <= ROUNDING && v <= ROUNDING {
                add(&[LEFT, RIGHT, STRAIGHT, LEFT], &[t, -FRAC_PI_2, u, v]);
            }
        }
        if right >= 2.0 {
            // 8.10.
            let t = libm::atan2(right_x, -right_y);
            let u = 2.0 - right;
            let v = wrapped(t + FRAC_PI_2 - turn);
            if least(t) && u <= ROUNDING && v <= ROUNDING {
                add(&[LEFT, RIGHT, STRAIGHT, RIGHT], &[t, -FRAC_PI_2, u, v]);
            }
        }
        if reversed {
            return;
        }
        // 8.1: C S C, both turns the same way.
        let (t, v) = (left_angle, wrapped(turn - left_angle));
        if least(t) && least(v) {
            add(&[LEFT, STRAIGHT, LEFT], &[t, left, v]);
        }
        if right >= 2.0 {
            // 8.2: C S C.
            let u = libm::sqrt((right * right - 4.0).max(0.0));
            let t = wrapped(right_angle + libm::atan2(2.0, u));
            let v = wrapped(t - turn);
            if least(t) && least(v) {
                add(&[LEFT, STRAIGHT, RIGHT], &[t, u, v]);
            }
            // 8.11: C | C S C | C.
            let u = 4.0 - u;
            if u <= ROUNDING {
                let t = libm::atan2(
                    (4.0 - u) * right_x - 2.0 * right_y,
                    -2.0 * right_x + (u - 4.0) * right_y,
                );
                let v = wrapped(t - turn);
                if least(t) && least(v) {
                    add(
                        &[LEFT, RIGHT, STRAIGHT, LEFT, RIGHT],
                        &[t, -FRAC_PI_2, u, -FRAC_PI_2, v],
                    );
                }
            }
        }
        // 8.7: C Cu | Cu C.
        let rho = (2.0 + right) / 4.0;
        if rho <= 1.0 {
            let u = libm::acos(rho);
            let (t, v) = self.ends(u, -u, right_x, right_y);
            if least(t) && v <= ROUNDING {
                add(&[LEFT, RIGHT, LEFT, RIGHT], &[t, u, -u, v]);
            }
        }
        // 8.8: C | Cu Cu | C.
        let rho = (20.0 - right * right) / 16.0;
        if (0.0..=1.0).contains(&rho) {
            let u = -libm::acos(rho);
            let (t, v) = self.ends(u, u, right_x, right_y);
            if least(t) && least(v) {
                add(&[LEFT, RIGHT, LEFT, RIGHT], &[t, u, u, v]);
            }
        }
    }

    /// The first and the last arc of words with two arcs between.
    fn ends(&self, u: f64, v: f64, xi: f64, eta: f64) -> (f64, f64) {
        let delta = wrapped(u - v);
        let (a, b) = (
            libm::sin(u) - libm::sin(delta),
            libm::cos(u) - libm::cos(delta) - 1.0,
        );
        let angle = libm::atan2(eta * a - xi * b, xi * a + eta * b);
        let other = 2.0 * (libm::cos(delta) - libm::cos(v) - libm::cos(u)) + 3.0;
        let tau = wrapped(if other < 0.0 { angle + PI } else { angle });
        (tau, wrapped(tau - u + v - self.turn))
    }
}
