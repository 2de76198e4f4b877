//! A kinodynamic RRT of one robot, or of several that move at the same time.
//!
//! S. M. LaValle, J. J. Kuffner, "Randomized kinodynamic planning", IJRR 20(5), 2001. Robots of a tree that have reached their
//! goals rest there.

use fleetyard_plugin_spacetime::random::Random;

use super::drive::Drive;
use super::near::{Found, Near};
use crate::course::{Course, Segment, Track};
use crate::robot::State;
use crate::scene::clash;

/// Axes in which nodes are compared: the first robot's place and heading, and places of others or its rates.
const AXES: usize = 12;

/// No node.
const NONE: u32 = u32::MAX;

/// Choices of a tree.
#[derive(Debug, Clone, Copy)]
pub struct Choices {
    /// Part of the samples that are the goals.
    pub goal_bias: f64,
    /// Longest time that controls are held, in seconds.
    pub longest: f64,
    /// New nodes are led to their goals exactly.
    pub connect: bool,
    /// Most nodes.
    pub room: usize,
}

/// States of all robots at a time.
#[derive(Debug)]
struct Node {
    time: f64,
    parent: u32,
    states: Vec<State>,
    /// Controls from the parent; none of robots that rest at their goals.
    segments: Vec<Option<Segment>>,
    is_done: Vec<bool>,
}

/// The nodes of a search, with what finds those that are near.
#[derive(Debug)]
pub struct Tree {
    near: Near<AXES>,
    nodes: Vec<Node>,
}

/// Courses of robots to their goals, which touch neither what they have to keep clear of nor each other; none if `goes_on` says
/// no before, which is asked before each control. The tree stays behind, in place of the last one: who is out of time
/// has none to free it.
pub fn solve(
    drives: &[Drive<'_>],
    choices: Choices,
    random: &mut Random,
    tree: &mut Option<Tree>,
    goes_on: &mut dyn FnMut() -> bool,
) -> Option<Vec<Course>> {
    let starts: Vec<State> = drives.iter().map(|drive| drive.member.start).collect();
    let rests = |drive: &Drive<'_>, state: &State, time: f64| {
        drive.member.goal.is_reached(state) && drive.may_rest(state, time)
    };
    let root = Node {
        time: 0.0,
        parent: NONE,
        is_done: drives
            .iter()
            .zip(&starts)
            .map(|(drive, start)| rests(drive, start, 0.0))
            .collect(),
        segments: vec![None; drives.len()],
        states: starts,
    };
    let mut joint = Joint {
        drives,
        tree: tree.insert(Tree {
            near: Near::new(drives[0].bounds(), drives[0].round()),
            nodes: Vec::new(),
        }),
    };
    if let Some(courses) = joint.added(root, choices.connect, random) {
        return Some(courses);
    }
    let mut found: Vec<Found> = Vec::new();
    while goes_on() && joint.tree.nodes.len() < choices.room {
        let is_goal = random.share() < choices.goal_bias;
        let sample: Vec<State> = drives
            .iter()
            .map(|drive| {
                if is_goal {
                    drive.goal(random)
                } else {
                    drive.anywhere(random)
                }
            })
            .collect();
        joint
            .tree
            .near
            .nearest(&joint.point(&sample), 1, &mut found);
        let parent = found.first()?.number;
        let from = &joint.tree.nodes[parent as usize];
        let mut segments: Vec<Option<Segment>> = Vec::with_capacity(drives.len());
        let mut seconds = choices.longest * (1.0 - random.share());
        for ((drive, state), is_done) in drives.iter().zip(&from.states).zip(&from.is_done) {
            if *is_done {
                segments.push(None);
                continue;
            }
            let segment = drive.control(state, choices.longest, random);
            if drive.member.robot.is_second {
                seconds = seconds.min(drive.until_limits(state, &segment.control));
            }
            segments.push(Some(segment));
        }
        if seconds <= 0.0 {
            continue;
        }
        for segment in segments.iter_mut().flatten() {
            segment.seconds = seconds;
        }
        if !joint.is_clear(
            from,
            &segments
                .iter()
                .map(|one| one.map_or_else(Vec::new, |one| vec![one]))
                .collect::<Vec<_>>(),
        ) {
            continue;
        }
        let time = from.time + seconds;
        let mut states = from.states.clone();
        let mut is_done = from.is_done.clone();
        for (at, drive) in drives.iter().enumerate() {
            if let Some(segment) = &segments[at] {
                states[at] = drive
                    .member
                    .robot
                    .after(&states[at], &segment.control, seconds);
                is_done[at] = rests(drive, &states[at], time);
            }
        }
        let node = Node {
            time,
            parent,
            states,
            segments,
            is_done,
        };
        if let Some(courses) = joint.added(node, choices.connect, random) {
            return Some(courses);
        }
    }
    None
}

struct Joint<'a> {
    drives: &'a [Drive<'a>],
    tree: &'a mut Tree,
}

impl Joint<'_> {
    fn point(&self, states: &[State]) -> [f64; AXES] {
        let mut point = [0.0; AXES];
        point[..6].copy_from_slice(&self.drives[0].point(&states[0]));
        if states.len() > 1 {
            let others = states[1..]
                .iter()
                .flat_map(|state| [state.at.x, state.at.y]);
            for (number, own) in point[3..].iter_mut().zip(others) {
                *number = own;
            }
        }
        point
    }

    /// Adds a node. The courses over it, if it is the goal or the goal is reached from it.
    fn added(&mut self, node: Node, connect: bool, random: &mut Random) -> Option<Vec<Course>> {
        let number = self.tree.nodes.len() as u32;
        let point = self.point(&node.states);
        let is_goal = node.is_done.iter().all(|is_done| *is_done);
        self.tree.nodes.push(node);
        self.tree.near.insert(point, number);
        if is_goal {
            return Some(self.courses(number));
        }
        if !connect {
            return None;
        }
        let node = &self.tree.nodes[number as usize];
        let mut last = Vec::with_capacity(self.drives.len());
        for ((drive, state), is_done) in self.drives.iter().zip(&node.states).zip(&node.is_done) {
            last.push(if *is_done {
                Vec::new()
            } else {
                drive.connection(state, &drive.goal(random))?
            });
        }
        if !self.is_clear(node, &last) {
            return None;
        }
        let mut courses = self.courses(number);
        for (at, drive) in self.drives.iter().enumerate() {
            let robot = &drive.member.robot;
            let own = Course {
                start: node.states[at],
                segments: last[at].clone(),
            };
            let time = node.time + own.seconds();
            if !node.is_done[at] && !drive.may_rest(&own.end(robot), time) {
                return None;
            }
            courses[at].segments.extend(own.segments);
        }
        Some(courses)
    }

    /// Robots that are driven on from a node touch nothing, and not each other, until the last of them rests.
    fn is_clear(&self, from: &Node, segments: &[Vec<Segment>]) -> bool {
        let alone = |at: usize| {
            segments[at].is_empty()
                || self.drives[at].is_clear(&from.states[at], &segments[at], from.time)
        };
        if !(0..self.drives.len()).all(alone) {
            return false;
        }
        if self.drives.len() < 2 {
            return true;
        }
        let tracks: Vec<Track> = self
            .drives
            .iter()
            .enumerate()
            .map(|(at, drive)| {
                let course = Course {
                    start: from.states[at],
                    segments: segments[at].clone(),
                };
                course.track(&drive.member.robot)
            })
            .collect();
        let end = tracks.iter().map(Track::seconds).fold(0.0, f64::max);
        let body = |at: usize| (&self.drives[at].member.body, &tracks[at]);
        (0..tracks.len()).all(|one| {
            (one + 1..tracks.len()).all(|other| clash(body(one), body(other), 0.0, end).is_none())
        })
    }

    fn courses(&self, number: u32) -> Vec<Course> {
        let mut courses: Vec<Course> = self
            .drives
            .iter()
            .map(|drive| Course::stay(drive.member.start))
            .collect();
        let mut at = number;
        while at != NONE {
            let node = &self.tree.nodes[at as usize];
            for (course, segment) in courses.iter_mut().zip(&node.segments) {
                course.segments.extend(*segment);
            }
            at = node.parent;
        }
        for course in &mut courses {
            course.segments.reverse();
        }
        courses
    }
}
