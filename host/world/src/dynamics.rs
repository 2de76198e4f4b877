//! Limits of the motion of bodies, and the places where a motion from knot to knot exceeds them.
//!
//! A motion that is linear between knots changes its velocity at once at every knot.
//! Read so, nothing that has a mass could follow any. It is therefore taken for the samples
//! of a smooth one: the velocity of a leg is that of its middle, and what changes from one
//! leg to the next changes in half the time of both, where a leg counts for at most
//! [`LONGEST_SAMPLE_S`]. So every motion within the limits passes if its knots are no
//! farther apart than that, and no leg may hide a change that takes longer. Before its
//! first knot and after its last a body rests.
//!
//! A heading is known as well as its leg says: what holds in the frame of the body has to
//! hold at some heading of every sample. That is how samples of an integration by steps of
//! Euler pass, whose legs lead where the body headed at their begin.

use core::f64::consts::{FRAC_PI_2, PI, TAU};

use fleetyard_core::{Knot, Knots};
use nalgebra::UnitComplex;

use crate::Vector;

/// Rounding that is forgiven: so many metres or radians in every knot, and this part of every
/// limit.
pub const DYNAMICS_TOLERANCE: f64 = 1e-6;

/// A leg that takes longer hides no change of velocity, in seconds.
pub const LONGEST_SAMPLE_S: f64 = 0.1;

/// A leg that takes less counts for this, so that rates stay finite.
const SHORTEST_S: f64 = 1e-12;

/// Into how many parts a turn of 2π is cut at most, however slow.
const PARTS_OF_A_TURN: f64 = 256.0;

/// The limits of a body's motion; infinite ones do not limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Dynamics {
    /// The limits of its motion over the floor.
    pub travel: Travel,
    /// The largest turn rate, in rad/s.
    pub turn_rad_per_s: f64,
    /// The largest change of the turn rate, in rad/s².
    pub turn_acceleration_rad_per_s2: f64,
    /// The largest turn on a metre of way, in radians: who steers does not turn in place.
    pub curvature_rad_per_m: f64,
}

/// Limits of speed in m/s and of acceleration in m/s², by the way in which they hold.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Travel {
    /// In every direction, by size.
    Polar {
        /// Of the velocity.
        speed: f64,
        /// Of its change.
        acceleration: f64,
    },
    /// Along x and along y of the world.
    Axes {
        /// Along each.
        speed: f64,
        /// Along each.
        acceleration: f64,
    },
    /// In the frame of the body, which moves in any direction whatever its heading.
    Body {
        /// Ahead.
        forward: f64,
        /// Back.
        backward: f64,
        /// To either side.
        sideways: f64,
        /// Of the speed ahead.
        forward_acceleration: f64,
        /// Of the speed to the side.
        sideways_acceleration: f64,
    },
    /// Only where the body heads.
    Wheels {
        /// Ahead.
        forward: f64,
        /// Back; 0 for who does not reverse.
        backward: f64,
        /// From a smaller speed to a larger one.
        acceleration: f64,
        /// From a larger speed to a smaller one.
        deceleration: f64,
    },
}

/// Kind of a limit. The order is that of [`Dynamics::excesses`].
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Demand {
    /// Speed, in m/s.
    Speed,
    /// A direction that wheels do not have, in radians from the nearest that they have.
    Course,
    /// Turn rate, in rad/s.
    TurnRate,
    /// Turn rate of who steers, in rad/s; the limit is that at the speed of the moment.
    Steering,
    /// Acceleration, in m/s².
    Acceleration,
    /// Turn acceleration, in rad/s².
    TurnAcceleration,
}

/// A place where a motion exceeds a limit of the body.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Excess {
    /// Kind of the limit.
    pub demand: Demand,
    /// Direction of the motion, as in "moves along x"; empty where that is no part of the limit.
    pub along: &'static str,
    /// The knot at the end of the leg, or at which the velocity changes.
    pub knot: usize,
    /// Time at which the leg begins, or the velocity changes, in seconds.
    pub time_s: f64,
    /// Position of the body then, in metres.
    pub place_m: [f64; 2],
    /// Value that the motion asks for.
    pub value: f64,
    /// The limit.
    pub limit: f64,
}

impl Dynamics {
    /// Those of a body that can do anything.
    pub const UNLIMITED: Self = Self {
        travel: Travel::Polar {
            speed: f64::INFINITY,
            acceleration: f64::INFINITY,
        },
        turn_rad_per_s: f64::INFINITY,
        turn_acceleration_rad_per_s2: f64::INFINITY,
        curvature_rad_per_m: f64::INFINITY,
    };

    /// The places where one agent's motion exceeds its limits: of every [`Demand`] the worst place,
    /// and the first among equal ones.
    ///
    /// Without headings wheels head where they move, and a body whose limits turn with it
    /// heads as suits it best.
    pub fn excesses(&self, knots: Knots<'_>) -> Vec<Excess> {
        let mut judge = Judge {
            dynamics: *self,
            worst: Vec::new(),
        };
        let has_headings = knots.heading_rad.is_some();
        match (self.travel, has_headings) {
            (Travel::Wheels { .. }, false) => judge.wheels_without_headings(knots),
            (
                Travel::Body {
                    forward,
                    backward,
                    sideways,
                    forward_acceleration,
                    sideways_acceleration,
                },
                false,
            ) => {
                let speed = Vector::new(forward.max(backward), sideways).norm();
                // A body that turns while it moves changes its velocity by that too.
                let turning = speed * self.turn_rad_per_s;
                let acceleration =
                    Vector::new(forward_acceleration, sideways_acceleration).norm() + turning;
                judge.dynamics.travel = Travel::Polar {
                    speed,
                    acceleration,
                };
                judge.motion(knots);
            }
            _ => judge.motion(knots),
        }
        judge.worst.sort_by_key(|excess| excess.demand);
        judge.worst
    }
}

/// A leg or a part of one: uniform motion over the floor and a uniform turn.
#[derive(Debug, Clone, Copy)]
struct Part {
    /// The knot at the end of the leg.
    knot: usize,
    begin_s: f64,
    span_s: f64,
    place: Vector,
    velocity: Vector,
    /// The headings at its begin and end.
    headings: [f64; 2],
    /// Possible error of the velocity and the turn rate, if both knots of the leg are off by the
    /// tolerance.
    off: f64,
}

impl Part {
    fn leg(knots: Knots<'_>, knot: usize) -> Self {
        let (from, to) = (knots.get(knot - 1), knots.get(knot));
        let span_s = (to.time_s - from.time_s).max(SHORTEST_S);
        let place = place(from);
        Self {
            knot,
            begin_s: from.time_s,
            span_s,
            place,
            velocity: (self::place(to) - place) / span_s,
            headings: [from, to].map(|knot| knot.heading_rad.unwrap_or(0.0)),
            off: 2.0 * DYNAMICS_TOLERANCE / span_s,
        }
    }

    /// Rest before the first knot, or after the last one.
    fn rest(knots: Knots<'_>, knot: usize) -> Self {
        let at = knots.get(knot);
        Self {
            knot,
            begin_s: at.time_s,
            span_s: LONGEST_SAMPLE_S,
            place: place(at),
            velocity: Vector::zeros(),
            headings: [at.heading_rad.unwrap_or(0.0); 2],
            off: 0.0,
        }
    }

    /// The part of it between two fractions.
    fn between(&self, from: f64, to: f64) -> Self {
        let [begin, end] = self.headings;
        let heading = |share: f64| begin + (end - begin) * share;
        let after_s = self.span_s * from;
        Self {
            begin_s: self.begin_s + after_s,
            span_s: self.span_s * (to - from),
            place: self.place + self.velocity * after_s,
            headings: [heading(from), heading(to)],
            ..*self
        }
    }

    /// Its first and its last tenth of a second.
    fn ends(&self) -> [Self; 2] {
        let share = (LONGEST_SAMPLE_S / self.span_s).min(1.0);
        [self.between(0.0, share), self.between(1.0 - share, 1.0)]
    }

    fn speed(&self) -> f64 {
        self.velocity.norm()
    }

    fn turn(&self) -> f64 {
        self.headings[1] - self.headings[0]
    }

    /// Seconds that it counts for.
    fn counts_s(&self) -> f64 {
        self.span_s.min(LONGEST_SAMPLE_S)
    }

    /// The velocity in the frame of the body, at a fraction of the turn.
    fn twist(&self, share: f64) -> [f64; 2] {
        let (sin, cos) = libm::sincos(self.headings[0] + self.turn() * share);
        let frame = UnitComplex::from_cos_sin_unchecked(cos, sin);
        frame.inverse_transform_vector(&self.velocity).into()
    }
}

/// Fractions of a part whose headings count for all of it.
const SHARES: [f64; 3] = [0.5, 0.0, 1.0];

/// Length of an arc over its chord, which turns by twice this angle.
fn arc_of(half: f64) -> f64 {
    let half = half.min(FRAC_PI_2);
    if half > 0.0 {
        half / libm::sin(half)
    } else {
        1.0
    }
}

struct Judge {
    dynamics: Dynamics,
    /// At most one of each demand.
    worst: Vec<Excess>,
}

/// Something that is held against a limit.
struct Measured {
    demand: Demand,
    along: &'static str,
    value: f64,
    limit: f64,
    /// Possible error of the value.
    off: f64,
}

impl Measured {
    fn over(&self) -> f64 {
        let most = self.limit * (1.0 + DYNAMICS_TOLERANCE) + self.off;
        // Nothing exceeds a limit that there is not.
        if most.is_finite() {
            self.value - most
        } else {
            f64::NEG_INFINITY
        }
    }
}

impl Judge {
    fn see(&mut self, measured: &Measured, at: &Part) {
        if measured.over() <= 0.0 {
            return;
        }
        let excess = Excess {
            demand: measured.demand,
            along: measured.along,
            knot: at.knot,
            time_s: at.begin_s,
            place_m: at.place.into(),
            value: measured.value,
            limit: measured.limit,
        };
        let same = |old: &&mut Excess| old.demand == excess.demand;
        match self.worst.iter_mut().find(same) {
            None => self.worst.push(excess),
            // By the part of the limit: limits of one demand differ by direction.
            Some(old) if excess.value * old.limit > old.value * excess.limit => *old = excess,
            Some(_) => {}
        }
    }

    fn motion(&mut self, knots: Knots<'_>) {
        let mut before = Part::rest(knots, 0);
        for knot in 1..knots.len() {
            let leg = Part::leg(knots, knot);
            let [first, last] = leg.ends();
            self.rates(&leg);
            self.junction(&before, &first, half_of(&before, &first));
            before = last;
        }
        let rest = Part::rest(knots, knots.len() - 1);
        self.junction(&before, &rest, half_of(&before, &rest));
    }

    /// Judges the rates of a leg in itself.
    fn rates(&mut self, leg: &Part) {
        let turn_rate = Measured {
            demand: Demand::TurnRate,
            along: "",
            value: leg.turn().abs() / leg.span_s,
            limit: self.dynamics.turn_rad_per_s,
            off: leg.off,
        };
        self.see(&turn_rate, leg);
        let curvature = self.dynamics.curvature_rad_per_m;
        if curvature.is_finite() {
            let steering = Measured {
                demand: Demand::Steering,
                along: "",
                value: leg.turn().abs() / leg.span_s,
                limit: curvature * leg.speed() * arc_of(0.5 * leg.turn().abs()),
                off: leg.off * (1.0 + curvature),
            };
            self.see(&steering, leg);
        }
        let turns_with_it = matches!(
            self.dynamics.travel,
            Travel::Body { .. } | Travel::Wheels { .. }
        );
        if !turns_with_it || leg.turn() == 0.0 || leg.speed() == 0.0 {
            self.velocity(leg);
            return;
        }
        // After a whole turn everything comes again.
        let turn = (TAU / leg.turn().abs()).min(1.0);
        // Rounding is no reason for another part.
        let parts = (leg.span_s * turn / LONGEST_SAMPLE_S - 0.01)
            .min(PARTS_OF_A_TURN)
            .ceil()
            .max(1.0);
        let mut before: Option<Part> = None;
        for part in 0..parts as u32 {
            let share = |part: u32| f64::from(part) / parts * turn;
            let part = leg.between(share(part), share(part + 1));
            self.velocity(&part);
            if let Some(before) = before.replace(part) {
                self.junction(&before, &part, part.span_s);
            }
        }
    }

    /// Judges a velocity.
    fn velocity(&mut self, part: &Part) {
        let speed = |along, value, limit| Measured {
            demand: Demand::Speed,
            along,
            value,
            limit,
            off: part.off,
        };
        match self.dynamics.travel {
            Travel::Polar { speed: limit, .. } => {
                self.see(&speed("", part.speed(), limit), part);
            }
            Travel::Axes { speed: limit, .. } => {
                let speeds: [f64; 2] = part.velocity.into();
                for (along, value) in ["along x", "along y"].into_iter().zip(speeds) {
                    self.see(&speed(along, value.abs(), limit), part);
                }
            }
            Travel::Body {
                forward,
                backward,
                sideways,
                ..
            } => {
                let most = self.unknown(part);
                let at = |share: f64| {
                    let [ahead, aside] = part.twist(share);
                    let (along, limit) = if ahead >= 0.0 {
                        ("forwards", forward)
                    } else {
                        ("backwards", backward)
                    };
                    [
                        speed(along, ahead.abs(), limit),
                        speed("sideways", aside.abs(), sideways),
                    ]
                    .map(|measured| Measured {
                        off: measured.off + most,
                        ..measured
                    })
                };
                self.least(at, part);
            }
            Travel::Wheels {
                forward, backward, ..
            } => match self.driven(part) {
                Ok(driven) => {
                    let (along, limit) = if driven[0] + driven[1] >= 0.0 {
                        ("forwards", forward)
                    } else {
                        ("backwards", backward)
                    };
                    self.see(&speed(along, part.speed(), limit), part);
                }
                Err(course) => {
                    self.see(&course, part);
                    self.see(&speed("", part.speed(), forward.max(backward)), part);
                }
            },
        }
    }

    /// Sees what is measured at that heading of a part that asks for least.
    fn least<const N: usize>(&mut self, at: impl Fn(f64) -> [Measured; N], part: &Part) {
        let worst = |all: &[Measured; N]| all.iter().map(Measured::over).fold(f64::MIN, f64::max);
        let all = SHARES.map(at);
        let least = all
            .iter()
            .min_by(|one, two| worst(one).total_cmp(&worst(two)));
        for measured in least.into_iter().flatten() {
            self.see(measured, part);
        }
    }

    /// Largest difference of the mean velocity of a part and any that the body had, in m/s: the arc
    /// above its chord, the turn that is not uniform, and the change of speed meanwhile.
    fn unknown(&self, part: &Part) -> f64 {
        let Travel::Body {
            forward_acceleration,
            sideways_acceleration,
            ..
        } = self.dynamics.travel
        else {
            return 0.0;
        };
        let turn = part.turn().abs().min(PI);
        let sped = part.counts_s() * forward_acceleration.max(sideways_acceleration);
        part.speed() * (0.125 * turn * turn + self.swing(part)) + sped * turn / 12.0
    }

    /// Angle by which a body can turn within a sample and turn back, in radians.
    fn swing(&self, part: &Part) -> f64 {
        let sample_s = part.counts_s();
        0.125 * sample_s * sample_s * if_finite(self.dynamics.turn_acceleration_rad_per_s2)
    }

    /// The least and the largest speed of wheels in a part, negative if they reverse, or
    /// that they do not lead there.
    ///
    /// A chord leads where the body headed at some moment, and is shorter than its arc.
    /// Within a sample it may have turned and back, and reversed: as far as that takes no
    /// longer.
    fn driven(&self, part: &Part) -> Result<[f64; 2], Measured> {
        let Travel::Wheels {
            backward,
            acceleration,
            deceleration,
            ..
        } = self.dynamics.travel
        else {
            return Ok([0.0; 2]);
        };
        let speed = part.speed();
        if speed <= part.off {
            return Ok([0.0; 2]);
        }
        let half = 0.5 * part.turn().abs() + self.swing(part);
        let reversed = 0.25 * part.counts_s() * if_finite(acceleration.max(deceleration)) * half;
        let middle = 0.5 * (part.headings[0] + part.headings[1]);
        let course = libm::atan2(part.velocity.y, part.velocity.x) - middle;
        let ahead = (wrapped(course).abs() - half).max(0.0);
        let back = (wrapped(course + PI).abs() - half).max(0.0);
        let (off, way) = if backward > 0.0 && back < ahead {
            (back, -1.0)
        } else {
            (ahead, 1.0)
        };
        let aside = speed * libm::sin(off.min(FRAC_PI_2));
        if aside > part.off + speed * DYNAMICS_TOLERANCE + reversed {
            return Err(Measured {
                demand: Demand::Course,
                along: "",
                value: off,
                limit: 0.0,
                off: 0.0,
            });
        }
        let mut ends = [speed * way, speed * way * arc_of(half)];
        ends.sort_by(f64::total_cmp);
        Ok([ends[0] - reversed, ends[1] + reversed])
    }

    /// From one part to the next, whose velocities lie `apart_s` apart in time.
    fn junction(&mut self, before: &Part, after: &Part, apart_s: f64) {
        let off = (before.off + after.off) / apart_s;
        let rate = |part: &Part| part.turn() / part.span_s;
        let turning = Measured {
            demand: Demand::TurnAcceleration,
            along: "",
            value: (rate(after) - rate(before)).abs() / apart_s,
            limit: self.dynamics.turn_acceleration_rad_per_s2,
            off,
        };
        self.see(&turning, after);
        let change = |along, by: f64, limit| Measured {
            demand: Demand::Acceleration,
            along,
            value: by.abs() / apart_s,
            limit,
            off,
        };
        let [old, new] = [before.velocity, after.velocity];
        match self.dynamics.travel {
            Travel::Polar { acceleration, .. } => {
                let by = (new - old).norm();
                self.see(&change("", by, acceleration), after);
            }
            Travel::Axes { acceleration, .. } => {
                for (axis, along) in ["along x", "along y"].into_iter().enumerate() {
                    let by = new[axis] - old[axis];
                    self.see(&change(along, by, acceleration), after);
                }
            }
            Travel::Body {
                forward_acceleration,
                sideways_acceleration,
                ..
            } => {
                let most = (self.unknown(before) + self.unknown(after)) / apart_s;
                let at = |share: f64| {
                    let (old, new) = (before.twist(share), after.twist(share));
                    [
                        change("forwards", new[0] - old[0], forward_acceleration),
                        change("sideways", new[1] - old[1], sideways_acceleration),
                    ]
                    .map(|measured| Measured {
                        off: measured.off + most,
                        ..measured
                    })
                };
                self.least(at, after);
            }
            Travel::Wheels { .. } => {
                if let (Ok(old), Ok(new)) = (self.driven(before), self.driven(after)) {
                    let [old, new] = nearest(old, new);
                    let (value, limit) = self.wheels_change(old, new, apart_s);
                    let measured = Measured {
                        value,
                        ..change("", 0.0, limit)
                    };
                    self.see(&measured, after);
                }
            }
        }
    }

    /// Acceleration that wheels need to change their speed, and the most that they have: a change
    /// through rest slows down first and speeds up then.
    fn wheels_change(&self, old: f64, new: f64, apart_s: f64) -> (f64, f64) {
        let Travel::Wheels {
            acceleration,
            deceleration,
            ..
        } = self.dynamics.travel
        else {
            return (0.0, f64::INFINITY);
        };
        let (down, up) = if old * new < 0.0 {
            (old.abs(), new.abs())
        } else {
            let by = new.abs() - old.abs();
            ((-by).max(0.0), by.max(0.0))
        };
        let change = down + up;
        let takes_s = down / deceleration + up / acceleration;
        let limit = if takes_s > 0.0 {
            change / takes_s
        } else {
            f64::INFINITY
        };
        (change / apart_s, limit)
    }

    /// Wheels that head where they move: at a corner they turn, for which there is the
    /// time that they rest.
    fn wheels_without_headings(&mut self, knots: Knots<'_>) {
        let Travel::Wheels {
            forward, backward, ..
        } = self.dynamics.travel
        else {
            return;
        };
        let mut before = Part::rest(knots, 0);
        // The last leg that moved, and whether it was driven backwards.
        let mut moved: Option<Part> = None;
        let (mut way, mut old) = (1.0, 0.0);
        for knot in 1..=knots.len() {
            let leg = if knot < knots.len() {
                Part::leg(knots, knot)
            } else {
                Part::rest(knots, knot - 1)
            };
            let mut new = 0.0;
            if leg.speed() > leg.off {
                if let Some(last) = moved.replace(leg) {
                    let turn = angle_between(last.velocity, leg.velocity);
                    let turn = if backward > 0.0 && turn > FRAC_PI_2 {
                        way = -way;
                        PI - turn
                    } else {
                        turn
                    };
                    let rests_s = leg.begin_s - (last.begin_s + last.span_s);
                    let apart_s = rests_s.max(0.0) + half_of(&last, &leg);
                    let corner = Measured {
                        demand: Demand::TurnRate,
                        along: "",
                        value: turn / apart_s,
                        limit: self.dynamics.turn_rad_per_s,
                        off: (last.off / last.speed() + leg.off / leg.speed()) / apart_s,
                    };
                    self.see(&corner, &leg);
                }
                let fast = Measured {
                    demand: Demand::Speed,
                    along: "",
                    value: leg.speed(),
                    limit: forward.max(backward),
                    off: leg.off,
                };
                self.see(&fast, &leg);
                new = leg.speed() * way;
            }
            let apart_s = half_of(&before, &leg);
            let (value, limit) = self.wheels_change(old, new, apart_s);
            let sudden = Measured {
                demand: Demand::Acceleration,
                along: "",
                value,
                limit,
                off: (before.off + leg.off) / apart_s,
            };
            self.see(&sudden, &leg);
            (before, old) = (leg, new);
        }
    }
}

/// Half of the time of both: from middle to middle, as far as they count.
fn half_of(one: &Part, two: &Part) -> f64 {
    0.5 * (one.counts_s() + two.counts_s())
}

/// A limit, or nothing where there is none: who changes at once does so between samples.
fn if_finite(limit: f64) -> f64 {
    if limit.is_finite() { limit } else { 0.0 }
}

fn place(knot: Knot) -> Vector {
    Vector::new(knot.x_m, knot.y_m)
}

/// The angle that differs by whole turns and is within half of one.
fn wrapped(angle: f64) -> f64 {
    angle - TAU * (angle / TAU).round()
}

fn angle_between(one: Vector, two: Vector) -> f64 {
    libm::atan2(one.perp(&two), one.dot(&two)).abs()
}

/// The two speeds of two ranges that differ least.
fn nearest(one: [f64; 2], two: [f64; 2]) -> [f64; 2] {
    if one[1] < two[0] {
        [one[1], two[0]]
    } else if two[1] < one[0] {
        [one[0], two[1]]
    } else {
        let common = one[0].max(two[0]);
        [common, common]
    }
}

#[cfg(test)]
mod tests {
    use fleetyard_core::{Knot, TrajectoryPlan};
    use proptest::prelude::*;

    use super::*;

    const AXES: Dynamics = Dynamics {
        travel: Travel::Axes {
            speed: 0.5,
            acceleration: 2.0,
        },
        turn_rad_per_s: PI,
        turn_acceleration_rad_per_s2: f64::INFINITY,
        curvature_rad_per_m: f64::INFINITY,
    };

    const WHEELS: Dynamics = Dynamics {
        travel: Travel::Wheels {
            forward: 1.0,
            backward: 0.5,
            acceleration: 1.0,
            deceleration: 2.0,
        },
        turn_rad_per_s: 1.0,
        turn_acceleration_rad_per_s2: 4.0,
        curvature_rad_per_m: f64::INFINITY,
    };

    const BODY: Dynamics = Dynamics {
        travel: Travel::Body {
            forward: 1.0,
            backward: 0.5,
            sideways: 0.25,
            forward_acceleration: 1.0,
            sideways_acceleration: 0.5,
        },
        turn_rad_per_s: 1.0,
        turn_acceleration_rad_per_s2: 2.0,
        curvature_rad_per_m: f64::INFINITY,
    };

    fn plan(knots: &[[f64; 4]], headings: bool) -> TrajectoryPlan {
        let mut plan = TrajectoryPlan::default();
        let knots = knots.iter().map(|[time_s, x_m, y_m, heading]| Knot {
            time_s: *time_s,
            x_m: *x_m,
            y_m: *y_m,
            heading_rad: headings.then_some(*heading),
        });
        plan.push_path(knots).unwrap();
        plan
    }

    fn asked(dynamics: &Dynamics, plan: &TrajectoryPlan) -> Vec<(Demand, &'static str)> {
        let excesses = dynamics.excesses(plan.knots(0));
        let named = excesses.iter().map(|excess| (excess.demand, excess.along));
        named.collect()
    }

    /// Samples of a motion with a velocity and a turn rate for every step, each of
    /// `step_s`, beginning and ending at rest.
    fn sampled(step_s: f64, twists: &[[f64; 3]], in_body: bool) -> Vec<[f64; 4]> {
        let mut knots = vec![[0.0; 4]];
        for [ahead, aside, omega] in twists {
            let [time_s, x, y, heading] = knots[knots.len() - 1];
            let (sin, cos) = if in_body {
                libm::sincos(heading)
            } else {
                (0.0, 1.0)
            };
            knots.push([
                time_s + step_s,
                x + (ahead * cos - aside * sin) * step_s,
                y + (ahead * sin + aside * cos) * step_s,
                heading + omega * step_s,
            ]);
        }
        knots
    }

    /// A body that reverses at once, and one that is too fast along one axis only.
    #[test]
    fn a_double_integrator_neither_reverses_at_once_nor_exceeds_an_axis() {
        let ramp = |v: f64| [[0.5 * v, 0.0, 0.0], [v, 0.0, 0.0], [0.5 * v, 0.0, 0.0]];
        let reversal: Vec<[f64; 3]> = ramp(0.4)[..2]
            .iter()
            .chain(&ramp(-0.4)[1..])
            .copied()
            .collect();
        let excesses = AXES.excesses(plan(&sampled(0.1, &reversal, false), false).knots(0));
        assert_eq!(excesses.len(), 1);
        assert_eq!(excesses[0].demand, Demand::Acceleration);
        assert_eq!((excesses[0].along, excesses[0].knot), ("along x", 3));
        assert!((excesses[0].value - 8.0).abs() < 1e-9 && (excesses[0].time_s - 0.2).abs() < 1e-12);
        assert!((excesses[0].place_m[0] - 0.06).abs() < 1e-12);

        let steps = |most: f64| {
            let mut speeds: Vec<f64> = (0..=3).map(|at| f64::from(at) * 0.2).collect();
            speeds[3] = most;
            speeds.extend([0.4, 0.2]);
            let twists: Vec<[f64; 3]> = speeds.iter().map(|v| [0.3, *v, 0.0]).collect();
            let mut knots = vec![[0.1, 0.0, 0.0], [0.2, 0.0, 0.0]];
            knots.extend(twists);
            knots.extend([[0.2, 0.0, 0.0], [0.1, 0.0, 0.0]]);
            plan(&sampled(0.1, &knots, false), false)
        };
        assert_eq!(asked(&AXES, &steps(0.5)), []);
        assert_eq!(asked(&AXES, &steps(0.6)), [(Demand::Speed, "along y")]);
        // By size the same would be too fast.
        let polar = Dynamics {
            travel: Travel::Polar {
                speed: 0.5,
                acceleration: 4.0,
            },
            ..AXES
        };
        assert_eq!(asked(&polar, &steps(0.5)), [(Demand::Speed, "")]);
    }

    /// A straight leg begins and ends at once, which takes a mass for ever.
    #[test]
    fn legs_at_one_speed_are_beyond_bodies_with_accelerations() {
        let leg = plan(&[[0.0; 4], [2.0, 0.9, 0.0, 0.0]], true);
        assert_eq!(asked(&AXES, &leg), [(Demand::Acceleration, "along x")]);
        let free = Dynamics {
            travel: Travel::Axes {
                speed: 0.5,
                acceleration: f64::INFINITY,
            },
            ..AXES
        };
        assert_eq!(asked(&free, &leg), []);
        // The first step of a ramp is half as high as the others.
        let slow = plan(&[[0.0; 4], [2.0, 0.39, 0.0, 0.0]], true);
        assert_eq!(asked(&AXES, &slow), []);
    }

    #[test]
    fn who_steers_does_not_turn_in_place() {
        let car = Dynamics {
            travel: Travel::Wheels {
                forward: 1.0,
                backward: 0.5,
                acceleration: f64::INFINITY,
                deceleration: f64::INFINITY,
            },
            turn_rad_per_s: 2.0,
            turn_acceleration_rad_per_s2: f64::INFINITY,
            curvature_rad_per_m: 2.0,
        };
        // Chords of arcs, ahead and back: one is as narrow as it can be, the other is narrower.
        let arc = |way: f64, turn: f64| {
            let knots: Vec<[f64; 4]> = (0..=20)
                .map(|at| {
                    let heading = turn * f64::from(at) / 20.0;
                    let radius = way / turn;
                    let (sin, cos) = libm::sincos(heading);
                    [
                        f64::from(at) * 0.1,
                        radius * sin,
                        radius * (1.0 - cos),
                        heading,
                    ]
                })
                .collect();
            plan(&knots, true)
        };
        assert_eq!(asked(&car, &arc(0.75, 1.5)), []);
        assert_eq!(asked(&car, &arc(-0.75, 1.5)), []);
        assert_eq!(asked(&car, &arc(0.74, 1.5)), [(Demand::Steering, "")]);
        let spot = plan(&[[0.0; 4], [1.0, 0.0, 0.0, 1.0]], true);
        assert_eq!(asked(&car, &spot), [(Demand::Steering, "")]);
    }

    #[test]
    fn wheels_lead_where_they_head() {
        let ramp = [0.05, 0.15, 0.25, 0.25, 0.15, 0.05];
        let along = |way: f64, aside: f64, omega: f64| {
            let twists: Vec<[f64; 3]> = ramp.iter().map(|v| [way * v, aside * v, omega]).collect();
            plan(&sampled(0.1, &twists, true), true)
        };
        assert_eq!(asked(&WHEELS, &along(1.0, 0.0, 0.0)), []);
        assert_eq!(asked(&WHEELS, &along(-1.0, 0.0, 0.1)), []);
        assert_eq!(
            asked(&WHEELS, &along(0.0, 1.0, 0.0)),
            [(Demand::Course, "")]
        );
        let forwards = Dynamics {
            travel: Travel::Wheels {
                forward: 1.0,
                backward: 0.0,
                acceleration: 1.0,
                deceleration: 2.0,
            },
            ..WHEELS
        };
        let excesses = forwards.excesses(along(-1.0, 0.0, 0.0).knots(0));
        assert_eq!(excesses[0].demand, Demand::Course);
        assert!((excesses[0].value - PI).abs() < 0.01);
        // A straight line that is driven while turning, over more than a sample.
        let skid = plan(&[[0.0; 4], [1.0, 0.04, 0.0, 0.3]], true);
        assert_eq!(asked(&WHEELS, &skid), [(Demand::Course, "")]);
        // It turns where it stands, too fast, and too suddenly.
        let turn = plan(
            &[[0.0; 4], [1.0, 0.0, 0.0, 1.5], [2.0, 0.0, 0.0, 1.5]],
            true,
        );
        assert_eq!(
            asked(&WHEELS, &turn),
            [(Demand::TurnRate, ""), (Demand::TurnAcceleration, "")]
        );
        // It speeds up half as well as it slows down.
        let brake = sampled(
            0.1,
            &[[0.1, 0.0, 0.0], [0.2, 0.0, 0.0], [0.19, 0.0, 0.0]],
            true,
        );
        assert_eq!(asked(&WHEELS, &plan(&brake, true)), []);
        let mut start = brake;
        start.reverse();
        for knot in &mut start {
            *knot = [0.3 - knot[0], -knot[1], 0.0, 0.0];
        }
        start[0][0] = 0.0;
        assert_eq!(
            asked(&WHEELS, &plan(&start, true)),
            [(Demand::Acceleration, "")]
        );
    }

    /// Without headings a corner is a turn, which takes the time of a rest.
    #[test]
    fn wheels_without_headings_turn_at_corners() {
        let corner = |rests_s: f64| {
            let mut knots = sampled(0.1, &[[0.1, 0.0, 0.0], [0.1, 0.0, 0.0]], false);
            let [time_s, x, ..] = knots[2];
            knots.push([time_s + rests_s, x, 0.0, 0.0]);
            for y in [0.01, 0.02] {
                knots.push([time_s + rests_s + 10.0 * y, x, y, 0.0]);
            }
            plan(&knots, false)
        };
        assert_eq!(asked(&WHEELS, &corner(1.5)), []);
        assert_eq!(asked(&WHEELS, &corner(1.2)), [(Demand::TurnRate, "")]);
        // Back is no turn for who reverses.
        let back = plan(
            &[[0.0; 4], [0.1, 0.01, 0.0, 0.0], [0.2, 0.0, 0.0, 0.0]],
            false,
        );
        assert_eq!(asked(&WHEELS, &back), [(Demand::Acceleration, "")]);
    }

    #[test]
    fn limits_turn_with_the_body() {
        let along = |heading: f64, v: f64| {
            let ramp: Vec<f64> = (1..=20).map(|at| (f64::from(at) * 0.05).min(v)).collect();
            let ramp = ramp.iter().chain(ramp.iter().rev());
            let mut knots = vec![[0.0, 0.0, 0.0, heading]];
            for v in ramp {
                let [time_s, x, ..] = knots[knots.len() - 1];
                knots.push([time_s + 0.1, x + v * 0.1, 0.0, heading]);
            }
            plan(&knots, true)
        };
        assert_eq!(asked(&BODY, &along(0.0, 1.0)), []);
        assert_eq!(asked(&BODY, &along(PI, 0.5)), []);
        assert_eq!(
            asked(&BODY, &along(PI, 0.6)),
            [(Demand::Speed, "backwards")]
        );
        assert_eq!(asked(&BODY, &along(FRAC_PI_2, 0.25)), []);
        assert_eq!(
            asked(&BODY, &along(-FRAC_PI_2, 0.3)),
            [(Demand::Speed, "sideways")]
        );
        // Sideways at the end of a turn, somewhere in the middle of a long leg.
        let drift = plan(
            &[
                [0.0; 4],
                [0.1, 0.005, 0.0, 0.0],
                [8.1, 0.805, 0.0, FRAC_PI_2],
                [16.1, 5.6, 0.0, 0.0],
            ],
            true,
        );
        assert!(asked(&BODY, &drift).contains(&(Demand::Speed, "sideways")));
        // It heads as suits it best where nobody says how.
        let free = plan(&sampled(0.1, &[[0.05, 0.0, 0.0]; 3], false), false);
        assert_eq!(asked(&BODY, &free), []);
    }

    /// As large, as short and as twisted as a plan can be.
    #[test]
    fn absurd_motions_are_judged() {
        let jump = plan(
            &[[0.0; 4], [5e-324, 1e9, -1e9, 1e9], [1e9, -1e9, 1e9, -1e9]],
            true,
        );
        for dynamics in [AXES, WHEELS, BODY] {
            let excesses = dynamics.excesses(jump.knots(0));
            assert!(!excesses.is_empty());
            let numbers = |excess: &Excess| excess.value.is_finite() && excess.limit.is_finite();
            assert!(excesses.iter().all(numbers), "{excesses:?}");
        }
        assert_eq!(asked(&Dynamics::UNLIMITED, &jump), []);
        let still = plan(&[[0.0, 3.0, 4.0, 5.0]], true);
        assert_eq!(asked(&WHEELS, &still), []);
    }

    proptest! {
        /// Motions that are integrated from inputs within the limits pass, however they are
        /// sampled; a tenth of the limit more does not.
        #[test]
        fn samples_of_what_bodies_do_pass(
            inputs in proptest::collection::vec((-1.0..1.0f64, -1.0..1.0f64, -1.0..1.0f64), 1..40),
            every in 1..11usize,
        ) {
            let step_s = 0.01;
            let clip = |value: f64, most: f64| value.max(-most).min(most);
            for (dynamics, limits) in [
                (AXES, [[0.5, 2.0], [0.5, 2.0], [PI, 50.0]]),
                (BODY, [[0.5, 1.0], [0.25, 0.5], [1.0, 2.0]]),
                (WHEELS, [[0.5, 1.0], [0.0, 0.0], [1.0, 4.0]]),
            ] {
                let mut twist = [0.0; 3];
                let mut twists = Vec::new();
                let mut step = |wanted: [f64; 3]| {
                    for (axis, [most, rate]) in limits.into_iter().enumerate() {
                        let by = clip(wanted[axis] * most - twist[axis], rate * step_s);
                        twist[axis] = clip(twist[axis] + by, most);
                    }
                    twists.push(twist);
                    twist
                };
                for (ahead, aside, omega) in &inputs {
                    for _ in 0..10 {
                        step([*ahead, *aside, *omega]);
                    }
                }
                while step([0.0; 3]).iter().any(|speed| speed.abs() > 0.0) {}
                let knots = sampled(step_s, &twists, dynamics != AXES);
                let last = knots.len() - 1;
                let kept = knots.iter().enumerate();
                let kept = kept.filter(|(at, _)| at % every == 0 || *at == last);
                let kept: Vec<[f64; 4]> = kept.map(|(_, knot)| *knot).collect();
                let plan = plan(&kept, true);
                let excesses = dynamics.excesses(plan.knots(0));
                prop_assert!(excesses.is_empty(), "{excesses:?}");
            }
        }
    }
}
