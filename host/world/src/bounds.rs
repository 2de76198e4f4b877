//! Boxes along the axes.

/// A box along the axes, in metres.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bounds {
    /// Lower left corner.
    pub min: [f64; 2],
    /// Upper right corner.
    pub max: [f64; 2],
}

impl Bounds {
    /// The smallest box around points, of which there is at least one.
    pub fn of(points: &[[f64; 2]]) -> Self {
        let at = |point: [f64; 2]| Self {
            min: point,
            max: point,
        };
        let others = points.iter().map(|point| at(*point));
        others.fold(at(points[0]), Self::with)
    }

    /// The smallest box around two.
    #[must_use]
    pub fn with(self, other: Self) -> Self {
        let of = |pick: fn(f64, f64) -> f64, a: [f64; 2], b: [f64; 2]| {
            [pick(a[0], b[0]), pick(a[1], b[1])]
        };
        Self {
            min: of(f64::min, self.min, other.min),
            max: of(f64::max, self.max, other.max),
        }
    }

    /// True if two boxes overlap or touch.
    pub fn meets(self, other: Self) -> bool {
        let along =
            |axis: usize| self.min[axis] <= other.max[axis] && other.min[axis] <= self.max[axis];
        along(0) && along(1)
    }

    /// True if a point is inside or on the border.
    pub fn contains(self, [x, y]: [f64; 2]) -> bool {
        self.min[0] <= x && x <= self.max[0] && self.min[1] <= y && y <= self.max[1]
    }
}
