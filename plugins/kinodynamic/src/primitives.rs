//! Motion primitives: short motions that a search puts one after the other.
//!
//! db-A\* and its relatives (Hönig, Ortiz-Haro, Toussaint, IROS 2022) draw primitives at random, optimise each, and allow a gap of
//! up to δ where one follows another. Here there is no gap. Where a robot stands and which way it looks changes nothing in how it
//! moves, so that a primitive begins in any pose. Its rates stand on a lattice: a robot of second order goes from one level to the
//! next with all the acceleration that it has, and holds it for the rest of a time step. All levels are exact, so that primitives
//! join exactly, and a chain of them is what a robot can do. A robot of first order has no rates, and its primitives are its extreme
//! controls and some between.
//!
//! A set is made where a search first needs it. That takes microseconds, so nothing is kept on disk.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_1_SQRT_2, TAU};
use std::rc::Rc;

use fleetyard_plugin_plane::Vector;

use crate::course::{Course, Knot, Segment};
use crate::robot::{Control, Robot, State};

/// Rates in steps of the lattice, in the order of the robot's axes.
pub type Level = [i16; 3];

/// A motion from one level to another.
#[derive(Debug, Clone)]
pub struct Primitive {
    /// Its controls.
    pub segments: Vec<Segment>,
    /// Its duration.
    pub seconds: f64,
    /// The level in the end.
    pub to: Level,
    /// Its track from the origin with heading zero.
    pub knots: Vec<Knot>,
    /// A circle that the robot's origin does not leave: its centre, and its radius in metres.
    pub around: (Vector, f64),
}

/// The primitives of a robot.
#[derive(Debug)]
pub struct Primitives {
    robot: Robot,
    step: f64,
    /// Of one level, in m/s and rad/s; zero of an axis that does not change.
    quantum: [f64; 3],
    sets: BTreeMap<Level, Rc<[Primitive]>>,
}

/// Directions of a robot that goes sideways, with and without a heading.
const DIRECTIONS: [u32; 2] = [8, 16];

/// A turn in one step by more than this, in radians, has smaller ones beside it.
const COARSE_RAD: f64 = 0.3;

/// The slower way of a car is held for up to so many steps.
const LONGEST: f64 = 8.0;

/// Most levels above zero.
const MOST_LEVELS: f64 = 64.0;

impl Primitives {
    /// Of a robot, each as long as `step` seconds.
    pub fn new(robot: &Robot, step: f64) -> Self {
        let both = robot.goes_sideways && robot.polar_changes;
        let quantum = [0, 1, 2].map(|axis| {
            let change = change(robot, axis, both && axis < 2);
            let [least, most] = robot.rates[axis];
            let top = most.max(-least);
            if change <= 0.0 || top <= 0.0 {
                return 0.0;
            }
            top / (top / (change * step)).ceil().clamp(1.0, MOST_LEVELS)
        });
        Self {
            robot: robot.clone(),
            step,
            quantum,
            sets: BTreeMap::new(),
        }
    }

    /// The rates of a level.
    pub fn rates(&self, level: Level) -> [f64; 3] {
        [0, 1, 2].map(|axis| f64::from(level[axis]) * self.quantum[axis])
    }

    /// The greatest level that is not faster than these rates on any axis.
    pub fn level(&self, rates: &[f64; 3]) -> Level {
        [0, 1, 2].map(|axis| {
            if self.quantum[axis] > 0.0 {
                let levels = rates[axis] / self.quantum[axis];
                (levels + levels.signum() * 1e-9).trunc() as i16
            } else {
                0
            }
        })
    }

    /// The primitives that begin with a level.
    pub fn from(&mut self, level: Level) -> Rc<[Primitive]> {
        if let Some(known) = self.sets.get(&level) {
            return Rc::clone(known);
        }
        let set: Rc<[Primitive]> = if self.robot.is_second {
            self.changes(level)
        } else {
            self.controls()
        };
        self.sets.insert(level, Rc::clone(&set));
        set
    }

    /// The robot stays where it is; `seconds` may be as long as one likes.
    pub fn rest(&self, seconds: f64) -> Primitive {
        self.primitive(
            [0; 3],
            [0; 3],
            vec![Segment {
                control: [0.0; 3],
                seconds,
            }],
        )
    }

    /// Of a robot of first order.
    fn controls(&self) -> Rc<[Primitive]> {
        let robot = &self.robot;
        let mut travels = vec![[0.0; 2]];
        if robot.goes_sideways {
            let directions = DIRECTIONS[usize::from(!robot.has_heading)];
            travels.extend((0..directions).map(|number| {
                let (sin, cos) = libm::sincos(TAU * f64::from(number) / f64::from(directions));
                fastest(robot, [cos, sin])
            }));
        } else {
            let [back, ahead] = robot.rates[0];
            travels.extend([[ahead, 0.0], [back, 0.0]]);
        }
        let [right, left] = robot.rates[2];
        // Parts of the fastest turns.
        let mut parts = vec![1.0];
        while !robot.goes_sideways
            && left.max(-right) * self.step * parts[parts.len() - 1] > COARSE_RAD / 2.0
        {
            parts.push(parts[parts.len() - 1] / 2.0);
        }
        let mut controls: Vec<Control> = Vec::new();
        for travel in travels {
            let stands = travel.iter().all(|rate| *rate == 0.0);
            // Turning on the spot by less is no use, nor is staying.
            let parts = &parts[..if stands { 1 } else { parts.len() }];
            let [right, left] = match &robot.car {
                Some(car) => [-1.0, 1.0].map(|way| way * car.curvature * travel[0].abs()),
                None => [right, left],
            };
            let turns = parts.iter().flat_map(|part| [left * part, right * part]);
            let straight = (!stands).then_some(0.0);
            for turn in straight.into_iter().chain(turns) {
                let control = [travel[0], travel[1], turn];
                let moves = control.iter().any(|rate| *rate != 0.0);
                if moves && !controls.contains(&control) {
                    controls.push(control);
                }
            }
        }
        let top = robot.top_speed();
        let held = controls.into_iter().map(|control| {
            // A car that backs slowly would not leave the states that count as the same.
            let longer = match &robot.car {
                Some(_) => (top / control[0].abs()).min(LONGEST),
                None => 1.0,
            };
            let segment = Segment {
                control,
                seconds: self.step * longer,
            };
            self.primitive([0; 3], [0; 3], vec![segment])
        });
        held.collect()
    }

    /// Of a robot of second order: one level more, one less or the same on every axis.
    fn changes(&self, level: Level) -> Rc<[Primitive]> {
        let robot = &self.robot;
        let mut found = Vec::new();
        for number in 0..27_i16 {
            let steps = [number / 9 - 1, number / 3 % 3 - 1, number % 3 - 1];
            let moves = (0..3).all(|axis| steps[axis] == 0 || self.quantum[axis] > 0.0);
            let to = [0, 1, 2].map(|axis| level[axis] + steps[axis]);
            let stays = to == [0; 3] && level == [0; 3];
            if !moves || stays || !robot.allows(&self.rates(to)) {
                continue;
            }
            let both = robot.polar_changes && steps[0] != 0 && steps[1] != 0;
            // Each axis changes as fast as it can, then holds.
            let changes = [0, 1, 2].map(|axis| change(robot, axis, both && axis < 2));
            let lasts = [0, 1, 2].map(|axis| {
                if steps[axis] == 0 {
                    0.0
                } else {
                    (self.quantum[axis] / changes[axis]).min(self.step)
                }
            });
            let mut ends = [lasts[0], lasts[1], lasts[2], self.step];
            ends.sort_by(f64::total_cmp);
            let mut segments = Vec::new();
            let mut begin = 0.0;
            for end in ends {
                if end - begin <= 1e-9 {
                    continue;
                }
                let control = [0, 1, 2].map(|axis| {
                    if lasts[axis] > begin {
                        f64::from(steps[axis]) * self.quantum[axis] / lasts[axis]
                    } else {
                        0.0
                    }
                });
                segments.push(Segment {
                    control,
                    seconds: end - begin,
                });
                begin = end;
            }
            let primitive = self.primitive(level, to, segments);
            // Between two levels whose lengths are bounded one rate may change before another.
            let course = Course {
                start: self.start(level),
                segments: primitive.segments.clone(),
            };
            if course.is_allowed(robot) {
                found.push(primitive);
            }
        }
        found.into()
    }

    fn start(&self, level: Level) -> State {
        State {
            rates: self.rates(level),
            ..State::rest(Vector::zeros(), 0.0)
        }
    }

    fn primitive(&self, from: Level, to: Level, segments: Vec<Segment>) -> Primitive {
        let course = Course {
            start: self.start(from),
            segments,
        };
        let knots = course.track(&self.robot).knots;
        Primitive {
            seconds: course.seconds(),
            segments: course.segments,
            to,
            around: circle(&knots),
            knots,
        }
    }
}

/// A circle that the origin does not leave: its centre, and its radius in metres.
pub fn circle(knots: &[Knot]) -> (Vector, f64) {
    let places = knots.iter().map(|knot| knot.pose.at);
    let first = knots[0].pose.at;
    let (low, high) = places.clone().fold((first, first), |(low, high), at| {
        (low.inf(&at), high.sup(&at))
    });
    let centre = (low + high) / 2.0;
    let reach = places.map(|at| (at - centre).norm()).fold(0.0, f64::max);
    (centre, reach)
}

/// The fastest change of a rate to both sides; with `both`, together with another one whose length with it is bounded.
fn change(robot: &Robot, axis: usize, both: bool) -> f64 {
    let [least, most] = robot.changes[axis];
    let change = most.min(-least);
    if both { change * FRAC_1_SQRT_2 } else { change }
}

/// The fastest travel in a direction.
fn fastest(robot: &Robot, direction: [f64; 2]) -> [f64; 2] {
    let within = |axis: usize| {
        let [least, most] = robot.rates[axis];
        let part = direction[axis];
        if part.abs() < 1e-12 {
            f64::INFINITY
        } else if part > 0.0 {
            most / part
        } else {
            least / part
        }
    };
    let most = |axis: usize| robot.rates[axis][1].max(-robot.rates[axis][0]);
    let polar = if robot.polar_rates {
        most(0).max(most(1))
    } else {
        f64::INFINITY
    };
    let speed = within(0).min(within(1)).min(polar);
    direction.map(|part| {
        if part.abs() < 1e-12 {
            0.0
        } else {
            part * speed
        }
    })
}
