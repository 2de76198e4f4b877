//! Geometric tests between swept bodies.

use fleetyard_world::{Pose, Shape, swept_shapes_meet};

/// A uniform motion of an agent, or a rest if both poses are the same.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sweep {
    pub(super) agent: u32,
    pub(super) from: Pose,
    pub(super) to: Pose,
}

impl Sweep {
    pub(super) fn rest(agent: u32, pose: Pose) -> Self {
        let (from, to) = (pose, pose);
        Self { agent, from, to }
    }

    pub(super) fn is_rest(&self) -> bool {
        self.from == self.to
    }
}

/// An axis-parallel box: least x and y, largest x and y.
pub(super) type Bounds = [f64; 4];

pub(super) fn overlap(a: Bounds, b: Bounds) -> bool {
    a[0] <= b[2] && b[0] <= a[2] && a[1] <= b[3] && b[1] <= a[3]
}

/// The agents' footprints.
#[derive(Clone, Copy)]
pub(super) struct Bodies<'a> {
    shape: &'a (dyn Fn(usize) -> &'a Shape + Sync),
    touch_m: f64,
}

impl<'a> Bodies<'a> {
    /// Footprints that overlap by at most this share of the smallest radius only touch:
    /// discs as wide as their cells always do.
    const TOUCH: f64 = 1e-6;

    pub(super) fn new(agents: usize, shape: &'a (dyn Fn(usize) -> &'a Shape + Sync)) -> Self {
        let radii = (0..agents).map(|agent| shape(agent).effective_radius_m());
        let touch_m = Self::TOUCH * radii.fold(f64::INFINITY, f64::min);
        Self { shape, touch_m }
    }

    pub(super) fn shape(&self, agent: u32) -> &'a Shape {
        (self.shape)(agent as usize)
    }

    pub(super) fn radius_m(&self, agent: u32) -> f64 {
        self.shape(agent).effective_radius_m()
    }

    /// True if the areas that two motions sweep come nearer than the margin, whatever
    /// their times.
    pub(super) fn meet(&self, a: Sweep, b: Sweep, margin_m: f64) -> bool {
        let (one, two) = (self.shape(a.agent), self.shape(b.agent));
        let margin_m = margin_m - self.touch_m;
        swept_shapes_meet(one, (a.from, a.to), two, (b.from, b.to), margin_m)
    }

    /// Bounding box of a motion's swept area, half the margin wider.
    pub(super) fn bounds(&self, sweep: Sweep, margin_m: f64) -> Bounds {
        let reach = self.radius_m(sweep.agent) + 0.5 * margin_m;
        let (a, b) = (sweep.from, sweep.to);
        [
            a.x.min(b.x) - reach,
            a.y.min(b.y) - reach,
            a.x.max(b.x) + reach,
            a.y.max(b.y) + reach,
        ]
    }
}

/// A motion with its time, in seconds.
#[derive(Debug, Clone, Copy)]
pub(super) struct Timed {
    pub(super) sweep: Sweep,
    pub(super) start_s: f64,
    pub(super) end_s: f64,
}

impl Timed {
    /// Pose of the agent at a time within the motion.
    fn at(&self, time_s: f64) -> Pose {
        if self.sweep.is_rest() {
            return self.sweep.from;
        }
        let share = (time_s - self.start_s) / (self.end_s - self.start_s);
        self.sweep.from.toward(self.sweep.to, share)
    }

    /// Sweep of the agent between two times within the motion.
    pub(super) fn part(&self, start_s: f64, end_s: f64) -> Sweep {
        Sweep {
            agent: self.sweep.agent,
            from: self.at(start_s),
            to: self.at(end_s),
        }
    }

    /// The first of a few common times of both motions at which the agents are nearer
    /// than the margin.
    pub(super) fn collides(&self, other: &Self, bodies: &Bodies<'_>, margin_m: f64) -> Option<f64> {
        const SAMPLES: u32 = 32;
        let start = self.start_s.max(other.start_s);
        let end = self.end_s.min(other.end_s);
        let duration = if end.is_finite() { end - start } else { 0.0 };
        (0..=SAMPLES)
            .map(|sample| start + duration * f64::from(sample) / f64::from(SAMPLES))
            .find(|time| {
                let (one, two) = (self.part(*time, *time), other.part(*time, *time));
                bodies.meet(one, two, margin_m)
            })
    }
}

/// The middle between two agents at a common time of their motions.
pub(super) fn middle(a: &Timed, b: &Timed, time_s: f64) -> [f64; 2] {
    let (one, two) = (a.at(time_s), b.at(time_s));
    [one.x.midpoint(two.x), one.y.midpoint(two.y)]
}

/// The two agents, the one with the lower number first.
pub(super) fn pair(a: &Timed, b: &Timed) -> [u32; 2] {
    let (a, b) = (a.sweep.agent, b.sweep.agent);
    [a.min(b), a.max(b)]
}

/// Order of two motions that conflict.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Order {
    First,
    Second,
    /// Neither motion can wait for the other at its start or be passed at its end.
    Neither,
}

/// The order of two motions that meet.
///
/// If one has ended when the other begins, the plan says so. If they are simultaneous, a
/// motion may go first if it can be passed at its end and the other motion can wait at
/// its start; if both may, the plan's times decide.
pub(super) fn order(a: &Timed, b: &Timed, bodies: &Bodies<'_>, margin_m: f64) -> Order {
    if a.end_s <= b.start_s {
        return Order::First;
    }
    if b.end_s <= a.start_s {
        return Order::Second;
    }
    let may_precede = |a: &Timed, b: &Timed| {
        let passed = Sweep::rest(a.sweep.agent, a.sweep.to);
        let waiting = Sweep::rest(b.sweep.agent, b.sweep.from);
        !bodies.meet(passed, b.sweep, margin_m) && !bodies.meet(waiting, a.sweep, margin_m)
    };
    match (may_precede(a, b), may_precede(b, a)) {
        (true, false) => Order::First,
        (false, true) => Order::Second,
        (false, false) => Order::Neither,
        (true, true) => {
            let by_time = a.start_s.total_cmp(&b.start_s);
            let by_time = by_time.then(a.end_s.total_cmp(&b.end_s));
            if by_time.then(a.sweep.agent.cmp(&b.sweep.agent)).is_lt() {
                Order::First
            } else {
                Order::Second
            }
        }
    }
}
