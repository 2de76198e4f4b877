//! Motions of one robot from rest to rest.

use fleetyard_plugin_plane::sssp::bodies::{Leg, Pose, wrapped};

use crate::course::{Course, Segment};
use crate::plugin::Member;
use crate::robot::{Robot, State};
use crate::scene::is_clear;
use crate::steer::steer;

/// Motions of a robot among what stands.
#[derive(Debug)]
pub struct Motions<'a> {
    member: &'a Member,
    /// Seconds for a metre or a radian to each side of every axis, and for a metre any way, where motions are straight.
    straight: Option<([[f64; 2]; 3], f64)>,
    /// Headings of its poses differ.
    pub turns: bool,
}

impl<'a> Motions<'a> {
    /// Of a robot. One that is a disc and turns as it likes turns on its way: its poses have one heading.
    pub fn new(member: &'a Member) -> Self {
        let robot = &member.robot;
        let is_straight = !robot.is_second && !robot.turns_axes;
        let pace = |limits: [f64; 2]| limits.map(|limit| limit.abs().recip());
        let longest = robot.rates[..2]
            .iter()
            .fold(0.0, |longest: f64, [least, most]| {
                longest.max(*most).max(-least)
            });
        let any_way = if robot.polar_rates {
            1.0 / longest
        } else {
            0.0
        };
        Self {
            member,
            straight: is_straight.then(|| (robot.rates.map(pace), any_way)),
            turns: robot.top_turn_rate() > 0.0 && !(is_straight && robot.body.is_disc()),
        }
    }

    /// The robot.
    pub fn robot(&self) -> &'a Robot {
        &self.member.robot
    }

    /// A motion that is clear is so the other way round.
    pub fn is_symmetric(&self) -> bool {
        self.straight.is_some() && self.member.space.body.is_disc()
    }

    /// Metres that count as much as a radian, where poses are compared.
    pub fn lever(&self) -> f64 {
        if self.turns {
            self.robot().top_speed() / self.robot().top_turn_rate()
        } else {
            0.0
        }
    }

    /// Seconds from rest to rest; infinite if limits do not lead there.
    pub fn seconds(&self, from: &Pose, to: &Pose) -> f64 {
        let Some((paces, any_way)) = &self.straight else {
            let segments = self.segments(from, to);
            return segments.map_or(f64::INFINITY, |segments| seconds(&segments));
        };
        let way = to.at - from.at;
        let least = if *any_way > 0.0 {
            way.norm() * any_way
        } else {
            0.0
        };
        let on = |by: f64, [back, ahead]: [f64; 2]| {
            if by > 0.0 {
                by * ahead
            } else if by < 0.0 {
                -by * back
            } else {
                0.0
            }
        };
        let least = least.max(on(way.x, paces[0])).max(on(way.y, paces[1]));
        if self.turns {
            least.max(on(wrapped(to.heading - from.heading), paces[2]))
        } else {
            least
        }
    }

    /// A bound of the seconds from below.
    pub fn bound(&self, from: &Pose, to: &Pose) -> f64 {
        if self.straight.is_some() {
            return self.seconds(from, to);
        }
        let robot = self.robot();
        let drive = (to.at - from.at).norm() / robot.top_speed();
        let turn = if self.turns {
            wrapped(to.heading - from.heading).abs() / robot.top_turn_rate()
        } else {
            0.0
        };
        drive.max(turn)
    }

    /// Controls from rest to rest.
    pub fn segments(&self, from: &Pose, to: &Pose) -> Option<Vec<Segment>> {
        let headings = !self.turns;
        steer(self.robot(), from, to, headings)
    }

    /// A body on its way from pose to pose touches nothing that stands. Where it begins has to be free.
    pub fn is_clear(&self, from: &Pose, to: &Pose) -> bool {
        let space = &self.member.space;
        if self.straight.is_some() {
            let turn = if self.turns {
                wrapped(to.heading - from.heading)
            } else {
                0.0
            };
            return space.is_clear(&Leg {
                from: *from,
                to: Pose {
                    heading: from.heading + turn,
                    ..*to
                },
                duration: 1.0,
            });
        }
        let start = State::rest(from.at, from.heading);
        self.segments(from, to).is_some_and(|segments| {
            is_clear(space, &Course { start, segments }.track(self.robot()))
        })
    }

    /// Controls through poses, from rest to rest, and to a heading in the end; none if its limits do not lead there.
    pub fn course(&self, way: &[Pose], heading: Option<f64>) -> Option<Vec<Segment>> {
        let mut segments = Vec::new();
        for pair in way.windows(2) {
            segments.extend(self.segments(&pair[0], &pair[1])?);
        }
        let last = way.last()?;
        let turn = match heading {
            Some(heading) if !self.turns => wrapped(heading - last.heading),
            _ => 0.0,
        };
        if turn == 0.0 {
            return Some(segments);
        }
        let [least, most] = self.robot().rates[2];
        let top = if turn > 0.0 { most } else { least };
        let (turning, driving) = (turn / top, seconds(&segments));
        if !turning.is_finite() || self.robot().is_second {
            return None;
        }
        let rate = if turning > driving {
            top
        } else {
            turn / driving
        };
        for segment in &mut segments {
            segment.control[2] = rate;
        }
        if turning > driving {
            segments.push(Segment {
                control: [0.0, 0.0, rate],
                seconds: turning - driving,
            });
        }
        Some(segments)
    }

    /// The way without poses that a direct motion makes needless: the fastest over poses of it in their order.
    pub fn shortened(&self, way: &[Pose]) -> Vec<Pose> {
        let mut best = vec![(0.0, 0_usize); way.len()];
        for to in 1..way.len() {
            let direct = |from: usize| best[from].0 + self.seconds(&way[from], &way[to]);
            let mut shortest = (direct(to - 1), to - 1);
            for from in (0..to - 1).rev() {
                let seconds = direct(from);
                if seconds < shortest.0 && self.is_clear(&way[from], &way[to]) {
                    shortest = (seconds, from);
                }
            }
            best[to] = shortest;
        }
        let mut at = way.len() - 1;
        let mut kept = vec![way[at]];
        while at > 0 {
            at = best[at].1;
            kept.push(way[at]);
        }
        kept.reverse();
        kept
    }

    /// Seconds of a way.
    pub fn cost(&self, way: &[Pose]) -> f64 {
        way.windows(2)
            .map(|pair| self.seconds(&pair[0], &pair[1]))
            .sum()
    }
}

/// Seconds of controls.
pub fn seconds(segments: &[Segment]) -> f64 {
    segments.iter().map(|segment| segment.seconds).sum()
}
