//! Poses: the position and the heading of a body.

use serde::{Deserialize, Serialize};

use crate::Vector;

/// A position in metres and a heading in radians, counter-clockwise from +x.
///
/// Headings are not wrapped: between two poses a heading goes straight from one
/// number to the other, so that 0 to 3π/2 is three quarters of a turn to the
/// left.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pose {
    /// Metres, growing to the right.
    pub x: f64,
    /// Metres, growing upwards.
    pub y: f64,
    /// Radians, counter-clockwise from +x.
    #[serde(default)]
    pub heading: f64,
}

impl Pose {
    /// A pose.
    pub fn new(x: f64, y: f64, heading: f64) -> Self {
        Self { x, y, heading }
    }

    /// A pose that looks along +x.
    pub fn at(x: f64, y: f64) -> Self {
        Self::new(x, y, 0.0)
    }

    /// True if all three numbers are finite.
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.heading.is_finite()
    }

    /// Cosine and sine of the heading, the same on every machine.
    pub fn rotation(self) -> (f64, f64) {
        // Most bodies of a grid never turn.
        if self.heading == 0.0 {
            (1.0, 0.0)
        } else {
            let (sin, cos) = libm::sincos(self.heading);
            (cos, sin)
        }
    }

    /// The place without the heading.
    pub fn position(self) -> Vector {
        Vector::new(self.x, self.y)
    }

    /// A point of the body in the world. Not as [`Placement`](crate::Placement) does it,
    /// which adds in another order: outlines keep their bits.
    pub fn apply(self, [x, y]: [f64; 2]) -> [f64; 2] {
        let (cos, sin) = self.rotation();
        [self.x + cos * x - sin * y, self.y + sin * x + cos * y]
    }

    /// The pose at a fraction of the way to another; at 0 and 1 exactly the ends.
    #[must_use]
    pub fn toward(self, end: Self, fraction: f64) -> Self {
        if fraction >= 1.0 {
            return end;
        }
        let between = |from: f64, to: f64| from + (to - from) * fraction;
        Self {
            x: between(self.x, end.x),
            y: between(self.y, end.y),
            heading: between(self.heading, end.heading),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn poses_go_from_end_to_end() {
        let (from, to) = (Pose::new(0.1, 0.2, 0.3), Pose::new(-7.7, 1e-9, 123.4));
        assert_eq!(from.toward(to, 0.0), from);
        assert_eq!(from.toward(to, 1.0), to);
        assert_eq!(
            Pose::default().toward(Pose::new(2.0, 4.0, 6.0), 0.5),
            Pose::new(1.0, 2.0, 3.0)
        );
    }

    #[test]
    fn rotations_are_cosine_and_sine() {
        for step in -1000..1000 {
            let heading = f64::from(step) * 0.37;
            let (cos, sin) = Pose::new(0.0, 0.0, heading).rotation();
            assert_eq!(cos.to_bits(), libm::cos(heading).to_bits());
            assert_eq!(sin.to_bits(), libm::sin(heading).to_bits());
        }
        let [x, y] = Pose::new(1.0, 2.0, std::f64::consts::FRAC_PI_2).apply([3.0, 0.0]);
        assert!((x - 1.0).abs() < 1e-15 && (y - 5.0).abs() < 1e-15);
    }
}
