//! State and target of a body.

/// Pose, velocity and the memory of the controller: 88 bytes.
///
/// Metres, seconds and radians in the world frame (x right, y up, headings
/// counter-clockwise from +x). The heading is unwrapped: between two ticks it changes by
/// what the body has turned.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Position.
    pub x: f64,
    /// Position.
    pub y: f64,
    /// Heading, unwrapped.
    pub heading: f64,
    /// Velocity in the world frame during the tick that ends here.
    pub vx: f64,
    /// Velocity in the world frame.
    pub vy: f64,
    /// Turn rate.
    pub omega: f64,
    /// Integrals of the controller: of distance and of heading.
    pub(super) sum_distance: f64,
    pub(super) sum_heading: f64,
    /// Cosine and sine of the heading `of`, kept from tick to tick.
    pub(super) cos: f64,
    pub(super) sin: f64,
    pub(super) of: f64,
}

impl State {
    /// A body at rest.
    pub fn at_rest(x: f64, y: f64, heading: f64) -> Self {
        let mut state = Self {
            x,
            y,
            heading,
            vx: 0.0,
            vy: 0.0,
            omega: 0.0,
            sum_distance: 0.0,
            sum_heading: 0.0,
            cos: 1.0,
            sin: 0.0,
            of: 0.0,
        };
        state.face();
        state
    }

    /// Copies the controller's memory from a state that was not reached.
    pub(crate) fn remember(&mut self, of: &Self) {
        self.sum_distance = of.sum_distance;
        self.sum_heading = of.sum_heading;
    }

    /// Speed over ground.
    pub fn speed_m_per_s(&self) -> f64 {
        (self.vx * self.vx + self.vy * self.vy).sqrt()
    }

    /// Updates cosine and sine of the heading.
    #[inline]
    pub(super) fn face(&mut self) {
        if self.of.to_bits() != self.heading.to_bits() {
            (self.sin, self.cos) = libm::sincos(self.heading);
            self.of = self.heading;
        }
    }

    /// A world vector in the body frame, ahead and to the left; needs [`State::face`].
    #[inline]
    pub(super) fn seen(&self, x: f64, y: f64) -> [f64; 2] {
        [x * self.cos + y * self.sin, y * self.cos - x * self.sin]
    }

    /// Clears the controller's memory at rest.
    #[inline]
    pub(super) fn forget(&mut self) {
        self.sum_distance = 0.0;
        self.sum_heading = 0.0;
    }

    /// The vector to the target, and its squared length.
    #[inline]
    pub(super) fn way(&self, target: &Target) -> (f64, f64, f64) {
        let (dx, dy) = (target.x - self.x, target.y - self.y);
        (dx, dy, dx * dx + dy * dy)
    }
}

/// Pose at which a body is to rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// Position in metres.
    pub x: f64,
    /// Position in metres.
    pub y: f64,
    /// Heading in radians; `None` leaves it to the model.
    pub heading: Option<f64>,
}
