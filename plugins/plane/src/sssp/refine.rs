//! Better ways and times after the first plan, a few robots at a time.
//!
//! The paper smooths ways by shortcuts and makes the temporal plan graph anew until that changes nothing. Here a few robots give
//! up their times at once; each gets the best of some ways amid those that keep theirs: its own, a shortest one, and the same with
//! shortcuts and detours, as early as safe intervals let it ([`crate::timing`]). Where the sum of arrivals grows all is as before
//! (large neighbourhood search: J. Li and others, IJCAI 2021).

use std::cell::OnceCell;
use std::f64::consts::PI;
use std::iter::zip;

use fleetyard_plugin_spacetime::random::Random;

use super::bodies::{Body, Leg, Pose, delays, near};
use super::order::Course;
use super::roadmap::{Roadmap, Robot, START};
use crate::Vector;
use crate::obstacles::Disc;
use crate::orders::{Attempt, End, try_orders};
use crate::spans::Spans;
use crate::tangent::Tangents;
use crate::timing::earliest_times;

/// A body that gives way to nobody.
#[derive(Debug, Clone)]
pub struct Moving {
    /// Its body.
    pub body: Body,
    /// Its poses and times.
    pub course: Course,
}

/// Most robots that give up their times at once.
const MOST: usize = 6;

/// Gains below this are rounding, in seconds.
const LEAST: f64 = 1e-9;

/// Tells ways of robots that meet from those that do not matter, by this many of the nearest.
const NEIGHBOURS: usize = 24;

/// Ways and times of a team.
pub struct Refiner<'a> {
    robots: &'a [Robot],
    moving: &'a [Moving],
    /// The shortest way of each robot that is known, as if it was alone.
    shortest: Vec<Vec<Pose>>,
    /// No arrival is earlier, in seconds.
    bounds: Vec<f64>,
    /// Robots whose shortest ways meet that of each, made when it is asked for.
    neighbours: Vec<OnceCell<Vec<u32>>>,
    courses: Vec<Course>,
    random: Random,
}

impl<'a> Refiner<'a> {
    /// Of a plan.
    pub fn new(
        robots: &'a [Robot],
        roadmaps: &[Roadmap],
        moving: &'a [Moving],
        courses: Vec<Course>,
        seed: u64,
        stop: &mut dyn FnMut() -> bool,
    ) -> Self {
        let (mut shortest, mut bounds) = (Vec::new(), Vec::new());
        for (robot, roadmap) in zip(robots, roadmaps) {
            let straight = robot.leg(robot.start, robot.goal).duration;
            let way = robot.space.of_disc().and_then(|obstacles| {
                Tangents::new(obstacles).shortest(robot.start.at, robot.goal.at, stop)
            });
            if let Some(way) = way {
                bounds.push(way.length / robot.speed);
                shortest.push(way.places.into_iter().map(on_plane).collect());
            } else {
                bounds.push(straight);
                shortest.push(pulled(robot, &roadmap.way(START)));
            }
        }
        Self {
            neighbours: vec![OnceCell::new(); robots.len()],
            random: Random::new(seed, 1),
            robots,
            moving,
            shortest,
            bounds,
            courses,
        }
    }

    /// The ways and times.
    pub fn courses(&self) -> &[Course] {
        &self.courses
    }

    /// The sum of arrivals in seconds, and a bound below it.
    pub fn sums(&self) -> [f64; 2] {
        let arrivals = self.courses.iter().map(Course::arrival);
        [arrivals.sum(), self.bounds.iter().sum()]
    }

    /// Nothing is left to gain.
    pub fn is_done(&self) -> bool {
        let [sum, bound] = self.sums();
        sum <= bound + 1e-6 * (1.0 + bound)
    }

    /// Times of all robots anew, in some order of priority, so that they give way to what moves as well; false if there are
    /// none on these ways and those that are tried beside them.
    pub fn give_way(&mut self, orders: u64, seed: u64, stop: &mut dyn FnMut() -> bool) -> bool {
        let team = self.robots.len();
        let first = (0..team as u32).collect();
        let kept = self.courses.clone();
        let (end, _) = try_orders(first, orders, seed, |order| {
            let mut away: Vec<usize> = order.iter().map(|robot| *robot as usize).collect();
            away.reverse();
            while let Some(robot) = away.pop() {
                if stop() {
                    return Attempt::Stopped;
                }
                let mut others = away.clone();
                others.push(robot);
                match self.best(robot, &kept[robot].way, &others) {
                    Some(course) => self.courses[robot] = course,
                    None => return Attempt::Blocked(team - 1 - away.len()),
                }
            }
            Attempt::Solved(())
        });
        end == End::Solved(())
    }

    /// One attempt to bring a few robots to their goals earlier; true where that changed the plan. Says how many were planned
    /// anew.
    pub fn attempt(&mut self) -> (bool, u64) {
        let mut away = self.choose();
        let count = away.len() as u64;
        let before: Vec<Course> = away
            .iter()
            .map(|robot| self.courses[*robot].clone())
            .collect();
        let chosen = away.clone();
        self.random.shuffle(&mut away);
        let old: f64 = before.iter().map(Course::arrival).sum();
        let old_length: f64 = before.iter().map(length).sum();
        let (mut new, mut new_length) = (0.0, 0.0);
        while let Some(robot) = away.last().copied() {
            let way = std::mem::take(&mut self.courses[robot].way);
            let best = self.best(robot, &way, &away);
            self.courses[robot].way = way;
            away.pop();
            let bound: f64 = away.iter().map(|robot| self.bounds[*robot]).sum();
            match best {
                Some(course) if new + course.arrival() + bound <= old + LEAST => {
                    new += course.arrival();
                    new_length += length(&course);
                    self.courses[robot] = course;
                }
                _ => {
                    new = f64::INFINITY;
                    break;
                }
            }
        }
        // A shorter way without a gain leaves room for others.
        let gains = new < old - LEAST || (new <= old && new_length < old_length - LEAST);
        if !gains {
            for (robot, course) in zip(chosen, before) {
                self.courses[robot] = course;
            }
        }
        (gains, count)
    }

    /// A robot that is late, and some of those that its way meets.
    fn choose(&mut self) -> Vec<usize> {
        let team = self.robots.len();
        let late = |robot: &usize| self.courses[*robot].arrival() - self.bounds[*robot];
        let drawn: Vec<usize> = (0..3).map(|_| self.random.below(team)).collect();
        let first = drawn.into_iter().max_by(|a, b| late(a).total_cmp(&late(b)));
        let mut chosen: Vec<usize> = first.into_iter().collect();
        let count = if self.random.one_in(2) {
            1
        } else {
            2 + self.random.below(MOST - 1)
        };
        let Some(first) = first else {
            return chosen;
        };
        let met =
            self.neighbours[first].get_or_init(|| neighbours(self.robots, &self.shortest, first));
        let mut met: Vec<usize> = met.iter().map(|robot| *robot as usize).collect();
        self.random.shuffle(&mut met);
        met.push(self.random.below(team));
        for other in met {
            if chosen.len() < count && !chosen.contains(&other) {
                chosen.push(other);
            }
        }
        chosen
    }

    /// The earliest course of a robot on its way and some others, amid those that are not away.
    fn best(&mut self, robot: usize, way: &[Pose], away: &[usize]) -> Option<Course> {
        let shortest = &self.shortest[robot];
        let mut ways = vec![way.to_vec()];
        if shortest != way {
            ways.push(shortest.clone());
        }
        let own = &self.robots[robot];
        for _ in 0..2 {
            let from = &ways[self.random.below(ways.len())];
            let changed = match self.random.below(4) {
                0 => detour(own, from, &mut self.random),
                1 => around(self.robots, robot, away, &mut self.random),
                _ => shortcut(own, from, &mut self.random),
            };
            ways.extend(changed);
        }
        let mut best: Option<Course> = None;
        for way in ways {
            let Some(course) = self.timed(robot, way, away) else {
                continue;
            };
            let better = best.as_ref().is_none_or(|best| {
                let gain = best.arrival() - course.arrival();
                gain > LEAST || (gain >= 0.0 && length(&course) < length(best))
            });
            if better {
                best = Some(course);
            }
        }
        best
    }

    /// The earliest times on a way amid those that are not away.
    fn timed(&self, robot: usize, way: Vec<Pose>, away: &[usize]) -> Option<Course> {
        let (robots, own) = (self.robots, &self.robots[robot]);
        let others = self.courses.iter().enumerate();
        let others = others.filter(|(other, _)| !away.contains(other));
        let others = others.map(|(other, course)| (&robots[other].space.body, course));
        let moving = self.moving.iter();
        let moving = moving.map(|moving| (&moving.body, &moving.course));
        let others: Vec<(&Body, f64, Leg)> = others
            .chain(moving)
            .flat_map(|(body, course)| legs(course).map(move |(begin, leg)| (body, begin, leg)))
            .collect();
        let body = &own.space.body;
        let taken = way.iter().map(|pose| {
            let mut taken = Spans::new();
            for (other, begin, leg) in &others {
                if let Some(span) = near(other, leg, body, pose) {
                    taken.insert(span.after(*begin));
                }
            }
            taken
        });
        let taken: Vec<Spans> = taken.collect();
        let times = earliest_times(&taken, |number| {
            let own_leg = own.leg(way[number], way[number + 1]);
            let mut forbidden = Spans::new();
            for (other, begin, leg) in &others {
                if let Some(span) = delays(other, leg, body, &own_leg) {
                    forbidden.insert(span.after(*begin));
                }
            }
            (own_leg.duration, forbidden)
        })?;
        Some(Course { way, times })
    }
}

/// A disc has no heading.
fn on_plane(at: Vector) -> Pose {
    Pose { at, heading: 0.0 }
}

fn length(course: &Course) -> f64 {
    let legs = course.way.windows(2);
    legs.map(|leg| (leg[1].at - leg[0].at).norm()).sum()
}

/// The motions of a course and its rests, with the seconds at which they begin.
fn legs(course: &Course) -> impl Iterator<Item = (f64, Leg)> {
    let rests = zip(&course.way, &course.times).filter_map(|(pose, [arrival, departure])| {
        let seconds = departure - arrival;
        (seconds > 0.0).then(|| (*arrival, Leg::rest(*pose, seconds)))
    });
    let legs = zip(course.way.windows(2), course.times.windows(2)).map(|(poses, times)| {
        let leg = Leg {
            from: poses[0],
            to: poses[1],
            duration: times[1][0] - times[0][1],
        };
        (times[0][1], leg)
    });
    rests.chain(legs)
}

/// Robots whose shortest ways meet that of one.
fn neighbours(robots: &[Robot], ways: &[Vec<Pose>], robot: usize) -> Vec<u32> {
    let legs = |robot: usize| {
        let legs = ways[robot].windows(2);
        legs.map(move |leg| robots[robot].leg(leg[0], leg[1]))
    };
    let body = |robot: usize| &robots[robot].space.body;
    let meets = |other: &usize| {
        *other != robot
            && legs(robot).any(|own| {
                legs(*other).any(|leg| {
                    let distance = body(robot).radius + body(*other).radius;
                    own.motion().overlap(&leg.motion(), distance).is_some()
                })
            })
    };
    let met = (0..robots.len()).filter(meets).map(|other| other as u32);
    met.take(NEIGHBOURS).collect()
}

/// A way without poses that are not needed: from each as far as it goes straight.
fn pulled(robot: &Robot, way: &[Pose]) -> Vec<Pose> {
    let mut pulled = vec![way[0]];
    let mut at = 0;
    while at + 1 < way.len() {
        let from = pulled[pulled.len() - 1];
        let far = (at + 2..way.len()).rev();
        at = far
            .into_iter()
            .find(|to| robot.connects(from, way[*to]))
            .unwrap_or(at + 1);
        pulled.push(robot.leg(from, way[at]).to);
    }
    pulled
}

/// The same poses, each within half a turn of the one before. Of poses that differ by rounding one is left.
fn aligned(robot: &Robot, way: impl IntoIterator<Item = Pose>) -> Vec<Pose> {
    let mut aligned: Vec<Pose> = Vec::new();
    for pose in way {
        let Some(last) = aligned.last() else {
            aligned.push(pose);
            continue;
        };
        let leg = robot.leg(*last, pose);
        if leg.duration >= LEAST {
            aligned.push(leg.to);
        } else if aligned.len() > 1 {
            // The goal is met exactly, and so is the start.
            aligned.pop();
            aligned.push(leg.to);
        }
    }
    aligned
}

/// A way that goes straight between two of its places, if it can.
fn shortcut(robot: &Robot, way: &[Pose], random: &mut Random) -> Option<Vec<Pose>> {
    if way.len() < 3 {
        return None;
    }
    let mut legs = [0; 2].map(|_| random.below(way.len() - 1));
    legs.sort_unstable();
    let [first, last] = legs;
    if first == last {
        return None;
    }
    let mut on = |leg: usize, at: usize| {
        if random.one_in(2) {
            way[at]
        } else {
            way[leg].toward(&way[leg + 1], random.share())
        }
    };
    let (from, to) = (on(first, first), on(last, last + 1));
    robot.connects(from, to).then(|| {
        let before = way[..=first].iter().copied();
        let after = way[last + 1..].iter().copied();
        aligned(robot, before.chain([from, to]).chain(after))
    })
}

/// A way with a pose more, a few radii beside it.
fn detour(robot: &Robot, way: &[Pose], random: &mut Random) -> Option<Vec<Pose>> {
    if way.len() < 2 {
        return None;
    }
    let leg = random.below(way.len() - 1);
    let (from, to) = (way[leg], way[leg + 1]);
    let mut beside = from.toward(&to, random.share());
    let reach = 8.0 * robot.space.body.radius;
    let offset = Vector::new(random.share() - 0.5, random.share() - 0.5);
    beside.at += offset * reach;
    if robot.has_heading() {
        beside.heading += PI * (random.share() - 0.5);
    }
    (robot.connects(from, beside) && robot.connects(beside, to)).then(|| {
        let (before, after) = way.split_at(leg + 1);
        let before = before.iter().copied().chain([beside]);
        aligned(robot, before.chain(after.iter().copied()))
    })
}

/// The shortest way of a disc round the goals of all others, of those that are away only some.
fn around(
    robots: &[Robot],
    robot: usize,
    away: &[usize],
    random: &mut Random,
) -> Option<Vec<Pose>> {
    let own = &robots[robot];
    let obstacles = own.space.of_disc()?;
    let others = robots.iter().enumerate();
    let others =
        others.filter(|(other, _)| *other != robot && (!away.contains(other) || random.one_in(2)));
    let parked = others.map(|(_, other)| Disc {
        at: other.goal.at,
        radius: other.space.body.radius,
    });
    let obstacles = obstacles.with_more_discs(parked);
    let mut tangents = Tangents::new(&obstacles);
    let way = tangents.shortest(own.start.at, own.goal.at, &mut || false)?;
    Some(way.places.into_iter().map(on_plane).collect())
}
