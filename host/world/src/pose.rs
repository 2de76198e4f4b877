//! Where a body is: a position and a heading.

use serde::{Deserialize, Serialize};

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

    /// Whether all three numbers are finite.
    pub fn is_finite(self) -> bool {
        self.x.is_finite() && self.y.is_finite() && self.heading.is_finite()
    }

    /// Cosine and sine of the heading, the same on every machine.
    pub fn rotation(self) -> (f64, f64) {
        // Most bodies of a grid never turn.
        if self.heading == 0.0 {
            (1.0, 0.0)
        } else {
            (libm::cos(self.heading), libm::sin(self.heading))
        }
    }

    /// A point of the body in the world.
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
