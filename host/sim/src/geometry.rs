//! Closed forms for uniformly moving discs.
//!
//! Everything here is about one span of time, run through by a fraction s from
//! 0 to 1. "Inside" is strict: a disc that touches is not inside. Whether the
//! ends of the span are inside is decided by the same expression on the same
//! numbers as at the end of the span before, so that a contact that lasts over
//! several spans neither flickers nor is lost to rounding.

/// When, within a span, something is inside something convex.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Inside {
    /// Fraction at which it comes in; 0 if it was inside at the start.
    pub(crate) enter: f64,
    /// Fraction at which it goes out; 1 if it is inside at the end.
    pub(crate) leave: f64,
    /// Inside at the start of the span.
    pub(crate) at_start: bool,
    /// Inside at the end of the span.
    pub(crate) at_end: bool,
}

/// The motion of one point relative to another: from `(x0, y0)` to `(x1, y1)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Relative {
    pub(crate) x0: f64,
    pub(crate) y0: f64,
    pub(crate) x1: f64,
    pub(crate) y1: f64,
}

impl Relative {
    fn start_squared(self) -> f64 {
        self.x0 * self.x0 + self.y0 * self.y0
    }

    fn end_squared(self) -> f64 {
        self.x1 * self.x1 + self.y1 * self.y1
    }

    /// The least squared distance to the origin and the first fraction at which
    /// it is reached.
    pub(crate) fn closest(self) -> (f64, f64) {
        let (wx, wy) = (self.x1 - self.x0, self.y1 - self.y0);
        let along = self.x0 * wx + self.y0 * wy;
        if along >= 0.0 {
            return (self.start_squared(), 0.0);
        }
        let length = wx * wx + wy * wy;
        if -along >= length {
            return (self.end_squared(), 1.0);
        }
        let s = -along / length;
        let (x, y) = (self.x0 + s * wx, self.y0 + s * wy);
        // Rounding must not make the least larger than an end, which decides
        // over contacts.
        let inner = x * x + y * y;
        (inner.min(self.start_squared()).min(self.end_squared()), s)
    }

    /// When the point is nearer to the origin than `radius`, given the least
    /// squared distance from [`Relative::closest`].
    pub(crate) fn inside_disc(self, radius: f64, least_squared: f64) -> Option<Inside> {
        let limit = radius * radius;
        let (at_start, at_end) = (self.start_squared() < limit, self.end_squared() < limit);
        if !at_start && !at_end && least_squared >= limit {
            return None;
        }
        let (wx, wy) = (self.x1 - self.x0, self.y1 - self.y0);
        let crossing = disc_crossing(self.x0, self.y0, wx, wy, limit).unwrap_or((0.0, 1.0));
        Some(Inside::clamped(crossing, at_start, at_end))
    }

    /// When the point is nearer than `radius` to the square of half side `half`
    /// around the origin.
    pub(crate) fn inside_square(self, half: f64, radius: f64) -> Option<Inside> {
        let limit = radius * radius;
        let near = |x: f64, y: f64| {
            let (dx, dy) = ((x.abs() - half).max(0.0), (y.abs() - half).max(0.0));
            dx * dx + dy * dy < limit
        };
        let (at_start, at_end) = (near(self.x0, self.y0), near(self.x1, self.y1));
        // A rounded square is the union of two rectangles and four discs.
        // It is convex, so the hull of the six intervals is the interval.
        let (wx, wy) = (self.x1 - self.x0, self.y1 - self.y0);
        let mut hull: Option<(f64, f64)> = None;
        let mut join = |part: Option<(f64, f64)>| {
            let part = part.filter(|(enter, leave)| *leave > 0.0 && *enter < 1.0);
            hull = match (hull, part) {
                (Some(a), Some(b)) => Some((a.0.min(b.0), a.1.max(b.1))),
                (a, b) => a.or(b),
            };
        };
        let (thin, wide) = (half, half + radius);
        join(box_crossing(self.x0, self.y0, wx, wy, wide, thin));
        join(box_crossing(self.x0, self.y0, wx, wy, thin, wide));
        for (cx, cy) in [(-half, -half), (-half, half), (half, -half), (half, half)] {
            join(disc_crossing(self.x0 - cx, self.y0 - cy, wx, wy, limit));
        }
        match hull {
            Some(crossing) => Some(Inside::clamped(crossing, at_start, at_end)),
            // Rounding may lose an interval that an end lies in.
            None if at_start || at_end => Some(Inside::clamped((0.0, 1.0), at_start, at_end)),
            None => None,
        }
    }
}

impl Inside {
    /// Confines a crossing to the span and lets the ends decide over rounding.
    fn clamped((enter, leave): (f64, f64), at_start: bool, at_end: bool) -> Self {
        let enter = if at_start { 0.0 } else { enter.clamp(0.0, 1.0) };
        let leave = if at_end { 1.0 } else { leave.clamp(0.0, 1.0) };
        Self {
            enter,
            leave: leave.max(enter),
            at_start,
            at_end,
        }
    }
}

/// The open interval of s with |p + s·w|² < `limit`, if there is one.
fn disc_crossing(x: f64, y: f64, wx: f64, wy: f64, limit: f64) -> Option<(f64, f64)> {
    let a = wx * wx + wy * wy;
    let b = x * wx + y * wy;
    let c = x * x + y * y - limit;
    let discriminant = b * b - a * c;
    // Written so that a point at rest, and NaN, have no crossing.
    if !(a > 0.0 && discriminant > 0.0) {
        return None;
    }
    let root = discriminant.sqrt();
    // The sum of equal signs loses no digits; the other root is c over it.
    let sum = if b >= 0.0 { -(b + root) } else { root - b };
    let (one, two) = (sum / a, c / sum);
    Some((one.min(two), one.max(two)))
}

/// The open interval of s with p + s·w inside a box around the origin.
fn box_crossing(x: f64, y: f64, wx: f64, wy: f64, half_x: f64, half_y: f64) -> Option<(f64, f64)> {
    let mut interval = (f64::NEG_INFINITY, f64::INFINITY);
    for (p, w, half) in [(x, wx, half_x), (y, wy, half_y)] {
        if w == 0.0 {
            if p.abs() >= half {
                return None;
            }
            continue;
        }
        let (one, two) = ((-half - p) / w, (half - p) / w);
        interval.0 = interval.0.max(one.min(two));
        interval.1 = interval.1.min(one.max(two));
    }
    (interval.0 < interval.1).then_some(interval)
}
