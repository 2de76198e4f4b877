//! Straight motions of discs, and the start times at which two of them come too close, in closed form.
//!
//! Two discs whose centres are at `p + v·t` and `q + w·s` are closer than `d` where
//! `‖p − q + v·t − w·s‖² < d²`. In the plane of (t, s) that is the inside of an ellipse or, where `v` and `w` are parallel,
//! of a strip; the motions last so long as a rectangle says. The ellipse cut by the rectangle is convex, so that the
//! differences t − s of its points are one open interval, and the ends of that interval are on its border: on a side of
//! the rectangle, or where a line t − s = const touches the ellipse.
//!
//! Planners of continuous time need these intervals for their constraints: A. Andreychuk, K. Yakovlev, P. Surynek,
//! D. Atzmon, R. Stern, "Multi-agent pathfinding with continuous time", AIJ 305, 2022 (unsafe intervals, section 4);
//! K. Kasaura, M. Nishimura, R. Yonetani, "Prioritized safe interval path planning for multi-agent pathfinding with
//! continuous time on 2D roadmaps", RA-L 7(4), 2022 (collisions annotated beforehand).

use crate::Vector;

/// An open interval of time, in seconds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Span {
    /// Its beginning.
    pub low: f64,
    /// Its end.
    pub high: f64,
}

impl Span {
    /// No point of time: joined with another it is the other.
    const EMPTY: Self = Self {
        low: f64::INFINITY,
        high: f64::NEG_INFINITY,
    };

    /// The same interval later.
    #[must_use]
    pub fn after(self, seconds: f64) -> Self {
        Self {
            low: self.low + seconds,
            high: self.high + seconds,
        }
    }

    fn include(&mut self, time: f64) {
        self.low = self.low.min(time);
        self.high = self.high.max(time);
    }
}

/// A disc's centre on its way along a straight line at constant speed, or at rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// The centre when the motion begins, in metres.
    pub from: Vector,
    /// Metres per second; zero at rest.
    pub velocity: Vector,
    /// Seconds; may be infinite at rest.
    pub duration: f64,
}

/// The start times at which two motions come too close, for both directions of the second one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Overlap {
    /// Delays of the second start against the first, in seconds, that bring the motions too close.
    pub forward: Span,
    /// The same for the second motion driven back, from its end to its beginning.
    pub backward: Span,
}

impl Motion {
    /// The straight motion between two places in a given time, which is above zero.
    pub fn between(from: Vector, to: Vector, duration: f64) -> Self {
        Self {
            from,
            velocity: (to - from) / duration,
            duration,
        }
    }

    /// A disc at rest.
    pub fn rest(at: Vector, duration: f64) -> Self {
        Self {
            from: at,
            velocity: Vector::zeros(),
            duration,
        }
    }

    /// The centre so many seconds after the motion began.
    pub fn at(&self, seconds: f64) -> Vector {
        self.from + self.velocity * seconds
    }

    /// The time of this motion, counted from its beginning, at which its centre is closer than `distance` to a place; of
    /// the motion's own ends those that are so near belong to it.
    pub fn near(&self, place: Vector, distance: f64) -> Option<Span> {
        let offset = self.from - place;
        inside(
            self.velocity.norm_squared(),
            self.velocity.dot(&offset),
            offset.norm_squared() - distance * distance,
            self.duration,
        )
    }

    /// The start times of `other`, counted from the start of this motion, at which the centres of both come closer than
    /// `distance` to each other while both last. None where they never do.
    pub fn overlap(&self, other: &Self, distance: f64) -> Option<Overlap> {
        let (p, v, w) = (self.from - other.from, self.velocity, other.velocity);
        // Most pairs that are asked for are near, but not near enough: seen from the middle of the first, the second is
        // beyond all that both reach.
        let reach = (v * self.duration).norm() + (w * other.duration).norm();
        let middles = p * 2.0 + v * self.duration - w * other.duration;
        if middles.norm_squared() > (reach + 2.0 * distance).powi(2) {
            return None;
        }
        let (vv, ww, vw) = (v.norm_squared(), w.norm_squared(), v.dot(&w));
        let (pv, pw) = (p.dot(&v), p.dot(&w));
        let gap = p.norm_squared() - distance * distance;
        let (mut difference, mut sum) = (Span::EMPTY, Span::EMPTY);
        let mut include = |t: f64, s: f64| {
            difference.include(t - s);
            sum.include(t + s);
        };
        for s in [0.0, other.duration] {
            if let Some(span) = inside(
                vv,
                pv - vw * s,
                gap + s * (ww * s - 2.0 * pw),
                self.duration,
            ) {
                include(span.low, s);
                include(span.high, s);
            }
        }
        for t in [0.0, self.duration] {
            let constant = gap + t * (vv * t + 2.0 * pv);
            if let Some(span) = inside(ww, -pw - vw * t, constant, other.duration) {
                include(t, span.low);
                include(t, span.high);
            }
        }
        // Where lines t − s = const and t + s = const touch the ellipse. Parallel motions have none, and their extremes
        // are on the sides.
        let determinant = vv * ww - vw * vw;
        if determinant > 1e-12 * vv * ww {
            let (t0, s0) = (
                (vw * pw - ww * pv) / determinant,
                (vv * pw - vw * pv) / determinant,
            );
            let least = gap + pv * t0 - pw * s0;
            if least < 0.0 {
                for sign in [-1.0, 1.0] {
                    let (t, s) = (
                        (ww + sign * vw) / determinant,
                        (vw + sign * vv) / determinant,
                    );
                    let scale = (-least / (t + sign * s)).sqrt();
                    for (t, s) in [
                        (t0 + t * scale, s0 + s * scale),
                        (t0 - t * scale, s0 - s * scale),
                    ] {
                        if (0.0..=self.duration).contains(&t) && (0.0..=other.duration).contains(&s)
                        {
                            include(t, s);
                        }
                    }
                }
            }
        }
        (difference.low < difference.high).then(|| Overlap {
            forward: difference,
            backward: sum.after(-other.duration),
        })
    }
}

/// The part of [0, duration] in which a·t² + 2·b·t + c is below zero, for a ≥ 0.
fn inside(a: f64, b: f64, c: f64, duration: f64) -> Option<Span> {
    let whole = Span {
        low: 0.0,
        high: duration,
    };
    if a <= 0.0 {
        return (c < 0.0).then_some(whole);
    }
    let discriminant = b * b - a * c;
    if discriminant <= 0.0 {
        return None;
    }
    // Both roots without a difference of nearly equal numbers.
    let q = -(b + discriminant.sqrt().copysign(b));
    let (one, other) = (q / a, if q == 0.0 { 0.0 } else { c / q });
    let (low, high) = (one.min(other).max(0.0), one.max(other).min(duration));
    (low < high).then_some(Span { low, high })
}
