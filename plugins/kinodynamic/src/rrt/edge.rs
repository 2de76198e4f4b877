//! One robot among what stands, and its motions from rest to rest.

use std::rc::Rc;

use fleetyard_plugin_plane::Vector;
use fleetyard_plugin_plane::bins::Rectangle;
use fleetyard_plugin_plane::sssp;
use fleetyard_plugin_plane::sssp::bodies::{Body, Pose, Space, wrapped};
use fleetyard_plugin_plane::sssp::roadmap::{self, Roadmap, START, Sampler};

use crate::course::{CHORD, Course, Segment, Track};
use crate::plugin::{Member, Team};
use crate::robot::State;
use crate::scene::{clash, is_clear};
use crate::steer::{brake, steer};

/// Motions are first tried by chords so far beside them, in metres and radians, of a body that is larger by as much.
const COARSE: f64 = 3e-3;

/// A robot as the search sees it.
#[derive(Debug)]
pub struct Walker {
    /// The robot and its task.
    pub member: Member,
    /// Its body, larger by all that its tracks may be off.
    pub body: Body,
    /// All that stands, as that body sees it.
    wide: Rc<Space>,
    /// Greatest distance of a track from its motion, in metres and radians.
    chord: f64,
    /// The controls that bring it to rest at first.
    pub braking: Option<Segment>,
    /// The state in which it is at rest then.
    pub root: State,
}

/// The fastest that a robot is.
#[derive(Debug, Clone, Copy)]
pub struct Speeds {
    travel: f64,
    turn: f64,
}

impl Walker {
    /// The robots of a team. None of a robot that is moving and cannot stop.
    pub fn team(team: &Team<'_>) -> Vec<Option<Self>> {
        let bodies: Vec<Body> = team.members.iter().map(|own| coarse(&own.body)).collect();
        let walker = |agent: usize| {
            let member = team.members[agent].clone();
            let braking = brake(&member.robot, &member.start);
            let root = match &braking {
                Some(braking) => {
                    member
                        .robot
                        .after(&member.start, &braking.control, braking.seconds)
                }
                None => member.start,
            };
            if root.rates.iter().any(|rate| rate.abs() > 1e-9) {
                return None;
            }
            let wide = team
                .scene
                .space(&member.space.body, off(&member.body, COARSE));
            let ends = |member: &Member| [member.start.pose(), member.goal.state.pose()];
            let rest = |pose: Pose| Track::rest(pose);
            // Where there is little room at starts and goals it takes a closer look at all.
            let is_roomy = ends(&member).iter().all(|pose| wide.is_free(pose))
                && team
                    .scene
                    .is_clear_of_movers(&bodies[agent], &rest(member.start.pose()), false)
                && (0..team.len())
                    .filter(|other| *other != agent)
                    .all(|other| {
                        let others = ends(&team.members[other]);
                        ends(&member).iter().zip(&others).all(|(own, others)| {
                            let (own, others) = (rest(*own), rest(*others));
                            clash((&bodies[agent], &own), (&bodies[other], &others), 0.0, 1.0)
                                .is_none()
                        })
                    });
            let (body, wide, chord) = if is_roomy {
                (bodies[agent].clone(), wide, COARSE)
            } else {
                (member.body.clone(), member.space.clone(), CHORD)
            };
            Some(Self {
                body,
                wide,
                chord,
                braking,
                root: State {
                    rates: [0.0; 3],
                    ..root
                },
                member,
            })
        };
        (0..team.len()).map(walker).collect()
    }

    /// Controls in straight lines, which [`Walker::body`] makes up for.
    pub fn track(&self, course: &Course) -> Track {
        course.track_within(&self.member.robot, self.chord)
    }

    /// The fastest that it is along its way and in turning.
    pub fn speeds(&self) -> Speeds {
        let robot = &self.member.robot;
        Speeds {
            travel: robot.top_speed(),
            turn: if robot.has_heading {
                robot.top_turn_rate()
            } else {
                0.0
            },
        }
    }

    /// A motion from rest to rest that touches nothing that stands; none where it is not found to be clear, or does not move.
    /// A goal whose heading is open is reached with any.
    pub fn edge(&self, from: &State, to: &Pose, heading_free: bool) -> Option<Edge> {
        let segments = steer(&self.member.robot, &from.pose(), to, heading_free)?;
        self.driven(Course {
            start: *from,
            segments,
        })
    }

    /// A motion from rest to rest by controls, if it touches nothing that stands.
    pub fn driven(&self, course: Course) -> Option<Edge> {
        let robot = &self.member.robot;
        let seconds = course.seconds();
        if seconds <= 0.0 {
            return None;
        }
        let track = self.track(&course);
        let clear = track.legs().all(|leg| self.wide.is_clear(&leg))
            || (self.chord > CHORD && is_clear(&self.member.space, &course.track(robot)));
        clear.then(|| {
            let first = track.knots[0].pose.at;
            let (low, high) = track
                .knots
                .iter()
                .fold((first, first), |(low, high), knot| {
                    (low.inf(&knot.pose.at), high.sup(&knot.pose.at))
                });
            Edge {
                reach: Rectangle::around(low, high, self.body.radius),
                start: course.start,
                end: State {
                    rates: [0.0; 3],
                    ..course.end(robot)
                },
                segments: course.segments,
                seconds,
                track,
            }
        })
    }

    /// Poses from start to goal among what stands, if RRT-Connect finds them while `more` says yes: its straight motions are
    /// those of a robot without inertia that goes in all directions.
    pub fn guide(&self, sampler: &mut Sampler, more: &mut dyn FnMut() -> bool) -> Vec<Pose> {
        let (start, goal) = (self.root.pose(), self.member.goal);
        let speeds = self.speeds();
        let heading = if goal.free.heading {
            start.heading
        } else {
            goal.state.heading
        };
        let goal = Pose {
            heading,
            ..goal.state.pose()
        };
        let is_roomy = self.wide.is_free(&start) && self.wide.is_free(&goal);
        let robot = roadmap::Robot {
            space: if is_roomy {
                self.wide.clone()
            } else {
                self.member.space.clone()
            },
            speed: speeds.travel,
            turn_rate: speeds.turn,
            start,
            goal,
        };
        let options = sssp::Options::default();
        let found = Roadmap::connecting(&robot, sampler, &options, more);
        found.map_or_else(Vec::new, |roadmap| roadmap.way(START))
    }

    /// It may rest in this pose as far as what stands is concerned.
    pub fn is_free(&self, pose: &Pose) -> bool {
        self.wide.is_free(pose) || self.member.space.is_free(pose)
    }
}

impl Speeds {
    /// About the time from one pose to another where nothing is in the way.
    pub fn seconds(&self, from: &Pose, to: &Pose) -> f64 {
        let part = |way: f64, speed: f64| {
            if way > 0.0 && speed > 0.0 {
                way / speed
            } else {
                0.0
            }
        };
        let turn = wrapped(to.heading - from.heading).abs();
        part((to.at - from.at).norm(), self.travel) + part(turn, self.turn)
    }

    /// Distance in metres that takes as long as a second.
    pub fn travel(&self) -> f64 {
        self.travel
    }
}

/// A motion from rest to rest.
#[derive(Debug)]
pub struct Edge {
    /// Its controls.
    pub segments: Vec<Segment>,
    /// Its track, from time zero on.
    pub track: Track,
    /// The state that it begins in.
    pub start: State,
    /// The state that it ends in.
    pub end: State,
    /// Its duration.
    pub seconds: f64,
    /// The box in which its body stays.
    pub reach: Rectangle,
}

impl Edge {
    /// Its track when it begins at that time.
    pub fn track_at(&self, departure: f64) -> Track {
        self.track.clone().later(departure)
    }

    /// A place is not nearer than the body comes.
    pub fn may_reach(&self, place: Vector) -> bool {
        self.reach.meets(&Rectangle {
            min: place,
            max: place,
        })
    }
}

/// The body, larger by all that a coarse track may be off.
fn coarse(body: &Body) -> Body {
    body.grown(off(body, COARSE))
}

/// Distance of a point of a body from where a track says that it is, at most.
fn off(body: &Body, chord: f64) -> f64 {
    chord * (1.0 + if body.is_disc() { 0.0 } else { body.radius })
}
