//! Discs and convex polygons that move straight through places and headings, and when they touch.
//!
//! Two discs are compared in closed form ([`crate::motion`]). For a polygon a part of a motion is enclosed in the convex hull of
//! its poses at both ends. Where it turns by φ meanwhile, a point at distance r from the origin is beside its chord by at most
//! r·φ²/8: the hull is made larger by so much, and the part is cut in two where that is too much (conservative advancement with
//! a bound that shrinks with the square). What is said to be apart is apart; what is said to touch is nearer than [`SLACK`].

use std::f64::consts::{PI, TAU};

use crate::Vector;
use crate::bins::{Bins, Rectangle};
use crate::motion::{Motion, Span};
use crate::obstacles::{Disc, Obstacles, cross, right};

/// Bodies may be so much nearer than touching, in metres: rounding is no contact.
const TOUCH: f64 = 1e-9;

/// A hull that is wider than a body's sweep by less than this is not cut any more, in metres.
pub const SLACK: f64 = 1e-7;

/// Parts of a motion that are looked at before it counts as touching.
const MOST_PARTS: u32 = 4096;

/// Intervals of time of two motions are not cut any more where both bodies move by less than this share of their radii.
const GRAIN: f64 = 1.0 / 16.0;

/// A place and a heading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pose {
    /// In metres.
    pub at: Vector,
    /// Radians counter-clockwise from +x.
    pub heading: f64,
}

/// The body of a robot about its origin.
#[derive(Debug, Clone, PartialEq)]
pub struct Body {
    /// Of the disc, or of the circle about the origin that encloses the polygon, in metres.
    pub radius: f64,
    /// Counter-clockwise corners of a convex polygon, in metres; none of a disc.
    pub corners: Vec<Vector>,
}

/// A straight motion at constant rates, or a rest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Leg {
    /// The pose at the beginning.
    pub from: Pose,
    /// The pose in the end; its heading is not wrapped, and says which way round the body turns.
    pub to: Pose,
    /// Seconds, above zero; may be infinite at rest.
    pub duration: f64,
}

/// The same angle, above −π and at most π.
pub fn wrapped(angle: f64) -> f64 {
    let angle = angle - TAU * libm::floor((angle + PI) / TAU);
    if angle > PI || angle <= -PI {
        PI
    } else {
        angle
    }
}

impl Pose {
    /// The pose at a part of the straight way to another one, along the shorter turn.
    #[must_use]
    pub fn toward(&self, other: &Self, part: f64) -> Self {
        Self {
            at: self.at + (other.at - self.at) * part,
            heading: self.heading + wrapped(other.heading - self.heading) * part,
        }
    }
}

impl Body {
    /// The body is a disc: its heading is of no account.
    pub fn is_disc(&self) -> bool {
        self.corners.is_empty()
    }

    /// The same body and all that is within a distance of it, in metres; of a polygon a little more at its corners.
    #[must_use]
    pub fn grown(&self, distance: f64) -> Self {
        let count = self.corners.len();
        let normal = |at: usize| {
            right(self.corners[(at + 1) % count] - self.corners[at % count]).normalize()
        };
        let corner = |at: usize| {
            let (before, after) = (normal(at + count - 1), normal(at));
            self.corners[at] + (before + after) * (distance / (1.0 + before.dot(&after)))
        };
        let corners: Vec<Vector> = (0..count).map(corner).collect();
        let farthest = corners.iter().map(Vector::norm).fold(0.0, f64::max);
        Self {
            radius: (self.radius + distance).max(farthest),
            corners,
        }
    }

    fn placed(&self, pose: &Pose) -> Hull {
        if self.is_disc() {
            return Hull {
                corners: vec![pose.at],
                rounding: self.radius,
            };
        }
        let (sin, cos) = (libm::sin(pose.heading), libm::cos(pose.heading));
        let placed = self.corners.iter().map(|corner| {
            let turned = Vector::new(
                corner.x * cos - corner.y * sin,
                corner.x * sin + corner.y * cos,
            );
            pose.at + turned
        });
        Hull {
            corners: placed.collect(),
            rounding: 0.0,
        }
    }

    /// A convex region in which the body is all the time from one pose to another.
    fn swept(&self, from: &Pose, to: &Pose) -> Hull {
        let mut hull = self.placed(from);
        if from == to {
            return hull;
        }
        hull.corners.extend(self.placed(to).corners);
        let turn = to.heading - from.heading;
        Hull {
            corners: convex(hull.corners),
            rounding: hull.rounding + self.beside(turn),
        }
    }

    /// Farthest that a point of the body is beside its chord in a turn.
    fn beside(&self, turn: f64) -> f64 {
        if self.is_disc() {
            0.0
        } else {
            self.radius * turn * turn / 8.0
        }
    }
}

impl Leg {
    /// The motion of the origin.
    pub fn motion(&self) -> Motion {
        if self.from.at == self.to.at {
            Motion::rest(self.from.at, self.duration)
        } else {
            Motion::between(self.from.at, self.to.at, self.duration)
        }
    }

    /// A body at rest in a pose.
    pub fn rest(pose: Pose, duration: f64) -> Self {
        Self {
            from: pose,
            to: pose,
            duration,
        }
    }

    /// The pose so many seconds after the beginning.
    fn at(&self, seconds: f64) -> Pose {
        if self.from == self.to {
            return self.from;
        }
        let part = seconds / self.duration;
        Pose {
            at: self.from.at + (self.to.at - self.from.at) * part,
            heading: self.from.heading + (self.to.heading - self.from.heading) * part,
        }
    }

    fn turn(&self) -> f64 {
        self.to.heading - self.from.heading
    }
}

/// A convex polygon, a segment or a point, and all that is within a distance of it.
#[derive(Debug, Clone)]
struct Hull {
    /// Counter-clockwise.
    corners: Vec<Vector>,
    rounding: f64,
}

impl Hull {
    /// No point of one is inside of the other.
    fn apart(&self, other: &Self) -> bool {
        let least = self.rounding + other.rounding - TOUCH;
        let separation = separation(&self.corners, &other.corners);
        separation >= least
            || (separation > 0.0
                && distance(&self.corners, &other.corners)
                    .min(distance(&other.corners, &self.corners))
                    >= least)
    }

    /// The distance of both, or less; below zero where they have a point in common.
    fn gap(&self, other: &Self) -> f64 {
        let separation = separation(&self.corners, &other.corners);
        let between = if separation > 0.0 {
            distance(&self.corners, &other.corners).min(distance(&other.corners, &self.corners))
        } else {
            separation
        };
        between - self.rounding - other.rounding
    }

    fn around(&self) -> Rectangle {
        let first = self.corners[0];
        let both = self.corners.iter().fold((first, first), |(low, high), at| {
            (low.inf(at), high.sup(at))
        });
        Rectangle::around(both.0, both.1, self.rounding)
    }
}

/// The convex hull, counter-clockwise (A. M. Andrew, Information Processing Letters 9(5), 1979).
fn convex(mut points: Vec<Vector>) -> Vec<Vector> {
    points.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        return points;
    }
    let mut hull: Vec<Vector> = Vec::with_capacity(points.len() + 1);
    let mut add = |points: &mut dyn Iterator<Item = &Vector>| {
        let begin = hull.len();
        for point in points {
            while let [.., a, b] = hull[begin..]
                && cross(b - a, point - b) <= 0.0
            {
                hull.pop();
            }
            hull.push(*point);
        }
        // The last one begins the other half.
        hull.pop();
    };
    add(&mut points.iter());
    add(&mut points.iter().rev());
    hull
}

/// The greatest distance of two parallel lines between two convex regions, below zero where there are none: at most their
/// distance, and above zero just where they have no point in common.
fn separation(a: &[Vector], b: &[Vector]) -> f64 {
    if let ([a], [b]) = (a, b) {
        return (a - b).norm();
    }
    beyond(a, b).max(beyond(b, a))
}

/// The greatest distance of the line of one of the edges of `a` from what is in front of it.
fn beyond(a: &[Vector], b: &[Vector]) -> f64 {
    let along = |normal: Vector, from: f64| {
        let nearest = b.iter().map(|corner| normal.dot(corner));
        nearest.fold(f64::INFINITY, f64::min) - from
    };
    let mut greatest = f64::NEG_INFINITY;
    if a.len() < 2 {
        return greatest;
    }
    for at in 0..a.len() {
        let (from, to) = (a[at], a[(at + 1) % a.len()]);
        let direction = (to - from).normalize();
        let normal = right(direction);
        greatest = greatest.max(along(normal, normal.dot(&from)));
        if a.len() == 2 {
            greatest = greatest.max(along(direction, direction.dot(&to)));
        }
    }
    greatest
}

/// The least distance of a corner of `a` from an edge of `b`.
fn distance(a: &[Vector], b: &[Vector]) -> f64 {
    let edge = |at: usize| (b[at], b[(at + 1) % b.len()]);
    let edges = (0..b.len()).map(edge);
    let pairs = edges.flat_map(|(from, to)| a.iter().map(move |corner| (from, to, corner)));
    let squares =
        pairs.map(|(from, to, corner)| crate::obstacles::squared_distance_to(from, to, *corner));
    squares.fold(f64::INFINITY, f64::min).sqrt()
}

/// `touches` of a sweep is true for some part of a motion, however finely it is cut.
fn meets(body: &Body, leg: &Leg, touches: &dyn Fn(&Hull) -> bool) -> bool {
    let mut parts = vec![(0.0, 1.0)];
    let part_of = |part: f64| Pose {
        at: leg.from.at + (leg.to.at - leg.from.at) * part,
        heading: leg.from.heading + leg.turn() * part,
    };
    for _ in 0..MOST_PARTS {
        let Some((begin, end)) = parts.pop() else {
            return false;
        };
        let (from, to) = (part_of(begin), part_of(end));
        if !touches(&body.swept(&from, &to)) {
            continue;
        }
        let middle = f64::midpoint(begin, end);
        if body.beside(to.heading - from.heading) < SLACK || touches(&body.placed(&part_of(middle)))
        {
            return true;
        }
        parts.extend([(middle, end), (begin, middle)]);
    }
    true
}

/// A body on its way touches one that rests.
pub fn hits(body: &Body, leg: &Leg, other: &Body, pose: &Pose) -> bool {
    let distance = body.radius + other.radius - TOUCH;
    let near = leg.motion().near(pose.at, distance).is_some();
    if !near || (body.is_disc() && other.is_disc()) {
        return near;
    }
    let other = other.placed(pose);
    meets(body, leg, &|swept| !swept.apart(&other))
}

/// Two polygons that move may overlap by so much for a moment, in metres.
const GRAZE: f64 = 1e-5;

/// The first time at which two bodies touch that move at the same time, counted from the beginning of both motions, which last
/// equally long. Neither can come nearer than their speeds allow (conservative advancement); polygons that overlap by less than
/// a hundredth of a millimetre may go unseen.
pub fn together(body: &Body, leg: &Leg, other: &Body, other_leg: &Leg) -> Option<f64> {
    let (motion, other_motion) = (leg.motion(), other_leg.motion());
    let relative = Motion {
        from: motion.from - other_motion.from,
        velocity: motion.velocity - other_motion.velocity,
        duration: leg.duration,
    };
    let reach = body.radius + other.radius - TOUCH;
    let near = relative.near(Vector::zeros(), reach)?;
    if body.is_disc() && other.is_disc() {
        return Some(near.low);
    }
    let spin = |body: &Body, leg: &Leg| {
        if body.is_disc() || leg.turn() == 0.0 {
            0.0
        } else {
            body.radius * leg.turn().abs() / leg.duration
        }
    };
    let speed = relative.velocity.norm() + spin(body, leg) + spin(other, other_leg);
    let mut time = near.low;
    loop {
        let gap = body
            .placed(&leg.at(time))
            .gap(&other.placed(&other_leg.at(time)));
        if gap < -TOUCH {
            return Some(time);
        }
        time += gap.max(GRAZE) / speed;
        if time >= near.high {
            return None;
        }
    }
}

/// The time of a motion, counted from its beginning, at which its body touches one that rests; for polygons it may be a little
/// more.
pub fn near(body: &Body, leg: &Leg, other: &Body, pose: &Pose) -> Option<Span> {
    let motion = leg.motion();
    let whole = motion.near(pose.at, body.radius + other.radius - TOUCH)?;
    if body.is_disc() && other.is_disc() {
        return Some(whole);
    }
    let placed = other.placed(pose);
    let grain = grain(body, leg);
    let mut found: Option<Span> = None;
    let mut parts = vec![whole];
    while let Some(part) = parts.pop() {
        if found.is_some_and(|found| found.low <= part.low && part.high <= found.high)
            || body
                .swept(&leg.at(part.low), &leg.at(part.high))
                .apart(&placed)
        {
            continue;
        }
        if part.high - part.low <= grain || !part.high.is_finite() {
            let found = found.get_or_insert(part);
            found.low = found.low.min(part.low);
            found.high = found.high.max(part.high);
            continue;
        }
        parts.extend(halves(part));
    }
    found
}

/// The start times of one motion, counted from the start of another, at which both bodies touch while both last; for polygons
/// there may be a few more. None where they never do.
pub fn delays(body: &Body, leg: &Leg, other: &Body, other_leg: &Leg) -> Option<Span> {
    let distance = body.radius + other.radius - TOUCH;
    let whole = leg.motion().overlap(&other_leg.motion(), distance)?.forward;
    if body.is_disc() && other.is_disc() {
        return Some(whole);
    }
    // A rest is one part, however long.
    let both = [Timed::new(body, leg), Timed::new(other, other_leg)];
    let high = farthest(&both, whole.high, |own, other| own.high - other.low)?;
    let low = -farthest(&both, -whole.low, |own, other| other.high - own.low)?;
    Some(Span { low, high })
}

struct Timed<'a> {
    body: &'a Body,
    leg: &'a Leg,
    grain: f64,
}

impl<'a> Timed<'a> {
    fn new(body: &'a Body, leg: &'a Leg) -> Self {
        Self {
            body,
            leg,
            grain: grain(body, leg),
        }
    }

    fn swept(&self, part: Span) -> Hull {
        if self.grain.is_finite() {
            let (from, to) = (self.leg.at(part.low), self.leg.at(part.high));
            self.body.swept(&from, &to)
        } else {
            self.body.placed(&self.leg.from)
        }
    }
}

/// Seconds in which a body moves by a grain; infinite at rest.
fn grain(body: &Body, leg: &Leg) -> f64 {
    let way = (leg.to.at - leg.from.at).norm() + body.radius * leg.turn().abs();
    if way > 0.0 {
        leg.duration * body.radius * GRAIN / way
    } else {
        f64::INFINITY
    }
}

fn halves(part: Span) -> [Span; 2] {
    let middle = f64::midpoint(part.low, part.high);
    [
        Span {
            high: middle,
            ..part
        },
        Span {
            low: middle,
            ..part
        },
    ]
}

/// The greatest value of a pair of small parts that touch, where `value` of a pair is at least that of all parts of it, but at
/// most `bound`.
fn farthest(
    [own, other]: &[Timed<'_>; 2],
    bound: f64,
    value: impl Fn(Span, Span) -> f64,
) -> Option<f64> {
    let whole = |timed: &Timed<'_>| Span {
        low: 0.0,
        high: timed.leg.duration,
    };
    let mut greatest: Option<f64> = None;
    let mut pairs = vec![(whole(own), whole(other))];
    for _ in 0..MOST_PARTS {
        let Some((a, b)) = pairs.pop() else {
            return greatest.map(|greatest| greatest.min(bound));
        };
        if greatest.is_some_and(|greatest| value(a, b) <= greatest)
            || own.swept(a).apart(&other.swept(b))
        {
            continue;
        }
        let (long, other_long) = ((a.high - a.low) / own.grain, (b.high - b.low) / other.grain);
        let (long, other_long) = (finite(long), finite(other_long));
        if long <= 1.0 && other_long <= 1.0 {
            greatest = Some(value(a, b));
            continue;
        }
        let mut cut = if long >= other_long {
            halves(a).map(|half| (half, b))
        } else {
            halves(b).map(|half| (a, half))
        };
        // The one with the greater value is looked at first.
        cut.sort_by(|one, other| value(one.0, one.1).total_cmp(&value(other.0, other.1)));
        pairs.extend(cut);
    }
    Some(bound)
}

/// Rests have infinitely long grains, and may last for ever.
fn finite(grains: f64) -> f64 {
    if grains.is_nan() { 0.0 } else { grains }
}

/// A body among obstacles that stand.
#[derive(Debug)]
pub struct Space {
    /// The body.
    pub body: Body,
    walls: Walls,
}

#[derive(Debug)]
enum Walls {
    Disc(Obstacles),
    Polygon {
        /// For a point.
        inside: Obstacles,
        edges: Vec<[Vector; 2]>,
        bins: Bins,
        bounds: Rectangle,
        discs: Vec<Disc>,
    },
}

impl Space {
    /// Among simple polygons in any orientation and discs, inside of `bounds`.
    pub fn new(body: Body, polygons: &[Vec<Vector>], bounds: Rectangle, discs: &[Disc]) -> Self {
        let obstacles =
            |radius| Obstacles::new(polygons.to_vec(), bounds, radius).with_discs(discs.to_vec());
        let walls = if body.is_disc() {
            Walls::Disc(obstacles(body.radius))
        } else {
            let edges = polygons.iter().flat_map(|corners| {
                (0..corners.len()).map(|at| [corners[at], corners[(at + 1) % corners.len()]])
            });
            let edges: Vec<[Vector; 2]> = edges.filter(|[a, b]| a != b).collect();
            let boxes = edges.iter().map(|[a, b]| Rectangle::around(*a, *b, 0.0));
            Walls::Polygon {
                inside: obstacles(0.0),
                bins: Bins::new(boxes.collect()),
                edges,
                bounds,
                discs: discs.to_vec(),
            }
        };
        Self { body, walls }
    }

    /// The obstacles as a disc sees them.
    pub fn of_disc(&self) -> Option<&Obstacles> {
        match &self.walls {
            Walls::Disc(obstacles) => Some(obstacles),
            Walls::Polygon { .. } => None,
        }
    }

    /// A body in this pose touches nothing.
    pub fn is_free(&self, pose: &Pose) -> bool {
        match &self.walls {
            Walls::Disc(obstacles) => obstacles.free(pose.at),
            Walls::Polygon { inside, .. } => {
                inside.free(pose.at) && self.is_clear(&Leg::rest(*pose, 1.0))
            }
        }
    }

    /// A body on its way touches nothing. Where it begins has to be free.
    pub fn is_clear(&self, leg: &Leg) -> bool {
        let (edges, bins, bounds, discs) = match &self.walls {
            Walls::Disc(obstacles) => return obstacles.clear(leg.from.at, leg.to.at),
            Walls::Polygon {
                edges,
                bins,
                bounds,
                discs,
                ..
            } => (edges, bins, bounds, discs),
        };
        !meets(&self.body, leg, &|swept| {
            let around = swept.around();
            let (low, high) = (around.min - bounds.min, bounds.max - around.max);
            if low.min().min(high.min()) < -TOUCH {
                return true;
            }
            let past = |disc: &Disc| {
                swept.apart(&Hull {
                    corners: vec![disc.at],
                    rounding: disc.radius,
                })
            };
            if !discs.iter().all(past) {
                return true;
            }
            let mut touched = false;
            bins.meeting(&around, |edge| {
                touched = touched
                    || !swept.apart(&Hull {
                        corners: edges[edge as usize].to_vec(),
                        rounding: 0.0,
                    });
            });
            touched
        })
    }
}
