//! Moves that were found one after the other, at once: fewer of them, and each as early as the order lets it.
//!
//! The paper makes a temporal plan graph of the moves (W. Hönig and others, ICAPS 2016): a move waits for those before it in the
//! order whose sweep meets its own. Here it waits only until it can follow: two moves have a delay from which on they do not
//! touch any more ([`bodies::delays`](super::bodies::delays)), so that a robot drives behind another one. A robot that rests
//! needs no constraint of its own. Whoever passes its place before it comes, or after it left, meets its first or its last
//! moment there within the move to or from it.

use super::bodies::{Pose, delays, hits};
use super::roadmap::Robot;
use super::search::Move;

/// A robot's poses, with the times at which it comes and leaves.
#[derive(Debug, Clone, PartialEq)]
pub struct Course {
    /// The poses; headings are within half a turn of those before.
    pub way: Vec<Pose>,
    /// Seconds of arrival and departure at each; it stays at the last for ever.
    pub times: Vec<[f64; 2]>,
}

impl Course {
    /// Stays where it is.
    pub fn staying(at: Pose) -> Self {
        Self {
            way: vec![at],
            times: vec![[0.0, f64::INFINITY]],
        }
    }

    /// Seconds at which it comes to its last pose.
    pub fn arrival(&self) -> f64 {
        self.times[self.times.len() - 1][0]
    }
}

/// Leaves out poses where a robot can go straight on, as long as the order of all other moves stays.
pub fn shorten(robots: &[Robot], moves: &mut Vec<Move>, stop: &mut dyn FnMut() -> bool) {
    for robot in 0..robots.len() {
        let mut first = 0;
        loop {
            let own: Vec<usize> = (0..moves.len())
                .filter(|place| moves[*place].robot == robot)
                .collect();
            if first + 1 >= own.len() || stop() {
                break;
            }
            let joined = (first + 1..own.len()).rev().find_map(|last| {
                let gone = &own[first..=last];
                join(robots, moves, gone).map(|(place, joined)| (gone, place, joined))
            });
            match joined {
                Some((gone, place, joined)) => {
                    moves[place] = joined;
                    let mut at = 0..;
                    moves.retain(|each| {
                        let at = at.next();
                        let is_joined = at == Some(place) && each.leg.duration > 0.0;
                        is_joined || !gone.iter().any(|gone| at == Some(*gone))
                    });
                }
                None => first += 1,
            }
        }
    }
}

/// One move instead of several of the same robot, at the place of the first or the last of them.
fn join(robots: &[Robot], moves: &[Move], own: &[usize]) -> Option<(usize, Move)> {
    let (first, last) = (own[0], own[own.len() - 1]);
    let robot = moves[first].robot;
    let (from, to) = (moves[first].leg.from, moves[last].leg.to);
    if !robots[robot].connects(from, to) {
        return None;
    }
    let leg = robots[robot].leg(from, to);
    let body = |robot: usize| &robots[robot].space.body;
    [(last, from), (first, to)]
        .into_iter()
        .find_map(|(place, waits)| {
            // While others move it is where it begins, or already where it ends.
            let between = moves[first + 1..last].iter();
            let passed = between
                .filter(|other| other.robot != robot)
                .any(|other| hits(body(other.robot), &other.leg, body(robot), &waits));
            if passed {
                return None;
            }
            let at = positions(robots, &moves[..place]);
            let blocked = at
                .iter()
                .enumerate()
                .any(|(other, pose)| other != robot && hits(body(robot), &leg, body(other), pose));
            (!blocked).then_some((place, Move { robot, leg }))
        })
}

/// The poses of all robots after these moves.
fn positions(robots: &[Robot], moves: &[Move]) -> Vec<Pose> {
    let mut at: Vec<Pose> = robots.iter().map(|robot| robot.start).collect();
    for each in moves {
        at[each.robot] = each.leg.to;
    }
    at
}

/// The moves as early as they can be when those that meet keep their order.
pub fn schedule(robots: &[Robot], moves: &[Move]) -> Vec<Course> {
    let mut courses: Vec<Course> = robots
        .iter()
        .map(|robot| Course::staying(robot.start))
        .collect();
    let mut begins: Vec<f64> = Vec::with_capacity(moves.len());
    for (number, each) in moves.iter().enumerate() {
        let body = &robots[each.robot].space.body;
        let course = &mut courses[each.robot];
        let mut begin = course.arrival();
        for (other, at) in moves[..number].iter().zip(&begins) {
            // Whoever is done by then is no hindrance.
            if other.robot != each.robot && at + other.leg.duration > begin {
                let other_body = &robots[other.robot].space.body;
                if let Some(span) = delays(other_body, &other.leg, body, &each.leg) {
                    begin = begin.max(at + span.high);
                }
            }
        }
        begins.push(begin);
        if let (Some(times), Some(last)) = (course.times.last_mut(), course.way.last()) {
            times[1] = begin;
            let to = Pose {
                heading: last.heading + each.leg.to.heading - each.leg.from.heading,
                ..each.leg.to
            };
            course.way.push(to);
        }
        let end = begin + each.leg.duration;
        course.times.push([end, f64::INFINITY]);
    }
    courses
}
