//! Controls drawn at random, and where they lead among what stands and what moves.

use std::rc::Rc;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::obstacles::Obstacles;
use fleetyard_plugin_plane::sssp::bodies::Body;
use fleetyard_plugin_spacetime::random::Random;

use super::near::lifted;
use crate::course::{CHORD, Course, Segment, Track};
use crate::plugin::{Member, Team};
use crate::robot::{Control, State};
use crate::scene::clash;
use crate::steer::{brake, steer};

/// Part of a body's radius by which a motion may be wide of its lines where nothing is near.
const WIDE: f64 = 0.25;

/// Part of the tolerances of a goal within which it is aimed at.
const WITHIN: f64 = 0.999;

/// A body that moves in a known way, and is to be kept clear of for some time.
#[derive(Debug, Clone, Copy)]
pub struct Moving<'a> {
    /// Its body.
    pub body: &'a Body,
    /// Its motion.
    pub track: &'a Track,
    /// Seconds from which on it counts, and until when.
    pub span: [f64; 2],
}

/// A robot that is driven by any controls.
#[derive(Debug, Clone)]
pub struct Drive<'a> {
    /// The robot, with its task.
    pub member: &'a Member,
    /// Bodies that it has to keep clear of.
    pub moving: Vec<Moving<'a>>,
    bounds: Rectangle,
    /// Obstacles as a disc sees them in which the body turns, a little larger.
    wide: Rc<Obstacles>,
    margin: f64,
    /// Metres that count as much as a radian, and as much as a unit of each rate.
    lever: f64,
    scales: [f64; 3],
}

impl<'a> Drive<'a> {
    /// Of a robot of a team, which keeps clear of movers alone.
    pub fn new(team: &'a Team<'_>, agent: usize) -> Self {
        let member = &team.members[agent];
        let robot = &member.robot;
        let moving = team.scene.movers.iter().map(|mover| Moving {
            body: &mover.body,
            track: &mover.track,
            span: [0.0, f64::INFINITY],
        });
        let world = team.scene.world;
        let radius = member.space.body.radius;
        let margin = radius * WIDE;
        let turn_rate = robot.top_turn_rate();
        let lever = if turn_rate > 0.0 {
            robot.top_speed() / turn_rate / 2.0
        } else {
            0.0
        };
        // A rate counts as the way on which it is lost.
        let scale = |axis: usize, metres: f64| {
            let most = |limits: [f64; 2]| limits[1].max(-limits[0]);
            let change = most(robot.changes[axis]);
            if change > 0.0 {
                metres * most(robot.rates[axis]) / change / 2.0
            } else {
                0.0
            }
        };
        Self {
            member,
            moving: moving.collect(),
            bounds: world.bounds,
            wide: Rc::new(Obstacles::new(
                world.polygons.clone(),
                world.bounds,
                radius + margin,
            )),
            margin,
            lever,
            scales: [scale(0, 1.0), scale(1, 1.0), scale(2, lever)],
        }
    }

    /// Length of the circle of headings, in metres.
    pub fn round(&self) -> f64 {
        self.lever * std::f64::consts::TAU
    }

    /// The box of the world.
    pub fn bounds(&self) -> Rectangle {
        self.bounds
    }

    /// A state as a point, in metres.
    pub fn point(&self, state: &State) -> [f64; 6] {
        let around = if self.lever > 0.0 {
            lifted(state.heading, self.lever)
        } else {
            0.0
        };
        let [along, across, turn] = [0, 1, 2].map(|axis| state.rates[axis] * self.scales[axis]);
        [state.at.x, state.at.y, around, along, across, turn]
    }

    /// Any state in the world.
    pub fn anywhere(&self, random: &mut Random) -> State {
        let robot = &self.member.robot;
        let share = Vector::new(random.share(), random.share());
        let heading = if self.lever > 0.0 {
            (random.share() - 0.5) * std::f64::consts::TAU
        } else {
            self.member.start.heading
        };
        let rates = if robot.is_second {
            robot.clamped_rates(&within(&robot.rates, random))
        } else {
            [0.0; 3]
        };
        State {
            at: self.bounds.min + (self.bounds.max - self.bounds.min).component_mul(&share),
            heading,
            rates,
            behind: heading,
        }
    }

    /// Any state that is near enough to the goal.
    pub fn goal(&self, random: &mut Random) -> State {
        let (goal, any) = (&self.member.goal, self.anywhere(random));
        let mut beside = || {
            let share = Vector::new(random.share(), random.share()) * 2.0 - Vector::repeat(1.0);
            // What is driven there is rounded.
            share * WITHIN / share.norm().max(1.0)
        };
        let at = if goal.place_m.is_finite() {
            goal.state.at + beside() * goal.place_m
        } else {
            any.at
        };
        let turn = beside().x * goal.heading_rad.min(std::f64::consts::PI);
        let rate = |axis: usize| {
            if goal.free.rates[axis] {
                any.rates[axis]
            } else {
                goal.state.rates[axis]
            }
        };
        let heading = if goal.free.heading {
            any.heading
        } else {
            goal.state.heading + turn
        };
        State {
            at,
            heading,
            rates: [0, 1, 2].map(rate),
            behind: heading,
        }
    }

    /// Any control, held for at most so many seconds, and no longer than rates allow.
    pub fn control(&self, state: &State, longest: f64, random: &mut Random) -> Segment {
        let robot = &self.member.robot;
        let control = robot.clamped(&within(robot.controls(), random));
        let seconds = longest * (1.0 - random.share());
        Segment {
            control,
            seconds: seconds.min(self.until_limits(state, &control)),
        }
    }

    /// Seconds after which a control makes rates exceed their limits.
    pub fn until_limits(&self, state: &State, control: &Control) -> f64 {
        let robot = &self.member.robot;
        if !robot.is_second {
            return f64::INFINITY;
        }
        let mut least = f64::INFINITY;
        let axes = control.iter().zip(&state.rates).zip(&robot.rates);
        for ((change, rate), [low, high]) in axes.skip(usize::from(robot.polar_rates) * 2) {
            let limit = if *change > 0.0 { high } else { low };
            if *change != 0.0 {
                least = least.min((limit - rate) / change);
            }
        }
        if robot.polar_rates {
            // |v + a·t| = most
            let most = robot.top_speed();
            let (v, a) = (
                Vector::new(state.rates[0], state.rates[1]),
                Vector::new(control[0], control[1]),
            );
            let (aa, av) = (a.norm_squared(), a.dot(&v));
            if aa > 0.0 {
                let inside = (most * most - v.norm_squared()).max(0.0);
                least = least.min(((av * av + aa * inside).sqrt() - av) / aa);
            }
        }
        least.max(0.0)
    }

    /// A body that is driven from a state on touches nothing, neither what stands nor what moves; it begins at a time in seconds.
    pub fn is_clear(&self, state: &State, segments: &[Segment], time: f64) -> bool {
        let course = Course {
            start: *state,
            segments: segments.to_vec(),
        };
        let robot = &self.member.robot;
        let coarse = course.track_within(robot, self.margin);
        let far = coarse
            .legs()
            .all(|leg| self.wide.clear(leg.from.at, leg.to.at));
        if far && self.moving.is_empty() {
            return true;
        }
        let track = course.track_within(robot, CHORD);
        if !far && !track.legs().all(|leg| self.member.space.is_clear(&leg)) {
            return false;
        }
        let track = track.later(time);
        let end = track.last().time;
        self.is_clear_of_moving(&track, time, end)
    }

    /// The robot may rest in a state from a time on, in seconds, for ever.
    pub fn may_rest(&self, state: &State, time: f64) -> bool {
        let track = Course::stay(*state).track(&self.member.robot);
        self.is_clear_of_moving(&track, time, f64::INFINITY)
    }

    fn is_clear_of_moving(&self, track: &Track, from: f64, until: f64) -> bool {
        self.moving.iter().all(|moving| {
            let (from, until) = (from.max(moving.span[0]), until.min(moving.span[1]));
            let both = ((&self.member.body, track), (moving.body, moving.track));
            from >= until || clash(both.0, both.1, from, until).is_none()
        })
    }

    /// A bound from below of the seconds to the goal.
    pub fn bound(&self, state: &State) -> f64 {
        let robot = &self.member.robot;
        let goal = &self.member.goal;
        let (way, turn, _) = goal.missed(state);
        let drive = (way.norm() - goal.place_m).max(0.0) / robot.top_speed();
        let turn = (turn.abs() - goal.heading_rad).max(0.0);
        if turn > 0.0 {
            drive.max(turn / robot.top_turn_rate())
        } else {
            drive
        }
    }

    /// Controls that stop the robot and lead it to a state near enough to its goal, where nothing is in the way.
    pub fn connection(&self, state: &State, aim: &State) -> Option<Vec<Segment>> {
        let Member { robot, goal, .. } = self.member;
        let mut segments: Vec<Segment> = brake(robot, state).into_iter().collect();
        let halt = Course {
            start: *state,
            segments: segments.clone(),
        };
        let rest = halt.end(robot);
        segments.extend(steer(robot, &rest.pose(), &aim.pose(), goal.free.heading)?);
        let course = Course {
            start: *state,
            segments,
        };
        goal.is_reached(&course.end(robot))
            .then_some(course.segments)
    }
}

/// Numbers between limits.
fn within(limits: &[[f64; 2]; 3], random: &mut Random) -> [f64; 3] {
    limits.map(|[least, most]| {
        if most > least {
            least + (most - least) * random.share()
        } else {
            least
        }
    })
}
